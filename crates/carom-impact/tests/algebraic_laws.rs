//! The laws of Chatterjee and Ruina, Brach, and Smith, against their definitions.

use crate::common::{any_case, close};
use carom_impact::{
    Brach, ChatterjeeRuina, Coefficients, Flags, Frictionless, ImpactProblem, Law, Mode, Smith, Whittaker, law_by_name,
};
use nalgebra::{Matrix3, Vector3, matrix, vector};

/// Kane and Levinson's double pendulum.
fn pendulum() -> ImpactProblem<f64, 2> {
    ImpactProblem::new(
        matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504],
        vector![-0.267174342835, -0.134202014333],
    )
    .unwrap()
}

#[test]
fn pendulum_has_the_reference_digits_under_chatterjee_and_ruina() {
    for (restitution, tangential_restitution, ratio) in [
        (0.5, 0.0, 0.562430),
        (0.5, 0.5, 0.562430), // limited by the cone
        (0.7, 0.0, 0.636471),
        (1.0, 0.0, 0.805939),
        (0.5, -1.0, 0.711413), // frictionless
    ] {
        let hit = ChatterjeeRuina { restitution, tangential_restitution, friction: 0.5 }.resolve(&pendulum()).unwrap();
        close("T+/T-", hit.energy_ratio(), ratio, 5e-7);
        if restitution == 0.5 && tangential_restitution >= 0.0 {
            close("P", (hit.impulse - vector![0.056858, 0.113717]).amax(), 0.0, 5e-7);
            close("u+", (hit.u_plus - vector![0.044578, 0.067101]).amax(), 0.0, 5e-7);
        }
    }
}

#[test]
fn pendulum_has_the_reference_digits_under_smith() {
    for (restitution, ratio) in [(0.5, 0.566774), (0.7, 0.654202), (1.0, 0.864443)] {
        let hit = Smith { restitution, friction: 0.5 }.resolve(&pendulum()).unwrap();
        close("T+/T-", hit.energy_ratio(), ratio, 5e-7);
        if restitution == 0.5 {
            close("u+", (hit.u_plus - vector![0.044315, 0.067101]).amax(), 0.0, 5e-7);
        }
    }
}

/// The critical ratio would gain energy here, so the energy bound applies. Inertial coupling reverses the slip, which
/// is along -t, so only a ratio along it is opposed to the final slip.
#[test]
fn pendulum_has_the_reference_digits_under_brach() {
    for (restitution, bound) in [(0.5, 0.274131), (0.7, 0.201101)] {
        let hit = Brach { restitution, impulse_ratio: 0.5 }.resolve(&pendulum()).unwrap();
        close("ratio", hit.impulse[0] / hit.impulse[1], -bound, 5e-7);
        close("T+/T-", hit.energy_ratio(), 1.0, 1e-14);
        assert!(!hit.flags.contains(Flags::ENERGY_GAIN));
        // A smaller ratio is not clipped; one against the initial slip is clipped to 0.
        let hit = Brach { restitution, impulse_ratio: 0.1 }.resolve(&pendulum()).unwrap();
        close("ratio", hit.impulse[0] / hit.impulse[1], -0.1, 1e-15);
        let hit = Brach { restitution, impulse_ratio: -0.1 }.resolve(&pendulum()).unwrap();
        assert_eq!(hit.impulse[0], 0.0);
        // By name friction acts towards rest.
        let coefficients = Coefficients { restitution, friction: 0.5, ..Default::default() };
        let named = law_by_name::<2>("brach", coefficients).unwrap().resolve(&pendulum()).unwrap();
        close("ratio by name", named.impulse[0] / named.impulse[1], -bound, 5e-7);
    }
    // If the critical ratio gains no energy it is the bound, and the contact sticks.
    let (h, u) = (*pendulum().delassus(), vector![0.267, -0.134]);
    let hit = Brach { restitution: 0.0, impulse_ratio: -100.0 }.resolve(&ImpactProblem::new(h, u).unwrap()).unwrap();
    let stick = h.try_inverse().unwrap() * -u;
    close("P", (hit.impulse - stick).amax(), 0.0, 1e-14);
    assert_eq!(hit.mode, Mode::Stick);
}

/// The formula, with inverted matrices, over regular problems in space.
#[test]
fn chatterjee_and_ruina_agree_with_the_formula() {
    let mut rng = fastrand::Rng::with_seed(21);
    let mut on_cone = 0;
    for _ in 0..10_000 {
        let case = crate::common::any_spatial(&mut rng, 0.1);
        let (h, u, mu, e) = (case.delassus, case.u, case.friction, case.restitution);
        let e_t = 2.0 * rng.f64() - 1.0;
        let p1 = Vector3::new(0.0, 0.0, -u.z / h[(2, 2)]);
        let p2 = h.try_inverse().unwrap() * -u;
        let mut p = p1 * (1.0 + e) + (p2 - p1) * (1.0 + e_t);
        if p.xy().norm() > mu * p.z {
            on_cone += 1;
            let kappa = mu * (1.0 + e) * p1.z / (p2.xy().norm() - mu * (p2 - p1).z);
            p = p1 * (1.0 + e) + (p2 - p1) * kappa;
        }
        let law = ChatterjeeRuina { restitution: e, tangential_restitution: e_t, friction: mu };
        let hit = law.resolve(&case.problem()).unwrap();
        close("P", (hit.impulse - p).norm(), 0.0, 1e-11 * p.norm());
        close("u+", (hit.u_plus - u - h * p).norm(), 0.0, 1e-11 * (1.0 + p.norm()));
    }
    assert!((2_000..8_000).contains(&on_cone), "{on_cone}");
}

/// In the plane v_t⁺ decreases with w, and w grows with v_t⁺: bisection finds the one solution.
#[test]
fn smith_agrees_with_bisection_in_the_plane() {
    let mut rng = fastrand::Rng::with_seed(22);
    for _ in 0..20_000 {
        let case = any_case(&mut rng, 0.1);
        let (h, u, mu) = (case.delassus, case.u, case.friction);
        let gain = -(1.0 + case.restitution) * u[1];
        let normal = |w: f64| gain / (h[(1, 1)] - mu * w * h[(0, 1)]);
        let end = |w: f64| u[0] + (h[(0, 1)] - mu * w * h[(0, 0)]) * normal(w);
        let mean = |y: f64| (u[0].abs() * u[0] + y.abs() * y) / (u[0] * u[0] + y * y);
        let (mut low, mut high) = (-1.0, 1.0);
        let jam = h[(1, 1)] / (mu * h[(0, 1)]);
        if jam.abs() < 1.0 {
            if jam > 0.0 { high = jam } else { low = jam }
        }
        for _ in 0..200 {
            let w = 0.5 * (low + high);
            if w < mean(end(w)) { low = w } else { high = w }
        }
        let w = 0.5 * (low + high);
        let hit = Smith { restitution: case.restitution, friction: mu }.resolve(&case.problem()).unwrap();
        // Near C = μ w B the bisection's own P_n has a large rounding error.
        let within = 1e-11 * (1.0 + mu) * (1.0 + hit.impulse.norm()) / u[0].abs().min(1.0);
        close("v_t+", hit.u_plus[0], end(w), within);
    }
}

/// Without slip before, friction is opposed to the slip after, which is Whittaker's law.
#[test]
fn smith_without_slip_before_is_whittaker() {
    let mut rng = fastrand::Rng::with_seed(23);
    for _ in 0..1000 {
        let mut case = any_case(&mut rng, 0.1);
        case.u[0] = 0.0;
        let (restitution, friction) = (case.restitution, case.friction);
        let smith = Smith { restitution, friction }.resolve(&case.problem()).unwrap();
        let whittaker = Whittaker { restitution, friction }.resolve(&case.problem()).unwrap();
        close("u+", (smith.u_plus - whittaker.u_plus).norm(), 0.0, 1e-13 * (1.0 + smith.u_plus.norm()));
    }
}

/// Brach's clipping against a scan: among the ratios between 0 and the prescribed one, his is the last admissible.
#[test]
fn brach_agrees_with_a_scan_of_the_ratios() {
    let mut rng = fastrand::Rng::with_seed(24);
    let mut clipped = 0;
    for _ in 0..5_000 {
        let case = crate::common::any_spatial(&mut rng, 0.1);
        let (h, u, e) = (case.delassus, case.u, case.restitution);
        let t = u.xy().normalize();
        let asked = 3.0 * (2.0 * rng.f64() - 1.0);
        let hit = Brach { restitution: e, impulse_ratio: asked }.resolve(&case.problem()).unwrap();
        let ratio = hit.impulse.xy().dot(&t) / hit.impulse.z;
        close("along t", (hit.impulse.xy() - t * (ratio * hit.impulse.z)).norm(), 0.0, 1e-13 * hit.impulse.norm());
        let d = |r: f64| Vector3::new(r * t.x, r * t.y, 1.0);
        // Ends with slip against the friction, and without gain.
        let admissible = |r: f64| {
            let p = d(r) * (-(1.0 + e) * u.z / (h * d(r)).z);
            let end = u + h * p;
            p.z > 0.0
                && r * end.xy().dot(&t) <= 1e-10 * end.norm()
                && p.dot(&(u + end)) <= 1e-10 * p.norm() * end.norm()
        };
        assert!(admissible(ratio), "{case:?} {ratio}");
        if (ratio - asked).abs() > 1e-9 {
            clipped += 1;
            assert!(!admissible(ratio + 1e-3 * (asked - ratio)), "{case:?}: {ratio} for {asked}");
        }
        assert!(ratio * asked >= 0.0 && ratio.abs() <= asked.abs() + 1e-12);
    }
    assert!(clipped > 1000, "{clipped}");
}

#[test]
fn spheres_in_space_have_their_closed_forms() {
    let h = Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    let problem = ImpactProblem::new(h, vector![0.6, -0.8, -1.0]).unwrap();
    for (law, v_t) in [
        (Box::new(Brach { restitution: 0.8, impulse_ratio: -0.1 }) as Box<dyn Law<f64, 3>>, 0.37),
        (Box::new(Brach { restitution: 0.8, impulse_ratio: -0.5 }), 0.0),
        (Box::new(Smith { restitution: 0.8, friction: 0.1 }), 0.37),
        (Box::new(ChatterjeeRuina { restitution: 0.8, tangential_restitution: 0.3, friction: 0.1 }), 0.37),
        (Box::new(ChatterjeeRuina { restitution: 0.8, tangential_restitution: 0.3, friction: 1.0 }), -0.3),
        (Box::new(ChatterjeeRuina { restitution: 0.8, tangential_restitution: 0.0, friction: 1.0 }), 0.0),
    ] {
        let hit = law.resolve(&problem).unwrap();
        close(law.name(), (hit.u_plus - vector![0.6 * v_t, -0.8 * v_t, 0.8]).norm(), 0.0, 1e-15);
        assert_eq!(hit.mode == Mode::Stick, v_t == 0.0);
    }
    // Dropped vertically there is no slip.
    let straight = ImpactProblem::new(h, vector![0.0, 0.0, -1.0]).unwrap();
    for law in ["chatterjee-ruina", "brach", "smith"] {
        let hit = carom_impact::law_by_name(law, crate::common::rough(0.8, 0.5)).unwrap().resolve(&straight).unwrap();
        assert_eq!((hit.u_plus, hit.mode), (vector![0.0, 0.0, 0.8], Mode::Stick), "{law}");
    }
}

/// Planar arms in space have no inverse mass across their plane: H of rank 2, or 1 with a single joint.
#[test]
fn planar_arms_in_space_agree_with_the_plane() {
    let arm = matrix![0.8, 0.3; 0.0, 0.0; -0.2, 0.9];
    let h = arm * arm.transpose();
    let u = arm * vector![-0.4, -1.1];
    let problem = ImpactProblem::new(h, u).unwrap();
    let plane = ImpactProblem::new(matrix![h[(0, 0)], h[(0, 2)]; h[(0, 2)], h[(2, 2)]], vector![u[0], u[2]]).unwrap();
    for law in ["chatterjee-ruina", "brach", "smith"] {
        for mu in [0.1, 0.5, 2.0] {
            let coefficients = crate::common::rough(0.5, mu);
            let three = carom_impact::law_by_name(law, coefficients).unwrap().resolve(&problem).unwrap();
            let two = carom_impact::law_by_name(law, coefficients).unwrap().resolve(&plane).unwrap();
            close(law, (three.u_plus - vector![two.u_plus[0], 0.0, two.u_plus[1]]).norm(), 0.0, 1e-14);
            close(law, (three.impulse - vector![two.impulse[0], 0.0, two.impulse[1]]).norm(), 0.0, 1e-14);
            assert_eq!(three.flags, Flags::NONE);
        }
    }
    // No impulse changes the slip across the plane, so friction slides along it: the limit for a small inverse mass.
    let across = ImpactProblem::new(h, u + vector![0.0, 0.7, 0.0]).unwrap();
    let law = ChatterjeeRuina { restitution: 0.5, tangential_restitution: 0.0, friction: 5.0 };
    let hit = law.resolve(&across).unwrap();
    assert_eq!(hit.u_plus[1], 0.7);
    close("friction across the plane", hit.impulse[1], -5.0 * hit.impulse[2], 1e-13);
    close("friction in the plane", hit.impulse[0], 0.0, 1e-13);
    // A single joint, turned out of every axis.
    let j = vector![0.3, -0.5, 0.7];
    let single = ImpactProblem::new(j * j.transpose(), -j).unwrap();
    let smooth = Frictionless { restitution: 0.5 }.resolve(&single).unwrap();
    let hit = law.resolve(&single).unwrap();
    close("u+", (hit.u_plus - smooth.u_plus).norm(), 0.0, 1e-15);
    assert!(hit.flags.contains(Flags::SINGULAR));
}

/// Slow slip, grazing approach, ill-conditioned matrices: a solution everywhere, and it satisfies the law.
#[test]
fn smith_satisfies_its_law_in_extreme_cases_in_space() {
    let mut rng = fastrand::Rng::with_seed(25);
    let mut compared = 0;
    for i in 0..30_000 {
        let mut case = crate::common::any_spatial(&mut rng, [0.3, 0.05, 0.003][i % 3]);
        let small = 10.0_f64.powi(-rng.i32(0..17));
        if rng.bool() {
            (case.u.x, case.u.y) = (case.u.x * small, case.u.y * small);
        } else {
            case.u.z *= small;
        }
        let mu = case.friction;
        let hit = Smith { restitution: case.restitution, friction: mu }.resolve(&case.problem()).unwrap();
        assert!(!hit.flags.contains(Flags::ENERGY_GAIN), "{case:?}");
        let (v, y) = (case.u.xy(), hit.u_plus.xy());
        let w = (v * v.norm() + y * y.norm()) / (v.norm_squared() + y.norm_squared());
        let off = (hit.impulse.xy() + w * (mu * hit.impulse.z)).norm();
        // Rounding of the slips changes w by 1/|v|.
        if v.norm() > 1e-6 {
            let rounding = 1e-13 / v.norm().min(1.0) + 1e-12;
            assert!(off <= rounding * (1.0 + mu) * (1.0 + hit.impulse.norm()), "{off:e} {case:?}");
            compared += 1;
        }
    }
    assert!(compared > 20_000, "{compared}");
}

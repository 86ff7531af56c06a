//! The laws of Chatterjee and Ruina, Brach, and Smith, against their definitions.

use crate::common::{any_case, any_spatial, close, pendulum};
use carom_impact::{
    Brach, ChatterjeeRuina, Coefficients, Flags, Frictionless, ImpactProblem, Law, Mode, Smith, Whittaker, law_by_name,
};
use nalgebra::{Matrix3, Vector3, matrix, vector};

/// Coefficients, T⁺/T⁻, and the velocity after the impact where it is known.
#[test]
fn pendulum_has_the_reference_digits_under_chatterjee_and_ruina_and_smith() {
    let friction = 0.5;
    let limited = Some([0.044578, 0.067101]);
    for (law, restitution, tangential_restitution, ratio, u_plus) in [
        ("chatterjee-ruina", 0.5, 0.0, 0.562430, limited),
        ("chatterjee-ruina", 0.5, 0.5, 0.562430, limited), // by the cone
        ("chatterjee-ruina", 0.7, 0.0, 0.636471, None),
        ("chatterjee-ruina", 1.0, 0.0, 0.805939, None),
        ("chatterjee-ruina", 0.5, -1.0, 0.711413, None), // frictionless
        ("smith", 0.5, 0.0, 0.566774, Some([0.044315, 0.067101])),
        ("smith", 0.7, 0.0, 0.654202, None),
        ("smith", 1.0, 0.0, 0.864443, None),
    ] {
        let given = Coefficients { restitution, tangential_restitution, friction };
        let hit = law_by_name::<2>(law, given).unwrap().resolve(&pendulum()).unwrap();
        let told = format!("{law} e {restitution} e_t {tangential_restitution}");
        close(&told, hit.energy_ratio(), ratio, 5e-7);
        if let Some([v_t, v_n]) = u_plus {
            close(&told, (hit.u_plus - vector![v_t, v_n]).amax(), 0.0, 5e-7);
        }
        if u_plus == limited {
            close(&told, (hit.impulse - vector![0.056858, 0.113717]).amax(), 0.0, 5e-7);
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
    let h = matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504];
    let u = vector![0.267, -0.134];
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
        let case = any_spatial(&mut rng, 0.1);
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
        let case = any_spatial(&mut rng, 0.1);
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

/// Arms in space of H of rank 2, without inverse mass across their plane, or of rank 1 with a single joint.
#[test]
fn chatterjee_and_ruina_slide_along_a_null_direction() {
    let arm = matrix![0.8, 0.3; 0.0, 0.0; -0.2, 0.9];
    let (h, u) = (arm * arm.transpose(), arm * vector![-0.4, -1.1]);
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

/// A solid sphere, m = R = 1, whose slip v_t follows from the prescribed coefficient.
#[test]
fn spheres_in_space_have_the_slip_that_is_asked_for() {
    let h = Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    let problem = ImpactProblem::new(h, vector![0.6, -0.8, -1.0]).unwrap();
    let restitution = 0.8;
    let ruina = |tangential_restitution, friction| ChatterjeeRuina { restitution, tangential_restitution, friction };
    let brach = |impulse_ratio| Brach { restitution, impulse_ratio };
    let laws: [(&dyn Law<f64, 3>, f64); 5] = [
        (&brach(-0.1), 0.37),
        (&brach(-0.5), 0.0),
        (&ruina(0.3, 0.1), 0.37),
        (&ruina(0.3, 1.0), -0.3),
        (&ruina(0.0, 1.0), 0.0),
    ];
    for (law, v_t) in laws {
        let hit = law.resolve(&problem).unwrap();
        close(law.name(), (hit.u_plus - vector![0.6 * v_t, -0.8 * v_t, 0.8]).norm(), 0.0, 1e-15);
        assert_eq!(hit.mode == Mode::Stick, v_t == 0.0);
    }
}

/// An approach along the normal whose slip is the rounding of a pose has the impulse of one without slip: along the coupling.
#[test]
fn a_slip_of_rounding_gives_brachs_law_no_direction() {
    let delassus = matrix![2.0, 0.1, 0.5; 0.1, 1.5, 0.3; 0.5, 0.3, 1.0];
    for ratio in [-0.1, 0.1] {
        let impulse = |slip: [f64; 2]| {
            let problem = ImpactProblem::new(delassus, vector![slip[0], slip[1], -1.0]).unwrap();
            problem.resolve(&Brach { restitution: 0.5, impulse_ratio: ratio }).unwrap().impulse
        };
        let without = impulse([0.0, 0.0]);
        for slip in [[1e-17, 0.0], [0.0, 1e-17], [-3e-16, 1e-15]] {
            assert!((impulse(slip) - without).norm() < 1e-14, "{slip:?}: {} instead of {without}", impulse(slip));
        }
        // A slip above rounding is one; a ratio along it is clipped to none.
        assert!(ratio > 0.0 || (impulse([1e-12, 0.0]) - without).norm() > 1e-2);
    }
}

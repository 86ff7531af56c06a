//! The forces of compliant contacts one by one: the rebound that a damping obtains, friction of a block on a slope, and
//! passivity.

use carom_impact::{
    Bristle, Damping, HuntCrossley, ImpactError, KelvinVoigt, NormalForce, RoundBody, SmoothedCoulomb, TangentialForce,
    WaltonBraun, hertz_stiffness, restitution_obtained,
};
use nalgebra::{Vector1, Vector2, Vector3, vector};

/// e prescribed and e obtained for the damping formulas, computed independently of this crate by integration to three
/// digits.
#[test]
fn published_damping_formulas_obtain_the_tabulated_rebounds() {
    let asked = [0.2, 0.35, 0.5, 0.7, 0.8, 0.9];
    let chart = [
        (Damping::Exact, asked),
        (Damping::HuntCrossley, [0.547, 0.600, 0.663, 0.768, 0.833, 0.909]),
        (Damping::HerbertMcWhannell, [0.501, 0.534, 0.594, 0.723, 0.807, 0.901]),
        (Damping::LeeWang, [0.712, 0.753, 0.799, 0.869, 0.909, 0.952]),
        (Damping::LankaraniNikravesh, [0.672, 0.692, 0.725, 0.796, 0.847, 0.913]),
        (Damping::Gonthier, [0.205, 0.352, 0.488, 0.670, 0.768, 0.876]),
        (Damping::ZhiyingQishao, [0.266, 0.361, 0.483, 0.680, 0.787, 0.896]),
        (Damping::Flores, [0.156, 0.309, 0.470, 0.683, 0.789, 0.894]),
        (Damping::HuGuo, [0.166, 0.325, 0.488, 0.697, 0.799, 0.900]),
    ];
    assert_eq!(chart.map(|(formula, _)| formula), Damping::ALL);
    for (formula, expected) in chart {
        assert_eq!(Damping::by_name(formula.name()), Some(formula));
        for (e, expected) in asked.into_iter().zip(expected) {
            let obtained = restitution_obtained(formula.number(e).unwrap());
            assert!((obtained - expected).abs() < 5.1e-4, "{} asked {e}: {obtained}", formula.name());
        }
        assert!(restitution_obtained(formula.number(1.0).unwrap()) == 1.0, "{}: elastic", formula.name());
        // e obtained grows with e prescribed
        let mut before = 0.0;
        for k in 1..=1000 {
            let obtained = restitution_obtained(formula.number(f64::from(k) / 1000.0).unwrap());
            assert!(obtained > before, "{} at {k}", formula.name());
            before = obtained;
        }
    }
    assert_eq!(Damping::by_name("drake"), None);
}

#[test]
fn rebound_obtained_is_the_inverse_of_the_root() {
    let (mut before, mut worst) = (1.0, 0.0_f64);
    for k in (1..10_000).rev() {
        let e = f64::from(k) / 10_000.0;
        let obtained = restitution_obtained(Damping::Exact.number(e).unwrap());
        assert!(obtained < before);
        before = obtained;
        worst = worst.max((obtained / e - 1.0).abs());
    }
    assert!(worst < 8.0 * f64::EPSILON, "{worst:e}");
    for exponent in [-300, -20, -4] {
        let e = 10.0_f64.powi(exponent);
        assert!((restitution_obtained(Damping::Exact.number(e).unwrap()) / e - 1.0).abs() < 1e-15, "{e:e}");
    }
    // weakly damped: e = 1 − 2x/3 + 4x²/9 − …, the inverse of the root's x = 3(1 − e)/2 (1 + (1 − e))
    for x in [1e-3, 1e-5, 1e-9, 1e-17] {
        let off = restitution_obtained(x) - (1.0 - 2.0 / 3.0 * x + 4.0 / 9.0 * x * x);
        assert!(off.abs() < x * x * x + f64::EPSILON, "{x:e}: {off:e}");
    }
    // both branches of the iteration agree where they meet
    let (below, above) = (restitution_obtained(0.2 - 1e-12), restitution_obtained(0.2 + 1e-12));
    assert!(below > above && below - above < 2e-12);
    assert_eq!(restitution_obtained(f64::INFINITY), 0.0);
    assert!(restitution_obtained(-0.1).is_nan() && restitution_obtained(f64::NAN).is_nan());
    for formula in Damping::ALL {
        assert!(formula.number(0.0).is_none() && formula.number(1.1).is_none() && formula.number(f64::NAN).is_none());
        assert!(formula.number(f64::MIN_POSITIVE).unwrap().is_finite(), "{}", formula.name());
    }
}

/// Digits of the two ends at ζ = 0.1 and 0.5, and the closed forms.
#[test]
fn kelvin_voigt_rebound_depends_on_the_end_of_the_contact() {
    let clipped = KelvinVoigt::new(1e5, 0.5).unwrap();
    let pulling = KelvinVoigt { pulls: true, ..clipped };
    let mass = 2.5;
    for (ratio, at_zero_depth, at_zero_force) in [(0.1, 0.7292, 0.7441), (0.5, 0.1630, 0.2984)] {
        let damping = ratio * 2.0 * (1e5_f64 * mass).sqrt();
        assert!((pulling.rebound(damping, mass) - at_zero_depth).abs() < 5.1e-5);
        assert!((clipped.rebound(damping, mass) - at_zero_force).abs() < 5.1e-5);
    }
    for k in 1..=1000 {
        let e = f64::from(k) / 1000.0;
        for contact in [clipped, pulling] {
            let contact = KelvinVoigt { restitution: e, ..contact };
            let obtained = contact.rebound(contact.damping(mass), mass);
            assert!((obtained / e - 1.0).abs() < 2e-14, "{contact:?}: {obtained}");
        }
    }
    // critical damping, on both sides of it, and nearly no rebound
    let critical = 2.0 * (1e5_f64 * mass).sqrt();
    for share in [0.9989, 0.9991, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0009, 1.0011] {
        // e^(-2) with the slope of −2 ζ (1 + (1 − ζ)/3)
        let slope = clipped.rebound(share * critical, mass) / (-2.0_f64 - 4.0 / 3.0 * (share - 1.0)).exp() - 1.0;
        assert!(slope.abs() < 2.0 * (share - 1.0).powi(2) + 1e-15, "{share}: {slope:e}");
    }
    assert_eq!(pulling.rebound(critical, mass), 0.0);
    for e in [1e-3, 1e-30, 1e-300] {
        let contact = KelvinVoigt { restitution: e, ..clipped };
        let loss = contact.rebound(contact.damping(mass), mass).ln() / e.ln();
        assert!((loss - 1.0).abs() < 1e-14, "{e:e}: {loss}");
    }
    assert_eq!(KelvinVoigt { restitution: 1.0, ..clipped }.damping(mass), 0.0);
    assert!(KelvinVoigt { restitution: 0.0, ..clipped }.damping(mass).is_nan());
}

/// Near critical damping ln e is −2 ζ acos ζ/√(1 − ζ²), and −2 ζ acosh ζ/√(ζ² − 1) beyond it, to rounding.
#[test]
fn kelvin_voigt_rebound_near_critical_damping_has_its_closed_form() {
    let (contact, mass) = (KelvinVoigt::new(1e5, 0.5).unwrap(), 2.5);
    let critical = 2.0 * (1e5_f64 * mass).sqrt();
    for k in 1..=40 {
        for share in [1.0 - 5e-5 * f64::from(k), 1.0 + 5e-5 * f64::from(k)] {
            let damping = share * critical;
            let z = damping / critical;
            let root = ((1.0 - z) * (1.0 + z)).abs().sqrt();
            let angle = if z < 1.0 { root.asin() } else { root.asinh() };
            let obtained = contact.rebound(damping, mass).ln();
            assert!((obtained / (-2.0 * z * angle / root) - 1.0).abs() < 1e-14, "{share}: {obtained}");
        }
    }
}

/// The spring returns e² of the work it absorbed, and its memory is the deepest point.
#[test]
fn walton_and_brauns_spring_returns_e_squared_of_the_work() {
    let (k, e, deepest) = (1e5, 0.6, 2e-3);
    let contact = NormalForce::WaltonBraun(WaltonBraun::new(k, e).unwrap());
    let force = |penetration: f64, deepest: f64| contact.force(penetration, 0.0, 0.0, deepest);
    let n = 100_000;
    let sum = |at: &dyn Fn(f64) -> f64| {
        (0..n).map(|i| at((f64::from(i) + 0.5) / f64::from(n) * deepest)).sum::<f64>() * deepest / f64::from(n)
    };
    let taken = sum(&|d| force(d, 0.0));
    let given = sum(&|d| force(d, deepest));
    assert!((taken / (0.5 * k * deepest * deepest) - 1.0).abs() < 1e-9);
    // the kink at the dent falls into one of n cells
    assert!((given / taken - e * e).abs() < 10.0 / f64::from(n), "{}", given / taken);
    assert_eq!(force((1.0 - e * e) * deepest * 0.999, deepest), 0.0);
    assert_eq!(force(-1.0, 0.0), 0.0);
    assert_eq!(force(3e-3, deepest), k * 3e-3, "loading line beyond its memory");
    let (a, b) = (force(deepest, deepest), force(deepest * (1.0 - 1e-12), deepest));
    assert!((a - b).abs() < 1e-9 * a, "continuous at the deepest point");
}

/// Steel on steel: two equal balls, a ball on a plate; the formula is symmetric.
#[test]
fn hertz_stiffness_has_its_closed_form() {
    let steel = RoundBody { radius: 0.05, modulus: 210e9, poisson_ratio: 0.3 };
    let equal = hertz_stiffness(steel, steel).unwrap();
    // E √(2R)/(3 (1 − ν²))
    let closed = 210e9 * (2.0_f64 * 0.05).sqrt() / (3.0 * (1.0 - 0.09));
    assert!((equal / closed - 1.0).abs() < 1e-14);
    let plate = RoundBody { radius: f64::INFINITY, ..steel };
    let flat = hertz_stiffness(steel, plate).unwrap();
    assert!((flat / equal - 2.0_f64.sqrt()).abs() < 1e-14, "zero curvature on the other side: √2 stiffer");
    let rubber = RoundBody { radius: 0.02, modulus: 5e6, poisson_ratio: 0.5 };
    assert_eq!(hertz_stiffness(steel, rubber).unwrap(), hertz_stiffness(rubber, steel).unwrap());
    let hollow = RoundBody { radius: -0.1, ..steel };
    assert!((hertz_stiffness(steel, hollow).unwrap() / flat - 2.0_f64.sqrt()).abs() < 1e-14);
    let refused = |one, other| hertz_stiffness(one, other).unwrap_err().to_string();
    assert_eq!(
        refused(plate, plate),
        "1/R is 0: the sum of the curvatures must be positive: two flat bodies, or a ball in a concave body of smaller \
         radius, do not touch in a point"
    );
    assert!(refused(RoundBody { radius: -0.04, ..steel }, steel).starts_with("1/R is -5"));
    assert_eq!(
        refused(steel, RoundBody { radius: 0.0, ..steel }),
        "radius is 0: it must not be 0 or NaN: give inf for a flat body, a negative radius for a concave one"
    );
    assert_eq!(refused(steel, RoundBody { modulus: -1.0, ..steel }), "modulus is -1: it must be finite and above 0");
    assert_eq!(
        refused(steel, RoundBody { poisson_ratio: 0.51, ..steel }),
        "Poisson's ratio is 0.51: that of an isotropic body is above -1 and at most 0.5"
    );
}

/// A block of 1 kg on a slope under its weight, from rest: positions, speeds, and the bristle's deflection.
fn slide(
    tangent: f64,
    force: impl Fn(f64, f64) -> f64,
    rate: impl Fn(f64, f64) -> f64,
    (dt, steps): (f64, usize),
) -> Vec<[f64; 3]> {
    let slope = |[_, v, z]: [f64; 3]| [v, 9.81 * tangent / tangent.hypot(1.0) + force(v, z), rate(v, z)];
    let add = |x: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let mut path = vec![[0.0; 3]];
    for step in 0..steps {
        let x = path[step];
        let a = slope(x);
        let b = slope(add(x, a, dt / 2.0));
        let c = slope(add(x, b, dt / 2.0));
        let d = slope(add(x, c, dt));
        path.push(std::array::from_fn(|i| x[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])));
    }
    path
}

/// Below the friction angle a bristle does not creep, smoothed friction creeps at v_d atanh(tan θ/μ); above it both
/// slide with Coulomb's acceleration.
#[test]
fn block_on_a_slope_sticks_on_a_bristle_and_creeps_on_smoothed_friction() {
    let (mu, tangent): (f64, f64) = (0.5, 0.4);
    let pressed = |tangent: f64| 9.81 / tangent.hypot(1.0);
    let smoothed = TangentialForce::Smoothed(SmoothedCoulomb::new(mu, 1e-3).unwrap());
    let creeping = |v, _| smoothed.force(&Vector1::zeros(), &Vector1::new(v), pressed(tangent)).x;
    let creep = slide(tangent, creeping, |_, _| 0.0, (1e-4, 20_000));
    let [_, speed, _] = creep[20_000];
    let expected = 1e-3 * (tangent / mu).atanh();
    assert!((speed / expected - 1.0).abs() < 1e-12, "{speed} instead of {expected}");

    let (k, c) = (1e4, 100.0); // half of critical
    let bristle = TangentialForce::Bristle(Bristle::new(mu, k, c).unwrap());
    let on = |tangent: f64, steps: usize| {
        let force = |v, z| bristle.force(&Vector1::new(z), &Vector1::new(v), pressed(tangent)).x;
        let rate = |v, z| bristle.rate(&Vector1::new(z), &Vector1::new(v), pressed(tangent)).x;
        slide(tangent, force, rate, (1e-4, steps))
    };
    let path = on(tangent, 20_000);
    let [place, speed, deflection] = path[20_000];
    // oscillations decay as exp(−c t/(2m)); the rest is the rounding of the weight over c
    assert!(speed.abs() < 1e-15, "it creeps at {speed:e} m/s");
    let bent = pressed(tangent) * tangent / k;
    assert!((deflection / bent - 1.0).abs() < 1e-12 && place >= deflection - 1e-15, "{place} {deflection} {bent}");
    // the first oscillation may slip a little; after it there is no motion
    assert!(place < 2.0 * bent && (path[10_000][0] - place).abs() < 1e-15, "{place}");

    let steep: f64 = 0.7;
    let [_, speed, deflection] = on(steep, 20_000)[20_000];
    let coulomb = 9.81 * (steep - mu) / steep.hypot(1.0);
    assert!((speed / (2.0 * coulomb) - 1.0).abs() < 0.01, "{speed} after 2 s at {coulomb} m/s²");
    assert!((deflection * k / (mu * pressed(steep)) - 1.0).abs() < 1e-12, "the bristle is at the friction limit");
}

/// In every state: within the cone, and energy that is not stored is dissipated.
#[test]
fn friction_is_passive_for_any_normal_force() {
    let mut rng = fastrand::Rng::with_seed(17);
    let mut any = |size: f64| size * (2.0 * rng.f64() - 1.0);
    let (mut sticks, mut slides) = (0, 0);
    for _ in 0..100_000 {
        let (mu, k, c) = (any(1.0).abs(), 10.0_f64.powf(4.0 + any(2.0)), 10.0_f64.powf(2.0 + any(2.0)));
        let bristle = TangentialForce::Bristle(Bristle::new(mu, k, c).unwrap());
        let normal = any(10.0); // includes negative forces, which have no friction
        let (z, v) = (Vector2::new(any(1e-3), any(1e-3)), Vector2::new(any(0.1), any(0.1)));
        let (force, rate) = (bristle.force(&z, &v, normal), bristle.rate(&z, &v, normal));
        let size = (k * z.norm() + c * v.norm()) * v.norm().max(rate.norm());
        let lost = -force.dot(&v) - k * z.dot(&rate);
        assert!(lost >= -1e-14 * size, "{bristle:?} {normal} {z} {v}: {lost:e}");
        assert!(force.norm() <= mu * normal.max(0.0) * (1.0 + 1e-15));
        if rate == v {
            sticks += 1
        } else {
            slides += 1
        }
        let smoothed = TangentialForce::Smoothed(SmoothedCoulomb::new(mu, 0.01).unwrap()).force(&z, &v, normal);
        assert!(smoothed.dot(&v) <= 0.0 && smoothed.norm() <= mu * normal.max(0.0) * (1.0 + 1e-15));
    }
    assert!(sticks > 1000 && slides > 1000, "{sticks} {slides}");
    // three rows in the world frame agree with two in the contact plane
    let bristle = TangentialForce::Bristle(Bristle::new(0.5, 1e4, 10.0).unwrap());
    let flat = bristle.force(&vector![1e-3, 0.0], &vector![0.1, 0.2], 30.0);
    let world: Vector3<f64> = bristle.force(&vector![1e-3, 0.0, 0.0], &vector![0.1, 0.2, 0.0], 30.0);
    assert_eq!((world.x, world.y, world.z), (flat.x, flat.y, 0.0));
}

#[test]
fn invalid_parameters_are_refused() {
    let message = |refused: Result<(), ImpactError>| refused.unwrap_err().to_string();
    assert_eq!(message(KelvinVoigt::new(-1.0, 0.5).map(drop)), "stiffness is -1: it must be finite and above 0");
    assert_eq!(message(WaltonBraun::new(f64::NAN, 0.5).map(drop)), "stiffness is NaN: it must be finite and above 0");
    for refused in [KelvinVoigt::new(1.0, 0.0).map(drop), WaltonBraun::new(1.0, 0.0).map(drop)] {
        assert!(message(refused).starts_with("restitution is 0: the restitution of a compliant contact is above 0"));
    }
    assert_eq!(message(SmoothedCoulomb::new(0.1, 0.0).map(drop)), "slip speed is 0: it must be finite and above 0");
    assert_eq!(
        message(SmoothedCoulomb::new(-0.1, 1.0).map(drop)),
        "friction -0.1 is not a finite number >= 0: give the Coulomb coefficient, 0 for none"
    );
    assert_eq!(
        message(Bristle::new(0.1, 1.0, 0.0).map(drop)),
        "bristle's damping is 0: it must be finite and above 0, to damp the oscillation of the bristle; 2 √(k m) is \
         critical for a mass m"
    );
    let laws = [
        NormalForce::HuntCrossley(HuntCrossley::new(1.0, 1.5, 0.5).unwrap()),
        NormalForce::KelvinVoigt(KelvinVoigt::new(1.0, 0.5).unwrap()),
        NormalForce::WaltonBraun(WaltonBraun::new(1.0, 0.5).unwrap()),
    ];
    assert_eq!(laws.map(|law| law.name()), NormalForce::NAMES);
    assert_eq!(laws.map(|law| law.has_memory()), [false, false, true]);
}

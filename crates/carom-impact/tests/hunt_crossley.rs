//! The Hunt–Crossley contact against tables, its own equation, and an independent integration.

use carom_impact::{Damping, HuntCrossley, NormalForce};

#[test]
fn roots_have_their_reference_values() {
    let table = [
        (0.1, 9.998159),
        (0.2, 4.919167),
        (0.3, 3.087082),
        (0.35, 2.523378),
        (0.5, 1.432751),
        (0.7, 0.634828),
        (0.8, 0.373146),
        (0.9, 0.166482),
        (0.95, 0.078927),
    ];
    for (e, expected) in table {
        let x = Damping::Exact.number(e).unwrap();
        assert!((x - expected).abs() < 5.1e-7, "e {e}: {x}");
    }
    // to all digits, from 40-digit arithmetic
    let exact = [
        (1e-6, 1e6),
        (0.02, 50.0),
        (0.05, 19.99999968153236),
        (0.1, 9.998159397495668),
        (0.35, 2.5233777059513476),
        (0.5, 1.432750533271375),
        (0.9, 0.16648195068530808),
        (0.99, 0.015151362109441019),
        (0.999, 0.0015015013512010866),
        (0.999999, 1.5000015000444836e-6),
        (1.0, 0.0),
    ];
    for (e, expected) in exact {
        let x = Damping::Exact.number(e).unwrap();
        assert!((x - expected).abs() <= 4.0 * f64::EPSILON * expected, "e {e}: {x} is not {expected}");
    }
}

#[test]
fn root_solves_its_equation() {
    let mut before = f64::INFINITY;
    for k in 1..100_000 {
        let e = f64::from(k) / 100_000.0;
        let x = Damping::Exact.number(e).unwrap();
        assert!(x > 0.0 && x <= 1.0 / e && x < before, "e {e}: {x}");
        before = x;
        // the equation without its logarithm, which is inaccurate where 1 - e x is nearly 0
        let off = (1.0 - e * x) - (1.0 + x) * (-x * (1.0 + e)).exp();
        assert!(off.abs() < 1e-14, "e {e}: off by {off:e}");
        if e > 0.3 {
            let off = x.ln_1p() - (-e * x).ln_1p() - x * (1.0 + e);
            assert!(off.abs() < 1e-14, "e {e}: off by {off:e}");
        }
    }
    // both ends: x is 1/e to the last digit, and (3/2)(1 - e) with its next two terms
    for exponent in -300..-1 {
        let e = 10.0_f64.powi(exponent);
        assert_eq!(Damping::Exact.number(e), Some(1.0 / e));
    }
    for exponent in -16..-5 {
        let loss = 1.0 - (1.0 - 10.0_f64.powi(exponent));
        let x = Damping::Exact.number(1.0 - loss).unwrap();
        assert!((x / (1.5 * loss * (1.0 + loss)) - 1.0).abs() < 2.0 * loss * loss + 1e-15, "loss {loss:e}: {x:e}");
    }
}

/// Rebound speed and largest penetration by fourth-order Runge–Kutta with `steps` steps per time scale of the
/// penetration, from the force alone.
fn integrate(contact: &HuntCrossley, mass: f64, approach: f64, steps: f64) -> (f64, f64) {
    let (law, damping) = (NormalForce::HuntCrossley(*contact), contact.damping(approach));
    let acceleration = |d: f64, w: f64| {
        let force = law.force(d, w, damping, 0.0);
        assert!(force >= 0.0);
        -force / mass
    };
    let power = 1.0 + contact.exponent;
    let scale = (mass * approach * approach / contact.stiffness).powf(1.0 / power);
    let dt = scale / approach / steps;
    let (mut d, mut w, mut deepest) = (0.0_f64, approach, 0.0_f64);
    loop {
        let (d1, w1) = (w, acceleration(d, w));
        let (d2, w2) = (w + 0.5 * dt * w1, acceleration(d + 0.5 * dt * d1, w + 0.5 * dt * w1));
        let (d3, w3) = (w + 0.5 * dt * w2, acceleration(d + 0.5 * dt * d2, w + 0.5 * dt * w2));
        let (d4, w4) = (w + dt * w3, acceleration(d + dt * d3, w + dt * w3));
        d += dt / 6.0 * (d1 + 2.0 * (d2 + d3) + d4);
        w += dt / 6.0 * (w1 + 2.0 * (w2 + w3) + w4);
        deepest = deepest.max(d);
        if d <= 0.0 {
            return (-w, deepest);
        }
    }
}

#[test]
fn integrated_rebound_is_e() {
    let cases = [
        // k, n, e, m, v0
        (1e7, 1.5, 0.5, 0.4, 0.2),
        (1e9, 1.5, 0.35, 12.0, 3.0),
        (5e4, 1.0, 0.8, 1.0, 0.1),
        (2e6, 2.0, 0.95, 0.01, 10.0),
        (1e5, 1.2, 0.2, 3.0, 0.01),
        (1e8, 3.0, 0.1, 0.4, 1.0),
        (1e7, 1.5, 1.0, 0.4, 0.2),
    ];
    for (k, n, e, m, v0) in cases {
        let contact = HuntCrossley::new(k, n, e).unwrap();
        let (rebound, deepest) = integrate(&contact, m, v0, 20_000.0);
        assert!((rebound / v0 - e).abs() < 1e-9, "n {n}, e {e}: rebound {}", rebound / v0);
        let told = NormalForce::HuntCrossley(contact).greatest_penetration(v0, m);
        assert!((deepest / told - 1.0).abs() < 1e-7, "n {n}, e {e}: depth {deepest}, told {told}");
    }
}

#[test]
fn force_never_pulls() {
    let contact = HuntCrossley::new(1e7, 1.5, 0.5).unwrap();
    let (law, damping) = (NormalForce::HuntCrossley(contact), contact.damping(0.2));
    for (d, w) in [(-1e-3, 1.0), (0.0, 1.0), (0.0, -1.0), (1e-3, -1.0), (1e-3, -0.5), (-1.0, -1.0)] {
        assert_eq!(law.force(d, w, damping, 0.0), 0.0, "at {d} m, {w} m/s");
    }
    // Hertz's force at zero rate
    let still = law.force(1e-4, 0.0, damping, 0.0);
    assert!((still - 10.0).abs() < 1e-13);
    // no damping without approach; a finite damping for the slowest approach
    assert_eq!(contact.damping(0.0), 0.0);
    assert_eq!(contact.damping(-1.0), 0.0);
    assert_eq!(law.greatest_penetration(-1.0, 1.0), 0.0);
    assert!(law.force(1e-4, 0.0, contact.damping(5e-324), 0.0) > 0.0);
    // NaN stays NaN
    assert!(law.force(f64::NAN, 0.0, 0.0, 0.0).is_nan() && contact.damping(f64::NAN).is_nan());
    assert!(HuntCrossley { restitution: 0.0, ..contact }.damping(1.0).is_nan());
}

#[test]
fn invalid_parameters_are_refused() {
    let refused = |k, n, e| HuntCrossley::new(k, n, e).unwrap_err().to_string();
    assert_eq!(refused(0.0, 1.5, 0.5), "stiffness is 0: it must be finite and above 0");
    assert_eq!(refused(f64::INFINITY, 1.5, 0.5), "stiffness is inf: it must be finite and above 0");
    let rule = "it must be between 0.1 and 10: 1 for a spring, 1.5 for round bodies (Hertz), 2 for the tip of a cone";
    for (n, shown) in [(f64::NAN, "NaN"), (0.0, "0"), (0.09, "0.09"), (10.1, "10.1"), (1e9, "1000000000")] {
        assert_eq!(refused(1e7, n, 0.5), format!("exponent is {shown}: {rule}"));
    }
    for (e, shown) in [(0.0, "0"), (-0.5, "-0.5"), (1.5, "1.5"), (f64::NAN, "NaN")] {
        assert_eq!(
            refused(1e7, 1.5, e),
            format!(
                "restitution is {shown}: the restitution of a compliant contact is above 0 and at most 1, because at 0 \
                 its damping would be infinite: give a small one such as 0.01, or use a rigid law"
            )
        );
        assert_eq!(Damping::Exact.number(e), None);
    }
}

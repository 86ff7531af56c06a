//! Error messages of invalid input, in full: each contains the value, the rule it breaks and a remedy.

use carom_impact::{
    Brach, ChatterjeeRuina, Energetic, Frictionless, ImpactError, ImpactOutcome, ImpactProblem, Law, Poisson, Whittaker,
};
use nalgebra::{Matrix2, Vector2, matrix, vector};

fn refused(h: Matrix2<f64>, u: Vector2<f64>) -> String {
    ImpactProblem::new(h, u).unwrap_err().to_string()
}

fn unresolved(law: impl Law<f64, 2>, h: Matrix2<f64>, u: Vector2<f64>) -> String {
    law.resolve(&ImpactProblem::new(h, u).unwrap()).unwrap_err().to_string()
}

const H: Matrix2<f64> = matrix![2.0, 0.5; 0.5, 1.0];
const U: Vector2<f64> = vector![1.0, -1.0];

#[test]
fn problems_and_laws_are_refused_with_value_rule_and_remedy() {
    let finite = "every number of an impact problem must be finite; check the pose, the velocity and the inertias it was built from";
    let (restitution, friction) = (0.5, 0.2);
    let singular = matrix![2.0, 0.0; 0.0, 0.0];
    let wedge = unresolved(Whittaker { restitution, friction: 2.0 }, matrix![1.0, 1.0; 1.0, 1.0], vector![-1.0, -1.0]);
    for (said, expected) in [
        (refused(matrix![2.0, f64::NAN; 0.5, 1.0], U), format!("delassus[0][1] is NaN: {finite}")),
        (refused(H, vector![1.0, f64::NEG_INFINITY]), format!("u_minus[1] is -inf: {finite}")),
        (
            refused(matrix![2.0, 0.5; 0.25, 1.0], U),
            "delassus[0][1] = 0.5 but delassus[1][0] = 0.25: the matrix must be symmetric within 0.00000002 (1e-8 of its \
             largest entry); build it as J M^-1 J^T"
                .into(),
        ),
        (
            refused(matrix![1.0, 2.0; 2.0, 0.5], U),
            "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, its pivot at [0][0] is \
             -7, below -0.0000000000004547473508864641 (rounding); no mass distribution has it, check the \
             mass matrix and the order of the contact axes"
                .into(),
        ),
        (
            unresolved(Poisson { restitution, friction }, singular, U),
            "the normal direction is singular: H_nn = 0 1/kg is zero within rounding, relative to the trace 2 1/kg of the \
             Delassus matrix, so the impulse would be infinite; leave the singular pose or model the compliance of the \
             structure"
                .into(),
        ),
        (
            wedge,
            "the contact wedges: friction 2 makes it stick while it still approaches with u_n = -1 m/s, and while it \
             sticks its normal direction is singular (inverse mass 0 1/kg, H_nn = 1 1/kg), so no finite impulse ends the \
             impact; lower the friction or leave the singular pose"
                .into(),
        ),
    ] {
        assert_eq!(said, expected);
    }
    for (value, shown) in [(1.5, "1.5"), (-0.1, "-0.1"), (f64::NAN, "NaN")] {
        let said = unresolved(Energetic { restitution: value, friction }, H, U);
        assert_eq!(said, format!("restitution {shown} is outside [0, 1]: 0 is no rebound, 1 a full rebound"));
    }
    for (value, shown) in [(-0.25, "-0.25"), (f64::INFINITY, "inf"), (f64::NAN, "NaN")] {
        let said = unresolved(Poisson { restitution, friction: value }, H, U);
        let rule = "is not a finite number >= 0: give the Coulomb coefficient, 0 for none";
        assert_eq!(said, format!("friction {shown} {rule}"));
    }
    for (tangential_restitution, shown) in [(1.5, "1.5"), (-1.25, "-1.25"), (f64::NAN, "NaN")] {
        let said = unresolved(ChatterjeeRuina { restitution, tangential_restitution, friction }, H, U);
        let rule = "is outside [-1, 1]: -1 is no tangential impulse, 0 one that stops the slip, 1 one that reverses it";
        assert_eq!(said, format!("tangential restitution {shown} {rule}"));
    }
    for (impulse_ratio, shown) in [(f64::INFINITY, "inf"), (f64::NAN, "NaN")] {
        let said = unresolved(Brach { restitution, impulse_ratio }, H, U);
        let rule = "is not finite: give tangential over normal impulse, negative against the slip";
        assert_eq!(said, format!("impulse ratio {shown} {rule}"));
    }
}

#[test]
fn slight_asymmetry_is_averaged() {
    let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5 + 1e-9, 1.0], U).unwrap();
    assert_eq!(problem.delassus()[(0, 1)], problem.delassus()[(1, 0)]);
    assert!((problem.delassus()[(0, 1)] - (0.5 + 0.5e-9)).abs() < 1e-16);
}

/// A user's own law may return any impulse; an outcome is made of it only if its numbers are finite.
#[test]
fn impulse_of_a_users_law() {
    let problem = ImpactProblem::new(H, U).unwrap();
    let of = |impulse| ImpactOutcome::of_impulse("mine", &problem, impulse);
    // Without friction the path is straight, and the law's own outcome is that of its impulse.
    let hit = Frictionless { restitution: 0.5 }.resolve(&problem).unwrap();
    let own = of(hit.impulse).unwrap();
    assert_eq!((own.mode, own.flags, own.newton), (hit.mode, hit.flags, hit.newton));
    for (found, expected) in [
        (own.energy_before, hit.energy_before),
        (own.energy_after, hit.energy_after),
        (own.normal_work, hit.normal_work),
        (own.friction_work, 0.0),
        (own.u_plus[0], hit.u_plus[0]),
        (own.u_plus[1], hit.u_plus[1]),
    ] {
        // Sums of a few terms of size one.
        assert!((found - expected).abs() < 16.0 * f64::EPSILON, "{found} {expected}");
    }
    // No impulse, or one that is too small, leaves the contact approaching.
    for impulse in [vector![0.0, 0.0], hit.impulse * 0.5] {
        let refusal = of(impulse).unwrap_err();
        assert!(matches!(refusal, ImpactError::Outcome { law: "mine", found, .. } if found < -0.1), "{refusal}");
    }
    let open = ImpactProblem::new(H, -U).unwrap();
    let none = ImpactOutcome::of_impulse("mine", &open, vector![0.0, 0.0]).unwrap();
    assert_eq!(
        none,
        Frictionless { restitution: 0.5 }.resolve(&open).map(|hit| ImpactOutcome { law: "mine", ..hit }).unwrap()
    );
    assert_eq!(
        of(vector![f64::NAN, 1.0]).unwrap_err().to_string(),
        "the impulse is NaN: every number of an impact problem must be finite; check the pose, the velocity and the \
         inertias it was built from"
    );
    let failed = ImpactError::UsersLaw { law: "mine", reason: "the table has no row for 3 m/s".into() };
    assert_eq!(failed.to_string(), "the law mine has failed: the table has no row for 3 m/s");
}

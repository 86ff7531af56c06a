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
fn numbers_that_are_not_finite() {
    assert_eq!(
        refused(matrix![2.0, f64::NAN; 0.5, 1.0], U),
        "delassus[0][1] is NaN: every number of an impact problem must be finite; check the pose, the velocity and \
         the inertias it was built from"
    );
    assert_eq!(
        refused(H, vector![1.0, f64::NEG_INFINITY]),
        "u_minus[1] is -inf: every number of an impact problem must be finite; check the pose, the velocity and the \
         inertias it was built from"
    );
}

#[test]
fn asymmetric_matrix() {
    assert_eq!(
        refused(matrix![2.0, 0.5; 0.25, 1.0], U),
        "delassus[0][1] = 0.5 but delassus[1][0] = 0.25: the matrix must be symmetric within 0.00000002 (1e-8 of its \
         largest entry); build it as J M^-1 J^T"
    );
}

#[test]
fn slight_asymmetry_is_averaged() {
    let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5 + 1e-9, 1.0], U).unwrap();
    assert_eq!(problem.delassus()[(0, 1)], problem.delassus()[(1, 0)]);
    assert!((problem.delassus()[(0, 1)] - (0.5 + 0.5e-9)).abs() < 1e-16);
}

#[test]
fn matrix_that_is_not_positive_semidefinite() {
    assert_eq!(
        refused(matrix![1.0, 2.0; 2.0, 0.5], U),
        "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, its pivot at [0][0] is \
         -7, below -0.0000000000004547473508864641 (rounding); no mass distribution has it, check the \
         mass matrix and the order of the contact axes"
    );
}

#[test]
fn coefficients_out_of_range() {
    for (restitution, shown) in [(1.5, "1.5"), (-0.1, "-0.1"), (f64::NAN, "NaN")] {
        assert_eq!(
            unresolved(Energetic { restitution, friction: 0.2 }, H, U),
            format!("restitution {shown} is outside [0, 1]: 0 is no rebound, 1 a full rebound")
        );
    }
    for (friction, shown) in [(-0.25, "-0.25"), (f64::INFINITY, "inf"), (f64::NAN, "NaN")] {
        assert_eq!(
            unresolved(Poisson { restitution: 0.5, friction }, H, U),
            format!("friction {shown} is not a finite number >= 0: give the Coulomb coefficient, 0 for none")
        );
    }
}

#[test]
fn coefficients_of_single_laws_out_of_range() {
    for (tangential_restitution, shown) in [(1.5, "1.5"), (-1.25, "-1.25"), (f64::NAN, "NaN")] {
        assert_eq!(
            unresolved(ChatterjeeRuina { restitution: 0.5, tangential_restitution, friction: 0.2 }, H, U),
            format!(
                "tangential restitution {shown} is outside [-1, 1]: -1 is no tangential impulse, 0 one that stops \
                 the slip, 1 one that reverses it"
            )
        );
    }
    for (impulse_ratio, shown) in [(f64::INFINITY, "inf"), (f64::NAN, "NaN")] {
        assert_eq!(
            unresolved(Brach { restitution: 0.5, impulse_ratio }, H, U),
            format!(
                "impulse ratio {shown} is not finite: give tangential over normal impulse, negative against the slip"
            )
        );
    }
}

#[test]
fn singular_normal_direction() {
    assert_eq!(
        unresolved(Poisson { restitution: 0.5, friction: 0.2 }, matrix![2.0, 0.0; 0.0, 0.0], U),
        "the normal direction is singular: H_nn = 0 1/kg is zero within rounding, relative to the trace 2 1/kg of the \
         Delassus matrix, so the impulse would be infinite; leave the singular pose or model the compliance of the \
         structure"
    );
}

#[test]
fn wedged_contact() {
    assert_eq!(
        unresolved(Whittaker { restitution: 0.5, friction: 2.0 }, matrix![1.0, 1.0; 1.0, 1.0], vector![-1.0, -1.0]),
        "the contact wedges: friction 2 makes it stick while it still approaches with u_n = -1 m/s, and while it \
         sticks its normal direction is singular (inverse mass 0 1/kg, H_nn = 1 1/kg), so no finite impulse ends the \
         impact; lower the friction or leave the singular pose"
    );
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

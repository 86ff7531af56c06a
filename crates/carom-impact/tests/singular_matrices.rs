//! Laws where H has a lower rank, and the flags that belong to the problem and not to the law.

use carom_impact::{Coefficients, Flags, ImpactError, ImpactProblem, LAW_NAMES, law_by_name};
use nalgebra::{Matrix2, Vector2, matrix, vector};

fn with_friction() -> impl Iterator<Item = &'static str> {
    LAW_NAMES.into_iter().filter(|name| *name != "frictionless")
}

/// A contact of a one-joint arm: H = j jᵀ/m. Every outcome satisfies u⁺ = u⁻ + H p and u_n⁺ ≥ 0, with an impulse of the size
/// that the approach needs; or the law refuses, because friction wedges the contact.
#[test]
fn outcomes_on_singular_matrices_satisfy_the_impulse_law() {
    let mut rng = fastrand::Rng::with_seed(3);
    let (mut resolved, mut brach) = (0, 0);
    for _ in 0..4000 {
        let j = Vector2::new(rng.f64() - 0.5, rng.f64() - 0.5);
        let inertia = 0.2 + rng.f64();
        let delassus: Matrix2<f64> = j * j.transpose() / inertia;
        // j q̇ approaches
        let rate = -j.y.signum() * (0.1 + rng.f64());
        let mut u = j * rate;
        if rng.bool() {
            u.x += 1e-9 * (rng.f64() - 0.5); // not in the range of H: a surface that moves
        }
        let restitution = [0.0, 1e-9, 0.5, 1.0][rng.usize(0..4)];
        let friction = 3.0 * rng.f64();
        let problem = ImpactProblem::new(delassus, u).unwrap();
        for name in with_friction() {
            let law =
                law_by_name::<2>(name, Coefficients { restitution, friction, ..Coefficients::default() }).unwrap();
            let Ok(hit) = law.resolve(&problem) else { continue };
            resolved += 1;
            brach += usize::from(name == "brach");
            let terms = u.norm() + delassus.norm() * hit.impulse.norm();
            let miss = (u + delassus * hit.impulse - hit.u_plus).norm();
            assert!(miss < 1e-10 * terms + 1e-14, "{name} e {restitution} μ {friction}: {delassus} {u} {hit:?}");
            // The tolerance is for u outside of the range of H by 1e-9 where u_n is as small as 1e-4.
            // Without friction C p = (1 + e) |u_n|; friction adds to it by at most the factor 1/|1 − μ |B|/C|, where H has rank 1.
            let grip = (1.0 - friction * (j.x / j.y).abs()).abs();
            let most = (1.0 + restitution) * u.y.abs() / delassus[(1, 1)] / grip.min(1.0);
            assert!(hit.impulse.y.is_finite() && hit.impulse.y <= most * (1.0 + 1e-4), "{name}: {hit:?}, most {most}");
        }
    }
    assert!(resolved > 10_000 && brach > 1500, "{resolved}, {brach} of Brach's law");
}

/// A contact of a one-joint arm nearly along its lever, H = j jᵀ within the rounding of its entries: its least eigenvalue is rounding,
/// of either sign, and no law takes its inverse for an impulse.
#[test]
fn an_eigenvalue_that_is_rounding_of_the_entries_carries_no_impulse() {
    let mut rng = fastrand::Rng::with_seed(4);
    let (mut resolved, mut wedged) = (0, 0);
    for k in 0..4000 {
        let flat = if k == 0 { 0.02 } else { 10f64.powf(-4.0 * rng.f64()) };
        let j = Vector2::new(1.0, flat);
        let mut delassus: Matrix2<f64> = j * j.transpose();
        // 64 ε of each entry, as of a matrix assembled from a pose; first the case whose impulse was 3.9e17 N s.
        let mut rounded = || 1.0 + 64.0 * f64::EPSILON * (2.0 * rng.f64() - 1.0);
        let [a, b, c] =
            if k == 0 { [1.0, 1.0, 0.00040000000000000013 / 0.0004] } else { [rounded(), rounded(), rounded()] };
        delassus = matrix![delassus[(0, 0)] * a, delassus[(0, 1)] * b; delassus[(1, 0)] * b, delassus[(1, 1)] * c];
        let side = if rng.bool() { 1.0 } else { -1.0 };
        let u = Vector2::new(side, -flat);
        let (restitution, friction) = ([0.0, 0.5, 1.0][rng.usize(0..3)], if k == 0 { 0.3 } else { 3.0 * rng.f64() });
        let problem = ImpactProblem::new(delassus, u).unwrap();
        // Without friction C p = (1 + e) |u_n|; friction multiplies it by no more than 1/|1 − μ |B|/C|.
        let grip = (1.0 - friction / flat).abs().min(1.0);
        let most = (1.0 + restitution) / flat / grip;
        for name in LAW_NAMES {
            let given = Coefficients { restitution, friction, ..Coefficients::default() };
            match law_by_name::<2>(name, given).unwrap().resolve(&problem) {
                Ok(hit) => {
                    resolved += 1;
                    assert!(
                        hit.impulse.norm() <= most * (1.0 + friction) * (1.0 + 1e-6),
                        "{name} {delassus} {u} {hit:?}"
                    );
                    // The impulses of the others are in a given ratio, whatever the null direction.
                    assert!(
                        name == "frictionless" || hit.flags.contains(Flags::SINGULAR),
                        "{name} {delassus} {u} {hit:?}"
                    );
                }
                Err(ImpactError::Wedged { .. }) => wedged += 1,
                Err(why) => panic!("{name} μ {friction} {delassus} {u}: {why}"),
            }
        }
    }
    assert!(resolved > 15_000 && wedged > 3000, "{resolved} {wedged}");
}

/// The first two cases gave u⁺ = (0, 0), though u⁻ + H p was (−.5, −.4), and no flag.
#[test]
fn brachs_law_without_restitution_stops_a_one_joint_arm_by_its_normal_impulse() {
    let delassus = matrix![1.1453773255420063, 0.8668104276559294; 0.8668104276559294, 0.6559937068227736];
    let u: Vector2<f64> = vector![-1.142188630438109, -0.8643972541933191];
    for friction in [0.5, 2.0, 10.0] {
        let law = law_by_name::<2>("brach", Coefficients { friction, ..Coefficients::default() }).unwrap();
        let hit = law.resolve(&ImpactProblem::new(delassus, u).unwrap()).unwrap();
        assert!((u + delassus * hit.impulse).norm() < 1e-8 && hit.u_plus.norm() < 1e-8, "{hit:?}");
        assert!((hit.impulse.y + u.y / delassus[(1, 1)]).abs() < 1e-12, "{hit:?}");
        assert!(hit.flags.contains(Flags::SINGULAR), "{hit:?}");
    }
}

/// `jam`: μ h·u ≥ C |u_t| at the start of the slip. `singular`: H has a null direction with a normal component. Neither depends
/// on the law.
#[test]
fn jam_and_singular_are_said_by_all_laws_with_friction_or_by_none() {
    let jammed = (matrix![2.440338, 1.521309; 1.521309, 1.00956], vector![0.3, -0.134201], 0.8);
    let plain = (matrix![2.440338, 0.5; 0.5, 1.00956], vector![0.3, -0.134201], 0.8);
    let j: Vector2<f64> = vector![0.3, 0.7];
    let singular = (j * j.transpose(), vector![0.2, -0.7], 0.389);
    for ((delassus, u, friction), flag) in
        [(jammed, Flags::JAM), (plain, Flags::default()), (singular, Flags::SINGULAR)]
    {
        let problem = ImpactProblem::new(delassus, u).unwrap();
        for name in with_friction() {
            let given = Coefficients { restitution: 0.5, friction, ..Coefficients::default() };
            let hit = law_by_name::<2>(name, given).unwrap().resolve(&problem).unwrap();
            let both = Flags::JAM | Flags::SINGULAR;
            let said = [Flags::JAM, Flags::SINGULAR].map(|one| hit.flags.contains(one));
            let wanted = [Flags::JAM, Flags::SINGULAR].map(|one| flag.contains(one) && both.contains(one));
            assert_eq!(said, wanted, "{name}: {hit:?}");
        }
    }
}

/// A contact that moves along its normal only, without slip or with one that nothing changes.
#[test]
fn a_contact_that_moves_along_its_normal_only_gets_the_impulse_of_a_mass() {
    let mass = 2.0;
    for (slip, friction, restitution) in [(0.0, 0.0, 0.5), (0.0, 0.4, 1.0), (0.3, 0.0, 0.0), (0.3, 0.4, 0.5)] {
        let problem = ImpactProblem::new(matrix![0.0, 0.0; 0.0, 1.0 / mass], vector![slip, -1.5]).unwrap();
        for name in LAW_NAMES {
            let given = Coefficients { restitution, friction, ..Coefficients::default() };
            let hit = law_by_name::<2>(name, given).unwrap().resolve(&problem).unwrap();
            let wanted = (1.0 + restitution) * 1.5 * mass;
            assert!((hit.impulse.y - wanted).abs() < 1e-14 * wanted, "{name} {slip} {friction}: {hit:?}");
            assert!(
                (hit.u_plus - vector![slip, restitution * 1.5]).norm() < 1e-14,
                "{name} {slip} {friction}: {hit:?}"
            );
        }
    }
}

/// Sliding friction −μ P_n does not depend on how heavy the contact is along its slip, also where this mass is infinite to rounding.
#[test]
fn friction_acts_along_a_tangent_that_hardly_moves() {
    for inverse_mass in [1e-6, 1e-9, 1e-12, 1e-13, 1e-15, 0.0] {
        let delassus = matrix![1.0, 0.0, 0.0; 0.0, inverse_mass, 0.0; 0.0, 0.0, 1.0];
        let problem = ImpactProblem::new(delassus, vector![0.0, 1.0, -1.0]).unwrap();
        for name in with_friction() {
            let given = Coefficients { restitution: 0.5, friction: 0.5, ..Coefficients::default() };
            let hit = law_by_name::<3>(name, given).unwrap().resolve(&problem).unwrap();
            assert!((hit.impulse - vector![0.0, -0.75, 1.5]).norm() < 1e-5, "{name}, H_tt {inverse_mass}: {hit:?}");
        }
    }
}

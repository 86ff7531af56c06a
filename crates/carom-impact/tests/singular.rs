//! Delassus matrices with a null direction: the outcome if there is one, an error if there is none, and never a NaN.

use crate::common::{Case, FOLLOWING, close, resolve};
use carom_impact::{Energetic, Flags, Frictionless, ImpactError, ImpactProblem, LAW_NAMES, Law, Mode, Newton, Poisson};
use nalgebra::{Matrix2, Vector2, matrix, vector};

fn with_friction() -> impl Iterator<Item = &'static str> {
    LAW_NAMES.into_iter().filter(|name| *name != "frictionless")
}

/// H and u⁻ of one joint of unit inertia, with its coefficients.
fn arm(j: Vector2<f64>, qd: f64, [restitution, friction]: [f64; 2]) -> Case<2> {
    Case { delassus: j * j.transpose(), u: j * qd, restitution, friction }
}

/// At a wall with large friction a single-joint arm slips until it stops in both directions at once; then it stays: no
/// impulse in the cone turns the joint back.
#[test]
fn single_joint_arm_that_sticks_stays_at_rest() {
    for (j, qd) in [(vector![0.3, 0.7], -1.0), (vector![-0.3, 0.7], -1.0), (vector![0.1, -0.9], 2.0)] {
        let ratio = j[0] / j[1];
        let problem = arm(j, qd, [0.0, 0.0]).problem();
        close("mu_stick = mu_jam", problem.mu_stick(), problem.mu_jam().unwrap(), 1e-14);
        for e in [0.0, 0.5, 1.0] {
            for mu in [1.01 / ratio.abs(), 10.0 / ratio.abs(), 1e6] {
                for law in FOLLOWING {
                    let hit = arm(j, qd, [e, mu]).resolve(law);
                    assert!(hit.u_plus.amax() <= 1e-15, "{law} {hit:?}");
                    assert!(hit.impulse.amax().is_finite());
                    assert!(hit.flags.contains(Flags::SINGULAR) && hit.mode != Mode::Open);
                    assert!(!hit.flags.contains(Flags::ENERGY_GAIN));
                    close(law, hit.energy_change, -hit.energy_before, 1e-15);
                    // Poisson's impulse is prescribed, and does not change the velocity.
                    let returned = if law == "poisson" { e } else { 0.0 };
                    close(law, hit.poisson.unwrap(), returned, 1e-14);
                }
            }
        }
    }
}

/// With less friction it slips back, and rebounds as usual. Without friction nothing holds its tangent, and the singular
/// direction has no influence: every law has the frictionless outcome, without a flag.
#[test]
fn single_joint_arm_with_less_friction_rebounds() {
    let j = vector![0.3, 0.7];
    for law in ["newton", "poisson", "energetic", "whittaker", "frictionless"] {
        let hit = arm(j, -1.0, [0.5, 0.4]).resolve(law);
        // One joint: the contact velocities stay in proportion.
        close(law, hit.u_plus[0] * 0.7, hit.u_plus[1] * 0.3, 1e-15);
        assert!(hit.u_plus[1] > 0.1 && hit.mode == Mode::ReverseSlip, "{law} {hit:?}");
        assert_eq!(hit.flags.contains(Flags::SINGULAR), law != "frictionless");
        assert!(hit.energy_change < 0.0);
        assert!(law != "newton" || (hit.newton.unwrap() - 0.5).abs() < 1e-14);
    }
    for law in LAW_NAMES {
        let hit = arm(j, -1.0, [0.5, 0.0]).resolve(law);
        assert_eq!((hit.flags, hit.impulse[0]), (Flags::NONE, 0.0), "{law}");
        // u⁺ = j q̇ with q̇ = -0.5 q̇⁻
        close(law, (hit.u_plus - j * 0.5).norm(), 0.0, 1e-15);
    }
}

/// Whittaker's rebound is prescribed, and a sticking single-joint arm cannot make it. With e = 0 it can, by a range of
/// impulses.
#[test]
fn whittaker_wedges_or_is_not_unique() {
    let at = |coefficients| arm(vector![0.3, 0.7], -1.0, coefficients);
    let refusal = at([0.5, 3.0]).resolved("whittaker").unwrap_err();
    assert!(matches!(refusal, ImpactError::Wedged { .. }), "{refusal}");
    let plastic = at([0.0, 2.0]).resolve("whittaker");
    assert_eq!((plastic.u_plus, plastic.mode), (Vector2::zeros(), Mode::Stick));
    assert!(plastic.flags.contains(Flags::SINGULAR));
    let both = at([0.0, 1.0]).resolve("whittaker");
    assert!(both.flags.contains(Flags::NON_UNIQUE), "{both:?}");
    assert!(both.impulse[0] > 0.0, "against the first slip, which points to -t");
}

/// A surface that moves along the null direction of H: friction makes the contact stick while it still approaches, and
/// no finite impulse ends the impact.
#[test]
fn sticking_while_approaching_is_a_wedge() {
    let own = arm(vector![0.3, 0.7], -1.0, [0.5, 4.0]);
    for law in FOLLOWING {
        let refusal = Case { u: vector![0.5, -0.7], ..own }.resolved(law).unwrap_err();
        assert!(matches!(refusal, ImpactError::Wedged { normal_velocity, .. } if normal_velocity < -0.7), "{refusal}");
        // In the opposite direction slip stops in restitution, and the contact sticks with the normal velocity at that
        // time.
        let hit = Case { u: vector![-0.4, -0.7], ..own }.resolve(law);
        assert_eq!((hit.u_plus[0], hit.mode), (0.0, Mode::Stick));
        close(law, hit.u_plus[1], 0.4 * 7.0 / 3.0 - 0.7, 1e-15);
        assert!(hit.impulse.amax().is_finite());
    }
}

/// A contact may have the normal axis alone.
#[test]
fn contact_without_tangents_is_resolved() {
    for law in LAW_NAMES {
        let hit = resolve(law, matrix![2.0], vector![-1.0], [0.5, 0.3]);
        assert_eq!((hit.u_plus, hit.impulse, hit.flags), (vector![0.5], vector![0.75], Flags::NONE), "{law}");
        assert_eq!(hit.energy_ratio(), 0.25);
    }
}

#[test]
fn singular_normal_direction_is_refused() {
    for c in [0.0, 1e-30, -1e-18] {
        let delassus = Matrix2::new(1.0, 0.0, 0.0, c);
        for law in LAW_NAMES {
            let case = Case { delassus, u: vector![0.5, -1.0], restitution: 0.5, friction: 0.3 };
            let refusal = case.resolved(law).unwrap_err();
            assert!(matches!(refusal, ImpactError::SingularNormal { .. }), "{law} {refusal}");
        }
        // A separating contact needs no impulse.
        let parting = ImpactProblem::new(delassus, vector![0.5, 1.0]).unwrap();
        assert!(Frictionless { restitution: 0.5 }.resolve(&parting).is_ok());
    }
    // An inverse mass that may be rounding is accepted, with a flag.
    let doubtful = ImpactProblem::new(Matrix2::new(1.0, 0.0, 0.0, 1e-15), vector![0.5, -1.0]).unwrap();
    let hit = Frictionless { restitution: 0.5 }.resolve(&doubtful).unwrap();
    assert_eq!(hit.flags, Flags::SINGULAR);
}

/// Null pivots are skipped, whichever of the three they are.
#[test]
fn energy_of_a_rank_deficient_matrix() {
    let j = vector![0.3, 0.7];
    let problem = arm(j, -2.0, [0.0, 0.0]).problem();
    close("½ q̇²", problem.kinetic_energy(problem.u_minus()), 2.0, 1e-15);
    let j = nalgebra::matrix![0.3, 0.1; 0.7, -0.2; 0.5, 0.4];
    let qd = vector![1.0, -2.0];
    let planar = ImpactProblem::new(j * j.transpose(), j * qd).unwrap();
    close("½ q̇·q̇", planar.kinetic_energy(planar.u_minus()), 2.5, 1e-13);
    let frozen = ImpactProblem::new(nalgebra::Matrix3::zeros(), vector![1.0, 2.0, 3.0]).unwrap();
    assert_eq!(frozen.kinetic_energy(frozen.u_minus()), 0.0);
}

/// As det H -> 0 the energetic and kinetic laws tend to the sticking arm; the kinematic one does not.
#[test]
fn near_singular_matrices_tend_to_the_sticking_arm() {
    let j = vector![0.3, 0.7];
    let near = |det: f64| {
        let across = vector![0.7, -0.3];
        let h = j * j.transpose() + across * across.transpose() * det;
        ImpactProblem::new(h, -j).unwrap()
    };
    let (e, mu) = (0.5, 4.0);
    for det in [1e-6, 1e-9, 1e-12] {
        let energetic = Energetic { restitution: e, friction: mu }.resolve(&near(det)).unwrap();
        let poisson = Poisson { restitution: e, friction: mu }.resolve(&near(det)).unwrap();
        let newton = Newton { restitution: e, friction: mu }.resolve(&near(det)).unwrap();
        assert!(energetic.u_plus[1] < 2.0 * det.sqrt() && poisson.u_plus[1] < 10.0 * det);
        close("newton", newton.u_plus[1], 0.35, 1e-14);
        assert!(newton.impulse[1] > 0.01 / det && newton.flags.contains(Flags::ENERGY_GAIN));
    }
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
        let case = Case { delassus, u, restitution, friction };
        for name in with_friction() {
            let Ok(hit) = case.resolved(name) else { continue };
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
        let case = Case { delassus, u, restitution, friction };
        // Without friction C p = (1 + e) |u_n|; friction multiplies it by no more than 1/|1 − μ |B|/C|.
        let grip = (1.0 - friction / flat).abs().min(1.0);
        let most = (1.0 + restitution) / flat / grip;
        for name in LAW_NAMES {
            match case.resolved(name) {
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
        let hit = resolve("brach", delassus, u, [0.0, friction]);
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
        for name in with_friction() {
            let hit = resolve(name, delassus, u, [0.5, friction]);
            for one in [Flags::JAM, Flags::SINGULAR] {
                assert_eq!(hit.flags.contains(one), flag.contains(one), "{name}: {hit:?}");
            }
        }
    }
}

/// Sliding friction −μ P_n does not depend on how heavy the contact is along its slip, also where this mass is infinite to rounding.
#[test]
fn friction_acts_along_a_tangent_that_hardly_moves() {
    for inverse_mass in [1e-6, 1e-9, 1e-12, 1e-13, 1e-15, 0.0] {
        let delassus = matrix![1.0, 0.0, 0.0; 0.0, inverse_mass, 0.0; 0.0, 0.0, 1.0];
        for name in with_friction() {
            let hit = resolve(name, delassus, vector![0.0, 1.0, -1.0], [0.5, 0.5]);
            assert!((hit.impulse - vector![0.0, -0.75, 1.5]).norm() < 1e-5, "{name}, H_tt {inverse_mass}: {hit:?}");
        }
    }
}

/// A slide along the normal: the tangent is singular, and every law has the impulse of a mass, with slip that nothing changes.
#[test]
fn a_contact_that_moves_along_its_normal_only_gets_the_impulse_of_a_mass() {
    for (slip, friction, e, mass) in [
        (0.0, 0.3, 0.5, 0.5),
        (1.0, 0.3, 0.5, 0.5),
        (-1.0, 0.3, 0.5, 0.5),
        (0.0, 0.0, 0.5, 2.0),
        (0.0, 0.4, 1.0, 2.0),
        (0.3, 0.0, 0.0, 2.0),
        (0.3, 0.4, 0.5, 2.0),
    ] {
        for law in LAW_NAMES {
            let hit = resolve(law, matrix![0.0, 0.0; 0.0, 1.0 / mass], vector![slip, -1.5], [e, friction]);
            let told = format!("{law} {slip} {friction}: {hit:?}");
            assert!((hit.impulse.y / ((1.0 + e) * 1.5 * mass) - 1.0).abs() < 1e-14, "{told}");
            assert_eq!((hit.u_plus[0], hit.flags), (slip, Flags::NONE), "{told}");
            close(&told, hit.u_plus[1], e * 1.5, 1e-15);
            assert_eq!(hit.mode, if slip == 0.0 { Mode::Stick } else { Mode::Slip }, "{told}");
        }
    }
}

//! Delassus matrices with a null direction: the outcome if there is one, an error if there is none, and never a NaN.

use crate::common::{close, rough};
use carom_impact::{
    Energetic, Flags, Frictionless, ImpactError, ImpactProblem, LAW_NAMES, Law, Mode, Newton, Poisson, law_by_name,
};
use nalgebra::{Matrix2, Vector2, vector};

/// One joint of unit inertia: `H = j jᵀ`, `u = j q̇`.
fn single_joint(j: Vector2<f64>, qd: f64) -> ImpactProblem<f64, 2> {
    ImpactProblem::new(j * j.transpose(), j * qd).unwrap()
}

/// At a wall with large friction a single-joint arm slips until it stops in both directions at once; then it stays: no
/// impulse in the cone turns the joint back.
#[test]
fn single_joint_arm_that_sticks_stays_at_rest() {
    for (j, qd) in [(vector![0.3, 0.7], -1.0), (vector![-0.3, 0.7], -1.0), (vector![0.1, -0.9], 2.0)] {
        let ratio = j[0] / j[1];
        let problem = single_joint(j, qd);
        close("mu_stick = mu_jam", problem.mu_stick(), problem.mu_jam().unwrap(), 1e-14);
        for e in [0.0, 0.5, 1.0] {
            for mu in [1.01 / ratio.abs(), 10.0 / ratio.abs(), 1e6] {
                for law in ["newton", "poisson", "energetic"] {
                    let hit = law_by_name::<2>(law, rough(e, mu)).unwrap().resolve(&problem).unwrap();
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

/// With less friction it slips back, and rebounds as usual.
#[test]
fn single_joint_arm_with_less_friction_rebounds() {
    let problem = single_joint(vector![0.3, 0.7], -1.0);
    for (law, e) in [("newton", 0.5), ("poisson", 0.5), ("energetic", 0.5), ("whittaker", 0.5), ("frictionless", 0.5)] {
        let hit = law_by_name::<2>(law, rough(e, 0.4)).unwrap().resolve(&problem).unwrap();
        // One joint: the contact velocities stay in proportion.
        close(law, hit.u_plus[0] * 0.7, hit.u_plus[1] * 0.3, 1e-15);
        assert!(hit.u_plus[1] > 0.1 && hit.mode == Mode::ReverseSlip, "{law} {hit:?}");
        assert_eq!(hit.flags.contains(Flags::SINGULAR), law != "frictionless");
        assert!(hit.energy_change < 0.0);
    }
    let newton = Newton { restitution: 0.5, friction: 0.4 }.resolve(&problem).unwrap();
    close("newton", newton.newton.unwrap(), 0.5, 1e-14);
}

/// Whittaker's rebound is prescribed, and a sticking single-joint arm cannot make it. With e = 0 it can, by a range of
/// impulses.
#[test]
fn whittaker_wedges_or_is_not_unique() {
    let problem = single_joint(vector![0.3, 0.7], -1.0);
    let refusal = law_by_name::<2>("whittaker", rough(0.5, 3.0)).unwrap().resolve(&problem).unwrap_err();
    assert!(matches!(refusal, ImpactError::Wedged { .. }), "{refusal}");

    let plastic = law_by_name::<2>("whittaker", rough(0.0, 2.0)).unwrap().resolve(&problem).unwrap();
    assert_eq!((plastic.u_plus, plastic.mode), (Vector2::zeros(), Mode::Stick));
    assert!(plastic.flags.contains(Flags::SINGULAR));
    let both = law_by_name::<2>("whittaker", rough(0.0, 1.0)).unwrap().resolve(&problem).unwrap();
    assert!(both.flags.contains(Flags::NON_UNIQUE), "{both:?}");
    assert!(both.impulse[0] > 0.0, "against the first slip, which points to -t");
}

/// A surface that moves along the null direction of H: friction makes the contact stick while it still approaches, and
/// no finite impulse ends the impact.
#[test]
fn sticking_while_approaching_is_a_wedge() {
    let j = vector![0.3, 0.7];
    let problem = ImpactProblem::new(j * j.transpose(), vector![0.5, -0.7]).unwrap();
    for law in ["newton", "poisson", "energetic"] {
        let refusal = law_by_name::<2>(law, rough(0.5, 4.0)).unwrap().resolve(&problem).unwrap_err();
        assert!(matches!(refusal, ImpactError::Wedged { normal_velocity, .. } if normal_velocity < -0.7), "{refusal}");
        // In the opposite direction slip stops in restitution, and the contact sticks with the normal velocity at that
        // time.
        let other = ImpactProblem::new(j * j.transpose(), vector![-0.4, -0.7]).unwrap();
        let hit = law_by_name::<2>(law, rough(0.5, 4.0)).unwrap().resolve(&other).unwrap();
        assert_eq!((hit.u_plus[0], hit.mode), (0.0, Mode::Stick));
        close(law, hit.u_plus[1], 0.4 * 7.0 / 3.0 - 0.7, 1e-15);
        assert!(hit.impulse.amax().is_finite());
    }
}

/// A slide along the normal: the tangent is singular, and every law has an outcome.
#[test]
fn singular_tangent_is_resolved() {
    let h = Matrix2::new(0.0, 0.0, 0.0, 2.0);
    for law in LAW_NAMES {
        for (v_t, mode) in [(0.0, Mode::Stick), (1.0, Mode::Slip), (-1.0, Mode::Slip)] {
            let problem = ImpactProblem::new(h, vector![v_t, -1.0]).unwrap();
            let hit = law_by_name::<2>(law, rough(0.5, 0.3)).unwrap().resolve(&problem).unwrap();
            assert_eq!((hit.u_plus, hit.mode, hit.flags), (vector![v_t, 0.5], mode, Flags::NONE), "{law}");
            close(law, hit.impulse[1], 0.75, 1e-15);
        }
    }
}

/// A contact may have the normal axis alone.
#[test]
fn contact_without_tangents_is_resolved() {
    let problem = ImpactProblem::new(nalgebra::matrix![2.0], vector![-1.0]).unwrap();
    for law in LAW_NAMES {
        let hit = law_by_name::<1>(law, rough(0.5, 0.3)).unwrap().resolve(&problem).unwrap();
        assert_eq!((hit.u_plus, hit.impulse, hit.flags), (vector![0.5], vector![0.75], Flags::NONE), "{law}");
        assert_eq!(hit.energy_ratio(), 0.25);
    }
}

#[test]
fn singular_normal_direction_is_refused() {
    for c in [0.0, 1e-30, -1e-18] {
        let problem = ImpactProblem::new(Matrix2::new(1.0, 0.0, 0.0, c), vector![0.5, -1.0]).unwrap();
        for law in LAW_NAMES {
            let refusal = law_by_name::<2>(law, rough(0.5, 0.3)).unwrap().resolve(&problem).unwrap_err();
            assert!(matches!(refusal, ImpactError::SingularNormal { .. }), "{law} {refusal}");
        }
        // A separating contact needs no impulse.
        let parting = ImpactProblem::new(Matrix2::new(1.0, 0.0, 0.0, c), vector![0.5, 1.0]).unwrap();
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
    let problem = single_joint(j, -2.0);
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

/// Without friction nothing holds the tangent of a single-joint arm, and the singular direction has no influence: every
/// law has the frictionless outcome, without a flag.
#[test]
fn frictionless_single_joint_arm_is_not_flagged_as_singular() {
    let j = vector![0.3, 0.7];
    let problem = single_joint(j, -1.0);
    for law in LAW_NAMES {
        let hit = law_by_name::<2>(law, rough(0.5, 0.0)).unwrap().resolve(&problem).unwrap();
        assert_eq!(hit.flags, Flags::NONE, "{law}");
        close(law, hit.impulse[0], 0.0, 0.0);
        // u⁺ = j q̇ with q̇ = -0.5 q̇⁻
        close(law, (hit.u_plus - j * 0.5).norm(), 0.0, 1e-15);
    }
}

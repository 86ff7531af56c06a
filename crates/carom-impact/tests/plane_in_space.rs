//! Contacts in space whose slip stays in a plane have the outcome of the planar problem, rotated about the normal.

use crate::common::{any_case, close, rough};
use carom_impact::{Flags, ImpactOutcome, ImpactProblem, LAW_NAMES, Mode, law_by_name};
use nalgebra::{Matrix3, Rotation3, Vector3, matrix, vector};

fn resolve(law: &str, h: Matrix3<f64>, u: Vector3<f64>, e: f64, mu: f64) -> ImpactOutcome<f64, 3> {
    law_by_name(law, rough(e, mu)).unwrap().resolve(&ImpactProblem::new(h, u).unwrap()).unwrap()
}

#[test]
fn rotated_planar_problem_has_the_rotated_outcome() {
    let mut rng = fastrand::Rng::with_seed(3);
    for i in 0..10_000 {
        let mut case = any_case(&mut rng, 0.1);
        if i % 10 == 0 {
            case.u[0] = 0.0;
        }
        let across = if i % 3 == 0 { 0.0 } else { rng.f64() }; // a planar robot has none
        let (h2, u2) = (case.delassus, case.u);
        let h = matrix![h2[(0, 0)], 0.0, h2[(0, 1)]; 0.0, across, 0.0; h2[(0, 1)], 0.0, h2[(1, 1)]];
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * rng.f64());
        let (turned_h, turned_u) = (turn * h * turn.inverse(), turn * vector![u2[0], 0.0, u2[1]]);
        for law in LAW_NAMES {
            let plane =
                law_by_name(law, rough(case.restitution, case.friction)).unwrap().resolve(&case.problem()).unwrap();
            let space = resolve(law, turned_h, turned_u, case.restitution, case.friction);
            let lift = |x: nalgebra::Vector2<f64>| turn * vector![x[0], 0.0, x[1]];
            // Turning H costs a few ε, amplified by its condition (100).
            let size = 1e-12 * plane.u_plus.norm().max(1.0);
            close(law, (space.u_plus - lift(plane.u_plus)).norm(), 0.0, size);
            // Smith's law turns a rounded slip across the plane into friction, μ P_n/|v_t| times it.
            let stiff = if law == "smith" { 1.0 + case.friction } else { 1.0 };
            let within = 1e-12 * stiff * plane.impulse.norm();
            close(law, (space.impulse - lift(plane.impulse)).norm(), 0.0, within);
            close(law, space.energy_change, plane.energy_change, size * plane.impulse.norm());
            close(law, space.energy_ratio(), plane.energy_ratio(), 1e-11 * plane.energy_ratio().max(1.0));
            assert_eq!(space.mode, plane.mode, "{law} {case:?}");
        }
    }
}

/// Along an axis nothing is rounded: the outcomes are identical bit by bit.
#[test]
fn aligned_plane_gives_identical_numbers() {
    let mut rng = fastrand::Rng::with_seed(4);
    for _ in 0..1000 {
        let case = any_case(&mut rng, 0.1);
        let (h, u) = (*case.problem().delassus(), case.u);
        let space = matrix![h[(0, 0)], 0.0, h[(0, 1)]; 0.0, 0.5, 0.0; h[(0, 1)], 0.0, h[(1, 1)]];
        for law in ["newton", "poisson", "energetic", "whittaker"] {
            let two =
                law_by_name(law, rough(case.restitution, case.friction)).unwrap().resolve(&case.problem()).unwrap();
            let three = resolve(law, space, vector![u[0], 0.0, u[1]], case.restitution, case.friction);
            assert_eq!([two.u_plus[0], 0.0, two.u_plus[1]], [three.u_plus[0], three.u_plus[1], three.u_plus[2]]);
            assert_eq!([two.impulse[0], 0.0, two.impulse[1]], [three.impulse[0], three.impulse[1], three.impulse[2]]);
            assert_eq!(two.normal_work, three.normal_work);
        }
    }
}

/// A solid sphere, m = R = 1: `H = diag(7/2, 7/2, 1)`, without inertial coupling, so any slip stays in its plane.
#[test]
fn solid_sphere_has_its_closed_form() {
    let h = Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    for law in ["newton", "poisson", "energetic", "whittaker"] {
        for direction in [vector![1.0, 0.0], vector![0.6, -0.8], vector![-0.28, 0.96]] {
            let u = vector![direction[0], direction[1], -1.0];
            let slips = resolve(law, h, u, 0.8, 0.1);
            let expected = vector![0.37 * direction[0], 0.37 * direction[1], 0.8];
            close(law, (slips.u_plus - expected).norm(), 0.0, 1e-15);

            let sticks = resolve(law, h, u, 0.8, 0.5);
            close(law, (sticks.u_plus - vector![0.0, 0.0, 0.8]).norm(), 0.0, 1e-15);
            close(law, sticks.impulse.xy().norm(), 2.0 / 7.0, 1e-15);
            assert_eq!(sticks.mode, Mode::Stick);
        }
        // Dropped vertically it has no slip direction, and none is needed.
        let straight = resolve(law, h, vector![0.0, 0.0, -1.0], 0.8, 0.5);
        assert_eq!((straight.u_plus, straight.mode), (vector![0.0, 0.0, 0.8], Mode::Stick));
        assert_eq!(straight.flags, Flags::NONE);
    }
}

/// Without friction the direction of slip does not matter, for any coupling.
#[test]
fn without_friction_all_laws_agree_in_space() {
    let general = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    let tangents = matrix![2.0, 0.3, 0.5; 0.3, 1.5, 0.0; 0.5, 0.0, 1.2];
    let normal = matrix![2.0, 0.0, 0.5; 0.0, 1.5, -0.4; 0.5, -0.4, 1.2];
    for h in [general, tangents, normal] {
        for u in [vector![0.6, -0.2, -1.0], vector![1.0, 0.0, -1.0]] {
            let frictionless = resolve("frictionless", h, u, 0.6, 0.3);
            for law in LAW_NAMES {
                let smooth = resolve(law, h, u, 0.6, 0.0);
                assert_eq!(smooth.law, law);
                close(law, (smooth.u_plus - frictionless.u_plus).norm(), 0.0, 1e-15);
                assert_eq!((smooth.impulse, smooth.mode), (frictionless.impulse, frictionless.mode), "{law}");
            }
        }
    }
}

/// The direction of a slip that is rounding of the approach is not used.
#[test]
fn rounding_in_the_slip_does_not_choose_the_plane() {
    let h = matrix![2.0, 0.0, 0.5; 0.0, 1.5, 0.0; 0.5, 0.0, 1.2];
    let clean = resolve("energetic", h, vector![0.0, 0.0, -1.0], 0.6, 0.1);
    let noisy = resolve("energetic", h, vector![-1e-17, 3e-17, -1.0], 0.6, 0.1);
    close("u+", (clean.u_plus - noisy.u_plus).norm(), 0.0, 1e-15);
    assert_eq!(noisy.mode, Mode::Slip);
}

/// `Frictionless` needs no plane: any matrix, in space.
#[test]
fn frictionless_outcome_in_space_is_the_closed_form() {
    let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    let u = vector![0.6, -0.2, -1.0];
    let hit = resolve("frictionless", h, u, 0.6, 0.0);
    let p_n = 1.6 / 1.2;
    close("u+", (hit.u_plus - vector![0.6 + 0.5 * p_n, -0.2 - 0.4 * p_n, 0.6]).norm(), 0.0, 1e-15);
    close("loss", hit.energy_change, -0.5 * (1.0 - 0.36) / 1.2, 1e-15);
    let inverse = h.try_inverse().unwrap();
    let energy = |u: Vector3<f64>| 0.5 * u.dot(&(inverse * u));
    close("ratio", hit.energy_ratio(), energy(hit.u_plus) / energy(u), 1e-15);
}

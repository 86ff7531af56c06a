//! Joint velocities for a velocity of a link.

use crate::common::{Zoo, close, sample, vector};
use carom_chain::{ChainError, FramePoint, ToolMotion, uniform_chain};
use nalgebra::{DVector, Vector3};

/// Of all joint velocities that give the point its velocity, those found have the least energy (or norm): any other one differs by a
/// velocity of the null space, and is larger by the energy (or norm) of this difference alone (Pythagoras).
#[test]
fn tool_velocities_are_reached_and_least() {
    let mut seen = [0; 3];
    for seed in 0..80 {
        let mut own = sample(6 + seed as usize % 6, Zoo::All, seed);
        let q = own.q();
        let chain = own.chain.clone();
        let Some(link) = chain.frames().iter().rev().find(|frame| frame.body.is_some()) else { continue };
        let at = FramePoint::new(chain.frame(&link.name).unwrap(), vector(&mut own.rng));
        let point = chain.point(at.frame, at.offset);
        let (u, other) = (vector(&mut own.rng), DVector::from_vec(own.v()));
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(&chain, &q).unwrap();
        let mass = kin.mass_matrix();
        for (k, (motion, name)) in ToolMotion::ALL.into_iter().enumerate() {
            let Ok(found) = kin.tool_velocity(at, u, motion) else { continue };
            seen[k] += 1;
            close(name, kin.point_velocity(point, found.as_slice()).unwrap().iter(), u.iter(), 1e-9, 0.1);
            let mut rows = kin.geometric_jacobian(at.frame);
            rows.rows_mut(3, 3).copy_from(&kin.point_jacobian(point));
            if motion == ToolMotion::Translation {
                let spin = kin.angular_velocity(at.frame, found.as_slice()).unwrap();
                assert!(spin.norm() < 1e-8 * found.amax(), "{name}: the link turns at {} rad/s", spin.norm());
            } else {
                rows = rows.rows(3, 3).into_owned();
            }
            // The part of another velocity that does not move the point.
            let null = &other - rows.clone().pseudo_inverse(1e-9).unwrap() * (&rows * &other);
            let product = match motion {
                ToolMotion::LeastNorm => found.dot(&null),
                _ => found.dot(&(&mass * &null)),
            };
            let size = found.norm() * null.norm() * if motion == ToolMotion::LeastNorm { 1.0 } else { mass.amax() };
            assert!(product.abs() <= 1e-7 * size, "seed {seed}, {name}: {product} of {size}");
        }
    }
    assert!(seen.iter().all(|count| *count > 20), "reached only {seen:?}");
}

/// A planar arm of two links cannot move its tip without turning the last link, and at a stretched pose not along itself.
#[test]
fn tool_velocities_that_no_joints_give_are_refused_with_the_link() {
    let arm = uniform_chain(2, 1.0, 1.0).unwrap();
    let tip = FramePoint::from(arm.frame("tip").unwrap());
    let mut workspace = arm.workspace();
    let mut refusal = |q: [f64; 2], u: Vector3<f64>, motion| {
        let mut at = workspace.update(&arm, &q).unwrap();
        at.tool_velocity(tip, u, motion).unwrap_err().to_string()
    };
    let turns = refusal([0.3, 0.8], Vector3::new(0.1, 0.2, 0.0), ToolMotion::Translation);
    assert!(turns.contains("'tip'") && turns.contains("without turning it"), "{turns}");
    for motion in [ToolMotion::LeastEnergy, ToolMotion::LeastNorm] {
        let stretched = refusal([0.3, 0.0], Vector3::new(0.3_f64.cos(), 0.3_f64.sin(), 0.0), motion);
        assert!(stretched.contains("'tip'") && stretched.contains("m/s: change q"), "{stretched}");
    }
    let mut at = workspace.update(&arm, &[0.3, 0.8]).unwrap();
    for (motion, _) in ToolMotion::ALL {
        let fixed = at.tool_velocity(FramePoint::from(arm.frame("link0").unwrap()), Vector3::x(), motion);
        assert!(matches!(fixed, Err(ChainError::FixedPoint { .. })), "{fixed:?}");
    }
    let nan = at.tool_velocity(tip, Vector3::new(0.0, f64::NAN, 0.0), ToolMotion::LeastNorm);
    assert!(matches!(nan, Err(ChainError::NotFinite { index: 1, .. })));
}

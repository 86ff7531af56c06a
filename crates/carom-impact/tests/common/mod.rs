//! Shared by the tests: random problems, and comparisons whose messages contain the numbers.

use carom_impact::{Coefficients, ImpactProblem};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// One random planar impact with its coefficients.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub delassus: Matrix2<f64>,
    pub u: Vector2<f64>,
    pub restitution: f64,
    pub friction: f64,
}

impl Case {
    pub fn problem(&self) -> ImpactProblem<f64, 2> {
        ImpactProblem::new(self.delassus, self.u).unwrap()
    }
}

/// A random planar impact: `H = G Gᵀ` with condition number up to about `1/flat²`, a speed of 1 in any approaching
/// direction, e in [0, 1] with both ends drawn, friction from 0 to beyond any jam.
pub fn any_case(rng: &mut fastrand::Rng, flat: f64) -> Case {
    let wide = |rng: &mut fastrand::Rng| 2.0 * rng.f64() - 1.0;
    let (turn, length) = (std::f64::consts::TAU * rng.f64(), flat + (1.0 - flat) * rng.f64());
    let axes = Matrix2::new(turn.cos(), -turn.sin(), turn.sin(), turn.cos());
    let delassus = axes * Matrix2::new(1.0, 0.0, 0.0, length * length) * axes.transpose();
    let angle = std::f64::consts::PI * rng.f64();
    let restitution = match rng.u8(0..10) {
        0 => 0.0,
        1 => 1.0,
        _ => rng.f64(),
    };
    let friction = match rng.u8(0..4) {
        0 => 0.0_f64.max(wide(rng)),
        1 => 10.0_f64.powf(3.0 * wide(rng)),
        _ => 2.0 * rng.f64(),
    };
    Case { delassus, u: Vector2::new(angle.cos(), -angle.sin()), restitution, friction }
}

/// Asserts `|x - expected| <= within`, with the numbers in the message.
#[track_caller]
pub fn close(what: &str, x: f64, expected: f64, within: f64) {
    assert!((x - expected).abs() <= within, "{what}: {x:e} instead of {expected:e}, off by {:e}", x - expected);
}

/// Coefficients of restitution and friction.
pub fn rough(restitution: f64, friction: f64) -> Coefficients {
    Coefficients { restitution, friction, ..Coefficients::default() }
}

/// One random impact in space with its coefficients.
#[derive(Debug, Clone, Copy)]
pub struct Spatial {
    pub delassus: Matrix3<f64>,
    pub u: Vector3<f64>,
    pub restitution: f64,
    pub friction: f64,
}

impl Spatial {
    pub fn problem(&self) -> ImpactProblem<f64, 3> {
        ImpactProblem::new(self.delassus, self.u).unwrap()
    }
}

/// A random impact in space, as [`any_case`]: axes turned at random, square roots of the eigenvalues from `flat` to 1.
pub fn any_spatial(rng: &mut fastrand::Rng, flat: f64) -> Spatial {
    let Case { restitution, friction, .. } = any_case(rng, flat);
    let mut turn = || std::f64::consts::TAU * rng.f64();
    let axes = Rotation3::from_euler_angles(turn(), turn(), turn());
    let mut length = || flat + (1.0 - flat) * rng.f64();
    let lengths = Vector3::new(1.0, length(), length());
    let delassus = axes * Matrix3::from_diagonal(&lengths.component_mul(&lengths)) * axes.inverse();
    let delassus = (delassus + delassus.transpose()) * 0.5;
    // Uniform on the half sphere.
    let (height, angle) = (rng.f64(), std::f64::consts::TAU * rng.f64());
    let flat = (1.0 - height * height).sqrt();
    Spatial { delassus, u: Vector3::new(flat * angle.cos(), flat * angle.sin(), -height), restitution, friction }
}

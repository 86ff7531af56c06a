//! A direction that an axis of the tip keeps: rows of the inverse kinematics beside those of the position.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | a | D | unit vector of the axis, axes of the body | `axis` |
//! | d | D | its direction, axes of the chain | `direction` |
//! | T | D×(D − 1) | unit vectors across d as columns | `across` |
//! | R | D×D | rotation of the body | – |
//!
//! Tᵀ R a = 0 holds for R a = d and for R a = −d, which is no solution. R a is the difference of the positions of two points of the
//! body, so that its rows of the Jacobian are differences too.

use carom_chain::Point;
use carom_chain::algebra::Algebra;
use nalgebra::{DMatrix, SVector, Vector3};

/// A direction that an axis of the tip keeps.
#[derive(Debug, Clone)]
pub(super) struct Pointing<const D: usize> {
    axis: SVector<f64, D>,
    direction: SVector<f64, D>,
    across: Vec<SVector<f64, D>>,
    /// Weight of a radian beside a metre: the length of the arm, m.
    weight: f64,
}

impl<const D: usize> Pointing<D> {
    /// `axis` in the axes of the body and `direction` in those of the chain; both of any length above 0.
    pub fn new(axis: SVector<f64, D>, direction: SVector<f64, D>) -> Self {
        let direction = direction.normalize();
        let mut across: Vec<SVector<f64, D>> = Vec::new();
        let mut least: Vec<usize> = (0..D).collect();
        least.sort_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs()));
        for k in least.into_iter().take(D - 1) {
            let mut unit = SVector::<f64, D>::zeros();
            unit[k] = 1.0;
            for other in across.iter().chain([&direction]) {
                unit -= other * other.dot(&unit);
            }
            across.push(unit.normalize());
        }
        Self { axis: axis.normalize(), direction, across, weight: 1.0 }
    }

    /// The same direction with the weight of a radian, m.
    pub fn weighted(self, weight: f64) -> Self {
        Self { weight, ..self }
    }

    /// Number of its rows.
    pub fn rows(&self) -> usize {
        D - 1
    }

    /// The point one metre from `point` along the axis.
    pub fn ahead<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>>(&self, point: Point<A>) -> Point<A> {
        Point { body: point.body, position: point.position + self.axis }
    }

    /// Residual of row `i` with R a, m.
    pub fn missing(&self, i: usize, turned: &SVector<f64, D>) -> f64 {
        -self.weight * self.across[i].dot(turned)
    }

    /// Entry of row `i` of the Jacobian, from those of both points.
    pub fn slope(&self, i: usize, v: usize, [at, ahead]: [&DMatrix<f64>; 2]) -> f64 {
        self.weight * (0..D).map(|k| self.across[i][k] * (ahead[(k, v)] - at[(k, v)])).sum::<f64>()
    }

    /// Whether R a is on the side of d.
    pub fn is_ahead(&self, turned: &SVector<f64, D>) -> bool {
        self.direction.dot(turned) > 0.0
    }
}

/// A pointing that a study file gives: an axis of the tip, in the axes of its link, and a direction in the world.
pub(super) fn given(axis: [f64; 3], direction: [f64; 3]) -> Result<[Vector3<f64>; 2], String> {
    let [axis, direction] = [("axis", axis), ("direction", direction)].map(|(key, v)| {
        let vector = Vector3::from(v);
        let unit = vector.try_normalize(0.0).filter(|unit| unit.iter().all(|x| x.is_finite()));
        unit.ok_or_else(|| format!("[tip] pointing.{key} = {v:?}: it must be finite and not zero"))
    });
    Ok([axis?, direction?])
}

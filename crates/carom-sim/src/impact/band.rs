//! Bounds of an impact while e and μ vary in ranges.

use super::contact::Contact;
use crate::error::SimError;
use carom_impact::{CoefficientRanges, Law};
use nalgebra::Vector3;

/// Bounds [minimum, maximum] of an impact over ranges of the coefficients. Each bound is attained, but in general not all
/// of them for the same coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactBand {
    /// Bounds of each joint velocity after the impact, rad/s or m/s.
    pub qd_plus: Vec<[f64; 2]>,
    /// Bounds of the velocity of the contact point after the impact, world axes, m/s.
    pub u_plus: [[f64; 2]; 3],
    /// Bounds of the impulse on the robot, world axes, N s.
    pub impulse: [[f64; 2]; 3],
    /// `true`: the bounds are exact up to rounding. `false`: they are sampled and may be too narrow.
    pub exact: bool,
    /// Number of impacts computed.
    pub evaluations: usize,
}

impl Contact<'_> {
    /// Bounds of the outcome while e and μ vary in ranges. [`ImpactProblem::band`](carom_impact::ImpactProblem::band)
    /// documents for which problems the bounds are exact and for which they are sampled.
    ///
    /// # Errors
    /// [`SimError::Impact`]: errors of the law at any of the coefficients, an invalid range, a user-defined law.
    pub fn band(&self, law: &dyn Law<f64, 3>, ranges: &CoefficientRanges) -> Result<ImpactBand, SimError> {
        let Self { problem, aim, pass, .. } = self;
        let axes = &aim.axes;
        // Linear functions of the impulse in contact axes: qd⁺ − qd⁻, u⁺ − u⁻ and the impulse in world axes.
        let velocity = axes * problem.delassus();
        let rows = pass.response().response.iter().map(|row| axes.tr_mul(row));
        let rows = rows.chain((0..3).map(|i| velocity.row(i).transpose()));
        let rows: Vec<Vector3<f64>> = rows.chain((0..3).map(|i| axes.row(i).transpose())).collect();
        let found = problem.band(law, ranges, &rows)?;
        let u_minus = axes * problem.u_minus();
        let before = self.qd.iter().chain(u_minus.iter()).copied().chain([0.0; 3]);
        let bounds = before.zip(found.low.iter().zip(&found.high));
        let mut bounds: Vec<[f64; 2]> = bounds.map(|(x, (low, high))| [x + low, x + high]).collect();
        let rest = bounds.split_off(self.qd.len());
        Ok(ImpactBand {
            qd_plus: bounds,
            u_plus: [rest[0], rest[1], rest[2]],
            impulse: [rest[3], rest[4], rest[5]],
            exact: found.exact,
            evaluations: found.evaluations,
        })
    }
}

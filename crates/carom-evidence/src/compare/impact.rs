//! One impact of the protocol for single impacts.

use super::candidates::Candidate;
use super::planar::PlanarImpact;
use carom_study::fit::{LawPair, MeasuredImpact};
use nalgebra::DVector;

/// One impact that models predict.
#[derive(Debug, Clone)]
pub(super) enum Impact {
    Planar(PlanarImpact),
    Measured(Box<MeasuredImpact>),
}

impl Impact {
    /// The residual whose norm is |v − v⁺|/|v⁻| for the velocity v that a model predicts; `None` where its law refuses the impact.
    pub fn residual(&self, model: &Candidate, x: &[f64]) -> Option<DVector<f64>> {
        match self {
            Self::Planar(impact) => Some(DVector::from_column_slice(impact.residual(model, x)?.as_slice())),
            Self::Measured(impact) => {
                let law = LawPair::new(model.law, model.coefficients(x, impact.approach_speed())).ok()?;
                Some(impact.residual(&law).ok()? / impact.speed())
            }
        }
    }

    /// The norm of the residual; infinite where there is none.
    pub fn error(&self, model: &Candidate, x: &[f64]) -> f64 {
        self.residual(model, x).map_or(f64::INFINITY, |residual| residual.norm())
    }

    /// The least error of any impulse at the contact point that does not pull.
    pub fn bound(&self, model: &Candidate, x: &[f64]) -> f64 {
        match self {
            Self::Planar(impact) => impact.bound(model, x),
            Self::Measured(impact) => impact.least_residual(f64::INFINITY) / impact.speed(),
        }
    }
}

//! A contact at one state of a chain: the quantities that are the same for all laws.

use super::derivative::ImpactDerivative;
use super::hit::ChainImpact;
use super::prepared::{Aim, InSpace, Pass, PreparedStrike};
use crate::error::SimError;
use carom_chain::{ContactInertia, Spatial};
use carom_impact::{CoefficientRanges, ImpactOutcome, ImpactProblem, Law};
use nalgebra::{DMatrix, Vector3};
use std::cell::OnceCell;

/// A contact at one state of a chain, to which laws are applied.
#[derive(Debug)]
pub struct Contact<'a> {
    pub(super) aim: Aim<'a>,
    pub(super) pass: Pass<'a, Spatial<f64>, InSpace, 3>,
    pub(super) q: &'a [f64],
    pub(super) qd: &'a [f64],
    pub(super) problem: ImpactProblem<f64, 3>,
    jacobian: OnceCell<DMatrix<f64>>,
    inertia: OnceCell<ContactInertia>,
}

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

impl<'a> Contact<'a> {
    pub(super) fn new(aim: Aim<'a>, q: &'a [f64], qd: &'a [f64]) -> Result<Self, SimError> {
        let mut pass = Pass::in_space(&aim);
        let problem = pass.problem(&aim, (q, qd))?;
        Ok(Self { aim, pass, q, qd, problem, jacobian: OnceCell::new(), inertia: OnceCell::new() })
    }

    /// The impact problem, which is the input of the law: in contact axes, tangents first, normal last.
    pub fn problem(&self) -> &ImpactProblem<f64, 3> {
        &self.problem
    }

    /// Delassus matrix and effective mass at the contact point, world axes. Inertia of drives is included.
    pub fn inertia(&self) -> &ContactInertia {
        self.inertia.get_or_init(|| ContactInertia::of(self.pass.response()))
    }

    /// Jacobian of the contact point, 3×nv, world axes.
    pub fn jacobian(&self) -> &DMatrix<f64> {
        self.jacobian.get_or_init(|| {
            let columns = self.pass.response().jacobian;
            DMatrix::from_fn(3, columns.len(), |i, k| columns[k][i])
        })
    }

    /// M⁻¹Jᵀ, nv×3: the joint velocities after unit impulses along the world axes on the chain at rest. Inertia of drives is
    /// included.
    pub fn response(&self) -> DMatrix<f64> {
        let rows = self.pass.response().response;
        DMatrix::from_fn(rows.len(), 3, |k, i| rows[k][i])
    }

    /// Computes the impact with a law.
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law.
    pub fn resolve(&mut self, law: &dyn Law<f64, 3>) -> Result<ChainImpact, SimError> {
        let outcome = self.problem.resolve(law)?;
        self.carry(outcome)
    }

    /// Computes all impacts that satisfy the law, see [`Law::branches`]. The first one is that of [`Contact::resolve`].
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law.
    pub fn branches(&mut self, law: &dyn Law<f64, 3>) -> Result<Vec<ChainImpact>, SimError> {
        let outcomes = law.branches(&self.problem)?;
        if law.known().is_none() {
            outcomes.iter().try_for_each(|outcome| outcome.check(&self.problem))?;
        }
        outcomes.into_iter().map(|outcome| self.carry(outcome)).collect()
    }

    fn carry(&mut self, outcome: ImpactOutcome<f64, 3>) -> Result<ChainImpact, SimError> {
        let Self { aim, pass, q, qd, .. } = self;
        let mut hit = ChainImpact::empty(qd.len());
        pass.carry(aim, (q, qd), outcome, &mut hit)?;
        Ok(hit)
    }

    /// Computes the impact with a law and its derivatives: see [`Strike::derivative`](crate::Strike::derivative).
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law and for a user-defined law, which has no derivative;
    /// [`SimError::DerivativeOfHeldJoints`].
    pub fn derivative(&self, law: &dyn Law<f64, 3>) -> Result<ImpactDerivative, SimError> {
        PreparedStrike::new(self.aim.clone()).derivative(self.q, self.qd, law)
    }

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

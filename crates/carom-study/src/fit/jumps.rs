//! Measured velocity jumps, and their residuals under a law.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | u⁻, u⁺ | D | contact velocity before and after, contact axes, m/s | `u_minus`, `u_plus` |
//! | H | D×D | Delassus matrix, 1/kg | `delassus` |
//! | L, m | nv×nv, 1 | M = L Lᵀ at the impact, total mass | `metric` = Lᵀ/√m |
//! | b | m | measured jump: u⁺ − u⁻, or Lᵀ(qd⁺ − qd⁻)/√m, m/s | `jump` |
//! | A | m×D | jump per unit impulse: H, or Lᵀ M⁻¹ Jᵀ/√m | `reach` |
//!
//! The residual is b − A p, m/s, with p the impulse of the law. For a chain its norm is √(2T/m), with T the kinetic energy of
//! the error of the joint velocities. It does not depend on the choice of coordinates or on units of rotation.

use super::bound::least_residual;
use super::error::FitError;
use super::least_squares::pose_metric;
use carom_chain::{Chain, FramePoint};
use carom_impact::{Coefficients, ImpactError, ImpactProblem, Law, law_by_name};
use carom_sim::Impacts;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3};

/// One impact measured at the joints of a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainJump {
    /// Configuration at the impact, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities before the impact, rad/s or m/s.
    pub qd_minus: Vec<f64>,
    /// Joint velocities after the impact, rad/s or m/s.
    pub qd_plus: Vec<f64>,
    /// Contact point.
    pub point: FramePoint,
    /// Contact normal, world frame, from the environment to the robot; need not have length 1.
    pub normal: Vector3<f64>,
}

/// One measured impact, as the input of a fit.
#[derive(Debug, Clone)]
pub struct MeasuredImpact {
    problem: Problem,
    reach: DMatrix<f64>,
    jump: DVector<f64>,
    /// Norm of the velocity before the impact, in the metric of the residual, m/s.
    speed: f64,
    /// The measurement at the joints and its metric, to recompute H for another inertia.
    chain: Option<(ChainJump, DMatrix<f64>)>,
}

#[derive(Debug, Clone)]
enum Problem {
    Plane(ImpactProblem<f64, 2>),
    Space(ImpactProblem<f64, 3>),
}

impl MeasuredImpact {
    /// An impact in the plane, given by its Delassus matrix (1/kg) and the contact velocities before and after (m/s), in
    /// contact axes (tangent, normal).
    ///
    /// # Errors
    /// [`FitError::Impact`] for an invalid matrix or velocity, [`FitError::Input`], and [`FitError::NoApproach`] if
    /// u_n⁻ ≥ 0.
    pub fn in_plane(
        delassus: SMatrix<f64, 2, 2>,
        u_minus: SVector<f64, 2>,
        u_plus: SVector<f64, 2>,
    ) -> Result<Self, FitError> {
        let problem = ImpactProblem::new(delassus, u_minus)?;
        Self::of_numbers(&problem, u_plus, Problem::Plane(problem))
    }

    /// An impact in space, given by its Delassus matrix (1/kg) and the contact velocities before and after (m/s), in contact
    /// axes (two tangents, then the normal).
    ///
    /// # Errors
    /// As [`MeasuredImpact::in_plane`].
    pub fn in_space(
        delassus: SMatrix<f64, 3, 3>,
        u_minus: SVector<f64, 3>,
        u_plus: SVector<f64, 3>,
    ) -> Result<Self, FitError> {
        let problem = ImpactProblem::new(delassus, u_minus)?;
        Self::of_numbers(&problem, u_plus, Problem::Space(problem))
    }

    fn of_numbers<const D: usize>(
        numbers: &ImpactProblem<f64, D>,
        u_plus: SVector<f64, D>,
        problem: Problem,
    ) -> Result<Self, FitError> {
        if let Some(&value) = u_plus.iter().find(|x| !x.is_finite()) {
            return Err(FitError::not_finite("u_plus", value));
        }
        let jump = DVector::from_column_slice((u_plus - numbers.u_minus()).as_slice());
        let reach = DMatrix::from_column_slice(D, D, numbers.delassus().as_slice());
        Self { problem, reach, jump, speed: numbers.u_minus().norm(), chain: None }.approaching()
    }

    /// An impact of one rigid body in the plane: its mass (kg) and moment of inertia (kg m²), the tangential and the normal row
    /// of the contact Jacobian, and its velocities before and after (m/s, m/s, rad/s). The residual is that of a chain.
    ///
    /// # Errors
    /// As [`MeasuredImpact::in_plane`]; [`FitError::Input`] for a mass or moment of inertia that is not positive.
    #[doc(hidden)] // for carom-evidence
    pub fn of_planar_body(
        (mass, inertia): (f64, f64),
        rows: [Vector3<f64>; 2],
        before: Vector3<f64>,
        after: Vector3<f64>,
    ) -> Result<Self, FitError> {
        for (what, value) in [("mass", mass), ("moment of inertia", inertia)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FitError::setting(what, value, "it must be positive and finite"));
            }
        }
        if let Some(&value) = before.iter().chain(after.iter()).find(|x| !x.is_finite()) {
            return Err(FitError::not_finite("a velocity", value));
        }
        let jacobian = SMatrix::<f64, 2, 3>::from_rows(&[rows[0].transpose(), rows[1].transpose()]);
        let inverse = SMatrix::<f64, 3, 3>::from_diagonal(&Vector3::new(1.0 / mass, 1.0 / mass, 1.0 / inertia));
        let metric = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 1.0, (inertia / mass).sqrt()]));
        let problem = ImpactProblem::new(jacobian * inverse * jacobian.transpose(), jacobian * before)?;
        let response = inverse * jacobian.transpose();
        let whole = |v: Vector3<f64>| &metric * DVector::from_column_slice(v.as_slice());
        Self {
            problem: Problem::Plane(problem),
            reach: &metric * DMatrix::from_column_slice(3, 2, response.as_slice()),
            jump: whole(after - before),
            speed: whole(before).norm(),
            chain: None,
        }
        .approaching()
    }

    /// An impact of a chain, given by its joint velocities before and after.
    ///
    /// # Errors
    /// A state that does not fit the chain, a singular normal direction (H_nn = 0), and [`FitError::NoApproach`] if u_n⁻ ≥ 0.
    pub fn of_chain(chain: &Chain, measured: &ChainJump) -> Result<Self, FitError> {
        Self::of_chain_in(chain, measured, pose_metric(chain, &measured.q)?)?.approaching()
    }

    fn of_chain_in(chain: &Chain, measured: &ChainJump, metric: DMatrix<f64>) -> Result<Self, FitError> {
        let ChainJump { q, qd_minus, qd_plus, point, normal } = measured;
        chain.check_v("qd_plus", qd_plus)?;
        let contact = chain.impact(q, qd_minus).at(*point).normal(*normal).contact()?;
        let axes = carom_chain::algebra::z_onto(normal.normalize());
        let response = contact.response() * DMatrix::from_column_slice(3, 3, axes.as_slice());
        let change = DVector::from_iterator(qd_plus.len(), qd_plus.iter().zip(qd_minus).map(|(a, b)| a - b));
        let (reach, jump) = (&metric * response, &metric * change);
        let speed = (&metric * DVector::from_column_slice(qd_minus)).norm();
        let problem = Problem::Space(*contact.problem());
        Ok(Self { problem, reach, jump, speed, chain: Some((measured.clone(), metric)) })
    }

    fn approaching(self) -> Result<Self, FitError> {
        let speed = self.approach_speed();
        if speed > 0.0 { Ok(self) } else { Err(FitError::NoApproach { normal_velocity: -speed }) }
    }

    /// −u_n⁻, m/s.
    #[doc(hidden)] // for carom-evidence
    pub fn approach_speed(&self) -> f64 {
        match &self.problem {
            Problem::Plane(problem) => problem.approach_speed(),
            Problem::Space(problem) => problem.approach_speed(),
        }
    }

    /// Whether the impact was measured at a chain, so that its inertia can be scaled.
    #[doc(hidden)] // for carom-evidence
    pub fn has_robot(&self) -> bool {
        self.chain.is_some()
    }

    /// The same measurement for a chain with other inertia. The metric of the residuals is unchanged.
    pub(crate) fn on(&self, chain: &Chain) -> Result<Self, FitError> {
        match &self.chain {
            None => Err(FitError::NoInertia),
            Some((measured, metric)) => Self::of_chain_in(chain, measured, metric.clone()),
        }
    }

    /// Norm of the measured jump, m/s.
    #[doc(hidden)]
    pub fn size(&self) -> f64 {
        self.jump.norm()
    }

    /// Norm of the velocity before the impact in the metric of the residual, m/s.
    #[doc(hidden)]
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Residual under a law, m/s: measured minus computed u⁺ or, for a chain, measured minus computed joint velocities in the
    /// metric of the kinetic energy.
    ///
    /// # Errors
    /// Error of the law.
    #[doc(hidden)]
    pub fn residual(&self, laws: &LawPair) -> Result<DVector<f64>, ImpactError> {
        let impulse = match &self.problem {
            Problem::Plane(problem) => DVector::from_column_slice(laws.plane.resolve(problem)?.impulse.as_slice()),
            Problem::Space(problem) => DVector::from_column_slice(laws.space.resolve(problem)?.impulse.as_slice()),
        };
        Ok(&self.jump - &self.reach * impulse)
    }

    /// Lower bound of the residual norm, m/s, over all impulses in the cone of the coefficient `friction`; with
    /// `f64::INFINITY` over all impulses with p_n ≥ 0. The impulse of every law with that friction lies in the cone.
    #[doc(hidden)]
    pub fn least_residual(&self, friction: f64) -> f64 {
        least_residual(&self.reach, &self.jump, friction)
    }
}

/// A law with its coefficients, for impacts in the plane and in space.
pub struct LawPair {
    plane: Box<dyn Law<f64, 2> + Send + Sync>,
    space: Box<dyn Law<f64, 3> + Send + Sync>,
}

impl LawPair {
    /// The law `name`, one of [`LAW_NAMES`](carom_impact::LAW_NAMES), with the given coefficients.
    ///
    /// # Errors
    /// [`FitError::Input`] for any other name.
    pub fn new(name: &str, coefficients: Coefficients) -> Result<Self, FitError> {
        let both = (law_by_name::<2>(name, coefficients), law_by_name::<3>(name, coefficients));
        let (Some(plane), Some(space)) = both else {
            return Err(FitError::unknown_law(name));
        };
        Ok(Self { plane, space })
    }
}

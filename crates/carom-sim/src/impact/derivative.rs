//! Derivatives of an impact of a chain, in closed form for M and for a point or a ball on a plane; the rows of other contacts
//! and the laws are differentiated by dual numbers.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J | 3×nv | contact velocity for unit joint rates, contact axes (tangents first, normal last) | `rows` |
//! | X | nv×3 | M⁻¹Jᵀ | `response` |
//! | s | 3 | velocity of the surface, contact axes | `surface` |
//! | H, u | 3×3, 3 | J X, J qd − s | – |
//! | P | 3 | impulse, contact axes: a function of H, u, e and μ by the law | – |
//!
//! With δ the change along a direction of q or of time, and ∂(Mx) from [`Kinematics::mass_matrix_derivatives`]:
//!
//! ```text
//! qd⁺ = qd⁻ + X P(H, u, e, μ)
//! δqd⁺ = δqd⁻ + M⁻¹(δJᵀ P − δM X P) + X δP,   δP = ∂P/∂H:δH + ∂P/∂u (δJ qd + J δqd − δs) + ∂P/∂e δe + ∂P/∂μ δμ
//! δH = δJ X + (δJ X)ᵀ − Xᵀ δM X
//! ```
//!
//! **Tangent space.** Derivatives with respect to q have nv columns: column k is the derivative along the motion with unit
//! `qd[k]` ([`Chain::q_rate_into`]) at constant qd⁻. For a floating joint these are translations along and rotations about
//! the axes of the body.

use super::hit::ChainImpact;
use crate::contact::Oscillation;
use crate::error::SimError;
use carom_chain::algebra::z_onto;
use carom_chain::{Chain, ChainError, FramePoint, Kinematics, Rows, Spatial};
use carom_impact::{Direction, LawDerivative};
use nalgebra::{Const, DMatrix, DVector, Dyn, Matrix3, Matrix3xX, MatrixXx3, RealField, U1, Vector3};
use num_dual::DualSVec64;

/// An impact of a chain with the derivatives of its joint velocities `hit.qd_plus`.
///
/// The derivatives are valid within the mode of the impact;
/// [`ImpactProblem::boundaries`](carom_impact::ImpactProblem::boundaries) of
/// [`Contact::problem`](crate::Contact::problem) gives the distances to the mode boundaries.
#[derive(Debug, Clone)]
pub struct ImpactDerivative {
    /// The impact.
    pub hit: ChainImpact,
    /// ∂qd⁺/∂q, nv×nv: column k is the derivative along the motion with unit `qd[k]` ([`Chain::q_rate_into`]) at constant
    /// qd⁻. For a floating joint these are translations along and rotations about the axes of the body.
    pub q: DMatrix<f64>,
    /// ∂qd⁺/∂qd⁻, nv×nv.
    pub qd: DMatrix<f64>,
    /// ∂qd⁺/∂e, nv; e in the sense of the law.
    pub restitution: DVector<f64>,
    /// ∂qd⁺/∂μ, nv; at μ = 0 the right-sided derivative.
    pub friction: DVector<f64>,
}

/// A contact as Jacobian rows for any scalar type, from which the derivatives of its impact are computed.
///
/// [`PlaneContact`] is the contact of a link with a plane, [`RowContact`] a gap whose row does not depend on q. Implement the
/// trait for other contacts, for instance between two links, with the methods of [`Kinematics`], which accept dual numbers.
pub trait ContactRows {
    /// J, 3×nv: the velocity of the contact point for unit joint rates, in contact axes, which may depend on q. The rows are
    /// two tangents (zero for a contact without them) and the normal, which is the derivative of the gap with respect to q.
    ///
    /// # Errors
    /// Errors of the kinematics.
    fn rows<T: RealField + Copy>(&self, kin: &Kinematics<Spatial<T>>, time: T) -> Result<Matrix3xX<T>, ChainError>;

    /// Velocity s of the surface in the same axes, m/s: u = J qd − s. Its negative normal component is the partial derivative
    /// of the gap with respect to time.
    fn surface_velocity<T: RealField + Copy>(&self, _kin: &Kinematics<Spatial<T>>, _time: T) -> Vector3<T> {
        Vector3::zeros()
    }

    /// The derivatives of J and of the surface's velocity: by dual numbers, unless the contact has a closed form.
    ///
    /// # Errors
    /// Errors of the kinematics.
    #[doc(hidden)]
    fn rates(&self, kin: &Kinematics<Spatial<f64>>, q: &[f64], time: f64) -> Result<RowRates, ChainError> {
        let nv = kin.chain().nv();
        let mut rates = RowRates::zeros(nv);
        if nv < 4 {
            by_duals::<4, Self>(self, kin.chain(), q, time, &mut rates)
        } else {
            by_duals::<8, Self>(self, kin.chain(), q, time, &mut rates)
        }?;
        Ok(rates)
    }
}

/// Derivatives of the rows of a contact along the nv tangent directions of q and, last, with respect to time.
#[derive(Debug, Clone, PartialEq)]
pub struct RowRates {
    /// 3×nv(nv+1): the derivatives of J side by side.
    rows: Matrix3xX<f64>,
    /// 3×(nv+1): the derivatives of the surface's velocity.
    surface: Matrix3xX<f64>,
}

impl RowRates {
    fn zeros(nv: usize) -> Self {
        Self { rows: Matrix3xX::zeros(nv * (nv + 1)), surface: Matrix3xX::zeros(nv + 1) }
    }
}

/// The unit normal along a vector.
pub(super) fn unit(given: Vector3<f64>) -> Result<Vector3<f64>, ChainError> {
    // Scaled first, so that squares neither overflow nor underflow.
    let unit = (given / given.amax()).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
    unit.ok_or_else(|| ChainError::NoDirection { given: given.as_slice().to_vec(), length: given.norm() })
}

/// Contact of a point or a ball on a link with a plane, which may oscillate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneContact {
    pub(crate) point: FramePoint,
    pub(crate) radius: f64,
    pub(crate) axes: Matrix3<f64>,
    pub(crate) motion: Option<Oscillation>,
}

impl PlaneContact {
    /// Contact of a point of a link, or of the origin of a link frame, with a plane at rest. `normal` is in world axes, from the environment to the
    /// robot, of any length except zero.
    ///
    /// # Errors
    /// [`ChainError::NoDirection`] for a normal that is zero or not finite.
    pub fn new(point: impl Into<FramePoint>, normal: impl Into<Vector3<f64>>) -> Result<Self, SimError> {
        Ok(Self { point: point.into(), radius: 0.0, axes: z_onto(unit(normal.into())?), motion: None })
    }

    /// The contact point, or the centre of the ball, relative to the origin of the frame, in its axes, m.
    #[must_use]
    pub fn offset(mut self, offset: impl Into<Vector3<f64>>) -> Self {
        self.point.offset = offset.into();
        self
    }

    /// Radius of the ball, m: the contact point is the point of the ball nearest to the plane.
    #[must_use]
    pub fn radius(mut self, radius: f64) -> Self {
        self.radius = radius;
        self
    }

    /// Harmonic motion of the plane.
    #[must_use]
    pub fn shaken(mut self, motion: Oscillation) -> Self {
        self.motion = Some(motion);
        self
    }
}

impl ContactRows for PlaneContact {
    fn rows<T: RealField + Copy>(&self, kin: &Kinematics<Spatial<T>>, _time: T) -> Result<Matrix3xX<T>, ChainError> {
        let axes: Matrix3<T> = self.axes.map(nalgebra::convert);
        let mut place: Vector3<T> = self.point.offset.map(nalgebra::convert);
        if self.radius != 0.0 {
            let pose = kin.pose(self.point.frame);
            let down = axes.column(2) * nalgebra::convert::<f64, T>(self.radius);
            place = pose.inverse().point(pose.point(place) - down);
        }
        let mut jacobian = Matrix3xX::zeros(kin.chain().nv());
        kin.point_jacobian_into(kin.chain().point(self.point.frame, place), &mut jacobian);
        Ok(axes.transpose() * jacobian)
    }

    fn surface_velocity<T: RealField + Copy>(&self, _kin: &Kinematics<Spatial<T>>, time: T) -> Vector3<T> {
        let Some(Oscillation { amplitude, frequency, phase }) = self.motion else { return Vector3::zeros() };
        let frequency: T = nalgebra::convert(frequency);
        let rate = frequency * (frequency * time + nalgebra::convert(phase)).cos();
        (self.axes.transpose() * amplitude).map(|x| nalgebra::convert::<f64, T>(x) * rate)
    }

    fn rates(&self, kin: &Kinematics<Spatial<f64>>, _q: &[f64], time: f64) -> Result<RowRates, ChainError> {
        let (chain, nv) = (kin.chain(), kin.chain().nv());
        let mut rates = RowRates::zeros(nv);
        let lever = self.axes.column(2) * -self.radius;
        kin.for_each_jacobian_derivative(chain.point(self.point.frame, self.point.offset), lever, |i, k, rate| {
            let mut column = rates.rows.column_mut(k * nv + i);
            column += self.axes.tr_mul(&rate);
        });
        if let Some(motion) = self.motion {
            let [_, _, acceleration] = motion.at(time);
            rates.surface.set_column(nv, &self.axes.tr_mul(&acceleration));
        }
        Ok(rates)
    }
}

/// A frictionless gap whose row ∂g/∂q does not depend on q, for instance between prismatic joints or at a joint limit.
#[derive(Debug, Clone, PartialEq)]
pub struct RowContact(pub Vec<f64>);

impl ContactRows for RowContact {
    fn rows<T: RealField + Copy>(&self, kin: &Kinematics<Spatial<T>>, _time: T) -> Result<Matrix3xX<T>, ChainError> {
        kin.chain().check_v("the gap's row", &self.0)?;
        let mut rows = Matrix3xX::zeros(self.0.len());
        for (k, x) in self.0.iter().enumerate() {
            rows[(2, k)] = nalgebra::convert(*x);
        }
        Ok(rows)
    }

    fn rates(&self, kin: &Kinematics<Spatial<f64>>, _q: &[f64], _time: f64) -> Result<RowRates, ChainError> {
        Ok(RowRates::zeros(kin.chain().nv()))
    }
}

/// A state of a chain at a time.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    pub chain: &'a Chain,
    pub q: &'a [f64],
    pub qd: &'a [f64],
    pub time: f64,
}

/// Derivatives of qd⁺.
pub(crate) struct Derivatives {
    pub q: DMatrix<f64>,
    pub qd: DMatrix<f64>,
    pub time: DVector<f64>,
    pub restitution: DVector<f64>,
    pub friction: DVector<f64>,
}

/// The derivatives of qd⁺ from rows and response of the contact, and the derivative of the law.
pub(crate) fn differentiate<C: ContactRows>(
    at: At,
    contact: &C,
    rows: &Matrix3xX<f64>,
    response: &MatrixXx3<f64>,
    law: &LawDerivative<3>,
) -> Result<Derivatives, SimError> {
    let nv = at.chain.nv();
    let mut workspace = at.chain.workspace();
    let mut kin = workspace.update(at.chain, at.q)?;
    let rates = contact.rates(&kin, at.q, at.time)?;
    let [x0, x1, x2] = [0, 1, 2].map(|b| &response.as_slice()[b * nv..][..nv]);
    let turned = kin.mass_matrix_derivatives([x0, x1, x2]);
    let velocity = DVector::from_column_slice(at.qd);
    let impulse = law.outcome.impulse;
    // The last column is that of time, on which M does not depend.
    let mut moved = DMatrix::zeros(nv, nv + 1);
    for (k, mut column) in moved.column_iter_mut().enumerate() {
        let rate = rates.rows.columns(k * nv, nv);
        column.gemv_tr(1.0, &rate, &impulse, 0.0);
        if k < nv {
            turned.iter().zip(&impulse).for_each(|(by, p)| column.axpy(-p, &by.column(k), 1.0));
        }
    }
    solve_columns(&mut kin, &mut moved)?;
    for (k, mut column) in moved.column_iter_mut().enumerate() {
        let rate = rates.rows.columns(k * nv, nv);
        let one = rate * response;
        let mut delassus = one + one.transpose();
        if k < nv {
            turned.iter().enumerate().for_each(|(b, by)| {
                let mut entry = delassus.column_mut(b);
                entry.gemv_tr(-1.0, response, &by.column(k), 1.0);
            });
        }
        let u_minus = rate * &velocity - rates.surface.column(k);
        let along = Direction { delassus: (delassus + delassus.transpose()) * 0.5, u_minus, ..Direction::default() };
        column.gemv(1.0, response, &law.impulse(&along), 1.0);
    }
    let mut qd = response * (law.velocity * rows);
    for k in 0..nv {
        qd[(k, k)] += 1.0;
    }
    Ok(Derivatives {
        time: moved.column(nv).into_owned(),
        q: moved.remove_column(nv),
        qd,
        restitution: response * law.restitution,
        friction: response * law.friction,
    })
}

/// The derivatives of the rows of a contact, N directions at once.
fn by_duals<const N: usize, C: ContactRows + ?Sized>(
    contact: &C,
    chain: &Chain,
    q: &[f64],
    time: f64,
    rates: &mut RowRates,
) -> Result<(), ChainError> {
    let (nq, nv) = (chain.nq(), chain.nv());
    let moving = chain.cast::<DualSVec64<N>>();
    let mut workspace = moving.workspace();
    let (mut unit, mut rate) = (vec![0.0; nv], vec![0.0; nq]);
    for first in (0..=nv).step_by(N) {
        let lanes = N.min(nv + 1 - first);
        let mut seeds = vec![nalgebra::SVector::<f64, N>::zeros(); nq + 1];
        for lane in 0..lanes {
            if first + lane == nv {
                seeds[nq][lane] = 1.0;
                continue;
            }
            unit[first + lane] = 1.0;
            chain.q_rate_into(q, &unit, &mut rate);
            unit[first + lane] = 0.0;
            for (seed, x) in seeds.iter_mut().zip(&rate) {
                seed[lane] = *x;
            }
        }
        let dual =
            |(x, seed): (&f64, &nalgebra::SVector<f64, N>)| DualSVec64::<N>::new(*x, num_dual::Derivative::some(*seed));
        let q: Vec<_> = q.iter().zip(&seeds).map(dual).collect();
        let time = dual((&time, &seeds[nq]));
        let kin = workspace.update(&moving, &q)?;
        let eps = |x: DualSVec64<N>| x.eps.unwrap_generic(Const::<N>, U1);
        let rows = contact.rows(&kin, time)?.map(eps);
        let surface = contact.surface_velocity(&kin, time).map(eps);
        for lane in 0..lanes {
            let k = first + lane;
            rates.rows.columns_mut(k * nv, nv).copy_from(&rows.map(|x| x[lane]));
            rates.surface.set_column(k, &surface.map(|x| x[lane]));
        }
    }
    Ok(())
}

/// M⁻¹Jᵀ, nv×3.
pub(crate) fn responses(
    kin: &mut Kinematics<Spatial<f64>>,
    rows: &Matrix3xX<f64>,
) -> Result<MatrixXx3<f64>, ChainError> {
    let mut columns = rows.transpose();
    solve_columns(kin, &mut columns)?;
    Ok(columns)
}

/// Replaces each column by M⁻¹ times it.
fn solve_columns<C: nalgebra::Dim, S: nalgebra::RawStorageMut<f64, Dyn, C, RStride = U1>>(
    kin: &mut Kinematics<Spatial<f64>>,
    columns: &mut nalgebra::Matrix<f64, Dyn, C, S>,
) -> Result<(), ChainError> {
    let (mut rows, mut responses) = (Rows::new(columns.nrows()), Rows::default());
    for column in columns.column_iter() {
        rows.add().iter_mut().zip(column.iter()).for_each(|(row, x)| *row = *x);
    }
    kin.respond(&rows, &mut responses)?;
    for (mut column, response) in columns.column_iter_mut().zip(responses.iter()) {
        column.iter_mut().zip(response).for_each(|(x, response)| *x = *response);
    }
    Ok(())
}

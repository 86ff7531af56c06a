//! Derivatives of an impact of a chain, in closed form for M and for a point or a ball on a plane; the rows of other contacts
//! and the laws are differentiated by dual numbers.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | D | 1 | 2 for a chain and a normal in one plane, else 3 | – |
//! | J | D×nv | contact velocity for unit joint rates, contact axes (tangents first, normal last) | `rows` |
//! | X | nv×D | M⁻¹Jᵀ | `response` |
//! | s | D | velocity of the surface, contact axes | `surface` |
//! | H, u | D×D, D | J X, J qd − s | – |
//! | P | D | impulse, contact axes: a function of H, u, e and μ by the law | – |
//!
//! With δ the change along a direction of q or of time, ∂(M XP) from [`Kinematics::mass_matrix_derivatives`] and ∂(XᵀMX) at constant X
//! from [`Kinematics::quadratic_derivatives`]:
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
use carom_chain::algebra::{Algebra, z_onto};
use carom_chain::{Chain, ChainError, FramePoint, Kinematics, Point, Rows, Spatial};
use carom_impact::{Direction, LawDerivative};
use nalgebra::{Const, DMatrix, DVector, Matrix3, Matrix3xX, RealField, SMatrix, SVector, U1, Vector3};
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
        let mut rates = RowRates::zeros(nv, nv + 1);
        if nv < 4 {
            by_duals::<4, Self>(self, kin.chain(), q, time, &mut rates)
        } else {
            by_duals::<8, Self>(self, kin.chain(), q, time, &mut rates)
        }?;
        Ok(rates)
    }
}

/// Derivatives of the rows of a contact along the nv tangent directions of q and, for a surface that may move, last with
/// respect to time. Contact axes.
#[derive(Debug, Clone, PartialEq)]
pub struct RowRates<const D: usize = 3> {
    /// The derivative of column i of J in direction k, at k nv + i.
    rows: Vec<SVector<f64, D>>,
    /// The derivatives of the surface's velocity.
    surface: Vec<SVector<f64, D>>,
}

impl<const D: usize> RowRates<D> {
    pub(crate) fn zeros(nv: usize, directions: usize) -> Self {
        Self { rows: vec![SVector::zeros(); nv * directions], surface: vec![SVector::zeros(); directions] }
    }

    /// The rates of a contact at the constant `lever` from the material `point`, in axes of the chain.
    pub(super) fn of_point<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>>(
        kin: &Kinematics<A>,
        (point, lever): (Point<A>, SVector<f64, D>),
        axes: &SMatrix<f64, D, D>,
        directions: usize,
    ) -> Self {
        let nv = kin.chain().nv();
        let mut rates = Self::zeros(nv, directions);
        kin.for_each_jacobian_derivative(point, lever, |i, k, rate| rates.rows[k * nv + i] += axes.tr_mul(&rate));
        rates
    }

    /// Sets the derivatives of the columns of J and of the surface's velocity in direction k.
    pub(crate) fn set(&mut self, k: usize, (columns, surface): (Vec<SVector<f64, D>>, SVector<f64, D>)) {
        self.rows[k * columns.len()..][..columns.len()].copy_from_slice(&columns);
        self.surface[k] = surface;
    }

    /// The derivatives of the columns of J in direction k.
    fn columns(&self, k: usize) -> &[SVector<f64, D>] {
        let nv = self.rows.len() / self.surface.len();
        &self.rows[k * nv..][..nv]
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
        let at = (chain.point(self.point.frame, self.point.offset), self.axes.column(2) * -self.radius);
        let mut rates = RowRates::of_point(kin, at, &self.axes, nv + 1);
        if let Some(motion) = self.motion {
            let [_, _, acceleration] = motion.at(time);
            rates.surface[nv] = self.axes.tr_mul(&acceleration);
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
        let nv = kin.chain().nv();
        Ok(RowRates::zeros(nv, nv + 1))
    }
}

/// Derivatives of qd⁺.
pub(crate) struct Derivatives {
    pub q: DMatrix<f64>,
    pub qd: DMatrix<f64>,
    /// With respect to time, if the rates of the rows are.
    pub time: Option<DVector<f64>>,
    pub restitution: DVector<f64>,
    pub friction: DVector<f64>,
}

/// The derivatives of qd⁺ from the columns of J and their rates, the rows of X, and the derivative of the law. `bind` changes
/// the answer of the velocities in direction k by what closed loops prevent.
pub(crate) fn differentiate<A: Algebra<Scalar = f64>, const D: usize>(
    kin: &mut Kinematics<A>,
    qd: &[f64],
    (rows, rates): (&[SVector<f64, D>], &RowRates<D>),
    response: &[SVector<f64, D>],
    law: &LawDerivative<D>,
    bind: impl Fn(usize, &mut [f64]),
) -> Result<Derivatives, SimError> {
    let nv = qd.len();
    let columns: [Vec<f64>; D] = std::array::from_fn(|b| response.iter().map(|x| x[b]).collect());
    let bent = kin.quadratic_derivatives(columns.each_ref().map(Vec::as_slice));
    let impulse = law.outcome.impulse;
    let jump: Vec<f64> = response.iter().map(|x| x.dot(&impulse)).collect();
    let turned = kin.mass_matrix_derivatives(&jump);
    // δJᵀP − δM X P for each direction; M does not depend on time, which is the direction after those of q.
    let (mut forces, mut moved) = (Rows::new(nv), Rows::new(nv));
    for k in 0..rates.surface.len() {
        let force = forces.add();
        for (force, rate) in force.iter_mut().zip(rates.columns(k)) {
            *force = rate.dot(&impulse);
        }
        if k < nv {
            force.iter_mut().zip(turned.column(k).iter()).for_each(|(force, by)| *force -= by);
        }
    }
    kin.respond(&forces, &mut moved)?;
    for (k, moved) in moved.iter_mut().enumerate() {
        bind(k, moved);
        let mut delassus = SMatrix::<f64, D, D>::zeros();
        let mut u_minus = -rates.surface[k];
        for ((rate, x), qd) in rates.columns(k).iter().zip(response).zip(qd) {
            delassus += rate * x.transpose();
            u_minus += rate * *qd;
        }
        delassus += delassus.transpose();
        if let Some(bent) = bent.get(k) {
            delassus -= bent;
        }
        let along = Direction { delassus, u_minus, ..Direction::default() };
        let change = law.impulse(&along);
        moved.iter_mut().zip(response).for_each(|(moved, x)| *moved += x.dot(&change));
    }
    let mut moved = moved.iter();
    let mut q = DMatrix::zeros(nv, nv);
    for (mut column, moved) in q.column_iter_mut().zip(&mut moved) {
        column.copy_from_slice(moved);
    }
    let kept = |i: usize, k: usize| if i == k { 1.0 } else { 0.0 };
    let along = |change: &SVector<f64, D>| DVector::from_fn(nv, |i, _| response[i].dot(change));
    Ok(Derivatives {
        q,
        qd: DMatrix::from_fn(nv, nv, |i, k| kept(i, k) + response[i].dot(&(law.velocity * rows[k]))),
        time: moved.next().map(DVector::from_column_slice),
        restitution: along(&law.restitution),
        friction: along(&law.friction),
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
            for (rate, column) in rates.rows[k * nv..][..nv].iter_mut().zip(rows.column_iter()) {
                *rate = column.map(|x| x[lane]);
            }
            rates.surface[k] = surface.map(|x| x[lane]);
        }
    }
    Ok(())
}

//! Derivatives of an impact of a chain, by dual numbers through the kinematics, the recursions and the law.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J | 3×nv | contact velocity for unit joint rates, contact axes (tangents first, normal last) | `rows` |
//! | X | nv×3 | M⁻¹Jᵀ | `response` |
//! | s | 3 | velocity of the surface, contact axes | `surface_velocity` |
//! | H, u | 3×3, 3 | J X, J qd − s | – |
//! | P | 3 | impulse, contact axes: what the law makes of H and u | – |
//!
//! `qd⁺ = qd⁻ + X P(H, u, e, μ)`. The law is differentiated once, by H, u, e and μ, in 11 directions at a time; the chain by q
//! in chunks of up to eight. So
//!
//! ```text
//! δqd⁺ = δqd⁻ + δX P + X δP,   δP = ∂P/∂H:δH + ∂P/∂u (δJ qd + J δqd − δs) + ∂P/∂e δe + ∂P/∂μ δμ
//! ```
//!
//! **Tangent space.** Derivatives by q have nv columns: column k is the change along the motion that unit `qd[k]` makes
//! ([`Chain::q_rate_into`]), while the numbers of qd⁻ stay. For a floating joint these are steps along and turns about the
//! body's own axes.

use crate::error::SimError;
use crate::strike::ChainImpact;
use crate::touch::Oscillation;
use carom_chain::algebra::z_onto;
use carom_chain::{Chain, ChainError, FrameId, Kinematics, Spatial};
use carom_impact::{Direction, LawDerivative};
use nalgebra::{Const, DMatrix, DVector, Matrix3, Matrix3xX, MatrixXx3, RealField, U1, Vector3};
use num_dual::DualSVec64;

/// An impact of a chain with the derivatives of its joint velocities `hit.qd_plus`.
///
/// They hold within the mode of the impact: [`ImpactProblem::boundaries`](carom_impact::ImpactProblem::boundaries) (of
/// [`Contact::problem`](crate::Contact::problem)) says how far the next one is.
#[derive(Debug, Clone)]
pub struct ImpactDerivative {
    /// The impact itself.
    pub hit: ChainImpact,
    /// ∂qd⁺/∂q, nv×nv: column k is the change along the motion that unit `qd[k]` makes
    /// ([`Chain::q_rate_into`]), while the numbers of qd⁻ stay. For a floating joint these are steps along and turns about
    /// the body's own axes.
    pub q: DMatrix<f64>,
    /// ∂qd⁺/∂qd⁻, nv×nv.
    pub qd: DMatrix<f64>,
    /// ∂qd⁺/∂e, nv; e in the law's own sense.
    pub restitution: DVector<f64>,
    /// ∂qd⁺/∂μ, nv; at μ = 0 from the right.
    pub friction: DVector<f64>,
}

/// A contact as rows over the joint velocities, in any scalar: what the derivatives of its impact need.
///
/// [`PlaneContact`] is that of a link with a plane; [`RowContact`] a gap whose row does not depend on q. For others
/// (links that meet each other, say) write the rows with the methods of [`Kinematics`], which carry dual numbers.
pub trait ContactRows {
    /// J, 3×nv: the velocity of the contact for unit joint rates, in contact axes that may turn with q: two tangents
    /// (zeros where there are none), then the normal, whose row is the gap's derivative by q.
    ///
    /// # Errors
    /// What the kinematics refuse.
    fn rows<T: RealField + Copy>(&self, kin: &Kinematics<Spatial<T>>, time: T) -> Result<Matrix3xX<T>, ChainError>;

    /// Velocity of the surface in the same axes, m/s: u = J qd − s, and minus its normal part is the gap's derivative by
    /// time.
    fn surface_velocity<T: RealField + Copy>(&self, _kin: &Kinematics<Spatial<T>>, _time: T) -> Vector3<T> {
        Vector3::zeros()
    }
}

/// A point or a ball that a link carries, before a plane that may be shaken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneContact {
    pub(crate) frame: FrameId,
    pub(crate) offset: Vector3<f64>,
    pub(crate) radius: f64,
    pub(crate) axes: Matrix3<f64>,
    pub(crate) motion: Option<Oscillation>,
}

impl PlaneContact {
    /// The origin of a link's frame, before a plane with this normal (world axes, from the environment to the robot, of any
    /// length but zero).
    ///
    /// # Errors
    /// A normal without direction.
    pub fn new(frame: FrameId, normal: [f64; 3]) -> Result<Self, SimError> {
        let given = Vector3::from(normal);
        let unit = (given / given.amax()).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
        let Some(unit) = unit else {
            return Err(ChainError::NoDirection { given: given.as_slice().to_vec(), length: given.norm() }.into());
        };
        Ok(Self { frame, offset: Vector3::zeros(), radius: 0.0, axes: z_onto(unit), motion: None })
    }

    /// The point, or the centre of the ball, from that origin, in the frame's own axes, m.
    #[must_use]
    pub fn offset(mut self, offset: [f64; 3]) -> Self {
        self.offset = offset.into();
        self
    }

    /// A ball of this radius, m: what touches is always its lowest point.
    #[must_use]
    pub fn radius(mut self, radius: f64) -> Self {
        self.radius = radius;
        self
    }

    /// The plane is shaken.
    #[must_use]
    pub fn shaken(mut self, motion: Oscillation) -> Self {
        self.motion = Some(motion);
        self
    }
}

impl ContactRows for PlaneContact {
    fn rows<T: RealField + Copy>(&self, kin: &Kinematics<Spatial<T>>, _time: T) -> Result<Matrix3xX<T>, ChainError> {
        let axes: Matrix3<T> = self.axes.map(nalgebra::convert);
        let mut place: Vector3<T> = self.offset.map(nalgebra::convert);
        if self.radius != 0.0 {
            let pose = kin.pose(self.frame);
            let down = axes.column(2) * nalgebra::convert::<f64, T>(self.radius);
            place = pose.inverse().point(pose.point(place) - down);
        }
        let mut jacobian = Matrix3xX::zeros(kin.chain().nv());
        kin.point_jacobian_into(kin.chain().point(self.frame, place), &mut jacobian);
        Ok(axes.transpose() * jacobian)
    }

    fn surface_velocity<T: RealField + Copy>(&self, _kin: &Kinematics<Spatial<T>>, time: T) -> Vector3<T> {
        let Some(Oscillation { amplitude, frequency, phase }) = self.motion else { return Vector3::zeros() };
        let frequency: T = nalgebra::convert(frequency);
        let rate = frequency * (frequency * time + nalgebra::convert(phase)).cos();
        (self.axes.transpose() * amplitude).map(|x| nalgebra::convert::<f64, T>(x) * rate)
    }
}

/// A gap whose row ∂g/∂q is the same at every q, without friction: between sliders, or a joint's limit.
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

/// From the contact's rows and response in plain numbers, and the law's derivative at them.
pub(crate) fn differentiate<C: ContactRows>(
    at: At,
    contact: &C,
    rows: &Matrix3xX<f64>,
    response: &MatrixXx3<f64>,
    law: &LawDerivative<3>,
) -> Result<Derivatives, SimError> {
    let nv = at.chain.nv();
    // The last column is that of time.
    let mut moved = DMatrix::zeros(nv, nv + 1);
    if nv < 4 {
        chunks::<4, C>(at, contact, response, law, &mut moved)
    } else {
        chunks::<8, C>(at, contact, response, law, &mut moved)
    }?;
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

/// δqd⁺ by each tangent direction of q, and by time, N at once.
fn chunks<const N: usize, C: ContactRows>(
    at: At,
    contact: &C,
    response: &MatrixXx3<f64>,
    law: &LawDerivative<3>,
    moved: &mut DMatrix<f64>,
) -> Result<(), SimError> {
    let (nq, nv) = (at.chain.nq(), at.chain.nv());
    let chain = at.chain.cast::<DualSVec64<N>>();
    let mut workspace = chain.workspace();
    let plain = |x: &f64| DualSVec64::<N>::from_re(*x);
    let qd: Vec<_> = at.qd.iter().map(plain).collect();
    let impulse = law.outcome.impulse.map(|x| plain(&x));
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
            at.chain.q_rate_into(at.q, &unit, &mut rate);
            unit[first + lane] = 0.0;
            for (seed, x) in seeds.iter_mut().zip(&rate) {
                seed[lane] = *x;
            }
        }
        let dual =
            |(x, seed): (&f64, &nalgebra::SVector<f64, N>)| DualSVec64::<N>::new(*x, num_dual::Derivative::some(*seed));
        let q: Vec<_> = at.q.iter().zip(&seeds).map(dual).collect();
        let time = dual((&at.time, &seeds[nq]));
        let mut kin = workspace.update(&chain, &q)?;
        let rows = contact.rows(&kin, time)?;
        let u = &rows * DVector::from_column_slice(&qd) - contact.surface_velocity(&kin, time);
        let x = responses(&mut kin, &rows)?;
        let delassus = &rows * &x;
        let jump = x * impulse;
        let eps = |x: DualSVec64<N>| x.eps.unwrap_generic(Const::<N>, U1);
        let (delassus, u, jump) = (delassus.map(eps), u.map(eps), jump.map(eps));
        for lane in 0..lanes {
            let h = Matrix3::from_fn(|i, j| (delassus[(i, j)][lane] + delassus[(j, i)][lane]) * 0.5);
            let along = Direction { delassus: h, u_minus: u.map(|x| x[lane]), ..Direction::default() };
            let column = jump.map(|x| x[lane]) + response * law.impulse(&along);
            moved.set_column(first + lane, &column);
        }
    }
    Ok(())
}

/// M⁻¹Jᵀ, nv×3.
pub(crate) fn responses<T: RealField + Copy>(
    kin: &mut Kinematics<Spatial<T>>,
    rows: &Matrix3xX<T>,
) -> Result<MatrixXx3<T>, ChainError> {
    let forces = rows.transpose();
    let mut out = MatrixXx3::zeros(forces.nrows());
    if kin.chain().is_coupled() {
        for k in 0..3 {
            out.set_column(k, &kin.solve(forces.column(k).as_slice())?);
        }
        return Ok(out);
    }
    let mut articulation = kin.articulate()?;
    for (force, mut moved) in forces.column_iter().zip(out.column_iter_mut()) {
        articulation.solve_into(force.as_slice(), moved.as_mut_slice())?;
    }
    Ok(out)
}

//! Kinematics: where every body is at `q`, and what moves a point.
//!
//! [`Workspace::update`] returns a view that borrows the workspace, so values of an old pose can't be read by mistake:
//!
//! ```
//! # use carom_chain::{Chain, uniform_chain};
//! let chain = uniform_chain(2, 1.0, 1.0).unwrap();
//! let mut ws = chain.workspace();
//! let folded = ws.update(&chain, &[0.0, 3.0]).unwrap().mass_matrix();
//! let straight = ws.update(&chain, &[0.0, 0.0]).unwrap().mass_matrix();
//! assert!(folded[(0, 0)] < straight[(0, 0)]);
//! ```
//! Keeping the old view over an update is a compile error:
//! ```compile_fail,E0499
//! # use carom_chain::{Chain, uniform_chain};
//! let chain = uniform_chain(2, 1.0, 1.0).unwrap();
//! let mut ws = chain.workspace();
//! let mut folded = ws.update(&chain, &[0.0, 3.0]).unwrap();
//! let straight = ws.update(&chain, &[0.0, 0.0]).unwrap().mass_matrix();
//! assert!(folded.mass_matrix()[(0, 0)] < straight[(0, 0)]);
//! ```
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | Rᵢ | 2×2, 3×3 | body axes to world axes | `rotation` |
//! | rᵢ | 2, 3 | from the parent's origin to body i's, world axes | `offset` |
//! | pᵢ | 2, 3 | origin of body i, world axes | `position` |
//! | sᵢ | – | axis of joint i, world axes, about pᵢ | `axis` |
//! | J | 3×nv | velocity of a point for unit joint rates, world axes | `point_jacobian` |

use crate::algebra::{Algebra, Articulated, Axis, Force, Inertia, Motion, Pose, Real};
use crate::chain::{Chain, FrameId, Point};
use crate::error::ChainError;
use nalgebra::{DMatrix, Dim, Matrix, RawStorageMut};
use num_traits::Zero;

/// Scratch memory for one chain: kinematics, and what the mass matrix and the recursions share.
#[derive(Debug, Clone)]
pub struct Workspace<A: Algebra> {
    pub(crate) rotation: Vec<A::Rotation>,
    pub(crate) offset: Vec<A::Vector>,
    pub(crate) position: Vec<A::Vector>,
    pub(crate) axis: Vec<Axis<A>>,
    pub(crate) composite: Vec<Inertia<A>>,
    pub(crate) velocity: Vec<Motion<A>>,
    pub(crate) acceleration: Vec<Motion<A>>,
    pub(crate) force: Vec<Force<A>>,
    pub(crate) articulated: Vec<A::Articulated>,
    pub(crate) transmitted: Vec<Force<A>>,
    pub(crate) inverse_d: Vec<A::Scalar>,
    pub(crate) drive: Vec<A::Scalar>,
}

/// The chain at one configuration. Positions, Jacobians, and the way to everything else.
#[derive(Debug)]
pub struct Kinematics<'a, A: Algebra> {
    pub(crate) chain: &'a Chain<A>,
    pub(crate) ws: &'a mut Workspace<A>,
}

impl<A: Algebra> Chain<A> {
    /// Scratch memory that fits this chain. Allocates; everything done in it afterwards does not.
    pub fn workspace(&self) -> Workspace<A> {
        let n = self.bodies.len();
        Workspace {
            rotation: vec![A::no_rotation(); n],
            offset: vec![A::zero(); n],
            position: vec![A::zero(); n],
            axis: vec![Axis::Turn(A::zero_angular()); n],
            composite: vec![Inertia::zero(); n],
            velocity: vec![Motion::zero(); n],
            acceleration: vec![Motion::zero(); n],
            force: vec![Force::zero(); n],
            articulated: vec![A::Articulated::from_rigid(&Inertia::zero()); n],
            transmitted: vec![Force::zero(); n],
            inverse_d: vec![A::Scalar::zero(); n],
            drive: vec![A::Scalar::zero(); n],
        }
    }
}

impl<A: Algebra> Workspace<A> {
    /// Moves the chain to `q` (length nq; rad, m, quaternion).
    ///
    /// # Errors
    /// [`ChainError::WrongLength`]. Numbers are not looked at: [`Chain::check_state`] does that.
    ///
    /// # Panics
    /// If the workspace was made for a longer chain or a shorter one.
    pub fn update<'a>(&'a mut self, chain: &'a Chain<A>, q: &[A::Scalar]) -> Result<Kinematics<'a, A>, ChainError> {
        chain.check_nq(q.len())?;
        assert_eq!(self.axis.len(), chain.bodies.len(), "this workspace belongs to another chain");
        for (i, body) in chain.bodies.iter().enumerate() {
            let (rotation, position) = match body.parent {
                Some(p) => (self.rotation[p], self.position[p]),
                None => (A::no_rotation(), A::zero()),
            };
            let placed = A::compose(rotation, body.placement.rotation);
            let (turned, moved) = A::move_joint(body.joint, placed, body.ratio, body.shift, &q[body.q_index..]);
            self.rotation[i] = turned;
            self.offset[i] = A::rotate(rotation, body.placement.translation) + moved;
            self.position[i] = position + self.offset[i];
            self.axis[i] = A::axis(body.joint, turned).scaled(body.ratio);
        }
        Ok(Kinematics { chain, ws: self })
    }
}

impl<A: Algebra> Kinematics<'_, A> {
    /// The chain.
    pub fn chain(&self) -> &Chain<A> {
        self.chain
    }

    /// Pose of a link's frame in the world.
    pub fn pose(&self, frame: FrameId) -> Pose<A> {
        let frame = &self.chain.frames[frame.0];
        self.body_pose(frame.body).then(&frame.pose)
    }

    /// World position of a point, m.
    pub fn position(&self, point: Point<A>) -> A::Vector {
        self.body_pose(point.body).point(point.position)
    }

    fn body_pose(&self, body: Option<usize>) -> Pose<A> {
        body.map_or(Pose::identity(), |i| Pose { rotation: self.ws.rotation[i], translation: self.ws.position[i] })
    }

    /// From the origin of the point's body to the point, world axes.
    pub(crate) fn arm(&self, body: usize, point: Point<A>) -> A::Vector {
        A::rotate(self.ws.rotation[body], point.position)
    }

    /// Visits the joints that move a point, from the point down to the world: body, and the vector from the joint's
    /// origin to the point. Summing offsets on the way loses no digits far from the world's origin.
    fn for_each_mover(&self, point: Point<A>, mut visit: impl FnMut(usize, A::Vector)) {
        let Some(body) = point.body else { return };
        let mut r = self.arm(body, point);
        let mut next = Some(body);
        while let Some(i) = next {
            visit(i, r);
            r += self.ws.offset[i];
            next = self.chain.bodies[i].parent;
        }
    }

    /// Jacobian of a point's velocity: LINEAR×nv, world axes. Overwrites `out`; allocates nothing.
    ///
    /// # Panics
    /// If `out` is smaller, or the point another chain's.
    pub fn point_jacobian_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &self,
        point: Point<A>,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        out.fill(A::Scalar::zero());
        self.for_each_mover(point, |i, r| {
            let column = self.ws.axis[i].point_velocity(r);
            for k in 0..A::LINEAR {
                out[(k, self.chain.bodies[i].v_index)] += A::linear_part(column, k);
            }
        });
    }

    /// As [`Self::point_jacobian_into`], in a new matrix.
    pub fn point_jacobian(&self, point: Point<A>) -> DMatrix<A::Scalar> {
        let mut j = DMatrix::zeros(A::LINEAR, self.chain.nv);
        self.point_jacobian_into(point, &mut j);
        j
    }

    /// Geometric Jacobian of a frame: angular rows first, then the linear rows of its origin; world axes.
    pub fn geometric_jacobian(&self, frame: FrameId) -> DMatrix<A::Scalar> {
        let frame = &self.chain.frames[frame.0];
        let origin = Point { body: frame.body, position: frame.pose.translation };
        let mut j = DMatrix::zeros(A::ANGULAR + A::LINEAR, self.chain.nv);
        self.for_each_mover(origin, |i, r| {
            let column = self.ws.axis[i].at_rate(nalgebra::convert(1.0)).shifted(r);
            let v = self.chain.bodies[i].v_index;
            for k in 0..A::ANGULAR {
                j[(k, v)] += A::angular_part(column.angular, k);
            }
            for k in 0..A::LINEAR {
                j[(A::ANGULAR + k, v)] += A::linear_part(column.linear, k);
            }
        });
        j
    }

    /// Velocity of a point for joint rates `qd` (length nv), world axes, m/s.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn point_velocity(&self, point: Point<A>, qd: &[A::Scalar]) -> Result<A::Vector, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        let mut velocity = A::zero();
        self.for_each_mover(point, |i, r| {
            velocity += self.ws.axis[i].point_velocity(r) * qd[self.chain.bodies[i].v_index];
        });
        Ok(velocity)
    }

    /// Angular velocity of a frame for joint rates `qd` (length nv), world axes, rad/s.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn angular_velocity(&self, frame: FrameId, qd: &[A::Scalar]) -> Result<A::Angular, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        let frame = &self.chain.frames[frame.0];
        let mut velocity = A::zero_angular();
        self.for_each_mover(Point { body: frame.body, position: frame.pose.translation }, |i, _| {
            velocity += self.ws.axis[i].at_rate(qd[self.chain.bodies[i].v_index]).angular;
        });
        Ok(velocity)
    }

    /// Jᵀf: the joint forces that a force on a point amounts to. Adds them to `out` (length nv).
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn add_point_force(&self, point: Point<A>, force: A::Vector, out: &mut [A::Scalar]) -> Result<(), ChainError> {
        self.chain.check_nv("joint force", out.len())?;
        self.for_each_mover(point, |i, r| {
            out[self.chain.bodies[i].v_index] += A::dot(self.ws.axis[i].point_velocity(r), force);
        });
        Ok(())
    }

    /// J̇ q̇: the acceleration of a point while no joint accelerates, world axes, m/s².
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn point_drift(&mut self, point: Point<A>, qd: &[A::Scalar]) -> Result<A::Vector, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.spread_velocity(qd);
        let ws = &mut *self.ws;
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let carried = body.parent.map_or(Motion::zero(), |p| ws.acceleration[p].shifted(ws.offset[i]));
            ws.acceleration[i] = carried + ws.force_free_rate(self.chain, i, qd);
        }
        let Some(body) = point.body else {
            return Ok(A::zero());
        };
        let r = self.arm(body, point);
        let (v, a) = (self.ws.velocity[body].shifted(r), self.ws.acceleration[body].shifted(r));
        // A spatial acceleration counts what flows past a fixed point; a point that moves along adds ω × v.
        Ok(a.linear + A::swing(v.angular, v.linear))
    }

    /// Outward pass of the velocities: vᵢ = v_λ + sᵢ q̇ᵢ.
    pub(crate) fn spread_velocity(&mut self, qd: &[A::Scalar]) {
        let ws = &mut *self.ws;
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let carried = body.parent.map_or(Motion::zero(), |p| ws.velocity[p].shifted(ws.offset[i]));
            ws.velocity[i] = carried + ws.axis[i].at_rate(qd[body.v_index]);
        }
    }
}

impl<A: Algebra> Workspace<A> {
    /// cᵢ = v × sᵢ q̇ᵢ, where v is the velocity of the body that carries the axis. The six axes of a floating joint are
    /// all carried by the body below the joint's first axis: Σ v_λ × sₖ q̇ₖ = v_λ × v_J = (v_λ + v_J) × v_J.
    pub(crate) fn force_free_rate(&self, chain: &Chain<A>, i: usize, qd: &[A::Scalar]) -> Motion<A> {
        let mut first = i;
        while A::rides_along(chain.bodies[first].joint) {
            first -= 1;
        }
        match chain.bodies[first].parent {
            None => Motion::zero(),
            Some(p) => {
                let carrier = self.velocity[p].shifted(self.offset[first]);
                carrier.carry(self.axis[i].at_rate(qd[chain.bodies[i].v_index]))
            }
        }
    }
}

/// Zero for any scalar of an algebra.
pub(crate) fn clear<T: Real>(numbers: &mut [T]) {
    numbers.fill(T::zero());
}

//! Kinematics: poses of all bodies at `q`, Jacobians and velocities of points.
//!
//! [`Workspace::update`] returns a view that borrows the workspace, so that values of an earlier configuration cannot be
//! read by mistake:
//!
//! ```
//! # use carom_chain::{Chain, uniform_chain};
//! let chain = uniform_chain(2, 1.0, 1.0).unwrap();
//! let mut ws = chain.workspace();
//! let folded = ws.update(&chain, &[0.0, 3.0]).unwrap().mass_matrix();
//! let straight = ws.update(&chain, &[0.0, 0.0]).unwrap().mass_matrix();
//! assert!(folded[(0, 0)] < straight[(0, 0)]);
//! ```
//! Using the earlier view after an update is a compile error:
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
//! | Rᵢ | 2×2, 3×3 | rotation from body axes to world axes | `rotation` |
//! | rᵢ | 2, 3 | from the parent's origin to body i's, world axes | `offset` |
//! | pᵢ | 2, 3 | origin of body i, world axes | `position` |
//! | sᵢ | – | axis of joint i, world axes, about pᵢ | `axis` |
//! | J | 3×nv | velocity of a point for unit joint rates, world axes | `point_jacobian` |

use crate::algebra::{Algebra, Axis, Force, Inertia, Motion, Pose};
use crate::body::{FrameId, Point};
use crate::chain::Chain;
use crate::delassus::{PointResponse, ResponseMemory};
use crate::error::ChainError;
use crate::prepare::{ByBody, Hinge, Subspace};
use crate::scratch::{Flow, Free, Link};
use crate::specialised::sine::sin_cos_by_pairs;
use nalgebra::{DMatrix, Dim, Matrix, RawStorageMut, SimdComplexField};
use num_traits::Zero;
use std::any::Any;

/// Scratch memory for one chain, used by its kinematics and by all recursions.
#[derive(Debug, Clone)]
pub struct Workspace<A: Algebra> {
    pub(crate) links: Vec<Link<A>>,
    pub(crate) velocity: Vec<Motion<A>>,
    pub(crate) flow: Vec<Flow<A>>,
    pub(crate) force: Vec<Force<A>>,
    /// Inertias in world axes: of single bodies or of their subtrees.
    pub(crate) inertia: Vec<Inertia<A>>,
    pub(crate) free: Vec<Free<A>>,
    /// Angle of each body's joint, rad; used for hinges only.
    angles: Vec<A::Scalar>,
    sines: Vec<A::Scalar>,
    cosines: Vec<A::Scalar>,
    /// Of [`Kinematics::contact`].
    pub(crate) response: ResponseMemory<A>,
    /// Of [`Kinematics::respond`]: the factor of M, and rows that are solved together.
    pub(crate) factor: Vec<A::Scalar>,
    pub(crate) solved: Vec<[A::Scalar; 4]>,
}

/// The chain at one configuration: its methods compute positions, Jacobians, the mass matrix, dynamics and energies.
#[derive(Debug)]
pub struct Kinematics<'a, A: Algebra> {
    pub(crate) chain: &'a Chain<A>,
    pub(crate) ws: &'a mut Workspace<A>,
}

/// The accelerations of all bodies at q̈ = 0: of [`Kinematics::drifts`].
#[derive(Debug)]
pub struct Drifts<'a, A: Algebra> {
    kin: &'a Kinematics<'a, A>,
}

impl<A: Algebra> Drifts<'_, A> {
    /// J̇ q̇: the acceleration of a point for q̈ = 0, world axes, m/s².
    pub fn of(&self, point: Point<A>) -> A::Vector {
        let Some(body) = point.body else { return A::zero() };
        let (r, Flow { spin, spin_rate, acceleration }) = (self.kin.arm(body, point), self.kin.ws.flow[body]);
        acceleration + A::swing(spin_rate, r) + A::swing(spin, A::swing(spin, r))
    }
}

impl<A: Algebra> Chain<A> {
    /// Scratch memory for this chain. This call allocates; the in-place methods that use the workspace do not.
    pub fn workspace(&self) -> Workspace<A> {
        let n = self.bodies.len();
        let zero = A::Scalar::zero();
        Workspace {
            links: vec![Link::world(); n],
            velocity: vec![Motion::zero(); n],
            flow: vec![Flow::base(A::zero()); n],
            force: vec![Force::zero(); n],
            inertia: vec![Inertia::zero(); n],
            free: vec![Free::zero(); n],
            angles: vec![zero; n],
            sines: vec![zero; n],
            cosines: vec![zero; n],
            response: ResponseMemory::default(),
            factor: Vec::new(),
            solved: Vec::new(),
        }
    }
}

impl<A: Algebra> Workspace<A> {
    /// Computes the pose of every body at `q` (length nq; rad, m, quaternion).
    ///
    /// # Errors
    /// [`ChainError::WrongLength`]. The numbers are not checked; use [`Chain::check_state`] for that.
    ///
    /// # Panics
    /// If the workspace was made for a chain with another number of bodies.
    pub fn update<'a>(&'a mut self, chain: &'a Chain<A>, q: &[A::Scalar]) -> Result<Kinematics<'a, A>, ChainError> {
        chain.check_nq(q.len())?;
        assert_eq!(
            self.links.len(),
            chain.prepared.len(),
            "this workspace belongs to another chain: make one with Chain::workspace"
        );
        // All sines first: computed body by body, each would delay the next body.
        for (angle, body) in self.angles.iter_mut().zip(&chain.prepared) {
            if A::turns(body.joint) {
                *angle = body.angle().at(q);
            }
        }
        self.take_sines();
        if chain.structure.hinges_alone {
            self.place::<Hinge<A>>(chain, q)
        } else {
            self.place::<Axis<A>>(chain, q)
        }
        Ok(Kinematics { chain, ws: self })
    }

    /// The result of the last [`Kinematics::contact`].
    #[doc(hidden)]
    pub fn contact(&self) -> PointResponse<'_, A> {
        self.response.response()
    }

    /// Sines and cosines of all angles: by [`crate::sine`] for `f64`, otherwise by the scalar type.
    fn take_sines(&mut self) {
        let Self { angles, sines, cosines, .. } = self;
        let in_f64 = (
            (angles as &dyn Any).downcast_ref::<Vec<f64>>(),
            (sines as &mut dyn Any).downcast_mut::<Vec<f64>>(),
            (cosines as &mut dyn Any).downcast_mut::<Vec<f64>>(),
        );
        if let (Some(angles), Some(sines), Some(cosines)) = in_f64 {
            return sin_cos_by_pairs(angles, sines, cosines);
        }
        for ((angle, sin), cos) in angles.iter().zip(sines).zip(cosines) {
            (*sin, *cos) = angle.simd_sin_cos();
        }
    }

    /// Computes rotation, position and joint axis of every body.
    #[inline(always)]
    fn place<X: Subspace<A>>(&mut self, chain: &Chain<A>, q: &[A::Scalar]) {
        let n = chain.prepared.len();
        let (links, turned) = (&mut self.links[..n], ByBody { sines: &self.sines[..n], cosines: &self.cosines[..n] });
        let (mut before, mut at) = (A::no_rotation(), A::zero());
        for (i, body) in chain.prepared.iter().enumerate() {
            let (outer, origin) = match body.parent {
                Some(p) if p + 1 == i => (Some(before), at),
                Some(p) => (Some(links[p].rotation), links[p].position),
                None => (None, A::zero()),
            };
            let (rotation, offset) = X::place(body, i, outer, q, &turned);
            (before, at) = (rotation, A::plus(origin, offset));
            links[i] = Link { rotation, offset, position: at, axis: X::at_rotation(body, rotation).axis() };
        }
    }
}

impl<A: Algebra> Kinematics<'_, A> {
    /// The chain.
    pub fn chain(&self) -> &Chain<A> {
        self.chain
    }

    /// Pose of a link's frame in the world, m.
    ///
    /// # Panics
    /// May panic if the handle belongs to another chain.
    pub fn pose(&self, frame: FrameId) -> Pose<A> {
        let frame = &self.chain.frames[frame.0];
        self.body_pose(frame.body).then(&frame.pose)
    }

    /// World position of a point, m.
    pub fn position(&self, point: Point<A>) -> A::Vector {
        self.body_pose(point.body).point(point.position)
    }

    fn body_pose(&self, body: Option<usize>) -> Pose<A> {
        body.map_or(Pose::identity(), |i| Pose {
            rotation: self.ws.links[i].rotation,
            translation: self.ws.links[i].position,
        })
    }

    /// Vector from the origin of the point's body to the point, world axes, m.
    pub(crate) fn arm(&self, body: usize, point: Point<A>) -> A::Vector {
        A::rotate(self.ws.links[body].rotation, point.position)
    }

    /// Visits the joints that move a point, from the point to the world: the body, and the vector from the joint's origin
    /// to the point. The vector is a sum of offsets, which avoids cancellation far from the world's origin.
    pub(crate) fn for_each_mover(&self, point: Point<A>, mut visit: impl FnMut(usize, A::Vector)) {
        let Some(body) = point.body else { return };
        let mut r = self.arm(body, point);
        let mut next = Some(body);
        while let Some(i) = next {
            visit(i, r);
            r += self.ws.links[i].offset;
            next = self.chain.bodies[i].parent;
        }
    }

    /// Jacobian of a point's velocity: 3×nv, 2×nv in the plane; world axes. Overwrites `out`; does not allocate.
    ///
    /// # Panics
    /// If `out` is smaller. May panic if the point belongs to another chain.
    pub fn point_jacobian_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &self,
        point: Point<A>,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        out.fill(A::Scalar::zero());
        self.for_each_mover(point, |i, r| {
            let column = self.ws.links[i].axis.point_velocity(r);
            for k in 0..A::LINEAR {
                out[(k, self.chain.bodies[i].v_index)] += A::linear_part(column, k);
            }
        });
    }

    /// As [`Self::point_jacobian_into`]; returns a new matrix.
    pub fn point_jacobian(&self, point: Point<A>) -> DMatrix<A::Scalar> {
        let mut j = DMatrix::zeros(A::LINEAR, self.chain.nv);
        self.point_jacobian_into(point, &mut j);
        j
    }

    /// Geometric Jacobian of a frame, 6×nv (3×nv in the plane): angular rows first, then the linear rows of the frame's
    /// origin; world axes.
    pub fn geometric_jacobian(&self, frame: FrameId) -> DMatrix<A::Scalar> {
        let frame = &self.chain.frames[frame.0];
        let origin = Point { body: frame.body, position: frame.pose.translation };
        let mut j = DMatrix::zeros(A::ANGULAR + A::LINEAR, self.chain.nv);
        self.for_each_mover(origin, |i, r| {
            let column = self.ws.links[i].axis.at_rate(nalgebra::convert(1.0)).shifted(r);
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
            velocity += self.ws.links[i].axis.point_velocity(r) * qd[self.chain.bodies[i].v_index];
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
            velocity += self.ws.links[i].axis.at_rate(qd[self.chain.bodies[i].v_index]).angular;
        });
        Ok(velocity)
    }

    /// Adds Jᵀf to `out` (length nv): the joint forces that are equivalent to a force f on a point (N, world axes). For an
    /// impulse (N s) the result is a joint impulse.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn add_point_force(&self, point: Point<A>, force: A::Vector, out: &mut [A::Scalar]) -> Result<(), ChainError> {
        self.chain.check_nv("joint force", out.len())?;
        self.for_each_mover(point, |i, r| {
            out[self.chain.bodies[i].v_index] += A::dot(self.ws.links[i].axis.point_velocity(r), force);
        });
        Ok(())
    }

    /// J̇ q̇: the acceleration of a point for q̈ = 0, world axes, m/s². `qd` has length nv.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn point_drift(&mut self, point: Point<A>, qd: &[A::Scalar]) -> Result<A::Vector, ChainError> {
        Ok(self.drifts(qd)?.of(point))
    }

    /// J̇ q̇ of any number of points, by one pass over the bodies. `qd` has length nv.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    #[doc(hidden)]
    pub fn drifts(&mut self, qd: &[A::Scalar]) -> Result<Drifts<'_, A>, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        let base = Flow::base(A::zero());
        for (i, body) in self.chain.prepared.iter().enumerate() {
            let outer = body.parent.map_or(base, |p| self.ws.flow[p]);
            self.ws.flow[i] = self.ws.flow_on(self.chain, i, &outer, qd, A::Scalar::zero());
        }
        Ok(Drifts { kin: self })
    }

    /// Outward pass of the velocities: vᵢ = v_λ + sᵢ q̇ᵢ.
    pub(crate) fn spread_velocity(&mut self, qd: &[A::Scalar]) {
        let ws = &mut *self.ws;
        for (i, body) in self.chain.prepared.iter().enumerate() {
            let Link { offset, axis, .. } = ws.links[i];
            let carried = body.parent.map_or(Motion::zero(), |p| ws.velocity[p].shifted(offset));
            ws.velocity[i] = carried + axis.at_rate(qd[body.v_index]);
        }
    }
}

//! The chain as a simulation sees it: vectors in space, whatever algebra computes them.
//!
//! A chain that keeps to a plane is computed in the plane ([`Planar`], 3-vectors); gaps, contacts and laws go on in
//! space. [`Space`] lifts and projects between the two, exactly: what stands square to the plane, the hinges bear.

use crate::error::SimError;
use carom_chain::algebra::{Algebra, Pose};
use carom_chain::{Chain, FrameId, Kinematics, Planar, PlanarChain, Point, Spatial, Workspace};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

/// An algebra whose vectors have a place in space.
pub(crate) trait Space: Algebra<Scalar = f64> {
    /// The chain, and what lifting needs.
    type Model;

    fn chain(model: &Self::Model) -> &Chain<Self>;
    fn pose(model: &Self::Model, frame: FrameId, pose: &Pose<Self>) -> Pose<Spatial<f64>>;
    fn lift(model: &Self::Model, v: Self::Vector) -> Vector3<f64>;
    fn project(model: &Self::Model, v: Vector3<f64>) -> Self::Vector;
    fn lift_angular(model: &Self::Model, w: Self::Angular) -> Vector3<f64>;
}

impl Space for Spatial<f64> {
    type Model = Chain;

    fn chain(model: &Chain) -> &Chain {
        model
    }
    fn pose(_: &Chain, _: FrameId, pose: &Pose<Self>) -> Pose<Self> {
        *pose
    }
    fn lift(_: &Chain, v: Vector3<f64>) -> Vector3<f64> {
        v
    }
    fn project(_: &Chain, v: Vector3<f64>) -> Vector3<f64> {
        v
    }
    fn lift_angular(_: &Chain, w: Vector3<f64>) -> Vector3<f64> {
        w
    }
}

impl Space for Planar<f64> {
    type Model = PlanarChain;

    fn chain(model: &PlanarChain) -> &Chain<Self> {
        &model.chain
    }
    fn pose(model: &PlanarChain, frame: FrameId, pose: &Pose<Self>) -> Pose<Spatial<f64>> {
        model.lift_pose(frame, pose)
    }
    fn lift(model: &PlanarChain, v: Vector2<f64>) -> Vector3<f64> {
        model.plane.lift(v)
    }
    fn project(model: &PlanarChain, v: Vector3<f64>) -> Vector2<f64> {
        model.plane.project(v)
    }
    fn lift_angular(model: &PlanarChain, w: f64) -> Vector3<f64> {
        model.plane.normal * w
    }
}

/// What a point feels: H = J M⁻¹ Jᵀ (3×3) and M⁻¹Jᵀ (nv×3), world axes.
pub(crate) type Felt = (Matrix3<f64>, DMatrix<f64>);

/// The chain at one configuration.
pub(crate) struct View<'a, A: Space> {
    pub model: &'a A::Model,
    pub kin: Kinematics<'a, A>,
}

impl<'a, A: Space> View<'a, A> {
    pub fn new(model: &'a A::Model, workspace: &'a mut Workspace<A>, q: &[f64]) -> Result<Self, SimError> {
        Ok(Self { model, kin: workspace.update(A::chain(model), q)? })
    }

    /// World pose of a frame.
    pub fn pose(&self, frame: FrameId) -> Pose<Spatial<f64>> {
        A::pose(self.model, frame, &self.kin.pose(frame))
    }

    /// The material point of a frame that is at `place` in the world now.
    pub fn point(&self, frame: FrameId, place: Vector3<f64>) -> Point<A> {
        let in_frame = self.kin.pose(frame).inverse().point(A::project(self.model, place));
        self.kin.chain().point(frame, in_frame)
    }

    pub fn velocity(&self, point: Point<A>, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        Ok(A::lift(self.model, self.kin.point_velocity(point, qd)?))
    }

    pub fn angular_velocity(&self, frame: FrameId, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        Ok(A::lift_angular(self.model, self.kin.angular_velocity(frame, qd)?))
    }

    /// The point's acceleration while no joint accelerates.
    pub fn drift(&mut self, point: Point<A>, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        Ok(A::lift(self.model, self.kin.point_drift(point, qd)?))
    }

    /// nᵀJ.
    pub fn row(&self, point: Point<A>, n: Vector3<f64>) -> Result<DVector<f64>, SimError> {
        let mut row = DVector::zeros(self.kin.chain().nv());
        self.kin.add_point_force(point, A::project(self.model, n), row.as_mut_slice())?;
        Ok(row)
    }

    /// 3×nv, world axes.
    pub fn jacobian(&self, point: Point<A>) -> DMatrix<f64> {
        let own = self.kin.point_jacobian(point);
        let mut jacobian = DMatrix::zeros(3, own.ncols());
        for (k, column) in own.column_iter().enumerate() {
            jacobian.set_column(k, &A::lift(self.model, A::vector(|i| column[i])));
        }
        jacobian
    }

    /// What a point feels; `None` if no joint moves it along `n`.
    pub fn inertia(&mut self, point: Point<A>, n: Vector3<f64>) -> Result<Option<Felt>, SimError> {
        let inertia = self.kin.contact_inertia(point)?;
        let axis = |k: usize| A::lift(self.model, A::vector(|i| if i == k { 1.0 } else { 0.0 }));
        let lift = DMatrix::from_fn(3, A::LINEAR, |i, k| axis(k)[i]);
        let own = lift.tr_mul(&n);
        if own.norm() < 1e-12 || inertia.effective_mass((&own / own.norm()).as_slice()).is_none() {
            return Ok(None);
        }
        let delassus = (&lift * &inertia.delassus * lift.transpose()).fixed_view::<3, 3>(0, 0).into_owned();
        Ok(Some((delassus, &inertia.response * lift.transpose())))
    }

    /// q̈ under joint forces and gravity alone.
    pub fn acceleration(&mut self, qd: &[f64], tau: &[f64], gravity: Vector3<f64>) -> Result<DVector<f64>, SimError> {
        Ok(self.kin.forward_dynamics(qd, tau, A::project(self.model, gravity))?)
    }

    /// The joint forces that hold the chain against gravity.
    pub fn gravity_force(&mut self, gravity: Vector3<f64>) -> DVector<f64> {
        self.kin.gravity_force(A::project(self.model, gravity))
    }

    /// The joint forces under which no joint accelerates.
    pub fn bias(&mut self, qd: &[f64], gravity: Vector3<f64>) -> Result<DVector<f64>, SimError> {
        Ok(self.kin.bias(qd, A::project(self.model, gravity))?)
    }

    /// Kinetic plus potential energy; heights count in the model's own plane.
    pub fn energy(&mut self, qd: &[f64], gravity: Vector3<f64>) -> Result<f64, SimError> {
        Ok(self.kin.kinetic_energy(qd)? + self.kin.potential_energy(A::project(self.model, gravity)))
    }
}

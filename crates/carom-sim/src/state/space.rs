//! The interface between a chain in the plane or in space and a simulation, whose vectors are in space.
//!
//! A planar chain is computed in the plane ([`Planar`], 3-vectors); gaps, contacts and laws are computed in space. [`Space`]
//! lifts and projects between the two. This is exact: joint constraint forces balance all loads perpendicular to the plane.

use super::accuracy::EXACT;
use super::coupling::Coupling;
use crate::error::SimError;
use carom_chain::algebra::{Algebra, Pose};
use carom_chain::{Chain, FrameId, Kinematics, Planar, PlanarChain, PlanarRow, Point, Rows, Spatial, Workspace};
use nalgebra::{DMatrix, DVector, Matrix3, MatrixXx3, Vector2, Vector3};

/// An algebra whose vectors can be lifted to space.
pub(crate) trait Space: Algebra<Scalar = f64> {
    /// The chain, and the data for lifting.
    type Model;

    fn chain(model: &Self::Model) -> &Chain<Self>;
    fn pose(model: &Self::Model, frame: FrameId, pose: &Pose<Self>) -> Pose<Spatial<f64>>;
    /// The material point at `offset` from the origin of a frame, in the axes of the frame, and the constant component of its
    /// position perpendicular to the plane.
    fn material_point(model: &Self::Model, frame: FrameId, offset: Vector3<f64>) -> (Point<Self>, Vector3<f64>);
    /// The closed form of q̈, for chains that have one.
    fn row(model: &Self::Model) -> Option<PlanarRow>;
    /// q̈ by the closed form; `false` if it fails.
    fn accelerate_row(
        row: &PlanarRow,
        motion: (&[f64], &[f64], &[f64]),
        gravity: Self::Vector,
        qdd: &mut [f64],
    ) -> bool;
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
    fn material_point(chain: &Chain, frame: FrameId, offset: Vector3<f64>) -> (Point<Self>, Vector3<f64>) {
        (chain.point(frame, offset), Vector3::zeros())
    }
    fn row(_: &Chain) -> Option<PlanarRow> {
        None
    }
    fn accelerate_row(_: &PlanarRow, _: (&[f64], &[f64], &[f64]), _: Vector3<f64>, _: &mut [f64]) -> bool {
        false
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
    fn material_point(model: &PlanarChain, frame: FrameId, offset: Vector3<f64>) -> (Point<Self>, Vector3<f64>) {
        let normal = model.plane.normal;
        let height = normal.dot(&model.lift_pose(frame, &Pose::identity()).point(offset));
        (model.point(frame, offset), normal * height)
    }
    fn row(model: &PlanarChain) -> Option<PlanarRow> {
        PlanarRow::of(&model.chain)
    }
    fn accelerate_row(
        row: &PlanarRow,
        (q, qd, tau): (&[f64], &[f64], &[f64]),
        gravity: Vector2<f64>,
        qdd: &mut [f64],
    ) -> bool {
        row.accelerate(q, qd, tau, gravity, qdd)
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

/// Delassus matrix H = J M⁻¹ Jᵀ (3×3) and response M⁻¹Jᵀ (nv×3) of a point, world axes.
pub(crate) type Felt = (Matrix3<f64>, MatrixXx3<f64>);

/// The chain at one configuration.
pub(crate) struct View<'a, A: Space> {
    pub model: &'a A::Model,
    pub kin: Kinematics<'a, A>,
    /// The loops, which bind every response.
    pub couplings: &'a [Coupling<A>],
}

impl<'a, A: Space> View<'a, A> {
    /// A chain without loops.
    pub fn new(model: &'a A::Model, workspace: &'a mut Workspace<A>, q: &[f64]) -> Result<Self, SimError> {
        Self::closed_by(model, workspace, q, &[])
    }

    /// A chain with these loops.
    pub fn closed_by(
        model: &'a A::Model,
        workspace: &'a mut Workspace<A>,
        q: &[f64],
        couplings: &'a [Coupling<A>],
    ) -> Result<Self, SimError> {
        Ok(Self { model, kin: workspace.update(A::chain(model), q)?, couplings })
    }

    /// World pose of a frame.
    pub fn pose(&self, frame: FrameId) -> Pose<Spatial<f64>> {
        A::pose(self.model, frame, &self.kin.pose(frame))
    }

    /// The material point of a frame that is at `place`, world axes.
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

    /// The acceleration of a point at q̈ = 0.
    pub fn drift(&mut self, point: Point<A>, qd: &[f64]) -> Result<Vector3<f64>, SimError> {
        Ok(A::lift(self.model, self.kin.point_drift(point, qd)?))
    }

    /// The accelerations of these points at q̈ = 0, by one pass over the bodies; zero for none.
    pub fn drifts<const N: usize>(
        &mut self,
        points: impl Iterator<Item = [Option<Point<A>>; N]>,
        qd: &[f64],
    ) -> Result<Vec<[Vector3<f64>; N]>, SimError> {
        let drifts = self.kin.drifts(qd)?;
        let of = |point: Option<Point<A>>| point.map_or_else(Vector3::zeros, |it| A::lift(self.model, drifts.of(it)));
        Ok(points.map(|points| points.map(of)).collect())
    }

    /// Adds nᵀJ to `row`.
    pub fn add_row(&self, point: Point<A>, n: Vector3<f64>, row: &mut [f64]) -> Result<(), SimError> {
        Ok(self.kin.add_point_force(point, A::project(self.model, n), row)?)
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

    /// Delassus matrix and response of a point of a chain without loops; `None` if no joint moves it along `n`.
    pub fn inertia(&mut self, point: Point<A>, n: Vector3<f64>) -> Result<Option<Felt>, SimError> {
        let own = A::project(self.model, n);
        let share = A::dot(own, own).sqrt();
        // A normal perpendicular to the plane of a planar chain.
        if share < EXACT {
            return Ok(None);
        }
        let contact = self.kin.contact(point, own * (1.0 / share), &[])?;
        if !contact.moves() {
            return Ok(None);
        }
        let axis = |k: usize| A::lift(self.model, A::vector(|i| if i == k { 1.0 } else { 0.0 }));
        let columns = contact.delassus.map(|column| A::lift(self.model, column));
        let delassus = (0..A::LINEAR).map(|k| columns[k] * axis(k).transpose()).sum();
        let rows: Vec<_> = contact.response.iter().map(|row| A::lift(self.model, *row).transpose()).collect();
        Ok(Some((delassus, MatrixXx3::from_rows(&rows))))
    }

    /// M⁻¹fᵀ for every row f, as far as the loops allow: see [`Kinematics::respond`].
    pub fn respond(&mut self, rows: &Rows, responses: &mut Rows) -> Result<(), SimError> {
        if !self.couplings.is_empty() {
            return self.respond_in_loops(None, rows, responses);
        }
        Ok(self.kin.respond(rows, responses)?)
    }

    /// [`View::respond`], with q̈ under joint forces and gravity alone, and with inertia added to each coordinate of a chain without
    /// loops: see [`Kinematics::accelerate_and_respond`].
    pub fn accelerate_and_respond(
        &mut self,
        (qd, tau, gravity): (&[f64], &[f64], Vector3<f64>),
        added: &[f64],
        qdd: &mut [f64],
        rows: &Rows,
        responses: &mut Rows,
    ) -> Result<(), SimError> {
        if !self.couplings.is_empty() {
            return self.respond_in_loops(Some((qd, tau, gravity, qdd)), rows, responses);
        }
        let gravity = A::project(self.model, gravity);
        Ok(self.kin.accelerate_and_respond((qd, tau, gravity), added, qdd, rows, responses)?)
    }

    /// q̈ under joint forces and gravity alone.
    pub fn acceleration_into(
        &mut self,
        qd: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        qdd: &mut [f64],
    ) -> Result<(), SimError> {
        if !self.couplings.is_empty() {
            let none = Rows::new(qd.len());
            return self.respond_in_loops(Some((qd, tau, gravity, qdd)), &none, &mut Rows::default());
        }
        Ok(self.kin.forward_dynamics_into(qd, tau, A::project(self.model, gravity), qdd)?)
    }

    /// The joint forces that balance gravity.
    pub fn gravity_force(&mut self, gravity: Vector3<f64>) -> DVector<f64> {
        self.kin.gravity_force(A::project(self.model, gravity))
    }

    /// The joint forces with q̈ = 0.
    pub fn bias(&mut self, qd: &[f64], gravity: Vector3<f64>) -> Result<DVector<f64>, SimError> {
        Ok(self.kin.bias(qd, A::project(self.model, gravity))?)
    }

    /// The joint forces for these accelerations.
    pub fn inverse_dynamics(
        &mut self,
        qd: &[f64],
        qdd: &[f64],
        gravity: Vector3<f64>,
    ) -> Result<DVector<f64>, SimError> {
        Ok(self.kin.inverse_dynamics(qd, qdd, A::project(self.model, gravity))?)
    }

    /// The derivatives of [`View::inverse_dynamics`] by q, in its tangent space, and by q̇.
    pub fn inverse_dynamics_derivatives(
        &mut self,
        qd: &[f64],
        qdd: &[f64],
        gravity: Vector3<f64>,
    ) -> Result<[DMatrix<f64>; 2], SimError> {
        Ok(self.kin.inverse_dynamics_derivatives(qd, qdd, A::project(self.model, gravity))?)
    }

    /// Kinetic plus potential energy; for planar chains with heights in the plane.
    pub fn energy(&mut self, qd: &[f64], gravity: Vector3<f64>) -> Result<f64, SimError> {
        Ok(self.kin.kinetic_energy(qd)? + self.kin.potential_energy(A::project(self.model, gravity)))
    }

    /// M⁻¹Jᵀ.
    pub fn responses(&mut self, j: &DMatrix<f64>) -> Result<DMatrix<f64>, SimError> {
        let (mut rows, mut responses) = (Rows::new(j.ncols()), Rows::default());
        for row in j.row_iter() {
            rows.add().iter_mut().zip(row.iter()).for_each(|(x, j)| *x = *j);
        }
        self.respond(&rows, &mut responses)?;
        let columns: Vec<_> = responses.iter().map(DVector::from_column_slice).collect();
        Ok(DMatrix::from_columns(&columns))
    }
}

/// H⁺: H is singular for planar arms, whose tip moves in two directions only.
pub(crate) fn pseudo_inverse(h: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = h.symmetric_eigen();
    let least = eigen.eigenvalues.max() * EXACT;
    let inverse = eigen.eigenvalues.map(|x| if x > least { 1.0 / x } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

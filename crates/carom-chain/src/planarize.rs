//! Exact reduction of a planar chain from space to the plane.
//!
//! A chain is planar if all hinge axes are parallel and all slider axes are perpendicular to them. Its bodies then stay in
//! parallel planes, and their motion is exactly that of their projections on one plane, with 3-vectors instead of
//! 6-vectors. The joint constraint forces balance the component of gravity normal to the plane.

use crate::algebra::{Inertia, Planar, PlanarJoint, Pose, Spatial, SpatialJoint, z_onto};
use crate::body::{Body, Frame, FrameId, Point};
use crate::chain::Chain;
use crate::error::ChainError;
use crate::rounding::ROUNDING;
use nalgebra::{Matrix3, Vector2, Vector3};

/// Tolerance on parallel and perpendicular axes (sine of the angle): the rounding of numbers of 10 digits in a file.
const ALIGNED: f64 = 1e-9;

/// A plane through the world's origin, with axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// First axis, unit, world.
    pub x: Vector3<f64>,
    /// Second axis, unit, world.
    pub y: Vector3<f64>,
    /// x × y.
    pub normal: Vector3<f64>,
}

impl Plane {
    /// The projection of a vector on the plane, in the plane's axes.
    pub fn project(&self, v: Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.x.dot(&v), self.y.dot(&v))
    }

    /// As [`Self::project`], but zero where the projection is rounding of the length of the vector. The levers of the planar chain do not
    /// contain heights, so that there it would count as a lever.
    fn shadow(&self, v: Vector3<f64>) -> Vector2<f64> {
        let shadow = self.project(v);
        if shadow.norm() <= ROUNDING * v.norm() { Vector2::zeros() } else { shadow }
    }

    /// The vector in space, world axes, of a vector in the plane.
    pub fn lift(&self, v: Vector2<f64>) -> Vector3<f64> {
        self.x * v.x + self.y * v.y
    }
}

/// A chain in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarChain {
    /// The planar chain; its q and qd are those of the chain in space.
    pub chain: Chain<Planar<f64>>,
    /// The plane.
    pub plane: Plane,
    /// World rotation of every frame while all joints are at zero.
    frame_rotations: Vec<Matrix3<f64>>,
    /// Height of every frame's origin over the plane, m: constant.
    frame_heights: Vec<f64>,
    /// The largest angle between an axis of the chain and the axis that replaces it, rad: zero up to rounding, unless a
    /// tolerance was given.
    pub tilt: f64,
}

impl PlanarChain {
    /// The projection of the point at `offset` (frame axes in space, m) from a frame's origin.
    ///
    /// # Panics
    /// May panic if the handle belongs to another chain.
    pub fn point(&self, frame: FrameId, offset: Vector3<f64>) -> Point<Planar<f64>> {
        // A frame's planar axes are the plane's while the joints are at zero.
        self.chain.point(frame, self.plane.shadow(self.frame_rotations[frame.0] * offset))
    }

    /// The pose in space of a frame whose pose in the plane is `shadow`.
    ///
    /// # Panics
    /// May panic if the handle belongs to another chain.
    #[doc(hidden)]
    pub fn lift_pose(&self, frame: FrameId, shadow: &Pose<Planar<f64>>) -> Pose<Spatial<f64>> {
        let Plane { x, y, normal } = self.plane;
        let (cos, sin) = (shadow.rotation.cos, shadow.rotation.sin);
        // x' = x cos + y sin, y' = y cos − x sin, and the normal is unchanged: R = x'xᵀ + y'yᵀ + nnᵀ.
        let turn =
            (x * cos + y * sin) * x.transpose() + (y * cos - x * sin) * y.transpose() + normal * normal.transpose();
        let translation = self.plane.lift(shadow.translation) + normal * self.frame_heights[frame.0];
        Pose { rotation: turn * self.frame_rotations[frame.0], translation }
    }
}

impl Chain {
    /// The same chain in the plane, if it is planar up to rounding: all of its axes are parallel or perpendicular within
    /// 64 ε. Computed at the first call and kept with the chain.
    pub fn in_plane(&self) -> Option<&PlanarChain> {
        let rounded = |flat: &PlanarChain| flat.tilt <= ROUNDING;
        self.flat.0.get_or_init(|| self.to_planar().ok().filter(rounded)).as_ref()
    }

    /// The same chain in the plane. The plane's normal is parallel to the hinges, its largest component positive.
    ///
    /// # Errors
    /// [`ChainError::NotReducible`], which names the joint that leaves the plane.
    pub fn to_planar(&self) -> Result<PlanarChain, ChainError> {
        self.to_planar_within(0.0)
    }

    /// As [`Self::to_planar`], for a chain whose axes deviate from parallel or perpendicular by up to `tolerance` (rad).
    /// Its axes are aligned; its pose at q = 0 does not change.
    ///
    /// Aligning an axis by an angle δ changes the rotation of its joint by at most 2δ at any joint angle: with R the joint's
    /// rotation and Q that of the alignment, ‖QRQᵀ − R‖ = ‖(Q−1)R − R(Q−1)‖ ≤ 2‖Q − 1‖ ≤ 2δ. A point is therefore displaced
    /// by at most the sum, over the joints between it and the world, of 2δ times its greatest distance from the joint.
    /// [`PlanarChain::tilt`] is the largest δ.
    ///
    /// # Errors
    /// [`ChainError::NotReducible`], which names the joint that leaves the plane.
    #[doc(hidden)]
    pub fn to_planar_within(&self, tolerance: f64) -> Result<PlanarChain, ChainError> {
        let aligned = ALIGNED.max(tolerance.sin());
        // World poses while every joint is at zero.
        let mut zero: Vec<Pose<Spatial<f64>>> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            zero.push(body.parent.map_or(body.placement, |p| zero[p].then(&body.placement)));
        }
        let axes: Vec<Vector3<f64>> = zero.iter().map(|pose| pose.rotation.column(2).into_owned()).collect();
        let plane = self.plane_of(&axes, aligned)?;
        let off = self.bodies.iter().zip(&axes).map(|(body, axis)| match body.joint {
            SpatialJoint::Prismatic => axis.dot(&plane.normal).abs(),
            _ => axis.cross(&plane.normal).norm(),
        });
        let tilt = off.fold(0.0, f64::max).min(1.0).asin();

        let shadow = |pose: &Pose<Spatial<f64>>, x: Vector2<f64>| Pose::<Planar<f64>> {
            rotation: crate::algebra::Turn { cos: x.x, sin: x.y },
            translation: plane.project(pose.translation),
        };
        let mut planar_zero: Vec<Pose<Planar<f64>>> = Vec::with_capacity(self.bodies.len());
        let mut bodies = Vec::with_capacity(self.bodies.len());
        for ((body, pose), axis) in self.bodies.iter().zip(&zero).zip(&axes) {
            let (joint, sign, x_axis) = match body.joint {
                SpatialJoint::Prismatic => (PlanarJoint::Prismatic, 1.0, plane.project(*axis).normalize()),
                _ => (PlanarJoint::Revolute, axis.dot(&plane.normal).signum(), Vector2::x()),
            };
            let own = shadow(pose, x_axis);
            let parent = body.parent.map_or(Pose::identity(), |p| planar_zero[p]);
            let in_world = body.inertia.rotated(pose.rotation);
            let inertia = Inertia::<Planar<f64>> {
                mass: in_world.mass,
                first_moment: plane.project(in_world.first_moment),
                rotational: plane.normal.dot(&(in_world.rotational * plane.normal)),
            };
            bodies.push(Body {
                parent: body.parent,
                joint_index: body.joint_index,
                joint,
                placement: parent.inverse().then(&own),
                inertia: inertia.rotated(own.inverse().rotation),
                q_index: body.q_index,
                v_index: body.v_index,
                ratio: body.ratio * sign,
                shift: body.shift * sign,
                rotor: body.rotor,
            });
            planar_zero.push(own);
        }

        let in_world = |frame: &Frame<Spatial<f64>>| frame.body.map_or(frame.pose, |b| zero[b].then(&frame.pose));
        let frames = self.frames.iter().map(|frame| {
            let own = shadow(&in_world(frame), Vector2::x());
            let parent = frame.body.map_or(Pose::identity(), |b| planar_zero[b]);
            Frame { name: frame.name.clone(), body: frame.body, pose: parent.inverse().then(&own) }
        });
        let chain = Chain::of(self.about.clone(), bodies, frames.collect(), self.nq, self.nv);
        let frame_rotations = self.frames.iter().map(|f| in_world(f).rotation).collect();
        let frame_heights = self.frames.iter().map(|f| plane.normal.dot(&in_world(f).translation)).collect();
        Ok(PlanarChain { chain, plane, frame_rotations, frame_heights, tilt })
    }

    /// The plane of motion of all joints.
    fn plane_of(&self, axes: &[Vector3<f64>], aligned: f64) -> Result<Plane, ChainError> {
        let leaves = |i: usize, why: String| {
            Err(ChainError::NotReducible(format!("joint '{}' leaves the plane: {why}", self.joint_of_body(i))))
        };
        let kind = |i: usize| self.bodies[i].joint;
        let hinges = || (0..axes.len()).filter(|&i| kind(i) == SpatialJoint::Revolute);
        let sliders = || (0..axes.len()).filter(|&i| kind(i) == SpatialJoint::Prismatic);
        if let Some(i) = (0..axes.len()).find(|&i| matches!(kind(i), SpatialJoint::Floating(_))) {
            return leaves(i, "a floating joint moves in space".into());
        }
        let Some(first) = hinges().chain(sliders()).next() else {
            return Err(ChainError::NotReducible("the chain has no moving joint, so no plane of motion".into()));
        };
        let normal = match hinges().next() {
            Some(hinge) => axes[hinge],
            // Sliders only: the normal of the first two that are not parallel, or any normal of one direction.
            None => sliders()
                .map(|i| axes[first].cross(&axes[i]))
                .find(|n| n.norm() > aligned)
                .map_or_else(|| z_onto(axes[first]).column(1).into_owned(), |n| n.normalize()),
        };
        // The sign of the normal is arbitrary: make its largest component positive.
        let normal = normal * normal[normal.iamax()].signum();
        if let Some(i) = hinges().find(|&i| axes[i].cross(&normal).norm() > aligned) {
            let [x, y, z] = axes[i].into();
            let hinge = self.joint_of_body(first);
            return leaves(i, format!("its axis ({x:.6}, {y:.6}, {z:.6}) is not parallel to that of '{hinge}'"));
        }
        if let Some(i) = sliders().find(|&i| axes[i].dot(&normal).abs() > aligned) {
            let [x, y, z] = normal.into();
            return leaves(
                i,
                format!("its direction is not perpendicular to the plane's normal ({x:.6}, {y:.6}, {z:.6})"),
            );
        }
        // x as near to the world's x as the plane allows (to its z where x is the normal).
        let toward = if normal.x.abs() > 0.9 { Vector3::y() } else { Vector3::x() };
        let x = (toward - normal * normal.dot(&toward)).normalize();
        Ok(Plane { x, y: normal.cross(&x), normal })
    }

    /// Name of the parent joint of a body.
    fn joint_of_body(&self, body: usize) -> &str {
        &self.joints()[self.bodies[body].joint_index].name
    }
}

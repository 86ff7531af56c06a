//! A tree of bodies with its mass matrix from the definition M = Σ m J_vᵀJ_v + J_ωᵀ I J_ω: independent of carom-chain.

use nalgebra::{DMatrix, Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::fmt::Write;

/// A body with the joint that carries it.
#[derive(Debug, Clone)]
pub struct Body {
    /// Index of the body below; `None` for the base.
    pub parent: Option<usize>,
    /// Of the joint in the parent's axes: position, and roll, pitch, yaw.
    pub at: Vector3<f64>,
    pub turned: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub slides: bool,
    pub mass: f64,
    /// Mass centre, in the body's axes.
    pub centre: Vector3<f64>,
    /// About the mass centre, in the body's axes.
    pub inertia: Matrix3<f64>,
}

/// URDF of the bodies: `base`, `link0` … on the joints `joint0` …
pub fn urdf(bodies: &[Body]) -> String {
    let list = |v: &Vector3<f64>| format!("{} {} {}", v.x, v.y, v.z);
    let mut text = r#"<robot name="tree"><link name="base"/>"#.to_owned();
    for (k, body) in bodies.iter().enumerate() {
        let parent = body.parent.map_or("base".to_owned(), |parent| format!("link{parent}"));
        let kind = if body.slides { "prismatic" } else { "revolute" };
        let i = &body.inertia;
        let _ = write!(
            text,
            r#"<link name="link{k}"><inertial><origin xyz="{}"/><mass value="{}"/>
            <inertia ixx="{}" ixy="{}" ixz="{}" iyy="{}" iyz="{}" izz="{}"/></inertial></link>
            <joint name="joint{k}" type="{kind}"><parent link="{parent}"/><child link="link{k}"/>
            <origin xyz="{}" rpy="{}"/><axis xyz="{}"/>
            <limit lower="-9" upper="9" effort="0" velocity="0"/></joint>"#,
            list(&body.centre),
            body.mass,
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)],
            list(&body.at),
            list(&body.turned),
            list(&body.axis)
        ); // writing to a String can't fail
    }
    text + "</robot>"
}

/// A pose of the tree.
pub struct Posed<'a> {
    bodies: &'a [Body],
    poses: Vec<Isometry3<f64>>,
}

impl<'a> Posed<'a> {
    pub fn new(bodies: &'a [Body], q: &[f64]) -> Self {
        let mut poses: Vec<Isometry3<f64>> = Vec::new();
        for (body, q) in bodies.iter().zip(q) {
            let below = body.parent.map_or_else(Isometry3::identity, |parent| poses[parent]);
            let turned =
                UnitQuaternion::from(Rotation3::from_euler_angles(body.turned.x, body.turned.y, body.turned.z));
            let moved = if body.slides {
                Isometry3::from(Translation3::from(body.axis * *q))
            } else {
                Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_scaled_axis(body.axis * *q))
            };
            poses.push(below * Isometry3::from_parts(Translation3::from(body.at), turned) * moved);
        }
        Self { bodies, poses }
    }

    /// Linear and angular velocity per joint velocity of a point of a body, given in the body's axes.
    pub fn jacobians(&self, body: usize, point: &Vector3<f64>) -> [DMatrix<f64>; 2] {
        let point = self.poses[body] * nalgebra::Point3::from(*point);
        let mut columns = [DMatrix::zeros(3, self.bodies.len()), DMatrix::zeros(3, self.bodies.len())];
        let mut below = Some(body);
        while let Some(k) = below {
            let axis = self.poses[k].rotation * self.bodies[k].axis;
            if self.bodies[k].slides {
                columns[0].set_column(k, &axis);
            } else {
                columns[0].set_column(k, &axis.cross(&(point.coords - self.poses[k].translation.vector)));
                columns[1].set_column(k, &axis);
            }
            below = self.bodies[k].parent;
        }
        columns
    }

    pub fn mass_matrix(&self) -> DMatrix<f64> {
        let mut mass = DMatrix::zeros(self.bodies.len(), self.bodies.len());
        for (k, body) in self.bodies.iter().enumerate() {
            let [linear, angular] = self.jacobians(k, &body.centre);
            let turned = self.poses[k].rotation.to_rotation_matrix().into_inner();
            mass += linear.transpose() * &linear * body.mass;
            mass += angular.transpose() * (turned * body.inertia * turned.transpose()) * &angular;
        }
        mass
    }
}

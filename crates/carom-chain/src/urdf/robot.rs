//! What a URDF says, checked, before any number is merged or moved.

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use std::path::PathBuf;

/// A checked robot description: one root, no loops, every number finite, every inertia one that a body can have.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// `<robot name>`.
    pub name: String,
    /// In the order of the file.
    pub links: Vec<Link>,
    /// In the order of the file.
    pub joints: Vec<Joint>,
    /// Index of the one link that is nobody's child.
    pub root: usize,
    /// What was read but not used, and what looks odd; one sentence each.
    pub warnings: Vec<String>,
}

/// A `<link>`.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// `None` where the file has no `<inertial>` (or one of zero mass and zero inertia).
    pub inertial: Option<Inertial>,
    /// Collision geometry, kept as data: nothing in this crate looks into it.
    pub collisions: Vec<Collision>,
}

/// An `<inertial>`, turned into link axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the link frame, m.
    pub com: Vector3<f64>,
    /// Rotational inertia about the centre of mass, in link axes, kg m².
    pub inertia_at_com: Matrix3<f64>,
}

/// A `<joint>`.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: JointType,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint frame in the parent link.
    pub origin: Isometry3<f64>,
    /// Axis in the joint frame (x where the file is silent).
    pub axis: Unit<Vector3<f64>>,
    /// Position, speed and effort limits.
    pub limits: Limits,
    /// Viscous damping, N m s/rad or N s/m.
    pub damping: f64,
    /// Static friction, N m or N.
    pub friction: f64,
    /// The joint this one follows.
    pub mimic: Option<Mimic>,
}

/// URDF joint types.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointType {
    /// A hinge with limits.
    Revolute,
    /// A hinge without limits.
    Continuous,
    /// A slider.
    Prismatic,
    /// No motion.
    Fixed,
    /// Free motion in space.
    Floating,
    /// Free motion in the plane normal to the axis.
    Planar,
}

impl JointType {
    /// The word the URDF uses.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
            Self::Fixed => "fixed",
            Self::Floating => "floating",
            Self::Planar => "planar",
        }
    }
}

/// What a joint may do; `None` where the file sets no bound.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Lowest position, rad or m.
    pub lower: Option<f64>,
    /// Highest position, rad or m.
    pub upper: Option<f64>,
    /// Highest speed, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Highest effort, N m or N.
    pub effort: Option<f64>,
}

/// `position = multiplier · (position of joint) + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mimic {
    /// Index of the joint that leads.
    pub joint: usize,
    /// Ratio of the two positions.
    pub multiplier: f64,
    /// Position of this joint where the leader is at zero.
    pub offset: f64,
}

/// A `<collision>` element: a shape and where it sits.
#[derive(Debug, Clone, PartialEq)]
pub struct Collision {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Pose in the link frame.
    pub origin: Isometry3<f64>,
    /// The shape.
    pub shape: Shape,
}

/// Shapes a URDF knows. Lengths in m; cylinder and capsule along z, centred.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Full side lengths.
    Box {
        /// Side lengths along x, y, z.
        size: Vector3<f64>,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// A cylinder with half-spheres at its ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length of the cylindrical part.
        length: f64,
    },
    /// A triangle mesh in a file that exists.
    Mesh {
        /// Resolved path.
        file: PathBuf,
        /// Scale along x, y, z.
        scale: Vector3<f64>,
    },
}

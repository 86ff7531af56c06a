//! The checked contents of a URDF, before links are merged.

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use std::fmt;
use std::path::PathBuf;

/// A checked robot description: exactly one root, no loops, every number finite, no inertia with a negative principal moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// `<robot name>`.
    pub name: String,
    /// The links, in the order of the file.
    pub links: Vec<Link>,
    /// The joints, in the order of the file.
    pub joints: Vec<Joint>,
    /// Index of the root link: the only link that is not the child of a joint.
    pub root: usize,
    /// The pairs of links between which the SRDF ([`LoadOptions::srdf`](super::LoadOptions::srdf)) disables collisions.
    pub disabled_pairs: Vec<[String; 2]>,
    /// The poses that the SRDF names.
    pub poses: Vec<NamedPose>,
    /// What loading has found and changed.
    pub report: LoadReport,
}

/// Positions of joints under a name: `<group_state>` of an SRDF.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPose {
    /// Its name.
    pub name: String,
    /// Joints with the numbers of their positions as the file has them: one for a hinge or slider, rad or m.
    pub positions: Vec<(String, Vec<f64>)>,
}

/// What loading has found in a file and changed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadReport {
    /// Deviations from the specification and values that look wrong, one sentence each. None of them makes a computation
    /// unsound. [`LoadOptions::strict`](super::LoadOptions::strict) refuses them.
    pub warnings: Vec<String>,
    /// Elements that this crate does not use, one sentence for each kind, and meshes that were left out on request.
    pub unused: Vec<String>,
    /// The changes of [`LoadOptions::repair`](super::LoadOptions::repair).
    pub repairs: Vec<Repair>,
}

impl LoadReport {
    /// The repairs and the first `shown` warnings; instead of further warnings, their number.
    pub fn summary(&self, shown: usize) -> Vec<String> {
        let repairs = self.repairs.iter().map(|repair| format!("repaired: {repair}"));
        let more = self.warnings.len().saturating_sub(shown);
        let rest = (more > 0).then(|| {
            let s = if more == 1 { "" } else { "s" };
            format!("{more} more warning{s} about the robot: carom inspect lists them")
        });
        repairs.chain(self.warnings.iter().take(shown).cloned()).chain(rest).collect()
    }
}

/// A change of [`LoadOptions::repair`](super::LoadOptions::repair).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Repair {
    /// A joint was made fixed, because nothing that it moves has mass.
    Welded {
        /// The joint.
        joint: String,
        /// Its child link, which has no mass.
        link: String,
        /// Its parent link.
        parent: String,
        /// The position at which it was fixed, rad or m; 0 for planar and floating joints.
        position: f64,
    },
    /// Principal moments of inertia were raised to the nearest ones that a body can have.
    Raised {
        /// The link.
        link: String,
        /// Principal moments in the file, in ascending order, kg m².
        before: [f64; 3],
        /// Principal moments used, each about the same axis, kg m².
        after: [f64; 3],
    },
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Welded { joint, link, parent, position } => {
                write!(
                    f,
                    "joint '{joint}' is fixed at {position}: link '{link}' has no mass and is welded to link '{parent}'"
                )
            }
            Self::Raised { link, before, after } => {
                let moments = |m: &[f64; 3]| m.map(short).join(", ");
                write!(f, "link '{link}': principal moments {} kg m² are raised to {}", moments(before), moments(after))
            }
        }
    }
}

/// A `<link>`.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// Mass and inertia. `None` without an `<inertial>`, with one of zero mass and zero inertia, and with a negative mass on
    /// a link that does not move (a warning).
    pub inertial: Option<Inertial>,
    /// Collision geometry. This crate stores it and does not use it.
    pub collisions: Vec<Collision>,
    /// Visual geometry. This crate stores it and does not use it.
    pub visuals: Vec<Visual>,
}

impl Link {
    /// A link without mass and shapes.
    #[doc(hidden)]
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), inertial: None, collisions: Vec::new(), visuals: Vec::new() }
    }
}

/// An `<inertial>`, expressed in link axes.
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
    /// Pose of the joint frame in the parent link, m.
    pub origin: Isometry3<f64>,
    /// Axis in the joint frame; x if the file has no `<axis>`.
    pub axis: Unit<Vector3<f64>>,
    /// Position, speed and effort limits.
    pub limits: Limits,
    /// Viscous damping, N m s/rad or N s/m.
    pub damping: f64,
    /// Static friction, N m or N.
    pub friction: f64,
    /// Inertia of motors' rotors reflected to the joint, N² I for the gear ratio N and the rotor's inertia I, from the elements
    /// `drake:rotor_inertia` and `drake:gear_ratio` of a `<transmission>`; kg m² or kg. 0 without them.
    pub rotor_inertia: f64,
    /// The joint that this one mimics. Chains of mimic joints are resolved: that joint does not mimic another.
    pub mimic: Option<Mimic>,
}

impl Joint {
    /// A joint in the frame of its parent link, with URDF's axis x, without limits and resistance.
    #[doc(hidden)]
    pub fn new(name: impl Into<String>, kind: JointType, parent: usize, child: usize) -> Self {
        Self {
            name: name.into(),
            kind,
            parent,
            child,
            origin: Isometry3::identity(),
            axis: Vector3::x_axis(),
            limits: Limits::default(),
            damping: 0.0,
            friction: 0.0,
            rotor_inertia: 0.0,
            mimic: None,
        }
    }
}

/// URDF joint types.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointType {
    /// A hinge with limits.
    Revolute,
    /// A hinge without limits.
    Continuous,
    /// A slider, with limits.
    Prismatic,
    /// No motion.
    Fixed,
    /// Free motion in space.
    Floating,
    /// Free motion in the plane normal to the axis.
    Planar,
}

impl JointType {
    /// The name of the type in URDF.
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

/// Limits of a joint; `None` without a limit.
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

/// A `<mimic>` element: position = `multiplier` · (position of `joint`) + `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mimic {
    /// Index of the joint that is mimicked.
    pub joint: usize,
    /// Ratio of the two positions.
    pub multiplier: f64,
    /// Position of this joint while the other is at zero, rad or m.
    pub offset: f64,
}

/// A `<collision>` element: a shape and its pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Collision {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Pose in the link frame, m.
    pub origin: Isometry3<f64>,
    /// The shape.
    pub shape: Shape,
}

/// A `<visual>` element: a shape, its pose and its colour. Its shape is never a [`Shape::MissingMesh`].
#[derive(Debug, Clone, PartialEq)]
pub struct Visual {
    /// Pose in the link frame, m.
    pub origin: Isometry3<f64>,
    /// The shape.
    pub shape: Shape,
    /// Red, green, blue and opacity of its material, each from 0 to 1, if it has one.
    pub colour: Option<[f64; 4]>,
}

/// Shapes of URDF, centred at the origin of [`Collision::origin`] or [`Visual::origin`]; cylinders and capsules along its z axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A box.
    Box {
        /// Full side lengths along x, y and z, m.
        size: Vector3<f64>,
    },
    /// A sphere.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// A cylinder.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Full length, m.
        length: f64,
    },
    /// A cylinder with hemispherical ends.
    Capsule {
        /// Radius, m.
        radius: f64,
        /// Length of the cylindrical part, m.
        length: f64,
    },
    /// A triangle mesh, in its file's own frame.
    Mesh {
        /// Path of the file, which existed when the robot was loaded.
        file: PathBuf,
        /// Scale along x, y and z.
        scale: Vector3<f64>,
    },
    /// A triangle mesh whose file was not found.
    MissingMesh {
        /// Its name in the URDF.
        name: String,
        /// Where it was searched for.
        tried: String,
    },
}

/// The number to six digits, without the rounding of the eigenvalue iteration.
pub(super) fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.5e}").parse().unwrap_or(number);
    if rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

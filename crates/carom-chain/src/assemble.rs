//! Builds the bodies of a chain from links and joints: links on fixed joints are merged with their parent, and every moving
//! joint becomes bodies of one degree of freedom.
//!
//! Only [`weld`] merges bodies; loading a URDF and [locking](crate::Chain::lock) joints both call it.

use crate::about::{About, Coordinates, JointInfo};
use crate::algebra::{Algebra, Inertia, Pose, Spatial, SpatialJoint, Symmetric3, z_onto};
use crate::body::{Body, Frame};
use crate::chain::Chain;
use crate::error::ChainError;
use crate::urdf::{self, Inertial, Joint, JointType, LoadOptions, Robot};
use nalgebra::{Matrix3, Vector3};
use std::path::Path;
use std::sync::Arc;

type Space = Spatial<f64>;

/// A link or an axis of a joint, before merging.
pub(crate) enum Node<A: Algebra> {
    /// It does not move relative to its parent.
    Fixed { parent: Option<usize>, placement: Pose<A>, inertia: Inertia<A> },
    /// It becomes this body; the parent is still an index of a node.
    Moving(Body<A>),
}

/// Merges every node that does not move relative to its parent into the parent. Also returns, for each node, its body
/// (`None` is the world) and its pose in that body.
#[allow(clippy::type_complexity)]
pub(crate) fn weld<A: Algebra>(nodes: Vec<Node<A>>) -> (Vec<Body<A>>, Vec<(Option<usize>, Pose<A>)>) {
    let mut bodies: Vec<Body<A>> = Vec::new();
    let mut places: Vec<(Option<usize>, Pose<A>)> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let place = |parent: Option<usize>, placement: &Pose<A>| {
            let (body, pose) = parent.map_or((None, Pose::identity()), |p| places[p]);
            (body, pose.then(placement))
        };
        match node {
            Node::Fixed { parent, placement, inertia } => {
                let (parent, placement) = place(parent, &placement);
                if let Some(body) = parent {
                    bodies[body].inertia += inertia.placed(&placement);
                }
                places.push((parent, placement));
            }
            Node::Moving(body) => {
                let (parent, placement) = place(body.parent, &body.placement);
                places.push((Some(bodies.len()), Pose::identity()));
                bodies.push(Body { parent, placement, ..body });
            }
        }
    }
    (bodies, places)
}

impl Chain {
    /// Reads a URDF file. The root link is fixed to the world.
    ///
    /// # Errors
    /// [`ChainError::Unreadable`], or [`ChainError::Urdf`] with file, line, element, value and rule.
    pub fn from_urdf_file(path: impl AsRef<Path>) -> Result<Self, ChainError> {
        Self::from_urdf_file_with(path, &LoadOptions::default())
    }

    /// Reads a URDF file with options: a floating base, strictness, repairs, folders of packages.
    ///
    /// # Errors
    /// As [`Chain::from_urdf_file`]; those of [`Chain::with_rotor_inertia`].
    pub fn from_urdf_file_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, ChainError> {
        Self::from_robot(urdf::read_file(path, options)?, options).with_rotors(options)
    }

    /// Reads a URDF from memory. Relative mesh paths are an error.
    ///
    /// # Errors
    /// [`ChainError::Urdf`]; its file is `<string>`.
    pub fn from_urdf_str(text: &str, options: &LoadOptions) -> Result<Self, ChainError> {
        Self::from_robot(urdf::read_str(text, None, options)?, options).with_rotors(options)
    }

    /// The same chain with the [rotors](LoadOptions::rotor_inertia) of the options, which [`Self::from_robot`] leaves out.
    ///
    /// # Errors
    /// Those of [`Chain::with_rotor_inertia`].
    pub fn with_rotors(self, options: &LoadOptions) -> Result<Self, ChainError> {
        let mut rotors = options.rotor_inertia.iter();
        rotors.try_fold(self, |chain, (joint, inertia)| chain.with_rotor_inertia(joint, *inertia))
    }

    /// Builds the chain of a checked robot. With `options.floating_base` a floating joint named `root_joint` connects the
    /// root link to the world.
    ///
    /// # Panics
    /// If the robot is not one that [`urdf::read_file`] can return: an index out of range, a loop, or a joint that mimics
    /// itself, another mimic joint or a joint without its own coordinate.
    pub fn from_robot(mut robot: Robot, options: &LoadOptions) -> Self {
        let links = robot.links.len();
        if options.floating_base {
            add_floating_base(&mut robot);
        }
        let coordinates = number_coordinates(&robot.joints);

        let mut nodes: Vec<Node<Space>> = Vec::new();
        let mut node_of_link = vec![None; robot.links.len()];
        for (link, joint) in parents_first(&robot) {
            let inertia = robot.links[link].inertial.map_or(Inertia::zero(), inertia_of);
            let (parent, placement) = match joint {
                None => (None, Pose::identity()),
                Some(j) => {
                    let joint = &robot.joints[j];
                    push_axes(&mut nodes, joint, j, &coordinates, node_of_link[joint.parent])
                }
            };
            node_of_link[link] = Some(nodes.len());
            nodes.push(Node::Fixed { parent, placement, inertia });
        }

        let (bodies, places) = weld(nodes);
        let frames = robot.links.iter().zip(&node_of_link).take(links).filter_map(|(link, node)| {
            let (body, pose) = places[(*node)?];
            Some(Frame { name: link.name.clone(), body, pose })
        });
        let (nq, nv) = lengths(&coordinates);
        Self::of(Arc::new(about(&robot, links, coordinates)), bodies, frames.collect(), nq, nv)
    }
}

fn add_floating_base(robot: &mut Robot) {
    let world = robot.links.len();
    robot.links.push(urdf::Link::new("world"));
    robot.joints.insert(0, Joint::new("root_joint", JointType::Floating, world, robot.root));
    for mimic in robot.joints.iter_mut().filter_map(|j| j.mimic.as_mut()) {
        mimic.joint += 1; // one joint was inserted before all others
    }
    robot.root = world;
}

/// Coordinates in the order of the file.
fn number_coordinates(joints: &[Joint]) -> Vec<Coordinates> {
    let (mut nq, mut nv) = (0, 0);
    let number = |joint: &Joint| {
        if let Some(m) = joint.mimic {
            let leader = joints[m.joint].name.clone();
            return Coordinates::Follows { joint: leader, multiplier: m.multiplier, offset: m.offset };
        }
        let (q, v) = match joint.kind {
            JointType::Fixed => return Coordinates::None,
            JointType::Revolute | JointType::Continuous | JointType::Prismatic => (1, 1),
            JointType::Planar => (3, 3),
            JointType::Floating => (7, 6),
        };
        (nq, nv) = (nq + q, nv + v);
        Coordinates::Own { q: nq - q..nq, v: nv - v..nv }
    };
    joints.iter().map(number).collect()
}

fn lengths(coordinates: &[Coordinates]) -> (usize, usize) {
    let own = coordinates.iter().filter_map(|c| match c {
        Coordinates::Own { q, v } => Some((q.len(), v.len())),
        _ => None,
    });
    own.fold((0, 0), |(nq, nv), (q, v)| (nq + q, nv + v))
}

/// Links with their parent joint, parents first. The stack is explicit: deep trees cannot overflow the call stack.
fn parents_first(robot: &Robot) -> Vec<(usize, Option<usize>)> {
    let mut joints_below = vec![Vec::new(); robot.links.len()];
    for (j, joint) in robot.joints.iter().enumerate().rev() {
        joints_below[joint.parent].push(j);
    }
    let mut order = Vec::with_capacity(robot.links.len());
    let mut stack = vec![(robot.root, None)];
    while let Some((link, joint)) = stack.pop() {
        order.push((link, joint));
        stack.extend(joints_below[link].iter().map(|&j| (robot.joints[j].child, Some(j))));
    }
    order
}

fn inertia_of(inertial: Inertial) -> Inertia<Space> {
    Inertia::from_com(inertial.mass, inertial.com, Symmetric3::of(&inertial.inertia_at_com))
}

/// Pushes one node for each axis of a joint; returns the node that the child link's frame is fixed to, and its pose there.
fn push_axes(
    nodes: &mut Vec<Node<Space>>,
    joint: &Joint,
    joint_index: usize,
    all: &[Coordinates],
    parent: Option<usize>,
) -> (Option<usize>, Pose<Space>) {
    let (q, v, ratio, shift) = match &all[joint_index] {
        Coordinates::Own { q, v } => (q.start, v.start, 1.0, 0.0),
        Coordinates::Follows { multiplier, offset, .. } => {
            let leader = joint.mimic.map(|m| &all[m.joint]);
            let Some(Coordinates::Own { q, v }) = leader else {
                unreachable!("validation resolves every mimic joint to a joint with its own coordinate")
            };
            (q.start, v.start, *multiplier, *offset)
        }
        Coordinates::None => return (parent, joint.origin.into()),
    };
    let (axis, rotor) = (joint.axis.into_inner(), joint.rotor_inertia);
    let axes: Vec<(SpatialJoint, Matrix3<f64>)> = match joint.kind {
        JointType::Fixed => unreachable!("a fixed joint has no coordinates"),
        JointType::Revolute | JointType::Continuous => vec![(SpatialJoint::Revolute, z_onto(axis))],
        JointType::Prismatic => vec![(SpatialJoint::Prismatic, z_onto(axis))],
        JointType::Planar => {
            let upright = z_onto(axis);
            let (x, y) = (upright.column(0).into_owned(), upright.column(1).into_owned());
            let slides = [x, y].map(|d| (SpatialJoint::Prismatic, z_onto(d)));
            slides.into_iter().chain([(SpatialJoint::Revolute, upright)]).collect()
        }
        JointType::Floating => (0..6).map(|k| (SpatialJoint::Floating(k), Matrix3::identity())).collect(),
    };
    // Each node's frame has the axis along z; its children are placed by the inverse rotation.
    let (mut parent, mut hang) = (parent, Pose::from(joint.origin));
    for (k, (joint, onto)) in axes.into_iter().enumerate() {
        let turned = Pose { rotation: onto, translation: Vector3::zeros() };
        let q_index = if matches!(joint, SpatialJoint::Floating(_)) { q } else { q + k };
        nodes.push(Node::Moving(Body {
            parent,
            joint_index,
            joint,
            placement: hang.then(&turned),
            inertia: Inertia::zero(),
            q_index,
            v_index: v + k,
            ratio,
            shift,
            rotor,
        }));
        (parent, hang) = (Some(nodes.len() - 1), turned.inverse());
    }
    (parent, hang)
}

fn about(robot: &Robot, links: usize, coordinates: Vec<Coordinates>) -> About {
    let link = |i: usize| robot.links[i].name.clone();
    let joints = robot.joints.iter().zip(coordinates).map(|(joint, coordinates)| JointInfo {
        name: joint.name.clone(),
        kind: joint.kind,
        parent: link(joint.parent),
        child: link(joint.child),
        limits: joint.limits,
        damping: joint.damping,
        friction: joint.friction,
        coordinates,
    });
    About {
        name: robot.name.clone(),
        joints: joints.collect(),
        links: robot.links[..links].to_vec(),
        total_mass: robot.links.iter().filter_map(|l| l.inertial).fold(0.0, |sum, i| sum + i.mass),
        report: robot.report.clone(),
        disabled_pairs: robot.disabled_pairs.clone(),
        poses: robot.poses.clone(),
        members: Vec::new(),
    }
}

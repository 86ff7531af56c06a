//! Joints: poses, axes, limits and mimic joints.

use super::names::{listed, suggestion};
use super::robot::{Joint, JointType, Limits, Mimic};
use super::source::{Source, own_child, own_children};
use super::tree::Tree;
use super::warnings::Warnings;
use crate::error::ChainError;
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;
use std::collections::HashMap;

/// The pose of an `<origin>`: rotations by roll, pitch and yaw about the fixed x, y and z axes, in that order.
pub(super) fn pose(origin: &urdf_rs::Pose) -> Isometry3<f64> {
    let ([x, y, z], [roll, pitch, yaw]) = (origin.xyz.0, origin.rpy.0);
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

/// The type of each joint.
///
/// # Errors
/// A type that urdf-rs supports and this crate does not.
pub(super) fn kinds(source: &Source, urdf: &urdf_rs::Robot) -> Result<Vec<JointType>, ChainError> {
    let kind = |(joint, node): (&urdf_rs::Joint, Node)| match joint.joint_type {
        urdf_rs::JointType::Revolute => Ok(JointType::Revolute),
        urdf_rs::JointType::Continuous => Ok(JointType::Continuous),
        urdf_rs::JointType::Prismatic => Ok(JointType::Prismatic),
        urdf_rs::JointType::Fixed => Ok(JointType::Fixed),
        urdf_rs::JointType::Floating => Ok(JointType::Floating),
        urdf_rs::JointType::Planar => Ok(JointType::Planar),
        urdf_rs::JointType::Spherical => Err(source.unsupported_type(node, "spherical")),
    };
    urdf.joints.iter().zip(source.joints()).map(kind).collect()
}

/// Checks that the file does not use the name of the joint that `LoadOptions::floating_base` adds.
///
/// # Errors
/// The file has a joint named `root_joint`.
pub(super) fn check_floating_base(source: &Source, urdf: &urdf_rs::Robot) -> Result<(), ChainError> {
    let mut joints = urdf.joints.iter().zip(source.joints());
    match joints.find(|(joint, _)| joint.name == "root_joint") {
        None => Ok(()),
        Some((_, node)) => {
            let rule = "the floating base is added as a joint of this name: rename the joint, or load the robot without \
                        a floating base";
            Err(source.error(node, None, rule))
        }
    }
}

/// The joints, checked.
///
/// # Errors
/// An axis of zero length, an invalid mimic joint.
pub(super) fn joints(
    source: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
    kinds: &[JointType],
    warnings: &mut Warnings,
) -> Result<Vec<Joint>, ChainError> {
    let mut joints = Vec::new();
    let mimics = mimics(source, urdf, kinds, warnings)?;
    for (j, (joint, node)) in urdf.joints.iter().zip(source.joints()).enumerate() {
        let (kind, (parent, child)) = (kinds[j], tree.ends[j]);
        let mut checked =
            Joint { origin: pose(&joint.origin), mimic: mimics[j], ..Joint::new(&joint.name, kind, parent, child) };
        if matches!(kind, JointType::Fixed | JointType::Floating) {
            for tag in ["axis", "limit", "dynamics"] {
                if let Some(element) = own_children(node, tag).next() {
                    warnings.unused(source, element, format!("<{tag}> of a {} joint", kind.name()));
                }
            }
        } else {
            checked.axis = axis(source, node, joint, kind, warnings)?;
            checked.limits = limits(source, node, kind, warnings);
            if let Some(dynamics) = &joint.dynamics {
                (checked.damping, checked.friction) = (dynamics.damping, dynamics.friction);
            }
        }
        joints.push(checked);
    }
    Ok(joints)
}

/// The axis, normalised; x if the file has no `<axis>`.
fn axis(
    source: &Source,
    node: Node,
    joint: &urdf_rs::Joint,
    kind: JointType,
    warnings: &mut Warnings,
) -> Result<Unit<Vector3<f64>>, ChainError> {
    let (axis, length) = Unit::new_and_get(Vector3::from(joint.axis.xyz.0));
    let element = own_child(node, "axis");
    if element == node {
        let text =
            format!("a {} joint without <axis> has the axis 1 0 0, as URDF says; give its <axis xyz>", kind.name());
        warnings.odd(source, node, &text);
        return Ok(axis);
    }
    if !(1e-9..1e9).contains(&length) {
        let rule = format!("has length {length}: the axis of a {} joint must be a unit vector", kind.name());
        return Err(source.error(element, Some("xyz"), rule));
    }
    if (length - 1.0).abs() > 1e-6 {
        warnings.odd(source, element, &format!("has length {length}, normalised to 1"));
    }
    Ok(axis)
}

/// Limits, read from the document, because urdf-rs reads absent attributes as zero.
fn limits(source: &Source, node: Node, kind: JointType, warnings: &mut Warnings) -> Limits {
    let element = own_child(node, "limit");
    // An attribute without a number is 0, the default in URDF; `xml` has warned of it.
    let number = |name| element.attribute(name).map(|text| text.trim().parse::<f64>().unwrap_or(0.0));
    let (mut lower, mut upper) = (number("lower"), number("upper"));
    let (velocity, effort) = (number("velocity"), number("effort"));
    if !matches!(kind, JointType::Revolute | JointType::Prismatic) {
        if lower.or(upper).is_some() {
            warnings.unused(source, element, format!("position <limit> of a {} joint", kind.name()));
        }
        return Limits { lower: None, upper: None, velocity, effort };
    }
    if element == node {
        let text = format!("a {} joint should have a <limit>; read as without limits", kind.name());
        warnings.odd(source, node, &text);
        return Limits::default();
    }
    for (name, value) in [("effort", effort), ("velocity", velocity)] {
        if value.is_none() {
            warnings.assumed(source, element, format!("<limit> without {name}"), "no limit");
        }
    }
    match (lower, upper) {
        (None, None) => {
            warnings.odd(source, element, "lower and upper are missing; read as without position limits");
        }
        _ if open_limits(source) => {}
        (None, Some(_)) => {
            lower = Some(0.0);
            warnings.odd(source, element, "lower is missing; read as 0, its default in URDF");
        }
        (Some(_), None) => {
            upper = Some(0.0);
            warnings.odd(source, element, "upper is missing; read as 0, its default in URDF");
        }
        _ => {}
    }
    if let (Some(lower), Some(upper)) = (lower, upper)
        && lower > upper
    {
        let text = format!("lower {lower} is greater than upper {upper}; read as without position limits");
        warnings.odd(source, element, &text);
        return Limits { lower: None, upper: None, velocity, effort };
    }
    Limits { lower, upper, velocity, effort }
}

/// Whether a missing limit means no limit: from version 1.2 of URDF.
fn open_limits(source: &Source) -> bool {
    let version = source.root.attribute("version").and_then(|text| text.trim().split_once('.'));
    let number = |text: &str| text.parse::<u32>().ok();
    version.and_then(|(major, minor)| Some((number(major)?, number(minor)?) >= (1, 2))).unwrap_or(false)
}

/// Mimic joints, each resolved to a joint that does not mimic another.
fn mimics(
    source: &Source,
    urdf: &urdf_rs::Robot,
    kinds: &[JointType],
    warnings: &mut Warnings,
) -> Result<Vec<Option<Mimic>>, ChainError> {
    let names: Vec<&str> = urdf.joints.iter().map(|joint| joint.name.as_str()).collect();
    let index: HashMap<&str, usize> = names.iter().enumerate().map(|(j, name)| (*name, j)).collect();
    let nodes: Vec<Node> = source.joints().into_iter().map(|node| own_child(node, "mimic")).collect();
    let one_axis = |j: usize| matches!(kinds[j], JointType::Revolute | JointType::Continuous | JointType::Prismatic);
    let mut mimics = Vec::new();
    for (j, joint) in urdf.joints.iter().enumerate() {
        let Some(mimic) = &joint.mimic else {
            mimics.push(None);
            continue;
        };
        if kinds[j] == JointType::Fixed {
            warnings.odd(source, nodes[j], "a fixed joint does not move; not used");
            mimics.push(None);
            continue;
        }
        let wrong = |rule| Err(source.error(nodes[j], Some("joint"), rule));
        let Some(leader) = index.get(mimic.joint.as_str()).copied() else {
            let hint = suggestion(&mimic.joint, &names);
            return wrong(format!("no joint is named '{}': {hint}", mimic.joint));
        };
        if leader == j {
            return wrong("a joint cannot mimic itself: name another joint, or remove <mimic>".into());
        }
        for (joint, role) in [(j, "mimic another"), (leader, "be mimicked")] {
            if !one_axis(joint) {
                let (name, kind) = (&urdf.joints[joint].name, kinds[joint].name());
                return wrong(format!(
                    "joint '{name}' is {kind} and cannot {role}: only revolute, continuous and prismatic joints can"
                ));
            }
        }
        let (multiplier, offset) = (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
        if multiplier == 0.0 {
            return Err(source.error(nodes[j], Some("multiplier"), "is 0, so the joint never moves: make it fixed"));
        }
        mimics.push(Some(Mimic { joint: leader, multiplier, offset }));
    }
    resolve_chains(source, urdf, &nodes, &mut mimics)?;
    Ok(mimics)
}

/// Resolves chains of mimic joints: a = m·b + n and b = p·c + q give a = m·p·c + m·q + n.
fn resolve_chains(
    source: &Source,
    urdf: &urdf_rs::Robot,
    nodes: &[Node],
    mimics: &mut [Option<Mimic>],
) -> Result<(), ChainError> {
    let mut done = vec![false; mimics.len()];
    let mut on_path = vec![false; mimics.len()];
    for j in 0..mimics.len() {
        let mut path = Vec::new();
        let mut next = j;
        while let Some(mimic) = mimics[next].filter(|_| !done[next]) {
            if std::mem::replace(&mut on_path[next], true) {
                let ring = path.iter().skip_while(|joint| **joint != next);
                let names: Vec<&str> = ring.map(|joint: &usize| urdf.joints[*joint].name.as_str()).collect();
                let rule = format!("joints {} mimic each other in a loop: remove one <mimic>", listed(&names));
                return Err(source.error(nodes[next], Some("joint"), rule));
            }
            path.push(next);
            next = mimic.joint;
        }
        for joint in path.into_iter().rev() {
            done[joint] = true;
            let Some(mimic) = &mut mimics[joint].take() else { continue };
            if let Some(leader) = mimics[mimic.joint] {
                mimic.offset += mimic.multiplier * leader.offset;
                mimic.multiplier *= leader.multiplier;
                mimic.joint = leader.joint;
            }
            if !mimic.multiplier.is_normal() || !mimic.offset.is_finite() {
                let rule = format!(
                    "its chain of mimic joints gives multiplier {} and offset {}, outside the range of numbers: correct \
                     the multipliers and offsets",
                    mimic.multiplier, mimic.offset
                );
                return Err(source.error(nodes[joint], None, rule));
            }
            mimics[joint] = Some(*mimic);
        }
    }
    Ok(())
}

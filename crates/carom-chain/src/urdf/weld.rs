//! Welds links without mass to the links that carry them, so that every coordinate moves some mass.

use super::robot::{Joint, JointType, Limits, Link, Repair};
use super::tree::Tree;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// Fixes the joints of every coordinate that moves no mass at the position nearest to 0 within the limits, and returns what
/// was changed. A robot of which nothing that moves has mass is not changed: nothing would be left to move.
pub(super) fn weld_massless(tree: &Tree, links: &[Link], joints: &mut [Joint], floating_base: bool) -> Vec<Repair> {
    let mut carries: Vec<bool> = links.iter().map(|link| link.inertial.is_some()).collect();
    for joint in tree.outwards.iter().rev() {
        let (parent, child) = tree.ends[*joint];
        carries[parent] |= carries[child];
    }
    // A mimic joint and the joint that it mimics share a coordinate.
    let leader = |j: usize| joints[j].mimic.map_or(j, |mimic| mimic.joint);
    let mut heavy = vec![false; joints.len()];
    for (j, joint) in joints.iter().enumerate() {
        heavy[leader(j)] |= joint.kind != JointType::Fixed && carries[joint.child];
    }
    let base_moves_mass = floating_base && carries[tree.root];
    if !base_moves_mass && !heavy.contains(&true) {
        return Vec::new();
    }
    let light = (0..joints.len()).filter(|j| joints[*j].kind != JointType::Fixed && !heavy[leader(*j)]);
    let nearest = |limits: Limits| 0.0_f64.min(limits.upper.unwrap_or(0.0)).max(limits.lower.unwrap_or(0.0));
    let position = |j: usize| match joints[j].mimic {
        Some(mimic) => mimic.multiplier * nearest(joints[mimic.joint].limits) + mimic.offset,
        None => nearest(joints[j].limits),
    };
    let welds: Vec<(usize, f64)> = light.map(|j| (j, position(j))).collect();
    let mut repairs = Vec::new();
    for (j, position) in welds {
        let joint = &mut joints[j];
        joint.origin *= motion(joint, position);
        joint.kind = JointType::Fixed;
        (joint.limits, joint.damping, joint.friction, joint.mimic) = (Limits::default(), 0.0, 0.0, None);
        repairs.push(Repair::Welded {
            joint: joint.name.clone(),
            link: links[joint.child].name.clone(),
            parent: links[joint.parent].name.clone(),
            position,
        });
    }
    repairs
}

/// Motion of a joint from 0 to `position`; none for planar and floating joints.
fn motion(joint: &Joint, position: f64) -> Isometry3<f64> {
    match joint.kind {
        JointType::Revolute | JointType::Continuous => {
            UnitQuaternion::from_axis_angle(&joint.axis, position) * Isometry3::identity()
        }
        JointType::Prismatic => Translation3::from(joint.axis.into_inner() * position).into(),
        JointType::Fixed | JointType::Planar | JointType::Floating => Isometry3::identity(),
    }
}

//! Exact reductions: a chain with fewer bodies and the same results.
//!
//! Links on fixed joints are merged when the file is loaded. This module locks joints, and prunes branches whose velocity
//! no impact at a given point can change: those that a different joint connects to the fixed base, because an impulse on
//! the fixed base moves nothing. The third reduction, to the plane, is [`Chain::to_planar`].

use crate::about::{About, Coordinates, JointInfo, Member};
use crate::algebra::{Algebra, Pose};
use crate::assemble::{Node, weld};
use crate::body::{Body, Frame, Point};
use crate::chain::Chain;
use crate::error::ChainError;
use std::ops::Range;
use std::sync::Arc;

/// A reduced chain, and the indices of its coordinates in the full chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced<A: Algebra> {
    /// The reduced chain. Look up its frames by name: handles of the full chain are not valid for it.
    pub chain: Chain<A>,
    /// Entry k of the reduced q is entry `q[k]` of the full q.
    pub q: Vec<usize>,
    /// Entry k of the reduced qd is entry `v[k]` of the full qd.
    pub v: Vec<usize>,
}

impl<A: Algebra<Scalar = f64>> Chain<A> {
    /// Locks joints at the given positions (rad, m, quaternion; one number for a revolute or prismatic joint, three for a
    /// planar one, seven for a floating one) and merges the bodies that they connect. Joints that mimic a locked joint are
    /// locked too.
    ///
    /// # Errors
    /// [`ChainError::UnknownJoint`], [`ChainError::WrongLength`], [`ChainError::NotFinite`],
    /// [`ChainError::NotUnitQuaternion`]; [`ChainError::NotReducible`] for a joint without its own coordinates.
    pub fn lock(&self, joints: &[(&str, &[f64])]) -> Result<Reduced<A>, ChainError> {
        let mut q_locked = self.zero_configuration();
        let mut locked = vec![false; self.nv];
        for &(name, values) in joints {
            let Coordinates::Own { q, v } = &self.joint(name)?.coordinates else {
                return Err(ChainError::NotReducible(format!(
                    "joint '{name}' has no coordinate of its own to lock (it is fixed, or follows another joint)"
                )));
            };
            if values.len() != q.len() {
                let layout = format!("joint '{name}'");
                return Err(ChainError::WrongLength { what: "value", got: values.len(), expected: q.len(), layout });
            }
            q_locked[q.clone()].copy_from_slice(values);
            locked[v.clone()].fill(true);
        }
        self.check_state(&q_locked, &vec![0.0; self.nv])?;
        let numbering = self.renumber(|v| !locked[v]);
        let nodes = self.bodies.iter().map(|body| {
            if !locked[body.v_index] {
                return Node::Moving(numbering.body(body));
            }
            let (placement, q) = (body.placement, &q_locked[body.q_index..]);
            let (rotation, moved) = A::move_joint(body.joint, placement.rotation, body.ratio, body.shift, q);
            let placement = Pose { rotation, translation: placement.translation + moved };
            Node::Fixed { parent: body.parent, placement, inertia: body.inertia }
        });
        let (bodies, places) = weld(nodes.collect());
        let frames = self.frames.iter().map(|frame| match frame.body {
            None => frame.clone(),
            Some(b) => {
                let (body, pose) = places[b];
                Frame { name: frame.name.clone(), body, pose: pose.then(&frame.pose) }
            }
        });
        let frames = frames.collect();
        Ok(self.rebuilt(bodies, frames, numbering))
    }

    /// Removes every body whose velocity no impulse at any of the `points` can change: all branches from the fixed base that
    /// contain none of the points. Branches that share a coordinate with a kept one through mimic joints are kept.
    pub fn prune(&self, points: &[Point<A>]) -> Reduced<A> {
        let mut root: Vec<usize> = Vec::with_capacity(self.bodies.len());
        for (i, body) in self.bodies.iter().enumerate() {
            root.push(body.parent.map_or(i, |p| root[p]));
        }
        let mut reached = vec![false; self.bodies.len()]; // by root
        let mut active = vec![false; self.nv];
        for body in points.iter().filter_map(|point| point.body) {
            reached[root[body]] = true;
        }
        loop {
            let before = (active.clone(), reached.clone());
            for (i, body) in self.bodies.iter().enumerate() {
                active[body.v_index] |= reached[root[i]];
                reached[root[i]] |= active[body.v_index];
            }
            if (&active, &reached) == (&before.0, &before.1) {
                break;
            }
        }

        let numbering = self.renumber(|v| active[v]);
        let mut moved_to = vec![None; self.bodies.len()];
        let mut bodies: Vec<Body<A>> = Vec::new();
        for (i, body) in self.bodies.iter().enumerate().filter(|(i, _)| reached[root[*i]]) {
            moved_to[i] = Some(bodies.len());
            bodies.push(Body { parent: body.parent.and_then(|p| moved_to[p]), ..numbering.body(body) });
        }
        let frames = self.frames.iter().filter_map(|frame| {
            let body = match frame.body {
                None => None,
                Some(b) => Some(moved_to[b]?),
            };
            Some(Frame { body, ..frame.clone() })
        });
        let frames = frames.collect();
        self.rebuilt(bodies, frames, numbering)
    }

    fn rebuilt(&self, bodies: Vec<Body<A>>, frames: Vec<Frame<A>>, to: Numbering) -> Reduced<A> {
        let joints = self.about.joints.iter().map(|joint| to.joint(joint, &self.about.joints)).collect();
        let members = self.about.members.iter().map(|member| to.member(member)).collect();
        let about = About { joints, members, ..(*self.about).clone() };
        let chain = Chain::of(Arc::new(about), bodies, frames, to.old_q.len(), to.old_v.len());
        Reduced { chain, q: to.old_q, v: to.old_v }
    }

    /// New indices of the coordinates of the joints that are kept.
    fn renumber(&self, keep: impl Fn(usize) -> bool) -> Numbering {
        let mut to = Numbering { new_q: vec![0; self.nq], new_v: vec![0; self.nv], old_q: vec![], old_v: vec![] };
        for joint in &self.about.joints {
            let Coordinates::Own { q, v } = &joint.coordinates else {
                continue;
            };
            if !keep(v.start) {
                continue;
            }
            for old in q.clone() {
                to.new_q[old] = to.old_q.len();
                to.old_q.push(old);
            }
            for old in v.clone() {
                to.new_v[old] = to.old_v.len();
                to.old_v.push(old);
            }
        }
        to
    }
}

/// Indices of the coordinates before and after a reduction.
struct Numbering {
    new_q: Vec<usize>,
    new_v: Vec<usize>,
    old_q: Vec<usize>,
    old_v: Vec<usize>,
}

impl Numbering {
    /// The body with its new indices.
    fn body<A: Algebra>(&self, body: &Body<A>) -> Body<A> {
        Body { q_index: self.new_q[body.q_index], v_index: self.new_v[body.v_index], ..*body }
    }

    /// The entries of a robot of a joined chain that are kept.
    fn member(&self, member: &Member) -> Member {
        let range = |old: &[usize], of: &Range<usize>| {
            let before = |end: usize| old.iter().filter(|k| **k < end).count();
            before(of.start)..before(of.end)
        };
        Member { q: range(&self.old_q, &member.q), v: range(&self.old_v, &member.v), ..member.clone() }
    }

    fn keeps(&self, joint: &JointInfo) -> bool {
        matches!(&joint.coordinates, Coordinates::Own { v, .. } if self.old_v.contains(&v.start))
    }

    /// The joint with its new indices; without coordinates if it is locked or pruned, or mimics such a joint.
    fn joint(&self, joint: &JointInfo, all: &[JointInfo]) -> JointInfo {
        let coordinates = match &joint.coordinates {
            Coordinates::Own { q, v } if self.keeps(joint) => {
                let (q0, v0) = (self.new_q[q.start], self.new_v[v.start]);
                Coordinates::Own { q: q0..q0 + q.len(), v: v0..v0 + v.len() }
            }
            follows @ Coordinates::Follows { joint: leader, .. }
                if all.iter().any(|j| j.name == *leader && self.keeps(j)) =>
            {
                follows.clone()
            }
            _ => Coordinates::None,
        };
        JointInfo { coordinates, ..joint.clone() }
    }
}

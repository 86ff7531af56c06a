//! The tree of links and joints: resolves names to indices, and checks that all links form one tree.

use super::names::{listed, suggestion};
use super::robot::JointType;
use super::source::{Source, own_child};
use crate::error::ChainError;
use nalgebra::Vector3;
use roxmltree::Node;
use std::collections::HashMap;

/// The links and joints as a rooted tree.
pub(super) struct Tree {
    pub root: usize,
    /// Parent and child link of each joint.
    pub ends: Vec<(usize, usize)>,
    /// Joints, each after the parent joint of its parent link.
    pub outwards: Vec<usize>,
}

impl Tree {
    /// Checks that names are unique, that joints connect existing links, and that all links form one tree.
    ///
    /// # Errors
    /// Duplicate and unknown names, links with two parents, several roots, loops.
    pub fn new(source: &Source, urdf: &urdf_rs::Robot) -> Result<Self, ChainError> {
        let links: Vec<&str> = urdf.links.iter().map(|link| link.name.as_str()).collect();
        let link_index = index(source, &source.links(), &links)?;
        let joints: Vec<&str> = urdf.joints.iter().map(|joint| joint.name.as_str()).collect();
        index(source, &source.joints(), &joints)?;

        let mut ends = Vec::new();
        let mut above: Vec<Option<usize>> = vec![None; links.len()];
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        for (j, (joint, node)) in urdf.joints.iter().zip(source.joints()).enumerate() {
            let find = |tag, name: &str| {
                link_index.get(name).copied().ok_or_else(|| {
                    let rule = format!("no link is named '{name}': {}", suggestion(name, &links));
                    source.error(own_child(node, tag), Some("link"), rule)
                })
            };
            let (parent, child) = (find("parent", &joint.parent.link)?, find("child", &joint.child.link)?);
            if parent == child {
                let rule = format!("connects link '{}' to itself: parent and child must differ", joint.child.link);
                return Err(source.error(node, None, rule));
            }
            if let Some(other) = above[child].replace(j) {
                let rule = format!(
                    "link '{}' is already the child of joint '{}' (line {}): a link is the child of at most one joint, \
                     because URDF cannot describe closed loops; remove one of the two joints",
                    joint.child.link,
                    joints[other],
                    source.line(source.joints()[other])
                );
                return Err(source.error(node, None, rule));
            }
            below[parent].push(j);
            ends.push((parent, child));
        }

        let roots: Vec<usize> = (0..links.len()).filter(|link| above[*link].is_none()).collect();
        if let [_, second, ..] = roots[..] {
            let names: Vec<&str> = roots.iter().map(|link| links[*link]).collect();
            let rule = format!(
                "links {} are the child of no joint, but a robot has exactly one root link: connect them by joints, for \
                 example fixed ones",
                listed(&names)
            );
            return Err(source.error(source.links()[second], None, rule));
        }
        let mut reached = vec![false; links.len()];
        let mut outwards = Vec::new();
        if let Some(root) = roots.first() {
            reached[*root] = true;
            let mut next = below[*root].clone();
            while let Some(joint) = next.pop() {
                let child = ends[joint].1;
                reached[child] = true;
                outwards.push(joint);
                next.extend(&below[child]);
            }
        }
        match (roots.first(), reached.iter().position(|reached| !reached)) {
            (Some(root), None) => Ok(Self { root: *root, ends, outwards }),
            (_, lost) => Err(loop_error(source, &links, &ends, &above, lost.unwrap_or(0))),
        }
    }

    /// Which links can move relative to the world.
    pub fn moving(&self, kinds: &[JointType], floating_base: bool) -> Vec<bool> {
        let mut moves = vec![false; self.ends.len() + 1];
        moves[self.root] = floating_base;
        for joint in &self.outwards {
            let (parent, child) = self.ends[*joint];
            moves[child] = moves[parent] || kinds[*joint] != JointType::Fixed;
        }
        moves
    }

    /// Greatest distance of a centre of mass from the first joint that moves it, measured along the links, m. What places that
    /// joint in the world does not count.
    pub fn reach(&self, urdf: &urdf_rs::Robot, moves: &[bool]) -> f64 {
        let length = |origin: &urdf_rs::Pose| Vector3::from(origin.xyz.0).norm();
        let mut along = vec![0.0; moves.len()];
        for joint in self.outwards.iter().filter(|joint| moves[self.ends[**joint].0]) {
            let (parent, child) = self.ends[*joint];
            along[child] = along[parent] + length(&urdf.joints[*joint].origin);
        }
        let links = urdf.links.iter().zip(along).zip(moves).filter(|(_, moves)| **moves);
        links.map(|((link, along), _)| along + length(&link.inertial.origin)).fold(0.0, f64::max)
    }
}

/// The index of each name. Names must be unique.
fn index<'a>(source: &Source, nodes: &[Node], names: &[&'a str]) -> Result<HashMap<&'a str, usize>, ChainError> {
    let mut indices = HashMap::new();
    for (i, name) in names.iter().enumerate() {
        if let Some(first) = indices.insert(*name, i) {
            let line = source.line(nodes[first]);
            let rule = format!("the name is already used on line {line}: names must be unique; rename one of the two");
            return Err(source.error(nodes[i], None, rule));
        }
    }
    Ok(indices)
}

/// The error that names the loop above `lost`, a link without a path to a root: following its parents must enter a loop.
fn loop_error(
    source: &Source,
    links: &[&str],
    ends: &[(usize, usize)],
    above: &[Option<usize>],
    lost: usize,
) -> ChainError {
    let parent = |link: usize| above[link].map_or(link, |joint| ends[joint].0);
    let start = (0..links.len()).fold(lost, |link, _| parent(link));
    let mut around = vec![start];
    let mut link = parent(start);
    while link != start {
        around.push(link);
        link = parent(link);
    }
    around.reverse();
    let first = (0..around.len()).min_by_key(|i| around[*i]).unwrap_or(0);
    around.rotate_left(first);
    let names: Vec<&str> = around.iter().map(|link| links[*link]).collect();
    let rule = format!(
        "links {} form a loop: a robot is a tree, so make one of them the child of another link, or the root",
        listed(&names)
    );
    source.error(source.links()[around[0]], None, rule)
}

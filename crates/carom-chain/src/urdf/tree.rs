//! Which joint hangs which link on which: names to indices, and one tree that holds every link.

use super::names::{listed, suggestion};
use super::source::{Source, own_child};
use crate::error::ChainError;
use roxmltree::Node;
use std::collections::HashMap;

/// The links and joints as a rooted tree.
pub(super) struct Tree {
    pub root: usize,
    /// Parent and child link of each joint.
    pub ends: Vec<(usize, usize)>,
    /// Joints, each after the one that carries its parent link.
    pub outwards: Vec<usize>,
}

impl Tree {
    /// Checks that names differ, that joints join links, and that all of it is one tree.
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
                let rule = format!("joins link '{}' to itself: parent and child must differ", joint.child.link);
                return Err(source.error(node, None, rule));
            }
            if let Some(other) = above[child].replace(j) {
                let rule = format!(
                    "link '{}' is already the child of joint '{}' (line {}): a link hangs on one joint, and a closed \
                     loop can't be written in URDF; remove one of the two",
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
                "links {} hang on no joint, and a robot has one root: join them, by fixed joints if nothing moves there",
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
}

/// The index of each name. Names must differ.
fn index<'a>(source: &Source, nodes: &[Node], names: &[&'a str]) -> Result<HashMap<&'a str, usize>, ChainError> {
    let mut indices = HashMap::new();
    for (i, name) in names.iter().enumerate() {
        if let Some(first) = indices.insert(*name, i) {
            let line = source.line(nodes[first]);
            let rule = format!("the name is already taken on line {line}: names must differ, rename one");
            return Err(source.error(nodes[i], None, rule));
        }
    }
    Ok(indices)
}

/// Names the loop that a link which no root carries hangs on. Going up from it never ends, so it ends in the loop.
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
        "links {} form a loop, each the child of the next: one of them must hang on the rest of the robot",
        listed(&names)
    );
    source.error(source.links()[around[0]], None, rule)
}

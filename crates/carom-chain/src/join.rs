//! Several robots as one chain: a forest whose trees are all connected to the world.
//!
//! M of the joined chain is block diagonal, one block for each robot, and an impulse on one robot moves no other. The
//! factorisation of M, the recursions and H use the tree, so the zeros cost nothing.

use crate::about::{About, Coordinates, JointInfo, Member};
use crate::algebra::{Pose, Spatial};
use crate::body::{Body, Frame};
use crate::chain::Chain;
use crate::error::ChainError;
use crate::urdf::{Link, LoadReport, Repair};
use nalgebra::Isometry3;
use std::sync::Arc;

/// A robot of [`Chain::join`].
#[derive(Debug, Clone, PartialEq)]
pub struct Placed<'a> {
    /// Its name: not empty, without `/`, and different from that of every other robot.
    pub name: &'a str,
    /// The robot.
    pub chain: &'a Chain,
    /// Pose of the robot's own world in the common world, m. For a robot on a fixed base that is the pose of its root link;
    /// the floating joint of a floating robot is relative to it, so its q is a pose in the common world for the identity.
    pub pose: Isometry3<f64>,
}

impl Chain {
    /// One chain of several robots. Joint `elbow` of the robot `left` is named `left/elbow`, and links are named in the same
    /// way. q and qd list the robots in their order; [`Chain::members`] has the entries of each.
    ///
    /// # Errors
    /// [`ChainError::RobotName`]: a name that is empty, contains `/` or is used twice.
    ///
    /// ```
    /// use carom_chain::{Chain, Placed, uniform_chain};
    /// use nalgebra::Isometry3;
    /// let arm = uniform_chain(2, 1.0, 1.0)?;
    /// let robots = [("left", -0.5), ("right", 0.5)];
    /// let robots = robots.map(|(name, x)| Placed { name, chain: &arm, pose: Isometry3::translation(x, 0.0, 0.0) });
    /// let both = Chain::join("cell", &robots)?;
    /// assert_eq!((both.nv(), both.members()[1].v.clone()), (4, 2..4));
    /// assert!(both.joint("right/joint2").is_ok());
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    pub fn join(name: &str, robots: &[Placed]) -> Result<Self, ChainError> {
        let mut about = About { name: name.into(), ..About::default() };
        let mut bodies: Vec<Body<Spatial<f64>>> = Vec::new();
        let mut frames: Vec<Frame<Spatial<f64>>> = Vec::new();
        let (mut nq, mut nv) = (0, 0);
        for (k, Placed { name, chain, pose }) in robots.iter().enumerate() {
            let refuse = |problem| Err(ChainError::RobotName { name: (*name).into(), problem });
            if name.is_empty() || name.contains('/') {
                return refuse(
                    "must not be empty or contain '/', which separates it from the names of links and joints",
                );
            }
            if robots[..k].iter().any(|other| other.name == *name) {
                return refuse("is used for two robots: rename one");
            }
            let world = Pose::from(*pose);
            let (first_body, first_joint) = (bodies.len(), about.joints.len());
            let placed = |body: Option<usize>, own: &Pose<Spatial<f64>>| match body {
                Some(_) => *own,
                None => world.then(own),
            };
            bodies.extend(chain.bodies.iter().map(|body| Body {
                parent: body.parent.map(|parent| parent + first_body),
                joint_index: body.joint_index + first_joint,
                placement: placed(body.parent, &body.placement),
                q_index: body.q_index + nq,
                v_index: body.v_index + nv,
                ..*body
            }));
            let full = |own: &str| format!("{name}/{own}");
            frames.extend(chain.frames.iter().map(|frame| Frame {
                name: full(&frame.name),
                body: frame.body.map(|body| body + first_body),
                pose: placed(frame.body, &frame.pose),
            }));
            // The world of a floating base is no link of the file.
            let link =
                |own: &String| if chain.links().iter().any(|it| it.name == *own) { full(own) } else { own.clone() };
            about.joints.extend(chain.joints().iter().map(|joint| JointInfo {
                name: full(&joint.name),
                parent: link(&joint.parent),
                child: link(&joint.child),
                coordinates: joint.coordinates.shifted(nq, nv, full),
                ..joint.clone()
            }));
            let links = chain.links().iter();
            about.links.extend(links.map(|it| Link { name: full(&it.name), ..it.clone() }));
            let pairs = chain.disabled_pairs().iter();
            about.disabled_pairs.extend(pairs.map(|pair| pair.each_ref().map(|link| full(link))));
            about.total_mass += chain.total_mass();
            about.report.append(name, chain.report());
            about.members.push(Member { name: (*name).into(), q: nq..nq + chain.nq, v: nv..nv + chain.nv });
            (nq, nv) = (nq + chain.nq, nv + chain.nv);
        }
        Ok(Self::of(Arc::new(about), bodies, frames, nq, nv))
    }
}

impl Coordinates {
    fn shifted(&self, nq: usize, nv: usize, full: impl Fn(&str) -> String) -> Self {
        match self {
            Self::Own { q, v } => Self::Own { q: q.start + nq..q.end + nq, v: v.start + nv..v.end + nv },
            Self::Follows { joint, multiplier, offset } => {
                Self::Follows { joint: full(joint), multiplier: *multiplier, offset: *offset }
            }
            Self::None => Self::None,
        }
    }
}

impl LoadReport {
    /// Adds what loading a robot of that name has found.
    fn append(&mut self, name: &str, of: &Self) {
        let told = |lines: &[String]| lines.iter().map(|line| format!("{name}: {line}")).collect::<Vec<_>>();
        self.warnings.extend(told(&of.warnings));
        self.unused.extend(told(&of.unused));
        self.repairs.extend(of.repairs.iter().map(|repair| repair.of_robot(name)));
    }
}

impl Repair {
    fn of_robot(&self, name: &str) -> Self {
        let full = |own: &String| format!("{name}/{own}");
        match self {
            Self::Welded { joint, link, parent, position } => {
                Self::Welded { joint: full(joint), link: full(link), parent: full(parent), position: *position }
            }
            Self::Raised { link, before, after } => Self::Raised { link: full(link), before: *before, after: *after },
        }
    }
}

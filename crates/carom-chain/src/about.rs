//! The joints and links of the file, as far as they do not depend on the algebra.

use crate::urdf::{JointType, Limits, Link, LoadReport, NamedPose};
use std::ops::Range;

/// Which entries of q and qd belong to a joint.
#[derive(Debug, Clone, PartialEq)]
pub enum Coordinates {
    /// Its own entries of q and of qd.
    Own {
        /// Entries of q.
        q: Range<usize>,
        /// Entries of qd.
        v: Range<usize>,
    },
    /// A mimic joint: position = `multiplier` · (position of the other joint) + `offset`.
    Follows {
        /// Name of the joint that it mimics.
        joint: String,
        /// Ratio of the positions.
        multiplier: f64,
        /// Position while the other joint is at zero, rad or m.
        offset: f64,
    },
    /// No coordinates: the joint is fixed in the file, locked or pruned.
    None,
}

/// The coordinate that a hinge or slider moves with: position of the joint = `multiplier` · q + `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointCoordinate {
    /// Index into q.
    pub q: usize,
    /// Index into qd.
    pub v: usize,
    /// Ratio of the positions: 1 for a joint with its own coordinate.
    pub multiplier: f64,
    /// Position while the coordinate is zero, rad or m: 0 for a joint with its own coordinate.
    pub offset: f64,
}

/// A joint of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct JointInfo {
    /// Its name.
    pub name: String,
    /// Its type in the file.
    pub kind: JointType,
    /// Name of the parent link.
    pub parent: String,
    /// Name of the child link.
    pub child: String,
    /// Limits of position, speed and effort.
    pub limits: Limits,
    /// Viscous damping, N m s/rad or N s/m.
    pub damping: f64,
    /// Static friction, N m or N.
    pub friction: f64,
    /// Its entries of q and qd.
    pub coordinates: Coordinates,
}

impl JointInfo {
    /// The index into qd of a joint with one coordinate of its own, which a motor can drive.
    pub(crate) fn driven_coordinate(&self) -> Option<usize> {
        match &self.coordinates {
            Coordinates::Own { v, .. } if v.len() == 1 => Some(v.start),
            _ => None,
        }
    }
}

/// The part of the model that does not depend on the algebra.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct About {
    pub name: String,
    pub joints: Vec<JointInfo>,
    pub links: Vec<Link>,
    pub total_mass: f64,
    pub report: LoadReport,
    /// Pairs of links that make no contact.
    pub disabled_pairs: Vec<[String; 2]>,
    /// Poses by name.
    pub poses: Vec<NamedPose>,
    /// The robots of a joined chain.
    pub members: Vec<Member>,
}

/// A robot of a joined chain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// Its entries of q.
    pub q: Range<usize>,
    /// Its entries of qd.
    pub v: Range<usize>,
}

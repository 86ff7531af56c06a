//! Loops of a mechanism: joints that close a tree of links.

use crate::error::{SimError, named};
use crate::state::{Coupling, EQUAL, Space, reach};
use carom_chain::Chain;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A joint that closes a loop: it keeps two frames together by a bilateral constraint, which carries forces and impulses
/// without loss. A chain is a tree, so a four-bar linkage is a chain of three hinges and a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// Its name.
    pub name: String,
    /// What it leaves free.
    pub joint: LoopJoint,
    /// The two frames.
    pub frames: [LoopFrame; 2],
}

/// What a loop leaves free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoopJoint {
    /// The origins stay together: a ball joint.
    Point,
    /// The origins and this axis (the same components in both frames) stay together: a hinge.
    Pin {
        /// The axis, of any length, in the axes of each frame.
        axis: Vector3<f64>,
    },
    /// The frames stay together.
    Weld,
}

impl LoopJoint {
    /// The name in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Pin { .. } => "pin",
            Self::Weld => "weld",
        }
    }
}

/// A frame on a link, or in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopFrame {
    /// The link; `None`: the world.
    pub link: Option<String>,
    /// Origin, m, and orientation, in the axes of the link.
    pub origin: Vector3<f64>,
    /// Orientation in the axes of the link.
    pub rotation: UnitQuaternion<f64>,
}

impl LoopFrame {
    /// The frame at `origin` (m, axes of the link) with roll, pitch and yaw `rpy` (rad) about the fixed axes of the link, as in
    /// URDF.
    pub fn new(link: Option<&str>, origin: impl Into<Vector3<f64>>, [r, p, y]: [f64; 3]) -> Self {
        let rotation = Rotation3::from_euler_angles(r, p, y).into();
        Self { link: link.map(str::to_owned), origin: origin.into(), rotation }
    }

    fn place(&self, offset: Vector3<f64>) -> Vector3<f64> {
        self.origin + self.rotation * offset
    }
}

impl Loop {
    /// Checks the loop for a chain.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an unknown link; [`SimError::Named`] for a loop between a link and itself or within the world, an
    /// axis without direction, and numbers that are not finite.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), SimError> {
        let refuse = |rule| Err(named("loop", &self.name, rule));
        for link in self.frames.iter().filter_map(|frame| frame.link.as_ref()) {
            chain.frame(link)?;
        }
        if self
            .frames
            .iter()
            .any(|frame| !frame.origin.iter().chain(frame.rotation.coords.iter()).all(|x| x.is_finite()))
        {
            return refuse("has a frame with numbers that are not finite");
        }
        let [one, other] = self.frames.each_ref().map(|frame| frame.link.as_ref());
        let fixed_to = |frame| chain.point(frame, Vector3::zeros()).body;
        let body = |link: Option<&String>| link.and_then(|link| chain.frame(link).ok()).and_then(fixed_to);
        if one == other || body(one) == body(other) {
            return refuse(
                "joins two frames that cannot move relative to each other: name links that a joint separates",
            );
        }
        match self.joint {
            LoopJoint::Pin { axis } if axis.try_normalize(f64::MIN_POSITIVE).is_none() || !axis.norm().is_finite() => {
                refuse("has an axis without direction: give a vector that is finite and not zero")
            }
            _ => Ok(()),
        }
    }

    /// The pairs of points that it keeps together: the origins; for a pin two points of the axis; for a weld three points. They
    /// are a quarter of the chain's reach apart, so that velocities of rotation and translation have similar weight.
    pub(crate) fn couplings<A: Space>(&self, chain: &Chain, model: &A::Model) -> Vec<Coupling<A>> {
        // A chain ends at the frame of its last link, which may reach further.
        let ends = self.frames.iter().filter(|frame| frame.link.is_some()).map(|frame| frame.origin.norm());
        let reach = Some(ends.fold(reach(chain), f64::max)).filter(|it| *it > 0.0 && it.is_finite()).unwrap_or(1.0);
        let size = 0.25 * reach;
        let name: Arc<str> = self.name.as_str().into();
        let at = |frame: &LoopFrame| frame.link.as_ref().and_then(|link| chain.frame(link).ok());
        let [one, other] = &self.frames;
        // A place of the world has to be the second.
        let (one, other) = if at(one).is_none() { (other, one) } else { (one, other) };
        let Some(frame) = at(one) else { return Vec::new() };
        let offsets = match self.joint {
            LoopJoint::Point => vec![Vector3::zeros()],
            LoopJoint::Pin { axis } => {
                let arm = axis.normalize() * size;
                let [above, below] =
                    [arm, -arm].map(|offset| A::material_point(model, frame, one.place(offset)).0.position);
                let apart = above - below;
                // In the plane a pin perpendicular to it is a point.
                let is_point = A::dot(apart, apart) < (EQUAL * size).powi(2);
                if is_point { vec![Vector3::zeros()] } else { vec![arm, -arm] }
            }
            LoopJoint::Weld => [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis * size).to_vec(),
        };
        let couple =
            |offset| Coupling::new(&name, model, (frame, one.place(offset)), (at(other), other.place(offset)), reach);
        offsets.into_iter().map(couple).collect()
    }
}

//! The parts of a chain: bodies with their joints, frames of links, and points.

use crate::algebra::{Algebra, Inertia, Pose};
use nalgebra::Vector3;

/// One body and the joint that connects it to its parent, in a frame aligned with the joint's axis. For two hinges in a row the
/// x axis of the body between them is parallel to their common perpendicular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body<A: Algebra> {
    /// Index of the parent body, smaller than this body's own; `None` is the world.
    pub parent: Option<usize>,
    /// Index in [`Chain::joints`](crate::Chain::joints) of the joint it belongs to.
    pub joint_index: usize,
    /// Type of the joint.
    pub joint: A::Joint,
    /// Pose of the joint's frame in the parent body (or the world) while the joint is at zero.
    pub placement: Pose<A>,
    /// Inertia about the body's origin, in body axes.
    pub inertia: Inertia<A>,
    /// Index in q of the joint's first coordinate.
    pub q_index: usize,
    /// Index in qd of the joint's velocity.
    pub v_index: usize,
    /// Joint position = `ratio` · q + `shift`. `ratio` is 1 unless the joint mimics another; −1 in the plane for an axis
    /// opposite to the plane's normal.
    pub ratio: A::Scalar,
    /// See `ratio`; rad or m. 0 unless the joint mimics another.
    pub shift: A::Scalar,
    /// Inertia of the motor's rotor, reflected to the joint: see
    /// [`Chain::with_rotor_inertia`](crate::Chain::with_rotor_inertia); kg m² or kg.
    pub rotor: A::Scalar,
}

/// A named frame: one for every link of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame<A: Algebra> {
    /// The link's name.
    pub name: String,
    /// The body it is fixed to; `None` is the world.
    pub body: Option<usize>,
    /// Its pose in that body (or the world).
    pub pose: Pose<A>,
}

/// Handle of a frame, from [`Chain::frame`](crate::Chain::frame).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct FrameId(pub(crate) usize);

/// A point fixed to a link, for example a contact point. A frame stands for its origin.
///
/// ```
/// # use carom_chain::{FramePoint, uniform_chain};
/// let tip = uniform_chain(2, 1.0, 1.0)?.frame("tip")?;
/// assert_eq!(FramePoint::from(tip), FramePoint::new(tip, [0.0; 3]));
/// # Ok::<(), carom_chain::ChainError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePoint {
    /// A frame of the link.
    pub frame: FrameId,
    /// The point relative to the origin of the frame, in its axes, m.
    pub offset: Vector3<f64>,
}

impl FramePoint {
    /// The point at `offset` from the origin of `frame`, in its axes, m.
    pub fn new(frame: FrameId, offset: impl Into<Vector3<f64>>) -> Self {
        Self { frame, offset: offset.into() }
    }
}

impl From<FrameId> for FramePoint {
    fn from(frame: FrameId) -> Self {
        Self { frame, offset: Vector3::zeros() }
    }
}

/// A point of a body as the algorithms use it: from [`Chain::point`](crate::Chain::point), in the plane or in space, for any
/// scalar. The description of a point of a link is a [`FramePoint`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point<A: Algebra> {
    /// The body it is fixed to; `None` is the world.
    pub body: Option<usize>,
    /// Its position relative to the body's origin, body axes, m.
    pub position: A::Vector,
}

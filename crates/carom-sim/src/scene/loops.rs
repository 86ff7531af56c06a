//! The loops of the mechanism, `[[loop]]`.

use super::file;
use crate::model::{Loop, LoopFrame, LoopJoint};
use carom_chain::Chain;

/// The `k`-th loop of a scene.
pub(crate) fn closure(chain: &Chain, k: usize, given: &file::Loop) -> Result<Loop, String> {
    let name = given.name.clone().unwrap_or_else(|| format!("loop {}", k + 1));
    let refuse = |why: String| format!("[[loop]] {}: {why}", k + 1);
    let joint = match (given.joint, given.axis) {
        (file::LoopJoint::Pin, axis) => LoopJoint::Pin { axis: axis.unwrap_or([0.0, 0.0, 1.0]).into() },
        (_, Some(_)) => return Err(refuse("has an axis, which only joint = \"pin\" has: remove it".into())),
        (file::LoopJoint::Point, None) => LoopJoint::Point,
        (file::LoopJoint::Weld, None) => LoopJoint::Weld,
    };
    let frame = |given: &file::LoopFrame| LoopFrame::new(given.link.as_deref(), given.xyz, given.rpy);
    let own = Loop { name, joint, frames: [frame(&given.first), frame(&given.second)] };
    own.check(chain).map_err(|e| refuse(e.to_string()))?;
    Ok(own)
}

//! Smooth motion: the equations of one contact mode.

mod dry;
mod free_motion;
mod held;
mod settle;
mod smooth;

pub(crate) use dry::{Dry, DryJoint};
pub use free_motion::{free_motion, free_motion_at};
pub(crate) use held::Held;
pub(crate) use smooth::Motion;

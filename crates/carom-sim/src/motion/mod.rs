//! Smooth motion: the equations of one contact mode.

pub(crate) mod free_motion;
pub(crate) mod held;
pub(crate) mod settle;
pub(crate) mod smooth;

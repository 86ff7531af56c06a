//! The possible contacts of a chain and what happens at them.

pub(crate) mod compliance;
pub(crate) mod rule;
pub(crate) mod touch;

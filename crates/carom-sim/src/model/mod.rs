//! What is simulated: a chain, its possible contacts, its motors and the settings.

pub(crate) mod drive;
pub(crate) mod simulation;

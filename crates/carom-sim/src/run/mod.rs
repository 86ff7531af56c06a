//! The run of a simulation from event to event.

pub(crate) mod events;
pub(crate) mod leg;
pub(crate) mod root;
pub(crate) mod several;
pub(crate) mod trajectory;
pub(crate) mod watch;

//! A chain at one state.

pub(crate) mod space;

//! The names of the Rerun SDK that recordings use, under one path.
//!
//! `re_sdk` (streams, sinks) and `re_sdk_types` (what can be logged) are what the crate `rerun` re-exports; a dependency on
//! `rerun` itself would also build its client, query engine and video code.

pub(crate) use re_sdk::*;
pub(crate) use re_sdk_types::archetypes::*;
pub(crate) use re_sdk_types::components::{Color, FillMode, Radius};
pub(crate) use re_sdk_types::datatypes::Quaternion;
pub(crate) use re_sdk_types::{components, datatypes};

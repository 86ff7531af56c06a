//! Recordings of scenes, impacts and impact maps for the Rerun viewer. No type of `rerun` is in a public signature.
//!
//! A recording of a motion holds links, surfaces, the path of the tip, arrows for impulses, and time series; the state at an
//! impact is logged twice at its exact time, before and after the jump. Every recording has a blueprint, the layout that the
//! viewer opens with. The format of Rerun is not compatible between versions: write recordings anew instead of keeping them.

mod bounds;
mod diagrams;
mod geometry;
mod lasting;
mod layout;
mod map;
mod measures;
mod scene;
mod summary;
mod target;

pub use diagrams::record_diagrams;
pub use map::{check_map, record_map};
pub use scene::SceneRecorder;
pub use target::Target;

/// The recorder of Rerun with what it logs, under the names that the crate `rerun` has for them.
#[doc(hidden)] // for the recording of the example planar2
pub mod rerun {
    pub use re_sdk::*;
    pub use re_sdk_types::archetypes::*;
    pub use re_sdk_types::components::{AlbedoFactor, Color, FillMode, Radius};
    pub use re_sdk_types::datatypes::Quaternion;
    pub use re_sdk_types::{components, datatypes};
}

use std::path::PathBuf;

/// Errors of writing a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The chain refuses a configuration, a link name or a velocity.
    #[error(transparent)]
    Chain(#[from] carom_chain::ChainError),
    /// A collision shape or mesh cannot be used.
    #[error(transparent)]
    Contact(#[from] carom_contact::ContactError),
    /// A map cannot be recorded; the message gives the reason.
    #[error("{0}")]
    Map(String),
    /// The viewer cannot be reached or started, or does not answer.
    #[error("the viewer cannot be used: {reason}")]
    Viewer {
        /// Message of the recorder or of the system.
        reason: String,
    },
    /// The file cannot be written.
    #[error("{}: the recording cannot be written: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Message of the system or of the recorder.
        reason: String,
    },
}

/// The largest number of the series …, 1, 2, 5, 10, … that is not above `scale`.
fn round(scale: f64) -> f64 {
    let ten = 10.0_f64.powf(scale.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|k| k * ten).find(|step| *step <= scale).unwrap_or(ten)
}

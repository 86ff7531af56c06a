//! Recordings for the Rerun viewer: rerun stops here, none of its types is in a public signature.
//!
//! A recording shows what the numbers mean: links, tip path, wall, impulse and velocity arrows, on the exact time of the
//! impact (both sides of the jump at that time), with a blueprint that opens on the whole. Recordings are made anew, never
//! kept: the format promises no compatibility.

mod bounds;
mod diagrams;
mod geometry;
mod layout;
mod map;
mod measures;
mod planar2;
mod scene;
mod summary;
mod target;

pub use diagrams::record_diagrams;
pub use map::record_map;
pub use planar2::{Side, record_planar2};
pub use scene::SceneRecorder;
pub use target::Target;

use std::path::PathBuf;

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The chain refuses.
    #[error(transparent)]
    Chain(#[from] carom_chain::ChainError),
    /// A shape can't be used.
    #[error(transparent)]
    Contact(#[from] carom_contact::ContactError),
    /// A map can't be shown.
    #[error("{0}")]
    Map(String),
    /// A viewer can't be reached or started.
    #[error("the viewer can't be used: {reason}")]
    Viewer {
        /// What the recorder said.
        reason: String,
    },
    /// The file can't be written.
    #[error("{}: the recording can't be written: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the system or the recorder said.
        reason: String,
    },
}

/// The nearest of 1, 2, 5, 10, … below.
fn round(scale: f64) -> f64 {
    let ten = 10.0_f64.powf(scale.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|k| k * ten).find(|step| *step <= scale).unwrap_or(ten)
}

//! Reasons why the paper cannot be reproduced.

use carom_chain::ChainError;
use carom_sim::SimError;
use carom_study::TableError;
use std::io;
use std::path::PathBuf;

/// Reason why the figures cannot be computed or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaperError {
    /// Error of the arm or of the simulation.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The simulation has no impact followed by separation.
    #[error(
        "{elbow}-elbow: the tip of this arm does not hit the wall and separate from it: give an arm like robots/planar2.urdf"
    )]
    Missed {
        /// The configuration: `up` or `down`.
        elbow: &'static str,
    },
    /// A table cannot be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A figure cannot be drawn.
    #[error("{0}")]
    Figure(String),
    /// The folder contains something else than the files of a report, or only some of them.
    #[error(
        "{folder}: it contains {found}: give a new or empty folder, or the folder of an earlier report, which is replaced"
    )]
    Occupied {
        /// The folder.
        folder: PathBuf,
        /// What is in it, and why it is no report.
        found: String,
    },
    /// A file or folder cannot be written.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file or folder.
        file: PathBuf,
        /// Error of the operating system.
        reason: io::Error,
    },
}

impl From<ChainError> for PaperError {
    fn from(error: ChainError) -> Self {
        Self::Sim(error.into())
    }
}

//! One line for everything that is refused.

use crate::input::Refused;
use carom_chain::ChainError;
use carom_sim::SimError;
use std::io;
use std::path::Path;

/// Why a command stopped.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The robot's file, which names itself in its message.
    #[error(transparent)]
    Robot(ChainError),
    /// A scene, or its simulation; a scene names its file itself.
    #[error("{0}")]
    Scene(String),
    /// A recording, which names its file itself.
    #[cfg(feature = "rerun")]
    #[error(transparent)]
    Recording(#[from] carom_record::RecordError),
    /// A table.
    #[error(transparent)]
    Table(#[from] carom_study::TableError),
    /// Measurements, which name their file themselves.
    #[error(transparent)]
    Measured(#[from] carom_study::consistency::MeasuredError),
    /// The paper's figures, which name their folder themselves.
    #[error(transparent)]
    Paper(#[from] carom_study::paper::PaperError),
    /// A file that can't be written.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file.
        file: String,
        /// What the system said.
        reason: io::Error,
    },
    /// A study or its map, which name their files themselves.
    #[error(transparent)]
    Study(#[from] carom_study::StudyError),
    /// A map that was stopped.
    #[error(
        "interrupted after {rows} of {total} rows, which are in {}: the same command with --resume goes on",
        partial.display()
    )]
    Interrupted {
        /// Rows that are done.
        rows: u64,
        /// Rows wanted.
        total: u64,
        /// Where they are.
        partial: std::path::PathBuf,
    },
    /// An option, with the file it speaks of.
    #[error("{0}")]
    Option(String),
    /// A line of input.
    #[error("{file}:{line}: {reason}")]
    Line {
        /// The file, or `<stdin>`.
        file: String,
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// Input that can't be read.
    #[error("{file}: cannot be read: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system said.
        reason: io::Error,
    },
    /// Output that can't be written.
    #[error("cannot write the answer: {0}")]
    Output(#[from] io::Error),
}

impl CliError {
    /// What a scene is refused for, with its file; some errors name theirs.
    pub fn scene(file: &Path, error: SimError) -> Self {
        match error {
            SimError::Scene { .. } | SimError::Chain(ChainError::Urdf { .. }) => Self::Scene(error.to_string()),
            other => Self::Scene(format!("{}: {other}", file.display())),
        }
    }

    /// An answer about a scene that can't be given.
    pub fn refused(file: &Path, refused: Refused) -> Self {
        match refused {
            Refused::Output(e) => Self::Output(e),
            Refused::Input(e) => Self::Scene(format!("{}: {e}", file.display())),
        }
    }
}

/// Why one line can't be answered; the reader of lines adds file and number.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LineError(pub String);

impl From<ChainError> for LineError {
    fn from(error: ChainError) -> Self {
        Self(error.to_string())
    }
}

impl From<SimError> for LineError {
    fn from(error: SimError) -> Self {
        Self(error.to_string())
    }
}

impl From<carom_impact::ImpactError> for LineError {
    fn from(error: carom_impact::ImpactError) -> Self {
        Self(error.to_string())
    }
}

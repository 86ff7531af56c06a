//! One line for everything that is refused.

use carom_chain::ChainError;
use carom_sim::SimError;
use std::io;

/// Why a command stopped.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The robot's file, which names itself in its message.
    #[error(transparent)]
    Robot(ChainError),
    /// A scene, or its simulation; a scene names its file itself.
    #[error("{0}")]
    Scene(String),
    /// A file that can't be written.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file.
        file: String,
        /// What the system said.
        reason: io::Error,
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

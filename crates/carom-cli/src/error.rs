//! Errors of the commands, each printed as one line.

use carom_chain::ChainError;
use carom_evidence::EvidenceError;
use carom_sim::SimError;
use carom_study::{RowsError, TableError, map_study::StudyError};
use std::fmt::Display;
use std::io;
use std::path::Path;

/// Error that ends a command.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// What is refused, or a file that cannot be read or written; the message names the file, the option or both.
    #[error("{0}")]
    Input(String),
    /// A table of rows with numbers whose computation was interrupted.
    #[error(
        "interrupted after {rows} of {total} rows, which are in {}: run the same command with --resume to continue",
        partial.display()
    )]
    Interrupted {
        /// Number of rows that are done.
        rows: u64,
        /// Number of rows of the table or its part.
        total: u64,
        /// The file that holds them.
        partial: std::path::PathBuf,
    },
    /// Runs of `carom simulate --runs` without a table that were interrupted; the answer is that of the first ones.
    #[error("interrupted after {count} of {runs} runs")]
    InterruptedRuns {
        /// Number of runs that are done.
        count: u64,
        /// Number of runs that were asked for.
        runs: u64,
    },
    /// Standard output that cannot be written.
    #[error("cannot write the answer: {0}")]
    Output(#[from] io::Error),
}

impl CliError {
    /// Error of a scene, with its file unless the error names it.
    pub fn scene(file: &Path, error: SimError) -> Self {
        match error {
            SimError::Scene { .. } | SimError::Chain(ChainError::Urdf { .. } | ChainError::Xacro { .. }) => {
                Self::Input(error.to_string())
            }
            other => Self::Input(format!("{}: {other}", file.display())),
        }
    }

    /// A line of input that is refused; lines are counted from 1.
    pub fn line(file: impl Display, line: usize, reason: &str) -> Self {
        Self::Input(format!("{file}:{line}: {reason}"))
    }

    /// Input that cannot be read.
    pub fn unreadable(file: impl Display, reason: &io::Error) -> Self {
        Self::Input(format!("{file}: cannot be read: {reason}"))
    }

    /// A file that cannot be written.
    pub fn unwritable(file: &Path, reason: &io::Error) -> Self {
        Self::Input(format!("{}: cannot be written: {reason}", file.display()))
    }
}

/// Conversions that keep the message of an error.
macro_rules! from {
    ($to:ty, $make:expr => $($kind:ty),+) => {$(
        impl From<$kind> for $to {
            fn from(error: $kind) -> Self {
                $make(error.to_string())
            }
        }
    )+};
}

// the messages of these errors name the file
from!(CliError, CliError::Input => EvidenceError, RowsError, StudyError, TableError);
#[cfg(feature = "rerun")]
from!(CliError, CliError::Input => carom_record::RecordError);

/// Why a line is refused; the reader of lines adds file and number.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LineError(pub String);

from!(LineError, LineError => ChainError, SimError, carom_impact::ImpactError);

/// Why a line was not answered.
pub enum Refused {
    /// Its content is refused.
    Input(LineError),
    /// The answer cannot be written.
    Output(io::Error),
}

impl<E: Into<LineError>> From<E> for Refused {
    fn from(error: E) -> Self {
        Self::Input(error.into())
    }
}

//! Errors of the commands, each printed as one line.

use carom_chain::ChainError;
use carom_sim::SimError;
use std::io;
use std::path::Path;

/// Error that ends a command.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// A robot; the message names its file.
    #[error(transparent)]
    Robot(ChainError),
    /// A scene or its simulation; the message names the file.
    #[error("{0}")]
    Scene(String),
    /// A recording; the message names its file.
    #[cfg(feature = "rerun")]
    #[error(transparent)]
    Recording(#[from] carom_record::RecordError),
    /// A table.
    #[error(transparent)]
    Table(#[from] carom_study::TableError),
    /// A program of the evidence; the message names its file or folder.
    #[error(transparent)]
    Evidence(#[from] carom_evidence::EvidenceError),
    /// A file that cannot be written.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file.
        file: String,
        /// Message of the system.
        reason: io::Error,
    },
    /// A study or its map; the message names their files.
    #[error(transparent)]
    Study(#[from] carom_study::map_study::StudyError),
    /// Rows of a table that are not written; the message names their files.
    #[error(transparent)]
    Rows(#[from] carom_study::RowsError),
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
    /// Cells of `carom stress` that are not as theory predicts.
    #[error("{count} cells are defects, see the notes in stress.md: {cells}")]
    Defects {
        /// Number of defects.
        count: usize,
        /// Scene and method of each.
        cells: String,
    },
    /// An option; the message names it, and its file if it has one.
    #[error("{0}")]
    Option(String),
    /// A line of input that is refused.
    #[error("{file}:{line}: {reason}")]
    Line {
        /// The file, or `<stdin>`.
        file: String,
        /// Counted from 1.
        line: usize,
        /// The rule that it breaks.
        reason: String,
    },
    /// Input that cannot be read.
    #[error("{file}: cannot be read: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// Message of the system.
        reason: io::Error,
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
                Self::Scene(error.to_string())
            }
            other => Self::Scene(format!("{}: {other}", file.display())),
        }
    }

    /// Error of the one answer of a command, with the file that it is about.
    pub fn refused(file: &Path, refused: Refused) -> Self {
        match refused {
            Refused::Output(e) => Self::Output(e),
            Refused::Input(e) => Self::Scene(format!("{}: {e}", file.display())),
        }
    }
}

/// Why a line is refused; the reader of lines adds file and number.
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

//! The error of all programs.

/// Reason why a program cannot do what it is asked for: the file or option, the value, the rule, and what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct EvidenceError(String);

impl EvidenceError {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }

    /// An error of a file or folder.
    pub(crate) fn of_file(file: &std::path::Path, reason: impl std::fmt::Display) -> Self {
        Self(format!("{}: {reason}", file.display()))
    }
}

macro_rules! from {
    ($($kind:ty),+) => {$(
        impl From<$kind> for EvidenceError {
            fn from(error: $kind) -> Self {
                Self(error.to_string())
            }
        }
    )+};
}

from!(carom_chain::ChainError, carom_sim::SimError, carom_study::TableError, carom_study::TossError);

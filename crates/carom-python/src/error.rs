//! Errors of the crates as Python exceptions; the message is that of the error.

use carom_chain::ChainError;
use carom_impact::ImpactError;
use carom_sim::SimError;
use carom_study::aim::AimError;
use carom_study::fit::FitError;
use carom_study::map_study::StudyError;
use carom_study::orbit::OrbitError;
use carom_study::{RowsError, TableError, TossError};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

/// The exceptions, defined in `python/carom/_errors.py`.
pub mod exceptions {
    pyo3::import_exception!(carom._errors, ChainError);
    pyo3::import_exception!(carom._errors, UrdfError);
    pyo3::import_exception!(carom._errors, StateError);
    pyo3::import_exception!(carom._errors, ImpactError);
    pyo3::import_exception!(carom._errors, SimulationError);
    pyo3::import_exception!(carom._errors, StudyError);
    pyo3::import_exception!(carom._errors, FitError);
    pyo3::import_exception!(carom._errors, RecordError);
}

/// An error of a crate, as the exception that it becomes.
pub trait Raise {
    /// The exception. `at` is put before the message: the place in a batch, or nothing.
    fn raise(&self, at: &str) -> PyErr;
}

impl Raise for ChainError {
    fn raise(&self, at: &str) -> PyErr {
        let message = format!("{at}{self}");
        match self {
            Self::Unreadable { .. }
            | Self::Urdf { .. }
            | Self::Xacro { .. }
            | Self::MeshNotFound { .. }
            | Self::PackageNotFound { .. } => exceptions::UrdfError::new_err(message),
            Self::WrongLength { .. } | Self::NotFinite { .. } | Self::NotUnitQuaternion { .. } => {
                exceptions::StateError::new_err(message)
            }
            _ => exceptions::ChainError::new_err(message),
        }
    }
}

impl Raise for SimError {
    fn raise(&self, at: &str) -> PyErr {
        match self {
            Self::Chain(error) => error.raise(at),
            Self::Impact(error) => error.raise(at),
            Self::Incomplete { .. }
            | Self::FixedPoint { .. }
            | Self::SingularNormal { .. }
            | Self::Locked { .. }
            | Self::Together { .. }
            | Self::Unbalanced { .. } => exceptions::ImpactError::new_err(format!("{at}{self}")),
            _ => exceptions::SimulationError::new_err(format!("{at}{self}")),
        }
    }
}

/// Errors with one exception each; the error of another crate within becomes the exception of that.
macro_rules! raise_as {
    ($($error:ident $(except $inner:ident)? => $exception:ident),+ $(,)?) => {$(
        impl Raise for $error {
            fn raise(&self, at: &str) -> PyErr {
                match self {
                    $(Self::$inner(error) => error.raise(at),)?
                    _ => exceptions::$exception::new_err(format!("{at}{self}")),
                }
            }
        }
    )+};
}

raise_as! {
    ImpactError => ImpactError,
    StudyError except Robot => StudyError,
    AimError except Run => StudyError,
    OrbitError except Run => StudyError,
    RowsError => StudyError,
    TableError => StudyError,
    FitError => FitError,
    TossError => FitError,
}

/// An error with the number of its state in a batch.
pub struct InBatch<E> {
    /// The error.
    pub error: E,
    /// Number of the state, from 0; `None` for a single state.
    pub state: Option<usize>,
}

impl<E: Raise> From<InBatch<E>> for PyErr {
    fn from(it: InBatch<E>) -> Self {
        let at = it.state.map_or_else(String::new, |k| format!("state {k}: "));
        it.error.raise(&at)
    }
}

/// Warns the caller.
pub fn warn(py: Python<'_>, message: String) -> PyResult<()> {
    let text = std::ffi::CString::new(message).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
}

/// The exception of an error that has no place in a batch.
pub fn raise<E: Raise>(error: E) -> PyErr {
    error.raise("")
}

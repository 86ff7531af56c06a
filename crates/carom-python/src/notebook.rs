//! What notebooks show of results: `python/carom/_notebook.py` writes it.

use crate::array::Array;
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;

/// The result of a function of that module.
pub fn call<'py>(py: Python<'py>, function: &str, arguments: impl PyCallArgs<'py>) -> PyResult<Array<'py>> {
    py.import("carom._notebook")?.getattr(function)?.call1(arguments)
}

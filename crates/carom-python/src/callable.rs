//! Functions of Python that the crates call: laws and controllers.

use crate::array::{Numbers, shown};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};

/// A function of Python, with the exception that it has raised last.
pub struct Callable {
    function: Py<PyAny>,
    raised: Mutex<Option<PyErr>>,
}

impl Callable {
    /// The function, and its name.
    ///
    /// # Errors
    /// `TypeError` for what cannot be called; `of` says what it is a function of.
    pub fn new(function: &Bound<'_, PyAny>, of: &str) -> PyResult<(Self, String)> {
        if !function.is_callable() {
            return Err(PyTypeError::new_err(format!("function cannot be called: give a function of {of}")));
        }
        let name = function.getattr("__name__").and_then(|name| name.extract::<String>());
        let own = Self { function: function.clone().unbind(), raised: Mutex::default() };
        Ok((own, name.unwrap_or_else(|_| "python".into())))
    }

    /// Calls the function with what `arguments` makes and writes the numbers that it returns into `out`. The error is the
    /// exception as text; `raise` gives the exception itself. `what` names the numbers.
    pub fn call<A>(
        &self,
        what: &str,
        arguments: impl FnOnce(Python<'_>) -> PyResult<A>,
        out: &mut [f64],
    ) -> Result<(), String>
    where
        A: for<'py> pyo3::call::PyCallArgs<'py>,
    {
        let done = Python::attach(|py| {
            let found = self.function.bind(py).call1(arguments(py)?)?;
            let numbers = Numbers::read(what, &found)?;
            if numbers.shape() != [out.len()] {
                let (shape, width) = (shown(numbers.shape()), out.len());
                return Err(PyTypeError::new_err(format!("{what} has the shape {shape}: ({width},) is needed")));
            }
            out.copy_from_slice(numbers.slice());
            Ok(())
        });
        done.map_err(|raised: PyErr| {
            let reason = raised.to_string();
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
            reason
        })
    }

    /// Takes the exception that the function has raised last.
    pub fn raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

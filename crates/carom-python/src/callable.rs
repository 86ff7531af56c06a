//! Functions of Python that the crates call: laws and controllers.

use crate::array::{Numbers, shown};
use pyo3::exceptions::PyTypeError;
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
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
    /// exception as text; `raised` gives the exception itself. `what` names the numbers.
    pub fn call<A>(
        &self,
        what: &str,
        arguments: impl FnOnce(Python<'_>) -> PyResult<A>,
        out: &mut [f64],
    ) -> Result<(), String>
    where
        A: for<'py> IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error = PyErr>,
    {
        let write = |py: Python<'_>| {
            let found = call(self.function.bind(py), &arguments(py)?.into_pyobject(py)?)?;
            let numbers = Numbers::read(what, &found)?;
            if numbers.shape() != [out.len()] {
                let (shape, width) = (shown(numbers.shape()), out.len());
                return Err(PyTypeError::new_err(format!("{what} has the shape {shape}: ({width},) is needed")));
            }
            out.copy_from_slice(numbers.slice());
            Ok(())
        };
        let done = Python::try_attach(|py| {
            write(py).map_err(|raised: PyErr| {
                let reason = raised.to_string();
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
                reason
            })
        });
        done.unwrap_or_else(|| Err("the interpreter is shutting down".into()))
    }

    /// The function.
    pub fn function<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.function.bind(py).clone()
    }

    /// Takes the exception that the function has raised last.
    pub fn raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Calls a function of Python.
///
/// When the interpreter ends while a daemon thread is in the function, Python before 3.14 ends the thread by an unwinding that
/// Rust cannot pass on: the process would abort. The thread then stops here instead, as later versions of Python have it, and
/// ends with the process. PyO3 does the same where a thread waits for the GIL.
#[allow(unsafe_code)]
fn call<'py>(function: &Bound<'py, PyAny>, arguments: &Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>> {
    struct Stop;
    impl Drop for Stop {
        fn drop(&mut self) {
            loop {
                std::thread::park();
            }
        }
    }
    // Declared here, as that of PyO3 must not unwind.
    unsafe extern "C-unwind" {
        fn PyObject_CallObject(function: *mut ffi::PyObject, arguments: *mut ffi::PyObject) -> *mut ffi::PyObject;
    }
    let unwound = Stop;
    // SAFETY: both objects live longer than the call, and the thread is attached to the interpreter.
    let result = unsafe { PyObject_CallObject(function.as_ptr(), arguments.as_ptr()) };
    std::mem::forget(unwound);
    // SAFETY: the result is a new reference, or null with an exception set.
    unsafe { Bound::from_owned_ptr_or_err(function.py(), result) }
}

//! Scenes and studies as dicts: their text in TOML.

use crate::array::{Numbers, numpy};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple};
use std::path::PathBuf;
use toml::{Table, Value};

/// The text of a dict in TOML. Values are texts, numbers, booleans, paths, lists, arrays of NumPy and dicts; keys with the value
/// None are left out.
///
/// # Errors
/// `TypeError` that names the key of any other value, `ValueError` for a dict that contains itself.
pub fn toml_text(given: &Bound<'_, PyAny>) -> PyResult<String> {
    let Ok(mapping) = given.cast::<PyMapping>() else {
        return Err(PyTypeError::new_err("this is not a dict: give the keys of the file as a dict"));
    };
    let table = table("", mapping, 0)?;
    toml::to_string(&table).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// Greatest number of dicts and lists in one another; that of the reader of TOML is 80.
const DEEPEST: usize = 64;

fn table(place: &str, given: &Bound<'_, PyMapping>, depth: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for pair in given.items()? {
        let (key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = pair.extract()?;
        let key: String =
            key.extract().map_err(|_| PyTypeError::new_err(format!("{place}: the key {key} is not a string")))?;
        if !value.is_none() {
            let place = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
            table.insert(key, toml_value(&place, &value, depth + 1)?);
        }
    }
    Ok(table)
}

fn toml_value(place: &str, given: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        let message = format!(
            "{place}: more than {DEEPEST} dicts and lists are in one another, and no key needs them: does one contain itself?"
        );
        return Err(PyValueError::new_err(message));
    }
    if given.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(given.extract()?));
    }
    if given.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(given.extract()?));
    }
    if given.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(given.extract()?));
    }
    if given.is_instance_of::<PyString>() {
        return Ok(Value::String(given.extract()?));
    }
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(Value::Table(table(place, dict.as_mapping(), depth)?));
    }
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        let items =
            given.try_iter()?.enumerate().map(|(k, item)| toml_value(&format!("{place}[{k}]"), &item?, depth + 1));
        return Ok(Value::Array(items.collect::<PyResult<_>>()?));
    }
    let py = given.py();
    if given.is_instance(&numpy(py)?.getattr("ndarray")?)? || given.is_instance(&numpy(py)?.getattr("generic")?)? {
        // Lists of Python's own numbers.
        let plain = given.call_method0("tolist")?;
        Numbers::read(place, given)?;
        return toml_value(place, &plain, depth);
    }
    if let Ok(path) = given.extract::<PathBuf>() {
        return Ok(Value::String(path.display().to_string()));
    }
    let kind = given.get_type().name()?;
    Err(PyTypeError::new_err(format!("{place} is {kind}: give a text, number, boolean, path, list, array or dict")))
}

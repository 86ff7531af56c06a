//! Scenes and studies as dicts: their text in TOML.

use crate::array::{Numbers, numpy};
use carom_chain::input::shown;
use carom_sim::path::{entry, place};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString, PyTuple};
use std::collections::BTreeMap;
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
    written(&table("", mapping, 0)?)
}

/// The text of these keys.
///
/// # Errors
/// `ValueError` for what TOML cannot hold.
pub fn written(table: &Table) -> PyResult<String> {
    // A line of its own, for messages about the whole text.
    let text = toml::to_string(table).map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(format!("# from a dict\n{text}"))
}

/// The text of these keys with changes: a dict of values by path (`run.gravity`, `surface[0].contact.restitution`). A dict as value changes the keys
/// that it has, None takes a key out, and any other value replaces what is there.
///
/// # Errors
/// As [`toml_text`]; `ValueError` for a path that leads nowhere.
pub fn changed_text(mut keys: Table, changes: &Bound<'_, PyAny>) -> PyResult<String> {
    let Ok(changes) = changes.cast::<PyMapping>() else {
        return Err(PyTypeError::new_err("changes is not a dict: give values by key, such as {\"run.duration\": 0.5}"));
    };
    for pair in changes.items()? {
        let (path, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = pair.extract()?;
        let path: String =
            path.extract().map_err(|_| PyTypeError::new_err(format!("the key {path} is not a string")))?;
        let (at, part) = place(&mut keys, &path).map_err(PyValueError::new_err)?;
        if value.is_none() {
            if part.ends_with(']') {
                let message =
                    format!("{path}: None takes a key out, and this is an entry of a list: give the list without it");
                return Err(PyValueError::new_err(message));
            }
            at.remove(part);
        } else {
            merge(entry(at, part, &path).map_err(PyValueError::new_err)?, &path, &value)?;
        }
    }
    written(&keys)
}

/// Changes a value to a given one: of tables only the keys that are given.
fn merge(old: &mut Value, place: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let (Value::Table(table), Ok(changes)) = (&mut *old, given.cast::<PyDict>()) else {
        *old = toml_value(place, given, 0)?;
        return Ok(());
    };
    for (key, value) in changes {
        let key: String =
            key.extract().map_err(|_| PyTypeError::new_err(format!("{place}: the key {key} is not a string")))?;
        if value.is_none() {
            table.remove(&key);
        } else {
            let place = format!("{place}.{key}");
            merge(table.entry(key).or_insert_with(|| Table::new().into()), &place, &value)?;
        }
    }
    Ok(())
}

/// A message about this text, which begins with a line of it, with the key in that line instead: the user has given a dict.
pub fn by_keys(message: &str, text: &str) -> String {
    let found = message.strip_prefix("line ").and_then(|rest| {
        let digits = rest.find(|c: char| !c.is_ascii_digit())?;
        let number: usize = rest[..digits].parse().ok()?;
        let line = text.lines().nth(number.checked_sub(1)?).unwrap_or("").trim();
        let quoted = format!(", {}: ", shown(line));
        let rule = rest[digits..].strip_prefix(quoted.as_str()).or_else(|| rest[digits..].strip_prefix(": "))?;
        Some((number, rule))
    });
    let Some((number, rule)) = found else { return message.to_owned() };
    // How many tables of each array of tables there are up to the line, and the table that the line is in.
    let (mut counts, mut place) = (BTreeMap::<String, usize>::new(), String::new());
    let mut key = None;
    for line in text.lines().take(number) {
        let Some(header) = line.strip_prefix('[') else {
            key = line.split_once(" = ").map(|(key, _)| key);
            continue;
        };
        let path = header.trim_end_matches(']').trim_start_matches('[');
        if line.starts_with("[[") {
            *counts.entry(path.to_owned()).or_default() += 1;
            counts.retain(|other, _| !other.starts_with(&format!("{path}.")));
        }
        (key, place) = (None, String::new());
        let mut prefix = String::new();
        for part in path.split('.') {
            let dot = if prefix.is_empty() { "" } else { "." };
            prefix = format!("{prefix}{dot}{part}");
            let count = counts.get(&prefix).map_or_else(String::new, |count| format!("[{}]", count - 1));
            place = format!("{place}{dot}{part}{count}");
        }
    }
    let place: Vec<&str> = [place.as_str(), key.unwrap_or("")].into_iter().filter(|part| !part.is_empty()).collect();
    if place.is_empty() { rule.to_owned() } else { format!("{}: {rule}", place.join(".")) }
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
        let beyond = |_| {
            PyValueError::new_err(format!("{place} is {given}: whole numbers go from {} to {}", i64::MIN, i64::MAX))
        };
        return given.extract().map(Value::Integer).map_err(beyond);
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

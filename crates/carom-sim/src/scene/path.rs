//! Paths of keys in files: `run.gravity`, `surface[0].contact.restitution`, `run.gravity[2]`.

use toml::{Table, Value};

/// Adds to the number at a path; returns its size before: of zero the largest of its list, or 1.
///
/// # Errors
/// A path that leads nowhere, and a value that is no number.
pub fn add(keys: &mut Table, path: &str, change: f64) -> Result<f64, String> {
    replace(keys, path, |own| own + change)
}

/// The number at a path.
///
/// # Errors
/// As [`add`].
pub fn get(keys: &mut Table, path: &str) -> Result<f64, String> {
    let mut found = 0.0;
    replace(keys, path, |own| {
        found = own;
        own
    })?;
    Ok(found)
}

/// Sets the number at a path.
///
/// # Errors
/// As [`add`].
pub fn set(keys: &mut Table, path: &str, number: f64) -> Result<(), String> {
    replace(keys, path, |_| number).map(drop)
}

fn replace(keys: &mut Table, path: &str, by: impl FnOnce(f64) -> f64) -> Result<f64, String> {
    let size = |value: &Value| number(value).map_or(0.0, f64::abs);
    let (at, part) = place(keys, path)?;
    let list = part.split_once('[').and_then(|(list, _)| at.get(list)?.as_array());
    let largest = list.map_or(0.0, |list| list.iter().map(size).fold(0.0, f64::max));
    let value = entry(at, part, path)?;
    let Some(own) = number(value) else {
        let why = "the scene has no number there: give it one, so that it can be changed; lists have entries like run.gravity[2]";
        return Err(format!("{path}: {why}"));
    };
    *value = Value::Float(by(own));
    let sizes = [own.abs(), largest, 1.0];
    Ok(sizes.into_iter().find(|size| *size > 0.0).unwrap_or(1.0))
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

/// The table that holds the last part of a path, and that part.
///
/// # Errors
/// A path that leads nowhere.
pub fn place<'t, 'p>(keys: &'t mut Table, path: &'p str) -> Result<(&'t mut Table, &'p str), String> {
    let (before, last) = path.rsplit_once('.').map_or((None, path), |(before, last)| (Some(before), last));
    let mut at = keys;
    for part in before.into_iter().flat_map(|before| before.split('.')) {
        at = table_in(entry(at, part, path)?, part, path)?;
    }
    Ok((at, last))
}

/// The value of a part of a path, `NAME`, `NAME[K]` or `NAME[K][L]`; an empty table where there is none.
///
/// # Errors
/// A list that has no such entry, or is none.
pub fn entry<'t>(table: &'t mut Table, part: &str, path: &str) -> Result<&'t mut Value, String> {
    let Some((name, indices)) = part.strip_suffix(']').and_then(|part| part.split_once('[')) else {
        return Ok(table.entry(part).or_insert_with(|| Table::new().into()));
    };
    let refuse = |why: String| format!("{path}: {why}");
    let whole = table.get_mut(name).ok_or_else(|| refuse(format!("there is no {name}: give the whole list")))?;
    let mut list = name.to_owned();
    indices.split("][").try_fold(whole, |value, index| {
        let Value::Array(all) = value else { return Err(refuse(format!("{list} is no list: leave out [{index}]"))) };
        let count = all.len();
        let one = index.parse().ok().and_then(|k: usize| all.get_mut(k));
        let one = one.ok_or_else(|| refuse(format!("{list} has {count} entries, which count from 0")))?;
        list = format!("{list}[{index}]");
        Ok(one)
    })
}

fn table_in<'t>(value: &'t mut Value, part: &str, path: &str) -> Result<&'t mut Table, String> {
    let kind = value.type_str();
    let count = value.as_array().map(Vec::len);
    value.as_table_mut().ok_or_else(|| {
        let why = match count {
            Some(count) => format!("{part} is a list of {count}: write {part}[0]"),
            None => format!("{part} is a {kind}, which has no keys"),
        };
        format!("{path}: {why}")
    })
}

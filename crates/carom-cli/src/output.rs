//! What goes out: JSON lines, or tables for people.

use crate::error::LineError;
use crate::input::Refused;
use serde::Serialize;
use std::io::Write;

/// One line of JSON. A number that is not finite has no JSON: the states were too large for `f64`.
pub fn json_line(out: &mut dyn Write, answer: &impl Serialize) -> Result<(), Refused> {
    let text = serde_json::to_string(answer).map_err(|e| LineError(e.to_string()))?;
    writeln!(out, "{text}").map_err(Refused::Output)
}

/// Refuses answers that overflowed.
pub fn finite<'a>(what: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Result<(), LineError> {
    match numbers.into_iter().find(|x| !x.is_finite()) {
        Some(x) => Err(LineError(format!("{what} comes out as {x}: the numbers of this line are too large for f64"))),
        None => Ok(()),
    }
}

/// A vector for people.
pub fn row(numbers: &[f64]) -> String {
    let cells: Vec<String> = numbers.iter().map(|x| format!("{:>13}", short(*x))).collect();
    cells.join(" ")
}

/// Seven digits, plain where that is readable.
pub fn short(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 {
        "0".into()
    } else if (1e-4..1e6).contains(&size) {
        format!("{x:.7}")
    } else {
        format!("{x:.6e}")
    }
}

//! Titles, axes and their numbers.

use super::super::Axis;
use crate::drawing::Area;
use plotters::prelude::*;

pub(super) fn name_of(axis: &Axis) -> String {
    if axis.unit.is_empty() || axis.name.ends_with("_deg") {
        axis.name.clone()
    } else {
        format!("{}, {}", axis.name, axis.unit)
    }
}

pub(super) fn ends(axis: &Axis) -> (f64, f64) {
    (axis.value(0), axis.value(axis.count() - 1))
}

pub(super) const TEXT: (&str, u32) = ("sans-serif", 14);
/// Height of the title.
pub(super) const HEAD: u32 = 26;

/// A drawing below its title.
pub(super) fn titled<'s>(root: &Area<'s>, title: &str) -> Result<Area<'s>, Box<dyn std::error::Error>> {
    let (head, rest) = root.split_vertically(HEAD);
    head.draw(&Text::new(title.to_owned(), (16, 10), TEXT)).map_err(|e| e.to_string())?;
    Ok(rest)
}

/// A number with enough digits to distinguish the ticks of an axis of length `span`.
pub(super) fn tick(x: f64, span: f64) -> String {
    let digits = (1.0 - span.abs().max(1e-300).log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{x:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

/// The numbers 1, 2 and 5 times a power of ten from `low` to `high`; of more than seven the powers of ten, of more than fourteen of these
/// every other, and so on.
pub(super) fn round_powers(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let between = |x: &f64| (low..=high).contains(x);
    let all: Vec<f64> =
        (first..=last).flat_map(|k| [1.0, 2.0, 5.0].map(|x| x * 10f64.powi(k))).filter(between).collect();
    let apart = ((last - first) / 7 + 1) as usize;
    if all.len() <= 7 { all } else { (first..=last).step_by(apart).map(|k| 10f64.powi(k)).filter(between).collect() }
}

/// A number in three digits.
pub(super) fn brief(x: f64) -> String {
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    if (1e-3..1e5).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

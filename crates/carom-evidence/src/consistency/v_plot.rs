//! Plot of the measurements over cot α with the best V-shaped function.

use super::range::Pose;
use super::{Findings, Point};
use crate::EvidenceError;
use crate::line_chart::{COLOURS, Curve, svg};

/// cot 0.0057°: with larger values the other angles would coincide in the plot.
const FAR: f64 = 1e4;

/// Plots Y over cot α for the rows, as SVG. Dots are the printed values, bars their rounding intervals, and the line of each
/// row is the function |cot α − h|/√D that needs the least rounding, dashed if it exceeds the rounding.
///
/// # Errors
/// A message if an angle is too close to 0° or 180°, if no measurement has E ≥ e, or if the plot cannot be drawn.
pub fn v_plot(rows: &[Findings]) -> Result<String, EvidenceError> {
    let points = || rows.iter().flat_map(|found| &found.points);
    let cots = || points().map(|p| p.entry.cot);
    for found in rows {
        if let Some(far) = found.points.iter().find(|point| point.entry.cot.abs() > FAR) {
            return Err(EvidenceError::new(format!(
                "row '{}': cot α = {:.1e} is too large for a plot: leave out angles within 0.01° of 0° and 180°",
                found.row, far.entry.cot
            )));
        }
    }
    if points().filter_map(height).next().is_none() {
        return Err(EvidenceError::new(
            "no measurement has E above e, so there is no Y to plot: leave out the picture",
        ));
    }
    let top = 1.3 * points().filter_map(height).fold(0.0, f64::max).max(0.1);
    let (left, right) = (cots().fold(0.0, f64::min), cots().fold(0.0, f64::max));
    let room = 0.15 * (right - left).max(1.0);
    let mut curves = Vec::new();
    for (k, found) in rows.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let mut measured = Curve::new(found.row.clone(), colour);
        for point in &found.points {
            measured.dots.extend(point.y.map(|y| (point.entry.cot, y)));
            measured.bars.extend(point.range.map(|y| (point.entry.cot, y.least, y.most.min(top))));
        }
        curves.push(measured);
        let Some(Pose { h, d }) = found.fit.at else { continue };
        let name = if found.consistent { "fit within rounding" } else { "best fit" };
        let mut v = Curve { dashed: !found.consistent, ..Curve::new(format!("{}: {name}", found.row), colour) };
        // extend the plot to the minimum at h if it is not far away
        let reach = |x: f64| (left - 1.5 * (right - left)..right + 1.5 * (right - left)).contains(&x);
        let (from, to) = if reach(h) { (left.min(h) - room, right.max(h) + room) } else { (left - room, right + room) };
        let mut ends = vec![from, to];
        if (from..to).contains(&h) {
            ends.insert(1, h);
        }
        v.line = ends.into_iter().map(|c| (c, (c - h).abs() / d.sqrt())).collect();
        curves.push(v);
    }
    svg("Consistency of energies: Y = |cot α − h| / √D", ["cot α", "Y = √((1 − e²)/(1 − E²) − 1)"], &curves)
        .map_err(EvidenceError::new)
}

/// Greatest finite Y of a point.
fn height(point: &Point) -> Option<f64> {
    let most = point.range.map(|y| y.most).filter(|y| y.is_finite());
    most.or(point.y).or(point.range.map(|y| y.least))
}

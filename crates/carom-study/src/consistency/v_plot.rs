//! Measurements over cot α, and the V that comes nearest to them.

use super::{Findings, MeasuredRow, Point};
use crate::line_chart::{COLOURS, Curve, svg};

/// cot 0.0057°: beyond it the other angles would fall onto one another.
const FAR: f64 = 1e4;

/// The rows over cot α as SVG: dots are the printed digits, bars what rounds to them, and the V of each row is the one that
/// needs the least rounding: dashed where even that one needs more than was printed.
///
/// # Errors
/// An angle too near to 0 or 180° for a picture, or what the drawing says.
pub fn v_plot(rows: &[(MeasuredRow, Findings)]) -> Result<String, String> {
    let points = || rows.iter().flat_map(|(_, found)| &found.points);
    let cots = || points().map(|p| p.cot);
    for (row, found) in rows {
        if let Some(far) = found.points.iter().find(|point| point.cot.abs() > FAR) {
            return Err(format!(
                "row '{}': no picture holds cot α = {:.1e}: leave angles within 0.01° of 0 and 180 out of it",
                row.name, far.cot
            ));
        }
    }
    if points().filter_map(height).next().is_none() {
        return Err("no entry has an E above its e: there is no Y to draw, leave the picture out".to_owned());
    }
    let top = 1.3 * points().filter_map(height).fold(0.0, f64::max).max(0.1);
    let (left, right) = (cots().fold(0.0, f64::min), cots().fold(0.0, f64::max));
    let room = 0.15 * (right - left).max(1.0);
    let mut curves = Vec::new();
    for (k, (row, found)) in rows.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let mut measured = Curve::new(row.name.clone(), colour);
        for point in &found.points {
            measured.dots.extend(point.y.map(|y| (point.cot, y)));
            measured.bars.extend(point.range.map(|y| (point.cot, y.least, y.most.min(top))));
        }
        curves.push(measured);
        let Some((h, d)) = found.fit.h_and_d else { continue };
        let name = if found.consistent() { "a V within its rounding" } else { "the nearest V" };
        let mut v = Curve { dashed: !found.consistent(), ..Curve::new(format!("{}: {name}", row.name), colour) };
        // the foot belongs to the picture if it is not far off
        let reach = |x: f64| (left - 1.5 * (right - left)..right + 1.5 * (right - left)).contains(&x);
        let (from, to) = if reach(h) { (left.min(h) - room, right.max(h) + room) } else { (left - room, right + room) };
        let mut ends = vec![from, to];
        if (from..to).contains(&h) {
            ends.insert(1, h);
        }
        v.line = ends.into_iter().map(|c| (c, (c - h).abs() / d.sqrt())).collect();
        curves.push(v);
    }
    svg("Energies over angles: Y = |cot α − h| / √D", ["cot α", "Y = √((1 − e²)/(1 − E²) − 1)"], &curves)
}

/// What of a point is to be seen.
fn height(point: &Point) -> Option<f64> {
    let most = point.range.map(|y| y.most).filter(|y| y.is_finite());
    most.or(point.y).or(point.range.map(|y| y.least))
}

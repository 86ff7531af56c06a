//! Picture of a data set: the mean error of each law, with its standard error, the bound and the floor.

use super::comparison::Comparison;
use super::page::{name, short};
use crate::EvidenceError;
use crate::line_chart::{COLOURS, GREY};
use carom_study::drawing::{Area, Drawn, picture, round_step};
use plotters::prelude::*;

const WIDTH: u32 = 920;
/// Least left end of the scale, width of a letter, and right end of the scale from the right edge, pixels.
const MARGIN: (i32, i32, i32) = (200, 7, 40);
const ROW: i32 = 22;
/// Height of a panel without its rows.
const HEAD: i32 = 96;

/// One panel for each comparison of a data set, below one another.
///
/// # Errors
/// [`EvidenceError`]: it cannot be drawn.
pub fn svg(comparisons: &[Comparison]) -> Result<String, EvidenceError> {
    let set = comparisons.first().map_or_else(String::new, |one| one.set.clone());
    let refuse = |e| EvidenceError::new(format!("the picture of {set} cannot be drawn: {e}"));
    let total: i32 = comparisons.iter().map(height).sum();
    picture((WIDTH, total.max(1) as u32), |root| draw(root, comparisons)).map_err(refuse)
}

fn height(one: &Comparison) -> i32 {
    HEAD + ROW * one.rows.len() as i32
}

fn draw(root: &Area, comparisons: &[Comparison]) -> Drawn {
    let mut top = 0;
    for one in comparisons {
        panel(root, one, top)?;
        top += height(one);
    }
    Ok(())
}

fn panel(root: &Area, one: &Comparison, top: i32) -> Drawn {
    let limits = [("best impulse at the point", one.bound), ("floor: noise of the start", one.floor)];
    let bars: Vec<(f64, f64)> =
        one.rows.iter().map(|row| (row.error.estimate.mean, row.error.estimate.standard_error)).collect();
    // a law far from the best would compress the scale: its value stands at the right end
    let far = 3.0 * bars.first().map_or(0.0, |best| best.0);
    let shown = bars.iter().filter(|(mean, _)| *mean <= far);
    let ends = shown.flat_map(|(mean, error)| [mean - error, mean + error]);
    let limited = limits.iter().filter_map(|(_, it)| Some(it.as_ref()?.estimate.mean));
    let (low, high) = ends.chain(limited).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
    let room = 0.05 * (high - low).max(1e-9);
    let (low, high) = ((low - room).max(0.0), high + room);
    let longest = one.rows.iter().map(|row| name(row).chars().count()).max().unwrap_or(0) as i32;
    let left = (20 + MARGIN.1 * longest).clamp(MARGIN.0, WIDTH as i32 / 2);
    let wide = WIDTH as i32 - left - MARGIN.2;
    let at = |x: f64| left + ((x - low) / (high - low) * f64::from(wide)).round() as i32;
    let (first, text) = (top + 44, ("sans-serif", 14));
    let bottom = first + ROW * bars.len() as i32;
    let title = format!("{}: {}", one.set, one.what);
    root.draw(&Text::new(title, (12, top + 12), ("sans-serif", 17)))?;
    for (x, label) in ticks(low, high) {
        root.draw(&PathElement::new([(at(x), first - 4), (at(x), bottom)], RGBColor(225, 225, 225).stroke_width(1)))?;
        root.draw(&Text::new(label.clone(), (at(x) - 4 * label.len() as i32, bottom + 4), text))?;
    }
    for (name, spread) in limits {
        let Some(spread) = spread else { continue };
        let x = at(spread.estimate.mean);
        let dashes = (first - 4..bottom).step_by(10);
        for y in dashes {
            root.draw(&PathElement::new([(x, y), (x, (y + 6).min(bottom))], GREY.stroke_width(2)))?;
        }
        root.draw(&Text::new(name, (x + 4, first - 18), ("sans-serif", 13)))?;
    }
    for (k, (row, (mean, error))) in one.rows.iter().zip(bars).enumerate() {
        let y = first + ROW * k as i32 + ROW / 2;
        // laws that are not distinguished from the best are drawn in its colour
        let level = row.to_best.mean <= 2.0 * row.to_best.standard_error;
        let colour = if level { COLOURS[0] } else { COLOURS[1] };
        root.draw(&Text::new(name(row), (12, y - 8), text))?;
        if mean > far {
            let value = format!("{} →", short(mean));
            root.draw(&Text::new(value, (WIDTH as i32 - MARGIN.2 - 60, y - 8), text.into_font().color(&colour)))?;
            continue;
        }
        root.draw(&PathElement::new([(at(mean - error), y), (at(mean + error), y)], colour.stroke_width(2)))?;
        root.draw(&Circle::new((at(mean), y), 4, colour.filled()))?;
    }
    let measure = format!("{}; mean ± standard error, blue: within two of the best", one.measure);
    root.draw(&Text::new(measure, (12, bottom + 24), ("sans-serif", 13)))?;
    Ok(())
}

/// Round values in a range, with their labels.
fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let step = round_step((high - low) / 6.0);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step).ceil() as i64;
    (first..)
        .map(|k| k as f64 * step)
        .take_while(|x| *x <= high)
        .take(20)
        .map(|x| (x, format!("{x:.digits$}")))
        .collect()
}

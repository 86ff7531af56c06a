//! Line charts as SVG, with the legend beside the plot.

use carom_study::drawing::{Area, Drawn, picture};
use plotters::prelude::*;

/// Colours of the two elbows, and of further rows.
pub(crate) const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 120, 180),
    RGBColor(227, 26, 28),
    RGBColor(51, 160, 44),
    RGBColor(106, 61, 154),
    RGBColor(255, 127, 0),
    RGBColor(177, 89, 40),
];
/// Paler versions of the first two [`COLOURS`].
pub(crate) const PALE: [RGBColor; 2] = [RGBColor(106, 176, 222), RGBColor(240, 130, 110)];
pub(crate) const GREY: RGBColor = RGBColor(120, 120, 120);

/// One curve of a chart.
pub(crate) struct Curve {
    /// Name in the legend; empty for no entry.
    pub name: String,
    pub colour: RGBColor,
    pub line: Vec<(f64, f64)>,
    pub dashed: bool,
    pub dots: Vec<(f64, f64)>,
    /// Vertical bars: x, lower end, upper end.
    pub bars: Vec<(f64, f64, f64)>,
}

impl Curve {
    pub fn new(name: impl Into<String>, colour: RGBColor) -> Self {
        Self { name: name.into(), colour, line: Vec::new(), dashed: false, dots: Vec::new(), bars: Vec::new() }
    }
}

const SIZE: (u32, u32) = (900, 460);
const LEGEND: i32 = 250;

/// Draws a chart as SVG.
pub(crate) fn svg(title: &str, axes: [&str; 2], curves: &[Curve]) -> Result<String, String> {
    let drawn = picture(SIZE, |root| draw(root, title, axes, curves));
    drawn.map_err(|e| format!("'{title}' cannot be drawn: {e}"))
}

fn draw(root: &Area, title: &str, axes: [&str; 2], curves: &[Curve]) -> Drawn {
    let points = || {
        let bars = |curve: &Curve| curve.bars.iter().flat_map(|b| [(b.0, b.1), (b.0, b.2)]).collect::<Vec<_>>();
        curves.iter().flat_map(move |curve| [curve.line.clone(), curve.dots.clone(), bars(curve)].concat())
    };
    let range = |of: fn((f64, f64)) -> f64| {
        let (low, high) = points().map(of).fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let room = 0.06 * (high - low).max(1e-9);
        low - room..high + room
    };
    if points().any(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return Err("the coordinates of a point are not finite".into());
    }
    let (left, right) = root.split_horizontally(SIZE.0 as i32 - LEGEND);
    let mut chart = ChartBuilder::on(&left)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
    let labels = ("sans-serif", 14);
    let tick = |x: &f64| {
        let text = format!("{x:.4}");
        let short = text.trim_end_matches('0').trim_end_matches('.');
        if short == "-0" { "0".into() } else { short.to_owned() }
    };
    let mut mesh = chart.configure_mesh();
    let mesh = mesh.x_label_formatter(&tick).y_label_formatter(&tick).label_style(labels);
    mesh.light_line_style(WHITE).x_desc(axes[0]).y_desc(axes[1]).draw()?;
    for curve in curves {
        let (thick, thin) = (curve.colour.stroke_width(2), curve.colour.stroke_width(1));
        if curve.dashed {
            chart.draw_series(DashedLineSeries::new(curve.line.iter().copied(), 6, 4, thick))?;
        } else {
            chart.draw_series(LineSeries::new(curve.line.iter().copied(), thick))?;
        }
        chart.draw_series(curve.bars.iter().map(|bar| PathElement::new([(bar.0, bar.1), (bar.0, bar.2)], thin)))?;
        // smaller dots on bars
        let radius = if curve.bars.is_empty() { 3 } else { 2 };
        chart.draw_series(curve.dots.iter().map(|&dot| Circle::new(dot, radius, curve.colour.filled())))?;
    }
    legend(&right, curves)
}

/// Draws the legend: each name with its line, its dot or both.
fn legend(area: &Area, curves: &[Curve]) -> Drawn {
    for (k, curve) in curves.iter().filter(|curve| !curve.name.is_empty()).enumerate() {
        let (y, style) = (56 + 24 * k as i32, curve.colour.stroke_width(2));
        for piece in if curve.dashed { vec![(0, 8), (13, 21)] } else { vec![(0, 21)] } {
            if !curve.line.is_empty() {
                area.draw(&PathElement::new([(piece.0, y), (piece.1, y)], style))?;
            }
        }
        if !curve.dots.is_empty() {
            area.draw(&Circle::new((10, y), 3, curve.colour.filled()))?;
        }
        area.draw(&Text::new(curve.name.clone(), (30, y - 7), ("sans-serif", 14)))?;
    }
    Ok(())
}

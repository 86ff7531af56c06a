//! Draws a planar diagram as SVG.

use super::{Diagram, Shape, Stroke, Symbol};
use crate::drawing::{Area, Drawn, picture, rgb};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Units of the drawing per pixel: plotters draws at integer coordinates, which would make curves uneven.
const FINE: i32 = 8;
/// Width and height of the picture, its margin, and the room for numbers and names beside the plot, in pixels.
const SIZE: (i32, i32) = (820, 600);
const MARGIN: i32 = 12;
const NUMBERS: (i32, i32) = (64, 44);
/// Width of the legend to the right of the plot, and greatest height of a line of it, in pixels.
const LEGEND: (i32, i32) = (208, 22);
/// Radius of a law's point in pixels, and its increase for each point drawn over it, so that it is visible as a ring.
const DOT: f64 = 4.5;
const RING: f64 = 1.6;
/// Opacity of areas.
const AREA: f64 = 0.5;

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

impl Diagram<2> {
    /// Draws the diagram as SVG; `None` if the window is empty or not finite.
    pub fn svg(&self) -> Option<String> {
        if self.window.iter().any(|[low, high]| !(high > low && (high - low).is_finite())) {
            return None;
        }
        let size = ((SIZE.0 * FINE) as u32, (SIZE.1 * FINE) as u32);
        let svg = picture(size, |root| self.draw(root)).ok()?;
        // the view box keeps the units of the drawing
        let fine = format!("width=\"{}\" height=\"{}\"", SIZE.0 * FINE, SIZE.1 * FINE);
        Some(svg.replacen(&fine, &format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1), 1))
    }

    fn draw(&self, root: &Area) -> Drawn {
        let page = root.margin(6 * FINE, 0, 0, 0).titled(&self.title, ("sans-serif", 20 * FINE))?;
        let [across, up] = self.window;
        // the frame is the window, at which lines are clipped; the legend is outside
        let (right, above, below) = self.margins(page.dim_in_pixel());
        let mut chart = ChartBuilder::on(&page)
            .margin_left(MARGIN * FINE)
            .margin_right(right)
            .margin_top(above)
            .margin_bottom(below)
            .x_label_area_size(NUMBERS.1 * FINE)
            .y_label_area_size(NUMBERS.0 * FINE)
            .build_cartesian_2d(across[0]..across[1], up[0]..up[1])?;
        let labels = ("sans-serif", 14 * FINE);
        let line = |colour: RGBColor, width: i32| colour.stroke_width((width * FINE) as u32);
        let [x, y] = &self.axes;
        let [x_number, y_number] = [across, up].map(|[low, high]| move |x: &f64| number(*x, high - low));
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(line(RGBColor(225, 225, 225), 1))
            .axis_style(line(BLACK, 1))
            .set_all_tick_mark_size(5 * FINE)
            .x_label_formatter(&x_number)
            .y_label_formatter(&y_number)
            .x_desc(x)
            .y_desc(y)
            .label_style(labels)
            .draw()?;
        for shape in &self.shapes {
            draw_shape(&mut chart, shape)?;
        }
        let near = 0.005 * (across[1] - across[0]).max(up[1] - up[0]);
        for (k, mark) in self.marks.iter().enumerate() {
            let over = self.marks[k + 1..].iter().filter(|over| {
                let [x, y] = [0, 1].map(|j| (over.at[j] - mark.at[j]).abs());
                over.symbol == Symbol::Law && x.max(y) < near
            });
            let radius = DOT + RING * over.count() as f64;
            let (at, colour) = ((mark.at[0], mark.at[1]), rgb(mark.colour));
            let (full, hollow) = (colour.filled(), line(colour, 2));
            let size = 5 * FINE;
            match mark.symbol {
                Symbol::Law => chart.draw_series([Circle::new(at, (radius * f64::from(FINE)) as i32, full)])?,
                Symbol::Start => chart.draw_series([Circle::new(at, 6 * FINE, hollow)])?,
                Symbol::Turn => chart.draw_series([Cross::new(at, size, hollow)])?,
                Symbol::Stop => chart.draw_series([TriangleMarker::new(at, size, full)])?,
            };
        }
        let (x, y) = chart.plotting_area().get_pixel_range();
        // pixels are counted from below the title
        let (left, top) = page.get_base_pixel();
        let ([x0, x1], [y0, y1]) = ([x.start - left, x.end - left], [y.start - top, y.end - top]);
        let round = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)];
        page.draw(&PathElement::new(round, line(BLACK, 1)))?;
        self.legend(&page, (x1, y0), y1 - y0)?;
        Ok(())
    }

    /// Margins to the right of, above and below the plot, for a frame that is exactly the window.
    fn margins(&self, (width, height): (u32, u32)) -> (i32, i32, i32) {
        let margin = MARGIN * FINE;
        if !self.equal_scales {
            return (margin + LEGEND.0 * FINE, margin, margin);
        }
        let width = f64::from(width) - f64::from(FINE * (2 * MARGIN + NUMBERS.0 + LEGEND.0));
        let height = f64::from(height) - f64::from(FINE * (2 * MARGIN + NUMBERS.1));
        let [across, up] = self.window.map(|[low, high]| high - low);
        let unit = (across / width).max(up / height);
        // a plot has at least the width of a pixel
        let spare = |room: f64, length: f64| (room - (length / unit).max(f64::from(FINE))).floor() as i32;
        let (beside, above) = (spare(width, across), spare(height, up));
        (margin + LEGEND.0 * FINE + beside, margin + above / 2, margin + above - above / 2)
    }

    /// Draws the legend, downwards from the upper right corner of the frame.
    fn legend(&self, page: &Area, (right, top): (i32, i32), height: i32) -> Drawn {
        let lines = self.shapes.len() + self.marks.len();
        let pitch = (LEGEND.1 * FINE).min(height.max((SIZE.1 / 2) * FINE) / lines.max(1) as i32);
        let text = ("sans-serif", 14 * FINE).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        let (left, swatch, size) = (right + 14 * FINE, 9 * FINE, 5 * FINE);
        let place = |k: usize| (left, top + pitch / 2 + pitch * k as i32);
        for (k, shape) in self.shapes.iter().enumerate() {
            let (x, y) = place(k);
            let colour = rgb(shape.colour);
            let end = x + 2 * swatch;
            match shape.stroke {
                Stroke::Area => {
                    page.draw(&Rectangle::new([(x, y - size), (end, y + size)], colour.mix(AREA).filled()))?;
                }
                _ => page.draw(&PathElement::new([(x, y), (end, y)], stroke(shape)))?,
            }
            page.draw(&Text::new(shape.name.clone(), (x + 26 * FINE, y), text.clone()))?;
        }
        for (k, mark) in self.marks.iter().enumerate() {
            let (x, y) = place(self.shapes.len() + k);
            let (at, full) = ((x + swatch, y), rgb(mark.colour).filled());
            let hollow = rgb(mark.colour).stroke_width(2 * FINE as u32);
            match mark.symbol {
                Symbol::Law => page.draw(&Circle::new(at, size, full))?,
                Symbol::Start => page.draw(&Circle::new(at, size, hollow))?,
                Symbol::Turn => page.draw(&Cross::new(at, size, hollow))?,
                Symbol::Stop => page.draw(&TriangleMarker::new(at, size, full))?,
            }
            page.draw(&Text::new(mark.name.clone(), (x + 26 * FINE, y), text.clone()))?;
        }
        Ok(())
    }
}

fn draw_shape(chart: &mut Chart, shape: &Shape<2>) -> Drawn {
    let pieces = shape.pieces.iter().map(|piece| piece.iter().map(|p| (p[0], p[1])).collect::<Vec<_>>());
    if shape.stroke == Stroke::Area {
        chart.draw_series(pieces.map(|piece| Polygon::new(piece, rgb(shape.colour).mix(AREA))))?;
    } else {
        chart.draw_series(pieces.map(|piece| PathElement::new(piece, stroke(shape))))?;
    }
    Ok(())
}

/// Style of a line.
fn stroke(shape: &Shape<2>) -> ShapeStyle {
    rgb(shape.colour).stroke_width((FINE * if shape.stroke == Stroke::Thick { 3 } else { 1 }) as u32)
}

/// Label of a number on an axis: shortest digits, exactly 0 for rounding errors.
fn number(x: f64, size: f64) -> String {
    if x.abs() < 1e-9 * size {
        return "0".into();
    }
    let digits = format!("{x:.4e}");
    match digits.parse::<f64>() {
        Ok(short) if (1e-4..1e5).contains(&short.abs()) => short.to_string(),
        Ok(short) => format!("{short:e}"),
        Err(_) => digits,
    }
}

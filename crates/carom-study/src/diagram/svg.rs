//! A diagram as SVG; plotters stops here.

use super::{Diagram, Shape, Stroke, Symbol};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// plotters draws in whole units: so many of them make a pixel, that curves come out smooth.
const FINE: i32 = 8;
/// Width and height of the picture, and what the plot leaves for numbers and names, in pixels.
const SIZE: (i32, i32) = (820, 600);
const MARGIN: i32 = 12;
const NUMBERS: (i32, i32) = (64, 44);
/// Share of the plot's width that the legend takes.
const LEGEND: f64 = 0.27;
/// Radius of a law's point in pixels, and what it is more for each one drawn over it, that it shows as a ring.
const DOT: f64 = 4.5;
const RING: f64 = 1.6;

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

impl Diagram<2> {
    /// The picture; `None` if the window is empty or not finite.
    pub fn svg(&self) -> Option<String> {
        if self.window.iter().any(|[low, high]| !(high > low && (high - low).is_finite())) {
            return None;
        }
        let mut svg = String::new();
        self.draw(&mut svg).ok()?;
        // The view box stays as fine as it was drawn.
        let fine = format!("width=\"{}\" height=\"{}\"", SIZE.0 * FINE, SIZE.1 * FINE);
        Some(svg.replacen(&fine, &format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1), 1))
    }

    fn draw(&self, svg: &mut String) -> Drawn {
        let size = [SIZE.0, SIZE.1].map(|x| (x * FINE) as u32);
        let root = SVGBackend::with_string(svg, (size[0], size[1])).into_drawing_area();
        root.fill(&WHITE)?;
        let page = root.margin(6 * FINE, 0, 0, 0).titled(&self.title, ("sans-serif", 20 * FINE))?;
        let [across, up] = self.frame(page.dim_in_pixel());
        let mut chart = ChartBuilder::on(&page)
            .margin(MARGIN * FINE)
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
            let swatch = 9 * FINE;
            let size = 5 * FINE;
            match mark.symbol {
                Symbol::Law => chart
                    .draw_series([Circle::new(at, (radius * f64::from(FINE)) as i32, full)])?
                    .label(&mark.name)
                    .legend(move |(x, y)| Circle::new((x + swatch, y), size, full)),
                Symbol::Start => chart
                    .draw_series([Circle::new(at, 6 * FINE, hollow)])?
                    .label(&mark.name)
                    .legend(move |(x, y)| Circle::new((x + swatch, y), size, hollow)),
                Symbol::Turn => chart
                    .draw_series([Cross::new(at, size, hollow)])?
                    .label(&mark.name)
                    .legend(move |(x, y)| Cross::new((x + swatch, y), size, hollow)),
                Symbol::Stop => chart
                    .draw_series([TriangleMarker::new(at, size, full)])?
                    .label(&mark.name)
                    .legend(move |(x, y)| TriangleMarker::new((x + swatch, y), size, full)),
            };
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE)
            .margin(4 * FINE)
            .legend_area_size(26 * FINE)
            .label_font(labels)
            .draw()?;
        root.present()?;
        Ok(())
    }

    /// The window with room for the legend on its right, and in equal scales if they are asked.
    fn frame(&self, (width, height): (u32, u32)) -> [[f64; 2]; 2] {
        let [[left, right], [low, high]] = self.window;
        if !self.equal_scales {
            return [[left, right + LEGEND / (1.0 - LEGEND) * (right - left)], [low, high]];
        }
        let width = f64::from(width) - f64::from(FINE * (2 * MARGIN + NUMBERS.0));
        let height = f64::from(height) - f64::from(FINE * (2 * MARGIN + NUMBERS.1));
        let unit = ((right - left) / ((1.0 - LEGEND) * width)).max((high - low) / height);
        // What is left over goes to the legend, and above and below.
        let spare = (height * unit - (high - low)) / 2.0;
        [[left, left + width * unit], [low - spare, high + spare]]
    }
}

fn draw_shape(chart: &mut Chart, shape: &Shape<2>) -> Drawn {
    let pieces = shape.pieces.iter().map(|piece| piece.iter().map(|p| (p[0], p[1])).collect::<Vec<_>>());
    let colour = rgb(shape.colour);
    if shape.stroke == Stroke::Area {
        let pale = colour.mix(0.5);
        let swatch = move |(x, y)| Rectangle::new([(x, y - 5 * FINE), (x + 18 * FINE, y + 5 * FINE)], pale.filled());
        chart.draw_series(pieces.map(|piece| Polygon::new(piece, pale)))?.label(&shape.name).legend(swatch);
        return Ok(());
    }
    let style = colour.stroke_width((FINE * if shape.stroke == Stroke::Thick { 3 } else { 1 }) as u32);
    let swatch = move |(x, y)| PathElement::new([(x, y), (x + 18 * FINE, y)], style);
    chart.draw_series(pieces.map(|piece| PathElement::new(piece, style)))?.label(&shape.name).legend(swatch);
    Ok(())
}

fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// A number on an axis: its shortest digits, and no rounding of zero.
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

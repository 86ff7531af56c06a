//! Pictures of a map: a curve over one axis, a heat map over two, a row of heat maps over three.
//!
//! A heat map is a PNG image inside the SVG with one pixel for each row of the map, which keeps a picture of a million rows
//! small; pixels of rows without a number are transparent and show the hatch below. Axes of lengths have one scale. Axes, colour bar and
//! legend are lines and text. Words (such as classes) have one colour each and a legend.

use super::{Axis, CLASSES, Study, StudyError};
use base64::Engine as _;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use rayon::prelude::*;
use std::fmt::Write as _;

/// Greatest number of rows of a picture: their values are held in memory.
const MOST: u64 = 1 << 24;
/// Greatest number of values of the axis over which heat maps stand side by side.
const PANELS: u64 = 8;
const PANEL: (u32, u32) = (420, 400);
const LEGEND: u32 = 150;

/// One column of a whole map, arranged by the axes that vary.
pub struct Values {
    /// The axes that vary: horizontal, vertical, and the axis over which heat maps stand side by side.
    pub axes: Vec<Axis>,
    /// Row number at each place; the horizontal axis varies fastest, then the vertical one.
    pub rows: Vec<u64>,
    /// Value at each place; NaN where the row has none. In a column of words, the index of the word.
    pub values: Vec<f64>,
    /// The conditions that do not vary, in one line: law, coefficients, speed, angle.
    pub title: String,
    /// Name of the column, with its unit.
    pub label: String,
    /// The words of a column of words; empty for a column of numbers.
    pub words: Vec<String>,
    /// Whether colours and the vertical axis of curves are logarithmic.
    pub logarithmic: bool,
}

impl Study {
    /// Checks that a picture can show this column of the map, without computing it.
    ///
    /// # Errors
    /// As [`Study::values`].
    #[doc(hidden)]
    pub fn check_picture(&self, column: &str) -> Result<(), StudyError> {
        self.arrange(column).map(drop)
    }

    /// Index of a column, and the axes that vary in the order of a picture.
    fn arrange(&self, column: &str) -> Result<(usize, Vec<usize>), StudyError> {
        let refuse = |rule: String| StudyError::File { file: self.file.clone(), rule };
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let at = names.iter().position(|name| *name == column);
        let at = at.ok_or_else(|| {
            refuse(format!("the map has no column '{column}': {}", super::read::nearest(column, &names)))
        })?;
        if self.rows > MOST {
            return Err(refuse(format!(
                "the map has {} rows, and a picture allows at most {MOST}: give the axes fewer values",
                self.rows
            )));
        }
        let axes = self.axes();
        let mut chosen: Vec<usize> = (0..axes.len()).filter(|k| axes[*k].varies()).collect();
        // panels: the axis of words, else the one with fewest values; the other axes keep their order
        if chosen.len() == 3 || (chosen.len() == 2 && chosen.iter().any(|k| !axes[*k].names().is_empty())) {
            let by = |k: &&usize| (axes[**k].names().is_empty(), axes[**k].count());
            if let Some(panels) = chosen.iter().min_by_key(by).copied() {
                chosen.retain(|k| *k != panels);
                chosen.push(panels);
            }
        }
        let drawn: Vec<&str> = chosen.iter().map(|k| axes[*k].name.as_str()).collect();
        let panels = match chosen.as_slice() {
            [] => return Err(refuse("no axis varies: a picture needs an axis with more than one value".into())),
            [_] | [_, _] => chosen.get(1).filter(|k| !axes[**k].names().is_empty()).map_or(1, |k| axes[*k].count()),
            [_, _, k] => axes[*k].count(),
            _ => PANELS + 1,
        };
        if panels > PANELS {
            return Err(refuse(format!(
                "{} axes vary ({}): a picture shows one or two, and a third with at most {PANELS} values; give the others one value",
                drawn.len(),
                drawn.join(", ")
            )));
        }
        let curve = chosen.len() == 1 || (chosen.len() == 2 && !axes[chosen[1]].names().is_empty());
        let drawn = if curve { &chosen[..1] } else { &chosen[..2] };
        for axis in drawn.iter().map(|k| &axes[*k]) {
            if !axis.names().is_empty() {
                return Err(refuse(format!("the axis {} has words, not numbers: let another axis vary", axis.name)));
            }
            if !curve && !is_even(axis) {
                return Err(refuse(format!(
                    "the values of {} are not evenly spaced, as a heat map requires: give a range {{ from, to, count }}",
                    axis.name
                )));
            }
        }
        Ok((at, chosen))
    }

    /// Computes one column of the whole map, arranged for a picture.
    ///
    /// # Errors
    /// [`StudyError::File`]: no such column; no axis or too many axes vary; unevenly spaced values on an axis of a heat map;
    /// more than 2²⁴ rows.
    pub fn values(&self, column: &str) -> Result<Values, StudyError> {
        let (at, chosen) = self.arrange(column)?;
        let axes = self.axes();
        // difference in row number of neighbours on an axis
        let stride = |k: usize| axes[k + 1..].iter().map(Axis::count).product::<u64>();
        let mut rows = vec![0];
        for k in &chosen {
            let (stride, count) = (stride(*k), axes[*k].count());
            rows = (0..count).flat_map(|place| rows.iter().map(move |row| row + place * stride)).collect();
        }
        let values = rows.par_iter().map_init(
            || (self.evaluator(), vec![0.0; self.columns.len()]),
            |(evaluator, row), index| {
                evaluator.row(*index, row);
                row[at]
            },
        );
        let unit = self.unit(column);
        Ok(Values {
            axes: chosen.iter().map(|k| axes[*k].clone()).collect(),
            values: values.collect(),
            rows,
            title: conditions(axes),
            label: if unit.is_empty() { column.into() } else { format!("{column}, {unit}") },
            words: self.columns[at].words.clone(),
            logarithmic: false,
        })
    }

    /// One column of the whole map as an SVG picture, `logarithmic` or linear in its values.
    ///
    /// # Errors
    /// As [`Study::values`]; for a logarithmic scale a column of words, or with values that are not above 0; if the picture cannot
    /// be drawn.
    pub fn picture(&self, column: &str, logarithmic: bool) -> Result<String, StudyError> {
        let values = Values { logarithmic, ..self.values(column)? };
        let refuse = |rule: String| Err(StudyError::File { file: self.file.clone(), rule });
        if logarithmic && !values.words.is_empty() {
            return refuse(format!("{column}: words have no logarithmic scale: leave it out"));
        }
        let below = values.values.iter().filter(|x| **x <= 0.0);
        if let Some(least) = below.copied().reduce(f64::min).filter(|_| logarithmic) {
            return refuse(format!(
                "{column}: a logarithmic scale needs values above 0, and the least one is {least}: leave it out, or show another column"
            ));
        }
        let mut svg = String::new();
        let drawn = if values.is_curve() { curve(&mut svg, &values) } else { heat_maps(&mut svg, &values) };
        drawn.map_err(|e| StudyError::File {
            file: self.file.clone(),
            rule: format!("the picture cannot be drawn: {e}"),
        })?;
        Ok(svg)
    }
}

/// The conditions that do not vary, of all axes of a study: law, restitution, other coefficients
/// that are not 0, speed, angle.
fn conditions(axes: &[Axis]) -> String {
    let [.., _, approach, speed, restitution, tangential, friction, law] = axes else { return String::new() };
    let fixed = |axis: &Axis, text: String| (!axis.varies()).then_some(text);
    let value = |axis: &Axis| tick(axis.value(0), axis.value(0).abs() / 100.0);
    let coefficient = |axis: &Axis, name: &str| {
        fixed(axis, format!("{name} = {}", value(axis))).filter(|_| axis.value(0) != 0.0 || name == "e")
    };
    let parts = [
        fixed(law, law.names().first().cloned().unwrap_or_default()),
        coefficient(restitution, "e"),
        coefficient(tangential, "e_t"),
        coefficient(friction, "μ"),
        fixed(speed, format!("{} m/s", value(speed))),
        fixed(approach, format!("approach {}°", value(approach))),
    ];
    parts.into_iter().flatten().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
}

fn is_even(axis: &Axis) -> bool {
    let (first, last) = ends(axis);
    let step = (last - first) / (axis.count() - 1) as f64;
    (0..axis.count()).all(|k| (axis.value(k) - first - step * k as f64).abs() <= 1e-9 * (last - first).abs())
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

impl Values {
    /// Whether the picture consists of curves: one axis of numbers, and possibly one of words.
    #[doc(hidden)]
    pub fn is_curve(&self) -> bool {
        self.axes.len() == 1 || (self.axes.len() == 2 && !self.axes[1].names().is_empty())
    }

    /// Smallest and greatest finite value. If both are equal, an interval around the value; without finite values (0, 1).
    #[doc(hidden)]
    pub fn range(&self) -> (f64, f64) {
        let finite = self.values.iter().filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        match (low, high) {
            (l, h) if l < h => (l, h),
            (l, h) if l == h => (l - 0.5 * l.abs().max(1e-12), h + 0.5 * h.abs().max(1e-12)),
            _ => (0.0, 1.0),
        }
    }

    /// Range of the colour bar: the 1st to the 99th percentile of the finite values, so that large values near a singular
    /// pose do not compress the rest of the scale. [`Values::range`] if the two percentiles are equal.
    #[doc(hidden)]
    pub fn colour_range(&self) -> (f64, f64) {
        let mut finite: Vec<f64> = self.values.iter().copied().filter(|x| x.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let at = |share: f64| finite.get((share * finite.len() as f64) as usize).copied();
        match (at(0.01), at(0.99)) {
            (Some(low), Some(high)) if low < high => (low, high),
            _ => self.range(),
        }
    }

    /// Place of a value on a scale over `(low, high)`, 0 to 1 between its ends.
    fn place(&self, value: f64, (low, high): (f64, f64)) -> f64 {
        let of = |x: f64| if self.logarithmic { x.ln() } else { x };
        (of(value) - of(low)) / (of(high) - of(low))
    }

    /// Colour (RGB) of a value for a colour bar over `(low, high)`. Values beyond the bar have the colour of its end, NaN is
    /// grey, words have one colour each.
    #[doc(hidden)]
    pub fn colour(&self, value: f64, (low, high): (f64, f64)) -> [u8; 3] {
        if !self.words.is_empty() {
            return word_colour(&self.words, value);
        }
        if value.is_nan() {
            return NOTHING;
        }
        let value = value.clamp(low, high);
        if low < 0.0 && high > 0.0 {
            // signed values: white at zero
            let size = low.abs().max(high);
            return mix(&DIVERGING, (value / size + 1.0) / 2.0);
        }
        mix(&SEQUENTIAL, self.place(value, (low, high)))
    }
}

/// Colour of NaN.
const NOTHING: [u8; 3] = [150, 150, 150];
/// Dark blue to yellow, with linearly increasing lightness.
const SEQUENTIAL: [[u8; 3]; 6] =
    [[33, 24, 82], [45, 75, 140], [36, 122, 142], [53, 168, 128], [138, 207, 85], [250, 231, 60]];
/// Blue over white to red.
const DIVERGING: [[u8; 3]; 5] = [[33, 90, 160], [130, 178, 214], [247, 247, 247], [236, 150, 120], [170, 30, 45]];
/// For [`CLASSES`], in their order.
const OF_CLASSES: [[u8; 3]; 11] = [
    [250, 250, 250],
    [222, 222, 222],
    [60, 60, 60],
    [150, 150, 150],
    [190, 190, 190],
    [106, 81, 163],
    [65, 171, 170],
    [198, 219, 239],
    [120, 160, 200],
    [253, 190, 90],
    [205, 70, 70],
];
/// For other words.
const OTHERS: [[u8; 3]; 8] = [
    [66, 133, 190],
    [240, 140, 50],
    [80, 165, 80],
    [200, 65, 65],
    [145, 105, 185],
    [140, 100, 80],
    [220, 130, 190],
    [120, 120, 120],
];

fn word_colour(words: &[String], value: f64) -> [u8; 3] {
    if value.is_nan() {
        return NOTHING;
    }
    let k = value as usize;
    if words.iter().eq(CLASSES.iter()) { OF_CLASSES[k % OF_CLASSES.len()] } else { OTHERS[k % OTHERS.len()] }
}

fn mix(colours: &[[u8; 3]], share: f64) -> [u8; 3] {
    let at = share * (colours.len() - 1) as f64;
    let k = (at as usize).min(colours.len() - 2);
    let part = at - k as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(colours[k][i]), f64::from(colours[k + 1][i]));
        (a + (b - a) * part).round() as u8
    })
}

fn rgb([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

fn name_of(axis: &Axis) -> String {
    if axis.unit.is_empty() || axis.name.ends_with("_deg") {
        axis.name.clone()
    } else {
        format!("{}, {}", axis.name, axis.unit)
    }
}

fn ends(axis: &Axis) -> (f64, f64) {
    (axis.value(0), axis.value(axis.count() - 1))
}

const TEXT: (&str, u32) = ("sans-serif", 14);
/// Height of the title.
const HEAD: u32 = 26;

/// A drawing of this size below its title.
fn titled<'s>(
    svg: &'s mut String,
    size: (u32, u32),
    title: &str,
) -> Result<DrawingArea<SVGBackend<'s>, Shift>, Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let (head, rest) = root.split_vertically(HEAD);
    head.draw(&Text::new(title.to_owned(), (16, 10), TEXT)).map_err(|e| e.to_string())?;
    Ok(rest)
}

fn curve(svg: &mut String, values: &Values) -> Drawn {
    let axis = &values.axes[0];
    let (left, right) = (0..axis.count())
        .map(|k| axis.value(k))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let (low, high) = if values.words.is_empty() { values.range() } else { (0.0, (values.words.len() - 1) as f64) };
    let several = values.axes.get(1);
    let width = 700;
    let size = (width + if several.is_some() { LEGEND } else { 0 }, 460 + HEAD);
    let root = titled(svg, size, &values.title)?;
    let (area, legend) = root.split_horizontally(width);
    let across = (left, right);
    if values.logarithmic {
        let room = (high / low).powf(0.05);
        lines((&area, &legend), values, across, (low / room..high * room).log_scale(), &brief)?;
    } else {
        let room = 0.05 * (high - low);
        let number = |y: f64| tick(y, high - low);
        lines((&area, &legend), values, across, low - room..high + room, &number)?;
    }
    root.present()?;
    Ok(())
}

type Area<'s> = DrawingArea<SVGBackend<'s>, Shift>;

/// Draws the curves over a vertical axis, whose numbers are written by `number`, and their legend.
fn lines<Y: AsRangedCoord<Value = f64>>(
    (area, legend): (&Area, &Area),
    values: &Values,
    (left, right): (f64, f64),
    up: Y,
    number: &dyn Fn(f64) -> String,
) -> Drawn
where
    Y::CoordDescType: ValueFormatter<f64>,
{
    let axis = &values.axes[0];
    let (count, several) = (axis.count() as usize, values.axes.get(1));
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(86)
        .build_cartesian_2d(left..right, up)?;
    let word = |y: &f64| {
        let near = y.round();
        if (y - near).abs() > 1e-6 || near < 0.0 {
            String::new()
        } else {
            values.words.get(near as usize).cloned().unwrap_or_default()
        }
    };
    let of_number = |y: &f64| number(*y);
    let y_label: &dyn Fn(&f64) -> String = if values.words.is_empty() { &of_number } else { &word };
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(name_of(axis))
        .y_desc(&values.label)
        .x_label_formatter(&|x| tick(*x, right - left))
        .y_label_formatter(y_label)
        .y_labels(values.words.len().max(9))
        .label_style(TEXT)
        .draw()?;
    if let Some(axis) = several {
        legend.draw(&Text::new(axis.name.clone(), (4, 16), TEXT))?;
    }
    for (k, part) in values.values.chunks(count).enumerate() {
        let stroke = rgb(OTHERS[k % OTHERS.len()]).stroke_width(2);
        let points: Vec<(f64, f64)> = (0..axis.count()).map(|i| axis.value(i)).zip(part.iter().copied()).collect();
        for run in points.split(|p| !p.1.is_finite()).filter(|run| !run.is_empty()) {
            chart.draw_series(LineSeries::new(run.iter().copied(), stroke))?;
        }
        if let Some(axis) = several {
            let y = 50 + 22 * k as i32;
            legend.draw(&PathElement::new([(4, y), (24, y)], stroke))?;
            legend.draw(&Text::new(axis.names()[k].clone(), (32, y - 8), TEXT))?;
        }
    }
    Ok(())
}

/// A number with enough digits to distinguish the ticks of an axis of length `span`.
fn tick(x: f64, span: f64) -> String {
    let digits = (1.0 - span.abs().max(1e-300).log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{x:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

fn heat_maps(svg: &mut String, values: &Values) -> Drawn {
    let (across, up) = (&values.axes[0], &values.axes[1]);
    let panels = values.axes.get(2);
    let count = panels.map_or(1, Axis::count) as usize;
    let cells = (across.count() * up.count()) as usize;
    let range = values.colour_range();
    let size = (PANEL.0 * count as u32 + LEGEND, PANEL.1 + 16 + HEAD);
    let mut images = HATCH.to_owned();
    {
        let root = titled(svg, size, &values.title)?;
        let (maps, legend) = root.split_horizontally(PANEL.0 * count as u32);
        for (k, area) in maps.split_evenly((1, count)).into_iter().enumerate() {
            let title = panels.map(|axis| match axis.names() {
                [] => format!("{} {}", axis.name, tick(axis.value(k as u64), axis.value(0))),
                names => format!("{} {}", axis.name, names[k]),
            });
            let place = panel(&area, title.as_deref(), across, up)?;
            let cells = &values.values[k * cells..(k + 1) * cells];
            hatched(&mut images, place)?;
            image(&mut images, place, cells, across, up, &|x| values.colour(x, range))?;
        }
        let end =
            if values.words.is_empty() { colour_bar(&legend, values, range)? } else { word_legend(&legend, values)? };
        let nothing = values.values.iter().filter(|x| x.is_nan()).count();
        if nothing > 0 {
            let share = 100.0 * nothing as f64 / values.values.len() as f64;
            legend.draw(&Text::new(format!("no result {share:.1} %"), (26, end), TEXT))?;
            let (across, down) = legend.get_pixel_range();
            hatched(&mut images, [across.start + 4, down.start + end, 14, 14])?;
        }
        root.present()?;
    }
    let end = svg.rfind("</svg>").ok_or("no end of the drawing")?;
    svg.insert_str(end, &images);
    Ok(())
}

/// Draws the axes of one heat map. Returns the area of its image: x, y, width, height.
fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    title: Option<&str>,
    across: &Axis,
    up: &Axis,
) -> Result<[i32; 4], Box<dyn std::error::Error>> {
    let [margin, below, beside]: [u32; 3] = [12, 44, 64];
    let ((x0, x1), (y0, y1)) = (ends(across), ends(up));
    let area = title.map_or(Ok(area.clone()), |title| area.titled(title, ("sans-serif", 16)))?;
    // Lengths on both axes have one scale: the longer side fills the panel.
    let (width, height) = area.dim_in_pixel();
    let (width, height) = (f64::from(width - 2 * margin - beside), f64::from(height - 2 * margin - below));
    let scale = if across.unit == "m" && up.unit == "m" {
        (width / (x1 - x0).abs()).min(height / (y1 - y0).abs())
    } else {
        f64::INFINITY
    };
    let rest = |size: f64, span: f64| (size - (span.abs() * scale).clamp(NARROWEST, size)).round() as u32;
    let mut builder = ChartBuilder::on(&area);
    builder.margin(margin).x_label_area_size(below).y_label_area_size(beside);
    builder.margin_right(margin + rest(width, x1 - x0)).margin_top(margin + rest(height, y1 - y0));
    let mut chart = builder.build_cartesian_2d(x0..x1, y0..y1)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(6)
        .y_labels(8)
        .x_desc(name_of(across))
        .y_desc(name_of(up))
        .x_label_formatter(&|x| tick(*x, x1 - x0))
        .y_label_formatter(&|y| tick(*y, y1 - y0))
        .label_style(TEXT)
        .draw()?;
    let (x, y) = chart.plotting_area().get_pixel_range();
    Ok([x.start, y.start, x.end - x.start, y.end - y.start])
}

/// The pattern of places without a result.
const HATCH: &str = "<defs><pattern id=\"no-result\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" \
                     patternTransform=\"rotate(45)\"><rect width=\"7\" height=\"7\" fill=\"#ffffff\"/>\
                     <rect width=\"2\" height=\"7\" fill=\"#a0a4aa\"/></pattern></defs>\n";
/// Length of the shorter side of a heat map of lengths, at least, pixels.
const NARROWEST: f64 = 40.0;

/// Fills a rectangle with the pattern of places without a result.
fn hatched(svg: &mut String, [x, y, width, height]: [i32; 4]) -> Drawn {
    writeln!(
        svg,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"url(#no-result)\" stroke=\"#787878\"/>"
    )?;
    Ok(())
}

/// Writes the pixels of one heat map, first row of the map at the bottom.
fn image(
    svg: &mut String,
    [x, y, width, height]: [i32; 4],
    cells: &[f64],
    across: &Axis,
    up: &Axis,
    colour: &dyn Fn(f64) -> [u8; 3],
) -> Drawn {
    let columns = across.count() as usize;
    let pixel = |value: &f64| {
        let [r, g, b] = colour(*value);
        [r, g, b, if value.is_nan() { 0 } else { u8::MAX }]
    };
    let pixels: Vec<u8> = cells.chunks(columns).rev().flatten().flat_map(pixel).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, across.count() as u32, up.count() as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    writeln!(
        svg,
        "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
         style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{data}\"/>"
    )?;
    Ok(())
}

/// Returns the height, pixels, of a further entry.
fn colour_bar(area: &Area, values: &Values, (low, high): (f64, f64)) -> Result<i32, Box<dyn std::error::Error>> {
    let (top, height) = (44, PANEL.1 as i32 - 140);
    area.draw(&Text::new(values.label.clone(), (4, 16), TEXT))?;
    for k in 0..height {
        let share = f64::from(k) / f64::from(height - 1);
        let value = if values.logarithmic { high * (low / high).powf(share) } else { high + (low - high) * share };
        let colour = rgb(values.colour(value, (low, high)));
        area.draw(&Rectangle::new([(4, top + k), (26, top + k + 1)], colour.filled()))?;
    }
    let beyond = |is: &dyn Fn(f64) -> bool| values.values.iter().any(|x| x.is_finite() && is(*x));
    // Round ticks, and the ends where values lie beyond them.
    let step = round_step((high - low) / 5.0);
    let even = || {
        let first = (low / step).ceil() as i64;
        (0..=6).map(|k| (first + k) as f64 * step).filter(|x| *x <= high).collect()
    };
    let mut ticks: Vec<f64> = if values.logarithmic { round_powers(low, high) } else { even() };
    let place = |value: f64| values.place(value, (low, high));
    let mut signs = Vec::new();
    for (end, more) in [(high, "≥ "), (low, "≤ ")] {
        if beyond(&|x| if more == "≥ " { x > high } else { x < low }) {
            ticks.retain(|x| (place(*x) - place(end)).abs() > 0.08);
            signs.push((end, more));
        }
    }
    for (value, more) in ticks.into_iter().map(|value| (value, "")).chain(signs) {
        let number = if values.logarithmic { brief(value) } else { tick(value, step) };
        let down = f64::from(height - 1) * (1.0 - place(value));
        area.draw(&Text::new(format!("{more}{number}"), (34, top - 6 + down.round() as i32), TEXT))?;
    }
    Ok(top + height + 14)
}

/// The numbers 1, 2 and 5 times a power of ten from `low` to `high`; of more than seven the powers of ten, of more than fourteen of these
/// every other, and so on.
fn round_powers(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let between = |x: &f64| (low..=high).contains(x);
    let all: Vec<f64> =
        (first..=last).flat_map(|k| [1.0, 2.0, 5.0].map(|x| x * 10f64.powi(k))).filter(between).collect();
    let apart = ((last - first) / 7 + 1) as usize;
    if all.len() <= 7 { all } else { (first..=last).step_by(apart).map(|k| 10f64.powi(k)).filter(between).collect() }
}

/// A number in three digits.
fn brief(x: f64) -> String {
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    if (1e-3..1e5).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// The least 1, 2 or 5 times a power of ten that is not below this.
fn round_step(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.max(f64::MIN_POSITIVE).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|x| x * power)
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// Legend of the words that occur, each with its colour and its percentage of the rows.
fn word_legend(area: &Area, values: &Values) -> Result<i32, Box<dyn std::error::Error>> {
    area.draw(&Text::new(values.label.clone(), (4, 16), TEXT))?;
    let mut line = 0;
    for (k, word) in values.words.iter().enumerate() {
        let count = values.values.iter().filter(|x| **x == k as f64).count();
        if count == 0 {
            continue;
        }
        let y = 44 + 22 * line;
        line += 1;
        let square = [(4, y), (18, y + 14)];
        area.draw(&Rectangle::new(square, rgb(word_colour(&values.words, k as f64)).filled()))?;
        area.draw(&Rectangle::new(square, RGBColor(120, 120, 120).stroke_width(1)))?;
        let share = 100.0 * count as f64 / values.values.len() as f64;
        let name = if word.is_empty() { "none" } else { word };
        area.draw(&Text::new(format!("{name} {share:.1} %"), (26, y), TEXT))?;
    }
    Ok(44 + 22 * line)
}

//! Heat maps over two axes, side by side, with their colour bar or the legend of their words.

use super::super::Axis;
use super::axes::{HEAD, TEXT, brief, ends, name_of, round_powers, tick, titled};
use super::colours::word_colour;
use super::values::{LEGEND, Values};
use crate::drawing::{Area, Drawn, picture, rgb, round_step};
use base64::Engine as _;
use plotters::prelude::*;
use std::error::Error;
use std::fmt::Write as _;

const PANEL: (u32, u32) = (420, 400);

/// Draws the heat maps of a picture.
pub(super) fn draw(values: &Values) -> Result<String, Box<dyn Error>> {
    let (across, up) = (&values.axes[0], &values.axes[1]);
    let panels = values.axes.get(2);
    let count = panels.map_or(1, Axis::count) as usize;
    let cells = (across.count() * up.count()) as usize;
    let range = values.colour_range();
    let size = (PANEL.0 * count as u32 + LEGEND, PANEL.1 + 16 + HEAD);
    let mut images = HATCH.to_owned();
    let mut svg = picture(size, |root| {
        let (maps, legend) = titled(root, &values.title)?.split_horizontally(PANEL.0 * count as u32);
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
        Ok(())
    })?;
    let end = svg.rfind("</svg>").ok_or("no end of the drawing")?;
    svg.insert_str(end, &images);
    Ok(svg)
}

/// Draws the axes of one heat map. Returns the area of its image: x, y, width, height.
fn panel(area: &Area, title: Option<&str>, across: &Axis, up: &Axis) -> Result<[i32; 4], Box<dyn Error>> {
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
fn colour_bar(area: &Area, values: &Values, (low, high): (f64, f64)) -> Result<i32, Box<dyn Error>> {
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

/// Legend of the words that occur, each with its colour and its percentage of the rows.
fn word_legend(area: &Area, values: &Values) -> Result<i32, Box<dyn Error>> {
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

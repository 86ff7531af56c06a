//! Curves over one axis.

use super::axes::{HEAD, TEXT, brief, name_of, tick, titled};
use super::colours::OTHERS;
use super::values::{LEGEND, Values};
use crate::drawing::{Area, Drawn, picture, rgb};
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use std::error::Error;

/// Draws the curves of a picture.
pub(super) fn draw(values: &Values) -> Result<String, Box<dyn Error>> {
    let axis = &values.axes[0];
    let (left, right) = (0..axis.count())
        .map(|k| axis.value(k))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let (low, high) = if values.words.is_empty() { values.range() } else { (0.0, (values.words.len() - 1) as f64) };
    let several = values.axes.get(1);
    let width = 700;
    let size = (width + if several.is_some() { LEGEND } else { 0 }, 460 + HEAD);
    picture(size, |root| {
        let (area, legend) = titled(root, &values.title)?.split_horizontally(width);
        let across = (left, right);
        if values.logarithmic {
            let room = (high / low).powf(0.05);
            lines((&area, &legend), values, across, (low / room..high * room).log_scale(), &brief)
        } else {
            let room = 0.05 * (high - low);
            let number = |y: f64| tick(y, high - low);
            lines((&area, &legend), values, across, low - room..high + room, &number)
        }
    })
}

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

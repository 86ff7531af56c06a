//! The chart as SVG: two panels of error over time, both axes logarithmic.

use super::stiffness::Stiffened;
use super::{Chart, Run, StiffnessChart, knob_value};
use carom_study::drawing::{Area, Drawn, sure_picture};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const PANEL: (u32, u32) = (560, 460);
const LINE: i32 = 19;

/// Errors below this are drawn at this value.
pub(super) const FLOOR: f64 = 1e-16;

/// Colour of the dashed line at the error of the reference solution.
const DOUBT: RGBColor = RGBColor(110, 110, 110);

impl Chart {
    /// Draws the chart as SVG. `title` is the name of the scene.
    pub fn svg(&self, title: &str) -> String {
        let mut methods: Vec<&str> = Vec::new();
        for run in &self.runs {
            if !methods.contains(&run.method.as_str()) {
                methods.push(&run.method);
            }
        }
        let rows = (methods.len() + 1).div_ceil(2) + 2 + self.absent.len();
        let size = (2 * PANEL.0, PANEL.1 + 46 + (LINE * rows as i32) as u32);
        sure_picture(size, |root| draw(root, self, title, &methods))
    }
}

/// An error of a run.
type Error = fn(&Run) -> Option<f64>;

/// Hues a golden angle apart, which differ clearly between neighbours in the list; every other one darker.
fn colour(k: usize) -> RGBColor {
    let hue = (0.58 + k as f64 * 0.381_966) % 1.0;
    let (r, g, b) = HSLColor(hue, 0.75, if k.is_multiple_of(2) { 0.42 } else { 0.55 }).rgb();
    RGBColor(r, g, b)
}

/// How the line of a method is drawn.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Look {
    colour: RGBColor,
    width: u32,
    /// Number of corners of the symbol, and the part of a corner's angle by which it is turned.
    symbol: (i32, f64),
}

const ROUND: (i32, f64) = (12, 0.5);
/// Square, triangle, diamond, triangle on its tip, hexagon.
const SYMBOLS: [(i32, f64); 5] = [(4, 0.5), (3, 0.25), (4, 0.0), (3, 0.75), (6, 0.5)];

/// carom's methods: thick lines with round symbols, a colour each. Those of other programs: thin lines, a colour for each program
/// (the first word of the method) and a symbol for each of its methods.
fn looks(chart: &Chart, methods: &[&str]) -> Vec<Look> {
    let mut programs: Vec<(&str, RGBColor, usize)> = Vec::new();
    let own = methods.iter().filter(|method| chart.is_own(method)).count();
    let mut looks = Vec::new();
    for (k, method) in methods.iter().enumerate() {
        if chart.is_own(method) {
            looks.push(Look { colour: colour(k), width: 3, symbol: ROUND });
            continue;
        }
        let name = method.split(' ').next().unwrap_or_default();
        let at = programs.iter().position(|it| it.0 == name).unwrap_or(programs.len());
        if at == programs.len() {
            programs.push((name, colour(own + at), 0));
        }
        let (_, colour, before) = &mut programs[at];
        looks.push(Look { colour: *colour, width: 1, symbol: SYMBOLS[*before % SYMBOLS.len()] });
        *before += 1;
    }
    looks
}

fn mark((x, y): (i32, i32), (corners, turn): (i32, f64)) -> Vec<(i32, i32)> {
    let size = if corners == 3 { 5.5 } else { 4.6 };
    let corner = |k: i32| {
        let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + turn) / f64::from(corners)).sin_cos();
        (x + (size * cos).round() as i32, y + (size * sin).round() as i32)
    };
    (0..corners).map(corner).collect()
}

fn draw(root: &Area, chart: &Chart, title: &str, methods: &[&str]) -> Drawn {
    let font = |size: i32| ("sans-serif", size).into_font().color(&BLACK);
    let (panels, below) = root.split_vertically(PANEL.1 + 30);
    let (head, panels) = panels.split_vertically(30);
    head.draw(&Text::new(title, (14, 8), font(18)))?;
    let (left, right) = panels.split_horizontally(PANEL.0);
    let looks = looks(chart, methods);
    let methods: Vec<(&str, Look)> = methods.iter().copied().zip(looks).collect();
    let after: [Error; 2] = [|run| run.after_impact, |_| None];
    panel(&left, chart, &methods, "error of q̇ right after the first impact", chart.doubt_after_impact, after)?;
    let end: [Error; 2] = [|run| run.at_end, |run| run.estimated_at_end];
    panel(&right, chart, &methods, "error of q and q̇ at the end", Some(chart.doubt_at_end), end)?;

    let text = font(13).pos(Pos::new(HPos::Left, VPos::Center));
    let place = |k: usize| (20 + (k % 2) as i32 * PANEL.0 as i32, 12 + LINE * (k / 2) as i32);
    for (k, &(method, look)) in methods.iter().enumerate() {
        let ((x, y), own) = (place(k), chart.is_own(method));
        below.draw(&PathElement::new([(x, y), (x + 22, y)], look.colour.stroke_width(look.width)))?;
        below.draw(&Polygon::new(mark((x + 11, y), look.symbol), look.colour.filled()))?;
        let knobs = chart.runs.iter().filter(|run| run.method == *method);
        let values: Vec<f64> = knobs.clone().map(|run| run.value).collect();
        let knob = knobs.map(|run| run.knob.as_str()).next().unwrap_or_default();
        let range = match values.as_slice() {
            [one] => format!("{knob} {}", knob_value(*one)),
            [first, .., last] => format!("{knob} {} … {}", knob_value(*first), knob_value(*last)),
            [] => String::new(),
        };
        // the caption states the laws of other programs
        let law = chart.runs.iter().find(|run| own && run.method == *method);
        let law = law.map_or_else(String::new, |run| format!("; law: {}", run.law));
        below.draw(&Text::new(format!("{method} ({range}){law}"), (x + 30, y), text.clone()))?;
    }
    let (x, y) = place(methods.len());
    for dash in [0, 9, 18] {
        below.draw(&PathElement::new([(x + dash, y), (x + dash + 5, y)], DOUBT.stroke_width(1)))?;
    }
    let dashes = "error of the reference solution; fine dashes: errors at the end as the runs estimate them";
    below.draw(&Text::new(dashes, (x + 30, y), text.clone()))?;
    let from = 12 + LINE * (methods.len() + 1).div_ceil(2) as i32;
    for (k, line) in chart.caption().into_iter().enumerate() {
        below.draw(&Text::new(line, (20, from + LINE * k as i32), text.clone()))?;
    }
    let from = from + 2 * LINE;
    for (k, absent) in chart.absent.iter().enumerate() {
        let (mut reason, all) = (absent.reason.chars().take(140).collect::<String>(), absent.reason.chars().count());
        if all > 140 {
            reason.push('…');
        }
        let line = format!("not run: {}: {reason}", absent.method);
        below.draw(&Text::new(line, (20, from + LINE * k as i32), text.clone()))?;
    }
    Ok(())
}

fn panel(
    area: &Area,
    chart: &Chart,
    methods: &[(&str, Look)],
    what: &str,
    doubt: Option<f64>,
    [error, estimate]: [Error; 2],
) -> Drawn {
    let curve = |method: &str, error: Error| -> Vec<(f64, f64)> {
        let own = chart.runs.iter().filter(|run| run.method == method);
        own.filter_map(|run| Some((run.wall_time * 1e3, error(run)?.max(FLOOR)))).collect()
    };
    let all = methods.iter().flat_map(|(method, _)| [error, estimate].map(|of| curve(method, of))).flatten();
    let all: Vec<(f64, f64)> = all.collect();
    if all.is_empty() {
        let font = ("sans-serif", 14).into_font().color(&BLACK);
        return Ok(area.draw(&Text::new(format!("{what}: no data"), (60, 60), font))?);
    }
    let range = |of: fn(&(f64, f64)) -> f64, room: f64| {
        let (low, high) = all.iter().map(of).fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        low / room..high * room
    };
    let (times, mut errors) = (range(|p| p.0, 1.6), range(|p| p.1, 4.0));
    if let Some(doubt) = doubt {
        errors = errors.start.min(doubt.max(FLOOR) / 4.0)..errors.end;
    }
    let mut axes = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(44)
        .y_label_area_size(66)
        .build_cartesian_2d(times.clone().log_scale(), errors.log_scale())?;
    axes.configure_mesh()
        .light_line_style(WHITE)
        .x_desc("time of the whole run, ms")
        .y_desc(what)
        .label_style(("sans-serif", 13))
        .x_label_formatter(&|x| power(*x))
        .y_label_formatter(&|x| power(*x))
        .draw()?;
    if let Some(doubt) = doubt {
        let doubt = doubt.max(FLOOR);
        let line = [(times.start, doubt), (times.end, doubt)];
        axes.draw_series(DashedLineSeries::new(line, 5, 4, DOUBT.stroke_width(1)))?;
    }
    for &(method, look) in methods {
        let points = curve(method, error);
        axes.draw_series(LineSeries::new(points.iter().copied(), look.colour.stroke_width(look.width)))?;
        let at = |p: &(f64, f64)| EmptyElement::at(*p) + Polygon::new(mark((0, 0), look.symbol), look.colour.filled());
        axes.draw_series(points.iter().map(at))?;
        let estimates = curve(method, estimate);
        axes.draw_series(DashedLineSeries::new(estimates, 2, 3, look.colour.stroke_width(1)))?;
    }
    Ok(())
}

impl StiffnessChart {
    /// Draws the errors over the factor of the stiffness as SVG, with a line of the order in theory. `title` is the name of the
    /// scene.
    pub fn svg(&self, title: &str) -> String {
        sure_picture((PANEL.0 + 300, PANEL.1), |root| draw_stiffness(root, self, title))
    }
}

fn draw_stiffness(root: &Area, chart: &StiffnessChart, title: &str) -> Drawn {
    type Error = fn(&Stiffened) -> Option<f64>;
    let errors: [(&str, Error, Option<f64>); 2] = [
        ("q̇ at the end of the first contact", |run| run.after_impact, chart.order_after_impact),
        ("q and q̇ at the end", |run| run.at_end, chart.order_at_end),
    ];
    let points = |error: Error| -> Vec<(f64, f64)> {
        chart.runs.iter().filter_map(|run| Some((run.factor, error(run)?.max(FLOOR)))).collect()
    };
    let all: Vec<(f64, f64)> = errors.iter().flat_map(|(_, error, _)| points(*error)).collect();
    let font = |size: i32| ("sans-serif", size).into_font().color(&BLACK);
    let (Some(first), Some(last)) = (chart.runs.first(), chart.runs.last()) else { return Ok(()) };
    if all.is_empty() {
        return Ok(root.draw(&Text::new(format!("{title}: no data"), (60, 60), font(14)))?);
    }
    let (low, high) = all.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), (_, y)| (low.min(*y), high.max(*y)));
    let (left, right) = root.split_horizontally(PANEL.0);
    let mut axes = ChartBuilder::on(&left)
        .caption(title, font(18))
        .margin(10)
        .x_label_area_size(44)
        .y_label_area_size(66)
        .build_cartesian_2d((first.factor / 1.6..last.factor * 1.6).log_scale(), (low / 4.0..high * 4.0).log_scale())?;
    axes.configure_mesh()
        .light_line_style(WHITE)
        .x_desc("factor of all stiffnesses")
        .y_desc("error against the run with rigid contacts")
        .label_style(("sans-serif", 13))
        .x_label_formatter(&|x| power(*x))
        .y_label_formatter(&|x| power(*x))
        .draw()?;
    let grey = RGBColor(150, 150, 150);
    let at_last = points(errors[1].1).last().map_or(low, |point| point.1);
    // Through the last error at the end, lower by half a decade to be seen beside it.
    let line = |factor: f64| (factor, 0.3 * at_last * (last.factor / factor).powf(chart.theory));
    axes.draw_series(DashedLineSeries::new([line(first.factor), line(last.factor)], 6, 4, grey.stroke_width(2)))?;
    let mut names = vec![(format!("order in theory: {:.3}", chart.theory), grey)];
    for (k, (name, error, order)) in errors.into_iter().enumerate() {
        let points = points(error);
        axes.draw_series(LineSeries::new(points.iter().copied(), colour(k).stroke_width(3)))?;
        let at = |p: &(f64, f64)| EmptyElement::at(*p) + Polygon::new(mark((0, 0), ROUND), colour(k).filled());
        axes.draw_series(points.iter().map(at))?;
        let order = order.map_or_else(String::new, |order| format!(": order {order:.3}"));
        names.push((format!("{name}{order}"), colour(k)));
    }
    let text = font(13).pos(Pos::new(HPos::Left, VPos::Center));
    for (k, (name, colour)) in names.into_iter().enumerate() {
        let y = 60 + 2 * LINE * k as i32;
        right.draw(&PathElement::new([(4, y), (22, y)], colour.stroke_width(3)))?;
        right.draw(&Text::new(name, (28, y), text.clone()))?;
    }
    Ok(())
}

/// Label of a number on a logarithmic axis: 1, 2 and 5 of each decade, an empty text for others.
pub(super) fn power(x: f64) -> String {
    let exponent = (x.log10() + 1e-9).floor() as i32;
    let digit = x / 10_f64.powi(exponent);
    let Some(digit) = [1.0, 2.0, 5.0].into_iter().find(|it| (digit - it).abs() < 1e-6) else { return String::new() };
    if (-2..4).contains(&exponent) {
        let text = format!("{:.2}", digit * 10_f64.powi(exponent));
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{digit}e{exponent}")
    }
}

#[cfg(test)]
mod tests {
    use super::{Chart, ROUND, looks, power};
    use crate::chart::{Reference, Run};

    /// The methods of one program have one colour and different symbols; all other pairs of lines differ in colour.
    #[test]
    fn methods_of_one_program_share_a_colour_and_differ_in_their_symbol() {
        let methods = ["events", "steps", "x 1, a", "y 2, a", "x 1, b", "x 1, c"];
        let run = |method: &&str| Run {
            method: (*method).to_owned(),
            law: String::new(),
            knob: "dt".to_owned(),
            value: 1.0,
            wall_time: 1.0,
            after_impact: None,
            at_end: Some(1.0),
            estimated_at_end: None,
        };
        let chart = Chart {
            runs: methods.iter().map(run).collect(),
            absent: Vec::new(),
            law: String::new(),
            doubt_after_impact: None,
            doubt_at_end: 0.0,
            peers: methods[2..].iter().map(|it| (*it).to_owned()).collect(),
            reference: Reference { impact: None, end: (vec![1.0], vec![1.0]), speed: 1.0, quaternions: Vec::new() },
        };
        let looks = looks(&chart, &methods);
        for (a, first) in looks.iter().enumerate() {
            assert_eq!((first.symbol == ROUND, first.width), (a < 2, if a < 2 { 3 } else { 1 }));
            for (b, second) in looks.iter().enumerate().skip(a + 1) {
                let same = [2, 4, 5].contains(&a) && [2, 4, 5].contains(&b);
                assert_eq!(first.colour == second.colour, same, "{} and {}", methods[a], methods[b]);
                assert!(!same || first.symbol != second.symbol, "{} and {}", methods[a], methods[b]);
            }
        }
    }

    #[test]
    fn ticks_have_labels_at_1_2_and_5_of_a_decade_only() {
        for (x, name) in [(1.0, "1"), (2.0, "2"), (3.0, ""), (7.0, ""), (10.0, "10"), (0.05, "0.05"), (5e-6, "5e-6")] {
            assert_eq!(power(x), name);
        }
        // powers of ten with rounding errors
        assert_eq!([power(0.1 * 0.1 * 0.1), power(1000.0000000000001)], ["1e-3", "1000"]);
    }
}

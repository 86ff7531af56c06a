//! The chart of a few chosen methods as SVG, each line with its name beside it.

use super::picture::{FLOOR, power};
use super::{Run, from_csv};
use crate::EvidenceError;
use carom_study::drawing::{Area, Drawn, sure_picture};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;

/// Size of a panel, and height of the title.
const PANEL: (u32, u32) = (600, 440);
const HEAD: u32 = 34;
const TEXT: i32 = 17;
/// Least distance of two names that stand above each other.
const LINE: i32 = 19;
/// Width of a letter of a name, on average.
const LETTER: i32 = 9;
/// The time axis is longer than the times by this factor, so that the names have room.
const ROOM: f64 = 30.0;

/// Colours that readers with any colour vision can tell apart (Okabe & Ito 2008), the first one black.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 0, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

type Line = (String, RGBColor, Vec<(f64, f64)>);
type Error = fn(&Run) -> Option<f64>;

/// Draws methods of a table that `Chart::csv` has written as SVG: error of q̇ after the first impact and error at the end, each over
/// the time of the whole run. `shown` has a method each, or METHOD=NAME with its name in the picture. A panel is left out if none of the
/// methods, or only one of several, has data for it.
///
/// # Errors
/// [`EvidenceError`]: the table cannot be read, has no such method or no errors of the methods, or more methods are shown than there are
/// colours.
pub fn redraw(table: &Path, shown: &[String], title: &str) -> Result<String, EvidenceError> {
    let name = table.display();
    let text = std::fs::read_to_string(table);
    let text = text.map_err(|reason| EvidenceError::of_file(table, format!("cannot be read: {reason}")))?;
    let runs = from_csv(&text).map_err(|reason| EvidenceError::new(format!("--from {name}: {reason}")))?;
    if shown.len() > COLOURS.len() {
        let most = COLOURS.len();
        return Err(EvidenceError::new(format!("--show: {} methods: give at most {most}", shown.len())));
    }
    let mut named = Vec::new();
    for one in shown {
        let (method, label) = one.split_once('=').unwrap_or((one, one));
        if !runs.iter().any(|run| run.method == method) {
            let mut known: Vec<&str> = runs.iter().map(|run| run.method.as_str()).collect();
            known.dedup();
            let known = known.join("; ");
            return Err(EvidenceError::new(format!("--show {method}: {name} has no such method, but: {known}")));
        }
        named.push((method, label));
    }
    svg(&runs, &named, title)
        .ok_or_else(|| EvidenceError::new(format!("--from {name}: it has no errors of --show {}", shown.join(", "))))
}

fn svg(runs: &[Run], shown: &[(&str, &str)], title: &str) -> Option<String> {
    let lines = |error: Error| -> Vec<Line> {
        let all = shown.iter().zip(COLOURS).map(|((method, name), colour)| {
            let own = runs.iter().filter(|run| run.method == *method);
            let points = own.filter_map(|run| Some((run.wall_time * 1e3, error(run)?.max(FLOOR)))).collect();
            ((*name).to_owned(), colour, points)
        });
        all.filter(|(_, _, points): &Line| !points.is_empty()).collect()
    };
    let panels: [(&str, Error); 2] = [
        ("error of q̇ after the first impact", |run| run.after_impact),
        ("error of q and q̇ at the end", |run| run.at_end),
    ];
    let mut drawn: Vec<(&str, Vec<Line>)> = panels.iter().map(|&(what, error)| (what, lines(error))).collect();
    drawn.retain(|(_, lines)| lines.len() >= shown.len().min(2) && !lines.is_empty());
    let size = (PANEL.0 * drawn.len() as u32, PANEL.1 + HEAD);
    (!drawn.is_empty()).then(|| sure_picture(size, |root| draw(root, &drawn, title)))
}

fn draw(root: &Area, panels: &[(&str, Vec<Line>)], title: &str) -> Drawn {
    let (head, below) = root.split_vertically(HEAD);
    head.draw(&Text::new(title, (14, 8), ("sans-serif", TEXT + 3).into_font().color(&BLACK)))?;
    for (area, (what, lines)) in below.split_evenly((1, panels.len())).iter().zip(panels) {
        panel(area, what, lines)?;
    }
    Ok(())
}

fn panel(area: &Area, what: &str, lines: &[Line]) -> Drawn {
    let range = |of: fn(&(f64, f64)) -> f64| {
        let all = lines.iter().flat_map(|line| line.2.iter().map(of));
        all.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)))
    };
    let ((soonest, latest), (least, greatest)) = (range(|p| p.0), range(|p| p.1));
    let mut axes = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(52)
        .y_label_area_size(78)
        .build_cartesian_2d((soonest / 1.6..latest * ROOM).log_scale(), (least / 6.0..greatest * 6.0).log_scale())?;
    axes.configure_mesh()
        .light_line_style(WHITE)
        .x_desc("time of the whole run, ms")
        .y_desc(what)
        .label_style(("sans-serif", TEXT - 2))
        .axis_desc_style(("sans-serif", TEXT))
        .x_label_formatter(&|x| power(*x))
        .y_label_formatter(&|x| power(*x))
        .draw()?;
    let mut names = Vec::new();
    for (k, (name, colour, points)) in lines.iter().enumerate() {
        let width = if k == 0 { 4 } else { 2 };
        axes.draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(width)))?;
        axes.draw_series(points.iter().map(|p| Circle::new(*p, width + 1, colour.filled())))?;
        // The name stands right of the point of the longest time.
        if let Some(last) = points.iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
            let (x, y) = axes.backend_coord(last);
            names.push((x + 12, y, name, *colour));
        }
    }
    apart(&mut names);
    let (left, top) = area.get_base_pixel();
    for (x, y, name, colour) in names {
        let style = ("sans-serif", TEXT).into_font().color(&colour).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(name.as_str(), (x - left, y - top), style))?;
    }
    Ok(())
}

/// Moves names that would cover each other down, in the order of their heights.
fn apart<T: AsRef<str>>(names: &mut [(i32, i32, T, RGBColor)]) {
    names.sort_by_key(|name| name.1);
    let end = |name: &(i32, i32, T, RGBColor)| name.0 + LETTER * name.2.as_ref().chars().count() as i32;
    for k in 1..names.len() {
        let (above, below) = names.split_at_mut(k);
        let own = &mut below[0];
        for other in above.iter() {
            if own.0 < end(other) && other.0 < end(own) && own.1 < other.1 + LINE {
                own.1 = other.1 + LINE;
            }
        }
    }
}

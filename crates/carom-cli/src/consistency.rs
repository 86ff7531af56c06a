//! `carom consistency`: whether measured restitutions and energies can come from a frictionless impact.

use crate::error::CliError;
use crate::files;
use crate::output::{answer, short, write_whole};
use carom_evidence::consistency::{Findings, MeasuredRow, Range, Rounded, consistency, read_measured, v_plot};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;

/// Test whether measured restitutions and energies can come from a frictionless impact
///
/// For a rigid, frictionless impact with Newton's coefficient e, at the angle α between path and
/// surface, E = √(T⁺/T⁻) obeys Y = √((1−e²)/(1−E²) − 1) = |cot α − h|/√D: over cot α a V with two
/// parameters h and D of the pose (Pagilla & Yu 2004, eqs. (10) to (16)). A row of measurements is
/// consistent if some V passes through all its values within their rounding.
///
/// Input: a CSV table.
/// Output, for each row: the verdict; cot α, e, E and Y with its range; the implied tangential
/// velocity after the impact; the ranges of h and D; the best fit; single changes of one number
/// that would make the row consistent.
/// JSON keys: rows [{row, consistent, points, branches, fit {factor, h, d}, changes, directions,
///   verdict}]; an end of a range is left out if it is unbounded.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct ConsistencyCommand {
    /// Table with the columns row, angle_deg, newton, energy_root and, optionally, tangential
    ///
    /// row: name of the row that the line belongs to; angle_deg: α (degrees); newton: e, the
    /// ratio of normal velocities; energy_root: E; tangential: the observed change of the
    /// tangential velocity (grows, shrinks, reverses, shrinks or reverses, grows or shrinks).
    /// Lines that begin with # are comments.
    #[arg(value_name = "TABLE.csv", verbatim_doc_comment)]
    table: PathBuf,
    /// Half-width of the rounding of every number [default: half a unit of its last digit]
    #[arg(long, value_name = "HALF", allow_hyphen_values = true)]
    rounding: Option<f64>,
    /// Draw Y over cot α with the best fit of each row (SVG)
    #[arg(long, value_name = "X.svg")]
    svg: Option<PathBuf>,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    rows: Vec<Row<'a>>,
}

#[derive(Serialize)]
struct Row<'a> {
    row: &'a str,
    consistent: bool,
    points: Vec<Point>,
    branches: Vec<Branch>,
    fit: Fit,
    changes: Vec<Change>,
    #[serde(skip_serializing_if = "Option::is_none")]
    directions: Option<Directions>,
    verdict: Vec<String>,
}

#[derive(Serialize)]
struct Point {
    angle_deg: f64,
    cot: f64,
    newton: Printed,
    energy_root: Printed,
    #[serde(skip_serializing_if = "Option::is_none")]
    seen: Option<&'static str>,
    /// Left out where E < e, or E = 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    y: Option<f64>,
    /// Left out where E < e beyond the rounding.
    #[serde(skip_serializing_if = "Option::is_none")]
    y_range: Option<Bounds>,
    #[serde(skip_serializing_if = "Option::is_none")]
    implied: Option<Implied>,
}

#[derive(Serialize)]
struct Printed {
    value: f64,
    half_unit: f64,
}

/// A range; an end is left out where nothing bounds it.
#[derive(Serialize)]
struct Bounds {
    #[serde(skip_serializing_if = "Option::is_none")]
    least: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    most: Option<f64>,
}

#[derive(Serialize)]
struct Branch {
    below: usize,
    h: Bounds,
    d: Bounds,
}

#[derive(Serialize)]
struct Fit {
    factor: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    d: Option<f64>,
}

#[derive(Serialize)]
struct Implied {
    tangential_per_speed: Bounds,
    changes: Vec<&'static str>,
}

#[derive(Serialize)]
struct Change {
    angle_deg: f64,
    column: &'static str,
    from: f64,
    to: Vec<Bounds>,
}

#[derive(Serialize)]
struct Directions {
    agree: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    h: Option<Bounds>,
    #[serde(skip_serializing_if = "Option::is_none")]
    factor: Option<f64>,
}

impl From<Range> for Bounds {
    fn from(range: Range) -> Self {
        let end = |x: f64| x.is_finite().then_some(x);
        Self { least: end(range.least), most: end(range.most) }
    }
}

impl ConsistencyCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        files::check(std::slice::from_ref(&self.table), &[("--svg", self.svg.as_deref())])?;
        let rows = read_measured(&self.table, self.rounding)?;
        let found: Vec<(MeasuredRow, Findings)> =
            rows.into_iter().map(|row| (row.clone(), consistency(&row))).collect();
        let report = Report { rows: found.iter().map(|(row, findings)| told(row, findings)).collect() };
        // Written before the answer: if the picture cannot be written, nothing is printed.
        if let Some(path) = &self.svg {
            let svg = v_plot(&found).map_err(|e| CliError::Option(format!("{}: {e}", self.table.display())))?;
            write_whole(path, &svg)?;
        }
        let written = answer(out, &report, self.json, for_people);
        written.map_err(|refused| CliError::refused(&self.table, refused))
    }
}

fn told<'a>(row: &'a MeasuredRow, found: &Findings) -> Row<'a> {
    let printed = |x: &Rounded| Printed { value: x.value, half_unit: x.half_unit };
    let points = row.entries.iter().zip(&found.points).enumerate().map(|(k, (entry, point))| Point {
        angle_deg: entry.angle_deg,
        cot: point.cot,
        newton: printed(&entry.newton),
        energy_root: printed(&entry.energy_root),
        seen: entry.seen.map(|seen| seen.name()),
        y: point.y,
        y_range: point.range.map(Bounds::from),
        implied: found.implied.get(k).map(|implied| Implied {
            tangential_per_speed: implied.velocity.into(),
            changes: implied.changes.iter().map(|change| change.name()).collect(),
        }),
    });
    let change = |change: &carom_evidence::consistency::Change| {
        let entry = &row.entries[change.entry];
        Change {
            angle_deg: entry.angle_deg,
            column: change.column.name(),
            from: change.column.of(entry).value,
            to: change.to.iter().map(|range| (*range).into()).collect(),
        }
    };
    Row {
        row: &row.name,
        consistent: found.consistent(),
        points: points.collect(),
        branches: found.branches.iter().map(|b| Branch { below: b.below, h: b.h.into(), d: b.d.into() }).collect(),
        fit: Fit {
            factor: found.fit.factor,
            h: found.fit.h_and_d.map(|(h, _)| h),
            d: found.fit.h_and_d.map(|(_, d)| d),
        },
        changes: found.changes.iter().map(change).collect(),
        directions: found.directions.map(|seen| Directions {
            agree: seen.agree(),
            h: seen.h.map(Bounds::from),
            factor: seen.factor,
        }),
        verdict: found.verdict(row),
    }
}

fn for_people(report: &Report, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "Y = √((1−e²)/(1−E²) − 1) of a frictionless impact is |cot α − h|/√D: a V over cot α.")?;
    for row in &report.rows {
        writeln!(out)?;
        writeln!(out, "{}: {}", row.row, if row.consistent { "consistent" } else { "NOT consistent" })?;
        writeln!(
            out,
            "{:>8} {:>9} {:>7} {:>7} {:>9}   {:19}   tangential velocity: v_t⁺/V and its change",
            "angle", "cot α", "e", "E", "Y", "Y within rounding"
        )?;
        for point in &row.points {
            let number = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| format!("{x:.5}"));
            let range = |bounds: &Bounds, no: &str| match (bounds.least, bounds.most) {
                (Some(least), Some(most)) if least == most => format!("{least:.4}"),
                (least, most) => {
                    let end = |x: Option<f64>| x.map_or_else(|| no.to_owned(), |x| format!("{x:.4}"));
                    format!("{} … {}", end(least), end(most))
                }
            };
            let y = point.y_range.as_ref().map_or_else(|| "none: E < e".into(), |y| range(y, "∞"));
            let implied = point.implied.as_ref().map_or_else(String::new, |implied| {
                format!("{:19} {}", range(&implied.tangential_per_speed, "unbounded"), implied.changes.join(" or "))
            });
            let seen = point.seen.map_or_else(String::new, |seen| format!(" (seen: {seen})"));
            writeln!(
                out,
                "{:>8} {:>9.5} {:>7} {:>7} {:>9}   {y:19}   {implied}{seen}",
                point.angle_deg,
                point.cot,
                point.newton.value,
                point.energy_root.value,
                number(point.y)
            )?;
        }
        if let (false, Some(h), Some(d)) = (row.consistent, row.fit.h, row.fit.d) {
            writeln!(out, "  (tangential velocities are those of the best fit: h = {}, D = {})", short(h), short(d))?;
        }
        for sentence in &row.verdict {
            writeln!(out, "  - {sentence}")?;
        }
    }
    writeln!(out)?;
    writeln!(
        out,
        "Tested is the table against eqs. (10) to (16) only: a rigid, frictionless impact with Newton's coefficient."
    )
}

//! `carom consistency`: whether measured restitutions and energies can come from a frictionless impact.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::output::{answer_about, write_whole};
use carom_evidence::consistency::{Findings, consistency, print, read_measured, v_plot};
use clap::Args;
use serde::Serialize;
use std::io::Write;
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
    /// Draw Y over cot α with the best fit of each row (.svg)
    #[arg(short, long, alias = "svg", value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    rows: Vec<Findings>,
}

impl ConsistencyCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let outputs = Outputs::of(self.out.as_slice(), &[Kind::Picture])?;
        files::check(std::slice::from_ref(&self.table), &outputs.files())?;
        let rows = read_measured(&self.table, self.rounding)?;
        let report = Report { rows: rows.iter().map(consistency).collect() };
        // Written before the answer: if the picture cannot be written, nothing is printed.
        if let Some(path) = &outputs.picture {
            let svg = v_plot(&report.rows).map_err(|e| CliError::Input(format!("{}: {e}", self.table.display())))?;
            write_whole(path, &svg)?;
        }
        answer_about(&self.table, out, &report, self.json, |report, out| print(&report.rows, out))
    }
}

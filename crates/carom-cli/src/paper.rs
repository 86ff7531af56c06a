//! `carom paper`: the figures and the table of Pagilla & Yu (2004), computed for the preset arm.

use crate::error::CliError;
use crate::files;
use crate::output::answer;
use carom_evidence::paper::{Paper, PaperError, stand_in};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;

/// Compute Figures 4 to 10 and Table I of Pagilla & Yu (2004) for the preset arm
///
/// The paper prints no inertia and no joint angles, so the arm robots/planar2.urdf stands in for
/// the authors' robot: 2 elbow poses × 4 approach angles × 3 speeds, without friction, with the
/// restitutions of Table I.
///
/// Output: figures (SVG), their numbers (CSV) and report.md in --out; and each claim of the paper,
/// with whether the model confirms it and the numbers that show it.
/// JSON keys: arm, stand_in, files, claims [{place, statement, confirmed, evidence}],
///   impacts [{elbow, speed (m/s), angle_deg, newton, tangential and normal ([before, after], m/s),
///   energy_loss (J), energy_root = √(T⁺/T⁻), coupling, change}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct PaperCommand {
    /// Folder to write to: new, empty, or of an earlier report, which is replaced
    ///
    /// It is made if it is missing; its parent must exist. A folder that holds anything else, or
    /// only some of the files of a report, is refused.
    #[arg(long, value_name = "DIR", verbatim_doc_comment)]
    out: PathBuf,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    arm: &'a str,
    stand_in: bool,
    files: Vec<String>,
    claims: Vec<Claim<'a>>,
    impacts: Vec<Impact>,
}

#[derive(Serialize)]
struct Claim<'a> {
    place: &'a str,
    statement: &'a str,
    confirmed: bool,
    evidence: &'a str,
}

/// One impact of the experiment. Tangential: down the wall; normal: off the wall.
#[derive(Serialize)]
struct Impact {
    elbow: &'static str,
    speed: f64,
    angle_deg: f64,
    newton: f64,
    tangential: [f64; 2],
    normal: [f64; 2],
    energy_loss: f64,
    energy_root: f64,
    coupling: f64,
    change: &'static str,
}

impl PaperCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        files::check_folder("--out", &self.out)?;
        let arm = stand_in().map_err(PaperError::from)?;
        let paper = Paper::of(&arm)?;
        paper.write(&self.out)?;
        let written = answer(out, &report(&paper), self.json, |report, out| for_people(report, &self.out, out));
        written.map_err(|refused| CliError::refused(&self.out, refused))
    }
}

fn report(paper: &Paper) -> Report<'_> {
    let impacts = paper.runs.iter().map(|run| Impact {
        elbow: run.elbow.name(),
        speed: run.speed,
        angle_deg: run.angle_deg,
        newton: run.restitution,
        tangential: run.tangential().into(),
        normal: run.normal().into(),
        energy_loss: run.hit.energy_loss(),
        energy_root: run.hit.energy_ratio().sqrt(),
        coupling: run.coupling,
        change: run.tangential_change().name(),
    });
    let claims = paper.claims.iter().map(|claim| Claim {
        place: claim.place,
        statement: &claim.statement,
        confirmed: claim.holds,
        evidence: &claim.evidence,
    });
    Report {
        arm: &paper.arm,
        stand_in: true,
        files: Paper::files(),
        claims: claims.collect(),
        impacts: impacts.collect(),
    }
}

fn for_people(report: &Report, folder: &std::path::Path, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "Claims of the paper, and whether {} confirms them (a stand-in, not the authors' arm):", report.arm)?;
    for claim in &report.claims {
        let verdict = if claim.confirmed { "yes" } else { "NO " };
        writeln!(out, "  {verdict} {}", claim.statement)?;
        writeln!(out, "      {}", claim.evidence)?;
    }
    writeln!(
        out,
        "Figures 4 to 10, Table I, the numbers behind them and the report: {}",
        folder.join("report.md").display()
    )
}

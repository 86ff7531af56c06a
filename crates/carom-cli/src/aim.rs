//! `carom aim`: numbers of a scene that are chosen such that its motion meets conditions, at least cost.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::motion::write_motion;
use crate::output::{Bar, Printed, answer_about, brief, warn, write_whole};
use crate::record::Record;
use carom_study::aim::{AimError, Found, Problem, Starts};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Choose numbers of a scene such that its motion meets conditions, at least cost
///
/// Input: a problem (TOML) that names a scene, its unknowns (numbers of the scene, formulas of them,
/// torques over time), conditions on the end of the motion and on its impacts, and costs. The search
/// uses the derivatives of the whole motion through its impacts.
///
/// Output: each unknown at the start of the search and as it was found, the conditions, the cost,
/// the events, the steps. It is an error if a condition is not met. --out writes the scene with what
/// was found, its motion as a table, or a recording.
/// JSON keys: unknowns [{name, first, found, at_bound}], conditions [{name, value, miss}], cost,
///   events [{time, what}], steps [{miss, cost, change, events}], runs, differentiated, end (met,
///   least, kink, steps); with --starts also starts {count, reached, failed {reason: number}}.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct AimCommand {
    /// Problem (TOML file)
    #[arg(value_name = "PROBLEM.toml")]
    problem: PathBuf,
    /// Search N times from random values of the unknowns between their bounds, and keep the least cost
    ///
    /// Each search begins at the nearest to the aim of 20 draws. Without a cost the first that meets the
    /// conditions is kept. Every unknown needs bounds.
    #[arg(long, value_name = "N", verbatim_doc_comment, value_parser = clap::value_parser!(u64).range(1..))]
    starts: Option<u64>,
    /// Seed of the random starts
    #[arg(long, value_name = "SEED", default_value_t = 0, requires = "starts")]
    seed: u64,
    /// File to write, of the kind that the ending of its name says; may be repeated
    ///
    /// .toml: the scene with what was found; torques over time are in a table X.torques.csv beside it.
    /// .csv, .parquet: the motion as a table. .rrd: a recording for the Rerun viewer; needs a carom that
    /// is built with the feature `rerun`. With - the table is on standard output as CSV, in place of the
    /// answer.
    #[arg(short, long, value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Answer {
    #[serde(flatten)]
    found: Found,
    #[serde(skip_serializing_if = "Option::is_none")]
    starts: Option<Starts>,
}

impl AimCommand {
    pub fn run(mut self, out: &mut dyn Write) -> Result<(), CliError> {
        let outputs = Outputs::of(&self.out, &[Kind::Scene, Kind::Table, Kind::Recording])?;
        self.record.check(outputs.recording.as_deref())?;
        let problem = Problem::from_file(&self.problem).map_err(|e| self.refuse(e))?;
        warn(&self.problem, &problem.warnings);
        let printed = Printed::of(outputs.tables.iter().map(PathBuf::as_path), self.json)?;
        let torques =
            outputs.scene.as_ref().filter(|_| problem.has_torques()).map(|path| path.with_extension("torques.csv"));
        let mut writes = outputs.files();
        writes.push(("--out", torques.as_deref()));
        files::check(&problem.files, &writes)?;
        files::clear_when_interrupted();
        let (found, starts) = match self.starts {
            None => (problem.solve().map_err(|e| self.refuse(e))?, None),
            Some(count) => {
                let bar = Bar::new(Some(count), "{elapsed:>5} {bar:30} {pos}/{len} starts");
                let found = problem.solve_from_many(count, self.seed, &|| bar.inc(1));
                let (found, starts) = found.map_err(|e| self.refuse(e))?;
                (found, Some(starts))
            }
        };
        if let Some(path) = &outputs.scene {
            let name =
                torques.as_ref().and_then(|path| path.file_name()).unwrap_or_default().to_string_lossy().into_owned();
            let folder = path.parent().unwrap_or(Path::new("."));
            let (scene, table) = problem.scene_of(&found, folder, &name).map_err(|e| self.refuse(e))?;
            if let (Some(path), Some(table)) = (&torques, table) {
                write_whole(path, &table)?;
            }
            write_whole(path, &scene)?;
        }
        let tables: Vec<&Path> = outputs.tables.iter().map(|path| printed.place(path)).collect();
        let (scene, plan) = problem.plan_of(&found).map_err(|e| self.refuse(e))?;
        write_motion((&self.problem, &scene), (&plan, scene.duration), &tables, &self.record)?;
        if printed.is_asked() {
            return printed.print(out);
        }
        answer_about(&self.problem, out, &Answer { found, starts }, self.json, print)
    }

    fn refuse(&self, error: AimError) -> CliError {
        match error {
            AimError::Run(error) => CliError::scene(&self.problem, error),
            AimError::File { ref file, .. } if *file == self.problem.display().to_string() => {
                CliError::Input(error.to_string())
            }
            other => CliError::Input(format!("{}: {other}", self.problem.display())),
        }
    }
}

/// Unknowns that are printed; the others are in the JSON answer and in the files.
const PRINTED: usize = 40;

fn print(answer: &Answer, out: &mut dyn Write) -> io::Result<()> {
    let Answer { found, starts } = answer;
    writeln!(
        out,
        "{}; {} steps, {} runs, {} of them with derivatives",
        found.end.text(),
        found.steps.len(),
        found.runs,
        found.differentiated
    )?;
    if let Some(Starts { count, reached, failed }) = starts {
        writeln!(out, "{reached} of {count} starts reach the aim")?;
        failed.iter().try_for_each(|(why, count)| writeln!(out, "  {count}: {why}"))?;
    }
    writeln!(out)?;
    let shown = &found.unknowns[..found.unknowns.len().min(PRINTED)];
    let width = shown.iter().map(|own| own.name.chars().count()).max().unwrap_or_default();
    writeln!(out, "{:width$}  {:>14}  {:>14}", "unknown", "at the start", "found")?;
    for own in shown {
        let bound = if own.at_bound { "  at its bound" } else { "" };
        writeln!(out, "{:width$}  {:>14}  {:>14.8}{bound}", own.name, brief(own.first), own.found)?;
    }
    if found.unknowns.len() > shown.len() {
        writeln!(out, "and {} more: --json or --out lists them", found.unknowns.len() - shown.len())?;
    }
    writeln!(out)?;
    for own in &found.conditions {
        writeln!(out, "{}: {:.10}, off by {:.0e}", own.name, own.value, own.miss)?;
    }
    if found.cost != 0.0 {
        writeln!(out, "cost: {:.10}", found.cost)?;
    }
    writeln!(out)?;
    writeln!(out, "step  largest miss            cost     change  events")?;
    for (k, step) in found.steps.iter().enumerate() {
        let events = step.events.join(", ");
        let line = format!("{:4}  {:12.1e}  {:14.7}  {:9.1e}  {events}", k + 1, step.miss, step.cost, step.change);
        writeln!(out, "{}", line.trim_end())?;
    }
    writeln!(out)?;
    writeln!(out, "events:")?;
    found.events.iter().try_for_each(|event| writeln!(out, "  {:>12.9} s  {}", event.time, event.what))
}

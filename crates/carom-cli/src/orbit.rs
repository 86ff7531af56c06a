//! `carom orbit`: periodic orbits, their stability, and branches of them.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::output::{Printed, answer, brief, progress, say, write_whole};
use crate::plan::moving_joints;
use crate::record::{Record, Recorder};
use crate::simulate::Tables;
use carom_sim::{Moment, Plan, Sampling, Seen};
use carom_study::orbit::{Branch, Orbit, OrbitError, Problem, Special};
use carom_study::state_columns;
use clap::Args;
use rayon::prelude::*;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Find a periodic orbit, its stability, and how it changes with a parameter
///
/// Input: a problem (TOML) that names a scene, the section at which a period begins and ends (an
/// impact of a contact, a linear function of the state that passes zero, or a time), and what need
/// not return or exchanges its role. Newton's method, with the derivative of the motion through its
/// impacts, finds the orbit near the start of the scene.
///
/// Output: the state on the section, the period, the events, and the multipliers: the factors by
/// which small disturbances grow in each period. The orbit is stable if all are below 1 in size.
/// With --branch the orbit is followed over the parameter of [vary], and folds, flips,
/// Neimark-Sacker points and changes of the sequence of events are located. With --cycles no orbit
/// is looked for: the motion runs from the start of the scene at each value of the parameter.
/// JSON keys: joints, start {q, qd}, period, events [{time, what}], multipliers [[re, im]],
///   stability, residual, iterations; with --branch: parameter, points [{parameter, as above}],
///   special [{kind, parameter, what, after}], end; with --cycles: values, rows, failed.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct OrbitCommand {
    /// Problem (TOML file)
    #[arg(value_name = "PROBLEM.toml")]
    problem: PathBuf,
    /// Follow the orbit over the parameter of [vary]
    #[arg(long, conflicts_with = "cycles")]
    branch: bool,
    /// Run N cycles at each of --values values of the parameter, after --skip cycles
    #[arg(long, value_name = "N", requires = "out", value_parser = clap::value_parser!(u64).range(1..))]
    cycles: Option<u64>,
    /// Number of cycles before those that --cycles writes
    #[arg(long, value_name = "N", default_value_t = 0, requires = "cycles")]
    skip: u64,
    /// Number of values of the parameter, evenly from [vary] from to to
    #[arg(long, value_name = "N", default_value_t = 1, requires = "cycles", value_parser = clap::value_parser!(u64).range(1..))]
    values: u64,
    /// File to write, of the kind that the ending of its name says; may be repeated
    ///
    /// .csv, .parquet: the motion of one period, the branch, or the cycles as a table. .svg: a column
    /// of the branch over the parameter. .rrd: a recording of one period for the Rerun viewer; needs a
    /// carom that is built with the feature `rerun`. With - the table is on standard output as CSV, in
    /// place of the answer.
    #[arg(short, long, value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    /// Column of the branch that is drawn
    #[arg(long, value_name = "COLUMN", default_value = "multiplier.size", requires = "branch")]
    show: String,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Found<'a> {
    joints: Vec<&'a str>,
    #[serde(flatten)]
    orbit: &'a Orbit,
}

#[derive(Serialize)]
struct Cycles {
    values: u64,
    rows: u64,
    failed: u64,
}

/// Times of a table or recording of one period.
const SAMPLES: f64 = 200.0;

impl OrbitCommand {
    pub fn run(mut self, out: &mut dyn Write) -> Result<(), CliError> {
        let kinds: &[Kind] = match (self.branch, self.cycles) {
            (true, _) => &[Kind::Table, Kind::Picture],
            (_, Some(_)) => &[Kind::Table],
            _ => &[Kind::Table, Kind::Recording],
        };
        let outputs = Outputs::of(&self.out, kinds)?;
        self.record.check(outputs.recording.as_deref())?;
        if self.record.is_asked() && (self.branch || self.cycles.is_some()) {
            return Err(CliError::Option(
                "--connect and --spawn record one orbit: leave out --branch and --cycles".into(),
            ));
        }
        let problem = Problem::from_file(&self.problem).map_err(|e| self.refuse(e))?;
        for warning in &problem.warnings {
            say(&format!("warning: {}: {warning}", self.problem.display()));
        }
        let printed = Printed::of(outputs.tables.iter().map(PathBuf::as_path), self.json)?;
        files::check(&problem.files, &outputs.files())?;
        files::clear_when_interrupted();
        let tables: Vec<&Path> = outputs.tables.iter().map(|path| printed.place(path)).collect();
        if let Some(cycles) = self.cycles {
            let done = self.run_cycles(&problem, cycles as usize, &tables)?;
            if printed.is_asked() {
                return printed.print(out);
            }
            let written = answer(out, &done, self.json, |done, out| {
                writeln!(out, "{} rows: cycles at {} values of {}", done.rows, done.values, problem.parameter_name())?;
                if done.failed > 0 {
                    writeln!(out, "at {} values the motion does not return to the section", done.failed)
                } else {
                    Ok(())
                }
            });
            return written.map_err(|refused| CliError::refused(&self.problem, refused));
        }
        if self.branch {
            let branch = problem.branch().map_err(|e| self.refuse(e))?;
            let columns = problem.branch_columns();
            let mut table = Tables::begin(tables, &columns, &problem.scene.text)?;
            branch.points.iter().for_each(|point| table.row(&point.row()));
            table.finish()?;
            if let Some(path) = &outputs.picture {
                let Some(svg) = branch.diagram(&columns, &self.show).and_then(|diagram| diagram.svg()) else {
                    let names: Vec<&str> =
                        columns.iter().filter(|it| it.words.is_empty()).map(|it| it.name.as_str()).collect();
                    return Err(CliError::Option(format!(
                        "--show {}: the columns of the branch are {}",
                        self.show,
                        names.join(", ")
                    )));
                };
                write_whole(path, &svg)?;
            }
            if printed.is_asked() {
                return printed.print(out);
            }
            let written = answer(out, &branch, self.json, print_branch);
            return written.map_err(|refused| CliError::refused(&self.problem, refused));
        }
        let orbit = problem.find().map_err(|e| self.refuse(e))?;
        let plan = problem.plan_of(&orbit).map_err(|e| self.refuse(e))?;
        self.write_period(&problem, &orbit, &plan, &tables)?;
        if printed.is_asked() {
            return printed.print(out);
        }
        let found = Found { joints: moving_joints(&plan), orbit: &orbit };
        let names = problem.scene.simulation.state_names();
        let written = answer(out, &found, self.json, |found, out| print_orbit(found.orbit, &names, out));
        written.map_err(|refused| CliError::refused(&self.problem, refused))
    }

    fn refuse(&self, error: OrbitError) -> CliError {
        match error {
            OrbitError::Run(error) => CliError::scene(&self.problem, error),
            OrbitError::File { .. } => CliError::Scene(error.to_string()),
            other => CliError::Scene(format!("{}: {other}", self.problem.display())),
        }
    }

    /// The motion of one period, as tables and as a recording.
    fn write_period(&self, problem: &Problem, orbit: &Orbit, plan: &Plan, tables: &[&Path]) -> Result<(), CliError> {
        if tables.is_empty() && !self.record.is_asked() {
            return Ok(());
        }
        let refuse = |e| CliError::scene(&self.problem, e);
        let columns = state_columns(&plan.simulation.chain);
        let mut table = Tables::begin(tables.iter().copied(), &columns, &problem.scene.text)?;
        let mut recorder = Recorder::begin(&self.record, &problem.scene, plan)?;
        let sampling = Sampling { every: Some(orbit.period / SAMPLES), ..Sampling::default() };
        let run = plan.stream(orbit.period, sampling, &mut |seen| {
            if let Seen::Moment(Moment { time, q, qd }) = &seen {
                table.row(&[&[*time], q.as_slice(), qd].concat());
            }
            if let Some(recorder) = &mut recorder {
                recorder.see(seen);
            }
        });
        let run = run.map_err(refuse)?;
        table.finish()?;
        recorder.map_or(Ok(()), |recorder| recorder.finish(&run))
    }

    /// The table of cycles.
    fn run_cycles(&self, problem: &Problem, cycles: usize, tables: &[&Path]) -> Result<Cycles, CliError> {
        let [from, to] = match problem.range() {
            Some(range) => range,
            None if self.values == 1 => [f64::NAN; 2],
            None => {
                return Err(CliError::Option(
                    "--values: the problem has no [vary]: give it parameter, from and to".into(),
                ));
            }
        };
        let columns = problem.cycle_columns();
        let mut table = Tables::begin(tables.iter().copied(), &columns, &problem.scene.text)?;
        let value =
            |k: u64| if self.values == 1 { from } else { from + (to - from) * k as f64 / (self.values - 1) as f64 };
        let bar = progress(self.values, "{elapsed:>5} {bar:30} {pos}/{len} values");
        let mut done = Cycles { values: self.values, rows: 0, failed: 0 };
        // Of so many values at a time, so that memory does not grow with their number.
        for first in (0..self.values).step_by(256) {
            let last = (first + 256).min(self.values);
            let found: Vec<_> = (first..last)
                .into_par_iter()
                .map(|k| {
                    bar.inc(1);
                    problem.cycle_rows(value(k), self.skip as usize, cycles)
                })
                .collect();
            for (k, found) in (first..last).zip(found) {
                let (rows, error) = found.map_err(|e| self.refuse(e))?;
                if let Some(error) = error {
                    if done.failed == 0 {
                        let name = problem.parameter_name();
                        say(&format!("warning: {}: {name} = {}: {error}", self.problem.display(), value(k)));
                    }
                    done.failed += 1;
                }
                done.rows += rows.len() as u64;
                rows.iter().for_each(|row| table.row(row));
            }
        }
        bar.finish_and_clear();
        table.finish()?;
        Ok(done)
    }
}

fn print_orbit(orbit: &Orbit, names: &[String], out: &mut dyn Write) -> io::Result<()> {
    let what = orbit.stability.name();
    writeln!(
        out,
        "{what} orbit of period {} s, found in {} steps; P(x) - x is {:.0e}",
        orbit.period, orbit.iterations, orbit.residual
    )?;
    writeln!(out)?;
    writeln!(out, "state on the section:")?;
    let numbers = orbit.start.q.iter().chain(&orbit.start.qd);
    if names.len() == orbit.start.q.len() + orbit.start.qd.len() {
        let width = names.iter().map(|name| name.chars().count()).max().unwrap_or_default();
        names.iter().zip(numbers).try_for_each(|(name, x)| writeln!(out, "  {name:width$}  {x:>19.13}"))?;
    } else {
        writeln!(out, "  q  {:?}\n  qd {:?}", orbit.start.q, orbit.start.qd)?;
    }
    writeln!(out)?;
    writeln!(out, "events:")?;
    orbit.events.iter().try_for_each(|event| writeln!(out, "  {:>12.9} s  {}", event.time, event.what))?;
    writeln!(out)?;
    writeln!(out, "multipliers, of small disturbances in each period:")?;
    let counts = orbit.multipliers.iter().take_while(|x| x.norm() > ZERO).count();
    for x in &orbit.multipliers[..counts] {
        let imaginary = if x.im == 0.0 {
            String::new()
        } else {
            format!(" {} {:.9} i", if x.im < 0.0 { '-' } else { '+' }, x.im.abs())
        };
        writeln!(out, "  {:>12.9}{imaginary:18}  |.| {:.9}", x.re, x.norm())?;
    }
    match orbit.multipliers.len() - counts {
        0 => Ok(()),
        zeros => writeln!(out, "  and {zeros} of zero: directions that contacts and the section forbid"),
    }
}

/// Multipliers up to this are zero up to the error of derivatives.
const ZERO: f64 = 1e-7;

fn print_branch(branch: &Branch, out: &mut dyn Write) -> io::Result<()> {
    let name = &branch.parameter;
    writeln!(out, "{:>14}  {:>14}  {:>26}  stability", brief_head(name), "period, s", "largest multiplier")?;
    for point in &branch.points {
        let orbit = &point.orbit;
        let largest = orbit.multipliers.first().copied().unwrap_or_default();
        let sign = if largest.im < 0.0 { '-' } else { '+' };
        let text = if largest.im == 0.0 {
            format!("{:.6}", largest.re)
        } else {
            format!("{:.6} {sign} {:.6} i", largest.re, largest.im.abs())
        };
        writeln!(
            out,
            "{:>14}  {:>14.9}  {text:>26}  {}",
            brief(point.parameter),
            orbit.period,
            orbit.stability.name()
        )?;
    }
    writeln!(out)?;
    for Special { kind, parameter, what, .. } in &branch.special {
        writeln!(out, "{kind} at {name} = {parameter:.9}: {what}")?;
    }
    writeln!(out, "the branch ends at {}", branch.end)
}

/// A name of at most 14 characters.
fn brief_head(name: &str) -> String {
    if name.chars().count() <= 14 { name.to_owned() } else { name.chars().take(13).chain(['…']).collect() }
}

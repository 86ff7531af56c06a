//! `carom simulate --runs`: many runs of a scene with disturbances, as one table.

use crate::error::CliError;
use crate::files;
use crate::output::{Bar, answer_about, brief, say, short};
use crate::rows::RowOptions;
use carom_sim::{Plan, Scene, SimError};
use carom_study::{Covariance, Ensemble, PredictedTime, Runs, Spread};
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    runs: Runs,
    /// Rows that an interrupted run had left, and `--resume` took over: they are not among `runs`.
    resumed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance: Option<Covariance>,
}

/// What is asked of the runs of a scene.
pub struct Asked<'a> {
    /// Their number.
    pub runs: u64,
    pub rows: &'a RowOptions,
    /// The table to write.
    pub table: Option<&'a Path>,
    /// Whether the covariance of the end is told, too.
    pub covariance: bool,
    pub json: bool,
}

/// Runs a scene many times, or fewer if it is interrupted; one row of the table for each run.
pub fn run((file, scene, plan): (&Path, &Scene, &Plan), asked: &Asked, out: &mut dyn Write) -> Result<(), CliError> {
    let Asked { runs, rows: options, table, covariance, json } = *asked;
    let refuse = |error| match error {
        SimError::Scene { file: unnamed, rule } if unnamed.is_empty() => {
            CliError::Input(format!("{}: --runs: {rule}", file.display()))
        }
        other => CliError::scene(file, other),
    };
    let ensemble = Ensemble::new(scene, plan, runs).map_err(refuse)?;
    let no_covariance = |e: SimError| match e {
        SimError::Scene { file: unnamed, rule } if unnamed.is_empty() => {
            CliError::Input(format!("{}: --covariance: {rule}", file.display()))
        }
        e => CliError::Input(format!("{}: --covariance: {e}", file.display())),
    };
    if covariance {
        ensemble.check_covariance().map_err(no_covariance)?;
    }
    let (pool, stop) = (options.pool()?, files::interrupts());
    let rows = options.rows(&ensemble);
    let total = rows.end - rows.start;
    let ended = match table {
        Some(path) => options.write(&ensemble, (path, rows), (&pool, &stop)),
        None => {
            let bar = Bar::new(Some(total), "{elapsed:>5} {bar:30} {pos}/{len} runs, {eta} to go");
            pool.install(|| ensemble.for_each(rows, &stop, |_| bar.inc(1)));
            let count = ensemble.spread().runs;
            if count < total { Err(CliError::InterruptedRuns { count, runs: total }) } else { Ok(()) }
        }
    };
    // The answer of interrupted runs is that of those that are done.
    let there = match &ended {
        Err(CliError::Interrupted { rows, .. }) => *rows,
        Err(CliError::InterruptedRuns { count, .. }) => *count,
        Ok(()) => total,
        Err(_) => return ended,
    };
    let spread = ensemble.spread();
    if there == 0 {
        return ended;
    }
    // A table has their rows.
    if table.is_none() && spread.impacts.is_none() {
        let why = spread.first_refusal.unwrap_or_default();
        return Err(CliError::Input(format!("{}: all runs are refused; {why}", file.display())));
    }
    let covariance = covariance.then(|| ensemble.covariance()).transpose();
    let covariance = covariance.map_err(no_covariance)?;
    let report = Report { resumed: there - spread.runs, runs: spread, covariance };
    answer_about(file, out, &report, json, for_people)?;
    if let (Some(why), None) = (&report.runs.first_refusal, &report.runs.impacts) {
        say(&format!("warning: {}: all runs are refused; {why}", file.display()));
    }
    ended
}

fn for_people(report: &Report, out: &mut dyn Write) -> io::Result<()> {
    let Report { runs, resumed, covariance } = report;
    write!(out, "{} runs, {} refused", runs.runs, runs.refused)?;
    if *resumed > 0 {
        write!(out, "; {resumed} more are in the table, from before the interruption")?;
    }
    writeln!(out)?;
    if let Some(why) = &runs.first_refusal {
        writeln!(out, "the first refusal: {why}")?;
    }
    let lines = [
        ("impacts", runs.impacts),
        ("first impact, s", runs.first_impact),
        ("lost in impacts, J", runs.lost_in_impacts),
    ];
    for (name, spread) in lines {
        let Some(Spread { count, mean, deviation, least, most }) = spread else { continue };
        let [mean, deviation, least, most] = [mean, deviation, least, most].map(short);
        writeln!(
            out,
            "{name:>22}: mean {mean}, standard deviation {deviation}, from {least} to {most} ({count} runs)"
        )?;
    }
    writeln!(out, "{:>22}: in {} runs", "other events than run 0", runs.other_events)?;
    covariance.as_ref().map_or(Ok(()), |it| covariance_for_people(it, out))
}

fn covariance_for_people(covariance: &Covariance, out: &mut dyn Write) -> io::Result<()> {
    let Covariance { names, sampled, linear, event_times, broken } = covariance;
    writeln!(out, "standard deviations of the end, of the runs and as the derivatives of run 0 predict them:")?;
    for (k, name) in names.iter().enumerate() {
        let predicted = linear.as_ref().map_or_else(|| "-".to_owned(), |rows| brief(rows[k][k].sqrt()));
        writeln!(out, "{name:>22}: {:>10} {predicted:>10}", brief(sampled[k][k].sqrt()))?;
    }
    for PredictedTime { kinds, time, deviation } in event_times {
        let Some(deviation) = deviation else { continue };
        writeln!(out, "time of {} at {} s: predicted {} s", kinds.join(", "), brief(*time), brief(*deviation))?;
    }
    broken.as_ref().map_or(Ok(()), |why| writeln!(out, "the end of run 0 has no derivatives: {why}"))
}

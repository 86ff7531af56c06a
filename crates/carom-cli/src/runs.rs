//! `carom simulate --runs`: many runs of a scene from disturbed starts, as one table.

use crate::error::CliError;
use crate::output::{answer, progress, short};
use carom_sim::{Plan, Scene};
use carom_study::{ALL_THE_SAME, SCENE_KEY, Table, TableError, ensemble, run_columns};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[derive(Serialize)]
struct Report {
    runs: u64,
    refused: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_refusal: Option<String>,
    impacts: Spread,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_impact: Option<Spread>,
    lost_in_impacts: Spread,
}

/// A number over the runs that have one.
#[derive(Serialize, Clone, Copy)]
struct Spread {
    count: u64,
    mean: f64,
    /// Standard deviation of the sample.
    deviation: f64,
    least: f64,
    most: f64,
}

/// Mean and variance by Welford's update.
#[derive(Default)]
struct Sample {
    count: u64,
    mean: f64,
    squares: f64,
    ends: Option<(f64, f64)>,
}

impl Sample {
    fn add(&mut self, x: f64) {
        self.count += 1;
        let off = x - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (x - self.mean);
        let (least, most) = self.ends.unwrap_or((x, x));
        self.ends = Some((least.min(x), most.max(x)));
    }

    fn spread(&self) -> Option<Spread> {
        let (least, most) = self.ends?;
        let deviation = (self.squares / (self.count.max(2) - 1) as f64).sqrt();
        Some(Spread { count: self.count, mean: self.mean, deviation, least, most })
    }
}

/// Runs a scene `runs` times, or fewer if `stop` is set meanwhile; one row of the table for each run.
pub fn run(
    (file, scene, plan): (&Path, &Scene, &Plan),
    (runs, stop): (u64, &AtomicBool),
    table: Option<&Path>,
    json: bool,
    out: &mut dyn Write,
) -> Result<(), CliError> {
    if scene.perturbation.is_none() {
        return Err(CliError::Scene(format!("{}: --runs: {ALL_THE_SAME}", file.display())));
    }
    let names = run_columns(scene, plan);
    let mut table = table.map(|path| Table::create_with(path, &names)).transpose()?;
    table.iter_mut().for_each(|table| table.describe(SCENE_KEY, &scene.text));
    let (mut refused, mut first_refusal) = (0, None);
    let (mut impacts, mut first_impact, mut lost) = (Sample::default(), Sample::default(), Sample::default());
    let bar = progress(runs, "{elapsed:>5} {bar:30} {pos}/{len} runs, {eta} to go");
    let mut count = 0;
    let done = ensemble((scene, plan), runs, stop, |run| {
        bar.inc(1);
        count += 1;
        match &run.result {
            Ok(summary) => {
                impacts.add(run.impacts as f64);
                run.first_impact.iter().for_each(|time| first_impact.add(*time));
                lost.add(summary.energy.impacts);
            }
            Err(error) => {
                refused += 1;
                first_refusal.get_or_insert(format!("run {}: {error}", run.number));
            }
        }
        table.as_mut().map_or(Ok::<(), TableError>(()), |table| table.row(&run.row(names.len())))
    });
    bar.finish_and_clear();
    done?;
    let interrupted = count < runs;
    if interrupted && count == 0 {
        return Err(CliError::InterruptedRuns { count, runs, place: String::new() });
    }
    let (Some(impacts), Some(lost_in_impacts)) = (impacts.spread(), lost.spread()) else {
        let why = first_refusal.unwrap_or_default();
        return Err(CliError::Scene(format!("{}: all runs are refused; {why}", file.display())));
    };
    let mut place = String::new();
    match table {
        Some(table) if interrupted => {
            let (partial, rows) = table.finish_partial()?;
            place = format!("; the table of the first {rows} is {}", partial.display());
        }
        Some(table) => table.finish()?,
        None => {}
    }
    let first_impact = first_impact.spread();
    let report = Report { runs: count, refused, first_refusal, impacts, first_impact, lost_in_impacts };
    let written = answer(out, &report, json, |report, out| {
        writeln!(out, "{} runs, {} refused", report.runs, report.refused)?;
        if let Some(why) = &report.first_refusal {
            writeln!(out, "the first refusal: {why}")?;
        }
        let mut line = |name: &str, it: Spread| {
            writeln!(
                out,
                "{name:>22}: mean {}, standard deviation {}, from {} to {} ({} runs)",
                short(it.mean),
                short(it.deviation),
                short(it.least),
                short(it.most),
                it.count
            )
        };
        line("impacts", report.impacts)?;
        report.first_impact.map_or(Ok(()), |it| line("first impact, s", it))?;
        line("lost in impacts, J", report.lost_in_impacts)
    });
    written.map_err(|refused| CliError::refused(file, refused))?;
    if interrupted { Err(CliError::InterruptedRuns { count, runs, place }) } else { Ok(()) }
}

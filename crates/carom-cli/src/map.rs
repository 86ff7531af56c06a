//! `carom map`: a study, from its file to its map.

use crate::error::CliError;
use crate::output::{answer, say};
use carom_study::Study;
use carom_study::study::{MapFile, Written};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Args)]
pub struct MapCommand {
    /// The study, TOML
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Write the map, .csv or .parquet
    #[arg(long, value_name = "X.parquet|csv")]
    out: Option<PathBuf>,
    /// Threads; as many as the machine has cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Write only part I of N (counted from 1); the parts, one after another, are the whole
    #[arg(long, value_name = "I/N", value_parser = parse_shard, requires = "out")]
    shard: Option<(u64, u64)>,
    /// Go on with what an interrupted run left, if it left something
    #[arg(long, requires = "out")]
    resume: bool,
    /// One line of JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Summary<'a> {
    study: String,
    rows: u64,
    columns: Vec<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
}

fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
    match numbers {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err("write part/parts, counted from 1, like 3/64".into()),
    }
}

impl MapCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let study = Study::from_file(&self.study)?;
        for warning in &study.warnings {
            say(&format!("warning: {}: {warning}", self.study.display()));
        }
        let threads = self.threads.unwrap_or(0); // 0: as many as there are cores
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
        let pool = pool.map_err(|e| CliError::Option(format!("--threads: {e}")))?;
        let (part, parts) = self.shard.unwrap_or((1, 1));
        let rows = study.shard(part, parts).unwrap_or(0..study.rows());
        if let Some(path) = &self.out {
            let file = MapFile { path: path.clone(), rows: rows.clone(), resume: self.resume };
            self.write(&study, &file, &pool)?;
        }
        let summary = Summary {
            study: self.study.display().to_string(),
            rows: rows.end - rows.start,
            columns: study.columns().iter().map(|column| column.name.as_str()).collect(),
            out: self.out.as_deref().map(|path| path.display().to_string()),
        };
        let written = answer(out, &summary, self.json, |summary, out| for_people(&study, summary, out));
        written.map_err(|refused| CliError::refused(&self.study, refused))
    }

    fn write(&self, study: &Study, file: &MapFile, pool: &rayon::ThreadPool) -> Result<(), CliError> {
        let left = file.partial();
        if !self.resume && left.exists() {
            say(&format!("warning: {} is left of an interrupted run: --resume would go on with it", left.display()));
        }
        let total = file.rows.end - file.rows.start;
        let stop = interrupts();
        // drawn on a terminal, and not elsewhere
        let bar = ProgressBar::new(total);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {human_pos}/{human_len} rows, {per_sec}, {eta} left")
        {
            bar.set_style(style);
        }
        let written = pool.install(|| study.write(file, &|rows| bar.inc(rows), &stop));
        bar.finish_and_clear();
        match written? {
            Written::Whole => Ok(()),
            Written::Interrupted { rows, partial } => Err(CliError::Interrupted { rows, total, partial }),
        }
    }
}

/// A flag that an interruption (Ctrl-C, or the signal that ends a process) raises; the second one ends the process.
fn interrupts() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    let handler = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    });
    if let Err(e) = handler {
        say(&format!("warning: an interruption will leave nothing: {e}"));
    }
    stop
}

fn for_people(study: &Study, summary: &Summary, out: &mut dyn Write) -> io::Result<()> {
    for axis in study.axes().iter().filter(|axis| axis.varies()) {
        let (count, unit) = (axis.count(), axis.unit);
        if axis.names().is_empty() {
            let ends = [axis.value(0), axis.value(count - 1)];
            writeln!(out, "{:24} {count:>9} from {} to {} {unit}", axis.name, ends[0], ends[1])?;
        } else {
            writeln!(out, "{:24} {count:>9} {}", axis.name, axis.names().join(", "))?;
        }
    }
    writeln!(out, "{} rows of {}", summary.rows, summary.columns.join(", "))?;
    if let Some(path) = &summary.out {
        writeln!(out, "written to {path}")?;
    }
    Ok(())
}

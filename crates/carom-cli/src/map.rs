//! `carom map`: a study, from its file to its map.

use crate::error::CliError;
use crate::files;
use crate::output::{answer, say, short, write_whole};
use crate::record::check_map;
use carom_study::Study;
use carom_study::study::{Advice, MapFile, Written};
use clap::{ArgGroup, Args};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::{Map, Value};
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Args)]
#[command(group(ArgGroup::new("result").args(["out", "svg", "rrd", "advise"]).required(true).multiple(true)))]
pub struct MapCommand {
    /// The study, TOML
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Write the map, .csv or .parquet
    #[arg(long, value_name = "X.parquet|csv")]
    out: Option<PathBuf>,
    /// Draw a quantity of the whole map: a curve over one axis, a heat map over two, several over a third of few values
    #[arg(long, value_name = "X.svg", conflicts_with = "shard")]
    svg: Option<PathBuf>,
    /// Record a quantity of the whole map for the Rerun viewer: images, places of the tip, poses of the arm
    #[arg(long, value_name = "X.rrd", conflicts_with = "shard")]
    rrd: Option<PathBuf>,
    /// The column that is drawn and recorded; the first quantity if not given
    #[arg(long, value_name = "COLUMN")]
    show: Option<String>,
    /// Say which rows are best under the study's [advise], and what a redundant arm's self-motion adds
    #[arg(long, conflicts_with = "shard")]
    advise: bool,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    svg: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rrd: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<Advised<'a>>,
}

/// Advice as JSON.
#[derive(Serialize)]
struct Advised<'a> {
    column: &'a str,
    goal: &'static str,
    fulfil: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    best_median_worst: Option<[f64; 3]>,
    best: Vec<Best<'a>>,
}

#[derive(Serialize)]
struct Best<'a> {
    row: u64,
    q: &'a [f64],
    values: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    self_motion: Option<Moved<'a>>,
}

/// Where a self-motion leads.
#[derive(Serialize)]
struct Moved<'a> {
    q: &'a [f64],
    values: Map<String, Value>,
}

impl<'a> Advised<'a> {
    fn of(study: &Study, advice: &'a Advice) -> Self {
        let best = advice.best.iter().map(|it| Best {
            row: it.index,
            q: &it.q,
            values: named(study, &it.row, |_| true),
            self_motion: it
                .self_motion
                .as_ref()
                .map(|(q, row)| Moved { q, values: named(study, row, |k| k >= class(study)) }),
        });
        Self {
            column: &advice.column,
            goal: if advice.maximise { "maximise" } else { "minimise" },
            fulfil: advice.fulfil,
            best_median_worst: advice.spread,
            best: best.collect(),
        }
    }
}

/// Where the columns of the pose and the conditions end.
fn class(study: &Study) -> usize {
    study.columns().iter().position(|column| column.name == "class").unwrap_or_default()
}

/// A row by its columns' names; what has no value is left out.
fn named(study: &Study, row: &[f64], keep: impl Fn(usize) -> bool) -> Map<String, Value> {
    let columns = study.columns().iter().zip(row).enumerate().filter(|(k, _)| keep(*k));
    let cells = columns.filter_map(|(_, (column, x))| {
        let value = if column.words.is_empty() {
            Value::Number(serde_json::Number::from_f64(*x)?)
        } else {
            Value::String(column.spell(*x).to_owned())
        };
        Some((column.name.clone(), value))
    });
    cells.collect()
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
        check_map(self.rrd.as_deref())?;
        let study = Study::from_file(&self.study)?;
        let writes = [("--out", self.out.as_deref()), ("--svg", self.svg.as_deref()), ("--rrd", self.rrd.as_deref())];
        files::check(&study.files, &writes)?;
        for warning in &study.warnings {
            say(&format!("warning: {}: {warning}", self.study.display()));
        }
        let names: Vec<&str> = study.columns().iter().map(|column| column.name.as_str()).collect();
        let shown = self.show.as_deref().or(names.get(class(&study) + 1).copied()).unwrap_or("class");
        if !names.contains(&shown) {
            let names = names.join(", ");
            return Err(CliError::Option(format!(
                "--show {shown}: no column of this map is called so: it has {names}"
            )));
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
        if let Some(path) = &self.svg {
            let svg = pool.install(|| study.picture(shown))?;
            write_whole(path, &svg)?;
        }
        if let Some(path) = &self.rrd {
            pool.install(|| crate::record::record_map(&study, shown, path))?;
        }
        let advice = if self.advise { Some(pool.install(|| study.advise())?) } else { None };
        let summary = Summary {
            study: self.study.display().to_string(),
            rows: rows.end - rows.start,
            columns: names,
            out: self.out.as_deref().map(|path| path.display().to_string()),
            svg: self.svg.as_deref().map(|path| path.display().to_string()),
            rrd: self.rrd.as_deref().map(|path| path.display().to_string()),
            advice: advice.as_ref().map(|advice| Advised::of(&study, advice)),
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
    for path in summary.out.iter().chain(&summary.svg).chain(&summary.rrd) {
        writeln!(out, "written to {path}")?;
    }
    summary.advice.as_ref().map_or(Ok(()), |advice| advice.for_people(out))
}

impl Advised<'_> {
    fn for_people(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { column, goal, fulfil, best, .. } = self;
        writeln!(out, "\n{goal} {column}: {fulfil} rows fulfil the conditions")?;
        if let Some([best, median, worst]) = self.best_median_worst {
            writeln!(out, "best {}, median {}, worst {}", short(best), short(median), short(worst))?;
        }
        let cells = |values: &Map<String, Value>| {
            let cell = |(name, value): (&String, &Value)| match value {
                Value::Number(x) => format!("{name} {}", short(x.as_f64().unwrap_or(f64::NAN))),
                other => format!("{name} {}", other.as_str().unwrap_or_default()),
            };
            values.iter().map(cell).collect::<Vec<_>>().join(", ")
        };
        let pose = |q: &[f64]| q.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ");
        for (k, it) in best.iter().enumerate() {
            writeln!(out, "{}. row {}: q {}\n   {}", k + 1, it.row, pose(it.q), cells(&it.values))?;
            if let Some(moved) = &it.self_motion {
                writeln!(out, "   along the self-motion: q {}\n   {}", pose(moved.q), cells(&moved.values))?;
            }
        }
        Ok(())
    }
}

//! `carom map`: impact maps of a study.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::output::{answer_about, short, warn, write_whole};
use crate::record::{check_map, check_recording, record_map};
use crate::rows::RowOptions;
use carom_study::NumberedRows;
use carom_study::map_study::{Advice, Study};
use clap::{ArgGroup, Args};
use serde::Serialize;
use serde_json::{Map, Value};
use std::io::{self, Write};
use std::path::PathBuf;

/// Compute a map of impacts over poses, approach angles, speeds, coefficients and laws
///
/// Input: a study (TOML) that names the robot, the axes of the map (joint positions or tip
/// positions, approach angles, speeds, restitution, friction, normals, laws) and the quantities.
/// Output: one row for each combination of the values, with the columns of the axes, the class of
/// the row and the quantities. The last axis of the study varies fastest. At least one of --out and
/// --advise is needed; a summary is printed: the axes, the number of rows, the columns and the
/// files written.
/// JSON keys: study, rows, columns, out, svg, rrd, advice {column, goal, fulfil, best_median_worst,
///   best [{row, q, values, self_motion}]}.
/// An interruption (Ctrl-C) or a full disk keeps the rows that are done in X.partial.csv or
/// X.partial.parquet, with a note X.partial.csv.json or X.partial.parquet.json; the exit status is
/// 1, and --resume continues.
#[derive(Args)]
#[command(verbatim_doc_comment)]
#[command(override_usage = "carom map [OPTIONS] <--out <FILE>|--advise> <STUDY.toml>")]
#[command(group(ArgGroup::new("result").args(["out", "advise"]).required(true).multiple(true)))]
pub struct MapCommand {
    /// Study (TOML file)
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// File to write, of the kind that the ending of its name says; may be repeated
    ///
    /// .csv, .parquet: the map as a table. .svg: a picture of one column of the whole map: a curve over
    /// one axis, a heat map over two, one heat map for each value of a third axis. .rrd: a recording
    /// for the Rerun viewer, with images, tip positions in space and poses of the arm; needs a carom
    /// that is built with the feature `rerun`.
    #[arg(short, long, aliases = ["svg", "rrd"], value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    /// Column that is drawn and recorded [default: the first quantity of the study]
    #[arg(long, value_name = "COLUMN")]
    show: Option<String>,
    /// Draw the picture with a logarithmic scale of the column, whose numbers must be above 0
    #[arg(long, requires = "out")]
    log: bool,
    /// Print the best rows under the conditions in [advise] of the study
    ///
    /// These are local optima of the map: rows without a better neighbour on an axis of numbers, so
    /// that rows beside the best one are not listed. For a redundant arm also the best pose along the
    /// self-motion through each of these rows.
    #[arg(long, conflicts_with = "shard", verbatim_doc_comment)]
    advise: bool,
    #[command(flatten)]
    rows: RowOptions,
    /// Print the summary as one line of JSON
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
    /// The columns of conditions that vary.
    #[serde(skip)]
    conditions: Vec<&'a str>,
}

#[derive(Serialize)]
struct Best<'a> {
    row: u64,
    q: &'a [f64],
    values: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    self_motion: Option<Moved<'a>>,
}

/// The best pose along a self-motion.
#[derive(Serialize)]
struct Moved<'a> {
    q: &'a [f64],
    values: Map<String, Value>,
}

impl<'a> Advised<'a> {
    fn of(study: &'a Study, advice: &'a Advice) -> Self {
        let before = study.columns()[..class(study)].iter().map(|column| column.name.as_str());
        let conditions = before.filter(|name| !name.starts_with("q.")).collect();
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
            conditions,
        }
    }
}

/// Index of the column `class`, which follows the columns of the pose and the conditions.
fn class(study: &Study) -> usize {
    study.columns().iter().position(|column| column.name == "class").unwrap_or_default()
}

/// A row by the names of its columns; columns without a value are left out.
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

impl MapCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let files = Outputs::of(&self.out, &[Kind::Table, Kind::Picture, Kind::Recording])?;
        let table = self.rows.table(&files)?;
        check_recording(files.recording.as_deref())?;
        let study = Study::from_file(&self.study)?;
        files::check(&study.files, &files.files())?;
        warn(&self.study, &study.warnings);
        let names: Vec<&str> = study.columns().iter().map(|column| column.name.as_str()).collect();
        let shown = self.show.as_deref().or(names.get(class(&study) + 1).copied()).unwrap_or("class");
        if !names.contains(&shown) {
            let names = names.join(", ");
            return Err(CliError::Input(format!(
                "--show {shown}: this map has no such column: its columns are {names}"
            )));
        }
        if self.show.is_some() && files.picture.is_none() && files.recording.is_none() {
            let why = "nothing is drawn or recorded: give --out a name that ends in .svg or .rrd";
            return Err(CliError::Input(format!("--show {shown}: {why}")));
        }
        // What cannot be drawn, recorded or advised is refused before the map is computed.
        if files.picture.is_some() {
            study.check_picture(shown)?;
        }
        if self.log && files.picture.is_none() {
            return Err(CliError::Input("--log: no picture is written: give --out a name that ends in .svg".into()));
        }
        if files.recording.is_some() {
            check_map(&study, shown)?;
        }
        if self.advise {
            study.check_advice()?;
        }
        let pool = self.rows.pool()?;
        let rows = self.rows.rows(&study);
        if let Some(path) = table {
            self.rows.write(&study, (path, rows.clone()), (&pool, &files::interrupts()))?;
        }
        if let Some(path) = &files.picture {
            let svg = pool.install(|| study.picture(shown, self.log))?;
            write_whole(path, &svg)?;
        }
        if let Some(path) = &files.recording {
            pool.install(|| record_map(&study, shown, path))?;
        }
        let advice = if self.advise { Some(pool.install(|| study.advise())?) } else { None };
        let summary = Summary {
            study: self.study.display().to_string(),
            rows: rows.end - rows.start,
            columns: names,
            out: table.map(|path| path.display().to_string()),
            svg: files.picture.as_deref().map(|path| path.display().to_string()),
            rrd: files.recording.as_deref().map(|path| path.display().to_string()),
            advice: advice.as_ref().map(|advice| Advised::of(&study, advice)),
        };
        answer_about(&self.study, out, &summary, self.json, |summary, out| for_people(&study, summary, out))
    }
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
        writeln!(out)?;
        writeln!(out, "{goal} {column}: {fulfil} rows fulfil the conditions")?;
        if let Some([best, median, worst]) = self.best_median_worst {
            writeln!(out, "best {}, median {}, worst {}", short(best), short(median), short(worst))?;
        }
        // The conditions of the rows and the column, and where a self-motion leads; all other columns are in the JSON.
        let text = |values: &Map<String, Value>, name: &str| match values.get(name) {
            Some(Value::Number(x)) => short(x.as_f64().unwrap_or(f64::NAN)),
            Some(other) => other.as_str().unwrap_or_default().to_owned(),
            None => "-".to_owned(),
        };
        let moves = best.iter().any(|it| it.self_motion.is_some());
        let mut head: Vec<&str> = vec!["row"];
        head.extend(self.conditions.iter().copied());
        head.push(column);
        head.extend(moves.then_some("self-motion"));
        head.extend(["class", "q"]);
        let mut rows = vec![head.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>()];
        for it in best {
            let mut cells = vec![it.row.to_string()];
            cells.extend(self.conditions.iter().map(|name| text(&it.values, name)));
            cells.push(text(&it.values, column));
            let (q, values) = it.self_motion.as_ref().map_or((it.q, &it.values), |moved| (moved.q, &moved.values));
            cells
                .extend(moves.then(|| it.self_motion.as_ref().map_or("-".into(), |moved| text(&moved.values, column))));
            cells.extend([text(values, "class"), q.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ")]);
            rows.push(cells);
        }
        let width = |k: usize| rows.iter().map(|cells| cells[k].chars().count()).max().unwrap_or_default();
        for cells in &rows {
            let last = cells.len() - 1;
            for (k, cell) in cells[..last].iter().enumerate() {
                write!(out, "{cell:>0$}  ", width(k))?;
            }
            writeln!(out, "{}", cells[last])?;
        }
        Ok(())
    }
}

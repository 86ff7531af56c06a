//! `carom chart`: work–precision chart of a scene, and the rigid limit of its compliant contacts.

use crate::error::CliError;
use crate::files;
use crate::output::{to_json, write_whole};
use crate::scene::load;
use carom_evidence::chart::{
    Absent, Chart, MOST_LABELLED, PeerOutcome, PeerRun, Run, Stiffened, StiffnessChart, csv, from_csv, knob_value,
    labelled_svg, stiffness_svg, svg,
};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Chart error against run time for every method that can run a scene
///
/// Runs the scene with event-driven integrators (parameter: tolerance), time steps (step) and
/// compliant contacts (stiffness), and compares each run with a reference solution: an event-driven
/// run in space at the tightest tolerance. The error of the reference solution is estimated with a
/// second integrator.
///
/// Input: a scene (TOML); runs of other programs (--peers).
/// Output: a picture (SVG), the numbers (CSV) and a table: method, parameter, run time (ms, median),
/// error of qd right after the first impact, error of q and qd at the end (relative to the largest
/// entry, of qd at the end to the largest entry at an event or at the end), contact law; then the
/// methods that did not run, with the reason.
/// With --from instead: a picture of the chosen methods (--show) of a table that this command has
/// written, each line with its name beside it. Nothing is run.
/// With --stiffness instead: errors of the scene's compliant contacts against the same scene with
/// rigid ones, over a factor of all stiffnesses from 1 to 1e6, beside the order that theory gives.
/// JSON keys: law, runs [{method, law, knob, value, wall_time (s), after_impact, at_end}],
///   absent [{method, reason}], doubt_after_impact and doubt_at_end (errors of the reference
///   solution); with --stiffness: runs [{factor, after_impact, at_end}], order_after_impact,
///   order_at_end (over the two stiffest decades), theory.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct ChartCommand {
    /// Scene (TOML file)
    #[arg(value_name = "SCENE.toml", required_unless_present = "from", conflicts_with = "from")]
    scene: Option<PathBuf>,
    /// Picture to write; the numbers go to the file of the same name with the ending .csv
    #[arg(long, value_name = "X.svg")]
    out: PathBuf,
    /// Draw the numbers of a chart that was computed already, a CSV table of this command
    #[arg(long, value_name = "X.csv", requires = "show", conflicts_with_all = ["peers", "stiffness", "budget", "json"])]
    from: Option<PathBuf>,
    /// A method that --from draws, and its name in the picture; may be repeated up to seven times
    #[arg(long, value_name = "METHOD[=NAME]", requires = "from")]
    show: Vec<String>,
    /// Runs of other programs, one JSON object per line, in the format of benches/peers
    ///
    /// Lines of other scenes are skipped; the scene is recognised by the name of its file.
    #[arg(long, value_name = "F.jsonl", verbatim_doc_comment)]
    peers: Option<PathBuf>,
    /// Draw the error of compliant contacts against rigid ones over their stiffness
    ///
    /// The scene must have compliant contacts.
    #[arg(long, conflicts_with = "peers", verbatim_doc_comment)]
    stiffness: bool,
    /// Longest run time of a single run, s
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, allow_hyphen_values = true)]
    budget: f64,
    /// Print one line of JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A line of `--peers`; keys that a chart does not need are ignored.
#[derive(Deserialize)]
struct PeerLine {
    scene: String,
    peer: String,
    method: String,
    #[serde(default)]
    version: String,
    knob: String,
    value: f64,
    wall_time_s: Option<f64>,
    result: Option<PeerResult>,
    failure: Option<String>,
}

#[derive(Deserialize)]
struct PeerResult {
    r#final: PeerState,
    after_impact: Option<PeerState>,
}

#[derive(Deserialize)]
struct PeerState {
    q: Vec<f64>,
    qd: Vec<f64>,
}

#[derive(Serialize)]
struct Report<'a> {
    law: &'a str,
    runs: Vec<Line<'a>>,
    absent: Vec<Missing<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    doubt_after_impact: Option<f64>,
    doubt_at_end: f64,
}

#[derive(Serialize)]
struct Line<'a> {
    method: &'a str,
    law: &'a str,
    knob: &'a str,
    value: f64,
    wall_time: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    after_impact: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_end: Option<f64>,
}

#[derive(Serialize)]
struct Missing<'a> {
    method: &'a str,
    reason: &'a str,
}

impl ChartCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let budget = Duration::try_from_secs_f64(self.budget).ok().filter(|budget| !budget.is_zero());
        let Some(budget) = budget else {
            return Err(CliError::Option(format!("--budget {}: give a number of seconds above 0", self.budget)));
        };
        if self.out.extension().is_none_or(|ending| ending != "svg") {
            return Err(CliError::Option(format!("--out {}: give a file that ends in .svg", self.out.display())));
        }
        let title = |file: &Path| file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let file = match (&self.from, &self.scene) {
            (Some(table), _) => return self.redraw(table, &title(table)),
            (None, Some(scene)) => scene,
            // The parser requires one of the two.
            (None, None) => return Err(CliError::Option("give a scene, or a table by --from".into())),
        };
        let refuse = |e| CliError::scene(file, e);
        let scene = load(file)?;
        let title = title(file);
        let peers = self.peers.as_deref().map(|file| read_peers(file, &title)).transpose()?.unwrap_or_default();
        let numbers = self.out.with_extension("csv");
        let reads: Vec<PathBuf> = scene.files.iter().chain(&self.peers).cloned().collect();
        files::check(&reads, &[("--out", Some(&self.out)), ("the numbers of --out,", Some(&numbers))])?;

        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{elapsed:>5} {spinner} {pos} runs, {msg}") {
            bar.set_style(style);
        }
        if self.stiffness {
            let chart = StiffnessChart::of(&scene, budget, &mut || bar.inc(1)).map_err(refuse)?;
            bar.finish_and_clear();
            let Some(chart) = chart else {
                let rule = "--stiffness: the scene has no compliant contact: give [contact], a surface or a pair the key \
                            compliance";
                return Err(CliError::Option(rule.into()));
            };
            write_whole(&self.out, &stiffness_svg(&chart, &title))?;
            write_whole(&numbers, &chart.csv())?;
            return stiffness_report(&chart, self.json, out);
        }
        let mut chart = Chart::of(&scene, budget, &mut |method| {
            bar.set_message(method.to_owned());
            bar.inc(1);
        })
        .map_err(refuse)?;
        chart.add_peers(&peers);
        bar.finish_and_clear();
        write_whole(&self.out, &svg(&chart, &title))?;
        write_whole(&numbers, &csv(&chart))?;
        if self.json {
            writeln!(out, "{}", to_json(&report(&chart))?)?;
            return Ok(());
        }
        for_people(&chart, out)?;
        Ok(())
    }
}

impl ChartCommand {
    /// Draws the methods of `--show` from a table.
    fn redraw(&self, table: &Path, title: &str) -> Result<(), CliError> {
        files::check(&[table.to_owned()], &[("--out", Some(&self.out))])?;
        let name = || table.display().to_string();
        let text = std::fs::read_to_string(table).map_err(|reason| CliError::Unreadable { file: name(), reason })?;
        let runs = from_csv(&text).map_err(|reason| CliError::Option(format!("--from {}: {reason}", name())))?;
        if self.show.len() > MOST_LABELLED {
            return Err(CliError::Option(format!("--show: {} methods: give at most {MOST_LABELLED}", self.show.len())));
        }
        let mut shown = Vec::new();
        for one in &self.show {
            let (method, label) = one.split_once('=').unwrap_or((one, one));
            if !runs.iter().any(|run| run.method == method) {
                let mut known: Vec<&str> = runs.iter().map(|run| run.method.as_str()).collect();
                known.dedup();
                let known = known.join("; ");
                return Err(CliError::Option(format!("--show {method}: {} has no such method, but: {known}", name())));
            }
            shown.push((method.to_owned(), label.to_owned()));
        }
        write_whole(&self.out, &labelled_svg(&runs, &shown, title))
    }
}

fn read_peers(file: &Path, scene: &str) -> Result<Vec<PeerRun>, CliError> {
    let name = || file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|reason| CliError::Unreadable { file: name(), reason })?;
    let mut peers = Vec::new();
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let refuse = |reason: String| CliError::Line { file: name(), line: k + 1, reason };
        let line: PeerLine = serde_json::from_str(line).map_err(|e| refuse(e.to_string()))?;
        if line.scene != scene {
            continue;
        }
        let outcome = match (line.result, line.wall_time_s) {
            (Some(result), Some(wall_time)) if wall_time > 0.0 => Ok(PeerOutcome {
                wall_time,
                qd_after_impact: result.after_impact.map(|state| state.qd),
                at_end: (result.r#final.q, result.r#final.qd),
            }),
            (Some(_), Some(time)) => return Err(refuse(format!("wall_time_s is {time}: it must be positive"))),
            _ => Err(line.failure.unwrap_or_else(|| "the run has no result".to_owned())),
        };
        let method = format!("{} {}, {}", line.peer, line.version, line.method);
        peers.push(PeerRun { method, knob: line.knob, value: line.value, outcome });
    }
    Ok(peers)
}

#[derive(Serialize)]
struct StiffnessReport {
    runs: Vec<StiffnessLine>,
    #[serde(skip_serializing_if = "Option::is_none")]
    order_after_impact: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    order_at_end: Option<f64>,
    theory: f64,
}

#[derive(Serialize)]
struct StiffnessLine {
    factor: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    after_impact: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_end: Option<f64>,
}

fn stiffness_report(chart: &StiffnessChart, json: bool, out: &mut dyn Write) -> Result<(), CliError> {
    let (after, end) = (chart.order(|run| run.after_impact), chart.order(|run| run.at_end));
    if json {
        let line =
            |&Stiffened { factor, after_impact, at_end }: &Stiffened| StiffnessLine { factor, after_impact, at_end };
        let runs = chart.runs.iter().map(line).collect();
        let report = StiffnessReport { runs, order_after_impact: after, order_at_end: end, theory: chart.theory };
        writeln!(out, "{}", to_json(&report)?)?;
        return Ok(());
    }
    writeln!(out, "{:>10} {:>12} {:>10}", "factor", "after impact", "at the end")?;
    for run in &chart.runs {
        let (after, end) = (number(run.after_impact), number(run.at_end));
        writeln!(out, "{:>10} {after:>12} {end:>10}", knob_value(run.factor))?;
    }
    let order = |order: Option<f64>| order.map_or_else(|| "–".to_owned(), |order| format!("{order:.3}"));
    writeln!(out, "order {:>17} {:>10}; in theory {:.3}", order(after), order(end), chart.theory)?;
    Ok(())
}

fn number(x: Option<f64>) -> String {
    x.map_or_else(|| "–".to_owned(), |x| format!("{x:.1e}"))
}

fn line(run: &Run) -> Line<'_> {
    let Run { method, law, knob, value, wall_time, after_impact, at_end } = run;
    Line { method, law, knob, value: *value, wall_time: *wall_time, after_impact: *after_impact, at_end: *at_end }
}

fn report(chart: &Chart) -> Report<'_> {
    let runs = chart.runs.iter().map(line).collect();
    let absent = chart.absent.iter().map(|Absent { method, reason }| Missing { method, reason }).collect();
    Report {
        law: &chart.law,
        runs,
        absent,
        doubt_after_impact: chart.doubt_after_impact,
        doubt_at_end: chart.doubt_at_end,
    }
}

fn for_people(chart: &Chart, out: &mut dyn Write) -> std::io::Result<()> {
    writeln!(
        out,
        "{:36} {:>20} {:>10} {:>12} {:>10}  law",
        "method", "parameter", "time, ms", "after impact", "at the end"
    )?;
    for run in &chart.runs {
        let knob = format!("{} {}", run.knob, knob_value(run.value));
        let (after, end) = (number(run.after_impact), number(run.at_end));
        writeln!(out, "{:36} {knob:>20} {:>10.4} {after:>12} {end:>10}  {}", run.method, run.wall_time * 1e3, run.law)?;
    }
    chart.caption().iter().try_for_each(|line| writeln!(out, "{line}"))?;
    for absent in &chart.absent {
        writeln!(out, "not run: {}: {}", absent.method, absent.reason)?;
    }
    let doubt = number(chart.doubt_after_impact);
    writeln!(out, "error of the reference solution: {doubt} after the impact, {:.1e} at the end", chart.doubt_at_end)
}

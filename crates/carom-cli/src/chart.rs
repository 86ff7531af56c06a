//! `carom chart`: work–precision chart of a scene, and the rigid limit of its compliant contacts.

use crate::error::CliError;
use crate::files;
use crate::output::{Bar, to_json, write_whole};
use crate::scene::load;
use carom_evidence::chart::{Chart, PeerRun, StiffnessChart, redraw};
use clap::Args;
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
    #[arg(short, long, value_name = "X.svg")]
    out: PathBuf,
    /// Draw the numbers of a chart that was computed already, a CSV table of this command
    #[arg(long, value_name = "X.csv", requires = "show", conflicts_with_all = ["peers", "stiffness", "budget", "json"])]
    from: Option<PathBuf>,
    /// A method that --from draws, and its name in the picture; may be repeated up to seven times
    #[arg(long, value_name = "METHOD[=NAME]", requires = "from", conflicts_with = "scene")]
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

impl ChartCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let budget = Duration::try_from_secs_f64(self.budget).ok().filter(|budget| !budget.is_zero());
        let Some(budget) = budget else {
            return Err(CliError::Input(format!("--budget {}: give a number of seconds above 0", self.budget)));
        };
        if self.out.extension().is_none_or(|ending| ending != "svg") {
            return Err(CliError::Input(format!("--out {}: give a file that ends in .svg", self.out.display())));
        }
        let title = |file: &Path| file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let file = match (&self.from, &self.scene) {
            (Some(table), _) => {
                files::check(&[table.to_owned()], &[("--out", Some(&self.out))])?;
                return write_whole(&self.out, &redraw(table, &self.show, &title(table))?);
            }
            (None, Some(scene)) => scene,
            // The parser requires one of the two.
            (None, None) => return Err(CliError::Input("give a scene, or a table by --from".into())),
        };
        let refuse = |e| CliError::scene(file, e);
        let scene = load(file)?;
        scene.plan().map_err(refuse)?; // which refuses an accuracy: a chart runs the scene with tolerances of its own
        let title = title(file);
        let peers = self.peers.as_deref().map(|file| read_peers(file, &title)).transpose()?.unwrap_or_default();
        let numbers = self.out.with_extension("csv");
        let reads: Vec<PathBuf> = scene.files.iter().chain(&self.peers).cloned().collect();
        files::check(&reads, &[("--out", Some(&self.out)), ("the numbers of --out,", Some(&numbers))])?;

        let bar = Bar::new(None, "{elapsed:>5} {spinner} {pos} runs, {msg}");
        if self.stiffness {
            let chart = StiffnessChart::of(&scene, budget, &mut || bar.inc(1)).map_err(refuse)?;
            drop(bar);
            let Some(chart) = chart else {
                let rule = "--stiffness: the scene has no compliant contact: give [contact], a surface or a pair the key \
                            compliance";
                return Err(CliError::Input(rule.into()));
            };
            write_whole(&self.out, &chart.svg(&title))?;
            write_whole(&numbers, &chart.csv())?;
            if self.json { writeln!(out, "{}", to_json(&chart)?) } else { chart.print(out) }?;
            return Ok(());
        }
        let mut chart = Chart::of(&scene, budget, &mut |method| {
            bar.set_message(method.to_owned());
            bar.inc(1);
        })
        .map_err(refuse)?;
        drop(bar);
        peers.into_iter().for_each(|run| chart.add_peer(run));
        write_whole(&self.out, &chart.svg(&title))?;
        write_whole(&numbers, &chart.csv())?;
        if self.json { writeln!(out, "{}", to_json(&chart)?) } else { chart.print(out) }?;
        Ok(())
    }
}

/// The runs of other programs in this scene.
fn read_peers(file: &Path, scene: &str) -> Result<Vec<PeerRun>, CliError> {
    let name = || file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|e| CliError::unreadable(name(), &e))?;
    let mut peers = Vec::new();
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let refuse = |reason: String| CliError::line(name(), k + 1, &reason);
        let run: PeerRun = serde_json::from_str(line).map_err(|e| refuse(e.to_string()))?;
        if run.scene == scene {
            run.check().map_err(refuse)?;
            peers.push(run);
        }
    }
    Ok(peers)
}

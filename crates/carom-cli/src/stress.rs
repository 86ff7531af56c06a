//! `carom stress`: scenes that are hard for impact laws and simulators, against what theory predicts.
//!
//! The files are written whatever the verdicts; a defect then ends the command with exit 1 and a line that lists the cells.

use crate::error::CliError;
use crate::files;
use crate::output::{Bar, make_folder, to_json, write_whole};
use carom_evidence::stress::{Table, names};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Run impact laws and simulation methods on built-in scenes that make methods fail
///
/// Each cell (method in a scene) has a verdict and a bound on its figure that theory predicts. A cell
/// that differs is a defect: the files are written, and the command ends with exit status 1.
///
/// Output: stress.md (table with figures, bounds and reasons), stress.json and stress.svg in --out,
/// and the number of cells of each verdict.
/// JSON keys: methods, scenes [{scene, story, measures, tolerance, cells [{method, verdict, expected,
///   figure, bound, reason, note}]}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct StressCommand {
    /// Folder to write to; it is made if it is missing, its parent must exist
    ///
    /// Three files of these names in it are replaced, other files stay. A folder that has
    /// only some of the three is refused.
    #[arg(short, long, value_name = "DIR", verbatim_doc_comment)]
    out: PathBuf,
    /// Run only the scenes whose names contain this text [default: all]
    #[arg(long, value_name = "TEXT")]
    scene: Option<String>,
    /// Print the content of stress.json instead of the counts
    #[arg(long)]
    json: bool,
}

/// The files in --out.
const FILES: [&str; 3] = ["stress.md", "stress.svg", "stress.json"];

impl StressCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let wanted = |name: &&str| self.scene.as_deref().is_none_or(|text| name.contains(text));
        let scenes: Vec<&str> = names().filter(wanted).collect();
        if scenes.is_empty() {
            let (text, names) = (self.scene.unwrap_or_default(), names().collect::<Vec<_>>().join(", "));
            let rule = format!("no name of a scene contains it: the scenes are {names}");
            return Err(CliError::Input(format!("--scene {text}: {rule}")));
        }
        files::check_folder(&self.out)?;
        files::check_own("--out", &self.out, &FILES)?;
        make_folder(&self.out)?;
        let bar = Bar::new(Some(scenes.len() as u64), "{elapsed:>5} {bar:30} {pos}/{len} {msg}");
        let table = Table::of(&scenes, &|name| {
            bar.set_message(name.to_owned());
            bar.inc(1);
        });
        drop(bar);
        let json = to_json(&table)?;
        let contents = [table.markdown(), table.svg(), format!("{json}\n")];
        FILES.iter().zip(&contents).try_for_each(|(name, text)| write_whole(&self.out.join(name), text))?;
        if self.json {
            writeln!(out, "{json}")?;
        } else {
            table.counts().try_for_each(|(count, verdict)| writeln!(out, "{count:5} {verdict}"))?;
            writeln!(out, "{} scenes; the table is {}", scenes.len(), self.out.join("stress.md").display())?;
        }
        let cells = table.defects();
        if cells.is_empty() {
            return Ok(());
        }
        let (count, cells) = (cells.len(), cells.join(", "));
        Err(CliError::Input(format!("{count} cells are defects, see the notes in stress.md: {cells}")))
    }
}

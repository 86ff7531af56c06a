//! `carom stress`: scenes that are hard for impact laws and simulators, against what theory predicts.
//!
//! The files are written whatever the verdicts; a defect then ends the command with exit 1 and a line that lists the cells.

use crate::error::CliError;
use crate::files;
use crate::output::{make_folder, progress, to_json, write_whole};
use carom_evidence::stress::{self, METHODS, Row, Verdict};
use clap::Args;
use serde::Serialize;
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
    #[arg(long, value_name = "DIR", verbatim_doc_comment)]
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

#[derive(Serialize)]
struct Report {
    methods: &'static [&'static str],
    scenes: Vec<Scene>,
}

#[derive(Serialize)]
struct Scene {
    scene: &'static str,
    story: &'static str,
    measures: &'static str,
    tolerance: f64,
    cells: Vec<Cell>,
}

#[derive(Serialize)]
struct Cell {
    method: &'static str,
    verdict: &'static str,
    expected: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    figure: Option<f64>,
    /// Least and largest figure that theory allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    bound: Option<[f64; 2]>,
    reason: &'static str,
    #[serde(skip_serializing_if = "String::is_empty")]
    note: String,
}

impl StressCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let wanted = |scene: &&stress::Scene| self.scene.as_deref().is_none_or(|text| scene.name.contains(text));
        let scenes: Vec<&stress::Scene> = stress::SCENES.iter().filter(wanted).collect();
        if scenes.is_empty() {
            let names: Vec<&str> = stress::SCENES.iter().map(|scene| scene.name).collect();
            let text = self.scene.unwrap_or_default();
            return Err(CliError::Option(format!(
                "--scene {text}: no name of a scene contains it: the scenes are {}",
                names.join(", ")
            )));
        }
        files::check_folder("--out", &self.out)?;
        files::check_own("--out", &self.out, &FILES)?;
        make_folder(&self.out)?;
        let bar = progress(scenes.len() as u64, "{elapsed:>5} {bar:30} {pos}/{len} {msg}");
        let rows = stress::run(&scenes, &|row: &Row| {
            bar.set_message(row.scene);
            bar.inc(1);
        });
        bar.finish_and_clear();
        let json = to_json(&report(&rows))?;
        let contents = [stress::markdown(&rows), stress::svg(&rows), format!("{json}\n")];
        FILES.iter().zip(&contents).try_for_each(|(name, text)| write_whole(&self.out.join(name), text))?;
        if self.json {
            writeln!(out, "{json}")?;
            return defects(&rows);
        }
        let count = |verdict| rows.iter().flat_map(|row| &row.cells).filter(|cell| cell.verdict == verdict).count();
        for verdict in Verdict::ALL {
            writeln!(out, "{:5} {}", count(verdict), verdict.name())?;
        }
        writeln!(out, "{} scenes; the table is {}", rows.len(), self.out.join("stress.md").display())?;
        defects(&rows)
    }
}

/// An error that lists the cells that are defects, if there are any.
fn defects(rows: &[Row]) -> Result<(), CliError> {
    let cells: Vec<String> =
        stress::defects(rows).iter().map(|(scene, cell)| format!("{scene} / {}", cell.method)).collect();
    if cells.is_empty() {
        return Ok(());
    }
    Err(CliError::Defects { count: cells.len(), cells: cells.join(", ") })
}

fn report(rows: &[Row]) -> Report {
    let cell = |cell: &stress::Cell| Cell {
        method: cell.method,
        verdict: cell.verdict.name(),
        expected: cell.expected.name(),
        figure: cell.figure,
        bound: cell.bound,
        reason: cell.reason,
        note: cell.note.clone(),
    };
    let scene = |row: &Row| Scene {
        scene: row.scene,
        story: row.story,
        measures: row.measures,
        tolerance: row.tolerance,
        cells: row.cells.iter().map(cell).collect(),
    };
    Report { methods: &METHODS, scenes: rows.iter().map(scene).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_defect_is_an_error_that_names_scene_and_method() {
        let scene = stress::SCENES.iter().find(|scene| scene.name == "jam").unwrap();
        let mut row = scene.run();
        assert!(defects(std::slice::from_ref(&row)).is_ok());
        row.cells[4].verdict = Verdict::Defect;
        let message = defects(&[row]).unwrap_err().to_string();
        assert_eq!(message, "1 cells are defects, see the notes in stress.md: jam / energetic");
    }
}

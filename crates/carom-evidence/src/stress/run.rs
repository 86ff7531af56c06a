//! All methods in the scenes of the stress table.

use super::method::{Cell, Expected, Found, METHODS, Row, Scene, Verdict};
use super::report;
use super::scenes::SCENES;
use rayon::prelude::*;
use serde::Serialize;

impl Scene {
    /// All methods in this scene.
    pub(crate) fn run(&self) -> Row {
        let of = |method| self.expected.iter().find(|expected| expected.methods.contains(&method));
        let cells = METHODS.into_iter().filter_map(|method| Some(self.cell(method, of(method)?)));
        Row {
            scene: self.name,
            story: self.story,
            measures: self.measures,
            tolerance: self.tolerance,
            cells: cells.collect(),
        }
    }

    pub(crate) fn cell(&self, method: &'static str, expected: &Expected) -> Cell {
        let (limits, mut wrong) = match expected.limits(method) {
            Ok(limits) => (limits, Vec::new()),
            Err(why) => (None, vec![format!("the prediction could not be computed: {why}")]),
        };
        let (figure, mut note) = match (self.judge)(method) {
            Err(why) => {
                if expected.verdict != Verdict::Refused {
                    wrong.push(format!("refused: {why}"));
                }
                (None, String::new())
            }
            Ok(Found { figure, violated, note }) => {
                wrong.extend(violated);
                match limits {
                    None => wrong.push("answered, but a refusal was expected".to_owned()),
                    Some([least, most]) => {
                        // Written so that NaN fails.
                        let inside = figure >= least && figure <= most;
                        if !inside {
                            wrong.push(format!(
                                "the figure is {figure:.3e}, outside {}",
                                report::interval([least, most])
                            ));
                        }
                    }
                }
                (Some(figure).filter(|figure| figure.is_finite()), note)
            }
        };
        let verdict = if wrong.is_empty() { expected.verdict } else { Verdict::Defect };
        if verdict == Verdict::Defect {
            note = format!("expected: {}; {}", expected.verdict.name(), wrong.join("; "));
        }
        let Expected { verdict: expected, reason, .. } = *expected;
        Cell { method, verdict, expected, figure, bound: limits, reason, note }
    }
}

/// The results of scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    pub(crate) methods: [&'static str; METHODS.len()],
    #[serde(rename = "scenes")]
    pub(crate) rows: Vec<Row>,
}

/// The names of all scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|scene| scene.name)
}

impl Table {
    /// Runs the scenes with these names on all cores; `done` is called with the name of each scene that is finished.
    pub fn of(names: &[&str], done: &(dyn Fn(&str) + Sync)) -> Self {
        let scenes: Vec<&Scene> = SCENES.iter().filter(|scene| names.contains(&scene.name)).collect();
        let row = |scene: &&Scene| {
            let row = scene.run();
            done(row.scene);
            row
        };
        // One scene per task, because some take a thousand times longer than others.
        Self { methods: METHODS, rows: scenes.par_iter().with_max_len(1).map(row).collect() }
    }

    /// The scene and the method of each cell that is not as theory predicts.
    pub fn defects(&self) -> Vec<String> {
        let cells = self.rows.iter().flat_map(|row| row.cells.iter().map(move |cell| (row.scene, cell)));
        let defects = cells.filter(|(_, cell)| cell.verdict == Verdict::Defect);
        defects.map(|(scene, cell)| format!("{scene} / {}", cell.method)).collect()
    }

    /// The number of cells of each verdict, and its name.
    pub fn counts(&self) -> impl Iterator<Item = (usize, &'static str)> {
        let of = |verdict| self.rows.iter().flat_map(|row| &row.cells).filter(|cell| cell.verdict == verdict).count();
        Verdict::ALL.into_iter().map(move |verdict| (of(verdict), verdict.name()))
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        report::markdown(&self.rows)
    }

    /// The table as a picture (SVG).
    pub fn svg(&self) -> String {
        report::svg(&self.rows)
    }
}

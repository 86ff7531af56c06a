//! Where methods fail: scenes that are hard for impact laws and simulators, and the verdict on each method in each scene.
//!
//! Every scene states, for each method that applies to it, the verdict that theory predicts and a bound on the figure that
//! the scene measures (`Expected`). The prediction follows from a closed form, an invariant, an independent numerical
//! solution, the order of a method, the rounding, or a theorem about which laws must fail and by how much. A figure outside its
//! bound, an unexpected refusal, a failure that does not happen and a violated side condition are all a
//! `Verdict::Defect`. All random numbers have fixed seeds.

mod bodies;
mod chains;
mod definition;
mod impulse_path;
mod lasting;
mod many;
mod motion;
mod report;
mod scenes;
mod several;
mod single;
mod tree;

use crate::serialised_by_name;
use carom_impact::{Coefficients, LAW_NAMES, Law, law_by_name};
use rayon::prelude::*;
use serde::Serialize;

/// The methods, in the order of the table's columns: the laws of one contact, those of several, and the simulators.
const METHODS: [&str; LAW_NAMES.len() + 7] = {
    let others = [MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL, LIU_ZHAO_BROGLIATO, EVENTS, STEPS, COMPLIANT];
    let (mut all, mut k) = ([""; LAW_NAMES.len() + 7], 0);
    while k < all.len() {
        all[k] = if k < LAW_NAMES.len() { LAW_NAMES[k] } else { others[k - LAW_NAMES.len()] };
        k += 1;
    }
    all
};

/// Newton's restitution for all contacts at once.
const MOREAU: &str = "moreau";
/// Poisson's law for several contacts.
const GLOCKER_PFEIFFER: &str = "glocker-pfeiffer";
/// One contact after another.
const SEQUENTIAL: &str = "sequential";
/// The energetic law for several contacts.
const LIU_ZHAO_BROGLIATO: &str = "liu-zhao-brogliato";
/// Event-driven simulation.
const EVENTS: &str = "events";
/// Moreau–Jean time steps.
const STEPS: &str = "steps";
/// Compliant contacts.
const COMPLIANT: &str = "compliant";

/// The result of one method in one scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The figure is rounding: at most 1e-12.
    Exact,
    /// The figure is at most the scene's tolerance.
    Within,
    /// The figure is above the tolerance, by an error of approximation of the predicted size.
    Degrades,
    /// No answer, but an error that states the reason, as predicted.
    Refused,
    /// Wrong, by the amount that theory predicts for this method.
    Fails,
    /// The prediction does not hold.
    Defect,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Exact, Self::Within, Self::Degrades, Self::Refused, Self::Fails, Self::Defect];

    /// As the table prints it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Within => "within tolerance",
            Self::Degrades => "degrades",
            Self::Refused => "refused",
            Self::Fails => "fails as theory predicts",
            Self::Defect => "defect",
        }
    }
}

serialised_by_name!(Verdict);

/// Largest figure of [`Verdict::Exact`].
const EXACT: f64 = 1e-12;

/// The bound on a figure.
#[derive(Debug, Clone, Copy)]
enum Bound {
    /// There is no figure: the method refuses.
    NoFigure,
    AtMost(f64),
    Between(f64, f64),
    /// The predicted value for a method, and the relative error allowed.
    Near(fn(&str) -> Result<f64, String>, f64),
}

/// What theory predicts for one or several methods in a scene.
#[derive(Debug, Clone, Copy)]
struct Expected {
    methods: &'static [&'static str],
    verdict: Verdict,
    bound: Bound,
    reason: &'static str,
}

impl Expected {
    const fn exact(methods: &'static [&'static str], reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Exact, bound: Bound::AtMost(EXACT), reason }
    }

    const fn within(methods: &'static [&'static str], most: f64, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Within, bound: Bound::AtMost(most), reason }
    }

    const fn degrades(methods: &'static [&'static str], bound: Bound, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Degrades, bound, reason }
    }

    const fn fails(methods: &'static [&'static str], bound: Bound, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Fails, bound, reason }
    }

    const fn refused(methods: &'static [&'static str], reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Refused, bound: Bound::NoFigure, reason }
    }

    /// Least and largest figure allowed; `None` for a refusal.
    fn limits(&self, method: &str) -> Result<Option<[f64; 2]>, String> {
        Ok(match self.bound {
            Bound::NoFigure => None,
            Bound::AtMost(most) => Some([0.0, most]),
            Bound::Between(least, most) => Some([least, most]),
            Bound::Near(value, relative) => {
                let value = value(method)?;
                Some([value * (1.0 - relative), value * (1.0 + relative)])
            }
        })
    }
}

/// One method in one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Cell {
    /// One of [`METHODS`].
    pub method: &'static str,
    /// The verdict: the expected one, or [`Verdict::Defect`].
    pub verdict: Verdict,
    /// The verdict that theory predicts.
    pub expected: Verdict,
    /// The scene's figure; `None` if the method refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figure: Option<f64>,
    /// Least and largest figure that theory allows; `None` if it predicts a refusal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<[f64; 2]>,
    /// Why theory predicts this.
    pub reason: &'static str,
    /// Further facts; of a defect, what differs from the prediction.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// One scene with all methods that apply to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Short name.
    pub scene: &'static str,
    /// What happens.
    pub story: &'static str,
    /// What the figure measures.
    pub measures: &'static str,
    /// Up to this figure a cell is within tolerance.
    pub tolerance: f64,
    /// The cells, in the order of [`METHODS`].
    pub cells: Vec<Cell>,
}

/// A scene of the table.
#[derive(Debug, Clone, Copy)]
struct Scene {
    /// Short name.
    name: &'static str,
    story: &'static str,
    measures: &'static str,
    tolerance: f64,
    /// The methods that apply are those that something is expected of.
    expected: &'static [Expected],
    judge: fn(&str) -> Judged,
}

/// What a scene measured of one method.
struct Found {
    figure: f64,
    /// Side conditions that do not hold.
    violated: Vec<String>,
    note: String,
}

/// `Err`: the error with which the method refused.
type Judged = Result<Found, String>;

impl Found {
    fn figure(figure: f64) -> Self {
        Self { figure, violated: Vec::new(), note: String::new() }
    }

    fn noting(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// A side condition: `value` is at most `most`.
    fn must(mut self, what: &str, value: f64, most: f64) -> Self {
        // Written so that NaN fails.
        let holds = value <= most;
        if !holds {
            self.violated.push(format!("{what}: {value:.3e}, at most {most:e} expected"));
        }
        self
    }

    /// A side condition that holds or not.
    fn must_be(mut self, what: &str, holds: bool) -> Self {
        if !holds {
            self.violated.push(format!("{what}: not so"));
        }
        self
    }
}

impl Scene {
    /// All methods in this scene.
    fn run(&self) -> Row {
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

    fn cell(&self, method: &'static str, expected: &Expected) -> Cell {
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
    methods: [&'static str; METHODS.len()],
    #[serde(rename = "scenes")]
    rows: Vec<Row>,
}

/// The names of all scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    scenes::SCENES.iter().map(|scene| scene.name)
}

impl Table {
    /// Runs the scenes with these names on all cores; `done` is called with the name of each scene that is finished.
    pub fn of(names: &[&str], done: &(dyn Fn(&str) + Sync)) -> Self {
        let scenes: Vec<&Scene> = scenes::SCENES.iter().filter(|scene| names.contains(&scene.name)).collect();
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

/// One law of one contact, in the plane or in space.
fn law<const D: usize>(name: &str, restitution: f64, friction: f64) -> Box<dyn Law<f64, D> + Send + Sync> {
    let coefficients = Coefficients { restitution, friction, ..Coefficients::default() };
    law_by_name(name, coefficients).unwrap_or_else(|| unreachable!("the scene lists laws only"))
}

/// A step h of the classical method of Runge and Kutta for dy/dt = rate(y): the integrator of the reference solutions, independent
/// of those that the scenes test.
fn runge_kutta<const N: usize>(y: [f64; N], h: f64, rate: impl Fn([f64; N]) -> [f64; N]) -> [f64; N] {
    let plus = |k: [f64; N], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
    let k1 = rate(y);
    let k2 = rate(plus(k1, h / 2.0));
    let k3 = rate(plus(k2, h / 2.0));
    let k4 = rate(plus(k3, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// An error's text.
fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
#[path = "../../tests/stress.rs"]
mod tests;

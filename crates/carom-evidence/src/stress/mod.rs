//! Where methods fail: scenes that are hard for impact laws and simulators, and the verdict on each method in each scene.
//!
//! Every scene states, for each method that applies to it, the verdict that theory predicts and a bound on the figure that
//! the scene measures ([`Expected`]). The prediction follows from a closed form, an invariant, an independent numerical
//! solution, the order of a method, the rounding, or a theorem about which laws must fail and by how much. A figure outside its
//! bound, an unexpected refusal, a failure that does not happen and a violated side condition are all a
//! [`Verdict::Defect`]. All random numbers have fixed seeds.
//!
//! ```
//! use carom_evidence::stress::{SCENES, Verdict};
//!
//! let kane = SCENES.iter().find(|scene| scene.name == "energy paradox").unwrap().run();
//! let cell = |method| kane.cells.iter().find(|cell| cell.method == method).unwrap();
//! assert_eq!(cell("whittaker").verdict, Verdict::Fails); // it gains energy, as Kane & Levinson found
//! assert!((cell("whittaker").figure.unwrap() - 6.35).abs() < 1e-3);
//! assert_eq!(cell("energetic").verdict, Verdict::Exact);
//! ```

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

pub use report::{markdown, svg};
pub use scenes::SCENES;

use carom_impact::{Coefficients, Law, law_by_name};
use rayon::prelude::*;

/// The methods, in the order of the table's columns: the laws of one contact, those of several, and the simulators.
pub const METHODS: [&str; 15] = [
    "frictionless",
    "whittaker",
    "newton",
    "poisson",
    "energetic",
    "chatterjee-ruina",
    "brach",
    "smith",
    MOREAU,
    GLOCKER_PFEIFFER,
    SEQUENTIAL,
    LIU_ZHAO_BROGLIATO,
    EVENTS,
    STEPS,
    COMPLIANT,
];

/// Newton's restitution for all contacts at once.
pub const MOREAU: &str = "moreau";
/// Poisson's law for several contacts.
pub const GLOCKER_PFEIFFER: &str = "glocker-pfeiffer";
/// One contact after another.
pub const SEQUENTIAL: &str = "sequential";
/// The energetic law for several contacts.
pub const LIU_ZHAO_BROGLIATO: &str = "liu-zhao-brogliato";
/// Event-driven simulation.
pub const EVENTS: &str = "events";
/// Moreau–Jean time steps.
pub const STEPS: &str = "steps";
/// Compliant contacts.
pub const COMPLIANT: &str = "compliant";

/// The result of one method in one scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
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

/// Largest figure of [`Verdict::Exact`].
pub const EXACT: f64 = 1e-12;

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
pub struct Expected {
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
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// One of [`METHODS`].
    pub method: &'static str,
    /// The verdict: the expected one, or [`Verdict::Defect`].
    pub verdict: Verdict,
    /// The verdict that theory predicts.
    pub expected: Verdict,
    /// The scene's figure; `None` if the method refused.
    pub figure: Option<f64>,
    /// Least and largest figure that theory allows; `None` if it predicts a refusal.
    pub bound: Option<[f64; 2]>,
    /// Why theory predicts this.
    pub reason: &'static str,
    /// Further facts; of a defect, what differs from the prediction.
    pub note: String,
}

/// One scene with all methods that apply to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
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
pub struct Scene {
    /// Short name.
    pub name: &'static str,
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
    pub fn run(&self) -> Row {
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

    /// What is inconsistent in the scene's expectations; empty if nothing is.
    pub fn inconsistencies(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut wrong =
            |methods: &[&str], what: &str| found.push(format!("{}: {}: {what}", self.name, methods.join(", ")));
        let listed = |method: &str| self.expected.iter().filter(|expected| expected.methods.contains(&method)).count();
        for expected in self.expected {
            let methods = expected.methods;
            if methods.iter().any(|method| !METHODS.contains(method) || listed(method) != 1) {
                wrong(methods, "a method that is unknown or listed twice");
            }
            if expected.reason.is_empty() {
                wrong(methods, "no reason");
            }
            let limits: Vec<_> = methods.iter().filter_map(|method| expected.limits(method).ok()).collect();
            let fits = |limits: &Option<[f64; 2]>| match (expected.verdict, limits) {
                (Verdict::Refused, None) => true,
                (Verdict::Exact, Some([least, most])) => *least == 0.0 && *most <= EXACT,
                (Verdict::Within, Some([least, most])) => least < most && *most > EXACT && *most <= self.tolerance,
                (Verdict::Degrades | Verdict::Fails, Some([least, most])) => least < most && *least > self.tolerance,
                _ => false,
            };
            if limits.len() != methods.len() || !limits.iter().all(fits) {
                wrong(methods, "the bound does not fit the verdict");
            }
        }
        found
    }
}

/// Runs scenes on all cores and returns their rows in order; `done` is called with each row that is finished.
pub fn run(scenes: &[&Scene], done: &(dyn Fn(&Row) + Sync)) -> Vec<Row> {
    let row = |scene: &&Scene| {
        let row = scene.run();
        done(&row);
        row
    };
    // One scene per task, because some take a thousand times longer than others.
    scenes.par_iter().with_max_len(1).map(row).collect()
}

/// The cells whose verdict is [`Verdict::Defect`], with the scene's name.
pub fn defects(rows: &[Row]) -> Vec<(&'static str, &Cell)> {
    let cells = rows.iter().flat_map(|row| row.cells.iter().map(move |cell| (row.scene, cell)));
    cells.filter(|(_, cell)| cell.verdict == Verdict::Defect).collect()
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

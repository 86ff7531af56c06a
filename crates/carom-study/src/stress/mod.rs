//! Where methods fail: scenes that break laws and simulators, each method's verdict, and the figure behind it.
//!
//! Every scene has a truth: a closed form, an invariant, or a theorem that says who must fail. A cell is what one method
//! makes of one scene. Nothing here is random without a fixed seed, so the table is the same everywhere.
//!
//! ```
//! use carom_study::stress::{SCENES, Verdict};
//!
//! let kane = SCENES.iter().find(|scene| scene.name == "energy paradox").unwrap().run();
//! let verdict = |method| kane.cells.iter().find(|cell| cell.method == method).unwrap().verdict;
//! assert_eq!(verdict("whittaker"), Verdict::Fails); // it creates energy, as Kane & Levinson found
//! assert_eq!(verdict("energetic"), Verdict::Exact);
//! ```

mod chains;
mod motion;
mod report;
mod scenes;
mod several;
mod single;

pub use report::{markdown, svg};
pub use scenes::SCENES;

use carom_impact::{Coefficients, Law, law_by_name};
use rayon::prelude::*;

/// The methods, in the order of the table's columns: the laws of one contact, those of several, and what simulates.
pub const METHODS: [&str; 14] = [
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
/// Event-driven simulation.
pub const EVENTS: &str = "events";
/// Moreau–Jean time steps.
pub const STEPS: &str = "steps";
/// Contacts that give way.
pub const COMPLIANT: &str = "compliant";

/// What a method makes of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Off by rounding: at most 1e-12 of the quantity.
    Exact,
    /// Off by no more than the method promises there.
    Within,
    /// Off by more.
    Degrades,
    /// Not answered, with an error that says why.
    Refused,
    /// Wrong in the way that theory says.
    Fails,
    /// Wrong against theory: a defect.
    Defect,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Exact, Self::Within, Self::Degrades, Self::Refused, Self::Fails, Self::Defect];

    /// In the table's words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Within => "within tolerance",
            Self::Degrades => "degrades",
            Self::Refused => "refused",
            Self::Fails => "fails as theory says",
            Self::Defect => "defect",
        }
    }
}

/// One method in one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// One of [`METHODS`].
    pub method: &'static str,
    /// What became of it.
    pub verdict: Verdict,
    /// The scene's figure; `None` if there is none.
    pub figure: Option<f64>,
    /// How it failed, why it was refused, what else there is to say.
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
    methods: &'static [&'static str],
    judge: fn(&str) -> Judged,
}

/// What a scene found out about one method.
struct Found {
    figure: f64,
    /// How it failed as theory says it must or may.
    fails: Option<String>,
    note: String,
}

/// `Err`: the error that refused.
type Judged = Result<Found, String>;

impl Found {
    fn figure(figure: f64) -> Self {
        Self { figure, fails: None, note: String::new() }
    }

    fn noting(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// A failure that theory predicts for this method.
    fn failing(self, how: Option<String>) -> Self {
        Self { fails: how, ..self }
    }
}

/// Figures up to here are rounding.
const EXACT: f64 = 1e-12;

impl Scene {
    /// All methods in this scene.
    pub fn run(&self) -> Row {
        let cell = |&method: &&'static str| {
            let (verdict, figure, note) = match (self.judge)(method) {
                Err(why) => (Verdict::Refused, None, why),
                Ok(Found { figure, note, .. }) if !figure.is_finite() => {
                    (Verdict::Defect, None, format!("{note} the figure is {figure}"))
                }
                Ok(Found { figure, fails: Some(how), .. }) => (Verdict::Fails, Some(figure), how),
                Ok(Found { figure, note, .. }) => {
                    let verdict = match figure {
                        f if f <= EXACT => Verdict::Exact,
                        f if f <= self.tolerance => Verdict::Within,
                        _ => Verdict::Degrades,
                    };
                    (verdict, Some(figure), note)
                }
            };
            Cell { method, verdict, figure, note }
        };
        Row {
            scene: self.name,
            story: self.story,
            measures: self.measures,
            tolerance: self.tolerance,
            cells: self.methods.iter().map(cell).collect(),
        }
    }
}

/// Scenes on all cores, in their order; `done` hears of each that is finished.
pub fn run(scenes: &[&Scene], done: &(dyn Fn(&Row) + Sync)) -> Vec<Row> {
    let row = |scene: &&Scene| {
        let row = scene.run();
        done(&row);
        row
    };
    // One by one, not by halves: some take a thousand times longer than others.
    scenes.par_iter().with_max_len(1).map(row).collect()
}

/// One law of one contact, in the plane or in space.
fn law<const D: usize>(name: &str, restitution: f64, friction: f64) -> Box<dyn Law<f64, D> + Send + Sync> {
    let coefficients = Coefficients { restitution, friction, ..Coefficients::default() };
    law_by_name(name, coefficients).unwrap_or_else(|| unreachable!("the scene lists laws only"))
}

/// An error as the reason of a refusal.
fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

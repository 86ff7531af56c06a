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
mod several;
mod single;

pub use report::{markdown, svg};

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

const LAWS: &[&str] = &carom_impact::LAW_NAMES;
const SEVERAL: &[&str] = &[MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL];
const SIMULATORS: &[&str] = &[EVENTS, STEPS, COMPLIANT];

/// The scenes, in the order of the table.
pub const SCENES: &[Scene] = &[
    Scene {
        name: "energy paradox",
        story: "Kane & Levinson's double pendulum strikes the floor, e from 0 to 1, μ from 0 to 1.2",
        measures: "worst violation of cone, unilaterality and energy books",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::kane_levinson,
    },
    Scene {
        name: "random census",
        story: "20 000 random planar impacts, e and μ random",
        measures: "worst violation of cone, unilaterality and energy books",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::census,
    },
    Scene {
        name: "census in space",
        story: "2 000 random impacts in space, where slip turns",
        measures: "worst violation of cone, unilaterality and energy books",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::census_in_space,
    },
    Scene {
        name: "jam",
        story: "the same pendulum, sliding into a jam: μ = 0.8 above C/B, e = 0.5",
        measures: "violation of cone, unilaterality and energy books",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::jam,
    },
    Scene {
        name: "impact without collision",
        story: "Painlevé's rod at 60°, μ = 1.5, slides along the floor: approach speed down to 0",
        measures: "impulse left when the approach is 1e-12 m/s",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::without_collision,
    },
    Scene {
        name: "grazing",
        story: "slip of 1 m/s, approach from 1 down to 1e-12 m/s",
        measures: "relative error of the impulse against its closed form",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::grazing,
    },
    Scene {
        name: "e = 0 and e = 1",
        story: "2 000 random frictionless impacts with e exactly 0 or 1",
        measures: "relative error of rebound and energy",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::extreme_restitution,
    },
    Scene {
        name: "slip about to stop",
        story: "500 random impacts in space with a slip of 1e-12 m/s, against the same without any",
        measures: "relative change of u⁺",
        tolerance: 1e-9,
        methods: LAWS,
        judge: single::slip_at_rest,
    },
    Scene {
        name: "singular pose",
        story: "a stretched two-link arm hit along itself, elbow from 0.1 down to 1e-12 rad",
        measures: "relative error of the joint velocities against their closed form",
        tolerance: 1e-9,
        methods: LAWS,
        judge: chains::singular_pose,
    },
    Scene {
        name: "stretched exactly",
        story: "the same arm with its elbow at 0: no joint moves the tip along the normal",
        measures: "–",
        tolerance: 1e-9,
        methods: LAWS,
        judge: chains::stretched,
    },
    Scene {
        name: "mass ratio 1e6",
        story: "six sliders in a row, masses of 1e-6, 1, 1e-6, … kg and the other way round, e = 0.5",
        measures: "relative error of the joint velocities against their closed form",
        tolerance: 1e-9,
        methods: LAWS,
        judge: chains::mass_ratio,
    },
    Scene {
        name: "2 links",
        story: "a uniform chain's tip is hit, e = 0.5, μ = 0.3",
        measures: "energy books, and J q̇⁺ against u⁺",
        tolerance: 1e-9,
        methods: LAWS,
        judge: |method| chains::long(method, 2),
    },
    Scene {
        name: "30 links",
        story: "the same",
        measures: "energy books, and J q̇⁺ against u⁺",
        tolerance: 1e-9,
        methods: LAWS,
        judge: |method| chains::long(method, 30),
    },
    Scene {
        name: "1000 links",
        story: "the same",
        measures: "energy books, and J q̇⁺ against u⁺",
        tolerance: 1e-9,
        methods: LAWS,
        judge: |method| chains::long(method, 1000),
    },
    Scene {
        name: "rod on two ends",
        story: "a rod falls flat on both ends, e = 0.5",
        measures: "difference from a rebound as flat",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::rod,
    },
    Scene {
        name: "three contacts, two freedoms",
        story: "a rod in the plane on three points: impulses are not unique, velocities are, e = 0.5",
        measures: "relative error of the velocities",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::redundant,
    },
    Scene {
        name: "e differs per contact",
        story: "2 000 random smooth impacts at two to four places, each with its own e",
        measures: "worst residual",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::different_restitutions,
    },
    Scene {
        name: "several rough contacts",
        story: "100 random impacts at two to four places with friction, one e for all",
        measures: "worst residual",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::rough,
    },
    Scene {
        name: "50 contacts",
        story: "a raft of 50 rough contacts that strike at once, e = 0",
        measures: "residual",
        tolerance: 1e-10,
        methods: SEVERAL,
        judge: several::raft,
    },
    Scene {
        name: "nearly parallel contacts",
        story: "a particle in a groove whose walls are 0.1 down to 1e-8 rad from level, e = 0",
        measures: "error of the velocity against its closed form",
        tolerance: 1e-7,
        methods: SEVERAL,
        judge: several::groove,
    },
    Scene {
        name: "Newton's cradle",
        story: "three equal balls, e = 1, against elastic contacts after Hertz of equal and of ten times different stiffness",
        measures: "largest error of a ball's velocity, m/s",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::cradle,
    },
    Scene {
        name: "rocking block",
        story: "a block rocks from corner to corner: ω⁺/ω⁻ = 1 − 1.5 sin²α (Housner)",
        measures: "error of the ratio",
        tolerance: 1e-9,
        methods: SEVERAL,
        judge: several::rocking_block,
    },
    Scene {
        name: "Zeno",
        story: "a ball bounces with e = 0.8 through its first four arcs, and with e = 0.5 to rest",
        measures: "error of the height, m",
        tolerance: 1e-6,
        methods: SIMULATORS,
        judge: motion::zeno,
    },
    Scene {
        name: "false Zeno",
        story: "a pendulum hits a wall at its lowest point, e = 0.5: the bounces never accumulate",
        measures: "relative error of the speed after six impacts",
        tolerance: 1e-6,
        methods: SIMULATORS,
        judge: motion::false_zeno,
    },
    Scene {
        name: "grazing in flight",
        story: "a ball thrown at a ceiling that it would miss, or overlap, by 1e-3 down to 1e-12 m",
        measures: "largest miss decided wrongly, m",
        tolerance: 1e-9,
        methods: SIMULATORS,
        judge: motion::grazing_flight,
    },
    Scene {
        name: "10 000 bounces",
        story: "a ball bounces with e = 1, ten thousand times (time stepping: for as long)",
        measures: "relative error of the energy",
        tolerance: 1e-6,
        methods: SIMULATORS,
        judge: motion::ten_thousand_bounces,
    },
    Scene {
        name: "block on a slope",
        story: "a point mass rests on a slope below the friction angle for 2 s (compliant: e = 0.01)",
        measures: "way crept, m",
        tolerance: 1e-6,
        methods: SIMULATORS,
        judge: motion::slope,
    },
    Scene {
        name: "the same on bristles",
        story: "friction that deflects before it slips (1e7 N/m, 1e3 N s/m)",
        measures: "way crept, m",
        tolerance: 1e-6,
        methods: &[COMPLIANT],
        judge: motion::slope_on_a_bristle,
    },
    Scene {
        name: "Painlevé's rod",
        story: "the rod of 60° and μ = 1.5 slides into its jam, e = 0 (compliant: 0.01)",
        measures: "deepest overlap, m",
        tolerance: 1e-6,
        methods: SIMULATORS,
        judge: motion::painleve,
    },
    Scene {
        name: "stiffness 1e4 N/m^1.5",
        story: "a ball of 1 kg lands with 1 m/s on a contact that is to give e = 0.5 back",
        measures: "relative error of e",
        tolerance: 1e-6,
        methods: &[COMPLIANT],
        judge: |_| motion::stiffness(1e4),
    },
    Scene {
        name: "stiffness 1e7 N/m^1.5",
        story: "the same",
        measures: "relative error of e",
        tolerance: 1e-6,
        methods: &[COMPLIANT],
        judge: |_| motion::stiffness(1e7),
    },
    Scene {
        name: "stiffness 1e10 N/m^1.5",
        story: "the same",
        measures: "relative error of e",
        tolerance: 1e-6,
        methods: &[COMPLIANT],
        judge: |_| motion::stiffness(1e10),
    },
    Scene {
        name: "time step 1e-5 s",
        story: "the ball with e = 0.8 for 3 s",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        methods: &[STEPS],
        judge: |_| motion::time_step(1e-5),
    },
    Scene {
        name: "time step 1e-4 s",
        story: "the same",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        methods: &[STEPS],
        judge: |_| motion::time_step(1e-4),
    },
    Scene {
        name: "time step 1e-3 s",
        story: "the same",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        methods: &[STEPS],
        judge: |_| motion::time_step(1e-3),
    },
    Scene {
        name: "time step 1e-2 s",
        story: "the same",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        methods: &[STEPS],
        judge: |_| motion::time_step(1e-2),
    },
    Scene {
        name: "time step 1e-1 s",
        story: "the same",
        measures: "mean error of the height, m",
        tolerance: 1e-6,
        methods: &[STEPS],
        judge: |_| motion::time_step(1e-1),
    },
    Scene {
        name: "quaternions",
        story: "a free body turns for 10⁶ time steps",
        measures: "error of the attitude, rad, and of the quaternion's norm",
        tolerance: 1e-9,
        methods: &[STEPS],
        judge: |_| motion::quaternions(),
    },
];

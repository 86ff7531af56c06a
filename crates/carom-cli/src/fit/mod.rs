//! `carom fit`: coefficients from recorded impacts.

mod read;
mod report;

use crate::RobotArgs;
use crate::error::CliError;
use crate::input::parse_vector;
use crate::output::{answer, say};
use carom_impact::LAW_NAMES;
use carom_study::Tosses;
use carom_study::fit::{Fit, FitError, FitOptions, Loss, RollOutOptions, fit_trajectories, fit_velocities};
use clap::{Args, builder::PossibleValuesParser};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct FitCommand {
    #[command(flatten)]
    source: Source,
    /// The robot's URDF; of a folder of tosses, its file in there
    #[arg(long, value_name = "ROBOT.urdf")]
    robot: Option<PathBuf>,
    /// Put a floating joint between world and root, as in `impact`; tosses have one anyway
    #[arg(long)]
    floating: bool,
    /// Load the robot although meshes of its collision geometry are missing
    #[arg(long)]
    no_meshes: bool,
    /// Order of the joints in q and qd, where it differs from the file's
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    joints: Option<Vec<String>>,
    /// Link whose frame holds the touching point; without it flights touch with the lowest point of the robot's shapes
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// The point, in the link's own axes; a line's own "point" goes first
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = parse_vector, allow_hyphen_values = true)]
    point: [f64; 3],
    /// Surface normal, world, from the environment to the robot
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,1", value_parser = parse_vector, allow_hyphen_values = true)]
    normal: [f64; 3],
    /// Acceleration of free fall in flights, m/s²
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,-9.81", value_parser = parse_vector, allow_hyphen_values = true)]
    gravity: [f64; 3],
    /// Impact law
    #[arg(long, value_parser = PossibleValuesParser::new(LAW_NAMES), default_value = "energetic")]
    law: String,
    /// Fit the scale of rotational inertia too, from 0.5 to 2
    #[arg(long)]
    inertia: bool,
    /// What a residual costs: huber is squares up to twice the median residual, in proportion beyond
    #[arg(long, value_parser = PossibleValuesParser::new(["huber", "squares"]), default_value = "huber")]
    loss: String,
    /// Upper end of the search for friction
    #[arg(long, value_name = "MU", default_value_t = 1.0, allow_hyphen_values = true)]
    max_friction: f64,
    /// Share of the impacts or tosses to fit on; the rest is for the test
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, allow_hyphen_values = true)]
    train: f64,
    /// Seed of that split, and of the bootstrap
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Confidence of the intervals
    #[arg(long, default_value_t = 0.95, allow_hyphen_values = true)]
    confidence: f64,
    /// Length of the tosses' error measure, m: mean |Δp|²/length + mean Δθ²
    #[arg(long, value_name = "METRES", default_value_t = 0.0524, allow_hyphen_values = true)]
    length: f64,
    /// Relative tolerance of the tosses' integration
    #[arg(long, default_value_t = 1e-6, allow_hyphen_values = true)]
    tolerance: f64,
    /// Step of the tosses while several contacts last, s
    #[arg(long, value_name = "SECONDS", default_value_t = 1e-3, allow_hyphen_values = true)]
    contact_step: f64,
    /// One line of JSON, with every impact's residual
    #[arg(long)]
    json: bool,
}

/// What was recorded.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// Velocity jumps: JSON lines {"delassus":[[…]],"u_minus":[…],"u_plus":[…]} in contact axes, tangents first, normal
    /// last, or {"q":[…],"qd_minus":[…],"qd_plus":[…],"point":[…]?} of a robot; - is standard input
    #[arg(long, value_name = "FILE")]
    velocities: Option<PathBuf>,
    /// Poses in the flights around impacts: JSON lines
    /// {"before":{"t":[…],"q":[[…],…]},"after":{"t":[…],"q":[[…],…]},"point":[…]?}; or a folder of tosses, for the first
    /// impact of each
    #[arg(long, value_name = "FILE|FOLDER")]
    flights: Option<PathBuf>,
    /// Whole tosses: a folder with tosses.csv and a URDF, as for `tosses`
    #[arg(long, value_name = "FOLDER")]
    tosses: Option<PathBuf>,
}

/// What the flights told.
#[derive(Default)]
pub struct Flights {
    /// Numbers of the tosses, or of the lines, that were joined.
    numbers: Vec<i64>,
    /// What each misses its samples by, m.
    rests: Vec<f64>,
    /// How exactly each knows its jump, m/s.
    deviations: Vec<f64>,
    /// Tosses that were left out, with the reason.
    left_out: Vec<(i64, String)>,
}

impl FitCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let loss = if self.loss == "squares" { Loss::Squares } else { Loss::Huber };
        let options = FitOptions {
            law: &self.law,
            loss,
            inertia: self.inertia,
            max_friction: self.max_friction,
            train: self.train,
            seed: self.seed,
            confidence: self.confidence,
        };
        let Source { velocities, flights, tosses } = &self.source;
        let mut told = Flights::default();
        let path = velocities.as_deref().or(flights.as_deref()).or(tosses.as_deref()).unwrap_or(Path::new("-"));
        let refuse = |e: FitError| CliError::Option(format!("{}: {e}", name(path)));
        let fit = if tosses.is_some() {
            let tosses = self.tosses(path)?;
            let roll =
                RollOutOptions { tolerance: self.tolerance, contact_step: self.contact_step, length: self.length };
            let bar = Bar::new("trials");
            fit_trajectories(&tosses, &options, &roll, &|done, all| bar.tell(done, all)).map_err(refuse)?
        } else {
            let (impacts, chain) = if velocities.is_some() {
                self.jumps(path)?
            } else if path.is_dir() {
                let tosses = self.tosses(path)?;
                let bar = Bar::new("flights");
                let impacts = self.first_impacts(path, &tosses, &mut told, &|done, all| bar.tell(done, all))?;
                (impacts, Some(tosses.chain))
            } else {
                self.flights(path, &mut told)?
            };
            let bar = Bar::new("parts");
            let mut fit =
                fit_velocities(&impacts, chain.as_ref(), &options, &|done, all| bar.tell(done, all)).map_err(refuse)?;
            number(&mut fit, &told.numbers);
            fit
        };
        let report = report::Report::new(&fit, &told, &self);
        answer(out, &report, self.json, report::for_people).map_err(|refused| CliError::refused(path, refused))
    }

    fn tosses(&self, folder: &Path) -> Result<Tosses, CliError> {
        let robot = self.robot.as_deref().map(Path::to_string_lossy);
        let tosses = Tosses::read(folder, robot.as_deref()).map_err(|e| CliError::Scene(e.to_string()))?;
        for warning in tosses.chain.warnings() {
            say(&format!("warning: {warning}"));
        }
        Ok(tosses)
    }

    fn robot_args(&self) -> Option<RobotArgs> {
        let urdf = self.robot.clone()?;
        Some(RobotArgs { urdf, floating: self.floating, no_meshes: self.no_meshes })
    }
}

/// Names the impacts by their toss where they have one, by their line counted from 1 where not.
fn number(fit: &mut Fit, numbers: &[i64]) {
    for one in &mut fit.each {
        one.number = numbers.get(one.number as usize).copied().unwrap_or(one.number + 1);
    }
}

/// A file's name for people.
fn name(path: &Path) -> String {
    if path == Path::new("-") { "<stdin>".into() } else { path.display().to_string() }
}

/// A progress bar on a terminal, and none elsewhere.
struct Bar(ProgressBar);

impl Bar {
    fn new(what: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} {prefix}, {elapsed} so far, {eta} to go");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Self(bar.with_prefix(what))
    }

    fn tell(&self, done: usize, all: usize) {
        self.0.set_length(all as u64);
        self.0.set_position(done as u64);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

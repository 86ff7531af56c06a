//! `carom fit`: coefficients of restitution and friction fitted to recorded impacts.

mod read;
mod report;

use crate::error::CliError;
use crate::input::{Given, LoadArgs, name, parse_vector, tell, words};
use crate::law::{Refusal, laws};
use crate::output::{Bar, answer_about};
use carom_chain::Chain;
use carom_impact::LAW_NAMES;
use carom_study::fit::{Fit, FitError, FitOptions, Joined, Loss, MeasuredImpact, fit_trajectories, fit_velocities};
use carom_study::{Horizon, RollOutOptions, Start, Tosses};
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Fit coefficients of restitution and friction to recorded impacts
///
/// Minimises the error of the law's predictions over restitution (0 to 1), friction (0 to
/// --max-friction; frictionless has none) and, with --inertia, the scale of rotational inertia
/// (0.5 to 2). All data are fitted unless --train says otherwise.
///
/// Input: one of --velocities, --flights and --tosses. The three kinds of data give different
/// coefficients; the output names the kind.
/// Output: the coefficients with their confidence intervals; the errors (m/s for velocities and
/// flights, the pose error of --length for tosses) of the part that was fitted (train) and of the
/// rest (test): mean and median, and for impacts the error that the best impulse in the friction
/// cone and the best impulse of any direction would leave; for tosses the pose errors over the whole
/// toss and to 0.1 s after the first impact; the worst impacts or tosses; notes.
/// JSON keys: fitted_to, law, loss, threshold, confidence, seed, start, horizon, coefficients
///   [{name, value, low, high, interval}], train and test {count, mean, median, below_half,
///   whole_mean, whole_median, early_mean, early_median, least_in_cone, least},
///   flights {joined, rest (m), deviation (m/s), outliers [{number, time}], left_out}, notes,
///   trials, each [{number, trained, error, whole, early, least_in_cone, least}]; with --law all
///   fits [these keys of each law, least error first] and refused [{law, reason}].
/// All lines are read before the fit: if one is refused, nothing is printed, and the exit status
/// is 1.
#[derive(Args)]
#[command(verbatim_doc_comment)]
#[command(override_usage = "carom fit [OPTIONS] <--velocities <FILE>|--flights <FILE|FOLDER>|--tosses <FOLDER>>")]
pub struct FitCommand {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    at: AtRobot,
    /// Acceleration of gravity in flights, world axes, m/s²
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,-9.81", value_parser = parse_vector, allow_hyphen_values = true, conflicts_with = "velocities")]
    gravity: [f64; 3],
    /// Impact law; all fits every law and prints one table, least error first
    #[arg(long, value_parser = laws(true), default_value = "energetic")]
    law: String,
    /// Fit the scale of rotational inertia as well, from 0.5 to 2; needs a robot
    ///
    /// One factor for the moments of inertia of all moving bodies about their centres of mass. Links on
    /// fixed joints are parts of one body.
    #[arg(long, verbatim_doc_comment)]
    inertia: bool,
    /// Loss of an error: huber is its square up to twice the median error, linear beyond
    #[arg(long, value_parser = words(&Loss::ALL, Loss::name), default_value = "huber")]
    loss: Loss,
    /// Largest friction of the search, above 0, at most 100
    #[arg(long, value_name = "MU", default_value_t = 1.0, allow_hyphen_values = true)]
    max_friction: f64,
    /// Share of the impacts or tosses that is fitted, above 0, at most 1; the rest is the test
    ///
    /// With a test the error is that of predictions, which compares laws fairly. `carom compare` does
    /// so with every impact in turn.
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, verbatim_doc_comment, allow_hyphen_values = true)]
    train: f64,
    /// Seed of the split into train and test, and of the bootstrap
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Confidence level of the intervals, 0.5 or more, below 1
    #[arg(long, default_value_t = 0.95, allow_hyphen_values = true)]
    confidence: f64,
    /// Length L of the tosses' pose error, m: mean |Δp|²/L + mean Δθ² over the samples
    #[arg(long, value_name = "METRES", default_value_t = 0.0524, allow_hyphen_values = true, conflicts_with_all = ["velocities", "flights"])]
    length: f64,
    /// State at the start of tosses: fitted to the poses of the flight before the first impact, or
    /// given by the first free sample of the table
    #[arg(long, value_parser = words(&Start::ALL, Start::name), default_value = "fitted", verbatim_doc_comment, conflicts_with_all = ["velocities", "flights"])]
    start: Start,
    /// Part of the tosses that is fitted: whole, or early, to 0.1 s after the first impact
    #[arg(long, value_parser = words(&Horizon::ALL, Horizon::name), default_value = "whole", conflicts_with_all = ["velocities", "flights"])]
    horizon: Horizon,
    /// Relative tolerance of the integration of tosses
    #[arg(long, default_value = "1e-6", allow_hyphen_values = true, conflicts_with_all = ["velocities", "flights"])]
    tolerance: f64,
    /// Length of a time step of tosses, where time steps are computed, s
    #[arg(long, value_name = "SECONDS", default_value_t = 1e-3, allow_hyphen_values = true, conflicts_with_all = ["velocities", "flights"])]
    contact_step: f64,
    /// Print one line of JSON, with the error of every impact or toss, instead of a table
    #[arg(long)]
    json: bool,
}

// The robot of measured impacts, and their contact.
#[derive(Args)]
pub struct AtRobot {
    /// Robot (URDF file); for a folder of tosses, its name in the folder [default: the only one]
    #[arg(long, value_name = "ROBOT.urdf")]
    pub robot: Option<PathBuf>,
    /// Add a floating joint between the world and the root link; always so for folders of tosses
    #[arg(long)]
    floating: bool,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Order of the joints in q and qd of JSON lines [default: the order of the file]
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    joints: Option<Vec<String>>,
    /// Link of the contact point [default for flights: the lowest point of the collision shapes]
    #[arg(long, visible_alias = "frame", value_name = "LINK")]
    pub tip: Option<String>,
    /// Contact point in the axes of the link, m; "point" of a line replaces it
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = parse_vector, allow_hyphen_values = true)]
    point: [f64; 3],
    /// Surface normal in world axes, from the environment to the robot
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,1", value_parser = parse_vector, allow_hyphen_values = true)]
    normal: [f64; 3],
}

// The recorded data.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// Velocities before and after impacts: JSON lines (- is standard input), or a CSV table
    ///
    /// {"delassus":[[…],…],"u_minus":[…],"u_plus":[…]} (1/kg, m/s) in contact axes, tangents
    /// first, normal last; or, with --robot and --tip, {"q":[…],"qd_minus":[…],"qd_plus":[…]}, to
    /// which "point":[x,y,z] (m) may be added, or what `carom impact --json` prints for one law.
    /// "qd" is read as "qd_minus". A table (.csv) has the columns q.<joint>, qd_minus.<joint>,
    /// qd_plus.<joint> in any order and, if wanted, point.x, point.y, point.z; others are not read.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    velocities: Option<PathBuf>,
    /// Poses in the flights before and after impacts, one JSON object per line, or a folder
    ///
    /// {"before":{"t":[…],"q":[[…],…]},"after":{"t":[…],"q":[[…],…]}} (s; rad, m), with --robot;
    /// "point":[x,y,z] (m) may be added. Velocities, pose and time of the impact come from fits
    /// of both flights. Samples that contradict all others of their flights (mistracked ones) are
    /// left out and listed. A folder of tosses gives the first impact of each toss.
    #[arg(long, value_name = "FILE|FOLDER", verbatim_doc_comment)]
    flights: Option<PathBuf>,
    /// Whole tosses: a folder with tosses.csv and a URDF, as for `carom tosses`
    #[arg(long, value_name = "FOLDER")]
    tosses: Option<PathBuf>,
}

/// Results of joining flights.
#[derive(Default)]
pub struct Flights {
    /// Numbers of the tosses, or of the lines, that were joined.
    numbers: Vec<i64>,
    /// Root mean square distance of each fit from its samples, m.
    rests: Vec<f64>,
    /// Standard deviation of each velocity jump, m/s.
    deviations: Vec<f64>,
    /// Samples that were left out as outliers: number and time, s.
    outliers: Vec<(i64, f64)>,
    /// Tosses that were left out, with the reason.
    left_out: Vec<(i64, String)>,
}

impl Flights {
    fn add(&mut self, number: i64, joined: &Joined) {
        self.numbers.push(number);
        self.rests.push(joined.rest);
        self.deviations.push(joined.deviation);
        self.outliers.extend(joined.outliers.iter().map(|time| (number, *time)));
    }
}

/// What is fitted.
enum Data {
    Impacts(Vec<MeasuredImpact>, Option<Chain>),
    Tosses(Tosses, RollOutOptions),
}

impl FitCommand {
    pub fn run(self, given: &Given, out: &mut dyn Write) -> Result<(), CliError> {
        self.refuse(given)?;
        let Source { velocities, flights, tosses } = &self.source;
        let mut told = Flights::default();
        let path = velocities.as_deref().or(flights.as_deref()).or(tosses.as_deref()).unwrap_or(Path::new("-"));
        let refuse = |e: FitError| CliError::Input(format!("{}: {e}", name(path)));
        let data = if tosses.is_some() {
            let roll = RollOutOptions {
                tolerance: self.tolerance,
                contact_step: self.contact_step,
                length: self.length,
                start: self.start,
                horizon: self.horizon,
                ..RollOutOptions::default()
            };
            Data::Tosses(self.tosses(path)?, roll)
        } else {
            let (impacts, chain) = if velocities.is_some() {
                self.at.jumps(path)?
            } else if path.is_dir() {
                let tosses = self.tosses(path)?;
                let bar = bar("flights");
                let impacts = self.first_impacts(path, &tosses, &mut told, &|done, all| bar.tell(done, all))?;
                (impacts, Some(tosses.chain))
            } else {
                let bar = bar("flights");
                self.flights(path, &mut told, &|done, all| bar.tell(done, all))?
            };
            Data::Impacts(impacts, chain)
        };
        if self.law != "all" {
            let fit = self.fit(&self.law, &data, &told).map_err(refuse)?;
            let report = report::Report::new(&fit, &told, &self);
            return answer_about(path, out, &report, self.json, report::for_people);
        }
        let (mut fits, mut refused) = (Vec::new(), Vec::new());
        for law in LAW_NAMES {
            match self.fit(law, &data, &told) {
                Ok(fit) => fits.push(fit),
                // all other errors hold for every law
                Err(FitError::Refused(reason)) => refused.push(Refusal { law, reason }),
                Err(e) => return Err(refuse(e)),
            }
        }
        let all = report::All::new(fits.iter().map(|fit| report::Report::new(fit, &told, &self)).collect(), refused);
        answer_about(path, out, &all, self.json, report::table)
    }

    /// Refuses options that the data make no use of.
    fn refuse(&self, given: &Given) -> Result<(), CliError> {
        let Source { flights, tosses, .. } = &self.source;
        if tosses.is_some() {
            let why = "whole tosses take gravity, the normal of the floor, the order of the joints and the points that touch from their folder";
            return given.refuse(&["gravity", "normal", "joints", "tip", "point"], why);
        }
        if flights.as_deref().is_some_and(Path::is_dir) {
            given.refuse(&["joints"], "the tosses of a folder name their columns")?;
            if self.at.tip.is_none() {
                given.refuse(&["point"], "it is a point of the link of --tip: give it, too")?;
            }
            return Ok(());
        }
        self.at.refuse(given)
    }

    /// The fit of one law.
    fn fit(&self, law: &str, data: &Data, told: &Flights) -> Result<Fit, FitError> {
        let options = FitOptions {
            law,
            loss: self.loss,
            inertia: self.inertia,
            max_friction: self.max_friction,
            train: self.train,
            seed: self.seed,
            confidence: self.confidence,
        };
        match data {
            Data::Tosses(tosses, roll) => {
                let bar = bar("trials");
                fit_trajectories(tosses, &options, roll, &|done, all| bar.tell(done, all))
            }
            Data::Impacts(impacts, chain) => {
                let bar = bar("parts");
                let mut fit = fit_velocities(impacts, chain.as_ref(), &options, &|done, all| bar.tell(done, all))?;
                number(&mut fit, &told.numbers);
                Ok(fit)
            }
        }
    }

    fn tosses(&self, folder: &Path) -> Result<Tosses, CliError> {
        let robot = self.at.robot.as_deref().map(Path::to_string_lossy);
        let options = self.at.load.options(true)?;
        let tosses = Tosses::read(folder, robot.as_deref(), &options).map_err(|e| CliError::Input(e.to_string()))?;
        tell(&folder.display().to_string(), &tosses.chain);
        Ok(tosses)
    }
}

/// Numbers the impacts by their toss if they have one, else by their line, counted from 1.
fn number(fit: &mut Fit, numbers: &[i64]) {
    for one in &mut fit.each {
        one.number = numbers.get(one.number as usize).copied().unwrap_or(one.number + 1);
    }
}

/// The middle one of the numbers in ascending order, of an even number of them the greater of two; 0 without numbers.
fn middle(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or_default()
}

/// A progress bar of these.
pub fn bar(what: &str) -> Bar {
    Bar::new(None, &format!("{{bar:40}} {{pos}}/{{len}} {what}, {{elapsed}} so far, {{eta}} to go"))
}

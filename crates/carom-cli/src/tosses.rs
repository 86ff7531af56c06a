//! `carom tosses`: simulation of measured tosses.

use crate::error::CliError;
use crate::input::{LoadArgs, check_coefficients, tell, within};
use crate::law::{laws, tangential};
use crate::output::{answer, short};
use carom_impact::Coefficients;
use carom_sim::{ContactLaw, ContactRule};
use carom_study::{PoseError, RollOut, RollOutOptions, Start, TossError, Tosses};
use clap::{Args, builder::PossibleValuesParser};
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;

/// Simulate measured tosses and print the error of the simulated poses
///
/// Simulates each toss of a floating robot from its first sample that does not touch the floor to
/// its last. The floor is z = 0, and gravity is 9.81 m/s² along −z. The state at the start is fitted
/// to all samples of the flight before the first impact, unless --start says otherwise.
///
/// Input: a folder with a URDF and the table tosses.csv, whose columns are toss, k, t (s), px, py,
/// pz (m), qw, qx, qy, qz (rotation of the root link in the world), vx, vy, vz (m/s, world axes),
/// wx, wy, wz (rad/s, the link's own axes) and, if the robot has a joint, theta, dtheta.
/// Output: how many tosses were simulated, refused and at rest (below 0.001 m/s) at the last sample;
/// the deepest overlap (m); the errors of position (m), rotation and joint (degrees; rad in JSON),
/// at the last sample and averaged over the samples, each as mean and median over the tosses; the
/// pose error of --length over the whole toss and to 0.1 s after the first impact.
/// JSON keys: tosses, failures, start, fitted_starts, at_rest, deepest_overlap, last and mean
///   {position_mean, position_median, rotation_…, joint_…}, whole and early {count, mean, median,
///   below_half}, each [{toss, samples, events, position, rotation, joint, final_speed (m/s),
///   deepest_overlap, whole, early}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct TossesCommand {
    /// Folder with tosses.csv and a URDF
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Name of the URDF in the folder [default: the only one]
    #[arg(long, value_name = "ROBOT.urdf")]
    robot: Option<String>,
    #[command(flatten)]
    load: LoadArgs,
    /// Impact law
    #[arg(long, value_parser = laws(false), default_value = "whittaker")]
    law: String,
    /// Coefficient of restitution, 0 to 1
    #[arg(long, visible_alias = "e", value_name = "E", default_value_t = 0.0, allow_hyphen_values = true)]
    restitution: f64,
    /// Coefficient of Coulomb friction, 0 or more
    #[arg(long, visible_alias = "mu", value_name = "MU", default_value_t = 0.3, allow_hyphen_values = true)]
    friction: f64,
    /// Coefficient of tangential restitution, -1 to 1, of chatterjee-ruina only [default: 0]
    #[arg(long, value_name = "ET", allow_hyphen_values = true)]
    tangential_restitution: Option<f64>,
    /// State at the start: fitted to the poses of the flight before the first impact, or given by
    /// the first free sample of the table
    #[arg(long, value_parser = PossibleValuesParser::new(["fitted", "given"]), default_value = "fitted", verbatim_doc_comment)]
    start: String,
    /// Length L of the pose error, m: mean |Δp|²/L + mean Δθ² over the samples
    #[arg(long, value_name = "METRES", default_value_t = 0.0524, allow_hyphen_values = true)]
    length: f64,
    /// Relative tolerance of the integration
    #[arg(long, default_value = "1e-9", allow_hyphen_values = true)]
    tolerance: f64,
    /// Length of a time step, where time steps are computed, s
    #[arg(long, value_name = "SECONDS", default_value_t = 5e-4, allow_hyphen_values = true)]
    contact_step: f64,
    /// Print one line of JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    tosses: usize,
    failures: Vec<String>,
    start: &'static str,
    fitted_starts: usize,
    at_rest: usize,
    deepest_overlap: f64,
    last: Spread,
    mean: Spread,
    whole: Measure,
    #[serde(skip_serializing_if = "Option::is_none")]
    early: Option<Measure>,
    each: Vec<One>,
}

/// The pose error of a part of the tosses.
#[derive(Serialize)]
struct Measure {
    count: usize,
    mean: f64,
    median: f64,
    below_half: f64,
}

/// Mean and median over the tosses.
#[derive(Serialize)]
struct Spread {
    position_mean: f64,
    position_median: f64,
    rotation_mean: f64,
    rotation_median: f64,
    joint_mean: f64,
    joint_median: f64,
}

#[derive(Serialize)]
struct One {
    toss: i64,
    samples: usize,
    events: usize,
    position: f64,
    rotation: f64,
    joint: f64,
    final_speed: f64,
    deepest_overlap: f64,
    whole: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    early: Option<f64>,
}

/// Speed of the root link below which a toss counts as at rest, m/s.
const REST: f64 = 1e-3;

impl TossesCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let Self { restitution, friction, .. } = self;
        check_coefficients(restitution, friction)?;
        let tangential_restitution = tangential(&self.law, self.tangential_restitution)?;
        for (option, x) in
            [("--tolerance", self.tolerance), ("--contact-step", self.contact_step), ("--length", self.length)]
        {
            within(option, x, f64::MIN_POSITIVE..=f64::MAX, "it must be positive and finite")?;
        }
        let refuse = |e: TossError| CliError::Scene(e.to_string());
        let options = self.load.options(true);
        let tosses = Tosses::read(&self.folder, self.robot.as_deref(), &options).map_err(refuse)?;
        tell(&self.folder.display().to_string(), &tosses.chain);
        let law = ContactLaw::named(&self.law, Coefficients { restitution, tangential_restitution, friction });
        let rule = ContactRule::new(law.unwrap_or_else(|| unreachable!("the option accepts names of laws only")));
        let roll = RollOutOptions {
            tolerance: self.tolerance,
            contact_step: self.contact_step,
            length: self.length,
            start: start(&self.start),
            ..RollOutOptions::default()
        };
        let all = tosses.roll_out(&rule, &roll);
        let (mut rolled, mut failures) = (Vec::new(), Vec::new());
        for one in all {
            match one {
                Ok(one) => rolled.push(one),
                Err(error) => failures.push(error.to_string()),
            }
        }
        if rolled.is_empty() {
            let first = failures.first().cloned().unwrap_or_default();
            return Err(CliError::Scene(format!("{}: {first}", self.folder.display())));
        }
        let report = report(&rolled, failures, &roll);
        answer(out, &report, self.json, for_people).map_err(|refused| CliError::refused(&self.folder, refused))
    }
}

/// The start of that name.
pub fn start(name: &str) -> Start {
    if name == Start::Given.name() { Start::Given } else { Start::Fitted }
}

fn report(rolled: &[RollOut], failures: Vec<String>, roll: &RollOutOptions) -> Report {
    let measure = |of: &dyn Fn(&RollOut) -> Option<f64>| {
        let mut errors: Vec<f64> = rolled.iter().filter_map(of).collect();
        errors.sort_by(f64::total_cmp);
        let count = errors.len();
        let below = errors.iter().filter(|error| **error < 0.5).count();
        (count > 0).then(|| Measure {
            count,
            mean: errors.iter().sum::<f64>() / count as f64,
            median: errors[count / 2],
            below_half: below as f64 / count as f64,
        })
    };
    let whole = measure(&|one| Some(one.pose_error(roll.length)));
    let spread = |of: fn(&RollOut) -> &PoseError| {
        let sorted = |part: fn(&PoseError) -> f64| {
            let mut values: Vec<f64> = rolled.iter().map(|one| part(of(one))).collect();
            values.sort_by(f64::total_cmp);
            (values.iter().sum::<f64>() / values.len() as f64, values[values.len() / 2])
        };
        let (position, rotation, joint) = (sorted(|e| e.position), sorted(|e| e.rotation), sorted(|e| e.joint));
        Spread {
            position_mean: position.0,
            position_median: position.1,
            rotation_mean: rotation.0,
            rotation_median: rotation.1,
            joint_mean: joint.0,
            joint_median: joint.1,
        }
    };
    let one = |one: &RollOut| One {
        toss: one.number,
        samples: one.samples,
        events: one.events,
        position: one.last.position,
        rotation: one.last.rotation,
        joint: one.last.joint,
        final_speed: one.final_speed,
        deepest_overlap: one.deepest,
        whole: one.pose_error(roll.length),
        early: one.early_error(roll.length),
    };
    Report {
        tosses: rolled.len() + failures.len(),
        failures,
        start: roll.start.name(),
        fitted_starts: rolled.iter().filter(|one| one.fitted).count(),
        at_rest: rolled.iter().filter(|one| one.final_speed < REST).count(),
        deepest_overlap: rolled.iter().map(|one| one.deepest).fold(0.0, f64::max),
        last: spread(|one| &one.last),
        mean: spread(|one| &one.mean),
        whole: whole.unwrap_or_else(|| unreachable!("at least one toss was simulated")),
        early: measure(&|one| one.early_error(roll.length)),
        each: rolled.iter().map(one).collect(),
    }
}

fn for_people(report: &Report, out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "{} tosses simulated, {} refused, {} at rest at their last sample, deepest overlap {} m",
        report.tosses - report.failures.len(),
        report.failures.len(),
        report.at_rest,
        short(report.deepest_overlap)
    )?;
    writeln!(out, "{} starts fitted to the flight, the others given by the table", report.fitted_starts)?;
    for failure in &report.failures {
        writeln!(out, "  {failure}")?;
    }
    let degrees = |x: f64| short(x.to_degrees());
    writeln!(out, "{:26} {:>12} {:>12} {:>12}", "error of the pose", "position m", "rotation °", "joint °")?;
    for (name, s) in [("at the last sample", &report.last), ("mean over the samples", &report.mean)] {
        writeln!(
            out,
            "{:26} {:>12} {:>12} {:>12}",
            format!("{name}, mean"),
            short(s.position_mean),
            degrees(s.rotation_mean),
            degrees(s.joint_mean)
        )?;
        writeln!(
            out,
            "{:26} {:>12} {:>12} {:>12}",
            format!("{name}, median"),
            short(s.position_median),
            degrees(s.rotation_median),
            degrees(s.joint_median)
        )?;
    }
    writeln!(out, "{:26} {:>12} {:>12} {:>12}", "pose error", "mean", "median", "below 0.5")?;
    for (name, measure) in [("whole toss", Some(&report.whole)), ("0.1 s past first impact", report.early.as_ref())] {
        let Some(m) = measure else { continue };
        writeln!(out, "{name:26} {:>12} {:>12} {:>12}", short(m.mean), short(m.median), short(m.below_half))?;
    }
    Ok(())
}

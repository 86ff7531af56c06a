//! `carom tosses`: simulation of measured tosses.

use crate::LoadArgs;
use crate::error::CliError;
use crate::input::{check_coefficients, tell, within};
use crate::law::{laws, tangential};
use crate::output::{answer, short};
use carom_impact::Coefficients;
use carom_sim::{ContactLaw, ContactRule};
use carom_study::{PoseError, RollOut, TossError, Tosses};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;

/// Simulate measured tosses and print the error of the simulated poses
///
/// Simulates each toss of a floating robot from its first sample that does not touch the floor to
/// its last. The floor is z = 0, and gravity is 9.81 m/s² along −z.
///
/// Input: a folder with a URDF and the table tosses.csv, whose columns are toss, k, t (s), px, py,
/// pz (m), qw, qx, qy, qz (rotation of the root link in the world), vx, vy, vz (m/s, world axes),
/// wx, wy, wz (rad/s, the link's own axes) and, if the robot has a joint, theta, dtheta.
/// Output: how many tosses were simulated, refused and at rest (below 0.001 m/s) at the last sample;
/// the deepest overlap (m); the errors of position (m), rotation and joint (degrees; rad in JSON),
/// at the last sample and averaged over the samples, each as mean and median over the tosses.
/// JSON keys: tosses, failures, at_rest, deepest_overlap, last and mean {position_mean,
///   position_median, rotation_…, joint_…}, each [{toss, samples, events, position, rotation,
///   joint, final_speed (m/s), deepest_overlap}].
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
    #[arg(long, value_parser = laws(None), default_value = "whittaker")]
    law: String,
    /// Coefficient of restitution, 0 to 1
    #[arg(long, value_name = "E", default_value_t = 0.0, allow_hyphen_values = true)]
    restitution: f64,
    /// Coefficient of Coulomb friction, 0 or more
    #[arg(long, value_name = "MU", default_value_t = 0.3, allow_hyphen_values = true)]
    friction: f64,
    /// Coefficient of tangential restitution, -1 to 1, of chatterjee-ruina only [default: 0]
    #[arg(long, value_name = "ET", allow_hyphen_values = true)]
    tangential_restitution: Option<f64>,
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
    at_rest: usize,
    deepest_overlap: f64,
    last: Spread,
    mean: Spread,
    each: Vec<One>,
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
}

/// Speed of the root link below which a toss counts as at rest, m/s.
const REST: f64 = 1e-3;

impl TossesCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let Self { restitution, friction, .. } = self;
        check_coefficients(restitution, friction)?;
        let tangential_restitution = tangential(&self.law, self.tangential_restitution)?;
        for (option, x) in [("--tolerance", self.tolerance), ("--contact-step", self.contact_step)] {
            within(option, x, f64::MIN_POSITIVE..=f64::MAX, "it must be positive and finite")?;
        }
        let refuse = |e: TossError| CliError::Scene(e.to_string());
        let options = self.load.options(true);
        let tosses = Tosses::read(&self.folder, self.robot.as_deref(), &options).map_err(refuse)?;
        tell(&self.folder.display().to_string(), &tosses.chain);
        let law = ContactLaw::named(&self.law, Coefficients { restitution, tangential_restitution, friction });
        let rule = ContactRule::new(law.unwrap_or_else(|| unreachable!("the option accepts names of laws only")));
        let all = tosses.roll_out(&rule, self.tolerance, self.contact_step);
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
        let report = report(&rolled, failures);
        answer(out, &report, self.json, for_people).map_err(|refused| CliError::refused(&self.folder, refused))
    }
}

fn report(rolled: &[RollOut], failures: Vec<String>) -> Report {
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
    };
    Report {
        tosses: rolled.len() + failures.len(),
        failures,
        at_rest: rolled.iter().filter(|one| one.final_speed < REST).count(),
        deepest_overlap: rolled.iter().map(|one| one.deepest).fold(0.0, f64::max),
        last: spread(|one| &one.last),
        mean: spread(|one| &one.mean),
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
    for failure in &report.failures {
        writeln!(out, "  {failure}")?;
    }
    let degrees = |x: f64| short(x.to_degrees());
    writeln!(out, "{:26} {:>12} {:>12} {:>12}", "error of the pose", "position m", "rotation °", "joint °")?;
    for (name, s) in [("at the last sample", &report.last), ("mean over the samples", &report.mean)] {
        writeln!(
            out,
            "{:26} {:>12} {:>12} {:>12}\n{:26} {:>12} {:>12} {:>12}",
            format!("{name}, mean"),
            short(s.position_mean),
            degrees(s.rotation_mean),
            degrees(s.joint_mean),
            format!("{name}, median"),
            short(s.position_median),
            degrees(s.rotation_median),
            degrees(s.joint_median)
        )?;
    }
    Ok(())
}

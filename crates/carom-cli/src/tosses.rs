//! `carom tosses`: simulation of measured tosses.

use crate::error::CliError;
use crate::input::{LoadArgs, check_coefficients, tell, within, words};
use crate::law::{laws, tangential};
use crate::output::{answer_about, short};
use carom_impact::Coefficients;
use carom_sim::{ContactLaw, ContactRule};
use carom_study::{RollOutOptions, Start, TossError, TossReport, Tosses};
use clap::Args;
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
    #[arg(long, value_parser = words(&Start::ALL, Start::name), default_value = "fitted", verbatim_doc_comment)]
    start: Start,
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

impl TossesCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let Self { restitution, friction, .. } = self;
        check_coefficients(restitution, friction)?;
        let tangential_restitution = tangential(&self.law, self.tangential_restitution)?;
        for (option, x) in [("--contact-step", self.contact_step), ("--length", self.length)] {
            within(option, x, f64::MIN_POSITIVE..=f64::MAX, "it must be positive and finite")?;
        }
        within("--tolerance", self.tolerance, f64::EPSILON..=0.1, "it must be from 2.3e-16 to 0.1")?;
        let refuse = |e: TossError| CliError::Input(e.to_string());
        let options = self.load.options(true)?;
        let tosses = Tosses::read(&self.folder, self.robot.as_deref(), &options).map_err(refuse)?;
        tell(&self.folder.display().to_string(), &tosses.chain);
        let law = ContactLaw::named(&self.law, Coefficients { restitution, tangential_restitution, friction });
        let rule = ContactRule::new(law.unwrap_or_else(|| unreachable!("the option accepts names of laws only")));
        let roll = RollOutOptions {
            tolerance: self.tolerance,
            contact_step: self.contact_step,
            length: self.length,
            start: self.start,
            ..RollOutOptions::default()
        };
        let report = tosses.report(&rule, &roll);
        let report = report.map_err(|e| CliError::Input(format!("{}: {e}", self.folder.display())))?;
        answer_about(&self.folder, out, &report, self.json, for_people)
    }
}

fn for_people(report: &TossReport, out: &mut dyn Write) -> io::Result<()> {
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
    let mut row = |name: &str, [a, b, c]: [&str; 3]| writeln!(out, "{name:26} {a:>12} {b:>12} {c:>12}");
    row("error of the pose", ["position m", "rotation °", "joint °"])?;
    for (name, s) in [("at the last sample", &report.last), ("mean over the samples", &report.mean)] {
        let mut errors = |kind: &str, position: f64, rotation: f64, joint: f64| {
            row(&format!("{name}, {kind}"), [&short(position), &degrees(rotation), &degrees(joint)])
        };
        errors("mean", s.position_mean, s.rotation_mean, s.joint_mean)?;
        errors("median", s.position_median, s.rotation_median, s.joint_median)?;
    }
    row("pose error", ["mean", "median", "below 0.5"])?;
    for (name, measure) in [("whole toss", Some(&report.whole)), ("0.1 s past first impact", report.early.as_ref())] {
        let Some(m) = measure else { continue };
        row(name, [&short(m.mean), &short(m.median), &short(m.below_half)])?;
    }
    Ok(())
}

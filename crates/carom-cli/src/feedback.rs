//! `carom feedback`: gains along the motion of a scene, through its impacts.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::output::{answer_about, brief, write_whole};
use crate::scene::load;
use carom_sim::Regulator;
use carom_study::{Growth, Tracked, tracked};
use clap::Args;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Add feedback to the motion of a scene: gains over time, through its impacts
///
/// Input: a scene (TOML) with the controller off, constant or torque-file, as `carom aim` writes it.
///
/// The gains are those of the linear-quadratic regulator of the motion, linearised through its
/// impacts. Deviations of --position, --velocity and --torque cost the same, each for as long as the
/// others. The motion is compared with the part of the reference after as many impacts as it had;
/// each part goes on beyond its ends, for a motion that strikes early or late.
///
/// Output: by what factor small disturbances of the start grow until the end at most, without and
/// with the feedback, in units of these deviations. --out writes the scene with the feedback, and
/// its table X.feedback.csv beside it.
/// JSON keys: rows, motors, impacts, growth {without, with}; where derivatives end, as at time
///   steps, the factor is left out.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct FeedbackCommand {
    /// Scene (TOML file)
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Deviation of each displacement, rad, m
    #[arg(long, value_name = "DEVIATION", default_value_t = 0.01)]
    position: f64,
    /// Deviation of each velocity, rad/s, m/s
    #[arg(long, value_name = "DEVIATION", default_value_t = 0.1)]
    velocity: f64,
    /// Deviation of each motor's force, N m, N
    #[arg(long, value_name = "DEVIATION", default_value_t = 1.0)]
    torque: f64,
    /// For how long a deviation lasts that costs what it costs at the end of the motion, s
    #[arg(long, value_name = "TIME", default_value_t = 1.0)]
    end: f64,
    /// Joints that have feedback, separated by commas [default: those with forces in the motion, or all]
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    joints: Vec<String>,
    /// Least number of rows of the table
    #[arg(long, value_name = "N", default_value_t = 200)]
    rows: usize,
    /// Scene file to write (.toml), with its table X.feedback.csv beside it
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

impl FeedbackCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let outputs = Outputs::of(self.out.as_slice(), &[Kind::Scene])?;
        let table = outputs.scene.as_ref().map(|path| path.with_extension("feedback.csv"));
        let scene = load(&self.scene)?;
        let mut writes = outputs.files();
        writes.push(("--out", table.as_deref()));
        let reads: Vec<PathBuf> = scene.files.iter().cloned().chain([self.scene.clone()]).collect();
        files::check(&reads, &writes)?;
        let refuse = |e| CliError::scene(&self.scene, e);
        let plan = scene.plan().map_err(refuse)?;
        let Self { position, velocity, torque: force, end, rows, joints, .. } = self;
        let regulator = Regulator { position, velocity, force, end, rows, joints };
        let own = outputs.scene.as_deref().unwrap_or(&self.scene);
        let folder = own.parent().unwrap_or(Path::new("."));
        let name = table.as_deref().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        let found = tracked((&scene, &plan), &regulator, (folder, &name)).map_err(refuse)?;
        if let (Some(path), Some(table)) = (&outputs.scene, &table) {
            write_whole(table, &found.table)?;
            write_whole(path, &found.scene)?;
        }
        answer_about(&self.scene, out, &found, self.json, print)
    }
}

fn print(found: &Tracked, out: &mut dyn Write) -> io::Result<()> {
    let Tracked { rows, motors, impacts, growth: Growth { without, with }, .. } = found;
    let after = if *impacts == 1 { "1 impact".to_owned() } else { format!("{impacts} impacts") };
    writeln!(out, "{rows} rows of gains for {}, through {after}", motors.join(", "))?;
    let told = |factor: &Option<f64>| factor.map_or("no derivative".to_owned(), brief);
    writeln!(out, "growth of small disturbances of the start until the end:")?;
    writeln!(out, "  without feedback  {}", told(without))?;
    writeln!(out, "  with feedback     {}", told(with))
}

//! `carom`: from a URDF to kinematics, dynamics and impacts, on the command line.
//!
//! Each command is a module: it reads its input through [`input`], asks the library, and writes for people or, with
//! `--json`, one line of JSON for each line it read. Exit status: 0 done; 1 the input or the physics was refused, said
//! in one `error: …` line on standard error; 2 usage.

mod chart;
mod consistency;
mod dynamics;
mod error;
mod files;
mod fit;
mod impact;
mod input;
mod inspect;
mod law;
mod map;
mod output;
mod paper;
mod plan;
mod record;
mod scene;
mod simulate;
mod stress;
mod tosses;

use clap::{Args, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;

/// Impacts of kinematic chains: qd⁺ = qd⁻ + M⁻¹ Jᵀ p
#[derive(Parser)]
#[command(
    name = "carom",
    version,
    about,
    term_width = 100, // on every terminal and in every build the lines of the book
    after_help = "Numbers are SI: m, rad, kg, s, N s. Normals point from the environment to the robot."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// What a URDF says: joints, degrees of freedom, mass, whether it moves in a plane, warnings
    Inspect(inspect::Inspect),
    /// Mass matrix, Jacobian, bias, energies and Delassus matrix at given states
    Dynamics(dynamics::Dynamics),
    /// What an impact at a point does to every joint, under one law or all
    Impact(impact::Impact),
    /// An impact law on plain numbers: Delassus matrix and contact velocity in, impulse out
    Law(law::LawCommand),
    /// An impact map: a study's quantities over poses, approaches, coefficients and laws
    Map(map::MapCommand),
    /// What a scene needs, what it leaves out exactly, and what within which bound
    Plan(plan::PlanCommand),
    /// The motion before, through and after the impacts of a scene
    Simulate(simulate::Simulate),
    /// Error against time for every method that can run a scene, other programs' runs on the same axes
    Chart(chart::ChartCommand),
    /// Where methods fail: scenes that break laws and simulators, and what each makes of them
    Stress(stress::StressCommand),
    /// Figures 4 to 10 and Table I of Pagilla & Yu (2004) from the preset arm, and what the model confirms of the paper
    Paper(paper::PaperCommand),
    /// Whether a table of restitutions and energies over angles can come from a frictionless impact at all, and of which pose
    Consistency(consistency::ConsistencyCommand),
    /// Measured tosses from a folder, rolled out from their first free sample, and how far the pose ends from the measured
    Tosses(tosses::TossesCommand),
    /// Coefficients from recorded impacts: velocity jumps, flights around an impact, or whole tosses
    Fit(fit::FitCommand),
}

/// Options of every command that reads a robot.
#[derive(Args)]
struct RobotArgs {
    /// The robot's URDF file
    #[arg(value_name = "ROBOT.urdf")]
    urdf: std::path::PathBuf,
    /// Put a floating joint between world and root: q = x y z qx qy qz qw, qd = linear then angular velocity of the root
    /// link in its own axes, both first in the arrays
    #[arg(long)]
    floating: bool,
    /// Load the robot although meshes of its collision geometry are missing
    #[arg(long)]
    no_meshes: bool,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let stdout = &mut io::stdout().lock();
    let done = match cli.command {
        Command::Inspect(command) => command.run(stdout),
        Command::Dynamics(command) => command.run(stdout),
        Command::Impact(command) => command.run(stdout),
        Command::Law(command) => command.run(stdout),
        Command::Map(command) => command.run(stdout),
        Command::Plan(command) => command.run(stdout),
        Command::Simulate(command) => command.run(stdout),
        Command::Chart(command) => command.run(stdout),
        Command::Stress(command) => command.run(stdout),
        Command::Paper(command) => command.run(stdout),
        Command::Consistency(command) => command.run(stdout),
        Command::Tosses(command) => command.run(stdout),
        Command::Fit(command) => command.run(stdout),
    };
    match done.and_then(|()| Ok(stdout.flush()?)) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads us has had enough: `carom … | head`.
        Err(error::CliError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            output::say(&format!("error: {error}"));
            ExitCode::from(1)
        }
    }
}

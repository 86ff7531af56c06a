//! The `carom` command: kinematics, dynamics, impacts, simulation and fits on the command line.
//!
//! Each command is a module: it reads its input through [`input`], calls the library, and writes tables for people or, with
//! `--json`, one line of JSON for each line of input.
//!
//! Contract of the streams (also in `carom --help`): the exit status is 0 when all is done; 1 when an input is refused, with
//! one line `error: …` on standard error; 2 for a wrong command line. Commands that read lines write the answer to each line
//! before they read the next, so the answers to the lines before a refused one are on standard output. A file that is named
//! by an option is complete or not there.

mod chart;
mod compare;
mod consistency;
mod dynamics;
mod error;
mod files;
mod fit;
mod from_state;
mod impact;
mod input;
mod inspect;
mod law;
mod map;
mod output;
mod paper;
mod plan;
mod record;
mod runs;
mod scene;
mod sensitivity;
mod simulate;
mod stress;
mod survey;
mod tosses;

use clap::{Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;

/// Impacts of kinematic chains: qd⁺ = qd⁻ + M⁻¹ Jᵀ p
///
/// carom computes what an impact does to a robot that is read from a URDF file: the joint velocities
/// qd⁺ after it, the impulse p, and the energy lost, under eight impact laws. It also evaluates the
/// robot's dynamics, simulates scenes with contacts, maps impacts over poses and parameters, and
/// fits coefficients of restitution and friction to measurements.
#[derive(Parser)]
#[command(
    name = "carom",
    version,
    verbatim_doc_comment,
    term_width = 100,
    after_help = AFTER_HELP
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Conventions and the contract of the streams. Lines end by hand before column 100, as those of all help texts.
const AFTER_HELP: &str = "\
Units: SI (m, rad, kg, s, N s, J); degrees only in names that end in _deg.
Normals: unit vectors from the environment to the robot; an approach has u·n < 0.
Floating base: q = x y z qx qy qz qw; qd = linear, then angular velocity in the link's own axes.

Exit status:
  0  Done.
  1  An input is refused. One line `error: …` on standard error names the file, the line or element,
     the value and the rule. Commands that read one problem per line (dynamics, impact, law) have
     then written the answers to all lines before the refused one.
  2  Wrong command line.
A file that an option names is complete or not there: it is written beside its place and renamed.
Warnings are lines `warning: …` on standard error.";

#[derive(Subcommand)]
enum Command {
    Inspect(inspect::Inspect),
    Dynamics(dynamics::Dynamics),
    Impact(impact::Impact),
    Law(law::LawCommand),
    Map(map::MapCommand),
    Plan(plan::PlanCommand),
    Simulate(simulate::Simulate),
    Chart(chart::ChartCommand),
    Stress(stress::StressCommand),
    Paper(paper::PaperCommand),
    Consistency(consistency::ConsistencyCommand),
    Tosses(tosses::TossesCommand),
    Fit(fit::FitCommand),
    Compare(compare::CompareCommand),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let stdout = &mut output::PlainLines(io::stdout().lock());
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
        Command::Compare(command) => command.run(stdout),
    };
    match done.and_then(|()| Ok(stdout.flush()?)) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader has closed the pipe, as in `carom … | head`.
        Err(error::CliError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            output::say(&format!("error: {error}"));
            ExitCode::from(1)
        }
    }
}

//! The `carom` command: kinematics, dynamics, impacts, simulation and fits on the command line.
//!
//! Each command is a module: it reads its input through [`input`], calls the library, and writes tables for people or, with
//! `--json`, one line of JSON for each line of input.
//!
//! Contract of the streams (also in `carom --help`): the exit status is 0 when all is done; 1 when an input is refused, with
//! one line `error: …` on standard error; 2 for a wrong command line. Commands that read lines write the answer to each line
//! before they read the next, so the answers to the lines before a refused one are on standard output. A file that is named
//! by an option is complete or not there.

mod aim;
mod chart;
mod compare;
mod completions;
mod consistency;
mod dynamics;
mod error;
mod feedback;
mod files;
mod fit;
mod from_state;
mod impact;
mod input;
mod inspect;
mod law;
mod map;
mod motion;
mod orbit;
mod output;
mod paper;
mod plan;
mod record;
mod rows;
mod run_error;
mod runs;
mod scene;
mod sensitivity;
mod simulate;
mod stress;
mod survey;
mod tosses;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

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
    /// Print no warnings on standard error (those of inspect are part of its answer)
    #[arg(short, long, global = true, display_order = 998)]
    quiet: bool,
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

Files:
  --out FILE writes what the ending of the name says: .csv or .parquet a table, .svg a picture, .rrd
  a recording for the Rerun viewer; the help of a command lists what it writes. As the name of a
  table, - is CSV on standard output, in place of the answer. Commands that write several files
  have --out FOLDER.
  A file that an option names is complete or not there: it is written beside its place and renamed.

Warnings are lines `warning: …` on standard error; --quiet leaves them out.";

#[derive(Subcommand)]
#[allow(clippy::large_enum_variant)] // there is one value
enum Command {
    #[command(flatten)]
    Use(Use),
    #[command(flatten)]
    Evidence(Evidence),
}

/// Commands on the user's robots, scenes and measurements, in the order of the help.
#[derive(Subcommand)]
enum Use {
    Inspect(inspect::Inspect),
    Dynamics(dynamics::Dynamics),
    Impact(impact::Impact),
    Law(law::LawCommand),
    Map(map::MapCommand),
    Plan(plan::PlanCommand),
    Simulate(simulate::Simulate),
    Aim(aim::AimCommand),
    Feedback(feedback::FeedbackCommand),
    Orbit(orbit::OrbitCommand),
    Tosses(tosses::TossesCommand),
    Fit(fit::FitCommand),
    Compare(compare::CompareCommand),
    Completions(completions::Completions),
}

/// Commands that test laws and methods against theory and publications.
#[derive(Subcommand)]
enum Evidence {
    Chart(chart::ChartCommand),
    Stress(stress::StressCommand),
    Paper(paper::PaperCommand),
    Consistency(consistency::ConsistencyCommand),
}

/// The command line, whose help lists the subcommands in two groups; clap itself has no headings for subcommands.
fn command_line() -> clap::Command {
    let mut command = Cli::command();
    command.build(); // adds `help`
    let evidence = Evidence::augment_subcommands(clap::Command::new(""));
    let evidence: Vec<&str> = evidence.get_subcommands().map(clap::Command::get_name).collect();
    let (header, literal) = (command.get_styles().get_header(), command.get_styles().get_literal());
    let width = command.get_subcommands().map(|one| one.get_name().len()).max().unwrap_or_default();
    let group = |title: &str, in_group: &dyn Fn(&str) -> bool| {
        let mut text = format!("{header}{title}:{header:#}\n");
        for one in command.get_subcommands().filter(|one| in_group(one.get_name())) {
            let (name, about) = (one.get_name(), one.get_about().map(ToString::to_string).unwrap_or_default());
            text += &format!("  {literal}{name:width$}{literal:#}  {about}\n");
        }
        text
    };
    let used = group("Commands", &|name| !evidence.contains(&name));
    let tests = group("Commands that test laws and methods", &|name| evidence.contains(&name));
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{used}\n{tests}\n{header}Options:{header:#}\n{{options}}{{after-help}}"
    );
    Cli::command().help_template(template)
}

fn main() -> ExitCode {
    let mut command = command_line();
    let matches = command.get_matches_mut();
    let given = input::Given::of(&command, &matches);
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.format(&mut command).exit());
    output::QUIET.store(cli.quiet, Ordering::Relaxed);
    let stdout = &mut output::PlainLines(io::stdout().lock());
    let done = match cli.command {
        Command::Use(command) => match command {
            Use::Inspect(command) => command.run(stdout),
            Use::Dynamics(command) => command.run(stdout),
            Use::Impact(command) => command.run(stdout),
            Use::Law(command) => command.run(stdout),
            Use::Map(command) => command.run(stdout),
            Use::Plan(command) => command.run(stdout),
            Use::Simulate(command) => command.run(stdout),
            Use::Aim(command) => command.run(stdout),
            Use::Feedback(command) => command.run(stdout),
            Use::Orbit(command) => command.run(stdout),
            Use::Tosses(command) => command.run(stdout),
            Use::Fit(command) => command.run(&given, stdout),
            Use::Compare(command) => command.run(&given, stdout),
            Use::Completions(command) => command.run(command_line()),
        },
        Command::Evidence(command) => match command {
            Evidence::Chart(command) => command.run(stdout),
            Evidence::Stress(command) => command.run(stdout),
            Evidence::Paper(command) => command.run(stdout),
            Evidence::Consistency(command) => command.run(stdout),
        },
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

//! `carom plan`: the model that a scene is simulated with.

use crate::error::CliError;
use crate::output::{answer_about, short};
use crate::scene::load;
use carom_sim::{Bounded, Decision, Plan};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;

/// Print the model of a scene, its exact reductions and its reductions within a bound
///
/// Input: a scene (TOML).
/// Output: the parts of the model that `carom simulate` uses, each with the reason; the parts that
/// are left out without any error (motion out of a plane, joints that cannot move, pairs that
/// cannot touch); the parts that are left out within a bound, which `[run] neglect` of the scene
/// allows, each with its bound. The bounds hold per impact, not over a run.
/// JSON keys: joints, kept and left_out [{what, choice, why}], bounded [{what, choice, bound, of}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct PlanCommand {
    /// Scene (TOML file)
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Print one line of JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A plan as JSON.
#[derive(Serialize)]
pub struct Account<'a> {
    joints: Vec<&'a str>,
    #[serde(flatten)]
    plan: &'a Plan,
}

impl<'a> Account<'a> {
    pub fn of(plan: &'a Plan) -> Self {
        Self { joints: moving_joints(plan), plan }
    }
}

/// Names of the joints whose coordinates are in q and qd of a plan.
pub fn moving_joints(plan: &Plan) -> Vec<&str> {
    plan.simulation.chain.moving_joints().map(|joint| joint.name.as_str()).collect()
}

impl PlanCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let refuse = |e| CliError::scene(&self.scene, e);
        let scene = load(&self.scene)?;
        let plan = scene.to_accuracy().map_err(refuse)?.plan;
        answer_about(&self.scene, out, &Account::of(&plan), self.json, |_, out| for_people(&plan, out))
    }
}

fn for_people(plan: &Plan, out: &mut dyn Write) -> io::Result<()> {
    let section = |title: &str, lines: &[Decision], out: &mut dyn Write| -> io::Result<()> {
        writeln!(out, "{title}")?;
        if lines.is_empty() {
            writeln!(out, "  nothing")?;
        }
        for Decision { what, choice, why } in lines {
            writeln!(out, "  {what:11} {choice}")?;
            writeln!(out, "              {why}")?;
        }
        Ok(())
    };
    section("modelled", &plan.kept, out)?;
    section("left out, without any error", &plan.left_out, out)?;
    writeln!(out, "left out within a bound")?;
    if plan.bounded.is_empty() {
        writeln!(out, "  nothing ([run] neglect = … allows it)")?;
    }
    for Bounded { what, choice, bound, of } in &plan.bounded {
        writeln!(out, "  {what:11} {choice}")?;
        writeln!(out, "              at most {} ({of})", short(*bound))?;
    }
    Ok(())
}

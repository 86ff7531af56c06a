//! `carom impact`: what an impact at a point does to every joint.

use crate::RobotArgs;
use crate::error::CliError;
use crate::input::{JointOrder, LimitWarnings, State, StateArgs, for_each_line, parse_vector};
use crate::law::{All, LawArgs};
use crate::output::{row, short};
use carom_sim::{ChainImpact, Impacts, SimError};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};

#[derive(Args)]
pub struct Impact {
    #[command(flatten)]
    robot: RobotArgs,
    #[command(flatten)]
    state: StateArgs,
    /// Surface normal in world axes, from the environment to the robot
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    normal: [f64; 3],
    #[command(flatten)]
    law: LawArgs,
}

#[derive(Serialize)]
struct Answer {
    law: &'static str,
    qd_plus: Vec<f64>,
    impulse: [f64; 3],
    u_minus: [f64; 3],
    u_plus: [f64; 3],
    energy_before: f64,
    energy_after: f64,
    mode: &'static str,
    normal_work: f64,
    friction_work: f64,
    flags: Vec<&'static str>,
}

impl Impact {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let laws = self.law.laws::<3>()?;
        let chain = self.robot.load()?;
        let order = JointOrder::new(&chain, &self.robot.urdf, self.state.joints.as_deref())?;
        let tip = self.robot.frame(&chain, &self.state.tip)?;
        let mut limits = LimitWarnings::default();
        for_each_line(&self.state.states, out, |state: State, place, out| {
            let (q, qd) = (order.q(&state.q), order.v(&state.qd));
            let mut contact = chain.impact(&q, &qd).at(tip).offset(self.state.point).normal(self.normal).contact()?;
            limits.check(&chain, &q, place);
            let mut all = All::default();
            for (name, law) in &laws {
                match contact.resolve(law.as_ref()) {
                    Ok(hit) => all.outcomes.push(outcome(name, &hit, &order)),
                    Err(SimError::Impact(why)) if laws.len() > 1 => all.refuse(name, &why)?,
                    Err(why) => return Err(why.into()),
                }
            }
            all.answer(out, self.state.json, laws.len(), |all, out| for_people(all, &order, out))
        })
    }
}

fn outcome(law: &'static str, hit: &ChainImpact, order: &JointOrder) -> Answer {
    Answer {
        law,
        qd_plus: order.theirs(&hit.qd_plus),
        impulse: hit.impulse.into(),
        u_minus: hit.u_minus.into(),
        u_plus: hit.u_plus.into(),
        energy_before: hit.energy_before,
        energy_after: hit.energy_after,
        mode: hit.mode.name(),
        normal_work: hit.contact.normal_work,
        friction_work: hit.contact.friction_work,
        flags: hit.flags.names().collect(),
    }
}

fn for_people(all: &All<Answer>, order: &JointOrder, out: &mut dyn Write) -> io::Result<()> {
    if let Some(first) = all.outcomes.first() {
        writeln!(out, "u⁻ {} m/s, kinetic energy {} J", row(&first.u_minus), short(first.energy_before))?;
        writeln!(out, "qd⁺ in the order {}", order.names.join(", "))?;
    }
    for a in &all.outcomes {
        let flags = if a.flags.is_empty() { String::new() } else { format!("  [{}]", a.flags.join(", ")) };
        writeln!(out, "{:16} {:12} qd⁺ {}{flags}", a.law, a.mode, row(&a.qd_plus))?;
        writeln!(out, "{:29} u⁺  {} m/s", "", row(&a.u_plus))?;
        writeln!(out, "{:29} p   {} N s", "", row(&a.impulse))?;
        writeln!(
            out,
            "{:29} T⁺  {:>13} J; normal work {}, friction work {} J",
            "",
            short(a.energy_after),
            short(a.normal_work),
            short(a.friction_work)
        )?;
    }
    for refused in &all.refused {
        writeln!(out, "{:16} not applicable: {}", refused.law, refused.reason)?;
    }
    writeln!(out)
}

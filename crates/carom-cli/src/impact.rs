//! `carom impact`: what an impact at a point does to every joint.

use crate::RobotArgs;
use crate::error::CliError;
use crate::input::{JointOrder, LimitWarnings, State, StateArgs, for_each_line, parse_range, parse_vector};
use crate::law::{All, LawArgs};
use crate::output::{row, short};
use carom_impact::{CoefficientRanges, Law};
use carom_sim::{ChainImpact, Contact, Impacts, SimError};
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
    /// The derivatives of qd⁺ by q (along unit motions of qd), qd⁻, restitution and friction, and how far the next mode is
    #[arg(long)]
    derivatives: bool,
    /// Bounds of the outcome while the restitution lies in this range, whatever --restitution is
    #[arg(long, value_name = "LOW:HIGH", value_parser = parse_range, allow_hyphen_values = true)]
    restitution_range: Option<[f64; 2]>,
    /// Bounds of the outcome while the friction lies in this range, whatever --friction is
    #[arg(long, value_name = "LOW:HIGH", value_parser = parse_range, allow_hyphen_values = true)]
    friction_range: Option<[f64; 2]>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    derivatives: Option<Derivatives>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mode_margin: Option<Margin>,
    #[serde(skip_serializing_if = "Option::is_none")]
    band: Option<Bounds>,
}

/// Of qd⁺; matrices as rows.
#[derive(Serialize)]
struct Derivatives {
    q: Vec<Vec<f64>>,
    qd: Vec<Vec<f64>>,
    restitution: Vec<f64>,
    friction: Vec<f64>,
}

/// The nearest boundary of the mode; left out where there is no impact.
#[derive(Serialize)]
struct Margin {
    margin: f64,
    edge: &'static str,
    beyond: &'static str,
}

/// Lowest and highest of each number.
#[derive(Serialize)]
struct Bounds {
    restitution: [f64; 2],
    friction: [f64; 2],
    qd_plus: Vec<[f64; 2]>,
    u_plus: [[f64; 2]; 3],
    impulse: [[f64; 2]; 3],
    exact: bool,
}

impl Impact {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let laws = self.law.laws::<3>()?;
        let ranges = self.ranges()?;
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
                match self.answer(&mut contact, name, law.as_ref(), ranges.as_ref(), &order) {
                    Ok(answer) => all.outcomes.push(answer),
                    Err(SimError::Impact(why)) if laws.len() > 1 => all.refuse(name, &why)?,
                    Err(why) => return Err(why.into()),
                }
            }
            all.answer(out, self.state.json, laws.len(), |all, out| for_people(all, &order, out))
        })
    }
}

impl Impact {
    fn ranges(&self) -> Result<Option<CoefficientRanges>, CliError> {
        if self.restitution_range.is_none() && self.friction_range.is_none() {
            return Ok(None);
        }
        let (e, mu) = (self.law.restitution, self.law.friction);
        let restitution = self.restitution_range.unwrap_or([e, e]);
        let friction = self.friction_range.unwrap_or([mu, mu]);
        if !(0.0 <= restitution[0] && restitution[1] <= 1.0) {
            let [low, high] = restitution;
            let rule = "a coefficient of restitution lies between 0 and 1";
            return Err(CliError::Option(format!("--restitution-range {low}:{high}: {rule}")));
        }
        if friction[0] < 0.0 {
            let [low, high] = friction;
            return Err(CliError::Option(format!(
                "--friction-range {low}:{high}: a coefficient of friction is not negative"
            )));
        }
        Ok(Some(CoefficientRanges { restitution, friction }))
    }

    fn answer(
        &self,
        contact: &mut Contact,
        name: &'static str,
        law: &dyn Law<f64, 3>,
        ranges: Option<&CoefficientRanges>,
        order: &JointOrder,
    ) -> Result<Answer, SimError> {
        let mut answer = if self.derivatives {
            let found = contact.derivative(law)?;
            let mut answer = outcome(name, &found.hit, order);
            answer.derivatives = Some(Derivatives {
                q: order.square(&found.q),
                qd: order.square(&found.qd),
                restitution: order.theirs(found.restitution.as_slice()),
                friction: order.theirs(found.friction.as_slice()),
            });
            let nearest = contact.problem().boundaries(law)?.into_iter().next();
            answer.mode_margin =
                nearest.map(|b| Margin { margin: b.margin, edge: b.edge.name(), beyond: b.beyond.name() });
            answer
        } else {
            outcome(name, &contact.resolve(law)?, order)
        };
        if let Some(ranges) = ranges {
            let band = contact.band(law, ranges)?;
            answer.band = Some(Bounds {
                restitution: ranges.restitution,
                friction: ranges.friction,
                qd_plus: order.theirs(&band.qd_plus),
                u_plus: band.u_plus,
                impulse: band.impulse,
                exact: band.exact,
            });
        }
        Ok(answer)
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
        derivatives: None,
        mode_margin: None,
        band: None,
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
        if let Some(Derivatives { q, qd, restitution, friction }) = &a.derivatives {
            for (by, rows) in [("q", q), ("qd⁻", qd)] {
                for (k, numbers) in rows.iter().enumerate() {
                    let head = if k == 0 { format!("∂qd⁺/∂{by}") } else { String::new() };
                    writeln!(out, "{:29} {head:12} {}", "", row(numbers))?;
                }
            }
            writeln!(out, "{:29} {:12} {}", "", "∂qd⁺/∂e", row(restitution))?;
            writeln!(out, "{:29} {:12} {}", "", "∂qd⁺/∂μ", row(friction))?;
        }
        if let Some(Margin { margin, edge, beyond }) = &a.mode_margin {
            writeln!(out, "{:29} nearest mode {beyond}, at {edge}, margin {}", "", short(*margin))?;
        }
        if let Some(band) = &a.band {
            let ([e0, e1], [m0, m1]) = (band.restitution, band.friction);
            let how = if band.exact { "exact" } else { "sampled, possibly too narrow" };
            writeln!(out, "{:29} e in {e0} … {e1}, μ in {m0} … {m1} ({how})", "")?;
            let pick = |k: usize| band.qd_plus.iter().map(|b| b[k]).collect::<Vec<_>>();
            writeln!(out, "{:29} qd⁺ from {}", "", row(&pick(0)))?;
            writeln!(out, "{:29}     to   {}", "", row(&pick(1)))?;
        }
    }
    for refused in &all.refused {
        writeln!(out, "{:16} not applicable: {}", refused.law, refused.reason)?;
    }
    writeln!(out)
}

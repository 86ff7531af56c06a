//! `carom dynamics`: mass matrix, Jacobian, bias, energies, Delassus matrix.

use crate::error::{CliError, LineError};
use crate::input::{JointOrder, LimitWarnings, RobotArgs, State, StateArgs, for_each_line, parse_vector};
use crate::output::{answer, row, short};
use carom_chain::{Chain, ChainError, Point, Spatial, Workspace};
use clap::Args;
use nalgebra::Vector3;
use serde::Serialize;
use std::io::{self, Write};

/// Compute mass matrix, Jacobian, bias, energies and Delassus matrix at given states
///
/// Input: a URDF file and a file of states, one JSON object per line (--states).
/// Output, for each state:
///   mass matrix M (kg m², kg); Jacobian J of the contact point (3 rows, world axes); Delassus
///   matrix H = J M⁻¹ Jᵀ (1/kg); bias (Coriolis, centrifugal and gravity forces, N m or N); gravity
///   force (the joint forces that hold the robot against gravity); kinetic and potential energy
///   (J; the potential energy is zero at the world's origin); qdd = M⁻¹ (tau − bias) if the state
///   has tau; tau = M qdd + bias if the state has qdd.
/// Where M is singular (links that move without mass), everything is computed that needs no
/// solution with M: there is no delassus, `singular` says why, and tau is refused.
/// With --kinematics: position (m) and Jacobian of the contact point only.
/// JSON keys: joints, mass_matrix, bias, gravity_force, kinetic_energy, potential_energy, and qdd or
///   tau; with --tip jacobian, and delassus or singular; with --kinematics joints, position, jacobian.
/// Answers are printed in the order of the lines. If a line is refused, the answers to the lines
/// above it have been printed, and the exit status is 1.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct Dynamics {
    #[command(flatten)]
    robot: RobotArgs,
    /// Link of the contact point; without it there is no Jacobian and no Delassus matrix
    #[arg(long, visible_alias = "frame", value_name = "LINK")]
    tip: Option<String>,
    #[command(flatten)]
    state: StateArgs,
    /// Acceleration of gravity in world axes, m/s²
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,-9.81", value_parser = parse_vector, allow_hyphen_values = true)]
    gravity: [f64; 3],
    /// Compute position and Jacobian of the contact point only; masses are not used
    #[arg(long, requires = "tip")]
    kinematics: bool,
}

#[derive(Serialize)]
struct Place<'a> {
    joints: &'a [String],
    position: [f64; 3],
    jacobian: Vec<Vec<f64>>,
}

#[derive(Serialize)]
struct Answer<'a> {
    joints: &'a [String],
    mass_matrix: Vec<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    jacobian: Option<Vec<Vec<f64>>>,
    bias: Vec<f64>,
    gravity_force: Vec<f64>,
    kinetic_energy: f64,
    potential_energy: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    delassus: Option<Vec<Vec<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    singular: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    qdd: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tau: Option<Vec<f64>>,
}

impl Dynamics {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let chain = self.robot.load()?;
        let order = JointOrder::new(&chain, &self.robot.urdf, self.state.joints.as_deref())?;
        let tip = self.tip.as_deref().map(|tip| self.robot.frame(&chain, tip)).transpose()?;
        let point = tip.map(|tip| chain.point(tip, self.state.point.into()));
        let mut ws = chain.workspace();
        let mut limits = LimitWarnings::default();
        for_each_line(&self.state.states, out, |state: State, place, out| {
            if let (true, Some(point)) = (self.kinematics, point) {
                let (q, qd) = (order.q(&state.q), order.v(&state.qd));
                chain.check_state(&q, &qd)?;
                let kin = ws.update(&chain, &q)?;
                let (position, jacobian) = (kin.position(point).into(), order.columns(&kin.point_jacobian(point)));
                limits.check(&chain, &q, place);
                return answer(
                    out,
                    &Place { joints: &order.names, position, jacobian },
                    self.state.json,
                    place_for_people,
                );
            }
            let found = evaluate(&chain, &mut ws, &order, point, self.gravity.into(), &state)?;
            limits.check(&chain, &order.q(&state.q), place);
            answer(out, &found, self.state.json, for_people)
        })
    }
}

fn evaluate<'a>(
    chain: &Chain,
    ws: &mut Workspace<Spatial<f64>>,
    order: &'a JointOrder,
    point: Option<Point<Spatial<f64>>>,
    gravity: Vector3<f64>,
    state: &State,
) -> Result<Answer<'a>, LineError> {
    let (q, qd) = (order.q(&state.q), order.v(&state.qd));
    chain.check_state(&q, &qd)?;
    let checked = |what, numbers: &Option<Vec<f64>>| match numbers {
        None => Ok(None),
        Some(numbers) => {
            let ours = order.v(numbers);
            chain.check_v(what, &ours).map(|()| Some(ours))
        }
    };
    let (tau_given, qdd_given) = (checked("tau", &state.tau)?, checked("qdd", &state.qdd)?);

    let mut kin = ws.update(chain, &q)?;
    let bias = kin.bias(&qd, gravity)?;
    let qdd = match tau_given {
        Some(tau) => Some(order.theirs(kin.forward_dynamics(&qd, &tau, gravity)?.as_slice())),
        None => None,
    };
    let tau = match qdd_given {
        Some(qdd) => Some(order.theirs(kin.inverse_dynamics(&qd, &qdd, gravity)?.as_slice())),
        None => None,
    };
    let (delassus, singular) = match point.map(|point| kin.delassus(point)) {
        None => (None, None),
        Some(Ok(delassus)) => (Some(delassus.row_iter().map(|r| r.iter().copied().collect()).collect()), None),
        Some(Err(why @ (ChainError::Massless { .. } | ChainError::NoInertia { .. }))) => (None, Some(why.to_string())),
        Some(Err(why)) => return Err(why.into()),
    };
    Ok(Answer {
        joints: &order.names,
        mass_matrix: order.square(&kin.mass_matrix()),
        jacobian: point.map(|point| order.columns(&kin.point_jacobian(point))),
        bias: order.theirs(bias.as_slice()),
        gravity_force: order.theirs(kin.gravity_force(gravity).as_slice()),
        kinetic_energy: kin.kinetic_energy(&qd)?,
        potential_energy: kin.potential_energy(gravity),
        delassus,
        singular,
        qdd,
        tau,
    })
}

fn joints_for_people(joints: &[String], out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "joints         {}", joints.iter().map(|j| format!("{j:>13}")).collect::<Vec<_>>().join(" "))
}

fn matrix(name: &str, rows: &[Vec<f64>], out: &mut dyn Write) -> io::Result<()> {
    for (i, numbers) in rows.iter().enumerate() {
        writeln!(out, "{:14} {}", if i == 0 { name } else { "" }, row(numbers))?;
    }
    Ok(())
}

fn place_for_people(place: &Place, out: &mut dyn Write) -> io::Result<()> {
    joints_for_people(place.joints, out)?;
    matrix("Jacobian", &place.jacobian, out)?;
    writeln!(out, "{:14} {}", "position", row(&place.position))?;
    writeln!(out)
}

fn for_people(a: &Answer, out: &mut dyn Write) -> io::Result<()> {
    joints_for_people(a.joints, out)?;
    matrix("mass matrix", &a.mass_matrix, out)?;
    if let Some(jacobian) = &a.jacobian {
        matrix("Jacobian", jacobian, out)?;
    }
    if let Some(delassus) = &a.delassus {
        matrix("Delassus", delassus, out)?;
    }
    if let Some(why) = &a.singular {
        writeln!(out, "no Delassus matrix, since M is singular: {why}")?;
    }
    writeln!(out, "{:14} {}", "bias", row(&a.bias))?;
    writeln!(out, "{:14} {}", "gravity force", row(&a.gravity_force))?;
    if let Some(qdd) = &a.qdd {
        writeln!(out, "{:14} {}", "qdd", row(qdd))?;
    }
    if let Some(tau) = &a.tau {
        writeln!(out, "{:14} {}", "tau", row(tau))?;
    }
    writeln!(out, "kinetic energy {} J, potential energy {} J", short(a.kinetic_energy), short(a.potential_energy))?;
    writeln!(out)
}

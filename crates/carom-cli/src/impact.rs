//! `carom impact`: the outcome of one impact at a point of a robot.

use crate::error::CliError;
use crate::error::LineError;
use crate::input::{JointOrder, LimitWarnings, RobotArgs, StateArgs, for_each_line, parse_range, parse_vector};
use crate::law::{All, Branch, LawArgs, print_refused};
use crate::output::{row, say, short};
use carom_chain::{Chain, ChainError, FramePoint, ToolMotion};
use carom_impact::{CoefficientRanges, Law};
use carom_sim::{ChainImpact, Contact, ImpactLoads, Impacts, JointImpulse, JointModel, SimError, Strike};
use clap::Args;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::Path;

/// Compute the outcome of one impact at a point of the robot, under one law or all
///
/// The impact takes no time: positions stay, velocities jump by qd⁺ = qd⁻ + M⁻¹ Jᵀ p. Joints move
/// freely during it unless --locked, --joint-stiffness or --joint-damping is given.
///
/// Input: a URDF file, states (--states), the contact point (--tip, --point), the surface normal
/// (--normal) and a law with its coefficients.
/// Output, for each state and law: qd⁺ (rad/s, m/s); velocity of the contact point before and after,
/// u⁻ and u⁺ (m/s), and impulse p on the robot (N s), all three in world axes; kinetic energy before
/// and after (J); work of the normal and of the friction impulse (J); mode (open, stick, slip,
/// reverse-slip) and flags as in `carom law --help`; what the options below add.
/// JSON keys: law, q, qd_minus, qd_plus, impulse, u_minus, u_plus, energy_before, energy_after,
///   mode, normal_work, friction_work, flags; with --law all {"outcomes":[…]}, and "refused":[…] of laws
///   without a solution.
///   branches: all solutions, if there are several.
///   drive_impulse (N m s or N s per joint), drive_work (J): with locked joints or drives.
///   derivatives {q, qd, restitution, friction}, mode_margin {margin, edge, beyond}: --derivatives.
///   band {restitution, friction, qd_plus, u_plus, impulse, exact}: with a range.
///   loads {joint_impulse, bearings [{joint, force, moment}]}: --loads.
/// Answers are printed in the order of the lines. If a line is refused, the answers to the lines
/// above it have been printed, and the exit status is 1.
#[derive(Args)]
#[command(verbatim_doc_comment, override_usage = USAGE)]
pub struct Impact {
    #[command(flatten)]
    robot: RobotArgs,
    /// Link of the contact point
    #[arg(long, visible_alias = "frame", value_name = "LINK")]
    tip: String,
    #[command(flatten)]
    state: StateArgs,
    /// Surface normal in world axes, from the environment to the robot, of any length but 0
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    normal: [f64; 3],
    #[command(flatten)]
    law: LawArgs,
    #[command(flatten)]
    drives: Drives,
    /// Add the derivatives of qd⁺ with respect to q, qd⁻, restitution and friction
    ///
    /// Those with respect to q are along unit joint velocities, so that they have nv columns. All
    /// hold within a contact mode. The margin, 0 to 1, is the normalised distance to the nearest
    /// mode boundary; edge names this boundary, and beyond is the mode behind it.
    #[arg(long, conflicts_with_all = ["locked", "contact_time"], verbatim_doc_comment)]
    derivatives: bool,
    /// Add bounds of the outcome for all restitutions in this range, 0:1 at most
    ///
    /// The outcome itself is still that of --restitution. The bounds are exact where a proof
    /// holds, else sampled and possibly too narrow; the answer states which.
    #[arg(
        long, value_name = "LOW:HIGH", value_parser = parse_range, allow_hyphen_values = true, verbatim_doc_comment
    )]
    restitution_range: Option<[f64; 2]>,
    /// Add bounds of the outcome for all coefficients of friction in this range
    ///
    /// As --restitution-range; both together give the bounds over both ranges.
    #[arg(
        long, value_name = "LOW:HIGH", value_parser = parse_range, allow_hyphen_values = true, verbatim_doc_comment
    )]
    friction_range: Option<[f64; 2]>,
    /// Add the loads on the joints
    ///
    /// The joint impulses Jᵀp (N m s, N s), which accelerate free joints and load the drives of locked
    /// ones; and for each moving joint the impulse that its parent link exerts on its child link, by
    /// bearing, gear and drive together: force (N s) and moment about the origin of the child link
    /// (N m s), in the axes of the child link.
    #[arg(long, verbatim_doc_comment)]
    loads: bool,
    /// Joint velocities that are taken where a state gives tip_velocity [default: least-energy]
    ///
    /// least-energy: those of the least kinetic energy, with which the link turns in general;
    /// least-norm: of the least sum of squares; without-rotation: the link does not turn, and of these
    /// velocities those of the least kinetic energy.
    #[arg(
        long, value_name = "HOW", value_parser = ToolMotion::from_name, verbatim_doc_comment
    )]
    motion: Option<ToolMotion>,
}

/// A line of `--states`; tau and qdd are those of `dynamics`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImpactState {
    q: Vec<f64>,
    qd: Option<Vec<f64>>,
    tip_velocity: Option<[f64; 3]>,
    #[serde(rename = "tau")]
    _tau: Option<Vec<f64>>,
    #[serde(rename = "qdd")]
    _qdd: Option<Vec<f64>>,
}

/// Usage in two lines of less than 100 columns.
const USAGE: &str = "\
carom impact [OPTIONS] --tip <LINK> --normal <X,Y,Z> --law <LAW> --restitution <E>
                    --states <FILE> <ROBOT.urdf>";

// Behaviour of the joints during the impact; free if none of these options is given.
#[derive(Args)]
struct Drives {
    /// Joints whose velocities stay the same through the impact, or `all`
    ///
    /// A model of joints under stiff position control. `all` does not lock a floating base.
    #[arg(
        long,
        value_name = "A,B,…",
        value_delimiter = ',',
        conflicts_with_all = ["joint_stiffness", "joint_damping"],
        verbatim_doc_comment
    )]
    locked: Option<Vec<String>>,
    /// Stiffness K of the joint drives during the contact, N m/rad or N/m [default: 0]
    ///
    /// One number for all joints (0 for a floating base), or one for each entry of qd. The impact
    /// is resolved with the inertia M + Δt (K Δt + D), where Δt is --contact-time.
    #[arg(
        long,
        value_name = "K,…",
        value_delimiter = ',',
        requires = "contact_time",
        allow_hyphen_values = true,
        verbatim_doc_comment
    )]
    joint_stiffness: Option<Vec<f64>>,
    /// Damping D of the joint drives during the contact, N m s/rad or N s/m [default: 0]
    ///
    /// Numbers as for --joint-stiffness.
    #[arg(
        long,
        value_name = "D,…",
        value_delimiter = ',',
        requires = "contact_time",
        allow_hyphen_values = true,
        verbatim_doc_comment
    )]
    joint_damping: Option<Vec<f64>>,
    /// Duration Δt of the contact, s; required with --joint-stiffness or --joint-damping
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    contact_time: Option<f64>,
}

/// Joint drives as springs and dampers, one number for each velocity coordinate of the chain.
struct Impedance {
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    contact_time: f64,
}

impl Drives {
    /// The locked joints, each named once, or `all` alone.
    fn locked(&self, urdf: &Path) -> Result<Vec<&str>, CliError> {
        let names: Vec<&str> = self.locked.iter().flatten().map(String::as_str).collect();
        let refuse = |why: String| Err(CliError::Input(format!("{}: --locked: {why}", urdf.display())));
        if names.len() > 1 && names.contains(&"all") {
            return refuse(
                "'all' locks every joint but a floating base: give it alone, or give names without it".into(),
            );
        }
        match names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)) {
            Some((_, twin)) => refuse(format!("joint '{twin}' is named twice")),
            None => Ok(names),
        }
    }

    fn impedance(&self, chain: &Chain, order: &JointOrder) -> Result<Option<Impedance>, CliError> {
        let Some(contact_time) = self.contact_time else { return Ok(None) };
        if self.joint_stiffness.is_none() && self.joint_damping.is_none() {
            let why = "--contact-time is the duration of the contact with the joint drives: give --joint-stiffness or --joint-damping too";
            return Err(CliError::Input(why.into()));
        }
        let spread = |option: &str, given: &Option<Vec<f64>>| {
            let given = given.as_deref().unwrap_or(&[0.0]);
            if let Some(x) = given.iter().find(|x| !(**x >= 0.0 && x.is_finite())) {
                let rule = "stiffness and damping of a drive are finite and 0 or more";
                return Err(CliError::Input(format!("{option} {x}: {rule}")));
            }
            if let [one] = given {
                return Ok(JointModel::for_all_joints(chain, *one));
            }
            if given.len() != chain.nv() {
                let (got, names) = (given.len(), order.names.join(", "));
                let why = format!("{option}: {got} numbers: give one, or {} in the order of qd ({names})", chain.nv());
                return Err(CliError::Input(why));
            }
            Ok(order.v(given))
        };
        let stiffness = spread("--joint-stiffness", &self.joint_stiffness)?;
        let damping = spread("--joint-damping", &self.joint_damping)?;
        Ok(Some(Impedance { stiffness, damping, contact_time }))
    }
}

#[derive(Serialize)]
struct Answer {
    law: &'static str,
    #[serde(flatten)]
    before: Before,
    qd_plus: Vec<f64>,
    #[serde(flatten)]
    hit: ChainImpact,
    /// Left out if the joints are free.
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_impulse: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_work: Option<f64>,
    /// All outcomes that satisfy the law, this one first; left out if there is one only.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    branches: Vec<Branch>,
    #[serde(skip_serializing_if = "Option::is_none")]
    derivatives: Option<Derivatives>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mode_margin: Option<Margin>,
    #[serde(skip_serializing_if = "Option::is_none")]
    band: Option<Bounds>,
    #[serde(skip_serializing_if = "Option::is_none")]
    loads: Option<ImpactLoads>,
}

/// The state before the impact, in the order asked for.
#[derive(Serialize, Clone)]
struct Before {
    q: Vec<f64>,
    qd_minus: Vec<f64>,
}

/// Derivatives of qd⁺; matrices as rows.
#[derive(Serialize)]
struct Derivatives {
    q: Vec<Vec<f64>>,
    qd: Vec<Vec<f64>>,
    restitution: Vec<f64>,
    friction: Vec<f64>,
}

/// The nearest boundary of the contact mode; left out if there is no impact.
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
        let tip = self.robot.frame(&chain, &self.tip)?;
        let impedance = self.drives.impedance(&chain, &order)?;
        let locked = self.drives.locked(&self.robot.urdf)?;
        let joints = match (&impedance, locked.as_slice()) {
            (Some(Impedance { stiffness, damping, contact_time }), _) => {
                JointModel::Impedance { stiffness, damping, contact_time: *contact_time }
            }
            (None, []) => JointModel::Free,
            (None, ["all"]) => JointModel::AllLocked,
            (None, names) => JointModel::Locked(names),
        };
        // Options that no state can satisfy are refused before any state is read, without a line number.
        let strike = chain.impact(&[], &[]).at(tip).offset(self.state.point).normal(self.normal).joints(joints);
        strike.prepare().and_then(|strike| strike.check_dynamics()).map_err(|why| {
            // Faults of the robot are named with its file.
            let robot = format!("{}: ", self.robot.urdf.display());
            let (robot, option) = match &why {
                SimError::Chain(ChainError::Massless { .. }) => return CliError::Input(format!("{robot}{why}")),
                SimError::Chain(ChainError::NoDirection { .. }) => ("", "--normal"),
                SimError::Setting { .. } => ("", "--contact-time"),
                SimError::FixedPoint { .. } => (robot.as_str(), "--tip"),
                _ => (robot.as_str(), "--locked"),
            };
            CliError::Input(format!("{robot}{option}: {why}"))
        })?;
        let mut limits = LimitWarnings::default();
        let point = FramePoint::new(tip, self.state.point);
        let (mut with_motion, mut without_motion) = (0, 0);
        for_each_line(&self.state.states, out, |state: ImpactState, place, out| {
            let q = order.q(&state.q);
            let qd = match (&state.qd, state.tip_velocity) {
                (Some(qd), None) => {
                    let qd = order.v(qd);
                    chain.check_state(&q, &qd)?;
                    without_motion += 1;
                    qd
                }
                (None, Some(velocity)) => {
                    chain.check_q(&q)?;
                    let motion = self.motion.unwrap_or_default();
                    let found = chain.workspace().update(&chain, &q)?.tool_velocity(point, velocity.into(), motion)?;
                    with_motion += 1;
                    found.as_slice().to_vec()
                }
                _ => return Err(LineError("give qd or tip_velocity, one of both".into()).into()),
            };
            let before = Before { q: state.q, qd_minus: order.theirs(&qd) };
            let strike = chain.impact(&q, &qd).at(point).normal(self.normal).joints(joints);
            let mut contact = strike.clone().contact()?;
            limits.check(&chain, &q, place);
            let mut all = All::default();
            for (name, law) in &laws {
                match self.answer(
                    (&before, &strike, &mut contact),
                    (*name, law.as_ref()),
                    ranges.as_ref(),
                    &order,
                    joints != JointModel::Free,
                ) {
                    Ok(answer) => all.outcomes.extend(answer),
                    Err(SimError::Impact(why)) if laws.len() > 1 => all.refuse(name, &why)?,
                    Err(why) => return Err(why.into()),
                }
            }
            all.answer(out, self.state.json, laws.len(), |all, out| for_people(all, &order, out))
        })?;
        if self.motion.is_some() && with_motion == 0 && without_motion > 0 {
            say(
                "warning: --motion has no effect: it chooses qd where a state gives tip_velocity, and every state gives qd",
            );
        }
        Ok(())
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
            return Err(CliError::Input(format!("--restitution-range {low}:{high}: {rule}")));
        }
        if friction[0] < 0.0 {
            let [low, high] = friction;
            return Err(CliError::Input(format!(
                "--friction-range {low}:{high}: a coefficient of friction is not negative"
            )));
        }
        Ok(Some(CoefficientRanges { restitution, friction }))
    }

    fn answer(
        &self,
        (before, strike, contact): (&Before, &Strike, &mut Contact),
        law: (&'static str, &dyn Law<f64, 3>),
        ranges: Option<&CoefficientRanges>,
        order: &JointOrder,
        driven: bool,
    ) -> Result<Option<Answer>, SimError> {
        let (name, law) = law;
        let hits = contact.branches(law)?;
        let Some(mut answer) = outcome(name, before, &hits, order, driven) else { return Ok(None) };
        if self.loads {
            let loads = strike.loads(&hits[0])?;
            let joint_impulse = order.theirs(&loads.joint_impulse);
            answer.loads = Some(ImpactLoads { joint_impulse, ..loads });
        }
        if self.derivatives {
            let found = contact.derivative(law)?;
            answer.derivatives = Some(Derivatives {
                q: order.square(&found.q),
                qd: order.square(&found.qd),
                restitution: order.theirs(found.restitution.as_slice()),
                friction: order.theirs(found.friction.as_slice()),
            });
            let nearest = contact.problem().boundaries(law)?.into_iter().next();
            answer.mode_margin =
                nearest.map(|b| Margin { margin: b.margin, edge: b.edge.name(), beyond: b.beyond.name() });
        }
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
        Ok(Some(answer))
    }
}

fn outcome(
    law: &'static str,
    before: &Before,
    hits: &[ChainImpact],
    order: &JointOrder,
    driven: bool,
) -> Option<Answer> {
    let branch = |hit: &ChainImpact| Branch {
        qd_plus: order.theirs(&hit.qd_plus),
        impulse: hit.impulse.as_slice().to_vec(),
        u_plus: hit.u_plus.as_slice().to_vec(),
        mode: hit.mode.name(),
        energy_ratio: hit.energy_ratio(),
    };
    let hit = hits.first()?;
    Some(Answer {
        law,
        before: before.clone(),
        qd_plus: order.theirs(&hit.qd_plus),
        hit: hit.clone(),
        drive_impulse: driven.then(|| order.theirs(&hit.drive_impulse)),
        drive_work: driven.then_some(hit.drive_work),
        branches: if hits.len() > 1 { hits.iter().map(branch).collect() } else { Vec::new() },
        derivatives: None,
        mode_margin: None,
        band: None,
        loads: None,
    })
}

/// The loads of an impact on the joints.
pub fn loads_for_people(ImpactLoads { joint_impulse, through }: &ImpactLoads, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "{:29} Jᵀp {} N m s, N s", "", row(joint_impulse))?;
    // Components that are sums of others with rounding are shown as zero.
    let size =
        |pick: fn(&JointImpulse) -> Vector3<f64>| through.iter().map(|joint| pick(joint).amax()).fold(0.0, f64::max);
    let (forces, moments) = (size(|joint| joint.force), size(|joint| joint.moment));
    let moments = moments.max(joint_impulse.iter().fold(0.0, |most, x| x.abs().max(most)));
    let clean = |of: &Vector3<f64>, size: f64| row(of.map(|x| if x.abs() < 1e-12 * size { 0.0 } else { x }).as_slice());
    for joint in through {
        let (force, moment) = (clean(&joint.force, forces), clean(&joint.moment, moments));
        writeln!(out, "{:29} through {}", "", joint.joint)?;
        writeln!(out, "{:29}   force  {force} N s", "")?;
        writeln!(out, "{:29}   moment {moment} N m s", "")?;
    }
    Ok(())
}

fn for_people(all: &All<Answer>, order: &JointOrder, out: &mut dyn Write) -> io::Result<()> {
    if let Some(first) = all.outcomes.first() {
        writeln!(
            out,
            "u⁻ {} m/s, kinetic energy {} J",
            row(first.hit.u_minus.as_slice()),
            short(first.hit.energy_before)
        )?;
        writeln!(out, "qd⁺ in the order {}", order.names.join(", "))?;
    }
    for a in &all.outcomes {
        let hit = &a.hit;
        let flags = if hit.flags.is_empty() { String::new() } else { format!("  [{}]", hit.flags) };
        writeln!(out, "{:16} {:12} qd⁺ {}{flags}", a.law, hit.mode, row(&a.qd_plus))?;
        writeln!(out, "{:29} u⁺  {} m/s", "", row(hit.u_plus.as_slice()))?;
        writeln!(out, "{:29} p   {} N s", "", row(hit.impulse.as_slice()))?;
        writeln!(
            out,
            "{:29} T⁺  {:>13} J; normal work {}, friction work {} J",
            "",
            short(hit.energy_after),
            short(hit.contact.normal_work),
            short(hit.contact.friction_work)
        )?;
        if let (Some(impulse), Some(work)) = (&a.drive_impulse, a.drive_work) {
            writeln!(out, "{:29} drives {} N m s, work {} J", "", row(impulse), short(work))?;
        }
        if let Some(loads) = &a.loads {
            loads_for_people(loads, out)?;
        }
        for other in a.branches.iter().skip(1) {
            writeln!(out, "  or also        {:12} qd⁺ {}", other.mode, row(&other.qd_plus))?;
            writeln!(out, "{:29} u⁺  {} m/s", "", row(&other.u_plus))?;
            writeln!(out, "{:29} p   {} N s, T⁺/T⁻ {}", "", row(&other.impulse), short(other.energy_ratio))?;
        }
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
            // Slip that stops in another phase has the same mode, but other derivatives.
            let still = if *beyond == hit.mode.name() { "still " } else { "" };
            let margin = short(*margin);
            writeln!(out, "{:29} nearest boundary {edge}, margin {margin}; beyond it {still}{beyond}", "")?;
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
    print_refused(&all.refused, out)?;
    writeln!(out)
}

//! What Figs. 4 to 7 show: the tip before, through and after one impact at 0.2 m/s under 45°, simulated.

use super::{Elbow, NORMAL, PaperError, TANGENT, strike};
use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_sim::{
    Compliance, ContactMode, ContactRule, EventKind, Holding, Moment, SimError, Simulation, Surface, Touch, Trajectory,
    free_motion,
};
use nalgebra::Vector3;

/// Angle and speed of Figs. 4 to 7.
pub(super) const ANGLE: f64 = 45.0;
pub(super) const SPEED: f64 = 0.2;
/// Table I's Newton coefficient of both elbows there.
pub(super) const RESTITUTION: f64 = 0.35;
/// Our choice for the compliant contact of Fig. 5: Hertz's exponent, a stiffness in N/m^(3/2), a friction.
pub(super) const STIFFNESS: f64 = 1e9;
pub(super) const FRICTION: f64 = 0.1;
const SLIP_SPEED: f64 = 1e-3;
/// So long before and after the impact, s.
const WINDOW: f64 = 0.02;
/// The same with some room: the probe's end is a ball, and touches a little before its centre would.
const SPAN: f64 = 1.01 * WINDOW;
/// Steps of each half; the paper's clock of 4 ms takes every 80th, beginning with the 40th: ten samples, five on each
/// side, none on the impact itself.
const STEPS: usize = 400;
const CLOCK: (usize, usize) = (40, 80);

/// The tip at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipState {
    /// Time from the impact, s.
    pub time: f64,
    /// Velocity into the wall (the paper's normal), m/s.
    pub normal: f64,
    /// Velocity down along the wall, m/s.
    pub tangential: f64,
    /// Way towards the wall from where it hits, m.
    pub towards: f64,
    /// Way down along the wall from where it hits, m.
    pub along: f64,
}

/// A rigid impact, continuous and as the paper's clock samples it.
#[derive(Debug, Clone, PartialEq)]
pub struct TipMotion {
    /// Configuration.
    pub elbow: Elbow,
    /// Continuous, with both sides of the impact at time 0.
    pub states: Vec<TipState>,
    /// Every 4 ms.
    pub samples: Vec<TipState>,
}

/// The force on the wall while a compliant contact is pressed.
#[derive(Debug, Clone, PartialEq)]
pub struct Forces {
    /// Configuration.
    pub elbow: Elbow,
    /// Time from the contact (s), force into the wall, force down along the wall (N), at equal steps.
    pub states: Vec<[f64; 3]>,
}

impl Forces {
    /// The greatest normal force, N.
    pub fn peak(&self) -> f64 {
        self.states.iter().map(|s| s[1]).fold(0.0, f64::max)
    }

    /// How long it presses, s.
    pub fn duration(&self) -> f64 {
        self.states.last().map_or(0.0, |s| s[0])
    }

    /// Normal and tangential impulse on the wall, N s: the trapezoidal rule, which for a force that begins and ends at zero
    /// is good to the square of the step.
    pub fn impulse(&self) -> [f64; 2] {
        let area = |k: usize| self.states.windows(2).map(|s| (s[1][0] - s[0][0]) * (s[0][k] + s[1][k]) / 2.0).sum();
        [area(1), area(2)]
    }
}

/// The arm before its wall, and what happens.
fn run(arm: &Chain, elbow: Elbow, contact: ContactRule) -> Result<(Simulation, Trajectory), SimError> {
    let hit = strike(arm, elbow, ANGLE, SPEED, contact.restitution)?;
    let start = free_motion(arm, &elbow.pose(), &hit.qd_minus, Vector3::zeros(), -SPAN, 2)?.remove(1);
    let at_impact = arm.workspace().update(arm, &elbow.pose())?.pose(arm.frame("tip")?).translation;
    let obstacle = Obstacle::half_space(at_impact, NORMAL.into())?;
    let wall = Surface { name: "wall".into(), obstacle, contact, motion: None };
    let touches = Touch::all(arm, &[wall], 0.0)?.touches.into_iter().filter(|touch| touch.link() == Some("tip"));
    let sim = Simulation { tolerance: 1e-10, ..Simulation::new(arm.clone(), touches.collect()) };
    let run = sim.run(&start.q, &start.qd, 2.0 * SPAN)?;
    Ok((sim, run))
}

/// Figs. 4, 6 and 7: the rigid impact.
pub(super) fn motion(arm: &Chain, elbow: Elbow) -> Result<TipMotion, PaperError> {
    let (sim, run) = run(arm, elbow, ContactRule { law: "newton", restitution: RESTITUTION, ..Default::default() })?;
    let missed = || PaperError::Missed { elbow: elbow.name() };
    let hit = run.events.iter().find(|event| matches!(event.kind, EventKind::Impact { .. })).ok_or_else(missed)?;
    let (n, t) = (-Vector3::from(NORMAL), Vector3::from(TANGENT));
    let point = arm.point(arm.frame("tip")?, Vector3::zeros());
    let mut workspace = arm.workspace();
    let place = workspace.update(arm, &hit.q)?.position(point);
    let mut state = |moment: Moment, time: f64| -> Result<TipState, SimError> {
        let view = workspace.update(arm, &moment.q)?;
        let (x, u) = (view.position(point) - place, view.point_velocity(point, &moment.qd)?);
        Ok(TipState { time, normal: n.dot(&u), tangential: t.dot(&u), towards: n.dot(&x), along: t.dot(&x) })
    };
    let step = |k: usize| WINDOW * (k as f64 / STEPS as f64 - 1.0);
    let side = |qd: &[f64]| Moment { time: hit.time, q: hit.q.clone(), qd: qd.to_vec() };
    let mut states = Vec::new();
    for k in (0..=2 * STEPS).filter(|k| *k != STEPS) {
        if k == STEPS + 1 {
            states.push(state(side(&hit.qd_minus), 0.0)?);
            states.push(state(side(&hit.qd_plus), 0.0)?);
        }
        states.push(state(run.at(&sim.chain, hit.time + step(k)), step(k))?);
    }
    let ticks = (0..10).map(|k| step(CLOCK.0 + k * CLOCK.1));
    let samples = ticks.map(|time| state(run.at(&sim.chain, hit.time + time), time)).collect::<Result<_, _>>()?;
    Ok(TipMotion { elbow, states, samples })
}

/// Fig. 5: a rigid impact has no force, so the contact gives way (Hunt & Crossley, damped so that e comes out as asked).
pub(super) fn forces(arm: &Chain, elbow: Elbow, friction: f64) -> Result<Forces, PaperError> {
    let tangential = Holding::Smoothed { slip_speed: SLIP_SPEED };
    let compliance = Some(Compliance { tangential, ..Compliance::new(STIFFNESS) });
    let rule = ContactRule { restitution: RESTITUTION, friction, compliance, ..Default::default() };
    let (sim, run) = run(arm, elbow, rule)?;
    let missed = || PaperError::Missed { elbow: elbow.name() };
    let [first, last, ..] = run.events.as_slice() else { return Err(missed()) };
    let EventKind::Mode { mode: ContactMode::Pressing { touch, damping } } = first.kind else { return Err(missed()) };
    let (n, t) = (-Vector3::from(NORMAL), Vector3::from(TANGENT));
    let force = |k: usize| -> Result<[f64; 3], SimError> {
        let span = (last.time - first.time) * k as f64 / STEPS as f64;
        let on_wall = -sim.pressing_force(touch, damping, &run.at(&sim.chain, first.time + span))?;
        Ok([span, n.dot(&on_wall), t.dot(&on_wall)])
    };
    Ok(Forces { elbow, states: (0..=STEPS).map(force).collect::<Result<_, _>>()? })
}

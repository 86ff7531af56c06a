//! Simulations for Figs. 4 to 7: the tip before, during and after one impact at 0.2 m/s and 45°.

use super::{Elbow, NORMAL, TANGENT, strike};
use crate::EvidenceError;
use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::{Energetic, Newton};
use carom_sim::{
    Compliance, ContactMode, ContactRule, EventKind, Holding, Moment, SimError, Simulation, Surface, Touch, Trajectory,
    free_motion,
};
use nalgebra::Vector3;

/// Angle and speed of Figs. 4 to 7.
pub(super) const ANGLE: f64 = 45.0;
pub(super) const SPEED: f64 = 0.2;
/// Newton's coefficient of Table I at 45°, equal for both elbows.
pub(super) const RESTITUTION: f64 = 0.35;
/// Parameters chosen here for the compliant contact of Fig. 5: stiffness, N/m^(3/2) (Hertz's exponent), and friction.
pub(super) const STIFFNESS: f64 = 1e9;
pub(super) const FRICTION: f64 = 0.1;
const SLIP_SPEED: f64 = 1e-3;
/// Time shown before and after the impact, s.
const WINDOW: f64 = 0.02;
/// Time simulated before and after the impact, s. It is longer, because the probe is a ball that touches before its centre.
const SPAN: f64 = 1.01 * WINDOW;
/// Steps of each half. The paper's sampling interval of 4 ms is every 80th step, beginning with the 40th: ten samples, five on
/// each side and none at the impact.
const STEPS: usize = 400;
const CLOCK: (usize, usize) = (40, 80);

/// State of the tip at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TipState {
    /// Time from the impact, s.
    pub time: f64,
    /// Velocity into the wall (the paper's normal), m/s.
    pub normal: f64,
    /// Velocity down along the wall, m/s.
    pub tangential: f64,
    /// Position towards the wall, from the point of impact, m.
    pub towards: f64,
    /// Position down along the wall, from the point of impact, m.
    pub along: f64,
}

/// Motion of the tip through a rigid impact.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TipMotion {
    /// Configuration of the arm.
    pub elbow: Elbow,
    /// States every 50 µs, with the states before and after the impact at time 0.
    pub states: Vec<TipState>,
    /// States every 4 ms, the paper's sampling interval.
    pub samples: Vec<TipState>,
}

/// Force on the wall during a compliant contact.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Forces {
    /// Configuration of the arm.
    pub elbow: Elbow,
    /// Time from the beginning of the contact (s), force into the wall and force down along the wall (N), at equal steps.
    pub states: Vec<[f64; 3]>,
}

impl Forces {
    /// The greatest normal force, N.
    pub fn peak(&self) -> f64 {
        self.states.iter().map(|s| s[1]).fold(0.0, f64::max)
    }

    /// Duration of the contact, s.
    pub fn duration(&self) -> f64 {
        self.states.last().map_or(0.0, |s| s[0])
    }

    /// Normal and tangential impulse on the wall, N s, by the trapezoidal rule, which has second order for a force that
    /// begins and ends at zero.
    pub fn impulse(&self) -> [f64; 2] {
        let area = |k: usize| self.states.windows(2).map(|s| (s[1][0] - s[0][0]) * (s[0][k] + s[1][k]) / 2.0).sum();
        [area(1), area(2)]
    }
}

/// Simulates the arm and its wall.
fn run(arm: &Chain, elbow: Elbow, contact: ContactRule) -> Result<(Simulation, Trajectory), SimError> {
    let hit = strike(arm, elbow, ANGLE, SPEED, contact.law.restitution())?;
    let start = free_motion(arm, &elbow.pose(), &hit.qd_minus, Vector3::zeros(), -SPAN, 2)?.remove(1);
    let at_impact = arm.workspace().update(arm, &elbow.pose())?.pose(arm.frame("tip")?).translation;
    let obstacle = Obstacle::half_space(at_impact, NORMAL.into())?;
    let wall = Surface { name: "wall".into(), obstacle, contact, motion: None };
    let touches = Touch::all(arm, &[wall], 0.0)?.touches.into_iter().filter(|touch| touch.link() == Some("tip"));
    let sim = Simulation { tolerance: 1e-10, ..Simulation::new(arm.clone(), touches.collect()) };
    let run = sim.run(&start.q, &start.qd, 2.0 * SPAN)?;
    Ok((sim, run))
}

fn missed(elbow: Elbow) -> EvidenceError {
    EvidenceError::new(format!(
        "{}-elbow: the tip of this arm does not hit the wall and separate from it: give an arm like robots/planar2.urdf",
        elbow.name()
    ))
}

/// Figs. 4, 6 and 7: the rigid impact.
pub(super) fn motion(arm: &Chain, elbow: Elbow) -> Result<TipMotion, EvidenceError> {
    let (sim, run) = run(arm, elbow, ContactRule::new(Newton { restitution: RESTITUTION, friction: 0.0 }))?;
    let missed = || missed(elbow);
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

/// Fig. 5: compliant contact by Hunt and Crossley, with the damping that gives Stronge's coefficient `RESTITUTION`. A rigid
/// impact has no finite force.
pub(super) fn forces(arm: &Chain, elbow: Elbow, friction: f64) -> Result<Forces, EvidenceError> {
    let tangential = Holding::Smoothed { slip_speed: SLIP_SPEED };
    let compliance = Some(Compliance { tangential, ..Compliance::new(STIFFNESS) });
    let rule = ContactRule { compliance, ..ContactRule::new(Energetic { restitution: RESTITUTION, friction }) };
    let (sim, run) = run(arm, elbow, rule)?;
    let missed = || missed(elbow);
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

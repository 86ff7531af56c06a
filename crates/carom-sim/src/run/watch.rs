//! The rate of the state of a motion, and the witness functions whose zeros end its contact mode.

use super::leg::{Flow, Witness};
use crate::contact::{BallOnPlane, ContactMode};
use crate::error::SimError;
use crate::model::Simulation;
use crate::motion::{Dry, DryJoint, Held, Motion};
use crate::state::{Space, View};
use nalgebra::Vector3;

/// The kinds of witness functions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Watch {
    /// The gap of a touch closes.
    Gap(usize),
    /// The normal force becomes negative.
    NormalForce,
    /// The slip velocity becomes zero.
    SlipStops,
    /// The contact force leaves the friction cone.
    Cone,
    /// A compliant contact opens.
    Depth,
    /// A compliant contact changes from loading to unloading.
    Turns,
    /// A joint with dry friction comes to rest (index into `dry`).
    JointStops(usize),
    /// The load of a joint exceeds its dry friction (index into `dry`).
    JointBreaksLoose(usize),
}

/// A motion with the witness functions of its present contact mode.
pub(crate) struct Watched<'m, 'a, A: Space> {
    motion: &'m mut Motion<'a, A>,
    pub watches: Vec<Watch>,
}

impl<'m, 'a, A: Space> Watched<'m, 'a, A> {
    pub fn new(motion: &'m mut Motion<'a, A>) -> Self {
        let sim = motion.sim;
        let gaps = (0..sim.touches.len()).filter(|&k| Some(k) != motion.mode.touch());
        let mut watches: Vec<Watch> = gaps.map(Watch::Gap).collect();
        match motion.mode {
            ContactMode::Free | ContactMode::Several | ContactMode::Latched { .. } => {}
            ContactMode::Sliding { touch } if sim.touches[touch].contact.law.friction() == 0.0 => {
                watches.push(Watch::NormalForce);
            }
            ContactMode::Sliding { .. } => watches.extend([Watch::NormalForce, Watch::SlipStops]),
            ContactMode::Sticking { .. } => watches.extend([Watch::NormalForce, Watch::Cone]),
            ContactMode::Pressing { touch, .. } => {
                watches.push(Watch::Depth);
                if sim.touches[touch].contact.compliance.is_some_and(|it| it.turns()) {
                    watches.push(Watch::Turns);
                }
            }
        }
        watches.extend(motion.dry.iter().enumerate().map(|(k, joint)| match joint.state {
            Dry::Holds => Watch::JointBreaksLoose(k),
            Dry::Brakes(_) => Watch::JointStops(k),
        }));
        Self { motion, watches }
    }
}

impl Watch {
    /// Whether it depends on constraint forces, not only on positions and velocities.
    fn needs_forces(self) -> bool {
        matches!(self, Self::NormalForce | Self::Cone | Self::JointBreaksLoose(_))
    }
}

impl<A: Space> Flow for Watched<'_, '_, A> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let motion = &mut *self.motion;
        let (q, qd) = motion.split(y);
        let (nq, nv) = (q.len(), qd.len());
        if nq == nv {
            out[..nq].copy_from_slice(qd); // no floating joint
        } else {
            motion.sim.chain.q_rate_into(q, qd, &mut out[..nq]);
        }
        let (qdd, rest) = out[nq..].split_at_mut(nv);
        let (power, bends) = rest.split_at_mut(2);
        if motion.moves_freely() {
            power.copy_from_slice(&motion.accelerate(time, y, qdd)?);
            bends.fill(0.0);
        } else {
            let held = motion.in_mode(time, y)?;
            qdd.copy_from_slice(held.qdd.as_slice());
            power.copy_from_slice(&held.power);
            bends.copy_from_slice(&held.bends.as_slice()[..bends.len()]);
        }
        Ok(())
    }

    fn witnesses(&mut self, time: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError> {
        out.clear();
        look(self.motion, &self.watches, time, y, |witness| out.push(witness))
    }

    fn witness(&mut self, k: usize, time: f64, y: &[f64]) -> Result<Witness, SimError> {
        let mut found = Witness::default();
        look(self.motion, &self.watches[k..=k], time, y, |witness| found = witness)?;
        Ok(found)
    }

    fn settle(&mut self, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let motion = &mut *self.motion;
        let changed = motion.sim.normalise(y);
        match motion.mode {
            ContactMode::Free | ContactMode::Several | ContactMode::Pressing { .. } => Ok(changed),
            ContactMode::Sliding { touch } => {
                let moved = motion.stop_normal(touch, time, y)?;
                motion.follow_slip(touch, time, y)?;
                Ok(moved || changed)
            }
            ContactMode::Sticking { touch } | ContactMode::Latched { touch } => {
                let moved = motion.stop_normal(touch, time, y)?;
                motion.stop_slip(touch, time, y)?;
                Ok(moved || changed)
            }
        }
    }
}

/// Passes the values of witness functions at a state to `see`.
fn look<A: Space>(
    motion: &mut Motion<A>,
    watches: &[Watch],
    time: f64,
    y: &[f64],
    mut see: impl FnMut(Witness),
) -> Result<(), SimError> {
    let held = if watches.iter().any(|w| w.needs_forces()) { Some(motion.in_mode(time, y)?) } else { None };
    let (q, qd) = motion.split(y);
    let (mode, slip, dry, deepest) = (motion.mode, motion.slip, &motion.dry, motion.deepest);
    let now = Now { mode, slip, dry, deepest, held: held.as_ref() };
    let view = View::new(motion.model, &mut motion.workspace, q)?;
    for watch in watches {
        see(watch.at((motion.sim, &motion.balls), &now, &view, (q, qd), time)?);
    }
    Ok(())
}

/// The inputs of the witness functions beside the state: see [`Motion`].
struct Now<'a> {
    mode: ContactMode,
    slip: Vector3<f64>,
    dry: &'a [DryJoint],
    deepest: f64,
    /// Computed if a witness needs constraint forces.
    held: Option<&'a Held>,
}

impl Watch {
    /// The value of the witness at a state.
    fn at<A: Space>(
        self,
        (sim, balls): (&Simulation, &[Option<BallOnPlane<A>>]),
        now: &Now,
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
    ) -> Result<Witness, SimError> {
        let look = |touch: usize| sim.touches[touch].look(balls[touch].as_ref(), view, (q, qd), time);
        let own = now.mode.touch().unwrap_or(0);
        Ok(match (self, now.held) {
            (Self::Gap(touch), _) => {
                let (gap, rate) = look(touch)?;
                Witness { value: gap, rate: Some(rate) }
            }
            (Self::Depth, _) => {
                let (gap, rate) = look(own)?;
                Witness { value: -gap, rate: Some(-rate) }
            }
            (Self::Turns, _) => {
                let (gap, rate) = look(own)?;
                // Only changes from loading to unloading deeper than the last one count. The comparison also keeps
                // rounding of the rate from a second event at the same point.
                Witness { value: if -gap > now.deepest { -rate } else { 0.0 }, rate: None }
            }
            (Self::SlipStops, _) => {
                let touch = &sim.touches[own];
                let place = touch.at(view, q, time).surface;
                let u = place.map_or(Ok(Vector3::zeros()), |place| touch.u(&place, view, qd, time))?;
                Witness { value: u.dot(&now.slip), rate: None }
            }
            (Self::JointStops(k), _) => {
                let DryJoint { v, state, .. } = now.dry[k];
                let Dry::Brakes(direction) = state else { unreachable!("this witness is for slipping joints") };
                Witness { value: qd[v] * direction, rate: None }
            }
            (Self::NormalForce, Some(held)) => Witness { value: held.normal_force, rate: None },
            (Self::Cone, Some(held)) => {
                let tangential = held.force - held.normal * held.normal_force;
                let mu = sim.touches[own].contact.law.friction();
                Witness { value: mu * held.normal_force - tangential.norm(), rate: None }
            }
            (Self::JointBreaksLoose(k), Some(held)) => {
                Witness { value: now.dry[k].friction - held.joints[k].abs(), rate: None }
            }
            (_, None) => unreachable!("constraint forces are computed for these witnesses"),
        })
    }
}

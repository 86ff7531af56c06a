//! A motion as the integrator of a leg sees it: the rate of its state, and the witnesses whose zeros end its mode of contact.

use crate::error::SimError;
use crate::leg::{Flow, Witness};
use crate::motion::{Dry, Motion};
use crate::space::Space;
use crate::trajectory::ContactMode;
use nalgebra::Vector3;

/// What a witness watches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Watch {
    Gap(usize),
    /// The contact would have to pull.
    NormalForce,
    /// Slip comes to rest.
    SlipStops,
    /// Friction no longer holds.
    Cone,
    /// A compliant contact comes out of its surface.
    Depth,
    /// A compliant contact stops to yield.
    Turns,
    /// A joint braked by dry friction comes to rest (index into `dry`).
    JointStops(usize),
    /// Dry friction no longer holds a joint.
    JointBreaksLoose(usize),
}

impl<A: Space> Motion<'_, A> {
    /// What ends the mode that it is in.
    pub fn watches(&self) -> Vec<Watch> {
        let sim = self.sim;
        let gaps = (0..sim.touches.len()).filter(|&k| Some(k) != self.mode.touch());
        let mut watches: Vec<Watch> = gaps.map(Watch::Gap).collect();
        match self.mode {
            ContactMode::Free | ContactMode::Several | ContactMode::Latched { .. } => {}
            ContactMode::Sliding { touch } if sim.touches[touch].contact.friction == 0.0 => {
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
        watches.extend(self.dry.iter().enumerate().map(|(k, joint)| match joint.state {
            Dry::Holds => Watch::JointBreaksLoose(k),
            Dry::Brakes(_) => Watch::JointStops(k),
        }));
        watches
    }
}

impl<A: Space> Flow for Motion<'_, A> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (q, qd) = self.split(y);
        let held = self.in_mode(time, y)?;
        let (nq, nv) = (q.len(), qd.len());
        self.sim.chain.q_rate_into(q, qd, &mut out[..nq]);
        out[nq..nq + nv].copy_from_slice(held.qdd.as_slice());
        out[nq + nv..nq + nv + 2].copy_from_slice(&held.power);
        if let Some(bends) = out.get_mut(nq + nv + 2..).filter(|tail| !tail.is_empty()) {
            bends.copy_from_slice(held.bends.as_slice());
        }
        Ok(())
    }

    fn witnesses(&mut self, time: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError> {
        out.clear();
        let (q, qd) = self.split(y);
        let watches = self.watches();
        // Forces only where one of them is watched.
        let forces = watches.iter().any(|w| {
            !matches!(w, Watch::Gap(_) | Watch::Depth | Watch::Turns | Watch::SlipStops | Watch::JointStops(_))
        });
        let held = if forces { Some(self.in_mode(time, y)?) } else { None };
        let sim = self.sim;
        let (mode, slip, dry, deepest) = (self.mode, self.slip, self.dry.clone(), self.deepest);
        let view = self.view(q)?;
        for watch in watches {
            let witness = match (watch, &held) {
                (Watch::Gap(touch), _) => {
                    let touch = &sim.touches[touch];
                    let at = touch.at(&view, q, time);
                    Witness { value: at.gap, rate: Some(touch.rate(&at, &view, qd, time)?) }
                }
                (Watch::Depth, _) => {
                    let touch = &sim.touches[mode.touch().unwrap_or(0)];
                    let at = touch.at(&view, q, time);
                    Witness { value: -at.gap, rate: Some(-touch.rate(&at, &view, qd, time)?) }
                }
                (Watch::Turns, _) => {
                    let touch = &sim.touches[mode.touch().unwrap_or(0)];
                    let at = touch.at(&view, q, time);
                    // Above the deepest point so far it may go to and fro as it likes; and one that has just turned there
                    // doesn't do so again by the rounding of its rate.
                    let deeper = -at.gap > deepest;
                    let value = if deeper { -touch.rate(&at, &view, qd, time)? } else { 0.0 };
                    Witness { value, rate: None }
                }
                (Watch::SlipStops, _) => {
                    let touch = &sim.touches[mode.touch().unwrap_or(0)];
                    let place = touch.at(&view, q, time).surface;
                    let u = place.map_or(Ok(Vector3::zeros()), |place| touch.u(&place, &view, qd, time))?;
                    Witness { value: u.dot(&slip), rate: None }
                }
                (Watch::JointStops(k), _) => {
                    let Dry::Brakes(direction) = dry[k].state else { unreachable!("it was listed as moving") };
                    Witness { value: qd[dry[k].v] * direction, rate: None }
                }
                (Watch::NormalForce, Some(held)) => Witness { value: held.normal_force, rate: None },
                (Watch::Cone, Some(held)) => {
                    let tangential = held.force - held.normal * held.normal_force;
                    let mu = sim.touches[mode.touch().unwrap_or(0)].contact.friction;
                    Witness { value: mu * held.normal_force - tangential.norm(), rate: None }
                }
                (Watch::JointBreaksLoose(k), Some(held)) => {
                    Witness { value: dry[k].friction - held.joints[k].abs(), rate: None }
                }
                (_, None) => unreachable!("forces are there when they are watched"),
            };
            out.push(witness);
        }
        Ok(())
    }

    fn settle(&mut self, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let changed = self.sim.normalise(y);
        match self.mode {
            ContactMode::Free | ContactMode::Several | ContactMode::Pressing { .. } => Ok(changed),
            ContactMode::Sliding { touch } => {
                let moved = self.stop_normal(touch, time, y)?;
                self.follow_slip(touch, time, y)?;
                Ok(moved || changed)
            }
            ContactMode::Sticking { touch } | ContactMode::Latched { touch } => {
                let moved = self.stop_normal(touch, time, y)?;
                self.stop_slip(touch, time, y)?;
                Ok(moved || changed)
            }
        }
    }
}

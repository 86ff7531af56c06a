//! Event-driven simulation: smooth legs of motion, and exact events between them.
//!
//! **One contact at a time.** In `free` mode nothing touches and every closing gap is an event. An impact is resolved by
//! the law; what follows is decided by the numbers just after it, with u⁺ the velocity off the surface, r = u⁺/|u⁻| and
//! −a the acceleration towards the surface in free motion:
//!
//! - u⁺ > 0 and not Zeno: free motion. The gap's witness sleeps for half of the predicted flight 2u⁺/a, so that the
//!   contact just left does not fire again.
//! - a > 0, r < 1 and remaining time 2u⁺/(a(1−r)) below [`Simulation::zeno_time`]: infinitely many impacts fit into that
//!   time; they are gone through at once (`zeno`), after which the contact lasts. A pendulum that swings into a wall at its
//!   lowest point has a = 0 there: its impacts never accumulate, and none of them is skipped.
//! - u⁺ = 0 (r = 0) and a > 0: the contact lasts from here.
//!
//! A lasting contact slides or sticks under the constraint force that keeps g̈ = 0 (and, sticking, u̇ = 0). It opens where
//! that force would have to pull, slides where it would leave the friction cone, and may stick where slip comes to rest.

use crate::error::SimError;
use crate::leg::{Accuracy, LegEnd, Sampler, leg};
use crate::motion::{Motion, Watch};
use crate::strike::Impacts;
use crate::touch::{At, Touch, TouchKind};
use crate::trajectory::{ContactMode, EnergyBooks, Event, EventKind, Moment, Statistics, StopReason, Trajectory};
use carom_chain::{Chain, ChainError};
use carom_impact::{LAW_NAMES, law_by_name};
use nalgebra::Vector3;

/// What drives the joints.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// Motors off.
    Off,
    /// Constant joint forces, N m or N.
    Constant(Vec<f64>),
    /// `kp (target − q) − kd qd`, for chains whose q̇ is qd.
    Pd {
        /// Stiffness, N m/rad or N/m.
        kp: f64,
        /// Damping, N m s/rad or N s/m.
        kd: f64,
        /// Target configuration.
        target: Vec<f64>,
    },
    /// Exactly what holds the chain against gravity.
    GravityCompensation,
}

/// The law of all contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactRule {
    /// Name of the impact law, one of [`carom_impact::LAW_NAMES`].
    pub law: &'static str,
    /// Its coefficient of restitution.
    pub restitution: f64,
    /// Coefficient of friction, of impacts and of lasting contact.
    pub friction: f64,
    /// Newton's coefficient of the joints' limits.
    pub limit_restitution: f64,
}

/// A chain among surfaces.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The chain.
    pub chain: Chain,
    /// What may touch.
    pub touches: Vec<Touch>,
    /// How it touches.
    pub contact: ContactRule,
    /// Acceleration of free fall, world, m/s².
    pub gravity: Vector3<f64>,
    /// What drives the joints. Their viscous damping acts besides; their dry friction does not.
    pub drive: Drive,
    /// Relative tolerance of the integration.
    pub tolerance: f64,
    /// Longest step, s.
    pub max_step: f64,
    /// Impacts that would all happen within this time are gone through at once, s.
    pub zeno_time: f64,
    /// Stop after so many events.
    pub max_events: usize,
}

impl Simulation {
    /// Runs from `(q, qd)` for `duration` seconds. `watch` gets the moments at multiples of `every` seconds.
    ///
    /// # Errors
    /// [`SimError`]: states and settings that do not fit, an overlap at the start, two contacts at once, jam.
    pub fn run(
        &self,
        q: &[f64],
        qd: &[f64],
        duration: f64,
        every: Option<f64>,
        watch: &mut dyn FnMut(Moment),
    ) -> Result<Trajectory, SimError> {
        self.check(q, qd, duration, every)?;
        let nq = self.chain.nq();
        let mut hand = |time: f64, y: &[f64]| watch(Moment { time, q: y[..nq].to_vec(), qd: y[nq..].to_vec() });
        let mut sampler = Sampler { every, count: 0, watch: &mut hand };
        let mut motion = Motion::new(self);
        let mut y: Vec<f64> = q.iter().chain(qd).copied().collect();
        let mut trajectory = Trajectory {
            events: Vec::new(),
            last: Moment { time: 0.0, q: q.to_vec(), qd: qd.to_vec() },
            mode: ContactMode::Free,
            stop: StopReason::Duration,
            statistics: Statistics::default(),
            energy: EnergyBooks { start: motion.energy(&y)?, ..Default::default() },
        };
        let mut time = 0.0;
        motion.begin(&mut time, &mut y, &mut trajectory)?;
        while time < duration {
            if trajectory.events.len() >= self.max_events {
                trajectory.stop = StopReason::Events;
                break;
            }
            let accuracy = Accuracy { tolerance: self.tolerance, max_step: self.max_step };
            let end = motion.asleep.map_or(duration, |(_, wake)| wake.min(duration));
            let LegEnd { time: t, y: state, fired } =
                leg(&mut motion, time, &y, end, accuracy, &mut trajectory.statistics, &mut sampler)?;
            (time, y) = (t, state);
            match fired {
                Some(witness) => motion.event(witness, &mut time, &mut y, &mut trajectory)?,
                None => motion.wake(&mut time, &mut y, &mut trajectory)?,
            }
        }
        trajectory.energy.end = motion.energy(&y)?;
        trajectory.mode = motion.mode;
        trajectory.last = Moment { time, q: y[..nq].to_vec(), qd: y[nq..].to_vec() };
        Ok(trajectory)
    }
}

impl Simulation {
    fn check(&self, q: &[f64], qd: &[f64], duration: f64, every: Option<f64>) -> Result<(), SimError> {
        self.chain.check_state(q, qd)?;
        let positive = |what, value: f64| {
            let fine = value > 0.0 && value.is_finite();
            let rule = "it must be positive and finite";
            if fine { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
        };
        positive("duration", duration)?;
        positive("tolerance", self.tolerance)?;
        positive("longest step", self.max_step)?;
        positive("Zeno time", self.zeno_time)?;
        if let Some(every) = every {
            positive("sampling interval", every)?;
        }
        let share = |what, value: f64| {
            let rule = "a coefficient of restitution lies between 0 and 1";
            if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
        };
        share("restitution", self.contact.restitution)?;
        share("limit restitution", self.contact.limit_restitution)?;
        if law_by_name::<3>(self.contact.law, 0.0, 0.0).is_none() {
            return Err(SimError::UnknownLaw { name: self.contact.law.into(), known: LAW_NAMES.join(", ") });
        }
        let mu = self.contact.friction;
        if !(mu >= 0.0 && mu.is_finite()) {
            let rule = "a coefficient of friction is finite and not negative";
            return Err(SimError::Setting { what: "friction", value: mu, rule });
        }
        match &self.drive {
            Drive::Constant(tau) => self.chain.check_v("tau", tau)?,
            Drive::Pd { .. } if self.chain.nq() != self.chain.nv() => {
                let why = format!("a PD drive needs joints with q̇ = qd; '{}' floats", self.chain.name());
                return Err(ChainError::NotReducible(why).into());
            }
            Drive::Pd { target, .. } => self.chain.check_v("target", target)?,
            Drive::Off | Drive::GravityCompensation => {}
        }
        Ok(())
    }
}

impl Motion<'_> {
    /// What touches at the start.
    fn begin(&mut self, time: &mut f64, y: &mut [f64], trajectory: &mut Trajectory) -> Result<(), SimError> {
        for touch in 0..self.sim.touches.len() {
            let (q, qd) = self.split(y);
            let (gap, rate, _) = self.closing(touch, q, qd)?;
            if gap < -TOUCHING {
                let name = self.sim.touches[touch].name.clone();
                return Err(SimError::Overlap { touch: name, depth: -gap });
            }
            if gap > TOUCHING {
                continue;
            }
            self.alone(touch, *time)?;
            if rate < 0.0 {
                self.impact(touch, time, y, trajectory)?;
            } else {
                self.leave(touch, 0.0, rate, time, y, trajectory)?;
            }
        }
        Ok(())
    }

    /// A sleeping witness wakes; if its gap is not open by then, it has touched.
    fn wake(&mut self, time: &mut f64, y: &mut [f64], trajectory: &mut Trajectory) -> Result<(), SimError> {
        let Some((touch, wake)) = self.asleep else { return Ok(()) };
        if *time < wake {
            return Ok(()); // the end of the simulation came first
        }
        self.asleep = None;
        let (q, qd) = self.split(y);
        let (gap, rate, _) = self.closing(touch, q, qd)?;
        if gap > 0.0 {
            Ok(())
        } else if rate < 0.0 {
            self.impact(touch, time, y, trajectory)
        } else {
            self.leave(touch, 0.0, rate, time, y, trajectory)
        }
    }

    /// Only one contact at a time.
    fn alone(&self, touch: usize, time: f64) -> Result<(), SimError> {
        match self.mode.touch() {
            Some(other) if other != touch => Err(SimError::SeveralContacts {
                time,
                first: self.sim.touches[other].name.clone(),
                second: self.sim.touches[touch].name.clone(),
            }),
            _ => Ok(()),
        }
    }

    fn event(
        &mut self,
        witness: usize,
        time: &mut f64,
        y: &mut [f64],
        trajectory: &mut Trajectory,
    ) -> Result<(), SimError> {
        let (watch, touch) = (self.watches()[witness], self.mode.touch());
        match (watch, touch) {
            (Watch::Gap(touch), _) => {
                self.alone(touch, *time)?;
                self.impact(touch, time, y, trajectory)
            }
            (Watch::NormalForce, Some(touch)) => {
                self.mode = ContactMode::Free;
                self.asleep = Some((touch, *time + BAND));
                self.note(EventKind::LiftOff { touch }, *time, y, y, trajectory);
                Ok(())
            }
            (Watch::SlipStops, Some(touch)) => {
                let before = y.to_vec();
                self.stop_slip(touch, y)?;
                self.last(touch, *time, &before, y, trajectory)
            }
            (Watch::Cone, Some(touch)) => {
                let held = self.held(*time, y, touch, true)?;
                self.slide_off(&held);
                self.mode = ContactMode::Sliding { touch };
                self.note(EventKind::Mode { mode: self.mode }, *time, y, y, trajectory);
                Ok(())
            }
            (_, None) => Ok(()),
        }
    }

    fn note(&self, kind: EventKind, time: f64, before: &[f64], after: &[f64], trajectory: &mut Trajectory) {
        let (q, qd_plus) = self.split(after);
        let (_, qd_minus) = self.split(before);
        let (q, qd_minus, qd_plus) = (q.to_vec(), qd_minus.to_vec(), qd_plus.to_vec());
        trajectory.events.push(Event { time, kind, q, qd_minus, qd_plus });
    }

    fn impact(
        &mut self,
        touch: usize,
        time: &mut f64,
        y: &mut [f64],
        trajectory: &mut Trajectory,
    ) -> Result<(), SimError> {
        let before = y.to_vec();
        let (q, qd) = self.split(&before);
        let (_, approach, _) = self.closing(touch, q, qd)?;
        let sim = self.sim;
        let nq = sim.chain.nq();
        let energy = self.energy(&before)?;
        let kind = match &sim.touches[touch].kind {
            TouchKind::Surface { shape, .. } => {
                let (offset, normal) = {
                    let kin = self.workspace.update(&sim.chain, q)?;
                    let At { surface, .. } = sim.touches[touch].at(&kin, q);
                    let (point, normal) = surface.unwrap_or_else(|| unreachable!("a surface has a touching point"));
                    (kin.pose(shape.frame()).inverse().point(kin.position(point)), normal)
                };
                let law = law_by_name::<3>(sim.contact.law, sim.contact.restitution, sim.contact.friction);
                let law = law.unwrap_or_else(|| unreachable!("the name was checked before the start"));
                let strike = sim.chain.impact(q, qd).at(shape.frame()).offset(offset.into()).normal(normal.into());
                let hit = Box::new(strike.resolve(law.as_ref())?);
                y[nq..].copy_from_slice(&hit.qd_plus);
                EventKind::Impact { touch, hit }
            }
            TouchKind::Limit { joint, .. } => {
                let mut kin = self.workspace.update(&sim.chain, q)?;
                let at = sim.touches[touch].at(&kin, q);
                let row = sim.touches[touch].normal_row(&at, &kin)?;
                let response = kin.solve(row.as_slice())?;
                let impulse = -(1.0 + sim.contact.limit_restitution) * approach / row.dot(&response);
                for (v, x) in y[nq..].iter_mut().zip(response.iter()) {
                    *v += x * impulse;
                }
                EventKind::Limit { joint: joint.clone(), impulse }
            }
        };
        self.note(kind, *time, &before, y, trajectory);
        trajectory.energy.impacts += energy - self.energy(y)?;
        let (q, qd) = self.split(y);
        let (_, rebound, _) = self.closing(touch, q, qd)?;
        self.leave(touch, approach, rebound, time, y, trajectory)
    }

    /// What follows when a touch has, or gets, the velocity `rebound` off the surface.
    fn leave(
        &mut self,
        touch: usize,
        approach: f64,
        rebound: f64,
        time: &mut f64,
        y: &mut [f64],
        trajectory: &mut Trajectory,
    ) -> Result<(), SimError> {
        let toward = -self.gap_free(touch, y)?;
        let share = if approach < 0.0 { rebound / -approach } else { 0.0 };
        // Rebounds below the rounding of the approach are none.
        let stays = rebound <= 1e-14 * approach.abs();
        let left = 2.0 * rebound / (toward * (1.0 - share));
        self.mode = ContactMode::Free;
        if toward > 0.0 && (stays || (share < 1.0 && left < self.sim.zeno_time)) {
            let before = y.to_vec();
            self.stop_normal(touch, y)?;
            if !stays {
                let impacts = trajectory
                    .events
                    .iter()
                    .filter(|e| {
                        matches!(e.kind, EventKind::Impact { .. } | EventKind::Limit { .. })
                            && e.kind.touch().is_none_or(|t| t == touch)
                    })
                    .count();
                self.pass(touch, left, *time, y)?;
                *time += left;
                self.note(EventKind::Zeno { touch, impacts }, *time, &before, y, trajectory);
            }
            return self.last(touch, *time, &before, y, trajectory);
        }
        // Half of the flight, during which the gap is open: the contact just left can't fire again.
        let wake = if toward > 0.0 { rebound / toward } else { BAND };
        // (And never so short that the integrator can't step.)
        self.asleep =
            Some((touch, *time + wake.clamp(1e-11 * (1.0 + *time), self.sim.max_step.max(1e-11 * (1.0 + *time)))));
        Ok(())
    }

    /// The contact lasts: does it stick or slide?
    fn last(
        &mut self,
        touch: usize,
        time: f64,
        before: &[f64],
        y: &[f64],
        trajectory: &mut Trajectory,
    ) -> Result<(), SimError> {
        self.mode = self.lasting_mode(touch, time, y)?;
        self.note(EventKind::Mode { mode: self.mode }, time, before, y, trajectory);
        Ok(())
    }
}

/// Gaps this small at the start count as touching, m.
const TOUCHING: f64 = 1e-9;
/// A contact that opens without a velocity may not fire again for this long, s.
const BAND: f64 = 1e-4;

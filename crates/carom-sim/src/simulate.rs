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
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | g̈₀, u̇₀ | 1, 3 | accelerations of gap and touching point without contact force | `gap_free`, `u_free` |
//! | λ | 3 | contact force, world, N | `force` |
//! | d | 3 | unit direction of slip | `slip` |
//!
//! Sliding: λ = λₙ(n − μ d), λₙ = −g̈₀/(nᵀHn − μ nᵀHd). Sticking: λ = −H⁺u̇₀.

use crate::error::SimError;
use crate::leg::{Accuracy, Flow, LegEnd, Sampler, Witness, leg};
use crate::strike::Impacts;
use crate::touch::{At, Touch, TouchKind};
use crate::trajectory::{ContactMode, EnergyBooks, Event, EventKind, Moment, Statistics, StopReason, Trajectory};
use carom_chain::{Chain, ChainError, Coordinates, Kinematics, Spatial, Workspace};
use carom_impact::law_by_name;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

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

/// State vectors are (q, qd).
struct Motion<'a> {
    sim: &'a Simulation,
    workspace: Workspace<Spatial<f64>>,
    mode: ContactMode,
    /// Direction of slip while the slip itself is too small to show it.
    slip: Vector3<f64>,
    /// A touch whose witness sleeps, and until when.
    asleep: Option<(usize, f64)>,
}

/// A lasting contact's acceleration and force.
struct Held {
    qdd: DVector<f64>,
    force: Vector3<f64>,
    normal: Vector3<f64>,
    normal_force: f64,
}

/// Slip slower than this share of the joints' speed has no direction of its own.
const STILL: f64 = 1e-9;

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
        let mut motion = Motion {
            sim: self,
            workspace: self.chain.workspace(),
            mode: ContactMode::Free,
            slip: Vector3::zeros(),
            asleep: None,
        };
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
    /// Makes the quaternions in q unit again: stages and steps of the integration leave the sphere by their error. Says
    /// whether any was off.
    fn normalise(&self, q: &mut [f64]) -> bool {
        let mut changed = false;
        for joint in self.chain.joints() {
            if let Coordinates::Own { q: own, v } = &joint.coordinates
                && own.len() != v.len()
            {
                let quaternion = &mut q[own.start + 3..own.end];
                let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                changed |= (norm - 1.0).abs() > f64::EPSILON;
                quaternion.iter_mut().for_each(|x| *x /= norm);
            }
        }
        changed
    }

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

/// What a witness watches.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Watch {
    Gap(usize),
    /// The contact would have to pull.
    NormalForce,
    /// Slip comes to rest.
    SlipStops,
    /// Friction no longer holds.
    Cone,
}

impl Motion<'_> {
    fn split<'y>(&self, y: &'y [f64]) -> (&'y [f64], &'y [f64]) {
        y.split_at(self.sim.chain.nq())
    }

    fn energy(&mut self, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let mut kin = self.workspace.update(&self.sim.chain, q)?;
        Ok(kin.kinetic_energy(qd)? + kin.potential_energy(self.sim.gravity))
    }

    /// q̈ without contact force.
    fn free_acceleration(
        sim: &Simulation,
        kin: &mut Kinematics<Spatial<f64>>,
        q: &[f64],
        qd: &[f64],
    ) -> Result<DVector<f64>, SimError> {
        let mut tau = match &sim.drive {
            Drive::Off => vec![0.0; qd.len()],
            Drive::Constant(tau) => tau.clone(),
            Drive::Pd { kp, kd, target } => (0..qd.len()).map(|i| kp * (target[i] - q[i]) - kd * qd[i]).collect(),
            Drive::GravityCompensation => kin.gravity_force(sim.gravity).as_slice().to_vec(),
        };
        for joint in sim.chain.joints() {
            if let Coordinates::Own { v, .. } = &joint.coordinates {
                for i in v.clone() {
                    tau[i] -= joint.damping * qd[i];
                }
            }
        }
        Ok(kin.forward_dynamics(qd, &tau, sim.gravity)?)
    }

    /// Gap, its rate and the touching point's velocity at one state.
    fn closing(&mut self, touch: usize, q: &[f64], qd: &[f64]) -> Result<(f64, f64, Vector3<f64>), SimError> {
        let sim = self.sim;
        let kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let rate = sim.touches[touch].gap_rate(&at, &kin, qd)?;
        let u = match at.surface {
            Some((point, _)) => kin.point_velocity(point, qd)?,
            None => Vector3::zeros(),
        };
        Ok((at.gap, rate, u))
    }

    /// dġ/dt and du/dt while no joint accelerates: what curvature of paths and surfaces does. Central differences of
    /// fourth order along the motion; with steps of 1e-3 of the joints' own time their error is about 1e-12 of the terms.
    fn drift(&mut self, touch: usize, q: &[f64], qd: &[f64]) -> Result<(f64, Vector3<f64>), SimError> {
        let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        if speed == 0.0 {
            return Ok((0.0, Vector3::zeros()));
        }
        let h = 1e-3 / speed.max(1e-3);
        let (mut rate, mut u) = (0.0, Vector3::zeros());
        let mut unit = q.to_vec();
        self.sim.normalise(&mut unit);
        for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved = self.sim.chain.integrate(&unit, qd, steps * h)?;
            let (_, rate_there, u_there) = self.closing(touch, &moved, qd)?;
            rate += weight * rate_there;
            u += u_there * weight;
        }
        Ok((rate / (12.0 * h), u / (12.0 * h)))
    }

    /// The acceleration of the gap in free motion.
    fn gap_free(&mut self, touch: usize, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let (drift, _) = self.drift(touch, q, qd)?;
        let sim = self.sim;
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let qdd = Self::free_acceleration(sim, &mut kin, q, qd)?;
        let at = sim.touches[touch].at(&kin, q);
        Ok(sim.touches[touch].normal_row(&at, &kin)?.dot(&qdd) + drift)
    }

    /// A lasting contact's force and acceleration.
    fn held(&mut self, time: f64, y: &[f64], touch: usize, sticking: bool) -> Result<Held, SimError> {
        let (q, qd) = self.split(y);
        let (gap_drift, u_drift) = self.drift(touch, q, qd)?;
        let (sim, slip) = (self.sim, self.slip);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let qdd = Self::free_acceleration(sim, &mut kin, q, qd)?;
        let at = sim.touches[touch].at(&kin, q);
        let Some((j, (_, n))) = sim.touches[touch].jacobian(&at, &kin).zip(at.surface) else {
            let row = sim.touches[touch].normal_row(&at, &kin)?;
            let response = kin.solve(row.as_slice())?;
            let force = -(row.dot(&qdd) + gap_drift) / row.dot(&response);
            let normal = Vector3::zeros();
            return Ok(Held { qdd: qdd + response * force, force: normal, normal, normal_force: force });
        };
        let response = responses(&mut kin, &j)?;
        let h = Matrix3::from_fn(|a, b| j.row(a).dot(&response.column(b).transpose()));
        let mu = sim.contact.friction;
        let force = if sticking {
            let u_free = Vector3::from_iterator((&j * &qdd).iter().copied()) + u_drift;
            -(pseudo_inverse(h) * u_free)
        } else {
            let u = Vector3::from_iterator((&j * DVector::from_column_slice(qd)).iter().copied());
            let d = direction_of_slip(u, n, qd).unwrap_or(slip) * if mu > 0.0 { 1.0 } else { 0.0 };
            let c = n.dot(&(h * n));
            let inverse_mass = c - mu * n.dot(&(h * d));
            if inverse_mass <= c * 1e-12 {
                return Err(SimError::Jam { time, touch: sim.touches[touch].name.clone(), friction: mu });
            }
            let gap_free = n.dot(&Vector3::from_iterator((&j * &qdd).iter().copied())) + gap_drift;
            (n - d * mu) * (-gap_free / inverse_mass)
        };
        Ok(Held { qdd: qdd + &response * force, force, normal: n, normal_force: n.dot(&force) })
    }

    fn watches(&self) -> Vec<Watch> {
        let asleep = self.asleep.map(|(touch, _)| touch);
        let gaps = (0..self.sim.touches.len()).filter(|&k| Some(k) != self.mode.touch() && Some(k) != asleep);
        let mut watches: Vec<Watch> = gaps.map(Watch::Gap).collect();
        match self.mode {
            ContactMode::Free => {}
            ContactMode::Sliding { .. } if self.sim.contact.friction == 0.0 => watches.push(Watch::NormalForce),
            ContactMode::Sliding { .. } => watches.extend([Watch::NormalForce, Watch::SlipStops]),
            ContactMode::Sticking { .. } => watches.extend([Watch::NormalForce, Watch::Cone]),
        }
        watches
    }

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

    /// Slip begins against the friction that would be needed to hold.
    fn slide_off(&mut self, held: &Held) {
        let tangential = held.force - held.normal * held.normal_force;
        self.slip = -tangential.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
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
                let law = law.unwrap_or_else(|| unreachable!("the law's name is one of LAW_NAMES"));
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

    fn lasting_mode(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<ContactMode, SimError> {
        let (q, qd) = self.split(y);
        let (_, _, u) = self.closing(touch, q, qd)?;
        let mu = self.sim.contact.friction;
        let surface = matches!(self.sim.touches[touch].kind, TouchKind::Surface { .. });
        if mu == 0.0 || !surface {
            return Ok(ContactMode::Sliding { touch });
        }
        let held = self.held(time, y, touch, true)?;
        if let Some(direction) = direction_of_slip(u, held.normal, qd) {
            self.slip = direction;
            return Ok(ContactMode::Sliding { touch });
        }
        let tangential = held.force - held.normal * held.normal_force;
        if tangential.norm() <= mu * held.normal_force {
            return Ok(ContactMode::Sticking { touch });
        }
        self.slide_off(&held);
        Ok(ContactMode::Sliding { touch })
    }

    /// Goes through `span` seconds of lasting contact at once, to second order: the span is below the Zeno time.
    fn pass(&mut self, touch: usize, span: f64, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let mode = self.lasting_mode(touch, time, y)?;
        let held = self.held(time, y, touch, matches!(mode, ContactMode::Sticking { .. }))?;
        let nq = self.sim.chain.nq();
        let (q, qd) = self.split(y);
        let mean: Vec<f64> = qd.iter().zip(held.qdd.iter()).map(|(v, a)| v + a * span / 2.0).collect();
        let moved = self.sim.chain.integrate(q, &mean, span)?;
        y[..nq].copy_from_slice(&moved);
        for (v, a) in y[nq..].iter_mut().zip(held.qdd.iter()) {
            *v += a * span;
        }
        Ok(())
    }

    /// Takes the normal velocity out by a normal impulse, and the gap by a step along its response.
    fn stop_normal(&mut self, touch: usize, y: &mut [f64]) -> Result<bool, SimError> {
        let sim = self.sim;
        let nq = sim.chain.nq();
        let (q, qd) = y.split_at(nq);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let row = sim.touches[touch].normal_row(&at, &kin)?;
        let rate = sim.touches[touch].gap_rate(&at, &kin, qd)?;
        let response = kin.solve(row.as_slice())?;
        let inverse_mass = row.dot(&response);
        let back: Vec<f64> = response.iter().map(|x| -x * at.gap / inverse_mass).collect();
        let moved = sim.chain.integrate(q, &back, 1.0)?;
        let changed = at.gap != 0.0 || rate != 0.0;
        y[..nq].copy_from_slice(&moved);
        for (v, x) in y[nq..].iter_mut().zip(response.iter()) {
            *v -= x * rate / inverse_mass;
        }
        Ok(changed)
    }

    /// Takes all velocity of the touching point out.
    fn stop_slip(&mut self, touch: usize, y: &mut [f64]) -> Result<(), SimError> {
        let sim = self.sim;
        let nq = sim.chain.nq();
        let (q, qd) = y.split_at(nq);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let Some(j) = sim.touches[touch].jacobian(&at, &kin) else { return Ok(()) };
        let response = responses(&mut kin, &j)?;
        let h = Matrix3::from_fn(|a, b| j.row(a).dot(&response.column(b).transpose()));
        let u = Vector3::from_iterator((&j * DVector::from_column_slice(qd)).iter().copied());
        let jump = &response * (pseudo_inverse(h) * u);
        for (v, x) in y[nq..].iter_mut().zip(jump.iter()) {
            *v -= x;
        }
        Ok(())
    }
}

/// Gaps this small at the start count as touching, m.
const TOUCHING: f64 = 1e-9;
/// A contact that opens without a velocity may not fire again for this long, s.
const BAND: f64 = 1e-4;

/// M⁻¹Jᵀ.
fn responses(kin: &mut Kinematics<Spatial<f64>>, j: &DMatrix<f64>) -> Result<DMatrix<f64>, SimError> {
    let mut response = DMatrix::zeros(j.ncols(), 3);
    for k in 0..3 {
        let row: Vec<f64> = j.row(k).iter().copied().collect();
        response.set_column(k, &kin.solve(&row)?);
    }
    Ok(response)
}

/// H⁺: a planar arm moves its tip in two directions only.
fn pseudo_inverse(h: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = h.symmetric_eigen();
    let least = eigen.eigenvalues.max() * 1e-12;
    let inverse = eigen.eigenvalues.map(|x| if x > least { 1.0 / x } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Unit direction of the tangential part of u; `None` if that is still.
fn direction_of_slip(u: Vector3<f64>, n: Vector3<f64>, qd: &[f64]) -> Option<Vector3<f64>> {
    let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (u - n * n.dot(&u)).try_normalize(STILL * speed)
}

impl Flow for Motion<'_> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (sim, (q, qd)) = (self.sim, self.split(y));
        let qdd = match self.mode {
            ContactMode::Free => {
                let mut kin = self.workspace.update(&sim.chain, q)?;
                Self::free_acceleration(sim, &mut kin, q, qd)?
            }
            ContactMode::Sliding { touch } => self.held(time, y, touch, false)?.qdd,
            ContactMode::Sticking { touch } => self.held(time, y, touch, true)?.qdd,
        };
        let (q_rate, qd_rate) = out.split_at_mut(sim.chain.nq());
        sim.chain.q_rate_into(q, qd, q_rate);
        qd_rate.copy_from_slice(qdd.as_slice());
        Ok(())
    }

    fn witnesses(&mut self, time: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError> {
        out.clear();
        let (q, qd) = self.split(y);
        let held = match self.mode {
            ContactMode::Free => None,
            ContactMode::Sliding { touch } => Some((touch, self.held(time, y, touch, false)?)),
            ContactMode::Sticking { touch } => Some((touch, self.held(time, y, touch, true)?)),
        };
        for watch in self.watches() {
            let witness = match (watch, &held) {
                (Watch::Gap(touch), _) => {
                    let (gap, rate, _) = self.closing(touch, q, qd)?;
                    Witness { value: gap, rate: Some(rate) }
                }
                (Watch::NormalForce, Some((_, held))) => Witness { value: held.normal_force, rate: None },
                (Watch::SlipStops, Some((touch, _))) => {
                    let (_, _, u) = self.closing(*touch, q, qd)?;
                    Witness { value: u.dot(&self.slip), rate: None }
                }
                (Watch::Cone, Some((_, held))) => {
                    let tangential = held.force - held.normal * held.normal_force;
                    let value = self.sim.contact.friction * held.normal_force - tangential.norm();
                    Witness { value, rate: None }
                }
                (_, None) => Witness { value: 1.0, rate: None },
            };
            out.push(witness);
        }
        Ok(())
    }

    fn settle(&mut self, _: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let changed = self.sim.normalise(y);
        match self.mode {
            ContactMode::Free => Ok(changed),
            ContactMode::Sliding { touch } => Ok(self.stop_normal(touch, y)? || changed),
            ContactMode::Sticking { touch } => {
                let moved = self.stop_normal(touch, y)?;
                self.stop_slip(touch, y)?;
                Ok(moved || changed)
            }
        }
    }
}

//! The event loop: smooth legs of motion, and exact events between them.
//!
//! **One contact at a time.** In the mode `free` there is no contact and every closing gap is an event. The law computes
//! the impact. The next mode follows from the state after it, with the separation velocity u⁺, r = u⁺/|u⁻| and the
//! acceleration a towards the surface in free motion:
//!
//! - u⁺ > 0 and no accumulation: free motion.
//! - a > 0, r < 1 and remaining time 2u⁺/(a(1−r)) below [`Simulation::zeno_time`]: the infinitely many impacts within that
//!   time are replaced by their limit (`zeno`), after which the contact lasts. For a pendulum that hits a wall at its lowest
//!   point a = 0: its impacts never accumulate, and all are computed.
//! - u⁺ = 0 (r = 0) and a > 0: the contact lasts.
//!
//! A lasting contact slides or sticks under the constraint force with g̈ = 0 (and u̇ = 0 if it sticks). It opens when the
//! normal force becomes negative, begins to slide when the force leaves the friction cone, and may stick when the slip
//! velocity becomes zero. A latch never opens. A compliant contact has no impact but a force, from the time at which its gap
//! closes until it opens.
//!
//! **Several contacts** at the same time are computed in `several.rs`: their impact is one problem for all of them. If at
//! most one contact lasts after it, the run continues event-driven; otherwise by time steps until all contacts are open.

use super::leg::{Accuracy, LegEnd, Sampler, leg};
use super::trajectory::{Blow, EnergyBooks, Event, EventKind, Sampling, Seen, Statistics, StopReason, Summary};
use super::watch::{Watch, Watched};
use crate::contact::{Compliance, ContactMode, friction_bound};
use crate::error::SimError;
use crate::impact::ChainImpact;
use crate::model::{Integrator, Simulation};
use crate::motion::{Dry, Motion};
use crate::state::{Moment, Space};
use carom_chain::algebra::z_onto;
use carom_impact::{Frictionless, ImpactProblem, Law};

/// The state of a run.
pub(crate) struct Run<'a, 'w, A: Space> {
    pub motion: Motion<'a, A>,
    pub time: f64,
    pub y: Vec<f64>,
    pub end: f64,
    pub sampler: Sampler<'w>,
    pub events: usize,
    pub statistics: Statistics,
    pub lost: f64,
    /// Times of the last events, to detect too many within a short time.
    pub recent: std::collections::VecDeque<f64>,
}

impl<'a, 'w, A: Space> Run<'a, 'w, A> {
    pub fn go(
        sim: &'a Simulation,
        model: &'a A::Model,
        (q, qd): (&[f64], &[f64]),
        end: f64,
        sampling: Sampling,
        watch: &'w mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        let sizes = (sim.chain.nq(), sim.chain.nv());
        let bristles = sim.touches.iter().any(|touch| touch.contact.compliance.is_some_and(|it| it.has_bristle()));
        let mut run = Self {
            motion: Motion::new(sim, model),
            time: 0.0,
            y: [q, qd, &[0.0, 0.0], if bristles { &[0.0; 3] } else { &[] }].concat(),
            end,
            sampler: Sampler { sampling, sizes, count: 0, until: 0.0, watch },
            events: 0,
            statistics: Statistics::default(),
            lost: 0.0,
            recent: std::collections::VecDeque::new(),
        };
        let start = run.motion.energy(&run.y)?;
        run.begin()?;
        let mut stop = StopReason::Duration;
        while run.time < end {
            if run.events >= sim.max_events {
                stop = StopReason::Events;
                break;
            }
            if run.motion.mode == ContactMode::Several {
                run.several_contacts()?;
            } else {
                run.one_leg()?;
            }
        }
        let energy = run.motion.energy(&run.y)?;
        let (nq, nv) = sizes;
        Ok(Summary {
            last: Moment { time: run.time, q: run.y[..nq].to_vec(), qd: run.y[nq..nq + nv].to_vec() },
            mode: run.motion.mode,
            stop,
            events: run.events,
            statistics: run.statistics,
            energy: EnergyBooks {
                start,
                end: energy,
                drive: run.y[nq + nv],
                resistance: run.y[nq + nv + 1],
                impacts: run.lost,
            },
        })
    }

    fn one_leg(&mut self) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let Simulation { tolerance, max_step, integrator, .. } = *sim;
        let gives_up = self.motion.mode.touch().is_some();
        let presses = matches!(self.motion.mode, ContactMode::Pressing { .. });
        let accuracy = Accuracy { tolerance, max_step, integrator, gives_up };
        let kinks = [Some(&sim.drive), sim.after_impact.as_ref()].into_iter().flatten();
        let kink = kinks.filter_map(|drive| drive.next_kink(self.time)).fold(f64::INFINITY, f64::min);
        let until = kink.min(self.end);
        if until - self.time <= 1e-13 * (1.0 + until) {
            self.time = until; // shorter than any integration step
            return Ok(());
        }
        let mut flow = Watched::new(&mut self.motion);
        let (statistics, sampler) = (&mut self.statistics, &mut self.sampler);
        let mut ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        if presses && matches!(ended, Err(SimError::Integration { .. })) {
            // A stiff compliant contact: repeat with the implicit integrator.
            let accuracy = Accuracy { integrator: Integrator::Radau, gives_up: false, ..accuracy };
            ended = leg(&mut flow, self.time, &self.y, until, accuracy, statistics, sampler);
        }
        let watches = flow.watches;
        match ended {
            Ok(LegEnd { time, y, fired }) => {
                (self.time, self.y) = (time, y);
                fired.map_or(Ok(()), |witness| self.event(watches[witness]))
            }
            // Rigid sliding has no consistent acceleration, or the direction of slip turns ever faster as the slip goes to
            // zero. Time steps have a solution in both cases.
            Err(SimError::Jam { .. }) => self.enter(ContactMode::Several),
            Err(SimError::Integration { .. }) if gives_up => self.enter(ContactMode::Several),
            Err(error) => Err(error),
        }
    }

    pub fn q_qd(&self) -> (Vec<f64>, Vec<f64>) {
        let (q, qd) = self.motion.split(&self.y);
        (q.to_vec(), qd.to_vec())
    }

    /// Gap and gap rate of a touch now.
    pub fn gap(&mut self, touch: usize) -> Result<(f64, f64), SimError> {
        let (q, qd) = self.q_qd();
        self.motion.gap(touch, &q, &qd, self.time)
    }

    /// Gaps and gap rates of all touches now.
    pub fn gaps(&mut self) -> Result<Vec<(f64, f64)>, SimError> {
        let (q, qd) = self.q_qd();
        self.motion.gaps(&q, &qd, self.time)
    }

    /// The contacts and the mode at the start.
    fn begin(&mut self) -> Result<(), SimError> {
        let sim = self.motion.sim;
        let (mut hits, mut rests, mut sunk) = (Vec::new(), Vec::new(), Vec::new());
        for (touch, (gap, rate)) in self.gaps()?.into_iter().enumerate() {
            let gives_way = sim.touches[touch].contact.compliance.is_some() && sim.touches[touch].link().is_some();
            if gap < -TOUCHING {
                if gives_way {
                    sunk.push((touch, -rate, -gap));
                    continue;
                }
                return Err(SimError::Overlap { touch: sim.touches[touch].name.clone(), depth: -gap });
            }
            if gap <= TOUCHING {
                if rate < 0.0 { hits.push(touch) } else { rests.push((touch, rate)) }
            }
        }
        // Touches with zero gap and no load are open.
        let mut pressed = Vec::new();
        for (touch, rate) in rests {
            if !matches!(self.stays(touch, 0.0, rate)?, Stays::No) {
                pressed.push((touch, rate));
            }
        }
        let rests = pressed;
        // A compliant contact may start with a penetration.
        if let Some(&(touch, approach, depth)) = sunk.first() {
            if sunk.len() + hits.len() + rests.len() > 1 {
                return Err(SimError::Overlap { touch: sim.touches[touch].name.clone(), depth });
            }
            let rule = &sim.touches[touch].contact;
            let (q, _) = self.q_qd();
            let mass = self.motion.effective_mass(touch, &q, self.time)?;
            let speed = approach.max(Compliance::SLOWEST);
            let damping = rule
                .compliance
                .map_or(Ok(0.0), |it| Ok::<_, SimError>(it.normal(rule.law.restitution())?.damping(speed, mass)))?;
            return self.press(touch, damping);
        }
        if sim.stepping {
            return self.enter(ContactMode::Several);
        }
        let points = |touches: &[usize]| touches.iter().all(|&k| sim.touches[k].is_point());
        match (hits.len(), rests.len()) {
            (0, 0) => self.motion.settle_joints(self.time, &mut self.y),
            (1, 0) if points(&hits) => self.impact(hits[0]),
            (0, 1) if points(&[rests[0].0]) => self.leave(rests[0].0, 0.0, rests[0].1),
            _ => self.enter(ContactMode::Several),
        }
    }

    fn event(&mut self, watch: Watch) -> Result<(), SimError> {
        let time = self.time;
        match (watch, self.motion.mode.touch()) {
            (Watch::Gap(touch), _) => self.touch(touch),
            (Watch::NormalForce | Watch::Depth, Some(touch)) => {
                self.motion.mode = ContactMode::Free;
                let y = self.y.clone();
                self.note(EventKind::LiftOff { touch }, &y, Vec::new());
                self.motion.settle_joints(time, &mut self.y)
            }
            (Watch::Turns, Some(touch)) => {
                let (gap, _) = self.gap(touch)?;
                self.motion.deepest = self.motion.deepest.max(-gap);
                Ok(())
            }
            (Watch::SlipStops, Some(touch)) => {
                let before = self.y.clone();
                if self.motion.follow_slip(touch, time, &before)? > TURNED {
                    return Ok(()); // the direction of slip has turned by 90°
                }
                self.motion.stop_slip(touch, time, &mut self.y)?;
                self.last(touch, &before)
            }
            (Watch::Cone, Some(touch)) => {
                let held = self.motion.in_mode(time, &self.y)?;
                self.motion.slide_off(&held);
                self.enter(ContactMode::Sliding { touch })
            }
            (Watch::JointStops(k) | Watch::JointBreaksLoose(k), _) => {
                let (before, nq) = (self.y.clone(), self.motion.sim.chain.nq());
                let v = self.motion.dry[k].v;
                if self.motion.dry[k].state != Dry::Holds {
                    self.y[nq + v] = 0.0;
                }
                if self.motion.dry[k].state == Dry::Holds {
                    // It begins to slip in the direction of the load.
                    let held = self.motion.in_mode(time, &self.y)?;
                    self.motion.dry[k].state = Dry::Brakes(-held.joints[k].signum());
                } else {
                    self.motion.settle_joints(time, &mut self.y)?;
                }
                let holds = self.motion.dry[k].state == Dry::Holds;
                let joint =
                    self.motion.sim.chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
                self.note(EventKind::Joint { joint, holds }, &before, Vec::new());
                Ok(())
            }
            (_, None) => Ok(()),
        }
    }

    /// Outputs an event that led from `before` to the present state.
    pub fn note(&mut self, kind: EventKind, before: &[f64], blows: Vec<Blow>) {
        let (q, qd_plus) = self.q_qd();
        let qd_minus = self.motion.split(before).1.to_vec();
        (self.sampler.watch)(Seen::Event(&Event { time: self.time, kind, q, qd_minus, qd_plus, blows }));
        self.events += 1;
        self.recent.push_back(self.time);
        if self.recent.len() > CROWD {
            self.recent.pop_front();
        }
    }

    pub fn enter(&mut self, mode: ContactMode) -> Result<(), SimError> {
        self.motion.mode = mode;
        let y = self.y.clone();
        self.note(EventKind::Mode { mode }, &y, Vec::new());
        if mode == ContactMode::Several { Ok(()) } else { self.motion.settle_joints(self.time, &mut self.y) }
    }

    /// A touch has closed, alone or together with others.
    fn touch(&mut self, touch: usize) -> Result<(), SimError> {
        let mut together = vec![touch];
        for (other, (gap, rate)) in self.gaps()?.into_iter().enumerate() {
            let free = other != touch && Some(other) != self.motion.mode.touch();
            if free && gap <= TOUCHING && rate <= 0.0 {
                together.push(other);
            }
        }
        together.extend(self.motion.mode.touch());
        let crowd = self.recent.len() == CROWD && self.time - self.recent[0] < self.motion.sim.contact_step;
        if crowd {
            return self.enter(ContactMode::Several);
        }
        if together.len() > 1 { self.several_impacts(&together) } else { self.impact(touch) }
    }

    /// The impact of a single touch.
    fn impact(&mut self, touch: usize) -> Result<(), SimError> {
        let before = self.y.clone();
        let (q, qd) = self.q_qd();
        let (sim, time) = (self.motion.sim, self.time);
        let (_, approach, u) = self.motion.closing(touch, &q, &qd, time)?;
        let energy = self.motion.energy(&before)?;
        let nq = sim.chain.nq();
        let one = &sim.touches[touch];
        if let (Some(compliance), Some(_)) = (one.contact.compliance, one.link()) {
            let speed = (-approach).max(Compliance::SLOWEST);
            let law = compliance.normal(one.contact.law.restitution())?;
            let mass = self.motion.effective_mass(touch, &q, time)?;
            let depth = law.greatest_penetration(speed, mass);
            if sim.neglect.is_none_or(|share| depth > share * self.motion.reach) {
                self.motion.count_impact(touch);
                return self.press(touch, law.damping(speed, mass));
            }
            self.statistics.neglected_depth = self.statistics.neglected_depth.max(depth);
        }
        if one.contact.latch {
            self.latch(touch)?;
            self.lost += energy - self.motion.energy(&self.y)?;
            return self.last(touch, &before);
        }
        let mut view = self.motion.view(&q)?;
        let at = one.at(&view, &q, time);
        let (kind, qd_plus, blows) = match (at.surface, one.limit_of()) {
            (Some(place), _) => {
                let given = &one.contact.law;
                let (restitution, friction) = (given.restitution(), given.friction());
                let Some((delassus, response)) = place.inertia(&mut view)? else {
                    let link = one.link().unwrap_or_default().to_owned();
                    return Err(SimError::SingularNormal { link, normal: place.normal.into() });
                };
                let axes = z_onto(place.normal);
                let problem = ImpactProblem::new(axes.transpose() * delassus * axes, axes.transpose() * u)?;
                let bound = friction_bound(&delassus, &place.normal, -approach, restitution, friction) / u.norm();
                let plain = Frictionless { restitution };
                let mut law: &dyn Law<f64, 3> = &**given;
                // The bound holds for the laws of `carom-impact`.
                if friction > 0.0 && !given.is_users() && sim.neglect.is_some_and(|share| bound <= share) {
                    law = &plain;
                    self.statistics.neglected += 1;
                    self.statistics.neglected_bound = self.statistics.neglected_bound.max(bound);
                }
                let mut hit = Box::new(ChainImpact::empty(qd.len()));
                let rows: Vec<_> = response.row_iter().map(|row| row.transpose()).collect();
                hit.carry(law.resolve(&problem)?, &axes, rows.iter(), &qd);
                hit.energy_before = view.kin.kinetic_energy(&qd)?;
                hit.energy_after = view.kin.kinetic_energy(&hit.qd_plus)?;
                let (qd_plus, impulse) = (hit.qd_plus.clone(), hit.impulse);
                (EventKind::Impact { touch, hit }, qd_plus, vec![Blow { touch, point: place.position, impulse }])
            }
            (None, joint) => {
                let row = one.row(&at, &view)?;
                let response = view.kin.solve(row.as_slice())?;
                let impulse = -(1.0 + one.contact.law.restitution()) * approach / row.dot(&response);
                let qd_plus = qd.iter().zip(response.iter()).map(|(v, x)| v + x * impulse).collect();
                (EventKind::Limit { touch, joint: joint.unwrap_or_default().to_owned(), impulse }, qd_plus, Vec::new())
            }
        };
        self.y[nq..nq + qd.len()].copy_from_slice(&qd_plus);
        self.motion.count_impact(touch);
        self.note(kind, &before, blows);
        self.lost += energy - self.motion.energy(&self.y)?;
        let (_, rebound) = self.gap(touch)?;
        self.leave(touch, approach, rebound)
    }

    /// The beginning of a compliant contact.
    fn press(&mut self, touch: usize, damping: f64) -> Result<(), SimError> {
        let sim = self.motion.sim;
        self.motion.deepest = f64::NEG_INFINITY;
        self.y[sim.chain.nq() + sim.chain.nv() + 2..].fill(0.0); // no deflection of the bristle
        self.enter(ContactMode::Pressing { touch, damping })
    }

    /// The impact at a latch: the velocity of the contact point relative to the surface becomes zero.
    fn latch(&mut self, touch: usize) -> Result<(), SimError> {
        let before = self.y.clone();
        self.motion.stop_normal(touch, self.time, &mut self.y)?;
        self.motion.stop_slip(touch, self.time, &mut self.y)?;
        self.motion.count_impact(touch);
        self.note(EventKind::Latch { touch }, &before, Vec::new());
        Ok(())
    }

    /// Whether a contact with the separation velocity `rebound` lasts: at once, or after infinitely many impacts within the
    /// returned time.
    pub fn stays(&mut self, touch: usize, approach: f64, rebound: f64) -> Result<Stays, SimError> {
        let toward = -self.motion.gap_acceleration(touch, self.time, &self.y)?;
        let share = if approach < 0.0 { rebound / -approach } else { 0.0 };
        // Rebound velocities below the rounding of the approach velocity count as zero.
        let rests = rebound <= 1e-14 * approach.abs();
        let left = 2.0 * rebound / (toward * (1.0 - share));
        if toward > 0.0 && rests {
            return Ok(Stays::Rests);
        }
        if toward > 0.0 && share < 1.0 && left < self.motion.sim.zeno_time {
            return Ok(Stays::Zeno(left));
        }
        Ok(Stays::No)
    }

    /// The next mode of a contact with the separation velocity `rebound`.
    fn leave(&mut self, touch: usize, approach: f64, rebound: f64) -> Result<(), SimError> {
        self.motion.mode = ContactMode::Free;
        self.motion.settle_joints(self.time, &mut self.y)?;
        match self.stays(touch, approach, rebound)? {
            Stays::No => Ok(()),
            Stays::Rests => {
                let before = self.y.clone();
                self.motion.stop_normal(touch, self.time, &mut self.y)?;
                self.last(touch, &before)
            }
            Stays::Zeno(left) => {
                let before = self.y.clone();
                let energy = self.motion.energy(&before)?;
                self.motion.stop_normal(touch, self.time, &mut self.y)?;
                self.motion.pass(touch, left, self.time, &mut self.y)?;
                self.lost += energy - self.motion.energy(&self.y)?;
                let (start, y) = (self.time, self.y.clone());
                self.time += left;
                self.sampler.stretch(start, self.time, 2, |_| y.clone());
                self.note(EventKind::Zeno { touch, impacts: self.motion.impacts(touch) }, &before, Vec::new());
                self.last(touch, &before)
            }
        }
    }

    /// A lasting contact begins: decides whether it sticks or slides.
    pub fn last(&mut self, touch: usize, before: &[f64]) -> Result<(), SimError> {
        if !self.motion.sim.touches[touch].is_point() {
            return self.enter(ContactMode::Several);
        }
        let mode = match self.motion.lasting_mode(touch, self.time, &self.y) {
            Err(SimError::Jam { .. }) => ContactMode::Several,
            mode => mode?,
        };
        self.motion.mode = mode;
        self.note(EventKind::Mode { mode }, before, Vec::new());
        if mode == ContactMode::Several { Ok(()) } else { self.motion.settle_joints(self.time, &mut self.y) }
    }
}

/// The next state of a contact after an impact.
pub(crate) enum Stays {
    Rests,
    /// It lasts after this time, s.
    Zeno(f64),
    No,
}

/// Gaps up to this size count as closed when another contact closes, m.
pub(crate) const TOUCHING: f64 = 1e-9;
/// Slip above this share of the largest joint velocity has not stopped.
const TURNED: f64 = 1e-5;
/// With this number of events within one contact step the run continues by time stepping.
const CROWD: usize = 100;

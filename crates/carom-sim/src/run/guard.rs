//! The guards of a contact mode: functions of the state whose zeros end the mode. All that is known of each kind is in this file: which
//! modes have it ([`Guard::of_mode`]), what else it is ([`Guard::is_gap`], …), its value ([`Guard::at`]), and what follows its zero
//! ([`Run::guard_fired`]).

use super::history::Class;
use super::leap::least;
use super::run_state::Run;
use super::trajectory::{EventKind, StepReason};
use crate::contact::{Grip, Passing, Placed, Slack};
use crate::error::SimError;
use crate::model::Simulation;
use crate::motion::{
    ActiveSet, ConstraintForces, Dry, DryJoint, Gaps, Hold, Lasting, Motion, Scale, Start, deflection,
};
use crate::state::{EQUAL, Space, View};
use carom_contact::Met;
use nalgebra::Vector3;

/// The guards; those of lasting contacts have their index into the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Guard {
    /// The gap of a touch closes.
    Gap(usize),
    /// The gap of a pair of bodies closes, or of those of its parts that do not last (index of the group).
    Pair(usize),
    /// The contact point reaches the border of a face or the end of an edge.
    Leaves(usize),
    /// The normal force becomes negative.
    NormalForce(usize),
    /// The slip velocity becomes zero.
    SlipStops(usize),
    /// A slip that turns ends soon: see `motion/ending.rs`.
    SlipEnds,
    /// Slip from rest is so fast that its direction follows from it.
    SlipGrows(usize),
    /// The contact force leaves the friction cone.
    Cone(usize),
    /// A compliant contact opens.
    Depth(usize),
    /// A compliant contact changes from loading to unloading, or one that was unloaded, and loaded again, becomes deeper than before.
    Turns(usize),
    /// The normal force of a compliant contact that is not open vanishes, or (`true`) it begins again: it has a kink there.
    Slackens(usize, bool),
    /// The slider of the bristle of a compliant contact begins to slip, or ceases to slip in this direction (a unit vector, world): friction
    /// has a kink there.
    Slider(usize, Option<Vector3<f64>>),
    /// A joint with dry friction comes to rest (index into `dry`).
    JointStops(usize),
    /// The load of a joint exceeds its dry friction (index into `dry`).
    JointBreaksLoose(usize),
    /// No admissible forces of redundant constraints are left. It replaces the guards that are [forces](Self::is_force) where the forces
    /// by the convention are not admissible, but others are.
    Admissible,
    /// The loops come near a pose at which the mechanism could branch.
    Branches,
    /// A touch begins to be one that may close, or (`true`) ceases to be one.
    MayClose(usize, bool),
}

/// How a leg ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ending {
    /// At the end of the run, or at a jump of forces that changes no mode.
    Passed,
    /// A guard fired.
    Fired(Guard),
    /// At a jump or a kink of forces or surfaces, with contacts.
    Kink,
    /// The mode cannot be continued.
    Stuck(StepReason),
}

/// The value of a guard.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct GuardValue {
    pub value: f64,
    pub rate: Option<f64>,
    /// Of a gap of two bodies: how they move past each other.
    pub passing: Option<Passing>,
    /// Hysteresis: values up to this count as zero. `None`: a guard that is never armed before it is positive, such as a force.
    pub band: Option<f64>,
    /// Whether it is a gap.
    pub is_gap: bool,
    /// Whether it may fall below zero and recover within a step.
    pub dips: bool,
}

impl GuardValue {
    /// A gap and its rate, with its rounding: above that of positions, below the height of any bounce that is resolved.
    pub fn gap((value, rate): (f64, f64), band: f64) -> Self {
        Self { value, rate: Some(rate), band: Some(band), is_gap: true, ..Self::default() }
    }

    /// A velocity with this resolution.
    pub fn velocity(value: f64, band: f64) -> Self {
        Self { value, band: Some(band), ..Self::default() }
    }

    /// The margin of a force.
    pub fn margin(value: f64) -> Self {
        Self { value, dips: true, ..Self::default() }
    }

    /// A quantity that matters only where it stays below zero.
    pub fn bound(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    /// The value above which it is armed.
    pub fn least(&self) -> f64 {
        self.band.unwrap_or(0.0)
    }
}

impl Guard {
    /// The guards of the present mode.
    ///
    /// # Errors
    /// A state at which a gap cannot be computed.
    pub fn of_mode<A: Space>(motion: &mut Motion<A>, (time, y): (f64, &[f64])) -> Result<Vec<Self>, SimError> {
        let sim = motion.sim;
        let [single, groups] = motion.gaps.to_watch(&motion.active.lasting, (y, motion.scale.pace));
        let mut guards: Vec<Self> = single.into_iter().map(Self::Gap).collect();
        guards.extend(groups.into_iter().map(Self::Pair));
        for i in 0..motion.active.lasting.len() {
            guards.extend(motion.has_vanished(i, (time, y))?.map(|vanished| Self::Slackens(i, vanished)));
            guards.extend(motion.slider(i, (time, y))?.map(|slips| Self::Slider(i, slips)));
            let own = motion.active.lasting[i];
            let touch = &sim.touches[own.touch];
            if touch.ends() {
                guards.push(Self::Leaves(i));
            }
            match own.hold {
                Hold::Latched => {}
                Hold::Slides { .. } => {
                    guards.push(Self::NormalForce(i));
                    if touch.contact.law.friction() > 0.0 && touch.link().is_some() {
                        guards.push(Self::SlipStops(i));
                    }
                }
                Hold::Starts { .. } => {
                    guards.extend([Self::NormalForce(i), Self::SlipStops(i), Self::SlipGrows(i)]);
                }
                Hold::Sticks => guards.extend([Self::NormalForce(i), Self::Cone(i)]),
                Hold::Presses { .. } => {
                    guards.push(Self::Depth(i));
                    if touch.contact.compliance.is_some_and(|it| it.turns()) {
                        guards.push(Self::Turns(i));
                    }
                }
            }
        }
        guards.extend(motion.active.dry.iter().enumerate().map(|(k, joint)| match joint.state {
            Dry::Holds => Self::JointBreaksLoose(k),
            Dry::Brakes(_) => Self::JointStops(k),
        }));
        if motion.may_turn() {
            guards.push(Self::SlipEnds);
        }
        if !motion.couplings.is_empty() {
            guards.push(Self::Branches);
        }
        let conditional = sim.touches.iter().enumerate().filter(|(_, touch)| touch.closes_while.is_some());
        guards.extend(conditional.map(|(k, touch)| Self::MayClose(k, touch.may_close(y, motion.scale.pace))));
        Ok(guards)
    }

    /// Whether it is the gap of bodies that do not touch: its zero is an impact.
    pub fn is_gap(self) -> bool {
        matches!(self, Self::Gap(_) | Self::Pair(_))
    }

    /// Whether it is the margin of a force within what it may be.
    pub fn is_force(self) -> bool {
        matches!(self, Self::NormalForce(_) | Self::Cone(_) | Self::JointBreaksLoose(_))
    }

    /// Whether it depends on constraint forces, not only on positions and velocities; that of a joint by its rate.
    pub fn needs_forces(self) -> bool {
        self.is_force() || matches!(self, Self::JointStops(_) | Self::SlipEnds)
    }

    /// Whether the forces of a mode are admissible as far as this guard sees it, at its start. On the border the convention for redundant
    /// forces decides nothing: the mode has been chosen there, perhaps with other forces. `alone`: there is a single row.
    pub fn admits<A: Space>(self, motion: &Motion<A>, held: &ConstraintForces, alone: bool) -> bool {
        match self {
            Self::NormalForce(i) if alone => held.contacts[i].normal_force >= 0.0,
            Self::NormalForce(i) => held.contacts[i].normal_force > 0.0,
            Self::Cone(i) => {
                let mu = motion.sim.touches[motion.active.lasting[i].touch].contact.law.friction();
                held.contacts[i].cone(mu) >= EQUAL * held.contacts[i].normal_force
            }
            Self::JointBreaksLoose(k) => held.joints[k].abs() <= (1.0 - EQUAL) * motion.active.dry[k].friction,
            _ => true,
        }
    }
}

/// Passes the values of guards at a state to `see`. `held`: its accelerations, if one of them needs forces.
pub(crate) fn look<A: Space>(
    motion: &mut Motion<A>,
    guards: &[Guard],
    (time, y): (f64, &[f64]),
    held: Option<&ConstraintForces>,
    mut see: impl FnMut(GuardValue),
) -> Result<(), SimError> {
    // By patterns: `==` of a guard compares directions too, which takes ten times as long.
    let watches = |which: fn(&Guard) -> bool| guards.iter().any(which);
    let slip_left = match held {
        Some(held) if watches(|guard| matches!(guard, Guard::SlipEnds)) => {
            motion.least_slip_left(&held.qdd, (time, y))?
        }
        _ => 0.0,
    };
    let admissible = if watches(|guard| matches!(guard, Guard::Admissible)) { motion.margin(time, y)? } else { 0.0 };
    let (noise, starts) = (motion.noise(), motion.starts());
    let (q, qd) = motion.split(y);
    let regular = if watches(|guard| matches!(guard, Guard::Branches)) { motion.regularity(q)? - least() } else { 0.0 };
    let tail = &y[q.len() + qd.len() + 2..];
    let bristles = (&motion.bristles[..], tail);
    let now = Now {
        bristles,
        regular,
        active: &motion.active,
        held,
        admissible,
        slip_left,
        noise,
        starts,
        scale: &motion.scale,
    };
    let view = View::new(motion.model, &mut motion.workspace, q)?;
    let mut last = None;
    for guard in guards {
        see(guard.at((motion.sim, &motion.gaps), &now, &view, (q, qd), time, &mut last)?);
    }
    Ok(())
}

/// How the bodies of each watched gap move past each other at a state; `None` for other guards and for contacts of parts.
pub(crate) fn passing<A: Space>(
    motion: &mut Motion<A>,
    guards: &[Guard],
    (time, y): (f64, &[f64]),
    out: &mut [GuardValue],
) -> Result<(), SimError> {
    let of_bodies = |guard: &Guard| match *guard {
        Guard::Gap(touch) => motion.sim.touches[touch].is_whole().then_some(touch),
        Guard::Pair(group) => Some(motion.gaps.first(group)),
        _ => None,
    };
    if guards.iter().all(|guard| of_bodies(guard).is_none()) {
        return Ok(());
    }
    let (q, qd) = motion.split(y);
    let view = View::new(motion.model, &mut motion.workspace, q)?;
    for (touch, found) in guards.iter().map(of_bodies).zip(out) {
        if let Some(touch) = touch {
            found.passing = motion.gaps.passing(touch, &view, qd, time)?;
        }
    }
    Ok(())
}

/// The inputs of the guards beside the state: see [`Motion`].
struct Now<'a> {
    /// The touches with bristles, and their deflections.
    bristles: (&'a [usize], &'a [f64]),
    /// Computed if it is watched.
    regular: f64,
    active: &'a ActiveSet,
    /// Computed if a guard needs constraint forces.
    held: Option<&'a ConstraintForces>,
    /// Computed if it is watched.
    admissible: f64,
    /// Computed if it is watched.
    slip_left: f64,
    scale: &'a Scale,
    /// Error of velocities.
    noise: f64,
    /// Until when slip begins.
    starts: Start,
}

impl Guard {
    /// Its value at a state.
    fn at<A: Space>(
        self,
        (sim, gaps): (&Simulation, &Gaps<A>),
        now: &Now,
        view: &View<A>,
        (q, qd): (&[f64], &[f64]),
        time: f64,
        last: &mut Option<(usize, Placed)>,
    ) -> Result<GuardValue, SimError> {
        let look = |touch: usize| gaps.look(touch, view, (q, qd), time);
        Ok(match (self, now.held) {
            (Self::Gap(touch), _) => {
                GuardValue::gap(gaps.own(touch, view, (q, qd), time, last)?, now.scale.hysteresis(touch))
            }
            (Self::Pair(group), _) => {
                let gap = gaps.of_group(group, &now.active.lasting, view, (q, qd), time)?;
                GuardValue::gap(gap, now.scale.rounding())
            }
            (Self::Leaves(i), _) => {
                let at = sim.touches[now.active.lasting[i].touch].at(view, q, time);
                GuardValue::velocity(at.margin, Met::OUTSIDE)
            }
            (Self::Depth(i), _) => {
                let (gap, rate) = look(now.active.lasting[i].touch)?;
                GuardValue::gap((-gap, -rate), now.scale.rounding())
            }
            (Self::Turns(i), _) => {
                let (gap, rate) = look(now.active.lasting[i].touch)?;
                match now.active.lasting[i].hold {
                    Hold::Presses { deepest, .. } if deepest.is_finite() => {
                        GuardValue::gap((deepest + gap, rate), now.scale.rounding())
                    }
                    // Where several contacts turn at one time, the others have a rate of rounding at the start of the next leg: they fire by
                    // the band.
                    _ => GuardValue::velocity(-rate, now.noise),
                }
            }
            (Self::Slackens(i, vanished), _) => {
                let own = now.active.lasting[i];
                let sign = if vanished { -1.0 } else { 1.0 };
                match own.slack(&sim.touches[own.touch].contact, look(own.touch)?) {
                    Some(Slack::Depth(depth)) => GuardValue::velocity(sign * depth, now.scale.rounding()),
                    Some(Slack::Speed(speed)) => GuardValue::velocity(sign * speed, now.noise),
                    None => GuardValue::default(),
                }
            }
            (Self::Slider(i, slips), _) => {
                let own = now.active.lasting[i];
                let deflection = deflection(now.bristles.0, now.bristles.1, own.touch);
                // Along a direction, so that a force that turns back within a step is seen.
                let left = |grip: &Grip| slips.map_or(grip.margin(), |along| grip.force.dot(&along) - grip.limit);
                match own.grip(&sim.touches[own.touch], deflection, (view, q, qd, time))? {
                    Some(grip) => GuardValue::velocity(left(&grip), grip.rounding()),
                    None => GuardValue::default(),
                }
            }
            (Self::SlipStops(i) | Self::SlipGrows(i), _) => {
                let touch = &sim.touches[now.active.lasting[i].touch];
                let (Hold::Slides { toward } | Hold::Starts { toward }) = now.active.lasting[i].hold else {
                    return Ok(GuardValue::default());
                };
                let Some(place) = touch.at(view, q, time).surface else { return Ok(GuardValue::default()) };
                let u = touch.u(&place, view, qd, time)?;
                if matches!(self, Self::SlipStops(_)) {
                    GuardValue::velocity(u.dot(&toward), now.noise)
                } else {
                    let slip = u - place.normal * place.normal.dot(&u);
                    GuardValue::bound(1.0 - now.starts.share(slip, toward))
                }
            }
            (Self::JointStops(k), Some(held)) => {
                let DryJoint { v, state, .. } = now.active.dry[k];
                let Dry::Brakes(direction) = state else { return Ok(GuardValue::default()) };
                // With its rate the time is exact: near a dead point of a loop a velocity that is almost zero is not one that can be stopped.
                let rate = Some(held.qdd[v] * direction);
                GuardValue { rate, ..GuardValue::velocity(qd[v] * direction, now.scale.joint(v, now.noise)) }
            }
            (Self::MayClose(touch, may), _) => {
                let Some(condition) = &sim.touches[touch].closes_while else { return Ok(GuardValue::default()) };
                let (state, sign) = ([q, qd].concat(), if may { 1.0 } else { -1.0 });
                let (value, rate) = condition.at(&state);
                let band = EQUAL * rate.abs() / now.scale.pace;
                GuardValue { rate: Some(sign * rate), ..GuardValue::velocity(sign * value, band) }
            }
            (Self::SlipEnds, _) => GuardValue::bound(now.slip_left),
            (Self::Branches, _) => GuardValue::bound(now.regular),
            (Self::Admissible, _) => GuardValue::margin(now.admissible),
            (Self::NormalForce(i), Some(held)) => GuardValue::margin(held.contacts[i].normal_force),
            (Self::Cone(i), Some(held)) => {
                let mu = sim.touches[now.active.lasting[i].touch].contact.law.friction();
                GuardValue::margin(held.contacts[i].cone(mu))
            }
            (Self::JointBreaksLoose(k), Some(held)) => {
                GuardValue::margin(now.active.dry[k].friction - held.joints[k].abs())
            }
            (_, None) => unreachable!("constraint forces are computed for these guards"),
        })
    }
}

impl<A: Space> Run<'_, '_, A> {
    /// The i-th contact changes from loading to unloading, or back. The time of the change is as exact as the dense output, so that the greatest depth
    /// follows from the depth then, its rate and its acceleration: derivatives of the run depend on it in first order.
    pub fn turn(&mut self, i: usize) -> Result<(), SimError> {
        let Lasting { touch, hold } = self.motion.active.lasting[i];
        let mut depth = f64::NEG_INFINITY;
        if matches!(hold, Hold::Presses { deepest: f64::NEG_INFINITY, .. }) {
            let (gap, rate) = self.gap(touch)?;
            let opens = self.motion.gap_acceleration(touch, self.time, &self.y)?;
            depth = -gap + if opens > 0.0 { 0.5 * rate * rate / opens } else { 0.0 };
        }
        if let Hold::Presses { deepest, .. } = &mut self.motion.active.lasting[i].hold {
            *deepest = depth;
        }
        Ok(())
    }

    /// What follows the zero of a guard.
    pub fn guard_fired(&mut self, guard: Guard) -> Result<(), SimError> {
        if self.history.is_crowded(self.time, guard.is_gap(), self.motion.sim) {
            return self.step_on(StepReason::Crowd);
        }
        let before = self.y.clone();
        match guard {
            Guard::Gap(touch) => return self.touch(touch),
            Guard::Branches => return self.pass_branch(),
            Guard::Pair(group) => {
                let gaps = self.gaps()?;
                let own = |k: usize| self.motion.gaps.is_of(group, k) && !self.motion.lasts(k);
                let least = gaps.iter().filter(|(k, _)| own(*k)).min_by(|a, b| a.1.0.total_cmp(&b.1.0));
                return least.map_or(Ok(()), |&(touch, _)| self.touch(touch));
            }
            Guard::Leaves(i) => {
                let touch = self.motion.active.lasting.remove(i).touch;
                self.note(EventKind::LiftOff { touch }, &before);
                return self.leave(touch, &before);
            }
            Guard::Depth(i) => {
                let own = self.motion.active.lasting.remove(i);
                self.note(EventKind::LiftOff { touch: own.touch }, &before);
            }
            Guard::Turns(i) => return self.turn(i),
            Guard::MayClose(touch, ceases) => return if ceases { Ok(()) } else { self.refuse_overlap(touch) },
            Guard::Slackens(..) | Guard::Slider(..) => return Ok(()),
            Guard::SlipGrows(i) => return self.motion.started(i, self.time, &before),
            Guard::SlipStops(i) => {
                self.motion.follow_slip(self.time, &before)?;
                let touch = self.motion.active.lasting[i].touch;
                if let Some(toward) = self.motion.slip(touch, self.time, &before)? {
                    self.motion.active.lasting[i].hold = Hold::Slides { toward }; // its direction has turned by 90°
                    return Ok(());
                }
            }
            Guard::JointStops(k) if self.motion.couplings.is_empty() => {
                self.y[self.motion.sim.chain.nq() + self.motion.active.dry[k].v] = 0.0;
            }
            Guard::NormalForce(_)
            | Guard::Cone(_)
            | Guard::JointBreaksLoose(_)
            | Guard::JointStops(_)
            | Guard::Admissible
            | Guard::SlipEnds => {}
        }
        let events = self.history.events;
        let (old, joints) = (self.motion.active.lasting.clone(), self.motion.active.dry.clone());
        self.resettle(None, &[], &before)?;
        // A contact that slides on in another direction, a joint that turns back: the mode has the same name as before.
        if self.history.events == events {
            match guard {
                // A contact whose normal force is zero again within this time has none.
                Guard::NormalForce(i) => {
                    let since = self.history.count(Class::NormalForce, self.time);
                    if since.is_some_and(|since| since <= self.motion.sim.zeno_time) {
                        self.resettle(Some(old[i].touch), &[], &before)?;
                    }
                }
                Guard::SlipStops(i) | Guard::Cone(i) => {
                    if let Some(mode) = self.motion.active.lasting.get(i).map(Lasting::mode) {
                        self.note(EventKind::Mode { mode }, &before);
                    }
                }
                Guard::JointStops(k) | Guard::JointBreaksLoose(k)
                    if self.motion.active.dry[k].state != joints[k].state =>
                {
                    self.note_joint(k, &before);
                }
                // A slip that seemed to end goes on, or has turned back at a dead point.
                Guard::SlipEnds => self.history.slip_goes_on = !self.note_turned((&old, false), &before),
                _ => {}
            }
        }
        Ok(())
    }
}

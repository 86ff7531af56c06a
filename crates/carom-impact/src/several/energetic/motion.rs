//! The motion during the impact, integrated from event to event.
//!
//! All numbers are without units here: velocities relative to the largest approach velocity, inverse masses to the
//! largest diagonal entry of H, stiffnesses to the largest one; the unit of τ follows from them.
//!
//! A contact **loads** while it approaches or is open, and **unloads** while it has a force and separates. Between two events
//! no contact changes from one to the other, and none closes or opens. A step that passes an event is made again, shorter,
//! until it ends at the first one. Where a contact closes or opens, its force has the non-integer power δ^η; steps
//! grow from there, and shrink towards it, by their error estimate.

use nalgebra::{DMatrix, DVector};

use super::extrapolation::{Extrapolation, ORDER};
use crate::ImpactError;

/// Approach velocity that is left at the end, in units of the error of a step.
const LEFT: f64 = 100.0;
/// Largest number of steps.
const MAX_STEPS: usize = 30_000;
/// Relative error of a step that rounding still allows.
const FINEST: f64 = 1e-14;
/// An event is located up to this velocity, or share of the penetration of an impact.
const LOCATED: f64 = 1e-15;
/// Velocities, and shares of the penetration of an impact, below which an event that is taken back within a step does not count.
const SHORT: f64 = 1e-10;
/// Energetic coefficients below this count as zero.
const INELASTIC: f64 = 1e-12;

/// Contacts with their normal rows only.
pub(super) struct Motion {
    /// H.
    pub delassus: DMatrix<f64>,
    pub u_minus: DVector<f64>,
    pub stiffness: Vec<f64>,
    /// Energetic coefficients.
    pub restitution: Vec<f64>,
    pub exponent: f64,
}

/// What a contact has gone through.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Pressed {
    /// Energy stored, all compressions together.
    pub stored: f64,
    /// Number of compressions that have ended.
    pub compressions: usize,
}

/// The end of a motion.
pub(super) struct End {
    pub impulse: DVector<f64>,
    pub contacts: Vec<Pressed>,
    pub steps: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Approaching, or open; with the penetration at which this compression began, at least 0.
    Loads {
        from: f64,
    },
    Unloads,
}

/// What ends a phase of a contact.
#[derive(Clone, Copy, PartialEq)]
enum Event {
    /// The penetration passes zero.
    Touches,
    /// The normal velocity passes zero.
    Turns,
}

impl Motion {
    /// F(δ) = k max(δ, 0)^η.
    fn force(&self, i: usize, depth: f64) -> f64 {
        let d = depth.max(0.0);
        let power = if self.exponent == 1.0 {
            d
        } else if self.exponent == 1.5 {
            d * d.sqrt()
        } else {
            d.powf(self.exponent)
        };
        self.stiffness[i] * power
    }

    /// E(δ) = F δ/(η + 1).
    fn energy(&self, i: usize, depth: f64) -> f64 {
        self.force(i, depth) * depth.max(0.0) / (self.exponent + 1.0)
    }

    /// Row i of H P.
    fn gained(&self, i: usize, impulse: &[f64]) -> f64 {
        // H is symmetric: its columns, which are contiguous, are its rows.
        let row = &self.delassus.as_slice()[i * impulse.len()..][..impulse.len()];
        row.iter().zip(impulse).map(|(h, p)| h * p).sum()
    }

    /// Penetration at which a contact alone stores the energy of its effective mass at velocity 1.
    fn depth(&self, i: usize) -> f64 {
        let energy = 0.5 / self.delassus[(i, i)];
        (energy * (self.exponent + 1.0) / self.stiffness[i]).powf((self.exponent + 1.0).recip())
    }

    /// dδ/dτ and dP/dτ of the state (δ, P).
    fn rate(&self, base: &[f64], faster: &[f64], state: &[f64], rate: &mut [f64]) {
        let (depth, impulse) = state.split_at(faster.len());
        let (closing, force) = rate.split_at_mut(faster.len());
        for i in 0..faster.len() {
            closing[i] = -(base[i] + self.gained(i, impulse)) * faster[i];
            force[i] = self.force(i, depth[i]);
        }
    }

    /// Integrates with this error of each step, until no contact has a force and none approaches, but for [`LEFT`] times as
    /// much.
    pub fn run(&self, tolerance: f64) -> Result<End, ImpactError> {
        let mut run = Run::new(self, tolerance.max(FINEST));
        while !run.is_over() {
            if run.steps == MAX_STEPS {
                return Err(ImpactError::Endless { steps: run.steps });
            }
            run.steps += 1;
            if !run.flies() {
                run.advance();
            }
        }
        run.rebase();
        Ok(End { impulse: DVector::from_vec(run.given), contacts: run.contacts, steps: run.steps })
    }
}

struct Run<'a> {
    motion: &'a Motion,
    count: usize,
    tolerance: f64,
    /// Penetrations δ, and impulses P since the last event; a negative penetration is a gap.
    state: Vec<f64>,
    /// Velocities and impulses at the last event. What is left of an impact may be many orders smaller than its beginning, and
    /// rounds in its own size.
    base: Vec<f64>,
    given: Vec<f64>,
    phases: Vec<Phase>,
    /// Ratio dδ/dτ over -u: 1 while a contact loads, 1/e² while it unloads.
    faster: Vec<f64>,
    contacts: Vec<Pressed>,
    /// Units of the state, for errors.
    scale: Vec<f64>,
    step: f64,
    steps: usize,
    method: Extrapolation,
}

impl<'a> Run<'a> {
    fn new(motion: &'a Motion, tolerance: f64) -> Self {
        let count = motion.stiffness.len();
        let depths = (0..count).map(|i| motion.depth(i));
        let impulses = (0..count).map(|i| motion.delassus[(i, i)].recip());
        let scale: Vec<f64> = depths.chain(impulses).collect();
        let step = scale[..count].iter().fold(f64::INFINITY, |least: f64, depth| least.min(*depth)) * 1e-3;
        Self {
            motion,
            count,
            tolerance,
            state: vec![0.0; 2 * count],
            base: motion.u_minus.as_slice().to_vec(),
            given: vec![0.0; count],
            phases: vec![Phase::Loads { from: 0.0 }; count],
            faster: vec![1.0; count],
            contacts: vec![Pressed::default(); count],
            scale,
            step,
            steps: 0,
            method: Extrapolation::new(2 * count),
        }
    }

    fn velocity(&self, i: usize, state: &[f64]) -> f64 {
        self.base[i] + self.motion.gained(i, &state[self.count..])
    }

    /// Counts impulses from here.
    fn rebase(&mut self) {
        for i in 0..self.count {
            self.base[i] += self.motion.gained(i, &self.state[self.count..]);
            self.given[i] += self.state[self.count + i];
        }
        self.state[self.count..].fill(0.0);
    }

    /// Whether no contact approaches, and what is still stored cannot change a velocity by more than the tolerance.
    fn is_over(&self) -> bool {
        let left: f64 = (0..self.count).map(|i| self.motion.energy(i, self.state[i])).sum();
        let end = LEFT * self.tolerance;
        left <= end * end && (0..self.count).all(|i| self.velocity(i, &self.state) >= -end)
    }

    /// Without a force velocities are constant: jumps to the next closing of a contact. False if a force acts, or begins.
    fn flies(&mut self) -> bool {
        if self.state[..self.count].iter().any(|depth| *depth > 0.0) {
            return false;
        }
        let approaching = |i: &usize| self.velocity(*i, &self.state) < 0.0;
        let time = |i: usize| self.state[i] / self.velocity(i, &self.state);
        let next = (0..self.count).filter(approaching).map(|i| (time(i), i)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((time, next)) = next.filter(|(time, _)| *time > 0.0) else { return false };
        for i in 0..self.count {
            let closer = self.velocity(i, &self.state) * time;
            self.state[i] -= closer;
            // Contacts that close together, but for rounding.
            if i == next || self.state[i].abs() <= LOCATED * self.scale[i] {
                self.state[i] = 0.0;
            }
        }
        true
    }

    /// One step, up to the first event.
    fn advance(&mut self) {
        let least = self.scale[..self.count].iter().fold(f64::INFINITY, |least: f64, depth| least.min(*depth));
        let (mut h, mut grown);
        loop {
            h = self.step;
            let error = self.attempt(h) / self.tolerance;
            // The largest growth for an error of zero, the largest shrinkage for one that is not finite.
            let change = if error > 0.0 { 0.8 * error.powf(-f64::from(ORDER).recip()) } else { 4.0 };
            grown = h * if error.is_finite() { change.clamp(0.1, 4.0) } else { 0.1 };
            let back = self.events(&self.method.middle);
            let back = back.into_iter().any(|event| self.value(event, &self.method.middle).abs() > SHORT);
            if h <= LOCATED * least || (error <= 1.0 && (!back || !self.passed().is_empty() || h <= SHORT * least)) {
                break;
            }
            // Too inexact, or an event that is taken back within the step.
            self.step = grown.min(0.5 * h);
        }
        self.step = grown;
        let passed = self.passed();
        let passed = if passed.is_empty() { passed } else { self.locate(h, passed) };
        self.state.copy_from_slice(&self.method.end);
        if !passed.is_empty() {
            self.rebase();
        }
        passed.into_iter().for_each(|(i, event)| self.pass(i, event));
    }

    /// A step of this length from `state`, left in `method`; returns its error estimate.
    fn attempt(&mut self, h: f64) -> f64 {
        let Self { motion, base, faster, state, scale, method, .. } = self;
        method.step(|state, rate| motion.rate(base, faster, state, rate), state, h, scale)
    }

    /// The events that the last attempt has passed.
    fn passed(&self) -> Vec<(usize, Event)> {
        self.events(&self.method.end)
    }

    /// The events between `state` and `end`.
    fn events(&self, end: &[f64]) -> Vec<(usize, Event)> {
        let mut events = Vec::new();
        for i in 0..self.count {
            let (before, after) = (self.state[i], end[i]);
            if (before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0) {
                events.push((i, Event::Touches));
            }
            let u = self.velocity(i, end);
            let turns = match self.phases[i] {
                Phase::Loads { .. } => u > 0.0 && (before > 0.0 || after > 0.0),
                Phase::Unloads => u < 0.0,
            };
            if turns {
                events.push((i, Event::Turns));
            }
        }
        events
    }

    /// The function whose zero the event is, relative to its unit.
    fn value(&self, (i, event): (usize, Event), state: &[f64]) -> f64 {
        match event {
            Event::Touches => state[i] / self.scale[i],
            Event::Turns => self.velocity(i, state),
        }
    }

    /// Shortens the step until it ends just behind the first event; returns the events there.
    fn locate(&mut self, h: f64, passed: Vec<(usize, Event)>) -> Vec<(usize, Event)> {
        let (mut low, mut high, mut passed) = (0.0, h, passed);
        let (mut low_state, mut high_state) = (self.state.clone(), self.method.end.clone());
        for turn in 0..200 {
            let values = passed.iter().map(|&event| self.value(event, &high_state).abs());
            if values.fold(0.0, f64::max) <= LOCATED || high - low <= LOCATED * high {
                break;
            }
            // The secant of the first event in the list, a little before or behind it so that the bracket shrinks from both
            // ends, and in turn the middle.
            let event = passed[0];
            let (from, to) = (self.value(event, &low_state), self.value(event, &high_state));
            let secant = low + (high - low) * from / (from - to);
            let aside = (1e-3 * (high - low)).min(1e-8 * h);
            let guess = [secant + aside, secant - aside, 0.5 * (low + high)][turn % 3];
            let guess = if guess > low && guess < high { guess } else { 0.5 * (low + high) };
            self.attempt(guess);
            let events = self.passed();
            if events.is_empty() {
                low = guess;
                low_state.copy_from_slice(&self.method.end);
            } else {
                (high, passed) = (guess, events);
                high_state.copy_from_slice(&self.method.end);
            }
        }
        self.method.end.copy_from_slice(&high_state);
        passed
    }

    /// What an event at the current state changes.
    fn pass(&mut self, i: usize, event: Event) {
        let motion = self.motion;
        match (event, self.phases[i]) {
            (Event::Touches, phase) => {
                self.state[i] = 0.0;
                if phase == Phase::Unloads {
                    self.load(i);
                }
            }
            (Event::Turns, Phase::Loads { from }) => {
                let one = &mut self.contacts[i];
                one.stored += motion.energy(i, self.state[i]) - motion.energy(i, from);
                one.compressions += 1;
                let e = motion.restitution[i];
                if e < INELASTIC {
                    self.state[i] = 0.0;
                    self.load(i);
                } else {
                    self.phases[i] = Phase::Unloads;
                    self.faster[i] = (e * e).recip();
                }
            }
            (Event::Turns, Phase::Unloads) => self.load(i),
        }
    }

    fn load(&mut self, i: usize) {
        self.phases[i] = Phase::Loads { from: self.state[i].max(0.0) };
        self.faster[i] = 1.0;
    }
}

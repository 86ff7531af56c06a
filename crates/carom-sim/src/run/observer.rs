//! After every accepted step of a leg: which guard fires first, and the samples of the step.
//!
//! **Trigger rule.** A guard w depends on the state. It is *armed* once it has been positive at the start of the
//! leg or at the end of a step, above its hysteresis. An armed guard fires at the first time t with w(t) ≤ 0. A zero exactly at the end of a step
//! fires there, once: the next leg starts with that guard not armed. If the rate of an armed guard is negative at the
//! start of a step and not negative at its end, its minimum within the step is evaluated, so that a short or grazing contact
//! is detected. Of a gap that closes at its rate within a step, and whose parts do not face each other at its end, some times within
//! the step are examined. The hysteresis of a gap is its rounding, so that rounding after an impact does not count as opening; that of a
//! velocity is its error. A gap or a velocity that is not armed and falls by more than its hysteresis fires
//! as well, so that no contact penetrates. Forces have none: they are armed when they are positive.
//!
//! Of the margin of a force the curvature over this step and the one before tells whether it may be negative within
//! the step: it is then evaluated at its middle, and at the minima of parabolas through three points.
//!
//! **Bodies.** The gap of two bodies is the least of those of their parts, and may close and open in several places within a step: the
//! step is divided where the velocities of the bodies allow a contact ([`Passing`](crate::contact::Passing)). Parts of bodies that touch
//! at others may begin to face each other below zero: an overlap of the bodies tells that one of them has closed.
//!
//! **Gaps that jump.** Parts of two bodies that begin to face each other with an overlap have a gap that jumps from infinity to
//! below zero: other parts of these bodies touched before, and passed each other within the step. The least of all gaps goes through
//! zero where they did.

use super::flow::System;
use super::guard::GuardValue;
use super::sampler::Sampler;
use super::trajectory::{Segment, Step};
use crate::state::{EQUAL, ROUNDING, STEPS};
use carom_impact::roots::descent;
use ivp::dense::StepInterpolant;
use ivp::solout::{ControlFlag, SolOut};

/// A step is examined in up to this number of parts, a power of two.
const PARTS: usize = 64;
/// What is near: a guard that is this share of its change within a step above its level, and of its change by its curvature where it is least;
/// bodies that touch and have turned by this angle relative to each other, rad.
const NEAR: f64 = 0.05;

/// A guard that fired within a step.
pub(crate) struct Crossing {
    pub guard: usize,
    /// The level at which it fires.
    pub level: f64,
    /// Start and end of the step, and the state at the start.
    pub start: f64,
    pub end: f64,
    pub y: Vec<f64>,
    /// The root on the dense output.
    pub time: f64,
}

/// A part of a step, with the guard that is examined, its level, and its values and rates at both ends.
#[derive(Clone, Copy)]
struct Part {
    k: usize,
    level: f64,
    start: f64,
    end: f64,
    before: GuardValue,
    after: GuardValue,
}

/// Called after every accepted step: evaluates guards and sampler.
pub(crate) struct Observer<'a, 'b, 'c> {
    pub system: &'a System<'b>,
    before: Vec<GuardValue>,
    /// The level at which each guard fires; `None` while it is not armed.
    levels: Vec<Option<f64>>,
    pub y_before: Vec<f64>,
    /// The time of `y_before`.
    pub reached: f64,
    /// The length of the step before, and the values of the guards at its start.
    earlier: Option<(f64, Vec<f64>)>,
    /// Scratch memory.
    after: Vec<GuardValue>,
    buffer: Vec<f64>,
    pub found: Option<Crossing>,
    /// The length of the longest step.
    pub longest: f64,
    /// `None`: only the last state is needed.
    pub sampler: Option<&'a mut Sampler<'c>>,
}

impl SolOut for Observer<'_, '_, '_> {
    fn solout(&mut self, start: f64, end: &mut f64, y: &mut [f64], dense: Option<&StepInterpolant<'_>>) -> ControlFlag {
        let end = *end;
        if self.system.0.borrow().error.is_some() {
            return ControlFlag::Interrupt;
        }
        let (Some(dense), true) = (dense, self.sampler.is_some()) else {
            self.y_before.copy_from_slice(y);
            return ControlFlag::Continue;
        };
        let mut after = std::mem::take(&mut self.after);
        self.system.ask(|flow| flow.guards(end, y, &mut after));
        // The number of guards is constant within a leg. If their evaluation fails, the list is empty and the error is
        // stored.
        let first = (after.iter().enumerate())
            .filter_map(|(k, after)| Some((self.first(k, (start, end), *after, dense)?, k)))
            .min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let first = first.map(|first| self.unless_jump(first, start, dense));
        let until = first.map_or(end, |((time, _), _)| time);
        let touches = self.system.0.borrow().flow.touches();
        let first = if touches { self.overlap((start, until), dense).or(first) } else { first };
        let until = first.map_or(end, |((time, _), _)| time);
        self.longest = self.longest.max(until - start);
        if let Some(sampler) = &mut self.sampler {
            let (buffer, system) = (&mut self.buffer, self.system);
            let mut at = |time| {
                dense.interpolate(time, buffer);
                system.ask(|flow| flow.close(buffer));
                buffer.clone()
            };
            if let Some(path) = &mut sampler.path {
                path.retain(|step| step.start < start); // a leg that failed is repeated
                let last = at(until);
                let shares = system.ask(|flow| flow.pieces([(start, &self.y_before), (until, &last)]));
                let mut from = start;
                path.extend(shares.iter().map(|share| {
                    let end = if *share == 1.0 { until } else { start + (until - start) * share };
                    let start = std::mem::replace(&mut from, end);
                    let before = at(start);
                    let states = Step::POINTS.map(|point| at(start + (end - start) * point)).to_vec();
                    Step { start, end, before, states }
                }));
            }
            let loads = sampler.sampling.loads;
            let told = |time: f64, y: &[f64]| system.ask(|flow| flow.told(time, y, loads));
            sampler.stretch((start, until, Segment::POINTS), at, told);
        }
        if let Some(((time, level), guard)) = first {
            self.found = Some(Crossing { guard, level, start, end, y: self.y_before.clone(), time });
            return ControlFlag::Interrupt;
        }
        let settled = self.system.ask(|flow| flow.settle(end, y));
        if settled {
            self.system.ask(|flow| flow.guards(end, y, &mut after));
        }
        for (level, guard) in self.levels.iter_mut().zip(&after) {
            if guard.value > guard.least() {
                *level = Some(0.0);
            }
        }
        if self.before.iter().any(|guard| guard.dips) {
            let (length, values) = self.earlier.get_or_insert_default();
            *length = end - start;
            values.clear();
            values.extend(self.before.iter().map(|guard| guard.value));
        }
        self.after = std::mem::replace(&mut self.before, after);
        self.y_before.copy_from_slice(y);
        self.reached = end;
        if settled { ControlFlag::ModifiedSolution } else { ControlFlag::Continue }
    }
}

impl<'a, 'b, 'c> Observer<'a, 'b, 'c> {
    /// For a leg from this state with these guards.
    pub fn new(
        system: &'a System<'b>,
        (start, y): (f64, &[f64]),
        before: Vec<GuardValue>,
        sampler: Option<&'a mut Sampler<'c>>,
    ) -> Self {
        let level = |w: &GuardValue| {
            if w.value > w.least() { Some(0.0) } else { w.band.map(|band| w.value.min(0.0) - band) }
        };
        let levels = before.iter().map(level).collect();
        let (y_before, buffer) = (y.to_vec(), vec![0.0; y.len()]);
        let (after, earlier) = (Vec::new(), None);
        Self {
            system,
            before,
            levels,
            y_before,
            reached: start,
            earlier,
            after,
            buffer,
            found: None,
            longest: 0.0,
            sampler,
        }
    }

    /// The first time in a part of the step at which bodies that touch begin to overlap, and the contact of their parts that was missed,
    /// because its parts did not face each other before, or do not at the end.
    fn overlap(&mut self, (start, end): (f64, f64), dense: &StepInterpolant) -> Option<((f64, f64), usize)> {
        let at = |it: &mut Self, time: f64| {
            dense.interpolate(time, &mut it.buffer);
            it.system.ask(|flow| flow.separated(time, &it.buffer))
        };
        let [mut before, turning] = at(self, start);
        if before <= 0.0 {
            return None; // they did so before
        }
        let parts = (turning * (end - start) / NEAR).ceil().clamp(1.0, PARTS as f64);
        let mut from = start;
        for part in 1..=parts as usize {
            let to = (start + (end - start) * part as f64 / parts).min(end);
            let [after, _] = at(self, to);
            if after <= 0.0 {
                let time = descent((from, before), (to, after), |time| at(self, time)[0]);
                dense.interpolate(time, &mut self.buffer);
                let k = self.system.ask(|flow| flow.closed_last(time, &self.buffer))?;
                return Some(((time, 0.0), k));
            }
            (from, before) = (to, after);
        }
        None
    }

    /// The guard that fires first; if it is a gap that jumps, that with the least gap where the least gap goes through zero before.
    fn unless_jump(
        &mut self,
        ((time, level), k): ((f64, f64), usize),
        start: f64,
        dense: &StepInterpolant,
    ) -> ((f64, f64), usize) {
        let gaps: Vec<usize> = (0..self.before.len())
            .filter(|&k| {
                self.before[k].is_gap && self.before[k].value > self.before[k].least() && self.levels[k] == Some(0.0)
            })
            .collect();
        let least = |it: &mut Self, time: f64| {
            let values = gaps.iter().map(|&k| (it.at(k, time, dense).value, k));
            values.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, k))
        };
        // A gap has jumped that does not count as closed at its root on the dense output; its hysteresis is rounding.
        if !gaps.contains(&k) || self.at(k, time, dense).value > -EQUAL / ROUNDING * self.before[k].least() {
            return ((time, level), k);
        }
        let (first, _) = least(self, start);
        let (last, _) = least(self, time);
        let zero = descent((start, first), (time, last), |time| least(self, time).0);
        ((zero, 0.0), least(self, zero).1)
    }

    /// The first time in the step at which a guard fires, and the level at which it does. A gap of two bodies is a minimum of many
    /// functions, and may close and open again within a step in several places: the step is divided as long as the velocities of the
    /// bodies allow it, into [`PARTS`] at most; into fewer where it is closed at the end of one.
    fn first(
        &mut self,
        k: usize,
        (start, end): (f64, f64),
        after: GuardValue,
        dense: &StepInterpolant,
    ) -> Option<(f64, f64)> {
        let (before, level) = (self.before[k], self.levels[k]?);
        let bounds = before.passing.zip(after.passing).map(|(own, other)| own.bounds(&other, end - start));
        self.within(Part { k, level, start, end, before, after }, bounds, PARTS, dense)
    }

    /// [`Self::first`] in a part of the step. `bounds`: of the rate and the curvature of the gap.
    fn within(
        &mut self,
        part: Part,
        bounds: Option<[f64; 2]>,
        parts: usize,
        dense: &StepInterpolant,
    ) -> Option<(f64, f64)> {
        let Part { k, level, start, end, before, after } = part;
        let (Some(bound), true) = (bounds, parts > 1 && before.value > level) else {
            return self.root(part, dense);
        };
        if after.value > level && stays_above(&part, bound) {
            return None;
        }
        let middle = 0.5 * (start + end);
        let between = self.at(k, middle, dense);
        let rest = if after.value > level { parts / 2 } else { (parts / 2).min(4) };
        let first = self.within(Part { end: middle, after: between, ..part }, bounds, rest, dense);
        let level = if between.value > between.least() { 0.0 } else { level };
        first.or_else(|| self.within(Part { level, start: middle, before: between, ..part }, bounds, rest, dense))
    }

    /// The first time in a part of the step at which a guard fires, by its values and rates at both ends.
    fn root(&mut self, part: Part, dense: &StepInterpolant) -> Option<(f64, f64)> {
        let Part { k, level, start, end, before, after } = part;
        let rates = before.rate.zip(after.rate);
        if let Some((a, b)) = rates.filter(|(a, b)| level < 0.0 && after.value <= 0.0 && *a > 0.0 && *b < 0.0) {
            // The gap opened and closed again within this step.
            let highest = descent((start, a), (end, b), |time| self.at(k, time, dense).rate.unwrap_or(0.0));
            let value = self.at(k, highest, dense).value;
            if value > before.least() {
                let value_at = |time: f64| self.at(k, time, dense).value;
                let closed = descent((highest, value), (end, after.value), value_at);
                return Some((closed, 0.0));
            }
        }
        let (reached, value) = if after.value <= level {
            (end, after.value)
        } else if let Some(within) = self.passed(part, dense).or_else(|| self.dips(part, dense)) {
            within
        } else {
            let (a, b) = rates.filter(|(a, b)| *a < 0.0 && *b >= 0.0)?;
            let lowest = descent((start, -a), (end, -b), |time| -self.at(k, time, dense).rate.unwrap_or(0.0));
            let value = self.at(k, lowest, dense).value;
            if value > level {
                return None;
            }
            (lowest, value)
        };
        if before.value <= level {
            return Some((start, level)); // already at the level at the start
        }
        let above = |time: f64| self.at(k, time, dense).value - level;
        Some((descent((start, before.value - level), (reached, value - level), above), level))
    }

    /// The first time in the step, of some, at which a gap is closed whose parts do not face each other at the end, because they
    /// have passed each other.
    fn passed(&mut self, part: Part, dense: &StepInterpolant) -> Option<(f64, f64)> {
        let Part { k, level, start, end, before, after } = part;
        let closing = before.rate.is_some_and(|rate| before.value + rate * (end - start) < level);
        if !after.is_gap || after.value.is_finite() || !closing {
            return None;
        }
        let times = (1..PARTS).map(|i| start + (end - start) * i as f64 / PARTS as f64);
        times.map(|time| (time, self.at(k, time, dense).value)).find(|(_, value)| *value <= level)
    }

    /// A time in the step at which the margin of a force is at its level, although it is above it at both ends.
    fn dips(&mut self, part: Part, dense: &StepInterpolant) -> Option<(f64, f64)> {
        let Part { k, level, start, end, before, after } = part;
        if !after.dips {
            return None;
        }
        let (first, last, span) = (before.value - level, after.value - level, end - start);
        // Its change by its curvature is ½ ẅ t², and a parabola falls by a quarter of it below its ends.
        let may_dip = match &self.earlier {
            Some((length, values)) => {
                let bend = 2.0 * ((last - first) / span - (before.value - values[k]) / length) / (span + length);
                first.min(last) <= 0.5 * bend * span * span
            }
            // In the first step of a leg from near the level, the guard may fall at first.
            None => first <= NEAR * last,
        };
        if !may_dip {
            return None;
        }
        let middle = 0.5 * (start + end);
        let mut points = [(start, first), (middle, self.at(k, middle, dense).value - level), (end, last)];
        if points[1].1 <= 0.0 {
            return Some((middle, points[1].1 + level));
        }
        // The minimum of the parabola through three points, again and again.
        for _ in 0..STEPS {
            let [(x, f), (y, g), (z, h)] = points;
            let (slope, next) = ((g - f) / (y - x), (h - g) / (z - y));
            let curvature = (next - slope) / (z - x);
            let lowest = 0.5 * (x + y - slope / curvature);
            let least = f + (lowest - x) * (slope + curvature * (lowest - y));
            let inside = start < lowest && lowest < end && ![x, y, z].contains(&lowest);
            if !(curvature > 0.0 && inside && least <= NEAR * curvature * (z - x) * (z - x)) {
                return None;
            }
            let value = self.at(k, lowest, dense).value - level;
            if value <= 0.0 {
                return Some((lowest, value + level));
            }
            let farthest = if lowest - x > z - lowest { 0 } else { 2 };
            points[farthest] = (lowest, value);
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        None
    }

    /// One guard on the dense output.
    fn at(&mut self, k: usize, time: f64, dense: &StepInterpolant) -> GuardValue {
        dense.interpolate(time, &mut self.buffer);
        self.system.ask(|flow| flow.guard(k, time, &self.buffer))
    }
}

/// Whether a gap stays above its level in a part of a step, by [bounds](Passing::bounds) of its rate and its curvature: the gap of convex
/// bodies that do not turn is a convex function of their distance, and so above its tangents; turning and accelerations take at most the
/// bound of the curvature times the square of the time over eight from that.
fn stays_above(part: &Part, [rate, curvature]: [f64; 2]) -> bool {
    let Part { level, start, end, before, after, .. } = part;
    let (first, last, span) = (before.value - level, after.value - level, end - start);
    if first + last > rate * span {
        return true;
    }
    let (Some(a), Some(b)) = (before.rate, after.rate) else { return false };
    let least = if a < 0.0 && b > 0.0 {
        let crossing = ((last - first - b * span) / (a - b)).clamp(0.0, span);
        (first + a * crossing).min(last - b * (span - crossing))
    } else {
        first.min(last)
    };
    least > 0.125 * curvature * span * span
}

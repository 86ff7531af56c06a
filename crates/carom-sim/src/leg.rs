//! One smooth leg of motion: integrated until its end or until a witness reaches zero.
//!
//! **Trigger rule.** A witness w is a function of the state. It is *armed* once it has been positive at the start of the
//! leg or at the end of a step. An armed witness fires at the first time t at which w(t) ≤ 0. A zero exactly at the end
//! of a step fires there, once: the next leg starts with that witness not armed. Between the ends of a step an armed
//! witness that dips (rate negative at the start, positive at the end) is looked at in its lowest point, so that a short
//! or grazing touch is not stepped over. A gap is armed only when it is wider than [`HYSTERESIS`]: the rounding of one
//! that has just been hit is no opening. A gap that is not armed should open; if it closes instead, by that much, it fires
//! there: nothing falls through.
//!
//! **Exact time.** The dense output of the step brackets the root; the state there is then computed by integrating to it
//! anew from the start of the step, and the time corrected by w/ẇ until the witness is rounding. So an event is as exact
//! as the integration, not as its interpolation.

use crate::error::SimError;
use crate::root::descent;
use crate::simulate::Integrator;
use crate::trajectory::{Moment, Sampling, Seen, Segment, Statistics};
use ivp::dense::StepInterpolant;
use ivp::ivp::FirstOrderSystem;
use ivp::matrix::MatrixStorage;
use ivp::methods::{DOP853, RADAU};
use ivp::solout::{ControlFlag, SolOut};
use std::cell::RefCell;

/// How far a gap that should open may close, m: above the rounding of positions, below the height of any bounce that is
/// resolved.
const HYSTERESIS: f64 = 1e-14;
/// Legs that need more steps than this are given up.
const MAX_STEPS: usize = 10_000_000;
/// So many steps for each of the longest are given to a leg that has another way.
const PATIENCE: usize = 500;

/// A smooth vector field with witnesses: one mode of contact of one chain.
pub(crate) trait Flow {
    /// ẏ at (t, y).
    fn rate(&mut self, t: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError>;
    /// Hears that a leg begins: how many witnesses there are, and which, stays the same until it ends.
    fn begin(&mut self);
    /// The witnesses at (t, y), each with its rate in time if it may dip within a step.
    fn witnesses(&mut self, t: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError>;
    /// One of them.
    fn witness(&mut self, k: usize, t: f64, y: &[f64]) -> Result<Witness, SimError>;
    /// Puts a state that drifted off its constraint back on it; says whether it changed anything.
    fn settle(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SimError>;
}

/// The value of a witness function.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Witness {
    pub value: f64,
    pub rate: Option<f64>,
}

/// How a leg ended.
#[derive(Debug, Clone)]
pub(crate) struct LegEnd {
    pub time: f64,
    pub y: Vec<f64>,
    /// The witness that fired.
    pub fired: Option<usize>,
}

/// How to integrate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Accuracy {
    pub tolerance: f64,
    pub max_step: f64,
    pub integrator: Integrator,
    /// Whether a leg that turns out to be stiff fails: there is another way then.
    pub gives_up: bool,
}

/// Hands out moments at multiples of an interval, and segments.
pub(crate) struct Sampler<'a> {
    pub sampling: Sampling,
    /// Lengths of q and qd.
    pub sizes: (usize, usize),
    /// How many moments were handed out.
    pub count: usize,
    /// Up to here segments were handed out: a leg that was given up is gone through again.
    pub until: f64,
    /// Who gets them.
    pub watch: &'a mut dyn FnMut(Seen),
}

impl Sampler<'_> {
    /// Hands out what is due of the stretch from `start` to `end`, from the states that `at` computes; `points` make up
    /// a segment.
    pub fn stretch(&mut self, start: f64, end: f64, points: usize, mut at: impl FnMut(f64) -> Vec<f64>) {
        let (nq, nv) = self.sizes;
        if let Some(every) = self.sampling.every {
            while self.count as f64 * every <= end {
                let time = self.count as f64 * every;
                let y = at(time);
                (self.watch)(Seen::Moment(&Moment { time, q: y[..nq].to_vec(), qd: y[nq..nq + nv].to_vec() }));
                self.count += 1;
            }
        }
        let start = start.max(self.until);
        if self.sampling.dense && end > start {
            self.until = end;
            let states = Segment::times(start, end, points).map(|time| at(time)[..nq + nv].to_vec()).collect();
            (self.watch)(Seen::Segment(&Segment { start, end, states }));
        }
    }
}

/// Integrates `flow` from `(start, y)` to `end`, or to the first witness that fires. The sampler sees its times on the
/// way.
pub(crate) fn leg(
    flow: &mut dyn Flow,
    start: f64,
    y: &[f64],
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
    sampler: &mut Sampler,
) -> Result<LegEnd, SimError> {
    flow.begin();
    let mut now = Vec::new();
    flow.witnesses(start, y, &mut now)?;
    // Witnesses without a rate are no gaps: one that is not positive waits until it is.
    let level = |w: &Witness| match w.rate {
        Some(_) if w.value > HYSTERESIS => Some(0.0),
        Some(_) => Some(w.value.min(0.0) - HYSTERESIS),
        None => (w.value > 0.0).then_some(0.0),
    };
    let levels = now.iter().map(level).collect();
    let system = System(RefCell::new(Inner { flow, error: None }));
    let mut observer = Observer {
        system: &system,
        before: now,
        levels,
        y_before: y.to_vec(),
        after: Vec::new(),
        buffer: vec![0.0; y.len()],
        found: None,
        sampler: Some(sampler),
    };
    integrate(&system, start, y, end, accuracy, statistics, &mut observer)?;
    let Observer { found, y_before, .. } = observer;
    match found {
        None => Ok(LegEnd { time: end, y: y_before, fired: None }),
        Some(found) => refine(&system, found, accuracy, statistics),
    }
}

/// The state at the exact time of an event: from the start of its step anew, the time corrected until the witness is
/// rounding.
fn refine(system: &System, found: Found, accuracy: Accuracy, statistics: &mut Statistics) -> Result<LegEnd, SimError> {
    let Found { witness, level, start, end, y, mut time } = found;
    let mut exact = y.clone();
    for _ in 0..8 {
        let mut observer = Observer {
            system,
            before: Vec::new(),
            levels: Vec::new(),
            y_before: y.clone(),
            after: Vec::new(),
            buffer: Vec::new(),
            found: None,
            sampler: None,
        };
        // No step is shorter than the clock's own grain.
        if time - start > 1e-14 * (1.0 + time.abs()) {
            integrate(system, start, &y, time, accuracy, statistics, &mut observer)?;
        }
        statistics.refinements += 1;
        exact = observer.y_before;
        let Witness { value, rate: Some(rate) } = system.0.borrow_mut().flow.witness(witness, time, &exact)? else {
            break;
        };
        let correction = (level - value) / rate;
        let negligible = correction.abs() <= 4.0 * f64::EPSILON * time.abs().max(time - start);
        // A gap is a difference of positions: nearer to its level than their rounding it can't come.
        let reached = (level - value).abs() <= 4.0 * f64::EPSILON;
        if negligible || reached || !(start..=end).contains(&(time + correction)) {
            break;
        }
        time += correction;
    }
    Ok(LegEnd { time, y: exact, fired: Some(witness) })
}

fn integrate(
    system: &System,
    start: f64,
    y: &[f64],
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
    observer: &mut Observer,
) -> Result<(), SimError> {
    let failed = |reason: String| SimError::Integration { time: start, reason };
    let longest = accuracy.max_step.min((end - start).abs());
    // A lasting contact whose steps grow so small has better ways: a leg of its length is done in hundreds.
    let max_steps =
        if accuracy.gives_up { PATIENCE * (1 + ((end - start).abs() / longest) as usize) } else { MAX_STEPS };
    // One for each number: ivp 0.6's Radau converts a tolerance in place, once for each number, so that a shared one ends
    // at 1e-3 whatever it was.
    let (relative, absolute) =
        (vec![accuracy.tolerance; y.len()].into(), vec![accuracy.tolerance * 1e-3; y.len()].into());
    let solved = match accuracy.integrator {
        Integrator::DormandPrince => {
            // What goes to a known time is part of a step that was accurate: one step. And nobody looks into it.
            let whole = observer.sampler.is_none().then_some(end - start);
            let method = DOP853::builder()
                .max_step(longest)
                .maybe_first_step(whole)
                .dense_output(observer.sampler.is_some())
                .stiff_test(if accuracy.gives_up { 1000 } else { usize::MAX })
                .max_steps(max_steps)
                .build();
            method.solve(system, start, y, end, relative, absolute, Some(observer))
        }
        Integrator::Radau => {
            let method =
                RADAU::builder().max_step(longest).max_steps(max_steps).mass_storage(MatrixStorage::Identity).build();
            method.solve(system, start, y, end, relative, absolute, Some(observer))
        }
    };
    let solved = solved.map_err(|e| failed(format!("{e:?}")))?;
    statistics.steps += solved.steps.accepted;
    statistics.rejections += solved.steps.rejected;
    statistics.evaluations += solved.evals.ode;
    if let Some(error) = system.0.borrow_mut().error.take() {
        return Err(error);
    }
    if solved.status.is_success() { Ok(()) } else { Err(failed(format!("{:?}", solved.status))) }
}

/// The flow as the integrator sees it. It can't hand errors through, so they wait here.
struct System<'a>(RefCell<Inner<'a>>);

struct Inner<'a> {
    flow: &'a mut dyn Flow,
    error: Option<SimError>,
}

impl System<'_> {
    fn ask<T: Default>(&self, question: impl FnOnce(&mut dyn Flow) -> Result<T, SimError>) -> T {
        let inner = &mut *self.0.borrow_mut();
        question(inner.flow).unwrap_or_else(|error| {
            inner.error.get_or_insert(error);
            T::default()
        })
    }
}

impl FirstOrderSystem for System<'_> {
    fn derivative(&self, t: f64, y: &[f64], rate: &mut [f64]) {
        rate.fill(0.0);
        self.ask(|flow| flow.rate(t, y, rate));
    }
}

/// A witness that fired within a step.
struct Found {
    witness: usize,
    /// Its level.
    level: f64,
    /// Start and end of the step, and the state at the start.
    start: f64,
    end: f64,
    y: Vec<f64>,
    /// The root on the dense output.
    time: f64,
}

/// Looks at every accepted step.
struct Observer<'a, 'b, 'c> {
    system: &'a System<'b>,
    before: Vec<Witness>,
    /// The level at which each witness fires; `None` while it is not armed.
    levels: Vec<Option<f64>>,
    y_before: Vec<f64>,
    /// Scratch memory.
    after: Vec<Witness>,
    buffer: Vec<f64>,
    found: Option<Found>,
    /// `None`: only the last state is wanted.
    sampler: Option<&'a mut Sampler<'c>>,
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
        self.system.ask(|flow| flow.witnesses(end, y, &mut after));
        // None has come or gone within a leg; where they can't be computed there are none, and the error is kept.
        let first = (after.iter().enumerate())
            .filter_map(|(k, after)| Some((self.root(k, start, end, *after, dense)?, k)))
            .min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let until = first.map_or(end, |((time, _), _)| time);
        if let Some(sampler) = &mut self.sampler {
            let buffer = &mut self.buffer;
            sampler.stretch(start, until, Segment::POINTS, |time| {
                dense.interpolate(time, buffer);
                buffer.clone()
            });
        }
        if let Some(((time, level), witness)) = first {
            self.found = Some(Found { witness, level, start, end, y: self.y_before.clone(), time });
            return ControlFlag::Interrupt;
        }
        let settled = self.system.ask(|flow| flow.settle(end, y));
        if settled {
            self.system.ask(|flow| flow.witnesses(end, y, &mut after));
        }
        for (level, witness) in self.levels.iter_mut().zip(&after) {
            if witness.value > if witness.rate.is_some() { HYSTERESIS } else { 0.0 } {
                *level = Some(0.0);
            }
        }
        self.after = std::mem::replace(&mut self.before, after);
        self.y_before.copy_from_slice(y);
        if settled { ControlFlag::ModifiedSolution } else { ControlFlag::Continue }
    }
}

impl Observer<'_, '_, '_> {
    /// The first time in the step at which a witness fires, and the level at which it does.
    fn root(&mut self, k: usize, start: f64, end: f64, after: Witness, dense: &StepInterpolant) -> Option<(f64, f64)> {
        let level = self.levels[k]?;
        let before = self.before[k];
        let rates = before.rate.zip(after.rate);
        if let Some((a, b)) = rates.filter(|(a, b)| level < 0.0 && after.value <= 0.0 && *a > 0.0 && *b < 0.0) {
            // It opened and closed again, all within this step.
            let highest = descent((start, a), (end, b), |time| self.at(k, time, dense).rate.unwrap_or(0.0));
            let value = self.at(k, highest, dense).value;
            if value > HYSTERESIS {
                let value_at = |time: f64| self.at(k, time, dense).value;
                let closed = descent((highest, value), (end, after.value), value_at);
                return Some((closed, 0.0));
            }
        }
        let (reached, value) = if after.value <= level {
            (end, after.value)
        } else {
            let (a, b) = rates.filter(|(a, b)| *a < 0.0 && *b > 0.0)?;
            let lowest = descent((start, -a), (end, -b), |time| -self.at(k, time, dense).rate.unwrap_or(0.0));
            let value = self.at(k, lowest, dense).value;
            if value > level {
                return None;
            }
            (lowest, value)
        };
        if before.value <= level {
            return Some((start, level)); // no descent: it is there
        }
        let above = |time: f64| self.at(k, time, dense).value - level;
        Some((descent((start, before.value - level), (reached, value - level), above), level))
    }

    /// One witness on the dense output.
    fn at(&mut self, k: usize, time: f64, dense: &StepInterpolant) -> Witness {
        dense.interpolate(time, &mut self.buffer);
        self.system.ask(|flow| flow.witness(k, time, &self.buffer))
    }
}

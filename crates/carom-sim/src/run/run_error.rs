//! The error of a run, estimated by runs with tighter tolerances.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | e, e′ | errors of a number of the run, and of the tighter run | – |
//! | r | the ratio of their tolerances | [`RATIO`] |
//!
//! Both runs approximate one motion, and differ by e − e′. The error of an integration with step control is nearly proportional to its
//! tolerance, so that |e′| is about r |e| (Skeel 1986, "Thirteen ways to estimate global error", Numer. Math. 48). An error may vanish where it
//! changes its sign, but e′ is about r times the largest error of its kind at most. So the estimate of each error is
//!
//! ```text
//! |e − e′| + r max |e − e′|
//! ```
//!
//! with the largest difference of its kind: of the displacements, of the velocities, of the times of the events so far. It contains all
//! that depends on the tolerance: the integration, the times of events and the impacts that amplify it, the drift of constraints. Rounding adds
//! [`EXACT`] of the size of the kind. The end of an accumulation of impacts replaces those that are left, and with a small restitution both
//! tolerances may leave the same ones: the tighter runs compute one impact more.
//!
//! **Accumulations of impacts at several contacts** end in an order that the tolerance changes, which is no error that is proportional to
//! it. Where the events of the two runs differ, but for the number of impacts of an accumulation at one contact, there is a third
//! run, again with r times the tolerance, and the larger of both differences counts.

use super::follow::Broken;
use super::stream::go;
use super::trajectory::{Event, EventKind, Sampling, Seen, Statistics, Summary};
use crate::error::{SimError, require};
use crate::plan::Plan;
use crate::state::{EXACT, Moment, STEPS};
use serde::Serialize;

/// The tolerance of a tighter run, as a share of that of the run before it.
pub(super) const RATIO: f64 = 0.1;
/// Of the integrator: the length of a step goes with this root of the tolerance.
const ORDER: f64 = 8.0;
/// Events in a row by which two runs agree again.
const AGREED: usize = 3;

/// The estimated errors of the numbers of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunError {
    /// The tolerances of the tighter runs.
    pub tighter: Vec<f64>,
    /// Of the final state; `None` without an estimate.
    #[serde(rename = "final", skip_serializing_if = "Option::is_none")]
    pub last: Option<StateError>,
    /// Of the states at the sampled times; `None` from where there is no estimate.
    #[serde(skip)]
    pub samples: Vec<Option<StateError>>,
    /// Of the times of the events, s, in their order; `None` for one that a tighter run does not have.
    #[serde(skip)]
    pub events: Vec<Option<f64>>,
    /// Where and why there is no estimate of the final state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown: Option<Broken>,
}

impl RunError {
    /// The largest of the final state and of the times of events; `None` without an estimate.
    pub(super) fn largest(&self) -> Option<f64> {
        let last = self.last.as_ref()?;
        Some(largest(last.q.iter().chain(&last.qd).chain(self.events.iter().flatten())))
    }
}

/// The estimated errors of a state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateError {
    /// Of q, as a displacement: nv numbers, rad, m; of a floating joint along and about the axes of its link.
    pub q: Vec<f64>,
    /// Of q̇: nv numbers, rad/s, m/s.
    pub qd: Vec<f64>,
}

/// A run as far as it is compared.
pub(super) struct Outline {
    pub events: Vec<Event>,
    moments: Vec<Moment>,
    pub summary: Summary,
}

/// How far two runs are apart.
pub(super) struct Apart {
    /// In the times of one's own events that the other has, s.
    times: Vec<Option<f64>>,
    last: StateError,
    /// Whether the events are the same, but for the number of impacts of an accumulation at one contact.
    pub same: bool,
    /// Whether both end at one event, or at the end of the duration.
    ends: bool,
}

impl Apart {
    pub fn largest(&self) -> f64 {
        largest(self.times.iter().flatten().chain(&self.last.q).chain(&self.last.qd))
    }
}

/// The time at which time steps begin.
pub(super) fn steps(events: &[Event]) -> Option<f64> {
    events.iter().find(|event| matches!(event.kind, EventKind::Steps { .. })).map(|event| event.time)
}

impl Plan {
    /// The errors of a run of this plan: of its events, of its samples at multiples of `every`, and of its end.
    ///
    /// # Errors
    /// [`SimError::Setting`] for a tolerance so tight that no tighter one tells its error; [`SimError::Stopped`]. A tighter run that fails is
    /// no error, but gives no estimate.
    pub fn error_of(
        &self,
        (duration, every): (f64, Option<f64>),
        (events, samples, summary): (&[Event], &[Moment], &Summary),
    ) -> Result<RunError, SimError> {
        let tolerance = self.simulation.tolerance;
        let rule = "no tighter run tells the error of this one: choose 1e-12 or more";
        require(tolerance >= EXACT, "tolerance", tolerance, rule)?;
        let (last, samples_by, events_by) = (None, vec![None; samples.len()], vec![None; events.len()]);
        let mut error = RunError { tighter: Vec::new(), last, samples: samples_by, events: events_by, unknown: None };
        if let Some(time) = steps(events) {
            let reason = "time steps begin, whose error does not follow from the tolerance: see step_error".into();
            return Ok(RunError { unknown: Some(Broken { time, reason }), ..error });
        }
        let (mut others, mut apart) = (Vec::<Outline>::new(), Vec::<Apart>::new());
        let mut tighter = RATIO * tolerance;
        while others.is_empty() || others.len() < 2 && apart.iter().any(|it| !it.same) {
            error.tighter.push(tighter);
            let none =
                |time, why: &str| Some(Broken { time, reason: format!("a run with the tolerance {tighter:e} {why}") });
            let other = match self.tighter(tighter, &summary.statistics).outline(duration, every, true) {
                Err(stopped @ SimError::Stopped { .. }) => return Err(stopped),
                Err(why) => {
                    let time = events.last().map_or(self.simulation.start_time, |event| event.time);
                    return Ok(RunError { unknown: none(time, &format!("fails: {why}")), ..error });
                }
                Ok(other) => other,
            };
            if let Some(time) = steps(&other.events) {
                return Ok(RunError { unknown: none(time, "needs time steps"), ..error });
            }
            let apart_by = self.apart((events, &summary.last), &other)?;
            if !apart_by.ends {
                return Ok(RunError { unknown: none(summary.last.time, "ends at another event"), ..error });
            }
            apart.push(apart_by);
            others.push(other);
            tighter *= RATIO;
        }
        let mut most = 0.0_f64;
        for (k, event) in events.iter().enumerate() {
            let times: Option<Vec<f64>> = apart.iter().map(|it| it.times[k]).collect();
            error.events[k] = times.map(|times| {
                let apart = largest(&times);
                most = most.max(apart);
                estimate(apart, most, event.time.abs())
            });
        }
        error.last = worst(apart.into_iter().map(|it| Some(it.last)), &summary.last);
        for (k, sample) in samples.iter().enumerate() {
            let each = others.iter().map(|other| self.difference(sample, other.moments.get(k)?).ok());
            error.samples[k] = worst(each, sample);
        }
        Ok(error)
    }

    /// The plan with a tighter tolerance than that of a run with these statistics, whose longest steps become shorter, too, as the others: even
    /// where the tolerance did not limit them, the error then follows from it.
    pub(super) fn tighter(&self, tolerance: f64, of: &Statistics) -> Self {
        let mut plan = self.clone();
        let sim = &mut plan.simulation;
        if of.longest_step > 0.0 {
            sim.max_step = sim.max_step.min(of.longest_step);
        }
        sim.max_step *= (tolerance / sim.tolerance).powf(1.0 / ORDER);
        sim.set_tolerance(tolerance);
        plan
    }

    /// The run, with its samples; with one impact more before each end of an accumulation if `later`.
    pub(super) fn outline(&self, duration: f64, every: Option<f64>, later: bool) -> Result<Outline, SimError> {
        let (mut events, mut moments) = (Vec::new(), Vec::new());
        let mut watch = |seen: Seen| match seen {
            Seen::Event(event) => events.push(event.clone()),
            Seen::Moment(moment) => moments.push(moment.clone()),
            _ => {}
        };
        let sampling = Sampling { every, ..Sampling::default() };
        let start = (self.q.as_slice(), self.qd.as_slice());
        let summary = go(&self.simulation, self.in_plane(), start, (duration, later), sampling, &mut watch)?;
        Ok(Outline { events, moments, summary })
    }

    pub(super) fn apart(&self, (events, last): (&[Event], &Moment), other: &Outline) -> Result<Apart, SimError> {
        let (pairs, same) = pair(events, &other.events);
        let last_of_other = other.events.len().checked_sub(1);
        let ends = last.time == other.summary.last.time
            || pairs.last().is_some_and(|pair| pair.is_some() && *pair == last_of_other);
        let apart = |(event, pair): (&Event, Option<usize>)| Some((event.time - other.events[pair?].time).abs());
        let times = events.iter().zip(pairs).map(apart).collect();
        Ok(Apart { times, last: self.difference(last, &other.summary.last)?, same, ends })
    }

    fn difference(&self, own: &Moment, other: &Moment) -> Result<StateError, SimError> {
        let q = self.simulation.chain.difference(&other.q, &own.q)?.into_iter().map(f64::abs).collect();
        Ok(StateError { q, qd: own.qd.iter().zip(&other.qd).map(|(a, b)| (a - b).abs()).collect() })
    }
}

/// The errors of a state, from its differences from others; `None` if one is missing.
fn worst(mut differences: impl Iterator<Item = Option<StateError>>, of: &Moment) -> Option<StateError> {
    let StateError { mut q, mut qd } = differences.next()??;
    for other in differences {
        let other = other?;
        q.iter_mut().zip(other.q).for_each(|(most, apart)| *most = most.max(apart));
        qd.iter_mut().zip(other.qd).for_each(|(most, apart)| *most = most.max(apart));
    }
    let estimates = |apart: Vec<f64>, numbers: &[f64]| {
        let (most, size) = (largest(&apart), largest(numbers));
        apart.into_iter().map(|apart| estimate(apart, most, size)).collect()
    };
    Some(StateError { q: estimates(q, &of.q), qd: estimates(qd, &of.qd) })
}

fn largest<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> f64 {
    numbers.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// The estimate of an error, from the difference of the runs, the largest one of its kind, and the size of its numbers.
fn estimate(apart: f64, most: f64, size: f64) -> f64 {
    apart + RATIO * most + EXACT * size
}

/// The index of the event of the other run for each of one's own, and whether the events are the same, but for the number of impacts of an
/// accumulation at one contact.
fn pair(own: &[Event], others: &[Event]) -> (Vec<Option<usize>>, bool) {
    let [own, others] = [own, others].map(|events| events.iter().map(|event| event.kind.mark()).collect::<Vec<_>>());
    let mut pairs = vec![None; own.len()];
    let (mut i, mut j, mut same) = (0, 0, true);
    loop {
        match (own.get(i), others.get(j)) {
            (None, None) => return (pairs, same),
            (one, other) if one == other => {
                pairs[i] = Some(j);
                (i, j) = (i + 1, j + 1);
            }
            _ => {
                let (a, b) = agreement(&own[i..], &others[j..]);
                // The end of an accumulation may be the first event in which they agree again.
                let mut block = own[i..].iter().take(a + 1).chain(others[j..].iter().take(b + 1));
                let mut passed = own[i..i + a].iter().chain(&others[j..j + b]);
                let end = block.find(|(kind, ..)| *kind == "zeno");
                same &= end.is_some_and(|end| passed.all(|event| event.1 == end.1));
                (i, j) = (i + a, j + b);
            }
        }
    }
}

/// The fewest events of both that are passed over until [`AGREED`] agree, or both end. If there are more than the impacts that an accumulation
/// with the restitution 0.996 has while its speed falls to a tenth, all of them.
fn agreement<T: PartialEq>(own: &[T], others: &[T]) -> (usize, usize) {
    let agree = |a: usize, b: usize| {
        let next = |events: &[T]| events.len().min(AGREED);
        let (own, others) = (&own[a..], &others[b..]);
        own[..next(own)] == others[..next(others)]
    };
    let mut splits = (0..=(own.len() + others.len()).min(10 * STEPS)).flat_map(|both| {
        let least = both.saturating_sub(others.len());
        (least..=both.min(own.len())).map(move |a| (a, both - a))
    });
    splits.find(|&(a, b)| agree(a, b)).unwrap_or((own.len(), others.len()))
}

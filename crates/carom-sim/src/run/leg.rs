//! One smooth leg of motion: integrated until its end or until a guard reaches zero.
//!
//! When a guard fires: `observer.rs`.
//!
//! **Exact time.** The dense output of the step brackets the root. The state there is then computed by integrating again
//! from the start of the step to this time, and the time is corrected by w/ẇ until the guard is zero to rounding. So the
//! error of an event is that of the integration, not that of its interpolation.
//!
//! **Short legs.** The method of order 8 evaluates the motion 12 times in a step and 3 times for its dense output, which allows long
//! steps; where events end legs before three of them, order 5 with 6 evaluations for both is cheaper. A leg after a short one begins with
//! order 5, and goes on with order 8 after 10 steps. Its dense output is of order 4, so that it serves tolerances from [`EQUAL`] on.

use super::flow::{Flow, System};
use super::guard::GuardValue;
use super::observer::{Crossing, Observer};
use super::sampler::Sampler;
use super::trajectory::Statistics;
use crate::error::{SimError, ended};
use crate::model::Integrator;
use crate::state::{EQUAL, MAX_STEPS, ROUNDING, STEPS};
use ivp::matrix::MatrixStorage;
use ivp::methods::{DOP853, DOPRI5, RADAU};
use ivp::status::Status;

/// The end of a leg.
#[derive(Debug, Clone)]
pub(crate) struct LegEnd {
    pub time: f64,
    pub y: Vec<f64>,
    /// The guard that fired.
    pub fired: Option<usize>,
    /// Why the integrator could not go on, if it could not: the state is that of its last step.
    pub stalled: Option<String>,
    /// The length of the last step, s, if it succeeded.
    pub step: Option<f64>,
    /// Whether the leg was so short beside its steps that order 5 is better for one like it.
    pub short: bool,
}

/// Settings of the integration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Accuracy {
    pub tolerance: f64,
    pub max_step: f64,
    pub integrator: Integrator,
    /// Of a leg that may end early, where it is stiff, because the caller then has a fallback: it takes up to this number times [`STEPS`]
    /// steps for each of maximal length, and is first examined for stiffness after its square times as many. Slow slip that stays slow needs
    /// hundreds.
    pub patience: Option<usize>,
    /// Length of the first step, s. Without it the integrator guesses it from the rate of the state at two places, which is too long
    /// by orders of magnitude where slip is slow.
    pub first_step: Option<f64>,
    /// Whether the explicit integrator begins with order 5.
    pub short: bool,
}

/// How an integration ended.
struct Ended {
    /// Whether the method of order 5 has stopped before the end, after 10 steps.
    paused: bool,
    /// The length of the next step, s.
    step: f64,
}

/// Integrates `flow` from `(start, y)` to `end`, or to the first guard that fires, and calls the sampler.
pub(crate) fn leg(
    flow: &mut dyn Flow,
    start: f64,
    y: &[f64],
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
    sampler: &mut Sampler,
) -> Result<LegEnd, SimError> {
    let mut now = Vec::new();
    flow.guards(start, y, &mut now)?;
    let system = System::new(flow);
    let mut observer = Observer::new(&system, (start, y), now, Some(sampler));
    let mut accuracy = accuracy;
    let mut ended = integrate(&system, start, y, end, accuracy, statistics, &mut observer);
    if let Ok(Ended { paused: true, step }) = ended {
        accuracy = Accuracy { short: false, first_step: Some(step), ..accuracy };
        let (start, y) = (observer.reached, observer.y_before.clone());
        ended = integrate(&system, start, &y, end, accuracy, statistics, &mut observer);
    }
    let left = end - observer.reached;
    let (stalled, step) = match ended {
        // The integrators refuse steps shorter than the rounding of the time. A rest of this length is zero.
        Err(SimError::Integration { .. }) if left <= ROUNDING * end.abs() => (None, None),
        Err(SimError::Integration { reason, .. }) => (Some(reason), None),
        done => (None, Some(done?.step)),
    };
    let Observer { found, y_before, reached, longest, .. } = observer;
    statistics.longest_step = statistics.longest_step.max(longest);
    let length = found.as_ref().map_or(reached, |found| found.time) - start;
    let short = accuracy.tolerance >= EQUAL && (accuracy.short || length <= 3.0 * longest);
    let time = if stalled.is_some() { reached } else { end };
    match found {
        None => Ok(LegEnd { time, y: y_before, fired: None, stalled, step, short }),
        Some(found) => {
            let (start, y) = (found.start, found.y.clone());
            match refine(&system, found, accuracy, statistics) {
                // Forces that grow without bound towards the event.
                Err(SimError::Integration { reason, .. }) => {
                    Ok(LegEnd { time: start, y, fired: None, stalled: Some(reason), step: None, short })
                }
                done => done.map(|end| LegEnd { step, short, ..end }),
            }
        }
    }
}

/// The state at the exact time of an event: integrated again from the start of its step, with the time corrected until the
/// guard is zero to rounding.
fn refine(
    system: &System,
    found: Crossing,
    accuracy: Accuracy,
    statistics: &mut Statistics,
) -> Result<LegEnd, SimError> {
    let Crossing { guard, level, start, end, y, mut time } = found;
    let mut exact = y.clone();
    let mut correction = f64::INFINITY;
    for _ in 0..8 {
        // A step must not be shorter than the rounding of the time.
        if time - start > ROUNDING * time.abs() {
            // By the midpoint rule, where its error, of third order, is below rounding.
            if correction.abs() <= ROUNDING.cbrt() * (time - start) {
                statistics.evaluations += 2;
                exact = system.midpoint((time - correction, &exact), correction)?;
            } else {
                exact = last(system, (start, &y), time, accuracy, statistics)?;
            }
        }
        statistics.refinements += 1;
        let there = system.0.borrow_mut().flow.guard(guard, time, &exact)?;
        let GuardValue { value, rate: Some(rate), .. } = there else { break };
        correction = (level - value) / rate;
        let negligible = correction.abs() <= 4.0 * f64::EPSILON * time.abs().max(time - start);
        // A gap is a difference of positions and is exact to their rounding only.
        let reached = there.is_gap && (level - value).abs() <= 0.05 * there.least();
        if negligible || reached || !(start..=end).contains(&(time + correction)) {
            break;
        }
        time += correction;
    }
    Ok(LegEnd { time, y: exact, fired: Some(guard), stalled: None, step: None, short: false })
}

/// The state at `end`, before or after `start`, by a smooth motion without events.
pub(crate) fn pass(
    flow: &mut dyn Flow,
    from: (f64, &[f64]),
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
) -> Result<Vec<f64>, SimError> {
    last(&System::new(flow), from, end, accuracy, statistics)
}

fn last(
    system: &System,
    (start, y): (f64, &[f64]),
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
) -> Result<Vec<f64>, SimError> {
    let mut observer = Observer::new(system, (start, y), Vec::new(), None);
    integrate(system, start, y, end, accuracy, statistics, &mut observer)?;
    Ok(observer.y_before)
}

fn integrate(
    system: &System,
    start: f64,
    y: &[f64],
    end: f64,
    accuracy: Accuracy,
    statistics: &mut Statistics,
    observer: &mut Observer,
) -> Result<Ended, SimError> {
    let failed = |reason: String| SimError::Integration { time: start, reason };
    let longest = accuracy.max_step.min((end - start).abs());
    let longest_steps = 1 + ((end - start).abs() / longest) as usize;
    let max_steps = accuracy.patience.map_or(MAX_STEPS, |times| MAX_STEPS.min(STEPS * times * longest_steps));
    // One tolerance for each component: Radau of ivp 0.6 converts a tolerance in place once for each component, which makes
    // a scalar tolerance 1e-3 whatever it was.
    let mut absolute = system.0.borrow().flow.units(y.len());
    absolute.iter_mut().for_each(|unit| *unit *= 1e-3 * accuracy.tolerance);
    let (relative, absolute) = (vec![accuracy.tolerance; y.len()].into(), absolute.into());
    let solved = match accuracy.integrator {
        Integrator::DormandPrince => {
            // Integration to a known time within an accepted step: a single step, without dense output.
            let dense = observer.sampler.is_some();
            let first = if dense { accuracy.first_step.map(|h| h.min(longest)) } else { Some(end - start) };
            macro_rules! solve {
                ($method:ident, $max_steps:expr) => {
                    $method::builder()
                        .max_step(longest)
                        .maybe_first_step(first)
                        .dense_output(dense)
                        .stiff_test(accuracy.patience.map_or(usize::MAX, |times| STEPS * times.pow(2)))
                        .max_steps($max_steps)
                        .build()
                        .solve(system, start, y, end, relative, absolute, Some(observer))
                };
            }
            if accuracy.short {
                solve!(DOPRI5, if dense { STEPS / 6 } else { max_steps })
            } else {
                solve!(DOP853, max_steps)
            }
        }
        Integrator::Radau => {
            // Radau of ivp 0.6 compares every step with the end but the first, which is 1e-6 s long by default.
            let method = RADAU::builder()
                .max_step(longest)
                .first_step((0.1 * accuracy.max_step).min((end - start).abs() / 2.0))
                .max_steps(max_steps)
                .mass_storage(MatrixStorage::Identity)
                .build();
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
    let paused = accuracy.short && observer.sampler.is_some() && solved.status == Status::NeedLargerNMax;
    if paused || solved.status.is_success() {
        return Ok(Ended { paused, step: solved.h.abs() });
    }
    Err(failed(ended(solved.status).into()))
}

#[cfg(test)]
mod tests {
    use super::super::sampler::Told;
    use super::super::trajectory::Sampling;
    use super::*;

    /// A flow with the rate 1, whose guards are gaps that depend on time alone.
    struct Clock<F> {
        gaps: F,
        /// The latest time at which the rate was evaluated.
        latest: f64,
    }

    impl<F: Fn(f64) -> Vec<GuardValue>> Flow for Clock<F> {
        fn rate(&mut self, t: f64, _: &[f64], out: &mut [f64]) -> Result<(), SimError> {
            self.latest = self.latest.max(t);
            out.fill(1.0);
            Ok(())
        }
        fn steps(&mut self, _: f64, _: &[f64], out: &mut [f64]) -> Result<(), SimError> {
            out.fill(1e-8);
            Ok(())
        }
        fn guards(&mut self, t: f64, _: &[f64], out: &mut Vec<GuardValue>) -> Result<(), SimError> {
            *out = (self.gaps)(t);
            Ok(())
        }
        fn guard(&mut self, k: usize, t: f64, _: &[f64]) -> Result<GuardValue, SimError> {
            Ok((self.gaps)(t)[k])
        }
        fn told(&mut self, _: f64, _: &[f64], _: bool) -> Result<Told, SimError> {
            Ok(Told::default())
        }
        fn close(&mut self, _: &mut [f64]) -> Result<(), SimError> {
            Ok(())
        }
        fn settle(&mut self, _: f64, _: &mut [f64]) -> Result<bool, SimError> {
            Ok(false)
        }
    }

    /// One leg of a [`Clock`] from time 0 with y = 1, and its latest evaluation.
    fn run(gap: impl Fn(f64) -> GuardValue, end: f64, integrator: Integrator) -> (LegEnd, Statistics, f64) {
        run_all(|t| vec![gap(t)], end, integrator)
    }

    fn run_all(gaps: impl Fn(f64) -> Vec<GuardValue>, end: f64, integrator: Integrator) -> (LegEnd, Statistics, f64) {
        run_from(gaps, (0.0, end), integrator)
    }

    fn run_from(
        gaps: impl Fn(f64) -> Vec<GuardValue>,
        (start, end): (f64, f64),
        integrator: Integrator,
    ) -> (LegEnd, Statistics, f64) {
        let mut flow = Clock { gaps, latest: 0.0 };
        let accuracy =
            Accuracy { tolerance: 1e-9, max_step: 1.0, integrator, patience: None, first_step: None, short: false };
        let mut statistics = Statistics::default();
        let sampling = Sampling::default();
        let mut sampler = Sampler { sampling, sizes: (1, 0), count: 0, until: 0.0, watch: &mut |_| {}, path: None };
        let found = leg(&mut flow, start, &[1.0], end, accuracy, &mut statistics, &mut sampler).unwrap();
        (found, statistics, flow.latest)
    }

    /// The integrators refuse steps shorter than the rounding of the time.
    #[test]
    fn a_leg_that_has_reached_its_end_to_rounding_has_ended() {
        for integrator in [Integrator::DormandPrince, Integrator::Radau] {
            let end = 1.0_f64.next_up();
            let (found, ..) = run_from(|_| vec![GuardValue::gap((1.0, 0.0), ROUNDING)], (1.0, end), integrator);
            assert_eq!((found.time, found.fired, found.stalled), (end, None, None), "{integrator:?}");
        }
    }

    /// A gap 0.1 − x² + 1.1 x³ with x = 1 − t/T closes within the step of length T and is stationary, open, at its end.
    #[test]
    fn a_gap_that_is_stationary_at_the_end_of_its_step_is_not_missed() {
        let end = 2.0_f64.powi(-10); // shorter than the first step, so that there is one step only
        let gap = |t: f64| {
            let x = 1.0 - t / end;
            GuardValue::gap((0.1 - x * x + 1.1 * x.powi(3), (2.0 * x - 3.3 * x * x) / end), ROUNDING)
        };
        assert_eq!(gap(end), GuardValue::gap((0.1, 0.0), ROUNDING));
        let (found, statistics, _) = run(gap, end, Integrator::DormandPrince);
        assert_eq!((found.fired, statistics.steps - statistics.refinements), (Some(0), 1));
        // Values of size one are exact to some units of rounding.
        let there = gap(found.time);
        assert!(there.value.abs() < 8.0 * f64::EPSILON && there.rate < Some(0.0), "{there:?} at {}", found.time);
    }

    /// Two parts approach, overlap up to a depth at which they count as apart, and are that deep at the end of the only step.
    #[test]
    fn parts_that_pass_each_other_within_a_step_touch() {
        let end = 2.0_f64.powi(-10);
        let gap = |t: f64| {
            let value = 0.3 * end - t;
            if value < -0.1 * end {
                GuardValue::gap((f64::INFINITY, 0.0), ROUNDING)
            } else {
                GuardValue::gap((value, -1.0), ROUNDING)
            }
        };
        let (found, _, _) = run(gap, end, Integrator::DormandPrince);
        assert_eq!(found.fired, Some(0));
        assert!((found.time / (0.3 * end) - 1.0).abs() < 1e-14, "{}", found.time / end);
    }

    /// A line of the first body strikes and leaves its face, too shortly for the times that are examined; the point that follows it is
    /// below zero as soon as it faces the other body.
    #[test]
    fn the_part_that_struck_first_is_found_by_the_part_whose_gap_jumps() {
        let end = 2.0_f64.powi(-10);
        let gaps = |t: f64| {
            let (gap, faces) = (0.301 * end - t, t < 0.302 * end);
            let apart = GuardValue::gap((f64::INFINITY, 0.0), ROUNDING);
            let there = GuardValue::gap((gap, -1.0), ROUNDING);
            vec![if faces { apart } else { there }, if faces { there } else { apart }]
        };
        let (found, _, _) = run_all(gaps, end, Integrator::DormandPrince);
        assert_eq!(found.fired, Some(1));
        assert!((found.time / (0.301 * end) - 1.0).abs() < 1e-14, "{}", found.time / end);
    }

    /// Beyond its end the forces may be others, for instance those of the next row of a table.
    #[test]
    fn a_leg_is_not_evaluated_beyond_its_end() {
        for integrator in [Integrator::DormandPrince, Integrator::Radau] {
            for end in [1e-14, 5e-7, 2e-6, 1e-3, 3.0] {
                let (found, _, latest) = run(|_| GuardValue::gap((1.0, 0.0), ROUNDING), end, integrator);
                assert_eq!((found.time, found.fired), (end, None));
                // The last step ends at the rounded sum of its start and its length.
                assert!((latest / end - 1.0).abs() < 1e-15, "{integrator:?}: {latest} beyond {end}");
                assert!((found.y[0] - 1.0 - end).abs() < 1e-14, "{integrator:?}: {:?}", found.y);
            }
        }
    }
}

//! The event at the end of a leg as a map E from time and state before it to time and state after it, which `sensitivity.rs`
//! differentiates.

use super::guard::Ending;
use super::guard::{Guard, GuardValue, Is, look};
use super::history::History;
use super::run_state::Run;
use crate::error::SimError;
use crate::motion::ActiveSet;
use crate::state::Space;
use nalgebra::DVector;

/// Step of the differences of guards.
pub(crate) const WIDE: f64 = 1e-4;

/// The end of a leg, before its event.
pub(crate) struct Before {
    pub time: f64,
    pub x: DVector<f64>,
    /// f⁻.
    pub f: DVector<f64>,
    pub ending: Ending,
    /// The guard that fired, and its rate.
    pub guard: Option<Guard>,
    pub rate: f64,
    /// Of a gap the displacement that increases it by 1, of least size.
    pub normal: Option<DVector<f64>>,
    pub active: ActiveSet,
    pub history: History,
}

/// What an event has led to.
pub(crate) struct After {
    pub time: f64,
    pub x: DVector<f64>,
    /// f⁺.
    pub f: DVector<f64>,
    pub active: ActiveSet,
}

/// A guard.
pub(crate) fn value<A: Space>(run: &mut Run<A>, guard: Guard, time: f64, x: &[f64]) -> Result<GuardValue, SimError> {
    let y = run.y_of(x);
    let held = if guard.needs_forces() { Some(run.motion.in_mode(time, &y)?) } else { None };
    let mut found = GuardValue::default();
    look(&mut run.motion, &[guard], (time, &y), held.as_ref(), |value| found = value)?;
    Ok(found)
}

/// ẇ, for guards without a rate of their own by a difference over the time `h`.
pub(crate) fn rate<A: Space>(
    run: &mut Run<A>,
    guard: Guard,
    (time, x): (f64, &[f64]),
    (f, h): (&DVector<f64>, f64),
) -> Result<f64, SimError> {
    if let Some(own) = value(run, guard, time, x)?.rate {
        return Ok(own);
    }
    let mut at = |times: f64| {
        let x = DVector::from_column_slice(x) + f * (times * h);
        value(run, guard, time + times * h, x.as_slice()).map(|it| it.value)
    };
    Ok((at(1.0)? - at(-1.0)?) / (2.0 * h))
}

/// ∂w/|∂w|² of a gap, by the displacements; `None` where none of them changes it.
pub(crate) fn normal<A: Space>(
    probe: &mut Run<A>,
    guard: Guard,
    time: f64,
    x: &[f64],
) -> Result<Option<DVector<f64>>, SimError> {
    let nv = probe.motion.sim.chain.nv();
    let tangent = probe.tangent(x).columns(0, nv).into_owned();
    let here = DVector::from_column_slice(x);
    let mut slope = DVector::zeros(nv);
    for j in 0..nv {
        let mut at = |h: f64| value(probe, guard, time, (&here + tangent.column(j) * h).as_slice()).map(|it| it.value);
        slope[j] = (at(WIDE)? - at(-WIDE)?) / (2.0 * WIDE);
    }
    let size = slope.norm_squared();
    Ok((size > 0.0).then(|| tangent * (slope / size)))
}

/// E: the state and the time after an event, of a state beside that of the event, which is first moved onto the constraints and
/// to the zero of the guard: along f, or of a gap along its normal, because the last contacts of an accumulation close too
/// slowly for a distance of second order.
///
/// Where slip stops, both of its components vanish: the slower the slip, the faster its direction turns towards the one in which
/// all neighbouring motions stop. What is left of the component across that direction is taken out by the friction that does so.
pub(crate) fn outcome<A: Space>(
    run: &mut Run<A>,
    before: &Before,
    after: &ActiveSet,
    (mut time, x): (f64, &[f64]),
    end: f64,
) -> Result<(DVector<f64>, f64), SimError> {
    run.motion.active = before.active.clone();
    let mut y = run.y_of(x);
    let remembered = &x[y.len() - 2..];
    run.motion.sim.normalise(&mut y);
    run.motion.settle(time, &mut y)?;
    if let Some(guard) = before.guard {
        for _ in 0..3 {
            let x = run.x_of(&y, remembered);
            let beyond = value(run, guard, time, &x)?.value;
            let moved = if let Some(normal) = &before.normal {
                DVector::from_vec(x) - normal * beyond
            } else {
                let span = -beyond / before.rate;
                time += span;
                DVector::from_vec(x) + &before.f * span
            };
            y = run.y_of(moved.as_slice());
            run.motion.sim.normalise(&mut y);
            run.motion.settle(time, &mut y)?;
        }
        if matches!(guard.is(), Is::Slip { .. }) {
            run.motion.straighten(after, time, &mut y)?;
            run.motion.active = after.clone();
            run.motion.settle(time, &mut y)?;
            run.motion.active = before.active.clone();
        }
        run.y_of(x); // what compliant contacts remember is not moved
    }
    (run.time, run.y, run.end) = (time, y, end);
    run.history.clone_from(&before.history);
    run.act(before.ending)?;
    Ok((DVector::from_vec(run.x()), run.time))
}

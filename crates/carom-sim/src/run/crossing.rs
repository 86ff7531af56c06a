//! The event at the end of a leg as a map E from time and state before it to time and state after it, which `event_derivative.rs`
//! differentiates; and its derivative in closed form where it is the impact of one touch that opens again.

use super::changed::{AT, WEIGHTS};
use super::guard::Ending;
use super::guard::{Guard, GuardValue, look};
use super::history::History;
use super::run_state::Run;
use crate::error::SimError;
use crate::impact::{Derivatives, RowRates, differentiate};
use crate::model::Place;
use crate::motion::{ActiveSet, Dry};
use crate::state::{CLEAR, Space};
use carom_chain::Rows;
use carom_chain::algebra::z_onto;
use carom_impact::{Frictionless, ImpactProblem, Law};
use nalgebra::{DVector, Matrix3, Vector3};

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

/// The derivative of a guard along a line on which it has these values at 0 and at −2, −1, 1 and 2 steps: of fourth order. That of
/// [`Guard::Admissible`] is constant but beyond its zero, where forces are missing: on that side, of second order.
pub(crate) fn slope(guard: Guard, here: f64, at: [f64; 4], step: f64) -> f64 {
    let one_sided = |first: f64, second: f64| (4.0 * first - second - 3.0 * here) / 2.0;
    let slope = match guard {
        Guard::Admissible if at[3] < at[0] => one_sided(at[2], at[3]),
        Guard::Admissible => -one_sided(at[1], at[0]),
        _ => at.iter().zip(WEIGHTS).map(|(value, weight)| value * weight).sum(),
    };
    slope / step
}

/// ẇ, for guards without a rate of their own by a difference over the time `h`.
pub(crate) fn rate<A: Space>(
    run: &mut Run<A>,
    guard: Guard,
    (time, x): (f64, &[f64]),
    (f, h): (&DVector<f64>, f64),
) -> Result<f64, SimError> {
    let here = value(run, guard, time, x)?;
    if let Some(own) = here.rate {
        return Ok(own);
    }
    let mut at = |times: f64| {
        let x = DVector::from_column_slice(x) + f * (times * h);
        value(run, guard, time + times * h, x.as_slice()).map(|it| it.value)
    };
    let [a, b, c, d] = AT.map(&mut at);
    Ok(slope(guard, here.value, [a?, b?, c?, d?], h))
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
        if matches!(guard, Guard::SlipStops(_) | Guard::JointStops(_)) {
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

/// The derivatives of the impact of one touch.
pub(crate) struct Struck {
    /// Of q̇⁺.
    pub jumped: Derivatives,
    /// Of the gap by q in its tangent space, nv.
    pub gap: Vec<f64>,
}

impl Struck {
    /// By the coefficient that a parameter changes.
    pub fn coefficient(&self, place: Place) -> &DVector<f64> {
        if matches!(place, Place::Restitution) { &self.jumped.restitution } else { &self.jumped.friction }
    }
}

/// The derivatives of the impact of one touch, in closed form: by q (in its tangent space), q̇⁻, time and coefficients.
///
/// Closed loops L q̇ = 0 bear the impulses Λ P: M X = Jᵀ + LᵀΛ with L X = 0. So the impact has the derivatives of one with the rows
/// J̃ = J + ΛᵀL at constant Λ, which have the same H and u; and where L turns by δL the jump must do so: L δΔq̇ = −δL Δq̇.
///
/// `None` for a user's law and a restitution that depends on the approach speed, at the border of a mode of the law, where another gap is closed,
/// and where the impact would move a joint that dry friction holds.
pub(crate) fn jump<A: Space>(run: &mut Run<A>, touch: usize, before: &Before) -> Result<Option<Struck>, SimError> {
    run.motion.active = before.active.clone();
    let (time, x) = (before.time, before.x.as_slice());
    let (nq, nv, sim) = (run.motion.sim.chain.nq(), run.motion.sim.chain.nv(), run.motion.sim);
    let y = run.y_of(x);
    let gaps = run.motion.all_gaps(time, &y, |_, _| false)?;
    let scale = &run.motion.scale;
    if gaps.iter().any(|&(k, (gap, _))| k != touch && gap <= scale.touching(k)) {
        return Ok(None);
    }
    let one = &sim.touches[touch];
    if one.contact.law.by_speed.is_some() {
        return Ok(None);
    }
    // The columns of J and the velocity of the surface, in contact axes.
    let rows = |run: &mut Run<A>, time: f64, q: &[f64]| -> Result<DVector<f64>, SimError> {
        let near = one.near(time);
        let one = near.as_ref().unwrap_or(one);
        let view = run.motion.view(q)?;
        let at = one.at(&view, q, time);
        let (mut rows, mut surface) = (Rows::new(nv), Vector3::zeros());
        if let Some(place) = at.surface {
            let axes = z_onto(place.normal);
            axes.column_iter().try_for_each(|axis| place.row_into(&view, axis.into(), rows.add()))?;
            surface = axes.tr_mul(&one.surface_velocity(&place, time));
        } else {
            rows.add();
            rows.add();
            one.row_into(&at, &view, rows.add())?;
        }
        let columns = (0..nv).flat_map(|i| [0, 1, 2].map(|k| rows.row(k)[i]));
        Ok(DVector::from_iterator(3 * nv + 3, columns.chain(surface.iter().copied())))
    };
    let split = |numbers: &[f64]| {
        let mut columns: Vec<Vector3<f64>> = numbers.chunks(3).map(Vector3::from_column_slice).collect();
        let surface = columns.pop().unwrap_or_default();
        (columns, surface)
    };
    let (q, qd) = (&x[..nq], &x[nq..nq + nv]);
    let (mut columns, surface) = split(rows(run, time, q)?.as_slice());
    let mut view = run.motion.view(q)?;
    let (mut along, mut answers) = (Rows::new(nv), Rows::default());
    for axis in 0..3 {
        along.add().iter_mut().zip(&columns).for_each(|(entry, column)| *entry = column[axis]);
    }
    view.respond(&along, &mut answers)?;
    let response: Vec<Vector3<f64>> = (0..nv).map(|i| Vector3::from_fn(|axis, _| answers.row(axis)[i])).collect();
    let mut holds = before.active.dry.iter().filter(|joint| joint.state == Dry::Holds);
    if holds.any(|joint| response[joint.v] != Vector3::zeros()) {
        return Ok(None);
    }
    let delassus: Matrix3<f64> = columns.iter().zip(&response).map(|(j, x)| j * x.transpose()).sum();
    let u = columns.iter().zip(qd).map(|(j, v)| j * *v).sum::<Vector3<f64>>() - surface;
    let plain = Frictionless { restitution: one.contact.law.restitution() };
    let law: &dyn Law<f64, 3> = if one.link().is_some() { &*one.contact.law } else { &plain };
    let problem = ImpactProblem::from_gram(delassus, u)?;
    let (Ok(borders), Ok(law)) = (problem.boundaries(law), problem.differentiate(law)) else { return Ok(None) };
    if borders.first().is_some_and(|nearest| nearest.margin <= CLEAR) {
        return Ok(None);
    }
    let gap = columns.iter().map(|column| column.z).collect();
    let jump: Vec<f64> = response.iter().map(|x| x.dot(&law.outcome.impulse)).collect();
    let loops = view.closed()?;
    let mut borne = vec![Vector3::zeros(); loops.as_ref().map_or(0, |loops| loops.rows.len())];
    if let Some(loops) = &loops {
        let mut open = Rows::default();
        view.kin.respond(&along, &mut open)?;
        (0..3).for_each(|axis| loops.forces(open.row(axis), None).for_each(|(row, force)| borne[row][axis] = force));
        for (row, borne) in loops.rows.iter().zip(&borne) {
            columns.iter_mut().zip(row).for_each(|(column, l)| *column += borne * *l);
        }
    }
    // The columns of J̃, the velocity of the surface, and L Δq̇.
    let in_loops = |run: &mut Run<A>, time: f64, q: &[f64]| -> Result<DVector<f64>, SimError> {
        let numbers = rows(run, time, q)?;
        if borne.is_empty() {
            return Ok(numbers);
        }
        let mut numbers: Vec<f64> = numbers.data.into();
        let turned = run.motion.view(q)?.loop_rows()?;
        for (row, borne) in turned.iter().zip(&borne) {
            (0..nv).for_each(|i| (0..3).for_each(|k| numbers[3 * i + k] += row[i] * borne[k]));
        }
        numbers.extend((0..turned.len()).map(|row| turned.dot(row, &jump)));
        Ok(numbers.into())
    };
    let size = 3 * nv + 3;
    let tangent = run.tangent(x);
    let mut rates = RowRates::zeros(nv, nv + 1);
    let mut wanted = vec![vec![0.0; borne.len()]; nv + 1];
    for k in 0..nv {
        let by = run.difference(x, tangent.column(k), f64::INFINITY, |run, x| in_loops(run, time, &x[..nq]))?;
        rates.set(k, split(&by.as_slice()[..size]));
        wanted[k].iter_mut().zip(by.iter().skip(size)).for_each(|(wanted, opened)| *wanted = -opened);
    }
    if one.motion.is_some() {
        let here = DVector::from_vec(vec![1.0]);
        let by = run.difference(&[0.0], here.column(0), f64::INFINITY, |run, by| rows(run, time + by[0], q))?;
        rates.set(nv, split(by.as_slice()));
    }
    let mut view = run.motion.view(q)?;
    let bind = |k: usize, moved: &mut [f64]| loops.iter().for_each(|loops| loops.bind(moved, Some(&wanted[k])));
    let jumped = differentiate(&mut view.kin, qd, (&columns, &rates), &response, &law, bind)?;
    Ok(Some(Struck { jumped, gap }))
}

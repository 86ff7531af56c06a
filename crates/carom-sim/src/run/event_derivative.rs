//! The derivative of an event: its saltation matrix, and the derivatives of its time.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | S⁻, S⁺ | n×k | derivatives before and after an event | – |
//! | w | 1 | the guard that fired | – |
//! | τ′ | k | derivatives of the time of the event | `time_by` |
//! | E | – | the event as a map from (t, x) before it to (t, x) after it | `crossing.rs` |
//! | Ξ | n⁺×n | saltation matrix: S⁺ = Ξ S⁻ + the columns of the parameters | [`LinearEvent`] |
//!
//! An event at w(t, x) = 0 has τ′ = −(∂w S⁻ + ∂ₚw)/ẇ. For a change of the j-th quantity by δ the event takes place at t + τ′ⱼδ in the state
//! x + (S⁻ⱼ + f⁻τ′ⱼ)δ, from which it leads to E. So
//!
//! ```text
//! S⁺ⱼ = dE/dδ − f⁺ dt⁺/dδ
//! ```
//!
//! where t⁺ is the time after the event, which differs from t at the end of an accumulation of impacts. With S⁻ = 1 this is the
//! saltation matrix (Aizerman & Gantmacher 1958; Leine & Nijmeijer 2004, section 7) of every event, whatever it consists of: an impact,
//! the impact of several contacts, the beginning and the end of a contact, slip that stops. Of the impact of one touch that opens again
//! dE/dδ has a closed form; otherwise it is a central difference of fourth order of the program that computes the event, from states that
//! are on the constraints and on w = 0. Where an event changes only what a compliant contact remembers, Ξ is 1 but for its rows.
//!
//! **Where there is no derivative** the events of neighbouring motions are others, and E has a kink or a jump: it is compared
//! with its own second differences, and the modes after the event must be the same.

use super::changed::{CENTRAL, Changed, DIFFERENCE, Stencil};
use super::crossing::{After, Before, Struck, WIDE, jump, normal, outcome, rate, slope, value};
use super::follow::{Follow, Stop};
use super::guard::{Ending, Guard};
use super::linear_run::{Around, LinearEvent, Maps};
use super::run_state::Run;
use super::trajectory::EventKind;
use super::variation::left_inverse;
use crate::error::SimError;
use crate::model::Place;
use crate::motion::{ActiveSet, Dry, Hold, Lasting};
use crate::state::{EXACT, Space};
use nalgebra::{DMatrix, DVector};

/// An event whose guard changes by less than this in the time in which the state changes by its own size is a grazing
/// one.
const GRAZING: f64 = 1e-7;
/// An event whose guard changes by less than this in that time has no derivative of its time that is told: the error of S,
/// about 1e-8, is divided by this rate.
const FAINT: f64 = 1e-3;
/// The share of its approach speed by which an impact may be slower beside the motion, and of the time in which the state changes by its own
/// size by which an event may be later.
const SLOWER: f64 = 1e-2;
/// How often the step of a parameter is shortened to a tenth for a slow impact, at most: seven digits are left then.
const FINEST: usize = 4;
/// A second difference above this share of the first may be a kink.
const KINK: f64 = 0.05;

/// Why an event has none.
const STEPS_BEGIN: &str = "time steps begin, which have no derivative";

/// The number of a parameter, and how often its step is shortened.
type By = (usize, usize);

impl<'a, 'w, A: Space> Follow<'a, 'w, A> {
    /// Ξ, τ′, and what the parameters add; `None` where nothing happens.
    pub(super) fn event(
        &mut self,
        ending: Ending,
        active: &ActiveSet,
        each: &mut dyn Maps,
    ) -> Result<Option<LinearEvent>, Stop> {
        let (time, x) = (self.run.time, self.run.x());
        // The force is continuous where it changes from loading to unloading.
        if let Ending::Fired(Guard::Turns(i)) = ending {
            self.run.act(ending)?;
            if self.run.motion.active.stepping {
                return self.broken(time, STEPS_BEGIN);
            }
            return Ok(Some(self.remembering((time, &x), active, |run| run.turn(i))?));
        }
        let f = self.probe.field(time, &x)?;
        let guard = if let Ending::Fired(guard) = ending { Some(guard) } else { None };
        let pace = self.pace(&x);
        let rate = match guard {
            Some(guard) => rate(&mut self.probe, guard, (time, &x), (&f, DIFFERENCE / pace))?,
            None => 1.0,
        };
        let (history, active) = (self.run.history.clone(), active.clone());
        let mut before =
            Before { time, x: DVector::from_vec(x), f, ending, guard, rate, normal: None, active, history };
        self.run.act(ending)?;
        if self.run.motion.active.stepping {
            return self.broken(time, STEPS_BEGIN);
        }
        let is_force = guard.is_some_and(Guard::is_force);
        let slips = matches!(guard, Some(Guard::SlipStops(_) | Guard::SlipGrows(_)));
        let changes_no_force =
            slips || matches!(guard, Some(Guard::MayClose(..) | Guard::Slackens(..) | Guard::Slider(..)));
        if (guard.is_none() || is_force || changes_no_force) && self.goes_on(&before) {
            return Ok(None);
        }
        if rate == 0.0 || !is_force && rate.abs() <= GRAZING * pace {
            return self.broken(time, "it grazes: a neighbouring motion may miss this event");
        }
        let (x, time_after) = (DVector::from_vec(self.run.x()), self.run.time);
        let rests = time_after >= self.run.end;
        let f = if rests { DVector::zeros(x.len()) } else { self.run.field(time_after, x.as_slice())? };
        let after = After { time: time_after, x, f, active: self.run.motion.active.clone() };
        let closed = match self.struck_alone(&before, &after) {
            Some(touch) => jump(&mut self.probe, touch, &before)?.map(|by| (touch, by)),
            None => None,
        };
        let is_closed =
            |changed: &Changed<A>| closed.is_some() && !matches!(changed.parameter.place(), Place::Anywhere);
        let mut middle = None;
        if closed.is_none() || !self.changed.iter().all(is_closed) {
            self.probe.motion.active = before.active.clone();
            if let Some(guard) = guard.filter(|guard| guard.is_gap() || matches!(guard, Guard::Depth(_))) {
                before.normal = normal(&mut self.probe, guard, time, before.x.as_slice())?;
            }
            let at = (time, before.x.as_slice());
            middle = Some(outcome(&mut self.probe, &before, &after.active, at, self.run.end)?.0);
        }
        let middle = middle.unwrap_or_default();
        let tangent = self.probe.tangent(before.x.as_slice());
        let inverse = left_inverse(&tangent);
        let parameters = self.changed.len();
        let acting =
            |changed: &Changed<A>| !is_closed(changed) && changed.acts(before.time.next_down(), after.time.next_up());
        let acting: Vec<usize> = (0..parameters).filter(|&p| acting(&self.changed[p])).collect();
        // A parameter may make an event so much later, with the same motion, that it is another one: the change of the motion by the
        // parameter compensates most of that. Such a parameter is changed together with the motion, along (S, 1) instead of (0, 1).
        let (mut changes, mut together) = (Vec::with_capacity(acting.len()), Vec::new());
        for p in acting {
            let mut own = DVector::zeros(before.x.len());
            let mut time_by = self.time_by(&own, Some((p, 0)), &before)?;
            let mut shorter = 0;
            // One that may move surfaces on which contacts last changes the state with them.
            let moves = matches!(self.changed[p].parameter.place(), Place::Anywhere)
                && before.active.lasting.iter().any(Lasting::is_rigid);
            if moves || self.share_by((&own, time_by), p, &before)? < 1.0 {
                if let Some(s) = each.columns() {
                    own = s.column(s.ncols() - parameters + p).into_owned();
                }
                time_by = self.time_by(&own, Some((p, 0)), &before)?;
                shorter = (-self.share_by((&own, time_by), p, &before)?.log10()).ceil() as usize;
                if shorter > FINEST {
                    let name = self.changed[p].parameter.name();
                    return self.broken(before.time, &format!("it is too slow for a derivative by {name}"));
                }
                together.push(p);
            }
            changes.push(((p, shorter), own, time_by));
        }
        // In closed form along all directions; otherwise along those in which changes of start and parameters lead, each as far as the
        // others: beside them the constraints and the modes of the motion need not hold.
        let (basis, coordinates) = match &closed {
            Some(_) => (tangent, inverse.clone()),
            None => directions(each.columns().map_or(tangent, |mut s| {
                let first = s.ncols() - parameters;
                // By the size of a parameter, not by its unit: differences along a short column would be rounding.
                for (mut column, changed) in s.columns_mut(first, parameters).column_iter_mut().zip(&self.changed) {
                    column *= changed.parameter.scale();
                }
                let own: Vec<usize> =
                    (0..s.ncols()).filter(|&j| j < first || !together.contains(&(j - first))).collect();
                s.select_columns(&own)
            })),
        };
        let mut map = DMatrix::zeros(after.x.len(), basis.ncols());
        let mut time_by = DVector::zeros(basis.ncols());
        for (j, own) in basis.column_iter().enumerate() {
            let own = own.into_owned();
            let column = match &closed {
                Some((_, by)) => {
                    time_by[j] = by.gap.get(j).map_or(0.0, |slope| -slope / rate);
                    struck((own, time_by[j]), by, &inverse, (&before, &after))
                }
                None => {
                    time_by[j] = self.time_by(&own, None, &before)?;
                    self.column_after((own, time_by[j]), None, &before, (&after, &middle))?
                }
            };
            map.set_column(j, &column);
        }
        let (map, time_by) = (map * &coordinates, coordinates.tr_mul(&time_by));
        let mut push = DMatrix::zeros(after.x.len(), parameters);
        let mut time_push = DVector::zeros(parameters);
        if let Some((touch, by)) = &closed {
            let (sim, changed) = (self.run.motion.sim, &self.changed);
            let own = |p: &usize| is_closed(&changed[*p]) && changed[*p].parameter.is_of(&sim.touches[*touch]);
            for p in (0..parameters).filter(own) {
                push.view_mut((sim.chain.nq(), p), (sim.chain.nv(), 1))
                    .copy_from(by.coefficient(changed[p].parameter.place()));
            }
        }
        for (by, own, time) in changes {
            let (p, _) = by;
            time_push[p] = time - time_by.dot(&own);
            let column = self.column_after((own.clone(), time), Some(by), &before, (&after, &middle))?;
            push.set_column(p, &(column - &map * own));
        }
        let happened: Vec<_> = self.happened.borrow_mut().drain(..).collect();
        // An event with a name, in whose time the motion does not go on by itself.
        let around = (!happened.is_empty() && after.time == before.time).then(|| {
            let moving = 2 * self.run.motion.sim.chain.nv();
            let leads = |inverse: DMatrix<f64>, f: &DVector<f64>, map: DMatrix<f64>, push: &DMatrix<f64>| {
                let inverse = inverse.rows(0, moving).into_owned();
                [&inverse * (map + f * time_by.transpose()), inverse * (push + f * time_push.transpose())]
            };
            let n = before.x.len();
            let none = DMatrix::zeros(n, parameters);
            let inverse_after = left_inverse(&self.run.tangent(after.x.as_slice()));
            Box::new(Around {
                before: leads(inverse, &before.f, DMatrix::identity(n, n), &none),
                after: leads(inverse_after, &after.f, map.clone(), &push),
            })
        });
        Ok(Some(LinearEvent {
            time,
            happened,
            around,
            map,
            push,
            time_by,
            time_push,
            counts: is_force || rate.abs() > FAINT * pace,
        }))
    }

    /// Whether the motion goes on as before. Kinks of forces that change no mode are such, and forces whose zero is located so early that
    /// the mode is chosen once more: its change follows. So is slip that turns by a right angle, and slip from rest that becomes fast enough to define
    /// its direction: friction follows it.
    fn goes_on(&self, before: &Before) -> bool {
        let (run, active) = (&self.run, &before.active);
        let same = |(own, now): (&Lasting, &Lasting)| match (own.hold, now.hold) {
            (Hold::Slides { .. } | Hold::Starts { .. }, Hold::Slides { .. }) => own.touch == now.touch,
            _ => own == now,
        };
        let now = &run.motion.active;
        let lasting = active.lasting.len() == now.lasting.len() && active.lasting.iter().zip(&now.lasting).all(same);
        let modes = lasting && active.dry == now.dry;
        modes && self.happened.borrow().is_empty() && run.time == before.time
    }

    /// The touch of an event that is its impact and nothing else, whose derivative has a closed form.
    fn struck_alone(&self, before: &Before, after: &After) -> Option<usize> {
        let sim = self.run.motion.sim;
        let happened = self.happened.borrow();
        let [event] = happened.as_slice() else { return None };
        let (EventKind::Impact { touch, .. } | EventKind::Limit { touch, .. }) = &event.kind else { return None };
        let gap = before.guard.is_some_and(Guard::is_gap);
        let free = !before.active.lasting.iter().any(Lasting::is_rigid);
        // The impact may turn the direction in which dry friction brakes a joint; a joint that it moves must not be held after it.
        let mut turned = before.active.clone();
        let joints = turned.dry.iter_mut().zip(&after.active.dry);
        joints
            .filter(|(own, other)| own.state != Dry::Holds && other.state != Dry::Holds)
            .for_each(|(own, other)| own.state = other.state);
        let same = turned.is_alike(&after.active) && before.x.len() == after.x.len();
        (gap && free && same && sim.neglect.is_none() && after.time == before.time).then_some(*touch)
    }

    /// τ′ of a change of x, and of a parameter with it.
    fn time_by(&mut self, own: &DVector<f64>, parameter: Option<By>, before: &Before) -> Result<f64, Stop> {
        let Some(guard) = before.guard else { return Ok(0.0) };
        // Guards are smooth, so a larger step has less rounding.
        let (stencil, step) = self.stencil(parameter, WIDE / own.amax().max(1.0))?;
        let mut values = [0.0; 4];
        for (k, (found, times)) in values.iter_mut().zip(stencil.at).enumerate() {
            let beside = &before.x + own * (times * step);
            let run = self.beside(parameter, k)?;
            run.motion.active.clone_from(&before.active);
            *found = value(run, guard, before.time, beside.as_slice())?.value;
        }
        let by = if stencil.is_one_sided() {
            values.iter().zip(stencil.weights).map(|(value, weight)| value * weight / step).sum()
        } else {
            slope(guard, 0.0, values, step) // the event is its zero
        };
        Ok(-by / before.rate)
    }

    /// Where the neighbouring motions are and their step, of a change of x by this step, or of a parameter.
    fn stencil(&mut self, parameter: Option<By>, step: f64) -> Result<(Stencil, f64), Stop> {
        let Some((p, shorter)) = parameter else { return Ok((CENTRAL, step)) };
        let (stencil, by, _) = self.changed[p].runs_at(shorter)?;
        Ok((stencil, by))
    }

    /// The run of one of these motions.
    fn beside(&mut self, parameter: Option<By>, k: usize) -> Result<&mut Run<'a, 'w, A>, Stop> {
        let Some((p, shorter)) = parameter else { return Ok(&mut self.probe) };
        let (.., runs) = self.changed[p].runs_at(shorter)?;
        Ok(&mut runs[k])
    }

    /// What a change of x, and of a parameter with it, becomes by the event. `middle`: the outcome without a change.
    fn column_after(
        &mut self,
        (own, time_by): (DVector<f64>, f64),
        parameter: Option<By>,
        before: &Before,
        (after, middle): (&After, &DVector<f64>),
    ) -> Result<DVector<f64>, Stop> {
        let (stencil, mut h) = self.stencil(parameter, DIFFERENCE / own.amax().max(1.0))?;
        let along = own + &before.f * time_by;
        if parameter.is_none() {
            h *= self.share(before, (&along, time_by), None, h)?;
        }
        let end = self.run.end;
        let mut found = Vec::with_capacity(stencil.at.len());
        for (k, times) in stencil.at.iter().enumerate() {
            let run = self.beside(parameter, k)?;
            let beside = &before.x + &along * (times * h);
            let at = (before.time + times * h * time_by, beside.as_slice());
            match outcome(run, before, &after.active, at, end) {
                Ok(outcome) if run.motion.active.is_alike(&after.active) => found.push(outcome),
                Ok(_) | Err(SimError::Overlap { .. }) => {
                    return self
                        .broken(before.time, "a neighbouring motion goes on in another mode or order of events");
                }
                Err(error) => return Err(error.into()),
            }
        }
        let mut moved = DVector::zeros(after.x.len());
        let mut later = 0.0;
        for ((there, time), weight) in found.iter().zip(stencil.weights) {
            moved += there * (weight / h);
            later += (time - after.time) * (weight / h);
        }
        // Of a smooth outcome the second differences at one and two steps are as 1 : 4, at a kink as 1 : 2, at a jump as 1 : 1.
        // On one side of the place those of the first and of the last three motions are equal, unless the place itself is at a jump.
        let second = |a: &DVector<f64>, b: &DVector<f64>, c: &DVector<f64>| (a + c - b * 2.0).amax() / h;
        let (bends, least) = if stencil.is_one_sided() {
            ([0, 1].map(|k| second(&found[k].0, &found[k + 1].0, &found[k + 2].0)), 1.0 / 3.0)
        } else {
            ([1, 0].map(|k| second(&found[k].0, middle, &found[3 - k].0)), 3.0)
        };
        if bends[0] > KINK * moved.amax().max(1.0) && bends[1] < least * bends[0] {
            return self
                .broken(before.time, "neighbouring motions have other events at the same time, in another order");
        }
        Ok(moved - &after.f * later)
    }

    /// By what the step `h` is too long: the event is later by a time in which the state changes, or the approach speed of a slow impact changes by as
    /// much as itself within a small change of the state, and the outcome is not smooth beyond that.
    fn share(
        &mut self,
        before: &Before,
        (along, time_by): (&DVector<f64>, f64),
        parameter: Option<By>,
        h: f64,
    ) -> Result<f64, Stop> {
        let (stencil, h) = self.stencil(parameter, h)?;
        let later = (SLOWER / (self.pace(before.x.as_slice()) * (time_by * h).abs())).min(1.0);
        let Before { guard: Some(guard), normal: Some(_), time, .. } = *before else { return Ok(later) };
        let k = stencil.beside();
        let run = self.beside(parameter, k)?;
        let step = stencil.at[k] * h;
        run.motion.active.clone_from(&before.active);
        let beside = &before.x + along * step;
        let there = rate(run, guard, (time + time_by * step, beside.as_slice()), (&before.f, DIFFERENCE))?;
        Ok((SLOWER * before.rate.abs() / (there - before.rate).abs()).min(later))
    }

    /// The same of the step of a parameter, and of the motion by `own` with it.
    fn share_by(&mut self, (own, time_by): (&DVector<f64>, f64), p: usize, before: &Before) -> Result<f64, Stop> {
        let along = own + &before.f * time_by;
        self.share(before, (&along, time_by), Some((p, 0)), 0.0)
    }

    /// The largest velocity, 1/s: the reciprocal of the time in which the state changes by its own size.
    fn pace(&self, x: &[f64]) -> f64 {
        let (nq, nv) = (self.run.motion.sim.chain.nq(), self.run.motion.sim.chain.nv());
        x[nq..nq + nv].iter().fold(1.0, |most: f64, v| most.max(v.abs()))
    }
}

/// The directions of the columns of S, of which none counts as longer than one, by QR with column pivoting: orthogonal, each as long as
/// what the columns have beside those before it, the first of size one; and the matrix of the coordinates of x along them. Not by nalgebra's
/// SVD, which loses directions of dependent columns: see [`least_norm`](carom_impact::least_norm).
fn directions(mut s: DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    s.column_iter_mut().for_each(|mut column| column /= column.amax().max(1.0));
    let factors = s.col_piv_qr();
    let (mut basis, upper) = (factors.q(), factors.r());
    let share = |i: usize| (upper[(i, i)] / upper[(0, 0)]).abs();
    let rank = (0..basis.ncols()).take_while(|&i| share(i) > EXACT).count();
    basis.resize_horizontally_mut(rank, 0.0);
    let mut coordinates = basis.transpose();
    for i in 0..rank {
        basis.column_mut(i).scale_mut(share(i));
        coordinates.row_mut(i).unscale_mut(share(i));
    }
    (basis, coordinates)
}

/// What a change of x, with the time of the event that it has, becomes by an impact with these derivatives.
fn struck(
    (own, time_by): (DVector<f64>, f64),
    Struck { jumped: by, .. }: &Struck,
    inverse: &DMatrix<f64>,
    (before, after): (&Before, &After),
) -> DVector<f64> {
    let along = own + &before.f * time_by;
    let nv = by.qd.ncols();
    let moved = inverse * &along;
    let mut jumped = &by.q * moved.rows(0, nv) + &by.qd * moved.rows(nv, nv);
    if let Some(time) = &by.time {
        jumped += time * time_by;
    }
    let nq = along.len() - (moved.len() - nv);
    let mut out = along;
    out.rows_mut(nq, nv).copy_from(&jumped);
    out - &after.f * time_by
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns that lead in fewer directions than they are, equally far or not: they have coordinates along all of these directions.
    #[test]
    fn directions_of_dependent_columns_contain_the_columns() {
        let rng = &mut fastrand::Rng::with_seed(1);
        let mut random = |rows, columns| DMatrix::from_fn(rows, columns, |_, _| rng.f64() - 0.5);
        for k in 0..4000 {
            let (n, columns) = ([3, 6, 14][k % 3], [3, 6, 15][k / 3 % 3]);
            let rank = 1 + k % (n.min(columns) - 1);
            let (mut along, mut shares) = (random(n, rank), random(columns, rank));
            if k % 2 == 0 {
                (along, shares) = (along.qr().q(), shares.qr().q());
            }
            let s = along * shares.transpose();
            let (basis, coordinates) = directions(s.clone());
            assert_eq!(basis.ncols(), rank, "{k}");
            let left = &basis * (&coordinates * &s) - &s;
            assert!(left.amax() < 1e-13, "{k}: {left}");
        }
    }
}

//! The conditions and the cost of a motion, and their derivatives by the unknowns.
//!
//! A number g of the final state, of a state at an impact, of an impulse, or an integral over the motion has the derivative
//! ∂g/∂u = Σ λᵀ ∂x₀/∂u + ∂g/∂p ∂p/∂u, with λ from the run in reverse; of an unknown that changes the duration T also ∂g/∂x ẋ(T).
//!
//! In [segments](super::segments) each has a run of its own, and x₀ of all but the first is unknown.

use super::function::{Function, Point, Slope, difference_within};
use super::problem::{Place, Problem};
use super::segments::Part;
use super::unknown::{FirstState, Given, from_to};
use super::{AimError, Happened};
use crate::problem_file::difference;
use carom_sim::{ByOutcome, Event, LinearRun, Moment, Parameter, Sampling, Seen, SimError, Simulation, StopReason};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// The values at some unknowns, and the simulations that have them.
pub(super) struct Values {
    parts: Vec<Part>,
    pub duration: f64,
    pub conditions: Vec<f64>,
    /// Of each cost, before weight and square.
    pub costs: Vec<f64>,
    pub effort: f64,
    pub events: Vec<Happened>,
}

/// Their derivatives: a row for each condition, and for each cost.
pub(super) struct Slopes {
    pub conditions: DMatrix<f64>,
    pub costs: DMatrix<f64>,
    pub effort: DVector<f64>,
}

/// A motion: each part with its end and its events.
struct Outcome<'a> {
    parts: Vec<(&'a Part, &'a Moment, Vec<&'a Event>)>,
    unknowns: &'a [f64],
}

/// One of the functions: its name, and where it is evaluated.
type Asked<'a> = (&'a str, &'a Function, &'a Place);

impl Problem {
    /// The functions with their places: of conditions, then of costs.
    fn functions(&self) -> impl Iterator<Item = Asked<'_>> {
        let conditions = self.conditions.iter().filter_map(|it| {
            let (function, place) = it.asked.as_ref()?;
            Some((it.name.as_str(), function, place))
        });
        conditions.chain(self.costs.iter().map(|it| (it.name.as_str(), &it.function, &it.place)))
    }

    /// The values at u, by a run of each part.
    pub(super) fn values(&self, u: &[f64]) -> Result<Values, AimError> {
        let (parts, duration) = self.given.parts(u)?;
        let along: Vec<&Function> = self
            .functions()
            .filter(|(.., place)| matches!(place, Place::Along))
            .map(|(_, function, _)| function)
            .collect();
        let runs = parts.par_iter().map(|part| run(part, u, &along)).collect::<Result<Vec<_>, SimError>>()?;
        let ran = parts.iter().zip(&runs).map(|(part, (last, events, _))| (part, last, events.iter().collect()));
        let outcome = Outcome { parts: ran.collect(), unknowns: u };
        let mut workspace = parts[0].plan.simulation.chain.workspace();
        let mut integrals = 0..along.len();
        let values = self.functions().map(|(name, function, place)| match place {
            Place::Along => {
                let k = integrals.next().unwrap_or_default();
                Ok(runs.iter().map(|(.., sums)| sums[k]).sum())
            }
            _ => {
                let found = outcome.point(place, name)?;
                if function.has_impulse() {
                    outcome.check_impulse(name, &found)?;
                }
                Ok(function.at(&found.2, &mut workspace)?)
            }
        });
        let mut conditions = values.collect::<Result<Vec<f64>, AimError>>()?;
        if let Some(k) = conditions.iter().position(|x| !x.is_finite()) {
            let name = self.functions().nth(k).map_or_else(String::new, |(name, ..)| name.to_owned());
            return Err(AimError::File {
                file: name,
                rule: "is no finite number: its formula has no value there".into(),
            });
        }
        let costs = conditions.split_off(conditions.len() - self.costs.len());
        for (pair, (last, ..)) in parts.windows(2).zip(&runs) {
            conditions.extend(pair[1].gap(last)?);
        }
        let effort =
            self.costly_torque().map_or(0.0, |torque| torque.effort(&u[self.given.unknowns.len()..], duration).0);
        let start = parts[0].origin;
        let touches = &parts[0].plan.simulation.touches;
        let told = |event: &Event| Happened { time: event.time - start, what: event.named(touches).told() };
        let events = runs.iter().flat_map(|(_, events, _)| events.iter().map(told)).collect();
        Ok(Values { duration, conditions, costs, effort, events, parts })
    }

    /// The derivatives at u, which has these values, by a run of each part in reverse.
    pub(super) fn slopes(&self, u: &[f64], values: &Values) -> Result<Slopes, AimError> {
        let given = &self.given;
        let Values { parts, duration, .. } = values;
        let (parameters, acting) = given.parameters(u, &parts[0].plan.simulation);
        let runs = parts.par_iter().map(|part| part.plan.linear_run(part.duration, &parameters));
        let runs = runs.collect::<Result<Vec<_>, SimError>>()?;
        let ran = parts.iter().zip(&runs).map(|(part, run)| (part, run.last(), run.happened().flatten().collect()));
        let outcome = Outcome { parts: ran.collect(), unknowns: u };
        let (n, moving) = (u.len(), 2 * parts[0].plan.simulation.chain.nv());
        let starts = (0..parts.len()).map(|k| given.starts(k, u)).collect::<Result<Vec<_>, _>>()?;
        let later = given.later(u)?;
        // A row for each function, and for each number in which a part begins elsewhere than the one before ends.
        let mut rows = Vec::new();
        // Of each part the rows to which its outcome counts.
        let mut counts: Vec<Vec<(usize, ByOutcome)>> = vec![Vec::new(); parts.len()];
        for asked in self.functions() {
            let mut row = vec![0.0; n];
            let (rate, by) = outcome.slope(asked, &runs, &mut row)?;
            if asked.1.is_of_impact() {
                given.add_simulations(u, asked.1, &outcome.point(asked.2, asked.0)?.2, &mut row)?;
            }
            later.iter().for_each(|(k, by)| row[*k] += rate * by);
            by.into_iter().for_each(|(part, by)| counts[part].push((rows.len(), by)));
            rows.push(row);
        }
        let first_gap = rows.len();
        for k in 1..parts.len() {
            for i in 0..moving {
                let last = (0..moving).map(|j| if j == i { 1.0 } else { 0.0 }).collect();
                counts[k - 1].push((rows.len(), ByOutcome { last, ..ByOutcome::default() }));
                let mut row = vec![0.0; n];
                starts[k].iter().for_each(|(j, start)| row[*j] -= start[i]);
                rows.push(row);
            }
        }
        for ((run, start), counts) in runs.iter().zip(&starts).zip(counts) {
            let (of, by): (Vec<usize>, Vec<ByOutcome>) = counts.into_iter().unzip();
            for (row, gradient) in of.into_iter().zip(run.gradients(&by)?) {
                let row = &mut rows[row];
                for (k, start) in start {
                    row[*k] += start.iter().zip(&gradient).map(|(x, by)| x * by).sum::<f64>();
                }
                acting.iter().zip(&gradient[moving..]).for_each(|(k, by)| row[*k] += by);
            }
        }
        let gaps = rows.split_off(first_gap);
        let costs = rows.split_off(first_gap - self.costs.len());
        rows.extend(gaps);
        let matrix = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]);
        let mut effort = DVector::zeros(n);
        if let Some(torque) = self.costly_torque() {
            let (sum, by) = torque.effort(&u[given.unknowns.len()..], *duration);
            effort.rows_mut(given.unknowns.len(), by.len()).copy_from_slice(&by);
            later.iter().for_each(|(k, by)| effort[*k] += sum / duration * by);
        }
        Ok(Slopes { conditions: matrix(&rows), costs: matrix(&costs), effort })
    }
}

impl Given {
    /// The parameters by which the run is differentiated, and the unknown of each.
    fn parameters(&self, u: &[f64], simulation: &Simulation) -> (Vec<Parameter>, Vec<usize>) {
        let (mut parameters, mut unknowns) = (Vec::new(), Vec::new());
        let shared = Arc::new(self.clone());
        for (k, own) in self.unknowns.iter().enumerate() {
            let moves_knots = self.torque.is_some() && own.duration(u[k]).is_some();
            if !own.acts && !moves_knots {
                continue;
            }
            let closed = own.path.as_ref().filter(|_| !moves_knots).and_then(|path| self.scene.of_drive(path));
            parameters.push(closed.unwrap_or_else(|| {
                let (given, at) = (shared.clone(), u.to_vec());
                Parameter::try_new(own.name.clone(), u[k].abs().max(own.size()), move |simulation, change| {
                    let mut beside = at.clone();
                    beside[k] += change;
                    let Simulation { stop, max_events, .. } = simulation;
                    let (stop, max_events) = (stop.clone(), *max_events);
                    *simulation = Simulation { stop, max_events, ..given.plan(&beside)?.0.simulation };
                    Ok(())
                })
            }));
            unknowns.push(k);
        }
        if let Some(torque) = &self.torque {
            let of_rows = Parameter::all(simulation);
            for (joint, name) in torque.joints.iter().enumerate() {
                let mut rows = of_rows.iter().filter(|own| own.name().starts_with(&format!("torque {name} ")));
                for k in 0..torque.count {
                    let own = if torque.pieces { 2 } else { 1 };
                    for row in rows.by_ref().take(own) {
                        parameters.push(row.clone());
                        unknowns.push(self.unknowns.len() + joint * torque.count + k);
                    }
                }
            }
        }
        (parameters, unknowns)
    }

    /// Adds the derivatives of a function of an impact by what the unknowns change in the simulation: its laws and masses.
    fn add_simulations(&self, u: &[f64], function: &Function, point: &Point, row: &mut [f64]) -> Result<(), SimError> {
        let mut workspace = point.sim.chain.workspace();
        for (k, own) in self.unknowns.iter().enumerate().filter(|(_, own)| own.acts) {
            row[k] += difference_within(u[k].abs().max(own.size()), |by| {
                let mut beside = u.to_vec();
                beside[k] += by;
                let sim = self.plan(&beside)?.0.simulation;
                // What it changes beside the simulation counts elsewhere.
                function.at(&Point { sim: &sim, ..*point }, &mut workspace)
            })?;
        }
        Ok(())
    }

    /// What the unknowns change at the start of a part: displacement and velocity.
    fn starts(&self, part: usize, u: &[f64]) -> Result<Vec<(usize, Vec<f64>)>, SimError> {
        if let Some(knot) = part.checked_sub(1) {
            return self.starts_at(knot, u);
        }
        let mut all = Vec::new();
        for (k, own) in self.unknowns.iter().enumerate() {
            match &own.start {
                None => {}
                Some(FirstState::Linear(slopes)) => all.push((k, slopes.clone())),
                Some(FirstState::Curved) => {
                    let h = 1e-3 * u[k].abs().max(own.size());
                    let at = |by: f64| {
                        let mut beside = u.to_vec();
                        beside[k] += by;
                        self.scene_at(&beside)
                    };
                    let near = from_to(&at(-h)?, &at(h)?, 2.0 * h)?;
                    let far = from_to(&at(-2.0 * h)?, &at(2.0 * h)?, 4.0 * h)?;
                    all.push((k, near.iter().zip(&far).map(|(near, far)| (4.0 * near - far) / 3.0).collect()));
                }
            }
        }
        Ok(all)
    }

    /// What the unknowns add to the duration.
    fn later(&self, u: &[f64]) -> Result<Vec<(usize, f64)>, SimError> {
        let own = self.unknowns.iter().zip(u).enumerate().filter(|(_, (own, x))| own.duration(**x).is_some());
        own.map(|(k, (own, x))| {
            let rate = difference(own.size(), |by| Ok(own.duration(x + by).unwrap_or_default()))?;
            Ok((k, rate))
        })
        .collect()
    }
}

impl<'a> Outcome<'a> {
    /// Where a function is evaluated that is no integral: the part, the number of its event, and the point.
    fn point(&self, place: &'a Place, name: &str) -> Result<(usize, Option<usize>, Point<'a>), AimError> {
        let Place::Impact { contact, touches, k, side } = place else {
            let part = self.parts.len() - 1;
            let (_, last, _) = &self.parts[part];
            return Ok((part, None, self.between(part, last.time, (&last.q, &last.qd))));
        };
        let is_own = |event: &&Event| event.struck().any(|touch| touches.contains(&touch));
        let all = || {
            self.parts.iter().enumerate().flat_map(|(part, (.., events))| events.iter().map(move |own| (part, *own)))
        };
        let Some((part, event)) = all().filter(|(_, event)| is_own(event)).nth(*k) else {
            let named =
                |(part, event): (usize, &Event)| event.named(&self.parts[part].0.plan.simulation.touches).told();
            let told: Vec<String> = all().map(named).collect();
            return Err(AimError::NoImpact {
                condition: name.to_owned(),
                contact: contact.clone(),
                found: all().filter(|(_, event)| is_own(event)).count(),
                seen: if told.is_empty() { "none".into() } else { told.join(", ") },
            });
        };
        let point = Point {
            qd: [&event.qd_minus, &event.qd_plus],
            side: *side,
            struck: event.kind.struck(),
            counts: touches,
            ..self.between(part, event.time, (&event.q, &event.qd_plus))
        };
        Ok((part, self.parts[part].2.iter().position(|own| std::ptr::eq(*own, event)), point))
    }

    /// # Errors
    /// [`AimError::File`] if the normal impulses of the run do not follow from its velocities: other contacts carry impulses, too, or those of
    /// several depend on each other.
    fn check_impulse(&self, name: &str, (part, event, point): &(usize, Option<usize>, Point)) -> Result<(), AimError> {
        let Some(event) = event.and_then(|k| self.parts[*part].2.get(k)) else { return Ok(()) };
        let moment = Moment { time: event.time, q: event.q.clone(), qd: event.qd_minus.clone() };
        let (mut told, mut size) = (0.0, 0.0);
        for own in &event.impulses {
            let normal = point.sim.touching_point(own.touch, &moment)?.map_or(0.0, |[_, n]| n.dot(&own.impulse));
            size += normal.abs();
            told += if point.counts.contains(&own.touch) { normal } else { 0.0 };
        }
        if size == 0.0 {
            return Ok(()); // a joint limit
        }
        let impulses = point.sim.normal_impulses(point.struck, point.q, point.qd, point.clock)?;
        let counted = point.struck.iter().zip(impulses).filter(|(touch, _)| point.counts.contains(touch));
        let found: f64 = counted.map(|(_, p)| p).sum();
        /// What differs by more is no error of the run.
        const SAME: f64 = 1e-6;
        if (found - told).abs() <= SAME * size {
            return Ok(());
        }
        let rule = format!(
            "impulse = {told:.6} N s does not follow from the velocities of the impact, which give {found:.6} N s: several contacts carry impulses that \
             depend on each other; aim at lost, or at velocities before or after the impact"
        );
        Err(AimError::File { file: name.to_owned(), rule })
    }

    /// A state of a part that is not at an impact.
    fn between<'s>(&self, part: usize, time: f64, state: (&'s [f64], &'s [f64])) -> Point<'s>
    where
        'a: 's,
    {
        self.parts[part].0.at(time, state, self.unknowns)
    }

    /// The derivatives of a function: its change by that of the duration, and those by the outcome of parts; those by the unknowns themselves are
    /// added to `row`.
    fn slope(
        &self,
        (name, function, place): Asked<'a>,
        runs: &[LinearRun],
        row: &mut [f64],
    ) -> Result<(f64, Vec<(usize, ByOutcome)>), AimError> {
        let mut workspace = self.parts[0].0.plan.simulation.chain.workspace();
        let mut add = |weight: f64, slope: &Slope| {
            slope.unknowns.iter().zip(&mut *row).for_each(|(by, row)| *row += weight * by);
        };
        if let Place::Along = place {
            let mut all = Vec::new();
            for (part, run) in runs.iter().enumerate() {
                let (_, by) = run.integral(|time, weight, state| {
                    let point = self.between(part, time, state.split_at(self.parts[part].1.q.len()));
                    let slope = function.slope(&point, &mut workspace)?;
                    add(weight, &slope);
                    Ok((function.at(&point, &mut workspace)?, [slope.q.as_slice(), &slope.qd[1]].concat()))
                })?;
                all.push((part, by));
            }
            let (.., end) = self.point(&Place::End, name)?;
            return Ok((function.at(&end, &mut workspace)?, all));
        }
        let (part, event, point) = self.point(place, name)?;
        let slope = function.slope(&point, &mut workspace)?;
        add(1.0, &slope);
        let by = by_outcome(&runs[part], event, point.side, &slope);
        let rate = match place {
            Place::End => by.last.iter().zip(runs[part].rate()).map(|(by, rate)| by * rate).sum::<f64>() + slope.time,
            _ => 0.0,
        };
        Ok((rate, vec![(part, by)]))
    }
}

/// Runs a part: its end, its events, and the integrals of functions over it.
fn run(part: &Part, unknowns: &[f64], along: &[&Function]) -> Result<(Moment, Vec<Event>, Vec<f64>), SimError> {
    let plan = &part.plan;
    let (mut events, mut sums, mut failed) = (Vec::new(), vec![0.0; along.len()], None);
    let mut workspace = plan.simulation.chain.workspace();
    let sampling = Sampling { dense: !along.is_empty(), ..Sampling::default() };
    let ran = plan.stream(part.duration, sampling, &mut |seen| match seen {
        Seen::Event(event) => events.push(event.clone()),
        Seen::Segment(segment) => {
            for (time, weight, state) in segment.quadrature() {
                let point = part.at(time, state.split_at(plan.q.len()), unknowns);
                for (sum, function) in sums.iter_mut().zip(along) {
                    match function.at(&point, &mut workspace) {
                        Ok(value) => *sum += weight * value,
                        Err(error) => failed = Some(error),
                    }
                }
            }
        }
        _ => {}
    })?;
    if ran.stop == StopReason::Events {
        let value = plan.simulation.max_events as f64;
        return Err(SimError::Setting {
            what: "max_events",
            value,
            rule: "the motion ends before its duration: raise it",
        });
    }
    failed.map_or(Ok((ran.last, events, sums)), Err)
}

/// The derivatives of a function by the outcome of a run, at its end or at one of its events.
fn by_outcome(run: &LinearRun, event: Option<usize>, side: usize, slope: &Slope) -> ByOutcome {
    let none = vec![0.0; slope.q.len()];
    let [before, after] = [0, 1].map(|own| {
        let q = if own == side { &slope.q } else { &none };
        [q.as_slice(), &slope.qd[own]].concat()
    });
    // Several may happen at one time.
    let index =
        event.and_then(|found| run.happened().enumerate().flat_map(|(k, all)| all.iter().map(move |_| k)).nth(found));
    match index {
        None => ByOutcome { last: after, ..ByOutcome::default() },
        Some(k) => {
            let some =
                |weights: Vec<f64>| if weights.iter().all(|x| *x == 0.0) { Vec::new() } else { vec![(k, weights)] };
            let times = if slope.time == 0.0 { Vec::new() } else { vec![(k, slope.time)] };
            ByOutcome {
                last: vec![0.0; before.len()],
                times,
                before: some(before),
                after: some(after),
                ..ByOutcome::default()
            }
        }
    }
}

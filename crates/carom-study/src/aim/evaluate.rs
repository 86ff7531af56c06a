//! The conditions and the cost of a motion, and their derivatives by the unknowns.
//!
//! A number g of the final state, of a state at an impact or of an impulse has the derivative ∂g/∂u = Σ λᵀ ∂x₀/∂u + ∂g/∂p ∂p/∂u, with λ from
//! the run in reverse; of an unknown that changes the duration T also ∂g/∂x ẋ(T).

use super::function::{Function, Point, Slope, difference};
use super::problem::{Place, Problem};
use super::unknown::{FirstState, Given, from_to};
use super::{AimError, Happened};
use carom_sim::{ByOutcome, Event, LinearRun, Parameter, Plan, Sampling, Seen, SimError, Simulation};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The values at some unknowns, and the simulation that has them.
pub(super) struct Values {
    plan: Plan,
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

/// A motion: its end and its events.
struct Outcome<'a> {
    plan: &'a Plan,
    unknowns: &'a [f64],
    time: f64,
    q: &'a [f64],
    qd: &'a [f64],
    events: Vec<&'a Event>,
}

impl Problem {
    /// The functions with their places: conditions, then costs.
    fn functions(&self) -> impl Iterator<Item = (&str, &Function, &Place)> {
        let conditions = self.conditions.iter().map(|it| (it.name.as_str(), &it.function, &it.place));
        conditions.chain(self.costs.iter().map(|it| (it.name.as_str(), &it.function, &it.place)))
    }

    /// The values at u, by a run.
    pub(super) fn values(&self, u: &[f64]) -> Result<Values, AimError> {
        let (plan, duration) = self.given.plan(u)?;
        let mut events: Vec<Event> = Vec::new();
        let run = plan.stream(duration, Sampling::default(), &mut |seen| {
            if let Seen::Event(event) = seen {
                events.push(event.clone());
            }
        })?;
        let last = &run.last;
        let outcome = Outcome {
            plan: &plan,
            unknowns: u,
            time: last.time,
            q: &last.q,
            qd: &last.qd,
            events: events.iter().collect(),
        };
        let mut workspace = plan.simulation.chain.workspace();
        let values = self.functions().map(|(name, function, place)| {
            let counts = place.touches();
            Ok(function.at(&outcome.point(place, name)?.counting(counts), &mut workspace)?)
        });
        let mut conditions = values.collect::<Result<Vec<f64>, AimError>>()?;
        if let Some(k) = conditions.iter().position(|x| !x.is_finite()) {
            let name = self.functions().nth(k).map_or_else(String::new, |(name, ..)| name.to_owned());
            return Err(AimError::File {
                file: name,
                rule: "is no finite number: its formula has no value there".into(),
            });
        }
        let costs = conditions.split_off(self.conditions.len());
        let of = self.given.torque.as_ref().filter(|_| self.effort > 0.0);
        let effort = of.map_or(0.0, |torque| torque.effort(&u[self.given.unknowns.len()..], duration).0);
        let start = plan.simulation.start_time;
        let told =
            |event: &Event| Happened { time: event.time - start, what: event.named(&plan.simulation.touches).told() };
        let events = events.iter().map(told).collect();
        Ok(Values { plan, duration, conditions, costs, effort, events })
    }

    /// The derivatives at u, which has these values, by a run in reverse.
    pub(super) fn slopes(&self, u: &[f64], values: &Values) -> Result<Slopes, AimError> {
        let given = &self.given;
        let Values { plan, duration, .. } = values;
        let (parameters, acting) = given.parameters(u, &plan.simulation);
        let run = plan.linear_run(*duration, &parameters)?;
        let starts = given.starts(u)?;
        let later = given.later(u)?;
        let last = run.last();
        let events = run.happened().flatten().collect();
        let outcome = Outcome { plan, unknowns: u, time: last.time, q: &last.q, qd: &last.qd, events };
        let mut workspace = plan.simulation.chain.workspace();
        let (n, nv) = (u.len(), plan.simulation.chain.nv());
        let mut slopes = Vec::new();
        for (name, function, place) in self.functions() {
            let point = outcome.point(place, name)?.counting(place.touches());
            let slope = function.slope(&point, &mut workspace)?;
            let by = by_outcome(&run, place, &slope);
            slopes.push((place, slope, by));
        }
        let all: Vec<ByOutcome> = slopes.iter().map(|(.., by)| by.clone()).collect();
        let mut rows = Vec::new();
        for ((place, slope, by), gradient) in slopes.iter().zip(run.gradients(&all)?) {
            let mut row = vec![0.0; n];
            for (k, start) in &starts {
                row[*k] += start.iter().zip(&gradient).map(|(x, by)| x * by).sum::<f64>();
            }
            acting.iter().zip(&gradient[2 * nv..]).for_each(|(k, by)| row[*k] += by);
            slope.unknowns.iter().zip(&mut row).for_each(|(by, row)| *row += by);
            if place.impact.is_none() {
                let rate = by.last.iter().zip(run.rate()).map(|(by, rate)| by * rate).sum::<f64>() + slope.time;
                later.iter().for_each(|(k, by)| row[*k] += rate * by);
            }
            rows.push(row);
        }
        let matrix = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]);
        let (conditions, costs) = rows.split_at(self.conditions.len());
        let mut effort = DVector::zeros(n);
        if let Some(torque) = given.torque.as_ref().filter(|_| self.effort > 0.0) {
            let (sum, by) = torque.effort(&u[given.unknowns.len()..], *duration);
            effort.rows_mut(given.unknowns.len(), by.len()).copy_from_slice(&by);
            later.iter().for_each(|(k, by)| effort[*k] += sum / duration * by);
        }
        Ok(Slopes { conditions: matrix(conditions), costs: matrix(costs), effort })
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

    /// What the unknowns change at the start: displacement and velocity.
    fn starts(&self, u: &[f64]) -> Result<Vec<(usize, Vec<f64>)>, SimError> {
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

impl Place {
    fn touches(&self) -> &[usize] {
        self.impact.as_ref().map_or(&[], |(_, touches, _)| touches)
    }

    /// The number of its impact among these events.
    fn find<'e>(&self, mut events: impl Iterator<Item = &'e Event>) -> Option<usize> {
        let (_, touches, k) = self.impact.as_ref()?;
        let is_own = |event: &Event| event.kind.struck().iter().any(|touch| touches.contains(touch));
        let mut left = *k;
        events.position(|event| {
            let is_own = is_own(event);
            let found = is_own && left == 0;
            left -= usize::from(is_own && left > 0);
            found
        })
    }
}

impl<'a> Outcome<'a> {
    fn point(&self, place: &Place, name: &str) -> Result<Point<'a>, AimError> {
        let (sim, side) = (&self.plan.simulation, place.side);
        let Some((contact, touches, _)) = &place.impact else {
            let qd = [self.qd, self.qd];
            let time = self.time - sim.start_time;
            return Ok(Point { sim, time, q: self.q, qd, side, struck: &[], counts: &[], unknowns: self.unknowns });
        };
        let Some(k) = place.find(self.events.iter().copied()) else {
            let is_own = |event: &&&Event| event.kind.struck().iter().any(|touch| touches.contains(touch));
            let told: Vec<String> = self.events.iter().map(|event| event.named(&sim.touches).told()).collect();
            return Err(AimError::NoImpact {
                condition: name.to_owned(),
                contact: contact.clone(),
                found: self.events.iter().filter(is_own).count(),
                seen: if told.is_empty() { "none".into() } else { told.join(", ") },
            });
        };
        let event = self.events[k];
        let qd = [event.qd_minus.as_slice(), &event.qd_plus];
        let struck = event.kind.struck();
        let time = event.time - sim.start_time;
        Ok(Point { sim, time, q: &event.q, qd, side, struck, counts: &[], unknowns: self.unknowns })
    }
}

impl<'a> Point<'a> {
    fn counting(self, counts: &'a [usize]) -> Self {
        Self { counts, ..self }
    }
}

/// The derivatives of a function by the outcome of a run.
fn by_outcome(run: &LinearRun, place: &Place, slope: &Slope) -> ByOutcome {
    let none = vec![0.0; slope.q.len()];
    let [before, after] = [0, 1].map(|side| {
        let q = if side == place.side { &slope.q } else { &none };
        [q.as_slice(), &slope.qd[side]].concat()
    });
    let index = place.impact.as_ref().and_then(|_| {
        let found = place.find(run.happened().flatten())?;
        run.happened().enumerate().flat_map(|(k, all)| all.iter().map(move |_| k)).nth(found)
    });
    match index {
        None => ByOutcome { last: after, ..ByOutcome::default() },
        Some(k) => {
            let some =
                |weights: Vec<f64>| if weights.iter().all(|x| *x == 0.0) { Vec::new() } else { vec![(k, weights)] };
            let times = if slope.time == 0.0 { Vec::new() } else { vec![(k, slope.time)] };
            ByOutcome { last: vec![0.0; before.len()], times, before: some(before), after: some(after) }
        }
    }
}

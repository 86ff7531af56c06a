//! A motion in segments (multiple shooting; Bock & Plitt 1984).
//!
//! Between N segments the state is unknown, and each has a run of its own; that it begins where the one before ends is a condition. The
//! derivatives of one segment are smaller than those of the whole by the growth of its errors, so that unstable motions are found from a
//! guess of their path.

use super::function::{Function, Point};
use super::problem::{Condition, Problem};
use super::unknown::Given;
use super::{AimError, End, Found, Unknown};
use crate::problem_file::difference;
use carom_chain::Coordinates;
use carom_sim::{Moment, Plan, SimError, Simulation, state_variables};
use std::collections::BTreeMap;

/// A segment, or the whole motion.
pub(super) struct Part {
    pub plan: Plan,
    pub duration: f64,
    /// When the whole motion begins, s.
    pub origin: f64,
}

impl Part {
    /// A state that is not at an impact.
    pub fn at<'a>(&'a self, time: f64, (q, qd): (&'a [f64], &'a [f64]), unknowns: &'a [f64]) -> Point<'a> {
        let (clock, time) = (time, time - self.origin);
        Point { sim: &self.plan.simulation, clock, time, q, qd: [qd, qd], side: 1, struck: &[], counts: &[], unknowns }
    }

    /// The displacement and the change of velocity from its start to the end of the one before.
    pub fn gap(&self, before: &Moment) -> Result<Vec<f64>, SimError> {
        let moved = self.plan.simulation.chain.difference(&self.plan.q, &before.q)?;
        let faster = before.qd.iter().zip(&self.plan.qd).map(|(a, b)| a - b);
        Ok(moved.into_iter().chain(faster).collect())
    }
}

impl Given {
    /// The parts of the motion at these values, and the duration of all.
    pub fn parts(&self, u: &[f64]) -> Result<(Vec<Part>, f64), SimError> {
        let (plan, duration) = self.plan(u)?;
        let origin = plan.simulation.start_time;
        let mut parts = vec![Part { plan, duration, origin }];
        for (k, knot) in self.knots.iter().enumerate() {
            let mut plan = parts[0].plan.clone();
            (plan.q, plan.qd) = self.state_at(k, u)?;
            plan.simulation.start_time = knot.time;
            let before = &mut parts[k];
            before.duration = knot.time - before.plan.simulation.start_time;
            parts.push(Part { plan, duration: origin + duration - knot.time, origin });
        }
        Ok((parts, duration))
    }

    /// Where the unknowns of a knot begin.
    fn of_knot(&self, knot: usize) -> usize {
        let torques = self.torque.as_ref().map_or(0, |own| own.joints.len() * own.count);
        self.unknowns.len() + torques + knot * 2 * self.knots[knot].qd.len()
    }

    /// The state at a knot.
    fn state_at(&self, knot: usize, u: &[f64]) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        let (Moment { q, qd, .. }, first, nv) = (&self.knots[knot], self.of_knot(knot), self.knots[knot].qd.len());
        let q = self.scene.simulation.chain.integrate(q, &u[first..first + nv], 1.0)?;
        Ok((q, qd.iter().zip(&u[first + nv..]).map(|(qd, by)| qd + by).collect()))
    }

    /// What the unknowns of a knot change there: displacement and velocity.
    pub fn starts_at(&self, knot: usize, u: &[f64]) -> Result<Vec<(usize, Vec<f64>)>, SimError> {
        let (chain, first, nv) = (&self.scene.simulation.chain, self.of_knot(knot), self.knots[knot].qd.len());
        let here = self.state_at(knot, u)?.0;
        let column = |j: usize| {
            let mut column = vec![0.0; 2 * nv];
            column[j] = 1.0;
            // A displacement in two steps is not that of their sum where a joint floats.
            for i in (0..nv).filter(|_| j < nv && chain.nq() != nv) {
                column[i] = difference(1.0, |by| {
                    let mut beside = u.to_vec();
                    beside[first + j] += by;
                    Ok(chain.difference(&here, &self.state_at(knot, &beside)?.0)?[i])
                })?;
            }
            Ok((first + j, column))
        };
        (0..2 * nv).map(column).collect()
    }
}

/// Formulas of time of numbers of (q, q̇) between segments, by their indices.
#[derive(Clone)]
pub(super) struct Guess(Vec<(usize, Function)>);

impl Guess {
    /// Reads the formulas by the names of the numbers.
    pub fn of(keys: &BTreeMap<String, String>, sim: &Simulation) -> Result<Self, String> {
        let known = state_variables(&sim.chain);
        let read = keys.iter().map(|(name, formula)| {
            let Some((_, k)) = known.iter().find(|(own, _)| own == name) else {
                let names: Vec<&str> = known.iter().map(|(own, _)| own.as_str()).collect();
                return Err(format!("has '{name}', which is no number of the state: there are {}", names.join(", ")));
            };
            Ok((*k, Function::of(formula, sim, &[], false).map_err(|why| format!("{name} = {why}"))?))
        });
        let mut all = read.collect::<Result<Vec<_>, String>>()?;
        // Velocities that are given replace the derivatives of positions.
        all.sort_by_key(|(k, _)| *k);
        Ok(Self(all))
    }

    /// The state at a time, s, of a motion that begins as the plan does. A velocity that is not given is the derivative of the formula of
    /// its joint, or zero.
    fn at(&self, plan: &Plan, time: f64) -> Result<Moment, SimError> {
        let chain = &plan.simulation.chain;
        let (mut q, mut qd) = (plan.q.clone(), vec![0.0; chain.nv()]);
        let mut workspace = chain.workspace();
        let start = Part { plan: plan.clone(), duration: 0.0, origin: 0.0 };
        for (k, function) in &self.0 {
            let mut value = |by: f64| function.at(&start.at(time + by, (&plan.q, &plan.qd), &[]), &mut workspace);
            let Some(number) = q.get_mut(*k) else {
                qd[k - q.len()] = value(0.0)?;
                continue;
            };
            *number = value(0.0)?;
            let v = chain.joints().iter().find_map(|joint| match &joint.coordinates {
                Coordinates::Own { q, v } if q.start == *k && q.len() == 1 => Some(v.start),
                _ => None,
            });
            if let Some(v) = v {
                qd[v] = difference(1.0, value)?;
            }
        }
        Ok(Moment { time: plan.simulation.start_time + time, q, qd })
    }
}

impl Problem {
    /// The problem in segments, which begin at the guessed states of the motion with these unknowns.
    fn in_segments(&self, first: &[f64]) -> Result<Self, AimError> {
        let (plan, duration) = self.given.plan(first)?;
        let (mut given, mut conditions) = (self.given.clone(), self.conditions.clone());
        for k in 1..self.segments {
            let names = plan.simulation.state_names();
            let gap = |name: &String| Condition {
                name: format!("{name} where segment {} begins, less that where the one before ends", k + 1),
                asked: None,
                bounds: [0.0; 2],
            };
            conditions.extend(names.iter().map(gap));
            given.knots.push(self.guess.at(&plan, duration * k as f64 / self.segments as f64)?);
        }
        Ok(Self { given, conditions, segments: 1, ..self.clone() })
    }

    /// Looks in segments, and then from there for the motion in one piece.
    pub(super) fn solve_in_segments(&self, first: Vec<f64>) -> Result<Found, AimError> {
        let split = self.in_segments(&first)?;
        let knots = split.given.first().split_off(first.len());
        let found = split.search([first, knots].concat())?;
        let whole = Self { segments: 1, ..self.clone() };
        let joined = |last: Found| Found {
            unknowns: (last.unknowns.into_iter().zip(&found.unknowns))
                .map(|(own, found)| Unknown { first: found.first, ..own })
                .collect(),
            steps: [found.steps.clone(), last.steps].concat(),
            runs: found.runs + last.runs,
            differentiated: found.differentiated + last.differentiated,
            ..last
        };
        match whole.search(found.values()) {
            Ok(last) => Ok(joined(last)),
            Err(stopped @ AimError::Run(SimError::Stopped { .. })) => Err(stopped),
            // It misses the conditions, or errors grow so far that it has other events or no derivative.
            Err(_) => {
                let u = found.values();
                let values = whole.values(&u)?;
                Ok(joined(whole.found(&u, values, &u, (Vec::new(), End::Segments), (1, 0))))
            }
        }
    }
}

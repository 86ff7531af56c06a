//! Contacts whose slip begins.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | d | 2 | direction of slip, in the axes of the contact | `along` |
//! | a_t | 2 | acceleration of the slip | `slips` |
//! | r | k | a_t across d, of each such contact: what is to vanish | `across` |
//!
//! Friction acts against the slip u, whose direction turns at the rate (friction acceleration)/|u|: out of a contact at rest the
//! equations of motion are as stiff as the slip is small, and their solution is the one that stays bounded. As u(0) = 0 that is u ∥ a_t
//! up to (turn of the direction in this time)·|u|. So up to a slip of [`Motion::starts`] the direction follows from the accelerations,
//! as in a contact at rest: a_t ∥ d, solved by Newton's method for the angles of all such contacts, with the other constraints held.
//! The velocity across d is zero during the start. Friction adds it afterwards, by the same impulse. The error is of second order in
//! the angle by which d turns during the start, and this angle is proportional to the duration of the start.

use super::active_set::{Hold, Lasting};
use super::assembled::Assembled;
use super::rows::{Constraints, push};
use super::smooth::Motion;
use crate::error::SimError;
use crate::state::{EQUAL, ROUNDING, STEPS, Space};
use nalgebra::{DMatrix, DVector, Vector2};

fn across(d: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-d.y, d.x)
}

impl<A: Space> Motion<'_, A> {
    /// λ where slip begins at some contacts; stores their directions.
    pub fn starting_forces(&self, time: f64, found: &mut Assembled) -> Result<DVector<f64>, SimError> {
        let wanted = -found.offset();
        let count = found.constraints.starts.len();
        for step in 0.. {
            self.push_along(found);
            let mut equations = self.equations(time, found)?;
            let lambda =
                equations.as_mut().and_then(|it| it.forces(&wanted)).ok_or_else(|| self.jam(time, found, 0))?;
            let mut qdd = found.free.clone();
            push(qdd.as_mut_slice(), &found.responses, lambda.as_slice());
            let (slips, sizes): (Vec<_>, Vec<_>) = (0..count).map(|i| found.slip_acceleration(i, &qdd)).unzip();
            let starts = &found.constraints.starts;
            let left = DVector::from_fn(count, |i, _| slips[i].dot(&across(starts[i].along)));
            let solved = left.iter().zip(&sizes).all(|(left, size)| left.abs() <= 10.0 * ROUNDING * size);
            if solved {
                return Ok(lambda);
            }
            // No directions of slip are consistent with the accelerations.
            let no_direction = || self.jam(time, found, starts[0].row);
            if step == STEPS {
                return Err(no_direction());
            }
            // r changes with the angles by the turn of d and by the friction that turns with it.
            let mut slope = DMatrix::zeros(count, count);
            for j in 0..count {
                let turned = found.turned(j, lambda[starts[j].row]);
                let rows = &found.constraints.rows;
                let held = DVector::from_fn(rows.len(), |i, _| rows.dot(i, turned.as_slice()));
                let mut change = turned;
                let forces = equations.as_ref().and_then(|it| it.solve(&-held));
                let forces = forces.ok_or_else(|| self.jam(time, found, 0))?;
                push(change.as_mut_slice(), &found.responses, forces.as_slice());
                for i in 0..count {
                    let moved = found.tangents(i, change.as_slice());
                    slope[(i, j)] = moved.dot(&across(starts[i].along));
                }
                slope[(j, j)] -= slips[j].dot(&starts[j].along);
            }
            // Several contacts may have the same slip: two wheels on one axle.
            let least = EQUAL * slope.amax();
            if slope.iter().any(|entry| !entry.is_finite()) {
                return Err(no_direction());
            }
            // nalgebra's SVD is wrong for some matrices: then the angles do not converge. Pivots instead of singular values would decide
            // otherwise in other units.
            let Ok(turn) = slope.svd(true, true).solve(&left, least) else {
                return Err(no_direction());
            };
            for (start, turn) in found.constraints.starts.iter_mut().zip(turn.iter()) {
                // Far from the solution the step may be of any size.
                let angle = -turn.clamp(-0.5, 0.5);
                start.along = (start.along * angle.cos() + across(start.along) * angle.sin()).normalize();
            }
        }
        unreachable!("the last step returns")
    }

    /// The responses and force directions of contacts whose slip begins, along n − μ d.
    fn push_along(&self, found: &mut Assembled) {
        let Assembled { constraints, responses, own_responses, tangent_responses, .. } = found;
        let Constraints { rows, forces, tangents, starts, contacts, .. } = constraints;
        for (i, start) in starts.iter().enumerate() {
            let force = -start.friction * start.along;
            let (normal, [first, second]) = (rows.row(start.row), [0, 1].map(|axis| tangents.row(2 * i + axis)));
            let target = forces.iter_mut().nth(start.row).into_iter().flatten();
            for (k, f) in target.enumerate() {
                *f = normal[k] + force.x * first[k] + force.y * second[k];
            }
            let (first, second) = (tangent_responses.row(2 * i), tangent_responses.row(2 * i + 1));
            let normal = own_responses.row(start.row);
            let target = responses.iter_mut().nth(start.row).into_iter().flatten();
            for (k, x) in target.enumerate() {
                *x = normal[k] + force.x * first[k] + force.y * second[k];
            }
            let contact = &mut contacts[start.contact];
            if let Some(directions) = &mut contact.directions {
                directions.set_column(2, &(contact.normal - start.toward() * start.friction));
            }
        }
    }

    /// Keeps the directions of slip that begins, for the next evaluation and for the witness functions.
    pub fn keep_directions(lasting: &mut [Lasting], found: &Assembled) {
        let starting = lasting.iter_mut().filter_map(|own| match &mut own.hold {
            Hold::Starts { toward } => Some(toward),
            _ => None,
        });
        for (toward, start) in starting.zip(&found.constraints.starts) {
            *toward = start.toward();
        }
    }
}

impl Assembled {
    /// T q̈ of the i-th contact whose slip begins.
    fn tangents(&self, i: usize, qdd: &[f64]) -> Vector2<f64> {
        let rows = &self.constraints.tangents;
        Vector2::new(rows.dot(2 * i, qdd), rows.dot(2 * i + 1, qdd))
    }

    /// Its acceleration of slip, and the size of the terms of it.
    fn slip_acceleration(&self, i: usize, qdd: &DVector<f64>) -> (Vector2<f64>, f64) {
        let drift = self.constraints.starts[i].drift;
        let rows = &self.constraints.tangents;
        // Before slip begins the accelerations without constraint forces and those by them may cancel: rounding is a share of each.
        let accelerations = || qdd.iter().zip(self.free.iter()).map(|(a, free)| a.abs().max(free.abs()));
        let terms = |k: usize| rows.row(k).iter().zip(accelerations()).map(|(r, a)| r.abs() * a).sum::<f64>();
        let size = terms(2 * i).max(terms(2 * i + 1)) + drift.amax();
        (self.tangents(i, qdd.as_slice()) + drift, size)
    }

    /// The change of q̈ per angle by which the friction of the i-th contact turns, at this normal force.
    fn turned(&self, i: usize, force: f64) -> DVector<f64> {
        let start = &self.constraints.starts[i];
        let turn = across(start.along) * (-start.friction * force);
        let (first, second) = (self.tangent_responses.row(2 * i), self.tangent_responses.row(2 * i + 1));
        DVector::from_fn(self.free.len(), |k, _| turn.x * first[k] + turn.y * second[k])
    }
}

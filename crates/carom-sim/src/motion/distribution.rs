//! Admissible forces of redundant constraints, where those of the convention (`held.rs`) are not.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | λ | m | constraint forces |
//! | G | m×m | F M⁻¹ Fᵀ, of rank r: forces with the same G λ cause the same accelerations |
//! | B, X | r, m×r | independent rows of G; G = X G_B |
//! | P | | projection onto the admissible forces, row by row: no pull, friction cones, bounds of dry joints |
//!
//! The admissible forces of least norm are λ = P(X η), where η solves the r equations G_B P(X η) = G_B λ₀ for any forces λ₀ of the same
//! motion: the projection of zero onto the intersection of a convex set with the affine set of all λ with G λ = G λ₀ (Deutsch 2001, *Best
//! Approximation in Inner Product Spaces*, theorem 10.13). Newton's method solves them, with the derivative of P on its present pieces.

use super::active_set::{Dry, DryJoint, Hold, Lasting};
use super::assembled::{Assembled, ConstraintForces};
use super::held::Detail;
use super::rows::Contact;
use super::smooth::Motion;
use crate::error::SimError;
use crate::state::{Basis, EQUAL, STEPS, Space};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What the forces of some rows may be.
enum Admitted {
    /// A contact or a stop: tangents first, the normal last.
    Cone { rows: Range<usize>, friction: f64 },
    /// The friction of a joint.
    Bound { row: usize, bound: f64 },
}

impl Admitted {
    /// Projects these rows of the forces, and sets the columns of the derivative for them.
    fn project(&self, forces: &mut DVector<f64>, slope: &mut DMatrix<f64>) {
        match self {
            Self::Bound { row, bound } => {
                if forces[*row].abs() > *bound {
                    forces[*row] = forces[*row].clamp(-bound, *bound);
                    slope[(*row, *row)] = 0.0;
                }
            }
            Self::Cone { rows, friction: mu } => {
                let n = rows.end - 1;
                let along = rows.start..n;
                let (push, size) = (forces[n], forces.rows_range(along.clone()).norm());
                if push >= 0.0 && size <= mu * push {
                    return;
                }
                slope.view_mut((rows.start, rows.start), (rows.len(), rows.len())).fill(0.0);
                if mu * size <= -push {
                    forces.rows_range_mut(rows.clone()).fill(0.0);
                    return;
                }
                // Onto the cone: (μ e, 1) times its component along it. Here |λ_t| > 0.
                let e = forces.rows_range(along.clone()) / size;
                let share = 1.0 / (1.0 + mu * mu);
                let normal = share * (push + mu * size);
                let ray = DVector::from_iterator(rows.len(), e.iter().map(|e| mu * e).chain([1.0]));
                slope
                    .view_mut((rows.start, rows.start), (rows.len(), rows.len()))
                    .copy_from(&(&ray * ray.transpose() * share));
                let turns = mu * normal / size;
                let mut across = slope.view_mut((rows.start, rows.start), (along.len(), along.len()));
                across += (DMatrix::identity(along.len(), along.len()) - &e * e.transpose()) * turns;
                forces.rows_range_mut(rows.clone()).copy_from(&(ray * normal));
            }
        }
    }
}

/// The admissible forces of least norm with the same G λ; `None` if they are not found.
fn least(gram: &DMatrix<f64>, given: &DVector<f64>, admitted: &[Admitted]) -> Option<DVector<f64>> {
    let basis = Basis::of(gram);
    let own = gram.select_rows(&basis.rows);
    let spread = basis.solve(&own)?.transpose();
    let wanted = &own * given;
    let at = |eta: &DVector<f64>| {
        let (mut forces, mut slope) = (&spread * eta, DMatrix::identity(given.len(), given.len()));
        admitted.iter().for_each(|rows| rows.project(&mut forces, &mut slope));
        let error = &own * &forces - &wanted;
        (forces, slope, error)
    };
    let mut eta = (spread.transpose() * &spread).cholesky()?.solve(&(spread.transpose() * given));
    let mut now = at(&eta);
    for _ in 0..STEPS {
        let (forces, slope, error) = &now;
        if error.amax() <= EQUAL * EQUAL.sqrt() * wanted.amax() {
            return Some(forces.clone());
        }
        let step = (&own * slope * &spread).lu().solve(error)?;
        let shorter = (0..30).map(|k| 0.5_f64.powi(k)).find_map(|share| {
            let next = &eta - &step * share;
            let there = at(&next);
            (there.2.norm() < error.norm()).then_some((next, there))
        });
        let Some(next) = shorter else { break };
        (eta, now) = next;
    }
    let (forces, _, error) = now;
    (error.amax() <= EQUAL * wanted.amax()).then_some(forces)
}

impl<A: Space> Motion<'_, A> {
    /// Replaces forces of redundant contacts that are not admissible, if others of the same motion are.
    pub fn distribute(&mut self, (time, y): (f64, &[f64]), held: &mut ConstraintForces) -> Result<(), SimError> {
        let sim = self.sim;
        let mu = |own: &Lasting| sim.touches[own.touch].contact.law.friction();
        let largest = held.contacts.iter().fold(0.0, |most: f64, own| most.max(own.normal_force.abs()));
        let admissible = self.active.lasting.iter().zip(&held.contacts).all(|(own, force)| match own.hold {
            Hold::Latched | Hold::Presses { .. } => true,
            Hold::Sticks => force.normal_force.min(force.cone(mu(own))) >= -EQUAL * largest,
            Hold::Slides { .. } | Hold::Starts { .. } => force.normal_force >= -EQUAL * largest,
        });
        let holds = |(joint, force): (&DryJoint, &f64)| {
            joint.state != Dry::Holds || force.abs() <= (1.0 + EQUAL) * joint.friction
        };
        if admissible && self.active.dry.iter().zip(&held.joints).all(holds) {
            return Ok(());
        }
        let mut found = Assembled::new(self.sim.chain.nv());
        let lasting = self.active.lasting.clone();
        self.assemble((time, y), &lasting, Detail::ROWS, &mut found)?;
        let Some(mut equations) = self.equations(time, &found)? else { return Ok(()) };
        let Some(given) = equations.forces(&-found.offset()) else { return Ok(()) };
        let constraints = &found.constraints;
        let pushes = constraints.contacts.iter().filter(|contact| contact.own.hold != Hold::Latched);
        let cone = |it: &Contact| Admitted::Cone { rows: it.rows.clone(), friction: mu(&it.own) };
        let mut admitted: Vec<Admitted> = pushes.map(cone).collect();
        let first = given.len() - constraints.joints.len();
        let joints = constraints.joints.iter().enumerate();
        admitted.extend(joints.map(|(i, k)| Admitted::Bound { row: first + i, bound: self.active.dry[*k].friction }));
        let Some(forces) = least(&constraints.forces.times(&found.responses), &given, &admitted) else { return Ok(()) };
        let stored = held.contacts.iter_mut().zip(&lasting).filter(|(_, own)| own.is_rigid());
        for ((stored, _), contact) in stored.zip(&constraints.contacts) {
            stored.force = contact.force(forces.as_slice());
            stored.normal_force = forces[contact.rows.end - 1];
        }
        Ok(())
    }
}

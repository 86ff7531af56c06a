//! The equations of motion of a chain with constraints and compliant contacts: closed contacts, joint limits, joints held by
//! their dry friction.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | q̈₀ | nv | acceleration without constraint forces | `free` |
//! | R, F | m×nv | rows of the constraints; generalised directions of their forces | `rows`, `forces` |
//! | K | m×m | R M⁻¹ Fᵀ | `delassus` |
//! | λ | m | constraint forces | `lambda` |
//! | B | r | independent rows of R | `basis` |
//! | X | m×r | R = X R_B | `spread` |
//!
//! All constraints are solved together: R q̈ + drift = 0 with q̈ = q̈₀ + M⁻¹Fᵀλ gives K λ = −(R q̈₀ + drift). A sticking contact
//! has three rows (R = F = J). A sliding contact has the normal row, and its force acts along n − μ d. A joint held by its
//! dry friction has the row of its coordinate.
//!
//! **Redundant constraints.** A box on four corners has more rows than it can move against, and K is singular. The rows B,
//! found by a pivoted Cholesky factorisation of R M⁻¹ Rᵀ, then determine the motion, and the forces follow from a convention:
//! λ = X η, the forces of equal springs under all rows that a rigid displacement compresses. For F = R these are the
//! forces of least norm; for normal forces under a face they are affine in the position of the contact point. The motion does
//! not depend on the convention where the rows F have the same rank as R. They do not if contacts of one body slide in
//! different directions: a spinning box. Its motion is that of the convention, and flagged (`unique.rs`).

use super::assembled::{Assembled, ConstraintForces, Force};
use super::lasting::{Hold, Lasting};
use super::smooth::Motion;
use crate::contact::{At, Memory};
use crate::error::SimError;
use crate::state::{Basis, Space};
use nalgebra::{DMatrix, DVector, Vector3};

/// Pivots of K above this share of its diagonal belong to independent rows: far above the share of [`Basis`] that decides.
const INDEPENDENT: f64 = 1e-6;

impl<A: Space> Motion<'_, A> {
    /// dġ/dt and du/dt at q̈ = 0, from the curvature of paths and surfaces, by central differences of fourth order along the
    /// motion, with steps of 1e-3 over the largest joint velocity: their relative error is about 1e-12. For touches without a
    /// closed form.
    fn numerical_drift(
        &mut self,
        touch: usize,
        (q, qd, time): (&[f64], &[f64], f64),
    ) -> Result<(f64, Vector3<f64>), SimError> {
        let sim = self.sim;
        let one = &sim.touches[touch];
        let shake = one.motion.as_ref().map_or(0.0, |motion| motion.frequency());
        let speed = qd.iter().fold(shake, |m, x| m.max(x.abs()));
        if speed == 0.0 {
            return Ok((0.0, Vector3::zeros()));
        }
        let h = 1e-3 / speed.max(1e-3);
        let (mut rate, mut u) = (0.0, Vector3::zeros());
        let mut unit = q.to_vec();
        sim.normalise(&mut unit);
        // The differences do not see beyond the rows of a table.
        let near = one.near(time);
        let one = near.as_ref().unwrap_or(one);
        for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved = sim.chain.integrate(&unit, qd, steps * h)?;
            let (_, rate_there, u_there) = self.closing_of(one, &moved, qd, time + steps * h)?;
            rate += weight * rate_there;
            u += u_there * weight;
        }
        Ok((rate / (12.0 * h), u / (12.0 * h)))
    }

    /// The constraints of these contacts and of the joints that dry friction holds, the acceleration without their forces, and
    /// the response M⁻¹Fᵀ. Compliant contacts press: see `press`.
    pub fn assemble(
        &mut self,
        (time, y): (f64, &[f64]),
        lasting: &[Lasting],
        found: &mut Assembled,
    ) -> Result<(), SimError> {
        let (q, qd) = self.split(y);
        let sim = self.sim;
        let mut numerical = Vec::new();
        for own in lasting.iter().filter(|own| own.is_rigid() && !sim.touches[own.touch].has_closed_drift()) {
            numerical.push(self.numerical_drift(own.touch, (q, qd, time))?);
        }
        let mut numerical = numerical.into_iter();
        found.power = self.apply(time, q, qd, &mut found.tau)?;
        let dry = std::mem::take(&mut self.dry);
        let bristles = std::mem::take(&mut self.bristles);
        let noise = self.noise();
        let tail = &y[q.len() + qd.len() + 2..];
        let mut view = self.view(q)?;
        found.constraints.clear();
        found.pressed.clear();
        let placed: Vec<At<A>> = lasting.iter().map(|own| sim.touches[own.touch].at(&view, q, time)).collect();
        let points = placed.iter().map(|at| at.surface.map_or([None; 2], |place| [Some(place.point), place.against]));
        let drifts = view.drifts(points, qd)?;
        for ((own, at), drifts) in lasting.iter().zip(placed).zip(drifts) {
            let touch = &sim.touches[own.touch];
            match own.hold {
                Hold::Presses { damping, deepest } => {
                    let slot = bristles.iter().position(|&k| k == own.touch).map(|k| 3 * k);
                    let deflection = slot.map_or_else(Vector3::zeros, |k| Vector3::from_column_slice(&tail[k..k + 3]));
                    let memory = Memory { damping, deepest, deflection };
                    let (Some(place), Some(compliance)) = (at.surface, touch.contact.compliance) else { continue };
                    let u = touch.u(&place, &view, qd, time)?;
                    let rate = place.normal.dot(&u);
                    let pressed = compliance.press(&touch.contact.law, &memory, (at.gap, rate), &place.normal, &u)?;
                    let (force, normal) = (pressed.force, place.normal);
                    found.scratch.fill(0.0);
                    place.row_into(&view, force, &mut found.scratch)?;
                    found.tau.iter_mut().zip(&found.scratch).for_each(|(tau, f)| *tau += f);
                    found.power[1] += found.scratch.iter().zip(qd).map(|(f, v)| f * v).sum::<f64>();
                    let normal_force = normal.dot(&force);
                    found.pressed.push(Force { force, normal, normal_force, bends: pressed.bends });
                }
                _ => {
                    let drift = match touch.drift(&at, &view, drifts, qd, time) {
                        Some(closed) => closed?,
                        None => numerical.next().unwrap_or_default(),
                    };
                    found.constraints.add((own, touch), (&at, &view), (qd, time), drift, noise)?;
                }
            }
        }
        found.constraints.hold(&dry);
        let done = found.respond(&mut view, (qd, sim.gravity));
        (self.dry, self.bristles) = (dry, bristles);
        done
    }

    /// Accelerations and forces in the present mode.
    pub fn in_mode(&mut self, time: f64, y: &[f64]) -> Result<ConstraintForces, SimError> {
        let mut lasting = std::mem::take(&mut self.lasting);
        let mut found = std::mem::take(&mut self.assembled);
        let held = self.assemble((time, y), &lasting, &mut found).and_then(|()| self.solve(time, &lasting, &mut found));
        Self::keep_directions(&mut lasting, &found);
        (self.lasting, self.assembled) = (lasting, found);
        held
    }

    /// The acceleration of a gap in the present mode.
    pub fn gap_acceleration(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<f64, SimError> {
        let qdd = self.in_mode(time, y)?.qdd;
        let mut found = Assembled::new(self.sim.chain.nv());
        let own = Lasting { touch, hold: Hold::Slides { toward: Vector3::zeros() } };
        self.assemble((time, y), &[own], &mut found)?;
        Ok(found.constraints.rows.dot(0, qdd.as_slice()) + found.constraints.drifts[0])
    }

    fn solve(&self, time: f64, lasting: &[Lasting], found: &mut Assembled) -> Result<ConstraintForces, SimError> {
        let m = found.constraints.rows.len();
        let lambda = if m == 0 {
            DVector::zeros(0)
        } else if found.constraints.starts.is_empty() {
            self.forces(time, lasting, found, &found.delassus(), &-found.offset())?
        } else {
            self.starting_forces(time, lasting, found)?
        };
        let Assembled { constraints, responses, free, power, .. } = &*found;
        let mut held = ConstraintForces {
            qdd: free.clone(),
            contacts: Vec::with_capacity(lasting.len()),
            joints: vec![0.0; self.dry.len()],
            power: *power,
        };
        for (response, force) in responses.iter().zip(lambda.iter()) {
            held.qdd.iter_mut().zip(response).for_each(|(qdd, x)| *qdd += force * x);
        }
        let (mut rigid, mut pressed) = (constraints.contacts.iter(), found.pressed.iter());
        for own in lasting {
            let force = if own.is_rigid() {
                let Some(contact) = rigid.next() else { break };
                let force = contact.force(lambda.as_slice());
                held.power[1] += force.dot(&contact.velocity);
                let last = contact.rows.end - 1;
                Force { force, normal: contact.normal, normal_force: lambda[last], bends: Vector3::zeros() }
            } else {
                pressed.next().copied().unwrap_or_default()
            };
            held.contacts.push(force);
        }
        let first = m - constraints.joints.len();
        for (k, force) in constraints.joints.iter().zip(lambda.iter().skip(first)) {
            held.joints[*k] = *force;
        }
        Ok(held)
    }

    /// λ.
    pub fn forces(
        &self,
        time: f64,
        lasting: &[Lasting],
        found: &Assembled,
        k: &DMatrix<f64>,
        wanted: &DVector<f64>,
    ) -> Result<DVector<f64>, SimError> {
        let Assembled { constraints, own_responses, .. } = found;
        let m = wanted.len();
        let jam = |contact: usize| {
            let touch = &self.sim.touches[constraints.contacts[contact].touch];
            SimError::Jam { time, touch: touch.name.clone(), friction: touch.contact.law.friction() }
        };
        if m == 1 {
            // A unit force must open the gap; NaN does not.
            let opens = k[(0, 0)] > 0.0 && (!constraints.skew || self.yields(found, k[(0, 0)])?);
            return if opens || constraints.contacts.is_empty() { Ok(wanted / k[(0, 0)]) } else { Err(jam(0)) };
        }
        // The usual case: rows that are clearly independent, whose forces act along them. A factorisation decides and solves.
        if !constraints.skew
            && let Some(factor) = k.clone().cholesky()
        {
            let l = factor.l_dirty();
            if (0..m).all(|i| l[(i, i)] * l[(i, i)] > INDEPENDENT * k[(i, i)]) {
                return Ok(factor.solve(wanted));
            }
        }
        let own = constraints.skew.then(|| constraints.rows.times(own_responses));
        let gram = own.as_ref().unwrap_or(k);
        let basis = Basis::of(gram);
        let rank = basis.rows.len();
        if rank == m {
            let Some(inverse) = k.clone().try_inverse() else { return Err(jam(0)) };
            let rigid = lasting.iter().filter(|own| own.is_rigid());
            for (c, (contact, own)) in constraints.contacts.iter().zip(rigid).enumerate() {
                let slides = matches!(own.hold, Hold::Slides { .. } | Hold::Starts { .. }) && constraints.skew;
                // Sliding is consistent if a unit force, with the other constraints held, opens the gap.
                let row = contact.rows.start;
                let yields = 1.0 / inverse[(row, row)] > 1e-12 * gram[(row, row)]; // false for NaN
                if slides && !yields {
                    return Err(jam(c));
                }
            }
            return Ok(inverse * wanted);
        }
        // λ = X η; the rows B of K X η = wanted.
        let spread = basis.spread(gram);
        let folded = DMatrix::from_fn(rank, rank, |i, j| k.row(basis.rows[i]).tr_dot(&spread.column(j)));
        let wanted = DVector::from_fn(rank, |i, _| wanted[basis.rows[i]]);
        let Some(eta) = folded.lu().solve(&wanted) else { return Err(jam(0)) };
        Ok(spread * eta)
    }

    /// Whether the response of a single sliding contact is above the rounding of its terms.
    fn yields(&self, found: &Assembled, k: f64) -> Result<bool, SimError> {
        let along = found.constraints.rows.row(0).iter().zip(found.responses.row(0));
        let terms: f64 = along.map(|(r, x)| (r * x).abs()).sum();
        Ok(k > 1e-12 * terms)
    }
}

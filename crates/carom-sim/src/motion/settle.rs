//! Projection of a state onto the constraints of its contact mode, and the choice of this mode.

use super::dry::Dry;
use super::held::{Held, Hold, STILL, direction_of_slip};
use super::smooth::Motion;
use crate::contact::ContactMode;
use crate::error::SimError;
use crate::state::{Space, pseudo_inverse};
use nalgebra::{Matrix3, Vector3};

/// Gaps and gap rates up to this size are not corrected, m and m/s: a correction would only disturb the integrator.
const ROUNDING: f64 = 1e-15;

impl<A: Space> Motion<'_, A> {
    /// Sets the direction of beginning slip: opposite to the tangential force that sticking would need.
    pub fn slide_off(&mut self, held: &Held) {
        let tangential = held.force - held.normal * held.normal_force;
        self.slip = -tangential.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    }

    /// Decides which joints are held by their dry friction: those at rest whose constraint force does not exceed it.
    pub fn settle_joints(&mut self, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let nq = self.sim.chain.nq();
        let speed = self.split(y).1.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for joint in &mut self.dry {
            let rate = &mut y[nq + joint.v];
            joint.state = if rate.abs() > STILL * speed { Dry::Brakes(rate.signum()) } else { Dry::Holds };
            if joint.state == Dry::Holds {
                *rate = 0.0;
            }
        }
        // The joint with the largest overload begins to slip; then the forces of the others are computed again.
        for _ in 0..self.dry.len() {
            let held = self.in_mode(time, y)?;
            let over = |k: &usize| held.joints[*k].abs() - self.dry[*k].friction;
            let Some(k) = (0..self.dry.len()).filter(|k| over(k) > 0.0).max_by(|a, b| over(a).total_cmp(&over(b)))
            else {
                break;
            };
            self.dry[k].state = Dry::Brakes(-held.joints[k].signum());
        }
        Ok(())
    }

    /// The mode of a lasting contact: latched, sticking or sliding.
    pub fn lasting_mode(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<ContactMode, SimError> {
        let (q, qd) = self.split(y);
        let (_, _, u) = self.closing(touch, q, qd, time)?;
        let rule = &self.sim.touches[touch].contact;
        if rule.latch {
            return Ok(ContactMode::Latched { touch });
        }
        if rule.law.friction() == 0.0 || self.sim.touches[touch].link().is_none() {
            return Ok(ContactMode::Sliding { touch });
        }
        let held = self.held(time, y, Some((touch, Hold::Sticks)))?;
        if let Some(direction) = direction_of_slip(u, held.normal, qd) {
            self.slip = direction;
            return Ok(ContactMode::Sliding { touch });
        }
        let tangential = held.force - held.normal * held.normal_force;
        if tangential.norm() <= rule.law.friction() * held.normal_force {
            return Ok(ContactMode::Sticking { touch });
        }
        self.slide_off(&held);
        Ok(ContactMode::Sliding { touch })
    }

    /// Advances a lasting contact by `span` seconds in one step of second order; the span is below the Zeno time.
    pub fn pass(&mut self, touch: usize, span: f64, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let mode = self.lasting_mode(touch, time, y)?;
        let hold = if matches!(mode, ContactMode::Sliding { .. }) { Hold::Slides } else { Hold::Sticks };
        let held = self.held(time, y, Some((touch, hold)))?;
        let nq = self.sim.chain.nq();
        let (q, qd) = self.split(y);
        let mean: Vec<f64> = qd.iter().zip(held.qdd.iter()).map(|(v, a)| v + a * span / 2.0).collect();
        let moved = self.sim.chain.integrate(q, &mean, span)?;
        y[..nq].copy_from_slice(&moved);
        for (v, a) in y[nq..].iter_mut().zip(held.qdd.iter()) {
            *v += a * span;
        }
        Ok(())
    }

    /// Sets the normal velocity to zero by a normal impulse, and the gap to zero by a displacement along its response. Returns
    /// whether it changed the state.
    pub fn stop_normal(&mut self, touch: usize, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let (q, qd) = self.split(y);
        let (q, qd) = (q.to_vec(), qd.to_vec());
        let sim = self.sim;
        let nq = sim.chain.nq();
        let mut view = self.view(&q)?;
        let at = sim.touches[touch].at(&view, &q, time);
        let row = sim.touches[touch].row(&at, &view)?;
        let rate = sim.touches[touch].rate(&at, &view, &qd, time)?;
        if at.gap.abs() <= ROUNDING && rate.abs() <= ROUNDING {
            return Ok(false);
        }
        let response = view.kin.solve(row.as_slice())?;
        let inverse_mass = row.dot(&response);
        let back: Vec<f64> = response.iter().map(|x| -x * at.gap / inverse_mass).collect();
        let moved = sim.chain.integrate(&q, &back, 1.0)?;
        y[..nq].copy_from_slice(&moved);
        for (v, x) in y[nq..].iter_mut().zip(response.iter()) {
            *v -= x * rate / inverse_mass;
        }
        Ok(true)
    }

    /// Updates the direction of slip, which turns in space; the witness function for its stop uses this direction. Returns the
    /// slip velocity as a share of the largest joint velocity.
    pub fn follow_slip(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let (q, qd) = (q.to_vec(), qd.to_vec());
        let sim = self.sim;
        let view = self.view(&q)?;
        let Some(place) = sim.touches[touch].at(&view, &q, time).surface else { return Ok(0.0) };
        let u = sim.touches[touch].u(&place, &view, &qd, time)?;
        if let Some(direction) = direction_of_slip(u, place.normal, &qd) {
            self.slip = direction;
        }
        let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        Ok((u - place.normal * place.normal.dot(&u)).norm() / speed.max(f64::MIN_POSITIVE))
    }

    /// Sets the velocity of the contact point relative to the surface to zero.
    pub fn stop_slip(&mut self, touch: usize, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let (q, qd) = self.split(y);
        let (q, qd) = (q.to_vec(), qd.to_vec());
        let sim = self.sim;
        let mut view = self.view(&q)?;
        let at = sim.touches[touch].at(&view, &q, time);
        let Some(place) = at.surface else { return Ok(()) };
        let u = sim.touches[touch].u(&place, &view, &qd, time)?;
        let jacobian = place.jacobian(&view);
        let response = view.responses(&jacobian)?;
        let h: Matrix3<f64> = (&jacobian * &response).fixed_view::<3, 3>(0, 0).into_owned();
        let jump = &response * (pseudo_inverse(h) * u);
        for (v, x) in y[sim.chain.nq()..].iter_mut().zip(jump.iter()) {
            *v -= x;
        }
        Ok(())
    }
}

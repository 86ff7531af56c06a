//! The equations of motion of a chain with constraints or a compliant contact: a lasting contact, a joint limit, joints held
//! by their dry friction.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | q̈₀ | nv | acceleration without constraint forces | `free` |
//! | R, F | m×nv | rows of the constraints; generalised directions of their forces | `rows`, `forces` |
//! | K | m×m | R M⁻¹ Fᵀ | `delassus` |
//! | λ | m | constraint forces | `lambda` |
//! | d | 3 | unit direction of slip | `slip` |
//!
//! All constraints are solved together: R q̈ + drift = 0 with q̈ = q̈₀ + M⁻¹Fᵀλ gives K λ = −(R q̈₀ + drift). A sticking contact
//! has three rows (R = F = J). A sliding contact has the normal row, and its force acts along n − μ d. A joint held by its
//! dry friction has the row of its coordinate.

use super::dry::Dry;
use super::smooth::Motion;
use crate::contact::{ContactMode, Memory};
use crate::error::SimError;
use crate::state::Space;
use carom_impact::least_norm;
use nalgebra::{DMatrix, DVector, Vector3};

/// Accelerations and constraint forces at one state.
pub(crate) struct Held {
    pub qdd: DVector<f64>,
    /// Force of the lasting contact on the robot, world, N.
    pub force: Vector3<f64>,
    pub normal: Vector3<f64>,
    /// Its normal component, or the force of a joint limit; it must not be negative.
    pub normal_force: f64,
    /// Constraint forces of the joints that dry friction holds, in the order of `dry`; 0 for the others.
    pub joints: Vec<f64>,
    /// Power of the drive, and of all dissipative forces.
    pub power: [f64; 2],
    /// Rate of the bristle's deflection, world, m/s.
    pub bends: Vector3<f64>,
}

/// Slip below this share of the largest joint velocity has no direction.
pub(crate) const STILL: f64 = 1e-9;

/// How a touch enters the equations of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Hold {
    Slides,
    Sticks,
    /// A compliant contact with this damping: a force without a constraint.
    Presses(f64),
}

impl<A: Space> Motion<'_, A> {
    /// dġ/dt and du/dt at q̈ = 0, from the curvature of paths and surfaces. In closed form where there is one, otherwise by
    /// central differences of fourth order along the motion, with steps of 1e-3 over the largest joint velocity: their
    /// relative error is about 1e-12.
    fn drift(&mut self, touch: usize, q: &[f64], qd: &[f64], time: f64) -> Result<(f64, Vector3<f64>), SimError> {
        let sim = self.sim;
        {
            let mut view = self.view(q)?;
            let at = sim.touches[touch].at(&view, q, time);
            if let Some(closed) = sim.touches[touch].drift(&at, &mut view, qd, time) {
                return closed;
            }
        }
        let shake = sim.touches[touch].motion.map_or(0.0, |motion| motion.frequency);
        let speed = qd.iter().fold(shake.abs(), |m, x| m.max(x.abs()));
        if speed == 0.0 {
            return Ok((0.0, Vector3::zeros()));
        }
        let h = 1e-3 / speed.max(1e-3);
        let (mut rate, mut u) = (0.0, Vector3::zeros());
        let mut unit = q.to_vec();
        sim.normalise(&mut unit);
        for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved = sim.chain.integrate(&unit, qd, steps * h)?;
            let (_, rate_there, u_there) = self.closing(touch, &moved, qd, time + steps * h)?;
            rate += weight * rate_there;
            u += u_there * weight;
        }
        Ok((rate / (12.0 * h), u / (12.0 * h)))
    }

    /// The acceleration of a gap in the present mode.
    pub fn gap_acceleration(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let (drift, _) = self.drift(touch, q, qd, time)?;
        let qdd = self.in_mode(time, y)?.qdd;
        let sim = self.sim;
        let view = self.view(q)?;
        let at = sim.touches[touch].at(&view, q, time);
        Ok(sim.touches[touch].row(&at, &view)?.dot(&qdd) + drift)
    }

    /// Accelerations and forces in the present mode.
    pub fn in_mode(&mut self, time: f64, y: &[f64]) -> Result<Held, SimError> {
        let lasting = match self.mode {
            ContactMode::Free | ContactMode::Several => None,
            ContactMode::Sliding { touch } => Some((touch, Hold::Slides)),
            ContactMode::Sticking { touch } | ContactMode::Latched { touch } => Some((touch, Hold::Sticks)),
            ContactMode::Pressing { touch, damping } => Some((touch, Hold::Presses(damping))),
        };
        self.held(time, y, lasting)
    }

    /// Accelerations and forces with (or without) a lasting contact.
    pub fn held(&mut self, time: f64, y: &[f64], lasting: Option<(usize, Hold)>) -> Result<Held, SimError> {
        let (q, qd) = self.split(y);
        let constrains = lasting.filter(|(_, hold)| !matches!(hold, Hold::Presses(_)));
        let drift = constrains.map(|(touch, _)| self.drift(touch, q, qd, time)).transpose()?;
        let (sim, slip, dry, deepest) = (self.sim, self.slip, self.dry.clone(), self.deepest);
        let deflection = y.get(q.len() + qd.len() + 2..).filter(|tail| !tail.is_empty());
        let deflection = deflection.map_or_else(Vector3::zeros, Vector3::from_column_slice);
        let (mut tau, mut power) = self.applied(time, q, qd)?;
        let mut view = self.view(q)?;
        let (mut pressed, mut bends) = (None, Vector3::zeros());
        if let Some((touch, Hold::Presses(damping))) = lasting {
            let touch = &sim.touches[touch];
            let at = touch.at(&view, q, time);
            if let (Some(place), Some(compliance)) = (at.surface, touch.contact.compliance) {
                let u = touch.u(&place, &view, qd, time)?;
                let rate = place.normal.dot(&u);
                let memory = Memory { damping, deepest, deflection };
                let found = compliance.press(&touch.contact.law, &memory, (at.gap, rate), &place.normal, &u)?;
                let force = found.force;
                bends = found.bends;
                let joints = place.row(&view, force)?;
                tau.iter_mut().zip(joints.iter()).for_each(|(tau, f)| *tau += f);
                power[1] += joints.iter().zip(qd).map(|(f, v)| f * v).sum::<f64>();
                pressed = Some((force, place.normal));
            }
        }
        let mut free = DVector::zeros(qd.len());
        view.acceleration_into(qd, &tau, sim.gravity, free.as_mut_slice())?;

        let (mut rows, mut forces, mut drifts) = (Vec::new(), Vec::new(), Vec::new());
        let (mut contact, mut normal, mut along) = (0, Vector3::zeros(), Vector3::zeros());
        let mut point_velocity = Vector3::zeros();
        if let (Some((touch, hold)), Some((gap_drift, u_drift))) = (lasting, drift) {
            let touch = &sim.touches[touch];
            let at = touch.at(&view, q, time);
            match (at.surface, hold) {
                (Some(place), Hold::Sticks) => {
                    let jacobian = place.jacobian(&view);
                    rows.extend((0..3).map(|k| jacobian.row(k).transpose()));
                    forces.extend(rows.iter().cloned());
                    drifts.extend(u_drift.iter());
                    normal = place.normal;
                }
                (Some(place), Hold::Slides) => {
                    let mu = touch.contact.law.friction();
                    let u = touch.u(&place, &view, qd, time)?;
                    let d = direction_of_slip(u, place.normal, qd).unwrap_or(slip);
                    normal = place.normal;
                    along = if mu > 0.0 { normal - d * mu } else { normal };
                    rows.push(touch.row(&at, &view)?);
                    forces.push(place.row(&view, along)?);
                    drifts.push(gap_drift);
                }
                (_, Hold::Presses(_)) => {}
                (None, _) => {
                    rows.push(touch.row(&at, &view)?);
                    forces.push(rows[0].clone());
                    drifts.push(gap_drift);
                }
            }
            contact = rows.len();
            if let Some(place) = at.surface {
                point_velocity = place.velocity(&view, qd)?;
            }
        }
        for joint in dry.iter().filter(|joint| joint.state == Dry::Holds) {
            let mut row = DVector::zeros(qd.len());
            row[joint.v] = 1.0;
            rows.push(row.clone());
            forces.push(row);
            drifts.push(0.0);
        }

        let mut held = Held {
            qdd: free,
            force: Vector3::zeros(),
            normal,
            normal_force: 0.0,
            joints: vec![0.0; dry.len()],
            power,
            bends,
        };
        if let Some((force, normal)) = pressed {
            (held.force, held.normal, held.normal_force) = (force, normal, normal.dot(&force));
        }
        if rows.is_empty() {
            return Ok(held);
        }
        let responses: Vec<DVector<f64>> =
            forces.iter().map(|force| view.kin.solve(force.as_slice())).collect::<Result<_, _>>()?;
        let delassus = DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i].dot(&responses[j]));
        let wanted = DVector::from_fn(rows.len(), |i, _| -(rows[i].dot(&held.qdd) + drifts[i]));
        let slides = matches!(lasting, Some((_, Hold::Slides)));
        if let (true, Some((touch, _))) = (slides, lasting) {
            // Sliding is consistent if a unit force, with the other constraints held, opens the gap; NaN is not.
            let mut unit = DVector::zeros(rows.len());
            unit[0] = 1.0;
            let opens = solve(&delassus, &unit)[0];
            let mu = sim.touches[touch].contact.law.friction();
            let yields = 1.0 / opens > 1e-12 * rows[0].dot(&view.kin.solve(rows[0].as_slice())?);
            if !yields {
                return Err(SimError::Jam { time, touch: sim.touches[touch].name.clone(), friction: mu });
            }
        }
        let lambda = solve(&delassus, &wanted);
        for (response, force) in responses.iter().zip(lambda.iter()) {
            held.qdd.axpy(*force, response, 1.0);
        }
        match contact {
            0 => {}
            1 if slides || normal != Vector3::zeros() => {
                held.force = along * lambda[0];
                held.normal_force = lambda[0];
            }
            1 => held.normal_force = lambda[0],
            _ => {
                held.force = Vector3::new(lambda[0], lambda[1], lambda[2]);
                held.normal_force = normal.dot(&held.force);
            }
        }
        if pressed.is_none() {
            power[1] += held.force.dot(&point_velocity);
            held.power = power;
        }
        let stuck = dry.iter().enumerate().filter(|(_, joint)| joint.state == Dry::Holds).map(|(k, _)| k);
        for (k, force) in stuck.zip(lambda.iter().skip(contact)) {
            held.joints[k] = *force;
        }
        Ok(held)
    }
}

/// The least-norm solution K⁺b: forces along directions that no joint moves are zero.
fn solve(k: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    if k.nrows() == 1 {
        return b / k[(0, 0)];
    }
    least_norm(k, b, 1e-12)
}

/// Unit direction of the tangential part of u; `None` if it is zero up to rounding.
pub(crate) fn direction_of_slip(u: Vector3<f64>, n: Vector3<f64>, qd: &[f64]) -> Option<Vector3<f64>> {
    let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (u - n * n.dot(&u)).try_normalize(STILL * speed)
}

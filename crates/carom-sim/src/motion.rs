//! The smooth motion of a chain in one mode of contact: free, sliding or sticking, and what is watched in it.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | g̈₀, u̇₀ | 1, 3 | accelerations of gap and touching point without contact force | `gap_free`, `u_free` |
//! | λ | 3 | contact force, world, N | `force` |
//! | d | 3 | unit direction of slip | `slip` |
//!
//! Sliding: λ = λₙ(n − μ d), λₙ = −g̈₀/(nᵀHn − μ nᵀHd). Sticking: λ = −H⁺u̇₀.

use crate::error::SimError;
use crate::leg::{Flow, Witness};
use crate::simulate::{Drive, Simulation};
use crate::touch::TouchKind;
use crate::trajectory::ContactMode;
use carom_chain::{Coordinates, Kinematics, Spatial, Workspace};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// State vectors are (q, qd).
pub(crate) struct Motion<'a> {
    pub sim: &'a Simulation,
    pub workspace: Workspace<Spatial<f64>>,
    pub mode: ContactMode,
    /// Direction of slip while the slip itself is too small to show it.
    pub slip: Vector3<f64>,
    /// A touch whose witness sleeps, and until when.
    pub asleep: Option<(usize, f64)>,
}

/// A lasting contact's acceleration and force.
pub(crate) struct Held {
    pub qdd: DVector<f64>,
    pub force: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub normal_force: f64,
}

/// Slip slower than this share of the joints' speed has no direction of its own.
const STILL: f64 = 1e-9;

/// What a witness watches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Watch {
    Gap(usize),
    /// The contact would have to pull.
    NormalForce,
    /// Slip comes to rest.
    SlipStops,
    /// Friction no longer holds.
    Cone,
}

impl Simulation {
    /// Makes the quaternions in q unit again: stages and steps of the integration leave the sphere by their error. Says
    /// whether any was off.
    fn normalise(&self, q: &mut [f64]) -> bool {
        let mut changed = false;
        for joint in self.chain.joints() {
            if let Coordinates::Own { q: own, v } = &joint.coordinates
                && own.len() != v.len()
            {
                let quaternion = &mut q[own.start + 3..own.end];
                let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                changed |= (norm - 1.0).abs() > f64::EPSILON;
                quaternion.iter_mut().for_each(|x| *x /= norm);
            }
        }
        changed
    }
}

impl<'a> Motion<'a> {
    /// Free motion of a simulation's chain.
    pub fn new(sim: &'a Simulation) -> Self {
        let workspace = sim.chain.workspace();
        Self { sim, workspace, mode: ContactMode::Free, slip: Vector3::zeros(), asleep: None }
    }

    pub fn split<'y>(&self, y: &'y [f64]) -> (&'y [f64], &'y [f64]) {
        y.split_at(self.sim.chain.nq())
    }

    pub fn energy(&mut self, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let mut kin = self.workspace.update(&self.sim.chain, q)?;
        Ok(kin.kinetic_energy(qd)? + kin.potential_energy(self.sim.gravity))
    }

    /// q̈ without contact force.
    fn free_acceleration(
        sim: &Simulation,
        kin: &mut Kinematics<Spatial<f64>>,
        q: &[f64],
        qd: &[f64],
    ) -> Result<DVector<f64>, SimError> {
        let mut tau = match &sim.drive {
            Drive::Off => vec![0.0; qd.len()],
            Drive::Constant(tau) => tau.clone(),
            Drive::Pd { kp, kd, target } => (0..qd.len()).map(|i| kp * (target[i] - q[i]) - kd * qd[i]).collect(),
            Drive::GravityCompensation => kin.gravity_force(sim.gravity).as_slice().to_vec(),
        };
        for joint in sim.chain.joints() {
            if let Coordinates::Own { v, .. } = &joint.coordinates {
                for i in v.clone() {
                    tau[i] -= joint.damping * qd[i];
                }
            }
        }
        Ok(kin.forward_dynamics(qd, &tau, sim.gravity)?)
    }

    /// Gap, its rate and the touching point's velocity at one state.
    pub fn closing(&mut self, touch: usize, q: &[f64], qd: &[f64]) -> Result<(f64, f64, Vector3<f64>), SimError> {
        let sim = self.sim;
        let kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let rate = sim.touches[touch].gap_rate(&at, &kin, qd)?;
        let u = match at.surface {
            Some((point, _)) => kin.point_velocity(point, qd)?,
            None => Vector3::zeros(),
        };
        Ok((at.gap, rate, u))
    }

    /// dġ/dt and du/dt while no joint accelerates: what curvature of paths and surfaces does. Central differences of
    /// fourth order along the motion; with steps of 1e-3 of the joints' own time their error is about 1e-12 of the terms.
    fn drift(&mut self, touch: usize, q: &[f64], qd: &[f64]) -> Result<(f64, Vector3<f64>), SimError> {
        let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        if speed == 0.0 {
            return Ok((0.0, Vector3::zeros()));
        }
        let h = 1e-3 / speed.max(1e-3);
        let (mut rate, mut u) = (0.0, Vector3::zeros());
        let mut unit = q.to_vec();
        self.sim.normalise(&mut unit);
        for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let moved = self.sim.chain.integrate(&unit, qd, steps * h)?;
            let (_, rate_there, u_there) = self.closing(touch, &moved, qd)?;
            rate += weight * rate_there;
            u += u_there * weight;
        }
        Ok((rate / (12.0 * h), u / (12.0 * h)))
    }

    /// The acceleration of the gap in free motion.
    pub fn gap_free(&mut self, touch: usize, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let (drift, _) = self.drift(touch, q, qd)?;
        let sim = self.sim;
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let qdd = Self::free_acceleration(sim, &mut kin, q, qd)?;
        let at = sim.touches[touch].at(&kin, q);
        Ok(sim.touches[touch].normal_row(&at, &kin)?.dot(&qdd) + drift)
    }

    /// A lasting contact's force and acceleration.
    pub fn held(&mut self, time: f64, y: &[f64], touch: usize, sticking: bool) -> Result<Held, SimError> {
        let (q, qd) = self.split(y);
        let (gap_drift, u_drift) = self.drift(touch, q, qd)?;
        let (sim, slip) = (self.sim, self.slip);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let qdd = Self::free_acceleration(sim, &mut kin, q, qd)?;
        let at = sim.touches[touch].at(&kin, q);
        let Some((j, (_, n))) = sim.touches[touch].jacobian(&at, &kin).zip(at.surface) else {
            let row = sim.touches[touch].normal_row(&at, &kin)?;
            let response = kin.solve(row.as_slice())?;
            let force = -(row.dot(&qdd) + gap_drift) / row.dot(&response);
            let normal = Vector3::zeros();
            return Ok(Held { qdd: qdd + response * force, force: normal, normal, normal_force: force });
        };
        let response = responses(&mut kin, &j)?;
        let h = Matrix3::from_fn(|a, b| j.row(a).dot(&response.column(b).transpose()));
        let mu = sim.contact.friction;
        let force = if sticking {
            let u_free = Vector3::from_iterator((&j * &qdd).iter().copied()) + u_drift;
            -(pseudo_inverse(h) * u_free)
        } else {
            let u = Vector3::from_iterator((&j * DVector::from_column_slice(qd)).iter().copied());
            let d = direction_of_slip(u, n, qd).unwrap_or(slip) * if mu > 0.0 { 1.0 } else { 0.0 };
            let c = n.dot(&(h * n));
            let inverse_mass = c - mu * n.dot(&(h * d));
            if inverse_mass <= c * 1e-12 {
                return Err(SimError::Jam { time, touch: sim.touches[touch].name.clone(), friction: mu });
            }
            let gap_free = n.dot(&Vector3::from_iterator((&j * &qdd).iter().copied())) + gap_drift;
            (n - d * mu) * (-gap_free / inverse_mass)
        };
        Ok(Held { qdd: qdd + &response * force, force, normal: n, normal_force: n.dot(&force) })
    }

    pub fn watches(&self) -> Vec<Watch> {
        let asleep = self.asleep.map(|(touch, _)| touch);
        let gaps = (0..self.sim.touches.len()).filter(|&k| Some(k) != self.mode.touch() && Some(k) != asleep);
        let mut watches: Vec<Watch> = gaps.map(Watch::Gap).collect();
        match self.mode {
            ContactMode::Free => {}
            ContactMode::Sliding { .. } if self.sim.contact.friction == 0.0 => watches.push(Watch::NormalForce),
            ContactMode::Sliding { .. } => watches.extend([Watch::NormalForce, Watch::SlipStops]),
            ContactMode::Sticking { .. } => watches.extend([Watch::NormalForce, Watch::Cone]),
        }
        watches
    }

    /// Slip begins against the friction that would be needed to hold.
    pub fn slide_off(&mut self, held: &Held) {
        let tangential = held.force - held.normal * held.normal_force;
        self.slip = -tangential.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    }

    pub fn lasting_mode(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<ContactMode, SimError> {
        let (q, qd) = self.split(y);
        let (_, _, u) = self.closing(touch, q, qd)?;
        let mu = self.sim.contact.friction;
        let surface = matches!(self.sim.touches[touch].kind, TouchKind::Surface { .. });
        if mu == 0.0 || !surface {
            return Ok(ContactMode::Sliding { touch });
        }
        let held = self.held(time, y, touch, true)?;
        if let Some(direction) = direction_of_slip(u, held.normal, qd) {
            self.slip = direction;
            return Ok(ContactMode::Sliding { touch });
        }
        let tangential = held.force - held.normal * held.normal_force;
        if tangential.norm() <= mu * held.normal_force {
            return Ok(ContactMode::Sticking { touch });
        }
        self.slide_off(&held);
        Ok(ContactMode::Sliding { touch })
    }

    /// Goes through `span` seconds of lasting contact at once, to second order: the span is below the Zeno time.
    pub fn pass(&mut self, touch: usize, span: f64, time: f64, y: &mut [f64]) -> Result<(), SimError> {
        let mode = self.lasting_mode(touch, time, y)?;
        let held = self.held(time, y, touch, matches!(mode, ContactMode::Sticking { .. }))?;
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

    /// Takes the normal velocity out by a normal impulse, and the gap by a step along its response.
    pub fn stop_normal(&mut self, touch: usize, y: &mut [f64]) -> Result<bool, SimError> {
        let sim = self.sim;
        let nq = sim.chain.nq();
        let (q, qd) = y.split_at(nq);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let row = sim.touches[touch].normal_row(&at, &kin)?;
        let rate = sim.touches[touch].gap_rate(&at, &kin, qd)?;
        let response = kin.solve(row.as_slice())?;
        let inverse_mass = row.dot(&response);
        let back: Vec<f64> = response.iter().map(|x| -x * at.gap / inverse_mass).collect();
        let moved = sim.chain.integrate(q, &back, 1.0)?;
        let changed = at.gap != 0.0 || rate != 0.0;
        y[..nq].copy_from_slice(&moved);
        for (v, x) in y[nq..].iter_mut().zip(response.iter()) {
            *v -= x * rate / inverse_mass;
        }
        Ok(changed)
    }

    /// Takes all velocity of the touching point out.
    pub fn stop_slip(&mut self, touch: usize, y: &mut [f64]) -> Result<(), SimError> {
        let sim = self.sim;
        let nq = sim.chain.nq();
        let (q, qd) = y.split_at(nq);
        let mut kin = self.workspace.update(&sim.chain, q)?;
        let at = sim.touches[touch].at(&kin, q);
        let Some(j) = sim.touches[touch].jacobian(&at, &kin) else { return Ok(()) };
        let response = responses(&mut kin, &j)?;
        let h = Matrix3::from_fn(|a, b| j.row(a).dot(&response.column(b).transpose()));
        let u = Vector3::from_iterator((&j * DVector::from_column_slice(qd)).iter().copied());
        let jump = &response * (pseudo_inverse(h) * u);
        for (v, x) in y[nq..].iter_mut().zip(jump.iter()) {
            *v -= x;
        }
        Ok(())
    }
}

/// M⁻¹Jᵀ.
fn responses(kin: &mut Kinematics<Spatial<f64>>, j: &DMatrix<f64>) -> Result<DMatrix<f64>, SimError> {
    let mut response = DMatrix::zeros(j.ncols(), 3);
    for k in 0..3 {
        let row: Vec<f64> = j.row(k).iter().copied().collect();
        response.set_column(k, &kin.solve(&row)?);
    }
    Ok(response)
}

/// H⁺: a planar arm moves its tip in two directions only.
fn pseudo_inverse(h: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = h.symmetric_eigen();
    let least = eigen.eigenvalues.max() * 1e-12;
    let inverse = eigen.eigenvalues.map(|x| if x > least { 1.0 / x } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Unit direction of the tangential part of u; `None` if that is still.
fn direction_of_slip(u: Vector3<f64>, n: Vector3<f64>, qd: &[f64]) -> Option<Vector3<f64>> {
    let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (u - n * n.dot(&u)).try_normalize(STILL * speed)
}

impl Flow for Motion<'_> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (sim, (q, qd)) = (self.sim, self.split(y));
        let qdd = match self.mode {
            ContactMode::Free => {
                let mut kin = self.workspace.update(&sim.chain, q)?;
                Self::free_acceleration(sim, &mut kin, q, qd)?
            }
            ContactMode::Sliding { touch } => self.held(time, y, touch, false)?.qdd,
            ContactMode::Sticking { touch } => self.held(time, y, touch, true)?.qdd,
        };
        let (q_rate, qd_rate) = out.split_at_mut(sim.chain.nq());
        sim.chain.q_rate_into(q, qd, q_rate);
        qd_rate.copy_from_slice(qdd.as_slice());
        Ok(())
    }

    fn witnesses(&mut self, time: f64, y: &[f64], out: &mut Vec<Witness>) -> Result<(), SimError> {
        out.clear();
        let (q, qd) = self.split(y);
        let held = match self.mode {
            ContactMode::Free => None,
            ContactMode::Sliding { touch } => Some((touch, self.held(time, y, touch, false)?)),
            ContactMode::Sticking { touch } => Some((touch, self.held(time, y, touch, true)?)),
        };
        for watch in self.watches() {
            let witness = match (watch, &held) {
                (Watch::Gap(touch), _) => {
                    let (gap, rate, _) = self.closing(touch, q, qd)?;
                    Witness { value: gap, rate: Some(rate) }
                }
                (Watch::NormalForce, Some((_, held))) => Witness { value: held.normal_force, rate: None },
                (Watch::SlipStops, Some((touch, _))) => {
                    let (_, _, u) = self.closing(*touch, q, qd)?;
                    Witness { value: u.dot(&self.slip), rate: None }
                }
                (Watch::Cone, Some((_, held))) => {
                    let tangential = held.force - held.normal * held.normal_force;
                    let value = self.sim.contact.friction * held.normal_force - tangential.norm();
                    Witness { value, rate: None }
                }
                (_, None) => Witness { value: 1.0, rate: None },
            };
            out.push(witness);
        }
        Ok(())
    }

    fn settle(&mut self, _: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let changed = self.sim.normalise(y);
        match self.mode {
            ContactMode::Free => Ok(changed),
            ContactMode::Sliding { touch } => Ok(self.stop_normal(touch, y)? || changed),
            ContactMode::Sticking { touch } => {
                let moved = self.stop_normal(touch, y)?;
                self.stop_slip(touch, y)?;
                Ok(moved || changed)
            }
        }
    }
}

//! The derivatives of the accelerations of one contact mode by its state.
//!
//! Symbols as in `held.rs`, and
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | L, μ | l×nv, l | rows of the closed loops, and their forces | `loops`, `mu` |
//! | γ, κ | m, l | drifts of the rows R and L | – |
//! | β | – | bristle rates of compliant contacts | – |
//! | δ̄ | – | change with the state at constant q̈, λ, μ | `changes` |
//!
//! The motion satisfies M q̈ + b = τ + Fᵀλ + Lᵀμ, R q̈ + γ = 0 and L q̈ + κ = 0. So
//!
//! ```text
//! M δq̈ = Fᵀδλ + Lᵀδμ + δ̄(τ + Fᵀλ + Lᵀμ) − δ̄(M q̈ + b),   R δq̈ = −δ̄(R q̈ + γ),   L δq̈ = −δ̄(L q̈ + κ)
//! ```
//!
//! with the matrices of the motion itself, which are factored once. δ̄(M q̈ + b) is that of the inverse dynamics in closed form; the rest
//! ([`Motion::balance`]) knows no inertia: controllers, and where the contacts are.

use super::active_set::Hold;
use super::assembled::Assembled;
use super::equations::Equations;
use super::held::Detail;
use super::rows::push;
use super::smooth::Motion;
use crate::error::SimError;
use crate::model::{Motor, Number};
use crate::state::{EXACT, Loops, Space};
use carom_chain::Rows;
use carom_impact::least_norm;
use nalgebra::{DMatrix, DVector};

/// The motion at a state, about which it is linearised.
pub(crate) struct Linear {
    found: Assembled,
    equations: Option<Equations>,
    loops: Option<Loops>,
    qdd: Vec<f64>,
    mu: DVector<f64>,
    /// ∂(M q̈ + b)/∂q and ∂(M q̈ + b)/∂q̇.
    pub inertial: [DMatrix<f64>; 2],
    /// The motors that are at the limit of their force: they give the same beside this state.
    limited: Vec<bool>,
}

impl<A: Space> Motion<'_, A> {
    /// Whether the present mode can be linearised. The direction of slip that begins is that of an acceleration.
    pub fn is_linear(&self) -> bool {
        !self.active.lasting.iter().any(|own| matches!(own.hold, Hold::Starts { .. }))
    }

    /// The motion in the present mode at a state.
    pub fn linear(&mut self, time: f64, y: &[f64]) -> Result<Linear, SimError> {
        let (q, qd) = self.sim.split(y);
        let gravity = self.sim.gravity;
        let lasting = self.active.lasting.clone();
        let mut found = Assembled::new(qd.len());
        self.assemble((time, y), &lasting, Detail { locks: true, own: true }, &mut found)?;
        let mut equations = None;
        let mut qdd = found.free.as_slice().to_vec();
        found.lambda = DVector::zeros(found.constraints.rows.len());
        if !found.lambda.is_empty() {
            let mut own = self.equations(time, &found)?.ok_or_else(|| self.jam(time, &found, 0))?;
            found.lambda = own.forces(&-found.offset()).ok_or_else(|| self.jam(time, &found, 0))?;
            equations = Some(own);
            push(&mut qdd, &found.responses, found.lambda.as_slice());
        }
        let mut view = self.view(q)?;
        let loops = view.closed()?;
        let mut mu = DVector::zeros(0);
        if let Some(loops) = &loops {
            let mut left = view.inverse_dynamics(qd, &qdd, gravity)?;
            left.iter_mut().zip(&found.tau).for_each(|(left, tau)| *left -= tau);
            for (row, force) in found.constraints.forces.iter().zip(found.lambda.iter()) {
                left.iter_mut().zip(row).for_each(|(left, r)| *left -= r * force);
            }
            // Of loops that are closed more often than needed one of the distributions.
            let rows = DMatrix::from_fn(qd.len(), loops.rows.len(), |i, j| loops.rows.row(j)[i]);
            mu = least_norm(&rows, &left, EXACT);
        }
        let inertial = view.inverse_dynamics_derivatives(qd, &qdd, gravity)?;
        let limited = self.limited_motors(time, y)?;
        Ok(Linear { found, equations, loops, qdd, mu, inertial, limited })
    }

    /// Whether nothing but joint forces acts.
    pub fn is_free(&self, at: &Linear) -> bool {
        self.active.lasting.is_empty() && self.couplings.is_empty() && at.found.constraints.rows.is_empty()
    }

    /// −∂τ/∂q and −∂τ/∂q̇ of each joint where nothing else acts, and each force depends on position and velocity of its own joint only.
    pub fn decoupled(&self, at: &Linear) -> Option<[Vec<f64>; 2]> {
        let own = self.is_free(at) && self.sim.wrenches.is_empty() && self.drive().law().is_decoupled();
        own.then(|| self.regulation(&at.limited).into())
    }

    /// The derivative of the force of a motor by a number of its drive.
    pub fn motor_by(&mut self, (number, joint): (Number, &Motor), (time, y): (f64, &[f64]), at: &Linear) -> f64 {
        let (sim, drive) = (self.sim, self.drive());
        let own = std::ptr::eq(drive, &sim.drive) && at.limited.get(joint.v) != Some(&true);
        if own { drive.law().force_by(number, joint, &self.asked(time, true).0, sim.split(y)) } else { 0.0 }
    }

    /// τ + Fᵀλ + Lᵀμ, R q̈ + γ, L q̈ + κ and β at a state, with the accelerations and forces of `at`.
    pub fn balance(&mut self, time: f64, y: &[f64], at: &Linear) -> Result<DVector<f64>, SimError> {
        let (_, qd) = self.sim.split(y);
        if self.is_free(at) {
            let (mut tau, _) = self.applied(time, self.sim.split(y).0, qd)?;
            tau.resize(qd.len() + 3 * self.bristles.len(), 0.0);
            return Ok(DVector::from_vec(tau));
        }
        let lasting = self.active.lasting.clone();
        let mut found = Assembled::new(qd.len());
        let mut view = self.place((time, y), &lasting, true, &mut found)?;
        let loops = view.loop_rows()?;
        let wanted = if loops.is_empty() { Vec::new() } else { view.loop_acceleration(qd)? };
        let Assembled { constraints, tau, pressed, .. } = found;
        let mut all = tau;
        let forces = constraints.forces.iter().zip(at.found.lambda.iter()).chain(loops.iter().zip(at.mu.iter()));
        for (row, force) in forces {
            all.iter_mut().zip(row).for_each(|(all, r)| *all += r * force);
        }
        all.extend((0..constraints.rows.len()).map(|i| constraints.rows.dot(i, &at.qdd) + constraints.drifts[i]));
        all.extend(wanted.iter().enumerate().map(|(i, wanted)| loops.dot(i, &at.qdd) - wanted));
        let mut bends = vec![0.0; 3 * self.bristles.len()];
        self.bend(lasting.iter().filter(|own| !own.is_rigid()).zip(&pressed), &mut bends);
        all.extend(bends);
        Ok(DVector::from_vec(all))
    }

    /// M q̈ + b at a state, with the accelerations of `at`.
    pub fn inertial_forces(&mut self, y: &[f64], at: &Linear) -> Result<DVector<f64>, SimError> {
        let ((q, qd), gravity) = (self.sim.split(y), self.sim.gravity);
        self.view(q)?.inverse_dynamics(qd, &at.qdd, gravity)
    }

    /// δq̈ for each of these δ̄ of [`Motion::balance`], less δ̄(M q̈ + b) in its first nv numbers.
    pub fn answers(&mut self, y: &[f64], at: &Linear, changes: &[DVector<f64>]) -> Result<Vec<Vec<f64>>, SimError> {
        let (q, qd) = self.sim.split(y);
        let (nv, m, gravity) = (qd.len(), at.found.lambda.len(), self.sim.gravity);
        let mut forces = Rows::new(nv);
        changes.iter().for_each(|change| forces.add().copy_from_slice(&change.as_slice()[..nv]));
        let (mut answers, mut free) = (Rows::default(), vec![0.0; nv]);
        let Assembled { tau, locked, constraints, responses, .. } = &at.found;
        self.view(q)?.accelerate_and_respond((qd, tau, gravity), locked, &mut free, &forces, &mut answers)?;
        let mut found = Vec::with_capacity(changes.len());
        for (answer, change) in answers.iter().zip(changes) {
            let mut qdd = answer.to_vec();
            if let Some(loops) = &at.loops {
                let wanted: Vec<f64> = change.rows(nv + m, loops.rows.len()).iter().map(|x| -x).collect();
                loops.bind(&mut qdd, Some(&wanted));
            }
            if let Some(equations) = &at.equations {
                let missing = DVector::from_fn(m, |i, _| -change[nv + i] - constraints.rows.dot(i, &qdd));
                push(&mut qdd, responses, equations.solve(&missing).unwrap_or_default().as_slice());
            }
            found.push(qdd);
        }
        Ok(found)
    }
}

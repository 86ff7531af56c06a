//! The smooth motion of a chain in one contact mode. Its constraints are in `held.rs`, its witness functions in
//! `run/guard.rs`.
//!
//! State vectors are (q, qd, work of the drive, work of dissipative forces): the terms of the energy balance are integrated
//! with the motion. The deflections of the bristles (world, m) of compliant contacts that have one are appended.

use super::active_set::{ActiveSet, Dry, Lasting};
use super::assembled::{Assembled, ConstraintForces, Force};
use super::groups::{Gaps, Near};
use super::scale::Scale;
use crate::contact::{Moving, Touch};
use crate::error::SimError;
use crate::model::{Asked, Drive, Motor, Simulation, SpringAt, motors};
use crate::state::{Coupling, Loops, Space, View, close_loops};
use carom_chain::{FrameId, PlanarRow, Rows, Workspace};
use nalgebra::{DVector, Vector3};

/// A chain in motion.
pub(crate) struct Motion<'a, A: Space> {
    pub sim: &'a Simulation,
    pub model: &'a A::Model,
    pub workspace: Workspace<A>,
    pub active: ActiveSet,
    /// The touches with a bristle, in the order of their deflections in the state.
    pub bristles: Vec<usize>,
    /// The units of the scene.
    pub scale: Scale,
    pub gaps: Gaps<'a, A>,
    /// The motions of the surfaces that move, one for each of their touches.
    pub moving: Vec<&'a Moving>,
    /// The contacts at the last choice of the mode, if another mode was consistent, too: see `unique.rs`.
    pub other_mode: Option<Vec<usize>>,
    /// The loops of the mechanism.
    pub couplings: Vec<Coupling<A>>,
    /// The largest number of independent rows of the loops so far.
    pub rank: usize,
    /// The closed form of q̈, if the chain has one.
    row: Option<PlanarRow>,
    /// Viscous damping of every velocity.
    damping: Vec<f64>,
    /// Passive springs.
    springs: Vec<SpringAt>,
    /// The joints that motors can drive, and the limits of their forces.
    motors: Vec<Motor>,
    limits: Vec<f64>,
    /// The frames on which the outer forces act.
    pushed: Vec<FrameId>,
    /// Joint forces: scratch memory.
    tau: Vec<f64>,
    /// Scratch memory of the constraints.
    pub assembled: Assembled,
    /// The forces of the last [`Motion::margin`], near those of the next one.
    pub margin_forces: Option<DVector<f64>>,
    /// Whether rows may depend on others in the present mode, so that the responses of all are computed.
    pub redundant: bool,
}

impl<'a, A: Space> Motion<'a, A> {
    /// Free motion of a simulation's chain.
    pub fn new(sim: &'a Simulation, model: &'a A::Model) -> Self {
        Self {
            sim,
            model,
            workspace: A::chain(model).workspace(),
            active: ActiveSet::new(sim),
            bristles: bristles(sim),
            scale: Scale::new(sim),
            gaps: Gaps::new(sim, model),
            moving: sim.touches.iter().filter_map(|touch| touch.motion.as_ref()).collect(),
            other_mode: None,
            row: if sim.loops.is_empty() { A::row(model) } else { None },
            couplings: sim.couplings(model),
            rank: 0,
            damping: sim.damping(),
            springs: sim.springs_at(),
            motors: motors(&sim.chain),
            limits: sim.force_limits(),
            pushed: sim.wrenches.iter().filter_map(|wrench| sim.chain.frame(&wrench.link).ok()).collect(),
            tau: vec![0.0; sim.chain.nv()],
            assembled: Assembled::new(sim.chain.nv()),
            redundant: false,
            margin_forces: None,
        }
    }

    pub fn split<'y>(&self, y: &'y [f64]) -> (&'y [f64], &'y [f64]) {
        self.sim.split(y)
    }

    pub fn view(&mut self, q: &[f64]) -> Result<View<'_, A>, SimError> {
        View::closed_by(self.model, &mut self.workspace, q, &self.couplings)
    }

    /// Closes the loops: see [`close_loops`].
    pub fn close_loops(&mut self, y: &mut [f64]) -> Result<bool, SimError> {
        let Self { sim, model, workspace, couplings, .. } = self;
        let (q, rest) = y.split_at_mut(sim.chain.nq());
        close_loops((&sim.chain, *model), workspace, couplings, q, &mut rest[..sim.chain.nv()])
    }

    /// How far the loops are from a pose at which the mechanism could branch, 0 to 1: see
    /// [`Loops::regularity`](crate::state::Loops::regularity).
    pub fn regularity(&mut self, q: &[f64]) -> Result<f64, SimError> {
        let rank = self.rank;
        let loops = self.view(q)?.closed()?;
        self.rank = loops.as_ref().map_or(0, Loops::rank).max(rank);
        Ok(loops.map_or(1.0, |loops| loops.regularity(rank)))
    }

    pub fn kinetic_energy(&mut self, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        Ok(self.view(q)?.kin.kinetic_energy(qd)?)
    }

    pub fn energy(&mut self, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let gravity = self.sim.gravity;
        let elastic: f64 = self.springs.iter().map(|spring| spring.energy(q[spring.q])).sum();
        Ok(self.view(q)?.energy(qd, gravity)? + elastic)
    }

    /// Whether some joint moves a touch along its normal: see [`Touch::moves`].
    pub fn moves(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<bool, SimError> {
        let (sim, (q, _)) = (self.sim, self.split(y));
        let mut view = self.view(q)?;
        let at = sim.touches[touch].at(&view, q, time);
        sim.touches[touch].moves(&at, &mut view)
    }

    /// Effective mass 1/(nᵀHn) of a touch, kg; infinite if no joint moves it along its normal.
    pub fn effective_mass(&mut self, touch: usize, q: &[f64], time: f64) -> Result<f64, SimError> {
        let sim = self.sim;
        let mut view = self.view(q)?;
        let at = sim.touches[touch].at(&view, q, time);
        let (mut row, mut response) = (Rows::new(sim.chain.nv()), Rows::default());
        sim.touches[touch].row_into(&at, &view, row.add())?;
        view.respond(&row, &mut response)?;
        Ok(1.0 / row.dot(0, response.row(0)))
    }

    /// Joint forces of drive, damping and slipping dry friction, and the powers of the drive and of the others.
    pub fn applied(&mut self, time: f64, q: &[f64], qd: &[f64]) -> Result<(Vec<f64>, [f64; 2]), SimError> {
        let mut tau = vec![0.0; qd.len()];
        let power = self.apply(time, q, qd, &mut tau)?;
        Ok((tau, power))
    }

    /// [`Motion::applied`], into `tau`.
    pub fn apply(&mut self, time: f64, q: &[f64], qd: &[f64], tau: &mut [f64]) -> Result<[f64; 2], SimError> {
        let resisted = self.resist(q, qd, tau);
        let mut driven = self.push_motors(time, (q, qd), true, tau)?;
        let sim = self.sim;
        if !self.pushed.is_empty() {
            let mut pushed = vec![0.0; qd.len()];
            let view = View::<A>::new(self.model, &mut self.workspace, q)?;
            for (wrench, frame) in sim.wrenches.iter().zip(&self.pushed) {
                wrench.push(*frame, &view, time, &mut pushed)?;
            }
            driven += pushed.iter().zip(qd).map(|(f, v)| f * v).sum::<f64>();
            tau.iter_mut().zip(&pushed).for_each(|(tau, f)| *tau += f);
        }
        Ok([driven, resisted])
    }

    /// Adds the forces of the motors, `limited` or as the controller asks for them, to `tau`; returns their power.
    fn push_motors(
        &mut self,
        time: f64,
        state: (&[f64], &[f64]),
        limited: bool,
        tau: &mut [f64],
    ) -> Result<f64, SimError> {
        let (drive, model) = (self.drive(), self.model);
        let (asked, workspace) = self.asked(time, limited);
        drive.push(&asked, (model, workspace), state, tau)
    }

    /// What a drive is given beside the state, and scratch memory.
    pub fn asked(&mut self, time: f64, limited: bool) -> (Asked<'_>, &mut Workspace<A>) {
        let asked = Asked {
            chain: &self.sim.chain,
            time,
            gravity: self.sim.gravity,
            hit: &self.active.was_hit,
            impacts: &self.active.impacts,
            motors: &self.motors,
            limits: if limited { &self.limits } else { &[] },
            damping: &self.damping,
            springs: &self.springs,
        };
        (asked, &mut self.workspace)
    }

    /// The forces of the motors, after their limits, length nv.
    pub fn motor_forces(&mut self, time: f64, y: &[f64]) -> Result<Vec<f64>, SimError> {
        let mut tau = vec![0.0; self.sim.chain.nv()];
        self.push_motors(time, self.sim.split(y), true, &mut tau)?;
        Ok(tau)
    }

    /// The motors of which the controller asks for more than their limit; empty without limits.
    pub fn limited_motors(&mut self, time: f64, y: &[f64]) -> Result<Vec<bool>, SimError> {
        if self.limits.is_empty() {
            return Ok(Vec::new());
        }
        let mut tau = vec![0.0; self.limits.len()];
        self.push_motors(time, self.sim.split(y), false, &mut tau)?;
        Ok(tau.iter().zip(&self.limits).map(|(force, limit)| force.abs() > *limit).collect())
    }

    /// Writes the forces of damping, springs and slipping dry friction into `tau`; returns the power of those that dissipate.
    fn resist(&self, q: &[f64], qd: &[f64], tau: &mut [f64]) -> f64 {
        let mut power = 0.0;
        for ((tau, damping), v) in tau.iter_mut().zip(&self.damping).zip(qd) {
            *tau = -damping * v;
            power -= damping * v * v;
        }
        for spring in &self.springs {
            let v = qd[spring.v];
            tau[spring.v] += spring.force(q[spring.q], v);
            power -= spring.damping * v * v;
        }
        for joint in &self.active.dry {
            if let Dry::Brakes(direction) = joint.state {
                tau[joint.v] -= joint.friction * direction;
                power -= joint.friction * direction * qd[joint.v];
            }
        }
        power
    }

    /// The present drive.
    pub fn drive(&self) -> &'a Drive {
        let after = if self.active.was_hit.contains(&true) { self.sim.after_impact.as_ref() } else { None };
        after.unwrap_or(&self.sim.drive)
    }

    /// Whether a touch is among the lasting contacts.
    pub fn lasts(&self, touch: usize) -> bool {
        self.active.lasting.iter().any(|own| own.touch == touch)
    }

    /// Whether there are neither constraints nor contact forces.
    pub fn moves_freely(&self) -> bool {
        self.active.lasting.is_empty() && !self.active.dry.iter().any(|joint| joint.state == Dry::Holds)
    }

    /// q̈ of a [free motion](Self::moves_freely), and the powers of the drive and of the dissipative forces: the result of
    /// [`Motion::held`] in this case, at lower cost.
    pub fn accelerate(&mut self, time: f64, y: &[f64], qdd: &mut [f64]) -> Result<[f64; 2], SimError> {
        let (q, qd) = self.split(y);
        let mut tau = std::mem::take(&mut self.tau);
        let power = self.apply(time, q, qd, &mut tau).and_then(|power| {
            let gravity = A::project(self.model, self.sim.gravity);
            let swings = self.row.as_ref().is_some_and(|row| A::accelerate_row(row, (q, qd, &tau), gravity, qdd));
            if !swings {
                let gravity = self.sim.gravity;
                self.view(q)?.acceleration_into(qd, &tau, gravity, qdd)?;
            }
            Ok(power)
        });
        self.tau = tau;
        power
    }

    /// The rate of the whole state in the present mode; `held`: its accelerations, unless it [moves freely](Self::moves_freely).
    pub fn rate(
        &mut self,
        time: f64,
        y: &[f64],
        held: Option<&ConstraintForces>,
        out: &mut [f64],
    ) -> Result<(), SimError> {
        self.sim.go_on(time)?;
        let (q, qd) = self.split(y);
        let (nq, nv) = (q.len(), qd.len());
        if nq == nv {
            out[..nq].copy_from_slice(qd); // no floating joint
        } else {
            self.sim.chain.q_rate_into(q, qd, &mut out[..nq]);
        }
        let (qdd, rest) = out[nq..].split_at_mut(nv);
        let (power, bends) = rest.split_at_mut(2);
        bends.fill(0.0);
        if let Some(held) = held {
            qdd.copy_from_slice(held.qdd.as_slice());
            power.copy_from_slice(&held.power);
            self.bend(self.active.lasting.iter().zip(&held.contacts), bends);
        } else {
            power.copy_from_slice(&self.accelerate(time, y, qdd)?);
        }
        Ok(())
    }

    /// Stiffness and damping of drive, springs and joints for every velocity coordinate. `limited`: the motors without feedback, if any.
    pub fn regulation(&self, limited: &[bool]) -> (Vec<f64>, Vec<f64>) {
        let (mut stiffness, mut damping) = (vec![0.0; self.damping.len()], self.damping.clone());
        let drive = self.drive();
        let fed = self.motors.iter().filter(|motor| limited.get(motor.v) != Some(&true));
        let gains = fed.map(|motor| (motor.v, drive.law().gains(motor.v)));
        let springs = self.springs.iter().map(|spring| (spring.v, (spring.stiffness, spring.damping)));
        for (v, (p, d)) in gains.chain(springs) {
            stiffness[v] += p;
            damping[v] += d;
        }
        (stiffness, damping)
    }

    /// Gap and gap rate of a touch at one state.
    pub fn gap(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<(f64, f64), SimError> {
        let (q, qd) = self.sim.split(y);
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        self.gaps.look(touch, &view, (q, qd), time)
    }

    /// Gaps and gap rates of all touches that are near at one state, see [`Gaps::all`], and last, may close or fulfil `also`.
    pub fn all_gaps(
        &mut self,
        time: f64,
        y: &[f64],
        also: impl Fn(&Self, &Near) -> bool,
    ) -> Result<Vec<Near>, SimError> {
        let (q, qd) = self.sim.split(y);
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        let mut gaps = self.gaps.all(&self.active.lasting, &view, (q, qd), time)?;
        gaps.retain(|near| self.lasts(near.0) || self.may_close(near.0, y) || also(self, near));
        Ok(gaps)
    }

    /// Whether a touch may close at a state.
    pub fn may_close(&self, touch: usize, y: &[f64]) -> bool {
        self.sim.touches[touch].may_close(y, self.scale.pace)
    }

    /// Whether the bodies of a touch with this gap and gap rate touch at rest.
    pub fn rests(&self, &(touch, (gap, rate)): &Near) -> bool {
        gap.abs() <= self.scale.touching(touch) && rate.abs() <= self.rest_of(touch)
    }

    /// Gap, its rate and the velocity of the contact point relative to the surface at one state.
    pub fn closing(
        &mut self,
        touch: usize,
        q: &[f64],
        qd: &[f64],
        time: f64,
    ) -> Result<(f64, f64, Vector3<f64>), SimError> {
        self.closing_of(&self.sim.touches[touch], q, qd, time)
    }

    /// [`Motion::closing`] of any touch.
    pub fn closing_of(
        &mut self,
        touch: &Touch,
        q: &[f64],
        qd: &[f64],
        time: f64,
    ) -> Result<(f64, f64, Vector3<f64>), SimError> {
        let view = self.view(q)?;
        let at = touch.at(&view, q, time);
        let u = at.surface.map_or(Ok(Vector3::zeros()), |place| touch.u(&place, &view, qd, time))?;
        Ok((at.gap, touch.rate(&at, &view, qd, time)?, u))
    }

    /// Writes the rates of the deflections of bristles that these contacts have.
    pub fn bend<'f>(&self, forces: impl Iterator<Item = (&'f Lasting, &'f Force)>, bends: &mut [f64]) {
        for (own, force) in forces {
            if let Some(slot) = self.bristles.iter().position(|&k| k == own.touch) {
                bends[3 * slot..3 * slot + 3].copy_from_slice(force.bends.as_slice());
            }
        }
    }
}

/// The touches with a bristle.
fn bristles(sim: &Simulation) -> Vec<usize> {
    let has = |k: &usize| sim.touches[*k].contact.compliance.is_some_and(|it| it.has_bristle());
    (0..sim.touches.len()).filter(has).collect()
}

/// The deflection of the bristle of a touch, world, m, from the end of a state; zero without one.
pub(crate) fn deflection(bristles: &[usize], tail: &[f64], touch: usize) -> Vector3<f64> {
    let slot = bristles.iter().position(|&k| k == touch).map(|k| 3 * k);
    slot.map_or_else(Vector3::zeros, |k| Vector3::from_column_slice(&tail[k..k + 3]))
}

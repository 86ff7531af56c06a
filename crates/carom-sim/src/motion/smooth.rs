//! The smooth motion of a chain in one contact mode. Its constraints are in `held.rs`, its witness functions in
//! `run/watch.rs`.
//!
//! State vectors are (q, qd, work of the drive, work of dissipative forces): the terms of the energy balance are integrated
//! with the motion. The deflections of the bristles (world, m) of compliant contacts that have one are appended.

use super::assembled::Assembled;
use super::groups::Gaps;
use super::lasting::{Dry, DryJoint, Hold, Lasting};
use crate::contact::ContactMode;
use crate::error::SimError;
use crate::model::{Asked, Drive, Simulation};
use crate::state::{Space, View, reach};
use carom_chain::{Coordinates, PlanarRow, Rows, Workspace};
use nalgebra::Vector3;

/// A chain in motion.
pub(crate) struct Motion<'a, A: Space> {
    pub sim: &'a Simulation,
    pub model: &'a A::Model,
    pub workspace: Workspace<A>,
    /// The closed contacts.
    pub lasting: Vec<Lasting>,
    /// Whether the motion is computed by time steps.
    pub stepping: bool,
    /// Joints with dry friction.
    pub dry: Vec<DryJoint>,
    /// The touches with a bristle, in the order of their deflections in the state.
    pub bristles: Vec<usize>,
    /// Largest joint velocity at the start of the leg, rad/s or m/s.
    pub speed: f64,
    /// Impacts so far, by touch.
    impacts: Vec<usize>,
    /// Whether an impact has happened.
    was_hit: bool,
    pub gaps: Gaps<'a, A>,
    /// The closed form of q̈, if the chain has one.
    row: Option<PlanarRow>,
    /// Viscous damping of every velocity.
    damping: Vec<f64>,
    /// Joint forces: scratch memory.
    tau: Vec<f64>,
    /// Scratch memory of the constraints.
    pub assembled: Assembled,
    /// Reach of the chain, m.
    pub reach: f64,
}

impl<'a, A: Space> Motion<'a, A> {
    /// Free motion of a simulation's chain.
    pub fn new(sim: &'a Simulation, model: &'a A::Model) -> Self {
        let mut dry = Vec::new();
        for joint in sim.chain.joints() {
            if let Coordinates::Own { v, .. } = &joint.coordinates
                && joint.friction > 0.0
            {
                dry.extend(v.clone().map(|v| DryJoint { v, friction: joint.friction, state: Dry::Holds }));
            }
        }
        Self {
            sim,
            model,
            workspace: A::chain(model).workspace(),
            lasting: Vec::new(),
            stepping: false,
            dry,
            bristles: bristles(sim),
            speed: 0.0,
            impacts: vec![0; sim.touches.len()],
            was_hit: false,
            gaps: Gaps::new(sim, model),
            row: A::row(model),
            damping: sim.damping(),
            tau: vec![0.0; sim.chain.nv()],
            assembled: Assembled::new(sim.chain.nv()),
            reach: reach(&sim.chain),
        }
    }

    pub fn split<'y>(&self, y: &'y [f64]) -> (&'y [f64], &'y [f64]) {
        let (nq, nv) = (self.sim.chain.nq(), self.sim.chain.nv());
        (&y[..nq], &y[nq..nq + nv])
    }

    pub fn view(&mut self, q: &[f64]) -> Result<View<'_, A>, SimError> {
        View::new(self.model, &mut self.workspace, q)
    }

    pub fn energy(&mut self, y: &[f64]) -> Result<f64, SimError> {
        let (q, qd) = self.split(y);
        let gravity = self.sim.gravity;
        self.view(q)?.energy(qd, gravity)
    }

    /// Effective mass 1/(nᵀHn) of a touch, kg; infinite if no joint moves it along its normal.
    pub fn effective_mass(&mut self, touch: usize, q: &[f64], time: f64) -> Result<f64, SimError> {
        let sim = self.sim;
        let mut view = self.view(q)?;
        let at = sim.touches[touch].at(&view, q, time);
        let (mut row, mut response) = (Rows::new(sim.chain.nv()), Rows::default());
        sim.touches[touch].row_into(&at, &view, row.add())?;
        view.kin.respond(&row, &mut response)?;
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
        let resisted = self.resist(qd, tau);
        let (drive, asked) = (self.drive(), self.asked(time));
        let driven = drive.push(asked, (self.model, &mut self.workspace), (q, qd), tau)?;
        Ok([driven, resisted])
    }

    /// Writes the forces of damping and of slipping dry friction into `tau`; returns their power.
    fn resist(&self, qd: &[f64], tau: &mut [f64]) -> f64 {
        let mut power = 0.0;
        for ((tau, damping), v) in tau.iter_mut().zip(&self.damping).zip(qd) {
            *tau = -damping * v;
            power -= damping * v * v;
        }
        for joint in &self.dry {
            if let Dry::Brakes(direction) = joint.state {
                tau[joint.v] -= joint.friction * direction;
                power -= joint.friction * direction * qd[joint.v];
            }
        }
        power
    }

    /// The inputs of the drive.
    fn asked(&self, time: f64) -> Asked<'a> {
        Asked { chain: &self.sim.chain, time, gravity: self.sim.gravity, hit: self.was_hit }
    }

    /// Counts an impact of a touch.
    pub fn count_impact(&mut self, touch: usize) {
        self.impacts[touch] += 1;
        self.was_hit = true;
    }

    /// Impacts of a touch so far.
    pub fn impacts(&self, touch: usize) -> usize {
        self.impacts[touch]
    }

    /// The present drive.
    fn drive(&self) -> &'a Drive {
        let after = if self.was_hit { self.sim.after_impact.as_ref() } else { None };
        after.unwrap_or(&self.sim.drive)
    }

    /// The contact mode, in one word.
    pub fn mode(&self) -> ContactMode {
        match self.lasting.as_slice() {
            _ if self.stepping => ContactMode::Stepping,
            [] => ContactMode::Free,
            [only] => only.mode(),
            _ => ContactMode::Several,
        }
    }

    /// Whether a touch is among the lasting contacts.
    pub fn lasts(&self, touch: usize) -> bool {
        self.lasting.iter().any(|own| own.touch == touch)
    }

    /// Whether there are neither constraints nor contact forces.
    pub fn moves_freely(&self) -> bool {
        self.lasting.is_empty() && !self.dry.iter().any(|joint| joint.state == Dry::Holds)
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

    /// Stiffness of the drive, and total damping of every velocity coordinate.
    pub fn regulation(&self) -> (f64, Vec<f64>) {
        let (stiffness, damping) = self.drive().gains();
        (stiffness, self.damping.iter().map(|own| own + damping).collect())
    }

    /// Gap and gap rate of a touch at one state.
    pub fn gap(&mut self, touch: usize, q: &[f64], qd: &[f64], time: f64) -> Result<(f64, f64), SimError> {
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        self.gaps.look(touch, &view, (q, qd), time)
    }

    /// Gaps and gap rates of all touches at one state: see [`Gaps::all`].
    pub fn all_gaps(&mut self, q: &[f64], qd: &[f64], time: f64) -> Result<Vec<(f64, f64)>, SimError> {
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        self.gaps.all(&self.lasting, &view, (q, qd), time)
    }

    /// Gap, its rate and the velocity of the contact point relative to the surface at one state.
    pub fn closing(
        &mut self,
        touch: usize,
        q: &[f64],
        qd: &[f64],
        time: f64,
    ) -> Result<(f64, f64, Vector3<f64>), SimError> {
        let touch = &self.sim.touches[touch];
        let view = self.view(q)?;
        let at = touch.at(&view, q, time);
        let u = at.surface.map_or(Ok(Vector3::zeros()), |place| touch.u(&place, &view, qd, time))?;
        Ok((at.gap, touch.rate(&at, &view, qd, time)?, u))
    }
}

/// The touches with a bristle.
pub(crate) fn bristles(sim: &Simulation) -> Vec<usize> {
    let has = |k: &usize| sim.touches[*k].contact.compliance.is_some_and(|it| it.has_bristle());
    (0..sim.touches.len()).filter(has).collect()
}

impl Lasting {
    /// Its mode.
    pub fn mode(&self) -> ContactMode {
        let touch = self.touch;
        match self.hold {
            Hold::Slides { .. } => ContactMode::Sliding { touch },
            Hold::Sticks => ContactMode::Sticking { touch },
            Hold::Latched => ContactMode::Latched { touch },
            Hold::Presses { damping, .. } => ContactMode::Pressing { touch, damping },
        }
    }
}

//! The smooth motion of a chain in one mode of contact; what is watched in it stands in `watch.rs`.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | q̈₀ | nv | acceleration without constraint forces | `free` |
//! | R, F | m×nv | rows of the constraints; directions in which their forces act | `rows`, `forces` |
//! | K | m×m | R M⁻¹ Fᵀ | `delassus` |
//! | λ | m | constraint forces | `lambda` |
//! | d | 3 | unit direction of slip | `slip` |
//!
//! All constraints at once: R q̈ + drift = 0 with q̈ = q̈₀ + M⁻¹Fᵀλ, so K λ = −(R q̈₀ + drift). A sticking contact has three
//! rows (R = F = J); a sliding one has the normal row, and its force acts along n − μ d; a joint held by its dry friction
//! has its own.
//!
//! State vectors are (q, qd, work of the drive, work of resistance): the energy's books are integrated with the motion. If a
//! compliant contact has a bristle its deflection (world, m) comes last.

use crate::compliance::Memory;
use crate::drive::{Asked, Drive};
use crate::error::SimError;
use crate::simulate::Simulation;
use crate::space::{Space, View};
use crate::touch::BallOnPlane;
use crate::trajectory::ContactMode;
use crate::watch::Watch;
use carom_chain::{Chain, Coordinates, PlanarRow, Workspace};
use carom_impact::least_norm;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A chain in motion.
pub(crate) struct Motion<'a, A: Space> {
    pub sim: &'a Simulation,
    pub model: &'a A::Model,
    pub workspace: Workspace<A>,
    pub mode: ContactMode,
    /// Direction of slip while the slip itself is too small to show it.
    pub slip: Vector3<f64>,
    /// Joints with dry friction.
    pub dry: Vec<DryJoint>,
    /// Impacts so far, by touch.
    impacts: Vec<usize>,
    /// Whether there was one.
    was_hit: bool,
    /// What ends the mode; of the leg that goes on.
    pub watched: Vec<Watch>,
    /// What of each touch can be known before it moves.
    pub balls: Vec<Option<BallOnPlane<A>>>,
    /// The closed form of q̈, if the chain has one.
    row: Option<PlanarRow>,
    /// Viscous damping of every velocity.
    damping: Vec<f64>,
    /// Joint forces: scratch memory.
    tau: Vec<f64>,
    /// How deep the compliant contact that presses was when it was last turned back, m; −∞ if it never was.
    pub deepest: f64,
    /// How far the chain reaches, m.
    pub reach: f64,
}

/// A joint with dry friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DryJoint {
    pub v: usize,
    /// N m or N.
    pub friction: f64,
    pub state: Dry,
}

/// What a joint's dry friction does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Dry {
    /// It holds the joint.
    Holds,
    /// The joint moves in this direction (1 or −1), against it.
    Brakes(f64),
}

/// Accelerations and constraint forces at one state.
pub(crate) struct Held {
    pub qdd: DVector<f64>,
    /// Force of the lasting contact on the robot, world.
    pub force: Vector3<f64>,
    pub normal: Vector3<f64>,
    /// Its part that must not pull (a limit's whole force).
    pub normal_force: f64,
    /// Forces of the joints that dry friction holds, in the order of `dry`; 0 for the others.
    pub joints: Vec<f64>,
    /// Power of the drive, and of everything that resists.
    pub power: [f64; 2],
    /// Rate of the bristle's deflection, world, m/s.
    pub bends: Vector3<f64>,
}

/// Slip slower than this share of the joints' speed has no direction of its own.
pub(crate) const STILL: f64 = 1e-9;

/// How a touch takes part in a constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Hold {
    Slides,
    Sticks,
    /// A compliant contact with this damping: a force, and no constraint.
    Presses(f64),
}

impl Simulation {
    /// Viscous damping of every velocity, from the robot.
    pub(crate) fn damping(&self) -> Vec<f64> {
        let mut damping = vec![0.0; self.chain.nv()];
        for joint in self.chain.joints() {
            if let Coordinates::Own { v, .. } = &joint.coordinates {
                damping[v.clone()].fill(joint.damping);
            }
        }
        damping
    }

    /// Makes the quaternions in q unit again: stages and steps of the integration leave the sphere by their error. Says
    /// whether any was off.
    pub(crate) fn normalise(&self, q: &mut [f64]) -> bool {
        if self.chain.nq() == self.chain.nv() {
            return false; // there are none
        }
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
            mode: ContactMode::Free,
            slip: Vector3::zeros(),
            dry,
            impacts: vec![0; sim.touches.len()],
            was_hit: false,
            watched: Vec::new(),
            balls: sim.touches.iter().map(|touch| touch.ball_on_plane(model)).collect(),
            row: A::row(model),
            damping: sim.damping(),
            tau: vec![0.0; sim.chain.nv()],
            deepest: 0.0,
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

    /// 1/(nᵀHn) of a touching point, kg; infinite if it can't move.
    pub fn effective_mass(&mut self, touch: usize, q: &[f64], time: f64) -> Result<f64, SimError> {
        let sim = self.sim;
        let mut view = self.view(q)?;
        let at = sim.touches[touch].at(&view, q, time);
        let row = sim.touches[touch].row(&at, &view)?;
        Ok(1.0 / row.dot(&view.kin.solve(row.as_slice())?))
    }

    /// Forces of drive, damping and braking joints, and the powers of the drive and of the others.
    pub fn applied(&mut self, time: f64, q: &[f64], qd: &[f64]) -> Result<(Vec<f64>, [f64; 2]), SimError> {
        let mut tau = vec![0.0; qd.len()];
        let resisted = self.resist(qd, &mut tau);
        let (drive, asked) = (self.drive(), self.asked(time));
        let driven = drive.push(asked, (self.model, &mut self.workspace), (q, qd), &mut tau)?;
        Ok((tau, [driven, resisted]))
    }

    /// Puts the forces of damping and of braking joints into `tau`; returns their power.
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

    /// What a drive is told when it is asked.
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

    /// What drives the joints now.
    fn drive(&self) -> &'a Drive {
        let after = if self.was_hit { self.sim.after_impact.as_ref() } else { None };
        after.unwrap_or(&self.sim.drive)
    }

    /// Whether nothing is held, and nothing pushes but drives and what resists.
    pub fn moves_freely(&self) -> bool {
        self.mode == ContactMode::Free && !self.dry.iter().any(|joint| joint.state == Dry::Holds)
    }

    /// q̈ of a motion that [moves freely](Self::moves_freely), and the powers of the drive and of what resists. What
    /// [`Motion::held`] finds then, at a fraction of its cost.
    pub fn accelerate(&mut self, time: f64, y: &[f64], qdd: &mut [f64]) -> Result<[f64; 2], SimError> {
        let (q, qd) = self.split(y);
        let mut tau = std::mem::take(&mut self.tau);
        let resisted = self.resist(qd, &mut tau);
        let (sim, drive, asked) = (self.sim, self.drive(), self.asked(time));
        let driven = drive.push(asked, (self.model, &mut self.workspace), (q, qd), &mut tau)?;
        let gravity = A::project(self.model, sim.gravity);
        let swings = self.row.as_ref().is_some_and(|row| A::accelerate_row(row, (q, qd, &tau), gravity, qdd));
        if !swings {
            self.view(q)?.acceleration_into(qd, &tau, sim.gravity, qdd)?;
        }
        self.tau = tau;
        Ok([driven, resisted])
    }

    /// Stiffness of the drive, and damping of every joint with that of the drive.
    pub fn regulation(&self) -> (f64, Vec<f64>) {
        let (stiffness, damping) = self.drive().gains();
        (stiffness, self.damping.iter().map(|own| own + damping).collect())
    }

    /// Gap and gap rate of a touch at one state.
    pub fn gap(&mut self, touch: usize, q: &[f64], qd: &[f64], time: f64) -> Result<(f64, f64), SimError> {
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        self.sim.touches[touch].look(self.balls[touch].as_ref(), &view, (q, qd), time)
    }

    /// Gaps and gap rates of all touches at one state.
    pub fn gaps(&mut self, q: &[f64], qd: &[f64], time: f64) -> Result<Vec<(f64, f64)>, SimError> {
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        let looks = self.sim.touches.iter().zip(&self.balls);
        looks.map(|(touch, ball)| touch.look(ball.as_ref(), &view, (q, qd), time)).collect()
    }

    /// Gap, its rate and the touching point's velocity over the surface at one state.
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

    /// dġ/dt and du/dt while no joint accelerates: what curvature of paths and surfaces does. In closed form where there
    /// is one; else central differences of fourth order along the motion: with steps of 1e-3 of the joints' own time
    /// their error is about 1e-12 of the terms.
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
        let mut tau = vec![0.0; qd.len()];
        let resisted = self.resist(qd, &mut tau);
        let (drive, asked) = (self.drive(), self.asked(time));
        let driven = drive.push(asked, (self.model, &mut self.workspace), (q, qd), &mut tau)?;
        let mut view = self.view(q)?;
        let mut power = [driven, resisted];
        let (mut pressed, mut bends) = (None, Vector3::zeros());
        if let Some((touch, Hold::Presses(damping))) = lasting {
            let touch = &sim.touches[touch];
            let at = touch.at(&view, q, time);
            if let (Some(place), Some(compliance)) = (at.surface, touch.contact.compliance) {
                let u = touch.u(&place, &view, qd, time)?;
                let rate = place.normal.dot(&u);
                let memory = Memory { damping, deepest, deflection };
                let found = compliance.press(&touch.contact, &memory, (at.gap, rate), &place.normal, &u)?;
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
                    let mu = touch.contact.friction;
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
            // The unit force against the rest held: sliding is consistent if it opens the gap.
            let mut unit = DVector::zeros(rows.len());
            unit[0] = 1.0;
            let opens = solve(&delassus, &unit)[0];
            let mu = sim.touches[touch].contact.friction;
            if opens.is_nan()
                || opens <= 0.0
                || 1.0 / opens <= 1e-12 * rows[0].dot(&view.kin.solve(rows[0].as_slice())?)
            {
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

/// How far a chain reaches: the longest way along its links, m.
fn reach(chain: &Chain) -> f64 {
    beyond(chain).into_iter().fold(0.0, f64::max)
}

/// For every body the greatest distance of a link's frame beyond its joint, m.
pub(crate) fn beyond(chain: &Chain) -> Vec<f64> {
    let bodies = chain.bodies();
    let mut beyond = vec![0.0_f64; bodies.len()];
    for frame in chain.frames() {
        if let Some(body) = frame.body {
            beyond[body] = beyond[body].max(frame.pose.translation.norm());
        }
    }
    for i in (0..bodies.len()).rev() {
        if let Some(parent) = bodies[i].parent {
            beyond[parent] = beyond[parent].max(bodies[i].placement.translation.norm() + beyond[i]);
        }
    }
    beyond
}

/// M⁻¹Jᵀ.
pub(crate) fn responses<A: Space>(view: &mut View<A>, j: &DMatrix<f64>) -> Result<DMatrix<f64>, SimError> {
    let mut response = DMatrix::zeros(j.ncols(), j.nrows());
    for k in 0..j.nrows() {
        let row: Vec<f64> = j.row(k).iter().copied().collect();
        response.set_column(k, &view.kin.solve(&row)?);
    }
    Ok(response)
}

/// H⁺: a planar arm moves its tip in two directions only.
pub(crate) fn pseudo_inverse(h: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = h.symmetric_eigen();
    let least = eigen.eigenvalues.max() * 1e-12;
    let inverse = eigen.eigenvalues.map(|x| if x > least { 1.0 / x } else { 0.0 });
    eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// K⁺b: directions that no joint moves need no force.
fn solve(k: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    if k.nrows() == 1 {
        return b / k[(0, 0)];
    }
    least_norm(k, b, 1e-12)
}

/// Unit direction of the tangential part of u; `None` if that is still.
pub(crate) fn direction_of_slip(u: Vector3<f64>, n: Vector3<f64>, qd: &[f64]) -> Option<Vector3<f64>> {
    let speed = qd.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (u - n * n.dot(&u)).try_normalize(STILL * speed)
}

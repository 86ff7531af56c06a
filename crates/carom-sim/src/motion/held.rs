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

use super::active_set::{Dry, Hold, Lasting};
use super::assembled::{Assembled, ConstraintForces, Force};
use super::equations::Equations;
use super::rows::push;
use super::scale::SLOWEST;
use super::smooth::{Motion, deflection};
use crate::contact::{At, Memory};
use crate::error::SimError;
use crate::state::{Space, View};
use carom_chain::urdf::JointType;
use nalgebra::{DVector, Vector3};

/// What is computed of the constraints at a state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Detail {
    /// Joints that dry friction holds and joints at their limits are locked, where the base floats; otherwise they are constraints.
    pub locks: bool,
    /// The responses of the rows R too, where F ≠ R.
    pub own: bool,
}

/// What acts on the joints beside constraints.
pub(crate) struct Loads {
    pub tau: Vec<f64>,
    /// Powers of the drive and of the others.
    pub power: [f64; 2],
    /// Rates of the bristles' deflections.
    pub bends: Vec<f64>,
}

impl Detail {
    /// All rows and their responses.
    pub const ROWS: Self = Self { locks: false, own: true };
}

impl<A: Space> Motion<'_, A> {
    /// dġ/dt and du/dt at q̈ = 0, from the curvature of paths and surfaces, by central differences of fourth order along the
    /// motion, with steps of 1e-4 over the largest joint velocity: their relative error is about 1e-12. Longer steps reach across borders of
    /// faces, beyond which the curvature is another one. For touches without a closed form.
    fn numerical_drift(
        &mut self,
        touch: usize,
        (q, qd, time): (&[f64], &[f64], f64),
    ) -> Result<(f64, Vector3<f64>), SimError> {
        let sim = self.sim;
        let one = &sim.touches[touch];
        let shake = one.motion.as_ref().map_or(0.0, |motion| motion.frequency());
        let speed = shake.max(self.scale.fastest(qd) / self.scale.length);
        if speed == 0.0 {
            return Ok((0.0, Vector3::zeros()));
        }
        let h = 1e-4 / speed.max(SLOWEST * self.scale.pace);
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
        detail: Detail,
        found: &mut Assembled,
    ) -> Result<(), SimError> {
        let gravity = self.sim.gravity;
        let (_, qd) = self.sim.split(y);
        let mut view = self.place((time, y), lasting, detail.locks, found)?;
        found.respond(&mut view, (qd, gravity), detail.own)
    }

    /// The constraints of [`Motion::assemble`] and the joint forces beside theirs, without what needs M; and the chain at this state.
    pub fn place(
        &mut self,
        (time, y): (f64, &[f64]),
        lasting: &[Lasting],
        locks: bool,
        found: &mut Assembled,
    ) -> Result<View<'_, A>, SimError> {
        let (q, qd) = self.sim.split(y);
        let sim = self.sim;
        let mut numerical = Vec::new();
        for own in lasting.iter().filter(|own| own.is_rigid() && sim.touches[own.touch].is_whole()) {
            numerical.push(self.numerical_drift(own.touch, (q, qd, time))?);
        }
        let mut numerical = numerical.into_iter();
        found.power = self.apply(time, q, qd, &mut found.tau)?;
        let locks = locks && self.may_lock();
        self.lock(lasting, locks, &mut found.locked);
        let noise = self.noise();
        let tail = &y[q.len() + qd.len() + 2..];
        let Self { model, workspace, couplings, active, bristles, .. } = self;
        let mut view = View::closed_by(*model, workspace, q, couplings)?;
        found.constraints.clear();
        found.pressed.clear();
        let placed: Vec<At<A>> = lasting.iter().map(|own| sim.touches[own.touch].at(&view, q, time)).collect();
        let points = placed.iter().map(|at| at.surface.map_or([None; 2], |place| [Some(place.point), place.against]));
        let drifts = view.drifts(points, qd)?;
        for ((own, at), drifts) in lasting.iter().zip(placed).zip(drifts) {
            let touch = &sim.touches[own.touch];
            match own.hold {
                Hold::Presses { damping, deepest } => {
                    let deflection = deflection(bristles, tail, own.touch);
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
                    let closed = touch.drift(&at, &view, drifts, qd, time)?;
                    let drift = closed.or_else(|| numerical.next()).unwrap_or_default();
                    found.constraints.add_accelerated((own, touch), (&at, &view), (qd, time), drift, (noise, locks))?;
                }
            }
        }
        if !locks {
            found.constraints.hold(&active.dry);
        }
        Ok(view)
    }

    /// The forces of drive, resistance and compliant contacts at a state.
    pub fn loads(&mut self, time: f64, y: &[f64]) -> Result<Loads, SimError> {
        let (q, qd) = self.split(y);
        let lasting = self.active.lasting.clone();
        if lasting.is_empty() {
            let (tau, power) = self.applied(time, q, qd)?;
            return Ok(Loads { tau, power, bends: Vec::new() });
        }
        let mut found = Assembled::new(qd.len());
        self.place((time, y), &lasting, false, &mut found)?;
        let mut bends = vec![0.0; 3 * self.bristles.len()];
        self.bend(lasting.iter().filter(|own| !own.is_rigid()).zip(&found.pressed), &mut bends);
        Ok(Loads { tau: found.tau, power: found.power, bends })
    }

    /// Accelerations and forces in the present mode.
    pub fn in_mode(&mut self, time: f64, y: &[f64]) -> Result<ConstraintForces, SimError> {
        let mut held = self.accelerations(time, y)?;
        self.add_forces_on_joints(y, &mut held)?;
        Ok(held)
    }

    /// [`Motion::in_mode`] without the forces on joints that are locked.
    pub fn accelerations(&mut self, time: f64, y: &[f64]) -> Result<ConstraintForces, SimError> {
        let mut lasting = std::mem::take(&mut self.active.lasting);
        let mut found = std::mem::take(&mut self.assembled);
        let mut attempt = |it: &mut Self| {
            it.assemble((time, y), &lasting, Detail { locks: true, own: it.redundant }, &mut found)?;
            it.solve(time, &lasting, &mut found)
        };
        let held = match attempt(self) {
            Ok(None) => {
                self.redundant = true;
                attempt(self)
            }
            held => held,
        };
        Self::keep_directions(&mut lasting, &found);
        (self.active.lasting, self.assembled) = (lasting, found);
        held.map(Option::unwrap_or_default)
    }

    /// Whether joints at rest can be locked in place of constraints. The base must float: on a fixed one a contact may have no joint left
    /// that moves it, and then nothing tells its inverse mass from rounding.
    fn may_lock(&self) -> bool {
        let chain = &self.sim.chain;
        let floats = chain.joints().first().is_some_and(|joint| joint.kind == JointType::Floating);
        floats && chain.members().is_empty() && !chain.is_coupled() && self.couplings.is_empty()
    }

    /// Locks the joints that dry friction holds and those at their limits, among these contacts.
    fn lock(&self, lasting: &[Lasting], locks: bool, locked: &mut Vec<f64>) {
        locked.clear();
        if !locks {
            return;
        }
        let dry = self.active.dry.iter().filter(|joint| joint.state == Dry::Holds).map(|joint| joint.v);
        let limits = lasting.iter().filter_map(|own| Some(self.sim.touches[own.touch].stops()?.0));
        for v in dry.chain(limits) {
            locked.resize(self.sim.chain.nv(), 0.0);
            locked[v] = f64::INFINITY;
        }
    }

    /// The forces on joints that are locked: M q̈ + C q̇ + g − τ − Fᵀλ.
    fn add_forces_on_joints(&mut self, y: &[f64], held: &mut ConstraintForces) -> Result<(), SimError> {
        if self.assembled.locked.is_empty() {
            return Ok(());
        }
        let (q, qd) = self.split(y);
        let gravity = self.sim.gravity;
        let mut needed = self.view(q)?.inverse_dynamics(qd, held.qdd.as_slice(), gravity)?;
        let Assembled { constraints, lambda, tau, .. } = &self.assembled;
        needed.iter_mut().zip(tau).for_each(|(needed, tau)| *needed -= tau);
        let mut without =
            |row: &[f64], force: f64| needed.iter_mut().zip(row).for_each(|(needed, r)| *needed -= r * force);
        for (row, force) in constraints.forces.iter().zip(lambda.iter()) {
            without(row, *force);
        }
        // A limit bears what pushes against it, and dry friction the rest. With equal shares friction would reach its bound, and the joint
        // would seem to break loose.
        let limits = || self.active.lasting.iter().map(|own| self.sim.touches[own.touch].stops());
        for (k, joint) in self.active.dry.iter().enumerate().filter(|(_, joint)| joint.state == Dry::Holds) {
            let pushed = limits().flatten().any(|(v, slope)| v == joint.v && slope * needed[v] >= 0.0);
            if !pushed {
                held.joints[k] = std::mem::take(&mut needed[joint.v]);
            }
        }
        for (contact, limit) in held.contacts.iter_mut().zip(limits()) {
            if let Some((v, slope)) = limit {
                contact.normal_force = needed[v] / slope;
            }
        }
        Ok(())
    }

    /// The acceleration of a gap in the present mode.
    pub fn gap_acceleration(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<f64, SimError> {
        let qdd = self.accelerations(time, y)?.qdd;
        let mut found = Assembled::new(self.sim.chain.nv());
        let own = Lasting { touch, hold: Hold::Slides { toward: Vector3::zeros() } };
        self.assemble((time, y), &[own], Detail::ROWS, &mut found)?;
        Ok(found.constraints.rows.dot(0, qdd.as_slice()) + found.constraints.drifts[0])
    }

    /// Accelerations and forces; `None` if the responses of the rows R are needed.
    fn solve(
        &self,
        time: f64,
        lasting: &[Lasting],
        found: &mut Assembled,
    ) -> Result<Option<ConstraintForces>, SimError> {
        let m = found.constraints.rows.len();
        found.lambda = if m == 0 {
            DVector::zeros(0)
        } else if !found.constraints.starts.is_empty() {
            self.starting_forces(time, found)?
        } else {
            let Some(mut equations) = self.equations(time, found)? else { return Ok(None) };
            equations.forces(&-found.offset()).ok_or_else(|| self.jam(time, found, 0))?
        };
        let Assembled { constraints, responses, free, power, lambda, .. } = &*found;
        let mut held = ConstraintForces {
            qdd: free.clone(),
            contacts: Vec::with_capacity(lasting.len()),
            joints: vec![0.0; self.active.dry.len()],
            power: *power,
        };
        push(held.qdd.as_mut_slice(), responses, lambda.as_slice());
        let (mut rigid, mut pressed) = (constraints.contacts.iter(), found.pressed.iter());
        for own in lasting {
            let force = if own.is_rigid() {
                let Some(contact) = rigid.next() else { break };
                let force = contact.force(lambda.as_slice());
                held.power[1] += contact.power(&force);
                let normal_force = contact.rows.clone().last().map_or(0.0, |last| lambda[last]);
                Force { force, normal: contact.normal, normal_force, bends: Vector3::zeros() }
            } else {
                pressed.next().copied().unwrap_or_default()
            };
            held.contacts.push(force);
        }
        let first = m - constraints.joints.len();
        for (k, force) in constraints.joints.iter().zip(lambda.iter().skip(first)) {
            held.joints[*k] = *force;
        }
        Ok(Some(held))
    }

    /// The equations of the constraint forces; `None` if the responses of the rows R are needed.
    pub fn equations(&self, time: f64, found: &Assembled) -> Result<Option<Equations>, SimError> {
        Equations::of(found).map_err(|row| self.jam(time, found, row))
    }

    /// No force along this row of the constraints opens the gap.
    pub fn jam(&self, time: f64, found: &Assembled, row: usize) -> SimError {
        let contacts = &found.constraints.contacts;
        let contact = contacts.iter().find(|contact| contact.rows.contains(&row)).or(contacts.first());
        let touch = contact.map(|contact| &self.sim.touches[contact.own.touch]);
        let friction = touch.map_or(0.0, |touch| touch.contact.law.friction());
        SimError::Jam { time, touch: touch.map(|touch| touch.name.clone()).unwrap_or_default(), friction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactRule, Surface, Touch};
    use crate::model::Simulation;
    use carom_chain::urdf::LoadOptions;
    use carom_chain::{Chain, Coordinates, Spatial};
    use carom_contact::Obstacle;
    use carom_impact::Newton;

    /// A floating body with three legs of two joints with dry friction, limits and feet that are balls, over a floor.
    fn robot() -> Simulation {
        let link = |name: &str, shape: &str| {
            format!(
                "<link name='{name}'><inertial><origin xyz='0.02 0.01 -0.1'/><mass value='0.7'/>
                 <inertia ixx='0.02' ixy='0' ixz='0.001' iyy='0.03' iyz='0' izz='0.01'/></inertial>{shape}</link>"
            )
        };
        let joint = |name: &str, parent: &str, child: &str, place: &str, axis: &str| {
            format!(
                "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><origin xyz='{place}'/>
                 <axis xyz='{axis}'/><limit lower='-1' upper='1' effort='9' velocity='9'/><dynamics friction='0.5'/></joint>"
            )
        };
        let foot = "<collision><origin xyz='0 0 -0.2'/><geometry><sphere radius='0.03'/></geometry></collision>";
        let mut text = format!("<robot name='walker'>{}", link("body", ""));
        for (k, place) in ["0.2 0.1 0", "-0.2 0.15 0", "0.05 -0.2 0"].into_iter().enumerate() {
            let (thigh, shank) = (format!("thigh{k}"), format!("shank{k}"));
            text += &link(&thigh, "");
            text += &link(&shank, foot);
            text += &joint(&format!("hip{k}"), "body", &thigh, place, "1 0.2 0");
            text += &joint(&format!("knee{k}"), &thigh, &shank, "0 0 -0.2", "0.1 1 0");
        }
        text += "</robot>";
        let options = LoadOptions { floating_base: true, ..Default::default() };
        let chain = Chain::from_urdf_str(&text, &options).unwrap();
        let contact = ContactRule::new(Newton { restitution: 0.0, friction: 0.6 });
        let obstacle = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
        let floor = Surface { name: "floor".into(), obstacle, contact, motion: None };
        let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        Simulation { gravity, ..Simulation::new(chain, touches) }
    }

    /// Joints that are locked move, and are loaded, as those with a constraint in their row: with feet that stick, slide and begin to slide.
    #[test]
    fn locked_joints_are_those_with_a_constraint() {
        let sim = robot();
        let (nq, nv) = (sim.chain.nq(), sim.chain.nv());
        let mut rng = fastrand::Rng::with_seed(1);
        let touch = |name: &str| sim.touches.iter().position(|touch| touch.name.starts_with(name)).unwrap();
        let holds =
            [Hold::Sticks, Hold::Slides { toward: Vector3::x() }, Hold::Starts { toward: Vector3::new(0.6, 0.8, 0.0) }];
        let mut compared = 0;
        for k in 0..60 {
            let mut draw = |n: usize| (0..n).map(|_| 2.0 * rng.f64() - 1.0).collect::<Vec<f64>>();
            let turn = nalgebra::Vector4::from_vec(draw(4)).normalize();
            let y = [&draw(3)[..], turn.as_slice(), &draw(nq - 7), &draw(nv), &[0.0; 2]].concat();
            let mut motion = Motion::<Spatial<f64>>::new(&sim, &sim.chain);
            motion.active.speed = 1.0;
            // The second knee slips, the first one is held by friction and its limit, the third by its limit alone.
            let v_of = |name: &str| {
                let joint = sim.chain.joints().iter().find(|joint| joint.name == name).unwrap();
                let Coordinates::Own { v, .. } = &joint.coordinates else { panic!("{name} has no coordinate") };
                v.start
            };
            let slipping = [v_of("knee1"), v_of("knee2")];
            for joint in motion.active.dry.iter_mut().filter(|joint| slipping.contains(&joint.v)) {
                joint.state = Dry::Brakes(1.0);
            }
            motion.active.lasting = vec![
                Lasting { touch: touch("shank0"), hold: holds[k % 3] },
                Lasting { touch: touch("lower limit of knee0"), hold: Hold::Slides { toward: Vector3::zeros() } },
                Lasting { touch: touch("shank1"), hold: holds[k / 3 % 2] },
                Lasting { touch: touch("upper limit of knee2"), hold: Hold::Slides { toward: Vector3::zeros() } },
            ];
            let lasting = motion.active.lasting.clone();
            // At a random pose sliding may jam.
            let Ok(locked) = motion.in_mode(0.0, &y) else { continue };
            assert!(!motion.assembled.locked.is_empty());
            let mut found = Assembled::new(nv);
            motion.assemble((0.0, &y), &lasting, Detail::ROWS, &mut found).unwrap();
            let rows = motion.solve(0.0, &lasting, &mut found).unwrap().unwrap();
            // Both solve equations of the same condition, of which the worst of these poses loses some five digits.
            let same =
                |what: &str, a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{what} {a} {b}, {k}");
            locked.qdd.iter().zip(&rows.qdd).for_each(|(a, b)| same("acceleration", *a, *b));
            // Of friction and limit of one joint only the sum is the same.
            let shared = motion.active.dry.iter().position(|joint| joint.v == v_of("knee0")).unwrap();
            let both = |held: &ConstraintForces| [held.joints[shared], held.contacts[1].normal_force];
            let ([own, pushed], [half, other]) = (both(&locked), both(&rows));
            same("load of the first knee", own + pushed, half + other);
            assert!(pushed >= 0.0 && own <= 0.0 && own * pushed == 0.0, "{own} {pushed}");
            for (a, b) in
                locked.joints.iter().zip(&rows.joints).enumerate().filter(|(k, _)| *k != shared).map(|it| it.1)
            {
                same("joint", *a, *b);
            }
            for (k, (a, b)) in locked.contacts.iter().zip(&rows.contacts).enumerate() {
                if k != 1 {
                    same("normal force", a.normal_force, b.normal_force);
                }
                same("force", (a.force - b.force).norm(), 0.0);
            }
            same("power", locked.power[1], rows.power[1]);
            compared += 1;
        }
        assert!(compared > 40, "{compared}");
    }
}

//! The choice of the contact mode: which closed contacts carry load, stick or slide, and which joints dry friction holds.
//!
//! At a state with closed contacts whose normal velocity is zero, the accelerations and forces satisfy a complementarity
//! problem with the equations of motion as its matrix (Glocker & Pfeiffer 1996):
//!
//! ```text
//! normal    0 ≤ λ_n ⟂ a_n ≥ 0
//! at rest   |λ_t| ≤ μ λ_n;  λ_t = −μ λ_n a_t/|a_t| where a_t ≠ 0
//! sliding   λ_t = −μ λ_n u_t/|u_t|: the force acts along n − μ d
//! joint     |λ| ≤ f;  λ = −f sign a where a ≠ 0
//! ```
//!
//! It is solved by [`SeveralProblem::simultaneous`]. The solution determines the modes: a contact with λ_n > 0 is loaded, one
//! with a_n > 0 opens. Where both are zero, or where a force is on the border of its cone at rest, the next derivative decides:
//! the problem is solved again at a state a short time ahead: 1e-6 of the time in which the state changes by its own size.

use super::active_set::{Dry, Hold, Lasting};
use super::assembled::Assembled;
use super::equations::Equations;
use super::held::Detail;
use super::rows::{Constraints, direction_of_slip, push};
use super::scale::{SLOWEST, Scale};
use super::smooth::Motion;
use crate::error::SimError;
use crate::state::{Basis, CLEAR, EQUAL, EXACT, Space};
use carom_impact::{Accuracy, SeveralProblem};
use nalgebra::{DVector, Vector3};
use std::cell::OnceCell;
use std::ops::Range;

/// Accuracy of forces and impulses of several contacts, relative to the largest acceleration without forces, or velocity. Problems that are
/// solved at all take less than a hundred iterations from the first start, which gets a seventh of these; others often have no solution.
pub(crate) const ACCURACY: Accuracy = Accuracy { tolerance: EXACT, max_iterations: 1000 };

/// A solution of the complementarity problem.
pub(super) struct Solution {
    pub force: DVector<f64>,
    acceleration: DVector<f64>,
    qdd: DVector<f64>,
    /// Size of the accelerations and of the forces.
    pub scale: [f64; 2],
    /// The problem that it solves.
    problem: SeveralProblem,
}

impl<A: Space> Motion<'_, A> {
    /// The unit direction of slip of a touch; `None`: at rest.
    pub fn slip(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<Option<Vector3<f64>>, SimError> {
        let (q, qd) = self.split(y);
        let sim = self.sim;
        if sim.touches[touch].link().is_none() || sim.touches[touch].contact.latch {
            return Ok(None);
        }
        let rest = self.rest();
        let view = self.view(q)?;
        let Some(place) = sim.touches[touch].at(&view, q, time).surface else { return Ok(None) };
        let u = sim.touches[touch].u(&place, &view, qd, time)?;
        Ok(direction_of_slip(u, place.normal, rest))
    }

    /// A closed touch at its present slip, before its mode is chosen. Slip that begins, and has not ended, goes on to begin.
    pub fn candidate(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<Lasting, SimError> {
        let slip = self.slip(touch, time, y)?;
        let starts = |own: &&Lasting| own.touch == touch && matches!(own.hold, Hold::Starts { .. });
        let kept = slip.and(self.active.lasting.iter().find(starts).copied());
        Ok(kept.unwrap_or_else(|| Lasting::of(touch, &self.sim.touches[touch], slip)))
    }

    /// Sets the states of the joints with dry friction by their velocities.
    pub fn brake(&mut self, y: &[f64]) {
        let (nq, rest) = (self.sim.chain.nq(), self.rest());
        for joint in &mut self.active.dry {
            let rate = y[nq + joint.v];
            joint.state =
                if rate.abs() > self.scale.joint(joint.v, rest) { Dry::Brakes(rate.signum()) } else { Dry::Holds };
        }
    }

    /// Sets the modes of the candidates and of the joints with dry friction; contacts that open are dropped. The normal
    /// velocities of the candidates, and all velocities of those at rest, are set to zero. `false`: no consistent mode was
    /// found.
    pub fn select(&mut self, candidates: &[Lasting], time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        self.close_loops(y)?;
        let before = self.active.dry.clone();
        self.brake(y);
        let mut entries = candidates.to_vec();
        self.pass_dead_points(&mut entries, &before, (time, y))?;
        self.other_mode = None;
        self.project((&entries, &entries), time, y)?;
        let resting = self.active.dry.iter().any(|joint| joint.state == Dry::Holds);
        if !resting && entries.iter().all(|entry| !entry.is_rigid()) {
            self.active.lasting = entries;
            return Ok(true);
        }
        let mut found = Assembled::new(self.sim.chain.nv());
        let Some(now) = self.complementarity((time, y), &entries, &mut found, None)? else { return Ok(false) };
        let others = self.has_other_mode(&now.problem, &found, &now)?;
        let rigid = || entries.iter().filter(|own| own.is_rigid());
        self.other_mode = others.then(|| rigid().map(|own| own.touch).collect());
        let ahead = if self.is_tied(&entries, &found, &now) { self.ahead((time, y), &entries, &now)? } else { None };
        let (found, solution) = ahead.unwrap_or((found, now));
        self.take(&entries, &found, &solution);
        Ok(true)
    }

    /// Where the present mode jams: drops a contact that slides, if the others leave it open now or a short time ahead. `false`, and nothing has
    /// changed, if there is none.
    pub fn let_open(&mut self, time: f64, y: &[f64]) -> Result<bool, SimError> {
        let entries = self.active.lasting.clone();
        let nv = self.sim.chain.nv();
        let (mut all, mut found) = (Assembled::new(nv), Assembled::new(nv));
        let Some(now) = self.complementarity((time, y), &entries, &mut all, None)? else { return Ok(false) };
        for (time, y) in [(time, y.to_vec()), self.state_ahead((time, y), &now)?] {
            self.assemble((time, &y), &entries, Detail::ROWS, &mut all)?;
            let Constraints { contacts, rows, drifts, .. } = &all.constraints;
            let slides = |own: &Lasting| matches!(own.hold, Hold::Slides { .. } | Hold::Starts { .. });
            for contact in contacts.iter().filter(|contact| slides(&contact.own) && !contact.rows.is_empty()) {
                let others: Vec<Lasting> =
                    entries.iter().filter(|own| own.touch != contact.own.touch).copied().collect();
                let Some(solution) = self.complementarity((time, &y), &others, &mut found, None)? else { continue };
                let normal = contact.rows.end - 1;
                let opening = rows.dot(normal, solution.qdd.as_slice()) + drifts[normal];
                if opening >= -EQUAL * solution.scale[0].max(all.largest()) {
                    self.take(&others, &found, &solution);
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Positive while the present mode has admissible forces: whether the complementarity problem keeps all its contacts closed,
    /// and those that stick at rest.
    pub fn margin(&mut self, time: f64, y: &[f64]) -> Result<f64, SimError> {
        let lasting = self.active.lasting.clone();
        let mut found = Assembled::new(self.sim.chain.nv());
        let start = self.margin_forces.take();
        let solved = self.complementarity((time, y), &lasting, &mut found, start.as_ref())?;
        // All rows but the tangential ones of contacts whose slip begins.
        let starts = lasting.iter().filter(|own| own.is_rigid()).zip(&found.constraints.contacts);
        let starts = starts.filter(|(own, _)| matches!(own.hold, Hold::Starts { .. }));
        let slips: Vec<Range<usize>> = starts.map(|(_, it)| it.rows.start..it.rows.end.saturating_sub(1)).collect();
        let margin = solved.as_ref().map_or(-1.0, |found| {
            let rows = found.acceleration.iter().enumerate().filter(|(i, _)| !slips.iter().any(|own| own.contains(i)));
            10.0 * EQUAL - rows.fold(0.0, |most: f64, (_, a)| most.max(a.abs())) / found.scale[0]
        });
        self.margin_forces = solved.map(|solution| solution.force);
        Ok(margin)
    }

    /// The solution of the complementarity problem; `None` if none was found. `start`: forces that may be near it.
    fn complementarity(
        &mut self,
        (time, y): (f64, &[f64]),
        entries: &[Lasting],
        found: &mut Assembled,
        start: Option<&DVector<f64>>,
    ) -> Result<Option<Solution>, SimError> {
        // Where slip begins friction is that of a contact at rest.
        let at_rest = |own: &Lasting| match own.hold {
            Hold::Starts { .. } => Lasting { hold: Hold::Sticks, ..*own },
            _ => *own,
        };
        let entries: Vec<Lasting> = entries.iter().map(at_rest).collect();
        self.assemble((time, y), &entries, Detail::ROWS, found)?;
        let (delassus, free) = (found.delassus(), found.offset());
        let constraints = found.constraints.laws(self.sim, &self.active.dry, 1.0, None);
        let problem = SeveralProblem::of_accelerations(delassus.clone(), free.clone(), constraints)?;
        let held = if start.is_none() { self.all_held(found, &free) } else { None };
        let start = start.or(held.as_ref()).filter(|start| start.len() == free.len());
        let outcome = problem.simultaneous(&ACCURACY, start)?;
        let solved = outcome.residual <= EQUAL;
        if !solved {
            return Ok(None);
        }
        let mut qdd = found.free.clone();
        push(qdd.as_mut_slice(), &found.responses, outcome.impulse.as_slice());
        let acceleration = &free + &delassus * &outcome.impulse;
        let largest = found.largest();
        let mobility = delassus.diagonal().amax().max(f64::MIN_POSITIVE);
        let scale = [largest, outcome.impulse.amax().max(largest / mobility)];
        Ok(Some(Solution { force: outcome.impulse, acceleration, qdd, scale, problem }))
    }

    /// The forces by the convention while all contacts last, those at rest stick and joints hold, if they are admissible up to
    /// a share of 1e-6: of the solutions with redundant contacts that in which the smooth motion goes on, or begins to slide, is near.
    fn all_held(&self, found: &Assembled, free: &DVector<f64>) -> Option<DVector<f64>> {
        let forces = Equations::of(found).ok()??.forces(&-free)?;
        let nearly = CLEAR * forces.amax();
        let pushes = found.constraints.contacts.iter().all(|contact| {
            let own_forces = &forces.as_slice()[contact.rows.clone()];
            let Some((normal, along)) = own_forces.split_last() else { return true };
            let friction = self.sim.touches[contact.own.touch].contact.law.friction() * normal;
            let inside = along.iter().map(|x| x * x).sum::<f64>().sqrt() <= friction + nearly;
            contact.own.hold == Hold::Latched || (*normal >= -nearly && inside)
        });
        let first = forces.len() - found.constraints.joints.len();
        let mut joints = found.constraints.joints.iter().zip(forces.iter().skip(first));
        (pushes && joints.all(|(k, force)| force.abs() <= self.active.dry[*k].friction + nearly)).then_some(forces)
    }

    /// Whether a contact is undecided: neither loaded nor opening, or at rest on the border of its cone.
    fn is_tied(&self, entries: &[Lasting], found: &Assembled, solution: &Solution) -> bool {
        let [accelerations, forces] = solution.scale.map(|scale| EQUAL * scale);
        let rigid = entries.iter().filter(|own| own.is_rigid());
        let contacts = found.constraints.contacts.iter().zip(rigid).any(|(contact, own)| {
            let last = contact.rows.end - 1;
            let (force, opens) = (solution.force[last], solution.acceleration[last]);
            match own.hold {
                Hold::Latched | Hold::Presses { .. } => false,
                _ if force <= forces => opens.abs() <= accelerations,
                Hold::Slides { .. } | Hold::Starts { .. } => false,
                Hold::Sticks => {
                    let t = solution.force.rows(contact.rows.start, 2).norm();
                    let a = solution.acceleration.rows(contact.rows.start, 2).norm();
                    let most = self.sim.touches[own.touch].contact.law.friction() * force;
                    a <= accelerations && (t - most).abs() <= forces
                }
            }
        });
        let first = solution.force.len() - found.constraints.joints.len();
        contacts
            || found.constraints.joints.iter().enumerate().any(|(i, &k)| {
                let (force, a) = (solution.force[first + i].abs(), solution.acceleration[first + i].abs());
                a <= accelerations && (force - self.active.dry[k].friction).abs() <= forces
            })
    }

    /// The problem a short time ahead, along the motion of a solution.
    fn ahead(
        &mut self,
        (time, y): (f64, &[f64]),
        entries: &[Lasting],
        now: &Solution,
    ) -> Result<Option<(Assembled, Solution)>, SimError> {
        let (time, there) = self.state_ahead((time, y), now)?;
        let mut found = Assembled::new(self.sim.chain.nv());
        Ok(self.complementarity((time, &there), entries, &mut found, None)?.map(|solution| (found, solution)))
    }

    /// Time and state a short time ahead, along the motion of a solution.
    fn state_ahead(&self, (time, y): (f64, &[f64]), now: &Solution) -> Result<(f64, Vec<f64>), SimError> {
        let (q, qd) = self.split(y);
        let nv = qd.len();
        let Scale { length, pace, .. } = self.scale;
        let rate = self.scale.fastest(qd) / length;
        let turn = (self.scale.fastest(now.qdd.iter()) / length).sqrt();
        let shake = self.moving.iter().fold(0.0, |m: f64, it| m.max(it.frequency()));
        let step = CLEAR / rate.max(turn).max(shake).max(SLOWEST * pace);
        let mut there = y.to_vec();
        there[..q.len()].copy_from_slice(&self.sim.chain.integrate(q, qd, step)?);
        for (v, a) in there[q.len()..q.len() + nv].iter_mut().zip(now.qdd.iter()) {
            *v += a * step;
        }
        Ok((time + step, there))
    }

    /// Stores the modes of a solution.
    fn take(&mut self, entries: &[Lasting], found: &Assembled, solution: &Solution) {
        let [accelerations, forces] = solution.scale.map(|scale| EQUAL * scale);
        let mut contacts = found.constraints.contacts.iter();
        // The forces of redundant contacts are a convention, from which no directions follow; in the plane the direction is given.
        let constraints = &found.constraints;
        let redundant = OnceCell::new();
        let rows = constraints.rows.len();
        // A single row has no responses of its own.
        let is_redundant = || *redundant.get_or_init(|| rows > 1 && Basis::of(&found.gram()).rows.len() < rows);
        // A contact that the others support could carry load as well.
        let is_supported =
            |contact: &Range<usize>| solution.acceleration[contact.end - 1].abs() <= accelerations && is_redundant();
        self.active.lasting.clear();
        for own in entries {
            if !own.is_rigid() {
                self.active.lasting.push(*own);
                continue;
            }
            let Some(contact) = contacts.next() else { break };
            let last = contact.rows.end - 1;
            let loaded = solution.force[last] > forces;
            let hold = match own.hold {
                Hold::Latched => Hold::Latched,
                _ if !loaded && !is_supported(&contact.rows) => continue,
                Hold::Sticks | Hold::Starts { .. } => {
                    let a = solution.acceleration.rows(contact.rows.start, 2);
                    if own.hold != Hold::Sticks || a.norm() > accelerations {
                        // Slip begins along its acceleration, or against the friction force where the acceleration is rounding.
                        let first = contact.rows.start;
                        let along = |of: &DVector<f64>| contact.tangential(&of.as_slice()[first..]);
                        let moves = a.norm() > accelerations;
                        let toward = if moves { along(&solution.acceleration) } else { -along(&solution.force) };
                        match toward.try_normalize(0.0) {
                            Some(toward) if A::LINEAR == 3 => Hold::Starts { toward },
                            toward => Hold::Slides { toward: toward.unwrap_or_else(Vector3::zeros) },
                        }
                    } else {
                        Hold::Sticks
                    }
                }
                hold => hold,
            };
            self.active.lasting.push(Lasting { touch: own.touch, hold });
        }
        let first = solution.force.len() - found.constraints.joints.len();
        for (i, &k) in found.constraints.joints.iter().enumerate() {
            let (force, a) = (solution.force[first + i], solution.acceleration[first + i]);
            if a.abs() > accelerations {
                self.active.dry[k].state = Dry::Brakes(-force.signum());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactRule, Surface, Touch};
    use crate::model::Simulation;
    use carom_chain::urdf::LoadOptions;
    use carom_chain::{Chain, Spatial};
    use carom_contact::Obstacle;
    use carom_impact::Newton;
    use carom_testing::build::{O, ball, in_plane, shape};

    /// A box on its four corners begins to slide down a slope: its corners stay closed under forces that push, and no more is asked of
    /// contacts whose slip begins. On a slope that friction holds they stick, and in a mode that lets nothing slide the slope is too steep.
    #[test]
    fn the_margin_of_a_mode_is_positive_where_its_slip_begins() {
        let text = "<robot name='box'><link name='body'><inertial><mass value='2'/>
            <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial>
            <collision><geometry><box size='0.4 0.3 0.2'/></geometry></collision></link></robot>";
        let chain = Chain::from_urdf_str(text, &LoadOptions { floating_base: true, ..Default::default() }).unwrap();
        let contact = ContactRule::new(Newton { restitution: 0.0, friction: 0.5 });
        let obstacle = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
        let floor = Surface { name: "floor".into(), obstacle, contact, motion: None };
        let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
        let lower =
            |touch: &Touch| ["corner 1", "corner 2", "corner 3", "corner 4"].iter().any(|it| touch.name.ends_with(it));
        let y = [&[0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0][..], &[0.0; 8]].concat();
        for (steep, slides) in [(0.3, false), (0.8, true)] {
            let gravity = Vector3::new(0.6 * steep, 0.8 * steep, -1.0) * 9.81;
            let sim = Simulation { gravity, ..Simulation::new(chain.clone(), touches.clone()) };
            let mut motion = Motion::<Spatial<f64>>::new(&sim, &sim.chain);
            motion.measure(0.0, &y);
            let closed = (0..sim.touches.len()).filter(|&k| lower(&sim.touches[k]));
            let candidates: Vec<Lasting> = closed.map(|k| Lasting::of(k, &sim.touches[k], None)).collect();
            let mut there = y.clone();
            assert!(motion.select(&candidates, 0.0, &mut there).unwrap());
            let starts = motion.active.lasting.iter().filter(|own| matches!(own.hold, Hold::Starts { .. })).count();
            assert_eq!((starts > 0, motion.active.lasting.len() >= 3), (slides, true), "{:?}", motion.active.lasting);
            assert!(motion.margin(0.0, &y).unwrap() > 0.0, "{steep}");
            motion.active.lasting.iter_mut().for_each(|own| own.hold = Hold::Sticks);
            assert_eq!(motion.margin(0.0, &y).unwrap() > 0.0, !slides, "{steep}");
        }
    }

    /// Painlevé's rod, 1 m long, slides on its lower end: without the force of the floor this end accelerates by ω² l sin φ − g. Whether the
    /// force jams, with K = 1 + 3 cos² φ − 3 μ sin φ cos φ < 0, or not: the contact may be left where this is positive, and only there.
    #[test]
    fn a_contact_is_left_where_the_others_leave_it_open() {
        let (l, phi) = (0.5, 2.0_f64.atan());
        let (sin, cos) = phi.sin_cos();
        let q = [0.0, l * sin + 1e-9, phi];
        let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
        for (friction, spin) in [(2.0, 8.0), (0.5, 0.0), (0.5, 8.0), (2.0, 0.0)] {
            let chain = in_plane(1.0, 1.0 / 12.0, &shape(&ball(1e-9), [0.5, 0.0, 0.0], O));
            let contact = ContactRule::new(Newton { restitution: 0.0, friction });
            let floor = Surface { name: "floor".into(), obstacle: floor.clone(), contact, motion: None };
            let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
            let sim = Simulation { gravity: -9.81 * Vector3::z(), ..Simulation::new(chain, touches) };
            let y = [&q[..], &[3.0 + spin * l * sin, spin * l * cos, spin], &[0.0; 2]].concat();
            let mut motion = Motion::<Spatial<f64>>::new(&sim, &sim.chain);
            motion.measure(0.0, &y);
            let slides = vec![Lasting { touch: 0, hold: Hold::Slides { toward: Vector3::x() } }];
            motion.active.lasting.clone_from(&slides);
            let opens = spin * spin * l * sin > 9.81;
            assert_eq!(motion.let_open(0.0, &y).unwrap(), opens, "μ {friction}, ω {spin}");
            assert_eq!(motion.active.lasting, if opens { Vec::new() } else { slides }, "μ {friction}, ω {spin}");
        }
    }
}

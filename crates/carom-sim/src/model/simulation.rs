//! The description of a simulation: a chain with its contacts, and the settings. It runs in `run/stream.rs`.

use super::drive::Drive;
use super::gains::motors;
use super::loops::Loop;
use super::spring::{Spring, SpringAt};
use super::wrench::Wrench;
use crate::contact::{Memory, Moving, SeveralLaw, Touch};
use crate::error::{SimError, named, require};
use crate::state::{Coupling, Moment, Space, View, close_loops};
use carom_chain::{Chain, Coordinates, JointInfo, PlanarChain, Spatial};
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The tolerance of simulations and scenes that give none.
pub(crate) const TOLERANCE: f64 = 1e-9;

/// A chain with its possible contacts and the settings of its simulation.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The chain.
    pub chain: Chain,
    /// The possible contacts, with their laws.
    pub touches: Vec<Touch>,
    /// Acceleration of free fall, world axes, m/s².
    pub gravity: Vector3<f64>,
    /// The joint forces of the motors. Damping and dry friction of the joints act in addition.
    pub drive: Drive,
    /// The drive from the first impact on; `None`: the same drive.
    pub after_impact: Option<Drive>,
    /// Passive springs of joints.
    pub springs: Vec<Spring>,
    /// Forces and torques on links from outside.
    pub wrenches: Vec<Wrench>,
    /// Loops of the mechanism. A run starts with the nearest state that closes them, in the metric of M.
    pub loops: Vec<Loop>,
    /// Whether the motors obey the effort limits of the URDF. A joint without a limit there has none.
    pub effort_limits: bool,
    /// Time at the start, s: tables, references and moving surfaces are those of this time then.
    pub start_time: f64,
    /// Relative tolerance of each integration step; the absolute tolerance is 1e-3 of it.
    pub tolerance: f64,
    /// Longest integration step, s.
    pub max_step: f64,
    /// If all remaining impacts of an accumulation (Zeno) end within this time, s, they are replaced by their limit.
    pub zeno_time: f64,
    /// Longest time step where time steps are computed, s; with `stepping` the length of all.
    pub contact_step: f64,
    /// The law of several contacts at the same time.
    pub several: SeveralLaw,
    /// Use time steps of `contact_step` throughout, without events other than rest, for comparison with time-stepping
    /// simulators.
    pub stepping: bool,
    /// The run stops after this number of events.
    pub max_events: usize,
    /// Compute planar chains in the plane, which gives the same motion at lower cost. `false`: always in space.
    pub planar: bool,
    /// The integrator of smooth motion.
    pub integrator: Integrator,
    /// Relative tolerance for approximations; `None`: none is made. An impact under a law of `carom-impact` is
    /// computed without friction if the bound on the resulting change of the contact point's velocity is below this share
    /// of that velocity. A chain is treated as
    /// planar if its joint axes deviate by less than this angle, rad. A compliant contact is treated as rigid if its
    /// penetration stays below this share of the length of the scene.
    pub neglect: Option<f64>,
    /// A flag that another thread sets to end runs, sessions and derivatives of runs, with [`SimError::Stopped`].
    pub stop: Option<Arc<AtomicBool>>,
}

/// Integrators of smooth motion, both with dense output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integrator {
    /// Dormand & Prince's explicit methods: that of order 8 with error estimates of orders 5 and 3 (DOP853), and that of order 5
    /// with an error estimate of order 4 (DOPRI5) where events follow each other after few steps.
    #[default]
    DormandPrince,
    /// Radau IIA of order 5, implicit: for stiff controllers and damping.
    Radau,
}

impl Simulation {
    /// A simulation with default settings: no gravity, motors off, tolerance 1e-9.
    pub fn new(chain: Chain, touches: Vec<Touch>) -> Self {
        Self {
            chain,
            touches,
            gravity: Vector3::zeros(),
            drive: Drive::Off,
            after_impact: None,
            springs: Vec::new(),
            wrenches: Vec::new(),
            loops: Vec::new(),
            effort_limits: false,
            start_time: 0.0,
            tolerance: TOLERANCE,
            max_step: 0.1,
            zeno_time: 1e-5,
            contact_step: 1e-3,
            several: SeveralLaw::default(),
            stepping: false,
            max_events: usize::MAX,
            planar: true,
            integrator: Integrator::DormandPrince,
            neglect: None,
            stop: None,
        }
    }

    /// # Errors
    /// [`SimError::Stopped`] once the flag [`Self::stop`] is set.
    pub(crate) fn go_on(&self, time: f64) -> Result<(), SimError> {
        let stopped = self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed));
        if stopped { Err(SimError::Stopped { time }) } else { Ok(()) }
    }

    /// The Zeno time for a tolerance: √(0.1 · tolerance) s, in which a body falls by about half the tolerance in m; between 1e-7 s,
    /// below which the heights of bounces reach the rounding of positions, and 1e-3 s, above which the change of the acceleration
    /// makes the formula of the accumulation inexact.
    pub fn zeno_time_for(tolerance: f64) -> f64 {
        (0.1 * tolerance).sqrt().clamp(1e-7, 1e-3)
    }

    /// Sets the tolerance, and the Zeno time in the ratio of those that belong to the tolerances.
    pub(crate) fn set_tolerance(&mut self, tolerance: f64) {
        self.zeno_time *= Self::zeno_time_for(tolerance) / Self::zeno_time_for(self.tolerance);
        self.tolerance = tolerance;
    }

    /// The smallest gap of all touches at a configuration, m (rad for limits of revolute joints), with moving surfaces at
    /// their place at time 0; infinite without touches.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid configuration.
    pub fn smallest_gap(&self, q: &[f64]) -> Result<f64, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, q)?;
        // The nearest points of two bodies stand for the contacts of their parts.
        let whole = self.touches.iter().filter(|touch| !touch.is_part());
        Ok(whole.map(|touch| touch.at(&view, q, 0.0).gap).fold(f64::INFINITY, f64::min))
    }

    /// Contact point and normal of a touch, whether it is open or closed: the point of the link nearest to the surface, m, and
    /// the unit normal from the surface to the robot, both in world axes. `None` for joint limits.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid configuration.
    pub fn touching_point(&self, touch: usize, moment: &Moment) -> Result<Option<[Vector3<f64>; 2]>, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, &moment.q)?;
        let place = self.touches.get(touch).and_then(|it| it.at(&view, &moment.q, moment.time).surface);
        Ok(place.map(|place| [place.position, place.normal]))
    }

    /// The force on the robot of a compliant contact, world axes, N.
    /// [`ContactMode::Pressing`](crate::ContactMode::Pressing) contains its `touch` and `damping`.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid state; [`SimError::NoForce`] for a rigid contact, and for a force that depends on the
    /// history of the contact ([`Yielding::WaltonBraun`](crate::Yielding::WaltonBraun),
    /// [`Holding::Bristle`](crate::Holding::Bristle)).
    pub fn pressing_force(&self, touch: usize, damping: f64, moment: &Moment) -> Result<Vector3<f64>, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, &moment.q)?;
        let Some(touch) = self.touches.get(touch) else { return Ok(Vector3::zeros()) };
        let at = touch.at(&view, &moment.q, moment.time);
        let refuse = |why| Err(SimError::NoForce { touch: touch.name.clone(), why });
        let (Some(place), Some(compliance)) = (at.surface, touch.contact.compliance) else {
            return refuse(" is a rigid contact, which has impulses and no force: give it a compliance");
        };
        if compliance.has_memory() {
            return refuse(
                ": its force depends on the history of the contact (largest penetration, or deflection of a bristle), which a single \
                 moment does not contain; choose the Hunt-Crossley or Kelvin-Voigt force and smoothed friction to compute forces \
                 afterwards",
            );
        }
        let u = touch.u(&place, &view, &moment.qd, moment.time)?;
        let memory = Memory { damping, ..Memory::default() };
        Ok(compliance.press(&touch.contact.law, &memory, (at.gap, place.normal.dot(&u)), &place.normal, &u)?.force)
    }

    /// The planar chain, if the simulation runs in the plane.
    pub fn in_plane(&self) -> Option<PlanarChain> {
        self.planar.then(|| self.flat()).flatten()
    }

    /// The chain in the plane, if it moves parallel to one within the tolerance `neglect`.
    pub(crate) fn flat(&self) -> Option<PlanarChain> {
        self.chain.to_planar_within(self.neglect.unwrap_or(0.0)).ok()
    }

    /// # Errors
    /// [`SimError`]: an invalid state or setting.
    pub(crate) fn check(&self, q: &[f64], qd: &[f64], duration: f64, every: Option<f64>) -> Result<(), SimError> {
        self.chain.check_state(q, qd)?;
        let steps = [("contact step", self.contact_step), ("longest step", self.max_step)];
        let steps = || every.map(|every| ("sampling interval", every)).into_iter().chain(steps);
        let times = [("duration", duration), ("tolerance", self.tolerance), ("Zeno time", self.zeno_time)];
        for (what, value) in times.into_iter().chain(steps()) {
            require(value > 0.0 && value.is_finite(), what, value, "it must be positive and finite")?;
        }
        for (what, value) in steps() {
            let rule = "the duration is more than 1e10 times as long: shorten the duration, or lengthen this";
            require(duration / value <= COUNTABLE, what, value, rule)?;
        }
        let rule = "no integration reaches it: numbers are rounded to 2.2e-16 of their size";
        require(self.tolerance >= f64::EPSILON, "tolerance", self.tolerance, rule)?;
        for &x in &self.gravity {
            require(x.is_finite(), "gravity", x, "every component must be finite")?;
            let rule = "it must stay below 1e100 m/s²: squares of larger numbers overflow";
            require(x.abs() <= STRONGEST, "gravity", x, rule)?;
        }
        if let SeveralLaw::Energetic { exponent } = self.several {
            let rule = "it lies between 1 (flat contacts) and 10: 1.5 for round bodies";
            require((1.0..=10.0).contains(&exponent), "exponent of the energetic law", exponent, rule)?;
        }
        let energetic = matches!(self.several, SeveralLaw::Energetic { .. }) && self.touches.len() > 1;
        for touch in &self.touches {
            let (own, name) = (&touch.contact, &touch.name);
            own.check(name)?;
            let friction = own.law.friction();
            if own.law.by_speed.is_some() && self.several != SeveralLaw::Moreau && self.touches.len() > 1 {
                let (touch, what) = (touch.name.clone(), "restitution by speed, at most");
                let rule = "only several = \"moreau\" has a restitution that depends on the approach speed: choose it, or give a number";
                return Err(SimError::Contact { touch, what, value: own.law.restitution(), rule });
            }
            if energetic && friction > 0.0 && own.compliance.is_none() && !own.latch {
                let rule = "the energetic law for several contacts has no friction: set it to 0, or choose another law with \
                            several";
                return Err(SimError::Contact { touch: name.clone(), what: "friction", value: friction, rule });
            }
            if let Some(compliance) = own.compliance {
                let rule = if touch.limit_of().is_some() {
                    "joint limits are rigid: remove the compliance, or give the joint a spring"
                } else if self.stepping {
                    "time stepping supports rigid contacts only: remove the compliance or use method = \"events\""
                } else if touch.is_covered() {
                    continue;
                } else {
                    "contacts of spheres and contacts on half-spaces can be compliant, not those of other bodies with faces and edges: \
                     give the link a sphere, make the surface a halfspace, or set compliance = \"rigid\" in a [[contact.pair]]"
                };
                let (touch, what, value) = (name.clone(), "compliance stiffness", compliance.stiffness);
                return Err(SimError::Contact { touch, what, value, rule });
            }
        }
        let moments = self.start_time.is_finite() && (self.start_time + duration).is_finite();
        let rule = "it must be finite, and so must be the end of the run";
        require(moments, "time at the start", self.start_time, rule)?;
        self.wrenches.iter().try_for_each(|wrench| wrench.check(&self.chain))?;
        self.springs.iter().try_for_each(|spring| spring.on(&self.chain).map(|_| ()))?;
        self.check_loops()?;
        self.drives().try_for_each(|drive| drive.check(&self.chain))
    }

    /// The drive, and that from the first impact on.
    pub(crate) fn drives(&self) -> impl Iterator<Item = &Drive> {
        std::iter::once(&self.drive).chain(&self.after_impact)
    }

    fn check_loops(&self) -> Result<(), SimError> {
        self.drives().try_for_each(|drive| self.check_loops_of(drive))?;
        self.loops.iter().try_for_each(|own| own.check(&self.chain))
    }

    /// # Errors
    /// [`SimError::Named`] for a drive that cannot be combined with loops.
    pub(crate) fn check_loops_of(&self, drive: &Drive) -> Result<(), SimError> {
        match self.loops.first() {
            Some(first) if drive.is_of_trees() => {
                let rule = "cannot be combined with the controllers \"transition\" and \"impact-invariant\", whose formulas are \
                            those of a tree: choose another controller, or remove the loop";
                Err(named("loop", &first.name, rule))
            }
            _ => Ok(()),
        }
    }

    /// The pairs of points that the loops keep together.
    pub(crate) fn couplings<A: Space>(&self, model: &A::Model) -> Vec<Coupling<A>> {
        let mut couplings = Vec::new();
        for own in &self.loops {
            couplings.extend(own.couplings::<A>(&self.chain, model));
        }
        couplings
    }

    /// The state nearest to `(q, qd)` in the metric of M that closes the loops, and the largest change of a coordinate.
    ///
    /// # Errors
    /// [`SimError::Loop`] if a loop cannot be closed from here; [`SimError::Named`] for an invalid loop.
    pub fn close_loops(&self, q: &[f64], qd: &[f64]) -> Result<(Moment, f64), SimError> {
        self.check_loops()?;
        let (mut own, mut rates) = (q.to_vec(), qd.to_vec());
        let couplings = self.couplings::<Spatial<f64>>(&self.chain);
        let mut workspace = self.chain.workspace();
        close_loops((&self.chain, &self.chain), &mut workspace, &couplings, &mut own, &mut rates)?;
        let changes = own.iter().zip(q).chain(rates.iter().zip(qd)).map(|(new, old)| (new - old).abs());
        let most = changes.fold(0.0, f64::max);
        Ok((Moment { time: self.start_time, q: own, qd: rates }, most))
    }

    /// Viscous damping of every velocity coordinate, from the URDF: the power of a joint that follows is −d (multiplier · q̇)².
    pub(crate) fn damping(&self) -> Vec<f64> {
        self.by_coordinate(|joint, multiplier| multiplier.powi(2) * joint.damping)
    }

    /// Dry friction of every velocity coordinate: joints that follow it slip together with it.
    pub(crate) fn friction(&self) -> Vec<f64> {
        self.by_coordinate(|joint, multiplier| multiplier.abs() * joint.friction)
    }

    /// The sums over the joints that move with each velocity coordinate, of a function of the joint and its multiplier.
    fn by_coordinate(&self, of: impl Fn(&JointInfo, f64) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.chain.nv()];
        for joint in self.chain.joints() {
            let (v, multiplier) = match (&joint.coordinates, self.chain.coordinate_of(joint)) {
                (Coordinates::Own { v, .. }, _) => (v.clone(), 1.0),
                (_, Some(moves)) => (moves.v..moves.v + 1, moves.multiplier),
                _ => continue,
            };
            sums[v].iter_mut().for_each(|sum| *sum += of(joint, multiplier));
        }
        sums
    }

    /// The springs at their numbers of q and qd; those that fit the chain, which [`Simulation::check`] asks of all.
    pub(crate) fn springs_at(&self) -> Vec<SpringAt> {
        self.springs.iter().filter_map(|spring| spring.on(&self.chain).ok()).collect()
    }

    /// Largest force of the motors for each number of qd; empty: no limits.
    pub(crate) fn force_limits(&self) -> Vec<f64> {
        if !self.effort_limits {
            return Vec::new();
        }
        let mut limits = vec![f64::INFINITY; self.chain.nv()];
        motors(&self.chain).iter().for_each(|motor| limits[motor.v] = motor.effort);
        limits
    }

    /// The first time after `time` at which drives, outer forces or surfaces jump or have a kink; infinite without one.
    pub(crate) fn next_kink(&self, moving: &[&Moving], time: f64) -> f64 {
        let kinks = self
            .drives()
            .map(|drive| drive.next_kink(time))
            .chain(self.wrenches.iter().filter_map(|wrench| wrench.next_kink(time)));
        let surfaces = moving.iter().filter_map(|moving| match moving {
            Moving::Given(motion) => motion.next_kink(time),
            _ => None,
        });
        kinks.chain(surfaces).fold(f64::INFINITY, f64::min)
    }

    /// Whether a chain at rest at `time` stays at rest beside surfaces at rest: no drive and no outer force depends on time.
    pub(crate) fn is_steady(&self, time: f64) -> bool {
        self.drives().all(Drive::is_steady) && self.wrenches.iter().all(|wrench| wrench.is_steady(time))
    }

    /// Whether a drive, an outer force or the place of a surface depends on time.
    #[doc(hidden)]
    pub fn depends_on_time(&self) -> bool {
        let moves = |motion: &Moving| matches!(motion, Moving::Given(motion) if motion.moves_shape());
        !self.is_steady(self.start_time) || self.touches.iter().filter_map(|touch| touch.motion.as_ref()).any(moves)
    }

    /// q and q̇ of a state, which begins with them.
    pub(crate) fn split<'y>(&self, y: &'y [f64]) -> (&'y [f64], &'y [f64]) {
        let (q, rest) = y.split_at(self.chain.nq());
        (q, &rest[..self.chain.nv()])
    }

    /// Normalises the quaternions in q, which the integration changes in length by its error. Returns whether any changed.
    pub(crate) fn normalise(&self, q: &mut [f64]) -> bool {
        if self.chain.nq() == self.chain.nv() {
            return false; // no quaternions
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

/// Largest number of steps or samples of a run, which takes hours.
const COUNTABLE: f64 = 1e10;
/// Largest component of gravity, m/s².
const STRONGEST: f64 = 1e100;

#[cfg(test)]
mod tests {
    use super::*;
    use carom_chain::urdf::LoadOptions;

    /// Two free bodies: the change of one quaternion is reported, whichever it is, and none if both have unit length.
    #[test]
    fn normalise_reports_whether_any_quaternion_changed() {
        let body = |name: &str| {
            format!(
                r#"<link name="{name}"><inertial><mass value="1"/>
                  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
                <joint name="{name}_free" type="floating"><parent link="world"/><child link="{name}"/></joint>"#
            )
        };
        let text = format!(r#"<robot name="pair"><link name="world"/>{}{}</robot>"#, body("a"), body("b"));
        let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap();
        let simulation = Simulation::new(chain, Vec::new());
        let unit = [0.0, 0.0, 0.0, 0.48, 0.6, 0.0, 0.64];
        for lengths in [[1.0, 1.0], [1.0, 1.25], [1.25, 1.0], [1.25, 1.25]] {
            let mut q = [unit, unit].concat();
            for (q, length) in q.chunks_mut(7).zip(lengths) {
                q[3..].iter_mut().for_each(|x| *x *= length);
            }
            assert_eq!(simulation.normalise(&mut q), lengths != [1.0, 1.0], "{lengths:?}");
            for (found, exact) in q.iter().zip([unit, unit].concat()) {
                assert!((found - exact).abs() <= f64::EPSILON, "{lengths:?}: {q:?}");
            }
        }
    }
}

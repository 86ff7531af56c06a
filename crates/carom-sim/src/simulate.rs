//! A chain among surfaces, with all that its simulation is told; how a run goes is in `run.rs`.

use crate::compliance::Memory;
use crate::drive::Drive;
use crate::error::SimError;
use crate::run::Run;
use crate::several::SeveralLaw;
use crate::space::View;
use crate::touch::Touch;
use crate::trajectory::{Moment, Sampling, Seen, Summary, Trajectory};
use carom_chain::{Chain, Planar, PlanarChain, Spatial};
use nalgebra::Vector3;

/// A chain among surfaces.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The chain.
    pub chain: Chain,
    /// What may touch, and how.
    pub touches: Vec<Touch>,
    /// Acceleration of free fall, world, m/s².
    pub gravity: Vector3<f64>,
    /// What drives the joints. Their damping and dry friction act besides.
    pub drive: Drive,
    /// What drives them from the first impact on; `None`: the same.
    pub after_impact: Option<Drive>,
    /// Relative tolerance of the integration.
    pub tolerance: f64,
    /// Longest step, s.
    pub max_step: f64,
    /// Impacts that would all happen within this time are gone through at once, s.
    pub zeno_time: f64,
    /// Step while several contacts last at once, s.
    pub contact_step: f64,
    /// The law of several contacts at once.
    pub several: SeveralLaw,
    /// Time steps of `contact_step` throughout, and no events but rest: what most simulators do, for comparison.
    pub stepping: bool,
    /// Stop after so many events.
    pub max_events: usize,
    /// Compute in the plane what keeps to a plane: the same motion for less. `false`: always in space.
    pub planar: bool,
    /// What integrates the smooth motion.
    pub integrator: Integrator,
    /// Leave friction out of an impact if that changes the velocity of the touching point by less than this share of it;
    /// treat a chain as planar whose axes are off by less than this (rad); treat a compliant contact as rigid that gives
    /// way by less than this share of the chain's reach. `None`: leave out nothing that is not zero.
    pub neglect: Option<f64>,
}

/// Integrators of smooth motion, both with dense output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integrator {
    /// Dormand & Prince's explicit method of order 8 with error estimates of orders 5 and 3.
    #[default]
    DormandPrince,
    /// Radau IIA of order 5, implicit: for stiff regulators and damping.
    Radau,
}

impl Simulation {
    /// A simulation without gravity, motors off, with a tolerance of 1e-9; every field can be set.
    pub fn new(chain: Chain, touches: Vec<Touch>) -> Self {
        Self {
            chain,
            touches,
            gravity: Vector3::zeros(),
            drive: Drive::Off,
            after_impact: None,
            tolerance: 1e-9,
            max_step: 0.1,
            zeno_time: 1e-5,
            contact_step: 1e-3,
            several: SeveralLaw::default(),
            stepping: false,
            max_events: usize::MAX,
            planar: true,
            integrator: Integrator::DormandPrince,
            neglect: None,
        }
    }

    /// Runs from `(q, qd)` for `duration` seconds and keeps everything.
    ///
    /// # Errors
    /// [`SimError`]: states and settings that do not fit, an overlap at the start.
    pub fn run(&self, q: &[f64], qd: &[f64], duration: f64) -> Result<Trajectory, SimError> {
        let (mut events, mut segments) = (Vec::new(), Vec::new());
        let summary = self.stream(q, qd, duration, Sampling { every: None, dense: true }, &mut |seen| match seen {
            Seen::Event(event) => events.push(event.clone()),
            Seen::Segment(segment) => segments.push(segment.clone()),
            Seen::Moment(_) => {}
        })?;
        Ok(Trajectory { events, segments, summary })
    }

    /// Runs from `(q, qd)` for `duration` seconds and hands everything to `watch` as it comes: memory does not grow with
    /// the simulated time.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    pub fn stream(
        &self,
        q: &[f64],
        qd: &[f64],
        duration: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        self.check(q, qd, duration, sampling)?;
        match self.in_plane() {
            Some(model) => Run::<Planar<f64>>::go(self, &model, (q, qd), duration, sampling, watch),
            None => Run::<Spatial<f64>>::go(self, &self.chain, (q, qd), duration, sampling, watch),
        }
    }

    /// The smallest gap of all touches at a configuration, surfaces where they are at time 0; infinite without touches.
    ///
    /// # Errors
    /// A configuration that does not fit.
    pub fn smallest_gap(&self, q: &[f64]) -> Result<f64, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, q)?;
        Ok(self.touches.iter().map(|touch| touch.at(&view, q, 0.0).gap).fold(f64::INFINITY, f64::min))
    }

    /// Where a link touches, or would touch, its surface: the point of the link nearest to it and the unit normal from the
    /// surface to the robot, world. `None` for joint limits.
    ///
    /// # Errors
    /// A state that does not fit.
    pub fn touching_point(&self, touch: usize, moment: &Moment) -> Result<Option<[Vector3<f64>; 2]>, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, &moment.q)?;
        let place = self.touches.get(touch).and_then(|it| it.at(&view, &moment.q, moment.time).surface);
        Ok(place.map(|place| [place.position, place.normal]))
    }

    /// The force on the robot, world, N, of a compliant contact that presses
    /// ([`ContactMode::Pressing`](crate::ContactMode::Pressing) names its touch and damping).
    ///
    /// # Errors
    /// A state that does not fit; a touch that is not compliant, or whose force has a memory
    /// ([`Yielding::WaltonBraun`](crate::Yielding::WaltonBraun), [`Holding::Bristle`](crate::Holding::Bristle)), which a
    /// moment does not hold.
    pub fn pressing_force(&self, touch: usize, damping: f64, moment: &Moment) -> Result<Vector3<f64>, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, &moment.q)?;
        let Some(touch) = self.touches.get(touch) else { return Ok(Vector3::zeros()) };
        let at = touch.at(&view, &moment.q, moment.time);
        let (Some(place), Some(compliance)) = (at.surface, touch.contact.compliance) else {
            return Err(SimError::Rigid { touch: touch.name.clone() });
        };
        if compliance.has_memory() {
            return Err(SimError::Memory { touch: touch.name.clone() });
        }
        let u = touch.u(&place, &view, &moment.qd, moment.time)?;
        let memory = Memory { damping, ..Memory::default() };
        Ok(compliance.press(&touch.contact, &memory, (at.gap, place.normal.dot(&u)), &place.normal, &u)?.force)
    }

    /// The chain in the plane, if it is to be computed there.
    pub fn in_plane(&self) -> Option<PlanarChain> {
        self.planar.then(|| self.chain.to_planar_within(self.neglect.unwrap_or(0.0)).ok()).flatten()
    }

    fn check(&self, q: &[f64], qd: &[f64], duration: f64, sampling: Sampling) -> Result<(), SimError> {
        self.chain.check_state(q, qd)?;
        let positive = |what, value: f64| {
            let fine = value > 0.0 && value.is_finite();
            let rule = "it must be positive and finite";
            if fine { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
        };
        if let Some(&value) = self.gravity.iter().find(|x| !x.is_finite()) {
            return Err(SimError::Setting { what: "gravity", value, rule: "every component must be finite" });
        }
        positive("duration", duration)?;
        positive("tolerance", self.tolerance)?;
        positive("longest step", self.max_step)?;
        positive("Zeno time", self.zeno_time)?;
        positive("contact step", self.contact_step)?;
        let countable = |what, value: f64| {
            let rule = "it fits more than 1e10 times into the duration: make it longer";
            if duration / value <= 1e10 { Ok(()) } else { Err(SimError::Setting { what, value, rule }) }
        };
        if let Some(every) = sampling.every {
            positive("sampling interval", every)?;
            countable("sampling interval", every)?;
        }
        countable("contact step", self.contact_step)?;
        for touch in &self.touches {
            touch.contact.check(&touch.name)?;
            if let Some(compliance) = touch.contact.compliance.filter(|_| self.stepping) {
                return Err(SimError::Contact {
                    touch: touch.name.clone(),
                    what: "compliance stiffness",
                    value: compliance.stiffness,
                    rule: "time steps know rigid contacts only: leave the compliance or the steps out",
                });
            }
        }
        self.drive.check(&self.chain)?;
        self.after_impact.iter().try_for_each(|drive| drive.check(&self.chain))
    }

    /// The joint of a velocity coordinate.
    pub(crate) fn joint_of(&self, index: usize) -> String {
        let own = |joint: &&carom_chain::JointInfo| matches!(&joint.coordinates, carom_chain::Coordinates::Own { v, .. } if v.contains(&index));
        self.chain.joints().iter().find(own).map_or_else(String::new, |joint| joint.name.clone())
    }
}

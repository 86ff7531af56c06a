//! The simulation of a chain with its contacts, and its settings; the event loop is in `run.rs`.

use super::drive::Drive;
use crate::contact::compliance::Memory;
use crate::contact::touch::Touch;
use crate::error::SimError;
use crate::run::events::Run;
use crate::run::several::SeveralLaw;
use crate::run::trajectory::{Moment, Sampling, Seen, Summary, Trajectory};
use crate::state::space::View;
use carom_chain::{Chain, Planar, PlanarChain, Spatial};
use nalgebra::Vector3;

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
    /// Relative tolerance of each integration step; the absolute tolerance is 1e-3 of it.
    pub tolerance: f64,
    /// Longest integration step, s.
    pub max_step: f64,
    /// If all remaining impacts of an accumulation (Zeno) end within this time, s, they are replaced by their limit.
    pub zeno_time: f64,
    /// Length of a time step while several contacts last, s.
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
    /// penetration stays below this share of the reach of the chain.
    pub neglect: Option<f64>,
}

/// Integrators of smooth motion, both with dense output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integrator {
    /// Dormand & Prince's explicit method of order 8 with error estimates of orders 5 and 3.
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

    /// Runs from `(q, qd)` for `duration` seconds and returns all events and the whole motion.
    ///
    /// # Errors
    /// [`SimError`]: an invalid state or setting, an overlap at the start, errors of the impact laws and of the integrator.
    pub fn run(&self, q: &[f64], qd: &[f64], duration: f64) -> Result<Trajectory, SimError> {
        let (mut events, mut segments) = (Vec::new(), Vec::new());
        let summary = self.stream(q, qd, duration, Sampling { every: None, dense: true }, &mut |seen| match seen {
            Seen::Event(event) => events.push(event.clone()),
            Seen::Segment(segment) => segments.push(segment.clone()),
            Seen::Moment(_) => {}
        })?;
        Ok(Trajectory { events, segments, summary })
    }

    /// Runs from `(q, qd)` for `duration` seconds and calls `watch` with every event, sample and segment. Memory does not
    /// grow with the simulated time.
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

    /// The smallest gap of all touches at a configuration, m (rad for limits of revolute joints), with moving surfaces at
    /// their place at time 0; infinite without touches.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid configuration.
    pub fn smallest_gap(&self, q: &[f64]) -> Result<f64, SimError> {
        let mut workspace = self.chain.workspace();
        let view = View::<Spatial<f64>>::new(&self.chain, &mut workspace, q)?;
        Ok(self.touches.iter().map(|touch| touch.at(&view, q, 0.0).gap).fold(f64::INFINITY, f64::min))
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
    /// [`SimError::Chain`] for an invalid state; [`SimError::Rigid`] for a rigid contact; [`SimError::Memory`] for a force that
    /// depends on the history of the contact ([`Yielding::WaltonBraun`](crate::Yielding::WaltonBraun),
    /// [`Holding::Bristle`](crate::Holding::Bristle)).
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

    /// The planar chain, if the simulation runs in the plane.
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
            let rule = "the duration is more than 1e10 times as long: make it longer";
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
                    rule: "time stepping supports rigid contacts only: remove the compliance or use method = \"events\"",
                });
            }
        }
        self.drive.check(&self.chain)?;
        self.after_impact.iter().try_for_each(|drive| drive.check(&self.chain))
    }
}

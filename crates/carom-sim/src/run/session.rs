//! A simulation as an object that a control loop drives.

use super::run_state::{Checkpoint, Run};
use super::trajectory::{EnergyBooks, Event, Sampling, Seen, StopReason, Summary};
use crate::contact::ContactMode;
use crate::error::{SimError, named, require};
use crate::model::{Drive, Simulation};
use crate::motion::{ContactState, Motion};
use crate::plan::Plan;
use crate::state::{Moment, Space};
use carom_chain::{Chain, PlanarChain};
use carom_impact::SeveralProblem;
use std::sync::Arc;

/// Asks a run that stands where the session does.
macro_rules! ask {
    ($session:expr, |$run:ident| $question:expr) => {{
        let (sim, checkpoint, ignore) = (&$session.simulation, $session.state.checkpoint.clone(), &mut |_: Seen| {});
        in_its_space!(sim, &$session.flat, |A, model| {
            let motion = Motion::<A>::new(sim, model);
            let $run = &mut Run::resume(motion, checkpoint, Sampling::default(), ignore);
            $question
        })
    }};
}

/// A simulation that is advanced piece by piece: a control loop reads state and contacts, sets joint forces and advances.
///
/// ```
/// use carom_chain::Chain;
/// use carom_sim::Simulation;
///
/// let arm = Chain::from_urdf_str(
///     r#"<robot name="arm"><link name="base"/><link name="tip"><inertial><mass value="1"/>
///        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
///        <joint name="hinge" type="continuous"><parent link="base"/><child link="tip"/>
///        <axis xyz="0 0 1"/></joint></robot>"#,
///     &Default::default(),
/// )?;
/// let mut session = Simulation::new(arm, Vec::new()).start(&[0.0], &[1.0])?;
/// while session.time() < 1.0 {
///     let rate = session.moment().qd[0];
///     session.set_forces(&[-2.0 * rate])?; // a brake, sampled at 100 Hz
///     session.advance(0.01)?;
/// }
/// assert!(session.moment().qd[0] < 0.2);
/// # Ok::<(), carom_sim::SimError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Session {
    simulation: Simulation,
    flat: Option<PlanarChain>,
    state: SessionState,
}

/// The whole state of a [`Session`]: time, positions and velocities, modes of the contacts, what they remember, counts. A
/// session that continues from it repeats its motion.
#[derive(Debug, Clone)]
pub struct SessionState {
    checkpoint: Checkpoint,
    /// Of the simulation that it is a state of.
    names: Arc<[String]>,
    /// Energy at the start, J.
    start: f64,
    /// Events that no advance has returned yet.
    pending: Vec<Event>,
    /// Whether the forces were set since the last advance.
    changed: bool,
}

/// What happened during an advance.
#[derive(Debug, Clone)]
pub struct Advance {
    /// The events, in the order of time.
    pub events: Vec<Event>,
    /// Why it ended: [`StopReason::Events`] after [`Simulation::max_events`] events of this session.
    pub stop: StopReason,
}

impl Simulation {
    /// Starts a session at `(q, qd)`. An impact at the start is among the events of the first advance.
    ///
    /// # Errors
    /// [`SimError`]: an invalid state or setting, an overlap at the start, errors of the impact laws.
    pub fn start(self, q: &[f64], qd: &[f64]) -> Result<Session, SimError> {
        let flat = self.in_plane();
        Session::new(self, flat, q, qd)
    }
}

impl Plan {
    /// Starts a session of the plan at its start, in the plane that the plan has decided on.
    ///
    /// # Errors
    /// As [`Simulation::start`].
    pub fn start(&self) -> Result<Session, SimError> {
        Session::new(self.simulation.clone(), self.in_plane().cloned(), &self.q, &self.qd)
    }
}

impl Session {
    fn new(simulation: Simulation, flat: Option<PlanarChain>, q: &[f64], qd: &[f64]) -> Result<Self, SimError> {
        let state = begin(&simulation, flat.as_ref(), q, qd)?;
        Ok(Self { simulation, flat, state })
    }

    /// The simulation. Its drive is the one that was set last.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The chain.
    pub fn chain(&self) -> &Chain {
        &self.simulation.chain
    }

    /// Time, s.
    pub fn time(&self) -> f64 {
        self.state.checkpoint.time
    }

    /// Time and state now.
    pub fn moment(&self) -> Moment {
        let (nq, nv) = (self.chain().nq(), self.chain().nv());
        let Checkpoint { time, y, .. } = &self.state.checkpoint;
        Moment { time: *time, q: y[..nq].to_vec(), qd: y[nq..nq + nv].to_vec() }
    }

    /// The contact mode now.
    pub fn mode(&self) -> ContactMode {
        self.state.checkpoint.active.mode()
    }

    /// The lasting contacts now, with their forces under the drive that was set last.
    ///
    /// # Errors
    /// [`SimError`] of the computation of forces.
    pub fn contacts(&self) -> Result<Vec<ContactState>, SimError> {
        ask!(self, |run| run.contacts())
    }

    /// The contact problem of a time step of this length (s) from the present state, as time steps of the scene pose it
    /// (Moreau–Jean, θ = ½): contacts that are closed after half a step with the present velocities, joint limits and joints with dry
    /// friction, in this order. Its impulses are N s, its velocities those of the rows relative to the surfaces, m/s and rad/s.
    /// Compliant contacts are among the forces.
    ///
    /// # Errors
    /// [`SimError::Setting`] for a step that is not > 0, and errors of the computation of forces.
    pub fn contact_problem(&self, step: f64) -> Result<SeveralProblem, SimError> {
        require(step > 0.0 && step.is_finite(), "step", step, "it must be positive and finite")?;
        ask!(self, |run| run.contact_problem(step))
    }

    /// The forces of the motors now, after their limits, under the drive that was set last: length nv; N m, N.
    ///
    /// # Errors
    /// [`SimError`] of the drive.
    pub fn motor_forces(&self) -> Result<Vec<f64>, SimError> {
        let Checkpoint { time, y, .. } = &self.state.checkpoint;
        ask!(self, |run| run.motion.motor_forces(*time, y))
    }

    /// The energy balance since the start of the session.
    ///
    /// # Errors
    /// [`SimError`] of the computation of energies.
    pub fn energy(&self) -> Result<EnergyBooks, SimError> {
        ask!(self, |run| run.books(self.state.start))
    }

    /// Replaces the drive, also that after an impact, by constant joint forces (length nv; N m, N).
    ///
    /// # Errors
    /// [`SimError::Chain`]: a wrong length, numbers that are not finite.
    pub fn set_forces(&mut self, forces: &[f64]) -> Result<(), SimError> {
        self.set_drive(Drive::Constant(forces.to_vec()))
    }

    /// Replaces the drive, also that after an impact.
    ///
    /// # Errors
    /// [`SimError`]: a drive that does not fit the chain.
    pub fn set_drive(&mut self, drive: Drive) -> Result<(), SimError> {
        drive.check(self.chain())?;
        self.simulation.check_loops_of(&drive)?;
        self.state.changed |= drive != self.simulation.drive || self.simulation.after_impact.is_some();
        (self.simulation.drive, self.simulation.after_impact) = (drive, None);
        Ok(())
    }

    /// Advances by `duration` seconds.
    ///
    /// # Errors
    /// As [`Simulation::stream`]; the session then stays where it was.
    pub fn advance(&mut self, duration: f64) -> Result<Advance, SimError> {
        self.go(duration, false)
    }

    /// Advances to the next event, by `longest` seconds at most. Events of the same cause have the same time: an impact and
    /// the mode that follows it. Without an event the list is empty.
    ///
    /// # Errors
    /// As [`Session::advance`].
    pub fn advance_to_event(&mut self, longest: f64) -> Result<Advance, SimError> {
        self.go(longest, true)
    }

    /// Advances by `duration` seconds and calls `watch` with every event, moment and segment, as [`Simulation::stream`] does.
    /// The moments are those after the present time, up to the end; at the start of the session also that of the start.
    ///
    /// # Errors
    /// As [`Session::advance`]; what was passed to `watch` before is then to be dropped.
    pub fn stream(
        &mut self,
        duration: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<StopReason, SimError> {
        self.pass(duration, false, sampling, watch)
    }

    /// [`Session::stream`] to the next event, by `longest` seconds at most.
    ///
    /// # Errors
    /// As [`Session::advance`].
    pub fn stream_to_event(
        &mut self,
        longest: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<StopReason, SimError> {
        self.pass(longest, true, sampling, watch)
    }

    /// The results so far, as those of a run that ends now for the reason `stop`.
    ///
    /// # Errors
    /// [`SimError`] of the computation of forces and energies.
    pub fn summary(&self, stop: StopReason) -> Result<Summary, SimError> {
        ask!(self, |run| run.summary(self.state.start, stop))
    }

    /// The state, for [`Session::restore`].
    pub fn save(&self) -> SessionState {
        self.state.clone()
    }

    /// Returns to a state of this session, or of another one of the same simulation. The drive stays as it is.
    ///
    /// # Errors
    /// [`SimError::Named`] if the state belongs to a simulation with other joints or possible contacts.
    pub fn restore(&mut self, state: &SessionState) -> Result<(), SimError> {
        let (own, other) = (&self.state.names, &state.names);
        if own != other {
            let apart = other.iter().find(|name| !own.contains(name)).or(own.iter().find(|name| !other.contains(name)));
            let name = apart.map_or("", String::as_str);
            return Err(named("the saved state", name, "belongs to another simulation: save it in this one"));
        }
        self.state = SessionState { changed: true, ..state.clone() };
        Ok(())
    }

    /// The nearest state to `(q, qd)`, in the metric of M, in which the contacts that are closed now are closed, those that last move as
    /// they do now (with no normal velocity, without slip where they stick), and the loops are closed.
    ///
    /// # Errors
    /// [`SimError::Chain`] for an invalid state.
    pub fn nearest(&self, q: &[f64], qd: &[f64]) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        self.simulation.check(q, qd, 1.0, None)?;
        ask!(self, |run| run.nearest(q, qd))
    }

    /// Starts again from another state, at the present time: contacts, counts and energies begin anew.
    ///
    /// # Errors
    /// As [`Simulation::start`].
    pub fn restart(&mut self, q: &[f64], qd: &[f64]) -> Result<(), SimError> {
        let simulation = Simulation { start_time: self.time(), ..self.simulation.clone() };
        self.state = begin(&simulation, self.flat.as_ref(), q, qd)?;
        self.simulation = simulation;
        Ok(())
    }

    fn go(&mut self, duration: f64, to_event: bool) -> Result<Advance, SimError> {
        let mut events = Vec::new();
        let watch = &mut |seen: Seen| {
            if let Seen::Event(event) = seen {
                events.push(event.clone());
            }
        };
        let stop = self.pass(duration, to_event, Sampling::default(), watch)?;
        Ok(Advance { events, stop })
    }

    fn pass(
        &mut self,
        duration: f64,
        to_event: bool,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<StopReason, SimError> {
        let moment = self.moment();
        self.simulation.check(&moment.q, &moment.qd, duration, sampling.every)?;
        for event in &self.state.pending {
            let loads = event.loads.clone().filter(|_| sampling.loads);
            watch(Seen::Event(&Event { loads, ..event.clone() }));
        }
        if to_event && !self.state.pending.is_empty() {
            self.state.pending.clear();
            return Ok(StopReason::Duration);
        }
        let go = (self.time() + duration, self.state.changed, to_event);
        let (sim, checkpoint) = (&self.simulation, self.state.checkpoint.clone());
        let advanced =
            in_its_space!(sim, &self.flat, |A, model| advance::<A>(sim, model, checkpoint, go, sampling, watch));
        let (stop, checkpoint) = advanced?;
        let SessionState { start, ref names, .. } = self.state;
        self.state = SessionState { checkpoint, names: names.clone(), start, pending: Vec::new(), changed: false };
        Ok(stop)
    }
}

fn begin(simulation: &Simulation, flat: Option<&PlanarChain>, q: &[f64], qd: &[f64]) -> Result<SessionState, SimError> {
    simulation.check(q, qd, 1.0, None)?;
    in_its_space!(simulation, flat, |A, model| start::<A>(simulation, model, q, qd))
}

fn start<A: Space>(sim: &Simulation, model: &A::Model, q: &[f64], qd: &[f64]) -> Result<SessionState, SimError> {
    let mut pending = Vec::new();
    let watch = &mut |seen: Seen| {
        if let Seen::Event(event) = seen {
            pending.push(event.clone());
        }
    };
    // With loads, in case that the first advance asks for them.
    let sampling = Sampling { loads: true, ..Sampling::default() };
    let mut run = Run::<A>::at_start(sim, model, (q, qd), sampling, watch)?;
    let start = run.motion.energy(&run.y)?;
    run.end = run.time;
    run.begin()?;
    let checkpoint = run.checkpoint();
    let names = sim.state_names().into_iter().chain(sim.touches.iter().map(|touch| touch.name.clone())).collect();
    Ok(SessionState { checkpoint, names, start, pending, changed: false })
}

/// Runs on from `checkpoint`; returns why it ended, and where.
fn advance<A: Space>(
    sim: &Simulation,
    model: &A::Model,
    checkpoint: Checkpoint,
    (end, changed, to_event): (f64, bool, bool),
    sampling: Sampling,
    watch: &mut dyn FnMut(Seen),
) -> Result<(StopReason, Checkpoint), SimError> {
    let mut run = Run::<A>::resume(Motion::new(sim, model), checkpoint, sampling, watch);
    run.end = end;
    run.wake(changed)?;
    let stop = run.until_end(to_event)?;
    Ok((stop, run.checkpoint()))
}

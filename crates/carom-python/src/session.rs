//! A simulation that a loop in Python advances.

use crate::array::{Array, list};
use crate::chain::{Chain, Origin};
use crate::contact_problem::ContactProblem;
use crate::error::{exceptions, raise};
use crate::run::{RunEvent, contact_table};
use crate::scene::{Functions, Planned, Scene};
use crate::table::Table;
use crate::threads::{LOOK, interruptible};
use carom_sim::{Sampling, Seen, StopReason};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pythonize::pythonize;
use std::sync::Arc;

/// A simulation that a loop advances: read state and contacts, set joint forces, advance. Made by `Scene.session`.
///
/// q and qd have the coordinates of `session.chain`, the reduced chain of the scene's plan. One thread at a time may use a session.
#[pyclass(module = "carom")]
pub struct Session {
    session: carom_sim::Session,
    chain: Chain,
    functions: Functions,
}

impl Session {
    pub fn new(session: carom_sim::Session, scene: &Scene, functions: Functions) -> Self {
        let chain = Chain::new(session.chain().clone(), Origin::Of(Arc::new(Planned(scene.clone()))));
        Self { session, chain, functions }
    }

    fn go(&mut self, py: Python<'_>, (duration, to_event, loads): (f64, bool, bool)) -> PyResult<Vec<RunEvent>> {
        let (session, mut events) = (&mut self.session, Vec::new());
        let sampling = Sampling { every: None, dense: duration > LOOK, loads };
        let advance = if to_event { carom_sim::Session::stream_to_event } else { carom_sim::Session::stream };
        let stop = interruptible(py, |look| {
            let watch = &mut |seen: Seen| {
                look();
                if let Seen::Event(event) = seen {
                    events.push(event.clone());
                }
            };
            advance(session, duration, sampling, watch)
        })?;
        let stop = self.functions.pass(stop)?;
        let sim = self.session.simulation();
        if stop == StopReason::Events && events.is_empty() {
            let (most, time) = (sim.max_events, self.session.time());
            let message =
                format!("the session has had {most} events by {time} s: raise max_events in [run] of the scene");
            return Err(exceptions::SimulationError::new_err(message));
        }
        Ok(events.into_iter().map(|event| RunEvent::of(sim, event)).collect())
    }
}

getters! { Session, self, py {
    /// The simulated robot.
    chain: Chain = self.chain.again();
    /// Time, s.
    time: f64 = self.session.time();
    /// Configuration, shape (nq,); rad, m, quaternion.
    q: Array<'py> = list(py, &self.session.moment().q)?;
    /// Joint velocities, shape (nv,); rad/s, m/s.
    qd: Array<'py> = list(py, &self.session.moment().qd)?;
    /// Forces of the motors now, after their limits, under the present joint forces, shape (nv,); N m, N.
    motors: Array<'py> = list(py, &self.functions.pass(self.session.motor_forces())?)?;
    /// The contact mode: "free", "sliding", "sticking", "latched", "pressing" or "stepping".
    mode: &'static str = self.session.mode().name();
    /// Energy balance since the start; the dict of `Run.energy`.
    energy: Bound<'py, PyAny>, "dict[str, float]" = pythonize(py, &self.functions.pass(self.session.energy())?)?;
} }

#[pymethods]
impl Session {
    /// The lasting contacts, with their forces under the present joint forces; a Table with the columns of `Run.contacts`.
    #[getter]
    fn contacts(&self) -> PyResult<Table> {
        let states = self.functions.pass(self.session.contacts())?;
        Ok(contact_table(self.session.simulation(), [(self.session.time(), &states[..])].into_iter()))
    }

    /// Sets constant joint forces instead of the controller, from now on.
    ///
    /// Args:
    ///     forces: shape (nv,), N m and N. The entries of a floating or planar joint are forces and torques on it.
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite.
    fn set_forces(&mut self, forces: &Bound<'_, PyAny>) -> PyResult<()> {
        self.session.set_forces(&self.chain.v("forces", forces)?.single("forces")?).map_err(raise)
    }

    /// Advances by a duration (s); returns the events in it, with loads=True with `Event.loads`. Ctrl-C ends it.
    ///
    /// Raises:
    ///     SimulationError: a motion that cannot be continued, more events than max_events. The session then stays where it was.
    ///         Exceptions of a law or a controller in Python are passed on as they are.
    #[pyo3(signature = (duration, *, loads=false))]
    fn advance(&mut self, py: Python<'_>, duration: f64, loads: bool) -> PyResult<Vec<RunEvent>> {
        self.go(py, (duration, false, loads))
    }

    /// Advances to the next event, by `longest` seconds at most; returns the events of its time, an empty list if there is none.
    /// Loads and errors as `advance`.
    #[pyo3(signature = (longest, *, loads=false))]
    fn advance_to_event(&mut self, py: Python<'_>, longest: f64, loads: bool) -> PyResult<Vec<RunEvent>> {
        self.go(py, (longest, true, loads))
    }

    /// The contact problem of a time step of this length (s) from the present state, as time steps of the scene pose it (Moreau–Jean,
    /// θ = ½): contacts that are closed after half a step with the present velocities, joint limits and joints with dry friction.
    ///
    /// Raises:
    ///     SimulationError: a step that is not > 0, and errors of the computation of forces.
    fn contact_problem(&self, step: f64) -> PyResult<ContactProblem> {
        Ok(self.functions.pass(self.session.contact_problem(step))?.into())
    }

    /// The whole state, for `restore`: time, q, qd, the contacts and what they remember. The joint forces are not part of it.
    fn save(&self) -> SessionState {
        SessionState { state: self.session.save() }
    }

    /// Returns to a saved state of this session or of another one of the same scene.
    ///
    /// Raises:
    ///     SimulationError: a state of a scene with other joints or contacts.
    fn restore(&mut self, state: &SessionState) -> PyResult<()> {
        self.session.restore(&state.state).map_err(raise)
    }

    /// Starts again from another state at the present time; contacts, energies and the count of events begin anew.
    ///
    /// Args:
    ///     q, qd: shapes (nq,) and (nv,).
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    ///     SimulationError: an overlap.
    fn restart(&mut self, q: &Bound<'_, PyAny>, qd: &Bound<'_, PyAny>) -> PyResult<()> {
        let (q, qd) = (self.chain.q(q)?.single("q")?, self.chain.v("qd", qd)?.single("qd")?);
        self.functions.pass(self.session.restart(&q, &qd))
    }

    fn __reduce__(&self) -> PyResult<Py<PyAny>> {
        Err(PyTypeError::new_err(
            "a carom.Session cannot be copied or pickled: start another one of the same scene and restore(session.save()); in another \
             process pickle the scene, q and qd, and begin with restart(q, qd)",
        ))
    }

    fn __repr__(&self) -> String {
        let (name, time, mode) = (self.session.chain().name(), self.session.time(), self.session.mode().name());
        format!("<carom.Session of '{name}' at {time} s, {mode}>")
    }
}

/// A saved state of a Session, for `Session.restore`.
#[pyclass(frozen, module = "carom")]
pub struct SessionState {
    state: carom_sim::SessionState,
}

#[pymethods]
impl SessionState {
    fn __repr__(&self) -> &'static str {
        "<carom.SessionState>"
    }

    fn __reduce__(&self) -> PyResult<Py<PyAny>> {
        Err(PyTypeError::new_err(
            "a carom.SessionState cannot be pickled: pickle the scene, q and qd, and begin with session.restart(q, qd)",
        ))
    }
}

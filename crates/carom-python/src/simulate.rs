//! Methods of `Scene` that run it.

use crate::error::raise;
use crate::run::{Run, Told};
use crate::scene::Scene;
use crate::sensitivity::{self, Sensitivity};
use crate::session::Session;
use crate::threads::{LOOK, interruptible};
use carom_sim::{Sampling, Seen};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;

/// Time between samples if neither the scene nor the call gives one, s: as on the command line.
const SAMPLE: f64 = 0.004;

#[pymethods]
impl Scene {
    /// Simulates the scene from event to event. The GIL is released, except while a function in Python is called.
    ///
    /// Args:
    ///     sample: time between samples, s; by default that of the scene, or 0.004 s.
    ///
    /// Raises:
    ///     SimulationError: an overlap at the start, a motion that cannot be continued. Exceptions of a law or a controller in
    ///         Python are passed on as they are.
    #[pyo3(signature = (*, sample=None))]
    fn simulate(&self, py: Python<'_>, sample: Option<f64>) -> PyResult<Run> {
        let every = sample.or(self.scene.sample).unwrap_or(SAMPLE);
        let sampling = Sampling { every: Some(every), dense: every > LOOK };
        let rated = self.functions.controller.as_ref().and_then(|it| Some((it, it.rate()?)));
        let done = interruptible(py, |look| {
            let plan = self.scene.plan()?;
            let (mut seen, duration) = (Vec::new(), self.scene.duration);
            let watch = &mut |it: Seen| {
                look();
                seen.extend(Told::of(&it));
            };
            let summary = match rated {
                Some((controller, rate)) => controller.run((&plan, rate), duration, sampling, watch)?,
                None => plan.stream(duration, sampling, watch)?,
            };
            Ok((plan, seen, summary))
        });
        let (plan, seen, summary) = self.functions.pass(done?)?;
        for warning in summary.warnings() {
            let text = std::ffi::CString::new(warning).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        Ok(Run::new(self.again(), plan, seen, summary))
    }

    /// Starts a Session: a simulation that a loop of one's own advances.
    ///
    /// Raises:
    ///     SimulationError: an overlap at the start.
    ///     ValueError: the scene has a controller with a rate.
    fn session(&self, py: Python<'_>) -> PyResult<Session> {
        if self.functions.controller.as_ref().is_some_and(|it| it.rate().is_some()) {
            return Err(PyValueError::new_err(
                "the scene has a controller with a rate, but in a session your loop samples: start the session of the scene \
                 without it, and set the joint forces with set_forces",
            ));
        }
        let session = py.detach(|| self.scene.plan()?.start());
        Ok(Session::new(self.functions.pass(session)?, self, self.functions.clone()))
    }

    /// The derivatives of the whole run: of the final state and of the times of events, by the start and by parameters. Exact to
    /// about 1e-8 of their size. The GIL is released, except while a law in Python is called.
    ///
    /// Args:
    ///     parameters: names of parameters, [] for none; by default all: "restitution" and "friction" of all contacts together, and
    ///         "kp elbow", "kd elbow", "target elbow" or "torque elbow" of each joint under PD control or constant forces.
    ///
    /// Raises:
    ///     ValueError: a name that is no parameter of the scene.
    ///     SimulationError: as `simulate`. A run that is not differentiable is no error: see `Sensitivity.broken`.
    #[pyo3(signature = (parameters=None))]
    fn sensitivity(&self, py: Python<'_>, parameters: Option<Vec<String>>) -> PyResult<Sensitivity> {
        let plan = py.detach(|| self.scene.plan()).map_err(raise)?;
        let parameters = sensitivity::chosen(&plan, parameters)?;
        let found = py.detach(|| sensitivity::of(&plan, self.scene.duration, &parameters));
        self.functions.pass(found)
    }
}

//! Scenes: read, planned, run.

use crate::array::{Array, Given, Maybe, list};
use crate::chain::Chain;
use crate::controller::PythonController;
use crate::error::raise;
use crate::laws::GivenLaw;
use crate::run::Run;
use crate::sensitivity::{self, Sensitivity};
use crate::session::Session;
use crate::text::toml_text;
use carom_sim::{Sampling, Seen, SimError};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;
use std::path::PathBuf;
use std::sync::Arc;

/// Time between samples if neither the scene nor the call gives one, s: as on the command line.
const SAMPLE: f64 = 0.004;

/// A scene: a robot, the surfaces around it, contact laws and run settings. Immutable.
///
/// Make one with `Scene.from_file`, `Scene.from_toml` or `Scene.from_dict`; the page "Scene keys" of the manual lists the keys.
#[pyclass(frozen, module = "carom")]
pub struct Scene {
    pub scene: Arc<carom_sim::Scene>,
    functions: Functions,
}

/// The functions in Python that a scene calls.
#[derive(Clone, Default)]
pub struct Functions {
    laws: Vec<GivenLaw>,
    controller: Option<PythonController>,
}

impl Functions {
    /// The result of a simulation, or the exception that a function has raised in it.
    ///
    /// # Errors
    /// The exception, or else that of the error of the simulation.
    pub fn pass<T>(&self, done: Result<T, SimError>) -> PyResult<T> {
        let controller = self.controller.as_ref().and_then(PythonController::raised);
        // All are taken, so that none is left for a later run.
        match self.laws.iter().filter_map(GivenLaw::raised).chain(controller).reduce(|first, _| first) {
            Some(raised) => Err(raised),
            None => done.map_err(raise),
        }
    }
}

impl From<carom_sim::Scene> for Scene {
    fn from(scene: carom_sim::Scene) -> Self {
        Self { scene: Arc::new(scene), functions: Functions::default() }
    }
}

impl Scene {
    fn other(&self, scene: carom_sim::Scene) -> Self {
        Self { scene: Arc::new(scene), functions: self.functions.clone() }
    }
}

getters! { Scene, self, py {
    /// The robot.
    chain: Chain = self.scene.simulation.chain.clone().into();
    /// Configuration at the start, shape (nq,).
    q: Array<'py> = list(py, &self.scene.q)?;
    /// Joint velocities at the start, shape (nv,).
    qd: Array<'py> = list(py, &self.scene.qd)?;
    /// Duration of a run, s.
    duration: f64 = self.scene.duration;
    /// Names of the surfaces.
    surfaces: Vec<&str> = self.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
    /// Names of the possible contacts.
    contacts: Vec<&str> = self.scene.simulation.touches.iter().map(|touch| touch.name.as_str()).collect();
    /// Warnings, one sentence each.
    warnings: Vec<String> = self.scene.warnings.clone();
} }

#[pymethods]
impl Scene {
    /// Reads a scene file (TOML), its robot and its meshes.
    ///
    /// Raises:
    ///     SimulationError: a key or a value that breaks a rule; the message names file, key, value and rule.
    ///     UrdfError, StateError: an invalid robot or start.
    #[staticmethod]
    fn from_file(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(py.detach(|| carom_sim::Scene::from_file(path)).map_err(raise)?.into())
    }

    /// Reads a scene from the text of a scene file; file names in it are relative to `folder`. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (text, folder=PathBuf::from(".")))]
    fn from_toml(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        Ok(py.detach(|| carom_sim::Scene::from_toml(text, folder)).map_err(raise)?.into())
    }

    /// Reads a scene from a dict with the keys of a scene file; file names in it are relative to `folder`. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (keys, folder=PathBuf::from(".")))]
    fn from_dict(py: Python<'_>, keys: Given, folder: PathBuf) -> PyResult<Self> {
        Self::from_toml(py, &toml_text(keys)?, folder)
    }

    /// The same scene from another start.
    ///
    /// Args:
    ///     q, qd: shapes (nq,) and (nv,); what is not given is kept.
    #[pyo3(signature = (q=None, qd=None))]
    fn with_start(&self, q: Maybe, qd: Maybe) -> PyResult<Self> {
        let chain = Chain::from(self.scene.simulation.chain.clone());
        let mut scene = (*self.scene).clone();
        if let Some(q) = q {
            scene.q = chain.q(q)?.single("q")?;
        }
        if let Some(qd) = qd {
            scene.qd = chain.v("qd", qd)?.single("qd")?;
        }
        chain.chain.check_state(&scene.q, &scene.qd).map_err(raise)?;
        Ok(self.other(scene))
    }

    /// The same scene with another duration, s.
    fn with_duration(&self, duration: f64) -> Self {
        self.other(carom_sim::Scene { duration, ..(*self.scene).clone() })
    }

    /// The same scene with another impact law at its contacts with surfaces and between links.
    ///
    /// Args:
    ///     law: a law like carom.Energetic(0.5, 0.2), or carom.PythonLaw(function, restitution, friction).
    ///     link: only at contacts of this link.
    ///     surface: only at contacts with this surface or second link.
    ///
    /// Raises:
    ///     ValueError: no contact of the scene is meant.
    #[pyo3(signature = (law, *, link=None, surface=None))]
    fn with_law(&self, law: Given, link: Option<&str>, surface: Option<&str>) -> PyResult<Self> {
        let law = GivenLaw::read(law)?;
        let mut scene = (*self.scene).clone();
        let mut met = false;
        for touch in &mut scene.simulation.touches {
            let other = touch.surface().or_else(|| touch.other_link());
            let meant = touch.limit_of().is_none()
                && link.is_none_or(|link| touch.link() == Some(link) || touch.other_link() == Some(link))
                && surface.is_none_or(|surface| other == Some(surface));
            if meant {
                touch.contact.law = law.of_contact();
                met = true;
            }
        }
        if !met {
            let names: Vec<&str> = self.scene.simulation.touches.iter().map(|touch| touch.name.as_str()).collect();
            let names = names.join(", ");
            return Err(PyValueError::new_err(format!("no contact of the scene is meant: its contacts are {names}")));
        }
        let mut other = self.other(scene);
        if law.is_python() {
            other.functions.laws.push(law);
        }
        Ok(other)
    }

    /// The same scene with motors that a function in Python drives, instead of the controllers of the scene.
    ///
    /// Args:
    ///     function: called as `function(time, q, qd)` with the time in s and arrays of shapes (nq,) and (nv,) of the whole chain
    ///         (`scene.chain`); returns the joint forces, shape (nv,), N m and N. The entries of floating and planar joints are
    ///         not used: no motor drives them.
    ///     rate: calls per second, from the start on; the forces are constant between the calls. None: the forces are a
    ///         continuous function of time and state. The integrator then calls the function some hundred to some thousand times
    ///         for each simulated second, also at states that it tries and rejects, so the function must not remember earlier
    ///         calls. A call costs some microseconds and holds the GIL.
    ///
    /// Raises:
    ///     TypeError: function cannot be called.
    ///     ValueError: a rate that is not positive.
    #[pyo3(signature = (function, *, rate=None))]
    fn with_controller(&self, function: Given, rate: Option<f64>) -> PyResult<Self> {
        let controller = PythonController::new(function, rate)?;
        let mut scene = (*self.scene).clone();
        (scene.simulation.drive, scene.simulation.after_impact) = (controller.drive(), None);
        let mut other = self.other(scene);
        other.functions.controller = Some(controller);
        Ok(other)
    }

    /// What a run models and what it leaves out: a dict of "joints", "kept" and "left_out" (dicts of what, choice, why) and
    /// "bounded" (dicts of what, choice, bound, of).
    ///
    /// Raises:
    ///     SimulationError, ChainError: an invalid mesh, a singular mass matrix at the start.
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let plan = py.detach(|| self.scene.plan()).map_err(raise)?;
        let dict = pythonize(py, &plan)?.cast_into::<PyDict>()?;
        dict.set_item("joints", Chain::from(plan.simulation.chain.clone()).joint_names())?;
        Ok(dict)
    }

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
        let sampling = Sampling { every: Some(sample.or(self.scene.sample).unwrap_or(SAMPLE)), dense: false };
        let rated = self.functions.controller.as_ref().and_then(|it| Some((it, it.rate()?)));
        let done = py.detach(|| {
            let plan = self.scene.plan()?;
            let (mut seen, duration) = (Vec::new(), self.scene.duration);
            let watch = &mut |it: Seen| seen.extend(crate::run::Told::of(&it));
            let summary = match rated {
                Some((controller, rate)) => controller.run((&plan, rate), duration, sampling, watch)?,
                None => plan.stream(duration, sampling, watch)?,
            };
            Ok((plan, seen, summary))
        });
        let (plan, seen, summary) = self.functions.pass(done)?;
        for warning in summary.warnings() {
            let text = std::ffi::CString::new(warning).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        Ok(Run::new(self.scene.clone(), plan, seen, summary))
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
        Ok(Session::new(self.functions.pass(session)?, self.functions.clone()))
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

    fn __repr__(&self) -> String {
        let (chain, contacts) = (self.scene.simulation.chain.name(), self.scene.simulation.touches.len());
        format!("<carom.Scene of '{chain}': {contacts} possible contacts, {} s>", self.scene.duration)
    }
}

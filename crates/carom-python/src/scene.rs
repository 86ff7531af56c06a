//! Scenes: read and planned.

use crate::array::{Array, Given, Maybe, count, list};
use crate::chain::{Chain, Origin, Owner};
use crate::controller::PythonController;
use crate::error::{exceptions, raise};
use crate::laws::GivenLaw;
use crate::pickle::{Parts, Pickled, Sources, fields, tuple};
use crate::text::{by_keys, changed_text, toml_text, written};
use crate::threads::left_behind;
use carom_sim::path::add;
use carom_sim::{Plan, Regulator, SimError, ToAccuracy};
use carom_study::tracked;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene: a robot, the surfaces around it, contact laws and run settings. Immutable.
///
/// Make one with `Scene.from_file`, `Scene.from_toml` or `Scene.from_dict`; the page "Scene keys" of the manual lists the keys.
#[pyclass(frozen, module = "carom")]
#[derive(Clone)]
pub struct Scene {
    pub scene: Arc<carom_sim::Scene>,
    /// What acts beside the keys.
    pub functions: Functions,
    sources: Arc<Sources>,
    changed: Changed,
}

/// What is not that of the text.
#[derive(Clone, Copy, Default)]
struct Changed {
    start: bool,
    duration: bool,
}

fields! { Changed { start, duration } }

/// The laws that a scene was given beside its keys, and the controller in Python.
#[derive(Clone, Default)]
pub struct Functions {
    laws: Vec<Arc<OwnLaw>>,
    pub controller: Option<PythonController>,
}

/// A law of `Scene.with_law` with its arguments.
struct OwnLaw {
    law: GivenLaw,
    object: Py<PyAny>,
    link: Option<String>,
    surface: Option<String>,
}

impl Functions {
    /// Whether nothing acts beside the keys.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty() && self.controller.is_none()
    }

    /// Calls per second of a controller that samples.
    pub fn rate(&self) -> Option<f64> {
        self.controller.as_ref().and_then(PythonController::rate)
    }

    /// Refuses a controller that samples, by what is asked.
    pub fn refuse_rate(&self, what: &str) -> PyResult<()> {
        match self.rate() {
            Some(rate) => Err(PyValueError::new_err(format!(
                "{what}: the controller of the scene has a rate, {rate} Hz, and what it does between its samples follows from no tolerance \
                 and has no derivatives: give it without a rate"
            ))),
            None => Ok(()),
        }
    }

    /// The result of a simulation, or the exception that a function has raised in it.
    ///
    /// # Errors
    /// The exception, or else that of the error of the simulation.
    pub fn pass<T>(&self, done: Result<T, SimError>) -> PyResult<T> {
        let controller = self.controller.as_ref().and_then(PythonController::raised);
        // All are taken, so that none is left for a later run.
        match self.laws.iter().filter_map(|own| own.law.raised()).chain(controller).reduce(|first, _| first) {
            Some(raised) => Err(raised),
            None => done.map_err(raise),
        }
    }
}

/// By its text, which is read again, and by what has been changed since: start, duration, laws and controller.
impl Owner for Scene {
    fn told<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Array<'py>)> {
        Ok(("Scene", self.write(py)?))
    }
}

/// A scene as the owner of the reduced chain of its plan.
pub struct Planned(pub Scene);

impl Owner for Planned {
    fn told<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Array<'py>)> {
        Ok(("Plan", self.0.write(py)?))
    }
}

impl Pickled for Scene {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let Self { scene, functions, sources, changed } = self;
        let laws = functions.laws.iter().map(|own| {
            tuple(py, [own.object.write(py)?, own.link.write(py)?, own.surface.write(py)?]).map(Bound::unbind)
        });
        let controller = functions.controller.as_ref();
        let controller = controller.map(|it| tuple(py, [it.function(py), it.rate().write(py)?]).map(Bound::unbind));
        tuple(
            py,
            [
                scene.text.write(py)?,
                sources.write(py)?,
                scene.q.write(py)?,
                scene.qd.write(py)?,
                scene.duration.write(py)?,
                changed.write(py)?,
                laws.collect::<PyResult<Vec<Py<PyAny>>>>()?.write(py)?,
                controller.transpose()?.write(py)?,
            ],
        )
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (py, mut parts) = (from.py(), Parts::of(from)?);
        let (text, sources): (String, Sources) = (parts.next()?, parts.next()?);
        let mut scene = carom_sim::Scene::from_toml(&text, &sources.folder).map_err(raise)?;
        sources.check(&Sources::of_text(sources.folder.clone(), &scene.files))?;
        (scene.q, scene.qd, scene.duration) = (parts.next()?, parts.next()?, parts.next()?);
        scene.files.splice(0..0, sources.file.clone());
        let mut scene = Self { changed: parts.next()?, ..Self::new(scene, sources) };
        for own in parts.next::<Vec<Py<PyAny>>>()? {
            let mut own = Parts::of(own.bind(py))?;
            let (law, link, surface): (Py<PyAny>, Option<String>, Option<String>) =
                (own.next()?, own.next()?, own.next()?);
            scene = scene.with_law(law.bind(py), link.as_deref(), surface.as_deref())?;
        }
        if let Some(own) = parts.next::<Option<Py<PyAny>>>()? {
            let mut own = Parts::of(own.bind(py))?;
            let function: Py<PyAny> = own.next()?;
            scene = scene.with_controller(function.bind(py), own.next()?)?;
        }
        Ok(scene)
    }
}

impl Scene {
    fn new(scene: carom_sim::Scene, sources: Sources) -> Self {
        let (functions, changed) = Default::default();
        Self { scene: Arc::new(scene), functions, sources: Arc::new(sources), changed }
    }

    fn of_text(py: Python<'_>, text: &str, folder: PathBuf) -> Result<Self, SimError> {
        let scene = py.detach(|| carom_sim::Scene::from_toml(text, &folder))?;
        let sources = Sources::of_text(folder, &scene.files);
        Ok(Self::new(scene, sources))
    }

    /// A scene of the text of a dict, whose keys messages name.
    fn of_keys(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        Self::of_text(py, text, folder).map_err(|error| match error {
            SimError::Scene { rule, .. } => {
                raise(SimError::Scene { file: "<dict>".into(), rule: by_keys(&rule, text) })
            }
            other => raise(other),
        })
    }

    /// The size of the number at the path of a key, as of [`carom_sim::Scene::with_number`], and the same scene with `change` added to it.
    ///
    /// # Errors
    /// As [`Scene::with_keys`]; a value that is no number.
    pub fn with_number(&self, py: Python<'_>, path: &str, change: f64) -> PyResult<(f64, Self)> {
        let mut keys = self.keys()?;
        let size = add(&mut keys, path, change).map_err(PyValueError::new_err)?;
        let text = written(&keys)?;
        Ok((size, self.with_text(py, &text)?))
    }

    /// The scene of other keys, with the laws and the controller of this one. A change of the keys that these make ineffective is refused.
    fn with_text(&self, py: Python<'_>, text: &str) -> PyResult<Self> {
        let of_keys = |text: &str| Self::of_keys(py, text, self.sources.folder.clone());
        let keyed = of_keys(text)?;
        if self.functions.is_empty() {
            return Ok(keyed);
        }
        let (before, after) = (of_keys(&written(&self.keys()?)?)?, keyed.clone().with_functions(py, &self.functions)?);
        let [was, is, acts] = [&before, &keyed, &after].map(|it| &it.scene.simulation);
        let laws = was.touches.iter().zip(&is.touches).zip(&acts.touches);
        let mut hidden = laws.filter(|((was, is), acts)| {
            was.name == is.name && was.contact.law != is.contact.law && acts.contact.law != is.contact.law
        });
        let refused = |what: &str, method: &str| {
            Err(PyValueError::new_err(format!(
                "the changed keys give {what}, and what {method} gave to the scene acts in place of it: change the keys first, then call \
                 {method}"
            )))
        };
        if let Some(((_, is), _)) = hidden.next() {
            return refused(&format!("{} another law", is.name), "with_law");
        }
        if self.functions.controller.is_some() && was.drive != is.drive {
            return refused("another controller", "with_controller");
        }
        Ok(after)
    }

    /// The keys, with the start and the duration that were given after reading.
    fn keys(&self) -> PyResult<toml::Table> {
        let mut keys: toml::Table =
            self.scene.text.parse().map_err(|e: toml::de::Error| PyValueError::new_err(e.to_string()))?;
        let numbers = |x: &[f64]| toml::Value::from(x.to_vec());
        if self.changed.start {
            let robot = keys.get_mut("robot").and_then(toml::Value::as_table_mut);
            let given = |robot: &toml::Table| robot.get("q").and_then(toml::Value::as_array).map(Vec::len);
            let robot = robot.filter(|robot| given(robot) == Some(self.scene.q.len()));
            let robot = robot.ok_or_else(|| {
                refuse("the start of several robots, or of one with segments, is not in keys of its own")
            })?;
            robot.remove("tip_velocity");
            robot.insert("q".into(), numbers(&self.scene.q));
            robot.insert("qd".into(), numbers(&self.scene.qd));
        }
        if self.changed.duration {
            let run = keys.entry("run").or_insert_with(|| toml::Table::new().into());
            if let Some(run) = run.as_table_mut() {
                run.insert("duration".into(), self.scene.duration.into());
            }
        }
        Ok(keys)
    }

    /// With the laws and the controller of another scene.
    fn with_functions(mut self, py: Python<'_>, other: &Functions) -> PyResult<Self> {
        for own in &other.laws {
            self = self.with_law(own.object.bind(py), own.link.as_deref(), own.surface.as_deref())?;
        }
        let Some(controller) = &other.controller else { return Ok(self) };
        self.with_controller(&controller.function(py), controller.rate())
    }

    fn other(&self, scene: carom_sim::Scene) -> Self {
        Self { scene: Arc::new(scene), ..self.clone() }
    }

    fn own_chain(&self) -> Chain {
        Chain::new(self.scene.simulation.chain.clone(), Origin::Of(Arc::new(self.clone())))
    }

    /// The scene with the tolerance that meets its accuracy, and its plan.
    ///
    /// # Errors
    /// `ValueError` for an accuracy and a controller with a rate; as [`carom_sim::Scene::to_accuracy`].
    pub fn planned(&self, py: Python<'_>) -> PyResult<(Self, Plan)> {
        if self.scene.accuracy.is_none() {
            let plan = py.detach(|| self.scene.plan());
            return Ok((self.clone(), self.functions.pass(plan)?));
        }
        if self.functions.rate().is_some() {
            return Err(PyValueError::new_err(
                "[run] accuracy: the scene has a controller with a rate, whose error does not follow from the tolerance: give tolerance",
            ));
        }
        let mut own = (*self.scene).clone();
        let met = left_behind(py, move |stop| {
            own.simulation.stop = Some(stop.clone());
            own.to_accuracy()
        })?;
        let ToAccuracy { mut scene, mut plan, .. } = self.functions.pass(met)?;
        (scene.simulation.stop, plan.simulation.stop) = (None, None);
        Ok((self.other(scene), plan))
    }
}

fn refuse(what: &str) -> PyErr {
    PyValueError::new_err(format!("{what}: take the dict of the scene before, and change its keys"))
}

getters! { Scene, self, py {
    /// The robot.
    chain: Chain = self.own_chain();
    /// The folder to which names of files in the keys are relative.
    folder: String = self.sources.folder.display().to_string();
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
        let scene = py.detach(|| carom_sim::Scene::from_file(&path)).map_err(raise)?;
        let sources = Sources::of_file(path, &scene.files);
        Ok(Self::new(scene, sources))
    }

    /// Reads a scene from the text of a scene file; file names in it are relative to `folder`, by default
    /// the working folder. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (text, folder=PathBuf::from(".")))]
    fn from_toml(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        Self::of_text(py, text, folder).map_err(raise)
    }

    /// Reads a scene from a dict with the keys of a scene file; file names in it are relative to `folder`, by default
    /// the working folder. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (keys, folder=PathBuf::from(".")))]
    fn from_dict(py: Python<'_>, keys: Given, folder: PathBuf) -> PyResult<Self> {
        Self::of_keys(py, &toml_text(keys)?, folder)
    }

    /// The keys of the scene, for `from_dict`; names of files in them are relative to `folder`, so that
    /// `Scene.from_dict(scene.to_dict(), folder=scene.folder)` is this scene.
    ///
    /// Raises:
    ///     ValueError: a law or a controller was given after reading, or another start to a scene of several robots or with segments:
    ///         no keys say it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        if !self.functions.is_empty() {
            return Err(refuse("no keys say a law of with_law or a function of with_controller"));
        }
        Ok(pythonize(py, &self.keys()?)?.cast_into()?)
    }

    /// The same scene with other keys: gains, gravity, coefficients, masses, whatever a scene file says.
    ///
    /// Args:
    ///     changes: values by the path of their key, such as {"run.gravity": [0, 0, -1.62], "contact.restitution": 0.8,
    ///         "surface[0].contact.friction": 0.1, "robot.mass": {"hand": 0.9}}. A dict as value changes the keys that it has, and keeps the
    ///         others; None takes a key out; any other value replaces what is there.
    ///
    /// Laws and the controller in Python, start and duration of this scene are kept; where a key is changed, it counts, and one that would not
    /// is an error.
    ///
    /// Raises:
    ///     SimulationError, UrdfError, StateError: as `from_dict`, with the path of the key.
    ///     ValueError: a path that leads nowhere; a start of several robots that is in no key; keys of a law or a controller that was given in
    ///         their place.
    fn with_keys(&self, py: Python<'_>, changes: Given) -> PyResult<Self> {
        let text = changed_text(self.keys()?, changes)?;
        self.with_text(py, &text)
    }

    /// The same scene from another start.
    ///
    /// Args:
    ///     q, qd: shapes (nq,) and (nv,); what is not given is kept.
    #[pyo3(signature = (q=None, qd=None))]
    fn with_start(&self, q: Maybe, qd: Maybe) -> PyResult<Self> {
        let chain = self.own_chain();
        let mut scene = (*self.scene).clone();
        if let Some(q) = q {
            scene.q = chain.q(q)?.single("q")?;
        }
        if let Some(qd) = qd {
            scene.qd = chain.v("qd", qd)?.single("qd")?;
        }
        chain.chain.check_state(&scene.q, &scene.qd).map_err(raise)?;
        let changed = Changed { start: true, ..self.changed };
        Ok(Self { changed, ..self.other(scene) })
    }

    /// The same scene with another duration, s.
    ///
    /// Raises:
    ///     SimulationError: a duration that is not positive and finite.
    fn with_duration(&self, duration: f64) -> PyResult<Self> {
        if !(duration > 0.0 && duration.is_finite()) {
            let why = format!("duration is {duration}: it must be positive and finite");
            return Err(exceptions::SimulationError::new_err(why));
        }
        let changed = Changed { duration: true, ..self.changed };
        Ok(Self { changed, ..self.other(carom_sim::Scene { duration, ..(*self.scene).clone() }) })
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
        let (object, law) = (law, GivenLaw::read(law)?);
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
            let those =
                if names.is_empty() { "it has none".to_owned() } else { format!("they are {}", names.join(", ")) };
            return Err(PyValueError::new_err(format!("law: link and surface name no contact of the scene: {those}")));
        }
        let mut other = self.other(scene);
        let (link, surface) = (link.map(str::to_owned), surface.map(str::to_owned));
        other.functions.laws.push(Arc::new(OwnLaw { law, object: object.clone().unbind(), link, surface }));
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

    /// Feedback along the motion of this scene, through its impacts: the gains of the linear-quadratic regulator.
    ///
    /// Args:
    ///     position, velocity, torque: deviations that cost the same: of each displacement (rad, m), each velocity (rad/s, m/s) and the
    ///         force of each motor (N m, N).
    ///     end: for how long a deviation lasts that costs what it costs at the end of the motion, s.
    ///     joints: names of those that have feedback; by default those with forces in the motion, or all.
    ///     rows: least number of rows of the table.
    ///     table: the name that the scene file gives its table.
    ///
    /// Returns:
    ///     A dict with the JSON keys of ``carom feedback --help``: rows, motors, impacts, growth; and scene, the text of a scene file with
    ///     the feedback, for the folder of this scene; and table, the text of its table (CSV).
    ///
    /// Raises:
    ///     SimulationError: a controller with feedback; a motion without derivatives; a deviation that is not positive.
    ///     ValueError: a law or a controller was given after reading.
    #[pyo3(signature = (*, position=0.01, velocity=0.1, torque=1.0, end=1.0, joints=None, rows=200, table="feedback.csv"))]
    fn feedback<'py>(
        &self,
        py: Python<'py>,
        position: f64,
        velocity: f64,
        torque: f64,
        end: f64,
        joints: Option<Vec<String>>,
        #[pyo3(from_py_with = count)] rows: usize,
        table: &str,
    ) -> PyResult<Array<'py>> {
        if !self.functions.is_empty() {
            return Err(refuse("no keys say a law of with_law or a function of with_controller"));
        }
        if joints.as_ref().is_some_and(Vec::is_empty) {
            return Err(PyValueError::new_err("joints is empty: name those with feedback, or leave it out"));
        }
        let joints = joints.unwrap_or_default();
        let folder = self.sources.folder.clone();
        let (scene, plan) = Self::of_keys(py, &written(&self.keys()?)?, folder.clone())?.planned(py)?;
        let regulator = Regulator { position, velocity, force: torque, end, rows, joints };
        let found = py.detach(|| tracked((&scene.scene, &plan), &regulator, (&folder, table))).map_err(raise)?;
        let answer = pythonize(py, &found)?;
        answer.set_item("scene", found.scene)?;
        answer.set_item("table", found.table)?;
        Ok(answer)
    }

    /// What a run models and what it leaves out: a dict of "joints", "kept" and "left_out" (dicts of what, choice, why) and
    /// "bounded" (dicts of what, choice, bound, of).
    ///
    /// Raises:
    ///     SimulationError, ChainError: an invalid mesh, a singular mass matrix at the start.
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (scene, plan) = self.planned(py)?;
        let dict = pythonize(py, &plan)?.cast_into::<PyDict>()?;
        let chain = Chain::new(plan.simulation.chain.clone(), Origin::Of(Arc::new(Planned(scene))));
        dict.set_item("joints", chain.joint_names())?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        let (chain, contacts) = (self.scene.simulation.chain.name(), self.scene.simulation.touches.len());
        format!("<carom.Scene of '{chain}': {contacts} possible contacts, {} s>", self.scene.duration)
    }
}

//! The class `Chain`: loading, names, limits, and the geometry of configurations.

use crate::array::{Array, Given, Maybe, Numbers, Rows, Target, count, list, numpy, rows, together};
use crate::batch::each_row;
use crate::error::{exceptions, raise};
use crate::order;
use crate::pickle::fields;
use carom_chain::urdf::{JointType, LoadOptions, Meshes, read_str};
use carom_chain::{ChainError, Coordinates, FrameId, Spatial, Workspace, input};
use pyo3::exceptions::{PyImportError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// A kinematic chain (a tree of links and joints) read from a URDF; immutable.
///
/// Make one with `Chain.from_urdf` or `Chain.from_robot_description`.
///
/// A state is an array q of shape (nq,) with joint velocities qd of shape (nv,); a batch has the shapes (B, nq) and (B, nv).
/// q and qd list the joints in the order of the file, an added floating base first. A floating joint has
/// q = x y z qx qy qz qw, and its qd is the linear, then the angular velocity of the child in child axes. Units are SI and
/// radians. Vectors and matrices of points are in world axes.
///
/// Batches are computed without the GIL and on all cores.
#[pyclass(frozen, module = "carom")]
pub struct Chain {
    pub chain: Arc<carom_chain::Chain>,
    origin: Arc<Origin>,
    /// Memory for single states, one for each thread that computes at the same time.
    pool: Mutex<Vec<Workspace<Spatial<f64>>>>,
}

/// What a chain was made from, to make it again from its pickle.
pub enum Origin {
    Urdf(Urdf),
    Uniform { links: usize, length: f64, mass: f64 },
    Of(Arc<dyn Owner>),
}

/// An object that has a chain.
pub trait Owner: Send + Sync {
    /// Its kind, and its pickle.
    ///
    /// # Errors
    /// Those of Python.
    fn told<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Array<'py>)>;
}

/// The text of a URDF and how it is read.
pub struct Urdf {
    text: String,
    /// The folder of the file, in which meshes are searched for.
    folder: Option<PathBuf>,
    floating: bool,
    meshes: bool,
    repair: bool,
    strict: bool,
    package_dirs: Vec<PathBuf>,
    rotor_inertia: BTreeMap<String, f64>,
    mass: BTreeMap<String, f64>,
    inertia: BTreeMap<String, [f64; 6]>,
}

fields! { Urdf { text, folder, floating, meshes, repair, strict, package_dirs, rotor_inertia, mass, inertia } }

impl Urdf {
    /// The chain of the text.
    ///
    /// # Errors
    /// Those of the text.
    pub fn chain(&self) -> Result<carom_chain::Chain, ChainError> {
        let options = self.options();
        let robot = read_str(&self.text, self.folder.as_deref(), &options)?;
        carom_chain::Chain::from_robot(robot, &options).with_rotors(&options)
    }

    fn options(&self) -> LoadOptions {
        LoadOptions {
            floating_base: self.floating,
            meshes: if self.meshes { Meshes::WhenUsed } else { Meshes::Ignored },
            strict: self.strict,
            repair: self.repair,
            package_dirs: self.package_dirs.clone(),
            rotor_inertia: self.rotor_inertia.clone(),
            mass: self.mass.clone(),
            inertia: self.inertia.clone(),
            ..LoadOptions::default()
        }
    }
}

impl Chain {
    pub fn new(chain: carom_chain::Chain, origin: Origin) -> Self {
        Self { chain: Arc::new(chain), origin: Arc::new(origin), pool: Mutex::default() }
    }

    /// What it was made from.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// The same chain.
    pub fn again(&self) -> Self {
        Self { chain: self.chain.clone(), origin: self.origin.clone(), pool: Mutex::default() }
    }

    /// The frame of this name.
    pub fn frame(&self, name: &str) -> PyResult<FrameId> {
        self.chain.frame(name).map_err(raise)
    }

    /// Calls `work` with memory for one state.
    pub fn with_workspace<R>(&self, work: impl FnOnce(&mut Workspace<Spatial<f64>>) -> R) -> R {
        let free = self.pool.lock().ok().and_then(|mut pool| pool.pop());
        let mut workspace = free.unwrap_or_else(|| self.chain.workspace());
        let result = work(&mut workspace);
        if let Ok(mut pool) = self.pool.lock() {
            pool.push(workspace);
        }
        result
    }

    /// Configurations: arrays (nq,) or (B, nq).
    pub fn q<'py>(&self, given: Given<'_, 'py>) -> PyResult<Rows<'py>> {
        self.named_q("q", given)
    }

    fn named_q<'py>(&self, what: &str, given: Given<'_, 'py>) -> PyResult<Rows<'py>> {
        Numbers::read(what, given)?.rows(what, self.chain.nq(), || self.layout())
    }

    /// Vectors of length nv: arrays (nv,) or (B, nv).
    pub fn v<'py>(&self, what: &str, given: Given<'_, 'py>) -> PyResult<Rows<'py>> {
        Numbers::read(what, given)?.rows(what, self.chain.nv(), || self.layout())
    }

    /// The joints with coordinates, for messages.
    fn layout(&self) -> String {
        let names = self.joint_names();
        match names.as_slice() {
            [first @ .., last] if first.len() > 20 => format!("joints {}, …, {last}", first[..20].join(", ")),
            names => format!("joints {}", names.join(", ")),
        }
    }

    /// Names of the joints with entries in q and qd.
    pub fn joint_names(&self) -> Vec<&str> {
        self.chain.moving_joints().map(|joint| joint.name.as_str()).collect()
    }

    /// One number for each entry of qd, of the joints of one degree of freedom; `other` for the others.
    fn limit(&self, of: impl Fn(&carom_chain::JointInfo) -> Option<f64>, other: f64) -> Vec<f64> {
        let mut limits = vec![other; self.chain.nv()];
        for joint in self.chain.moving_joints() {
            if let Coordinates::Own { v, .. } = &joint.coordinates
                && v.len() == 1
            {
                limits[v.start] = of(joint).unwrap_or(other);
            }
        }
        limits
    }
}

/// The argument `inertia`: six numbers for each link.
///
/// # Errors
/// `TypeError` for what is no dict of numbers; `StateError` for another number of them.
fn inertias(given: &Bound<'_, PyAny>) -> PyResult<BTreeMap<String, [f64; 6]>> {
    let given: BTreeMap<String, Vec<f64>> = given.extract()?;
    let six = |(link, numbers): (String, Vec<f64>)| match <[f64; 6]>::try_from(numbers) {
        Ok(numbers) => Ok((link, numbers)),
        Err(numbers) => Err(exceptions::StateError::new_err(format!(
            "inertia of '{link}' has {} numbers: give six, ixx, ixy, ixz, iyy, iyz, izz",
            numbers.len()
        ))),
    };
    given.into_iter().map(six).collect()
}

/// Writes into `out` the numbers that `work` makes of the rows of two arguments, `width` for each state.
fn of_two<'py>(
    py: Python<'py>,
    given: [(&str, &Rows<'py>); 2],
    (width, out): (usize, Maybe),
    work: impl Fn(&[f64], &[f64]) -> Result<Vec<f64>, ChainError> + Sync + Send,
) -> PyResult<Py<PyAny>> {
    let count = together(given)?;
    let mut target = Target::new(out, count, &[width])?;
    let [first, second] = given.map(|(_, rows)| rows.plain());
    let one = |(): &mut (), k: usize, out: &mut [f64]| {
        work(first.row(k), second.row(k)).map(|moved| out.copy_from_slice(&moved))
    };
    each_row(py, count, target.slice(), width, || (), one)?;
    target.finish(py)
}

getters! { Chain, self, py {
    /// Name of the robot.
    name: &str = self.chain.name();
    /// Length of q.
    nq: usize = self.chain.nq();
    /// Length of qd: the degrees of freedom.
    nv: usize = self.chain.nv();
    /// Names of the joints that have entries in q and qd, in their order.
    joints: Vec<&str> = self.joint_names();
    /// Names of the frames, one for each link, in the order of the file.
    frames: Vec<&str> = self.chain.frames().iter().map(|frame| frame.name.as_str()).collect();
    /// Sum of the masses of all links, kg.
    total_mass: f64 = self.chain.total_mass();
    /// Names of the links that move without mass. Dynamics are refused if there are any.
    massless_links: Vec<&str> = self.chain.massless_links();
    /// What loading has found odd in the file, one sentence each.
    warnings: Vec<String> = self.chain.report().warnings.clone();
    /// The changes that `repair` has made, one sentence each.
    repairs: Vec<String> = self.chain.report().repairs.iter().map(ToString::to_string).collect();
    /// Lower limits of the positions, shape (nv,), rad or m; -inf without a limit and for floating and planar joints.
    lower: Array<'py> = list(py, &self.limit(|joint| joint.limits.lower, f64::NEG_INFINITY))?;
    /// Upper limits of the positions, shape (nv,), rad or m; inf without a limit and for floating and planar joints.
    upper: Array<'py> = list(py, &self.limit(|joint| joint.limits.upper, f64::INFINITY))?;
    /// Limits of the speeds, shape (nv,), rad/s or m/s; inf without a limit.
    velocity_limit: Array<'py> = list(py, &self.limit(|joint| joint.limits.velocity, f64::INFINITY))?;
    /// Limits of the efforts, shape (nv,), N m or N; inf without a limit.
    effort_limit: Array<'py> = list(py, &self.limit(|joint| joint.limits.effort, f64::INFINITY))?;
} }

/// The folder of a package, for `$(find NAME)` of xacro.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn find_package(name: &str, folder: PathBuf, package_dirs: Vec<PathBuf>) -> PyResult<PathBuf> {
    carom_chain::urdf::find_package(name, Some(&folder), &package_dirs).map_err(raise)
}

#[pymethods]
impl Chain {
    /// Reads a URDF: the path of a file, or the text of one.
    ///
    /// Args:
    ///     source: path of a file, or a string that begins with "<".
    ///     floating: connects the root link to the world by a floating joint.
    ///     meshes: False leaves missing collision meshes out; True warns of them, and raises an error where one is used.
    ///     repair: changes the robot as little as needed to compute its dynamics; `repairs` lists the changes.
    ///     strict: raises an error for what is otherwise a warning.
    ///     package_dirs: folders in which packages (package://NAME/…) are searched for first.
    ///     rotor_inertia: inertias of motors' rotors reflected to their joints, N² I for the gear ratio N: a dict by joint, kg m² or
    ///         kg. They replace those of the file.
    ///     mass: masses of links instead of those of the file: a dict by link, kg. Rotational inertias change in proportion.
    ///     inertia: rotational inertias of links about their centres of mass, along the axes of the link, instead of those of the file: a dict by
    ///         link of ixx, ixy, ixz, iyy, iyz, izz, kg m².
    ///     xacro: arguments of a xacro file, a dict by name. A file that is xacro is expanded by the package `xacro` (pip install xacro), which
    ///         finds packages as carom does.
    ///
    /// Raises:
    ///     UrdfError: the file cannot be read or breaks a rule; the message names line, element, value and rule. A xacro file, and the
    ///         package `xacro` is not installed, or refuses it.
    #[staticmethod]
    #[pyo3(signature = (source, *, floating=false, meshes=true, repair=false, strict=false, package_dirs=Vec::new(), rotor_inertia=BTreeMap::new(), mass=BTreeMap::new(), inertia=BTreeMap::new(), xacro=None))]
    fn from_urdf(
        py: Python<'_>,
        source: Given,
        floating: bool,
        meshes: bool,
        repair: bool,
        strict: bool,
        package_dirs: Vec<PathBuf>,
        rotor_inertia: BTreeMap<String, f64>,
        mass: BTreeMap<String, f64>,
        #[pyo3(from_py_with = inertias)] inertia: BTreeMap<String, [f64; 6]>,
        xacro: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let absolute = |path: PathBuf| std::path::absolute(&path).unwrap_or(path);
        let package_dirs = package_dirs.into_iter().map(absolute).collect();
        let (text, folder) = (String::new(), None);
        let mut urdf =
            Urdf { text, folder, floating, meshes, repair, strict, package_dirs, rotor_inertia, mass, inertia };
        let options = urdf.options();
        let text = source
            .extract::<String>()
            .ok()
            .filter(|text| text.trim_start_matches('\u{feff}').trim_start().starts_with('<'));
        let chain = if let Some(text) = text {
            if xacro.is_some() {
                return Err(PyTypeError::new_err("xacro: a text is not expanded: give the path of a file"));
            }
            urdf.text = text;
            py.detach(|| carom_chain::Chain::from_urdf_str(&urdf.text, &options)).map_err(raise)?
        } else {
            let Ok(path) = source.extract::<PathBuf>() else {
                return Err(PyTypeError::new_err(
                    "source is neither a path nor a string: give the file or the text of a URDF",
                ));
            };
            urdf.folder = absolute(path.clone()).parent().map(PathBuf::from);
            let plain = xacro.is_none().then(|| py.detach(|| carom_chain::Chain::from_urdf_file_with(&path, &options)));
            match plain {
                Some(Ok(chain)) => {
                    urdf.text = input::read_text(&path, input::MOST_MIB)?;
                    chain
                }
                Some(Err(error)) if !matches!(error, ChainError::Xacro { .. }) => return Err(raise(error)),
                _ => {
                    let expand = py.import("carom._xacro")?.getattr("expand")?;
                    urdf.text = expand.call1((&path, xacro, &urdf.package_dirs))?.extract()?;
                    let chain = py.detach(|| urdf.chain());
                    chain.map_err(|error| raise(error.in_file(format!("{}, expanded by xacro", path.display()))))?
                }
            }
        };
        Ok(Self::new(chain, Origin::Urdf(urdf)))
    }

    /// Reads a robot of the package `robot_descriptions`, for example "panda_description", with the arguments that the package gives for
    /// a xacro file. The other arguments are those of `from_urdf`.
    ///
    /// Raises:
    ///     ImportError: the package is not installed, or has no robot of this name, or cannot download it.
    #[staticmethod]
    #[pyo3(signature = (name, *, floating=false, meshes=true, repair=false, strict=false, package_dirs=Vec::new(), rotor_inertia=BTreeMap::new(), mass=BTreeMap::new(), inertia=BTreeMap::new()))]
    fn from_robot_description(
        py: Python<'_>,
        name: &str,
        floating: bool,
        meshes: bool,
        repair: bool,
        strict: bool,
        mut package_dirs: Vec<PathBuf>,
        rotor_inertia: BTreeMap<String, f64>,
        mass: BTreeMap<String, f64>,
        #[pyo3(from_py_with = inertias)] inertia: BTreeMap<String, [f64; 6]>,
    ) -> PyResult<Self> {
        let refuse = |why: &str| PyImportError::new_err(format!("robot_descriptions.{name}: {why}"));
        py.import("robot_descriptions").map_err(|_| {
            refuse("the package robot_descriptions is not installed: pip install robot_descriptions, or give the file to from_urdf")
        })?;
        let module = py.import(format!("robot_descriptions.{name}")).map_err(|e| {
            refuse(&format!(
                "{e}; `python -m robot_descriptions list` prints the names; a robot that cannot be downloaded is read from a file, \
                 by from_urdf"
            ))
        })?;
        let (path, xacro) = match (module.getattr("URDF_PATH"), module.getattr("XACRO_PATH")) {
            (Ok(path), _) => (path, None),
            (_, Ok(path)) => {
                let arguments = module.getattr("XACRO_ARGS").ok().and_then(|it| it.cast_into::<PyDict>().ok());
                (path, Some(arguments.unwrap_or_else(|| PyDict::new(py))))
            }
            _ => return Err(refuse("it has no URDF: choose one with URDF_PATH or XACRO_PATH")),
        };
        if let Ok(package) = module.getattr("PACKAGE_PATH").and_then(|path| path.extract()) {
            package_dirs.push(package);
        }
        Self::from_urdf(py, &path, floating, meshes, repair, strict, package_dirs, rotor_inertia, mass, inertia, xacro)
    }

    /// A chain of equal uniform rods on hinges about z, straight along x at q = 0, with the frame "tip" at its end.
    ///
    /// Args:
    ///     links: number of rods, 1 or more.
    ///     length: of the whole chain, m.
    ///     mass: of the whole chain, kg.
    ///
    /// Raises:
    ///     ChainError: a number that is not positive.
    #[staticmethod]
    fn uniform(#[pyo3(from_py_with = count)] links: usize, length: f64, mass: f64) -> PyResult<Self> {
        let chain = carom_chain::uniform_chain(links, length, mass).map_err(raise)?;
        Ok(Self::new(chain, Origin::Uniform { links, length, mass }))
    }

    /// The joints of the file: a list of dicts with name, type, parent, child, the slices q and v of its entries (None for
    /// fixed and mimic joints), mimic (None, or joint, multiplier and offset), lower, upper, velocity, effort (None without a
    /// limit), damping and friction.
    #[getter]
    fn joint_table<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let slice =
            |range: &std::ops::Range<usize>| pyo3::types::PySlice::new(py, range.start as isize, range.end as isize, 1);
        let row = |joint: &carom_chain::JointInfo| {
            let (q, v, mimic) = match &joint.coordinates {
                Coordinates::Own { q, v } => (Some(slice(q)), Some(slice(v)), None),
                Coordinates::Follows { joint, multiplier, offset } => (None, None, Some((joint, *multiplier, *offset))),
                Coordinates::None => (None, None, None),
            };
            let limits = &joint.limits;
            Ok(dict! { py,
                "name": &joint.name, "type": joint.kind.name(), "parent": &joint.parent, "child": &joint.child,
                "q": q, "v": v, "mimic": mimic,
                "lower": limits.lower, "upper": limits.upper, "velocity": limits.velocity, "effort": limits.effort,
                "damping": joint.damping, "friction": joint.friction,
            })
        };
        self.chain.joints().iter().map(row).collect()
    }

    /// The configuration in which all coordinates are zero and quaternions are the identity, shape (nq,).
    fn neutral<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        list(py, &self.chain.zero_configuration())
    }

    /// Random configurations: uniform within the position limits of the joints, those of mimic joints included, within ±π rad or ±1 m
    /// without limits; floating joints within ±1 m and with a uniform rotation.
    ///
    /// Args:
    ///     rng: a numpy.random.Generator, or a seed of one.
    ///     size: None for one configuration of shape (nq,), or their number B for the shape (B, nq).
    ///
    /// Raises:
    ///     ChainError: limits of mimic joints that leave a joint no position.
    #[pyo3(signature = (rng=None, size=None))]
    fn random_configuration<'py>(
        &self,
        py: Python<'py>,
        rng: Maybe,
        #[pyo3(from_py_with = count)] size: Option<usize>,
    ) -> PyResult<Array<'py>> {
        let (nq, number) = (self.chain.nq(), size.unwrap_or(1));
        let rng = numpy(py)?.getattr("random")?.call_method1("default_rng", (rng,))?;
        let draw = |name: &str| Numbers::read(name, &rng.call_method1(name, ((number, nq),))?);
        let (uniform, normal) = (draw("random")?, draw("standard_normal")?);
        let mut out = vec![0.0; number * nq];
        let within = |share: f64, lower: f64, upper: f64| lower + share * (upper - lower);
        for (k, row) in out.chunks_exact_mut(nq.max(1)).enumerate() {
            let (uniform, normal) = (&uniform.slice()[k * nq..], &normal.slice()[k * nq..]);
            for joint in self.chain.moving_joints() {
                let Coordinates::Own { q, .. } = &joint.coordinates else { continue };
                let half = if matches!(joint.kind, JointType::Prismatic) { 1.0 } else { std::f64::consts::PI };
                let ends = match self.chain.limits_of(q.start) {
                    [Some(lower), Some(upper)] if lower > upper => {
                        let why =
                            "its limits and those of the joints that mimic it leave it no position: correct the limits";
                        return Err(exceptions::ChainError::new_err(format!("joint '{}': {why}", joint.name)));
                    }
                    [Some(lower), Some(upper)] => (lower, upper),
                    [Some(lower), None] => (lower, lower + 2.0 * half),
                    [None, Some(upper)] => (upper - 2.0 * half, upper),
                    [None, None] => (-half, half),
                };
                match q.len() {
                    1 => row[q.start] = within(uniform[q.start], ends.0, ends.1),
                    3 => {
                        let half = [1.0, 1.0, std::f64::consts::PI];
                        q.clone().zip(half).for_each(|(i, half)| row[i] = within(uniform[i], -half, half));
                    }
                    _ => {
                        let turn = q.start + 3..q.end;
                        let norm = normal[turn.clone()].iter().map(|x| x * x).sum::<f64>().sqrt();
                        (q.start..q.start + 3).for_each(|i| row[i] = within(uniform[i], -1.0, 1.0));
                        turn.for_each(|i| row[i] = normal[i] / norm);
                    }
                }
            }
        }
        rows(py, out, size, nq)
    }

    /// The configuration after moving from q with the constant velocity qd for dt seconds; shape of q.
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    #[pyo3(signature = (q, qd, dt=1.0, *, out=None))]
    fn integrate(&self, q: Given, qd: Given, dt: f64, out: Maybe) -> PyResult<Py<PyAny>> {
        if !dt.is_finite() {
            return Err(exceptions::StateError::new_err(format!("dt is {dt}: it must be finite")));
        }
        let given = [("q", &self.q(q)?), ("qd", &self.v("qd", qd)?)];
        of_two(q.py(), given, (self.chain.nq(), out), |q, qd| self.chain.integrate(q, qd, dt))
    }

    /// The rate of q at the velocity qd; shape of q. It is qd itself but for floating joints.
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    #[pyo3(signature = (q, qd, *, out=None))]
    fn q_rate(&self, q: Given, qd: Given, out: Maybe) -> PyResult<Py<PyAny>> {
        let given = [("q", &self.q(q)?), ("qd", &self.v("qd", qd)?)];
        let rate = |q: &[f64], qd: &[f64]| {
            let mut rate = vec![0.0; q.len()];
            self.chain.q_rate_into(q, qd, &mut rate);
            Ok(rate)
        };
        of_two(q.py(), given, (self.chain.nq(), out), rate)
    }

    /// The constant velocity that moves the chain from q_from to q_to in one second; shape (nv,) or (B, nv).
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    #[pyo3(signature = (q_from, q_to, *, out=None))]
    fn difference(&self, q_from: Given, q_to: Given, out: Maybe) -> PyResult<Py<PyAny>> {
        let given = [("q_from", &self.named_q("q_from", q_from)?), ("q_to", &self.named_q("q_to", q_to)?)];
        of_two(q_from.py(), given, (self.chain.nv(), out), |from, to| self.chain.difference(from, to))
    }

    /// The positions of joints of one degree of freedom that are outside their limits at q (shape (nq,)), one sentence each.
    fn outside_limits(&self, q: Given) -> PyResult<Vec<String>> {
        let q = self.q(q)?.single("q")?;
        Ok(self.chain.outside_limits(&q).into_iter().map(|(_, why)| why).collect())
    }

    /// q, or the pair (q, v), in the order and the coordinates of a Pinocchio model of the same file: children sorted by the
    /// names of their joints, continuous joints as (cos, sin), mimic joints with coordinates of their own.
    ///
    /// Raises:
    ///     ChainError: a planar joint, whose axis Pinocchio does not read.
    #[pyo3(signature = (q, v=None))]
    fn to_pinocchio(&self, q: Given, v: Maybe) -> PyResult<Py<PyAny>> {
        order::to_pinocchio(self, q, v)
    }

    /// The inverse of `to_pinocchio`; the positions of mimic joints are ignored.
    #[pyo3(name = "from_pinocchio", signature = (q, v=None))]
    fn of_pinocchio(&self, q: Given, v: Maybe) -> PyResult<Py<PyAny>> {
        order::from_pinocchio(self, q, v)
    }

    fn __repr__(&self) -> String {
        let (name, nq, nv, links) = (self.chain.name(), self.chain.nq(), self.chain.nv(), self.chain.frames().len());
        // Six digits: a sum of masses has more, of rounding.
        let mass = self.chain.total_mass();
        let mass = format!("{mass:.5e}").parse().unwrap_or(mass);
        format!("<carom.Chain '{name}': nq {nq}, nv {nv}, {links} links, {mass} kg>")
    }
}

//! Pickling, the same way for all classes that do not change: an object is written as tuples of its fields and read again.
//!
//! Results are written with their numbers, and not computed again. A chain, a scene and a study are written as the text that they
//! were read from, and read again.

use crate::array::Array;
use carom_impact::{Account, ImpactOutcome, Mode, Phase};
use carom_sim::{
    Broken, ChainImpact, ContactImpulse, ContactMode, ContactState, EnergyBooks, Event, EventKind, EventLoads,
    EventTime, ImpactBand, ImpactLoads, JointImpulse, Moment, NonUnique, RunError, Saltation, Sensitivity,
    SeveralImpact, StateError, Statistics, StepReason, StopReason, Summary,
};
use carom_study::Column;
use carom_study::fit::{Coefficient, Fit, FittedTo, Interval, Loss, Misfit, Score};
use nalgebra::{DMatrix, DVector, SVector};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::sync::Mutex;

/// What can be written as an object that Python pickles, and read again.
pub trait Pickled: Sized {
    /// The object.
    ///
    /// # Errors
    /// Those of Python.
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>>;

    /// What `write` has made the object of.
    ///
    /// # Errors
    /// `ValueError` for another object.
    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self>;
}

/// A name that lives as long as the program: each distinct name is kept once.
pub fn kept(name: String) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = names.get(name.as_str()) {
        return known;
    }
    let name: &'static str = name.leak();
    names.insert(name);
    name
}

/// The parts of a tuple.
pub struct Parts<'py>(std::vec::IntoIter<Bound<'py, PyAny>>);

impl<'py> Parts<'py> {
    /// # Errors
    /// `ValueError` for what is no tuple.
    pub fn of(from: &Bound<'py, PyAny>) -> PyResult<Self> {
        let parts = from.cast::<PyTuple>().map_err(|_| unknown())?;
        Ok(Self(parts.iter().collect::<Vec<_>>().into_iter()))
    }

    /// The next part.
    ///
    /// # Errors
    /// `ValueError` if there is none of this type.
    pub fn next<T: Pickled>(&mut self) -> PyResult<T> {
        T::read(&self.0.next().ok_or_else(unknown)?)
    }
}

fn unknown() -> PyErr {
    PyValueError::new_err("this was not pickled by this version of carom: compute it again, and pickle it anew")
}

/// A tuple of these parts.
pub fn tuple<'py, const N: usize>(py: Python<'py>, parts: [Array<'py>; N]) -> PyResult<Array<'py>> {
    Ok(PyTuple::new(py, parts)?.into_any())
}

/// Structs, by all of their fields.
macro_rules! fields {
    ($($type:ty { $($field:ident),* $(,)? })*) => { $(
        impl $crate::pickle::Pickled for $type {
            fn write<'py>(&self, py: pyo3::Python<'py>) -> pyo3::PyResult<crate::array::Array<'py>> {
                let Self { $($field),* } = self;
                $crate::pickle::tuple(py, [$($crate::pickle::Pickled::write($field, py)?),*])
            }

            fn read(from: &pyo3::Bound<'_, pyo3::PyAny>) -> pyo3::PyResult<Self> {
                let mut parts = $crate::pickle::Parts::of(from)?;
                Ok(Self { $($field: parts.next()?),* })
            }
        }
    )* };
}
pub(crate) use fields;

/// Enums, by the name of their variant and its fields.
macro_rules! variants {
    ($($type:ty { $($name:ident $({ $($field:ident),* })? $(($($part:ident),*))?),* $(,)? })*) => { $(
        impl $crate::pickle::Pickled for $type {
            fn write<'py>(&self, py: pyo3::Python<'py>) -> pyo3::PyResult<crate::array::Array<'py>> {
                let parts = match self { $(
                    Self::$name $({ $($field),* })? $(($($part),*))? => vec![
                        pyo3::types::PyString::new(py, stringify!($name)).into_any(),
                        $($($crate::pickle::Pickled::write($field, py)?,)*)? $($($crate::pickle::Pickled::write($part, py)?,)*)?
                    ],
                )* };
                Ok(pyo3::types::PyTuple::new(py, parts)?.into_any())
            }

            fn read(from: &pyo3::Bound<'_, pyo3::PyAny>) -> pyo3::PyResult<Self> {
                let mut parts = $crate::pickle::Parts::of(from)?;
                let name: String = parts.next()?;
                $(if name == stringify!($name) {
                    $($(let $field = parts.next()?;)*)? $($(let $part = parts.next()?;)*)?
                    return Ok(Self::$name $({ $($field),* })? $(($($part),*))?);
                })*
                Err($crate::pickle::unknown_variant(&name))
            }
        }
    )* };
}
pub(crate) use variants;

pub fn unknown_variant(name: &str) -> PyErr {
    PyValueError::new_err(format!(
        "'{name}' was not pickled by this version of carom: compute it again, and pickle it anew"
    ))
}

/// Types that Python has too.
macro_rules! plain {
    ($($type:ty)*) => { $(
        impl Pickled for $type {
            fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
                Ok(self.clone().into_pyobject(py)?.to_owned().into_any())
            }

            fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
                from.extract().map_err(|_| unknown())
            }
        }
    )* };
}
plain! { f64 usize u64 i64 bool String PathBuf BTreeMap<String, f64> BTreeMap<String, [f64; 6]> }

impl Pickled for &'static str {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        Ok(PyString::new(py, self).into_any())
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        String::read(from).map(kept)
    }
}

impl Pickled for Py<PyAny> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        Ok(self.bind(py).clone())
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(from.clone().unbind())
    }
}

impl Pickled for Py<PyDict> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        Ok(self.bind(py).clone().into_any())
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(from.cast::<PyDict>().map_err(|_| unknown())?.clone().unbind())
    }
}

impl<T: Pickled> Pickled for Vec<T> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let all: Vec<_> = self.iter().map(|one| one.write(py)).collect::<PyResult<_>>()?;
        Ok(PyList::new(py, all)?.into_any())
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        from.cast::<PyList>().map_err(|_| unknown())?.iter().map(|one| T::read(&one)).collect()
    }
}

impl<T: Pickled, const N: usize> Pickled for [T; N] {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let all: Vec<_> = self.iter().map(|one| one.write(py)).collect::<PyResult<_>>()?;
        Ok(PyList::new(py, all)?.into_any())
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::try_from(Vec::read(from)?).map_err(|_| unknown())
    }
}

impl<T: Pickled> Pickled for Option<T> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.as_ref().map_or_else(|| Ok(py.None().into_bound(py)), |one| one.write(py))
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        if from.is_none() { Ok(None) } else { T::read(from).map(Some) }
    }
}

impl<T: Pickled> Pickled for Box<T> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        T::write(self, py)
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        T::read(from).map(Box::new)
    }
}

impl<const D: usize> Pickled for SVector<f64, D> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        <[f64; D]>::from(*self).write(py)
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        <[f64; D]>::read(from).map(Self::from)
    }
}

impl Pickled for DVector<f64> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.as_slice().to_vec().write(py)
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        Vec::read(from).map(Self::from_vec)
    }
}

impl Pickled for DMatrix<f64> {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        tuple(py, [self.nrows().write(py)?, self.ncols().write(py)?, self.as_slice().to_vec().write(py)?])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let (rows, columns, entries): (usize, usize, Vec<f64>) = (parts.next()?, parts.next()?, parts.next()?);
        if rows.checked_mul(columns) != Some(entries.len()) {
            return Err(unknown());
        }
        Ok(Self::from_vec(rows, columns, entries))
    }
}

/// Where a scene or a study was read, and the contents of the files beside it.
pub struct Sources {
    /// The folder to which names of files are relative, absolute.
    pub folder: PathBuf,
    /// The file itself; `None` if it was a text.
    pub file: Option<PathBuf>,
    /// Each file that it names, with a hash of its contents.
    files: Vec<NamedFile>,
}

struct NamedFile {
    path: PathBuf,
    hash: u64,
}

impl Sources {
    /// Of a file with this path, which named `files`; it may be among them.
    pub fn of_file(path: PathBuf, files: &[PathBuf]) -> Self {
        let path = std::path::absolute(&path).unwrap_or(path);
        let folder = path.parent().map_or_else(PathBuf::new, PathBuf::from);
        let others: Vec<PathBuf> = files.get(1..).unwrap_or_default().to_vec();
        Self { file: Some(path), ..Self::of_text(folder, &others) }
    }

    /// Of a text in this folder, which named `files`.
    pub fn of_text(folder: PathBuf, files: &[PathBuf]) -> Self {
        let hash = |path: &PathBuf| {
            let mut hasher = DefaultHasher::new();
            std::fs::read(path).unwrap_or_default().hash(&mut hasher);
            NamedFile { path: path.clone(), hash: hasher.finish() }
        };
        Self {
            folder: std::path::absolute(&folder).unwrap_or(folder),
            file: None,
            files: files.iter().map(hash).collect(),
        }
    }

    /// Whether the files are those that `now` has read.
    ///
    /// # Errors
    /// `ValueError` that names the first one that is not.
    pub fn check(&self, now: &Self) -> PyResult<()> {
        let other = self.files.iter().zip(&now.files).find(|(then, now)| then.hash != now.hash);
        let Some((then, _)) = other else { return Ok(()) };
        let path = then.path.display();
        let message =
            format!("{path} has changed since this was pickled: read the scene or the study again, and pickle it anew");
        Err(PyValueError::new_err(message))
    }
}

fields! {
    Sources { folder, file, files }
    NamedFile { path, hash }
    ImpactOutcome<f64, 3> {
        law, impulse, u_minus, u_plus, energy_before, energy_after, energy_change, account,
    }
    Account<f64> { mode, normal_work, friction_work, newton, poisson, energetic, slip_end, slip_stop, flags }
    ChainImpact {
        qd_plus, impulse, u_minus, u_plus, energy_before, energy_after, drive_impulse, drive_work, mode, contact, flags,
    }
    ImpactBand { qd_plus, u_plus, impulse, exact, evaluations }
    Saltation { matrix, closing, time }
    SeveralImpact { qd_plus, impulses, u_minus, u_plus, energy_before, energy_after, residual, flags }
    Moment { time, q, qd }
    ContactImpulse { touch, point, impulse }
    ContactState { touch, mode, point, normal, gap, force, normal_force, flags }
    Event { time, kind, q, qd_minus, qd_plus, impulses, loads }
    EventLoads { impact, motors_minus, motors_plus }
    ImpactLoads { joint_impulse, through }
    JointImpulse { joint, force, moment }
    EnergyBooks { start, end, drive, resistance, impacts }
    Statistics {
        steps, rejections, evaluations, refinements, contact_steps, step_error, worst_residual, energy_gained,
        longest_step, non_unique_time, neglected_frictions, neglected_bound, neglected_depth,
    }
    Summary { last, mode, contacts, stop, events, statistics, energy }
    Sensitivity { names, last, last_by, rate, events, broken }
    EventTime { time, kinds, time_by }
    Broken { time, reason }
    RunError { tighter, last, samples, events, unknown }
    StateError { q, qd }
    Column { name, words, unit }
    Fit { to, law, loss, threshold, coefficients, train, test, each, notes, trials }
    Coefficient { name, value, low, high, interval }
    Misfit { number, trained, error, whole, early, least_in_cone, least }
    Score {
        count, mean, median, below_half, whole_mean, whole_median, early_mean, early_median, least_in_cone, least,
    }
}

variants! {
    Mode { Open, Stick, Slip, ReverseSlip }
    Phase { Compression, Restitution }
    ContactMode {
        Free, Sliding { touch }, Sticking { touch }, Latched { touch }, Pressing { touch, damping }, Several, Stepping,
    }
    StopReason { Duration, Events }
    StepReason { Asked, Face, Crowd, NoMode, Stiff }
    NonUnique { Distribution, Modes }
    EventKind {
        Impact { touch, hit },
        Several { touches, residual, flags },
        Latch { touch },
        Limit { touch, joint, impulse },
        Zeno { touch, impacts },
        Mode { mode },
        LiftOff { touch },
        Joint { joint, holds },
        Steps { reason },
        NonUnique { reason, touches },
        Rest,
    }
    FittedTo { Velocities, Trajectories }
    Interval { Profile, Bootstrap, Alike }
    Loss { Squares, Huber }
}

//! Fits of coefficients to measured impacts.

use crate::array::{Array, Numbers, array, count, shown, vector};
use crate::chain::Chain;
use crate::dynamics::offset;
use crate::error::{Raise, exceptions, raise};
use crate::pickle::fields;
use crate::threads::{halt, left_behind};
use carom_chain::FramePoint;
use carom_chain::urdf::LoadOptions;
use carom_study::fit::{
    ChainJump, Fit, FitError, FitOptions, Loss, MeasuredImpact, Score, fit_trajectories, fit_velocities,
};
use carom_study::{Horizon, RollOutOptions, Start, Tosses};
use nalgebra::{SMatrix, SVector};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The result of a fit.
#[pyclass(frozen, module = "carom", name = "Fit")]
pub struct FitResult {
    fit: Fit,
}

fields! { FitResult { fit } }

getters! { FitResult, self, py {
    /// What was fitted to: "velocities" or "trajectories".
    fitted_to: &'static str, "Literal['velocities', 'trajectories']" = self.fit.to.name();
    /// Name of the law.
    law: &str = &self.fit.law;
    /// Errors of the part that was fitted: a dict of "count", "mean", "median" (m/s for velocities), "below_half", "least" and
    /// "least_in_cone".
    train: Bound<'py, PyDict>, "dict[str, float | None]" = score(py, &self.fit.train)?;
    /// Errors of the rest, as `train`; None if nothing is left.
    test: Option<Bound<'py, PyDict>>, "dict[str, float | None] | None" = self.fit.test.as_ref().map(|test| score(py, test)).transpose()?;
    /// Error of each measurement, shape (N,).
    errors: Array<'py> = array(py, self.fit.each.iter().map(|one| one.error).collect(), &[self.fit.each.len()])?;
    /// Whether each measurement was fitted, a list of booleans.
    trained: Vec<bool> = self.fit.each.iter().map(|one| one.trained).collect();
    /// Notes for the reader, one sentence each.
    notes: Vec<String> = self.fit.notes.clone();
    /// Number of sets of coefficients that were evaluated.
    trials: usize = self.fit.trials;
} }

#[pymethods]
impl FitResult {
    /// The coefficients: a dict from "restitution", "friction" and, if asked for, "inertia scale" to dicts of "value", "low" and
    /// "high" (confidence interval) and "interval" (its method).
    #[getter]
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for it in &self.fit.coefficients {
            let one = dict! { py, "value": it.value, "low": it.low, "high": it.high, "interval": it.interval.name() };
            all.set_item(it.name, one)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        let one = |it: &carom_study::fit::Coefficient| format!("{} {} [{}, {}]", it.name, it.value, it.low, it.high);
        let all: Vec<String> = self.fit.coefficients.iter().map(one).collect();
        format!("<carom.Fit of {} to {}: {}>", self.fit.law, self.fit.to.name(), all.join(", "))
    }
}

fn score<'py>(py: Python<'py>, score: &Score) -> PyResult<Bound<'py, PyDict>> {
    Ok(dict! { py,
        "count": score.count, "mean": score.mean, "median": score.median, "below_half": score.below_half,
        "whole_mean": score.whole_mean, "whole_median": score.whole_median,
        "early_mean": score.early_mean, "early_median": score.early_median,
        "least": score.least, "least_in_cone": score.least_in_cone,
    })
}

/// Options of a fit as keywords.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options {
    law: String,
    loss: String,
    inertia: bool,
    max_friction: f64,
    train: f64,
    #[pyo3(from_py_with = count)]
    seed: u64,
    confidence: f64,
}

impl Options {
    fn all(&self) -> PyResult<FitOptions<'_>> {
        let loss = word_of("loss", &self.loss, &Loss::ALL, Loss::name)?;
        let Self { law, inertia, max_friction, train, seed, confidence, .. } = self;
        Ok(FitOptions {
            law,
            loss,
            inertia: *inertia,
            max_friction: *max_friction,
            train: *train,
            seed: *seed,
            confidence: *confidence,
        })
    }
}

/// Runs a fit with these options, which Ctrl-C ends.
fn fitted<E: Raise + Send + 'static>(
    py: Python<'_>,
    options: Options,
    work: impl FnOnce(&FitOptions, &AtomicBool) -> Result<Fit, E> + Send + 'static,
) -> PyResult<FitResult> {
    let fit = left_behind(py, move |stop| work(&options.all()?, stop).map_err(raise))?;
    Ok(FitResult { fit: fit? })
}

/// Makes an impact of D axes from H, u⁻ and u⁺.
type Make<const D: usize> =
    fn(SMatrix<f64, D, D>, SVector<f64, D>, SVector<f64, D>) -> Result<MeasuredImpact, FitError>;

fn of_numbers<const D: usize>(given: [&Numbers; 3], of: Make<D>) -> PyResult<Vec<MeasuredImpact>> {
    let [h, before, after] = given.map(Numbers::slice);
    let one = |k: usize| {
        let matrix = SMatrix::from_row_slice(&h[k * D * D..(k + 1) * D * D]);
        let vector = |all: &[f64]| SVector::from_column_slice(&all[k * D..(k + 1) * D]);
        of(matrix, vector(before), vector(after)).map_err(|e| Raise::raise(&e, &format!("impact {k}: ")))
    };
    (0..before.len() / D).map(one).collect()
}

/// Impacts by velocities at the contact.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct AtContact<'py> {
    delassus: Array<'py>,
    u_minus: Array<'py>,
    u_plus: Array<'py>,
}

/// Impacts by velocities of the joints of a robot.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct AtJoints<'py> {
    chain: Bound<'py, Chain>,
    q: Array<'py>,
    qd_minus: Array<'py>,
    qd_plus: Array<'py>,
    frame: String,
    point: Option<Array<'py>>,
    normal: Array<'py>,
}

/// Measured impacts, and the robot that they were measured at.
pub type Measured = (Vec<MeasuredImpact>, Option<Arc<carom_chain::Chain>>);

/// The impacts of a dict of [`AtContact`] or, with a chain, of [`AtJoints`].
///
/// # Errors
/// `StateError` for wrong shapes and numbers, `FitError` for impacts that are none.
pub fn measured(data: &Bound<'_, PyDict>) -> PyResult<Measured> {
    if data.contains("chain")? { at_joints(&data.extract()?) } else { Ok((at_contact(&data.extract()?)?, None)) }
}

fn at_contact(data: &AtContact) -> PyResult<Vec<MeasuredImpact>> {
    let h = Numbers::read("delassus", &data.delassus)?;
    let (before, after) = (Numbers::read("u_minus", &data.u_minus)?, Numbers::read("u_plus", &data.u_plus)?);
    let given = [&h, &before, &after];
    match (h.shape(), before.shape(), after.shape()) {
        ([n, 2, 2], [a, 2], [b, 2]) if n == a && n == b => of_numbers(given, MeasuredImpact::in_plane),
        ([n, 3, 3], [a, 3], [b, 3]) if n == a && n == b => of_numbers(given, MeasuredImpact::in_space),
        shapes => {
            let (h, before, after) = (shown(shapes.0), shown(shapes.1), shown(shapes.2));
            let message = format!(
                "delassus, u_minus and u_plus have the shapes {h}, {before} and {after}: (N, D, D), (N, D) and (N, D) with D = 2 or 3 \
                 are needed"
            );
            Err(exceptions::StateError::new_err(message))
        }
    }
}

fn at_joints(data: &AtJoints) -> PyResult<Measured> {
    let own = data.chain.get();
    let (q, before, after) = (own.q(&data.q)?, own.v("qd_minus", &data.qd_minus)?, own.v("qd_plus", &data.qd_plus)?);
    let point = FramePoint::new(own.frame(&data.frame)?, offset(data.point.as_ref())?);
    let normal = vector("normal", &data.normal)?.into();
    let count = crate::array::together([("q", &q), ("qd_minus", &before), ("qd_plus", &after)])?;
    let Some(count) = count else {
        return Err(PyTypeError::new_err(
            "q, qd_minus and qd_plus are one impact: give batches (N, nq), (N, nv), (N, nv)",
        ));
    };
    let (q, before, after) = (q.plain(), before.plain(), after.plain());
    let one = |k: usize| {
        let (q, qd_minus, qd_plus) = (q.row(k).to_vec(), before.row(k).to_vec(), after.row(k).to_vec());
        let jump = ChainJump { q, qd_minus, qd_plus, point, normal };
        MeasuredImpact::of_chain(&own.chain, &jump).map_err(|e| Raise::raise(&e, &format!("impact {k}: ")))
    };
    Ok(((0..count).map(one).collect::<PyResult<_>>()?, Some(own.chain.clone())))
}

/// Fits to single impacts: see `carom.fit`.
#[pyfunction]
pub fn fit_impacts(py: Python<'_>, data: &Bound<'_, PyDict>, options: &Bound<'_, PyDict>) -> PyResult<FitResult> {
    let (options, (impacts, chain)): (Options, _) = (options.extract()?, measured(data)?);
    fitted(py, options, move |options, stop| fit_velocities(&impacts, chain.as_deref(), options, &|_, _| halt(stop)))
}

/// # Errors
/// `FitError` for another word of the argument `what` than those of all.
pub fn word_of<T: Copy>(what: &str, word: &str, all: &[T], name: fn(T) -> &'static str) -> PyResult<T> {
    all.iter().copied().find(|it| name(*it) == word).ok_or_else(|| {
        let known: Vec<String> = all.iter().map(|it| format!("'{}'", name(*it))).collect();
        exceptions::FitError::new_err(format!("{what} is '{word}': it must be {}", known.join(" or ")))
    })
}

/// Fits to tosses: see `carom.fit`.
#[pyfunction]
pub fn fit_tosses(
    py: Python<'_>,
    folder: PathBuf,
    robot: Option<&str>,
    tolerance: f64,
    contact_step: f64,
    length: f64,
    start: &str,
    horizon: &str,
    options: &Bound<'_, PyDict>,
) -> PyResult<FitResult> {
    let options: Options = options.extract()?;
    let start = word_of("start", start, &Start::ALL, Start::name)?;
    let horizon = word_of("horizon", horizon, &Horizon::ALL, Horizon::name)?;
    let roll = RollOutOptions { tolerance, contact_step, length, start, horizon, ..RollOutOptions::default() };
    let tosses = py.detach(|| Tosses::read(&folder, robot, &LoadOptions::default())).map_err(raise)?;
    fitted(py, options, move |options, stop| fit_trajectories(&tosses, options, &roll, &|_, _| halt(stop)))
}

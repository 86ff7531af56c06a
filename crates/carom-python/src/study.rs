//! Impact maps of studies.

use crate::array::{self, Array, list};
use crate::batch::CHUNK;
use crate::chain::{Chain, Origin, Owner};
use crate::error::raise;
use crate::pickle::{Parts, Pickled, Sources, tuple};
use crate::table::Table;
use crate::text::{by_keys, toml_text};
use crate::threads::on_all_cores;
use carom_study::map_study::StudyError;
use carom_study::{Column, STUDY_KEY};
use carom_study::{NumberedRows, RowFile};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A study: an impact map over poses, approach angles, speeds, coefficients and laws. Immutable.
///
/// Make one with `Study.from_file`, `Study.from_toml` or `Study.from_dict`; the page "Study keys" of the manual lists the keys, the
/// columns and the classes.
#[pyclass(frozen, module = "carom")]
#[derive(Clone)]
pub struct Study {
    study: Arc<carom_study::map_study::Study>,
    sources: Arc<Sources>,
}

/// By its text, which is read again.
impl Owner for Study {
    fn told<'py>(&self, py: Python<'py>) -> PyResult<(&'static str, Array<'py>)> {
        Ok(("Study", Pickled::write(self, py)?))
    }
}

impl Pickled for Study {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        tuple(py, [self.study.text().to_owned().write(py)?, self.sources.write(py)?])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let (text, sources): (String, Sources) = (parts.next()?, parts.next()?);
        let study = carom_study::map_study::Study::from_toml(&text, &sources.folder).map_err(raise)?;
        sources.check(&Sources::of_text(sources.folder.clone(), &study.files))?;
        Ok(Self { study: Arc::new(study), sources: Arc::new(sources) })
    }
}

impl Study {
    pub fn its_chain(&self) -> &carom_chain::Chain {
        self.study.chain()
    }

    fn of_text(py: Python<'_>, text: &str, folder: PathBuf) -> Result<Self, StudyError> {
        let study = py.detach(|| carom_study::map_study::Study::from_toml(text, &folder))?;
        let sources = Sources::of_text(folder, &study.files);
        Ok(Self { study: Arc::new(study), sources: Arc::new(sources) })
    }

    /// The study in a file or a dict.
    fn read(py: Python<'_>, given: &Bound<'_, PyAny>, folder: PathBuf) -> PyResult<Self> {
        if let Ok(study) = given.cast::<Self>() {
            return Ok(study.get().clone());
        }
        if given.is_instance_of::<PyMapping>() {
            return Self::from_dict(py, given, folder);
        }
        match given.extract::<PathBuf>() {
            Ok(path) => Self::from_file(py, path),
            Err(_) => Err(PyTypeError::new_err("study is neither a Study, a path nor a dict")),
        }
    }
}

fn names(study: &carom_study::map_study::Study) -> Vec<&str> {
    study.columns().iter().map(|column| column.name.as_str()).collect()
}

/// Values of a row by the names of the columns; columns without a value are left out.
fn named<'py>(py: Python<'py>, columns: &[Column], row: &[f64]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (column, x) in columns.iter().zip(row).filter(|(_, x)| !x.is_nan()) {
        if column.words.is_empty() {
            dict.set_item(&column.name, *x)?;
        } else {
            dict.set_item(&column.name, column.spell(*x))?;
        }
    }
    Ok(dict)
}

getters! { Study, self, py {
    /// Names of the columns.
    columns: Vec<&str> = names(&self.study);
    /// Units of the columns: a dict; empty texts for words and dimensionless numbers.
    units: BTreeMap<&str, &str> = names(&self.study).into_iter().map(|name| (name, self.study.unit(name))).collect();
    /// The robot.
    chain: Chain = Chain::new(self.study.chain().clone(), Origin::Of(Arc::new(self.clone())));
    /// Warnings, one sentence each.
    warnings: Vec<String> = self.study.warnings.clone();
} }

#[pymethods]
impl Study {
    /// Reads a study file (TOML) and its robot.
    ///
    /// Raises:
    ///     StudyError: a key or a value that breaks a rule; the message names file, key, value and rule.
    ///     UrdfError: an invalid robot.
    #[staticmethod]
    fn from_file(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let study = py.detach(|| carom_study::map_study::Study::from_file(&path)).map_err(raise)?;
        let sources = Sources::of_file(path, &study.files);
        Ok(Self { study: Arc::new(study), sources: Arc::new(sources) })
    }

    /// Reads a study from the text of a study file; file names in it are relative to `folder`. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (text, folder=PathBuf::from(".")))]
    fn from_toml(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        Self::of_text(py, text, folder).map_err(raise)
    }

    /// Reads a study from a dict with the keys of a study file; file names in it are relative to `folder`. Errors as `from_file`.
    #[staticmethod]
    #[pyo3(signature = (keys, folder=PathBuf::from(".")))]
    fn from_dict(py: Python<'_>, keys: &Bound<'_, PyAny>, folder: PathBuf) -> PyResult<Self> {
        let text = toml_text(keys)?;
        Self::of_text(py, &text, folder).map_err(|error| match error {
            StudyError::File { rule, .. } => {
                raise(StudyError::File { file: "<dict>".into(), rule: by_keys(&rule, &text) })
            }
            other => raise(other),
        })
    }

    /// Number of rows.
    fn __len__(&self) -> usize {
        self.study.rows() as usize
    }

    /// The axes that vary, in the order of the rows: a list of pairs of a name and the number of its values. The last axis varies
    /// fastest.
    #[getter]
    fn axes(&self) -> Vec<(&str, u64)> {
        let varying = self.study.axes().iter().filter(|axis| axis.varies());
        varying.map(|axis| (axis.name.as_str(), axis.count())).collect()
    }

    /// Computes the whole map, or the rows from `start` up to `stop`, as a Table in memory. Ctrl-C ends it.
    #[pyo3(signature = (start=0, stop=None))]
    fn table(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = array::count)] start: u64,
        #[pyo3(from_py_with = array::count)] stop: Option<u64>,
    ) -> PyResult<Table> {
        let (study, columns) = (&*self.study, self.study.columns().to_vec());
        let (width, all) = (columns.len(), study.rows());
        let end = stop.unwrap_or(all).min(all).max(start.min(all));
        let count = usize::try_from(end - start.min(all)).unwrap_or(usize::MAX);
        let rows = on_all_cores(py, |stop| {
            let mut rows = vec![0.0; count * width];
            let pieces = rows.par_chunks_mut(CHUNK * width).enumerate().with_max_len(4);
            pieces.for_each_init(
                || study.evaluator(),
                |evaluator, (c, rows)| {
                    for (k, row) in rows.chunks_exact_mut(width).enumerate() {
                        if stop.load(Ordering::Relaxed) {
                            break;
                        }
                        evaluator.row(start + (c * CHUNK + k) as u64, row);
                    }
                },
            );
            rows
        })?;
        Ok(Table::of_rows(columns, &rows).with_text(STUDY_KEY, study.text()))
    }

    /// Computes the map into a file in constant memory, as CSV or Parquet by the ending of the name. Ctrl-C or a full disk leaves
    /// a partial file, from which resume=True continues.
    ///
    /// Raises:
    ///     StudyError: the file cannot be written, another process writes it, or the partial file cannot be continued.
    #[pyo3(signature = (path, *, resume=false))]
    fn write(&self, py: Python<'_>, path: PathBuf, resume: bool) -> PyResult<()> {
        let file = RowFile { path, rows: 0..self.study.rows(), resume };
        let study = &*self.study;
        on_all_cores(py, |stop| study.write(&file, &|_| {}, stop))?.map(drop).map_err(raise)
    }

    /// One column of the map as a picture, the text of an SVG; log=True: its numbers on a logarithmic scale.
    #[pyo3(signature = (column, *, log=false))]
    fn svg(&self, py: Python<'_>, column: &str, log: bool) -> PyResult<String> {
        let study = &*self.study;
        on_all_cores(py, |_| study.picture(column, log))?.map_err(raise)
    }

    /// The best rows under the conditions in [advise] of the study: a dict of "column", "goal", "fulfil" (number of rows that
    /// fulfil them), "best_median_worst" (or None) and "best", a list of dicts of "row", "q" (nq,), "values" and, for a redundant
    /// arm, "self_motion" (q and values at the best pose along its self-motion, or None). The rows of "best" are local optima of the
    /// map: those without a better neighbour on an axis of numbers.
    ///
    /// Raises:
    ///     StudyError: a study without [advise].
    fn advise<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (study, columns) = (&*self.study, self.study.columns());
        let advice = on_all_cores(py, |_| study.advise())?.map_err(raise)?;
        let pose = |q: &[f64]| list(py, q);
        let mut best = Vec::new();
        for it in &advice.best {
            let moved =
                it.self_motion.as_ref().map(|(q, row)| -> PyResult<_> { Ok((pose(q)?, named(py, columns, row)?)) });
            best.push(dict! { py,
                "row": it.index,
                "q": pose(&it.q)?,
                "values": named(py, columns, &it.row)?,
                "self_motion": moved.transpose()?,
            });
        }
        Ok(dict! { py,
            "column": &advice.column,
            "goal": if advice.maximise { "maximise" } else { "minimise" },
            "fulfil": advice.fulfil,
            "best_median_worst": advice.spread.map(|[a, b, c]| (a, b, c)),
            "best": best,
        })
    }

    fn __repr__(&self) -> String {
        format!("<carom.Study: {} rows of {}>", self.study.rows(), names(&self.study).join(", "))
    }
}

/// The impact map of a study.
///
/// Args:
///     study: a Study, the path of a study file, or a dict with its keys.
///     out: a file (X.csv or X.parquet) that is written in constant memory; None gives a Table in memory.
///     folder: the folder to which file names in a dict are relative.
///
/// Returns:
///     A Table, or None with `out`.
///
/// Raises:
///     StudyError, UrdfError: as Study.from_file and Study.write.
#[pyfunction]
#[pyo3(signature = (study, out=None, *, folder=PathBuf::from(".")))]
pub fn map(py: Python<'_>, study: &Bound<'_, PyAny>, out: Option<PathBuf>, folder: PathBuf) -> PyResult<Option<Table>> {
    let study = Study::read(py, study, folder)?;
    match out {
        Some(path) => study.write(py, path, false).map(|()| None),
        None => study.table(py, 0, None).map(Some),
    }
}

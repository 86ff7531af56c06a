//! Numbers of NumPy as slices, and slices as arrays of NumPy.
//!
//! A state is an array `(n,)`, a batch `(B, n)`. Arrays of `float64` that are C-contiguous are read in place, others are
//! copied: other numbers, strides, lists. An array must not be written by another thread while a function reads it.

use crate::error::exceptions::StateError;
use numpy::{
    IntoPyArray, PyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArrayMethods,
};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

/// The module `numpy`.
pub fn numpy(py: Python<'_>) -> PyResult<&Bound<'_, PyModule>> {
    static NUMPY: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    NUMPY.get_or_try_init(py, || Ok(py.import("numpy")?.unbind())).map(|module| module.bind(py))
}

/// A whole number that is not negative, or none: Python's own OverflowError would not name the argument.
///
/// # Errors
/// `TypeError` for other numbers.
pub fn count<'py, T: FromPyObjectOwned<'py>>(given: &Bound<'py, PyAny>) -> PyResult<T> {
    let why: PyErr = match given.extract::<T>() {
        Ok(number) => return Ok(number),
        Err(why) => why.into(),
    };
    if why.is_instance_of::<PyOverflowError>(given.py()) {
        return Err(PyTypeError::new_err(format!("{given} is out of range: give a whole number that is not negative")));
    }
    Err(why)
}

/// Numbers with the shape that they had in Python.
pub struct Numbers<'py> {
    shape: Vec<usize>,
    held: Held<'py>,
}

enum Held<'py> {
    Own(Vec<f64>),
    Borrowed(PyReadonlyArrayDyn<'py, f64>),
}

/// Up to this number of entries a copy costs less than a borrow.
const SMALL: usize = 64;

impl<'py> Numbers<'py> {
    /// Reads an array, or anything that `numpy.asarray` makes one of.
    ///
    /// # Errors
    /// `TypeError` for entries that are not real numbers.
    pub fn read(what: &str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        match given.cast::<PyArrayDyn<f64>>() {
            Ok(array) => Self::of(what, array),
            Err(_) => Self::of(what, &converted(what, given)?),
        }
    }

    fn of(what: &str, array: &Bound<'py, PyArrayDyn<f64>>) -> PyResult<Self> {
        let shape = array.shape().to_vec();
        if !(array.is_c_contiguous() && array.is_aligned()) {
            let whole = array.call_method1(intern!(array.py(), "copy"), (intern!(array.py(), "C"),))?;
            return Self::of(what, whole.cast::<PyArrayDyn<f64>>()?);
        }
        if array.len() <= SMALL {
            return Ok(Self { shape, held: Held::Own(array.to_vec()?) });
        }
        let busy = |e| StateError::new_err(format!("{what}: {e}; is it the array that the result is written to?"));
        let read = array.try_readonly().map_err(busy)?;
        // Its layout is fixed while it is borrowed.
        read.as_slice()?;
        Ok(Self { shape, held: Held::Borrowed(read) })
    }

    /// The entries in the order of C.
    pub fn slice(&self) -> &[f64] {
        match &self.held {
            Held::Own(numbers) => numbers,
            Held::Borrowed(array) => array.as_slice().unwrap_or_default(),
        }
    }

    /// The shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The single state or the batch of states of `width` numbers. `layout`: the meaning of the numbers, for messages.
    ///
    /// # Errors
    /// `StateError` for another shape.
    pub fn rows(self, what: &str, width: usize, layout: impl Fn() -> String) -> PyResult<Rows<'py>> {
        let count = match self.shape[..] {
            [n] if n == width => None,
            [count, n] if n == width => Some(count),
            _ => {
                let shape = shown(&self.shape);
                return Err(StateError::new_err(format!(
                    "{what} has the shape {shape}: ({width},) for one state or (B, {width}) for a batch is needed ({})",
                    layout()
                )));
            }
        };
        Ok(Rows { numbers: self, width, count })
    }
}

impl<'py> Numbers<'py> {
    /// One number, or one for each state.
    ///
    /// # Errors
    /// `StateError` for another shape than () or (B,).
    pub fn scalars(self, what: &str) -> PyResult<Rows<'py>> {
        let count = match self.shape[..] {
            [] => None,
            [count] => Some(count),
            _ => {
                let shape = shown(&self.shape);
                return Err(StateError::new_err(format!(
                    "{what} has the shape {shape}: a number, or (B,) for a batch, is needed"
                )));
            }
        };
        Ok(Rows { numbers: self, width: 1, count })
    }
}

/// A shape as Python writes it.
pub fn shown(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// `given` as an array of `float64`.
fn converted<'py>(what: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let py = given.py();
    let refuse =
        |found: String| PyTypeError::new_err(format!("{what} is {found}: give an array of real numbers (float64)"));
    let array =
        numpy(py)?.call_method1(intern!(py, "asarray"), (given,)).map_err(|e| refuse(format!("no array: {e}")))?;
    let dtype = array.getattr(intern!(py, "dtype"))?;
    let kind: String = dtype.getattr(intern!(py, "kind"))?.extract()?;
    if !["b", "i", "u", "f"].contains(&kind.as_str()) {
        return Err(refuse(format!("an array of {dtype}")));
    }
    let named = PyDict::new(py);
    named.set_item(intern!(py, "copy"), false)?;
    let array = array.call_method(intern!(py, "astype"), (intern!(py, "float64"),), Some(&named))?;
    Ok(array.cast_into::<PyArrayDyn<f64>>()?)
}

/// One state or a batch of states.
pub struct Rows<'py> {
    numbers: Numbers<'py>,
    width: usize,
    /// `None` for one state.
    count: Option<usize>,
}

impl Rows<'_> {
    /// Number of states of a batch; `None` for one state.
    pub fn count(&self) -> Option<usize> {
        self.count
    }

    /// The numbers of one state.
    ///
    /// # Errors
    /// `StateError` for a batch.
    pub fn single(&self, what: &str) -> PyResult<Vec<f64>> {
        match self.count {
            None => Ok(self.numbers.slice().to_vec()),
            Some(_) => {
                Err(StateError::new_err(format!("{what} is a batch: one state is needed, of shape ({},)", self.width)))
            }
        }
    }

    /// The states as slices, without Python.
    pub fn plain(&self) -> Plain<'_> {
        Plain { numbers: self.numbers.slice(), width: self.width, one: self.count.is_none() }
    }
}

/// States as slices. A single state serves every place of a batch.
#[derive(Clone, Copy)]
pub struct Plain<'a> {
    numbers: &'a [f64],
    width: usize,
    one: bool,
}

impl<'a> Plain<'a> {
    /// State `k`.
    pub fn row(&self, k: usize) -> &'a [f64] {
        let start = if self.one { 0 } else { k * self.width };
        &self.numbers[start..start + self.width]
    }
}

/// Number of states of several arguments: that of the batches among them, which must agree; `None` if all are single.
///
/// # Errors
/// `StateError` for batches of different lengths.
pub fn together<'a, 'py: 'a>(all: impl IntoIterator<Item = (&'a str, &'a Rows<'py>)>) -> PyResult<Option<usize>> {
    let mut batches = all.into_iter().filter_map(|(what, rows)| Some((what, rows.count?)));
    let Some((first, count)) = batches.next() else { return Ok(None) };
    match batches.find(|(_, other)| *other != count) {
        None => Ok(Some(count)),
        Some((what, other)) => {
            Err(StateError::new_err(format!("{first} has {count} states but {what} has {other}: give the same number")))
        }
    }
}

/// An array.
pub type Array<'py> = Bound<'py, PyAny>;

/// An argument of a method, and one that may be missing.
pub type Given<'a, 'py> = &'a Bound<'py, PyAny>;
pub type Maybe<'a, 'py> = Option<Given<'a, 'py>>;

/// The array of one axis of these entries.
pub fn list<'py>(py: Python<'py>, numbers: &[f64]) -> PyResult<Array<'py>> {
    array(py, numbers.to_vec(), &[numbers.len()])
}

/// The array of rows of `width` entries, or of one row without a `count`.
pub fn rows<'py>(py: Python<'py>, numbers: Vec<f64>, count: Option<usize>, width: usize) -> PyResult<Array<'py>> {
    array(py, numbers, &count.into_iter().chain([width]).collect::<Vec<_>>())
}

/// The array of these entries.
pub fn array<'py>(py: Python<'py>, numbers: Vec<f64>, shape: &[usize]) -> PyResult<Array<'py>> {
    let flat = numbers.into_pyarray(py);
    if let [n] = shape
        && *n == flat.len()
    {
        return Ok(flat.into_any());
    }
    Ok(flat.reshape(shape.to_vec())?.into_any())
}

/// The array of one byte each.
pub fn bytes<'py>(py: Python<'py>, numbers: Vec<u8>) -> Bound<'py, PyAny> {
    PyArray::from_vec(py, numbers).into_any()
}

/// Where results are written: the caller's array, or a new one.
pub struct Target<'py> {
    shape: Vec<usize>,
    given: Option<(Bound<'py, PyAny>, PyReadwriteArrayDyn<'py, f64>)>,
    new: Vec<f64>,
}

impl<'py> Target<'py> {
    /// For results of the shape `each` for every state.
    ///
    /// # Errors
    /// `TypeError` or `StateError` for an `out` that does not fit.
    pub fn new(out: Option<&Bound<'py, PyAny>>, count: Option<usize>, each: &[usize]) -> PyResult<Self> {
        let shape: Vec<usize> = count.into_iter().chain(each.iter().copied()).collect();
        let Some(given) = out else {
            let new = vec![0.0; shape.iter().product()];
            return Ok(Self { shape, given: None, new });
        };
        let refuse = |why: String| {
            StateError::new_err(format!(
                "out {why}: a C-contiguous, writeable float64 array of shape {} is needed",
                shown(&shape)
            ))
        };
        let Ok(array) = given.cast::<PyArrayDyn<f64>>() else {
            return Err(PyTypeError::new_err("out is not an array of float64: make one with numpy.empty"));
        };
        if array.shape() != shape {
            return Err(refuse(format!("has the shape {}", shown(array.shape()))));
        }
        if !array.is_c_contiguous() {
            return Err(refuse("is not C-contiguous".into()));
        }
        let mut write = array.try_readwrite().map_err(|e| refuse(format!("cannot be written: {e}")))?;
        if write.as_slice_mut().is_err() {
            return Err(refuse("is not aligned".into()));
        }
        Ok(Self { shape, given: Some((given.clone(), write)), new: Vec::new() })
    }

    /// The entries.
    pub fn slice(&mut self) -> &mut [f64] {
        match &mut self.given {
            Some((_, write)) => write.as_slice_mut().unwrap_or_default(),
            None => &mut self.new,
        }
    }

    /// The array; a number for results without axes.
    pub fn finish(self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        match self.given {
            Some((given, _)) => Ok(given.unbind()),
            None if self.shape.is_empty() => Ok(self.new[0].into_pyobject(py)?.into_any().unbind()),
            None => Ok(array(py, self.new, &self.shape)?.unbind()),
        }
    }
}

/// A vector for all states, or one for each.
///
/// # Errors
/// `StateError` for another shape than (3,) or (B, 3).
pub fn vectors<'py>(what: &str, given: &Bound<'py, PyAny>, layout: &str) -> PyResult<Rows<'py>> {
    let numbers = match given.extract::<(f64, f64, f64)>() {
        Ok((x, y, z)) => Numbers { shape: vec![3], held: Held::Own(vec![x, y, z]) },
        Err(_) => Numbers::read(what, given)?,
    };
    numbers.rows(what, 3, || layout.to_owned())
}

/// Three numbers of a vector.
///
/// # Errors
/// `StateError` for another number of them, and for numbers that are not finite.
pub fn vector(what: &str, given: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let numbers = match given.extract::<(f64, f64, f64)>() {
        Ok(numbers) => numbers.into(),
        Err(_) => {
            let numbers = Numbers::read(what, given)?;
            <[f64; 3]>::try_from(numbers.slice()).map_err(|_| {
                StateError::new_err(format!("{what} has the shape {}: 3 numbers are needed", shown(numbers.shape())))
            })?
        }
    };
    match numbers.iter().find(|x| !x.is_finite()) {
        Some(x) => Err(StateError::new_err(format!("{what} has the number {x}: it must be finite"))),
        None => Ok(numbers),
    }
}

//! Tables: columns of numbers and of words, for NumPy, Pandas, Polars and whatever reads the Arrow C stream interface.

use crate::array::{Array, Maybe, list, numpy};
use crate::error::raise;
use crate::laws::texts;
use crate::notebook;
use crate::pickle::fields;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, RecordBatchIterator, StringArray};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use carom_study::Column;
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use std::path::PathBuf;
use std::sync::Arc;

/// A table of named columns.
///
/// `table["name"]` is a column as an array; `numpy`, `to_pandas` and `to_polars` convert the whole table, as does any library that
/// reads `__arrow_c_stream__` (pyarrow.table(table), duckdb, …).
#[pyclass(frozen, module = "carom")]
pub struct Table {
    columns: Vec<Column>,
    /// The numbers of each column; in a column of words their indices, NaN for the empty word.
    values: Vec<Vec<f64>>,
    /// Key and text of the scene or study, for the metadata of Parquet files.
    source: Option<Source>,
}

/// Key and text of a scene or a study.
struct Source {
    key: &'static str,
    text: String,
}

fields! {
    Table { columns, values, source }
    Source { key, text }
}

impl Table {
    pub fn new(columns: Vec<Column>) -> Self {
        let values = vec![Vec::new(); columns.len()];
        Self { columns, values, source: None }
    }

    /// The same table with the text of the scene or study that it is from.
    pub fn with_text(self, key: &'static str, text: &str) -> Self {
        Self { source: Some(Source { key, text: text.to_owned() }), ..self }
    }

    /// Appends a row: a number for each column.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>) {
        self.values.iter_mut().zip(row).for_each(|(column, x)| column.push(x));
    }

    /// The table of rows that are stored one after another.
    pub fn of_rows(columns: Vec<Column>, rows: &[f64]) -> Self {
        let width = columns.len().max(1);
        let values = (0..columns.len()).map(|c| rows.iter().skip(c).step_by(width).copied().collect()).collect();
        Self { columns, values, source: None }
    }

    fn find(&self, name: &str) -> PyResult<usize> {
        self.columns.iter().position(|column| column.name == name).ok_or_else(|| {
            PyKeyError::new_err(format!("no column is named '{name}': the columns are {}", self.names().join(", ")))
        })
    }

    fn names(&self) -> Vec<&str> {
        self.columns.iter().map(|column| column.name.as_str()).collect()
    }

    fn column<'py>(&self, py: Python<'py>, c: usize) -> PyResult<Array<'py>> {
        let (column, values) = (&self.columns[c], &self.values[c]);
        if column.words.is_empty() {
            return list(py, values);
        }
        if values.is_empty() {
            return numpy(py)?.call_method1("array", (Vec::<String>::new(), "str"));
        }
        // The empty word is the last one, where the index -1 leads.
        let words: Vec<&str> = column.words.iter().map(String::as_str).chain([""]).collect();
        let places: Vec<i64> = values.iter().map(|x| if x.is_nan() { -1 } else { *x as i64 }).collect();
        texts(py, &words)?.get_item(numpy::PyArray1::from_vec(py, places))
    }

    fn batch(&self) -> Result<RecordBatch, ArrowError> {
        let mut fields = Vec::new();
        let mut arrays: Vec<ArrayRef> = Vec::new();
        for (column, values) in self.columns.iter().zip(&self.values) {
            let array: ArrayRef = if column.words.is_empty() {
                Arc::new(Float64Array::from(values.clone()))
            } else {
                let keys: Int32Array = values.iter().map(|x| (!x.is_nan()).then_some(*x as i32)).collect();
                Arc::new(DictionaryArray::try_new(keys, Arc::new(StringArray::from(column.words.clone())))?)
            };
            let kind: DataType = array.data_type().clone();
            fields.push(Field::new(&column.name, kind, !column.words.is_empty()));
            arrays.push(array);
        }
        RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)
    }
}

getters! { Table, self, py {
    /// Names of the columns.
    columns: Vec<&str> = self.names();
} }

#[pymethods]
impl Table {
    fn __len__(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }

    fn __contains__(&self, name: &str) -> bool {
        self.find(name).is_ok()
    }

    /// A column as an array: numbers, or texts for a column of words.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Array<'py>> {
        self.column(py, self.find(name)?)
    }

    /// All columns: a dict from names to arrays.
    fn numpy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (c, column) in self.columns.iter().enumerate() {
            dict.set_item(&column.name, self.column(py, c)?)?;
        }
        Ok(dict)
    }

    /// A pandas.DataFrame; needs pandas.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        py.import("pandas")?.call_method1("DataFrame", (self.numpy(py)?,))
    }

    /// A polars.DataFrame; needs polars.
    fn to_polars<'py>(this: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        this.py().import("polars")?.call_method1("DataFrame", (this,))
    }

    /// Writes the table as CSV or Parquet, by the ending of the name. A Parquet file has units, carom's version and the text of the
    /// scene or study in its metadata.
    ///
    /// Raises:
    ///     StudyError: the file cannot be written, or its name has another ending.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| {
            let mut table = carom_study::Table::create_with(&path, &self.columns)?;
            if let Some(Source { key, text }) = &self.source {
                table.describe(key, text);
            }
            let mut row = vec![0.0; self.columns.len()];
            for k in 0..self.values.first().map_or(0, Vec::len) {
                row.iter_mut().zip(&self.values).for_each(|(x, column)| *x = column[k]);
                table.row(&row)?;
            }
            table.finish()
        })
        .map_err(raise)
    }

    /// The Arrow C stream interface; columns of words are dictionaries of texts, with null for the empty word.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Maybe<'_, 'py>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The protocol allows a producer to ignore the request.
        let _ = requested_schema;
        let batch = self.batch().map_err(|e| PyValueError::new_err(e.to_string()))?;
        let schema = batch.schema();
        let stream = FFI_ArrowArrayStream::new(Box::new(RecordBatchIterator::new([Ok(batch)], schema)));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// Draws a column over another one with matplotlib.
    ///
    /// Args:
    ///     y: name of the column.
    ///     x: name of the other one; the first column by default.
    ///     axes: the Axes to draw into; new ones by default.
    ///
    /// Returns:
    ///     The Axes.
    ///
    /// Raises:
    ///     KeyError: no column has the name.
    ///     ImportError: matplotlib is not installed.
    #[pyo3(signature = (y, x=None, axes=None))]
    fn plot<'py>(this: &Bound<'py, Self>, y: &str, x: Option<&str>, axes: Maybe<'_, 'py>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "table_plot", (this, y, x, axes))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "table_html", (this,))
    }

    fn __repr__(&self) -> String {
        format!("<carom.Table of {} rows: {}>", self.__len__(), self.names().join(", "))
    }
}

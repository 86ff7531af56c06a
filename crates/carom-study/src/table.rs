//! Tables of numbers, written row by row in constant memory: CSV or Parquet, as the file's name ends.
//!
//! | | `.csv` | `.parquet` |
//! | --- | --- | --- |
//! | columns | a header, quoted where it must be | required doubles; required strings for columns of words |
//! | numbers | shortest decimals that read back to the bit; NaN's payload is lost | to the bit |
//! | held back | a buffer of some kilobytes | one row group, 2²² numbers (32 MB) at most |
//! | compression | none | Snappy, which every reader knows |
//!
//! A table is written as `X.csv.part` beside its place and moved there when it is whole, so that a file under its own
//! name is always a whole one.

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most rows of one Parquet row group, and most numbers: the memory that a table takes.
const GROUP_ROWS: usize = 1 << 16;
const GROUP_NUMBERS: usize = 1 << 22;

/// Why a table can't be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// A file name that says no known format.
    #[error("{file}: a table's name ends in .csv or .parquet")]
    Extension {
        /// The file.
        file: PathBuf,
    },
    /// Columns that make no table.
    #[error("{file}: {reason}")]
    Columns {
        /// The file.
        file: PathBuf,
        /// What is wrong with them.
        reason: String,
    },
    /// A row of another length than the header.
    #[error("{file}: a row of {given} numbers for {columns} columns")]
    Row {
        /// The file.
        file: PathBuf,
        /// Numbers in the row.
        given: usize,
        /// Columns of the table.
        columns: usize,
    },
    /// The file system, or the format, says no.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// What was said.
        reason: io::Error,
    },
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name in the header.
    pub name: String,
    /// Empty for a column of numbers. Else the column holds words: a row's number k stands for `words[k]`.
    pub words: Vec<String>,
}

impl Column {
    /// A column of numbers.
    pub fn number(name: impl Into<String>) -> Self {
        Self { name: name.into(), words: Vec::new() }
    }

    /// A column of words, each written as its place among `words`.
    pub fn word<W: Into<String>>(name: impl Into<String>, words: impl IntoIterator<Item = W>) -> Self {
        Self { name: name.into(), words: words.into_iter().map(Into::into).collect() }
    }

    /// The word that a number stands for; the empty word for a number that stands for none.
    pub fn spell(&self, value: f64) -> &str {
        // `as` takes NaN to 0 and negatives too: those are none
        if value >= 0.0 { self.words.get(value as usize).map_or("", String::as_str) } else { "" }
    }

    /// The number that stands for a word; NaN for one that is not among the words.
    pub(crate) fn code(&self, word: &str) -> f64 {
        self.words.iter().position(|w| w == word).map_or(f64::NAN, |k| k as f64)
    }
}

/// A table being written. Dropped before [`Table::finish`], it leaves nothing behind.
///
/// ```
/// # use carom_study::{Table, TableError};
/// # let folder = std::env::temp_dir().join(format!("carom-table-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder).unwrap();
/// let file = folder.join("fall.csv");
/// let mut table = Table::create(&file, &["time".into(), "height".into()])?;
/// for k in 0..3 {
///     let time = 0.1 * f64::from(k);
///     table.row(&[time, 1.0 - 4.905 * time * time])?;
/// }
/// table.finish()?;
/// assert!(std::fs::read_to_string(&file).unwrap().starts_with("time,height\n0,1\n0.1,0.95095\n"));
/// # std::fs::remove_dir_all(&folder).unwrap();
/// # Ok::<(), TableError>(())
/// ```
pub struct Table {
    // before `place`: what is open is closed before it is removed
    sink: Sink,
    place: Place,
    columns: usize,
    whole: bool,
}

impl Table {
    /// Begins a table at `path` with one column for each name; `.csv` or `.parquet` at the path's end, in capitals
    /// or not, says which. A file that is already there stays until [`Table::finish`] replaces it.
    ///
    /// # Errors
    /// [`TableError`]: another extension, no columns, two of one name, a folder that can't be written to.
    pub fn create(path: &Path, columns: &[String]) -> Result<Self, TableError> {
        Self::create_with(path, &columns.iter().map(Column::number).collect::<Vec<_>>())
    }

    /// The same with columns of words among them.
    ///
    /// # Errors
    /// As [`Table::create`].
    pub fn create_with(path: &Path, columns: &[Column]) -> Result<Self, TableError> {
        let refuse = |reason: String| TableError::Columns { file: path.to_owned(), reason };
        let format = path.extension().map(|ending| ending.to_ascii_lowercase());
        let open: fn(File, &[Column]) -> io::Result<Sink> = match format.as_deref().and_then(|f| f.to_str()) {
            Some("csv") => Sink::csv,
            Some("parquet") => Sink::parquet,
            _ => return Err(TableError::Extension { file: path.to_owned() }),
        };
        if columns.is_empty() {
            return Err(refuse("a table needs a column".into()));
        }
        let mut seen = std::collections::HashSet::new();
        if let Some(twice) = columns.iter().find(|column| !seen.insert(&column.name)) {
            return Err(refuse(format!("two columns are called '{}'", twice.name)));
        }
        let (place, file) = Place::begin(path).map_err(unwritable(path))?;
        let sink = open(file, columns).map_err(unwritable(path))?;
        Ok(Self { sink, place, columns: columns.len(), whole: true })
    }

    /// Adds a row: a number for each column.
    ///
    /// # Errors
    /// [`TableError`]: another number of numbers, which leaves the table as it was; a write that failed, after which
    /// the table can't be finished.
    pub fn row(&mut self, values: &[f64]) -> Result<(), TableError> {
        if values.len() != self.columns {
            let file = self.place.path.clone();
            return Err(TableError::Row { file, given: values.len(), columns: self.columns });
        }
        let written = self.sink.row(values);
        self.whole &= written.is_ok();
        written.map_err(unwritable(&self.place.path))
    }

    /// Writes what is held back and moves the table to its place.
    ///
    /// # Errors
    /// [`TableError`]: the file can't be written, now or at an earlier row. Nothing is left behind then.
    pub fn finish(self) -> Result<(), TableError> {
        let path = self.place.path.clone();
        self.finish_at(&path)
    }

    /// As [`Table::finish`], but to another place in the same folder: what is there of a table that was not finished.
    ///
    /// # Errors
    /// As [`Table::finish`].
    pub(crate) fn finish_at(self, path: &Path) -> Result<(), TableError> {
        let Self { sink, place, whole, .. } = self;
        let flushed = if whole { sink.finish() } else { Err(io::Error::other("a row was lost")) };
        flushed.and_then(|()| place.keep(path)).map_err(unwritable(path))
    }
}

fn unwritable(path: &Path) -> impl FnOnce(io::Error) -> TableError {
    let file = path.to_owned();
    move |reason| TableError::Unwritable { file, reason }
}

/// Where a table goes, and the unfinished file beside it.
struct Place {
    path: PathBuf,
    part: PathBuf,
    kept: bool,
}

impl Place {
    fn begin(path: &Path) -> io::Result<(Self, File)> {
        if path.is_dir() {
            // said now, and not by the last step of a long computation
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(".part");
        let part = path.with_file_name(name);
        let file = File::create(&part)?;
        Ok((Self { path: path.to_owned(), part, kept: false }, file))
    }

    fn keep(mut self, path: &Path) -> io::Result<()> {
        std::fs::rename(&self.part, path)?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if !self.kept {
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// A format.
enum Sink {
    Csv(Box<csv::Writer<File>>, Vec<Column>),
    Parquet(Box<Groups>),
}

/// A Parquet file and the columns of its next row group.
struct Groups {
    file: SerializedFileWriter<File>,
    names: Vec<Column>,
    columns: Vec<Vec<f64>>,
    rows: usize,
}

impl Sink {
    fn csv(file: File, columns: &[Column]) -> io::Result<Self> {
        let mut writer = csv::Writer::from_writer(file);
        writer.write_record(columns.iter().map(|column| &column.name))?;
        Ok(Self::Csv(Box::new(writer), columns.to_vec()))
    }

    fn parquet(file: File, columns: &[Column]) -> io::Result<Self> {
        let typed = |column: &Column| {
            let (physical, logical) = match column.words.as_slice() {
                [] => (Physical::DOUBLE, None),
                _ => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            };
            let built = Type::primitive_type_builder(&column.name, physical).with_logical_type(logical);
            built.with_repetition(Repetition::REQUIRED).build().map(Arc::new)
        };
        let fields = columns.iter().map(typed).collect::<Result<_, _>>().map_err(plain)?;
        let schema = Type::group_type_builder("table").with_fields(fields).build().map_err(plain)?;
        // numbers from a computation hardly repeat: a dictionary of them only costs; words do
        let mut properties =
            WriterProperties::builder().set_compression(Compression::SNAPPY).set_dictionary_enabled(false);
        for column in columns.iter().filter(|column| !column.words.is_empty()) {
            properties = properties.set_column_dictionary_enabled(ColumnPath::new(vec![column.name.clone()]), true);
        }
        let file = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build())).map_err(plain)?;
        let rows = (GROUP_NUMBERS / columns.len()).clamp(1, GROUP_ROWS);
        let held = vec![Vec::new(); columns.len()];
        Ok(Self::Parquet(Box::new(Groups { file, names: columns.to_vec(), columns: held, rows })))
    }

    fn row(&mut self, values: &[f64]) -> io::Result<()> {
        match self {
            Self::Csv(writer, columns) => {
                for (column, value) in columns.iter().zip(values) {
                    if column.words.is_empty() {
                        writer.write_field(value.to_string())?;
                    } else {
                        writer.write_field(column.spell(*value))?;
                    }
                }
                Ok(writer.write_record(None::<&[u8]>)?)
            }
            Self::Parquet(groups) => {
                for (column, value) in groups.columns.iter_mut().zip(values) {
                    column.push(*value);
                }
                if groups.columns[0].len() < groups.rows { Ok(()) } else { groups.write().map_err(plain) }
            }
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv(mut writer, _) => writer.flush(),
            Self::Parquet(mut groups) => {
                groups.write().and_then(|()| groups.file.finish()).map(|_metadata| ()).map_err(plain)
            }
        }
    }
}

impl Groups {
    /// Writes the columns as a row group and empties them.
    fn write(&mut self) -> Result<(), ParquetError> {
        if self.columns[0].is_empty() {
            return Ok(());
        }
        let mut group = self.file.next_row_group()?;
        for (name, column) in self.names.iter().zip(&mut self.columns) {
            let Some(mut out) = group.next_column()? else { break };
            if name.words.is_empty() {
                out.typed::<DoubleType>().write_batch(column, None, None)?;
            } else {
                let words: Vec<ByteArray> = column.iter().map(|value| ByteArray::from(name.spell(*value))).collect();
                out.typed::<ByteArrayType>().write_batch(&words, None, None)?;
            }
            out.close()?;
            column.clear();
        }
        group.close().map(|_metadata| ())
    }
}

/// Reads a table that [`Table`] wrote, row by row, in the memory of one row group.
///
/// # Errors
/// What the file system or the format says, other columns than these, and whatever `see` refuses.
pub(crate) fn read_table(
    path: &Path,
    columns: &[Column],
    see: &mut dyn FnMut(&[f64]) -> io::Result<()>,
) -> io::Result<()> {
    let other = || io::Error::other("it has other columns");
    let mut row = vec![0.0; columns.len()];
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
        let mut reader = csv::Reader::from_path(path)?;
        if !reader.headers()?.iter().eq(columns.iter().map(|column| column.name.as_str())) {
            return Err(other());
        }
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record)? {
            for ((column, cell), value) in columns.iter().zip(&record).zip(&mut row) {
                *value = match column.words.as_slice() {
                    [] => cell.parse().map_err(|_| io::Error::other(format!("'{cell}' is no number")))?,
                    _ => column.code(cell),
                };
            }
            see(&row)?;
        }
        return Ok(());
    }
    let file = SerializedFileReader::new(File::open(path)?).map_err(plain)?;
    let schema = file.metadata().file_metadata().schema_descr_ptr();
    if !schema.columns().iter().map(|c| c.name()).eq(columns.iter().map(|column| column.name.as_str())) {
        return Err(other());
    }
    let mut held: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    for k in 0..file.num_row_groups() {
        let group = file.get_row_group(k).map_err(plain)?;
        let rows = usize::try_from(group.metadata().num_rows()).map_err(io::Error::other)?;
        for (i, (column, into)) in columns.iter().zip(&mut held).enumerate() {
            into.clear();
            match group.get_column_reader(i).map_err(plain)? {
                ColumnReader::DoubleColumnReader(mut reader) if column.words.is_empty() => {
                    reader.read_records(rows, None, None, into).map_err(plain)?;
                }
                ColumnReader::ByteArrayColumnReader(mut reader) if !column.words.is_empty() => {
                    let mut words: Vec<ByteArray> = Vec::with_capacity(rows);
                    reader.read_records(rows, None, None, &mut words).map_err(plain)?;
                    into.extend(words.iter().map(|word| word.as_utf8().map_or(f64::NAN, |word| column.code(word))));
                }
                _ => return Err(other()),
            }
            if into.len() != rows {
                return Err(io::Error::other("a row group is shorter than it says"));
            }
        }
        for r in 0..rows {
            for (value, column) in row.iter_mut().zip(&held) {
                *value = column[r];
            }
            see(&row)?;
        }
    }
    Ok(())
}

/// What the file system said, without Parquet's wrapping.
fn plain(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => io::Error::other(inner),
        other => other.into(),
    }
}

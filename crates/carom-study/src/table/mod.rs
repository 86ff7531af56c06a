//! Tables of numbers, written row by row in constant memory: CSV or Parquet, as the file's name ends.
//!
//! | | `.csv` | `.parquet` |
//! | --- | --- | --- |
//! | columns | a header, quoted where it must be | required doubles; required strings for columns of words |
//! | numbers | shortest decimals that read back to the bit; NaN's payload is lost | to the bit |
//! | held back | 2¹⁴ rows at most | one row group: 2¹⁶ rows and 2²² numbers (32 MB) at most |
//! | compression | none | Snappy, which every reader knows |
//!
//! A table is written as `X.csv.part` beside its place and moved there when it is whole, so that a file under its own
//! name is always a whole one.

mod encode;

pub(crate) use encode::{CHUNK, Encoder, Piece, Rows};

use encode::Format;
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnCloseResult;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::serialized_reader::ReadOptionsBuilder;
use parquet::file::writer::SerializedFileWriter;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes handed to the file at a time.
const WRITE_BYTES: usize = 1 << 18;

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
        self.place(value).map_or("", |k| &self.words[k])
    }

    /// The place among the words that a number stands for.
    fn place(&self, value: f64) -> Option<usize> {
        // `as` takes NaN to 0 and negatives too: those are none
        (value >= 0.0 && (value as usize) < self.words.len()).then_some(value as usize)
    }

    /// The number that stands for a word; NaN for one that is not among the words.
    fn code(&self, word: &str) -> f64 {
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
    out: Out,
    place: Place,
    encoder: Encoder,
    held: Rows,
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
        let is_text = match format.as_deref().and_then(|f| f.to_str()) {
            Some("csv") => true,
            Some("parquet") => false,
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
        let encoder = if is_text { Ok(Encoder::csv(columns)) } else { Encoder::parquet(columns) };
        let encoder = encoder.map_err(unwritable(path))?;
        let out = Out::begin(file, &encoder).map_err(unwritable(path))?;
        Ok(Self { out, place, held: encoder.rows(), encoder, whole: true })
    }

    /// Adds a row: a number for each column.
    ///
    /// # Errors
    /// [`TableError`]: another number of numbers, which leaves the table as it was; a write that failed, after which
    /// the table can't be finished.
    pub fn row(&mut self, values: &[f64]) -> Result<(), TableError> {
        let columns = self.encoder.columns.len();
        if values.len() != columns {
            return Err(TableError::Row { file: self.place.path.clone(), given: values.len(), columns });
        }
        self.held.push(values);
        if self.held.room() == 0 { self.flush() } else { Ok(()) }
    }

    /// Writes the rows that are held back.
    fn flush(&mut self) -> Result<(), TableError> {
        let (encoder, held) = (&self.encoder, &self.held);
        let pieces = (0..encoder.pieces(held)).map(|k| encoder.piece(held, k)).collect::<io::Result<Vec<_>>>();
        self.held.clear();
        self.append(pieces)
    }

    /// How its rows become bytes.
    pub(crate) fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    /// Hands out the rows that are held back, to be filled up and given to [`Table::append`].
    pub(crate) fn take_held(&mut self) -> Rows {
        std::mem::replace(&mut self.held, self.encoder.rows())
    }

    /// Adds the pieces of a group, which is full unless it is the last.
    ///
    /// # Errors
    /// What could not be encoded, or not be written: the table can't be finished then.
    pub(crate) fn append(&mut self, pieces: io::Result<Vec<Piece>>) -> Result<(), TableError> {
        let written = pieces.and_then(|pieces| self.out.append(pieces));
        self.whole &= written.is_ok();
        written.map_err(unwritable(&self.place.path))
    }

    /// Takes over the rows of a table that [`Table::finish_at`] left, into one without rows: whole groups as they are,
    /// without decoding them; what is left of a group is held back. How many rows it took, where the file tells.
    ///
    /// # Errors
    /// What the file system or the format says, or that it has other columns.
    pub(crate) fn take_over(&mut self, path: &Path) -> io::Result<Option<u64>> {
        self.whole = false;
        let file = File::open(path)?;
        let taken = match &mut self.out {
            Out::Csv(out) => {
                let header = self.encoder.header()?;
                let mut theirs = vec![0; header.len()];
                let mut file = file;
                file.read_exact(&mut theirs)?;
                if theirs != header {
                    return Err(other_columns());
                }
                io::copy(&mut file, out)?;
                None
            }
            Out::Parquet(out) => Some(take_groups(file, out, &self.encoder, &mut self.held)?),
        };
        self.whole = true;
        Ok(taken)
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
    pub(crate) fn finish_at(mut self, path: &Path) -> Result<(), TableError> {
        self.flush()?;
        let Self { out, place, whole, .. } = self;
        let flushed = if whole { out.finish() } else { Err(io::Error::other("a row was lost")) };
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

/// The file that pieces go into.
enum Out {
    Csv(BufWriter<File>),
    Parquet(Box<SerializedFileWriter<BufWriter<File>>>),
}

impl Out {
    fn begin(file: File, encoder: &Encoder) -> io::Result<Self> {
        let mut file = BufWriter::with_capacity(WRITE_BYTES, file);
        match &encoder.format {
            Format::Csv => {
                file.write_all(&encoder.header()?)?;
                Ok(Self::Csv(file))
            }
            Format::Parquet { schema, properties } => {
                let writer = SerializedFileWriter::new(file, schema.root_schema_ptr(), Arc::clone(properties));
                writer.map(|writer| Self::Parquet(Box::new(writer))).map_err(plain)
            }
        }
    }

    /// Writes a group through to the file: a full disk is told now.
    fn append(&mut self, pieces: Vec<Piece>) -> io::Result<()> {
        match self {
            Self::Csv(file) => {
                pieces.into_iter().try_for_each(|piece| match piece {
                    Piece::Text(text) => file.write_all(&text),
                    Piece::Column(..) => Err(io::Error::other("a column for a text")),
                })?;
                file.flush()
            }
            Self::Parquet(_) if pieces.is_empty() => Ok(()),
            Self::Parquet(file) => {
                let mut group = file.next_row_group().map_err(plain)?;
                for piece in pieces {
                    let Piece::Column(bytes, close) = piece else {
                        return Err(io::Error::other("a text for a column"));
                    };
                    group.append_column(&bytes, *close).map_err(plain)?;
                }
                group.close().map_err(plain)?;
                file.flush()
            }
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv(mut file) => file.flush(),
            Self::Parquet(mut file) => file.finish().map(|_metadata| ()).map_err(plain),
        }
    }
}

fn other_columns() -> io::Error {
    io::Error::other("it has other columns")
}

/// Copies the whole groups of a Parquet table that this module wrote into another, and the rows of its last, shorter one into
/// `rest`. How many rows there were.
fn take_groups(
    from: File,
    into: &mut SerializedFileWriter<BufWriter<File>>,
    encoder: &Encoder,
    rest: &mut Rows,
) -> io::Result<u64> {
    // everything that is said of a column, so that its copy says the same
    let options = ReadOptionsBuilder::new().with_encoding_stats_as_mask(false).build();
    let file = SerializedFileReader::new_with_options(from.try_clone()?, options).map_err(plain)?;
    let schema = file.metadata().file_metadata().schema_descr_ptr();
    let mine = into.schema_descr();
    let alike = |(a, b): (&Arc<_>, &Arc<_>)| a == b;
    if schema.num_columns() != mine.num_columns() || !schema.columns().iter().zip(mine.columns()).all(alike) {
        return Err(other_columns());
    }
    let mut taken = 0;
    for k in 0..file.num_row_groups() {
        let group = file.metadata().row_group(k);
        let rows = u64::try_from(group.num_rows()).map_err(io::Error::other)?;
        taken += rows;
        if rows != encoder.group() as u64 {
            if k + 1 != file.num_row_groups() || rows > encoder.group() as u64 {
                return Err(io::Error::other("its row groups have other lengths"));
            }
            decode(&file, k, rows as usize, &encoder.columns, rest)?;
            continue;
        }
        let mut copy = into.next_row_group().map_err(plain)?;
        for column in group.columns() {
            let close = ColumnCloseResult {
                bytes_written: u64::try_from(column.compressed_size()).map_err(io::Error::other)?,
                rows_written: rows,
                metadata: column.clone(),
                bloom_filter: None,
                column_index: None,
                offset_index: None,
            };
            copy.append_column(&from, close).map_err(plain)?;
        }
        copy.close().map_err(plain)?;
    }
    Ok(taken)
}

/// Reads a row group back into rows.
fn decode(
    file: &SerializedFileReader<File>,
    group: usize,
    rows: usize,
    columns: &[Column],
    into: &mut Rows,
) -> io::Result<()> {
    let group = file.get_row_group(group).map_err(plain)?;
    let mut held: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    for (i, (column, into)) in columns.iter().zip(&mut held).enumerate() {
        match group.get_column_reader(i).map_err(plain)? {
            ColumnReader::DoubleColumnReader(mut reader) if column.words.is_empty() => {
                reader.read_records(rows, None, None, into).map_err(plain)?;
            }
            ColumnReader::ByteArrayColumnReader(mut reader) if !column.words.is_empty() => {
                let mut words: Vec<ByteArray> = Vec::with_capacity(rows);
                reader.read_records(rows, None, None, &mut words).map_err(plain)?;
                into.extend(words.iter().map(|word| word.as_utf8().map_or(f64::NAN, |word| column.code(word))));
            }
            _ => return Err(other_columns()),
        }
        if into.len() != rows {
            return Err(io::Error::other("a row group is shorter than it says"));
        }
    }
    for r in 0..rows {
        into.push(&held.iter().map(|column| column[r]).collect::<Vec<_>>());
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

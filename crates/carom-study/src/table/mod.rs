//! Tables written row by row in constant memory, as CSV or Parquet. The extension of the file name selects the format.
//!
//! | | `.csv` | `.parquet` |
//! | --- | --- | --- |
//! | columns | a header, quoted where necessary | required doubles; required strings for columns of words |
//! | numbers | shortest decimals that are read back exactly; the payload of a NaN is lost | exact |
//! | buffer | at most 2¹⁴ rows | one row group: at most 2¹⁶ rows and 2²² numbers (32 MB) |
//! | compression | none | numbers: Snappy; words: a dictionary with indices of a few bits |
//! | metadata | none | `carom.version`; `carom.units`, a JSON object from columns to units; texts of [`Table::describe`] |
//!
//! A table is written to `X.csv.part` in the same folder and renamed when it is complete. A file under its final name is
//! therefore always complete. The temporary file is locked, so that a second process that writes the same table is refused.

mod column;
mod encode;
mod resume;
mod words;

pub use column::Column;
pub(crate) use encode::{CHUNK, Encoder, Piece, Rows};

use crate::Part;
use encode::{Format, plain};
use parquet::file::metadata::{FileMetaData, KeyValue, ParquetMetaData, ParquetMetaDataWriter, RowGroupMetaData};
use parquet::file::writer::SerializedFileWriter;
use resume::take_groups;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bytes written to the file at a time.
const WRITE_BYTES: usize = 1 << 18;

/// Reason why a table cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The extension of the file name is not a known format.
    #[error("{file}: the name of a table must end in .csv or .parquet")]
    Extension {
        /// The file.
        file: PathBuf,
    },
    /// Invalid columns.
    #[error("{file}: {reason}")]
    Columns {
        /// The file.
        file: PathBuf,
        /// The rule that is broken.
        reason: String,
    },
    /// The length of a row is not the number of columns.
    #[error("{file}: a row has {given} numbers, but the table has {columns} columns")]
    Row {
        /// The file.
        file: PathBuf,
        /// Length of the row.
        given: usize,
        /// Number of columns.
        columns: usize,
    },
    /// The file cannot be written.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// Error of the operating system or of the encoder.
        reason: io::Error,
    },
}

impl GroupEnd {
    fn of(file: &SerializedFileWriter<BufWriter<File>>, rows: u64) -> Self {
        Self { rows, bytes: file.bytes_written() as u64, groups: file.flushed_row_groups().len() }
    }
}

/// A table being written. If it is dropped before [`Table::finish`], the temporary file is removed.
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
    // before `place`, so that nothing is written after the file has got its name
    out: Out,
    place: Part,
    encoder: Encoder,
    held: Rows,
    facts: Vec<KeyValue>,
    whole: bool,
    /// Ends of the groups that have reached the file, in order.
    groups: Vec<GroupEnd>,
}

/// End of a group of rows in the file.
#[derive(Clone, Copy)]
struct GroupEnd {
    /// Number of rows up to here.
    rows: u64,
    /// Length of the file up to here, bytes.
    bytes: u64,
    /// Number of row groups of a Parquet file up to here.
    groups: usize,
}

impl Table {
    /// Creates a table at `path` with one column of numbers for each name. The extension `.csv` or `.parquet`, in upper or lower
    /// case, selects the format. An existing file is unchanged until [`Table::finish`] replaces it.
    ///
    /// # Errors
    /// [`TableError`]: another extension, no columns, duplicate names, a folder that cannot be written to, or another process that
    /// writes the same table.
    pub fn create(path: &Path, columns: &[String]) -> Result<Self, TableError> {
        Self::create_with(path, &columns.iter().map(Column::number).collect::<Vec<_>>())
    }

    /// As [`Table::create`], with columns of numbers or words.
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
            return Err(refuse("a table needs at least one column".into()));
        }
        let mut seen = std::collections::HashSet::new();
        if let Some(twice) = columns.iter().find(|column| !seen.insert(&column.name)) {
            return Err(refuse(format!("two columns have the name '{}'", twice.name)));
        }
        let place = Part::locked(path).map_err(unwritable(path))?;
        let file = place.file().try_clone().map_err(unwritable(path))?;
        let encoder = if is_text { Ok(Encoder::csv(columns)) } else { Encoder::parquet(columns) };
        let encoder = encoder.map_err(unwritable(path))?;
        let out = Out::begin(file, &encoder).map_err(unwritable(path))?;
        // sorted, whatever features of serde_json are on
        let units: BTreeMap<&str, &str> =
            columns.iter().filter(|it| !it.unit.is_empty()).map(|it| (it.name.as_str(), it.unit)).collect();
        let units = serde_json::to_string(&units).map_err(|e| unwritable(path)(e.into()))?;
        let facts = [("carom.version", env!("CARGO_PKG_VERSION").to_owned()), ("carom.units", units)];
        let facts = facts.map(|(key, text)| KeyValue::new(key.to_owned(), text)).into();
        Ok(Self { out, place, held: encoder.rows(), encoder, facts, whole: true, groups: Vec::new() })
    }

    /// Adds a text to the metadata of a Parquet file, for example `carom.scene` with the scene that was simulated. CSV files have
    /// no metadata.
    pub fn describe(&mut self, key: &str, text: &str) {
        self.facts.push(KeyValue::new(key.to_owned(), text.to_owned()));
    }

    /// Adds a row: a number for each column, or the index of a word.
    ///
    /// # Errors
    /// [`TableError::Row`] if the length is wrong, with the table unchanged; [`TableError::Unwritable`] if writing fails, after
    /// which the table cannot be finished.
    pub fn row(&mut self, values: &[f64]) -> Result<(), TableError> {
        let columns = self.encoder.columns.len();
        if values.len() != columns {
            return Err(TableError::Row { file: self.place.path().to_owned(), given: values.len(), columns });
        }
        self.held.push(values);
        if self.held.room() == 0 { self.flush() } else { Ok(()) }
    }

    /// Writes the buffered rows.
    pub(crate) fn flush(&mut self) -> Result<(), TableError> {
        let (encoder, held) = (&self.encoder, &self.held);
        let (rows, pieces) = (held.length(), (0..encoder.pieces(held)).map(|k| encoder.piece(held, k)).collect());
        self.held.clear();
        self.append(rows, pieces)
    }

    /// The encoder of the rows.
    pub(crate) fn encoder(&self) -> &Encoder {
        &self.encoder
    }

    /// Takes the buffered rows, to be completed, encoded and passed to [`Table::append`].
    pub(crate) fn take_held(&mut self) -> Rows {
        std::mem::replace(&mut self.held, self.encoder.rows())
    }

    /// Adds the pieces of a group of `rows` rows. All groups but the last are complete.
    ///
    /// # Errors
    /// The error of encoding or writing; the table cannot be finished then.
    pub(crate) fn append(&mut self, rows: usize, pieces: io::Result<Vec<Piece>>) -> Result<(), TableError> {
        let rows = self.rows() + rows as u64;
        let written = pieces.and_then(|pieces| self.out.append(pieces)).and_then(|()| self.out.end(rows));
        self.whole &= written.is_ok();
        written.map(|end| self.groups.push(end)).map_err(unwritable(self.place.path()))
    }

    /// Number of rows that have reached the file.
    fn rows(&self) -> u64 {
        self.groups.last().map_or(0, |end| end.rows)
    }

    /// Copies the `rows` rows of a table written by [`Table::leave`] into this empty table: complete groups without decoding them,
    /// the rows of an incomplete group into the buffer. CSV files do not store the number of rows.
    ///
    /// # Errors
    /// The error of reading or decoding, or that the table has other columns or another number of rows.
    pub(crate) fn take_over(&mut self, path: &Path, rows: u64) -> io::Result<()> {
        self.whole = false;
        let file = File::open(path)?;
        match &mut self.out {
            Out::Csv(out) => {
                let header = self.encoder.header()?;
                let mut theirs = vec![0; header.len()];
                let mut file = file;
                file.read_exact(&mut theirs)?;
                if theirs != header {
                    return Err(other_columns());
                }
                io::copy(&mut file, out)?;
                out.flush()?;
                self.groups.push(self.out.end(rows)?);
            }
            Out::Parquet(out) => {
                let groups = take_groups(file, out, &self.encoder, &mut self.held)?;
                out.flush()?;
                self.groups = groups;
                let found = self.rows() + self.held.length() as u64;
                if found != rows {
                    return Err(io::Error::other(format!(
                        "it has {found} rows instead of the {rows} that were written"
                    )));
                }
            }
        }
        self.whole = true;
        Ok(())
    }

    /// Writes the buffered rows and renames the table to its final name.
    ///
    /// # Errors
    /// [`TableError::Unwritable`]: writing failed, now or at an earlier row. The temporary file is removed then.
    pub fn finish(mut self) -> Result<(), TableError> {
        self.complete()?;
        self.keep()
    }

    /// Writes the buffered rows and the end of the table.
    ///
    /// # Errors
    /// As [`Table::finish`].
    pub(crate) fn complete(&mut self) -> Result<(), TableError> {
        self.flush()?;
        let Self { out, place, encoder, facts, groups, whole, .. } = self;
        let lost = || io::Error::other("a row was lost");
        let end = groups.last().filter(|_| *whole).ok_or_else(lost);
        end.and_then(|end| cut(place.file(), end, encoder, &out.groups(), facts)).map_err(unwritable(place.path()))
    }

    /// Renames the completed table to its final name.
    ///
    /// # Errors
    /// As [`Table::finish`].
    pub(crate) fn keep(self) -> Result<(), TableError> {
        let Self { out, place, .. } = self;
        drop(out);
        let path = place.path().to_owned();
        place.keep().map_err(unwritable(&path))
    }

    /// Ends a table before its last row under another name in the same folder: a complete table of the rows so far. Where they cannot
    /// be written, as on a full disk, it has the groups of rows that have reached the file; returns the number of rows. `beside`, called with the temporary file and this number, does what must succeed before the
    /// file is renamed.
    ///
    /// # Errors
    /// [`TableError::Unwritable`]: no more than `least` rows can be kept, if a row was lost. The temporary file is removed then.
    pub(crate) fn leave(
        mut self,
        path: &Path,
        least: u64,
        mut beside: impl FnMut(&Path, u64) -> io::Result<()>,
    ) -> Result<u64, TableError> {
        let mut failed = if self.whole { self.flush().err() } else { None };
        let lost = failed.is_some() || !self.whole;
        let Self { out, place, encoder, facts, groups, .. } = self;
        let written = out.groups();
        drop(out); // what it has buffered is cut off below
        for (_, end) in groups.iter().rev().enumerate().filter(|(k, end)| (!lost && *k == 0) || end.rows > least) {
            let cut = cut(place.file(), end, &encoder, &written, &facts);
            match cut.and_then(|()| beside(place.temporary(), end.rows)).map_err(unwritable(path)) {
                Ok(()) => return place.keep_as(path).map(|()| end.rows).map_err(unwritable(path)),
                Err(error) => _ = failed.get_or_insert(error),
            }
        }
        Err(failed.unwrap_or_else(|| unwritable(path)(io::Error::other("no row has reached the file"))))
    }
}

/// Path of the table of an interrupted run: `X.partial.csv` for `X.csv`.
pub(crate) fn partial(path: &Path) -> PathBuf {
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    path.with_extension(format!("partial.{ending}"))
}

/// Makes a file a complete table that ends with this group; `written` has the groups of a Parquet file.
fn cut(
    mut file: &File,
    end: &GroupEnd,
    encoder: &Encoder,
    written: &[RowGroupMetaData],
    facts: &[KeyValue],
) -> io::Result<()> {
    file.set_len(end.bytes)?;
    file.seek(SeekFrom::Start(end.bytes))?;
    let Format::Parquet { schema, properties } = &encoder.format else { return Ok(()) };
    let (version, made_by) = (properties.writer_version().as_num(), properties.created_by().to_owned());
    let rows = i64::try_from(end.rows).map_err(io::Error::other)?;
    let own = FileMetaData::new(version, rows, Some(made_by), Some(facts.to_vec()), Arc::clone(schema), None);
    let metadata = ParquetMetaData::new(own, written[..end.groups].to_vec());
    let mut footer = Vec::new();
    ParquetMetaDataWriter::new(&mut footer, &metadata).finish().map_err(plain)?;
    file.write_all(&footer)
}

fn unwritable(path: &Path) -> impl FnOnce(io::Error) -> TableError {
    let file = path.to_owned();
    move |reason| TableError::Unwritable { file, reason }
}

/// The file that pieces are written to.
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

    /// Writes a group and flushes it, so that a full disk is an error at once.
    fn append(&mut self, pieces: Vec<Piece>) -> io::Result<()> {
        match self {
            Self::Csv(file) => {
                pieces.into_iter().try_for_each(|piece| match piece {
                    Piece::Text(text) => file.write_all(&text),
                    Piece::Column(..) => Err(io::Error::other("a column for a text")),
                })?;
                file.flush()
            }
            Self::Parquet(file) if pieces.is_empty() => file.flush(),
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

    /// The end of what is written and flushed, `rows` rows.
    fn end(&mut self, rows: u64) -> io::Result<GroupEnd> {
        match self {
            Self::Csv(file) => Ok(GroupEnd { rows, bytes: file.stream_position()?, groups: 0 }),
            Self::Parquet(file) => Ok(GroupEnd::of(file, rows)),
        }
    }

    /// Metadata of the groups of a Parquet file.
    fn groups(&self) -> Vec<RowGroupMetaData> {
        match self {
            Self::Csv(_) => Vec::new(),
            Self::Parquet(file) => file.flushed_row_groups().to_vec(),
        }
    }
}

fn other_columns() -> io::Error {
    io::Error::other("it has other columns")
}

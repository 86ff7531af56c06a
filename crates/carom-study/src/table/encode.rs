//! Encoding of rows: rows are buffered column by column and encoded in independent pieces, in parallel. A piece is a column of
//! a row group (Parquet) or a range of its rows (CSV). The bytes depend on the rows alone, as groups have a fixed size.

use super::column::Column;
use super::words;
use bytes::Bytes;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, get_column_writer};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesPtr};
use parquet::file::statistics::Statistics;
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::{SchemaDescPtr, SchemaDescriptor, Type};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::io;
use std::sync::Arc;

/// Number of rows of a chunk, in which the numbers of a column are contiguous.
pub(crate) const CHUNK: usize = 64;
/// Greatest number of rows, and of numbers, in one Parquet row group; a table buffers as many.
const GROUP_ROWS: usize = 1 << 16;
const GROUP_NUMBERS: usize = 1 << 22;
/// Number of rows that a CSV table buffers.
const TEXT_ROWS: usize = 1 << 14;
/// Rows of one piece of CSV.
const PIECE_ROWS: usize = 16 * CHUNK;
/// Greatest number of rows of one page of a column: 64 kB of numbers, the window of Snappy, which fits in a core's cache.
pub(super) const PAGE_ROWS: usize = 1 << 13;
/// Rows passed to the encoder of a column at a time.
const BATCH_ROWS: usize = 16 * CHUNK;

/// The buffered rows of a group: chunks of [`CHUNK`] rows, each stored column by column.
#[derive(Debug)]
pub(crate) struct Rows {
    width: usize,
    most: usize,
    length: usize,
    /// Numbers beyond the chunks of `length` are unused.
    numbers: Vec<f64>,
}

impl Rows {
    pub fn length(&self) -> usize {
        self.length
    }

    /// Number of rows that can still be added.
    pub fn room(&self) -> usize {
        self.most - self.length
    }

    pub fn clear(&mut self) {
        self.truncate(0);
    }

    /// Keeps the first `length` rows.
    pub fn truncate(&mut self, length: usize) {
        self.length = length;
    }

    pub fn push(&mut self, row: &[f64]) {
        let at = self.length % CHUNK;
        let begin = (self.length - at) * self.width;
        self.length += 1;
        self.reserve();
        for (column, x) in row.iter().enumerate() {
            self.numbers[begin + column * CHUNK + at] = *x;
        }
    }

    /// Allocates the chunks of `length` rows and returns their end.
    fn reserve(&mut self) -> usize {
        let end = self.length.div_ceil(CHUNK) * CHUNK * self.width;
        if self.numbers.len() < end {
            self.numbers.resize(end, 0.0);
        }
        end
    }

    /// Adds `count` rows after complete chunks and returns them, to be filled: column c of row r of a chunk is at
    /// `c * CHUNK + r`.
    pub fn grow(&mut self, count: usize) -> &mut [f64] {
        debug_assert!(self.length.is_multiple_of(CHUNK) && count <= self.room());
        let begin = self.length * self.width;
        self.length += count;
        let end = self.reserve();
        &mut self.numbers[begin..end]
    }

    /// The numbers of a column in the rows `from..until`; `from` is the first row of a chunk.
    pub(super) fn column(&self, column: usize, from: usize, until: usize) -> impl Iterator<Item = &[f64]> {
        (from..until).step_by(CHUNK).map(move |row| {
            let begin = row * self.width + column * CHUNK;
            &self.numbers[begin..begin + CHUNK.min(until - row)]
        })
    }
}

/// Encoder of rows, shared by threads.
#[derive(Clone)]
pub(crate) struct Encoder {
    pub(super) columns: Arc<[Column]>,
    pub(super) format: Format,
}

#[derive(Clone)]
pub(super) enum Format {
    Csv,
    Parquet { schema: SchemaDescPtr, properties: WriterPropertiesPtr },
}

/// A part of a group, encoded.
pub(crate) enum Piece {
    Text(Vec<u8>),
    /// Bytes of a column, and their metadata.
    Column(Bytes, Box<ColumnCloseResult>),
}

impl Encoder {
    pub fn csv(columns: &[Column]) -> Self {
        Self { columns: columns.into(), format: Format::Csv }
    }

    pub fn parquet(columns: &[Column]) -> io::Result<Self> {
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
        // No dictionaries for numbers, as computed ones hardly repeat. Statistics (min, max) for each row group; an index of
        // pages would enlarge the footer, which is held in memory.
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_dictionary_enabled(false)
            .set_data_page_row_count_limit(PAGE_ROWS)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true);
        let schema = Arc::new(SchemaDescriptor::new(Arc::new(schema)));
        let format = Format::Parquet { schema, properties: Arc::new(properties.build()) };
        Ok(Self { columns: columns.into(), format })
    }

    /// Number of rows of a complete group.
    pub fn group(&self) -> usize {
        let most = match self.format {
            Format::Csv => TEXT_ROWS,
            Format::Parquet { .. } => GROUP_ROWS,
        };
        (GROUP_NUMBERS / self.columns.len()).clamp(1, most)
    }

    /// An empty buffer for the rows of a group.
    pub fn rows(&self) -> Rows {
        Rows { width: self.columns.len(), most: self.group(), length: 0, numbers: Vec::new() }
    }

    /// Header line of a CSV table.
    pub fn header(&self) -> io::Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.columns.iter().map(|column| &column.name))?;
        writer.into_inner().map_err(|e| io::Error::other(e.to_string()))
    }

    /// Number of pieces of these rows.
    pub fn pieces(&self, rows: &Rows) -> usize {
        match self.format {
            Format::Csv => rows.length.div_ceil(PIECE_ROWS),
            Format::Parquet { .. } if rows.length == 0 => 0,
            Format::Parquet { .. } => self.columns.len(),
        }
    }

    /// Encodes all pieces on the threads of rayon's current pool.
    pub fn encode(&self, rows: &Rows) -> io::Result<Vec<Piece>> {
        (0..self.pieces(rows)).into_par_iter().map(|k| self.piece(rows, k)).collect()
    }

    /// Encodes piece number `k`.
    pub fn piece(&self, rows: &Rows, k: usize) -> io::Result<Piece> {
        match &self.format {
            Format::Csv => self.text(rows, k * PIECE_ROWS),
            Format::Parquet { schema, properties } => {
                let column = &self.columns[k];
                let encoded = if column.words.is_empty() {
                    numbers(k, rows, schema, properties)
                } else {
                    words::encode(column, k, rows, schema)
                };
                encoded.map_err(plain)
            }
        }
    }

    fn text(&self, rows: &Rows, from: usize) -> io::Result<Piece> {
        let until = rows.length.min(from + PIECE_ROWS);
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut number = String::new();
        for row in from..until {
            for (c, column) in self.columns.iter().enumerate() {
                let chunk = row - row % CHUNK;
                let value = rows.numbers[chunk * rows.width + c * CHUNK + row % CHUNK];
                if column.words.is_empty() {
                    number.clear();
                    let _ = write!(number, "{value}"); // writing into a String does not fail
                    writer.write_field(&number)?;
                } else {
                    writer.write_field(column.spell(value))?;
                }
            }
            writer.write_record(None::<&[u8]>)?;
        }
        writer.into_inner().map(Piece::Text).map_err(|e| io::Error::other(e.to_string()))
    }
}

/// Encodes one column of numbers of a row group as Parquet.
fn numbers(
    k: usize,
    rows: &Rows,
    schema: &SchemaDescPtr,
    properties: &WriterPropertiesPtr,
) -> Result<Piece, ParquetError> {
    let mut sink = TrackedWrite::new(Vec::with_capacity(rows.length * size_of::<f64>()));
    let pages = Box::new(SerializedPageWriter::new(&mut sink));
    let mut writer = get_column_writer(schema.column(k), Arc::clone(properties), pages);
    let ColumnWriter::DoubleColumnWriter(out) = &mut writer else {
        return Err(ParquetError::General("a column must have numbers or words".into()));
    };
    let mut numbers = Vec::with_capacity(BATCH_ROWS);
    for from in (0..rows.length).step_by(BATCH_ROWS) {
        numbers.clear();
        rows.column(k, from, rows.length.min(from + BATCH_ROWS)).for_each(|some| numbers.extend_from_slice(some));
        out.write_batch(&numbers, None, None)?;
    }
    let mut close = writer.close()?;
    // Statistics without the deprecated min and max fields: the reader drops these, so a copy of the column would differ.
    if let Some(Statistics::Double(told)) = close.metadata.statistics() {
        let told = Statistics::Double(told.clone().with_backwards_compatible_min_max(false));
        close.metadata = close.metadata.into_builder().set_statistics(told).build()?;
    }
    Ok(Piece::Column(sink.into_inner()?.into(), Box::new(close)))
}

/// The error of the file system, without the wrapper of the Parquet crate.
pub(super) fn plain(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => inner.downcast::<io::Error>().map_or_else(io::Error::other, |own| *own),
        other => other.into(),
    }
}

//! Encoding of a column of words as Parquet: a dictionary page with all words, and data pages with their indices.
//!
//! The Parquet crate looks up every value in a hash table of the words. Here a value is an index already, so that a row costs a
//! few bits of output: 3 columns of words took a quarter of the time of a map.
//!
//! A data page is one byte with the number of bits of an index, then runs: either `count << 1` and the index that is repeated,
//! or `groups << 1 | 1` and 8 indices per group, least significant bits first (encoding RLE_DICTIONARY of the Parquet format).

use super::column::Column;
use super::encode::{CHUNK, PAGE_ROWS, Piece, Rows};
use parquet::basic::{Compression, Encoding, PageType};
use parquet::column::page::{CompressedPage, Page, PageWriter};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, PageEncodingStats};
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::SchemaDescPtr;

/// Compression of columns of words.
pub(super) const COMPRESSION: Compression = Compression::UNCOMPRESSED;

/// Encodes column `k` of a row group.
pub(super) fn encode(column: &Column, k: usize, rows: &Rows, schema: &SchemaDescPtr) -> Result<Piece, ParquetError> {
    let mut sink = TrackedWrite::new(Vec::new());
    let mut pages = SerializedPageWriter::new(&mut sink);
    // Numbers without a word are the empty text, which may be one of the words: a table that is read back must give the same bytes.
    let empty = column.words.iter().position(String::is_empty);
    let none = empty.unwrap_or(column.words.len());
    let words = column.words.len() + usize::from(empty.is_none());
    let mut dictionary = Vec::new();
    for word in column.words.iter().map(String::as_str).chain([""]).take(words) {
        let length = u32::try_from(word.len()).map_err(|e| ParquetError::External(e.into()))?;
        dictionary.extend_from_slice(&length.to_le_bytes());
        dictionary.extend_from_slice(word.as_bytes());
    }
    let size = dictionary.len();
    let page = Page::DictionaryPage {
        buf: dictionary.into(),
        num_values: count(words)?,
        encoding: Encoding::PLAIN,
        is_sorted: false,
    };
    let first = pages.write_page(CompressedPage::new(page, size))?;
    let bits = (usize::BITS - (words - 1).leading_zeros()).max(1);
    let (mut total, mut data_offset, mut data_pages) = ([first.uncompressed_size, first.compressed_size], None, 0);
    for from in (0..rows.length()).step_by(PAGE_ROWS) {
        let until = rows.length().min(from + PAGE_ROWS);
        let mut runs = Runs::new(bits);
        for values in rows.column(k, from, until) {
            let mut places = [none as u64; CHUNK];
            for (place, x) in places.iter_mut().zip(values) {
                *place = column.place(*x).unwrap_or(none) as u64;
            }
            runs.add(&places[..values.len()]);
        }
        let bytes = runs.finish();
        let size = bytes.len();
        let page = Page::DataPage {
            buf: bytes.into(),
            num_values: count(until - from)?,
            encoding: Encoding::RLE_DICTIONARY,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        };
        let page = pages.write_page(CompressedPage::new(page, size))?;
        data_offset.get_or_insert(page.offset);
        total = [total[0] + page.uncompressed_size, total[1] + page.compressed_size];
        data_pages += 1;
    }
    pages.close()?;
    let stats = |page_type, encoding, count| PageEncodingStats { page_type, encoding, count };
    let metadata = ColumnChunkMetaData::builder(schema.column(k))
        .set_compression(COMPRESSION)
        .set_encodings(vec![Encoding::PLAIN, Encoding::RLE, Encoding::RLE_DICTIONARY])
        .set_page_encoding_stats(vec![
            stats(PageType::DICTIONARY_PAGE, Encoding::PLAIN, 1),
            stats(PageType::DATA_PAGE, Encoding::RLE_DICTIONARY, data_pages),
        ])
        .set_total_uncompressed_size(total[0] as i64)
        .set_total_compressed_size(total[1] as i64)
        .set_num_values(rows.length() as i64)
        .set_data_page_offset(data_offset.unwrap_or(0) as i64)
        .set_dictionary_page_offset(Some(first.offset as i64))
        .build()?;
    let close = ColumnCloseResult {
        bytes_written: total[1] as u64,
        rows_written: rows.length() as u64,
        metadata,
        bloom_filter: None,
        column_index: None,
        offset_index: None,
    };
    Ok(Piece::Column(sink.into_inner()?.into(), Box::new(close)))
}

fn count(n: usize) -> Result<u32, ParquetError> {
    u32::try_from(n).map_err(|e| ParquetError::External(e.into()))
}

/// The runs of a data page.
struct Runs {
    bits: u32,
    bytes: Vec<u8>,
    /// The index that is repeated at the end, and how often.
    alike: (u64, usize),
    /// Groups of eight at the end, and their bytes.
    groups: usize,
    packed: Vec<u8>,
}

impl Runs {
    fn new(bits: u32) -> Self {
        Self { bits, bytes: vec![bits as u8], alike: (0, 0), groups: 0, packed: Vec::new() }
    }

    /// Adds the indices of a chunk. All chunks but the last have a multiple of eight.
    #[inline]
    fn add(&mut self, places: &[u64]) {
        let Some(&first) = places.first() else { return };
        if places.iter().all(|place| *place == first) {
            self.end_groups();
            if self.alike.0 != first {
                self.end_alike();
            }
            self.alike = (first, self.alike.1 + places.len());
            return;
        }
        self.end_alike();
        self.groups += places.len().div_ceil(8);
        let (mut held, mut size) = (0_u64, 0);
        for group in places.chunks(8) {
            for i in 0..8 {
                held |= group.get(i).copied().unwrap_or(0) << size;
                size += self.bits;
                while size >= 8 {
                    self.packed.push(held as u8);
                    (held, size) = (held >> 8, size - 8);
                }
            }
        }
    }

    fn end_alike(&mut self) {
        let (place, length) = std::mem::take(&mut self.alike);
        if length > 0 {
            self.header((length as u64) << 1);
            self.bytes.extend_from_slice(&place.to_le_bytes()[..self.bits.div_ceil(8) as usize]);
        }
    }

    fn end_groups(&mut self) {
        if self.groups > 0 {
            self.header((self.groups as u64) << 1 | 1);
            self.bytes.append(&mut self.packed);
            self.groups = 0;
        }
    }

    /// A number in groups of seven bits, the least significant first.
    fn header(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }

    fn finish(mut self) -> Vec<u8> {
        self.end_alike();
        self.end_groups();
        self.bytes
    }
}

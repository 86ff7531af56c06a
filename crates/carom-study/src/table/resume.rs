//! The rows that an unfinished Parquet table holds.

use super::column::Column;
use super::encode::{Encoder, Rows, plain};
use super::{GroupEnd, other_columns};
use parquet::column::reader::ColumnReader;
use parquet::column::writer::ColumnCloseResult;
use parquet::data_type::ByteArray;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::serialized_reader::ReadOptionsBuilder;
use parquet::file::writer::SerializedFileWriter;
use std::fs::File;
use std::io::{self, BufWriter};
use std::sync::Arc;

/// Copies the complete groups of a Parquet table written by this module into another table, and the rows of its last,
/// incomplete group into `rest`. Returns the ends of the copied groups.
pub(super) fn take_groups(
    from: File,
    into: &mut SerializedFileWriter<BufWriter<File>>,
    encoder: &Encoder,
    rest: &mut Rows,
) -> io::Result<Vec<GroupEnd>> {
    // read all metadata of a column, so that its copy is identical
    let options = ReadOptionsBuilder::new().with_encoding_stats_as_mask(false).build();
    let file = SerializedFileReader::new_with_options(from.try_clone()?, options).map_err(plain)?;
    let schema = file.metadata().file_metadata().schema_descr_ptr();
    let mine = into.schema_descr();
    let alike = |(a, b): (&Arc<_>, &Arc<_>)| a == b;
    if schema.num_columns() != mine.num_columns() || !schema.columns().iter().zip(mine.columns()).all(alike) {
        return Err(other_columns());
    }
    let (mut taken, mut ends) = (0, Vec::new());
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
        ends.push(GroupEnd::of(into, taken));
    }
    Ok(ends)
}

/// Decodes a row group into rows.
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
            return Err(io::Error::other("a row group is shorter than its metadata states"));
        }
    }
    for r in 0..rows {
        into.push(&held.iter().map(|column| column[r]).collect::<Vec<_>>());
    }
    Ok(())
}

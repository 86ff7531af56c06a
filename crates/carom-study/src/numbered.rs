//! Writes tables whose rows are functions of their number, in parts and with resumption: maps, cycles, basins, ensembles.
//!
//! Rows are computed in parallel, written in the order of their numbers, in constant memory. All work runs on the threads of rayon's
//! current pool. While the rows of one group are computed, the previous group is encoded, column by column, and the one before that is
//! written. Rows are computed in blocks whose length adapts to their computing time, so that an interruption takes effect soon. The bytes
//! of the file do not depend on the blocks, because a row is a function of its number and the table determines the groups.
//!
//! A run that is interrupted, or cannot write on, as on a full disk, leaves `X.partial.parquet`, a valid table of the rows so far,
//! and the metadata needed to resume in `X.partial.parquet.json`. To resume, complete groups are copied as bytes (of a CSV file
//! everything), the rows of the last group are decoded, and the remaining rows are computed. The result is byte-identical to that
//! of an uninterrupted run.

use crate::table::{CHUNK, Rows, partial};
use crate::{Column, Part, Table, TableError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Target computing time of a block.
const BLOCK_TIME: Duration = Duration::from_millis(100);
/// Greatest number of chunks in one task of rayon.
const MOST_CHUNKS: usize = 4;

/// A table whose rows are functions of their number: a [map](crate::map_study::Study), [cycles](crate::orbit::Cycles), a
/// [basin](crate::orbit::Basin), an [ensemble](crate::Ensemble).
pub trait NumberedRows: Sync {
    /// The columns.
    fn columns(&self) -> &[Column];

    /// Number of rows of the whole table.
    fn rows(&self) -> u64;

    /// Row numbers of part `part` of `parts`, counted from 1. The parts are consecutive, and their lengths differ by at most one row. `None`
    /// unless `1 ≤ part ≤ parts`.
    fn shard(&self, part: u64, parts: u64) -> Option<Range<u64>> {
        shard(self.rows(), part, parts)
    }

    /// Computes and writes the rows `file.rows`. `progress` is called with the number of rows that have been computed since its last call,
    /// from several threads; setting `stop` ends the run early and leaves a partial table.
    ///
    /// # Errors
    /// [`RowsError`]: a file cannot be written, another process writes it, or the partial table cannot be resumed.
    /// [`RowsError::Incomplete`] if a partial table is left.
    ///
    /// # Panics
    /// If `file.rows` ends beyond the last row.
    fn write(&self, file: &RowFile, progress: &(dyn Fn(u64) + Sync), stop: &AtomicBool) -> Result<Written, RowsError>
    where
        Self: Sized,
    {
        assert!(file.rows.end <= self.rows(), "rows {:?} of {}", file.rows, self.rows());
        let mut table = Table::create_with(&file.path, self.columns())?;
        let (key, text) = self.text();
        table.describe(key, text);
        let writing = Writing { source: self, file, progress, stop };
        let done = if file.resume { writing.take_over(&mut table)? } else { 0 };
        progress(done);
        let mut next = file.rows.start + done;
        let written = writing.go_on(&mut table, &mut next);
        let written = if next < file.rows.end { written } else { written.and_then(|()| table.complete()) };
        if written.is_err() || next < file.rows.end {
            return writing.leave(table, done, written);
        }
        table.keep()?;
        // What an interrupted run has left is older than the table now.
        let _ = std::fs::remove_file(file.partial());
        let _ = std::fs::remove_file(file.note());
        Ok(Written::Whole)
    }

    /// Key and text of the metadata of a Parquet file.
    #[doc(hidden)]
    fn text(&self) -> (&'static str, &str);

    /// What the rows are computed from: its name in messages, and its text.
    #[doc(hidden)]
    fn sources(&self) -> Vec<(String, String)>;

    /// Number of rows that a block needs in order to keep all threads busy.
    #[doc(hidden)]
    fn least(&self) -> usize {
        CHUNK
    }

    /// Computes the rows of a block, or the first of them if `stop` is set meanwhile; returns how many are computed.
    #[doc(hidden)]
    fn compute(&self, block: Block) -> usize;
}

/// Consecutive rows to be computed.
pub struct Block<'b> {
    /// Number of the first row.
    pub first: u64,
    /// Number of rows.
    pub count: usize,
    /// Chunks of rows, stored column by column: see [`Rows::grow`].
    pub chunks: &'b mut [f64],
    /// Number of columns.
    pub width: usize,
    /// Is called with numbers of rows that are done.
    pub progress: &'b (dyn Fn(u64) + Sync),
    pub stop: &'b AtomicBool,
}

impl Block<'_> {
    /// Computes the rows one by one; `row` gets the number of a row. Each thread has an evaluator of its own. Returns the number of rows, or 0
    /// if `stop` is set.
    pub fn each<E>(
        self,
        evaluator: impl Fn() -> E + Sync + Send,
        row: impl Fn(&mut E, u64, &mut [f64]) + Sync + Send,
    ) -> usize {
        let Self { first, count, chunks, width, progress, stop } = self;
        chunks.par_chunks_mut(CHUNK * width).enumerate().with_max_len(MOST_CHUNKS).for_each_init(
            || (evaluator(), vec![0.0; width]),
            |(evaluator, numbers), (k, chunk)| {
                if stop.load(Ordering::Relaxed) {
                    return;
                }
                let here = CHUNK.min(count - k * CHUNK);
                for r in 0..here {
                    row(evaluator, first + (k * CHUNK + r) as u64, numbers);
                    numbers.iter().enumerate().for_each(|(c, x)| chunk[c * CHUNK + r] = *x);
                }
                progress(here as u64);
            },
        );
        if stop.load(Ordering::Relaxed) { 0 } else { count }
    }

    /// Computes something of each row [in order](in_order), and tells the progress.
    pub fn map<R: Send>(&self, of_row: impl Fn(u64) -> R + Sync) -> Vec<R> {
        in_order(self.first..self.first + self.count as u64, self.stop, |number| {
            let done = of_row(number);
            (self.progress)(1);
            done
        })
    }

    /// Sets the row `place` of the block, counted from 0.
    pub fn set(&mut self, place: usize, row: &[f64]) {
        let begin = (place - place % CHUNK) * self.width + place % CHUNK;
        row.iter().enumerate().for_each(|(c, x)| self.chunks[begin + c * CHUNK] = *x);
    }
}

/// Computes something of each row in parallel, in the order of the rows; of the first ones if `stop` is set meanwhile: each thread takes the next
/// row, so that no row is missing before one that is done.
pub(crate) fn in_order<R: Send>(rows: Range<u64>, stop: &AtomicBool, of_row: impl Fn(u64) -> R + Sync) -> Vec<R> {
    let next = AtomicU64::new(rows.start);
    let work = |_: rayon::BroadcastContext<'_>| {
        let mut own = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= rows.end {
                break;
            }
            own.push((number, of_row(number)));
        }
        own
    };
    let mut done: Vec<(u64, R)> = rayon::broadcast(work).into_iter().flatten().collect();
    done.sort_unstable_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, row)| row).collect()
}

/// Output file of a table whose rows have numbers.
#[derive(Debug, Clone)]
pub struct RowFile {
    /// Path of the table; the extension, `.csv` or `.parquet`, selects the format.
    pub path: PathBuf,
    /// Row numbers to write: all, or a shard.
    pub rows: Range<u64>,
    /// Resume from the partial table of an interrupted run, if there is one.
    pub resume: bool,
}

/// How the writing of rows ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Written {
    /// All rows were written.
    Whole,
    /// The run was stopped.
    Interrupted {
        /// Number of rows in the partial table.
        rows: u64,
        /// Path of the partial table.
        partial: PathBuf,
    },
}

/// Metadata of an interrupted run, compared on resuming.
#[derive(Serialize, Deserialize, PartialEq)]
struct Note {
    carom: String,
    sources: Vec<(String, String)>,
    first: u64,
    end: u64,
    /// Number of rows in the partial table.
    rows: u64,
    /// Length of the partial table, bytes.
    bytes: u64,
    /// CRC-32 of its bytes.
    checksum: u32,
}

impl RowFile {
    /// Path of the partial table that an interrupted run leaves: `X.partial.parquet` for `X.parquet`.
    pub fn partial(&self) -> PathBuf {
        partial(&self.path)
    }

    fn note(&self) -> PathBuf {
        let mut name = self.partial().into_os_string();
        name.push(".json");
        name.into()
    }
}

/// Reason why the rows of a table are not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RowsError {
    /// The table cannot be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The table cannot be written to its end, as on a full disk; the rows before it are kept.
    #[error(
        "{error}; the first {rows} rows are kept in {}: mend this, then run it again with --resume (in Python resume=True)",
        partial.display()
    )]
    Incomplete {
        /// Why the table cannot be written.
        error: TableError,
        /// Number of rows in the partial table.
        rows: u64,
        /// The partial table.
        partial: PathBuf,
    },
    /// The partial table of an interrupted run cannot be resumed.
    #[error("{}: the interrupted run cannot be resumed: {reason}", file.display())]
    Resume {
        /// The partial table or its metadata file.
        file: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The metadata file of a partial table cannot be written.
    #[error("{}: cannot be written: {reason}", file.display())]
    Beside {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        reason: io::Error,
    },
}

/// [`NumberedRows::shard`] of so many rows.
pub(crate) fn shard(rows: u64, part: u64, parts: u64) -> Option<Range<u64>> {
    let until = |part: u64| (u128::from(rows) * u128::from(part) / u128::from(parts)) as u64;
    (1..=parts).contains(&part).then(|| until(part - 1)..until(part))
}

/// A table that is being written.
struct Writing<'w, N> {
    source: &'w N,
    file: &'w RowFile,
    progress: &'w (dyn Fn(u64) + Sync),
    stop: &'w AtomicBool,
}

impl<N: NumberedRows> Writing<'_, N> {
    /// Computes and writes the rows from `next` on.
    fn go_on(&self, table: &mut Table, next: &mut u64) -> Result<(), TableError> {
        let encoder = table.encoder().clone();
        let (mut filling, mut full) = (table.take_held(), encoder.rows());
        let (mut rows, mut pieces) = (0, Ok(Vec::new()));
        let mut length = self.least();
        loop {
            let ready = std::mem::replace(&mut pieces, Ok(Vec::new()));
            // rows last: their tasks are small and balance the load
            let ((written, encoded), ()) = rayon::join(
                || rayon::join(|| table.append(rows, ready), || encoder.encode(&full)),
                || self.fill(&mut filling, next, &mut length),
            );
            written?;
            if full.length() == 0 && filling.length() == 0 {
                return Ok(());
            }
            (rows, pieces) = (full.length(), encoded);
            full.clear();
            std::mem::swap(&mut filling, &mut full);
        }
    }

    /// The least length of a block: whole chunks.
    fn least(&self) -> usize {
        self.source.least().next_multiple_of(CHUNK)
    }

    /// Computes rows from `next` on until the group is full, the last row is reached, or `stop` is set, in blocks of about `length` rows.
    fn fill(&self, rows: &mut Rows, next: &mut u64, length: &mut usize) {
        let Self { source, file, progress, stop } = *self;
        let width = source.columns().len();
        while rows.room() > 0 && *next < file.rows.end && !stop.load(Ordering::Relaxed) {
            let room = rows.room().min(*length);
            let count = usize::try_from(file.rows.end - *next).map_or(room, |left| room.min(left));
            let begun = Instant::now();
            let (first, before) = (*next, rows.length());
            let compute =
                |count, chunks: &mut [f64]| source.compute(Block { first, count, chunks, width, progress, stop });
            // A run that was interrupted has left a part of a chunk.
            let left = before.next_multiple_of(CHUNK) - before;
            if left > 0 {
                let mut chunk = vec![0.0; CHUNK * width];
                for r in 0..compute(count.min(left), &mut chunk) {
                    let row: Vec<f64> = (0..width).map(|c| chunk[c * CHUNK + r]).collect();
                    rows.push(&row);
                }
            } else {
                let done = compute(count, rows.grow(count));
                rows.truncate(before + done);
            }
            *next += (rows.length() - before) as u64;
            if begun.elapsed() < BLOCK_TIME {
                *length = (2 * *length).min(1 << 20).max(self.least());
            } else if begun.elapsed() > 4 * BLOCK_TIME {
                *length = (*length / 2).max(self.least());
            }
        }
    }

    fn note(&self, rows: u64, (bytes, checksum): (u64, u32)) -> Note {
        Note {
            carom: env!("CARGO_PKG_VERSION").into(),
            sources: self.source.sources(),
            first: self.file.rows.start,
            end: self.file.rows.end,
            rows,
            bytes,
            checksum,
        }
    }

    /// Leaves the partial table and its metadata. `written` is the error that has ended the run, if one has; `done` the number of
    /// rows of the partial table that it has resumed, which stays if no more rows can be kept.
    fn leave(&self, table: Table, done: u64, written: Result<(), TableError>) -> Result<Written, RowsError> {
        let file = self.file;
        let partial = file.partial();
        let mut note = None;
        let left = table.leave(&partial, done, |temporary, rows| {
            let text = serde_json::to_string_pretty(&self.note(rows, sum(temporary)?))?;
            let part = Part::unique(&file.note())?;
            part.file().write_all(text.as_bytes())?;
            note = Some(part);
            Ok(())
        });
        let named = |reason| RowsError::Beside { file: file.note(), reason };
        let left = match (left, note) {
            (Ok(rows), Some(note)) => note.keep().map(|()| Ok(rows)).map_err(named)?,
            (left, _) => left,
        };
        match (written, left) {
            (Ok(()), Ok(rows)) => Ok(Written::Interrupted { rows, partial }),
            (Err(error), Ok(rows)) => Err(RowsError::Incomplete { error, rows, partial }),
            (Err(error), Err(_)) | (Ok(()), Err(error)) if done > 0 => {
                Err(RowsError::Incomplete { error, rows: done, partial })
            }
            (Err(error), Err(_)) | (Ok(()), Err(error)) => Err(error.into()),
        }
    }

    /// Copies the partial table of an interrupted run. Returns its number of rows.
    fn take_over(&self, table: &mut Table) -> Result<u64, RowsError> {
        let (partial, beside) = (self.file.partial(), self.file.note());
        if !partial.exists() {
            return Ok(0);
        }
        let refuse = |file: &Path, reason: String| RowsError::Resume { file: file.to_owned(), reason };
        let again = "run without --resume to start again";
        let text = std::fs::read_to_string(&beside).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let left: Note = serde_json::from_str(&text).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let ours = self.note(left.rows, (left.bytes, left.checksum));
        if left != ours {
            let changed = ours.sources.iter().find(|source| !left.sources.contains(source));
            let what = match changed {
                Some((name, _)) => name.as_str(),
                None if left.carom != ours.carom => "the version of carom",
                None => "the shard",
            };
            return Err(refuse(&beside, format!("{what} has changed since; {again}")));
        }
        let (length, checksum) = sum(&partial).map_err(|e| refuse(&partial, e.to_string()))?;
        if length != left.bytes {
            let reason = format!("it has {length} bytes instead of the {} that were written; {again}", left.bytes);
            return Err(refuse(&partial, reason));
        }
        if checksum != left.checksum {
            return Err(refuse(&partial, format!("its bytes are not those that were written; {again}")));
        }
        table.take_over(&partial, left.rows).map_err(|error| match error.raw_os_error() {
            // a full disk, say: the partial table is as it was
            Some(_) => refuse(&partial, error.to_string()),
            None => refuse(&partial, format!("{error}; {again}")),
        })?;
        Ok(left.rows)
    }
}

/// Names and checksums of the files from which rows are computed.
pub(crate) fn checksums(files: &[PathBuf]) -> impl Iterator<Item = (String, String)> {
    files.iter().map(|file| {
        // A file that has vanished since is not the one that was read.
        let sum = std::fs::read(file).map_or_else(|e| e.to_string(), |bytes| crc32fast::hash(&bytes).to_string());
        (file.display().to_string(), sum)
    })
}

/// Length and CRC-32 of a file.
fn sum(path: &Path) -> io::Result<(u64, u32)> {
    let (mut file, mut hasher) = (File::open(path)?, crc32fast::Hasher::new());
    let (mut length, mut buffer) = (0, vec![0; 1 << 16]);
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok((length, hasher.finalize()));
        }
        hasher.update(&buffer[..count]);
        length += count as u64;
    }
}

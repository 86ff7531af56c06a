//! Writes a map to a file: computed in parallel, written in the order of the rows, in constant memory.
//!
//! All work runs on the threads of rayon's current pool. While the rows of one group are computed, the previous group is
//! encoded, column by column, and the one before that is written. Rows are computed in blocks whose length adapts to their
//! computing time, so that an interruption takes effect soon. The bytes of the file do not depend on the blocks, because
//! a row is a function of its number and the table determines the groups.
//!
//! A run that is interrupted, or cannot write on, as on a full disk, leaves `X.partial.parquet`, a valid table of the rows so far,
//! and the metadata needed to resume in `X.partial.parquet.json`. To resume, complete groups are copied as bytes (of a CSV file
//! everything), the rows of the last group are decoded, and the remaining rows are computed. The result is byte-identical to that
//! of an uninterrupted run.

use super::{Study, StudyError};
use crate::table::{CHUNK, Rows, partial};
use crate::{Part, STUDY_KEY, Table, TableError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Target computing time of a block.
const BLOCK_TIME: Duration = Duration::from_millis(100);
/// Greatest number of chunks in one task of rayon.
const MOST_CHUNKS: usize = 4;

/// Output file of a map.
#[derive(Debug, Clone)]
pub struct MapFile {
    /// Path of the table; the extension, `.csv` or `.parquet`, selects the format.
    pub path: PathBuf,
    /// Row numbers to write: all, or a shard.
    pub rows: Range<u64>,
    /// Resume from the partial table of an interrupted run, if there is one.
    pub resume: bool,
}

/// How [`Study::write`] ended.
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
    study: String,
    urdf: String,
    first: u64,
    end: u64,
    /// Number of rows in the partial table.
    rows: u64,
    /// Length of the partial table, bytes.
    bytes: u64,
    /// CRC-32 of its bytes.
    checksum: u32,
}

impl MapFile {
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

impl Study {
    /// Computes and writes the rows `file.rows` of the map. `progress` is called with the number of rows that have been
    /// computed since its last call, from several threads; setting `stop` ends the run early and leaves a partial table.
    ///
    /// # Errors
    /// [`StudyError`]: a file cannot be written, another process writes it, or the partial table cannot be resumed.
    /// [`StudyError::Incomplete`] if a partial table is left.
    ///
    /// # Panics
    /// If `file.rows` ends beyond [`Study::rows`].
    pub fn write(
        &self,
        file: &MapFile,
        progress: &(dyn Fn(u64) + Sync),
        stop: &AtomicBool,
    ) -> Result<Written, StudyError> {
        assert!(file.rows.end <= self.rows, "rows {:?} of {}", file.rows, self.rows);
        let mut table = Table::create_with(&file.path, &self.columns)?;
        table.describe(STUDY_KEY, &self.text);
        let done = if file.resume { self.take_over(file, &mut table)? } else { 0 };
        progress(done);
        let mut next = file.rows.start + done;
        let written = self.go_on(&mut table, &mut next, file.rows.end, progress, stop);
        let written = if next < file.rows.end { written } else { written.and_then(|()| table.complete()) };
        if written.is_err() || next < file.rows.end {
            return self.leave(file, table, done, written);
        }
        table.keep()?;
        if file.resume {
            // their rows are in the map now
            let _ = std::fs::remove_file(file.partial());
            let _ = std::fs::remove_file(file.note());
        }
        Ok(Written::Whole)
    }

    /// Computes and writes the rows from `next` on.
    fn go_on(
        &self,
        table: &mut Table,
        next: &mut u64,
        end: u64,
        progress: &(dyn Fn(u64) + Sync),
        stop: &AtomicBool,
    ) -> Result<(), TableError> {
        let encoder = table.encoder().clone();
        let (mut filling, mut full) = (table.take_held(), encoder.rows());
        let (mut rows, mut pieces) = (0, Ok(Vec::new()));
        let mut length = CHUNK;
        loop {
            let ready = std::mem::replace(&mut pieces, Ok(Vec::new()));
            // rows last: their tasks are small and balance the load
            let ((written, encoded), ()) = rayon::join(
                || rayon::join(|| table.append(rows, ready), || encoder.encode(&full)),
                || self.fill(&mut filling, next, end, &mut length, progress, stop),
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

    /// Computes rows from `next` on until the group is full, the last row is reached, or `stop` is set. Blocks of about
    /// `length` rows are kept completely or discarded.
    fn fill(
        &self,
        rows: &mut Rows,
        next: &mut u64,
        end: u64,
        length: &mut usize,
        progress: &(dyn Fn(u64) + Sync),
        stop: &AtomicBool,
    ) {
        let width = self.columns.len();
        while rows.room() > 0 && *next < end && !stop.load(Ordering::Relaxed) {
            let room = rows.room().min(*length);
            let count = usize::try_from(end - *next).map_or(room, |left| room.min(left));
            let begun = Instant::now();
            let (before, first) = (rows.length(), *next);
            rows.grow(count).par_chunks_mut(CHUNK * width).enumerate().with_max_len(MOST_CHUNKS).for_each_init(
                || (self.evaluator(), vec![0.0; width]),
                |(evaluator, row), (k, chunk)| {
                    if stop.load(Ordering::Relaxed) {
                        return; // the block is discarded
                    }
                    let here = CHUNK.min(count - k * CHUNK);
                    for r in 0..here {
                        evaluator.row(first + (k * CHUNK + r) as u64, row);
                        row.iter().enumerate().for_each(|(c, x)| chunk[c * CHUNK + r] = *x);
                    }
                    progress(here as u64);
                },
            );
            if stop.load(Ordering::Relaxed) {
                return rows.truncate(before);
            }
            *next += count as u64;
            if begun.elapsed() < BLOCK_TIME {
                *length = (2 * *length).min(1 << 20);
            } else if begun.elapsed() > 4 * BLOCK_TIME {
                *length = (*length / 2).max(CHUNK);
            }
        }
    }

    fn note(&self, file: &MapFile, rows: u64, (bytes, checksum): (u64, u32)) -> Note {
        Note {
            carom: env!("CARGO_PKG_VERSION").into(),
            study: self.text.clone(),
            urdf: self.urdf.clone(),
            first: file.rows.start,
            end: file.rows.end,
            rows,
            bytes,
            checksum,
        }
    }

    /// Leaves the partial table and its metadata. `written` is the error that has ended the run, if one has; `done` the number of
    /// rows of the partial table that it has resumed, which stays if no more rows can be kept.
    fn leave(
        &self,
        file: &MapFile,
        table: Table,
        done: u64,
        written: Result<(), TableError>,
    ) -> Result<Written, StudyError> {
        let partial = file.partial();
        let mut note = None;
        let left = table.leave(&partial, done, |temporary, rows| {
            let text = serde_json::to_string_pretty(&self.note(file, rows, sum(temporary)?))?;
            let part = Part::unique(&file.note())?;
            part.file().write_all(text.as_bytes())?;
            note = Some(part);
            Ok(())
        });
        let named = |reason| StudyError::Beside { file: file.note(), reason };
        let left = match (left, note) {
            (Ok(rows), Some(note)) => note.keep().map(|()| Ok(rows)).map_err(named)?,
            (left, _) => left,
        };
        match (written, left) {
            (Ok(()), Ok(rows)) => Ok(Written::Interrupted { rows, partial }),
            (Err(error), Ok(rows)) => Err(StudyError::Incomplete { error, rows, partial }),
            (Err(error), Err(_)) | (Ok(()), Err(error)) if done > 0 => {
                Err(StudyError::Incomplete { error, rows: done, partial })
            }
            (Err(error), Err(_)) | (Ok(()), Err(error)) => Err(error.into()),
        }
    }

    /// Copies the partial table of an interrupted run. Returns its number of rows.
    fn take_over(&self, file: &MapFile, table: &mut Table) -> Result<u64, StudyError> {
        let (partial, beside) = (file.partial(), file.note());
        if !partial.exists() {
            return Ok(0);
        }
        let refuse = |file: &Path, reason: String| StudyError::Resume { file: file.to_owned(), reason };
        let again = "run without --resume to start again";
        let text = std::fs::read_to_string(&beside).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let left: Note = serde_json::from_str(&text).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let ours = self.note(file, left.rows, (left.bytes, left.checksum));
        if left != ours {
            let what = if left.study != ours.study {
                "the study file"
            } else if left.urdf != ours.urdf {
                "the robot's file"
            } else if left.carom != ours.carom {
                "the version of carom"
            } else {
                "the shard"
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

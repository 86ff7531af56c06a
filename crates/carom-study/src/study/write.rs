//! A map on its way into a file: computed by all threads, written in the order of its rows, in constant memory.
//!
//! The threads of rayon's current pool do all of it: while rows of a group are computed, the group before is encoded, column
//! by column, and the one before that is written. Rows are computed in blocks whose length follows the time that they
//! take, so that an interruption is heeded soon; the file's bytes don't depend on it, since rows are a function of their
//! number and groups are counted by the table.
//!
//! An interrupted run leaves `X.partial.parquet`, a whole table of the rows that are done, and a note beside it,
//! `X.partial.parquet.json`, which says of what. To resume, whole groups are copied as bytes (of CSV everything), the rows of
//! the last group are read back, and the rest is computed: the result has the bytes of a run that was never interrupted.

use super::{Study, StudyError};
use crate::Table;
use crate::table::{CHUNK, Rows};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A block takes about this time.
const BLOCK_TIME: Duration = Duration::from_millis(100);
/// Most chunks that one thread computes before others may help it.
const MOST_CHUNKS: usize = 4;

/// Where a map goes.
#[derive(Debug, Clone)]
pub struct MapFile {
    /// `.csv` or `.parquet`.
    pub path: PathBuf,
    /// The rows wanted: all, or a shard.
    pub rows: Range<u64>,
    /// Go on with what an interrupted run left, if it left something.
    pub resume: bool,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Written {
    /// All rows are there.
    Whole,
    /// It was stopped.
    Interrupted {
        /// How many rows are there.
        rows: u64,
        /// Where.
        partial: PathBuf,
    },
}

/// Of what an interrupted run is the beginning.
#[derive(Serialize, Deserialize, PartialEq)]
struct Note {
    carom: String,
    study: String,
    urdf: String,
    first: u64,
    end: u64,
    /// Rows that are done.
    rows: u64,
    /// Length of the table that holds them.
    bytes: u64,
}

impl MapFile {
    /// Where an interrupted run leaves what is done: `X.partial.parquet` for `X.parquet`.
    pub fn partial(&self) -> PathBuf {
        let ending = self.path.extension().unwrap_or_default().to_string_lossy().into_owned();
        self.path.with_extension(format!("partial.{ending}"))
    }

    fn note(&self) -> PathBuf {
        let mut name = self.partial().into_os_string();
        name.push(".json");
        name.into()
    }
}

impl Study {
    /// Writes the map, or the part of it that `file.rows` says. `progress` hears of rows as they are done (from several
    /// threads), `stop` ends the run early.
    ///
    /// # Errors
    /// [`StudyError`]: a file that can't be written, or not resumed. Nothing is left behind then.
    ///
    /// # Panics
    /// If `file.rows` goes beyond [`Study::rows`].
    pub fn write(
        &self,
        file: &MapFile,
        progress: &(dyn Fn(u64) + Sync),
        stop: &AtomicBool,
    ) -> Result<Written, StudyError> {
        assert!(file.rows.end <= self.rows, "rows {:?} of {}", file.rows, self.rows);
        let mut table = Table::create_with(&file.path, &self.columns)?;
        let done = if file.resume { self.take_over(file, &mut table)? } else { 0 };
        progress(done);
        let mut next = file.rows.start + done;
        self.go_on(&mut table, &mut next, file.rows.end, progress, stop)?;
        if next < file.rows.end {
            return self.leave(file, table, next - file.rows.start);
        }
        table.finish()?;
        if file.resume {
            // What they hold is in the map now.
            let _ = std::fs::remove_file(file.partial());
            let _ = std::fs::remove_file(file.note());
        }
        Ok(Written::Whole)
    }

    /// Computes rows from `next` on and writes them.
    fn go_on(
        &self,
        table: &mut Table,
        next: &mut u64,
        end: u64,
        progress: &(dyn Fn(u64) + Sync),
        stop: &AtomicBool,
    ) -> Result<(), StudyError> {
        let encoder = table.encoder().clone();
        let (mut filling, mut full) = (table.take_held(), encoder.rows());
        let mut pieces = Ok(Vec::new());
        let mut length = CHUNK;
        loop {
            let ready = std::mem::replace(&mut pieces, Ok(Vec::new()));
            // Rows last: they come in small parts, so that whoever is free first takes of them, and all end together.
            let ((written, encoded), ()) = rayon::join(
                || rayon::join(|| table.append(ready), || encoder.encode(&full)),
                || self.fill(&mut filling, next, end, &mut length, progress, stop),
            );
            written?;
            if full.length() == 0 && filling.length() == 0 {
                return Ok(());
            }
            pieces = encoded;
            full.clear();
            std::mem::swap(&mut filling, &mut full);
        }
    }

    /// Computes rows from `next` on until the group is full, or the end is there, or a stop. Blocks of about `length` rows
    /// are there as a whole or not at all.
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
                        return; // this block is thrown away
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

    fn note(&self, file: &MapFile, rows: u64, bytes: u64) -> Note {
        Note {
            carom: env!("CARGO_PKG_VERSION").into(),
            study: self.text.clone(),
            urdf: self.urdf.clone(),
            first: file.rows.start,
            end: file.rows.end,
            rows,
            bytes,
        }
    }

    /// Leaves what is done, and the note of what it is.
    fn leave(&self, file: &MapFile, table: Table, rows: u64) -> Result<Written, StudyError> {
        let (partial, beside) = (file.partial(), file.note());
        table.finish_at(&partial)?;
        let trouble = |reason| StudyError::Beside { file: beside.clone(), reason };
        let bytes = std::fs::metadata(&partial).map_err(trouble)?.len();
        let text = serde_json::to_string_pretty(&self.note(file, rows, bytes)).map_err(|e| trouble(e.into()))?;
        write_beside(&beside, text.as_bytes()).map_err(trouble)?;
        Ok(Written::Interrupted { rows, partial })
    }

    /// Copies what an interrupted run left; how many rows that were.
    fn take_over(&self, file: &MapFile, table: &mut Table) -> Result<u64, StudyError> {
        let (partial, beside) = (file.partial(), file.note());
        if !partial.exists() {
            return Ok(0);
        }
        let refuse = |file: &Path, reason: String| StudyError::Resume { file: file.to_owned(), reason };
        let again = "run without --resume to begin again";
        let text = std::fs::read_to_string(&beside).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let left: Note = serde_json::from_str(&text).map_err(|e| refuse(&beside, format!("{e}; {again}")))?;
        let ours = self.note(file, left.rows, left.bytes);
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
            return Err(refuse(&beside, format!("{what} is not what it was; {again}")));
        }
        let length = std::fs::metadata(&partial).map_err(|e| refuse(&partial, e.to_string()))?.len();
        if length != left.bytes {
            let reason = format!("it has {length} bytes, and its note says {}; {again}", left.bytes);
            return Err(refuse(&partial, reason));
        }
        match table.take_over(&partial) {
            Err(error) => Err(refuse(&partial, format!("{error}; {again}"))),
            Ok(Some(rows)) if rows != left.rows => {
                Err(refuse(&partial, format!("it holds {rows} rows, and its note says {}; {again}", left.rows)))
            }
            Ok(_) => Ok(left.rows),
        }
    }
}

/// Writes a file beside its place and moves it there.
fn write_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    std::fs::write(&part, bytes)?;
    std::fs::rename(&part, path).inspect_err(|_| {
        let _ = std::fs::remove_file(&part);
    })
}

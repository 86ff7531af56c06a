//! A map on its way into a file: computed by all threads, written in the order of its rows, in constant memory.
//!
//! The threads of rayon's current pool compute a block while the block before it is written. How long a block is follows
//! the time that it takes, so that an interruption is heeded soon; the file's bytes don't depend on it, since rows are a
//! function of their number and row groups are counted by the table.
//!
//! An interrupted run leaves `X.partial.parquet`, a whole table of the rows that are done, and a note beside it,
//! `X.partial.parquet.json`, which says of what. To resume, the rows are copied over and the rest is computed: the result
//! has the bytes of a run that was never interrupted.

use super::{Study, StudyError};
use crate::table::read_table;
use crate::{Table, TableError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Rows that a thread computes before it looks up.
const CHUNK: usize = 64;
/// Most numbers of a block: three blocks of 4 MB are under way at most.
const BLOCK_NUMBERS: usize = 1 << 19;
/// A block takes about this time.
const BLOCK_TIME: Duration = Duration::from_millis(100);

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
        let width = self.columns.len();
        let most = (BLOCK_NUMBERS / width).max(CHUNK) as u64;
        let mut length = CHUNK as u64;
        std::thread::scope(|scope| {
            let (full, blocks) = mpsc::sync_channel::<Vec<f64>>(1);
            let (empty, used) = mpsc::channel::<Vec<f64>>();
            let writer = scope.spawn(move || -> Result<(), TableError> {
                for block in blocks {
                    block.chunks_exact(width).try_for_each(|row| table.row(row))?;
                    let _ = empty.send(block);
                }
                Ok(())
            });
            while *next < end && !stop.load(Ordering::Relaxed) {
                let rows = length.min(end - *next);
                let mut block = used.try_recv().unwrap_or_default();
                block.resize(rows as usize * width, 0.0);
                let begun = Instant::now();
                let first = *next;
                block.par_chunks_mut(CHUNK * width).enumerate().for_each_init(
                    || self.evaluator(),
                    |evaluator, (chunk, rows)| {
                        if stop.load(Ordering::Relaxed) {
                            return; // this block is thrown away
                        }
                        let from = first + (chunk * CHUNK) as u64;
                        for (index, row) in (from..).zip(rows.chunks_exact_mut(width)) {
                            evaluator.row(index, row);
                        }
                        progress((rows.len() / width) as u64);
                    },
                );
                // The writer has gone if a write failed; its error is told below.
                if stop.load(Ordering::Relaxed) || full.send(block).is_err() {
                    break;
                }
                *next += rows;
                if begun.elapsed() < BLOCK_TIME {
                    length = (2 * length).min(most);
                } else if begun.elapsed() > 4 * BLOCK_TIME {
                    length = (length / 2).max(CHUNK as u64);
                }
            }
            drop(full);
            match writer.join() {
                Ok(written) => Ok(written?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }

    fn note(&self, file: &MapFile, rows: u64) -> Note {
        Note {
            carom: env!("CARGO_PKG_VERSION").into(),
            study: self.text.clone(),
            urdf: self.urdf.clone(),
            first: file.rows.start,
            end: file.rows.end,
            rows,
        }
    }

    /// Leaves what is done, and the note of what it is.
    fn leave(&self, file: &MapFile, table: Table, rows: u64) -> Result<Written, StudyError> {
        let (partial, beside) = (file.partial(), file.note());
        table.finish_at(&partial)?;
        let trouble = |reason| StudyError::Beside { file: beside.clone(), reason };
        let text = serde_json::to_string_pretty(&self.note(file, rows)).map_err(|e| trouble(e.into()))?;
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
        let ours = self.note(file, left.rows);
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
        let mut rows = 0;
        let mut failed = None;
        let read = read_table(&partial, &self.columns, &mut |row| {
            rows += 1;
            table.row(row).map_err(|e| {
                failed = Some(e);
                io::Error::other("the map can't be written")
            })
        });
        match (failed, read) {
            (Some(error), _) => Err(error.into()),
            (None, Err(error)) => Err(refuse(&partial, format!("{error}; {again}"))),
            (None, Ok(())) if rows != left.rows => {
                Err(refuse(&partial, format!("it holds {rows} rows, and its note says {}; {again}", left.rows)))
            }
            (None, Ok(())) => Ok(rows),
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

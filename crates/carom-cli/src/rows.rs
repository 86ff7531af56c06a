//! Tables whose rows have numbers: the options and files that maps, cycles and basins share.

use crate::error::CliError;
use crate::files::Outputs;
use crate::output::{Bar, say};
use carom_study::{NumberedRows, RowFile, Written};
use clap::Args;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[derive(Args)]
pub struct RowOptions {
    /// Number of threads, 1 or more [default: one for each core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Compute part I of N only, 1 ≤ I ≤ N; the parts in order are the whole table
    #[arg(long, value_name = "I/N", value_parser = parse_shard, requires = "out")]
    shard: Option<(u64, u64)>,
    /// Continue from the partial file of an interrupted run, if there is one
    #[arg(long, requires = "out")]
    resume: bool,
}

fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
    match numbers {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err("write part/parts, counted from 1, like 3/64".into()),
    }
}

/// Progress of so many rows.
pub fn bar(rows: u64) -> Bar {
    Bar::new(Some(rows), "{bar:40} {human_pos}/{human_len} rows, {per_sec}, {eta} left")
}

impl RowOptions {
    /// The option that was given, if one was.
    pub fn given(&self) -> Option<&'static str> {
        let given =
            [("--threads", self.threads.is_some()), ("--shard", self.shard.is_some()), ("--resume", self.resume)];
        given.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The one table of the outputs.
    ///
    /// # Errors
    /// [`CliError::Input`]: several tables, a table on standard output, options that do not fit the outputs.
    pub fn table<'f>(&self, files: &'f Outputs) -> Result<Option<&'f Path>, CliError> {
        let table = match files.tables.as_slice() {
            [] => None,
            [one] if one == Path::new("-") => {
                let why = "--out -: the table can be resumed from its file: give the name of a table, .csv or .parquet";
                return Err(CliError::Input(why.into()));
            }
            [one] => Some(one.as_path()),
            [one, other, ..] => {
                let (one, other) = (one.display(), other.display());
                return Err(CliError::Input(format!("--out {other}: --out {one} is a table too: give one")));
            }
        };
        if self.shard.is_some() && (files.picture.is_some() || files.recording.is_some()) {
            let why = "--shard: a picture and a recording are of the whole table: give tables only, or no --shard";
            return Err(CliError::Input(why.into()));
        }
        if table.is_none() && (self.shard.is_some() || self.resume) {
            let option = if self.resume { "--resume" } else { "--shard" };
            return Err(CliError::Input(format!("{option} is for a table: give --out X.csv or --out X.parquet")));
        }
        Ok(table)
    }

    /// The threads.
    ///
    /// # Errors
    /// [`CliError::Input`] if they cannot be made.
    pub fn pool(&self) -> Result<rayon::ThreadPool, CliError> {
        let threads = self.threads.unwrap_or(0); // 0: as many as there are cores
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
        pool.map_err(|e| CliError::Input(format!("--threads: {e}")))
    }

    /// Numbers of the rows of a table that are asked for.
    pub fn rows(&self, of: &impl NumberedRows) -> Range<u64> {
        self.shard.and_then(|(part, parts)| of.shard(part, parts)).unwrap_or(0..of.rows())
    }

    /// Writes rows of a table to a file.
    ///
    /// # Errors
    /// [`CliError::Input`] of the file, or [`CliError::Interrupted`].
    pub fn write(
        &self,
        of: &impl NumberedRows,
        (path, rows): (&Path, Range<u64>),
        (pool, stop): (&rayon::ThreadPool, &AtomicBool),
    ) -> Result<(), CliError> {
        let total = rows.end - rows.start;
        if let (Some((part, parts)), 0) = (self.shard, total) {
            say(&format!("warning: --shard {part}/{parts}: it has no row, there are fewer rows than parts"));
        }
        let file = RowFile { path: path.to_owned(), rows, resume: self.resume };
        let left = file.partial();
        if !self.resume && left.exists() {
            say(&format!(
                "warning: {} is the partial file of an interrupted run and will be replaced: --resume would continue from it",
                left.display()
            ));
        }
        let bar = bar(total);
        match pool.install(|| of.write(&file, &|rows| bar.inc(rows), stop))? {
            Written::Whole => Ok(()),
            Written::Interrupted { rows, partial } => Err(CliError::Interrupted { rows, total, partial }),
        }
    }
}

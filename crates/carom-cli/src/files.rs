//! Checks of the files that a command reads and writes, made before any work: no output replaces an input or another
//! output, and every output has an existing folder that can be written to. Interruptions.

use crate::error::CliError;
use crate::output::say;
use carom_study::{Part, remove_unfinished};
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Refuses outputs, each named by its option, that are no files, have no folder, or are an input or another output.
pub fn check(reads: &[PathBuf], writes: &[(&str, Option<&Path>)]) -> Result<(), CliError> {
    let refuse = |(option, path): (&str, &Path), why: String| {
        Err(CliError::Input(format!("{option} {}: {why}", path.display())))
    };
    let mut taken: Vec<(&str, &Path, PathBuf)> = Vec::new();
    for (option, path) in writes.iter().filter_map(|(option, path)| Some((*option, (*path)?))) {
        check_parent(option, path)?;
        let (Some(name), false) = (path.file_name(), path.exists() && !path.is_file()) else {
            return refuse((option, path), "it is a folder or a device: give the name of a file".into());
        };
        let own = place(path, name).map_err(|e| CliError::unwritable(path, &e))?;
        // An input that cannot be found is not read.
        if reads.iter().any(|read| read.canonicalize().is_ok_and(|read| read == own)) {
            return refuse(
                (option, path),
                "the command reads this file and would replace it: give another name".into(),
            );
        }
        if let Some((other, theirs, _)) = taken.iter().find(|(_, _, theirs)| *theirs == own) {
            let theirs = theirs.display();
            return refuse((option, path), format!("{other} {theirs} names the same file: give each its own"));
        }
        taken.push((option, path, own));
    }
    // Last, so that nothing is made in any folder if an option is refused.
    taken.iter().try_for_each(|(_, path, _)| Part::unique(path).map(drop).map_err(|e| CliError::unwritable(path, &e)))
}

/// The files of `--out` by what they hold: the ending of a name says it.
#[derive(Default)]
pub struct Outputs {
    /// Tables: .csv, .parquet, or - for CSV on standard output.
    pub tables: Vec<PathBuf>,
    /// Picture: .svg.
    pub picture: Option<PathBuf>,
    /// Recording: .rrd.
    pub recording: Option<PathBuf>,
    /// Scene: .toml.
    pub scene: Option<PathBuf>,
}

/// What an output of a command holds.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    Table,
    Picture,
    Recording,
    Scene,
}

impl Kind {
    /// Its name in messages, and the endings of its files.
    fn named(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Table => ("table", &["csv", "parquet"]),
            Self::Picture => ("picture", &["svg"]),
            Self::Recording => ("recording", &["rrd"]),
            Self::Scene => ("scene", &["toml"]),
        }
    }
}

impl Outputs {
    /// Sorts the files of `--out` of a command that writes these kinds.
    ///
    /// # Errors
    /// [`CliError::Input`]: another ending, or a second picture or recording.
    pub fn of(files: &[PathBuf], kinds: &[Kind]) -> Result<Self, CliError> {
        let mut all = Self::default();
        for path in files {
            let refuse = |why: String| Err(CliError::Input(format!("--out {}: {why}", path.display())));
            let ending = path.extension().map(|it| it.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
            let kind = kinds.iter().find(|kind| {
                let printed = **kind == Kind::Table && path == Path::new("-");
                printed || kind.named().1.contains(&ending.as_str())
            });
            let (what, slot) = match kind {
                Some(Kind::Table) => {
                    all.tables.push(path.clone());
                    continue;
                }
                Some(Kind::Picture) => ("picture", &mut all.picture),
                Some(Kind::Recording) => ("recording", &mut all.recording),
                Some(Kind::Scene) => ("scene", &mut all.scene),
                None => {
                    let one = |kind: &Kind| format!(".{} for a {}", kind.named().1.join(" or ."), kind.named().0);
                    let known = kinds.iter().map(one).collect::<Vec<_>>().join(", ");
                    return refuse(format!("the ending of the name says what is written: {known}"));
                }
            };
            if let Some(other) = slot.replace(path.clone()) {
                return refuse(format!("--out {} is a {what} too: give one", other.display()));
            }
        }
        Ok(all)
    }

    /// All files that are written, for [`check`].
    pub fn files(&self) -> Vec<(&'static str, Option<&Path>)> {
        let tables = self.tables.iter().filter(|path| *path != Path::new("-"));
        let others = self.picture.iter().chain(&self.recording).chain(&self.scene);
        tables.chain(others).map(|path| ("--out", Some(path.as_path()))).collect()
    }
}

/// Refuses a folder of `--out` that is a file or whose parent does not exist; the folder itself may be missing.
pub fn check_folder(path: &Path) -> Result<(), CliError> {
    if path.is_dir() {
        return Ok(());
    }
    if path.exists() {
        return Err(CliError::Input(format!("--out {}: it is a file: give a folder", path.display())));
    }
    check_parent("--out", path)
}

/// Refuses a folder that has some of these files but not all: they are not those of an earlier run, which are replaced.
pub fn check_own(option: &str, folder: &Path, names: &[&str]) -> Result<(), CliError> {
    let (there, missing): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| folder.join(name).exists());
    let ([one, ..], [other, ..]) = (there.as_slice(), missing.as_slice()) else { return Ok(()) };
    let folder = folder.display();
    Err(CliError::Input(format!(
        "{option} {folder}: it contains '{one}' but not '{other}', so it is not the folder of an earlier run, whose files are \
         replaced: give another folder"
    )))
}

fn check_parent(option: &str, path: &Path) -> Result<(), CliError> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    match parent.filter(|parent| !parent.is_dir()) {
        None => Ok(()),
        Some(missing) => {
            let (path, missing) = (path.display(), missing.display());
            Err(CliError::Input(format!("{option} {path}: there is no folder {missing}: make it first")))
        }
    }
}

/// Absolute path of a file that exists or will be written, with links resolved.
fn place(path: &Path, name: &OsStr) -> io::Result<PathBuf> {
    path.canonicalize().or_else(|_| {
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        Ok(parent.unwrap_or(Path::new(".")).canonicalize()?.join(name))
    })
}

/// When the command is interrupted or terminated, removes its temporary files, says so, and exits with status 1. The outputs
/// themselves are not touched: they are complete or not there.
pub fn clear_when_interrupted() {
    let handler = ctrlc::set_handler(|| {
        remove_unfinished();
        say("error: interrupted: nothing is written");
        std::process::exit(1);
    });
    // Without a handler an interruption ends the command at once, and the temporary files stay.
    let _ = handler;
}

/// A flag that is set by an interruption (SIGINT, SIGTERM); a second interruption ends the process.
pub fn interrupts() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    let handler = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            remove_unfinished();
            std::process::exit(1);
        }
    });
    if let Err(e) = handler {
        say(&format!("warning: interruptions cannot be caught ({e}): an interrupted run will leave no partial file"));
    }
    stop
}

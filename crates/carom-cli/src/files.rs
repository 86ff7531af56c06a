//! Checks of the files that a command reads and writes, made before any work: no output replaces an input or another
//! output, and every output has an existing folder.

use crate::error::CliError;
use crate::output::say;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

/// Refuses outputs, each named by its option, that are no files, have no folder, or are an input or another output.
pub fn check(reads: &[PathBuf], writes: &[(&str, Option<&Path>)]) -> Result<(), CliError> {
    let refuse = |(option, path): (&str, &Path), why: String| {
        Err(CliError::Option(format!("{option} {}: {why}", path.display())))
    };
    let mut taken: Vec<(&str, &Path, PathBuf)> = Vec::new();
    for (option, path) in writes.iter().filter_map(|(option, path)| Some((*option, (*path)?))) {
        check_parent(option, path)?;
        let (Some(name), false) = (path.file_name(), path.exists() && !path.is_file()) else {
            return refuse((option, path), "it is a folder or a device: give the name of a file".into());
        };
        let own = place(path, name).map_err(|reason| unwritable(path, reason))?;
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
    Ok(())
}

/// Refuses a folder for outputs that is a file or whose parent does not exist; the folder itself may be missing.
pub fn check_folder(option: &str, path: &Path) -> Result<(), CliError> {
    if path.is_dir() {
        return Ok(());
    }
    if path.exists() {
        return Err(CliError::Option(format!("{option} {}: it is a file: give a folder", path.display())));
    }
    check_parent(option, path)
}

fn check_parent(option: &str, path: &Path) -> Result<(), CliError> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    match parent.filter(|parent| !parent.is_dir()) {
        None => Ok(()),
        Some(missing) => {
            let (path, missing) = (path.display(), missing.display());
            Err(CliError::Option(format!("{option} {path}: there is no folder {missing}: make it first")))
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

fn unwritable(path: &Path, reason: io::Error) -> CliError {
    CliError::Unwritable { file: path.display().to_string(), reason }
}

/// When the command is interrupted or terminated, removes the temporary files beside these outputs, says so, and exits with
/// status 1. The outputs themselves are not touched: they are complete or not there.
pub fn clear_when_interrupted<'a>(writes: impl Iterator<Item = &'a Path>) {
    let parts: Vec<PathBuf> = writes
        .map(|path| {
            let mut name = path.file_name().unwrap_or_default().to_owned();
            name.push(".part");
            path.with_file_name(name)
        })
        .collect();
    let handler = ctrlc::set_handler(move || {
        for part in &parts {
            let _ = std::fs::remove_file(part);
        }
        say("error: interrupted: nothing is written");
        std::process::exit(1);
    });
    // Without a handler an interruption ends the command at once, and the temporary files stay.
    let _ = handler;
}

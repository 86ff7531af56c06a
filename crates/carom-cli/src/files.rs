//! Files that are whole or not there.

use crate::error::CliError;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A folder that gets files.
pub struct Folder(PathBuf);

impl Folder {
    /// Made if it is not there, before any long work.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        fs::create_dir_all(path).map_err(|e| refuse(path, &e))?;
        Ok(Self(path.to_owned()))
    }

    /// Writes all files beside their places, and then moves them there.
    pub fn write(&self, files: &[(&str, String)]) -> Result<(), CliError> {
        let part = |name: &str| self.0.join(format!("{name}.part"));
        for (name, text) in files {
            if let Err(e) = fs::write(part(name), text) {
                files.iter().for_each(|(name, _)| drop(fs::remove_file(part(name))));
                return Err(refuse(&self.0.join(name), &e));
            }
        }
        for (name, _) in files {
            let place = self.0.join(name);
            fs::rename(part(name), &place).map_err(|e| refuse(&place, &e))?;
        }
        Ok(())
    }
}

fn refuse(path: &Path, error: &io::Error) -> CliError {
    CliError::Option(format!("{}: cannot be written: {error}", path.display()))
}

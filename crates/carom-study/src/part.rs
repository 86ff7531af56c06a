//! Files that are complete or not there: written under a temporary name in the folder of their place, then renamed.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The temporary files of this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files of this process: for a program that ends at once, as after an interruption.
pub fn remove_unfinished() {
    for part in &*unfinished() {
        let _ = std::fs::remove_file(part);
    }
}

/// A file that is being written under a temporary name. [`Part::keep`] renames it; dropped before, it is removed.
///
/// Two processes that write one file have two temporary files, or the second is refused: a file under its own name is always
/// the whole of one of them.
#[derive(Debug)]
pub struct Part {
    path: PathBuf,
    part: PathBuf,
    file: File,
    kept: bool,
}

impl Part {
    /// A temporary file `X.csv.????????.part` for `X.csv`, of a name that no other has: for files that are written at the end of a
    /// computation. Of several writers the last one's file stays.
    ///
    /// # Errors
    /// The path is a folder, or its folder cannot be written to.
    pub fn unique(path: &Path) -> io::Result<Self> {
        let folder = check(path)?;
        loop {
            let part = folder.join(with_ending(path, &format!(".{:08x}.part", fastrand::u32(..))));
            match File::create_new(&part) {
                Err(taken) if taken.kind() == io::ErrorKind::AlreadyExists => {}
                made => return Ok(Self::own(path, part, made?)),
            }
        }
    }

    /// The temporary file `X.csv.part` for `X.csv`, locked: for files that are written during a computation. A file of this name
    /// that a process has left when it was killed is overwritten.
    ///
    /// # Errors
    /// As [`Part::unique`]; [`io::ErrorKind::ResourceBusy`] if another writer holds the lock.
    pub fn locked(path: &Path) -> io::Result<Self> {
        let folder = check(path)?;
        let part = folder.join(with_ending(path, ".part"));
        loop {
            let file = File::options().write(true).create(true).truncate(false).open(&part)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let why = "another process writes it: wait for its end, or give another name";
                    return Err(io::Error::new(io::ErrorKind::ResourceBusy, why));
                }
                Err(TryLockError::Error(_)) => {
                    // The file system has no locks, so nobody writes under this name.
                    let _ = std::fs::remove_file(&part);
                    return Self::unique(path);
                }
            }
            // Between opening and locking, its owner may have renamed or removed the file.
            let opened = same_file::Handle::from_file(file.try_clone()?)?;
            if same_file::Handle::from_path(&part).is_ok_and(|named| named == opened) {
                if file.metadata()?.len() > 0 {
                    file.set_len(0)?;
                }
                return Ok(Self::own(path, part, file));
            }
        }
    }

    fn own(path: &Path, part: PathBuf, file: File) -> Self {
        unfinished().insert(part.clone());
        Self { path: path.to_owned(), part, file, kept: false }
    }

    /// The place of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The temporary name.
    pub fn temporary(&self) -> &Path {
        &self.part
    }

    /// The temporary file, open for writing.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Renames the file to its place, where it replaces an older one.
    ///
    /// # Errors
    /// It cannot be renamed; the temporary file is removed then.
    pub fn keep(self) -> io::Result<()> {
        let path = self.path.clone();
        self.keep_as(&path)
    }

    /// As [`Part::keep`], under another name in the same folder.
    ///
    /// # Errors
    /// As [`Part::keep`].
    pub fn keep_as(mut self, path: &Path) -> io::Result<()> {
        std::fs::rename(&self.part, path)?;
        self.kept = true;
        Ok(())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Removed before the lock ends, which is when the file is closed.
        unfinished().remove(&self.part);
        if !self.kept {
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// Writes a file that is complete or not there.
///
/// # Errors
/// The path is a folder, or the file cannot be written; an older file stays then.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let part = Part::unique(path)?;
    part.file().write_all(bytes)?;
    part.keep()
}

/// The folder of a file. An early error if the path is a folder itself, before a long computation.
fn check(path: &Path) -> io::Result<&Path> {
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    Ok(folder.unwrap_or(Path::new(".")))
}

fn with_ending(path: &Path, ending: &str) -> OsString {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(ending);
    name
}

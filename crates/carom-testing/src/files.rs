//! Robots and scenes of the repository, and folders of a test.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The folder of the repository.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The path of a file of the repository.
pub fn path(of: &str) -> PathBuf {
    Path::new(ROOT).join(of)
}

/// The text of a file of the repository.
#[track_caller]
pub fn text(of: &str) -> String {
    std::fs::read_to_string(path(of)).unwrap_or_else(|why| panic!("{of}: {why}"))
}

/// A page of the book.
#[track_caller]
pub fn page(name: &str) -> String {
    text(&format!("book/src/{name}"))
}

/// What stands in backticks in the first cells of the table under a heading of a page, in order; a cell begins with such a name.
#[track_caller]
pub fn named(page: &str, heading: &str) -> Vec<String> {
    let mut lines = page.lines().skip_while(|line| *line != heading);
    assert!(lines.next().is_some(), "the page has no heading {heading}");
    let section = lines.take_while(|line| !line.starts_with('#'));
    let cells = section.filter_map(|line| line.strip_prefix("| `")?.split(" |").next());
    cells.flat_map(|cell| cell.split('`').step_by(2).filter(|name| !name.is_empty()).map(str::to_owned)).collect()
}

/// A robot of the repository.
#[track_caller]
pub fn robot(name: &str) -> Chain {
    Chain::from_urdf_file(path(&format!("robots/{name}.urdf"))).unwrap()
}

/// A robot of the repository, on a floating base or not.
#[track_caller]
pub fn robot_with(name: &str, floating_base: bool) -> Chain {
    let options = LoadOptions { floating_base, ..LoadOptions::default() };
    Chain::from_urdf_file_with(path(&format!("robots/{name}.urdf")), &options).unwrap()
}

/// A folder of one test, which is removed with the value.
#[derive(Debug)]
pub struct Folder(
    /// Its path.
    pub PathBuf,
);

impl Folder {
    /// An empty folder of its own.
    pub fn new() -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("carom-testing-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for temporary files");
        Self(folder)
    }

    /// Writes a file, and returns its path.
    #[track_caller]
    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().expect("a path in the folder")).expect("a folder");
        std::fs::write(&path, text).expect("a file in a folder of its own");
        path
    }

    /// The text of a file in the folder.
    #[track_caller]
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap_or_else(|why| panic!("{name}: {why}"))
    }

    /// Names of the files in a folder of the folder, in order; none if there is no such folder.
    pub fn files(&self, folder: &str) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.0.join(folder)) else { return Vec::new() };
        let mut names: Vec<String> = entries.map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Copies a file of the repository into the folder, under its own name.
    #[track_caller]
    pub fn copy(&self, of: &str) -> PathBuf {
        let name = Path::new(of).file_name().expect("a file");
        self.write(name.to_str().expect("a name in UTF-8"), text(of))
    }

    /// Makes folders of the repository appear in this one.
    #[cfg(unix)]
    #[track_caller]
    pub fn link(&self, folders: &[&str]) {
        for folder in folders {
            std::os::unix::fs::symlink(path(folder), self.0.join(folder)).expect("a link");
        }
    }
}

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}

impl std::ops::Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl AsRef<Path> for Folder {
    fn as_ref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What stays behind in the folder for temporary files does no harm.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

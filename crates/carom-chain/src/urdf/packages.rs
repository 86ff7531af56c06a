//! Search for mesh files: plain paths, `file://`, `package://` and `model://`.

use crate::error::ChainError;
use std::cell::OnceCell;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The file of a mesh: a path relative to `folder`, a `file://` path, or `package://NAME/…` (also `model://`), in a package as
/// [`find_package`] finds them.
///
/// # Errors
/// [`ChainError::MeshNotFound`] with the paths tried.
pub fn find_mesh(name: &str, folder: Option<&Path>, package_dirs: &[PathBuf]) -> Result<PathBuf, ChainError> {
    let found = Packages::new(folder, package_dirs).find(name);
    found.map_err(|tried| ChainError::MeshNotFound { name: name.into(), tried })
}

/// The folder of a package. Packages are searched for in `package_dirs`, in `folder` and those above it, in the folders of the environment
/// variable `ROS_PACKAGE_PATH`, and in `share` in those of `AMENT_PREFIX_PATH`. Each of these may be the package itself, which has the
/// name of its folder or that in its `package.xml`, or contain it; `package_dirs` and `ROS_PACKAGE_PATH` at any depth.
///
/// # Errors
/// [`ChainError::PackageNotFound`].
pub fn find_package(name: &str, folder: Option<&Path>, package_dirs: &[PathBuf]) -> Result<PathBuf, ChainError> {
    let packages = Packages::new(folder, package_dirs);
    let found = packages.named(name).next();
    found.ok_or_else(|| ChainError::PackageNotFound { name: name.into(), searched: packages.searched() })
}

/// The folders in which meshes are searched for.
pub(super) struct Packages {
    /// The folder of relative paths.
    base: Option<PathBuf>,
    /// In the order of the search.
    roots: Vec<Root>,
}

/// A folder that may be a package or contain some.
struct Root {
    folder: PathBuf,
    /// The packages in it at any depth, by name, once they are asked for; `None` for a folder in which they lie side by side.
    deep: Option<OnceCell<Vec<(String, PathBuf)>>>,
}

/// Depth of folders in which packages are searched for: links may lead in circles.
const DEPTH: usize = 8;

impl Packages {
    pub fn new(base_dir: Option<&Path>, package_dirs: &[PathBuf]) -> Self {
        let (ros, ament) = (std::env::var_os("ROS_PACKAGE_PATH"), std::env::var_os("AMENT_PREFIX_PATH"));
        Self::of(base_dir, package_dirs, ros.as_deref(), ament.as_deref())
    }

    fn of(base_dir: Option<&Path>, package_dirs: &[PathBuf], ros: Option<&OsStr>, ament: Option<&OsStr>) -> Self {
        // The folder of a bare file name is "".
        let base = base_dir.map(|dir| if dir == "" { PathBuf::from(".") } else { dir.to_path_buf() });
        let absolute = |dir: &PathBuf| std::path::absolute(dir).unwrap_or_else(|_| dir.clone());
        let given = package_dirs.iter().map(absolute).map(|folder| Root { folder, deep: Some(OnceCell::new()) });
        let whole = base.as_ref().map(absolute);
        let above = whole.iter().flat_map(|dir| dir.ancestors());
        let above = above.map(|folder| Root { folder: folder.into(), deep: None });
        let ros = ros.into_iter().flat_map(std::env::split_paths);
        let ros = ros.map(|folder| Root { folder, deep: Some(OnceCell::new()) });
        let ament = ament.into_iter().flat_map(std::env::split_paths);
        let ament = ament.map(|prefix| Root { folder: prefix.join("share"), deep: None });
        Self { roots: given.chain(above).chain(ros).chain(ament).collect(), base }
    }

    /// The folders of the packages with this name.
    fn named<'a>(&'a self, name: &'a str) -> impl Iterator<Item = PathBuf> + 'a {
        self.roots.iter().flat_map(move |root| root.named(name))
    }

    /// Where packages are searched for.
    fn searched(&self) -> String {
        let base = self.base.as_ref().map_or(String::new(), |dir| format!("in or above '{}', ", dir.display()));
        format!(
            "{base}in the package folders (--package-dir, LoadOptions::package_dirs), ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
        )
    }

    /// The file of a mesh name; otherwise a text that says which paths were tried.
    pub fn find(&self, name: &str) -> Result<PathBuf, String> {
        if let Some(inner) = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://")) {
            return self.find_in_package(inner);
        }
        let plain = name.strip_prefix("file://").unwrap_or(name);
        let path = match &self.base {
            _ if plain.contains("://") => return Err("only file://, package:// and model:// are supported".into()),
            Some(base) => base.join(plain),
            None if Path::new(plain).is_relative() => {
                return Err("the path is relative, and a URDF read from memory has no folder".into());
            }
            None => PathBuf::from(plain),
        };
        if path.is_file() { Ok(path) } else { Err(format!("tried '{}'", path.display())) }
    }

    fn find_in_package(&self, inner: &str) -> Result<PathBuf, String> {
        let (package, rest) = inner.split_once('/').unwrap_or((inner, ""));
        let mut files = Vec::new();
        for file in self.named(package).map(|folder| folder.join(rest)) {
            if file.is_file() {
                return Ok(file);
            }
            files.push(file);
        }
        if files.is_empty() {
            return Err(format!("there is no folder '{package}' {}", self.searched()));
        }
        let mut tried: Vec<String> = Vec::new();
        for file in files.iter().map(|file| format!("'{}'", file.display())) {
            if !tried.contains(&file) {
                tried.push(file);
            }
        }
        Err(format!("tried {}", tried.join(", ")))
    }
}

impl Root {
    /// The packages with this name, the nearest first.
    fn named<'a>(&'a self, name: &'a str) -> impl Iterator<Item = PathBuf> + 'a {
        let folder = &self.folder;
        let own = || folder.file_name() == Some(OsStr::new(name)) || name_of(folder).as_deref() == Some(name);
        let inside = folder.join(name);
        let near = [own().then(|| folder.clone()), inside.is_dir().then_some(inside)];
        let far = self.deep.iter().flat_map(|found| {
            found.get_or_init(|| {
                let mut all = Vec::new();
                collect(folder, DEPTH, &mut all);
                all
            })
        });
        near.into_iter().flatten().chain(far.filter(move |(own, _)| own == name).map(|(_, folder)| folder.clone()))
    }
}

/// The name in the `package.xml` of a folder.
fn name_of(folder: &Path) -> Option<String> {
    let text = std::fs::read_to_string(folder.join("package.xml")).ok()?;
    let document = roxmltree::Document::parse(&text).ok()?;
    let name = document.root_element().children().find(|child| child.has_tag_name("name"))?;
    Some(name.text()?.trim().to_owned())
}

/// Lists the packages in a folder, as ROS does: none lies in another, nor in a folder with a file that says so.
fn collect(folder: &Path, depth: usize, found: &mut Vec<(String, PathBuf)>) {
    if ["CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE"].iter().any(|file| folder.join(file).exists()) {
        return;
    }
    if let Some(name) = name_of(folder) {
        found.push((name, folder.into()));
        return;
    }
    let Some(depth) = depth.checked_sub(1) else { return };
    let hidden = |path: &Path| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    let inside = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut inside: Vec<PathBuf> = inside.filter(|path| path.is_dir() && !hidden(path)).collect();
    inside.sort();
    inside.iter().for_each(|folder| collect(folder, depth, found));
}

#[cfg(test)]
mod tests {
    use super::Packages;
    use std::path::{Path, PathBuf};

    /// Where a package lies, and what finds it.
    #[test]
    fn packages_are_found_by_option_and_by_the_paths_of_ros() {
        let top = std::env::temp_dir().join(format!("carom-ros-path-{}", std::process::id()));
        let [package, shared] = ["hand", "prefix/share/hand"].map(|folder| top.join(folder));
        for folder in [&package, &shared] {
            std::fs::create_dir_all(folder).unwrap();
            std::fs::write(folder.join("palm.stl"), "").unwrap();
        }
        let (plain, in_prefix) = (Ok(package.join("palm.stl")), Ok(shared.join("palm.stl")));
        let joined = |folders: &[PathBuf]| std::env::join_paths(folders).unwrap();
        let find = |given: &[PathBuf], ros: &[PathBuf], ament: &[PathBuf]| {
            Packages::of(None, given, Some(&joined(ros)), Some(&joined(ament))).find("package://hand/palm.stl")
        };
        let (top, prefix, other) = ([top.clone()], [top.join("prefix")], [top.join("other")]);
        let this = std::slice::from_ref(&package);
        assert_eq!(
            find(&[], &[other[0].clone(), top[0].clone()], &[]),
            plain,
            "ROS_PACKAGE_PATH: a folder of packages"
        );
        assert_eq!(find(&[], this, &[]), plain, "ROS_PACKAGE_PATH: the package itself");
        assert_eq!(find(&[], &[], &prefix), in_prefix, "AMENT_PREFIX_PATH");
        assert_eq!(find(&top, &[], &prefix), plain, "a given folder comes first");
        assert_eq!(find(this, &other, &prefix), plain, "a given folder that is the package itself");
        let none = "there is no folder 'hand' in the package folders (--package-dir, LoadOptions::package_dirs), \
                    ROS_PACKAGE_PATH or AMENT_PREFIX_PATH";
        assert_eq!(find(&other, &other, &top), Err(none.into()), "a prefix contains packages in share only");
        // A workspace: a package in a repository whose folder has another name, found by what its package.xml says.
        let source = top[0].join("src/repository/hand_v2");
        std::fs::create_dir_all(&source).unwrap();
        std::fs::write(source.join("package.xml"), "<package><name> grip </name></package>").unwrap();
        std::fs::write(source.join("palm.stl"), "").unwrap();
        let grip = |base: Option<&Path>, given: &[PathBuf], ros: &[PathBuf]| {
            Packages::of(base, given, Some(&joined(ros)), None).find("package://grip/palm.stl")
        };
        let palm = Ok(source.join("palm.stl"));
        assert_eq!(grip(None, &top, &[]), palm, "a given folder, at any depth");
        assert_eq!(grip(None, &[], &[top[0].join("src")]), palm, "ROS_PACKAGE_PATH, at any depth");
        assert_eq!(grip(Some(&source.join("urdf")), &[], &[]), palm, "the package in which the robot lies");
        std::fs::write(top[0].join("src/COLCON_IGNORE"), "").unwrap();
        assert!(grip(None, &top, &[]).is_err(), "a folder that is not to be searched");
        std::fs::remove_dir_all(&top[0]).unwrap();
    }
}

//! Search for mesh files: plain paths, `file://`, `package://` and `model://`.

use crate::error::ChainError;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The file of a mesh: a path relative to `folder`, a `file://` path, or `package://NAME/…` (also `model://`). Packages are
/// searched for in `package_dirs`, in `folder` and those above it, in the folders of the environment variable
/// `ROS_PACKAGE_PATH`, and in `share` in those of `AMENT_PREFIX_PATH`. Each of these may be the package itself or contain it.
///
/// # Errors
/// [`ChainError::MeshNotFound`] with the paths tried.
pub fn find_mesh(name: &str, folder: Option<&Path>, package_dirs: &[PathBuf]) -> Result<PathBuf, ChainError> {
    let found = Packages::new(folder, package_dirs).find(name);
    found.map_err(|tried| ChainError::MeshNotFound { name: name.into(), tried })
}

/// The folders in which meshes are searched for.
pub(super) struct Packages {
    /// The folder of relative paths.
    base: Option<PathBuf>,
    /// Folders that may be a package or contain one, in the order of the search.
    roots: Vec<PathBuf>,
}

impl Packages {
    pub fn new(base_dir: Option<&Path>, package_dirs: &[PathBuf]) -> Self {
        let (ros, ament) = (std::env::var_os("ROS_PACKAGE_PATH"), std::env::var_os("AMENT_PREFIX_PATH"));
        Self::of(base_dir, package_dirs, ros.as_deref(), ament.as_deref())
    }

    fn of(base_dir: Option<&Path>, package_dirs: &[PathBuf], ros: Option<&OsStr>, ament: Option<&OsStr>) -> Self {
        // The folder of a bare file name is "".
        let base = base_dir.map(|dir| if dir == "" { PathBuf::from(".") } else { dir.to_path_buf() });
        let absolute = |dir: &PathBuf| std::path::absolute(dir).unwrap_or_else(|_| dir.clone());
        let given = package_dirs.iter().map(absolute);
        let whole = base.as_ref().map(absolute);
        let above = whole.iter().flat_map(|dir| dir.ancestors()).map(Path::to_path_buf);
        let ros = ros.into_iter().flat_map(std::env::split_paths);
        let ament = ament.into_iter().flat_map(std::env::split_paths).map(|prefix| prefix.join("share"));
        Self { roots: given.chain(above).chain(ros).chain(ament).collect(), base }
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
        for root in &self.roots {
            let inside = root.join(package);
            let itself = root.file_name() == Some(OsStr::new(package));
            for dir in [itself.then(|| root.clone()), inside.is_dir().then_some(inside)].into_iter().flatten() {
                let file = dir.join(rest);
                if file.is_file() {
                    return Ok(file);
                }
                files.push(file);
            }
        }
        if files.is_empty() {
            let base = self.base.as_ref().map_or(String::new(), |dir| format!("in or above '{}', ", dir.display()));
            return Err(format!(
                "there is no folder '{package}' {base}in the package folders (--package-dir, LoadOptions::package_dirs), \
                 ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"
            ));
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

#[cfg(test)]
mod tests {
    use super::Packages;
    use std::path::PathBuf;

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
        std::fs::remove_dir_all(&top[0]).unwrap();
    }
}

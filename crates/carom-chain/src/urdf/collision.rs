//! Collision geometry: shapes, and paths of mesh files.

use super::joint::pose;
use super::robot::{Collision, Shape};
use super::source::{Source, own_children};
use super::warnings::Warnings;
use super::{LoadOptions, Meshes};
use crate::error::ChainError;
use nalgebra::Vector3;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The shapes of each link. With [`Meshes::Ignored`] a missing mesh is left out, with a warning.
///
/// # Errors
/// With [`Meshes::Required`], a missing mesh.
pub(super) fn collisions(
    source: &Source,
    urdf: &urdf_rs::Robot,
    base_dir: Option<&Path>,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Result<Vec<Vec<Collision>>, ChainError> {
    let folders = Folders::new(base_dir, std::env::var_os("ROS_PACKAGE_PATH").as_deref());
    let mut of_links = Vec::new();
    for (link, link_node) in urdf.links.iter().zip(source.links()) {
        let mut collisions = Vec::new();
        for (collision, node) in link.collision.iter().zip(own_children(link_node, "collision")) {
            let shape = match &collision.geometry {
                urdf_rs::Geometry::Box { size } => Shape::Box { size: size.0.into() },
                urdf_rs::Geometry::Sphere { radius } => Shape::Sphere { radius: *radius },
                urdf_rs::Geometry::Cylinder { radius, length } => Shape::Cylinder { radius: *radius, length: *length },
                urdf_rs::Geometry::Capsule { radius, length } => Shape::Capsule { radius: *radius, length: *length },
                urdf_rs::Geometry::Mesh { filename, scale } => match (folders.find(filename), options.meshes) {
                    (Ok(file), _) => {
                        Shape::Mesh { file, scale: scale.map_or(Vector3::repeat(1.0), |scale| scale.0.into()) }
                    }
                    (Err(tried), Meshes::Required) => {
                        let rule = format!(
                            "mesh '{filename}' is not found; {tried}. Correct the path, or load the robot without \
                             missing meshes: --no-meshes (LoadOptions::meshes)"
                        );
                        return Err(source.error(node, None, rule));
                    }
                    (Err(_), Meshes::Ignored) => {
                        warnings.odd(source, node, &format!("mesh '{filename}' is not found, left out"));
                        continue;
                    }
                },
            };
            collisions.push(Collision { name: collision.name.clone(), origin: pose(&collision.origin), shape });
        }
        of_links.push(collisions);
    }
    Ok(of_links)
}

/// The folders in which meshes are searched for.
struct Folders {
    /// The folder of the URDF.
    base: Option<PathBuf>,
    /// Folders that may be a package or contain one: the URDF's and those above it, then those of `ROS_PACKAGE_PATH`.
    packages: Vec<PathBuf>,
}

impl Folders {
    fn new(base_dir: Option<&Path>, ros_package_path: Option<&OsStr>) -> Self {
        // The folder of a bare file name is "".
        let base = base_dir.map(|dir| if dir == "" { PathBuf::from(".") } else { dir.to_path_buf() });
        let whole = base.as_ref().and_then(|dir| std::path::absolute(dir).ok());
        let above = whole.iter().flat_map(|dir| dir.ancestors()).map(Path::to_path_buf);
        let listed = ros_package_path.into_iter().flat_map(std::env::split_paths);
        Self { packages: above.chain(listed).collect(), base }
    }

    /// The file of a mesh name; otherwise a text that says which paths were tried.
    fn find(&self, name: &str) -> Result<PathBuf, String> {
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
        let itself = self.packages.iter().filter(|dir| dir.file_name() == Some(OsStr::new(package))).cloned();
        let inside = self.packages.iter().map(|dir| dir.join(package)).filter(|dir| dir.is_dir());
        let mut files: Vec<PathBuf> = itself.chain(inside).map(|dir| dir.join(rest)).collect();
        if let Some(found) = files.iter().find(|file| file.is_file()) {
            return Ok(found.clone());
        }
        if files.is_empty() {
            let base = self.base.as_ref().map_or(String::new(), |dir| format!("in or above '{}' or ", dir.display()));
            return Err(format!("there is no folder '{package}' {base}in ROS_PACKAGE_PATH"));
        }
        files.dedup();
        let tried: Vec<String> = files.iter().map(|file| format!("'{}'", file.display())).collect();
        Err(format!("tried {}", tried.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::Folders;

    #[test]
    fn packages_are_found_by_ros_package_path() {
        let top = std::env::temp_dir().join(format!("carom-ros-path-{}", std::process::id()));
        let package = top.join("hand");
        std::fs::create_dir_all(&package).unwrap();
        std::fs::write(package.join("palm.stl"), "").unwrap();
        let find = |folders: &[_]| {
            let path = std::env::join_paths(folders).unwrap();
            Folders::new(None, Some(&path)).find("package://hand/palm.stl")
        };
        assert_eq!(find(&[top.join("other"), top.clone()]), Ok(package.join("palm.stl")), "a folder of packages");
        assert_eq!(find(std::slice::from_ref(&package)), Ok(package.join("palm.stl")), "the package itself");
        assert_eq!(find(&[top.join("other")]), Err("there is no folder 'hand' in ROS_PACKAGE_PATH".into()));
        std::fs::remove_dir_all(&top).unwrap();
    }
}

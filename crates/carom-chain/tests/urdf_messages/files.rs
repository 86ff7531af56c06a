//! Messages about files: mesh paths, missing meshes, unreadable robots.

use crate::texts::*;
use carom_chain::ChainError;
use carom_chain::urdf::{self, LoadOptions, Meshes, Shape};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// A temporary folder, removed when the test ends.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("carom-urdf-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn write(&self, file: &str, text: &str) -> PathBuf {
        let file = self.0.join(file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, text).unwrap();
        file
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn mesh(name: &str) -> String {
    shape(&format!("<mesh filename='{name}' scale='1 2 3'/>"))
}

#[test]
fn mesh_paths_of_every_form_are_resolved() {
    let folder = Folder::new("found");
    let urdf = folder.write("arm_description/urdf/arm.urdf", "");
    let part = folder.write("arm_description/meshes/part one.stl", "");
    let other = folder.write("tools/gripper/x.stl", "");
    let beside = folder.write("arm_description/urdf/y.stl", "");
    let base = urdf.parent().unwrap();
    for (name, file) in [
        ("y.stl".to_string(), beside.clone()),
        ("../meshes/part one.stl".into(), base.join("../meshes/part one.stl")),
        (part.display().to_string(), part.clone()),
        (format!("file://{}", part.display()), part.clone()),
        ("package://arm_description/meshes/part one.stl".into(), part.clone()),
        ("model://tools/gripper/x.stl".into(), other),
    ] {
        std::fs::write(&urdf, mesh(&name)).unwrap();
        let robot = urdf::read_file(&urdf, &LoadOptions::default()).unwrap();
        let scale = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(robot.links[0].collisions[0].shape, Shape::Mesh { file, scale }, "{name}");
    }
}

#[test]
fn missing_meshes_are_errors_or_warnings_by_option() {
    let folder = Folder::new("missing");
    let urdf = folder.write("arm/arm.urdf", "");
    let base = urdf.parent().unwrap().display().to_string();
    let end = "Correct the path, or load the robot without missing meshes: --no-meshes (LoadOptions::meshes)";
    for (name, tried) in [
        ("x.stl", format!("tried '{base}/x.stl'")),
        ("file:///nowhere/x.stl", "tried '/nowhere/x.stl'".to_string()),
        ("package://arm/x.stl", format!("tried '{base}/x.stl'")),
        (
            "package://carom_no_such_package/x.stl",
            format!("there is no folder 'carom_no_such_package' in or above '{base}' or in ROS_PACKAGE_PATH"),
        ),
        ("http://host/x.stl", "only file://, package:// and model:// are supported".into()),
    ] {
        std::fs::write(&urdf, mesh(name)).unwrap();
        let error = urdf::read_file(&urdf, &LoadOptions::default()).unwrap_err();
        let file = urdf.display();
        assert_eq!(
            error.to_string(),
            format!("{file}:1: link 'a' <collision>: mesh '{name}' is not found; {tried}. {end}")
        );
    }
    refused(&[
        (
            mesh("x.stl"),
            "<string>:1: link 'a' <collision>: mesh 'x.stl' is not found; the path is relative, and a URDF read from memory has no folder. Correct the path, or load the robot without missing meshes: --no-meshes (LoadOptions::meshes)",
        ),
        (mesh(""), r#"<string>:1: link 'a' <mesh filename>: "" is empty: a name is needed"#),
    ]);

    let options = LoadOptions { meshes: Meshes::Ignored, ..Default::default() };
    let robot = urdf::read_str(&mesh("x.stl"), None, &options).unwrap();
    assert!(robot.links[0].collisions.is_empty());
    assert_eq!(robot.warnings, ["link 'a' <collision> (line 1): mesh 'x.stl' is not found, left out"]);
}

#[test]
fn unreadable_file_is_named_in_the_error() {
    let error = urdf::read_file("no/such/robot.urdf", &LoadOptions::default()).unwrap_err();
    assert!(matches!(&error, ChainError::Unreadable { path, .. } if path == Path::new("no/such/robot.urdf")));
    assert!(error.to_string().starts_with("no/such/robot.urdf: cannot be read: "), "{error}");
}

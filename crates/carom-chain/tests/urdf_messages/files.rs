//! Messages about files: mesh paths, missing meshes, unreadable robots.

use crate::urdf_messages::texts::*;
use carom_chain::ChainError;
use carom_chain::urdf::{self, LoadOptions, Meshes, Shape};
use carom_testing::files::Folder;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

fn mesh(name: &str) -> String {
    shape(&format!("<mesh filename='{name}' scale='1 2 3'/>"))
}

#[test]
fn mesh_paths_of_every_form_are_resolved() {
    let folder = Folder::new();
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

/// The name of a missing mesh, and where it was searched for.
fn missing(robot: &urdf::Robot) -> (String, String) {
    match &robot.links[0].collisions[0].shape {
        Shape::MissingMesh { name, tried } => (name.clone(), tried.clone()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn missing_meshes_are_warnings_left_out_by_option_and_refused_by_strict() {
    let folder = Folder::new();
    let urdf = folder.write("arm/arm.urdf", "");
    let base = urdf.parent().unwrap().display().to_string();
    let everywhere =
        "in the package folders (--package-dir, LoadOptions::package_dirs), ROS_PACKAGE_PATH or AMENT_PREFIX_PATH";
    for (name, tried) in [
        ("x.stl", format!("tried '{base}/x.stl'")),
        ("file:///nowhere/x.stl", "tried '/nowhere/x.stl'".to_string()),
        ("package://arm/x.stl", format!("tried '{base}/x.stl'")),
        (
            "package://carom_no_such_package/x.stl",
            format!("there is no folder 'carom_no_such_package' in or above '{base}', {everywhere}"),
        ),
        ("http://host/x.stl", "only file://, package:// and model:// are supported".into()),
    ] {
        std::fs::write(&urdf, mesh(name)).unwrap();
        let robot = urdf::read_file(&urdf, &LoadOptions::default()).unwrap();
        let text = format!("mesh '{name}' is not found; {tried}. The shape cannot be used in contacts");
        assert_eq!(robot.report.warnings, [format!("link 'a' <collision> (line 1): {text}")]);
        assert_eq!(missing(&robot), (name.to_owned(), tried));
        let strict = LoadOptions { strict: true, ..Default::default() };
        let error = urdf::read_file(&urdf, &strict).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{}:1: link 'a' <collision>: {text}", urdf.display())), "{error}");
    }
    let robot = read(&mesh("x.stl")).unwrap();
    assert_eq!(missing(&robot).1, "the path is relative, and a URDF read from memory has no folder");
    refused_texts(&[(mesh(""), r#"<string>:1: link 'a' <mesh filename>: "" is empty: a name is needed"#)]);

    let options = LoadOptions { meshes: Meshes::Ignored, strict: true, ..Default::default() };
    let robot = urdf::read_str(&mesh("x.stl"), None, &options).unwrap();
    assert!(robot.links[0].collisions.is_empty());
    assert_eq!(robot.report.unused, ["link 'a' <collision> (line 1): mesh 'x.stl' is not found, left out"]);
}

#[test]
fn packages_are_searched_for_in_given_folders_first() {
    let folder = Folder::new();
    let urdf = folder.write("arm/arm.urdf", mesh("package://parts/x.stl"));
    let near = folder.write("arm/parts/x.stl", "");
    let far = folder.write("elsewhere/parts/x.stl", "");
    let found = |package_dirs: Vec<PathBuf>| {
        let options = LoadOptions { package_dirs, ..Default::default() };
        match urdf::read_file(&urdf, &options).unwrap().links.remove(0).collisions.remove(0).shape {
            Shape::Mesh { file, .. } => file,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(found(vec![]), near);
    assert_eq!(found(vec![folder.0.join("elsewhere")]), far);
    let found = urdf::find_mesh("package://parts/x.stl", None, &[folder.0.join("elsewhere")]);
    assert_eq!(found, Ok(far));
    let error = urdf::find_mesh("package://parts/y.stl", Some(&folder.0.join("arm")), &[]).unwrap_err();
    let tried = near.with_file_name("y.stl");
    assert_eq!(error.to_string(), format!("mesh 'package://parts/y.stl' is not found; tried '{}'", tried.display()));
}

#[test]
fn unreadable_file_is_named_in_the_error() {
    let error = urdf::read_file("no/such/robot.urdf", &LoadOptions::default()).unwrap_err();
    assert!(matches!(&error, ChainError::Unreadable { path, .. } if path == Path::new("no/such/robot.urdf")));
    assert!(error.to_string().starts_with("no/such/robot.urdf: cannot be read: "), "{error}");
}

/// Visual shapes have their poses and the colours of their materials, by name or their own; what cannot be drawn is listed, also in
/// strict files, and changes nothing else.
#[test]
fn visual_shapes_are_kept_with_their_colours() {
    let folder = Folder::new();
    let mesh = folder.write("look/hull.dae", "");
    let text = "<robot name='r'><material name='red'><color rgba='1 0 0 1'/></material>
        <link name='a'>
          <visual><origin xyz='1 2 3' rpy='0 0 1'/><geometry><box size='1 2 3'/></geometry><material name='red'/></visual>
          <visual><geometry><mesh filename='package://look/hull.dae' scale='2 2 2'/></geometry>
            <material name='own'><color rgba='0 0.5 1 0.25'/></material></visual>
          <visual><geometry><sphere radius='0'/></geometry></visual>
          <visual><geometry><mesh filename='package://look/none.dae'/></geometry></visual>
          <visual><origin xyz='nan 0 0'/><geometry><sphere radius='1'/></geometry></visual>
          <visual><geometry><cylinder radius='0.1' length='0.2'/></geometry><material name='unknown'/></visual>
        </link></robot>";
    let urdf = folder.write("r.urdf", text);
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    let robot = urdf::read_file(&urdf, &strict).unwrap();
    assert_eq!(robot.report.unused, ["<visual> (3 times, first on line 6) is not used"]);
    let [cuboid, hull, cylinder] = robot.links[0].visuals.as_slice() else { panic!("{:?}", robot.links[0].visuals) };
    assert_eq!(
        (&cuboid.shape, cuboid.colour),
        (&Shape::Box { size: Vector3::new(1.0, 2.0, 3.0) }, Some([1.0, 0.0, 0.0, 1.0]))
    );
    assert_eq!(cuboid.origin.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    assert!((cuboid.origin.rotation.angle() - 1.0).abs() < 1e-15);
    assert_eq!(hull.shape, Shape::Mesh { file: mesh, scale: Vector3::repeat(2.0) });
    assert_eq!(hull.colour, Some([0.0, 0.5, 1.0, 0.25]));
    assert_eq!((&cylinder.shape, cylinder.colour), (&Shape::Cylinder { radius: 0.1, length: 0.2 }, None));
    assert!(robot.links[0].collisions.is_empty());
    let without = LoadOptions { meshes: Meshes::Ignored, ..LoadOptions::default() };
    assert_eq!(urdf::read_file(&urdf, &without).unwrap().links[0].visuals.len(), 2, "meshes are left out on request");
}

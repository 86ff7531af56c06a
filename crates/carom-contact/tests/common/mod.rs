//! Random bodies and poses; the tests fix the seeds.

use carom_chain::FrameId;
use carom_chain::urdf::{Collision, Shape};
use carom_contact::{LinkShape, Mesh, Obstacle};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::sync::atomic::{AtomicU64, Ordering};

pub fn vector(rng: &mut fastrand::Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0))
}

pub fn unit(rng: &mut fastrand::Rng) -> Vector3<f64> {
    loop {
        let v = vector(rng, 1.0);
        if v.norm() > 0.1 && v.norm() < 1.0 {
            return v.normalize();
        }
    }
}

pub fn isometry(rng: &mut fastrand::Rng, spread: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(unit(rng) * rng.f64() * 3.0);
    Isometry3::from_parts(Translation3::from(vector(rng, spread)), turn)
}

/// An arbitrary frame: these tests place the shapes themselves.
pub fn some_frame() -> FrameId {
    carom_chain::uniform_chain(1, 1.0, 1.0).unwrap().frame("link1").unwrap()
}

pub fn link_shape(shape: Shape) -> LinkShape {
    LinkShape::new("body", some_frame(), &Collision { name: None, origin: Isometry3::identity(), shape }).unwrap()
}

pub const KINDS: [&str; 5] = ["sphere", "capsule", "cylinder", "box", "hull"];

/// A body of a kind, with sizes from 0.05 to 0.3 m. A hull is that of random points in an OBJ file.
pub fn body(kind: &str, rng: &mut fastrand::Rng) -> LinkShape {
    let mut size = || 0.05 + 0.25 * rng.f64();
    link_shape(match kind {
        "sphere" => Shape::Sphere { radius: size() },
        "capsule" => Shape::Capsule { radius: size() / 2.0, length: size() },
        "cylinder" => Shape::Cylinder { radius: size(), length: size() },
        "box" => Shape::Box { size: Vector3::from_fn(|_, _| size()) },
        _ => return hull_of(&(0..30).map(|_| vector(rng, 0.15)).collect::<Vec<_>>(), rng.u64(..)),
    })
}

/// The convex hull of some points, at least three, through the OBJ file `hull-<number>-<count>.obj`.
pub fn hull_of(points: &[Vector3<f64>], number: u64) -> LinkShape {
    let mut text = String::new();
    for v in points {
        text += &format!("v {} {} {}\n", v.x, v.y, v.z);
    }
    for k in 3..=points.len() {
        text += &format!("f {} {} {k}\n", k - 2, k - 1);
    }
    // Tests of one process may make hulls of one number at the same time.
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let file = temp(&format!("hull-{number}-{}.obj", COUNT.fetch_add(1, Ordering::Relaxed)));
    std::fs::write(&file, text).unwrap();
    link_shape(Shape::Mesh { file, scale: Vector3::repeat(1.0) })
}

/// A path in a folder of this process.
pub fn temp(name: &str) -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("carom-contact-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// The twelve triangles of a box with sides `size`, oriented outwards.
pub fn box_mesh(size: Vector3<f64>) -> Mesh {
    let h = size / 2.0;
    let side = |bit: u32, h: f64| if bit == 0 { -h } else { h };
    let vertices = (0..8).map(|k| Vector3::new(side(k & 1, h.x), side(k & 2, h.y), side(k & 4, h.z))).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    Mesh::from_triangles(vertices, triangles).unwrap()
}

pub fn half_space(point: Vector3<f64>, normal: Vector3<f64>) -> Obstacle {
    Obstacle::half_space(point, normal).unwrap()
}

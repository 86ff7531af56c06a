//! Gaps to meshes, compared with gaps to their triangles and to the bodies that they bound.

use crate::common::*;
use carom_chain::urdf::Shape;
use carom_contact::{Mesh, Obstacle, gap, gap_points};
use nalgebra::{Isometry3, Vector3};

/// Bodies larger and smaller than 1 m: no length is special.
#[test]
fn gap_to_a_mesh_is_the_smallest_gap_to_one_of_its_triangles() {
    let mut rng = fastrand::Rng::with_seed(7);
    let at = isometry(&mut rng, 1.0);
    // Hilly ground of 6 by 6 squares with sides of 1 m.
    let mut corner = |k: u32| Vector3::new(f64::from(k % 7), f64::from(k / 7), rng.f64());
    let vertices: Vec<_> = (0..49).map(&mut corner).collect();
    let squares = (0..49).filter(|k| k % 7 < 6 && k / 7 < 6);
    let triangles: Vec<_> = squares.flat_map(|k| [[k, k + 1, k + 8], [k, k + 8, k + 7]]).collect();
    let ground = Obstacle::mesh(Mesh::from_triangles(vertices.clone(), triangles.clone()).unwrap(), at).unwrap();
    let single = |triangle: &[u32; 3]| {
        let corners = triangle.map(|k| vertices[k as usize]).to_vec();
        Obstacle::mesh(Mesh::from_triangles(corners, vec![[0, 1, 2]]).unwrap(), at).unwrap()
    };
    let parts: Vec<_> = triangles.iter().map(single).collect();
    let mut rng = fastrand::Rng::with_seed(8);
    for size in [0.1, 0.3, 1.0, 2.0, 4.0] {
        let bodies = [
            link_shape(Shape::Sphere { radius: size }),
            link_shape(Shape::Capsule { radius: size, length: size }),
            link_shape(Shape::Box { size: Vector3::new(size, 2.0 * size, size / 2.0) }),
        ];
        for (kind, body) in bodies.iter().enumerate() {
            for _ in 0..20 {
                let height = size + 3.0 * rng.f64();
                let place = Vector3::new(8.0 * rng.f64() - 1.0, 8.0 * rng.f64() - 1.0, height);
                let place = at * Isometry3::from_parts(place.into(), isometry(&mut rng, 1.0).rotation);
                let whole = gap(body, &place.into(), &ground).distance;
                let least = parts.iter().map(|part| gap(body, &place.into(), part).distance);
                let least = least.fold(f64::INFINITY, f64::min);
                assert!((whole - least).abs() < 1e-13, "size {size}, body {kind}: {whole} against {least}");
            }
        }
    }
}

#[test]
fn sphere_centred_in_a_closed_box_mesh_has_the_gap_to_the_solid_box() {
    let mut rng = fastrand::Rng::with_seed(9);
    for _ in 0..300 {
        let size = Vector3::from_fn(|_, _| 0.1 + rng.f64());
        let at = isometry(&mut rng, 2.0);
        let inside = vector(&mut rng, 0.5).component_mul(&size);
        let place = at * Isometry3::translation(inside.x, inside.y, inside.z);
        let body = link_shape(Shape::Sphere { radius: 0.01 + 0.3 * rng.f64() });
        let found = gap(&body, &place.into(), &Obstacle::mesh(box_mesh(size), at).unwrap());
        let exact = gap(&body, &place.into(), &Obstacle::cuboid(at, size).unwrap());
        assert!((found.distance - exact.distance).abs() < 1e-13, "{found:?} against {exact:?}");
        assert!((found.normal - exact.normal).norm() < 1e-9, "{found:?} against {exact:?}");
        assert!((found.on_robot - exact.on_robot).norm() < 1e-9, "{found:?} against {exact:?}");
        assert!((found.on_environment - exact.on_environment).norm() < 1e-9, "{found:?} against {exact:?}");
    }
}

/// An L of three unit squares, as one polygon of six corners that begins at each of them: the triangles cover its area once, and
/// a ball in the notch does not touch it.
#[test]
fn concave_faces_are_split_inside_their_outline() {
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    let folder = std::env::temp_dir().join(format!("carom-concave-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for first in 0..6 {
        let corners = (0..6).map(|k| outline[(first + k) % 6]);
        let vertices: String = corners.map(|[x, y]| format!("v {x} {y} 0\n")).collect();
        for face in ["f 1 2 3 4 5 6\n", "f 6 5 4 3 2 1\n"] {
            let file = folder.join(format!("l{first}.obj"));
            std::fs::write(&file, format!("{vertices}{face}")).unwrap();
            let mesh = Mesh::read(&file, Vector3::repeat(1.0), "l").unwrap();
            let area: f64 = mesh
                .triangles()
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|k| mesh.vertices()[k as usize]);
                    0.5 * (b - a).cross(&(c - a)).norm()
                })
                .sum();
            assert!((area - 3.0).abs() < 1e-15, "corner {first}: area {area}");
            let obstacle = Obstacle::mesh(mesh, Isometry3::identity()).unwrap();
            let ball = link_shape(Shape::Sphere { radius: 0.1 });
            // The nearest points are the two edges of the notch.
            let found = gap(&ball, &Isometry3::translation(1.5, 1.5, 0.0).into(), &obstacle).distance;
            assert!((found - 0.4).abs() < 1e-15, "corner {first}: {found}");
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// The lowest corner of a box at a closed mesh: its normal is that of the face at any height above and depth below it, down to the rounding of the
/// positions, and so is the sign of its gap above that rounding.
#[test]
fn the_normal_at_a_face_of_a_mesh_has_all_its_digits_at_any_depth() {
    let mut rng = fastrand::Rng::with_seed(11);
    let size = Vector3::new(1.0, 0.7, 0.4);
    let edge = 0.1;
    let body = link_shape(Shape::Box { size: Vector3::repeat(edge) });
    for _ in 0..200 {
        let at = isometry(&mut rng, 1.0);
        let mesh = Obstacle::mesh(box_mesh(size), at).unwrap();
        // The diagonal of the face, an edge between two triangles in one plane, is included.
        let (x, y) = (0.8 * (rng.f64() - 0.5), 0.8 * (rng.f64() - 0.5));
        let y = if rng.bool() { y } else { x };
        let turned = isometry(&mut rng, 0.0).rotation;
        let corners = (0..8).map(|k| {
            turned * Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64).add_scalar(-0.5) * edge
        });
        let lowest = corners.min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
        for height in [1e-2, 1e-6, 1e-9, 1e-12, 1e-14, 1e-15, 1e-16, 1e-17, 0.0] {
            for height in [height, -height] {
                let place = Vector3::new(x * size.x, y * size.y, size.z / 2.0 + height) - lowest;
                let place = at * Isometry3::from_parts(place.into(), turned);
                let found = gap_points(&body, &place.into(), &mesh, 0.0)[0];
                let normal = at * Vector3::z();
                // The place is rounded to some units in the last place of a number of size 2.
                assert!((found.distance - height).abs() < 5e-15, "{found:?} at {height:e}");
                assert!((found.normal - normal).norm() < 1e-13, "{found:?} instead of {normal:?} at {height:e}");
            }
        }
    }
}

//! Triangles of a polygon.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | n | normal of the polygon: the sum of the cross products of its corners (Newell) |
//!
//! A convex polygon is a fan about its first corner. From another one ears are cut: triangles of three successive corners
//! that turn left about n and contain no other corner. A polygon without crossing edges always has one (G. H. Meisters,
//! *Polygons have ears*, 1975). Corners slightly off a plane are seen along n.

use nalgebra::Vector3;

/// The triangles of the polygon with these corners, as indices of `vertices`.
pub(super) fn triangles(vertices: &[Vector3<f64>], corners: &[u32]) -> Vec<[u32; 3]> {
    let at = |corner: u32| vertices.get(corner as usize).copied().unwrap_or_default();
    let first = corners.first().copied().map_or_else(Vector3::zeros, at);
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    let n: Vector3<f64> = pairs.map(|(a, b)| (at(*a) - first).cross(&(at(*b) - first))).sum();
    let left = |a: u32, b: u32, c: u32| n.dot(&(at(b) - at(a)).cross(&(at(c) - at(b))));
    let mut rest = corners.to_vec();
    let mut found = Vec::with_capacity(corners.len().saturating_sub(2));
    while rest.len() > 3 {
        let m = rest.len();
        let around = |i: usize| (rest[(i + m - 1) % m], rest[i], rest[(i + 1) % m]);
        let turns = |i: usize| {
            let (a, b, c) = around(i);
            left(a, b, c)
        };
        if (0..m).all(|i| turns(i) >= 0.0) {
            break;
        }
        let is_ear = |i: usize| {
            let (a, b, c) = around(i);
            let inside = |p: &u32| {
                let other = ![a, b, c].contains(p);
                other && left(a, b, *p) >= 0.0 && left(b, c, *p) >= 0.0 && left(c, a, *p) >= 0.0
            };
            turns(i) > 0.0 && !rest.iter().any(inside)
        };
        // Without an ear the edges cross: what is left becomes a fan.
        let Some(ear) = (0..m).find(|&i| is_ear(i)) else { break };
        let (a, b, c) = around(ear);
        found.push([a, b, c]);
        rest.remove(ear);
    }
    found.extend((2..rest.len()).map(|k| [rest[0], rest[k - 1], rest[k]]));
    found
}

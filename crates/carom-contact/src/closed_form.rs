//! Signed distances in closed form: a point or a segment against a point, a segment, a box or a cylinder.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | p | the point, in the axes of the box or cylinder |
//! | h | half sides of the box |
//! | r, l | radius and half length of the cylinder |
//! | n | unit normal, from the second body to the first |
//!
//! All positions of one call are in the same axes. Distances are exact to rounding on both sides of zero. Where the normal
//! is not determined (a point on a segment), it is z.

use nalgebra::Vector3;

/// The nearest points of two cores, `a` on the first and `b` on the second, and their signed distance along `normal`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    pub distance: f64,
    pub normal: Vector3<f64>,
    pub a: Vector3<f64>,
    pub b: Vector3<f64>,
}

impl Nearest {
    /// The distance of two points, |a − b|.
    pub fn of_points(a: Vector3<f64>, b: Vector3<f64>) -> Self {
        let distance = (a - b).norm();
        let normal = if distance > 0.0 { (a - b) / distance } else { Vector3::z() };
        Self { distance, normal, a, b }
    }

    /// The same with the two bodies exchanged.
    pub fn swapped(self) -> Self {
        Self { normal: -self.normal, a: self.b, b: self.a, ..self }
    }
}

/// A segment: its middle and half of the vector from end to end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment {
    pub middle: Vector3<f64>,
    pub half: Vector3<f64>,
}

impl Segment {
    fn at(&self, s: f64) -> Vector3<f64> {
        self.middle + self.half * s
    }

    /// s in [−1, 1] of the point nearest to `p`: s = (p − c)·h / h·h, clamped.
    fn nearest(&self, p: Vector3<f64>) -> f64 {
        let length = self.half.norm_squared();
        if length > 0.0 { ((p - self.middle).dot(&self.half) / length).clamp(-1.0, 1.0) } else { 0.0 }
    }
}

/// A point and a segment.
pub(crate) fn point_segment(p: Vector3<f64>, segment: &Segment) -> Nearest {
    Nearest::of_points(p, segment.at(segment.nearest(p)))
}

/// Two segments c + s h, c′ + t h′: where both derivatives of |c + s h − c′ − t h′|² vanish,
/// s = ((h·h′)(h′·w) − (h′·h′)(h·w)) / ((h·h)(h′·h′) − (h·h′)²) with w = c − c′, clamped to [−1, 1]; t is then nearest to
/// that point, and s to t's if t was clamped. (Ericson, *Real-Time Collision Detection* (2005), 5.1.9.) Parallel segments
/// are nearest along an interval; its middle is used.
pub(crate) fn segment_segment(first: &Segment, second: &Segment) -> Nearest {
    let w = first.middle - second.middle;
    let (aa, ab, bb) = (first.half.norm_squared(), first.half.dot(&second.half), second.half.norm_squared());
    let determinant = aa * bb - ab * ab;
    let s = if determinant > 1e-14 * aa * bb {
        (ab * second.half.dot(&w) - bb * first.half.dot(&w)) / determinant
    } else {
        // Parallel: the middle of the interval of `first` nearest to `second`.
        let ends = [first.nearest(second.at(-1.0)), first.nearest(second.at(1.0))];
        (ends[0] + ends[1]) / 2.0
    };
    let t = second.nearest(first.at(s.clamp(-1.0, 1.0)));
    let s = first.nearest(second.at(t));
    let nearest = Nearest::of_points(first.at(s), second.at(t));
    if nearest.distance > 0.0 {
        return nearest;
    }
    let across = first.half.cross(&second.half);
    Nearest { normal: across.try_normalize(0.0).unwrap_or(Vector3::z()), ..nearest }
}

/// A point and a box: outside, the distance of p from p clamped to the box; inside, the largest |pᵢ| − hᵢ (the nearest face;
/// of equally near faces the first of x, y, z).
pub(crate) fn point_box(p: Vector3<f64>, half: Vector3<f64>) -> Nearest {
    let clamped = p.zip_map(&half, |p, h| p.clamp(-h, h));
    let distance = (p - clamped).norm();
    if distance > 0.0 {
        return Nearest { distance, normal: (p - clamped) / distance, a: p, b: clamped };
    }
    let mut face = 0;
    for i in 1..3 {
        if p[i].abs() - half[i] > p[face].abs() - half[face] {
            face = i;
        }
    }
    leave_by_face(p, face, half)
}

fn leave_by_face(p: Vector3<f64>, face: usize, half: Vector3<f64>) -> Nearest {
    let (mut normal, mut b) = (Vector3::zeros(), p);
    normal[face] = if p[face] < 0.0 { -1.0 } else { 1.0 };
    b[face] = normal[face] * half[face];
    Nearest { distance: p[face].abs() - half[face], normal, a: p, b }
}

/// A point and a cylinder along z: with ρ = √(x² + y²) − r and ζ = |z| − l, the distance is √(ρ₊² + ζ₊²) outside and
/// max(ρ, ζ) inside.
pub(crate) fn point_cylinder(p: Vector3<f64>, radius: f64, half: f64) -> Nearest {
    let across = p.x.hypot(p.y);
    let outward = if across > 0.0 { Vector3::new(p.x / across, p.y / across, 0.0) } else { Vector3::x() };
    let up = if p.z < 0.0 { -1.0 } else { 1.0 };
    let (rho, zeta) = (across - radius, p.z.abs() - half);
    let on_side = outward * radius + Vector3::new(0.0, 0.0, p.z);
    let on_cap = Vector3::new(p.x, p.y, up * half);
    if rho > 0.0 && zeta > 0.0 {
        return Nearest::of_points(p, outward * radius + Vector3::new(0.0, 0.0, up * half));
    }
    if rho >= zeta {
        Nearest { distance: rho, normal: outward, a: p, b: on_side }
    } else {
        Nearest { distance: zeta, normal: Vector3::new(0.0, 0.0, up), a: p, b: on_cap }
    }
}

/// A segment and a box.
pub(crate) fn segment_box(segment: &Segment, half: Vector3<f64>) -> Nearest {
    let nearest = point_box(segment.at(nearest_to_box(segment, half)), half);
    if nearest.distance > 1e-9 * half.max() { nearest } else { segment_in_box(segment, half) }
}

/// s in [−1, 1] of the point of a segment c + s d nearest to a box.
///
/// The squared distance f(s) = Σ max(|cᵢ + s dᵢ| − hᵢ, 0)² is convex and piecewise quadratic, with breakpoints where a
/// coordinate is ±hᵢ. Its derivative g is non-decreasing and piecewise linear, so its zeros are a point or an interval (for
/// a segment along a face), whose middle is used.
fn nearest_to_box(segment: &Segment, half: Vector3<f64>) -> f64 {
    let (c, d) = (segment.middle, segment.half);
    let zero = 4.0 * f64::EPSILON * d.norm() * (c.norm() + d.norm() + half.norm());
    let slope = |s: f64| {
        let x = segment.at(s);
        let g: f64 = (0..3).map(|i| (x[i] - x[i].clamp(-half[i], half[i])) * d[i]).sum();
        if g.abs() <= zero { 0.0 } else { g }
    };
    // The last breakpoint where f decreases, and the first where it increases.
    let (mut falls, mut grows) = ((-1.0, slope(-1.0)), (1.0, slope(1.0)));
    let (mut first, mut last) = (grows, falls); // of the breakpoints where g = 0
    for s in (0..3).flat_map(|i| [(half[i] - c[i]) / d[i], (-half[i] - c[i]) / d[i]]).chain([-1.0, 1.0]) {
        if (-1.0..=1.0).contains(&s) {
            let here = (s, slope(s));
            if here.1 < 0.0 && s >= falls.0 {
                falls = here;
            } else if here.1 > 0.0 && s <= grows.0 {
                grows = here;
            } else if here.1 == 0.0 {
                first = if s < first.0 || first.1 != 0.0 { here } else { first };
                last = if s > last.0 || last.1 != 0.0 { here } else { last };
            }
        }
    }
    if first.1 == 0.0 {
        (first.0 + last.0) / 2.0
    } else if falls.1 >= 0.0 {
        -1.0
    } else if grows.1 <= 0.0 {
        1.0
    } else {
        falls.0 - falls.1 * (grows.0 - falls.0) / (grows.1 - falls.1)
    }
}

/// A segment that intersects a box. The Minkowski difference of the two is a polyhedron whose faces are those of the box and
/// those spanned by an edge of the box and the segment. The direction of greatest separation is therefore one of their six
/// normals n: that with the largest |n·c| − Σ|nᵢ|hᵢ − |n·d|.
fn segment_in_box(segment: &Segment, half: Vector3<f64>) -> Nearest {
    let (c, d) = (segment.middle, segment.half);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let across = axes.map(|e| e.cross(&d).try_normalize(1e-12 * d.norm()));
    let mut best = (f64::NEG_INFINITY, Vector3::z());
    for n in axes.into_iter().map(Some).chain(across).flatten() {
        let separation = n.dot(&c).abs() - n.abs().dot(&half) - n.dot(&d).abs();
        if separation > best.0 {
            best = (separation, if n.dot(&c) < 0.0 { -n } else { n });
        }
    }
    let (distance, normal) = best;
    // The segment translated out of the box touches it at the nearest point.
    let touching = Segment { middle: c - normal * distance, half: d };
    let s = nearest_to_box(&touching, half);
    let a = segment.at(s);
    Nearest { distance, normal, a, b: a - normal * distance }
}

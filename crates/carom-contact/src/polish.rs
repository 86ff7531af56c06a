//! From nearly to exactly the greatest separation: the last step of the search in `convex.rs`.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | n | unit vector from B to A |
//! | w(n) | lowest point of A along n less highest point of B; s = n·w |
//! | e | a direction along which a body is flat where it is touched: an edge, two of a face |
//! | T | directions in which n may still turn: n·δ = 0 and e·δ = 0 |
//! | K | how fast w moves when n turns: κ t tᵀ with κ = r/\|n⊥\| for a rim of radius r with tangent t |
//!
//! The search ends with a few corners of each body. Two corners of a body span an edge, three a face, and n is at right
//! angles to both: that alone fixes n between polyhedra that meet in edge and edge or in corner and face. Otherwise w must
//! be along n; where n turns by δ in T, w turns by −K δ, so Newton's step is (s + K) δ = w in T. The matrix is positive
//! where s > 0, that is for bodies apart.
//!
//! A cylinder is flat along its side, or on its cap, or round at its rim; near the border between these each is tried, and
//! the greatest s is the best, because no s is too great.

use crate::closed_form::Nearest;
use crate::convex::{Placed, Vertex};
use crate::solid::Core;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Directions at right angles to each other, at most two.
#[derive(Debug, Clone, Copy)]
struct Flat {
    along: [Vector3<f64>; 2],
    count: usize,
}

impl Flat {
    const NONE: Self = Self { along: [Vector3::new(0.0, 0.0, 0.0); 2], count: 0 };

    fn directions(&self) -> &[Vector3<f64>] {
        &self.along[..self.count]
    }

    /// One direction more, unless it is (nearly) among them or there are two.
    fn with(mut self, direction: Vector3<f64>) -> Self {
        if self.count < 2 {
            let rest = self.directions().iter().fold(direction, |rest, e| rest - e * e.dot(&rest));
            if let Some(e) = rest.try_normalize(1e-6 * direction.norm()) {
                // Once more: the difference above may have lost digits.
                let e = self.directions().iter().fold(e, |e, f| e - f * f.dot(&e)).normalize();
                self.along[self.count] = e;
                self.count += 1;
            }
        }
        self
    }

    /// `v` without its parts along them.
    fn remove(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.directions().iter().fold(v, |v, e| v - e * e.dot(&v))
    }

    /// Unit vectors at right angles to `n` and to them.
    fn turns(&self, n: Vector3<f64>) -> Self {
        let mut both = *self;
        let mut turns = Self::NONE;
        if both.count == 0 {
            let other = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
            both = both.with(other.cross(&n));
            turns = turns.with(both.along[0]);
        }
        if both.count == 1 {
            turns = turns.with(n.cross(&both.along[0]));
        }
        turns
    }

    fn projector(&self) -> Matrix3<f64> {
        self.directions().iter().map(|e| e * e.transpose()).sum()
    }
}

/// Within this of a cylinder's axis or cross-section, a normal may belong to the cap or to the side, too.
const BORDER: f64 = 0.03;

/// Where a body is touched: a corner and what is flat about it, or a rim, side or cap of a cylinder.
#[derive(Debug, Clone, Copy)]
struct Feature {
    /// `None` for a cylinder, whose extreme point moves with n.
    corner: Option<Vector3<f64>>,
    flat: Flat,
}

/// The features that may be touched along `n`, given corners of a body. `doubted`: the corners are not just those of the
/// place, so that each of them alone, and each two, are offered too.
fn features(body: &Placed, corners: &[Vector3<f64>], n: Vector3<f64>, doubted: bool, mut visit: impl FnMut(Feature)) {
    let feature = |corner, flat| Feature { corner, flat };
    match body.core {
        Core::Point => visit(feature(Some(corners[0]), Flat::NONE)),
        Core::Cylinder { .. } => {
            let axes = [0, 1, 2].map(|k| body.pose.rotation.column(k).into_owned());
            let along = n.dot(&axes[2]).abs();
            if along < BORDER {
                visit(feature(None, Flat::NONE.with(axes[2])));
            }
            if 1.0 - along * along < BORDER * BORDER {
                visit(feature(None, Flat::NONE.with(axes[0]).with(axes[1])));
            }
            visit(feature(None, Flat::NONE));
        }
        _ => {
            let edge = |flat: Flat, p: &Vector3<f64>, q: &Vector3<f64>| if p == q { flat } else { flat.with(q - p) };
            let all = corners.iter().fold(Flat::NONE, |flat, q| edge(flat, &corners[0], q));
            visit(feature(Some(corners[0]), all));
            for (k, p) in corners.iter().enumerate().filter(|(k, p)| doubted && !corners[..*k].contains(p)) {
                for q in corners[k..].iter().filter(|q| *q != p || corners[k] == **q) {
                    visit(feature(Some(*p), edge(Flat::NONE, p, q)));
                }
            }
        }
    }
}

/// κ and t of a cylinder touched along `n`.
fn curvature(body: &Placed, n: Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let Core::Cylinder { radius, .. } = body.core else { return None };
    let tangent = body.pose.rotation.column(2).cross(&n);
    let across = tangent.norm();
    (across > 1e-9).then(|| (radius / across, tangent / across))
}

/// The best direction, and the nearest points for it. `lowest` gives w(n) of the bodies `a` and `b` apart, `corners` are
/// those of the search (at most three), `rough` is its answer, whose distance is that of two points and so not too small.
/// Where s stays below it, the search had a corner too much or too few.
pub(crate) fn polish(
    bodies: (&Placed, &Placed),
    corners: &[Vertex],
    rough: Nearest,
    lowest: impl Fn(Vector3<f64>) -> Vertex,
) -> Nearest {
    let rounding = 8.0 * f64::EPSILON * (bodies.0.radius + bodies.1.radius + rough.distance);
    let mut known = [corners[0]; 6];
    known[..corners.len()].copy_from_slice(corners);
    let mut best = Nearest { distance: rough.normal.dot(&lowest(rough.normal).w), ..rough };
    let mut touched = None;
    for count in corners.len()..=corners.len() + 3 {
        let (start, doubted) = (best.normal, count > corners.len());
        let (of_a, of_b) = (known.map(|corner| corner.a), known.map(|corner| corner.b));
        features(bodies.0, &of_a[..count], start, doubted, |a| {
            features(bodies.1, &of_b[..count], start, doubted, |b| {
                let n = turn(bodies, (&a, &b), start, &lowest);
                let s = n.dot(&lowest(n).w);
                // Flat before round, unless round is better by more than rounding: a round cap has no points inside.
                if s > best.distance + if touched.is_some() { rounding } else { -rounding } {
                    best = Nearest { distance: s, normal: n, ..rough };
                    touched = Some((a, b));
                }
            });
        });
        if best.distance >= rough.distance - rounding || count == known.len() {
            break;
        }
        known[count] = lowest(best.normal);
    }
    match touched {
        Some((a, b)) => meet(best, &a, &b, &lowest),
        None => best,
    }
}

/// Newton's iteration for the greatest n·w, within the directions that the features leave. |w| (without what is along the flats) stands for
/// s, its value at the end: that makes the steps far from it shorter.
fn turn(
    bodies: (&Placed, &Placed),
    (a, b): (&Feature, &Feature),
    start: Vector3<f64>,
    lowest: &impl Fn(Vector3<f64>) -> Vertex,
) -> Vector3<f64> {
    let flat = b.flat.directions().iter().fold(a.flat, |flat, e| flat.with(*e));
    if let [e, f] = flat.directions() {
        let normal = e.cross(f).normalize();
        return if normal.dot(&start) < 0.0 { -normal } else { normal };
    }
    let difference = |n: Vector3<f64>| {
        let extreme = lowest(n);
        let lift = extreme.w - (extreme.a - extreme.b);
        flat.remove(lift + a.corner.unwrap_or(extreme.a) - b.corner.unwrap_or(extreme.b))
    };
    let Some(mut n) = flat.remove(start).try_normalize(1e-3) else { return start };
    let mut w = difference(n);
    for _ in 0..20 {
        let turns = flat.turns(n);
        let part =
            |v: &Vector3<f64>| Vector2::from_fn(|k, _| if k < turns.count { turns.along[k].dot(v) } else { 0.0 });
        let mut matrix = Matrix2::identity() * w.norm();
        for (kappa, tangent) in [curvature(bodies.0, n), curvature(bodies.1, n)].into_iter().flatten() {
            let tangent = part(&tangent);
            matrix += kappa * tangent * tangent.transpose();
        }
        let Some(inverse) = matrix.try_inverse() else { break };
        let step = inverse * part(&w);
        let way: Vector3<f64> = (0..turns.count).map(|k| turns.along[k] * step[k]).sum();
        // The whole step, or as much of it as leads upwards (up to rounding: s is flat at its top).
        let least = n.dot(&w) - 4.0 * f64::EPSILON * (bodies.0.radius + bodies.1.radius + w.norm());
        let tries = (0..20).map(|halved| {
            let next = flat.remove(n + way * 0.5_f64.powi(halved)).normalize();
            (next, difference(next))
        });
        match tries.into_iter().find(|(n, w)| n.dot(w) >= least) {
            Some(next) => (n, w) = next,
            None => break,
        }
        if way.norm() < 1e-15 {
            break;
        }
    }
    n
}

/// The points that meet along n: on the features, nearest to the rough ones, a − b = s n.
fn meet(best: Nearest, a: &Feature, b: &Feature, lowest: &impl Fn(Vector3<f64>) -> Vertex) -> Nearest {
    let n = best.normal;
    let extreme = lowest(n);
    let (flat_a, flat_b) = (&a.flat, &b.flat);
    let on = |feature: &Feature, extreme: Vector3<f64>, rough: Vector3<f64>| {
        let base = feature.corner.unwrap_or(extreme);
        base + feature.flat.projector() * (rough - base)
    };
    let (a, b) = (on(a, extreme.a, best.a), on(b, extreme.b, best.b));
    let lift = extreme.w - (extreme.a - extreme.b);
    let missing = n * best.distance - lift - (a - b);
    // The shortest pair of moves along the flats: y with (E Eᵀ + F Fᵀ) y = missing; what they do not span is filled up.
    let (of_a, of_b) = (flat_a.projector(), flat_b.projector());
    let both = flat_b.directions().iter().fold(*flat_a, |flat, e| flat.with(*e));
    let rest = Matrix3::identity() - both.projector();
    match (of_a + of_b + rest).try_inverse() {
        Some(inverse) => {
            let y = inverse * missing;
            Nearest { a: a + of_a * y, b: b - of_b * y, ..best }
        }
        None => Nearest { a, b, ..best },
    }
}

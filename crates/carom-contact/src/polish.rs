//! Refines the direction of greatest separation to rounding accuracy: the last step of the search in `convex.rs`.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | n | unit vector from B to A |
//! | w(n) | lowest point of A along n minus highest point of B; s = n·w |
//! | e | a direction along which a body is flat at its nearest point: that of an edge, or two of a face |
//! | T | directions in which n may change: n·δ = 0 and e·δ = 0 |
//! | K | derivative of −w with respect to n: κ t tᵀ with κ = r/\|n⊥\| for a rim of radius r with tangent t |
//!
//! The search ends with a few corners of each body. Two corners of a body span an edge and three a face, and n is
//! perpendicular to both. This determines n for polyhedra that are nearest at two edges or at a corner and a face. Otherwise
//! w must be parallel to n. A change of n by δ in T changes w by −K δ, so Newton's step is (s + K) δ = w in T. The matrix is
//! positive definite for s > 0, that is, for separate bodies.
//!
//! A cylinder is flat along its side and on its caps, and round at its rims. Near the border between these features all of
//! them are tried. The largest s is the best, because every s is a lower bound.

use crate::closed_form::Nearest;
use crate::convex::{Placed, Vertex};
use crate::solid::Core;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// At most two perpendicular unit vectors.
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

    /// Adds a direction, unless it is (nearly) in their span or there are two already.
    fn with(mut self, direction: Vector3<f64>) -> Self {
        if self.count < 2 {
            let rest = self.directions().iter().fold(direction, |rest, e| rest - e * e.dot(&rest));
            if let Some(e) = rest.try_normalize(1e-6 * direction.norm()) {
                // Orthogonalised again: the difference above may have lost digits.
                let e = self.directions().iter().fold(e, |e, f| e - f * f.dot(&e)).normalize();
                self.along[self.count] = e;
                self.count += 1;
            }
        }
        self
    }

    /// `v` without its components along them.
    fn remove(&self, v: Vector3<f64>) -> Vector3<f64> {
        self.directions().iter().fold(v, |v, e| v - e * e.dot(&v))
    }

    /// Unit vectors perpendicular to `n` and to them.
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

/// Sine of the angle from a cylinder's axis or cross-section up to which the cap or the side is tried, too.
const BORDER: f64 = 0.03;

/// The feature of a body that is nearest to the other: a corner, edge or face, or the rim, side or cap of a cylinder.
#[derive(Debug, Clone, Copy)]
struct Feature {
    /// `None` for a cylinder, whose extreme point moves with n.
    corner: Option<Vector3<f64>>,
    flat: Flat,
}

/// Calls `visit` with the features of a body that may be extreme along `n`, given some of its corners. `doubted`: the corners
/// may include others than those of the feature, so that each of them and each pair are visited too.
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

/// κ and t of a cylinder for the normal `n`.
fn curvature(body: &Placed, n: Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let Core::Cylinder { radius, .. } = body.core else { return None };
    let tangent = body.pose.rotation.column(2).cross(&n);
    let across = tangent.norm();
    (across > 1e-9).then(|| (radius / across, tangent / across))
}

/// The direction of greatest separation and the nearest points. `lowest` returns w(n), `corners` are those of the search (at
/// most three), and `rough` is its result, whose distance is that of two points of the bodies and so an upper bound. If s
/// stays below it, the search has returned a corner too many or too few, and further corners are added.
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
                // Flat features are visited first, and kept unless a round one is better by more than rounding.
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

/// Newton's iteration for the largest n·w over the directions perpendicular to the features. |w|, without its components
/// along the features, is used for s, to which it converges: this shortens the first steps.
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
        // The full step, halved until s does not decrease by more than rounding.
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

/// The nearest points: on the features, with a − b = s n, as close as possible to the rough ones.
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
    // The smallest displacements along the features: y with (E Eᵀ + F Fᵀ) y = missing. `rest` makes the matrix regular.
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

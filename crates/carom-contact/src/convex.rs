//! The signed distance of any two convex cores.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | A, B | the first and the second core |
//! | n | unit vector from B to A |
//! | s(n) | separation: height along n of A's lowest point minus that of B's highest point |
//! | v | vector from the nearest point of B to that of A |
//!
//! **Signed distance** is the greatest separation over all directions, d = max s(n), on both sides of zero. s(n) of any n is
//! a lower bound, so the distance returned is never too large.
//!
//! **Separate bodies**: the algorithm of Gilbert, Johnson and Keerthi (IEEE J. Robotics Autom. 4 (1988) 193) on the
//! Minkowski difference A − B. It ends when its lower and upper bounds agree to rounding; on a rim, which its corners only
//! approximate, at a relative error of about 1e-8. `polish.rs` then refines the result.
//!
//! **Close and overlapping bodies**: v is too short to give a direction, or zero. A is translated (lifted) by t along a
//! guess n₀, so that the bodies are well apart. The lifted pair maximises s(n) + t n·n₀, and its n has s(n) ≥ s(n₀). This is
//! repeated with the new n until n does not change. It is the proximal-point iteration for max s(n): it converges in one or
//! two steps for polyhedra, and gains three digits per step on rims.

use crate::closed_form::Nearest;
use crate::parry;
use crate::polish::polish;
use crate::solid::Core;
use carom_chain::Spatial;
use carom_chain::algebra::Pose;
use nalgebra::Vector3;

/// A core and its pose.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub core: Core<'a>,
    pub pose: Pose<Spatial<f64>>,
    /// Radius of a sphere about the pose's origin that contains it, m.
    pub radius: f64,
}

impl Placed<'_> {
    fn support(&self, d: Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation * self.core.support(self.pose.rotation.tr_mul(&d))
    }
}

/// Two cores, with positions relative to B's origin.
struct Pair<'a> {
    a: &'a Placed<'a>,
    b: &'a Placed<'a>,
    /// From B's origin to A's.
    offset: Vector3<f64>,
    /// Sum of the two radii: the length scale of tolerances.
    size: f64,
}

/// A corner of A − B.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Vertex {
    /// a − b
    pub w: Vector3<f64>,
    pub a: Vector3<f64>,
    pub b: Vector3<f64>,
}

/// Pairs closer than this fraction of the size are lifted. Above it, rounding changes a normal by at most 1e-8, and one that
/// is determined by an edge or face by at most 1e-15.
const NEAR: f64 = 1e-7;

/// Distance of lifted bodies, as a fraction of the size.
const LIFTED: f64 = 1e-3;

/// The nearest points of two cores. `a` and `b` are in world axes.
pub(crate) fn nearest(a: &Placed, b: &Placed) -> Nearest {
    let size = a.radius + b.radius;
    let pair = Pair { a, b, offset: a.pose.translation - b.pose.translation, size };
    let found = pair.search(Vector3::zeros(), pair.offset);
    let local = match found {
        Some(apart) if apart.distance > NEAR * size => apart,
        _ => pair.climb(found),
    };
    let origin = b.pose.translation;
    Nearest { a: local.a + origin, b: local.b + origin, ..local }
}

impl Pair<'_> {
    /// The corner of A − B lowest along n.
    fn lowest(&self, n: Vector3<f64>) -> Vertex {
        let (a, b) = (self.a.support(-n) + self.offset, self.b.support(n));
        Vertex { w: a - b, a, b }
    }

    /// s(n)
    fn separation(&self, n: Vector3<f64>) -> f64 {
        n.dot(&self.lowest(n).w)
    }

    /// The nearest points of B and of A translated by `lift`; `None` if they overlap. In the result, `distance` is that of
    /// the lifted pair, and `a` is a point of A before the translation. A non-zero lift must separate the pair.
    fn search(&self, lift: Vector3<f64>, guess: Vector3<f64>) -> Option<Nearest> {
        let lifted = |n| {
            let corner = self.lowest(n);
            Vertex { w: corner.w + lift, ..corner }
        };
        let rounding = 4.0 * f64::EPSILON * (self.size + lift.norm() + self.offset.norm());
        let mut simplex = Simplex::of(lifted(guess.try_normalize(0.0).unwrap_or(Vector3::z())));
        for _ in 0..100 {
            let v = simplex.nearest();
            let length = v.norm();
            if length <= rounding {
                return None;
            }
            let corner = lifted(v / length);
            let separation = v.dot(&corner.w) / length;
            if length - separation <= rounding {
                break;
            }
            // For a flat tetrahedron the test is unreliable: omitted if the pair is known to be separate.
            if separation <= 0.0 && lift == Vector3::zeros() && simplex.surrounds_with(&corner) {
                return None;
            }
            let next = simplex.with(corner);
            if next.nearest().norm() >= length {
                break;
            }
            simplex = next;
        }
        let (v, a, b) = (simplex.nearest(), simplex.mix(|c| c.a), simplex.mix(|c| c.b));
        let distance = v.norm();
        let rough = Nearest { distance, normal: v / distance, a, b };
        Some(polish((self.a, self.b), &simplex.corners[..simplex.count], rough, lifted))
    }

    /// Repeats the search with lifts until the direction does not change. `apart` is the result of the search without lift.
    fn climb(&self, apart: Option<Nearest>) -> Nearest {
        let found = match apart {
            Some(nearest) => Some(nearest.normal),
            None => parry::way_out_of(|d| self.lowest(-d).w / self.size),
        };
        let mut n = self.guess(found);
        let mut separation = self.separation(n);
        let mut best = None;
        for _ in 0..30 {
            let lift = LIFTED * self.size - separation;
            let Some(found) = self.search(n * lift, n) else { break };
            let next = self.separation(found.normal);
            if next < separation - f64::EPSILON * self.size {
                // The separation decreased, which is rounding: the direction is kept.
                best = best.or(Some(Nearest { normal: n, ..found }));
                break;
            }
            let turned = (found.normal - n).norm();
            (n, separation, best) = (found.normal, next, Some(found));
            if turned <= 1e-13 {
                break;
            }
        }
        match best {
            Some(found) => Nearest { distance: separation, ..found },
            None => {
                let corner = self.lowest(n);
                Nearest { distance: separation, normal: n, a: corner.a, b: corner.b }
            }
        }
    }

    /// The direction of greatest separation among some candidates: `found`, the vector between the origins, the axes of both
    /// bodies, and the cross products of these axes.
    fn guess(&self, found: Option<Vector3<f64>>) -> Vector3<f64> {
        let axes = |placed: &Placed| {
            let own = placed.core.has_axes();
            (0..3).filter(move |_| own).map(|k| placed.pose.rotation.column(k).into_owned()).collect::<Vec<_>>()
        };
        let (of_a, of_b) = (axes(self.a), axes(self.b));
        let products = of_a.iter().flat_map(|x| of_b.iter().map(|y| x.cross(y)));
        let likely = of_a.iter().copied().chain(of_b.iter().copied()).chain(products);
        let likely = likely.chain([Vector3::x(), Vector3::y(), Vector3::z(), self.offset]);
        let mut best = (f64::NEG_INFINITY, Vector3::z());
        let both = likely.flat_map(|n| [n, -n]).chain(found);
        for n in both.filter_map(|n| n.try_normalize(1e-9)) {
            let separation = self.separation(n);
            if separation > best.0 {
                best = (separation, n);
            }
        }
        best.1
    }
}

/// Up to three corners of A − B, with the positive weights of their point nearest to the origin.
#[derive(Debug, Clone, Copy)]
struct Simplex {
    corners: [Vertex; 3],
    weights: [f64; 3],
    count: usize,
}

impl Simplex {
    fn of(corner: Vertex) -> Self {
        Self { corners: [corner; 3], weights: [1.0, 0.0, 0.0], count: 1 }
    }

    fn mix(&self, part: impl Fn(&Vertex) -> Vector3<f64>) -> Vector3<f64> {
        (0..self.count).map(|k| part(&self.corners[k]) * self.weights[k]).sum()
    }

    fn nearest(&self) -> Vector3<f64> {
        self.mix(|corner| corner.w)
    }

    /// Adds a corner and removes those whose weight becomes zero. Only faces with the new corner are examined, because any
    /// improvement includes it.
    fn with(&self, new: Vertex) -> Self {
        let old = &self.corners[..self.count];
        let mut best = Self::of(new);
        let mut least = new.w.norm_squared();
        let mut consider = |corners: [Vertex; 3], weights: [f64; 3], count: usize| {
            if weights[..count].iter().all(|weight| *weight > 0.0) {
                let face = Self { corners, weights, count };
                let distance = face.nearest().norm_squared();
                if distance < least {
                    (best, least) = (face, distance);
                }
            }
        };
        for (k, p) in old.iter().enumerate() {
            let e = p.w - new.w;
            let t = -new.w.dot(&e) / e.norm_squared();
            consider([new, *p, *p], [1.0 - t, t, 0.0], 2);
            for q in &old[k + 1..] {
                let f = q.w - new.w;
                // The normal equations of |w + t e + u f|².
                let (ee, ef, ff) = (e.norm_squared(), e.dot(&f), f.norm_squared());
                let (we, wf) = (-new.w.dot(&e), -new.w.dot(&f));
                let determinant = ee * ff - ef * ef;
                let (t, u) = ((we * ff - wf * ef) / determinant, (wf * ee - we * ef) / determinant);
                consider([new, *p, *q], [1.0 - t - u, t, u], 3);
            }
        }
        best
    }

    /// Whether the tetrahedron with this fourth corner has the origin inside: by Cramer's rule for
    /// w + t e + u f + x g = 0.
    fn surrounds_with(&self, new: &Vertex) -> bool {
        let [p, q, r] = &self.corners[..self.count] else { return false };
        let (e, f, g) = (p.w - new.w, q.w - new.w, r.w - new.w);
        let volume = e.dot(&f.cross(&g));
        let t = -new.w.dot(&f.cross(&g)) / volume;
        let u = -e.dot(&new.w.cross(&g)) / volume;
        let x = -e.dot(&f.cross(&new.w)) / volume;
        t > 0.0 && u > 0.0 && x > 0.0 && t + u + x < 1.0
    }
}

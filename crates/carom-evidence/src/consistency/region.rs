//! Convex regions of the plane of (a, b) = (1/√D, h/√D), in which each measurement is a strip.
//!
//! A region is stored in homogeneous coordinates: generators (a, b, w), in the order of the boundary, are the points
//! (a/w, b/w), and directions if w = 0, so unbounded regions need no bounding box. The extremes of h = b/a, D = (w/a)² and
//! |a c − b|/w are at generators, because these are quotients of linear forms and monotonic along edges.

use super::range::{Pose, Range};
use nalgebra::Vector3;

/// Rounding error of generators of length 1.
const ROUNDING: f64 = 1e-14;

/// A convex region with a ≥ 0.
#[derive(Debug, Clone)]
pub(super) struct Region(Vec<Vector3<f64>>);

impl Region {
    /// The half-plane a ≥ 0. Neighbouring generators span the faces a = 0 and w = 0.
    pub fn all() -> Self {
        Self(vec![Vector3::new(0.0, -1.0, 0.0), Vector3::x(), Vector3::y(), Vector3::z()])
    }

    /// The part where `form` · (a, b, w) ≥ 0 (Sutherland & Hodgman).
    pub fn clip(&self, form: Vector3<f64>) -> Self {
        let form = form / form.amax(); // the square of the cotangent of a small angle can overflow
        let mut kept = Vec::new();
        for (k, p) in self.0.iter().enumerate() {
            let q = &self.0[(k + 1) % self.0.len()];
            let (up, next) = (form.dot(p), form.dot(q));
            if up >= 0.0 {
                kept.push(*p);
            }
            if (up > 0.0 && next < 0.0) || (up < 0.0 && next > 0.0) {
                let mut corner = (p * next.abs() + q * up.abs()).normalize();
                // rounding must not turn a direction (w = 0) into a point, nor a = 0 into a > 0
                for axis in [0, 2] {
                    if corner[axis].abs() < ROUNDING {
                        corner[axis] = 0.0;
                    }
                }
                kept.push(corner);
            }
        }
        Self(kept)
    }

    /// The part with `side` (a c − b) in `y`.
    pub fn strip(&self, cot: f64, side: f64, y: Range) -> Self {
        let height = Vector3::new(cot, -1.0, 0.0) * side;
        let above = self.clip(height - Vector3::z() * y.least);
        if y.most.is_finite() { above.clip(Vector3::z() * y.most - height) } else { above }
    }

    /// Whether it contains a point with a > 0, that is a finite h and D.
    pub fn holds_some(&self) -> bool {
        self.0.iter().any(|g| g.x > 0.0) && self.0.iter().any(|g| g.z > 0.0)
    }

    /// Range of a quotient of two linear forms whose denominator is not negative in the region.
    fn range(&self, above: impl Fn(&Vector3<f64>) -> f64, below: impl Fn(&Vector3<f64>) -> f64) -> Range {
        // a generator with 0/0, such as the direction (0, 1, 0) for w/a, is a limit of points with other quotients
        let quotients = self.0.iter().map(|g| (above(g), below(g))).filter(|(a, b)| *a != 0.0 || *b != 0.0);
        Range::over(quotients.map(|(a, b)| a / b))
    }

    /// Range of h.
    pub fn h(&self) -> Range {
        self.range(|g| g.y, |g| g.x)
    }

    /// Range of D.
    pub fn d(&self) -> Range {
        let root = self.range(|g| g.z, |g| g.x);
        Range { least: root.least * root.least, most: root.most * root.most }
    }

    /// Range of |a c − b| for c = `cot`.
    pub fn y(&self, cot: f64) -> Range {
        let height = self.range(|g| g.x * cot - g.y, |g| g.z);
        let (low, high) = (height.least.abs(), height.most.abs());
        let least = if height.least <= 0.0 && height.most >= 0.0 { 0.0 } else { low.min(high) };
        Range { least, most: low.max(high) }
    }

    /// (h, D) of an interior point; `None` if the region is unbounded or touches a = 0, so that h or D has no bound.
    pub fn middle(&self) -> Option<Pose> {
        if self.0.iter().any(|g| g.x <= 0.0 || g.z <= 0.0) {
            return None;
        }
        let mean: Vector3<f64> = self.0.iter().map(|g| g / g.z).sum::<Vector3<f64>>() / self.0.len() as f64;
        Some(Pose { h: mean.y / mean.x, d: 1.0 / (mean.x * mean.x) })
    }
}

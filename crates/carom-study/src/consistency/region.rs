//! The plane of (a, b) = (1/√D, h/√D), in which every measurement is a strip, and convex regions of it.
//!
//! A region is kept as the cone over it: generators (a, b, w), in the order of its boundary, stand for the points
//! (a/w, b/w), and for directions where w = 0. So regions without bound need no box, and every extreme that is asked for
//! is taken at a generator: h = b/a, D = (w/a)² and |a c − b|/w are quotients of linear forms, monotonic along edges.

use super::Range;
use nalgebra::Vector3;

/// Beside generators of length 1.
const ROUNDING: f64 = 1e-14;

/// A convex region with a ≥ 0.
#[derive(Debug, Clone)]
pub(super) struct Region(Vec<Vector3<f64>>);

impl Region {
    /// Everything with a ≥ 0. Neighbours span the faces a = 0 and w = 0.
    pub fn all() -> Self {
        Self(vec![Vector3::new(0.0, -1.0, 0.0), Vector3::x(), Vector3::y(), Vector3::z()])
    }

    /// The part where `form` · (a, b, w) ≥ 0 (Sutherland & Hodgman).
    pub fn clip(&self, form: Vector3<f64>) -> Self {
        let form = form / form.amax(); // the cotangent of a small angle squares beyond f64
        let mut kept = Vec::new();
        for (k, p) in self.0.iter().enumerate() {
            let q = &self.0[(k + 1) % self.0.len()];
            let (up, next) = (form.dot(p), form.dot(q));
            if up >= 0.0 {
                kept.push(*p);
            }
            if (up > 0.0 && next < 0.0) || (up < 0.0 && next > 0.0) {
                let mut corner = (p * next.abs() + q * up.abs()).normalize();
                // rounding must not make a point of a direction, nor a steepest V of a flat one
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

    /// Where `side` (a c − b) lies in `y`.
    pub fn strip(&self, cot: f64, side: f64, y: Range) -> Self {
        let height = Vector3::new(cot, -1.0, 0.0) * side;
        let above = self.clip(height - Vector3::z() * y.least);
        if y.most.is_finite() { above.clip(Vector3::z() * y.most - height) } else { above }
    }

    /// Whether it holds a point with a > 0: an h and a D.
    pub fn holds_some(&self) -> bool {
        self.0.iter().any(|g| g.x > 0.0) && self.0.iter().any(|g| g.z > 0.0)
    }

    /// Range of a quotient of two linear forms whose denominator is not negative here.
    fn range(&self, above: impl Fn(&Vector3<f64>) -> f64, below: impl Fn(&Vector3<f64>) -> f64) -> Range {
        // a generator without either, as the direction (0, 1, 0) has for w/a, is the limit of points beside it
        let quotients = self.0.iter().map(|g| (above(g), below(g))).filter(|(a, b)| *a != 0.0 || *b != 0.0);
        Range::over(quotients.map(|(a, b)| a / b))
    }

    /// h.
    pub fn h(&self) -> Range {
        self.range(|g| g.y, |g| g.x)
    }

    /// D.
    pub fn d(&self) -> Range {
        let root = self.range(|g| g.z, |g| g.x);
        Range { least: root.least * root.least, most: root.most * root.most }
    }

    /// |a c − b|.
    pub fn y(&self, cot: f64) -> Range {
        let height = self.range(|g| g.x * cot - g.y, |g| g.z);
        let (low, high) = (height.least.abs(), height.most.abs());
        let least = if height.least <= 0.0 && height.most >= 0.0 { 0.0 } else { low.min(high) };
        Range { least, most: low.max(high) }
    }

    /// (h, D) of a point inside; `None` where the region reaches a = 0, so that h and D have no bound.
    pub fn middle(&self) -> Option<(f64, f64)> {
        if self.0.iter().any(|g| g.x <= 0.0 || g.z <= 0.0) {
            return None;
        }
        let mean: Vector3<f64> = self.0.iter().map(|g| g / g.z).sum::<Vector3<f64>>() / self.0.len() as f64;
        Some((mean.y / mean.x, 1.0 / (mean.x * mean.x)))
    }
}

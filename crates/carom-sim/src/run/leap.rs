//! The continuation of a motion over a pose at which a mechanism with loops could branch.
//!
//! At a flat four-bar linkage the rows of its loop depend on each other. The motion through this pose is smooth: the mechanism
//! stays on its branch by its inertia, with forces that stay finite. But near the pose they are quotients of small numbers,
//! and an error of the state is amplified by the reciprocal of the [regularity](crate::state::Loops::regularity) r. So the
//! pose is not integrated through: where r falls below [`least`], the motion is continued by the polynomial through its past
//! to the time at which r has the same value on the other side, and then the loops are closed there.
//!
//! The past are n = [`NODES`] states at the Chebyshev points of a time n times as long as the leap, integrated backwards from
//! its start, away from the pose. A polynomial of degree n−1 in these points amplifies their errors by T₍ₙ₋₁₎(1 + 2/n),
//! about 140 (Trefethen, *Approximation Theory and Approximation Practice*, chapter 15, for the growth beyond the interval).
//!
//! A run, or an advance of a session, that ends within a leap ends with the state of the polynomial; the leap is part of what
//! it continues from. Forces that are set or jump within a leap act from its end on.

use crate::state::CLEAR;
use std::f64::consts::PI;

/// Number of states of the past, and its length in lengths of the leap.
pub(crate) const NODES: usize = 10;

/// The regularity, the sine of an angle, below which the loops count as near a branching pose: the pivots of their rows, its squares, are
/// then no longer clear.
pub(crate) fn least() -> f64 {
    CLEAR.sqrt()
}

/// See the head of this module.
#[derive(Debug, Clone)]
pub(crate) struct Leap {
    pub from: f64,
    pub to: f64,
    /// Length of the past, s.
    pub past: f64,
    /// The past, at the [nodes](Leap::node).
    pub states: Vec<Vec<f64>>,
    /// Energy and kinetic energy at the start, J.
    pub energy: f64,
    pub kinetic: f64,
    /// Work of drive and resistance up to the start, J.
    pub work: f64,
}

impl Leap {
    /// The time of the `k`-th state of the past, from the start backwards.
    pub fn node(from: f64, past: f64, k: usize) -> f64 {
        from - 0.5 * past * (1.0 - angle(k).cos())
    }

    /// The state at a time, by barycentric interpolation with the weights of Chebyshev points of the first kind.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let x = 1.0 + 2.0 * (time - self.from) / self.past;
        let weights: Vec<f64> = (0..NODES).map(|k| sign(k) * angle(k).sin() / (x - angle(k).cos())).collect();
        let sum: f64 = weights.iter().sum();
        let number = |i: usize| self.states.iter().zip(&weights).map(|(state, w)| state[i] * w).sum::<f64>() / sum;
        (0..self.states[0].len()).map(number).collect()
    }
}

fn angle(k: usize) -> f64 {
    (2 * k + 1) as f64 * PI / (2 * NODES) as f64
}

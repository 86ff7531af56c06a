//! Reference trajectories: cubic splines through given positions.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | tᵢ, yᵢ | times and positions, i = 0 … n |
//! | hᵢ, sᵢ | tᵢ₊₁ − tᵢ, (yᵢ₊₁ − yᵢ)/hᵢ |
//! | mᵢ | second derivative at tᵢ |
//!
//! Continuity of the first derivative gives hᵢ₋₁mᵢ₋₁ + 2(hᵢ₋₁+hᵢ)mᵢ + hᵢmᵢ₊₁ = 6(sᵢ − sᵢ₋₁) for 0 < i < n. At the ends the
//! third derivative is continuous at t₁ and tₙ₋₁ ("not a knot"): m₀ = m₁ − (m₂ − m₁)h₀/h₁ and its mirror image. Cubic
//! polynomials are then reproduced, and the error of smooth curves is of fourth order up to the ends (C. de Boor, *A Practical
//! Guide to Splines*, chapter IV). Three points give a parabola, two a line, one a constant.

use crate::error::{SimError, require};
use crate::state::{check_rows, next_of};

/// Positions of joints over time, with continuous velocity and acceleration: cubic splines. Before the first and after the
/// last time the joints rest at the first and last position.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    times: Vec<f64>,
    /// For each joint the positions and second derivatives at the times.
    pub(super) curves: Vec<Curve>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curve {
    y: Vec<f64>,
    m: Vec<f64>,
}

impl Reference {
    /// The splines through `positions` (a row for each time, with a number for each joint that has one coordinate, in the
    /// order of qd; rad, m) at ascending `times`, s.
    ///
    /// # Errors
    /// [`SimError::Setting`]: no row, rows of different lengths, times that do not ascend, numbers that are not finite.
    pub fn new(times: Vec<f64>, positions: &[Vec<f64>]) -> Result<Self, SimError> {
        let names = ["number of rows of the reference", "number in the reference", "time in the reference"];
        check_rows(names, &times, positions)?;
        for pair in times.windows(2) {
            require(pair[0] < pair[1], names[2], pair[1], "the times of a reference must ascend")?;
        }
        let width = positions[0].len();
        for length in positions.iter().map(Vec::len) {
            let rule = "all rows must have the same length";
            require(length == width, "length of a row of the reference", length as f64, rule)?;
        }
        let curve = |k: usize| {
            let y: Vec<f64> = positions.iter().map(|row| row[k]).collect();
            let m = second_derivatives(&times, &y);
            Curve { y, m }
        };
        let curves = (0..width).map(curve).collect();
        Ok(Self { times, curves })
    }

    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.times.len()
    }

    /// The position of joint `k` in a row.
    pub(super) fn position(&self, k: usize, row: usize) -> f64 {
        self.curves[k].y[row]
    }

    /// Adds to it; the spline goes through the new position.
    pub(super) fn shift(&mut self, k: usize, row: usize, by: f64) {
        let curve = &mut self.curves[k];
        curve.y[row] += by;
        curve.m = second_derivatives(&self.times, &curve.y);
    }

    /// Number of joints.
    pub(crate) fn joints(&self) -> usize {
        self.curves.len()
    }

    /// Position, velocity and acceleration of joint `k` at a time.
    ///
    /// # Panics
    /// If `k` is not below the number of joints.
    pub fn at(&self, k: usize, time: f64) -> [f64; 3] {
        let (t, Curve { y, m }) = (&self.times, &self.curves[k]);
        let last = t.len() - 1;
        let after = t.partition_point(|&knot| knot <= time);
        if after == 0 {
            return [y[0], 0.0, 0.0];
        }
        if after > last {
            return [y[last], 0.0, 0.0];
        }
        let i = after - 1;
        let (h, x) = (t[i + 1] - t[i], time - t[i]);
        let jerk = (m[i + 1] - m[i]) / h;
        let rate = (y[i + 1] - y[i]) / h - h * (2.0 * m[i] + m[i + 1]) / 6.0;
        [y[i] + x * (rate + x * (m[i] / 2.0 + x * jerk / 6.0)), rate + x * (m[i] + x * jerk / 2.0), m[i] + x * jerk]
    }

    /// The first knot after `time`.
    pub(super) fn next_kink(&self, time: f64) -> Option<f64> {
        next_of(&self.times, time)
    }
}

/// mᵢ.
fn second_derivatives(t: &[f64], y: &[f64]) -> Vec<f64> {
    let n = t.len() - 1;
    let mut m = vec![0.0; n + 1];
    if n < 2 {
        return m;
    }
    let h = |i: usize| t[i + 1] - t[i];
    let slope = |i: usize| (y[i + 1] - y[i]) / h(i);
    if n == 2 {
        m.fill(2.0 * (slope(1) - slope(0)) / (h(0) + h(1)));
        return m;
    }
    // Rows 1 … n−1 of a tridiagonal system: lower, diagonal, upper, right-hand side; m₀ and mₙ are eliminated.
    let mut rows: Vec<[f64; 4]> =
        (1..n).map(|i| [h(i - 1), 2.0 * (h(i - 1) + h(i)), h(i), 6.0 * (slope(i) - slope(i - 1))]).collect();
    let fold = |near: f64, next: f64| (near * (1.0 + near / next), near * near / next);
    let (centre, side) = fold(h(0), h(1));
    rows[0][1] += centre;
    rows[0][2] -= side;
    let (centre, side) = fold(h(n - 1), h(n - 2));
    let end = n - 2;
    rows[end][1] += centre;
    rows[end][0] -= side;
    for i in 1..rows.len() {
        let [_, diagonal, upper, right] = rows[i - 1];
        let factor = rows[i][0] / diagonal;
        rows[i][1] -= factor * upper;
        rows[i][3] -= factor * right;
    }
    for i in (0..rows.len()).rev() {
        let beyond = if i + 1 < rows.len() { rows[i][2] * m[i + 2] } else { 0.0 };
        m[i + 1] = (rows[i][3] - beyond) / rows[i][1];
    }
    m[0] = m[1] - (m[2] - m[1]) * h(0) / h(1);
    m[n] = m[n - 1] - (m[n - 2] - m[n - 1]) * h(n - 1) / h(n - 2);
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Through four points and more of a cubic polynomial goes this polynomial; through three of a parabola the parabola.
    #[test]
    fn a_spline_through_points_of_a_cubic_polynomial_is_this_polynomial() {
        let times = [-0.3, 0.1, 0.2, 0.9, 1.4, 1.5];
        for (degree, points) in [(3, 6), (3, 5), (3, 4), (2, 3), (1, 2), (0, 1)] {
            let coefficients = [0.7, -2.0, 1.3, 0.9];
            let exact = |x: f64| {
                let c = |k: usize| if k <= degree { coefficients[k] } else { 0.0 };
                let value = c(0) + x * (c(1) + x * (c(2) + x * c(3)));
                [value, c(1) + x * (2.0 * c(2) + 3.0 * x * c(3)), 2.0 * c(2) + 6.0 * x * c(3)]
            };
            let t = times[..points].to_vec();
            let rows: Vec<Vec<f64>> = t.iter().map(|&t| vec![exact(t)[0]]).collect();
            let found = Reference::new(t.clone(), &rows).unwrap();
            for k in 0..50 {
                let time = t[0] + (t[points - 1] - t[0]) * f64::from(k) / 50.0;
                let (a, b) = (found.at(0, time), exact(time));
                // Second differences of numbers of size 1 over intervals of 0.1 lose 1e3 units of rounding.
                assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-12), "{points} points at {time}: {a:?} {b:?}");
            }
            let (first, last) = (found.times[0], found.times[found.times.len() - 1]);
            assert_eq!(found.at(0, first - 1.0), [rows[0][0], 0.0, 0.0]);
            assert_eq!(found.at(0, last + 1.0), [rows[points - 1][0], 0.0, 0.0]);
        }
    }

    /// Velocity and acceleration are continuous at the knots, and the error of sin t falls by 2⁴ with half the interval.
    #[test]
    fn a_spline_is_smooth_and_of_fourth_order() {
        let error = |n: usize| {
            let times: Vec<f64> = (0..=n).map(|k| 3.0 * k as f64 / n as f64).collect();
            let rows: Vec<Vec<f64>> = times.iter().map(|t| vec![t.sin()]).collect();
            let found = Reference::new(times.clone(), &rows).unwrap();
            for &knot in &times[1..n] {
                let (before, after) = (found.at(0, knot.next_down()), found.at(0, knot));
                assert!((0..3).all(|i| (before[i] - after[i]).abs() < 1e-10), "{before:?} {after:?}");
            }
            (0..1000)
                .map(|k| 3.0 * f64::from(k) / 1000.0)
                .map(|t| (found.at(0, t)[0] - t.sin()).abs())
                .fold(0.0, f64::max)
        };
        let ratio: f64 = error(100) / error(200);
        assert!((14.0..19.0).contains(&ratio), "{ratio}");
    }
}

//! A measured impact of a planar body, and what a model predicts for it.

use super::candidates::{Candidate, Effect, Parameter};
use crate::halved;
use carom_impact::{ImpactProblem, law_by_name};
use carom_study::fit::{FitError, MeasuredImpact};
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4};

/// One impact of a body in the plane. Velocities are (m/s, m/s, rad/s).
#[derive(Debug, Clone)]
pub(super) struct PlanarImpact {
    /// Mass (kg) and moment of inertia (kg m²).
    pub body: (f64, f64),
    /// The tangential and the normal row of the contact Jacobian.
    pub rows: [Vector3<f64>; 2],
    /// Velocity before the impact.
    pub before: Vector3<f64>,
    /// Velocity after it.
    pub after: Vector3<f64>,
    /// What is measured after the impact, if further corners may strike.
    pub sequel: Option<Sequel>,
}

/// A square above the floor from the instant at which its lowest corner touches, until its velocity has been measured: by
/// straight lines through the samples, z with gravity.
#[derive(Debug, Clone)]
pub(super) struct Sequel {
    /// Angle of the square; it turns x towards z.
    pub angle: f64,
    /// Times of the samples after the touching instant, ascending, s.
    pub samples: Vec<f64>,
}

/// Side of the square, m.
pub(super) const SIDE: f64 = 0.06;
/// Gravity of the drops, m/s².
pub(super) const GRAVITY: f64 = 9.81;
/// Spacing at which gaps are checked, s: at 3 m/s a corner moves 0.6 mm.
const CHECK: f64 = 2e-4;
/// Greatest number of impacts until the last sample; a square that strikes more often has come to rest.
const MOST: usize = 20;

impl PlanarImpact {
    /// The problem for the tangential arm `arm`, as a multiple of the table's.
    fn rows(&self, arm: f64) -> [Vector3<f64>; 2] {
        let [d, n] = self.rows;
        [Vector3::new(d.x, d.y, d.z * arm), n]
    }

    /// The impact as the fits of coefficients read it.
    pub fn measured(&self, arm: f64) -> Result<MeasuredImpact, FitError> {
        MeasuredImpact::of_planar_body(self.body, self.rows(arm), self.before, self.after)
    }

    /// A velocity whose norm is that in the metric of the kinetic energy, per square root of the mass, m/s.
    fn scaled(&self, v: Vector3<f64>) -> Vector3<f64> {
        let (mass, inertia) = self.body;
        Vector3::new(v.x, v.y, (inertia / mass).sqrt() * v.z)
    }

    /// The residual whose norm is |v − v⁺|/|v⁻| for the velocity v that a model predicts; `None` where its law refuses the impact.
    pub fn residual(&self, model: &Candidate, x: &[f64]) -> Option<Vector3<f64>> {
        let arm = model.value(Parameter::Arm, x).unwrap_or(1.0);
        let strike = |rows, before| struck(self.body, rows, before, model, x);
        let mut v = strike(self.rows(arm), self.before)?;
        if let Some(sequel) = self.sequel.as_ref().filter(|_| model.effects.contains(&Effect::Strikes)) {
            v = sequel.measured(v, strike);
        }
        Some(self.scaled(v - self.after) / self.scaled(self.before).norm())
    }

    /// The least error of any impulse at the contact point that does not pull.
    pub fn bound(&self, model: &Candidate, x: &[f64]) -> f64 {
        let arm = model.value(Parameter::Arm, x).unwrap_or(1.0);
        self.measured(arm).map_or(f64::INFINITY, |it| it.least_residual(f64::INFINITY) / it.speed())
    }
}

/// The velocity after an impact; `None` if the law refuses it.
fn struck(
    (mass, inertia): (f64, f64),
    rows: [Vector3<f64>; 2],
    before: Vector3<f64>,
    model: &Candidate,
    x: &[f64],
) -> Option<Vector3<f64>> {
    let jacobian = Matrix2x3::from_rows(&rows.map(|row| row.transpose()));
    let inverse = Matrix3::from_diagonal(&Vector3::new(1.0 / mass, 1.0 / mass, 1.0 / inertia));
    let problem = ImpactProblem::new(jacobian * inverse * jacobian.transpose(), jacobian * before).ok()?;
    let law = law_by_name::<2>(model.law, model.coefficients(x, problem.approach_speed()))?;
    Some(before + inverse * jacobian.transpose() * law.resolve(&problem).ok()?.impulse)
}

impl Sequel {
    /// The velocity after the impact that lines through the samples show, at the touching instant, if the square leaves its
    /// first impact with velocity `v`. `strike` gives the velocity after an impact from the rows of its Jacobian and the
    /// velocity before.
    fn measured(
        &self,
        v: Vector3<f64>,
        strike: impl Fn([Vector3<f64>; 2], Vector3<f64>) -> Option<Vector3<f64>>,
    ) -> Vector3<f64> {
        let mut flight = Falling { time: 0.0, pose: Vector3::new(0.0, 0.0, self.angle), v };
        flight.pose.y = -flight.corners(0.0)[flight.lowest(0.0)].y;
        let (mut seen, mut impacts) = (Vec::new(), 0);
        for &sample in &self.samples {
            while impacts < MOST {
                let Some((time, corner)) = flight.next_strike(sample) else { break };
                flight.advance(time);
                let at = flight.corners(time)[corner] - flight.pose.xy();
                let rows = [Vector3::new(1.0, 0.0, -at.y), Vector3::new(0.0, 1.0, at.x)];
                flight.v = strike(rows, flight.v).unwrap_or(flight.v);
                impacts += 1;
            }
            seen.push(flight.at(sample) + Vector3::new(0.0, 0.5 * GRAVITY * sample * sample, 0.0));
        }
        slope(&self.samples, &seen)
    }
}

/// Slope of the straight line through points, by least squares.
fn slope(times: &[f64], points: &[Vector3<f64>]) -> Vector3<f64> {
    let middle = times.iter().sum::<f64>() / times.len() as f64;
    let squares: f64 = times.iter().map(|t| (t - middle).powi(2)).sum();
    times.iter().zip(points).map(|(t, point)| point * (t - middle)).sum::<Vector3<f64>>() / squares
}

/// A square in free fall over the floor z = 0.
struct Falling {
    /// Time, pose of the centre (x, z, angle), and velocity, after the last impact.
    time: f64,
    pose: Vector3<f64>,
    v: Vector3<f64>,
}

impl Falling {
    fn at(&self, time: f64) -> Vector3<f64> {
        let t = time - self.time;
        self.pose + self.v * t - Vector3::new(0.0, 0.5 * GRAVITY * t * t, 0.0)
    }

    fn corners(&self, time: f64) -> [Vector2<f64>; 4] {
        let pose = self.at(time);
        corners(pose.z).map(|corner| pose.xy() + corner)
    }

    fn lowest(&self, time: f64) -> usize {
        let corners = self.corners(time);
        (0..4).min_by(|a, b| corners[*a].y.total_cmp(&corners[*b].y)).unwrap_or(0)
    }

    fn advance(&mut self, time: f64) {
        let v = self.v - Vector3::new(0.0, GRAVITY * (time - self.time), 0.0);
        (self.pose, self.v, self.time) = (self.at(time), v, time);
    }

    /// The first time until `end` at which a corner reaches the floor from above, and the corner. A corner at the floor that
    /// falls has reached it.
    fn next_strike(&self, end: f64) -> Option<(f64, usize)> {
        let below = |time: f64| self.corners(time)[self.lowest(time)].y < -TOUCHING;
        let mut last = self.time;
        while last < end {
            let next = (last + CHECK).min(end);
            if below(next) {
                let [_, under] = halved([last, next], 40, |time| !below(time));
                return Some((under, self.lowest(under)));
            }
            last = next;
        }
        None
    }
}

/// Depth below which a corner counts as at the floor, m.
const TOUCHING: f64 = 1e-9;

/// The corners of a square from its centre; `angle` turns x towards z.
fn corners(angle: f64) -> [Vector2<f64>; 4] {
    let reach = SIDE * FRAC_1_SQRT_2;
    [0.0, 1.0, 2.0, 3.0].map(|k| angle + FRAC_PI_4 + FRAC_PI_2 * k).map(|a| Vector2::new(a.cos(), a.sin()) * reach)
}

/// The corner that is lowest, from the centre.
pub(super) fn lowest_corner(angle: f64) -> Vector2<f64> {
    corners(angle).into_iter().min_by(|a, b| a.y.total_cmp(&b.y)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use carom_impact::{Frictionless, Law};

    fn sequel(samples: &[f64]) -> Sequel {
        Sequel { angle: 0.4, samples: samples.to_vec() }
    }

    /// A lossless impact without friction of a square of mass 1.
    fn lossless(rows: [Vector3<f64>; 2], before: Vector3<f64>) -> Option<Vector3<f64>> {
        let inverse = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 6.0 / (SIDE * SIDE)));
        let jacobian = Matrix2x3::from_rows(&rows.map(|row| row.transpose()));
        let problem = ImpactProblem::new(jacobian * inverse * jacobian.transpose(), jacobian * before).ok()?;
        Some(
            before + inverse * jacobian.transpose() * Frictionless { restitution: 1.0 }.resolve(&problem).ok()?.impulse,
        )
    }

    /// Lines through samples of a free flight give its velocity at the touching instant.
    #[test]
    fn a_flight_without_strikes_shows_its_velocity() {
        let v = Vector3::new(0.3, 2.0, 5.0);
        let seen = sequel(&[0.006, 0.01, 0.014, 0.018]).measured(v, |_, _| unreachable!("no corner strikes"));
        assert!((seen - v).norm() < 1e-12, "{seen}");
    }

    /// The square turns towards its face, and further corners strike: without friction and loss the energy and the momentum
    /// along the floor are kept from strike to strike, and no corner is below the floor at a sample.
    #[test]
    fn further_strikes_keep_energy_and_stay_above_the_floor() {
        let v = Vector3::new(0.3, 0.2, -40.0);
        let strikes = std::cell::Cell::new(0);
        let count = |rows, before| {
            strikes.set(strikes.get() + 1);
            lossless(rows, before)
        };
        let seen = sequel(&[0.03, 0.031]).measured(v, count);
        assert!(strikes.get() >= 1, "a corner strikes");
        assert!((seen.x - v.x).abs() < 1e-9, "{seen}");
        // two samples 1 ms apart, after all strikes, give the velocity between them: the energy is that of the launch
        let corner = lowest_corner(0.4);
        let energy = |v: Vector3<f64>| 0.5 * (v.xy().norm_squared() + SIDE * SIDE / 6.0 * v.z * v.z);
        let mut flight = Falling { time: 0.0, pose: Vector3::new(0.0, -corner.y, 0.4), v };
        while let Some((time, corner)) = flight.next_strike(0.03) {
            flight.advance(time);
            let at = flight.corners(time)[corner] - flight.pose.xy();
            assert!(flight.corners(time)[flight.lowest(time)].y > -1e-6);
            flight.v = lossless([Vector3::new(1.0, 0.0, -at.y), Vector3::new(0.0, 1.0, at.x)], flight.v).unwrap();
            let now = energy(flight.v) + GRAVITY * (flight.pose.y + corner_height(0.4));
            assert!((now - energy(v)).abs() < 1e-6, "{now} {}", energy(v));
        }
        assert!((seen.z - flight.v.z).abs() < 1e-9, "{seen} {}", flight.v);
    }

    /// Height of the lowest corner over the centre.
    fn corner_height(angle: f64) -> f64 {
        lowest_corner(angle).y
    }
}

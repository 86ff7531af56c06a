//! The passage of a mechanism with loops through a pose at which it could branch.
//!
//! At a flat four-bar linkage the rows of its loop depend on each other. The motion through this pose is smooth: the mechanism
//! stays on its branch by its inertia, with forces that stay finite. But near the pose they are quotients of small numbers,
//! and an error of the state is amplified by the reciprocal of the [regularity](crate::state::Loops::regularity) r. So the
//! pose is not integrated through: where r falls below [`LEAST`], the motion is continued by the polynomial through its past
//! to the time at which r has the same value on the other side, and then the loops are closed there.
//!
//! The past are [`NODES`] states at the Chebyshev points of a time [`PAST`] times as long as the leap, integrated backwards from
//! its start, away from the pose. A polynomial of degree n−1 in these points amplifies their errors by T₍ₙ₋₁₎(1 + 2/PAST),
//! about 140 (Trefethen, *Approximation Theory and Approximation Practice*, chapter 15, for the growth beyond the interval).

use super::events::{Run, TOUCHING};
use super::leg::{Accuracy, pass};
use super::trajectory::Segment;
use super::watch::Watched;
use crate::error::SimError;
use crate::motion::Lasting;
use crate::state::Space;
use std::f64::consts::PI;

/// The regularity below which the loops count as near a branching pose.
pub(crate) const LEAST: f64 = 1e-3;
/// Number of states of the past.
const NODES: usize = 10;
/// Length of the past, in lengths of the leap.
const PAST: f64 = 10.0;
/// A leap that changes the energy by more than this share of the kinetic energy has failed.
const TRUST: f64 = 1e-6;

impl<A: Space> Run<'_, '_, A> {
    /// Leaps over a pose at which the mechanism could branch.
    ///
    /// # Errors
    /// [`SimError::Branch`] if the motion does not come out at the other side: it stops or turns back near this pose.
    pub fn pass_branch(&mut self) -> Result<(), SimError> {
        let failed = SimError::Branch { time: self.time };
        let energy = self.motion.energy(&self.y)?;
        let kinetic = self.motion.kinetic_energy(&self.y)?;
        let (q, qd) = self.q_qd();
        let here = self.motion.regularity(&q)?;
        let (nq, nv) = (q.len(), qd.len());
        let speed = qd.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        if speed == 0.0 || self.motion.lasting.iter().any(Lasting::is_rigid) {
            return Err(failed);
        }
        // The rate of the regularity, from a moment before.
        let moment = 0.1 * LEAST / speed;
        let before = self.motion.sim.chain.integrate(&q, &qd, -moment)?;
        let rate = (self.motion.regularity(&before)? - here) / moment;
        let leap = 2.2 * here / rate;
        // It falls to zero within a tenth of a radian, or of a metre, if it falls.
        if !(leap > 0.0 && leap * speed < 0.1) {
            return Err(failed);
        }
        let sim = self.motion.sim;
        let accuracy = Accuracy {
            tolerance: sim.tolerance.min(1e-12),
            max_step: sim.max_step,
            integrator: sim.integrator,
            gives_up: false,
        };
        let (from, past) = (self.time, PAST * leap);
        let angle = |k: usize| (2 * k + 1) as f64 * PI / (2 * NODES) as f64;
        let mut states = Vec::with_capacity(NODES);
        let mut flow = Watched::new(&mut self.motion, (from, f64::INFINITY), &self.y)?;
        let (mut time, mut y) = (from, self.y.clone());
        for k in 0..NODES {
            let node = from - 0.5 * past * (1.0 - angle(k).cos());
            y = pass(&mut flow, (time, &y), node, accuracy, &mut self.statistics)?;
            time = node;
            states.push(y.clone());
        }
        // Barycentric interpolation, with the weights of Chebyshev points of the first kind.
        let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let at = |time: f64| {
            let x = 1.0 + 2.0 * (time - from) / past;
            let weights: Vec<f64> = (0..NODES).map(|k| sign(k) * angle(k).sin() / (x - angle(k).cos())).collect();
            let sum: f64 = weights.iter().sum();
            let number =
                |i: usize| states.iter().zip(&weights).map(|(state, weight)| state[i] * weight).sum::<f64>() / sum;
            (0..y.len()).map(number).collect::<Vec<f64>>()
        };
        self.time = from + leap;
        let works = |y: &[f64]| y[nq + nv] + y[nq + nv + 1];
        let work = works(&self.y);
        self.y = at(self.time);
        sim.normalise(&mut self.y);
        self.motion.close_loops(&mut self.y)?;
        let change = energy - self.motion.energy(&self.y)? + works(&self.y) - work;
        let clear = self.gaps()?.into_iter().all(|(gap, _)| gap >= -TOUCHING);
        if !clear || change.abs() > TRUST * energy.abs().max(kinetic) {
            return Err(failed);
        }
        self.lost += change;
        self.sampler.stretch((from, self.time, Segment::POINTS), at, |_, _| Vec::new());
        Ok(())
    }
}

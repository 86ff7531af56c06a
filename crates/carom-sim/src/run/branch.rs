//! The passage of a mechanism with loops through a pose at which it could branch: see `leap.rs`.

use super::guarded::Guarded;
use super::leap::{Leap, NODES, least};
use super::leg::{Accuracy, pass};
use super::run_state::Run;
use super::sampler::Told;
use super::trajectory::Segment;
use crate::error::SimError;
use crate::motion::Lasting;
use crate::state::{CLEAR, EXACT, Space};

impl<A: Space> Run<'_, '_, A> {
    /// # Errors
    /// [`SimError::Branch`] at or near a pose at which the mechanism could branch: its loops have more independent rows, or are
    /// ten times as regular, a little aside: ten times what counts as near, in rad or lengths of the scene.
    pub fn refuse_branching_start(&mut self) -> Result<(), SimError> {
        if self.motion.couplings.is_empty() {
            return Ok(());
        }
        let (q, qd) = self.q_qd();
        let (here, rank) = (self.motion.regularity(&q)?, self.motion.rank);
        let scale = &self.motion.scale;
        let aside: Vec<f64> = (0..qd.len())
            .map(|k| scale.joint(k, 10.0 * least() * scale.length) * (1.0 + 2.4 * k as f64).sin())
            .collect();
        let mut near = [self.motion.sim.chain.integrate(&q, &aside, 1.0)?, qd].concat();
        // A linkage that closes nowhere aside has no other branch there.
        let branches = self.motion.close_loops(&mut near).is_ok() && {
            let there = self.motion.regularity(&near[..q.len()])?;
            self.motion.rank > rank || (here < least() && there > 10.0 * here)
        };
        if branches { Err(SimError::Branch { time: self.time }) } else { Ok(()) }
    }

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
        let speed = self.motion.scale.fastest(&qd) / self.motion.scale.length;
        if speed == 0.0 || self.motion.active.lasting.iter().any(Lasting::is_rigid) {
            return Err(failed);
        }
        // The rate of the regularity, from a moment before.
        let moment = 0.1 * least() / speed;
        let before = self.motion.sim.chain.integrate(&q, &qd, -moment)?;
        let rate = (self.motion.regularity(&before)? - here) / moment;
        let leap = 2.2 * here / rate;
        // It falls to zero within a tenth of a radian, or of a metre, if it falls.
        if !(leap > 0.0 && leap * speed < 0.1) {
            return Err(failed);
        }
        let sim = self.motion.sim;
        let accuracy = Accuracy {
            first_step: None,
            tolerance: sim.tolerance.min(EXACT),
            max_step: sim.max_step,
            integrator: sim.integrator,
            short: false,
            patience: None,
        };
        let (from, past) = (self.time, NODES as f64 * leap);
        let mut states = Vec::with_capacity(NODES);
        let mut flow = Guarded::new(&mut self.motion, (from, f64::INFINITY), &self.y)?;
        let (mut time, mut y) = (from, self.y.clone());
        for k in 0..NODES {
            let node = Leap::node(from, past, k);
            // A motion that comes to rest at the pose grows without bound backwards.
            let Ok(earlier) = pass(&mut flow, (time, &y), node, accuracy, &mut self.history.statistics) else {
                return Err(failed);
            };
            (time, y) = (node, earlier);
            states.push(y.clone());
        }
        let work = self.work();
        self.follow(Leap { from, to: from + leap, past, states, energy, kinetic, work })
    }

    /// Goes on with a leap, to its end or to that of the run.
    ///
    /// # Errors
    /// As [`Run::pass_branch`].
    pub fn follow(&mut self, leap: Leap) -> Result<(), SimError> {
        let start = std::mem::replace(&mut self.time, leap.to.min(self.end));
        self.y = leap.at(self.time);
        self.motion.sim.normalise(&mut self.y);
        let ends = self.time == leap.to;
        if ends {
            self.motion.close_loops(&mut self.y)?;
            let change = leap.energy - self.motion.energy(&self.y)? + self.work() - leap.work;
            let (gaps, scale) = (self.gaps()?, &self.motion.scale);
            let clear = gaps.into_iter().all(|(k, (gap, _))| gap >= -scale.touching(k));
            if !clear || change.abs() > CLEAR * leap.energy.abs().max(leap.kinetic) {
                return Err(SimError::Branch { time: leap.from });
            }
            self.history.lost += change;
        }
        let (motion, mut failed, loads) = (&mut self.motion, None, self.sampler.sampling.loads);
        let told = |time: f64, y: &[f64]| {
            let motors = if loads { motion.motor_forces(time, y) } else { Ok(Vec::new()) };
            Told { contacts: Vec::new(), motors: motors.map_err(|error| failed = Some(error)).unwrap_or_default() }
        };
        self.sampler.stretch((start, self.time, Segment::POINTS), |time| leap.at(time), told);
        failed.map_or(Ok(()), Err)?;
        self.history.leap = Some(leap).filter(|_| !ends);
        Ok(())
    }

    /// The work of drive and resistance so far, J.
    fn work(&self) -> f64 {
        let first = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        self.y[first] + self.y[first + 1]
    }
}

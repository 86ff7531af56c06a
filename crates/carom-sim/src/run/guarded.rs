//! The rate of the state of a motion, and the guards whose zeros end its contact mode.

use super::flow::Flow;
use super::guard::{Guard, GuardValue, look, passing};
use super::sampler::Told;
use crate::error::SimError;
use crate::motion::{ConstraintForces, LEVER, Lasting, Motion};
use crate::state::{CLEAR, MAX_STEPS, Space, View};
use std::ops::Range;

/// A motion with the guards of its present contact mode.
pub(crate) struct Guarded<'m, 'a, A: Space> {
    motion: &'m mut Motion<'a, A>,
    pub guards: Vec<Guard>,
    /// The latest time before the next jump of forces or surfaces: what the leg sees at its end is the limit from before.
    latest: f64,
    known: Option<Known>,
    /// The groups of bodies that touch at some of their parts.
    touching: Vec<usize>,
}

/// The forces at the latest state at which they were computed. Integrator and guards ask for those of the same state.
struct Known {
    time: f64,
    y: Vec<f64>,
    held: ConstraintForces,
    /// Whether they contain those on joints that are locked.
    on_joints: bool,
}

/// 4!⁴/(9 · 8!²), the constant of the error of Gauss's method of order 8 (E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential
/// Equations I*, 1993, section II.7).
const GAUSS: f64 = 2.27e-5;
/// The greatest decay in a step: with it the method keeps 0.005 where 0.0025 is left; an explicit integrator is not stable beyond it, either.
const DECAY: f64 = 6.0;
/// The pieces of a step in which a force has the slope of a root.
const GRADED: usize = 8;

impl<'m, 'a, A: Space> Guarded<'m, 'a, A> {
    /// For the present mode from this time to the next `kink`.
    pub fn new(motion: &'m mut Motion<'a, A>, (time, kink): (f64, f64), y: &[f64]) -> Result<Self, SimError> {
        let mut guards = Guard::of_mode(motion, (time, y))?;
        (motion.redundant, motion.margin_forces) = (false, None);
        let mut known = None;
        if motion.active.lasting.iter().any(Lasting::is_rigid) {
            let held = motion.in_mode(time, y)?;
            let alone = motion.assembled.constraints.rows.len() == 1;
            if !guards.iter().all(|guard| guard.admits(motion, &held, alone)) {
                guards.retain(|guard| !guard.is_force());
                guards.push(Guard::Admissible);
            }
            known = Some(Known { time, y: y.to_vec(), held, on_joints: true });
        }
        let touching = motion.gaps.touching(&motion.active.lasting);
        Ok(Self { motion, guards, latest: kink.next_down(), known, touching })
    }

    /// Before another attempt from this state: the directions of slip there, which an attempt has changed with each of its steps; of a slip
    /// that is none, the one of before.
    pub fn restart(&mut self, lasting: &[Lasting], (time, y): (f64, &[f64])) -> Result<(), SimError> {
        self.motion.active.lasting.copy_from_slice(lasting);
        self.known = None;
        self.motion.follow_slip(time, y)
    }

    /// Computes the accelerations at a state, unless they are known; `on_joints`: with the forces on joints that are locked.
    fn know(&mut self, (time, y): (f64, &[f64]), on_joints: bool) -> Result<(), SimError> {
        let same = |known: &Known| known.time == time && known.y == y && (known.on_joints || !on_joints);
        if self.known.as_ref().is_some_and(same) {
            return Ok(());
        }
        let mut memory = self.known.take().map_or_else(Vec::new, |known| known.y);
        let held = if on_joints { self.motion.in_mode(time, y)? } else { self.motion.accelerations(time, y)? };
        memory.clear();
        memory.extend_from_slice(y);
        let on_joints = on_joints || self.motion.assembled.locked.is_empty();
        self.known = Some(Known { time, y: memory, held, on_joints });
        Ok(())
    }

    /// Passes the values of these guards to `see`.
    fn look(&mut self, which: Range<usize>, time: f64, y: &[f64], see: impl FnMut(GuardValue)) -> Result<(), SimError> {
        let time = time.min(self.latest);
        let needs_forces = self.guards[which.clone()].iter().any(|guard| guard.needs_forces());
        if needs_forces {
            self.know((time, y), true)?;
        }
        let held = self.known.as_ref().filter(|_| needs_forces).map(|known| &known.held);
        look(self.motion, &self.guards[which], (time, y), held, see)
    }

    /// Into how many equal pieces a step of this length is divided.
    ///
    /// The motion beside a motion at rest is as fast as its controllers and springs make it, which the steps of the run do not show. Of each
    /// joint alone: an oscillation of √(k/m − (d/2m)²), of which Gauss's method of order 8 has an error of [`GAUSS`] x⁹ in a step of x times
    /// the time of this rate, which becomes the tolerance; and a decay of d/m, in a step of which by [`DECAY`] that method has an error of
    /// 3e-3, which decays itself.
    fn equal_pieces(&mut self, y: &[f64], span: f64) -> Result<usize, SimError> {
        let (stiffness, damping) = self.motion.regulation(&[]);
        if stiffness.iter().chain(&damping).all(|gain| *gain == 0.0) {
            return Ok(1);
        }
        let longest = (self.motion.sim.tolerance / GAUSS).powf(1.0 / 9.0);
        let (q, _) = self.motion.sim.split(y);
        let Some(factor) = self.motion.view(q)?.kin.mass_matrix().cholesky() else { return Ok(1) };
        let mobility = factor.inverse().diagonal();
        let pieces = stiffness.iter().zip(&damping).zip(mobility.iter()).map(|((k, d), mobility)| {
            let (rate, decay) = (k * mobility, d * mobility);
            let oscillation = (rate - 0.25 * decay * decay).max(0.0).sqrt();
            (oscillation / longest).max(decay / DECAY) * span
        });
        Ok((pieces.fold(1.0, f64::max).ceil() as usize).min(MAX_STEPS))
    }
}

impl<A: Space> Flow for Guarded<'_, '_, A> {
    fn rate(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let time = time.min(self.latest);
        let free = self.motion.moves_freely();
        if !free {
            self.know((time, y), false)?;
        }
        let held = self.known.as_ref().filter(|_| !free).map(|known| &known.held);
        self.motion.rate(time, y, held, out)
    }

    fn steps(&mut self, time: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (nq, nv) = (self.motion.sim.chain.nq(), self.motion.sim.chain.nv());
        let usual = f64::EPSILON.sqrt();
        for ((step, x), unit) in out.iter_mut().zip(y).zip(self.units(y.len())) {
            *step = usual * x.abs().max(unit);
        }
        // The energies have no effect on the motion.
        out[nq + nv..nq + nv + 2].fill(0.0);
        // The rate depends on the direction of slip: below the size of the slip it is linear.
        let slip = self.motion.slowest_slip(time.min(self.latest), y)?.max(self.motion.noise());
        let scale = &self.motion.scale;
        out[nq..nq + nv]
            .iter_mut()
            .enumerate()
            .for_each(|(v, step)| *step = step.min(scale.joint(v, CLEAR.sqrt() * slip)));
        Ok(())
    }

    fn units(&self, state: usize) -> Vec<f64> {
        let chain = &self.motion.sim.chain;
        self.motion.scale.units(chain.total_mass(), chain.nq(), state)
    }

    fn guards(&mut self, time: f64, y: &[f64], out: &mut Vec<GuardValue>) -> Result<(), SimError> {
        out.clear();
        self.look(0..self.guards.len(), time, y, |value| out.push(value))?;
        passing(self.motion, &self.guards, (time.min(self.latest), y), out)
    }

    fn guard(&mut self, k: usize, time: f64, y: &[f64]) -> Result<GuardValue, SimError> {
        let mut found = GuardValue::default();
        self.look(k..k + 1, time, y, |value| found = value)?;
        Ok(found)
    }

    fn touches(&self) -> bool {
        !self.touching.is_empty()
    }

    fn separated(&mut self, time: f64, y: &[f64]) -> Result<[f64; 2], SimError> {
        let (motion, time) = (&mut *self.motion, time.min(self.latest));
        let slack = motion.overlaps();
        let (q, qd) = motion.split(y);
        let view = View::new(motion.model, &mut motion.workspace, q)?;
        let (mut least, mut turning) = (f64::INFINITY, 0.0_f64);
        for &group in &self.touching {
            let [gap, turns] = motion.gaps.separated(group, &motion.active.lasting, &view, (qd, time), -slack)?;
            (least, turning) = (least.min(slack + gap), turning.max(turns));
        }
        Ok([least, turning])
    }

    fn closed_last(&mut self, time: f64, y: &[f64]) -> Result<Option<usize>, SimError> {
        let slack = self.motion.overlaps();
        let mut found = Vec::new();
        self.look(0..self.guards.len(), time, y, |value| found.push(value))?;
        let of_parts = |guard: &Guard| match guard {
            Guard::Gap(touch) => self.motion.sim.touches[*touch].is_part(),
            _ => false,
        };
        let closed =
            |value: &GuardValue| value.value.abs() <= LEVER * slack && value.rate.is_some_and(|rate| rate < 0.0);
        let parts =
            self.guards.iter().zip(&found).enumerate().filter(|(_, (guard, gap))| of_parts(guard) && closed(gap));
        Ok(parts.min_by(|a, b| a.1.1.value.abs().total_cmp(&b.1.1.value.abs())).map(|(k, _)| k))
    }

    fn told(&mut self, time: f64, y: &[f64], motors: bool) -> Result<Told, SimError> {
        self.known = None; // the scratch memory of the motion is that of other states afterwards
        let time = time.min(self.latest);
        let motors = if motors { self.motion.motor_forces(time, y)? } else { Vec::new() };
        Ok(Told { contacts: self.motion.contact_states(time, y)?, motors })
    }

    fn close(&mut self, y: &mut [f64]) -> Result<(), SimError> {
        if !self.motion.couplings.is_empty() {
            self.motion.sim.normalise(y);
            self.motion.close_loops(y)?;
        }
        Ok(())
    }

    /// At a force with the slope of a root of the depth, k d^1.5, the method has an error of 1e-3 of its change in a step from d = 0;
    /// in [`GRADED`] pieces that end at (k/8)⁴ of the step 6e-8.
    fn pieces(&mut self, [(start, from), (until, to)]: [(f64, &[f64]); 2]) -> Result<Vec<f64>, SimError> {
        self.known = None; // the scratch memory of the motion is that of other states afterwards
        let equal = self.equal_pieces(to, until - start)?;
        let mut shares: Vec<f64> = (1..=equal).map(|k| k as f64 / equal as f64).collect();
        let graded = (1..GRADED).map(|k| (k as f64 / GRADED as f64).powi(4));
        let [begins, ends] = self.motion.roots([(start, from), (until, to)])?;
        shares.extend(graded.clone().filter(|_| begins));
        shares.extend(graded.map(|share| 1.0 - share).filter(|_| ends));
        shares.sort_by(f64::total_cmp);
        shares.dedup();
        Ok(shares)
    }

    fn settle(&mut self, time: f64, y: &mut [f64]) -> Result<bool, SimError> {
        let time = time.min(self.latest);
        self.known = None; // directions of slip may change
        let motion = &mut *self.motion;
        let changed = motion.sim.normalise(y);
        let moved = motion.settle(time, y)?;
        motion.follow_slip(time, y)?;
        Ok(moved || changed)
    }
}

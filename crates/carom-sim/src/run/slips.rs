//! The choice of the mode, and slips that end as soon as it is chosen: see `motion/ending.rs`.

use super::events::Run;
use crate::error::SimError;
use crate::motion::{Candidate, Dry};
use crate::state::Space;

impl<A: Space> Run<'_, '_, A> {
    /// [`Motion::select`](crate::motion::Motion::select); the energy of the velocities that it sets to zero is booked.
    pub fn select(&mut self, candidates: &[Candidate]) -> Result<bool, SimError> {
        let energy = self.motion.energy(&self.y)?;
        let found = self.motion.select(candidates, self.time, &mut self.y)?;
        self.lost += energy - self.motion.energy(&self.y)?;
        Ok(found)
    }

    /// Ends the slips of contacts and joints that would end soon and then rest; the energy that they lose is booked.
    pub fn end_slips(&mut self, candidates: &[Candidate]) -> Result<(), SimError> {
        if self.memory.follows_slips {
            return Ok(());
        }
        let mut ending = self.motion.ending(self.time, &self.y)?;
        if ending.is_empty() {
            return Ok(());
        }
        let (kept, y, other) = (self.motion.kept(), self.y.clone(), self.motion.other_mode.take());
        let energy = self.motion.energy(&y)?;
        while !ending.is_empty() {
            let ends = |touch| ending.touches.contains(&touch);
            let rest = |own: &Candidate| Candidate { slip: if ends(own.touch) { None } else { own.slip }, ..*own };
            let candidates: Vec<Candidate> = candidates.iter().map(rest).collect();
            ending.joints.iter().for_each(|&k| self.motion.dry[k].state = Dry::Holds);
            self.motion.shut(&candidates, self.time, &mut self.y)?;
            let found = self.motion.select(&candidates, self.time, &mut self.y)?;
            if found && !self.motion.is_moving(&mut ending) {
                self.lost += energy - self.motion.energy(&self.y)?;
                return Ok(());
            }
            self.motion.keep(kept.clone());
            self.y.copy_from_slice(&y);
            if !found {
                break;
            }
        }
        self.motion.other_mode = other;
        Ok(())
    }
}

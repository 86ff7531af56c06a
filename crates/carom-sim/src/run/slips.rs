//! Slips that end as soon as their mode is chosen: see `motion/ending.rs`.

use super::events::Run;
use super::trajectory::EventKind;
use crate::error::SimError;
use crate::motion::{Candidate, Dry, Hold, Lasting};
use crate::state::Space;
use nalgebra::Vector3;

impl<A: Space> Run<'_, '_, A> {
    /// After a slip that seemed to end: it goes on, or has turned back at a dead point, which is an event. `old`: the contacts before.
    pub fn slips_on(&mut self, old: &[Lasting], before: &[f64]) {
        let toward = |own: &Lasting| if let Hold::Slides { toward } = own.hold { toward } else { Vector3::zeros() };
        let pairs = old.iter().zip(&self.motion.lasting);
        let turned = pairs.filter(|(old, own)| toward(old).dot(&toward(own)) < 0.0).map(|(_, own)| own.mode());
        let turned: Vec<_> = turned.collect();
        self.memory.slip_goes_on = turned.is_empty();
        for mode in turned {
            self.note(EventKind::Mode { mode }, before, Vec::new());
        }
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

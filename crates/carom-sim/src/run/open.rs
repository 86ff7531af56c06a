//! The event that a motion is not unique.

use super::events::Run;
use super::trajectory::EventKind;
use crate::error::SimError;
use crate::state::Space;

impl<A: Space> Run<'_, '_, A> {
    /// The event that the motion in the present mode is not unique, if it was not noted before.
    pub fn note_open(&mut self) -> Result<(), SimError> {
        let open = self.motion.open(self.time, &self.y)?;
        if let Some((reason, touches)) = &open
            && open != self.memory.open
        {
            let (y, touches) = (self.y.clone(), touches.clone());
            self.note(EventKind::NonUnique { reason: *reason, touches }, &y, Vec::new());
        }
        self.memory.open = open;
        Ok(())
    }
}

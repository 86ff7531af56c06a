//! What a run outputs between its events.

use super::trajectory::{Sampling, Seen, Segment, Step};
use crate::motion::ContactState;
use crate::state::Moment;

/// What is output with a moment beside its state.
#[derive(Debug, Clone, Default)]
pub(crate) struct Told {
    /// The lasting contacts.
    pub contacts: Vec<ContactState>,
    /// The forces of the motors, if loads are asked for.
    pub motors: Vec<f64>,
}

/// Passes moments at multiples of an interval, and segments, to the callback.
pub(crate) struct Sampler<'a> {
    pub sampling: Sampling,
    /// Lengths of q and qd.
    pub sizes: (usize, usize),
    /// Number of moments so far.
    pub count: usize,
    /// End of the last segment: a leg that failed is repeated, and its segments are not output twice.
    pub until: f64,
    /// The callback.
    pub watch: &'a mut dyn FnMut(Seen),
    /// The integration steps of the last leg, if they are wanted.
    pub path: Option<Vec<Step>>,
}

impl Sampler<'_> {
    /// Outputs the moments and the segment between `start` and `end`. `at` computes the state at a time, `told` what is
    /// output with it; a segment has `points` points.
    pub fn stretch(
        &mut self,
        (start, end, points): (f64, f64, usize),
        mut at: impl FnMut(f64) -> Vec<f64>,
        mut told: impl FnMut(f64, &[f64]) -> Told,
    ) {
        let (nq, nv) = self.sizes;
        if let Some(every) = self.sampling.every {
            // The last multiple may exceed the end by rounding: 3 × 0.1 > 0.3.
            while self.count as f64 * every <= end + 2.0 * f64::EPSILON * end {
                let time = (self.count as f64 * every).min(end);
                let y = at(time);
                (self.watch)(Seen::Moment(&Moment { time, q: y[..nq].to_vec(), qd: y[nq..nq + nv].to_vec() }));
                let Told { contacts, motors } = told(time, &y);
                if !contacts.is_empty() {
                    (self.watch)(Seen::Contacts(time, &contacts));
                }
                if self.sampling.loads {
                    (self.watch)(Seen::Motors(time, &motors));
                }
                self.count += 1;
            }
        }
        let start = start.max(self.until);
        if self.sampling.dense && end > start {
            self.until = end;
            let states = Segment::times(start, end, points).map(|time| at(time)[..nq + nv].to_vec()).collect();
            (self.watch)(Seen::Segment(&Segment { start, end, states }));
        }
    }
}

//! What a run remembers of its last events.

use super::watch::Watch;
use crate::model::Simulation;
use crate::motion::NonUnique;
use std::collections::VecDeque;

/// The part of a run's state by which neighbouring runs must start alike: their motions differ, their pasts do not.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    /// Number of events so far.
    pub events: usize,
    /// Times at which the last legs ended at a zero of a witness function, to detect too many within a short time.
    recent: VecDeque<f64>,
    /// Time of the last zero of a normal force after which its contact was chosen again with the same mode.
    pub kept: Option<f64>,
    /// Whether a slip that seemed to end goes on: the next leg does not look for its end.
    pub slip_goes_on: bool,
    /// Whether all slips are followed to their exact end.
    pub follows_slips: bool,
    /// Times of the last impacts, to detect their accumulation.
    pub impact_times: VecDeque<f64>,
    /// Why the motion in the present mode is not unique, with its contacts.
    pub open: Option<(NonUnique, Vec<usize>)>,
    /// Whether the chain is at rest and stays so.
    pub resting: bool,
    /// The time for which the present mode, which is stiff, is next integrated implicitly, s.
    pub implicit: Option<f64>,
    /// The length of the last step of the integration, s.
    pub step: Option<f64>,
    /// Whether the last leg was short: see `leg.rs`.
    pub short: bool,
    /// The time after which time steps next look for a consistent mode, s.
    pub wait: f64,
    /// The time at which time steps last ended, s.
    pub resumed: Option<f64>,
    /// The time of the last impacts without collision of several contacts, and their number at this time.
    jammed: (f64, usize),
}

/// At most so many impacts without collision of several contacts happen at one time: each ends the slip of a contact.
const JAMS: usize = 8;
/// So many ends of legs within one time step are too many.
const CROWD: usize = 300;
/// Too many impacts within this number of Zeno times do not accumulate.
const TAIL: f64 = 10.0;

impl Memory {
    /// A leg has ended at a zero of a witness function.
    pub fn add(&mut self, time: f64) {
        self.recent.push_back(time);
        if self.recent.len() > CROWD {
            self.recent.pop_front();
        }
    }

    /// Counts an impact without collision; `false` if there were too many at this time.
    pub fn may_jam(&mut self, time: f64) -> bool {
        let (last, count) = self.jammed;
        self.jammed = (time, if last == time { count + 1 } else { 1 });
        self.jammed.1 <= JAMS
    }

    /// Whether there were too many of them within a time step; where gaps close, within some Zeno times, because hundreds of impacts of
    /// one ball lie within a time step before they accumulate.
    pub fn is_crowded(&self, time: f64, watch: Watch, sim: &Simulation) -> bool {
        let closes = matches!(watch, Watch::Gap(_) | Watch::Pair(_) | Watch::Rest(_));
        let within = if closes { sim.contact_step.min(TAIL * sim.zeno_time) } else { sim.contact_step };
        self.recent.len() == CROWD && time - self.recent[0] < within
    }
}

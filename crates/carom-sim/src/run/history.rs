//! What a run has done: its events, the counts, the energy of its impacts, and what its next decisions take from them.
//!
//! Events of one class that follow one another without end would keep a run from going on. After so many of them within a time, the run
//! goes on in another way:
//!
//! | class | number | within | then |
//! |---|---|---|---|
//! | [`Class::Leg`] | 300 | a time step; 10 Zeno times where gaps close or closed just before, because one ball may bounce hundreds of times before it rests | time steps |
//! | [`Class::Impact`] | 7 | the Zeno time | the rest of them is one impact without restitution, if they accumulate |
//! | [`Class::NormalForce`] | 2 | the Zeno time | the contact opens |
//! | [`Class::Jam`] | [`STEPS`] | no time: each ends the slip of a contact, or a law with tangential restitution leaves a share of it | time steps |

use super::leap::Leap;
use super::trajectory::Statistics;
use crate::model::Simulation;
use crate::motion::{ContactState, NonUnique};
use crate::state::STEPS;
use std::collections::VecDeque;

/// The past of a run. Neighbouring runs start with the same one: their motions differ, their pasts do not.
#[derive(Debug, Clone, Default)]
pub(crate) struct History {
    /// Number of events so far.
    pub events: usize,
    pub statistics: Statistics,
    /// Kinetic energy lost in impacts, J.
    pub lost: f64,
    /// The contacts of the last time step.
    pub stepped: Vec<ContactState>,
    /// A leap over a pose at which the mechanism could branch, if the run stands within it.
    pub leap: Option<Leap>,
    /// The times of the last events of each class.
    times: [VecDeque<f64>; 4],
    /// Whether a slip that seemed to end goes on: the next leg does not look for its end.
    pub slip_goes_on: bool,
    /// Whether all slips are followed to their exact end.
    pub follows_slips: bool,
    /// Whether accumulations of impacts end one impact later than their conditions ask for: the run beside, which tells the error of their ends.
    pub ends_later: bool,
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
}

/// A class of events that may follow one another without end.
#[derive(Clone, Copy)]
pub(crate) enum Class {
    /// A leg ends at a zero of a guard.
    Leg,
    /// A contact or a limit closes with an impact.
    Impact,
    /// A normal force is zero, and its contact is chosen again with the same mode.
    NormalForce,
    /// An impact without collision.
    Jam,
}

impl Class {
    /// The number of the table at the head of this module.
    pub fn many(self) -> usize {
        match self {
            Self::Leg => 300,
            Self::Impact => 7,
            Self::NormalForce => 2,
            Self::Jam => STEPS,
        }
    }
}

/// Too many impacts within this number of Zeno times do not accumulate; slower than a fall of this time they are slow.
pub(crate) const TAIL: f64 = 10.0;

impl History {
    /// Whether a contact carried a load in the last time step.
    pub fn carried(&self, touch: usize) -> bool {
        self.stepped.iter().any(|own| own.touch == touch && own.normal_force > 0.0)
    }

    /// Counts an event; the time since the first of its class that counts, if there were so many.
    pub fn count(&mut self, class: Class, time: f64) -> Option<f64> {
        let (times, many) = (&mut self.times[class as usize], class.many());
        times.push_back(time);
        if times.len() > many {
            times.pop_front();
        }
        (times.len() == many).then(|| time - times[0])
    }

    /// Counts the end of a leg; whether there were too many.
    pub fn is_crowded(&mut self, time: f64, closes: bool, sim: &Simulation) -> bool {
        let bounce = TAIL * sim.zeno_time;
        let closes = closes || self.times[Class::Impact as usize].back().is_some_and(|last| time - last < bounce);
        let within = if closes { sim.contact_step.min(bounce) } else { sim.contact_step };
        self.count(Class::Leg, time).is_some_and(|since| since < within)
    }
}

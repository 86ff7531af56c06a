//! What a run remembers of its last events.

use crate::motion::NonUnique;
use std::collections::VecDeque;

/// The part of a run's state by which neighbouring runs must start alike: their motions differ, their pasts do not.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    /// Number of events so far.
    pub events: usize,
    /// Times of the last events, to detect too many within a short time.
    pub recent: VecDeque<f64>,
    /// Times of the last impacts, to detect their accumulation.
    pub blows: VecDeque<f64>,
    /// Why the motion in the present mode is not unique, with its contacts.
    pub open: Option<(NonUnique, Vec<usize>)>,
    /// Whether the chain is at rest and stays so.
    pub resting: bool,
    /// The time for which the present mode, which is stiff, is next integrated implicitly, s.
    pub implicit: Option<f64>,
}

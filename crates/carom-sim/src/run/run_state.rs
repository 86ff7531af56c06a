//! A run of a simulation.

use super::history::History;
use super::sampler::Sampler;
use crate::motion::Motion;
use crate::state::Space;

/// A run. Its state is that of a [`Checkpoint`](super::checkpoint::Checkpoint): the time, the numbers of the state, the active set of the
/// motion, and the history. All else follows from the simulation or is scratch memory.
pub(crate) struct Run<'a, 'w, A: Space> {
    pub motion: Motion<'a, A>,
    pub time: f64,
    pub y: Vec<f64>,
    pub history: History,
    /// The time at which it ends.
    pub end: f64,
    pub sampler: Sampler<'w>,
}

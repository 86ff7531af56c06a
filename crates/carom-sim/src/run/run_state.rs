//! The state of a run.

use super::leap::Leap;
use super::memory::Memory;
use super::sampler::Sampler;
use super::trajectory::Statistics;
use crate::motion::{ContactState, Motion};
use crate::state::Space;

/// A run: the motion, where it stands, and what it has done.
pub(crate) struct Run<'a, 'w, A: Space> {
    pub motion: Motion<'a, A>,
    pub time: f64,
    pub y: Vec<f64>,
    pub end: f64,
    pub sampler: Sampler<'w>,
    pub statistics: Statistics,
    pub lost: f64,
    /// The contacts of the last time step.
    pub stepped: Vec<ContactState>,
    pub memory: Memory,
    /// A leap over a pose at which the mechanism could branch, if the run stands within it.
    pub leap: Option<Leap>,
}

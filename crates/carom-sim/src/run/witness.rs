//! The values of witness functions, whose zeros end a leg: see `leg.rs`.

use crate::contact::Passing;

/// Hysteresis of gaps, m: above the rounding of positions, below the height of any bounce that is resolved.
pub(crate) const HYSTERESIS: f64 = 1e-14;

/// The value of a witness function.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Witness {
    pub value: f64,
    pub rate: Option<f64>,
    /// Of a gap of two bodies: how they move past each other.
    pub passing: Option<Passing>,
    /// Hysteresis: values up to this count as zero. `None`: a witness that is never armed before it is positive, such as a force.
    pub band: Option<f64>,
    /// Whether it may fall below zero and recover within a step.
    pub dips: bool,
}

impl Witness {
    /// A gap and its rate.
    pub fn gap(value: f64, rate: f64) -> Self {
        Self { value, rate: Some(rate), band: Some(HYSTERESIS), ..Self::default() }
    }

    /// A velocity with this resolution.
    pub fn velocity(value: f64, band: f64) -> Self {
        Self { value, band: Some(band), ..Self::default() }
    }

    /// The margin of a force.
    pub fn margin(value: f64) -> Self {
        Self { value, dips: true, ..Self::default() }
    }

    /// A quantity that matters only where it stays below zero.
    pub fn bound(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    /// Whether it is a gap.
    pub fn is_gap(&self) -> bool {
        self.band == Some(HYSTERESIS)
    }

    /// The value above which it is armed.
    pub fn least(&self) -> f64 {
        self.band.unwrap_or(0.0)
    }
}

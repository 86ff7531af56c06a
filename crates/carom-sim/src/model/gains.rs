//! The joints that motors drive, and gains for each of them.

use crate::error::{SimError, require};
use carom_chain::{Chain, Coordinates};

/// One non-negative number for all joints, or one for each number of qd.
#[derive(Debug, Clone, PartialEq)]
pub enum Gains {
    /// The same at all joints.
    Same(f64),
    /// One for each number of qd, length nv; those of floating and planar joints are not used.
    Each(Vec<f64>),
}

impl From<f64> for Gains {
    fn from(gain: f64) -> Self {
        Self::Same(gain)
    }
}

impl From<Vec<f64>> for Gains {
    fn from(gains: Vec<f64>) -> Self {
        Self::Each(gains)
    }
}

impl Gains {
    /// The gain of a number of qd.
    pub(crate) fn at(&self, v: usize) -> f64 {
        match self {
            Self::Same(gain) => *gain,
            Self::Each(gains) => gains[v],
        }
    }

    /// The gains of all `nv` numbers of qd, to be changed one by one.
    pub(super) fn each(&mut self, nv: usize) -> &mut [f64] {
        if let Self::Same(gain) = self {
            *self = Self::Each(vec![*gain; nv]);
        }
        match self {
            Self::Same(gain) => std::slice::from_mut(gain),
            Self::Each(gains) => gains,
        }
    }

    /// # Errors
    /// [`SimError`]: a gain that is negative or not finite, or a list of another length than nv.
    pub(crate) fn check(&self, what: &'static str, chain: &Chain) -> Result<(), SimError> {
        let gains = match self {
            Self::Same(gain) => std::slice::from_ref(gain),
            Self::Each(gains) => {
                chain.check_v(what, gains)?;
                gains.as_slice()
            }
        };
        gains.iter().try_for_each(|&gain| not_negative(what, gain))
    }
}

/// # Errors
/// [`SimError::Setting`] for a number that is negative or not finite.
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<(), SimError> {
    require(value >= 0.0 && value.is_finite(), what, value, "it must be finite and not negative")
}

/// A joint with one coordinate, which a motor can drive. Floating and planar joints have none: nothing drives a base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motor {
    /// Its entries of q and qd.
    pub q: usize,
    pub v: usize,
    /// Its effort limit in the URDF, N m or N; infinite without one.
    pub effort: f64,
}

/// The joints that motors can drive, in the order of qd.
pub(crate) fn motors(chain: &Chain) -> Vec<Motor> {
    let one = |joint: &carom_chain::JointInfo| match &joint.coordinates {
        Coordinates::Own { q, v } if v.len() == 1 => {
            Some(Motor { q: q.start, v: v.start, effort: joint.limits.effort.unwrap_or(f64::INFINITY) })
        }
        _ => None,
    };
    let mut motors: Vec<Motor> = chain.joints().iter().filter_map(one).collect();
    motors.sort_by_key(|motor| motor.v);
    motors
}

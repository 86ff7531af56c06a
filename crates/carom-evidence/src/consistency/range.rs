//! Ranges of the quantities of a pose.

use serde::Serialize;

/// A closed interval; an end without bound is infinite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Range {
    /// The lower end.
    #[serde(skip_serializing_if = "is_unbounded")]
    pub least: f64,
    /// The upper end.
    #[serde(skip_serializing_if = "is_unbounded")]
    pub most: f64,
}

fn is_unbounded(end: &f64) -> bool {
    !end.is_finite()
}

impl Range {
    pub fn over(numbers: impl Iterator<Item = f64>) -> Self {
        let none = Self { least: f64::INFINITY, most: f64::NEG_INFINITY };
        numbers.fold(none, |r, x| Self { least: r.least.min(x), most: r.most.max(x) })
    }

    /// Whether the interval contains `x`.
    #[cfg(test)]
    pub fn holds(&self, x: f64) -> bool {
        (self.least..=self.most).contains(&x)
    }
}

/// What e and E tell of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Pose {
    pub h: f64,
    pub d: f64,
}

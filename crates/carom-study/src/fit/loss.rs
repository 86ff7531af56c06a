//! Loss functions.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | r | norm of one measurement's residual | `norm` |
//! | δ | threshold beyond which the loss grows linearly | `threshold` |
//! | ρ(r) | r², or 2 δ r − δ² beyond δ (P. J. Huber, Ann. Math. Statist. 35 (1964) 73) | `cost` |
//! | w(r) | ρ'(r)/(2 r): 1, or δ/r beyond δ | `weight` |

/// Loss as a function of the norm of a measurement's residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Loss {
    /// Least squares: efficient for Gaussian noise, not robust against outliers.
    Squares,
    /// Huber's loss: quadratic up to a threshold, linear beyond. The threshold is twice the median residual of the fit that
    /// minimises the sum of the residual norms. The argument is the norm of the whole residual, so an outlier is an impact,
    /// not a component of one.
    #[default]
    Huber,
}

crate::words! { Loss { Huber "huber", Squares "squares" } }

/// A loss with its threshold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cost {
    /// δ; infinite for squares, 0 for the norm itself.
    pub threshold: f64,
}

impl Cost {
    /// Sum of the norms; its minimiser determines the scale of the residuals.
    pub const NORMS: Self = Self { threshold: 0.0 };
    pub const SQUARES: Self = Self { threshold: f64::INFINITY };

    /// ρ.
    pub fn of(self, norm: f64) -> f64 {
        if self.threshold == 0.0 {
            norm
        } else if norm <= self.threshold {
            norm * norm
        } else {
            self.threshold * (2.0 * norm - self.threshold)
        }
    }

    /// Sum over measurements.
    pub fn sum(self, norms: &[f64]) -> f64 {
        norms.iter().map(|&norm| self.of(norm)).sum()
    }

    /// w.
    pub fn weight(self, norm: f64) -> f64 {
        if norm <= self.threshold { 1.0 } else { self.threshold / norm }
    }
}

/// Median (of an even number of values, the mean of the middle two); 0 without values.
#[doc(hidden)] // for carom-evidence
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

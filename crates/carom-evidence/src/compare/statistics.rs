//! Folds, and statistics of errors on held-out measurements.

use carom_study::fit::{median, shuffled};
use serde::Serialize;

/// The fold of each of `count` measurements: the measurements are dealt out in the order of [`shuffled`], so that the sizes of
/// two folds differ by at most one.
pub(super) fn folds(count: usize, folds: usize, seed: u64) -> Vec<usize> {
    let mut of = vec![0; count];
    for (place, k) in shuffled(count, seed).into_iter().enumerate() {
        of[k] = place % folds;
    }
    of
}

/// A mean with its standard error, the sample standard deviation divided by √n; the error of one value is 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Estimate {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
}

impl Estimate {
    /// Mean and standard error of values; zeros without values.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        if values.is_empty() {
            return Self { mean: 0.0, standard_error: 0.0 };
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        Self { mean, standard_error: (variance / n).sqrt() }
    }

    /// The mean of the differences `a − b` of paired values: its standard error is smaller than that of two independent
    /// means where the two values of a pair rise and fall together.
    pub fn of_pairs(a: &[f64], b: &[f64]) -> Self {
        let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        Self::of(&differences)
    }
}

/// Statistics of errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Spread {
    /// Mean and its standard error.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// Median.
    pub median: f64,
}

impl Spread {
    pub(super) fn of(values: &[f64]) -> Self {
        Self { estimate: Estimate::of(values), median: median(values.iter().copied()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_measurement_is_in_one_fold_and_folds_are_of_equal_size() {
        for (count, number) in [(10, 2), (11, 3), (285, 5)] {
            let of = folds(count, number, 7);
            assert_eq!(of.len(), count);
            let sizes: Vec<usize> = (0..number).map(|fold| of.iter().filter(|it| **it == fold).count()).collect();
            assert_eq!(sizes.iter().sum::<usize>(), count);
            assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
            // the first measurements of the order, to which tosses are fitted, are spread over the folds alike
            let first = shuffled(count, 7).into_iter().take(number).map(|k| of[k]);
            assert_eq!(first.collect::<Vec<_>>(), (0..number).collect::<Vec<_>>());
        }
        assert_ne!(folds(100, 5, 1), folds(100, 5, 2), "the seed decides");
    }

    /// Differences 1, 2, 3: mean 2, sample variance 1, standard error 1/√3. Unpaired, the two means have a larger one.
    #[test]
    fn the_paired_standard_error_is_that_of_the_differences() {
        let (a, b) = ([11.0, 22.0, 33.0], [10.0, 20.0, 30.0]);
        let paired = Estimate::of_pairs(&a, &b);
        assert!((paired.mean - 2.0).abs() < 1e-15);
        assert!((paired.standard_error - (1.0_f64 / 3.0).sqrt()).abs() < 1e-15, "{paired:?}");
        assert!(paired.standard_error < 0.1 * Estimate::of(&a).standard_error);
        assert_eq!(Estimate::of(&[3.0]), Estimate { mean: 3.0, standard_error: 0.0 });
    }
}

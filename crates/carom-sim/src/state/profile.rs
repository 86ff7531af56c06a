//! Numbers over time.

use crate::error::{SimError, require};
use std::sync::Arc;

/// `N` numbers over time, linear between given times, constant before the first and after the last one. Clones share their
/// memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile<const N: usize> {
    times: Arc<[f64]>,
    values: Arc<[[f64; N]]>,
}

impl<const N: usize> Profile<N> {
    /// The profile through `values` at `times` (s). The times ascend; a time that is given twice is a jump.
    ///
    /// # Errors
    /// [`SimError::Setting`]: no row, other numbers of times and of values, times that descend or are given more than twice,
    /// numbers that are not finite.
    pub fn new(times: &[f64], values: &[[f64; N]]) -> Result<Self, SimError> {
        let names = ["number of rows of the table", "number in the table", "time in the table"];
        check_rows(names, times, values)?;
        for three in times.windows(3) {
            let rule = "a jump has two rows of the same time, not more";
            require(three[0] != three[2], "time in the table", three[0], rule)?;
        }
        Ok(Self { times: times.into(), values: values.into() })
    }

    /// The same numbers at all times.
    pub fn constant(value: [f64; N]) -> Self {
        Self { times: [0.0].into(), values: [value].into() }
    }

    /// The times of the rows, s.
    pub(crate) fn times(&self) -> &[f64] {
        &self.times
    }

    /// The numbers at a time (s); at a jump those after it.
    pub fn at(&self, time: f64) -> [f64; N] {
        let (before, after, share) = between(&self.times, time);
        let (a, b) = (&self.values[before], &self.values[after]);
        std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
    }

    /// Their rates at a time; at the time of a row those after it.
    pub(crate) fn rate(&self, time: f64) -> [f64; N] {
        let (before, after, _) = between(&self.times, time);
        let (a, b, span) = (&self.values[before], &self.values[after], self.times[after] - self.times[before]);
        std::array::from_fn(|i| if span > 0.0 { (b[i] - a[i]) / span } else { 0.0 })
    }

    /// Their integrals from time 0 to this time.
    pub fn integral(&self, time: f64) -> [f64; N] {
        let (to, from) = (self.since_first(time), self.since_first(0.0));
        std::array::from_fn(|i| to[i] - from[i])
    }

    /// Their integrals from the first row.
    fn since_first(&self, time: f64) -> [f64; N] {
        let mut sum = [0.0; N];
        let mut add = |span: f64, a: &[f64; N], b: &[f64; N]| {
            (0..N).for_each(|i| sum[i] += 0.5 * span * (a[i] + b[i]));
        };
        let (first, last) = (self.times[0], self.times[self.times.len() - 1]);
        if time <= first {
            add(time - first, &self.values[0], &self.values[0]);
            return sum;
        }
        for k in 1..self.times.len() {
            if time <= self.times[k] {
                add(time - self.times[k - 1], &self.values[k - 1], &self.at(time.next_down()));
                return sum;
            }
            add(self.times[k] - self.times[k - 1], &self.values[k - 1], &self.values[k]);
        }
        let end = &self.values[self.values.len() - 1];
        add(time - last, end, end);
        sum
    }

    /// The first time of a row after `time`.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        next_of(&self.times, time)
    }
}

/// The rows of a table before and after a time, and the interpolation weight of the later one; outside the table twice the
/// first or last row.
pub(crate) fn between(times: &[f64], time: f64) -> (usize, usize, f64) {
    let after = times.partition_point(|&t| t <= time);
    if after == 0 || after == times.len() {
        let row = after.min(times.len() - 1);
        return (row, row, 0.0);
    }
    (after - 1, after, (time - times[after - 1]) / (times[after] - times[after - 1]))
}

/// Checks a table over time: what its number of rows, its numbers and its times are called in messages, its times, and its rows.
pub(crate) fn check_rows<R: AsRef<[f64]>>(
    [count, number, time]: [&'static str; 3],
    times: &[f64],
    rows: &[R],
) -> Result<(), SimError> {
    let paired = !times.is_empty() && times.len() == rows.len();
    require(paired, count, rows.len() as f64, "it must be the number of times, and at least 1")?;
    for &x in times.iter().chain(rows.iter().flat_map(AsRef::as_ref)) {
        require(x.is_finite(), number, x, "it must be finite")?;
    }
    times.windows(2).try_for_each(|pair| require(pair[0] <= pair[1], time, pair[1], "the times of a table must ascend"))
}

/// The first of ascending times after `time`.
pub(crate) fn next_of(times: &[f64], time: f64) -> Option<f64> {
    times.get(times.partition_point(|&t| t <= time)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rate is the derivative of the value and the value that of the integral, at both sides of rows and of a jump.
    #[test]
    fn value_rate_and_integral_of_a_profile_agree() {
        let profile = Profile::new(&[-0.5, 1.0, 1.0, 2.5], &[[1.0], [4.0], [-2.0], [1.0]]).unwrap();
        for time in [-2.0, -0.3, 0.0, 0.4, 0.999, 1.001, 1.7, 2.4, 2.6, 9.0] {
            let h = 1e-6;
            let [ahead, behind] = [h, -h].map(|h| (profile.at(time + h)[0], profile.integral(time + h)[0]));
            // Central differences of linear and quadratic functions are exact up to rounding over h.
            assert!(((ahead.0 - behind.0) / (2.0 * h) - profile.rate(time)[0]).abs() < 1e-8, "rate at {time}");
            assert!(((ahead.1 - behind.1) / (2.0 * h) - profile.at(time)[0]).abs() < 1e-8, "value at {time}");
        }
        assert_eq!((profile.at(1.0), profile.at(1f64.next_down())[0].round()), ([-2.0], 4.0));
        // Trapezoids: ½·1.5·(1+4) before the jump, ½·1.5·(−2+1) after it.
        let whole = profile.integral(2.5)[0] - profile.integral(-0.5)[0];
        assert!((whole - (3.75 - 0.75)).abs() < 1e-14, "{whole}");
        assert_eq!(profile.next_kink(1.0), Some(2.5));
    }

    #[test]
    fn tables_without_order_are_refused() {
        for times in [vec![], vec![1.0, 0.0], vec![0.0, 0.0, 0.0], vec![f64::NAN]] {
            assert!(Profile::new(&times, &vec![[0.0]; times.len()]).is_err(), "{times:?}");
        }
        assert!(Profile::new(&[0.0], &[[1.0], [2.0]]).is_err());
        assert!(Profile::new(&[0.0], &[[f64::INFINITY]]).is_err());
    }
}

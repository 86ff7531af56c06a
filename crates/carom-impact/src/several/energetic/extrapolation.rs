//! One step of a differential equation y' = f(y): the explicit midpoint rule with 2, 4, … 12 substeps, extrapolated to
//! infinitely many (W. B. Gragg 1965; R. Bulirsch, J. Stoer 1966). The result is of order 12, its error is estimated
//! by the difference from the second best result.

/// Number of substeps of each row of the table, divided by two.
const ROWS: usize = 6;

/// Order of the error estimate in the step.
pub(super) const ORDER: i32 = 2 * ROWS as i32 - 1;

/// Memory for steps, and the result of the last one.
pub(super) struct Extrapolation {
    /// State at the end of the step.
    pub end: Vec<f64>,
    /// State at the middle of the step, of order 2 only.
    pub middle: Vec<f64>,
    /// Slopes at the start of the step and inside it.
    first: Vec<f64>,
    slope: Vec<f64>,
    at: Vec<f64>,
    before: Vec<f64>,
    table: Vec<Vec<f64>>,
}

impl Extrapolation {
    pub fn new(size: usize) -> Self {
        let zero = vec![0.0; size];
        Self {
            end: zero.clone(),
            middle: zero.clone(),
            first: zero.clone(),
            slope: zero.clone(),
            at: zero.clone(),
            before: zero.clone(),
            table: vec![zero; ROWS],
        }
    }

    /// A step of length `h` from `y`; returns the largest estimated error of an entry as a share of its `scale`.
    pub fn step(&mut self, f: impl Fn(&[f64], &mut [f64]), y: &[f64], h: f64, scale: &[f64]) -> f64 {
        let Self { end, middle, first, slope, at, before, table } = self;
        let size = y.len();
        let mut error = 0.0_f64;
        f(y, first);
        for row in 0..ROWS {
            let count = 2 * (row + 1);
            let s = h / count as f64;
            // Increments from y, which round less than the states: w₀ = 0, w₁ = s f(y), wₘ₊₁ = wₘ₋₁ + 2 s f(y + wₘ).
            let mut w = std::mem::take(&mut table[row]);
            for i in 0..size {
                (before[i], w[i]) = (0.0, s * first[i]);
            }
            for m in 1..count {
                for i in 0..size {
                    at[i] = y[i] + w[i];
                }
                if row + 1 == ROWS && 2 * m == count {
                    middle.copy_from_slice(at);
                }
                f(at, slope);
                for i in 0..size {
                    (before[i], w[i]) = (w[i], before[i] + 2.0 * s * slope[i]);
                }
            }
            // Neville's scheme in s²: the entry k of the table becomes the value that uses the substeps of rows k to `row`.
            end.copy_from_slice(&w);
            table[row] = w;
            for k in (0..row).rev() {
                let share = (count as f64 / (2 * (k + 1)) as f64).powi(2) - 1.0;
                for i in 0..size {
                    let better = end[i] + (end[i] - table[k][i]) / share;
                    if k == 0 && row + 1 == ROWS {
                        error = error.max((better - end[i]).abs() / scale[i]);
                    }
                    (table[k][i], end[i]) = (better, better);
                }
            }
        }
        for i in 0..size {
            end[i] = y[i] + table[0][i];
        }
        error
    }
}

//! Tables of cycles: the states on the section that follow one another, at several values of the parameter.

use super::pictures::numbers_of;
use super::problem::Problem;
use super::{OrbitError, State};
use crate::SCENE_KEY;
use crate::diagram::Diagram;
use crate::map_study::MOST_DRAWN;
use crate::numbered::{self, Block, NumberedRows};
use crate::table::{CHUNK, Column};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// A table of cycles. A row is a function of its number: it is cycle number `skip + number % keep` at the value number `number / keep` of the
/// parameter. After a cycle that does not return to the section, the rows of this value have no state.
pub struct Cycles<'p> {
    pub(super) problem: &'p Problem,
    columns: Vec<Column>,
    values: u64,
    skip: u64,
    keep: u64,
    failures: Mutex<Failures>,
    /// Where the last rows end that were computed, so that the next ones need not begin anew. Rows do not depend on it.
    left: Mutex<Left>,
    /// The column that is drawn, and its number of each row; [`MISSING`] of rows that are not computed yet.
    drawn: Option<(usize, Vec<AtomicU64>)>,
}

/// The bits of no number that a row has.
const MISSING: u64 = u64::MAX;

/// The values at which a cycle that was computed did not return.
#[derive(Default)]
struct Failures {
    count: u64,
    /// The lowest number of them, and why.
    first: Option<(u64, OrbitError)>,
}

/// Where the rows of a block end, within the cycles of a value: number of the next row, and the state, or the word of its outcome.
type Left = Option<(u64, Result<State, f64>)>;

impl Problem {
    /// The table of `keep` cycles after `skip` cycles from the start of the scene, at so many values of the parameter, evenly spaced.
    ///
    /// # Errors
    /// [`OrbitError::File`]: several values of a problem without a parameter; no value or no cycle; 2⁶⁴ rows or more.
    pub fn cycles(&self, values: u64, skip: u64, keep: u64) -> Result<Cycles<'_>, OrbitError> {
        let refuse = |rule: &str| Err(self.refusal(rule));
        if values == 0 || keep == 0 || values.checked_mul(keep).is_none() {
            return refuse("the numbers of values and of cycles must be 1 or more, and their product below 2⁶⁴");
        }
        if values > 1 && self.vary.is_none() {
            return refuse(
                "[vary] is missing, and several values of the parameter are asked for: give it parameter, from and to",
            );
        }
        self.check_modulo_at_start()?;
        Ok(Cycles {
            problem: self,
            columns: self.cycle_columns(),
            values,
            skip,
            keep,
            failures: Mutex::default(),
            left: Mutex::default(),
            drawn: None,
        })
    }
}

impl Cycles<'_> {
    /// The same table, of which a column is kept for [`Cycles::picture`].
    ///
    /// # Errors
    /// [`OrbitError::File`]: a name that is no column of the state, a problem without a parameter, more than 2²⁴ rows.
    pub fn drawing(mut self, show: &str) -> Result<Self, OrbitError> {
        let refuse = |rule: String| Err(self.problem.refusal(rule));
        let state = &self.columns[2..self.columns.len() - 1];
        let Some(place) = state.iter().position(|column| column.name == show) else {
            return refuse(format!("the cycles have no column '{show}': there are {}", numbers_of(state)));
        };
        if self.values < 2 {
            return refuse("a picture of cycles is over several values of the parameter: give more values".into());
        }
        if self.rows() > MOST_DRAWN {
            return refuse(format!("the table has {} rows, and a picture allows at most {MOST_DRAWN}", self.rows()));
        }
        self.drawn = Some((2 + place, (0..self.rows()).map(|_| AtomicU64::new(MISSING)).collect()));
        Ok(self)
    }

    /// A picture of the column of [`Cycles::drawing`] over the parameter. Rows that have not been computed are computed; setting `stop`
    /// meanwhile ends that, and gives `None`, as does a table without such a column.
    pub fn picture(&self, progress: &(dyn Fn(u64) + Sync), stop: &AtomicBool) -> Option<Diagram<2>> {
        let (column, numbers) = self.drawn.as_ref()?;
        let missing = |row: u64| numbers[row as usize].load(Ordering::Relaxed) == MISSING;
        let rows = |value: u64| value * self.keep..(value + 1) * self.keep;
        (0..self.values).into_par_iter().filter(|value| rows(*value).any(missing)).for_each(|value| {
            let _kept = self.of_value(rows(value), &None, stop);
            progress(self.keep);
        });
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let points = (0..)
            .zip(numbers)
            .map(|(row, number)| [self.value(row / self.keep), f64::from_bits(number.load(Ordering::Relaxed))]);
        Some(self.dots(&self.columns[*column], &points.collect::<Vec<_>>()))
    }

    /// The number of values at which a cycle that was computed did not return, and the first of these values with the reason.
    pub fn failures(&self) -> (u64, Option<(f64, OrbitError)>) {
        let failures = self.failures.lock().unwrap_or_else(PoisonError::into_inner);
        (failures.count, failures.first.clone().map(|(number, error)| (self.value(number), error)))
    }

    /// Value number `number` of the parameter; NaN of a problem without one.
    fn value(&self, number: u64) -> f64 {
        let Some([from, to]) = self.problem.range() else { return f64::NAN };
        match self.values {
            1 => from,
            values => from + (to - from) * number as f64 / (values - 1) as f64,
        }
    }

    /// The rows `rows`, which are of one value of the parameter, and where they end.
    fn of_value(&self, rows: Range<u64>, left: &Left, stop: &AtomicBool) -> (Vec<f64>, Result<State, f64>) {
        let (number, from) = (rows.start / self.keep, rows.start % self.keep);
        let value = self.value(number);
        let failed = |error: OrbitError| {
            let outcome = error.outcome();
            let mut failures = self.failures.lock().unwrap_or_else(PoisonError::into_inner);
            failures.count += 1;
            if failures.first.as_ref().is_none_or(|(first, _)| number < *first) {
                failures.first = Some((number, error));
            }
            outcome
        };
        let (mut here, before) = match left {
            Some((row, here)) if *row == rows.start && from > 0 => (here.clone(), 0),
            _ => (Ok(self.problem.start()), self.skip + from),
        };
        let plan = match self.problem.plan(Some(value).filter(|value| value.is_finite())) {
            Ok(plan) => Some(plan),
            Err(error) => {
                here = here.and_then(|_| Err(failed(error)));
                None
            }
        };
        let next = |here: Result<State, f64>| match (&plan, here) {
            (Some(plan), Ok(state)) if !stop.load(Ordering::Relaxed) => {
                self.problem.period(plan, &state).map(|period| period.end).map_err(failed)
            }
            (_, here) => here,
        };
        for _ in 0..before {
            here = next(here);
        }
        let mut numbers = Vec::with_capacity((rows.end - rows.start) as usize * self.columns.len());
        for row in rows {
            here = next(here);
            let first = numbers.len();
            numbers.extend([value, (self.skip + row % self.keep) as f64]);
            match &here {
                Ok(State { q, qd }) => numbers.extend(q.iter().chain(qd).copied().chain([0.0])),
                Err(outcome) => {
                    numbers.extend(std::iter::repeat_n(f64::NAN, self.columns.len() - 3));
                    numbers.push(*outcome);
                }
            }
            if let Some((column, kept)) = &self.drawn {
                kept[row as usize].store(numbers[first + column].to_bits(), Ordering::Relaxed);
            }
        }
        (numbers, here)
    }
}

impl NumberedRows for Cycles<'_> {
    /// The columns: the parameter, the number of the cycle, the state on the section, the outcome.
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn rows(&self) -> u64 {
        self.values * self.keep
    }

    /// Whole values of the parameter.
    fn shard(&self, part: u64, parts: u64) -> Option<Range<u64>> {
        numbered::shard(self.values, part, parts).map(|values| values.start * self.keep..values.end * self.keep)
    }

    fn text(&self) -> (&'static str, &str) {
        (SCENE_KEY, &self.problem.scene.text)
    }

    fn sources(&self) -> Vec<(String, String)> {
        let options = format!("{} values, {} cycles after {}", self.values, self.keep, self.skip);
        self.problem.sources("the number of values or of cycles", options)
    }

    fn least(&self) -> usize {
        let keep = usize::try_from(self.keep).unwrap_or(usize::MAX);
        rayon::current_num_threads().saturating_mul(keep).clamp(CHUNK, 1 << 20)
    }

    fn compute(&self, mut block: Block) -> usize {
        let end = block.first + block.count as u64;
        let values: Vec<u64> = (block.first / self.keep..=(end - 1) / self.keep).collect();
        let rows = |value: u64| block.first.max(value * self.keep)..end.min((value + 1) * self.keep);
        let before = std::mem::take(&mut *self.left.lock().unwrap_or_else(PoisonError::into_inner));
        let found = values.par_iter().map(|value| {
            let rows = rows(*value);
            let done = rows.end - rows.start;
            let found = self.of_value(rows, &before, block.stop);
            (block.progress)(done);
            found
        });
        let mut found: Vec<_> = found.collect();
        let rows = found.iter().flat_map(|(numbers, _)| numbers.chunks_exact(block.width));
        let rows: Vec<&[f64]> = rows.collect();
        rows.into_iter().enumerate().for_each(|(place, row)| block.set(place, row));
        // Of cycles that were interrupted the state is not that of the last row.
        if block.stop.load(Ordering::Relaxed) {
            return 0;
        }
        let left = found.pop().map(|(_, left)| (end, left));
        *self.left.lock().unwrap_or_else(PoisonError::into_inner) = left;
        block.count
    }
}

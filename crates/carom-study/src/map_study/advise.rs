//! Optimal rows of a map under the criterion and constraints of `[advise]`, refined along the self-motion of redundant arms.
//!
//! Only local optima of the grid are returned: rows without a better neighbour on any axis of numbers. For an arm with more
//! joints than its tip has coordinates, each of them is then improved along the self-motion, which leaves the tip in place.
//! First, walks of fixed length along the null space of J, one in each direction of each joint, look for the best starting
//! point; then the criterion is minimised by gradient descent projected on the null space of J. After each step, Newton's
//! method returns the tip to its position.

use super::arm::Worker;
use super::axis::{Axis, places};
use super::quantity::Class;
use super::{CLASSES, Study, StudyError};
use crate::fit::median;
use rayon::prelude::*;

/// Greatest number of rows: one number for each is held in memory.
const MOST: u64 = 1 << 24;
/// Step of the central differences, rad or m; for values of size 1 their error is about 1e-10.
const DIFFERENCE: f64 = 1e-5;
/// Step of a walk, rad, and number of steps: more than half a turn of each joint.
const WALK_STEP: f64 = 0.08;
const WALK: usize = 50;
/// Initial and smallest step of the descent, rad, and greatest number of steps.
const FIRST_STEP: f64 = 0.1;
const LAST_STEP: f64 = 1e-7;
const STEPS: usize = 400;

/// Criterion and constraints, as indices of columns.
pub(super) struct Wish {
    pub column: usize,
    pub maximise: bool,
    /// Codes of the admissible classes; if empty, all classes with numbers.
    pub classes: Vec<f64>,
    /// (column, lower bound, upper bound).
    pub bounds: Vec<(usize, f64, f64)>,
    pub best: usize,
}

/// Result of [`Study::advise`].
#[derive(Debug, Clone)]
pub struct Advice {
    /// The column that is minimised or maximised.
    pub column: String,
    /// Whether it is maximised.
    pub maximise: bool,
    /// Number of rows that fulfil the constraints.
    pub fulfil: u64,
    /// Best, median and worst value of the column among these rows; `None` if there are none.
    pub spread: Option<[f64; 3]>,
    /// Local optima of the grid, at most `[advise] best` of them, in the order of the values at the end of the self-motion.
    pub best: Vec<Advised>,
}

/// A local optimum of the map.
#[derive(Debug, Clone)]
pub struct Advised {
    /// Number of the row.
    pub index: u64,
    /// The row: a number for each of [`NumberedRows::columns`](crate::NumberedRows::columns).
    pub row: Vec<f64>,
    /// Configuration of the row, rad or m.
    pub q: Vec<f64>,
    /// For a redundant arm, if the self-motion improves the criterion: the configuration at its end, and the row computed
    /// there. The columns of axes, and the columns `q.*` of that row, are still those of `row`.
    pub self_motion: Option<(Vec<f64>, Vec<f64>)>,
}

impl Wish {
    /// The cost to minimise; infinite if the row violates a constraint.
    fn cost(&self, row: &[f64], class: usize) -> f64 {
        let does = if self.classes.is_empty() {
            row[class] > Class::NoImpact.code()
        } else {
            self.classes.contains(&row[class])
        };
        // false for NaN
        let within = |&(k, low, high): &(usize, f64, f64)| (low..=high).contains(&row[k]);
        let value = if self.maximise { -row[self.column] } else { row[self.column] };
        if does && value.is_finite() && self.bounds.iter().all(within) { value } else { f64::INFINITY }
    }
}

impl Study {
    /// Checks that the study has an `[advise]` that can be followed, without computing the map.
    ///
    /// # Errors
    /// As [`Study::advise`].
    #[doc(hidden)]
    pub fn check_advice(&self) -> Result<(), StudyError> {
        self.wish().map(drop)
    }

    fn wish(&self) -> Result<&Wish, StudyError> {
        let refuse = |rule: String| StudyError::File { file: self.file.clone(), rule };
        let wish = self.wish.as_ref();
        let wish = wish.ok_or_else(|| refuse("[advise] is missing: add it with minimise or maximise".into()))?;
        if self.rows > MOST {
            return Err(refuse(format!(
                "the map has {} rows, and --advise allows at most {MOST}: give the axes fewer values",
                self.rows
            )));
        }
        Ok(wish)
    }

    /// Computes the whole map and returns its local optima under the criterion and constraints of `[advise]`.
    ///
    /// # Errors
    /// [`StudyError::File`]: the study has no `[advise]`, or more than 2²⁴ rows.
    pub fn advise(&self) -> Result<Advice, StudyError> {
        let wish = self.wish()?;
        let class = self.class_column();
        let costs: Vec<f64> = (0..self.rows)
            .into_par_iter()
            .map_init(
                || (self.evaluator(), vec![0.0; self.columns.len()]),
                |(evaluator, row), index| {
                    evaluator.row(index, row);
                    wish.cost(row, class)
                },
            )
            .collect();
        let mut sorted: Vec<f64> = costs.iter().copied().filter(|cost| cost.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let value = |cost: f64| if wish.maximise { -cost } else { cost };
        let (fulfil, ends) = (sorted.len() as u64, sorted.first().copied().zip(sorted.last().copied()));
        let spread = ends.map(|(best, worst)| [best, median(sorted), worst].map(value));
        let axes = self.axes();
        let mut tops: Vec<u64> = (0..self.rows).into_par_iter().filter(|index| is_top(axes, &costs, *index)).collect();
        tops.sort_by(|a, b| costs[*a as usize].total_cmp(&costs[*b as usize]).then(a.cmp(b)));
        tops.truncate(wish.best);
        let redundant = self.engine.nv() > self.engine.conditions();
        let found = tops.par_iter().map(|&index| {
            let mut worker = self.engine.worker();
            let mut row = vec![0.0; self.columns.len()];
            worker.row(index, &mut row);
            let q = worker.pose(index).unwrap_or_default();
            let self_motion = redundant.then(|| self.descend(&mut *worker, wish, index, &q)).flatten();
            Advised { index, row, q, self_motion }
        });
        // The best after the self-motion first.
        let cost = |it: &Advised| wish.cost(it.self_motion.as_ref().map_or(&it.row, |(_, row)| row), class);
        let mut best: Vec<Advised> = found.collect();
        best.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        Ok(Advice { column: self.columns[wish.column].name.clone(), maximise: wish.maximise, fulfil, spread, best })
    }

    fn class_column(&self) -> usize {
        self.columns.iter().position(|column| column.words == CLASSES).unwrap_or_default()
    }

    /// Improves the criterion along the self-motion from `q`: the configuration found and its row. `None` without improvement.
    fn descend(&self, worker: &mut dyn Worker, wish: &Wish, index: u64, q: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let class = self.class_column();
        let mut row = vec![0.0; self.columns.len()];
        let mut cost_at = |worker: &mut dyn Worker, q: &[f64]| {
            worker.row_at(index, q, &mut row);
            wish.cost(&row, class)
        };
        let tip = worker.tip(q)?;
        let (mut q, start) = (q.to_vec(), cost_at(worker, q));
        let (mut cost, mut step) = (start, FIRST_STEP);
        let from = q.clone();
        for (joint, sign) in (0..from.len()).flat_map(|joint| [(joint, 1.0), (joint, -1.0)]) {
            let mut along = vec![0.0; from.len()];
            along[joint] = sign;
            let mut here = from.clone();
            for _ in 0..WALK {
                // continue in the direction of the previous step
                let direction = worker.self_motion(&here, &along)?;
                let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
                let mut next: Vec<f64> = here.iter().zip(&direction).map(|(x, d)| x + WALK_STEP * d / length).collect();
                if length < 1e-6 || !worker.hold(&mut next, tip) {
                    break;
                }
                along = next.iter().zip(&here).map(|(b, a)| (b - a) / WALK_STEP).collect();
                here = next;
                let there = cost_at(worker, &here);
                if there < cost {
                    (q, cost) = (here.clone(), there);
                }
            }
        }
        for _ in 0..STEPS {
            let mut downhill = vec![0.0; q.len()];
            for (k, slope) in downhill.iter_mut().enumerate() {
                let mut side = |by: f64| {
                    let mut moved = q.clone();
                    moved[k] += by;
                    cost_at(worker, &moved)
                };
                let (ahead, behind) = (side(DIFFERENCE), side(-DIFFERENCE));
                // where one side violates a constraint: the one-sided difference of the other
                *slope = match (ahead.is_finite(), behind.is_finite()) {
                    (true, true) => (behind - ahead) / (2.0 * DIFFERENCE),
                    (true, false) => (cost - ahead) / DIFFERENCE,
                    (false, true) => (behind - cost) / DIFFERENCE,
                    (false, false) => 0.0,
                };
            }
            let direction = worker.self_motion(&q, &downhill)?;
            let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length <= 1e-9 * cost.abs() {
                break;
            }
            let better = loop {
                let mut trial: Vec<f64> = q.iter().zip(&direction).map(|(x, d)| x + step * d / length).collect();
                if worker.hold(&mut trial, tip) {
                    let there = cost_at(worker, &trial);
                    if there < cost {
                        break Some((trial, there));
                    }
                }
                step /= 2.0;
                if step < LAST_STEP {
                    break None;
                }
            };
            let Some((trial, there)) = better else { break };
            (q, cost) = (trial, there);
            step = (1.5 * step).min(FIRST_STEP);
        }
        if cost >= start {
            return None;
        }
        worker.row_at(index, &q, &mut row);
        Some((q, row))
    }
}

/// Whether no neighbour on an axis of numbers is better. Of equal neighbours only the first is an optimum.
fn is_top(axes: &[Axis], costs: &[f64], index: u64) -> bool {
    let cost = costs[index as usize];
    if !cost.is_finite() {
        return false;
    }
    let mut at = vec![0; axes.len()];
    places(axes, index, &mut at);
    let mut stride = 1;
    for (axis, place) in axes.iter().zip(&at).rev() {
        if axis.names().is_empty() {
            let next = (*place + 1 < axis.count()).then(|| index + stride);
            let last = (*place > 0).then(|| index - stride);
            if next.is_some_and(|n| costs[n as usize] < cost) || last.is_some_and(|l| costs[l as usize] <= cost) {
                return false;
            }
        }
        stride *= axis.count();
    }
    true
}

//! Basins: to which attractor the motion leads from each start of a grid.
//!
//! From a start the return map is iterated. The motion has settled when the states after n and n − k cycles agree to a thousandth of the
//! tolerance; the period of the attractor is then the least divisor d of k for which those after n and n − d cycles agree to the
//! tolerance, so that a motion that approaches a cycle slowly, and from both sides in turn, is not of twice its period. An attractor is told
//! by its period and by one of its states: that whose rounded numbers are the lexicographically least of the period, so that it does not
//! depend on the phase in which the motion arrives.

use super::problem::{Grid, Problem, Timed};
use super::return_map::Period;
use super::{FAILURES, OrbitError, State};
use crate::SCENE_KEY;
use crate::map_study::{MOST_DRAWN, Values};
use crate::numbered::{Block, NumberedRows};
use crate::table::{CHUNK, Column};
use carom_chain::Coordinates;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// States that agree to this share of the tolerance of a basin are those of an attractor: the motion is nearer to it than the tolerance if it
/// approaches by a factor of at most 0.999 in each period.
const SETTLED: f64 = 1e-3;
/// Number of attractors that are told apart; cells of further ones are counted together.
const MOST_ATTRACTORS: usize = 1000;
/// Number of colours of a picture.
const COLOURS: usize = 8;

/// The attractors of the starts of a grid. A row of its table is a function of its number: the first axis varies fastest.
pub struct Basin<'p> {
    problem: &'p Problem,
    grid: &'p Grid,
    columns: Vec<Column>,
    /// The simulation, if it is the same at all places.
    plan: Option<Timed>,
    /// Of each number of (q, qd), whether it must return.
    returns: Vec<bool>,
    /// What each cell is: 0 if it is not computed yet, 1 + its outcome, or [`FIRST`] and the number of its attractor. Empty if there are too
    /// many cells for a picture.
    cells: Vec<AtomicU32>,
    outcomes: Vec<AtomicU64>,
    found: Mutex<Found>,
}

/// The first number of a cell that is that of an attractor.
const FIRST: u32 = 100;

/// Period, cycles, and rounded state of an attractor.
type Key = (usize, Vec<i64>);

#[derive(Default)]
struct Found {
    numbers: HashMap<Key, u32>,
    attractors: Vec<Attractor>,
}

/// An attractor of a basin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Attractor {
    /// Its period, cycles.
    pub period: usize,
    /// One of its states on the section, rounded to the tolerance; zero for numbers that need not return.
    pub state: State,
    /// Number of cells that were computed and lead to it.
    pub cells: u64,
}

/// How the motion from a start ends.
struct End {
    /// Number of cycles that were run.
    cycles: usize,
    /// The period and the rounded state of the attractor, or the word of the outcome.
    attractor: Result<Key, f64>,
}

impl Problem {
    /// The basin of the problem.
    ///
    /// # Errors
    /// [`OrbitError::File`] if the problem has none, or 2⁶⁴ cells or more.
    pub fn basin(&self) -> Result<Basin<'_>, OrbitError> {
        let refuse = |rule: &str| self.refusal(rule);
        let grid = self.basin.as_ref().ok_or_else(|| refuse("[basin] is missing: give it x and y"))?;
        let [x, y] = [0, 1].map(|k| &grid.axes[k].axis);
        let rows = x.count().checked_mul(y.count());
        let rows = rows.ok_or_else(|| refuse("[basin] has 2⁶⁴ cells or more: give its axes fewer points"))?;
        let mut columns = vec![Column::number(&x.name).in_unit(x.unit), Column::number(&y.name).in_unit(y.unit)];
        columns.push(Column::word("outcome", ["settled", "unsettled"].into_iter().chain(FAILURES)));
        columns.extend(["cycles", "period"].map(Column::number));
        columns.extend(self.state_columns());
        self.check_modulo_at_start()?;
        let plan = grid.is_of_starts().then(|| self.plan_in(grid, [x.value(0), y.value(0)])).transpose()?;
        let chain = &self.scene.simulation.chain;
        let mut returns = vec![true; chain.nq() + chain.nv()];
        for v in &self.modulo {
            if let Some(Coordinates::Own { q, .. }) = chain.joint_of_velocity(*v).map(|joint| &joint.coordinates) {
                returns[q.clone()].fill(false);
            }
        }
        let kept = if rows <= MOST_DRAWN { rows } else { 0 };
        Ok(Basin {
            problem: self,
            grid,
            plan,
            returns,
            cells: (0..kept).map(|_| AtomicU32::new(0)).collect(),
            outcomes: (0..FAILURES.len() + 2).map(|_| AtomicU64::new(0)).collect(),
            columns,
            found: Mutex::default(),
        })
    }
}

impl Basin<'_> {
    /// The outcomes of the cells that were computed, each with the number of its cells.
    pub fn outcomes(&self) -> Vec<(&str, u64)> {
        let words = self.columns[2].words.iter().map(String::as_str);
        let counts = self.outcomes.iter().map(|count| count.load(Ordering::Relaxed));
        words.zip(counts).filter(|(_, count)| *count > 0).collect()
    }

    /// The attractors of the cells that were computed, by decreasing number of cells; of more than 1000 the first that were found. Rows whose
    /// rounded numbers differ by one unit count for one attractor.
    pub fn attractors(&self) -> Vec<Attractor> {
        self.ordered().into_iter().map(|(_, attractor)| attractor).collect()
    }

    /// The attractors, each with its numbers of cells: those of one period whose rounded numbers differ by one unit are one attractor.
    fn ordered(&self) -> Vec<(Vec<u32>, Attractor)> {
        let found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all: Vec<(&Key, u32)> = found.numbers.iter().map(|(key, number)| (key, *number)).collect();
        let of = |number: u32| &found.attractors[number as usize];
        all.sort_by(|a, b| of(b.1).cells.cmp(&of(a.1).cells).then(a.0.cmp(b.0)));
        let mut ordered: Vec<(&Key, Vec<u32>, Attractor)> = Vec::new();
        for (key, number) in all {
            let alike = |other: &Key| other.0 == key.0 && other.1.iter().zip(&key.1).all(|(a, b)| (a - b).abs() <= 1);
            match ordered.iter_mut().find(|(other, ..)| alike(other)) {
                Some((_, numbers, attractor)) => {
                    numbers.push(number);
                    attractor.cells += of(number).cells;
                }
                None => ordered.push((key, vec![number], of(number).clone())),
            }
        }
        ordered.sort_by(|a, b| b.2.cells.cmp(&a.2.cells).then(a.0.cmp(b.0)));
        ordered.into_iter().map(|(_, numbers, attractor)| (numbers, attractor)).collect()
    }

    /// A picture of the basin as SVG: a colour for each attractor and each other outcome. Cells that have not been computed are computed;
    /// setting `stop` meanwhile ends that, and gives `None`.
    ///
    /// # Errors
    /// [`OrbitError::File`]: more than 2²⁴ cells, or the picture cannot be drawn.
    pub fn picture(&self, progress: &(dyn Fn(u64) + Sync), stop: &AtomicBool) -> Result<Option<String>, OrbitError> {
        let refuse = |rule: String| self.problem.refusal(rule);
        if self.cells.is_empty() {
            return Err(refuse(format!(
                "[basin] has {} cells, and a picture allows at most {MOST_DRAWN}: give its axes fewer points",
                self.rows()
            )));
        }
        let missing = (0..self.rows()).into_par_iter();
        missing.filter(|cell| self.cells[*cell as usize].load(Ordering::Relaxed) == 0).for_each(|cell| {
            if !stop.load(Ordering::Relaxed) {
                self.row(cell);
                progress(1);
            }
        });
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        // Words: the attractors with the most cells, the others together, and the other outcomes that occur.
        let failed: Vec<usize> =
            (1..self.outcomes.len()).filter(|k| self.outcomes[*k].load(Ordering::Relaxed) > 0).collect();
        let ordered = self.ordered();
        let room = COLOURS.saturating_sub(failed.len()).max(2);
        let named = if ordered.len() <= room { ordered.len() } else { room - 1 };
        let mut places: HashMap<u32, usize> = HashMap::new();
        let mut words = Vec::new();
        for (k, (numbers, attractor)) in ordered.iter().take(named).enumerate() {
            places.extend(numbers.iter().map(|number| (FIRST + number, k)));
            words.push(format!("{}: period {}", letter(k), attractor.period));
        }
        let others = words.len();
        words.push("other attractors".into());
        for outcome in failed {
            places.insert(1 + outcome as u32, words.len());
            words.push(self.columns[2].words[outcome].clone());
        }
        let value = |cell: &AtomicU32| *places.get(&cell.load(Ordering::Relaxed)).unwrap_or(&others) as f64;
        let values = Values {
            axes: self.grid.axes.iter().map(|it| it.axis.clone()).collect(),
            rows: (0..self.rows()).collect(),
            values: self.cells.iter().map(value).collect(),
            title: "Basins of attraction".into(),
            label: "attractor".into(),
            words,
            logarithmic: false,
        };
        values.svg().map(Some).map_err(refuse)
    }

    /// Computes a row, and notes what it is.
    fn row(&self, number: u64) -> Vec<f64> {
        let [x, y] = [0, 1].map(|k| &self.grid.axes[k].axis);
        let place = [x.value(number % x.count()), y.value(number / x.count())];
        let End { cycles, attractor } = self.end(place);
        let (outcome, cell) = match &attractor {
            Ok(key) => (0, self.noted(key)),
            Err(outcome) => (*outcome as usize, 1 + *outcome as u32),
        };
        self.outcomes[outcome].fetch_add(1, Ordering::Relaxed);
        if let Some(own) = self.cells.get(number as usize) {
            own.store(cell, Ordering::Relaxed);
        }
        let mut row = vec![place[0], place[1], outcome as f64, cycles as f64];
        match attractor {
            Ok((period, key)) => {
                row.push(period as f64);
                row.extend(self.numbers(&key));
            }
            Err(_) => row.resize(self.columns.len(), f64::NAN),
        }
        row
    }

    /// The numbers of a rounded state.
    fn numbers(&self, key: &[i64]) -> Vec<f64> {
        key.iter().map(|k| *k as f64 * self.grid.tolerance).collect()
    }

    /// Counts a cell of an attractor; returns its number of a cell.
    fn noted(&self, key: &Key) -> u32 {
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let Found { numbers, attractors } = &mut *found;
        let number = match numbers.get(key) {
            Some(number) => *number,
            None if attractors.len() == MOST_ATTRACTORS => return FIRST + MOST_ATTRACTORS as u32,
            None => {
                let all = self.numbers(&key.1);
                let (q, qd) = all.split_at(self.problem.scene.q.len());
                attractors.push(Attractor { period: key.0, state: State { q: q.to_vec(), qd: qd.to_vec() }, cells: 0 });
                numbers.insert(key.clone(), attractors.len() as u32 - 1);
                attractors.len() as u32 - 1
            }
        };
        attractors[number as usize].cells += 1;
        FIRST + number
    }

    /// Iterates the return map from a place.
    fn end(&self, place: [f64; 2]) -> End {
        let Grid { cycles: most, periods, tolerance, .. } = *self.grid;
        let failed = |cycles: usize, error: &OrbitError| End { cycles, attractor: Err(error.outcome() + 1.0) };
        let own;
        let plan = match &self.plan {
            Some(plan) => plan,
            None => match self.problem.plan_in(self.grid, place) {
                Ok(plan) => {
                    own = plan;
                    &own
                }
                Err(error) => return failed(0, &error),
            },
        };
        let mut state = State { q: plan.q.clone(), qd: plan.qd.clone() };
        self.grid.move_start(place, &mut state.q, &mut state.qd);
        let mut last: VecDeque<Vec<f64>> = VecDeque::new();
        for cycles in 1..=most {
            state = match self.problem.period(plan, &state) {
                Ok(Period { end, .. }) => end,
                Err(error) => return failed(cycles, &error),
            };
            let numbers: Vec<f64> = state.q.iter().chain(&state.qd).copied().collect();
            let agrees = |before: &[f64], within: f64| {
                let pairs = numbers.iter().zip(before).zip(&self.returns);
                pairs.into_iter().all(|((a, b), returns)| !returns || (a - b).abs() <= within)
            };
            if let Some(k) = last.iter().position(|before| agrees(before, SETTLED * tolerance)).map(|place| place + 1) {
                let divisor = |d: &usize| k.is_multiple_of(*d) && agrees(&last[*d - 1], tolerance);
                let period = (1..k).find(divisor).unwrap_or(k);
                last.push_front(numbers);
                let keys = last.iter().take(period).map(|numbers| self.rounded(numbers));
                return End { cycles, attractor: Ok((period, keys.min().unwrap_or_default())) };
            }
            last.push_front(numbers);
            last.truncate(periods);
        }
        End { cycles: most, attractor: Err(1.0) }
    }

    fn rounded(&self, numbers: &[f64]) -> Vec<i64> {
        let one = |(x, returns): (&f64, &bool)| if *returns { (x / self.grid.tolerance).round() as i64 } else { 0 };
        numbers.iter().zip(&self.returns).map(one).collect()
    }
}

/// The name of attractor number `k`.
fn letter(k: usize) -> char {
    char::from(b'A' + (k % 26) as u8)
}

impl NumberedRows for Basin<'_> {
    /// The columns: the axes, the outcome, the number of cycles that were run, the period of the attractor in cycles and its state.
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Number of cells.
    fn rows(&self) -> u64 {
        self.grid.axes.iter().map(|it| it.axis.count()).product()
    }

    fn text(&self) -> (&'static str, &str) {
        (SCENE_KEY, &self.problem.scene.text)
    }

    fn sources(&self) -> Vec<(String, String)> {
        self.problem.sources("the kind of the table", "basin".into())
    }

    fn least(&self) -> usize {
        CHUNK * rayon::current_num_threads()
    }

    fn compute(&self, mut block: Block) -> usize {
        let rows = block.map(|number| self.row(number));
        rows.iter().enumerate().for_each(|(place, row)| block.set(place, row));
        rows.len()
    }
}

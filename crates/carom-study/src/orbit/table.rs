//! Columns and rows of the tables of branches and of cycles.

use super::{Branch, FAILURES, Problem, Stability};
use crate::scene_table::coordinate_columns;
use crate::table::Column;

impl Problem {
    pub(super) fn state_columns(&self) -> Vec<Column> {
        let chain = &self.scene.simulation.chain;
        [coordinate_columns(chain, "q", true), coordinate_columns(chain, "qd", false)].concat()
    }

    /// Name of the parameter; `parameter` without one.
    pub fn parameter_name(&self) -> &str {
        self.vary.as_ref().map_or("parameter", |vary| &vary.name)
    }

    /// The range of the parameter.
    pub fn range(&self) -> Option<[f64; 2]> {
        self.vary.as_ref().map(|vary| [vary.from, vary.to])
    }

    /// The columns of a table of a branch: the parameter, the number of passages of a period, the state on the section and its time, the period,
    /// the largest multiplier, stability.
    pub fn branch_columns(&self) -> Vec<Column> {
        let mut columns = vec![Column::number(self.parameter_name()), Column::number("passages")];
        columns.extend(self.state_columns());
        columns.extend(["start_time", "period"].map(|name| Column::number(name).in_unit("s")));
        columns.extend(["multiplier.re", "multiplier.im", "multiplier.size"].map(Column::number));
        columns.push(Column::word("stability", Stability::ALL.map(Stability::name)));
        columns
    }

    pub(super) fn cycle_columns(&self) -> Vec<Column> {
        let mut columns = vec![Column::number(self.parameter_name()), Column::number("cycle")];
        columns.extend(self.state_columns());
        columns.push(Column::word("outcome", ["returned"].into_iter().chain(FAILURES)));
        columns
    }
}

impl Branch {
    /// Its rows: see [`Problem::branch_columns`].
    pub fn rows(&self) -> Vec<Vec<f64>> {
        let row = |point: &super::Point| {
            let orbit = &point.orbit;
            let largest = orbit.multipliers.first().copied().unwrap_or_default();
            let stability = Stability::ALL.iter().position(|it| *it == orbit.stability).unwrap_or_default();
            let first = [point.parameter, self.passages as f64];
            let last = [orbit.start_time, orbit.period, largest.re, largest.im, largest.norm(), stability as f64];
            [&first, orbit.start.q.as_slice(), &orbit.start.qd, &last].concat()
        };
        self.points.iter().map(row).collect()
    }
}

//! Tables and pictures of branches and of cycles.

use super::{Branch, OrbitError, Point, Problem, Stability, State};
use crate::diagram::{BLUE, Diagram, GREY, RED, Shape, Stroke};
use crate::scene_table::coordinate_columns;
use crate::table::Column;

const STABILITIES: [&str; 3] = ["stable", "neutral", "unstable"];

impl Problem {
    fn state_columns(&self) -> Vec<Column> {
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

    /// The columns of a table of a branch: the parameter, the state on the section, the period, the largest multiplier, stability.
    pub fn branch_columns(&self) -> Vec<Column> {
        let mut columns = vec![Column::number(self.parameter_name())];
        columns.extend(self.state_columns());
        columns.push(Column::number("period").in_unit("s"));
        columns.extend(["multiplier.re", "multiplier.im", "multiplier.size"].map(Column::number));
        columns.push(Column::word("stability", STABILITIES));
        columns
    }

    /// The columns of a table of cycles: the parameter, the number of the cycle, the state on the section, and whether the motion returned.
    pub fn cycle_columns(&self) -> Vec<Column> {
        let mut columns = vec![Column::number(self.parameter_name()), Column::number("cycle")];
        columns.extend(self.state_columns());
        columns.push(Column::word("outcome", ["returned", "failed"]));
        columns
    }

    /// The rows of `keep` cycles after `skip` cycles from the start of the scene, at one value of the parameter. A cycle that does not
    /// return ends them: its row has no state, and its reason is returned, too.
    ///
    /// # Errors
    /// [`OrbitError`] of the scene at this value.
    pub fn cycle_rows(
        &self,
        value: f64,
        skip: usize,
        keep: usize,
    ) -> Result<(Vec<Vec<f64>>, Option<OrbitError>), OrbitError> {
        let start = State { q: self.scene.q.clone(), qd: self.scene.qd.clone() };
        let numbers = start.q.len() + start.qd.len();
        let mut rows = Vec::new();
        for (k, state) in self.cycle(value, start)?.take(skip + keep).enumerate() {
            match state {
                Ok(_) if k < skip => {}
                Ok(State { q, qd }) => rows.push([&[value, k as f64], q.as_slice(), &qd, &[0.0]].concat()),
                Err(error) => {
                    rows.push([&[value, k as f64], vec![f64::NAN; numbers].as_slice(), &[1.0]].concat());
                    return Ok((rows, Some(error)));
                }
            }
        }
        Ok((rows, None))
    }
}

impl Point {
    /// Its row among the [columns](Problem::branch_columns) of a branch.
    pub fn row(&self) -> Vec<f64> {
        let orbit = &self.orbit;
        let largest = orbit.multipliers.first().copied().unwrap_or_default();
        let stability = STABILITIES.iter().position(|name| *name == orbit.stability.name()).unwrap_or_default();
        let last = [orbit.period, largest.re, largest.im, largest.norm(), stability as f64];
        [&[self.parameter], orbit.start.q.as_slice(), &orbit.start.qd, &last].concat()
    }
}

impl Branch {
    /// Draws a column of [`Problem::branch_columns`] over the parameter: stable orbits as a thick line, others as a thin one. `None` if there
    /// is no such column of numbers, or nothing to draw.
    pub fn diagram(&self, columns: &[Column], show: &str) -> Option<Diagram<2>> {
        let column = columns.iter().position(|column| column.name == show && column.words.is_empty())?;
        let rows: Vec<Vec<f64>> = self.points.iter().map(Point::row).collect();
        let at = |row: &[f64]| [row[0], row[column]];
        let mut shapes: Vec<Shape<2>> = Vec::new();
        for (name, colour, stroke, is) in
            [("stable", BLUE, Stroke::Thick, true), ("not stable", RED, Stroke::Thin, false)]
        {
            let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
            for k in 1..rows.len() {
                if (self.points[k].orbit.stability == Stability::Stable) != is {
                    continue;
                }
                let (from, to) = (at(&rows[k - 1]), at(&rows[k]));
                match pieces.last_mut().filter(|piece| piece.last() == Some(&from)) {
                    Some(piece) => piece.push(to),
                    None => pieces.push(vec![from, to]),
                }
            }
            if !pieces.is_empty() {
                shapes.push(Shape { name: name.into(), colour, stroke, pieces });
            }
        }
        let window = [0, 1].map(|axis| {
            let numbers = rows.iter().map(|row| at(row)[axis]);
            let [low, high] = numbers.fold([f64::MAX, f64::MIN], |[low, high], x| [x.min(low), x.max(high)]);
            let room = 0.05 * (high - low).max(1e-9 * high.abs().max(1e-300));
            [low - room, high + room]
        });
        let mut kinds: Vec<&str> = self.special.iter().map(|it| it.kind).collect();
        kinds.dedup();
        for kind in kinds {
            let lines = self.special.iter().filter(|it| it.kind == kind);
            let pieces = lines.map(|it| vec![[it.parameter, window[1][0]], [it.parameter, window[1][1]]]).collect();
            shapes.push(Shape { name: kind.into(), colour: GREY, stroke: Stroke::Thin, pieces });
        }
        let unit = columns[column].unit;
        let label = if unit.is_empty() { show.to_owned() } else { format!("{show}, {unit}") };
        let title = format!("Orbits over {}", self.parameter);
        Some(Diagram {
            title,
            axes: [self.parameter.clone(), label],
            window,
            equal_scales: false,
            shapes,
            marks: Vec::new(),
        })
    }
}

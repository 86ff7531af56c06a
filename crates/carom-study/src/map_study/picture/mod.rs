//! Pictures of a map: a curve over one axis, a heat map over two, a row of heat maps over three.
//!
//! A heat map is a PNG image inside the SVG with one pixel for each row of the map, which keeps a picture of a million rows
//! small; pixels of rows without a number are transparent and show the hatch below. Axes of lengths have one scale. Axes, colour bar and
//! legend are lines and text. Words (such as classes) have one colour each and a legend.

mod axes;
mod colours;
mod curve;
mod heat_map;
mod values;

use super::{Axis, Study, StudyError};
use axes::{ends, tick};
use rayon::prelude::*;

pub use values::Values;

/// Greatest number of rows of a picture: their values are held in memory.
pub(crate) const MOST_DRAWN: u64 = 1 << 24;
/// Greatest number of values of the axis over which heat maps stand side by side.
const PANELS: u64 = 8;

impl Study {
    /// Checks that a picture can show this column of the map, without computing it.
    ///
    /// # Errors
    /// As [`Study::values`].
    #[doc(hidden)]
    pub fn check_picture(&self, column: &str) -> Result<(), StudyError> {
        self.arrange(column).map(drop)
    }

    /// Index of a column, and the axes that vary in the order of a picture.
    fn arrange(&self, column: &str) -> Result<(usize, Vec<usize>), StudyError> {
        let refuse = |rule: String| StudyError::File { file: self.file.clone(), rule };
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let at = names.iter().position(|name| *name == column);
        let at = at.ok_or_else(|| {
            refuse(format!("the map has no column '{column}': {}", super::read::nearest(column, &names)))
        })?;
        if self.rows > MOST_DRAWN {
            return Err(refuse(format!(
                "the map has {} rows, and a picture allows at most {MOST_DRAWN}: give the axes fewer values",
                self.rows
            )));
        }
        let axes = self.axes();
        let mut chosen: Vec<usize> = (0..axes.len()).filter(|k| axes[*k].varies()).collect();
        // panels: the axis of words, else the one with fewest values; the other axes keep their order
        if chosen.len() == 3 || (chosen.len() == 2 && chosen.iter().any(|k| !axes[*k].names().is_empty())) {
            let by = |k: &&usize| (axes[**k].names().is_empty(), axes[**k].count());
            if let Some(panels) = chosen.iter().min_by_key(by).copied() {
                chosen.retain(|k| *k != panels);
                chosen.push(panels);
            }
        }
        let drawn: Vec<&str> = chosen.iter().map(|k| axes[*k].name.as_str()).collect();
        let panels = match chosen.as_slice() {
            [] => return Err(refuse("no axis varies: a picture needs an axis with more than one value".into())),
            [_] | [_, _] => chosen.get(1).filter(|k| !axes[**k].names().is_empty()).map_or(1, |k| axes[*k].count()),
            [_, _, k] => axes[*k].count(),
            _ => PANELS + 1,
        };
        if panels > PANELS {
            return Err(refuse(format!(
                "{} axes vary ({}): a picture shows one or two, and a third with at most {PANELS} values; give the others one value",
                drawn.len(),
                drawn.join(", ")
            )));
        }
        let curve = chosen.len() == 1 || (chosen.len() == 2 && !axes[chosen[1]].names().is_empty());
        let drawn = if curve { &chosen[..1] } else { &chosen[..2] };
        for axis in drawn.iter().map(|k| &axes[*k]) {
            if !axis.names().is_empty() {
                return Err(refuse(format!("the axis {} has words, not numbers: let another axis vary", axis.name)));
            }
            if !curve && !is_even(axis) {
                return Err(refuse(format!(
                    "the values of {} are not evenly spaced, as a heat map requires: give a range {{ from, to, count }}",
                    axis.name
                )));
            }
        }
        Ok((at, chosen))
    }

    /// Computes one column of the whole map, arranged for a picture.
    ///
    /// # Errors
    /// [`StudyError::File`]: no such column; no axis or too many axes vary; unevenly spaced values on an axis of a heat map;
    /// more than 2²⁴ rows.
    pub fn values(&self, column: &str) -> Result<Values, StudyError> {
        let (at, chosen) = self.arrange(column)?;
        let axes = self.axes();
        // difference in row number of neighbours on an axis
        let stride = |k: usize| axes[k + 1..].iter().map(Axis::count).product::<u64>();
        let mut rows = vec![0];
        for k in &chosen {
            let (stride, count) = (stride(*k), axes[*k].count());
            rows = (0..count).flat_map(|place| rows.iter().map(move |row| row + place * stride)).collect();
        }
        let values = rows.par_iter().map_init(
            || (self.evaluator(), vec![0.0; self.columns.len()]),
            |(evaluator, row), index| {
                evaluator.row(*index, row);
                row[at]
            },
        );
        let unit = self.unit(column);
        Ok(Values {
            axes: chosen.iter().map(|k| axes[*k].clone()).collect(),
            values: values.collect(),
            rows,
            title: conditions(axes),
            label: if unit.is_empty() { column.into() } else { format!("{column}, {unit}") },
            words: self.columns[at].words.clone(),
            logarithmic: false,
        })
    }

    /// One column of the whole map as an SVG picture, `logarithmic` or linear in its values.
    ///
    /// # Errors
    /// As [`Study::values`]; for a logarithmic scale a column of words, or with values that are not above 0; if the picture cannot
    /// be drawn.
    pub fn picture(&self, column: &str, logarithmic: bool) -> Result<String, StudyError> {
        let values = Values { logarithmic, ..self.values(column)? };
        let refuse = |rule: String| Err(StudyError::File { file: self.file.clone(), rule });
        if logarithmic && !values.words.is_empty() {
            return refuse(format!("{column}: words have no logarithmic scale: leave it out"));
        }
        let below = values.values.iter().filter(|x| **x <= 0.0);
        if let Some(least) = below.copied().reduce(f64::min).filter(|_| logarithmic) {
            return refuse(format!(
                "{column}: a logarithmic scale needs values above 0, and the least one is {least}: leave it out, or show another column"
            ));
        }
        values.svg().map_err(|rule| StudyError::File { file: self.file.clone(), rule })
    }
}

impl Values {
    /// The picture.
    ///
    /// # Errors
    /// Why it cannot be drawn.
    pub(crate) fn svg(&self) -> Result<String, String> {
        let drawn = if self.is_curve() { curve::draw(self) } else { heat_map::draw(self) };
        drawn.map_err(|e| format!("the picture cannot be drawn: {e}"))
    }
}

/// The conditions that do not vary, of all axes of a study: law, restitution, other coefficients
/// that are not 0, speed, angle.
fn conditions(axes: &[Axis]) -> String {
    let [.., _, approach, speed, restitution, tangential, friction, law] = axes else { return String::new() };
    let fixed = |axis: &Axis, text: String| (!axis.varies()).then_some(text);
    let value = |axis: &Axis| tick(axis.value(0), axis.value(0).abs() / 100.0);
    let coefficient = |axis: &Axis, name: &str| {
        fixed(axis, format!("{name} = {}", value(axis))).filter(|_| axis.value(0) != 0.0 || name == "e")
    };
    let parts = [
        fixed(law, law.names().first().cloned().unwrap_or_default()),
        coefficient(restitution, "e"),
        coefficient(tangential, "e_t"),
        coefficient(friction, "μ"),
        fixed(speed, format!("{} m/s", value(speed))),
        fixed(approach, format!("approach {}°", value(approach))),
    ];
    parts.into_iter().flatten().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
}

fn is_even(axis: &Axis) -> bool {
    let (first, last) = ends(axis);
    let step = (last - first) / (axis.count() - 1) as f64;
    (0..axis.count()).all(|k| (axis.value(k) - first - step * k as f64).abs() <= 1e-9 * (last - first).abs())
}

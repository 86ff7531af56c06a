//! Pictures: branches over the parameter, multipliers in the plane of complex numbers, the motion of one period, cycles over the parameter.

use super::{Branch, Cycles, Orbit, OrbitError, Problem, Stability};
use crate::diagram::{BLUE, Diagram, GREY, Mark, RED, Shape, Stroke, Symbol};
use crate::scene_table::state_columns;
use crate::table::Column;
use carom_sim::{Sampling, Seen};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Number of samples of the motion of one period in tables and pictures.
pub const SAMPLES: usize = 200;
/// Number of places, from bottom to top, in which states of cycles are told apart in a picture: about one pixel each.
const PLACES: f64 = 500.0;

/// The names of the columns of numbers.
pub(super) fn numbers_of(columns: &[Column]) -> String {
    let names: Vec<&str> = columns.iter().filter(|it| it.words.is_empty()).map(|it| it.name.as_str()).collect();
    names.join(", ")
}

/// The index of a column of numbers.
fn place(columns: &[Column], show: &str) -> Option<usize> {
    columns.iter().position(|column| column.name == show && column.words.is_empty())
}

fn label(column: &Column) -> String {
    if column.unit.is_empty() { column.name.clone() } else { format!("{}, {}", column.name, column.unit) }
}

/// The range of these numbers with some room; of equal numbers a range around them.
fn range(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = numbers
        .filter(|x| x.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [x.min(low), x.max(high)]);
    if low > high {
        return [0.0, 1.0];
    }
    let size = if high - low > 1e-9 * high.abs().max(low.abs()) { high - low } else { high.abs().max(1e-3) };
    [low - 0.05 * size, high + 0.05 * size]
}

impl Branch {
    /// Draws a column of [`Problem::branch_columns`] over the parameter, of this branch and of those that begin at its flips: stable orbits as
    /// a thick line, others as a thin one, a branch of one orbit as a dot. `None` if there is no such column of numbers.
    pub fn diagram(&self, doubled: &[Self], columns: &[Column], show: &str) -> Option<Diagram<2>> {
        let column = place(columns, show)?;
        let branches: Vec<(&Self, Vec<[f64; 2]>)> = std::iter::once(self)
            .chain(doubled)
            .map(|branch| (branch, branch.rows().iter().map(|row| [row[0], row[column]]).collect()))
            .collect();
        let mut shapes: Vec<Shape<2>> = Vec::new();
        for (name, colour, stroke, is) in
            [("stable", BLUE, Stroke::Thick, true), ("not stable", RED, Stroke::Thin, false)]
        {
            let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
            for (branch, rows) in &branches {
                let mut drawn = false;
                let moved = |k| branch.special.iter().any(|it| it.kind == "section" && it.after == k);
                for k in 1..rows.len() {
                    if (branch.points[k].orbit.stability == Stability::Stable) != is {
                        drawn = false;
                        continue;
                    }
                    match pieces.last_mut().filter(|_| drawn && !moved(k)) {
                        Some(piece) => piece.push(rows[k]),
                        None if moved(k) => pieces.push(vec![rows[k]]),
                        None => pieces.push(vec![rows[k - 1], rows[k]]),
                    }
                    drawn = true;
                }
            }
            if !pieces.is_empty() {
                shapes.push(Shape::new(name, colour, stroke, pieces));
            }
        }
        let all = || branches.iter().flat_map(|(_, rows)| rows);
        let window = [range(all().map(|at| at[0])), range(all().map(|at| at[1]))];
        let mut kinds: Vec<&str> = branches.iter().flat_map(|(branch, _)| &branch.special).map(|it| it.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            let lines = branches.iter().flat_map(|(branch, _)| &branch.special).filter(|it| it.kind == kind);
            let pieces = lines.map(|it| vec![[it.parameter, window[1][0]], [it.parameter, window[1][1]]]).collect();
            shapes.push(Shape::new(kind, GREY, Stroke::Thin, pieces));
        }
        let alone = |(branch, rows): &(&Self, Vec<[f64; 2]>)| {
            let (at, stable) = (rows[0], branch.points[0].orbit.stability == Stability::Stable);
            let (name, colour) = if stable { ("stable", BLUE) } else { ("not stable", RED) };
            Mark { name: name.into(), colour, symbol: Symbol::Law, at }
        };
        Some(Diagram {
            title: format!("Orbits over {}", self.parameter),
            axes: [self.parameter.clone(), label(&columns[column])],
            window,
            equal_scales: false,
            shapes,
            marks: branches.iter().filter(|(_, rows)| rows.len() == 1).map(alone).collect(),
        })
    }

    /// Draws the multipliers of the branch, those of zero left out, and the unit circle: inside of it disturbances decay. The largest ones at
    /// the ends of the branch are marked.
    pub fn multipliers(&self) -> Diagram<2> {
        let circle = (0..=SAMPLES).map(|k| TAU * k as f64 / SAMPLES as f64).map(|angle| [angle.cos(), angle.sin()]);
        let mut shapes = vec![Shape::new("unit circle", GREY, Stroke::Thin, vec![circle.collect()])];
        let of =
            |point: &super::Point| -> Vec<[f64; 2]> { point.orbit.lasting().iter().map(|x| [x.re, x.im]).collect() };
        let all: Vec<[f64; 2]> = self.points.iter().flat_map(of).chain([[1.0, 1.0], [-1.0, -1.0]]).collect();
        let window = [0, 1].map(|k| range(all.iter().map(|at| at[k])));
        // A dot is a short line.
        let half = 2e-3 * (window[0][1] - window[0][0]);
        for (name, colour, is) in [("stable", BLUE, true), ("not stable", RED, false)] {
            let points = self.points.iter().filter(|point| (point.orbit.stability == Stability::Stable) == is);
            let pieces: Vec<Vec<[f64; 2]>> =
                points.flat_map(of).map(|[x, y]| vec![[x - half, y], [x + half, y]]).collect();
            if !pieces.is_empty() {
                shapes.push(Shape::new(name, colour, Stroke::Thick, pieces));
            }
        }
        let marked = |point: Option<&super::Point>, name: &str, symbol: Symbol| -> Vec<Mark<2>> {
            let largest = point.map(of).and_then(|all| all.first().copied());
            largest.into_iter().map(|at| Mark { name: name.into(), colour: GREY, symbol, at }).collect()
        };
        let parameter = |point: Option<&super::Point>| point.map_or(0.0, |point| point.parameter);
        let (first, last) = (self.points.first(), self.points.last());
        let names = [first, last].map(|point| format!("{} = {}", self.parameter, parameter(point)));
        let mut marks = marked(first, &names[0], Symbol::Start);
        marks.extend(marked(last, &names[1], Symbol::Turn));
        Diagram {
            title: format!("Multipliers over {}", self.parameter),
            axes: ["real part".into(), "imaginary part".into()],
            window,
            equal_scales: true,
            shapes,
            marks,
        }
    }
}

impl Problem {
    /// Position and velocity of the first coordinate of one number that must return, as columns of a picture.
    pub fn usual_portrait(&self) -> Option<[String; 2]> {
        let chain = &self.scene.simulation.chain;
        let mut joints = chain.joints().iter().filter_map(|joint| Some((joint, chain.coordinate_of(joint)?)));
        let (joint, _) = joints.find(|(_, at)| !self.modulo.contains(&at.v))?;
        Some(["q", "qd"].map(|head| format!("{head}.{}", joint.name)))
    }

    /// Draws one column of the motion of one period over another; where velocities jump, a thin line leads from before to after.
    ///
    /// # Errors
    /// [`OrbitError::File`] for a name that is no column of the motion: time, q and qd; [`OrbitError`] of the run.
    pub fn portrait(&self, orbit: &Orbit, show: [&str; 2]) -> Result<Diagram<2>, OrbitError> {
        let columns = state_columns(&self.scene.simulation.chain);
        let mut at = [0; 2];
        for (own, name) in at.iter_mut().zip(show) {
            let refuse =
                || self.refusal(format!("the motion has no column '{name}': there are {}", numbers_of(&columns)));
            *own = place(&columns, name).ok_or_else(refuse)?;
        }
        let point = |time: f64, q: &[f64], qd: &[f64]| {
            let row = [&[time], q, qd].concat();
            at.map(|k| row[k])
        };
        let plan = self.plan_of(orbit)?;
        let (mut motion, mut jumps) = (vec![Vec::new()], Vec::<Vec<[f64; 2]>>::new());
        let sampling = Sampling { every: Some(orbit.period / SAMPLES as f64), ..Sampling::default() };
        plan.stream(orbit.period, sampling, &mut |seen| match seen {
            Seen::Moment(moment) => {
                let piece = motion.last_mut();
                piece.into_iter().for_each(|piece| piece.push(point(moment.time, &moment.q, &moment.qd)));
            }
            Seen::Event(event) if event.qd_minus != event.qd_plus => {
                let [before, after] = [&event.qd_minus, &event.qd_plus].map(|qd| point(event.time, &event.q, qd));
                motion.last_mut().into_iter().for_each(|piece| piece.push(before));
                jumps.push(vec![before, after]);
                motion.push(vec![after]);
            }
            _ => {}
        })?;
        let all = || motion.iter().chain(&jumps).flatten();
        let window = [0, 1].map(|k| range(all().map(|at| at[k])));
        let at_start = point(0.0, &orbit.start.q, &orbit.start.qd);
        let marks = vec![Mark { name: "start".into(), colour: GREY, symbol: Symbol::Start, at: at_start }];
        motion.retain(|piece| piece.len() > 1);
        let mut shapes = vec![Shape::new("motion", BLUE, Stroke::Thick, motion)];
        if !jumps.is_empty() {
            shapes.push(Shape::new("impact", RED, Stroke::Thin, jumps));
        }
        let axes = at.map(|k| label(&columns[k]));
        Ok(Diagram { title: "One period".into(), axes, window, equal_scales: false, shapes, marks })
    }
}

impl Cycles<'_> {
    /// Draws points of a column over the parameter.
    pub(super) fn dots(&self, column: &Column, points: &[[f64; 2]]) -> Diagram<2> {
        let window = [range(points.iter().map(|at| at[0])), range(points.iter().map(|at| at[1]))];
        let height = (window[1][1] - window[1][0]) / PLACES;
        // Neighbouring places at one value are one line.
        let taken: BTreeSet<(u64, i64)> = points
            .iter()
            .filter(|at| at[1].is_finite())
            .map(|at| (at[0].to_bits(), ((at[1] - window[1][0]) / height).floor() as i64))
            .collect();
        let mut pieces: Vec<(u64, i64, i64)> = Vec::new();
        for (value, place) in taken {
            match pieces.last_mut().filter(|(last, _, end)| *last == value && *end == place) {
                Some((.., end)) => *end = place + 1,
                None => pieces.push((value, place, place + 1)),
            }
        }
        let line = |(value, from, to): (u64, i64, i64)| {
            let x = f64::from_bits(value);
            [from, to].map(|place| [x, window[1][0] + place as f64 * height]).to_vec()
        };
        let pieces: Vec<Vec<[f64; 2]>> = pieces.into_iter().map(line).collect();
        let name = self.problem.parameter_name().to_owned();
        Diagram {
            title: format!("Cycles over {name}"),
            axes: [name, label(column)],
            window,
            equal_scales: false,
            shapes: vec![Shape::new("states", BLUE, Stroke::Thick, pieces)],
            marks: Vec::new(),
        }
    }
}

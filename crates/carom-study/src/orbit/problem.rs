//! A problem of orbits: its scene at values of the parameter and at places of a grid.

use super::{Orbit, OrbitError, State};
use crate::map_study::Axis;
use crate::numbered::checksums;
use crate::problem_file::{Formulas, difference, evaluated};
use carom_sim::{Formula, LinearFunction, Oscillation, Parameter, Plan, Scene, Simulation, SurfaceMotion};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// A periodic orbit that is looked for: a scene, a section, a relabelling.
///
/// ```
/// use carom_study::orbit::{Problem, Stability};
/// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies/compass.toml");
/// let orbit = Problem::from_file(file)?.find()?;
/// assert_eq!(orbit.stability, Stability::Stable);
/// # Ok::<(), carom_study::orbit::OrbitError>(())
/// ```
#[derive(Clone)]
pub struct Problem {
    /// The scene. Its start is where the search begins; its duration is the longest time of one passage.
    pub scene: Scene,
    /// The files that were read.
    pub files: Vec<PathBuf>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
    pub(super) section: Section,
    /// By what share of its period a section that is one is later than the start of the scene.
    pub(super) phase: f64,
    /// Numbers of the change of a state that need not return.
    pub(super) modulo: Vec<usize>,
    /// Of each relabelled joint: its numbers in q and qd, and the function of the others that it becomes.
    pub(super) relabel: Vec<Relabelled>,
    /// Number of passages of one period.
    pub(super) passages: usize,
    /// Whether orbits of half the passages are not meant: on a branch that begins at a flip.
    pub(super) doubled: bool,
    /// Number of periods before Newton's method begins.
    pub(super) before: usize,
    pub(super) tolerance: f64,
    pub(super) vary: Option<Vary>,
    pub(super) basin: Option<Grid>,
    /// The text of the problem file.
    pub(super) text: String,
    /// The file that messages name.
    pub(super) name: String,
}

/// Where a period begins and ends.
#[derive(Debug, Clone)]
pub(super) enum Section {
    /// Each impact of these contacts.
    Contact { name: String, touches: Vec<usize> },
    /// A linear function passes zero, upwards.
    Rising { formula: String, function: LinearFunction },
    /// After this time, s.
    After(f64),
}

/// A joint whose coordinate after the section is a function of those before.
#[derive(Debug, Clone)]
pub(super) struct Relabelled {
    pub q: usize,
    pub v: usize,
    pub to: LinearFunction,
    /// The terms of the function, by numbers of qd.
    pub rates: Vec<(usize, f64)>,
}

/// A parameter and its range.
#[derive(Debug, Clone)]
pub(super) struct Vary {
    pub name: String,
    pub from: f64,
    pub to: f64,
    pub points: usize,
    /// The keys that follow it.
    pub set: Formulas,
    /// The period of the section, if it follows it.
    pub period: Option<Formula>,
}

/// A simulation with its start, and how long a passage may take.
#[derive(Clone)]
pub(super) struct Timed {
    pub plan: Plan,
    /// The period of a section that is a time, otherwise the duration of the scene, s.
    pub longest: f64,
}

impl std::ops::Deref for Timed {
    type Target = Plan;

    fn deref(&self) -> &Plan {
        &self.plan
    }
}

/// The parameter as one by which periods are differentiated.
pub(super) struct ByParameter {
    /// Of the simulation.
    pub parameter: Parameter,
    /// The derivative of the period of the section, s.
    pub period: f64,
}

/// A grid of starts.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// The axes; the first varies fastest.
    pub axes: [GridAxis; 2],
    pub set: Formulas,
    /// Greatest number of cycles.
    pub cycles: usize,
    /// Greatest number of cycles of one period of an attractor.
    pub periods: usize,
    /// To which states of attractors are rounded, in the unit of each number.
    pub tolerance: f64,
}

/// An axis of a grid.
#[derive(Debug, Clone)]
pub(super) struct GridAxis {
    pub axis: Axis,
    pub means: Means,
}

/// What the number of an axis is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Means {
    /// The number with this index in (q, qd) of the start.
    State(usize),
    /// The parameter of `vary`.
    Parameter,
    /// The number at the path of a key of the scene.
    Key,
    /// A variable of the formulas.
    Variable,
}

impl Problem {
    /// An error of the problem file.
    pub(super) fn refusal(&self, rule: impl Into<String>) -> OrbitError {
        OrbitError::File { file: self.name.clone(), rule: rule.into() }
    }

    /// The start of the scene.
    pub(super) fn start(&self) -> State {
        State { q: self.scene.q.clone(), qd: self.scene.qd.clone() }
    }

    /// What rows of a table are computed from: the files, and options of this name.
    pub(super) fn sources(&self, name: &str, options: String) -> Vec<(String, String)> {
        let mut all = vec![("the problem file".to_owned(), self.text.clone()), (name.to_owned(), options)];
        all.extend(checksums(&self.files));
        all
    }

    /// The simulation at this value of the parameter.
    pub(super) fn plan(&self, parameter: Option<f64>) -> Result<Timed, OrbitError> {
        let (Some(vary), Some(value)) = (&self.vary, parameter) else { return self.plan_with(&[], None) };
        self.plan_with(&vary.values(value), vary.period(value))
    }

    /// The simulation of a place of a grid, with its start.
    pub(super) fn plan_in(&self, grid: &Grid, place: [f64; 2]) -> Result<Timed, OrbitError> {
        let mut timed = self.plan_by_keys(grid, place)?;
        let Plan { q, qd, .. } = &mut timed.plan;
        grid.move_start(place, q, qd);
        Ok(timed)
    }

    /// The same before numbers of its start are set.
    fn plan_by_keys(&self, grid: &Grid, place: [f64; 2]) -> Result<Timed, OrbitError> {
        let (mut values, mut period) = (Vec::new(), None);
        if let Some(vary) = &self.vary {
            let axis = (0..2).find(|k| grid.axes[*k].means == Means::Parameter);
            let value = axis.map_or(vary.from, |k| place[k]);
            values.extend(vary.values(value));
            period = vary.period(value);
        }
        for (GridAxis { axis, means }, value) in grid.axes.iter().zip(place) {
            if *means == Means::Key {
                values.push((axis.name.clone(), value));
            }
        }
        let names = [0, 1].map(|k| (grid.axes[k].axis.name.as_str(), place[k]));
        values.extend(evaluated(&grid.set, &names));
        self.plan_with(&values, period)
    }

    /// # Errors
    /// [`OrbitError::File`] if one axis of a basin sets a number of the start that the other changes by keys of the scene.
    pub(super) fn check_axes(&self, grid: &Grid) -> Result<(), OrbitError> {
        let ends = |k: usize| [0, grid.axes[k].axis.count() - 1].map(|row| grid.axes[k].axis.value(row));
        for (own, other) in [(0, 1), (1, 0)] {
            let means = |k: usize| &grid.axes[k].means;
            let (Means::State(n), false) = (means(own), matches!(means(other), Means::State(_))) else { continue };
            let mut found = Vec::new();
            for value in ends(other) {
                let mut place = [ends(0)[0], ends(1)[0]];
                place[other] = value;
                let Plan { q, qd, .. } = self.plan_by_keys(grid, place)?.plan;
                found.push(q.into_iter().chain(qd).nth(*n));
            }
            if found[0] != found[1] {
                let [own, other] = [own, other].map(|k| &grid.axes[k].axis.name);
                return Err(self.refusal(format!(
                    "[basin] both axes set one number, {own}: {other} changes it, too. Give each axis a number of its own"
                )));
            }
        }
        Ok(())
    }

    fn plan_with(&self, values: &[(String, f64)], period: Option<f64>) -> Result<Timed, OrbitError> {
        let changed = if values.is_empty() { None } else { Some(self.scene.with_values(values)?) };
        let scene = changed.as_ref().unwrap_or(&self.scene);
        let mut plan = scene.plan()?;
        plan.simulation.tolerance = self.tolerance;
        plan.simulation.stop.clone_from(&self.scene.simulation.stop);
        let longest = match self.section {
            Section::After(given) => period.unwrap_or(given),
            _ => self.scene.duration,
        };
        if !(longest > 0.0 && longest.is_finite()) {
            let rule = "it must be positive and finite over the whole range";
            return Err(self.refusal(format!("[vary] set.\"section.period\" is {longest}: {rule}")));
        }
        self.check_surfaces(scene, longest)?;
        plan.simulation.start_time += self.phase * longest;
        Ok(Timed { plan, longest })
    }

    /// # Errors
    /// [`OrbitError::File`] if a surface has another phase or place after the period of a section than before it: no motion returns.
    fn check_surfaces(&self, scene: &Scene, period: f64) -> Result<(), OrbitError> {
        /// A period that is given with six digits is meant as the exact one.
        const DIGITS: f64 = 1e-6;
        /// A surface this near, m, has returned: tables of velocities have rounded numbers.
        const RETURNED: f64 = 1e-9;
        // A relabelled state may belong to the mirrored motion, half a period later.
        if !matches!(self.section, Section::After(_)) || !self.relabel.is_empty() {
            return Ok(());
        }
        for surface in &scene.surfaces {
            if let Some(SurfaceMotion::Translation(velocity)) = &surface.motion {
                let start = self.scene.simulation.start_time + self.phase * period;
                let [from, to] = [start, start + period].map(|time| velocity.integral(time));
                let moved = from.iter().zip(to).fold(0.0, |most: f64, (from, to)| most.max((to - from).abs()));
                if moved > RETURNED {
                    return Err(self.refusal(format!(
                        "[section] period = {period}: surface {} is {moved:.3e} m away after it, and no motion returns. Give it a motion that returns",
                        surface.name
                    )));
                }
            }
            let Some(SurfaceMotion::Oscillation(Oscillation { amplitude, frequency, .. })) = &surface.motion else {
                continue;
            };
            // In Hz, as in the file: the conversions change its last digits.
            let frequency = (frequency.abs() / TAU * 1e12).round() / 1e12;
            let count = period * frequency;
            let whole = count.round().max(1.0);
            if amplitude.norm() > 0.0 && frequency != 0.0 && (count - whole).abs() > DIGITS * whole {
                return Err(self.refusal(format!(
                    "[section] period = {period}: surface {} moves with {frequency} Hz, {count:.6} times in it, and no motion returns. Give a \
                     whole number of its periods, as {}; where [vary] changes the frequency, give set.\"section.period\" there",
                    surface.name, whole / frequency
                )));
            }
        }
        Ok(())
    }

    /// The simulation that starts on an orbit, at the first value of the parameter.
    ///
    /// # Errors
    /// [`OrbitError`] of the scene.
    pub fn plan_of(&self, orbit: &Orbit) -> Result<Plan, OrbitError> {
        let State { q, qd } = orbit.start.clone();
        let mut plan = self.plan(self.vary.as_ref().map(|vary| vary.from))?.plan;
        plan.simulation.start_time = orbit.start_time;
        Ok(Plan { q, qd, ..plan })
    }

    /// The parameter of the problem at a value, as one by which runs are differentiated.
    pub(super) fn parameter(&self, value: f64) -> Option<ByParameter> {
        let vary = self.vary.clone()?;
        let (scene, tolerance) = (self.scene.clone(), self.tolerance);
        let scale = value.abs().max(1e-3 * (vary.to - vary.from).abs());
        let period = difference(scale, |by| Ok(vary.period(value + by).unwrap_or(0.0))).ok()?;
        let parameter = Parameter::try_new(vary.name.clone(), scale, move |simulation, delta| {
            let changed = scene.with_values(&vary.values(value + delta))?.plan()?.simulation;
            let Simulation { stop, max_events, start_time, .. } = simulation;
            let (stop, max_events, start_time) = (stop.clone(), *max_events, *start_time);
            *simulation = Simulation { stop, max_events, start_time, tolerance, ..changed };
            Ok(())
        });
        Some(ByParameter { parameter, period })
    }
}

impl Vary {
    /// The values of the keys.
    fn values(&self, value: f64) -> Vec<(String, f64)> {
        if self.set.is_empty() && self.period.is_none() {
            return vec![(self.name.clone(), value)];
        }
        evaluated(&self.set, &[(&self.name, value)])
    }

    /// The period of the section, if it follows the parameter.
    fn period(&self, value: f64) -> Option<f64> {
        self.period.as_ref().map(|formula| formula.at(&[value]))
    }
}

impl Grid {
    /// Whether all places have one simulation, and only the start differs.
    pub fn is_of_starts(&self) -> bool {
        self.set.is_empty() && self.axes.iter().all(|axis| matches!(axis.means, Means::State(_)))
    }

    /// Sets the numbers of a start that are those of a place.
    pub fn move_start(&self, place: [f64; 2], q: &mut [f64], qd: &mut [f64]) {
        for (axis, value) in self.axes.iter().zip(place) {
            match axis.means {
                Means::State(k) if k < q.len() => q[k] = value,
                Means::State(k) => qd[k - q.len()] = value,
                _ => {}
            }
        }
    }
}

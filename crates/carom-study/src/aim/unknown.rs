//! A scene as a function of unknowns: numbers of its file, formulas of several, and torques.

use super::torque::Torque;
use crate::problem_file::{self, Formulas, evaluated, formulas};
use carom_sim::{Moment, Plan, Scene, SimError};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnknownKeys {
    number: Option<String>,
    name: Option<String>,
    #[serde(default)]
    set: BTreeMap<String, String>,
    first: Option<f64>,
    from: Option<f64>,
    to: Option<f64>,
}

/// A scene as a function of unknowns.
#[derive(Clone)]
pub(super) struct Given {
    pub scene: Scene,
    pub unknowns: Vec<Own>,
    pub torque: Option<Torque>,
    /// Where all segments but the first begin, as displacement and change of velocity from these states: see `segments.rs`.
    pub knots: Vec<Moment>,
}

/// An unknown, with its place in the scene: a number of the file, or formulas of it.
#[derive(Clone)]
pub(super) struct Own {
    pub name: String,
    pub first: f64,
    pub bounds: [f64; 2],
    /// Its key, if it is a number of the file.
    pub path: Option<String>,
    /// Otherwise the numbers of the file that follow it.
    set: Formulas,
    /// Where it changes the start, and whether only in proportion.
    pub start: Option<FirstState>,
    /// Whether it changes more of the simulation than its start and its duration.
    pub acts: bool,
}

/// What an unknown changes at the start.
#[derive(Clone)]
pub(super) enum FirstState {
    /// The derivatives of displacement and velocity, which are the same everywhere.
    Linear(Vec<f64>),
    /// They must be computed at each place.
    Curved,
}

impl Own {
    /// The paths of the numbers of the file that it sets.
    pub fn numbers(&self) -> impl Iterator<Item = &str> {
        self.path.as_deref().into_iter().chain(self.set.iter().map(|(path, _)| path.as_str()))
    }
}

impl Given {
    /// The unknowns at the start of the search.
    pub fn first(&self) -> Vec<f64> {
        let torques = self.torque.iter().flat_map(|own| own.each(&own.first));
        self.unknowns.iter().map(|own| own.first).chain(torques).chain(self.of_knots(0.0)).collect()
    }

    /// Their names, but for those of knots.
    pub fn names(&self) -> Vec<String> {
        let torques = self.torque.iter().flat_map(|own| {
            own.joints.iter().flat_map(|joint| (0..own.count).map(move |k| format!("torque {joint} {}", k + 1)))
        });
        self.unknowns.iter().map(|own| own.name.clone()).chain(torques).collect()
    }

    /// Their bounds.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let torques = self.torque.iter().flat_map(|own| own.each(&own.bounds));
        let free = self.of_knots([f64::NEG_INFINITY, f64::INFINITY]);
        self.unknowns.iter().map(|own| own.bounds).chain(torques).chain(free).collect()
    }

    /// This for each number of the knots.
    fn of_knots<T: Copy>(&self, each: T) -> impl Iterator<Item = T> {
        self.knots.iter().flat_map(move |knot| std::iter::repeat_n(each, 2 * knot.qd.len()))
    }

    /// The scene at these values; its torques are in [`Given::plan`].
    pub fn scene_at(&self, u: &[f64]) -> Result<Scene, SimError> {
        let values: Vec<_> = self.unknowns.iter().zip(u).flat_map(|(own, value)| own.values(*value)).collect();
        if values.is_empty() {
            return Ok(self.scene.clone());
        }
        self.scene.with_values(&values)
    }

    /// The simulation at these values, and its duration.
    pub fn plan(&self, u: &[f64]) -> Result<(Plan, f64), SimError> {
        let scene = self.scene_at(u)?;
        let mut plan = scene.plan()?;
        if let Some(torque) = &self.torque {
            plan.simulation.drive = torque.drive(&u[self.unknowns.len()..], &plan, scene.duration);
        }
        plan.simulation.stop.clone_from(&self.scene.simulation.stop);
        Ok((plan, scene.duration))
    }
}

/// The path of the duration of a run.
const DURATION: &str = "run.duration";

impl Own {
    /// The values of its keys.
    pub fn values(&self, value: f64) -> Vec<(String, f64)> {
        match &self.path {
            Some(path) => vec![(path.clone(), value)],
            None => evaluated(&self.set, &[(&self.name, value)]),
        }
    }

    /// Its size: half of its range, or that of its first value.
    pub fn size(&self) -> f64 {
        size(self.bounds, self.first)
    }

    /// The duration that it gives, s.
    pub fn duration(&self, value: f64) -> Option<f64> {
        self.values(value).into_iter().find_map(|(path, value)| (path == DURATION).then_some(value))
    }
}

impl UnknownKeys {
    /// The unknown of a scene.
    pub fn read(&self, scene: &Scene) -> Result<Own, String> {
        let (name, path, set, first) = match (&self.number, &self.name) {
            (Some(path), None) if self.set.is_empty() => {
                let own = scene.number(path).map_err(|e| e.to_string())?;
                (path, Some(path.clone()), Formulas::new(), self.first.unwrap_or(own))
            }
            (None, Some(name)) if !self.set.is_empty() => {
                let first = self.first.ok_or("needs first, its value at the start of the search")?;
                (name, None, formulas(&self.set, &[name])?, first)
            }
            _ => return Err("needs number (the path of a key), or name and set (formulas of it by paths)".into()),
        };
        if !first.is_finite() {
            return Err(format!("first = {first}: it must be finite"));
        }
        let bounds = bounds(self.from, self.to, first)?;
        let mut own = Own { name: name.clone(), first, bounds, path, set, start: None, acts: false };
        // What it changes: from the scene at values beside the first one, inside the bounds.
        let step = 1e-3 * first.abs().max(1.0);
        let step = if first + 2.0 * step <= bounds[1] { step } else { -step };
        let at = |k: f64| scene.with_values(&own.values(first + k * step)).map_err(|e| e.to_string());
        let (a, b, c) = (at(0.0)?, at(1.0)?, at(2.0)?);
        if (&a.q, &a.qd) != (&b.q, &b.qd) {
            let slopes = |from: &Scene, to: &Scene| from_to(from, to, step).map_err(|e| e.to_string());
            let (slopes, next) = (slopes(&a, &b)?, slopes(&b, &c)?);
            let straight = slopes.iter().zip(&next).all(|(a, b)| (a - b).abs() <= STRAIGHT * a.abs().max(1.0));
            own.start = Some(if straight { FirstState::Linear(slopes) } else { FirstState::Curved });
        }
        let keeps = own.values(first).iter().all(|(path, _)| path == DURATION || problem_file::is_of_start(path));
        // A controller may depend on the velocity at the start.
        let drives = |scene: &Scene| format!("{:?}", (&scene.simulation.drive, &scene.simulation.after_impact));
        own.acts = !keeps || drives(&a) != drives(&b);
        Ok(own)
    }

    /// Its name in messages.
    pub fn label(&self, k: usize) -> String {
        self.number.as_ref().or(self.name.as_ref()).cloned().unwrap_or_else(|| (k + 1).to_string())
    }
}

/// The bounds of a number that begins at `first`.
pub(super) fn bounds(from: Option<f64>, to: Option<f64>, first: f64) -> Result<[f64; 2], String> {
    let bounds = [from.unwrap_or(f64::NEG_INFINITY), to.unwrap_or(f64::INFINITY)];
    if bounds[0].partial_cmp(&bounds[1]) != Some(std::cmp::Ordering::Less) {
        return Err(format!("from = {}, to = {}: from must be below to", bounds[0], bounds[1]));
    }
    if !(bounds[0]..=bounds[1]).contains(&first) {
        return Err(format!("its first value, {first}, is not from {} to {}: give first", bounds[0], bounds[1]));
    }
    Ok(bounds)
}

/// The size of a number: half of its range, or that of its first value.
pub(super) fn size([from, to]: [f64; 2], first: f64) -> f64 {
    if (to - from).is_finite() { 0.5 * (to - from) } else { first.abs().max(1.0) }
}

/// Derivatives of a start that are the same up to this are so up to rounding.
const STRAIGHT: f64 = 1e-9;

/// From the start of one scene to that of another, as displacement and change of velocity, for each unit of `step`.
pub(super) fn from_to(from: &Scene, to: &Scene, step: f64) -> Result<Vec<f64>, SimError> {
    let moved = from.simulation.chain.difference(&from.q, &to.q)?;
    let faster = to.qd.iter().zip(&from.qd).map(|(to, from)| to - from);
    Ok(moved.into_iter().chain(faster).map(|change| change / step).collect())
}

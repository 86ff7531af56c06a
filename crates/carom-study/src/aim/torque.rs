//! Torques of joints over time, as unknowns: at knots, or in pieces.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | τₖ | torque at knot k, or in piece k |
//! | h | time between knots, or length of a piece |
//! | ∫ τ² dt | h/3 Σ (τₖ² + τₖ τₖ₊₁ + τₖ₊₁²) between knots, h Σ τₖ² of pieces |

use super::unknown::bounds;
use carom_chain::Coordinates;
use carom_sim::{Drive, Plan, Scene, TorqueTable};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TorqueKeys {
    joints: Vec<String>,
    knots: Option<usize>,
    pieces: Option<usize>,
    first: Option<Each>,
    from: Option<Each>,
    to: Option<Each>,
}

/// One number for all joints, or one for each.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, or a list of numbers, one for each of joints")]
enum Each {
    Same(f64),
    List(Vec<f64>),
}

impl Each {
    fn of(given: &Option<Self>, key: &str, joint: usize, joints: usize) -> Result<Option<f64>, String> {
        match given {
            None => Ok(None),
            Some(Self::Same(x)) => Ok(Some(*x)),
            Some(Self::List(all)) if all.len() == joints => Ok(Some(all[joint])),
            Some(Self::List(all)) => {
                Err(format!("{key} has {} numbers: give {joints}, one for each of joints", all.len()))
            }
        }
    }
}

/// Torques over time.
#[derive(Clone)]
pub(super) struct Torque {
    pub joints: Vec<String>,
    /// Number of unknowns of each joint.
    pub count: usize,
    /// Whether each is constant over a piece of time; otherwise the torque is linear between them.
    pub pieces: bool,
    /// Of each joint.
    pub bounds: Vec<[f64; 2]>,
    pub first: Vec<f64>,
}

impl TorqueKeys {
    /// The torques of a scene.
    pub fn read(&self, scene: &Scene) -> Result<Torque, String> {
        let known = names_of_motors(scene);
        if self.joints.is_empty() {
            return Err(format!("joints is empty: give some of {}", known.join(", ")));
        }
        for (k, joint) in self.joints.iter().enumerate() {
            if !known.contains(joint) {
                return Err(format!(
                    "joints has '{joint}', which is no joint with one coordinate: there are {}",
                    known.join(", ")
                ));
            }
            if self.joints[..k].contains(joint) {
                return Err(format!("joints has '{joint}' twice: remove one"));
            }
        }
        if !matches!(scene.simulation.drive, Drive::Off) || scene.simulation.after_impact.is_some() {
            return Err("takes the place of the controller: the scene must have controller = \"off\"".into());
        }
        let (count, pieces) = match (self.knots, self.pieces) {
            (Some(knots), None) if knots >= 2 => (knots, false),
            (None, Some(pieces)) if pieces >= 1 => (pieces, true),
            _ => return Err(
                "needs knots (2 or more, with torques linear between them) or pieces (1 or more, of constant torque)"
                    .into(),
            ),
        };
        let (mut firsts, mut all) = (Vec::new(), Vec::new());
        for joint in 0..self.joints.len() {
            let of = |given, key| Each::of(given, key, joint, self.joints.len());
            let first = of(&self.first, "first")?.unwrap_or(0.0);
            if !first.is_finite() {
                return Err(format!("first = {first}: it must be finite"));
            }
            all.push(bounds(of(&self.from, "from")?, of(&self.to, "to")?, first)?);
            firsts.push(first);
        }
        Ok(Torque { joints: self.joints.clone(), count, pieces, bounds: all, first: firsts })
    }
}

impl Torque {
    /// What each joint has, for all of its unknowns.
    pub fn each<T: Copy>(&self, of_joints: &[T]) -> impl Iterator<Item = T> {
        of_joints.iter().flat_map(|own| std::iter::repeat_n(*own, self.count))
    }

    /// The times of the rows of its table, and the torques of the joints.
    pub fn rows(&self, torques: &[f64], duration: f64) -> Vec<(f64, Vec<f64>)> {
        let row = |time: f64, k: usize| {
            let forces = (0..self.joints.len()).map(|joint| torques[joint * self.count + k]).collect();
            (time, forces)
        };
        let h = self.step(duration);
        if self.pieces {
            return (0..self.count).flat_map(|k| [row(k as f64 * h, k), row((k + 1) as f64 * h, k)]).collect();
        }
        (0..self.count).map(|k| row(k as f64 * h, k)).collect()
    }

    /// The drive of a plan.
    pub fn drive(&self, torques: &[f64], plan: &Plan, duration: f64) -> Drive {
        let chain = &plan.simulation.chain;
        let places: Vec<Option<usize>> = self
            .joints
            .iter()
            .map(|name| chain.joint(name).ok().and_then(|joint| chain.coordinate_of(joint)).map(|at| at.v))
            .collect();
        let rows = self.rows(torques, duration).into_iter().map(|(time, own)| {
            let mut forces = vec![0.0; chain.nv()];
            places.iter().zip(own).for_each(|(v, force)| {
                if let Some(v) = v {
                    forces[*v] = force;
                }
            });
            (time, forces)
        });
        let (times, forces) = rows.unzip();
        Drive::Table(TorqueTable { times, forces })
    }

    /// The time between knots, or the length of a piece.
    fn step(&self, duration: f64) -> f64 {
        duration / (if self.pieces { self.count } else { self.count - 1 }) as f64
    }

    /// ∫ |τ|² dt, and its derivatives: a quadratic form of the torques, half that of its second derivatives.
    pub fn effort(&self, torques: &[f64], duration: f64) -> (f64, Vec<f64>) {
        let mut by = vec![0.0; torques.len()];
        for (i, j, x) in self.effort_twice(duration) {
            by[i] += x * torques[j];
            if i != j {
                by[j] += x * torques[i];
            }
        }
        (0.5 * by.iter().zip(torques).map(|(by, torque)| by * torque).sum::<f64>(), by)
    }

    /// The second derivatives of the effort: row, column, value, of which those above the diagonal stand for both.
    pub fn effort_twice(&self, duration: f64) -> Vec<(usize, usize, f64)> {
        let (mut all, h) = (Vec::new(), self.step(duration));
        for at in (0..self.joints.len()).map(|joint| joint * self.count) {
            if self.pieces {
                all.extend((at..at + self.count).map(|k| (k, k, 2.0 * h)));
                continue;
            }
            for k in at..at + self.count {
                let ends = k == at || k + 1 == at + self.count;
                all.push((k, k, if ends { 2.0 } else { 4.0 } * h / 3.0));
                if k + 1 < at + self.count {
                    all.push((k, k + 1, h / 3.0));
                }
            }
        }
        all
    }
}

/// The names of the joints that motors can drive.
pub(crate) fn names_of_motors(scene: &Scene) -> Vec<String> {
    let chain = &scene.simulation.chain;
    let is_own =
        |joint: &&carom_chain::JointInfo| matches!(&joint.coordinates, Coordinates::Own { v, .. } if v.len() == 1);
    let own = chain.joints().iter().filter(is_own);
    own.map(|joint| joint.name.clone()).collect()
}

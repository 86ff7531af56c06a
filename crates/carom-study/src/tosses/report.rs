//! What the roll-outs of tosses show together, as it is written.

use super::roll_out::{PoseError, RollOut, RollOutOptions};
use super::{TossError, Tosses};
use carom_sim::ContactRule;
use serde::Serialize;

/// The errors of simulated tosses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TossReport {
    /// Number of tosses, with those that failed.
    pub tosses: usize,
    /// Why tosses could not be simulated.
    pub failures: Vec<String>,
    /// Where the starts are from: [`Start::name`](super::Start::name).
    pub start: &'static str,
    /// Number of starts that were fitted to the flight; the others are given by the table.
    pub fitted_starts: usize,
    /// Number of tosses at rest at their last sample: below 0.001 m/s.
    pub at_rest: usize,
    /// Deepest penetration of the floor, m.
    pub deepest_overlap: f64,
    /// Error at the last sample.
    pub last: TossSpread,
    /// Mean error over the samples.
    pub mean: TossSpread,
    /// Pose error over the whole toss.
    pub whole: TossMeasure,
    /// Pose error to 0.1 s after the first impact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early: Option<TossMeasure>,
    /// Each toss that was simulated.
    pub each: Vec<TossErrors>,
}

/// The pose error of a part of the tosses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TossMeasure {
    /// Number of tosses that have it.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Share of the tosses with an error below 0.5.
    pub below_half: f64,
}

/// Mean and median over the tosses: m, rad, rad.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)] // the names say it
pub struct TossSpread {
    pub position_mean: f64,
    pub position_median: f64,
    pub rotation_mean: f64,
    pub rotation_median: f64,
    pub joint_mean: f64,
    pub joint_median: f64,
}

/// One toss: its [`RollOut`] with the pose errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)] // see RollOut
pub struct TossErrors {
    pub toss: i64,
    pub samples: usize,
    pub events: usize,
    pub position: f64,
    pub rotation: f64,
    pub joint: f64,
    pub final_speed: f64,
    pub deepest_overlap: f64,
    pub whole: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub early: Option<f64>,
}

/// Speed of the root link below which a toss counts as at rest, m/s.
const REST: f64 = 1e-3;

impl Tosses {
    /// Simulates all tosses as [`Tosses::roll_out`] does; what their errors are together.
    ///
    /// # Errors
    /// The first error, if no toss was simulated.
    pub fn report(&self, contact: &ContactRule, roll: &RollOutOptions) -> Result<TossReport, TossError> {
        let (mut rolled, mut failures, mut first) = (Vec::new(), Vec::new(), None);
        for one in self.roll_out(contact, roll) {
            match one {
                Ok(one) => rolled.push(one),
                Err(error) => {
                    failures.push(error.to_string());
                    first.get_or_insert(error);
                }
            }
        }
        let measure = |of: &dyn Fn(&RollOut) -> Option<f64>| {
            let mut errors: Vec<f64> = rolled.iter().filter_map(of).collect();
            errors.sort_by(f64::total_cmp);
            let count = errors.len();
            let below = errors.iter().filter(|error| **error < 0.5).count();
            (count > 0).then(|| TossMeasure {
                count,
                mean: errors.iter().sum::<f64>() / count as f64,
                median: errors[count / 2],
                below_half: below as f64 / count as f64,
            })
        };
        let Some(whole) = measure(&|one| Some(one.pose_error(roll.length))) else {
            let reason = "the table has no toss".to_owned();
            return Err(first.unwrap_or(TossError::File { file: self.urdf.with_file_name("tosses.csv"), reason }));
        };
        let spread = |of: fn(&RollOut) -> &PoseError| {
            let sorted = |part: fn(&PoseError) -> f64| {
                let mut values: Vec<f64> = rolled.iter().map(|one| part(of(one))).collect();
                values.sort_by(f64::total_cmp);
                (values.iter().sum::<f64>() / values.len() as f64, values[values.len() / 2])
            };
            let (position, rotation, joint) = (sorted(|e| e.position), sorted(|e| e.rotation), sorted(|e| e.joint));
            TossSpread {
                position_mean: position.0,
                position_median: position.1,
                rotation_mean: rotation.0,
                rotation_median: rotation.1,
                joint_mean: joint.0,
                joint_median: joint.1,
            }
        };
        let one = |one: &RollOut| TossErrors {
            toss: one.number,
            samples: one.samples,
            events: one.events,
            position: one.last.position,
            rotation: one.last.rotation,
            joint: one.last.joint,
            final_speed: one.final_speed,
            deepest_overlap: one.deepest,
            whole: one.pose_error(roll.length),
            early: one.early_error(roll.length),
        };
        Ok(TossReport {
            tosses: rolled.len() + failures.len(),
            failures,
            start: roll.start.name(),
            fitted_starts: rolled.iter().filter(|one| one.fitted).count(),
            at_rest: rolled.iter().filter(|one| one.final_speed < REST).count(),
            deepest_overlap: rolled.iter().map(|one| one.deepest).fold(0.0, f64::max),
            last: spread(|one| &one.last),
            mean: spread(|one| &one.mean),
            whole,
            early: measure(&|one| one.early_error(roll.length)),
            each: rolled.iter().map(one).collect(),
        })
    }
}

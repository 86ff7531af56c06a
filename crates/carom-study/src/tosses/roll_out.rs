//! Simulation of a toss, and its error against the measured poses.

use super::{Launch, Scene, Start, Toss, TossError, Tosses, on_floor};
use carom_sim::{ContactRule, Moment, Sampling, Seen, SeveralLaw, SimError, Simulation};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Options of the roll-outs and of their error measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RollOutOptions {
    /// Relative tolerance of the integration.
    pub tolerance: f64,
    /// Time step while several contacts are closed, s.
    pub contact_step: f64,
    /// Length that the position error is divided by in [`RollOut::pose_error`], m.
    pub length: f64,
    /// How the state at the start is determined.
    pub start: Start,
    /// The part of a toss that a fit minimises the error of.
    pub horizon: Horizon,
    /// The law of impacts of several contacts.
    pub several: SeveralLaw,
}

impl Default for RollOutOptions {
    /// 1e-6, 1 ms, and 0.0524 m, half the width of the cube of ContactNets; fitted starts, whole tosses, Moreau's law.
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            contact_step: 1e-3,
            length: 0.0524,
            start: Start::default(),
            horizon: Horizon::default(),
            several: SeveralLaw::default(),
        }
    }
}

/// The part of a toss that is compared, from its first free sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Horizon {
    /// To the last sample.
    #[default]
    Whole,
    /// To 0.1 s after the first impact.
    Early,
}

crate::words! { Horizon { Whole "whole", Early "early" } }

/// End of [`Horizon::Early`] after the first impact, s.
const EARLY: f64 = 0.1;

/// Comparison of a roll-out with the measured toss.
#[derive(Debug, Clone)]
pub struct RollOut {
    /// Number of the toss.
    pub number: i64,
    /// Number of samples from the first free one to the last.
    pub samples: usize,
    /// Error at the last sample.
    pub last: PoseError,
    /// Mean error over the samples.
    pub mean: PoseError,
    /// Mean of the squared errors over the samples: m², rad², rad².
    pub mean_square: PoseError,
    /// Mean of the squared errors over the samples to 0.1 s after the first impact: m², rad², rad²; `None` for a toss
    /// without an impact before its last sample.
    pub early_mean_square: Option<PoseError>,
    /// Speed of the root link at the end of the roll-out, m/s.
    pub final_speed: f64,
    /// Greatest penetration of the floor at a sample of the roll-out, m; 0 if there is none.
    pub deepest: f64,
    /// Number of events of the roll-out.
    pub events: usize,
    /// Whether the start was fitted to the flight.
    pub fitted: bool,
}

/// Difference between two poses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseError {
    /// Distance between the origins of the root link, m.
    pub position: f64,
    /// Angle between the rotations of the root link, rad.
    pub rotation: f64,
    /// Largest difference of a joint angle, rad, wrapped to ±π; 0 without joints.
    pub joint: f64,
}

impl Tosses {
    /// Simulates all tosses in parallel with contact rule `contact`, each to its last sample. Results are in the order of the
    /// tosses.
    pub fn roll_out(&self, contact: &ContactRule, options: &RollOutOptions) -> Vec<Result<RollOut, TossError>> {
        let (launches, scene) = (self.launches(options.start), self.scene());
        let one = |(toss, launch): (&Toss, Result<Launch, TossError>)| {
            launch?.roll_out(&scene, toss, contact, options, Horizon::Whole)
        };
        self.tosses.par_iter().zip(launches).map(one).collect()
    }
}

impl Launch {
    /// Index of the last measured sample of a part of the toss; `None` if the toss has no such part.
    #[doc(hidden)] // for carom-evidence
    pub fn end(&self, toss: &Toss, horizon: Horizon) -> Option<usize> {
        let last = toss.samples.len() - 1;
        match horizon {
            Horizon::Whole => Some(last),
            Horizon::Early => {
                let end = toss.samples[self.impact?].time + EARLY * (1.0 + 1e-9);
                toss.samples.iter().rposition(|sample| sample.time <= end)
            }
        }
    }

    /// Simulates the toss from this start. With [`Horizon::Early`] the simulation ends with this part, if there is one, and the
    /// errors are those up to there.
    #[doc(hidden)] // for carom-evidence
    pub fn roll_out(
        &self,
        scene: &Scene,
        toss: &Toss,
        contact: &ContactRule,
        options: &RollOutOptions,
        horizon: Horizon,
    ) -> Result<RollOut, TossError> {
        let refuse = |reason: SimError| TossError::Simulation { number: toss.number, reason };
        let last = self.end(toss, horizon).unwrap_or(toss.samples.len() - 1);
        let (rolled, events) = self.predict(scene, toss, last, contact, options).map_err(refuse)?;
        let simulation = on_floor(scene, contact).map_err(refuse)?;
        let mut deepest = 0.0_f64;
        for moment in &rolled {
            deepest = deepest.max(-simulation.smallest_gap(&moment.q).map_err(refuse)?);
        }
        let measured = &toss.samples[self.sample..=last];
        let errors: Vec<PoseError> = rolled.iter().zip(measured).map(|(a, b)| PoseError::between(a, b)).collect();
        let early = self.end(toss, Horizon::Early).and_then(|end| errors.get(..=end - self.sample));
        let count = errors.len();
        let end = &rolled[count - 1];
        Ok(RollOut {
            number: toss.number,
            samples: count,
            last: errors[count - 1],
            mean: PoseError::mean(&errors, |x| x),
            mean_square: PoseError::mean(&errors, |x| x * x),
            early_mean_square: early.map(|errors| PoseError::mean(errors, |x| x * x)),
            final_speed: Vector3::from_column_slice(&end.qd[..3]).norm(),
            deepest,
            events,
            fitted: self.fitted.is_some(),
        })
    }

    /// The residuals of a roll-out, whose squares sum up to [`RollOut::error`] of the part: for each sample |Δp|/√`length` in
    /// world axes, the rotation vector, and the joint, over the square root of the number of samples.
    #[doc(hidden)] // for carom-evidence
    pub fn residual(
        &self,
        scene: &Scene,
        toss: &Toss,
        contact: &ContactRule,
        options: &RollOutOptions,
    ) -> Result<Vec<f64>, SimError> {
        let last = self.end(toss, options.horizon).unwrap_or(toss.samples.len() - 1);
        let (rolled, _) = self.predict(scene, toss, last, contact, options)?;
        let share = (rolled.len() as f64).sqrt().recip();
        let both = rolled.iter().zip(&toss.samples[self.sample..=last]);
        Ok(both.flat_map(|(a, b)| apart(a, b, options.length)).map(|x| x * share).collect())
    }

    /// The simulated states at the samples from the start to the sample `last`, and the number of events.
    #[doc(hidden)] // for carom-evidence
    pub fn simulate(
        &self,
        scene: &Scene,
        toss: &Toss,
        last: usize,
        contact: &ContactRule,
        options: &RollOutOptions,
    ) -> Result<(Vec<Moment>, usize), SimError> {
        let simulation = Simulation {
            tolerance: options.tolerance,
            contact_step: options.contact_step,
            several: options.several,
            ..on_floor(scene, contact)?
        };
        let measured = &toss.samples[self.sample..=last];
        let end = measured[measured.len() - 1].time - measured[0].time;
        sampled(&simulation, (&self.q, &self.qd), end, measured.len())
    }
}

/// The states of a motion at `count` samples of equal spacing from its start to its end, and the number of its events.
pub(super) fn sampled(
    simulation: &Simulation,
    (q, qd): (&[f64], &[f64]),
    end: f64,
    count: usize,
) -> Result<(Vec<Moment>, usize), SimError> {
    let mut rolled: Vec<Moment> = Vec::new();
    let sampling = Sampling { every: Some(end / (count - 1).max(1) as f64), ..Sampling::default() };
    let summary = simulation.stream(q, qd, end, sampling, &mut |seen| {
        if let Seen::Moment(moment) = seen {
            rolled.push(moment.clone());
        }
    })?;
    // by rounding, the last sample may lie beyond the end
    rolled.truncate(count - 1);
    rolled.push(summary.last);
    Ok((rolled, summary.events))
}

impl RollOut {
    /// Error measure of B. Acosta, W. Yang, M. Posa (IEEE RA-L 7, 2022) over the samples of the roll-out: mean of |Δp|²
    /// divided by `length` (m), plus mean of Δθ² (rad²), plus the mean of the squared joint error, if there is a joint. For
    /// their cube they use half its width, 0.0524 m. As in the paper, the terms have different units: |Δp|²/`length` is a
    /// length.
    pub fn pose_error(&self, length: f64) -> f64 {
        self.mean_square.measure(length)
    }

    /// The same over the samples to 0.1 s after the first impact; `None` for a toss without an impact before its last
    /// sample.
    pub fn early_error(&self, length: f64) -> Option<f64> {
        Some(self.early_mean_square?.measure(length))
    }

    /// The error of a part of the toss.
    #[doc(hidden)] // for carom-evidence
    pub fn error(&self, horizon: Horizon, length: f64) -> Option<f64> {
        match horizon {
            Horizon::Whole => Some(self.pose_error(length)),
            Horizon::Early => self.early_error(length),
        }
    }
}

fn place(moment: &Moment) -> Vector3<f64> {
    Vector3::from_column_slice(&moment.q[..3])
}

/// The rotation of the root link at a configuration.
pub(super) fn turn(q: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]))
}

/// An angle between −π and π.
fn wrapped(x: f64) -> f64 {
    (x + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

/// The components of the difference between two poses, in the units of the measure.
fn apart(a: &Moment, b: &Moment, length: f64) -> Vec<f64> {
    let away = (place(a) - place(b)) / length.sqrt();
    let turned = turn(&b.q).rotation_to(&turn(&a.q)).scaled_axis();
    let joints = a.q[7..].iter().zip(&b.q[7..]).map(|(a, b)| wrapped(a - b));
    away.iter().chain(turned.iter()).copied().chain(joints).collect()
}

impl PoseError {
    /// The differences of two poses.
    #[doc(hidden)] // for carom-evidence
    pub fn between(a: &Moment, b: &Moment) -> Self {
        let joints = a.q[7..].iter().zip(&b.q[7..]);
        Self {
            position: (place(a) - place(b)).norm(),
            rotation: turn(&a.q).angle_to(&turn(&b.q)),
            joint: joints.map(|(a, b)| wrapped(a - b).abs()).fold(0.0, f64::max),
        }
    }

    /// The mean of a function of each component.
    #[doc(hidden)] // for carom-evidence
    pub fn mean(errors: &[Self], of: fn(f64) -> f64) -> Self {
        let count = errors.len() as f64;
        let mean = |part: fn(&Self) -> f64| errors.iter().map(|e| of(part(e))).sum::<f64>() / count;
        Self { position: mean(|e| e.position), rotation: mean(|e| e.rotation), joint: mean(|e| e.joint) }
    }

    /// The measure of [`RollOut::pose_error`] of mean squares.
    #[doc(hidden)] // for carom-evidence
    pub fn measure(&self, length: f64) -> f64 {
        self.position / length + self.rotation + self.joint
    }
}

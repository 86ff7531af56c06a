//! The rigid limit of a scene's compliant contacts: error against the rigid run over a factor of their stiffness.
//!
//! A contact with the normal force k dⁿ lasts for a time ∝ k^(−1/(n+1)), so its outcome differs from that of an impulse by terms of
//! this order: k^(−1/2) for a linear spring, k^(−2/5) for Hertz's. With the stiffness k the other parameters change such that
//! the contact stays similar to itself: bristles by the same factor, their damping by its root, the slip speed by its
//! inverse root.

use super::{Reference, TIGHT, ends_impact, knob_value, number};
use carom_sim::{Compliance, Holding, Scene, SimError, Simulation, Touch, Trajectory, Yielding};
use serde::Serialize;
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// One run of the scene with stiffer contacts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Stiffened {
    /// Factor of all stiffnesses of the scene.
    pub factor: f64,
    /// Error of q̇ at the end of the first contact, relative to its largest entry after the rigid impact; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_impact: Option<f64>,
    /// Greater of the errors of q and of q̇ at the end, relative as in [`Run`](super::Run).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_end: Option<f64>,
}

/// Errors of the compliant contacts of a scene against rigid ones, over a factor of their stiffness.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StiffnessChart {
    /// The runs, in ascending order of the factor.
    pub(crate) runs: Vec<Stiffened>,
    /// The measured orders of both errors; `None` with fewer than two errors above zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) order_after_impact: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) order_at_end: Option<f64>,
    /// The theoretical order, 1/(n + 1); with several compliant contacts the smallest of their orders.
    pub(crate) theory: f64,
}

/// Runs per decade of the factor, and number of decades.
const PER_DECADE: i32 = 2;
const DECADES: i32 = 6;
/// The order is that of the runs within this many decades of the stiffest.
const FITTED: i32 = 2;
/// The tolerance of the compliant runs.
const TOLERANCE: f64 = 1e-12;

impl StiffnessChart {
    /// Runs a scene with rigid contacts, then with its compliant contacts at growing stiffness, until a run takes a quarter of
    /// `budget`. `done` is called after each run. `None` if the scene has no compliant contact.
    ///
    /// # Errors
    /// [`SimError`] of a run.
    pub fn of(scene: &Scene, budget: Duration, done: &mut dyn FnMut()) -> Result<Option<Self>, SimError> {
        let base = &scene.simulation;
        let orders = base.touches.iter().filter_map(|touch| touch.contact.compliance).map(order);
        let Some(theory) = orders.min_by(f64::total_cmp) else { return Ok(None) };
        let run = |sim: &Simulation| sim.run(&scene.q, &scene.qd, scene.duration);
        let changed = |tolerance: f64, change: &dyn Fn(Compliance) -> Option<Compliance>| {
            let mut sim = Simulation { tolerance, max_step: scene.duration, ..base.clone() };
            sim.zeno_time = Simulation::zeno_time_for(tolerance).min(base.zeno_time);
            for touch in &mut sim.touches {
                touch.contact.compliance = touch.contact.compliance.and_then(change);
            }
            sim.touches = Touch::divided(sim.touches);
            sim
        };
        let reference = Reference::of(base, &run(&changed(TIGHT, &|_| None))?);
        done();
        let mut runs = Vec::new();
        for k in 0..=DECADES * PER_DECADE {
            let factor = 10_f64.powf(f64::from(k) / f64::from(PER_DECADE));
            let sim = changed(TOLERANCE, &|own| Some(stiffened(own, factor)));
            let start = Instant::now();
            let found = run(&sim)?;
            done();
            let after_impact = after_first(&found).and_then(|qd| reference.after_impact(qd));
            let last = &found.summary.last;
            runs.push(Stiffened { factor, after_impact, at_end: reference.at_end(&last.q, &last.qd) });
            if start.elapsed() > budget / 4 {
                break;
            }
        }
        let (order_after_impact, order_at_end) =
            (measured(&runs, |run| run.after_impact), measured(&runs, |run| run.at_end));
        Ok(Some(Self { runs, order_after_impact, order_at_end, theory }))
    }

    /// Prints all runs as a table, and the orders.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn print(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{:>10} {:>12} {:>10}", "factor", "after impact", "at the end")?;
        for run in &self.runs {
            let (after, end) = (number(run.after_impact), number(run.at_end));
            writeln!(out, "{:>10} {after:>12} {end:>10}", knob_value(run.factor))?;
        }
        let order = |order: Option<f64>| order.map_or_else(|| "–".to_owned(), |order| format!("{order:.3}"));
        let (after, end) = (order(self.order_after_impact), order(self.order_at_end));
        writeln!(out, "order {after:>17} {end:>10}; in theory {:.3}", self.theory)
    }

    /// All runs as CSV, one line each.
    pub fn csv(&self) -> String {
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
        let row = |run: &Stiffened| format!("{:e},{},{}\n", run.factor, number(run.after_impact), number(run.at_end));
        "factor,error_after_impact,error_at_end\n".to_owned() + &self.runs.iter().map(row).collect::<String>()
    }
}

/// The measured order of an error: the slope of −ln(error) over ln(factor), by least squares over the two stiffest decades.
/// `None` with fewer than two errors above zero.
fn measured(runs: &[Stiffened], error: impl Fn(&Stiffened) -> Option<f64>) -> Option<f64> {
    let last = runs.last()?.factor;
    let late = runs.iter().filter(|run| run.factor * 10_f64.powi(FITTED) > 0.999 * last);
    let points: Vec<(f64, f64)> = late
        .filter_map(|run| error(run).filter(|error| *error > 0.0).map(|error| (run.factor.ln(), error.ln())))
        .collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    (points.len() > 1).then_some(-slope)
}

/// The order of the error of a contact.
fn order(own: Compliance) -> f64 {
    match own.normal {
        Yielding::HuntCrossley { exponent, .. } => 1.0 / (exponent + 1.0),
        Yielding::KelvinVoigt { .. } | Yielding::WaltonBraun => 0.5,
    }
}

fn stiffened(own: Compliance, factor: f64) -> Compliance {
    let root = factor.sqrt();
    let tangential = match own.tangential {
        Holding::Smoothed { slip_speed } => Holding::Smoothed { slip_speed: slip_speed / root },
        Holding::Bristle { stiffness, damping } => {
            Holding::Bristle { stiffness: stiffness * factor, damping: damping * root }
        }
    };
    Compliance { stiffness: own.stiffness * factor, tangential, ..own }
}

/// q̇ at the end of the first contact.
fn after_first(run: &Trajectory) -> Option<&[f64]> {
    run.events.iter().find(|event| ends_impact(event)).map(|event| event.qd_plus.as_slice())
}

#[cfg(test)]
#[path = "../../tests/stiffness.rs"]
mod tests;

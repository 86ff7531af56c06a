//! Output of a fit: all results as JSON, the main ones for people.

use super::{FitCommand, Flights};
use crate::output::short;
use carom_study::fit::{Fit, FittedTo, Misfit, Score};
use serde::Serialize;
use std::io::{self, Write};

#[derive(Serialize)]
pub struct Report {
    fitted_to: &'static str,
    law: String,
    loss: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    threshold: Option<f64>,
    confidence: f64,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    horizon: Option<String>,
    coefficients: Vec<CoefficientAnswer>,
    train: ScoreAnswer,
    #[serde(skip_serializing_if = "Option::is_none")]
    test: Option<ScoreAnswer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flights: Option<FlightsAnswer>,
    notes: Vec<String>,
    trials: usize,
    each: Vec<Each>,
}

#[derive(Serialize)]
struct CoefficientAnswer {
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
    interval: &'static str,
}

#[derive(Serialize)]
struct ScoreAnswer {
    count: usize,
    mean: f64,
    median: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    below_half: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    whole_mean: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    whole_median: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    early_mean: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    early_median: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    least_in_cone: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    least: Option<f64>,
}

#[derive(Serialize)]
struct FlightsAnswer {
    joined: usize,
    /// Medians.
    rest: f64,
    deviation: f64,
    outliers: Vec<Outlier>,
    left_out: Vec<LeftOut>,
}

/// A sample that was left out.
#[derive(Serialize)]
struct Outlier {
    number: i64,
    time: f64,
}

#[derive(Serialize)]
struct LeftOut {
    number: i64,
    reason: String,
}

#[derive(Serialize)]
struct Each {
    number: i64,
    trained: bool,
    error: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    whole: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    early: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    least_in_cone: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    least: Option<f64>,
}

impl Report {
    pub fn new(fit: &Fit, told: &Flights, command: &FitCommand) -> Self {
        let score = |s: &Score| ScoreAnswer {
            count: s.count,
            mean: s.mean,
            median: s.median,
            below_half: s.below_half,
            whole_mean: s.whole.map(|both| both.0),
            whole_median: s.whole.map(|both| both.1),
            early_mean: s.early.map(|both| both.0),
            early_median: s.early.map(|both| both.1),
            least_in_cone: s.least_in_cone,
            least: s.least,
        };
        let each = |one: &Misfit| Each {
            number: one.number,
            trained: one.trained,
            error: one.error,
            whole: one.whole,
            early: one.early,
            least_in_cone: one.least_in_cone,
            least: one.least,
        };
        let middle = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or_default()
        };
        let flights = (!told.numbers.is_empty()).then(|| FlightsAnswer {
            joined: told.numbers.len(),
            rest: middle(&told.rests),
            deviation: middle(&told.deviations),
            outliers: told.outliers.iter().map(|&(number, time)| Outlier { number, time }).collect(),
            left_out: told
                .left_out
                .iter()
                .map(|(number, reason)| LeftOut { number: *number, reason: reason.clone() })
                .collect(),
        });
        Self {
            fitted_to: fit.to.name(),
            law: fit.law.clone(),
            loss: fit.loss.name(),
            threshold: fit.threshold,
            confidence: command.confidence,
            seed: command.seed,
            start: (fit.to == FittedTo::Trajectories).then(|| command.start.clone()),
            horizon: (fit.to == FittedTo::Trajectories).then(|| command.horizon.clone()),
            coefficients: fit
                .coefficients
                .iter()
                .map(|c| CoefficientAnswer {
                    name: c.name,
                    value: c.value,
                    low: c.low,
                    high: c.high,
                    interval: c.interval.name(),
                })
                .collect(),
            train: score(&fit.train),
            test: fit.test.as_ref().map(score),
            flights,
            notes: fit.notes.clone(),
            trials: fit.trials,
            each: fit.each.iter().map(each).collect(),
        }
    }
}

/// Number of the largest errors that are printed for people.
const WORST: usize = 5;

pub fn for_people(report: &Report, out: &mut dyn Write) -> io::Result<()> {
    let trajectories = report.fitted_to == FittedTo::Trajectories.name();
    let of = if trajectories { "tosses" } else { "impacts" };
    let tested = report.test.as_ref().map_or(0, |test| test.count);
    let threshold = report.threshold.map_or(String::new(), |t| format!(" beyond {}", short(t)));
    writeln!(
        out,
        "{} of {} {of} ({tested} kept for the test, seed {}), law {}, loss {}{threshold}, {} trials",
        report.fitted_to, report.train.count, report.seed, report.law, report.loss, report.trials
    )?;
    if let Some(flights) = &report.flights {
        writeln!(
            out,
            "{} impacts from flights; median distance of the fits from the samples {} m (rms), median deviation of the jumps {} m/s; {} left out",
            flights.joined,
            short(flights.rest),
            short(flights.deviation),
            flights.left_out.len()
        )?;
        if !flights.outliers.is_empty() {
            let of: Vec<String> =
                flights.outliers.iter().take(5).map(|it| format!("{} at {} s", it.number, short(it.time))).collect();
            let more = if flights.outliers.len() > 5 { ", …" } else { "" };
            let count = flights.outliers.len();
            writeln!(out, "{count} samples left out, which contradict their flights: {}{more}", of.join(", "))?;
        }
    }
    for c in &report.coefficients {
        let percent = report.confidence * 100.0;
        writeln!(
            out,
            "{:14} {:>12}   {percent} %: {:>12} … {:<12} ({})",
            c.name,
            short(c.value),
            short(c.low),
            short(c.high),
            c.interval
        )?;
    }
    let (what, more) = if trajectories {
        let parts = ["whole mean", "whole median", "below 0.5", "0.1 s mean", "0.1 s median"];
        ("pose error", parts.to_vec())
    } else {
        ("residual m/s", vec!["mean", "median", "best in cone", "best of any"])
    };
    let row = |out: &mut dyn Write, name: &str, cells: Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|cell| format!("{cell:>12}")).collect();
        writeln!(out, "{name:14} {}", cells.join(" "))
    };
    row(out, what, more.iter().map(|&name| name.to_owned()).collect())?;
    for (name, score) in [("train", Some(&report.train)), ("test", report.test.as_ref())] {
        let Some(s) = score else { continue };
        let cells = if trajectories {
            vec![s.whole_mean, s.whole_median, s.below_half, s.early_mean, s.early_median]
        } else {
            vec![Some(s.mean), Some(s.median), s.least_in_cone, s.least]
        };
        row(out, name, cells.into_iter().map(|x| x.map_or(String::new(), short)).collect())?;
    }
    let mut worst: Vec<&Each> = report.each.iter().collect();
    worst.sort_by(|a, b| b.error.total_cmp(&a.error));
    worst.truncate(WORST);
    let worst: Vec<String> = worst.iter().map(|one| format!("{} ({})", one.number, short(one.error))).collect();
    writeln!(out, "worst {of}: {}", worst.join(", "))?;
    for note in &report.notes {
        writeln!(out, "note: {note}")?;
    }
    Ok(())
}

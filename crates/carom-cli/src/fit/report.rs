//! Output of a fit: all results as JSON, the main ones for people.

use super::{FitCommand, Flights, middle};
use crate::law::{Refusal, print_refused};
use crate::output::short;
use carom_study::fit::{Coefficient, Fit, FittedTo, Loss, Misfit, Score};
use carom_study::{Horizon, Start};
use serde::Serialize;
use std::io::{self, Write};

#[derive(Serialize)]
pub struct Report<'a> {
    fitted_to: FittedTo,
    law: &'a str,
    loss: Loss,
    #[serde(skip_serializing_if = "Option::is_none")]
    threshold: Option<f64>,
    confidence: f64,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<Start>,
    #[serde(skip_serializing_if = "Option::is_none")]
    horizon: Option<Horizon>,
    coefficients: &'a [Coefficient],
    train: Score,
    #[serde(skip_serializing_if = "Option::is_none")]
    test: Option<Score>,
    #[serde(skip_serializing_if = "Option::is_none")]
    flights: Option<FlightsAnswer<'a>>,
    notes: &'a [String],
    trials: usize,
    each: &'a [Misfit],
}

#[derive(Serialize)]
struct FlightsAnswer<'a> {
    joined: usize,
    /// Medians.
    rest: f64,
    deviation: f64,
    outliers: Vec<Outlier>,
    left_out: Vec<LeftOut<'a>>,
}

/// A sample that was left out.
#[derive(Serialize)]
struct Outlier {
    number: i64,
    time: f64,
}

#[derive(Serialize)]
struct LeftOut<'a> {
    number: i64,
    reason: &'a str,
}

impl<'a> Report<'a> {
    pub fn new(fit: &'a Fit, told: &'a Flights, command: &'a FitCommand) -> Self {
        let flights = (!told.numbers.is_empty()).then(|| FlightsAnswer {
            joined: told.numbers.len(),
            rest: middle(told.rests.clone()),
            deviation: middle(told.deviations.clone()),
            outliers: told.outliers.iter().map(|&(number, time)| Outlier { number, time }).collect(),
            left_out: told.left_out.iter().map(|(number, reason)| LeftOut { number: *number, reason }).collect(),
        });
        let trajectories = fit.to == FittedTo::Trajectories;
        Self {
            fitted_to: fit.to,
            law: &fit.law,
            loss: fit.loss,
            threshold: fit.threshold,
            confidence: command.confidence,
            seed: command.seed,
            start: trajectories.then_some(command.start),
            horizon: trajectories.then_some(command.horizon),
            coefficients: &fit.coefficients,
            train: fit.train,
            test: fit.test,
            flights,
            notes: &fit.notes,
            trials: fit.trials,
            each: &fit.each,
        }
    }
}

/// Number of the largest errors that are printed for people.
const WORST: usize = 5;

pub fn for_people(report: &Report, out: &mut dyn Write) -> io::Result<()> {
    let trajectories = report.fitted_to == FittedTo::Trajectories;
    let of = if trajectories { "tosses" } else { "impacts" };
    let tested = match &report.test {
        Some(test) => format!(" ({} kept for the test, seed {})", test.count, report.seed),
        None => String::new(),
    };
    let threshold = report.threshold.map_or(String::new(), |t| format!(" beyond {}", short(t)));
    writeln!(
        out,
        "{} of {} {of}{tested}, law {}, loss {}{threshold}, {} trials",
        report.fitted_to.name(),
        report.train.count,
        report.law,
        report.loss.name(),
        report.trials
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
    for c in report.coefficients {
        let percent = report.confidence * 100.0;
        writeln!(
            out,
            "{:14} {:>12}   {percent} %: {:>12} … {:<12} ({})",
            c.name,
            short(c.value),
            short(c.low),
            short(c.high),
            c.interval.name()
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
    let mut worst: Vec<&Misfit> = report.each.iter().collect();
    worst.sort_by(|a, b| b.error.total_cmp(&a.error));
    worst.truncate(WORST);
    let worst: Vec<String> = worst.iter().map(|one| format!("{} ({})", one.number, short(one.error))).collect();
    writeln!(out, "worst {of}: {}", worst.join(", "))?;
    for note in report.notes {
        writeln!(out, "note: {note}")?;
    }
    Ok(())
}

/// The fits of all laws, least error first.
#[derive(Serialize)]
pub struct All<'a> {
    fits: Vec<Report<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    refused: Vec<Refusal>,
}

impl<'a> All<'a> {
    pub fn new(mut fits: Vec<Report<'a>>, refused: Vec<Refusal>) -> Self {
        fits.sort_by(|a, b| a.judged().mean.total_cmp(&b.judged().mean));
        Self { fits, refused }
    }
}

impl Report<'_> {
    /// The errors by which laws are compared: those of the test, if there is one.
    fn judged(&self) -> &Score {
        self.test.as_ref().unwrap_or(&self.train)
    }
}

/// All laws as one table.
pub fn table(all: &All, out: &mut dyn Write) -> io::Result<()> {
    if let Some(first) = all.fits.first() {
        let trajectories = first.fitted_to == FittedTo::Trajectories;
        let (of, unit) = if trajectories { ("tosses", "pose errors") } else { ("impacts", "residuals (m/s)") };
        let judged = match &first.test {
            Some(test) => format!("{unit} of the {} kept for the test, seed {}", test.count, first.seed),
            None => format!("{unit} of the same {of}"),
        };
        let (to, percent) = (first.fitted_to.name(), first.confidence * 100.0);
        let count = first.train.count;
        writeln!(out, "{to} of {count} {of}, loss {}, intervals of {percent} %; {judged}", first.loss.name())?;
        let mut names: Vec<&str> = Vec::new();
        for one in all.fits.iter().flat_map(|fit| fit.coefficients) {
            if !names.contains(&one.name) {
                names.push(one.name);
            }
        }
        let head: String = names.iter().map(|name| format!("{name:<26}")).collect();
        writeln!(out, "{:16} {head} {:>12} {:>12}", "law", "mean", "median")?;
        for fit in &all.fits {
            let cell = |name: &&str| {
                let own = fit.coefficients.iter().find(|one| one.name == *name);
                let text = own.map(|c| format!("{:.4} ({:.4} … {:.4})", c.value, c.low, c.high));
                format!("{:<26}", text.unwrap_or_default())
            };
            let (cells, score) = (names.iter().map(cell).collect::<String>(), fit.judged());
            writeln!(out, "{:16} {cells} {:>12} {:>12}", fit.law, short(score.mean), short(score.median))?;
        }
    }
    print_refused(&all.refused, out)
}

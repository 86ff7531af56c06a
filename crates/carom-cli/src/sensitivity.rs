//! `carom simulate --sensitivity`: derivatives of the final state and of the times of events.

use crate::error::CliError;
use crate::output::brief;
use carom_sim::{Broken, Columns, EventTime, Plan, Scene, SimError};
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

/// Number of derivatives of each number that people are shown.
const SHOWN: usize = 3;

#[derive(Serialize)]
pub struct Sensitivity {
    names: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    r#final: Option<Vec<Row>>,
    events: Vec<EventTime>,
    #[serde(skip_serializing_if = "Option::is_none")]
    broken: Option<Broken>,
}

/// The derivatives of one number of the final state.
#[derive(Serialize)]
struct Row {
    of: String,
    by: Vec<f64>,
}

/// Refuses what has no derivative anywhere.
pub fn check(file: &Path, plan: &Plan) -> Result<(), CliError> {
    if plan.simulation.stepping {
        let why = "--sensitivity: time steps have no derivative: take method = \"events\" in [run]";
        return Err(CliError::Input(format!("{}: {why}", file.display())));
    }
    Ok(())
}

impl Sensitivity {
    /// Of the whole run of a scene, by its initial state and by the parameters of its contacts and its drive, or by what has these names.
    pub fn of(scene: &Scene, plan: &Plan, wrt: &[String]) -> Result<Self, SimError> {
        let unknown = |rule| SimError::Scene { file: "--wrt".into(), rule };
        let chosen = match wrt {
            [] => Columns::all(plan),
            names => {
                let of_key = |path: &str| scene.parameter(path).map_err(|e| unknown(e.to_string()));
                Columns::of(plan, names, of_key, unknown)?
            }
        };
        let found = chosen.of_all(plan.sensitivity(scene.duration, &chosen.parameters)?);
        let rows = plan.simulation.state_names();
        let row = |(of, row): (&String, Vec<f64>)| Row { of: of.clone(), by: row };
        let last = found.last_by.map(|by| {
            let numbers = by.row_iter().map(|row| row.iter().copied().collect());
            rows.iter().zip(numbers).map(row).collect()
        });
        Ok(Self { r#final: last, events: found.events, broken: found.broken, names: found.names })
    }

    /// The largest derivatives of each number.
    pub fn for_people(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out)?;
        writeln!(
            out,
            "derivatives by the start and by parameters, SI units and radians, the {SHOWN} largest of each:"
        )?;
        for event in &self.events {
            let what = format!("time of {} at {} s", event.kinds.join(", "), brief(event.time));
            if event.time_by.iter().all(|x| x.is_finite()) {
                self.line(&what, &event.time_by, out)?;
            } else {
                writeln!(out, "  {what}: too slow for digits that count")?;
            }
        }
        for row in self.r#final.iter().flatten() {
            self.line(&format!("final {}", row.of), &row.by, out)?;
        }
        match &self.broken {
            Some(Broken { time, reason }) => {
                writeln!(out, "the final state has no derivatives: they end at {} s: {reason}", brief(*time))
            }
            None => Ok(()),
        }
    }

    fn line(&self, what: &str, by: &[f64], out: &mut dyn Write) -> io::Result<()> {
        let mut order: Vec<usize> = (0..by.len()).filter(|&j| by[j] != 0.0).collect();
        order.sort_by(|&i, &j| by[j].abs().total_cmp(&by[i].abs()));
        let shown = order.iter().take(SHOWN).map(|&j| format!("{} by {}", brief(by[j]), self.names[j]));
        let shown: Vec<String> = shown.collect();
        writeln!(out, "  {what}: {}", if shown.is_empty() { "none".to_owned() } else { shown.join(", ") })
    }
}

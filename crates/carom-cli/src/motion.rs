//! The motion of a plan as tables and as a recording: of what `carom aim` and `carom orbit` find.

use crate::error::CliError;
use crate::record::{Record, begin_recording};
use crate::simulate::Tables;
use carom_sim::{Moment, Plan, Sampling, Scene, Seen};
use carom_study::orbit::SAMPLES;
use carom_study::state_columns;
use std::path::Path;

/// Writes the motion of a plan. `file`: the problem, for messages.
pub fn write_motion(
    (file, scene): (&Path, &Scene),
    (plan, duration): (&Plan, f64),
    tables: &[&Path],
    record: &Record,
) -> Result<(), CliError> {
    if tables.is_empty() && !record.is_asked() {
        return Ok(());
    }
    let columns = state_columns(&plan.simulation.chain);
    let mut table = Tables::begin(tables.iter().copied(), &columns, &scene.text)?;
    let mut recorder = begin_recording(record, scene, plan)?;
    let sampling = Sampling { every: Some(duration / SAMPLES as f64), ..Sampling::default() };
    let run = plan.stream(duration, sampling, &mut |seen| {
        if let Seen::Moment(Moment { time, q, qd }) = &seen {
            table.row(&[&[*time], q.as_slice(), qd].concat());
        }
        if let Some(recorder) = &mut recorder {
            recorder.see(seen);
        }
    });
    let run = run.map_err(|e| CliError::scene(file, e))?;
    table.finish()?;
    if let Some(recorder) = recorder {
        recorder.finish(&run)?;
    }
    Ok(())
}

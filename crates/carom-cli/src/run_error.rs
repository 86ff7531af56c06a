//! `carom simulate --error` and scenes with an accuracy: the errors of a run as text.

use crate::output::{brief, short};
use carom_sim::{Broken, Met, RunError, StateError};
use std::io::{self, Write};

/// How the accuracy of a scene is met.
pub fn accuracy(met: &Met, out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "accuracy {}: met by the tolerance {} (max_step {}, zeno_time {}), with an estimated error of {}, after {} evaluations in all",
        brief(met.asked),
        brief(met.tolerance),
        brief(met.max_step),
        brief(met.zeno_time),
        brief(met.error),
        met.evaluations
    )
}

/// The errors of the final state and the largest one of the times.
pub fn for_people(error: &RunError, out: &mut dyn Write) -> io::Result<()> {
    let two = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") };
    let by: Vec<String> = error.tighter.iter().map(|tolerance| brief(*tolerance)).collect();
    let by = match by.len() {
        0 => String::new(),
        1 => format!(", by a run with the tolerance {}", by[0]),
        _ => format!(", by runs with the tolerances {}", by.join(" and ")),
    };
    if let Some(Broken { time, reason }) = &error.unknown {
        return writeln!(out, "no estimate of the error: at {} s {reason}", short(*time));
    }
    writeln!(out, "estimated errors{by}:")?;
    let numbers = |numbers: &[f64]| numbers.iter().map(|x| two(*x)).collect::<Vec<_>>().join(" ");
    if let Some(StateError { q, qd }) = &error.last {
        writeln!(out, "q  ± {}", numbers(q))?;
        writeln!(out, "qd ± {}", numbers(qd))?;
    }
    let times = error.events.iter().flatten();
    let (known, most) = times.fold((0, 0.0_f64), |(known, most), time| (known + 1, most.max(*time)));
    let others = error.events.len() - known;
    if known > 0 {
        write!(out, "times of events ± {} s at most", two(most))?;
        if others > 0 {
            write!(out, "; {others} of {} are not in the runs with tighter tolerances", error.events.len())?;
        }
        writeln!(out)?;
    }
    Ok(())
}

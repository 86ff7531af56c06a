//! Many runs of one scene from disturbed starts.

use crate::scene_table::state_columns;
use crate::table::Column;
use carom_sim::{Moment, Plan, Sampling, Scene, Seen, SimError, StopReason, Summary};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// One run of a scene from a disturbed start.
#[derive(Debug, Clone)]
pub struct Run {
    /// Its number; 0 is the start itself.
    pub number: u64,
    /// The start, of the whole chain.
    pub start: Moment,
    /// Number of impacts: events with impulses.
    pub impacts: usize,
    /// Time of the first impact, s.
    pub first_impact: Option<f64>,
    /// The result of the run, of the chain that the plan keeps; or why there is none, for instance an overlap at the start.
    pub result: Result<Summary, SimError>,
}

/// What to tell of runs of a scene that has no [`perturbation`](Scene::perturbation).
pub const ALL_THE_SAME: &str =
    "the scene has no disturbance, and all runs would be the same: add [run] perturb = { q = …, qd = … }";

/// How runs end, in the column `outcome`.
const OUTCOMES: [&str; 3] = ["duration", "events", "refused"];

/// The columns of a table of runs: number, outcome, impacts, time of the first one, events; start, end; energies.
pub fn run_columns(scene: &Scene, plan: &Plan) -> Vec<Column> {
    let (whole, kept) = (state_columns(&scene.simulation.chain), state_columns(&plan.simulation.chain));
    let mut columns = vec![Column::number("run"), Column::word("outcome", OUTCOMES)];
    columns.extend(
        [("impacts", ""), ("first_impact", "s"), ("events", "")].map(|(name, unit)| Column::number(name).in_unit(unit)),
    );
    let of = |moment: &str, it: &Column| Column::number(format!("{moment}.{}", it.name)).in_unit(it.unit);
    columns.extend(whole[1..].iter().map(|it| of("start", it)));
    columns.extend(kept.iter().map(|it| of("end", it)));
    let energies = ["energy_start", "energy_end", "lost_in_impacts", "energy_error"];
    columns.extend(energies.map(|name| Column::number(name).in_unit("J")));
    columns
}

impl Run {
    /// Its row among so many [columns](run_columns).
    pub fn row(&self, columns: usize) -> Vec<f64> {
        let start = self.start.q.iter().chain(&self.start.qd);
        let mut row = vec![self.number as f64];
        match &self.result {
            Ok(summary) => {
                let stop = f64::from(u8::from(summary.stop == StopReason::Events));
                let first = self.first_impact.unwrap_or(f64::NAN);
                row.extend([stop, self.impacts as f64, first, summary.events as f64]);
                row.extend(start);
                row.push(summary.last.time);
                row.extend(summary.last.q.iter().chain(&summary.last.qd));
                let energy = summary.energy;
                row.extend([energy.start, energy.end, energy.impacts, energy.error()]);
            }
            Err(_) => {
                row.extend([2.0, f64::NAN, f64::NAN, f64::NAN]);
                row.extend(start);
                row.resize(columns, f64::NAN);
            }
        }
        row
    }
}

/// Runs of one scene are computed in groups of this number for each thread; the threads wait for each other at the end of a group.
const GROUP: u64 = 16;

/// Runs a scene `runs` times by its plan, which is made once, from starts that its [`perturbation`](Scene::perturbation) disturbs, in parallel,
/// and passes the results to `each` in the order of their numbers. They do not depend on the number of threads. Without a perturbation all
/// starts are the same. Setting `stop` ends the runs early: those that have begun are completed, no other begins.
///
/// # Errors
/// The first error of `each`, after which no further group is computed.
pub fn ensemble<E>(
    (scene, plan): (&Scene, &Plan),
    runs: u64,
    stop: &AtomicBool,
    mut each: impl FnMut(Run) -> Result<(), E>,
) -> Result<(), E> {
    let (mut first, size) = (0, GROUP * rayon::current_num_threads() as u64);
    while first < runs && !stop.load(Ordering::Relaxed) {
        let group = first..runs.min(first + size);
        let one = |number| (!stop.load(Ordering::Relaxed)).then(|| run(scene, plan, number));
        let done: Vec<Option<Run>> = group.clone().into_par_iter().map(one).collect();
        // Runs after one that has not begun are left out, so that the results are the first ones without a gap.
        done.into_iter().map_while(|run| run).try_for_each(&mut each)?;
        first = group.end;
    }
    Ok(())
}

fn run(scene: &Scene, plan: &Plan, number: u64) -> Run {
    let time = scene.simulation.start_time;
    let undisturbed = || Ok((scene.q.clone(), scene.qd.clone()));
    let given = scene.perturbation.as_ref();
    let start = given.map_or_else(undisturbed, |it| it.start(&scene.simulation.chain, (&scene.q, &scene.qd), number));
    let (mut impacts, mut first_impact) = (0, None);
    let (start, result) = match start {
        Err(error) => (Moment { time, q: scene.q.clone(), qd: scene.qd.clone() }, Err(error)),
        Ok((q, qd)) => {
            let result = plan.stream_from((&q, &qd), scene.duration, Sampling::default(), &mut |seen| {
                if let Seen::Event(event) = seen
                    && event.kind.is_impact()
                {
                    impacts += 1;
                    first_impact.get_or_insert(event.time);
                }
            });
            (Moment { time, q, qd }, result)
        }
    };
    Run { number, start, impacts, first_impact, result }
}

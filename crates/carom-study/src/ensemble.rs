//! Many runs of one scene from disturbed starts.

use carom_sim::{EventKind, Moment, Sampling, Scene, Seen, SimError, Summary};
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

/// Runs of one scene are computed in groups of this number for each thread; the threads wait for each other at the end of a group.
const GROUP: u64 = 16;

/// Runs a scene `runs` times from starts that its [`perturbation`](Scene::perturbation) disturbs, in parallel, and passes the
/// results to `each` in the order of their numbers. They do not depend on the number of threads. Without a perturbation all
/// starts are the same. Setting `stop` ends the runs early: those that have begun are completed, no other begins.
///
/// # Errors
/// The first error of `each`, after which no further group is computed.
pub fn ensemble<E>(
    scene: &Scene,
    runs: u64,
    stop: &AtomicBool,
    mut each: impl FnMut(Run) -> Result<(), E>,
) -> Result<(), E> {
    let (mut first, size) = (0, GROUP * rayon::current_num_threads() as u64);
    while first < runs && !stop.load(Ordering::Relaxed) {
        let group = first..runs.min(first + size);
        let one = |number| (!stop.load(Ordering::Relaxed)).then(|| run(scene, number));
        let done: Vec<Option<Run>> = group.clone().into_par_iter().map(one).collect();
        // Runs after one that has not begun are left out, so that the results are the first ones without a gap.
        done.into_iter().map_while(|run| run).try_for_each(&mut each)?;
        first = group.end;
    }
    Ok(())
}

fn run(scene: &Scene, number: u64) -> Run {
    let time = scene.simulation.start_time;
    let undisturbed = || Ok((scene.q.clone(), scene.qd.clone()));
    let given = scene.perturbation.as_ref();
    let start = given.map_or_else(undisturbed, |it| it.start(&scene.simulation.chain, (&scene.q, &scene.qd), number));
    let (mut impacts, mut first_impact) = (0, None);
    let (start, result) = match start {
        Err(error) => (Moment { time, q: scene.q.clone(), qd: scene.qd.clone() }, Err(error)),
        Ok((q, qd)) => {
            let disturbed = Scene { q: q.clone(), qd: qd.clone(), ..scene.clone() };
            let result = disturbed.plan().and_then(|plan| {
                plan.stream(scene.duration, Sampling::default(), &mut |seen| {
                    let Seen::Event(event) = seen else { return };
                    let hit = matches!(
                        event.kind,
                        EventKind::Impact { .. }
                            | EventKind::Several { .. }
                            | EventKind::Latch { .. }
                            | EventKind::Limit { .. }
                    );
                    if hit {
                        impacts += 1;
                        first_impact.get_or_insert(event.time);
                    }
                })
            });
            (Moment { time, q, qd }, result)
        }
    };
    Run { number, start, impacts, first_impact, result }
}

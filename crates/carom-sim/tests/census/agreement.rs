//! Random scenes under the default method against the same scenes by other methods: a hundredth of the tolerance to the end, as far
//! as disturbed starts stay together, and fine time steps up to the first event.

use super::case::{Answer, Case, End};
use super::{LIMIT, Verdict, compare, energy, random};

/// Disturbance of the start.
const NUDGE: f64 = 1e-8;
/// A motion is not compared after its disturbances have grown by this.
const GROWN: f64 = 1e4;
/// Time steps of the comparison, s.
const STEP: f64 = 1e-4;

/// Differences of the configurations at the samples.
fn apart(a: &Answer, b: &Answer) -> Vec<f64> {
    a.samples.iter().zip(&b.samples).map(|(a, b)| compare(&a.1, &b.1)).collect()
}

fn nudged(case: &Case, size: f64) -> End {
    case.run_as(Some(0.02), LIMIT, move |scene| {
        // Velocities are free of constraints such as the length of a quaternion.
        scene.qd.iter_mut().enumerate().for_each(|(k, x)| *x += size * if k % 2 == 0 { 1.0 } else { -0.7 });
    })
}

pub fn case(seed: u64) -> (String, Case) {
    let scene = random::scene(seed);
    (scene.kind.clone(), scene.as_is())
}

pub fn judge(seed: u64) -> Verdict {
    let (group, case) = case(seed);
    let answer = match energy::balanced(&group, &case, Some(0.02), LIMIT) {
        Ok(answer) => answer,
        Err(verdict) => return verdict,
    };
    let asked = answer.plan.simulation.stepping;
    let first = answer.events.iter().find(|event| event.time > 0.0).map_or(answer.scene.duration, |event| event.time);
    let speed = answer.samples.iter().flat_map(|sample| &sample.2).fold(1.0_f64, |most, x| most.max(x.abs()));
    let compliant = answer.scene.simulation.touches.iter().any(|touch| touch.contact.compliance.is_some());
    if !compliant && !asked && first > 0.02 {
        let short = move |scene: &mut carom_sim::Scene| {
            scene.duration = 0.99 * first.min(0.3);
            (scene.simulation.stepping, scene.simulation.contact_step) = (true, STEP);
        };
        if let End::Done(steps) = case.run_as(Some(0.02), LIMIT, short) {
            let off = apart(&answer, &steps).into_iter().fold(0.0, f64::max);
            // Of first order in the step; the accelerations are those of the speeds within some centimetres.
            let allowed = STEP * 3.0 * speed * speed;
            if off > allowed {
                return Verdict::bad(
                    group,
                    "time steps contradict",
                    format!("{off:.1e} above {allowed:.1e} before {first}"),
                );
            }
        }
    }
    let several = answer.statistics();
    if asked
        || several.contact_steps > 0
        || several.non_unique_time > 0.0
        || answer.events.iter().any(|event| event.kind.name() == "non-unique")
    {
        return Verdict::open(group, "balanced; by time steps, or told to be ambiguous", String::new());
    }
    let finer = case.run_as(Some(0.02), LIMIT, |scene| {
        scene.simulation.tolerance = (0.01 * scene.simulation.tolerance).max(1e-12);
    });
    let (End::Done(finer), End::Done(up), End::Done(down)) = (finer, nudged(&case, NUDGE), nudged(&case, -NUDGE))
    else {
        return Verdict::open(group, "balanced; a disturbed run is refused or slow", String::new());
    };
    let (off, up, down) = (apart(&answer, &finer), apart(&answer, &up), apart(&answer, &down));
    let (mut growth, mut seen) = (1.0_f64, 0);
    let tolerance = answer.plan.simulation.tolerance;
    for (k, off) in off.iter().enumerate().take(up.len().min(down.len())) {
        growth = growth.max(up[k] / NUDGE).max(down[k] / NUDGE);
        if growth > GROWN {
            break;
        }
        let allowed = 1e3 * tolerance * growth * speed.max(1.0) + 1e-7;
        if *off > allowed {
            let time = answer.samples[k].0;
            let before: Vec<_> = answer
                .events
                .iter()
                .filter(|event| event.time <= time)
                .map(|event| (event.kind.name(), event.time))
                .collect();
            let last = &before[before.len().saturating_sub(4)..];
            let note = format!("{off:.1e} above {allowed:.1e} at {time:.2} s, growth {growth:.1e}, after {last:?}");
            return Verdict::bad(group, "a finer tolerance contradicts", note);
        }
        seen += 1;
    }
    let whole = seen == answer.samples.len();
    Verdict::right(group, if whole { "agrees to the end" } else { "agrees until disturbances grow" }, String::new())
}

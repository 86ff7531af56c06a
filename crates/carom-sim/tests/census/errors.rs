//! Estimated errors of runs from random starts, beside their errors against a run with a far tighter tolerance.

use super::case::{Case, watched};
use super::{LIMIT, Verdict};
use carom_sim::{
    Distribution, Event, Met, Moment, Perturbation, Plan, Sampling, Scene, Seen, SimError, Simulation, Summary,
};
use std::path::{Path, PathBuf};

/// Scenes of the repository: a ball, bodies with corners, arms, walkers, a table of four legs, loops, compliant feet.
const SCENES: [&str; 16] = [
    "bounce",
    "box",
    "chain10",
    "cube",
    "delta",
    "feet",
    "four_bar",
    "n_four_bar",
    "planar2",
    "planar3",
    "quadruped",
    "racket",
    "rocking",
    "steer",
    "strike7",
    "table",
];
/// Tolerances of the reference, and of the run that tells its error.
const EXACT: [f64; 2] = [1e-12, 1e-13];
/// Sizes of the disturbances of q and of q̇.
const SIZES: [f64; 2] = [0.05, 0.3];
/// By which a floating base is raised, m.
const RAISED: f64 = 0.05;
/// Starts that overlap a surface are drawn again, from the numbers of another run.
const DRAWS: u64 = 20;
/// How many times the estimate an error may be.
const ALLOWED: f64 = 10.0;

fn path(seed: u64) -> PathBuf {
    let name = SCENES[seed as usize % SCENES.len()];
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name).with_extension("toml")
}

pub fn case(seed: u64) -> Case {
    Case { path: Some(path(seed)), ..Case::default() }
}

/// A scene with the random start of this seed.
fn start(seed: u64) -> Result<Scene, SimError> {
    let mut scene = Scene::from_file(path(seed))?;
    let chain = &scene.simulation.chain;
    let mut q = scene.q.clone();
    if chain.nq() > chain.nv() {
        q[2] += RAISED;
    }
    let [q_sizes, qd_sizes] = SIZES.map(|size| vec![size; chain.nv()]);
    let disturbed =
        Perturbation { q: q_sizes, qd: qd_sizes, numbers: Vec::new(), seed: 29, distribution: Distribution::Uniform };
    for draw in 0..DRAWS {
        let own = disturbed.start(chain, (&q, &scene.qd), 1 + DRAWS * seed + draw)?;
        if scene.simulation.smallest_gap(&own.0)? > 0.0 || draw + 1 == DRAWS {
            (scene.q, scene.qd) = own;
            break;
        }
    }
    Ok(scene)
}

fn run(plan: &Plan, duration: f64) -> Result<(Vec<Event>, Summary), SimError> {
    let mut events = Vec::new();
    let summary = plan.stream(duration, Sampling::default(), &mut |seen| {
        if let Seen::Event(event) = seen {
            events.push(event.clone());
        }
    })?;
    Ok((events, summary))
}

/// What came of a comparison.
enum Found {
    /// No estimate, and why.
    None(String),
    /// No reference: two tighter tolerances differ by more than the estimate.
    NoReference,
    /// The largest ratio of true and estimated errors, that of the number with the largest estimate, and a note.
    Ratios([f64; 2], String),
}

/// The run with this tolerance.
fn with_tolerance(plan: &Plan, duration: f64, tolerance: f64) -> Result<(Vec<Event>, Summary), SimError> {
    let mut exact = plan.clone();
    exact.simulation.zeno_time *=
        Simulation::zeno_time_for(tolerance) / Simulation::zeno_time_for(plan.simulation.tolerance);
    exact.simulation.tolerance = tolerance;
    run(&exact, duration)
}

fn compare(seed: u64) -> Result<Found, SimError> {
    let scene = start(seed)?;
    let (plan, duration) = (scene.plan()?, scene.duration);
    let (events, summary) = run(&plan, duration)?;
    let error = plan.error_of((duration, None), (&events, &[], &summary))?;
    let (Some(estimated), runs) = (error.last, error.tighter.len()) else {
        return Ok(Found::None(error.unknown.map_or(String::new(), |broken| broken.reason)));
    };
    let truths = EXACT.map(|tolerance| with_tolerance(&plan, duration, tolerance));
    let [Ok((exact, end)), Ok((_, again))] = truths else { return Ok(Found::NoReference) };
    let apart = |a: &Moment, b: &Moment| -> Result<[Vec<f64>; 2], SimError> {
        let faster = a.qd.iter().zip(&b.qd).map(|(a, b)| a - b).collect();
        Ok([plan.simulation.chain.difference(&b.q, &a.q)?, faster])
    };
    let [q, qd] = apart(&summary.last, &end.last)?;
    let [q_doubt, qd_doubt] = apart(&end.last, &again.last)?;
    let mut all = vec![("q", q, estimated.q, q_doubt), ("qd", qd, estimated.qd, qd_doubt)];
    let same = events.len() == exact.len() && events.iter().zip(&exact).all(|(a, b)| a.kind.name() == b.kind.name());
    if same {
        let times = events
            .iter()
            .zip(&exact)
            .zip(&error.events)
            .filter_map(|((a, b), estimate)| Some((a.time - b.time, (*estimate)?)));
        let (times, estimates): (Vec<f64>, Vec<f64>) = times.unzip();
        let doubts = vec![0.0; times.len()];
        all.push(("times", times, estimates, doubts));
    }
    let (mut worst, mut of_largest, mut note, mut largest) = (0.0, 0.0, String::new(), 0.0);
    for (what, errors, estimates, doubts) in all {
        for ((error, estimate), doubt) in errors.iter().zip(&estimates).zip(&doubts) {
            if doubt.abs() > *estimate {
                return Ok(Found::NoReference);
            }
            let ratio = error.abs() / estimate;
            if ratio > worst {
                worst = ratio;
                note = format!(
                    "{what}: {error:.1e}, estimated {estimate:.1e}, truth by {doubt:.1e}, {} events, {} truly, {runs} runs",
                    events.len(),
                    exact.len()
                );
            }
            if *estimate > largest && what == "q" {
                (largest, of_largest) = (*estimate, ratio);
            }
        }
    }
    Ok(Found::Ratios([worst, of_largest], note))
}

pub fn judge(seed: u64) -> Verdict {
    let group = SCENES[seed as usize % SCENES.len()];
    match watched(3.0 * LIMIT, move || compare(seed)) {
        None => Verdict::open(group, "slow", String::new()),
        Some(Err(panicked)) => Verdict::bad(group, "panic", panicked),
        Some(Ok(Err(SimError::Overlap { .. }))) => Verdict::open(group, "overlap at the start", String::new()),
        Some(Ok(Err(why))) => Verdict::open(group, "refused", why.to_string()),
        Some(Ok(Ok(Found::None(why)))) => {
            let digit = |letter: char| letter.is_ascii_digit();
            let reason = why.split(|letter| letter == ':' || digit(letter)).next().unwrap_or_default().to_owned();
            Verdict::open(group, format!("no estimate ({reason})"), why)
        }
        Some(Ok(Ok(Found::NoReference))) => Verdict::open(group, "no reference", String::new()),
        Some(Ok(Ok(Found::Ratios([worst, of_largest], note)))) => {
            if worst.is_nan() || worst > ALLOWED {
                return Verdict::bad(group, "worse than ten times its estimate", format!("{worst:.1e} times: {note}"));
            }
            let class = match of_largest {
                x if x < 0.1 => "below 1/10",
                x if x < 1.0 / 3.0 => "1/10 to 1/3",
                x if x < 3.0 => "1/3 to 3",
                _ => "3 to 10",
            };
            Verdict::right(group, class, note)
        }
    }
}

/// The accuracy that is asked for.
const ACCURACY: f64 = 1e-8;
/// Tolerances among which the loosest that meets it is looked for, in a decade.
const TRIES: f64 = 4.0;
/// The cost, over that of the loosest tolerance that meets the accuracy, which is aimed at.
const COST: f64 = 2.5;

/// The largest error, as a share of the accuracy, of a scene with such a wish, and its cost over that of the loosest tolerance that meets the wish.
fn met(seed: u64) -> Result<Option<[f64; 2]>, SimError> {
    let mut scene = start(seed)?;
    let (plan, duration) = (scene.plan()?, scene.duration);
    let (exact, end) = with_tolerance(&plan, duration, EXACT[0])?;
    let (end, again) = (end.last, with_tolerance(&plan, duration, EXACT[1])?.1.last);
    let off = |events: &[Event], last: &Moment| -> Result<f64, SimError> {
        let apart = plan
            .simulation
            .chain
            .difference(&end.q, &last.q)?
            .into_iter()
            .chain(end.qd.iter().zip(&last.qd).map(|(a, b)| a - b));
        let pairs = events.iter().zip(&exact).take_while(|(a, b)| a.kind.name() == b.kind.name());
        let times = pairs.map(|(a, b)| a.time - b.time);
        Ok(apart.chain(times).fold(0.0, |most: f64, x| most.max(x.abs())))
    };
    if off(&exact, &again)? > 0.1 * ACCURACY {
        return Ok(None);
    }
    scene.accuracy = Some(ACCURACY);
    let Some(Met { events, summary, evaluations, .. }) = scene.to_accuracy()?.met else { return Ok(None) };
    let mut tolerance = 1e-4;
    let cheapest = loop {
        let (events, summary) = with_tolerance(&plan, duration, tolerance)?;
        if off(&events, &summary.last)? <= ACCURACY {
            break summary.statistics.evaluations;
        }
        tolerance /= 10_f64.powf(1.0 / TRIES);
    };
    let cost = evaluations as f64 / cheapest as f64;
    Ok(Some([off(&events, &summary.last)? / ACCURACY, cost]))
}

pub fn judge_accuracy(seed: u64) -> Verdict {
    let group = SCENES[seed as usize % SCENES.len()];
    match watched(10.0 * LIMIT, move || met(seed)) {
        None => Verdict::open(group, "slow", String::new()),
        Some(Err(panicked)) => Verdict::bad(group, "panic", panicked),
        Some(Ok(Err(SimError::Overlap { .. }))) => Verdict::open(group, "overlap at the start", String::new()),
        Some(Ok(Err(SimError::Accuracy { why, .. }))) => Verdict::open(group, "refused", why),
        Some(Ok(Err(why))) => Verdict::open(group, "fails", why.to_string()),
        Some(Ok(Ok(None))) => Verdict::open(group, "no reference", String::new()),
        Some(Ok(Ok(Some([error, cost])))) => {
            let note = format!("error {error:.1e} of what was asked for, cost {cost:.2}");
            let class = match () {
                () if error.is_nan() || error > 1.0 => return Verdict::bad(group, "missed", note),
                () if cost > COST => "met at a higher cost",
                () => "met",
            };
            Verdict::right(group, class, note)
        }
    }
}

//! Derivatives of runs of random scenes: forward against differences of runs, and reverse against forward.

use super::case::{Case, watched};
use super::{LIMIT, Verdict, random};
use carom_sim::{Parameter, Plan, Scene, Sensitivity, SimError};
use nalgebra::DVector;

/// Tolerance of all runs.
const TOLERANCE: f64 = 1e-11;
/// Duration of the runs, s.
const DURATION: f64 = 0.3;
/// Steps of the differences along the direction.
const STEPS: [f64; 5] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Differences of two steps that agree to this have converged.
const AGREE: f64 = 1e-4;
/// What forward derivatives may differ by from differences that have converged: several times as much, or a share of the largest.
const ALLOWED: f64 = 10.0;
const SHARE: f64 = 1e-5;
/// This share after an accumulation of impacts, whose last ones are summed as if nothing else changed.
const SHARE_SUMMED: f64 = 1e-4;
/// And through compliant contacts: while they last, derivatives are up to some hundred times those after them, and right to 1e-5.
const SHARE_COMPLIANT: f64 = 5e-3;

pub fn case(seed: u64) -> (String, Case) {
    let mut scene = random::scene(seed);
    (scene.steps, scene.tolerance) = (false, TOLERANCE);
    (scene.kind.clone(), scene.as_is())
}

/// What is compared.
struct Found {
    by: Sensitivity,
    /// The derivative along the direction, forward, and by differences of runs with each step.
    forward: DVector<f64>,
    differences: Vec<DVector<f64>>,
    /// The largest difference of reverse and forward derivatives, relative to the largest of these.
    reverse: f64,
}

fn end(plan: &Plan, last: &[f64], along: &[f64], parameters: &[Parameter], h: f64) -> Result<DVector<f64>, SimError> {
    let mut sim = plan.simulation.clone();
    let nv = sim.chain.nv();
    for (parameter, by) in parameters.iter().zip(&along[2 * nv..]) {
        sim = parameter.apply(&sim, h * by)?;
    }
    let q = sim.chain.integrate(&plan.q, &along[..nv], h)?;
    let qd: Vec<f64> = plan.qd.iter().zip(&along[nv..]).map(|(v, by)| v + h * by).collect();
    let run = sim.run(&q, &qd, DURATION)?.summary.last;
    let apart = sim.chain.difference(last, &run.q)?;
    Ok(DVector::from_iterator(2 * nv, apart.into_iter().chain(run.qd)))
}

fn compare(scene: &Scene, seed: u64) -> Result<Found, SimError> {
    let plan = scene.plan()?;
    let parameters = Parameter::all(&plan.simulation);
    let by = plan.sensitivity(DURATION, &parameters)?;
    let rng = &mut fastrand::Rng::with_seed(seed ^ 0x5eed);
    let mut number = |_: usize| 2.0 * rng.f64() - 1.0;
    let along = DVector::from_fn(by.names.len(), |k, _| number(k));
    let Some(columns) = &by.last_by else {
        let none = DVector::zeros(0);
        return Ok(Found { by, forward: none, differences: Vec::new(), reverse: 0.0 });
    };
    let forward = columns * &along;
    let weights = DVector::from_fn(columns.nrows(), |k, _| number(k));
    let run = plan.linear_run(DURATION, &parameters)?;
    let back = DVector::from_vec(run.vjp(weights.as_slice(), &[])?) - columns.tr_mul(&weights);
    let reverse = back.amax() / columns.amax().max(1e-300);
    let mut differences = Vec::new();
    for h in STEPS {
        let at = |times: f64| end(&plan, &by.last.q, along.as_slice(), &parameters, times * h);
        let slope = (at(1.0)? - at(-1.0)?) * (8.0 / 12.0 / h) - (at(2.0)? - at(-2.0)?) * (1.0 / 12.0 / h);
        differences.push(slope);
    }
    Ok(Found { by, forward, differences, reverse })
}

pub fn judge(seed: u64) -> Verdict {
    let (group, case) = case(seed);
    let work = move || {
        let scene = case.load()?;
        scene.plan().map_err(|why| why.to_string())?;
        Ok::<_, String>(compare(&scene, seed))
    };
    let found = match watched(3.0 * LIMIT, work) {
        None => return Verdict::good(group, "slow", String::new()),
        Some(Err(panicked)) => return Verdict::bad(group, "panic", panicked),
        Some(Ok(Err(_))) => return Verdict::good(group, "refused by the scene", String::new()),
        Some(Ok(Ok(Err(SimError::Overlap { .. })))) => {
            return Verdict::good(group, "overlap at the start", String::new());
        }
        Some(Ok(Ok(Err(why)))) => return Verdict::bad(group, "refused", why.to_string()),
        Some(Ok(Ok(Ok(found)))) => found,
    };
    if let Some(broken) = &found.by.broken {
        let reason = broken.reason.rsplit(": ").next().unwrap_or_default();
        return Verdict::good(group, format!("no derivative ({reason})"), String::new());
    }
    if found.reverse > 1e-9 {
        return Verdict::bad(group, "reverse contradicts forward", format!("{:e}", found.reverse));
    }
    // The steps whose differences agree best.
    let size = |a: &DVector<f64>| a.amax().max(1.0);
    let pairs = found.differences.windows(2).map(|pair| ((&pair[0] - &pair[1]).amax() / size(&pair[1]), &pair[1]));
    let Some((apart, best)) = pairs.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Verdict::bad(group, "no differences", String::new());
    };
    if apart.is_nan() || apart > AGREE {
        return Verdict::good(group, "differences do not converge", String::new());
    }
    let off = (&found.forward - best).amax() / size(best);
    let kinds: Vec<&str> = found.by.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    let note = format!("apart by {off:.1e}, differences by {apart:.1e}, after {kinds:?}");
    let share = match () {
        () if kinds.contains(&"pressing") => SHARE_COMPLIANT,
        () if kinds.contains(&"zeno") => SHARE_SUMMED,
        () => SHARE,
    };
    if off.is_nan() || off > ALLOWED * apart.max(0.1 * share) {
        return Verdict::bad(group, "differences contradict", note);
    }
    let met = kinds.iter().filter(|kind| ["impact", "several", "limit"].contains(kind)).count();
    Verdict::good(group, if met > 0 { "agrees, through impacts" } else { "agrees" }, note)
}

//! Derivatives of runs of random scenes: forward against differences of runs, and reverse against forward.

use super::case::{Case, watched};
use super::{LIMIT, Verdict, random};
use carom_sim::{Parameter, Plan, Scene, Sensitivity, SimError};
use carom_testing::files::Folder;
use fastrand::Rng;
use nalgebra::DVector;

/// Tolerance of all runs.
const TOLERANCE: f64 = 1e-11;
/// Duration of the runs, s.
const DURATION: f64 = 0.3;
/// Numbers of surfaces among the parameters.
const SURFACES: usize = 3;
/// Steps of the differences along the direction.
const STEPS: [f64; 5] = [1e-4, 1e-5, 1e-6, 1e-7, 1e-8];
/// Differences of two steps that agree to this have converged.
const AGREE: f64 = 1e-4;
/// What forward derivatives may differ by from differences that have converged: several times as much, or a share of the largest.
const ALLOWED: f64 = 10.0;
const SHARE: f64 = 1e-5;
/// This share after an accumulation of impacts, whose last ones are summed as if nothing else changed.
const SHARE_SUMMED: f64 = 1e-4;

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

/// What the derivatives are by: the start, parameters of the simulation, and numbers of the file with their values.
struct By {
    scene: Scene,
    plan: Plan,
    parameters: Vec<Parameter>,
    numbers: Vec<(String, f64)>,
}

impl By {
    /// The change of the end from `last` with all of them changed by h times `along`.
    fn end(&self, last: &[f64], along: &[f64], h: f64) -> Result<DVector<f64>, SimError> {
        let (start, own) = along.split_at(2 * self.plan.simulation.chain.nv());
        let (own, of_the_file) = own.split_at(self.parameters.len());
        let mut sim = self.plan.simulation.clone();
        if !self.numbers.is_empty() {
            let changed =
                self.numbers.iter().zip(of_the_file).map(|((path, value), by)| (path.clone(), value + h * by));
            sim = self.scene.with_values(&changed.collect::<Vec<_>>())?.plan()?.simulation;
        }
        for (parameter, by) in self.parameters.iter().zip(own) {
            sim = parameter.apply(&sim, h * by)?;
        }
        let (q, qd) = start.split_at(start.len() / 2);
        let q = sim.chain.integrate(&self.plan.q, q, h)?;
        let qd: Vec<f64> = self.plan.qd.iter().zip(qd).map(|(v, by)| v + h * by).collect();
        let run = sim.run(&q, &qd, DURATION)?.summary.last;
        let apart = sim.chain.difference(last, &run.q)?;
        Ok(DVector::from_iterator(start.len(), apart.into_iter().chain(run.qd)))
    }
}

/// The paths of all numbers below a key.
fn numbers(path: &str, value: &toml::Value, found: &mut Vec<String>) {
    match value {
        toml::Value::Float(_) | toml::Value::Integer(_) => found.push(path.to_owned()),
        toml::Value::Array(all) => {
            all.iter().enumerate().for_each(|(k, value)| numbers(&format!("{path}[{k}]"), value, found));
        }
        toml::Value::Table(all) => {
            all.iter().for_each(|(key, value)| numbers(&format!("{path}.{key}"), value, found));
        }
        _ => {}
    }
}

/// Numbers of the scene: places, shapes and motions of surfaces, and one of springs and gravity.
fn of_the_file(scene: &Scene, rng: &mut Rng) -> Result<Vec<(String, f64)>, SimError> {
    let keys: toml::Table = scene.text.parse().expect("the text of a scene that was read");
    let gravity = keys.get("run").and_then(|run| run.get("gravity"));
    let groups = [
        (SURFACES, vec![("surface", keys.get("surface"))]),
        (1, vec![("spring", keys.get("spring")), ("run.gravity", gravity)]),
    ];
    let mut chosen = Vec::new();
    for (most, of) in groups {
        let mut all = Vec::new();
        of.iter()
            .filter_map(|(path, value)| Some((path, (*value)?)))
            .for_each(|(path, it)| numbers(path, it, &mut all));
        rng.shuffle(&mut all);
        chosen.extend(all.into_iter().take(most));
    }
    chosen.into_iter().map(|path| scene.number(&path).map(|value| (path, value))).collect()
}

fn compare(scene: Scene, seed: u64) -> Result<Found, SimError> {
    let plan = scene.plan()?;
    let rng = &mut Rng::with_seed(seed ^ 0x5eed);
    let (parameters, numbers) = (Parameter::all(&plan.simulation), of_the_file(&scene, rng)?);
    let all = numbers.iter().map(|(path, _)| scene.parameter(path)).collect::<Result<Vec<_>, _>>()?;
    let all = [&parameters[..], &all[..]].concat();
    let by = plan.sensitivity(DURATION, &all)?;
    let first = by.names.len() - numbers.len();
    let size = |k: usize| if k < first { 1.0 } else { numbers[k - first].1.abs().max(1.0) };
    let mut number = |_: usize| 2.0 * rng.f64() - 1.0;
    let along = DVector::from_fn(by.names.len(), |k, _| number(k) * size(k));
    let Some(columns) = &by.last_by else {
        let none = DVector::zeros(0);
        return Ok(Found { by, forward: none, differences: Vec::new(), reverse: 0.0 });
    };
    let forward = columns * &along;
    let weights = DVector::from_fn(columns.nrows(), |k, _| number(k));
    let run = plan.linear_run(DURATION, &all)?;
    let back = DVector::from_vec(run.vjp(weights.as_slice(), &[])?) - columns.tr_mul(&weights);
    let reverse = back.amax() / columns.amax().max(1e-300);
    let mut differences = Vec::new();
    let own = By { scene, plan, parameters, numbers };
    for h in STEPS {
        let at = |times: f64| own.end(&by.last.q, along.as_slice(), times * h);
        let slope = (at(1.0)? - at(-1.0)?) * (8.0 / 12.0 / h) - (at(2.0)? - at(-2.0)?) * (1.0 / 12.0 / h);
        differences.push(slope);
    }
    Ok(Found { by, forward, differences, reverse })
}

pub fn judge(seed: u64) -> Verdict {
    let (group, case) = case(seed);
    let work = move || {
        // A changed scene reads its meshes again.
        let folder = Folder::new();
        case.write(&folder).map_err(|why| why.to_string())?;
        let scene = Case { path: Some(folder.join("s.toml")), ..Case::default() }.load()?;
        scene.plan().map_err(|why| why.to_string())?;
        Ok::<_, String>(compare(scene, seed))
    };
    let found = match watched(3.0 * LIMIT, work) {
        None => return Verdict::open(group, "slow", String::new()),
        Some(Err(panicked)) => return Verdict::bad(group, "panic", panicked),
        Some(Ok(Err(_))) => return Verdict::open(group, "refused by the scene", String::new()),
        Some(Ok(Ok(Err(SimError::Overlap { .. })))) => {
            return Verdict::open(group, "overlap at the start", String::new());
        }
        // A tilt of the floor tells corners apart that are one in the plane: there are derivatives from both sides, and they differ.
        Some(Ok(Ok(Err(SimError::Named { what: "parameter", .. })))) => {
            return Verdict::open(group, "refused by a parameter", String::new());
        }
        Some(Ok(Ok(Err(why)))) => return Verdict::bad(group, "refused", why.to_string()),
        Some(Ok(Ok(Ok(found)))) => found,
    };
    if let Some(broken) = &found.by.broken {
        let reason = broken.reason.rsplit(": ").next().unwrap_or_default();
        return Verdict::open(group, format!("no derivative ({reason})"), String::new());
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
        return Verdict::open(group, "differences do not converge", String::new());
    }
    let off = (&found.forward - best).amax() / size(best);
    let kinds: Vec<&str> = found.by.events.iter().flat_map(|event| event.kinds.iter().copied()).collect();
    let note = format!("apart by {off:.1e}, differences by {apart:.1e}, after {kinds:?}");
    let share = if kinds.contains(&"zeno") { SHARE_SUMMED } else { SHARE };
    if off.is_nan() || off > ALLOWED * apart.max(0.1 * share) {
        return Verdict::bad(group, "differences contradict", note);
    }
    let met = kinds.iter().filter(|kind| ["impact", "several", "limit"].contains(kind)).count();
    Verdict::right(group, if met > 0 { "agrees, through impacts" } else { "agrees" }, note)
}

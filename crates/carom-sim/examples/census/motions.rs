//! Motions with lasting contacts from random starts: a census of their events, and their order.

use super::census::each;
use carom_sim::{Distribution, EventKind, Perturbation, Plan, Sampling, Scene, Seen, Simulation, StepReason, Summary};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

pub type Answer<T> = Result<T, Box<dyn std::error::Error>>;

const DIGITS: [i32; 5] = [6, 7, 8, 9, 10];
const EXACT: f64 = 1e-12;
/// Samples of a run.
const SAMPLES: f64 = 200.0;
/// The change of a state by which a change of the start by [`EXACT`] has grown too much.
const GROWN: f64 = 1e-9;
/// Starts that overlap a surface are drawn again, from the numbers of another run.
const DRAWS: u64 = 50;

/// A scene with the sizes of its disturbances.
struct Study {
    name: &'static str,
    plan: Plan,
    duration: f64,
    disturbed: Perturbation,
    /// By which the base is lifted, so that it overlaps no surface, m.
    raised: f64,
}

impl Study {
    /// `size`: the disturbances of each number of qd, in q and in qd; the first six are those of the base if it floats.
    fn new(name: &'static str, raised: f64, size: impl Fn(usize) -> (f64, f64)) -> Answer<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = Scene::from_file(root.join(format!("scenes/{name}.toml")))?;
        let plan = scene.plan()?;
        let (q, qd) = (0..plan.qd.len()).map(size).unzip();
        let disturbed = Perturbation { q, qd, numbers: Vec::new(), seed: 17, distribution: Distribution::Uniform };
        Ok(Self { name, duration: scene.duration, plan, disturbed, raised })
    }

    fn all() -> Answer<Vec<Self>> {
        let base = |k: usize, place: f64, turn: f64, joint: f64| match k {
            0..3 => place,
            3..6 => turn,
            _ => joint,
        };
        Ok(vec![
            Self::new("box", 0.15, |k| (base(k, 0.05, 3.0, 0.0), base(k, 1.0, 5.0, 0.0)))?,
            Self::new("table", 0.0, |_| (0.3, 0.5))?,
            Self::new("quadruped", 0.1, |k| (base(k, 0.05, 0.3, 0.3), base(k, 0.5, 1.0, 1.0)))?,
        ])
    }

    /// The random start of this number.
    fn start(&self, number: u64) -> Answer<(Vec<f64>, Vec<f64>)> {
        let sim = &self.plan.simulation;
        for draw in 0..DRAWS {
            let mut q = self.plan.q.clone();
            q[2] += self.raised;
            let (q, qd) = self.disturbed.start(&sim.chain, (&q, &self.plan.qd), 1 + DRAWS * number + draw)?;
            if sim.smallest_gap(&q)? > 0.0 {
                return Ok((q, qd));
            }
        }
        Err(format!("{}: no start without an overlap", self.name).into())
    }

    /// q at equal intervals, with a base that is raised by this, m.
    fn path(&self, tolerance: f64, start: &(Vec<f64>, Vec<f64>), raised: f64) -> Answer<Vec<Vec<f64>>> {
        let mut start = start.clone();
        start.0[0] += raised;
        let mut path = Vec::new();
        let sampling = Sampling { every: Some(self.duration / SAMPLES), ..Sampling::default() };
        let see = &mut |seen: Seen| {
            if let Seen::Moment(moment) = seen {
                path.push(moment.q.clone());
            }
        };
        self.run_sampled(tolerance, &start, sampling, see)?;
        Ok(path)
    }

    fn run(&self, tolerance: f64, start: &(Vec<f64>, Vec<f64>), see: &mut dyn FnMut(Seen)) -> Answer<Summary> {
        self.run_sampled(tolerance, start, Sampling::default(), see)
    }

    fn run_sampled(
        &self,
        tolerance: f64,
        (q, qd): &(Vec<f64>, Vec<f64>),
        sampling: Sampling,
        see: &mut dyn FnMut(Seen),
    ) -> Answer<Summary> {
        let zeno_time = Simulation::zeno_time_for(tolerance);
        let sim = Simulation { tolerance, zeno_time, ..self.plan.simulation.clone() };
        Ok(sim.stream(q, qd, self.duration, sampling, see)?)
    }
}

/// What was counted in one run.
#[derive(Default)]
struct Count {
    events: BTreeMap<&'static str, usize>,
    /// Stretches of time steps: reason, start, length.
    stretches: Vec<(StepReason, f64, f64)>,
    failed: Option<String>,
    time: f64,
    evaluations: usize,
    residual: f64,
    /// The residual of the balance of energy, J.
    energy: f64,
    /// Impacts of several contacts that their law does not solve.
    unsolved: usize,
}

/// The residual above which an impact is not solved.
const UNSOLVED: f64 = 1e-9;

fn count(study: &Study, number: u64) -> Count {
    let mut found = Count::default();
    let mut since: Option<(StepReason, f64)> = None;
    let clock = Instant::now();
    let tolerance = study.plan.simulation.tolerance;
    let done = study.start(number).and_then(|start| {
        study.run(tolerance, &start, &mut |seen| {
            let Seen::Event(event) = seen else { return };
            *found.events.entry(event.kind.name()).or_default() += 1;
            if let Some((reason, from)) = since.take() {
                found.stretches.push((reason, from, event.time - from));
            }
            found.unsolved +=
                usize::from(matches!(event.kind, EventKind::Several { residual, .. } if residual > UNSOLVED));
            if let EventKind::Steps { reason } = event.kind {
                since = Some((reason, event.time));
            }
        })
    });
    if let Some((reason, from)) = since {
        found.stretches.push((reason, from, study.duration - from));
    }
    match done {
        Ok(summary) => {
            found.evaluations = summary.statistics.evaluations;
            found.residual = summary.statistics.worst_residual;
            found.energy = summary.energy.error().abs();
        }
        Err(error) => found.failed = Some(error.to_string()),
    }
    found.time = clock.elapsed().as_secs_f64();
    found
}

pub fn census(starts: u64, only: Option<&str>) -> Answer<()> {
    println!("| scene | starts | share of time in time steps | stretches | failures | seconds per run: median, most |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let mut more = String::new();
    for study in Study::all()?.iter().filter(|study| only.is_none_or(|name| name == study.name)) {
        let counts = each(0..starts, |number| count(study, number));
        let stepped: f64 = counts.iter().flat_map(|one| &one.stretches).map(|stretch| stretch.2).sum();
        let failed = counts.iter().filter(|one| one.failed.is_some()).count();
        let times: Vec<f64> = counts.iter().map(|one| one.time).collect();
        println!(
            "| {} | {starts} | {:.4} % | {} | {failed} | {:.3}, {:.2} |",
            study.name,
            100.0 * stepped.abs() / (starts as f64 * study.duration),
            counts.iter().map(|one| one.stretches.len()).sum::<usize>(),
            quartiles(&times)[1],
            times.iter().copied().fold(0.0, f64::max),
        );
        let mut kinds = BTreeMap::<&str, usize>::new();
        let mut reasons = BTreeMap::<&str, (usize, f64, Vec<String>)>::new();
        let mut failures = BTreeMap::<String, Vec<usize>>::new();
        for (number, one) in counts.iter().enumerate() {
            one.events.iter().for_each(|(kind, events)| *kinds.entry(kind).or_default() += events);
            for (reason, from, length) in &one.stretches {
                let entry = reasons.entry(reason.name()).or_default();
                (entry.0, entry.1) = (entry.0 + 1, entry.1 + length);
                entry.2.push(format!("{number} at {from:.6} s"));
            }
            if let Some(error) = &one.failed {
                // The numbers of the message differ.
                let words = error.chars().filter(|letter| !letter.is_ascii_digit()).collect();
                failures.entry(words).or_default().push(number);
            }
        }
        let evaluations: usize = counts.iter().map(|one| one.evaluations).sum();
        let residual = counts.iter().map(|one| one.residual).fold(0.0, f64::max);
        let unsolved: usize = counts.iter().map(|one| one.unsolved).sum();
        more += &format!(
            "\n{}: events {kinds:?}; {evaluations} evaluations; worst residual {residual:.1e}, {unsolved} impacts without solution\n",
            study.name
        );
        for (reason, (stretches, time, first)) in reasons {
            more +=
                &format!("  {stretches} stretches, {time:.4} s: {reason}; starts {:?}\n", &first[..first.len().min(8)]);
        }
        for (error, starts) in failures {
            more += &format!("  {} failures: {error}; starts {:?}\n", starts.len(), &starts[..starts.len().min(8)]);
        }
        let energies: Vec<f64> = counts.iter().map(|one| one.energy).collect();
        let [_, middle, upper] = quartiles(&energies);
        let mut worst: Vec<usize> = (0..counts.len()).collect();
        worst.sort_by(|a, b| energies[*b].total_cmp(&energies[*a]));
        let worst = worst.iter().take(8).map(|&k| format!("{k}: {:.1e}", energies[k])).collect::<Vec<_>>();
        more += &format!(
            "  residual of the balance of energy, J: median {middle:.1e}, upper quartile {upper:.1e}; starts {worst:?}\n"
        );
        let slowest = (0..counts.len()).max_by(|a, b| times[*a].total_cmp(&times[*b])).unwrap_or_default();
        more += &format!("  slowest: start {slowest}\n");
    }
    print!("{more}");
    Ok(())
}

pub fn order(starts: u64, only: Option<&str>) -> Answer<()> {
    println!("| scene | tolerance | error of q: quartiles |");
    println!("| --- | --- | --- |");
    for study in Study::all()?.iter().filter(|study| only.map_or(study.name != "quadruped", |name| name == study.name))
    {
        let errors = each(0..starts, |number| {
            let start = study.start(number).ok()?;
            let exact = study.path(EXACT, &start, 0.0).ok()?;
            let nudged = study.path(EXACT, &start, EXACT).ok()?;
            let grown = exact.iter().zip(&nudged).position(|(a, b)| distance(a, b) > GROWN);
            let last = grown.unwrap_or(exact.len()).saturating_sub(1);
            let error = |digits: i32| {
                let path = study.path(10_f64.powi(-digits), &start, 0.0).ok()?;
                Some(distance(&path[last], &exact[last]).max(1e-16))
            };
            let mut found = DIGITS.iter().map(|&digits| error(digits)).collect::<Option<Vec<f64>>>()?;
            found.push(last as f64 * study.duration / SAMPLES);
            Some(found)
        });
        let failed = errors.iter().filter(|one| one.is_none()).count();
        let errors: Vec<Vec<f64>> = errors.into_iter().flatten().collect();
        for (k, digits) in DIGITS.iter().enumerate() {
            let [low, median, high] = quartiles(&errors.iter().map(|one| one[k]).collect::<Vec<_>>());
            println!("| {} | 1e-{digits} | {low:.1e}, {median:.1e}, {high:.1e} |", study.name);
        }
        let [low, median, high] = quartiles(&errors.iter().map(|one| one[DIGITS.len()]).collect::<Vec<_>>());
        println!("| {} | time of the comparison, s | {low:.2}, {median:.2}, {high:.2} |", study.name);
        let [low, median, high] = quartiles(&errors.iter().map(|one| slope(one)).collect::<Vec<_>>());
        println!("| {} | order | {low:.2}, {median:.2}, {high:.2}; {failed} failures |", study.name);
    }
    Ok(())
}

/// Slope of log error against log tolerance, by least squares.
fn slope(errors: &[f64]) -> f64 {
    let mean = DIGITS.iter().map(|&digits| f64::from(digits)).sum::<f64>() / DIGITS.len() as f64;
    let pairs = DIGITS.iter().map(|&digits| f64::from(digits) - mean).zip(errors);
    let (above, below) =
        pairs.fold((0.0, 0.0), |(above, below), (x, error)| (above - x * error.log10(), below + x * x));
    above / below
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * (sorted.len().max(1) - 1) as f64).round() as usize).copied();
    [0.25, 0.5, 0.75].map(|share| at(share).unwrap_or(f64::NAN))
}

/// The events of one start, and its costs.
pub fn one(number: u64, only: Option<&str>) -> Answer<()> {
    for study in Study::all()?.iter().filter(|study| only.is_none_or(|name| name == study.name)) {
        let start = study.start(number)?;
        println!("{}: q {:?}, qd {:?}", study.name, start.0, start.1);
        let touches = &study.plan.simulation.touches;
        let summary = study.run(study.plan.simulation.tolerance, &start, &mut |seen| {
            let Seen::Event(event) = seen else { return };
            let of: Vec<&str> = match &event.kind {
                EventKind::Several { touches: several, .. } => {
                    several.iter().map(|&k| touches[k].name.as_str()).collect()
                }
                EventKind::Steps { reason } => vec![reason.name()],
                kind => kind.touch().map(|k| touches[k].name.as_str()).into_iter().collect(),
            };
            println!("{:.12} {} {of:?}", event.time, event.kind.name());
        })?;
        println!("{:?}", summary.statistics);
    }
    Ok(())
}

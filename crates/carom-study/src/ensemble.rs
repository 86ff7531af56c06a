//! Many runs of one scene with disturbances: a table whose rows are functions of their number, their spread, and what the derivatives of
//! the undisturbed run predict for it.

use crate::numbered::{self, Block, NumberedRows};
use crate::problem_file::SAMPLE;
use crate::scene_table::{SCENE_KEY, state_columns};
use crate::table::{CHUNK, Column};
use carom_sim::{Columns, Moment, Perturbation, Plan, Sampling, Scene, Seen, SimError, StopReason, Summary};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// One run of a scene with its disturbances.
#[derive(Debug, Clone)]
struct Run {
    /// Its number; 0 is the start itself.
    pub number: u64,
    /// The disturbed numbers of the scene.
    pub numbers: Vec<f64>,
    /// The start, of the whole chain.
    pub start: Moment,
    /// Number of impacts: events with impulses.
    pub impacts: usize,
    /// Time of the first impact, s.
    pub first_impact: Option<f64>,
    /// Whether the events are those of run 0, in their order.
    pub same_events: bool,
    /// The result of the run, of the chain that the plan keeps; or why there is none, for instance an overlap at the start.
    pub result: Result<Summary, SimError>,
}

/// What to tell of runs of a scene that has no [`perturbation`](Scene::perturbation).
const ALL_THE_SAME: &str =
    "the scene has no disturbance, and all runs would be the same: add [run] perturb = { q = …, qd = …, numbers = … }";

/// How runs end, in the column `outcome`.
const OUTCOMES: [&str; 3] = ["duration", "events", "refused"];

impl Run {
    /// Its row among so many columns.
    fn row(&self, columns: usize) -> Vec<f64> {
        let start = self.start.q.iter().chain(&self.start.qd);
        let mut row = vec![self.number as f64];
        match &self.result {
            Ok(summary) => {
                let stop = f64::from(u8::from(summary.stop == StopReason::Events));
                let first = self.first_impact.unwrap_or(f64::NAN);
                let same = f64::from(u8::from(self.same_events));
                row.extend([stop, self.impacts as f64, first, summary.events as f64, same]);
                row.extend(self.numbers.iter().chain(start));
                row.push(summary.last.time);
                row.extend(summary.last.q.iter().chain(&summary.last.qd));
                let energy = summary.energy;
                row.extend([energy.start, energy.end, energy.impacts, energy.error()]);
            }
            Err(_) => {
                row.extend([2.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN]);
                row.extend(self.numbers.iter().chain(start));
                row.resize(columns, f64::NAN);
            }
        }
        row
    }
}

/// Many runs of one scene, whose [`perturbation`](Scene::perturbation) disturbs them. A run is a function of its number; run 0 has no
/// disturbance.
pub struct Ensemble<'s> {
    scene: &'s Scene,
    plan: &'s Plan,
    given: &'s Perturbation,
    /// The undisturbed numbers of the scene, and the start that its file gives.
    numbers: Vec<f64>,
    of_file: (Vec<f64>, Vec<f64>),
    runs: u64,
    columns: Vec<Column>,
    /// The events of run 0.
    events: Vec<Mark>,
    /// The end of run 0.
    end: Option<(Moment, StopReason)>,
    seen: Mutex<Noted>,
}

/// What an event is: its kind, the names of its contacts, which have other numbers in other plans, and its joint.
type Mark = (&'static str, Vec<String>, Option<String>);

/// What was seen of the runs so far.
#[derive(Default)]
struct Noted {
    refused: u64,
    first_refusal: Option<String>,
    /// Runs with other events than run 0.
    others: u64,
    impacts: Sample,
    first_impact: Sample,
    lost: Sample,
    /// Of the end, relative to that of run 0: displacement and velocity.
    end: Cloud,
}

/// The spread of the runs of an ensemble that were computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Runs {
    /// Number of runs.
    pub runs: u64,
    /// Of them without a result.
    pub refused: u64,
    /// Why the first of these has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_refusal: Option<String>,
    /// Runs whose events are not those of run 0.
    pub other_events: u64,
    /// Impacts of a run; `None` if all runs were refused, as below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impacts: Option<Spread>,
    /// Time of the first impact, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_impact: Option<Spread>,
    /// Energy that is lost in impacts, J.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_in_impacts: Option<Spread>,
}

/// A number over the runs that have one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Number of runs.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the sample.
    pub deviation: f64,
    /// Least.
    pub least: f64,
    /// Greatest.
    pub most: f64,
}

/// The covariance of the end of the runs, beside that which the derivatives of run 0 predict for small disturbances.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Covariance {
    /// The numbers of the end: `q shoulder`, `qd shoulder` …; displacements, as in a [`Sensitivity`](carom_sim::Sensitivity).
    pub names: Vec<String>,
    /// Covariance of the runs that have a result, rows.
    pub sampled: Vec<Vec<f64>>,
    /// S Σ Sᵀ with the derivatives S of the end of run 0 and the covariance Σ of the disturbances; `None` if there are no derivatives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear: Option<Vec<Vec<f64>>>,
    /// Predicted standard deviations of the times of the events of run 0, s; those of one time are one.
    pub event_times: Vec<PredictedTime>,
    /// Why there are no derivatives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broken: Option<String>,
}

/// The predicted spread of the time of events.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictedTime {
    /// Kinds of the events.
    pub kinds: Vec<String>,
    /// The time in run 0, s.
    pub time: f64,
    /// Standard deviation, s; `None` for impacts so slow that the digits of their derivatives do not count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<f64>,
}

/// Mean and variance by Welford's update.
#[derive(Default)]
struct Sample {
    count: u64,
    mean: f64,
    squares: f64,
    ends: Option<(f64, f64)>,
}

impl Sample {
    fn add(&mut self, x: f64) {
        self.count += 1;
        let off = x - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (x - self.mean);
        let (least, most) = self.ends.unwrap_or((x, x));
        self.ends = Some((least.min(x), most.max(x)));
    }

    fn spread(&self) -> Option<Spread> {
        let (least, most) = self.ends?;
        let deviation = (self.squares / (self.count.max(2) - 1) as f64).sqrt();
        Some(Spread { count: self.count, mean: self.mean, deviation, least, most })
    }
}

/// Mean and covariance of vectors, by the same update.
#[derive(Default)]
struct Cloud {
    count: u64,
    mean: DVector<f64>,
    squares: DMatrix<f64>,
}

impl Cloud {
    fn add(&mut self, x: DVector<f64>) {
        if self.count == 0 {
            (self.mean, self.squares) = (DVector::zeros(x.len()), DMatrix::zeros(x.len(), x.len()));
        }
        self.count += 1;
        let off = &x - &self.mean;
        self.mean += &off / self.count as f64;
        self.squares += &off * (x - &self.mean).transpose();
    }
}

/// Runs of one scene are computed in groups of this number for each thread; the threads wait for each other at the end of a group.
const GROUP: u64 = 16;

impl<'s> Ensemble<'s> {
    /// So many runs of a scene. Where the disturbances are of the start only, all have the plan of the scene.
    ///
    /// # Errors
    /// [`SimError::Scene`]: the scene has no disturbance, or one of a key that it does not have. An error of run 0 is none here: it is refused.
    pub fn new(scene: &'s Scene, plan: &'s Plan, runs: u64) -> Result<Self, SimError> {
        let refuse = |rule: String| SimError::Scene { file: String::new(), rule };
        let given = scene.perturbation.as_ref().ok_or_else(|| refuse(ALL_THE_SAME.into()))?;
        if given.numbers.iter().any(|own| own.path == SAMPLE) {
            return Err(refuse(format!("[run] perturb.numbers: {SAMPLE}: the runs have no samples: remove it")));
        }
        let numbers = given.numbers.iter().map(|own| match scene.number(&own.path) {
            Err(SimError::Scene { file, rule }) => Err(refuse(format!("[run] perturb.numbers: {file}: {rule}"))),
            number => number,
        });
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
        let (seen, columns) = (Mutex::default(), columns(scene, plan, given));
        let of_file =
            if numbers.is_empty() { Default::default() } else { scene.with_values(&[]).map(|it| (it.q, it.qd))? };
        let (events, end) = (Vec::new(), None);
        let mut own = Self { scene, plan, given, numbers, of_file, runs, columns, events, end, seen };
        let mut events = Vec::new();
        let first = plan.stream(scene.duration, Sampling::default(), &mut |seen| {
            if let Seen::Event(event) = seen {
                let (kind, touches, joint) = event.kind.mark();
                let names = touches.into_iter().map(|touch| plan.simulation.touches[touch].name.clone());
                events.push((kind, names.collect(), joint.map(str::to_owned)));
            }
        });
        (own.events, own.end) = (events, first.ok().map(|summary| (summary.last, summary.stop)));
        own.refuse_start_of_file()?;
        Ok(own)
    }

    /// Computes runs in parallel, and passes their rows to `each` in the order of their numbers. They do not depend on the number of threads.
    /// Setting `stop` ends this early: runs that have begun are completed, no other begins.
    pub fn for_each(&self, runs: Range<u64>, stop: &AtomicBool, mut each: impl FnMut(Vec<f64>)) {
        let (mut first, size) = (runs.start, GROUP * rayon::current_num_threads() as u64);
        while first < runs.end && !stop.load(Ordering::Relaxed) {
            let group = first..runs.end.min(first + size);
            first = group.end;
            for run in numbered::in_order(group, stop, |number| self.run(number)) {
                self.note(&run);
                each(run.row(self.columns.len()));
            }
        }
    }

    /// The spread of the runs that were computed.
    pub fn spread(&self) -> Runs {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        Runs {
            runs: seen.refused + seen.impacts.count,
            refused: seen.refused,
            first_refusal: seen.first_refusal.clone(),
            other_events: seen.others,
            impacts: seen.impacts.spread(),
            first_impact: seen.first_impact.spread(),
            lost_in_impacts: seen.lost.spread(),
        }
    }

    /// The covariance of the end of the runs that were computed, and that which the derivatives of run 0 predict.
    ///
    /// # Errors
    /// As [`Plan::sensitivity`]; a number of the scene by which a run has no derivatives.
    pub fn covariance(&self) -> Result<Covariance, SimError> {
        let names = self.plan.simulation.state_names();
        let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        let sampled = {
            let Cloud { count, squares, .. } = &self.seen.lock().unwrap_or_else(PoisonError::into_inner).end;
            let none = DMatrix::zeros(names.len(), names.len());
            if *count == 0 { none } else { squares / (*count.max(&2) - 1) as f64 }
        };
        let columns = self.differentiated()?;
        let found = columns.of_all(self.plan.sensitivity(self.scene.duration, &columns.parameters)?);
        // Of the numbers of the start that the plan keeps.
        let sizes = self.kept(&self.given.q).into_iter().chain(self.kept(&self.given.qd));
        let of_start = sizes.map(|size| self.given.distribution.deviation(size));
        let of_numbers = self.given.numbers.iter().map(|it| it.distribution.deviation(it.size));
        let deviations: Vec<f64> = of_start.chain(of_numbers).collect();
        let linear = found.last_by.map(|mut by| {
            by.column_iter_mut().zip(&deviations).for_each(|(mut column, size)| column *= *size);
            rows(&(&by * by.transpose()))
        });
        let event_times = found.events.iter().map(|event| PredictedTime {
            kinds: event.kinds.iter().map(ToString::to_string).collect(),
            time: event.time,
            deviation: Some(
                event.time_by.iter().zip(&deviations).map(|(by, size)| (by * size).powi(2)).sum::<f64>().sqrt(),
            )
            .filter(|deviation| deviation.is_finite()),
        });
        let event_times = event_times.collect();
        let broken = found.broken.map(|it| format!("at {} s {}", it.time, it.reason));
        Ok(Covariance { names, sampled: rows(&sampled), linear, event_times, broken })
    }

    /// The start and the numbers that are disturbed, by which runs are differentiated: [`Ensemble::covariance`] needs them.
    ///
    /// # Errors
    /// A number of the scene by which a run has no derivatives.
    pub fn check_covariance(&self) -> Result<(), SimError> {
        self.differentiated().map(drop)
    }

    /// Refuses disturbed numbers of the start in a scene with a start of one's own: with them comes that of its file.
    fn refuse_start_of_file(&self) -> Result<(), SimError> {
        let is_start = |scene: &Scene| (&scene.q, &scene.qd) == (&self.of_file.0, &self.of_file.1);
        if self.numbers.is_empty() || is_start(self.scene) {
            return Ok(());
        }
        for ((own, number), change) in self.given.numbers.iter().zip(&self.numbers).zip(self.given.changes(1)) {
            if self.scene.with_values(&[(own.path.clone(), number + change)]).is_ok_and(|it| !is_start(&it)) {
                let rule = format!(
                    "[run] perturb.numbers: {} is a number of the start, which is not that of the file: disturb it by perturb.q or perturb.qd",
                    own.path
                );
                return Err(SimError::Scene { file: String::new(), rule });
            }
        }
        Ok(())
    }

    fn differentiated(&self) -> Result<Columns, SimError> {
        let numbers = self.given.numbers.iter().map(|it| it.path.clone());
        let by: Vec<String> = ["q", "qd"].map(String::from).into_iter().chain(numbers).collect();
        let unknown = |rule| SimError::Scene { file: String::new(), rule };
        if matches!(self.end, Some((_, StopReason::Events))) {
            let rule = "the runs end at an event, and the derivatives are those of the state at a fixed time: remove max_events";
            return Err(unknown(rule.into()));
        }
        Columns::of(self.plan, &by, |path| self.scene.parameter(path), unknown)
    }

    /// Of numbers for each velocity of the scene those of the velocities that the plan keeps.
    fn kept(&self, sizes: &[f64]) -> Vec<f64> {
        let (whole, own) = (self.scene.simulation.state_names(), self.plan.simulation.state_names());
        let (whole, own) = (&whole[..whole.len() / 2], &own[..own.len() / 2]);
        own.iter().filter_map(|name| Some(sizes[whole.iter().position(|it| it == name)?])).collect()
    }

    fn note(&self, run: &Run) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        match &run.result {
            Err(error) => {
                seen.refused += 1;
                seen.first_refusal.get_or_insert_with(|| format!("run {}: {error}", run.number));
            }
            Ok(summary) => {
                seen.others += u64::from(!run.same_events);
                seen.impacts.add(run.impacts as f64);
                run.first_impact.iter().for_each(|time| seen.first_impact.add(*time));
                seen.lost.add(summary.energy.impacts);
                if let Some((end, _)) = &self.end
                    && let Ok(moved) = self.plan.simulation.chain.difference(&end.q, &summary.last.q)
                {
                    let faster = summary.last.qd.iter().zip(&end.qd).map(|(own, of)| own - of);
                    seen.end.add(DVector::from_vec(moved.into_iter().chain(faster).collect()));
                }
            }
        }
    }

    fn run(&self, number: u64) -> Run {
        let Self { scene, given, .. } = *self;
        let changes = given.changes(number);
        let numbers: Vec<f64> = self.numbers.iter().zip(changes).map(|(own, change)| own + change).collect();
        let at = |q: &[f64], qd: &[f64]| Moment { time: scene.simulation.start_time, q: q.to_vec(), qd: qd.to_vec() };
        let changed = (!numbers.is_empty()).then(|| self.changed(&numbers)).transpose();
        let undone = |start, error| Run {
            number,
            numbers: numbers.clone(),
            start,
            impacts: 0,
            first_impact: None,
            same_events: false,
            result: Err(error),
        };
        let changed = match changed {
            Ok(changed) => changed,
            Err(SimError::Scene { rule, .. }) => {
                let error = SimError::Scene { file: "[run] perturb.numbers".into(), rule };
                return undone(at(&scene.q, &scene.qd), error);
            }
            Err(error) => return undone(at(&scene.q, &scene.qd), error),
        };
        let (scene, plan) = changed.as_ref().map_or((scene, self.plan), |(scene, plan)| (scene, plan));
        let (q, qd) = match given.start(&scene.simulation.chain, (&scene.q, &scene.qd), number) {
            Ok(start) => start,
            Err(error) => return undone(at(&scene.q, &scene.qd), error),
        };
        let (mut impacts, mut first_impact, mut count, mut same) = (0, None, 0, true);
        let result = plan.stream_from((&q, &qd), scene.duration, Sampling::default(), &mut |seen| {
            let Seen::Event(event) = seen else { return };
            if event.kind.is_impact() {
                impacts += 1;
                first_impact.get_or_insert(event.time);
            }
            let (kind, touches, joint) = event.kind.mark();
            let names = touches.iter().map(|touch| &plan.simulation.touches[*touch].name);
            let is = |own: &Mark| own.0 == kind && own.1.iter().eq(names) && own.2.as_deref() == joint;
            same &= self.events.get(count).is_some_and(is);
            count += 1;
        });
        let same_events = same && count == self.events.len();
        Run { number, numbers, start: at(&q, &qd), impacts, first_impact, same_events, result }
    }

    /// The scene and its plan with these numbers.
    fn changed(&self, numbers: &[f64]) -> Result<(Scene, Plan), SimError> {
        let paths = self.given.numbers.iter().map(|own| own.path.clone());
        let values: Vec<(String, f64)> = paths.zip(numbers.iter().copied()).collect();
        let mut scene = self.scene.with_values(&values)?;
        // A start of one's own stays, unless the numbers are of the start.
        if (&scene.q, &scene.qd) == (&self.of_file.0, &self.of_file.1) {
            (scene.q, scene.qd) = (self.scene.q.clone(), self.scene.qd.clone());
        }
        scene.simulation.start_time = self.scene.simulation.start_time;
        let mut plan = scene.plan()?;
        plan.simulation.stop.clone_from(&self.plan.simulation.stop);
        if plan.simulation.state_names() != self.plan.simulation.state_names() {
            let rule = "with these numbers the plan keeps other joints: add model = \"full\"".into();
            return Err(SimError::Scene { file: String::new(), rule });
        }
        Ok((scene, plan))
    }
}

fn columns(scene: &Scene, plan: &Plan, given: &Perturbation) -> Vec<Column> {
    let (whole, kept) = (state_columns(&scene.simulation.chain), state_columns(&plan.simulation.chain));
    let mut columns = vec![Column::number("run"), Column::word("outcome", OUTCOMES)];
    let of_events = [("impacts", ""), ("first_impact", "s"), ("events", ""), ("same_events", "")];
    columns.extend(of_events.map(|(name, unit)| Column::number(name).in_unit(unit)));
    columns.extend(given.numbers.iter().map(|own| Column::number(&own.path)));
    let of = |moment: &str, it: &Column| Column::number(format!("{moment}.{}", it.name)).in_unit(it.unit);
    columns.extend(whole[1..].iter().map(|it| of("start", it)));
    columns.extend(kept.iter().map(|it| of("end", it)));
    let energies = ["energy_start", "energy_end", "lost_in_impacts", "energy_error"];
    columns.extend(energies.map(|name| Column::number(name).in_unit("J")));
    columns
}

impl NumberedRows for Ensemble<'_> {
    /// The columns: number, outcome, impacts, time of the first one, events, whether these are those of run 0; disturbed numbers, start, end,
    /// energies.
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn rows(&self) -> u64 {
        self.runs
    }

    fn text(&self) -> (&'static str, &str) {
        (SCENE_KEY, &self.scene.text)
    }

    fn sources(&self) -> Vec<(String, String)> {
        let mut all = vec![
            ("the scene".to_owned(), self.scene.text.clone()),
            ("the number of runs".to_owned(), self.runs.to_string()),
        ];
        all.extend(numbered::checksums(&self.scene.files));
        all
    }

    fn least(&self) -> usize {
        CHUNK * rayon::current_num_threads()
    }

    fn compute(&self, mut block: Block) -> usize {
        let runs = block.map(|number| self.run(number));
        runs.iter().enumerate().for_each(|(place, run)| block.set(place, &run.row(self.columns.len())));
        runs.iter().for_each(|run| self.note(run));
        runs.len()
    }
}

//! Work–precision diagrams: error against computing time of every method that can run a scene, each over its own parameter
//! (tolerance, step or stiffness).
//!
//! The reference solution is an event-driven run in space with the tightest tolerance. Its own error is estimated by comparison
//! with a second integrator. Two errors are computed: of q̇ right after the first impact, and of q and q̇ at the end; beside the second stands
//! what event-driven runs estimate for it. Times are medians of whole runs without recording, and without the estimate.

mod kernel;
mod labelled;
mod picture;
mod stiffness;

pub use labelled::redraw;
pub use stiffness::StiffnessChart;

use carom_chain::Coordinates;
use carom_impact::Damping;
use carom_sim::{
    Compliance, Event, EventKind, Integrator, Moment, Plan, Sampling, Scene, Seen, SimError, Simulation, StateError,
    Touch, Trajectory, Yielding,
};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// One run of one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Run {
    /// Name of the method.
    pub method: String,
    /// Impact law that the method follows, as text.
    pub law: String,
    /// Name of the method's parameter, with its unit.
    pub knob: String,
    /// Value of the parameter.
    pub value: f64,
    /// Median wall time of the whole run, s.
    pub wall_time: f64,
    /// Error of q̇ right after the first impact, relative to its largest entry; `None` without an impact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_impact: Option<f64>,
    /// Greater of the errors of q and of q̇ at the end, that of q relative to its largest entry, that of q̇ to its largest entry at an
    /// event or at the end; `None` if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_end: Option<f64>,
    /// That error as the run estimates it, by [`Plan::error_of`]; `None` for other methods than events, and where there is no estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimated_at_end: Option<f64>,
}

/// Formats the value of a parameter: whole numbers below 1000 in full, others with two significant digits and an exponent.
fn knob_value(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1000.0 {
        return value.to_string();
    }
    let rounded = format!("{value:.1e}");
    rounded.replace(".0e", "e")
}

/// A method that could not run the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Absent {
    /// Name of the method.
    pub method: String,
    /// Why it could not run.
    pub reason: String,
}

/// One run of another program (a peer), as it writes it. Keys that a chart does not need are ignored.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct PeerRun {
    /// Name of the scene.
    pub scene: String,
    /// Names of the program and of its method.
    pub(crate) peer: String,
    pub(crate) method: String,
    #[serde(default)]
    pub(crate) version: String,
    /// Name of the method's parameter, with its unit.
    pub(crate) knob: String,
    /// Value of the parameter.
    pub(crate) value: f64,
    /// Wall time of the whole run, s.
    pub(crate) wall_time_s: Option<f64>,
    pub(crate) result: Option<PeerResult>,
    /// The error message of a run without a result.
    pub(crate) failure: Option<String>,
}

impl PeerRun {
    /// # Errors
    /// In words: the time of a run with a result is not positive.
    pub fn check(&self) -> Result<(), String> {
        match self.wall_time_s.filter(|time| self.result.is_some() && (time.is_nan() || *time <= 0.0)) {
            Some(time) => Err(format!("wall_time_s is {time}: it must be positive")),
            None => Ok(()),
        }
    }
}

/// States of a run of another program, in the conventions of carom.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct PeerResult {
    pub r#final: PeerState,
    /// Right after the first impact.
    pub after_impact: Option<PeerState>,
}

/// q, rad or m, and q̇, rad/s or m/s.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct PeerState {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
}

/// Work–precision data of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Chart {
    /// Impact law of the scene and of the reference solution, as text.
    law: String,
    /// All runs, grouped by method, in the order of the method's parameter.
    pub(crate) runs: Vec<Run>,
    /// Methods that could not run the scene.
    pub(crate) absent: Vec<Absent>,
    /// Estimated error of the reference solution after the first impact; `None` without an impact.
    #[serde(skip_serializing_if = "Option::is_none")]
    doubt_after_impact: Option<f64>,
    /// Estimated error of the reference solution at the end.
    pub(crate) doubt_at_end: f64,
    /// Methods of other programs.
    #[serde(skip)]
    peers: Vec<String>,
    #[serde(skip)]
    reference: Reference,
}

/// The reference solution.
#[derive(Debug, Clone, PartialEq)]
struct Reference {
    impact: Option<(f64, Vec<f64>)>,
    end: (Vec<f64>, Vec<f64>),
    /// Largest entry of q̇ at an event or at the end. At the end alone q̇ may be anything down to zero, as motions come to rest.
    speed: f64,
    /// First entries of the quaternions in q, of four entries each.
    quaternions: Vec<usize>,
}

impl Reference {
    fn of(sim: &Simulation, run: &Trajectory) -> Self {
        let first = run.events.iter().find(|event| is_impact(event));
        let last = &run.summary.last;
        let floating = sim.chain.joints().iter().filter_map(|joint| match &joint.coordinates {
            // a position and a quaternion
            Coordinates::Own { q, .. } if q.len() == 7 => Some(q.start + 3),
            _ => None,
        });
        let quaternions = floating.collect();
        let impact = first.map(|it| (it.time, it.qd_plus.clone()));
        let events = run.events.iter().flat_map(|event| [&event.qd_minus, &event.qd_plus]);
        let speed = events.chain([&last.qd]).map(|qd| largest(qd)).fold(0.0, f64::max);
        Self { impact, end: (last.q.clone(), last.qd.clone()), speed, quaternions }
    }

    fn after_impact(&self, qd: &[f64]) -> Option<f64> {
        self.impact.as_ref().and_then(|(_, exact)| off(qd, exact, largest(exact)))
    }

    fn at_end(&self, q: &[f64], qd: &[f64]) -> Option<f64> {
        let (exact, mut q) = (&self.end.0, q.to_vec());
        for &first in &self.quaternions {
            let (Some(own), Some(theirs)) = (q.get_mut(first..first + 4), exact.get(first..first + 4)) else {
                continue;
            };
            // A quaternion and its negative are the same rotation.
            if own.iter().zip(theirs).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                own.iter_mut().for_each(|x| *x = -*x);
            }
        }
        Some(off(&q, exact, largest(exact))?.max(off(qd, &self.end.1, self.speed)?))
    }

    /// The estimated error of a final state, relative to what [`Reference::at_end`] is relative to.
    fn estimated(&self, StateError { q, qd }: &StateError) -> Option<f64> {
        let [q, qd] =
            [(q, largest(&self.end.0)), (qd, self.speed)].map(|(of, size)| off(of, &vec![0.0; of.len()], size));
        Some(q?.max(qd?))
    }
}

fn is_impact(event: &Event) -> bool {
    matches!(event.kind, EventKind::Impact { .. } | EventKind::Several { .. } | EventKind::Limit { .. })
}

/// Whether an event ends an impact: the impact of a rigid contact, or the lift-off of a compliant one.
fn ends_impact(event: &Event) -> bool {
    is_impact(event) || matches!(event.kind, EventKind::LiftOff { .. })
}

fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Largest difference, relative to `size`; absolute if this is below 1e-9. `None` if the lengths differ or an entry is not finite.
fn off(found: &[f64], exact: &[f64], size: f64) -> Option<f64> {
    let size = if size > 1e-9 { size } else { 1.0 };
    let differ = found.iter().zip(exact).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    (found.len() == exact.len() && differ.is_finite()).then_some(differ / size)
}

/// Tolerance of the reference solution, and the loosest one for which its time steps are avoided.
const TIGHT: f64 = 1e-13;
const LOOSEST: f64 = 1e-11;
/// The parameter of event-driven methods.
const TOLERANCE: &str = "tolerance";
/// Least duration and least number of runs of one measurement.
const MEASURE: Duration = Duration::from_millis(150);
const FEWEST: usize = 5;

impl Chart {
    /// Runs a scene with every method. The parameter of a method is not refined further once a run takes a quarter of
    /// `budget`. `done` is called with the name of the method after each of its runs.
    ///
    /// # Errors
    /// [`SimError`] of the reference solution. Errors of other runs are told as the reasons of methods that are absent.
    pub fn of(scene: &Scene, budget: Duration, done: &mut dyn FnMut(&str)) -> Result<Self, SimError> {
        // no maximum step: the tolerance alone determines the steps
        let base = &Simulation { max_step: scene.duration, ..scene.simulation.clone() };
        // The rule that ends accumulations follows the tolerance.
        let zeno_time = |tolerance| Simulation::zeno_time_for(tolerance).min(base.zeno_time);
        let exact = |integrator, tolerance| {
            let zeno_time = zeno_time(tolerance);
            Simulation { integrator, tolerance, zeno_time, planar: false, ..base.clone() }
        };
        let run = |sim: &Simulation| sim.run(&scene.q, &scene.qd, scene.duration);
        // At the tightest tolerance rounding may leave no consistent mode, which time steps then bridge less exactly.
        let mut tight = TIGHT;
        let mut reference_run = run(&exact(Integrator::DormandPrince, tight))?;
        while reference_run.summary.statistics.contact_steps > 0 && tight < LOOSEST {
            tight *= 10.0_f64.sqrt();
            reference_run = run(&exact(Integrator::DormandPrince, tight))?;
        }
        let reference = Reference::of(base, &reference_run);
        // the errors of the other integrator are independent, except for rounding
        let other = Reference::of(base, &run(&exact(Integrator::Radau, 10.0 * tight))?);
        let doubt_after_impact = other.impact.as_ref().and_then(|(_, qd)| reference.after_impact(qd));
        let doubt_at_end = reference.at_end(&other.end.0, &other.end.1).unwrap_or(0.0);
        let (runs, absent, peers, law) = (Vec::new(), Vec::new(), Vec::new(), law_of(base));
        let mut chart = Self { runs, absent, law, doubt_after_impact, doubt_at_end, peers, reference };
        chart.closed_form(scene, &reference_run)?;

        let tolerances = || (3..=13).map(|k| 10_f64.powi(-k));
        let mut spaces = vec![(false, "in space")];
        if base.in_plane().is_some() {
            spaces.insert(0, (true, "in the plane"));
        }
        for &(planar, space) in &spaces {
            for (integrator, name) in [(Integrator::DormandPrince, "DOP853"), (Integrator::Radau, "Radau IIA")] {
                let at = |tolerance| {
                    let zeno_time = Simulation::zeno_time_for(tolerance);
                    Simulation { integrator, tolerance, zeno_time, planar, ..base.clone() }
                };
                let method = (format!("events, {name}, {space}"), "the scene's".to_owned());
                chart.sweep((scene, budget), method, TOLERANCE, tolerances(), at, done);
            }
        }
        let planar = spaces[0].0;
        let steps = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6];
        let at = |contact_step| Simulation { stepping: true, contact_step, planar, ..base.clone() };
        let method = ("Moreau–Jean steps".to_owned(), "Newton's e with a friction cone".to_owned());
        chart.sweep((scene, budget), method, "step, s", steps, at, done);
        let own = "contact force";
        let forces = [
            ("Hunt–Crossley", own, Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact }),
            ("Kelvin–Voigt", own, Yielding::KelvinVoigt { pulls: false }),
            ("Walton–Braun", "contact force, in the stiff limit Stronge's", Yielding::WaltonBraun),
        ];
        for (name, law, normal) in forces {
            let stiffnesses = (3..=11).map(|k| 10_f64.powi(k));
            let at = |stiffness| {
                let mut soft = Simulation { tolerance: 1e-10, planar, ..base.clone() };
                for touch in soft.touches.iter_mut().filter(|touch| touch.link().is_some()) {
                    touch.contact.compliance = Some(Compliance { normal, ..Compliance::new(stiffness) });
                }
                soft.touches = Touch::divided(soft.touches);
                soft
            };
            let method = (format!("compliant, {name}"), law.to_owned());
            chart.sweep((scene, budget), method, "stiffness", stiffnesses, at, done);
        }
        Ok(chart)
    }

    /// Adds a run of another program, which must be of this scene.
    pub fn add_peer(&mut self, run: PeerRun) {
        let PeerRun { peer, version, method, knob, value, wall_time_s, result, failure, .. } = run;
        let method = format!("{peer} {version}, {method}");
        let (Some(result), Some(wall_time)) = (result, wall_time_s) else {
            let reason = failure.unwrap_or_else(|| "the run has no result".to_owned());
            self.absent.push(Absent { method, reason: format!("{knob} = {value}: {reason}") });
            return;
        };
        let at_end = self.reference.at_end(&result.r#final.q, &result.r#final.qd);
        let after_impact = result.after_impact.and_then(|state| self.reference.after_impact(&state.qd));
        if at_end.is_none() && after_impact.is_none() {
            let reason = "its states are not finite, or do not have the size of this scene's".into();
            self.absent.push(Absent { method, reason });
        } else {
            self.peers.push(method.clone());
            let (law, estimated_at_end) = ("its own".to_owned(), None);
            self.runs.push(Run { method, law, knob, value, wall_time, after_impact, at_end, estimated_at_end });
        }
    }

    /// Prints all runs as a table.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn print(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{:36} {:>20} {:>10} {:>12} {:>10} {:>9}  law",
            "method", "parameter", "time, ms", "after impact", "at the end", "estimated"
        )?;
        for Run { method, law, knob, value, wall_time, after_impact, at_end, estimated_at_end } in &self.runs {
            let knob = format!("{knob} {}", knob_value(*value));
            let [after, end, estimated] = [after_impact, at_end, estimated_at_end].map(|error| number(*error));
            let time = wall_time * 1e3;
            writeln!(out, "{method:36} {knob:>20} {time:>10.4} {after:>12} {end:>10} {estimated:>9}  {law}")?;
        }
        self.caption().iter().try_for_each(|line| writeln!(out, "{line}"))?;
        for absent in &self.absent {
            writeln!(out, "not run: {}: {}", absent.method, absent.reason)?;
        }
        let doubt = number(self.doubt_after_impact);
        writeln!(out, "error of the reference solution: {doubt} after the impact, {:.1e} at the end", self.doubt_at_end)
    }

    /// All runs as CSV, one line each.
    pub fn csv(&self) -> String {
        let mut lines = csv::Writer::from_writer(Vec::new());
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
        let rows = self.runs.iter().map(|run| {
            let [value, time] = [run.value, run.wall_time].map(|x| format!("{x:e}"));
            let [after, end, estimated] = [run.after_impact, run.at_end, run.estimated_at_end].map(number);
            [run.method.clone(), run.knob.clone(), value, time, after, end, run.law.clone(), estimated]
        });
        let [method, knob, value, time, after, end, law] = HEAD;
        let head = [method, knob, value, time, after, end, law, ESTIMATED].map(String::from);
        for row in std::iter::once(head).chain(rows) {
            // writing into a vector does not fail
            let _ = lines.write_record(row);
        }
        lines.into_inner().map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default()
    }

    /// Definition of the errors, two lines of text.
    fn caption(&self) -> [String; 2] {
        let peers = if self.peers.is_empty() { "" } else { " Other programs use their own laws." };
        let first = format!("Errors are relative to the reference solution with the scene's law: {}.{peers}", self.law);
        let second = "Without friction all laws agree for a single contact; with friction, methods with another law do not \
                      converge to the reference solution.";
        [first, second.to_owned()]
    }

    /// Whether a method is carom's.
    fn is_own(&self, method: &str) -> bool {
        !self.peers.iter().any(|peer| peer == method)
    }

    /// Runs one method over the values of its parameter, until a run takes too long.
    fn sweep(
        &mut self,
        (scene, budget): (&Scene, Duration),
        (method, law): (String, String),
        knob: &str,
        values: impl IntoIterator<Item = f64>,
        simulation: impl Fn(f64) -> Simulation,
        done: &mut dyn FnMut(&str),
    ) {
        let mut refused: Option<String> = None;
        let before = self.runs.len();
        for value in values {
            let (sim, begin) = (simulation(value), Instant::now());
            // The errors of other methods do not follow from a tolerance.
            let estimates = knob == TOLERANCE;
            match measure(scene, &sim, &self.reference, (MEASURE.min(budget), estimates)) {
                Ok((wall_time, [after_impact, at_end, estimated_at_end])) => {
                    let (method, law, knob) = (method.clone(), law.clone(), knob.to_owned());
                    self.runs.push(Run { method, law, knob, value, wall_time, after_impact, at_end, estimated_at_end });
                    if wall_time > budget.as_secs_f64() / 4.0 {
                        break; // the next run would exceed the budget
                    }
                }
                Err(why) => {
                    refused = refused.or(Some(why));
                    if begin.elapsed() > budget {
                        break;
                    }
                }
            }
            done(&method);
        }
        if let Some(reason) = refused.filter(|_| self.runs.len() == before) {
            self.absent.push(Absent { method, reason });
        }
    }
}

/// The laws of a simulation's contacts, as text.
fn law_of(sim: &Simulation) -> String {
    let contacts = sim.touches.iter().filter(|touch| touch.link().is_some());
    let mut laws: Vec<String> = Vec::new();
    for contact in contacts.map(|touch| &touch.contact) {
        let law = match (contact.compliance.is_some(), contact.law.friction()) {
            (true, _) => "compliant contact".to_owned(),
            _ if contact.law.known().is_none() => contact.law.name().to_owned(),
            (false, 0.0) => format!("{}, no friction", contact.law.name()),
            (false, mu) => format!("{}, friction {mu}", contact.law.name()),
        };
        if !laws.contains(&law) {
            laws.push(law);
        }
    }
    if laws.is_empty() { "no contact".to_owned() } else { laws.join("; ") }
}

fn number(x: Option<f64>) -> String {
    x.map_or_else(|| "–".to_owned(), |x| format!("{x:.1e}"))
}

/// The columns of a table of runs.
const HEAD: [&str; 7] = ["method", "knob", "value", "wall_time_s", "error_after_impact", "error_at_end", "law"];
/// One more, which a drawing of chosen methods does not need.
const ESTIMATED: &str = "estimated_error_at_end";

/// The runs of a table that [`Chart::csv`] has written.
///
/// # Errors
///
/// In words, with the line: a missing column, a cell that is not a number, a time that is not positive.
fn from_csv(text: &str) -> Result<Vec<Run>, String> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let head = reader.headers().map_err(|e| e.to_string())?.clone();
    let mut place = [0; HEAD.len()];
    for (place, name) in place.iter_mut().zip(HEAD) {
        let found = head.iter().position(|it| it == name);
        *place = found.ok_or_else(|| format!("the column {name} is missing: carom chart writes it"))?;
    }
    let [method, knob, value, time, after, end, law] = place;
    let mut runs = Vec::new();
    for (k, row) in reader.records().enumerate() {
        let row = row.map_err(|e| e.to_string())?;
        let text = |column: usize| row.get(column).unwrap_or_default();
        let number = |column: usize| {
            let wrong = |_| format!("line {}, column {}: {:?} is not a number", k + 2, &head[column], text(column));
            text(column).parse::<f64>().map_err(wrong)
        };
        let perhaps = |column: usize| if text(column).is_empty() { Ok(None) } else { number(column).map(Some) };
        let wall_time = number(time)?;
        if !(wall_time > 0.0 && wall_time.is_finite()) {
            return Err(format!("line {}, column wall_time_s: {wall_time} is not a positive time", k + 2));
        }
        runs.push(Run {
            method: text(method).to_owned(),
            law: text(law).to_owned(),
            knob: text(knob).to_owned(),
            value: number(value)?,
            wall_time,
            after_impact: perhaps(after)?,
            at_end: perhaps(end)?,
            estimated_at_end: None,
        });
    }
    Ok(runs)
}

/// Time of one run, its errors after the first impact and at the end, and its estimate of the latter.
fn measure(
    scene: &Scene,
    sim: &Simulation,
    reference: &Reference,
    (long, estimates): (Duration, bool),
) -> Result<(f64, [Option<f64>; 3]), String> {
    // First the states, as a run that is refused needs no time.
    let soft = sim.touches.iter().any(|touch| touch.contact.compliance.is_some());
    let mut watch = After { reference, sim, qd: None, rigid: false, events: Vec::new() };
    let sampling = Sampling { every: sim.stepping.then_some(sim.contact_step), ..Sampling::default() };
    let summary = sim
        .stream(&scene.q, &scene.qd, scene.duration, sampling, &mut |seen| watch.see(&seen))
        .map_err(|e| e.to_string())?;
    if soft && (watch.rigid || summary.statistics.contact_steps > 0) {
        let what = if watch.rigid { "an impact of several rigid contacts" } else { "time steps with rigid contacts" };
        return Err(format!("the run has {what}, which does not depend on the stiffness"));
    }
    let bare = Sampling::default();
    let begin = Instant::now();
    let mut times = Vec::new();
    while times.is_empty() || (times.len() < 1000 && begin.elapsed() < long) || {
        times.len() < FEWEST && begin.elapsed() < 10 * long
    } {
        let start = Instant::now();
        sim.stream(&scene.q, &scene.qd, scene.duration, bare, &mut |_| {}).map_err(|e| e.to_string())?;
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);

    let after_impact = watch.qd.as_ref().and_then(|qd| reference.after_impact(qd));
    let at_end = reference.at_end(&summary.last.q, &summary.last.qd);
    let estimated = estimates.then(|| {
        let (simulation, flat, [kept, left_out]) = (sim.clone(), sim.in_plane(), [Vec::new(), Vec::new()]);
        let (q, qd) = (scene.q.clone(), scene.qd.clone());
        let plan = Plan { simulation, q, qd, flat, kept, left_out, bounded: Vec::new() };
        let error = plan.error_of((scene.duration, None), (&watch.events, &[], &summary));
        // Too tight a tolerance leaves no tighter one: no estimate.
        error.ok().and_then(|error| reference.estimated(&error.last?))
    });
    Ok((times[times.len() / 2], [after_impact, at_end, estimated.flatten()]))
}

/// Records q̇ right after the first impact: for a rigid contact after the event; for a compliant contact after its end; for
/// time stepping after the step that contains the impact and one more step.
struct After<'a> {
    reference: &'a Reference,
    sim: &'a Simulation,
    qd: Option<Vec<f64>>,
    /// Whether a simultaneous impact of several contacts occurred.
    rigid: bool,
    events: Vec<Event>,
}

impl After<'_> {
    fn see(&mut self, seen: &Seen) {
        self.rigid |= matches!(seen, Seen::Event(Event { kind: EventKind::Several { .. }, .. }));
        if let Seen::Event(event) = seen {
            self.events.push((*event).clone());
        }
        let Some((time, _)) = self.reference.impact.as_ref().filter(|_| self.qd.is_none()) else { return };
        match seen {
            Seen::Event(event) if !self.sim.stepping && ends_impact(event) => self.qd = Some(event.qd_plus.clone()),
            Seen::Moment(Moment { time: now, qd, .. }) if *now >= time + 1.01 * self.sim.contact_step => {
                self.qd = Some(qd.clone());
            }
            _ => {}
        }
    }
}

#[cfg(test)]
#[path = "../../tests/chart.rs"]
mod tests;

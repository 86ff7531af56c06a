//! Error against time: every method that can run a scene, each over its own knob.
//!
//! The yardstick is an event-driven run in space, as exact as the numbers allow, whose own error is seen from the
//! other integrator. Two errors are told: that of q̇ right after the first impact (what an impact law answers for), and that
//! of q and q̇ at the end (what a user sees). Times are medians of whole runs, without any recording.

mod kernel;
mod picture;

pub use picture::svg;

use carom_impact::Damping;
use carom_sim::{
    Compliance, Event, EventKind, Integrator, Moment, Sampling, Scene, Seen, SimError, Simulation, Trajectory, Yielding,
};
use std::time::{Duration, Instant};

/// One run of one method.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The method, with what tells it from others.
    pub method: String,
    /// The law of impact that it follows, in words.
    pub law: String,
    /// What the knob is called.
    pub knob: String,
    /// Its value.
    pub value: f64,
    /// Median time of the whole run, s.
    pub wall_time: f64,
    /// Error of q̇ right after the first impact, relative to its largest entry; `None` without one.
    pub after_impact: Option<f64>,
    /// Error of q and q̇ at the end, each relative to its largest entry, the larger of the two; `None` if it is not known.
    pub at_end: Option<f64>,
}

/// A knob's value for people: small whole numbers as they are, others by two digits and a power of ten.
pub fn knob_value(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1000.0 {
        return value.to_string();
    }
    let rounded = format!("{value:.1e}");
    rounded.replace(".0e", "e")
}

/// A method that could not run.
#[derive(Debug, Clone, PartialEq)]
pub struct Absent {
    /// The method.
    pub method: String,
    /// Why.
    pub reason: String,
}

/// What a peer's program says of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct PeerRun {
    /// The peer and what tells its methods apart.
    pub method: String,
    /// What the knob is called.
    pub knob: String,
    /// Its value.
    pub value: f64,
    /// Time of the whole run, s, and its states; or why there is none.
    pub outcome: Result<PeerOutcome, String>,
}

/// States of a peer's run, in the conventions of carom.
#[derive(Debug, Clone, PartialEq)]
pub struct PeerOutcome {
    /// Time of the whole run, s.
    pub wall_time: f64,
    /// q̇ right after the first impact.
    pub qd_after_impact: Option<Vec<f64>>,
    /// q and q̇ at the end.
    pub at_end: (Vec<f64>, Vec<f64>),
}

/// A scene's methods, side by side.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// All runs; those of one method stand together, in the order of its knob.
    pub runs: Vec<Run>,
    /// What could not run.
    pub absent: Vec<Absent>,
    /// The law of impact that the scene asks for, and the yardstick follows.
    pub law: String,
    /// The yardstick's own error after the first impact.
    pub doubt_after_impact: Option<f64>,
    /// The yardstick's own error at the end.
    pub doubt_at_end: f64,
    /// Methods of peers.
    peers: Vec<String>,
    reference: Reference,
}

/// The yardstick.
#[derive(Debug, Clone, PartialEq)]
struct Reference {
    impact: Option<(f64, Vec<f64>)>,
    end: (Vec<f64>, Vec<f64>),
}

impl Reference {
    fn of(run: &Trajectory) -> Self {
        let first = run.events.iter().find(|event| is_impact(event));
        let last = &run.summary.last;
        Self { impact: first.map(|it| (it.time, it.qd_plus.clone())), end: (last.q.clone(), last.qd.clone()) }
    }

    fn after_impact(&self, qd: &[f64]) -> Option<f64> {
        self.impact.as_ref().and_then(|(_, exact)| off(qd, exact))
    }

    fn at_end(&self, q: &[f64], qd: &[f64]) -> Option<f64> {
        Some(off(q, &self.end.0)?.max(off(qd, &self.end.1)?))
    }
}

fn is_impact(event: &Event) -> bool {
    matches!(event.kind, EventKind::Impact { .. } | EventKind::Several { .. } | EventKind::Limit { .. })
}

/// A contact that gives way has its impact behind it when it lifts off.
fn ends_impact(event: &Event) -> bool {
    is_impact(event) || matches!(event.kind, EventKind::LiftOff { .. })
}

/// Largest difference, relative to the largest entry; absolute where all is at rest. `None` if sizes differ.
fn off(found: &[f64], exact: &[f64]) -> Option<f64> {
    let size = exact.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let size = if size > 1e-9 { size } else { 1.0 };
    let differ = found.iter().zip(exact).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    (found.len() == exact.len() && differ.is_finite()).then_some(differ / size)
}

/// Tightest tolerance of the yardstick.
const TIGHT: f64 = 1e-13;
/// One measurement takes at least this long, or this many runs.
const MEASURE: Duration = Duration::from_millis(150);
const FEWEST: usize = 5;

impl Chart {
    /// Runs a scene by every method; `budget` is the longest a single run may take, `done` hears of each run.
    ///
    /// # Errors
    /// What the scene's own run is refused for.
    pub fn of(scene: &Scene, budget: Duration, done: &mut dyn FnMut(&str)) -> Result<Self, SimError> {
        // The tolerance alone is to choose the steps.
        let base = &Simulation { max_step: scene.duration, ..scene.simulation.clone() };
        let exact = |integrator, tolerance| Simulation { integrator, tolerance, planar: false, ..base.clone() };
        let run = |sim: &Simulation| sim.run(&scene.q, &scene.qd, scene.duration);
        let reference_run = run(&exact(Integrator::DormandPrince, TIGHT))?;
        let reference = Reference::of(&reference_run);
        // Another integrator shares no error but rounding.
        let other = Reference::of(&run(&exact(Integrator::Radau, 10.0 * TIGHT))?);
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
                let knob = |tolerance| Simulation { integrator, tolerance, planar, ..base.clone() };
                let method = (format!("events, {name}, {space}"), "the scene's".to_owned());
                chart.sweep((scene, budget), method, "tolerance", tolerances(), knob, done);
            }
        }
        let planar = spaces[0].0;
        let steps = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6];
        let knob = |contact_step| Simulation { stepping: true, contact_step, planar, ..base.clone() };
        let method = ("Moreau–Jean steps".to_owned(), "Newton's e with a friction cone".to_owned());
        chart.sweep((scene, budget), method, "step, s", steps, knob, done);
        let own = "its force's own";
        let forces = [
            ("Hunt–Crossley", own, Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact }),
            ("Kelvin–Voigt", own, Yielding::KelvinVoigt { pulls: false }),
            ("Walton–Braun", "its force's own, when stiff Stronge's", Yielding::WaltonBraun),
        ];
        for (name, law, normal) in forces {
            let stiffnesses = (3..=11).map(|k| 10_f64.powi(k));
            let knob = |stiffness| {
                let mut soft = Simulation { tolerance: 1e-10, planar, ..base.clone() };
                for touch in soft.touches.iter_mut().filter(|touch| touch.link().is_some()) {
                    touch.contact.compliance = Some(Compliance { normal, ..Compliance::new(stiffness) });
                }
                soft
            };
            let method = (format!("compliant, {name}"), law.to_owned());
            chart.sweep((scene, budget), method, "stiffness", stiffnesses, knob, done);
        }
        Ok(chart)
    }

    /// Adds peers' runs; those of other scenes are the caller's to leave out.
    pub fn add_peers(&mut self, peers: &[PeerRun]) {
        for PeerRun { method, knob, value, outcome } in peers {
            let absent = |reason: String| Absent { method: method.clone(), reason };
            match outcome {
                Err(reason) => self.absent.push(absent(format!("{knob} = {value}: {reason}"))),
                Ok(PeerOutcome { wall_time, qd_after_impact, at_end: (q, qd) }) => {
                    let at_end = self.reference.at_end(q, qd);
                    let after_impact = qd_after_impact.as_ref().and_then(|qd| self.reference.after_impact(qd));
                    if at_end.is_none() && after_impact.is_none() {
                        self.absent.push(absent("its states are not finite, or not those of this scene".into()));
                        continue;
                    }
                    let (method, knob, value) = (method.clone(), knob.clone(), *value);
                    self.peers.push(method.clone());
                    let law = "its own".to_owned();
                    self.runs.push(Run { method, law, knob, value, wall_time: *wall_time, after_impact, at_end });
                }
            }
        }
    }

    /// What is called an error here, in two lines for a reader.
    pub fn caption(&self) -> [String; 2] {
        let peers = if self.peers.is_empty() { "" } else { " Peers follow their own laws." };
        let first = format!("Error is the distance from the scene's law: {}.{peers}", self.law);
        let second = "One contact without friction is the same under every law; with friction another law's answer stays off, \
                      however fine its knob.";
        [first, second.to_owned()]
    }

    /// Whether a method is carom's.
    fn is_own(&self, method: &str) -> bool {
        !self.peers.iter().any(|peer| peer == method)
    }

    /// One method over its knob, until a run takes too long.
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
            let sim = simulation(value);
            match measure(scene, &sim, &self.reference, MEASURE.min(budget)) {
                Ok((wall_time, after_impact, at_end)) => {
                    let (method, law, knob) = (method.clone(), law.clone(), knob.to_owned());
                    self.runs.push(Run { method, law, knob, value, wall_time, after_impact, at_end });
                    if wall_time > budget.as_secs_f64() / 4.0 {
                        break; // the next one would take too long
                    }
                }
                Err(why) => refused = refused.or(Some(why)),
            }
            done(&method);
        }
        if let Some(reason) = refused.filter(|_| self.runs.len() == before) {
            self.absent.push(Absent { method, reason });
        }
    }
}

/// The laws of a simulation's contacts, in words.
fn law_of(sim: &Simulation) -> String {
    let contacts = sim.touches.iter().filter(|touch| touch.link().is_some());
    let mut laws: Vec<String> = Vec::new();
    for contact in contacts.map(|touch| &touch.contact) {
        let law = match (contact.compliance.is_some(), contact.friction) {
            (true, _) => "of contacts that give way".to_owned(),
            (false, 0.0) => format!("{}, no friction", contact.law),
            (false, mu) => format!("{}, friction {mu}", contact.law),
        };
        if !laws.contains(&law) {
            laws.push(law);
        }
    }
    if laws.is_empty() { "no contact".to_owned() } else { laws.join("; ") }
}

/// All runs as CSV, one line each.
pub fn csv(chart: &Chart) -> String {
    let mut lines = csv::Writer::from_writer(Vec::new());
    let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
    let head =
        ["method", "knob", "value", "wall_time_s", "error_after_impact", "error_at_end", "law"].map(String::from);
    let rows = chart.runs.iter().map(|run| {
        let [value, time] = [run.value, run.wall_time].map(|x| format!("{x:e}"));
        let [after, end] = [run.after_impact, run.at_end].map(number);
        [run.method.clone(), run.knob.clone(), value, time, after, end, run.law.clone()]
    });
    for row in std::iter::once(head).chain(rows) {
        // A vector takes everything.
        let _ = lines.write_record(row);
    }
    lines.into_inner().map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default()
}

/// Time and errors of one run.
fn measure(
    scene: &Scene,
    sim: &Simulation,
    reference: &Reference,
    long: Duration,
) -> Result<(f64, Option<f64>, Option<f64>), String> {
    let bare = Sampling { every: None, dense: false };
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

    let soft = sim.touches.iter().any(|touch| touch.contact.compliance.is_some());
    let mut watch = After { reference, sim, qd: None, rigid: false };
    let sampling = Sampling { every: sim.stepping.then_some(sim.contact_step), dense: false };
    let summary = sim
        .stream(&scene.q, &scene.qd, scene.duration, sampling, &mut |seen| watch.see(&seen))
        .map_err(|e| e.to_string())?;
    if soft && (watch.rigid || summary.statistics.contact_steps > 0) {
        return Err("several contacts at once are rigid, whatever the stiffness".to_owned());
    }
    let after_impact = watch.qd.as_ref().and_then(|qd| reference.after_impact(qd));
    Ok((times[times.len() / 2], after_impact, reference.at_end(&summary.last.q, &summary.last.qd)))
}

/// Looks out for q̇ right after the first impact: of an event, what follows it; of a contact that gives way, its end; of time
/// steps, the state after the step that the impact falls in, and the one more that carries it out.
struct After<'a> {
    reference: &'a Reference,
    sim: &'a Simulation,
    qd: Option<Vec<f64>>,
    /// Whether several contacts were hit at once.
    rigid: bool,
}

impl After<'_> {
    fn see(&mut self, seen: &Seen) {
        self.rigid |= matches!(seen, Seen::Event(Event { kind: EventKind::Several { .. }, .. }));
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

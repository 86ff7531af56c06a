//! A scene of a census: robots and scene as texts, its run under a watchdog, and the energy of its answers by an own computation.

use carom_sim::{EnergyBooks, EventKind, Plan, Sampling, Scene, Seen, Simulation, Statistics, StepReason};
use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, panic_any, set_hook, take_hook};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Once, mpsc};
use std::time::{Duration, Instant};

/// A scene and the files that it names.
#[derive(Clone, Default)]
pub struct Case {
    pub files: Vec<(String, String)>,
    pub scene: String,
    /// Instead of these: a scene file.
    pub path: Option<PathBuf>,
    /// By time steps throughout, whatever the file says.
    pub steps: bool,
}

/// What became of a case.
pub enum End {
    Done(Box<Answer>),
    /// By whom, and why.
    Refused(&'static str, String),
    Panicked(String),
    /// Not finished within the limit, s.
    Overdue,
}

/// An event, without the impulses.
pub struct Happened {
    pub time: f64,
    pub kind: EventKind,
    pub q: Vec<f64>,
    pub qd: [Vec<f64>; 2],
}

/// The answers of a run, and what was computed from them.
pub struct Answer {
    pub scene: Scene,
    pub plan: Plan,
    /// (time, q, qd) at equal intervals.
    pub samples: Vec<(f64, Vec<f64>, Vec<f64>)>,
    /// The first [`KEPT`] events.
    pub events: Vec<Happened>,
    pub reasons: Vec<StepReason>,
    /// Whether impacts were summed in closed form, which takes the time of their flights.
    pub summed: bool,
    pub summary: carom_sim::Summary,
    /// Kinetic plus potential energy by an own computation, without that of compliant contacts: at the start, at the end, and the least and the largest in between.
    pub energy: [f64; 4],
    /// The largest kinetic energy.
    pub kinetic: f64,
    /// Kinetic energies lost in events by an own computation: their sum, and the sum of those lost (negative: gained) in events
    /// that are flagged `energy-gain`.
    pub lost: [f64; 2],
}

const KEPT: usize = 2000;

struct Late;

thread_local! {
    static LAST_PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Messages of panics under a watchdog are answers, not output.
fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |info| match std::thread::current().name() {
            Some("census") => LAST_PANIC.with(|last| *last.borrow_mut() = info.to_string()),
            _ => usual(info),
        }));
    });
}

/// Seconds of computation of this thread where the system tells them, or else of the clock: a busy machine makes no scene overdue.
fn spent(clock: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| clock.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// How much longer than its limit a run may take by the clock.
const BUSY: f64 = 5.0;
/// How much longer a run may take that is compiled for tests than one that is compiled for use.
const UNOPTIMISED: f64 = if cfg!(debug_assertions) { 4.0 } else { 1.0 };

/// Computes something in a thread of its own; `None` if it takes longer than this, s. The thread is then left behind.
pub fn watched<T: Send + 'static>(limit: f64, work: impl FnOnce() -> T + Send + 'static) -> Option<Result<T, String>> {
    quiet();
    let (send, receive) = mpsc::channel();
    let body = move || {
        let done = catch_unwind(AssertUnwindSafe(work)).map_err(|payload: Box<dyn Any + Send>| {
            if payload.is::<Late>() { None } else { Some(LAST_PANIC.with(|last| last.borrow().clone())) }
        });
        // The receiver may have given up.
        let _ = send.send(done);
    };
    std::thread::Builder::new().name("census".into()).stack_size(1 << 25).spawn(body).expect("a thread");
    match receive.recv_timeout(Duration::from_secs_f64(limit)) {
        Ok(Ok(done)) => Some(Ok(done)),
        Ok(Err(Some(panicked))) => Some(Err(panicked)),
        Ok(Err(None)) | Err(_) => None,
    }
}

impl Case {
    /// Writes the files and the scene `s.toml` into a folder.
    pub fn write(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join("s.toml"), &self.scene)?;
        self.files.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
    }

    pub fn load(&self) -> Result<Scene, String> {
        if let Some(path) = &self.path {
            let mut scene = Scene::from_file(path).map_err(|e| e.to_string())?;
            scene.simulation.stepping |= self.steps;
            return Ok(scene);
        }
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder: PathBuf = std::env::temp_dir().join(format!("carom-census-{}-{number}", std::process::id()));
        self.write(&folder).map_err(|e| e.to_string())?;
        let scene = Scene::from_toml(&self.scene, &folder).map_err(|e| e.to_string());
        // What stays behind in the folder for temporary files does no harm.
        let _ = std::fs::remove_dir_all(&folder);
        scene
    }

    /// Runs as `carom simulate` does, with samples at this interval; overdue after `limit` seconds of computation.
    pub fn run(&self, every: Option<f64>, limit: f64) -> End {
        self.run_as(every, limit, |_| {})
    }

    /// As [`Case::run`], after a change of the scene.
    pub fn run_as(&self, every: Option<f64>, limit: f64, change: impl FnOnce(&mut Scene) + Send + 'static) -> End {
        let limit = UNOPTIMISED * limit;
        let case = self.clone();
        let work = move || -> Result<Answer, (&'static str, String)> {
            let mut scene = case.load().map_err(|why| ("scene", why))?;
            change(&mut scene);
            Answer::of(scene, every, limit)
        };
        // A call between two answers may take its time too.
        match watched(BUSY * limit, work) {
            None => End::Overdue,
            Some(Err(panicked)) => End::Panicked(panicked),
            Some(Ok(Err((by, why)))) => End::Refused(by, why),
            Some(Ok(Ok(answer))) => End::Done(Box::new(answer)),
        }
    }
}

impl Answer {
    pub fn of(scene: Scene, every: Option<f64>, limit: f64) -> Result<Self, (&'static str, String)> {
        let plan = scene.plan().map_err(|e| ("plan", e.to_string()))?;
        let clock = Instant::now();
        let mut own = Own::new(&scene, &plan);
        let (mut samples, mut events, mut reasons) = (Vec::new(), Vec::new(), Vec::new());
        let mut seen_so_far = 0_usize;
        let (mut open, mut summed) = (None::<(f64, f64)>, false);
        let (mut lost, mut range, mut most) = ([0.0, 0.0], [f64::INFINITY, f64::NEG_INFINITY], 0.0_f64);
        let sampling = Sampling { every, dense: true, ..Sampling::default() };
        let summary = plan.stream(scene.duration, sampling, &mut |seen| {
            seen_so_far += 1;
            // Asking for the time costs as much as a step.
            if seen_so_far.is_multiple_of(16) && spent(clock) > limit {
                panic_any(Late);
            }
            let (q, qd) = match seen {
                Seen::Moment(moment) => {
                    samples.push((moment.time, moment.q.clone(), moment.qd.clone()));
                    (moment.q.clone(), moment.qd.clone())
                }
                Seen::Event(event) => {
                    let [before, after] = [&event.qd_minus, &event.qd_plus].map(|qd| own.kinetic(&event.q, qd));
                    let loss = before - after;
                    // Events of one time tell of the same jump: what an impact loses, and the mode that begins with it.
                    lost[0] += match &mut open {
                        Some((time, last)) if *time == event.time => std::mem::replace(last, after) - after,
                        _ => {
                            open = Some((event.time, after));
                            loss
                        }
                    };
                    let flagged = match &event.kind {
                        EventKind::Impact { hit, .. } => hit.flags,
                        EventKind::Several { flags, .. } => *flags,
                        _ => carom_impact::Flags::NONE,
                    };
                    if flagged.contains(carom_impact::Flags::ENERGY_GAIN) {
                        lost[1] += loss;
                    }
                    summed |= matches!(event.kind, EventKind::Zeno { .. });
                    if let EventKind::Steps { reason } = event.kind {
                        reasons.push(reason);
                    }
                    if events.len() < KEPT {
                        let qd = [event.qd_minus.clone(), event.qd_plus.clone()];
                        let (time, kind, q) = (event.time, event.kind.clone(), event.q.clone());
                        events.push(Happened { time, kind, q, qd });
                    }
                    (event.q.clone(), event.qd_plus.clone())
                }
                Seen::Segment(segment) => {
                    let last = segment.states.last().expect("a segment has states");
                    let (q, qd) = last.split_at(own.nq());
                    (q.to_vec(), qd.to_vec())
                }
                Seen::Contacts(..) | Seen::Motors(..) => return,
            };
            let kinetic = own.kinetic(&q, &qd);
            let now = kinetic + own.potential(&q);
            range = [range[0].min(now), range[1].max(now)];
            most = most.max(kinetic);
        });
        let summary = summary.map_err(|e| ("run", e.to_string()))?;
        let start = own.kinetic(&plan.q, &plan.qd) + own.potential(&plan.q);
        let end = own.kinetic(&summary.last.q, &summary.last.qd) + own.potential(&summary.last.q);
        let energy = [start, end, range[0].min(start), range[1].max(start)];
        Ok(Self { scene, plan, samples, events, reasons, summed, summary, energy, kinetic: most, lost })
    }

    /// The energy that a run moves: the largest kinetic energy, the range of all energies, the work of motors.
    pub fn scale(&self) -> f64 {
        let books = self.books();
        let range = self.energy[3] - self.energy[2];
        self.kinetic.max(range).max(books.drive.abs()).max(1e-6)
    }

    pub fn books(&self) -> EnergyBooks {
        self.summary.energy
    }

    pub fn statistics(&self) -> Statistics {
        self.summary.statistics
    }

    /// Whether all numbers of the answer are finite.
    pub fn finite(&self) -> bool {
        let last = &self.summary.last;
        let books = self.books();
        let energies = [books.start, books.end, books.drive, books.resistance, books.impacts];
        last.q.iter().chain(&last.qd).chain(&energies).all(|x| x.is_finite())
    }

    /// Whether something outside moves the scene: surfaces with a motion, or forces.
    pub fn driven(&self) -> bool {
        self.scene.surfaces.iter().any(|surface| surface.motion.is_some())
    }
}

/// Energies by ½ q̇ᵀ M q̇, the heights of the masses and the springs.
pub struct Own {
    sim: Simulation,
    workspace: carom_chain::Workspace<carom_chain::Spatial<f64>>,
}

impl Own {
    /// Of all joints of the scene, or of those that the plan keeps, whichever the answers have.
    pub fn new(scene: &Scene, plan: &Plan) -> Self {
        let whole = plan.q.len() == scene.q.len();
        let sim = if whole { scene.simulation.clone() } else { plan.simulation.clone() };
        let workspace = sim.chain.workspace();
        Self { sim, workspace }
    }

    pub fn nq(&self) -> usize {
        self.sim.chain.nq()
    }

    pub fn kinetic(&mut self, q: &[f64], qd: &[f64]) -> f64 {
        let Ok(mut kin) = self.workspace.update(&self.sim.chain, q) else { return f64::NAN };
        let m = kin.mass_matrix();
        let qd = nalgebra::DVector::from_column_slice(qd);
        0.5 * qd.dot(&(m * &qd))
    }

    pub fn potential(&mut self, q: &[f64]) -> f64 {
        let gravity = self.sim.gravity;
        let Ok(kin) = self.workspace.update(&self.sim.chain, q) else { return f64::NAN };
        let springs = self.sim.springs.iter().map(|spring| {
            let joint = self.sim.chain.joint(&spring.joint).ok();
            let at = joint.and_then(|joint| self.sim.chain.coordinate_of(joint));
            let of = |at: carom_chain::JointCoordinate| at.multiplier * q[at.q] + at.offset - spring.rest;
            at.map_or(0.0, |at| 0.5 * spring.stiffness * of(at).powi(2))
        });
        kin.potential_energy(gravity) + springs.sum::<f64>()
    }
}

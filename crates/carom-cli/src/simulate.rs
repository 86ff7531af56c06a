//! `carom simulate`: simulation of a scene.

use crate::error::CliError;
use crate::files;
use crate::from_state;
use crate::output::{answer, say, short};
use crate::plan::moving_joints;
use crate::record::{Record, Recorder};
use crate::runs;
use crate::scene::load;
use crate::sensitivity::{self, Sensitivity};
use carom_chain::Chain;
use carom_sim::{ContactState, Event, EventKind, Moment, Plan, Sampling, Seen, Simulation};
use carom_study::{SCENE_KEY, Table, TableError, contact_columns, contact_row, state_columns};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Sampling interval of tables and recordings if the scene names none, s: that of the paper.
const SAMPLE: f64 = 0.004;

/// Simulate a scene: motion, impacts, sliding and sticking contact of a robot
///
/// Input: a scene (TOML) that names the robot and its start, the surfaces, the contact law with its
/// coefficients, the controller and the duration.
/// Output: the events in order of time (impact, limit, mode changes, lift-off, rest …), each with
/// its time (s), the contact and, for an impact, u⁻, u⁺ (m/s) in world axes, the size of the impulse
/// (N s) and the mode; the final q and qd; the energy balance (J); the work of the integrator.
/// JSON keys:
///   joints, stop_reason (duration, events), mode (of contact at the end);
///   events [{time, kind, contact, contacts (of several), reason, flags, q, qd_minus, qd_plus, impact,
///     impulses}];
///   final {time, q, qd, contacts [{contact, mode, point, normal, gap, force, normal_force, flags}]};
///   energy {start, end, drive, resistance, lost_in_impacts, error}, where
///     end = start + drive + resistance − lost_in_impacts + error;
///   statistics {steps, rejections, evaluations, refinements, contact_steps, step_error (rad or m),
///     worst_residual, energy_gained (J), non_unique_time (s), neglected_frictions, neglected_bound,
///     neglected_depth}.
/// JSON keys with --sensitivity: sensitivity {names (of the columns: q and qd of the start by joint,
///   then parameters); final [{of, by}], a row for each number of the final state; events [{time,
///   kinds, time_by}]; broken {time, reason} instead of final where the derivatives end}.
/// JSON keys with --runs: runs, refused, first_refusal; impacts, first_impact, lost_in_impacts, each
///   {count, mean, deviation (of the sample), least, most} over the runs.
/// If the run fails or is interrupted, nothing is printed, and no table and no recording is written.
/// An interruption of --runs ends them early: the answer and the table, under the name X.partial.csv
/// or X.partial.parquet, are those of the runs so far, and the exit status is 1.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct Simulate {
    /// Scene (TOML file)
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Write the motion as a CSV table: time (s), q, qd
    ///
    /// Sampled at the interval `[run] sample` of the scene, or every 0.004 s. Columns: time,
    /// q.<joint> (rad, m), qd.<joint> (rad/s, m/s); a joint with several coordinates has numbered
    /// columns.
    #[arg(long, value_name = "X.csv", verbatim_doc_comment)]
    csv: Option<PathBuf>,
    /// Write the same table as Parquet
    #[arg(long, value_name = "X.parquet")]
    parquet: Option<PathBuf>,
    /// Write the lasting contacts as a table (X.csv or X.parquet): a row for each contact at each sample
    ///
    /// Columns: time (s), contact (its name), mode (sliding, sticking, latched, pressing, stepping), point
    /// x, y, z (m) and unit normal nx, ny, nz from the environment to the robot in world axes, gap (m; rad),
    /// force on the robot fx, fy, fz (N, world axes) and its normal component (N; N m at a joint limit, where
    /// the vectors are zero), flags (non-unique: the motion depends on how forces are distributed).
    #[arg(long, value_name = "X.csv|X.parquet", verbatim_doc_comment)]
    contacts: Option<PathBuf>,
    /// Start from this state instead of that of the scene
    ///
    /// A JSON file: {"q": […], "qd": […]} and, if wanted, "time" (s), at which tables and moving
    /// surfaces begin; or the answer of `carom simulate --json`, whose `final` state and time are
    /// taken. The duration counts from there. Past impacts, after which `after_impact` acts,
    /// and what compliant contacts remember are not part of a state.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    from_state: Option<PathBuf>,
    /// Run N times from starts that `[run] perturb` disturbs; the table has a row for each run
    ///
    /// Columns of --csv or --parquet: run (0: the start itself), outcome (duration, events,
    /// refused), impacts, first_impact (s), events; start.q.<joint>, start.qd.<joint>; end.time,
    /// end.q.<joint>, end.qd.<joint>; energy_start, energy_end, lost_in_impacts, energy_error (J).
    /// The runs use all processors; the table does not depend on their number.
    #[arg(
        long,
        value_name = "N",
        verbatim_doc_comment,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    runs: Option<u64>,
    /// Differentiate the final state and the times of the events by the start and by parameters
    ///
    /// Exact to about 1e-8 of their size. The parameters: restitution and friction of all
    /// contacts together; of the controller kp, kd, target or torque of each joint. A change
    /// of q is a displacement: of a floating joint along and about the axes of its link.
    /// Where the outcome is not differentiable, the time and the reason are given.
    #[arg(long, verbatim_doc_comment, conflicts_with = "runs")]
    sensitivity: bool,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Summary<'a> {
    joints: Vec<&'a str>,
    stop_reason: &'static str,
    mode: &'static str,
    events: Vec<Happened<'a>>,
    r#final: Last<'a>,
    energy: Energy,
    statistics: Cost,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensitivity: Option<Sensitivity>,
}

#[derive(Serialize)]
struct Happened<'a> {
    time: f64,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    contact: Option<&'a str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    contacts: Vec<&'a str>,
    q: &'a [f64],
    qd_minus: &'a [f64],
    qd_plus: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'static str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    flags: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    impact: Option<Impact>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    impulses: Vec<Push<'a>>,
}

/// One impulse on the robot.
#[derive(Serialize)]
struct Push<'a> {
    contact: &'a str,
    point: [f64; 3],
    impulse: [f64; 3],
}

#[derive(Serialize)]
struct Impact {
    law: &'static str,
    impulse: [f64; 3],
    u_minus: [f64; 3],
    u_plus: [f64; 3],
    energy_before: f64,
    energy_after: f64,
    mode: &'static str,
    normal_work: f64,
    friction_work: f64,
    flags: Vec<&'static str>,
}

#[derive(Serialize)]
struct Last<'a> {
    time: f64,
    q: &'a [f64],
    qd: &'a [f64],
    contacts: Vec<Lasting<'a>>,
}

/// A lasting contact.
#[derive(Serialize)]
struct Lasting<'a> {
    contact: &'a str,
    mode: &'static str,
    point: [f64; 3],
    normal: [f64; 3],
    gap: f64,
    force: [f64; 3],
    normal_force: f64,
    flags: Vec<&'static str>,
}

#[derive(Serialize)]
struct Energy {
    start: f64,
    end: f64,
    drive: f64,
    resistance: f64,
    lost_in_impacts: f64,
    error: f64,
}

#[derive(Serialize)]
struct Cost {
    steps: usize,
    rejections: usize,
    evaluations: usize,
    refinements: usize,
    contact_steps: usize,
    step_error: f64,
    worst_residual: f64,
    energy_gained: f64,
    non_unique_time: f64,
    neglected_frictions: usize,
    neglected_bound: f64,
    neglected_depth: f64,
}

impl Simulate {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let refuse = |e| CliError::scene(&self.scene, e);
        self.record.check()?;
        let mut scene = load(&self.scene)?;
        if let Some(file) = &self.from_state {
            from_state::apply(file, &mut scene)?;
            scene.files.push(file.clone());
        }
        let (csv, parquet) = (self.csv.as_deref(), self.parquet.as_deref());
        files::check(
            &scene.files,
            &[
                ("--csv", csv),
                ("--parquet", parquet),
                ("--contacts", self.contacts.as_deref()),
                ("--out", self.record.file()),
            ],
        )?;
        if let Some(runs) = self.runs {
            if self.contacts.is_some() || self.record.is_asked() || (csv.is_some() && parquet.is_some()) {
                let why = "--runs: write one table, with --csv or --parquet, without --contacts and recordings";
                return Err(CliError::Option(why.into()));
            }
            let stop = files::interrupts();
            let plan = scene.plan().map_err(refuse)?;
            return runs::run((&self.scene, &scene, &plan), (runs, &stop), csv.or(parquet), self.json, out);
        }
        files::clear_when_interrupted();
        let plan = scene.plan().map_err(refuse)?;
        if self.sensitivity {
            sensitivity::check(&self.scene, &plan)?;
        }
        let sim = &plan.simulation;
        let mut tables = Tables::begin([csv, parquet], &sim.chain, &scene.text)?;
        let mut contacts = ContactTable::begin(self.contacts.as_deref(), sim, &scene.text)?;
        let mut recorder = Recorder::begin(&self.record, &scene, &plan)?;
        let sampled = !tables.tables.is_empty() || contacts.table.is_some() || recorder.is_some();
        let every = sampled.then(|| scene.sample.unwrap_or(SAMPLE));
        let mut events = Vec::new();
        let sampling = Sampling { every, dense: false };
        let run = plan.stream(scene.duration, sampling, &mut |seen| {
            match &seen {
                Seen::Moment(moment) => tables.row(moment),
                Seen::Event(event) => events.push((*event).clone()),
                Seen::Contacts(time, states) => contacts.rows(*time, states),
                Seen::Segment(_) => {}
            }
            if let Some(recorder) = &mut recorder {
                recorder.see(seen);
            }
        });
        let run = run.map_err(refuse)?;
        for warning in run.warnings() {
            say(&format!("warning: {}: {warning}", self.scene.display()));
        }
        let derivatives = self.sensitivity.then(|| Sensitivity::of(&plan, scene.duration));
        let derivatives = derivatives.transpose().map_err(refuse)?;
        tables.finish()?;
        contacts.finish()?;
        if let Some(recorder) = recorder {
            recorder.finish(&run)?;
        }
        let summary = Summary { sensitivity: derivatives, ..summary(&plan, &events, &run) };
        let written = answer(out, &summary, self.json, |summary, out| {
            for_people(sim, &events, &run, out)?;
            summary.sensitivity.as_ref().map_or(Ok(()), |derivatives| derivatives.for_people(out))
        });
        written.map_err(|refused| CliError::refused(&self.scene, refused))
    }
}

fn lasting<'a>(sim: &'a Simulation, state: &ContactState) -> Lasting<'a> {
    Lasting {
        contact: &sim.touches[state.touch].name,
        mode: state.mode.name(),
        point: state.point.into(),
        normal: state.normal.into(),
        gap: state.gap,
        force: state.force.into(),
        normal_force: state.normal_force,
        flags: state.flags.names().collect(),
    }
}

fn summary<'a>(plan: &'a Plan, events: &'a [Event], run: &'a carom_sim::Summary) -> Summary<'a> {
    let sim = &plan.simulation;
    let happened = |e: &'a Event| Happened {
        time: e.time,
        kind: e.kind.name(),
        contact: contact(sim, &e.kind),
        contacts: several(&e.kind).iter().map(|touch| sim.touches[*touch].name.as_str()).collect(),
        q: &e.q,
        qd_minus: &e.qd_minus,
        qd_plus: &e.qd_plus,
        reason: reason(&e.kind),
        flags: match &e.kind {
            EventKind::Several { flags, .. } => flags.names().collect(),
            _ => Vec::new(),
        },
        impact: match &e.kind {
            EventKind::Impact { touch, hit } => Some(Impact {
                law: sim.touches[*touch].contact.law.name(),
                impulse: hit.impulse.into(),
                u_minus: hit.u_minus.into(),
                u_plus: hit.u_plus.into(),
                energy_before: hit.energy_before,
                energy_after: hit.energy_after,
                mode: hit.mode.name(),
                normal_work: hit.contact.normal_work,
                friction_work: hit.contact.friction_work,
                flags: hit.flags.names().collect(),
            }),
            _ => None,
        },
        impulses: e
            .impulses
            .iter()
            .map(|one| Push {
                contact: &sim.touches[one.touch].name,
                point: one.point.into(),
                impulse: one.impulse.into(),
            })
            .collect(),
    };
    let energy = run.energy;
    let s = run.statistics;
    Summary {
        joints: moving_joints(plan),
        stop_reason: run.stop.name(),
        mode: run.mode.name(),
        events: events.iter().map(happened).collect(),
        r#final: Last {
            time: run.last.time,
            q: &run.last.q,
            qd: &run.last.qd,
            contacts: run.contacts.iter().map(|state| lasting(sim, state)).collect(),
        },
        energy: Energy {
            start: energy.start,
            end: energy.end,
            drive: energy.drive,
            resistance: energy.resistance,
            lost_in_impacts: energy.impacts,
            error: energy.error(),
        },
        statistics: Cost {
            steps: s.steps,
            rejections: s.rejections,
            evaluations: s.evaluations,
            refinements: s.refinements,
            contact_steps: s.contact_steps,
            step_error: s.step_error,
            worst_residual: s.worst_residual,
            energy_gained: s.energy_gained,
            non_unique_time: s.non_unique_time,
            neglected_frictions: s.neglected,
            neglected_bound: s.neglected_bound,
            neglected_depth: s.neglected_depth,
        },
        sensitivity: None,
    }
}

fn contact<'a>(sim: &'a Simulation, kind: &'a EventKind) -> Option<&'a str> {
    match kind {
        EventKind::Limit { joint, .. } | EventKind::Joint { joint, .. } => Some(joint),
        other => other.touch().map(|touch| sim.touches[touch].name.as_str()),
    }
}

/// The contacts of an event of several.
fn several(kind: &EventKind) -> &[usize] {
    match kind {
        EventKind::Several { touches, .. } | EventKind::NonUnique { touches, .. } => touches,
        _ => &[],
    }
}

/// Why time steps begin, or why the motion is not unique.
fn reason(kind: &EventKind) -> Option<&'static str> {
    match kind {
        EventKind::NonUnique { reason, .. } => Some(reason.name()),
        EventKind::Steps { reason } => Some(reason.name()),
        _ => None,
    }
}

/// Number of contacts of one event that are listed for people; `--json` has all.
const LISTED: usize = 8;

fn for_people(sim: &Simulation, events: &[Event], run: &carom_sim::Summary, out: &mut dyn Write) -> io::Result<()> {
    for event in events {
        let what = contact(sim, &event.kind).or(reason(&event.kind)).unwrap_or("");
        let mut line = format!("{:>14} s  {:10} {what}", short(event.time), event.kind.name());
        let touches = several(&event.kind);
        if !touches.is_empty() {
            let names: Vec<&str> = touches.iter().map(|&touch| sim.touches[touch].name.as_str()).collect();
            if reason(&event.kind).is_some() {
                line += ": ";
            }
            let listed = if names.len() > LISTED + 1 { LISTED } else { names.len() };
            line += &names[..listed].join(", ");
            if names.len() > listed {
                line += &format!(" and {} more", names.len() - listed);
            }
        }
        if let EventKind::Several { flags, .. } = &event.kind
            && !flags.is_empty()
        {
            line += &format!(": {flags}");
        }
        if let EventKind::Impact { hit, .. } = &event.kind {
            let [u_minus, u_plus] =
                [hit.u_minus, hit.u_plus].map(|u| u.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" "));
            let impulse = short(hit.impulse.norm());
            line += &format!(": u⁻ ({u_minus}), u⁺ ({u_plus}) m/s, impulse {impulse} N s, {}", hit.mode);
        }
        writeln!(out, "{line}")?;
    }
    let last = &run.last;
    writeln!(out, "{:>14} s  end ({}), {}", short(last.time), run.stop.name(), run.mode.name())?;
    let numbers = |x: &[f64]| x.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ");
    writeln!(out, "q  {}", numbers(&last.q))?;
    writeln!(out, "qd {}", numbers(&last.qd))?;
    let (e, s) = (run.energy, run.statistics);
    writeln!(
        out,
        "energy {} J at the start, {} J at the end: {} J lost in impacts, {} J from the drive, {} J of damping, friction and \
         lasting contacts",
        short(e.start),
        short(e.end),
        short(e.impacts),
        short(e.drive),
        short(e.resistance)
    )?;
    writeln!(
        out,
        "{} events, {} steps, {} rejected, {} evaluations, {} steps with several contacts",
        run.events, s.steps, s.rejections, s.evaluations, s.contact_steps
    )?;
    if s.step_error > 0.0 {
        writeln!(
            out,
            "estimated error of the positions in the steps with several contacts: {} rad or m",
            short(s.step_error)
        )?;
    }
    if s.non_unique_time > 0.0 {
        writeln!(out, "the motion is not unique for {} s: see the events", short(s.non_unique_time))?;
    }
    if s.neglected > 0 {
        let bound = short(s.neglected_bound);
        writeln!(
            out,
            "friction left out of {} impacts: velocity error of the contact point at most {bound} of its speed before the impact",
            s.neglected
        )?;
    }
    Ok(())
}

/// The tables that are being written; keeps the first error.
struct Tables {
    tables: Vec<Table>,
    failed: Option<TableError>,
}

impl Tables {
    fn begin(paths: [Option<&Path>; 2], chain: &Chain, scene: &str) -> Result<Self, CliError> {
        let columns = state_columns(chain);
        let tables = paths.into_iter().flatten().map(|path| Table::create_with(path, &columns));
        let mut tables = tables.collect::<Result<Vec<_>, _>>()?;
        tables.iter_mut().for_each(|table| table.describe(SCENE_KEY, scene));
        Ok(Self { tables, failed: None })
    }

    fn row(&mut self, moment: &Moment) {
        let numbers: Vec<f64> = std::iter::once(moment.time).chain(moment.q.clone()).chain(moment.qd.clone()).collect();
        for table in &mut self.tables {
            if self.failed.is_none() {
                self.failed = table.row(&numbers).err();
            }
        }
    }

    fn finish(self) -> Result<(), CliError> {
        if let Some(error) = self.failed {
            return Err(error.into());
        }
        Ok(self.tables.into_iter().try_for_each(Table::finish)?)
    }
}

/// The table of lasting contacts.
struct ContactTable {
    table: Option<Table>,
    failed: Option<TableError>,
}

impl ContactTable {
    fn begin(path: Option<&Path>, sim: &Simulation, scene: &str) -> Result<Self, CliError> {
        let mut table = path.map(|path| Table::create_with(path, &contact_columns(sim))).transpose()?;
        table.iter_mut().for_each(|table| table.describe(SCENE_KEY, scene));
        Ok(Self { table, failed: None })
    }

    fn rows(&mut self, time: f64, states: &[ContactState]) {
        let Some(table) = &mut self.table else { return };
        for state in states {
            if self.failed.is_none() {
                self.failed = table.row(&contact_row(time, state)).err();
            }
        }
    }

    fn finish(self) -> Result<(), CliError> {
        if let Some(error) = self.failed {
            return Err(error.into());
        }
        Ok(self.table.map_or(Ok(()), Table::finish)?)
    }
}

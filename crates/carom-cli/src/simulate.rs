//! `carom simulate`: simulation of a scene.

use crate::error::CliError;
use crate::files::{self, Kind, Outputs};
use crate::from_state;
use crate::impact::loads_for_people;
use crate::output::{Printed, answer_about, short, warn};
use crate::record::{Record, begin_recording};
use crate::rows::RowOptions;
use crate::run_error;
use crate::runs;
use crate::scene::load;
use crate::sensitivity::{self, Sensitivity};
use carom_impact::Mode;
use carom_sim::{
    EventLoads, Met, Moment, NamedEvent, NamedRun, RunError, Sampling, Scene, Seen, Statistics, Summary, ToAccuracy,
    UnderLaw,
};
use carom_study::{
    Column, SCENE_KEY, Table, TableError, contact_columns, contact_row, error_columns, error_row, event_table,
    load_columns, load_rows, motor_columns, state_columns,
};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Simulate a scene: motion, impacts, sliding and sticking contact of a robot
///
/// Input: a scene (TOML) that names the robot and its start, the surfaces, the contact law with its
/// coefficients, the controller and the duration.
/// Output: the events in order of time (impact, limit, mode changes, lift-off, rest …), each with
/// its time (s), the contact and, for an impact, u⁻, u⁺ (m/s) in world axes, the size of the impulse
/// (N s) and the slip at its end (no slip, slip, reverse-slip; in JSON the mode); for an impact at
/// several contacts the size of each impulse, and qd before and after it; the final q and qd; the
/// energy balance (J); the work of the integrator. Events of one kind and time are one row.
/// JSON keys:
///   joints, stop_reason (duration, events), mode (of contact at the end);
///   events [{time, kind, contact, contacts (of several), reason, flags, q, qd_minus, qd_plus, impact,
///     impulses, loads {joint_impulse, bearings, motors_minus, motors_plus}: --loads}];
///   final {time, q, qd, contacts [{contact, mode, point, normal, gap, force, normal_force, flags}]};
///   energy {start, end, drive, resistance, lost_in_impacts, error}, where
///     end = start + drive + resistance − lost_in_impacts + error;
///   statistics {the numbers listed at the end};
///   accuracy {asked, tolerance, max_step, zeno_time, error, evaluations} of a scene with [run] accuracy.
/// JSON keys with --error: error {tighter (tolerances of the runs that tell it), final {q, qd}, or
///   unknown {time, reason} instead of it}; of each event time_error, unless it has none.
/// JSON keys with --sensitivity: sensitivity {names (of the columns: q and qd of the start by joint,
///   then parameters); final [{of, by}], a row for each number of the final state; events [{time,
///   kinds, time_by}]; broken {time, reason} instead of final where the derivatives end}.
/// JSON keys with --runs: runs, refused, first_refusal, other_events; impacts, first_impact,
///   lost_in_impacts, each {count, mean, deviation (of the sample), least, most} over the runs;
///   resumed (rows of the table that --resume took over, not among runs); with --covariance
///   covariance {names, sampled (rows), linear (rows), event_times [{kinds, time, deviation}], broken}.
/// If the run fails or is interrupted, nothing is printed, and no table and no recording is written.
/// An interruption of --runs, or a full disk, keeps the rows that are done in X.partial.csv or
/// X.partial.parquet, with a note X.partial.csv.json or X.partial.parquet.json; the exit status is 1,
/// and --resume continues. Without a table the answer is that of the runs so far.
#[derive(Args)]
#[command(verbatim_doc_comment, after_long_help = statistics())]
pub struct Simulate {
    /// Scene (TOML file)
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Write the motion as a table (.csv, .parquet) or a recording (.rrd); may be repeated
    ///
    /// Sampled at the interval `[run] sample` of the scene, or every 0.004 s. Columns: time,
    /// q.<joint> (rad, m), qd.<joint> (rad/s, m/s); a joint with several coordinates has numbered
    /// columns. With - the table is on standard output as CSV, in place of the answer. A recording is
    /// for the Rerun viewer.
    #[arg(short, long, aliases = ["csv", "parquet", "rrd"], value_name = "FILE", verbatim_doc_comment)]
    out: Vec<PathBuf>,
    /// Write the lasting contacts as a table (.csv, .parquet, -): a row for each contact at each sample
    ///
    /// Columns: time (s), contact (its name), mode (sliding, sticking, latched, pressing, stepping), point
    /// x, y, z (m) and unit normal nx, ny, nz from the environment to the robot in world axes, gap (m; rad),
    /// force on the robot fx, fy, fz (N, world axes) and its normal component (N; N m at a joint limit, where
    /// the vectors are zero), flags (non-unique: the motion depends on how forces are distributed).
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    contacts: Option<PathBuf>,
    /// Add the loads on the joints: at the impacts, and the forces of the motors over time
    ///
    /// At each impact (impact, several, latch, limit) Jᵀp and the impulse through every joint as those
    /// of `carom impact --loads`, and the forces of the motors (N m, N) after their limits, just before
    /// and just after; in the JSON answer: loads of the event. Tables of --out have also the columns
    /// motor.<joint> (N m, N), recordings plots of these. Mechanisms with loops have no impulses through
    /// joints, time steps and compliant contacts no impacts.
    #[arg(long, verbatim_doc_comment, conflicts_with = "runs")]
    loads: bool,
    /// Write the loads of the impacts as a table (.csv, .parquet, -): a row for each joint at each impact
    ///
    /// Columns: time (s), kind (of the event), joint; the impulse of its parent link on its child link
    /// fx, fy, fz (N s) and its moment mx, my, mz (N m s) about the origin of the child link, in the axes
    /// of the child link; of joints with one coordinate joint_impulse (Jᵀp; N m s, N s), motor_minus and
    /// motor_plus (force of the motor before and after; N m, N).
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    joint_loads: Option<PathBuf>,
    /// Write the events as a table (.csv, .parquet, -): a row for each event, and for each of its contacts
    ///
    /// Columns: time (s), event (its kind), contact (contact or joint), detail (slip at the end of an impact:
    /// stick, slip, reverse-slip; reason of others), flags; point x, y, z (m), impulse on the robot px, py, pz
    /// (N s), and of an impact at one contact its velocity before and after, ux_minus … uz_plus (m/s), all
    /// in world axes; qd_minus.<joint>, qd_plus.<joint> (rad/s, m/s). Numbers that an event lacks are NaN.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    events: Option<PathBuf>,
    /// Start from this state instead of that of the scene
    ///
    /// A JSON file: {"q": […], "qd": […]} and, if wanted, "time" (s), at which tables and moving
    /// surfaces begin; or the answer of `carom simulate --json`, whose `final` state and time are
    /// taken. The duration counts from there. Past impacts, after which `after_impact` acts,
    /// and what compliant contacts remember are not part of a state.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    from_state: Option<PathBuf>,
    /// Run N times with the disturbances of `[run] perturb`; the table has a row for each run
    ///
    /// Columns of --out: run (0: without disturbance), outcome (duration, events, refused), impacts,
    /// first_impact (s), events, same_events (1 if the events are those of run 0); the numbers of the
    /// scene that are disturbed; start.q.<joint>, start.qd.<joint>; end.time, end.q.<joint>,
    /// end.qd.<joint>; energy_start, energy_end, lost_in_impacts, energy_error (J).
    /// A row depends on its number only: --shard computes a part of them, and the table does not depend
    /// on the number of threads.
    #[arg(
        long,
        value_name = "N",
        verbatim_doc_comment,
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    runs: Option<u64>,
    /// With --runs, tell the covariance of the end, and that which the derivatives of run 0 predict
    ///
    /// Covariance of the displacements and velocities of the end over the runs, relative to run 0, beside
    /// S Σ Sᵀ with the derivatives S of the end of run 0, as of --sensitivity, and the covariance Σ of the
    /// disturbances; and the predicted standard deviations of the times of the events.
    #[arg(long, verbatim_doc_comment, requires = "runs")]
    covariance: bool,
    /// Estimate the error of the run: of every number of the final state and of the times of events
    ///
    /// By a run with a tenth of the tolerance, and where its events differ by one with a hundredth:
    /// absolute errors, of q as a displacement (rad, m; of a floating joint along and about the axes of
    /// its link), of qd (rad/s, m/s) and of times (s). Tables of --out have also the columns
    /// error.q.<joint> and error.qd.<joint>, those of --events time_error, recordings plots. Runs with
    /// time steps have no estimate.
    #[arg(long, verbatim_doc_comment, conflicts_with = "runs")]
    error: bool,
    /// Differentiate the final state and the times of the events by the start and by parameters
    ///
    /// Exact to about 1e-8 of their size. The parameters: restitution and friction of all
    /// contacts together; of the controller kp, kd, target or torque of each joint, and the rows
    /// of a table of torques or of a reference. A change
    /// of q is a displacement: of a floating joint along and about the axes of its link.
    /// Where the outcome is not differentiable, the time and the reason are given.
    #[arg(long, verbatim_doc_comment, conflicts_with = "runs")]
    sensitivity: bool,
    /// Differentiate by these numbers only, with --sensitivity: q,contact.friction,run.gravity[2]
    ///
    /// Separated by commas: q and qd (the whole start), "q elbow" (a part of it), a parameter such as
    /// friction or "kp elbow", or any number of the scene by the path of its key. A name stands for
    /// all that begin with it: "torque elbow" for all rows of a table of torques.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        requires = "sensitivity",
        conflicts_with = "runs",
        verbatim_doc_comment
    )]
    wrt: Vec<String>,
    #[command(flatten)]
    rows: RowOptions,
    #[command(flatten)]
    record: Record,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    run: NamedRun<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    accuracy: Option<&'a Met>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<RunError>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensitivity: Option<Sensitivity>,
}

/// The statistics and what they say, for the help.
fn statistics() -> String {
    const COLUMNS: usize = 98;
    let mut text = "Keys of statistics:".to_owned();
    for (name, about) in Statistics::FIELDS {
        text += &format!("\n  {name:20}");
        let mut length = 0;
        for word in about.split_whitespace() {
            if length + 1 + word.chars().count() > COLUMNS - 22 {
                text += &format!("\n{:22}", "");
                length = 0;
            }
            text += &format!(" {word}");
            length += 1 + word.chars().count();
        }
    }
    text
}

impl Simulate {
    pub fn run(mut self, out: &mut dyn Write) -> Result<(), CliError> {
        let outputs = Outputs::of(&self.out, &[Kind::Table, Kind::Recording])?;
        self.record.check(outputs.recording.as_deref())?;
        let refuse = |e| CliError::scene(&self.scene, e);
        let mut scene = load(&self.scene)?;
        if let Some(file) = &self.from_state {
            from_state::apply(file, &mut scene)?;
            scene.files.push(file.clone());
        }
        let (contacts, of_events) = (self.contacts.as_deref(), self.events.as_deref());
        let joint_loads = self.joint_loads.as_deref();
        let loads = self.loads || joint_loads.is_some();
        let named = [("--contacts", contacts), ("--events", of_events), ("--joint-loads", joint_loads)];
        let tables = outputs.tables.iter().map(PathBuf::as_path);
        let printed = Printed::of(tables.chain(named.iter().filter_map(|(_, path)| *path)), self.json)?;
        let unprinted = [("--sensitivity", self.sensitivity), ("--covariance", self.covariance)];
        if let Some((option, _)) = unprinted.iter().find(|(_, asked)| *asked && printed.is_asked()) {
            let why = format!(
                "{option} is part of the answer, which a table on standard output replaces: give the table a file"
            );
            return Err(CliError::Input(why));
        }
        let files = named.map(|(option, path)| (option, path.filter(|path| *path != Path::new("-"))));
        let written = [&outputs.files()[..], &files].concat();
        files::check(&scene.files, &written)?;
        let tables: Vec<&Path> = outputs.tables.iter().map(|path| printed.place(path)).collect();
        if let Some(runs) = self.runs {
            if self.covariance && runs < 2 {
                let why =
                    "--covariance: run 0 is without disturbance, the runs from 1 on have it: give --runs 2 or more";
                return Err(CliError::Input(why.into()));
            }
            let others = named.iter().any(|(_, path)| path.is_some());
            if others || self.record.is_asked() || tables.len() > 1 {
                let why =
                    "--runs: write one table, with --out, without --contacts, --events, --joint-loads and recordings";
                return Err(CliError::Input(why.into()));
            }
            if let Some(option) = self.rows.given().filter(|_| printed.is_asked()) {
                let why = format!(
                    "{option}: a table on standard output has no parts: give the name of a table, .csv or .parquet"
                );
                return Err(CliError::Input(why));
            }
            let ToAccuracy { scene, plan, .. } = scene.to_accuracy().map_err(refuse)?;
            let table = tables.first().copied();
            let asked = runs::Asked { runs, rows: &self.rows, table, covariance: self.covariance, json: self.json };
            let answer: &mut dyn Write = if printed.is_asked() { &mut io::sink() } else { &mut *out };
            let ran = runs::run((&self.scene, &scene, &plan), &asked, answer);
            return if ran.is_ok() { printed.print(out) } else { printed.keep(ran) };
        }
        if let Some(option) = self.rows.given() {
            return Err(CliError::Input(format!("{option} is for the rows of --runs: leave it out")));
        }
        files::clear_when_interrupted();
        let ToAccuracy { scene, plan, met } = scene.to_accuracy().map_err(refuse)?;
        if self.sensitivity {
            sensitivity::check(&self.scene, &plan)?;
        }
        let sim = &plan.simulation;
        let mut columns = state_columns(&sim.chain);
        if loads {
            columns.extend(motor_columns(&sim.chain));
        }
        if self.error {
            columns.extend(error_columns(&sim.chain));
        }
        let mut states = Tables::begin(tables, &columns, &scene.text)?;
        let mut contacts = Tables::begin(contacts.map(|path| printed.place(path)), &contact_columns(sim), &scene.text)?;
        let mut joint_loads =
            Tables::begin(joint_loads.map(|path| printed.place(path)), &load_columns(&sim.chain), &scene.text)?;
        let mut recorder = begin_recording(&self.record, &scene, &plan)?;
        let sampled = [&states, &contacts].iter().any(|it| !it.tables.is_empty()) || recorder.is_some();
        let every = sampled.then(|| scene.sample.unwrap_or(Scene::SAMPLE));
        let mut events = Vec::new();
        let sampling = Sampling { every, loads, ..Sampling::default() };
        let mut row = Vec::new();
        // Of a run whose errors are told after its end.
        let (mut rows, mut moments) = (Vec::new(), Vec::new());
        let mut write = |row: &[f64]| if self.error { rows.push(row.to_vec()) } else { states.row(row) };
        let mut watch = |seen: Seen| {
            match &seen {
                Seen::Moment(moment) => {
                    let Moment { time, q, qd } = moment;
                    row = [&[*time], &q[..], qd].concat();
                    if !loads {
                        write(&row);
                    }
                    if self.error {
                        moments.push((*moment).clone());
                    }
                }
                Seen::Motors(_, forces) => write(&[&row[..], forces].concat()),
                Seen::Event(event) => {
                    load_rows(&sim.chain, event).iter().for_each(|row| joint_loads.row(row));
                    events.push((*event).clone());
                }
                Seen::Contacts(time, all) => all.iter().for_each(|state| contacts.row(&contact_row(*time, state))),
                Seen::Segment(_) => {}
            }
            if let Some(recorder) = &mut recorder {
                recorder.see(seen);
            }
        };
        let run = match met.as_ref().filter(|_| every.is_none() && !loads) {
            Some(met) => {
                events.clone_from(&met.events);
                met.summary.clone()
            }
            None => plan.stream(scene.duration, sampling, &mut watch).map_err(refuse)?,
        };
        let error = self.error.then(|| plan.error_of((scene.duration, every), (&events, &moments, &run)));
        let error = error.transpose().map_err(refuse)?;
        if let Some(error) = &error {
            for (row, sample) in rows.iter().zip(&error.samples) {
                states.row(&[&row[..], &error_row(&sim.chain, sample.as_ref())].concat());
            }
        }
        let without_loads = if loads { run.missing_loads(sim) } else { Vec::new() };
        warn(&self.scene, run.warnings().into_iter().chain(without_loads));
        let derivatives = self.sensitivity.then(|| Sensitivity::of(&scene, &plan, &self.wrt));
        let derivatives = derivatives.transpose().map_err(refuse)?;
        states.finish()?;
        contacts.finish()?;
        joint_loads.finish()?;
        let mut named = run.named(sim, &events);
        let errors = error.iter().flat_map(|error| &error.events);
        named.events.iter_mut().zip(errors).for_each(|(event, error)| event.time_error = *error);
        let (columns, rows) = event_table(&sim.chain, &named.events, self.error);
        let mut table = Tables::begin(of_events.map(|path| printed.place(path)), &columns, &scene.text)?;
        rows.iter().for_each(|row| table.row(row));
        table.finish()?;
        if let Some(mut recorder) = recorder {
            if let Some(error) = &error {
                recorder.errors(&moments, &error.samples);
            }
            recorder.finish(&run)?;
        }
        if printed.is_asked() {
            return printed.print(out);
        }
        let whole = Answer { run: named, accuracy: met.as_ref(), error, sensitivity: derivatives };
        answer_about(&self.scene, out, &whole, self.json, |whole, out| {
            for_people(&whole.run.events, &run, out)?;
            whole.accuracy.map_or(Ok(()), |met| run_error::accuracy(met, out))?;
            whole.error.as_ref().map_or(Ok(()), |error| run_error::for_people(error, out))?;
            whole.sensitivity.as_ref().map_or(Ok(()), |derivatives| derivatives.for_people(out))
        })
    }
}

/// Number of contacts, or of joint velocities, of one event that are listed for people; `--json` has all.
const LISTED: usize = 8;

/// The first of a list, and how many more there are.
fn listed(all: &[String], between: &str) -> String {
    let shown = if all.len() > LISTED + 1 { LISTED } else { all.len() };
    let more = if all.len() > shown { format!(" and {} more", all.len() - shown) } else { String::new() };
    all[..shown].join(between) + &more
}

fn numbers(x: &[f64]) -> Vec<String> {
    x.iter().map(|x| short(*x)).collect()
}

/// Whether two events in a row are one row: contacts that begin, end or accumulate at the same time, as it is printed.
fn alike(a: &NamedEvent, b: &NamedEvent) -> bool {
    let plain = |it: &NamedEvent| it.contact.is_some() && it.impact.is_none() && it.reason.is_none();
    plain(a) && plain(b) && a.kind == b.kind && short(a.time) == short(b.time)
}

/// How the contact slips at the end of an impact: `stick` is what a ball without spin does, too, which does not stay.
fn slips(mode: Mode) -> &'static str {
    if mode == Mode::Stick { "no slip" } else { mode.name() }
}

fn for_people(events: &[NamedEvent], run: &Summary, out: &mut dyn Write) -> io::Result<()> {
    for group in events.chunk_by(alike) {
        let event = &group[0];
        let mut line = format!("{:>14} s  {:10} {}", short(event.time), event.kind, event.reason.unwrap_or(""));
        if event.reason.is_some() && !event.contacts.is_empty() {
            line += ": ";
        }
        let of = |name: &&str| {
            let own = event.impulses.iter().filter(|it| it.contact == *name);
            let size = own.map(|it| it.what.impulse.norm()).reduce(|a, b| a + b);
            size.map_or((*name).to_owned(), |size| format!("{name} ({} N s)", short(size)))
        };
        let contacts: Vec<String> = if event.contacts.is_empty() {
            group.iter().filter_map(|event| event.contact).map(str::to_owned).collect()
        } else {
            event.contacts.iter().map(of).collect()
        };
        line += &listed(&contacts, "; ");
        if !event.flags.is_empty() {
            line += &format!(": {}", event.flags.join(", "));
        }
        if let Some(UnderLaw { hit, .. }) = event.impact {
            let [u_minus, u_plus] = [hit.u_minus, hit.u_plus].map(|u| numbers(u.as_slice()).join(" "));
            let impulse = short(hit.impulse.norm());
            line += &format!(": u⁻ ({u_minus}), u⁺ ({u_plus}) m/s, impulse {impulse} N s, {}", slips(hit.mode));
        }
        writeln!(out, "{line}")?;
        if !event.contacts.is_empty() && event.qd_minus != event.qd_plus {
            let [before, after] = [event.qd_minus, event.qd_plus].map(|qd| listed(&numbers(qd), " "));
            writeln!(out, "{:29}qd⁻ ({before}), qd⁺ ({after})", "")?;
        }
        for EventLoads { impact, motors_minus, motors_plus } in group.iter().filter_map(|event| event.loads) {
            loads_for_people(impact, out)?;
            let [before, after] = [motors_minus, motors_plus].map(|forces| numbers(forces).join(" "));
            writeln!(out, "{:29} motors ({before}) before, ({after}) after, N m, N", "")?;
        }
    }
    let last = &run.last;
    writeln!(out, "{:>14} s  end ({}), {}", short(last.time), run.stop.name(), run.mode.name())?;
    writeln!(out, "q  {}", numbers(&last.q).join(" "))?;
    writeln!(out, "qd {}", numbers(&last.qd).join(" "))?;
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
        "{} events; {} steps of the integrator, {} rejected, {} evaluations; {} time steps",
        run.events, s.steps, s.rejections, s.evaluations, s.contact_steps
    )?;
    if s.step_error > 0.0 {
        writeln!(out, "estimated error of the positions in the time steps: {} rad or m", short(s.step_error))?;
    }
    if s.non_unique_time > 0.0 {
        writeln!(out, "the motion is not unique for {} s: see the events", short(s.non_unique_time))?;
    }
    if s.neglected_frictions > 0 {
        let bound = short(s.neglected_bound);
        writeln!(
            out,
            "friction left out of {} impacts: velocity error of the contact point at most {bound} of its speed before the impact",
            s.neglected_frictions
        )?;
    }
    Ok(())
}

/// Tables of the same rows that are being written; keeps the first error.
pub struct Tables {
    tables: Vec<Table>,
    failed: Option<TableError>,
}

impl Tables {
    pub fn begin<'a>(
        paths: impl IntoIterator<Item = &'a Path>,
        columns: &[Column],
        scene: &str,
    ) -> Result<Self, CliError> {
        let tables = paths.into_iter().map(|path| Table::create_with(path, columns));
        let mut tables = tables.collect::<Result<Vec<_>, _>>()?;
        tables.iter_mut().for_each(|table| table.describe(SCENE_KEY, scene));
        Ok(Self { tables, failed: None })
    }

    pub fn row(&mut self, numbers: &[f64]) {
        for table in &mut self.tables {
            if self.failed.is_none() {
                self.failed = table.row(numbers).err();
            }
        }
    }

    pub fn finish(self) -> Result<(), CliError> {
        if let Some(error) = self.failed {
            return Err(error.into());
        }
        Ok(self.tables.into_iter().try_for_each(Table::finish)?)
    }
}

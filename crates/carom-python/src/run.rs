//! A run of a scene: samples, events and lasting contacts as arrays and tables.

use crate::array::{Array, Maybe, array, list};
use crate::chain::{Chain, Origin};
use crate::dynamics::loads_dict;
use crate::error::{exceptions, raise};
use crate::impact::Impact;
use crate::notebook;
use crate::pickle::{Parts, Pickled, fields, tuple, variants};
use crate::scene::{Planned, Scene};
use crate::table::Table;
use carom_sim::{
    ContactState, Event, EventKind, EventLoads, EventTime, Moment, NamedEvent, Plan, RunError, Seen, Simulation,
    StateError, Summary,
};
use carom_study::{
    Column, SCENE_KEY, contact_columns, contact_row, coordinate_columns, error_columns, error_row, load_columns,
    load_rows, motor_columns, state_columns,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

/// What a run has reported, in the order of time.
pub enum Told {
    Moment(Moment),
    Event(Event),
    Contacts(f64, Vec<ContactState>),
    Motors(f64, Vec<f64>),
}

variants! { Told { Moment(moment), Event(event), Contacts(time, states), Motors(time, forces) } }

impl Told {
    /// The events and the moments among these.
    pub fn events_and_moments(all: &[Self]) -> (Vec<Event>, Vec<Moment>) {
        let events = all.iter().filter_map(|it| if let Self::Event(event) = it { Some(event.clone()) } else { None });
        let moments =
            all.iter().filter_map(|it| if let Self::Moment(moment) = it { Some(moment.clone()) } else { None });
        (events.collect(), moments.collect())
    }

    pub fn of(seen: &Seen) -> Option<Self> {
        match seen {
            Seen::Moment(moment) => Some(Self::Moment((*moment).clone())),
            Seen::Event(event) => Some(Self::Event((*event).clone())),
            Seen::Contacts(time, states) => Some(Self::Contacts(*time, states.to_vec())),
            Seen::Motors(time, forces) => Some(Self::Motors(*time, forces.to_vec())),
            Seen::Segment(_) => None,
        }
    }
}

/// A run of a scene.
///
/// q and qd have the coordinates of `run.chain`, all joints of the scene.
#[pyclass(frozen, module = "carom")]
pub struct Run {
    scene: Scene,
    plan: Plan,
    told: Vec<Told>,
    summary: Summary,
    /// Whether it has loads.
    loads: bool,
    /// Its errors, if they were asked for.
    error: Option<RunError>,
}

impl Run {
    /// With loads and errors, if they were asked for.
    pub fn new(
        scene: Scene,
        plan: Plan,
        told: Vec<Told>,
        summary: Summary,
        (loads, error): (bool, Option<RunError>),
    ) -> Self {
        Self { scene, plan, told, summary, loads, error }
    }

    /// The forces of the motors at the moments.
    fn forces(&self) -> impl Iterator<Item = &[f64]> {
        self.told.iter().filter_map(|told| if let Told::Motors(_, forces) = told { Some(&forces[..]) } else { None })
    }

    /// # Errors
    /// `ValueError`: loads were not asked for.
    fn loaded(&self) -> PyResult<&Self> {
        let none = "this run has no loads: compute them with scene.simulate(loads=True)";
        if self.loads { Ok(self) } else { Err(PyValueError::new_err(none)) }
    }

    /// # Errors
    /// `ValueError`: errors were not asked for.
    fn estimated(&self) -> PyResult<&RunError> {
        let none = "this run has no errors: estimate them with scene.simulate(error=True)";
        self.error.as_ref().ok_or_else(|| PyValueError::new_err(none))
    }

    /// The errors at the moments; NaN where there are none.
    fn errors<'py>(&self, py: Python<'py>, of: fn(&StateError) -> &[f64]) -> PyResult<Array<'py>> {
        let (samples, nv) = (&self.estimated()?.samples, self.plan.simulation.chain.nv());
        let row = |sample: &Option<StateError>| sample.as_ref().map_or(vec![f64::NAN; nv], |error| of(error).to_vec());
        array(py, samples.iter().flat_map(row).collect(), &[samples.len(), nv])
    }

    /// What to know of the results.
    pub fn all_warnings(&self) -> Vec<String> {
        let missing = if self.loads { self.summary.missing_loads(&self.plan.simulation) } else { Vec::new() };
        self.summary.warnings().into_iter().chain(missing).collect()
    }

    fn moments(&self) -> impl Iterator<Item = &Moment> {
        self.told.iter().filter_map(|told| if let Told::Moment(moment) = told { Some(moment) } else { None })
    }

    fn all_events(&self) -> impl Iterator<Item = &Event> {
        self.told.iter().filter_map(|told| if let Told::Event(event) = told { Some(event) } else { None })
    }

    fn rows<'py>(&self, py: Python<'py>, width: usize, of: fn(&Moment) -> &[f64]) -> PyResult<Array<'py>> {
        let numbers: Vec<f64> = self.moments().flat_map(|moment| of(moment).iter().copied()).collect();
        array(py, numbers, &[self.moments().count(), width])
    }
}

/// By its scene, which is planned again, and by what it has reported.
impl Pickled for Run {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        tuple(
            py,
            [
                self.scene.write(py)?,
                self.told.write(py)?,
                self.summary.write(py)?,
                self.loads.write(py)?,
                self.error.write(py)?,
            ],
        )
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let scene: Scene = parts.next()?;
        let plan = scene.scene.plan().map_err(raise)?;
        Ok(Self::new(scene, plan, parts.next()?, parts.next()?, (parts.next()?, parts.next()?)))
    }
}

/// Lasting contacts at some times as a table.
pub fn contact_table<'a>(sim: &Simulation, told: impl Iterator<Item = (f64, &'a [ContactState])>) -> Table {
    let mut table = Table::new(contact_columns(sim));
    for (time, states) in told {
        for state in states {
            table.push(contact_row(time, state));
        }
    }
    table
}

getters! { Run, self, py {
    /// The simulated robot.
    chain: Chain = Chain::new(self.plan.simulation.chain.clone(), Origin::Of(Arc::new(Planned(self.scene.clone()))));
    /// Times of the samples, shape (S,), s. At the time of an event the sample is the state before it.
    time: Array<'py> = list(py, &self.moments().map(|moment| moment.time).collect::<Vec<_>>())?;
    /// Configurations at the samples, shape (S, nq); rad, m, quaternions.
    q: Array<'py> = self.rows(py, self.plan.simulation.chain.nq(), |moment| &moment.q)?;
    /// Joint velocities at the samples, shape (S, nv); rad/s, m/s.
    qd: Array<'py> = self.rows(py, self.plan.simulation.chain.nv(), |moment| &moment.qd)?;
    /// Forces of the motors at the samples, after their limits, shape (S, nv); N m, N. Needs `simulate(loads=True)`.
    motors: Array<'py> = {
        let forces: Vec<f64> = self.loaded()?.forces().flatten().copied().collect();
        array(py, forces, &[self.moments().count(), self.plan.simulation.chain.nv()])?
    };
    /// The events in the order of time, a list of Event.
    events: Vec<RunEvent> = {
        let mut errors = self.error.iter().flat_map(|error| error.events.iter().copied());
        let own = |event: &Event| RunEvent::of(&self.plan.simulation, event.clone()).with_error(errors.next().flatten());
        self.all_events().map(own).collect()
    };
    /// The estimated errors of the end, a dict: tighter (the tolerances of the runs that tell them), final (a dict of q, as a
    /// displacement of nv numbers, and qd), or unknown (a dict of time and reason) instead of it. None without `simulate(error=True)`.
    error: Option<Bound<'py, PyAny>>, "dict[str, Any] | None" = self.error.as_ref().map(|error| pythonize(py, error)).transpose()?;
    /// The estimated errors of q at the samples, as displacements, shape (S, nv); rad, m. Needs `simulate(error=True)`; NaN where there
    /// is no estimate.
    q_error: Array<'py> = self.errors(py, |error| &error.q)?;
    /// The estimated errors of qd at the samples, shape (S, nv); rad/s, m/s. Needs `simulate(error=True)`; NaN where there is no estimate.
    qd_error: Array<'py> = self.errors(py, |error| &error.qd)?;
    /// Why the run has ended: "duration" or "events".
    stop_reason: &'static str, "Literal['duration', 'events']" = self.summary.stop.name();
    /// Contact mode at the end.
    mode: &'static str = self.summary.mode.name();
    /// What to know of the results: an energy balance that does not close, impulses that do not satisfy their law, missing loads. They are raised as
    /// Python warnings, too.
    warnings: Vec<String> = self.all_warnings();
    /// Energy balance, a dict in J: end = start + drive + resistance - lost_in_impacts + error.
    energy: Bound<'py, PyAny>, "dict[str, float]" = pythonize(py, &self.summary.energy)?;
    /// Work of the solvers, a dict of numbers. `carom simulate --help` says what each means.
    statistics: Bound<'py, PyAny>, "dict[str, float]" = pythonize(py, &self.summary.statistics)?;
} }

#[pymethods]
impl Run {
    /// The samples as a Table: time, then q.<joint>, qd.<joint>, with loads motor.<joint>, and with errors error.q.<joint> and
    /// error.qd.<joint>; joints with several coordinates have numbered columns.
    #[getter]
    fn states(&self) -> Table {
        let chain = &self.plan.simulation.chain;
        let mut columns = state_columns(chain);
        if self.loads {
            columns.extend(motor_columns(chain));
        }
        if self.error.is_some() {
            columns.extend(error_columns(chain));
        }
        let mut table = Table::new(columns).with_text(SCENE_KEY, &self.scene.scene.text);
        let mut forces = self.forces();
        let mut errors = self.error.iter().flat_map(|error| &error.samples);
        for Moment { time, q, qd } in self.moments() {
            let forces = forces.next().unwrap_or_default();
            let error = errors.next().map_or_else(Vec::new, |error| error_row(chain, error.as_ref()));
            table.push([*time].iter().chain(q).chain(qd).chain(forces).chain(&error).copied());
        }
        table
    }

    /// The loads of the impacts as a Table, a row for each joint at each impact: time (s), kind of the event, joint; the impulse of its
    /// parent link on its child link fx, fy, fz (N s) and its moment mx, my, mz (N m s) about the origin of the child link, in the axes
    /// of the child link; of joints with one coordinate joint_impulse (Jᵀp; N m s, N s), motor_minus and motor_plus (force of the motor
    /// before and after; N m, N). Needs `simulate(loads=True)`.
    #[getter]
    fn loads(&self) -> PyResult<Table> {
        let chain = &self.loaded()?.plan.simulation.chain;
        let mut table = Table::new(load_columns(chain)).with_text(SCENE_KEY, &self.scene.scene.text);
        self.all_events().for_each(|event| load_rows(chain, event).into_iter().for_each(|row| table.push(row)));
        Ok(table)
    }

    /// The events as a Table: time (s), kind, contact, mode of an impact, the impulse of all contacts px, py, pz (N s, world
    /// axes), then q.<joint>, qd_minus.<joint>, qd_plus.<joint>, and with errors time_error (s).
    #[getter]
    fn event_table(&self) -> Table {
        let sim = &self.plan.simulation;
        let events: Vec<NamedEvent> = self.all_events().map(|event| event.named(&sim.touches)).collect();
        let kind = |event: &NamedEvent| Some(event.kind.to_owned());
        let place = |event: &NamedEvent| event.contact.map(str::to_owned);
        let mode = |event: &NamedEvent| event.impact.map(|impact| impact.hit.mode.name().to_owned());
        let words = |of: &dyn Fn(&NamedEvent) -> Option<String>| -> Vec<String> {
            events.iter().filter_map(of).collect::<BTreeSet<_>>().into_iter().collect()
        };
        let (kinds, places, modes) = (words(&kind), words(&place), words(&mode));
        // A column of words needs a word.
        let column = |name: &str, words: &[String]| {
            let words = if words.is_empty() { &[String::new()] } else { words };
            Column::word(name, words.iter().cloned())
        };
        let mut columns = vec![Column::number("time").in_unit("s"), column("kind", &kinds), column("contact", &places)];
        columns.push(column("mode", &modes));
        columns.extend(["px", "py", "pz"].map(|name| Column::number(name).in_unit("N s")));
        for (head, positions) in [("q", true), ("qd_minus", false), ("qd_plus", false)] {
            columns.extend(coordinate_columns(&sim.chain, head, positions));
        }
        columns.extend(self.error.as_ref().map(|_| Column::number("time_error").in_unit("s")));
        let mut errors = self.error.iter().flat_map(|error| &error.events);
        let mut table = Table::new(columns).with_text(SCENE_KEY, &self.scene.scene.text);
        let code = |words: &[String], word: Option<String>| {
            word.and_then(|word| words.iter().position(|it| *it == word)).map_or(f64::NAN, |k| k as f64)
        };
        for event in &events {
            let impulse: nalgebra::Vector3<f64> = event.impulses.iter().map(|one| one.what.impulse).sum();
            let head = [event.time, code(&kinds, kind(event)), code(&places, place(event)), code(&modes, mode(event))];
            let state = event.q.iter().chain(event.qd_minus).chain(event.qd_plus);
            let error = errors.next().map(|error| error.unwrap_or(f64::NAN));
            table.push(head.iter().chain(impulse.iter()).chain(state).copied().chain(error));
        }
        table
    }

    /// The lasting contacts at the samples as a Table: time (s), contact, mode, point x, y, z (m), unit normal nx, ny, nz from the
    /// environment to the robot, gap (m; rad), force on the robot fx, fy, fz (N, world axes), normal_force (N; N m at a limit),
    /// flags ("non-unique" where the motion depends on how forces are distributed, else "").
    #[getter]
    fn contacts(&self) -> Table {
        let told = self.told.iter().filter_map(|told| match told {
            Told::Contacts(time, states) => Some((*time, states.as_slice())),
            _ => None,
        });
        contact_table(&self.plan.simulation, told).with_text(SCENE_KEY, &self.scene.scene.text)
    }

    /// The end: a tuple of the time (s), q (nq,) and qd (nv,).
    #[getter]
    fn last<'py>(&self, py: Python<'py>) -> PyResult<(f64, Array<'py>, Array<'py>)> {
        let Moment { time, q, qd } = &self.summary.last;
        Ok((*time, list(py, q)?, list(py, qd)?))
    }

    /// Draws q and qd over time, with a line at each impact, with matplotlib.
    ///
    /// Args:
    ///     axes: two Axes to draw into; new ones by default.
    ///
    /// Returns:
    ///     The Axes.
    ///
    /// Raises:
    ///     ImportError: matplotlib is not installed.
    #[pyo3(signature = (axes=None))]
    fn plot<'py>(this: &Bound<'py, Self>, axes: Maybe<'_, 'py>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "run_plot", (this, axes))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "run_html", (this,))
    }

    fn __repr__(&self) -> String {
        let (samples, events) = (self.moments().count(), self.summary.events);
        let Summary { stop, mode, last, .. } = &self.summary;
        let (stop, mode, time) = (stop.name(), mode.name(), last.time);
        format!("<carom.Run: {events} events, {samples} samples, ended at {time} s ({stop}), {mode}>")
    }
}

/// Contact, point and impulse.
type Push<'py> = (String, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// An event of a run.
#[pyclass(frozen, module = "carom", name = "Event")]
pub struct RunEvent {
    event: Event,
    contact: Option<String>,
    contacts: Vec<String>,
    reason: Option<&'static str>,
    flags: Vec<&'static str>,
    /// The contact of each impulse.
    struck: Vec<String>,
    /// The derivatives of its time.
    time_by: Option<Vec<f64>>,
    /// The estimated error of its time.
    time_error: Option<f64>,
}

fields! { RunEvent { event, contact, contacts, reason, flags, struck, time_by, time_error } }

impl RunEvent {
    /// An event of this simulation.
    pub fn of(sim: &Simulation, event: Event) -> Self {
        let NamedEvent { contact, contacts, reason, flags, impulses, .. } = event.named(&sim.touches);
        let contact = contact.map(str::to_owned);
        let contacts = contacts.into_iter().map(str::to_owned).collect();
        let struck = impulses.iter().map(|one| one.contact.to_owned()).collect();
        Self { contact, contacts, reason, flags, struck, event, time_by: None, time_error: None }
    }

    /// With the estimated error of its time.
    pub fn with_error(self, time_error: Option<f64>) -> Self {
        Self { time_error, ..self }
    }

    /// With the derivatives of its time that are among these, if there are any.
    pub fn with_derivatives(self, times: &[EventTime]) -> Self {
        let Event { time, kind, .. } = &self.event;
        // The run that is differentiated follows slips in another way: up to rounding its times are the same.
        let same = |it: &&EventTime| (it.time - time).abs() <= 1e-9 * time.max(1.0) && it.kinds.contains(&kind.name());
        let time_by = times.iter().find(same).map(|it| it.time_by.clone());
        Self { time_by, ..self }
    }
}

getters! { RunEvent, self, py {
    /// Time, s.
    time: f64 = self.event.time;
    /// "impact", "several", "latch", "limit", "zeno", "lift-off", "joint-stops", "joint-moves", "stepping", "non-unique", "rest",
    /// or the new contact mode.
    kind: &'static str = self.event.kind.name();
    /// Name of the contact or the joint, None if the event belongs to none or to several.
    contact: Option<&str> = self.contact.as_deref();
    /// Names of the contacts of an event of the kind "several" or "non-unique"; else empty.
    contacts: Vec<String> = self.contacts.clone();
    /// Why, for the kinds "stepping" and "non-unique"; else None.
    reason: Option<&'static str> = self.reason;
    /// Names of the flags of an event of the kind "several": "energy-gain", "non-unique"; else empty.
    flags: Vec<&'static str> = self.flags.clone();
    /// The Impact, for an event of the kind "impact"; else None.
    impact: Option<Impact> = match &self.event.kind {
        EventKind::Impact { hit, .. } => Some(Impact::of((**hit).clone(), None)),
        _ => None,
    };
    /// Configuration, shape (nq,).
    q: Array<'py> = list(py, &self.event.q)?;
    /// Joint velocities before, shape (nv,).
    qd_minus: Array<'py> = list(py, &self.event.qd_minus)?;
    /// Joint velocities after, shape (nv,).
    qd_plus: Array<'py> = list(py, &self.event.qd_plus)?;
    /// Derivatives of the time by the columns `Sensitivity.names`, shape (columns,), for the events of a Sensitivity; None for events of
    /// runs and where the derivatives have ended.
    time_by: Option<Array<'py>>, "_Vector | None" = self.time_by.as_ref().map(|by| list(py, by)).transpose()?;
    /// The estimated error of the time, s, of a run with `simulate(error=True)`; else None, and for an event that runs with tighter
    /// tolerances do not have.
    time_error: Option<f64> = self.time_error;
    /// The loads on the joints, for the kinds "impact", "several", "latch" and "limit" of `simulate(loads=True)`; else None. A dict as of
    /// `Chain.impact_loads`, with motors_minus and motors_plus, the forces of the motors before and after (nv,), N m and N.
    loads: Option<Bound<'py, PyDict>>, "_EventLoads | None" = match self.event.loads.as_deref() {
        Some(EventLoads { impact, motors_minus, motors_plus }) => {
            let loads = loads_dict(py, impact)?;
            loads.set_item("motors_minus", list(py, motors_minus)?)?;
            loads.set_item("motors_plus", list(py, motors_plus)?)?;
            Some(loads)
        }
        None => None,
    };
} }

#[pymethods]
impl RunEvent {
    /// The impulses on the robot: a list of tuples of the contact, the point (3,) in m and the impulse (3,) in N s, world axes.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Vec<Push<'py>>> {
        let one = |(one, name): (&carom_sim::ContactImpulse, &String)| {
            let vector = |v: &nalgebra::Vector3<f64>| list(py, v.as_slice());
            Ok((name.clone(), vector(&one.point)?, vector(&one.impulse)?))
        };
        self.event.impulses.iter().zip(&self.struck).map(one).collect()
    }

    fn __repr__(&self) -> String {
        let place = self.contact.as_ref().map_or_else(String::new, |contact| format!(" at {contact}"));
        format!("<carom.Event {}{place}, {} s>", self.event.kind.name(), self.event.time)
    }
}

/// Whether this package can write recordings.
#[pyfunction]
pub fn can_record() -> bool {
    cfg!(feature = "rerun")
}

/// Writes the recording of a run to a file; `carom.record` says more.
#[pyfunction]
#[cfg(feature = "rerun")]
pub fn record(py: Python<'_>, run: &Bound<'_, Run>, path: PathBuf) -> PyResult<()> {
    use carom_record::{SceneRecorder, Target};
    let run = run.get();
    let done = py.detach(|| {
        let mut recorder = SceneRecorder::begin(&Target::File(path), &run.scene.scene, &run.plan)?;
        for told in &run.told {
            recorder.see(match told {
                Told::Moment(moment) => Seen::Moment(moment),
                Told::Event(event) => Seen::Event(event),
                Told::Contacts(time, states) => Seen::Contacts(*time, states),
                Told::Motors(time, forces) => Seen::Motors(*time, forces),
            });
        }
        recorder.finish(&run.summary)
    });
    done.map_err(|e| exceptions::RecordError::new_err(e.to_string()))
}

/// Refuses to write a recording.
#[pyfunction]
#[cfg(not(feature = "rerun"))]
pub fn record(run: &Bound<'_, Run>, _path: PathBuf) -> PyResult<()> {
    let message = format!(
        "{} is not recorded: this package is built without recordings (--no-default-features); build it without that option, or use \
         carom simulate --out",
        run.get().__repr__()
    );
    Err(exceptions::RecordError::new_err(message))
}

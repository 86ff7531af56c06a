//! The recording of a scene, while it is simulated.
//!
//! | entity | what |
//! | --- | --- |
//! | `/world/links/…` | the links' visual shapes, or collision shapes without any, once; their poses |
//! | `/world/surfaces/…` | the surfaces; the displacement of those that move |
//! | `/world/tip` | the tip's path, piece by piece |
//! | `/world/contacts`, `/world/impulses`, `/world/impulse` | points at which impulses acted, arrows of the impulses, size of the last one |
//! | `/world/forces` | arrows of the forces of lasting contacts |
//! | `/series/…` | positions, velocities, the tip's velocity, energies, gaps; forces of motors and impulses through joints, with loads |
//! | `/contact`, `/contact/…` | the mode of contact over time: of all contacts in one word, and of each pair of bodies whose contacts last |
//! | `/events` | the events, as text |
//! | `/run` | summary of the run |
//!
//! Values are logged at exact times, at an event twice: before and after. Memory does not grow with the length of the run.

use crate::bounds::{Bounds, Eye, Outline, xyz};
use crate::geometry::{self, Drawn, of_surface, transform};
use crate::lasting::Lanes;
use crate::layout::{self, Cursor, Tile};
use crate::measures::{ERROR, MOTOR, Measures, THROUGH};
use crate::rerun;
use crate::target::{Sink, Target};
use crate::{RecordError, round, summary};
use carom_chain::algebra::{Pose, z_onto};
use carom_chain::{Chain, Plane, Spatial, Workspace};
use carom_contact::{Surface as Form, found_shapes};
use carom_sim::{ContactImpulse, ContactState, Event, EventLoads, Moment, Plan, Scene, Seen, StateError, Summary};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

const PATH: u32 = 0xffb0_00ff;
const BLOW: u32 = 0xff5a_36ff;
/// Duration of a replay, s, at most real time.
const REPLAY: f64 = 8.0;
/// Time before the first event from which a replay is repeated, as a share of the duration.
const LEAD: f64 = 0.05;
/// Length of the arrow of the largest impulse, as a share of the size of the scene.
const ARROW: f64 = 0.3;
/// Number of events with impulses after which a file fixes the scale of the arrows; later arrows are cut at three times the
/// length.
const HELD: usize = 1000;

/// A recording that is being written; [`SceneRecorder::see`] records what a run reports.
pub struct SceneRecorder {
    sink: Sink,
    live: bool,
    chain: Chain,
    workspace: Workspace<Spatial<f64>>,
    plane: Option<Plane>,
    gravity: Vector3<f64>,
    touches: Vec<String>,
    measures: Measures,
    /// Links that may move.
    links: Vec<Drawn>,
    outline: Outline,
    bounds: Bounds,
    duration: f64,
    /// Size of the scene at the start, m, which scales arrows and the pieces of the path.
    size: f64,
    /// Length of the arrow of 1 N s, m, once it is fixed.
    arrow: Option<f64>,
    /// Impulses that are not yet drawn, with their times, until the scale is fixed.
    held: Vec<(f64, Vec<ContactImpulse>)>,
    /// End of the path of the tip so far.
    path: Option<Vector3<f64>>,
    lanes: Lanes,
    /// Whether forces of motors, impulses through joints, and errors were reported.
    more: [bool; 3],
    /// Time of the last moment whose lasting contacts were not reported: it has none.
    untold: Option<f64>,
    /// Time of the first event, s.
    first: Option<f64>,
    counts: BTreeMap<&'static str, usize>,
    /// The last time that was recorded, s.
    time: f64,
    failed: Option<RecordError>,
    /// Why visual meshes are not drawn.
    unread: Vec<String>,
}

impl SceneRecorder {
    /// Opens the recording of a scene that runs by `plan`, and logs the links, the surfaces and the start.
    ///
    /// # Errors
    /// [`RecordError`]: a file or viewer that cannot be used, a mesh that cannot be read.
    pub fn begin(target: &Target, scene: &Scene, plan: &Plan) -> Result<Self, RecordError> {
        let sim = &plan.simulation;
        let chain = sim.chain.clone();
        let shapes = found_shapes(&chain)?;
        let plane = plan.flat.as_ref().map(|flat| flat.plane);
        let sink = Sink::open(target, chain.name())?;

        let (looks, unread) = geometry::looks(&chain, &shapes)?;
        let (mut bounds, outline) = (Bounds::empty(), Outline::of(&chain, &looks));
        let mut workspace = chain.workspace();
        outline.enter(&workspace.update(&chain, &plan.q)?, &mut bounds);
        scene.surfaces.iter().for_each(|surface| bounds.include_obstacle(&surface.obstacle));
        let size = bounds.size();
        let measures = Measures::of(scene, sim, &shapes, plane.as_ref())?;
        measures.name(&sink, &chain)?;
        let links = geometry::links(&sink, &chain, &looks, size)?;
        let mut recorder = Self {
            sink,
            live: target.is_live(),
            workspace,
            plane,
            gravity: sim.gravity,
            touches: sim.touches.iter().map(|touch| touch.name.clone()).collect(),
            measures,
            links,
            outline,
            bounds,
            duration: scene.duration,
            size,
            arrow: None,
            held: Vec::new(),
            path: None,
            lanes: Lanes::of(&sim.touches),
            more: [false; 3],
            untold: None,
            first: None,
            counts: BTreeMap::new(),
            time: 0.0,
            failed: None,
            unread,
            chain,
        };
        recorder.begin_world()?;
        recorder.state(0.0, (&plan.q, &plan.qd), true)?;
        recorder.lanes.begin(&recorder.sink)?;
        let weight = recorder.chain.total_mass() * recorder.gravity.norm();
        recorder.lanes.arrow = (weight > 0.0).then(|| round(ARROW * size / weight));
        if recorder.live {
            recorder.show()?;
        }
        Ok(recorder)
    }

    /// Records what a run reports. The first error ends the recording; [`SceneRecorder::finish`] returns it.
    pub fn see(&mut self, seen: Seen) {
        if self.failed.is_none() {
            let done = match seen {
                Seen::Moment(moment) => self.moment(moment),
                Seen::Event(event) => self.event(event),
                Seen::Contacts(time, states) => {
                    self.untold = None;
                    self.contacts(time, states)
                }
                Seen::Motors(time, forces) => self.motors(time, forces),
                Seen::Segment(_) => Ok(()),
            };
            self.failed = done.err();
        }
    }

    /// Records the estimated errors of these moments, as decimal logarithms. The first error ends the recording, as in [`SceneRecorder::see`].
    pub fn errors(&mut self, moments: &[Moment], errors: &[Option<StateError>]) {
        if self.failed.is_none() {
            self.failed = self.log_errors(moments, errors).err();
        }
    }

    fn log_errors(&mut self, moments: &[Moment], errors: &[Option<StateError>]) -> Result<(), RecordError> {
        self.begin_more(2, |it| Measures::name_errors(&it.sink, &it.chain))?;
        for (moment, error) in moments.iter().zip(errors) {
            let Some(StateError { q, qd }) = error else { continue };
            self.sink.rec.set_duration_secs("time", moment.time);
            for (entity, errors) in ERROR.into_iter().zip([q, qd]) {
                // A number that stays zero has no logarithm; below its rounding no error of a number of size 1 is seen.
                let numbers = errors.iter().map(|error| error.max(f64::EPSILON).log10());
                self.sink.now(entity, &rerun::Scalars::new(numbers))?;
            }
        }
        Ok(())
    }

    /// Records the summary of the run and closes. A file has its own name only after this.
    ///
    /// # Errors
    /// The first error of the whole recording.
    pub fn finish(mut self, summary: &Summary) -> Result<(), RecordError> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let Moment { time, q, qd } = &summary.last;
        self.tell()?;
        self.impulses()?;
        self.state(*time, (q, qd), true)?;
        self.contacts(*time, &summary.contacts)?;
        let mut page = summary::markdown(&self.chain, summary, &self.counts, [self.arrow, self.lanes.arrow]);
        for reason in &self.unread {
            page += &format!("\nNot drawn: {reason}\n");
        }
        self.sink.fixed("run", &rerun::TextDocument::from_markdown(page))?;
        // Half-spaces are drawn again, now that the extent of the motion is known.
        geometry::surfaces(&self.sink, &self.measures.surfaces, &self.bounds, self.plane.as_ref())?;
        if !self.live {
            self.show()?;
        }
        self.sink.finish()
    }

    /// Logs the world's axes, the surfaces and the names of the modes.
    fn begin_world(&mut self) -> Result<(), RecordError> {
        let up = xyz(self.up());
        let axes = Matrix3::<f64>::identity();
        let coordinates = (0..3).find(|k| (axes.column(*k) - Vector3::from(up.map(f64::from))).norm() < 1e-6);
        let coordinates = match coordinates {
            Some(0) => rerun::ViewCoordinates::RIGHT_HAND_X_UP(),
            Some(1) => rerun::ViewCoordinates::RIGHT_HAND_Y_UP(),
            _ => rerun::ViewCoordinates::RIGHT_HAND_Z_UP(),
        };
        self.sink.fixed("world", &coordinates)?;
        geometry::surfaces(&self.sink, &self.measures.surfaces, &self.bounds, self.plane.as_ref())
    }

    /// The upward direction: against gravity; without gravity z, or the second axis of the chain's plane.
    fn up(&self) -> Vector3<f64> {
        let in_plane = |v: Vector3<f64>| self.plane.map_or(v, |plane| v - plane.normal * plane.normal.dot(&v));
        let up = in_plane(-self.gravity).try_normalize(1e-9);
        up.unwrap_or_else(|| self.plane.map_or_else(Vector3::z, |plane| plane.y))
    }

    /// The eye: along the plane's normal for a planar chain, else from above and one side.
    fn eye(&self) -> Eye {
        let up = self.up();
        let from = self.plane.map_or_else(
            || {
                let mut from = z_onto(up) * Vector3::new(0.45, -0.8, 0.4);
                for surface in &self.measures.surfaces {
                    if let Form::HalfSpace { normal, .. } = surface.obstacle.surface() {
                        // Keeps the eye outside the half-space.
                        from += normal * (0.25 - normal.dot(&from)).max(0.0);
                    }
                }
                from.normalize()
            },
            |plane| plane.normal,
        );
        Eye::looking(&self.bounds, from, up, Eye::WIDE)
    }

    /// Sends the layout.
    fn show(&self) -> Result<(), RecordError> {
        let eye = self.eye();
        let scene =
            layout::space(self.chain.name(), "/world", &eye, &["/world/tip", "/world/contacts", "/world/impulses"]);
        let words = Tile::Row(vec![(3.0, layout::log("events", "/events")), (2.0, layout::text("summary", "/run"))]);
        // Where positions and velocities have the same names, only the positions have a legend.
        let alike = self.chain.nq() == self.chain.nv();
        let mut plots = vec![
            layout::series("joint velocities (rad/s, m/s)", "/series/velocity", !alike),
            layout::series("joint positions (rad, m)", "/series/position", true),
        ];
        if self.measures.tip.is_some() {
            plots.push(layout::series("velocity of the tip (m/s)", "/series/tip", true));
        }
        plots.push(layout::series("energy (J)", "/series/energy", true));
        if self.measures.has_gaps() {
            plots.push(layout::series("least gap (m)", "/series/gap", true));
        }
        if self.more[0] {
            plots.push(layout::series("forces of the motors (N m, N)", "/series/motor", true));
        }
        if self.more[1] {
            plots.push(layout::series("impulses through joints (N s)", "/series/through/force", true));
            plots.push(layout::series("their moments (N m s)", "/series/through/moment", true));
        }
        if self.more[2] {
            plots.push(layout::series("log10 of the errors of positions (rad, m)", "/series/error/position", true));
            plots.push(layout::series(
                "log10 of the errors of velocities (rad/s, m/s)",
                "/series/error/velocity",
                true,
            ));
        }
        plots.push(layout::states("contact", "/contact"));
        let mut rows = Vec::new();
        while !plots.is_empty() {
            let pair: Vec<_> = plots.drain(..plots.len().min(2)).map(|tile| (1.0, tile)).collect();
            rows.push((1.0, Tile::Row(pair)));
        }
        let left = Tile::Column(vec![(2.4, scene), (1.0, words)]);
        let root = Tile::Row(vec![(1.0, left), (1.0, Tile::Column(rows))]);
        let speed = (self.duration / REPLAY).min(1.0);
        let cursor = match self.first {
            Some(first) if !self.live => {
                Cursor::Replay { speed, from: (first - LEAD * self.duration).max(0.0), to: self.time }
            }
            _ => Cursor::Newest { speed },
        };
        layout::send(&self.sink, &root, &cursor)
    }

    /// Logs the poses and all values at a time; `moved`: whether the configuration has changed too.
    fn state(&mut self, time: f64, (q, qd): (&[f64], &[f64]), moved: bool) -> Result<(), RecordError> {
        self.time = time;
        self.sink.rec.set_duration_secs("time", time);
        let mut kin = self.workspace.update(&self.chain, q)?;
        if moved {
            for Drawn { frame, path } in &self.links {
                self.sink.now(path.clone(), &transform(&kin.pose(*frame)))?;
            }
            for surface in &self.measures.surfaces {
                if let Some(motion) = &surface.motion {
                    let pose = Pose { rotation: Matrix3::identity(), translation: motion.at(time)[0] };
                    self.sink.now(of_surface(surface, &self.measures.surfaces), &transform(&pose))?;
                }
            }
            self.outline.enter(&kin, &mut self.bounds);
        }
        for (entity, values) in self.measures.at(&mut kin, (q, qd), time)? {
            self.sink.now(entity, &rerun::Scalars::new(values))?;
        }
        if let Some(tip) = &self.measures.tip {
            let here = kin.position(tip.point);
            match self.path {
                Some(there) if (here - there).norm() > 0.002 * self.size => {
                    let piece = rerun::LineStrips3D::new([[xyz(there), xyz(here)]]).with_colors([PATH]);
                    self.sink.now("world/tip", &piece.with_radii([0.0025 * self.size as f32]))?;
                    self.path = Some(here);
                }
                Some(_) => {}
                None => self.path = Some(here),
            }
        }
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        *self.counts.entry(event.kind.name()).or_default() += 1;
        self.first.get_or_insert(event.time);
        self.tell()?;
        self.state(event.time, (&event.q, &event.qd_minus), true)?;
        self.state(event.time, (&event.q, &event.qd_plus), false)?;
        let words = rerun::TextLog::new(summary::words(event, &self.touches)).with_level("INFO");
        self.sink.now("events", &words)?;
        self.lanes.event(&self.sink, &event.kind)?;
        if let Some(EventLoads { impact, motors_minus, motors_plus }) = event.loads.as_deref() {
            self.motors(event.time, motors_minus)?;
            self.motors(event.time, motors_plus)?;
            if !impact.through.is_empty() {
                self.begin_more(1, |it| Measures::name_impulses(&it.sink, &impact.through))?;
                let sizes = [
                    impact.through.iter().map(|it| it.force.norm()).collect::<Vec<_>>(),
                    impact.through.iter().map(|it| it.moment.norm()).collect(),
                ];
                for (entity, sizes) in THROUGH.into_iter().zip(sizes) {
                    self.sink.now(entity, &rerun::Scalars::new(sizes))?;
                }
            }
        }
        if event.impulses.iter().any(|one| one.impulse.norm() > 0.0) {
            self.held.push((event.time, event.impulses.clone()));
            if self.arrow.is_some() || self.live || self.held.len() == HELD {
                self.impulses()?;
            }
        }
        Ok(())
    }

    fn moment(&mut self, Moment { time, q, qd }: &Moment) -> Result<(), RecordError> {
        self.tell()?;
        self.untold = Some(*time);
        self.state(*time, (q, qd), true)
    }

    /// The forces of the motors at a time.
    fn motors(&mut self, time: f64, forces: &[f64]) -> Result<(), RecordError> {
        self.begin_more(0, |it| Measures::name_motors(&it.sink, &it.chain))?;
        self.sink.rec.set_duration_secs("time", time);
        self.sink.now(MOTOR, &rerun::Scalars::new(forces.iter().copied()))
    }

    /// Names series when they are reported for the first time, and gives them views.
    fn begin_more(&mut self, k: usize, name: impl FnOnce(&Self) -> Result<(), RecordError>) -> Result<(), RecordError> {
        if std::mem::replace(&mut self.more[k], true) {
            return Ok(());
        }
        name(self)?;
        if self.live { self.show() } else { Ok(()) }
    }

    /// Records that the last moment had no lasting contacts, if none were reported.
    fn tell(&mut self) -> Result<(), RecordError> {
        self.untold.take().map_or(Ok(()), |time| self.contacts(time, &[]))
    }

    /// The lasting contacts at a time.
    fn contacts(&mut self, time: f64, states: &[ContactState]) -> Result<(), RecordError> {
        self.sink.rec.set_duration_secs("time", time);
        self.lanes.set(&self.sink, states)?;
        let (eye, share) = self.nearer();
        let before = |point: Vector3<f64>| point + (eye - point) * share;
        let largest = states.iter().map(|state| state.force.norm()).fold(0.0, f64::max);
        if largest > 0.0 {
            self.lanes.arrow.get_or_insert_with(|| round(ARROW * self.size / largest));
        }
        self.lanes.draw(&self.sink, states, (before, share), (self.size, 3.0 * ARROW * self.size))
    }

    /// The position of the eye, and the share of the way to it by which arrows are moved: the links of a planar chain would hide
    /// them.
    fn nearer(&self) -> (Vector3<f64>, f64) {
        let eye = self.eye();
        let share = self.plane.map_or(0.0, |plane| {
            let [depth, distance] = [self.bounds.half_depth(&plane.normal), (eye.position - eye.target).norm()];
            (depth / distance).min(0.5)
        });
        (eye.position, share)
    }

    /// Draws the impulses that are not yet drawn, to one scale.
    fn impulses(&mut self) -> Result<(), RecordError> {
        let held = std::mem::take(&mut self.held);
        let greatest = held.iter().flat_map(|(_, impulses)| impulses).map(|one| one.impulse.norm()).fold(0.0, f64::max);
        if greatest > 0.0 {
            let scale = *self.arrow.get_or_insert_with(|| round(ARROW * self.size / greatest));
            for (time, impulses) in &held {
                self.sink.rec.set_duration_secs("time", *time);
                self.arrows(impulses, scale)?;
            }
            self.sink.rec.set_duration_secs("time", self.time);
        }
        Ok(())
    }

    /// Draws the arrows of the impulses of one event, and their sizes in N s.
    fn arrows(&self, impulses: &[ContactImpulse], scale: f64) -> Result<(), RecordError> {
        let (eye, share) = self.nearer();
        let before = |point: Vector3<f64>| point + (eye - point) * share;
        let longest = 3.0 * ARROW * self.size;
        let (mut points, mut arrows, mut ends, mut labels) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for ContactImpulse { point, impulse, .. } in impulses.iter().filter(|one| one.impulse.norm() > 0.0) {
            let arrow = (impulse * scale).cap_magnitude(longest);
            points.push(xyz(before(*point)));
            arrows.push(xyz(arrow * (1.0 - share)));
            // Arrows too short to be seen have no label; the last label stays.
            if arrow.norm() > 0.02 * self.size {
                ends.push(xyz(before(point + arrow)));
                labels.push(format!("{} N s", summary::short(impulse.norm())));
            }
        }
        let size = self.size as f32;
        let arrows = rerun::Arrows3D::from_vectors(arrows).with_origins(points.clone()).with_colors([BLOW]);
        self.sink.now("world/impulses", &arrows.with_radii([0.006 * size]))?;
        let points = rerun::Points3D::new(points).with_colors([BLOW]).with_radii([0.01 * size]);
        self.sink.now("world/contacts", &points)?;
        if ends.is_empty() {
            return Ok(());
        }
        let label = rerun::Points3D::new(ends).with_colors([BLOW]).with_radii([0.002 * size]).with_labels(labels);
        self.sink.now("world/impulse", &label.with_show_labels(true))
    }
}

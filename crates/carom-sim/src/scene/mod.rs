//! Scenes: reads robots, the surfaces around them, contact laws and run settings from a TOML file. The keys are documented at
//! [`Scene`].

mod beam;
mod contact;
mod control;
mod drive;
mod file;
mod force;
mod loops;
mod perturb;
mod robots;
mod surface;
mod table;
mod tip_velocity;
mod toml;

pub use perturb::{Distribution, Perturbation};
#[doc(hidden)]
pub use toml::from_toml;

use crate::contact::{Surface, Touch, Touches};
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::View;
use carom_chain::Spatial;
use carom_chain::input;
use carom_contact::LeftOut;
use contact::{apply, between_links, rule, several, unused};
use drive::per_joint;
use file::{File, Method, Model, Shape};
use force::{spring, wrench};
use loops::closure;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use surface::{Places, surface};

/// A scene: a robot or several, the surfaces around them, contact laws and run settings, read from a TOML file
/// ([`Scene::from_file`]).
///
/// ```toml
/// [robot]
/// urdf = "robots/planar2.urdf"        # relative to the scene file
/// q = [0.7854, -1.5708]
/// tip_velocity = { speed = 0.2, angle_deg = 45, along = [0, -1, 0] }   # or qd = [..]
///
/// [[surface]]
/// shape = { halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] } }
///
/// [contact]
/// law = "energetic"
/// restitution = 0.35
/// friction = 0.0
///
/// [run]
/// duration = 0.5
/// ```
///
/// # Keys
///
/// Units are SI, angles are in radians unless the key says otherwise, vectors are in world axes. File names are relative to
/// the folder of the scene file. "nq" is the length of q, "nv" that of qd. "required" and "–" mark keys without a default,
/// of which those with "–" are optional. A key that does not exist is refused.
///
/// ## `[robot]`
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `urdf` | file name | required | the robot |
/// | `srdf` | file name | – | an SRDF file; the pairs of links that it disables do not touch: see [`LoadOptions::srdf`](carom_chain::urdf::LoadOptions::srdf) |
/// | `q` | nq numbers; rad, m | required | configuration at the start, in the order of the joints in the URDF (a floating base first; fixed and mimic joints have no number). A floating joint has seven numbers: position x, y, z and quaternion x, y, z, w |
/// | `qd` | nv numbers; rad/s, m/s | zeros | joint velocities at the start, in the same order. A floating joint has six: linear, then angular velocity, in the axes of the body. Not together with `tip_velocity` |
/// | `tip_velocity` | table, see below | – | velocity of the tip at the start, instead of `qd` |
/// | `tip` | link name | `"tip"` | the link whose frame origin is the tip: used by `tip_velocity`, by the controllers `"transition"` and `"impact-invariant"`, and for the path in recordings. A robot without a link named `tip` needs the key for these only |
/// | `floating` | boolean | `false` | connects the base link to the world by a floating joint |
/// | `strict` | boolean | `false` | refuses what is otherwise a warning about the URDF |
/// | `repair` | boolean | `false` | changes the robot as little as needed to compute its dynamics: see [`LoadOptions::repair`](carom_chain::urdf::LoadOptions::repair) |
/// | `package_dirs` | list of folders | `[]` | folders in which the packages of mesh names (`package://NAME/…`) are searched for first |
/// | `rotor_inertia` | table of numbers by joint name, kg m², kg | none | reflected inertias of motors' rotors, N² I with the gear ratio N: see [`Chain::with_rotor_inertia`](carom_chain::Chain::with_rotor_inertia) |
/// | `beam` | list of tables `[[robot.beam]]`, see below | `[]` | slender links that bend |
///
/// `[[robot.beam]]` divides a link into rigid segments on elastic hinges
/// ([`Robot::with_segments`](carom_chain::urdf::Robot::with_segments)): the bends are the joints `LINK_bend1`, … (of two axes
/// `LINK_bend1a`, `LINK_bend1b`, …) after those of the URDF, each with a spring. `q` and `qd` without their numbers start from a
/// straight link.
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `link` | link name | required | the link |
/// | `from`, `to` | 3 numbers each, m | required | ends of the part that bends, in the axes of the link |
/// | `bends` | integer, at least 1 | required | number of elastic hinges |
/// | `bending` | one or two tables `{ axis, stiffness }` | required | axis of bending (3 numbers, in the axes of the link, normal to the beam), and the bending stiffness E I about it, N m² |
/// | `damping` | ≥ 0, s | `0` | τ of the bending moment E I (κ + τ dκ/dt) of a curvature κ |
///
/// `tip_velocity = { speed, angle_deg, along }`: the velocity `speed (cos α · d − sin α · n)` of the tip, where α is `angle_deg`,
/// n the normal of the first surface, and d the unit vector of the projection of `along` onto that surface. All three keys are
/// required, and the first surface must be a half-space. Of all joint velocities that give the tip this velocity, those with
/// the least kinetic energy are taken.
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `speed` | m/s | required | speed of the tip |
/// | `angle_deg` | degrees | required | angle α between the velocity and the surface; positive towards the surface |
/// | `along` | 3 numbers | required | direction of the tangential velocity; its length and its normal part are ignored |
///
/// ## `[[robot]]` (one table for each of several robots, instead of `[robot]`)
///
/// All robots are one chain ([`Chain::join`](carom_chain::Chain::join)) with the names `robot/joint` and `robot/link`; inside the
/// robot's own table names have no prefix. Links of different robots may touch each other without further keys. Keys: those of
/// `[robot]`, of which `q` has the default zeros, those of the controllers of `[run]`, for this robot alone, and
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `name` | string, unique, without `/` | required | the robot's name |
/// | `position` | 3 numbers, m | `[0, 0, 0]` | position of the root link; of a floating robot at the start |
/// | `rpy` | 3 numbers, rad | `[0, 0, 0]` | orientation of the root link |
///
/// With `floating = true`, `q` has the numbers of the joints alone, or, without `position` and `rpy`, those of the base before them.
/// `after_impact` of a robot begins at its own first impact. Either `[run]` or the robots have keys of controllers.
///
/// ## `[[surface]]` (one table for each surface; none is needed)
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `name` | string, unique | `"surface 1"`, `"surface 2"`, … | name in events, plans and `[[contact.pair]]` |
/// | `shape` | one of the shapes below | required | shape and pose |
/// | `contact` | table of `law`, `restitution`, `tangential_restitution`, `friction`, `latch`, `compliance` | those of `[contact]` | values that differ from `[contact]` at this surface |
/// | `motion` | table, see below | at rest | motion of the shape |
/// | `belt` | table, see below | – | motion of the material along a surface whose shape stays. Not together with `motion` |
///
/// | key of `motion` | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `amplitude`, `frequency`, `phase` | 3 numbers, m; Hz; rad | –, –, `0` | harmonic motion: displacement `amplitude · sin(2π · frequency · t + phase)` |
/// | `velocity` | 3 numbers, m/s | – | constant velocity, instead |
/// | `file` | file name | – | table of velocities, instead: columns `time`, `vx`, `vy`, `vz`; missing ones are 0 |
///
/// | key of `belt` | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `velocity`, `angular_velocity` | 3 numbers each, m/s, rad/s | zero | v and ω: the velocity of a point x is `v + ω × (x − centre)`, without its part normal to the surface |
/// | `centre` | 3 numbers, m | `[0, 0, 0]` | a point of the axis of ω |
/// | `file` | file name | – | table instead: columns `time`, `vx`, `vy`, `vz`, `wx`, `wy`, `wz`; missing ones are 0 |
///
/// | shape | keys | defaults |
/// | --- | --- | --- |
/// | `halfspace` | `point` (m) on its boundary, `normal` (any length) out of it, towards the robot | – |
/// | `box` | `centre` (m), `size` (m, full side lengths), `rpy` (rad) | `rpy = [0, 0, 0]` |
/// | `sphere` | `centre` (m), `radius` (m) | – |
/// | `cylinder` | `centre` (m), `radius` (m), `length` (m) along its z-axis, `rpy` (rad) | `rpy = [0, 0, 0]` |
/// | `capsule` | as `cylinder`; `length` is that of the segment | `rpy = [0, 0, 0]` |
/// | `mesh` | `file` (STL, DAE or OBJ; a path, `file://…` or `package://NAME/…`), `scale` (one factor for each axis), `position` (m), `rpy` (rad) | `scale = [1, 1, 1]`, `position = [0, 0, 0]`, `rpy = [0, 0, 0]` |
///
/// `rpy` are roll, pitch and yaw about the fixed x, y and z axes, as in URDF.
///
/// ## `[contact]`
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `law` | string | `"frictionless"` | impact law of a single contact: `"frictionless"`, `"whittaker"`, `"newton"`, `"poisson"`, `"energetic"` (Stronge), `"chatterjee-ruina"`, `"brach"` or `"smith"` |
/// | `restitution` | 0 … 1 | `0` | coefficient of restitution e, in the sense of the law. Compliant contacts need e > 0 |
/// | `tangential_restitution` | −1 … 1 | `0` | coefficient of tangential restitution of an impact of a single contact under `"chatterjee-ruina"`; no other law uses it |
/// | `friction` | ≥ 0 | `0` | Coulomb's coefficient μ, of impacts and of lasting contacts. With the law `"frictionless"` it does not act in impacts of a single contact |
/// | `limit_restitution` | 0 … 1 | `0` | Newton's coefficient of restitution at joint limits |
/// | `latch` | boolean | `false` | the first contact stops the contact point and holds it from then on |
/// | `several` | string | `"moreau"` | law for several contacts at the same time, in impacts and time steps: `"moreau"` (Newton's restitution at all contacts), `"poisson"` (compression of all, then restitution of all), `"sequential"` (one impact after another, always at the contact with the highest approach velocity) or `"energetic"` (impulses in the ratios that stiffnesses and stored energies give; no contact may have friction). Each contact keeps its `restitution` and `friction`; its `law` is not used |
/// | `several_exponent` | 1 … 10 | `1.5` | exponent of the normal force over the penetration under `several = "energetic"`: 1 for flat contacts, 1.5 for round bodies |
/// | `relative_stiffness` | > 0 | `1` | stiffness relative to other contacts, by which they share an impact under `several = "energetic"`; no other law uses it. That of joint limits is 1 unless a pair gives it |
/// | `links` | list of pairs of link names, or `"all"` | `[]` | links that may touch each other, e.g. `[["ball1", "ball2"]]`, or those of [`Touch::within_robots`]. Other pairs of links of one robot are ignored |
/// | `between_robots` | boolean | `true` | whether links of different robots may touch without being listed: [`Touch::between_robots`]. For several robots only |
/// | `compliance` | table, see below, or `"rigid"` | `"rigid"` | makes contacts with surfaces and between links compliant: forces during a finite contact time instead of impulses. A compliant contact uses neither `law` nor `latch`. Any number may press at once, beside rigid ones. Joint limits are rigid. Of spheres, and of any shape on half-spaces, with a force at each of its corners and rims that touches; refused for other pairs of bodies. Not together with `method = "steps"` |
///
/// `compliance = { … }`:
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `stiffness` | > 0; N/m, for `"hunt-crossley"` N/mⁿ | required | k |
/// | `force` | string | `"hunt-crossley"` | normal force over the penetration d: `"hunt-crossley"` k dⁿ (1 + a ḋ), `"kelvin-voigt"` k d + c ḋ, or `"walton-braun"` (k d in loading, a steeper line in unloading). Damping follows from `restitution` |
/// | `exponent` | 0.1 … 10 | `1.5` | n; `"hunt-crossley"` only |
/// | `damping` | string | `"exact"` | formula for a; `"hunt-crossley"` only. `"exact"` gives the rebound e exactly; the others are published approximations: `"hunt-crossley"`, `"herbert-mcwhannell"`, `"lee-wang"`, `"lankarani-nikravesh"`, `"gonthier"`, `"zhiying-qishao"`, `"flores"`, `"hu-guo"` (see [`Damping`](carom_impact::Damping)) |
/// | `pulls` | boolean | `false` | whether the force may be tensile while the bodies separate; `"kelvin-voigt"` only |
/// | `slip_speed` | > 0, m/s | `1e-3` | v_s of the smoothed Coulomb friction μ Fₙ tanh(v/v_s). Not together with `bristle` |
/// | `bristle` | table of `stiffness` (> 0, N/m) and `damping` (> 0, N s/m), both required | – | friction by a bristle, which sticks, instead of smoothed friction |
///
/// ## `[[contact.pair]]` (one table for each exception)
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `link` | link name, or the name of one of several robots | every link | contacts of this link, or of all links of the robot |
/// | `surface` | the same, or surface name | every surface | contacts with this surface or link; a pair of links has no order |
/// | `joint` | joint name | – | the limits of this joint. Not together with `link` or `surface` |
/// | `law`, `restitution`, `tangential_restitution`, `friction`, `latch`, `compliance`, `relative_stiffness` | as in `[contact]` | those of the surface | values at these contacts. With `joint` only `restitution`, `latch` and `relative_stiffness` are allowed |
///
/// At least one of `link`, `surface` and `joint` is required. `[contact]` is overruled by `contact` of the surface, and this by
/// `[[contact.pair]]`; of several that apply to a contact, the last one that sets a value decides. A `compliance` replaces the whole
/// table, so that its other keys have their defaults.
///
/// ## `[[spring]]` (one table for each passive spring)
///
/// `joint` (a hinge or slider), `rest` (rad, m; default 0), `stiffness` (N m/rad, N/m; required), `damping` (N m s/rad, N s/m;
/// default 0): see [`Spring`](crate::Spring).
///
/// ## `[[force]]` (one table for each force from outside)
///
/// `link`, `point` (m, in the axes of the link; default its origin), `axes` (`"world"` or `"body"`; default `"world"`), and
/// either `force` (N), `torque` (N m) or both, or `file`: a table with the columns `time`, `fx`, `fy`, `fz`, `tx`, `ty`, `tz`,
/// of which missing ones are 0. See [`Wrench`](crate::Wrench).
///
/// ## `[[loop]]` (one table for each joint that closes a loop)
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `name` | string | `"loop 1"`, `"loop 2"`, … | name in messages |
/// | `joint` | string | required | what it leaves free: `"point"` (a ball joint), `"pin"` (a hinge) or `"weld"` (nothing) |
/// | `first`, `second` | tables of `link`, `xyz` (m), `rpy` (rad) | –, zero, zero | the two frames that are joined, in the axes of their links; without `link` in the world |
/// | `axis` | 3 numbers | `[0, 0, 1]` | axis of a pin, in the axes of both frames |
///
/// The start is moved to the nearest state that closes the loops, in the metric of M, with a warning. See
/// [`Loop`](crate::Loop).
///
/// Tables are CSV or (by the ending `.parquet`) Parquet files, with columns by name in any order. They are linear between
/// rows; the integration stops and starts again at every row.
///
/// ## `[run]`
///
/// | key | type, unit | default | meaning |
/// | --- | --- | --- | --- |
/// | `duration` | > 0, s | required | simulated time |
/// | `gravity` | 3 numbers, m/s² | `[0, 0, 0]` | acceleration of free fall |
/// | `tolerance` | > 0 | `1e-9` | relative tolerance of each integration step; the absolute one is 1e-3 of it |
/// | `max_step` | > 0, s | `0.1` | longest integration step |
/// | `sample` | > 0, s | – | time between the samples of tables and recordings; `carom simulate` takes 0.004 s without it |
/// | `zeno_time` | > 0, s | √(0.1 · `tolerance`) | if all remaining impacts of an accumulation (Zeno) end within this time, they are replaced by their limit |
/// | `contact_step` | > 0, s | `1e-3` | longest time step, where time steps are computed; with `method = "steps"` the length of all |
/// | `max_events` | integer | `100000` | the run stops after this number of events |
/// | `method` | string | `"events"` | `"events"`: event-driven, with time steps only where events cannot follow the motion ([`StepReason`](crate::StepReason)); `"steps"`: Moreau–Jean time steps of `contact_step` throughout |
/// | `model` | string | `"auto"` | `"auto"`: with the exact reductions of [`Scene::plan`]; `"full"`: without any reduction |
/// | `neglect` | above 0, below 1 | nothing is neglected | relative tolerance for approximations, each with a reported bound: see [`Simulation::neglect`]. Ignored with `model = "full"` |
/// | `controller` | string | `"off"` | what drives the joints, see below |
/// | `after_impact` | string | that of `controller` | controller from the first impact on |
///
/// | controller | keys of `[run]` that it reads | joint forces |
/// | --- | --- | --- |
/// | `"off"` | – | zero |
/// | `"constant"` | `torque` (nv numbers; N m, N; required) | constant |
/// | `"torque-file"` | `torque_file` (required) | interpolated linearly over time, constant before the first and after the last row. Columns: `time` (s, ascending), and the name of every joint with one coordinate (N m, N). A CSV file whose first line has no names has the time, then nv joint forces in the order of qd |
/// | `"pd"` | `kp` (N m/rad, N/m), `kd` (N m s/rad, N s/m), `target`; all required | `kp (target − q) − kd qd` at the joints with one coordinate |
/// | `"tracking"` | `reference` (table of positions: `time` and the name of every joint with one coordinate), `kp`, `kd`; all required; `feed_forward` (boolean; default `true` if every joint has one coordinate) | [`Tracking`](crate::Tracking) of cubic splines through the positions |
/// | `"gravity-compensation"` | – | those that balance gravity, at the joints with one coordinate. A floating base falls |
/// | `"transition"` | `gain` (1/s, required), `press` (m/s², default `0`), `compensate` (boolean, default `true`) | transition from free motion to contact, see [`Transition`](crate::Transition). The desired tip velocity is that at the start. The first surface must be a half-space |
/// | `"impact-invariant"` | `kp`, `kd`, `target` as for `"pd"`; all required | [`ImpactInvariant`](crate::ImpactInvariant) feedback with the desired velocity zero. The first surface must be a half-space. No floating joints |
///
/// `kp` and `kd` are one number, a list (nv numbers, or one for each joint with one coordinate), or a table by joint name, in
/// which joints that are not named have 0. `target` is nq numbers, or a table by joint name, in which joints that are not named
/// keep their position at the start. With `effort_limits = true` the motors obey the effort limits of the URDF.
///
/// `perturb = { q, qd, seed, distribution }`: random disturbances of the start for many runs ([`Perturbation`]). `q` and `qd`
/// are sizes as `kp`, `distribution` is `"normal"` (default) or `"uniform"`.
///
/// A key that neither `controller` nor `after_impact` reads is refused. The damping and the dry friction of the URDF's
/// `<dynamics>` act in addition to every controller.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The simulation of the whole chain; [`Scene::plan`] reduces it.
    pub simulation: Simulation,
    /// Configuration at the start, length nq; rad, m, quaternion.
    pub q: Vec<f64>,
    /// Joint velocities at the start, length nv; rad/s, m/s.
    pub qd: Vec<f64>,
    /// Duration, s.
    pub duration: f64,
    /// Interval between samples, s; `None` if the file has no `sample`.
    pub sample: Option<f64>,
    /// Random disturbances of the start; `None` if the file has no `perturb`.
    pub perturbation: Option<Perturbation>,
    /// The surfaces, in the order of the file.
    pub surfaces: Vec<Surface>,
    /// The link that is the tip; `None` if the file names none and the robot has no link `tip`.
    pub tip: Option<String>,
    /// Pairs of a link and a surface that can't touch, each with its reason.
    pub out_of_reach: Vec<(String, LeftOut)>,
    /// `model = "full"`: [`Scene::plan`] makes no reductions.
    pub full: bool,
    /// The text of the scene file.
    pub text: String,
    /// Every file that was read: scene, robot, meshes of robot and surfaces, tables.
    pub files: Vec<PathBuf>,
    /// Warnings: a start outside joint limits, a `[[contact.pair]]` that applies to no contact. Those about the robot are in
    /// [`Chain::report`](carom_chain::Chain::report).
    pub warnings: Vec<String>,
}

/// Changes of the start up to this size are not reported, rad, m, rad/s, m/s: the digits of a file.
const NOTICED: f64 = 1e-9;

impl Scene {
    /// Reads a scene file, its robot and its meshes.
    ///
    /// # Errors
    /// [`SimError::Scene`] with file, key, value and rule; [`SimError::Chain`] for an invalid robot or start state.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, SimError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = input::read_text(path, input::MOST_MIB)
            .map_err(|e| SimError::Scene { file: name.clone(), rule: format!("cannot be read: {e}") })?;
        let mut scene = Self::read(&text, name, path.parent().unwrap_or(Path::new(".")))?;
        scene.files.insert(0, path.to_owned());
        Ok(scene)
    }

    /// Reads a scene from the text of a scene file. File names in it are relative to `folder`.
    ///
    /// # Errors
    /// As [`Scene::from_file`]; the file of the messages is `<scene>`.
    pub fn from_toml(text: &str, folder: impl AsRef<Path>) -> Result<Self, SimError> {
        Self::read(text, "<scene>".into(), folder.as_ref())
    }

    fn read(text: &str, name: String, folder: &Path) -> Result<Self, SimError> {
        let refuse = |rule: String| SimError::Scene { file: name.clone(), rule };
        let file: File = from_toml(text).map_err(refuse)?;

        let in_folder = |names: Vec<&PathBuf>| names.into_iter().map(|name| folder.join(name)).collect::<Vec<_>>();
        let (files, package_dirs) = (in_folder(file.tables()), in_folder(file.robot.package_dirs()));
        let places = Places { folder, package_dirs: &package_dirs };
        let robots = file.robot.load(folder, &refuse)?;
        let chain = robots.chain.clone();
        let rule = rule(&file.contact).map_err(|why| refuse(format!("[contact] {why}")))?;
        rule.check("[contact]").map_err(|e| refuse(e.to_string()))?;
        let surfaces = file.surface.iter().enumerate();
        let surfaces = surfaces.map(|(k, it)| surface(places, k, it, &rule).map_err(&refuse));
        let surfaces: Vec<Surface> = surfaces.collect::<Result<_, _>>()?;
        let mut names = HashSet::new();
        if let Some(twin) = surfaces.iter().find(|it| !names.insert(it.name.as_str())) {
            return Err(refuse(format!(
                "[[surface]] name = \"{}\": two surfaces have this name, rename one",
                twin.name
            )));
        }
        let mut q = robots.q.clone();
        let mut qd = robots.velocities(&surfaces, !file.loops.is_empty(), &refuse)?;

        let mut warnings: Vec<String> = chain.outside_limits(&q).iter().map(ToString::to_string).collect();
        let full = file.run.model == Model::Full;
        let limits = file.contact.limit_restitution;
        let Touches { mut touches, mut left_out } = if full {
            Touches { touches: Touch::every(&chain, &surfaces, limits)?, left_out: Vec::new() }
        } else {
            Touch::all(&chain, &surfaces, limits)?
        };
        let linked = between_links(&file.contact, &chain, &rule, &refuse)?;
        touches.extend(linked.touches);
        left_out.extend(linked.left_out);
        for pair in &file.contact.pair {
            let met = apply(pair, &chain, &surfaces, &mut touches);
            if !met.map_err(|why| refuse(format!("[[contact.pair]] {why}")))? {
                let named = [("link", &pair.link), ("surface", &pair.surface), ("joint", &pair.joint)];
                let named = named.iter().filter_map(|(key, name)| Some(format!("{key} = \"{}\"", name.as_ref()?)));
                let named: Vec<String> = named.collect();
                warnings.push(format!("[[contact.pair]] {}: applies to no contact of this scene", named.join(", ")));
            }
        }
        let touches = Touch::divided(touches);
        warnings.extend(unused(&file.contact, &file.surface, &touches));
        let (drive, after_impact) = robots.drives(folder, &file.run.control(), &surfaces, &qd).map_err(&refuse)?;
        let springs = file.spring.iter().enumerate().map(|(k, it)| spring(&chain, k, it));
        let mut springs = springs.collect::<Result<Vec<_>, _>>().map_err(&refuse)?;
        for spring in robots.springs() {
            spring.on(&chain).map_err(|e| refuse(format!("[[robot.beam]]: {e}")))?;
            springs.push(spring);
        }
        let wrenches = file.force.iter().enumerate().map(|(k, it)| wrench(folder, &chain, k, it));
        let wrenches = wrenches.collect::<Result<Vec<_>, _>>().map_err(&refuse)?;
        let loops = file.loops.iter().enumerate().map(|(k, it)| closure(&chain, k, it));
        let loops = loops.collect::<Result<Vec<_>, _>>().map_err(&refuse)?;
        let perturbation = file.run.perturb.as_ref().map(|given| {
            let size = |key: &str, given: &Option<file::PerJoint>| match given {
                Some(file::PerJoint::Same(size)) => Ok(vec![*size; chain.nv()]),
                Some(given) => per_joint(key, given, &chain),
                None => Ok(vec![0.0; chain.nv()]),
            };
            let (q, qd) = (size("perturb.q", &given.q)?, size("perturb.qd", &given.qd)?);
            match q.iter().chain(&qd).find(|x| !(x.is_finite() && **x >= 0.0)) {
                Some(x) => Err(format!("perturb has the size {x}: it must be finite and not negative")),
                None => Ok(Perturbation { q, qd, seed: given.seed, distribution: given.distribution }),
            }
        });
        let perturbation = perturbation.transpose().map_err(|why| refuse(format!("[run] {why}")))?;
        warnings.extend(robots.falling([Some(&drive), after_impact.as_ref()]));
        if file.run.neglect.is_some_and(|share| !(share > 0.0 && share < 1.0)) {
            let share = file.run.neglect.unwrap_or_default();
            return Err(refuse(format!("[run] neglect = {share}: it must be above 0 and below 1")));
        }
        let tip = robots.tip().map_err(&refuse)?;
        if let Some(sample) = file.run.sample.filter(|sample| !(*sample > 0.0 && sample.is_finite())) {
            return Err(refuse(format!("[run] sample = {sample}: it must be positive and finite")));
        }
        let simulation = Simulation {
            gravity: file.run.gravity.into(),
            drive,
            after_impact,
            springs,
            wrenches,
            loops,
            effort_limits: file.run.effort_limits,
            tolerance: file.run.tolerance,
            max_step: file.run.max_step.unwrap_or(0.1),
            zeno_time: file.run.zeno_time.unwrap_or_else(|| Simulation::zeno_time_for(file.run.tolerance)),
            contact_step: file.run.contact_step,
            several: several(&file.contact).map_err(|why| refuse(format!("[contact] {why}")))?,
            stepping: file.run.method == Method::Steps,
            max_events: file.run.max_events,
            planar: !full,
            neglect: if full { None } else { file.run.neglect },
            ..Simulation::new(chain, touches)
        };
        let (start, change) = simulation.close_loops(&q, &qd).map_err(|e| refuse(e.to_string()))?;
        if change > NOTICED {
            let new = format!("q = {:?}, qd = {:?}", start.q, start.qd);
            warnings.push(format!("[robot] the start does not close the loops: moved by up to {change:.3e} to {new}"));
        }
        (q, qd) = (start.q, start.qd);
        warnings.extend(closed_at_start(&simulation, &q)?);
        let obstacles = file.surface.iter().filter_map(|it| match &it.shape {
            Shape::Mesh { file, .. } => places.mesh(file).ok(),
            _ => None,
        });
        let collisions = simulation.chain.links().iter().flat_map(|link| &link.collisions).map(|it| &it.shape);
        let visuals = simulation.chain.links().iter().flat_map(|link| &link.visuals).map(|it| &it.shape);
        let meshes = collisions.chain(visuals).filter_map(|shape| match shape {
            carom_chain::urdf::Shape::Mesh { file, .. } => Some(file.clone()),
            _ => None,
        });
        let files = files.into_iter().chain(obstacles).chain(meshes).collect();
        let (duration, sample) = (file.run.duration, file.run.sample);
        Ok(Self {
            simulation,
            q,
            qd,
            duration,
            sample,
            perturbation,
            surfaces,
            tip,
            out_of_reach: left_out,
            full,
            text: text.to_owned(),
            files,
            warnings,
        })
    }
}

/// What a user may not expect of the contacts that are closed at the start: those without a row, and compliant ones that are pressed.
fn closed_at_start(simulation: &Simulation, q: &[f64]) -> Result<Vec<String>, SimError> {
    let (chain, time) = (&simulation.chain, simulation.start_time);
    let (couplings, mut workspace) = (simulation.couplings::<Spatial<f64>>(chain), chain.workspace());
    let mut view = View::closed_by(chain, &mut workspace, q, &couplings)?;
    let mut warnings = Vec::new();
    for touch in simulation.touches.iter().filter(|touch| touch.link().is_some() && touch.is_covered()) {
        let at = touch.at(&view, q, time);
        if at.gap > NOTICED || !at.counts() {
            continue;
        }
        if !touch.moves(&at, &mut view)? {
            let pair = format!("{} on {}", touch.link().unwrap_or_default(), touch.surface().unwrap_or_default());
            let warning = format!(
                "[robot] {pair} is closed at the start, and no joint moves the contact along its normal: it has neither force nor \
                 friction"
            );
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        if let Some(compliance) = touch.contact.compliance.filter(|_| at.gap < -NOTICED) {
            warnings.push(format!(
                "[robot] {} starts {} m deep in its compliance ({compliance}): the energy stored in it comes in as work of the contact, \
                 start with an open gap unless this is meant",
                touch.name, -at.gap
            ));
        }
    }
    Ok(warnings)
}

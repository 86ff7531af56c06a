//! Scenes: a robot among surfaces, written in TOML.
//!
//! ```toml
//! [robot]
//! urdf = "robots/planar2.urdf"        # relative to the scene file
//! q = [0.7854, -1.5708]
//! tip_velocity = { speed = 0.2, angle_deg = 45, along = [0, -1, 0] }   # or qd = [..]
//!
//! [[surface]]
//! shape = { halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] } }
//!
//! [contact]
//! law = "energetic"
//! restitution = 0.35
//! friction = 0.0
//!
//! [run]
//! duration = 0.5
//! ```
//!
//! A half-space's normal points out of it, to the robot's side. `angle_deg` is the angle between the tip's path and the
//! first surface, `along` the direction of the path's shadow on it.
//!
//! | table | keys, with what they are without being given |
//! | --- | --- |
//! | `[robot]` | `urdf`, `q`, `qd` or `tip_velocity`, `tip = "tip"`, `floating = false` |
//! | `[[surface]]` | `name`, `shape` = `halfspace {point, normal}`, `box {centre, size, rpy}`, `sphere {centre, radius}` or `mesh {file, scale, position, rpy}`; `contact {law, restitution, friction, latch}` where it differs; `motion {amplitude, frequency (Hz), phase}` |
//! | `[contact]` | `law = "frictionless"`, `restitution = 0`, `friction = 0`, `limit_restitution = 0`, `latch = false`, `several = "moreau"`, `"poisson"` or `"sequential"` for contacts at one time; `links = [["a", "b"], …]` for links that may touch each other; `compliance` for contacts that give way |
//! | `compliance` | `stiffness` (N/m, N/mⁿ); `force = "hunt-crossley"` (`exponent = 1.5`, from 0.1 to 10, `damping = "exact"` or a published formula's name, see [`Damping`]), `"kelvin-voigt"` (`pulls = false`) or `"walton-braun"`; `slip_speed = 1e-3` below which friction is smoothed, or `bristle {stiffness (N/m), damping (N s/m)}`, which sticks |
//! | `[[contact.pair]]` | `link` and/or `surface` (or the other link of a pair), or `joint` (its limits); `law`, `restitution`, `friction`, `latch` there |
//! | `[run]` | `duration`, `tolerance = 1e-9`, `gravity = [0, 0, 0]`, `sample`, `max_step = 0.1`, `zeno_time = 1e-5`, `contact_step = 1e-3`, `max_events = 100000`, `method = "events"` or `"steps"` (of `contact_step` throughout), `model = "auto"` or `"full"`, `neglect` |
//! | `[run]`, drive | `controller = "off"`, `"constant"` (`torque`), `"torque-file"` (`torque_file`: CSV, time and one column per joint), `"pd"` (`kp`, `kd`, `target`), `"gravity-compensation"`, `"transition"` (`gain`, `press`, `compensate`), `"impact-invariant"` (`kp`, `kd`, `target`); `after_impact`: the same choice from the first impact on |

use crate::compliance::{Compliance, Holding, Yielding};
use crate::error::SimError;
use crate::scene_drive::Drives;
use crate::scene_file::{self, File, Method, Model, Robot, Shape, TipVelocity};
use crate::simulate::Simulation;
use crate::touch::{ContactRule, Oscillation, Surface, Touch, Touches};
use carom_chain::urdf::{LoadOptions, Meshes};
use carom_chain::{Chain, ChainError};
use carom_contact::{LeftOut, Obstacle};
use carom_impact::{Damping, LAW_NAMES, NormalForce};
use nalgebra::{DVector, Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// A scene as the file says it, with everything it names loaded.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The whole chain among its surfaces; [`Scene::plan`] makes it as small as it may be.
    pub simulation: Simulation,
    /// Configuration at the start.
    pub q: Vec<f64>,
    /// Joint velocities at the start.
    pub qd: Vec<f64>,
    /// Duration, s.
    pub duration: f64,
    /// Interval between samples, s.
    pub sample: Option<f64>,
    /// The surfaces.
    pub surfaces: Vec<Surface>,
    /// The link whose path is shown, if the robot has it.
    pub tip: Option<String>,
    /// Pairs that can't touch, each with its reason.
    pub out_of_reach: Vec<(String, LeftOut)>,
    /// `model = "full"`: nothing is left out.
    pub full: bool,
    /// Every file that was read: the scene's own, the robot's and its meshes, meshes of surfaces, torques.
    pub files: Vec<PathBuf>,
    /// What looks odd.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// [`SimError::Scene`] with file, key, value and rule; what the robot's file and the start state are refused for.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, SimError> {
        let path = path.as_ref();
        let refuse = |rule: String| SimError::Scene { file: path.display().to_string(), rule };
        let text = std::fs::read_to_string(path).map_err(|e| refuse(format!("cannot be read: {e}")))?;
        let file: File = from_toml(&text).map_err(refuse)?;
        let folder = path.parent().unwrap_or(Path::new("."));

        let options = LoadOptions { floating_base: file.robot.floating, meshes: Meshes::Required };
        let chain = Chain::from_urdf_file_with(folder.join(&file.robot.urdf), &options)?;
        let rule = ContactRule {
            law: law(&file.contact.law).map_err(|why| refuse(format!("[contact] {why}")))?,
            restitution: file.contact.restitution,
            friction: file.contact.friction,
            latch: file.contact.latch,
            compliance: file
                .contact
                .compliance
                .as_ref()
                .map(compliance)
                .transpose()
                .map_err(|why| refuse(format!("[contact] compliance {why}")))?,
        };
        rule.check("[contact]").map_err(|e| refuse(e.to_string()))?;
        let surfaces = file.surface.iter().enumerate();
        let surfaces = surfaces.map(|(k, it)| surface(folder, k, it, rule).map_err(&refuse));
        let surfaces: Vec<Surface> = surfaces.collect::<Result<_, _>>()?;
        if let Some((_, twin)) =
            surfaces.iter().enumerate().find(|(k, it)| surfaces[..*k].iter().any(|o| o.name == it.name))
        {
            return Err(refuse(format!("[[surface]] name = \"{}\": two surfaces have it, rename one", twin.name)));
        }
        chain.check_state(&file.robot.q, &vec![0.0; chain.nv()])?;
        let qd = match (&file.robot.qd, &file.robot.tip_velocity) {
            (Some(qd), None) => qd.clone(),
            (None, None) => vec![0.0; chain.nv()],
            (Some(_), Some(_)) => return Err(refuse("[robot] has both qd and tip_velocity: give one of them".into())),
            (None, Some(tip)) => tip_velocity(&chain, &file.robot, tip, surfaces.first()).map_err(&refuse)?,
        };
        chain.check_state(&file.robot.q, &qd)?;

        let mut warnings: Vec<String> = chain.outside_limits(&file.robot.q).iter().map(ToString::to_string).collect();
        let full = file.run.model == Model::Full;
        let limits = file.contact.limit_restitution;
        let Touches { mut touches, left_out } = if full {
            Touches { touches: Touch::every(&chain, &surfaces, limits)?, left_out: Vec::new() }
        } else {
            Touch::all(&chain, &surfaces, limits)?
        };
        for (k, [link, other]) in file.contact.links.iter().enumerate() {
            let twin = |pair: &[String; 2]| pair.contains(link) && pair.contains(other);
            if link != other && file.contact.links[..k].iter().any(twin) {
                return Err(refuse(format!(
                    "[contact] links = [\"{link}\", \"{other}\"]: the pair is there twice, leave one out"
                )));
            }
            let pair = Touch::between(&chain, link, other, rule);
            touches.extend(pair.map_err(|e| refuse(format!("[contact] links = [\"{link}\", \"{other}\"]: {e}")))?);
        }
        for pair in &file.contact.pair {
            let met = apply(pair, &chain, &surfaces, &mut touches);
            if !met.map_err(|why| refuse(format!("[[contact.pair]] {why}")))? {
                let named = [("link", &pair.link), ("surface", &pair.surface), ("joint", &pair.joint)];
                let named = named.iter().filter_map(|(key, name)| Some(format!("{key} = \"{}\"", name.as_ref()?)));
                let named: Vec<String> = named.collect();
                warnings.push(format!("[[contact.pair]] {}: no such contact can happen here", named.join(", ")));
            }
        }
        let drives = Drives { folder, file: &file, chain: &chain, surfaces: &surfaces, qd: &qd };
        let drive = drives.drive("controller", file.run.controller).map_err(&refuse)?;
        let after_impact = file.run.after_impact.map(|c| drives.drive("after_impact", c));
        let after_impact = after_impact.transpose().map_err(&refuse)?;
        drives.check_unused().map_err(&refuse)?;
        if file.run.neglect.is_some_and(|share| !(share > 0.0 && share < 1.0)) {
            let share = file.run.neglect.unwrap_or_default();
            return Err(refuse(format!("[run] neglect = {share}: it is a share, above 0 and below 1")));
        }
        let tip = match chain.frame(&file.robot.tip) {
            Ok(_) => Some(file.robot.tip.clone()),
            Err(_) if file.robot.tip == scene_file::tip() => None,
            Err(unknown) => return Err(refuse(format!("[robot] tip = \"{}\": {unknown}", file.robot.tip))),
        };
        if let Some(sample) = file.run.sample.filter(|sample| !(*sample > 0.0 && sample.is_finite())) {
            return Err(refuse(format!("[run] sample = {sample}: it must be positive and finite")));
        }
        let simulation = Simulation {
            gravity: file.run.gravity.into(),
            drive,
            after_impact,
            tolerance: file.run.tolerance,
            max_step: file.run.max_step.unwrap_or(0.1),
            zeno_time: file.run.zeno_time,
            contact_step: file.run.contact_step,
            several: file.contact.several,
            stepping: file.run.method == Method::Steps,
            max_events: file.run.max_events,
            planar: !full,
            neglect: if full { None } else { file.run.neglect },
            ..Simulation::new(chain, touches)
        };
        let named = [Some(&file.robot.urdf), file.run.torque_file.as_ref()].into_iter().flatten();
        let meshes = file.surface.iter().filter_map(|it| match &it.shape {
            Shape::Mesh { file, .. } => Some(file),
            _ => None,
        });
        let named = named.chain(meshes).map(|file| folder.join(file));
        let shapes = simulation.chain.links().iter().flat_map(|link| &link.collisions);
        let meshes = shapes.filter_map(|collision| match &collision.shape {
            carom_chain::urdf::Shape::Mesh { file, .. } => Some(file.clone()),
            _ => None,
        });
        let files = std::iter::once(path.to_owned()).chain(named).chain(meshes).collect();
        let (q, duration, sample) = (file.robot.q, file.run.duration, file.run.sample);
        Ok(Self { simulation, q, qd, duration, sample, surfaces, tip, out_of_reach: left_out, full, files, warnings })
    }
}

/// Reads TOML. What is wrong is said with the line, its text where no key is named, and the nearest name.
///
/// # Errors
/// The message.
#[doc(hidden)] // shared with the other files of this workspace that are written in TOML
pub fn from_toml<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|e: toml::de::Error| {
        let line = e.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        let message = suggest(e.message());
        // Only complaints about fields name a key.
        let quoted = text.lines().nth(line - 1).filter(|_| !message.contains(" field `")).map(str::trim);
        quoted.map_or_else(|| format!("line {line}: {message}"), |it| format!("line {line}, {it}: {message}"))
    })
}

/// serde names the unknown key and the known ones: name the nearest.
fn suggest(message: &str) -> String {
    let message = message.trim_end().replace('\n', "; ");
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next().filter(|_| message.contains("unknown")) else { return message.clone() };
    let near = quoted.map(|name| (strsim::jaro_winkler(unknown, name), name)).max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, name)) if likeness > 0.7 => format!("{message}; did you mean `{name}`?"),
        _ => message.clone(),
    }
}

fn law(name: &str) -> Result<&'static str, String> {
    let found = LAW_NAMES.into_iter().find(|&known| known == name);
    found.ok_or_else(|| format!("law = \"{name}\": the laws are {}", LAW_NAMES.join(", ")))
}

fn compliance(given: &scene_file::Compliance) -> Result<Compliance, String> {
    let scene_file::Compliance { stiffness, force, exponent, damping, pulls, slip_speed, bristle } = given;
    let names = NormalForce::NAMES;
    let force = force.as_deref().unwrap_or(names[0]);
    let normal = match names.iter().position(|&name| name == force) {
        Some(0) => {
            let named = |name: &String| {
                let known = || Damping::ALL.map(Damping::name).join(", ");
                Damping::by_name(name).ok_or_else(|| format!("damping = \"{name}\": the formulas are {}", known()))
            };
            let damping = damping.as_ref().map_or(Ok(Damping::Exact), named)?;
            Yielding::HuntCrossley { exponent: exponent.unwrap_or(1.5), damping }
        }
        Some(1) => Yielding::KelvinVoigt { pulls: pulls.unwrap_or(false) },
        Some(_) => Yielding::WaltonBraun,
        None => return Err(format!("force = \"{force}\": the forces are {}", names.join(", "))),
    };
    let owned = [("exponent", exponent.is_some(), 0), ("damping", damping.is_some(), 0), ("pulls", pulls.is_some(), 1)];
    if let Some((key, _, owner)) = owned.into_iter().find(|&(_, given, owner)| given && names[owner] != force) {
        return Err(format!("{key} belongs to force = \"{}\"", names[owner]));
    }
    let tangential = match (slip_speed, bristle) {
        (Some(_), Some(_)) => {
            return Err("has slip_speed and bristle: smoothed friction has no bristle, give one".into());
        }
        (_, Some(bristle)) => Holding::Bristle { stiffness: bristle.stiffness, damping: bristle.damping },
        (speed, None) => Holding::Smoothed { slip_speed: speed.unwrap_or(1e-3) },
    };
    Ok(Compliance { stiffness: *stiffness, normal, tangential })
}

fn surface(folder: &Path, k: usize, surface: &scene_file::Surface, rule: ContactRule) -> Result<Surface, String> {
    let name = surface.name.clone().unwrap_or_else(|| format!("surface {}", k + 1));
    let placed = |centre: [f64; 3], rpy: [f64; 3]| {
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        Isometry3::from_parts(Translation3::from(Vector3::from(centre)), turn)
    };
    let obstacle = match &surface.shape {
        Shape::Halfspace { point, normal } => Obstacle::half_space((*point).into(), (*normal).into()),
        Shape::Box { centre, size, rpy } => Obstacle::cuboid(placed(*centre, *rpy), (*size).into()),
        Shape::Sphere { centre, radius } => Obstacle::sphere((*centre).into(), *radius),
        Shape::Mesh { file, scale, position, rpy } => {
            Obstacle::mesh_file(&folder.join(file), (*scale).into(), placed(*position, *rpy))
        }
    };
    let obstacle = obstacle.map_err(|e| format!("[[surface]] '{name}': {e}"))?;
    let own = &surface.contact;
    let contact = overridden(rule, own.law.as_deref(), own.restitution, own.friction, own.latch)
        .map_err(|why| format!("[[surface]] '{name}': contact {why}"))?;
    contact.check(&format!("[[surface]] '{name}'")).map_err(|e| e.to_string())?;
    let motion = surface.motion.as_ref().map(|motion| Oscillation {
        amplitude: motion.amplitude.into(),
        frequency: motion.frequency * std::f64::consts::TAU,
        phase: motion.phase,
    });
    if let Some(Oscillation { amplitude, frequency, phase }) = &motion
        && !(amplitude.iter().all(|x| x.is_finite()) && frequency.is_finite() && phase.is_finite())
    {
        return Err(format!("[[surface]] '{name}': motion has numbers that are not finite"));
    }
    Ok(Surface { name, obstacle, contact, motion })
}

fn overridden(
    rule: ContactRule,
    named: Option<&str>,
    restitution: Option<f64>,
    friction: Option<f64>,
    latch: Option<bool>,
) -> Result<ContactRule, String> {
    Ok(ContactRule {
        law: named.map(law).transpose()?.unwrap_or(rule.law),
        restitution: restitution.unwrap_or(rule.restitution),
        friction: friction.unwrap_or(rule.friction),
        latch: latch.unwrap_or(rule.latch),
        compliance: rule.compliance,
    })
}

/// One `[[contact.pair]]`; says whether there is such a pair.
fn apply(pair: &scene_file::Pair, chain: &Chain, surfaces: &[Surface], touches: &mut [Touch]) -> Result<bool, String> {
    let scene_file::Pair { link, surface, joint, law, restitution, friction, latch } = pair;
    if joint.is_some() == (link.is_some() || surface.is_some()) {
        return Err("names a link and/or a surface, or else a joint (for its limits)".into());
    }
    if let Some(link) = link {
        chain.frame(link).map_err(|e| e.to_string())?;
    }
    let partners = touches.iter().filter_map(Touch::other_link);
    let mut known: Vec<&str> = surfaces.iter().map(|it| it.name.as_str()).chain(partners).collect();
    known.dedup();
    if let Some(name) = surface.as_ref().filter(|name| !known.contains(&name.as_str())) {
        return Err(format!("surface = \"{name}\": the surfaces are {}", known.join(", ")));
    }
    if let Some(joint) = joint {
        chain.joint(joint).map_err(|e| e.to_string())?;
    }
    if joint.is_some() && (law.is_some() || friction.is_some()) {
        return Err("names a joint: its limits know restitution and latch only, leave law and friction out".into());
    }
    let mut met = false;
    for touch in touches {
        let meant = match joint {
            Some(joint) => touch.limit_of() == Some(joint),
            None => {
                touch.limit_of().is_none()
                    && link.as_deref().is_none_or(|link| touch.link() == Some(link))
                    && surface.as_deref().is_none_or(|surface| touch.surface() == Some(surface))
            }
        };
        if meant {
            met = true;
            touch.contact = overridden(touch.contact, law.as_deref(), *restitution, *friction, *latch)?;
            touch.contact.check(&touch.name).map_err(|e| e.to_string())?;
        }
    }
    Ok(met)
}

pub(crate) fn half_space(surface: Option<&Surface>) -> Option<Vector3<f64>> {
    match surface.map(|surface| surface.obstacle.surface()) {
        Some(carom_contact::Surface::HalfSpace { normal, .. }) => Some(*normal),
        _ => None,
    }
}

/// Joint velocities that give the tip its velocity with the least kinetic energy: qd = M⁻¹Jᵀ H⁺ u.
fn tip_velocity(
    chain: &Chain,
    robot: &Robot,
    tip: &TipVelocity,
    surface: Option<&Surface>,
) -> Result<Vec<f64>, String> {
    let say = |e: ChainError| e.to_string();
    let Some(normal) = half_space(surface) else {
        return Err(
            "[robot] tip_velocity speaks of the first surface, which must be a halfspace: give qd instead".into()
        );
    };
    let along = Vector3::from(tip.along);
    if !(tip.speed.is_finite() && tip.angle_deg.is_finite()) {
        let (speed, angle) = (tip.speed, tip.angle_deg);
        return Err(format!("[robot] tip_velocity: speed {speed} and angle_deg {angle} must be finite"));
    }
    let alpha = tip.angle_deg.to_radians();
    let shadow = (along - normal * normal.dot(&along)).try_normalize(1e-12);
    if shadow.is_none() && alpha.cos().abs() > 1e-12 {
        let [x, y, z] = tip.along;
        return Err(format!(
            "[robot] tip_velocity: along = [{x}, {y}, {z}] has no part along the surface: give a direction on it"
        ));
    }
    let shadow = shadow.unwrap_or_else(Vector3::zeros);
    let u = (shadow * alpha.cos() - normal * alpha.sin()) * tip.speed;
    let point = chain.point(chain.frame(&robot.tip).map_err(say)?, Vector3::zeros());
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(chain, &robot.q).map_err(say)?;
    let inertia = kin.contact_inertia(point).map_err(say)?;
    let force: DVector<f64> = inertia.principal[..inertia.rank]
        .iter()
        .map(|(direction, sigma)| {
            direction * (direction.dot(&DVector::from_column_slice(u.as_slice())) / (sigma * sigma))
        })
        .fold(DVector::zeros(3), |sum, part| sum + part);
    let mut impulse = vec![0.0; chain.nv()];
    kin.add_point_force(point, Vector3::new(force[0], force[1], force[2]), &mut impulse).map_err(say)?;
    let qd = kin.solve(&impulse).map_err(say)?;
    let reached = kin.point_velocity(point, qd.as_slice()).map_err(say)?;
    if (reached - u).norm() > 1e-9 * tip.speed.abs() {
        let [x, y, z] = u.into();
        return Err(format!(
            "[robot] tip_velocity: at this pose no joint velocities give '{}' ({x}, {y}, {z}) m/s",
            robot.tip
        ));
    }
    Ok(qd.as_slice().to_vec())
}

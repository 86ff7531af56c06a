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

use crate::error::SimError;
use crate::simulate::{ContactRule, Drive, Simulation};
use crate::touch::Touch;
use carom_chain::urdf::{LoadOptions, Meshes};
use carom_chain::{Chain, ChainError};
use carom_contact::Obstacle;
use carom_impact::LAW_NAMES;
use nalgebra::{DVector, Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A scene as the file says it, with everything it names loaded.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The chain among its surfaces.
    pub simulation: Simulation,
    /// Configuration at the start.
    pub q: Vec<f64>,
    /// Joint velocities at the start.
    pub qd: Vec<f64>,
    /// Duration, s.
    pub duration: f64,
    /// Interval between samples, s.
    pub sample: Option<f64>,
    /// What looks odd, or is left out.
    pub warnings: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    robot: Robot,
    #[serde(default)]
    surface: Vec<Surface>,
    #[serde(default)]
    contact: Contact,
    run: Run,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Robot {
    urdf: PathBuf,
    q: Vec<f64>,
    qd: Option<Vec<f64>>,
    tip_velocity: Option<TipVelocity>,
    #[serde(default = "tip")]
    tip: String,
    #[serde(default)]
    floating: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TipVelocity {
    speed: f64,
    angle_deg: f64,
    along: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Surface {
    name: Option<String>,
    shape: Shape,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
enum Shape {
    Halfspace {
        point: [f64; 3],
        normal: [f64; 3],
    },
    Box {
        centre: [f64; 3],
        size: [f64; 3],
        #[serde(default)]
        rpy: [f64; 3],
    },
    Sphere {
        centre: [f64; 3],
        radius: f64,
    },
    Mesh {
        file: PathBuf,
        #[serde(default = "unscaled")]
        scale: [f64; 3],
        #[serde(default)]
        position: [f64; 3],
        #[serde(default)]
        rpy: [f64; 3],
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Contact {
    law: String,
    restitution: f64,
    friction: f64,
    limit_restitution: f64,
}

impl Default for Contact {
    fn default() -> Self {
        Self { law: "frictionless".into(), restitution: 0.0, friction: 0.0, limit_restitution: 0.0 }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Run {
    duration: f64,
    #[serde(default = "tolerance")]
    tolerance: f64,
    #[serde(default)]
    gravity: [f64; 3],
    sample: Option<f64>,
    max_step: Option<f64>,
    #[serde(default = "zeno_time")]
    zeno_time: f64,
    #[serde(default = "max_events")]
    max_events: usize,
    #[serde(default)]
    controller: Controller,
    target: Option<Vec<f64>>,
    kp: Option<f64>,
    kd: Option<f64>,
    torque: Option<Vec<f64>>,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Controller {
    #[default]
    Off,
    Pd,
    Constant,
    GravityCompensation,
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}
fn tip() -> String {
    "tip".into()
}
fn tolerance() -> f64 {
    1e-9
}
/// Above it the formula would be off where the acceleration changes, below it heights of bounces drown in rounding.
fn zeno_time() -> f64 {
    1e-5
}
fn max_events() -> usize {
    100_000
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
        let file: File = toml::from_str(&text).map_err(|e| {
            let line = e.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
            refuse(format!("line {line}: {}", suggest(e.message())))
        })?;
        let folder = path.parent().unwrap_or(Path::new("."));

        let options = LoadOptions { floating_base: file.robot.floating, meshes: Meshes::Required };
        let chain = Chain::from_urdf_file_with(folder.join(&file.robot.urdf), &options)?;
        let surfaces =
            file.surface.iter().enumerate().map(|(k, surface)| obstacle(folder, k, surface).map_err(&refuse));
        let surfaces: Vec<(String, Obstacle)> = surfaces.collect::<Result<_, _>>()?;
        let law = LAW_NAMES.into_iter().find(|&name| name == file.contact.law).ok_or_else(|| {
            refuse(format!("[contact] law = \"{}\": the laws are {}", file.contact.law, LAW_NAMES.join(", ")))
        })?;
        let drive = drive(&file.run).map_err(&refuse)?;
        chain.check_state(&file.robot.q, &vec![0.0; chain.nv()])?;
        let qd = match (&file.robot.qd, &file.robot.tip_velocity) {
            (Some(qd), None) => qd.clone(),
            (None, None) => vec![0.0; chain.nv()],
            (Some(_), Some(_)) => return Err(refuse("[robot] has both qd and tip_velocity: give one of them".into())),
            (None, Some(tip)) => tip_velocity(&chain, &file.robot, tip, surfaces.first()).map_err(&refuse)?,
        };

        let mut warnings: Vec<String> = chain.outside_limits(&file.robot.q).iter().map(ToString::to_string).collect();
        let dry = chain.joints().iter().filter(|j| j.friction > 0.0).map(|j| format!("'{}'", j.name));
        let dry: Vec<String> = dry.collect();
        if !dry.is_empty() {
            warnings.push(format!("dry friction of the joints {} is not simulated", dry.join(", ")));
        }
        let touches = Touch::all(&chain, surfaces)?;
        let duration = file.run.duration;
        let simulation = Simulation {
            touches,
            chain,
            contact: ContactRule {
                law,
                restitution: file.contact.restitution,
                friction: file.contact.friction,
                limit_restitution: file.contact.limit_restitution,
            },
            gravity: file.run.gravity.into(),
            drive,
            tolerance: file.run.tolerance,
            max_step: file.run.max_step.unwrap_or(0.1),
            zeno_time: file.run.zeno_time,
            max_events: file.run.max_events,
        };
        Ok(Self { simulation, q: file.robot.q, qd, duration, sample: file.run.sample, warnings })
    }
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

fn obstacle(folder: &Path, k: usize, surface: &Surface) -> Result<(String, Obstacle), String> {
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
    Ok((name, obstacle))
}

fn drive(run: &Run) -> Result<Drive, String> {
    let needs = |key: &str| format!("[run] controller needs the key {key}");
    let unused = |given: bool, key: &str, controller: &str| {
        if given { Err(format!("[run] {key} belongs to controller = \"{controller}\"")) } else { Ok(()) }
    };
    if run.controller != Controller::Pd {
        unused(run.target.is_some() || run.kp.is_some() || run.kd.is_some(), "target, kp or kd", "pd")?;
    }
    if run.controller != Controller::Constant {
        unused(run.torque.is_some(), "torque", "constant")?;
    }
    Ok(match run.controller {
        Controller::Off => Drive::Off,
        Controller::GravityCompensation => Drive::GravityCompensation,
        Controller::Constant => Drive::Constant(run.torque.clone().ok_or_else(|| needs("torque"))?),
        Controller::Pd => Drive::Pd {
            kp: run.kp.ok_or_else(|| needs("kp"))?,
            kd: run.kd.ok_or_else(|| needs("kd"))?,
            target: run.target.clone().ok_or_else(|| needs("target"))?,
        },
    })
}

/// Joint velocities that give the tip its velocity with the least kinetic energy: qd = M⁻¹Jᵀ H⁺ u.
fn tip_velocity(
    chain: &Chain,
    robot: &Robot,
    tip: &TipVelocity,
    surface: Option<&(String, Obstacle)>,
) -> Result<Vec<f64>, String> {
    let say = |e: ChainError| e.to_string();
    let Some(carom_contact::Surface::HalfSpace { normal, .. }) = surface.map(|(_, obstacle)| obstacle.surface()) else {
        return Err(
            "[robot] tip_velocity speaks of the first surface, which must be a halfspace: give qd instead".into()
        );
    };
    let along = Vector3::from(tip.along);
    let shadow = (along - normal * normal.dot(&along)).try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
    let alpha = tip.angle_deg.to_radians();
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

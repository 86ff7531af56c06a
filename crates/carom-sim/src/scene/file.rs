//! The keys of a scene file for serde; they are documented in `mod.rs`.

use super::beam::Beam;
use super::control::with_controller;
pub(crate) use super::control::{Control, Controller, PerJoint, Target};
use super::perturb::Distribution;
use crate::contact::SeveralLaw;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub robot: Robots,
    #[serde(default)]
    pub surface: Vec<Surface>,
    #[serde(default)]
    pub contact: Contact,
    #[serde(default)]
    pub spring: Vec<Spring>,
    #[serde(default)]
    pub force: Vec<Force>,
    #[serde(default, rename = "loop")]
    pub loops: Vec<Loop>,
    pub run: Run,
}

impl File {
    /// The files of the robots and of all tables; meshes are not among them.
    pub fn tables(&self) -> Vec<&PathBuf> {
        let mut named: Vec<&PathBuf> = match &self.robot {
            Robots::One(robot) => std::iter::once(&robot.urdf).chain(&robot.srdf).collect(),
            Robots::Several(all) => {
                let of = |it| {
                    let it: &Member = it;
                    [Some(&it.urdf), it.srdf.as_ref(), it.torque_file.as_ref(), it.reference.as_ref()]
                };
                all.iter().flat_map(of).flatten().collect()
            }
        };
        named.extend(self.run.torque_file.iter().chain(&self.run.reference));
        named.extend(self.force.iter().filter_map(|it| it.file.as_ref()));
        for surface in &self.surface {
            named.extend(surface.motion.iter().filter_map(|motion| motion.file.as_ref()));
            named.extend(surface.belt.iter().filter_map(|belt| belt.file.as_ref()));
        }
        named
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Spring {
    pub joint: String,
    #[serde(default)]
    pub rest: f64,
    pub stiffness: f64,
    #[serde(default)]
    pub damping: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Force {
    pub link: String,
    #[serde(default)]
    pub point: [f64; 3],
    #[serde(default)]
    pub axes: Axes,
    pub force: Option<[f64; 3]>,
    pub torque: Option<[f64; 3]>,
    pub file: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Loop {
    pub name: Option<String>,
    pub joint: LoopJoint,
    pub first: LoopFrame,
    pub second: LoopFrame,
    pub axis: Option<[f64; 3]>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LoopJoint {
    Point,
    Pin,
    Weld,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LoopFrame {
    pub link: Option<String>,
    #[serde(default)]
    pub xyz: [f64; 3],
    #[serde(default)]
    pub rpy: [f64; 3],
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Axes {
    #[default]
    World,
    Body,
}

/// `[robot]`, or the tables `[[robot]]`.
pub(crate) enum Robots {
    One(Box<Robot>),
    Several(Vec<Member>),
}

impl Robots {
    /// The folders in which the packages of meshes are searched for first.
    pub fn package_dirs(&self) -> Vec<&PathBuf> {
        match self {
            Self::One(robot) => robot.package_dirs.iter().collect(),
            Self::Several(all) => all.iter().flat_map(|it| &it.package_dirs).collect(),
        }
    }
}

impl<'de> Deserialize<'de> for Robots {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl<'de> Visitor<'de> for Form {
            type Value = Robots;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a table [robot], or a table [[robot]] for each robot")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Robots, A::Error> {
                Robot::deserialize(MapAccessDeserializer::new(map)).map(|robot| Robots::One(Box::new(robot)))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Robots, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Robots::Several)
            }
        }
        deserializer.deserialize_any(Form)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Robot {
    pub urdf: PathBuf,
    pub srdf: Option<PathBuf>,
    pub q: Vec<f64>,
    pub qd: Option<Vec<f64>>,
    pub tip_velocity: Option<TipVelocity>,
    #[serde(default = "tip")]
    pub tip: String,
    #[serde(default)]
    pub floating: bool,
    #[serde(default)]
    pub strict: bool,
    #[serde(default)]
    pub repair: bool,
    #[serde(default)]
    pub package_dirs: Vec<PathBuf>,
    #[serde(default)]
    pub rotor_inertia: BTreeMap<String, f64>,
    #[serde(default)]
    pub beam: Vec<Beam>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TipVelocity {
    pub speed: f64,
    pub angle_deg: f64,
    pub along: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Surface {
    pub name: Option<String>,
    pub shape: Shape,
    #[serde(default)]
    pub contact: Override,
    pub motion: Option<Motion>,
    pub belt: Option<Belt>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
pub(crate) enum Shape {
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
    Cylinder {
        centre: [f64; 3],
        radius: f64,
        length: f64,
        #[serde(default)]
        rpy: [f64; 3],
    },
    Capsule {
        centre: [f64; 3],
        radius: f64,
        length: f64,
        #[serde(default)]
        rpy: [f64; 3],
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
#[serde(deny_unknown_fields)]
pub(crate) struct Motion {
    pub amplitude: Option<[f64; 3]>,
    /// Hz.
    pub frequency: Option<f64>,
    pub phase: Option<f64>,
    pub velocity: Option<[f64; 3]>,
    pub file: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Belt {
    pub velocity: Option<[f64; 3]>,
    pub angular_velocity: Option<[f64; 3]>,
    #[serde(default)]
    pub centre: [f64; 3],
    pub file: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Contact {
    pub law: String,
    pub restitution: f64,
    pub tangential_restitution: f64,
    pub friction: f64,
    pub limit_restitution: f64,
    pub latch: bool,
    pub compliance: Softness,
    pub several: SeveralLaw,
    pub several_exponent: Option<f64>,
    pub relative_stiffness: f64,
    pub links: Links,
    pub between_robots: Option<bool>,
    pub pair: Vec<Pair>,
}

/// The links that may touch each other.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a list of pairs of link names, or \"all\"")]
pub(crate) enum Links {
    Pairs(Vec<[String; 2]>),
    All(All),
}

#[derive(Deserialize, Clone, Copy)]
pub(crate) enum All {
    #[serde(rename = "all")]
    All,
}

/// The value of `compliance`: `"rigid"`, or a table.
#[derive(Clone)]
pub(crate) enum Softness {
    Rigid,
    Compliant(Compliance),
}

impl<'de> Deserialize<'de> for Softness {
    fn deserialize<D: Deserializer<'de>>(given: D) -> Result<Self, D::Error> {
        given.deserialize_any(ReadSoftness)
    }
}

/// Keeps the messages about the keys of the table, which an untagged enum would lose.
struct ReadSoftness;

impl<'de> Visitor<'de> for ReadSoftness {
    type Value = Softness;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table such as { stiffness = 1e7 }, or \"rigid\"")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Softness, E> {
        if text == "rigid" { Ok(Softness::Rigid) } else { Err(E::invalid_value(Unexpected::Str(text), &self)) }
    }

    fn visit_map<M: MapAccess<'de>>(self, table: M) -> Result<Softness, M::Error> {
        Compliance::deserialize(MapAccessDeserializer::new(table)).map(Softness::Compliant)
    }
}

#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(crate) struct Compliance {
    pub stiffness: f64,
    pub force: Option<String>,
    pub exponent: Option<f64>,
    pub damping: Option<String>,
    pub pulls: Option<bool>,
    pub slip_speed: Option<f64>,
    pub bristle: Option<Bristle>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bristle {
    pub stiffness: f64,
    pub damping: f64,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            law: "frictionless".into(),
            restitution: 0.0,
            tangential_restitution: 0.0,
            friction: 0.0,
            limit_restitution: 0.0,
            latch: false,
            compliance: Softness::Rigid,
            several: SeveralLaw::default(),
            several_exponent: None,
            relative_stiffness: 1.0,
            links: Links::Pairs(Vec::new()),
            between_robots: None,
            pair: Vec::new(),
        }
    }
}

/// The values of `[contact]` that one surface or pair replaces.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Override {
    pub law: Option<String>,
    pub restitution: Option<f64>,
    pub tangential_restitution: Option<f64>,
    pub friction: Option<f64>,
    pub latch: Option<bool>,
    pub compliance: Option<Softness>,
    pub relative_stiffness: Option<f64>,
}

/// The values that apply to contacts of one link with one surface, or to the limits of one joint.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pair {
    pub link: Option<String>,
    pub surface: Option<String>,
    pub joint: Option<String>,
    pub law: Option<String>,
    pub restitution: Option<f64>,
    pub tangential_restitution: Option<f64>,
    pub friction: Option<f64>,
    pub latch: Option<bool>,
    pub compliance: Option<Softness>,
    pub relative_stiffness: Option<f64>,
}

impl Pair {
    pub fn values(&self) -> Override {
        let Self { law, restitution, tangential_restitution, friction, latch, compliance, relative_stiffness, .. } =
            self.clone();
        Override { law, restitution, tangential_restitution, friction, latch, compliance, relative_stiffness }
    }
}

with_controller! { Run {
    pub duration: f64,
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    #[serde(default)]
    pub gravity: [f64; 3],
    pub sample: Option<f64>,
    pub max_step: Option<f64>,
    pub zeno_time: Option<f64>,
    #[serde(default = "contact_step")]
    pub contact_step: f64,
    #[serde(default = "max_events")]
    pub max_events: usize,
    #[serde(default)]
    pub method: Method,
    #[serde(default)]
    pub model: Model,
    pub neglect: Option<f64>,
    #[serde(default)]
    pub effort_limits: bool,
    pub perturb: Option<Perturb>,
} }

with_controller! { Member {
    pub name: String,
    pub urdf: PathBuf,
    pub srdf: Option<PathBuf>,
    pub position: Option<[f64; 3]>,
    pub rpy: Option<[f64; 3]>,
    pub q: Option<Vec<f64>>,
    pub qd: Option<Vec<f64>>,
    pub tip_velocity: Option<TipVelocity>,
    #[serde(default = "tip")]
    pub tip: String,
    #[serde(default)]
    pub floating: bool,
    #[serde(default)]
    pub strict: bool,
    #[serde(default)]
    pub repair: bool,
    #[serde(default)]
    pub package_dirs: Vec<PathBuf>,
    #[serde(default)]
    pub rotor_inertia: BTreeMap<String, f64>,
    #[serde(default)]
    pub beam: Vec<Beam>,
} }

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Perturb {
    pub q: Option<PerJoint>,
    pub qd: Option<PerJoint>,
    #[serde(default)]
    pub seed: u64,
    #[serde(default)]
    pub distribution: Distribution,
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Method {
    /// Event-driven.
    #[default]
    Events,
    /// Time steps of `contact_step` throughout.
    Steps,
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Model {
    /// With the exact reductions of the plan.
    #[default]
    Auto,
    /// Without any reduction.
    Full,
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}
/// The tip of a scene that names none.
pub(crate) fn tip() -> String {
    "tip".into()
}
fn tolerance() -> f64 {
    1e-9
}
fn contact_step() -> f64 {
    1e-3
}
fn max_events() -> usize {
    100_000
}

//! The keys of a scene file for serde; the book documents them (`book/src/reference-scene.md`).

use super::keys::{Loading, Numbers, Table};
use super::perturb::Distribution;
use crate::contact::{RestitutionBySpeed, SeveralLaw};
use crate::key_group;
use crate::model::{Spring, WrenchAxes};
use carom_chain::ToolMotion;
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
    pub contact: Table<(ContactKeys, Contact)>,
    #[serde(default)]
    pub spring: Vec<Spring>,
    #[serde(default)]
    pub force: Vec<Force>,
    #[serde(default, rename = "loop")]
    pub loops: Vec<Loop>,
    pub run: Table<(Run, Control)>,
}

impl File {
    /// The folders in which the packages of meshes are searched for first.
    pub fn package_dirs(&self) -> Vec<&PathBuf> {
        self.robot.all.iter().flat_map(|it| &it.load.package_dirs).collect()
    }

    /// The files of the robots and of all tables; meshes are not among them.
    pub fn tables(&self) -> Vec<&PathBuf> {
        let Table((_, run)) = &self.run;
        let mut named: Vec<&PathBuf> = Vec::new();
        for Member { load, start, control, .. } in &self.robot.all {
            named.push(&load.urdf);
            named.extend(start.srdf.iter().chain(control.files()));
        }
        named.extend(run.files());
        named.extend(self.force.iter().filter_map(|it| it.file.as_ref()));
        for surface in &self.surface {
            named.extend(surface.motion.iter().filter_map(|motion| motion.file.as_ref()));
            named.extend(surface.belt.iter().filter_map(|belt| belt.file.as_ref()));
        }
        named
    }
}

key_group! {
    pub(crate) struct Force needs [link] {
        link: String,
        point: Numbers<3>,
        axes: WrenchAxes,
        force: Option<Numbers<3>>,
        torque: Option<Numbers<3>>,
        file: Option<PathBuf>,
    }

    pub(crate) struct Loop needs [joint, first, second] {
        name: Option<String>,
        joint: LoopJoint,
        first: LoopFrame,
        second: LoopFrame,
        axis: Option<Numbers<3>>,
    }

    pub(crate) struct LoopFrame needs [] {
        link: Option<String>,
        xyz: Numbers<3>,
        rpy: Numbers<3>,
    }

    pub(crate) struct Place needs [name] {
        name: String,
        position: Option<Numbers<3>>,
        rpy: Option<Numbers<3>>,
    }

    pub(crate) struct Start needs [] {
        srdf: Option<PathBuf>,
        q: Option<Target>,
        qd: Option<Vec<f64>>,
        effort: BTreeMap<String, f64>,
        tip_velocity: Option<TipVelocity>,
        floating: bool,
        beam: Vec<Beam>,
    }

    pub(crate) struct TipVelocity needs [] {
        velocity: Option<Numbers<3>>,
        speed: Option<f64>,
        angle_deg: Option<f64>,
        along: Option<Numbers<3>>,
        motion: Tool,
    }

    pub(crate) struct Beam needs [link, from, to, bends, bending] {
        link: String,
        from: Numbers<3>,
        to: Numbers<3>,
        bends: usize,
        bending: Vec<Bending>,
        damping: f64,
    }

    pub(crate) struct Bending needs [axis, stiffness] {
        axis: Numbers<3>,
        stiffness: f64,
    }

    pub(crate) struct Motion needs [] {
        amplitude: Option<Numbers<3>>,
        /// Hz.
        frequency: Option<f64>,
        phase: Option<f64>,
        velocity: Option<Numbers<3>>,
        file: Option<PathBuf>,
    }

    pub(crate) struct Belt needs [] {
        velocity: Option<Numbers<3>>,
        angular_velocity: Option<Numbers<3>>,
        centre: Numbers<3>,
        file: Option<PathBuf>,
    }

    /// The values of a contact: of `[contact]`, of one surface and of one pair.
    pub(crate) struct ContactKeys needs [] {
        law: Option<String>,
        restitution: Option<Restitution>,
        tangential_restitution: Option<f64>,
        friction: Option<f64>,
        latch: Option<bool>,
        compliance: Option<Softness>,
        relative_stiffness: Option<f64>,
    }

    /// The other keys of `[contact]`.
    pub(crate) struct Contact needs [] {
        limit_restitution: f64,
        several: SeveralLaw,
        several_exponent: Option<f64>,
        links: Links = Links::Pairs(Vec::new()),
        between_robots: Option<bool>,
        pair: Vec<Table<(Pair, ContactKeys)>>,
    }

    /// The contacts with values of their own: those of one link with one surface, or the limits of one joint.
    pub(crate) struct Pair needs [] {
        link: Option<String>,
        surface: Option<String>,
        joint: Option<String>,
        disabled: bool,
        closes_while: Option<String>,
    }

    pub(crate) struct Compliance needs [stiffness] {
        stiffness: f64,
        force: Option<String>,
        exponent: Option<f64>,
        damping: Option<String>,
        pulls: Option<bool>,
        slip_speed: Option<f64>,
        bristle: Option<Bristle>,
    }

    pub(crate) struct Bristle needs [stiffness, damping] {
        stiffness: f64,
        damping: f64,
    }

    pub(crate) struct Run needs [duration] {
        duration: f64,
        tolerance: Option<f64>,
        accuracy: Option<f64>,
        gravity: Numbers<3> = Numbers([0.0, 0.0, -9.81]),
        sample: Option<f64>,
        max_step: Option<f64>,
        zeno_time: Option<f64>,
        contact_step: f64 = 1e-3,
        max_events: usize = 100_000,
        method: Method,
        model: Model,
        neglect: Option<f64>,
        effort_limits: bool,
        perturb: Option<Perturb>,
    }

    pub(crate) struct Perturb needs [] {
        q: Option<PerJoint>,
        qd: Option<PerJoint>,
        numbers: BTreeMap<String, f64>,
        seed: u64,
        distribution: Distribution,
        distributions: BTreeMap<String, Distribution>,
    }

    /// The keys of a controller, of `[run]` or of one `[[robot]]`.
    pub(crate) struct Control needs [] {
        controller: Controller,
        after_impact: Option<Controller>,
        target: Option<Target>,
        kp: Option<PerJoint>,
        kd: Option<PerJoint>,
        torque: Option<Vec<f64>>,
        torque_file: Option<PathBuf>,
        feedback_file: Option<PathBuf>,
        reference: Option<PathBuf>,
        feed_forward: Option<bool>,
        gain: Option<f64>,
        press: Option<f64>,
        compensate: Option<bool>,
    }
}

impl Control {
    /// Its tables.
    fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.torque_file.iter().chain(&self.reference).chain(&self.feedback_file)
    }
}

/// The names of all controllers.
pub(crate) const CONTROLLERS: [&str; 9] = [
    "off",
    "pd",
    "constant",
    "gravity-compensation",
    "transition",
    "impact-invariant",
    "torque-file",
    "tracking",
    "feedback",
];

/// The index of a controller in the list of all.
#[derive(Default, Clone, Copy, PartialEq)]
pub(crate) struct Controller(pub usize);

impl<'de> Deserialize<'de> for Controller {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        CONTROLLERS.iter().position(|own| *own == name).map(Self).ok_or_else(|| {
            let known = CONTROLLERS.join("`, `");
            serde::de::Error::custom(format_args!("unknown variant `{name}`, expected one of `{known}`"))
        })
    }
}

/// One number for all joints, one for each number of qd (or of the joints that motors can drive), or by joint name.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, a list of numbers, or a table of numbers by joint name")]
pub(crate) enum PerJoint {
    Same(f64),
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
}

/// nq numbers, a table of numbers by joint name, or the name of a pose in the SRDF.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a list of numbers, a table of numbers by joint name, or the name of a pose in the SRDF")]
pub(crate) enum Target {
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
    Pose(String),
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LoopJoint {
    #[default]
    Point,
    Pin,
    Weld,
}

/// `[robot]`, or the tables `[[robot]]`.
pub(crate) struct Robots {
    /// `[[robot]]`: each robot has a name.
    pub named: bool,
    pub all: Vec<Member>,
}

/// The keys of one robot.
pub(crate) struct Member {
    pub place: Place,
    pub load: Loading,
    pub start: Start,
    /// Without keys for `[robot]`, whose controller is that of `[run]`.
    pub control: Control,
}

/// The keys of one of several robots.
type MemberKeys = Table<((Place, Loading), (Start, Control))>;

impl<'de> Deserialize<'de> for Robots {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl<'de> Visitor<'de> for Form {
            type Value = Robots;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a table [robot], or a table [[robot]] for each robot")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Robots, A::Error> {
                let Table((load, start)): Table<(Loading, Start)> =
                    Table::deserialize(MapAccessDeserializer::new(map))?;
                if start.q.is_none() {
                    return Err(serde::de::Error::missing_field("q"));
                }
                let (place, control) = (Place::default(), Control::default());
                Ok(Robots { named: false, all: vec![Member { place, load, start, control }] })
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Robots, A::Error> {
                let all: Vec<MemberKeys> = Vec::deserialize(SeqAccessDeserializer::new(list))?;
                let member = |Table(((place, load), (start, control)))| Member { place, load, start, control };
                Ok(Robots { named: true, all: all.into_iter().map(member).collect() })
            }
        }
        deserializer.deserialize_any(Form)
    }
}

#[derive(Default)]
pub(crate) struct Tool(pub ToolMotion);

impl<'de> Deserialize<'de> for Tool {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        ToolMotion::from_name(&String::deserialize(from)?).map(Self).map_err(serde::de::Error::custom)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Surface {
    pub name: Option<String>,
    pub shape: Shape,
    #[serde(default)]
    pub contact: ContactKeys,
    pub motion: Option<Motion>,
    pub belt: Option<Belt>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
pub(crate) enum Shape {
    Halfspace {
        point: Numbers<3>,
        normal: Numbers<3>,
    },
    Box {
        centre: Numbers<3>,
        size: Numbers<3>,
        #[serde(default)]
        rpy: Numbers<3>,
    },
    Sphere {
        centre: Numbers<3>,
        radius: f64,
    },
    Cylinder {
        centre: Numbers<3>,
        radius: f64,
        length: f64,
        #[serde(default)]
        rpy: Numbers<3>,
    },
    Capsule {
        centre: Numbers<3>,
        radius: f64,
        length: f64,
        #[serde(default)]
        rpy: Numbers<3>,
    },
    Mesh {
        file: PathBuf,
        #[serde(default = "unscaled")]
        scale: Numbers<3>,
        #[serde(default)]
        position: Numbers<3>,
        #[serde(default)]
        rpy: Numbers<3>,
    },
}

/// The links that may touch each other.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a list of pairs of link names, or \"all\"")]
pub(crate) enum Links {
    Pairs(Vec<[String; 2]>),
    All(All),
}

#[derive(Deserialize)]
pub(crate) enum All {
    #[serde(rename = "all")]
    All,
}

/// The value of `restitution`: a number, or a table.
pub(crate) enum Restitution {
    Constant(f64),
    BySpeed(RestitutionBySpeed),
}

impl<'de> Deserialize<'de> for Restitution {
    fn deserialize<D: Deserializer<'de>>(given: D) -> Result<Self, D::Error> {
        given.deserialize_any(ReadRestitution)
    }
}

/// Keeps the messages about the keys of the table, which an untagged enum would lose.
struct ReadRestitution;

impl<'de> Visitor<'de> for ReadRestitution {
    type Value = Restitution;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or a table { viscoelastic = a } or { table = [[speed, coefficient], …] }")
    }

    fn visit_f64<E>(self, number: f64) -> Result<Restitution, E> {
        Ok(Restitution::Constant(number))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Restitution, E> {
        Ok(Restitution::Constant(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Restitution, E> {
        Ok(Restitution::Constant(number as f64))
    }

    fn visit_map<M: MapAccess<'de>>(self, table: M) -> Result<Restitution, M::Error> {
        RestitutionBySpeed::deserialize(MapAccessDeserializer::new(table)).map(Restitution::BySpeed)
    }
}

/// The value of `compliance`: `"rigid"`, or a table.
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

fn unscaled() -> Numbers<3> {
    Numbers([1.0; 3])
}

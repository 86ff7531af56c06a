//! The keys of a scene file, as `scene.rs` documents them.

use crate::several::SeveralLaw;
use serde::Deserialize;
use std::path::PathBuf;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub robot: Robot,
    #[serde(default)]
    pub surface: Vec<Surface>,
    #[serde(default)]
    pub contact: Contact,
    pub run: Run,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Robot {
    pub urdf: PathBuf,
    pub q: Vec<f64>,
    pub qd: Option<Vec<f64>>,
    pub tip_velocity: Option<TipVelocity>,
    #[serde(default = "tip")]
    pub tip: String,
    #[serde(default)]
    pub floating: bool,
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
    pub amplitude: [f64; 3],
    /// Hz.
    pub frequency: f64,
    #[serde(default)]
    pub phase: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Contact {
    pub law: String,
    pub restitution: f64,
    pub friction: f64,
    pub limit_restitution: f64,
    pub latch: bool,
    pub compliance: Option<Compliance>,
    pub several: SeveralLaw,
    pub links: Vec<[String; 2]>,
    pub pair: Vec<Pair>,
}

#[derive(Deserialize)]
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
        let law = "frictionless".into();
        let (latch, compliance, several) = (false, None, SeveralLaw::default());
        let (links, pair) = (Vec::new(), Vec::new());
        Self { law, restitution: 0.0, friction: 0.0, limit_restitution: 0.0, latch, compliance, several, links, pair }
    }
}

/// What differs from `[contact]` at one surface.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Override {
    pub law: Option<String>,
    pub restitution: Option<f64>,
    pub friction: Option<f64>,
    pub latch: Option<bool>,
}

/// What differs where one link meets one surface, or at one joint's limits.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Pair {
    pub link: Option<String>,
    pub surface: Option<String>,
    pub joint: Option<String>,
    pub law: Option<String>,
    pub restitution: Option<f64>,
    pub friction: Option<f64>,
    pub latch: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Run {
    pub duration: f64,
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    #[serde(default)]
    pub gravity: [f64; 3],
    pub sample: Option<f64>,
    pub max_step: Option<f64>,
    #[serde(default = "zeno_time")]
    pub zeno_time: f64,
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
    pub controller: Controller,
    pub after_impact: Option<Controller>,
    pub target: Option<Vec<f64>>,
    pub kp: Option<f64>,
    pub kd: Option<f64>,
    pub torque: Option<Vec<f64>>,
    pub torque_file: Option<PathBuf>,
    pub gain: Option<f64>,
    pub press: Option<f64>,
    pub compensate: Option<bool>,
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Method {
    /// From event to event.
    #[default]
    Events,
    /// Steps of `contact_step` throughout.
    Steps,
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Model {
    /// As little as the scene needs.
    #[default]
    Auto,
    /// No reduction at all.
    Full,
}

#[derive(Deserialize, Default, PartialEq, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Controller {
    #[default]
    Off,
    Pd,
    Constant,
    GravityCompensation,
    Transition,
    ImpactInvariant,
    TorqueFile,
}

impl Controller {
    /// As the file says it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Pd => "pd",
            Self::Constant => "constant",
            Self::GravityCompensation => "gravity-compensation",
            Self::Transition => "transition",
            Self::ImpactInvariant => "impact-invariant",
            Self::TorqueFile => "torque-file",
        }
    }
}

fn unscaled() -> [f64; 3] {
    [1.0; 3]
}
/// The link that is the tip where a scene names none.
pub(crate) fn tip() -> String {
    "tip".into()
}
fn tolerance() -> f64 {
    1e-9
}
/// Above it the formula would be off where the acceleration changes, below it heights of bounces drown in rounding.
fn zeno_time() -> f64 {
    1e-5
}
fn contact_step() -> f64 {
    1e-3
}
fn max_events() -> usize {
    100_000
}

//! The keys of controllers, which `[run]` and `[[robot]]` share.

use crate::key_group;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One number for all joints, one for each number of qd (or of the joints that motors can drive), or by joint name.
#[derive(Deserialize, Clone, Debug, PartialEq)]
#[serde(untagged, expecting = "a number, a list of numbers, or a table of numbers by joint name")]
pub(crate) enum PerJoint {
    Same(f64),
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
}

/// nq numbers, a table of numbers by joint name, or the name of a pose in the SRDF.
#[derive(Deserialize, Clone, Debug, PartialEq)]
#[serde(untagged, expecting = "a list of numbers, a table of numbers by joint name, or the name of a pose in the SRDF")]
pub(crate) enum Target {
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
    Pose(String),
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
    Tracking,
}

impl Controller {
    /// The name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Pd => "pd",
            Self::Constant => "constant",
            Self::GravityCompensation => "gravity-compensation",
            Self::Transition => "transition",
            Self::ImpactInvariant => "impact-invariant",
            Self::TorqueFile => "torque-file",
            Self::Tracking => "tracking",
        }
    }
}

key_group! {
    /// The keys of a controller, of `[run]` or of one `[[robot]]`.
    #[derive(Clone, PartialEq)]
    pub(crate) struct Control needs [] {
        controller: Controller,
        after_impact: Option<Controller>,
        target: Option<Target>,
        kp: Option<PerJoint>,
        kd: Option<PerJoint>,
        torque: Option<Vec<f64>>,
        torque_file: Option<PathBuf>,
        reference: Option<PathBuf>,
        feed_forward: Option<bool>,
        gain: Option<f64>,
        press: Option<f64>,
        compensate: Option<bool>,
    }
}

//! The keys of controllers for serde, which `[run]` and `[[robot]]` share; they are documented in `mod.rs`.

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

/// nq numbers, or a table of numbers by joint name.
#[derive(Deserialize, Clone, Debug, PartialEq)]
#[serde(untagged, expecting = "a list of numbers, or a table of numbers by joint name")]
pub(crate) enum Target {
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
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

/// A table that has the keys of a controller beside its own.
macro_rules! with_controller {
    ($name:ident { $($own:tt)* }) => {
        #[derive(Deserialize, Default)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct $name {
            $($own)*
            #[serde(default)]
            pub controller: Controller,
            pub after_impact: Option<Controller>,
            pub target: Option<Target>,
            pub kp: Option<PerJoint>,
            pub kd: Option<PerJoint>,
            pub torque: Option<Vec<f64>>,
            pub torque_file: Option<PathBuf>,
            pub reference: Option<PathBuf>,
            pub feed_forward: Option<bool>,
            pub gain: Option<f64>,
            pub press: Option<f64>,
            pub compensate: Option<bool>,
        }

        impl $name {
            /// The keys of the controller.
            pub fn control(&self) -> Control {
                Control {
                    controller: self.controller,
                    after_impact: self.after_impact,
                    target: self.target.clone(),
                    kp: self.kp.clone(),
                    kd: self.kd.clone(),
                    torque: self.torque.clone(),
                    torque_file: self.torque_file.clone(),
                    reference: self.reference.clone(),
                    feed_forward: self.feed_forward,
                    gain: self.gain,
                    press: self.press,
                    compensate: self.compensate,
                }
            }
        }
    };
}

/// The keys of a controller, of `[run]` or of one `[[robot]]`.
#[derive(Default, Clone, PartialEq)]
pub(crate) struct Control {
    pub controller: Controller,
    pub after_impact: Option<Controller>,
    pub target: Option<Target>,
    pub kp: Option<PerJoint>,
    pub kd: Option<PerJoint>,
    pub torque: Option<Vec<f64>>,
    pub torque_file: Option<PathBuf>,
    pub reference: Option<PathBuf>,
    pub feed_forward: Option<bool>,
    pub gain: Option<f64>,
    pub press: Option<f64>,
    pub compensate: Option<bool>,
}

pub(crate) use with_controller;

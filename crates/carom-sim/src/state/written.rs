//! How results are written by serde: vectors as lists, modes and flags by their names.

use carom_impact::{Flags, Mode};
use nalgebra::Vector3;
use serde::{Serialize, Serializer};

pub(crate) fn vector<S: Serializer>(vector: &Vector3<f64>, to: S) -> Result<S::Ok, S::Error> {
    <[f64; 3]>::from(*vector).serialize(to)
}

pub(crate) fn mode<S: Serializer>(mode: &Mode, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(mode.name())
}

pub(crate) fn flags<S: Serializer>(flags: &Flags, to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(flags.names())
}

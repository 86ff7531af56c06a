//! How results are written by serde: vectors as lists, modes and flags by their names; a line of JSON.

use carom_impact::{Flags, Mode};
use nalgebra::Vector3;
use serde::{Serialize, Serializer};
use serde_json::ser::{CompactFormatter, Formatter};
use std::io::{self, Write};

/// A line of JSON; a number that is not finite is null.
pub fn to_json(answer: &impl Serialize) -> io::Result<String> {
    let mut text = Vec::new();
    answer.serialize(&mut serde_json::Serializer::with_formatter(&mut text, Unsigned))?;
    String::from_utf8(text).map_err(io::Error::other)
}

/// Writes zeros without their sign, which depends on rounding only.
struct Unsigned;

impl Formatter for Unsigned {
    fn write_f64<W: ?Sized + Write>(&mut self, out: &mut W, value: f64) -> io::Result<()> {
        CompactFormatter.write_f64(out, value + 0.0)
    }
}

pub(crate) fn vector<S: Serializer>(vector: &Vector3<f64>, to: S) -> Result<S::Ok, S::Error> {
    <[f64; 3]>::from(*vector).serialize(to)
}

pub(crate) fn mode<S: Serializer>(mode: &Mode, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(mode.name())
}

pub(crate) fn flags<S: Serializer>(flags: &Flags, to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(flags.names())
}

//! Programs that check carom and impact laws, behind the commands of the same names:
//!
//! - [`chart`]: work–precision diagrams of a scene; [`stress`]: the stress table of impact laws and methods;
//! - [`compare`]: all impact laws on measured data, by cross-validation;
//! - [`paper`] and [`consistency`]: the two-link experiment of Pagilla and Yu, and a consistency test of its measurements.
//!
//! P. R. Pagilla, B. Yu, *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Transactions on
//! Mechatronics 9 (2004), doi 10.1109/TMECH.2004.823888, is called "the paper" in this crate.

mod error;

pub use error::EvidenceError;

pub mod chart;
pub mod compare;
pub mod consistency;
mod line_chart;
pub mod paper;
pub mod stress;

/// Enums whose values are written as their `name()`.
macro_rules! serialised_by_name {
    ($($kind:ty),+) => {$(
        impl serde::Serialize for $kind {
            fn serialize<S: serde::Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
                out.serialize_str(self.name())
            }
        }
    )+};
}
use serialised_by_name;

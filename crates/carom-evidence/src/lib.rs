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

/// An interval after so many halvings, of which the part is kept at whose ends `is_low` differs: it is true at the lower one.
pub(crate) fn halved([mut low, mut high]: [f64; 2], halvings: usize, is_low: impl Fn(f64) -> bool) -> [f64; 2] {
    for _ in 0..halvings {
        let middle = 0.5 * (low + high);
        if is_low(middle) { low = middle } else { high = middle }
    }
    [low, high]
}

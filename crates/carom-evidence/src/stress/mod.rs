//! Where methods fail: scenes that are hard for impact laws and simulators, and the verdict on each method in each scene.
//!
//! Every scene states, for each method that applies to it, the verdict that theory predicts and a bound on the figure that
//! the scene measures (`Expected`). The prediction follows from a closed form, an invariant, an independent numerical
//! solution, the order of a method, the rounding, or a theorem about which laws must fail and by how much. A figure outside its
//! bound, an unexpected refusal, a failure that does not happen and a violated side condition are all a
//! `Verdict::Defect`. All random numbers have fixed seeds.

mod bodies;
mod chains;
mod definition;
mod impulse_path;
mod lasting;
mod many;
mod method;
mod motion;
mod report;
mod run;
mod scenes;
mod several;
mod single;
mod tree;

pub use run::{Table, names};

#[cfg(test)]
#[path = "../../tests/stress.rs"]
mod tests;

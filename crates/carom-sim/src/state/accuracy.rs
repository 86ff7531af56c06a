//! What counts as zero: the thresholds of decisions, in four steps, each some digits from the next.
//!
//! | step | share of the largest of its kind | meaning |
//! |---|---|---|
//! | [`ROUNDING`] | 1e-14 | a sum of some dozens of terms has this error |
//! | [`EXACT`] | 1e-12 | a number computed from such sums by equations, whose terms cancel, has this error; such equations are solved to it |
//! | [`EQUAL`] | 1e-9 | numbers that differ by less are equal: which of them is larger depends on rounding and on the tolerance of the run, so that a tie is decided in another way; numbers of files, which have ten digits, differ by less where they mean the same; impulses, forces and energies with a larger error do not satisfy their equations |
//! | [`CLEAR`] | 1e-6 | numbers that differ by more are different beyond doubt: no further test is needed |
//!
//! The kinds are forces and accelerations of one problem, velocities of one state, and lengths of one scene.

/// Error of a sum.
pub(crate) const ROUNDING: f64 = 1e-14;
/// Error of a solution.
pub(crate) const EXACT: f64 = 1e-12;
/// A tie.
pub(crate) const EQUAL: f64 = 1e-9;
/// No tie.
pub(crate) const CLEAR: f64 = 1e-6;

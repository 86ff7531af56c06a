//! What counts as zero, and how long something is tried: the numbers that decisions share.
//!
//! **Shares**, each some digits from the next:
//!
//! | step | share of the largest of its kind | meaning |
//! |---|---|---|
//! | [`ROUNDING`] | 1e-14 | a sum of some dozens of terms has this error |
//! | [`EXACT`] | 1e-12 | a number computed from such sums by equations, whose terms cancel, has this error; such equations are solved to it |
//! | [`EQUAL`] | 1e-9 | numbers that differ by less are equal: which of them is larger depends on rounding and on the tolerance of the run, so that a tie is decided in another way; numbers of files, which have ten digits, differ by less where they mean the same; impulses, forces and energies with a larger error do not satisfy their equations; rows of which less is left beside others depend on these |
//! | [`CLEAR`] | 1e-6 | numbers that differ by more are different beyond doubt: no further test is needed |
//!
//! The kinds are forces and accelerations of one problem, velocities of one state, and lengths of one scene. Roots of these shares follow from
//! them: a sine whose square is clear, a step whose error of third order is exact.
//!
//! Rates below [`NONE`], in the units of the state, are none: the square of their rounding, as a share of a tolerance, would be no normal number,
//! and its reciprocal, which ivp 0.6 takes, infinite.
//!
//! **Effort**:
//!
//! | what | number | why |
//! |---|---|---|
//! | [`STEPS`] of an iteration from any start | 60 | one that halves its error, or an interval, in each step has reached the last of the 53 binary digits by then, and Newton's method from near its solution long before; an integration that takes as many steps where one of the longest should do is stiff |
//! | [`GROWTH`] | 4 | what fails is tried again with so many times the effort; what succeeds goes on with steps of so many times the length at most |
//! | [`MAX_STEPS`] of an integration | 1e7 | more take hours |
//! | [`MANY`] corners | 32 | fewer are examined one by one faster than all together |

/// Error of a sum.
pub(crate) const ROUNDING: f64 = 1e-14;
/// Error of a solution.
pub(crate) const EXACT: f64 = 1e-12;
/// A tie.
pub(crate) const EQUAL: f64 = 1e-9;
/// No tie.
pub(crate) const CLEAR: f64 = 1e-6;
/// No rate.
pub(crate) const NONE: f64 = 1e-140;
/// Share of an energy from which on an error of its balance is told: that of the velocities is half of it.
pub(crate) const NOTICED: f64 = 1e-3;

/// Steps of an iteration.
pub(crate) const STEPS: usize = 60;
/// Growth of effort and of steps.
pub(crate) const GROWTH: f64 = 4.0;
/// Steps of an integration.
pub(crate) const MAX_STEPS: usize = 10_000_000;
/// Corners that are examined one by one.
pub(crate) const MANY: usize = 32;

//! Smooth motion: the equations of one contact mode, and the choice of the mode.

mod active_set;
mod assembled;
mod beside;
mod contact_states;
mod dead_points;
mod distribution;
mod ending;
mod equations;
mod free_motion;
mod groups;
mod held;
mod rows;
mod scale;
mod select;
mod settle;
mod slope;
mod smooth;
mod starting;
mod unique;
mod zero;

pub(crate) use active_set::{ActiveSet, Dry, DryJoint, Hold, Lasting};
pub(crate) use assembled::ConstraintForces;
pub use contact_states::ContactState;
pub use free_motion::{free_motion, free_motion_at};
pub(crate) use groups::{Gaps, Near};
pub(crate) use held::Loads;
pub(crate) use rows::{Constraints, Contact, Level, direction_of_slip, push};
pub(crate) use scale::{Scale, is_reached};
pub(crate) use select::ACCURACY;
pub(crate) use settle::Kink;
pub(crate) use slope::Linear;
pub(crate) use smooth::{Motion, deflection};
pub use unique::NonUnique;
pub(crate) use zero::{LEVER, Start};

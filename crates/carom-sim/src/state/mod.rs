//! A chain at one state, in the plane or in space.

mod accuracy;
mod basis;
mod closing;
mod coupling;
mod formula;
mod linear_function;
mod moment;
mod profile;
mod reach;
mod space;
pub(crate) mod written;

pub(crate) use accuracy::{CLEAR, EQUAL, EXACT, GROWTH, MANY, MAX_STEPS, NONE, NOTICED, ROUNDING, STEPS};
pub(crate) use basis::{Basis, Spread};
pub(crate) use closing::close_loops;
pub(crate) use coupling::{Coupling, Loops};
pub use formula::Formula;
pub use linear_function::{LinearFunction, state_variables};
pub use moment::{ContactImpulse, Moment};
pub use profile::Profile;
pub(crate) use profile::{between, check_rows, next_of};
pub(crate) use reach::{beyond, reach};
pub(crate) use space::{Felt, Space, View, pseudo_inverse};
pub use written::to_json;

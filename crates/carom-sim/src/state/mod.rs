//! A chain at one state, in the plane or in space.

mod blow;
mod moment;
mod profile;
mod reach;
mod space;

pub use blow::Blow;
pub use moment::Moment;
pub use profile::Profile;
pub(crate) use profile::{between, next_of};
pub(crate) use reach::{beyond, reach};
pub(crate) use space::{Felt, Space, View, pseudo_inverse};

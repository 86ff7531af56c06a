//! Studies of impacts: the two-link experiment of Pagilla & Yu, a third link's self-motion, impact maps, tables.
//!
//! P. R. Pagilla, B. Yu, *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Transactions on
//! Mechatronics 9 (2004), doi 10.1109/TMECH.2004.823888: "the paper" throughout.

pub mod fit;
mod impact_map;
pub mod paper;
mod routh_diagram;
mod self_motion;
mod table;
mod tosses;

pub use impact_map::{Approach, MapPoint, tangential_map};
pub use routh_diagram::{LawPoint, routh_diagram};
pub use self_motion::{SelfMotionPoint, self_motion};
pub use table::{Table, TableError};
pub use tosses::{PoseError, RollOut, Toss, TossError, Tosses};

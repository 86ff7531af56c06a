//! Studies of impacts: the two-link experiment of Pagilla & Yu, a third link's self-motion, impact maps, tables, and
//! diagrams that compare laws.
//!
//! P. R. Pagilla, B. Yu, *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Transactions on
//! Mechatronics 9 (2004), doi 10.1109/TMECH.2004.823888: "the paper" throughout.

pub mod chart;
pub mod consistency;
mod diagram;
pub mod fit;
mod impact_map;
mod line_chart;
pub mod paper;
mod self_motion;
pub mod stress;
pub mod study;
mod table;
mod tosses;

pub use diagram::{Diagram, LawPoint, Mark, Shape, Stroke, Symbol, hodograph, impulse_space, routh_diagram};
pub use impact_map::{Approach, MapPoint, tangential_map};
pub use self_motion::{SelfMotionPoint, self_motion};
pub use study::{Study, StudyError};
pub use table::{Column, Table, TableError};
pub use tosses::{PoseError, RollOut, Toss, TossError, Tosses};

//! Studies of impacts with robots:
//!
//! - [`map_study`]: impact maps from study files, with pictures and local optima;
//! - [`fit`]: fits of restitution and friction to recorded impacts; [`Tosses`]: roll-outs of measured tosses;
//! - [`compare`]: all impact laws on measured data, by cross-validation;
//! - [`paper`] and [`consistency`]: the two-link experiment of Pagilla and Yu, and a consistency test of its measurements;
//! - [`ensemble()`]: many runs of a scene from disturbed starts;
//! - [`chart`]: work–precision diagrams; [`stress`]: the stress table of impact laws and methods;
//! - [`hodograph`], [`routh_diagram`], [`impulse_space`]: diagrams of one impact that compare laws;
//! - [`self_motion()`], [`tangential_map`]: maps of three-link and two-link arms; [`Table`]: CSV and Parquet tables;
//!   [`state_columns`], [`contact_columns`]: those of a simulation; [`Part`]: files that are complete or not there.
//!
//! P. R. Pagilla, B. Yu, *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Transactions on
//! Mechatronics 9 (2004), doi 10.1109/TMECH.2004.823888, is called "the paper" in this crate.

pub mod chart;
pub mod compare;
pub mod consistency;
mod diagram;
mod ensemble;
pub mod fit;
mod impact_map;
mod line_chart;
pub mod map_study;
pub mod paper;
mod part;
mod scene_table;
mod self_motion;
pub mod stress;
mod table;
mod tosses;

pub use diagram::{Diagram, LawPoint, Mark, Shape, Stroke, Symbol, hodograph, impulse_space, routh_diagram};
pub use ensemble::{Run, ensemble};
pub use impact_map::{Approach, MapPoint, tangential_map};
pub use map_study::{Study, StudyError};
pub use part::{Part, remove_unfinished, write_whole};
pub use scene_table::{SCENE_KEY, STUDY_KEY, contact_columns, contact_row, coordinate_columns, state_columns};
pub use self_motion::{SelfMotionPoint, self_motion};
pub use table::{Column, Table, TableError};
pub use tosses::{Fitted, Horizon, Launch, PoseError, RollOut, RollOutOptions, Start, Toss, TossError, Tosses};

//! Studies of impacts with robots:
//!
//! - [`map_study`]: impact maps from study files, with pictures and local optima;
//! - [`fit`]: fits of restitution and friction to recorded impacts; [`Tosses`]: roll-outs of measured tosses;
//! - [`aim`]: numbers of a scene that are chosen such that its motion meets conditions, at least cost;
//! - [`orbit`]: periodic orbits, their multipliers, and branches of them over a parameter;
//! - [`tracked`]: feedback along the motion of a scene, through its impacts;
//! - [`Ensemble`]: many runs of a scene with disturbances;
//! - [`hodograph`], [`routh_diagram`], [`impulse_space`]: diagrams of one impact that compare laws;
//! - [`self_motion()`], [`tangential_map`]: maps of three-link and two-link arms; [`Table`]: CSV and Parquet tables;
//!   [`state_columns`], [`contact_columns`], [`load_columns`]: those of a simulation; [`Part`]: files that are complete or not there.

pub mod aim;
mod diagram;
#[doc(hidden)] // for carom-evidence
pub mod drawing;
mod ensemble;
mod feedback;
pub mod fit;
mod impact_map;
pub mod map_study;
mod moved_scene;
mod numbered;
pub mod orbit;
mod part;
mod problem_file;
mod scene_table;
mod self_motion;
mod table;
#[doc(hidden)] // for carom-evidence
pub mod tosses;
mod words;

pub use diagram::{Diagram, LawPoint, hodograph, impulse_space, routh_diagram};
pub use ensemble::{Covariance, Ensemble, PredictedTime, Runs, Spread};
pub use feedback::{Growth, Tracked, tracked};
pub use impact_map::{Approach, MapPoint, tangential_map};
pub use numbered::{NumberedRows, RowFile, RowsError, Written};
pub use self_motion::{SelfMotionPoint, self_motion};
pub use table::{Column, TableError};
pub use tosses::{Horizon, PoseError, RollOut, RollOutOptions, Start, Toss, TossError, TossReport, Tosses};

// Hidden: what only the other crates of carom use.
#[doc(hidden)]
pub use {
    diagram::{Mark, Shape, Stroke, Symbol},
    part::{Part, remove_unfinished, write_whole},
    scene_table::{
        SCENE_KEY, STUDY_KEY, contact_columns, contact_row, coordinate_columns, error_columns, error_row, event_table,
        load_columns, load_rows, motor_columns, state_columns,
    },
    table::Table,
};

//! What is simulated: a chain, its possible contacts, its motors, springs and outer forces, and the settings.

mod control_law;
mod controller;
mod drive;
mod feedback;
mod gains;
mod impact_controllers;
mod loops;
mod parameter;
mod pd;
mod reference;
mod simulation;
mod spring;
mod torques;
mod tracking;
mod wrench;

pub(crate) use control_law::{Asked, Number};
pub use controller::{Controller, Observed};
pub use drive::{Drive, RobotDrive};
pub use feedback::{Feedback, FeedbackRow, coordinate_names};
pub use gains::Gains;
pub(crate) use gains::{Motor, motors};
pub use impact_controllers::{ImpactInvariant, Transition};
pub use loops::{Loop, LoopFrame, LoopJoint};
pub use parameter::Parameter;
pub(crate) use parameter::Place;
pub use pd::Pd;
pub use reference::Reference;
pub(crate) use simulation::TOLERANCE;
pub use simulation::{Integrator, Simulation};
pub use spring::Spring;
pub(crate) use spring::SpringAt;
pub use torques::TorqueTable;
pub use tracking::Tracking;
pub use wrench::{Load, Wrench, WrenchAxes};

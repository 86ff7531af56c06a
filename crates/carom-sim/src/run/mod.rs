//! The run of a simulation from event to event, and its results.

mod branch;
mod checkpoint;
mod crossing;
mod differences;
mod events;
mod flow;
mod guard;
mod guarded;
mod history;
mod impacts;
mod leap;
mod leg;
mod linear_run;
mod loads;
mod modes;
mod named;
mod observer;
mod run_state;
mod sampler;
mod sensitivity;
mod session;
mod several;
mod steps;
mod stream;
mod trajectory;
mod variation;

pub use linear_run::{EventTime, LinearRun};
pub use named::{AtContact, NamedEvent, UnderLaw};
pub use sensitivity::{Broken, Sensitivity};
pub use session::{Advance, Session, SessionState};
pub use trajectory::{
    EnergyBooks, Event, EventKind, EventLoads, Sampling, Seen, Segment, Statistics, StepReason, StopReason, Summary,
    Trajectory,
};

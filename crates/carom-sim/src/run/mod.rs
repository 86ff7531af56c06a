//! The run of a simulation from event to event, and its results.

/// Evaluates an expression with the algebra and the model of a simulation: in the plane, if its planar chain is given, or in space.
macro_rules! in_its_space {
    ($sim:expr, $flat:expr, |$A:ident, $model:ident| $what:expr) => {
        match $flat {
            Some($model) => {
                type $A = carom_chain::Planar<f64>;
                $what
            }
            None => {
                type $A = carom_chain::Spatial<f64>;
                let $model = &$sim.chain;
                $what
            }
        }
    };
}

mod branch;
mod changed;
mod columns;
mod crossing;
mod event_derivative;
mod events;
mod flow;
mod follow;
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
mod regulator;
mod run_error;
mod run_state;
mod sampler;
mod sensitivity;
mod session;
mod several;
mod steps;
mod stream;
mod to_accuracy;
mod trajectory;
mod variation;

pub use columns::Columns;
pub use follow::Broken;
pub use linear_run::{ByOutcome, EventTime, LinearRun};
pub use named::{AtContact, NamedEvent, NamedRun, UnderLaw};
pub use regulator::Regulator;
pub use run_error::{RunError, StateError};
pub use sensitivity::Sensitivity;
pub use session::{Advance, Session, SessionState};
pub use to_accuracy::{Met, ToAccuracy};
pub use trajectory::{
    EnergyBooks, Event, EventKind, EventLoads, Sampling, Seen, Segment, Statistics, StepReason, StopReason, Summary,
    Trajectory,
};

//! Where chain, contact and impact law meet: **one impact of a chain, and the motion before, through and after many**.
//!
//! `carom-chain` knows nothing of impacts and `carom-impact` nothing of robots. [`Strike`] forms the
//! [`ImpactProblem`](carom_impact::ImpactProblem) of a chain at a state and carries the law's impulse back into the joints;
//! [`frictionless_jump_into`] is the kernel of it for sweeps. [`Scene`] reads a robot among surfaces from TOML,
//! [`Simulation`] runs it from event to event, and the [`Trajectory`] tells what happened. [`free_motion`] is motion with
//! the motors off and nothing in the way, forward or back in time.
//!
//! **Conventions.** The contact normal is a unit vector from the environment to the robot; approach means a negative
//! normal velocity; impulses act on the robot.

mod batch;
mod compliance;
mod derivative;
mod drive;
mod error;
mod free_motion;
mod frictionless;
mod held;
mod leg;
mod motion;
mod plan;
mod root;
mod run;
mod saltation;
mod scene;
mod scene_drive;
mod scene_file;
mod settle;
mod several;
mod simulate;
mod space;
mod strike;
mod touch;
mod trajectory;
mod watch;

pub use batch::{FrictionlessJump, Jumped, Outcomes, States};
pub use compliance::{Compliance, Holding, Yielding};
pub use derivative::{ContactRows, ImpactDerivative, PlaneContact, RowContact};
pub use drive::{Drive, ImpactInvariant, Transition};
pub use error::SimError;
pub use free_motion::{free_motion, free_motion_at};
pub use frictionless::frictionless_jump_into;
pub use plan::{Bounded, Decision, Plan};
pub use saltation::{Jump, Saltation, saltation};
pub use scene::Scene;
#[doc(hidden)]
pub use scene::from_toml;
pub use several::SeveralLaw;
pub use simulate::{Integrator, Simulation};
pub use strike::{ChainImpact, Contact, ImpactBand, Impacts, JointModel, Strike};
pub use touch::{ContactRule, Oscillation, Surface, Touch, Touches};
pub use trajectory::{
    Blow, ContactMode, EnergyBooks, Event, EventKind, Moment, Sampling, Seen, Segment, Statistics, StopReason, Summary,
    Trajectory,
};

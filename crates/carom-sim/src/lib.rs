//! Impacts of kinematic chains and event-driven simulation of chains with impacts and contacts.
//!
//! This crate combines `carom-chain` (kinematics and dynamics), `carom-contact` (gaps) and `carom-impact` (impact laws):
//!
//! - [`Strike`] forms the [`ImpactProblem`](carom_impact::ImpactProblem) of a chain at one state and computes the joint
//!   velocities after the impact from the impulse of a law; [`FrictionlessJump`] and [`frictionless_jump_into`] are the
//!   kernels for sweeps without friction.
//! - [`Scene`] reads a robot and its surroundings from a TOML file, [`Scene::plan`] reduces it exactly, and [`Simulation`]
//!   runs it from event to event. The result is a [`Trajectory`] or a [`Summary`].
//! - [`free_motion`] is motion without motors and contacts, forward or back in time.
//! - [`saltation()`] and [`Strike::derivative`] are first derivatives of impacts.
//!
//! **Order.** Each module uses only those above it, and `error`:
//!
//! | module | what |
//! | --- | --- |
//! | `state` | a chain at one moment, in the plane or in space |
//! | `contact` | possible contacts: surfaces, touches, gaps, rules, modes |
//! | `impact` | one impact of a chain at one point |
//! | `model` | the description of a simulation: chain, touches, motors, settings |
//! | `scene` | a scene file as data |
//! | `motion` | the equations of one contact mode |
//! | `plan` | what is modelled, decided once: chain, plane, touches, choices |
//! | `run` | a simulation from event to event, and its results |
//!
//! **Conventions.** SI units and radians. The contact normal is a unit vector from the environment to the robot. The
//! normal velocity is negative while the bodies approach. Impulses and forces are those on the robot. A gap is positive
//! while a contact is open.

mod contact;
mod error;
mod impact;
mod model;
mod motion;
mod plan;
mod run;
mod scene;
mod state;

pub use contact::{
    Belt, Compliance, ContactLaw, ContactMode, ContactRule, Holding, Oscillation, RestitutionBySpeed, SeveralLaw,
    Surface, SurfaceMotion, Touch, Touches, Yielding,
};
pub use error::SimError;
pub use impact::{
    ChainImpact, Contact, ContactRows, FrictionlessJump, Grip, ImpactBand, ImpactDerivative, ImpactLoads, Impacts,
    JointImpulse, JointModel, Jumped, Outcomes, PlaneContact, PreparedStrike, RowContact, Saltation, SeveralImpact,
    States, Strike, StruckPoint, frictionless_jump_into, impact_loads, saltation,
};
pub use model::{
    Controller, Drive, Feedback, FeedbackRow, Gains, ImpactInvariant, Integrator, Load, Loop, LoopFrame, LoopJoint,
    Observed, Parameter, Pd, Reference, RobotDrive, Simulation, Spring, TorqueTable, Tracking, Transition, Wrench,
    WrenchAxes,
};
pub use motion::{ContactState, NonUnique, free_motion};
pub use plan::{Bounded, Decision, Plan};
pub use run::{
    Advance, Broken, ByOutcome, Columns, EnergyBooks, Event, EventKind, EventLoads, EventTime, LinearRun, Met,
    Regulator, RunError, Sampling, Seen, Segment, Sensitivity, Session, SessionState, StateError, Statistics,
    StepReason, StopReason, Summary, ToAccuracy, Trajectory,
};
pub use scene::{Distribution, Disturbed, Perturbation, Scene};
pub use state::{ContactImpulse, Formula, LinearFunction, Moment, Profile};

// Hidden: what only the command line, the Python package and the studies use.
#[doc(hidden)]
pub use {
    model::coordinate_names,
    motion::free_motion_at,
    run::{AtContact, NamedEvent, NamedRun, UnderLaw},
    scene::{from_toml, keys, path},
    state::{state_variables, to_json},
};

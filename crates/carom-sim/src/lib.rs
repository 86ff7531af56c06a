//! Where chain and impact law meet: **one impact of a chain**, from state and surface normal to joint velocities after.
//!
//! `carom-chain` knows nothing of impacts and `carom-impact` nothing of robots; this crate forms the
//! [`ImpactProblem`](carom_impact::ImpactProblem) of a chain at a state and carries the law's impulse back into the
//! joints. [`Strike`] is the checked way for any law, [`frictionless_jump_into`] the kernel for sweeps, [`free_motion`]
//! what happens before and after with the motors off.
//!
//! **Conventions.** The contact normal is a unit vector from the environment to the robot; approach means a negative
//! normal velocity; impulses act on the robot.

mod error;
mod free_motion;
mod frictionless;
mod strike;

pub use error::SimError;
pub use free_motion::{Sample, free_motion};
pub use frictionless::frictionless_jump_into;
pub use strike::{ChainImpact, Contact, Impacts, Strike};

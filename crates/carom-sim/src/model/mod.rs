//! What is simulated: a chain, its possible contacts, its motors and the settings.

mod drive;
mod several_law;
mod simulation;

pub(crate) use drive::Asked;
pub use drive::{Drive, ImpactInvariant, Transition};
pub use several_law::SeveralLaw;
pub use simulation::{Integrator, Simulation};

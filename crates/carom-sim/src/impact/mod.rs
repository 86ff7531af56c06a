//! Impacts of a chain at one point: single, prepared, in batches; their derivatives, saltation matrices and bounds.

mod band;
mod batch;
mod contact;
mod derivative;
mod frictionless;
mod hit;
mod joints;
mod lanes;
mod loads;
mod many;
mod prepared;
mod saltation;
mod strike;
mod together;

pub use band::ImpactBand;
pub use batch::{FrictionlessJump, Jumped, Outcomes};
pub use contact::Contact;
pub use derivative::{ContactRows, ImpactDerivative, PlaneContact, RowContact};
pub use frictionless::frictionless_jump_into;
pub use hit::ChainImpact;
pub use joints::JointModel;
pub use lanes::States;
pub use loads::{ImpactLoads, JointImpulse, impact_loads};
pub use prepared::PreparedStrike;
pub use saltation::{Saltation, saltation};
pub use strike::{Impacts, Strike};
pub use together::{Grip, SeveralImpact, StruckPoint};

//! Impacts of a chain at one point: single, prepared, in batches; their derivatives, saltation matrices and bounds.

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

pub use contact::{Contact, ImpactBand};
pub use derivative::{ContactRows, ImpactDerivative, PlaneContact, RowContact};
pub(crate) use derivative::{Derivatives, RowRates, differentiate};
pub use frictionless::{FrictionlessJump, Jumped, Outcomes, frictionless_jump_into};
pub use hit::ChainImpact;
pub use joints::JointModel;
pub use lanes::States;
pub use loads::{ImpactLoads, JointImpulse, impact_loads};
pub use prepared::PreparedStrike;
pub use saltation::{Saltation, saltation};
pub use strike::{Impacts, Strike};
pub use together::{Grip, SeveralImpact, StruckPoint};

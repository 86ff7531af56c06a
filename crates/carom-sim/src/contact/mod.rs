//! The possible contacts of a chain, their gaps, and the rules by which they act.

mod by_speed;
mod compliance;
mod condition;
mod friction;
mod gap;
mod law;
mod links;
mod mode;
mod pair;
mod rule;
mod several_law;
mod surface;
mod touch;

pub use by_speed::RestitutionBySpeed;
pub use compliance::{Compliance, Holding, Yielding};
pub(crate) use compliance::{Grip, Memory, Slack};
pub(crate) use condition::ClosesWhile;
pub(crate) use friction::friction_bound;
pub(crate) use gap::{At, BallOnPlane, Place};
pub use law::ContactLaw;
pub(crate) use links::{are_disabled, robot_of};
pub use mode::ContactMode;
pub(crate) use pair::{APART, FAR, Pair, Passing, Placed};
pub use rule::ContactRule;
pub use several_law::SeveralLaw;
pub(crate) use surface::Moving;
pub use surface::{Belt, Oscillation, Surface, SurfaceMotion};
pub(crate) use touch::TouchKind;
pub use touch::{Touch, Touches};

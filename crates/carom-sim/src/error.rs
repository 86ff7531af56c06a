//! What can be wrong with an impact of a chain.

use carom_chain::ChainError;
use carom_impact::ImpactError;

/// Every way in which this crate refuses its input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The chain refuses.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The impact law refuses.
    #[error(transparent)]
    Impact(#[from] ImpactError),
    /// Nothing was said about where the chain is hit.
    #[error("no contact {missing} was given: say {say}")]
    Incomplete {
        /// `point` or `normal`.
        missing: &'static str,
        /// The call that is missing.
        say: &'static str,
    },
    /// The point does not move at all: it belongs to the base.
    #[error("link '{link}' is fixed to the world: no impact can move it, choose a link that a joint moves")]
    FixedPoint {
        /// The link.
        link: String,
    },
    /// The normal direction is singular: no joint motion moves the point along it.
    #[error(
        "at this pose no joint moves '{link}' along the normal {normal:?} (singular direction): the structure would take \
         the impact, and the impulse of any rigid law would be infinite; change the pose or the normal"
    )]
    SingularNormal {
        /// The link.
        link: String,
        /// The unit normal.
        normal: [f64; 3],
    },
}

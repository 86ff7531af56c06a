//! A strike whose contact point, normal and joint model have been checked: it computes impacts of many states without
//! allocation. If the chain and the normal are in one plane, it computes them in that plane.
//!
//! Symbols as in `strike.rs`.

use super::hit::ChainImpact;
use super::pass::{Aim, InSpace, OfPlane, Pass};
use crate::error::SimError;
use carom_chain::{Planar, Spatial};
use carom_impact::Law;

/// A contact point of a chain with its normal and joint model, checked once: see [`Strike::prepare`](crate::Strike::prepare).
///
/// ```
/// # use carom_chain::uniform_chain;
/// # use carom_impact::Energetic;
/// # use carom_sim::Impacts;
/// let arm = uniform_chain(2, 1.0, 1.0)?;
/// let (q, qd) = ([0.3, 0.7], [-0.5, -1.0]);
/// let mut strike = arm.impact(&q, &qd).at(arm.frame("tip")?).normal([0.0, 1.0, 0.0]).prepare()?;
/// let law = Energetic { restitution: 0.5, friction: 0.3 };
/// let mut hit = strike.outcome();
/// for k in 0..3 {
///     strike.resolve_into(&[0.3, 0.7 + 0.1 * k as f64], &qd, &law, &mut hit)?;
///     assert!(hit.energy_after < hit.energy_before);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PreparedStrike<'a> {
    aim: Aim<'a>,
    pass: Route<'a>,
}

/// The algebra in which the impacts are computed.
#[derive(Debug, Clone)]
enum Route<'a> {
    Plane(Pass<'a, Planar<f64>, OfPlane, 2>),
    Space(Pass<'a, Spatial<f64>, InSpace, 3>),
}

impl<'a> PreparedStrike<'a> {
    pub(super) fn new(aim: Aim<'a>) -> Self {
        let pass = Pass::in_plane(&aim).map_or_else(|| Route::Space(Pass::in_space(&aim)), Route::Plane);
        Self { aim, pass }
    }

    /// Memory for one result.
    pub fn outcome(&self) -> ChainImpact {
        ChainImpact::empty(self.aim.chain.nv())
    }

    /// Computes the impact of the chain at `q` (length nq; rad, m, unit quaternion) and `qd` (length nv; rad/s, m/s) with a law,
    /// and writes it to `hit`. Allocates only at the first
    /// call, and for chains with mimic joints or more than 48 bodies. That the numbers are finite is checked by their effect at the
    /// contact; [`Chain::check_state`](carom_chain::Chain::check_state) checks each of them.
    ///
    /// # Errors
    /// [`SimError::Chain`] for a wrong length or a singular mass matrix; [`SimError::SingularNormal`] or [`SimError::Locked`] if
    /// no (free) joint moves the contact point along the normal; [`SimError::Impact`] for errors of the law. `hit` is then
    /// unspecified.
    ///
    /// # Panics
    /// If `hit` was made for a chain with another number of velocities.
    pub fn resolve_into(
        &mut self,
        q: &[f64],
        qd: &[f64],
        law: &dyn Law<f64, 3>,
        hit: &mut ChainImpact,
    ) -> Result<(), SimError> {
        let nv = self.aim.chain.nv();
        if qd.len() != nv {
            self.aim.chain.check_v("qd", qd)?;
        }
        assert_eq!(
            hit.qd_plus.len(),
            nv,
            "this result belongs to another chain: make one with PreparedStrike::outcome"
        );
        match &mut self.pass {
            Route::Plane(pass) => pass.resolve_into(&self.aim, (q, qd), law, hit),
            Route::Space(pass) => pass.resolve_into(&self.aim, (q, qd), law, hit),
        }
    }
}

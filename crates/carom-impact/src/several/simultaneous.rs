//! Moreau's law: all constraints at once.

use nalgebra::DVector;

use super::restart::solve_patiently;
use super::solve::Found;
use super::{Accuracy, SeveralOutcome, SeveralProblem, check_size};
use crate::problem::check_velocity;
use crate::{Flags, ImpactError};

impl SeveralProblem {
    /// Moreau's law: all constraints at once, Newton's restitution, Coulomb's cone. The conditions are at the head of
    /// the module (`mod.rs`).
    ///
    /// `warm_start` is an initial guess of the impulses (N s), for instance those of the previous time step: their modes
    /// are tried first.
    ///
    /// **Parameters.** e and μ of each constraint, e as a ratio of normal velocities.
    ///
    /// **Guarantee.** Every impulse is in its cone or within its bound. With e = 0 no energy is gained, beyond the
    /// residual; nor is it without friction, for any e, if each contact that gets an impulse was approaching: its share
    /// of the energy change is `-½ (1 - e) p |u⁻|`. Otherwise energy may be gained ([`Flags::ENERGY_GAIN`]): with
    /// friction as under [`Whittaker`](crate::Whittaker); without friction by a separating contact that an impulse
    /// brings to rest, whose share is `½ p u⁻`, even with one e for all contacts. [`poisson`](Self::poisson) has no
    /// such gain. Redundant contacts have many solutions for the impulses; without friction all of them give the same
    /// `u_plus`. With friction it may depend on the solution where contacts slide in different directions, or with
    /// different coefficients ([`Flags::NON_UNIQUE`]; see [`undetermined`](crate::undetermined)).
    ///
    /// **Fails** if no impulses satisfy the law. This requires e > 0 and a singular H: friction wedges a contact, or
    /// obstacles on both sides of the robot, where the separating contact (target 0, not -e u⁻) prevents the rebound
    /// from the other. The iteration also misses some solutions. Neither is an error: `residual` is then above the
    /// tolerance.
    ///
    /// # Errors
    ///
    /// [`ImpactError::Sizes`], [`ImpactError::NotFinite`]: a `warm_start` of the wrong size or with an entry that is
    /// not finite.
    pub fn simultaneous(
        &self,
        accuracy: &Accuracy,
        warm_start: Option<&DVector<f64>>,
    ) -> Result<SeveralOutcome, ImpactError> {
        if let Some(guess) = warm_start {
            check_size("warm_start", self.u_minus.len(), guess.len())?;
            check_velocity("warm_start", guess.as_slice())?;
        }
        let mut outcome = self.outcome(solve_patiently(self, accuracy, warm_start));
        if self.gram {
            outcome.flags |= Flags::NON_UNIQUE.when(self.has_others(&outcome.impulse, &outcome.u_plus));
        }
        Ok(outcome)
    }

    /// The outcome of these impulses.
    pub(super) fn outcome(&self, found: Found) -> SeveralOutcome {
        let u_plus = &self.u_free + &self.delassus * &found.impulse;
        let (energy_change, flags) = self.energy(&found.impulse, &u_plus, found.residual);
        SeveralOutcome {
            u_plus,
            energy_change,
            flags,
            residual: found.residual,
            iterations: found.iterations,
            impulse: found.impulse,
        }
    }
}

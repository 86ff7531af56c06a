//! All solutions of a law at `u_n = 0`, where there may be more than one.
//!
//! A contact that slides at `u_n = 0` and whose friction jams may go on sliding without an impulse, or get a finite
//! impulse without approach (Painlevé's impact without collision). Both satisfy the law. As `v_n -> 0` from below, the
//! impulse tends to the finite one, not to zero.
//!
//! Laws that follow the slip have the second solution exactly where the slip jams, `μ h·u >= C`. Laws that impose their
//! conditions on the total impulse have it where these hold with `v_n⁺ = v_n⁻ = 0`. In the plane this is the same set
//! of problems, in space it is not.

use nalgebra::RealField;

use crate::contact::Contact;
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// The outcome of a law, and the others that satisfy it.
pub(crate) struct Answers<T, const D: usize> {
    pub first: ImpactOutcome<T, D>,
    pub others: Vec<ImpactOutcome<T, D>>,
}

impl<T: RealField + Copy, const D: usize> Answers<T, D> {
    /// `strike` resolves an approach along a regular normal direction. `from_rest` returns impulses that satisfy the
    /// law at `v_n = 0`, with or without the zero impulse; if it fails there are none.
    pub fn of(
        law: &'static str,
        mu: T,
        problem: &ImpactProblem<T, D>,
        strike: impl FnOnce() -> Result<ImpactOutcome<T, D>, ImpactError>,
        from_rest: impl FnOnce() -> Result<Vec<ImpactOutcome<T, D>>, ImpactError>,
    ) -> Result<Self, ImpactError> {
        if problem.approach_speed() > T::zero() {
            problem.check_normal()?;
            // Both are properties of the problem and μ: one rule for all laws.
            let (mut first, contact) = (strike()?, Contact::of(problem));
            first.flags |= Flags::JAM.when(contact.jams(mu));
            first.flags |= Flags::SINGULAR.when(mu > T::zero() && contact.is_singular());
            return Ok(Self { first, others: Vec::new() });
        }
        let slides = problem.approach_speed() == T::zero() && problem.check_normal().is_ok();
        let mut others = if slides { from_rest().unwrap_or_default() } else { Vec::new() };
        others.retain(|hit| hit.impulse[D - 1] > T::zero());
        let jams = slides && Contact::of(problem).jams(mu);
        let flags = Flags::JAM.when(jams) | Flags::NON_UNIQUE.when(!others.is_empty());
        for hit in &mut others {
            hit.flags |= flags;
        }
        Ok(Self { first: ImpactOutcome::none(law, problem, flags), others })
    }

    pub fn all(self) -> Vec<ImpactOutcome<T, D>> {
        std::iter::once(self.first).chain(self.others).collect()
    }
}

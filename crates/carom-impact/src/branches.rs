//! Where a law has more than one answer, or jumps: all of them.
//!
//! A contact that slides at `v_n = 0` and whose friction jams may go on sliding without an impulse, or take a finite
//! one from no approach at all (Painlevé's impact without collision). Both satisfy the law; as the approach fades,
//! `v_n -> 0` from below, the impulse goes to the second, not to zero.
//!
//! Laws that follow the slip have that second answer exactly where the slip jams, `μ h·u >= C`. Laws that impose
//! their conditions on the whole impulse at once have it where those hold with `v_n⁺ = v_n⁻ = 0`; in the plane that is
//! the same place, in space it is not.

use nalgebra::RealField;

use crate::contact::Contact;
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// The answer a law gives, and the others that satisfy it.
pub(crate) struct Answers<T, const D: usize> {
    pub first: ImpactOutcome<T, D>,
    pub others: Vec<ImpactOutcome<T, D>>,
}

impl<T: RealField + Copy, const D: usize> Answers<T, D> {
    /// `strike` answers an approach along a normal that can move; `from_rest` gives impulses that satisfy the law at
    /// `v_n = 0`, the zero one among them or not. Where it refuses there is none.
    pub fn of(
        law: &'static str,
        mu: T,
        problem: &ImpactProblem<T, D>,
        strike: impl FnOnce() -> Result<ImpactOutcome<T, D>, ImpactError>,
        from_rest: impl FnOnce() -> Result<Vec<ImpactOutcome<T, D>>, ImpactError>,
    ) -> Result<Self, ImpactError> {
        if problem.approach_speed() > T::zero() {
            problem.check_normal()?;
            return Ok(Self { first: strike()?, others: Vec::new() });
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

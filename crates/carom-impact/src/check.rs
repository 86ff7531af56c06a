//! The checks that every outcome passes before it is given: a number that fails one is an error, never a result.
//!
//! | check | rule | scale of its rounding |
//! |---|---|---|
//! | finite | impulse, velocity after, energies | – |
//! | velocity | `u⁺ = u⁻ + H p` | `\|u⁻\| + \|H\| \|p\|` |
//! | separation | `u_n⁺ >= 0` | the same, along the normal |
//! | work | `W_n + W_t = ½ p·(u⁻ + u⁺)`, which is `T⁺ - T⁻` by the first rule | `½ \|p\|·(\|u⁻\| + \|u⁺\|)` |
//! | cone | `p_n >= 0`, `\|p_t\| <= μ p_n`; for a law that promises it | the terms of u_n, over `H_nn` |
//!
//! A check may be missed by its rounding and by [`share`] of the quantities before the impact, which an iteration leaves. The first
//! look ([`is_clear`]) has no division and one branch; what it leaves in doubt is decided by [`check`] with the terms.

use nalgebra::{RealField, convert};

use crate::outcome::finite;
use crate::problem::plain;
use crate::rounding::{NULL_PIVOT, rounding};
use crate::{ImpactError, ImpactOutcome, ImpactProblem};

/// 1e-9, far above what laws leave and far below what matters in a motion; more in a precision that does not have it.
fn share<T: RealField + Copy>() -> T {
    convert::<f64, T>(1e-9).max(rounding(NULL_PIVOT))
}

/// Where rounding could take a larger share of the velocity before, the one after is not known: impulses near overflow.
const UNKNOWN: f64 = 1e-3;

/// Whether all checks are passed beyond doubt. `false` for numbers that are not finite, because each of them is compared.
#[inline(always)]
pub(crate) fn is_clear<T: RealField + Copy, const D: usize>(
    problem: &ImpactProblem<T, D>,
    hit: &ImpactOutcome<T, D>,
    cone: Option<T>,
) -> bool {
    let (n, h, p) = (D - 1, problem.delassus(), &hit.impulse);
    let mut off = T::zero();
    for i in 0..D {
        let mut u = hit.u_minus[i] - hit.u_plus[i];
        for k in 0..D {
            u += h[(i, k)] * p[k];
        }
        off += u.abs();
    }
    let unbooked = (hit.normal_work + hit.friction_work) - (hit.energy_after - hit.energy_before);
    let mut square = T::zero();
    for i in 0..n {
        square += p[i] * p[i];
    }
    // Twice the share for the square.
    let most = cone.map(|mu| mu * p[n]);
    let in_cone = most.is_none_or(|most| square <= most * most * (T::one() + share::<T>()) && p[n] >= T::zero());
    off <= share::<T>() * problem.approach_speed()
        && unbooked.abs() <= share::<T>() * hit.energy_before
        && hit.u_plus[n] >= T::zero()
        && in_cone
}

/// Decides what [`is_clear`] leaves open. `cone`: the coefficient of friction of a law that promises the cone.
#[cold]
#[inline(never)]
pub(crate) fn check<T: RealField + Copy, const D: usize>(
    problem: &ImpactProblem<T, D>,
    hit: &ImpactOutcome<T, D>,
    cone: Option<T>,
) -> Result<(), ImpactError> {
    let (n, h, half) = (D - 1, problem.delassus(), convert::<f64, T>(0.5));
    let ImpactOutcome { impulse, u_minus, u_plus, .. } = hit;
    finite("the impulse", impulse)?;
    finite("the velocity after the impact", u_plus)?;
    finite("the kinetic energy", &[hit.energy_before, hit.energy_after])?;
    finite("the work of the impulse", &[hit.normal_work, hit.friction_work])?;
    let refuse = |check, found: T, expected: T, allowed: T| {
        let [found, expected, allowed] = [found, expected, allowed].map(plain);
        Err(ImpactError::Outcome { law: hit.law, check, found, expected, allowed })
    };

    let speed = u_minus.amax();
    let terms = |i: usize| (0..D).fold(u_minus[i].abs(), |sum, k| sum + (h[(i, k)] * impulse[k]).abs());
    for i in 0..D {
        let expected = u_minus[i] + (0..D).fold(T::zero(), |sum, k| sum + h[(i, k)] * impulse[k]);
        let allowed = speed * share() + (terms(i) * rounding(NULL_PIVOT)).min(speed * convert(UNKNOWN));
        if (u_plus[i] - expected).abs() > allowed {
            return refuse("its velocity after the impact is not u⁻ + H p (m/s)", u_plus[i], expected, allowed);
        }
    }
    let allowed = terms(n) * rounding(NULL_PIVOT);
    if u_plus[n] < -allowed {
        return refuse("it leaves the contact approaching: the normal velocity (m/s)", u_plus[n], T::zero(), allowed);
    }
    let (works, expected) = (hit.normal_work + hit.friction_work, hit.energy_change);
    let passed = impulse.abs().dot(&(u_minus.abs() + u_plus.abs())) * half;
    let allowed = hit.energy_before * share() + passed * rounding(NULL_PIVOT);
    if (works - expected).abs() > allowed {
        return refuse("its works do not sum to the change of the kinetic energy (J)", works, expected, allowed);
    }
    if let Some(mu) = cone {
        let (p_n, p_t) = (impulse[n], (0..n).fold(T::zero(), |sum, i| sum.hypot(impulse[i])));
        // The normal impulse is a difference of velocities over C.
        let doubt = terms(n) / h[(n, n)] * rounding(NULL_PIVOT);
        let allowed = (p_t + p_n.abs()) * share() + (mu + T::one()) * doubt;
        if p_n < -allowed {
            return refuse("its normal impulse pulls (N s)", p_n, T::zero(), allowed);
        }
        if p_t > mu * p_n + allowed {
            return refuse("its impulse leaves the cone of friction: along the surface (N s)", p_t, mu * p_n, allowed);
        }
    }
    Ok(())
}

impl<T: RealField + Copy, const D: usize> ImpactOutcome<T, D> {
    /// Checks the outcome of a user's own law for a problem: finite numbers, `u⁺ = u⁻ + H p`, `u_n⁺ >= 0`, and works that sum to
    /// `½ p·(u⁻ + u⁺)`, all within rounding or 1e-9 of the velocities and energies before. Outcomes of the laws of this crate and
    /// of [`of_impulse`](Self::of_impulse) have passed these checks; of the former the impulse has been found in its cone too.
    ///
    /// # Errors
    /// [`ImpactError::Outcome`] with the check and its numbers; [`ImpactError::NotFinite`].
    pub fn check(&self, problem: &ImpactProblem<T, D>) -> Result<(), ImpactError> {
        if is_clear(problem, self, None) { Ok(()) } else { check(problem, self, None) }
    }
}

use nalgebra::{RealField, Vector2};

use super::{Family, Rule, check_friction, check_restitution, check_tangential_restitution};
use crate::branches::Answers;
use crate::contact::{Contact, length};
use crate::outcome::{Account, Mode};
use crate::rounding::{NULL_PIVOT, rounding};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// A combination of two plastic impulses, one without friction (P₁) and one that sticks (P₂), with a normal and a
/// tangential coefficient of restitution, limited to the friction cone.
///
/// ```text
/// P₁ = -(u_n⁻/C) n                        without friction, to u_n = 0
/// P₂ = -H⁻¹ u⁻                            sticking, to u = 0
/// P  = (1 + e) P₁ + κ (P₂ - P₁)           with κ = 1 + e_t if that is in the cone, else the κ
///                                         between 0 and 1 + e_t at which |P_t| = μ P_n
/// ```
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `tangential_restitution` e_t in \[-1, 1\], where -1 is
/// [`Frictionless`](crate::Frictionless) and 1 doubles the tangential impulse that sticks; `friction` μ >= 0.
///
/// **Guarantee.** One solution for every H with `C > 0`, regular or not, in the plane and in space, in closed form;
/// `u_n⁺ = -e u_n⁻`. Never gains energy: `P₂ - P₁` does not change u_n, so the energies of the two parts add up, and
///
/// ```text
/// T⁺ - T⁻ = -(1 - e²) (u_n⁻)²/(2 C) - κ (2 - κ) E,   E = ½ (P₂ - P₁)ᵀ H (P₂ - P₁) >= 0,   0 <= κ <= 2
/// ```
///
/// **Fails** to be Coulomb's law in time: even with e_t = 0 and large friction, a contact with inertial coupling
/// (`H_tn ≠ 0`) slips after the impact, because only the plastic part sticks. The coefficients have to be fitted; e_t
/// is not a material constant.
///
/// **Singular H.** `P₂ - P₁` is the shortest tangential impulse that stops all slip which H can change; along a null
/// direction of H no friction acts.
///
/// **Works** are those of the straight path from u⁻ to u⁺, see [`Whittaker`](crate::Whittaker).
///
/// **Source.** Chatterjee and Ruina, *A new algebraic rigid-body collision law based on impulse space considerations*,
/// J. Appl. Mech. 65 (1998) 939.
///
/// ```
/// # use carom_impact::{ChatterjeeRuina, ImpactProblem, Law};
/// # use nalgebra::{matrix, vector};
/// // A solid sphere on a rough floor: the slip stops and reverses (a superball).
/// let problem = ImpactProblem::new(matrix![3.5, 0.0, 0.0; 0.0, 3.5, 0.0; 0.0, 0.0, 1.0], vector![1.0, 0.0, -1.0])?;
/// let law = ChatterjeeRuina { restitution: 0.8, tangential_restitution: 0.5, friction: 0.5 };
/// let hit = law.resolve(&problem)?;
/// assert!((hit.u_plus - vector![-0.5, 0.0, 0.8_f64]).norm() < 1e-15);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChatterjeeRuina<T = f64> {
    /// Normal, kinematic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Tangential coefficient of restitution, -1 to 1.
    pub tangential_restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy> Rule<T> for ChatterjeeRuina<T> {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Cone(Some(self.tangential_restitution))
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        check_restitution(self.restitution)?;
        check_tangential_restitution(self.tangential_restitution)?;
        check_friction(self.friction)?;
        let strike = || self.strike(problem);
        Answers::of(Self::NAME, self.friction, problem, strike, || Ok(vec![strike()?]))
    }
}

impl<T: RealField + Copy> ChatterjeeRuina<T> {
    fn strike<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let (e, mu) = (self.restitution, self.friction);
        let contact = Contact::of(problem);
        let (h, c) = (contact.coupling, contact.normal);
        let mobility = contact.at_held_normal();
        let smooth = -contact.v_n / c; // P₁ along n
        // P₂ - P₁ = (stop, lift): it stops the slip that P₁ leaves.
        let slip = contact.slip + h * smooth;
        let stop = -mobility.least_solution(&slip);
        // What no tangential impulse changes: the impulse that would stop it is infinite, so friction slides along it.
        let lasting = slip - mobility.moved(&slip);
        let terms = length(&contact.slip) + length(&h) * smooth;
        let slides = length(&lasting) > terms * rounding(NULL_PIVOT);
        let lift = -h.dot(&stop) / c;

        let rebound = (T::one() + e) * smooth;
        let whole = T::one() + self.tangential_restitution;
        let size = length(&stop);
        let sticks = whole * size <= mu * (rebound + whole * lift);
        // Outside the cone the denominator is positive: whole (size - mu lift) > mu rebound >= 0.
        let share = if sticks { whole } else { mu * rebound / (size - mu * lift) };

        let against = if slides { -lasting / length(&lasting) } else { Vector2::zeros() };
        let resisted = T::one() + mu * h.dot(&against) / c;
        let sticks = sticks && !(slides && mu > T::zero());
        let (tangent, p_n) = if slides && whole > T::zero() && resisted > T::zero() {
            let p_n = rebound / resisted;
            (against * (mu * p_n), p_n)
        } else {
            (stop * share, rebound + lift * share)
        };
        let impulse = Contact::lift(&tangent, p_n);
        let mut v_t = contact.slip + contact.tangents * tangent + h * p_n;
        if sticks && mu > T::zero() && contact.rests(&v_t, &tangent, p_n) {
            v_t.fill(T::zero());
        }
        let u_plus = Contact::lift(&v_t, -e * contact.v_n);
        let mut account = Account::straight(e, &impulse, problem.u_minus(), &u_plus);
        if account.mode == Mode::Stick && mu == T::zero() && contact.slip.amax() > T::zero() {
            account.mode = Mode::Slip; // without friction it cannot stick
        }
        account.flags |= Flags::SINGULAR.when(mu > T::zero() && contact.is_singular());
        ImpactOutcome::of(Self::NAME, problem, impulse, u_plus, account, Some(mu))
    }
}

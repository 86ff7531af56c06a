use nalgebra::{RealField, convert};

use super::{Family, Rule, check_friction, check_restitution};
use crate::branches::Answers;
use crate::cone::{Cone, Touch};
use crate::contact::{Contact, length};
use crate::flow::Found;
use crate::outcome::{Account, Mode};
use crate::plane::{others_with_friction, resolve_with_friction};
use crate::rounding::rounding;
use crate::routh::{Answer, Turns, coefficient_of_work};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// Newton's coefficient and Coulomb's cone, both imposed on the total impulse.
///
/// ```text
/// u_n⁺ = -e u_n⁻, and either
/// stick:  P = H⁻¹ (-v_t⁻, -(1+e) v_n⁻)                       if |P_t| <= μ P_n
/// slip σ: P_n = -(1+e) v_n⁻ / (C - σ μ B),  P_t = -σ μ P_n   if P_n > 0 and σ v_t⁺ >= 0
/// ```
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** In the plane one solution for every regular H. Proof: let `P_t = -λ μ P_n` with λ in \[-1, 1\]. The
/// rebound fixes `P_n(λ) = -(1+e) v_n⁻/(C - λ μ B)`, and then `dv_t⁺/dλ` has the sign of `-(A C - B²)`: v_t⁺ decreases
/// with λ wherever `P_n > 0`, and tends to -∞ (or comes from +∞) where `C - λ μ B` reaches zero. Therefore exactly one
/// of three cases holds: λ = 1 with `v_t⁺ >= 0`, λ = -1 with `v_t⁺ <= 0`, or a zero of v_t⁺ between them. This is why
/// the contact sticks if neither slip is admissible.
///
/// **Fails** to be passive: it can gain energy. Friction is opposed to the *final* slip, so it may act along the slip
/// during most of the impact. Such an outcome has the flag `energy-gain`. At det H = 0 there may be no solution
/// ([`ImpactError::Wedged`]), or a range of impulses with one u⁺: then the one whose friction is opposed to the initial
/// slip is taken, with the flag `non-unique`; [`branches`](crate::Law::branches) returns both ends of the range.
///
/// **Works.** The law has no path in time. The works are those of the straight path from u⁻ to u⁺,
/// `W_n = ½ P_n (v_n⁻ + v_n⁺)` and `W_t = ½ P_t (v_t⁻ + v_t⁺)`, on which all three realised coefficients are e.
///
/// **In space** friction of size `μ P_n` acts along `-v_t⁺`: with the normal impulse eliminated, `P_t = -(S + s 1)⁻¹ b`
/// for an s >= 0 that is computed to rounding (`cone.rs`). At least one such s exists for every regular H, and there
/// may be three (in about 1 of 1000 random problems, test `whittaker_s_branches_are_all_solutions_of_a_scan`); then
/// sticking is taken if it is a solution, and the outcome has the flag `non-unique`; [`branches`](crate::Law::branches)
/// returns all.
///
/// For singular H in space a pair of solutions may be missed; the law then returns [`ImpactError::Wedged`] although a
/// finite impulse satisfies it (18 of 2000 random problems of rank 2, test
/// `rank_deficient_matrices_are_answered_or_refused_as_wedged`).
///
/// **Source.** Whittaker, *Analytical Dynamics* (1904); its energy paradox: Kane and Levinson, *Dynamics* (1985).
///
/// ```
/// # use carom_impact::{Flags, ImpactProblem, Law, Whittaker};
/// # use nalgebra::{matrix, vector};
/// let problem = ImpactProblem::new(
///     matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504],
///     vector![-0.267174342835_f64, -0.134202014333],
/// )?;
/// let hit = Whittaker { restitution: 0.5, friction: 0.5 }.resolve(&problem)?;
/// assert_eq!(hit.u_plus[0], 0.0);
/// assert!((hit.energy_ratio() - 1.587494687).abs() < 1e-8);
/// assert!(hit.flags.contains(Flags::ENERGY_GAIN));
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whittaker<T = f64> {
    /// Kinematic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy> Rule<T> for Whittaker<T> {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Cone(None)
    }

    /// The other solutions of an approach are left out: counting them is cheaper.
    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        let (e, mu) = (self.restitution, self.friction);
        check_restitution(e)?;
        check_friction(mu)?;
        let strike = || {
            let refused = |contact: &Contact<T>| contact.wedged(mu, contact.v_n, contact.held_inverse_mass());
            let in_plane = |contact: &_| {
                let found = algebraic(contact, e, mu, Which::First);
                found.ok_or_else(|| refused(&Contact::of(contact)))
            };
            let in_space = || {
                let contact = Contact::of(problem);
                let (cone, gain) = (Cone::of(&contact), self.gain(&contact));
                let touch = cone.solve(mu, &contact.slip, -gain, || length(&contact.slip) + gain);
                let mut found = self.found(problem, &touch.ok_or_else(|| refused(&contact))?);
                found.account.flags |= Flags::NON_UNIQUE.when(cone.answers(mu, &contact.slip, -gain) > 1);
                Ok(found)
            };
            resolve_with_friction(Self::NAME, e, mu, problem, in_plane, in_space)
        };
        // Without approach the first solution is the zero impulse.
        Answers::of(Self::NAME, mu, problem, strike, || Ok(self.others(problem, Which::First)))
    }

    fn branches<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Vec<ImpactOutcome<T, D>>, ImpactError> {
        let mut answers = self.answers(problem)?;
        if problem.approach_speed() > T::zero() && answers.first.flags.contains(Flags::NON_UNIQUE) {
            answers.others = self.others(problem, Which::Second);
            for other in &mut answers.others {
                other.flags |= Flags::NON_UNIQUE;
            }
        }
        Ok(answers.all())
    }
}

impl<T: RealField + Copy> Whittaker<T> {
    fn others<const D: usize>(&self, problem: &ImpactProblem<T, D>, in_plane: Which) -> Vec<ImpactOutcome<T, D>> {
        let (e, mu) = (self.restitution, self.friction);
        if mu == T::zero() {
            return Vec::new();
        }
        let in_space = || {
            let contact = Contact::of(problem);
            let (cone, gain) = (Cone::of(&contact), self.gain(&contact));
            let mut touches = cone.all(mu, &contact.slip, -gain);
            if gain > T::zero()
                && let Some(first) = cone.solve(mu, &contact.slip, -gain, || length(&contact.slip) + gain)
            {
                // The first is among them, to the rounding of its slip.
                let off = |touch: &Touch<T>| (touch.slip - first.slip).abs();
                let nearest = touches.iter().map(off).reduce(T::min);
                touches.retain(|touch| Some(off(touch)) != nearest);
            }
            touches.iter().map(|touch| self.found(problem, touch)).collect()
        };
        others_with_friction(Self::NAME, mu, problem, |contact| algebraic(contact, e, mu, in_plane), in_space)
    }

    /// `C P_n + h·P_t`.
    fn gain(&self, contact: &Contact<T>) -> T {
        -(T::one() + self.restitution) * contact.v_n
    }

    fn found<const D: usize>(&self, problem: &ImpactProblem<T, D>, touch: &Touch<T>) -> Found<T, D> {
        let (e, contact) = (self.restitution, Contact::of(problem));
        let impulse = Contact::lift(&touch.tangent, touch.normal);
        // Exactly opposed to the friction; zero if it sticks.
        let u_plus = Contact::lift(&(touch.tangent * -touch.slip), -e * contact.v_n);
        let mut account = Account::straight(e, &impulse, problem.u_minus(), &u_plus);
        account.flags |= Flags::SINGULAR.when(contact.is_singular());
        Found { impulse, u_plus, account }
    }
}

/// Which solution of a planar contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Which {
    First,
    /// The other end of a range of impulses, if there is a range.
    Second,
}

/// `None` without a solution: the contact wedges, or there is no second one.
fn algebraic<T: RealField + Copy>(contact: &ImpactProblem<T, 2>, e: T, mu: T, which: Which) -> Option<Answer<T>> {
    let (zero, one, half) = (T::zero(), T::one(), convert::<f64, T>(0.5));
    let (a, b, c) = contact.abc();
    let (v_t, v_n) = contact.velocity();
    let v_n_plus = -e * v_n;
    let gain = v_n_plus - v_n; // C P_n + B P_t = gain > 0
    let held = contact.held_inverse_mass();
    let locked = contact.is_locked(held);

    // Slip σ: (P_n, v_t⁺) if P_n > 0 and the final slip is σ.
    let slip = |sigma: T| {
        let p_n = gain / (c - sigma * mu * b);
        let jump = (b - sigma * mu * a) * p_n;
        let mut v_t_plus = v_t + jump;
        if locked && v_t_plus.abs() <= (v_t.abs() + jump.abs()) * rounding(1024.0) {
            v_t_plus = zero;
        }
        let pushes = !contact.is_locked(c - sigma * mu * b);
        (pushes && sigma * v_t_plus >= zero).then_some((sigma, p_n, v_t_plus))
    };

    let first = if v_t < zero { -one } else { one };
    let mut flags = Flags::SINGULAR.when(locked && mu > zero);
    let at_rest = v_t == zero && (b == zero || contact.tangent_is_frozen());
    if which == Which::Second && (at_rest || slip(first).is_none() || slip(-first).is_none()) {
        return None;
    }
    let (p_t, p_n, v_t_plus) = if at_rest {
        // No slip before, and nothing accelerates the tangent.
        (zero, gain / c, zero)
    } else {
        match (slip(first), slip(-first)) {
            (_, Some((sigma, p_n, v_t_plus))) if which == Which::Second => (-sigma * mu * p_n, p_n, v_t_plus),
            (Some((sigma, p_n, v_t_plus)), other) => {
                flags |= Flags::NON_UNIQUE.when(other.is_some() && mu > zero);
                (-sigma * mu * p_n, p_n, v_t_plus)
            }
            (None, Some((sigma, p_n, v_t_plus))) => (-sigma * mu * p_n, p_n, v_t_plus),
            (None, None) if locked => return None,
            (None, None) => {
                // Stick: A P_t + B P_n = -v_t and B P_t + C P_n = gain.
                let p_n = (gain + b / a * v_t) / held;
                (-(v_t + b * p_n) / a, p_n, zero)
            }
        }
    };

    let mode = if v_t_plus == zero && (at_rest || mu > zero) {
        Mode::Stick
    } else if v_t_plus * v_t < zero {
        Mode::ReverseSlip
    } else {
        Mode::Slip
    };
    // On the straight path v_n = 0 divides the impulse as v_n⁺ to -v_n⁻. Without approach there are no coefficients.
    let approaches = gain != zero;
    let share = -v_n / gain;
    let taken = share * p_n * v_n * half;
    let returned = (one - share) * p_n * v_n_plus * half;
    Some(Answer {
        p_t,
        p_n,
        v_t: v_t_plus,
        v_n: v_n_plus,
        account: Account {
            normal_work: p_n * (v_n + v_n_plus) * half,
            friction_work: p_t * (v_t + v_t_plus) * half,
            newton: approaches.then_some(e),
            poisson: approaches.then_some(e),
            energetic: approaches.then(|| coefficient_of_work(returned, taken)),
            mode,
            slip_end: None,
            slip_stop: None,
            flags,
        },
        turns: Turns::AtTheEnd,
    })
}

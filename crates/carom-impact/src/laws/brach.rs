use nalgebra::{RealField, Vector2, convert};

use super::{Family, Rule, check_friction, check_impulse_ratio, check_restitution};
use crate::branches::Answers;
use crate::contact::{Contact, length};
use crate::outcome::Account;
use crate::problem::determinant;
use crate::rounding::{CANCELLED, NULL_PIVOT, rounding};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// Newton's coefficient, and a prescribed impulse ratio r in the direction t of the initial slip, clipped to the
/// admissible ratios.
///
/// ```text
/// P = (n + r t) P_n,   P_n = -(1 + e) u_n⁻/(C + r B)
/// ```
///
/// with A, B, C of the plane (t, n). The prescribed ratio is clipped to the interval from 0 to the nearer of two
/// bounds:
///
/// ```text
/// r₀ = -(C v_t - (1 + e) B u_n⁻)/(B v_t - (1 + e) A u_n⁻)   critical: slip ends just at separation
/// r₁ where T⁺ = T⁻                                          a quadratic
/// ```
///
/// Beyond r₀ friction would accelerate the contact past rest. If the denominator of r₀ is not positive, no ratio
/// against the slip stops it, and r₀ is not a bound. If inertial coupling alone reverses the slip, `r₀ > 0`: then only
/// friction *along* the initial slip acts against the final one, and a negative ratio is clipped to 0.
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `impulse_ratio` r, finite, negative against the slip. By
/// name ([`law_by_name`](crate::law_by_name)) its absolute value is the coefficient of friction and its sign that of
/// r₀: towards rest. Without slip, t is the direction of `H_tn`, into which the normal impulse accelerates the contact.
///
/// **Guarantee.** One solution where `C + r B > 0`, as for every regular H; `u_n⁺ = -e u_n⁻`; never gains energy,
/// because the ratio is clipped.
///
/// **Fails** to predict r: the ratio is a result of an impact, not a property of a surface. In space friction across
/// the initial slip is neglected, though the slip may turn.
///
/// **Singular H.** Where H is singular in the plane (t, n), impulses along its null direction change no velocity, so no
/// ratio stops the slip; the prescribed one is taken, or 0 if the slip ends without friction. A ratio with
/// `C + r B <= 0` wedges.
///
/// **Works** are those of the straight path from u⁻ to u⁺, see [`Whittaker`](crate::Whittaker).
///
/// **Source.** Brach, *Rigid body collisions*, J. Appl. Mech. 56 (1989) 133; *Mechanical Impact Dynamics* (1991).
///
/// ```
/// # use carom_impact::{Brach, ImpactProblem, Law};
/// # use nalgebra::{matrix, vector};
/// let problem = ImpactProblem::new(matrix![3.5, 0.0; 0.0, 1.0], vector![1.0_f64, -1.0])?;
/// let hit = Brach { restitution: 0.8, impulse_ratio: -0.1 }.resolve(&problem)?;
/// assert!((hit.u_plus - vector![0.37, 0.8]).norm() < 1e-15);
/// // The critical ratio is -1/6.3: a larger one is clipped to it, and the slip stops.
/// let hit = Brach { restitution: 0.8, impulse_ratio: -0.5 }.resolve(&problem)?;
/// assert!(hit.u_plus[0].abs() < 1e-15 && (hit.impulse[0] / hit.impulse[1] + 1.0 / 6.3).abs() < 1e-15);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brach<T = f64> {
    /// Kinematic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Prescribed ratio of tangential to normal impulse along the initial slip; negative against it.
    pub impulse_ratio: T,
}

impl<T: RealField + Copy> Rule<T> for Brach<T> {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Ratio(*self)
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        check_restitution(self.restitution)?;
        check_impulse_ratio(self.impulse_ratio)?;
        let strike = || self.strike(problem);
        // Only a ratio against the slip can jam.
        let mu = (-self.impulse_ratio).max(T::zero());
        Answers::of(Self::NAME, mu, problem, strike, || Ok(vec![strike()?]))
    }
}

impl<T: RealField + Copy> Brach<T> {
    fn strike<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let e = self.restitution;
        let contact = Contact::of(problem);
        let t = direction(&contact);
        let plane = Plane::of(&contact, &t, e);
        let det = determinant(plane.a, plane.b, plane.c);
        // Where H is singular in the plane, all ratios give the same velocity, and rest is no bound of theirs.
        let singular = plane.a > T::zero() && contact.is_locked(det / plane.a);
        let (ratio, rests) =
            if singular { plane.unbounded(self.impulse_ratio) } else { plane.clipped(self.impulse_ratio) };
        // At rest P_n stays finite as approach and `push` vanish together, if the sticking contact has an inverse mass.
        let push = if rests && !singular {
            (plane.gain * det / plane.stops()).max(det / plane.a)
        } else {
            plane.c + ratio * plane.b
        };
        if contact.is_locked(push) {
            return Err(contact.wedged(ratio.abs(), contact.v_n, push));
        }
        // At rest the impulse is the one that sticks in the plane (t, n): no difference C + r B to round.
        let (p_t, p_n) = if rests && !singular {
            (-plane.slides() / det, plane.stops() / det)
        } else {
            (ratio * plane.gain / push, plane.gain / push)
        };
        let impulse = Contact::lift(&(t * p_t), p_n);
        let mut v_t = contact.slip + contact.tangents * t * p_t + contact.coupling * p_n;
        if rests {
            v_t -= t * t.dot(&v_t); // rounding of rest
            if contact.rests(&v_t, &(t * p_t), p_n) {
                v_t.fill(T::zero());
            }
        }
        let u_plus = Contact::lift(&v_t, -e * contact.v_n);
        let mut account = Account::straight(e, &impulse, problem.u_minus(), &u_plus);
        // Also for a ratio along the slip, which cannot jam.
        account.flags |= Flags::SINGULAR.when(self.impulse_ratio != T::zero() && contact.is_singular());
        ImpactOutcome::of(Self::NAME, problem, impulse, u_plus, account, Some(self.impulse_ratio.abs()))
    }
}

/// Brach's law whose impulse ratio has the size of Coulomb's coefficient and acts towards rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BrachTowardsRest<T = f64> {
    pub restitution: T,
    pub friction: T,
}

impl<T: RealField + Copy> BrachTowardsRest<T> {
    fn towards_rest<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Brach<T> {
        let Self { restitution, friction } = *self;
        let contact = Contact::of(problem);
        let turned = Plane::of(&contact, &direction(&contact), restitution).critical().is_some_and(|r| r > T::zero());
        Brach { restitution, impulse_ratio: if turned { friction } else { -friction } }
    }
}

impl<T: RealField + Copy> Rule<T> for BrachTowardsRest<T> {
    fn family<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Family<T> {
        Family::Ratio(self.towards_rest(problem))
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        check_friction(self.friction)?;
        self.towards_rest(problem).answers(problem)
    }
}

impl Brach {
    /// The prescribed ratio along the initial slip, and the bound that clips a larger one of the same sign.
    pub(crate) fn asked_and_bound<const D: usize>(&self, problem: &ImpactProblem<f64, D>) -> (f64, f64) {
        let contact = Contact::of(problem);
        let plane = Plane::of(&contact, &direction(&contact), self.restitution);
        let asked = self.impulse_ratio;
        (asked, plane.clipped(asked.signum() * (1.0 + asked.abs()) * 1e6).0)
    }
}

/// The unit vector along the slip; without slip, which may be rounding of the approach, that along `H_tn`; without either zero.
fn direction<T: RealField + Copy>(contact: &Contact<T>) -> Vector2<T> {
    let along = |x: &Vector2<T>, least: T| {
        let size = length(x);
        (size > least).then(|| x / size)
    };
    let slip = along(&contact.slip, contact.v_n.abs() * rounding(CANCELLED));
    slip.or_else(|| along(&contact.coupling, T::zero())).unwrap_or_else(Vector2::zeros)
}

/// The contact in the plane of its initial slip, `v_t >= 0`.
struct Plane<T> {
    a: T,
    b: T,
    c: T,
    v_t: T,
    v_n: T,
    /// `-(1 + e) v_n`.
    gain: T,
}

impl<T: RealField + Copy> Plane<T> {
    fn of(contact: &Contact<T>, t: &Vector2<T>, e: T) -> Self {
        Self {
            a: t.dot(&(contact.tangents * t)),
            b: t.dot(&contact.coupling),
            c: contact.normal,
            v_t: t.dot(&contact.slip),
            v_n: contact.v_n,
            gain: -(T::one() + e) * contact.v_n,
        }
    }

    /// r₀, if there is one.
    fn critical(&self) -> Option<T> {
        (self.stops() > T::zero()).then(|| -self.slides() / self.stops())
    }

    /// `C v_t⁺` at r = 0.
    fn slides(&self) -> T {
        self.c * self.v_t + self.b * self.gain
    }

    /// The denominator of the critical ratio.
    fn stops(&self) -> T {
        self.b * self.v_t + self.a * self.gain
    }

    /// The admissible ratio nearest to the prescribed one, and whether it is the critical one.
    fn clipped(&self, asked: T) -> (T, bool) {
        let (ratio, rests) = match self.critical() {
            Some(r) if r <= T::zero() && asked <= r => (r, true),
            Some(r) if r >= T::zero() && asked >= r => (r, true),
            Some(r) if asked * r < T::zero() => (T::zero(), false),
            // No slip before, and none after without friction.
            Some(r) if r == T::zero() => (r, true),
            None if asked > T::zero() => (T::zero(), false),
            _ => (asked, false),
        };
        if self.gain == T::zero() {
            return (ratio, rests); // no approach: to stop the slip costs energy, any other impulse is zero
        }
        let bounded = self.within_energy(ratio);
        (bounded, rests && bounded == ratio)
    }

    /// The ratio where H is singular, and whether the slip ends: if it does so without friction, 0; else the prescribed one.
    fn unbounded(&self, asked: T) -> (T, bool) {
        let terms = (self.c * self.v_t).abs() + (self.b * self.gain).abs();
        let ends = self.slides().abs() <= terms * rounding(NULL_PIVOT);
        if ends { (T::zero(), true) } else { (asked, false) }
    }

    /// The ratio between 0 and `r` nearest to `r` that gains no energy.
    fn within_energy(&self, r: T) -> T {
        let (zero, two) = (T::zero(), convert::<f64, T>(2.0));
        // (T⁺ - T⁻)(C + r B)²/gain = α r² + β r + γ, with γ <= 0.
        let alpha = self.v_t * self.b + self.a * self.gain / two;
        let beta = self.v_t * self.c + (self.v_n + self.gain) * self.b;
        let gamma = self.c * (self.v_n + self.gain / two);
        if (alpha * r + beta) * r + gamma <= zero {
            return r;
        }
        // The root on the side of r, in the form without cancellation.
        let side = r.signum();
        let slope = beta * side;
        let root = (slope * slope - convert::<f64, T>(4.0) * alpha * gamma).max(zero);
        if slope < zero {
            side * (root.sqrt() - slope) / (two * alpha)
        } else if gamma == zero {
            zero
        } else {
            -side * two * gamma / (slope + root.sqrt())
        }
    }
}

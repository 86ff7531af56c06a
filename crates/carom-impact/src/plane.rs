//! From any contact to the plane of its slip, and back.
//!
//! Let t be the direction of slip, n the normal, b a tangent across t. If `u_b = 0` and
//! `H_bt = H_bn = 0`, then no impulse in the plane (t, n) starts motion along b, so slip never
//! leaves the plane, friction never leaves t, and the 2 × 2 problem in (t, n) is the whole of it:
//! an exact reduction, and a closed form. Where it fails slip turns as it goes, and the law works in
//! space (`flow/`, `cone.rs`).

use std::any::TypeId;

use nalgebra::{Matrix2, RealField, SVector, Vector2, convert};

use crate::branches::Answers;
use crate::contact::Contact;
use crate::flow::{Found, follow};
use crate::laws::{check_friction, check_restitution, frictionless};
use crate::outcome::Account;
use crate::problem::{plain, rounding};
use crate::routh::{Ending, walk};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// A coupling below this multiple of ε, beside the largest entry of H (or a velocity, beside
/// `|u|`), is taken for rounding.
const PLANE: f64 = 256.0;

/// When friction follows a slip that turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turns {
    /// At every instant.
    InTime,
    /// Only the last slip counts.
    AtTheEnd,
}

/// What a law finds in the plane of slip, before it is lifted back.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answer<T> {
    pub p_t: T,
    pub p_n: T,
    pub v_t: T,
    pub v_n: T,
    pub account: Account<T>,
    pub turns: Turns,
}

/// A law that answers by Routh's method, in the plane of slip or in space.
pub(crate) struct Routh<T> {
    pub law: &'static str,
    pub restitution: T,
    pub friction: T,
    pub ending: Ending,
}

impl<T: RealField + Copy> Routh<T> {
    pub fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        let Self { law, restitution: e, friction: mu, ending } = *self;
        check_restitution(e)?;
        check_friction(mu)?;
        let strike = || {
            let in_plane = |contact: &_| walk(contact, e, mu, ending);
            resolve_with_friction(law, e, mu, problem, in_plane, || follow(problem, e, mu, ending))
        };
        // At v_n = 0 there is a path only where friction drives the contact deeper.
        let from_rest = || if Contact::of(problem).jams(mu) { Ok(vec![strike()?]) } else { Ok(Vec::new()) };
        Answers::of(law, mu, problem, strike, from_rest)
    }
}

/// Answers `problem` with a law that works in the plane of slip where there is one, and else in space: an approach
/// along a normal that can move, coefficients in their range.
pub(crate) fn resolve_with_friction<T: RealField + Copy, const D: usize>(
    law: &'static str,
    restitution: T,
    mu: T,
    problem: &ImpactProblem<T, D>,
    in_plane: impl FnOnce(&ImpactProblem<T, 2>) -> Result<Answer<T>, ImpactError>,
    in_space: impl FnOnce() -> Result<Found<T, D>, ImpactError>,
) -> Result<ImpactOutcome<T, D>, ImpactError> {
    let Some(plane) = SlipPlane::of(problem) else {
        // Without friction no direction of slip is needed.
        if mu == T::zero() {
            return Ok(frictionless(law, restitution, problem));
        }
        let Found { impulse, u_plus, account } = in_space()?;
        return ImpactOutcome::of(law, problem, impulse, u_plus, &account).if_finite();
    };
    let contact = plane.contact(problem);
    let answer = in_plane(&contact)?;
    Ok(plane.lift(law, problem, mu, answer))
}

/// The answers beside the first of a law that has several.
pub(crate) fn others_with_friction<T: RealField + Copy, const D: usize>(
    law: &'static str,
    mu: T,
    problem: &ImpactProblem<T, D>,
    in_plane: impl FnOnce(&ImpactProblem<T, 2>) -> Option<Answer<T>>,
    in_space: impl FnOnce() -> Vec<Found<T, D>>,
) -> Vec<ImpactOutcome<T, D>> {
    if let Some(plane) = SlipPlane::of(problem) {
        let answer = in_plane(&plane.contact(problem));
        return answer.into_iter().map(|answer| plane.lift(law, problem, mu, answer)).collect();
    }
    let outcome = |Found { impulse, u_plus, account }| ImpactOutcome::of(law, problem, impulse, u_plus, &account);
    in_space().into_iter().filter_map(|found| outcome(found).if_finite().ok()).collect()
}

/// The planar contact that the slip never leaves, if there is one.
pub(crate) fn in_slip_plane<const D: usize>(problem: &ImpactProblem<f64, D>) -> Option<ImpactProblem<f64, 2>> {
    Some(SlipPlane::of(problem)?.contact(problem))
}

/// The plane through the normal in which the slip stays.
struct SlipPlane<T, const D: usize> {
    /// Unit tangent; zero if nothing moves or drives the contact along any tangent.
    t: SVector<T, D>,
    /// Slip velocity along t (m/s).
    v_t: T,
}

impl<T: RealField + Copy, const D: usize> SlipPlane<T, D> {
    /// Along the slip `u_t`; without slip along `h_tn`, where the normal impulse will drive it;
    /// without either the contact never leaves `v_t = 0` and any tangent, hence none, will do.
    fn of(problem: &ImpactProblem<T, D>) -> Option<Self> {
        let h = problem.delassus();
        let u = problem.u_minus();
        if D == 2 {
            let mut t = SVector::zeros();
            t[0] = T::one();
            return Some(Self { t, v_t: u[0] });
        }
        let tolerance: T = rounding(PLANE);
        if let Some(t) = along(u) {
            let v_t = t.dot(u);
            let plane = Self { t, v_t }.check(problem);
            // Slip that may be rounding of the approach has no direction worth a plane of its own.
            if plane.is_some() || v_t > u.norm() * tolerance {
                return plane;
            }
        }
        let drive = h.column(D - 1).into_owned();
        match along(&drive) {
            Some(t) if drive.dot(&t) > h.amax() * tolerance => Self { t, v_t: rest(t.dot(u)) }.check(problem),
            _ => Some(Self { t: SVector::zeros(), v_t: T::zero() }),
        }
    }

    /// `H_bt = H_bn = 0` for every tangent b across t.
    fn check(self, problem: &ImpactProblem<T, D>) -> Option<Self> {
        let n = D - 1;
        let h = problem.delassus();
        let allowed = h.amax() * rounding(PLANE);
        let across = |mut x: SVector<T, D>| {
            x[n] = T::zero();
            (x - self.t * self.t.dot(&x)).norm()
        };
        let tangent = across(h * self.t);
        let normal = across(h.column(n).into_owned());
        (tangent <= allowed && normal <= allowed).then_some(self)
    }

    /// The problem seen in (t, n).
    fn contact(&self, problem: &ImpactProblem<T, D>) -> ImpactProblem<T, 2> {
        let n = D - 1;
        let h = problem.delassus();
        let h_t = h * self.t;
        let (a, b, c) = (self.t.dot(&h_t), h_t[n], h[(n, n)]);
        ImpactProblem::trusted(Matrix2::new(a, b, b, c), Vector2::new(self.v_t, problem.u_minus()[n]))
    }

    /// The answer in contact axes: across the plane nothing moves, but derivatives do.
    fn lift(
        &self,
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        mu: T,
        mut answer: Answer<T>,
    ) -> ImpactOutcome<T, D> {
        let contact = self.contact(problem);
        let (_, b, c) = contact.abc();
        let (v_t, _) = contact.velocity();
        // dv_n/dp = C - μ s B <= 0 in the first slip.
        let jams = v_t != T::zero() && mu * v_t.signum() * b >= c;
        answer.account.flags |= Flags::JAM.when(jams);
        let mut impulse = self.t * answer.p_t;
        impulse[D - 1] = answer.p_n;
        let mut u_plus = self.t * answer.v_t;
        u_plus[D - 1] = answer.v_n;
        if D == 3 && mu > T::zero() && has_derivatives::<T>() {
            let (across, velocity) = self.across(problem, &answer, mu);
            impulse += across;
            u_plus += velocity;
        }
        ImpactOutcome::of(law, problem, impulse, u_plus, &answer.account)
    }
}

/// Zero, with the derivative of x.
fn rest<T: RealField + Copy>(x: T) -> T {
    x - convert(plain(x))
}

/// Whether `T` is more than a number. For numbers all that goes on across the plane is rounding.
fn has_derivatives<T: 'static>() -> bool {
    let this = TypeId::of::<T>();
    this != TypeId::of::<f64>() && this != TypeId::of::<f32>()
}

impl<T: RealField + Copy, const D: usize> SlipPlane<T, D> {
    /// Impulse and velocity across the plane, to first order in what leads out of it: `H_bt`, `H_bn` and `u_b`, whose
    /// values are rounding, but whose derivatives need not be.
    ///
    /// While the contact slips at speed r in direction s, friction turns with the slip, `p_b' = -μ w/r`, so that
    /// `w' = κ - μ H_bb w/r` with `κ = H_bn - μ s H_bt`; r changes at a constant rate ρ. From w = 0:
    ///
    /// ```text
    /// p_b = -μ κ r₀ S² e[0, ρS, -μ H_bb S],   S = ∫ dp/r,   e[…] the divided difference of exp
    /// ```
    ///
    /// Slip that begins from rest keeps `w/r`; a contact that sticks, or whose slip stops, has `w = 0`. (Where slip stops,
    /// w goes to zero as `r^α` with `α = μ H_bb/|ρ|`. Next to the plane it passes by zero at a distance of the order
    /// `δ^{1/(1-α)}`, δ being that to the plane: of higher order, but for small α by little.)
    fn across(&self, problem: &ImpactProblem<T, D>, answer: &Answer<T>, mu: T) -> (SVector<T, D>, SVector<T, D>) {
        let (zero, contact) = (T::zero(), Contact::of(problem));
        let t = Vector2::from_fn(|i, _| if i < D - 1 { self.t[i] } else { zero });
        let lift = |x: Vector2<T>| Contact::lift::<D>(&x, zero);
        if t.amax() == zero {
            // At rest, driven nowhere: it sticks.
            let p = -contact.mobility().least_solution(&(contact.slip + contact.coupling * answer.p_n));
            return (lift(p), SVector::zeros());
        }
        // The first slip, or the one to come, is along t.
        let v_t = self.v_t;
        let v_plus = answer.v_t;
        let b = Vector2::new(-t.y, t.x);
        let row = contact.tangents * b;
        let (h_bt, h_bb, h_bn) = (row.dot(&t), row.dot(&b), contact.coupling.dot(&b));
        let (along, drive, w) = (t.dot(&(contact.tangents * t)), contact.coupling.dot(&t), contact.slip.dot(&b));
        let frozen = h_bb <= contact.floor();
        let by = |x: T| if frozen { zero } else { x / h_bb };
        let pushed = h_bt * answer.p_t + h_bn * answer.p_n;
        if v_plus == zero {
            // Whatever the way, w = 0 at its end.
            return (lift(b * -by(w + pushed)), SVector::zeros());
        }
        if answer.turns == Turns::AtTheEnd {
            let share = answer.p_t.abs() / v_plus.abs();
            let end = (w + pushed) / (T::one() + h_bb * share);
            return (lift(b * -(end * share)), lift(b * end));
        }
        let stop = answer.account.slip_stop;
        let (first, rest) = match stop {
            Some(p) => (p, answer.p_n - p),
            None if v_t == zero => (zero, answer.p_n),
            None => (answer.p_n, zero),
        };
        let (mut p_b, mut end) = (zero, zero);
        if v_t != zero {
            let kappa = h_bn - mu * h_bt;
            if stop.is_some() {
                p_b = -by(kappa * first);
            } else {
                // Only the derivative of κ counts, whose factor is a plain number.
                let [r, rate, spread, p] = [v_t, drive - mu * along, mu * h_bb, first].map(plain);
                let s = if rate == 0.0 { p / r } else { (rate * p / r).ln_1p() / rate };
                let weight = r * s * s * exp_divided([0.0, rate * s, -spread * s]);
                p_b = -mu * kappa * convert::<f64, T>(weight);
                end = kappa * first + h_bb * p_b;
            }
        }
        if v_t == zero || stop.is_some() {
            // Slip back, or away, in direction s t + η b.
            let s = if v_t == zero { v_plus.signum() } else { -T::one() };
            let eta = (h_bn - mu * s * h_bt) / (s * drive - mu * along + mu * h_bb);
            p_b -= mu * eta * rest;
            end = eta * v_plus.abs();
        }
        (lift(b * p_b), lift(b * end))
    }
}

/// The divided difference `e[a, b, c]` of the exponential: its mean second derivative over the three, halved.
fn exp_divided(mut x: [f64; 3]) -> f64 {
    x.sort_by(f64::total_cmp);
    let [a, b, c] = x;
    if c - a < 0.5 {
        // Σ h_k(x - b)/(k + 2)!, with the complete symmetric polynomials h_k of (a - b) and (c - b).
        let (left, right) = (a - b, c - b);
        let (mut sum, mut h, mut power, mut factorial) = (0.0, 1.0, 1.0, 2.0);
        for k in 0..20 {
            sum += h / factorial;
            power *= right;
            h = h * left + power;
            factorial *= f64::from(k + 3);
        }
        return b.exp() * sum;
    }
    let first = |a: f64, b: f64| if b == a { a.exp() } else { b.exp() * (a - b).exp_m1() / (a - b) };
    (first(b, c) - first(a, b)) / (c - a)
}

/// Unit vector along the tangential part of `x`; `None` if that is zero.
fn along<T: RealField + Copy, const D: usize>(x: &SVector<T, D>) -> Option<SVector<T, D>> {
    let mut tangent = *x;
    tangent[D - 1] = T::zero();
    // Scaled first, lest the squares of small speeds underflow.
    let largest = tangent.amax();
    (largest > T::zero()).then(|| (tangent / largest).normalize())
}

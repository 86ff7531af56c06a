//! Exact reduction of a contact in space to the plane of its slip.
//!
//! Let t be the direction of slip, n the normal, b the tangent perpendicular to t. If `u_b = 0` and `H_bt = H_bn = 0`,
//! no impulse in the plane (t, n) accelerates the contact along b. The slip then stays in the plane, friction stays
//! along t, and the 2 × 2 problem in (t, n) is equivalent to the full one and has a closed form. Otherwise the slip
//! turns, and the law works in space (`flow/`, `cone.rs`).

use nalgebra::{Matrix2, RealField, SVector, Vector2, convert};

use crate::branches::Answers;
use crate::contact::Contact;
use crate::flow::{Found, follow};
use crate::laws::{check_friction, check_restitution, frictionless};
use crate::outcome::finite;
use crate::problem::plain;
use crate::rounding::{COUPLING, rounding};
use crate::routh::{Answer, Ending, Turns, walk};
use crate::scalar::{has_derivatives, rest, value};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// A law that uses Routh's method, in the plane of slip or in space.
pub(crate) struct Routh<T> {
    pub law: &'static str,
    pub restitution: T,
    pub friction: T,
    pub ending: Ending,
}

impl<T: RealField + Copy> Routh<T> {
    #[inline(always)]
    pub fn resolve<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        if problem.approach_speed() > T::zero() {
            check_restitution(self.restitution)?;
            check_friction(self.friction)?;
            problem.check_normal()?;
            return self.strike(problem);
        }
        Ok(self.answers(problem)?.first)
    }

    pub fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        check_restitution(self.restitution)?;
        check_friction(self.friction)?;
        // At v_n = 0 there is a path only where friction jams.
        let jams = || Contact::of(problem).jams(self.friction);
        let from_rest = || if jams() { Ok(vec![self.strike(problem)?]) } else { Ok(Vec::new()) };
        Answers::of(self.law, self.friction, problem, || self.strike(problem), from_rest)
    }

    #[inline(never)] // one place of use, so that its parts are inlined
    fn strike<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let Self { law, restitution: e, friction: mu, ending } = *self;
        let in_plane = |contact: &_| walk(contact, e, mu, ending);
        resolve_with_friction(law, e, mu, problem, in_plane, || follow(problem, e, mu, ending))
    }
}

impl<T: RealField + Copy> Routh<T> {
    /// The path of an impact whose slip turns in space; `None` for others.
    pub fn turning<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Option<Found<T, D>>, ImpactError> {
        let Self { restitution: e, friction: mu, ending, .. } = *self;
        if problem.approach_speed() <= T::zero() || mu == T::zero() || SlipPlane::of(problem).is_some() {
            return Ok(None);
        }
        check_restitution(e)?;
        check_friction(mu)?;
        problem.check_normal()?;
        follow(problem, e, mu, ending).map(Some)
    }

    /// The impulse alone. The coefficients are in their ranges.
    pub fn impulse<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<SVector<T, D>, ImpactError> {
        let Self { restitution: e, friction: mu, ending, .. } = *self;
        if problem.approach_speed() <= T::zero() {
            return Ok(SVector::zeros());
        }
        let impulse = match SlipPlane::of(problem) {
            Some(plane) => plane.ends(problem, mu, &walk(&plane.contact, e, mu, ending)?).0,
            None => follow(problem, e, mu, ending)?.impulse,
        };
        finite("the impulse", &impulse)?;
        Ok(impulse)
    }
}

/// Resolves `problem` with a law that works in the plane of slip if there is one, otherwise in space. Requires an
/// approach along a regular normal direction and coefficients in their ranges.
#[inline(always)]
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
            return frictionless(law, restitution, problem);
        }
        let Found { impulse, u_plus, account } = in_space()?;
        return ImpactOutcome::of(law, problem, impulse, u_plus, account, Some(mu));
    };
    let answer = in_plane(&plane.contact)?;
    plane.lift(law, problem, mu, answer)
}

/// The further solutions of a law that has several.
pub(crate) fn others_with_friction<T: RealField + Copy, const D: usize>(
    law: &'static str,
    mu: T,
    problem: &ImpactProblem<T, D>,
    in_plane: impl FnOnce(&ImpactProblem<T, 2>) -> Option<Answer<T>>,
    in_space: impl FnOnce() -> Vec<Found<T, D>>,
) -> Vec<ImpactOutcome<T, D>> {
    if let Some(plane) = SlipPlane::of(problem) {
        return in_plane(&plane.contact)
            .into_iter()
            .filter_map(|answer| plane.lift(law, problem, mu, answer).ok())
            .collect();
    }
    let outcome =
        |Found { impulse, u_plus, account }| ImpactOutcome::of(law, problem, impulse, u_plus, account, Some(mu));
    in_space().into_iter().filter_map(|found| outcome(found).ok()).collect()
}

/// The plane through the normal in which the slip stays.
pub(crate) struct SlipPlane<T, const D: usize> {
    /// Unit tangent; zero if the contact has no slip and no coupling along any tangent.
    t: SVector<T, D>,
    /// The problem in the axes (t, n).
    pub contact: ImpactProblem<T, 2>,
}

impl<T: RealField + Copy, const D: usize> SlipPlane<T, D> {
    /// The plane along the slip `u_t`; without slip the plane along `h_tn`, into which the normal impulse accelerates
    /// the contact; without either the contact stays at `v_t = 0`, and no tangent is needed.
    #[inline(always)]
    pub fn of(problem: &ImpactProblem<T, D>) -> Option<Self> {
        let h = problem.delassus();
        let u = problem.u_minus();
        if D < 3 {
            // One tangent, or none.
            let (n, zero) = (D - 1, T::zero());
            let (one, a, b, v_t) =
                if D == 2 { (T::one(), h[(0, 0)], h[(1, 0)], u[0]) } else { (zero, zero, zero, zero) };
            let contact = ImpactProblem::trusted(Matrix2::new(a, b, b, h[(n, n)]), Vector2::new(v_t, u[n]));
            return Some(Self { t: SVector::from_fn(|i, _| if i < n { one } else { zero }), contact });
        }
        let tolerance: T = rounding(COUPLING);
        if let Some((t, v_t)) = direction(u) {
            let plane = Self::along(problem, t, v_t);
            // The direction of a slip that may be rounding of the approach is undefined.
            if plane.is_some() || v_t > u.map(value).norm() * tolerance {
                return plane;
            }
        }
        let (t, v_t) = Self::from_rest(problem);
        Self::along(problem, t, v_t)
    }

    /// The direction into which the normal impulse accelerates a contact without slip, zero if there is none; and a slip that is
    /// zero but for its derivative.
    #[cold]
    fn from_rest(problem: &ImpactProblem<T, D>) -> (SVector<T, D>, T) {
        match direction(&problem.delassus().column(D - 1).into_owned()) {
            Some((t, drive)) if drive > value(problem.largest_entry()) * rounding(COUPLING) => {
                (t, rest(t.dot(problem.u_minus())))
            }
            _ => (SVector::zeros(), T::zero()),
        }
    }

    /// The plane along the unit tangent t, if `H_bt = H_bn = 0` for the tangent b perpendicular to it.
    #[inline(always)]
    fn along(problem: &ImpactProblem<T, D>, t: SVector<T, D>, v_t: T) -> Option<Self> {
        let (h, n) = (problem.delassus(), D - 1);
        let h_t = h.column(0) * t[0] + h.column(1) * t[1];
        let across = |x: T, y: T| value(t[0] * y - t[1] * x).abs();
        let allowed = value(problem.largest_entry()) * rounding(COUPLING);
        if across(h_t[0], h_t[1]) > allowed || across(h[(0, n)], h[(1, n)]) > allowed {
            return None;
        }
        let (a, b, c) = (t[0] * h_t[0] + t[1] * h_t[1], h_t[n], h[(n, n)]);
        let contact = ImpactProblem::trusted(Matrix2::new(a, b, b, c), Vector2::new(v_t, problem.u_minus()[n]));
        Some(Self { t, contact })
    }

    /// The outcome in contact axes. Across the plane all values are zero, but derivatives need not be.
    #[inline(always)]
    fn lift(
        &self,
        law: &'static str,
        problem: &ImpactProblem<T, D>,
        mu: T,
        mut answer: Answer<T>,
    ) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let contact = &self.contact;
        let (_, b, c) = contact.abc();
        let (v_t, _) = contact.velocity();
        // dv_n/dp = C - μ s B <= 0 in the first slip.
        let jams = v_t != T::zero() && mu * v_t.signum() * b >= c;
        answer.account.flags |= Flags::JAM.when(jams);
        let (impulse, u_plus) = self.ends(problem, mu, &answer);
        // Neither slip nor impulse across the plane: the energies, and their first derivatives, are those in the plane.
        let energies = contact.kinetic_energies([*contact.u_minus(), Vector2::new(answer.v_t, answer.v_n)]);
        ImpactOutcome::with_energies(law, problem, (impulse, u_plus), energies, answer.account, Some(mu))
    }

    /// Impulse and velocity after the impact in contact axes.
    #[inline(always)]
    fn ends(&self, problem: &ImpactProblem<T, D>, mu: T, answer: &Answer<T>) -> (SVector<T, D>, SVector<T, D>) {
        let in_axes = |tangent: T, normal: T| {
            SVector::from_fn(|i, _| match i {
                i if i == D - 1 => normal,
                _ if D == 2 => tangent,
                i => self.t[i] * tangent,
            })
        };
        let (mut impulse, mut u_plus) = (in_axes(answer.p_t, answer.p_n), in_axes(answer.v_t, answer.v_n));
        if D == 3 && mu > T::zero() && has_derivatives::<T>() {
            let (across, velocity) = self.across(problem, answer, mu);
            impulse += across;
            u_plus += velocity;
        }
        (impulse, u_plus)
    }
}

impl<T: RealField + Copy, const D: usize> SlipPlane<T, D> {
    /// Impulse and velocity across the plane, to first order in `H_bt`, `H_bn` and `u_b`, whose values are zero within
    /// rounding, but whose derivatives need not be.
    ///
    /// While the contact slips at speed r in direction s, friction turns with the slip, `p_b' = -μ w/r`, so that
    /// `w' = κ - μ H_bb w/r` with `κ = H_bn - μ s H_bt`; r changes at a constant rate ρ. From w = 0:
    ///
    /// ```text
    /// p_b = -μ κ r₀ S² e[0, ρS, -μ H_bb S],   S = ∫ dp/r,   e[…] the divided difference of exp
    /// ```
    ///
    /// If slip begins from rest, `w/r` is constant; if the contact sticks, or its slip stops, `w = 0`. (Where slip
    /// stops, w goes to zero as `r^α` with `α = μ H_bb/|ρ|`. Next to the plane it misses zero by a distance of the
    /// order `δ^{1/(1-α)}`, where δ is the distance to the plane; this is of higher order, but for small α only
    /// slightly.)
    fn across(&self, problem: &ImpactProblem<T, D>, answer: &Answer<T>, mu: T) -> (SVector<T, D>, SVector<T, D>) {
        let (zero, contact) = (T::zero(), Contact::of(problem));
        let t = Vector2::from_fn(|i, _| if i < D - 1 { self.t[i] } else { zero });
        let lift = |x: Vector2<T>| Contact::lift::<D>(&x, zero);
        if t.amax() == zero {
            // No slip and no coupling: it sticks.
            let p = -contact.mobility().least_solution(&(contact.slip + contact.coupling * answer.p_n));
            return (lift(p), SVector::zeros());
        }
        // The initial slip, or the slip that follows from rest, is along t.
        let (v_t, _) = self.contact.velocity();
        let v_plus = answer.v_t;
        let b = Vector2::new(-t.y, t.x);
        let row = contact.tangents * b;
        let (h_bt, h_bb, h_bn) = (row.dot(&t), row.dot(&b), contact.coupling.dot(&b));
        let (along, drive, w) = (t.dot(&(contact.tangents * t)), contact.coupling.dot(&t), contact.slip.dot(&b));
        let frozen = h_bb <= contact.floor();
        let by = |x: T| if frozen { zero } else { x / h_bb };
        let pushed = h_bt * answer.p_t + h_bn * answer.p_n;
        if v_plus == zero {
            // w = 0 at the end of any path to rest.
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
                // κ is zero but for its derivative, so its factor can be a plain number.
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

/// The divided difference `e[a, b, c]` of the exponential.
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

/// Unit vector along the tangential part of `x`, and its length; `None` if it is zero.
#[inline(always)]
fn direction<T: RealField + Copy, const D: usize>(x: &SVector<T, D>) -> Option<(SVector<T, D>, T)> {
    let mut tangent = *x;
    tangent[D - 1] = T::zero();
    // Along a contact axis without a root; derivatives may have a component across it.
    if D == 3 && (x[0] == T::zero() || x[1] == T::zero()) && !has_derivatives::<T>() {
        let (slip, length) = (x[0] + x[1], (x[0] + x[1]).abs());
        return (length > T::zero()).then(|| (tangent.map(|x| if x == T::zero() { x } else { slip.signum() }), length));
    }
    let (square, least) = (tangent.norm_squared(), T::default_epsilon().powi(4));
    if square > least && square * least < T::one() {
        let length = square.sqrt();
        return Some((tangent / length, length));
    }
    // Scaled first, so that the squares of small and large speeds stay within the range of numbers.
    let largest = tangent.amax();
    (largest > T::zero()).then(|| {
        let scaled = tangent / largest;
        (scaled.normalize(), scaled.norm() * largest)
    })
}

use nalgebra::{Matrix2, RealField, Vector2, convert};

use super::{Family, Rule, check_friction, check_restitution};
use crate::branches::Answers;
use crate::cone::{Cone, Touch};
use crate::contact::{Contact, Mobility, length};
use crate::outcome::{Account, Mode};
use crate::rounding::{NULL_PIVOT, rounding};
use crate::{Flags, ImpactError, ImpactOutcome, ImpactProblem};

/// A value below this multiple of ε times the terms it is compared with counts as zero.
const REST: f64 = 32.0;

/// Newton's coefficient, with friction against a weighted mean w of the slips before and after the impact.
///
/// ```text
/// u_n⁺ = -e u_n⁻
/// P_t  = -μ P_n w,   w = (|v_t⁻| v_t⁻ + |v_t⁺| v_t⁺)/(|v_t⁻|² + |v_t⁺|²),   |w| <= 1
/// ```
///
/// **Parameters.** `restitution` e, kinematic, in \[0, 1\]; `friction` μ >= 0.
///
/// **Guarantee.** `u_n⁺ = -e u_n⁻`. Never gains energy: with `x = |v_t⁻|` and `y = |v_t⁺|`, the contribution of
/// friction to the energy change is `½ P_t·(v_t⁻ + v_t⁺) <= -½ μ P_n (x + y)(x - y)²/(x² + y²)`. In the plane one
/// solution for every regular H: `v_t⁺` decreases with w, and w increases with `v_t⁺`. In space a solution exists for
/// every regular H, because the field `P_t + μ P_n w` points outwards on the whole boundary of the cone; uniqueness is
/// not proved.
///
/// **Fails** to stick: a slip that Coulomb friction would stop becomes small, but zero only as μ -> ∞. Slip that
/// reverses is hardly braked, because the two slips cancel in w. Without slip before, it is
/// [`Whittaker`](crate::Whittaker)'s law.
///
/// **Method.** Newton's method within the cone. If it stalls, friction is raised in steps, or the iteration starts from
/// a point reached along the field itself. It converges for each of 100 000 random problems in space (test
/// `smith_answers_100_000_impacts_in_space`).
///
/// **Works** are those of the straight path from u⁻ to u⁺, see [`Whittaker`](crate::Whittaker).
///
/// **Source.** Smith, *Predicting rebounds using rigid-body dynamics*, J. Appl. Mech. 58 (1991) 754.
///
/// ```
/// # use carom_impact::{ImpactProblem, Law, Smith};
/// # use nalgebra::{matrix, vector};
/// // Kane and Levinson's double pendulum.
/// let problem = ImpactProblem::new(
///     matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504],
///     vector![-0.267174342835_f64, -0.134202014333],
/// )?;
/// let hit = Smith { restitution: 0.5, friction: 0.5 }.resolve(&problem)?;
/// assert!((hit.u_plus - vector![0.044315, 0.067101]).amax() < 1e-6);
/// assert!((hit.energy_ratio() - 0.566774).abs() < 1e-6);
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smith<T = f64> {
    /// Kinematic coefficient of restitution, 0 to 1.
    pub restitution: T,
    /// Coulomb coefficient of friction, 0 or more.
    pub friction: T,
}

impl<T: RealField + Copy> Rule<T> for Smith<T> {
    fn family<const D: usize>(&self, _: &ImpactProblem<T, D>) -> Family<T> {
        Family::Mean
    }

    fn answers<const D: usize>(&self, problem: &ImpactProblem<T, D>) -> Result<Answers<T, D>, ImpactError> {
        let (e, mu) = (self.restitution, self.friction);
        check_restitution(e)?;
        check_friction(mu)?;
        let contact = Contact::of(problem);
        let strike = || {
            let found = answer(&contact, e, mu);
            let refused = || contact.wedged(mu, contact.v_n, contact.held_inverse_mass());
            self.outcome(problem, found.ok_or_else(refused)?)
        };
        let from_rest = || from_rest(&contact, mu).map(|found| self.outcome(problem, found)).into_iter().collect();
        Answers::of(Self::NAME, mu, problem, strike, from_rest)
    }
}

impl<T: RealField + Copy> Smith<T> {
    fn outcome<const D: usize>(
        &self,
        problem: &ImpactProblem<T, D>,
        (tangent, p_n, v_t): (Vector2<T>, T, Vector2<T>),
    ) -> Result<ImpactOutcome<T, D>, ImpactError> {
        let (e, mu, contact) = (self.restitution, self.friction, Contact::of(problem));
        let impulse = Contact::lift(&tangent, p_n);
        let u_plus = Contact::lift(&v_t, -e * contact.v_n);
        let mut account = Account::straight(e, &impulse, problem.u_minus(), &u_plus);
        if account.mode == Mode::Stick && contact.slip.amax() > T::zero() {
            account.mode = Mode::Slip; // this law does not stick
        }
        account.flags |= Flags::SINGULAR.when(mu > T::zero() && contact.is_singular());
        ImpactOutcome::of(Self::NAME, problem, impulse, u_plus, account, Some(mu))
    }
}

/// `(P_t, P_n, v_t⁺)`.
fn answer<T: RealField + Copy>(contact: &Contact<T>, e: T, mu: T) -> Option<(Vector2<T>, T, Vector2<T>)> {
    let gain = -(T::one() + e) * contact.v_n;
    let cone = || {
        let cone = Cone::new(contact.tangents, contact.coupling, contact.normal);
        cone.solve(mu, &contact.slip, -gain, || gain)
    };
    // No slip before, or one that may be rounding of the approach: then w has the direction of the slip after.
    if length(&contact.slip) <= gain * rounding(REST) && mu > T::zero() {
        let touch = cone()?;
        return Some((touch.tangent, touch.normal, touch.tangent * -touch.slip));
    }
    let equation = Equation::of(contact, gain);
    let near = || equation.near(mu, &cone()?, &contact.at_held_normal());
    // A slip so slow that w reverses within the rounding of v_t⁺; the error of `near` is of second order.
    let slow = length(&contact.slip) <= length(&equation.start) * T::default_epsilon().sqrt();
    if slow
        && mu > T::zero()
        && let Some((x, Some(v_t))) = near()
    {
        return Some((x, equation.normal(&x), v_t));
    }
    let x = equation.solve(mu, || near().map(|(x, _)| x))?;
    Some((x, equation.normal(&x), equation.end(&x)))
}

/// The finite solution at `v_n = 0`, if there is one: Newton's method from the solution for a slow approach.
fn from_rest<T: RealField + Copy>(contact: &Contact<T>, mu: T) -> Option<(Vector2<T>, T, Vector2<T>)> {
    let (zero, speed) = (T::zero(), length(&contact.slip));
    if speed == zero || mu == zero {
        return None;
    }
    let slow = Contact { v_n: -speed * convert(1e-6), ..*contact };
    let equation = Equation::of(contact, zero);
    let x = equation.newton(mu, answer(&slow, zero, mu)?.0)?;
    // An impulse that does not change the slip is zero within rounding.
    let moves = length(&(equation.tangents * x)) > speed * convert(1e-3);
    moves.then(|| (x, equation.normal(&x), equation.end(&x)))
}

/// `x + μ P_n(x) w(x) = 0` for `x = P_t`, with the normal impulse eliminated.
struct Equation<T> {
    slip: Vector2<T>,
    /// P_n at x = 0.
    smooth: T,
    /// `h/C`.
    tilt: Vector2<T>,
    /// `A - h hᵀ/C`, whose rounding alone would otherwise stop the slip, by impulses of its inverse.
    tangents: Matrix2<T>,
    /// v_t⁺ at x = 0.
    start: Vector2<T>,
}

impl<T: RealField + Copy> Equation<T> {
    fn of(contact: &Contact<T>, gain: T) -> Self {
        let tilt = contact.coupling / contact.normal;
        Self {
            slip: contact.slip,
            smooth: gain / contact.normal,
            tilt,
            tangents: contact.at_held_normal().matrix(),
            start: contact.slip + contact.coupling * (gain / contact.normal),
        }
    }

    fn normal(&self, x: &Vector2<T>) -> T {
        self.smooth - self.tilt.dot(x)
    }

    fn end(&self, x: &Vector2<T>) -> Vector2<T> {
        self.start + self.tangents * x
    }

    /// The weighted mean w of the slips before and after; zero without slip.
    fn mean(&self, v_t: &Vector2<T>) -> Vector2<T> {
        let (before, after) = (length(&self.slip), length(v_t));
        let squares = before * before + after * after;
        if squares == T::zero() { Vector2::zeros() } else { (self.slip * before + v_t * after) / squares }
    }

    /// Left side and its derivative.
    fn value(&self, mu: T, x: &Vector2<T>) -> (Vector2<T>, Matrix2<T>) {
        let (y, p_n) = (self.end(x), self.normal(x));
        let (w, before, after) = (self.mean(&y), length(&self.slip), length(&y));
        let squares = before * before + after * after;
        // d(|y| y) = |y| 1 + y yᵀ/|y|
        let mut rate = Matrix2::identity() * after - w * y.transpose() * convert::<f64, T>(2.0);
        if after > T::zero() {
            rate += y * y.transpose() / after;
        }
        let slope = Matrix2::identity() + rate * self.tangents * (mu * p_n / squares) - w * self.tilt.transpose() * mu;
        (x + w * (mu * p_n), slope)
    }

    /// An estimate for slow slips, near the solution on the cone. If that one sticks, its friction is -μ P_n w, and w
    /// determines the remaining slip `v_t⁺ = |v_t⁻| z` by
    ///
    /// ```text
    /// |z| z = w (1 + |z|²) - v,  v = v_t⁻/|v_t⁻|
    /// ```
    fn near(&self, mu: T, touch: &Touch<T>, mobility: &Mobility<T>) -> Option<(Vector2<T>, Option<Vector2<T>>)> {
        if touch.slip > T::zero() {
            return Some((touch.tangent, None));
        }
        let (one, speed) = (T::one(), length(&self.slip));
        let (w, v) = (-touch.tangent / (mu * touch.normal), self.slip / speed);
        // a |z|⁴ - 2 b |z|² - c = 0
        let (a, b, c) = (one - w.norm_squared(), w.dot(&(w - v)), (w - v).norm_squared());
        let square = (b + (b * b + a * c).sqrt()) / a;
        let z = (w * (one + square) - v) / square.sqrt();
        let x = touch.tangent + mobility.least_solution(&(z * speed));
        (x.x + x.y).is_finite().then_some((x, Some(z * speed)))
    }

    /// Newton's method from zero friction; if it stalls, from the estimate for slow slips; then with friction raised in
    /// steps; then along the field.
    ///
    /// Where no impulse at held normal velocity changes the slip, `v_t⁺` and w are given and the equation is linear,
    /// `P_n (1 - μ w·h/C) = P_n(0)`: without a solution where friction wedges the contact.
    fn solve(&self, mu: T, near: impl FnOnce() -> Option<Vector2<T>>) -> Option<Vector2<T>> {
        if self.tangents.iter().all(|entry| *entry == T::zero()) {
            let w = self.mean(&self.start);
            let (hold, lift) = (T::one(), mu * w.dot(&self.tilt));
            let wedges = hold - lift <= (hold + lift.abs()) * rounding(NULL_PIVOT);
            return (!wedges).then(|| w * (-mu * self.smooth / (hold - lift)));
        }
        if let Some(x) = self.newton(mu, Vector2::zeros()) {
            return Some(x);
        }
        if let Some(x) = near().and_then(|x| self.newton(mu, x)) {
            return Some(x);
        }
        if let Some(x) = self.raised(mu) {
            return Some(x);
        }
        // The field points out of the cone on its whole boundary, so steps against it end inside.
        let mut x = Vector2::zeros();
        for _ in 0..200 {
            for _ in 0..64 {
                let (f, slope) = self.value(mu, &x);
                x -= f / (T::one() + slope.norm());
            }
            if let Some(x) = self.newton(mu, x) {
                return Some(x);
            }
        }
        None
    }

    /// Newton's method with friction raised in steps.
    fn raised(&self, mu: T) -> Option<Vector2<T>> {
        let half: T = convert(0.5);
        let (mut x, mut share, mut step) = (Vector2::zeros(), T::zero(), convert::<f64, T>(1.0 / 64.0));
        for _ in 0..200 {
            let next = (share + step).min(T::one());
            match self.newton(mu * next, x) {
                Some(found) if next == T::one() => return Some(found),
                Some(found) => (x, share, step) = (found, next, step * convert(1.5)),
                None => step *= half,
            }
        }
        None
    }

    fn newton(&self, mu: T, mut x: Vector2<T>) -> Option<Vector2<T>> {
        let half: T = convert(0.5);
        let (mut f, mut slope) = self.value(mu, &x);
        for _ in 0..60 {
            let det = slope.determinant();
            if det == T::zero() {
                return None;
            }
            let step =
                Vector2::new(slope[(1, 1)] * f.x - slope[(0, 1)] * f.y, slope[(0, 0)] * f.y - slope[(1, 0)] * f.x)
                    / det;
            let size = length(&f);
            let scale = length(&x) + mu * self.normal(&x);
            let mut share = T::one();
            let next = loop {
                let next = x - step * share;
                let p_n = self.normal(&next);
                let (g, g_slope) = self.value(mu, &next);
                // At rounding, one more full step makes the derivatives of dual numbers converge.
                if size <= scale * rounding(16.0) && p_n > T::zero() {
                    return Some(next);
                }
                let falls = length(&g) < size * (T::one() - share * convert(1e-4));
                if p_n > T::zero() && falls {
                    break (next, g, g_slope);
                }
                share *= half;
                if share < convert(1e-9) {
                    // The rounding error of w may be larger, as its slope is 1/|v_t⁻|, and that of P_n, a difference.
                    let rough = scale * T::default_epsilon().sqrt() + mu * self.smooth * rounding(16.0);
                    let settled =
                        length(&step) <= length(&x) * T::default_epsilon().sqrt() && size <= length(&x) * convert(1e-4);
                    return (size <= rough || settled).then_some(x);
                }
            };
            (x, f, slope) = next;
        }
        None
    }
}

//! Routh's method in the plane: integrates an impact in closed form along straight segments, with the normal impulse p
//! as the independent variable.
//!
//! Rigid bodies, Coulomb friction. While slip keeps its direction s, friction is `-μ s` per unit of normal impulse, and
//! the velocity changes at a constant rate. When slip stops, the contact sticks if friction is large enough, otherwise
//! it slips back. An impact therefore has at most two segments:
//!
//! | segment | `dv_t/dp` | `dv_n/dp` | `dp_t/dp` |
//! |---|---|---|---|
//! | slip s | `B - μ s A` | `C - μ s B` | `-μ s` |
//! | stick | 0 | `det H/A` | `-B/A` |
//!
//! Compression ends at `v_n = 0`. Three laws share this path and differ in the end of restitution ([`Ending`]). By the
//! order of the events "slip stops" and "compression ends" an impact belongs to one of these classes:
//!
//! | class | slip stops | then |
//! |---|---|---|
//! | A | never | the three laws agree |
//! | C | in restitution | sticks or slips back |
//! | B | in compression | sticks or slips back; the three laws differ only in the impulse of restitution |
//! | B, jam | in compression, after `v_n` has become more negative (`μ s B >= C`) | sticks |
//!
//! A solution exists and is unique for every regular H, `μ >= 0`, `v_n < 0`: after slip has stopped, `dv_n/dp > 0` in
//! both cases. Stick has `det H/A > 0`; slip back towards `sign B` requires `μ < |B|/A < C/|B|`, so that
//! `C - μ|B| > 0`. And slip that jams does stop: `μ s B >= C` gives `μ A >= A C/|B| > |B|`, so v_t decreases to zero.
//!
//! Symbols: `(a, b, c)` = (H_tt, H_tn, H_nn) in 1/kg; velocities in m/s, impulses in N s, work in J.
//!
//! Sources: Routh, *Dynamics of a System of Rigid Bodies* (1860, 1905); Keller, J. Appl. Mech. 53 (1986) 1; Wang and
//! Mason, J. Appl. Mech. 59 (1992) 635; Stronge, Proc. R. Soc. A 431 (1990) 169.

use nalgebra::{RealField, convert};

use crate::outcome::{Account, Mode, Phase};
use crate::problem::plain;
use crate::rounding::rounding;
use crate::{Flags, ImpactError, ImpactProblem};

/// Which slip friction is opposed to, if the slip turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turns {
    /// That of each instant.
    InTime,
    /// The final slip.
    AtTheEnd,
}

/// The result of a law in the plane of slip.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Answer<T> {
    pub p_t: T,
    pub p_n: T,
    pub v_t: T,
    pub v_n: T,
    pub account: Account<T>,
    pub turns: Turns,
}

/// The condition that ends restitution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    /// `v_n = -e v_n⁻`.
    Velocity,
    /// Impulse of restitution = e × impulse of compression.
    Impulse,
    /// Normal work of restitution = -e² × normal work of compression.
    Work,
}

/// A segment of the path: constant rates in the normal impulse p.
#[derive(Debug, Clone, Copy)]
struct Segment<T> {
    mode: Mode,
    /// `dv_t/dp` (1/kg).
    tangent_rate: T,
    /// `dv_n/dp` (1/kg).
    normal_rate: T,
    /// `dp_t/dp`.
    friction_rate: T,
}

impl<T: RealField + Copy> Segment<T> {
    /// Slip in direction s = ±1.
    fn slip(contact: &ImpactProblem<T, 2>, mu: T, s: T, mode: Mode) -> Self {
        let (a, b, c) = contact.abc();
        Self { mode, tangent_rate: b - mu * s * a, normal_rate: c - mu * s * b, friction_rate: -mu * s }
    }

    /// The tangential impulse that keeps `v_t = 0`: `A dp_t + B dp = 0`.
    fn stick(contact: &ImpactProblem<T, 2>) -> Self {
        let (tangent_rate, normal_rate) = (T::zero(), contact.held_inverse_mass());
        Self { mode: Mode::Stick, tangent_rate, normal_rate, friction_rate: -contact.hold() }
    }
}

/// The state on the path.
#[derive(Debug, Clone, Copy)]
struct Walk<T> {
    p: T,
    p_t: T,
    v_t: T,
    v_n: T,
    normal_work: T,
    friction_work: T,
}

impl<T: RealField + Copy> Walk<T> {
    fn start(v_t: T, v_n: T) -> Self {
        let zero = T::zero();
        Self { p: zero, p_t: zero, v_t, v_n, normal_work: zero, friction_work: zero }
    }

    /// The state at the end of compression, `v_n = 0`, with impulse and works reset to zero: added to the work of
    /// compression, a small work of restitution would be lost in rounding.
    fn turn(&self) -> Self {
        Self::start(self.v_t, T::zero())
    }

    fn advanced(mut self, segment: &Segment<T>, dp: T) -> Self {
        self.advance(segment, dp);
        self
    }

    /// Advances by `dp >= 0` along `segment`. Velocities are linear in p, so the trapezium rule gives the exact work. A
    /// negative `dp`, which can only be rounding, counts as zero.
    fn advance(&mut self, segment: &Segment<T>, dp: T) {
        let dp = dp.max(T::zero());
        let half: T = convert(0.5);
        let dp_t = segment.friction_rate * dp;
        let (v_t, v_n) = (self.v_t, self.v_n);
        self.v_t += segment.tangent_rate * dp;
        self.v_n += segment.normal_rate * dp;
        self.p += dp;
        self.p_t += dp_t;
        self.normal_work += dp * (v_n + self.v_n) * half;
        self.friction_work += dp_t * (v_t + self.v_t) * half;
    }
}

/// Integrates the contact from `v_n < 0`, or from a jam at `v_n = 0`, to the end of restitution.
///
/// If `det H = 0`, a sticking contact has no inverse mass along its normal. If it begins to stick exactly when
/// compression ends, as a single-joint arm does, it stays at `v_n = 0`, without further impulse unless the law
/// prescribes the impulse itself; if it sticks before, it wedges.
#[inline(always)]
pub(crate) fn walk<T: RealField + Copy>(
    contact: &ImpactProblem<T, 2>,
    e: T,
    mu: T,
    ending: Ending,
) -> Result<Answer<T>, ImpactError> {
    let zero = T::zero();
    let (v_t, v_n) = contact.velocity();
    let slips = v_t != zero;
    // Without slip there is only the second segment. If that is stick, a slip of value 0 with a derivative stops at
    // once, in any direction; if not, it has the direction of that segment.
    let rests = !slips && mu >= contact.mu_stick();
    let s = match sign(v_t) {
        s if s != zero => s,
        _ if rests => T::one(),
        _ => sign(contact.abc().1),
    };
    let first = Segment::slip(contact, mu, s, Mode::Slip);
    let wedged = |held: T, inverse_mass: T| ImpactError::Wedged {
        friction: plain(mu),
        normal_velocity: plain(held),
        inverse_mass: plain(inverse_mass),
        free_inverse_mass: plain(contact.abc().2),
    };

    // p1: slip stops; at once if there is none.
    let slip_stops = if rests && first.tangent_rate == zero {
        Some(zero)
    } else {
        (rests || s * first.tangent_rate < zero).then(|| -v_t / first.tangent_rate)
    };
    // pc: compression ends, if slip lasts until then.
    let slip_peaks = (first.normal_rate > zero).then(|| -v_n / first.normal_rate);
    if slip_stops.is_none() && contact.is_locked(first.normal_rate) {
        return Err(wedged(v_n, first.normal_rate));
    }

    let mut down = Walk::start(v_t, v_n);
    let mut up;
    let mut slip_end = None;
    let (mut mode, mut realised) = (first.mode, [e; 3]);
    if let Some(pc) = slip_peaks.filter(|&pc| slip_stops.is_none_or(|p1| p1 >= pc + e * pc)) {
        // A: with one rate throughout, all three laws end at p = (1 + e) pc.
        down.advance(&first, pc);
        up = down.turn().advanced(&first, e * pc);
    } else {
        // Slip neither stops nor raises v_n: refused above, and impossible for det H > 0.
        let Some(p1) = slip_stops else { return Err(wedged(v_n, first.normal_rate)) };
        let then = after_slip(contact, mu, sign(v_t));
        let (locked, by_rate) = (contact.is_locked(then.normal_rate), T::one() / then.normal_rate);
        if let Some(pc) = slip_peaks.filter(|&pc| p1 >= pc) {
            // C: compression ends, slip stops, restitution goes on.
            down.advance(&first, pc);
            up = down.turn().advanced(&first, p1 - pc);
            up.v_t = zero;
            slip_end = Some(Phase::Restitution);
        } else {
            // B: slip stops, compression goes on.
            down.advance(&first, p1);
            down.v_t = zero;
            if !locked {
                down.advance(&then, -down.v_n * by_rate);
            } else if down.v_n < (v_n - first.normal_rate.abs() * p1) * rounding(1024.0) {
                return Err(wedged(down.v_n, then.normal_rate));
            }
            up = down.turn();
            slip_end = Some(Phase::Compression);
        }
        let end = End { ending, e, v_n_minus: v_n, pc: down.p, work: down.normal_work };
        up.advance(&then, end.left(up.p, up.v_n, up.normal_work, then.normal_rate, locked));
        (mode, realised) =
            (then.mode, [-up.v_n / v_n, up.p / down.p, coefficient_of_work(up.normal_work, down.normal_work)]);
    }

    let [newton, poisson, energetic] = realised;
    Ok(Answer {
        p_t: down.p_t + up.p_t,
        p_n: down.p + up.p,
        v_t: up.v_t,
        v_n: up.v_n,
        account: Account {
            normal_work: down.normal_work + up.normal_work,
            friction_work: down.friction_work + up.friction_work,
            newton: (v_n != zero).then_some(newton),
            poisson: Some(poisson),
            energetic: Some(energetic),
            mode,
            slip_end: slip_end.filter(|_| slips),
            slip_stop: slip_stops.filter(|_| slip_end.is_some() && slips),
            flags: Flags::SINGULAR.when(mu > zero && contact.is_singular()),
        },
        turns: Turns::InTime,
    })
}

/// `sqrt(-returned/taken)`. At 0, where the root has no derivative, dual numbers get 0.
pub(crate) fn coefficient_of_work<T: RealField + Copy>(returned: T, taken: T) -> T {
    if returned > T::zero() { (-returned / taken).sqrt() } else { T::zero() }
}

/// The segment after slip s has stopped: stick if friction is large enough, otherwise slip towards `sign B`. This is
/// slip back: slip s stops only if `s B < μ A`, and with `μ A < |B|` it follows that `s B < 0`.
fn after_slip<T: RealField + Copy>(contact: &ImpactProblem<T, 2>, mu: T, s: T) -> Segment<T> {
    if mu >= contact.mu_stick() {
        return Segment::stick(contact);
    }
    let (_, b, _) = contact.abc();
    let mode = if s == T::zero() { Mode::Slip } else { Mode::ReverseSlip };
    Segment::slip(contact, mu, sign(b), mode)
}

/// The condition that ends restitution, with the quantities of compression that it needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct End<T> {
    pub ending: Ending,
    pub e: T,
    pub v_n_minus: T,
    /// Normal impulse of compression (N s).
    pub pc: T,
    /// Normal work of compression, negative (J).
    pub work: T,
}

impl<T: RealField + Copy> End<T> {
    /// The normal impulse to the end of restitution at the constant rate `dv_n/dp`, from a state with impulse p,
    /// velocity v_n and work since the end of compression.
    #[inline(always)]
    pub fn left(&self, p: T, v_n: T, work: T, rate: T, locked: bool) -> T {
        // Inverted first: the quotient would wait for the works.
        let (two, by_rate) = (convert::<f64, T>(2.0), T::one() / rate);
        let Self { e, .. } = *self;
        match self.ending {
            Ending::Impulse => e * self.pc - p,
            // No impulse changes v_n of a locked contact.
            _ if locked => T::zero(),
            Ending::Velocity => (-e * self.v_n_minus - v_n) * by_rate,
            Ending::Work if v_n == T::zero() => e * (-two * self.work * by_rate).sqrt(),
            Ending::Work => {
                // The root x of v_n x + rate x²/2 = left, in the form without cancellation.
                let left = -e * e * self.work - work;
                two * left / (v_n + (v_n * v_n + two * rate * left).sqrt())
            }
        }
    }
}

/// -1, 0 or 1.
fn sign<T: RealField + Copy>(x: T) -> T {
    if x > T::zero() {
        T::one()
    } else if x < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}

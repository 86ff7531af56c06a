//! Routh's method in the plane: the impact as a walk along straight lines, with the normal impulse
//! p as its clock.
//!
//! Rigid bodies, Coulomb friction. While slip keeps its direction s, friction is `-μ s` per unit
//! of normal impulse and the velocity moves at a constant rate; when slip stops, the contact
//! sticks if friction can hold it, and slips back if not. So there are two segments at most:
//!
//! | segment | `dv_t/dp` | `dv_n/dp` | `dp_t/dp` |
//! |---|---|---|---|
//! | slip s | `B - μ s A` | `C - μ s B` | `-μ s` |
//! | stick | 0 | `det H/A` | `-B/A` |
//!
//! Compression ends at `v_n = 0`. Three laws share the walk; only the end of restitution differs
//! ([`Ending`]). By the order of the two events, "slip stops" and "compression ends", an impact is
//! of one of these classes:
//!
//! | class | slip stops | then |
//! |---|---|---|
//! | A | never | the three laws agree |
//! | C | in restitution | sticks or slips back |
//! | B | in compression | sticks or slips back; the three laws agree up to Δp |
//! | B, jam | in compression, after `v_n` has become more negative (`μ s B >= C`) | sticks |
//!
//! An answer exists and is unique for every regular H, `μ >= 0`, `v_n < 0`: after slip stops,
//! `dv_n/dp > 0` in both cases. Stick has `det H/A > 0`; slipping back towards `sign B` needs
//! `μ < |B|/A < C/|B|`, so that `C - μ|B| > 0`. And slip that drives the contact deeper does stop:
//! `μ s B >= C` gives `μ A >= A C/|B| > |B|`, so v_t runs to zero.
//!
//! Symbols: `(a, b, c)` = (H_tt, H_tn, H_nn) in 1/kg; velocities in m/s, impulses in N s, work in J.
//!
//! Sources: Routh, *Dynamics of a System of Rigid Bodies* (1860, 1905); Keller, J. Appl. Mech. 53
//! (1986) 1; Wang and Mason, J. Appl. Mech. 59 (1992) 635; Stronge, Proc. R. Soc. A 431 (1990) 169.

use nalgebra::{RealField, convert};

use crate::outcome::{Account, Mode, Phase};
use crate::plane::{Answer, Turns};
use crate::problem::{plain, rounding};
use crate::{Flags, ImpactError, ImpactProblem};

/// What ends the restitution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    /// `v_n = -e v_n⁻`.
    Velocity,
    /// Impulse of restitution = e × impulse of compression.
    Impulse,
    /// Normal work of restitution = -e² × normal work of compression.
    Work,
}

/// Constant rates in the normal impulse p.
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

    /// The tangential impulse that keeps `v_t = 0`: `A dp_t + B dp = 0`. `held` is `det H/A`.
    fn stick(contact: &ImpactProblem<T, 2>, held: T) -> Self {
        let (a, b, _) = contact.abc();
        let frozen = contact.tangent_is_frozen();
        Self {
            mode: Mode::Stick,
            tangent_rate: T::zero(),
            normal_rate: held,
            friction_rate: if frozen { T::zero() } else { -b / a },
        }
    }
}

/// Where the walk stands.
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

    /// Restitution begins where compression ends, at `v_n = 0`, with books of its own: a small
    /// work returned would drown in the rounding of the work put in.
    fn turn(&self) -> Self {
        Self::start(self.v_t, T::zero())
    }

    fn advanced(mut self, segment: &Segment<T>, dp: T) -> Self {
        self.advance(segment, dp);
        self
    }

    /// Goes on by `dp >= 0` along `segment`. Velocities are linear in p, so the trapezium rule is
    /// the exact work. A step that rounding turned backwards is none.
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

/// Walks the contact from `v_n < 0`, or from a jam at `v_n = 0`, to the end of restitution.
///
/// A held contact without mobility along its normal (`det H = 0`) cannot be pushed off: if it is
/// held exactly when compression ends, as a single-joint arm is, it stays at `v_n = 0`, with no
/// further impulse unless the impulse itself is prescribed; if it is held before, it wedges.
pub(crate) fn walk<T: RealField + Copy>(
    contact: &ImpactProblem<T, 2>,
    e: T,
    mu: T,
    ending: Ending,
) -> Result<Answer<T>, ImpactError> {
    let zero = T::zero();
    let (v_t, v_n) = contact.velocity();
    let held = contact.held_inverse_mass();
    let then = after_slip(contact, mu, sign(v_t), held);
    // Without slip there is but what follows. If that is stick, a slip too small to see (the derivative of one) stops
    // at once, in whichever direction; if not, it goes on as what follows does.
    let s = match sign(v_t) {
        s if s != zero => s,
        _ if then.mode == Mode::Stick => T::one(),
        _ => sign(contact.abc().1),
    };
    let first = Segment::slip(contact, mu, s, Mode::Slip);
    let locked = contact.is_locked(then.normal_rate);
    let wedged = |held: T, inverse_mass: T| ImpactError::Wedged {
        friction: plain(mu),
        normal_velocity: plain(held),
        inverse_mass: plain(inverse_mass),
        free_inverse_mass: plain(contact.abc().2),
    };

    // p1: slip stops. It does at once if there is none.
    let slip_stops = if v_t == zero && then.mode == Mode::Stick {
        Some(if first.tangent_rate == zero { zero } else { -v_t / first.tangent_rate })
    } else if s * first.tangent_rate < zero {
        Some(-v_t / first.tangent_rate)
    } else {
        None
    };
    // pc: compression ends, if slip lasts until then.
    let slip_peaks = (first.normal_rate > zero).then(|| -v_n / first.normal_rate);
    if slip_stops.is_none() && contact.is_locked(first.normal_rate) {
        return Err(wedged(v_n, first.normal_rate));
    }

    let mut down = Walk::start(v_t, v_n);
    let up;
    let slip_end = match (slip_peaks, slip_stops) {
        // A: with one rate throughout, every ending is at p = (1 + e) pc.
        (Some(pc), p1) if p1.is_none_or(|p1| p1 >= pc + e * pc) => {
            down.advance(&first, pc);
            up = down.turn().advanced(&first, e * pc);
            None
        }
        // C: compression ends, slip stops, restitution goes on.
        (Some(pc), Some(p1)) if p1 >= pc => {
            down.advance(&first, pc);
            let mut back = down.turn().advanced(&first, p1 - pc);
            back.v_t = zero;
            let end = End { ending, e, v_n_minus: v_n, pc: down.p, work: down.normal_work };
            let rest = end.left(back.p, back.v_n, back.normal_work, then.normal_rate, locked);
            up = back.advanced(&then, rest);
            Some(Phase::Restitution)
        }
        // B: slip stops, compression goes on.
        (_, Some(p1)) => {
            down.advance(&first, p1);
            down.v_t = zero;
            if !locked {
                down.advance(&then, -down.v_n / then.normal_rate);
            } else if down.v_n < (v_n - first.normal_rate.abs() * p1) * rounding(1024.0) {
                return Err(wedged(down.v_n, then.normal_rate));
            }
            let back = down.turn();
            let end = End { ending, e, v_n_minus: v_n, pc: down.p, work: down.normal_work };
            let rest = end.left(back.p, back.v_n, back.normal_work, then.normal_rate, locked);
            up = back.advanced(&then, rest);
            Some(Phase::Compression)
        }
        // Slip neither stops nor lifts v_n: refused above, and det H > 0 forbids it.
        (_, None) => return Err(wedged(v_n, first.normal_rate)),
    };

    Ok(Answer {
        p_t: down.p_t + up.p_t,
        p_n: down.p + up.p,
        v_t: up.v_t,
        v_n: up.v_n,
        account: Account {
            normal_work: down.normal_work + up.normal_work,
            friction_work: down.friction_work + up.friction_work,
            newton: (v_n != zero).then(|| -up.v_n / v_n),
            poisson: Some(up.p / down.p),
            energetic: Some(coefficient_of_work(up.normal_work, down.normal_work)),
            mode: if slip_end.is_some() { then.mode } else { first.mode },
            slip_end: if v_t == zero { None } else { slip_end },
            slip_stop: slip_stops.filter(|_| slip_end.is_some() && v_t != zero),
            flags: Flags::SINGULAR.when(mu > zero && contact.is_locked(held)),
        },
        turns: Turns::InTime,
    })
}

/// `sqrt(-returned/taken)`. The root has no derivative at 0: a plain zero there.
pub(crate) fn coefficient_of_work<T: RealField + Copy>(returned: T, taken: T) -> T {
    if returned > T::zero() { (-returned / taken).sqrt() } else { T::zero() }
}

/// What follows slip s: stick if friction can hold the contact, else slip towards `sign B`,
/// which is back: slip s stops only where `s B < μ A`, and with `μ A < |B|` that leaves `s B < 0`.
fn after_slip<T: RealField + Copy>(contact: &ImpactProblem<T, 2>, mu: T, s: T, held: T) -> Segment<T> {
    if mu >= contact.mu_stick() {
        return Segment::stick(contact, held);
    }
    let (_, b, _) = contact.abc();
    let mode = if s == T::zero() { Mode::Slip } else { Mode::ReverseSlip };
    Segment::slip(contact, mu, sign(b), mode)
}

/// What ends the restitution, with the numbers of the compression it refers to.
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
    /// Normal impulse still to come at the constant rate `dv_n/dp`, where restitution has brought the impulse p,
    /// the velocity v_n and the work so far.
    pub fn left(&self, p: T, v_n: T, work: T, rate: T, locked: bool) -> T {
        let two: T = convert(2.0);
        let Self { e, .. } = *self;
        match self.ending {
            Ending::Impulse => e * self.pc - p,
            // No impulse moves a locked contact on.
            _ if locked => T::zero(),
            Ending::Velocity => (-e * self.v_n_minus - v_n) / rate,
            Ending::Work if v_n == T::zero() => e * (-two * self.work / rate).sqrt(),
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

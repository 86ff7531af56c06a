//! Routh's method in space: integrates the contact velocity, with the normal impulse p as the independent variable.
//!
//! Rigid bodies and Coulomb friction, as in `routh.rs`; but in space slip turns while it lasts. With r its speed, φ its
//! direction, u = (cos φ, sin φ) and u⊥ perpendicular to u,
//!
//! ```text
//! dv_t/dp = h - μ A u,   dv_n/dp = C - μ h·u
//! dr/dp   = u·(h - μ A u),   r dφ/dp = u⊥·(h - μ A u) = k_φ(φ)
//! ```
//!
//! The direction φ turns towards a zero of k_φ: an **invariant direction**, along which slip is straight ([`Line`]).
//! k_φ always has a zero, because its mean over the circle is zero. Elsewhere the flow is integrated by power series
//! ([`Curve`]) in a variable in which it is regular as r -> 0.
//!
//! When slip has stopped, the contact sticks if friction is large enough, otherwise it slips along an invariant
//! direction on which slip grows:
//!
//! ```text
//! stick   dp_t/dp = -A⁺ h                       if |A⁺ h| <= μ
//! slip    dp_t/dp = -μ u = -(A + s 1)⁻¹ h       with s > 0 such that |dp_t/dp| = μ;  dr/dp = μ s
//! ```
//!
//! The second line is `h - μ A u = μ s u` solved for u. Its left side decreases as s grows, from `|A⁺ h| > μ` to 0, so
//! there is exactly one such direction.
//!
//! While `μ h·u > C` friction jams: the normal impulse lowers v_n. In space slip may turn into such a direction during
//! restitution and bring the contact back to `v_n = 0` before the end. Then everything before counts as compression,
//! which goes on.
//!
//! Symbols as in `contact.rs`; velocities in m/s, impulses in N s, work in J.
//!
//! Sources: Keller, J. Appl. Mech. 53 (1986) 1; Bhatt and Koechling, *Three-dimensional frictional rigid-body impact*,
//! J. Appl. Mech. 62 (1995) 893.

mod curve;
mod gauss;
mod line;
mod path;
mod series;
mod state;
#[cfg(test)]
mod tests;
mod turn;

use nalgebra::{RealField, SVector, Vector2};

use crate::cone::shift;
use crate::contact::{Contact, length};
use crate::outcome::{Account, Mode, Phase};
use crate::problem::plain;
use crate::rounding::rounding;
use crate::routh::{End, Ending, coefficient_of_work};
use crate::scalar::has_derivatives;
use crate::{Flags, ImpactError, ImpactProblem};
use curve::{Curve, Resume};
use line::Line;
pub use path::{ImpulsePath, InvariantDirection, PathPoint};
use state::{Return, State};
use turn::Turn;

/// A slip below this multiple of ε times the speeds before the impact counts as about to stop or just begun.
const SLOW: f64 = 1.0 / 64.0;

/// A rate of turning below this multiple of ε times the terms that cancel in it counts as zero.
const STRAIGHT: f64 = 4.0;

/// Restitution below this coefficient does not use the series of compression.
const SMALL: f64 = 1.0 / 32.0;

/// Limit of pieces, far above the some dozens that impacts need; beyond it slip counts as straight.
const PIECES: usize = 4096;

/// Rates of slip at a direction.
struct Rates<T> {
    /// `dr/dp` (1/kg).
    radial: T,
    /// `k_φ` (1/kg).
    turning: T,
}

/// A piece of the flow.
#[allow(clippy::large_enum_variant)] // used at once, not stored
enum Piece<'a, T> {
    Line(Line<T>),
    Curve(Curve<'a, T>),
}

/// The result of the flow, in contact axes.
pub(crate) struct Found<T, const D: usize> {
    pub impulse: SVector<T, D>,
    pub u_plus: SVector<T, D>,
    pub account: Account<T>,
}

impl<T: RealField + Copy, const D: usize> Found<T, D> {
    /// Without derivatives.
    pub fn plain(&self) -> Found<f64, D> {
        let Self { impulse, u_plus, account } = self;
        Found { impulse: impulse.map(plain), u_plus: u_plus.map(plain), account: account.plain() }
    }
}

/// Integrates a contact that approaches, or jams at `v_n = 0`, with friction `μ > 0`, to the end of restitution.
///
/// A sticking contact without inverse mass along its normal is treated as in the plane: see `routh.rs`.
pub(crate) fn follow<T: RealField + Copy, const D: usize>(
    problem: &ImpactProblem<T, D>,
    e: T,
    mu: T,
    ending: Ending,
) -> Result<Found<T, D>, ImpactError> {
    let zero = T::zero();
    let contact = Contact::of(problem);
    let mut flow = Flow::new(&contact, mu);
    let mut state = State::start(&contact);
    let mut turn = Turn::new(&contact, mu, flow.scale);
    // Without slip: a slip of value 0 with a derivative stops at once if the contact sticks.
    if state.r == zero && flow.departure().heading.amax() == zero {
        state.p_t = -contact.mobility().least_solution(&contact.slip);
        state.v_n = contact.v_n + contact.coupling.dot(&state.p_t);
    }
    let (mut slip_end, mut slip_stop) = (None, None);
    let (down, up) = loop {
        let (stopped, curve) = flow.compress(&mut state, &mut turn)?;
        slip_end = slip_end.or(stopped.is_some().then_some(Phase::Compression));
        slip_stop = slip_stop.or(stopped);
        let down = state;
        state = down.turn();
        let end = End { ending, e, v_n_minus: contact.v_n, pc: down.p, work: down.normal_work };
        // A small work of restitution would be lost beside that of compression: a series of its own has it.
        let curve = curve.filter(|_| plain(e) >= SMALL);
        let (over, stopped) = flow.restore(&mut state, &end, curve, &mut turn);
        let phase = if over { Phase::Restitution } else { Phase::Compression };
        slip_end = slip_end.or(stopped.is_some().then_some(phase));
        slip_stop = slip_stop.or(stopped.map(|p| down.p + p));
        if over {
            break (down, state);
        }
        state = state.added_to(&down);
    };

    let impulse = Contact::lift(&(down.p_t + up.p_t), down.p + up.p);
    let u_plus = Contact::lift(&(up.heading * up.r), up.v_n);
    let account = Account {
        normal_work: down.normal_work + up.normal_work,
        friction_work: down.friction_work + up.friction_work,
        newton: (contact.v_n != zero).then(|| -up.v_n / contact.v_n),
        poisson: Some(up.p / down.p),
        energetic: Some(coefficient_of_work(up.normal_work, down.normal_work)),
        mode: if up.r == zero { Mode::Stick } else { Mode::between(problem.u_minus(), &u_plus) },
        slip_end,
        slip_stop,
        flags: Flags::JAM.when(flow.jams) | Flags::SINGULAR.when(contact.is_singular()),
    };
    Ok(Found { impulse, u_plus, account })
}

/// The flow of one contact.
struct Flow<'a, T> {
    contact: &'a Contact<T>,
    mu: T,
    /// `|h| + μ |A|`, which bounds the rates of slip (1/kg).
    scale: T,
    /// r below which slip counts as straight until it stops.
    slow: T,
    /// The piece that follows when slip has stopped, once it is needed.
    departure: Option<Line<T>>,
    jams: bool,
    pieces: usize,
}

impl<'a, T: RealField + Copy> Flow<'a, T> {
    fn new(contact: &'a Contact<T>, mu: T) -> Self {
        let speed = contact.slip.amax().max(contact.v_n.abs());
        let scale = length(&contact.coupling) + mu * contact.tangents.norm();
        Self { contact, mu, scale, slow: speed * rounding(SLOW), departure: None, jams: false, pieces: 0 }
    }

    fn departure(&mut self) -> Line<T> {
        *self.departure.get_or_insert_with(|| departure(self.contact, self.mu))
    }

    fn rates(&self, u: &Vector2<T>) -> Rates<T> {
        let (a, h) = (&self.contact.tangents, &self.contact.coupling);
        let f = h - a * u * self.mu;
        Rates { radial: u.dot(&f), turning: u.x * f.y - u.y * f.x }
    }

    /// The piece that follows this state.
    #[inline]
    fn piece<'t>(&mut self, state: &mut State<T>, turn: &'t mut Turn) -> Piece<'t, T>
    where
        'a: 't,
    {
        self.pieces += 1;
        let rates = self.rates(&state.heading);
        if state.r == T::zero() || (state.r <= self.slow && rates.radial >= T::zero()) {
            state.r = T::zero();
            return Piece::Line(self.departure());
        }
        let straight = rates.turning.abs() <= self.scale * rounding(STRAIGHT) || self.stops_here(state, &rates);
        let piece = if straight || state.r <= self.slow || self.pieces > PIECES {
            let doubt = self.scale * rounding(1024.0);
            Piece::Line(Line::slip(self.contact, self.mu, state.heading, rates.radial, doubt))
        } else {
            Piece::Curve(Curve::new(self.contact, self.mu, state, turn))
        };
        if let Piece::Line(line) = &piece {
            self.jams |= line.normal_rate <= T::zero();
        }
        piece
    }

    /// Whether slip stops along an invariant direction so near that the rest of its turning does not count: the direction turns by
    /// `k_φ/λ` more, with `λ = -dk_φ/dφ`, which changes `dr/dp` by at most κ times as much, and the velocity by that times the
    /// impulse that is left, `r/|dr/dp|`. Derivatives are not small where the change itself is.
    fn stops_here(&self, state: &State<T>, rates: &Rates<T>) -> bool {
        let (u, slows) = (&state.heading, -rates.radial);
        let across = Vector2::new(-u.y, u.x);
        let settles = self.mu * across.dot(&(self.contact.tangents * across)) - slows;
        let (turns, room) = (rates.turning.abs() * self.scale, settles * slows);
        !has_derivatives::<T>()
            && slows > T::zero()
            && settles > T::zero()
            && turns < room
            && state.r * turns <= self.slow * room
    }

    /// Integrates to `v_n = 0`; returns the impulse at which slip stopped, if it did, and the rest of the last curve.
    #[allow(clippy::type_complexity)] // two results, used at once
    fn compress(
        &mut self,
        state: &mut State<T>,
        turn: &mut Turn,
    ) -> Result<(Option<T>, Option<Resume<T>>), ImpactError> {
        let (mut stopped, mut rest) = (None, None);
        loop {
            match self.piece(state, turn) {
                Piece::Line(line) => {
                    if let Some(dp) = line.rises(state) {
                        *state = line.at(state, dp).added_to(state);
                        break;
                    }
                    let Some(dp) = line.end(state).filter(|_| !line.locked) else {
                        self.check_held(state, &line)?;
                        break;
                    };
                    *state = line.at(state, dp).added_to(state);
                    state.r = T::zero();
                    stopped = stopped.or(Some(state.p));
                }
                Piece::Curve(curve) => {
                    let rises = curve.rises();
                    let t = rises.unwrap_or_else(|| curve.end());
                    self.jams |= curve.jams(t);
                    let step = curve.at(t);
                    *state = step.added_to(state);
                    if rises.is_some() {
                        rest = Some(curve.resume(t, step));
                        break;
                    }
                }
            }
        }
        state.v_n = T::zero();
        Ok((stopped, rest))
    }

    /// Whether a contact whose v_n no impulse changes is at `v_n = 0` within rounding; otherwise it wedges.
    fn check_held(&self, state: &State<T>, line: &Line<T>) -> Result<(), ImpactError> {
        let Contact { normal, coupling, v_n, .. } = self.contact;
        let terms = v_n.abs() + (*normal + self.mu * length(coupling)) * state.p;
        if line.locked && state.v_n >= -terms * rounding(1024.0) {
            return Ok(());
        }
        Err(self.contact.wedged(self.mu, state.v_n, line.normal_rate))
    }

    /// Integrates to the end of restitution, or back to `v_n = 0` before it. Returns whether restitution is over, and
    /// the impulse since its start at which slip stopped.
    fn restore(
        &mut self,
        state: &mut State<T>,
        end: &End<T>,
        mut rest: Option<Resume<T>>,
        turn: &mut Turn,
    ) -> (bool, Option<T>) {
        let mut stopped = None;
        loop {
            let piece = match rest.take() {
                Some(rest) => Piece::Curve(Curve::resumed(self.contact, self.mu, &rest, turn)),
                None => self.piece(state, turn),
            };
            let found = match &piece {
                Piece::Line(line) => line.returns(state, end),
                Piece::Curve(curve) => curve.returns(state, end),
            };
            let (over, x) = match (&found, &piece) {
                (Return::Ends(x), _) => (Some(true), *x),
                (Return::Falls(x), _) => (Some(false), *x),
                (Return::Not, Piece::Curve(curve)) => (None, curve.end()),
                // A line without end on which restitution does not end is locked.
                (Return::Not, Piece::Line(line)) => match line.end(state) {
                    Some(dp) => (None, dp),
                    None => return (true, stopped),
                },
            };
            match &piece {
                Piece::Line(line) => {
                    *state = line.at(state, x).added_to(state);
                    if over.is_none() {
                        state.r = T::zero();
                        stopped = stopped.or(Some(state.p));
                    }
                }
                Piece::Curve(curve) => {
                    self.jams |= curve.jams(x);
                    *state = curve.at(x).added_to(state);
                }
            }
            state.v_n = state.v_n.max(T::zero());
            if let Some(over) = over {
                if !over {
                    state.v_n = T::zero();
                }
                // More changes of phase can only be rounding.
                return (over || self.pieces > 2 * PIECES, stopped);
            }
        }
    }
}

/// The piece of a contact without slip: stick, or slip along the one direction on which slip grows.
fn departure<T: RealField + Copy>(contact: &Contact<T>, mu: T) -> Line<T> {
    let mobility = contact.mobility();
    let drive = mobility.moved(&contact.coupling);
    let hold = -mobility.least_solution(&drive);
    let slides = length(&hold) > mu;
    match slides.then(|| shift(&mobility, &drive, mu, T::one(), &Vector2::zeros())).flatten() {
        Some(s) => {
            let heading = mobility.shifted_solution(s, &drive) / mu;
            Line::slip(contact, mu, heading, mu * s, T::zero())
        }
        None => Line::stick(contact, hold),
    }
}

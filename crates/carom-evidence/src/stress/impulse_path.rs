//! Routh's method by numerical integration: one contact with Coulomb friction, followed along its normal impulse.
//!
//! This is a reference solution. It shares no code with `carom_impact::flow`: the velocity is integrated in a variable τ
//! with dp = |v_t| dτ, in which the equations are smooth while there is slip,
//!
//! ```text
//! dv_t/dτ = h |v_t| - μ A v_t,   dv_n/dτ = C |v_t| - μ h·v_t,   dp_t/dτ = -μ v_t
//! ```
//!
//! by Gragg's extrapolated midpoint rule of order 12. Sticking, and slip in an invariant direction, have constant rates in p.

use crate::halved;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Midpoint steps of the extrapolation.
const MIDPOINTS: [usize; 6] = [2, 4, 6, 8, 10, 12];
/// A step of τ times the largest rate of the equations.
const STEP: f64 = 0.5;
/// Steps after which an integration is given up; the scenes need some dozens.
const MOST_STEPS: usize = 4000;
/// Slip below this share of the speed before the impact has stopped.
const STOPPED: f64 = 1e-13;
/// Slip turns no more if its rate of turning is below this share of the rates.
const STRAIGHT: f64 = 1e-14;

/// The contact after the normal impulse p.
#[derive(Debug, Clone, Copy)]
pub struct Reached {
    /// Contact velocity, m/s.
    pub u: Vector3<f64>,
    /// Tangential impulse, N s.
    pub tangential: Vector2<f64>,
    /// Normal work, J.
    pub normal_work: f64,
    /// Friction work, J.
    pub friction_work: f64,
    /// Normal impulse at the end of compression, N s; `None` while the contact approaches.
    pub compression: Option<f64>,
    /// Normal work of compression, J.
    pub compression_work: f64,
}

/// v_x, v_y, v_n, p_x, p_y, p, normal work, friction work.
type State = nalgebra::SVector<f64, 8>;

const VN: usize = 2;
const P: usize = 5;
const WORK: usize = 6;

struct Contact {
    a: Matrix2<f64>,
    h: Vector2<f64>,
    c: f64,
    mu: f64,
}

/// Follows the contact `h`, `u` (tangents first) with friction μ to the normal impulse `p`; `None` if it is not reached.
pub fn follow(h: &Matrix3<f64>, u: &Vector3<f64>, mu: f64, p: f64) -> Option<Reached> {
    let contact =
        Contact { a: h.fixed_view::<2, 2>(0, 0).into(), h: h.fixed_view::<2, 1>(0, 2).into(), c: h[(2, 2)], mu };
    let mut y = State::zeros();
    y.fixed_rows_mut::<3>(0).copy_from(u);
    let mut turn = (u.z >= 0.0).then_some((0.0, 0.0));
    let stopped = STOPPED * u.norm();
    for _ in 0..MOST_STEPS {
        let left = p - y[P];
        if left <= p * 1e-15 {
            // The end of an inelastic impact is the end of compression.
            if turn.is_none() && y[VN].abs() <= 1e-9 * u.norm() {
                turn = Some((y[P], y[WORK]));
            }
            return Some(Reached {
                u: Vector3::new(y[0], y[1], y[VN]),
                tangential: Vector2::new(y[3], y[4]),
                normal_work: y[WORK],
                friction_work: y[7],
                compression: turn.map(|(p, _)| p),
                compression_work: turn.map_or(0.0, |(_, work)| work),
            });
        }
        let next = contact.advance(&y, left, stopped)?;
        // Compression ends where v_n comes up to zero; if friction presses the contact back, at the last such place.
        if y[VN] < 0.0 && next.end[VN] >= 0.0 {
            let at = next.to_velocity(&contact, &y);
            turn = Some((at[P], at[WORK]));
        } else if next.end[VN] < -1e-12 * u.norm() {
            turn = None;
        }
        y = next.end;
    }
    None
}

/// A piece of the path.
struct Piece {
    end: State,
    kind: Kind,
}

enum Kind {
    /// dp_t/dp along it.
    Straight(Vector2<f64>),
    /// Its length in τ.
    Curved(f64),
}

impl Contact {
    fn advance(&self, y: &State, left: f64, stopped: f64) -> Option<Piece> {
        let v = Vector2::new(y[0], y[1]);
        let r = v.norm();
        if self.mu == 0.0 {
            return Some(self.straight(y, Vector2::zeros(), left));
        }
        let direction = if r > 0.0 { v / r } else { v };
        let drive = self.h - self.a * direction * self.mu;
        let radial = direction.dot(&drive);
        if r == 0.0 || (r <= stopped && radial < 0.0) {
            let mut rest = *y;
            (rest[0], rest[1]) = (0.0, 0.0);
            return Some(self.straight(&rest, self.after_stop()?, left));
        }
        let rates = self.h.norm() + self.mu * self.a.norm();
        if (direction.x * drive.y - direction.y * drive.x).abs() <= STRAIGHT * rates {
            let stops = if radial < 0.0 { -r / radial } else { f64::INFINITY };
            let mut piece = self.straight(y, -direction * self.mu, left.min(stops));
            if stops <= left {
                (piece.end[0], piece.end[1]) = (0.0, 0.0);
            }
            return Some(piece);
        }
        let span = STEP / (rates + self.c);
        let end = self.extrapolated(y, span);
        if end[P] - y[P] <= left {
            return Some(Piece { end, kind: Kind::Curved(span) });
        }
        let span = root(span, |span| self.extrapolated(y, span)[P] - y[P] - left);
        let mut end = self.extrapolated(y, span);
        end[P] = y[P] + left;
        Some(Piece { end, kind: Kind::Curved(span) })
    }

    /// dp_t/dp of a contact without slip: stick where friction can hold it, else slip in the direction in which it grows.
    fn after_stop(&self) -> Option<Vector2<f64>> {
        let hold = -(self.a.try_inverse()? * self.h);
        if hold.norm() <= self.mu {
            return Some(hold);
        }
        // |(A + s)⁻¹h| falls from above μ to zero as s grows.
        let held = |s: f64| Some(-((self.a + Matrix2::identity() * s).try_inverse()? * self.h));
        let low = |s: f64| held(s).is_some_and(|rate| rate.norm() > self.mu);
        held(halved([0.0, self.h.norm() / self.mu], 200, low)[1])
    }

    /// With the constant rate `rate` = dp_t/dp over the normal impulse `dp`.
    fn straight(&self, y: &State, rate: Vector2<f64>, dp: f64) -> Piece {
        let (dv, dvn) = (self.a * rate + self.h, self.c + self.h.dot(&rate));
        let v = Vector2::new(y[0], y[1]);
        let mut end = *y;
        end[0] += dv.x * dp;
        end[1] += dv.y * dp;
        end[VN] += dvn * dp;
        end[3] += rate.x * dp;
        end[4] += rate.y * dp;
        end[P] += dp;
        end[WORK] += y[VN] * dp + 0.5 * dvn * dp * dp;
        end[7] += rate.dot(&v) * dp + 0.5 * rate.dot(&dv) * dp * dp;
        Piece { end, kind: Kind::Straight(rate) }
    }

    fn derivative(&self, y: &State) -> State {
        let v = Vector2::new(y[0], y[1]);
        let r = v.norm();
        let dv = self.h * r - self.a * v * self.mu;
        let friction = -v * self.mu;
        let dvn = self.c * r + self.h.dot(&friction);
        State::from([dv.x, dv.y, dvn, friction.x, friction.y, r, y[VN] * r, friction.dot(&v)])
    }

    /// Gragg's midpoint rule over `span`, extrapolated to a step of zero.
    fn extrapolated(&self, y: &State, span: f64) -> State {
        let mut row: [State; MIDPOINTS.len()] = [State::zeros(); MIDPOINTS.len()];
        for (k, &count) in MIDPOINTS.iter().enumerate() {
            let step = span / count as f64;
            let (mut before, mut now) = (*y, y + self.derivative(y) * step);
            for _ in 1..count {
                let next = before + self.derivative(&now) * (2.0 * step);
                (before, now) = (now, next);
            }
            row[k] = (before + now + self.derivative(&now) * step) * 0.5;
            for j in (0..k).rev() {
                let ratio = (count as f64 / MIDPOINTS[j] as f64).powi(2);
                row[j] = row[j + 1] + (row[j + 1] - row[j]) / (ratio - 1.0);
            }
        }
        row[0]
    }
}

impl Piece {
    /// The state of this piece, which begins at `y`, where its normal velocity is zero.
    fn to_velocity(&self, contact: &Contact, y: &State) -> State {
        match self.kind {
            Kind::Straight(rate) => contact.straight(y, rate, -y[VN] / (contact.c + contact.h.dot(&rate))).end,
            Kind::Curved(span) => contact.extrapolated(y, root(span, |span| contact.extrapolated(y, span)[VN])),
        }
    }
}

/// Where `value`, negative at 0 and not at `end`, is zero (the Illinois method).
fn root(end: f64, value: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high, mut side) = ((0.0, value(0.0)), (end, value(end)), 0);
    for _ in 0..100 {
        let x = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        if !(x > low.0 && x < high.0) || high.0 - low.0 <= 4.0 * f64::EPSILON * end {
            break;
        }
        let y = value(x);
        if y < 0.0 {
            low = (x, y);
            high.1 *= if side < 0 { 0.5 } else { 1.0 };
            side = -1;
        } else {
            high = (x, y);
            low.1 *= if side > 0 { 0.5 } else { 1.0 };
            side = 1;
        }
        if y == 0.0 {
            break;
        }
    }
    // The root may be next to either end.
    if value(low.0).abs() < value(high.0).abs() { low.0 } else { high.0 }
}

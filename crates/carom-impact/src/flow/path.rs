//! The path of the flow as a list of points, and its invariant directions.
//!
//! With A = `H_tt` in its principal axes, λ₁ <= λ₂ along them, and h in the same axes,
//!
//! ```text
//! k_φ(φ) = h₂ cos φ - h₁ sin φ - μ Δ sin φ cos φ,   Δ = λ₂ - λ₁
//! ```
//!
//! With the signs of the axes chosen so that h₁, h₂ >= 0, k_φ has one zero in the first quadrant, where it decreases,
//! one in the third, where it increases, and none in the fourth. In the second quadrant it has two if
//! `h₁^⅔ + h₂^⅔ < (μ Δ)^⅔`, on either side of the direction with `tan³ φ = -h₂/h₁`, otherwise none. So there are two
//! invariant directions or four.

use nalgebra::{SVector, Vector2};

use super::{Flow, Piece, State, Turn, length};
use crate::contact::Contact;
use crate::laws::check_friction;
use crate::outcome::finite;
use crate::roots::{MOST_STEPS, bisect};
use crate::rounding::{CANCELLED, rounding};
use crate::{ImpactError, ImpactProblem};
use std::f64::consts::{FRAC_PI_2, PI};

/// Points per step of the power series, over which slip turns by about a right angle at most.
const POINTS: usize = 16;

/// The path of an impact in impulse and velocity while friction is opposed to the slip of each instant: a polygon.
///
/// [`Newton`](crate::Newton), [`Poisson`](crate::Poisson) and [`Energetic`](crate::Energetic) follow the same path and
/// differ in its end, so the path does not depend on the restitution. Where slip keeps its direction or the contact
/// sticks, the path is straight and its corners are exact; where slip turns, the points lie on the curve at short
/// distances.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpulsePath<const D: usize> {
    /// The points from u⁻ on, with non-decreasing normal impulse.
    pub points: Vec<PathPoint<D>>,
    /// Index of the first point with `u_n = 0`, the end of compression; 0 if the contact does not approach.
    pub compression_end: usize,
    /// Index of the point at which slip stops, if it does; after it the contact sticks or slips in another direction.
    pub slip_end: Option<usize>,
}

/// A point on an [`ImpulsePath`], in contact axes: tangents first, normal last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint<const D: usize> {
    /// Impulse up to this point (N s).
    pub impulse: SVector<f64, D>,
    /// Contact velocity at this point (m/s).
    pub velocity: SVector<f64, D>,
}

/// A direction in which slip does not turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InvariantDirection {
    /// Angle of the slip velocity, from the first tangent towards the second, in (-π, π] (rad).
    pub angle: f64,
    /// `dr/dp`, change of the slip speed with the normal impulse (1/kg): positive if slip grows along the direction,
    /// negative if it decreases.
    pub slip_rate: f64,
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// Integrates the impact to the end of compression, and on to `normal_impulse` (N s) if that is larger.
    ///
    /// ```
    /// # use carom_impact::{Energetic, ImpactProblem, Law};
    /// # use nalgebra::{matrix, vector};
    /// let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    /// let problem = ImpactProblem::new(h, vector![0.6, -0.2, -1.0])?;
    /// let hit = Energetic { restitution: 0.6, friction: 0.3 }.resolve(&problem)?;
    /// let path = problem.impulse_path(0.3, hit.impulse.z)?;
    /// assert!((path.points[path.compression_end].impulse.z - 0.988823584).abs() < 1e-9);
    /// assert!((path.points.last().unwrap().velocity - hit.u_plus).norm() < 1e-14);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// - [`ImpactError::Coefficient`]: `friction` is out of range.
    /// - [`ImpactError::NotFinite`]: `normal_impulse` is not finite, or a number on the path overflows.
    /// - [`ImpactError::SingularNormal`]: the normal direction is singular.
    /// - [`ImpactError::Wedged`]: the contact wedges before compression ends.
    ///
    /// **Source.** Keller, J. Appl. Mech. 53 (1986) 1; the hodograph after Bhatt and Koechling, J. Appl. Mech. 62
    /// (1995) 893.
    pub fn impulse_path(&self, friction: f64, normal_impulse: f64) -> Result<ImpulsePath<D>, ImpactError> {
        check_friction(friction)?;
        finite("normal_impulse", &[normal_impulse])?;
        self.check_normal()?;
        let path = if friction == 0.0 {
            self.straight_path(normal_impulse)
        } else {
            Walk::new(&Contact::of(self)).follow(friction, normal_impulse)?
        };
        let numbers = path.points.iter().flat_map(|point| point.impulse.iter().chain(point.velocity.iter()));
        finite("the path of the impulse", numbers)?;
        Ok(path)
    }

    /// Without friction slip does not stop.
    fn straight_path(&self, normal_impulse: f64) -> ImpulsePath<D> {
        let mobility = self.delassus().column(D - 1).into_owned();
        let turn = (self.approach_speed() / mobility[D - 1]).max(0.0);
        let at = |p: f64| {
            let mut impulse = SVector::zeros();
            impulse[D - 1] = p;
            PathPoint { impulse, velocity: self.u_minus() + mobility * p }
        };
        let mut stations = vec![0.0];
        stations.extend([turn, normal_impulse].iter().filter(|&&p| p > 0.0 && p >= turn));
        let mut points: Vec<_> = stations.into_iter().map(at).collect();
        let compression_end = usize::from(turn > 0.0);
        if turn > 0.0 {
            points[1].velocity[D - 1] = 0.0;
        }
        ImpulsePath { points, compression_end, slip_end: None }
    }
}

impl ImpactProblem<f64, 3> {
    /// The directions in which slip does not turn, two or four, in ascending order of their angles. If `H_tn = 0` and
    /// `H_tt` is a multiple of the identity, as for a sphere, slip never turns and the list is empty.
    ///
    /// The directions depend on H and the friction alone, and no path of the slip velocity crosses them. If slip has
    /// stopped and friction is too small to keep the contact sticking, slip continues along the direction with positive
    /// `slip_rate`.
    ///
    /// ```
    /// # use carom_impact::ImpactProblem;
    /// # use nalgebra::{matrix, vector};
    /// let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    /// let [out, inwards] = ImpactProblem::new(h, vector![0.6, -0.2, -1.0])?.invariant_directions(0.3)?[..] else {
    ///     panic!("two")
    /// };
    /// assert!((out.angle.to_degrees() + 45.30081).abs() < 1e-5 && out.slip_rate > 0.0);
    /// assert!((inwards.angle.to_degrees() - 151.39478).abs() < 1e-5 && inwards.slip_rate < 0.0);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`ImpactError::Coefficient`].
    ///
    /// **Source.** Bhatt and Koechling, J. Appl. Mech. 62 (1995) 893. Their number (by an astroid) is derived at the
    /// head of this module's source.
    pub fn invariant_directions(&self, friction: f64) -> Result<Vec<InvariantDirection>, ImpactError> {
        check_friction(friction)?;
        let contact = Contact::of(self);
        let (a, h) = (contact.tangents, contact.coupling);
        let (half, off) = ((a[(0, 0)] - a[(1, 1)]) / 2.0, a[(0, 1)]);
        let spread = friction * 2.0 * half.hypot(off);
        // Slip without coupling and friction does not turn.
        if length(&h) + spread <= (h.amax() + friction * a.amax()) * rounding::<f64>(CANCELLED) {
            return Ok(Vec::new());
        }
        // The axis of the larger eigenvalue lies at half the angle of (half, off), the first axis across it.
        let turn = off.atan2(half) / 2.0;
        let mut axes = [Vector2::new(turn.sin(), -turn.cos()), Vector2::new(turn.cos(), turn.sin())];
        for axis in &mut axes {
            if axis.dot(&h) < 0.0 {
                *axis = -*axis;
            }
        }
        let [h1, h2] = axes.map(|axis| axis.dot(&h));
        let turning = |angle: f64| h2 * angle.cos() - h1 * angle.sin() - spread * angle.sin() * angle.cos();
        // By the sign alone: there may be a zero at the end of a bracket, which symmetry may cause.
        let between = |negative, positive| bisect(negative, positive, MOST_STEPS, |angle| turning(angle) > 0.0);
        let mut angles = vec![between(FRAC_PI_2, 0.0), between(PI, 1.5 * PI)];
        let share = |x: f64| x.cbrt().powi(2);
        if share(h1) + share(h2) < share(spread) {
            let greatest = PI - h2.cbrt().atan2(h1.cbrt());
            angles.extend([between(FRAC_PI_2, greatest), between(PI, greatest)]);
        }
        let mut found: Vec<_> = angles
            .into_iter()
            .map(|angle| {
                let u = axes[0] * angle.cos() + axes[1] * angle.sin();
                InvariantDirection { angle: u.y.atan2(u.x), slip_rate: u.dot(&(h - a * u * friction)) }
            })
            .collect();
        found.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        Ok(found)
    }
}

/// The state of the flow and the points passed so far.
struct Walk<'a, const D: usize> {
    contact: &'a Contact<f64>,
    state: State<f64>,
    points: Vec<PathPoint<D>>,
}

impl<'a, const D: usize> Walk<'a, D> {
    fn new(contact: &'a Contact<f64>) -> Self {
        let state = State::start(contact);
        let mut walk = Self { contact, state, points: Vec::new() };
        walk.pass();
        walk
    }

    fn pass(&mut self) {
        let State { p, p_t, heading, r, v_n, .. } = self.state;
        self.points.push(PathPoint { impulse: Contact::lift(&p_t, p), velocity: Contact::lift(&(heading * r), v_n) });
    }

    fn follow(mut self, mu: f64, normal_impulse: f64) -> Result<ImpulsePath<D>, ImpactError> {
        let mut flow = Flow::new(self.contact, mu);
        let mut compression_end = (self.contact.v_n >= 0.0).then_some(0);
        let (mut slip_end, mut turn) = (None, Turn::new(self.contact, mu, flow.scale));
        while compression_end.is_none() || self.state.p < normal_impulse {
            let room = compression_end.map(|_| normal_impulse - self.state.p);
            match flow.piece(&mut self.state, &mut turn) {
                Piece::Line(line) => {
                    let rises = line.rises(&self.state).filter(|_| room.is_none());
                    let stops = line.end(&self.state).filter(|_| !(line.locked && room.is_none()));
                    let ends = rises.or(stops).into_iter().chain(room).reduce(f64::min);
                    // Locked: compression is over here, or the contact wedges.
                    let Some(dp) = ends else {
                        flow.check_held(&self.state, &line)?;
                        self.state.v_n = 0.0;
                        compression_end = Some(self.points.len() - 1);
                        continue;
                    };
                    self.state = line.at(&self.state, dp).added_to(&self.state);
                    if rises.is_some() {
                        self.state.v_n = 0.0;
                        compression_end = Some(self.points.len());
                    } else if stops == Some(dp) {
                        self.state.r = 0.0;
                        slip_end = Some(self.points.len());
                    }
                    if room == Some(dp) {
                        self.state.p = normal_impulse;
                    }
                    self.pass();
                }
                Piece::Curve(curve) => {
                    let rises = if room.is_none() { curve.rises() } else { None };
                    let reached = room.and_then(|room| curve.reaches(room));
                    let end = rises.or(reached).unwrap_or_else(|| curve.end());
                    let start = self.state;
                    for k in 1..=POINTS {
                        self.state = start;
                        self.state = curve.at(end * k as f64 / POINTS as f64).added_to(&self.state);
                        if k == POINTS && rises.is_some() {
                            self.state.v_n = 0.0;
                            compression_end = Some(self.points.len());
                        }
                        if k == POINTS && reached.is_some() {
                            self.state.p = normal_impulse;
                        }
                        self.pass();
                    }
                }
            }
        }
        let compression_end = compression_end.unwrap_or_default();
        Ok(ImpulsePath { points: self.points, compression_end, slip_end })
    }
}

//! The surfaces of the environment, and their motion.

use super::rule::ContactRule;
use crate::state::Profile;
use carom_contact::Obstacle;
use nalgebra::Vector3;

/// Harmonic motion of a surface: the displacement `amplitude · sin(ω t + phase)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillation {
    /// Direction and size, world axes, m.
    pub amplitude: Vector3<f64>,
    /// Angular frequency ω, rad/s.
    pub frequency: f64,
    /// Phase, rad.
    pub phase: f64,
}

impl Oscillation {
    /// Displacement (m), velocity (m/s) and acceleration (m/s²) at a time (s), world axes.
    pub fn at(&self, time: f64) -> [Vector3<f64>; 3] {
        let Self { amplitude, frequency, phase } = *self;
        let (sin, cos) = (frequency * time + phase).sin_cos();
        [amplitude * sin, amplitude * (frequency * cos), amplitude * (-frequency * frequency * sin)]
    }
}

/// How a surface moves. World axes.
#[derive(Debug, Clone, PartialEq)]
pub enum SurfaceMotion {
    /// The shape oscillates.
    Oscillation(Oscillation),
    /// The shape moves without turning, at this velocity (m/s). At time 0 it is where the [`Surface`] says.
    Translation(Profile<3>),
    /// The material of the surface moves along it, the shape stays: a conveyor belt, a turntable.
    Belt(Belt),
}

/// The velocity of the material of a surface whose shape stays: of a point x, v + ω × (x − centre), without its part normal to
/// the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Belt {
    /// v (m/s), then ω (rad/s).
    pub velocity: Profile<6>,
    /// A point of the axis of ω, m.
    pub centre: Vector3<f64>,
}

impl From<Oscillation> for SurfaceMotion {
    fn from(motion: Oscillation) -> Self {
        Self::Oscillation(motion)
    }
}

impl SurfaceMotion {
    /// Displacement (m), velocity (m/s) and acceleration (m/s²) of the shape at a time (s).
    pub fn at(&self, time: f64) -> [Vector3<f64>; 3] {
        match self {
            Self::Oscillation(motion) => motion.at(time),
            Self::Translation(velocity) => {
                [velocity.integral(time), velocity.at(time), velocity.rate(time)].map(Vector3::from)
            }
            Self::Belt(_) => [Vector3::zeros(); 3],
        }
    }

    /// Whether the shape moves.
    pub(crate) fn moves_shape(&self) -> bool {
        !matches!(self, Self::Belt(_))
    }

    /// The next time at which the acceleration jumps.
    pub(crate) fn next_kink(&self, time: f64) -> Option<f64> {
        match self {
            Self::Oscillation(_) => None,
            Self::Translation(velocity) => velocity.next_kink(time),
            Self::Belt(belt) => belt.velocity.next_kink(time),
        }
    }
}

/// The motion of the surface of a touch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Moving {
    Given(SurfaceMotion),
    /// What a motion is near a time, continued smoothly beyond the rows of its table.
    Near {
        time: f64,
        shift: [Vector3<f64>; 3],
        /// Centre, velocity and its rate.
        belt: Option<(Vector3<f64>, [f64; 6], [f64; 6])>,
    },
}

impl Moving {
    /// Displacement, velocity and acceleration of the shape.
    pub fn shift(&self, now: f64) -> [Vector3<f64>; 3] {
        match self {
            Self::Given(motion) => motion.at(now),
            Self::Near { time, shift: [place, velocity, acceleration], .. } => {
                let span = now - time;
                [place + (velocity + acceleration * (0.5 * span)) * span, velocity + acceleration * span, *acceleration]
            }
        }
    }

    /// The motion near a time, if it is given by a table.
    pub fn near(&self, time: f64) -> Option<Self> {
        let Self::Given(motion) = self else { return None };
        let belt = match motion {
            SurfaceMotion::Oscillation(_) => return None,
            SurfaceMotion::Translation(_) => None,
            SurfaceMotion::Belt(belt) => Some((belt.centre, belt.velocity.at(time), belt.velocity.rate(time))),
        };
        Some(Self::Near { time, shift: motion.at(time), belt })
    }

    /// v, v̇, ω and ω̇ of the material at a time, and the centre; `None` if it moves with the shape.
    fn belt(&self, now: f64) -> Option<(Vector3<f64>, [Vector3<f64>; 4])> {
        let (centre, value, rate) = match self {
            Self::Given(SurfaceMotion::Belt(belt)) => (belt.centre, belt.velocity.at(now), belt.velocity.rate(now)),
            Self::Near { time, belt: Some((centre, value, rate)), .. } => {
                (*centre, std::array::from_fn(|i| value[i] + rate[i] * (now - time)), *rate)
            }
            _ => return None,
        };
        let part = |numbers: &[f64; 6], first: usize| Vector3::from_column_slice(&numbers[first..first + 3]);
        Some((centre, [part(&value, 0), part(&rate, 0), part(&value, 3), part(&rate, 3)]))
    }

    /// Velocity of the material at a contact point with this normal.
    pub fn velocity(&self, now: f64, position: Vector3<f64>, normal: Vector3<f64>) -> Vector3<f64> {
        let along = self.belt(now).map_or_else(Vector3::zeros, |(centre, [v, _, turn, _])| {
            tangential(v + turn.cross(&(position - centre)), normal)
        });
        self.shift(now)[1] + along
    }

    /// Rate of [`Moving::velocity`] for a contact point that moves at `rate` over a plane.
    pub fn acceleration(
        &self,
        now: f64,
        (position, rate): (Vector3<f64>, Vector3<f64>),
        normal: Vector3<f64>,
    ) -> Vector3<f64> {
        let along = self.belt(now).map_or_else(Vector3::zeros, |(centre, [_, dv, turn, dturn])| {
            tangential(dv + dturn.cross(&(position - centre)) + turn.cross(&rate), normal)
        });
        self.shift(now)[2] + along
    }

    /// The size of the velocity, m/s, at a distance of this `length` (m) from the axis of a belt that turns.
    pub fn speed(&self, now: f64, length: f64) -> f64 {
        let along = self.belt(now).map_or(0.0, |(_, [v, _, turn, _])| v.amax().max(length * turn.amax()));
        along.max(self.shift(now)[1].amax())
    }

    /// Whether the velocity differs from point to point.
    pub fn turns(&self) -> bool {
        matches!(self, Self::Given(SurfaceMotion::Belt(_)))
    }

    /// A frequency of the motion, rad/s: numerical differences have steps far below its inverse.
    pub fn frequency(&self) -> f64 {
        match self {
            Self::Given(SurfaceMotion::Oscillation(motion)) => motion.frequency.abs(),
            _ => 1.0,
        }
    }
}

fn tangential(v: Vector3<f64>, normal: Vector3<f64>) -> Vector3<f64> {
    v - normal * normal.dot(&v)
}

/// A surface of the environment.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Its name.
    pub name: String,
    /// Its shape and pose.
    pub obstacle: Obstacle,
    /// Law and coefficients of contacts with it.
    pub contact: ContactRule,
    /// Its motion; `None`: at rest.
    pub motion: Option<SurfaceMotion>,
}

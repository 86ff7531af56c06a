//! Energies and momentum, summed over the bodies with their own inertias.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | vᵢ | velocity of body i | `velocity` |
//! | T, V | kinetic and potential energy | `kinetic_energy`, `potential_energy` |

use crate::algebra::{Algebra, Force};
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use num_traits::Zero;

impl<A: Algebra> Kinematics<'_, A> {
    /// Kinetic energy T = ½ Σ v·Iv, that of rotors included, J.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn kinetic_energy(&mut self, qd: &[A::Scalar]) -> Result<A::Scalar, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.spread_velocity(qd);
        let mut twice = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let v = self.ws.velocity[i];
            let rate = qd[body.v_index];
            twice += body.inertia.rotated(self.ws.links[i].rotation).apply(v).power(v) + body.rotor * rate * rate;
        }
        Ok(twice * nalgebra::convert(0.5))
    }

    /// Potential energy V = −Σ m g·c of the moving bodies, relative to the world's origin, J. `gravity` in world axes, m/s².
    pub fn potential_energy(&self, gravity: A::Vector) -> A::Scalar {
        let mut v = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let h = self.ws.links[i].position * body.inertia.mass
                + A::rotate(self.ws.links[i].rotation, body.inertia.first_moment);
            v -= A::dot(gravity, h);
        }
        v
    }

    /// Linear momentum (kg m/s) and angular momentum about the world's origin (kg m²/s) of the moving bodies, world axes.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn momentum(&mut self, qd: &[A::Scalar]) -> Result<Force<A>, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.spread_velocity(qd);
        let mut sum = Force::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let own = body.inertia.rotated(self.ws.links[i].rotation).apply(self.ws.velocity[i]);
            sum += own.shifted(self.ws.links[i].position);
        }
        Ok(sum)
    }
}

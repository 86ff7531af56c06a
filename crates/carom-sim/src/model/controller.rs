//! Controllers that users write in Rust.

use super::control_law::{Add, Asked, Body, ControlLaw, State};
use crate::error::{SimError, named};
use crate::state::Space;
use carom_chain::Chain;
use nalgebra::Vector3;
use std::fmt;
use std::sync::Arc;

/// What a controller sees.
#[derive(Debug, Clone, Copy)]
pub struct Observed<'a> {
    /// The chain that is simulated.
    pub chain: &'a Chain,
    /// Time, s.
    pub time: f64,
    /// Configuration, length nq; rad, m, quaternion.
    pub q: &'a [f64],
    /// Joint velocities, length nv; rad/s, m/s.
    pub qd: &'a [f64],
    /// Acceleration of free fall, world axes, m/s².
    pub gravity: Vector3<f64>,
    /// Whether an impact has happened.
    pub hit: bool,
}

/// A controller: joint forces as a function of time and state.
///
/// The integrator evaluates it several times in each of its steps, also at states that it tries and rejects. So the result
/// must depend on its arguments only, and continuously between two kinks. A controller that samples at intervals or has
/// memory belongs into a loop around [`Session`](crate::Session).
///
/// ```
/// use carom_sim::{Controller, Drive, Observed, SimError};
///
/// /// A motor that swings the first joint: an amplitude in N m at 2 rad/s.
/// struct Swing(f64);
/// impl Controller for Swing {
///     fn name(&self) -> &str {
///         "swing"
///     }
///     fn forces(&self, now: &Observed, forces: &mut [f64]) -> Result<(), SimError> {
///         forces[0] = self.0 * (2.0 * now.time).sin();
///         Ok(())
///     }
/// }
/// let drive = Drive::user(Swing(0.5));
/// ```
pub trait Controller: Send + Sync {
    /// Its name in plans and messages.
    fn name(&self) -> &str;

    /// Writes the joint forces (N m, N) into `forces`, which has length nv and is zero at the call. Entries of floating and
    /// planar joints are ignored: no motor drives them.
    ///
    /// # Errors
    /// What stops the simulation, for instance [`SimError::Chain`] of a computation with the chain.
    fn forces(&self, now: &Observed, forces: &mut [f64]) -> Result<(), SimError>;

    /// The first time after `time` (s) at which the forces jump or have a kink as a function of time; the integration stops
    /// and starts again there.
    fn next_kink(&self, _time: f64) -> Option<f64> {
        None
    }

    /// Whether the forces do not depend on time explicitly. A robot at rest then stays at rest.
    fn is_steady(&self) -> bool {
        false
    }
}

/// A user's [`Controller`] as a value: see [`Drive::user`](crate::Drive::user). Clones share it, and it equals its clones only.
#[derive(Clone)]
pub struct UserController(pub(super) Arc<dyn Controller>);

impl PartialEq for UserController {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl ControlLaw for UserController {
    fn next_kink(&self, time: f64) -> Option<f64> {
        self.0.next_kink(time).filter(|kink| *kink > time)
    }

    fn drive<A: Space>(&self, asked: &Asked, _: Body<A>, (q, qd): State, add: Add) -> Result<(), SimError> {
        let mut forces = vec![0.0; qd.len()];
        let Asked { chain, time, gravity, .. } = *asked;
        let hit = asked.was_hit();
        self.0.forces(&Observed { chain, time, q, qd, gravity, hit }, &mut forces)?;
        if let Some(v) = forces.iter().position(|force| !force.is_finite()) {
            let joint = chain.joint_of_velocity(v).map_or_else(String::new, |joint| joint.name.clone());
            let problem = format!("gets the force {} from controller '{}'", forces[v], self.0.name());
            return Err(named("joint", &joint, problem));
        }
        asked.motors.iter().for_each(|motor| add(motor.v, forces[motor.v]));
        Ok(())
    }
}

impl fmt::Debug for UserController {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("UserController").field(&self.0.name()).finish()
    }
}

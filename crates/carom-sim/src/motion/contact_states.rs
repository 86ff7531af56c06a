//! The lasting contacts of a state, with their forces, for the output of a run.

use super::smooth::Motion;
use crate::contact::ContactMode;
use crate::error::SimError;
use crate::state::{Space, written};
use carom_impact::Flags;
use nalgebra::Vector3;
use serde::Serialize;

/// A lasting contact at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContactState {
    /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
    #[serde(skip)]
    pub touch: usize,
    /// Its mode; [`ContactMode::Stepping`] in time steps.
    pub mode: ContactMode,
    /// Contact point, world axes, m; zero for a joint limit.
    #[serde(serialize_with = "written::vector")]
    pub point: Vector3<f64>,
    /// Unit normal from the environment to the robot, world axes; zero for a joint limit.
    #[serde(serialize_with = "written::vector")]
    pub normal: Vector3<f64>,
    /// Gap, m or rad; negative for a compliant contact that is pressed.
    pub gap: f64,
    /// Force on the robot, world axes, N; zero for a joint limit. In a time step the mean over the step.
    #[serde(serialize_with = "written::vector")]
    pub force: Vector3<f64>,
    /// Its normal component, N; for a joint limit the force or torque on the joint, N or N m. Forces of redundant contacts
    /// are those of equal springs under all of them, or, where these are not admissible, the admissible ones of least norm.
    pub normal_force: f64,
    /// `non-unique` if the motion depends on how this force and those of other contacts are distributed.
    #[serde(serialize_with = "written::flags")]
    pub flags: Flags,
}

impl<A: Space> Motion<'_, A> {
    /// The lasting contacts at a state in the present mode.
    pub fn contact_states(&mut self, time: f64, y: &[f64]) -> Result<Vec<ContactState>, SimError> {
        if self.active.lasting.is_empty() {
            return Ok(Vec::new());
        }
        let mut held = self.in_mode(time, y)?;
        let (lasting, flags) = (self.active.lasting.clone(), self.flags());
        self.distribute((time, y), &mut held)?;
        let sim = self.sim;
        let (q, _) = self.split(y);
        let view = self.view(q)?;
        let states = lasting.iter().zip(&held.contacts).zip(flags).map(|((own, force), flags)| {
            let at = sim.touches[own.touch].at(&view, q, time);
            let (point, normal) = at.surface.map_or_else(Default::default, |place| (place.position, place.normal));
            let (touch, mode, gap) = (own.touch, own.mode(), at.gap);
            ContactState {
                touch,
                mode,
                point,
                normal,
                gap,
                force: force.force,
                normal_force: force.normal_force,
                flags,
            }
        });
        Ok(states.collect())
    }
}

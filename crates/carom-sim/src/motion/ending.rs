//! Contacts and joints with dry friction whose slip is about to end.
//!
//! Where the slip u turns in space it does so at the rate |u̇|/|u|: towards its end the steps of the integration become shorter in
//! proportion to what is left of it. What is left for less than a quarter t of the [Zeno time](crate::Simulation::zeno_time) is left out:
//! the contact sticks at once, by the impulse that ends its slip ([`Motion::shut`]). By the end of this time both motions have had the
//! same impulses up to terms of second order in t, as both have no slip then. Slip along a line needs no such steps, and is followed
//! to its end. Of the joints with dry friction an impact sets many in motion that stop as soon: they stop at once, too.
//!
//! This is done where a mode is chosen. A slip that has lasted is followed to a sixteenth of t before its end. For derivatives of the motion,
//! whose error would be of first order in t, all slips are followed to their end.

use super::active_set::{Dry, DryJoint, Hold, Lasting};
use super::rows::Contact;
use super::smooth::Motion;
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::{Space, View};
use nalgebra::{DVector, Vector3};

/// The time t as a share of the Zeno time: the change of the motion is quadratic in it, and with the whole of it larger than the error of
/// the integration.
const SHARE: f64 = 0.25;

impl Lasting {
    /// Whether it slides in space with friction, so that its slip may turn.
    fn may_turn<A: Space>(&self, sim: &Simulation) -> bool {
        let touch = &sim.touches[self.touch];
        A::LINEAR == 3
            && matches!(self.hold, Hold::Slides { .. })
            && touch.link().is_some()
            && touch.contact.law.friction() > 0.0
    }

    /// u² + t u·u̇, where its slip u turns and becomes slower; else u². It is negative where the slip ends within the time t = `within`.
    /// `own`: the contact among the constraints.
    fn slip_left<A: Space>(
        &self,
        within: f64,
        sim: &Simulation,
        view: &View<A>,
        (qdd, own): (&[f64], &Contact),
        (q, time): (&[f64], f64),
    ) -> Result<f64, SimError> {
        let touch = &sim.touches[self.touch];
        let Some(place) = touch.at(view, q, time).surface else { return Ok(f64::MAX) };
        let along_surface = |v: Vector3<f64>| v - own.normal * own.normal.dot(&v);
        let u = along_surface(own.velocity - own.surface);
        let a = along_surface(place.velocity(view, qdd)? + own.drift);
        let slows = -u.dot(&a);
        let turns = slows > 0.0 && u.cross(&a).norm() > sim.tolerance.sqrt() * slows;
        Ok(u.norm_squared() - if turns { within * slows } else { 0.0 })
    }
}

impl<A: Space> Motion<'_, A> {
    /// What comes to rest soon in the present mode: slips that turn, and joints with dry friction.
    pub fn ending(&mut self, time: f64, y: &[f64]) -> Result<Ending, SimError> {
        let sim = self.sim;
        let brakes = |joint: &DryJoint| joint.state != Dry::Holds;
        let mut ending = Ending::default();
        if !self.may_turn() && !self.active.dry.iter().any(brakes) {
            return Ok(ending);
        }
        let held = match self.accelerations(time, y) {
            Err(SimError::Jam { .. }) => return Ok(ending),
            held => held?,
        };
        let (_, qd) = self.split(y);
        let within = SHARE * sim.zeno_time;
        // In loops a joint that becomes slow may pass a dead point.
        let tree = self.couplings.is_empty();
        for (k, joint) in self.active.dry.iter().enumerate().filter(|(_, joint)| tree && brakes(joint)) {
            let (rate, slows) = (qd[joint.v].abs(), -held.qdd[joint.v] * qd[joint.v].signum());
            if slows > 0.0 && rate <= within * slows {
                ending.joints.push(k);
            }
        }
        self.slips_left(within, &held.qdd, (time, y), |touch, left| {
            if left < 0.0 {
                ending.touches.push(touch);
            }
        })?;
        Ok(ending)
    }

    /// Passes what is left of each slip that may turn to `see`, with its touch, at these accelerations, which are the last ones computed.
    fn slips_left(
        &mut self,
        within: f64,
        qdd: &DVector<f64>,
        (time, y): (f64, &[f64]),
        mut see: impl FnMut(usize, f64),
    ) -> Result<(), SimError> {
        let (q, _) = self.split(y);
        let view = View::<A>::new(self.model, &mut self.workspace, q)?;
        let rigid = self.active.lasting.iter().filter(|own| own.is_rigid());
        let contacts = rigid.zip(&self.assembled.constraints.contacts);
        for (own, contact) in contacts.filter(|(own, _)| own.may_turn::<A>(self.sim)) {
            see(own.touch, own.slip_left(within, self.sim, &view, (qdd.as_slice(), contact), (q, time))?);
        }
        Ok(())
    }

    /// Whether a contact slides whose slip may turn.
    pub fn may_turn(&self) -> bool {
        self.active.lasting.iter().any(|own| own.may_turn::<A>(self.sim))
    }

    /// What is left of the slip that ends first, at these accelerations, which are the last ones computed: negative where it ends within a
    /// sixteenth of t, so that slips that end together end by one event.
    pub fn least_slip_left(&mut self, qdd: &DVector<f64>, at: (f64, &[f64])) -> Result<f64, SimError> {
        let mut least = f64::MAX;
        self.slips_left(SHARE.powi(3) * self.sim.zeno_time, qdd, at, |_, left| least = least.min(left))?;
        Ok(least)
    }

    /// Takes away what does not rest in the present mode; returns whether there was any.
    pub fn is_moving(&self, ending: &mut Ending) -> bool {
        let all = ending.touches.len() + ending.joints.len();
        let sticks =
            |touch: &usize| self.active.lasting.iter().any(|own| own.touch == *touch && own.hold == Hold::Sticks);
        ending.touches.retain(sticks);
        ending.joints.retain(|k| self.active.dry[*k].state == Dry::Holds);
        ending.touches.len() + ending.joints.len() < all
    }
}

/// What comes to rest soon.
#[derive(Debug, Default)]
pub(crate) struct Ending {
    pub touches: Vec<usize>,
    /// Indices into `dry`.
    pub joints: Vec<usize>,
}

impl Ending {
    pub fn is_empty(&self) -> bool {
        self.touches.is_empty() && self.joints.is_empty()
    }
}

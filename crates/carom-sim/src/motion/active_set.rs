//! The active set of a motion: the constraints that hold now, with their modes.

use super::lasting::{Dry, DryJoint, Hold, Lasting};
use crate::contact::ContactMode;
use crate::model::Simulation;

/// The closed contacts and the joints with dry friction, with what drives and decisions ask of the past. It is copied where a motion
/// continues, or is compared with another one.
#[derive(Debug, Clone)]
pub(crate) struct ActiveSet {
    /// The closed contacts.
    pub lasting: Vec<Lasting>,
    /// Whether the motion is computed by time steps.
    pub stepping: bool,
    /// Joints with dry friction.
    pub dry: Vec<DryJoint>,
    /// Impacts so far, by touch.
    pub impacts: Vec<usize>,
    /// For each number of qd whether an impact has hit its robot.
    pub was_hit: Vec<bool>,
    /// The largest velocity at the last decision, m/s: see `zero.rs`.
    pub speed: f64,
}

impl ActiveSet {
    /// Free motion before the first impact.
    pub fn new(sim: &Simulation) -> Self {
        let rough = sim.friction().into_iter().enumerate().filter(|(_, friction)| *friction > 0.0);
        Self {
            lasting: Vec::new(),
            stepping: false,
            dry: rough.map(|(v, friction)| DryJoint { v, friction, state: Dry::Holds }).collect(),
            impacts: vec![0; sim.touches.len()],
            was_hit: vec![false; sim.chain.nv()],
            speed: 0.0,
        }
    }

    /// Counts an impact of a touch.
    pub fn count_impact(&mut self, touch: usize, sim: &Simulation) {
        self.impacts[touch] += 1;
        if sim.chain.members().is_empty() {
            self.was_hit.fill(true);
        } else {
            sim.touches[touch].robots(&sim.chain).for_each(|robot| self.was_hit[robot.v.clone()].fill(true));
        }
    }

    /// Whether a contact sticks.
    pub fn sticks(&self, touch: usize) -> bool {
        self.lasting.iter().any(|own| own.touch == touch && own.hold == Hold::Sticks)
    }

    /// Whether both have the same contacts in the same modes.
    pub fn is_alike(&self, other: &Self) -> bool {
        let same = |(own, other): (&Lasting, &Lasting)| {
            let (own, other) = (own.mode(), other.mode());
            own.touch() == other.touch() && std::mem::discriminant(&own) == std::mem::discriminant(&other)
        };
        let contacts = self.lasting.len() == other.lasting.len() && self.lasting.iter().zip(&other.lasting).all(same);
        let joints = self.dry.iter().zip(&other.dry).all(|(own, other)| own.state == other.state);
        contacts && joints && self.stepping == other.stepping
    }

    /// Whether both are of simulations with the same number of touches.
    pub fn fits(&self, other: &Self) -> bool {
        self.impacts.len() == other.impacts.len()
    }

    /// The contact mode, in one word.
    pub fn mode(&self) -> ContactMode {
        match &self.lasting[..] {
            _ if self.stepping => ContactMode::Stepping,
            [] => ContactMode::Free,
            [only] => only.mode(),
            _ => ContactMode::Several,
        }
    }
}

//! The active set of a motion: what lasts between two events, the closed contacts with their modes and the joints with dry friction.

use crate::contact::{Compliance, ContactMode, ContactRule, Grip, Memory, Slack, Touch};
use crate::error::SimError;
use crate::model::Simulation;
use crate::state::{Space, View};
use nalgebra::Vector3;

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

    /// Begins time steps, to which rigid contacts are left.
    pub fn let_go(&mut self) {
        self.stepping = true;
        self.lasting.retain(|own| !own.is_rigid());
    }

    /// Whether both have the same contacts in the same modes.
    pub fn is_alike(&self, other: &Self) -> bool {
        let same = |(own, other): (&Lasting, &Lasting)| own.is_alike(other);
        let contacts = self.lasting.len() == other.lasting.len() && self.lasting.iter().zip(&other.lasting).all(same);
        let joints = self.dry.iter().zip(&other.dry).all(|(own, other)| own.state == other.state);
        contacts && joints && self.stepping == other.stepping
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

/// A closed contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lasting {
    pub touch: usize,
    pub hold: Hold,
}

/// How a closed contact enters the equations of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Hold {
    /// It slides. The direction of slip, a unit vector, holds while the slip is too small to define it; it is zero without
    /// friction and at joint limits.
    Slides { toward: Vector3<f64> },
    /// It slides from rest, still slowly, in this direction: see `starting.rs`.
    Starts { toward: Vector3<f64> },
    /// It sticks.
    Sticks,
    /// A latch: it sticks whatever the force.
    Latched,
    /// A compliant contact with this damping: a force without a constraint. `deepest` is the penetration, m, at which it
    /// last changed from loading to unloading; −∞ if it did not, or has become deeper.
    Presses { damping: f64, deepest: f64 },
}

impl Lasting {
    /// A rigid contact that slips in this direction, or rests.
    pub fn of(touch: usize, of: &Touch, slip: Option<Vector3<f64>>) -> Self {
        let rough = of.contact.law.friction() > 0.0 && of.link().is_some();
        let hold = match slip {
            _ if of.contact.latch => Hold::Latched,
            _ if !rough => Hold::Slides { toward: Vector3::zeros() },
            Some(toward) => Hold::Slides { toward },
            None => Hold::Sticks,
        };
        Self { touch, hold }
    }

    /// Whether both are the same contact in the same mode.
    pub fn is_alike(&self, other: &Self) -> bool {
        self.touch == other.touch && std::mem::discriminant(&self.mode()) == std::mem::discriminant(&other.mode())
    }

    /// Whether it is a constraint.
    pub fn is_rigid(&self) -> bool {
        !matches!(self.hold, Hold::Presses { .. })
    }

    /// How far the normal force of a compliant contact with this gap and gap rate is from vanishing: see [`Compliance::slack`].
    pub fn slack(&self, rule: &ContactRule, gap: (f64, f64)) -> Option<Slack> {
        let Hold::Presses { damping, deepest } = self.hold else { return None };
        let memory = Memory { damping, deepest, deflection: Vector3::zeros() };
        rule.compliance?.slack(&rule.law, &memory, gap)
    }

    /// What the slider of its bristle carries: see [`Compliance::grip`](crate::Compliance).
    pub fn grip<A: Space>(
        &self,
        touch: &Touch,
        deflection: Vector3<f64>,
        (view, q, qd, time): (&View<A>, &[f64], &[f64], f64),
    ) -> Result<Option<Grip>, SimError> {
        let compliance = touch.contact.compliance.filter(Compliance::has_bristle);
        let (Hold::Presses { damping, deepest }, Some(compliance)) = (self.hold, compliance) else { return Ok(None) };
        let at = touch.at(view, q, time);
        let Some(place) = at.surface else { return Ok(None) };
        let u = touch.u(&place, view, qd, time)?;
        let memory = Memory { damping, deepest, deflection };
        compliance.grip(&touch.contact.law, &memory, (at.gap, place.normal.dot(&u)), &place.normal, &u)
    }

    /// Its mode.
    pub fn mode(&self) -> ContactMode {
        let touch = self.touch;
        match self.hold {
            Hold::Slides { .. } | Hold::Starts { .. } => ContactMode::Sliding { touch },
            Hold::Sticks => ContactMode::Sticking { touch },
            Hold::Latched => ContactMode::Latched { touch },
            Hold::Presses { damping, .. } => ContactMode::Pressing { touch, damping },
        }
    }
}

/// A joint with dry friction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DryJoint {
    pub v: usize,
    /// N m or N.
    pub friction: f64,
    pub state: Dry,
}

/// The state of the dry friction of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Dry {
    /// The joint sticks.
    Holds,
    /// The joint slips in this direction (1 or −1), with the friction against it.
    Brakes(f64),
}

//! Events and contacts with the names of their contacts, as they are written.

use super::trajectory::{EnergyBooks, Event, EventKind, EventLoads, Statistics, StopReason, Summary};
use crate::contact::{ContactMode, Touch};
use crate::impact::ChainImpact;
use crate::model::Simulation;
use crate::motion::ContactState;
use crate::state::{ContactImpulse, Moment};
use serde::Serialize;

/// What happens at a contact, with the contact's name.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct AtContact<'a, T> {
    /// Name of the contact.
    pub contact: &'a str,
    /// What happens there.
    #[serde(flatten)]
    pub what: &'a T,
}

/// An impact with the name of its law.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct UnderLaw<'a> {
    /// Name of the contact's law.
    pub law: &'static str,
    /// The impact.
    #[serde(flatten)]
    pub hit: &'a ChainImpact,
}

/// An event with the names of its contacts.
#[derive(Debug, Clone, Serialize)]
pub struct NamedEvent<'a> {
    /// Time, s.
    pub time: f64,
    /// The estimated error of the time, s, if it was asked for and there is one: of [`RunError::events`](super::RunError::events).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_error: Option<f64>,
    /// Name of the kind: [`EventKind::name`].
    pub kind: &'static str,
    /// The contact or the joint; `None` if the event belongs to none or to several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<&'a str>,
    /// The contacts of an event of several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<&'a str>,
    /// Configuration, length nq.
    pub q: &'a [f64],
    /// Joint velocities before the event, length nv; rad/s, m/s.
    pub qd_minus: &'a [f64],
    /// Joint velocities after the event, length nv; rad/s, m/s.
    pub qd_plus: &'a [f64],
    /// Why time steps begin, or why the motion is not unique.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<&'static str>,
    /// Flags of an impact at several contacts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flags: Vec<&'static str>,
    /// The impact at a single contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impact: Option<UnderLaw<'a>>,
    /// The contact impulses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impulses: Vec<AtContact<'a, ContactImpulse>>,
    /// The loads on the joints, if they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loads: Option<&'a EventLoads>,
}

impl NamedEvent<'_> {
    /// Kind and contacts: `impact foot on floor`.
    pub fn told(&self) -> String {
        let contacts: Vec<&str> = self.contact.into_iter().chain(self.contacts.iter().copied()).collect();
        if contacts.is_empty() { self.kind.to_owned() } else { format!("{} {}", self.kind, contacts.join(" and ")) }
    }
}

impl Event {
    /// The event with the names of these contacts, those of its [`Simulation::touches`](crate::Simulation::touches).
    #[doc(hidden)]
    pub fn named<'a>(&'a self, touches: &'a [Touch]) -> NamedEvent<'a> {
        let name = |touch: &usize| touches[*touch].name.as_str();
        let several = match &self.kind {
            EventKind::Several { touches, .. } | EventKind::NonUnique { touches, .. } => touches.as_slice(),
            _ => &[],
        };
        NamedEvent {
            time: self.time,
            time_error: None,
            kind: self.kind.name(),
            contact: match &self.kind {
                EventKind::Limit { joint, .. } | EventKind::Joint { joint, .. } => Some(joint),
                other => other.touch().as_ref().map(name),
            },
            contacts: several.iter().map(name).collect(),
            q: &self.q,
            qd_minus: &self.qd_minus,
            qd_plus: &self.qd_plus,
            reason: match &self.kind {
                EventKind::NonUnique { reason, .. } => Some(reason.name()),
                EventKind::Steps { reason } => Some(reason.name()),
                _ => None,
            },
            flags: match &self.kind {
                EventKind::Several { flags, .. } => flags.names().collect(),
                _ => Vec::new(),
            },
            impact: match &self.kind {
                EventKind::Impact { touch, hit } => Some(UnderLaw { law: touches[*touch].contact.law.name(), hit }),
                _ => None,
            },
            impulses: self.impulses.iter().map(|what| AtContact { contact: name(&what.touch), what }).collect(),
            loads: self.loads.as_deref(),
        }
    }
}

#[doc(hidden)]
impl ContactState {
    /// The lasting contact with its name, of those of its [`Simulation::touches`](crate::Simulation::touches).
    pub fn named<'a>(&'a self, touches: &'a [Touch]) -> AtContact<'a, Self> {
        AtContact { contact: &touches[self.touch].name, what: self }
    }
}

/// A whole run with the names of its joints and contacts, as the command line and the C API write it.
#[derive(Debug, Clone, Serialize)]
pub struct NamedRun<'a> {
    /// The joints with entries in q.
    pub joints: Vec<&'a str>,
    /// Why the run has ended.
    pub stop_reason: StopReason,
    /// Contact mode at the end.
    pub mode: ContactMode,
    /// The events in the order of time.
    pub events: Vec<NamedEvent<'a>>,
    /// State and lasting contacts at the end.
    pub r#final: NamedEnd<'a>,
    /// Energy balance.
    pub energy: EnergyBooks,
    /// Statistics of the solvers.
    pub statistics: Statistics,
}

/// The end of a run.
#[derive(Debug, Clone, Serialize)]
pub struct NamedEnd<'a> {
    /// Time and state.
    #[serde(flatten)]
    pub moment: &'a Moment,
    /// The lasting contacts.
    pub contacts: Vec<AtContact<'a, ContactState>>,
}

#[doc(hidden)]
impl Summary {
    /// The run of this simulation with its events and with names.
    pub fn named<'a>(&'a self, sim: &'a Simulation, events: &'a [Event]) -> NamedRun<'a> {
        let contacts = self.contacts.iter().map(|state| state.named(&sim.touches)).collect();
        NamedRun {
            joints: sim.chain.moving_joints().map(|joint| joint.name.as_str()).collect(),
            stop_reason: self.stop,
            mode: self.mode,
            events: events.iter().map(|event| event.named(&sim.touches)).collect(),
            r#final: NamedEnd { moment: &self.last, contacts },
            energy: self.energy,
            statistics: self.statistics,
        }
    }
}

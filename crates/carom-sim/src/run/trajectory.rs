//! The results of a simulation: events with the states before and after, the motion between them, the reason for the end,
//! solver statistics and the energy balance.

use crate::contact::ContactMode;
use crate::impact::{ChainImpact, ImpactLoads};
use crate::motion::{ContactState, NonUnique};
use crate::state::{CLEAR, ContactImpulse, EQUAL, Moment, NOTICED};
use carom_chain::Chain;
use carom_impact::Flags;
use serde::{Serialize, Serializer};
use std::f64::consts::PI;

/// The kind of an event.
#[derive(Debug, Clone)]
pub enum EventKind {
    /// An impact at a single contact.
    Impact {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// The result of the impact.
        hit: Box<ChainImpact>,
    },
    /// An impact at several contacts, or at one while another lasts: one problem for all of them, solved by
    /// [`Simulation::several`](crate::Simulation::several).
    Several {
        /// Indices in [`Simulation::touches`](crate::Simulation::touches).
        touches: Vec<usize>,
        /// Residual of the contact conditions, relative to the velocities.
        residual: f64,
        /// `energy-gain` if the law has increased the energy, `non-unique` if the velocities depend on how impulses are
        /// distributed over redundant contacts.
        flags: Flags,
    },
    /// An impact at a latch, which holds the contact from now on.
    Latch {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// An impact of a joint at its limit.
    Limit {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// Name of the joint.
        joint: String,
        /// Impulse on the joint, N m s or N s.
        impulse: f64,
    },
    /// Zeno accumulation: infinitely many impacts in a finite time, replaced by their limit.
    Zeno {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// Number of impacts of the touch that were computed before.
        impacts: usize,
    },
    /// Change of the contact mode: a lasting contact begins, or changes between sliding and sticking.
    Mode {
        /// The new mode.
        mode: ContactMode,
    },
    /// A lasting contact opens.
    LiftOff {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A joint with dry friction begins to stick or to slip.
    Joint {
        /// Name of the joint.
        joint: String,
        /// `true`: it sticks from now on; `false`: it slips.
        holds: bool,
    },
    /// Time steps begin.
    Steps {
        /// Why.
        reason: StepReason,
    },
    /// The motion from here on, up to the next change of a mode, is one of several that the laws admit.
    NonUnique {
        /// Why.
        reason: NonUnique,
        /// The contacts: indices in [`Simulation::touches`](crate::Simulation::touches).
        touches: Vec<usize>,
    },
    /// The chain is at rest and stays at rest to the end.
    Rest,
}

/// Why a motion is computed by time steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepReason {
    /// The scene asks for them.
    Asked,
    /// A face lies on a mesh, or a rim on a round body: contacts that are not divided into points.
    Face,
    /// Too many impacts within one time step.
    Crowd,
    /// No mode of the contacts is consistent with the equations of motion and the laws of contact.
    NoMode,
    /// The motion with these contacts is too stiff for the integrators.
    Stiff,
}

impl StepReason {
    /// The reason in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Asked => "the scene asks for time steps",
            Self::Face => "a face lies on a mesh, or a rim on a round body",
            Self::Crowd => "too many events within one time step",
            Self::NoMode => "no mode of the contacts is consistent",
            Self::Stiff => "the motion is too stiff for the integrators",
        }
    }
}

impl Event {
    /// Indices of the touches of an impact that it strikes; none of other events. A contact that lasts, and that the impact of another one opens,
    /// has no impulse and is not struck.
    pub fn struck(&self) -> impl Iterator<Item = usize> {
        let size = |touch: usize| self.impulses.iter().find(|own| own.touch == touch).map(|own| own.impulse.norm());
        let all = self.kind.struck();
        let most = all.iter().filter_map(|touch| size(*touch)).fold(0.0, f64::max);
        all.iter().copied().filter(move |touch| size(*touch).is_none_or(|own| own > EQUAL * most))
    }
}

impl EventKind {
    /// What happens, apart from its numbers: the name of the kind, the contacts, the joint.
    #[doc(hidden)]
    pub fn mark(&self) -> (&'static str, Vec<usize>, Option<&str>) {
        let (touches, joint) = match self {
            Self::NonUnique { touches, .. } => (touches.clone(), None),
            Self::Joint { joint, .. } => (Vec::new(), Some(joint.as_str())),
            kind if kind.is_impact() => (kind.struck().to_vec(), None),
            kind => (kind.touch().into_iter().collect(), None),
        };
        (self.name(), touches, joint)
    }

    /// Name of the kind: `impact`, `several`, `latch`, `limit`, `zeno`, `lift-off`, `joint-stops`, `joint-moves`,
    /// `stepping`, `non-unique` or `rest`.
    /// For [`EventKind::Mode`] the name of the mode (`free`, `sliding`, `sticking`, `latched`, `pressing`).
    pub fn name(&self) -> &'static str {
        match self {
            Self::Impact { .. } => "impact",
            Self::Several { .. } => "several",
            Self::Latch { .. } => "latch",
            Self::Joint { holds: true, .. } => "joint-stops",
            Self::Joint { holds: false, .. } => "joint-moves",
            Self::NonUnique { .. } => "non-unique",
            Self::Rest => "rest",
            Self::Steps { .. } => "stepping",
            Self::Limit { .. } => "limit",
            Self::Zeno { .. } => "zeno",
            Self::Mode { mode } => mode.name(),
            Self::LiftOff { .. } => "lift-off",
        }
    }

    /// Whether velocities jump: `impact`, `several`, `limit` or `latch`.
    pub fn is_impact(&self) -> bool {
        !self.struck().is_empty()
    }

    /// Indices of the touches of an impact; none of other events.
    pub fn struck(&self) -> &[usize] {
        match self {
            Self::Impact { touch, .. } | Self::Limit { touch, .. } | Self::Latch { touch } => {
                std::slice::from_ref(touch)
            }
            Self::Several { touches, .. } => touches,
            _ => &[],
        }
    }

    /// Index of the touch, if the event belongs to exactly one.
    pub fn touch(&self) -> Option<usize> {
        match self {
            Self::Impact { touch, .. }
            | Self::Latch { touch }
            | Self::Limit { touch, .. }
            | Self::Zeno { touch, .. }
            | Self::LiftOff { touch } => Some(*touch),
            Self::Mode { mode } => mode.touch(),
            Self::Several { .. } | Self::Joint { .. } | Self::Steps { .. } | Self::NonUnique { .. } | Self::Rest => {
                None
            }
        }
    }
}

/// An event with the states before and after it.
#[derive(Debug, Clone)]
pub struct Event {
    /// Time, s.
    pub time: f64,
    /// The kind of the event.
    pub kind: EventKind,
    /// Configuration, length nq; the same before and after.
    pub q: Vec<f64>,
    /// Joint velocities before the event, length nv; rad/s, m/s.
    pub qd_minus: Vec<f64>,
    /// Joint velocities after the event, length nv; rad/s, m/s.
    pub qd_plus: Vec<f64>,
    /// The contact impulses; empty for joint limits and for events without impulses.
    pub impulses: Vec<ContactImpulse>,
    /// The loads on the joints, with [`Sampling::loads`], of the kinds impact, several, latch and limit.
    pub loads: Option<Box<EventLoads>>,
}

/// The loads on the joints at an impact of a run.
///
/// The impulse through a joint whose limit is hit has that of the stop along its axis. Of a chain that moves in a plane, one of corners that
/// differ across the plane carries the impulse of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventLoads {
    /// The impulses; those through the joints are empty for a mechanism with loops, where they are not determined.
    #[serde(flatten)]
    pub impact: ImpactLoads,
    /// The forces of the motors just before, after their limits, length nv; N m, N.
    pub motors_minus: Vec<f64>,
    /// The forces of the motors just after.
    pub motors_plus: Vec<f64>,
}

/// The motion between two times as dense output: q and qd at Chebyshev points. Interpolation between them gives the
/// polynomial of the integrator (of degree seven).
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// First time, s.
    pub start: f64,
    /// Last time, s.
    pub end: f64,
    /// (q, qd) at `start + (end − start)(1 − cos(π k/(n−1)))/2`, k = 0 … n−1.
    pub states: Vec<Vec<f64>>,
}

impl Segment {
    /// Number of points that determine the polynomial of the integrator.
    pub(crate) const POINTS: usize = 8;

    pub(crate) fn times(start: f64, end: f64, points: usize) -> impl Iterator<Item = f64> {
        let last = (points - 1) as f64;
        (0..points).map(move |k| start + (end - start) * 0.5 * (1.0 - (PI * k as f64 / last).cos()))
    }

    /// (q, qd) at a time between `start` and `end`, by barycentric interpolation.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let n = self.states.len();
        let (mut above, mut below) = (vec![0.0; self.states[0].len()], 0.0);
        for (k, (node, state)) in Self::times(self.start, self.end, n).zip(&self.states).enumerate() {
            if time == node {
                return state.clone();
            }
            // Barycentric weights of Chebyshev points of the second kind: alternating signs, halved at the ends.
            let half = if k == 0 || k == n - 1 { 0.5 } else { 1.0 };
            let weight = half * if k % 2 == 0 { 1.0 } else { -1.0 } / (time - node);
            below += weight;
            above.iter_mut().zip(state).for_each(|(sum, x)| *sum += weight * x);
        }
        above.iter_mut().for_each(|sum| *sum /= below);
        above
    }

    /// Times, weights (s) and states of Gauss's quadrature of order 8 over both halves: ∫ g dt over the segment is Σ weight g(time, state).
    pub fn quadrature(&self) -> impl Iterator<Item = (f64, f64, Vec<f64>)> {
        let half = 0.5 * (self.end - self.start);
        let points = Step::POINTS.iter().zip(Step::WEIGHTS);
        let times =
            [self.start, self.start + half].map(|start| points.clone().map(move |(c, b)| (start + half * c, half * b)));
        times.into_iter().flatten().map(|(time, weight)| (time, weight, self.at(time)))
    }
}

/// One integration step: its states at its start and at given points.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub start: f64,
    pub end: f64,
    pub before: Vec<f64>,
    /// At `start + (end − start) c` for the points c of [`Step::POINTS`].
    pub states: Vec<Vec<f64>>,
}

impl Step {
    /// Gauss's points: the zeros of Legendre's polynomial of degree 4, in 0 … 1.
    pub const POINTS: [f64; 4] =
        [0.069_431_844_202_973_71, 0.330_009_478_207_571_9, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];

    /// The weights of Gauss's quadrature at them: ∫ g dt = (end − start) Σ b g with order 8.
    pub const WEIGHTS: [f64; 4] =
        [0.173_927_422_568_726_93, 0.326_072_577_431_273_07, 0.326_072_577_431_273_07, 0.173_927_422_568_726_93];
}

/// Output of a run, passed to the callback of [`Simulation::stream`](crate::Simulation::stream).
#[derive(Debug)]
pub enum Seen<'a> {
    /// The state at a sampled time; at the time of an event, the state before it.
    Moment(&'a Moment),
    /// An event.
    Event(&'a Event),
    /// The lasting contacts at the time of the moment before; not reported where there are none.
    Contacts(f64, &'a [ContactState]),
    /// The forces of the motors, after their limits, at the time of the moment before: length nv; N m, N. With [`Sampling::loads`].
    Motors(f64, &'a [f64]),
    /// The motion since the last segment or event.
    Segment(&'a Segment),
}

/// The output of a run in addition to its events.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sampling {
    /// Time between moments, s; `None`: no moments.
    pub every: Option<f64>,
    /// Whether to output segments.
    pub dense: bool,
    /// Whether to compute the forces of the motors at each moment, and the loads on the joints at each impact.
    pub loads: bool,
}

/// The reason for the end of a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The requested duration was reached.
    Duration,
    /// The maximal number of events was reached.
    Events,
}

impl StopReason {
    /// Name of the reason: `duration` or `events`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Duration => "duration",
            Self::Events => "events",
        }
    }
}

/// Defines a struct with the list of its fields.
macro_rules! listed {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[doc = $text:literal])* pub $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        pub struct $name { $($(#[doc = $text])* pub $field: $type,)* }

        impl $name {
            /// Name and description of each field.
            pub const FIELDS: &[(&str, &str)] = &[$((stringify!($field), concat!($($text),*))),*];
        }
    };
}

listed! {
/// Statistics of the solvers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Statistics {
    /// Accepted integration steps.
    pub steps: usize,
    /// Longest integration step, s.
    pub longest_step: f64,
    /// Rejected integration steps.
    pub rejections: usize,
    /// Evaluations of the equation of motion.
    pub evaluations: usize,
    /// Steps repeated to reach the exact time of an event.
    pub refinements: usize,
    /// Time steps with several contacts.
    pub contact_steps: usize,
    /// Sum of the estimated errors of the positions in time steps with step control, rad or m: each is the largest difference
    /// between one step and two of half its length.
    pub step_error: f64,
    /// Largest residual of the problems with several contacts, relative to their velocities.
    pub worst_residual: f64,
    /// Energy that impulses of time steps have added where no surface moves, J: their law gains energy there.
    pub energy_gained: f64,
    /// Time in contact modes, and in time steps, whose motion depends on how forces are distributed over redundant contacts, s.
    pub non_unique_time: f64,
    /// Number of impacts whose friction was neglected.
    pub neglected_frictions: usize,
    /// Largest bound on the error of these impacts: change of the velocity of the contact point, relative to its velocity
    /// before the impact.
    pub neglected_bound: f64,
    /// Largest penetration of compliant contacts that were treated as rigid, m.
    pub neglected_depth: f64,
}
}

/// The energy balance of a run, J: `end = start + drive + resistance − impacts`, up to the error of the integration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergyBooks {
    /// Kinetic plus potential energy at the start.
    pub start: f64,
    /// Kinetic plus potential energy at the end.
    pub end: f64,
    /// Work of the motors.
    pub drive: f64,
    /// Work of damping, dry friction and lasting contacts: not positive, except with moving surfaces.
    pub resistance: f64,
    /// Energy lost in impacts and by the impulses of time steps: −½ Σ (u⁻ + u⁺)·p (negative: gained).
    pub impacts: f64,
}

impl Serialize for EnergyBooks {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Self { start, end, drive, resistance, impacts } = *self;
        let lost = ("lost_in_impacts", impacts);
        let all = [("start", start), ("end", end), ("drive", drive), ("resistance", resistance), lost];
        to.collect_map(all.into_iter().chain([("error", self.error())]))
    }
}

impl EnergyBooks {
    /// The residual of the balance, J, which measures the error of the integration.
    pub fn error(&self) -> f64 {
        self.end - (self.start + self.drive + self.resistance - self.impacts)
    }

    /// The sum of the sizes of the energies at the start and of all works and losses, J.
    fn size(&self) -> f64 {
        self.start.abs() + self.drive.abs() + self.resistance.abs() + self.impacts.abs()
    }
}

/// The summary of a run.
#[derive(Debug, Clone)]
pub struct Summary {
    /// State at the end.
    pub last: Moment,
    /// Contact mode at the end.
    pub mode: ContactMode,
    /// The lasting contacts at the end.
    pub contacts: Vec<ContactState>,
    /// Reason for the end.
    pub stop: StopReason,
    /// Number of events.
    pub events: usize,
    /// Statistics of the solvers.
    pub statistics: Statistics,
    /// Energy balance.
    pub energy: EnergyBooks,
}

impl Summary {
    /// What to tell the user of the results: an energy balance that does not close, impulses that do not satisfy their law.
    pub fn warnings(&self) -> Vec<String> {
        let residual = self.statistics.worst_residual;
        let unsolved = (residual > 10.0 * NOTICED).then(|| {
            format!(
                "impulses of several contacts satisfy their law to {residual:.1e} of the contact velocities only: friction wedges a contact, \
                 or masses are too different; choose another law (several), less friction or restitution"
            )
        });
        let gained = self.statistics.energy_gained;
        let gains = (gained > CLEAR * self.energy.size()).then(|| {
            format!(
                "the impulses of time steps have added {gained:.3e} J: their law gains energy at these contacts, choose another law (several), \
                 less restitution or friction, or method = \"events\""
            )
        });
        self.balance_warning().into_iter().chain(unsolved).chain(gains).collect()
    }

    fn balance_warning(&self) -> Option<String> {
        let (error, scale) = (self.energy.error(), self.energy.size());
        let stepped = self.statistics.contact_steps > 0;
        let changed = if error > 0.0 { "gained" } else { "lost" };
        let help = if stepped { "use shorter time steps (contact_step)" } else { "use a smaller tolerance" };
        // Integration stays far below; time steps do not where they are too long for the motion.
        let most = if stepped { 10.0 * NOTICED } else { NOTICED };
        (error.abs() > most * scale).then(|| {
            format!(
                "the energy balance does not close: {:.3e} J {changed} without a cause, beside {scale:.3e} J at the start, of drives, \
                 resistance and impacts: {help}",
                error.abs()
            )
        })
    }
}

/// A whole run with its events and its motion.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// The events in the order of time.
    pub events: Vec<Event>,
    /// The motion between events.
    pub segments: Vec<Segment>,
    /// The summary of the run.
    pub summary: Summary,
}

impl Trajectory {
    /// The state at a time, s. At the time of an event it is the state after the event; for times outside the run it is the
    /// first or the last state.
    pub fn at(&self, chain: &Chain, time: f64) -> Moment {
        let later = self.segments.partition_point(|segment| segment.start <= time);
        let Some(segment) = self.segments.get(later.saturating_sub(1)) else { return self.summary.last.clone() };
        let state = segment.at(time.clamp(segment.start, segment.end));
        let (q, qd) = state.split_at(chain.nq());
        Moment { time, q: q.to_vec(), qd: qd.to_vec() }
    }
}

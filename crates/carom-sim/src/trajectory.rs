//! What a simulation tells: events with both sides of their jump, the motion between them, why it stopped, what it cost,
//! the energy's books.

use crate::strike::ChainImpact;
use carom_chain::Chain;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// The chain at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time, s.
    pub time: f64,
    /// Configuration.
    pub q: Vec<f64>,
    /// Joint velocities.
    pub qd: Vec<f64>,
}

/// How the chain meets its surroundings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactMode {
    /// Nothing touches.
    Free,
    /// It touches and slides.
    Sliding {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// It touches and sticks.
    Sticking {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A latch holds it.
    Latched {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A compliant contact presses.
    Pressing {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// Its damping a, s/m, from the speed of its approach.
        damping: f64,
    },
    /// Several contacts at once, by time stepping.
    Several,
}

impl ContactMode {
    /// `free`, `sliding`, `sticking`, `latched`, `pressing` or `several`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Sliding { .. } => "sliding",
            Self::Sticking { .. } => "sticking",
            Self::Latched { .. } => "latched",
            Self::Pressing { .. } => "pressing",
            Self::Several => "several",
        }
    }

    /// The one touch that touches.
    pub fn touch(self) -> Option<usize> {
        match self {
            Self::Free | Self::Several => None,
            Self::Sliding { touch }
            | Self::Sticking { touch }
            | Self::Latched { touch }
            | Self::Pressing { touch, .. } => Some(touch),
        }
    }
}

/// What happened.
#[derive(Debug, Clone)]
pub enum EventKind {
    /// A touch came together with a normal velocity: an impact.
    Impact {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// The impact, in full.
        hit: Box<ChainImpact>,
    },
    /// Several touches came together at once, or one while another lasted: Newton's restitution and Coulomb's cone for
    /// all of them in one problem.
    Several {
        /// Indices in [`Simulation::touches`](crate::Simulation::touches).
        touches: Vec<usize>,
        /// What the solver left of the conditions, relative to the velocities.
        residual: f64,
    },
    /// A touch came together and is held from now on.
    Latch {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// A joint ran into its limit: an impact of its own.
    Limit {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// Name of the joint.
        joint: String,
        /// Impulse on the joint, N m s or N s.
        impulse: f64,
    },
    /// Infinitely many impacts in a finite time, gone through by the accumulation formula.
    Zeno {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
        /// How many impacts of the touch were computed one by one before.
        impacts: usize,
    },
    /// Sustained contact begins, or changes between sliding and sticking.
    Mode {
        /// The mode from now on.
        mode: ContactMode,
    },
    /// A sustained contact opens.
    LiftOff {
        /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
        touch: usize,
    },
    /// The dry friction of a joint stops it, or lets it go.
    Joint {
        /// Name of the joint.
        joint: String,
        /// It is held from now on.
        holds: bool,
    },
    /// Nothing moves any more, and nothing will.
    Rest,
}

impl EventKind {
    /// `impact`, `several`, `latch`, `limit`, `zeno`, `free`, `sliding`, `sticking`, `latched`, `pressing`, `lift-off`, `joint-stops`,
    /// `joint-moves` or `rest`; of modes their own name, with `stepping` for several contacts.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Impact { .. } => "impact",
            Self::Several { .. } => "several",
            Self::Latch { .. } => "latch",
            Self::Joint { holds: true, .. } => "joint-stops",
            Self::Joint { holds: false, .. } => "joint-moves",
            Self::Rest => "rest",
            Self::Mode { mode: ContactMode::Several } => "stepping",
            Self::Limit { .. } => "limit",
            Self::Zeno { .. } => "zeno",
            Self::Mode { mode } => mode.name(),
            Self::LiftOff { .. } => "lift-off",
        }
    }

    /// The touch it concerns.
    pub fn touch(&self) -> Option<usize> {
        match self {
            Self::Impact { touch, .. }
            | Self::Latch { touch }
            | Self::Limit { touch, .. }
            | Self::Zeno { touch, .. }
            | Self::LiftOff { touch } => Some(*touch),
            Self::Mode { mode } => mode.touch(),
            Self::Several { .. } | Self::Joint { .. } | Self::Rest => None,
        }
    }
}

/// An event with the states on both of its sides.
#[derive(Debug, Clone)]
pub struct Event {
    /// Time, s.
    pub time: f64,
    /// What happened.
    pub kind: EventKind,
    /// Configuration, the same on both sides.
    pub q: Vec<f64>,
    /// Joint velocities before.
    pub qd_minus: Vec<f64>,
    /// Joint velocities after.
    pub qd_plus: Vec<f64>,
    /// Where impulses acted.
    pub blows: Vec<Blow>,
}

/// One impulse on the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blow {
    /// Index of the touch in [`Simulation::touches`](crate::Simulation::touches).
    pub touch: usize,
    /// Where it acts, world, m.
    pub point: Vector3<f64>,
    /// The impulse, world, N s.
    pub impulse: Vector3<f64>,
}

/// The motion between two times, with its dense output: q and qd at Chebyshev's points, between which the polynomial
/// through them is the integrator's own (seventh degree).
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
    /// How many points the integrator's polynomial needs.
    pub(crate) const POINTS: usize = 8;

    pub(crate) fn times(start: f64, end: f64, points: usize) -> impl Iterator<Item = f64> {
        let last = (points - 1) as f64;
        (0..points).map(move |k| start + (end - start) * 0.5 * (1.0 - (PI * k as f64 / last).cos()))
    }

    /// (q, qd) at a time: barycentric interpolation.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let n = self.states.len();
        let (mut above, mut below) = (vec![0.0; self.states[0].len()], 0.0);
        for (k, (node, state)) in Self::times(self.start, self.end, n).zip(&self.states).enumerate() {
            if time == node {
                return state.clone();
            }
            // Weights of Chebyshev's points of the second kind: alternating, halved at the ends.
            let half = if k == 0 || k == n - 1 { 0.5 } else { 1.0 };
            let weight = half * if k % 2 == 0 { 1.0 } else { -1.0 } / (time - node);
            below += weight;
            above.iter_mut().zip(state).for_each(|(sum, x)| *sum += weight * x);
        }
        above.iter_mut().for_each(|sum| *sum /= below);
        above
    }
}

/// What a run hands out while it goes on.
#[derive(Debug)]
pub enum Seen<'a> {
    /// The chain at a sampled time. At the time of an event it is the state before it.
    Moment(&'a Moment),
    /// What happened.
    Event(&'a Event),
    /// The motion since the last segment, or since an event.
    Segment(&'a Segment),
}

/// What a run hands out besides its events.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sampling {
    /// Seconds between moments; `None` for none.
    pub every: Option<f64>,
    /// Hand out segments.
    pub dense: bool,
}

/// Why a simulation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The asked duration is over.
    Duration,
    /// The number of events reached its bound.
    Events,
}

impl StopReason {
    /// `duration` or `events`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Duration => "duration",
            Self::Events => "events",
        }
    }
}

/// What it cost.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: usize,
    /// Rejected steps.
    pub rejections: usize,
    /// Evaluations of the equation of motion.
    pub evaluations: usize,
    /// Repeated steps to an event's exact time.
    pub refinements: usize,
    /// Fixed steps with several contacts at once.
    pub contact_steps: usize,
    /// The worst residual of a problem with several contacts, relative to its velocities.
    pub worst_residual: f64,
    /// Impacts whose friction was left out.
    pub neglected: usize,
    /// The greatest bound among them: by how much the velocity of the touching point may be off, as a share of what it
    /// was before.
    pub neglected_bound: f64,
    /// The greatest depth of compliant contacts that were taken for rigid, m.
    pub neglected_depth: f64,
}

/// Kinetic plus potential energy, and where it went, J: `end = start + drive + resistance − impacts`, but for the error of
/// the integration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergyBooks {
    /// At the start.
    pub start: f64,
    /// At the end.
    pub end: f64,
    /// Work of the motors.
    pub drive: f64,
    /// Work of damping, dry friction and lasting contacts: negative, but for surfaces that move.
    pub resistance: f64,
    /// Lost in impacts (negative: gained), and in steps with several contacts.
    pub impacts: f64,
}

impl EnergyBooks {
    /// What the books miss: the error of the integration, seen from the energy.
    pub fn error(&self) -> f64 {
        self.end - (self.start + self.drive + self.resistance - self.impacts)
    }
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct Summary {
    /// The last moment.
    pub last: Moment,
    /// The mode at the end.
    pub mode: ContactMode,
    /// Why it ended.
    pub stop: StopReason,
    /// How many events there were.
    pub events: usize,
    /// What it cost.
    pub statistics: Statistics,
    /// The energy's books.
    pub energy: EnergyBooks,
}

/// A whole run, kept.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// In the order of time.
    pub events: Vec<Event>,
    /// The motion between events.
    pub segments: Vec<Segment>,
    /// How it ended.
    pub summary: Summary,
}

impl Trajectory {
    /// The chain at a time; after an event where the time is that of one, at the first or last moment outside.
    pub fn at(&self, chain: &Chain, time: f64) -> Moment {
        let later = self.segments.partition_point(|segment| segment.start <= time);
        let Some(segment) = self.segments.get(later.saturating_sub(1)) else { return self.summary.last.clone() };
        let state = segment.at(time.clamp(segment.start, segment.end));
        let (q, qd) = state.split_at(chain.nq());
        Moment { time, q: q.to_vec(), qd: qd.to_vec() }
    }
}

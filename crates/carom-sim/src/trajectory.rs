//! What a simulation tells: events with both sides of their jump, why it stopped, what it cost, the energy's books.

use crate::strike::ChainImpact;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl ContactMode {
    /// `free`, `sliding` or `sticking`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Sliding { .. } => "sliding",
            Self::Sticking { .. } => "sticking",
        }
    }

    /// The touch that touches.
    pub fn touch(self) -> Option<usize> {
        match self {
            Self::Free => None,
            Self::Sliding { touch } | Self::Sticking { touch } => Some(touch),
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
    /// A joint ran into its limit: an impact of its own.
    Limit {
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
}

impl EventKind {
    /// `impact`, `limit`, `zeno`, `sliding`, `sticking` or `lift-off`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Impact { .. } => "impact",
            Self::Limit { .. } => "limit",
            Self::Zeno { .. } => "zeno",
            Self::Mode { mode } => mode.name(),
            Self::LiftOff { .. } => "lift-off",
        }
    }

    /// The touch it concerns.
    pub fn touch(&self) -> Option<usize> {
        match self {
            Self::Impact { touch, .. } | Self::Zeno { touch, .. } | Self::LiftOff { touch } => Some(*touch),
            Self::Mode { mode } => mode.touch(),
            Self::Limit { .. } => None,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: usize,
    /// Rejected steps.
    pub rejections: usize,
    /// Evaluations of the equation of motion.
    pub evaluations: usize,
    /// Repeated steps to an event's exact time.
    pub refinements: usize,
}

/// Kinetic plus potential energy, and where it went, J.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergyBooks {
    /// At the start.
    pub start: f64,
    /// At the end.
    pub end: f64,
    /// Lost in impacts (negative: gained).
    pub impacts: f64,
}

/// The result of a simulation. Its length is that of the list of events: what lies between was handed to the watcher.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// In the order of time.
    pub events: Vec<Event>,
    /// The last moment.
    pub last: Moment,
    /// The mode at the end.
    pub mode: ContactMode,
    /// Why it ended.
    pub stop: StopReason,
    /// What it cost.
    pub statistics: Statistics,
    /// The energy's books.
    pub energy: EnergyBooks,
}

//! What counts as zero in a run: all its thresholds of lengths, times and velocities, as multiples of those of the scene.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | L | length of the scene: the longest path along the links to a point of a shape, m | `length` |
//! | x | L, or the largest length among positions and coordinates, m | `extent` |
//! | T | 10 √(L/g), some periods of a pendulum; without gravity 1000 [`contact_step`](crate::Simulation::contact_step) | 1/`pace` |
//! | v | largest joint velocity, angles times L, or velocity of a surface, m/s | `speed` |
//! | τ | tolerance of the run | |
//!
//! | what | threshold | why |
//! | --- | --- | --- |
//! | rounding of a gap | 1e-14 x | a gap is a difference of positions |
//! | an overlap that is not corrected | 1e-12 L | some digits above rounding |
//! | a gap is closed, of a contact without normal velocity | min(τ, 1e-9) x | exact events leave rounding |
//! | a gap is closed in the instant of an event | 1e-9 x | the event is that of another contact |
//! | bodies overlap because a contact was missed | 10 max(τ, 1e-9) x | above what closed contacts leave |
//! | error of a velocity along constraints: `noise` | max(τ, 1e-6) v / 100, at least τ L/(100 T) | states are projected, so that it is far below the tolerance |
//! | a velocity is zero: `rest` | 10 times its error | one of this size stops within a time of the same size, and moves by its square |
//! | approach velocity of a part beside another one: `still` | a hundredth of that | a fast turn about one part is a slow approach of the other |
//! | slip that begins has the direction of its acceleration | √τ L/T | the error is of second order in the time of the start |
//!
//! Gaps and rates of the limits of hinges are angles, and are compared without L. Shares of forces and accelerations: `state/accuracy.rs`.

use super::smooth::Motion;
use crate::contact::Touch;
use crate::model::Simulation;
use crate::state::{CLEAR, EQUAL, ROUNDING, Space, beyond, reach};
use carom_chain::Coordinates;
use carom_chain::urdf::JointType;
use std::collections::BTreeMap;

/// The units of a scene: see the head of this module.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    /// Reach of the chain, m.
    pub reach: f64,
    /// L.
    pub length: f64,
    /// 1/T.
    pub pace: f64,
    /// For each velocity coordinate what makes it a velocity: L for angles, else 1.
    levers: Vec<f64>,
    /// The coordinates of q that are lengths.
    lengths: Vec<usize>,
    /// For each touch what makes lengths such as its gap: 1/L for limits of hinges, else 1.
    pub per_touch: Vec<f64>,
    /// L, or the distance of a base from the origin if it is larger; and the largest length among the coordinates, too.
    placed: f64,
    extent: f64,
}

/// [`Motion::noise`] as a share of the tolerance.
const NOISE: f64 = 2e-2;

impl Scale {
    pub fn new(sim: &Simulation) -> Self {
        let reach = reach(&sim.chain);
        let mut extents = BTreeMap::<&str, f64>::new();
        for (link, extent) in sim.touches.iter().flat_map(Touch::extents) {
            extents.entry(link).and_modify(|most| *most = most.max(extent)).or_insert(extent);
        }
        let extent = |link: &str| extents.get(link).copied().unwrap_or_default();
        let size = beyond(&sim.chain, extent).into_iter().fold(0.0, f64::max);
        let length = if size > 0.0 && size.is_finite() { size } else { 1.0 };
        let bases = sim.chain.bodies().iter().filter(|body| body.parent.is_none());
        let placed = bases.map(|body| body.placement.translation.norm()).fold(length, f64::max);
        let gravity = sim.gravity.norm();
        let pace = if gravity > 0.0 { 0.1 * (gravity / length).sqrt() } else { 1e-3 / sim.contact_step };
        let mut levers = vec![length; sim.chain.nv()];
        let mut lengths = Vec::new();
        for joint in sim.chain.joints() {
            let Coordinates::Own { q, v } = &joint.coordinates else { continue };
            let count = match joint.kind {
                JointType::Prismatic => 1,
                JointType::Planar => 2,
                JointType::Floating => 3,
                _ => 0,
            };
            levers[v.start..v.start + count].fill(1.0);
            lengths.extend(q.start..q.start + count);
        }
        let per_touch = sim.touches.iter().map(|touch| touch.stops().map_or(1.0, |(v, _)| levers[v].recip())).collect();
        Self { reach, length, pace, levers, lengths, per_touch, placed, extent: placed }
    }

    /// The largest of these joint velocities, angles times L, m/s.
    pub fn fastest<'v>(&self, qd: impl IntoIterator<Item = &'v f64>) -> f64 {
        self.levers.iter().zip(qd).fold(0.0, |most, (lever, v)| most.max(lever * v.abs()))
    }

    /// Gaps up to this count as closed when another contact closes.
    pub fn touching(&self, touch: usize) -> f64 {
        EQUAL * self.extent * self.per_touch[touch]
    }

    /// The rounding of the gap of bodies, m.
    pub fn rounding(&self) -> f64 {
        ROUNDING * self.extent
    }

    /// The rounding of a gap.
    pub fn hysteresis(&self, touch: usize) -> f64 {
        self.rounding() * self.per_touch[touch]
    }

    /// A velocity in the unit of a velocity coordinate: rad/s or m/s.
    pub fn joint(&self, v: usize, speed: f64) -> f64 {
        speed / self.levers[v]
    }

    /// Whether what is left of a time until another one is shorter than any step.
    pub fn is_reached(&self, until: f64, time: f64) -> bool {
        until - time <= 10.0 * ROUNDING * (1.0 / self.pace + until)
    }

    /// The acceleration L/T², m/s².
    pub fn acceleration(&self) -> f64 {
        self.length * self.pace * self.pace
    }

    /// The greatest difference of two configurations, rad, or of lengths as a share of L.
    pub fn apart(&self, q: &[f64], other: &[f64]) -> f64 {
        let unit = |k: usize| if self.lengths.contains(&k) { self.length } else { 1.0 };
        q.iter().zip(other).enumerate().map(|(k, (one, two))| (one - two).abs() / unit(k)).fold(0.0, f64::max)
    }

    /// The unit of each number of the state (q, q̇, two works, and deflections of bristles), of which its absolute error is a share: L, 1 rad,
    /// their rates over T, and the kinetic energy of this mass at L/T.
    pub fn units(&self, mass: f64, nq: usize, state: usize) -> Vec<f64> {
        let speed = self.length * self.pace;
        let mut units = vec![self.length; state];
        (0..nq).filter(|k| !self.lengths.contains(k)).for_each(|k| units[k] = 1.0);
        for (unit, lever) in units[nq..].iter_mut().zip(&self.levers) {
            *unit = speed / lever;
        }
        units[nq + self.levers.len()..][..2].fill(0.5 * mass * speed * speed);
        units
    }
}

impl<A: Space> Motion<'_, A> {
    /// The scale of the next decisions: at the start of a leg and of an impact.
    pub fn measure(&mut self, time: f64, y: &[f64]) {
        let surfaces = self.moving.iter().map(|motion| motion.speed(time)).fold(0.0, f64::max);
        let (q, qd) = self.split(y);
        self.speed = self.scale.fastest(qd).max(surfaces);
        self.scale.extent = self.scale.lengths.iter().fold(self.scale.placed, |most, &k| most.max(q[k].abs()));
    }

    /// The error of velocities along constraints, m/s: slip below it has no direction of its own. Tolerances below 1e-6 do not refine the
    /// direction of slip: where slip is slow it relaxes at a rate of the friction acceleration over the slip, and an explicit integrator
    /// would have to resolve it.
    pub fn noise(&self) -> f64 {
        let tolerance = self.sim.tolerance;
        NOISE * (tolerance.max(CLEAR) * self.speed).max(tolerance * self.scale.length * self.scale.pace)
    }

    /// Velocities below this count as zero, m/s.
    pub fn rest(&self) -> f64 {
        10.0 * self.noise()
    }

    /// The same for the gap rate of a touch.
    pub fn rest_of(&self, touch: usize) -> f64 {
        self.rest() * self.scale.per_touch[touch]
    }

    /// Approach velocities of a part beside another part of the same bodies below this count as zero, m/s.
    pub fn still(&self) -> f64 {
        0.01 * self.rest()
    }

    /// Slip from rest up to this has the direction of its acceleration, m/s.
    pub fn starts(&self) -> f64 {
        self.sim.tolerance.sqrt() * self.scale.length * self.scale.pace
    }

    /// Gaps below this count as closed where the contact has no normal velocity.
    pub fn closed(&self, touch: usize) -> f64 {
        self.sim.tolerance.min(EQUAL) * self.scale.extent * self.scale.per_touch[touch]
    }

    /// Bodies that touch overlap by more than this only where another contact of their parts was missed, m.
    pub fn overlaps(&self) -> f64 {
        10.0 * self.sim.tolerance.max(EQUAL) * self.scale.extent
    }
}

//! The units of a scene: see `zero.rs`.

use crate::contact::Touch;
use crate::model::Simulation;
use crate::state::{EQUAL, ROUNDING, beyond, reach};
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
    pub extent: f64,
}

impl Scale {
    pub fn new(sim: &Simulation) -> Self {
        let reach = reach(&sim.chain);
        let mut extents = BTreeMap::<&str, f64>::new();
        // Parts of a pair have its shapes.
        let shapes = sim.touches.chunk_by(Touch::is_of_the_same_pair).filter_map(<[Touch]>::first);
        for (link, extent) in shapes.flat_map(Touch::extents) {
            extents.entry(link).and_modify(|most| *most = most.max(extent)).or_insert(extent);
        }
        let extent = |link: &str| extents.get(link).copied().unwrap_or_default();
        let size = beyond(&sim.chain, extent).into_iter().fold(0.0, f64::max);
        let length = if size > 0.0 && size.is_finite() { size } else { 1.0 };
        let bases = sim.chain.bodies().iter().filter(|body| body.parent.is_none());
        let placed = bases.map(|body| body.placement.translation.norm()).fold(length, f64::max);
        let gravity = sim.gravity.norm();
        let pace = if gravity > 0.0 { 0.5 * (gravity / length).sqrt() } else { 1e-3 / sim.contact_step };
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
        let per_touch =
            sim.touches.iter().map(|touch| touch.stops().map_or(1.0, |(v, slope)| slope.abs() / levers[v])).collect();
        Self { reach, length, pace, levers, lengths, per_touch, placed, extent: placed }
    }

    /// Takes the lengths of a configuration into account.
    pub fn measure(&mut self, q: &[f64]) {
        self.extent = self.lengths.iter().fold(self.placed, |most, &k| most.max(q[k].abs()));
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

    /// The slowest approach of which a compliant contact has a damping of its own, m/s.
    pub fn slowest(&self) -> f64 {
        SLOWEST * self.length * self.pace
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

    /// The unit of each number of the state (q, q̇, two works, and deflections of bristles), of which its absolute error is a share: 1 m or rad,
    /// their rates per second, and the kinetic energy of this mass at 1 m/s. They have units: multiples of L and T made the steps of small
    /// bodies shorter than the rounding of their time, and those of large ones less accurate than documented.
    pub fn units(&self, mass: f64, nq: usize, state: usize) -> Vec<f64> {
        let mut units = vec![1.0; state];
        units[nq + self.levers.len()..][..2].fill(0.5 * mass);
        units
    }
}

/// The slowest motion, as a share of the pace of the scene, that has a time of its own, and the slowest approach, as a share of its speed
/// L/T, of which compliant contacts have a damping of their own: that of Hunt & Crossley grows as its inverse.
pub(crate) const SLOWEST: f64 = 1e-3;

/// Whether what is left of a time until another one is shorter than any step; `pace`: 1/T.
pub(crate) fn is_reached(until: f64, time: f64, pace: f64) -> bool {
    until - time <= 10.0 * ROUNDING * (1.0 / pace + until)
}

//! What counts as zero in a run: all its thresholds of lengths, times and velocities, as multiples of those of the scene.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | L | length of the scene: the longest path along the links to a point of a shape, m | `length` |
//! | x | L, or the largest length among positions and coordinates, m | `extent` |
//! | T | 2 √(L/g), the time of a fall through 2 L; without gravity 1000 [`contact_step`](crate::Simulation::contact_step) | 1/`pace` |
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
//! | error of a velocity along constraints: `noise` | max(τ, 1e-6) v / 20, at least τ L/(20 T) | states are projected, so that it is far below the tolerance |
//! | a velocity is zero: `rest` | 10 times its error | one of this size stops within a time of the same size, and moves by its square |
//! | approach velocity of a part beside another one: `still` | a hundredth of that | a fast turn about one part is a slow approach of the other |
//! | slip that begins has the direction of its acceleration | √τ L/T | the error is of second order in the time of the start |
//! | a compliant contact has the damping of its approach from | L/(1000 T) | that of Hunt & Crossley grows as the inverse of the approach |
//!
//! Gaps and rates of the limits of hinges are angles, and are compared without L. Shares of forces and accelerations: `state/accuracy.rs`.

use super::smooth::Motion;
use crate::state::{CLEAR, EQUAL, Space};

/// [`Motion::noise`] as a share of the tolerance.
const NOISE: f64 = 5e-2;
/// The motion of one part of a body may be so many times that of another part: where one of them is zero by the thresholds of this table, the
/// other one may be larger by this.
pub(crate) const LEVER: f64 = 100.0;

impl<A: Space> Motion<'_, A> {
    /// The scale of the next decisions: at the start of a leg and of an impact.
    pub fn measure(&mut self, time: f64, y: &[f64]) {
        let surfaces = self.moving.iter().map(|motion| motion.speed(time)).fold(0.0, f64::max);
        let (q, qd) = self.split(y);
        self.active.speed = self.scale.fastest(qd).max(surfaces);
        self.scale.measure(q);
    }

    /// The error of velocities along constraints, m/s: slip below it has no direction of its own. Tolerances below 1e-6 do not refine the
    /// direction of slip: where slip is slow it relaxes at a rate of the friction acceleration over the slip, and an explicit integrator
    /// would have to resolve it.
    pub fn noise(&self) -> f64 {
        let tolerance = self.sim.tolerance;
        NOISE * (tolerance.max(CLEAR) * self.active.speed).max(tolerance * self.scale.length * self.scale.pace)
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
        self.rest() / LEVER
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

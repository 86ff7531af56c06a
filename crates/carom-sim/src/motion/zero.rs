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
//! | slip u that begins has the direction d of its acceleration | up to √τ L/T, and while d × u is zero or 100 τ L/T, or its square beyond that below τ L/T \|u\| | the error is of second order in the turn of d |
//! | a compliant contact has the damping of its approach from | L/(1000 T) | that of Hunt & Crossley grows as the inverse of the approach |
//!
//! Gaps and rates of the limits of hinges are angles, and are compared without L. Shares of forces and accelerations: `state/accuracy.rs`.

use super::smooth::Motion;
use crate::state::{CLEAR, EQUAL, Space};
use nalgebra::Vector3;

/// [`Motion::noise`] as a share of the tolerance.
const NOISE: f64 = 5e-2;
/// The motion of one part of a body may be so many times that of another part: where one of them is zero by the thresholds of this table, the
/// other one may be larger by this.
pub(crate) const LEVER: f64 = 100.0;

/// Until when slip that begins has the direction of its acceleration, m/s: see the table above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    slip: f64,
    error: f64,
    /// Slip across the direction that counts as none.
    across: f64,
}

impl Start {
    /// How far the start of this slip is, whose acceleration has this direction; from 1 on it has ended.
    pub fn share(&self, slip: Vector3<f64>, toward: Vector3<f64>) -> f64 {
        let (size, across) = (slip.norm(), (toward.cross(&slip).norm() - self.across).max(0.0));
        (size / self.slip).max(across * across / (size * self.error).max(f64::MIN_POSITIVE))
    }
}

impl<A: Space> Motion<'_, A> {
    /// The scale of the next decisions: at the start of a leg and of an impact.
    pub fn measure(&mut self, time: f64, y: &[f64]) {
        let surfaces = self.moving.iter().map(|motion| motion.speed(time, self.scale.length)).fold(0.0, f64::max);
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

    /// Until when slip from rest has the direction of its acceleration.
    pub fn starts(&self) -> Start {
        let (tolerance, speed) = (self.sim.tolerance, self.scale.length * self.scale.pace);
        let error = tolerance * speed;
        Start { slip: tolerance.sqrt() * speed, error, across: self.rest().max(100.0 * error) }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use carom_chain::algebra::Spatial;
    use carom_testing::build::{O, Part, X, Y, ball, shape, urdf};
    use carom_testing::files::Folder;

    /// The thresholds of a pendulum of L = 0.45 m on a slide, which moves at 2 m/s and 3 rad/s, beside a wall that turns at 1 rad/s, in units of length and time, with their powers of both.
    fn thresholds(length: f64, time: f64) -> Vec<(&'static str, f64, [i32; 2])> {
        let foot = shape(&ball(0.05 * length), [0.0, 0.0, -0.4 * length], O);
        let bob = Part::new("bob", "slide", "revolute", Y, O).limits(-1.0, 1.0, 9.0).with(foot);
        let slide = Part::slider("slide", "base", X).limits(-9.0 * length, 9.0 * length, 9.0);
        let folder = Folder::new();
        folder.write("robot.urdf", urdf(&[slide, bob]));
        let scene = format!(
            "[robot]\nurdf = \"robot.urdf\"\nq = [{}, 0]\nqd = [{}, {}]\n[[surface]]\nname = \"wall\"\n\
             shape = {{ halfspace = {{ point = [{}, 0, 0], normal = [-1, 0, 0] }} }}\n\
             belt = {{ velocity = [0, 0, 0], angular_velocity = [{}, 0, 0] }}\n\
             [contact]\nfriction = 0.5\n\
             [run]\nduration = 1\ntolerance = 1e-7\ngravity = [0, 0, {}]\n",
            0.5 * length,
            2.0 * length / time,
            3.0 / time,
            2.0 * length,
            1.0 / time,
            -0.45 * length / (time * time),
        );
        let plan = Scene::from_toml(&scene, &folder).unwrap().plan().unwrap();
        let sim = &plan.simulation;
        let mut motion = Motion::<Spatial<f64>>::new(sim, &sim.chain);
        motion.measure(0.0, &[&plan.q[..], &plan.qd, &[0.0, 0.0]].concat());
        let limit = sim.touches.iter().position(|touch| touch.stops().is_some_and(|(v, _)| v == 1)).unwrap();
        let foot = sim.touches.iter().position(|touch| touch.link().is_some()).unwrap();
        let scale = &motion.scale;
        vec![
            ("length", scale.length, [1, 0]),
            ("extent", scale.extent, [1, 0]),
            ("pace", scale.pace, [0, -1]),
            ("acceleration", scale.acceleration(), [1, -2]),
            ("rounding of a gap", scale.hysteresis(foot), [1, 0]),
            ("rounding of an angle", scale.hysteresis(limit), [0, 0]),
            ("closed in an event", scale.touching(foot), [1, 0]),
            ("angle of a closed limit", scale.touching(limit), [0, 0]),
            ("closed without velocity", motion.closed(foot), [1, 0]),
            ("angle without velocity", motion.closed(limit), [0, 0]),
            ("overlap", motion.overlaps(), [1, 0]),
            ("noise", motion.noise(), [1, -1]),
            ("rest", motion.rest_of(foot), [1, -1]),
            ("rest of a limit", motion.rest_of(limit), [0, -1]),
            ("still", motion.still(), [1, -1]),
            ("starts", motion.starts().slip, [1, -1]),
            ("error of a start", motion.starts().error, [1, -1]),
            ("slip across a start", motion.starts().across, [1, -1]),
            ("slowest", scale.slowest(), [1, -1]),
            ("rate of a slide", scale.joint(0, 2.0 * length / time), [1, -1]),
            ("rate of a hinge", scale.joint(1, 2.0 * length / time), [0, -1]),
        ]
    }

    /// The table above, for T = 2 √(L/g) = 2 s.
    #[test]
    fn thresholds_are_those_of_the_table_in_every_unit() {
        let expected = [
            0.45,
            0.5,
            0.5,
            0.1125,
            5e-15,
            5e-15 / 0.45,
            5e-10,
            5e-10 / 0.45,
            5e-10,
            5e-10 / 0.45,
            5e-7,
            1e-7,
            1e-6,
            1e-6 / 0.45,
            1e-8,
            1e-7_f64.sqrt() * 0.225,
            1e-7 * 0.225,
            1e-5 * 0.225,
            2.25e-4,
            2.0,
            2.0 / 0.45,
        ];
        for (length, time) in [(1.0, 1.0), (1e3, 1.0), (1e-3, 1.0), (1.0, 30.0), (1e3, 0.01)] {
            for ((name, found, [l, t]), expected) in thresholds(length, time).into_iter().zip(expected) {
                let expected = expected * length.powi(l) * time.powi(t);
                assert!(
                    (found - expected).abs() < 1e-12 * expected,
                    "{name}: {found:e} for {expected:e} in {length} m, {time} s"
                );
            }
        }
    }
}

//! The expected measurement of a toss whose start is measured with errors.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | n | 1 | number of angles: three of the root link, one for each joint |
//! | σ | 1 | standard deviation of the error of each angle, rad |
//! | ε | n | an error: a rotation vector in the axes of the root link, and joint angles |
//! | D | 3×3 | the rotation of the first three components of ε |
//!
//! The errors are those of the calibration of the measured frames: they are constant during a toss and independent of each other. If
//! R and θ are measured, R D and θ + ε are the rotation and the joint angles of the robot; its position and its velocities in
//! the world frame are those measured. A roll-out from there to R(t), θ(t) predicts the measurement R(t) Dᵀ, θ(t) − ε. The mean over
//! ε is the prediction of least mean square error; to first order in ε it is the roll-out from the measured start, and in
//! free flight of a rigid body with a spherical tensor of inertia it is that roll-out itself.
//!
//! The mean over the normal distribution of ε is that of the 2n points ±√n σ eₖ, which is exact for polynomials of third degree
//! (I. Arasaratnam, S. Haykin, Cubature Kalman Filters, IEEE Trans. Autom. Control 54, 2009, eq. 32). The mean of rotations is
//! that of F. L. Markley, Y. Cheng, J. L. Crassidis, Y. Oshman (Averaging quaternions, J. Guid. Control Dyn. 30, 2007, eq. 13).

use super::roll_out::turn;
use super::{Launch, RollOutOptions, Scene, Toss};
use carom_sim::{ContactRule, Moment, SimError};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

/// A start with an error ε, and what turns its roll-out into a measurement: Dᵀ and −ε of the joints.
struct Turned {
    start: Launch,
    back: UnitQuaternion<f64>,
    joints: Vec<f64>,
}

impl Launch {
    /// The poses that are expected to be measured at the samples to `last`, with the velocities of the roll-out from this start,
    /// and the number of its events. Without errors (`scene.errors` = 0) the poses are those of this roll-out. A roll-out that
    /// the simulation refuses has no share in the mean.
    pub(crate) fn predict(
        &self,
        scene: &Scene,
        toss: &Toss,
        last: usize,
        contact: &ContactRule,
        options: &RollOutOptions,
    ) -> Result<(Vec<Moment>, usize), SimError> {
        let own = || self.simulate(scene, toss, last, contact, options);
        if scene.errors == 0.0 {
            return own();
        }
        let rolled = |one: &Turned| {
            let (moments, events) = one.start.simulate(scene, toss, last, contact, options).ok()?;
            Some((moments.iter().map(|moment| one.measured(moment)).collect::<Vec<_>>(), events))
        };
        let all: Vec<(Vec<Moment>, usize)> = self.turned(scene.errors).iter().filter_map(rolled).collect();
        let Some((first, events)) = all.first() else { return own() };
        let at = |k: usize| {
            let moments: Vec<&Moment> = all.iter().filter_map(|(moments, _)| moments.get(k)).collect();
            mean(&moments)
        };
        Ok(((0..first.len()).map(at).collect(), *events))
    }

    /// The 2n starts with errors.
    fn turned(&self, sigma: f64) -> Vec<Turned> {
        let count = self.q.len() - 4;
        let size = sigma * (count as f64).sqrt();
        let one = |point: usize| {
            let of = |k: usize| match point {
                point if point / 2 != k => 0.0,
                point if point % 2 == 0 => size,
                _ => -size,
            };
            let by = UnitQuaternion::from_scaled_axis(Vector3::new(of(0), of(1), of(2)));
            let back = by.inverse();
            let mut start = self.clone();
            let turned = turn(&self.q) * by;
            start.q[3..7].copy_from_slice(turned.coords.as_slice());
            for part in [0, 3] {
                let own = back * Vector3::from_column_slice(&self.qd[part..part + 3]);
                start.qd[part..part + 3].copy_from_slice(own.as_slice());
            }
            let joints: Vec<f64> = (3..count).map(|k| -of(k)).collect();
            start.q[7..].iter_mut().zip(&joints).for_each(|(q, joint)| *q -= joint);
            Turned { start, back, joints }
        };
        (0..2 * count).map(one).collect()
    }
}

impl Turned {
    /// The pose that is measured where the robot is at `moment`.
    fn measured(&self, moment: &Moment) -> Moment {
        let mut seen = moment.clone();
        seen.q[3..7].copy_from_slice((turn(&moment.q) * self.back).coords.as_slice());
        seen.q[7..].iter_mut().zip(&self.joints).for_each(|(q, joint)| *q += joint);
        seen
    }
}

/// The mean of poses, with arithmetic means of velocities.
fn mean(moments: &[&Moment]) -> Moment {
    let mut mean = moments[0].clone();
    let share = 1.0 / moments.len() as f64;
    let arithmetic =
        |of: fn(&Moment) -> &[f64], k: usize| moments.iter().map(|moment| of(moment)[k]).sum::<f64>() * share;
    for k in (0..3).chain(7..mean.q.len()) {
        mean.q[k] = arithmetic(|moment| &moment.q, k);
    }
    for k in 0..mean.qd.len() {
        mean.qd[k] = arithmetic(|moment| &moment.qd, k);
    }
    let turns: Vec<UnitQuaternion<f64>> = moments.iter().map(|moment| turn(&moment.q)).collect();
    mean.q[3..7].copy_from_slice(mean_turn(&turns).coords.as_slice());
    mean
}

/// The rotation of least mean square distance from rotations, as chords: the eigenvector of Σ q qᵀ to the greatest eigenvalue.
fn mean_turn(turns: &[UnitQuaternion<f64>]) -> UnitQuaternion<f64> {
    let sum: Matrix4<f64> = turns.iter().map(|turn| turn.coords * turn.coords.transpose()).sum();
    let eigen = sum.symmetric_eigen();
    let axis: Vector4<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    UnitQuaternion::from_quaternion(Quaternion::from(axis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use carom_chain::Chain;
    use carom_chain::urdf::LoadOptions;

    /// A cube with a hinged cube, or alone.
    fn scene(hinged: bool, errors: f64) -> Scene {
        let link = |name| {
            format!(
                "<link name='{name}'><inertial><mass value='0.4'/><inertia ixx='7e-4' iyy='7e-4' izz='7e-4' ixy='0' ixz='0' \
                 iyz='0'/></inertial><collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision></link>"
            )
        };
        let more = format!(
            "{}<joint name='j' type='continuous'><parent link='a'/><child link='b'/><origin xyz='0 0 0.15'/><axis xyz='1 0 \
             0'/></joint>",
            link("b")
        );
        let urdf = format!("<robot name='r'>{}{}</robot>", link("a"), if hinged { more } else { String::new() });
        let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
        Scene { chain: Chain::from_urdf_str(&urdf, &options).unwrap(), floor: 0.0, errors }
    }

    /// A start at a height, and a toss of 30 samples at intervals of 10 ms, of which only the times are used.
    fn thrown(scene: &Scene, height: f64) -> (Launch, Toss) {
        let by = UnitQuaternion::from_euler_angles(0.7, -0.4, 2.0);
        let mut q = vec![0.1, -0.2, height, by.i, by.j, by.k, by.w];
        let mut qd = vec![0.8, 0.3, -0.2, 3.0, -4.0, 2.0];
        if scene.chain.nv() > 6 {
            q.push(0.4);
            qd.push(2.0);
        }
        let sample = |k: usize| Moment { time: 0.01 * k as f64, q: q.clone(), qd: qd.clone() };
        let toss = Toss { number: 1, samples: (0..30).map(sample).collect() };
        (Launch { sample: 0, q, qd, impact: None, fitted: None }, toss)
    }

    fn predicted(hinged: bool, errors: f64, height: f64) -> Vec<Moment> {
        let scene = scene(hinged, errors);
        let (launch, toss) = thrown(&scene, height);
        let options = RollOutOptions { tolerance: 1e-10, ..RollOutOptions::default() };
        launch.predict(&scene, &toss, 29, &ContactRule::default(), &options).unwrap().0
    }

    /// Greatest differences of position (m), rotation and joint (rad).
    fn apart(a: &[Moment], b: &[Moment]) -> f64 {
        let one = |(a, b): (&Moment, &Moment)| {
            let places = a.q[..3].iter().chain(&a.q[7..]).zip(b.q[..3].iter().chain(&b.q[7..]));
            places.map(|(a, b)| (a - b).abs()).fold(turn(&a.q).angle_to(&turn(&b.q)), f64::max)
        };
        a.iter().zip(b).map(one).fold(0.0, f64::max)
    }

    /// In free flight the roll-out of a cube, whose tensor of inertia is spherical, does not depend on the axes of its link: its
    /// expected measurement is the roll-out from the measured start. Error of the integration 1e-10, of the angle of nearly equal
    /// quaternions √ε.
    #[test]
    fn the_expected_flight_of_a_cube_is_its_flight() {
        let (with, without) = (predicted(false, 0.05, 3.0), predicted(false, 0.0, 3.0));
        assert!(apart(&with, &without) < 1e-7, "{}", apart(&with, &without));
    }

    /// Means over antithetic starts contain no term of first order: in the flight of two links, whose motion depends on ε, the
    /// difference from the roll-out is proportional to σ².
    #[test]
    fn the_expected_flight_differs_by_the_square_of_the_errors() {
        let exact = predicted(true, 0.0, 3.0);
        let [coarse, fine] = [0.08, 0.04].map(|sigma| apart(&predicted(true, sigma, 3.0), &exact));
        assert!(coarse > 1e-4 && (coarse / fine - 4.0).abs() < 0.2, "{coarse} {fine}");
    }

    /// Without errors the prediction is the roll-out to the last digit, and after an impact the two differ.
    #[test]
    fn without_errors_the_prediction_is_the_roll_out() {
        let (scene, low) = (scene(true, 0.0), 0.3);
        let (launch, toss) = thrown(&scene, low);
        let options = RollOutOptions { tolerance: 1e-10, ..RollOutOptions::default() };
        let (rolled, _) = launch.simulate(&scene, &toss, 29, &ContactRule::default(), &options).unwrap();
        assert_eq!(predicted(true, 0.0, low), rolled);
        assert!(apart(&predicted(true, 0.02, low), &rolled) > 1e-3);
    }

    /// A start with an error measures, at its first sample, what was measured, and its world velocities are those measured.
    #[test]
    fn starts_with_errors_have_the_measured_pose_and_velocity() {
        let (launch, toss) = thrown(&scene(true, 0.0), 1.0);
        let all = launch.turned(0.05);
        assert_eq!(all.len(), 8);
        let mut sums = vec![0.0; 4];
        for one in &all {
            let start = Moment { q: one.start.q.clone(), qd: one.start.qd.clone(), ..toss.samples[0].clone() };
            assert!(apart(&[one.measured(&start)], &toss.samples[..1]) < 1e-7);
            for part in [0, 3] {
                let world = |q: &[f64], qd: &[f64]| turn(q) * Vector3::from_column_slice(&qd[part..part + 3]);
                assert!((world(&one.start.q, &one.start.qd) - world(&launch.q, &launch.qd)).norm() < 1e-14);
            }
            // the covariance of the points is σ² on the diagonal
            let error = one.back.inverse().scaled_axis();
            for (sum, x) in sums.iter_mut().zip([error.x, error.y, error.z, one.joints[0]]) {
                *sum += x * x / 8.0;
            }
        }
        assert!(sums.iter().all(|sum| (sum / 0.05_f64.powi(2) - 1.0).abs() < 1e-12), "{sums:?}");
    }

    /// The mean of two rotations is the half of the way between them, whatever the signs of the quaternions; that of turns by φ and
    /// −φ about each of three axes is the middle.
    #[test]
    fn the_mean_of_rotations_is_their_middle() {
        let (a, b) =
            (UnitQuaternion::from_euler_angles(0.3, 1.1, -2.0), UnitQuaternion::from_euler_angles(0.9, 0.2, -1.0));
        let minus = |turn: UnitQuaternion<f64>| UnitQuaternion::new_unchecked(-turn.into_inner());
        let half = a * UnitQuaternion::from_scaled_axis(0.5 * (a.inverse() * b).scaled_axis());
        assert!(mean_turn(&[a, b]).angle_to(&half) < 1e-7);
        assert!(mean_turn(&[a, minus(b)]).angle_to(&half) < 1e-7);
        let by = [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().flat_map(|axis| [axis, -axis]);
        let all: Vec<_> = by.map(|by| a * UnitQuaternion::from_scaled_axis(0.7 * by)).collect();
        assert!(mean_turn(&all).angle_to(&a) < 1e-7);
    }
}

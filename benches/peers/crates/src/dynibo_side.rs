//! Kernels of the crate dynibo, which reads the URDF itself: mass matrix, inverse and forward dynamics, and `chain` from its mass
//! matrix and Jacobian, which each repeat the kinematics, and the Cholesky decomposition of nalgebra. Nothing allocates in a call.
//!
//! Its gravity is fixed: 9.80665 m/s² along −z of the world. The fixed base is therefore rotated for the dynamics, and time is
//! scaled so that 9.81 m/s² become 9.80665 m/s²: q̇ by s, q̈ and τ by s². Inputs are scaled before, answers when they are shown.

use crate::{Case, time};
use dynibo::{Frame, Robot};
use nalgebra_of_dynibo::{Cholesky, DMatrix, Matrix3, Vector3};
use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;
use std::mem::replace;

/// The square of the scale s of velocities.
const SQUARE: f64 = 9.80665 / 9.81;

struct Ordered {
    q: Vec<f64>,
    qd: Vec<f64>,
    input: Vec<f64>,
    /// q̇ and the input in scaled time.
    qd_scaled: Vec<f64>,
    input_scaled: Vec<f64>,
}

pub fn run(case: &Case, seconds: f64) {
    let mut robot = Robot::from_urdf(&case.urdf).expect("dynibo reads the robot");
    let tip = robot.link_id("tip").expect("the robot has a tip");
    let n = case.hinges.len();
    assert_eq!(robot.joint_count(), n, "dynibo has another number of joints");
    let names: Vec<&str> = (0..n).map(|k| robot.joint_name(k).expect("a joint")).collect();
    // place[i]: where dynibo has joint i of carom
    let place: Vec<usize> = (case.hinges.iter())
        .map(|it| names.iter().position(|name| *name == it.name).expect("dynibo has the joint"))
        .collect();
    let ordered = |them: &[f64], scale: f64| {
        let mut out = vec![0.0; n];
        place.iter().zip(them).for_each(|(&k, x)| out[k] = scale * x);
        out
    };
    let states: Vec<Ordered> = (case.states.iter())
        .map(|it| Ordered {
            q: ordered(&it.q, 1.0),
            qd: ordered(&it.qd, 1.0),
            input: ordered(&it.input, 1.0),
            qd_scaled: ordered(&it.qd, SQUARE.sqrt()),
            input_scaled: ordered(&it.input, SQUARE),
        })
        .collect();
    let mut k = 0;
    let mut next = || {
        k = (k + 1) % states.len();
        &states[(k + states.len() - 1) % states.len()]
    };
    let show = |shown: &mut Vec<f64>, them: &[f64], scale: f64| shown.extend(place.iter().map(|&k| them[k] / scale));
    // The rotation takes the y axis of the robot to the z axis of the world.
    let mut standing = robot.fork();
    standing.set_base_frame(Frame::rotation(FRAC_PI_2 * Vector3::x())).expect("a rotation");

    let mut m = DMatrix::zeros(n, n);
    let mut jacobian = DMatrix::zeros(6, n);
    let (mut solved, mut h, mut after) = (DMatrix::zeros(n, 3), Matrix3::zeros(), vec![0.0; n]);
    let normal = Vector3::new(-1.0, 0.0, 0.0);
    time("dynibo", "chain", &case.states, seconds, |_, shown| {
        let Ordered { q, qd, .. } = next();
        robot.mass_matrix(q, m.as_mut_slice()).expect("M");
        robot.jacobian(q, tip, jacobian.as_mut_slice()).expect("J");
        // The last three of its six rows are the velocity of the tip.
        let of_tip = jacobian.fixed_rows::<3>(3);
        of_tip.transpose_to(&mut solved);
        // Cholesky owns its matrix, whose memory is taken back afterwards.
        let factors = Cholesky::new(replace(&mut m, DMatrix::zeros(0, 0))).expect("M is positive definite");
        factors.solve_mut(&mut solved);
        m = factors.unpack_dirty();
        of_tip.mul_to(&solved, &mut h);
        let approach: f64 = of_tip.column_iter().zip(qd).map(|(column, rate)| normal.dot(&column) * rate).sum();
        let impulse = normal * (-1.35 * approach / normal.dot(&(h * normal)));
        for (k, after) in after.iter_mut().enumerate() {
            *after = qd[k] + solved.row(k).transpose().dot(&impulse);
        }
        black_box(&mut after);
        if let Some(shown) = shown {
            show(shown, &after, 1.0);
            shown.extend([h[(0, 0)], h[(0, 1)], h[(1, 1)]]);
        }
    });
    time("dynibo", "mass", &case.states, seconds, |_, shown| {
        let Ordered { q, input, .. } = next();
        robot.mass_matrix(q, m.as_mut_slice()).expect("M");
        black_box(&mut m);
        if let Some(shown) = shown {
            let product: Vec<f64> = m.column_iter().map(|it| it.iter().zip(input).map(|(m, x)| m * x).sum()).collect();
            show(shown, &product, 1.0);
        }
    });
    let mut answer = vec![0.0; n];
    time("dynibo", "inverse", &case.states, seconds, |_, shown| {
        let Ordered { q, qd_scaled, input_scaled, .. } = next();
        standing.inverse_dynamics(q, qd_scaled, input_scaled, &[], &mut answer).expect("torques");
        black_box(&mut answer);
        if let Some(shown) = shown {
            show(shown, &answer, SQUARE);
        }
    });
    time("dynibo", "forward", &case.states, seconds, |_, shown| {
        let Ordered { q, qd_scaled, input_scaled, .. } = next();
        standing.forward_dynamics(q, qd_scaled, input_scaled, &[], &mut answer).expect("accelerations");
        black_box(&mut answer);
        if let Some(shown) = shown {
            show(shown, &answer, SQUARE);
        }
    });
}

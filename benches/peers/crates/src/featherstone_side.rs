//! Kernels of the crate featherstone: mass matrix, inverse and forward dynamics, in f32, its only scalar type. All three allocate
//! their results and their intermediate data.
//!
//! In 0.1.0 a joint transform maps vectors to the axes of the child by the rotation +q, so its dynamics are those of joints
//! rotated by −q: it is given −q, with q̇, q̈ and τ unchanged, and then agrees. Its forward kinematics composes the same
//! transforms as if they were poses, so its Jacobian is wrong for both signs (observed on planar2), and `chain` is left out.

use crate::{Case, time};
use featherstone::aba::aba_forward_dynamics;
use featherstone::body::ArticulatedBody;
use featherstone::crba::crba_mass_matrix;
use featherstone::joint::GenJoint;
use featherstone::rnea::rnea_inverse_dynamics;
use featherstone::spatial::{SpatialInertia, SpatialTransform};
use nalgebra::{DVector, Matrix3, Vector3};
use std::hint::black_box;

fn vector(v: [f64; 3]) -> Vector3<f32> {
    Vector3::from(v.map(|x| x as f32))
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f32> {
    Matrix3::from_fn(|i, j| rows[i][j] as f32)
}

pub fn run(case: &Case, seconds: f64) {
    let mut body = ArticulatedBody::new();
    body.set_gravity(Vector3::new(0.0, -9.81, 0.0));
    for (i, it) in case.hinges.iter().enumerate() {
        let turn = matrix(it.turn).transpose();
        // The translation of the transform is in the axes of the child.
        let place = SpatialTransform::from_rotation_translation(turn, turn * vector(it.shift));
        let inertia = SpatialInertia::from_mass_inertia(it.mass as f32, vector(it.centre), matrix(it.inertia));
        let parent = it.parent.map_or(-1, |p| p as i32);
        body.add_body(format!("link{i}"), parent, GenJoint::Revolute { axis: vector(it.axis) }, inertia, place);
    }
    let single = |them: &[f64], sign: f32| DVector::from_iterator(them.len(), them.iter().map(|x| sign * *x as f32));
    let states: Vec<[DVector<f32>; 3]> =
        case.states.iter().map(|it| [single(&it.q, -1.0), single(&it.qd, 1.0), single(&it.input, 1.0)]).collect();
    let mut k = 0;
    let mut next = || {
        k = (k + 1) % states.len();
        &states[(k + states.len() - 1) % states.len()]
    };
    let show = |shown: Option<&mut Vec<f64>>, them: &DVector<f32>| {
        if let Some(shown) = shown {
            shown.extend(them.iter().map(|&x| f64::from(x)));
        }
    };
    time("featherstone", "mass", &case.states, seconds, |_, shown| {
        let [q, _, input] = next();
        body.q.copy_from(q);
        let m = black_box(crba_mass_matrix(black_box(&body)));
        if shown.is_some() {
            show(shown, &(m * input));
        }
    });
    time("featherstone", "inverse", &case.states, seconds, |_, shown| {
        let [q, qd, input] = next();
        body.q.copy_from(q);
        body.qd.copy_from(qd);
        body.qdd.copy_from(input);
        let (tau, _) = black_box(rnea_inverse_dynamics(black_box(&body)));
        show(shown, &tau);
    });
    time("featherstone", "forward", &case.states, seconds, |_, shown| {
        let [q, qd, input] = next();
        body.q.copy_from(q);
        body.qd.copy_from(qd);
        body.tau.copy_from(input);
        show(shown, black_box(aba_forward_dynamics(black_box(&mut body))));
    });
}

//! The kernel `chain` with the multibodies of rapier. M, inverse and forward dynamics are not public. Public are the Jacobians of
//! the bodies (`forward_kinematics`, `body_jacobian`) and the LU factors of M (`inv_augmented_mass`), which only
//! `dof_inverse_inertia` updates: it repeats the kinematics, assembles Coriolis terms beside M, factors both and solves for every
//! joint. The time is that of these public functions, which is more than the chain needs.

use crate::{Case, State, time};
use rapier3d_f64::na::{DMatrix, Matrix3, Vector3};
use rapier3d_f64::prelude::*;
use std::hint::black_box;

fn vector(v: [f64; 3]) -> Vector {
    Vector::new(v[0], v[1], v[2])
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix {
    Matrix::from_cols(vector(rows[0]), vector(rows[1]), vector(rows[2])).transpose()
}

pub fn run(case: &Case, seconds: f64) {
    let mut world = PhysicsWorld::default();
    let base = world.insert_body(RigidBodyBuilder::fixed());
    let (mut bodies, mut joint) = (Vec::new(), None);
    for it in &case.hinges {
        let properties = MassProperties::with_inertia_matrix(vector(it.centre), it.mass, matrix(it.inertia));
        let body = world.insert_body(RigidBodyBuilder::dynamic().additional_mass_properties(properties));
        // Joints rotate about the x axis of their frames.
        let axis = Rotation::from_rotation_arc(Vector::X, vector(it.axis));
        let turned = Rotation::from_mat3(&matrix(it.turn));
        let hinge = GenericJointBuilder::new(JointAxesMask::LOCKED_REVOLUTE_AXES)
            .local_frame1(Pose::from_parts(vector(it.shift), turned * axis))
            .local_frame2(Pose::from_parts(Vector::ZERO, axis));
        joint = world.insert_multibody_joint(it.parent.map_or(base, |p| bodies[p]), body, hinge);
        bodies.push(body);
    }
    let (link, tip) = case.tip;
    let (Some(joint), Some(&last)) = (joint, bodies.get(link)) else { return };
    let Some(id) = world.multibody_joints.rigid_body_link(last).map(|it| it.id) else { return };
    let arm = vector(tip) - vector(case.hinges[link].centre);
    // Otherwise the mass of a body is set in the first step of the world.
    world.bodies.iter_mut().for_each(|(_, body)| body.recompute_mass_properties_from_colliders(&world.colliders));
    let bodies = &mut world.bodies;
    let Some((tree, _)) = world.multibody_joints.get_mut(joint) else { return };
    tree.forward_kinematics(bodies, true);
    tree.damping_mut().fill(0.0);
    let n = tree.ndofs();
    assert_eq!(n, case.hinges.len(), "rapier has another number of joints");

    let mut now = vec![0.0; n];
    let mut step = vec![0.0; n];
    let (mut solved, mut after) = (DMatrix::zeros(n, 3), vec![0.0; n]);
    let (mut jacobian, mut h) = (DMatrix::zeros(3, n), Matrix3::zeros());
    let normal = Vector3::new(-1.0, 0.0, 0.0);
    time("rapier", "chain", &case.states, seconds, |State { q, qd, .. }, shown| {
        for ((step, now), q) in step.iter_mut().zip(&mut now).zip(q) {
            *step = q - *now;
            *now = *q;
        }
        tree.apply_displacements(&step);
        tree.forward_kinematics(bodies, false);
        tree.update_rigid_bodies(bodies, true);
        black_box(tree.dof_inverse_inertia(bodies));
        // rows: velocity of the centre of mass, then the angular one
        let of_body = tree.body_jacobian(id);
        let r = *bodies[last].rotation() * arm;
        let r = Vector3::new(r.x, r.y, r.z);
        for k in 0..n {
            let spin: Vector3<f64> = of_body.fixed_view::<3, 1>(3, k).into();
            let velocity = of_body.fixed_view::<3, 1>(0, k) + spin.cross(&r);
            jacobian.set_column(k, &velocity);
            solved.set_row(k, &velocity.transpose());
        }
        tree.inv_augmented_mass().solve_mut(&mut solved);
        jacobian.mul_to(&solved, &mut h);
        let approach: f64 = (0..n).map(|k| normal.dot(&jacobian.column(k)) * qd[k]).sum();
        let impulse = normal * (-1.35 * approach / normal.dot(&(h * normal)));
        for k in 0..n {
            after[k] = qd[k] + solved.row(k).transpose().dot(&impulse);
        }
        black_box(&mut after);
        if let Some(shown) = shown {
            shown.extend(&after);
            shown.extend([h[(0, 0)], h[(0, 1)], h[(1, 1)]]);
        }
    });
}

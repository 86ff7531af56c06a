//! Comparison of the closed form for a few hinges in the plane with the recursion.

use crate::common::{Zoo, close, robot, unit};
use carom_chain::urdf::{JointType, LoadOptions};
use carom_chain::{Chain, ChainError, Planar, PlanarRow, uniform_chain};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// A row of random hinges with axes along ±z, random rotations about them and random links.
fn row(hinges: usize, rng: &mut fastrand::Rng) -> Chain<Planar<f64>> {
    let mut robot = robot(hinges, Zoo::Uncoupled, rng);
    for (k, joint) in robot.joints.iter_mut().enumerate() {
        (joint.kind, joint.parent) = (JointType::Revolute, k);
        joint.axis = if rng.bool() { Vector3::z_axis() } else { -Vector3::z_axis() };
        joint.origin.rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 3.0 * unit(rng));
    }
    Chain::from_robot(robot, &LoadOptions::default()).to_planar().unwrap().chain
}

#[test]
fn accelerations_of_the_closed_form_equal_those_of_the_recursion() {
    let mut rng = fastrand::Rng::with_seed(41);
    for round in 0..400 {
        let n = 1 + round % 4;
        let chain = row(n, &mut rng);
        let mut draw = || (0..n).map(|_| 3.0 * unit(&mut rng)).collect::<Vec<f64>>();
        let (q, qd, tau) = (draw(), draw(), draw());
        for gravity in [Vector2::zeros(), Vector2::new(2.0, -9.81)] {
            let mut qdd = vec![f64::NAN; n];
            assert!(PlanarRow::of(&chain).unwrap().accelerate(&q, &qd, &tau, gravity, &mut qdd));
            let mut workspace = chain.workspace();
            let mut kin = workspace.update(&chain, &q).unwrap();
            let other = kin.forward_dynamics(&qd, &tau, gravity).unwrap();
            // Rounding of both methods and of the angles, times the condition number of M.
            let eigenvalues = kin.mass_matrix().symmetric_eigenvalues();
            let solved = 100.0 * f64::EPSILON * eigenvalues.max() / eigenvalues.min();
            close("qdd", &qdd, other.iter(), solved, 1.0);
        }
    }
}

#[test]
fn chains_that_are_not_rows_of_at_most_four_hinges_have_no_planar_row() {
    let of = |n: usize| PlanarRow::of(&uniform_chain(n, 1.0, 1.0).unwrap().to_planar().unwrap().chain);
    assert!(of(4).is_some() && of(5).is_none());
    // Chains with sliders, branches and mimic joints.
    let mut rows = 0;
    for seed in 0..200 {
        let sample = crate::common::sample(3, Zoo::Plane, seed);
        let Ok(flat) = sample.chain.to_planar() else { continue };
        if let Some(row) = PlanarRow::of(&flat.chain) {
            let (q, zero) = (vec![0.4; flat.chain.nq()], vec![0.0; flat.chain.nv()]);
            let (mut qdd, gravity) = (zero.clone(), Vector2::new(0.0, -1.0));
            assert!(row.accelerate(&q, &zero, &zero, gravity, &mut qdd));
            let mut workspace = flat.chain.workspace();
            let other = workspace.update(&flat.chain, &q).unwrap().forward_dynamics(&zero, &zero, gravity).unwrap();
            close("qdd", &qdd, other.iter(), 1e-10, 1.0);
            rows += 1;
        }
    }
    assert!((1..100).contains(&rows), "{rows} of 200 are rows of hinges");
}

#[test]
fn joint_without_inertia_is_refused_by_closed_form_and_recursion() {
    // A point mass on the axis of the last joint.
    let mut rng = fastrand::Rng::with_seed(5);
    let mut robot = robot(3, Zoo::Plane, &mut rng);
    for (k, joint) in robot.joints.iter_mut().enumerate() {
        (joint.kind, joint.parent, joint.axis) = (JointType::Revolute, k, Vector3::z_axis());
        joint.mimic = None;
    }
    if let Some(last) = robot.links.last_mut().and_then(|link| link.inertial.as_mut()) {
        (last.com, last.inertia_at_com) = (Vector3::zeros(), nalgebra::Matrix3::zeros());
    }
    let chain = Chain::from_robot(robot, &LoadOptions::default()).to_planar().unwrap().chain;
    let (q, zero, mut qdd) = ([0.3, -0.8, 1.1], [0.0; 3], [0.0; 3]);
    assert!(!PlanarRow::of(&chain).unwrap().accelerate(&q, &zero, &zero, Vector2::zeros(), &mut qdd));
    let mut workspace = chain.workspace();
    let refused = workspace.update(&chain, &q).unwrap().forward_dynamics(&zero, &zero, Vector2::zeros());
    assert!(matches!(refused, Err(ChainError::NoInertia { .. })), "{refused:?}");
    assert!(!PlanarRow::of(&chain).unwrap().accelerate(&q[..2], &zero, &zero, Vector2::zeros(), &mut qdd), "lengths");
}

//! The wrenches that joints transmit, against other routes to the same numbers.

use crate::common::{Zoo, close, rotation, sample, vector};
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, Coordinates, FramePoint, uniform_chain_urdf};
use nalgebra::{DVector, Vector3};

/// Sᵀ w = τ − Jᵀ f for the columns S of every joint that follows no other one: the relative velocity of its links at unit rates. The
/// tolerances of sums of some dozens of terms of size one.
#[test]
fn wrenches_along_the_joints_are_the_joint_forces_of_inverse_dynamics() {
    let gravity = Vector3::new(0.3, -0.5, -9.81);
    for seed in 0..60 {
        let mut own = sample(1 + seed as usize % 9, Zoo::Uncoupled, seed);
        let (q, qd, qdd) = (own.q(), own.v(), own.v());
        let chain = own.chain.clone();
        let links: Vec<_> = chain.frames().iter().filter(|frame| frame.body.is_some()).collect();
        if links.is_empty() {
            continue;
        }
        let forces: Vec<_> = (0..3)
            .map(|_| {
                let link = links[own.rng.usize(..links.len())];
                (FramePoint::new(chain.frame(&link.name).unwrap(), vector(&mut own.rng)), 5.0 * vector(&mut own.rng))
            })
            .collect();
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(&chain, &q).unwrap();
        let mut expected = kin.inverse_dynamics(&qd, &qdd, gravity).unwrap();
        for (at, force) in &forces {
            kin.add_point_force(chain.point(at.frame, at.offset), -force, expected.as_mut_slice()).unwrap();
        }
        let wrenches = kin.joint_wrenches(&qd, &qdd, gravity, &forces).unwrap();
        for wrench in &wrenches {
            let joint = &chain.joints()[wrench.joint];
            let Coordinates::Own { v, .. } = &joint.coordinates else { unreachable!("no mimic joints in this sample") };
            // An added floating base has the world as its parent, which is no link.
            let (parent, child) = (chain.frame(&joint.parent).ok(), chain.frame(&joint.child).unwrap());
            let pose = kin.pose(child);
            for k in v.clone() {
                let mut rate = DVector::zeros(chain.nv());
                rate[k] = 1.0;
                let rate = rate.as_slice();
                let mut spin = kin.angular_velocity(child, rate).unwrap();
                let mut speed = kin.point_velocity(chain.point(child, Vector3::zeros()), rate).unwrap();
                if let Some(parent) = parent {
                    let own = kin.pose(parent);
                    let beside = own.rotation.tr_mul(&(pose.translation - own.translation));
                    spin -= kin.angular_velocity(parent, rate).unwrap();
                    speed -= kin.point_velocity(chain.point(parent, beside), rate).unwrap();
                }
                let power = spin.dot(&(pose.rotation * wrench.moment)) + speed.dot(&(pose.rotation * wrench.force));
                close("joint force", &[power], &[expected[k]], 1e-11, expected.amax().max(1.0));
            }
        }
    }
}

/// A joint that is replaced by six free coordinates needs all six numbers of its wrench as joint forces for the same motion.
#[test]
fn wrenches_are_the_joint_forces_of_a_floating_joint_in_the_same_motion() {
    let text = uniform_chain_urdf(4, 1.6, 3.0);
    let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap();
    let mut rng = fastrand::Rng::with_seed(4);
    for k in 1..=4 {
        let freed = text.replace(
            &format!("name=\"joint{k}\" type=\"continuous\""),
            &format!("name=\"joint{k}\" type=\"floating\""),
        );
        let freed = Chain::from_urdf_str(&freed, &LoadOptions::default()).unwrap();
        let q: Vec<f64> = (0..4).map(|_| 3.0 * (rng.f64() - 0.5)).collect();
        let qdd: Vec<f64> = (0..4).map(|_| rng.f64() - 0.5).collect();
        let impulse = vector(&mut rng);
        // The same state: a turn about z; the same change: the joint's rate is the last component of the angular velocity.
        let (mut q6, mut qdd6) = (q.clone(), qdd.clone());
        let turn = (0.5 * q[k - 1]).sin_cos();
        q6.splice(k - 1..k, [0.0, 0.0, 0.0, 0.0, 0.0, turn.0, turn.1]);
        qdd6.splice(k - 1..k, [0.0, 0.0, 0.0, 0.0, 0.0, qdd[k - 1]]);
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(&chain, &q).unwrap();
        let at = |chain: &Chain| FramePoint::new(chain.frame("tip").unwrap(), [0.1, 0.2, -0.3]);
        let found = kin.joint_wrenches(&[0.0; 4], &qdd, Vector3::zeros(), &[(at(&chain), impulse)]).unwrap()[k - 1];
        let mut workspace = freed.workspace();
        let mut kin = workspace.update(&freed, &q6).unwrap();
        let mut expected = kin.inverse_dynamics(&[0.0; 9], &qdd6, Vector3::zeros()).unwrap();
        let point = freed.point(at(&freed).frame, at(&freed).offset);
        kin.add_point_force(point, -impulse, expected.as_mut_slice()).unwrap();
        assert_eq!(found.joint, k - 1);
        let numbers = found.force.iter().chain(found.moment.iter());
        close("wrench", numbers, expected.rows(k - 1, 6).iter(), 1e-13, 1.0);
    }
}

/// The wrenches at the root and the impulse change the momentum of all bodies.
#[test]
fn wrenches_at_the_root_and_impulses_balance_the_momentum() {
    for seed in 0..40 {
        let mut own = sample(2 + seed as usize % 7, Zoo::All, seed);
        let (q, change) = (own.q(), own.v());
        let chain = own.chain.clone();
        let Some(link) = chain.frames().iter().rev().find(|frame| frame.body.is_some()) else { continue };
        let at = FramePoint::new(chain.frame(&link.name).unwrap(), rotation(&mut own.rng) * Vector3::x());
        let impulse = vector(&mut own.rng);
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(&chain, &q).unwrap();
        let place = kin.position(chain.point(at.frame, at.offset));
        let still = vec![0.0; chain.nv()];
        let (mut force, mut moment) = (impulse, place.cross(&impulse));
        for wrench in kin.joint_wrenches(&still, &change, Vector3::zeros(), &[(at, impulse)]).unwrap() {
            let joint = &chain.joints()[wrench.joint];
            let first = chain.bodies().iter().find(|body| body.joint_index == wrench.joint).unwrap();
            if first.parent.is_none() {
                let pose = kin.pose(chain.frame(&joint.child).unwrap());
                let own = pose.rotation * wrench.force;
                force += own;
                moment += pose.rotation * wrench.moment + pose.translation.cross(&own);
            }
        }
        let momentum = kin.momentum(&change).unwrap();
        close("momentum", force.iter(), momentum.force.iter(), 1e-12, 1.0);
        close("angular momentum", moment.iter(), momentum.moment.iter(), 1e-12, 1.0);
    }
}

/// Along the axis of a hinge or slider a joint transmits the force of its drive, less the reflected inertia of its rotor times its
/// acceleration: a joint that nothing drives, the latter with the other sign.
#[test]
fn wrenches_along_joints_with_rotors_lack_the_torque_that_turns_the_rotor() {
    let bare = uniform_chain_urdf(2, 1.0, 2.0);
    let chain =
        Chain::from_urdf_str(&bare, &LoadOptions::default()).unwrap().with_rotor_inertia("joint2", 0.3).unwrap();
    let tip = FramePoint::from(chain.frame("tip").unwrap());
    let (q, impulse) = ([0.4, -1.1], Vector3::new(0.2, -0.7, 0.0));
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(&chain, &q).unwrap();
    let mut change = DVector::zeros(2);
    kin.add_point_force(chain.point(tip.frame, tip.offset), impulse, change.as_mut_slice()).unwrap();
    let change = kin.mass_matrix().cholesky().unwrap().solve(&change);
    let wrenches = kin.joint_wrenches(&[0.0; 2], change.as_slice(), Vector3::zeros(), &[(tip, impulse)]).unwrap();
    close("moments", &[wrenches[0].moment.z, wrenches[1].moment.z], &[0.0, -0.3 * change[1]], 1e-13, 0.1);
    assert!(change[1].abs() > 0.1);
}

//! The axes of bodies on hinges are rotated when a chain is made. Nothing that is measured in link or world axes depends on
//! them: poses and energies are computed here from the joints and inertias of the file, in the file's axes.
//!
//! Tolerances: some dozen operations for each of up to 12 joints.

use crate::common::{Sample, Zoo, close, robot};
use carom_chain::algebra::z_onto;
use carom_chain::urdf::{JointType, LoadOptions, Robot};
use carom_chain::{Chain, Coordinates};
use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

/// Pose of every link, by the transforms of the joints one after another.
fn poses_of_the_file(robot: &Robot, chain: &Chain, q: &[f64]) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity(); robot.links.len()];
    for (joint, info) in robot.joints.iter().zip(chain.joints()) {
        let at = match &info.coordinates {
            Coordinates::Own { q: own, .. } => q[own.clone()].to_vec(),
            Coordinates::Follows { multiplier, offset, joint } => {
                let Coordinates::Own { q: own, .. } = &chain.joint(joint).unwrap().coordinates else { unreachable!() };
                vec![multiplier * q[own.start] + offset]
            }
            Coordinates::None => vec![],
        };
        let turned = |angle| {
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&joint.axis, angle))
        };
        let moved = match joint.kind {
            JointType::Fixed => Isometry3::identity(),
            JointType::Revolute | JointType::Continuous => turned(at[0]),
            JointType::Prismatic => Translation3::from(joint.axis.into_inner() * at[0]).into(),
            JointType::Planar => {
                let onto = z_onto(joint.axis.into_inner());
                Translation3::from(onto.column(0) * at[0] + onto.column(1) * at[1]) * turned(at[2])
            }
            JointType::Floating => Isometry3::from_parts(
                Translation3::new(at[0], at[1], at[2]),
                Unit::new_normalize(Quaternion::new(at[6], at[3], at[4], at[5])),
            ),
        };
        poses[joint.child] = poses[joint.parent] * joint.origin * moved;
    }
    poses
}

fn agrees(robot: Robot, rng: fastrand::Rng) {
    let chain = Chain::from_robot(robot.clone(), &LoadOptions::default());
    let mut s = Sample { chain, rng };
    let (q, qd, gravity) = (s.q(), s.v(), s.vector() * 10.0);
    let poses = poses_of_the_file(&robot, &s.chain, &q);
    let mut ws = s.chain.workspace();
    let mut kin = ws.update(&s.chain, &q).unwrap();
    let (mut kinetic, mut potential) = (0.0, 0.0);
    for ((link, pose), frame) in robot.links.iter().zip(&poses).zip(s.chain.frames()) {
        let id = s.chain.frame(&link.name).unwrap();
        let own = kin.pose(id);
        close("rotation", own.rotation.iter(), pose.rotation.to_rotation_matrix().matrix().iter(), 1e-13, 1.0);
        close("translation", own.translation.iter(), pose.translation.vector.iter(), 1e-13, 1.0);
        let Some(inertial) = link.inertial.filter(|_| frame.body.is_some()) else { continue };
        let com = s.chain.point(id, inertial.com);
        let (v, spin) = (kin.point_velocity(com, &qd).unwrap(), kin.angular_velocity(id, &qd).unwrap());
        let spin = pose.rotation.inverse() * spin;
        kinetic += 0.5 * (inertial.mass * v.norm_squared() + spin.dot(&(inertial.inertia_at_com * spin)));
        potential -= inertial.mass * gravity.dot(&(pose * nalgebra::Point3::from(inertial.com)).coords);
    }
    close("T", [kin.kinetic_energy(&qd).unwrap()].iter(), [kinetic].iter(), 1e-12, 1.0);
    close("V", [kin.potential_energy(gravity)].iter(), [potential].iter(), 1e-12, 100.0);
}

#[test]
fn poses_and_energies_are_those_of_the_files_joints_and_inertias() {
    for seed in 0..400 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let robot = robot(1 + seed as usize % 12, Zoo::All, &mut rng);
        agrees(robot, rng);
    }
}

#[test]
fn poses_and_energies_are_those_of_the_file_for_trees_of_hinges_with_parallel_and_opposite_axes() {
    for seed in 0..200 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut robot = robot(8, Zoo::Uncoupled, &mut rng);
        for joint in &mut robot.joints {
            (joint.kind, joint.axis) = (JointType::Revolute, Vector3::z_axis());
            let tilt = [0.0, 1e-9, 0.7, std::f64::consts::PI][rng.usize(0..4)];
            let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
            let ends =
                [0, 1].map(|_| about(Vector3::z_axis(), [0.0, std::f64::consts::PI, rng.f64()][rng.usize(0..3)]));
            joint.origin.rotation = ends[0] * about(Vector3::x_axis(), tilt) * ends[1];
        }
        agrees(robot, rng);
    }
}

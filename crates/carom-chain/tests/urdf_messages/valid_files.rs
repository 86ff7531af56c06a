//! Results of the reader for valid files.

use crate::urdf_messages::texts::*;
use carom_chain::urdf::{JointType, LoadReport, Shape};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

#[test]
fn valid_robot_is_read_with_all_its_values() {
    let robot = read(
        r#"<?xml version="1.0"?>
        <robot name="arm &amp; hand">
          <joint name="elbow" type="revolute">
            <axis xyz="0 0 1"/>
            <child link="hand"/>
            <parent link="arm"/>
            <origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>
            <limit lower="-1" upper="2" effort="3" velocity="4"/>
            <dynamics damping="0.5" friction="0.25"/>
          </joint>
          <link name="hand">
            <collision name="palm">
              <geometry><capsule radius="0.1" length="0.2"/></geometry>
              <origin xyz="0 0 0.5"/>
            </collision>
            <inertial>
              <mass value="2"/>
              <inertia ixx="1" ixy="0.1" ixz="0.2" iyy="1.5" iyz="0.3" izz="2"/>
              <origin xyz="0.1 0.2 0.3"/>
            </inertial>
            <collision><geometry><box size="1 2 3"/></geometry></collision>
          </link>
          <link name="arm"/>
          <link name="tip"/>
          <joint name="a_tip" type="fixed"><parent link="hand"/><child link="tip"/></joint>
        </robot>"#,
    )
    .unwrap();
    assert_eq!(robot.report, LoadReport::default(), "<dynamics> is used by simulations");
    assert_eq!(robot.name, "arm & hand");
    assert_eq!(robot.links.iter().map(|link| link.name.as_str()).collect::<Vec<_>>(), ["hand", "arm", "tip"]);
    assert_eq!(robot.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>(), ["elbow", "a_tip"]);
    assert_eq!(robot.root, 1);

    let elbow = &robot.joints[0];
    assert_eq!((elbow.kind, elbow.parent, elbow.child), (JointType::Revolute, 1, 0));
    assert_eq!((elbow.damping, elbow.friction, elbow.mimic), (0.5, 0.25, None));
    assert_eq!(elbow.axis, Vector3::z_axis());
    assert_eq!(elbow.origin.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(robot.joints[1].origin, nalgebra::Isometry3::identity());
    assert_eq!(robot.joints[1].axis, Vector3::x_axis());

    let hand = &robot.links[0];
    let inertial = hand.inertial.unwrap();
    assert_eq!((inertial.mass, inertial.com), (2.0, Vector3::new(0.1, 0.2, 0.3)));
    assert_eq!(inertial.inertia_at_com, Matrix3::new(1.0, 0.1, 0.2, 0.1, 1.5, 0.3, 0.2, 0.3, 2.0));
    assert_eq!(hand.collisions[0].name.as_deref(), Some("palm"));
    assert_eq!(hand.collisions[0].shape, Shape::Capsule { radius: 0.1, length: 0.2 });
    assert_eq!(hand.collisions[0].origin.translation.vector, Vector3::new(0.0, 0.0, 0.5));
    assert_eq!(hand.collisions[1].shape, Shape::Box { size: Vector3::new(1.0, 2.0, 3.0) });
    assert_eq!((robot.links[1].inertial, robot.links[1].collisions.len()), (None, 0));
}

#[test]
fn roll_pitch_yaw_are_about_fixed_axes_x_y_z() {
    let (r, p, y) = (0.3, -0.7, 1.9);
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let by_hand = about(Vector3::z_axis(), y) * about(Vector3::y_axis(), p) * about(Vector3::x_axis(), r);
    let read_one = |inside: &str| read(&joint("fixed", inside)).unwrap();
    let origin = read_one(&format!("<origin rpy='{r} {p} {y}'/>")).joints[0].origin;
    assert!(origin.rotation.angle_to(&UnitQuaternion::from_rotation_matrix(&by_hand)) < 1e-14);

    let principal = Vector3::new(1.0, 2.0, 2.5);
    let text = on_b(
        &inertial("1", "1 2 2.5 0").replace("<mass", &format!("<origin rpy='{r} {p} {y}' xyz='1 0 0'/><mass")),
        "continuous",
    );
    let inertial = read(&text).unwrap().links[1].inertial.unwrap();
    let expected = by_hand * Matrix3::from_diagonal(&principal) * by_hand.transpose();
    assert!((inertial.inertia_at_com - expected).amax() < 1e-14);
    assert_eq!(inertial.inertia_at_com, inertial.inertia_at_com.transpose());
    assert_eq!(inertial.com, Vector3::x(), "the centre of mass is given in link axes");
}

//! Warnings of numbers in other units than those of URDF, and of joints without an axis.

use crate::urdf_messages::texts::*;

/// An arm of two links of 2 and 1 kg, with these origins, limits, rotation of the collision and moment of inertia.
fn arm(length: &str, limits: &str, rpy: &str, moment: &str) -> String {
    let [lower, upper] = limits.split(' ').collect::<Vec<_>>()[..] else { panic!("{limits}") };
    let link = |name: &str, mass: &str| {
        format!(
            "<link name='{name}'><inertial><origin xyz='{length} 0 0'/><mass value='{mass}'/>
            <inertia ixx='{moment}' iyy='{moment}' izz='{moment}' ixy='0' ixz='0' iyz='0'/></inertial>
            <collision><origin rpy='0 {rpy} 0'/><geometry><sphere radius='0.02'/></geometry></collision></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, at: &str| {
        format!(
            "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 1 0'/>
            <origin xyz='{at} 0 0'/><limit lower='{lower}' upper='{upper}' effort='1' velocity='1'/></joint>"
        )
    };
    robot(&format!(
        "<link name='a'/>{}{}{}{}",
        link("b", "2"),
        link("c", "1"),
        joint("j", "a", "b", "1000"),
        joint("k", "b", "c", length)
    ))
}

#[test]
fn lengths_angles_and_moments_in_si_units_are_no_warnings() {
    for text in [
        arm("0.5", "-3 3", "1.5708", "0.01"),
        // what published robots have: limits that stand for none, more than one turn, a mass that stands for none
        arm("0.5", "-10 10", "-4.71239", "0.01"),
        arm("0.5", "-9.42 9.42", "6.2832", "1.5"),
        arm("0.5", "-1e16 1e16", "0", "0.01"),
        arm("0.5", "-1000 1000", "0", "0.01"),
        arm("0.5", "0 15.7", "0", "0.01").replace("mass value='1'", "mass value='1e-6'"),
        arm("99", "-3 3", "0", "1000"),
    ] {
        warned_texts(&[(text, &[])]);
    }
}

#[test]
fn angles_in_degrees_are_warned_of() {
    strictly_refused_texts(&[
        (
            arm("0.5", "-170 170", "1.5708", "0.01"),
            &[
                "joint 'j' <limit> (line 6): -170 … 170 is more than two turns: limits are in rad; -170° … 170° are -2.96706 … 2.96706 rad (the first of 2 such joints)",
            ],
        ),
        (
            arm("0.5", "-3 3", "90", "0.01"),
            &[
                "link 'b' <origin rpy> (line 3): 90 is more than a turn: angles are in rad; 90° are 1.5708 rad (the first of 2 such origins)",
            ],
        ),
        (
            arm("0.5", "0 22.5", "0", "0.01").replace("22.5", "2").replacen("upper='2'", "upper='22.5'", 1),
            &[
                "joint 'j' <limit> (line 6): 0 … 22.5 is more than two turns: limits are in rad; 0° … 22.5° are 0 … 0.392699 rad",
            ],
        ),
    ]);
}

/// The place of the first joint in the world may be far.
#[test]
fn lengths_in_millimetres_are_warned_of_in_links_that_move() {
    strictly_refused_texts(&[(
        arm("500", "-3 3", "0", "0.01"),
        &[
            "joint 'k' <origin xyz> (line 7): lies 500 m from the origin of the link: lengths are in m; 1 mm is 0.001 m (the greatest of 3 such lengths)",
        ],
    )]);
}

/// A radius of gyration of ten times the size of the robot, here its reach of 1 m, is the bound: 100 kg m² for 1 kg.
#[test]
fn moments_far_beyond_the_size_of_the_robot_are_warned_of() {
    warned_texts(&[(arm("0.5", "-3 3", "0", "99"), &[])]);
    strictly_refused_texts(&[
        (
            arm("0.5", "-3 3", "0", "15000"),
            &[
                "link 'b' <inertia> (line 2): a principal moment of 15000 kg m² is that of 2 kg at a distance of 86.6025 m, but the robot has a size of 1 m: moments are in kg m²; 1 kg mm² is 1e-6 kg m² (the greatest of 2 such links)",
            ],
        ),
        (
            arm("0.5", "-3 3", "0", "101"),
            &[
                "link 'c' <inertia> (line 4): a principal moment of 101 kg m² is that of 1 kg at a distance of 10.0499 m, but the robot has a size of 1 m: moments are in kg m²; 1 kg mm² is 1e-6 kg m²",
            ],
        ),
    ]);
    // a link of the size of a ship
    warned_texts(&[(arm("0.5", "-3 3", "0", "101").replace("radius='0.02'", "radius='50'"), &[])]);
}

#[test]
fn joints_without_an_axis_are_warned_of_unless_they_need_none() {
    let joint =
        |kind: &str| joined(&format!("<joint name='j' type='{kind}'><parent link='a'/><child link='b'/></joint>"));
    for kind in ["continuous", "planar"] {
        let text = format!(
            "joint 'j' (line 1): a {kind} joint without <axis> has the axis 1 0 0, as URDF says; give its <axis xyz>"
        );
        strictly_refused_texts(&[(joint(kind), &[&text])]);
        assert_eq!(read(&joint(kind)).unwrap().joints[0].axis, nalgebra::Vector3::x_axis());
    }
    warned_texts(&[(joint("fixed"), &[]), (joint("floating"), &[])]);
}

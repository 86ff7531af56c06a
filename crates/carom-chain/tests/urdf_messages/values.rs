//! Messages about values: numbers, axes, limits, inertias, mimic joints.

use crate::urdf_messages::texts::*;
use carom_chain::urdf::{self, LoadOptions};

#[test]
fn invalid_numbers_are_refused() {
    refused(
        r#"
        joint fixed: <origin xyz='0 0 1,5'/>
            <string>:1: joint 'j' <origin xyz>: "0 0 1,5" is wrong: '1,5' is not a number; write numbers with a decimal point, separated by spaces
        joint fixed: <origin rpy='0 nan 0'/>
            <string>:1: joint 'j' <origin rpy>: "0 nan 0" is wrong: 'nan' is not a finite number up to 1e100
        joint fixed: <origin rpy='0 0 1e300'/>
            <string>:1: joint 'j' <origin rpy>: "0 0 1e300" is wrong: '1e300' is not a finite number up to 1e100
        joint fixed: <origin quat_xyzw='0 0 0 1'/>
            <string>:1: joint 'j' <origin quat_xyzw>: quaternions are not supported: give the rotation as rpy
        moving heavy: 1 1 1 0
            <string>:1: link 'b' <mass value>: "heavy" is wrong: 'heavy' is not a number; write numbers with a decimal point, separated by spaces
        moving inf: 1 1 1 0
            <string>:1: link 'b' <mass value>: "inf" is wrong: 'inf' is not a finite number up to 1e100
        moving 1: 1 x 1 0
            <string>:1: link 'b' <inertia iyy>: "x" is wrong: 'x' is not a number; write numbers with a decimal point, separated by spaces
        moving 1: 1 1 1 NaN
            <string>:1: link 'b' <inertia ixy>: "NaN" is wrong: 'NaN' is not a finite number up to 1e100
        joint revolute: <limit lower='-pi'/>
            <string>:1: joint 'j' <limit lower>: "-pi" is wrong: '-pi' is not a number; write numbers with a decimal point, separated by spaces
        joint revolute: <limit upper='inf'/>
            <string>:1: joint 'j' <limit upper>: "inf" is wrong: 'inf' is not a finite number up to 1e100; for no limit, omit the attribute (lower and upper together: one alone has the other at 0)
        joint revolute: <limit effort='-1'/>
            <string>:1: joint 'j' <limit effort>: "-1" is wrong: -1 must not be negative
        joint revolute: <limit velocity='-0.5'/>
            <string>:1: joint 'j' <limit velocity>: "-0.5" is wrong: -0.5 must not be negative
        joint revolute: <dynamics damping='-0.1'/>
            <string>:1: joint 'j' <dynamics damping>: "-0.1" is wrong: -0.1 must not be negative
        joint revolute: <dynamics friction='-2'/>
            <string>:1: joint 'j' <dynamics friction>: "-2" is wrong: -2 must not be negative
        joint revolute: <mimic joint='k' multiplier='two'/>
            <string>:1: joint 'j' <mimic multiplier>: "two" is wrong: 'two' is not a number; write numbers with a decimal point, separated by spaces
        joint revolute: <limit effort='1 2'/>
            <string>:1: joint 'j' <limit effort>: "1 2" contains 2 numbers, 1 is needed
        moving 1 2: 1 1 1 0
            <string>:1: link 'b' <mass value>: "1 2" contains 2 numbers, 1 is needed
        shape: <box size='1 1'/>
            <string>:1: link 'a' <box size>: "1 1" contains 2 numbers, 3 are needed
        shape: <box/>
            <string>:1: link 'a' <box>: the attribute size is missing: add it
        shape: <sphere radius='-1'/>
            <string>:1: link 'a' <sphere radius>: "-1" is wrong: -1 must not be negative
        shape: <sphere radius='1'/><sphere radius='1'/>
            <string>:1: link 'a' <geometry>: contains 2 shapes, at most one is allowed: <box>, <sphere>, <cylinder>, <capsule>, <mesh>
    "#,
    );
}

#[test]
fn invalid_axes_and_limits_are_refused_or_warned_of() {
    refused(
        r"
        joint continuous: <axis xyz='0 0 0'/>
            <string>:1: joint 'j' <axis xyz>: has length 0: the axis of a continuous joint must be a unit vector
        joint planar: <axis xyz='0 0 0'/>
            <string>:1: joint 'j' <axis xyz>: has length 0: the axis of a planar joint must be a unit vector
    ",
    );
    warned(
        r"
        joint continuous: <axis xyz='0 3 4'/>
            joint 'j' <axis> (line 1): has length 5, normalised to 1
        joint continuous: <axis xyz='0 0.6000001 0.8'/>
        joint revolute:
            joint 'j' (line 1): a revolute joint should have a <limit>; read as without limits
        joint revolute: <limit effort='1' velocity='1'/>
            joint 'j' <limit> (line 1): lower and upper are missing; read as without position limits
        joint prismatic: <limit upper='2' effort='1' velocity='1'/>
            joint 'j' <limit> (line 1): lower is missing; read as 0, its default in URDF
        joint prismatic: <limit lower='-2' effort='1' velocity='1'/>
            joint 'j' <limit> (line 1): upper is missing; read as 0, its default in URDF
        joint continuous: <limit lower='1' upper='-1' velocity='3'/>
            position <limit> of a continuous joint (line 1) is not used
        joint fixed: <axis xyz='0 0 0'/><limit lower='1' upper='-1'/><dynamics damping='1'/>
            <axis> of a fixed joint (line 1) is not used
            <dynamics> of a fixed joint (line 1) is not used
            <limit> of a fixed joint (line 1) is not used
        star: fixed <axis xyz='1 0 0'/> | fixed <axis xyz='1 0 0'/>
            <axis> of a fixed joint (2 times, first on line 2) is not used
    ",
    );
}

#[test]
fn limits_are_read_by_joint_type_and_urdf_version() {
    let limits = |kind, inside| {
        let limits = read(&joint(kind, inside)).unwrap().joints[0].limits;
        [limits.lower, limits.upper, limits.velocity, limits.effort]
    };
    let all = "<limit lower='-1' upper=' 2 ' velocity='3' effort='4'/>";
    assert_eq!(limits("revolute", all), [Some(-1.0), Some(2.0), Some(3.0), Some(4.0)]);
    assert_eq!(limits("continuous", all), [None, None, Some(3.0), Some(4.0)]);
    assert_eq!(limits("fixed", all), [None; 4]);
    assert_eq!(limits("floating", all), [None; 4]);
    assert_eq!(limits("revolute", ""), [None; 4]);
    assert_eq!(limits("revolute", "<limit lower='-1' upper='2'/>"), [Some(-1.0), Some(2.0), None, None]);
    assert_eq!(limits("revolute", "<limit upper='2'/>"), [Some(0.0), Some(2.0), None, None]);
    // from version 1.2 a missing limit means no limit
    let open = joint("revolute", "<limit upper='-2'/>").replace("<robot", "<robot version='1.2'");
    assert_eq!(read(&open).unwrap().joints[0].limits.lower, None);
}

#[test]
fn negative_masses_and_moments_are_refused_on_moving_links() {
    refused(
        r"
        moving -1: 1 1 1 0
            <string>:1: link 'b' <mass value>: -1 kg is negative: the mass of a body must be positive
        moving 1: 1 1 1 2
            <string>:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest possible ones: --repair (LoadOptions::repair)
        moving 1: -1 -1 -1 0
            <string>:1: link 'b' <inertia>: principal moments -1, -1 and -1 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest possible ones: --repair (LoadOptions::repair)
        moving 0: -1 1 1 0
            <string>:1: link 'b' <inertia>: principal moments -1, 1 and 1 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest possible ones: --repair (LoadOptions::repair)
    ",
    );
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let error = urdf::read_str(&on_b(&inertial("-1", "1 1 1 0"), "fixed"), None, &floating).unwrap_err();
    assert_eq!(
        error.to_string(),
        "<string>:1: link 'b' <mass value>: -1 kg is negative: the mass of a body must be positive"
    );
}

#[test]
fn mimic_joints_are_resolved_or_refused() {
    let follow = |joint: &str| format!("<mimic joint='{joint}'/>");
    refused(
        r"
        star: continuous | continuous <mimic joint='j00'/>
            <string>:3: joint 'j1' <mimic joint>: no joint is named 'j00': did you mean 'j0'?
        star: continuous | continuous <mimic joint='elbow'/>
            <string>:3: joint 'j1' <mimic joint>: no joint is named 'elbow': there are 'j0' and 'j1'
        star: continuous <mimic joint='j0'/>
            <string>:2: joint 'j0' <mimic joint>: a joint cannot mimic itself: name another joint, or remove <mimic>
        star: continuous <mimic joint='j1'/> | continuous <mimic joint='j2'/> | continuous <mimic joint='j1'/>
            <string>:3: joint 'j1' <mimic joint>: joints 'j1' and 'j2' mimic each other in a loop: remove one <mimic>
        star: fixed | continuous <mimic joint='j0'/>
            <string>:3: joint 'j1' <mimic joint>: joint 'j0' is fixed and cannot be mimicked: only revolute, continuous and prismatic joints can
        star: continuous | planar <mimic joint='j0'/>
            <string>:3: joint 'j1' <mimic joint>: joint 'j1' is planar and cannot mimic another: only revolute, continuous and prismatic joints can
        star: continuous | continuous <mimic/>
            <string>:3: joint 'j1' <mimic>: the attribute joint is missing: add it
        star: continuous | continuous <mimic joint='j0' multiplier='0'/>
            <string>:3: joint 'j1' <mimic multiplier>: is 0, so the joint never moves: make it fixed
        star: continuous | continuous <mimic joint='j0' multiplier='1e-90'/> | continuous <mimic joint='j1' multiplier='1e-90'/> | continuous <mimic joint='j2' multiplier='1e-90'/> | continuous <mimic joint='j3' multiplier='1e-90'/>
            <string>:6: joint 'j4' <mimic>: its chain of mimic joints gives multiplier 0 and offset 0, outside the range of numbers: correct the multipliers and offsets
    ",
    );

    let robot = read(&star(&[
        ("continuous", "<mimic joint='j1' multiplier='2' offset='1'/>"),
        ("continuous", "<mimic joint='j2' multiplier='-3' offset='5'/>"),
        ("continuous", ""),
        ("continuous", &follow("j2")),
    ]))
    .unwrap();
    let mimics = robot.joints.iter().map(|joint| joint.mimic.map(|m| (m.joint, m.multiplier, m.offset)));
    assert_eq!(
        mimics.collect::<Vec<_>>(),
        [Some((2, -6.0, 11.0)), Some((2, -3.0, 5.0)), None, Some((2, 1.0, 0.0))],
        "2 (-3 x + 5) + 1 = -6 x + 11"
    );
}

//! Messages about values: numbers, axes, limits, inertias, mimic joints.

use crate::texts::*;
use carom_chain::urdf::{self, LoadOptions};

#[test]
fn invalid_numbers_are_refused() {
    let origin = |text: &str| joint("fixed", &format!("<origin {text}/>"));
    refused(&[
        (origin("xyz='0 0'"), r#"<string>:1: joint 'j' <origin xyz>: "0 0" contains 2 numbers, 3 are needed"#),
        (origin("xyz=''"), r#"<string>:1: joint 'j' <origin xyz>: "" contains 0 numbers, 3 are needed"#),
        (
            origin("xyz='0 0 1,5'"),
            r#"<string>:1: joint 'j' <origin xyz>: "0 0 1,5" is wrong: '1,5' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            origin("rpy='0 nan 0'"),
            r#"<string>:1: joint 'j' <origin rpy>: "0 nan 0" is wrong: 'nan' is not a finite number up to 1e100"#,
        ),
        (
            origin("rpy='0 0 1e300'"),
            r#"<string>:1: joint 'j' <origin rpy>: "0 0 1e300" is wrong: '1e300' is not a finite number up to 1e100"#,
        ),
        (
            origin("quat_xyzw='0 0 0 1'"),
            "<string>:1: joint 'j' <origin quat_xyzw>: quaternions are not supported: give the rotation as rpy",
        ),
        (
            joint("revolute", "<axis xyz='0 0 1 0'/>"),
            r#"<string>:1: joint 'j' <axis xyz>: "0 0 1 0" contains 4 numbers, 3 are needed"#,
        ),
        (joint("revolute", "<axis/>"), "<string>:1: joint 'j' <axis>: the attribute xyz is missing: add it"),
        (
            moving("heavy", "1 1 1 0"),
            r#"<string>:1: link 'b' <mass value>: "heavy" is wrong: 'heavy' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            moving("inf", "1 1 1 0"),
            r#"<string>:1: link 'b' <mass value>: "inf" is wrong: 'inf' is not a finite number up to 1e100"#,
        ),
        (
            moving("1", "1 x 1 0"),
            r#"<string>:1: link 'b' <inertia iyy>: "x" is wrong: 'x' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            moving("1", "1 1 1 NaN"),
            r#"<string>:1: link 'b' <inertia ixy>: "NaN" is wrong: 'NaN' is not a finite number up to 1e100"#,
        ),
        (
            joint("revolute", "<limit lower='-pi'/>"),
            r#"<string>:1: joint 'j' <limit lower>: "-pi" is wrong: '-pi' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            joint("revolute", "<limit upper='inf'/>"),
            r#"<string>:1: joint 'j' <limit upper>: "inf" is wrong: 'inf' is not a finite number up to 1e100; for no limit, omit the attribute"#,
        ),
        (
            joint("revolute", "<limit effort='-1'/>"),
            r#"<string>:1: joint 'j' <limit effort>: "-1" is wrong: -1 must not be negative"#,
        ),
        (
            joint("revolute", "<limit velocity='-0.5'/>"),
            r#"<string>:1: joint 'j' <limit velocity>: "-0.5" is wrong: -0.5 must not be negative"#,
        ),
        (
            joint("revolute", "<dynamics damping='-0.1'/>"),
            r#"<string>:1: joint 'j' <dynamics damping>: "-0.1" is wrong: -0.1 must not be negative"#,
        ),
        (
            joint("revolute", "<dynamics friction='-2'/>"),
            r#"<string>:1: joint 'j' <dynamics friction>: "-2" is wrong: -2 must not be negative"#,
        ),
        (
            joint("revolute", "<mimic joint='k' multiplier='two'/>"),
            r#"<string>:1: joint 'j' <mimic multiplier>: "two" is wrong: 'two' is not a number; write numbers with a decimal point, separated by spaces"#,
        ),
        (
            joint("revolute", "<mimic joint='k' offset='1 2'/>"),
            r#"<string>:1: joint 'j' <mimic offset>: "1 2" contains 2 numbers, 1 is needed"#,
        ),
        (
            shape("<box size='1 0 1'/>"),
            r#"<string>:1: link 'a' <box size>: "1 0 1" is wrong: 0 must be greater than zero"#,
        ),
        (shape("<box/>"), "<string>:1: link 'a' <box>: the attribute size is missing: add it"),
        (
            shape("<sphere radius='-1'/>"),
            r#"<string>:1: link 'a' <sphere radius>: "-1" is wrong: -1 must be greater than zero"#,
        ),
        (
            shape("<cylinder radius='1' length='0'/>"),
            r#"<string>:1: link 'a' <cylinder length>: "0" is wrong: 0 must be greater than zero"#,
        ),
        (
            shape("<capsule radius='0' length='1'/>"),
            r#"<string>:1: link 'a' <capsule radius>: "0" is wrong: 0 must be greater than zero"#,
        ),
        (
            shape("<mesh filename='m.stl' scale='1 1 0'/>"),
            r#"<string>:1: link 'a' <mesh scale>: "1 1 0" is wrong: 0 must not be zero"#,
        ),
        (
            shape(""),
            "<string>:1: link 'a' <geometry>: contains 0 shapes, exactly one is needed: <box>, <sphere>, <cylinder>, <capsule>, <mesh>",
        ),
        (
            shape("<sphere radius='1'/><sphere radius='1'/>"),
            "<string>:1: link 'a' <geometry>: contains 2 shapes, exactly one is needed: <box>, <sphere>, <cylinder>, <capsule>, <mesh>",
        ),
    ]);
}

#[test]
fn invalid_axes_and_limits_are_refused_or_warned_of() {
    refused(&[
        (
            joint("continuous", "<axis xyz='0 0 0'/>"),
            "<string>:1: joint 'j' <axis xyz>: has length 0: the axis of a continuous joint must be a unit vector",
        ),
        (
            joint("planar", "<axis xyz='0 0 0'/>"),
            "<string>:1: joint 'j' <axis xyz>: has length 0: the axis of a planar joint must be a unit vector",
        ),
        (
            joint("prismatic", "<limit lower='2' upper='-2'/>"),
            "<string>:1: joint 'j' <limit>: lower 2 is greater than upper -2: swap or correct them",
        ),
        (
            joint("prismatic", "<limit upper='-2'/>"),
            "<string>:1: joint 'j' <limit>: lower 0 is greater than upper -2: swap or correct them",
        ),
    ]);
    warned(&[
        (joint("continuous", "<axis xyz='0 3 4'/>"), &["joint 'j' <axis> (line 1): has length 5, normalised to 1"]),
        (joint("continuous", "<axis xyz='0 0.6000001 0.8'/>"), &[]),
        (
            joint("revolute", ""),
            &["joint 'j' (line 1): a revolute joint should have a <limit>; read as without limits"],
        ),
        (
            joint("revolute", "<limit effort='1' velocity='1'/>"),
            &["joint 'j' <limit> (line 1): lower and upper are missing; read as without position limits"],
        ),
        (
            joint("prismatic", "<limit upper='2'/>"),
            &["joint 'j' <limit> (line 1): lower is missing; read as 0, its default in URDF"],
        ),
        (
            joint("prismatic", "<limit lower='-2'/>"),
            &["joint 'j' <limit> (line 1): upper is missing; read as 0, its default in URDF"],
        ),
        (
            joint("continuous", "<limit lower='1' upper='-1' velocity='3'/>"),
            &["position <limit> of a continuous joint (line 1) is not used"],
        ),
        (
            joint("fixed", "<axis xyz='0 0 0'/><limit lower='1' upper='-1'/><dynamics damping='1'/>"),
            &[
                "<axis> of a fixed joint (line 1) is not used",
                "<dynamics> of a fixed joint (line 1) is not used",
                "<limit> of a fixed joint (line 1) is not used",
            ],
        ),
        (
            star(&[("fixed", "<axis xyz='1 0 0'/>"), ("fixed", "<axis xyz='1 0 0'/>")]),
            &["<axis> of a fixed joint (2 times, first on line 2) is not used"],
        ),
    ]);
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
fn impossible_inertias_are_refused_on_moving_links() {
    refused(&[
        (
            moving("-1", "1 1 1 0"),
            "<string>:1: link 'b' <mass value>: -1 kg is negative: the mass of a body must be positive",
        ),
        (
            moving("0", "1 1 1 0"),
            "<string>:1: link 'b' <mass value>: is 0 kg, but <inertia> is not zero: give the mass of the body, or remove <inertial>",
        ),
        (
            moving("1", "1 1 1 2"),
            "<string>:1: link 'b' <inertia>: principal moments -1, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            moving("1", "-1 -1 -1 0"),
            "<string>:1: link 'b' <inertia>: principal moments -1, -1 and -1 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz",
        ),
        (
            moving("1", "0.1 0.2 0.4 0"),
            "<string>:1: link 'b' <inertia>: principal moments 0.1, 0.2 and 0.4 kg m²: 0.1 + 0.2 = 0.3 is less than 0.4, but no principal moment of a body exceeds the sum of the other two; compute the inertia again, about the centre of mass",
        ),
    ]);
    warned(&[
        (moving("1", "0.1 0.2 0.3 0"), &[]),
        (
            moving("1", "0.1 0.2 0.30001 0"),
            &[
                "link 'b' <inertial> (line 1): principal moments 0.1, 0.2 and 0.30001 kg m²: the greatest exceeds the sum of the other two by the fraction 3.3e-5 of itself, accepted as rounding",
            ],
        ),
        (
            on_b(&inertial("0", "0 0 0 0"), "fixed"),
            &["link 'b' <inertial> (line 1): mass and inertia are zero; read as without <inertial>"],
        ),
        (
            on_b(&inertial("-1", "1 1 1 0"), "fixed"),
            &[
                "link 'b' <mass> (line 1): -1 kg is negative: the mass of a body must be positive; not used, since the link never moves",
            ],
        ),
        (
            on_b(&inertial("1", "1 2 4 0"), "fixed"),
            &[
                "link 'b' <inertia> (line 1): principal moments 1, 2 and 4 kg m²: 1 + 2 = 3 is less than 4, but no principal moment of a body exceeds the sum of the other two; compute the inertia again, about the centre of mass; not used, since the link never moves",
            ],
        ),
    ]);
    let robot = read(&on_b(&inertial("-1", "1 1 1 0"), "fixed")).unwrap();
    assert_eq!(robot.links[1].inertial, None);
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let error = urdf::read_str(&on_b(&inertial("-1", "1 1 1 0"), "fixed"), None, &floating).unwrap_err();
    assert_eq!(
        error.to_string(),
        "<string>:1: link 'b' <mass value>: -1 kg is negative: the mass of a body must be positive"
    );
}

#[test]
fn moving_joint_without_mass_is_refused() {
    let chain = |kind: &str, tip: &str| {
        robot(&format!(
            "<link name='a'/><link name='b'/><link name='c'>{tip}</link>
            <joint name='j' type='{kind}'><parent link='a'/><child link='b'/></joint>
            <joint name='k' type='fixed'><parent link='b'/><child link='c'/></joint>"
        ))
    };
    for kind in ["continuous", "planar", "floating"] {
        assert!(read(&chain(kind, INERTIAL)).is_ok(), "mass of a link fixed to the moving one counts");
    }
    assert!(read(&chain("fixed", "")).is_ok());
    refused(&[
        (
            chain("continuous", ""),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
        (
            chain("floating", ""),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
        (
            chain("planar", &inertial("0", "0 0 0 0")),
            "<string>:2: joint 'j': moves link 'b', and neither it nor any link below it has mass: give link 'b' an <inertial>, or make the joint fixed",
        ),
    ]);
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let error = urdf::read_str(&chain("fixed", ""), None, &floating).unwrap_err();
    assert_eq!(
        error.to_string(),
        "<string>:1: robot 'r': no link has mass, and a floating base needs mass: give link 'a' an <inertial>"
    );
    assert!(urdf::read_str(&chain("fixed", INERTIAL), None, &floating).is_ok());
}

#[test]
fn mimic_joints_are_resolved_or_refused() {
    let follow = |joint: &str| format!("<mimic joint='{joint}'/>");
    refused(&[
        (
            star(&[("continuous", ""), ("continuous", &follow("j00"))]),
            "<string>:3: joint 'j1' <mimic joint>: no joint is named 'j00': did you mean 'j0'?",
        ),
        (
            star(&[("continuous", ""), ("continuous", &follow("elbow"))]),
            "<string>:3: joint 'j1' <mimic joint>: no joint is named 'elbow': there are 'j0' and 'j1'",
        ),
        (
            star(&[("continuous", &follow("j0"))]),
            "<string>:2: joint 'j0' <mimic joint>: a joint cannot mimic itself: name another joint, or remove <mimic>",
        ),
        (
            star(&[("continuous", &follow("j1")), ("continuous", &follow("j2")), ("continuous", &follow("j1"))]),
            "<string>:3: joint 'j1' <mimic joint>: joints 'j1' and 'j2' mimic each other in a loop: remove one <mimic>",
        ),
        (
            star(&[("fixed", ""), ("continuous", &follow("j0"))]),
            "<string>:3: joint 'j1' <mimic joint>: joint 'j0' is fixed and cannot be mimicked: only revolute, continuous and prismatic joints can",
        ),
        (
            star(&[("continuous", ""), ("planar", &follow("j0"))]),
            "<string>:3: joint 'j1' <mimic joint>: joint 'j1' is planar and cannot mimic another: only revolute, continuous and prismatic joints can",
        ),
        (
            star(&[("continuous", ""), ("continuous", "<mimic/>")]),
            "<string>:3: joint 'j1' <mimic>: the attribute joint is missing: add it",
        ),
        (
            star(&[("continuous", ""), ("continuous", "<mimic joint='j0' multiplier='0'/>")]),
            "<string>:3: joint 'j1' <mimic multiplier>: is 0, so the joint never moves: make it fixed",
        ),
        (
            star(&[
                ("continuous", ""),
                ("continuous", "<mimic joint='j0' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j1' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j2' multiplier='1e-90'/>"),
                ("continuous", "<mimic joint='j3' multiplier='1e-90'/>"),
            ]),
            "<string>:6: joint 'j4' <mimic>: its chain of mimic joints gives multiplier 0 and offset 0, outside the range of numbers: correct the multipliers and offsets",
        ),
    ]);

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

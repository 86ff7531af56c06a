//! The three classes of loading: warnings for what leaves the mathematics sound, partial service without mass, repairs.

use crate::urdf_messages::texts::*;
use carom_chain::urdf::{self, Inertial, LoadOptions, Repair};
use carom_chain::{Chain, ChainError};
use nalgebra::{Matrix3, Vector3};

fn repair() -> LoadOptions {
    LoadOptions { repair: true, ..Default::default() }
}

/// The inertia of link `b`.
fn of_b(text: &str) -> Option<Inertial> {
    read(text).unwrap().links[1].inertial
}

#[test]
fn inertias_that_no_body_has_are_warnings_if_no_moment_is_negative() {
    strictly_refused(
        r"
        moving 1: 0.1 0.2 0.30001 0
            link 'b' <inertial> (line 1): principal moments 0.1, 0.2 and 0.30001 kg m²: the greatest exceeds the sum of the other two by the fraction 3.3e-5 of itself, accepted as rounding
        moving 1: 0.1 0.2 0.4 0
            link 'b' <inertial> (line 1): principal moments 0.1, 0.2 and 0.4 kg m²: 0.1 + 0.2 = 0.3 is less than 0.4, but no principal moment of a body exceeds the sum of the other two; used as they are, since the mass matrix stays positive
        moving 2: 1 1 -1e-10 0
            link 'b' <inertial> (line 1): principal moments -1e-10, 1 and 1 kg m²: a negative one is accepted as rounding and read as 0
        moving 0: 1 1 1 0
            link 'b' <inertial> (line 1): the mass is 0 and <inertia> is not; read as rotational inertia without mass
        fixed 0: 0 0 0 0
            link 'b' <inertial> (line 1): mass and inertia are zero; read as without <inertial>
        moving 2: 0 0 -2.4e-35 0
            link 'b' <inertial> (line 1): principal moments -2.4e-35, 0 and 0 kg m²: a negative one is accepted as rounding and read as 0
    ",
    );
    warned_texts(&[(moving("1", "0.1 0.2 0.3 0"), &[])]);
    let given = of_b(&moving("1", "0.1 0.2 0.4 0")).unwrap().inertia_at_com;
    assert_eq!(given, Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.4)), "used as it is");
    assert_eq!(of_b(&moving("2", "1 1 -1e-10 0")).unwrap().inertia_at_com[(2, 2)], 0.0);
    let spin = of_b(&moving("0", "1 1 1 0")).unwrap();
    assert_eq!((spin.mass, spin.inertia_at_com), (0.0, Matrix3::identity()));
}

/// A thin plate, as a rotated matrix: its moments 1, 1 and 2 are within rounding of the triangle inequality.
#[test]
fn rounding_of_the_eigenvalues_is_no_warning() {
    let text = moving("1", "0 1 1 0").replace("<mass", "<origin rpy='0.3 0.2 0.1'/><mass");
    warned_texts(&[(text, &[]), (moving("1", "0.5 1.5 2 0.5"), &[])]);
}

#[test]
fn links_that_never_move_need_no_possible_inertia_and_their_mass_counts() {
    strictly_refused(
        r"
        fixed -1: 1 1 1 0
            link 'b' <mass> (line 1): -1 kg is negative: the mass of a body must be positive; not used, since the link never moves
        fixed 3: 1 1 1 2
            link 'b' <inertia> (line 1): principal moments -1, 1 and 3 kg m²: none may be negative; not used, since the link never moves
    ",
    );
    assert_eq!(of_b(&on_b(&inertial("-1", "1 1 1 0"), "fixed")), None);
    let kept = of_b(&on_b(&inertial("3", "1 1 1 2"), "fixed")).unwrap();
    assert_eq!((kept.mass, kept.inertia_at_com), (3.0, Matrix3::zeros()));
    let chain = Chain::from_urdf_str(&on_b(&inertial("3", "1 1 1 2"), "fixed"), &Default::default()).unwrap();
    assert_eq!(chain.total_mass(), 3.0);
}

/// A stub with moments -1, 1 and 3 on a fixed joint of a link with moments 1, 1 and 1 and of mass 1: at a distance d the body of
/// both has the moment -1 + 1 + d²/2 about one axis, by the parallel-axis theorem for two masses of 1 kg.
#[test]
fn a_negative_moment_is_a_warning_if_its_rigid_body_has_none() {
    let text = |distance: f64, kind: &str| {
        robot(&format!(
            "<link name='a'/><link name='b'>{INERTIAL}</link><link name='c'>{}</link>
            <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='1 0 0'/></joint>
            <joint name='k' type='{kind}'><parent link='b'/><child link='c'/><origin xyz='0 0 {distance}'/></joint>",
            inertial("1", "-1.5 1 3 0")
        ))
    };
    strictly_refused_texts(&[(
        text(1.1, "fixed"),
        &[
            "link 'c' <inertia> (line 1): principal moments -1.5, 1 and 3 kg m²: none may be negative; used as they are, since the rigid body of this link and the links fixed to it has none",
        ],
    )]);
    let chain = Chain::from_urdf_str(&text(1.1, "fixed"), &Default::default()).unwrap();
    let mut workspace = chain.workspace();
    let moment = workspace.update(&chain, &[0.0]).unwrap().mass_matrix()[(0, 0)];
    let exact = 1.0 - 1.5 + 1.1 * 1.1;
    assert!((moment - exact).abs() < 1e-15, "about the axis of j, through b: {moment}");
    let rule = "<string>:1: link 'c' <inertia>: principal moments -1.5, 1 and 3 kg m²: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest possible ones: --repair (LoadOptions::repair)";
    refused_texts(&[(text(0.9, "fixed"), rule), (text(1.1, "continuous"), rule)]);
}

#[test]
fn missing_and_miscounted_numbers_with_a_default_are_warnings() {
    let origin = |text: &str| joint("fixed", &format!("<origin {text}/>"));
    let without = |name: &str| moving("1", "1 1 1 0").replace(&format!(" {name}=\"0\""), "");
    strictly_refused(
        r#"
        joint fixed: <origin xyz='0 1'/>
            joint 'j' <origin xyz> (line 1): "0 1" contains 2 numbers, 3 are needed; read as 0 0 0
        joint fixed: <origin rpy=''/>
            joint 'j' <origin rpy> (line 1): "" contains 0 numbers, 3 are needed; read as 0 0 0
        joint continuous: <axis xyz='0 0 1 0'/>
            joint 'j' <axis xyz> (line 1): "0 0 1 0" contains 4 numbers, 3 are needed; read as 1 0 0
        joint continuous: <axis/>
            <axis> without xyz (line 1): read as 1 0 0
        joint continuous: <dynamics damping='1 2'/>
            joint 'j' <dynamics damping> (line 1): "1 2" contains 2 numbers, 1 is needed; read as 0
        star: continuous | continuous <mimic joint='j0' multiplier='' offset='1 2'/>
            joint 'j1' <mimic multiplier> (line 3): "" contains 0 numbers, 1 is needed; read as 1
            joint 'j1' <mimic offset> (line 3): "1 2" contains 2 numbers, 1 is needed; read as 0
        joint revolute: <limit lower='1 2' upper='3' effort='1' velocity='1'/>
            joint 'j' <limit lower> (line 1): "1 2" contains 2 numbers, 1 is needed; read as 0
        star: revolute <limit lower='-1' upper='1'/> | prismatic <limit upper='1' lower='0' effort='2'/>
            <limit> without effort (line 2): read as no limit
            <limit> without velocity (2 times, first on line 2): read as no limit
    "#,
    );
    strictly_refused_texts(&[
        (without("ixz"), &["<inertia> without ixz (line 1): read as 0"]),
        (without("iyz"), &["<inertia> without iyz (line 1): read as 0"]),
        (without("ixy"), &["<inertia> without ixy (line 1): read as 0"]),
        (
            on_b("<inertial><mass value='2'/><origin xyz='0 1 0'/></inertial>", "continuous"),
            &["<inertial> without <inertia> (line 1): read as zero: the mass is a point"],
        ),
    ]);
    let axis = |inside| read(&joint("continuous", inside)).unwrap().joints[0].axis;
    assert_eq!([axis("<axis/>"), axis("<axis xyz='0 0 1 0'/>")], [Vector3::x_axis(); 2]);
    assert_eq!(read(&origin("xyz='0 1' rpy='0'")).unwrap().joints[0].origin, nalgebra::Isometry3::identity());
    let point = of_b(&on_b("<inertial><mass value='2'/><origin xyz='0 1 0'/></inertial>", "continuous")).unwrap();
    assert_eq!((point.mass, point.com, point.inertia_at_com), (2.0, Vector3::y(), Matrix3::zeros()));
    let mimic = read(&star(&[("continuous", ""), ("continuous", "<mimic joint='j0' multiplier='' offset='1 2'/>")]));
    assert_eq!(mimic.unwrap().joints[1].mimic.map(|m| (m.multiplier, m.offset)), Some((1.0, 0.0)));
    let limits = read(&joint("revolute", "<limit lower='1 2' upper='3' effort='1'/>")).unwrap().joints[0].limits;
    assert_eq!((limits.lower, limits.upper, limits.effort, limits.velocity), (Some(0.0), Some(3.0), Some(1.0), None));
}

#[test]
fn crossed_limits_are_read_as_no_limits() {
    let both = |lower: &str| format!("<limit {lower} upper='-2' effort='3' velocity='4'/>");
    strictly_refused(
        r"
        joint prismatic: <limit lower='2' upper='-2' effort='3' velocity='4'/>
            joint 'j' <limit> (line 1): lower 2 is greater than upper -2; read as without position limits
        joint prismatic: <limit  upper='-2' effort='3' velocity='4'/>
            joint 'j' <limit> (line 1): lower is missing; read as 0, its default in URDF
            joint 'j' <limit> (line 1): lower 0 is greater than upper -2; read as without position limits
    ",
    );
    let limits = read(&joint("prismatic", &both("lower='2'"))).unwrap().joints[0].limits;
    assert_eq!([limits.lower, limits.upper, limits.effort, limits.velocity], [None, None, Some(3.0), Some(4.0)]);
}

#[test]
fn shapes_without_size_or_of_unknown_kinds_are_left_out() {
    let left_out = |name: &str| format!("link 'a' <collision> (line 1): the shape is left out, since its {name} is 0");
    for (inside, name) in [
        ("<box size='1 0 1'/>", "size"),
        ("<sphere radius='0'/>", "radius"),
        ("<cylinder radius='0' length='1'/>", "radius"),
        ("<cylinder radius='1' length='0'/>", "length"),
        ("<capsule radius='1' length='0'/>", "length"),
        ("<mesh filename='m.stl' scale='1 1 0'/>", "scale"),
    ] {
        strictly_refused_texts(&[(shape(inside), &[&left_out(name)])]);
        assert!(read(&shape(inside)).unwrap().links[0].collisions.is_empty(), "{inside}");
    }
    // the shapes beside one that is left out keep their poses
    let two = robot(
        "<link name='a'><collision name='p'><geometry><plane normal='0 0 1'/></geometry></collision>
        <collision name='q'><origin xyz='1 2 3'/><geometry><sphere radius='1'/></geometry></collision></link>",
    );
    strictly_refused_texts(&[(
        two.clone(),
        &[
            "link 'a' <collision> (line 1): the collision is left out, since it has no shape that is supported",
            "<plane> (line 1) is not used: it is unknown",
        ],
    )]);
    let collisions = read(&two).unwrap().links.remove(0).collisions;
    let kept: Vec<_> = collisions.iter().map(|it| (it.name.as_deref(), it.origin.translation.vector)).collect();
    assert_eq!(kept, [(Some("q"), Vector3::new(1.0, 2.0, 3.0))]);
}

#[test]
fn misspelt_version_of_the_declaration_is_a_warning() {
    let text = format!("<?xml verison=\"1.0\"?>\n{}", joint("continuous", ""));
    strictly_refused_texts(&[(text, &["XML (line 1): \"verison\" in the declaration is read as \"version\""])]);
    refused_texts(&[(
        "<?xml verzion='1.0'?><robot/>".into(),
        "<string>:1: XML: is not well-formed: expected 'version' at 1:7; correct the file",
    )]);
}

#[test]
fn unknown_elements_are_warnings_and_unused_ones_are_not_refused_by_strict() {
    let text =
        joint("continuous", "<gear/><safety_controller/>").replace("</robot>", "<material/><e:x xmlns:e='e'/></robot>");
    strictly_refused_texts(&[(text.clone(), &["<gear> (line 1) is not used: it is unknown"])]);
    let report = read(&text).unwrap().report;
    let unused =
        ["<e:x> (line 1) is not used", "<material> (line 1) is not used", "<safety_controller> (line 1) is not used"];
    assert_eq!(report.unused, unused);
    let known = joint("continuous", "<safety_controller/>");
    assert!(urdf::read_str(&known, None, &LoadOptions { strict: true, ..Default::default() }).is_ok());
}

#[test]
fn xacro_definitions_that_are_not_called_are_not_used() {
    let text = joint("continuous", "").replace(
        "</robot>",
        "<x:property xmlns:x='http://ros.org/wiki/xacro' name='p' value='${q}'/><gazebo><a b='${c}'/></gazebo></robot>",
    );
    warned_texts(&[(text, &["<gazebo> (line 1) is not used", "<x:property> (line 1) is not used"])]);
}

#[test]
fn mimic_of_a_fixed_joint_is_a_warning() {
    let text = star(&[("continuous", ""), ("fixed", "<mimic joint='j0'/>")]);
    strictly_refused_texts(&[(text.clone(), &["joint 'j1' <mimic> (line 3): a fixed joint does not move; not used"])]);
    assert_eq!(Chain::from_urdf_str(&text, &Default::default()).unwrap().nv(), 1);
}

/// Joint `j` moves `b` with mass, `k` moves `c` and `l` moves `d` below it without mass.
fn massless_end(more: &str) -> String {
    robot(&format!(
        "<link name='a'/><link name='b'>{INERTIAL}</link><link name='c'/><link name='d'/>
        <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>
        <joint name='k' type='continuous'><parent link='b'/><child link='c'/><origin xyz='1 0 0'/><axis xyz='0 0 1'/></joint>
        <joint name='l' type='prismatic'><parent link='c'/><child link='d'/><axis xyz='0 1 0'/>{more}</joint>"
    ))
}

const ABOVE_ZERO: &str = "<limit lower='0.5' upper='1' effort='1' velocity='1'/>";

#[test]
fn robots_without_mass_have_kinematics_and_no_dynamics() {
    let chain = Chain::from_urdf_str(&massless_end(ABOVE_ZERO), &Default::default()).unwrap();
    assert_eq!((chain.nv(), chain.massless_links()), (3, vec!["c", "d"]));
    let mut workspace = chain.workspace();
    let mut at = workspace.update(&chain, &[0.0, std::f64::consts::FRAC_PI_2, 0.5]).unwrap();
    let tip = chain.point(chain.frame("d").unwrap(), Vector3::zeros());
    assert!((at.position(tip) - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-15);
    let exact = nalgebra::dmatrix![0.0, 0.0, -1.0; 0.5, -0.5, 0.0; 0.0, 0.0, 0.0];
    assert!((at.point_jacobian(tip) - exact).amax() < 1e-15);
    let message = "'r' has no dynamics, because nothing that these links carry has mass: 'c', 'd'. Give them an <inertial>, load the robot with --repair (LoadOptions::repair), which welds them to the links that carry them, or lock their joints";
    for error in [
        chain.check_dynamics().unwrap_err(),
        at.delassus(tip).unwrap_err(),
        at.forward_dynamics(&[0.0; 3], &[0.0; 3], Vector3::zeros()).unwrap_err(),
    ] {
        assert!(matches!(error, ChainError::Massless { .. }));
        assert_eq!(error.to_string(), message);
    }
    let locked = chain.lock(&[("k", &[0.0]), ("l", &[0.5])]).unwrap().chain;
    assert_eq!(locked.check_dynamics(), Ok(()), "without these joints there are dynamics");
    let floating = LoadOptions { floating_base: true, ..Default::default() };
    let nothing = Chain::from_urdf_str(&robot("<link name='a'/>"), &floating).unwrap();
    assert_eq!(nothing.massless_links(), ["a"]);
}

#[test]
fn coordinates_of_mimic_joints_have_mass_if_one_of_their_joints_moves_some() {
    let text = |follower: &str| {
        robot(&format!(
            "<link name='a'/><link name='b'/><link name='c'>{follower}</link>
            <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='1 0 0'/></joint>
            <joint name='k' type='continuous'><parent link='a'/><child link='c'/><mimic joint='j' multiplier='2'/></joint>"
        ))
    };
    let heavy = Chain::from_urdf_str(&text(INERTIAL), &repair()).unwrap();
    assert_eq!((heavy.check_dynamics(), heavy.report().repairs.len(), heavy.nv()), (Ok(()), 0, 1));
    let mut workspace = heavy.workspace();
    assert_eq!(workspace.update(&heavy, &[0.0]).unwrap().mass_matrix()[(0, 0)], 4.0, "2² times the moment of 1 kg m²");
    let light = Chain::from_urdf_str(&text(""), &repair()).unwrap();
    assert_eq!(light.massless_links(), ["b", "c"], "nothing is left to move, so nothing is repaired");
}

#[test]
fn repair_welds_massless_links_at_the_position_nearest_to_zero() {
    let repaired = urdf::read_str(&massless_end(ABOVE_ZERO), None, &repair()).unwrap();
    let weld = |joint: &str, link: &str, parent: &str, position| Repair::Welded {
        joint: joint.into(),
        link: link.into(),
        parent: parent.into(),
        position,
    };
    assert_eq!(repaired.report.repairs, [weld("k", "c", "b", 0.0), weld("l", "d", "c", 0.5)]);
    assert_eq!(
        repaired.report.repairs[1].to_string(),
        "joint 'l' is fixed at 0.5: link 'd' has no mass and is welded to link 'c'"
    );
    let chain = Chain::from_robot(repaired, &repair());
    assert_eq!((chain.nv(), chain.check_dynamics()), (1, Ok(())));
    // the pose of the end is that of the robot as it is, at this position
    let whole = Chain::from_urdf_str(&massless_end(ABOVE_ZERO), &Default::default()).unwrap();
    let end = |chain: &Chain, q: &[f64]| {
        let mut workspace = chain.workspace();
        let tip = chain.point(chain.frame("d").unwrap(), Vector3::zeros());
        workspace.update(chain, q).unwrap().position(tip)
    };
    assert!((end(&chain, &[0.3]) - end(&whole, &[0.3, 0.0, 0.5])).norm() < 1e-15);
    let clean = urdf::read_str(&joint("continuous", ""), None, &repair()).unwrap();
    assert!(clean.report.repairs.is_empty() && clean.joints == read(&joint("continuous", "")).unwrap().joints);
}

/// Followers are welded where their multiplier and offset put them: 3 · 0.5 + 0.25, a turn about z.
#[test]
fn repair_welds_mimic_joints_where_their_leader_is_welded() {
    let text = massless_end(ABOVE_ZERO).replace(
        "</robot>",
        "<link name='e'/><joint name='m' type='continuous'><parent link='b'/><child link='e'/><axis xyz='0 0 1'/>
        <mimic joint='l' multiplier='3' offset='0.25'/></joint></robot>",
    );
    let robot = urdf::read_str(&text, None, &repair()).unwrap();
    let turn = robot.joints[3].origin.rotation.scaled_axis();
    assert!((turn - Vector3::z() * 1.75).norm() < 1e-15, "{turn}");
    assert_eq!((robot.joints[3].mimic, robot.report.repairs.len()), (None, 3));
}

#[test]
fn repair_raises_principal_moments_to_the_nearest_possible_ones() {
    for (given, before, after) in [
        ("0.1 0.2 0.4 0", [0.1, 0.2, 0.4], [0.2, 0.2, 0.4]),
        ("1 1 1 2", [-1.0, 1.0, 3.0], [2.0, 1.0, 3.0]),
        ("-1 -2 3 0", [-2.0, -1.0, 3.0], [3.0, 0.0, 3.0]),
        ("-1 2 2.5 0", [-1.0, 2.0, 2.5], [0.5, 2.0, 2.5]),
    ] {
        let robot = urdf::read_str(&moving("1", given), None, &repair()).unwrap();
        let [Repair::Raised { link, before: was, after: is }] = &robot.report.repairs[..] else { panic!("{given}") };
        let differs = |x: &[f64; 3], y: &[f64; 3]| x.iter().zip(y).any(|(x, y)| (x - y).abs() > 1e-15);
        assert!(link == "b" && !differs(was, &before) && !differs(is, &after), "{given}: {was:?} {is:?}");
        let used = robot.links[1].inertial.unwrap().inertia_at_com;
        let [mut moments, mut expected]: [[f64; 3]; 2] = [used.symmetric_eigenvalues().into(), after];
        moments.sort_by(f64::total_cmp);
        expected.sort_by(f64::total_cmp);
        assert!(!differs(&moments, &expected), "{given}: {moments:?}");
        assert!(moments[0] + moments[1] > moments[2] - 1e-15, "a body can have them: {moments:?}");
    }
    // The axes stay: the moment about (1, -1, 0) is raised, which adds to ixx, iyy and -ixy in equal parts.
    let robot = urdf::read_str(&moving("1", "1 1 1 2"), None, &repair()).unwrap();
    let exact = nalgebra::matrix![2.5, 0.5, 0.0; 0.5, 2.5, 0.0; 0.0, 0.0, 1.0];
    assert!((robot.links[1].inertial.unwrap().inertia_at_com - exact).amax() < 1e-15);
    assert_eq!(robot.report.repairs[0].to_string(), "link 'b': principal moments -1, 1, 3 kg m² are raised to 2, 1, 3");
    let still = urdf::read_str(&on_b(&inertial("1", "0.1 0.2 0.4 0"), "fixed"), None, &repair()).unwrap();
    assert!(still.report.repairs.is_empty(), "an inertia that has no effect is not changed");
}

#[test]
fn summary_of_a_report_has_all_repairs_and_the_first_warnings() {
    let text = massless_end("").replace("<link name='d'/>", "<link name='d' x='1' y='2' z='3'/>");
    let report = urdf::read_str(&text, None, &repair()).unwrap().report;
    assert_eq!(report.warnings.len(), 4);
    let summary = report.summary(3);
    assert_eq!(summary[..2], [0, 1].map(|k| format!("repaired: {}", report.repairs[k])));
    assert_eq!(summary[2..5], report.warnings[..3]);
    assert_eq!(summary[5..], ["1 more warning about the robot: carom inspect lists them"]);
    assert_eq!(report.summary(4).len(), 6, "no line for nothing");
}

//! Small systems compared with their closed forms, and the errors of singular ones.

use crate::common::solve;
use carom_chain::algebra::{Articulated, Axis, Inertia, PlanarArticulated};
use carom_chain::urdf::{Inertial, Joint, JointType, Link, LoadOptions, Robot};
use carom_chain::{Chain, ChainError, Planar, uniform_chain};
use nalgebra::{Matrix3, Vector2, Vector3};

fn close(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-14 * b.abs().max(1.0), "{a} against {b}");
}

/// A free rigid body whose centre of mass c lies off the reference point: for the acceleration (α, a) of that point the
/// force is f = m (a + α ẑ × c), and the moment about the point is I_c α + c × f.
#[test]
fn planar_articulated_inertia_of_a_rigid_body_is_newtons_and_eulers_law() {
    let (mass, c, i_c) = (3.0, Vector2::new(0.4, -0.7), 0.9);
    let articulated = PlanarArticulated::from_rigid(&Inertia::<Planar<f64>>::from_com(mass, c, i_c));
    let (alpha, a) = (1.7, Vector2::new(-0.6, 2.3));
    let force = articulated.along(Axis::Turn(alpha)) + articulated.along(Axis::Slide(a));
    let f = mass * (a + alpha * Vector2::new(-c.y, c.x));
    close(force.force.x, f.x);
    close(force.force.y, f.y);
    close(force.moment, i_c * alpha + c.x * f.y - c.y * f.x);
}

/// Two uniform rods of 1 m and 1 kg, hinged at the origin and end to end, angles from the x axis.
#[test]
fn double_pendulum_equals_its_closed_form() {
    let chain = uniform_chain(2, 2.0, 2.0).unwrap();
    let (q1, q2, w1, w2) = (0.3_f64, 0.8_f64, 1.2, -0.7);
    let mut ws = chain.workspace();
    let mut kin = ws.update(&chain, &[q1, q2]).unwrap();
    let m = kin.mass_matrix();
    // M = [[5/3 + cos q₂, 1/3 + cos q₂/2], [·, 1/3]]
    close(m[(0, 0)], 5.0 / 3.0 + q2.cos());
    close(m[(0, 1)], 1.0 / 3.0 + q2.cos() / 2.0);
    close(m[(1, 1)], 1.0 / 3.0);
    // C q̇ = ½ sin q₂ (−2 q̇₁q̇₂ − q̇₂², q̇₁²), g = (g (3/2 cos q₁ + ½ cos(q₁+q₂)), …)
    let bias = kin.bias(&[w1, w2], Vector3::new(0.0, -9.81, 0.0)).unwrap();
    let (g1, g2) = (1.5 * q1.cos() * 9.81, 0.5 * (q1 + q2).cos() * 9.81);
    close(bias[0], 0.5 * q2.sin() * (-2.0 * w1 * w2 - w2 * w2) + g1 + g2);
    close(bias[1], 0.5 * q2.sin() * w1 * w1 + g2);
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let p = kin.position(tip);
    close(p.x, q1.cos() + (q1 + q2).cos());
    close(p.y, q1.sin() + (q1 + q2).sin());
    // Published Delassus matrix of Kane's pendulum (links at 20° and 30° from the vertical).
    let mut kin = ws.update(&chain, &[(-70_f64).to_radians(), 10_f64.to_radians()]).unwrap();
    let h = kin.delassus(tip).unwrap();
    for (got, published) in [(h[(0, 0)], 2.440338045696), (h[(0, 1)], 1.521308658011), (h[(1, 1)], 1.009560290504)] {
        assert!((got - published).abs() < 1e-11, "{got} against {published}");
    }
}

fn one_link(kind: JointType, inertial: Option<Inertial>) -> Robot {
    Robot {
        name: "one".into(),
        links: vec![Link::new("base"), Link { inertial, ..Link::new("body") }],
        joints: vec![Joint { axis: Vector3::z_axis(), ..Joint::new("joint", kind, 0, 1) }],
        root: 0,
        disabled_pairs: Vec::new(),
        poses: Vec::new(),
        report: Default::default(),
    }
}

/// A free rod of 1 m and 1 kg; H at its left end is [[1+3 sin²θ, −3 sinθ cosθ], [·, 1+3 cos²θ]].
#[test]
fn delassus_of_a_free_rod_equals_its_closed_form() {
    let rod = Inertial {
        mass: 1.0,
        com: Vector3::zeros(),
        inertia_at_com: Matrix3::from_diagonal(&Vector3::new(0.0, 1.0 / 12.0, 1.0 / 12.0)),
    };
    let chain = Chain::from_robot(one_link(JointType::Planar, Some(rod)), &LoadOptions::default());
    assert_eq!((chain.nq(), chain.nv()), (3, 3));
    let end = chain.point(chain.frame("body").unwrap(), Vector3::new(-0.5, 0.0, 0.0));
    for theta in [0.0_f64, 0.4, 1.0, 1.5] {
        let (s, c) = theta.sin_cos();
        let mut ws = chain.workspace();
        let mut kin = ws.update(&chain, &[5.0, -3.0, theta]).unwrap();
        let h = kin.delassus(end).unwrap();
        close(h[(0, 0)], 1.0 + 3.0 * s * s);
        close(h[(0, 1)], -3.0 * s * c);
        close(h[(1, 1)], 1.0 + 3.0 * c * c);
        // The rod has no joints but its free motion: locking changes nothing in the plane.
        let locked = kin.locked_delassus(end).unwrap();
        for (i, k) in [(0, 0), (0, 1), (1, 1)] {
            close(locked[(i, k)], h[(i, k)]);
        }
    }
}

#[test]
fn point_mass_on_its_hinge_axis_is_refused_as_no_inertia() {
    let on_axis = Inertial { mass: 2.0, com: Vector3::new(0.0, 0.0, 0.3), inertia_at_com: Matrix3::zeros() };
    let chain = Chain::from_robot(one_link(JointType::Revolute, Some(on_axis)), &LoadOptions::default());
    let tip = chain.point(chain.frame("body").unwrap(), Vector3::x());
    let error = chain.workspace().update(&chain, &[0.2]).unwrap().delassus(tip).unwrap_err();
    assert_eq!(error, ChainError::NoInertia { joint: "joint".into() });
    let refused = solve(&mut chain.workspace().update(&chain, &[0.2]).unwrap(), &[1.0]).unwrap_err();
    assert_eq!(refused, error);
    assert_eq!(
        error.to_string(),
        "joint 'joint' moves no inertia at this pose, so its acceleration is not determined: give the links below it mass and \
         inertia, or lock it"
    );
}

/// Two coaxial hinges without inertia between them: M is singular at every pose, though no entry of it is zero. The computed
/// pivot is only the rounding error of a slender body's large inertia.
#[test]
fn coaxial_hinges_without_inertia_between_are_refused_at_every_pose() {
    let mut rng = fastrand::Rng::with_seed(3);
    for slender in [1e-3, 1e-6] {
        let mut robot = one_link(JointType::Revolute, None);
        let body = Inertial {
            mass: 2.0,
            com: Vector3::new(0.01, 0.0, 1.0),
            inertia_at_com: Matrix3::from_diagonal(&Vector3::new(0.2, 0.2, slender)),
        };
        robot.links.push(Link { inertial: Some(body), ..Link::new("blade") });
        let second = Joint { name: "second".into(), parent: 1, child: 2, ..robot.joints[0].clone() };
        robot.joints.push(second);
        // An axis that no frame is aligned with, to avoid exact cancellation.
        let tilt = nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        robot.joints[0].origin.rotation = tilt;
        let chain = Chain::from_robot(robot, &LoadOptions::default());
        let tip = chain.point(chain.frame("blade").unwrap(), Vector3::new(0.3, 0.2, 0.9));
        let mut ws = chain.workspace();
        for _ in 0..1000 {
            let q = [rng.f64() * 6.0, rng.f64() * 6.0];
            let mut kin = ws.update(&chain, &q).unwrap();
            let recursive = kin.delassus(tip).unwrap_err();
            assert!(matches!(recursive, ChainError::NoInertia { .. }));
            assert!(matches!(solve(&mut kin, &[1.0, 0.5]).unwrap_err(), ChainError::NoInertia { .. }));
        }
    }
}

#[test]
fn locked_delassus_of_a_thin_straight_robot_is_refused_beside_its_axis() {
    let chain = uniform_chain(2, 2.0, 2.0).unwrap();
    let mut ws = chain.workspace();
    let mut kin = ws.update(&chain, &[0.4, 0.0]).unwrap();
    let tip = chain.frame("tip").unwrap();
    assert!(kin.locked_delassus(chain.point(tip, Vector3::zeros())).is_ok());
    let beside = kin.locked_delassus(chain.point(tip, Vector3::new(0.0, 0.1, 0.0))).unwrap_err();
    assert_eq!(beside, ChainError::NoLockedInertia);
}

#[test]
fn lock_refuses_a_zero_quaternion_and_locks_mimic_joints_too() {
    let text = r#"<robot name="r"><link name="a"/>
        <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="c"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="d"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name="free" type="floating"><parent link="a"/><child link="b"/></joint>
        <joint name="lead" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/></joint>
        <joint name="follow" type="continuous"><parent link="c"/><child link="d"/><axis xyz="0 1 0"/>
          <mimic joint="lead" multiplier="2"/></joint></robot>"#;
    let chain = Chain::from_urdf_str(text, &LoadOptions::default()).unwrap();
    let nothing = chain.lock(&[("free", &[0.0; 7])]).unwrap_err();
    assert_eq!(nothing, ChainError::NotUnitQuaternion { joint: "free".into(), norm: 0.0 });
    let held = chain.lock(&[("lead", &[0.3])]).unwrap();
    assert_eq!((held.chain.nq(), held.chain.nv(), held.chain.bodies().len()), (7, 6, 6));
    for joint in ["lead", "follow"] {
        assert_eq!(held.chain.joint(joint).unwrap().coordinates, carom_chain::Coordinates::None);
    }
    // The mimic joint leaves the plane, not the joint whose coordinate it shares.
    let base = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let arm = chain.lock(&[("free", &base)]).unwrap().chain;
    let why = arm.to_planar().unwrap_err().to_string();
    assert!(why.starts_with("joint 'follow' leaves the plane"), "{why}");
}

#[test]
fn straight_arm_has_one_singular_direction() {
    let chain = uniform_chain(2, 2.0, 2.0).unwrap();
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let q = [0.7, 0.0];
    let inertia = chain.workspace().update(&chain, &q).unwrap().contact_inertia(tip).unwrap();
    assert_eq!(inertia.rank, 1);
    let along = Vector3::new(0.7_f64.cos(), 0.7_f64.sin(), 0.0);
    assert_eq!(inertia.effective_mass(along.as_slice()), None);
    let across = [-along.y, along.x, 0.0];
    // H across = jᵀ M⁻¹ j with M of the straight arm and j = (2, 1).
    let (m11, m12, m22) = (8.0 / 3.0, 5.0 / 6.0, 1.0 / 3.0);
    let h: f64 = (4.0 * m22 - 4.0 * m12 + m11) / (m11 * m22 - m12 * m12);
    assert!((inertia.effective_mass(&across).unwrap() * h - 1.0).abs() < 1e-13);
    for singular in inertia.principal[inertia.rank..].iter().map(|principal| &principal.0) {
        assert!((singular[0] * across[0] + singular[1] * across[1]).abs() < 1e-12);
    }
    // With an elbow angle of 1e-12 rad the direction is not singular.
    let bent = chain.workspace().update(&chain, &[0.7, 1e-12]).unwrap().contact_inertia(tip).unwrap();
    assert_eq!(bent.rank, 2);
    assert!(bent.effective_mass(along.as_slice()).unwrap() > 1e20);
}

#[test]
fn to_planar_names_the_joint_that_leaves_the_plane() {
    let text = r#"<robot name="r"><link name="a"/>
        <link name="b"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <link name="c"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name="yaw" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
        <joint name="pitch" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/></joint></robot>"#;
    let chain = Chain::from_urdf_str(text, &LoadOptions::default()).unwrap();
    assert_eq!(
        chain.to_planar().unwrap_err().to_string(),
        "joint 'pitch' leaves the plane: its axis (0.000000, 1.000000, 0.000000) is not parallel to that of 'yaw'"
    );
    let planar_error = Chain::from_urdf_str(text, &LoadOptions { floating_base: true, ..Default::default() })
        .unwrap()
        .to_planar()
        .unwrap_err();
    assert_eq!(planar_error.to_string(), "joint 'root_joint' leaves the plane: a floating joint moves in space");
}

/// Straight chain of thin rods, H transverse at the end: the transverse speeds of the joints have the tridiagonal mass matrix
/// m/6 · (2, 1; 1, 4, 1; …), whose pivot at the end tends to m/(2√3) for many links: H = 2√3 n/M.
#[test]
fn delassus_of_a_long_straight_chain_tends_to_its_limit() {
    for n in [100, 1000] {
        let chain = uniform_chain(n, 1.0, 1.0).unwrap();
        let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
        let h = chain.workspace().update(&chain, &vec![0.0; n]).unwrap().delassus(tip).unwrap();
        let limit = 2.0 * 3.0_f64.sqrt() * n as f64;
        assert!((h[(1, 1)] / limit - 1.0).abs() < 1e-13, "{}", h[(1, 1)]);
        assert_eq!(h[(0, 0)], 0.0);
    }
}

//! Several robots as one chain: M is block diagonal, every block and every point is that of the robot alone at its place,
//! and an impulse on one robot moves no other.

use carom_chain::{Chain, ChainError, Coordinates, Placed};
use carom_testing::build::{Part, Y, chain};
use carom_testing::files::robot_with;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// A robot with a joint that mimics another.
fn gripper() -> Chain {
    let link = |part: Part| part.com([0.02, 0.0, 0.05]).weighing(0.3, [0.001, 0.002, 0.0015]);
    let finger = |name: &str, y: f64| link(Part::slider(name, "palm", Y)).at([0.1, y, 0.0]).limits(0.0, 0.05, 9.0);
    let follow = "<mimic joint=\"jfinger1\" multiplier=\"-1\"/>";
    let palm = link(Part::hinge("palm", "base", [0.0, 0.6, 0.8]));
    chain(&[palm, finger("finger1", 0.02), finger("finger2", -0.02).joint(follow)])
}

fn place(x: f64, rpy: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
    Isometry3::from_parts(Translation3::new(x, 0.3, -0.2), turn)
}

struct Cell {
    parts: Vec<(&'static str, Chain, Isometry3<f64>)>,
    joined: Chain,
    q: Vec<Vec<f64>>,
    qd: Vec<Vec<f64>>,
}

fn cell() -> Cell {
    let parts = vec![
        ("ball", robot_with("ball", true), Isometry3::identity()),
        ("arm", robot_with("arm7", false), place(1.5, [0.4, -0.7, 1.1])),
        ("grip", gripper(), place(-2.0, [0.1, 0.2, -0.3])),
        ("flat", robot_with("planar2", false), place(4.0, [1.2, 0.0, 0.0])),
    ];
    let placed = parts.iter().map(|(name, chain, pose)| Placed { name, chain, pose: *pose });
    let joined = Chain::join("cell", &placed.collect::<Vec<_>>()).unwrap();
    let mut random = fastrand::Rng::with_seed(7);
    let mut numbers = |n: usize| (0..n).map(|_| 2.0 * random.f64() - 1.0).collect::<Vec<f64>>();
    let mut q: Vec<Vec<f64>> = parts.iter().map(|(_, chain, _)| numbers(chain.nq())).collect();
    let norm = q[0][3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
    q[0][3..7].iter_mut().for_each(|x| *x /= norm);
    let qd = parts.iter().map(|(_, chain, _)| numbers(chain.nv())).collect();
    Cell { parts, joined, q, qd }
}

/// Sums over some tens of terms of order one: rounding stays below this.
const ROUNDING: f64 = 1e-12;

#[test]
fn every_block_of_m_and_every_force_is_that_of_the_robot_alone() {
    let Cell { parts, joined, q, qd } = cell();
    let (all_q, all_qd) = (q.concat(), qd.concat());
    let gravity = Vector3::new(0.3, -1.2, -9.81);
    let mut workspace = joined.workspace();
    let mut kin = workspace.update(&joined, &all_q).unwrap();
    let (m, bias) = (kin.mass_matrix(), kin.bias(&all_qd, gravity).unwrap());
    let energy = kin.kinetic_energy(&all_qd).unwrap();
    let (mut kinetic, mut mass) = (0.0, 0.0);
    let mut outside = m.clone();
    for (k, member) in joined.members().iter().enumerate() {
        let (name, chain, pose) = &parts[k];
        assert_eq!(member.name, *name);
        let mut alone = chain.workspace();
        let mut own = alone.update(chain, &q[k]).unwrap();
        let block = m.view_range(member.v.clone(), member.v.clone());
        let difference = (block.clone_owned() - own.mass_matrix()).abs().max();
        assert!(difference < ROUNDING, "{name}: {difference}");
        // Gravity in the axes of the robot's own world.
        let forces = own.bias(&qd[k], pose.rotation.inverse() * gravity).unwrap();
        let rows = bias.rows_range(member.v.clone());
        assert!((rows.clone_owned() - &forces).abs().max() < 10.0 * ROUNDING, "{name}: {rows} {forces}");
        kinetic += own.kinetic_energy(&qd[k]).unwrap();
        mass += chain.total_mass();
        outside.view_range_mut(member.v.clone(), member.v.clone()).fill(0.0);
    }
    assert_eq!(outside.abs().max(), 0.0, "M has entries between robots");
    assert!((energy - kinetic).abs() < ROUNDING * kinetic);
    assert!((joined.total_mass() - mass).abs() < ROUNDING * mass);
}

#[test]
fn points_and_contact_inertias_are_those_of_the_robot_alone_at_its_place() {
    let Cell { parts, joined, q, qd } = cell();
    let (all_q, all_qd) = (q.concat(), qd.concat());
    let mut workspace = joined.workspace();
    for (k, member) in joined.members().iter().enumerate() {
        let (name, chain, pose) = &parts[k];
        let link = &chain.links().last().unwrap().name;
        let offset = Vector3::new(0.05, -0.02, 0.03);
        let (point, alone) = (
            joined.point(joined.frame(&format!("{name}/{link}")).unwrap(), offset),
            chain.point(chain.frame(link).unwrap(), offset),
        );
        let mut own = chain.workspace();
        let mut own = own.update(chain, &q[k]).unwrap();
        let mut kin = workspace.update(&joined, &all_q).unwrap();
        let at = pose * nalgebra::Point3::from(own.position(alone));
        assert!((kin.position(point) - at.coords).norm() < ROUNDING, "{name}");
        let speed = pose.rotation * own.point_velocity(alone, &qd[k]).unwrap();
        assert!((kin.point_velocity(point, &all_qd).unwrap() - speed).norm() < ROUNDING, "{name}");
        let turn = pose.rotation.to_rotation_matrix();
        let alone = turn.matrix() * own.delassus(alone).unwrap() * turn.matrix().transpose();
        let joined_h = kin.delassus(point).unwrap();
        let scale = alone.abs().max();
        assert!((&joined_h - alone).abs().max() < ROUNDING * scale, "{name}: {joined_h} {alone}");
        // An impulse at the point moves no other robot.
        let j = kin.point_jacobian(point);
        for v in (0..joined.nv()).filter(|v| !member.v.contains(v)) {
            assert_eq!(j.column(v).abs().max(), 0.0, "{name}: number {v} of qd");
        }
    }
}

#[test]
fn joints_are_named_by_robot_and_followers_follow_their_own_robot() {
    let joined = cell().joined;
    let Coordinates::Follows { joint, .. } = &joined.joint("grip/jfinger2").unwrap().coordinates else { panic!() };
    assert_eq!(joint, "grip/jfinger1");
    assert_eq!(joined.joint("ball/root_joint").unwrap().parent, "world");
    assert_eq!(joined.joint("flat/shoulder").unwrap().parent, "flat/base");
    // Locking a joint of one robot renumbers the robots behind it.
    let locked = joined.lock(&[("arm/elbow_pitch", &[0.2])]).unwrap();
    let lengths: Vec<usize> = locked.chain.members().iter().map(|member| member.v.len()).collect();
    assert_eq!(lengths, [6, 6, 2, 2]);
    assert_eq!(locked.chain.members()[3].v, 14..16);
}

#[test]
fn robots_of_one_plane_are_planar_and_others_are_refused_by_joint() {
    let arm = robot_with("planar2", false);
    let join = |rpy: [f64; 3]| {
        let robots = [("a", place(0.0, [0.0; 3])), ("b", place(1.0, rpy))];
        Chain::join("two", &robots.map(|(name, pose)| Placed { name, chain: &arm, pose })).unwrap()
    };
    assert!(join([0.0, 0.0, 0.7]).to_planar().is_ok());
    let refused = join([0.5, 0.0, 0.0]).to_planar().unwrap_err().to_string();
    assert!(refused.contains("'b/shoulder' leaves the plane"), "{refused}");
}

#[test]
fn names_that_would_be_ambiguous_are_refused() {
    let arm = robot_with("planar2", false);
    for names in [["a", "a"], ["a", ""], ["a", "b/c"]] {
        let robots = names.map(|name| Placed { name, chain: &arm, pose: Isometry3::identity() });
        let refused = Chain::join("two", &robots);
        assert!(matches!(&refused, Err(ChainError::RobotName { name, .. }) if name == names[1]), "{refused:?}");
    }
}

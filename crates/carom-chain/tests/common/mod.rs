//! Random robots with every joint type, branches, mimic joints, links on fixed joints, and rotated frames.

use carom_chain::urdf::{Inertial, Joint, JointType, Link, LoadOptions, Mimic, Robot};
use carom_chain::{Chain, Coordinates};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

/// Which joints a random robot may have.
#[derive(Clone, Copy, PartialEq)]
pub enum Zoo {
    /// All types, and mimic joints.
    All,
    /// All types, without mimic joints.
    Uncoupled,
    /// Hinges and sliders of one inclined plane, and mimic joints.
    Plane,
}

pub struct Sample {
    pub chain: Chain,
    pub rng: fastrand::Rng,
}

impl std::fmt::Debug for Sample {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let joints = self.chain.joints().iter().map(|j| (j.kind, &j.parent, &j.child, &j.coordinates));
        f.debug_list().entries(joints).finish()
    }
}

pub fn unit(rng: &mut fastrand::Rng) -> f64 {
    rng.f64() * 2.0 - 1.0
}

pub fn vector(rng: &mut fastrand::Rng) -> Vector3<f64> {
    Vector3::new(unit(rng), unit(rng), unit(rng))
}

pub fn rotation(rng: &mut fastrand::Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(vector(rng) * 2.0)
}

/// Masses within a factor of 30, and inertias of boxes. The tolerances of the tests are chosen for these.
fn inertial(rng: &mut fastrand::Rng) -> Inertial {
    let mass = 0.2 + 5.0 * rng.f64();
    let side = vector(rng).map(|x| 0.05 + 0.3 * x.abs());
    let square = side.component_mul(&side);
    let boxed = Vector3::new(square.y + square.z, square.z + square.x, square.x + square.y) * (mass / 12.0);
    let turn = rotation(rng).to_rotation_matrix();
    let inertia_at_com = turn * Matrix3::from_diagonal(&boxed) * turn.inverse();
    Inertial { mass, com: vector(rng) * 0.3, inertia_at_com }
}

pub fn robot(joints: usize, zoo: Zoo, rng: &mut fastrand::Rng) -> Robot {
    let tilt = rotation(rng);
    let normal = tilt * Vector3::z();
    let mut robot = Robot {
        name: "zoo".into(),
        links: vec![],
        joints: vec![],
        root: 0,
        disabled_pairs: vec![],
        poses: vec![],
        report: Default::default(),
    };
    robot.links.push(Link { inertial: Some(inertial(rng)), ..Link::new("link0") });
    for k in 0..joints {
        let parent = if rng.f64() < 0.7 { k } else { rng.usize(0..=k) };
        let plane = zoo == Zoo::Plane;
        let kind = match rng.u32(0..if plane { 4 } else { 6 }) {
            0 => JointType::Revolute,
            1 => JointType::Continuous,
            2 => JointType::Prismatic,
            3 if k > 0 => JointType::Fixed,
            3 => JointType::Revolute,
            4 => JointType::Planar,
            _ => JointType::Floating,
        };
        // In the plane all frames stay parallel to the world's, so every axis is given in world axes.
        let turn = if plane { UnitQuaternion::identity() } else { rotation(rng) };
        let axis = match (plane, kind) {
            (false, _) => vector(rng),
            (true, JointType::Prismatic) => normal.cross(&vector(rng)),
            (true, _) => normal * unit(rng).signum(),
        };
        let leaders: Vec<usize> =
            (0..k).filter(|&j| one_dof(&robot.joints[j]) && robot.joints[j].mimic.is_none()).collect();
        let may_follow = zoo != Zoo::Uncoupled && !leaders.is_empty() && kind != JointType::Fixed && rng.f64() < 0.2;
        let mut joint = Joint {
            origin: Isometry3::from_parts(Translation3::from(vector(rng) * 0.5), turn),
            axis: Unit::new_normalize(axis),
            ..Joint::new(format!("joint{}", k + 1), kind, parent, k + 1)
        };
        if may_follow && one_dof(&joint) {
            let joint_index = leaders[rng.usize(0..leaders.len())];
            joint.mimic = Some(Mimic { joint: joint_index, multiplier: 0.5 + unit(rng), offset: unit(rng) });
        }
        robot.joints.push(joint);
        robot.links.push(Link { inertial: Some(inertial(rng)), ..Link::new(format!("link{}", k + 1)) });
    }
    robot
}

fn one_dof(joint: &Joint) -> bool {
    matches!(joint.kind, JointType::Revolute | JointType::Continuous | JointType::Prismatic)
}

pub fn sample(joints: usize, zoo: Zoo, seed: u64) -> Sample {
    let mut rng = fastrand::Rng::with_seed(seed);
    let floating_base = zoo != Zoo::Plane && rng.bool();
    let options = LoadOptions { floating_base, ..Default::default() };
    let chain = Chain::from_robot(robot(joints, zoo, &mut rng), &options);
    Sample { chain, rng }
}

impl Sample {
    pub fn q(&mut self) -> Vec<f64> {
        let mut q: Vec<f64> = (0..self.chain.nq()).map(|_| unit(&mut self.rng) * 2.0).collect();
        for joint in self.chain.joints() {
            if let Coordinates::Own { q: own, .. } = &joint.coordinates
                && own.len() == 7
            {
                let turn = rotation(&mut self.rng);
                q[own.start + 3..own.end].copy_from_slice(turn.coords.as_slice());
            }
        }
        q
    }

    pub fn v(&mut self) -> Vec<f64> {
        (0..self.chain.nv()).map(|_| unit(&mut self.rng) * 2.0).collect()
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        vector(&mut self.rng)
    }
}

/// dq/dt for velocities qd.
pub fn q_rate(chain: &Chain, q: &[f64], qd: &[f64]) -> Vec<f64> {
    let mut rate = vec![0.0; chain.nq()];
    chain.q_rate_into(q, qd, &mut rate);
    rate
}

/// Checks |a − b| ≤ `relative` · max(largest |b|, `floor`) for all entries.
#[track_caller]
pub fn close<'a>(
    name: &str,
    a: impl IntoIterator<Item = &'a f64>,
    b: impl IntoIterator<Item = &'a f64>,
    relative: f64,
    floor: f64,
) {
    let (a, b): (Vec<f64>, Vec<f64>) = (a.into_iter().copied().collect(), b.into_iter().copied().collect());
    assert_eq!(a.len(), b.len(), "{name}: lengths");
    let scale = b.iter().fold(floor, |m, x| m.max(x.abs()));
    for (i, (x, y)) in a.iter().zip(&b).enumerate() {
        assert!((x - y).abs() <= relative * scale, "{name}[{i}]: {x} against {y}, scale {scale}");
    }
}

/// M⁻¹b.
pub fn solve(
    kin: &mut carom_chain::Kinematics<carom_chain::Spatial<f64>>,
    b: &[f64],
) -> Result<nalgebra::DVector<f64>, carom_chain::ChainError> {
    let (mut rows, mut responses) = (carom_chain::Rows::new(b.len()), carom_chain::Rows::default());
    rows.add().copy_from_slice(b);
    kin.respond(&rows, &mut responses)?;
    Ok(nalgebra::DVector::from_column_slice(responses.row(0)))
}

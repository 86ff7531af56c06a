//! Comparison of the probe with `Kinematics`, for every shape of chain that the probe distinguishes.

mod common;

use carom_chain::algebra::Algebra;
use carom_chain::urdf::{JointType, LoadOptions};
use carom_chain::{Chain, ChainError, Point, uniform_chain};
use common::{Sample, Zoo, close, robot, sample};
use nalgebra::{DMatrix, UnitQuaternion, Vector2, Vector3};

/// Compares position, J and M to 1e-13 of their largest entry, and H and the response to that times the condition number of M.
fn agrees<A: Algebra<Scalar = f64>>(chain: &Chain<A>, point: Point<A>, normal: A::Vector, q: &[f64]) {
    let probe = chain.probe(point).unwrap();
    let mut reading = probe.reading();
    // The reading is used for another pose first: no values of it may remain.
    probe.read_into(&q.iter().map(|x| x + 0.3).collect::<Vec<_>>(), normal, &mut reading).unwrap();
    probe.read_into(q, normal, &mut reading).unwrap();
    let found = reading.found();

    let n = chain.nv();
    let mut ws = chain.workspace();
    let mut kin = ws.update(chain, q).unwrap();
    let parts = |v: A::Vector| (0..A::LINEAR).map(|k| A::linear_part(v, k)).collect::<Vec<f64>>();
    let (j, m) = (kin.point_jacobian(point), kin.mass_matrix());
    close("position", &parts(found.position), &parts(kin.position(point)), 1e-13, 1.0);
    let columns: Vec<f64> = found.jacobian.iter().flat_map(|&c| parts(c)).collect();
    close("J", &columns, j.iter(), 1e-13, 1.0);
    close("M", found.mass_matrix, m.iter(), 1e-13, 1e-3);

    let mut along = vec![0.0; n];
    kin.add_point_force(point, normal, &mut along).unwrap();
    close("Jᵀn", found.joint_impulse, &along, 1e-13, 1.0);

    // 100 ε for the rounding of the recursions, times the condition number.
    let eigenvalues = m.symmetric_eigenvalues();
    let solved = 1e-13 + 100.0 * f64::EPSILON * eigenvalues.max() / eigenvalues.min();
    let mut response = vec![0.0; n];
    let mut articulation = kin.articulate().unwrap();
    articulation.solve_into(&along, &mut response).unwrap();
    close("M⁻¹Jᵀn", found.response, &response, solved, 1e-3);
    let h: DMatrix<f64> = articulation.delassus(point);
    let columns: Vec<f64> = found.delassus[..A::LINEAR].iter().flat_map(|&c| parts(c)).collect();
    close("H", &columns, h.iter(), solved, 1e-3);
    let mobility: f64 = along.iter().zip(&response).map(|(a, x)| a * x).sum();
    close("nᵀHn", [found.mobility].iter(), [mobility].iter(), solved, h.amax());
}

fn direction(s: &mut Sample) -> Vector3<f64> {
    s.vector().normalize()
}

#[test]
fn probe_equals_kinematics_on_any_tree() {
    for seed in 0..300 {
        let mut s = sample(1 + seed as usize % 9, Zoo::Uncoupled, seed);
        let moving: Vec<_> = s.chain.frames().iter().filter(|f| f.body.is_some()).map(|f| f.name.clone()).collect();
        for name in [moving.first(), moving.last()].into_iter().flatten() {
            let offset = s.vector();
            let point = s.chain.point(s.chain.frame(name).unwrap(), offset);
            let (normal, q) = (direction(&mut s), s.q());
            agrees(&s.chain, point, normal, &q);
        }
    }
}

#[test]
fn reused_reading_has_no_stale_values() {
    for seed in 0..60 {
        let mut s = match seed % 3 {
            // Hinges in a row: the shape is a row for a point on the last body, and a tree for all others.
            0 => row(2 + seed as usize % 5, seed),
            // The first joint is a slider, so that the shape is a tree of any joints for all points.
            _ => {
                let mut rng = fastrand::Rng::with_seed(seed);
                let mut robot = robot(6, Zoo::Uncoupled, &mut rng);
                robot.joints[0].kind = JointType::Prismatic;
                Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng }
            }
        };
        let (offset, normal, q) = (s.vector(), direction(&mut s), s.q());
        let moving: Vec<_> = s.chain.frames().iter().filter(|f| f.body.is_some()).map(|f| f.name.clone()).collect();
        let at = |name: &String| s.chain.probe(s.chain.point(s.chain.frame(name).unwrap(), offset)).unwrap();
        let probes: Vec<_> = moving.iter().map(at).collect();
        let mut reading = probes[0].reading();
        // All probes forwards and backwards, then each before and after the last.
        let last = probes.last().unwrap();
        let tour = probes.iter().chain(probes.iter().rev()).chain(probes.iter().flat_map(|p| [p, last, p]));
        for probe in tour {
            let mut fresh = probe.reading();
            probe.read_into(&q, normal, &mut fresh).unwrap();
            probe.read_into(&q, normal, &mut reading).unwrap();
            let (a, b) = (reading.found(), fresh.found());
            assert_eq!(
                (a.jacobian, a.mass_matrix, a.joint_impulse, a.response, a.delassus, a.mobility),
                (b.jacobian, b.mass_matrix, b.joint_impulse, b.response, b.delassus, b.mobility)
            );
        }
    }
}

#[test]
fn probe_equals_kinematics_on_trees_of_hinges() {
    for seed in 0..200 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut robot = robot(4 + seed as usize % 9, Zoo::Uncoupled, &mut rng);
        robot.joints.iter_mut().for_each(|joint| joint.kind = JointType::Revolute);
        let mut s = Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng };
        for frame in s.chain.frames().to_vec().into_iter().filter(|f| f.body.is_some()) {
            let (offset, normal, q) = (s.vector(), direction(&mut s), s.q());
            let point = s.chain.point(s.chain.frame(&frame.name).unwrap(), offset);
            agrees(&s.chain, point, normal, &q);
        }
    }
}

/// A row of random hinges in space.
fn row(hinges: usize, seed: u64) -> Sample {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut robot = robot(hinges, Zoo::Uncoupled, &mut rng);
    for (k, joint) in robot.joints.iter_mut().enumerate() {
        (joint.kind, joint.parent) = (JointType::Revolute, k);
    }
    Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng }
}

#[test]
fn probe_equals_kinematics_on_rows_of_hinges() {
    for seed in 0..100 {
        for hinges in 1..=8 {
            let mut s = row(hinges, seed);
            let name = format!("link{hinges}");
            let offset = s.vector();
            let point = s.chain.point(s.chain.frame(&name).unwrap(), offset);
            let (normal, q) = (direction(&mut s), s.q());
            agrees(&s.chain, point, normal, &q);
        }
    }
}

#[test]
fn probe_keeps_its_accuracy_for_nearly_parallel_axes() {
    // The rotations of the frames about two parallel axes are not determined separately; for nearly parallel ones barely.
    for seed in 0..30 {
        for tilt in [0.0, 1e-15, 1e-12, 1e-8, 1e-4, std::f64::consts::PI] {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut robot = robot(4, Zoo::Uncoupled, &mut rng);
            for (k, joint) in robot.joints.iter_mut().enumerate() {
                (joint.kind, joint.parent, joint.axis) = (JointType::Revolute, k, Vector3::z_axis());
                let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
                let (first, last) = (about(Vector3::z_axis(), rng.f64()), about(Vector3::z_axis(), rng.f64()));
                joint.origin.rotation = first * about(Vector3::x_axis(), tilt) * last;
            }
            let mut s = Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng };
            let offset = s.vector();
            let point = s.chain.point(s.chain.frame("link4").unwrap(), offset);
            let (normal, q) = (direction(&mut s), s.q());
            agrees(&s.chain, point, normal, &q);
        }
    }
}

#[test]
fn probe_equals_kinematics_in_the_plane() {
    for seed in 0..300 {
        let mut s = sample(1 + seed as usize % 9, Zoo::Plane, seed);
        let Ok(flat) = s.chain.to_planar() else { continue };
        let frames: Vec<_> = flat.chain.frames().iter().filter(|f| f.body.is_some()).map(|f| f.name.clone()).collect();
        let Some(name) = frames.last() else { continue };
        let offset = s.vector();
        let point = flat.point(s.chain.frame(name).unwrap(), offset);
        let q = s.q();
        let normal = Vector2::new(s.vector().x, 1.0).normalize();
        if !flat.chain.is_coupled() {
            agrees(&flat.chain, point, normal, &q);
        }
    }
    for hinges in [1, 2, 3, 4, 7, 30] {
        let chain = uniform_chain(hinges, 1.0, 1.0).unwrap();
        let flat = chain.to_planar().unwrap();
        let point = flat.point(chain.frame("tip").unwrap(), Vector3::zeros());
        let q: Vec<f64> = (0..hinges).map(|i| 0.3 + 0.1 * (i % 5) as f64).collect();
        agrees(&flat.chain, point, -Vector2::x(), &q);
    }
}

#[test]
fn probe_refuses_fixed_points_mimic_joints_and_wrong_lengths() {
    let chain = uniform_chain(2, 1.0, 1.0).unwrap();
    let base = chain.point(chain.frame("link0").unwrap(), Vector3::zeros());
    assert!(matches!(chain.probe(base), Err(ChainError::FixedPoint { .. })));
    let coupled = (0..).map(|seed| sample(6, Zoo::All, seed)).find(|s| s.chain.is_coupled()).unwrap().chain;
    let last = coupled.point(coupled.frame("link6").unwrap(), Vector3::zeros());
    assert!(matches!(coupled.probe(last), Err(ChainError::Coupled { .. })));
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let probe = chain.probe(tip).unwrap();
    let mut reading = probe.reading();
    for q in [&[0.1][..], &[0.1, 0.2, 0.3]] {
        assert!(matches!(probe.read_into(q, Vector3::x(), &mut reading), Err(ChainError::WrongLength { .. })));
    }
}

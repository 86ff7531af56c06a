//! The response at a contact point compared with its definitions, for every shape of chain and every route.

use crate::common::{Sample, Zoo, close, robot, sample};
use carom_chain::algebra::Algebra;
use carom_chain::urdf::{JointType, LoadOptions};
use carom_chain::{Chain, ChainError, ContactInertia, Keep, Point, PointResponse, ResponseMemory, uniform_chain};
use carom_testing::build::{self, Part};
use nalgebra::{DMatrix, UnitQuaternion, Vector2, Vector3};

/// Compares position, J and M to 1e-13 of their largest entry, and H and the response to that times the condition number of M.
fn agrees<A: Algebra<Scalar = f64>>(chain: &Chain<A>, point: Point<A>, normal: A::Vector, q: &[f64]) {
    let at = chain.contact_point(point).unwrap();
    let mut memory = ResponseMemory::default();
    // The memory is used for another pose first: no values of it may remain.
    at.visit(&q.iter().map(|x| x + 0.3).collect::<Vec<_>>(), normal, &[], &mut memory, Keep).unwrap();
    at.visit(q, normal, &[], &mut memory, Keep).unwrap();
    equals_its_definition(chain, point, normal, &[], q, memory.response());
    let mut ws = chain.workspace();
    equals_its_definition(
        chain,
        point,
        normal,
        &[],
        q,
        ws.update(chain, q).unwrap().contact(point, normal, &[]).unwrap(),
    );

    // Some joints are free, some have a rotor, some are locked.
    let added = weights(chain, q);
    at.visit(q, normal, &added, &mut memory, Keep).unwrap();
    equals_its_definition(chain, point, normal, &added, q, memory.response());
    let mut kin = ws.update(chain, q).unwrap();
    equals_its_definition(chain, point, normal, &added, q, kin.contact(point, normal, &added).unwrap());
}

/// Inertias of drives: none, finite or infinite.
fn weights<A: Algebra<Scalar = f64>>(chain: &Chain<A>, q: &[f64]) -> Vec<f64> {
    let mut rng = fastrand::Rng::with_seed(q[0].to_bits());
    let weight = |_| match rng.u8(0..4) {
        0 => 0.0,
        1 => f64::INFINITY,
        _ => 10.0_f64.powf(4.0 * rng.f64() - 2.0),
    };
    (0..chain.nv()).map(weight).collect()
}

/// H = J (M + W)⁻¹ Jᵀ and X = (M + W)⁻¹ Jᵀ by a dense solve over the coordinates that are not locked.
fn equals_its_definition<A: Algebra<Scalar = f64>>(
    chain: &Chain<A>,
    point: Point<A>,
    normal: A::Vector,
    added: &[f64],
    q: &[f64],
    found: PointResponse<A>,
) {
    let mut ws = chain.workspace();
    let mut kin = ws.update(chain, q).unwrap();
    let parts = |v: A::Vector| (0..A::LINEAR).map(|k| A::linear_part(v, k)).collect::<Vec<f64>>();
    let all = |them: &[A::Vector]| them.iter().flat_map(|&v| parts(v)).collect::<Vec<f64>>();
    let (j, m) = (kin.point_jacobian(point), kin.mass_matrix());
    close("position", &parts(found.position), &parts(kin.position(point)), 1e-13, 1.0);
    close("J", &all(found.jacobian), j.iter(), 1e-13, 1.0);
    if !found.mass_matrix.is_empty() {
        close("M", found.mass_matrix, m.iter(), 1e-13, 1e-3);
        let qd: Vec<f64> = (0..chain.nv()).map(|k| (k as f64 + 0.5).sin()).collect();
        close("T", &[found.kinetic_energy(&qd)], &[kin.kinetic_energy(&qd).unwrap()], 1e-12, 1e-3);
    }

    let weight = |k: usize| added.get(k).copied().unwrap_or(0.0);
    let free: Vec<usize> = (0..chain.nv()).filter(|&k| weight(k).is_finite()).collect();
    if free.is_empty() {
        let all = [all(found.response), all(&found.delassus)].concat();
        assert!(all.iter().all(|x| *x == 0.0) && ContactInertia::of(found).rank == 0, "all joints are locked");
        return;
    }
    let mut own = m.select_rows(&free).select_columns(&free);
    free.iter().enumerate().for_each(|(i, &k)| own[(i, i)] += weight(k));
    // 100 ε for the rounding of the recursions, times the condition number.
    let eigenvalues = own.symmetric_eigenvalues();
    let solved = 1e-13 + 100.0 * f64::EPSILON * eigenvalues.max() / eigenvalues.min();
    let pushed = j.transpose().select_rows(&free);
    let moved = own.cholesky().unwrap().solve(&pushed);
    let mut x = DMatrix::zeros(chain.nv(), A::LINEAR);
    free.iter().enumerate().for_each(|(i, &k)| x.set_row(k, &moved.row(i)));
    close("X", &all(found.response), x.transpose().iter(), solved, 1e-3);
    let h = &j * &x;
    close("H", &all(&found.delassus[..A::LINEAR]), h.iter(), solved, 1e-3);
    let n = nalgebra::DVector::from_vec(parts(normal));
    close("nᵀHn", &[found.mobility], &[n.dot(&(&h * &n))], solved, h.amax());
    let mut sum = DMatrix::zeros(A::LINEAR, A::LINEAR);
    for (y, inverse_d) in found.reduced_jacobian.iter().zip(found.inverse_d) {
        let y = nalgebra::DVector::from_vec(parts(*y));
        sum += &y * y.transpose() * *inverse_d;
    }
    close("Σ y yᵀ / D", sum.iter(), h.iter(), solved, 1e-3);
    let axes: [A::Vector; 3] = std::array::from_fn(|k| A::vector(|i| if i == k { 1.0 } else { 0.0 }));
    let gram = found.delassus_in(axes);
    close("H from columns", gram.view((0, 0), h.shape()).iter(), h.iter(), solved, 1e-3);
}

fn direction(s: &mut Sample) -> Vector3<f64> {
    s.vector().normalize()
}

/// The names of the links that move.
fn moving(chain: &Chain) -> Vec<String> {
    chain.frames().iter().filter(|f| f.body.is_some()).map(|f| f.name.clone()).collect()
}

/// [`agrees`] for a random point, normal and pose, on a link.
fn agrees_on(s: &mut Sample, link: &str) {
    let offset = s.vector();
    let point = s.chain.point(s.chain.frame(link).unwrap(), offset);
    let (normal, q) = (direction(s), s.q());
    agrees(&s.chain, point, normal, &q);
}

#[test]
fn response_equals_its_definition_on_any_tree() {
    for seed in 0..300 {
        let mut s = sample(1 + seed as usize % 9, Zoo::Uncoupled, seed);
        let links = moving(&s.chain);
        [links.first(), links.last()].into_iter().flatten().for_each(|link| agrees_on(&mut s, link));
    }
}

#[test]
fn reused_memory_has_no_stale_values() {
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
        let moving = moving(&s.chain);
        let at = |name: &String| s.chain.contact_point(s.chain.point(s.chain.frame(name).unwrap(), offset)).unwrap();
        let points: Vec<_> = moving.iter().map(at).collect();
        let mut memory = ResponseMemory::default();
        // All points forwards and backwards, then each before and after the last.
        let last = points.last().unwrap();
        let tour = points.iter().chain(points.iter().rev()).chain(points.iter().flat_map(|p| [p, last, p]));
        for point in tour {
            let mut fresh = ResponseMemory::default();
            point.visit(&q, normal, &[], &mut fresh, Keep).unwrap();
            point.visit(&q, normal, &[], &mut memory, Keep).unwrap();
            let (a, b) = (memory.response(), fresh.response());
            assert_eq!(
                (a.jacobian, a.mass_matrix, a.reduced_jacobian, a.response, a.delassus, a.mobility, a.inverse_d),
                (b.jacobian, b.mass_matrix, b.reduced_jacobian, b.response, b.delassus, b.mobility, b.inverse_d)
            );
        }
    }
}

#[test]
fn response_equals_its_definition_on_trees_of_hinges() {
    for seed in 0..200 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut robot = robot(4 + seed as usize % 9, Zoo::Uncoupled, &mut rng);
        robot.joints.iter_mut().for_each(|joint| joint.kind = JointType::Revolute);
        let mut s = Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng };
        moving(&s.chain).iter().for_each(|link| agrees_on(&mut s, link));
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
fn response_equals_its_definition_on_rows_of_hinges() {
    for seed in 0..100 {
        for hinges in 1..=8 {
            agrees_on(&mut row(hinges, seed), &format!("link{hinges}"));
        }
    }
}

#[test]
fn response_keeps_its_accuracy_for_nearly_parallel_axes() {
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
            agrees_on(&mut s, "link4");
        }
    }
}

#[test]
fn response_equals_its_definition_in_the_plane() {
    for seed in 0..300 {
        let mut s = sample(1 + seed as usize % 9, Zoo::Plane, seed);
        let Ok(flat) = s.chain.to_planar() else { continue };
        let Some(name) = flat.chain.frames().iter().rfind(|f| f.body.is_some()).map(|f| f.name.clone()) else {
            continue;
        };
        let offset = s.vector();
        let point = flat.point(s.chain.frame(&name).unwrap(), offset);
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
fn response_of_mimic_joints_equals_its_definition() {
    let mut coupled = 0;
    for seed in 0..100 {
        let mut s = sample(3 + seed as usize % 6, Zoo::All, seed);
        if !s.chain.is_coupled() {
            continue;
        }
        coupled += 1;
        let Some(name) = s.chain.frames().iter().rfind(|f| f.body.is_some()).map(|f| f.name.clone()) else { continue };
        let offset = s.vector();
        let point = s.chain.point(s.chain.frame(&name).unwrap(), offset);
        let (normal, q) = (direction(&mut s), s.q());
        for added in [vec![0.0; s.chain.nv()], weights(&s.chain, &q)] {
            let mut ws = s.chain.workspace();
            let mut kin = ws.update(&s.chain, &q).unwrap();
            equals_its_definition(&s.chain, point, normal, &added, &q, kin.contact(point, normal, &added).unwrap());
        }
    }
    assert!(coupled > 10, "{coupled}");
}

#[test]
fn response_of_long_chains_equals_its_definition() {
    for (links, tree) in [(49, false), (60, false), (60, true)] {
        let mut rng = fastrand::Rng::with_seed(links as u64);
        let mut robot = robot(links, Zoo::Uncoupled, &mut rng);
        for (k, joint) in robot.joints.iter_mut().enumerate() {
            joint.kind = JointType::Revolute;
            // A tree: four branches of a long trunk.
            joint.parent = if tree && k % 15 == 14 { 7 } else { k };
        }
        let mut s = Sample { chain: Chain::from_robot(robot, &LoadOptions::default()), rng };
        let offset = s.vector();
        let point = s.chain.point(s.chain.frame(&format!("link{links}")).unwrap(), offset);
        let (normal, q) = (direction(&mut s), s.q());
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let found = kin.contact(point, normal, &[]).unwrap();
        assert!(found.mass_matrix.is_empty(), "the recursion does not form M");
        agrees(&s.chain, point, normal, &q);
    }
}

/// The first hinge of the arm is vertical, and its floating base has no inertia: rotation of the base about the hinge moves
/// nothing. The rounding of its pivot may have either sign.
#[test]
fn floating_base_without_inertia_is_refused_at_every_pose() {
    let text = std::fs::read_to_string(format!("{}/../../robots/arm7.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let chain = Chain::from_urdf_str(&text, &LoadOptions { floating_base: true, ..Default::default() }).unwrap();
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let (mut ws, mut rng) = (chain.workspace(), fastrand::Rng::with_seed(2));
    for _ in 0..200 {
        let mut q: Vec<f64> = (0..chain.nq()).map(|_| 4.0 * rng.f64() - 2.0).collect();
        let length = q[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
        q[3..7].iter_mut().for_each(|x| *x /= length);
        let error = ws.update(&chain, &q).unwrap().contact(tip, Vector3::x(), &[]).unwrap_err();
        assert_eq!(error, ChainError::NoInertia { joint: "root_joint".into() });
        let mut memory = ResponseMemory::default();
        chain.contact_point(tip).unwrap().visit(&q, Vector3::x(), &[], &mut memory, Keep).unwrap();
        assert!(memory.response().is_doubtful());
    }
}

#[test]
fn fixed_points_mimic_joints_and_wrong_lengths_are_refused() {
    let chain = uniform_chain(2, 1.0, 1.0).unwrap();
    let base = chain.point(chain.frame("link0").unwrap(), Vector3::zeros());
    assert!(matches!(chain.contact_point(base), Err(ChainError::FixedPoint { .. })));
    let coupled = (0..).map(|seed| sample(6, Zoo::All, seed)).find(|s| s.chain.is_coupled()).unwrap().chain;
    let last = coupled.point(coupled.frame("link6").unwrap(), Vector3::zeros());
    assert!(matches!(coupled.contact_point(last), Err(ChainError::Coupled { .. })));
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let (at, mut memory) = (chain.contact_point(tip).unwrap(), ResponseMemory::default());
    for q in [&[0.1][..], &[0.1, 0.2, 0.3]] {
        assert!(matches!(at.visit(q, Vector3::x(), &[], &mut memory, Keep), Err(ChainError::WrongLength { .. })));
    }
    let mut ws = chain.workspace();
    let mut kin = ws.update(&chain, &[0.1, 0.2]).unwrap();
    assert!(matches!(kin.contact(tip, Vector3::x(), &[1.0]), Err(ChainError::WrongLength { .. })));
    let at_base = kin.contact(base, Vector3::x(), &[]).unwrap();
    assert_eq!((at_base.delassus, at_base.mobility, at_base.moves()), ([Vector3::zeros(); 3], 0.0, false));
}

/// A row of `n` hinges whose axes all pass through one point, of which the last link has the offset returned; with `mimic`, the
/// second follows the first.
fn hinges_through_a_point(n: usize, mimic: bool, rng: &mut fastrand::Rng) -> (Chain, Vector3<f64>) {
    let mut arm = crate::common::vector(rng);
    let mut parts = Vec::new();
    for k in 0..n {
        let parent = k.checked_sub(1).map_or("base".into(), |p| format!("l{p}"));
        let axis = crate::common::vector(rng).normalize();
        let place = arm - axis * crate::common::unit(rng);
        arm -= place;
        let part = Part::hinge(&format!("l{k}"), &parent, axis.into()).at(place.into());
        let part = part.com(crate::common::vector(rng).into()).weighing(1.0, [0.1, 0.2, 0.15]);
        let follows = mimic && k == 1;
        parts.push(if follows { part.joint("<mimic joint='jl0' multiplier='-0.7'/>") } else { part });
    }
    (build::chain(&parts), arm)
}

/// What no joint moves is moved along no direction, by every route: unrolled, fused, by recursions, with mimic joints. Its J is
/// rounding as a whole, and so is H.
#[test]
fn a_point_on_the_axes_of_all_hinges_does_not_move() {
    let mut rng = fastrand::Rng::with_seed(5);
    for (n, mimic) in [(1, false), (2, false), (3, false), (6, false), (60, false), (5, true)] {
        let mut nonzero = 0;
        for _ in 0..20 {
            let (chain, offset) = hinges_through_a_point(n, mimic, &mut rng);
            let point = chain.point(chain.frame(&format!("l{}", n - 1)).unwrap(), offset);
            let q: Vec<f64> = (0..chain.nq()).map(|_| 3.0 * crate::common::unit(&mut rng)).collect();
            let normal = crate::common::vector(&mut rng).normalize();
            let mut still = |found: PointResponse<carom_chain::Spatial<f64>>| {
                assert!(!found.moves(), "{n} hinges: J {:?}", found.jacobian);
                assert_eq!(found.delassus_in([Vector3::x(), Vector3::y(), Vector3::z()]).amax(), 0.0);
                nonzero += usize::from(found.mobility > 0.0);
            };
            let (mut workspace, mut memory) = (chain.workspace(), ResponseMemory::default());
            still(workspace.update(&chain, &q).unwrap().contact(point, normal, &[]).unwrap());
            if !mimic {
                chain.contact_point(point).unwrap().visit(&q, normal, &[], &mut memory, Keep).unwrap();
                still(memory.response());
            }
            // Beside the axes it moves.
            let beside =
                chain.point(chain.frame(&format!("l{}", n - 1)).unwrap(), offset + crate::common::vector(&mut rng));
            let kin = &mut workspace.update(&chain, &q).unwrap();
            let found = kin.contact(beside, normal, &[]).unwrap();
            assert!(n == 1 || found.moves(), "{n} hinges");
        }
        assert!(nonzero > 10, "the mobility of {n} hinges is exactly zero: the test shows nothing");
    }
}

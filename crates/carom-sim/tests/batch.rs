//! The kernel for sweeps: `jump_into` compared with the recursive kernel, `many` compared with `jump_into`; prepared strikes at
//! columns of states compared with single impacts.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, Point, uniform_chain};
use carom_impact::{Energetic, Frictionless, Law, Mode, Poisson, Whittaker};
use carom_sim::{
    ChainImpact, FrictionlessJump, Impacts, JointModel, Outcomes, SimError, States, Strike, frictionless_jump_into,
};
use carom_testing::files::robot_with;
use carom_testing::scenes::users_law;
use nalgebra::{DMatrix, Vector2, Vector3};

fn columns(rows: usize, count: usize, f: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..rows).map(|row| (0..count).map(|k| f(row, k)).collect()).collect()
}

fn read(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

fn write(columns: &mut [Vec<f64>]) -> Vec<&mut [f64]> {
    columns.iter_mut().map(Vec::as_mut_slice).collect()
}

/// Every result of `many` with `count` states equals that of `jump_into` bit by bit, and those agree with the recursion, which allocates nothing,
/// and with impacts by the checked interface, where there are any. Returns the number of these.
fn check_batch<A: Algebra<Scalar = f64>>(
    chain: &Chain<A>,
    point: Point<A>,
    normal: A::Vector,
    count: usize,
    checked: impl Fn(&[f64], &[f64]) -> Option<ChainImpact>,
) -> usize {
    let (nq, nv, linear) = (chain.nq(), chain.nv(), A::LINEAR);
    // The quaternions are not normalised here: the kernels divide by their length.
    let q = columns(nq, count, |row, k| 0.4 * (row as f64 + 1.0) + 0.7 * (k as f64 + 0.3 * row as f64).sin());
    let qd = columns(nv, count, |row, k| (1.3 * row as f64 + 0.9 * k as f64).cos());
    let mut qd_plus = columns(nv, count, |_, _| f64::NAN);
    let mut impulse = columns(1, count, |_, _| f64::NAN);
    let mut delassus = columns(linear * linear, count, |_, _| f64::NAN);
    let mut jacobian = columns(linear * nv, count, |_, _| f64::NAN);
    let mut mass_matrix = columns(nv * nv, count, |_, _| f64::NAN);

    let kernel = FrictionlessJump::new(chain, point).unwrap();
    let mut outcomes = Outcomes {
        qd_plus: &mut write(&mut qd_plus),
        impulse: &mut write(&mut impulse),
        delassus: &mut write(&mut delassus),
        jacobian: &mut write(&mut jacobian),
        mass_matrix: &mut write(&mut mass_matrix),
    };
    kernel.many(States { q: &read(&q), qd: &read(&qd) }, normal, 0.35, &mut outcomes).unwrap();

    let mut jump = kernel.jump();
    let mut workspace = chain.workspace();
    let (mut scratch, mut recursive) = (vec![0.0; nv], vec![0.0; nv]);
    let mut compared = 0;
    for k in 0..count {
        let at = |columns: &[Vec<f64>]| columns.iter().map(|c| c[k]).collect::<Vec<_>>();
        let (q, qd) = (at(&q), at(&qd));
        kernel.jump_into(&q, &qd, normal, 0.35, &mut jump).unwrap();
        let parts = |v: &A::Vector| (0..linear).map(|i| A::linear_part(*v, i)).collect::<Vec<_>>();
        assert_eq!(at(&qd_plus), jump.qd_plus);
        assert_eq!(at(&impulse), [jump.impulse]);
        let found = jump.response();
        assert_eq!(at(&delassus), found.delassus[..linear].iter().flat_map(parts).collect::<Vec<_>>());
        assert_eq!(at(&jacobian), found.jacobian.iter().flat_map(parts).collect::<Vec<_>>());
        assert_eq!(at(&mass_matrix), found.mass_matrix);

        // H = J M⁻¹ Jᵀ by the definition. Rounding is multiplied by the condition number of M, up to 1e6 for 60 links.
        let m = DMatrix::from_column_slice(nv, nv, found.mass_matrix);
        let j = DMatrix::from_fn(linear, nv, |i, v| A::linear_part(found.jacobian[v], i));
        let h = &j * m.cholesky().unwrap().solve(&j.transpose());
        let largest = h.amax();
        let off = |c: usize, r: usize| (A::linear_part(found.delassus[c], r) - h[(r, c)]).abs();
        assert!((0..linear).all(|c| (0..linear).all(|r| off(c, r) <= 1e-9 * largest)), "{h}");

        let mut kin = workspace.update(chain, &q).unwrap();
        let mut p = 0.0;
        let allocated = allocation_counter::measure(|| {
            p = frictionless_jump_into(&mut kin, point, normal, 0.35, &qd, &mut scratch, &mut recursive).unwrap();
        });
        assert_eq!(allocated.count_total, 0);
        // Both have rounding errors of 1e-16 times the condition number of M, some 1e4 for these robots.
        let scale = recursive.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        assert!((p - jump.impulse).abs() <= 1e-11 * p.abs(), "{p} {}", jump.impulse);
        assert!(jump.qd_plus.iter().zip(&recursive).all(|(a, b)| (a - b).abs() <= 1e-11 * scale));
        let Some(hit) = checked(&q, &qd).filter(|hit| hit.mode != Mode::Open) else { continue };
        compared += 1;
        assert!(
            hit.qd_plus.iter().zip(&recursive).all(|(a, b)| (a - b).abs() <= 1e-10 * scale),
            "{hit:?} {recursive:?}"
        );
        assert!((p - hit.impulse.norm()).abs() <= 1e-10 * p, "{p} {hit:?}");
    }
    compared
}

#[test]
fn batched_impacts_equal_single_impacts_bit_by_bit() {
    // Points on the last link of an arm, on a middle link, on a branch of a tree, and on a floating body.
    let cases = [
        ("planar2", "tip", false),
        ("planar3", "tip", false),
        ("arm7", "tip", false),
        ("arm7", "link5", false),
        ("humanoid29", "tip", false),
        ("box", "box", true),
    ];
    let mut planar = Vec::new();
    for (name, link, floating) in cases {
        let chain = robot_with(name, floating);
        let frame = chain.frame(link).unwrap();
        let (offset, law) = (Vector3::new(0.1, 0.02, 0.05), Frictionless { restitution: 0.35 });
        let (point, normal) = (chain.point(frame, offset), Vector3::new(0.6, 0.0, 0.8));
        // The checked interface refuses quaternions that are not normalised.
        let strike = |q: &[f64], qd: &[f64], offset: Vector3<f64>, normal: Vector3<f64>| {
            let hit = chain.impact(q, qd).at(frame).offset(offset).normal(normal).resolve(&law);
            if floating { None } else { Some(hit.unwrap()) }
        };
        // Complete blocks and incomplete ones.
        let counts = [0, 1, 4, 8, 19, 64, 131].into_iter();
        let one = |count| check_batch(&chain, point, normal, count, |q, qd| strike(q, qd, offset, normal));
        let compared: usize = counts.map(one).sum();
        assert!(floating || compared > 40, "{name}: {compared}");
        if let Ok(flat) = chain.to_planar() {
            planar.push(name);
            let (point, normal) = (flat.point(frame, Vector3::zeros()), Vector3::new(-0.8, 0.6, 0.0));
            let one = |count| {
                let checked = |q: &[f64], qd: &[f64]| strike(q, qd, Vector3::zeros(), normal);
                check_batch(&flat.chain, point, flat.plane.project(normal), count, checked)
            };
            let compared: usize = [1, 70].map(one).iter().sum();
            assert!(compared > 10, "{name} in the plane: {compared}");
        }
    }
    assert_eq!(planar, ["planar2", "planar3"]);
    // With 60 links by recursions.
    for links in [12, 60] {
        let long = uniform_chain(links, 3.0, 2.0).unwrap();
        let flat = long.to_planar().unwrap();
        let tip = long.frame("tip").unwrap();
        assert_eq!(flat.chain.has_fused_pass(), links == 12);
        check_batch(&flat.chain, flat.point(tip, Vector3::zeros()), -Vector2::y(), 9, |_, _| None);
        check_batch(&long, long.point(tip, Vector3::zeros()), -Vector3::y(), 5, |_, _| None);
    }
}

#[test]
fn columns_of_wrong_number_or_length_are_refused() {
    let chain = robot_with("planar2", false);
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    let kernel = FrictionlessJump::new(&chain, tip).unwrap();
    let (two, three) = ([0.1, 0.2], [0.1, 0.2, 0.3]);
    let normal = -Vector3::x();
    let refused = |q: &[&[f64]], qd: &[&[f64]], wanted: usize| {
        let mut impulse = vec![0.0; wanted];
        let mut outcomes = Outcomes { impulse: &mut [&mut impulse], ..Default::default() };
        let answer = kernel.many(States { q, qd }, normal, 0.5, &mut outcomes);
        assert!(matches!(answer, Err(ChainError::WrongLength { .. })), "{answer:?}");
    };
    refused(&[&two], &[&two, &two], 2);
    refused(&[&two, &two], &[&two, &two, &two], 2);
    refused(&[&two, &three], &[&two, &two], 2);
    refused(&[&two, &two], &[&two, &two], 3);
    let mut jump = kernel.jump();
    assert!(kernel.jump_into(&two, &three, normal, 0.5, &mut jump).is_err());
    assert!(kernel.jump_into(&three, &two, normal, 0.5, &mut jump).is_err());
    let (mut workspace, mut short, mut right) = (chain.workspace(), [0.0; 1], [0.0; 2]);
    let mut kin = workspace.update(&chain, &two).unwrap();
    let refused = frictionless_jump_into(&mut kin, tip, normal, 0.5, &two, &mut short, &mut right);
    assert!(matches!(refused, Err(ChainError::WrongLength { got: 1, expected: 2, .. })));
}

/// All numbers of a result, for comparison by digits.
fn numbers(hit: &ChainImpact) -> Vec<f64> {
    let vectors = [hit.impulse, hit.u_minus, hit.u_plus, hit.contact.impulse, hit.contact.u_plus];
    let energies = [hit.energy_before, hit.energy_after, hit.drive_work, hit.contact.normal_work];
    let of_vectors = vectors.iter().flat_map(|v| [v.x, v.y, v.z]);
    of_vectors.chain(hit.qd_plus.iter().chain(&hit.drive_impulse).copied()).chain(energies).collect()
}

/// Every impact of `count` states in columns has the digits of a single one. Returns how many there were, and how many slipped.
fn check_columns<'a>(chain: &'a Chain, describe: &impl Fn() -> Strike<'a>, count: usize) -> (usize, usize) {
    let q = columns(chain.nq(), count, |row, k| 0.4 * (row as f64 + 1.0) + 0.7 * (k as f64 + 0.3 * row as f64).sin());
    let qd = columns(chain.nv(), count, |row, k| (1.3 * row as f64 + 0.9 * k as f64).cos());
    let halving = users_law("halving", |problem| Frictionless { restitution: 0.5 }.resolve(problem));
    let laws: [&dyn Law<f64, 3>; 5] = [
        &Frictionless { restitution: 0.35 },
        &Energetic { restitution: 0.5, friction: 0.3 },
        &Poisson { restitution: 0.2, friction: 0.8 },
        &Whittaker { restitution: 0.4, friction: 0.2 },
        &halving,
    ];
    let (mut strike, mut single) = (describe().prepare().unwrap(), describe().prepare().unwrap());
    let mut alone = single.outcome();
    let (mut next, mut moved) = (0, 0);
    for law in laws {
        next = 0;
        let done = strike.many(States { q: &read(&q), qd: &read(&qd) }, law, |k, hit| {
            assert_eq!(k, next);
            next += 1;
            let at = |columns: &[Vec<f64>]| columns.iter().map(|c| c[k]).collect::<Vec<_>>();
            let expected = single.resolve_into(&at(&q), &at(&qd), law, &mut alone);
            match (hit, expected) {
                (Ok(hit), Ok(())) => {
                    assert_eq!((hit.mode, hit.flags), (alone.mode, alone.flags));
                    assert_eq!(numbers(hit), numbers(&alone));
                    moved += usize::from(hit.impulse.norm() > 0.0);
                }
                (Err(got), Err(expected)) => assert_eq!(got.to_string(), expected.to_string()),
                (got, expected) => panic!("{got:?} in columns, {expected:?} alone"),
            }
        });
        done.unwrap();
        assert_eq!(next, count);
    }
    (next, moved)
}

#[test]
fn impacts_of_columns_equal_single_impacts_bit_by_bit_for_every_law() {
    // In the plane and in space, rows and trees, on a floating body, and by the recursion for long chains.
    let cases = [("planar2", false), ("planar3", false), ("arm7", false), ("humanoid29", false), ("box", true)];
    let mut chains: Vec<Chain> = cases.iter().map(|(name, floating)| robot_with(name, *floating)).collect();
    chains.push(uniform_chain(50, 3.0, 2.0).unwrap());
    for chain in &chains {
        let frame = chain.frame("tip").or_else(|_| chain.frame("box")).unwrap();
        let damping = vec![2.0; chain.nv()];
        let held = JointModel::Impedance { stiffness: &damping, damping: &damping, contact_time: 0.01 };
        let name = chain.joints()[0].name.clone();
        let locked = [name.as_str()];
        let mut models = vec![JointModel::Free];
        if chain.nv() < 12 && chain.nq() == chain.nv() {
            models.extend([held, JointModel::Locked(&locked)]);
        }
        for joints in models {
            for normal in [[0.6, 0.8, 0.0], [0.6, 0.1, 0.8]] {
                let describe =
                    || chain.impact(&[], &[]).at(frame).offset([0.1, 0.02, 0.05]).normal(normal).joints(joints);
                // Complete blocks and incomplete ones.
                for count in [0, 1, 19, 70] {
                    let (all, moved) = check_columns(chain, &describe, count);
                    assert!(all < 19 || moved > all, "{} of {all}", moved);
                }
            }
        }
    }
}

/// A stretched arm that is struck along its links, and a velocity that is no number, are refused; the states beside them are not.
#[test]
fn refused_states_do_not_refuse_those_beside_them() {
    let arm = uniform_chain(2, 1.0, 1.0).unwrap();
    let up = std::f64::consts::FRAC_PI_2;
    let mut q = columns(2, 21, |row, k| 0.3 + 0.5 * row as f64 + 0.01 * k as f64);
    let mut qd = columns(2, 21, |row, _| [-0.5, -1.0][row]);
    (q[0][5], q[1][5]) = (up, 0.0);
    qd[1][9] = f64::NAN;
    let mut strike = arm.impact(&[], &[]).at(arm.frame("tip").unwrap()).normal([0.0, 1.0, 0.0]).prepare().unwrap();
    let law = Energetic { restitution: 0.5, friction: 0.3 };
    let mut refused = Vec::new();
    let states = States { q: &read(&q), qd: &read(&qd) };
    let done = strike.many(states, &law, |k, hit| match hit {
        Ok(hit) => assert!(hit.energy_after < hit.energy_before && hit.impulse.y > 0.0),
        Err(SimError::SingularNormal { .. }) => refused.push((k, "singular")),
        Err(SimError::Impact { .. }) => refused.push((k, "impact")),
        Err(other) => panic!("{other}"),
    });
    done.unwrap();
    assert_eq!(refused, [(5, "singular"), (9, "impact")]);
    let two = [0.1, 0.2];
    let missing = strike.many(States { q: &[&two], qd: &[&two, &two] }, &law, |_, _| unreachable!());
    assert!(matches!(missing, Err(SimError::Chain(ChainError::WrongLength { .. }))), "{missing:?}");
}

#[test]
fn memory_for_impacts_of_columns_does_not_grow_with_the_number_of_states() {
    for (name, law) in [
        ("planar2", &Energetic { restitution: 0.5, friction: 0.3 } as &dyn Law<f64, 3>),
        ("arm7", &Poisson { restitution: 0.2, friction: 0.8 }),
    ] {
        let chain = robot_with(name, false);
        let tip = chain.frame("tip").unwrap();
        let mut strike = chain.impact(&[], &[]).at(tip).normal([-1.0, 0.0, 0.0]).prepare().unwrap();
        let mut allocations = |count: usize| {
            let q = columns(chain.nq(), count, |row, k| (row as f64 + 0.3 * k as f64).sin());
            let qd = columns(chain.nv(), count, |row, k| (1.3 * row as f64 + 0.9 * k as f64).cos());
            let (q, qd) = (read(&q), read(&qd));
            let each = |_: usize, hit: Result<&ChainImpact, SimError>| assert!(hit.is_ok());
            allocation_counter::measure(|| strike.many(States { q: &q, qd: &qd }, law, each).unwrap()).count_total
        };
        let few = allocations(3);
        assert_eq!(allocations(500), few, "{name}");
    }
}

//! The kernel for sweeps: `jump_into` compared with the recursive kernel, `many` compared with `jump_into`.

use carom_chain::algebra::Algebra;
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, ChainError, Point, uniform_chain};
use carom_sim::{FrictionlessJump, Outcomes, States, frictionless_jump_into};
use nalgebra::{Vector2, Vector3};

fn robot(name: &str, floating_base: bool) -> Chain {
    let file = format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(file).unwrap();
    Chain::from_urdf_str(&text, &LoadOptions { floating_base, ..Default::default() }).unwrap()
}

fn columns(rows: usize, count: usize, f: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..rows).map(|row| (0..count).map(|k| f(row, k)).collect()).collect()
}

fn read(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

fn write(columns: &mut [Vec<f64>]) -> Vec<&mut [f64]> {
    columns.iter_mut().map(Vec::as_mut_slice).collect()
}

/// Every result of `many` with `count` states equals that of `jump_into` bit by bit, and those agree with the recursion.
fn check_batch<A: Algebra<Scalar = f64>>(chain: &Chain<A>, point: Point<A>, normal: A::Vector, count: usize) {
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
    for k in 0..count {
        let at = |columns: &[Vec<f64>]| columns.iter().map(|c| c[k]).collect::<Vec<_>>();
        let (q, qd) = (at(&q), at(&qd));
        kernel.jump_into(&q, &qd, normal, 0.35, &mut jump).unwrap();
        let parts = |v: &A::Vector| (0..linear).map(|i| A::linear_part(*v, i)).collect::<Vec<_>>();
        assert_eq!(at(&qd_plus), jump.qd_plus);
        assert_eq!(at(&impulse), [jump.impulse]);
        let found = jump.memory.response();
        assert_eq!(at(&delassus), found.delassus[..linear].iter().flat_map(parts).collect::<Vec<_>>());
        assert_eq!(at(&jacobian), found.jacobian.iter().flat_map(parts).collect::<Vec<_>>());
        assert_eq!(at(&mass_matrix), found.mass_matrix);

        let mut kin = workspace.update(chain, &q).unwrap();
        let p = frictionless_jump_into(&mut kin, point, normal, 0.35, &qd, &mut scratch, &mut recursive).unwrap();
        // Both have rounding errors of 1e-16 times the condition number of M, some 1e4 for these robots.
        let scale = recursive.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        assert!((p - jump.impulse).abs() <= 1e-11 * p.abs(), "{p} {}", jump.impulse);
        assert!(jump.qd_plus.iter().zip(&recursive).all(|(a, b)| (a - b).abs() <= 1e-11 * scale));
    }
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
        let chain = robot(name, floating);
        let frame = chain.frame(link).unwrap();
        let point = chain.point(frame, Vector3::new(0.1, 0.02, 0.05));
        // Complete blocks and incomplete ones.
        for count in [0, 1, 4, 8, 19, 64, 131] {
            check_batch(&chain, point, Vector3::new(0.6, 0.0, 0.8), count);
        }
        if let Ok(flat) = chain.to_planar() {
            planar.push(name);
            let point = flat.point(frame, Vector3::zeros());
            for count in [1, 70] {
                check_batch(&flat.chain, point, Vector2::new(-0.8, 0.6), count);
            }
        }
    }
    assert_eq!(planar, ["planar2", "planar3"]);
    let long = uniform_chain(12, 3.0, 2.0).unwrap();
    let flat = long.to_planar().unwrap();
    let tip = long.frame("tip").unwrap();
    check_batch(&flat.chain, flat.point(tip, Vector3::zeros()), -Vector2::y(), 9);
}

#[test]
fn columns_of_wrong_number_or_length_are_refused() {
    let chain = robot("planar2", false);
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
}

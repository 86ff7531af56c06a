//! Time of every recursion at 2 to 100 joints, in the plane and in space: `cargo bench -p carom-chain`.
//!
//! Planar chains are uniform thin rods; in spatial ones the hinge axis alternates between z and y. Each measurement repeats
//! one call at one configuration, so that data stay in the cache.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Kinematics, Planar, Point, Spatial, uniform_chain, uniform_chain_urdf};
use divan::{Bencher, black_box};
use nalgebra::{DMatrix, Vector2, Vector3};

const SIZES: [usize; 6] = [2, 3, 7, 10, 30, 100];

fn main() {
    divan::main();
}

struct Case<A: Algebra> {
    chain: Chain<A>,
    tip: Point<A>,
    gravity: A::Vector,
}

fn in_plane(n: usize) -> Case<Planar<f64>> {
    let chain = uniform_chain(n, 1.0, 1.0).unwrap();
    let flat = chain.to_planar().unwrap();
    let tip = flat.point(chain.frame("tip").unwrap(), Vector3::zeros());
    Case { chain: flat.chain, tip, gravity: Vector2::new(0.0, -9.81) }
}

fn in_space(n: usize) -> Case<Spatial<f64>> {
    let urdf = uniform_chain_urdf(n, 1.0, 1.0);
    let parts: Vec<&str> = urdf.split("<axis xyz=\"0 0 1\"/>").collect();
    let axes = ["<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 1 0\"/>"];
    let turned = parts
        .iter()
        .enumerate()
        .fold(String::new(), |text, (i, part)| text + part + if i + 1 < parts.len() { axes[i % 2] } else { "" });
    // Thin rods have no inertia about their own axis, but their hinges are perpendicular to it.
    let chain = Chain::from_urdf_str(&turned, &Default::default()).unwrap();
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    Case { chain, tip, gravity: Vector3::new(0.0, 0.0, -9.81) }
}

/// Times `kernel` on a chain that has been moved to its pose.
fn at_pose<A: Algebra<Scalar = f64>>(
    bencher: Bencher,
    case: Case<A>,
    mut kernel: impl FnMut(&mut Kinematics<A>, &Case<A>, &[f64], &mut [f64]),
) {
    let n = case.chain.nv();
    let q: Vec<f64> = (0..n).map(|i| 0.3 + 0.1 * (i % 5) as f64).collect();
    let mut out = vec![0.0; n];
    let mut ws = case.chain.workspace();
    let mut kin = ws.update(&case.chain, &q).unwrap();
    bencher.bench_local(|| kernel(&mut kin, &case, black_box(&q), &mut out));
}

fn update<A: Algebra<Scalar = f64>>(bencher: Bencher, case: Case<A>) {
    let q: Vec<f64> = (0..case.chain.nv()).map(|i| 0.3 + 0.1 * (i % 5) as f64).collect();
    let mut ws = case.chain.workspace();
    bencher.bench_local(|| ws.update(&case.chain, black_box(&q)).unwrap().position(case.tip));
}

macro_rules! kernels {
    ($($algebra:ident: $case:ident, $rows:literal;)*) => {$(
        #[divan::bench_group]
        mod $algebra {
            use super::*;

            #[divan::bench(args = SIZES)]
            fn kinematics(bencher: Bencher, n: usize) {
                update(bencher, $case(n));
            }
            #[divan::bench(args = SIZES)]
            fn point_jacobian(bencher: Bencher, n: usize) {
                let mut j = DMatrix::zeros($rows, n);
                at_pose(bencher, $case(n), |kin, case, _, _| kin.point_jacobian_into(case.tip, &mut j));
            }
            #[divan::bench(args = SIZES)]
            fn mass_matrix_crba(bencher: Bencher, n: usize) {
                let mut m = DMatrix::zeros(n, n);
                at_pose(bencher, $case(n), |kin, _, _, _| kin.mass_matrix_into(&mut m));
            }
            #[divan::bench(args = SIZES)]
            fn inverse_dynamics_rnea(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, case, qd, out| {
                    kin.inverse_dynamics_into(qd, qd, case.gravity, out).unwrap();
                });
            }
            #[divan::bench(args = SIZES)]
            fn forward_dynamics_aba(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, case, qd, out| {
                    kin.articulate().unwrap().forward_dynamics_into(qd, qd, case.gravity, out).unwrap();
                });
            }
            #[divan::bench(args = SIZES)]
            fn response_articulated(bencher: Bencher, n: usize) {
                let mut row = vec![0.0; n];
                at_pose(bencher, $case(n), |kin, case, _, out| {
                    kin.articulate().unwrap().respond_along(case.tip, case.gravity, &mut row, out).unwrap();
                });
            }
            #[divan::bench(args = SIZES)]
            fn delassus_recursive(bencher: Bencher, n: usize) {
                let mut h = DMatrix::zeros($rows, $rows);
                at_pose(bencher, $case(n), |kin, case, _, _| {
                    kin.articulate().unwrap().delassus_into(case.tip, &mut h);
                });
            }
            #[divan::bench(args = SIZES)]
            fn contact(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, case, _, _| {
                    black_box(kin.contact(case.tip, case.gravity, &[]).unwrap().mobility);
                });
            }
            #[divan::bench(args = SIZES)]
            fn kinetic_energy(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, _, qd, _| {
                    black_box(kin.kinetic_energy(qd).unwrap());
                });
            }
            #[divan::bench(args = SIZES)]
            fn point_drift(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, case, qd, _| {
                    black_box(kin.point_drift(case.tip, qd).unwrap());
                });
            }
            #[divan::bench(args = SIZES)]
            fn gravity_force(bencher: Bencher, n: usize) {
                at_pose(bencher, $case(n), |kin, case, _, _| {
                    black_box(kin.gravity_force(case.gravity));
                });
            }
        }
    )*};
}

kernels!(planar: in_plane, 2; space: in_space, 3;);

//! The quantities of the paper in one benchmark: kinematics, J, M, H and the frictionless jump, one configuration at a time,
//! for the URDFs in `robots/`: `cargo bench -p carom-sim`.
//!
//! `*_jump` computes only what the impact needs (kinematics and the O(n) recursion); `*_lanes4` computes it for four
//! configurations at once (divide by four).

use carom_chain::algebra::{Algebra, Real};
use carom_chain::{Chain, Planar, Point, Spatial, uniform_chain};
use carom_impact::{Energetic, Frictionless, Law};
use carom_sim::{Impacts, frictionless_jump_into};
use divan::{Bencher, black_box};
use nalgebra::{DMatrix, Vector2, Vector3};
use simba::simd::WideF64x4;

fn main() {
    divan::main();
}

fn robot(name: &str) -> Chain {
    let chain = match name {
        "chain29" => uniform_chain(29, 1.0, 1.0),
        "chain100" => uniform_chain(100, 1.0, 1.0),
        _ => Chain::from_urdf_file(format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"))),
    };
    chain.unwrap()
}

struct Case<A: Algebra> {
    chain: Chain<A>,
    tip: Point<A>,
    normal: A::Vector,
}

fn planar<T: Real>(name: &str) -> Case<Planar<T>> {
    let chain = robot(name);
    let flat = chain.to_planar().unwrap();
    let cast = flat.chain.cast::<T>();
    let tip = cast.point(cast.frame("tip").unwrap(), Vector2::zeros());
    Case { chain: cast, tip, normal: Vector2::new(-T::one(), T::zero()) }
}

fn space<T: Real>(name: &str) -> Case<Spatial<T>> {
    let chain = robot(name).cast::<T>();
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    Case { chain, tip, normal: Vector3::new(-T::one(), T::zero(), T::zero()) }
}

fn state<T: Real>(n: usize) -> Vec<T> {
    (0..n).map(|i| nalgebra::convert(0.3 + 0.1 * (i % 5) as f64)).collect()
}

fn whole<A: Algebra>(bencher: Bencher, case: Case<A>) {
    let n = case.chain.nv();
    let q: Vec<A::Scalar> = state(n);
    let (mut scratch, mut qd_plus) = (q.clone(), q.clone());
    let mut ws = case.chain.workspace();
    let mut j = DMatrix::zeros(A::LINEAR, n);
    let mut m = DMatrix::zeros(n, n);
    let mut h = DMatrix::zeros(A::LINEAR, A::LINEAR);
    let e = nalgebra::convert(0.35);
    bencher.bench_local(|| {
        let q = black_box(&q);
        let mut kin = ws.update(&case.chain, q).unwrap();
        kin.point_jacobian_into(case.tip, &mut j);
        kin.mass_matrix_into(&mut m);
        frictionless_jump_into(&mut kin, case.tip, case.normal, e, q, &mut scratch, &mut qd_plus).unwrap();
        kin.articulate().unwrap().delassus_into(case.tip, &mut h);
    });
}

fn jump<A: Algebra>(bencher: Bencher, case: Case<A>) {
    let q: Vec<A::Scalar> = state(case.chain.nv());
    let (mut scratch, mut qd_plus) = (q.clone(), q.clone());
    let mut ws = case.chain.workspace();
    let e = nalgebra::convert(0.35);
    bencher.bench_local(|| {
        let q = black_box(&q);
        let mut kin = ws.update(&case.chain, q).unwrap();
        frictionless_jump_into(&mut kin, case.tip, case.normal, e, q, &mut scratch, &mut qd_plus).unwrap()
    });
}

const FLAT: [&str; 4] = ["planar2", "planar3", "chain29", "chain100"];
const ALL: [&str; 5] = ["planar2", "planar3", "arm7", "chain29", "chain100"];

#[divan::bench(args = FLAT)]
fn planar_chain(bencher: Bencher, name: &str) {
    whole(bencher, planar::<f64>(name));
}
#[divan::bench(args = FLAT)]
fn planar_jump(bencher: Bencher, name: &str) {
    jump(bencher, planar::<f64>(name));
}
#[divan::bench(args = FLAT)]
fn planar_jump_lanes4(bencher: Bencher, name: &str) {
    jump(bencher, planar::<WideF64x4>(name));
}
#[divan::bench(args = ALL)]
fn space_chain(bencher: Bencher, name: &str) {
    whole(bencher, space::<f64>(name));
}
#[divan::bench(args = ALL)]
fn space_jump(bencher: Bencher, name: &str) {
    jump(bencher, space::<f64>(name));
}
#[divan::bench(args = ALL)]
fn space_jump_lanes4(bencher: Bencher, name: &str) {
    jump(bencher, space::<WideF64x4>(name));
}

/// The checked interface: allocates, validates all inputs, detects singular directions.
#[divan::bench(args = ["planar2", "planar3", "arm7"])]
fn checked_strike_frictionless(bencher: Bencher, name: &str) {
    checked(bencher, name, &Frictionless { restitution: 0.35 });
}
#[divan::bench(args = ["planar2", "planar3", "arm7"])]
fn checked_strike_energetic(bencher: Bencher, name: &str) {
    checked(bencher, name, &Energetic { restitution: 0.35, friction: 0.2 });
}

fn checked(bencher: Bencher, name: &str, law: &dyn Law<f64, 3>) {
    let chain = robot(name);
    let tip = chain.frame("tip").unwrap();
    let q: Vec<f64> = state(chain.nv());
    bencher.bench_local(|| chain.impact(&q, &q).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law).unwrap());
}

/// The same with all derivatives of qd⁺ with respect to q, qd⁻, e and μ. Divide by the time of the impact above.
#[divan::bench(args = ["planar2", "planar3", "arm7"])]
fn derivative_frictionless(bencher: Bencher, name: &str) {
    derivative(bencher, name, &Frictionless { restitution: 0.35 });
}
#[divan::bench(args = ["planar2", "planar3", "arm7"])]
fn derivative_energetic(bencher: Bencher, name: &str) {
    derivative(bencher, name, &Energetic { restitution: 0.35, friction: 0.2 });
}

fn derivative(bencher: Bencher, name: &str, law: &dyn Law<f64, 3>) {
    let chain = robot(name);
    let tip = chain.frame("tip").unwrap();
    let q: Vec<f64> = state(chain.nv());
    bencher.bench_local(|| chain.impact(&q, &q).at(tip).normal([-1.0, 0.0, 0.0]).derivative(law).unwrap());
}

//! The recursions over f32, SIMD lanes and dual numbers, compared with f64.

use crate::common::{Zoo, close, sample};
use carom_chain::algebra::{Algebra, Real};
use carom_chain::{Chain, Kinematics, Spatial};
use nalgebra::{SimdValue, Vector3};
use num_dual::{Dual2_64, Dual64};
use simba::simd::{WideF32x8, WideF64x4};

/// M, bias, forward dynamics and H, in one vector.
fn everything<T: Real>(
    kin: &mut Kinematics<Spatial<T>>,
    tip: carom_chain::Point<Spatial<T>>,
    qd: &[T],
    tau: &[T],
) -> Vec<T> {
    let gravity = Vector3::new(T::zero(), T::zero(), nalgebra::convert(-9.81));
    let mut all: Vec<T> = kin.mass_matrix().iter().copied().collect();
    all.extend(kin.bias(qd, gravity).unwrap().iter());
    let mut qdd = vec![T::zero(); qd.len()];
    let mut articulation = kin.articulate().unwrap();
    articulation.forward_dynamics_into(qd, tau, gravity, &mut qdd).unwrap();
    all.extend(qdd);
    all.extend(articulation.delassus(tip).iter());
    all
}

fn at<T: Real>(chain: &Chain, q: &[T], qd: &[T], tau: &[T]) -> Vec<T>
where
    Spatial<f64>: Algebra<Scalar = f64, Cast<T> = Spatial<T>>,
{
    let chain = chain.cast::<T>();
    let tip = chain.point(chain.frame(&chain.frames().last().unwrap().name).unwrap(), Vector3::zeros());
    let mut ws = chain.workspace();
    let mut kin = ws.update(&chain, q).unwrap();
    everything(&mut kin, tip, qd, tau)
}

#[test]
fn each_of_four_f64_lanes_equals_the_scalar_result() {
    for seed in 0..40 {
        let mut s = sample(7, Zoo::Uncoupled, seed);
        let states: Vec<_> = (0..4).map(|_| (s.q(), s.v(), s.v())).collect();
        let lanes = |pick: &dyn Fn(usize) -> Vec<f64>| -> Vec<WideF64x4> {
            let rows: Vec<Vec<f64>> = (0..4).map(pick).collect();
            (0..rows[0].len()).map(|i| WideF64x4::from([rows[0][i], rows[1][i], rows[2][i], rows[3][i]])).collect()
        };
        let together = at(
            &s.chain,
            &lanes(&|k| states[k].0.clone()),
            &lanes(&|k| states[k].1.clone()),
            &lanes(&|k| states[k].2.clone()),
        );
        for (k, (q, qd, tau)) in states.iter().enumerate() {
            let alone = at(&s.chain, q, qd, tau);
            let lane: Vec<f64> = together.iter().map(|x| x.extract(k)).collect();
            // Lanes may use another sine: rounding of the angles, with the tolerance of two_routes.rs.
            blocks(&s.chain, "lane", &lane, &alone, 1e-10);
        }
    }
}

/// Compares M, bias, q̈ and H, each relative to its largest entry.
fn blocks(chain: &Chain, name: &str, got: &[f64], want: &[f64], tolerance: f64) {
    let n = chain.nv();
    let ends = [n * n, n * n + n, n * n + 2 * n, want.len()];
    let mut start = 0;
    for (block, end) in ["M", "bias", "qdd", "H"].into_iter().zip(ends) {
        close(&format!("{name} {block}"), &got[start..end], &want[start..end], tolerance, 1e-3);
        start = end;
    }
}

#[test]
fn f32_and_its_lanes_equal_f64_to_single_precision() {
    for seed in 0..40 {
        let mut s = sample(4, Zoo::Uncoupled, seed);
        let (q, qd, tau) = (s.q(), s.v(), s.v());
        let m = s.chain.workspace().update(&s.chain, &q).unwrap().mass_matrix();
        let eigenvalues = m.symmetric_eigenvalues();
        // A few hundred roundings of 6e-8, times the condition number of M.
        let tolerance = 2e-5 * eigenvalues.max() / eigenvalues.min();
        if tolerance > 0.1 {
            continue; // M of this chain is too ill-conditioned for f32
        }
        let alone = at(&s.chain, &q, &qd, &tau);
        let single = |x: &[f64]| -> Vec<f32> { x.iter().map(|&x| x as f32).collect() };
        let in_f32: Vec<f64> =
            at(&s.chain, &single(&q), &single(&qd), &single(&tau)).iter().map(|&x| f64::from(x)).collect();
        blocks(&s.chain, "f32", &in_f32, &alone, tolerance);
        let wide = |x: &[f64]| -> Vec<WideF32x8> { x.iter().map(|&x| WideF32x8::splat(x as f32)).collect() };
        let in_lanes = at(&s.chain, &wide(&q), &wide(&qd), &wide(&tau));
        for k in 0..8 {
            let lane: Vec<f64> = in_lanes.iter().map(|x| f64::from(x.extract(k))).collect();
            blocks(&s.chain, "f32 lane", &lane, &alone, tolerance);
        }
    }
}

#[test]
fn values_of_dual_numbers_equal_f64_exactly() {
    for seed in 0..40 {
        let mut s = sample(6, Zoo::Uncoupled, seed);
        // f64 uses the sine of `carom_chain::sine`, which can differ from the library's in the last digit. Some states have
        // equal sines for all joints; there all results must be equal.
        let unchanged = (0..200).any(|_| {
            let (q, qd, tau) = (s.q(), s.v(), s.v());
            let dual = |x: &[f64]| -> Vec<Dual64> { x.iter().map(|&x| Dual64::from(x)).collect() };
            let with_duals = at(&s.chain, &dual(&q), &dual(&qd), &dual(&tau));
            let alone = at(&s.chain, &q, &qd, &tau);
            with_duals.iter().zip(&alone).all(|(x, alone)| x.re == *alone)
        });
        assert!(unchanged, "seed {seed}");
    }
}

#[test]
fn first_and_second_order_duals_have_equal_values() {
    for seed in 0..40 {
        let mut s = sample(6, Zoo::Uncoupled, seed);
        let (q, qd, tau) = (s.q(), s.v(), s.v());
        let once = |x: &[f64]| -> Vec<Dual64> { x.iter().map(|&x| Dual64::from(x)).collect() };
        let twice = |x: &[f64]| -> Vec<Dual2_64> { x.iter().map(|&x| Dual2_64::from(x)).collect() };
        let first: Vec<f64> = at(&s.chain, &once(&q), &once(&qd), &once(&tau)).iter().map(|x| x.re).collect();
        let second: Vec<f64> = at(&s.chain, &twice(&q), &twice(&qd), &twice(&tau)).iter().map(|x| x.re).collect();
        assert_eq!(first, second);
        // f64 uses another sine: rounding of the angles, as for lanes.
        blocks(&s.chain, "dual", &first, &at(&s.chain, &q, &qd, &tau), 1e-10);
    }
}

#[test]
fn rounding_errors_of_long_chains_are_bounded() {
    // Errors of f32 compared with f64, in units of the ε of f32: of M relative to the diagonal, of τ relative to the largest
    // of the joints beyond, of q̈ relative to its largest entry. Without base inertial parameters the errors were 15, 78 and
    // 18 ε at 100 links; the bounds are twice that.
    for n in [10, 30, 100] {
        let chain = carom_chain::uniform_chain(n, 1.0, 1.0).unwrap();
        let in_f32 = chain.cast::<f32>();
        let (mut ws, mut ws32) = (chain.workspace(), in_f32.workspace());
        let mut rng = fastrand::Rng::with_seed(5);
        let epsilon = f64::from(f32::EPSILON);
        for _ in 0..20 {
            let random = |rng: &mut fastrand::Rng| -> Vec<f32> { (0..n).map(|_| rng.f32() * 4.0 - 2.0).collect() };
            let (q32, qd32) = (random(&mut rng), random(&mut rng));
            let wide = |x: &[f32]| -> Vec<f64> { x.iter().map(|&x| f64::from(x)).collect() };
            let (q, qd) = (wide(&q32), wide(&qd32));
            let (gravity, gravity32) = (Vector3::new(0.0, -9.75, 0.0), Vector3::new(0.0, -9.75_f32, 0.0));
            let mut kin = ws.update(&chain, &q).unwrap();
            let mut kin32 = ws32.update(&in_f32, &q32).unwrap();

            let (m, m32) = (kin.mass_matrix(), kin32.mass_matrix());
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let lost = (m[(i, j)] - f64::from(m32[(i, j)])).abs() / (m[(i, i)] * m[(j, j)]).sqrt();
                assert!(lost <= 30.0 * epsilon, "M({i}, {j}) of {n}: {} ε", lost / epsilon);
            }
            let tau = kin.inverse_dynamics(&qd, &qd, gravity).unwrap();
            let tau32 = kin32.inverse_dynamics(&qd32, &qd32, gravity32).unwrap();
            for i in 0..n {
                let lost = (tau[i] - f64::from(tau32[i])).abs() / tau.rows(i, n - i).amax();
                assert!(lost <= 160.0 * epsilon, "τ({i}) of {n}: {} ε", lost / epsilon);
            }
            let (mut qdd, mut qdd32) = (vec![0.0; n], vec![0.0; n]);
            kin.articulate().unwrap().forward_dynamics_into(&qd, &qd, gravity, &mut qdd).unwrap();
            kin32.articulate().unwrap().forward_dynamics_into(&qd32, &qd32, gravity32, &mut qdd32).unwrap();
            let largest = qdd.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
            for i in 0..n {
                let lost = (qdd[i] - f64::from(qdd32[i])).abs() / largest;
                assert!(lost <= 36.0 * epsilon, "q̈({i}) of {n}: {} ε", lost / epsilon);
            }
        }
    }
}

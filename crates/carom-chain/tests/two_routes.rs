//! Every quantity, computed by two methods, for random chains of 1 to 12 joints of all types.
//!
//! Tolerances: a chain of n bodies needs a few hundred operations per body, each with a rounding error of ε = 2.2e-16 of its
//! operands. Masses differ by a factor of up to 30, and poses are not near singular ones, so results agree to about 1e3·ε of
//! their largest entry. Solves with M lose accuracy by its condition number (up to about 1e4).

use crate::common::{Sample, Zoo, close, q_rate, robot, sample, solve};
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, Kinematics, Spatial};
use nalgebra::{DMatrix, DVector, Vector3};
use num_dual::Dual64;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const KINEMATIC: f64 = 1e-12;
const GRAVITY: Vector3<f64> = Vector3::new(0.7, -1.1, -9.81);

/// Relative tolerance of a solve with M: 1e3·ε times its condition number.
fn solved(m: &DMatrix<f64>) -> f64 {
    let eigenvalues = m.clone().symmetric_eigenvalues();
    1e3 * f64::EPSILON * eigenvalues.max() / eigenvalues.min()
}

fn zoo() -> impl Strategy<Value = Sample> {
    (1..=12_usize, any::<u64>()).prop_map(|(n, seed)| sample(n, Zoo::All, seed))
}

/// A robot with a floating base.
fn floating(joints: usize, seed: u64) -> Sample {
    let mut rng = fastrand::Rng::with_seed(seed);
    let options = LoadOptions { floating_base: true, ..Default::default() };
    Sample { chain: Chain::from_robot(robot(joints, Zoo::Uncoupled, &mut rng), &options), rng }
}

fn tip(s: &mut Sample) -> carom_chain::Point<Spatial<f64>> {
    let last = s.chain.frames().last().unwrap().name.clone();
    let offset = s.vector();
    s.chain.point(s.chain.frame(&last).unwrap(), offset)
}

/// Evaluates the chain at q, moving with qd, in dual numbers: the ε part is the time derivative.
fn moving<R>(chain: &Chain, q: &[f64], qd: &[f64], read: impl FnOnce(&mut Kinematics<Spatial<Dual64>>) -> R) -> R {
    let dual = chain.cast::<Dual64>();
    let q: Vec<Dual64> = q.iter().zip(q_rate(chain, q, qd)).map(|(&x, dx)| Dual64::new(x, dx)).collect();
    let mut ws = dual.workspace();
    read(&mut ws.update(&dual, &q).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(2004), ..ProptestConfig::with_cases(400) })]

    #[test]
    fn crba_equals_the_columns_of_rnea(mut s in zoo()) {
        let q = s.q();
        let nv = s.chain.nv();
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let m = kin.mass_matrix();
        for j in 0..nv {
            let mut qdd = vec![0.0; nv];
            qdd[j] = 1.0;
            let column = kin.inverse_dynamics(&vec![0.0; nv], &qdd, Vector3::zeros()).unwrap();
            close("column", column.iter(), m.column(j).iter(), KINEMATIC, m.amax());
        }
        prop_assert_eq!(&m, &m.transpose());
    }

    #[test]
    fn inverse_dynamics_is_mass_times_acceleration_plus_bias(mut s in zoo()) {
        let (q, qd, qdd) = (s.q(), s.v(), s.v());
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let bias = kin.bias(&qd, GRAVITY).unwrap();
        let by_parts = kin.mass_matrix() * DVector::from_column_slice(&qdd) + &bias;
        let tau = kin.inverse_dynamics(&qd, &qdd, GRAVITY).unwrap();
        close("tau", tau.iter(), by_parts.iter(), KINEMATIC, bias.amax().max(1.0) * 10.0);
        let still = kin.bias(&vec![0.0; s.chain.nv()], GRAVITY).unwrap();
        let held = kin.gravity_force(GRAVITY);
        close("gravity", held.iter(), still.iter(), KINEMATIC, 10.0);
    }

    #[test]
    fn forward_dynamics_solves_the_equation_of_motion(mut s in zoo()) {
        let (q, qd, tau) = (s.q(), s.v(), s.v());
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let qdd = kin.forward_dynamics(&qd, &tau, GRAVITY).unwrap();
        let left = DVector::from_column_slice(&tau) - kin.bias(&qd, GRAVITY).unwrap();
        let m = kin.mass_matrix();
        // Backward error: M q̈ equals τ − bias to rounding, independently of M's condition number.
        close("M qdd", (&m * &qdd).iter(), left.iter(), 1e-11, m.amax() * qdd.amax());
        let dense = m.clone().cholesky().unwrap().solve(&left);
        close("qdd", qdd.iter(), dense.iter(), solved(&m), 1.0);
    }

    #[test]
    fn rows_solved_together_equal_each_one_alone(mut s in zoo(), count in 1..=9_usize) {
        let (q, nv) = (s.q(), s.chain.nv());
        // Every second row acts on one joint only, as that of a joint limit.
        let one = |k: usize| (0..nv).map(|v| if v == k % nv { 1.0 } else { 0.0 }).collect();
        let rows: Vec<Vec<f64>> = (0..count).map(|k| if k % 2 == 1 { s.v() } else { one(k) }).collect();
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let m = kin.mass_matrix();
        let (mut all, mut responses) = (carom_chain::Rows::new(nv), carom_chain::Rows::default());
        rows.iter().for_each(|row| all.add().copy_from_slice(row));
        kin.respond(&all, &mut responses).unwrap();
        prop_assert_eq!(responses.len(), count);
        for (k, row) in rows.iter().enumerate() {
            let alone = solve(&mut kin, row).unwrap();
            let (response, size) = (DVector::from_column_slice(responses.row(k)), alone.amax());
            close("alone", response.iter(), alone.iter(), solved(&m), size);
            close("M x", (&m * &response).iter(), row.iter(), 1e-11, m.amax() * size);
        }
    }

    #[test]
    fn inertia_added_to_coordinates_is_added_to_the_diagonal_of_the_mass_matrix(mut s in zoo()) {
        let (q, qd, tau, row, nv) = (s.q(), s.v(), s.v(), s.v(), s.chain.nv());
        let added: Vec<f64> = s.v().iter().map(|x| x.abs()).collect();
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let m = kin.mass_matrix() + DMatrix::from_diagonal(&DVector::from_column_slice(&added));
        let left = DVector::from_column_slice(&tau) - kin.bias(&qd, GRAVITY).unwrap();
        let (mut rows, mut responses) = (carom_chain::Rows::new(nv), carom_chain::Rows::default());
        rows.add().copy_from_slice(&row);
        let mut qdd = vec![0.0; nv];
        kin.accelerate_and_respond((&qd, &tau, GRAVITY), &added, &mut qdd, &rows, &mut responses).unwrap();
        let dense = m.clone().cholesky().unwrap();
        close("qdd", qdd.iter(), dense.solve(&left).iter(), solved(&m), 1.0);
        let response = dense.solve(&DVector::from_column_slice(&row));
        close("response", responses.row(0).iter(), response.iter(), solved(&m), 1.0);
    }

    #[test]
    fn recursive_delassus_equals_dense(mut s in zoo()) {
        let (q, tip) = (s.q(), tip(&mut s));
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let j = kin.point_jacobian(tip);
        let m = kin.mass_matrix();
        let h = &j * m.clone().cholesky().unwrap().solve(&j.transpose());
        if !s.chain.is_coupled() {
            close("H", kin.articulate().unwrap().delassus(tip).iter(), h.iter(), solved(&m), 1e-300);
        }
        close("H fused", kin.delassus(tip).unwrap().iter(), h.iter(), solved(&m), 1e-300);
        let inertia = kin.contact_inertia(tip).unwrap();
        close("contact", inertia.delassus.iter(), h.iter(), solved(&m), 1e-300);
        prop_assert_eq!(inertia.rank, j.svd(false, false).rank(1e-12));
        // the effective mass is 1/nᵀHn in every direction that is not singular
        let n = s.vector().normalize();
        let c = (n.transpose() * &h * n)[0];
        if let Some(mass) = inertia.effective_mass(n.as_slice()) {
            prop_assert!((mass * c - 1.0).abs() < 1e-6 * (h.amax() / c).sqrt(), "{} {}", mass, c);
        }
    }

    #[test]
    fn jacobian_is_the_derivative_of_position(mut s in zoo()) {
        let (q, qd, tip) = (s.q(), s.v(), tip(&mut s));
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let v = kin.point_velocity(tip, &qd).unwrap();
        let by_columns = kin.point_jacobian(tip) * DVector::from_column_slice(&qd);
        close("J qd", by_columns.iter(), v.iter(), KINEMATIC, 1.0);
        let frame = s.chain.frame(&s.chain.frames().last().unwrap().name).unwrap();
        let origin = s.chain.point(frame, Vector3::zeros());
        let six = kin.geometric_jacobian(frame) * DVector::from_column_slice(&qd);
        close("linear rows", six.rows(3, 3).iter(), kin.point_velocity(origin, &qd).unwrap().iter(), KINEMATIC, 1.0);
        let drift = kin.point_drift(tip, &qd).unwrap();
        let r = kin.pose(frame).rotation;

        let dual_tip = s.chain.cast::<Dual64>().point(frame, tip_offset(&s.chain, tip));
        let (rate, jacobian_rate, spin) = moving(&s.chain, &q, &qd, |kin| {
            let r = kin.pose(frame).rotation;
            (kin.position(dual_tip).map(|x| x.eps), kin.point_jacobian(dual_tip).map(|x| x.eps), r.map(|x| x.eps))
        });
        close("dp/dt", rate.iter(), v.iter(), KINEMATIC, 1.0);
        let j_dot_qd = jacobian_rate * DVector::from_column_slice(&qd);
        close("dJ/dt qd", j_dot_qd.iter(), drift.iter(), KINEMATIC, 10.0);
        // Ṙ Rᵀ = ω×
        let omega = spin * r.transpose();
        let angular = [omega[(2, 1)], omega[(0, 2)], omega[(1, 0)]];
        close("angular rows", six.rows(0, 3).iter(), angular.iter(), KINEMATIC, 1.0);
    }

    #[test]
    fn duals_of_the_mass_matrix_equal_finite_differences(mut s in zoo()) {
        let (q, qd) = (s.q(), s.v());
        let exact = moving(&s.chain, &q, &qd, |kin| kin.mass_matrix().map(|x| x.eps));
        let h = 1e-5;
        let at = |t: f64| {
            let moved = s.chain.integrate(&q, &qd, t).unwrap();
            s.chain.workspace().update(&s.chain, &moved).unwrap().mass_matrix()
        };
        let central: DMatrix<f64> = (at(h) - at(-h)) / (2.0 * h);
        // Error of central differences: h² times the third derivative, and ε/h times the entry.
        close("dM/dt", central.iter(), exact.iter(), 1e-6, at(0.0).amax() * 10.0);
        // Conservation of energy: q̇ᵀ(C q̇) = ½ q̇ᵀ Ṁ q̇.
        let qd_ = DVector::from_column_slice(&qd);
        let work = s.chain.workspace().update(&s.chain, &q).unwrap().bias(&qd, Vector3::zeros()).unwrap().dot(&qd_);
        let needed = 0.5 * (qd_.transpose() * &exact * &qd_)[0];
        close("power", [work].iter(), [needed].iter(), KINEMATIC, 10.0 * at(0.0).amax());
    }

    #[test]
    fn energies_agree_with_mass_matrix_and_gravity(mut s in zoo()) {
        let (q, qd) = (s.q(), s.v());
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let t = kin.kinetic_energy(&qd).unwrap();
        let qd_ = DVector::from_column_slice(&qd);
        let by_matrix = 0.5 * (qd_.transpose() * kin.mass_matrix() * &qd_)[0];
        close("T", [t].iter(), [by_matrix].iter(), KINEMATIC, 1e-3);
        let power = kin.gravity_force(GRAVITY).dot(&qd_);
        let gravity = GRAVITY.map(|x| Dual64::new(x, 0.0));
        let rate = moving(&s.chain, &q, &qd, |kin| kin.potential_energy(gravity).eps);
        close("dV/dt", [rate].iter(), [power].iter(), KINEMATIC, 10.0);
    }

    #[test]
    fn momentum_rate_of_a_free_robot_equals_its_weight((n, seed) in (0..=8_usize, any::<u64>())) {
        let mut s = floating(n, seed);
        let (q, qd) = (s.q(), s.v());
        let qdd = s.chain.workspace().update(&s.chain, &q).unwrap()
            .forward_dynamics(&qd, &vec![0.0; s.chain.nv()], GRAVITY).unwrap();
        let qd_dual: Vec<Dual64> = qd.iter().zip(qdd.iter()).map(|(&x, &dx)| Dual64::new(x, dx)).collect();
        let (rate, mass_at) = moving(&s.chain, &q, &qd, |kin| {
            let momentum = kin.momentum(&qd_dual).unwrap();
            let mass_at = kin.momentum(&vec![Dual64::from(0.0); qd.len()]).unwrap();
            (momentum, mass_at.force.map(|x| x.re))
        });
        prop_assert_eq!(mass_at, Vector3::zeros());
        // Σ force = total mass · gravity, though the internal motion is not small.
        let weight = GRAVITY * s.chain.total_mass();
        let m = s.chain.workspace().update(&s.chain, &q).unwrap().mass_matrix();
        close("dp/dt", rate.force.map(|x| x.eps).iter(), weight.iter(), solved(&m), qdd.amax().max(1.0));
        prop_assert!(rate.force.map(|x| x.re).norm() > 0.0, "the robot moves");
    }

    #[test]
    fn planar_chains_equal_their_chains_in_space((n, seed) in (1..=12_usize, any::<u64>())) {
        let mut s = sample(n, Zoo::Plane, seed);
        let (q, qd, tau, offset) = (s.q(), s.v(), s.v(), s.vector());
        let flat = s.chain.to_planar().unwrap();
        let frame = s.chain.frame(&s.chain.frames().last().unwrap().name.clone()).unwrap();
        let (tip, flat_tip) = (s.chain.point(frame, offset), flat.point(frame, offset));
        let (mut ws, mut flat_ws) = (s.chain.workspace(), flat.chain.workspace());
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let mut flat_kin = flat_ws.update(&flat.chain, &q).unwrap();
        let plane = flat.plane;
        close("p", flat_kin.position(flat_tip).iter(), plane.project(kin.position(tip)).iter(), KINEMATIC, 1.0);
        let (pose, lifted) = (kin.pose(frame), flat.lift_pose(frame, &flat_kin.pose(frame)));
        close("rotation", lifted.rotation.iter(), pose.rotation.iter(), KINEMATIC, 1.0);
        close("translation", lifted.translation.iter(), pose.translation.iter(), KINEMATIC, 1.0);
        let m = kin.mass_matrix();
        close("M", flat_kin.mass_matrix().iter(), m.iter(), KINEMATIC, 1e-3);
        let shadow = nalgebra::Matrix2x3::from_rows(&[plane.x.transpose(), plane.y.transpose()]);
        let j = shadow * kin.point_jacobian(tip);
        close("J", flat_kin.point_jacobian(flat_tip).iter(), j.iter(), KINEMATIC, 1.0);
        let bias = kin.bias(&qd, GRAVITY).unwrap();
        close("bias", flat_kin.bias(&qd, plane.project(GRAVITY)).unwrap().iter(), bias.iter(), KINEMATIC, 100.0);
        let drift = plane.project(kin.point_drift(tip, &qd).unwrap());
        close("drift", flat_kin.point_drift(flat_tip, &qd).unwrap().iter(), drift.iter(), KINEMATIC, 10.0);
        let qdd = kin.forward_dynamics(&qd, &tau, GRAVITY).unwrap();
        let flat_qdd = flat_kin.forward_dynamics(&qd, &tau, plane.project(GRAVITY)).unwrap();
        close("qdd", flat_qdd.iter(), qdd.iter(), solved(&m), 1.0);
        let h = kin.delassus(tip).unwrap();
        let flat_h = flat_kin.delassus(flat_tip).unwrap();
        let axes = [plane.x, plane.y];
        for a in 0..2 {
            for b in 0..2 {
                let lifted = (axes[a].transpose() * &h * axes[b])[0];
                close("H", [flat_h[(a, b)]].iter(), [lifted].iter(), solved(&m), h.amax());
            }
        }
    }

    #[test]
    fn locked_chain_equals_the_full_chain_with_those_joints_at_rest((n, seed) in (2..=12_usize, any::<u64>())) {
        let mut s = sample(n, Zoo::All, seed);
        let (q, mut qd, tip_offset) = (s.q(), s.v(), s.vector());
        let own: Vec<(String, Vec<f64>, std::ops::Range<usize>)> = s.chain.joints().iter().filter_map(|j| match &j.coordinates {
            carom_chain::Coordinates::Own { q: at, v } => Some((j.name.clone(), q[at.clone()].to_vec(), v.clone())),
            _ => None,
        }).collect();
        let held: Vec<_> = own.iter().filter(|_| s.rng.bool()).collect();
        for (_, _, v) in &held {
            qd[v.clone()].fill(0.0);
        }
        let names: Vec<(&str, &[f64])> = held.iter().map(|h| (h.0.as_str(), h.1.as_slice())).collect();
        let less = s.chain.lock(&names).unwrap();
        prop_assert_eq!(less.chain.nv(), s.chain.nv() - held.iter().map(|h| h.2.len()).sum::<usize>());
        let (q_less, qd_less): (Vec<f64>, Vec<f64>) =
            (less.q.iter().map(|&i| q[i]).collect(), less.v.iter().map(|&i| qd[i]).collect());
        let name = s.chain.frames().last().unwrap().name.clone();
        let tip = s.chain.point(s.chain.frame(&name).unwrap(), tip_offset);
        let tip_less = less.chain.point(less.chain.frame(&name).unwrap(), tip_offset);
        let (mut ws, mut ws_less) = (s.chain.workspace(), less.chain.workspace());
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let mut kin_less = ws_less.update(&less.chain, &q_less).unwrap();
        let m = kin.mass_matrix();
        let sub = DMatrix::from_fn(less.v.len(), less.v.len(), |i, j| m[(less.v[i], less.v[j])]);
        close("M", kin_less.mass_matrix().iter(), sub.iter(), 1e-11, m.amax());
        close("tip", kin_less.position(tip_less).iter(), kin.position(tip).iter(), KINEMATIC, 1.0);
        let v = kin.point_velocity(tip, &qd).unwrap();
        close("v", kin_less.point_velocity(tip_less, &qd_less).unwrap().iter(), v.iter(), KINEMATIC, 1.0);
        let bias = kin.bias(&qd, GRAVITY).unwrap();
        let bias_sub: Vec<f64> = less.v.iter().map(|&i| bias[i]).collect();
        close("bias", kin_less.bias(&qd_less, GRAVITY).unwrap().iter(), bias_sub.iter(), 1e-11, bias.amax().max(10.0));
    }

    #[test]
    fn pruned_branches_do_not_change_velocity_jumps((n, seed) in (2..=12_usize, any::<u64>())) {
        let mut s = sample(n, Zoo::All, seed);
        let (q, f) = (s.q(), s.vector());
        let pick = s.rng.usize(0..s.chain.frames().len());
        let name = s.chain.frames()[pick].name.clone();
        let tip = s.chain.point(s.chain.frame(&name).unwrap(), f);
        let less = s.chain.prune(&[tip]);
        let tip_less = less.chain.point(less.chain.frame(&name).unwrap(), f);
        let q_less: Vec<f64> = less.q.iter().map(|&i| q[i]).collect();
        let mut ws = s.chain.workspace();
        let mut kin = ws.update(&s.chain, &q).unwrap();
        let mut impulse = vec![0.0; s.chain.nv()];
        kin.add_point_force(tip, f, &mut impulse).unwrap();
        let jump = solve(&mut kin, &impulse).unwrap();
        let tolerance = solved(&kin.mass_matrix()).max(1e-11);
        let mut ws = less.chain.workspace();
        let mut kin = ws.update(&less.chain, &q_less).unwrap();
        let mut impulse = vec![0.0; less.chain.nv()];
        kin.add_point_force(tip_less, f, &mut impulse).unwrap();
        let jump_less = solve(&mut kin, &impulse).unwrap();
        for i in 0..s.chain.nv() {
            match less.v.iter().position(|&v| v == i) {
                Some(k) => close("reached", [jump_less[k]].iter(), [jump[i]].iter(), tolerance, jump.amax().max(1e-3)),
                None => close("not reached", [jump[i]].iter(), [0.0].iter(), 1e-11, jump.amax().max(1e-3)),
            }
        }
    }

    #[test]
    fn locked_delassus_equals_that_of_a_floating_robot_with_locked_joints((n, seed) in (1..=8_usize, any::<u64>())) {
        // A floating robot: H with all joints locked but the floating base is the locked Delassus matrix.
        let mut s = floating(n, seed);
        let (q, tip_offset) = (s.q(), s.vector());
        let own: Vec<(String, Vec<f64>)> = s.chain.joints().iter().skip(1).filter_map(|j| match &j.coordinates {
            carom_chain::Coordinates::Own { q: at, .. } => Some((j.name.clone(), q[at.clone()].to_vec())),
            _ => None,
        }).collect();
        let names: Vec<(&str, &[f64])> = own.iter().map(|h| (h.0.as_str(), h.1.as_slice())).collect();
        let frozen = s.chain.lock(&names).unwrap();
        let name = s.chain.frames().last().unwrap().name.clone();
        let tip = s.chain.point(s.chain.frame(&name).unwrap(), tip_offset);
        let frozen_tip = frozen.chain.point(frozen.chain.frame(&name).unwrap(), tip_offset);
        let locked = s.chain.workspace().update(&s.chain, &q).unwrap().locked_delassus(tip).unwrap();
        let h = frozen.chain.workspace().update(&frozen.chain, &q[..7]).unwrap().delassus(frozen_tip).unwrap();
        let m = frozen.chain.workspace().update(&frozen.chain, &q[..7]).unwrap().mass_matrix();
        close("H", locked.iter(), h.iter(), solved(&m), 1e-300);
    }

    #[test]
    fn integration_in_two_half_steps_equals_one_step((size, seed) in (-9.0..0.3_f64, any::<u64>())) {
        // Screw motions with rotations from 1e-9 to 2 rad.
        let mut s = floating(0, seed);
        let (q, turn) = (s.q(), s.vector() * 10.0_f64.powf(size));
        let qd = [0.3, -0.5, 0.7, turn.x, turn.y, turn.z];
        let once = s.chain.integrate(&q, &qd, 1.0).unwrap();
        let half = s.chain.integrate(&q, &qd, 0.5).unwrap();
        let twice = s.chain.integrate(&half, &qd, 0.5).unwrap();
        close("two halves", twice.iter(), once.iter(), 4e-15, 1.0);
    }

    #[test]
    fn integrate_and_difference_are_inverse(mut s in zoo()) {
        let (q, qd) = (s.q(), s.v());
        // The rotation is less than half a turn, so that the difference is unique.
        let to = s.chain.integrate(&q, &qd, 0.8).unwrap();
        let back = s.chain.difference(&q, &to).unwrap();
        let expected: Vec<f64> = qd.iter().map(|x| x * 0.8).collect();
        close("difference", back.iter(), expected.iter(), 1e-11, 1.0);
        // To first order a step is dt times the rate of q.
        let h = 1e-6;
        let step = s.chain.integrate(&q, &qd, h).unwrap();
        let rate: Vec<f64> = step.iter().zip(&q).map(|(a, b)| (a - b) / h).collect();
        close("rate", rate.iter(), q_rate(&s.chain, &q, &qd).iter(), 1e-5, 1.0);
    }
}

fn tip_offset(chain: &Chain, tip: carom_chain::Point<Spatial<f64>>) -> Vector3<Dual64> {
    let frame = chain.frames().last().unwrap();
    assert_eq!(frame.body, tip.body);
    let local = frame.pose.inverse().point(tip.position);
    local.map(|x| Dual64::new(x, 0.0))
}

#[test]
fn quaternions_stay_unit_over_a_million_steps() {
    let chain = floating(0, 7).chain;
    let qd = [0.3, -0.2, 0.1, 3.0, -5.0, 4.0];
    let mut q = chain.zero_configuration();
    for _ in 0..1_000_000 {
        q = chain.integrate(&q, &qd, 1e-3).unwrap();
    }
    let norm = q[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((norm - 1.0).abs() < 4.0 * f64::EPSILON, "{norm}");
    // A constant velocity over 1000 s, in one step and in a million.
    let once = chain.integrate(&chain.zero_configuration(), &qd, 1000.0).unwrap();
    let apart = chain.difference(&once, &q).unwrap();
    assert!(apart.iter().all(|x| x.abs() < 1e-8), "{apart:?}");
}

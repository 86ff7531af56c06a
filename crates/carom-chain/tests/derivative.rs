//! Derivatives of M, J and the inverse dynamics compared with dual numbers through the same recursions.

use crate::common::{Sample, Zoo, close, sample};
use carom_chain::{Chain, Spatial};
use nalgebra::{DMatrix, Vector2, Vector3};
use num_dual::Dual64;

/// The chain of a sample over dual numbers at q, moved along the unit velocity k.
fn dual_q(chain: &Chain, q: &[f64], k: usize) -> Vec<Dual64> {
    let (mut unit, mut rate) = (vec![0.0; chain.nv()], vec![0.0; chain.nq()]);
    unit[k] = 1.0;
    chain.q_rate_into(q, &unit, &mut rate);
    q.iter().zip(&rate).map(|(x, dx)| Dual64::new(*x, *dx)).collect()
}

fn agrees(s: &mut Sample) {
    let (q, nv) = (s.q(), s.chain.nv());
    let name = s.chain.frames().last().unwrap().name.clone();
    let frame = s.chain.frame(&name).unwrap();
    let (offset, lever) = (s.vector(), s.vector());
    let (x, gravity) = ([s.v(), s.v()], s.vector());
    let mut ws = s.chain.workspace();
    let mut kin = ws.update(&s.chain, &q).unwrap();
    let scale = kin.mass_matrix().amax() * x.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs())) + 1e-300;
    let found = x.each_ref().map(|x| kin.mass_matrix_derivatives(x));
    let forms = kin.quadratic_derivatives([&x[0], &x[1]]);
    let mut rates = vec![DMatrix::<f64>::zeros(3, nv); nv];
    let point = s.chain.point(frame, offset);
    kin.for_each_jacobian_derivative(point, lever, |i, k, rate| {
        (0..3).for_each(|row| rates[k][(row, i)] += rate[row]);
    });

    let [by_q, by_qd] = kin.inverse_dynamics_derivatives(&x[0], &x[1], gravity).unwrap();
    let fastest = x[0].iter().fold(1.0_f64, |m, x| m.max(x.abs()));
    let forces = kin.inverse_dynamics(&x[0], &x[1], gravity).unwrap().amax().max(scale * fastest * fastest);

    let chain: Chain<Spatial<Dual64>> = s.chain.cast();
    let mut ws = chain.workspace();
    for (k, rates) in rates.iter().enumerate() {
        let mut kin = ws.update(&chain, &dual_q(&s.chain, &q, k)).unwrap();
        let m = kin.mass_matrix().map(|entry| entry.eps);
        let [qd, qdd] = x.each_ref().map(|x| x.iter().map(|x| Dual64::from_re(*x)).collect::<Vec<_>>());
        let g = gravity.map(Dual64::from_re);
        let wanted = kin.inverse_dynamics(&qd, &qdd, g).unwrap().map(|tau| tau.eps);
        close("∂τ/∂q", by_q.column(k).iter(), wanted.iter(), 1e-12, forces);
        let mut turning = qd.clone();
        turning[k].eps = 1.0;
        let both = kin.inverse_dynamics(&turning, &qdd, g).unwrap().map(|tau| tau.eps);
        close("∂τ/∂q̇", by_qd.column(k).iter(), (both - wanted).iter(), 1e-12, forces);
        for (x, found) in x.iter().zip(&found) {
            let wanted = m.clone() * nalgebra::DVector::from_column_slice(x);
            close("∂(Mx)", found.column(k).iter(), wanted.iter(), 1e-13, scale);
        }
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let [one, other] = [&x[a], &x[b]].map(|x| nalgebra::DVector::from_column_slice(x));
            let size = scale * one.lp_norm(1).max(1.0);
            close("∂(xᵀMx)", &[forms[k][(a, b)]], &[one.dot(&(&m * other))], 1e-13, size);
        }
        // The material point of the link that is at the constant lever from the point.
        let pose = kin.pose(frame);
        let dual = |v: Vector3<f64>| v.map(Dual64::from_re);
        let place = pose.inverse().point(pose.point(dual(offset)) + dual(lever));
        let wanted = kin.point_jacobian(chain.point(frame, place)).map(|entry| entry.eps);
        close("∂J", rates.iter(), wanted.iter(), 1e-13, 1.0);
    }
}

#[test]
fn derivatives_of_m_and_j_equal_those_by_dual_numbers() {
    for seed in 0..200 {
        agrees(&mut sample(1 + seed as usize % 9, Zoo::All, seed));
    }
}

#[test]
fn derivatives_of_the_inverse_dynamics_in_the_plane_are_those_in_space() {
    for seed in 0..100 {
        let mut s = sample(1 + seed as usize % 7, Zoo::Plane, seed);
        let Ok(flat) = s.chain.to_planar() else { continue };
        let (q, qd, qdd) = (s.q(), s.v(), s.v());
        let (mut ws, mut flat_ws) = (s.chain.workspace(), flat.chain.workspace());
        let gravity = flat.plane.lift(Vector2::new(0.3, -9.0));
        let wanted = ws.update(&s.chain, &q).unwrap().inverse_dynamics_derivatives(&qd, &qdd, gravity).unwrap();
        let mut kin = flat_ws.update(&flat.chain, &q).unwrap();
        let found = kin.inverse_dynamics_derivatives(&qd, &qdd, Vector2::new(0.3, -9.0)).unwrap();
        for (found, wanted) in found.iter().zip(&wanted) {
            close("in the plane", found.iter(), wanted.iter(), 1e-12, 1.0);
        }
    }
}

#[test]
fn derivatives_of_floating_robots_equal_those_by_dual_numbers() {
    let floating = carom_chain::urdf::LoadOptions { floating_base: true, ..Default::default() };
    for seed in 0..60 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let robot = crate::common::robot(seed as usize % 6, Zoo::All, &mut rng);
        agrees(&mut Sample { chain: Chain::from_robot(robot, &floating), rng });
    }
}

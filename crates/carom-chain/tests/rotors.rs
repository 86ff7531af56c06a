//! Reflected inertia of rotors, against the same chain without rotors.

use crate::common::{Sample, Zoo, close, sample};
use carom_chain::{Chain, Coordinates, Keep, ResponseMemory, uniform_chain};
use nalgebra::{DMatrix, DVector, Vector3};

/// A random chain, and the same with a rotor at every joint with one coordinate.
fn geared(joints: usize, zoo: Zoo, seed: u64) -> (Sample, Chain, Vec<f64>) {
    let mut own = sample(joints, zoo, seed);
    let (mut chain, mut inertias) = (own.chain.clone(), vec![0.0; own.chain.nv()]);
    for joint in own.chain.joints() {
        if let Coordinates::Own { v, .. } = &joint.coordinates
            && v.len() == 1
        {
            inertias[v.start] = own.rng.f64() + 0.1;
            chain = chain.with_rotor_inertia(&joint.name, inertias[v.start]).unwrap();
        }
    }
    (own, chain, inertias)
}

/// M + diag(r), τ + r q̈, and T + ½ Σ r q̇²; forward dynamics is the inverse of inverse dynamics; H = J (M + diag r)⁻¹ Jᵀ by the
/// fused pass, from a workspace, and by the recursion, with mimic joints and in the plane. Tolerances: 1e-12 of the size, times the
/// condition number of M (below 1e4 here) where M is solved with.
#[test]
fn rotors_add_their_inertia_to_the_diagonal_of_m_everywhere() {
    let gravity = Vector3::new(0.3, -0.5, -9.81);
    for seed in 0..60 {
        let zoo = [Zoo::Uncoupled, Zoo::All, Zoo::Plane][seed as usize % 3];
        let (mut own, chain, inertias) = geared(1 + seed as usize % 9, zoo, seed);
        let (q, qd, qdd) = (own.q(), own.v(), own.v());
        let (mut ws, mut bare_ws) = (chain.workspace(), own.chain.workspace());
        let (mut kin, mut bare) = (ws.update(&chain, &q).unwrap(), bare_ws.update(&own.chain, &q).unwrap());
        let rotors = DMatrix::from_diagonal(&DVector::from_column_slice(&inertias));
        let m = bare.mass_matrix() + &rotors;
        close("rotors", &chain.rotor_inertias(), &inertias, 0.0, 1.0);
        close("M", kin.mass_matrix().iter(), m.iter(), 1e-12, 1e-3);
        let tau = bare.inverse_dynamics(&qd, &qdd, gravity).unwrap() + &rotors * DVector::from_column_slice(&qdd);
        close("tau", kin.inverse_dynamics(&qd, &qdd, gravity).unwrap().iter(), tau.iter(), 1e-12, 1.0);
        close("bias", kin.bias(&qd, gravity).unwrap().iter(), bare.bias(&qd, gravity).unwrap().iter(), 1e-12, 1.0);
        let energy = 0.5 * DVector::from_column_slice(&qd).dot(&(&m * DVector::from_column_slice(&qd)));
        close("T", &[kin.kinetic_energy(&qd).unwrap()], &[energy], 1e-12, 1e-3);
        let found = kin.forward_dynamics(&qd, tau.as_slice(), gravity).unwrap();
        close("qdd", found.iter(), &qdd, 1e-8, 1.0);

        let frame = chain.frames().iter().rev().find(|frame| frame.body.is_some());
        let Some(name) = frame.map(|frame| frame.name.clone()) else { continue };
        let point = chain.point(chain.frame(&name).unwrap(), Vector3::new(0.1, 0.2, -0.1));
        let j = kin.point_jacobian(point);
        let h = &j * m.clone().cholesky().unwrap().solve(&j.transpose());
        let columns = |response: [Vector3<f64>; 3]| response.iter().flat_map(|v| v.iter().copied()).collect::<Vec<_>>();
        close("H", &columns(kin.contact(point, Vector3::z(), &[]).unwrap().delassus), h.iter(), 1e-8, 1e-3);
        if chain.has_fused_pass() {
            let mut memory = ResponseMemory::default();
            chain.contact_point(point).unwrap().visit(&q, Vector3::z(), &[], &mut memory, Keep).unwrap();
            close("fused H", &columns(memory.response().delassus), h.iter(), 1e-8, 1e-3);
            close("fused M", memory.response().mass_matrix, m.iter(), 1e-12, 1e-3);
        }
    }
}

/// The unrolled rows of two and three hinges, a row of sixty (which has no fused pass), and the same rows in the plane.
#[test]
fn rotors_act_in_rows_of_every_length_and_in_the_plane() {
    for joints in [1, 2, 3, 4, 7, 60] {
        let bare = uniform_chain(joints, 1.0, 1.0).unwrap();
        let inertias: Vec<f64> = (1..=joints).map(|k| 0.01 * k as f64).collect();
        let add = |chain: Chain, k: usize| chain.with_rotor_inertia(&format!("joint{}", k + 1), inertias[k]).unwrap();
        let chain = (0..joints).fold(bare.clone(), add);
        let flat = chain.to_planar().unwrap();
        assert!(carom_chain::PlanarRow::of(&flat.chain).is_none());
        let q: Vec<f64> = (0..joints).map(|k| 0.3 + 0.1 * (k as f64).sin()).collect();
        let m = bare.workspace().update(&bare, &q).unwrap().mass_matrix();
        let m = m + DMatrix::from_diagonal(&DVector::from_column_slice(&inertias));
        let (mut workspace, torque) = (flat.chain.workspace(), q.clone());
        let mut kin = workspace.update(&flat.chain, &q).unwrap();
        close("M", kin.mass_matrix().iter(), m.iter(), 1e-12, 1e-3);
        let exact = m.clone().cholesky().unwrap().solve(&DVector::from_column_slice(&torque));
        let found = kin.forward_dynamics(&vec![0.0; joints], &torque, flat.plane.project(Vector3::zeros())).unwrap();
        close("qdd", found.iter(), exact.iter(), 1e-8, 1e-3);
        if chain.has_fused_pass() {
            let mut memory = ResponseMemory::default();
            let point = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
            chain.contact_point(point).unwrap().visit(&q, Vector3::y(), &[], &mut memory, Keep).unwrap();
            close("fused M", memory.response().mass_matrix, m.iter(), 1e-12, 1e-3);
        }
    }
}

/// Locking, pruning and casting keep the rotors of the joints that remain.
#[test]
fn reductions_keep_rotors() {
    let chain = uniform_chain(3, 1.0, 1.0).unwrap().with_rotor_inertia("joint3", 0.25).unwrap();
    let less = chain.lock(&[("joint1", &[0.2])]).unwrap();
    assert_eq!(less.chain.rotor_inertias(), [0.0, 0.25]);
    assert_eq!(chain.cast::<f32>().rotor_inertias(), [0.0, 0.0, 0.25]);
    assert_eq!(chain.with_rotor_inertia("joint3", 0.5).unwrap().rotor_inertias(), [0.0, 0.0, 0.5]);
}

#[test]
fn rotors_that_make_no_sense_are_refused() {
    let chain = uniform_chain(2, 1.0, 1.0).unwrap();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(chain.with_rotor_inertia("joint1", bad).unwrap_err().to_string().contains("not negative"));
    }
    assert!(chain.with_rotor_inertia("elbow", 1.0).unwrap_err().to_string().contains("joint1"));
}

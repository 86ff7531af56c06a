//! Robots and their dynamics.

use crate::own::*;
use carom_c::*;
use carom_chain::{Chain as RustChain, Spatial, Workspace};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ptr;

#[test]
fn joints_and_frames_are_those_of_the_rust_chain() {
    for name in ["planar2", "arm7", "humanoid29"] {
        let (own, rust) = (robot(name), RustChain::from_urdf_file(file(&format!("robots/{name}.urdf"))).unwrap());
        // SAFETY: valid arguments.
        unsafe {
            assert_eq!((carom_chain_nq(own.at), carom_chain_nv(own.at)), (rust.nq(), rust.nv()));
            assert_eq!(text(carom_chain_name(own.at)), rust.name());
            assert_eq!(text(carom_chain_warnings(own.at)), rust.report().warnings.join("\n"));
            assert_eq!(carom_chain_frame_count(own.at), rust.frames().len());
            for (k, it) in rust.frames().iter().enumerate() {
                assert_eq!(text(carom_chain_frame_name(own.at, k)), it.name);
                assert_eq!(frame(&own, &it.name), k);
            }
            assert_eq!(carom_chain_joint_count(own.at), rust.nv());
            for k in 0..rust.nv() {
                let mut joint = std::mem::MaybeUninit::<Joint>::uninit();
                assert_eq!(carom_chain_joint(own.at, k, joint.as_mut_ptr()), Status::CAROM_OK, "{}", error());
                let (joint, expected) = (joint.assume_init(), rust.joint_of_velocity(k).unwrap());
                assert_eq!(text(joint.name), expected.name);
                assert_eq!((joint.q_index, joint.q_count, joint.v_index, joint.v_count), (k, 1, k, 1));
                assert_eq!(joint.lower, expected.limits.lower.unwrap_or(f64::NEG_INFINITY));
                assert_eq!(joint.upper, expected.limits.upper.unwrap_or(f64::INFINITY));
                assert_eq!(joint.velocity, expected.limits.velocity.unwrap_or(f64::INFINITY));
                assert_eq!(joint.effort, expected.limits.effort.unwrap_or(f64::INFINITY));
            }
            let mut joint = std::mem::MaybeUninit::<Joint>::uninit();
            assert_eq!(carom_chain_joint(own.at, 99, joint.as_mut_ptr()), Status::CAROM_INVALID_ARGUMENT);
            assert!(error().starts_with("carom_chain_joint: index is 99: the chain has "), "{}", error());
            assert!(carom_chain_frame_name(own.at, 99).is_null());
            assert!(error().starts_with("carom_chain_frame_name: frame is 99: the chain has "), "{}", error());
        }
    }
}

#[test]
fn options_of_loading_have_the_effects_of_their_names() {
    let path = c(&file("robots/arm7.urdf"));
    let mut chain = ptr::null_mut();
    // SAFETY: valid arguments.
    unsafe {
        let free = Own::new(carom_chain_free, |at| carom_chain_load(path.as_ptr(), CAROM_FLOATING_BASE, at));
        assert_eq!((carom_chain_nq(free.at), carom_chain_nv(free.at)), (7 + 7, 6 + 7));
        let mut joint = std::mem::MaybeUninit::<Joint>::uninit();
        assert_eq!(carom_chain_joint(free.at, 0, joint.as_mut_ptr()), Status::CAROM_OK);
        let joint = joint.assume_init();
        assert_eq!((joint.q_count, joint.v_count, joint.lower), (7, 6, f64::NEG_INFINITY));
        assert_eq!(carom_chain_load(path.as_ptr(), 1 << 9, &mut chain), Status::CAROM_INVALID_ARGUMENT);
        assert_eq!(error(), "carom_chain_load: options has the unknown bits 0x200");
    }
    let odd =
        c("<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'
        ixy='0' ixz='0' iyz='0'/></inertial></link><link name='c'/>
        <joint name='j' type='continuous'><parent link='a'/><child link='b'/><axis xyz='0 0 2'/></joint>
        <joint name='k' type='continuous'><parent link='b'/><child link='c'/><axis xyz='0 0 1'/></joint></robot>");
    // SAFETY: valid arguments.
    unsafe {
        let loose = Own::new(carom_chain_free, |at| carom_chain_parse(odd.as_ptr(), 0, at));
        let warning = text(carom_chain_warnings(loose.at));
        assert!(warning.contains("has length 2, normalised to 1"), "{warning}");
        assert_eq!(carom_chain_parse(odd.as_ptr(), CAROM_STRICT, &mut chain), Status::CAROM_REFUSED_INPUT);
        let repaired = Own::new(carom_chain_free, |at| carom_chain_parse(odd.as_ptr(), CAROM_REPAIR, at));
        assert_eq!((carom_chain_nv(loose.at), carom_chain_nv(repaired.at)), (2, 1));
        assert!(text(carom_chain_warnings(repaired.at)).contains("'k'"), "{}", text(carom_chain_warnings(repaired.at)));
        let mut strike = ptr::null_mut();
        let (point, normal) = ([0.0; 3], [1.0, 0.0, 0.0]);
        let status = carom_strike_prepare(loose.at, 2, point.as_ptr(), normal.as_ptr(), ptr::null(), &mut strike);
        assert_eq!(status, Status::CAROM_REFUSED_PHYSICS, "{}", error());
        assert!(error().contains("has no dynamics"), "{}", error());
    }
}

/// Both sides at one state.
struct Case {
    own: Own<Dynamics>,
    rust: RustChain,
    workspace: Workspace<Spatial<f64>>,
    frame: usize,
}

#[test]
fn dynamics_from_c_equal_those_of_rust_bit_by_bit() {
    let (gravity, offset) = ([0.3, -0.2, -9.81], [0.01, -0.02, 0.03]);
    for name in ["planar2", "arm7", "humanoid29"] {
        let (chain, rust) = (robot(name), RustChain::from_urdf_file(file(&format!("robots/{name}.urdf"))).unwrap());
        // SAFETY: valid arguments.
        let own = Own::new(carom_dynamics_free, |at| unsafe { carom_dynamics_create(chain.at, at) });
        let workspace = rust.workspace();
        let mut case = Case { own, rust, workspace, frame: frame(&chain, "tip") };
        let (nv, point) = (case.rust.nv(), case.rust.point(case.rust.frame("tip").unwrap(), offset.into()));
        let (q, qd) = states(nv, 3);
        for (q, qd) in q.iter().zip(&qd) {
            let mut kin = case.workspace.update(&case.rust, q).unwrap();
            let (q_at, qd_at) = (q.as_ptr(), qd.as_ptr());
            let (mut m, mut j, mut h, mut pose) = (vec![7.0; nv * nv], vec![7.0; 3 * nv], [7.0; 9], [7.0; 16]);
            let (mut tau, mut qdd, mut kinetic, mut potential) = (vec![7.0; nv], vec![7.0; nv], 7.0, 7.0);
            let at = case.own.at;
            // SAFETY: valid arguments.
            unsafe {
                let ok = |status| assert_eq!(status, Status::CAROM_OK, "{}", error());
                ok(carom_mass_matrix(at, q_at, nv, m.as_mut_ptr(), nv * nv));
                ok(carom_jacobian(at, q_at, nv, case.frame, offset.as_ptr(), j.as_mut_ptr(), 3 * nv));
                ok(carom_delassus(at, q_at, nv, case.frame, offset.as_ptr(), h.as_mut_ptr()));
                ok(carom_pose(at, q_at, nv, case.frame, pose.as_mut_ptr()));
                let g = gravity.as_ptr();
                ok(carom_inverse_dynamics(at, q_at, nv, qd_at, nv, q_at, nv, g, tau.as_mut_ptr(), nv));
                ok(carom_forward_dynamics(at, q_at, nv, qd_at, nv, tau.as_ptr(), nv, g, qdd.as_mut_ptr(), nv));
                ok(carom_energies(at, q_at, nv, qd_at, nv, g, &mut kinetic, &mut potential));
            }
            let g = Vector3::from(gravity);
            assert_eq!(DMatrix::from_row_slice(nv, nv, &m), kin.mass_matrix());
            assert_eq!(DMatrix::from_row_slice(3, nv, &j), kin.point_jacobian(point));
            assert_eq!(DVector::from_vec(tau.clone()), kin.inverse_dynamics(qd, q, g).unwrap());
            assert_eq!(DVector::from_vec(qdd.clone()), kin.forward_dynamics(qd, &tau, g).unwrap());
            assert_eq!((kinetic, potential), (kin.kinetic_energy(qd).unwrap(), kin.potential_energy(g)));
            // Two routes: H by the articulated bodies, q̈ by the inverse dynamics that gave τ.
            let expected = kin.delassus(point).unwrap();
            assert!((DMatrix::from_row_slice(3, 3, &h) - &expected).amax() < 1e-12 * expected.amax());
            let accelerated = DVector::from_vec(qdd) - DVector::from_column_slice(q);
            assert!(accelerated.amax() < 1e-9, "{accelerated}");
            let rust_pose = kin.pose(case.rust.frame("tip").unwrap());
            for i in 0..3 {
                assert!((0..3).all(|k| pose[4 * i + k] == rust_pose.rotation[(i, k)]));
                assert_eq!((pose[4 * i + 3], pose[12 + i]), (rust_pose.translation[i], 0.0));
            }
            assert_eq!(pose[15], 1.0);
        }
    }
}

#[test]
fn a_number_that_is_not_finite_is_refused_with_its_place() {
    let chain = robot("planar2");
    // SAFETY: valid arguments.
    unsafe {
        let own = Own::new(carom_dynamics_free, |at| carom_dynamics_create(chain.at, at));
        let (q, mut m) = ([0.3, f64::NAN], [0.0; 4]);
        assert_eq!(carom_mass_matrix(own.at, q.as_ptr(), 2, m.as_mut_ptr(), 4), Status::CAROM_REFUSED_INPUT);
        assert_eq!(error(), "carom_mass_matrix: q[1] is NaN: every number must be finite");
    }
}

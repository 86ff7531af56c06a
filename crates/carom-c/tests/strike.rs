//! Prepared strikes.

use crate::own::*;
use carom_c::*;
use carom_impact::{Coefficients, law_by_name};
use carom_sim::{ChainImpact, Impacts, JointModel};
use std::ptr;

const NORMAL: [f64; 3] = [-1.0, 0.2, 0.1];

fn equal(own: (&[f64], &Hit), rust: &ChainImpact) {
    let (qd_plus, hit) = own;
    assert_eq!(qd_plus, rust.qd_plus);
    let vectors = [(hit.impulse, rust.impulse), (hit.u_minus, rust.u_minus), (hit.u_plus, rust.u_plus)];
    assert!(vectors.iter().all(|(own, rust)| own.as_slice() == rust.as_slice()), "{hit:?} {rust:?}");
    let energies = [hit.energy_before, hit.energy_after, hit.normal_work, hit.friction_work, hit.drive_work];
    let contact = &rust.contact;
    let expected = [rust.energy_before, rust.energy_after, contact.normal_work, contact.friction_work, rust.drive_work];
    assert_eq!(energies, expected);
    assert_eq!((hit.mode, hit.status), (rust.mode.into(), Status::CAROM_OK));
}

#[test]
fn a_strike_from_c_equals_the_rust_strike_bit_by_bit() {
    for name in ["planar2", "arm7", "humanoid29"] {
        let (own, rust) =
            (robot(name), carom_chain::Chain::from_urdf_file(file(&format!("robots/{name}.urdf"))).unwrap());
        let joint = rust.joint_of_velocity(0).unwrap().name.as_str();
        let (q, qd) = states(rust.nv(), 5);
        for (locked, joints) in
            [(None, JointModel::Free), (Some(joint), JointModel::Locked(&[joint])), (Some(""), JointModel::Free)]
        {
            let strike = strike(&own, "tip", NORMAL, locked);
            for law_name in ["energetic", "newton", "smith"] {
                let law = law(law_name, 0.5, 0.3);
                let coefficients = Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() };
                let rust_law = law_by_name::<3>(law_name, coefficients).unwrap();
                for (q, qd) in q.iter().zip(&qd) {
                    let tip = rust.frame("tip").unwrap();
                    let expected = rust.impact(q, qd).at(tip).normal(NORMAL).joints(joints).resolve(&*rust_law);
                    let (status, qd_plus, hit) = resolve(&strike, &law, q, qd);
                    match expected {
                        Ok(expected) => {
                            assert_eq!(status, Status::CAROM_OK, "{name}: {}", error());
                            equal((&qd_plus, &hit), &expected);
                        }
                        Err(why) => assert_eq!(error(), format!("carom_strike_resolve: {why}")),
                    }
                }
            }
        }
    }
}

#[test]
fn all_joints_of_a_floating_robot_can_be_locked() {
    let path = c(&file("robots/arm7.urdf"));
    // SAFETY: valid arguments.
    let own = Own::new(carom_chain_free, |at| unsafe { carom_chain_load(path.as_ptr(), CAROM_FLOATING_BASE, at) });
    let options = carom_chain::urdf::LoadOptions { floating_base: true, ..Default::default() };
    let rust = carom_chain::Chain::from_urdf_file_with(file("robots/arm7.urdf"), &options).unwrap();
    let (strike, law) = (strike(&own, "tip", NORMAL, Some("all")), law("energetic", 0.5, 0.3));
    let (mut q, mut qd) = (rust.zero_configuration(), vec![0.1; rust.nv()]);
    (q[8], qd[0]) = (0.7, 1.0);
    let at = rust.impact(&q, &qd).at(rust.frame("tip").unwrap()).normal(NORMAL).joints(JointModel::AllLocked);
    let expected = at.resolve(&carom_impact::Energetic { restitution: 0.5, friction: 0.3 }).unwrap();
    let (status, qd_plus, hit) = resolve(&strike, &law, &q, &qd);
    assert_eq!(status, Status::CAROM_OK, "{}", error());
    equal((&qd_plus, &hit), &expected);
    assert!(hit.impulse != [0.0; 3] && qd_plus[6..] == qd[6..]);
}

#[test]
fn a_strike_outlives_the_chain_that_it_was_made_from() {
    let (arm, law) = (robot("arm7"), law("energetic", 0.5, 0.3));
    let strike = strike(&arm, "tip", NORMAL, None);
    let (q, qd) = states(7, 1);
    let (_, before, _) = resolve(&strike, &law, &q[0], &qd[0]);
    drop(arm);
    let (status, after, _) = resolve(&strike, &law, &q[0], &qd[0]);
    assert_eq!((status, before), (Status::CAROM_OK, after));
}

#[test]
fn a_batch_has_the_digits_of_single_strikes_and_names_the_states_that_are_refused() {
    let (arm, law) = (robot("planar2"), law("energetic", 0.35, 0.2));
    let strike = strike(&arm, "tip", [-1.0, 0.0, 0.0], None);
    let (mut q, qd) = states(2, 6);
    // Stretched along the normal, which no joint can move.
    (q[3], q[5]) = (vec![0.0, 0.0], vec![0.0, 0.0]);
    let (flat_q, flat_qd) = (q.concat(), qd.concat());
    let (mut out, mut hits) = ([-7.0; 12], [blank(); 6]);
    // SAFETY: valid arguments.
    let status = unsafe {
        carom_strike_many(
            strike.at,
            law.at,
            6,
            flat_q.as_ptr(),
            12,
            flat_qd.as_ptr(),
            12,
            out.as_mut_ptr(),
            12,
            hits.as_mut_ptr(),
        )
    };
    assert_eq!(status, Status::CAROM_REFUSED_PHYSICS);
    assert!(error().starts_with("carom_strike_many: state 3: at this pose no joint moves 'tip'"), "{}", error());
    for k in 0..6 {
        let (status, qd_plus, hit) = resolve(&strike, &law, &q[k], &qd[k]);
        assert_eq!(hits[k].status, status);
        if status == Status::CAROM_OK {
            assert_eq!((&out[2 * k..][..2], hits[k].impulse), (&qd_plus[..], hit.impulse));
        } else {
            assert!((k == 3 || k == 5) && out[2 * k].is_nan() && hits[k].impulse[0].is_nan());
            // A strike that is refused leaves the memory of the caller as it was.
            assert_eq!((qd_plus, hit.energy_after), (vec![-7.0; 2], -7.0));
        }
    }
    // SAFETY: valid arguments.
    let status = unsafe {
        let (q, qd) = (flat_q.as_ptr(), flat_qd.as_ptr());
        carom_strike_many(strike.at, law.at, 5, q, 12, qd, 12, out.as_mut_ptr(), 12, hits.as_mut_ptr())
    };
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert_eq!(error(), "carom_strike_many: q has 12 numbers, 10 are needed (count × nq)");
}

#[test]
fn derivatives_from_c_equal_those_of_rust_bit_by_bit() {
    let (own, rust) = (robot("arm7"), carom_chain::Chain::from_urdf_file(file("robots/arm7.urdf")).unwrap());
    let (strike, law) = (strike(&own, "tip", NORMAL, None), law("energetic", 0.5, 0.3));
    let (q, qd) = states(7, 4);
    for (q, qd) in q.iter().zip(&qd) {
        let at = rust.impact(q, qd).at(rust.frame("tip").unwrap()).normal(NORMAL);
        let expected = at.derivative(&carom_impact::Energetic { restitution: 0.5, friction: 0.3 }).unwrap();
        let (mut by_q, mut by_qd, mut by_e, mut by_mu) = ([-7.0; 49], [-7.0; 49], [-7.0; 7], [-7.0; 7]);
        // SAFETY: valid arguments.
        let status = unsafe {
            carom_strike_derivative(
                strike.at,
                law.at,
                q.as_ptr(),
                7,
                qd.as_ptr(),
                7,
                by_q.as_mut_ptr(),
                49,
                by_qd.as_mut_ptr(),
                49,
                by_e.as_mut_ptr(),
                7,
                by_mu.as_mut_ptr(),
                7,
            )
        };
        assert_eq!(status, Status::CAROM_OK, "{}", error());
        assert_eq!(by_q[..], *expected.q.transpose().as_slice());
        assert_eq!(by_qd[..], *expected.qd.transpose().as_slice());
        assert_eq!(by_e[..], *expected.restitution.as_slice());
        assert_eq!(by_mu[..], *expected.friction.as_slice());
    }
}

#[test]
fn strikes_are_refused_by_frame_normal_and_joint() {
    let arm = robot("planar2");
    let refused = |frame: usize, normal: [f64; 3], locked: Option<&str>| {
        let (mut strike, locked) = (ptr::dangling_mut(), locked.map(c));
        let locked = locked.as_ref().map_or(ptr::null(), |names| names.as_ptr());
        // SAFETY: valid arguments.
        let status =
            unsafe { carom_strike_prepare(arm.at, frame, [0.0; 3].as_ptr(), normal.as_ptr(), locked, &mut strike) };
        assert!(status != Status::CAROM_OK && strike.is_null());
        (status, error())
    };
    let tip = frame(&arm, "tip");
    let (status, message) = refused(99, NORMAL, None);
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert!(message.starts_with("carom_strike_prepare: frame is 99: the chain has "), "{message}");
    let (status, message) = refused(tip, [0.0; 3], None);
    assert_eq!(status, Status::CAROM_REFUSED_INPUT, "{message}");
    let (status, message) = refused(tip, NORMAL, Some("elbow, sholder"));
    assert_eq!(status, Status::CAROM_REFUSED_INPUT);
    assert!(message.contains("no joint is named 'sholder'") && message.contains("shoulder"), "{message}");
    let (status, message) = refused(tip, NORMAL, Some("all"));
    assert_eq!(status, Status::CAROM_REFUSED_PHYSICS, "{message}");
    let (status, message) = refused(frame(&arm, "base"), NORMAL, None);
    assert_eq!(status, Status::CAROM_REFUSED_PHYSICS, "{message}");
}

#[test]
fn threads_with_strikes_of_their_own_share_chain_and_law() {
    let (arm, law) = (robot("arm7"), law("energetic", 0.5, 0.3));
    let (q, qd) = states(7, 50);
    let all = |strike: &Own<Strike>, law: &Own<Law>| -> Vec<Vec<f64>> {
        q.iter().zip(&qd).map(|(q, qd)| resolve(strike, law, q, qd).1).collect()
    };
    let expected = all(&strike(&arm, "tip", NORMAL, None), &law);
    /// The rules of the header allow it.
    struct Shared<'a>(&'a Own<Chain>, &'a Own<Law>);
    // SAFETY: chains and laws do not change.
    unsafe impl Sync for Shared<'_> {}
    let shared = &Shared(&arm, &law);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let Shared(arm, law) = shared;
                assert_eq!(all(&strike(arm, "tip", NORMAL, None), law), expected);
            });
        }
    });
}

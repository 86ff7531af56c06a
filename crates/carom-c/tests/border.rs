//! Faults of the caller.

use crate::own::*;
use carom_c::*;
use std::ptr;

#[test]
fn null_is_refused_with_the_name_of_function_and_argument() {
    let (arm, law) = (robot("planar2"), law("energetic", 0.35, 0.2));
    let strike = strike(&arm, "tip", [-1.0, 0.0, 0.0], None);
    let (q, mut out, mut hit) = ([0.3, 0.4], [0.0; 2], blank());
    let null = ptr::null();
    // SAFETY: null is refused.
    unsafe {
        let mut chain = ptr::dangling_mut();
        assert_eq!(carom_chain_load(ptr::null(), 0, &mut chain), Status::CAROM_INVALID_ARGUMENT);
        assert_eq!(error(), "carom_chain_load: path is NULL");
        assert_eq!(carom_chain_load(c("x").as_ptr(), 0, ptr::null_mut()), Status::CAROM_INVALID_ARGUMENT);
        assert_eq!(error(), "carom_chain_load: chain is NULL");
        let out = out.as_mut_ptr();
        let status = carom_strike_resolve(strike.at, ptr::null(), q.as_ptr(), 2, q.as_ptr(), 2, out, 2, &mut hit);
        assert_eq!((status, error().as_str()), (Status::CAROM_INVALID_ARGUMENT, "carom_strike_resolve: law is NULL"));
        let status = carom_strike_resolve(strike.at, law.at, null, 2, q.as_ptr(), 2, out, 2, &mut hit);
        assert_eq!((status, error().as_str()), (Status::CAROM_INVALID_ARGUMENT, "carom_strike_resolve: q is NULL"));
        let status = carom_strike_resolve(strike.at, law.at, q.as_ptr(), 2, q.as_ptr(), 2, out, 2, ptr::null_mut());
        assert_eq!((status, error().as_str()), (Status::CAROM_INVALID_ARGUMENT, "carom_strike_resolve: hit is NULL"));
        assert_eq!(carom_chain_nq(ptr::null()), 0);
        assert_eq!(error(), "carom_chain_nq: chain is NULL");
        carom_chain_free(ptr::null_mut());
        assert_eq!(error(), "");
    }
}

#[test]
fn a_failed_load_leaves_null_so_that_freeing_it_is_harmless() {
    let mut chain = ptr::dangling_mut();
    // SAFETY: valid arguments.
    unsafe {
        let status = carom_chain_load(c("no/such.urdf").as_ptr(), 0, &mut chain);
        assert_eq!(status, Status::CAROM_REFUSED_INPUT);
        assert!(error().starts_with("carom_chain_load: no/such.urdf: cannot be read"), "{}", error());
        assert!(chain.is_null());
        carom_chain_free(chain);
    }
}

#[test]
fn a_wrong_length_is_named_with_both_lengths() {
    let (arm, law) = (robot("planar2"), law("energetic", 0.35, 0.2));
    let strike = strike(&arm, "tip", [-1.0, 0.0, 0.0], None);
    let (status, ..) = resolve(&strike, &law, &[0.3, 0.4, 0.5], &[0.1, 0.2]);
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert_eq!(error(), "carom_strike_resolve: q has 3 numbers, 2 are needed (shoulder, elbow)");
    let (status, ..) = resolve(&strike, &law, &[0.3, 0.4], &[0.1]);
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert_eq!(error(), "carom_strike_resolve: qd_plus has 1 numbers, 2 are needed (nv)");
    let (mut m, q) = ([0.0; 3], [0.3, 0.4]);
    let dynamics = Own::new(carom_dynamics_free, |at| {
        // SAFETY: valid arguments.
        unsafe { carom_dynamics_create(arm.at, at) }
    });
    // SAFETY: valid arguments.
    let status = unsafe { carom_mass_matrix(dynamics.at, q.as_ptr(), 2, m.as_mut_ptr(), 3) };
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert_eq!(error(), "carom_mass_matrix: mass_matrix has 3 numbers, 4 are needed (nv × nv)");
}

#[test]
fn overlapping_and_misaligned_arrays_are_refused() {
    let (arm, law) = (robot("planar2"), law("energetic", 0.35, 0.2));
    let strike = strike(&arm, "tip", [-1.0, 0.0, 0.0], None);
    let (q, mut qd, mut hit) = ([0.3, 0.4], [-0.1, 0.5, 0.0], blank());
    let in_place = qd.as_mut_ptr();
    // SAFETY: valid arguments; overlaps and addresses that are not aligned are refused.
    unsafe {
        let status = carom_strike_resolve(strike.at, law.at, q.as_ptr(), 2, in_place, 2, in_place.add(1), 2, &mut hit);
        assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
        let rule = "carom_strike_resolve: qd_plus overlaps qd: give what is written a memory of its own";
        assert_eq!(error(), rule);
        // The same array twice is sound where it is only read.
        let (mut out, same) = ([0.0; 2], q.as_ptr());
        let status = carom_strike_resolve(strike.at, law.at, same, 2, same, 2, out.as_mut_ptr(), 2, &mut hit);
        assert_eq!(status, Status::CAROM_OK, "{}", error());
        let odd = in_place.byte_add(1);
        let status = carom_strike_resolve(strike.at, law.at, q.as_ptr(), 2, odd, 2, out.as_mut_ptr(), 2, &mut hit);
        assert_eq!(
            (status, error().as_str()),
            (Status::CAROM_INVALID_ARGUMENT, "carom_strike_resolve: qd is not aligned to 8 bytes")
        );
    }
}

#[test]
fn each_thread_has_its_own_message_and_a_good_call_clears_it() {
    let arm = robot("planar2");
    let mut frame = 0;
    // SAFETY: valid arguments.
    let status = unsafe { carom_chain_frame(arm.at, c("tipp").as_ptr(), &mut frame) };
    assert_eq!(status, Status::CAROM_REFUSED_INPUT);
    assert!(error().contains("no link is named 'tipp'") && error().contains("tip"), "{}", error());
    std::thread::spawn(|| assert_eq!(error(), "")).join().unwrap();
    assert!(error().contains("tipp"));
    // SAFETY: valid arguments.
    assert_eq!(unsafe { carom_chain_nq(arm.at) }, 2);
    assert_eq!(error(), "");
}

#[test]
fn text_that_is_not_utf8_is_refused() {
    let (mut law, name) = (ptr::null_mut(), c"energ\xff");
    // SAFETY: valid arguments.
    let status = unsafe { carom_law_create(name.as_ptr(), 0.5, 0.2, 0.0, &mut law) };
    assert_eq!(status, Status::CAROM_INVALID_ARGUMENT);
    assert!(error().starts_with("carom_law_create: name is not UTF-8"), "{}", error());
}

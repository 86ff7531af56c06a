//! Scenes and sessions.

use crate::own::*;
use carom_c::*;
use carom_sim::{Drive, Pd, Sampling};
use std::ptr;

fn scene(name: &str) -> Own<Scene> {
    let path = c(&file(&format!("scenes/{name}.toml")));
    // SAFETY: valid arguments.
    Own::new(carom_scene_free, |at| unsafe { carom_scene_load(path.as_ptr(), at) })
}

fn session(scene: &Own<Scene>) -> Own<Session> {
    // SAFETY: valid arguments.
    Own::new(carom_session_free, |at| unsafe { carom_session_start(scene.at, at) })
}

fn plan(name: &str) -> carom_sim::Plan {
    carom_sim::Scene::from_file(file(&format!("scenes/{name}.toml"))).unwrap().plan().unwrap()
}

fn state(session: &Own<Session>, nq: usize, nv: usize) -> (f64, Vec<f64>, Vec<f64>) {
    let (mut time, mut q, mut qd) = (-7.0, vec![-7.0; nq], vec![-7.0; nv]);
    // SAFETY: valid arguments.
    let status = unsafe { carom_session_state(session.at, &mut time, q.as_mut_ptr(), nq, qd.as_mut_ptr(), nv) };
    assert_eq!(status, Status::CAROM_OK, "{}", error());
    (time, q, qd)
}

#[test]
fn the_summary_is_that_of_the_rust_run() {
    let own = scene("planar2");
    let (mut json, mut warnings) = (ptr::null_mut(), ptr::null_mut());
    // SAFETY: valid arguments.
    let status = unsafe { carom_scene_summary_json(own.at, &mut json, &mut warnings) };
    assert_eq!(status, Status::CAROM_OK, "{}", error());
    let answer: serde_json::Value = serde_json::from_str(&text(json)).unwrap();
    assert_eq!(text(warnings), "");
    // SAFETY: freed once.
    unsafe {
        carom_text_free(json);
        carom_text_free(warnings);
        carom_text_free(ptr::null_mut());
    }
    let plan = plan("planar2");
    let run = plan.stream(0.5, Sampling::default(), &mut |_| {}).unwrap();
    assert_eq!(answer["final"]["q"], serde_json::json!(run.last.q));
    assert_eq!(answer["final"]["qd"], serde_json::json!(run.last.qd));
    assert_eq!(answer["joints"], serde_json::json!(["shoulder", "elbow"]));
    assert_eq!(answer["events"].as_array().unwrap().len(), run.events);
    assert_eq!(answer["energy"]["lost_in_impacts"], serde_json::json!(run.energy.impacts));
    assert_eq!(answer["statistics"]["steps"], serde_json::json!(run.statistics.steps));
}

#[test]
fn a_session_goes_through_the_motion_of_the_rust_session_step_by_step() {
    let own = session(&scene("planar2"));
    let mut rust = plan("planar2").start().unwrap();
    let mut impacts = 0;
    for _ in 0..20 {
        let mut count = usize::MAX;
        // SAFETY: valid arguments.
        let status = unsafe { carom_session_advance(own.at, 0.025, &mut count) };
        assert_eq!(status, Status::CAROM_OK, "{}", error());
        let expected = rust.advance(0.025).unwrap();
        assert_eq!(count, expected.events.len());
        for (k, event) in expected.events.iter().enumerate() {
            let mut own_event = std::mem::MaybeUninit::<Event>::uninit();
            let (mut before, mut after) = ([-7.0; 2], [-7.0; 2]);
            // SAFETY: valid arguments.
            let told = unsafe {
                assert_eq!(carom_session_event(own.at, k, own_event.as_mut_ptr()), Status::CAROM_OK, "{}", error());
                let (before, after) = (before.as_mut_ptr(), after.as_mut_ptr());
                assert_eq!(carom_session_event_velocities(own.at, k, before, 2, after, 2), Status::CAROM_OK);
                own_event.assume_init()
            };
            assert_eq!((told.time, told.is_impact), (event.time, event.kind.is_impact()));
            assert_eq!((before.to_vec(), after.to_vec()), (event.qd_minus.clone(), event.qd_plus.clone()));
            assert_eq!(text(told.kind), event.kind.name());
            if event.kind.is_impact() {
                impacts += 1;
                let touch = &rust.simulation().touches[event.kind.touch().unwrap()];
                assert_eq!((text(told.contact), told.impulse), (touch.name.clone(), event.impulses[0].impulse.into()));
            }
        }
        let (time, q, qd) = state(&own, 2, 2);
        let moment = rust.moment();
        assert_eq!((time, q, qd), (moment.time, moment.q, moment.qd));
    }
    assert!(impacts > 0);
}

#[test]
fn a_session_stops_at_the_next_event_with_forces_targets_and_states_that_are_set() {
    let own = session(&scene("planar2"));
    let mut rust = plan("planar2").start().unwrap();
    let (forces, kp, kd, target) = ([0.3, -0.2], [30.0, 20.0], [2.0, 1.0], [0.7, -1.4]);
    let mut count = usize::MAX;
    let both = |own: &Own<Session>, rust: &carom_sim::Session| {
        let (moment, found) = (rust.moment(), state(own, 2, 2));
        assert_eq!(found, (moment.time, moment.q, moment.qd));
    };
    // SAFETY: valid arguments.
    unsafe {
        let ok = |status| assert_eq!(status, Status::CAROM_OK, "{}", error());
        ok(carom_session_set_forces(own.at, forces.as_ptr(), 2));
        rust.set_forces(&forces).unwrap();
        ok(carom_session_advance_to_event(own.at, 1.0, &mut count));
        assert!(count == rust.advance_to_event(1.0).unwrap().events.len() && count > 0);
        both(&own, &rust);
        ok(carom_session_set_targets(own.at, kp.as_ptr(), 2, kd.as_ptr(), 2, target.as_ptr(), 2));
        let pd = Pd { kp: kp.to_vec().into(), kd: kd.to_vec().into(), target: target.to_vec() };
        rust.set_drive(Drive::Pd(pd)).unwrap();
        // A copy goes on by itself.
        let copy = Own::new(carom_session_free, |at| carom_session_copy(own.at, at));
        ok(carom_session_advance(copy.at, 0.05, &mut count));
        both(&own, &rust);
        ok(carom_session_advance(own.at, 0.05, &mut count));
        rust.advance(0.05).unwrap();
        both(&own, &rust);
        both(&copy, &rust);
        let (q, qd) = ([1.0, -2.0], [0.1, 0.2]);
        ok(carom_session_set_state(own.at, q.as_ptr(), 2, qd.as_ptr(), 2));
        rust.restart(&q, &qd).unwrap();
        both(&own, &rust);
        let event = &mut std::mem::MaybeUninit::<Event>::uninit();
        assert_eq!(carom_session_event(own.at, 0, event.as_mut_ptr()), Status::CAROM_INVALID_ARGUMENT);
        assert!(error().contains("index is 0: the last advance has had 0 events"), "{}", error());
    }
}

#[test]
fn the_chain_of_a_session_has_the_joints_of_its_state() {
    let own = session(&scene("planar2"));
    // SAFETY: valid arguments.
    unsafe {
        let chain = Own::new(carom_chain_free, |at| carom_session_chain(own.at, at));
        drop(own);
        assert_eq!((carom_chain_nq(chain.at), carom_chain_nv(chain.at)), (2, 2));
        assert_eq!(text(carom_chain_name(chain.at)), "planar2");
    }
}

#[test]
fn scenes_and_sessions_are_refused_with_their_reasons() {
    let mut at = ptr::dangling_mut();
    // SAFETY: valid arguments.
    let status = unsafe { carom_scene_load(c("no/such.toml").as_ptr(), &mut at) };
    assert!(status == Status::CAROM_REFUSED_INPUT && at.is_null());
    assert!(error().starts_with("carom_scene_load: no/such.toml: cannot be read"), "{}", error());
    let own = session(&scene("planar2"));
    let (mut count, wrong) = (0, [0.0; 3]);
    let (deep, still) = ([0.0, 0.0], [0.0; 2]);
    // SAFETY: valid arguments.
    unsafe {
        assert_eq!(carom_session_advance(own.at, f64::NAN, &mut count), Status::CAROM_REFUSED_INPUT);
        assert!(error().starts_with("carom_session_advance: "), "{}", error());
        assert_eq!(carom_session_set_forces(own.at, wrong.as_ptr(), 3), Status::CAROM_INVALID_ARGUMENT);
        assert!(error().contains("has 3 numbers, 2 are needed"), "{}", error());
        let status = carom_session_set_state(own.at, deep.as_ptr(), 2, still.as_ptr(), 2);
        assert_eq!(status, Status::CAROM_REFUSED_PHYSICS);
        assert!(error().contains("overlaps"), "{}", error());
    }
    // The session stays where it was.
    assert_eq!(state(&own, 2, 2).0, 0.0);
}

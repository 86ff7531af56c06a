//! Simulations as objects that a control loop drives.

use carom_sim::{EventKind, Moment, Parameter, Sampling, Seen, Session, SimError, Simulation, StopReason};
use carom_testing::build::{self, X, Z, along};
use carom_testing::scenes::{G, newton, on_floor, shipped};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A ball of 2 kg and 5 cm that moves along x and z above the ground, without turning.
fn ball(restitution: f64, friction: f64) -> Simulation {
    let ball = along(&[X, Z], 2.0, [1.0; 3], &build::ball(0.05));
    Simulation { tolerance: 1e-11, ..on_floor(ball, newton(restitution, friction)) }
}

/// A run in pieces has the events, the end and the energies of the run in one piece.
#[test]
fn a_run_in_pieces_is_the_whole_run() {
    for name in ["planar2", "bounce", "box"] {
        let scene = shipped(name);
        let plan = scene.plan().unwrap();
        let duration = scene.duration.min(0.6);
        let whole = plan.run(duration).unwrap();
        let mut session = plan.start().unwrap();
        let mut events = Vec::new();
        for k in 1..=37 {
            let until = duration * f64::from(k) / 37.0;
            events.extend(session.advance(until - session.time()).unwrap().events);
        }
        let names = |events: &[carom_sim::Event]| events.iter().map(|e| e.kind.name()).collect::<Vec<_>>();
        assert_eq!(names(&events), names(&whole.events), "{name}");
        for (a, b) in events.iter().zip(&whole.events) {
            // Both integrate with this tolerance, with other steps; a bounce amplifies an error by up to its 1/e.
            assert!((a.time - b.time).abs() < 1e4 * plan.simulation.tolerance, "{name}: {} {}", a.time, b.time);
        }
        let last = session.moment();
        for (a, b) in last.q.iter().chain(&last.qd).zip(whole.summary.last.q.iter().chain(&whole.summary.last.qd)) {
            assert!((a - b).abs() < 1e5 * plan.simulation.tolerance, "{name}: {a} {b}");
        }
        let (a, b) = (session.energy().unwrap(), whole.summary.energy);
        assert!((a.impacts - b.impacts).abs() < 1e-6 * b.start.abs().max(1.0), "{name}: {a:?} {b:?}");
    }
}

/// The moments of a run in pieces are those of the run in one piece, each once, also at the ends of the pieces and at rest.
#[test]
fn a_run_in_pieces_has_each_moment_once() {
    let falls = |e| (ball(e, 0.2), [0.0, 0.1], [0.5, 0.0]);
    for (sim, q, qd) in [falls(0.7), falls(0.0)] {
        let sampling = Sampling { every: Some(0.01), ..Sampling::default() };
        let collect = |moments: &mut Vec<Moment>, seen: Seen| {
            if let Seen::Moment(moment) = seen {
                moments.push(moment.clone());
            }
        };
        let mut whole = Vec::new();
        let summary = sim.stream(&q, &qd, 1.0, sampling, &mut |seen| collect(&mut whole, seen)).unwrap();
        let mut session = sim.start(&q, &qd).unwrap();
        let mut pieces = Vec::new();
        // Pieces that end at moments, up to rounding, and pieces that end between them.
        for until in (1..=50).map(|k| f64::from(k) * 0.01).chain((1..=7).map(|k| 0.5 + f64::from(k) / 14.0)) {
            let duration = until - session.time();
            session.stream(duration, sampling, &mut |seen| collect(&mut pieces, seen)).unwrap();
        }
        let times = |moments: &[Moment]| moments.iter().map(|moment| moment.time).collect::<Vec<_>>();
        assert_eq!(times(&pieces), times(&whole));
        assert_eq!(whole.len(), 101);
        for (a, b) in pieces.iter().zip(&whole) {
            // Both integrate with a tolerance of 1e-11.
            assert!((a.q[1] - b.q[1]).abs() < 1e-8 && (a.q[0] - b.q[0]).abs() < 1e-8, "{a:?} {b:?}");
        }
        let own = session.summary(StopReason::Duration).unwrap();
        assert_eq!((own.events, own.mode.name(), own.stop), (summary.events, summary.mode.name(), summary.stop));
        assert!((own.energy.impacts - summary.energy.impacts).abs() < 1e-8 && own.energy.error().abs() < 1e-9);
        assert!((own.contacts.len() == summary.contacts.len()) && (own.last.q[1] - summary.last.q[1]).abs() < 1e-8);
    }
}

fn to(session: &mut Session, time: f64) {
    session.advance(time - session.time()).unwrap();
}

/// From a saved state the motion is repeated bit for bit, in this session and in another one.
#[test]
fn a_restored_session_repeats_its_motion() {
    let plan = shipped("planar2").plan().unwrap();
    let mut session = plan.start().unwrap();
    to(&mut session, 0.2);
    let saved = session.save();
    let mut other = plan.start().unwrap();
    to(&mut session, 0.35);
    to(&mut session, 0.5);
    let end = session.moment();
    for session in [&mut session, &mut other] {
        session.restore(&saved).unwrap();
        assert_eq!(session.time(), 0.2);
        to(session, 0.35);
        to(session, 0.5);
        assert_eq!(session.moment(), end);
    }
    assert!(
        ball(0.0, 0.0)
            .start(&[0.0, 1.0], &[0.0, 0.0])
            .unwrap()
            .restore(&shipped("box").plan().unwrap().start().unwrap().save())
            .is_err()
    );
}

/// A bouncing ball, event by event: tₖ = √(2h/g)(1 + 2e + 2e² + …); between events nothing is returned.
#[test]
fn advance_to_event_stops_at_each_bounce() {
    let (h, e): (f64, f64) = (0.8, 0.7);
    let mut session = ball(e, 0.0).start(&[0.0, 0.05 + h], &[0.3, 0.0]).unwrap();
    let fall = (2.0 * h / G).sqrt();
    assert!(session.advance_to_event(0.5 * fall).unwrap().events.is_empty());
    let mut time = fall;
    for k in 0..6 {
        let events = session.advance_to_event(10.0).unwrap().events;
        assert!(matches!(events[0].kind, EventKind::Impact { .. }), "{events:?}");
        assert!((events[0].time - time).abs() < 1e-11 && session.time() == events[0].time, "bounce {k}");
        time += 2.0 * fall * e.powi(k + 1);
    }
}

/// A body at rest stays at rest under a force below μ m g and slides with (F − μ m g)/m above it, when a loop sets the force.
#[test]
fn forces_set_by_a_loop_move_a_resting_body_when_friction_is_spent() {
    let mu = 0.4;
    let mut session = ball(0.0, mu).start(&[0.0, 0.05], &[0.0, 0.0]).unwrap();
    let (mut rests, most) = (0, mu * 2.0 * G);
    for force in [0.0, 0.5 * most, 0.9 * most, 1.5 * most, 1.5 * most] {
        session.set_forces(&[force, 0.0]).unwrap();
        rests += session.advance(0.1).unwrap().events.iter().filter(|e| e.kind.name() == "rest").count();
        let contacts = session.contacts().unwrap();
        assert!((contacts[0].normal_force - 2.0 * G).abs() < 1e-9, "{contacts:?}");
    }
    assert_eq!(rests, 1, "rest is told once");
    assert_eq!(session.mode().name(), "sliding");
    let a = 0.5 * most / 2.0;
    let last = session.moment();
    assert!((last.qd[0] - a * 0.2).abs() < 1e-9 && (last.q[0] - 0.5 * a * 0.04).abs() < 1e-9, "{last:?} {a}");
    assert!((session.energy().unwrap().error()).abs() < 1e-9);
    session.restart(&[0.0, 1.0], &[0.0, 0.0]).unwrap();
    assert_eq!((session.time(), session.moment().q), (0.5, vec![0.0, 1.0]));
    assert!(session.set_forces(&[1.0]).is_err() && session.advance(-1.0).is_err());
}

/// A flag ends what has begun, in events and in time steps, and what begins after it.
#[test]
fn a_flag_ends_runs_sessions_and_derivatives() {
    let scene = shipped("bounce");
    let mut plan = scene.plan().unwrap();
    for stepping in [false, true] {
        plan.simulation.stepping = stepping;
        let stop = Arc::new(AtomicBool::new(false));
        plan.simulation.stop = Some(stop.clone());
        let mut seen = 0;
        let sampling = Sampling { every: Some(0.01), ..Sampling::default() };
        let run = plan.stream(1e6, sampling, &mut |_| {
            seen += 1;
            stop.store(seen > 5, Ordering::Relaxed);
        });
        let Err(SimError::Stopped { time }) = run else { panic!("{run:?}") };
        assert!(time > 0.0 && time < scene.duration, "{time}");
    }
    plan.simulation.stepping = false;
    let by = plan.sensitivity(scene.duration, &Parameter::all(&plan.simulation));
    assert!(matches!(by, Err(SimError::Stopped { .. })), "{by:?}");
    let session = plan.start().and_then(|mut session| session.advance(1.0));
    assert!(matches!(session, Err(SimError::Stopped { .. })), "{session:?}");
}

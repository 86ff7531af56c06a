//! Charts of scenes with free bodies, and of scenes whose contacts last.

use crate::chart::{Chart, PeerResult, PeerRun, PeerState};
use carom_sim::Scene;
use carom_testing::scenes::shipped as scene;
use std::time::Duration;

/// One run of each method, as a longer one exceeds the budget.
fn chart(scene: &Scene) -> Chart {
    Chart::of(scene, Duration::from_micros(1), &mut |_| {}).unwrap()
}

/// q of a free body has a quaternion, whose negative is the same rotation: the error does not depend on the sign that another program
/// returns. It does depend on the rotation.
#[test]
fn the_sign_of_a_quaternion_is_no_error() {
    let mut scene = scene("bounce");
    scene.duration = 0.2;
    scene.qd = vec![0.0, 0.0, 0.0, 1.0, 2.0, 3.0];
    let last = scene.simulation.run(&scene.q, &scene.qd, scene.duration).unwrap().summary.last;
    let mut chart = chart(&scene);
    let run = |method: &str, q: Vec<f64>| PeerRun {
        scene: "bounce".to_owned(),
        peer: method.to_owned(),
        method: "steps".to_owned(),
        version: "1".to_owned(),
        knob: "dt".to_owned(),
        value: 1e-3,
        wall_time_s: Some(1.0),
        result: Some(PeerResult { r#final: PeerState { q, qd: last.qd.clone() }, after_impact: None }),
        failure: None,
    };
    let with = |turn: [f64; 4]| last.q[..3].iter().copied().chain(turn).collect::<Vec<f64>>();
    let [x, y, z, w] = [3, 4, 5, 6].map(|k| last.q[k]);
    let short = last.q[..6].to_vec();
    for peer in [
        run("same", last.q.clone()),
        run("negative", with([-x, -y, -z, -w])),
        run("inverse", with([-x, -y, -z, w])),
        run("short", short),
    ] {
        chart.add_peer(peer);
    }
    let at_end =
        |peer: &str| chart.runs.iter().find(|run| run.method == format!("{peer} 1, steps")).unwrap().at_end.unwrap();
    assert!(at_end("same") < 1e-9 && at_end("negative") == at_end("same"), "{:?}", chart.runs);
    // The largest entry of q is the height of 0.85 m; z of the quaternion is sin(0.2 s |ω| / 2) 3/|ω|.
    let omega = 14.0_f64.sqrt();
    let wanted = 2.0 * (0.1 * omega).sin() * 3.0 / omega / last.q.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
    assert!((at_end("inverse") - wanted).abs() < 1e-9, "{} instead of {wanted}", at_end("inverse"));
    assert_eq!(chart.absent.last().unwrap().method, "short 1, steps");
}

/// A box tumbles to rest, which takes no time steps at the tolerance of the reference either: two integrators agree on it to 1e-10, at most a
/// thousandth of what any other method here reaches at its coarsest parameter.
#[test]
fn the_reference_of_a_box_that_comes_to_rest_has_no_time_steps() {
    let chart = chart(&scene("box"));
    assert!(chart.doubt_at_end < 1e-10, "{}", chart.doubt_at_end);
    let ends = chart.runs.iter().filter_map(|run| run.at_end);
    assert!(ends.clone().count() > 3 && ends.fold(f64::INFINITY, f64::min) > 1e-7, "{:?}", chart.runs);
}

/// Every run of events has an estimate but those with the tightest tolerances, which no tighter one can tell; no other method has one. An error is
/// at most ten times its estimate, as far as the reference tells.
#[test]
fn estimated_errors_stand_beside_those_of_events() {
    let chart = Chart::of(&scene("planar2"), Duration::from_millis(20), &mut |_| {}).unwrap();
    let (mut compared, mut events) = (0, 0);
    for run in &chart.runs {
        let of_events = run.method.starts_with("events");
        events += usize::from(of_events);
        assert!(run.estimated_at_end.is_none() || of_events, "{run:?}");
        assert!(run.estimated_at_end.is_some() || !of_events || run.value < 1e-12, "{run:?}");
        if let (Some(error), Some(estimate)) = (run.at_end, run.estimated_at_end) {
            compared += 1;
            assert!(error <= 10.0 * (estimate + chart.doubt_at_end), "{run:?}");
        }
    }
    assert!(events >= 22 && compared >= 20, "{compared} of {events}");
    let (csv, table) = (chart.csv(), chart.csv().lines().filter(|line| !line.ends_with(',')).count());
    assert!(
        csv.starts_with("method,knob,value,") && csv.lines().next().unwrap().ends_with(",law,estimated_error_at_end")
    );
    assert_eq!(table, compared + 1);
}

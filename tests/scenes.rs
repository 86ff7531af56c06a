//! The scenes that come with the project tell the stories that their first lines promise.

use carom::sim::{Event, Scene, Trajectory};

fn run(name: &str) -> (Scene, Trajectory) {
    let scene = Scene::from_file(format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let plan = scene.plan().unwrap();
    let run = plan.simulation.run(&plan.q, &plan.qd, scene.duration).unwrap();
    // Nothing is ever inside a surface, but for what a time step overlaps.
    let deepest = (0..=1000)
        .map(|k| run.at(&plan.simulation.chain, scene.duration * f64::from(k) / 1000.0))
        .map(|moment| plan.simulation.smallest_gap(&moment.q).unwrap())
        .fold(f64::INFINITY, f64::min);
    let fastest = run.events.iter().flat_map(|event| &event.qd_minus).fold(0.0_f64, |m, v| m.max(v.abs()));
    assert!(deepest > -2.0 * fastest * plan.simulation.contact_step, "{name}: overlap {deepest}");
    let books = run.summary.energy;
    assert!(books.error().abs() < 1e-6 * books.start.abs().max(books.impacts.abs()), "{name}: {books:?}");
    (scene, run)
}

fn happens(run: &Trajectory, kinds: &[&str]) {
    let mut events = run.events.iter().map(|event: &Event| event.kind.name());
    for kind in kinds {
        let all = || run.events.iter().map(|event| event.kind.name()).collect::<Vec<_>>();
        assert!(events.any(|name| name == *kind), "no '{kind}' where it should be in {:?}", all());
    }
}

#[test]
fn a_three_link_arm_hits_slides_and_lifts_off() {
    happens(&run("planar3").1, &["impact", "zeno", "sliding", "lift-off"]);
}

#[test]
fn a_free_rod_rattles_to_rest_on_both_ends() {
    let (_, run) = run("rod");
    happens(&run, &["impact", "impact", "rest"]);
    assert!((run.summary.last.q[2] - 0.01).abs() < 1e-9);
}

#[test]
fn a_box_tumbles_to_rest_on_a_face() {
    let (_, run) = run("box");
    happens(&run, &["impact", "impact", "stepping", "rest"]);
    let height = run.summary.last.q[2];
    assert!([0.06, 0.04, 0.025].iter().any(|half| (height - half).abs() < 1e-9), "{height}");
}

#[test]
fn a_thrown_ball_bounces_off_floor_and_box() {
    let (scene, run) = run("ball");
    let names: Vec<&str> =
        run.events.iter().filter_map(|event| scene.simulation.touches[event.kind.touch()?].surface()).collect();
    assert!(names.starts_with(&["floor", "box"]), "{names:?}");
}

#[test]
fn a_falling_arm_comes_to_rest_on_a_table() {
    happens(&run("table").1, &["impact", "sliding", "rest"]);
}

#[test]
fn the_experiments_arm_strikes_its_wall_once() {
    let (_, run) = run("planar2");
    assert_eq!(run.events.iter().map(|event| event.kind.name()).collect::<Vec<_>>(), ["impact"]);
}

#[test]
fn a_cradle_sends_its_last_ball_up() {
    let (scene, run) = run("cradle");
    happens(&run, &["several", "several"]);
    let swings = run.at(&scene.simulation.chain, 0.5).q;
    assert!(swings[2] < -0.4 && swings[0].abs() < 1e-9 && swings[1].abs() < 1e-9, "{swings:?}");
}

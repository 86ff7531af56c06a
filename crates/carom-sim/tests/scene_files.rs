//! Scene files: units and bounds of their numbers, messages about refused values, and the bound of a plan.

use carom_sim::{Scene, SimError};

/// Reads a scene with the arm `planar2.urdf`.
fn read(name: &str, text: &str) -> Result<Scene, SimError> {
    let robots = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots");
    let folder = std::env::temp_dir().join(format!("carom-scene-files-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::copy(format!("{robots}/planar2.urdf"), folder.join("arm.urdf")).unwrap();
    std::fs::write(folder.join("scene.toml"), text).unwrap();
    let scene = Scene::from_file(folder.join("scene.toml"));
    std::fs::remove_dir_all(&folder).unwrap();
    scene
}

fn rule(name: &str, text: &str) -> String {
    match read(name, text) {
        Err(SimError::Scene { rule, .. }) => rule,
        other => panic!("{text}\n{other:?}"),
    }
}

const ARM: &str = "[robot]\nurdf = \"arm.urdf\"\nq = [0.7854, -1.5708]\n";
const WALL: &str = "[[surface]]\nshape = { halfspace = { point = [0.65, 0, 0], normal = [-1, 0, 0] } }\n";

/// The displacement of a surface with the frequency f in Hz is amplitude · sin(2π f t + phase).
#[test]
fn the_frequency_of_a_moving_surface_is_in_hertz() {
    let motion = "motion = { amplitude = [0.02, 0, 0], frequency = 2.5, phase = 0.3 }\n";
    let scene = read("hertz", &format!("{ARM}{WALL}{motion}[run]\nduration = 1\n")).unwrap();
    let motion = scene.surfaces[0].motion.unwrap();
    let mut largest = 0.0_f64;
    for time in [0.0, 0.05, 0.1, 0.33] {
        let angle = 2.0 * std::f64::consts::PI * 2.5 * time + 0.3;
        let [place, velocity, _] = motion.at(time);
        // An angle of some radians is rounded to 1e-15.
        assert!((place.x - 0.02 * angle.sin()).abs() < 1e-15, "{place} at {time} s");
        assert!((velocity.x - 0.02 * 5.0 * std::f64::consts::PI * angle.cos()).abs() < 1e-15, "{velocity} at {time} s");
        largest = largest.max(place.x.abs());
    }
    assert!(largest > 0.01);
}

#[test]
fn a_controller_without_its_keys_is_refused_by_name() {
    for (controller, key) in [
        ("pd", "kp"),
        ("constant", "torque"),
        ("torque-file", "torque_file"),
        ("transition", "gain"),
        ("impact-invariant", "kp"),
    ] {
        for asks in ["controller", "after_impact"] {
            let said = rule(controller, &format!("{ARM}{WALL}[run]\nduration = 1\n{asks} = \"{controller}\"\n"));
            assert_eq!(said, format!("[run] {asks} = \"{controller}\" needs the key {key}"));
        }
    }
}

/// A second pair of the same links would count their contact twice. A link paired with itself is refused for that reason.
#[test]
fn a_pair_of_links_that_is_listed_twice_is_refused() {
    let said = |name: &str, links: &str| {
        rule(name, &format!("{ARM}{WALL}[contact]\nlinks = [{links}]\n[run]\nduration = 1\n"))
    };
    assert_eq!(
        said("same", r#"["link1", "tip"], ["link1", "tip"]"#),
        r#"[contact] links = ["link1", "tip"]: the pair is listed twice, remove one"#
    );
    assert_eq!(
        said("turned", r#"["link1", "tip"], ["link1", "link2"], ["tip", "link1"]"#),
        r#"[contact] links = ["tip", "link1"]: the pair is listed twice, remove one"#
    );
    let itself = r#"[contact] links = ["tip", "tip"]: link 'tip' is paired with itself: name two links"#;
    assert_eq!(said("itself", r#"["tip", "tip"]"#), itself);
    let all = format!("{ARM}[contact]\nlinks = [[\"link1\", \"tip\"], [\"link1\", \"link2\"]]\n[run]\nduration = 1\n");
    assert_eq!(read("different", &all).unwrap().simulation.touches.iter().filter(|it| it.link().is_some()).count(), 2);
}

#[test]
fn friction_that_is_negative_or_not_finite_is_refused() {
    for (written, shown) in [("-0.1", "-0.1"), ("inf", "inf"), ("nan", "NaN")] {
        let said = rule("friction", &format!("{ARM}{WALL}[contact]\nfriction = {written}\n[run]\nduration = 1\n"));
        assert_eq!(
            said,
            format!("[contact]: friction is {shown}: a coefficient of friction is finite and not negative")
        );
    }
}

/// The plan's bound on neglected friction is that for an impact at the start pose and velocity: with the wall 2 nm ahead of the
/// tip, the run reports the same bound.
#[test]
fn the_plan_bounds_neglected_friction_as_the_run_does() {
    let text = |friction: f64| {
        format!(
            "[robot]\nurdf = \"arm.urdf\"\nq = [0.7, -1.3]\nqd = [0.3, 1.1]\n\
             [[surface]]\nshape = {{ halfspace = {{ point = [{}, 0, 0], normal = [-1, 0, 0] }} }}\n\
             [contact]\nlaw = \"energetic\"\nrestitution = 0.35\nfriction = {friction}\n\
             [run]\nduration = 1e-3\nneglect = 0.9\nmax_events = 1\n",
            // Both links are 0.45 m long; the tip is a ball of 1 µm.
            0.45 * (0.7_f64.cos() + (0.7_f64 - 1.3).cos()) + 1e-6 + 2e-9
        )
    };
    for friction in [0.0, 0.01, 0.1] {
        let plan = read("bound", &text(friction)).unwrap().plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 1e-3).unwrap();
        let statistics = run.summary.statistics;
        assert_eq!((run.events.len(), run.events[0].kind.name()), (1, "impact"));
        let bounds: Vec<f64> = plan.bounded.iter().filter(|it| it.what == "friction").map(|it| it.bound).collect();
        if friction == 0.0 {
            assert!(bounds.is_empty() && statistics.neglected == 0, "{bounds:?}");
            continue;
        }
        assert_eq!((bounds.len(), statistics.neglected), (1, 1));
        // The arm turns by some nanoradians between the start and the impact.
        let off = bounds[0] / statistics.neglected_bound - 1.0;
        assert!(bounds[0] > 0.1 * friction && off.abs() < 1e-7, "{bounds:?} {statistics:?}");
    }
}

//! `carom simulate`: output, files and refusals.

use crate::desk::*;
use serde_json::Value;

const SCENE: &str = include_str!("../../../../scenes/planar2.toml");

impl Desk {
    fn scene(&self, change: impl Fn(String) -> String) {
        self.write("s.toml", change(SCENE.replace("../robots/", "")));
    }

    #[track_caller]
    fn refuses_scene(&self, change: impl Fn(String) -> String, message: &str) {
        self.scene(change);
        let before = self.files("");
        refused(self.run("simulate s.toml --json --csv x.csv"), message);
        assert_eq!(self.files(""), before, "nothing is written");
    }
}

#[test]
fn simulate_gives_events_and_a_table() {
    let desk = Desk::new("simulate");
    desk.scene(|text| text);
    let summary = &desk.answers("simulate s.toml --json --csv x.csv", "")[0];
    for key in ["stop_reason", "events", "final", "energy", "statistics"] {
        assert!(!summary[key].is_null(), "{key}");
    }
    let event = &summary["events"][0];
    assert_eq!((event["kind"].as_str(), event["contact"].as_str()), (Some("impact"), Some("tip on surface 1")));
    let number = |v: &Value| v.as_f64().unwrap();
    // Closed form of v_t⁺ at 45°, .2 m/s, e = .35: .31079 m/s down the wall.
    assert!((number(&event["impact"]["u_plus"][1]) + 0.31079).abs() < 5e-6);
    assert!((number(&event["impact"]["u_plus"][0]) + 0.35 * 0.2 * 0.5_f64.sqrt()).abs() < 1e-6);
    let lost = number(&summary["energy"]["start"]) - number(&summary["energy"]["end"]);
    assert!((lost - number(&summary["energy"]["lost_in_impacts"])).abs() < 1e-8);
    let table = std::fs::read_to_string(desk.0.join("x.csv")).unwrap();
    assert!(table.starts_with("time,q.shoulder,q.elbow,qd.shoulder,qd.elbow\n0,0.7854,-1.5708,"));
    assert_eq!(table.lines().count(), 127);
}

#[test]
fn invalid_scenes_are_refused_with_the_reason() {
    let desk = Desk::new("simulate-bad");
    desk.refuses_scene(
        |text| text.replace("restitution =", "restituton ="),
        "s.toml: line 12: unknown field `restituton`, expected one of `law`, `restitution`, `tangential_restitution`, `friction`, \
         `limit_restitution`, `latch`, `compliance`, `several`, `links`, `pair`; did you mean `restitution`?",
    );
    desk.refuses_scene(
        |text| text.replace("0.6364, 0, 0]", "0.63, 0, 0]"),
        "s.toml: at the start tip on surface 1 overlaps by 0.006396 m: choose a start without overlap",
    );
    desk.refuses_scene(
        |text| text.replace("tolerance = 1e-9", "tolerance = 0"),
        "s.toml: tolerance is 0: it must be positive and finite",
    );
    desk.refuses_scene(
        |text| text.replace("0.35", "1.5"),
        "s.toml: [contact]: restitution is 1.5: a coefficient of restitution lies between 0 and 1",
    );
    desk.refuses_scene(
        |text| text.replace("\"energetic\"", "\"hertz\""),
        "s.toml: [contact] law = \"hertz\": the laws are frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith",
    );
    desk.refuses_scene(
        |text| text.replace("q = [0.7854, -1.5708]", "q = [0.7854]"),
        "s.toml: q has 1 numbers, 2 are needed (shoulder, elbow)",
    );
    desk.refuses_scene(
        |text| text.replace("normal = [-1, 0, 0]", "normal = [0, 0, 0]"),
        "s.toml: [[surface]] 'surface 1': obstacle: normal is (0, 0, 0): a direction must not be zero",
    );
}

/// A surface out of reach is no error: the run has no events.
#[test]
fn a_surface_out_of_reach_gives_no_events() {
    let desk = Desk::new("simulate-far");
    desk.scene(|text| text.replace("0.6364, 0, 0]", "2, 0, 0]"));
    let summary = &desk.answers("simulate s.toml --json", "")[0];
    assert_eq!(summary["events"].as_array().unwrap().len(), 0);
    assert_eq!((summary["stop_reason"].as_str(), summary["mode"].as_str()), (Some("duration"), Some("free")));
}

/// With the feature `rerun` the file is complete; without it the option is refused.
#[test]
fn a_recording_is_complete_or_not_written() {
    let desk = Desk::new("record");
    desk.scene(|text| text);
    let files = desk.files("").len();
    let ran = desk.run("simulate s.toml --out x.rrd");
    if !cfg!(feature = "rerun") {
        refused(ran, "--out, --connect and --spawn need recordings: build carom with the feature rerun");
        assert_eq!(desk.files("").len(), files);
        return;
    }
    assert_eq!(ran.code, Some(0), "{ran:?}");
    assert!(desk.0.join("x.rrd").metadata().unwrap().len() > 10_000);
    assert_eq!(desk.files("").len(), files + 1, "the recording and no other new file");
    let ran = desk.run("simulate s.toml --connect rerun+http://127.0.0.1:1/proxy");
    assert_eq!(ran.code, Some(1));
    let words = "error: the viewer cannot be used: rerun+http://127.0.0.1:1/proxy: ";
    assert!(ran.err.starts_with(words), "{}", ran.err);
}

//! `carom simulate`: scenes from the command line, and what is refused.

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// A folder of its own for each test, gone afterwards.
struct Desk(PathBuf);

impl Desk {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("carom-simulate-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn scene(&self, change: impl Fn(String) -> String) -> String {
        let text = std::fs::read_to_string(format!("{ROOT}/scenes/planar2.toml")).unwrap();
        let text = text.replace("../robots", &format!("{ROOT}/robots"));
        std::fs::write(self.0.join("s.toml"), change(text)).unwrap();
        "s.toml".into()
    }

    fn run(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_carom")).args(args).current_dir(&self.0).output().unwrap()
    }

    #[track_caller]
    fn refused(&self, change: impl Fn(String) -> String, message: &str) {
        let scene = self.scene(change);
        let ran = self.run(&["simulate", &scene, "--json", "--csv", "x.csv"]);
        let said = String::from_utf8(ran.stderr).unwrap();
        assert_eq!((ran.status.code(), said.trim_end()), (Some(1), message));
        assert!(ran.stdout.is_empty());
        assert_eq!(std::fs::read_dir(&self.0).unwrap().count(), 1, "nothing is written but the scene itself");
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_designs_scene_gives_events_and_a_table() {
    let desk = Desk::new("good");
    let scene = desk.scene(|text| text);
    let ran = desk.run(&["simulate", &scene, "--json", "--csv", "x.csv"]);
    assert!(ran.status.success(), "{ran:?}");
    let summary: Value = serde_json::from_slice(&ran.stdout).unwrap();
    for key in ["stop_reason", "events", "final", "energy", "statistics"] {
        assert!(!summary[key].is_null(), "{key}");
    }
    let event = &summary["events"][0];
    assert_eq!((event["kind"].as_str(), event["contact"].as_str()), (Some("impact"), Some("tip on surface 1")));
    let number = |v: &Value| v.as_f64().unwrap();
    // v_t⁺ of the closed form at 45°, .2 m/s, e = .35: .31079 m/s down the wall.
    assert!((number(&event["impact"]["u_plus"][1]) + 0.31079).abs() < 5e-6);
    assert!((number(&event["impact"]["u_plus"][0]) + 0.35 * 0.2 * 0.5_f64.sqrt()).abs() < 1e-6);
    let lost = number(&summary["energy"]["start"]) - number(&summary["energy"]["end"]);
    assert!((lost - number(&summary["energy"]["lost_in_impacts"])).abs() < 1e-8);
    let table = std::fs::read_to_string(desk.0.join("x.csv")).unwrap();
    assert!(table.starts_with("time,q.shoulder,q.elbow,qd.shoulder,qd.elbow\n0,0.7854,-1.5708,"));
    assert_eq!(table.lines().count(), 127);
}

#[test]
fn scenes_that_can_not_be_are_refused_with_the_reason() {
    let desk = Desk::new("bad");
    desk.refused(
        |text| text.replace("restitution =", "restituton ="),
        "error: s.toml: line 12: unknown field `restituton`, expected one of `law`, `restitution`, `friction`, \
         `limit_restitution`, `latch`, `compliance`, `several`, `links`, `pair`; did you mean `restitution`?",
    );
    desk.refused(
        |text| text.replace("0.6364, 0, 0]", "0.63, 0, 0]"),
        "error: s.toml: at the start tip on surface 1 overlaps by 0.006395934260112617 m: move the start apart",
    );
    desk.refused(
        |text| text.replace("tolerance = 1e-9", "tolerance = 0"),
        "error: s.toml: tolerance is 0: it must be positive and finite",
    );
    desk.refused(
        |text| text.replace("0.35", "1.5"),
        "error: s.toml: [contact]: restitution is 1.5: a coefficient of restitution lies between 0 and 1",
    );
    desk.refused(
        |text| text.replace("\"energetic\"", "\"hertz\""),
        "error: s.toml: [contact] law = \"hertz\": the laws are frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith",
    );
    desk.refused(
        |text| text.replace("q = [0.7854, -1.5708]", "q = [0.7854]"),
        "error: s.toml: q has 1 numbers, 2 are needed (shoulder, elbow)",
    );
    desk.refused(
        |text| text.replace("normal = [-1, 0, 0]", "normal = [0, 0, 0]"),
        "error: s.toml: [[surface]] 'surface 1': obstacle: normal is (0, 0, 0): a direction needs a length",
    );
}

/// A surface out of reach is a plain answer: nothing happens.
#[test]
fn an_unreachable_surface_is_no_error() {
    let desk = Desk::new("far");
    let scene = desk.scene(|text| text.replace("0.6364, 0, 0]", "2, 0, 0]"));
    let ran = desk.run(&["simulate", &scene, "--json"]);
    let summary: Value = serde_json::from_slice(&ran.stdout).unwrap();
    assert_eq!(summary["events"].as_array().unwrap().len(), 0);
    assert_eq!((summary["stop_reason"].as_str(), summary["mode"].as_str()), (Some("duration"), Some("free")));
}

/// Recordings, or a word on why there are none.
#[test]
fn a_recording_is_whole_or_not_there() {
    let desk = Desk::new("record");
    let scene = desk.scene(|text| text);
    let ran = desk.run(&["simulate", &scene, "--out", "x.rrd"]);
    let files = || std::fs::read_dir(&desk.0).unwrap().count();
    if !cfg!(feature = "rerun") {
        let said =
            "error: --out, --connect and --spawn need recordings, without which this carom was built (feature rerun)";
        assert_eq!(String::from_utf8(ran.stderr).unwrap().trim_end(), said);
        assert_eq!((ran.status.code(), files()), (Some(1), 1));
        return;
    }
    assert!(ran.status.success(), "{ran:?}");
    assert!(desk.0.join("x.rrd").metadata().unwrap().len() > 10_000);
    assert_eq!(files(), 2, "the scene and the recording");
    let ran = desk.run(&["simulate", &scene, "--out", "nowhere/x.rrd"]);
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(said.starts_with("error: nowhere/x.rrd: the recording can't be written: "), "{said}");
    assert_eq!((ran.status.code(), files()), (Some(1), 2));
    let ran = desk.run(&["simulate", &scene, "--connect", "rerun+http://127.0.0.1:1/proxy"]);
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(said.starts_with("error: the viewer can't be used: rerun+http://127.0.0.1:1/proxy: "), "{said}");
}

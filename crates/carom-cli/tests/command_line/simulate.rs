//! `carom simulate`: output, files and refusals.

use crate::command_line::desk::*;
use carom_sim::{Parameter, Scene};
use carom_testing::build::{Part, Z, ball, urdf};
use carom_testing::files::text;
use serde_json::Value;

const SCENE: &str = include_str!("../../../../scenes/planar2.toml");

impl Desk {
    fn scene(&self, change: impl Fn(String) -> String) {
        self.write("s.toml", change(SCENE.replace("../robots/", "")));
    }
}

#[test]
fn simulate_gives_events_and_a_table() {
    let desk = Desk::new();
    desk.scene(|text| text);
    let summary = &desk.one("simulate s.toml --json --csv x.csv");
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
    let table = desk.read("x.csv");
    assert!(table.starts_with("time,q.shoulder,q.elbow,qd.shoulder,qd.elbow\n0,0.7854,-1.5708,"));
    assert_eq!(table.lines().count(), 127);
}

/// The loads of an event in the answer are the rows of its time in the table; the motors have columns only where loads are asked for.
#[test]
fn loads_of_a_run_are_in_the_answer_and_in_tables() {
    let desk = Desk::new();
    desk.scene(|text| {
        text.replace("\"off\"", "\"pd\"\nkp = 9\nkd = 1\ntarget = [0.7854, -1.5708]").replace("= 0.5", "= 0.02")
    });
    let run = &desk.one("simulate s.toml --json --loads --out x.csv --joint-loads l.csv");
    let event = run["events"].as_array().unwrap().iter().find(|event| event["kind"] == "impact").unwrap();
    let rows = |file: &str| -> Vec<Vec<String>> {
        let text = desk.read(file);
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let loads = rows("l.csv");
    assert_eq!(loads[0].join(","), "time,kind,joint,fx,fy,fz,mx,my,mz,joint_impulse,motor_minus,motor_plus");
    assert_eq!(loads.len(), 3);
    for (k, row) in loads[1..].iter().enumerate() {
        let bearing = &event["loads"]["bearings"][k];
        assert_eq!((&row[1], row[2].as_str()), (&"impact".to_owned(), bearing["joint"].as_str().unwrap()));
        let own = [&bearing["force"][0], &bearing["force"][1], &bearing["force"][2]];
        let of = |name: &str| &event["loads"][name][k];
        let numbers =
            [&event["time"]].into_iter().chain(own).chain(["joint_impulse", "motors_minus", "motors_plus"].map(of));
        for (cell, number) in [0, 3, 4, 5, 9, 10, 11].into_iter().zip(numbers) {
            // serde_json reads decimals to a unit of the last place.
            let (cell, number) = (row[cell].parse::<f64>().unwrap(), number.as_f64().unwrap());
            assert!((cell - number).abs() <= f64::EPSILON * number.abs(), "{number} in {row:?}");
        }
    }
    let states = rows("x.csv");
    assert_eq!(states[0].join(","), "time,q.shoulder,q.elbow,qd.shoulder,qd.elbow,motor.shoulder,motor.elbow");
    // kp (q* − q) − kd q̇ at the start: the target is the start.
    let at = |k: usize| states[1][k].parse::<f64>().unwrap();
    assert!((at(5) + at(3)).abs() < 1e-12 && (at(6) + at(4)).abs() < 1e-12 && at(5) != 0.0, "{:?}", states[1]);
    let plain = desk.run("simulate s.toml --json --out y.csv");
    assert!(!plain.out.contains("loads") && rows("y.csv")[0].len() == 5);
    let said = desk.run("simulate s.toml --loads").out;
    assert!(said.contains("through shoulder") && said.contains("motors ("), "{said}");
    let why = "--runs: write one table, with --out, without --contacts, --events, --joint-loads and recordings";
    desk.refused("simulate s.toml --joint-loads l.csv --runs 2", why);
}

/// The cells of a line of CSV, some of them in quotes.
fn cells(line: &str) -> Vec<&str> {
    let mut quoted = false;
    let mut split = |c: char| {
        quoted ^= c == '"';
        c == ',' && !quoted
    };
    line.split(&mut split).map(|cell| cell.trim_matches('"')).collect()
}

/// The rows of a table as maps from column to cell.
fn rows(table: &str) -> Vec<std::collections::BTreeMap<&str, &str>> {
    let mut lines = table.lines().map(cells);
    let names: Vec<&str> = lines.next().unwrap();
    lines.map(|cells| names.iter().copied().zip(cells).collect()).collect()
}

#[test]
fn the_table_of_events_has_the_numbers_of_the_answer() {
    let desk = Desk::new();
    for robot in ["box", "quadruped"] {
        desk.0.copy(&format!("robots/{robot}.urdf"));
        let scene = text(&format!("scenes/{robot}.toml"));
        desk.write("s.toml", scene.replace("../robots/", ""));
        let run = &desk.one("simulate s.toml --json --events e.csv");
        let table = desk.read("e.csv");
        let rows = rows(&table);
        let number = |cell: &str| cell.parse::<f64>().unwrap();
        let near = |cell: &str, value: &Value| (number(cell) - value.as_f64().unwrap()).abs() < 1e-12;
        let (mut at, mut struck) = (0, 0);
        for event in run["events"].as_array().unwrap() {
            let own: Vec<_> = rows[at..].iter().take_while(|row| near(row["time"], &event["time"])).collect();
            let impulses = event["impulses"].as_array().map_or(&[][..], Vec::as_slice);
            let contacts = event["contacts"].as_array().map_or(1, Vec::len).max(1).max(impulses.len());
            assert!(own.len() >= contacts, "{event}");
            for row in &own[..contacts] {
                assert_eq!(row["event"], event["kind"]);
                let of =
                    |impulse: &&Value| impulse["contact"] == row["contact"] && near(row["x"], &impulse["point"][0]);
                let impulse = impulses.iter().find(of);
                assert_eq!(impulse.is_some(), row["px"] != "NaN", "{row:?}");
                if let Some(impulse) = impulse {
                    assert!(["px", "py", "pz"].iter().enumerate().all(|(k, p)| near(row[p], &impulse["impulse"][k])));
                    struck += 1;
                }
                if let Some(u) = event["impact"]["u_minus"].as_array() {
                    assert!(near(row["uz_minus"], &u[2]) && near(row["ux_plus"], &event["impact"]["u_plus"][0]));
                    assert_eq!(row["detail"], event["impact"]["mode"]);
                }
                let joint =
                    table.lines().next().unwrap().split(',').find(|name| name.starts_with("qd_minus.")).unwrap();
                assert!(near(row[joint], &event["qd_minus"][0]));
            }
            at += contacts;
        }
        assert!(at == rows.len() && struck > 1, "{at} of {} rows, {struck} impulses", rows.len());
        let printed = desk.run("simulate s.toml --events -");
        assert_eq!(printed.out, table);
        desk.run("simulate s.toml --events e.parquet");
        assert!(desk.files("").contains(&"e.parquet".to_owned()));
    }
}

/// A box that spins on its four corners: an event with its reason and contacts, a flag at each contact of answer and table, the time.
#[test]
fn simulate_tells_where_a_motion_is_not_unique() {
    let desk = Desk::new();
    let scene = |spin: f64| {
        format!(
            r#"[robot]
urdf = "box.urdf"
floating = true
tip = "box"
q = [0, 0, 0.025, 0, 0, 0, 1]
qd = [0.5, 0, 0, 0, 0, {spin}]
[[surface]]
name = "floor"
shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}
[contact]
law = "newton"
restitution = 0
friction = 0.3
[run]
duration = 0.02
gravity = [0, 0, -9.81]
"#
        )
    };
    for (spin, words) in [(0.0, &[][..]), (3.0, &["non-unique"])] {
        desk.write("s.toml", scene(spin));
        let run = &desk.one("simulate s.toml --json --contacts c.csv");
        let open = |event: &&Value| event["kind"] == "non-unique";
        let events: Vec<&Value> = run["events"].as_array().unwrap().iter().filter(open).collect();
        assert_eq!(events.len(), words.len(), "{run}");
        for event in events {
            assert_eq!(event["reason"], "the motion depends on the distribution of forces over redundant contacts");
            assert_eq!(event["contacts"].as_array().unwrap().len(), 4);
        }
        let contacts = run["final"]["contacts"].as_array().unwrap();
        assert!(contacts.len() == 4 && contacts.iter().all(|contact| contact["flags"] == serde_json::json!(words)));
        let time = run["statistics"]["non_unique_time"].as_f64().unwrap();
        assert!((time - 0.02 * words.len() as f64).abs() < 1e-12, "{time}");
        let table = desk.read("c.csv");
        let end = format!(",{}", words.join(""));
        let mut lines = table.lines();
        assert!(lines.next().unwrap().ends_with(",normal_force,flags"));
        assert!(lines.all(|line| line.ends_with(&end)), "{table}");
        let said = desk.run("simulate s.toml").out;
        assert_eq!(said.contains("non-unique"), !words.is_empty(), "{said}");
    }
}

/// The tests of the library compare them with differences of runs.
#[test]
fn sensitivities_are_those_of_the_library() {
    let desk = Desk::new();
    desk.scene(|text| text.replace("friction = 0.0", "friction = 0.1").replace("1e-9", "1e-11"));
    let answer = &desk.one("simulate s.toml --sensitivity --json");
    assert!(has_no_null(answer));
    let own = &answer["sensitivity"];
    assert_eq!(keys(own), ["events", "final", "names"]);
    let names = ["q shoulder", "q elbow", "qd shoulder", "qd elbow", "restitution", "friction"];
    assert_eq!(texts(&own["names"]), names);
    let rows = own["final"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["of"].as_str().unwrap()).collect::<Vec<_>>(), names[..4]);

    let scene = Scene::from_file(desk.join("s.toml")).unwrap();
    let parameters = [Parameter::restitution(), Parameter::friction()];
    let expected = scene.plan().unwrap().sensitivity(scene.duration, &parameters).unwrap();
    let agree = |found: &Value, expected: Vec<f64>| {
        let found = numbers(found);
        assert_eq!(found.len(), expected.len());
        found.iter().zip(&expected).for_each(|(x, y)| close("by", *x, *y, 1e-12 * (1.0 + y.abs())));
    };
    for (row, expected) in rows.iter().zip(expected.last_by.unwrap().row_iter()) {
        agree(&row["by"], expected.iter().copied().collect());
    }
    let events = own["events"].as_array().unwrap();
    assert_eq!(events.len(), expected.events.len());
    for (event, expected) in events.iter().zip(expected.events) {
        agree(&event["time_by"], expected.time_by);
    }
    // Some columns: by names, by words that names begin with, by keys.
    let some = &desk.one("simulate s.toml --sensitivity --wrt friction,qd,contact.friction --json")["sensitivity"];
    assert_eq!(texts(&some["names"]), ["friction", "qd shoulder", "qd elbow", "contact.friction"]);
    for (row, all) in some["final"].as_array().unwrap().iter().zip(rows) {
        let (own, all) = (numbers(&row["by"]), numbers(&all["by"]));
        let scale = all.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
        assert_eq!(own.len(), 4);
        own.iter().zip([all[5], all[2], all[3], all[5]]).for_each(|(own, all)| close("wrt", *own, all, 1e-8 * scale));
    }
    desk.refused("simulate s.toml --sensitivity --wrt frction",
        "--wrt: 'frction' is no number of the scene: wrt has \"q\", \"qd\", q shoulder, q elbow, qd shoulder, qd elbow, restitution, \
         friction, and paths of keys like contact.friction",
    );
    desk.refused("simulate s.toml --sensitivity --wrt contact.law",
        "--wrt: contact.law: the scene has no number there: give it one, so that it can be changed; lists have entries like \
         run.gravity[2]",
    );
    usage(desk.run("simulate s.toml --wrt q"), "--sensitivity");
    let text = desk.run("simulate s.toml --sensitivity").out;
    assert!(text.contains("\n  time of impact at 2.8749") && text.contains("\n  final qd elbow: "), "{text}");
}

/// Where the derivatives end, the time and the reason are told, and there is no matrix. What has no derivative at all is refused.
#[test]
fn sensitivities_that_do_not_exist_are_told_or_refused() {
    let desk = Desk::new();
    let ball = Part::slider("ball", "base", Z).weighing(2.0, [1.0; 3]).shaped(&ball(0.1));
    desk.write("ball.urdf", urdf(&[ball]));
    let scene = r#"robot = { urdf = "ball.urdf", tip = "ball", q = [0.1], qd = [-1] }
        surface = [{ shape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } } }]
        contact = { restitution = 0.5 }
        run = { duration = 0.1, gravity = [0, 0, -9.81] }"#;
    desk.write("b.toml", scene);
    let answer = &desk.one("simulate b.toml --sensitivity --json")["sensitivity"];
    assert_eq!(keys(answer), ["broken", "events", "names"]);
    assert_eq!(number(&answer["broken"]["time"]), 0.0);
    let reason = answer["broken"]["reason"].as_str().unwrap();
    assert!(reason.contains("begins with an impact"), "{reason}");
    let text = desk.run("simulate b.toml --sensitivity").out;
    assert!(text.contains("no derivatives: they end at 0 s: "), "{text}");

    desk.write("b.toml", scene.replace("duration", "method = \"steps\", contact_step = 1e-3, duration"));
    desk.refused(
        "simulate b.toml --sensitivity",
        "b.toml: --sensitivity: time steps have no derivative: take method = \"events\" in [run]",
    );
    usage(desk.run("simulate b.toml --sensitivity --runs 3"), "cannot be used with");
}

/// With the feature `rerun` the file is complete; without it the option is refused.
#[test]
fn a_recording_is_complete_or_not_written() {
    let desk = Desk::new();
    desk.scene(|text| text);
    let files = desk.files("").len();
    let ran = desk.run("simulate s.toml --out x.rrd");
    if !cfg!(feature = "rerun") {
        refused(ran, "--out, --connect and --spawn need recordings: build carom with the feature rerun");
        assert_eq!(desk.files("").len(), files);
        return;
    }
    assert_eq!(ran.code, Some(0), "{ran:?}");
    assert!(desk.join("x.rrd").metadata().unwrap().len() > 10_000);
    assert_eq!(desk.files("").len(), files + 1, "the recording and no other new file");
    let ran = desk.run("simulate s.toml --connect rerun+http://127.0.0.1:1/proxy");
    assert_eq!(ran.code, Some(1));
    let words = "error: the viewer cannot be used: rerun+http://127.0.0.1:1/proxy: ";
    assert!(ran.err.starts_with(words), "{}", ran.err);
}

/// What is printed of a run says what happened: a ball that bounces does not stick, blows at several contacts have their impulses
/// and velocities, and contacts that come to last at the same time are one row.
#[test]
fn printed_events_say_what_happened() {
    let desk = Desk::new();
    let print = |name: &str, robots: &[&str]| {
        for robot in robots {
            desk.0.copy(robot);
        }
        let scene = text(&format!("scenes/{name}.toml"));
        desk.write("s.toml", scene.replace("../robots/", ""));
        let (ran, whole) = (desk.run("simulate s.toml"), desk.one("simulate s.toml --json"));
        done(&ran);
        (ran.out, whole)
    };
    let (ball, whole) = print("bounce", &["robots/ball.urdf"]);
    assert_eq!(whole["events"][0]["impact"]["mode"], "stick");
    assert!(ball.lines().next().unwrap().ends_with("N s, no slip"), "{ball}");
    assert!(ball.trim_end().ends_with("evaluations; 0 time steps"), "{ball}");

    let (row, whole) = print("box", &["robots/box.urdf"]);
    let events = whole["events"].as_array().unwrap();
    let blow = events.iter().find(|event| event["kind"] == "several").unwrap();
    let size = |it: &Value| numbers(&it["impulse"]).iter().map(|x| x * x).sum::<f64>().sqrt();
    let impulses: Vec<String> = blow["impulses"]
        .as_array()
        .unwrap()
        .iter()
        .map(|it| format!("{} ({:.7} N s)", it["contact"].as_str().unwrap(), size(it)))
        .collect();
    let at = row.lines().position(|line| line.contains(" several ")).unwrap();
    let printed: Vec<&str> = row.lines().skip(at).take(2).collect();
    assert!(impulses.iter().all(|it| printed[0].contains(it)), "{printed:?}: {impulses:?}");
    let qd = format!("qd⁻ ({:.7} ", numbers(&blow["qd_minus"])[0]);
    assert!(printed[1].trim_start().starts_with(&qd), "{printed:?}: {qd}");
    let both = "zeno       box on floor, corner 1; box on floor, corner 2";
    assert!(row.lines().any(|line| line.ends_with(both)), "{row}");
    let kinds = |kind: &str| events.iter().filter(|event| event["kind"] == kind).count();
    assert!(row.matches(" zeno ").count() < kinds("zeno"), "two corners that come to rest together are one row");
}

/// The same estimates in the answer, in both tables and for people; without the option there are none of them.
#[test]
fn errors_of_a_run_are_in_the_answer_and_in_tables() {
    let desk = Desk::new();
    desk.scene(|text| text);
    let answer = &desk.one("simulate s.toml --error --json --out x.csv --events e.csv");
    let error = &answer["error"];
    assert_eq!(error["tighter"].as_array().unwrap().len(), 1);
    let table = desk.read("x.csv");
    let header = "time,q.shoulder,q.elbow,qd.shoulder,qd.elbow,error.q.shoulder,error.q.elbow,error.qd.shoulder,error.qd.elbow\n";
    assert!(table.starts_with(header), "{table}");
    let last: Vec<f64> = table.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    let of = |key: &str| error["final"][key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap());
    let whole: Vec<f64> = of("q").chain(of("qd")).collect();
    assert!(last[5..] == whole && whole.iter().all(|x| *x > 0.0 && *x < 1e-9), "{last:?} {whole:?}");
    let events = desk.read("e.csv");
    let time_error = answer["events"][0]["time_error"].as_f64().unwrap();
    assert!(events.lines().next().unwrap().ends_with(",time_error"));
    assert_eq!(events.lines().nth(1).unwrap().rsplit(',').next().unwrap().parse::<f64>(), Ok(time_error));
    let told = desk.run("simulate s.toml --error").out;
    assert!(
        told.contains("estimated errors, by a run with the tolerance") && told.contains("times of events ±"),
        "{told}"
    );
    let plain = &desk.one("simulate s.toml --json");
    assert!(plain["error"].is_null() && plain["events"][0]["time_error"].is_null());
    desk.scene(|text| text.replace("[run]", "[run]\nmethod = \"steps\""));
    let told = desk.run("simulate s.toml --error").out;
    assert!(told.contains("no estimate of the error: at 0 s time steps begin"), "{told}");
}

#[test]
fn a_scene_with_an_accuracy_has_a_tolerance_of_its_own() {
    let desk = Desk::new();
    let accurate = |accuracy: &str| {
        desk.scene(|text| {
            text.replace("tolerance = 1e-9\n", "").replace("[run]", &format!("[run]\naccuracy = {accuracy}"))
        });
    };
    accurate("1e-8");
    let answer = &desk.one("simulate s.toml --json");
    let accuracy = &answer["accuracy"];
    assert_eq!(accuracy["asked"].as_f64(), Some(1e-8));
    assert!(accuracy["error"].as_f64().unwrap() <= 1e-8 && accuracy["tolerance"].as_f64().unwrap() > 0.0);
    let plan = desk.run("plan s.toml").out;
    assert!(plan.contains("accuracy = 1e-8"), "{plan}");
    // Sampled and not, it is the same run.
    let sampled = &desk.one("simulate s.toml --json --out x.csv");
    assert_eq!((&sampled["final"], &sampled["events"]), (&answer["final"], &answer["events"]));
    accurate("1e-17");
    let ran = desk.run("simulate s.toml");
    let words = ["s.toml", "accuracy = 1e-17", "rounding prevents", "ask for less"];
    words.iter().for_each(|words| refused_with(&ran, words));
    accurate("1e-8\ntolerance = 1e-9");
    refused_with(&desk.run("simulate s.toml"), "give one of tolerance and accuracy");
}

//! `carom simulate`: starts from files, many runs from disturbed starts, interruption.

use crate::command_line::desk::*;
use serde_json::Value;
use std::time::Duration;

/// An arm without motors, beside a wall.
const SCENE: &str = r#"[robot]
urdf = "planar2.urdf"
q = [0.7854, -1.5708]
qd = [-0.2, 0.3]
[[surface]]
shape = { halfspace = { point = [0.7, 0, 0], normal = [-1, 0, 0] } }
[contact]
law = "newton"
restitution = 0.5
friction = 0.1
[run]
gravity = [0, -9.81, 0]
duration = 0.6
"#;

/// The scene's text and the units of all columns are in the metadata, which Parquet files hold as plain text at their end.
#[test]
fn parquet_tables_of_runs_hold_their_scene_and_units() {
    let desk = Desk::new();
    let scene = SCENE.replace("duration", "perturb = { qd = 0.01 }\nduration");
    desk.write("s.toml", &scene);
    desk.run("simulate s.toml --parquet run.parquet --contacts contacts.parquet");
    desk.run("simulate s.toml --runs 2 --parquet runs.parquet");
    let cases = [
        ("run", r#""qd.elbow":"rad/s","qd.shoulder":"rad/s","time":"s"}"#),
        ("contacts", r#""x":"m","y":"m","z":"m"}"#),
        ("runs", r#""start.qd.elbow":"rad/s","start.qd.shoulder":"rad/s"}"#),
    ];
    for (name, units) in cases {
        let bytes = std::fs::read(desk.join(format!("{name}.parquet"))).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        for part in ["carom.version", "carom.units", units, "carom.scene", &scene] {
            assert!(text.contains(part), "{name}: {part}");
        }
    }
}

/// What a run remembers beside its state is not part of one, and this is said: that a robot was hit, and what compliant contacts remember.
#[test]
fn a_run_from_a_state_says_what_the_state_lacks() {
    let desk = Desk::new();
    desk.write("state.json", r#"{"q": [0.7854, -1.5708], "qd": [0.3, -0.9]}"#);
    let warned = |text: String| {
        desk.write("s.toml", text);
        let ran = desk.run("simulate s.toml --from-state state.json");
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        ran.err.lines().filter(|line| line.starts_with("warning: --from-state")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(warned(SCENE.to_owned()).is_empty());
    let after = warned(SCENE.replace("[run]", "[run]\nafter_impact = \"gravity-compensation\""));
    assert!(after.len() == 1 && after[0].contains("after_impact"), "{after:?}");
    let soft = "[contact]\ncompliance = { stiffness = 1e6, exponent = 1 }";
    let soft = warned(SCENE.replace("[contact]", soft));
    assert!(soft.len() == 1 && soft[0].contains("compliant contacts"), "{soft:?}");
}

/// A run from the last state of another one continues it: the end is that of the run in one piece, and so is its time.
#[test]
fn a_run_continues_from_the_answer_of_another_one() {
    let desk = Desk::new();
    desk.write("s.toml", SCENE);
    desk.write("half.toml", SCENE.replace("duration = 0.6", "duration = 0.3"));
    let whole = &desk.one("simulate s.toml --json")["final"];
    let half = desk.run("simulate half.toml --json");
    desk.write("half.json", &half.out);
    let state = &serde_json::from_str::<Value>(&half.out).unwrap()["final"];
    desk.write("state.json", state.to_string());
    for file in ["half.json", "state.json"] {
        let rest = &desk.one(&format!("simulate half.toml --from-state {file} --json"))["final"];
        assert_eq!(rest["time"].as_f64(), Some(0.6));
        for key in ["q", "qd"] {
            for (a, b) in numbers(&rest[key]).iter().zip(numbers(&whole[key])) {
                // The tolerance of both is 1e-9; an impact amplifies little.
                assert!((a - b).abs() < 1e-6, "{key}: {a} {b}");
            }
        }
    }
    desk.write("bad.json", r#"{"q": [0], "qd": [0, 0]}"#);
    desk.refused(
        "simulate s.toml --from-state bad.json",
        "--from-state bad.json: q has 1 numbers, 2 are needed (shoulder, elbow)",
    );
    desk.write("bad.json", "{}");
    let needed = "it must be an object with q and qd, and time if wanted, or the answer of carom simulate --json";
    desk.refused(
        "simulate s.toml --from-state bad.json",
        &format!("--from-state bad.json: missing field `q` at line 1 column 2: {needed}"),
    );
    desk.write("bad.json", r#"{"q": [0, 0], "qd": [0, 0], "tme": 1}"#);
    desk.refused(
        "simulate s.toml --from-state bad.json",
        &format!(
            "--from-state bad.json: unknown field `tme`, expected one of `time`, `q`, `qd`, `contacts` at line 1 column 33: {needed}"
        ),
    );
    refused_with(&desk.run("simulate s.toml --from-state none.json"), "error: none.json: cannot be read");
}

/// The table of many runs: the same bytes from one thread and from several, run 0 from the start itself, the sizes of the
/// others those that the scene asks for.
#[test]
#[expect(clippy::approx_constant, reason = "the digits of the scene")]
fn many_runs_start_as_the_scene_asks_and_do_not_depend_on_threads() {
    let desk = Desk::new();
    desk.write("s.toml", format!("{SCENE}perturb = {{ q = {{ elbow = 0.02 }}, qd = [0.1, 0], seed = 7 }}\n"));
    let mut tables = Vec::new();
    for threads in ["1", "2"] {
        let command = format!("simulate s.toml --runs 400 --csv t.csv --threads {threads} --json");
        let ran = finish(desk.command(&command).spawn().unwrap(), b"");
        assert_eq!(ran.code, Some(0), "{}", ran.err);
        let report: Value = serde_json::from_str(&ran.out).unwrap();
        assert_eq!((report["runs"].as_u64(), report["refused"].as_u64()), (Some(400), Some(0)));
        tables.push(desk.read("t.csv"));
    }
    assert_eq!(tables[0], tables[1]);
    let mut lines = tables[0].lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |name: &str| -> Vec<f64> {
        let k = names.iter().position(|own| *own == name).unwrap_or_else(|| panic!("{name} in {names:?}"));
        rows.iter().map(|row| row[k].parse().unwrap()).collect()
    };
    assert_eq!(rows.len(), 400);
    let alone = &desk.one("simulate s.toml --json");
    assert_eq!((column("end.q.elbow")[0], column("start.q.elbow")[0]), (numbers(&alone["final"]["q"])[1], -1.5708));
    for (name, mean, size) in
        [("start.q.shoulder", 0.7854, 0.0), ("start.q.elbow", -1.5708, 0.02), ("start.qd.shoulder", -0.2, 0.1)]
    {
        let values = &column(name)[1..];
        let n = values.len() as f64;
        let found = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|x| (x - found).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        // Five standard errors of the mean, s/√n, and of the deviation, s/√(2n).
        assert!((found - mean).abs() <= 5.0 * size / n.sqrt() + 1e-12, "{name}: mean {found}");
        assert!((deviation - size).abs() <= 5.0 * size / (2.0 * n).sqrt() + 1e-12, "{name}: deviation {deviation}");
    }
    refused(
        {
            desk.write("s.toml", SCENE);
            desk.run("simulate s.toml --runs 3")
        },
        "s.toml: --runs: the scene has no disturbance, and all runs would be the same: add [run] perturb = { q = …, qd = …, numbers = … }",
    );
}

/// A state of one's own is the start of all runs: numbers of the start of the file, which it replaces, can't be disturbed beside it. Derivatives
/// at a fixed time predict nothing of runs that end at an event.
#[test]
fn disturbances_that_runs_cannot_have_are_refused() {
    let desk = Desk::new();
    desk.write("state.json", r#"{"q": [0.7, -1.5], "qd": [0.3, -0.9]}"#);
    let numbers = |name: &str| format!("{SCENE}perturb = {{ numbers = {{ \"{name}\" = 0.01 }} }}\n");
    desk.write("s.toml", numbers("robot.q[0]"));
    desk.refused(
        "simulate s.toml --from-state state.json --runs 2",
        "s.toml: --runs: [run] perturb.numbers: robot.q[0] is a number of the start, which is not that of the file: disturb it by perturb.q or \
         perturb.qd",
    );
    desk.write("s.toml", numbers("contact.friction"));
    desk.run("simulate s.toml --from-state state.json --runs 3 --out t.csv -q");
    let table = desk.read("t.csv");
    assert_eq!(table.lines().skip(1).filter(|line| line.contains(",0.7,-1.5,0.3,-0.9,")).count(), 3, "{table}");
    desk.write("s.toml", numbers("run.sample"));
    desk.refused(
        "simulate s.toml --runs 2",
        "s.toml: --runs: [run] perturb.numbers: run.sample: the runs have no samples: remove it",
    );
    let falls = SCENE.replace("[0.7, 0, 0], normal = [-1, 0, 0]", "[0, -0.5, 0], normal = [0, 1, 0]");
    desk.write("s.toml", format!("{falls}max_events = 1\nperturb = {{ q = 0.01 }}\n"));
    desk.refused(
        "simulate s.toml --runs 2 --covariance",
        "s.toml: --covariance: the runs end at an event, and the derivatives are those of the state at a fixed time: remove max_events",
    );
}

/// Runs that start inside the wall are counted, told and marked in the table; the others are computed.
#[test]
fn runs_that_are_refused_are_counted() {
    let desk = Desk::new();
    let near = SCENE.replace("point = [0.7,", "point = [0.637,");
    desk.write("s.toml", format!("{near}perturb = {{ q = 0.05, distribution = \"uniform\" }}\n"));
    let report = &desk.one("simulate s.toml --runs 60 --csv t.csv --json");
    let table = desk.read("t.csv");
    let marked = table.lines().filter(|line| line.contains(",refused,")).count() as u64;
    assert!(marked > 5 && marked < 55, "{marked}");
    assert_eq!(report["refused"].as_u64(), Some(marked));
    assert!(report["first_refusal"].as_str().unwrap().contains("overlaps by"), "{report}");
    // A table has the rows of runs that are all refused, also of a part; without one there is no answer.
    desk.write("s.toml", format!("{}perturb = {{ qd = 0.1 }}\n", near.replace("[0.637,", "[0.6,")));
    let ran = desk.run("simulate s.toml --runs 60 --shard 2/2 --out t.csv --json");
    assert!(ran.code == Some(0) && ran.err.starts_with("warning: s.toml: all runs are refused; run 30: "), "{ran:?}");
    let report: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!((report["runs"].as_u64(), report["refused"].as_u64()), (Some(30), Some(30)));
    assert!(desk.run("simulate s.toml --runs 60").err.contains("all runs are refused; run 0: "));
}

/// An interrupted run says so, exits with status 1, and leaves no file.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_no_file() {
    let desk = Desk::new();
    desk.write("s.toml", SCENE.replace("duration = 0.6", "duration = 1e5\nmax_step = 1e-3"));
    let before = desk.files("");
    let ran = desk.interrupted("simulate s.toml --csv t.csv --contacts c.parquet", "t.csv", 0, Duration::ZERO);
    refused(ran, "interrupted: nothing is written");
    assert_eq!(desk.files(""), before);
}

/// The answer and the table are those of as many runs as are done, and the last line tells how many; resumed, the table is that of a run
/// without an interruption, byte by byte, and so are the parts of several shards one after another.
#[cfg(unix)]
#[test]
fn interrupted_runs_are_kept() {
    let desk = Desk::new();
    desk.write("s.toml", format!("{SCENE}perturb = {{ qd = 0.01 }}\n"));
    for name in ["t.csv", "t.parquet"] {
        let runs = 100_000_000;
        let args = format!("simulate s.toml --runs {runs} --out {name} --json");
        let ran = desk.interrupted(&args, name, 0, Duration::from_millis(500)); // for some runs
        let report: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
        let count = report["runs"].as_u64().unwrap();
        let partial = name.replace("t.", "t.partial.");
        assert_eq!(ran.code, Some(1));
        assert!(ran.err.contains(&format!("{count} of {runs}")) && ran.err.contains(&partial), "{}", ran.err);
        assert!(count > 0 && !desk.files("").iter().any(|file| file == name || file.ends_with(".part")));
        let again = &desk.one(&format!("simulate s.toml --runs {count} --out again.{name} --json"));
        assert_eq!(*again, report);
        let [kept, whole] = [partial, format!("again.{name}")].map(|file| std::fs::read(desk.join(file)).unwrap());
        assert!(kept == whole, "{name}");
    }
}

/// Runs that are done are kept although a block of rows, of all threads, takes longer than the program runs; resumed amid a block, the table is
/// that of a run without an interruption.
#[cfg(unix)]
#[test]
fn slow_runs_that_are_done_are_kept() {
    let desk = Desk::new();
    let slow = SCENE.replace("duration = 0.6", "duration = 0.6\nmax_step = 2e-5");
    desk.write("s.toml", format!("{slow}perturb = {{ qd = 0.01 }}\n"));
    let runs = "simulate s.toml --runs 150 --threads 2 --json --out";
    desk.one(&format!("{runs} whole.csv"));
    let ran = desk.interrupted(&format!("{runs} t.csv"), "t.csv", 0, Duration::from_millis(300));
    assert_eq!(ran.code, Some(1), "{ran:?}: it must be interrupted");
    let left: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    let left = left["runs"].as_u64().unwrap();
    assert!(0 < left && left < 128, "{left}");
    let done = desk.one(&format!("{runs} t.csv --resume"));
    assert_eq!((done["resumed"].as_u64(), done["runs"].as_u64()), (Some(left), Some(150 - left)));
    let read = |file: &str| std::fs::read(desk.join(file)).unwrap();
    assert!(read("t.csv") == read("whole.csv"));
}

/// Rows are functions of their number: shards one after another are the whole table, and so is the table of an interrupted run that goes on.
#[cfg(unix)]
#[test]
fn shards_and_resumed_runs_are_the_whole_table() {
    let desk = Desk::new();
    let numbers = "numbers = { \"contact.restitution\" = 0.05 }";
    desk.write("s.toml", format!("{SCENE}perturb = {{ qd = 0.01, {numbers}, seed = 3 }}\n"));
    let runs = 3000;
    desk.one(&format!("simulate s.toml --runs {runs} --out whole.csv --json"));
    let parts = (1..=3).map(|part| {
        let report =
            desk.one(&format!("simulate s.toml --runs {runs} --out part.csv --shard {part}/3 --threads 1 --json"));
        assert_eq!((report["runs"].as_u64(), report["resumed"].as_u64()), (Some(1000), Some(0)));
        desk.read("part.csv").split_once('\n').unwrap().1.to_owned()
    });
    let parts: String = parts.collect();
    assert_eq!(desk.read("whole.csv").split_once('\n').unwrap().1, parts);

    let args = format!("simulate s.toml --runs {runs} --out t.csv --threads 1 --json");
    let ran = desk.interrupted(&args, "t.csv", 0, Duration::from_millis(150));
    assert_eq!(ran.code, Some(1), "{ran:?}: it must be interrupted");
    let done = desk.one(&format!("simulate s.toml --runs {runs} --out t.csv --resume --json"));
    assert_eq!(done["runs"].as_u64().unwrap() + done["resumed"].as_u64().unwrap(), runs);
    assert!(desk.read("t.csv") == desk.read("whole.csv"));
    assert!(!desk.files("").iter().any(|file| file.contains("partial")));

    for (options, why) in [
        ("--threads 1", "--threads is for the rows of --runs: leave it out"),
        (
            "--runs 3 --out - --threads 1",
            "--threads: a table on standard output has no parts: give the name of a table",
        ),
        ("--runs 3 --shard 1/2", "--out"),
    ] {
        let ran = desk.run(&format!("simulate s.toml {options}"));
        assert!(ran.code != Some(0) && ran.err.contains(why), "{options}: {}", ran.err);
    }
}

/// Numbers of the scene are disturbed as their sizes say, and beside the covariance of the end stands that of the derivatives; for small
/// disturbances they agree within five standard errors of a sample.
#[test]
fn disturbed_numbers_have_the_covariance_that_the_derivatives_predict() {
    let desk = Desk::new();
    // Uniform between ± √3e-3, whose standard deviation is 1e-3.
    let most = 3.0_f64.sqrt() * 1e-3;
    let sizes = format!("{{ \"contact.restitution\" = {most}, \"run.gravity[1]\" = 1e-3 }}");
    let uniform = "distributions = { \"contact.restitution\" = \"uniform\" }";
    let scene = SCENE.replace("[0.7, 0, 0]", "[0.66, 0, 0]").replace("[-0.2, 0.3]", "[0.2, 1.0]");
    desk.write("s.toml", format!("{scene}perturb = {{ q = 1e-4, qd = 1e-4, numbers = {sizes}, {uniform} }}\n"));
    let runs = 2000;
    let report = desk.one(&format!("simulate s.toml --runs {runs} --covariance --out t.csv --json"));
    assert_eq!((report["refused"].as_u64(), report["other_events"].as_u64()), (Some(0), Some(0)));
    let covariance = &report["covariance"];
    let (sampled, linear) = (matrix(&covariance["sampled"]), matrix(&covariance["linear"]));
    assert_eq!((covariance["names"].as_array().unwrap().len(), sampled.shape(), linear.shape()), (4, (4, 4), (4, 4)));
    for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
        let scale = (linear[(i, i)] * linear[(j, j)]).sqrt();
        let within = 5.0 * scale * (2.0 / f64::from(runs)).sqrt();
        let [sampled, linear] = [sampled[(i, j)], linear[(i, j)]];
        assert!((sampled - linear).abs() < within, "{i} {j}: {sampled} {linear}");
    }
    let table = desk.read("t.csv");
    let names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: &str| -> Vec<f64> {
        let k = names.iter().position(|own| *own == name).unwrap_or_else(|| panic!("{name} in {names:?}"));
        table.lines().skip(1).map(|line| line.split(',').nth(k).unwrap().parse().unwrap()).collect()
    };
    let moments = |values: &[f64]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
    };
    let restitution = column("contact.restitution");
    let (mean, deviation) = moments(&restitution[1..]);
    assert!((mean - restitution[0]).abs() < 5.0 * 1e-3 / f64::from(runs).sqrt(), "{mean} {}", restitution[0]);
    let furthest = restitution.iter().map(|x| (x - restitution[0]).abs()).fold(0.0, f64::max);
    assert!((0.99 * most..=most).contains(&furthest), "{furthest}");
    let (_, of_impact) = moments(&column("first_impact"));
    let predicted = covariance["event_times"][0]["deviation"].as_f64().unwrap();
    for (found, wanted) in [(deviation, 1e-3), (of_impact, predicted)] {
        assert!((found / wanted - 1.0).abs() < 5.0 / (2.0 * f64::from(runs)).sqrt(), "{found} {wanted}");
    }

    // Before the runs: no table is left.
    desk.write("s.toml", format!("{SCENE}perturb = {{ numbers = {{ \"run.duration\" = 1e-3 }} }}\n"));
    let ran = desk.run("simulate s.toml --runs 3 --covariance --out none.csv");
    refused_with(&ran, "--covariance: run.duration: duration is no parameter of the motion");
    assert!(!desk.files("").contains(&"none.csv".to_owned()), "{:?}", desk.files(""));
    desk.write("s.toml", format!("{SCENE}perturb = {{ q = 1e-4, {uniform} }}\n"));
    refused_with(&desk.run("simulate s.toml --runs 3"), "contact.restitution, which is not among perturb.numbers");
    desk.write("s.toml", format!("{SCENE}perturb = {{ numbers = {{ \"contact.restitutoin\" = 1e-3 }} }}\n"));
    let ran = desk.run("simulate s.toml --runs 3");
    ["s.toml: --runs: [run] perturb.numbers: ", "restitutoin"].iter().for_each(|words| refused_with(&ran, words));
}

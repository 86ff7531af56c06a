//! Tests of `carom fit` as a process: the three kinds of data, the output, refusals with their messages.

use crate::command_line::desk::{Desk, Ran, number, refused_with, usage};
use serde_json::{Value, json};

impl Desk {
    fn lines(&self, file: &str, lines: &[Value]) {
        self.write(file, lines.iter().map(|line| format!("{line}\n")).collect::<String>());
    }
}

/// A ball of mass 1 strikes with velocity u. H is the identity, so u⁺ = (u_t − μ(1+e)|u_n| sign u_t, −e u_n) while it slips.
fn jump(u: [f64; 2]) -> Value {
    let (e, mu) = (0.5, 0.2);
    let lost = (mu * (1.0 + e) * -u[1]).min(u[0].abs());
    json!({"delassus": [[1, 0], [0, 1]], "u_minus": u, "u_plus": [u[0] - lost * u[0].signum(), -e * u[1]]})
}

fn jumps() -> Vec<Value> {
    (0..8).map(|k| jump([0.3 * f64::from(k) - 1.0, -1.0 - 0.1 * f64::from(k)])).collect()
}

#[test]
fn fit_to_exact_jumps_recovers_the_coefficients() {
    let desk = Desk::new();
    desk.lines("jumps.jsonl", &jumps());
    let all = desk.one("fit --velocities jumps.jsonl --json");
    assert_eq!((&all["train"]["count"], &all["test"]), (&json!(8), &Value::Null), "all impacts are fitted");
    let fit = desk.one("fit --velocities jumps.jsonl --train 0.5 --json");
    assert_eq!(fit["fitted_to"], "velocities");
    assert_eq!((&fit["train"]["count"], &fit["test"]["count"]), (&json!(4), &json!(4)));
    let coefficients = fit["coefficients"].as_array().unwrap();
    assert_eq!(coefficients.len(), 2, "{fit}");
    for (coefficient, (name, truth)) in coefficients.iter().zip([("restitution", 0.5), ("friction", 0.2)]) {
        assert_eq!(coefficient["name"], name);
        assert!((number(&coefficient["value"]) - truth).abs() < 1e-6, "{coefficient}");
    }
    assert_eq!(fit["each"].as_array().unwrap().len(), 8);
    assert_eq!(fit, desk.one("fit --velocities jumps.jsonl --train 0.5 --json"), "two runs give the same answer");
    let Ran { code, out, err } = desk.run("fit --velocities jumps.jsonl --train 0.5");
    assert_eq!((code, err.as_str()), (Some(0), ""), "the progress bar is shown on a terminal only");
    let kept = "velocities of 4 impacts (4 kept for the test, seed 0), law energetic, loss huber";
    assert!(out.starts_with(kept) && out.contains("\ntest "), "{out}");
    let Ran { out, .. } = desk.run("fit --velocities jumps.jsonl");
    assert!(out.starts_with("velocities of 8 impacts, law energetic, loss huber") && !out.contains("\ntest "), "{out}");
    assert!(out.contains("note: fitted to velocities"), "{out}");
}

/// The fits of one law each, least error first: the error is that of the test, if there is one.
#[test]
fn the_table_of_all_laws_has_their_fits() {
    let desk = Desk::new();
    // A coupled H, with which laws differ: the jumps are those of Poisson's law.
    let problem = |k: u32| {
        let x = f64::from(k);
        json!({"delassus": [[2, 0.9], [0.9, 1]], "u": [1.5 * (x * 1.3).sin(), -1.0 - 0.1 * x]})
    };
    let problems: Vec<Value> = (0..12).map(problem).collect();
    desk.lines("problems.jsonl", &problems);
    let law = "law --law poisson --restitution 0.55 --friction 0.2 --problems problems.jsonl --json";
    let Ran { code, out, err } = desk.run(law);
    assert_eq!(code, Some(0), "{err}");
    let jump = |(problem, line): (&Value, &str)| {
        let hit: Value = serde_json::from_str(line).unwrap();
        json!({"delassus": problem["delassus"], "u_minus": problem["u"], "u_plus": hit["u_plus"]})
    };
    desk.lines("jumps.jsonl", &problems.iter().zip(out.lines()).map(jump).collect::<Vec<_>>());
    for train in ["", " --train 0.5"] {
        let all = desk.one(&format!("fit --velocities jumps.jsonl --law all{train} --json"));
        let fits = all["fits"].as_array().unwrap();
        assert_eq!((fits.len(), &fits[0]["law"]), (8, &json!("poisson")), "{all}");
        let part = if train.is_empty() { "train" } else { "test" };
        let error = |fit: &Value| number(&fit[part]["mean"]);
        assert!(error(&fits[0]) < 1e-9 && fits.is_sorted_by(|a, b| error(a) <= error(b)), "{all}");
        for fit in fits {
            let law = fit["law"].as_str().unwrap();
            assert_eq!(*fit, desk.one(&format!("fit --velocities jumps.jsonl --law {law}{train} --json")));
            let names = fit["coefficients"].as_array().unwrap().len();
            assert_eq!(names, if law == "frictionless" { 1 } else { 2 }, "{law}");
        }
        let Ran { out, .. } = desk.run(&format!("fit --velocities jumps.jsonl --law all{train}"));
        let laws: Vec<&str> = out.lines().skip(2).map(|line| line.split_whitespace().next().unwrap()).collect();
        assert_eq!(laws, fits.iter().map(|fit| fit["law"].as_str().unwrap()).collect::<Vec<_>>(), "{out}");
        assert!(out.lines().nth(2).unwrap().starts_with("poisson          0.5500 (0.55"), "{out}");
    }
}

/// Joint velocities of planar2 before and after ten impacts, computed by `carom impact`.
#[test]
fn fit_to_joint_velocities_recovers_the_coefficients() {
    let desk = Desk::new();
    let state = |k: u32| {
        let x = f64::from(k);
        json!({"q": [0.5 + 0.1 * x, -1.0 - 0.05 * x], "qd": [-0.4 + 0.09 * x, 0.3 - 0.11 * x]})
    };
    let states: Vec<Value> = (0..10).map(state).collect();
    desk.lines("states.jsonl", &states);
    let strike = "impact planar2.urdf --tip tip --normal -1,0,0 --law energetic --restitution 0.4 --friction 0.15";
    let Ran { code, out, err } = desk.run(&format!("{strike} --json --states states.jsonl"));
    assert_eq!(code, Some(0), "{err}");
    let hits: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(hits.len(), 10, "{err}");
    let struck = states.iter().zip(&hits).filter(|(_, hit)| hit["flags"].as_array().unwrap().is_empty());
    let jumps: Vec<Value> =
        struck.map(|(s, hit)| json!({"q": s["q"], "qd_minus": s["qd"], "qd_plus": hit["qd_plus"]})).collect();
    assert!(jumps.len() >= 4, "{}", jumps.len());
    desk.lines("jumps.jsonl", &jumps);
    let fit = desk.one("fit --velocities jumps.jsonl --robot planar2.urdf --tip tip --normal -1,0,0 --train 1 --json");
    let values: Vec<f64> = fit["coefficients"].as_array().unwrap().iter().map(|c| number(&c["value"])).collect();
    assert!((values[0] - 0.4).abs() < 1e-6 && (values[1] - 0.15).abs() < 1e-6, "{values:?}");
    // With two joints and a contact in the plane some impulse gives any velocity jump.
    assert!(number(&fit["train"]["least"]) < 1e-9);

    // An answer of `carom impact` is a jump, and `qd` is another name of `qd_minus`.
    let struck = || states.iter().zip(&hits).filter(|(_, hit)| hit["flags"].as_array().unwrap().is_empty());
    desk.lines("answers.jsonl", &struck().map(|(_, hit)| hit.clone()).collect::<Vec<_>>());
    let short = struck().map(|(s, hit)| json!({"q": s["q"], "qd": s["qd"], "qd_plus": hit["qd_plus"]}));
    desk.lines("short.jsonl", &short.collect::<Vec<_>>());
    for file in ["answers.jsonl", "short.jsonl"] {
        let args = format!("fit --velocities {file} --robot planar2.urdf --tip tip --normal -1,0,0 --train 1 --json");
        assert_eq!(desk.one(&args), fit, "{file}");
    }
    desk.lines("bare.jsonl", &[json!({"law": "newton", "qd_plus": [0, 0]})]);
    let rule = "the answer of `carom impact` needs the keys q, qd_minus and qd_plus";
    desk.refused("fit --velocities bare.jsonl", &format!("bare.jsonl:1: {rule}"));
}

#[test]
fn fit_to_flights_of_a_box_recovers_the_coefficients() {
    let desk = Desk::new();
    let pose = |z: f64, x: f64| json!([x, 0, z, 0, 0, 0, 1]);
    // A box that falls flat without rotating: no corner is lowest, so its centre is given as the contact point.
    let line = |speed: f64, slip: f64| {
        let (e, mu, g) = (0.5, 0.2, 9.81);
        let after = slip - mu * (1.0 + e) * speed;
        let fall = |t: f64| pose(0.025 - speed * t - 0.5 * g * t * t, slip * t);
        let rise = |t: f64| pose(0.025 + e * speed * t - 0.5 * g * t * t, after * t);
        let times = [0.002, 0.01, 0.02, 0.03];
        let back: Vec<f64> = times.iter().rev().map(|t| -t).collect();
        json!({
            "before": {"t": back, "q": back.iter().map(|&t| fall(t)).collect::<Vec<_>>()},
            "after": {"t": times, "q": times.map(rise)},
        })
    };
    let lines: Vec<Value> = (0..5).map(|k| line(1.0 + 0.2 * f64::from(k), 2.0)).collect();
    desk.lines("flights.jsonl", &lines);
    let fit = desk.one("fit --flights flights.jsonl --robot box.urdf --floating --tip box --train 1 --json");
    assert_eq!(fit["flights"]["joined"], 5);
    let values: Vec<f64> = fit["coefficients"].as_array().unwrap().iter().map(|c| number(&c["value"])).collect();
    // The contact point is the centre of mass, so friction acts as on a particle.
    assert!((values[0] - 0.5).abs() < 1e-6 && (values[1] - 0.2).abs() < 1e-6, "{values:?}");
}

/// Impacts of a body at its centre of mass, which is a particle there: e = 0.5, μ = 0.2, with 2 % of noise in the jump.
fn impacts(count: u32) -> String {
    let mut text = "i,pre_vx,pre_vy,pre_w,post_vx,post_vy,post_w,d_x,d_y,d_th,n_x,n_y,n_th\n".to_owned();
    for k in 0..count {
        let x = f64::from(k);
        let (slip, speed) = (1.0 + 0.03 * x, 1.0 + 0.1 * (7.0 * x).sin());
        let noise = |phase: f64| 1.0 + 0.02 * (phase + 13.0 * x).sin();
        let (lost, gained) = (0.3 * speed * noise(0.0), 1.5 * speed * noise(2.0));
        text += &format!("{k},{slip},{},1,{},{},1,1,0,0,0,1,0\n", -speed, slip - lost, gained - speed);
    }
    text
}

#[test]
fn a_comparison_writes_tables_pictures_and_json() {
    let desk = Desk::new();
    let data = desk.join("data/particle");
    std::fs::create_dir_all(&data).unwrap();
    std::fs::write(data.join("impacts_odd.csv"), impacts(20)).unwrap();
    let found = desk.one("compare data --folds 4 --out out --json");
    let one = &found["comparisons"][0];
    let rows = one["rows"].as_array().unwrap();
    let constant: Vec<&Value> = rows.iter().filter(|row| row["effects"].as_array().is_none_or(Vec::is_empty)).collect();
    // Every law, and with each effect that a table of single impacts allows.
    assert_eq!((&one["set"], constant.len(), rows.len() % 8), (&json!("particle"), 8, 0));
    let worst = constant.last().unwrap();
    assert_eq!(worst["law"], "frictionless");
    assert!(number(&worst["to_best"]["mean"]) > 2.0 * number(&worst["to_best"]["standard_error"]));
    let newton = constant.iter().find(|row| row["law"] == "newton").unwrap();
    for (k, truth) in [0.5, 0.2].into_iter().enumerate() {
        for value in newton["coefficients"][k]["values"].as_array().unwrap() {
            assert!((number(value) - truth).abs() < 0.02, "{newton}");
        }
    }
    for file in ["particle.md", "particle.svg", "summary.md", "compare.json"] {
        assert!(desk.join("out").join(file).is_file(), "{file}");
    }
    let Ran { code, out, err } = desk.run("compare data/particle/impacts_odd.csv --folds 4");
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.starts_with("# Summary") && out.contains("| impacts_odd |"), "{out}");
    let rule = "it holds no data set: a folder needs tosses.csv with a URDF, a CSV table with the columns pre_vx … of single impacts, or \
                one with the columns log, base_qw, knee_joint_leftdot … of landings";
    desk.refused("compare out", &format!("out: {rule}"));
    desk.refused("compare data --export cases.json", "--export: none of the data sets has tosses");
    assert!(!desk.join("cases.json").exists());
    desk.refused("compare data --folds 1", "number of folds is 1: it must be at least 2");
}

/// Impacts of planar2 under Poisson's law with 0.1 % of noise, as JSON lines and as a table whose columns have another order. The
/// slip reverses in a third of them, and there the laws differ.
fn own_impacts(desk: &Desk) {
    let state = |k: u32| {
        let x = f64::from(k);
        let angle = 0.6 + 1.9 * (x * 0.618).fract();
        json!({"q": [0.7 + 0.01 * x, -1.5 - 0.01 * x], "qd": [0.5 * angle.cos(), 0.5 * angle.sin()]})
    };
    let states: Vec<Value> = (0..30).map(state).collect();
    desk.lines("states.jsonl", &states);
    let strike = "impact planar2.urdf --tip tip --normal -1,0,0 --law poisson --restitution 0.4 --friction 0.15";
    let Ran { code, out, err } = desk.run(&format!("{strike} --json --states states.jsonl"));
    assert_eq!(code, Some(0), "{err}");
    let hits = out.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let (mut lines, mut table) =
        (Vec::new(), "time,qd_plus.elbow,qd_minus.shoulder,q.elbow,q.shoulder,qd_plus.shoulder,qd.elbow\n".to_owned());
    for (k, (state, hit)) in states.iter().zip(hits).enumerate() {
        if !hit["flags"].as_array().unwrap().is_empty() {
            continue;
        }
        let noise = |phase: f64| 1.0 + 0.001 * (phase + 13.0 * k as f64).sin();
        let after = [number(&hit["qd_plus"][0]) * noise(0.0), number(&hit["qd_plus"][1]) * noise(2.0)];
        let (q, qd) = (&state["q"], &state["qd"]);
        table += &format!("0.1,{},{},{},{},{},{}\n", after[1], qd[0], q[1], q[0], after[0], qd[1]);
        lines.push(json!({"q": q, "qd_minus": qd, "qd_plus": after}));
    }
    assert!(lines.len() >= 20, "{}", lines.len());
    desk.lines("own.jsonl", &lines);
    desk.write("own.csv", table);
}

const AT: &str = "--robot planar2.urdf --tip tip --normal -1,0,0";

#[test]
fn tables_of_impacts_are_read_by_the_names_of_their_columns() {
    let desk = Desk::new();
    own_impacts(&desk);
    let fit = |file: &str| {
        let fit = desk.one(&format!("fit --velocities {file} {AT} --law poisson --json"));
        assert_eq!(fit["train"]["count"], 30);
        fit["coefficients"].as_array().unwrap().iter().map(|c| number(&c["value"])).collect::<Vec<_>>()
    };
    // a number of JSON is read within one unit of its last place
    let off: f64 = fit("own.csv").iter().zip(fit("own.jsonl")).map(|(a, b)| (a - b).abs()).sum();
    assert!(off < 1e-9, "{off}");
    let table = desk.read("own.csv");
    desk.write("less.csv", table.replace("q.elbow", "angle"));
    let columns = "time, qd_plus.elbow, qd_minus.shoulder, angle, q.shoulder, qd_plus.shoulder, qd.elbow";
    let refusal = format!("less.csv: there is no column 'q.elbow': the columns are {columns}");
    desk.refused(&format!("fit --velocities less.csv {AT}"), &refusal);
    desk.write("odd.csv", table.replacen("\n0.1,", "\n0.1,x", 1));
    let Ran { err, .. } = desk.run(&format!("fit --velocities odd.csv {AT}"));
    assert!(
        err.starts_with("error: odd.csv:2: column qd_plus.elbow: 'x") && err.ends_with("is not a finite number\n"),
        "{err}"
    );
    desk.refused("fit --velocities own.csv", "own.csv: a table has velocities of joints: give --robot and --tip");
}

/// The law that made the impacts predicts those that it was not fitted to with the error of their noise.
#[test]
fn laws_are_compared_on_own_impacts() {
    let desk = Desk::new();
    own_impacts(&desk);
    let found = desk.one(&format!("compare own.jsonl {AT} --folds 4 --json"));
    let one = &found["comparisons"][0];
    let rows = one["rows"].as_array().unwrap();
    let constant: Vec<&Value> = rows.iter().filter(|row| row["effects"].as_array().is_none_or(Vec::is_empty)).collect();
    assert_eq!(
        (&one["set"], constant.len(), constant[0]["law"].as_str()),
        (&json!("own"), 8, Some("poisson")),
        "{one}"
    );
    let mean = |row: &Value| number(&row["mean"]);
    // 0.1 % of noise in each velocity after the impact, as a share of the velocity before, which is about as large
    assert!((1e-4..2e-3).contains(&mean(constant[0])), "{}", constant[0]);
    let second = &constant[1];
    assert!(mean(second) > 3.0 * mean(constant[0]), "{second}");
    assert!(number(&second["to_best"]["mean"]) > 2.0 * number(&second["to_best"]["standard_error"]), "{second}");
    for (k, truth) in [0.4, 0.15].into_iter().enumerate() {
        for value in constant[0]["coefficients"][k]["values"].as_array().unwrap() {
            assert!((number(value) - truth).abs() < 0.003, "{}", constant[0]);
        }
    }
    assert!(number(&one["bound"]["mean"]) < 1e-9, "some impulse gives any jump of two joints");
    let table = &desk.one(&format!("compare own.csv {AT} --folds 4 --json"))["comparisons"][0];
    assert_eq!((&table["folds"], &table["rows"][0]["law"]), (&one["folds"], &one["rows"][0]["law"]));
    let Ran { code, out, err } = desk.run(&format!("compare own.jsonl {AT} --folds 4"));
    assert_eq!((code, err.as_str()), (Some(0), ""));
    assert!(out.starts_with("# own\n") && LAWS.iter().all(|law| out.contains(&format!("\n| {law} | e 0."))), "{out}");
    std::fs::create_dir(desk.join("data")).unwrap();
    desk.write("data/odd.csv", impacts(20));
    let rule = "they belong to your own impacts, and none of the data are: give JSON lines (.jsonl), or a CSV table with the columns \
                q.<joint>, qd_minus.<joint>, qd_plus.<joint>";
    desk.refused(&format!("compare data {AT}"), &format!("--robot, --tip, --normal: {rule}"));
    let tosses = "they are about tosses, and none of the data are: leave them out";
    desk.refused(
        &format!("compare own.jsonl {AT} --horizon whole --length 0.1"),
        &format!("--horizon, --length: {tosses}"),
    );
    let rolls = "they are about tosses and landings, and none of the data are: leave them out";
    desk.refused(&format!("compare own.jsonl {AT} --trials 5"), &format!("--trials: {rolls}"));
    let robot = "they are about a robot, which is missing: give --robot ROBOT.urdf";
    desk.refused("compare own.jsonl --strict --tip probe", &format!("--tip, --strict: {robot}"));
}

const LAWS: [&str; 8] =
    ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];

#[test]
fn data_that_cannot_be_fitted_are_refused() {
    let desk = Desk::new();
    desk.lines("jumps.jsonl", &jumps());
    desk.lines("empty.jsonl", &[]);
    desk.refused("fit --velocities empty.jsonl", "empty.jsonl: it holds no impacts: give at least one");
    desk.refused(
        "fit --velocities jumps.jsonl --train 0",
        "jumps.jsonl: training share is 0: it must be above 0 and at most 1",
    );
    desk.refused(
        "fit --velocities jumps.jsonl --inertia",
        "jumps.jsonl: the scale of inertia cannot be fitted to impacts given by a Delassus matrix: give a robot and the \
         configurations q",
    );
    desk.refused("fit --flights jumps.jsonl", "jumps.jsonl: flights need a robot: give --robot");
    let robot = "they are about a robot, which is missing: give --robot ROBOT.urdf";
    for (options, named) in [
        ("--point 0,0,1", "--point"),
        ("--normal 1,0,0 --joints a", "--joints, --normal"),
        ("--rotor-inertia a=1", "--rotor-inertia"),
        ("--package-dir . --no-meshes", "--no-meshes, --package-dir"),
    ] {
        desk.refused(&format!("fit --velocities jumps.jsonl {options}"), &format!("{named}: {robot}"));
    }
    let folder = "whole tosses take gravity, the normal of the floor, the order of the joints and the points that touch from their folder";
    desk.refused("fit --tosses . --gravity 0,0,-1 --tip a", &format!("--gravity, --tip: {folder}"));
    desk.refused("fit --flights . --joints a", "--joints: the tosses of a folder name their columns");
    desk.refused("fit --flights . --point 0,0,1", "--point: it is a point of the link of --tip: give it, too");
    for (line, message) in [
        (
            json!({"delassus": [[1, 0], [0, 1]], "u_minus": [0, -1]}),
            "a jump is either delassus, u_minus, u_plus (all three) or q, qd_minus, qd_plus (all three)",
        ),
        (
            json!({"delassus": [[1, 0]], "u_minus": [0, -1], "u_plus": [0, 1]}),
            "delassus has rows of 2 numbers: u_minus has 2, so 2 rows of 2 are needed",
        ),
        (
            json!({"delassus": [[1, 0], [0, 1]], "u_minus": [0, -1], "u_plus": [0, 1, 2]}),
            "u_plus has 3 numbers, u_minus has 2: give as many",
        ),
        (
            json!({"delassus": [[1]], "u_minus": [-1], "u_plus": [1]}),
            "u_minus has 1 numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed",
        ),
        (
            json!({"delassus": [[1, 0], [0, 1]], "u_minus": [0, 1], "u_plus": [0, 1]}),
            "the contact does not approach: its normal velocity before the impact is 1 m/s and must be negative; leave \
             this measurement out, or check the normal (from the environment to the robot)",
        ),
        (json!({"q": [0, 0], "qd_minus": [0, 0], "qd_plus": [0, 0]}), "q needs a robot: give --robot and --tip"),
    ] {
        desk.lines("bad.jsonl", &[jump([1.0, -1.0]), line]);
        desk.refused("fit --velocities bad.jsonl", &format!("bad.jsonl:2: {message}"));
    }
    desk.refused(
        "fit --velocities jumps.jsonl --robot planar2.urdf",
        "--robot planar2.urdf: no line of jumps.jsonl has a q: leave --robot out, or give q, qd_minus, qd_plus instead of \
         delassus",
    );
    desk.refused(
        "fit --velocities jumps.jsonl --confidence 1",
        "jumps.jsonl: confidence is 1: it must be at least 0.5 and below 1",
    );
    let text = r#"{"delassus":[[1,0],[0,1]],"u_minus":[0,-1],"u_plus":[0,NaN]}"#;
    desk.write("nan.jsonl", text);
    refused_with(&desk.run("fit --velocities nan.jsonl"), "error: nan.jsonl:1: expected value at column ");
    for missing in
        ["--velocities none --robot box.urdf --floating", "--flights none --robot box.urdf --floating", "--tosses none"]
    {
        refused_with(&desk.run(&format!("fit {missing}")), "error: none: cannot be read: ");
    }
    for (args, words) in [
        ("fit", "--velocities <FILE>|--flights <FILE|FOLDER>|--tosses <FOLDER>"),
        ("fit --velocities a --tosses b", "cannot be used with"),
        ("fit --velocities a --start given", "cannot be used with"),
        ("fit --flights a --contact-step 1e-4", "cannot be used with"),
        ("fit --velocities a --gravity 0,0,-1", "cannot be used with"),
        ("fit --velocities jumps.jsonl --law hertz", "invalid value 'hertz' for '--law <LAW>'"),
    ] {
        usage(desk.run(args), words);
    }
}

//! `carom stress` and `carom chart`: files that are complete or not written.

use crate::command_line::desk::*;
use serde_json::Value;

#[test]
fn stress_writes_its_table_as_markdown_json_and_svg() {
    let desk = Desk::new();
    let ran = desk.run("stress --out table --scene jam");
    done(&ran);
    assert!(ran.out.contains("8 exact\n") && ran.out.ends_with("the table is table/stress.md\n"), "{}", ran.out);
    assert_eq!(desk.files("table"), ["stress.json", "stress.md", "stress.svg"]);
    let read = |name: &str| desk.read(&format!("table/{name}"));
    let json: Value = serde_json::from_str(&read("stress.json")).unwrap();
    assert_eq!(json["methods"].as_array().unwrap().len(), 15);
    let cells = json["scenes"][0]["cells"].as_array().unwrap();
    assert!(cells.len() == 8 && cells.iter().all(|cell| cell["verdict"] == "exact"), "{cells:?}");
    assert!(read("stress.md").contains("| jam | exact |") && read("stress.svg").starts_with("<svg"));
}

#[test]
fn stress_refuses_unknown_scenes_and_invalid_folders() {
    let desk = Desk::new();
    let ran = desk.run("stress --out table --scene grzing");
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.err.starts_with("error: --scene grzing: no name of a scene contains it: the scenes are energy paradox, "),
        "{}",
        ran.err
    );
    desk.write("file", "");
    let ran = desk.run("stress --out file --scene jam");
    assert_eq!((ran.code, ran.err.as_str()), (Some(1), "error: --out file: it is a file: give a folder\n"));
    assert_eq!(desk.run("stress").code, Some(2));
}

const SCENE: &str = r#"[robot]
urdf = "planar2.urdf"
q = [0.7854, -1.5708]
qd = [-0.444444, 0.444444]
[[surface]]
shape = { halfspace = { point = [0.6364, 0, 0], normal = [-1, 0, 0] } }
[contact]
law = "energetic"
restitution = 0.35
[run]
duration = 0.05
"#;

const PEERS: &str = r#"{"scene":"wall","peer":"x","version":"1","method":"steps","knob":"dt","value":0.001,"wall_time_s":0.002,"result":{"final":{"q":[0.77,-1.55],"qd":[-0.4,0.4]},"after_impact":null}}
{"scene":"wall","peer":"y","version":"2","method":"default","knob":"dt","value":0.001,"wall_time_s":null,"result":null,"failure":"no rebound"}
{"scene":"other","peer":"y","version":"2","method":"default","knob":"dt","value":0.001,"wall_time_s":null,"result":null}
"#;

#[test]
fn a_chart_contains_every_method_and_the_peers() {
    let desk = Desk::new();
    desk.write("wall.toml", SCENE);
    desk.write("peers.jsonl", PEERS);
    std::fs::create_dir(desk.join("c")).unwrap();
    let ran = desk.run("chart wall.toml --out c/wall.svg --peers peers.jsonl --budget 0.1 --json");
    done(&ran);
    let chart: Value = serde_json::from_str(&ran.out).unwrap();
    let runs = chart["runs"].as_array().unwrap();
    let of = |method: &str| -> Vec<&Value> { runs.iter().filter(|run| run["method"] == method).collect() };
    // Events are exact at the impact at every tolerance; time steps are not, and their error falls with the step.
    assert!(!of("events, DOP853, in the plane").is_empty());
    for run in of("events, DOP853, in the plane") {
        assert!(run["after_impact"].as_f64().unwrap() < 1e-9, "{run}");
    }
    let steps: Vec<f64> = of("Moreau–Jean steps").iter().map(|run| run["at_end"].as_f64().unwrap()).collect();
    assert!(steps.len() > 1 && steps[0] > 1e-6, "{steps:?}");
    let soft: Vec<f64> = of("compliant, Hunt–Crossley").iter().map(|run| run["at_end"].as_f64().unwrap()).collect();
    assert!(soft.first() > soft.last(), "{soft:?}");
    assert_eq!(of("x 1, steps").len(), 1);
    // The law of each method. The scene has no friction, so that all laws agree.
    assert_eq!(chart["law"], "energetic, no friction");
    for (method, law) in [
        ("events, DOP853, in space", "the scene's"),
        ("Moreau–Jean steps", "Newton's e with a friction cone"),
        ("compliant, Hunt–Crossley", "contact force"),
        ("x 1, steps", "its own"),
    ] {
        assert!(of(method).iter().all(|run| run["law"] == law) && !of(method).is_empty(), "{method}");
    }
    assert_eq!(chart["absent"][0]["method"], "y 2, default");
    assert_eq!(chart["absent"][0]["reason"], "dt = 0.001: no rebound");
    assert_eq!(desk.files("c"), ["wall.csv", "wall.svg"]);
    let table = desk.read("c/wall.csv");
    assert_eq!(table.lines().count(), 1 + runs.len());
    let picture = desk.read("c/wall.svg");
    assert!(picture.contains("not run: y 2, default") && picture.contains("error of the reference solution"));
    assert!(picture.contains("e with a friction cone") && picture.contains("Errors are relative to the reference"));
}

#[test]
fn a_chart_of_stiffness_draws_both_errors_beside_the_order_in_theory() {
    let desk = Desk::new();
    let soft = SCENE.replace("[contact]\n", "[contact]\ncompliance = { stiffness = 1e6, exponent = 1 }\n");
    desk.write("wall.toml", &soft);
    std::fs::create_dir(desk.join("c")).unwrap();
    let ran = desk.run("chart wall.toml --stiffness --out c/soft.svg --json");
    done(&ran);
    let chart: Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(chart["theory"], 0.5);
    assert!((chart["order_after_impact"].as_f64().unwrap() - 0.5).abs() < 0.05, "{chart}");
    assert_eq!(desk.files("c"), ["soft.csv", "soft.svg"]);
    let table = desk.read("c/soft.csv");
    assert_eq!(table.lines().count(), 1 + chart["runs"].as_array().unwrap().len());
    let picture = desk.read("c/soft.svg");
    assert!(picture.contains("order in theory: 0.500") && picture.contains("factor of all stiffnesses"));
    let plan: Value = serde_json::from_str(&desk.run("plan wall.toml --json").out).unwrap();
    let kept = plan["kept"].as_array().unwrap();
    let own: Vec<&Value> = kept.iter().filter(|line| line["what"] == "compliance").collect();
    assert!(own.len() == 1 && own[0]["choice"].as_str().unwrap().contains("hunt-crossley 1e6 N/m"), "{plan}");
}

const TABLE: &str = "method,knob,value,wall_time_s,error_after_impact,error_at_end,law\n\
    events,tolerance,1e-9,1e-5,,1e-12,the scene's\n\
    steps,dt,1e-3,1e-3,1e-2,1e-3,Newton's\n\
    steps,dt,1e-4,1e-2,1e-3,1.0e-4,Newton's\n\
    other,dt,1e-4,1e-2,1e-3,1.2e-4,its own\n\
    left-out,dt,1e-4,1e-2,1e-3,1e-4,its own\n";

/// Lines that end at the same place have names that do not cover each other; a panel with the data of one method is left out.
#[test]
fn few_methods_of_a_computed_chart_are_drawn_with_their_names() {
    let desk = Desk::new();
    desk.write("wall.csv", TABLE);
    let ran = desk.run("chart --from wall.csv --out wall.svg --show events=carom --show steps --show other=peer");
    assert_eq!((ran.code, ran.out.as_str(), ran.err.as_str()), (Some(0), "", ""));
    let picture = desk.read("wall.svg");
    // In both panels, since two of the methods have an error after the impact; there `events` has none.
    let places = |name: &str| -> Vec<[f64; 2]> {
        let line = format!("\n{name}\n");
        let own = picture.match_indices(&line);
        own.map(|(at, _)| {
            let tag = &picture[picture[..at].rfind("<text").unwrap()..at];
            ["x", "y"].map(|key| {
                let value = tag.split(&format!(" {key}=\"")).nth(1).unwrap();
                value.split('"').next().unwrap().parse().unwrap()
            })
        })
        .collect()
    };
    assert_eq!((places("carom").len(), places("steps").len(), places("left-out").len()), (1, 2, 0));
    for (one, other) in places("steps").iter().zip(places("peer")) {
        assert!((one[0] - other[0]).abs() <= 1.0 && (one[1] - other[1]).abs() >= 17.0, "{one:?} {other:?}");
    }
    // A single method, in the panels for which it has data.
    for (method, panels) in [("steps", 2), ("events", 1)] {
        desk.run(&format!("chart --from wall.csv --out one.svg --show {method}"));
        let picture = std::fs::read_to_string(desk.join("one.svg")).unwrap();
        assert_eq!(picture.matches(&format!("\n{method}\n")).count(), panels, "{method}");
    }
    let wrong = TABLE.replace("1e-5,,1e-12", "0,,1e-12");
    desk.write("wrong.csv", &wrong);
    for (args, message) in [
        ("wall.csv --show event", "--show event: wall.csv has no such method, but: events; steps; other; left-out"),
        ("wrong.csv --show events", "--from wrong.csv: line 2, column wall_time_s: 0 is not a positive time"),
    ] {
        let ran = desk.run(&format!("chart --out w.svg --from {args}"));
        assert_eq!((ran.code, ran.err), (Some(1), format!("error: {message}\n")));
        assert!(!desk.join("w.svg").exists());
    }
}

#[test]
fn chart_refuses_invalid_options_and_files() {
    let desk = Desk::new();
    desk.write("wall.toml", SCENE);
    desk.write("accurate.toml", format!("{SCENE}accuracy = 1e-8\n"));
    desk.write("broken.jsonl", "{\"scene\":\"wall\"}\n");
    let ran = desk.run("chart wall.toml --out w.svg --show anything");
    assert!(ran.code == Some(2) && ran.err.contains("'[SCENE.toml]' cannot be used with"), "{ran:?}");
    for (args, message) in [
        ("wall.toml --out wall.png", "--out wall.png: give a file that ends in .svg"),
        ("wall.toml --out w.svg --budget 0", "--budget 0: give a number of seconds above 0"),
        (
            "wall.toml --out w.svg --stiffness",
            "--stiffness: the scene has no compliant contact: give [contact], a surface or a pair the key compliance",
        ),
        (
            "accurate.toml --out w.svg",
            "accurate.toml: [run] accuracy = 1e-8: simulate and plan choose a tolerance that meets it, other commands and functions do not: \
             give tolerance",
        ),
        ("no.toml --out w.svg", "no.toml: cannot be read: No such file or directory (os error 2)"),
        ("wall.toml --out w.svg --peers no.jsonl", "no.jsonl: cannot be read: No such file or directory (os error 2)"),
        ("wall.toml --out w.svg --peers broken.jsonl", "broken.jsonl:1: missing field `peer` at line 1 column 16"),
    ] {
        let ran = desk.run(&format!("chart {args}"));
        assert_eq!((ran.code, ran.err), (Some(1), format!("error: {message}\n")));
        assert!(!desk.join("w.svg").exists() && ran.out.is_empty());
    }
}

//! `carom aim`: output, files and refusals.

use crate::command_line::desk::*;

/// The scene that is written strikes as the answer says, with the torques in the table beside it.
#[test]
fn the_scene_the_table_and_the_answer_are_of_one_motion() {
    let desk = Desk::with_studies();
    let found = desk.one("aim studies/aims/nail.toml --out blow.toml --out blow.csv --json");
    assert!(found["conditions"][0]["miss"].as_f64().unwrap() <= 1e-9);
    let run = desk.one("simulate blow.toml --json");
    let strike = &run["events"][0];
    assert_eq!(strike["contact"], "tip on wall");
    let near = |own: &serde_json::Value, other: f64| (own.as_f64().unwrap() - other).abs() < 1e-6;
    assert!(near(&strike["time"], found["events"][0]["time"].as_f64().unwrap()), "{strike}");
    let table = desk.read("blow.csv");
    let last: Vec<f64> = table.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    assert!(near(&run["final"]["q"][0], last[1]) && near(&run["final"]["q"][1], last[2]), "{last:?} {run}");
    let torques = desk.read("blow.torques.csv");
    assert!(torques.starts_with("time,shoulder,elbow\n0,"), "{torques}");
    assert_eq!(torques.lines().count(), 10);
}

/// The scene with feedback makes the same strike, and disturbed starts end nearer to it by the factor that the answer says or more.
#[test]
fn the_scene_with_feedback_repeats_the_motion_and_holds_disturbed_starts_to_it() {
    let desk = Desk::with_studies();
    desk.one("aim studies/aims/bounce.toml --out bounce.toml --json");
    let found = desk.one("feedback bounce.toml --torque 10 --out tracked.toml --json");
    assert_eq!((found["impacts"].as_u64(), found["motors"].as_array().map(Vec::len)), (Some(1), Some(1)), "{found}");
    let [without, with] = ["without", "with"].map(|key| found["growth"][key].as_f64().unwrap());
    assert!(without > 2.0 && with < 1e-4, "{found}");
    let end = |scene: &str, start: f64| {
        let text = desk.read(scene);
        desk.write("moved.toml", text.replace("4.0001", &start.to_string()));
        let run = desk.one("simulate moved.toml --json");
        assert_eq!(run["events"].as_array().map(Vec::len), Some(1), "{run}");
        [&run["final"]["q"][0], &run["final"]["qd"][0]].map(|x| x.as_f64().unwrap())
    };
    let off = |a: [f64; 2], b: [f64; 2]| ((a[0] - b[0]) / 0.01).hypot((a[1] - b[1]) / 0.1);
    let aim = end("bounce.toml", 4.0001);
    assert!(off(end("tracked.toml", 4.0001), aim) < 1e-4);
    // 2 cm are two deviations.
    for start in [3.9801, 4.0201] {
        let missed = [end("bounce.toml", start), end("tracked.toml", start)].map(|other| off(other, aim));
        assert!(missed[0] > 0.4 && missed[1] < 2.0 * 1.1 * with + 1e-4, "{missed:?}");
    }
}

#[test]
fn feedback_that_cannot_be_is_refused_with_names() {
    let desk = Desk::with_studies();
    desk.one("aim studies/aims/nail.toml --out blow.toml --json");
    desk.one("feedback blow.toml --out tracked.toml --json");
    let (scene, table) = ["tracked.toml", "tracked.feedback.csv"].map(|name| desk.read(name)).into();
    let other = |name: &str| scene.replace("tracked.feedback.csv", name);
    desk.write("half.toml", other("half.csv"));
    desk.write("half.csv", table.replacen(",0,", ",0.5,", 1));
    desk.write("name.toml", other("name.csv"));
    desk.write("name.csv", table.replacen("gain.elbow.qd.elbow", "gain.elbow.qd.elbo", 1));
    desk.write("three.toml", scene.replace("torque_file = \"blow.torques.csv\"", "torque = [1, 2, 3]"));
    desk.write("both.toml", scene.replace("torque_file", "torque = [1, 2]\ntorque_file"));
    for (args, told) in [
        (
            "feedback scenes/racket.toml",
            "racket.toml: feedback: controller = \"pd\": it is added to a motion without it",
        ),
        ("feedback scenes/box.toml", "box.toml: feedback: 'box' has no joint with one coordinate"),
        (
            "feedback blow.toml --joints nix",
            "feedback: 'nix' is no joint with one coordinate: there are shoulder, elbow",
        ),
        ("feedback blow.toml --position 0", "deviation of positions is 0: it must be positive"),
        ("feedback blow.toml --out blow.toml", "the command reads this file"),
        ("simulate half.toml", "half.csv: impacts = 0.5 at the time"),
        ("simulate name.toml", "name.csv: column gain.elbow.qd.elbo is not known"),
        ("simulate three.toml", "torque has 3 numbers, 2 are needed (shoulder, elbow)"),
        ("simulate both.toml", "takes torque or torque_file, not both"),
    ] {
        refused_with(&desk.run(args), told);
    }
}

#[test]
fn aims_that_are_not_reached_and_wrong_problems_name_file_key_and_rule() {
    let desk = Desk::with_studies();
    let racket = desk.read("studies/aims/racket.toml");
    let racket = racket.replace("../../scenes", "scenes");
    desk.write("far.toml", racket.replace("equals = 1.8", "equals = 18"));
    desk.write("typo.toml", racket.replace("robot.q[3]", "robot.q[30]"));
    let twice = "[[unknown]]\nname = \"v\"\nfirst = 1\nset = { \"robot.q[3]\" = \"v\" }\n";
    desk.write("twice.toml", format!("{racket}\n{twice}"));
    for (args, told) in [
        ("aim twice.toml", "both set robot.q[3]: remove one"),
        ("aim studies/aims/none.toml", "studies/aims/none.toml: cannot be read"),
        ("aim far.toml", "far.toml: not reached after"),
        ("aim typo.toml", "typo.toml: [[unknown]] robot.q[30]: "),
        ("aim studies/aims/bounce.toml --starts 2", "error: studies/aims/bounce.toml: torque z 1: has no bounds"),
        ("aim studies/aims/racket.toml --out racket.svg", "the ending of the name says what is written"),
        ("aim studies/aims/racket.toml --out studies/aims/racket.toml", "the command reads this file"),
    ] {
        refused_with(&desk.run(args), told);
    }
}

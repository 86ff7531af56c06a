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
    let table = std::fs::read_to_string(desk.0.join("blow.csv")).unwrap();
    let last: Vec<f64> = table.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    assert!(near(&run["final"]["q"][0], last[1]) && near(&run["final"]["q"][1], last[2]), "{last:?} {run}");
    let torques = std::fs::read_to_string(desk.0.join("blow.torques.csv")).unwrap();
    assert!(torques.starts_with("time,shoulder,elbow\n0,"), "{torques}");
    assert_eq!(torques.lines().count(), 10);
}

#[test]
fn aims_that_are_not_reached_and_wrong_problems_name_file_key_and_rule() {
    let desk = Desk::with_studies();
    let racket = std::fs::read_to_string(desk.0.join("studies/aims/racket.toml")).unwrap();
    let racket = racket.replace("../../scenes", "scenes");
    std::fs::write(desk.0.join("far.toml"), racket.replace("equals = 1.8", "equals = 18")).unwrap();
    std::fs::write(desk.0.join("typo.toml"), racket.replace("robot.q[3]", "robot.q[30]")).unwrap();
    for (args, told) in [
        ("aim studies/aims/none.toml", "studies/aims/none.toml: cannot be read"),
        ("aim far.toml", "far.toml: not reached after"),
        ("aim typo.toml", "typo.toml: [[unknown]] robot.q[30]: "),
        ("aim studies/aims/bounce.toml --starts 2", "torque z 1: has no bounds"),
        ("aim studies/aims/racket.toml --out racket.svg", "the ending of the name says what is written"),
        ("aim studies/aims/racket.toml --out studies/aims/racket.toml", "the command reads this file"),
    ] {
        let ran = desk.run(args);
        assert!(ran.code == Some(1) && ran.err.contains(told), "{args}: {ran:?}");
    }
}

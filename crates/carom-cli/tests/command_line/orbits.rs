//! `carom orbit`: output, files and refusals.

use crate::command_line::desk::*;

/// The desk with the studies of the repository.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.0.link(&["robots", "scenes", "studies"]);
    desk
}

#[test]
fn an_orbit_its_branch_and_its_cycles_are_written_as_tables() {
    let desk = desk();
    let ball = "orbit studies/atlas/ball.toml";
    let found = desk.one(&format!("{ball} --out period.csv --json"));
    assert_eq!(found["stability"], "stable");
    let table = std::fs::read_to_string(desk.0.join("period.csv")).unwrap();
    assert!(table.starts_with("time,q.z,qd.z\n0,"), "{table}");
    assert_eq!(table.lines().count(), 202);
    let branch = desk.one(&format!("{ball} --branch --out branch.csv --out branch.svg --show q.z --json"));
    // Γ² = (2(1+e²)/(1+e)²)² + (π(1−e)/(1+e))² at e = 0.5.
    let flip = (2.0 * 1.25 / 2.25_f64).hypot(std::f64::consts::PI / 3.0);
    assert_eq!(branch["special"][0]["kind"], "flip");
    assert!((branch["special"][0]["parameter"].as_f64().unwrap() - flip).abs() < 1e-8);
    let rows = std::fs::read_to_string(desk.0.join("branch.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + branch["points"].as_array().unwrap().len());
    assert!(std::fs::read_to_string(desk.0.join("branch.svg")).unwrap().contains("Orbits over acceleration"));
    let cycles = desk.one(&format!("{ball} --cycles 3 --skip 2 --values 4 --out cycles.csv --json"));
    assert_eq!(
        (cycles["values"].as_u64(), cycles["rows"].as_u64(), cycles["failed"].as_u64()),
        (Some(4), Some(12), Some(0))
    );
    let rows = std::fs::read_to_string(desk.0.join("cycles.csv")).unwrap();
    assert!(rows.starts_with("acceleration,cycle,q.z,qd.z,outcome\n1.2,2,"), "{rows}");
}

#[test]
fn what_cannot_be_done_names_file_option_and_rule() {
    let desk = desk();
    for (args, told) in [
        ("orbit studies/atlas/none.toml", "studies/atlas/none.toml: cannot be read"),
        ("orbit studies/atlas/hammer2.toml --branch", "[vary] is missing: give it parameter, from and to"),
        ("orbit studies/atlas/hammer2.toml --cycles 2 --values 3 --out c.csv", "--values: the problem has no [vary]"),
        (
            "orbit studies/atlas/ball.toml --branch --out b.svg --show speed",
            "--show speed: the columns of the branch are acceleration",
        ),
        ("orbit studies/atlas/ball.toml --out o.svg", "the ending of the name says what is written"),
    ] {
        let ran = desk.run(args);
        assert!(ran.code == Some(1) && ran.err.contains(told), "{args}: {ran:?}");
    }
}

//! `carom orbit`: output, files and refusals.

use crate::command_line::desk::*;

#[test]
fn an_orbit_its_branch_and_its_cycles_are_written_as_tables() {
    let desk = Desk::with_studies();
    let ball = "orbit studies/atlas/ball.toml";
    let found = desk.one(&format!("{ball} --out period.csv --json"));
    assert_eq!(found["stability"], "stable");
    let table = desk.read("period.csv");
    assert!(table.starts_with("time,q.z,qd.z\n0,"), "{table}");
    assert_eq!(table.lines().count(), 202);
    let branch = desk.one(&format!("{ball} --branch --out branch.csv --out branch.svg --show q.z --json"));
    // Γ² = (2(1+e²)/(1+e)²)² + (π(1−e)/(1+e))² at e = 0.5.
    let flip = (2.0 * 1.25 / 2.25_f64).hypot(std::f64::consts::PI / 3.0);
    assert_eq!(branch["special"][0]["kind"], "flip");
    assert!((branch["special"][0]["parameter"].as_f64().unwrap() - flip).abs() < 1e-8);
    let rows = desk.read("branch.csv");
    assert_eq!(rows.lines().count(), 1 + branch["points"].as_array().unwrap().len());
    assert!(desk.read("branch.svg").contains("Orbits over acceleration"));
    let cycles = desk.one(&format!("{ball} --cycles 3 --skip 2 --values 4 --out cycles.csv --json"));
    assert_eq!(
        (cycles["values"].as_u64(), cycles["rows"].as_u64(), cycles["failed"].as_u64()),
        (Some(4), Some(12), Some(0))
    );
    let rows = desk.read("cycles.csv");
    assert!(rows.starts_with("acceleration,cycle,q.z,qd.z,outcome\n1.2,2,"), "{rows}");
}

#[test]
fn multipliers_phase_portraits_and_cycles_are_drawn() {
    let desk = Desk::with_studies();
    let ball = "studies/atlas/ball.toml";
    desk.one(&format!("orbit {ball} --branch --out m.svg --show multipliers --json"));
    assert!(desk.read("m.svg").contains("unit circle"));
    desk.one(&format!("orbit {ball} --out phase.svg --json"));
    assert!(desk.read("phase.svg").contains("qd.z, m/s") && desk.read("phase.svg").contains("impact"));
    desk.one(&format!("orbit {ball} --cycles 3 --values 4 --out c.svg --json"));
    assert!(desk.read("c.svg").contains("Cycles over acceleration"));
}

#[test]
fn basins_and_parts_of_cycles_are_tables_of_their_rows() {
    let desk = Desk::with_studies();
    let text = desk.read("studies/atlas/ball.toml");
    let text = text.replace("ball_scene.toml", "studies/atlas/ball_scene.toml").replace("points = 200", "points = 3");
    desk.write("small.toml", text);
    let basin = desk.one("orbit small.toml --basin --out b.csv --out b.svg --json");
    assert_eq!((basin["rows"].as_u64(), basin["computed"].as_u64()), (Some(9), Some(9)));
    assert!(
        desk.read("b.csv").starts_with("qd z,z,outcome,cycles,period,q.z,qd.z\n-1,0.01,settled,"),
        "{}",
        desk.read("b.csv")
    );
    assert_eq!(desk.read("b.csv").lines().count(), 10);
    assert!(desk.read("b.svg").contains("Basins of attraction"));
    desk.one("orbit small.toml --cycles 2 --skip 1 --values 3 --out all.csv --json");
    let part =
        desk.one("orbit small.toml --cycles 2 --skip 1 --values 3 --out part.csv --shard 2/3 --threads 1 --json");
    assert_eq!((part["values"].as_u64(), part["rows"].as_u64()), (Some(1), Some(2)));
    let (all, part) = (desk.read("all.csv"), desk.read("part.csv"));
    assert_eq!(all.lines().skip(3).take(2).collect::<Vec<_>>(), part.lines().skip(1).collect::<Vec<_>>());
    let doubled = desk.one("orbit studies/atlas/ball.toml --branch --doubled 1 --out d.csv --json");
    assert_eq!((doubled["passages"].as_u64(), doubled["doubled"][0]["passages"].as_u64()), (Some(1), Some(2)));
    let points =
        doubled["points"].as_array().unwrap().len() + doubled["doubled"][0]["points"].as_array().unwrap().len();
    assert_eq!(desk.read("d.csv").lines().count(), 1 + points);
}

/// The branch that was computed is not lost because none of twice the period begins on it.
#[test]
fn a_branch_without_a_flip_is_told_beside_the_warning() {
    let desk = Desk::with_studies();
    let ran = desk.run("orbit studies/atlas/rattle.toml --branch --doubled 1");
    assert!(ran.code == Some(0) && ran.err.contains("warning: --doubled 1: "), "{ran:?}");
    assert!(
        ran.err.contains("the branch of 1 passage has no flip") && ran.out.contains("the branch ends at"),
        "{ran:?}"
    );
}

#[test]
fn what_cannot_be_done_names_file_option_and_rule() {
    let desk = Desk::with_studies();
    for (args, told) in [
        ("orbit studies/atlas/none.toml", "studies/atlas/none.toml: cannot be read"),
        ("orbit studies/atlas/hammer2.toml --branch", "[vary] is missing: give it parameter, from and to"),
        ("orbit studies/atlas/hammer2.toml --cycles 2 --values 3 --out c.csv", "[vary] is missing, and several values"),
        ("orbit studies/atlas/hammer2.toml --basin --out c.csv", "[basin] is missing: give it x and y"),
        ("orbit studies/atlas/hammer2.toml --branch --doubled 1", "[vary] is missing: give it parameter, from and to"),
        ("orbit studies/atlas/ball.toml --cycles 2 --out -", "--out -: the table can be resumed from its file"),
        ("orbit studies/atlas/ball.toml --out o.csv --threads 1", "--threads is for the rows of --cycles and --basin"),
        ("orbit studies/atlas/ball.toml --out o.csv --show q.z", "--show: no picture is written"),
        ("orbit studies/atlas/ball.toml --out o.svg --show q.z", "the picture of one orbit has two columns"),
        ("orbit studies/atlas/ball.toml --out o.svg --show q.z,speed", "no column 'speed': there are time, q.z, qd.z"),
        (
            "orbit studies/atlas/ball.toml --cycles 2 --values 2 --out o.svg --show speed",
            "no column 'speed': there are q.z, qd.z",
        ),
        (
            "orbit studies/atlas/ball.toml --branch --out b.svg --show speed",
            "--show speed: the columns of the branch are acceleration",
        ),
        ("orbit studies/atlas/ball.toml --out o.txt", "the ending of the name says what is written"),
    ] {
        refused_with(&desk.run(args), told);
    }
    let ball = "orbit studies/atlas/ball.toml --out o.csv";
    for options in ["--branch --values 3", "--branch --skip 3", "--basin --values 3", "--cycles 2 --doubled 1"] {
        usage(desk.run(&format!("{ball} {options}")), "cannot be used with");
    }
}

//! The book's pages on output files and commands name what real runs write.
#![cfg(unix)]

use crate::command_line::desk::Desk;
use carom_testing::files::{named, page, path, text};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// What `carom` answers to lines on standard input.
fn feed(desk: &Desk, args: &str, input: &str) -> String {
    let ran = desk.feed(args, input);
    assert_eq!(ran.code, Some(0), "carom {args}: {}", ran.err);
    ran.out
}

fn carom(desk: &Desk, args: &str) -> String {
    feed(desk, args, "")
}

fn header(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).unwrap();
    text.lines().next().unwrap().split(',').map(str::to_owned).collect()
}

/// The column with its joint and number as the page writes them.
fn general(column: &str) -> String {
    let mut parts = column.split('.');
    match (parts.next(), parts.next(), parts.next()) {
        (Some("motor"), Some(_), _) => "motor.JOINT".into(),
        (Some("error"), Some(of), Some(_)) => format!("error.{of}.JOINT"),
        (Some(head @ ("q" | "qd")), Some(_), None) => format!("{head}.JOINT"),
        (Some(head @ ("q" | "qd")), Some(_), Some(_)) => format!("{head}.JOINT.K"),
        _ => column.to_owned(),
    }
}

#[test]
fn columns_of_events_are_those_of_the_page() {
    let (page, desk) = (page("reference-output.md"), Desk::with_studies());
    carom(&desk, "simulate scenes/planar2.toml --error --events e.csv");
    let general = |column: &String| column.split_once('.').map_or(column.clone(), |(head, _)| format!("{head}.JOINT"));
    let seen: BTreeSet<String> = header(&desk.join("e.csv")).iter().map(general).collect();
    assert_eq!(seen, named(&page, "## Events").into_iter().collect());
}

#[test]
fn columns_of_a_simulation_are_those_of_the_page() {
    let (page, desk) = (page("reference-output.md"), Desk::with_studies());
    let mut seen = BTreeSet::new();
    for scene in ["planar2", "bounce"] {
        carom(&desk, &format!("simulate scenes/{scene}.toml --loads --error --csv {scene}.csv"));
        seen.extend(header(&desk.join(format!("{scene}.csv"))).iter().map(|column| general(column)));
    }
    assert_eq!(seen, named(&page, "## Simulation").into_iter().collect());
}

/// Studies in which each axis varies in turn, with every quantity of the page on study files.
#[test]
fn columns_of_a_map_are_those_of_the_pages() {
    let (output, study, desk) = (page("reference-output.md"), page("reference-study.md"), Desk::with_studies());
    let axes = named(&output, "## Map");
    let quantities = named(&study, "### `quantities`");
    let wanted = quantities.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    let planar = "[robot]\nurdf = \"robots/planar2.urdf\"\n";
    let space = "[robot]\nurdf = \"robots/arm7.urdf\"\n";
    let grid = "[joints]\nshoulder = [0.7, 0.8]\nelbow = -1.5\n";
    let place = "[tip]\nx = [0.4, 0.5]\ny = [0.1, 0.2]\nelbow = \"both\"\n";
    let spatial = "[tip]\nx = [0.4, 0.45]\ny = 0.1\nz = [0.5, 0.6]\nseeds = [[0, 0.5, 0, 1, 0, 0.8, 0], [0, 0.6, 0, 1, 0, 0.8, 0]]\n";
    let normal = "[impact]\nnormal = [-1, 0, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"newton\"\nrestitution = 0.3\n";
    let degrees = "[impact]\nnormal_deg = [170, 180]\napproach_deg = [40, 50]\nspeed = [0.1, 0.2]\n\
        law = [\"newton\", \"chatterjee-ruina\"]\nrestitution = [0.3, 0.4]\nfriction = [0.1, 0.2]\n\
        tangential_restitution = [0, 0.1]\n";
    let normals = "[impact]\nnormal = [[-1, 0, 0], [0, 0, 1]]\nalong = [1, 1, 1]\napproach_deg = 80\nspeed = 0.2\n\
        law = \"frictionless\"\nrestitution = 0.3\n";
    let mut seen = BTreeSet::new();
    for (robot, poses, impact, quantities) in [
        (planar, grid, normal, wanted.as_str()),
        (planar, place, degrees, "\"impulse\""),
        (space, spatial, normals, "\"impulse\""),
    ] {
        std::fs::write(desk.join("study.toml"), format!("{robot}{poses}{impact}[map]\nquantities = [{quantities}]\n"))
            .unwrap();
        carom(&desk, "map study.toml --out map.csv");
        let columns: Vec<String> = header(&desk.join("map.csv")).iter().map(|column| general(column)).collect();
        let class = columns.iter().position(|column| column == "class").unwrap();
        let place = |column: &String| {
            axes.iter().position(|axis| axis == column).unwrap_or_else(|| panic!("{column}: {axes:?}"))
        };
        let given = columns[..=class].iter().filter(|column| *column != "q.JOINT");
        assert!(given.map(place).is_sorted(), "{columns:?}");
        seen.extend(columns[..=class].iter().cloned());
        for column in &columns[class + 1..] {
            let name = column.split('.').next().unwrap();
            assert!(quantities.contains(&format!("\"{name}\"")), "{column}");
            seen.insert(name.to_owned());
        }
    }
    let all: BTreeSet<String> = axes.into_iter().chain(quantities).collect();
    assert_eq!(seen, all);
}

#[test]
fn columns_of_a_chart_and_of_the_paper_are_those_of_the_page() {
    let (page, desk) = (page("reference-output.md"), Desk::with_studies());
    carom(&desk, "chart scenes/planar2.toml --out chart.svg --budget 0.01");
    assert_eq!(header(&desk.join("chart.csv")), named(&page, "## Chart"));
    carom(&desk, "paper --out figures");
    let mut tables = 0;
    for entry in std::fs::read_dir(desk.join("figures")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "csv") {
            let name = path.file_name().unwrap().to_str().unwrap();
            assert_eq!(header(&path), named(&page, &format!("### `{name}`")), "{name}");
            tables += 1;
        }
    }
    assert_eq!(tables, page.lines().filter(|line| line.starts_with("### `fig") || *line == "### `table1.csv`").count());
}

/// Every command stands on the page with the command that prints its help, which the book shows below it.
#[test]
fn help_of_every_command_is_on_the_page() {
    let (page, desk) = (page("reference-cli.md"), Desk::with_studies());
    let general = carom(&desk, "--help");
    let commands = general.lines().skip_while(|line| *line != "Commands:").take_while(|line| *line != "Options:");
    let names: Vec<&str> = commands
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(names.len() >= 10, "{names:?}");
    for name in names {
        assert!(page.contains(&format!("```sh\ncarom {name} --help\n```\n")), "the page has no block for carom {name}");
    }
}

/// A page that names a test as `file::name`, or a source file alone.
#[test]
fn tests_named_on_the_page_exist() {
    let page = text("docs/tested.md");
    let (mut missing, mut named) = (Vec::new(), 0);
    for name in page.split('`').skip(1).step_by(2).filter(|name| name.contains(".rs")) {
        let (file, test) = name.split_once("::").unwrap_or((name, ""));
        match std::fs::read_to_string(path(file)) {
            Ok(text) if test.is_empty() || text.contains(&format!("fn {test}(")) => named += 1,
            Ok(_) => missing.push(format!("{file} has no fn {test}")),
            Err(_) => missing.push(format!("{file} does not exist")),
        }
    }
    assert!(missing.is_empty(), "{}", missing.join("\n"));
    assert!(named > 100, "only {named} tests are named");
}

/// The paths of all keys of an answer: `a.b`, and `a[].b` of what is in a list. The keys of `values` are columns.
fn paths(value: &Value, at: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(all) if !at.ends_with("values") => {
            for (key, value) in all {
                let path = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
                found.insert(path.clone());
                paths(value, &path, found);
            }
        }
        Value::Array(all) => all.iter().for_each(|value| paths(value, &format!("{at}[]"), found)),
        _ => {}
    }
}

/// A key of an answer is a row of its command's table, or is named in the text of the row of what holds it; and every row
/// that is not optional has its key in an answer.
#[test]
fn keys_of_answers_are_those_of_the_page() {
    let (page, desk) = (page("reference-cli.md"), Desk::with_studies());
    let state = r#"{"q":[0.7854,-1.5708],"qd":[-0.15,0.6],"tau":[0,0],"qdd":[0,0]}"#;
    let kane = r#"{"delassus":[[2.440338,1.521309],[1.521309,1.009560]],"u":[-0.267174,-0.134202]}"#;
    let jumps: String = (0..12)
        .map(|k| f64::from(k) * 0.1 + 0.5)
        .map(|u| format!("{{\"delassus\":[[1,0],[0,1]],\"u_minus\":[{u},-1],\"u_plus\":[{},0.5]}}\n", u - 0.3))
        .collect();
    let scene = desk.read("scenes/planar2.toml");
    let scene = scene.replace("friction = 0.0", "friction = 0.1").replace("[run]", "[run]\nneglect = 0.5");
    let ball = desk.read("studies/atlas/ball.toml");
    let ball = ball.replace("ball_scene.toml", "studies/atlas/ball_scene.toml").replace("points = 200", "points = 2");
    desk.write("small.toml", ball);
    let arm = desk.read("scenes/planar3.toml");
    desk.write("accurate.toml", arm.replace("[run]", "[run]\naccuracy = 1e-6").replace("../", ""));
    desk.write("own/scene.toml", scene);
    let robot = "robots/planar2.urdf --tip tip --states - --json";
    let strike = format!("impact {robot} --normal -1,0,0 --law energetic --restitution 0.35 --friction 0.2");
    let runs: [(&str, Vec<(String, &str)>); 15] = [
        ("inspect", vec![("inspect robots/arm7.urdf --json".into(), "")]),
        ("dynamics", vec![(format!("dynamics {robot}"), state)]),
        (
            "impact",
            vec![
                (format!("{strike} --derivatives --loads --restitution-range 0.3:0.4"), state),
                (format!("{strike} --joint-stiffness 2000 --contact-time 0.005"), state),
            ],
        ),
        ("law", vec![("law --law poisson --restitution 0.5 --friction 0.5 --problems - --json".into(), kane)]),
        ("map", vec![("map studies/self_motion.toml --advise --json".into(), "")]),
        ("plan", vec![("plan own/scene.toml --json".into(), "")]),
        (
            "simulate",
            vec![
                ("simulate scenes/planar2.toml --sensitivity --loads --json".into(), ""),
                ("simulate accurate.toml --error --json".into(), ""),
            ],
        ),
        (
            "aim",
            vec![
                ("aim studies/aims/nail.toml --json".into(), ""),
                ("aim studies/aims/racket.toml --starts 3 --json".into(), ""),
            ],
        ),
        ("feedback", vec![("feedback scenes/planar2.toml --json".into(), "")]),
        (
            "orbit",
            vec![
                ("orbit studies/atlas/ball.toml --json".into(), ""),
                ("orbit studies/atlas/ball.toml --branch --doubled 1 --json".into(), ""),
                ("orbit small.toml --basin --out basin.csv --json".into(), ""),
                ("orbit studies/atlas/ball.toml --cycles 2 --out cycles.csv --json".into(), ""),
            ],
        ),
        (
            "chart",
            vec![
                ("chart scenes/planar2.toml --out c.svg --budget 0.01 --json".into(), ""),
                ("chart scenes/feet.toml --stiffness --out f.svg --json".into(), ""),
            ],
        ),
        ("stress", vec![("stress --out stress --scene jam --json".into(), "")]),
        ("paper", vec![("paper --out paper --json".into(), "")]),
        ("consistency", vec![("consistency docs/table1.csv --json".into(), "")]),
        ("fit", vec![("fit --velocities - --json".into(), jumps.as_str())]),
    ];
    for (command, runs) in runs {
        let (_, section) = page.split_once(&format!("\n## {command}\n")).unwrap();
        let section = section.split("\n## ").next().unwrap();
        let rows: Vec<&str> = section.lines().filter(|line| line.starts_with("| `")).collect();
        let help = carom(&desk, &format!("{command} --help"));
        let (_, listed) = help.split_once("Keys of statistics:").unwrap_or_default();
        let mut seen = BTreeSet::new();
        for (args, input) in runs {
            for line in feed(&desk, &args, input).lines() {
                paths(&serde_json::from_str(line).unwrap(), "", &mut seen);
            }
        }
        for path in &seen {
            let own = rows.iter().any(|row| row.starts_with(&format!("| `{path}` |")));
            let above = rows
                .iter()
                .any(|row| row.starts_with(&format!("| `{path}.")) || row.starts_with(&format!("| `{path}[]")));
            let leaf = path.rsplit('.').next().unwrap();
            let inside = rows.iter().any(|row| {
                let key = row[3..].split('`').next().unwrap().trim_end_matches("[]");
                path.starts_with(key) && row.contains(&format!("`{leaf}`"))
            });
            let listed = path.starts_with("statistics.") && listed.contains(&format!("\n  {leaf} "));
            assert!(own || above || inside || listed, "carom {command} answers {path}, which is not on the page");
        }
        if command == "fit" {
            continue; // its section has tables of what it reads, too
        }
        // tables of flags and events have two columns, tables of keys three
        for row in rows.iter().filter(|row| row.matches(" | ").count() == 2 && !row.contains("optional")) {
            let key = row[3..].split('`').next().unwrap().trim_end_matches("[]");
            assert!(seen.contains(key), "carom {command} has no key {key}, which is on the page");
        }
    }
}

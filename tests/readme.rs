//! The README: what `cargo run --example planar2` prints, its snippets, and the size of the page; and words that no page of the book has.

use carom::prelude::*;
use std::process::Command;

const README: &str = include_str!("../README.md");

/// The example is run as a user runs it, in a folder of its own, since it writes a recording.
fn printed_by_the_example() -> String {
    let folder = std::env::temp_dir().join(format!("carom-readme-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "-q", "--locked", "--example", "planar2", "--manifest-path"]);
    cargo.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).current_dir(&folder);
    if cfg!(not(feature = "rerun")) {
        cargo.arg("--no-default-features");
    }
    let ran = cargo.output().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8(ran.stdout).unwrap()
}

/// Every line of the README's first printed block is a line of the example's output, in the same order.
#[test]
fn readme_shows_what_the_example_prints() {
    let blocks: Vec<&str> = README.split("```text\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let shown = blocks.iter().find(|block| block.contains("elbow")).expect("a block with the example's output");
    assert!(shown.lines().count() > 8, "{shown}");
    let printed = printed_by_the_example();
    let mut rest = printed.lines().map(str::trim_end);
    for line in shown.lines().map(str::trim_end) {
        assert!(rest.any(|printed| printed == line), "the README says\n{line}\nbut the example prints\n{printed}");
    }
}

#[test]
fn readme_has_at_most_12_kb() {
    assert!(README.len() <= 12_000, "{} bytes", README.len());
}

/// The impact of the README's Rust and Python snippets: the tip rebounds, and the impact loses energy.
#[test]
#[expect(clippy::approx_constant, reason = "the digits of the README")]
fn the_impact_of_the_readme_rebounds_and_loses_energy() {
    let arm = Chain::from_urdf_file(concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf")).unwrap();
    let tip = arm.frame("tip").unwrap();
    let (q, qd) = ([0.7854, -1.5708], [-0.15, 0.6]);
    let law = Energetic { restitution: 0.35, friction: 0.2 };
    let hit = arm.impact(&q, &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law).unwrap();
    assert!(hit.energy_after < hit.energy_before);
    assert_eq!(hit.mode, Mode::ReverseSlip);
    // Both snippets are this impact.
    for part in
        ["[0.7854, -1.5708]", "[-0.15, 0.6]", "restitution: 0.35, friction: 0.2", "restitution=0.35, friction=0.2"]
    {
        assert!(README.contains(part), "{part}");
    }
}

/// Readers on a code forge see the lines that rustdoc hides.
#[test]
fn no_line_of_the_readmes_code_is_hidden() {
    let code = README.split("```rust\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    for line in code.flat_map(str::lines) {
        assert!(!line.starts_with("# "), "{line}");
    }
}

/// Words that tell how the project or a measurement was at another time. Such belong into the changelog.
const OF_ANOTHER_TIME: [&str; 21] = [
    "earlier version",
    "earlier versions",
    "earlier run",
    "earlier runs",
    "before it",
    "before this",
    "was measured before",
    "were measured before",
    "busy machine",
    "other job",
    "other jobs",
    "another job",
    "now reached",
    "missed as set",
    "as it was set",
    "as they were set",
    "aim of the project",
    "aims of the project",
    "aim of this project",
    "aims of this project",
    "not described further",
];

#[test]
fn pages_of_the_book_tell_of_no_other_time() {
    let pages = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/book/src")).unwrap();
    let pages = pages.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|end| end == "md"));
    let (mut read, mut found) = (0, Vec::new());
    for path in pages {
        let text = std::fs::read_to_string(&path).unwrap().to_lowercase();
        let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
        let words = format!(" {} ", words.join(" "));
        found.extend(
            OF_ANOTHER_TIME.iter().filter(|it| words.contains(&format!(" {it} "))).map(|it| (path.clone(), *it)),
        );
        read += 1;
    }
    assert!(read > 40 && found.is_empty(), "of {read} pages, write what is: {found:?}");
}

//! The README's first screen: what `cargo run --example planar2` prints, and the size of the page.

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

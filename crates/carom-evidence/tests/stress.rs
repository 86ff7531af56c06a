//! The table of scenes that are hard for methods: no cell is a defect, and the files in `docs` are those of a fresh run.

use super::method::{EXACT, METHODS, Scene, Verdict};
use super::scenes::SCENES;
use super::{Table, names};
use carom_testing::files::text;
use std::sync::LazyLock;

static TABLE: LazyLock<Table> = LazyLock::new(|| Table::of(&names().collect::<Vec<_>>(), &|_| {}));

fn named(text: &str) -> Table {
    Table::of(&names().filter(|name| name.contains(text)).collect::<Vec<_>>(), &|_| {})
}

#[test]
fn no_cell_of_any_scene_is_a_defect() {
    assert_eq!(TABLE.defects(), [""; 0]);
    for cell in TABLE.rows.iter().flat_map(|row| &row.cells) {
        assert_eq!(cell.verdict, cell.expected, "{}", cell.note);
        assert_eq!(cell.figure.is_none(), cell.verdict == Verdict::Refused);
    }
}

/// `docs/stress.md` and `docs/stress.svg` are made by `carom stress --out docs`.
#[test]
fn committed_table_and_picture_are_those_of_a_fresh_run() {
    for (name, fresh) in [("stress.md", TABLE.markdown()), ("stress.svg", TABLE.svg())] {
        let committed = text(&format!("docs/{name}"));
        let differs = committed.lines().zip(fresh.lines()).find(|(one, other)| one != other);
        let same = committed == fresh;
        assert!(
            same,
            "docs/{name} is not that of a fresh run: run `carom stress --out docs`; first difference: {differs:#?}"
        );
    }
}

#[test]
fn every_expectation_has_a_reason_and_a_bound_that_fits_its_verdict() {
    let found: Vec<String> = SCENES.iter().flat_map(inconsistencies).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// What is inconsistent in the scene's expectations; empty if nothing is.
fn inconsistencies(of: &Scene) -> Vec<String> {
    let mut found = Vec::new();
    let mut wrong = |methods: &[&str], what: &str| found.push(format!("{}: {}: {what}", of.name, methods.join(", ")));
    let listed = |method: &str| of.expected.iter().filter(|expected| expected.methods.contains(&method)).count();
    for expected in of.expected {
        let methods = expected.methods;
        if methods.iter().any(|method| !METHODS.contains(method) || listed(method) != 1) {
            wrong(methods, "a method that is unknown or listed twice");
        }
        if expected.reason.is_empty() {
            wrong(methods, "no reason");
        }
        let limits: Vec<_> = methods.iter().filter_map(|method| expected.limits(method).ok()).collect();
        let fits = |limits: &Option<[f64; 2]>| match (expected.verdict, limits) {
            (Verdict::Refused, None) => true,
            (Verdict::Exact, Some([least, most])) => *least == 0.0 && *most <= EXACT,
            (Verdict::Within, Some([least, most])) => least < most && *most > EXACT && *most <= of.tolerance,
            (Verdict::Degrades | Verdict::Fails, Some([least, most])) => least < most && *least > of.tolerance,
            _ => false,
        };
        if limits.len() != methods.len() || !limits.iter().all(fits) {
            wrong(methods, "the bound does not fit the verdict");
        }
    }
    found
}

/// The same rows whatever the order and the threads, and the same files.
#[test]
fn the_table_is_deterministic() {
    let one = named("grazing");
    assert!(one.rows.len() > 1);
    let scenes = SCENES.iter().filter(|scene| scene.name.contains("grazing"));
    let other = Table { methods: METHODS, rows: scenes.map(Scene::run).collect() };
    assert_eq!(one, other);
    assert_eq!((one.markdown(), one.svg()), (other.markdown(), other.svg()));
}

/// The scene of Kane & Levinson: Whittaker's law gains the energy that they found, Stronge's none.
#[test]
fn the_energy_paradox_has_its_published_verdicts() {
    let kane = &named("energy paradox").rows[0];
    let cell = |method| kane.cells.iter().find(|cell| cell.method == method).unwrap();
    assert_eq!(cell("whittaker").verdict, Verdict::Fails);
    assert!((cell("whittaker").figure.unwrap() - 6.35).abs() < 1e-3);
    assert_eq!(cell("energetic").verdict, Verdict::Exact);
}

#[test]
fn a_defect_is_told_by_its_scene_and_method() {
    let mut table = named("jam");
    assert_eq!(table.defects(), [""; 0]);
    let row = table.rows.iter_mut().find(|row| row.scene == "jam").unwrap();
    row.cells[4].verdict = Verdict::Defect;
    assert_eq!(table.defects(), ["jam / energetic"]);
}

/// The picture shows every scene and every method; of some scenes only the methods that stand beside one that applies.
#[test]
fn the_picture_has_every_scene_and_method() {
    let whole = TABLE.svg();
    for text in METHODS.into_iter().chain(TABLE.rows.iter().map(|row| row.scene)) {
        assert!(whole.contains(&text.replace('\'', "&apos;")), "{text}");
    }
    let picture = named("2 links").svg();
    for (k, text) in METHODS.into_iter().enumerate() {
        assert_eq!(picture.contains(&format!("\n{text}\n")), k < 8, "{text}");
    }
    assert_eq!(picture.matches("exact\n").count(), 8 + 1, "once in each cell, and once in the legend");
}

//! The table of scenes that are hard for methods: no cell is a defect, and the files in `docs` are those of a fresh run.

use carom_evidence::stress::{METHODS, Row, SCENES, Scene, Verdict, defects, markdown, run, svg};
use std::path::Path;
use std::sync::LazyLock;

static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| run(&SCENES.iter().collect::<Vec<_>>(), &|_| {}));

#[test]
fn no_cell_of_any_scene_is_a_defect() {
    let found: Vec<String> =
        defects(&ROWS).iter().map(|(scene, cell)| format!("{scene}, {}: {}", cell.method, cell.note)).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
    for cell in ROWS.iter().flat_map(|row| &row.cells) {
        assert_eq!(cell.verdict, cell.expected);
        assert_eq!(cell.figure.is_none(), cell.verdict == Verdict::Refused);
    }
}

/// `docs/stress.md` and `docs/stress.svg` are made by `carom stress --out docs`.
#[test]
fn committed_table_and_picture_are_those_of_a_fresh_run() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    for (name, fresh) in [("stress.md", markdown(&ROWS)), ("stress.svg", svg(&ROWS))] {
        let committed = std::fs::read_to_string(docs.join(name)).unwrap();
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
    let found: Vec<String> = SCENES.iter().flat_map(Scene::inconsistencies).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The same rows whatever the order and the threads, and the same files.
#[test]
fn the_table_is_deterministic() {
    let some: Vec<&Scene> = SCENES.iter().filter(|scene| scene.name.contains("grazing")).collect();
    assert!(some.len() > 1);
    let (one, other) = (run(&some, &|_| {}), some.iter().map(|scene| scene.run()).collect::<Vec<_>>());
    assert_eq!(one, other);
    assert_eq!((markdown(&one), svg(&one)), (markdown(&other), svg(&other)));
}

/// The picture shows every scene and every method; of some scenes only the methods that stand beside one that applies.
#[test]
fn the_picture_has_every_scene_and_method() {
    let whole = svg(&ROWS);
    for text in METHODS.into_iter().chain(ROWS.iter().map(|row| row.scene)) {
        assert!(whole.contains(&text.replace('\'', "&apos;")), "{text}");
    }
    let some: Vec<&Scene> = SCENES.iter().filter(|scene| scene.name.contains("2 links")).collect();
    let rows = run(&some, &|_| {});
    let picture = svg(&rows);
    for (k, text) in METHODS.into_iter().enumerate() {
        assert_eq!(picture.contains(&format!("\n{text}\n")), k < 8, "{text}");
    }
    assert_eq!(picture.matches("exact\n").count(), 8 + 1, "once in each cell, and once in the legend");
}

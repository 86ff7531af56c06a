//! The table of failures says what theory says.

use carom_study::stress::{METHODS, Row, SCENES, Scene, Verdict, markdown, run, svg};

/// Everything that does not take a minute.
fn rows() -> Vec<Row> {
    let quick: Vec<&Scene> = SCENES.iter().filter(|scene| scene.name != "10 000 bounces").collect();
    run(&quick, &|_| {})
}

#[test]
fn every_verdict_is_the_one_that_theory_gives() {
    let rows = rows();
    for row in &rows {
        for cell in &row.cells {
            assert_ne!(cell.verdict, Verdict::Defect, "{}, {}: {}", row.scene, cell.method, cell.note);
            assert!(cell.figure.is_none_or(f64::is_finite), "{}, {}", row.scene, cell.method);
            assert!(METHODS.contains(&cell.method));
        }
    }
    let verdict = |scene: &str, method: &str| {
        let row = rows.iter().find(|row| row.scene == scene).unwrap_or_else(|| panic!("{scene}"));
        row.cells.iter().find(|cell| cell.method == method).unwrap_or_else(|| panic!("{scene}, {method}")).verdict
    };
    use Verdict::{Degrades, Exact, Fails, Refused, Within};
    // Who gains energy, and who does not.
    for scene in ["energy paradox", "random census", "census in space"] {
        for method in &METHODS[..8] {
            let expected = if matches!(*method, "whittaker" | "newton") { Fails } else { Exact };
            assert_eq!(verdict(scene, method), expected, "{scene}, {method}");
        }
    }
    // Friction makes two answers possible where nothing approaches; without it there is one.
    assert_eq!(verdict("impact without collision", "frictionless"), Exact);
    assert_eq!(verdict("impact without collision", "energetic"), Fails);
    assert_eq!(verdict("slip about to stop", "brach"), Fails);
    assert!(METHODS[..8].iter().all(|method| verdict("stretched exactly", method) == Refused));
    // Orders, different e, and waves.
    assert_eq!(verdict("rod on two ends", "moreau"), Exact);
    assert_eq!(verdict("rod on two ends", "sequential"), Fails);
    assert_eq!(verdict("e differs per contact", "moreau"), Fails);
    assert_eq!(verdict("e differs per contact", "glocker-pfeiffer"), Exact);
    for method in ["moreau", "glocker-pfeiffer", "sequential"] {
        assert_eq!(verdict("Newton's cradle", method), Fails, "{method}");
        assert_eq!(verdict("rocking block", method), Exact, "{method}");
    }
    // Simulators.
    assert_eq!(verdict("Zeno", "events"), Exact);
    assert_eq!(verdict("Zeno", "steps"), Degrades);
    assert!(matches!(verdict("false Zeno", "events"), Exact | Within));
    assert_eq!(verdict("grazing in flight", "events"), Exact);
    assert_eq!(verdict("block on a slope", "compliant"), Fails);
    assert_eq!(verdict("Painlevé's rod", "events"), Fails);
}

/// The same rows whatever the order and the threads, and the same files.
#[test]
fn the_table_is_deterministic() {
    let some: Vec<&Scene> = SCENES.iter().filter(|scene| scene.name.contains("en")).collect();
    assert!(some.len() > 3);
    let (one, other) = (run(&some, &|_| {}), some.iter().map(|scene| scene.run()).collect::<Vec<_>>());
    assert_eq!(one, other);
    assert_eq!((markdown(&one), svg(&one)), (markdown(&other), svg(&other)));
}

/// Every cell of the table is in the picture, in its row and column.
#[test]
fn the_picture_holds_every_scene_and_method() {
    let some: Vec<&Scene> = SCENES.iter().filter(|scene| scene.name.contains("links")).collect();
    let rows = run(&some, &|_| {});
    let picture = svg(&rows);
    for text in METHODS.into_iter().chain(rows.iter().map(|row| row.scene)) {
        assert!(picture.contains(text), "{text}");
    }
    assert_eq!(picture.matches("exact\n").count(), 3 * 8 + 1, "and once in the legend");
}

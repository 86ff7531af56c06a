//! The book's page on study files names every key, quantity and class that the parser accepts, and no other.
#![cfg(unix)]

use carom_study::NumberedRows;
use carom_study::map_study::{CLASSES, Study};
use carom_testing::files::{self, Folder};
use std::collections::BTreeSet;

fn named(page: &str, heading: &str) -> BTreeSet<String> {
    files::named(page, heading).into_iter().collect()
}

fn page() -> String {
    files::page("reference-study.md")
}

/// A folder beside a link to the presets, in which studies can be written as in `studies/`.
fn folder() -> Folder {
    let desk = Folder::new();
    desk.link(&["robots"]);
    desk
}

fn read(folder: &Folder, text: &str) -> Result<Study, String> {
    Study::from_file(folder.write("studies/probe.toml", text)).map_err(|e| e.to_string())
}

#[test]
fn page_names_the_keys_that_the_parser_accepts() {
    let (page, desk) = (page(), folder());
    for (heading, text) in [
        ("## Tables", "zzz = 1"),
        ("## Values", "[tip]\nx = { zzz = 1 }"),
        ("## `[robot]`", "[robot]\nzzz = 1"),
        ("## `[tip]`", "[tip]\nzzz = 1"),
        ("### `elbow`", "[tip]\nelbow = \"zzz\""),
        ("## `[impact]`", "[impact]\nzzz = 1"),
        ("## `[map]`", "[map]\nzzz = 1"),
        ("## `[advise]`", "[advise]\nzzz = 1"),
    ] {
        let message = read(&desk, text).err().unwrap();
        let (_, names) = message.split_once("expected").unwrap_or_else(|| panic!("{text}\n{message}"));
        let known: BTreeSet<String> = names.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        assert!(!known.is_empty(), "{heading}: {message}");
        assert_eq!(named(&page, heading), known, "{heading}: the page on the left, the parser on the right");
    }
}

/// The quantities are those of the error message about an unknown one: a list separated by commas, at its end.
#[test]
fn page_names_the_quantities_and_classes() {
    let (page, desk) = (page(), folder());
    let study = |name: &str| {
        format!(
            "[robot]\nurdf = \"../robots/planar2.urdf\"\n[tip]\nx = 0.5\ny = 0.1\n[impact]\nnormal = [-1, 0, 0]\n\
             approach_deg = 45\nspeed = 0.2\nlaw = \"energetic\"\nrestitution = 0.3\n[map]\nquantities = [\"{name}\"]\n"
        )
    };
    let message = read(&desk, &study("zzz")).err().unwrap();
    let known: BTreeSet<String> =
        message.split(", ").filter_map(|part| part.split_whitespace().last()).map(str::to_owned).collect();
    let quantities = named(&page, "### `quantities`");
    assert!(quantities.len() > 20);
    assert_eq!(quantities, known, "the page on the left, the parser's message on the right: {message}");
    for quantity in &quantities {
        read(&desk, &study(quantity)).unwrap();
    }
    assert_eq!(named(&page, "### `class`"), CLASSES.map(str::to_owned).into_iter().collect());
}

#[test]
fn examples_of_the_page_are_studies() {
    let (page, desk) = (page(), folder());
    let mut parsed = 0;
    for block in page.split("```toml\n").skip(1) {
        let text = block.split("```").next().unwrap();
        let study = read(&desk, text).unwrap_or_else(|e| panic!("{text}\n{e}"));
        assert!(study.rows() > 1);
        parsed += 1;
    }
    assert_eq!(parsed, 2);
}

//! The book's page on scene files names every key and every value that the parser accepts, and no other.
#![cfg(unix)]

use carom_impact::{Damping, LAW_NAMES, NormalForce};
use carom_sim::{ContactMode, Scene, SeveralLaw};
use carom_testing::files::{self, Folder};
use std::collections::BTreeSet;
use std::path::Path;

fn named(page: &str, heading: &str) -> BTreeSet<String> {
    files::named(page, heading).into_iter().collect()
}

fn page() -> String {
    files::page("reference-scene.md")
}

/// A folder beside a link to the presets, in which scenes can be written as in `scenes/`.
fn folder() -> Folder {
    let desk = Folder::new();
    std::fs::create_dir_all(desk.join("scenes")).unwrap();
    desk.link(&["robots"]);
    desk
}

/// The names that the parser would accept in place of `zzz`.
fn expected(folder: &Path, text: &str) -> BTreeSet<String> {
    let file = folder.join("scenes/probe.toml");
    std::fs::write(&file, text).unwrap();
    let message = Scene::from_file(&file).unwrap_err().to_string();
    // the reader of TOML says it in its own words for the tables of an enumeration
    if let Some((_, names)) = message.split_once("available keys: ") {
        return names.split(", ").map(str::to_owned).collect();
    }
    let (_, names) = message.split_once("expected").unwrap_or_else(|| panic!("{text}\n{message}"));
    names.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn page_names_the_keys_and_values_that_the_parser_accepts() {
    let (page, desk) = (page(), folder());
    let robot = "[robot]\nurdf = \"x\"\nq = [0]\n";
    for (heading, text) in [
        ("## Tables", "zzz = 1".to_owned()),
        ("## `[robot]`", "[robot]\nzzz = 1".to_owned()),
        ("## `[[robot]]`", "[[robot]]\nzzz = 1".to_owned()),
        ("### `tip_velocity`", format!("{robot}tip_velocity = {{ zzz = 1 }}")),
        ("## `[[surface]]`", "[[surface]]\nzzz = 1".to_owned()),
        ("### `shape`", "[[surface]]\nshape = { zzz = {} }".to_owned()),
        ("### `halfspace`", "[[surface]]\nshape = { halfspace = { zzz = 1 } }".to_owned()),
        ("### `box`", "[[surface]]\nshape = { box = { zzz = 1 } }".to_owned()),
        ("### `sphere`", "[[surface]]\nshape = { sphere = { zzz = 1 } }".to_owned()),
        ("### `cylinder`", "[[surface]]\nshape = { cylinder = { zzz = 1 } }".to_owned()),
        ("### `capsule`", "[[surface]]\nshape = { capsule = { zzz = 1 } }".to_owned()),
        ("### `belt`", "[[surface]]\nbelt = { zzz = 1 }".to_owned()),
        ("## `[[spring]]`", "[[spring]]\nzzz = 1".to_owned()),
        ("## `[[force]]`", "[[force]]\nzzz = 1".to_owned()),
        ("## `[[loop]]`", "[[loop]]\nzzz = 1".to_owned()),
        ("### Frame of a loop", "[[loop]]\nfirst = { zzz = 1 }".to_owned()),
        ("### `joint` of a loop", "[[loop]]\njoint = \"zzz\"".to_owned()),
        ("### `axes`", "[[force]]\naxes = \"zzz\"".to_owned()),
        ("### `perturb`", "[run]\nperturb = { zzz = 1 }".to_owned()),
        ("### `distribution`", "[run]\nperturb = { distribution = \"zzz\" }".to_owned()),
        ("### `mesh`", "[[surface]]\nshape = { mesh = { zzz = 1 } }".to_owned()),
        ("### `contact` of a surface", "[[surface]]\ncontact = { zzz = 1 }".to_owned()),
        ("### `motion`", "[[surface]]\nmotion = { zzz = 1 }".to_owned()),
        ("## `[contact]`", "[contact]\nzzz = 1".to_owned()),
        ("### `compliance`", "[contact]\ncompliance = { zzz = 1 }".to_owned()),
        ("### `bristle`", "[contact]\ncompliance = { bristle = { zzz = 1 } }".to_owned()),
        ("### `several`", "[contact]\nseveral = \"zzz\"".to_owned()),
        ("## `[[contact.pair]]`", "[[contact.pair]]\nzzz = 1".to_owned()),
        ("## `[run]`", "[run]\nzzz = 1".to_owned()),
        ("### `method`", "[run]\nmethod = \"zzz\"".to_owned()),
        ("### `model`", "[run]\nmodel = \"zzz\"".to_owned()),
        ("### `controller`", "[run]\ncontroller = \"zzz\"".to_owned()),
    ] {
        let known = expected(&desk, &text);
        assert!(known.len() > 1, "{heading}: {known:?}");
        assert_eq!(named(&page, heading), known, "{heading}: the page on the left, the parser on the right");
    }
}

#[test]
fn page_names_the_laws_forces_and_damping_formulas() {
    let page = page();
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(named(&page, "### `law`"), set(&LAW_NAMES));
    assert_eq!(named(&page, "### `force`"), set(&NormalForce::NAMES));
    assert_eq!(named(&page, "### `damping`"), set(&Damping::ALL.map(Damping::name)));
    assert_eq!(named(&page, "### `several`"), set(&SeveralLaw::ALL.map(SeveralLaw::name)));
}

/// In the answer of `carom simulate`.
#[test]
fn page_names_the_modes_of_a_run() {
    let page = files::page("reference-cli.md");
    let row =
        page.lines().find(|line| line.starts_with("| `mode` |") && line.contains("`free`")).expect("a row of the mode");
    let (touch, damping) = (0, 0.0);
    let modes = [
        ContactMode::Free,
        ContactMode::Sliding { touch },
        ContactMode::Sticking { touch },
        ContactMode::Latched { touch },
        ContactMode::Pressing { touch, damping },
        ContactMode::Several,
        ContactMode::Stepping,
    ];
    assert_eq!(row.split('`').skip(3).step_by(2).collect::<Vec<_>>(), modes.map(ContactMode::name));
}

#[test]
fn examples_of_the_page_parse_and_can_be_planned() {
    let (page, desk) = (page(), folder());
    let mut parsed = 0;
    for block in page.split("```toml\n").skip(1) {
        let text = block.split("```").next().unwrap();
        let file = desk.join("scenes/example.toml");
        std::fs::write(&file, text).unwrap();
        let scene = Scene::from_file(&file).unwrap_or_else(|e| panic!("{text}\n{e}"));
        scene.plan().unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        parsed += 1;
    }
    assert_eq!(parsed, 3);
}

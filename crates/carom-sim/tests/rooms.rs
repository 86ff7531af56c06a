//! The folders of this crate import in one direction, and ARCHITECTURE.md names files that exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{read_dir, read_to_string};
use std::path::Path;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const SRC: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src");
/// The order at the head of `lib.rs`: a folder uses only those before it.
const ROOMS: [&str; 8] = ["state", "contact", "impact", "model", "scene", "motion", "plan", "run"];

/// The modules that a file imports by `use <from>::…`, or names by this path elsewhere.
fn named<'t>(text: &'t str, from: &'t str) -> impl Iterator<Item = &'t str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let paths = code.flat_map(move |line| line.split(from).skip(1));
    paths
        .filter_map(|path| path.split(|c: char| !(c.is_lowercase() || c == '_')).next())
        .filter(|name| !name.is_empty())
}

#[test]
fn folders_import_in_one_direction_and_files_without_rings() {
    for (k, room) in ROOMS.iter().enumerate() {
        let mut imports: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for file in read_dir(Path::new(SRC).join(room)).unwrap() {
            let path = file.unwrap().path();
            let text = read_to_string(&path).unwrap();
            for other in named(&text, "crate::") {
                assert!(!ROOMS[k + 1..].contains(&other), "{} imports from {other}", path.display());
            }
            let module = path.file_stem().unwrap().to_str().unwrap().to_owned();
            let beside =
                named(&text, "super::").filter(|name| Path::new(SRC).join(room).join(format!("{name}.rs")).exists());
            imports.insert(module, beside.map(str::to_owned).collect());
        }
        // Files that import none of those that are left are removed, until none is left or all are in a ring.
        while !imports.is_empty() {
            let left: BTreeSet<String> = imports.keys().cloned().collect();
            imports.retain(|_, others| others.iter().any(|other| left.contains(other)));
            assert!(imports.len() < left.len(), "the files of {room}/ import one another in a ring: {left:?}");
        }
    }
    let lib = read_to_string(Path::new(SRC).join("lib.rs")).unwrap();
    let places: Vec<Option<usize>> = ROOMS.iter().map(|room| lib.find(&format!("//! | `{room}` |"))).collect();
    assert!(places.is_sorted() && places[0].is_some(), "the table in lib.rs has another order");
}

#[test]
fn files_named_in_the_architecture_exist_and_its_walks_are_short() {
    let page = read_to_string(Path::new(ROOT).join("ARCHITECTURE.md")).unwrap();
    let mut walk = Vec::new();
    for line in page.lines() {
        let inside =
            line.split('`').skip(1).step_by(2).filter(|name| name.starts_with("carom-") && name.contains("/src/"));
        for name in inside {
            let path = Path::new(ROOT).join("crates").join(name);
            assert!(path.exists(), "{name} does not exist");
            let Some((number, _)) = line.split_once(". `") else { continue };
            let Ok(number) = number.parse::<usize>() else { continue };
            if number == 1 {
                walk.clear();
            }
            assert!(!walk.contains(&name) && number == walk.len() + 1 && number <= 24, "{line}");
            let lines = read_to_string(path).unwrap().lines().count();
            assert!(lines <= 500, "{name} has {lines} lines");
            walk.push(name);
        }
    }
    assert!(!walk.is_empty());
}

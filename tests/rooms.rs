//! The structure of the sources: no three files of a crate import one another in a circle, the folders of `carom-sim`
//! import in one direction, and ARCHITECTURE.md names files that exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{read_dir, read_to_string};
use std::path::Path;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// The order at the head of carom-sim's `lib.rs`: a folder uses only those before it.
const ROOMS: [&str; 8] = ["state", "contact", "impact", "model", "scene", "motion", "plan", "run"];

/// A path of modules and names from the root of a crate.
type Names = Vec<String>;

/// A file of a crate: the items that it defines, and the paths that it names.
#[derive(Default)]
struct File {
    defined: BTreeSet<String>,
    /// The name in this file and the path of each `use` declaration.
    imports: BTreeMap<String, Names>,
    /// The paths of `use …::*`.
    globs: Vec<Names>,
    /// Every path in the code, and whether it is one that the file re-exports (`pub use`): a list of contents, no import.
    named: Vec<(Names, bool)>,
}

/// One file uses a name that another file defines.
struct Arrow {
    from: Names,
    to: Names,
    name: String,
    reexported: bool,
}

/// Words and signs of Rust code, `::` as one sign, without comments and literals.
fn tokens(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let at = |k: usize| chars.get(k).copied().unwrap_or('\0');
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let (mut k, mut found) = (0, Vec::new());
    while k < chars.len() {
        let start = k;
        let raw = if at(k) == 'r' { chars[k + 1..].iter().take_while(|c| **c == '#').count() } else { 0 };
        if at(k) == '/' && at(k + 1) == '/' {
            while k < chars.len() && at(k) != '\n' {
                k += 1;
            }
        } else if at(k) == '/' && at(k + 1) == '*' {
            while k < chars.len() && !(at(k) == '*' && at(k + 1) == '/' && k > start + 1) {
                k += 1;
            }
            k += 2;
        } else if at(k) == 'r' && at(k + raw + 1) == '"' {
            k += raw + 2;
            while k < chars.len() && !(at(k) == '"' && (1..=raw).all(|j| at(k + j) == '#')) {
                k += 1;
            }
            k += raw + 1;
        } else if at(k) == '"' || (at(k) == '\'' && (at(k + 1) == '\\' || at(k + 2) == '\'')) {
            k += 1;
            while k < chars.len() && at(k) != at(start) {
                k += if at(k) == '\\' { 2 } else { 1 };
            }
            k += 1;
        } else if word(at(k)) || (at(k) == '\'' && word(at(k + 1))) {
            k += 1;
            while word(at(k)) {
                k += 1;
            }
            // A lifetime is no word.
            if at(start) != '\'' {
                found.push(chars[start..k].iter().collect());
            }
        } else {
            k += if at(k) == ':' && at(k + 1) == ':' { 2 } else { 1 };
            if !at(start).is_whitespace() {
                found.push(chars[start..k].iter().collect());
            }
        }
    }
    found
}

/// The tokens without the items under `#[cfg(test)]`, and the modules among these that are files.
fn without_tests(all: &[String]) -> (Vec<&str>, Vec<&str>) {
    let (mut kept, mut modules, mut k) = (Vec::new(), Vec::new(), 0);
    while k < all.len() {
        if !all[k..].iter().take(7).eq(["#", "[", "cfg", "(", "test", ")", "]"]) {
            kept.push(all[k].as_str());
            k += 1;
            continue;
        }
        let (start, mut depth) = (k + 7, 0);
        k = start;
        while k < all.len() {
            depth += i32::from(all[k] == "{") - i32::from(all[k] == "}");
            k += 1;
            if depth == 0 && [";", "}"].contains(&all[k - 1].as_str()) {
                break;
            }
        }
        if all[start] == "mod" && all[k - 1] == ";" {
            modules.push(all[start + 1].as_str());
        }
    }
    (kept, modules)
}

/// The path of `names` as it is read in `module`: from the root of the crate, if it begins at a word for a module.
fn absolute(module: &[String], names: &[String]) -> Names {
    let (mut path, mut rest) = (module.to_vec(), names);
    while let Some(first) = rest.first() {
        match first.as_str() {
            "crate" => path.clear(),
            "super" => drop(path.pop()),
            "self" => {}
            _ => break,
        }
        rest = &rest[1..];
    }
    path.extend_from_slice(rest);
    path
}

/// The words of a path at the head of `code`.
fn path_at(code: &[&str]) -> Names {
    let mut path = Vec::new();
    for (k, token) in code.iter().enumerate() {
        let word = token.starts_with(|c: char| c.is_alphabetic() || c == '_');
        match k % 2 {
            0 if word => path.push((*token).to_owned()),
            1 if *token == "::" => {}
            _ => break,
        }
    }
    path
}

impl File {
    /// Reads one tree of a `use` declaration and returns the number of its tokens.
    fn tree(&mut self, module: &[String], before: &[String], code: &[&str], reexported: bool) -> usize {
        let path = path_at(code);
        let mut k = (2 * path.len()).saturating_sub(1);
        let mut names = [before, &path].concat();
        if code[k] == "::" {
            k += 1;
        }
        if code[k] == "{" {
            k += 1;
            while code[k] != "}" {
                k += if code[k] == "," { 1 } else { self.tree(module, &names, &code[k..], reexported) };
            }
            return k + 1;
        }
        if code[k] == "*" {
            self.globs.push(absolute(module, &names));
            names.push("*".into());
            self.named.push((absolute(module, &names), reexported));
            return k + 1;
        }
        if names.last().is_some_and(|name| name == "self") && names.len() > 1 {
            names.pop();
        }
        let mut name = names.last().unwrap().clone();
        if code[k] == "as" {
            name = code[k + 1].into();
            k += 2;
        }
        self.named.push((absolute(module, &names), reexported));
        self.imports.insert(name, absolute(module, &names));
        k
    }

    /// Reads the code of the file of `module`.
    fn read(code: &[&str], module: &[String]) -> Self {
        let mut file = Self::default();
        let (mut depth, mut k) = (0, 0);
        // Modules in braces, with the depth at which they end.
        let mut inner: Vec<(i32, &str)> = Vec::new();
        while k < code.len() {
            depth += i32::from(code[k] == "{") - i32::from(code[k] == "}");
            inner.retain(|(end, _)| *end <= depth);
            let place = || -> Names {
                module.iter().cloned().chain(inner.iter().map(|(_, name)| (*name).to_owned())).collect()
            };
            let next = code.get(k + 1).copied().unwrap_or("");
            let before = if k == 0 { "" } else { code[k - 1] };
            if code[k] == "use" && next != "<" {
                let public = before == "pub" || (before == ")" && code[..k].iter().rev().nth(3) == Some(&"pub"));
                k += 1 + file.tree(&place(), &[], &code[k + 1..], public);
            } else if ["fn", "struct", "enum", "union", "trait", "type", "const", "static", "mod"].contains(&code[k]) {
                if depth == inner.len() as i32 {
                    file.defined.insert(next.into());
                }
                if code[k] == "mod" && code.get(k + 2) == Some(&"{") {
                    inner.push((depth + 1, next));
                    depth += 1;
                    k += 1;
                }
                k += if next == "fn" { 1 } else { 2 };
            } else if code[k] == "macro_rules" {
                file.defined.insert(code[k + 2].into());
                k += 3;
            } else {
                // Not what follows a dot: fields and methods.
                let path = if before == "." { Names::new() } else { path_at(&code[k..]) };
                k += (2 * path.len()).saturating_sub(1).max(1);
                if !path.is_empty() {
                    file.named.push((absolute(&place(), &path), false));
                }
            }
        }
        let again: BTreeSet<&Names> =
            file.named.iter().filter(|(_, reexported)| *reexported).map(|(path, _)| path).collect();
        let names = file.imports.iter().filter(|(_, path)| again.contains(path));
        let names: Vec<Names> = names.map(|(name, _)| absolute(module, std::slice::from_ref(name))).collect();
        for (path, reexported) in &mut file.named {
            *reexported |= names.iter().any(|name| path.starts_with(name));
        }
        file
    }
}

/// The files of a crate by module.
struct Crate(BTreeMap<Names, File>);

impl Crate {
    /// From paths below `src` and texts.
    fn of(texts: &[(String, String)]) -> Self {
        let mut files = BTreeMap::new();
        let mut tests = Vec::new();
        for (path, text) in texts {
            let mut module: Names = path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if module.last().is_some_and(|last| ["lib", "main", "mod"].contains(&last.as_str())) {
                module.pop();
            }
            let all = tokens(text);
            let (code, modules) = without_tests(&all);
            tests.extend(modules.iter().map(|name| absolute(&module, &[(*name).to_owned()])));
            files.insert(module.clone(), File::read(&code, &module));
        }
        files.retain(|module, _| !tests.iter().any(|test| module.starts_with(test)));
        Self(files)
    }

    /// The file that defines what `path` names, through re-exports, with the name; none for modules and for names from
    /// elsewhere.
    fn definition(&self, path: &[String], effort: usize) -> Option<(&Names, String)> {
        let length = (0..=path.len()).rev().find(|length| self.0.contains_key(&path[..*length]))?;
        let (module, file) = self.0.get_key_value(&path[..length]).unwrap();
        let [name, rest @ ..] = &path[length..] else { return None };
        if effort == 0 {
            return None;
        }
        if file.defined.contains(name) || name == "*" {
            return Some((module, name.clone()));
        }
        match file.imports.get(name) {
            Some(import) => self.definition(&[import, rest].concat(), effort - 1),
            None => file
                .globs
                .iter()
                .find_map(|glob| self.definition(&[glob.clone(), vec![name.clone()]].concat(), effort - 1)),
        }
    }

    fn arrows(&self) -> Vec<Arrow> {
        let mut arrows = Vec::new();
        for (from, file) in &self.0 {
            for (path, reexported) in &file.named {
                let found = self.definition(path, 8).filter(|(to, _)| *to != from);
                arrows.extend(found.map(|(to, name)| Arrow {
                    from: from.clone(),
                    to: to.clone(),
                    name,
                    reexported: *reexported,
                }));
            }
        }
        arrows
    }

    /// The largest sets of files of which each uses each, directly or through others, if they have more than `most`
    /// files. Each file is listed with what it uses of the others.
    fn circles(&self, most: usize) -> Vec<String> {
        let mut used: BTreeMap<&Names, BTreeMap<&Names, BTreeSet<&str>>> = BTreeMap::new();
        let arrows = self.arrows();
        for Arrow { from, to, name, .. } in arrows.iter().filter(|arrow| !arrow.reexported) {
            used.entry(from).or_default().entry(to).or_default().insert(name);
        }
        let reached = |start| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![start]);
            while let Some(module) = open.pop() {
                let next = used.get(module).into_iter().flat_map(|uses| uses.keys());
                open.extend(next.filter(|other| seen.insert(**other)));
            }
            seen
        };
        let reach: BTreeMap<&Names, BTreeSet<&Names>> = self.0.keys().map(|module| (module, reached(module))).collect();
        let circle = |module| -> BTreeSet<&Names> {
            reach[module].iter().copied().filter(|other| reach[*other].contains(module)).collect()
        };
        let circles: BTreeSet<BTreeSet<&Names>> =
            self.0.keys().map(circle).filter(|circle| circle.len() > most).collect();
        let told = |circle: &BTreeSet<&Names>| {
            let lines = circle.iter().map(|from| {
                let uses = used[*from].iter().filter(|(to, _)| circle.contains(*to));
                let uses: Vec<_> = uses.map(|(to, names)| format!("{} {names:?}", title(to))).collect();
                format!("  {} uses {}\n", title(from), uses.join(", "))
            });
            format!("{} files:\n{}", circle.len(), lines.collect::<String>())
        };
        circles.iter().map(told).collect()
    }
}

/// The module as it is written in code.
fn title(module: &[String]) -> String {
    if module.is_empty() { "crate".into() } else { module.join("::") }
}

/// The paths below `src` and texts of a crate's files.
fn texts(folder: &Path, below: &str, found: &mut Vec<(String, String)>) {
    for entry in read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{below}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() {
            texts(&path, &format!("{name}/"), found);
        } else if name.ends_with(".rs") {
            found.push((name, read_to_string(&path).unwrap()));
        }
    }
}

fn crate_at(name: &str) -> Crate {
    let mut found = Vec::new();
    texts(&Path::new(ROOT).join("crates").join(name).join("src"), "", &mut found);
    Crate::of(&found)
}

/// Two halves of one idea may use each other, but not in carom-sim, whose files are read in the order of a run.
fn most(name: &str) -> usize {
    if name == "carom-sim" { 1 } else { 2 }
}

#[test]
fn no_three_files_import_one_another_in_a_circle() {
    let mut told = String::new();
    for folder in read_dir(Path::new(ROOT).join("crates")).unwrap() {
        let name = folder.unwrap().file_name().into_string().unwrap();
        for circle in crate_at(&name).circles(most(&name)) {
            told += &format!("{name}: {circle}");
        }
    }
    assert!(told.is_empty(), "files that import one another:\n{told}");
}

#[test]
fn a_circle_is_found_through_groups_reexports_and_paths() {
    let circles = |third: &str| {
        let texts = [
            ("lib.rs", "mod a; mod b; mod part; pub use b::B;"),
            ("a.rs", "use crate::{\n    B,\n    part::{self, mod_free as free},\n};\npub struct A; // crate::none::N"),
            ("b.rs", "pub struct B;\nfn f() -> char { super::part::c::g(\"crate::a::A\"); '\"' }"),
            ("part/mod.rs", "pub mod c;\npub use c::C;\nfn f(c: C) {}\npub fn mod_free() {}"),
            ("part/c.rs", third),
        ];
        Crate::of(&texts.map(|(path, text)| (path.to_owned(), text.to_owned()))).circles(2)
    };
    assert_eq!(circles("pub struct C; pub fn g() {}"), [""; 0]);
    let found = circles("pub struct C; pub fn g(a: &'static super::super::a::A) {}");
    let expected = "3 files:\n  a uses b {\"B\"}\n  b uses part::c {\"g\"}\n  part::c uses a {\"A\"}\n";
    assert_eq!(found, [expected]);
    assert_eq!(circles("pub struct C; pub fn g() {}\n#[cfg(test)]\nmod tests { use crate::a::A; }"), [""; 0]);
}

#[test]
fn folders_of_carom_sim_import_in_one_direction() {
    let place = |module: &Names| ROOMS.iter().position(|room| module.first().is_some_and(|first| first == room));
    for Arrow { from, to, name, .. } in crate_at("carom-sim").arrows() {
        let (Some(user), Some(used)) = (place(&from), place(&to)) else { continue };
        assert!(used <= user, "{} uses {name} of {}", title(&from), title(&to));
    }
    let lib = read_to_string(Path::new(ROOT).join("crates/carom-sim/src/lib.rs")).unwrap();
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

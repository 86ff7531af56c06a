//! What the files of studies have in common; of the problem files of aims and of orbits: the scene with other values of its keys, formulas of its numbers,
//! and derivatives by differences.

use carom_chain::input;
use carom_sim::{Formula, Scene, SimError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Numbers of the scene as functions of names: the path of a key, and its formula.
pub(crate) type Formulas = Vec<(String, Formula)>;

/// What `read` makes of a file, of its text, name and folder, with the file before the other `files`; `refuse` takes its name and a rule.
pub(crate) fn read<T, E>(
    path: &Path,
    refuse: fn(String, String) -> E,
    read: fn(&str, String, &Path) -> Result<T, E>,
    files: fn(&mut T) -> &mut Vec<PathBuf>,
) -> Result<T, E> {
    let name = path.display().to_string();
    let text = input::read_text(path, input::MOST_MIB);
    let text = text.map_err(|e| refuse(name.clone(), format!("cannot be read: {e}")))?;
    let mut found = read(&text, name, path.parent().unwrap_or(Path::new(".")))?;
    files(&mut found).insert(0, path.to_owned());
    Ok(found)
}

/// Why no problem reads these keys of scenes.
const IDLE: &str = "the motions of this problem have no samples and no disturbances: remove it";
pub(crate) const SAMPLE: &str = "run.sample";

/// The scene of a problem in this folder, `with` other values at the paths of keys. `idle`: keys that this kind of problems does not read, and
/// what to do.
pub(crate) fn scene(folder: &Path, scene: &Path, with: &toml::Table, idle: &[(&str, &str)]) -> Result<Scene, SimError> {
    let scene = Scene::from_file(folder.join(scene))?;
    for (own, why) in [(SAMPLE, IDLE), ("run.perturb", IDLE)].iter().chain(idle) {
        if with.keys().any(|key| key.starts_with(*own) || is_within(with, key, own)) {
            let rule = format!("with: {own}: {why}");
            return Err(SimError::Scene { file: scene.files[0].display().to_string(), rule });
        }
    }
    if with.is_empty() {
        return Ok(scene);
    }
    let changed = scene.with_entries(with).map_err(|e| match e {
        SimError::Scene { file, rule } => {
            let name = scene.files[0].display();
            SimError::Scene { file: format!("{name}: with"), rule: format!("{file}: {rule}") }
        }
        other => other,
    })?;
    Ok(Scene { files: scene.files, ..changed })
}

/// Whether the value of a key of `with` has an entry at a path.
fn is_within(with: &toml::Table, key: &str, path: &str) -> bool {
    let parts = path.strip_prefix(key).and_then(|rest| rest.strip_prefix('.'));
    parts.is_some_and(|parts| parts.split('.').try_fold(&with[key], |value, part| value.get(part)).is_some())
}

/// The first of these paths that `with` gives, too: its value there has no effect.
pub(crate) fn given_twice<'p>(with: &toml::Table, mut paths: impl Iterator<Item = &'p String>) -> Option<&'p String> {
    paths.find(|path| with.keys().any(|key| key == *path || is_within(with, key, path)))
}

/// Whether a name is the path of a key.
pub(crate) fn is_path(name: &str) -> bool {
    name.contains(['.', '['])
}

/// Whether a path leads to the start of a scene.
pub(crate) fn is_of_start(path: &str) -> bool {
    let (table, key) = path.split_once('.').unwrap_or((path, ""));
    let key = key.split(['.', '[']).next().unwrap_or_default();
    table.starts_with("robot") && ["q", "qd", "tip_velocity"].contains(&key)
}

/// Reads formulas of these names.
pub(crate) fn formulas(set: &BTreeMap<String, String>, names: &[&str]) -> Result<Formulas, String> {
    let read = set.iter().map(|(key, formula)| {
        let key_of = |why: String| format!("set.\"{key}\" = {why}");
        let read = Formula::of(formula, names).map_err(key_of)?;
        let refuse = |why: String| key_of(format!("\"{formula}\" {why}"));
        match read.names().iter().find(|name| !names.contains(&name.as_str())) {
            Some(name) => Err(refuse(format!("has the variable '{name}': there are {}", names.join(", ")))),
            None if read.names().is_empty() => {
                Err(refuse(format!("does not depend on {}: give the number in with", names.join(", "))))
            }
            None => Ok((key.clone(), read)),
        }
    });
    read.collect()
}

/// The numbers of the scene at values of the names.
pub(crate) fn evaluated(set: &Formulas, names: &[(&str, f64)]) -> Vec<(String, f64)> {
    let of = |formula: &Formula| {
        let value = |name: &String| names.iter().find(|(own, _)| own == name).map_or(f64::NAN, |(_, value)| *value);
        formula.at(&formula.names().iter().map(value).collect::<Vec<f64>>())
    };
    set.iter().map(|(key, formula)| (key.clone(), of(formula))).collect()
}

/// Of the error of [`difference`], h⁴, and that of rounding, ε/h, neither is above 1e-11.
pub(crate) const STEP: f64 = 1e-3;

/// The derivative at 0 of a function of a number of this size: a central difference of fourth order.
pub(crate) fn difference(size: f64, mut at: impl FnMut(f64) -> Result<f64, SimError>) -> Result<f64, SimError> {
    let h = STEP * size;
    Ok(((at(h)? - at(-h)?) * 8.0 - (at(2.0 * h)? - at(-2.0 * h)?)) / (12.0 * h))
}

//! The keys of a scene for a file in another folder.

use carom_sim::Scene;
use std::path::{Component, Path, PathBuf};

/// The keys of a scene, with paths from this folder.
pub(crate) fn keys_in(scene: &Scene, folder: &Path) -> Result<toml::Table, String> {
    let mut keys: toml::Table = scene.text.parse().map_err(|e: toml::de::Error| e.to_string())?;
    if let Some(between) = between(folder, &scene.folder) {
        keys.iter_mut().for_each(|(key, value)| rebase(key, value, &between));
    }
    Ok(keys)
}

/// The keys of a scene whose values are paths.
const PATHS: [&str; 7] = ["urdf", "srdf", "file", "torque_file", "feedback_file", "reference", "package_dirs"];

/// The path from one folder to another; `None` if they are the same or one is not there.
fn between(from: &Path, to: &Path) -> Option<PathBuf> {
    let here = |path: &Path| if path.as_os_str().is_empty() { Path::new(".") } else { path }.canonicalize();
    let (from, to) = (here(from).ok()?, here(to).ok()?);
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(to.components().skip(common)).collect();
    Some(path).filter(|path| !path.as_os_str().is_empty())
}

/// Changes relative paths to those from a folder from which theirs is reached by `between`.
fn rebase(key: &str, value: &mut toml::Value, between: &Path) {
    match value {
        toml::Value::String(path) if PATHS.contains(&key) && !path.contains("://") && Path::new(path).is_relative() => {
            let mut whole = PathBuf::new();
            for part in between.join(&*path).components() {
                let ends_in_name = matches!(whole.components().next_back(), Some(Component::Normal(_)));
                if part == Component::ParentDir && ends_in_name {
                    whole.pop();
                } else {
                    whole.push(part);
                }
            }
            *path = whole.to_string_lossy().into_owned();
        }
        toml::Value::Array(all) => all.iter_mut().for_each(|value| rebase(key, value, between)),
        toml::Value::Table(all) => all.iter_mut().for_each(|(key, value)| rebase(key, value, between)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each key of a scene whose value is a path, or a list of paths, is changed with the folder: those that the page of scene files lists.
    #[test]
    fn all_paths_of_a_scene_move_with_its_file() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../book/src/reference-scene.md");
        let page = std::fs::read_to_string(page).unwrap();
        let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` | "));
        let paths: Vec<&str> = rows
            .filter(|(_, rest)| rest.starts_with("path |") || rest.starts_with("list of paths |"))
            .map(|(key, _)| key)
            .collect();
        assert!(paths.len() > 8 && paths.iter().all(|key| PATHS.contains(key)), "{paths:?}");
        let mut value = toml::Value::String("../robots/arm.urdf".into());
        rebase("urdf", &mut value, Path::new("../own/scenes"));
        assert_eq!(value.as_str(), Some("../own/robots/arm.urdf"));
        let mut other = toml::Value::String("arm".into());
        rebase("name", &mut other, Path::new("../own/scenes"));
        assert_eq!(other.as_str(), Some("arm"));
    }
}

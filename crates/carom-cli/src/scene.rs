//! Reading of scenes.

use crate::error::CliError;
use crate::input::tell;
use crate::output::warn;
use carom_sim::Scene;
use std::path::Path;

/// Reads a scene and prints its warnings.
pub fn load(file: &Path) -> Result<Scene, CliError> {
    let scene = Scene::from_file(file).map_err(|e| CliError::scene(file, e))?;
    let chain = &scene.simulation.chain;
    let mut urdfs = scene.files.iter().filter(|file| file.extension().is_some_and(|it| it == "urdf"));
    let robot = match (urdfs.next(), urdfs.next()) {
        (Some(urdf), None) => urdf.display().to_string(),
        _ => format!("robot '{}'", chain.name()),
    };
    tell(&format!("{}: {robot}", file.display()), chain);
    warn(file, &scene.warnings);
    Ok(scene)
}

//! Reading of scenes.

use crate::error::CliError;
use crate::input::tell;
use crate::output::say;
use carom_sim::Scene;
use std::path::Path;

/// Reads a scene and prints its warnings.
pub fn load(file: &Path) -> Result<Scene, CliError> {
    let scene = Scene::from_file(file).map_err(|e| CliError::scene(file, e))?;
    let chain = &scene.simulation.chain;
    tell(&format!("{}: robot '{}'", file.display(), chain.name()), chain);
    for warning in &scene.warnings {
        say(&format!("warning: {}: {warning}", file.display()));
    }
    Ok(scene)
}

//! Scenes as commands get them.

use crate::error::CliError;
use crate::output::say;
use carom_sim::Scene;
use std::path::Path;

/// Reads a scene, and says what looks odd in it.
pub fn load(file: &Path) -> Result<Scene, CliError> {
    let scene = Scene::from_file(file).map_err(|e| CliError::scene(file, e))?;
    for warning in &scene.warnings {
        say(&format!("warning: {}: {warning}", file.display()));
    }
    Ok(scene)
}

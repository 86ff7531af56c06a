//! Scenes and their whole runs.

use crate::border::c_text;
use crate::error::{Fault, Status};
use carom_sim::{NamedRun, Sampling, Seen, to_json};
use std::ffi::{CString, c_char};
use std::ptr;

/// A scene file with its robots, read; it does not change. Any number of threads may use one at the same time.
pub struct Scene {
    pub(crate) scene: carom_sim::Scene,
    warnings: CString,
}

/// Reads a scene (a TOML file: the page "Scene keys" of the book), its robots and their meshes; freed by carom_scene_free. Refused
/// input: a file that cannot be read or breaks a rule; the message names file, key, value and rule.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_scene_load(path: *const c_char, scene: *mut *mut Scene) -> Status {
    call!(carom_scene_load, |text path, created scene| {
        let loaded = carom_sim::Scene::from_file(path)?;
        let report = loaded.simulation.chain.report();
        let repairs = report.repairs.iter().map(ToString::to_string);
        let told = report.warnings.iter().cloned().chain(repairs).chain(loaded.warnings.iter().cloned());
        let warnings = c_text(&told.collect::<Vec<_>>().join("\n"));
        scene.give(Scene { scene: loaded, warnings });
        Ok(())
    })
}

/// Frees a scene; nothing for NULL. Its sessions stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_scene_free(scene: *mut Scene) {
    free!(carom_scene_free, free scene);
}

/// What is odd in the scene and its robots: one sentence a line, UTF-8; an empty text if there is nothing. Valid until the scene is freed.
/// NULL for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_scene_warnings(scene: *const Scene) -> *const c_char {
    call!(carom_scene_warnings or ptr::null(), |shared scene| Ok(scene.warnings.as_ptr()))
}

/// Runs the scene for its duration. `json` becomes the line that `carom simulate --json` prints: joints, stop_reason, mode, events, final,
/// energy, statistics. `warnings` becomes what is to be told of the results, one sentence a line; often an empty text. Both are UTF-8
/// and freed by carom_text_free. Refused physics: an overlap at the start, a motion that cannot be continued.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_scene_summary_json(
    scene: *const Scene,
    json: *mut *mut c_char,
    warnings: *mut *mut c_char,
) -> Status {
    call!(carom_scene_summary_json, |shared scene, created json, created warnings| {
        let plan = scene.scene.plan()?;
        let mut events = Vec::new();
        let watch = &mut |seen: Seen| {
            if let Seen::Event(event) = seen {
                events.push(event.clone());
            }
        };
        let run = plan.stream(scene.scene.duration, Sampling::default(), watch)?;
        let text = line(&run.named(&plan.simulation, &events))?;
        json.give_text(&text);
        warnings.give_text(&run.warnings().join("\n"));
        Ok(())
    })
}

/// Frees a text of carom_scene_summary_json; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_text_free(text: *mut c_char) {
    free!(carom_text_free, free_text text);
}

/// The line of JSON of a run, as the command line writes it.
fn line(run: &NamedRun) -> Result<String, Fault> {
    let text = to_json(run).unwrap_or_default();
    // serde_json writes null for numbers that are not finite; nothing else of a run is null.
    if text.contains("null") || text.is_empty() {
        let why =
            "a number of the result is not finite: the numbers of this scene are too large, or too small, for f64";
        return Err(Fault::physics(why.into()));
    }
    Ok(text)
}

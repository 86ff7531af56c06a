//! The scene file of what was found.

use super::torque::names_of_motors;
use super::{AimError, Found, Problem};
use crate::moved_scene::keys_in;
use std::path::Path;

impl Problem {
    /// The text of a scene file with what was found, for a file in this folder, and with `[torque]` the table of the torques (CSV), to which
    /// the scene gives this name.
    ///
    /// # Errors
    /// [`AimError`] of the scene.
    pub fn scene_of(&self, found: &Found, folder: &Path, torques: &str) -> Result<(String, Option<String>), AimError> {
        let u = found.values();
        let scene = self.given.scene_at(&u)?;
        let unread = |e: String| AimError::File { file: "the scene that is written".into(), rule: e };
        let mut keys = keys_in(&scene, folder).map_err(unread)?;
        let run = keys.get_mut("run").and_then(toml::Value::as_table_mut);
        let table = match (&self.given.torque, run) {
            (Some(torque), Some(run)) => {
                run.insert("controller".into(), "torque-file".into());
                run.insert("torque_file".into(), torques.into());
                let joints = names_of_motors(&scene);
                let mut table = format!("time,{}\n", joints.join(","));
                for (time, forces) in torque.rows(&u[self.given.unknowns.len()..], scene.duration) {
                    let own = joints.iter().map(|joint| {
                        let k = torque.joints.iter().position(|own| own == joint);
                        k.map_or("0".to_owned(), |k| forces[k].to_string())
                    });
                    table += &format!("{time},{}\n", own.collect::<Vec<_>>().join(","));
                }
                Some(table)
            }
            _ => None,
        };
        Ok((toml::to_string(&keys).map_err(|e| unread(e.to_string()))?, table))
    }
}

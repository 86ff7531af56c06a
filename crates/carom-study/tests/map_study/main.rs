//! Impact maps from study files: each row agrees with a single impact and does not depend on other rows (`rows`); files do
//! not depend on threads, interruptions and shards (`files`).

mod files;
mod rows;

use carom_study::Study;
use std::path::{Path, PathBuf};

fn robot(name: &str) -> String {
    format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"))
}

/// Writes the file of a study of a robot: `poses` is the table of poses, `impact` the keys of `[impact]`.
fn study_in(folder: &Path, name: &str, robot_name: &str, poses: &str, impact: &str, quantities: &str) -> PathBuf {
    let text = format!(
        "[robot]\nurdf = \"{}\"\n{poses}\n[impact]\n{impact}\n[map]\nquantities = [{quantities}]\n",
        robot(robot_name)
    );
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    path
}

fn study(robot_name: &str, poses: &str, impact: &str, quantities: &str) -> Study {
    let folder = tempfile::tempdir().unwrap();
    Study::from_file(study_in(folder.path(), "study", robot_name, poses, impact, quantities)).unwrap()
}

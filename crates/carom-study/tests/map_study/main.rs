//! Impact maps from a study file: each row is the impact that it says it is and depends on no other (`rows`), and the files
//! that hold the rows are the same however they were written (`files`).

mod files;
mod rows;

use carom_study::Study;
use std::path::{Path, PathBuf};

fn robot(name: &str) -> String {
    format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"))
}

/// A study of `poses` and `impact` of a robot, asking for everything that a single impact tells.
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

//! Impact maps from study files: each row agrees with a single impact and does not depend on other rows (`rows`), the tip is at its target
//! (`poses`), and files do not depend on threads, interruptions and shards (`files`).

mod files;
mod poses;
mod rows;

use carom_study::NumberedRows;
use carom_study::map_study::Study;
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

/// Why a study of a robot is refused.
fn refused(robot_name: &str, poses: &str, impact: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = study_in(folder.path(), "study", robot_name, poses, impact, "\"impulse\"");
    Study::from_file(file).err().unwrap().to_string()
}

/// The text of a study file gives the rows of the file; its name in messages is `<study>`.
#[test]
fn a_study_from_text_is_that_of_its_file() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../studies");
    let path = format!("{folder}/self_motion.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let (file, own) = (Study::from_file(&path).unwrap(), Study::from_toml(&text, folder).unwrap());
    assert_eq!((file.columns(), file.rows()), (own.columns(), own.rows()));
    assert_eq!((&file.files[0], &file.files[1..]), (&PathBuf::from(path), &own.files[..]));
    let row = |study: &Study, index| {
        let mut out = vec![0.0; study.columns().len()];
        study.evaluator().row(index, &mut out);
        out.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    assert!((0..file.rows()).all(|index| row(&file, index) == row(&own, index)));
    let refused = Study::from_toml("[robot]\nurdf = 3", folder).err().unwrap().to_string();
    assert!(refused.starts_with("<study>: line 2, urdf = 3: "), "{refused}");
}

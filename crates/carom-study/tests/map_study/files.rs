//! Files of impact maps: their bytes do not depend on threads, interruptions or shards.

use crate::map_study::study_in;
use carom_study::map_study::Study;
use carom_study::{NumberedRows, RowFile, RowsError, Written};
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A map of 20 008 rows, which are computed in many small blocks.
fn small(folder: &Path) -> Study {
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = [30, 60]\nspeed = 0.2\nlaw = [\"energetic\", \"newton\"]\nrestitution = 0.35\nfriction = 0.1";
    let poses = "[tip]\nx = { from = -0.9, to = 0.9, count = 61 }\ny = { from = -0.9, to = 0.9, count = 41 }";
    let quantities = "\"tangential_jump\", \"impulse\", \"limit_joint\", \"flags\"";
    Study::from_file(study_in(folder, "small", "planar2", poses, impact, quantities)).unwrap()
}

fn write(study: &Study, path: &Path, rows: std::ops::Range<u64>, threads: usize) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let file = RowFile { path: path.to_owned(), rows, resume: false };
    let done = AtomicU64::new(0);
    let count = |rows| {
        done.fetch_add(rows, Ordering::Relaxed);
    };
    let written = pool.install(|| study.write(&file, &count, &AtomicBool::new(false))).unwrap();
    assert_eq!(written, Written::Whole);
    assert_eq!(done.into_inner(), file.rows.end - file.rows.start);
    std::fs::read(path).unwrap()
}

/// Starts or resumes a run and stops it once more than `after` rows are computed. Returns the number of rows and the partial
/// table.
fn interrupted(study: &Study, file: &RowFile, after: u64) -> (u64, PathBuf) {
    let (stop, done) = (AtomicBool::new(false), AtomicU64::new(0));
    let count = |rows| {
        stop.fetch_or(done.fetch_add(rows, Ordering::Relaxed) + rows > after, Ordering::Relaxed);
    };
    let Written::Interrupted { rows, partial } = study.write(file, &count, &stop).unwrap() else {
        panic!("the run was not interrupted");
    };
    (rows, partial)
}

/// A study refuses numbers of links and joints that its robot does not have, and invalid ones, with file and key.
#[test]
fn numbers_of_links_and_joints_are_refused_with_file_and_key() {
    let folder = tempfile::tempdir().unwrap();
    for (given, rule) in [
        ("mass = { foo = 1 }", "[robot] mass: no link is named 'foo'; "),
        ("mass = { link1 = -1 }", "[robot] mass of link1 is -1: it must be positive and finite"),
        ("inertia = { foo = [1, 0, 0, 1, 0, 1] }", "[robot] inertia: no link is named 'foo'; "),
        ("rotor_inertia = { foo = 1 }", "[robot] rotor_inertia: no joint is named 'foo'; "),
    ] {
        let poses = format!("{given}\n[joints]\nshoulder = 0.3\nelbow = 0.4");
        let impact = "normal = [-1, 0, 0]\napproach_deg = 90\nspeed = 0.2\nlaw = \"newton\"\nrestitution = 0.3";
        let file = study_in(folder.path(), "s", "planar2", &poses, impact, "\"impulse\"");
        let said = Study::from_file(&file).err().unwrap().to_string();
        assert!(said.starts_with(&format!("{}: {rule}", file.display())), "{said}");
    }
}

/// A robot whose last link has no mass, and an unknown attribute.
#[test]
fn studies_repair_robots_refuse_those_without_dynamics_and_can_be_strict() {
    let folder = tempfile::tempdir().unwrap();
    let inertial = "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name='{name}' type='continuous'><parent link='{parent}'/><child link='{child}'/>\
             <origin xyz='1 0 0'/><axis xyz='0 0 1'/></joint>"
        )
    };
    let joints = joint("j", "a", "b") + &joint("k", "b", "tip");
    let text = format!(
        "<robot name='r'><link name='a' x='1'/><link name='b'>{inertial}</link><link name='tip'/>{joints}</robot>"
    );
    std::fs::write(folder.path().join("r.urdf"), text).unwrap();
    let study = |keys: &str| {
        let file = folder.path().join("study.toml");
        let impact =
            "[impact]\nnormal = [-1, 0, 0]\napproach_deg = 90\nspeed = 0.2\nlaw = \"newton\"\nrestitution = 0.3";
        let text = format!(
            "[robot]\nurdf = \"r.urdf\"\n{keys}\n[joints]\nj = [1.0, 1.1]\n{impact}\n[map]\nquantities = [\"impulse\"]\n"
        );
        std::fs::write(&file, text).unwrap();
        Study::from_file(file)
    };
    let error = study("").err().unwrap().to_string();
    assert!(
        error.contains("[robot] urdf: 'r' has no dynamics, because nothing that these links carry has mass: 'tip'."),
        "{error}"
    );
    let repaired = study("repair = true\npackage_dirs = [\"..\"]").unwrap();
    let warnings = [
        "repaired: joint 'k' is fixed at 0: link 'tip' has no mass and is welded to link 'b'",
        "<link x> (line 1) is not used: it is unknown",
    ];
    let urdf = folder.path().join("r.urdf");
    let warnings = warnings.map(|warning| format!("{}: {warning}", urdf.display()));
    assert_eq!((repaired.rows(), &repaired.warnings[..]), (2, &warnings[..]));
    let error = study("repair = true\nstrict = true").err().unwrap().to_string();
    assert!(error.contains("r.urdf:1: <link x>: is not used: it is unknown: correct it"), "{error}");
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let study = small(folder.path());
    for name in ["map.csv", "map.parquet"] {
        let path = folder.path().join(name);
        let one = write(&study, &path, 0..study.rows(), 1);
        assert!(one.len() > 100_000);
        for threads in [2, 5] {
            assert!(one == write(&study, &path, 0..study.rows(), threads), "{name} by {threads} threads");
        }
    }
}

/// A map of several Parquet row groups that is interrupted and resumed has the bytes of an uninterrupted one; the complete groups are copied as
/// bytes. The partial table is a table of the rows so far, under a name of its own.
#[test]
fn an_interrupted_map_is_resumed_to_the_same_bytes() {
    let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let impact = "normal = [-1, 0, 0]\nalong = [0, -1, 0]\napproach_deg = 45\nspeed = 0.2\nlaw = \"energetic\"\nrestitution = 0.35\nfriction = 0.1";
    let poses = "[joints]\nshoulder = { from = -3, to = 3, count = 350 }\nelbow = { from = -3, to = 3, count = 500 }";
    let quantities = "\"impulse\", \"limit_joint\", \"flags\"";
    let study = Study::from_file(study_in(folder.path(), "groups", "planar2", poses, impact, quantities)).unwrap();
    for ending in ["csv", "parquet"] {
        let name = format!("map.{ending}");
        let whole = write(&study, &folder.path().join(&name), 0..study.rows(), 2);
        let path = folder.path().join(format!("again.{ending}"));
        let mut file = RowFile { path: path.clone(), rows: 0..study.rows(), resume: false };
        let mut last = 0;
        for after in [1000, 70_000, 140_000] {
            let (rows, partial) = interrupted(&study, &file, after);
            assert!(rows > last && rows < study.rows(), "{rows} rows after {last}");
            assert!(!path.exists());
            assert_eq!(partial, folder.path().join(format!("again.partial.{ending}")));
            let so_far = write(&study, &other.path().join(&name), 0..rows, 1);
            assert!(std::fs::read(&partial).unwrap() == so_far, "{name}: {rows} rows");
            last = rows;
            file.resume = true;
        }
        if ending == "parquet" {
            let left = SerializedFileReader::new(std::fs::File::open(file.partial()).unwrap()).unwrap();
            let groups: Vec<i64> = left.metadata().row_groups().iter().map(|group| group.num_rows()).collect();
            assert!(groups[0] == 65536 && groups.len() > 1, "{groups:?}");
        }
        assert_eq!(study.write(&file, &|_| (), &AtomicBool::new(false)).unwrap(), Written::Whole);
        assert!(std::fs::read(&path).unwrap() == whole, "{name}");
        assert!(!file.partial().exists(), "the partial table is removed");
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 5, "{left:?}");
}

#[test]
fn a_truncated_or_foreign_partial_table_is_not_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let study = small(folder.path());
    for ending in ["parquet", "csv"] {
        let mut file =
            RowFile { path: folder.path().join(format!("map.{ending}")), rows: 0..study.rows(), resume: false };
        interrupted(&study, &file, 2000);
        file.resume = true;
        let left = std::fs::read(file.partial()).unwrap();
        let mut spoilt = left.clone();
        spoilt.truncate(left.len() - 100);
        std::fs::write(file.partial(), &spoilt).unwrap();
        let refused = |file: &RowFile| study.write(file, &|_| (), &AtomicBool::new(false)).unwrap_err().to_string();
        let message = refused(&file);
        assert!(message.contains("bytes instead of the") && message.contains("without --resume"), "{message}");
        // the same length, with one bit changed
        for at in [0, left.len() / 2, left.len() - 1] {
            let mut altered = left.clone();
            altered[at] ^= 1;
            std::fs::write(file.partial(), &altered).unwrap();
            let message = refused(&file);
            assert!(message.contains("its bytes are not those that were written"), "byte {at}: {message}");
        }
        // the same length, but not a table with these columns
        spoilt.resize(left.len(), b'x');
        spoilt[..20].fill(b'x');
        std::fs::write(file.partial(), &spoilt).unwrap();
        assert!(refused(&file).contains("without --resume to start again"));
        assert!(!file.path.exists() && file.partial().exists());
        std::fs::write(file.partial(), &left).unwrap();
        assert_eq!(study.write(&file, &|_| (), &AtomicBool::new(false)).unwrap(), Written::Whole);
    }
}

#[test]
fn a_partial_table_of_another_study_or_shard_is_not_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let study = small(folder.path());
    let mut file = RowFile { path: folder.path().join("map.csv"), rows: 0..study.rows(), resume: false };
    interrupted(&study, &file, 0);
    file.resume = true;
    let refused = |study: &Study, file: &RowFile| match study.write(file, &|_| (), &AtomicBool::new(false)) {
        Err(RowsError::Resume { reason, .. }) => reason,
        other => panic!("{other:?}"),
    };
    let shard = RowFile { rows: 0..10, ..file.clone() };
    assert!(refused(&study, &shard).contains("the shard"));
    let text = std::fs::read_to_string(folder.path().join("small.toml")).unwrap();
    std::fs::write(folder.path().join("small.toml"), text.replace("0.35", "0.36")).unwrap();
    let other = Study::from_file(folder.path().join("small.toml")).unwrap();
    assert!(refused(&other, &file).contains("the study file"));
}

#[test]
fn consecutive_shards_are_the_whole_map() {
    let folder = tempfile::tempdir().unwrap();
    let study = small(folder.path());
    let whole = write(&study, &folder.path().join("map.csv"), 0..study.rows(), 2);
    for parts in [1, 3, 7] {
        let mut joined = Vec::new();
        for part in 1..=parts {
            let path = folder.path().join(format!("part{part}.csv"));
            let text = write(&study, &path, study.shard(part, parts).unwrap(), 2);
            let header = text.iter().position(|b| *b == b'\n').unwrap() + 1;
            joined.extend_from_slice(if part == 1 { &text } else { &text[header..] });
        }
        assert!(joined == whole, "{parts} parts");
    }
    assert!(study.shard(0, 3).is_none() && study.shard(4, 3).is_none());
    let path = folder.path().join("map.parquet");
    write(&study, &path, 0..study.rows(), 2);
    let whole = parquet_rows(&path);
    assert_eq!(whole.len() as u64, study.rows());
    for parts in [3, 7] {
        let mut joined = Vec::new();
        for part in 1..=parts {
            let path = folder.path().join(format!("part{part}.parquet"));
            write(&study, &path, study.shard(part, parts).unwrap(), 2);
            joined.extend(parquet_rows(&path));
        }
        assert!(joined == whole, "{parts} parts");
    }
}

/// Every row as text, with names and values, because NaN is not equal to itself.
fn parquet_rows(path: &Path) -> Vec<String> {
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    reader.into_iter().map(|row| format!("{:?}", row.unwrap())).collect()
}

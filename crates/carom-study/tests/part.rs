//! Files that are complete or not there, whoever else writes them.

use carom_study::{Part, Table, write_whole};
use std::io::{ErrorKind, Write};
use std::path::Path;

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn two_writers_of_one_file_have_two_temporary_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.svg");
    let [one, two] = [(); 2].map(|()| Part::unique(&path).unwrap());
    assert_ne!(one.temporary(), two.temporary());
    // One after the other in small pieces, as two processes would.
    for _ in 0..1000 {
        one.file().write_all(b"one").unwrap();
        two.file().write_all(b"second").unwrap();
    }
    one.keep().unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "one".repeat(1000));
    two.keep().unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "second".repeat(1000));
    assert_eq!(files(folder.path()), ["x.svg"]);
}

#[test]
fn a_locked_file_has_one_writer_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    let first = Part::locked(&path).unwrap();
    first.file().write_all(b"first").unwrap();
    let refused = Part::locked(&path).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::ResourceBusy);
    let refused = Table::create(&path, &["time".into()]).err().unwrap().to_string();
    let why = "cannot be written: another process writes it: wait for its end, or give another name";
    assert_eq!(refused, format!("{}: {why}", path.display()));
    assert_eq!(std::fs::read(first.temporary()).unwrap(), b"first");
    first.keep().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"first");
    drop(Part::locked(&path).unwrap());
    assert_eq!(files(folder.path()), ["x.csv"]);
}

#[test]
fn the_temporary_file_of_a_killed_process_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    std::fs::write(folder.path().join("x.csv.part"), "a longer text than the new one").unwrap();
    let part = Part::locked(&path).unwrap();
    part.file().write_all(b"new").unwrap();
    part.keep().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
}

/// Threads that make, write and rename the same file without a pause: every file that is seen is that of one of them, and a lock
/// that was taken on a file that has just been renamed does not count.
#[test]
fn a_file_that_many_write_is_always_the_whole_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.csv");
    let texts = ["a", "b", "c"].map(|letter| letter.repeat(10_000));
    write_whole(&path, texts[0].as_bytes()).unwrap();
    std::thread::scope(|scope| {
        for text in &texts {
            scope.spawn(|| {
                for _ in 0..300 {
                    if let Ok(part) = Part::locked(&path) {
                        part.file().write_all(&text.as_bytes()[..4000]).unwrap();
                        part.file().write_all(&text.as_bytes()[4000..]).unwrap();
                        part.keep().unwrap();
                    }
                    let seen = std::fs::read_to_string(&path).unwrap();
                    assert!(texts.contains(&seen), "{} bytes", seen.len());
                }
            });
        }
    });
    assert_eq!(files(folder.path()), ["x.csv"]);
}

#[test]
fn a_folder_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    for made in [Part::unique(folder.path()), Part::locked(folder.path())] {
        assert_eq!(made.unwrap_err().kind(), ErrorKind::IsADirectory);
    }
    assert!(write_whole(&folder.path().join("nowhere/x.svg"), b"").is_err());
    assert_eq!(files(folder.path()), [""; 0]);
}

//! Recordings of impact maps: the file is complete or not there.

use carom_record::{RecordError, Target, record_map};
use carom_study::map_study::Study;
use carom_testing::files::{Folder, path, text};
use std::path::Path;

/// The study of the README with `count` tip positions along each axis.
fn study(count: usize) -> Study {
    let text = text("studies/reversal.toml").replace("count = 361", &format!("count = {count}"));
    Study::from_toml(&text, path("studies")).unwrap()
}

fn size(path: &Path) -> u64 {
    std::fs::metadata(path).unwrap().len()
}

#[test]
fn a_recorded_map_contains_its_images_and_points() {
    let desk = Folder::new();
    let path = desk.join("m.rrd");
    record_map(&study(31), "class", &Target::File(path.clone())).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let holds = |name: &str| bytes.windows(name.len()).any(|window| window == name.as_bytes());
    assert!(bytes.starts_with(b"RRF"));
    for entity in ["/map/0", "/map/1", "/map/1/here", "/space/tip/1", "/space/arm", "/colours/words", "/legend"] {
        assert!(holds(entity), "no {entity}");
    }
    assert!(!holds("/map/2"), "there are two elbow poses");
    // Nine times the rows give more points. The file is compressed, so its size has no exact bound.
    let fine = desk.join("fine.rrd");
    record_map(&study(93), "class", &Target::File(fine.clone())).unwrap();
    assert!(size(&fine) > size(&path));
}

#[test]
fn maps_that_cannot_be_recorded_are_refused_and_no_file_is_written() {
    let desk = Folder::new();
    let path = desk.join("m.rrd");
    for (count, column, why) in
        [(5, "clas", "did you mean \"class\"?"), (800, "class", "rows: a recording holds 1048576 at most")]
    {
        match record_map(&study(count), column, &Target::File(path.clone())) {
            Err(RecordError::Map(said)) => assert!(said.contains(why), "{said}"),
            other => panic!("{other:?}"),
        }
    }
    assert!(desk.files("").is_empty());
}

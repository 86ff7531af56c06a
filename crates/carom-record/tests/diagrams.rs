//! Recordings of diagrams: the file is complete or not there.

use carom_record::{RecordError, Target, record_diagrams};
use carom_study::{LawPoint, hodograph, impulse_space, routh_diagram};
use nalgebra::{matrix, vector};

/// A folder of its own, removed when the test ends.
#[test]
fn diagrams_of_an_impact_are_recorded_or_refused_with_the_file_named() {
    let desk = carom_testing::files::Folder::new();
    let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    let problem = carom_impact::ImpactProblem::new(h, vector![0.6, -0.2, -1.0]).unwrap();
    let laws = [LawPoint { law: "newton".into(), impulse: [-0.3977242309, 0.2551286539, 1.5840946475] }];
    let (plane, space) = (hodograph(&problem, 0.3, &laws).unwrap(), impulse_space(&problem, 0.3, &laws).unwrap());
    let path = desk.join("space.rrd");
    record_diagrams(&Target::File(path.clone()), &plane, Some(&space), "words").unwrap();
    let file = std::fs::read(&path).unwrap();
    assert!(file.starts_with(b"RRF2"));
    // The format is compressed, so the presence of the 3D diagram is checked by the size of the file.
    record_diagrams(&Target::File(path.clone()), &plane, None, "words").unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() + 10_000 < file.len() as u64);

    let planar = carom_impact::ImpactProblem::new(matrix![2.4, 1.5; 1.5, 1.0], vector![-0.3, -0.1]).unwrap();
    let routh = routh_diagram(&planar, 0.5, &[]).unwrap();
    let path = desk.join("plane.rrd");
    record_diagrams(&Target::File(path.clone()), &routh, None, "").unwrap();
    assert!(std::fs::read(&path).unwrap().starts_with(b"RRF2"));

    let path = desk.join("no folder").join("x.rrd");
    let error = record_diagrams(&Target::File(path.clone()), &routh, None, "").unwrap_err();
    assert!(matches!(&error, RecordError::Unwritable { path: named, .. } if *named == path), "{error}");
    assert_eq!(desk.0.read_dir().unwrap().count(), 2);
}

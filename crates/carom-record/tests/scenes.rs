//! Recordings of scenes: the file is complete or not there.

use carom_record::{RecordError, SceneRecorder, Target};
use carom_sim::{Sampling, Scene, Seen};
use carom_testing::files::{Folder, text};
use carom_testing::scenes::shipped as scene;
use std::path::Path;

fn record(scene: &Scene, path: &Path, every: f64) -> Result<(), RecordError> {
    let plan = scene.plan().unwrap();
    let mut recorder = SceneRecorder::begin(&Target::File(path.into()), scene, &plan)?;
    let sampling = Sampling { every: Some(every), ..Sampling::default() };
    let run = plan.stream(scene.duration, sampling, &mut |seen| recorder.see(seen));
    recorder.finish(&run.unwrap())
}

/// The bytes of a recording.
fn recorded(scene: &Scene, every: f64) -> Vec<u8> {
    let folder = Folder::new();
    let path = folder.join("x.rrd");
    record(scene, &path, every).unwrap();
    std::fs::read(path).unwrap()
}

/// Whether a recording has this word.
fn holds(bytes: &[u8], word: &str) -> bool {
    bytes.windows(word.len()).any(|window| window == word.as_bytes())
}

#[test]
fn recordings_of_scenes_begin_with_the_header_of_the_format() {
    let desk = Folder::new();
    for name in ["planar2", "ball", "table", "catch"] {
        let path = desk.join(format!("{name}.rrd"));
        record(&scene(name), &path, 0.004).unwrap();
        assert!(std::fs::read(&path).unwrap().starts_with(b"RRF2"), "{name}");
    }
    assert_eq!(desk.files(""), ["ball.rrd", "catch.rrd", "planar2.rrd", "table.rrd"], "no other file is left");
}

#[test]
fn the_file_grows_linearly_with_the_number_of_samples() {
    let size = |duration: f64| recorded(&Scene { duration, ..scene("planar2") }, 1e-4).len() as f64;
    let [short, middle, long] = [0.1, 0.2, 0.4].map(size);
    assert!((long - middle) < 2.5 * (middle - short), "{short} {middle} {long}");
}

#[test]
fn an_older_recording_stays_until_the_new_one_is_complete() {
    let desk = Folder::new();
    let path = desk.join("x.rrd");
    std::fs::write(&path, "older").unwrap();
    let scene = scene("planar2");
    let plan = scene.plan().unwrap();
    let mut recorder = SceneRecorder::begin(&Target::File(path.clone()), &scene, &plan).unwrap();
    let mut moments = 0;
    let sampling = Sampling { every: Some(0.01), ..Sampling::default() };
    let run = plan.stream(0.1, sampling, &mut |seen| {
        moments += usize::from(matches!(seen, Seen::Moment(_)));
        recorder.see(seen);
    });
    assert!(run.is_ok() && moments > 5);
    let [older, part] = &desk.files("")[..] else { panic!("{:?}", desk.files("")) };
    assert!(older == "x.rrd" && part.starts_with("x.rrd.") && part.ends_with(".part"), "{part}");
    drop(recorder); // without `finish`: the recording is abandoned
    assert_eq!((desk.files(""), desk.read("x.rrd")), (vec!["x.rrd".to_owned()], "older".into()));
}

#[test]
fn a_file_that_cannot_be_written_is_named_and_leaves_no_partial_file() {
    let desk = Folder::new();
    let path = desk.join("no folder").join("x.rrd");
    let error = record(&scene("planar2"), &path, 0.1).unwrap_err();
    assert!(matches!(&error, RecordError::Unwritable { path: named, .. } if *named == path), "{error}");
    assert!(!error.to_string().contains(".part"), "{error}");
    // A folder of the same name is noticed when the complete file is renamed.
    let path = desk.join("folder");
    std::fs::create_dir_all(path.join("not empty")).unwrap();
    let error = record(&scene("planar2"), &path, 0.1).unwrap_err();
    assert!(matches!(error, RecordError::Unwritable { .. }), "{error}");
    assert_eq!(desk.files(""), ["folder"]);
}

#[test]
fn an_invalid_address_of_a_viewer_is_refused() {
    let scene = scene("planar2");
    let plan = scene.plan().unwrap();
    let error = SceneRecorder::begin(&Target::Connect(Some("nowhere".into())), &scene, &plan).err().unwrap();
    assert!(matches!(error, RecordError::Viewer { .. }), "{error}");
}

/// The bytes of a recording of a ball with these elements before an end tag of its file.
fn ball_with(desk: &Folder, elements: &str, before: &str) -> Vec<u8> {
    desk.write("ball.urdf", text("robots/ball.urdf").replace(before, &format!("{elements}{before}")));
    let keys = "[robot]\nurdf = \"ball.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\n[run]\nduration = 0.1\n";
    recorded(&Scene::from_toml(keys, desk).unwrap(), 0.05)
}

/// A link is drawn by its visual shapes; a mesh of them that cannot be read is told, and the collision shapes are drawn instead.
#[test]
fn links_are_drawn_by_their_visual_shapes() {
    let desk = Folder::new();
    let ball_with = |elements: &str| ball_with(&desk, elements, "</link>");
    let plain = ball_with("");
    assert!(holds(&plain, "Ellipsoids3D") && !holds(&plain, "Boxes3D:"));
    let cuboid = ball_with("<visual><geometry><box size='1 1 1'/></geometry></visual>");
    assert!(holds(&cuboid, "Boxes3D:") && !holds(&cuboid, "Ellipsoids3D"));
    desk.write("broken.stl", "no mesh");
    let broken = ball_with("<visual><geometry><mesh filename='broken.stl'/></geometry></visual>");
    assert!(holds(&broken, "Ellipsoids3D"));
}

/// The viewer repeats a run from its first event on; a run without events has nothing to repeat.
#[test]
fn replays_select_the_time_from_the_first_event() {
    let selects = |name: &str, duration: f64| {
        holds(&recorded(&Scene { duration, ..scene(name) }, 0.02), "TimePanelBlueprint:time_selection")
    };
    assert!(selects("planar2", 0.5));
    assert!(!selects("chain10", 0.02), "ten links fall without touching");
}

/// A pair of bodies whose contacts last has one lane, and each force an arrow; pairs that never touch have none. No entity has a name that
/// the viewer shows with backslashes.
#[test]
fn lasting_contacts_have_a_lane_for_each_pair_of_bodies_and_forces() {
    let bytes = |name: &str, duration: f64| recorded(&Scene { duration, ..scene(name) }, 0.02);
    // The box comes to rest on four of its corners.
    let rests = bytes("box", 1.0);
    assert!(holds(&rests, "/contact/box_on_floor") && !holds(&rests, r"/contact/box_on_floor\"));
    assert!(
        holds(&rests, "/world/links/box/shape_1")
            && [r"shape\ ", r"box\ ", r"on\ "].iter().all(|name| !holds(&rests, name))
    );
    assert!(holds(&rests, "/world/forces"));
    let flies = bytes("box", 0.1);
    assert!(!holds(&flies, "/world/forces") && !holds(&flies, "/contact/box_on_floor"));
}

/// Names that differ in a space only stay apart.
#[test]
fn links_whose_names_differ_in_a_space_are_two_entities() {
    let other = "<link name='a_b'/><link name='a b'/><joint name='one' type='fixed'><parent link='ball'/><child link='a_b'/></joint>\
        <joint name='two' type='fixed'><parent link='ball'/><child link='a b'/></joint>";
    let bytes = ball_with(&Folder::new(), other, "</robot>");
    assert!(holds(&bytes, "/world/links/a_b") && holds(&bytes, r"/world/links/a\ b"));
}

/// Estimated errors have plots, which a recording without them has not.
#[test]
fn estimated_errors_have_plots() {
    let (desk, scene) = (Folder::new(), scene("planar2"));
    let plan = scene.plan().unwrap();
    let plots = |errors: bool| {
        let path = desk.join("x.rrd");
        let mut recorder = SceneRecorder::begin(&Target::File(path.clone()), &scene, &plan).unwrap();
        let (mut events, mut moments) = (Vec::new(), Vec::new());
        let sampling = Sampling { every: Some(0.05), ..Sampling::default() };
        let run = plan.stream(scene.duration, sampling, &mut |seen| {
            match &seen {
                Seen::Event(event) => events.push((*event).clone()),
                Seen::Moment(moment) => moments.push((*moment).clone()),
                _ => {}
            }
            recorder.see(seen);
        });
        let run = run.unwrap();
        if errors {
            let error = plan.error_of((scene.duration, Some(0.05)), (&events, &moments, &run)).unwrap();
            recorder.errors(&moments, &error.samples);
        }
        recorder.finish(&run).unwrap();
        let bytes = std::fs::read(path).unwrap();
        ["/series/error/position", "log10 of the errors"].map(|word| holds(&bytes, word))
    };
    assert_eq!((plots(true), plots(false)), ([true; 2], [false; 2]));
}

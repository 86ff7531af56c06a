//! Files that commands write: they never replace an input or one another, and none is written if an input is refused.

use crate::command_line::desk::*;
use serde_json::json;
use std::process::Child;
use std::time::{Duration, Instant};

const SCENE: &str = r#"[robot]
urdf = "planar2.urdf"
q = [0.7854, -1.5708]
[run]
controller = "torque-file"
torque_file = "torque.csv"
duration = 0.01
"#;

const STUDY: &str = r#"[robot]
urdf = "planar2.urdf"
[joints]
shoulder = { from = 0, to = 1, count = 3 }
elbow = 1
[impact]
normal = [-1, 0, 0]
approach_deg = 45
speed = 0.2
law = "frictionless"
restitution = 0.5
[map]
quantities = ["impulse"]
"#;

/// A desk with a scene, a study, a table, and two files of problems, one of which has an invalid second line.
fn laid() -> Desk {
    let desk = Desk::new();
    desk.write("s.toml", SCENE);
    desk.write("torque.csv", "0,0,0\n1,0,0\n");
    desk.write("m.toml", STUDY);
    desk.write("t.csv", "row,angle_deg,newton,energy_root\nup,45,0.4,0.7\n");
    let good = json!({"delassus": [[2, 0.5], [0.5, 1]], "u": [0.3, -1]});
    desk.write("good.jsonl", format!("{good}\n"));
    desk.write("bad.jsonl", format!("{good}\noops\n"));
    desk
}

/// Checks that the command is refused with this message and changes no file.
#[track_caller]
fn leaves_all(desk: &Desk, args: &str, message: &str) {
    let all = || -> Vec<(String, Vec<u8>)> {
        let read = |name: String| (name.clone(), std::fs::read(desk.join(name)).unwrap_or_default());
        desk.files("").into_iter().map(read).collect()
    };
    let before = all();
    desk.refused(args, message);
    assert!(all() == before, "{args} wrote something");
}

const LAW: &str = "law --law all --restitution 0.5 --friction 0.2 --problems";

#[test]
fn outputs_that_would_replace_an_input_are_refused() {
    let desk = laid();
    let lost = "the command reads this file and would replace it: give another name";
    for (from, to) in
        [("t.csv", "t.svg"), ("good.jsonl", "good.svg"), ("m.toml", "m.svg"), ("planar2.urdf", "robot.svg")]
    {
        std::fs::copy(desk.join(from), desk.join(to)).unwrap();
    }
    let study = desk.read("m.toml");
    desk.write("m.toml", study.replace("planar2.urdf", "robot.svg"));
    for (args, named) in [
        ("consistency t.svg --out t.svg".to_owned(), "--out t.svg"),
        (format!("{LAW} good.svg --out ./good.svg"), "--out ./good.svg"),
        ("simulate s.toml --out torque.csv".into(), "--out torque.csv"),
        ("simulate s.toml --contacts torque.csv".into(), "--contacts torque.csv"),
        ("chart s.toml --out torque.svg".into(), "the numbers of --out, torque.csv"),
        ("map m.svg --out m.svg".into(), "--out m.svg"),
        ("map m.toml --svg robot.svg".into(), "--out robot.svg"),
    ] {
        leaves_all(&desk, &args, &format!("{named}: {lost}"));
    }
}

#[cfg(unix)]
#[test]
fn outputs_that_reach_an_input_through_a_link_are_refused() {
    let desk = laid();
    std::os::unix::fs::symlink("t.csv", desk.join("link.svg")).unwrap();
    std::os::unix::fs::symlink(".", desk.join("here")).unwrap();
    let lost = "the command reads this file and would replace it: give another name";
    leaves_all(&desk, "consistency t.csv --out link.svg", &format!("--out link.svg: {lost}"));
    std::fs::copy(desk.join("t.csv"), desk.join("t.svg")).unwrap();
    std::os::unix::fs::symlink("t.svg", desk.join("link.csv")).unwrap();
    leaves_all(&desk, "consistency link.csv --out t.svg", &format!("--out t.svg: {lost}"));
    leaves_all(&desk, "consistency t.svg --out here/t.svg", &format!("--out here/t.svg: {lost}"));
    let twice = "--out here/m.csv: --out m.csv is a table too: give one";
    leaves_all(&desk, "map m.toml --out m.csv --out here/m.csv", twice);
}

#[test]
fn two_outputs_of_the_same_file_are_refused() {
    let desk = laid();
    for (args, message) in cases(
        r"
        map m.toml --out m.csv --out m.csv
            --out m.csv: --out m.csv is a table too: give one
        map m.toml --out -
            --out -: the table can be resumed from its file: give the name of a table, .csv or .parquet
        map m.toml --out m.svg --shard 1/2
            --shard: a picture and a recording are of the whole table: give tables only, or no --shard
        map m.toml --out m.svg --resume
            --resume is for a table: give --out X.csv or --out X.parquet
        simulate s.toml --out x.csv --out ./x.csv
            --out ./x.csv: --out x.csv names the same file: give each its own
        simulate s.toml --out x.csv --contacts ./x.csv
            --contacts ./x.csv: --out x.csv names the same file: give each its own
    ",
    ) {
        leaves_all(&desk, args, message);
    }
}

#[test]
fn missing_folders_of_outputs_are_refused_before_any_work() {
    let desk = laid();
    for (args, option) in [
        ("consistency t.csv".to_owned(), "--out"),
        (format!("{LAW} good.jsonl"), "--out"),
        ("simulate s.toml".into(), "--out"),
        ("chart s.toml".into(), "--out"),
        ("map m.toml".into(), "--out"),
        ("paper".into(), "--out"),
        ("stress".into(), "--out"),
    ] {
        let file = if args.starts_with("simulate") { "no/such.csv" } else { "no/such.svg" };
        let file = if file.ends_with(".svg") && args.starts_with("stress") { "no/such" } else { file };
        let message = format!("{option} {file}: there is no folder no: make it first");
        leaves_all(&desk, &format!("{args} {option} {file}"), &message);
    }
    let folder = "it is a folder or a device: give the name of a file";
    std::fs::create_dir(desk.join("folder.csv")).unwrap();
    leaves_all(&desk, "map m.toml --out folder.csv", &format!("--out folder.csv: {folder}"));
    std::fs::create_dir(desk.join("folder.svg")).unwrap();
    leaves_all(&desk, "consistency t.csv --out folder.svg", &format!("--out folder.svg: {folder}"));
}

/// The ending of a name says what is written; the names of before are read as `--out` and not in the help.
#[test]
fn outputs_are_written_by_their_endings() {
    let desk = laid();
    let says = "the ending of the name says what is written:";
    let both = ".csv or .parquet for a table, .rrd for a recording";
    for (args, file, message) in [
        ("simulate s.toml --out", "x.svg", format!("{says} {both}")),
        ("simulate s.toml --csv", "s.toml", format!("{says} {both}")),
        ("simulate s.toml --contacts t.csv --out", "x", format!("{says} {both}")),
        ("consistency t.csv --svg", "-", format!("{says} .svg for a picture")),
        (
            "law --law all --restitution 0.5 --problems good.jsonl --out a.svg --svg",
            "b.svg",
            "--out a.svg is a picture too: give one".into(),
        ),
    ] {
        leaves_all(&desk, &format!("{args} {file}"), &format!("--out {file}: {message}"));
    }
    done(&desk.run("simulate s.toml --out new.csv --out new.parquet"));
    done(&desk.run("simulate s.toml --csv old.csv --parquet old.parquet"));
    let read = |file: &str| std::fs::read(desk.join(file)).unwrap();
    for ending in ["csv", "parquet"] {
        assert!(read(&format!("new.{ending}")) == read(&format!("old.{ending}")), "{ending}");
    }
    let help = desk.run("simulate --help").out;
    assert!(help.contains("--out <FILE>") && !help.contains("--csv") && !help.contains("--parquet"), "{help}");
}

/// The table of the name `-` is that of a file, and stands alone on standard output.
#[test]
fn a_table_is_printed_in_place_of_the_answer() {
    let desk = laid();
    done(&desk.run("simulate s.toml --out x.csv --contacts c.csv"));
    for (args, file) in [("--out -", "x.csv"), ("--contacts - --out y.csv", "c.csv")] {
        let ran = desk.run(&format!("simulate s.toml {args}"));
        done(&ran);
        assert_eq!(ran.out, desk.read(file), "{args}");
    }
    let header = desk.read("x.csv");
    assert!(header.starts_with("time,q."), "{header}");
    assert!(desk.join("y.csv").exists());
    let rule = "give the table the name of a file";
    leaves_all(
        &desk,
        "simulate s.toml --out - --json",
        &format!("-: standard output has the answer of --json: {rule}"),
    );
    leaves_all(&desk, "simulate s.toml --out - --contacts -", &format!("-: standard output has another table: {rule}"));
}

#[test]
fn recordings_without_the_feature_are_refused_before_anything_is_read() {
    if cfg!(feature = "rerun") {
        return;
    }
    let desk = laid();
    let without = "recordings: build carom with the feature rerun";
    desk.write("empty.jsonl", "");
    for file in ["empty.jsonl", "bad.jsonl"] {
        let message = format!("--out, --connect and --spawn need {without}");
        leaves_all(&desk, &format!("{LAW} {file} --out x.rrd"), &message);
    }
    leaves_all(&desk, "map m.toml --out m.csv --rrd m.rrd", &format!("a recording needs {without}"));
}

#[test]
fn map_needs_an_output_and_an_existing_column() {
    let desk = laid();
    for words in ["--out <FILE>", "--advise"] {
        usage(desk.run("map m.toml"), words);
    }
    for args in ["--out m.csv --show impulses", "--out m.csv --svg m.svg --show impulses"] {
        let message = "--show impulses: this map has no such column: its columns are q.shoulder, class, impulse";
        leaves_all(&desk, &format!("map m.toml {args}"), message);
    }
}

#[test]
fn zeros_are_printed_without_a_sign() {
    let desk = Desk::new();
    let state = json!({"q": UP_ELBOW, "qd": [-0.3, 0.3]});
    for args in [
        "impact planar2.urdf --tip tip --normal -1,0,0 --law all --restitution 0.5 --locked shoulder --states -",
        "impact planar2.urdf --tip tip --normal -1,0,0 --law all --restitution 0 --joint-damping 0 --contact-time 1 --states -",
    ] {
        for json in ["", " --json"] {
            let ran = desk.feed(&format!("{args}{json}"), state.to_string());
            done(&ran);
            assert!(
                !ran.out.contains("-0.0,") && !ran.out.contains("-0.0]") && !ran.out.contains("-0 "),
                "{}",
                ran.out
            );
        }
    }
    let problem = json!({"delassus": [[1, 0], [0, 1]], "u": [-0.0, -1]});
    let hit = desk.answers("law --law all --restitution 0 --friction 0.5 --problems - --json", &problem.to_string());
    assert!(!hit[0].to_string().contains("-0.0"), "{}", hit[0]);
}

/// A study whose map is computed for a while.
fn long_map() -> String {
    STUDY.replace("count = 3", "count = 20000").replace("elbow = 1\n", "elbow = { from = 1, to = 2, count = 20000 }\n")
}

/// A process that ends with the test.
struct Running(Child);

impl Running {
    /// Starts a command and waits until it has begun the file `part`.
    fn begun(desk: &Desk, args: &str, part: &str) -> Self {
        let mut own = Self(desk.command(args).spawn().unwrap());
        let start = Instant::now();
        while !desk.files("").contains(&part.to_owned()) {
            assert!(own.0.try_wait().unwrap().is_none(), "{args} ended");
            assert!(start.elapsed() < Duration::from_secs(60), "{args} does not begin");
            std::thread::sleep(Duration::from_millis(10));
        }
        own
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The second process would write into the file of the first. It changes nothing; when the first is gone, however it ended, the
/// file can be written.
#[test]
fn a_second_process_that_writes_the_same_table_is_refused() {
    let desk = laid();
    desk.write("long.toml", SCENE.replace("duration = 0.01", "duration = 1e5\nmax_step = 1e-3"));
    desk.write("long-map.toml", long_map());
    for (long, short, name) in [
        ("simulate long.toml --csv x.csv", "simulate s.toml --csv x.csv", "x.csv"),
        ("simulate long.toml --parquet x.parquet", "simulate s.toml --contacts x.parquet", "x.parquet"),
        ("map long-map.toml --out m.csv", "map m.toml --out m.csv", "m.csv"),
        ("map long-map.toml --out m.parquet", "map m.toml --out m.parquet", "m.parquet"),
    ] {
        let mut first = Running::begun(&desk, long, &format!("{name}.part"));
        let why = "cannot be written: another process writes it: wait for its end, or give another name";
        desk.refused(short, &format!("{name}: {why}"));
        assert!(first.0.try_wait().unwrap().is_none(), "{long} goes on");
        assert!(desk.files("").contains(&format!("{name}.part")) && !desk.join(name).exists());
        drop(first);
        done(&desk.run(short));
        assert!(desk.join(name).exists() && !desk.files("").contains(&format!("{name}.part")), "{short}");
    }
}

#[test]
fn what_cannot_be_drawn_or_advised_is_refused_before_the_map_is_computed() {
    let desk = laid();
    let four = STUDY
        .replace("elbow = 1\n", "elbow = { from = 1, to = 2, count = 3 }\n")
        .replace("speed = 0.2", "speed = [0.1, 0.2]")
        .replace("restitution = 0.5", "restitution = [0.4, 0.5]");
    desk.write("four.toml", four);
    let axes = "four.toml: 4 axes vary (q.shoulder, q.elbow, speed, restitution): a picture shows one or two, and a third with at \
                most 8 values; give the others one value";
    leaves_all(&desk, "map four.toml --out m.csv --svg m.svg", axes);
    let advice = "four.toml: [advise] is missing: add it with minimise or maximise";
    leaves_all(&desk, "map four.toml --out m.csv --advise", advice);
    if cfg!(feature = "rerun") {
        leaves_all(&desk, "map four.toml --out m.csv --rrd m.rrd", axes);
    }
    desk.write("large.toml", long_map());
    let rows =
        "large.toml: the map has 400000000 rows, and a picture allows at most 16777216: give the axes fewer values";
    leaves_all(&desk, "map large.toml --out m.csv --svg m.svg", rows);
}

/// In the folder /proc no file can be made, by any user.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_to_is_refused_before_any_work() {
    let desk = laid();
    let ran = desk.run("map m.toml --out m.csv --svg /proc/m.svg");
    refused_with(&ran, "error: /proc/m.svg: cannot be written: ");
    assert!(!desk.join("m.csv").exists());
}

#[test]
fn files_of_the_user_in_the_folder_of_a_report_are_not_replaced() {
    let desk = laid();
    for (command, own, missing) in
        [("paper", "table1.csv", "fig4.svg"), ("stress --scene jam", "stress.md", "stress.svg")]
    {
        let folder = desk.join(command.split(' ').next().unwrap());
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join(own), "mine").unwrap();
        let ran = desk.run(&format!("{command} --out {}", folder.display()));
        refused_with(&ran, &format!("it contains '{own}' but not '{missing}', so it is "));
        assert_eq!(std::fs::read_to_string(folder.join(own)).unwrap(), "mine");
        assert_eq!(desk.files(folder.file_name().unwrap().to_str().unwrap()), [own]);
        // The folder of an earlier run is written again.
        std::fs::remove_file(folder.join(own)).unwrap();
        for _ in 0..2 {
            done(&desk.run(&format!("{command} --out {}", folder.display())));
        }
    }
    // Beside the three files of `stress`, others stay.
    desk.write("stress/mine.txt", "mine");
    done(&desk.run("stress --scene jam --out stress"));
    assert_eq!(desk.files("stress"), ["mine.txt", "stress.json", "stress.md", "stress.svg"]);
}

//! Tests of `carom map` as a process: rows that are those of the study, refusals that name file, key, value and rule, and
//! interruptions.

use crate::command_line::desk::{Desk, Ran, refused};
use carom_study::map_study::Study;
use carom_study::{NumberedRows, RowFile};
use carom_testing::files::page;
use serde_json::json;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

impl Desk {
    fn study(&self, change: impl Fn(&str) -> String) {
        self.write("s.toml", change(STUDY));
    }

    /// Checks the message of a study in which the first `old` is `new`.
    #[track_caller]
    fn refuses_study(&self, old: &str, new: &str, message: &str) {
        assert!(STUDY.contains(old), "the study has no {old}");
        self.study(|text| text.replacen(old, new, 1));
        let before = self.files("");
        refused(self.run("map s.toml --out x.csv"), &format!("s.toml: {message}"));
        assert_eq!(self.files(""), before, "nothing is written");
    }
}

const STUDY: &str = r#"
[robot]
urdf = "planar2.urdf"

[joints]
shoulder = { from = -90, to = 90, count = 7, unit = "deg" }
elbow = { from = -1.4, to = 1.5, count = 6 }

[impact]
normal = [-1, 0, 0]
along = [0, -1, 0]
approach_deg = { from = 30, to = 60, count = 2 }
speed = 0.2
law = "energetic"
restitution = 0.35
friction = 0.2

[map]
quantities = ["tangential_after", "impulse", "qd_minus", "qd_plus", "mode_margin", "mode_edge", "mode_beyond", "mode"]
"#;

/// The tests of carom-study compare its rows with single impacts.
#[test]
fn a_map_is_the_table_of_its_study() {
    let desk = Desk::new();
    desk.study(str::to_owned);
    let summary = desk.one("map s.toml --out m.csv --json");
    assert_eq!((&summary["rows"], &summary["out"]), (&json!(84), &json!("m.csv")));
    let text = desk.read("m.csv");
    assert!(text.starts_with("q.shoulder,q.elbow,approach_deg,class,") && text.lines().count() == 85, "{text}");
    let study = Study::from_file(desk.join("s.toml")).unwrap();
    let own = RowFile { path: desk.join("own.csv"), rows: 0..study.rows(), resume: false };
    study.write(&own, &|_| (), &AtomicBool::new(false)).unwrap();
    assert!(text == desk.read("own.csv"));
}

#[test]
fn invalid_studies_are_refused_with_file_key_value_and_rule() {
    let desk = Desk::new();
    let values = "a number, a list of numbers, or { from, to, count }";
    for (old, new, message) in [
        ("count = 6 }", "cuont = 6 }", "line 7: unknown field `cuont`, expected one of `from`, `to`, `count`, `unit`; did you mean `count`?".to_owned()),
        ("count = 6 }", "count = 1 }", "[joints] elbow: count = 1: a range has at least 2 values; for one value write the number itself".into()),
        ("{ from = -1.4, to = 1.5, count = 6 }", "\"wide\"", format!("line 7, elbow = \"wide\": invalid type: string \"wide\", expected {values}")),
        ("{ from = -1.4, to = 1.5, count = 6 }", "[]", "[joints] elbow: the list is empty: give at least one value".into()),
        ("to = 1.5", "to = nan", "[joints] elbow: NaN: every value must be finite".into()),
        ("elbow =", "elbov =", "[joints] elbov: no joint is named 'elbov'; did you mean 'elbow'?".into()),
        ("elbow = { from = -1.4, to = 1.5, count = 6 }", "", "[joints] has no elbow: give every moving joint a value or a range".into()),
        ("[joints]", "[tip]\nx = 0.5\ny = 0.1\n[joints]", "both [joints] and [tip] are given: keep one of them".into()),
        ("along = [0, -1, 0]", "along = [2, 0, 0]", "[impact] along = [2, 0, 0] is normal to the surface: give a direction along the surface".into()),
        ("normal = [-1, 0, 0]", "", "[impact] has no normal: give normal = [x, y, z], from the environment to the robot".into()),
        ("normal = [-1, 0, 0]", "normal = [0, 0, 0]", "[impact] normal = [0.0, 0.0, 0.0]: a normal needs a finite length above 0".into()),
        ("to = 60", "to = 200", "[impact] approach_deg = 200: the angle must lie between 0 and 180 degrees".into()),
        ("speed = 0.2", "speed = -0.2", "[impact] speed = -0.2: the speed must be above 0".into()),
        ("restitution = 0.35", "restitution = [0.2, 1.35]", "[impact] restitution = 1.35: a coefficient of restitution lies between 0 and 1".into()),
        ("friction = 0.2", "friction = -0.2", "[impact] friction = -0.2: a coefficient of friction is not negative".into()),
        ("friction = 0.2", "tangential_restitution = 0.2", "[impact] tangential_restitution is used by none of the laws in law = [\"energetic\"], only by chatterjee-ruina: leave it out, or add one of these laws".into()),
        ("law = \"energetic\"\nrestitution = 0.35\nfriction = 0.2", "law = \"frictionless\"\nrestitution = 0.35\nfriction = [0, 0.2]", "[impact] friction is used by none of the laws in law = [\"frictionless\"], only by whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith: leave it out, or add one of these laws".into()),
        ("\"energetic\"", "[\"energetic\", \"poison\"]", "[impact] law = \"poison\": did you mean \"poisson\"? Known names: frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith".into()),
        ("\"impulse\"", "\"impulse\", \"impulse\"", "[map] quantities holds \"impulse\" twice".into()),
        ("count = 7", "count = 9223372036854775807", "the map has 2⁶⁴ rows or more: give the axes fewer values".into()),
    ] {
        desk.refuses_study(old, new, &message);
    }
    for (wish, told) in [
        ("class = []", "error: s.toml: [advise] class is empty: give at least one of unreachable, outside-limits, "),
        (
            "at_most = { speed = 1 }",
            "no column of numbers 'speed': add it to quantities, or give it more than one value if it is an axis;",
        ),
    ] {
        desk.study(|text| format!("{text}\n[advise]\nminimise = \"impulse\"\n{wish}\n"));
        let said = desk.run("map s.toml --out x.csv").err;
        assert!(said.contains(told), "{said}");
    }
}

#[test]
fn an_unknown_quantity_is_refused_with_the_nearest_name() {
    let desk = Desk::new();
    desk.study(|text| text.replace("\"impulse\"", "\"impulses\""));
    let said = desk.run("map s.toml --out x.csv").err;
    assert!(said.starts_with(
        "error: s.toml: [map] quantities holds \"impulses\": did you mean \"impulse\"? Known names: mode"
    ));
}

#[test]
fn invalid_shards_and_threads_are_usage_errors() {
    let desk = Desk::new();
    desk.study(str::to_owned);
    let before = desk.files("");
    for args in [
        "--out x.csv --shard 0/3",
        "--out x.csv --shard 4/3",
        "--out x.csv --shard 3",
        "--shard 1/3",
        "--out x.csv --threads 0",
    ] {
        assert_eq!(desk.run(&format!("map s.toml {args}")).code, Some(2), "{args}");
    }
    assert_eq!(desk.run("map s.toml --out x.txt").code, Some(1));
    assert_eq!(desk.files(""), before);
}

/// Ctrl-C leaves a complete table of the rows that are done and names it; `--resume` gives the bytes of an uninterrupted run.
#[cfg(unix)]
#[test]
fn an_interrupted_map_is_resumed_to_the_same_bytes() {
    let desk = Desk::new();
    // The map has eight groups of rows; the first is written while the third is computed, so the interruption comes early.
    desk.study(|text| text.replace("count = 7", "count = 512").replace("count = 6", "count = 512"));
    for name in ["m.parquet", "m.csv"] {
        let args = format!("map s.toml --out {name} --threads 1");
        let Ran { code, err: said, .. } = desk.interrupted(&args, name, 10_000, Duration::ZERO);
        assert_eq!(code, Some(1), "{said}");
        let partial = name.replace("m.", "m.partial.");
        assert!(said.starts_with("error: interrupted after ") && said.contains(&partial), "{said}");
        assert!(!desk.files("").iter().any(|file| file == name || file.ends_with(".part")));
        let resumed = desk.run(&format!("map s.toml --out {name} --resume"));
        assert_eq!(resumed.code, Some(0), "{resumed:?}");
        let bytes = std::fs::read(desk.join(name)).unwrap();
        // What an interrupted run has left is gone with a whole table, resumed or not.
        assert!(!desk.join(&partial).exists());
        desk.write(&partial, "of an older run");
        assert!(desk.run(&format!("map s.toml --out {name} --threads 2")).code == Some(0));
        assert!(bytes == std::fs::read(desk.join(name)).unwrap(), "{name}");
        assert!(!desk.join(partial).exists());
    }
}

/// The recipes of the book for many machines, with four parts of CSV. Slurm is replaced by the variables that it sets in the
/// tasks of an array; without GNU parallel, `xargs` is used.
#[cfg(unix)]
#[test]
fn parts_made_by_the_recipes_of_the_book_are_the_whole_map() {
    let desk = Desk::new();
    desk.study(|text| text.replace("count = 7", "count = 40"));
    std::fs::rename(desk.join("s.toml"), desk.join("study.toml")).unwrap();
    assert!(desk.run("map study.toml --out whole.csv").code == Some(0));
    let whole = desk.read("whole.csv");
    let book = page("task-impact-maps.md");
    let recipe = |holds: &str| {
        let block = book.split("```").find(|block| block.starts_with("sh,ignore\n") && block.contains(holds));
        let text =
            block.unwrap_or_else(|| panic!("no recipe of the book contains {holds}")).split_once('\n').unwrap().1;
        assert!(text.contains("64"), "{text}");
        text.replace("64", "4").replace(".parquet", ".csv")
    };
    let carom = PathBuf::from(env!("CARGO_BIN_EXE_carom"));
    let path = std::env::join_paths(
        std::iter::once(carom.parent().unwrap().to_owned())
            .chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    )
    .unwrap();
    let shell = |text: &str, set: &[(&str, &str)]| {
        let mut command = Command::new("sh");
        command.args(["-e", "-c", text]).current_dir(&desk.0).env("PATH", &path).envs(set.to_vec());
        let ran = command.output().unwrap();
        assert!(ran.status.success(), "{text}\n{}", String::from_utf8_lossy(&ran.stderr));
    };
    let joined = || {
        let mut joined = String::new();
        for part in 1..=4 {
            let text = desk.read(&format!("parts/{part}.csv"));
            joined += if part == 1 { &text } else { text.split_once('\n').unwrap().1 };
        }
        std::fs::remove_dir_all(desk.join("parts")).unwrap();
        joined
    };

    let parallel = recipe("parallel --joblog");
    let there = Command::new("parallel").arg("--version").output();
    let is_gnu = there.is_ok_and(|said| String::from_utf8_lossy(&said.stdout).starts_with("GNU parallel"));
    let (begin, command) = parallel.split_once("parallel --joblog parts/log --resume-failed").unwrap();
    shell(&if is_gnu { parallel.clone() } else { format!("{begin}xargs -I{{}} sh -c{command}") }, &[]);
    assert!(joined() == whole, "GNU parallel");

    let array = recipe("#SBATCH --array");
    std::fs::create_dir(desk.join("parts")).unwrap();
    for task in ["1", "2", "3", "4"] {
        shell(&array, &[("SLURM_ARRAY_TASK_ID", task), ("SLURM_CPUS_PER_TASK", "2")]);
    }
    assert!(joined() == whole, "Slurm");
}

/// A limit of the size of files stands for a full disk: both end a write that has begun. The rows before it are kept, and a run
/// that resumes gives the bytes of an uninterrupted one, also after a second failure.
#[cfg(unix)]
#[test]
fn a_map_that_does_not_fit_on_the_disk_is_resumed_to_the_same_bytes() {
    let desk = Desk::new();
    // eight groups of rows each
    for (name, count) in [("m.parquet", 512), ("m.csv", 256)] {
        let count = format!("count = {count}");
        desk.study(|text| text.replace("count = 7", &count).replace("count = 6", &count));
        assert!(desk.run(&format!("map s.toml --out {name}")).code == Some(0));
        let whole = std::fs::read(desk.join(name)).unwrap();
        std::fs::remove_file(desk.join(name)).unwrap();
        let partial = name.replace("m.", "m.partial.");
        let mut kept = 0;
        // In the midst of the rows, twice, and at their end, in the footer of a Parquet file. The unit of the limit is 512 bytes.
        let limits =
            [(whole.len() / 3 / 512, ""), (whole.len() / 3 / 512, " --resume"), (whole.len() / 512, " --resume")];
        for (limit, more) in limits {
            let carom = env!("CARGO_BIN_EXE_carom");
            let script =
                format!("trap '' XFSZ; ulimit -f {limit}; exec {carom} map s.toml --out {name} --threads 1{more}");
            let ran = Command::new("sh").args(["-c", &script]).current_dir(&desk.0).output().unwrap();
            let said = String::from_utf8(ran.stderr).unwrap();
            assert_eq!(ran.status.code(), Some(1), "{said}");
            let said = said.lines().last().unwrap();
            assert!(said.starts_with(&format!("error: {name}: cannot be written: File too large")), "{said}");
            let rows = said.split("the first ").nth(1).unwrap().split(' ').next().unwrap();
            assert!(said.contains(&format!(" rows are kept in {partial}: ")) && said.contains("--resume"), "{said}");
            let rows: u64 = rows.parse().unwrap();
            assert!(rows >= kept && rows > 0 && rows < 512 * 512 * 2, "{rows} rows after {kept}");
            kept = rows;
            let left: Vec<String> = desk.files("").into_iter().filter(|file| file.starts_with("m.")).collect();
            assert_eq!(left, [partial.clone(), format!("{partial}.json")]);
        }
        let resumed = desk.run(&format!("map s.toml --out {name} --resume"));
        assert_eq!(resumed.code, Some(0), "{resumed:?}");
        assert!(whole == std::fs::read(desk.join(name)).unwrap(), "{name}");
        std::fs::remove_file(desk.join(name)).unwrap();
        assert!(!desk.join(partial).exists());
    }
}

#[test]
fn a_column_is_shown_where_there_is_a_picture_or_a_recording() {
    let desk = Desk::new();
    desk.study(str::to_owned);
    let message = "--show impulse: nothing is drawn or recorded: give --out a name that ends in .svg or .rrd";
    desk.refused("map s.toml --out x.csv --show impulse", message);
    assert_eq!(desk.files("").iter().filter(|name| name.starts_with("x.")).count(), 0);
}

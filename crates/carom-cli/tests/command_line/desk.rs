//! A temporary folder, runs of the command in it, and checks of its answers.

use carom_testing::files::Folder;
pub use carom_testing::tables::cases;
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub const INERTIAL: &str =
    r#"<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;

/// Elbow up; at this pose the tip touches the wall of the paper, whose normal is -x.
pub const UP_ELBOW: [f64; 2] = [FRAC_PI_4, -FRAC_PI_2];

/// A folder that is removed when the test ends. Commands run in it, so that messages name files without a path.
pub struct Desk(pub Folder);

impl std::ops::Deref for Desk {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.0
    }
}

/// Exit status and output of a run.
#[derive(Debug, PartialEq)]
pub struct Ran {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Desk {
    /// A new folder with the preset robots.
    pub fn new() -> Self {
        let folder = Folder::new();
        for robot in ["robots/planar2.urdf", "robots/planar3.urdf", "robots/arm7.urdf", "robots/box.urdf"] {
            folder.copy(robot);
        }
        Self(folder)
    }

    /// The desk with the robots, scenes, studies and documents of the repository.
    pub fn with_studies() -> Self {
        let desk = Self::new();
        desk.0.link(&["robots", "scenes", "studies", "docs"]);
        desk
    }

    pub fn command(&self, args: &str) -> Command {
        self.command_of(&args.split_whitespace().collect::<Vec<_>>())
    }

    pub fn command_of(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_carom"));
        command.args(args).current_dir(&self.0).env_remove("ROS_PACKAGE_PATH").env_remove("AMENT_PREFIX_PATH");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs with arguments that contain no spaces.
    pub fn run(&self, args: &str) -> Ran {
        self.feed(args, "")
    }

    /// The same, with text on standard input.
    pub fn feed(&self, args: &str, input: impl AsRef<[u8]>) -> Ran {
        finish(self.command(args).spawn().unwrap(), input.as_ref())
    }

    /// Runs a command until the table that it writes has this number of bytes, waits, interrupts it and collects its output.
    #[cfg(unix)]
    pub fn interrupted(&self, args: &str, table: &str, least: u64, wait: Duration) -> Ran {
        let child = self.command(args).spawn().unwrap();
        let (part, begun) = (self.0.join(format!("{table}.part")), Instant::now());
        while std::fs::metadata(&part).map_or(true, |of| of.len() < least) {
            assert!(begun.elapsed() < Duration::from_secs(60), "the run does not begin");
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(wait);
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        finish(child, b"")
    }

    /// The answers as JSON; panics if anything is refused.
    pub fn answers(&self, args: &str, input: &str) -> Vec<Value> {
        let ran = self.feed(args, input);
        assert_eq!(ran.code, Some(0), "{args}: {}", ran.err);
        ran.out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The one answer of a command without standard input.
    #[track_caller]
    pub fn one(&self, args: &str) -> Value {
        let mut answers = self.answers(args, "");
        assert_eq!(answers.len(), 1, "{args}");
        answers.remove(0)
    }

    /// Checks for a refusal with this message.
    #[track_caller]
    pub fn refused(&self, args: &str, message: &str) {
        refused(self.run(args), message);
    }

    /// The one answer to one line.
    pub fn answer(&self, args: &str, input: &Value) -> Value {
        let answers = self.answers(args, &input.to_string());
        assert_eq!(answers.len(), 1, "{args}");
        answers.into_iter().next().unwrap()
    }
}

/// Writes to the standard input of a run and collects its output. A run that is refused early reads no input, so a closed pipe
/// is no failure here.
pub fn finish(mut child: Child, input: &[u8]) -> Ran {
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let feeder = std::thread::spawn(move || {
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    Ran {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Checks for exit status 1, nothing on standard output, and this one line on standard error.
#[track_caller]
pub fn refused(ran: Ran, message: &str) {
    let expected = Ran { code: Some(1), out: String::new(), err: format!("error: {message}\n") };
    assert_eq!(ran, expected);
}

/// Checks for exit status 1, nothing on standard output, and a line of refusal with these words.
#[track_caller]
pub fn refused_with(ran: &Ran, words: &str) {
    let told = ran.err.lines().any(|line| line.starts_with("error: ") && line.contains(words));
    assert!(ran.code == Some(1) && ran.out.is_empty() && told, "{words:?}: {ran:?}");
}

/// Checks for a usage error: exit status 2, nothing on standard output, these words on standard error.
#[track_caller]
pub fn usage(ran: Ran, words: &str) {
    assert_eq!((ran.code, ran.out.as_str()), (Some(2), ""), "{}", ran.err);
    assert!(ran.err.contains(words), "{:?} not in {:?}", words, ran.err);
}

/// Checks for exit status 0 and nothing on standard error.
#[track_caller]
pub fn done(ran: &Ran) {
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
}

/// Checks what holds for every input: no panic, an exit status of the contract, one line of refusal, and JSON without null.
#[track_caller]
pub fn civil(ran: &Ran, what: &str) {
    assert!(matches!(ran.code, Some(0..=2)), "{what}: {ran:?}");
    assert!(!ran.err.contains("panicked"), "{what}: {ran:?}");
    if ran.code == Some(1) {
        let errors: Vec<&str> = ran.err.lines().filter(|line| !line.starts_with("warning: ")).collect();
        assert_eq!(errors.len(), 1, "{what}: {ran:?}");
        assert!(errors[0].starts_with("error: "), "{what}: {ran:?}");
    }
    for line in ran.out.lines() {
        let value: Value = serde_json::from_str(line).unwrap();
        assert!(has_no_null(&value), "{what}: {line}");
    }
}

/// serde_json writes `null` for NaN and infinity.
pub fn has_no_null(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Array(items) => items.iter().all(has_no_null),
        Value::Object(items) => items.values().all(has_no_null),
        _ => true,
    }
}

pub fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

pub fn vector(value: &Value) -> DVector<f64> {
    numbers(value).into()
}

pub fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j])
}

pub fn texts(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect()
}

#[track_caller]
pub fn close(what: &str, got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{what}: {got} against {want}");
}

pub fn robot(inside: &str) -> String {
    format!(r#"<robot name="r">{inside}</robot>"#)
}

/// Link `a` (root, without inertia), link `b`, and a hinge `j` between them.
pub fn hinged(b: &str) -> String {
    robot(&format!(
        r#"<link name="a"/><link name="b">{b}</link><joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint>"#
    ))
}

/// A link with an inertial, and a joint that hangs it on another link 1 m along x.
pub fn limb(name: &str, parent: &str, kind: &str, more: &str) -> String {
    format!(
        r#"<link name="{name}">{INERTIAL}</link><joint name="{kind}_{name}" type="{kind}">
        <parent link="{parent}"/><child link="{name}"/><origin xyz="1 0 0"/>{more}</joint>"#
    )
}

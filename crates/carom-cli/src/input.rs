//! Input of the commands: robots, JSON lines, vectors on the command line, the order of the joints.

use crate::error::{CliError, LineError, Refused};
use crate::output::{PlainLines, say};
use carom_chain::input::{MESSAGE, MOST_MIB, shortened};
use carom_chain::urdf::{JointType, LoadOptions, Meshes};
use carom_chain::{Chain, Coordinates, FrameId, JointInfo};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command};
use serde::{Deserialize, de::DeserializeOwned};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

// Options of every command that reads a robot.
#[derive(Args)]
pub struct RobotArgs {
    /// Robot (URDF file)
    #[arg(value_name = "ROBOT.urdf")]
    pub urdf: PathBuf,
    /// Add a floating joint `root_joint` between the world and the root link
    ///
    /// Its coordinates come first: q = x y z qx qy qz qw (m, unit quaternion), qd = linear, then
    /// angular velocity of the root link in its own axes (m/s, rad/s).
    #[arg(long, verbatim_doc_comment)]
    pub floating: bool,
    #[command(flatten)]
    pub load: LoadArgs,
}

// How robots are read, for every command that reads one.
#[derive(Args, Clone, Default)]
pub struct LoadArgs {
    /// Leave out collision meshes whose files are missing
    #[arg(long)]
    pub no_meshes: bool,
    /// Refuse what is otherwise a warning about the file
    #[arg(long)]
    pub strict: bool,
    /// Change the robot as little as needed to compute its dynamics, and list every change
    ///
    /// Links that move without mass are welded to the links that carry them; principal moments of
    /// inertia that no body has are raised to the nearest possible ones.
    #[arg(long, verbatim_doc_comment)]
    pub repair: bool,
    /// Folder in which packages (package://NAME/…) are searched for first; may be repeated
    ///
    /// Packages are also searched for in the folder of the robot and those above it, in
    /// ROS_PACKAGE_PATH, and in share/ of AMENT_PREFIX_PATH.
    #[arg(long = "package-dir", value_name = "DIR", verbatim_doc_comment)]
    pub package_dirs: Vec<PathBuf>,
    /// Reflected inertia of the motor's rotor at a joint, kg m² or kg; may be repeated
    ///
    /// N² I for a gear ratio N and a rotor inertia I. It is added to the diagonal of M.
    /// It replaces drake:rotor_inertia and drake:gear_ratio in a <transmission> of the URDF.
    #[arg(long, value_name = "JOINT=INERTIA", value_parser = parse_rotor, verbatim_doc_comment)]
    pub rotor_inertia: Vec<(String, f64)>,
}

/// The options of a subcommand that stand on the command line.
pub struct Given(Vec<String>);

impl Given {
    pub fn of(command: &Command, matches: &ArgMatches) -> Self {
        let Some((name, own)) = matches.subcommand() else { return Self(Vec::new()) };
        let is_given = |arg: &&Arg| own.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
        let options = command.find_subcommand(name).into_iter().flat_map(Command::get_arguments);
        Self(options.filter(is_given).filter_map(|arg| arg.get_long().map(str::to_owned)).collect())
    }

    /// Refuses those of these options that are given, for this reason.
    pub fn refuse(&self, options: &[&str], why: &str) -> Result<(), CliError> {
        let is_given = |option: &&&str| self.0.iter().any(|own| own == **option);
        let found: Vec<String> = options.iter().filter(is_given).map(|it| format!("--{it}")).collect();
        if found.is_empty() { Ok(()) } else { Err(CliError::Input(format!("{}: {why}", found.join(", ")))) }
    }
}

impl RobotArgs {
    /// Reads the robot and prints the first warnings about it.
    pub fn load(&self) -> Result<Chain, CliError> {
        let options = self.load.options(self.floating)?;
        let chain = Chain::from_urdf_file_with(&self.urdf, &options).map_err(|e| CliError::Input(e.to_string()))?;
        tell(&self.urdf.display().to_string(), &chain);
        Ok(chain)
    }

    /// The same, for a command that computes dynamics.
    ///
    /// # Errors
    /// [`CliError::Input`] if links move without mass.
    pub fn load_for_dynamics(&self) -> Result<Chain, CliError> {
        let chain = self.load()?;
        chain.check_dynamics().map_err(|e| CliError::Input(format!("{}: {e}", self.urdf.display())))?;
        Ok(chain)
    }

    /// A frame of the robot, by link name.
    pub fn frame(&self, chain: &Chain, link: &str) -> Result<FrameId, CliError> {
        chain.frame(link).map_err(|e| CliError::Input(format!("{}: --tip: {e}", self.urdf.display())))
    }
}

impl LoadArgs {
    /// # Errors
    /// [`CliError::Input`] for a joint with two rotors.
    pub fn options(&self, floating_base: bool) -> Result<LoadOptions, CliError> {
        let rotors = &self.rotor_inertia;
        if let Some((_, (twin, _))) =
            rotors.iter().enumerate().find(|(k, (name, _))| rotors[..*k].iter().any(|it| it.0 == *name))
        {
            return Err(CliError::Input(format!("--rotor-inertia: joint '{twin}' is named twice")));
        }
        Ok(LoadOptions {
            floating_base,
            meshes: if self.no_meshes { Meshes::Ignored } else { Meshes::WhenUsed },
            strict: self.strict,
            repair: self.repair,
            package_dirs: self.package_dirs.clone(),
            rotor_inertia: rotors.iter().cloned().collect(),
            ..LoadOptions::default()
        })
    }
}

/// Prints the repairs of a robot and the first warnings about it.
pub fn tell(file: &str, chain: &Chain) {
    for line in chain.report().summary(5) {
        say(&format!("warning: {file}: {line}"));
    }
}

/// A joint and a number: `elbow=0.02`.
pub fn parse_rotor(text: &str) -> Result<(String, f64), String> {
    let (joint, number) = text.split_once('=').ok_or("give JOINT=INERTIA, for instance elbow=0.02")?;
    Ok((joint.to_owned(), number.parse().map_err(|_| format!("'{number}' is not a number"))?))
}

/// Three numbers: `x,y,z`.
pub fn parse_vector(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|x| x.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|e| format!("{e}: write three numbers, like 0,0,-9.81"))?;
    if let Some(x) = numbers.iter().find(|x| !x.is_finite()) {
        return Err(format!("{x} is not finite"));
    }
    numbers.try_into().map_err(|n: Vec<f64>| format!("{} numbers, three are needed: x,y,z", n.len()))
}

/// Refuses a number of an option that lies outside its range; `rule` is the message.
pub fn within(option: &str, x: f64, range: RangeInclusive<f64>, rule: &str) -> Result<(), CliError> {
    if range.contains(&x) { Ok(()) } else { Err(CliError::Input(format!("{option} {x}: {rule}"))) }
}

/// Refuses coefficients outside the range that is common to all laws.
pub fn check_coefficients(restitution: f64, friction: f64) -> Result<(), CliError> {
    within("--restitution", restitution, 0.0..=1.0, "a coefficient of restitution lies between 0 and 1")?;
    within("--friction", friction, 0.0..=f64::MAX, "a coefficient of friction is finite and not negative")
}

/// Two numbers in order: `low:high`.
pub fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(':').map(|x| x.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|e| format!("{e}: write two numbers, like 0.3:0.4"))?;
    match numbers.as_slice() {
        [low, high] if low.is_finite() && high.is_finite() && low <= high => Ok([*low, *high]),
        [low, high] => Err(format!("{low} to {high} is no range: the lower number comes first, and both are finite")),
        _ => Err(format!("{} numbers, two are needed: low:high", numbers.len())),
    }
}

/// A line of `--states`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub tau: Option<Vec<f64>>,
    pub qdd: Option<Vec<f64>>,
}

/// The values of an option that takes one of these words.
pub fn words<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let named = move |word: String| all.iter().copied().find(|it| name(*it) == word);
    PossibleValuesParser::new(all.iter().map(|it| name(*it)))
        .map(move |word| named(word).unwrap_or_else(|| unreachable!("the option accepts these words only")))
}

/// The name of a file in messages.
pub fn name(path: &Path) -> String {
    if path == Path::new("-") { "<stdin>".into() } else { path.display().to_string() }
}

/// Answers each JSON line of a file (`-` is standard input), in order; with standard input, flushes after each answer.
///
/// # Errors
/// Stops at the first line that is refused; the answers to the lines above it have been written.
pub fn for_each_line<T: DeserializeOwned>(
    path: &Path,
    out: &mut dyn Write,
    mut answer: impl FnMut(T, &Place, &mut dyn Write) -> Result<(), Refused>,
) -> Result<(), CliError> {
    let (stdin, file) = (path == Path::new("-"), name(path));
    let unreadable = |e| CliError::unreadable(&file, &e);
    let mut reader: Box<dyn BufRead> = if stdin {
        Box::new(io::stdin().lock())
    } else {
        Box::new(BufReader::new(File::open(path).map_err(unreadable)?))
    };
    let mut out = PlainLines(io::BufWriter::new(out)); // above the buffer, which does not know where a line ends
    let mut bytes = Vec::new();
    let mut place = Place { file: file.clone(), line: 0 };
    loop {
        bytes.clear();
        let most = MOST_MIB << 20;
        if reader.by_ref().take(most + 1).read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
            break;
        }
        place.line += 1;
        if bytes.len() as u64 > most {
            let reason = format!("the line is longer than {MOST_MIB} MiB, the limit: write one object on each line");
            return Err(CliError::line(&file, place.line, &reason));
        }
        let text = std::str::from_utf8(&bytes);
        let text =
            text.map_err(|_| unreadable(io::Error::new(io::ErrorKind::InvalidData, "it is no text in UTF-8")))?;
        let text = if place.line == 1 { text.strip_prefix('\u{feff}').unwrap_or(text) } else { text };
        if text.trim().is_empty() {
            continue;
        }
        let parsed = serde_json::from_str(text.trim_end()).map_err(|e| Refused::Input(LineError(shorten(&e))));
        parsed.and_then(|value| answer(value, &place, &mut out)).map_err(|refused| match refused {
            Refused::Input(LineError(reason)) => CliError::line(&file, place.line, &reason),
            Refused::Output(e) => CliError::Output(e),
        })?;
        if stdin {
            out.flush()?;
        }
    }
    Ok(out.flush()?)
}

/// The message of serde without its line number, which counts within this one line and is always 1.
pub fn shorten(error: &serde_json::Error) -> String {
    let text = error.to_string().replace(" at line 1 column ", " at column ");
    shortened(&text, MESSAGE).into_owned()
}

/// File and number of a line.
pub struct Place {
    pub file: String,
    pub line: usize,
}

/// Warns of positions outside the joint limits, once for each joint.
#[derive(Default)]
pub struct LimitWarnings {
    said: std::collections::HashSet<String>,
}

impl LimitWarnings {
    pub fn check(&mut self, chain: &Chain, q: &[f64], place: &Place) {
        for (joint, outside) in chain.outside_limits(q) {
            if self.said.insert(joint.to_owned()) {
                say(&format!("warning: {}:{}: {outside} (said once for this joint)", place.file, place.line));
            }
        }
    }
}

/// The caller's order of the joints, as a permutation of the chain's q and qd.
pub struct JointOrder {
    /// Names, in the caller's order.
    pub names: Vec<String>,
    /// Entry k of the caller's q is entry `q[k]` of the chain's.
    q: Vec<usize>,
    v: Vec<usize>,
}

impl JointOrder {
    /// The caller's list (`--joints a,b,c`), or the order of the file. A floating base that is missing from the list comes first.
    ///
    /// # Errors
    /// [`CliError::Input`] if a name is unknown, fixed, a mimic joint or repeated, or if a moving joint is missing.
    pub fn new(chain: &Chain, urdf: &Path, list: Option<&[String]>) -> Result<Self, CliError> {
        let own: Vec<&JointInfo> = chain.moving_joints().collect();
        let refuse = |why: String| CliError::Input(format!("{}: --joints: {why}", urdf.display()));
        let ordered = match list {
            None => own,
            Some(list) => {
                let mut ordered: Vec<&JointInfo> = Vec::new();
                for name in list {
                    let joint = chain.joint(name).map_err(|e| refuse(e.to_string()))?;
                    match &joint.coordinates {
                        Coordinates::Own { .. } => {}
                        Coordinates::None => return Err(refuse(format!("joint '{name}' is fixed: leave it out"))),
                        Coordinates::Follows { joint, .. } => {
                            return Err(refuse(format!(
                                "joint '{name}' mimics '{joint}' and has no coordinate of its own: leave it out"
                            )));
                        }
                    }
                    if ordered.iter().any(|j| j.name == *name) {
                        return Err(refuse(format!("joint '{name}' is named twice")));
                    }
                    ordered.push(joint);
                }
                let missing: Vec<&JointInfo> =
                    own.into_iter().filter(|j| !ordered.iter().any(|o| o.name == j.name)).collect();
                match missing.as_slice() {
                    [] => {}
                    [base] if base.name == "root_joint" && base.kind == JointType::Floating => ordered.insert(0, base),
                    [joint, ..] => {
                        return Err(refuse(format!(
                            "joint '{}' is not in the list: name every moving joint",
                            joint.name
                        )));
                    }
                }
                ordered
            }
        };
        let mut order = Self { names: Vec::new(), q: Vec::new(), v: Vec::new() };
        for joint in ordered {
            if let Coordinates::Own { q, v } = &joint.coordinates {
                order.names.push(joint.name.clone());
                order.q.extend(q.clone());
                order.v.extend(v.clone());
            }
        }
        Ok(order)
    }

    /// The chain's q from the caller's. A vector of wrong length is returned as it is; the chain refuses it.
    pub fn q(&self, theirs: &[f64]) -> Vec<f64> {
        permute(&self.q, theirs)
    }

    /// The chain's qd, tau or qdd from the caller's.
    pub fn v(&self, theirs: &[f64]) -> Vec<f64> {
        permute(&self.v, theirs)
    }

    /// The caller's order of a vector of length nv.
    pub fn theirs<X: Copy>(&self, ours: &[X]) -> Vec<X> {
        self.v.iter().map(|&i| ours[i]).collect()
    }

    /// The caller's order of the columns of a matrix, as rows of numbers.
    pub fn columns(&self, ours: &nalgebra::DMatrix<f64>) -> Vec<Vec<f64>> {
        ours.row_iter().map(|row| self.v.iter().map(|&j| row[j]).collect()).collect()
    }

    /// The caller's order of both rows and columns.
    pub fn square(&self, ours: &nalgebra::DMatrix<f64>) -> Vec<Vec<f64>> {
        self.v.iter().map(|&i| self.v.iter().map(|&j| ours[(i, j)]).collect()).collect()
    }
}

fn permute(order: &[usize], theirs: &[f64]) -> Vec<f64> {
    if theirs.len() != order.len() {
        return theirs.to_vec();
    }
    let mut ours = vec![0.0; theirs.len()];
    for (&i, &x) in order.iter().zip(theirs) {
        ours[i] = x;
    }
    ours
}

// Options of every command that reads states of a robot.
#[derive(clap::Args)]
pub struct StateArgs {
    /// Contact point in the axes of the link, m
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "0,0,0",
        requires = "tip",
        value_parser = parse_vector,
        allow_hyphen_values = true
    )]
    pub point: [f64; 3],
    /// Order of the joints in all vectors of input and output [default: the order of the file]
    ///
    /// Names every moving joint once; fixed and mimic joints have no coordinates. A floating base
    /// that is not named comes first.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', verbatim_doc_comment)]
    pub joints: Option<Vec<String>>,
    /// States, one JSON object per line; - is standard input
    ///
    /// {"q":[…],"qd":[…]}: positions (rad, m) and velocities (rad/s, m/s). `dynamics` also reads
    /// "tau" (joint forces, N m or N) and "qdd" (accelerations, rad/s² or m/s²). Empty lines are
    /// skipped.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    pub states: PathBuf,
    /// Print one line of JSON for each line of input instead of tables
    #[arg(long)]
    pub json: bool,
}

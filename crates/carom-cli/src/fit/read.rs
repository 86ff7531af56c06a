//! Recorded impacts from files and folders.

use super::{AtRobot, FitCommand, Flights, middle};
use crate::error::{CliError, LineError};
use crate::input::{Given, JointOrder, RobotArgs, for_each_line, name, shorten};
use crate::law::square;
use carom_chain::{Chain, FrameId, FramePoint};
use carom_study::fit::{ChainJump, FitError, Flight, Joined, MeasuredImpact, join_flights, lowest_point, toss_flights};
use carom_study::{Column, Tosses, state_columns};
use nalgebra::SVector;
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::value::RawValue;
use std::io;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JumpLine {
    delassus: Option<Vec<Vec<f64>>>,
    u_minus: Option<Vec<f64>>,
    u_plus: Option<Vec<f64>>,
    q: Option<Vec<f64>>,
    #[serde(alias = "qd")]
    qd_minus: Option<Vec<f64>>,
    qd_plus: Option<Vec<f64>>,
    point: Option<[f64; 3]>,
}

/// What is read of an answer of `carom impact --json`, which is recognised by the name of its law.
#[derive(Deserialize)]
struct Answer {
    law: Option<IgnoredAny>,
    q: Option<Vec<f64>>,
    #[serde(alias = "qd")]
    qd_minus: Option<Vec<f64>>,
    qd_plus: Option<Vec<f64>>,
}

impl JumpLine {
    fn read(text: &str) -> Result<Self, LineError> {
        match serde_json::from_str::<Answer>(text) {
            Ok(Answer { law: Some(_), q, qd_minus, qd_plus }) => {
                if q.is_none() || qd_minus.is_none() || qd_plus.is_none() {
                    let rule = "the answer of `carom impact` needs the keys q, qd_minus and qd_plus";
                    return Err(LineError(rule.into()));
                }
                let (delassus, u_minus, u_plus, point) = (None, None, None, None);
                Ok(Self { delassus, u_minus, u_plus, q, qd_minus, qd_plus, point })
            }
            // a line that is no answer is read, or refused, as a jump
            _ => serde_json::from_str(text).map_err(|e| LineError(shorten(&e))),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FlightLine {
    before: Samples,
    after: Samples,
    point: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Samples {
    t: Vec<f64>,
    q: Vec<Vec<f64>>,
}

/// Flights whose fit misses the samples by more than this many medians are left out: they are not two free flights.
const UNLIKE: f64 = 3.0;

/// The robot of a file of impacts.
struct Robot {
    chain: Chain,
    order: JointOrder,
    tip: Option<FrameId>,
}

fn refuse(e: &FitError) -> LineError {
    LineError(e.to_string())
}

impl AtRobot {
    /// Refuses options about a robot where none is given.
    pub fn refuse(&self, given: &Given) -> Result<(), CliError> {
        if self.robot.is_some() {
            return Ok(());
        }
        let options = [
            "floating",
            "joints",
            "tip",
            "point",
            "normal",
            "no-meshes",
            "strict",
            "repair",
            "package-dir",
            "rotor-inertia",
        ];
        given.refuse(&options, "they are about a robot, which is missing: give --robot ROBOT.urdf")
    }

    fn robot_args(&self) -> Option<RobotArgs> {
        let urdf = self.robot.clone()?;
        Some(RobotArgs { urdf, floating: self.floating, load: self.load.clone() })
    }

    fn robot(&self) -> Result<Option<Robot>, CliError> {
        let Some(args) = self.robot_args() else { return Ok(None) };
        let chain = args.load_for_dynamics()?;
        let order = JointOrder::new(&chain, &args.urdf, self.joints.as_deref())?;
        let tip = self.tip.as_deref().map(|tip| args.frame(&chain, tip)).transpose()?;
        Ok(Some(Robot { chain, order, tip }))
    }

    /// Velocity jumps: one on each line, or in each row of a table.
    pub fn jumps(&self, path: &Path) -> Result<(Vec<MeasuredImpact>, Option<Chain>), CliError> {
        let robot = self.robot()?;
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
            let Some(robot) = robot else {
                let file = name(path);
                return Err(CliError::Input(format!(
                    "{file}: a table has velocities of joints: give --robot and --tip"
                )));
            };
            return Ok((self.table(path, &robot)?, Some(robot.chain)));
        }
        let mut impacts = Vec::new();
        let mut of_robot = false;
        for_each_line(path, &mut io::sink(), |line: Box<RawValue>, _, _| {
            let line = JumpLine::read(line.get())?;
            of_robot |= line.q.is_some();
            impacts.push(self.jump(line, robot.as_ref())?);
            Ok(())
        })?;
        not_empty(path, impacts.len())?;
        if let (Some(args), false) = (self.robot_args(), of_robot) {
            let (file, robot) = (name(path), args.urdf.display());
            return Err(CliError::Input(format!(
                "--robot {robot}: no line of {file} has a q: leave --robot out, or give q, qd_minus, qd_plus instead of delassus"
            )));
        }
        Ok((impacts, robot.map(|robot| robot.chain)))
    }

    /// The rows of a CSV table, whose columns are found by their names.
    fn table(&self, path: &Path, robot: &Robot) -> Result<Vec<MeasuredImpact>, CliError> {
        let file = || path.display().to_string();
        let unreadable = |e: csv::Error| CliError::unreadable(file(), &e.into());
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(unreadable)?;
        let header: Vec<String> = reader.headers().map_err(unreadable)?.iter().map(str::to_owned).collect();
        let find = |name: &str| header.iter().position(|own| own.trim_start_matches('\u{feff}') == name);
        // the columns of each vector in the order of the chain, as tables of `carom simulate` have them
        let columns = state_columns(&robot.chain);
        let (mut q, mut before, mut after) = (Vec::new(), Vec::new(), Vec::new());
        for Column { name, .. } in &columns {
            let needed = |name: &str| {
                let rule = || format!("{}: there is no column '{name}': the columns are {}", file(), header.join(", "));
                find(name).ok_or_else(|| CliError::Input(rule()))
            };
            if let Some(joint) = name.strip_prefix("qd.") {
                let minus = format!("qd_minus.{joint}");
                before.push(find(&minus).or(find(name)).map_or_else(|| needed(&minus), Ok)?);
                after.push(needed(&format!("qd_plus.{joint}"))?);
            } else if name.starts_with("q.") {
                q.push(needed(name)?);
            }
        }
        let point: Option<Vec<usize>> = ["point.x", "point.y", "point.z"].into_iter().map(find).collect();
        let mut impacts = Vec::new();
        for record in reader.records() {
            let record = record.map_err(unreadable)?;
            let line = record.position().map_or(0, |place| place.line() as usize);
            let refuse = |LineError(reason): LineError| CliError::line(file(), line, &reason);
            let numbers = |columns: &[usize]| -> Result<Vec<f64>, LineError> {
                let one = |&k: &usize| {
                    let text = record.get(k).unwrap_or_default();
                    let number = text.parse().ok().filter(|x: &f64| x.is_finite());
                    number.ok_or_else(|| LineError(format!("column {}: '{text}' is not a finite number", header[k])))
                };
                columns.iter().map(one).collect()
            };
            let read = || -> Result<MeasuredImpact, LineError> {
                let point = point.as_deref().map(&numbers).transpose()?;
                let point = point.map(|p| std::array::from_fn(|k| p[k]));
                self.at_chain(robot, numbers(&q)?, numbers(&before)?, numbers(&after)?, point)
            };
            impacts.push(read().map_err(refuse)?);
        }
        not_empty(path, impacts.len())?;
        Ok(impacts)
    }

    /// The impact of a robot, whose vectors have the order of the chain.
    fn at_chain(
        &self,
        robot: &Robot,
        q: Vec<f64>,
        qd_minus: Vec<f64>,
        qd_plus: Vec<f64>,
        point: Option<[f64; 3]>,
    ) -> Result<MeasuredImpact, LineError> {
        let Some(frame) = robot.tip else {
            return Err(LineError("q needs a contact point: give its link with --tip".into()));
        };
        let point = FramePoint::new(frame, point.unwrap_or(self.point));
        let measured = ChainJump { q, qd_minus, qd_plus, point, normal: self.normal.into() };
        MeasuredImpact::of_chain(&robot.chain, &measured).map_err(|e| refuse(&e))
    }

    fn jump(&self, line: JumpLine, robot: Option<&Robot>) -> Result<MeasuredImpact, LineError> {
        let JumpLine { delassus, u_minus, u_plus, q, qd_minus, qd_plus, point } = line;
        match ((delassus, u_minus, u_plus), (q, qd_minus, qd_plus)) {
            ((Some(h), Some(before), Some(after)), (None, None, None)) => {
                if point.is_some() {
                    return Err(LineError("point belongs to q of a robot, not to delassus: leave it out".into()));
                }
                match before.len() {
                    2 => MeasuredImpact::in_plane(
                        square(&h, "u_minus")?,
                        vector("u_minus", &before)?,
                        vector("u_plus", &after)?,
                    ),
                    3 => MeasuredImpact::in_space(
                        square(&h, "u_minus")?,
                        vector("u_minus", &before)?,
                        vector("u_plus", &after)?,
                    ),
                    n => {
                        return Err(LineError(format!(
                            "u_minus has {n} numbers: 2 in the plane (t, n) or 3 in space (t1, t2, n) are needed"
                        )));
                    }
                }
                .map_err(|e| refuse(&e))
            }
            ((None, None, None), (Some(q), Some(before), Some(after))) => {
                let Some(robot) = robot else {
                    return Err(LineError("q needs a robot: give --robot and --tip".into()));
                };
                let order = &robot.order;
                self.at_chain(robot, order.q(&q), order.v(&before), order.v(&after), point)
            }
            _ => Err(LineError(
                "a jump is either delassus, u_minus, u_plus (all three) or q, qd_minus, qd_plus (all three)".into(),
            )),
        }
    }
}

impl FitCommand {
    /// Flights before and after impacts, one pair on each line.
    pub fn flights(
        &self,
        path: &Path,
        told: &mut Flights,
        progress: &dyn Fn(usize, usize),
    ) -> Result<(Vec<MeasuredImpact>, Option<Chain>), CliError> {
        let Some(robot) = self.at.robot()? else {
            let file = name(path);
            return Err(CliError::Input(format!("{file}: flights need a robot: give --robot")));
        };
        let mut impacts = Vec::new();
        // Standard input and pipes are read once, so their number of lines is unknown.
        let lines = if path.is_file() { std::fs::read(path).map_or(0, |it| count_lines(&it)) } else { 0 };
        for_each_line(path, &mut io::sink(), |line: FlightLine, place, _| {
            if lines > 0 {
                progress(place.line - 1, lines);
            }
            let FlightLine { before, after, point } = line;
            let flight = |samples: Samples| Flight {
                times: samples.t,
                poses: samples.q.iter().map(|q| robot.order.q(q)).collect(),
            };
            let joined = join_flights(&robot.chain, self.gravity.into(), &flight(before), &flight(after));
            let joined = joined.map_err(|e| refuse(&e))?;
            let tip = robot.tip.map(|frame| FramePoint::new(frame, point.unwrap_or(self.at.point)));
            impacts.push(self.at_impact(&robot.chain, &joined, tip).map_err(|e| refuse(&e))?);
            told.add(place.line as i64, &joined);
            Ok(())
        })?;
        not_empty(path, impacts.len())?;
        Ok((impacts, Some(robot.chain)))
    }

    fn at_impact(&self, chain: &Chain, joined: &Joined, tip: Option<FramePoint>) -> Result<MeasuredImpact, FitError> {
        let point = match tip {
            Some(tip) => tip,
            None => lowest_point(chain, &joined.q, self.at.normal)?,
        };
        let Joined { q, qd_minus, qd_plus, .. } = joined.clone();
        MeasuredImpact::of_chain(chain, &ChainJump { q, qd_minus, qd_plus, point, normal: self.at.normal.into() })
    }

    /// The first impact of each toss of a folder, from the flights around it.
    pub fn first_impacts(
        &self,
        folder: &Path,
        tosses: &Tosses,
        told: &mut Flights,
        progress: &dyn Fn(usize, usize),
    ) -> Result<Vec<MeasuredImpact>, CliError> {
        let tip = self
            .at
            .tip
            .as_deref()
            .map(|tip| tosses.chain.frame(tip).map(|frame| FramePoint::new(frame, self.at.point)));
        let tip = tip.transpose().map_err(|e| CliError::Input(format!("{}: --tip: {e}", folder.display())))?;
        let all = toss_flights(tosses).map_err(|e| CliError::Input(e.to_string()))?;
        not_empty(folder, all.len())?;
        let count = all.len();
        let mut joined = Vec::new();
        for (done, (number, before, after)) in all.into_iter().enumerate() {
            progress(done, count);
            match join_flights(&tosses.chain, self.gravity.into(), &before, &after) {
                Ok(one) => joined.push((number, one)),
                Err(e) => told.left_out.push((number, e.to_string())),
            }
        }
        let most = UNLIKE * middle(joined.iter().map(|(_, one)| one.rest).collect());
        let mut impacts = Vec::new();
        for (number, one) in joined {
            if one.rest > most {
                let why =
                    format!("the fit of its flights misses the samples by {} m, more than {UNLIKE} medians", one.rest);
                told.left_out.push((number, why));
                continue;
            }
            match self.at_impact(&tosses.chain, &one, tip) {
                Ok(impact) => {
                    impacts.push(impact);
                    told.add(number, &one);
                }
                Err(e @ FitError::NoApproach { .. }) => told.left_out.push((number, e.to_string())),
                Err(e) => return Err(CliError::Input(format!("{}: toss {number}: {e}", folder.display()))),
            }
        }
        Ok(impacts)
    }
}

fn count_lines(text: &[u8]) -> usize {
    text.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()).count()
}

fn not_empty(path: &Path, found: usize) -> Result<(), CliError> {
    if found > 0 {
        return Ok(());
    }
    Err(CliError::Input(format!("{}: it holds no impacts: give at least one", name(path))))
}

fn vector<const D: usize>(what: &str, numbers: &[f64]) -> Result<SVector<f64, D>, LineError> {
    if numbers.len() != D {
        return Err(LineError(format!("{what} has {} numbers, u_minus has {D}: give as many", numbers.len())));
    }
    Ok(SVector::from_column_slice(numbers))
}

//! The robots of a scene: `[robot]`, or one `[[robot]]` for each of several, with their beams (`[[robot.beam]]`: links that bend) and
//! their velocities at the start.

use super::drive::{Drives, World, positions};
use super::file::{Beam, Control, Member, Robots, Target, TipVelocity};
use super::keys::{Keys, TIP};
use super::refuse;
use super::surface::half_space;
use crate::contact::Surface;
use crate::error::SimError;
use crate::model::{Drive, RobotDrive, Simulation, Spring};
use crate::state::EXACT;
use carom_chain::urdf::{self, JointType, LoadOptions, Robot};
use carom_chain::{Chain, ChainError, FramePoint, Placed};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// The loaded robots.
pub(crate) struct Loaded {
    /// All robots as one chain.
    pub chain: Chain,
    /// Configuration of all robots at the start.
    pub q: Vec<f64>,
    robots: Vec<One>,
}

/// A robot as it is read from its file: the chain, and the springs of its beams.
#[derive(Debug, Clone)]
pub struct Body {
    pub(super) chain: Chain,
    springs: Vec<Spring>,
}

/// One robot.
struct One {
    /// Its name; `None` for `[robot]`, whose links and joints have no prefix.
    name: Option<String>,
    /// The heading of its table, for messages.
    table: String,
    chain: Chain,
    q: Vec<f64>,
    /// The springs of its beams.
    springs: Vec<Spring>,
    given: Member,
}

impl Robots {
    /// Loads the robots, or takes these, and places them.
    pub fn load(self, folder: &Path, bodies: Option<&[Body]>) -> Result<Loaded, SimError> {
        let named = self.named;
        let robots = self.all.into_iter().enumerate().map(|(k, it)| {
            let name = named.then(|| it.place.name.clone());
            One::load(folder, it, name, bodies.and_then(|all| all.get(k)))
        });
        let robots = robots.collect::<Result<Vec<_>, _>>()?;
        let [first, ..] = robots.as_slice() else {
            return Err(refuse("[[robot]] is empty: give one table for each robot".into()));
        };
        let chain = match first.name {
            None => first.chain.clone(),
            Some(_) => {
                let names: Vec<&str> = robots.iter().filter_map(|it| it.name.as_deref()).collect();
                let placed = robots.iter().zip(&names).map(|(it, name)| it.placed(name));
                let joined = Chain::join(&names.join(", "), &placed.collect::<Vec<_>>());
                joined.map_err(|e| refuse(format!("[[robot]] {e}")))?
            }
        };
        let q = robots.iter().flat_map(|it| &it.q).copied().collect();
        Ok(Loaded { chain, q, robots })
    }
}

impl Body {
    /// What of the tables `[robot]` or `[[robot]]` the robots depend on: all keys but those of the start, the place and the controller.
    pub fn keys(robot: &toml::Value) -> Vec<toml::Table> {
        let others = [Control::names(), vec!["q", "qd", "tip_velocity", "tip", "position", "rpy"]].concat();
        let part = |table: &toml::Table| {
            let kept = table.iter().filter(|(key, _)| !others.contains(&key.as_str()));
            kept.map(|(key, value)| (key.clone(), value.clone())).collect()
        };
        match robot {
            toml::Value::Array(all) => all.iter().filter_map(toml::Value::as_table).map(part).collect(),
            one => one.as_table().map(part).into_iter().collect(),
        }
    }

    fn read(
        folder: &Path,
        given: &Member,
        name: Option<&str>,
        said: &impl Fn(String) -> SimError,
    ) -> Result<Self, SimError> {
        let (file, options) = given.load.options(folder).map_err(said)?;
        if given.start.srdf.as_ref().is_some_and(|file| file.as_os_str().is_empty()) {
            return Err(said("srdf is empty: give the path of the file".into()));
        }
        let srdf = given.start.srdf.as_ref().map(|file| folder.join(file));
        let options = LoadOptions { floating_base: given.start.floating, srdf, ..options };
        let robot = urdf::read_file(file, &options)?;
        let (robot, springs) = divided(robot, &given.start.beam, &|joint| full(name, joint))?;
        let chain = Chain::from_robot(robot, &options).with_rotors(&options)?;
        let chain =
            given.start.effort.iter().try_fold(chain, |chain, (joint, limit)| chain.with_effort_limit(joint, *limit));
        let chain = chain.map_err(|why| said(format!("effort: {why}")))?;
        chain.check_dynamics()?;
        Ok(Self { chain, springs })
    }
}

impl One {
    fn load(folder: &Path, given: Member, name: Option<String>, body: Option<&Body>) -> Result<Self, SimError> {
        let table = name.as_ref().map_or_else(|| "[robot]".to_owned(), |name| format!("[[robot]] '{name}'"));
        let said = |why: String| refuse(format!("{table} {why}"));
        let Body { chain, springs } = match body {
            Some(body) => body.clone(),
            None => Body::read(folder, &given, name.as_deref(), &said)?,
        };
        let q = start(&chain, &given).map_err(said)?;
        let robot = Self { name, table, chain, q, springs, given };
        robot.checked(robot.chain.check_state(&robot.q, &vec![0.0; robot.chain.nv()]))?;
        Ok(robot)
    }

    /// An error of the state, with the name of the robot where there are several.
    fn checked<T>(&self, done: Result<T, ChainError>) -> Result<T, SimError> {
        done.map_err(|e| if self.name.is_some() { refuse(format!("{} {e}", self.table)) } else { e.into() })
    }

    fn placed<'a>(&'a self, name: &'a str) -> Placed<'a> {
        // The place of a floating robot is in its q.
        let pose = if self.given.start.floating { Isometry3::identity() } else { pose(&self.given) };
        Placed { name, chain: &self.chain, pose }
    }

    fn full(&self, own: &str) -> String {
        full(self.name.as_deref(), own)
    }
}

/// The name of a link or joint of a robot in the chain of all robots.
fn full(robot: Option<&str>, own: &str) -> String {
    robot.map_or_else(|| own.to_owned(), |name| format!("{name}/{own}"))
}

fn pose(given: &Member) -> Isometry3<f64> {
    let [roll, pitch, yaw] = *given.place.rpy.unwrap_or_default();
    let position = Translation3::from(Vector3::from(given.place.position.unwrap_or_default()));
    Isometry3::from_parts(position, UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

/// Configuration of a robot at the start.
fn start(chain: &Chain, given: &Member) -> Result<Vec<f64>, String> {
    let numbers = [given.place.position, given.place.rpy].into_iter().flatten().flat_map(|it| *it);
    if let Some(x) = numbers.into_iter().find(|x| !x.is_finite()) {
        return Err(format!("position and rpy have the number {x}: every number must be finite"));
    }
    let placed = given.place.position.is_some() || given.place.rpy.is_some();
    let base = if given.start.floating && !given.place.name.is_empty() {
        let pose = pose(given);
        [pose.translation.vector.as_slice(), pose.rotation.coords.as_slice()].concat()
    } else {
        Vec::new()
    };
    let lengths = [chain.nq(), chain.nq() - base.len()];
    let q = match &given.start.q {
        Some(Target::Each(q)) => Some(straight(q.clone(), &given.start.beam, &lengths)),
        Some(by_name) => {
            let mut rest = chain.zero_configuration();
            rest[..base.len()].copy_from_slice(&base);
            Some(positions("q", by_name, chain, &rest)?)
        }
        None => None,
    };
    let is_list = matches!(given.start.q, Some(Target::Each(_)));
    match &q {
        None => Ok(chain.zero_configuration().iter().enumerate().map(|(k, x)| *base.get(k).unwrap_or(x)).collect()),
        Some(q) if !base.is_empty() && q.len() + base.len() == chain.nq() => Ok([base.as_slice(), q].concat()),
        Some(q) if !base.is_empty() && q.len() == chain.nq() && placed && is_list => Err(format!(
            "q has {} numbers, of which the first seven are the pose of the floating base, which position and rpy also give: \
             give one of them",
            q.len()
        )),
        Some(q) if !given.start.floating && q.len() == chain.nq() + 7 => {
            let wrong = chain.check_state(q, &vec![0.0; chain.nv()]);
            let wrong = wrong.err().map_or_else(String::new, |e| e.to_string());
            Err(format!("{wrong}; a floating base, which has seven of them, needs floating = true"))
        }
        Some(q) => Ok(q.clone()),
    }
}

impl Loaded {
    /// Refuses effort limits of robots in a scene whose motors have none.
    pub fn check_efforts(&self, are_limited: bool) -> Result<(), String> {
        match self.robots.iter().find(|robot| !robot.given.start.effort.is_empty() && !are_limited) {
            Some(One { table, .. }) => {
                Err(format!("{table} effort is read with [run] effort_limits = true only: set it, or remove effort"))
            }
            None => Ok(()),
        }
    }

    /// The robots as they were read.
    pub fn bodies(&self) -> Vec<Body> {
        self.robots.iter().map(|it| Body { chain: it.chain.clone(), springs: it.springs.clone() }).collect()
    }

    /// The springs of all beams.
    pub fn springs(&self) -> impl Iterator<Item = &Spring> {
        self.robots.iter().flat_map(|it| &it.springs)
    }

    /// Joint velocities of all robots at the start.
    pub fn velocities(&self, surfaces: &[Surface], has_loops: bool) -> Result<Vec<f64>, SimError> {
        let (mut all, mut from) = (Vec::with_capacity(self.chain.nv()), 0);
        for robot in &self.robots {
            let nv = robot.chain.nv();
            let own = match (&robot.given.start.qd, &robot.given.start.tip_velocity) {
                (Some(qd), None) => straight(qd.clone(), &robot.given.start.beam, &[nv]),
                (None, None) => vec![0.0; nv],
                (Some(_), Some(_)) => {
                    return Err(refuse(format!("{} has both qd and tip_velocity: give one of them", robot.table)));
                }
                (None, Some(_)) if has_loops => {
                    let why = "tip_velocity cannot be combined with [[loop]], which changes it: give qd instead";
                    return Err(refuse(format!("{} {why}", robot.table)));
                }
                (None, Some(tip)) => {
                    let link = robot.full(&robot.given.load.tip);
                    let found = tip_velocity((&self.chain, &self.q), &link, tip, surfaces.first());
                    found.map_err(|why| refuse(format!("{} {why}", robot.table)))?[from..from + nv].to_vec()
                }
            };
            robot.checked(robot.chain.check_state(&robot.q, &own))?;
            all.extend(own);
            from += nv;
        }
        Ok(all)
    }

    /// The drive, and that after the first impact. `run` is the controller of `[run]`.
    pub fn drives(
        &self,
        folder: &Path,
        run: &Control,
        surfaces: &[Surface],
        qd: &[f64],
    ) -> Result<(Drive, Option<Drive>), String> {
        let (world, asks, name) = (World { chain: &self.chain, q: &self.q, qd }, "", "");
        let own: Vec<&Control> = self.robots.iter().map(|robot| &robot.given.control).collect();
        if own.iter().all(|it| it.given.is_empty()) {
            // One controller for everything.
            let tip = self.robots.first().filter(|it| it.name.is_none()).map(|it| it.given.load.tip.as_str());
            let (q, chain) = (&self.q, &self.chain);
            let (table, control, tip_in_world) = ("[run]", run, tip);
            return Drives { asks, name, folder, table, control, chain, q, tip, tip_in_world, surfaces, world }.both();
        }
        if !run.given.is_empty() {
            return Err("[run] has keys of a controller, and so has a [[robot]]: give each robot its own".into());
        }
        let mut drives = Vec::new();
        for (robot, control) in self.robots.iter().zip(&own) {
            let One { table, chain, q, given, .. } = robot;
            let full = robot.full(&given.load.tip);
            let (tip, tip_in_world) = (Some(given.load.tip.as_str()), Some(full.as_str()));
            let of = Drives { asks, name, folder, table, control, chain, q, tip, tip_in_world, surfaces, world };
            let both = of.both()?;
            for drive in std::iter::once(&both.0).chain(&both.1) {
                drive.check(chain).map_err(|e| format!("{table} {e}"))?;
            }
            drives.push(both);
        }
        let lengths = (self.chain.nq(), self.chain.nv());
        let members = drives.into_iter().zip(self.chain.members()).map(|((drive, after), member)| RobotDrive {
            robot: member.name.clone(),
            v: member.v.clone(),
            drive: drive.of_member(member, lengths),
            after_impact: after.map(|after| after.of_member(member, lengths)),
        });
        Ok((Drive::Robots(members.collect()), None))
    }

    /// The link that is the tip: that of the first robot that has one.
    ///
    /// # Errors
    /// A key `tip` that names no link.
    pub fn tip(&self) -> Result<Option<String>, String> {
        let mut first = None;
        for robot in &self.robots {
            let name = &robot.given.load.tip;
            match robot.chain.frame(name) {
                Ok(_) => first = first.or(Some(robot.full(name))),
                Err(_) if *name == TIP => {}
                Err(unknown) => return Err(format!("{} tip = \"{name}\": {unknown}", robot.table)),
            }
        }
        Ok(first)
    }

    /// Warnings about gravity compensation, which holds no floating base.
    pub fn falling(&self, simulation: &Simulation) -> Vec<String> {
        let compensates = |name: Option<&str>| {
            let mut own =
                simulation.drives().flat_map(Drive::each_robot).filter(|(robot, _)| robot.is_none() || *robot == name);
            own.any(|(_, drive)| matches!(drive, Drive::GravityCompensation))
        };
        let falls = |robot: &One| {
            let mut joints = robot.chain.joints().iter();
            let base = joints.find(|joint| joint.kind == JointType::Floating)?;
            let table = robot.name.as_ref().map_or("[run]", |_| robot.table.as_str());
            compensates(robot.name.as_deref()).then(|| {
                format!(
                    "{table} controller = \"gravity-compensation\" drives joints only: nothing but contacts holds the \
                     floating joint '{}', so the robot falls",
                    base.name
                )
            })
        };
        self.robots.iter().filter_map(falls).collect()
    }
}

/// The robot with its beams divided into segments, and the springs of the bends; `name` gives the name of a joint in the chain.
fn divided(
    mut robot: Robot,
    beams: &[Beam],
    name: &impl Fn(&str) -> String,
) -> Result<(Robot, Vec<Spring>), ChainError> {
    let mut springs = Vec::new();
    for it in beams {
        let stiffness = it.bending.iter().map(|bending| (bending.axis.into(), bending.stiffness)).collect();
        let beam = urdf::Beam { ends: [it.from.into(), it.to.into()], bends: it.bends, stiffness };
        let bends: Vec<urdf::Bend>;
        (robot, bends) = robot.with_segments(&it.link, &beam)?;
        springs.extend(bends.into_iter().map(|bend| Spring {
            joint: name(&bend.joint),
            rest: 0.0,
            stiffness: bend.stiffness,
            damping: it.damping * bend.stiffness,
        }));
    }
    Ok((robot, springs))
}

/// `numbers`, with zeros for the bends at its end if it is shorter by them than one of `lengths`.
fn straight(mut numbers: Vec<f64>, beams: &[Beam], lengths: &[usize]) -> Vec<f64> {
    let bends: usize = beams.iter().map(|it| it.bends * it.bending.len()).sum();
    let whole = numbers.len() + bends;
    if !lengths.contains(&numbers.len()) && lengths.contains(&whole) {
        numbers.resize(whole, 0.0);
    }
    numbers
}

/// The joint velocities that give the tip its velocity.
fn tip_velocity(
    (chain, q): (&Chain, &[f64]),
    link: &str,
    tip: &TipVelocity,
    surface: Option<&Surface>,
) -> Result<Vec<f64>, String> {
    let say = |e: ChainError| format!("tip_velocity: {e}");
    let velocity = match (tip.velocity, tip.speed, tip.angle_deg, tip.along) {
        (Some(velocity), None, None, None) => Vector3::from(velocity),
        (None, Some(speed), Some(angle), Some(along)) => towards((speed, angle, *along), surface)?,
        _ => return Err("tip_velocity needs velocity, or speed, angle_deg and along: give one of both".into()),
    };
    let point = FramePoint::from(chain.frame(link).map_err(say)?);
    let mut workspace = chain.workspace();
    let found = workspace.update(chain, q).and_then(|mut at| at.tool_velocity(point, velocity, tip.motion.0));
    Ok(found.map_err(say)?.as_slice().to_vec())
}

/// The velocity of this speed and angle to the first surface.
fn towards((speed, angle, along): (f64, f64, [f64; 3]), surface: Option<&Surface>) -> Result<Vector3<f64>, String> {
    let Some(normal) = half_space(surface) else {
        return Err("tip_velocity with an angle is relative to the first surface, which must be a halfspace: give \
                    tip_velocity.velocity or qd instead"
            .into());
    };
    if !(speed.is_finite() && angle.is_finite()) {
        return Err(format!("tip_velocity: speed {speed} and angle_deg {angle} must be finite"));
    }
    let alpha = angle.to_radians();
    let along = Vector3::from(along);
    let shadow = (along - normal * normal.dot(&along)).try_normalize(EXACT);
    if shadow.is_none() && alpha.cos().abs() > EXACT {
        let [x, y, z] = along.into();
        return Err(format!(
            "tip_velocity: along = [{x}, {y}, {z}] is normal to the surface: give a direction along the surface"
        ));
    }
    Ok((shadow.unwrap_or_default() * alpha.cos() - normal * alpha.sin()) * speed)
}

//! A landing of one leg: the robot with what its URDF lacks, its state before the landing, and the run to the end of the window.
//!
//! | part | model | source |
//! | --- | --- | --- |
//! | toe | two balls of 0.1 mm at the ends of the line along which it touches | the collision shapes of Cassie's URDF, where they have radius 0 |
//! | rotors | reflected inertia of each motor | MuJoCo Menagerie, `agility_cassie/cassie.xml`, `armature` |
//! | rod from thigh to spring of the heel | a link with two hinges at the thigh, which a loop joins to the spring | mass and inertia: the same file |
//! | springs of knee and heel | joints with 1500 and 1250 N m/rad | the same file |
//! | motors | the measured torques, and the damping of the URDF | the table |
//!
//! The floor is at the height of the toe's lowest point at the sample of the landing, but below both toes at the start.

use super::super::candidates::{Candidate, Effect, Parameter};
use super::super::scenes::rule;
use super::log::{JOINTS, Log, MEASURED, MOTORS, SAMPLE, SIDES, SPRINGS, Sample, of_side};
use carom_chain::urdf::{Collision, Inertial, Joint, JointType, Limits, Link, LoadOptions, Robot, Shape};
use carom_chain::{Chain, ChainError, Coordinates};
use carom_contact::Obstacle;
use carom_sim::{
    Drive, Loop, LoopFrame, LoopJoint, Sampling, Seen, SimError, Simulation, Spring, Surface, TorqueTable, Touch,
};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Samples from the landing to the middle of those by which a jump is measured: 7 and 5 ms. The first is fitted.
pub(super) const WINDOWS: [usize; 2] = [14, 10];
/// Samples from the start of a run to the landing.
const AHEAD: usize = 2;
/// Radius of the balls of a toe, m.
pub(super) const BALL: f64 = 1e-4;
/// Reflected inertia of the rotors of [`MOTORS`], kg m².
const ROTORS: [f64; MOTORS.len()] = [0.038125, 0.038125, 0.09344, 0.09344, 0.01225];
/// Stiffness of [`SPRINGS`], N m/rad.
const STIFFNESS: [f64; 2] = [1500.0, 1250.0];
/// Ends of a rod: on the thigh of each side, and on the spring of the heel, m.
const THIGH: [Vector3<f64>; 2] = [Vector3::new(0.0, 0.0, 0.045), Vector3::new(0.0, 0.0, -0.045)];
const HEEL: Vector3<f64> = Vector3::new(0.11877, -0.01, 0.0);
/// Ends of the line along which a toe touches, m.
const TOE: [Vector3<f64>; 2] = [Vector3::new(-0.0457, 0.112, 0.0), Vector3::new(0.088, 0.0, 0.0)];
/// A rod: mass (kg), centre along its axis x (m), principal moments of inertia (kg m²).
const ROD: (f64, f64, [f64; 3]) = (0.1567, 0.24719, [3.754e-6, 0.004487, 0.004488]);
/// The link between the two hinges of a rod: mass and moments of inertia, small beside those of the rod.
const BETWEEN: (f64, [f64; 3]) = (1e-3, [1e-6; 3]);
/// Gravity, m/s².
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// The robot with its rods, whose joints do not reach their limits within a landing.
pub(super) fn with_rods(robot: &Robot) -> Result<Chain, String> {
    let mut robot = robot.clone();
    for joint in &mut robot.joints {
        if joint.kind == JointType::Revolute {
            (joint.kind, joint.limits) = (JointType::Continuous, Limits::default());
        }
    }
    for (side, thigh) in THIGH.iter().enumerate() {
        let link = |name: &str| {
            let name = of_side(name, side);
            let found = robot.links.iter().position(|link| link.name == name);
            found.ok_or_else(|| {
                format!("it has no link '{name}', which the model of a landing needs: give it this name")
            })
        };
        let [parent, toe, _] = [link("thigh")?, link("toe")?, link("heel_spring")?];
        let ball = |end: Vector3<f64>| {
            let origin = Isometry3::translation(end.x, end.y, end.z);
            Collision { name: None, origin, shape: Shape::Sphere { radius: BALL } }
        };
        robot.links[toe].collisions = TOE.map(ball).into();
        let turn = hang(&mut robot, parent, ("rod_z", side), *thigh, Vector3::z(), (BETWEEN.0, 0.0, BETWEEN.1));
        hang(&mut robot, turn, ("rod_y", side), Vector3::zeros(), Vector3::y(), ROD);
    }
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    let chain = Chain::from_robot(robot, &options);
    chain.check_dynamics().map_err(|e| e.to_string())?;
    Ok(chain)
}

/// Adds a link on a hinge; joint and link have the same name. The link's index.
fn hang(
    robot: &mut Robot,
    parent: usize,
    (name, side): (&str, usize),
    place: Vector3<f64>,
    axis: Vector3<f64>,
    (mass, centre, moments): (f64, f64, [f64; 3]),
) -> usize {
    let (name, child) = (of_side(name, side), robot.links.len());
    let inertia_at_com = Matrix3::from_diagonal(&moments.into());
    let inertial = Some(Inertial { mass, com: Vector3::x() * centre, inertia_at_com });
    robot.links.push(Link { inertial, ..Link::new(&name) });
    robot.joints.push(Joint {
        origin: Isometry3::translation(place.x, place.y, place.z),
        axis: nalgebra::Unit::new_normalize(axis),
        ..Joint::new(name, JointType::Continuous, parent, child)
    });
    child
}

/// The first entries of q and qd of a joint.
fn at(chain: &Chain, joint: &str) -> Result<(usize, usize), ChainError> {
    match &chain.joint(joint)?.coordinates {
        Coordinates::Own { q, v } => Ok((q.start, v.start)),
        _ => unreachable!("the joints of a landing are hinges: see check_joints"),
    }
}

/// A landing of one leg.
#[derive(Debug, Clone)]
pub(super) struct Landing {
    /// Index of its log.
    pub log: usize,
    /// Line of the table at which it lands.
    pub line: usize,
    /// The state at the start: the configuration two samples before the landing, and the mean velocities of the three samples before it.
    q: Vec<f64>,
    qd: Vec<f64>,
    /// Height of the floor, m.
    floor: f64,
    /// Lengths of the rods, m.
    rods: [f64; 2],
    /// Torques of the motors at the samples from the start.
    torques: Vec<Vec<f64>>,
    /// Entries of qd of the measured joints of the leg that lands.
    joints: [usize; MEASURED],
    /// The mean of their measured velocities over the three samples around the middle of each window, rad/s.
    after: [[f64; MEASURED]; WINDOWS.len()],
}

impl Landing {
    /// The landing of a side of a log; `None` without one, and too near an end of the log.
    pub fn of(chain: &Chain, (number, log): (usize, &Log), side: usize) -> Result<Option<Self>, ChainError> {
        let whole = |k: &usize| *k > AHEAD && k + WINDOWS[0] + 1 < log.samples.len();
        log.landing(side).filter(whole).map(|k| Self::at_sample(chain, (number, log), side, k)).transpose()
    }

    /// The landing of a side at the sample `k`.
    pub fn at_sample(chain: &Chain, (number, log): (usize, &Log), side: usize, k: usize) -> Result<Self, ChainError> {
        let start = &log.samples[k - AHEAD];
        let (q, mut qd) = (configuration(chain, start)?, vec![0.0; chain.nv()]);
        let back = start.turn.inverse();
        let velocity = Vector3::from(log.mean(k - 3, k - 1, |it| it.velocity.into()));
        let spin = Vector3::from(log.mean(k - 3, k - 1, |it| it.spin.into()));
        qd[..3].copy_from_slice((back * velocity).as_slice());
        qd[3..6].copy_from_slice((back * spin).as_slice());
        for (side, _) in SIDES.iter().enumerate() {
            let rates = log.mean(k - 3, k - 1, |it| it.legs[side].rates);
            for (joint, rate) in JOINTS.iter().zip(rates) {
                qd[at(chain, &of_side(joint, side))?.1] = rate;
            }
        }
        let torques = |it: &Sample| -> Result<Vec<f64>, ChainError> {
            let mut torques = vec![0.0; chain.nv()];
            for (side, leg) in it.legs.iter().enumerate() {
                for (motor, torque) in MOTORS.iter().zip(leg.torques) {
                    torques[at(chain, &of_side(JOINTS[*motor], side))?.1] = torque;
                }
            }
            Ok(torques)
        };
        let mut joints = [0; MEASURED];
        for (entry, joint) in joints.iter_mut().zip(JOINTS) {
            *entry = at(chain, &of_side(joint, side))?.1;
        }
        let measured = |window: usize| {
            let rates = log.mean(k + window - 1, k + window + 1, |it| it.legs[side].rates);
            std::array::from_fn(|joint| rates[joint])
        };
        let landed = lowest(chain, &configuration(chain, &log.samples[k])?, side)?;
        let both = lowest(chain, &q, 0)?.min(lowest(chain, &q, 1)?);
        let mut landing = Self {
            log: number,
            line: log.samples[k].line,
            q,
            qd,
            floor: landed.min(both - 2.0 * BALL) - BALL,
            rods: [0.0; 2],
            torques: log.samples[k - AHEAD..].iter().take(END + 1).map(torques).collect::<Result<_, _>>()?,
            joints,
            after: WINDOWS.map(measured),
        };
        for side in 0..SIDES.len() {
            landing.close_rod(chain, side)?;
        }
        Ok(landing)
    }

    /// Velocity of the heel's spring, which has no encoder, from the length of the rod; angles and velocities of the rod.
    ///
    /// With the vector r from the thigh to the heel in the axes of the thigh, ℓ = |r|: the rod's hinges are at atan2(r_y, r_x) and
    /// −asin(r_z/ℓ).
    fn close_rod(&mut self, chain: &Chain, side: usize) -> Result<(), ChainError> {
        let spring = at(chain, &of_side(JOINTS[SPRINGS[1]], side))?.1;
        let (thigh, heel) = (chain.frame(&of_side("thigh", side))?, chain.frame(&of_side("heel_spring", side))?);
        let (upper, lower) = (chain.point(thigh, THIGH[side]), chain.point(heel, HEEL));
        let mut workspace = chain.workspace();
        let kin = workspace.update(chain, &self.q)?;
        let along = kin.position(lower) - kin.position(upper);
        let apart = |qd: &[f64]| -> Result<Vector3<f64>, ChainError> {
            Ok(kin.point_velocity(lower, qd)? - kin.point_velocity(upper, qd)?)
        };
        let mut alone = vec![0.0; chain.nv()];
        alone[spring] = 1.0;
        self.qd[spring] -= along.dot(&apart(&self.qd)?) / along.dot(&apart(&alone)?);
        let back = kin.pose(thigh).rotation.transpose();
        let r = back * along;
        let rate = back * (apart(&self.qd)? - kin.angular_velocity(thigh, &self.qd)?.cross(&along));
        let (length, flat) = (r.norm(), r.xy().norm());
        let turns = [
            ("rod_z", r.y.atan2(r.x), (r.x * rate.y - r.y * rate.x) / (flat * flat)),
            ("rod_y", -(r.z / length).asin(), -rate.z / flat),
        ];
        for (joint, angle, rate) in turns {
            let (q, v) = at(chain, &of_side(joint, side))?;
            (self.q[q], self.qd[v]) = (angle, rate);
        }
        self.rods[side] = length;
        Ok(())
    }

    /// The simulation of a model with the parameters `x`.
    fn simulation(&self, chain: &Chain, model: &Candidate, x: &[f64], tolerance: f64) -> Result<Simulation, SimError> {
        let has = |effect| model.effects.contains(&effect);
        let drive = model.value(Parameter::ToeInertia, x).unwrap_or_default();
        let mut chain = chain.clone();
        let (mut springs, mut loops) = (Vec::new(), Vec::new());
        for side in 0..SIDES.len() {
            for (motor, inertia) in MOTORS.iter().zip(ROTORS).filter(|_| has(Effect::Rotors)) {
                let more = if JOINTS[*motor] == "toe" { drive } else { 0.0 };
                chain = chain.with_rotor_inertia(&of_side(JOINTS[*motor], side), inertia + more)?;
            }
            for (spring, stiffness) in SPRINGS.iter().zip(STIFFNESS).filter(|_| has(Effect::Springs)) {
                springs.push(Spring { joint: of_side(JOINTS[*spring], side), rest: 0.0, stiffness, damping: 0.0 });
            }
            if has(Effect::Rods) {
                let end = LoopFrame::new(Some(&of_side("rod_y", side)), Vector3::x() * self.rods[side], [0.0; 3]);
                let heel = LoopFrame::new(Some(&of_side("heel_spring", side)), HEEL, [0.0; 3]);
                loops.push(Loop { name: of_side("rod", side), joint: LoopJoint::Point, frames: [end, heel] });
            }
        }
        let obstacle = Obstacle::half_space(Vector3::z() * self.floor, Vector3::z())?;
        let floor = Surface { name: "floor".into(), obstacle, contact: rule(model, x), motion: None };
        let touches = Touch::all(&chain, &[floor], 0.0)?.touches;
        let times = (0..self.torques.len()).map(|k| k as f64 * SAMPLE).collect();
        let drive = if has(Effect::Springs) {
            Drive::Table(TorqueTable { times, forces: self.torques.clone() })
        } else {
            Drive::Off
        };
        let zeno_time = Simulation::zeno_time_for(tolerance);
        Ok(Simulation {
            gravity: GRAVITY,
            drive,
            springs,
            loops,
            tolerance,
            zeno_time,
            several: model.several,
            ..Simulation::new(chain, touches)
        })
    }

    /// The errors of the predicted jumps of the measured joint velocities in each window, rad/s; `None` where the run is refused.
    pub fn errors(
        &self,
        chain: &Chain,
        model: &Candidate,
        x: &[f64],
        tolerance: f64,
    ) -> Option<[[f64; MEASURED]; WINDOWS.len()]> {
        let simulation = self.simulation(chain, model, x, tolerance).ok()?;
        let mut rates: Vec<[f64; MEASURED]> = Vec::new();
        let mut keep = |seen: Seen<'_>| {
            if let Seen::Moment(moment) = seen {
                rates.push(self.joints.map(|v| moment.qd[v]));
            }
        };
        let sampling = Sampling { every: Some(SAMPLE), ..Sampling::default() };
        let summary = simulation.stream(&self.q, &self.qd, END as f64 * SAMPLE, sampling, &mut keep).ok()?;
        // by rounding, the last sample may lie beyond the end
        rates.truncate(END);
        rates.push(self.joints.map(|v| summary.last.qd[v]));
        let error = |window: usize, joint: usize| {
            let simulated = &rates[AHEAD + WINDOWS[window] - 1..=AHEAD + WINDOWS[window] + 1];
            simulated.iter().map(|rates| rates[joint]).sum::<f64>() / 3.0 - self.after[window][joint]
        };
        Some(std::array::from_fn(|window| std::array::from_fn(|joint| error(window, joint))))
    }

    /// Root mean square of the measured jumps in a window, rad/s.
    pub fn jump(&self, window: usize) -> f64 {
        rms(&std::array::from_fn(|joint| self.after[window][joint] - self.qd[self.joints[joint]]))
    }
}

/// Number of sampling intervals of a run.
const END: usize = AHEAD + WINDOWS[0] + 1;

/// Root mean square.
pub(super) fn rms(values: &[f64; MEASURED]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / MEASURED as f64).sqrt()
}

/// The configuration at a sample, with the rods along their axes.
pub(super) fn configuration(chain: &Chain, sample: &Sample) -> Result<Vec<f64>, ChainError> {
    let mut q = chain.zero_configuration();
    q[..3].copy_from_slice(sample.position.as_slice());
    q[3..7].copy_from_slice(sample.turn.coords.as_slice());
    for (side, leg) in sample.legs.iter().enumerate() {
        for (joint, angle) in JOINTS.iter().zip(leg.angles) {
            q[at(chain, &of_side(joint, side))?.0] = angle;
        }
    }
    Ok(q)
}

/// Height of the lower end of the line of a toe.
pub(super) fn lowest(chain: &Chain, q: &[f64], side: usize) -> Result<f64, ChainError> {
    let frame = chain.frame(&of_side("toe", side))?;
    let mut workspace = chain.workspace();
    let kin = workspace.update(chain, q)?;
    let heights = TOE.map(|end| kin.position(chain.point(frame, end)).z);
    Ok(heights[0].min(heights[1]))
}

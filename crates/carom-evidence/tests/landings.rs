//! Landings of a made-up biped with the links and joints of Cassie, simulated from scene files: the model finds the parameters that made
//! them, and each of its parts is needed.

use super::leg::Landing;
use super::log::{JOINTS, MOTORS, of_side};
use super::*;
use crate::compare::data_sets;
use crate::compare::statistics::Estimate;
use carom_chain::Coordinates;
use carom_chain::urdf::{self, LoadOptions};
use carom_sim::{Moment, Sampling, Scene, Seen};
use carom_testing::files::Folder;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::fmt::Write;

/// Angles of [`JOINTS`] in flight: the thigh forward, the shin back, the toe's line nearly level.
const POSTURE: [f64; 8] = [0.0, 0.0, -0.6, 1.1, 0.02, -1.0, -0.35, 0.02];
/// The truth: restitution, friction, inertia of the toe's drive.
const TRUTH: [f64; 3] = [0.2, 0.5, 0.08];
/// The sample at which the leg lands, and the number of samples.
const LANDS: usize = 6;
const COUNT: usize = 26;
/// A height that no leg reaches, m.
const NOWHERE: f64 = -9.0;

/// The robot; `full` adds what the model adds: rods, and balls at the toes.
fn biped(full: bool) -> String {
    let link = |name: &str, mass: f64, size: f64, shapes: &str| {
        let [i, j] = [0.1 * mass * size * size, 0.08 * mass * size * size];
        format!(
            "<link name='{name}'><inertial><origin xyz='{} 0 0'/><mass value='{mass}'/><inertia ixx='{i}' iyy='{i}' \
             izz='{j}' ixy='0' ixz='0' iyz='0'/></inertial>{shapes}</link>",
            0.3 * size
        )
    };
    let joint = |name: &str, [parent, child]: [&str; 2], origin: &str, axis: &str| {
        format!(
            "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><origin {origin}/><axis \
             xyz='{axis}'/><limit lower='-3' upper='3' effort='300' velocity='99'/><dynamics damping='0.2'/></joint>"
        )
    };
    let ball =
        |at: &str| format!("<collision><origin xyz='{at}'/><geometry><sphere radius='0.0001'/></geometry></collision>");
    let toe = if full { ball("-0.0457 0.112 0") + &ball("0.088 0 0") } else { String::new() };
    let mut text = format!("<robot name='biped'>{}", link("pelvis", 9.0, 0.3, ""));
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let of = |name: &str| format!("{name}_{side}");
        for (name, mass, size) in
            [("yaw", 1.5, 0.1), ("hip", 1.0, 0.1), ("thigh", 5.0, 0.2), ("knee", 0.8, 0.1), ("shin", 0.6, 0.4)]
        {
            text += &link(&of(name), mass, size, "");
        }
        text += &link(&of("tarsus"), 0.8, 0.4, "");
        text += &link(&of("heel_spring"), 0.1, 0.1, "");
        text += &link(&of("toe"), 0.3, 0.1, &toe);
        let hip = format!("xyz='0 {} 0'", 0.12 * sign);
        for (name, [parent, child], origin, axis) in [
            ("hip_roll", ["pelvis", "yaw"], hip.as_str(), "1 0 0"),
            ("hip_yaw", ["yaw", "hip"], "xyz='0 0 -0.05'", "0 0 1"),
            ("hip_pitch", ["hip", "thigh"], "xyz='0 0 -0.1' rpy='-1.5707963 1.5707963 0'", "0 0 1"),
            ("knee", ["thigh", "knee"], "xyz='0.15 0 0'", "0 0 1"),
            ("knee_joint", ["knee", "shin"], "xyz='0.05 0.05 0'", "0 0 1"),
            ("ankle_joint", ["shin", "tarsus"], "xyz='0.4 0 0'", "0 0 1"),
            ("ankle_spring_joint", ["tarsus", "heel_spring"], "xyz='0 -0.03 0' rpy='0 0 2.5'", "0 0 1"),
            ("toe", ["tarsus", "toe"], "xyz='0.4 0 0'", "0 0 1"),
        ] {
            let parent = if parent == "pelvis" { parent.to_owned() } else { of(parent) };
            text += &joint(&of(name), [&parent, &of(child)], origin, axis);
        }
        if full {
            text += &format!(
                "<link name='turn_{side}'><inertial><mass value='0.001'/><inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' \
                 ixz='0' iyz='0'/></inertial></link><link name='rod_{side}'><inertial><origin xyz='0.24719 0 0'/><mass \
                 value='0.1567'/><inertia ixx='3.754e-6' iyy='0.004487' izz='0.004488' ixy='0' ixz='0' \
                 iyz='0'/></inertial></link><joint name='rod_z_{side}' type='continuous'><parent link='thigh_{side}'/><child \
                 link='turn_{side}'/><origin xyz='0 0 {}'/><axis xyz='0 0 1'/></joint><joint name='rod_y_{side}' \
                 type='continuous'><parent link='turn_{side}'/><child link='rod_{side}'/><axis xyz='0 1 0'/></joint>",
                0.045 * sign
            );
        }
    }
    text + "</robot>"
}

/// A folder with both robots.
fn robots() -> Folder {
    let folder = Folder::new();
    folder.write("biped.urdf", biped(false));
    folder.write("full.urdf.text", biped(true));
    folder
}

/// Torques of [`MOTORS`] of both legs, N m.
const TORQUES: [f64; 5] = [8.0, -4.0, 12.0, 20.0, -6.0];

/// The samples of a jump with its seed, from a scene file with the floor at a height.
fn jump(folder: &Folder, seed: u64, floor: f64) -> (Chain, Vec<Moment>) {
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    let chain = Chain::from_urdf_str(&biped(true), &options).unwrap();
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut wide = |size: f64| size * (2.0 * rng.f64() - 1.0);
    // one leg lower than the other
    let roll = if seed.is_multiple_of(2) { 0.15 } else { -0.15 };
    let turn = UnitQuaternion::from_euler_angles(roll, wide(0.1), wide(0.3));
    let mut q = vec![0.1, -0.2, 1.0, turn.i, turn.j, turn.k, turn.w];
    q.resize(chain.nq(), 0.0);
    let mut qd = vec![0.0; chain.nv()];
    qd[..6].copy_from_slice(&[wide(0.5), wide(0.2), -1.5 + wide(0.4), wide(0.5), wide(0.5), wide(0.5)]);
    let (mut torques, mut rotors) = (vec![0.0; chain.nv()], String::new());
    let inertias = [0.038125, 0.038125, 0.09344, 0.09344, 0.01225 + TRUTH[2]];
    let at = |name: &str| match &chain.joint(name).unwrap().coordinates {
        Coordinates::Own { q, v } => (q.start, v.start),
        other => panic!("{other:?}"),
    };
    for side in 0..2 {
        for (k, joint) in JOINTS.iter().enumerate() {
            let (place, rate) = at(&of_side(joint, side));
            q[place] = POSTURE[k] + wide(0.03);
            qd[rate] = wide(0.5);
        }
        for (motor, (torque, inertia)) in MOTORS.iter().zip(TORQUES.iter().zip(inertias)) {
            torques[at(&of_side(JOINTS[*motor], side)).1] = *torque;
            let _ = write!(rotors, "{} = {inertia}, ", of_side(JOINTS[*motor], side));
        }
    }
    // the rods point at the springs of the heels; the scene finds the velocities that close the loops
    let mut lengths = [0.0; 2];
    for (side, length) in lengths.iter_mut().enumerate() {
        let frame = |name: &str| chain.frame(&of_side(name, side)).unwrap();
        let (thigh, heel) = (frame("thigh"), frame("heel_spring"));
        let mut workspace = chain.workspace();
        let kin = workspace.update(&chain, &q).unwrap();
        let upper = Vector3::new(0.0, 0.0, if side == 0 { 0.045 } else { -0.045 });
        let ends = [chain.point(thigh, upper), chain.point(heel, Vector3::new(0.11877, -0.01, 0.0))];
        let [from, to] = ends.map(|point| kin.position(point));
        let along = kin.pose(thigh).rotation.transpose() * (to - from);
        *length = along.norm();
        for (joint, angle) in [("rod_z", along.y.atan2(along.x)), ("rod_y", -(along.z / *length).asin())] {
            q[at(&of_side(joint, side)).0] = angle;
        }
    }
    let springs: String = [("knee_joint", 1500.0), ("ankle_spring_joint", 1250.0)]
        .iter()
        .flat_map(|(joint, stiffness)| {
            (0..2).map(move |side| {
                format!("[[spring]]\njoint = \"{}\"\nstiffness = {stiffness:?}\n", of_side(joint, side))
            })
        })
        .collect();
    let loops: String = ["left", "right"]
        .iter()
        .zip(lengths)
        .map(|(side, length)| {
            format!(
                "[[loop]]\njoint = \"point\"\nfirst = {{ link = \"rod_{side}\", xyz = [{length:?}, 0.0, 0.0] }}\nsecond = {{ link = \
                 \"heel_spring_{side}\", xyz = [0.11877, -0.01, 0.0] }}\n"
            )
        })
        .collect();
    let scene = format!(
        "[robot]\nurdf = \"full.urdf.text\"\nfloating = true\nq = {q:?}\nqd = {qd:?}\nrotor_inertia = {{ {} \
         }}\n[[surface]]\nshape = {{ halfspace = {{ point = [0.0, 0.0, {floor:?}], normal = [0.0, 0.0, 1.0] }} }}\n[contact]\nlaw = \
         \"newton\"\nrestitution = {:?}\nfriction = {:?}\n{springs}{loops}[run]\nduration = {:?}\ngravity = [0.0, 0.0, -9.81]\ncontroller = \
         \"constant\"\ntorque = {torques:?}\ntolerance = 1e-7\n",
        rotors.trim_end_matches(", "),
        TRUTH[0],
        TRUTH[1],
        SAMPLE * COUNT as f64
    );
    let scene = Scene::from_toml(&scene, &folder.0).unwrap();
    let mut moments = Vec::new();
    let mut keep = |seen: Seen<'_>| {
        if let Seen::Moment(moment) = seen {
            moments.push(moment.clone());
        }
    };
    let sampling = Sampling { every: Some(SAMPLE), ..Sampling::default() };
    scene.simulation.stream(&scene.q, &scene.qd, scene.duration, sampling, &mut keep).unwrap();
    (chain, moments)
}

/// The sample of the table for a moment, as a log gives it: without the rods, and without the velocities of the heels' springs.
fn row(chain: &Chain, log: u64, k: usize, moment: &Moment) -> String {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(moment.q[6], moment.q[3], moment.q[4], moment.q[5]));
    let [v, w] = [0, 3].map(|part| turn * Vector3::from_column_slice(&moment.qd[part..part + 3]));
    let mut cells = vec![k as f64 * SAMPLE, turn.w, turn.i, turn.j, turn.k];
    cells.extend(moment.q[..3].iter().chain(w.iter()).chain(v.iter()));
    for side in 0..2 {
        for joint in JOINTS {
            let Coordinates::Own { q, v } = &chain.joint(&of_side(joint, side)).unwrap().coordinates else { panic!() };
            let encoder = if joint == "ankle_spring_joint" { 0.0 } else { 1.0 };
            cells.extend([moment.q[q.start], encoder * moment.qd[v.start]]);
        }
        cells.extend(TORQUES);
    }
    let cells: Vec<String> = cells.iter().map(f64::to_string).collect();
    format!("{log},{}\n", cells.join(","))
}

fn header() -> String {
    let mut names: Vec<String> = ["log", "t", "base_qw", "base_qx", "base_qy", "base_qz", "base_x", "base_y", "base_z"]
        .into_iter()
        .chain(["base_wx", "base_wy", "base_wz", "base_vx", "base_vy", "base_vz"])
        .map(str::to_owned)
        .collect();
    for side in 0..2 {
        names.extend(JOINTS.iter().flat_map(|joint| [of_side(joint, side), of_side(joint, side) + "dot"]));
        names.extend(MOTORS.iter().map(|motor| of_side(JOINTS[*motor], side) + "_motor"));
    }
    names.join(",") + "\n"
}

/// The landings of jumps, with the floor where the leg that lands is at [`LANDS`].
fn landings(folder: &Folder, count: u64) -> Landings {
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    let robot = urdf::read_str(&biped(false), None, &options).unwrap();
    let chain = with_rods(&robot).unwrap();
    let one = |seed: u64| {
        let log_of = |(full, moments): &(Chain, Vec<Moment>)| {
            let rows: String = moments.iter().enumerate().map(|(k, it)| row(full, seed, k, it)).collect();
            let table = folder.0.join(format!("jump-{seed}.csv"));
            std::fs::write(&table, header() + &rows).unwrap();
            log::read(&table).unwrap().remove(0)
        };
        let flight = log_of(&jump(folder, seed, NOWHERE));
        let lower =
            |side: usize| leg::lowest(&chain, &leg::configuration(&chain, &flight.samples[LANDS]).unwrap(), side);
        let heights = [0, 1].map(|side| lower(side).unwrap());
        let side = usize::from(heights[1] < heights[0]);
        let log = log_of(&jump(folder, seed, heights[side] - leg::BALL));
        Landing::at_sample(&chain, (seed as usize, &log), side, LANDS).unwrap()
    };
    Landings { landings: (0..count).map(one).collect(), left_out: 0, chain: chain.clone() }
}

/// The complete model without some effects.
fn model(without: &[Effect]) -> Candidate {
    let newton = Candidate::all().into_iter().find(|one| one.law == "newton").unwrap();
    EFFECTS.iter().filter(|effect| !without.contains(effect)).fold(newton, |model, effect| model.with(*effect))
}

/// With the true parameters the model predicts the jumps to the error of the start's mean velocities, and without any of its parts the
/// error is ten times as large.
#[test]
fn the_model_predicts_landings_and_each_part_is_needed() {
    let folder = robots();
    let all = landings(&folder, 4);
    let error = |without: &[Effect]| {
        let model = model(without);
        let errors = all.errors(&model, &TRUTH[..model.parameters.len()], 1e-7);
        let each: Vec<f64> = errors.iter().flat_map(|it| it.unwrap().map(|one| rms(&one))).collect();
        each.iter().sum::<f64>() / each.len() as f64
    };
    let (whole, jumps) = (error(&[]), all.landings.iter().map(|it| it.jump(0)).fold(f64::INFINITY, f64::min));
    assert!(jumps > 1.0 && whole < 0.02, "{whole} {jumps}");
    for effect in EFFECTS {
        let without = error(&[effect]);
        assert!(without > 10.0 * whole, "{effect:?}: {without} {whole}");
    }
}

/// From other coefficients and without the inertia of the toe's drive, the fit of each fold finds the inertia, and the held-out errors
/// fall below a third of those without it.
#[test]
fn the_fit_recovers_the_inertia_of_the_toe() {
    let folder = robots();
    let all = landings(&folder, 4);
    let options = CompareOptions { folds: 2, trials: 30, tolerance: 1e-6, ..CompareOptions::default() };
    let candidate = model(&[Effect::Toe]);
    let errors = all.errors(&candidate, &TRUTH[..2], 1e-6).iter().map(|it| rms(&it.unwrap()[0])).collect();
    let simpler = Judged { candidate, coefficients: vec![vec![0.3, 0.4]; 2], training: vec![Vec::new(); 2], errors };
    let [with, other] = judge(&all, &model(&[]), Some(&simpler), &[0, 1, 1, 0], &options);
    for x in &with.coefficients {
        // half of the distance to the nearest inertia from which the search starts
        assert!((x[2] - TRUTH[2]).abs() < 0.01, "{:?}", with.coefficients);
    }
    let mean = |one: &Judged| Estimate::of(&one.errors).mean;
    let (within, without) = (mean(&with).max(mean(&other)), mean(&simpler));
    // the budget ends the search before e, which is 0.3 at the start, has reached 0.2
    assert!(3.0 * within < without, "{within} {without} {:?}", with.coefficients);
}

/// A landing is the first sample from which the mean velocity of the knee's spring over three samples falls by 2 rad/s within five: of
/// one that falls by 0.5 rad/s a sample from the sample 10 on, the mean around 11 is lower by 2.5 − 0.5/3 rad/s than that around 16; of
/// one that falls slower than 0.4 rad/s a sample there is none.
#[test]
fn a_landing_begins_where_the_spring_of_the_knee_falls() {
    let log = |slope: f64| {
        let sample = |k: usize| {
            let mut legs = [log::Leg::default(); 2];
            legs[1].rates[log::SPRINGS[0]] = 3.0 - slope * k.saturating_sub(10) as f64;
            let (zero, turn) = (Vector3::zeros(), UnitQuaternion::identity());
            log::Sample { line: k + 2, time: k as f64 * SAMPLE, position: zero, turn, velocity: zero, spin: zero, legs }
        };
        log::Log { name: "a".into(), samples: (0..40).map(sample).collect() }
    };
    let mean = |k: usize| (k - 1..=k + 1).map(|k| 3.0 - 0.5 * k.saturating_sub(10) as f64).sum::<f64>() / 3.0;
    let first = (1..30).find(|&k| mean(k) - mean(k + 5) >= 2.0).unwrap();
    assert_eq!((log(0.5).landing(1), first), (Some(9), 9));
    assert_eq!([log(0.5).landing(0), log(0.39).landing(1)], [None, None]);
}

/// A table of a folder of its own is recognised whatever its name, and broken ones are refused with file, place, rule and remedy.
#[test]
fn broken_tables_and_robots_are_refused() {
    let folder = robots();
    let (chain, moments) = jump(&folder, 1, NOWHERE);
    let rows: Vec<String> = moments.iter().enumerate().map(|(k, it)| row(&chain, 7, k, it)).collect();
    let whole = header() + &rows.concat();
    let table = folder.0.join("of_any_name.csv");
    let load = |text: &str, robot: &str| {
        std::fs::write(&table, text).unwrap();
        std::fs::write(folder.0.join("biped.urdf"), robot).unwrap();
        data_sets(&folder.0, &LoadOptions::default())
    };
    let robot = biped(false);
    let set = load(&whole, &robot).unwrap().remove(0);
    let few = crate::compare::compare(&set, &CompareOptions::default(), &|_, _| {}).unwrap_err().to_string();
    assert!(few.ends_with("it has 0 measurements that can be compared, but 5 are needed for 5 folds"), "{few}");
    let refused = |text: &str, robot: &str, file: &str, why: &str| {
        let told = load(text, robot).unwrap_err().to_string();
        assert_eq!(told, format!("{}: {why}", folder.0.join(file).display()));
    };
    let table = |text: &str, why: &str| refused(text, &robot, "of_any_name.csv", why);
    table(
        &whole.replacen("toe_rightdot", "x", 1),
        "column 'toe_rightdot' is missing: tables of landings need it, add it",
    );
    table(&header(), "it has no samples below its header: add them, or remove the table");
    let (first, rest) = (&rows[0], rows[1..].concat());
    table(
        &(header() + &first.replacen("7,0,", "7,x,", 1) + &rest),
        "line 2, column t: 'x' is not a finite number: correct it",
    );
    let order = "line 3, column t: the times of log '7' must ascend: sort them";
    table(&(header() + &rows[1] + first), order);
    let slow: String = rows.iter().step_by(2).map(String::as_str).collect();
    let told = load(&(header() + &slow), &robot).unwrap_err().to_string();
    assert!(told.contains("the samples of log '7' are 1.000 ms apart in the mean, but must be 0.5 ms"), "{told}");
    let back = "log '7' has begun before another log: sort the samples by log and time";
    table(&(header() + first + &rows[1].replacen("7,", "8,", 1) + &rows[2]), &format!("line 4, column log: {back}"));
    let long = rows[0].split(',').enumerate().map(|(k, cell)| if k == 2 { "2" } else { cell }).collect::<Vec<_>>();
    let told = load(&(header() + &long.join(",")), &robot).unwrap_err().to_string();
    assert!(told.contains("line 2, columns base_qw … base_qz: the norm of the quaternion is 2"), "{told}");
    let of_robot = |robot: &str, why: &str| refused(&whole, robot, "biped.urdf", why);
    let missing = "it has no hinge 'toe_left', which tables of landings measure: add it, or give the joint this name";
    of_robot(&robot.replacen("joint name='toe_left'", "joint name='tip'", 1), missing);
    let more = "its joint 'extra' is not one of those that tables of landings measure: make it fixed, or remove it";
    let extra = "<link name='e'/><joint name='extra' type='continuous'><parent link='pelvis'/><child link='e'/></joint></robot>";
    of_robot(&robot.replacen("</robot>", extra, 1), more);
    let lost = "it has no link 'thigh_left', which the model of a landing needs: give it this name";
    of_robot(&robot.replace("'thigh_left'", "'leg'"), lost);
}

//! Scenes in other units: with all lengths, masses or times multiplied by a factor, the same events happen, and the end is the scaled one.
//!
//! Mechanics has no unit of its own, so that a run must not depend on the units of its scene. The factors are powers of two, which multiply
//! without rounding: any difference comes from a number in the code that has a unit.
//!
//! | Symbol | Meaning |
//! |---|---|
//! | L, M, T | factors of lengths, masses and times |

use carom_chain::Coordinates;
use carom_chain::urdf::JointType;
use carom_sim::{Sampling, Scene, Seen, Simulation};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

#[derive(Clone, Copy)]
struct Factors {
    length: f64,
    mass: f64,
    time: f64,
}

impl Factors {
    const ONE: Self = Self { length: 1.0, mass: 1.0, time: 1.0 };

    fn speed(self) -> f64 {
        self.length / self.time
    }

    fn force(self) -> f64 {
        self.mass * self.length / (self.time * self.time)
    }

    /// L of a joint that slides, 1 of a hinge.
    fn of_joint(self, slides: bool) -> f64 {
        if slides { self.length } else { 1.0 }
    }

    /// Of the force of a joint: N or N m.
    fn effort(self, slides: bool) -> f64 {
        self.force() * self.length / self.of_joint(slides)
    }
}

/// Numbers separated by spaces, each times a factor.
fn times(text: &str, factor: f64) -> String {
    let scaled = text.split_whitespace().map(|number| format!("{:?}", number.parse::<f64>().unwrap() * factor));
    scaled.collect::<Vec<_>>().join(" ")
}

/// Writes an element of a URDF with its lengths, masses and times scaled; `slides` tells of the joint around it.
fn write_scaled(node: roxmltree::Node, by: Factors, slides: bool, out: &mut String) {
    let name = node.tag_name().name();
    let slides = if name == "joint" { node.attribute("type") == Some("prismatic") } else { slides };
    write!(out, "<{name}").unwrap();
    for attribute in node.attributes() {
        let factor = match (name, attribute.name()) {
            ("origin", "xyz") | ("box", "size") | ("sphere" | "cylinder" | "capsule", "radius" | "length") => by.length,
            ("mass", "value") => by.mass,
            ("inertia", _) => by.mass * by.length * by.length,
            ("limit", "lower" | "upper") => by.of_joint(slides),
            ("limit", "velocity") => by.of_joint(slides) / by.time,
            ("limit", "effort") | ("dynamics", "friction") => by.effort(slides),
            ("dynamics", "damping") => by.effort(slides) * by.time / by.of_joint(slides),
            _ => {
                write!(out, " {}=\"{}\"", attribute.name(), attribute.value()).unwrap();
                continue;
            }
        };
        write!(out, " {}=\"{}\"", attribute.name(), times(attribute.value(), factor)).unwrap();
    }
    out.push('>');
    node.children().filter(roxmltree::Node::is_element).for_each(|child| write_scaled(child, by, slides, out));
    write!(out, "</{name}>").unwrap();
}

/// A number or every number of a list.
fn scale(value: &mut Value, factor: f64) {
    match value {
        Value::Integer(n) => *value = Value::Float(*n as f64 * factor),
        Value::Float(x) => *x *= factor,
        Value::Array(all) => all.iter_mut().for_each(|one| scale(one, factor)),
        Value::Table(all) => all.iter_mut().for_each(|(_, one)| scale(one, factor)),
        _ => {}
    }
}

fn compliance(table: &mut Table, by: Factors) {
    let linear = table.get("exponent").is_some_and(|it| it.as_float() == Some(1.0) || it.as_integer() == Some(1))
        || table.get("force").and_then(Value::as_str) == Some("walton-braun");
    assert!(linear, "the unit of this stiffness: {table:?}");
    scale(table.get_mut("stiffness").unwrap(), by.force() / by.length);
    // The default has a unit.
    table.entry("slip_speed").or_insert(Value::Float(1e-3));
    scale(table.get_mut("slip_speed").unwrap(), by.speed());
}

/// The keys of a scene with units. The joints with springs and controllers are hinges but for those in `sliders`.
fn scale_keys(table: &mut Table, by: Factors, sliders: &BTreeSet<String>) {
    let slides = table.get("joint").and_then(Value::as_str).is_some_and(|joint| sliders.contains(joint));
    let stiff = by.effort(slides) / by.of_joint(slides);
    for (key, value) in table.iter_mut() {
        match key.as_str() {
            "position" | "point" | "centre" | "size" | "xyz" => scale(value, by.length),
            "duration" => scale(value, by.time),
            "gravity" => scale(value, by.speed() / by.time),
            "rest" => scale(value, by.of_joint(slides)),
            "stiffness" | "kp" => scale(value, stiff),
            "damping" | "kd" => scale(value, stiff * by.time),
            "velocity" => scale(value, by.speed()),
            "compliance" => compliance(value.as_table_mut().unwrap(), by),
            "q" | "qd" | "tip_velocity" | "target" | "normal" => {}
            _ => match value {
                Value::Table(inner) => scale_keys(inner, by, sliders),
                Value::Array(all) => {
                    all.iter_mut().filter_map(Value::as_table_mut).for_each(|it| scale_keys(it, by, sliders))
                }
                _ => {}
            },
        }
    }
}

/// The factors of the coordinates and velocities of a scene.
fn of_state(scene: &Scene, by: Factors) -> (Vec<f64>, Vec<f64>) {
    let chain = &scene.simulation.chain;
    let (mut of_q, mut of_v) = (vec![1.0; chain.nq()], vec![1.0 / by.time; chain.nv()]);
    for joint in chain.joints() {
        let Coordinates::Own { q, v } = &joint.coordinates else { continue };
        let lengths = match joint.kind {
            JointType::Prismatic => 1,
            JointType::Planar => 2,
            JointType::Floating => 3,
            _ => 0,
        };
        of_q[q.start..q.start + lengths].fill(by.length);
        of_v[v.start..v.start + lengths].fill(by.speed());
    }
    (of_q, of_v)
}

/// The scene of a file in other units.
fn scaled(path: &Path, by: Factors, tolerance: f64, folder: &Path) -> Scene {
    let original = Scene::from_file(path).unwrap();
    let mut file: Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
    let joints = original.simulation.chain.joints();
    let sliders = joints.iter().filter(|it| it.kind == JointType::Prismatic).map(|it| it.name.clone()).collect();
    scale_keys(&mut file, by, &sliders);
    let (of_q, of_v) = of_state(&original, by);
    let times =
        |numbers: &[f64], factors: &[f64]| -> Vec<f64> { numbers.iter().zip(factors).map(|(x, f)| x * f).collect() };
    let (q, qd) = (times(&original.q, &of_q), times(&original.qd, &of_v));
    let run = file["run"].as_table_mut().unwrap();
    // Times that the original has by default.
    let in_turn = path.file_stem().is_some_and(|name| name == IN_TURN);
    let zeno_time = if in_turn { Simulation::zeno_time_for(tolerance) } else { original.simulation.zeno_time };
    run.insert("zeno_time".into(), Value::Float(zeno_time * by.time));
    run.insert("contact_step".into(), Value::Float(original.simulation.contact_step * by.time));
    run.insert("max_step".into(), Value::Float(original.simulation.max_step * by.time));
    run.insert("tolerance".into(), Value::Float(original.simulation.tolerance.min(tolerance)));
    let robot = |table: &mut Table, number: usize| {
        let urdf = path.parent().unwrap().join(table["urdf"].as_str().unwrap());
        let text = std::fs::read_to_string(&urdf).unwrap();
        let mut out = String::new();
        write_scaled(roxmltree::Document::parse(&text).unwrap().root_element(), by, false, &mut out);
        let name = format!("{number}.urdf");
        std::fs::write(folder.join(&name), out).unwrap();
        table.insert("urdf".into(), Value::String(name));
        let links = table.get_mut("inertia").and_then(Value::as_table_mut).into_iter().flatten();
        for number in links.flat_map(|(_, own)| own.as_array_mut().unwrap()) {
            let own = number.as_float().or(number.as_integer().map(|whole| whole as f64)).unwrap();
            *number = Value::Float(own * by.mass * by.length * by.length);
        }
    };
    match &mut file["robot"] {
        Value::Array(robots) => {
            robots.iter_mut().enumerate().for_each(|(number, one)| robot(one.as_table_mut().unwrap(), number));
        }
        one => {
            let one = one.as_table_mut().unwrap();
            robot(one, 0);
            one.remove("tip_velocity");
            one.insert("q".into(), Value::Array(q.iter().copied().map(Value::Float).collect()));
            one.insert("qd".into(), Value::Array(qd.iter().copied().map(Value::Float).collect()));
        }
    }
    let mut scene =
        Scene::from_toml(&file.to_string(), folder).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    (scene.q, scene.qd) = (q, qd);
    scene
}

/// Events as (kind, touch), with their times, and the end.
type Outcome = (Vec<(&'static str, Option<usize>)>, Vec<f64>, Vec<f64>, Vec<f64>);

fn outcome(scene: &Scene) -> Outcome {
    let plan = scene.plan().unwrap();
    let (mut events, mut times) = (Vec::new(), Vec::new());
    let mut seen = |seen: Seen| {
        if let Seen::Event(event) = seen {
            events.push((event.kind.name(), event.kind.touch()));
            times.push(event.time);
        }
    };
    let summary = plan.stream(scene.duration, Sampling::default(), &mut seen).unwrap();
    (events, times, summary.last.q, summary.last.qd)
}

/// The events of each instant as a set: which of two contacts is the first where both close, stick or come to rest at one time is decided by
/// rounding, and so is whether their impacts are told as one.
fn instants(events: &[(&'static str, Option<usize>)], times: &[f64]) -> Vec<(f64, BTreeSet<String>)> {
    let mut instants: Vec<(f64, BTreeSet<String>)> = Vec::new();
    for ((kind, touch), time) in events.iter().zip(times) {
        let event = match *kind {
            "impact" | "several" => "impact".to_owned(),
            kind => format!("{kind} {touch:?}"),
        };
        match instants.last_mut() {
            Some((last, set)) if time - *last <= INSTANT => drop(set.insert(event)),
            _ => instants.push((*time, BTreeSet::from([event]))),
        }
    }
    instants
}

/// Events within this time are one instant, s: some multiple of the tolerance of the scenes.
const INSTANT: f64 = 1e-8;

/// What differs between a scene and the same in other units; `None` if nothing does.
fn difference(path: &Path, by: Factors, folder: &Path) -> Option<String> {
    // The absolute tolerance has a unit: with longer times velocities are smaller, and their steps are coarser.
    let in_turn = path.file_stem().is_some_and(|name| name == IN_TURN);
    let tolerance = if by.time > 1.0 || in_turn { 3e-11 } else { f64::INFINITY };
    let (one, other) = (scaled(path, Factors::ONE, tolerance, folder), scaled(path, by, tolerance, folder));
    let (events, times, q, qd) = outcome(&one);
    let (found_events, mut found_times, found_q, found_qd) = outcome(&other);
    found_times.iter_mut().for_each(|time| *time /= by.time);
    // The absolute error of the integration has a unit of length and of time, and none of mass: there rounding itself is the same.
    let same_rounding = by.length == 1.0 && by.time == 1.0;
    if same_rounding && events != found_events {
        let k = (0..).find(|&k| events.get(k) != found_events.get(k)).unwrap_or_default();
        return Some(format!("event {k} of {}: {:?}, but {:?}", events.len(), events.get(k), found_events.get(k)));
    }
    let tied = by.time != 1.0 && path.file_stem().is_some_and(|name| name == SIDE_BY_SIDE);
    let told = |events: &[(&'static str, Option<usize>)], times: &[f64]| {
        let mut all = instants(events, times);
        if tied {
            all.iter_mut().for_each(|(_, events)| events.retain(|event| event == "impact"));
            all.retain(|(_, events)| !events.is_empty());
        }
        all
    };
    let (instants, found_instants) = (told(&events, &times), told(&found_events, &found_times));
    let here = |k: usize| (instants.get(k), found_instants.get(k));
    let same = |k: &usize| match here(*k) {
        (Some((time, events)), Some((found_time, found))) => (time - found_time).abs() <= NEAR && events == found,
        (one, other) => one.is_none() && other.is_none(),
    };
    if let Some(k) = (0..instants.len().max(found_instants.len())).find(|k| !same(k)) {
        let (wanted, found) = here(k);
        return Some(format!("instant {k} of {}: {wanted:?}, but {found:?}", instants.len()));
    }
    let (of_q, of_v) = of_state(&one, by);
    let apart = |found: &[f64], wanted: &[f64], factors: &[f64]| -> f64 {
        let off =
            found.iter().zip(wanted).zip(factors).map(|((found, wanted), factor)| (found / factor - wanted).abs());
        off.fold(0.0, f64::max)
    };
    let off = [("q", apart(&found_q, &q, &of_q)), ("qd", apart(&found_qd, &qd, &of_v))];
    let (what, most) = off.into_iter().fold(("", 0.0), |most, one| if one.1 > most.1 { one } else { most });
    (most > NEAR).then(|| format!("{what} differ by {most:.1e}"))
}

/// Ten times the largest tolerance of the scenes, whose errors depend on the steps.
const NEAR: f64 = 1e-7;

/// A scene in which, at its own tolerance and Zeno time, rounding decides which of the last bounces of two corners in turn is the end of an
/// accumulation: they are 1.6e-7 s apart. It has a finer tolerance, and the Zeno time of that.
const IN_TURN: &str = "box";

/// A scene with bodies that rest side by side in its motion: whether their contact lasts or opens is decided by rounding. In other times only its
/// impacts are compared.
const SIDE_BY_SIDE: &str = "cradle";

fn check(name: &str, by: Factors) {
    let folder = std::env::temp_dir().join(format!("carom-scale-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(scenes).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|it| it == "toml"));
    paths.sort();
    let mut wrong = Vec::new();
    for path in &paths {
        if let Some(why) = difference(path, by, &folder) {
            wrong.push(format!("{}: {why}", path.file_stem().unwrap().display()));
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(wrong.is_empty() && paths.len() > 20, "{}", wrong.join("\n"));
}

#[test]
fn scenes_in_masses_of_a_thousandth_have_the_same_motion() {
    check("light", Factors { mass: 1.0 / 1024.0, ..Factors::ONE });
}

#[test]
fn scenes_in_masses_of_a_thousand_have_the_same_motion() {
    check("heavy", Factors { mass: 1024.0, ..Factors::ONE });
}

#[test]
fn scenes_in_lengths_of_a_thousandth_have_the_same_motion() {
    check("small", Factors { length: 1.0 / 1024.0, ..Factors::ONE });
}

#[test]
fn scenes_in_lengths_of_a_thousand_have_the_same_motion() {
    check("large", Factors { length: 1024.0, ..Factors::ONE });
}

#[test]
fn scenes_in_times_of_a_hundredth_have_the_same_motion() {
    check("short", Factors { time: 1.0 / 128.0, ..Factors::ONE });
}

#[test]
fn scenes_in_times_of_thirty_have_the_same_motion() {
    check("long", Factors { time: 32.0, ..Factors::ONE });
}

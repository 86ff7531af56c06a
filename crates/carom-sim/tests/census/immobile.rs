//! Contacts that no joint moves along their normal, or that only one joint moves.
//!
//! A mechanism touches a floor along which all its joints move. The floor can do no work, so that its motion is that of the same
//! mechanism without the floor. With a vertical slider under it, which gravity presses down, a smooth floor makes the motion that
//! of the mechanism with this slider locked. The mechanisms are turned at random in space, so that what is zero by the geometry is rounding.
//!
//! Blows at random points of robots with one or two joints: what the law answers is finite, u⁺ = J q̇⁺, the work of the impulse is
//! the change of the energy. A blow that no joint moves along the normal is refused.

use super::build::*;
use super::case::{Case, End};
use super::{LIMIT, Verdict, compare};
use carom_chain::{Chain, FramePoint};
use carom_impact::{AnyLaw, Coefficients, Flags};
use carom_sim::Impacts;
use fastrand::Rng;
use std::f64::consts::PI;

struct Mechanism {
    name: &'static str,
    parts: Vec<Part>,
    q: Vec<f64>,
    qd: Vec<f64>,
    /// Height of the floor.
    floor: f64,
}

const NAMES: [&str; 24] = [
    "SCARA of 2",
    "SCARA of 3",
    "6 vertical hinges",
    "door",
    "door on a ball",
    "lying log on a hinge",
    "planar box",
    "planar ball",
    "gantry",
    "sliding box",
    "sliding ball",
    "sliding log",
    "wheel, a ball",
    "wheel, a cylinder",
    "wheel, a capsule",
    "caster",
    "ball on its hinge",
    "upright cylinder on its axis",
    "upright capsule on its axis",
    "ball on a wrist",
    "SCARA with a mimic joint",
    "lift undone by a mimic joint",
    "tree with two feet",
    "slider on a turntable",
];

/// Joints of the parts are hinges or sliders but for the planar ones, which have three numbers.
fn mechanism(kind: usize, rng: &mut Rng) -> Mechanism {
    let r = within(rng, 0.03, 0.3);
    let h = within(rng, -0.5, 0.5);
    let [l, m] = [0.0; 2].map(|_: f64| within(rng, 0.2, 0.8));
    let size = [0.0; 3].map(|_: f64| within(rng, 0.1, 0.5));
    let hinge = |name: &str, parent: &str, axis, at| Part::new(name, parent, "continuous", axis, at);
    let slider = |name: &str, parent: &str, axis, at| Part::new(name, parent, "prismatic", axis, at);
    let foot = |part: Part, at: [f64; 3]| part.with(shape(&ball(r), at, O));
    let on_y = [0.5 * PI, 0.0, 0.0];
    let on_x = [0.0, 0.5 * PI, 0.0];
    let (mut parts, mut floor, mut n) = (Vec::new(), h - r, 0);
    match kind {
        0 | 1 | 2 | 20 => {
            let count = [2, 3, 6, 0, 2][kind % 5 + usize::from(kind == 20) * 4];
            for k in 0..count {
                let parent = if k == 0 { "carrier".to_owned() } else { format!("l{}", k - 1) };
                let at = if k == 0 { [0.0, 0.0, h] } else { [within(rng, 0.2, 0.6), 0.0, 0.0] };
                let part = hinge(&format!("l{k}"), &parent, Z, at);
                let mimic = r#"<mimic joint="jl0" multiplier="-0.7" offset="0.3"/>"#;
                let part = if kind == 20 && k == 1 { part.joint(mimic) } else { part };
                parts.push(if k == count - 1 { foot(part, [m, 0.0, 0.0]) } else { part });
            }
        }
        3 => {
            parts.push(hinge("leaf", "carrier", Z, O).with(shape(&brick(size), [0.5 * size[0], 0.0, 0.0], O)));
            floor = -0.5 * size[2];
        }
        4 => parts.push(foot(hinge("leaf", "carrier", Z, [0.0, 0.0, h]), [l, m, 0.0])),
        5 => parts.push(hinge("log", "carrier", Z, [0.0, 0.0, h]).with(shape(&cylinder(r, m), [l, 0.0, 0.0], on_x))),
        6 | 7 => {
            let body = Part::new("body", "carrier", "planar", Z, [0.0, 0.0, h]);
            n = 2;
            parts.push(if kind == 6 { body.with(shape(&brick(size), O, O)) } else { foot(body, O) });
            floor = if kind == 6 { h - 0.5 * size[2] } else { floor };
        }
        8 => {
            parts.push(slider("beam", "carrier", X, O));
            parts.push(slider("trolley", "beam", Y, [0.1, 0.0, h]).with(shape(&brick(size), O, O)));
            floor = h - 0.5 * size[2];
        }
        9 => {
            parts.push(slider("body", "carrier", X, [0.0, 0.0, h]).with(shape(&brick(size), O, O)));
            floor = h - 0.5 * size[2];
        }
        10 => parts.push(foot(slider("body", "carrier", [0.6, 0.8, 0.0], [0.0, 0.0, h]), O)),
        11 => parts.push(slider("log", "carrier", X, [0.0, 0.0, h]).with(shape(&capsule(r, m), O, on_x))),
        12 => parts.push(foot(hinge("wheel", "carrier", Y, [0.0, 0.0, h]), O)),
        13 => parts.push(hinge("wheel", "carrier", Y, [0.0, 0.0, h]).with(shape(&cylinder(r, m), O, on_y))),
        14 => parts.push(hinge("wheel", "carrier", Y, [0.0, 0.0, h]).with(shape(&capsule(r, m), O, on_y))),
        15 => {
            parts.push(hinge("fork", "carrier", Z, [0.0, 0.0, h]));
            parts.push(hinge("wheel", "fork", X, [l, 0.0, 0.0]).with(shape(&cylinder(r, 0.1), O, on_x)));
        }
        16 => parts.push(foot(hinge("body", "carrier", Z, [l, m, h]), O)),
        17 => {
            parts.push(hinge("body", "carrier", Z, [l, m, h]).with(shape(&cylinder(r, m), O, O)));
            floor = h - 0.5 * m;
        }
        18 => {
            parts.push(hinge("body", "carrier", Z, [l, m, h]).with(shape(&capsule(r, m), O, O)));
            floor = h - 0.5 * m - r;
        }
        19 => {
            parts.push(hinge("a", "carrier", X, [l, m, h]));
            parts.push(hinge("b", "a", Y, O));
            parts.push(foot(hinge("c", "b", Z, O), O));
        }
        21 => {
            parts.push(slider("up", "carrier", Z, O));
            let down = r#"<mimic joint="jup" multiplier="-1"/>"#;
            parts.push(foot(slider("down", "up", Z, [l, 0.0, h]).joint(down), O));
        }
        22 => {
            parts.push(hinge("body", "carrier", Z, O));
            parts.push(foot(hinge("left", "body", Z, [l, 0.0, h]), [m, 0.0, 0.0]));
            parts.push(foot(hinge("right", "body", Z, [-l, 0.0, h]), [0.0, m, 0.0]));
        }
        _ => {
            parts.push(hinge("table", "carrier", Z, O));
            parts.push(slider("body", "table", X, [l, 0.0, h]).with(shape(&brick(size), O, O)));
            floor = h - 0.5 * size[2];
        }
    }
    let mimics = parts.iter().filter(|part| part.more.contains("<mimic")).count();
    n += parts.len() - mimics;
    let damping = if rng.u8(0..4) == 0 { r#"<dynamics damping="0.1"/>"# } else { "" };
    let parts = parts.into_iter().map(|part| part.random(rng, 0.3).joint(damping)).collect();
    let [q, qd] = [0.8, 2.0].map(|size| (0..n).map(|_| within(rng, -size, size)).collect());
    Mechanism { name: NAMES[kind], parts, q, qd, floor }
}

/// The scene, and the scene that moves as it should.
pub fn cases(seed: u64) -> (String, bool, [Case; 2]) {
    let rng = &mut Rng::with_seed(seed);
    let kind = (seed % NAMES.len() as u64) as usize;
    // The two that move along their normal alone would be lifted twice.
    let lift = rng.u8(0..5) == 0;
    let place = Place::random(rng);
    let mut mechanism = mechanism(kind, rng);
    let carrier = |joint| Part::new("carrier", "mount", joint, Z, O);
    let (law, several) = (one_of(rng, &LAWS), one_of(rng, &SEVERAL));
    let smooth = lift || several == "energetic" || rng.bool();
    let (e, mu) = (one_of(rng, &[0.0, 0.5, 1.0]), if smooth { 0.0 } else { one_of(rng, &[0.3, 1.5]) });
    let tilt = direction(rng);
    let gravity = match rng.u8(0..4) {
        0 if !lift => V::zeros(),
        1 if !lift => V::new(3.0 * tilt.x, 3.0 * tilt.y, -9.81),
        _ => V::new(0.0, 0.0, -9.81),
    };
    let parts = |joint| -> Vec<Part> {
        [place.mount(), carrier(joint)].into_iter().chain(mechanism.parts.iter().cloned()).collect()
    };
    let [lifted, locked] = ["prismatic", "fixed"].map(|joint| urdf(&parts(joint)));
    let run = format!("[run]\nduration = 0.3\ntolerance = 1e-11\n{}", place.gravity(gravity));
    let state = |q: &[f64], qd: &[f64]| {
        format!("[robot]\nurdf = \"r.urdf\"\ntip = \"carrier\"\nq = {}\nqd = {}\n", list(q), list(qd))
    };
    let free = Case {
        files: vec![("r.urdf".into(), locked.clone())],
        scene: format!("{}{run}model = \"full\"\n", state(&mechanism.q, &mechanism.qd)),
        ..Case::default()
    };
    if lift {
        mechanism.q.insert(0, 0.0);
        mechanism.qd.insert(0, 0.0);
    }
    let floor = place.halfspace("floor", V::new(0.0, 0.0, mechanism.floor), V::z());
    let contact =
        format!("{floor}[contact]\nlaw = \"{law}\"\nseveral = \"{several}\"\nrestitution = {e:?}\nfriction = {mu:?}\n");
    let held = Case {
        files: vec![("r.urdf".into(), if lift { lifted } else { locked })],
        scene: format!("{}{contact}{run}", state(&mechanism.q, &mechanism.qd)),
        ..Case::default()
    };
    let group = format!("{}{}", mechanism.name, if lift { ", on a lift" } else { "" });
    (group, lift, [held, free])
}

pub fn judge(seed: u64) -> Verdict {
    let (group, lift, [held, free]) = cases(seed);
    let End::Done(wanted) = free.run(None, LIMIT) else { return Verdict::bad(group, "no reference", String::new()) };
    let found = match held.run(None, LIMIT) {
        End::Refused(_, why) => return Verdict::good(group, "refused", why),
        other => match other.done(&group) {
            Ok(found) => found,
            Err(verdict) => return verdict,
        },
    };
    let (q, qd) = (&found.summary.last.q, &found.summary.last.qd);
    let skip = usize::from(lift);
    let speed = wanted.summary.last.qd.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
    let off = compare(&qd[skip..], &wanted.summary.last.qd).max(compare(&q[skip..], &wanted.summary.last.q)) / speed;
    let note = format!("{off:.1e}, {} time steps, events {:?}", found.statistics().contact_steps, found.names());
    match off {
        // 1e-11 in each step grows by less than a hundred in 0.3 s.
        _ if off <= 1e-9 && found.statistics().contact_steps > 0 => Verdict::good(group, "right, by time steps", note),
        _ if off <= 1e-9 => Verdict::good(group, "right", note),
        _ => Verdict::bad(group, "wrong motion", note),
    }
}

/// A blow at a point of a robot with one or two joints, at which no joint, one joint or both move along the normal.
pub fn blow(seed: u64) -> Verdict {
    let rng = &mut Rng::with_seed(seed);
    let place = Place::random(rng);
    let two = rng.bool();
    let axis: [f64; 3] = direction(rng).into();
    let mut parts = vec![place.mount(), Part::new("a", "mount", "continuous", axis, O).random(rng, 0.5)];
    let mut tip = "a";
    if two {
        let (joint, axis) =
            (one_of(rng, &["continuous", "prismatic"]), if rng.bool() { axis } else { direction(rng).into() });
        parts.push(Part::new("b", "a", joint, axis, direction(rng).into()).turned(turn(rng)).random(rng, 0.5));
        tip = "b";
    }
    let chain = match Chain::from_urdf_str(&urdf(&parts), &Default::default()) {
        Ok(chain) => chain,
        Err(e) => return Verdict::bad("blow", "no robot", e.to_string()),
    };
    let n = chain.nv();
    let [q, qd] = [1.5, 2.0].map(|size| (0..n).map(|_| within(rng, -size, size)).collect::<Vec<_>>());
    // On the axis of the last hinge, beside it along a normal in a plane with it, or anywhere.
    let own = V::from(parts.last().map_or(axis, |part| part.axis));
    let on_axis = rng.u8(0..3) == 0 && !two;
    let offset = if on_axis { own * within(rng, -0.5, 0.5) } else { direction(rng) * within(rng, 0.05, 0.8) };
    let Ok(frame) = chain.frame(tip) else { return Verdict::bad("blow", "no robot", tip.into()) };
    let mut workspace = chain.workspace();
    let Ok(kin) = workspace.update(&chain, &q) else { return Verdict::bad("blow", "no robot", tip.into()) };
    let jacobian = kin.point_jacobian(chain.point(frame, offset));
    let mut normal = direction(rng);
    // Normal to what the last joint does.
    let across = rng.bool() && jacobian.column(n - 1).norm() > 1e-3;
    if across {
        let along = V::from_column_slice(jacobian.column(n - 1).as_slice()).normalize();
        normal = (normal - along * along.dot(&normal)).normalize();
    }
    let law = one_of(rng, &LAWS);
    let mut coefficients = Coefficients::default();
    (coefficients.restitution, coefficients.friction) = (one_of(rng, &[0.0, 0.5, 1.0]), one_of(rng, &[0.0, 0.3, 1.5]));
    let Some(law) = AnyLaw::named(law, coefficients) else { return Verdict::bad("blow", "no law", law.into()) };
    let row = jacobian.transpose() * normal;
    // What the joints could move it by: the lever of a hinge, and the one of the second, 1 m away from the first.
    let lever = offset.norm() + if two { 1.0 } else { 0.0 };
    let most = row.iter().fold(0.0, |most: f64, x: &f64| most.max(x.abs()));
    let immobile = most <= 1e-14 * lever;
    let group = match (immobile, two, across) {
        // 64 ε of the lever is 1.4e-14: what is above it may be moved, or not.
        _ if !immobile && most < 1e-12 * lever => {
            return Verdict::good("blow at the bound of mobility", "any", String::new());
        }
        (true, ..) => "blow that no joint moves",
        (_, false, _) => "blow that one joint moves",
        (_, true, true) => "blow that the first of two joints moves",
        (_, true, false) => "blow that two joints move",
    };
    let done = std::panic::catch_unwind(|| {
        chain.impact(&q, &qd).at(FramePoint::new(frame, offset)).normal(normal).resolve(&law)
    });
    let hit = match done {
        Err(_) => return Verdict::bad(group, "panic", String::new()),
        // A wedge is refused too.
        Ok(Err(why)) => {
            return Verdict::new(group, "refused", super::energy::false_message(&why.to_string()), why.to_string());
        }
        Ok(Ok(hit)) => hit,
    };
    let told = hit.flags.contains(Flags::SINGULAR) || hit.flags.contains(Flags::JAM);
    let speed = row.dot(&nalgebra::DVector::from_column_slice(&qd));
    if immobile {
        // Nothing approaches, so that an answer without an impulse is right too.
        let still = compare(&hit.qd_plus, &qd) <= 1e-9;
        let note = format!("qd {qd:?} to {:?}, impulse {:?}", hit.qd_plus, hit.impulse.as_slice());
        return Verdict::new(group, if still { "nothing happens" } else { "an answer" }, !still, note);
    }
    let u = &jacobian * nalgebra::DVector::from_column_slice(&hit.qd_plus);
    let off = (&u - hit.u_plus).norm() / (hit.u_plus.norm() + hit.u_minus.norm());
    let work = 0.5 * hit.impulse.dot(&(hit.u_minus + hit.u_plus));
    let gain = hit.energy_after - hit.energy_before;
    let unpaid = (work - gain).abs() / hit.energy_before;
    let gained = gain > 1e-9 * hit.energy_before && !hit.flags.contains(Flags::ENERGY_GAIN);
    let note =
        format!("u off {off:.1e}, work off {unpaid:.1e}, gain {gain:.1e}, approach {speed:.1e}, flags {:?}", hit.flags);
    let (class, bad) = match () {
        () if told => ("flagged", false),
        () if off > 1e-9 || off.is_nan() => ("u⁺ is not J q̇⁺", true),
        () if unpaid > 1e-9 || unpaid.is_nan() => ("works do not sum", true),
        () if gained => ("gain without a flag", true),
        () => ("right", false),
    };
    Verdict::new(group, class, bad, note)
}

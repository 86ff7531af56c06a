//! Loops that lock joints, and loops that leave some freedom, with dry friction, limits, controllers and contacts.
//!
//! A frame that its loops lock stays at rest, whatever it carries; a ball that falls on it rebounds to the restitution's share. A
//! floating frame that its loops lock moves as the rigid body that it is. What keeps some freedom keeps its loops closed and its
//! books balanced.

use super::build::*;
use super::case::{Answer, Case, End};
use super::{LIMIT, Verdict, compare, energy};
use carom_chain::Chain;
use fastrand::Rng;

const NAMES: [&str; 11] = [
    "truss of 2 bars, point",
    "truss of 2 bars, pin",
    "truss of 2 bars, weld",
    "3 hinges, weld",
    "floating triangle",
    "3 hinges in space, point",
    "5 hinges in space, pin",
    "6 hinges in space, weld",
    "four-bar linkage",
    "five-bar linkage",
    "6 hinges in space, pin",
];
/// The first of the mechanisms that keep some freedom.
const FREE: usize = 8;
const FLOATING: usize = 4;

pub struct Locked {
    pub group: String,
    pub case: Case,
    /// The rigid body that a floating frame is.
    pub rigid: Option<Case>,
    /// Restitution, if a ball falls on it.
    pub ball: Option<f64>,
    free: bool,
    joints: usize,
}

pub fn case(seed: u64) -> Locked {
    let rng = &mut Rng::with_seed(seed);
    let kind = (seed % NAMES.len() as u64) as usize;
    let place = Place::random(rng);
    let (joint, count) = match kind {
        0 => ("point", 2),
        1 | 4 => (if kind == 4 && rng.bool() { "point" } else { "pin" }, 2),
        2 => ("weld", 2),
        3 => ("weld", 3),
        5 => ("point", 3),
        6 => ("pin", 5),
        7 => ("weld", 6),
        8 => (one_of(rng, &["point", "pin"]), 3),
        9 => (one_of(rng, &["point", "pin"]), 4),
        _ => ("pin", 6),
    };
    let spatial = (5..=7).contains(&kind) || kind == 10;
    let rubbing = rng.bool();
    let mut q: Vec<f64> = (0..count).map(|_| within(rng, 0.4, 1.2) * if rng.bool() { 1.0 } else { -1.0 }).collect();
    let at_limit = rng.u8(0..4) == 0;
    let mut parts = Vec::new();
    for k in 0..count {
        let parent = if k == 0 { "mount".to_owned() } else { format!("l{}", k - 1) };
        let axis = if spatial { direction(rng).into() } else { Z };
        let at = if k == 0 { O } else { [within(rng, 0.2, 0.5), 0.0, 0.0] };
        let friction = if rubbing { within(rng, 0.01, 1.0) } else { 0.0 };
        let upper = if at_limit && k == 0 { q[0] } else { 3.1 };
        let more = format!(
            r#"<dynamics friction="{friction:?}"/><limit lower="-3.1" upper="{upper:?}" effort="20" velocity="9"/>"#
        );
        parts.push(Part::new(&format!("l{k}"), &parent, "revolute", axis, at).random(rng, 0.3).joint(&more));
    }
    let r = within(rng, 0.02, 0.06);
    let end = [within(rng, 0.2, 0.4), 0.0, 0.0];
    let carries = rng.usize(0..count);
    let foot = [0.5 * end[0], 0.0, 0.0];
    parts[carries].shapes = shape(&ball(r), foot, O);
    let floating = kind == FLOATING;
    let root = Part::new("mount", "base", "fixed", Z, O).random(rng, 0.3).with(shape(&ball(r), [-0.2, 0.0, 0.0], O));
    let robot = |parts: &[Part]| match floating {
        true => rooted(&root.link(), parts),
        false => urdf(&[&[place.mount()], parts].concat()),
    };
    let text = robot(&parts);
    // Where the end of the last link and the foot are, in the axes of the world (of the root link if it floats).
    let bare = robot(&parts.iter().map(|part| Part { shapes: String::new(), ..part.clone() }).collect::<Vec<_>>());
    let chain = Chain::from_urdf_str(&bare, &Default::default()).expect("a robot");
    let mut workspace = chain.workspace();
    let kin = workspace.update(&chain, &q).expect("a pose");
    let last = chain.frame(&format!("l{}", count - 1)).expect("a link");
    let there = kin.position(chain.point(last, end.into()));
    let rpy: [f64; 3] = {
        let (roll, pitch, yaw) = nalgebra::Rotation3::from_matrix_unchecked(kin.pose(last).rotation).euler_angles();
        [roll, pitch, yaw]
    };
    let on = chain.frame(&format!("l{carries}")).expect("a link");
    let foot = kin.position(chain.point(on, foot.into()));
    let world = if floating { "link = \"mount\", ".to_owned() } else { String::new() };
    let mut scene = String::new();
    let free = kind >= FREE;
    let speed = if free { within(rng, -2.0, 2.0) } else { 0.0 };
    let mut qd = vec![speed; count];
    let base = q.clone();
    if floating {
        q = [vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], q].concat();
        qd = [(0..6).map(|_| within(rng, -1.5, 1.5)).collect(), qd].concat();
    }
    scene += &format!(
        "[[robot]]\nname = \"f\"\nurdf = \"f.urdf\"\ntip = \"l0\"\nfloating = {floating}\nq = {}\nqd = {}\n",
        list(&q),
        list(&qd)
    );
    if rng.u8(0..4) == 0 && !floating {
        scene += "controller = \"pd\"\nkp = 30\nkd = 0.5\ntarget = { jl0 = 0.1 }\n";
    }
    let held = format!(
        "[[loop]]\njoint = \"{joint}\"\nfirst = {{ link = \"f/l{}\", xyz = {} }}\nsecond = {{ {}xyz = {}, rpy = {} }}\n",
        count - 1,
        list(&end),
        world.replace("\"mount\"", "\"f/mount\""),
        list(there.as_slice()),
        list(&rpy)
    );
    let up = if floating { V::z() } else { place.vector(V::y()) };
    let (mut dropped, e) = (None, one_of(rng, &[0.0, 0.4, 1.0]));
    match rng.usize(0..3) {
        // A floor under the foot, which it touches, or under the floating frame.
        0 | 1 if !floating || rng.bool() => {
            let point = if floating { V::new(0.0, 0.0, 0.6) } else { foot - up * r };
            scene += &format!(
                "[[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = {}, normal = {} }} }}\n",
                list(point.as_slice()),
                list(up.as_slice())
            );
        }
        2 if !floating && !free => {
            dropped = Some(e);
            let above = foot + up * (2.0 * r + 0.05);
            scene += &format!(
                "[[robot]]\nname = \"b\"\nurdf = \"b.urdf\"\ntip = \"ball\"\nfloating = true\nposition = {}\n",
                list(above.as_slice())
            );
        }
        _ => {}
    }
    let rigid = floating.then(|| {
        let fixed: Vec<Part> = parts
            .iter()
            .zip(&base)
            .map(|(part, q)| Part { joint: "fixed", rpy: [0.0, 0.0, *q], more: String::new(), ..part.clone() })
            .collect();
        (
            rooted(&root.link(), &fixed),
            scene
                .replace(&format!("q = {}", list(&q)), &format!("q = {}", list(&q[..7])))
                .replace(&format!("qd = {}", list(&qd)), &format!("qd = {}", list(&qd[..6]))),
        )
    });
    let (law, limit) = (one_of(rng, &LAWS), one_of(rng, &[0.0, 0.5]));
    // A smooth blow through the centre of the ball does not turn it.
    let mu = if dropped.is_some() { 0.0 } else { one_of(rng, &[0.0, 0.5, 1.2]) };
    let end = format!(
        "[contact]\nlaw = \"{law}\"\nrestitution = {e:?}\nfriction = {mu:?}\nlimit_restitution = {limit:?}\n[run]\nduration = 0.3\n\
         tolerance = 1e-10\ngravity = {}\n",
        list((up * -9.81).as_slice())
    );
    let with = match dropped {
        Some(_) => ", a ball on it",
        None if scene.contains("floor") => ", a floor",
        None => "",
    };
    let mut files = vec![("f.urdf".to_owned(), text)];
    if dropped.is_some() {
        let part = Part::new("ball", "", "fixed", Z, O).with(shape(&ball(r), O, O));
        files.push(("b.urdf".to_owned(), rooted(&part.link(), &[])));
    }
    let case = Case { files, scene: format!("{scene}{held}{end}"), ..Case::default() };
    let rigid = rigid.map(|(text, scene)| Case {
        files: vec![("f.urdf".into(), text)],
        scene: format!("{scene}{end}"),
        ..Case::default()
    });
    Locked { group: format!("{}{with}", NAMES[kind]), case, rigid, ball: dropped, free, joints: count }
}

/// The largest distance of the points that the loops keep together.
pub fn open(answer: &Answer) -> f64 {
    let sim = &answer.scene.simulation;
    let mut workspace = sim.chain.workspace();
    let Ok(kin) = workspace.update(&sim.chain, &answer.summary.last.q) else { return f64::NAN };
    let place = |frame: &carom_sim::LoopFrame| match &frame.link {
        Some(link) => sim
            .chain
            .frame(link)
            .map_or(V::from_element(f64::NAN), |id| kin.position(sim.chain.point(id, frame.origin))),
        None => frame.origin,
    };
    sim.loops.iter().map(|own| (place(&own.frames[0]) - place(&own.frames[1])).norm()).fold(0.0, f64::max)
}

pub fn judge(seed: u64) -> Verdict {
    let it = case(seed);
    let group = it.group.clone();
    let answer = match it.case.run(Some(0.01), LIMIT) {
        // A linkage may wedge.
        End::Refused(by, why) if it.free && !energy::false_message(&why) => {
            return Verdict::open(group, format!("refused by the {by}"), why);
        }
        end => match end.done(&group) {
            Ok(answer) => answer,
            Err(verdict) => return verdict,
        },
    };
    let told = format!(
        "{} time steps, {} evaluations, events {:?}",
        answer.statistics().contact_steps,
        answer.statistics().evaluations,
        answer.names()
    );
    let gap = open(&answer);
    if gap > 1e-7 || gap.is_nan() {
        return Verdict::bad(group, "the loop opens", format!("{gap:.1e} m, {told}"));
    }
    // A run of 0.3 s at 1e-10 needs some hundred steps.
    if answer.statistics().evaluations > 300_000 || answer.statistics().contact_steps > 3000 {
        return Verdict::bad(group, "too many steps", told);
    }
    if let Some((class, note)) = energy::wrong(&answer) {
        return Verdict::bad(group, class, note);
    }
    if let Some(rigid) = &it.rigid {
        let wanted = match rigid.run(Some(0.01), LIMIT).done(&group) {
            Ok(wanted) => wanted,
            Err(verdict) => return verdict,
        };
        let n = answer.samples.len().min(wanted.samples.len());
        // Impacts may make the motions part: what follows the third of them is not compared.
        let until = wanted.events.get(2).map_or(f64::INFINITY, |event| event.time);
        let both = answer.samples.iter().zip(&wanted.samples).take(n).filter(|(_, wanted)| wanted.0 < until);
        let off = both.map(|(found, wanted)| compare(&found.2[..6], &wanted.2[..6])).fold(0.0, f64::max);
        let note = format!("{off:.1e}, {told}, wanted {:?}", wanted.names());
        return Verdict::new(
            group,
            if off < 1e-6 { "as a rigid body" } else { "not as a rigid body" },
            off >= 1e-6,
            note,
        );
    }
    if it.free {
        return Verdict::right(group, "closed and balanced", told);
    }
    let moved = answer.samples.iter().map(|(_, q, qd)| {
        let speed = qd[..it.joints].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        speed.max(compare(&q[..it.joints], &answer.samples[0].1[..it.joints]))
    });
    let moved = moved.fold(0.0, f64::max);
    if moved > 1e-7 || moved.is_nan() {
        return Verdict::bad(group, "a locked frame moves", format!("{moved:.1e}, {told}"));
    }
    if let Some(e) = it.ball {
        let hit = answer.events.iter().find(|event| ["impact", "several"].contains(&event.kind.name()));
        let Some(hit) = hit else { return Verdict::bad(group, "no impact", told) };
        let [before, after] = [0, 1].map(|side| V::from_column_slice(&hit.qd[side][it.joints..it.joints + 3]));
        // The ball has not turned: the axes of its body are those of the world.
        let off = (after + before * e).norm() / before.norm();
        return Verdict::new(
            group,
            if off < 1e-7 { "rebounds" } else { "another rebound" },
            off >= 1e-7,
            format!("{off:.1e}, {told}"),
        );
    }
    let class = if answer.statistics().contact_steps > 0 { "at rest, by time steps" } else { "at rest" };
    Verdict::right(group, class, told)
}

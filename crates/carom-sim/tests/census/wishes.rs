//! Keys of scenes with an effect of their own. The judge compares the motion with that effect: it is there, or the scene is refused, or a
//! warning names the key.

use super::build::*;
use super::case::{Answer, Case, End};
use super::{LIMIT, Verdict, compare};
use fastrand::Rng;

const G: f64 = 9.81;
/// What is wrong with an answer.
type Check = Box<dyn Fn(&Answer) -> Result<(), String>>;

/// A wish: its scene, and what the answer must be. The judge returns what is wrong.
pub struct Wish {
    pub group: String,
    pub case: Case,
    check: Check,
    /// The same scene without the wish: warnings that it has too are not about the wish.
    without: Option<Case>,
}

impl Wish {
    fn new(
        group: &str,
        files: Vec<(&str, String)>,
        scene: String,
        check: impl Fn(&Answer) -> Result<(), String> + 'static,
    ) -> Self {
        Self { group: group.to_owned(), case: case(files, scene), check: Box::new(check), without: None }
    }
}

fn near(found: f64, wanted: f64, share: f64, what: &str) -> Result<(), String> {
    let off = (found - wanted).abs();
    if off <= share * wanted.abs().max(1e-9) { Ok(()) } else { Err(format!("{what}: {found:e} instead of {wanted:e}")) }
}

fn case(files: Vec<(&str, String)>, scene: String) -> Case {
    Case { files: files.into_iter().map(|(name, text)| (name.to_owned(), text)).collect(), scene, ..Case::default() }
}

/// A body on vertical and horizontal sliders, or free, on a surface under its weight.
const BODIES: [&str; 7] =
    ["ball", "capsule, upright", "capsule, lying", "box", "box on an edge", "cylinder, upright", "mesh"];
const GROUNDS: [&str; 6] = ["halfspace", "box", "sphere", "cylinder", "capsule", "mesh"];

/// Half the height of the body, its shape, a file, and the number of contact points on a half-space.
fn body(kind: usize, r: f64) -> (f64, String, Option<(&'static str, String)>, usize) {
    let tip = 0.25 * std::f64::consts::PI;
    match kind {
        0 => (r, shape(&ball(r), O, O), None, 1),
        1 => (2.0 * r, shape(&capsule(r, 2.0 * r), O, O), None, 1),
        2 => (r, shape(&capsule(r, 2.0 * r), O, [0.0, 2.0 * tip, 0.0]), None, 2),
        3 => (r, shape(&brick([4.0 * r, 3.0 * r, 2.0 * r]), O, O), None, 4),
        4 => (r * 2.0_f64.sqrt(), shape(&brick([2.0 * r, 3.0 * r, 2.0 * r]), O, [0.0, tip, 0.0]), None, 2),
        5 => (r, shape(&cylinder(1.5 * r, 2.0 * r), O, O), None, 0),
        _ => {
            (r, shape(r#"<mesh filename="m.obj"/>"#, O, O), Some(("m.obj", brick_mesh([4.0 * r, 3.0 * r, 2.0 * r]))), 4)
        }
    }
}

fn ground(kind: usize) -> (String, Option<(&'static str, String)>) {
    let size = [1.0, 1.0, 0.2];
    let shape = match kind {
        0 => "halfspace = { point = [0, 0, 0], normal = [0, 0, 1] }",
        1 => "box = { centre = [0, 0, -0.1], size = [1, 1, 0.2] }",
        2 => "sphere = { centre = [0, 0, -0.5], radius = 0.5 }",
        3 => "cylinder = { centre = [0, 0, -0.5], radius = 0.5, length = 1, rpy = [1.5707963267948966, 0, 0] }",
        4 => "capsule = { centre = [0, 0, -0.5], radius = 0.5, length = 1, rpy = [1.5707963267948966, 0, 0] }",
        _ => "mesh = { file = \"g.obj\", position = [0, 0, -0.1] }",
    };
    let file = (kind == 5).then(|| ("g.obj", brick_mesh(size)));
    (format!("[[surface]]\nname = \"ground\"\nshape = {{ {shape} }}\n"), file)
}

/// A body on a vertical slider rests on a compliant ground: it sinks by what its weight asks for.
fn sinks(rng: &mut Rng) -> Wish {
    let (kind, on) = (rng.usize(0..BODIES.len()), rng.usize(0..GROUNDS.len()));
    let (r, mass) = (within(rng, 0.03, 0.1), within(rng, 0.5, 3.0));
    let (half, element, file, points) = body(kind, r);
    let k = 10_f64.powf(within(rng, 3.5, 5.5));
    let (force, n) = one_of(rng, &[("exponent = 1", 1.0), ("exponent = 1.5", 1.5), ("force = \"kelvin-voigt\"", 1.0)]);
    let law = format!("compliance = {{ stiffness = {k:?}, {force} }}");
    let free = rng.u8(0..3) == 0 && kind != 4 && on < 2;
    // Damped so that it does not oscillate; a free body has the damping of its contact only.
    let stiffness = n * k * (mass * G / k).powf(1.0 - 1.0 / n);
    let damping = (stiffness * mass).sqrt();
    let more = format!(r#"<dynamics damping="{damping:?}"/>"#);
    let part = Part::new("body", "base", "prismatic", Z, O).joint(&more).with(element).weighing(mass, [0.01 * mass; 3]);
    let start = half + 1e-4;
    let (text, q) = match free {
        true => (rooted(&part.link(), &[]), list(&[0.0, 0.0, start, 0.0, 0.0, 0.0, 1.0])),
        false => (urdf(&[part]), list(&[start])),
    };
    let (surface, second) = ground(on);
    let robot = format!("[robot]\nurdf = \"r.urdf\"\ntip = \"body\"\nfloating = {free}\nq = {q}\n");
    let scene = |wish: &str| {
        format!(
            "{robot}{surface}[contact]\nrestitution = 0.7\n{wish}\n[run]\nduration = {}\ngravity = [0, 0, {}]\n",
            if free { 4.0 } else { 2.0 },
            -G
        )
    };
    let files: Vec<_> = [Some(("r.urdf", text)), file, second].into_iter().flatten().collect();
    let height = move |answer: &Answer| {
        let tail = answer.samples.len().saturating_sub(20);
        let last = &answer.samples[tail..];
        let z = usize::from(free) * 2;
        last.iter().map(|(_, q, _)| q[z]).sum::<f64>() / last.len().max(1) as f64
    };
    let check = move |answer: &Answer| {
        let sunk = half - height(answer);
        let depth = |points: f64| (mass * G / (points * k)).powf(1.0 / n);
        // On a half-space each corner carries its share; on other surfaces it is open how many points carry, but not that they yield.
        let [least, most] = match (on, points) {
            (0, 1..) => [depth(points as f64); 2],
            _ => [depth(16.0), depth(1.0)],
        };
        let share = if free { 0.2 } else { 0.03 };
        if sunk < (1.0 - share) * least || sunk > (1.0 + share) * most {
            return Err(format!("sinks by {sunk:e} m instead of {least:e} to {most:e}, {:?}", answer.reasons.first()));
        }
        Ok(())
    };
    let without = Some(case(files.clone(), scene("")));
    let group = format!("compliance: {} on {}", BODIES[kind], GROUNDS[on]);
    Wish { without, ..Wish::new(&group, files, scene(&law), check) }
}

/// A compliant contact that begins deep inside cannot be what was meant.
fn deep(rng: &mut Rng) -> Wish {
    let (kind, on) = (rng.usize(0..BODIES.len()), rng.usize(0..2));
    let r = within(rng, 0.03, 0.1);
    let (half, element, file, _) = body(kind, r);
    let part = Part::new("body", "", "fixed", Z, O).with(element);
    // Deeper than half of the box it would be nearer to its lower side, or below it.
    let depth = (half * one_of(rng, &[0.5, 1.0, 3.0, 30.0])).min(if on == 1 { 0.09 } else { f64::INFINITY });
    let (surface, second) = ground(on);
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"body\"\nfloating = true\nq = [0, 0, {:?}, 0, 0, 0, 1]\n{surface}[contact]\nrestitution = 0.5\n\
         compliance = {{ stiffness = 1e5 }}\n[run]\nduration = 0.2\ngravity = [0, 0, {}]\n",
        half - depth,
        -G
    );
    let files: Vec<_> = [Some(("r.urdf", rooted(&part.link(), &[]))), file, second].into_iter().flatten().collect();
    // The penetration of the weight is some tenths of a millimetre.
    let check = move |_: &Answer| if depth < 0.01 { Ok(()) } else { Err(format!("starts {depth} m deep")) };
    Wish::new("compliance that starts deep", files, scene, check)
}

/// A ball on a vertical slider rebounds to the restitution's share of its speed, whatever the law, from a surface, another link or
/// a limit.
fn rebound(rng: &mut Rng) -> Wish {
    let law = one_of(rng, &LAWS);
    let (e, mu) = (within(rng, 0.1, 0.95), within(rng, 0.0, 1.0));
    let several = one_of(rng, &SEVERAL);
    let free = rng.bool();
    let part = Part::new("body", "base", "prismatic", Z, O).with(shape(&ball(0.1), O, O));
    let how = rng.usize(0..3);
    let limit = r#"<limit lower="0.1" upper="9" effort="1" velocity="1"/>"#;
    let part = if how == 2 { part.joint(limit) } else { part };
    let free = free && how != 2;
    let (text, q) = match free {
        true => (rooted(&part.link(), &[]), list(&[0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0])),
        false => (urdf(&[part]), "[0.3]".into()),
    };
    let (surface, second) = ground(if how == 2 { 0 } else { rng.usize(0..GROUNDS.len()) });
    let surface = if how == 2 { String::new() } else { surface };
    let mu = if several == "energetic" { 0.0 } else { mu };
    let keys = match how {
        0 => format!("law = \"{law}\"\nrestitution = {e:?}\nfriction = {mu:?}\nseveral = \"{several}\"\n"),
        1 => format!(
            "law = \"newton\"\nrestitution = 0.0\nseveral = \"{several}\"\n[[contact.pair]]\nlink = \"body\"\nsurface = \"ground\"\nlaw = \"{law}\"\nrestitution = {e:?}\nfriction = {mu:?}\n"
        ),
        _ if rng.bool() => format!("limit_restitution = {e:?}\n"),
        _ => format!("limit_restitution = 0.0\n[[contact.pair]]\njoint = \"jbody\"\nrestitution = {e:?}\n"),
    };
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"body\"\nfloating = {free}\nq = {q}\n{surface}[contact]\n{keys}[run]\nduration = 0.22\n{}gravity = [0, 0, {}]\n",
        one_of(rng, &["", "", "method = \"steps\"\ncontact_step = 1e-5\n"]),
        -G
    );
    let files: Vec<_> = [Some(("r.urdf", text)), second].into_iter().flatten().collect();
    let check = move |answer: &Answer| {
        // It has fallen by 0.2 m at the time √(2 · 0.2/g) = 0.20 s with the speed √(2 g 0.2), and rises.
        let (time, speed) = ((0.4 / G).sqrt(), (0.4 * G).sqrt());
        let z = usize::from(free) * 2;
        near(answer.summary.last.qd[z] + G * (0.22 - time), e * speed, 1e-3, "speed after the impact")
    };
    let group = ["restitution of [contact]", "restitution of a pair", "restitution of a limit"][how];
    Wish::new(group, files, scene, check)
}

/// A ball that slides on the floor without turning is slowed by μ g.
fn friction(rng: &mut Rng) -> Wish {
    let (law, mu, v) = (one_of(rng, &LAWS), within(rng, 0.1, 0.6), within(rng, 0.5, 2.0));
    let parts = [
        Part::new("beam", "base", "prismatic", X, O).weighing(0.2, [1e-3; 3]),
        Part::new("body", "beam", "prismatic", Z, O).with(shape(&ball(0.1), O, O)),
    ];
    let (surface, _) = ground(0);
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"body\"\nq = [0, 0.1]\nqd = [{:?}, 0]\n{surface}[contact]\nlaw = \"{law}\"\nfriction = {mu:?}\n[run]\nduration = 2\ngravity = [0, 0, {}]\n",
        v, -G
    );
    let check = move |answer: &Answer| {
        // The beam's mass moves along, and has no weight on the floor.
        let slowing = mu * G / 1.2;
        let (path, end) = (v * v / (2.0 * slowing), 2.0_f64);
        let (x, speed) = match v / slowing < end {
            true => (path, 0.0),
            false => (v * end - 0.5 * slowing * end * end, v - slowing * end),
        };
        near(answer.summary.last.q[0], x, 1e-6, "path")?;
        near(answer.summary.last.qd[0] + 1.0, speed + 1.0, 1e-6, "speed + 1")
    };
    Wish::new("friction", vec![("r.urdf", urdf(&parts))], scene, check)
}

/// Motors with limits change the energy by no more than their limits times the ways of their joints.
fn efforts(rng: &mut Rng) -> Wish {
    let n = rng.usize(1..5);
    let limits: Vec<f64> = (0..n).map(|_| within(rng, 0.05, 2.0)).collect();
    let mut parts = vec![Place::random(rng).mount()];
    for (k, limit) in limits.iter().enumerate() {
        let (parent, axis) = (if k == 0 { "mount".to_owned() } else { format!("l{}", k - 1) }, direction(rng).into());
        let joint = one_of(rng, &["revolute", "prismatic"]);
        let more = format!(r#"<limit lower="-40" upper="40" effort="{limit:?}" velocity="9"/>"#);
        parts.push(Part::new(&format!("l{k}"), &parent, joint, axis, [0.3, 0.0, 0.0]).random(rng, 0.3).joint(&more));
    }
    let targets: Vec<f64> = (0..n).map(|_| within(rng, -3.0, 3.0)).collect();
    let drive = match rng.usize(0..3) {
        0 => format!("controller = \"pd\"\nkp = 500\nkd = 1\ntarget = {}\n", list(&targets)),
        1 => format!(
            "controller = \"constant\"\ntorque = {}\n",
            list(&targets.iter().map(|x| 20.0 * x).collect::<Vec<_>>())
        ),
        _ => "controller = \"gravity-compensation\"\n".to_owned(),
    };
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\nqd = {}\n[run]\nduration = 0.5\neffort_limits = true\ngravity = {}\n{drive}",
        list(&vec![0.2; n]),
        list(&targets),
        list((direction(rng) * G).as_slice())
    );
    let check = move |answer: &Answer| {
        let mut own = super::case::Own::new(&answer.scene, &answer.plan);
        let energies: Vec<f64> =
            answer.samples.iter().map(|(_, q, qd)| own.kinetic(q, qd) + own.potential(q)).collect();
        for (k, pair) in answer.samples.windows(2).enumerate() {
            // A speed may have its maximum between two samples: the largest of those around, and a margin.
            let around = &answer.samples[k.saturating_sub(1)..(k + 3).min(answer.samples.len())];
            let fastest = |j: usize| around.iter().fold(0.15, |most: f64, (_, _, qd)| most.max(qd[j].abs() + 0.15));
            let ways = (0..n).map(|j| limits[j] * 1.001 * fastest(j) * (pair[1].0 - pair[0].0));
            let (most, change) = (ways.sum::<f64>(), (energies[k + 1] - energies[k]).abs());
            if change > most + 1e-6 {
                return Err(format!("{change:e} J within a sample at {} s, at most {most:e}", pair[0].0));
            }
        }
        Ok(())
    };
    Wish::new("effort limits", vec![("r.urdf", urdf(&parts))], scene, check)
}

/// Pendulums of which the floor can reach some, or robots that nothing can reach: all joints are in the answer, in the order of the
/// scene, with the motion that the full model gives.
fn whole(rng: &mut Rng) -> Wish {
    let n = rng.usize(2..6);
    let mut parts = Vec::new();
    for k in 0..n {
        let reached = rng.bool();
        let parent = if k > 0 && rng.u8(0..3) == 0 { format!("l{}", k - 1) } else { "base".to_owned() };
        let joint = one_of(rng, &["continuous", "revolute", "continuous", "fixed"]);
        let axis = if rng.bool() { Y } else { direction(rng).into() };
        let at = if parent == "base" {
            [within(rng, -1.0, 1.0), k as f64, if reached { 0.3 } else { 4.0 }]
        } else {
            [0.3, 0.0, 0.0]
        };
        let part = Part::new(&format!("l{k}"), &parent, joint, axis, at).random(rng, 0.2);
        parts.push(if rng.u8(0..4) > 0 { part.with(shape(&ball(0.05), [0.3, 0.0, 0.0], O)) } else { part });
    }
    let moving: Vec<&Part> = parts.iter().filter(|part| part.joint != "fixed").collect();
    let count = moving.len();
    let [q, qd] = [0.3, 1.0].map(|size| (0..count).map(|_| within(rng, -size, size)).collect::<Vec<_>>());
    let drive = match rng.usize(0..4) {
        0 => format!("controller = \"pd\"\nkp = 3\nkd = 0.1\ntarget = {}\n", list(&vec![0.1; count])),
        1 => format!("controller = \"constant\"\ntorque = {}\n", list(&vec![0.2; count])),
        2 => "controller = \"gravity-compensation\"\n".to_owned(),
        _ => String::new(),
    };
    let spring = match moving.first() {
        Some(part) if rng.bool() => format!("[[spring]]\njoint = \"j{}\"\nstiffness = 2\ndamping = 0.01\n", part.name),
        _ => String::new(),
    };
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\nqd = {}\n[[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
         {spring}[contact]\nlaw = \"{}\"\nrestitution = 0.3\n[run]\nduration = 0.3\ngravity = [0, 0, {}]\n{drive}",
        list(&q),
        list(&qd),
        one_of(rng, &LAWS),
        -G
    );
    let files = vec![("r.urdf", urdf(&parts))];
    let full = case(files.clone(), format!("{scene}model = \"full\"\n"));
    let check = move |answer: &Answer| {
        let found = &answer.summary.last;
        if (found.q.len(), found.qd.len()) != (q.len(), qd.len()) {
            return Err(format!("{} numbers in q for {} joints", found.q.len(), q.len()));
        }
        if answer.events.iter().any(|event| event.q.len() != q.len() || event.qd[1].len() != qd.len()) {
            return Err("an event without all joints".into());
        }
        let End::Done(wanted) = full.run(None, LIMIT) else { return Ok(()) };
        let off = compare(&found.q, &wanted.summary.last.q).max(compare(&found.qd, &wanted.summary.last.qd));
        near(off + 1.0, 1.0, 1e-5, "1 + the difference to the full model")?;
        // Parts that cannot move add a constant, or not.
        let change = |answer: &Answer| answer.books().end - answer.books().start;
        let scale = wanted.scale();
        near(change(answer) + scale, change(&wanted) + scale, 1e-5, "scale and change of energy")
    };
    Wish::new("parts out of reach", files, scene, check)
}

/// Balls in a row on a slider each: the law for several contacts keeps momentum, gains no energy, leaves nothing approaching, and
/// refuses friction where it has none.
fn several(rng: &mut Rng) -> Wish {
    let law = one_of(rng, &SEVERAL);
    let n = rng.usize(2..6);
    let masses: Vec<f64> = (0..n).map(|_| within(rng, 0.2, 3.0)).collect();
    let e = one_of(rng, &[0.0, 0.5, 1.0]);
    let mu = if rng.u8(0..4) == 0 { 0.3 } else { 0.0 };
    let parts: Vec<Part> = (0..n)
        .map(|k| {
            let part = Part::new(&format!("l{k}"), "base", "prismatic", X, [0.2 * k as f64, 0.0, 0.0]);
            part.with(shape(&ball(0.1), O, O)).weighing(masses[k], [0.01; 3])
        })
        .collect();
    let mut qd = vec![0.0; n];
    qd[0] = 1.0;
    let mut q = vec![0.0; n];
    q[0] = -0.05;
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"l0\"\nq = {}\nqd = {}\n[contact]\nlinks = \"all\"\nseveral = \"{law}\"\nlaw = \"newton\"\nrestitution = {e:?}\nfriction = {mu:?}\n[run]\nduration = 0.06\n",
        list(&q),
        list(&qd)
    );
    let check = move |answer: &Answer| {
        if law == "energetic" && mu > 0.0 {
            return Err("friction under several = \"energetic\" is ignored".into());
        }
        let v = &answer.summary.last.qd;
        near(v.iter().zip(&masses).map(|(v, m)| v * m).sum(), masses[0], 1e-9, "momentum")?;
        let energy = v.iter().zip(&masses).map(|(v, m)| v * v * m).sum::<f64>();
        if energy > masses[0] * (1.0 + 1e-9) {
            return Err(format!("twice the energy: {energy} of {}", masses[0]));
        }
        if v[0] > 1.0 - 1e-6 {
            return Err("no impact".into());
        }
        Ok(())
    };
    Wish::new(&format!("several = \"{law}\""), vec![("r.urdf", urdf(&parts))], scene, check)
}

/// A latch holds what it has touched.
fn latch(rng: &mut Rng) -> Wish {
    let part = Part::new("body", "base", "prismatic", Z, O).with(shape(&ball(0.1), O, O));
    let (surface, second) = ground(rng.usize(0..GROUNDS.len()));
    let scene = format!(
        "[robot]\nurdf = \"r.urdf\"\ntip = \"body\"\nq = [0.2]\nqd = [{:?}]\n{surface}[contact]\nlatch = true\nrestitution = 0.9\n\
         [run]\nduration = 1\n",
        within(rng, -2.0, -0.5)
    );
    let check = |answer: &Answer| {
        near(answer.summary.last.q[0], 0.1, 1e-6, "place of the latch")?;
        near(answer.summary.last.qd[0] + 1.0, 1.0, 1e-9, "1 + speed")
    };
    let files: Vec<_> = [Some(("r.urdf", urdf(&[part]))), second].into_iter().flatten().collect();
    Wish::new("latch", files, scene, check)
}

/// A loop stays closed while its linkage moves.
fn closed(rng: &mut Rng) -> Wish {
    // The linkages with freedom and a floor are among the seeds of the census of loops.
    let locked = super::locked::case(11 * rng.u64(0..1000) + rng.u64(8..11));
    let check = |answer: &Answer| {
        let gap = super::locked::open(answer);
        if gap <= 1e-7 { Ok(()) } else { Err(format!("the loop opens by {gap:e} m")) }
    };
    Wish { group: "loop".into(), case: locked.case, check: Box::new(check), without: None }
}

pub fn wish(seed: u64) -> Wish {
    let rng = &mut Rng::with_seed(seed);
    match seed % 10 {
        0..3 => sinks(rng),
        3 => deep(rng),
        4 => rebound(rng),
        5 => friction(rng),
        6 => efforts(rng),
        7 => whole(rng),
        8 => several(rng),
        _ if rng.bool() => latch(rng),
        _ => closed(rng),
    }
}

pub fn judge(seed: u64) -> Verdict {
    let Wish { group, case, check, without } = wish(seed);
    let answer = match case.run(Some(0.005), LIMIT) {
        End::Refused(by, why) if !super::energy::false_message(&why) => {
            return Verdict::open(group, format!("refused by the {by}"), why);
        }
        other => match other.done(&group) {
            Ok(answer) => answer,
            Err(verdict) => return verdict,
        },
    };
    let Err(why) = check(&answer) else { return Verdict::right(group, "fulfilled", String::new()) };
    let usual = without.and_then(|case| case.load().ok()).map_or_else(Vec::new, |scene| scene.warnings);
    let warned: Vec<_> = answer.scene.warnings.iter().filter(|warning| !usual.contains(warning)).collect();
    if warned.is_empty() { Verdict::bad(group, "ignored", why) } else { Verdict::open(group, "warned of", why) }
}

//! Random scenes: one to three robots, fixed or floating, with surfaces, contacts, controllers, springs, forces and loops of all kinds.

use super::build::*;
use super::case::Case;
use carom_chain::Chain;
use fastrand::Rng;

/// A scene as text, in parts, so that a judge may change how it is computed.
#[derive(Clone)]
pub struct Scene {
    pub files: Vec<(String, String)>,
    pub text: String,
    pub tolerance: f64,
    pub steps: bool,
    pub kind: String,
}

impl Scene {
    /// With other keys of `[run]`.
    pub fn case(&self, tolerance: f64, more: &str) -> Case {
        let scene = format!("{}tolerance = {tolerance:?}\n{more}", self.text);
        Case { files: self.files.clone(), scene, ..Case::default() }
    }

    pub fn as_is(&self) -> Case {
        self.case(self.tolerance, if self.steps { "method = \"steps\"\n" } else { "" })
    }
}

fn body_shape(rng: &mut Rng, files: &mut Vec<(String, String)>) -> String {
    let size = |rng: &mut Rng| within(rng, 0.02, 0.1);
    let element = match rng.usize(0..21) {
        0..7 => ball(size(rng)),
        7..12 => brick([size(rng), size(rng), size(rng)].map(|x| 1.5 * x)),
        12..16 => cylinder(size(rng), 2.0 * size(rng)),
        16..20 => capsule(0.7 * size(rng), 2.0 * size(rng)),
        _ => {
            let name = format!("m{}.obj", files.len());
            files.push((name.clone(), brick_mesh([size(rng), size(rng), size(rng)].map(|x| 1.5 * x))));
            format!(r#"<mesh filename="{name}"/>"#)
        }
    };
    let rpy = if rng.bool() { O } else { turn(rng) };
    shape(&element, [within(rng, 0.0, 0.1), within(rng, -0.03, 0.03), 0.0], rpy)
}

fn joint_xml(kind: &str, rng: &mut Rng) -> String {
    let (damping, friction) = (one_of(rng, &[0.0, 0.0, 0.02, 0.2]), one_of(rng, &[0.0, 0.0, 0.0, 0.05]));
    let dynamics = format!(r#"<dynamics damping="{damping:?}" friction="{friction:?}"/>"#);
    let half = if kind == "prismatic" { within(rng, 0.15, 0.3) } else { within(rng, 1.0, 3.0) };
    format!(
        r#"{dynamics}<limit lower="{:?}" upper="{half:?}" effort="{:?}" velocity="20"/>"#,
        -half,
        within(rng, 1.0, 60.0)
    )
}

/// A tree of 1 to 10 joints, as a table `[[robot]]`, and its number.
fn robot(number: usize, rng: &mut Rng, files: &mut Vec<(String, String)>) -> String {
    let name = format!("r{number}");
    let (floating, flat) = (rng.u8(0..20) < 9, rng.u8(0..3) == 0);
    let count = if floating { rng.usize(0..8) } else { rng.usize(1..10) };
    let mut root = Part::new("l0", "", "fixed", Z, O).random(rng, 0.15);
    root.mass *= 10_f64.powf(within(rng, -1.0, 1.0));
    if rng.u8(0..5) > 0 || count == 0 {
        root = root.with(body_shape(rng, files));
    }
    let (mut parts, mut q, mut qd) = (Vec::<Part>::new(), Vec::new(), Vec::new());
    for k in 0..count {
        let parent = if rng.u8(0..5) > 0 { k } else { rng.usize(0..=k) };
        let joint = one_of(
            rng,
            &["revolute", "revolute", "revolute", "continuous", "continuous", "prismatic", "prismatic", "fixed"],
        );
        let axis: [f64; 3] = match (flat, joint) {
            (true, "prismatic") => [within(rng, -1.0, 1.0), 0.0, within(rng, 0.1, 1.0)],
            (true, _) => Y,
            (false, _) if rng.bool() => one_of(rng, &[X, Y, Z]),
            _ => direction(rng).into(),
        };
        let aside = if flat { 0.0 } else { within(rng, -0.05, 0.05) };
        let at = [within(rng, 0.1, 0.25), aside, within(rng, -0.05, 0.05)];
        let rpy = if flat {
            [0.0, within(rng, -1.0, 1.0), 0.0]
        } else if rng.bool() {
            turn(rng)
        } else {
            O
        };
        let mut part = Part::new(&format!("l{}", k + 1), &format!("l{parent}"), joint, axis, at).turned(rpy);
        part = part.random(rng, 0.15).joint(&joint_xml(joint, rng));
        let mass = 10_f64.powf(within(rng, -1.0, 0.7));
        (part.mass, part.inertia) = (part.mass * mass, part.inertia.map(|x| x * mass));
        let leader =
            (k > 0 && rng.u8(0..15) == 0).then(|| parts.iter().find(|other| other.joint == joint && joint != "fixed"));
        if let Some(Some(leader)) = leader
            && !leader.more.contains("<mimic")
        {
            part =
                part.joint(&format!(r#"<mimic joint="j{}" multiplier="{:?}"/>"#, leader.name, within(rng, -1.0, 1.0)));
        } else if joint != "fixed" {
            q.push(if joint == "prismatic" { within(rng, -0.1, 0.1) } else { within(rng, -0.8, 0.8) });
            qd.push(within(rng, -4.0, 4.0));
        }
        if rng.u8(0..5) > 0 {
            part = part.with(body_shape(rng, files));
        }
        parts.push(part);
    }
    let joints = qd.len();
    let mut table =
        format!("[[robot]]\nname = \"{name}\"\nurdf = \"{name}.urdf\"\ntip = \"l0\"\nfloating = {floating}\n");
    let base = if floating { 6 } else { 0 };
    let mut all: Vec<f64> = (0..base).map(|_| within(rng, -1.5, 1.5)).collect();
    all.extend(qd);
    let at = [number as f64 * within(rng, 0.5, 1.2), within(rng, -0.3, 0.3), within(rng, 0.3, 1.2)];
    let rpy = if flat && rng.bool() { O } else { turn(rng) };
    table += &format!("position = {}\nrpy = {}\nq = {}\nqd = {}\n", list(&at), list(&rpy), list(&q), list(&all));
    match rng.u8(0..8) {
        0 if joints > 0 => {
            let named = |rng: &mut Rng, low: f64, high: f64, parts: &[Part]| {
                let moving = parts.iter().filter(|part| part.joint != "fixed" && !part.more.contains("<mimic"));
                let of = moving.map(|part| format!("j{} = {:?}", part.name, within(rng, low, high)));
                of.collect::<Vec<_>>().join(", ")
            };
            let (kp, kd) = (10_f64.powf(within(rng, 0.0, 3.0)), 10_f64.powf(within(rng, -1.0, 1.5)));
            let target = named(rng, -1.0, 1.0, &parts);
            table += &format!("controller = \"pd\"\nkp = {kp:?}\nkd = {kd:?}\ntarget = {{ {target} }}\n");
        }
        1 if joints > 0 => {
            let torques: Vec<f64> =
                (0..base + joints).map(|k| if k < base { 0.0 } else { within(rng, -3.0, 3.0) }).collect();
            table += &format!("controller = \"constant\"\ntorque = {}\n", list(&torques));
        }
        2 if joints > 0 => table += "controller = \"gravity-compensation\"\n",
        _ => {}
    }
    if rng.u8(0..12) == 0
        && let Some(part) = parts.iter().find(|part| ["revolute", "continuous"].contains(&part.joint))
        && !part.more.contains("<mimic")
    {
        let (stiffness, damping) = (10_f64.powf(within(rng, 0.0, 3.0)), within(rng, 0.0, 0.3));
        table += &format!(
            "[[spring]]\njoint = \"{name}/j{}\"\nstiffness = {stiffness:?}\ndamping = {damping:?}\n",
            part.name
        );
    }
    let robot = rooted(&root.link(), &parts);
    if !floating && rng.u8(0..8) == 0 && joints >= 4 {
        table += &closure(&name, &robot, &q, count, (V::from(at), rpy), rng);
    }
    files.push((format!("{name}.urdf"), robot));
    table
}

/// A ball joint between the last link and the world, where it is at the start.
fn closure(name: &str, robot: &str, q: &[f64], last: usize, (at, rpy): (V, [f64; 3]), rng: &mut Rng) -> String {
    // Shapes are not needed for the pose, and their meshes are not there.
    let mut bare = robot.to_owned();
    while let (Some(start), Some(end)) = (bare.find("<collision>"), bare.find("</collision>")) {
        bare.replace_range(start..end + "</collision>".len(), "");
    }
    let Ok(chain) = Chain::from_urdf_str(&bare, &Default::default()) else { return String::new() };
    let (Ok(frame), mut workspace) = (chain.frame(&format!("l{last}")), chain.workspace()) else {
        return String::new();
    };
    let own = direction(rng) * 0.1;
    let Ok(kin) = workspace.update(&chain, q) else { return String::new() };
    let there = Place { at, rpy }.point(kin.position(chain.point(frame, own)));
    let [own, there] = [own, there].map(|p| list(p.as_slice()));
    format!(
        "[[loop]]\njoint = \"point\"\nfirst = {{ link = \"{name}/l{last}\", xyz = {own} }}\nsecond = {{ xyz = {there} }}\n"
    )
}

fn surface(k: usize, rng: &mut Rng, files: &mut Vec<(String, String)>) -> String {
    let centre = list(&[within(rng, -1.5, 1.5), within(rng, -1.0, 1.0), within(rng, -0.8, 0.6)]);
    let rpy = list(&turn(rng));
    let size = |rng: &mut Rng| within(rng, 0.1, 0.6);
    let shape = match rng.usize(0..16) {
        n if k == 0 || n < 5 => {
            let normal = V::new(within(rng, -0.3, 0.3), within(rng, -0.3, 0.3), 1.0);
            let normal = if rng.bool() { V::z() } else { normal };
            format!(
                "halfspace = {{ point = [0, 0, {:?}], normal = {} }}",
                within(rng, -0.6, 0.0),
                list(normal.as_slice())
            )
        }
        5..9 => {
            format!("box = {{ centre = {centre}, size = {}, rpy = {rpy} }}", list(&[size(rng), size(rng), size(rng)]))
        }
        9..12 => format!("sphere = {{ centre = {centre}, radius = {:?} }}", 0.5 * size(rng)),
        12 | 13 => format!(
            "cylinder = {{ centre = {centre}, radius = {:?}, length = {:?}, rpy = {rpy} }}",
            0.5 * size(rng),
            size(rng)
        ),
        14 => format!(
            "capsule = {{ centre = {centre}, radius = {:?}, length = {:?}, rpy = {rpy} }}",
            0.4 * size(rng),
            size(rng)
        ),
        _ => {
            files.push((format!("s{k}.obj"), brick_mesh([size(rng), size(rng), size(rng)])));
            format!("mesh = {{ file = \"s{k}.obj\", position = {centre}, rpy = {rpy} }}")
        }
    };
    let mut v = |size: f64| list(&[0.0; 3].map(|_: f64| within(rng, -size, size)));
    let more = match k % 5 {
        1 => format!("motion = {{ amplitude = {}, frequency = 7.3 }}\n", v(0.01)),
        2 => format!("belt = {{ velocity = {} }}\n", v(0.8)),
        _ => String::new(),
    };
    let more = if rng.u8(0..4) == 0 { more } else { String::new() };
    format!("[[surface]]\nname = \"s{k}\"\nshape = {{ {shape} }}\n{more}")
}

/// The scene of a seed.
pub fn scene(seed: u64) -> Scene {
    let rng = &mut Rng::with_seed(seed);
    let (mut files, mut text) = (Vec::new(), String::new());
    let robots = one_of(rng, &[1, 1, 1, 2, 2, 3]);
    (0..robots).for_each(|number| text += &robot(number, rng, &mut files));
    (0..rng.usize(0..5)).for_each(|k| text += &surface(k, rng, &mut files));
    let (law, several) = (one_of(rng, &LAWS), one_of(rng, &["moreau", "moreau", "poisson", "sequential", "energetic"]));
    let compliant = rng.u8(0..5) == 0;
    let steps = !compliant && rng.u8(0..6) == 0;
    let e = one_of(rng, &[0.0, 0.1, 0.5, 0.8, 1.0]);
    let e = if compliant && e == 0.0 { 0.3 } else { e };
    let mu = if several == "energetic" { 0.0 } else { one_of(rng, &[0.0, 0.1, 0.3, 0.6, 1.0]) };
    let limit = one_of(rng, &[0.0, 0.3, 1.0]);
    text += &format!(
        "[contact]\nlaw = \"{law}\"\nseveral = \"{several}\"\nrestitution = {e:?}\nfriction = {mu:?}\nlimit_restitution = {limit:?}\n"
    );
    if law == "chatterjee-ruina" {
        text += &format!("tangential_restitution = {:?}\n", within(rng, -1.0, 1.0));
    }
    if rng.u8(0..4) == 0 {
        text += "links = \"all\"\n";
    }
    if rng.u8(0..40) == 0 {
        text += "latch = true\n";
    }
    if compliant {
        let bristle = "bristle = { stiffness = 1e5, damping = 10 }";
        let more = ["exponent = 1.5", "exponent = 1", "force = \"kelvin-voigt\"", "force = \"walton-braun\"", bristle];
        let compliance =
            format!("compliance = {{ stiffness = {:?}, {} }}", 10_f64.powf(within(rng, 4.0, 8.0)), one_of(rng, &more));
        // The first surface is a half-space, on which all shapes can be compliant; between other bodies few can.
        let first = "name = \"s0\"\n";
        match rng.u8(0..4) > 0 && text.contains(first) {
            true => text = text.replace(first, &format!("{first}contact = {{ {compliance} }}\n")),
            false => text += &format!("{compliance}\n"),
        }
    }
    let g = one_of(rng, &["[0, 0, -9.81]", "[0, 0, -9.81]", "[0, 0, -9.81]", "[0, 0, 0]", "[1, -2, -5]"]);
    text += &format!("[run]\nduration = 1\ngravity = {g}\n");
    if rng.u8(0..10) == 0 {
        text += "model = \"full\"\n";
    }
    let tolerance = one_of(rng, &[1e-9, 1e-9, 1e-7, 1e-6]);
    let kind = match () {
        () if compliant => "compliant",
        () if steps => "method = \"steps\"",
        () if text.contains("[[loop]]") => "rigid, with a loop",
        () => "rigid",
    };
    Scene { files, text, tolerance, steps, kind: kind.into() }
}

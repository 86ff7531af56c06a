//! Periodic orbits: references of the literature and closed forms, and that iteration of the map agrees with Newton's method.

use crate::shaken_table::shaken;
use carom_study::orbit::{Branch, Orbit, OrbitError, Problem, Stability};
use carom_testing::files::{Folder, path};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::ops::Deref;

#[track_caller]
pub fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found} instead of {expected}");
}

/// The parameter at the only special point of this kind.
#[track_caller]
pub fn only(branch: &Branch, kind: &str) -> f64 {
    let all: Vec<f64> = branch.special.iter().filter(|it| it.kind == kind).map(|it| it.parameter).collect();
    assert_eq!(all.len(), 1, "{kind}: {:?} {}", branch.special, branch.end);
    all[0]
}

/// A problem with the folder of its files.
pub struct Case(Problem, pub Folder);

impl Deref for Case {
    type Target = Problem;

    fn deref(&self) -> &Problem {
        &self.0
    }
}

/// A problem whose files are these texts.
pub fn problem(robot: &str, scene: &str, keys: &str) -> Result<Case, OrbitError> {
    let folder = Folder::new();
    for (name, text) in [("robot.urdf", robot), ("scene.toml", scene)] {
        std::fs::write(folder.0.join(name), text).unwrap();
    }
    Ok(Case(Problem::from_toml(&format!("scene = \"scene.toml\"\n{keys}"), &folder.0)?, folder))
}

/// A link with a point mass.
pub fn mass(name: &str, mass: f64, below: f64, inertia: f64) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="0 0 {}"/><mass value="{mass}"/>
           <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>FEET</link>"#,
        -below
    )
}

pub fn joint(name: &str, kind: &str, [parent, child]: [&str; 2], axis: &str) -> String {
    let limit = if kind == "prismatic" { r#"<limit effort="0" velocity="100"/>"# } else { "" };
    format!(
        r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>{limit}</joint>"#
    )
}

/// A point as good as without size.
pub fn foot(at: [f64; 3]) -> String {
    let [x, y, z] = at;
    format!(r#"<collision><origin xyz="{x} {y} {z}"/><geometry><sphere radius="1e-12"/></geometry></collision>"#)
}

/// Two legs of length 1 with these masses at the hip and in each leg, `below` the hip.
pub fn biped(hip: f64, leg: f64, below: f64) -> String {
    let mut urdf = String::from(r#"<robot name="biped"><link name="ground"/><link name="rail"/>"#);
    urdf += &joint("x", "prismatic", ["ground", "rail"], "1 0 0");
    urdf += &mass("hip", hip, 0.0, 0.0).replace("FEET", "");
    urdf += &joint("z", "prismatic", ["rail", "hip"], "0 0 1");
    for side in ["left", "right"] {
        urdf += &mass(&format!("{side}_leg"), leg, below, 0.0).replace("FEET", &foot([0.0, 0.0, -1.0]));
        urdf += &joint(side, "continuous", ["hip", &format!("{side}_leg")], "0 1 0");
    }
    urdf + "</robot>"
}

/// The walk of a biped down a slope, from a stance angle, its rate and that of the swing leg.
pub fn walk(gravity: f64, slope: f64, [stance, rate, swing]: [f64; 3]) -> String {
    let (sin, cos) = stance.sin_cos();
    format!(
        r#"
[robot]
urdf = "robot.urdf"
tip = "hip"
q = {{ x = 0, z = {cos}, left = {stance}, right = {} }}
qd = [{}, {}, {rate}, {swing}]
[[surface]]
name = "slope"
shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}
[contact]
restitution = 0
friction = 1
[[contact.pair]]
link = "left_leg"
closes_while = "right"
[[contact.pair]]
link = "right_leg"
closes_while = "left"
[run]
duration = 8
gravity = [{}, 0, {}]"#,
        -stance,
        rate * cos,
        -rate * sin,
        gravity * slope.sin(),
        -gravity * slope.cos()
    )
}

pub const STEP: &str = r#"
section.contact = "right_leg"
orbit.modulo = ["x"]
orbit.relabel = { left = "right", right = "left" }
"#;

/// The multipliers that are not zero.
fn nonzero(orbit: &Orbit) -> Vec<[f64; 2]> {
    orbit.multipliers.iter().filter(|x| x.norm() > 1e-6).map(|x| [x.re, x.im]).collect()
}

/// External truth: Goswami, Thuilot & Espiau (1998), with more digits by an independent integration (scipy, tolerance 1e-13).
#[test]
fn the_compass_gait_has_the_published_cycle_and_multipliers() {
    type Case = (f64, [f64; 4], [[f64; 2]; 3]);
    let cases: [Case; 2] = [
        (
            3.0,
            [-0.218668802939, 1.092383589884, 0.377373948907, 0.734346391159],
            [[-0.19972613, 0.54447606], [-0.19972613, -0.54447606], [0.13157262, 0.0]],
        ),
        (
            2.0,
            [-0.201356778725, 1.012638104257, 0.519189049368, 0.719652212362],
            [[0.09804256, 0.58438725], [0.09804256, -0.58438725], [0.1604889, 0.0]],
        ),
    ];
    for (degrees, [angle, rate, swing, time], multipliers) in cases {
        let slope = f64::to_radians(degrees);
        let near = [angle - slope + 3e-3, rate - 0.01, swing + 0.01];
        let problem = problem(&biped(10.0, 5.0, 0.5), &walk(9.81, slope, near), STEP).unwrap();
        let orbit = problem.find().unwrap();
        close("angle", orbit.start.q[2] + slope, angle, 2e-12);
        close("rate", orbit.start.qd[2], rate, 2e-11);
        close("swing", orbit.start.qd[3], swing, 2e-11);
        close("time", orbit.period, time, 2e-12);
        assert_eq!(orbit.stability, Stability::Stable);
        // Multipliers do not depend on the section: the next stance leg passes the normal of the slope.
        let middle = STEP.replace("contact = \"right_leg\"", "rising = \"right\"");
        let other = Case(
            Problem::from_toml(&format!("scene = \"scene.toml\"\n{middle}"), &problem.1.0).unwrap(),
            Folder::new(),
        );
        let other = other.find().unwrap();
        close("time from another section", other.period, orbit.period, 1e-11);
        for (one, two) in nonzero(&orbit).iter().zip(nonzero(&other)) {
            (0..2).for_each(|k| close("multiplier from another section", two[k], one[k], 1e-7));
        }
        // Without the exchange of the legs a period has two steps: in one of them this leg stands, and the impact of the other one lifts it.
        let stride = "section.contact = \"right_leg\"\norbit.modulo = [\"x\"]";
        let stride = Problem::from_toml(&format!("scene = \"scene.toml\"\n{stride}"), &problem.1.0).unwrap();
        close("stride", stride.find().unwrap().period, 2.0 * orbit.period, 1e-11);
        let found = nonzero(&orbit);
        assert_eq!(found.len(), 3, "{:?}", orbit.multipliers);
        for (found, expected) in found.iter().zip(&multipliers) {
            (0..2).for_each(|k| close("multiplier", found[k], expected[k], 1e-8));
        }
    }
}

/// External truth: Garcia et al. (1998), with more digits by an independent integration. Its feet have no mass: three small masses are
/// extrapolated by a parabola.
#[test]
fn the_limit_of_light_feet_is_the_simplest_walker() {
    let masses = [1e-3, 1e-4, 1e-5];
    let vary = "vary = { parameter = \"slope\", from = 0.0145, to = 0.0155, set = { \"run.gravity[0]\" = \"sin(slope)\", \
                \"run.gravity[2]\" = \"-cos(slope)\" } }";
    let mut columns = Vec::new();
    for mass in masses {
        let (stance, rate) = (-0.2003109, 0.1998325);
        let scene = walk(1.0, 0.009, [stance, rate, rate * (2.0 * stance).cos()]);
        let orbit = problem(&biped(1.0, mass, 1.0), &scene, STEP).unwrap().find().unwrap();
        let pair = nonzero(&orbit)[0];
        let (stance, rate) = (-0.2346, 0.2322);
        let scene = walk(1.0, 0.0145, [stance, rate, rate * (2.0 * stance).cos()]);
        let branch = problem(&biped(1.0, mass, 1.0), &scene, &format!("{STEP}{vary}")).unwrap().branch().unwrap();
        let flip = only(&branch, "flip");
        columns.push([-orbit.start.q[2], orbit.start.qd[2], orbit.period, pair[0], pair[1], flip]);
    }
    let limit = |k: usize| {
        let weight = |i: usize| -> f64 {
            let others = (0..3).filter(|j| *j != i);
            others.map(|j| masses[j] / (masses[j] - masses[i])).product()
        };
        (0..3).map(|i| weight(i) * columns[i][k]).sum::<f64>()
    };
    let expected = [0.2003109005443, 0.1998324730050, 3.882463752851, -0.19009984, 0.55759878, 0.015088438];
    // The error of the parabola is of third order in the masses, 1e-9 of its coefficient.
    let tolerances = [2e-10, 2e-10, 2e-8, 2e-7, 2e-7, 2e-9];
    for (k, (expected, tolerance)) in expected.into_iter().zip(tolerances).enumerate() {
        close(&format!("number {k}"), limit(k), expected, tolerance);
    }
}

/// A wheel of eight spokes of length 1, without a rim: 1 kg at the hub, with a moment of inertia.
pub fn wheel(inertia: f64) -> String {
    let mut feet = String::new();
    for k in 0..8 {
        let angle = PI / 8.0 * f64::from(1 + 2 * k);
        feet += &foot([angle.sin(), 0.0, -angle.cos()]);
    }
    let mut urdf = String::from(r#"<robot name="wheel"><link name="ground"/><link name="rail"/><link name="post"/>"#);
    urdf += &joint("x", "prismatic", ["ground", "rail"], "1 0 0");
    urdf += &joint("z", "prismatic", ["rail", "post"], "0 0 1");
    urdf += &mass("wheel", 1.0, 0.0, inertia).replace("FEET", &feet);
    urdf += &joint("pitch", "continuous", ["post", "wheel"], "0 1 0");
    urdf + "</robot>"
}

/// The wheel on a slope with two spokes on it, at the height cos α of its hub, with these velocities and gravity along x and z.
pub fn rolling(alpha: f64, [vx, vz, rate]: [f64; 3], [gx, gz]: [f64; 2]) -> String {
    format!(
        r#"
[robot]
urdf = "robot.urdf"
tip = "wheel"
q = [0, {}, 0]
qd = [{vx}, {vz}, {rate}]
[[surface]]
name = "slope"
shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}
[contact]
restitution = 0
friction = 2
[run]
duration = 5
gravity = [{gx}, 0, {gz}]"#,
        alpha.cos()
    )
}

/// A rod of 1 kg on a hinge about y, its centre 0.3 m below.
fn pendulum(more: &str) -> String {
    let hinge = joint("j", "continuous", ["base", "rod"], "0 1 0").replace("</joint>", &format!("{more}</joint>"));
    format!(
        r#"<robot name="pendulum"><link name="base"/>{}{hinge}</robot>"#,
        mass("rod", 1.0, 0.3, 0.02).replace("FEET", "")
    )
}

/// 2π/M(1, cos φ₀/2) √(J/(m g l)), by the arithmetic-geometric mean M.
fn period_of_a_pendulum(amplitude: f64) -> f64 {
    let (mut a, mut b) = (1.0, (0.5 * amplitude).cos());
    for _ in 0..8 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    TAU / a * ((0.02 + 0.09) / (9.81 * 0.3_f64)).sqrt()
}

/// The start of a cycle on a section through zero is that of its end up to rounding, on one side or the other.
#[test]
fn a_pendulum_has_the_period_of_its_amplitude_on_sections_through_zero() {
    for amplitude in [0.8, 1.2, 0.3, -0.8] {
        let scene = format!(
            "[robot]\nurdf = \"robot.urdf\"\nq = [{amplitude}]\nqd = [0]\n[run]\nduration = 5\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n"
        );
        for section in ["rising = \"j\"", "falling = \"j\"", "rising = \"{qd j}\"", "falling = \"{qd j}\""] {
            let orbit = problem(&pendulum(""), &scene, &format!("section.{section}")).unwrap().find().unwrap();
            close(section, orbit.period, period_of_a_pendulum(amplitude), 1e-9);
        }
    }
}

/// J ẍ + d ẋ + k x = 0 keeps the share exp(−2π δ/ω) of its velocity from one passage to the next, with δ = d/2J and ω² = k/J − δ²; Newton's
/// method finds its rest, where x is zero.
#[test]
fn a_damped_oscillation_loses_its_share_in_each_cycle() {
    let (stiffness, damping, inertia) = (3.0_f64, 0.2, 0.11);
    let urdf = pendulum("");
    let scene = format!(
        "[robot]\nurdf = \"robot.urdf\"\nq = [0.5]\nqd = [0]\n[run]\nduration = 5\ngravity = [0, 0, 0]\ntolerance = 1e-11\n\
         controller = \"pd\"\nkp = {stiffness}\nkd = {damping}\ntarget = [0]\n"
    );
    let rate = 0.5 * damping / inertia;
    let turn = (stiffness / inertia - rate * rate).sqrt();
    let case = problem(&urdf, &scene, "section.rising = \"j\"").unwrap();
    let start = carom_study::orbit::State { q: vec![0.5], qd: vec![0.0] };
    let found: Vec<f64> = case.cycle(0.0, start).unwrap().take(5).map(|state| state.unwrap().qd[0]).collect();
    for pair in found.windows(2) {
        close("share", pair[1] / pair[0], (-rate * TAU / turn).exp(), 1e-8);
    }
    let rest = problem(&urdf, &scene, "section.period = 0.3").unwrap().find().unwrap();
    assert_eq!(rest.stability, Stability::Stable);
    close("rest", rest.start.q[0], 0.0, 1e-9);
    close("multiplier", rest.multipliers[0].norm(), (-rate * 0.3).exp(), 1e-8);
}

/// A driven pendulum turns on and on: its angle must return, up to a turn, as its weight depends on it.
#[test]
fn a_coordinate_on_which_the_motion_depends_must_return() {
    let urdf = pendulum(r#"<dynamics damping="0.5"/>"#);
    let scene = "[robot]\nurdf = \"robot.urdf\"\nq = [0]\nqd = [8]\n[run]\nduration = 5\ngravity = [0, 0, -9.81]\ntolerance = 1e-10\n\
                 controller = \"constant\"\ntorque = [4.0]\n";
    let keys = "section.falling = \"{qd j}-8\"\norbit.modulo = [\"j\"]";
    let case = problem(&urdf, scene, keys).unwrap();
    let start = carom_study::orbit::State { q: vec![0.0], qd: vec![8.0] };
    let errors = [case.find().err(), case.cycle(0.0, start).err(), case.cycles(1, 0, 5).err()];
    for error in errors.into_iter().map(Option::unwrap) {
        let told = "[orbit] modulo: the motion depends on j, so that it must return";
        assert!(error.to_string().contains(told), "{error}");
    }
    let keys = "section.rising = \"j-6\"\norbit.relabel = { j = \"j-2*PI\" }";
    assert_eq!(problem(&urdf, scene, keys).unwrap().find().unwrap().stability, Stability::Stable);
}

/// Closed form: with legs of length l at angles 2α on a slope γ ω² just after an impact is cos²2α · 4 (g/l) sin α sin γ/(1 − cos²2α), and
/// the multiplier of ω is cos²2α of ω², which is that of ω, too, on the cycle. With a moment of inertia J at the hub an impact
/// multiplies ω by (J + m l² cos 2α)/(J + m l²).
#[test]
fn the_rimless_wheel_rolls_as_its_closed_form() {
    let (alpha, slope, g) = (PI / 8.0, 0.1_f64, 9.81);
    // Newton's steps lead to the section up to rounding, on one side of it or the other.
    for (inertia, near) in [(0.02, 1.05), (0.2, 1.05), (0.02, 1.06), (0.2, 1.02), (0.1, 1.1)] {
        let urdf = wheel(inertia);
        let factor = (inertia + (2.0 * alpha).cos()) / (inertia + 1.0);
        // Energy of a step: (1 + J) (ω₁² − ω₀²)/2 = g (cos(α − γ) − cos(α + γ)).
        let gained = 4.0 * g * alpha.sin() * slope.sin() / (1.0 + inertia);
        let omega = (factor * factor * gained / (1.0 - factor * factor)).sqrt();
        // At pitch 0 two spokes stand on the floor; the wheel turns about the front one.
        let guess = near * omega;
        let velocities = [guess * alpha.cos(), guess * alpha.sin(), guess];
        let scene = rolling(alpha, velocities, [g * slope.sin(), -g * slope.cos()]);
        let keys = format!(
            "section.contact = \"wheel\"\norbit.modulo = [\"x\"]\norbit.relabel = {{ pitch = \"pitch - {}\" }}",
            2.0 * alpha
        );
        let orbit = problem(&urdf, &scene, &keys).unwrap().find().unwrap();
        close("rate", orbit.start.qd[2], omega, 1e-10);
        assert_eq!(nonzero(&orbit).len(), 1, "{:?}", orbit.multipliers);
        close("multiplier", orbit.multipliers[0].re, factor * factor, 1e-8);
        // The same cycle from the middle of a step, where the hub moves along the slope: its start is on the section.
        let keys = keys.replace("section.contact = \"wheel\"", "section.falling = \"{qd z}\"");
        let other = problem(&urdf, &scene, &keys).unwrap().find().unwrap();
        let climbed = slope.cos() * (1.0 - alpha.cos()) - slope.sin() * alpha.sin();
        close(
            "rate in the middle",
            other.start.qd[2],
            (omega * omega - 2.0 * g * climbed / (1.0 + inertia)).sqrt(),
            1e-10,
        );
        close("period", other.period, orbit.period, 1e-10);
        close("multiplier", other.multipliers[0].re, factor * factor, 1e-8);
    }
}

/// A second route of a walker: the doubled gait is that to which steps converge.
#[test]
fn the_doubled_compass_gait_limps_as_its_steps_do() {
    let file = path("studies/compass.toml");
    let keys = std::fs::read_to_string(&file).unwrap().replace("from = 3", "from = 4.3").replace("to = 5", "to = 4.5");
    let keys = keys.replace("[orbit]", "[orbit]\nbefore = 40");
    let problem = Problem::from_toml(&keys, file.parent().unwrap()).unwrap();
    let (_, doubled) = problem.doubled(&problem.branch().unwrap()).unwrap();
    let last = doubled.points.last().unwrap();
    assert_eq!((doubled.ended, last.parameter, last.orbit.stability), ("range", 4.5, Stability::Stable));
    let mut start = last.orbit.start.clone();
    start.qd.iter_mut().for_each(|v| *v *= 1.0 + 1e-4);
    let far = problem.cycle(4.5, last.orbit.start.clone()).unwrap().nth(1).unwrap().unwrap();
    (0..4).for_each(|k| close("two steps", far.qd[k], last.orbit.start.qd[k], 1e-9));
    let other = problem.cycle(4.5, last.orbit.start.clone()).unwrap().next().unwrap().unwrap();
    assert!((other.qd[2] - last.orbit.start.qd[2]).abs() > 1e-2, "a limp");
}

/// Closed form: the ball rises g T²/8 above the place A sin φ of its impact, where A ω cos φ = (1−e)/(1+e) g T/2. Under a ceiling the branch
/// ends where it touches.
#[test]
fn a_branch_that_reaches_a_ceiling_ends_by_grazing_at_the_closed_form() {
    let (e, g, omega) = (0.5_f64, 9.81, 20.0 * PI);
    let period = TAU / omega;
    let case = shaken(e, 1.2, 1.5, 1).unwrap();
    let across = (1.0 - e) / (1.0 + e) * g * period / (2.0 * omega);
    let grazes = 1.35;
    let height = ((grazes * g / (omega * omega)).powi(2) - across * across).sqrt() + g * period * period / 8.0;
    let scene = std::fs::read_to_string(case.1.0.join("scene.toml")).unwrap();
    let ceiling = format!(
        "[[surface]]\nname = \"ceiling\"\nshape = {{ halfspace = {{ point = [0, 0, {height}], normal = [0, 0, -1] }} }}\n[contact]"
    );
    std::fs::write(case.1.0.join("scene.toml"), scene.replace("[contact]", &ceiling)).unwrap();
    let keys = format!(
        "scene = \"scene.toml\"\nsection.period = {period}\nvary = {{ parameter = \"gamma\", from = 1.2, to = 1.5, set = {{ \
         \"surface[0].motion.amplitude[2]\" = \"{}*gamma\" }} }}",
        g / (omega * omega)
    );
    let branch = Problem::from_toml(&keys, &case.1.0).unwrap().branch().unwrap();
    assert_eq!(branch.ended, "grazing", "{}", branch.end);
    close("touches", branch.points.last().unwrap().parameter, grazes, 1e-6);
    assert!(branch.points.iter().all(|point| point.orbit.events.len() == 1));
}

/// A branch that ends at its first orbit is drawn as a dot.
#[test]
fn a_branch_of_one_orbit_has_a_picture() {
    let problem = shaken(0.5, 1.2, 1.25, 1).unwrap();
    let mut branch = problem.branch().unwrap();
    branch.points.truncate(1);
    let columns = problem.branch_columns();
    let diagram = branch.diagram(&[], &columns, "multiplier.size").unwrap();
    assert_eq!(diagram.marks[0].at, [1.2, branch.points[0].orbit.multipliers[0].norm()]);
    assert!(diagram.window.iter().zip(diagram.marks[0].at).all(|([low, high], x)| *low < x && x < *high));
    assert!(diagram.svg().unwrap().contains("<circle"));
    assert!(branch.diagram(&[], &columns, "speed").is_none() && branch.diagram(&[], &columns, "stability").is_none());
}

/// A damped mass on a spring comes to rest, and every section through its rest is passed by its oscillation: Newton's method leads to the rest,
/// which has no period. A wall that shakes beside it makes no orbit of `modulo` coordinates either, on whichever side it is.
#[test]
fn a_state_at_rest_and_a_coordinate_that_returns_are_no_orbits() {
    let robot = |damping: f64| {
        let body = mass("m", 1.0, 0.0, 0.01).replace("FEET", &foot([0.0; 3]));
        let slide = joint("x", "prismatic", ["world", "m"], "1 0 0");
        let slide = slide.replace("</joint>", &format!("<dynamics damping=\"{damping}\"/></joint>"));
        format!("<robot name=\"mass\"><link name=\"world\"/>{body}{slide}</robot>")
    };
    let scene = |start: f64, more: &str| {
        format!(
            "[robot]\nurdf = \"robot.urdf\"\nq = [{start}]\n[[spring]]\njoint = \"x\"\nstiffness = 100\n{more}\
             [run]\nduration = 5\ngravity = [0, 0, 0]\n"
        )
    };
    let told = |found: Result<Case, OrbitError>| {
        found.and_then(|case| case.find()).err().map(|e| e.to_string()).unwrap_or_default()
    };
    for section in ["rising", "falling"] {
        let keys = format!("section.{section} = \"{{qd x}}\"");
        let error = told(problem(&robot(0.5), &scene(0.3, ""), &keys));
        assert!(error.contains("a state at rest has no period"), "{section}: {error}");
    }
    for side in [1.0, -1.0] {
        let wall = format!(
            "[[surface]]\nname = \"wall\"\nshape = {{ halfspace = {{ point = [{}, 0, 0], normal = [{}, 0, 0] }} }}\n\
             motion = {{ amplitude = [0.02, 0, 0], frequency = 2 }}\n[contact]\nlaw = \"newton\"\nrestitution = 0.6\n",
            0.05 * side,
            -side
        );
        let keys = "section.period = 0.5\norbit.before = 20\norbit.modulo = [\"x\"]";
        let error = told(problem(&robot(0.5), &scene(-0.012 * side, &wall), keys));
        assert!(error.contains("the motion depends on x"), "{side}: {error}");
    }
}

/// What is wrong is told with the key, the value and what there is.
#[test]
fn wrong_problems_are_refused_with_key_value_and_rule() {
    let scene = walk(9.81, 0.05, [-0.27, 1.09, 0.38]);
    let cases = [
        ("section = {}", "[section] needs one of contact"),
        ("section.contact = \"tail\"", "contact = \"tail\" is no contact"),
        ("section.rising = \"left*right\"", "is not linear"),
        ("section.rising = \"TAU\"", "does not depend on the state: it never passes zero"),
        (
            "section.contact = \"left_leg\"\nvary = { parameter = \"e\", from = 0, to = 1, set = { \"contact.friction\" = \"e / 2\" } }",
            "\"e / 2\" has e without braces, which is a constant or a function of formulas: write {e}",
        ),
        ("section.rising = \"knee\"", "has no variable 'knee'"),
        (
            "section.rising = \"{qd left}\"\nwith = { run = { duration = 8, gravity = [0, 0, -9.81], controller = \"off\" } }\norbit.modulo = [\"tail\"]",
            "modulo has 'tail'",
        ),
        ("section.period = -1", "period = -1: it must be positive"),
        ("section.contact = \"left_leg\"\norbit.modulo = [\"y\"]", "modulo has 'y'"),
        ("section.contact = \"left_leg\"\norbit.relabel = { left = \"tail\" }", "has no variable 'tail'"),
        ("section.contact = \"left_leg\"\norbit.passages = 0", "passages = 0: it must be 1 or more"),
        (
            "section.contact = \"left_leg\"\nwith = { \"run.sample\" = 0.1 }",
            "run.sample: the motions of this problem have no samples",
        ),
        (
            "section.contact = \"left_leg\"\nwith = { \"run.tolerance\" = 1e-3 }",
            "with: run.tolerance: orbits are integrated to the tolerance of [orbit]: give it there",
        ),
        (
            "section.period = 0.5\nwith = { \"run.duration\" = 2 }",
            "run.duration: a passage lasts as long as the period of [section]",
        ),
        (
            "section.contact = \"left_leg\"\nvary = { parameter = \"contact.restitution\", from = 0, to = 2 }",
            "[vary] contact.restitution = 2: ",
        ),
        (
            "section.contact = \"left_leg\"\nwith = { run = { duration = 8, perturb = { q = 0.1 } } }",
            "run.perturb: the motions of this problem have no samples and no disturbances",
        ),
        (
            "section.contact = \"left_leg\"\nvary = { parameter = \"s\", from = 0, to = 1, set = { \"contact.friction\" = \"0.3\" } }",
            "does not depend on s: give the number in with",
        ),
        (
            "section.contact = \"left_leg\"\nwith = { contact = { friction = 0.5, restitution = 0 } }\nvary = { parameter = \"contact.friction\", from = 0.5, to = 1 }",
            "with: contact.friction: [vary] or [basin] replaces this number at each value",
        ),
        (
            "section.contact = \"left_leg\"\nwith = { \"run.duration\" = 9 }\nvary = { parameter = \"s\", from = 1, to = 2, set = { \"run.duration\" = \"4 * s\" } }",
            "with: run.duration: [vary] or [basin] replaces this number at each value",
        ),
        (
            "section.contact = \"left_leg\"\nvary = { parameter = \"contact.friction\", from = 0, to = 1, set = { \"contact.restitution\" = \"{contact.friction}\" } }",
            "parameter = \"contact.friction\": with set it is the name of a variable",
        ),
        ("section.contact = \"left_leg\"\norbit.cycle = 3", "unknown field `cycle`"),
        ("section.contact = \"left_leg\"\nvary = { parameter = \"run.speed\", from = 0, to = 1 }", "run.speed"),
    ];
    for (keys, told) in cases {
        let error = problem(&biped(10.0, 5.0, 0.5), &scene, keys).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(told), "{keys}: {error}");
    }
    let basin = |x: &str| {
        format!(
            "section.contact = \"left_leg\"\nbasin = {{ x = {x}, y = {{ what = \"z\", from = 0, to = 1, points = 2 }} }}"
        )
    };
    for (x, told) in [
        (
            "{ what = \"knee\", from = 0, to = 1, points = 3 }",
            "x.what = \"knee\": it is no variable of the state (x, qd x",
        ),
        ("{ what = \"z\", from = 0, to = 1, points = 3 }", "x.what and y.what are both \"z\""),
        (
            "{ what = \"robot.q.z\", from = 0, to = 1, points = 3 }",
            "both axes set one number, z: robot.q.z changes it, too",
        ),
        ("{ what = \"left\", from = 1, to = 1, points = 3 }", "the ends of a range must differ"),
        ("{ what = \"contact.bounce\", from = 0, to = 1, points = 3 }", "contact.bounce"),
    ] {
        let error = problem(&biped(10.0, 5.0, 0.5), &scene, &basin(x)).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(told), "{x}: {error}");
    }
    let start = problem(
        &biped(10.0, 5.0, 0.5),
        &scene,
        "section.contact = \"left_leg\"\nvary = { parameter = \"robot.qd[0]\", from = 0.5, to = 1 }",
    );
    let start = start.err().map(|e| e.to_string()).unwrap_or_default();
    assert!(start.contains("robot.qd[0]: the start and the duration are no part of an orbit"), "{start}");
    // Each period begins anew: what is elsewhere after it, or was changed in it, makes no orbit.
    let ball = |keys: &str| {
        let text = format!("scene = \"ball_scene.toml\"\nsection.period = 0.1\n{keys}");
        Problem::from_toml(&text, path("studies/atlas"))
            .and_then(|it| it.find())
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    };
    let away = ball("with = { \"surface[0].motion\" = { velocity = [0, 0, 0.01] } }");
    assert!(away.contains("surface table is 1.000e-3 m away after it"), "{away}");
    let after =
        ball("with = { \"run.after_impact\" = \"pd\", \"run.kp\" = 10, \"run.kd\" = 1, \"run.target\" = [0.05] }");
    assert!(after.contains("after_impact is for the first impact of a motion"), "{after}");
    // A section that is never reached names itself and what was seen.
    let error = problem(&biped(10.0, 5.0, 0.5), &scene, "section.rising = \"z - 5\"").unwrap().find().unwrap_err();
    let mut told = String::new();
    write!(told, "{error}").unwrap();
    assert!(told.contains("rising z - 5") && told.contains("within 8 s"), "{told}");
}

/// The error of a state that the search tries says so: the start of the scene is 2 rad inside the limits.
#[test]
fn a_search_that_leads_beyond_a_limit_does_not_blame_the_start() {
    let robot = carom_testing::files::text("robots/planar2.urdf");
    let scene = "[robot]\nurdf = \"robot.urdf\"\nq = [0.3, -1.0]\n[run]\nduration = 1\ngravity = [0, -9.81, 0]\n";
    let error = problem(&robot, scene, "section.period = 0.5").unwrap().find().unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("of Newton's method P(x) − x is") && told.contains("lower limit of elbow overlaps"),
        "{told}"
    );
    assert_eq!(error.name(), "not-converged");
}

/// A four-bar linkage without forces turns on, and no speed but zero returns in half a second: P(x) − x falls as a share of growing velocities, and the
/// search must not follow.
#[test]
fn a_search_does_not_run_away_to_high_speeds() {
    let robot = carom_testing::files::text("robots/four_bar.urdf");
    let scene = carom_testing::files::text("scenes/four_bar.toml").replace("../robots/four_bar.urdf", "robot.urdf");
    let scene = scene.replace("gravity = [0, 0, -9.81]", "gravity = [0, 0, 0]");
    let surface = scene.find("[[surface]]").unwrap()..scene.find("[contact]").unwrap();
    let scene = scene.replace(&scene[surface], "");
    let orbit = problem(&robot, &scene, "section.period = 0.5\norbit.tolerance = 1e-6").unwrap().find().unwrap();
    assert!(orbit.start.qd.iter().all(|v| v.abs() < 1e-6), "{:?}", orbit.start.qd);
}

/// The study of the book.
#[test]
fn the_compass_study_finds_its_flip() {
    let branch = Problem::from_file(path("studies/compass.toml")).unwrap().branch().unwrap();
    close("flip", only(&branch, "flip"), 4.3908982, 1e-6);
    assert!(branch.end.contains("the end of the range"), "{}", branch.end);
}

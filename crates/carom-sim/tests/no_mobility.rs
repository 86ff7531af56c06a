//! Contacts that no joint moves along their normal: they have neither force nor friction, whatever the rounding of their rows.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::{Energetic, Newton};
use carom_sim::{ContactRule, Scene, Simulation, Surface, Touch, Trajectory};
use nalgebra::{Rotation3, Vector3};

const LINK: &str = "<mass value='1.5'/><inertia ixx='0.03' ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.04'/></inertial>";

/// Name, links and joints, q, q̇, height.
type Robot = (&'static str, String, Vec<f64>, Vec<f64>, f64);

/// A robot whose first joint is placed by `turn` and `shift`, its start, and the height of the floor below its contact points.
fn robots() -> [Robot; 5] {
    let box_at = |x: f64| {
        format!("<collision><origin xyz='{x} 0 0'/><geometry><box size='0.8 0.04 0.6'/></geometry></collision>")
    };
    let ball =
        |x: f64| format!("<collision><origin xyz='{x} 0 0'/><geometry><sphere radius='0.1'/></geometry></collision>");
    let one = |kind: &str, axis: &str, shape: String| {
        format!(
            "<link name='a'><inertial><origin xyz='0.2 0.1 0'/>{LINK}{shape}</link>
             <joint name='j' type='{kind}'>BASE<parent link='base'/><child link='a'/><axis xyz='{axis}'/></joint>"
        )
    };
    let scara = format!(
        "<link name='a'><inertial><origin xyz='0.2 0 0'/>{LINK}</link><link name='b'><inertial><origin xyz='0.1 0 0'/>{LINK}{}</link>
         <joint name='j' type='continuous'>BASE<parent link='base'/><child link='a'/><axis xyz='0 0 1'/></joint>
         <joint name='k' type='continuous'><origin xyz='0.4 0 0'/><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>",
        ball(0.3)
    );
    [
        ("door", one("continuous", "0 0 1", box_at(0.4)), vec![0.2], vec![2.0], 0.3),
        ("wheel", one("continuous", "0 1 0", ball(0.0)), vec![0.3], vec![7.0], 0.1),
        ("planar box", one("planar", "0 0 1", box_at(0.0)), vec![0.1, -0.2, 0.3], vec![1.2, -0.5, 2.0], 0.3),
        ("SCARA", scara.clone(), vec![0.7, -0.9], vec![2.0, -1.0], 0.1),
        ("folded SCARA", scara, vec![0.7, std::f64::consts::PI], vec![2.0, -1.0], 0.1),
    ]
}

/// Floors that touch these robots at many poses of the whole scene: the motion is that without the floor. The integrations take other
/// steps, with a tolerance of 1e-9 each.
#[test]
fn a_contact_that_no_joint_moves_does_not_change_the_motion() {
    let mut rng = fastrand::Rng::with_seed(41);
    for (name, parts, q, qd, height) in robots() {
        for k in 0..40 {
            let mut draw = || 2.0 * rng.f64() - 1.0;
            // The first scenes stand upright, at the origin or beside it.
            let turn =
                if k < 2 { Rotation3::identity() } else { Rotation3::new(Vector3::from_fn(|_, _| 3.0 * draw())) };
            let shift = if k == 0 { Vector3::zeros() } else { Vector3::from_fn(|_, _| draw()) };
            let (r, p, y) = turn.euler_angles();
            let base = format!("<origin xyz='{} {} {}' rpy='{r} {p} {y}'/>", shift.x, shift.y, shift.z);
            let text = format!("<robot name='r'><link name='base'/>{}</robot>", parts.replace("BASE", &base));
            let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap();
            let friction = [0.0, 0.4, 1.5][k % 3];
            let contact = if k % 2 == 0 {
                ContactRule::new(Newton { restitution: 0.5, friction })
            } else {
                ContactRule::new(Energetic { restitution: 0.3, friction })
            };
            let obstacle =
                Obstacle::half_space(turn * Vector3::new(0.0, 0.0, -height) + shift, turn * Vector3::z()).unwrap();
            let floor = Surface { name: "floor".into(), obstacle, contact, motion: None };
            let gravity = turn * Vector3::new(0.3, 0.0, -9.81);
            let run = |surfaces: &[Surface]| {
                let touches = Touch::all(&chain, surfaces, 0.0).unwrap().touches;
                let count = touches.len();
                let sim = Simulation { gravity, ..Simulation::new(chain.clone(), touches) };
                (sim.run(&q, &qd, 0.3).unwrap_or_else(|why| panic!("{name}, scene {k}: {why}")), count)
            };
            let ((with, touches), (without, _)) = (run(&[floor]), run(&[]));
            assert!(touches > 0, "{name}: no contact is possible");
            let last = |run: &Trajectory| run.summary.last.clone();
            let (own, other) = (last(&with), last(&without));
            for (a, b) in own.q.iter().chain(&own.qd).zip(other.q.iter().chain(&other.qd)) {
                assert!(
                    (a - b).abs() < 1e-7 * (1.0 + b.abs()),
                    "{name}, scene {k}: {own:?} without the floor {other:?}"
                );
            }
        }
    }
}

/// Reads a scene of a robot.
fn scene(name: &str, robot: &str, text: &str) -> Scene {
    let folder = std::env::temp_dir().join(format!("carom-mobility-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("robot.urdf"), robot).unwrap();
    std::fs::write(folder.join("scene.toml"), text).unwrap();
    let scene = Scene::from_file(folder.join("scene.toml"));
    std::fs::remove_dir_all(&folder).unwrap();
    scene.unwrap_or_else(|why| panic!("{name}: {why}"))
}

/// Two links whose end is pinned to the world are locked. Dry friction, limits and contacts, in all combinations and at many poses, leave
/// them at rest: what the loop leaves of their rows is rounding.
#[test]
fn a_locked_truss_stays_at_rest() {
    let mut rng = fastrand::Rng::with_seed(7);
    for k in 0..60 {
        let mut draw = || 2.0 * rng.f64() - 1.0;
        let axis = Vector3::from_fn(|_, _| draw()).normalize();
        let (friction, limit) = (if k % 2 == 0 { "<dynamics friction='0.2'/>" } else { "" }, 0.5 + 0.4 * draw());
        let joint = |name: &str, parent: &str, child: &str, x: f64| {
            format!(
                "<joint name='{name}' type='revolute'><origin xyz='{x} 0 0'/><parent link='{parent}'/><child link='{child}'/>
                 <axis xyz='{} {} {}'/><limit lower='-4' upper='4' effort='9' velocity='9'/>{friction}</joint>",
                axis.x, axis.y, axis.z
            )
        };
        let ball = "<collision><origin xyz='0.2 0 0'/><geometry><sphere radius='0.05'/></geometry></collision>";
        let robot = format!(
            "<robot name='truss'><link name='base'/><link name='a'><inertial><origin xyz='0.1 0 0'/>{LINK}</link>
             <link name='b'><inertial><origin xyz='0.1 0 0'/>{LINK}{ball}</link>{}{}</robot>",
            joint("j", "base", "a", 0.0).replace("upper='4'", &format!("upper='{limit}'")),
            joint("k", "a", "b", 0.4)
        );
        let chain = Chain::from_urdf_str(&robot, &LoadOptions::default()).unwrap();
        // The first joint stands at its limit.
        let q = [limit, 1.0 + 0.3 * draw()];
        let (mut workspace, tip) = (chain.workspace(), chain.frame("b").unwrap());
        let pose = workspace.update(&chain, &q).unwrap().pose(tip);
        let (end, centre) = (pose.point(Vector3::new(0.3, 0.02, 0.0)), pose.point(Vector3::new(0.2, 0.0, 0.0)));
        let n = Vector3::from_fn(|_, _| draw()).normalize();
        let place = centre - n * 0.05;
        let list = |v: Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let mut text = format!(
            "[robot]\nurdf = \"robot.urdf\"\ntip = \"b\"\nq = {q:?}\n[[loop]]\njoint = \"point\"\nfirst = {{ link = \"b\", xyz = [0.3, 0.02, 0] }}\n\
             second = {{ xyz = {} }}\n[run]\nduration = 0.1\ngravity = {}\n",
            list(end),
            list(n * -9.81)
        );
        if k % 3 != 0 {
            text += &format!(
                "[[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = {}, normal = {} }} }}\n[contact]\nlaw = \"newton\"\nfriction = 0.5\n",
                list(place),
                list(n)
            );
        }
        let plan = scene("truss", &robot, &text).plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 0.1).unwrap_or_else(|why| panic!("scene {k}: {why}"));
        let last = run.summary.last;
        assert!(last.q.iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9), "scene {k}: {:?} from {q:?}", last.q);
        assert!(last.qd.iter().all(|v| v.abs() < 1e-9), "scene {k}: {:?}", last.qd);
        assert_eq!(run.summary.statistics.contact_steps, 0, "scene {k}");
    }
}

/// A pendulum whose bob is tangent to the floor at its lowest point passes it: at the tangent point no joint moves it along the normal, and
/// beside it next to nothing does. Restitution, friction, laws and the place of the hinge do not matter.
#[test]
fn a_pendulum_passes_a_floor_that_is_tangent_to_its_path() {
    let mut rng = fastrand::Rng::with_seed(3);
    for k in 0..40 {
        let (height, length, radius) = (1.0 + rng.f64(), 0.2 + 0.3 * rng.f64(), 0.02 + 0.1 * rng.f64());
        let robot = format!(
            "<robot name='p'><link name='base'/><link name='a'><inertial><origin xyz='0 0 -{length}'/>{LINK}
             <collision><origin xyz='0 0 -{length}'/><geometry><sphere radius='{radius}'/></geometry></collision></link>
             <joint name='j' type='continuous'><origin xyz='0 0 {height}'/><parent link='base'/><child link='a'/><axis xyz='0 1 0'/></joint></robot>"
        );
        let chain = Chain::from_urdf_str(&robot, &LoadOptions::default()).unwrap();
        let contact = ContactRule::new(Energetic { restitution: 0.5, friction: 0.5 * (k % 3) as f64 });
        let obstacle = Obstacle::half_space(Vector3::new(0.0, 0.0, height - length - radius), Vector3::z()).unwrap();
        let floor = Surface { name: "floor".into(), obstacle, contact, motion: None };
        let run = |surfaces: &[Surface]| {
            let gravity = Vector3::new(0.0, 0.0, -9.81);
            let touches = Touch::all(&chain, surfaces, 0.0).unwrap().touches;
            let sim = Simulation { gravity, ..Simulation::new(chain.clone(), touches) };
            sim.run(&[-0.6], &[0.3], 1.0).unwrap().summary.last
        };
        let (with, without) = (run(&[floor]), run(&[]));
        assert!((with.q[0] - without.q[0]).abs() < 1e-7, "scene {k}: {with:?} without the floor {without:?}");
    }
}

/// A contact without a row is told, once for each pair.
#[test]
fn a_contact_that_no_joint_moves_is_told() {
    let (_, parts, q, _, height) = robots()[0].clone();
    let robot = format!("<robot name='r'><link name='base'/>{}</robot>", parts.replace("BASE", ""));
    let text = format!(
        "[robot]\nurdf = \"robot.urdf\"\nq = {q:?}\n[[surface]]\nname = \"floor\"\n\
         shape = {{ halfspace = {{ point = [0, 0, -{height}], normal = [0, 0, 1] }} }}\n[run]\nduration = 0.1\n"
    );
    let warnings = scene("told", &robot, &text).warnings;
    let about = |warning: &&String| {
        warning.contains("a on floor is closed at the start, and no joint moves the contact along its normal")
    };
    assert_eq!(warnings.iter().filter(about).count(), 1, "{warnings:?}");
}

//! Contacts that no joint moves along their normal: they have neither force nor friction, whatever the rounding of their rows. The census
//! `immobile` has more of them.

use carom_sim::{Simulation, Surface};
use carom_testing::build::{O, Part, Y, Z, ball, brick, chain, shape, urdf};
use carom_testing::scenes::{among, half_space, rule, scene, surface};
use nalgebra::Vector3;

fn link(name: &str, parent: &str, kind: &'static str, axis: [f64; 3], com: [f64; 3]) -> Part {
    Part::new(name, parent, kind, axis, O).com(com).weighing(1.5, [0.03, 0.02, 0.04])
}

/// Two links whose end is pinned to the world are locked. Dry friction, limits and contacts, in all combinations and at many poses, leave
/// them at rest: what the loop leaves of their rows is rounding, in whatever unit masses are.
#[test]
fn a_locked_truss_stays_at_rest() {
    let mut rng = fastrand::Rng::with_seed(7);
    for k in 0..60 {
        let mut draw = || 2.0 * rng.f64() - 1.0;
        let axis = Vector3::from_fn(|_, _| draw()).normalize();
        let (friction, limit) = (if k % 2 == 0 { "<dynamics friction='0.2'/>" } else { "" }, 0.5 + 0.4 * draw());
        let unit = [1.0, 1e-6, 1e6][k % 5 % 3];
        let bar = |name: &str, parent: &str, x: f64, upper: f64| {
            let bar = link(name, parent, "revolute", axis.into(), [0.1, 0.0, 0.0]).at([x, 0.0, 0.0]);
            let bar = bar.weighing(1.5 * unit, [0.03, 0.02, 0.04].map(|inertia| inertia * unit));
            bar.limits(-4.0, upper, 9.0).joint(friction)
        };
        let ball = shape(&ball(0.05), [0.2, 0.0, 0.0], O);
        let parts = [bar("a", "base", 0.0, limit), bar("b", "a", 0.4, 4.0).with(ball)];
        let chain = chain(&parts);
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
        let plan = scene(&[("robot.urdf", &urdf(&parts))], &text).unwrap().plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 0.1).unwrap_or_else(|why| panic!("scene {k}: {why}"));
        let last = run.summary.last;
        assert!(last.q.iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9), "scene {k}: {:?} from {q:?}", last.q);
        assert!(last.qd.iter().all(|v| v.abs() < 1e-9), "scene {k}: {:?}", last.qd);
        assert_eq!(run.summary.statistics.contact_steps, 0, "scene {k}");
    }
}

/// A pendulum whose bob is tangent to the floor at its lowest point passes it: at the tangent point no joint moves it along the normal, and
/// beside it next to nothing does. Restitution, friction, the place of the hinge and the unit of lengths do not matter.
#[test]
fn a_pendulum_passes_a_floor_that_is_tangent_to_its_path() {
    let mut rng = fastrand::Rng::with_seed(3);
    for k in 0..40 {
        let unit = [1.0, 1e-3, 1e3][k % 3];
        let (height, length, radius) = (1.0 + rng.f64(), 0.2 + 0.3 * rng.f64(), 0.02 + 0.1 * rng.f64());
        let [height, length, radius] = [height, length, radius].map(|length| length * unit);
        let bob = shape(&ball(radius), [0.0, 0.0, -length], O);
        let inertia = [0.03, 0.02, 0.04].map(|inertia| inertia * unit * unit);
        let pendulum = link("a", "base", "continuous", Y, [0.0, 0.0, -length]).weighing(1.5, inertia);
        let pendulum = pendulum.at([0.0, 0.0, height]).with(bob);
        let chain = chain(&[pendulum]);
        let plane = half_space([0.0, 0.0, height - length - radius], Vector3::z());
        let floor = surface("floor", plane, rule("energetic", 0.5, 0.5 * (k / 3 % 3) as f64));
        let run = |surfaces: &[Surface]| {
            let sim = Simulation { gravity: Vector3::z() * (-9.81 * unit), ..among(chain.clone(), surfaces) };
            sim.run(&[-0.6], &[0.3], 1.0).unwrap().summary.last
        };
        let (with, without) = (run(&[floor]), run(&[]));
        assert!((with.q[0] - without.q[0]).abs() < 1e-7, "scene {k}: {with:?} without the floor {without:?}");
    }
}

/// A contact without a row is told, once for each pair.
#[test]
fn a_contact_that_no_joint_moves_is_told() {
    let leaf = shape(&brick([0.8, 0.04, 0.6]), [0.4, 0.0, 0.0], O);
    let door = urdf(&[link("a", "base", "continuous", Z, [0.2, 0.1, 0.0]).with(leaf)]);
    let text = "[robot]\nurdf = \"robot.urdf\"\nq = [0.2]\n[[surface]]\nname = \"floor\"\n\
                shape = { halfspace = { point = [0, 0, -0.3], normal = [0, 0, 1] } }\n[run]\nduration = 0.1\n";
    let warnings = scene(&[("robot.urdf", &door)], text).unwrap().warnings;
    let about = |warning: &&String| {
        warning.contains("a on floor is closed at the start, and no joint moves the contact along its normal")
    };
    assert_eq!(warnings.iter().filter(about).count(), 1, "{warnings:?}");
}

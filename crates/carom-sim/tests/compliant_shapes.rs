//! Which shapes have compliant contacts: each fulfils the wish for a stiffness, or is refused with the names of the pair.

use carom_sim::{Plan, SimError};
use carom_testing::build::{self, O, Part, Z, brick, one_body, stl, urdf};
use carom_testing::scenes::scene;

/// A body of 2 kg over a surface, both given by their shapes, with linear compliance of 1e4 N/m, at this height.
fn plan(shape: &str, surface: &str, height: f64, more: &str) -> Result<Plan, SimError> {
    let robot = one_body(2.0, [0.01; 3], &build::shape(shape, O, O));
    let text = format!(
        "[robot]\nurdf = 'robot.urdf'\nfloating = true\ntip = 'body'\nq = [0, 0, {height}, 0, 0, 0, 1]\n[[surface]]\nname = 'desk'\n\
         shape = {{ {surface} }}\n[contact]\nrestitution = 0.2\ncompliance = {{ stiffness = 1e4, force = 'kelvin-voigt' }}\n{more}\
         [run]\nduration = 1\ngravity = [0, 0, -9.81]\n"
    );
    // A pyramid with its base of 0.2 m × 0.2 m down, 48 corners on a base that is a ring, as a hull.
    let ring = |k: usize| {
        let angle = std::f64::consts::TAU * (k % 48) as f64 / 48.0;
        [0.1 * angle.cos(), 0.1 * angle.sin(), -0.05]
    };
    let cone =
        stl((0..48).flat_map(|k| [[ring(k), ring(k + 1), [0.0, 0.0, 0.1]], [ring(k + 1), ring(k), [0.0, 0.0, -0.05]]]));
    scene(&[("cone.stl", &cone), ("robot.urdf", &robot)], &text).and_then(|scene| scene.plan())
}

const FLOOR: &str = "halfspace = { point = [0, 0, 0], normal = [0, 0, 1] }";

/// A body at rest sinks by m g/(n k), where n corners touch: a sphere at one point, a box at four, a mesh at each corner of its base.
#[test]
fn a_body_on_a_half_space_sinks_by_its_weight_over_the_stiffness_of_its_corners() {
    let shapes = [
        ("sphere", "<sphere radius='0.1'/>", 0.1, 1.0),
        ("box", "<box size='0.2 0.3 0.1'/>", 0.05, 4.0),
        ("mesh", "<mesh filename='cone.stl'/>", 0.05, 48.0),
    ];
    for (name, shape, height, corners) in shapes {
        let plan = plan(shape, FLOOR, height + 1e-3, "").unwrap();
        let summary = plan.simulation.run(&plan.q, &plan.qd, 1.0).unwrap().summary;
        let sunk = height - summary.last.q[2];
        let exact = 2.0 * 9.81 / (corners * 1e4);
        // The damped oscillation is over: less than 1e-6 of it is left after 1 s. The mesh has numbers of single precision.
        assert!((sunk - exact).abs() < 1e-5 * exact + 2e-8 * height, "{name}: {sunk:e} m instead of {exact:e} m");
        assert_eq!(summary.statistics.contact_steps, 0, "{name}");
    }
}

/// The force between faces and edges of two bodies has no formula here: such a pair is refused, by plan and run, unless it is made rigid.
#[test]
fn compliance_of_two_bodies_with_faces_is_refused_with_their_names() {
    let desk = "box = { centre = [0, 0, -0.1], size = [1, 1, 0.2] }";
    for (_name, shape) in [("a box", "<box size='0.2 0.3 0.1'/>"), ("a mesh", "<mesh filename='cone.stl'/>")] {
        let said = plan(shape, desk, 0.06, "").unwrap_err().to_string();
        assert!(said.contains("body on desk: compliance stiffness is 10000"), "{said}");
        let rigid = "[[contact.pair]]\nlink = 'body'\ncompliance = 'rigid'\n";
        plan(shape, desk, 0.06, rigid).unwrap();
    }
    let ball = plan("<sphere radius='0.1'/>", desk, 0.101, "").unwrap();
    let last = ball.simulation.run(&ball.q, &ball.qd, 1.0).unwrap().summary.last;
    let exact = 2.0 * 9.81 / 1e4;
    assert!((0.1 - last.q[2] - exact).abs() < 1e-5 * exact, "{:?}", last.q);
}

/// In the plane corners with the same projection are one; compliant ones are not, because each has a force.
#[test]
fn a_compliant_box_sinks_alike_in_the_plane_and_in_space() {
    let robot = urdf(&[Part::slider("body", "base", Z).weighing(2.0, [0.01; 3]).shaped(&brick([0.2, 0.3, 0.1]))]);
    for model in ["auto", "full"] {
        let text = format!(
            "[robot]\nurdf = 'robot.urdf'\ntip = 'body'\nq = [0.051]\n[[surface]]\nname = 'floor'\nshape = {{ {FLOOR} }}\n[contact]\n\
             restitution = 0.2\ncompliance = {{ stiffness = 1e4, force = 'kelvin-voigt' }}\n[run]\nduration = 1\nmodel = '{model}'\n\
             gravity = [0, 0, -9.81]\n"
        );
        let plan = scene(&[("robot.urdf", &robot)], &text).unwrap().plan().unwrap();
        let last = plan.simulation.run(&plan.q, &plan.qd, 1.0).unwrap().summary.last;
        let exact = 2.0 * 9.81 / 4e4;
        assert!((0.05 - last.q[0] - exact).abs() < 1e-5 * exact, "{model}: {:?}", last.q);
    }
}

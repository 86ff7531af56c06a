//! Loops as joints: a robot whose joint is a loop moves and is struck as the same robot with the joint in its tree.

use carom_chain::Chain;
use carom_sim::{Event, Loop, LoopFrame, LoopJoint, Sampling, Simulation, Touch};
use carom_testing::build::{O, Part, Z, ball, chain, shape};
use carom_testing::numeric::rk4;
use carom_testing::scenes::{G, half_space, rule, surface};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// A turn and a place in general position.
const RPY: [f64; 3] = [0.4, -0.7, 1.1];
const XYZ: [f64; 3] = [0.3, 0.1, -0.2];

/// The place of a joint in the origin of its parent.
const THERE: ([f64; 3], [f64; 3]) = (O, O);
/// Of the hinges.
const AXIS: [f64; 3] = [0.2, 1.0, 0.1];

/// A link of 1.3 kg with a ball at its centre of mass, 0.4 m below its origin.
fn body(joint: &'static str, parent: &str, (at, rpy): ([f64; 3], [f64; 3])) -> Part {
    let com = [0.1, 0.0, -0.4];
    let body = Part::new("body", parent, joint, AXIS, at).turned(rpy).with(shape(&ball(0.08), com, O));
    body.com(com).weighing(1.3, [0.02, 0.03, 0.014]).products([0.001, 0.0, 0.002])
}

/// With a wall of some friction and restitution at this height in the way of the balls.
fn simulation(chain: Chain, loops: Vec<Loop>, height: f64) -> Simulation {
    let obstacle = half_space([0.0, 0.0, height], [0.2, -0.1, 1.0]);
    let touches = Touch::all(&chain, &[surface("wall", obstacle, rule("energetic", 0.5, 0.3))], 0.0).unwrap().touches;
    Simulation { loops, gravity: Vector3::new(2.0, 0.0, -G), tolerance: 1e-12, ..Simulation::new(chain, touches) }
}

fn tie(joint: LoopJoint, first: LoopFrame, second: LoopFrame) -> Vec<Loop> {
    vec![Loop { name: "tie".into(), joint, frames: [first, second] }]
}

/// Place and turn of a floating link at a frame of another link.
fn at(chain: &Chain, q: &[f64], link: &str, offset: LoopFrame) -> [f64; 7] {
    let mut workspace = chain.workspace();
    let kin = workspace.update(chain, q).unwrap();
    let pose = kin.pose(chain.frame(link).unwrap());
    let turn = UnitQuaternion::from_matrix(&pose.rotation) * offset.rotation;
    let place = pose.point(offset.origin);
    let turn = turn.coords;
    [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
}

/// The same events, with the same impulses, and the same path of a point of the link `body`.
fn same(tree: &Simulation, q: &[f64], tied: &Simulation, tied_q: &[f64]) -> Vec<Event> {
    let duration = 1.2;
    let zeros = |sim: &Simulation| vec![0.0; sim.chain.nv()];
    let one = tree.run(q, &zeros(tree), duration).unwrap();
    let other = tied.run(tied_q, &zeros(tied), duration).unwrap();
    assert_eq!(one.events.len(), other.events.len(), "{:?}\n{:?}", one.events, other.events);
    for (a, b) in one.events.iter().zip(&other.events) {
        assert_eq!(a.kind.name(), b.kind.name());
        assert!((a.time - b.time).abs() < 1e-8, "{} {}", a.time, b.time);
        for (a, b) in a.impulses.iter().zip(&b.impulses) {
            assert!((a.impulse - b.impulse).norm() < 1e-7 * a.impulse.norm(), "{a:?} {b:?}");
        }
    }
    let place = |sim: &Simulation, q: &[f64]| {
        let mut workspace = sim.chain.workspace();
        let kin = workspace.update(&sim.chain, q).unwrap();
        kin.position(sim.chain.point(sim.chain.frame("body").unwrap(), Vector3::new(0.3, -0.2, 0.5)))
    };
    for k in 0..=60 {
        let time = duration * f64::from(k) / 60.0;
        let [a, b] = [place(tree, &one.at(&tree.chain, time).q), place(tied, &other.at(&tied.chain, time).q)];
        // Impacts amplify errors of 1e-10 by their number.
        assert!((a - b).norm() < 1e-7, "{a} {b} at {time}");
    }
    let balance = other.summary.energy;
    assert!(balance.error().abs() < 1e-9, "{balance:?}");
    one.events
}

fn strikes(events: &[Event]) {
    assert!(events.iter().any(|event| event.kind.name() == "impact"), "{events:?}");
}

/// A floating body that is pinned to the world is one on a hinge.
#[test]
fn a_pin_is_a_hinge() {
    let tree = chain(&[body("continuous", "base", (XYZ, RPY))]);
    let tied = chain(&[body("floating", "base", THERE)]);
    let axis = Vector3::from(AXIS);
    for length in [1.0, 7.0] {
        let pin = LoopJoint::Pin { axis: axis * length };
        for swapped in [false, true] {
            let (mut first, mut second) =
                (LoopFrame::new(Some("body"), [0.0; 3], [0.0; 3]), LoopFrame::new(None, XYZ, RPY));
            if swapped {
                (first, second) = (second, first);
            }
            let start = at(&tree, &[0.3], "body", LoopFrame::new(None, [0.0; 3], [0.0; 3]));
            let loops = tie(pin, first, second);
            strikes(&same(
                &simulation(tree.clone(), Vec::new(), -0.62),
                &[0.3],
                &simulation(tied.clone(), loops, -0.62),
                &start,
            ));
        }
    }
}

/// Two bodies that are welded by a loop are one with a fixed joint, the first on a hinge, the second floating.
#[test]
fn a_weld_is_a_fixed_joint() {
    let arm = Part::hinge("arm", "base", AXIS).at([0.0, 0.0, 0.1]).turned([0.2, 0.1, 0.0]);
    let arm = arm.com([0.0, 0.1, -0.2]).weighing(0.8, [0.01, 0.012, 0.009]);
    let tree = chain(&[arm.clone(), body("fixed", "arm", (XYZ, RPY))]);
    let tied = chain(&[arm, body("floating", "base", THERE)]);
    let loops =
        tie(LoopJoint::Weld, LoopFrame::new(Some("arm"), XYZ, RPY), LoopFrame::new(Some("body"), [0.0; 3], [0.0; 3]));
    let mut start = vec![0.4];
    start.extend(at(&tree, &[0.4], "body", LoopFrame::new(None, [0.0; 3], [0.0; 3])));
    // The floor is out of reach.
    same(&simulation(tree, Vec::new(), -5.0), &[0.4], &simulation(tied, loops, -5.0), &start);
}

/// A floating body on a point of the world is a heavy body about a fixed point: its attitude is that of Euler's equations
/// I ω̇ = m c × g − ω × I ω about this point, integrated independently (Runge & Kutta's method, 2e-5 s).
#[test]
fn a_point_is_a_spherical_pendulum() {
    let tied = chain(&[body("floating", "base", THERE)]);
    let loops = tie(LoopJoint::Point, LoopFrame::new(Some("body"), [0.0; 3], [0.0; 3]), LoopFrame::new(None, XYZ, RPY));
    let mut sim = simulation(tied, loops, -2.0);
    sim.touches.clear();
    let turn = UnitQuaternion::from_euler_angles(0.5, 0.3, -0.2);
    let mut rate = Vector3::new(1.0, -2.0, 4.0);
    let [x, y, z, w] = [turn.i, turn.j, turn.k, turn.w];
    let (q, qd) = ([XYZ[0], XYZ[1], XYZ[2], x, y, z, w], [0.0, 0.0, 0.0, rate.x, rate.y, rate.z]);
    let duration = 1.0;
    let mut states = Vec::new();
    let sampling = Sampling { every: Some(0.25), ..Sampling::default() };
    sim.stream(&q, &qd, duration, sampling, &mut |seen| {
        if let carom_sim::Seen::Moment(moment) = seen {
            states.push(moment.clone());
        }
    })
    .unwrap();

    let (mass, centre) = (1.3, Vector3::new(0.1, 0.0, -0.4));
    let own = Matrix3::new(0.02, 0.001, 0.0, 0.001, 0.03, 0.002, 0.0, 0.002, 0.014);
    let inertia: Matrix3<f64> =
        own + mass * (Matrix3::identity() * centre.norm_squared() - centre * centre.transpose());
    let inverse = inertia.try_inverse().unwrap();
    let slope = |[w, x, y, z, a, b, c]: [f64; 7]| {
        let (turn, rate) = (Quaternion::new(w, x, y, z), Vector3::new(a, b, c));
        let gravity = UnitQuaternion::from_quaternion(turn).inverse() * sim.gravity;
        let spin = inverse * (centre.cross(&gravity) * mass - rate.cross(&(inertia * rate)));
        let Quaternion { coords } = turn * Quaternion::from_imag(rate) * 0.5;
        [coords.w, coords.x, coords.y, coords.z, spin.x, spin.y, spin.z]
    };
    let mut turn = turn.into_inner();
    let h = 2e-5;
    for state in &states[1..] {
        for _ in 0..12500 {
            let [w, x, y, z, a, b, c] = rk4(slope, [turn.w, turn.i, turn.j, turn.k, rate.x, rate.y, rate.z], h);
            (turn, rate) = (Quaternion::new(w, x, y, z).normalize(), Vector3::new(a, b, c));
        }
        let found = Vector3::new(state.qd[3], state.qd[4], state.qd[5]);
        assert!((found - rate).norm() < 1e-8, "{found} {rate}");
        let found = Quaternion::new(state.q[6], state.q[3], state.q[4], state.q[5]);
        let apart = (found - turn).norm().min((found + turn).norm());
        assert!(apart < 1e-9, "{found} {turn}");
        // The point stays where it is.
        assert!((Vector3::new(state.q[0], state.q[1], state.q[2]) - Vector3::from(XYZ)).norm() < 1e-9);
    }
}

/// A mimic joint in a loop: a gear whose second wheel is fixed to the first by a rod and a slot. The rod between two hinges that
/// turn by the same angle is the coupler of a parallelogram: the loop and the mimic joint demand the same, and the linkage
/// moves as without the mimic joint.
#[test]
fn a_mimic_joint_agrees_with_the_loop_that_demands_the_same() {
    let rod = |name: &str, parent: &str, x: f64| {
        let part = Part::hinge(name, parent, Z).at([x, 0.0, 0.0]).com([0.5, 0.0, 0.0]);
        part.weighing(1.0, [0.001, 0.0833, 0.0833])
    };
    let links = |mimic: &str| {
        chain(&[rod("left", "base", 0.0), rod("coupler", "left", 1.0), rod("right", "base", 1.0).joint(mimic)])
    };
    let pin = LoopJoint::Pin { axis: Vector3::z() };
    let end = |link| LoopFrame::new(Some(link), [1.0, 0.0, 0.0], [0.0; 3]);
    let loops = tie(pin, end("coupler"), end("right"));
    let gravity = Vector3::new(0.0, -G, 0.0);
    let run = |chain: Chain, q: &[f64], qd: &[f64]| {
        let sim = Simulation { loops: loops.clone(), gravity, tolerance: 1e-11, ..Simulation::new(chain, Vec::new()) };
        sim.run(q, qd, 0.5).unwrap().summary.last
    };
    let free = run(links(""), &[1.3, -1.3, 1.3], &[-0.5, 0.5, -0.5]);
    let geared = run(links(r#"<mimic joint="jleft"/>"#), &[1.3, -1.3], &[-0.5, 0.5]);
    assert_eq!(geared.q.len(), 2);
    for k in 0..2 {
        assert!(
            (free.q[k] - geared.q[k]).abs() < 1e-9 && (free.qd[k] - geared.qd[k]).abs() < 1e-9,
            "{free:?} {geared:?}"
        );
    }
}

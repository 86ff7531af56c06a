//! Slip that ends: what is left of it after an event for less than a quarter of the Zeno time is left out.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::Newton;
use carom_sim::{ContactRule, Simulation, Surface, Touch};
use nalgebra::Vector3;

const G: f64 = 9.81;
const FRICTION: f64 = 0.5;
/// Acceleration along the incline, m/s².
const DOWN: f64 = 2.0;
const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];

fn chain(text: &str) -> Chain {
    Chain::from_urdf_str(text, &LoadOptions::default()).unwrap()
}

/// A mass on a floor that is inclined along x.
fn mass_on_incline(tolerance: f64) -> Simulation {
    let joint = |name: &str, parent: &str, child: &str, axis: &str| {
        format!(
            "<joint name='{name}' type='prismatic'><parent link='{parent}'/><child link='{child}'/><axis xyz='{axis}'/>
             <limit lower='-9' upper='9' effort='99' velocity='99'/></joint>"
        )
    };
    let text = [
        "<robot name='mass'><link name='base'/><link name='a'/><link name='b'/>",
        "<link name='c'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>",
        "<collision><geometry><sphere radius='0.1'/></geometry></collision></link>",
        &joint("x", "base", "a", "1 0 0"),
        &joint("y", "a", "b", "0 1 0"),
        &joint("z", "b", "c", "0 0 1"),
        "</robot>",
    ];
    let chain = chain(&text.concat());
    let contact = ContactRule::new(Newton { restitution: 0.0, friction: FRICTION });
    let obstacle = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let surface = Surface { name: "floor".into(), obstacle, contact, motion: None };
    let touches = Touch::all(&chain, &[surface], 0.0).unwrap().touches;
    let (gravity, zeno_time) = (Vector3::new(DOWN, 0.0, -G), Simulation::zeno_time_for(tolerance));
    Simulation { gravity, tolerance, zeno_time, ..Simulation::new(chain, touches) }
}

/// A mass that starts across an incline stops at a known place. With φ the angle between its velocity u and the line of greatest slope,
/// k = μ g/a and t = tan φ/2: u = u₀ t^k/sin φ, and dx = −u² cos φ dφ/(a sin φ), dy = −u² dφ/a. Near the end the slip turns by an
/// angle of size one in every time in which it halves.
#[test]
fn a_mass_that_starts_across_an_incline_stops_at_a_known_place() {
    let k = FRICTION * G / DOWN;
    for tolerance in TOLERANCES {
        let sim = mass_on_incline(tolerance);
        // The second slip ends at once.
        for slip in [1.0, 0.1 * FRICTION * G * sim.zeno_time] {
            let run = sim.run(&[0.0, 0.0, 0.1], &[0.0, slip, 0.0], 1.0).unwrap();
            let size = slip * slip / DOWN;
            let x = size / 4.0 * (1.0 / (2.0 * k - 2.0) - 1.0 / (2.0 * k + 2.0));
            let y = size / 2.0 * (1.0 / (2.0 * k - 1.0) + 1.0 / (2.0 * k + 1.0));
            let last = &run.summary.last;
            let off = (last.q[0] - x).abs().max((last.q[1] - y).abs());
            assert!(off < tolerance, "{off:e} at {tolerance:e} from {slip}");
            assert_eq!(last.qd, [0.0; 3]);
            assert!(run.summary.energy.error().abs() < tolerance, "{:?}", run.summary.energy);
        }
    }
}

/// Two arms on a hinge without friction, and a hinge between them that dry friction stops within a quarter of the Zeno time: afterwards both turn as
/// one body with the angular momentum of the start. Its error is of second order in that time.
#[test]
fn a_joint_that_dry_friction_stops_at_once_passes_its_momentum_on() {
    let link = |name: &str| {
        format!(
            "<link name='{name}'><inertial><origin xyz='0.5 0 0'/><mass value='1'/>
             <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, more: &str| {
        format!(
            "<joint name='{name}' type='continuous'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>{more}</joint>"
        )
    };
    let elbow = "<origin xyz='1 0 0'/><dynamics friction='3'/>";
    let text = [
        "<robot name='arms'><link name='base'/>",
        &link("one"),
        &link("two"),
        &joint("shoulder", "base", "one", ""),
        &joint("elbow", "one", "two", elbow),
        "</robot>",
    ];
    let chain = chain(&text.concat());
    for tolerance in TOLERANCES {
        let zeno_time = Simulation::zeno_time_for(tolerance);
        let sim = Simulation {
            gravity: Vector3::zeros(),
            tolerance,
            zeno_time,
            ..Simulation::new(chain.clone(), Vec::new())
        };
        let (angle, qd) = (0.7_f64, [0.2, 3.0 * zeno_time]);
        let run = sim.run(&[0.0, angle], &qd, 1.0).unwrap();
        // Moments of inertia about the shoulder and the elbow, and what couples them.
        let (own, across) = (0.1 + 0.25, 0.5 * angle.cos());
        let whole = own + 1.0 + own + 2.0 * across;
        let turns = qd[0] + (own + across) / whole * qd[1];
        let last = &run.summary.last;
        assert!((last.qd[0] - turns).abs() < tolerance, "{} {turns} at {tolerance:e}", last.qd[0]);
        assert!((last.q[1] - angle).abs() < tolerance, "{last:?}");
        assert!(last.qd[1].abs() < 1e-15, "{last:?}"); // rounding
        assert!(run.summary.energy.error().abs() < tolerance, "{:?}", run.summary.energy);
    }
}

/// A tripod turns about one of its feet, which slips by little, while the two others slide. With a short Zeno time this slip is followed
/// to its end; with a long one it ends at once, by impulses of all three feet along the directions of their forces. Both motions agree up
/// to terms of second order in the time of the slip.
#[test]
fn a_foot_whose_slip_ends_at_once_moves_its_body_as_one_whose_slip_is_followed() {
    let feet = [[0.05, 0.0], [-0.1, 0.15], [-0.1, -0.15]];
    let foot = |[x, y]: [f64; 2]| {
        format!("<collision><origin xyz='{x} {y} -0.2'/><geometry><sphere radius='0.03'/></geometry></collision>")
    };
    let text = format!(
        "<robot name='tripod'><link name='body'><inertial><mass value='2'/>
         <inertia ixx='0.02' ixy='0' ixz='0' iyy='0.03' iyz='0' izz='0.04'/></inertial>{}</link></robot>",
        feet.map(foot).concat()
    );
    let options = LoadOptions { floating_base: true, ..Default::default() };
    let chain = Chain::from_urdf_str(&text, &options).unwrap();
    let contact = ContactRule::new(Newton { restitution: 0.0, friction: FRICTION });
    let obstacle = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let surface = Surface { name: "floor".into(), obstacle, contact, motion: None };
    let touches = Touch::all(&chain, &[surface], 0.0).unwrap().touches;
    let (gravity, tolerance) = (Vector3::new(0.0, 0.0, -G), 1e-10);
    let (turn, slip) = (1.0, [1.5e-4, 1e-4]);
    let run = |zeno_time: f64| {
        let sim = Simulation { gravity, tolerance, zeno_time, ..Simulation::new(chain.clone(), touches.clone()) };
        // The first foot moves with `slip`, and the body turns about the vertical.
        let qd = [slip[0], slip[1] - turn * feet[0][0], 0.0, 0.0, 0.0, turn];
        sim.run(&[0.0, 0.0, 0.23, 0.0, 0.0, 0.0, 1.0], &qd, 0.01).unwrap()
    };
    let (at_once, followed) = (run(1e-3), run(1e-7));
    let sticks = |run: &carom_sim::Trajectory| {
        run.events.iter().find(|event| event.kind.name() == "sticking").map(|event| event.time)
    };
    assert_eq!(sticks(&at_once), Some(0.0));
    assert!(sticks(&followed) > Some(0.0), "{:?}", sticks(&followed));
    let (one, other) = (&at_once.summary.last, &followed.summary.last);
    let off = one.qd.iter().zip(&other.qd).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // A quarter of the Zeno time squared, and changes of the accelerations at a rate of some tens of 1/s³ in that time.
    assert!(off < 10.0 * (1e-3_f64 / 4.0).powi(2), "{off:e}: {:?} {:?}", one.qd, other.qd);
    for run in [&at_once, &followed] {
        assert!(run.summary.energy.error().abs() < 1e-9, "{:?}", run.summary.energy);
    }
}

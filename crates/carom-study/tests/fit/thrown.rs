//! Simulated tosses, and what else the tests of fits and of comparisons share.

use carom_chain::Chain;
use carom_impact::Coefficients;
use carom_sim::Moment;
use carom_study::Toss;
use carom_testing::files::robot_with;
use fastrand::Rng;
use nalgebra::Vector3;
use std::f64::consts::PI;

pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

pub fn normal(rng: &mut Rng) -> f64 {
    // Box–Muller method
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (2.0 * PI * rng.f64()).cos()
}

pub fn rough(restitution: f64, friction: f64) -> Coefficients {
    Coefficients { restitution, friction, ..Coefficients::default() }
}

pub fn close(what: &str, x: f64, expected: f64, within: f64) {
    assert!((x - expected).abs() <= within, "{what}: {x} instead of {expected}, off by {:e}", x - expected);
}

pub fn load(robot: &str) -> Chain {
    robot_with(robot, true)
}

pub fn tossed(rng: &mut Rng) -> (Vec<f64>, Vec<f64>) {
    let mut wide = |size: f64| size * (2.0 * rng.f64() - 1.0);
    let turn = nalgebra::UnitQuaternion::from_euler_angles(wide(3.0), wide(1.5), wide(3.0));
    let q = vec![wide(1.0), wide(1.0), 0.2, turn.i, turn.j, turn.k, turn.w];
    let qd = (0..6).map(|k| if k < 3 { wide(2.0) } else { wide(10.0) }).collect();
    (q, qd)
}

/// The samples of a motion above the floor z = 0.
pub fn rolled(
    chain: &Chain,
    law: carom_impact::Energetic,
    q: &[f64],
    qd: &[f64],
    every: f64,
    duration: f64,
) -> Vec<Moment> {
    let obstacle = carom_contact::Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let contact = carom_sim::ContactRule::new(law);
    let floor = carom_sim::Surface { name: "floor".into(), obstacle, contact, motion: None };
    let touches = carom_sim::Touch::all(chain, &[floor], 0.0).unwrap().touches;
    let simulation = carom_sim::Simulation { gravity: GRAVITY, ..carom_sim::Simulation::new(chain.clone(), touches) };
    let mut samples: Vec<Moment> = Vec::new();
    let sampling = carom_sim::Sampling { every: Some(every), ..Default::default() };
    let mut keep = |seen: carom_sim::Seen| {
        if let carom_sim::Seen::Moment(moment) = seen {
            samples.push(moment.clone());
        }
    };
    simulation.stream(q, qd, duration, sampling, &mut keep).unwrap();
    samples
}

/// Tosses of a chain above the floor z = 0, computed with a law and sampled every 10 ms for 0.5 s.
pub fn thrown(chain: &Chain, law: carom_impact::Energetic, rng: &mut Rng, count: i64) -> Vec<Toss> {
    let one = |number| {
        let (mut q, mut qd) = tossed(rng);
        q[2] = 0.15 + 0.1 * rng.f64();
        qd[2] *= 0.2;
        let samples = rolled(chain, law, &q, &qd, 0.01, 0.5);
        Toss { number, samples }
    };
    (0..count).map(one).collect()
}

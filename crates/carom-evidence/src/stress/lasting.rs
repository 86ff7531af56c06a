//! Motions with several contacts that last at once.

use super::bodies::{G, cuboid, free, link, moments, plane, rule, simulation, touches};
use super::method::{Found, Judged, STEPS, said};
use super::single::worse;
use carom_sim::{EventKind, Simulation, Trajectory};
use nalgebra::Vector3;

/// Half the length, the width and the height of the block, m.
const HALF: [f64; 3] = [0.2, 0.15, 0.1];

/// A free block of 1 kg among half-spaces, each with a point and a normal.
fn scene(
    method: &str,
    planes: &[[Vector3<f64>; 2]],
    (restitution, friction): (f64, f64),
    gravity: Vector3<f64>,
) -> Result<Simulation, String> {
    let shape = format!("<collision>{}</collision>", cuboid(HALF));
    let chain = free(&link("block", 1.0, moments(1.0, HALF), [0.0; 3], &shape))?;
    let planes = planes.iter().map(|[point, normal]| plane(*point, *normal)).collect::<Result<_, _>>()?;
    let touches = touches(&chain, planes, &rule(restitution, friction))?;
    let zeno_time = Simulation::zeno_time_for(1e-12);
    Ok(Simulation { gravity, zeno_time, ..simulation(method, chain, touches) })
}

fn run(sim: &Simulation, height: f64, [vx, vz]: [f64; 2], duration: f64) -> Result<Trajectory, String> {
    let q = [0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0];
    sim.run(&q, &[vx, 0.0, vz, 0.0, 0.0, 0.0], duration).map_err(said)
}

fn floor() -> [Vector3<f64>; 2] {
    [Vector3::zeros(), Vector3::z()]
}

/// Without a time step, in events.
fn without_steps(found: Found, moved: &Trajectory) -> Found {
    found.must_be("no time step", moved.summary.statistics.contact_steps == 0)
}

/// It slides at 1 m/s and stops after v²/(2 μ g), at the time v/(μ g): one event for four corners.
pub fn stop(method: &str) -> Judged {
    let (mu, speed) = (0.3, 1.0);
    let sim = scene(method, &[floor()], (0.0, mu), Vector3::new(0.0, 0.0, -G))?;
    let moved = run(&sim, HALF[2], [speed, 0.0], 0.5)?;
    let error = (moved.summary.last.q[0] - speed * speed / (2.0 * mu * G)).abs();
    if method == STEPS {
        return Ok(Found::figure(error));
    }
    let sticks = |event: &&carom_sim::Event| event.kind.name() == "sticking";
    let times: Vec<f64> = moved.events.iter().filter(sticks).map(|event| event.time).collect();
    let late = times.iter().map(|time| (time - speed / (mu * G)).abs()).fold(0.0, worse);
    let found = Found::figure(error).must("error of the time at which a corner stops, s", late, 1e-11);
    Ok(without_steps(found.must_be("four corners stop", times.len() == 4), &moved))
}

/// On a slope, by gravity that leans: the corners bear m g cos θ/4 (1 ± tan θ · height/length), and their friction is m g sin θ.
pub fn loads(method: &str) -> Judged {
    let (s, c) = 0.2_f64.atan().sin_cos();
    let sim = scene(method, &[floor()], (0.0, 0.5), Vector3::new(G * s, 0.0, -G * c))?;
    let moved = run(&sim, HALF[2], [0.0; 2], 0.5)?;
    let contacts = &moved.summary.contacts;
    let mut error = (contacts.iter().map(|contact| contact.force.x).sum::<f64>() + G * s).abs();
    for contact in contacts {
        let expected = G * c / 4.0 * (1.0 + s / c * HALF[2] / HALF[0] * contact.point.x.signum());
        error = worse(error, (contact.normal_force - expected).abs());
    }
    let crept = moved.summary.last.q[0].abs();
    let found = Found::figure(error / G).must("distance crept, m", crept, 1e-12);
    Ok(without_steps(found.must_be("four corners bear", contacts.len() == 4), &moved))
}

/// It falls between two rough walls that it touches without pressing: none of eight corners bears.
pub fn walls(method: &str) -> Judged {
    let planes = [[-HALF[0] * Vector3::x(), Vector3::x()], [HALF[0] * Vector3::x(), -Vector3::x()]];
    let sim = scene(method, &planes, (0.0, 0.5), Vector3::new(0.0, 0.0, -G))?;
    let time = 0.5;
    let moved = run(&sim, 0.0, [0.0; 2], time)?;
    let fall = 0.5 * G * time * time;
    let error = (moved.summary.last.q[2] + fall).abs() / fall;
    let flagged = moved.events.iter().any(|event| matches!(event.kind, EventKind::NonUnique { .. }));
    Ok(without_steps(Found::figure(error).must_be("flagged non-unique: a squeeze could hold it", flagged), &moved))
}

/// It lands flat with e = 0.5, and its four corners chatter together: at rest after √(2h/g) (1 + e)/(1 − e).
pub fn chatter(method: &str) -> Judged {
    let (e, drop) = (0.5, 0.2);
    let sim = scene(method, &[floor()], (e, 0.3), Vector3::new(0.0, 0.0, -G))?;
    let moved = run(&sim, HALF[2] + drop, [0.0; 2], 1.0)?;
    let expected = (2.0 * drop / G).sqrt() * (1.0 + e) / (1.0 - e);
    let rest = moved.events.iter().find(|event| matches!(event.kind, EventKind::Rest));
    let error = rest.map_or(f64::NAN, |event| (event.time - expected).abs());
    let last = &moved.summary.last.q;
    let tilt = worse((last[2] - HALF[2]).abs(), last[3].hypot(last[4]));
    Ok(without_steps(Found::figure(error).must("error of the pose at rest, m and rad/2", tilt, 1e-9), &moved))
}

//! The paper's arm reaches the wall at 0.2 m/s and 45°, e = 0.35, with five controllers: number of bounces, time until the tip
//! rests on the wall, and its slip along the wall until then.
//!
//! `cargo run --example transition`

use carom::contact::Obstacle;
use carom::nalgebra::Vector3;
use carom::prelude::{Chain, Energetic, SimError};
use carom::sim::{
    ContactMode, ContactRule, Drive, Event, EventKind, ImpactInvariant, Pd, Simulation, Surface, Touch, Trajectory,
    Transition,
};
use carom_evidence::paper::{Elbow, strike};

const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar2.urdf");
const SPEED: f64 = 0.2;
const ANGLE: f64 = 45.0;
const RESTITUTION: f64 = 0.35;
const DURATION: f64 = 2.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = Chain::from_urdf_file(URDF)?;
    let pose = Elbow::Up.pose();
    let before = strike(&arm, Elbow::Up, ANGLE, SPEED, RESTITUTION)?;
    let (normal, qd) = (-Vector3::x(), before.qd_minus);
    // The wall stands 10 mm before the tip of this pose.
    let at = arm.workspace().update(&arm, &pose)?.pose(arm.frame("tip")?).translation;
    let wall = Obstacle::half_space(at + Vector3::x() * 0.01, normal)?;
    let contact = ContactRule::new(Energetic { restitution: RESTITUTION, friction: 0.0 });
    let surface = Surface { name: "wall".into(), obstacle: wall, contact, motion: None };
    let touches = Touch::all(&arm, &[surface], 0.0)?.touches;

    // The target of the PD controllers is the configuration after 0.1 s of free motion: the tip 4 mm behind the wall.
    let target: Vec<f64> = pose.iter().zip(qd).map(|(q, v)| q + 0.1 * v).collect();
    let (kp, kd, tip) = (40.0, 4.0, || "tip".to_owned());
    let pd = Drive::Pd(Pd { kp: kp.into(), kd: kd.into(), target: target.clone() });
    let (kp, kd) = (kp.into(), kd.into());
    let blind = ImpactInvariant { tip: tip(), normal, kp, kd, target, velocity: vec![0.0; 2] };
    let velocity = before.hit.u_minus;
    let transition = |compensate| {
        let (gain, press, restitution) = (60.0, 0.5, RESTITUTION);
        Drive::Transition(Transition { tip: tip(), normal, velocity, gain, press, compensate, restitution })
    };

    println!(
        "{} approaches a wall at {SPEED} m/s and {ANGLE} deg, e = {RESTITUTION}, frictionless; {DURATION} s.",
        arm.name()
    );
    println!("pd and impact-invariant act from the first impact on, transition from the start.\n");
    println!("{:24} bounces    rests      slip  fastest  hardest", "");
    println!("{:24}          after s        mm      m/s  hit N s", "controller");
    for (name, drive, after) in [
        ("off", Drive::Off, None),
        ("pd", Drive::Off, Some(pd)),
        ("impact-invariant", Drive::Off, Some(Drive::ImpactInvariant(blind))),
        ("transition", transition(false), None),
        ("transition, compensated", transition(true), None),
    ] {
        let sim = Simulation { drive, after_impact: after, ..Simulation::new(arm.clone(), touches.clone()) };
        println!("{name:24} {}", row(&sim, &sim.run(&pose, &qd, DURATION)?)?);
    }
    println!("{READING}");
    Ok(())
}

const READING: &str = "
Without motors the tip bounces off, and the impact doubles its speed along the wall. The PD controllers bring it to rest on
the wall after about a dozen bounces and most of a second, the transition controller within 0.13 s. With compensation the
tip approaches with a lower tangential velocity, and the impact changes it to the desired one: half the greatest speed
along the wall, with an impulse 3 % larger.";

/// Number of bounces, time until the tip rests on the wall, slip from the first impact until then (or until the end), greatest
/// speed along the wall, and largest impulse.
fn row(sim: &Simulation, run: &Trajectory) -> Result<String, SimError> {
    let mut workspace = sim.chain.workspace();
    let tip = sim.chain.point(sim.chain.frame("tip")?, Vector3::zeros());
    let hits: Vec<&Event> = run.events.iter().filter(|event| matches!(event.kind, EventKind::Impact { .. })).collect();
    let rests = |event: &&Event| matches!(event.kind, EventKind::Mode { mode: ContactMode::Sliding { .. } });
    let rest = run.events.iter().find(rests).map(|event| event.time);
    let first = hits.first().map_or(DURATION, |event| event.time);
    let (mut slip, mut fastest, mut last) = (0.0_f64, 0.0_f64, None);
    for k in 0..=4000 {
        let time = first + (rest.unwrap_or(DURATION) - first) * f64::from(k) / 4000.0;
        let moment = run.at(&sim.chain, time);
        let view = workspace.update(&sim.chain, &moment.q)?;
        let (y, speed) = (view.position(tip).y, view.point_velocity(tip, &moment.qd)?.y.abs());
        slip += last.map_or(0.0, |before: f64| (y - before).abs());
        (fastest, last) = (fastest.max(speed), Some(y));
    }
    let hardest = hits.iter().flat_map(|event| &event.impulses).map(|one| one.impulse.norm()).fold(0.0, f64::max);
    let rest = rest.map_or_else(|| "never".into(), |time| format!("{:.4}", time - first));
    Ok(format!("{:7} {rest:>8} {:>9.2} {fastest:>8.4} {hardest:>8.4}", hits.len(), slip * 1e3))
}

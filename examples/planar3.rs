//! The paper's arm with a third link: effective mass at the wall and jump of the tangential velocity along the self-motion,
//! that is over all poses with the same tip position.
//!
//! `cargo run --example planar3`

use carom::chain::Chain;
use carom::study::{SelfMotionPoint, self_motion};
use nalgebra::Vector3;

const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/robots/planar3.urdf");
const LENGTHS: [f64; 3] = [0.45, 0.45, 0.25];
/// On the wall of the two-link experiment.
const TARGET: [f64; 2] = [0.6364, 0.0];
const RESTITUTION: f64 = 0.35;
const SPEED: f64 = 0.2;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = Chain::from_urdf_file(URDF)?;
    let tip = arm.frame("tip")?;
    let (normal, tangent) = (-Vector3::x(), -Vector3::y());
    let poses = self_motion(&arm, tip, LENGTHS, TARGET, normal, tangent, 360)?;

    println!(
        "{}: tip at ({}, {}) m on a wall, approach at {SPEED} m/s and 45 deg, e = {RESTITUTION}, frictionless.",
        arm.name(),
        TARGET[0],
        TARGET[1]
    );
    println!("{} poses of the self-motion; every 24th:\n", poses.len());
    println!("  shoulder    elbow    wrist   effective    impulse       v_t+  tangential");
    println!("       deg      deg      deg     mass kg        N s        m/s  velocity");
    for pose in poses.iter().step_by(24) {
        println!("{}", line(pose));
    }

    let mass = |p: &&SelfMotionPoint| p.effective_mass.unwrap_or(f64::INFINITY);
    let lightest = poses.iter().min_by(|a, b| mass(a).total_cmp(&mass(b)));
    let heaviest = poses.iter().filter(|p| p.effective_mass.is_some()).max_by(|a, b| mass(a).total_cmp(&mass(b)));
    let steady = poses.iter().filter(|p| p.coupling.is_some()).min_by(|a, b| jump(a).abs().total_cmp(&jump(b).abs()));
    println!();
    for (what, pose) in [
        ("smallest effective mass", lightest),
        ("largest effective mass", heaviest),
        ("smallest tangential jump", steady),
    ] {
        if let Some(pose) = pose {
            println!("{what}:\n{}", line(pose));
        }
    }
    if let (Some(light), Some(heavy)) = (lightest, heaviest) {
        println!(
            "\nAlong the self-motion the effective mass varies by a factor of {:.1}.",
            mass(&heavy) / mass(&light)
        );
    }
    Ok(())
}

/// v_t⁺ − v_t⁻ = −(1+e) h v_n (the paper's eq. 15), with the approach speed v_n.
fn jump(pose: &SelfMotionPoint) -> f64 {
    -(1.0 + RESTITUTION) * pose.coupling.unwrap_or(f64::NAN) * SPEED * 45_f64.to_radians().sin()
}

fn line(pose: &SelfMotionPoint) -> String {
    let degrees: Vec<String> = pose.q.iter().map(|q| format!("{:>9.1}", q.to_degrees())).collect();
    let Some(mass) = pose.effective_mass else {
        return format!(" {}   singular direction: no joint moves the tip along the normal", degrees.join(""));
    };
    let before = SPEED * 45_f64.to_radians().cos();
    let impulse = (1.0 + RESTITUTION) * mass * SPEED * 45_f64.to_radians().sin();
    let after = before + jump(pose);
    let change = carom_evidence::paper::Tangential::of(before, after).name();
    format!(" {} {mass:>11.4} {impulse:>10.4} {after:>10.4}  {change}", degrees.join(""))
}

//! Bodies, joints and simulations of the scenes.

use super::method::{COMPLIANT, STEPS, said};
use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::Energetic;
use carom_sim::{Compliance, ContactRule, Simulation, Surface, Touch};
use nalgebra::Vector3;

pub const G: f64 = 9.81;
/// Where a scene does not say otherwise: stiffness of compliant contacts, N/m^1.5, and time step, s.
pub const STIFFNESS: f64 = 1e7;
pub const STEP: f64 = 1e-3;

/// A link with mass (kg) and moments of inertia about its axes (kg m²) at the mass centre (m), and its shapes.
pub fn link(name: &str, mass: f64, [x, y, z]: [f64; 3], [a, b, c]: [f64; 3], shapes: &str) -> String {
    format!(
        r#"<link name="{name}"><inertial><origin xyz="{a} {b} {c}"/><mass value="{mass}"/>
        <inertia ixx="{x}" ixy="0" ixz="0" iyy="{y}" iyz="0" izz="{z}"/></inertial>{shapes}</link>"#
    )
}

/// A joint (`continuous`, `prismatic` or `fixed`) at `x` along the parent's first axis. Sliders end far away.
pub fn joint(kind: &str, [parent, child]: [&str; 2], x: f64, axis: [f64; 3]) -> String {
    let [a, b, c] = axis;
    let limit = if kind == "prismatic" { r#"<limit lower="-1e6" upper="1e6" effort="0" velocity="0"/>"# } else { "" };
    format!(
        r#"<joint name="to {child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="{x} 0 0"/><axis xyz="{a} {b} {c}"/>{limit}</joint>"#
    )
}

/// The collision shape of a ball.
pub fn sphere([x, y, z]: [f64; 3], radius: f64) -> String {
    format!(r#"<collision><origin xyz="{x} {y} {z}"/><geometry><sphere radius="{radius}"/></geometry></collision>"#)
}

/// The geometry of a box with these half edges.
pub fn cuboid(half: [f64; 3]) -> String {
    let [x, y, z] = half.map(|half| 2.0 * half);
    format!(r#"<geometry><box size="{x} {y} {z}"/></geometry>"#)
}

/// Moments of inertia of a uniform box.
pub fn moments(mass: f64, half: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = half.map(|half| half * half);
    [y + z, x + z, x + y].map(|sum| mass * sum / 3.0)
}

/// Links and joints on the link `world`.
pub fn chain(elements: &str) -> Result<Chain, String> {
    let text = format!(r#"<robot name="bodies"><link name="world"/>{elements}</robot>"#);
    Chain::from_urdf_str(&text, &LoadOptions::default()).map_err(said)
}

/// A free body.
pub fn free(link: &str) -> Result<Chain, String> {
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    Chain::from_urdf_str(&format!(r#"<robot name="body">{link}</robot>"#), &options).map_err(said)
}

pub fn rule(restitution: f64, friction: f64) -> ContactRule {
    ContactRule::new(Energetic { restitution, friction })
}

/// The rule of a method, compliant where the method is: Hunt & Crossley's force; friction smoothed below 1e-3 m/s.
pub fn with_method(method: &str, rule: ContactRule) -> ContactRule {
    ContactRule { compliance: (method == COMPLIANT).then_some(Compliance::new(STIFFNESS)), ..rule }
}

pub fn plane(point: Vector3<f64>, normal: Vector3<f64>) -> Result<Obstacle, String> {
    Obstacle::half_space(point, normal).map_err(said)
}

/// The contacts of a chain with obstacles, without the far ends of its sliders.
pub fn touches(chain: &Chain, obstacles: Vec<Obstacle>, contact: &ContactRule) -> Result<Vec<Touch>, String> {
    let surface =
        |(k, obstacle)| Surface { name: format!("surface {k}"), obstacle, contact: contact.clone(), motion: None };
    let surfaces: Vec<Surface> = obstacles.into_iter().enumerate().map(surface).collect();
    let all = Touch::all(chain, &surfaces, 0.0).map_err(said)?.touches;
    Ok(all.into_iter().filter(|touch| touch.link().is_some()).collect())
}

/// Under gravity, as a method simulates it.
pub fn simulation(method: &str, chain: Chain, touches: Vec<Touch>) -> Simulation {
    Simulation {
        gravity: Vector3::new(0.0, 0.0, -G),
        tolerance: 1e-12,
        contact_step: STEP,
        stepping: method == STEPS,
        ..Simulation::new(chain, touches)
    }
}

//! Impacts without collision (Painlevé) of contacts beside others.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::Newton;
use carom_sim::{ContactRule, EventKind, Simulation, Surface, Touch};
use nalgebra::Vector3;

/// Radius of the end of the rod, m.
const RADIUS: f64 = 1e-9;

/// Painlevé's rod of 1 kg and 1 m at 60° beside a ball at rest on the same floor. Its lower end slides at 1 m/s; in one direction no
/// acceleration is consistent, and the impulse that stops the end follows: with its inverse inertia H = [13/4, ∓(3/4)√3; ., 7/4] 1/kg
/// it is −H⁻¹(±1, 0) = (∓7/16, (3/16)√3) N s, inside the cone of μ = 1.5. The ball is not moved.
#[test]
fn a_rod_jams_beside_a_contact_at_rest() {
    let link = |name: &str, mass: f64, inertia: f64, shape: &str| {
        format!(
            "<link name='{name}'><inertial><mass value='{mass}'/><inertia ixx='{inertia}' ixy='0' ixz='0' iyy='{inertia}' iyz='0'
             izz='{inertia}'/></inertial><collision>{shape}</collision></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, axis: &str| {
        format!(
            "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><axis xyz='{axis}'/>
             <limit lower='-9' upper='9' effort='0' velocity='0'/></joint>"
        )
    };
    let end = format!("<origin xyz='0.5 0 0'/><geometry><sphere radius='{RADIUS}'/></geometry>");
    let text = [
        "<robot name='rod'><link name='world'/><link name='a'/><link name='b'/>",
        &link("rod", 1.0, 1.0 / 12.0, &end),
        &link("ball", 1.0, 1.0, "<geometry><sphere radius='0.1'/></geometry>"),
        &joint("x", "prismatic", "world", "a", "1 0 0"),
        &joint("z", "prismatic", "a", "b", "0 0 1"),
        &joint("pitch", "continuous", "b", "rod", "0 1 0"),
        &joint("fall", "prismatic", "world", "ball", "0 0 1"),
        "</robot>",
    ];
    let chain = Chain::from_urdf_str(&text.concat(), &LoadOptions::default()).unwrap();
    let contact = ContactRule::new(Newton { restitution: 0.0, friction: 1.5 });
    let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let floor = Surface { name: "floor".into(), obstacle: floor, contact, motion: None };
    let mut touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
    touches.retain(|touch| touch.link().is_some());
    let sim = Simulation { gravity: Vector3::new(0.0, 0.0, -9.81), ..Simulation::new(chain, touches) };
    let (pitch, height) = (60_f64.to_radians(), 0.5 * 60_f64.to_radians().sin() + RADIUS);
    let mut jammed = 0;
    for side in [1.0, -1.0] {
        let run = sim.run(&[0.0, height, pitch, 0.1], &[side, 0.0, 0.0, 0.0], 0.02).unwrap();
        let EventKind::Several { touches, .. } = &run.events[0].kind else { continue };
        jammed += 1;
        assert_eq!((touches.len(), run.events[0].time, run.summary.statistics.contact_steps), (2, 0.0, 0));
        let impulse = |link: &str| {
            let of = |one: &&carom_sim::ContactImpulse| sim.touches[one.touch].link() == Some(link);
            run.events[0].impulses.iter().find(of).expect("an impulse").impulse
        };
        // The limit of vanishing approach velocities is taken at 1e-8 of the slip.
        let expected = Vector3::new(-7.0 / 16.0 * side, 0.0, 3.0 / 16.0 * 3_f64.sqrt());
        assert!((impulse("rod") - expected).norm() < 1e-7, "{:?}", impulse("rod"));
        assert!(impulse("ball").norm() < 1e-7, "{:?}", impulse("ball"));
        assert!(run.summary.last.qd[3].abs() < 1e-15, "{:?}", run.summary.last);
    }
    assert_eq!(jammed, 1);
}

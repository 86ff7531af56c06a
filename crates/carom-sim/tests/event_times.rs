//! Events at the limits of time: at the first instants of a run and at its end.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_contact::Obstacle;
use carom_impact::Newton;
use carom_sim::{ContactRule, Integrator, Simulation, Surface, Touch};
use nalgebra::Vector3;

const RADIUS: f64 = 0.1;

/// A ball on a vertical slider over a floor, without gravity.
fn ball(integrator: Integrator) -> Simulation {
    let text = format!(
        r#"<robot name="ball"><link name="world"/>
        <link name="ball">
          <inertial><mass value="2"/><inertia ixx="0.008" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.008"/></inertial>
          <collision><geometry><sphere radius="{RADIUS}"/></geometry></collision>
        </link>
        <joint name="fall" type="prismatic"><parent link="world"/><child link="ball"/><axis xyz="0 0 1"/>
          <limit lower="-1000" upper="1000" effort="0" velocity="0"/></joint></robot>"#
    );
    let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap();
    let contact = ContactRule::new(Newton { restitution: 0.5, friction: 0.0 });
    let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let floor = Surface { name: "floor".into(), obstacle: floor, contact, motion: None };
    let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
    let touches = touches.into_iter().filter(|touch| touch.link().is_some()).collect();
    Simulation { integrator, ..Simulation::new(chain, touches) }
}

/// A run shorter than the first step of an integrator (1 µs for Radau's) ends at its end, before an impact 0.2 µs later.
#[test]
fn nothing_happens_after_the_end_of_a_run() {
    for integrator in [Integrator::DormandPrince, Integrator::Radau] {
        let sim = ball(integrator);
        let (start, end) = (RADIUS + 7e-7, 5e-7);
        let run = sim.run(&[start], &[-1.0], end).unwrap_or_else(|e| panic!("{integrator:?} {e}"));
        assert!(run.events.is_empty(), "{integrator:?}: {:?}", run.events);
        assert_eq!(run.summary.last.time, end);
        assert!(run.segments.iter().all(|segment| segment.end <= end), "{integrator:?}: {:?}", run.segments);
        assert!((run.summary.last.q[0] - (start - end)).abs() < 1e-16, "{integrator:?}: {:?}", run.summary.last);
        // The impact that the first run must not see.
        let later = sim.run(&[start], &[-1.0], 1e-6).unwrap();
        assert_eq!(later.events.len(), 1);
        assert!((later.events[0].time - 7e-7).abs() < 1e-16, "{integrator:?}: {:?}", later.events[0]);
    }
}

/// Times near zero have no rounding worth mentioning: the state at an impact 2 fs after the start is that of the impact.
#[test]
fn the_state_at_an_impact_just_after_the_start_has_a_closed_gap() {
    for integrator in [Integrator::DormandPrince, Integrator::Radau] {
        let (gap, speed) = (2e-9, 1e6);
        let run =
            ball(integrator).run(&[RADIUS + gap], &[-speed], 1e-6).unwrap_or_else(|e| panic!("{integrator:?} {e}"));
        let hit = &run.events[0];
        assert_eq!((run.events.len(), hit.kind.name()), (1, "impact"));
        // A gap within 4 ε = 9e-16 m of zero counts as closed.
        assert!((hit.time / (gap / speed) - 1.0).abs() < 1e-6, "{integrator:?}: {} s", hit.time);
        assert!((hit.q[0] - RADIUS).abs() < 1e-15, "{integrator:?}: {:e}", hit.q[0] - RADIUS);
    }
}

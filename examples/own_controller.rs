//! Two ways to a controller of one's own: a function of time and state inside the simulation, and a sampled loop around it.
//!
//! A ball of 2 kg on a vertical slider is to be held 0.3 m above a floor onto which it falls at first.

use carom::prelude::{Chain, Newton, Obstacle};
use carom::sim::{ContactRule, Controller, Drive, Observed, SimError, Simulation, Surface, Touch};
use nalgebra::Vector3;

const WANTED: f64 = 0.3;

/// A spring and a damper that switch on at the first impact. The forces depend on time and state only.
struct AfterTheFall {
    stiffness: f64,
    damping: f64,
}

impl Controller for AfterTheFall {
    fn name(&self) -> &str {
        "after-the-fall"
    }

    fn forces(&self, now: &Observed, forces: &mut [f64]) -> Result<(), SimError> {
        if now.hit {
            let weight = now.chain.total_mass() * now.gravity.norm();
            forces[0] = weight + self.stiffness * (WANTED - now.q[0]) - self.damping * now.qd[0];
        }
        Ok(())
    }

    fn is_steady(&self) -> bool {
        true
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = Chain::from_urdf_str(
        r#"<robot name="lift"><link name="world"/>
          <link name="ball"><inertial><mass value="2"/>
            <inertia ixx="0.008" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.008"/></inertial>
            <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
          <joint name="height" type="prismatic"><parent link="world"/><child link="ball"/><axis xyz="0 0 1"/>
            <limit lower="-9" upper="9" effort="60" velocity="9"/></joint></robot>"#,
        &Default::default(),
    )?;
    let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z())?;
    let contact = ContactRule::new(Newton { restitution: 0.4, friction: 0.0 });
    let floor = Surface { name: "floor".into(), obstacle: floor, contact, motion: None };
    let touches = Touch::all(&ball, &[floor], 0.0)?.touches;
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let simulation = Simulation { gravity, ..Simulation::new(ball, touches) };

    let drive = Drive::user(AfterTheFall { stiffness: 200.0, damping: 40.0 });
    let inside = Simulation { drive, ..simulation.clone() };
    let run = inside.run(&[0.6], &[0.0], 3.0)?;
    println!("inside:  {} impacts, {:.6} m after 3 s", impacts(&run.events), run.summary.last.q[0]);

    // A loop at 200 Hz with an integrator, which a function of the state could not have.
    let mut session = simulation.start(&[0.6], &[0.0])?;
    let (mut events, mut sum) = (Vec::new(), 0.0);
    while session.time() < 3.0 - 1e-9 {
        let now = session.moment();
        let error = WANTED - now.q[0];
        sum += 0.005 * error;
        session.set_forces(&[19.62 + 200.0 * error + 50.0 * sum - 40.0 * now.qd[0]])?;
        events.extend(session.advance(0.005)?.events);
    }
    println!("sampled: {} impacts, {:.6} m after 3 s", impacts(&events), session.moment().q[0]);
    Ok(())
}

fn impacts(events: &[carom::sim::Event]) -> usize {
    events.iter().filter(|event| event.kind.name() == "impact").count()
}

//! The energetic law of several contacts in simulations: cradles against the velocities of elastic contacts.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_impact::{Energetic, Frictionless};
use carom_sim::{ContactRule, SeveralLaw, Simulation, Touch};

const RADIUS: f64 = 0.1;

/// Balls of 1 kg on a common line, each with a slider of its own along it.
fn row(count: usize) -> Chain {
    let ball = |k: usize| {
        format!(
            r#"<link name="ball{k}"><inertial><mass value="1"/>
              <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial>
              <collision><geometry><sphere radius="{RADIUS}"/></geometry></collision></link>
            <joint name="x{k}" type="prismatic"><parent link="world"/><child link="ball{k}"/><axis xyz="1 0 0"/>
              <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>"#
        )
    };
    let text =
        format!(r#"<robot name="row"><link name="world"/>{}</robot>"#, (1..=count).map(ball).collect::<String>());
    Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap()
}

/// A simulation in which neighbouring balls may touch.
fn neighbours(chain: Chain, contact: ContactRule) -> Simulation {
    let pairs = 1..chain.nv();
    let touches =
        pairs.flat_map(|k| Touch::between(&chain, &format!("ball{k}"), &format!("ball{}", k + 1), &contact).unwrap());
    Simulation::new(chain.clone(), touches.collect())
}

/// The balls of B8 under the energetic law, whose outcome depends on the stiffnesses; with a middle contact of another
/// stiffness the ratio counts.
#[test]
fn energetic_law_disperses_cradles_as_elastic_contacts_do() {
    for (exponent, stiffnesses, after) in [
        (1.0, vec![1.0, 1.0], vec![-0.130262, 0.150230, 0.980032]),
        (1.5, vec![7.0, 7.0], vec![-0.070952, 0.076403, 0.994549]),
        (1.5, vec![10.0, 1.0], vec![-0.006184, 0.006222, 0.999962]),
        (1.5, vec![1.0, 10.0], vec![-0.325713, 0.575813, 0.749900]),
        (1.5, vec![1.0; 4], vec![-0.07109, -0.03027, -0.01446, 0.12704, 0.98878]),
    ] {
        let count = after.len();
        let contact = ContactRule::new(Frictionless { restitution: 1.0 });
        let mut sim = neighbours(row(count), contact);
        sim.several = SeveralLaw::Energetic { exponent };
        sim.touches.iter_mut().zip(&stiffnesses).for_each(|(touch, k)| touch.contact.relative_stiffness = *k);
        let mut q: Vec<f64> = (0..count).map(|k| 2.0 * RADIUS * k as f64).collect();
        q[0] = -0.3;
        let mut qd = vec![0.0; count];
        qd[0] = 1.0;
        let run = sim.run(&q, &qd, 0.5).unwrap();
        // As many digits as are known.
        let within = if count == 3 { 1e-6 } else { 1e-5 };
        for (found, expected) in run.events[0].qd_plus.iter().zip(&after) {
            assert!((found - expected).abs() < within, "{exponent} {stiffnesses:?}: {:?}", run.events[0].qd_plus);
        }
        let energy: f64 = run.summary.last.qd.iter().map(|v| v * v).sum();
        assert!((energy - 1.0).abs() < 1e-10, "{energy}");
    }
}

/// A contact with friction is refused before the run, as are a stiffness and an exponent out of range.
#[test]
fn energetic_law_refuses_friction_and_invalid_stiffnesses() {
    let energetic = SeveralLaw::Energetic { exponent: 1.5 };
    let refused = |several, contact| {
        let sim = Simulation { several, ..neighbours(row(3), contact) };
        sim.run(&[-0.3, 0.2, 0.4], &[1.0, 0.0, 0.0], 0.5).unwrap_err().to_string()
    };
    let smooth = ContactRule::new(Frictionless { restitution: 1.0 });
    let rough = ContactRule::new(Energetic { restitution: 0.5, friction: 0.2 });
    assert!(
        refused(energetic, rough).contains("friction is 0.2: the energetic law for several contacts has no friction")
    );
    let soft = ContactRule { relative_stiffness: 0.0, ..smooth.clone() };
    assert!(refused(energetic, soft).contains("relative_stiffness is 0: "));
    assert!(refused(SeveralLaw::Energetic { exponent: 0.5 }, smooth).contains("0.5"));
}

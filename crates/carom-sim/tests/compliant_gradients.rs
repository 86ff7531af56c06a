//! Derivatives of runs through compliant contacts: their damping and memory, bristles and smoothed friction.

use crate::closed_gradients::ball;
use crate::sensitivity::{agrees, check, kinds};
use carom_impact::{Damping, Newton};
use carom_sim::{Compliance, ContactRule, Parameter, Simulation, Yielding};
use carom_testing::scenes::{changed, with_robots};

/// A bristle holds, slips and swings: its deflection is among what is differentiated.
#[test]
fn sensitivities_through_a_contact_with_a_bristle_equal_differences_of_runs() {
    let bristle =
        "friction = 0.4\ncompliance = { stiffness = 1e8, exponent = 3.0, bristle = { stiffness = 1e4, damping = 50 } }";
    let found = check("bristle", &changed("planar2", &[("friction = 0.0", bristle)]), 0.5, None, 1e-6);
    assert_eq!(kinds(&found), ["pressing", "lift-off"]);
}

/// A floating ball of 60 g bounces once with slip on compliant floors, each of its sliders begins and ceases to slip several times: near the
/// closing and the opening the deflection is as small as the steps of differences were.
#[test]
fn sensitivities_through_bristles_of_every_stiffness_equal_differences_of_runs() {
    for force in ["\"hunt-crossley\"", "\"kelvin-voigt\"", "\"walton-braun\"", "\"kelvin-voigt\", pulls = true"] {
        for (stiffness, damping, slip) in [(1e3, 1.0, 1.0), (1e4, 1.0, 1.0), (1e4, 100.0, 0.1), (1e5, 10.0, 1.0)] {
            // Its steps are those of the bristle, and the run is the more accurate.
            let text = format!(
                "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.3, 0, 0, 0, 1]\n\
                 qd = [{slip}, 0, 0, 0, 0, 0]\n[[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n\
                 [contact]\nrestitution = 0.6\nfriction = 0.2\n\
                 compliance = {{ stiffness = 1e4, force = {force}, bristle = {{ stiffness = {stiffness}, damping = {damping} }} }}\n\
                 [run]\nduration = 0.3\ngravity = [0, 0, -9.81]\ntolerance = 1e-10\n"
            );
            let scene = with_robots(&text).unwrap();
            let plan = scene.plan().unwrap();
            let sim = &plan.simulation;
            let found = plan.sensitivity(0.3, &[]).unwrap();
            let name = format!("{force} {stiffness} {damping}");
            agrees(&name, &found, (sim, &plan.q, &plan.qd), 0.3, &[], (&[2, 6], 1e-5), 1e-4);
        }
    }
}

/// The damping of a compliant contact follows from the approach speed, and is among what is differentiated.
#[test]
fn sensitivities_through_a_compliant_contact_equal_differences_of_runs() {
    // The slope of the force has a kink of d^0.5 where the contact begins with n = 1.5, which costs the integration of S digits.
    for (exponent, tolerance) in [(1.5, 1e-5), (3.0, 1e-6)] {
        let normal = Yielding::HuntCrossley { exponent, damping: Damping::Exact };
        let contact = ContactRule {
            compliance: Some(Compliance { normal, ..Compliance::new(2e4) }),
            ..ContactRule::new(Newton { restitution: 0.6, friction: 0.0 })
        };
        let sim = ball(contact);
        let parameters = Parameter::all(&sim);
        let found = sim.sensitivity(&[0.3], &[-0.5], 0.35, &parameters).unwrap();
        agrees("ball", &found, (&sim, &[0.3], &[-0.5]), 0.35, &parameters, (&[0, 1, 2], 1e-5), tolerance);
    }
}

/// A ball that starts within the depth of a contact: its damping follows from the approach at the start and from the coefficients, and a start
/// on the way out unloads from its own depth.
#[test]
fn sensitivities_of_a_start_within_a_contact_equal_differences_of_runs() {
    let hunt = Yielding::HuntCrossley { exponent: 1.5, damping: Damping::Exact };
    for normal in [hunt, Yielding::KelvinVoigt { pulls: true }, Yielding::WaltonBraun] {
        for speed in [-0.7, 0.4] {
            let contact = ContactRule {
                compliance: Some(Compliance { normal, ..Compliance::new(2e4) }),
                ..ContactRule::new(Newton { restitution: 0.6, friction: 0.0 })
            };
            let sim = Simulation { tolerance: 1e-11, ..ball(contact) };
            let parameters = Parameter::all(&sim);
            for duration in [0.01, 0.2] {
                let found = sim.sensitivity(&[0.09], &[speed], duration, &parameters).unwrap();
                let (name, own) = (format!("{normal:?}, {speed}"), (&sim, &[0.09][..], &[speed][..]));
                agrees(&name, &found, own, duration, &parameters, (&[0, 1, 2], 1e-5), 1e-6);
            }
        }
    }
}

/// A ball rolls over a compliant floor at 20 m/s: its friction changes within a slip of 1 mm/s, which steps of differences must not pass. The ball
/// comes to stick, and has as much of its spin in the end at any speed.
#[test]
fn sensitivities_of_smoothed_friction_do_not_depend_on_the_speed_of_rolling() {
    let spin = |speed: f64| {
        let text = format!(
            "[robot]\nurdf = \"../robots/ball.urdf\"\nfloating = true\ntip = \"ball\"\nq = [0, 0, 0.07, 0, 0, 0, 1]\nqd = [{speed}, 0, -1, 0, {}, 0]\n\
             [[surface]]\nname = \"floor\"\nshape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}\n[contact]\nrestitution = 0.6\nfriction = 0.5\n\
             compliance = {{ stiffness = 1e5 }}\n[run]\nduration = 0.1\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n",
            speed / 0.05
        );
        let plan = with_robots(&text).unwrap().plan().unwrap();
        let found = plan.sensitivity(0.1, &[]).unwrap();
        found.last_by.unwrap_or_else(|| panic!("{:?}", found.broken))[(10, 10)]
    };
    let slow = spin(0.5);
    assert!((spin(20.0) - slow).abs() < 1e-6, "{} {slow}", spin(20.0));
}

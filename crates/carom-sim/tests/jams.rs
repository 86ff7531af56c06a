//! Impacts without collision (Painlevé) of contacts beside others.

use carom_sim::EventKind;
use carom_testing::build::{O, Part, X, Y, Z, ball, chain, shape};
use carom_testing::scenes::{newton, on_floor};
use nalgebra::Vector3;

/// Radius of the end of the rod, m.
const RADIUS: f64 = 1e-9;

/// Painlevé's rod of 1 kg and 1 m at 60° beside a ball at rest on the same floor. Its lower end slides at 1 m/s; in one direction no
/// acceleration is consistent, and the impulse that stops the end follows: with its inverse inertia H = [13/4, ∓(3/4)√3; ., 7/4] 1/kg
/// it is −H⁻¹(±1, 0) = (∓7/16, (3/16)√3) N s, inside the cone of μ = 1.5. The ball is not moved.
#[test]
fn a_rod_jams_beside_a_contact_at_rest() {
    let parts = [
        Part::slider("a", "base", X).massless(),
        Part::slider("b", "a", Z).massless(),
        Part::hinge("rod", "b", Y).weighing(1.0, [1.0 / 12.0; 3]).with(shape(&ball(RADIUS), [0.5, 0.0, 0.0], O)),
        Part::slider("ball", "base", Z).weighing(1.0, [1.0; 3]).shaped(&ball(0.1)),
    ];
    let sim = on_floor(chain(&parts), newton(0.0, 1.5));
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

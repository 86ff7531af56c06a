//! The rigid limit of compliant contacts, as `carom chart --stiffness` draws it.

use crate::chart::StiffnessChart;
use carom_sim::Yielding;
use carom_testing::scenes::shipped;
use std::time::Duration;

const BUDGET: Duration = Duration::from_secs(100);

/// A block that falls on two feet, then on the other two: with linear springs the errors of the velocities after the first contact
/// and of the state at the end go to zero as k^(−1/2), with Hertz's exponent as k^(−2/5).
#[test]
fn the_error_of_compliant_feet_falls_with_the_order_of_the_duration_of_their_contact() {
    let linear = shipped("feet");
    let mut hertz = shipped("feet");
    for touch in &mut hertz.simulation.touches {
        if let Some(own) = &mut touch.contact.compliance {
            own.normal = Yielding::HuntCrossley { exponent: 1.5, damping: carom_impact::Damping::Exact };
            own.stiffness = 1e7;
        }
    }
    for (scene, theory) in [(linear, 0.5), (hertz, 0.4)] {
        let chart = StiffnessChart::of(&scene, BUDGET, &mut || {}).unwrap().unwrap();
        assert_eq!(chart.theory, theory);
        for order in [chart.order_after_impact, chart.order_at_end] {
            let order = order.unwrap();
            assert!((order - theory).abs() < 0.02, "order {order} instead of {theory}: {:?}", chart.runs);
        }
        assert_eq!(chart.runs.len(), 13);
    }
}

/// A scene without compliant contacts has no rigid limit to draw.
#[test]
fn a_rigid_scene_has_no_stiffness_chart() {
    let mut scene = shipped("feet");
    scene.simulation.touches.iter_mut().for_each(|touch| touch.contact.compliance = None);
    assert_eq!(StiffnessChart::of(&scene, BUDGET, &mut || {}).unwrap(), None);
}

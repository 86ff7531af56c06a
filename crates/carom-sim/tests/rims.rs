//! The arm of `scenes/table.toml` from starts after which its links lie with rims and round sides on the edges of the table.

use carom_sim::{EventKind, StopReason};
use carom_testing::scenes::shipped;
use carom_testing::tables::numbers;

/// Runs the scene from a start; without time steps, and with its energies in balance. Whether a rim or the end of a round side
/// has struck an edge.
fn falls(q: &str, qd: &str) -> bool {
    let scene = shipped("table");
    let plan = scene.plan().unwrap();
    let run = plan.simulation.run(&numbers(q), &numbers(qd), scene.duration).unwrap();
    assert_eq!(run.summary.stop, StopReason::Duration);
    let steps = run.events.iter().filter(|event| matches!(event.kind, EventKind::Steps { .. })).count();
    let touches = &plan.simulation.touches;
    assert_eq!(steps, 0, "stretches of time steps");
    // The arm falls from some 100 J. The tolerance of the scene is 1e-8, over some hundreds of steps.
    let books = run.summary.energy;
    assert!(books.error().abs() < 1e-5, "{books:?}");
    run.events.iter().any(|event| {
        let struck = match &event.kind {
            EventKind::Several { touches, .. } => touches.clone(),
            kind => kind.touch().into_iter().collect(),
        };
        struck.iter().any(|&k| touches[k].name.contains("on edge"))
    })
}

/// The rim of link 4 falls through the depth at which its parts still face those of the table within one step.
#[test]
fn a_rim_that_passes_an_edge_within_one_step_strikes_it() {
    assert!(falls(
        "0.03376378580980832 0.5995383489777656 0.25024190301932714 1.1844570164392743 0.17772136375511338 0.5259382214123904 0.29077903788061343",
        "-0.0998359126606495 0.4101221249556041 0.32376836034790946 -0.21005062537816915 0.41572800672751253 -0.3162999674963085 0.2335967223599843",
    ));
}

/// Link 3 slides on its round side over the edge until the edge is at the end of the side, and then on its rim.
#[test]
fn a_link_slides_from_its_round_side_onto_its_rim() {
    assert!(falls(
        "-0.04838735506223396 0.44979694228016215 -0.12366199736359915 1.129897224337399 -0.2516082813147116 0.5665988118212527 -0.2173178470235937",
        "-0.2691529633978871 -0.42343678847102845 -0.4159521126159217 0.016966004951329494 -0.48534260328233964 -0.4656059474065769 0.4215903893003219",
    ));
}

/// The force of a joint stop falls to zero so that its contact is chosen again with a force of rounding, at one time for ever.
#[test]
fn a_stop_whose_force_is_zero_again_at_once_opens() {
    falls(
        "-0.22538874928093344 0.23487823049662315 0.03780444850577051 1.0845349578705117 -0.19971084899532102 0.6329662375084928 -0.09508113300939948",
        "-0.25344490529300767 -0.34899276266204254 0.017950518004907212 -0.40044165515137375 -0.31378633036853165 -0.452897398558055 0.09466057280339757",
    );
}

/// An accumulation of impacts of a rim on an edge that ends as the rim leaves the edge: parts that no longer face each other have no
/// gap to be closed. The wrist was turned by three radians to close one, past its limit.
#[test]
fn a_rim_that_leaves_an_edge_while_its_impacts_accumulate_opens() {
    assert!(falls(
        "0.13670036571390315 0.6609897489771839 0.23071520500016424 0.7563384351660294 0.0036681123054894235 0.8931514614441006 0.23297786910613855",
        "0.21376717644485455 -0.3510770808765742 -0.28617460950675677 -0.08956534803562705 -0.05161138623378875 0.42292206722814885 -0.39712317533056596",
    ));
}

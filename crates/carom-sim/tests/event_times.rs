//! Events at the limits of time: at the first instants of a run and at its end.

use carom_contact::Obstacle;
use carom_sim::{Integrator, Simulation, Spring, Touch};
use carom_testing::build::{Part, X, Y, Z, ball as ball_of, brick, chain, falling_ball};
use carom_testing::scenes::{DOWN, among, floor, newton, on_floor, surface};
use nalgebra::{Isometry3, Vector3};

const RADIUS: f64 = 0.1;

/// A ball on a vertical slider over a floor, without gravity.
fn ball(integrator: Integrator) -> Simulation {
    Simulation { integrator, gravity: Vector3::zeros(), ..on_floor(falling_ball(), newton(0.5, 0.0)) }
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

/// A slider reaches its limit in the time that is left of the impacts of a ball, and that the run jumps over. With the speed u after its
/// last impact the ball's impacts accumulate 2u/(g(1 − e)) later.
#[test]
fn a_gap_that_closes_while_impacts_accumulate_is_not_missed() {
    let (g, e, height, zeno_time): (f64, f64, f64, f64) = (9.81, 0.5, 0.2, 1e-3);
    let ball = Part::slider("ball", "base", Z).weighing(2.0, [1.0; 3]).shaped(&ball_of(RADIUS));
    let side = Part::slider("side", "base", X).limits(-9.0, 0.0, 0.0).weighing(2.0, [1.0; 3]);
    let chain = chain(&[ball, side]);
    let touches = Touch::all(&chain, &[floor(newton(e, 0.0))], 1.0).unwrap().touches;
    let sim = Simulation { gravity: DOWN, zeno_time, ..Simulation::new(chain, touches) };

    let fall = (2.0 * height / g).sqrt();
    let rest = fall * (1.0 + 2.0 * e / (1.0 - e));
    let lefts = (1..).map(|k| 2.0 * e.powi(k) * fall / (1.0 - e));
    let left = lefts.into_iter().find(|left| *left < zeno_time).unwrap();
    let hit = rest - left / 2.0;
    let (q, end) = ([RADIUS + height, -hit], 1.0);
    let run = sim.run(&q, &[0.0, 1.0], end).unwrap();
    let limit = run.events.iter().find(|event| event.qd_plus[1] < 0.0).expect("the slider reaches its limit");
    assert!((limit.time - hit).abs() < 1e-12, "{} {hit}", limit.time);
    assert_eq!((limit.qd_minus[1], limit.qd_plus[1]), (1.0, -1.0));
    let last = &run.summary.last;
    assert!((last.q[0] - RADIUS).abs() < 1e-15 && (last.q[1] + end - hit).abs() < 1e-12, "{last:?}");
    // What is left of the impacts is that of hops by less than g·left²/8.
    assert!(run.summary.energy.error().abs() < 1e-12, "{:?}", run.summary.energy);
    // With the slider at rest nothing else ends the jump of a run that ends within it.
    let end = rest - 0.75 * left;
    assert_eq!(sim.run(&q, &[0.0; 2], end).unwrap().summary.last.time, end);
}

/// A block of two millimetres' half-width rocks from one corner to the other: the approach of the second corner is slow, 0.6 mm/s, since
/// the corners are near each other. A wheel beside it turns fast, so that this is slow for the robot, too. The impact leaves r ω,
/// r = 1 − 1.5 sin²α (G. W. Housner, Bull. Seismol. Soc. Am. 53, 1963).
#[test]
fn the_slow_approach_of_a_corner_beside_another_is_an_impact() {
    let (alpha, radius) = (0.02_f64, 0.1);
    let (b, h) = (radius * alpha.sin(), radius * alpha.cos());
    let mass = 2.0;
    let inertia = mass * radius * radius / 3.0;
    let parts = [
        Part::slider("a", "base", X).massless(),
        Part::slider("b", "a", Z).massless(),
        Part::hinge("block", "b", Y).weighing(mass, [inertia; 3]).shaped(&brick([2.0 * b, 0.1, 2.0 * h])),
        Part::hinge("wheel", "base", Z).weighing(1.0, [1.0; 3]),
    ];
    // Corners on the face of a body: contacts of one pair.
    let floor = Obstacle::cuboid(Isometry3::translation(0.0, 0.0, -0.1), Vector3::new(1.0, 1.0, 0.2)).unwrap();
    let sim = among(chain(&parts), &[surface("floor", floor, newton(0.0, 5.0))]);
    let sim = Simulation { tolerance: 1e-6, ..sim };
    let (s, c) = (0.7 * alpha).sin_cos();
    let start = [s * h - c * b, c * h + s * b, 0.7 * alpha, 0.0];
    let run = sim.run(&start, &[0.0, 0.0, 0.0, 100.0], 0.25).unwrap();
    let hit = run.events.iter().find(|event| event.qd_minus != event.qd_plus).expect("the other corner strikes");
    let (before, after) = (hit.qd_minus[2], hit.qd_plus[2]);
    assert!(before < -0.1, "{hit:?}");
    let ratio = 1.0 - 1.5 * alpha.sin().powi(2);
    assert!((after / before - ratio).abs() < 1e-9, "{} {ratio}", after / before);
    assert!(run.summary.energy.error().abs() < 1e-6 * run.summary.energy.start, "{:?}", run.summary.energy);
}

/// A mass that a force of 2000 N presses against a stop without loss, with dry friction of 20 N: each bounce takes the share 2 · 20/2020 of the
/// energy, and hundreds of them take less than a time step. Between impacts friction turns, and both are no crowd: the mass comes to rest by events.
#[test]
fn bounces_of_a_joint_with_dry_friction_on_a_stop_without_loss_end_by_events() {
    let slide = Part::slider("mass", "base", X).limits(0.0, 9.0, 0.0).joint("<dynamics friction='20'/>");
    let chain = chain(&[slide.weighing(1.0, [0.01; 3])]);
    let touches = Touch::all(&chain, &[], 1.0).unwrap().touches;
    let sim = Simulation { gravity: Vector3::new(-2000.0, 0.0, 0.0), ..Simulation::new(chain, touches) };
    let run = sim.run(&[1e-6], &[0.0], 0.1).unwrap();
    let kinds: Vec<&str> = run.events.iter().map(|event| event.kind.name()).collect();
    assert!(!kinds.contains(&"stepping") && kinds.iter().filter(|kind| **kind == "limit").count() > 100, "{kinds:?}");
    assert!(run.summary.last.q[0].abs() < 1e-12 && run.summary.last.qd[0] == 0.0, "{:?}", run.summary.last);
}

/// Squares of such numbers are no numbers: an oscillation of this size is integrated as any other, and is at rest to all digits.
#[test]
fn motions_that_have_died_out_go_on() {
    let slide = Part::slider("mass", "base", X).limits(-9.0, 9.0, 0.0);
    let chain = chain(&[slide.weighing(1.0, [0.01; 3])]);
    let spring = Spring { joint: chain.joints()[0].name.clone(), rest: 0.0, stiffness: 40.0, damping: 1.5 };
    for size in [1e-152, 1e-154, 1e-157, 1e-160, 1e-170, 1e-300] {
        let sim = Simulation { springs: vec![spring.clone()], ..Simulation::new(chain.clone(), Vec::new()) };
        let run = sim.run(&[size], &[0.0], 3.0).unwrap_or_else(|e| panic!("{size:e}: {e}"));
        assert!(
            run.summary.statistics.steps < 100 && run.summary.last.q[0].abs() <= size,
            "{size:e}: {:?}",
            run.summary
        );
    }
}

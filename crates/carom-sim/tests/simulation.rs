//! Event-driven simulation against closed forms.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_sim::{ContactMode, ContactRule, EventKind, Sampling, Seen, Simulation, StopReason, Touch};
use carom_testing::build::{O, Part, X, Y, Z, along, ball, chain, falling_ball, free, shape};
use carom_testing::files::robot;
use carom_testing::scenes::{DOWN, G, floor, half_space, kinds, level, rule, surface, towards_wall};
use nalgebra::Vector3;

fn simulation(chain: Chain, obstacle: Obstacle, contact: ContactRule) -> Simulation {
    let restitution = contact.law.restitution();
    let touches = Touch::all(&chain, &[surface("floor", obstacle, contact)], restitution).unwrap().touches;
    Simulation { gravity: DOWN, tolerance: 1e-10, max_events: 100_000, ..Simulation::new(chain, touches) }
}

/// A solid ball of 2 kg and 0.1 m that floats.
fn free_ball() -> Chain {
    free(2.0, [0.008; 3], &shape(&ball(0.1), O, O))
}

/// Apex heights e^{2k} h, and the end of the bouncing at t₁ (1+e)/(1−e).
#[test]
fn bouncing_ball_has_closed_form_heights_and_zeno_time() {
    for (e, zeno) in [(0.5, 1.354570923), (0.8, 4.063712769), (0.9, 8.578949179)] {
        let sim = simulation(falling_ball(), level(), rule("newton", e, 0.3));
        let run = sim.run(&[1.1], &[0.0], zeno + 1.0).unwrap();
        let impacts: Vec<_> = run.events.iter().filter(|e| matches!(e.kind, EventKind::Impact { .. })).collect();
        let first = (2.0 / G).sqrt();
        assert!((impacts[0].time - first).abs() < 1e-13 * first);
        // The impacts before the remaining bouncing time 2 v⁺/(g (1 − e)) falls below `zeno_time`, v⁺ = eᵏ √(2 g h).
        let resolved = (1..).find(|&k| 2.0 * e.powi(k) * (2.0 * G).sqrt() / (G * (1.0 - e)) < sim.zeno_time).unwrap();
        assert_eq!(impacts.len(), resolved as usize, "e {e}");
        for (k, impact) in impacts.iter().enumerate() {
            let apex = impact.qd_plus[0] * impact.qd_plus[0] / (2.0 * G);
            let exact = e.powi(2 * (k as i32 + 1));
            // Heights are differences of positions near 0.1 m, which are rounded to about 1e-17 m.
            let tolerance = 1e-9_f64.max(1e-16 / exact);
            assert!((apex / exact - 1.0).abs() < tolerance, "e {e}, bounce {k}: {apex} against {exact}");
        }
        let end = run.events.iter().find(|e| matches!(e.kind, EventKind::Zeno { .. })).unwrap();
        assert!((end.time - zeno).abs() < 1e-9, "e {e}: {} against {zeno}", end.time);
        // It then rests on the floor, and has lost its initial potential energy.
        assert_eq!(run.summary.mode.name(), "sticking");
        assert!((run.summary.last.q[0] - 0.1).abs() < 1e-12 && run.summary.last.qd[0].abs() < 1e-12);
        assert!((run.summary.energy.impacts - 2.0 * G).abs() < 1e-9);
        assert_eq!(run.summary.stop, StopReason::Duration);
    }
}

/// Impacts accumulate where bounces are lower than 1e-13 m, which rounding hides, before their time is short; and where hundreds of them
/// lie within one time step. With e = 0.99, 450 impacts lie within the last millisecond.
#[test]
fn bounces_end_where_rounding_begins() {
    for (e, tolerance) in [(0.9, 1e-12), (0.99, 1e-9)] {
        let zeno_time = Simulation::zeno_time_for(tolerance);
        let sim = simulation(falling_ball(), level(), rule("newton", e, 0.0));
        let sim = Simulation { tolerance, zeno_time, max_events: 5000, ..sim };
        let h = 0.01;
        let zeno = (2.0 * h / G).sqrt() * (1.0 + e) / (1.0 - e);
        let run = sim.run(&[0.1 + h], &[0.0], zeno + 0.1).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0, "e {e}");
        let ends: Vec<f64> =
            run.events.iter().filter(|e| matches!(e.kind, EventKind::Zeno { .. })).map(|e| e.time).collect();
        assert_eq!(ends.len(), 1, "e {e}: {ends:?}");
        // The bounces that are left out last for 2u/(g (1 − e)), with a height u²/2g of 1e-13 m.
        let left = 2.0 * (2e-13 * G).sqrt() / (G * (1.0 - e));
        assert!((ends[0] - zeno).abs() < left, "e {e}: {} for {zeno}", ends[0]);
        assert!(run.summary.last.qd[0] == 0.0 && (run.summary.last.q[0] - 0.1).abs() < 1e-12);
    }
}

/// No event is lost or reported twice in ten thousand bounces with e = 1, one every 2√(2h/g).
#[test]
fn ten_thousand_elastic_bounces_are_each_reported_once() {
    let mut sim = simulation(falling_ball(), level(), rule("newton", 1.0, 0.0));
    sim.max_events = 10_000;
    let h = 0.02_f64;
    let run = sim.run(&[0.1 + h], &[0.0], 1e4).unwrap();
    assert_eq!((run.summary.stop, run.events.len()), (StopReason::Events, 10_000));
    assert!(run.events.iter().all(|e| matches!(e.kind, EventKind::Impact { .. })));
    let half = (2.0 * h / G).sqrt();
    let last = half * (2.0 * 9_999.0 + 1.0);
    // Each bounce rounds position and time; the errors accumulate like a random walk, and the period depends on the energy.
    assert!((run.summary.last.time / last - 1.0).abs() < 1e-8, "{} against {last}", run.summary.last.time);
    assert!((run.summary.energy.end / run.summary.energy.start - 1.0).abs() < 1e-8);
}

/// A ball thrown obliquely: without friction its horizontal velocity stays constant through all bounces.
#[test]
fn free_ball_keeps_its_horizontal_velocity_without_friction() {
    let sim = simulation(free_ball(), level(), rule("frictionless", 0.7, 0.0));
    let q = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0];
    let qd = [0.3, -0.2, 0.0, 0.0, 0.0, 0.0];
    let run = sim.run(&q, &qd, 4.0).unwrap();
    assert!(run.events.iter().any(|e| matches!(e.kind, EventKind::Zeno { .. })));
    assert!(
        (run.summary.last.q[0] - 1.2).abs() < 1e-11 && (run.summary.last.q[1] + 0.8).abs() < 1e-11,
        "{:?}",
        run.summary.last
    );
    assert!((run.summary.last.q[2] - 0.1).abs() < 1e-11);
    assert_eq!(run.summary.mode, ContactMode::Sliding { touch: 0 });
}

/// A solid ball that starts with slip: Coulomb friction μ m g decelerates it and accelerates its rotation until it rolls at
/// 5/7 of its initial speed, after t = 2 v/(7 μ g).
#[test]
fn sliding_ball_begins_to_roll_at_the_closed_form_time() {
    let sim = simulation(free_ball(), level(), rule("frictionless", 0.0, 0.2));
    let (q, v) = ([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], 1.4);
    let run = sim.run(&q, &[v, 0.0, 0.0, 0.0, 0.0, 0.0], 2.0).unwrap();
    let rolls =
        run.events.iter().find(|e| matches!(e.kind, EventKind::Mode { mode: ContactMode::Sticking { .. } })).unwrap();
    let time = 2.0 * v / (7.0 * 0.2 * G);
    assert!((rolls.time - time).abs() < 1e-7, "{} against {time}", rolls.time);
    let speed = |m: &carom_sim::Moment| {
        // World velocity of the centre: child axes turn with the ball.
        let kin_q = &m.q;
        let mut rate = vec![0.0; 7];
        sim.chain.q_rate_into(kin_q, &m.qd, &mut rate);
        rate[0]
    };
    assert!((speed(&run.summary.last) - v * 5.0 / 7.0).abs() < 1e-7, "{}", speed(&run.summary.last));
    assert!(run.summary.last.q[2] - 0.1 < 1e-10);
}

/// u_n⁺ = −e u_n⁻ at approach speeds from 1 mm/s to 3 m/s: there is no velocity threshold.
#[test]
fn restitution_is_exact_at_every_approach_speed() {
    for speed in [0.001, 0.01, 0.2, 3.0] {
        for e in [0.0, 0.35, 1.0] {
            let wall = half_space([0.6464, 0.0, 0.0], -Vector3::x());
            let sim = simulation(robot("planar2"), wall, rule("energetic", e, 0.0));
            let sim = Simulation { gravity: Vector3::zeros(), ..sim };
            let (q, qd) = towards_wall(&sim.chain, speed);
            let run = sim.run(&q, &qd, 0.05 / speed).unwrap();
            let EventKind::Impact { hit, .. } = &run.events[0].kind else { panic!("{:?}", run.events[0]) };
            assert!(((hit.u_plus.x / hit.u_minus.x) + e).abs() < 1e-12, "{speed} {e}");
            // The jump of all joint velocities equals that of a single impact at the pose of the event.
            let law = carom_impact::Frictionless { restitution: e };
            let tip = sim.chain.frame("tip").unwrap();
            let event = &run.events[0];
            use carom_sim::Impacts;
            let exact =
                sim.chain.impact(&event.q, &event.qd_minus).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law).unwrap();
            for (a, b) in event.qd_plus.iter().zip(&exact.qd_plus) {
                // The simulated contact point is offset by the radius of the tip's ball.
                assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} {b}");
            }
            // The tip is on the wall to rounding.
            let mut ws = sim.chain.workspace();
            let x = ws.update(&sim.chain, &event.q).unwrap().position(sim.chain.point(tip, Vector3::zeros())).x;
            assert!((x + 1e-6 - 0.6464).abs() < 1e-14, "{x}");
        }
    }
}

/// A pendulum that hits a wall at its lowest point: one impact every half period, each e times slower, without
/// accumulation.
#[test]
fn pendulum_impacts_without_accumulation_are_all_resolved() {
    let bob = Part { com: [0.0, 0.0, -1.0], ..Part::hinge("bob", "base", Y) };
    let bob = bob.weighing(1.0, [0.1; 3]).with(shape(&ball(0.05), [0.0, 0.0, -1.0], O));
    let wall = half_space([-0.05, 0.0, 0.0], Vector3::x());
    let sim = simulation(chain(&[bob]), wall, rule("newton", 0.5, 0.0));
    // Small swings: 1e-3 rad.
    let run = sim.run(&[-1e-3], &[0.0], 30.0).unwrap();
    assert!(run.events.iter().all(|e| matches!(e.kind, EventKind::Impact { .. })), "{:?}", run.events.last());
    let half = std::f64::consts::PI / (G / 1.1_f64).sqrt();
    for pair in run.events.windows(2) {
        assert!((pair[1].time - pair[0].time - half).abs() < 1e-6 * half);
        assert!((pair[1].qd_plus[0] / pair[0].qd_plus[0] - 0.5).abs() < 1e-9);
    }
    // A quarter period to the first, then one every half period.
    assert_eq!(run.events.len(), 1 + ((30.0 - half / 2.0) / half) as usize);
}

/// A bead that slides down a smooth sphere from θ₀ with speed v₀ leaves it at cos θ = ⅔ (cos θ₀ + v₀²/2gR).
#[test]
fn bead_leaves_a_smooth_sphere_at_the_closed_form_angle() {
    let bead = along(&[X, Z], 0.3, [1.0; 3], &ball(0.1));
    let dome = Obstacle::sphere(Vector3::zeros(), 0.9).unwrap();
    let sim = simulation(bead, dome, rule("newton", 0.3, 0.0));
    let (theta, v) = (0.2_f64, 0.5);
    let (q, qd) = ([theta.sin(), theta.cos()], [v * theta.cos(), -v * theta.sin()]);
    let run = sim.run(&q, &qd, 1.2).unwrap();
    let leaves = run.events.iter().find(|e| matches!(e.kind, EventKind::LiftOff { .. })).unwrap();
    let height = 2.0 / 3.0 * (theta.cos() + v * v / (2.0 * G));
    assert!((leaves.q[1] - height).abs() < 1e-8, "{} against {height}", leaves.q[1]);
    // The bead is on the sphere until then, and its speed satisfies the condition for leaving it.
    assert!((leaves.q[0].hypot(leaves.q[1]) - 1.0).abs() < 1e-11);
    let speed = leaves.qd_plus[0].hypot(leaves.qd_plus[1]);
    assert!((speed * speed - G * height).abs() < 1e-8);
    assert_eq!(run.summary.mode, ContactMode::Free);
    assert!((run.summary.energy.end - run.summary.energy.start).abs() < 1e-9);
}

/// A falling chain without impacts conserves its energy over a minute and thousands of steps.
#[test]
fn energy_is_conserved_without_impacts() {
    let chain = carom_chain::uniform_chain(2, 2.0, 2.0).unwrap();
    let far = half_space([0.0, 0.0, -100.0], Vector3::z());
    let mut sim = simulation(chain, far, rule("frictionless", 0.5, 0.0));
    sim.gravity = Vector3::new(0.0, -G, 0.0);
    sim.tolerance = 1e-12;
    let mut moments = 0;
    let sampling = Sampling { every: Some(0.004), ..Sampling::default() };
    let run = sim.stream(&[1.0, 0.5], &[0.0, 0.0], 60.0, sampling, &mut |seen| {
        moments += usize::from(matches!(seen, Seen::Moment(_)));
    });
    let run = run.unwrap();
    assert_eq!(moments, 15_001);
    assert!((run.energy.end - run.energy.start).abs() < 1e-8, "{:?}", run.energy);
    assert!(run.statistics.steps > 500 && run.events == 0);
}

/// Multiples of the interval that exceed the duration by rounding, such as 3 × 0.1 s, are samples at its end.
#[test]
fn the_last_sample_of_a_run_is_at_its_end() {
    let chain = carom_chain::uniform_chain(2, 2.0, 2.0).unwrap();
    let far = half_space([0.0, 0.0, -100.0], Vector3::z());
    let sim = simulation(chain, far, rule("frictionless", 0.5, 0.0));
    for (duration, every, count) in [(0.3, 0.1, 4), (0.7, 0.1, 8), (1.2, 0.1, 13), (0.35, 2e-4, 1751), (0.35, 0.1, 4)] {
        let mut times = Vec::new();
        let sampling = Sampling { every: Some(every), ..Sampling::default() };
        sim.stream(&[1.0, 0.5], &[0.0, 0.0], duration, sampling, &mut |seen| {
            if let Seen::Moment(moment) = seen {
                times.push(moment.time);
            }
        })
        .unwrap();
        let last = every * f64::from(count - 1);
        assert_eq!(times.len(), count as usize, "{every} s of {duration} s");
        assert!(times.iter().all(|time| *time <= duration) && (times[times.len() - 1] - last).abs() < 1e-15);
    }
}

/// Reaching a joint limit is an impact: the velocities of all joints jump.
#[test]
fn reaching_a_joint_limit_is_an_impact() {
    let arm = |name: &str, parent: &str| Part {
        com: [0.5, 0.0, 0.0],
        ..Part::hinge(name, parent, Z).weighing(1.0, [0.01, 0.1, 0.1])
    };
    let second = Part { joint: "revolute", ..arm("two", "one").at(X).limits(-1.0, 1.0, 0.0) };
    let mut sim = simulation(chain(&[arm("one", "base"), second]), level(), rule("newton", 0.6, 0.0));
    sim.gravity = Vector3::zeros();
    let run = sim.run(&[0.0, 0.0], &[0.1, 2.0], 2.0).unwrap();
    let event = &run.events[0];
    assert!(matches!(&event.kind, EventKind::Limit { joint, .. } if joint == "jtwo"), "{:?}", event.kind);
    assert!((event.q[1] - 1.0).abs() < 1e-13);
    assert!((event.qd_plus[1] + 0.6 * event.qd_minus[1]).abs() < 1e-13);
    // −(1+e) q̇ᵢ M⁻¹eᵢ/(M⁻¹)ᵢᵢ: the momentum of the first joint is untouched.
    let mut ws = sim.chain.workspace();
    let m = ws.update(&sim.chain, &event.q).unwrap().mass_matrix();
    let momentum = |v: &[f64]| m[(0, 0)] * v[0] + m[(0, 1)] * v[1];
    assert!((momentum(&event.qd_plus) - momentum(&event.qd_minus)).abs() < 1e-13);
}

#[test]
fn invalid_simulations_are_refused_with_the_reason() {
    let sim = simulation(falling_ball(), level(), rule("newton", 0.5, 0.0));
    let said = |duration: f64| sim.run(&[1.0], &[0.0], duration).unwrap_err().to_string();
    assert_eq!(said(-1.0), "duration is -1: it must be positive and finite");
    // A robot without collision shapes has no touches.
    let arm = carom_chain::uniform_chain(2, 2.0, 2.0).unwrap();
    assert!(
        Touch::all(&arm, &[floor(rule("newton", 0.5, 0.0))], 0.0).unwrap().touches.is_empty(),
        "the chain has no collision shapes"
    );
}

/// A ball flies past a sphere; its path overlaps the sphere by 1 µm or less, for a fraction of an integration step.
#[test]
fn a_contact_much_shorter_than_a_step_is_detected() {
    for (depth, hits) in [(1e-6, true), (1e-9, true), (-1e-9, false)] {
        let post = Obstacle::sphere(Vector3::zeros(), 0.5).unwrap();
        let sim = Simulation { gravity: Vector3::zeros(), ..simulation(free_ball(), post, rule("newton", 0.5, 0.0)) };
        let start = [-2.0, 0.6 - depth, 0.0, 0.0, 0.0, 0.0, 1.0];
        let run = sim.run(&start, &[40.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.1).unwrap();
        assert_eq!(kinds(&run), if hits { vec!["impact"] } else { Vec::new() }, "{depth}");
        if hits {
            // The contact begins where (0.6 − depth)² + x² = 0.6².
            let (x, found) = (-(2.0 * 0.6 * depth - depth * depth).sqrt(), run.events[0].q[0]);
            assert!((found - x).abs() < 1e-7, "{found} against {x}");
        }
    }
}

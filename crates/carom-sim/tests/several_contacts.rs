//! Simulations with several contacts at the same time.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::ChatterjeeRuina;
use carom_sim::{ContactRule, EventKind, Simulation};
use carom_testing::build::{O, Part, X, Y, Z, along, ball, chain, floating_box, in_plane, shape};
use carom_testing::scenes::{G, among, half_space, newton, on_floor, rule, surface};
use nalgebra::{Matrix3, Rotation3, Vector3};

fn slope(angle: f64) -> Obstacle {
    half_space([0.0; 3], [angle.sin(), 0.0, angle.cos()])
}

fn simulation(chain: Chain, obstacle: Obstacle, law: &str, restitution: f64, friction: f64) -> Simulation {
    let floor = surface("floor", obstacle, rule(law, restitution, friction));
    Simulation { tolerance: 1e-11, ..among(chain, &[floor]) }
}

/// B9: a uniform rod dropped flat on both ends rebounds without rotation, with e times its speed.
#[test]
fn a_rod_dropped_flat_rebounds_without_rotation() {
    let ends = r#"<collision><origin xyz="0.5 0 0"/><geometry><sphere radius="0.01"/></geometry></collision>
        <collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="0.01"/></geometry></collision>"#;
    for e in [0.0, 0.5, 1.0] {
        let sim = simulation(in_plane(1.0, 1.0 / 12.0, ends), slope(0.0), "newton", e, 0.0);
        let run = sim.run(&[0.0, 0.51, 0.0], &[0.0, 0.0, 0.0], 0.4).unwrap();
        let hit = &run.events[0];
        assert!(matches!(&hit.kind, EventKind::Several { touches, .. } if touches.len() == 2), "{hit:?}");
        assert_eq!(hit.impulses.len(), 2);
        assert!((hit.time - (2.0 * 0.5 / G).sqrt()).abs() < 1e-11);
        assert!((hit.qd_plus[1] + e * hit.qd_minus[1]).abs() < 1e-11 && hit.qd_plus[2].abs() < 1e-10, "{hit:?}");
    }
}

/// A box at rest on a level floor keeps its pose to 1e-9.
#[test]
fn a_box_at_rest_does_not_creep_or_sink() {
    let sim = simulation(floating_box([0.3, 0.2, 0.1], 2.0), slope(0.0), "energetic", 0.5, 0.4);
    let start = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
    let run = sim.run(&start, &[0.0; 6], 5.0).unwrap();
    assert!(run.events.iter().any(|e| e.kind.name() == "rest"), "{:?}", run.events);
    for (a, b) in run.summary.last.q.iter().zip(&start) {
        assert!((a - b).abs() < 1e-9, "{:?}", run.summary.last.q);
    }
}

/// A block (a ball that cannot rotate) and a box on a slope stick below the friction angle, and slide above it with
/// g (sin θ − μ cos θ).
#[test]
fn a_body_on_a_slope_sticks_or_slides_with_coulomb_acceleration() {
    let mu = 0.3_f64;
    for (angle, slides) in [(mu.atan() - 0.01, false), (mu.atan() + 0.1, true)] {
        let sim = simulation(along(&[X, Z], 1.0, [1.0; 3], &ball(0.1)), slope(angle), "newton", 0.0, mu);
        let (s, c) = angle.sin_cos();
        let run = sim.run(&[0.1 * s, 0.1 * c], &[0.0, 0.0], 1.0).unwrap();
        let way = (run.summary.last.q[0] - 0.1 * s).hypot(run.summary.last.q[1] - 0.1 * c);
        let expected = if slides { 0.5 * G * (s - mu * c) } else { 0.0 };
        assert!((way - expected).abs() < 1e-9, "{way} against {expected}");
        assert_eq!(run.summary.mode.name(), if slides { "sliding" } else { "sticking" });
    }
    for (angle, slides) in [(mu.atan() - 0.02, false), (mu.atan() + 0.1, true)] {
        let sim = simulation(floating_box([0.3, 0.2, 0.1], 2.0), slope(angle), "newton", 0.0, mu);
        let (s, c) = angle.sin_cos();
        let half = angle / 2.0;
        let start = [0.05 * s, 0.0, 0.05 * c, 0.0, half.sin(), 0.0, half.cos()];
        let run = sim.run(&start, &[0.0; 6], 1.0).unwrap();
        let last = &run.summary.last;
        let way = (last.q[0] - start[0]).hypot(last.q[2] - start[2]);
        let expected = if slides { 0.5 * G * (s - mu * c) } else { 0.0 };
        // The midpoint rule is exact for constant acceleration.
        assert!((way - expected).abs() < 1e-7, "{way} against {expected}");
        assert!(last.qd[3..].iter().all(|w| w.abs() < 1e-8), "it does not turn: {:?}", last.qd);
    }
}

/// A box thrown on the floor loses energy at every impact and comes to rest on one of its faces.
#[test]
fn a_tumbling_box_comes_to_rest_on_a_face() {
    let size = [0.1, 0.07, 0.05];
    let mut rng = fastrand::Rng::with_seed(3);
    let mut impacts = 0;
    for case in 0..12 {
        let (e, mu) = ([0.0, 0.3, 0.6][case % 3], [0.1, 0.3, 0.8][case / 4]);
        let sim = simulation(floating_box(size, 0.4), slope(0.0), "poisson", e, mu);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(3.0 * rng.f64(), 3.0 * rng.f64(), 3.0 * rng.f64());
        let q = [0.0, 0.0, 0.2 + 0.2 * rng.f64(), turn.i, turn.j, turn.k, turn.w];
        let qd: Vec<f64> = (0..6).map(|k| (rng.f64() - 0.5) * if k < 3 { 1.0 } else { 10.0 }).collect();
        let run = sim.run(&q, &qd, 6.0).unwrap_or_else(|error| panic!("case {case}: {error}"));
        let last = &run.summary.last;
        let names = || run.events.iter().map(|e| (e.time, e.kind.name())).collect::<Vec<_>>();
        assert!(run.events.iter().any(|e| e.kind.name() == "rest"), "case {case}: {:?}, {:?}", last, names());
        let heights = size.map(|side| (last.q[2] - side / 2.0).abs());
        assert!(heights.iter().any(|gap| *gap < 1e-6), "case {case}: centre at {}", last.q[2]);
        for event in &run.events {
            if let EventKind::Impact { hit, .. } = &event.kind {
                assert!(hit.energy_after <= hit.energy_before * (1.0 + 1e-12));
                impacts += 1;
            }
        }
        // Without restitution the problem of several contacts has a solution, and it is found. With restitution and friction
        // there may be none for redundant corners: the residual then stays above the tolerance.
        let allowed = if e == 0.0 { 1e-9 } else { 1e-4 };
        assert!(run.summary.statistics.worst_residual < allowed, "case {case}: {:?}", run.summary.statistics);
    }
    assert!(impacts >= 12, "{impacts} single impacts in 12 runs");
}

/// Painlevé's rod, whose lower end slides on the floor. In one direction the acceleration has no solution with a contact that
/// slides on: an impact without collision stops the slip, with the impulse of `Law::branches` (0.4375, 0.3248 N s for a rod
/// of 1 kg and 1 m at 60° with 1 m/s). In the other direction it slides, until it approaches a jam as well.
#[test]
fn a_jammed_rod_has_an_impact_without_collision() {
    let end = r#"<collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="1e-9"/></geometry></collision>
        <collision><origin xyz="0.5 0 0"/><geometry><sphere radius="1e-9"/></geometry></collision>"#;
    let sim = simulation(in_plane(1.0, 1.0 / 12.0, end), slope(0.0), "energetic", 0.0, 1.5);
    let theta = 60_f64.to_radians();
    let mut jammed = 0;
    for side in [1.0, -1.0] {
        let run = sim.run(&[0.0, 0.5 * theta.sin() + 1e-9, -theta], &[side, 0.0, 0.0], 2.0).unwrap();
        let names: Vec<_> = run.events.iter().map(|event| (event.time, event.kind.name())).collect();
        if let EventKind::Impact { hit, .. } = &run.events[0].kind {
            assert_eq!(run.events[0].time, 0.0);
            let expected = Vector3::new(-0.4375 * side, 0.0, 0.32475953);
            assert!((hit.impulse - expected).norm() < 1e-7, "{:?}", hit.impulse);
            assert_eq!(run.summary.statistics.contact_steps, 0, "{side}: {names:?}");
            jammed += 1;
        } else {
            assert!(names[0] == (0.0, "sliding") && names[1].0 > 0.05, "{side}: {names:?}");
        }
        for k in 0..=400 {
            let moment = run.at(&sim.chain, f64::from(k) * 0.005);
            let low = moment.q[1] - 0.5 * moment.q[2].sin().abs() - 1e-9;
            // A time step leaves an overlap of up to 2 g h², exact events leave none.
            let allowed = if run.summary.statistics.contact_steps > 0 { 3.0 * G * 1e-6 } else { 1e-9 };
            assert!(low > -allowed, "{low} at {}", moment.time);
        }
        assert!(run.summary.energy.end < run.summary.energy.start + 1e-9);
    }
    assert_eq!(jammed, 1);
}

/// The same jam under laws that do not stop it at once. The law without friction has no impulse there: Coulomb's friction along the impulse
/// (Routh) takes its place. Chatterjee and Ruina's law with a negative tangential restitution leaves a share of the slip, and jams again until
/// none is left. In both the impulses add up to the one that stops the slip.
#[test]
fn a_jam_that_the_law_does_not_end_ends_by_coulombs_friction() {
    let shapes = [-0.5, 0.5].map(|x| shape(&ball(1e-9), [x, 0.0, 0.0], O)).concat();
    let share: f64 = 0.66;
    let returning = ChatterjeeRuina { restitution: 0.0, tangential_restitution: -share, friction: 1.5 };
    let theta = 60_f64.to_radians();
    for (contact, once) in [(rule("frictionless", 0.0, 1.5), true), (ContactRule::new(returning), false)] {
        let floor = surface("floor", slope(0.0), contact);
        let sim = Simulation { tolerance: 1e-11, ..among(in_plane(1.0, 1.0 / 12.0, &shapes), &[floor]) };
        let run = sim.run(&[0.0, 0.5 * theta.sin() + 1e-9, -theta], &[-1.0, 0.0, 0.0], 0.01).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0, "{:?}", run.events);
        let hits: Vec<_> = run.events.iter().filter(|event| !event.impulses.is_empty()).collect();
        assert!(hits.iter().all(|event| event.time == 0.0) && (hits.len() == 1) == once, "{}", hits.len());
        let sum: Vector3<f64> = hits.iter().flat_map(|event| &event.impulses).map(|one| one.impulse).sum();
        // H⁻¹ (1, 0) of the slip; what is left of it in the end counts as none.
        let left = if once { 0.0 } else { share.powi(hits.len() as i32) };
        let stop = Vector3::new(7.0 / 16.0, 0.0, 3.0 * 3.0_f64.sqrt() / 16.0) * (1.0 - left);
        assert!(left < 1e-6 && (sum - stop).norm() < 1e-8, "{sum:?} for {stop:?} by {}", hits.len());
        for (first, second) in hits.iter().zip(hits.iter().skip(1)) {
            let [first, second] = [first, second].map(|event| event.impulses[0].impulse);
            assert!((second - first * share).norm() < 1e-6 * first.norm(), "{first:?} {second:?}");
        }
    }
}

/// A ball on three sliders that are not at right angles: K = A M⁻¹ Aᵀ with the axes as the columns of A. Its slip begins at an angle to
/// K e₃ that is a little too wide for friction to jam, C − μ h·u > 0. On one side friction turns it until it does: at once the impulse
/// K⁻¹(0 − u) stops the ball. On the other side friction turns it away, and it slides on.
#[test]
fn slip_that_turns_into_a_jam_is_stopped_by_an_impact() {
    let axes =
        [[-0.52, 0.76, -0.38], [0.69, 0.72, 0.03], [0.83, 0.29, 0.47]].map(|axis| Vector3::from(axis).normalize());
    let (masses, mu, slip) = ([0.14, 1.03, 0.08], 1.0, 0.01);
    let a = Matrix3::from_columns(&axes);
    // What a slider moves is beyond it.
    let m = Matrix3::from_fn(|i, j| masses[i.max(j)..].iter().sum::<f64>() * axes[i].dot(&axes[j]));
    let k = a * m.try_inverse().unwrap() * a.transpose();
    let h = Vector3::new(k[(0, 2)], k[(1, 2)], 0.0);
    let jam = (k[(2, 2)] / (mu * h.norm())).acos();
    let names = ["base", "a", "b", "c"];
    let parts = [0, 1, 2].map(|i| {
        let part = Part::slider(names[i + 1], names[i], axes[i].into()).weighing(masses[i], [1.0; 3]);
        if i == 2 { part.shaped(&ball(0.1)) } else { part }
    });
    let sim = simulation(chain(&parts), half_space([0.0, 0.0, -0.1], Z), "energetic", 0.0, mu);
    for (side, beyond) in [(1.0, 1e-6), (1.0, 3e-5), (-1.0, 1e-6), (-1.0, 3e-5)] {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), side * (jam + beyond));
        let u = turn * h.normalize() * slip;
        let qd = a.try_inverse().unwrap() * u;
        let run = sim.run(&[0.0; 3], qd.as_slice(), 0.01).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0, "{side} {beyond}: {:?}", run.events);
        let impulse: Vector3<f64> = run.events.iter().flat_map(|event| &event.impulses).map(|one| one.impulse).sum();
        let stop = -k.try_inverse().unwrap() * u;
        // The approach from which the limit is taken, 1e-9 of the scene's speed, is 1e-7 of the slip.
        let error = if side < 0.0 { (impulse - stop).norm() } else { 1e-3 * impulse.norm() };
        assert!(error < 1e-6 * stop.norm(), "{side} {beyond}: {impulse:?} for {stop:?}");
    }
}

/// The same rod beside a ball at rest on the same floor. Its lower end slides at 1 m/s; in one direction no
/// acceleration is consistent, and the impulse that stops the end follows: with its inverse inertia H = [13/4, ∓(3/4)√3; ., 7/4] 1/kg
/// it is −H⁻¹(±1, 0) = (∓7/16, (3/16)√3) N s, inside the cone of μ = 1.5. The ball is not moved.
#[test]
fn a_rod_jams_beside_a_contact_at_rest() {
    let parts = [
        Part::slider("a", "base", X).massless(),
        Part::slider("b", "a", Z).massless(),
        Part::hinge("rod", "b", Y).weighing(1.0, [1.0 / 12.0; 3]).with(shape(&ball(1e-9), [0.5, 0.0, 0.0], O)),
        Part::slider("ball", "base", Z).weighing(1.0, [1.0; 3]).shaped(&ball(0.1)),
    ];
    let sim = on_floor(chain(&parts), newton(0.0, 1.5));
    let (pitch, height) = (60_f64.to_radians(), 0.5 * 60_f64.to_radians().sin() + 1e-9);
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

/// The error of time stepping is of first order in the step, in the mean over many starts.
#[test]
fn time_stepping_converges_to_the_event_driven_solution() {
    let disc = in_plane(1.0, 0.1, r#"<collision><geometry><sphere radius="0.1"/></geometry></collision>"#);
    let exact = simulation(disc, slope(0.0), "newton", 0.5, 0.0);
    let error = |step: f64| {
        let steps = Simulation { stepping: true, contact_step: step, ..exact.clone() };
        // The error depends on the phase of the impact within a step, so it is averaged over 40 starts.
        let starts = (0..40).map(|k| 0.3 + 0.001_317 * f64::from(k));
        let misses = starts.map(|height| {
            let q = [0.0, 0.1 + height, 0.0];
            let [found, expected] = [&steps, &exact].map(|sim| sim.run(&q, &[0.0; 3], 0.4).unwrap().summary.last.q[1]);
            (found - expected).abs()
        });
        misses.sum::<f64>() / 40.0
    };
    let (coarse, fine) = (error(1e-2), error(1e-3));
    let order = (coarse / fine).log10();
    assert!((0.7..1.4).contains(&order), "{coarse} {fine}: order {order}");
}

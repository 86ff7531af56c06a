//! Mechanisms with closed loops in motion: closed forms, conservation laws, the same robot as a tree.

use carom_chain::Chain;
use carom_sim::{Loop, LoopFrame, LoopJoint, Moment, Sampling, Seen, SimError, Simulation, Spring, Summary};
use carom_testing::mechanisms::{Cut, FourBar, Rod, n_four_bar, pin, turned};
use carom_testing::scenes::G;
use nalgebra::Vector3;
use std::f64::consts::PI;

fn simulation(chain: Chain, loops: Vec<Loop>) -> Simulation {
    let gravity = Vector3::new(0.0, -G, 0.0);
    Simulation { loops, gravity, tolerance: 1e-11, ..Simulation::new(chain, Vec::new()) }
}

/// The states at multiples of `every`, and the summary.
fn sampled(sim: &Simulation, (q, qd): (&[f64], &[f64]), duration: f64, every: f64) -> (Vec<Moment>, Summary) {
    let mut moments = Vec::new();
    let sampling = Sampling { every: Some(every), ..Sampling::default() };
    let summary = sim.stream(q, qd, duration, sampling, &mut |seen| {
        if let Seen::Moment(moment) = seen {
            moments.push(moment.clone());
        }
    });
    (moments, summary.unwrap())
}

fn energy(sim: &Simulation, moment: &Moment) -> f64 {
    let mut workspace = sim.chain.workspace();
    let mut kin = workspace.update(&sim.chain, &moment.q).unwrap();
    kin.kinetic_energy(&moment.qd).unwrap() + kin.potential_energy(sim.gravity)
}

/// The curve of a point of the coupler of a four-bar linkage, a sextic (Roberts 1875; Hartenberg & Denavit, *Kinematic
/// Synthesis of Linkages*, 1964, section 6-6): zero on the curve.
fn sextic(bar: &FourBar, [u, v]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    let FourBar { crank: a, coupler: b, rocker: c, ground: d } = *bar;
    let (m, n) = (u.hypot(v), (b - u).hypot(v));
    // The angle at the point from the crank's end to the rocker's.
    let angle = (-v).atan2(b - u) - (-v).atan2(-u);
    let (sine, cosine) = angle.sin_cos();
    let (to_a, to_b) = (x * x + y * y + m * m - a * a, (x - d).powi(2) + y * y + n * n - c * c);
    let one = n * ((x - d) * cosine + y * sine) * to_a - m * x * to_b;
    let other = n * ((x - d) * sine - y * cosine) * to_a + m * y * to_b;
    let last = 2.0 * m * n * (sine * (x * (x - d) + y * y) - d * y * cosine);
    one * one + other * other - last * last
}

/// A crank-rocker swings and turns under gravity: at every sample the angles are those of Freudenstein's equation, the
/// angular velocities those of its derivative, a point of the coupler is on its curve, and the energy is that of the start.
/// The plane and space (where five of six rows of a pin depend on others), pin and point, both ways to cut the loop.
#[test]
fn a_crank_rocker_moves_by_freudensteins_equation() {
    let mut rng = fastrand::Rng::with_seed(19);
    for k in 0..3 {
        let bar = FourBar::random(&mut rng);
        for (cut, joint) in [(Cut::Joint, pin()), (Cut::Joint, LoopJoint::Point), (Cut::Foot, pin())] {
            for planar in [true, false] {
                let chain = bar.chain(cut, Default::default(), [""; 3]);
                let sim = Simulation { planar, ..simulation(chain, vec![bar.closure(cut, joint)]) };
                // The first turns slowly enough to swing back, the others turn around.
                let [q, qd] = bar.state(cut, 0.7, [1.0, 9.0, -12.0][k]);
                let (moments, summary) = sampled(&sim, (&q, &qd), 3.0, 0.01);
                assert_eq!(moments.len(), 301);
                let start = energy(&sim, &moments[0]);
                let mut workspace = sim.chain.workspace();
                for moment in &moments {
                    let [wanted, rates] = bar.state(cut, moment.q[0], moment.qd[0]);
                    // Between its steps the integrator's polynomial has an error of some hundred tolerances.
                    for (found, wanted) in moment.q.iter().zip(wanted) {
                        assert!(turned(*found, wanted).abs() < 1e-8, "{bar:?} {cut:?} {moment:?} {wanted}");
                    }
                    for (found, wanted) in moment.qd.iter().zip(rates) {
                        assert!((found - wanted).abs() < 1e-7, "{bar:?} {cut:?} {moment:?} {wanted}");
                    }
                    let kin = workspace.update(&sim.chain, &moment.q).unwrap();
                    let (u, v) = (0.6 * bar.coupler, 0.3);
                    let point = sim.chain.point(sim.chain.frame("coupler").unwrap(), Vector3::new(u, v, 0.0));
                    let at = kin.position(point);
                    let off = sextic(&bar, [u, v], [at.x, at.y]);
                    assert!(off.abs() < 1e-8, "{off} off the coupler curve");
                    let drift = energy(&sim, moment) - start;
                    assert!(drift.abs() < 1e-7 * start.abs().max(1.0), "{drift} J");
                }
                // At the end the loop is closed by projection, to rounding.
                let last = &summary.last;
                let [wanted, rates] = bar.state(cut, last.q[0], last.qd[0]);
                for k in 0..3 {
                    assert!(turned(last.q[k], wanted[k]).abs() < 1e-11, "{last:?} {wanted:?}");
                    assert!((last.qd[k] - rates[k]).abs() < 1e-10, "{last:?} {rates:?}");
                }
            }
        }
    }
}

/// A crank-rocker turns for `duration` seconds, at 7 revolutions per second: afterwards its loop is closed, its angles and angular
/// velocities are those of Freudenstein's equation, and its energy is the one of the start to `within` of it.
fn does_not_drift(duration: f64, at_least: f64, within: f64) {
    let bar = FourBar { crank: 0.3, coupler: 0.9, rocker: 0.8, ground: 0.7 };
    let sim = Simulation {
        tolerance: 1e-10,
        max_step: 1.0,
        ..simulation(bar.chain(Cut::Joint, Default::default(), [""; 3]), vec![bar.closure(Cut::Joint, pin())])
    };
    let [q, qd] = bar.state(Cut::Joint, 0.0, 30.0);
    let summary = sim.stream(&q, &qd, duration, Sampling::default(), &mut |_| {}).unwrap();
    let (last, books) = (summary.last, summary.energy);
    let revolutions = last.q[0] / (2.0 * std::f64::consts::PI);
    assert!(revolutions > at_least, "{revolutions}");
    let [wanted, rates] = bar.state(Cut::Joint, last.q[0], last.qd[0]);
    // Angles of x rad are rounded to 1e-16 x.
    let rounding = last.q[0] * 1e-15;
    for k in 0..3 {
        assert!(turned(last.q[k], wanted[k]).abs() < 1e-11 + rounding, "{last:?} {wanted:?}");
        assert!((last.qd[k] - rates[k]).abs() < 1e-9 + 100.0 * rounding, "{last:?} {rates:?}");
    }
    // The error of a step is a tolerance at most; there are 60 to a revolution.
    assert!((books.end - books.start).abs() < within * books.start, "{books:?}");
}

#[test]
fn a_crank_rocker_does_not_drift_over_many_revolutions() {
    does_not_drift(60.0, 400.0, 1e-7);
}

#[test]
#[ignore = "ten minutes: cargo test loops:: -- --ignored"]
fn a_crank_rocker_does_not_drift_over_a_hundred_thousand_revolutions() {
    does_not_drift(13_900.0, 1e5, 1e-5);
}

/// A crank that has turned 10⁵ times has an angle that is rounded to 1e-10: it closes and moves to these digits.
#[test]
fn a_crank_that_has_turned_a_hundred_thousand_times_goes_on() {
    let bar = FourBar { crank: 0.3, coupler: 0.9, rocker: 0.8, ground: 0.7 };
    let sim = simulation(bar.chain(Cut::Joint, Default::default(), [""; 3]), vec![bar.closure(Cut::Joint, pin())]);
    let turns = 2e5 * std::f64::consts::PI;
    let [mut q, qd] = bar.state(Cut::Joint, 0.3, 9.0);
    (q[0], q[1]) = (q[0] + turns, q[1] - turns);
    let last = sim.stream(&q, &qd, 2.0, Sampling::default(), &mut |_| {}).unwrap().last;
    let [wanted, rates] = bar.state(Cut::Joint, last.q[0], last.qd[0]);
    for k in 0..3 {
        assert!(turned(last.q[k], wanted[k]).abs() < 2e-9, "{last:?} {wanted:?}");
        assert!((last.qd[k] - rates[k]).abs() < 1e-8, "{last:?} {rates:?}");
    }
}

/// The N-four-bar falls through its flat pose, in which its loops depend on each other, and keeps its energy: both cuts, all
/// tolerances. The leap over the pose has an error of its own, of 1e-11.
#[test]
fn an_n_four_bar_keeps_its_energy_through_its_flat_pose() {
    for n in [1, 2] {
        let mut ends: Vec<Moment> = Vec::new();
        for cut in [Cut::Joint, Cut::Foot] {
            for (tolerance, within) in [(1e-9, 1e-7), (1e-11, 1e-9), (1e-12, 1e-9)] {
                let (chain, loops, q, qd) = n_four_bar(n, cut);
                let sim = Simulation { tolerance, ..simulation(chain, loops) };
                let (moments, summary) = sampled(&sim, (&q, &qd), 10.0, 0.05);
                let books = summary.energy;
                assert!((books.end - books.start).abs() < within * books.start, "{n} {cut:?} {tolerance}: {books:?}");
                let flat = moments.iter().filter(|it| it.q[0] < 0.0).count();
                assert!(flat > 20, "it passes the flat pose");
                // All rods stay parallel: no other branch.
                for moment in &moments {
                    let (first, last) = (moment.q[0], moment.q[moment.q.len() - 1]);
                    if cut == Cut::Joint {
                        assert!(turned(first, last).abs() < 1e-7, "{n} {tolerance}: {moment:?}");
                    }
                    let off = (energy(&sim, moment) - books.start).abs();
                    assert!(off < 100.0 * within * books.start, "{n} {cut:?} {tolerance}: {off} at {}", moment.time);
                }
                if tolerance < 1e-10 {
                    ends.push(summary.last);
                }
            }
        }
        // The first rod at the end is the same for every cut.
        for end in &ends[1..] {
            assert!((end.q[0] - ends[0].q[0]).abs() < 1e-6 && (end.qd[0] - ends[0].qd[0]).abs() < 1e-6, "{ends:?}");
        }
    }
}

/// The rods of the N-four-bar stay parallel and its couplers level, so that it is one pendulum with
/// (N+1) m l²/3 + N m l² for its inertia and m g l ((N+1)/2 + N) sin θ for the torque of its weight. Its period is that of
/// the turning pendulum: the integral of dθ/ω(θ) by energy.
#[test]
fn an_n_four_bar_is_a_pendulum() {
    let n = 2.0;
    let (chain, loops, q, qd) = n_four_bar(2, Cut::Joint);
    let sim = simulation(chain, loops);
    let (inertia, weight) = ((n + 1.0) / 3.0 + n, G * ((n + 1.0) / 2.0 + n));
    let rate = |angle: f64| (1.0 + 2.0 * weight / inertia * (1.0 - angle.sin())).sqrt();
    // The rule of the trapezium converges geometrically for a periodic integrand.
    let points = 400;
    let step = 2.0 * std::f64::consts::PI / f64::from(points);
    let period: f64 = (0..points).map(|k| step / rate(f64::from(k) * step)).sum();
    let last = sim.stream(&q, &qd, 3.0 * period, Sampling::default(), &mut |_| {}).unwrap().last;
    let turns = q[0] - last.q[0] - 6.0 * std::f64::consts::PI;
    // Six passages of the flat pose, each with an error of 1e-10 of the velocity.
    assert!(turns.abs() < 1e-7 && (last.qd[0] + 1.0).abs() < 1e-7, "{turns} {last:?}");
}

/// A mechanism that stops in its flat pose could leave it by either branch: the run ends with an error, and not with a choice.
#[test]
fn a_mechanism_that_stops_at_its_branching_pose_is_refused() {
    let (chain, loops, q, _) = n_four_bar(1, Cut::Joint);
    // Without gravity, with a brake: a linear damper in each joint of the ground stops it at the flat pose.
    let spring = |joint: &str| Spring { joint: joint.into(), rest: 0.0, stiffness: 0.0, damping: 1.0 };
    let sim = Simulation {
        gravity: Vector3::zeros(),
        springs: vec![spring("j_rod0"), spring("j_rod1")],
        ..simulation(chain, loops)
    };
    // θ̈ I = −2 θ̇ with I = 2/3 + 1: it stops after θ̇ I / 2.
    let rate = std::f64::consts::FRAC_PI_2 * 2.0 / (5.0 / 3.0);
    let stopped = sim.run(&q, &[-rate, rate, -rate], 30.0);
    assert!(matches!(stopped, Err(SimError::Branch { .. })), "{:?}", stopped.map(|run| run.summary));
    // Faster by a percent it passes.
    let fast = 1.02 * rate;
    let run = sim.run(&q, &[-fast, fast, -fast], 30.0).unwrap();
    assert!(run.summary.last.q[0] < 0.0, "{:?}", run.summary.last);
}

/// A start in the flat pose is refused as well.
#[test]
fn a_start_in_a_branching_pose_is_refused() {
    let (chain, loops, _, _) = n_four_bar(1, Cut::Joint);
    let sim = simulation(chain, loops);
    for start in [0.0, 1e-4, -1e-4] {
        let run = sim.run(&[start, -start, start], &[0.0; 3], 0.1);
        assert!(matches!(run, Err(SimError::Branch { .. })), "{start}: {:?}", run.map(|run| run.summary));
    }
}

/// A run in pieces of 1 ms, of which some end within the leap over a flat pose, is the run in one piece, and so is one that goes
/// on from a state that was saved within the leap.
#[test]
fn a_session_goes_on_within_the_leap_over_a_flat_pose() {
    let (chain, loops, q, qd) = n_four_bar(1, Cut::Joint);
    let sim = simulation(chain, loops);
    let whole = sim.stream(&q, &qd, 2.0, Sampling::default(), &mut |_| {}).unwrap().last;
    let near = |found: &Moment| {
        let pairs = found.q.iter().zip(&whole.q).chain(found.qd.iter().zip(&whole.qd));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let mut session = sim.clone().start(&q, &qd).unwrap();
    let mut within = Vec::new();
    for k in 1..=20000 {
        session.advance(f64::from(k) * 1e-4 - session.time()).unwrap();
        // It stands where it was asked to.
        assert!((session.time() - f64::from(k) * 1e-4).abs() < 1e-13);
        let now = session.moment();
        assert!(turned(now.q[0], now.q[2]).abs() < 1e-9, "{now:?}");
        if now.q[0].sin().abs() < 2e-4 {
            within.push(session.save());
        }
    }
    // Each piece starts its integration anew, with an error of some tolerances.
    assert!(near(&session.moment()) < 1e-7, "{:?} {whole:?}", session.moment());
    assert!(!within.is_empty());
    for state in &within {
        let mut again = sim.clone().start(&q, &qd).unwrap();
        again.restore(state).unwrap();
        again.advance(2.0 - again.time()).unwrap();
        assert!(near(&again.moment()) < 1e-7, "{:?} {whole:?}", again.moment());
    }
}

/// A slider-crank with dry friction f in its slider, in the horizontal plane: the slider's velocity passes through zero at both dead
/// points, where its friction only changes its direction. The loss of kinetic energy is f times the path of the slider.
#[test]
fn dry_friction_changes_its_direction_at_the_dead_points_of_a_slider() {
    let (r, l, f, mass) = (0.3_f64, 0.8, 0.7, 1.5);
    let slider = format!(
        r#"<link name="slider"><inertial><mass value="{mass}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
        </inertial></link><joint name="slide" type="prismatic"><parent link="ground"/><child link="slider"/><axis xyz="1 0 0"/>
        <limit lower="-9" upper="9" effort="9" velocity="9"/><dynamics friction="{f}"/></joint>"#
    );
    let chain = carom_testing::mechanisms::chain_and(
        &[Rod::new("crank", "ground", 0.0, r), Rod::new("rod", "crank", r, l)],
        &slider,
    );
    let frame = |link, x| LoopFrame::new(Some(link), [x, 0.0, 0.0], [0.0; 3]);
    let joint = LoopJoint::Pin { axis: Vector3::z() };
    let loops = vec![Loop { name: "pin".into(), joint, frames: [frame("rod", l), frame("slider", 0.0)] }];
    let place = |angle: f64| r * angle.cos() + (l * l - (r * angle.sin()).powi(2)).sqrt();
    let lean = |angle: f64| -(r / l * angle.sin()).asin();
    for tolerance in [1e-3, 1e-4, 1e-6, 1e-8, 1e-10] {
        let sim = Simulation { loops: loops.clone(), tolerance, ..Simulation::new(chain.clone(), Vec::new()) };
        let (angle, speed) = (1.0_f64, 12.0);
        let q = [angle, lean(angle) - angle, place(angle)];
        // The rates by differences: closed by the simulation.
        let h = 1e-6;
        let rate = |of: &dyn Fn(f64) -> f64| (of(angle + h) - of(angle - h)) / (2.0 * h) * speed;
        let qd = [speed, rate(&lean) - speed, rate(&place)];
        let (closed, _) = sim.close_loops(&q, &qd).unwrap();
        let run = sim.run(&closed.q, &closed.qd, 2.0).unwrap();
        let end = run.summary.last.q[0];
        assert!(end > angle + 2.0 * PI, "the crank turns by {}", end - angle);
        let turns: Vec<f64> = (1..100).map(|k| f64::from(k) * PI).filter(|turn| *turn < end).collect();
        let stations: Vec<f64> = [angle].into_iter().chain(turns).chain([end]).map(place).collect();
        let path: f64 = stations.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
        let balance = run.summary.energy;
        let lost = balance.start - balance.end;
        let allowed = 20.0 * tolerance * balance.start;
        assert!((lost - f * path).abs() < allowed, "{tolerance}: {lost} J lost, {} J of friction", f * path);
        assert!(balance.error().abs() < allowed, "{tolerance}: {}", balance.error());
    }
}

//! Several lasting contacts, event-driven: closed forms, and independent integrations.

use carom_chain::Chain;
use carom_impact::Coefficients;
use carom_sim::{ContactLaw, ContactState, Drive, EventKind, Gains, Sampling, Seen, Simulation, Trajectory};
use carom_testing::build::{O, Part, X, Z, ball, brick, chain, floating_box, in_plane, one_body, shape, urdf};
use carom_testing::numeric::rk4;
use carom_testing::scenes::{self, G, among, half_space, newton, surface};
use nalgebra::{Vector2, Vector3};

/// All contacts of the links, under Newton's law without restitution.
fn simulation(chain: Chain, surfaces: &[(&str, Vector3<f64>)], friction: f64) -> Simulation {
    let plane =
        |(name, normal): &(&str, Vector3<f64>)| surface(name, half_space([0.0; 3], *normal), newton(0.0, friction));
    let surfaces: Vec<_> = surfaces.iter().map(plane).collect();
    Simulation { tolerance: 1e-11, ..among(chain, &surfaces) }
}

/// A uniform rod of 1 m in the x–z plane, with its ends at ±0.5 along its x axis.
fn rod(mass: f64) -> Chain {
    let end = |x: f64| shape(&ball(1e-9), [x, 0.0, 0.0], O);
    in_plane(mass, mass / 12.0, &(end(-0.5) + &end(0.5)))
}

fn names(run: &Trajectory) -> Vec<(f64, &'static str)> {
    run.events.iter().map(|event| (event.time, event.kind.name())).collect()
}

/// The contacts at every sample of a run.
fn told(sim: &Simulation, q: &[f64], qd: &[f64], duration: f64, every: f64) -> Vec<(f64, Vec<ContactState>)> {
    let mut all = Vec::new();
    let sampling = Sampling { every: Some(every), ..Sampling::default() };
    sim.stream(q, qd, duration, sampling, &mut |seen| {
        if let Seen::Contacts(time, states) = seen {
            all.push((time, states.to_vec()));
        }
    })
    .unwrap();
    all
}

/// A box slides to rest on its four corners: at v/(μ g), after v²/(2 μ g). Its friction acts below its centre, so the loads of
/// the front corners are m g (1 + μ h/a)/4, with half height h and half length a, and those of the rear ones are smaller by as
/// much. The stop is one event of all four corners.
#[test]
fn a_box_slides_to_rest_on_four_corners() {
    let (mu, v, mass) = (0.3, 1.2, 2.0);
    let sim = simulation(floating_box([0.3, 0.2, 0.1], mass), &[("floor", Vector3::z())], mu);
    let (q, qd) = ([0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0], [v, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let run = sim.run(&q, &qd, 1.0).unwrap();
    assert_eq!(run.summary.statistics.contact_steps, 0, "{:?}", names(&run));
    let stop = v / (mu * G);
    let sticks: Vec<f64> = run.events.iter().filter(|e| e.kind.name() == "sticking").map(|e| e.time).collect();
    assert_eq!(sticks.len(), 4, "{:?}", names(&run));
    for time in sticks {
        assert!((time - stop).abs() < 1e-9, "{time} for {stop}");
    }
    let last = &run.summary.last;
    assert!((last.q[0] - v * v / (2.0 * mu * G)).abs() < 1e-10, "{last:?}");
    assert!((last.q[2] - 0.05).abs() < 1e-12 && last.q[3..6].iter().all(|x| x.abs() < 1e-10), "{last:?}");
    // The balance of the loads.
    for (time, states) in told(&sim, &q, &qd, 1.0, 0.05) {
        let share = if time < stop { mu * 0.05 / 0.15 } else { 0.0 };
        assert_eq!(states.len(), 4);
        for state in states {
            let front = (state.point.x - last.q[0].min(v * time - 0.5 * mu * G * time * time)).signum();
            let load = mass * G / 4.0 * (1.0 + front * share);
            assert!((state.normal_force - load).abs() < 1e-8 * load, "{time}: {} for {load}", state.normal_force);
            let friction = if time < stop { -mu * load } else { 0.0 };
            assert!((state.force.x - friction).abs() < 1e-8 && state.force.y.abs() < 1e-8, "{time}: {:?}", state.force);
        }
    }
}

/// A box on a slope of angle θ > atan(μ) slides; where μ > a/h (half length over half height) and tan θ > a/h it tips about its
/// lower edge instead, with the angular acceleration m g (h sin θ − a cos θ)/(I + m (a² + h²)).
#[test]
fn a_slender_box_on_a_slope_tips_over_its_edge() {
    let (a, h, mass, mu) = (0.05, 0.15, 1.5, 0.9);
    for (angle, tips) in [(0.3, false), (0.4_f64, true)] {
        let normal = Vector3::new(angle.sin(), 0.0, angle.cos());
        let sim = simulation(floating_box([2.0 * a, 0.1, 2.0 * h], mass), &[("slope", normal)], mu);
        let half = angle / 2.0;
        let start = [h * normal.x, 0.0, h * normal.z, 0.0, half.sin(), 0.0, half.cos()];
        let run = sim.run(&start, &[0.0; 6], 0.01).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0, "{:?}", names(&run));
        let inertia = mass * (a * a + h * h) / 3.0;
        let alpha = if tips {
            mass * G * (h * angle.sin() - a * angle.cos()) / (inertia + mass * (a * a + h * h))
        } else {
            0.0
        };
        // The torque of gravity changes by the order of the angle turned, 1e-4.
        let spin = run.summary.last.qd[4];
        assert!((spin - alpha * 0.01).abs() <= 1e-3 * alpha * 0.01, "{angle}: {spin} for {}", alpha * 0.01);
        assert_eq!(run.summary.contacts.len(), if tips { 2 } else { 4 });
    }
}

/// A ladder slides down a smooth wall on a smooth floor, from rest. It leaves the wall where its upper end has fallen to two
/// thirds of its height, at the angular velocity ω² = 3 g (sin α₀ − sin α)/l with sin α = 2/3 sin α₀.
#[test]
fn a_ladder_leaves_its_wall_at_two_thirds_of_its_height() {
    let sim = simulation(rod(3.0), &[("floor", Vector3::z()), ("wall", Vector3::x())], 0.0);
    let alpha: f64 = 1.1;
    // The end at −0.5 is up, at the wall.
    let (s, c) = alpha.sin_cos();
    let tiny = 1e-9;
    let run = sim.run(&[0.5 * c + tiny, 0.5 * s + tiny, alpha], &[0.0; 3], 1.0).unwrap();
    assert_eq!(run.summary.statistics.contact_steps, 0, "{:?}", names(&run));
    let leaves = run.events.iter().find(|event| matches!(event.kind, EventKind::LiftOff { .. })).unwrap();
    let sine = 2.0 / 3.0 * s;
    assert!((leaves.q[2].sin() - sine).abs() < 1e-9, "{} for {sine}", leaves.q[2].sin());
    let spin = -(3.0 * G * (s - sine)).sqrt();
    assert!((leaves.qd_plus[2] - spin).abs() < 1e-9, "{} for {spin}", leaves.qd_plus[2]);
}

/// A box that slides and spins on four corners, against the equations of its plane motion with loads that are affine in the
/// position of the corner: Σ N = m g, Σ N r = friction's moment about the centre at the height h. Where a corner would pull, the
/// three others bear the load.
fn loads_of_corners(at: &[Vector2<f64>], d: &[Vector2<f64>], (weight, lever): (f64, f64)) -> Vec<f64> {
    // Moments about the horizontal axes: Σ N r − h Σ (force) = 0, as the friction acts at the height −h.
    let moments = |k: usize| Vector3::new(1.0, at[k].x - lever * d[k].x, at[k].y - lever * d[k].y);
    let shape = |k: usize| Vector3::new(1.0, at[k].x, at[k].y);
    let mut affine = nalgebra::Matrix3::zeros();
    (0..4).for_each(|k| affine += moments(k) * shape(k).transpose());
    let whole = Vector3::new(weight, 0.0, 0.0);
    let factors = affine.lu().solve(&whole).unwrap();
    let mut loads: Vec<f64> = (0..4).map(|k| factors.dot(&shape(k))).collect();
    if let Some(pulling) = (0..4).find(|&k| loads[k] < 0.0) {
        let others: Vec<usize> = (0..4).filter(|&k| k != pulling).collect();
        let three = nalgebra::Matrix3::from_fn(|i, j| moments(others[j])[i]);
        let found = three.lu().solve(&whole).unwrap();
        loads[pulling] = 0.0;
        others.iter().zip(found.iter()).for_each(|(&k, load)| loads[k] = *load);
    }
    loads
}

/// [`loads_of_corners`], integrated by the classical method of Runge and Kutta.
#[test]
fn a_spinning_box_is_borne_by_corners_that_push() {
    for (size, mass, mu, start, end, pulls) in [
        ([0.3, 0.2, 0.1], 2.0, 0.25, [0.8, 0.1, 3.0], 0.2, false),
        ([0.3, 0.2, 0.24], 1.0, 0.8, [0.6, 0.9, 3.0], 0.1, true),
    ] {
        let h = size[2] / 2.0;
        let inertia = mass * (size[0] * size[0] + size[1] * size[1]) / 12.0;
        let corner = |k: usize, turn: f64| {
            let (x, y) = (if k & 1 == 0 { 0.15 } else { -0.15 }, if k & 2 == 0 { 0.1 } else { -0.1 });
            let (s, c) = turn.sin_cos();
            Vector2::new(c * x - s * y, s * x + c * y)
        };
        let loaded = |y: [f64; 6]| {
            let [_, _, turn, vx, vy, w] = y;
            let at: Vec<Vector2<f64>> = (0..4).map(|k| corner(k, turn)).collect();
            let d: Vec<Vector2<f64>> =
                at.iter().map(|r| Vector2::new(vx - w * r.y, vy + w * r.x).normalize()).collect();
            let loads = loads_of_corners(&at, &d, (mass * G, mu * h));
            (at, d, loads)
        };
        let rate = |y: [f64; 6]| {
            let (at, d, loads) = loaded(y);
            let (mut force, mut torque) = (Vector2::zeros(), 0.0);
            for ((r, d), load) in at.iter().zip(&d).zip(&loads) {
                let f = -d * (mu * load);
                force += f;
                torque += r.x * f.y - r.y * f.x;
            }
            [y[3], y[4], y[5], force.x / mass, force.y / mass, torque / inertia]
        };
        let [vx, vy, w] = start;
        let mut y = [0.0, 0.0, 0.0, vx, vy, w];
        let steps = 2000;
        let step = end / f64::from(steps);
        (0..steps).for_each(|_| y = rk4(rate, y, step));
        let (_, _, mut loads) = loaded(y);
        assert_eq!(loads.contains(&0.0), pulls);
        let sim = simulation(floating_box(size, mass), &[("floor", Vector3::z())], mu);
        let run = sim.run(&[0.0, 0.0, h, 0.0, 0.0, 0.0, 1.0], &[vx, vy, 0.0, 0.0, 0.0, w], end).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0, "{:?}", names(&run));
        let q = &run.summary.last.q;
        let turn = 2.0 * q[5].atan2(q[6]);
        for (found, expected) in [q[0], q[1], turn].into_iter().zip(y) {
            // Runge–Kutta's error is of the order of step⁴ = 1e-16.
            assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
        }
        let mut found: Vec<f64> = run.summary.contacts.iter().map(|contact| contact.normal_force).collect();
        loads.sort_by(f64::total_cmp);
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), 4);
        for (found, expected) in found.iter().zip(&loads) {
            assert!((found - expected).abs() < 1e-6 * mass * G, "{found} N for {expected} N");
        }
    }
}

/// Every contact twice: the motion is the same, although each pair of forces is undetermined.
#[test]
fn duplicated_contacts_do_not_change_the_motion() {
    let contact = ContactLaw::named("newton", Coefficients { friction: 0.3, ..Coefficients::default() }).unwrap();
    for qd in [[0.7, 0.2, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5, 0.8, 0.0]] {
        let once = simulation(floating_box([0.3, 0.2, 0.1], 2.0), &[("floor", Vector3::z())], 0.3);
        assert_eq!(once.touches[0].contact.law, contact);
        let mut twice = once.clone();
        twice.touches.extend(once.touches.iter().cloned());
        let start = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
        let [one, two] = [&once, &twice].map(|sim| sim.run(&start, &qd, 0.15).unwrap().summary);
        assert_eq!(two.statistics.contact_steps, 0);
        for (a, b) in one.last.q.iter().zip(&two.last.q) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

/// Two flat fingers squeeze a box of mass m with the force F each while it falls at the speed v: friction 2 μ F on eight corners stops it
/// after the time v/a and the distance v²/2a with a = 2 μ F/m − g, without a turn, and it stays there.
#[test]
fn a_gripper_stops_a_box_without_turning_it() {
    let finger = |name: &str, axis| {
        let part = Part::slider(name, "base", axis).limits(-1.0, 1.0, 100.0);
        part.weighing(0.3, [0.001; 3]).shaped(&brick([0.02, 0.06, 0.05]))
    };
    let gripper = urdf(&[finger("left", X), finger("right", [-1.0, 0.0, 0.0])]);
    let object = one_body(0.5, [0.002; 3], &shape(&brick([0.1, 0.1, 0.3]), O, O));
    let (squeeze, mu, mass, speed) = (12.0, 0.4, 0.5, 0.3);
    let text = format!(
        r#"
        [[robot]]
        name = "gripper"
        urdf = "gripper.urdf"
        q = [-0.06, -0.06]
        controller = "constant"
        torque = [{squeeze}, {squeeze}]
        [[robot]]
        name = "object"
        urdf = "object.urdf"
        floating = true
        position = [0, 0, 0]
        qd = [0, 0, -{speed}, 0, 0, 0]
        [contact]
        law = "newton"
        restitution = 0
        friction = {mu}
        [run]
        duration = 0.2
        gravity = [0, 0, -{G}]
        tolerance = 1e-10
        "#
    );
    let scene = scenes::scene(&[("gripper.urdf", &gripper), ("object.urdf", &object)], &text).unwrap();
    let run = scene.plan().unwrap().run(scene.duration).unwrap();
    let slows = 2.0 * mu * squeeze / mass - G;
    let stop = run.events.iter().find(|event| event.kind.name() == "sticking").expect("the box stops");
    assert!((stop.time - speed / slows).abs() < 1e-9, "{} s for {} s", stop.time, speed / slows);
    // Eight contacts begin to slide and stop, once.
    assert!(run.events.len() < 24, "{:?}", names(&run));
    assert_eq!(run.summary.statistics.contact_steps, 0);
    let (place, rest) = (&run.summary.last.q[2..], &run.summary.last.qd);
    let expected = [0.0, 0.0, -speed * speed / (2.0 * slows), 0.0, 0.0, 0.0, 1.0];
    for (found, expected) in place.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{place:?}");
    }
    assert!(rest.iter().all(|v| v.abs() < 1e-9), "{rest:?}");
}

/// A box is put on a slope that is too steep for it: from the first moment on friction is μ times the normal force and opposes the slip,
/// whose direction is that of its acceleration.
#[test]
fn friction_opposes_slip_from_its_beginning() {
    let mut sim = simulation(floating_box([0.3, 0.2, 0.1], 2.0), &[("floor", Vector3::z())], 0.3);
    for downhill in [[0.5, 0.0], [0.0, -0.5], [-0.3, 0.4]] {
        sim.gravity = Vector3::new(downhill[0], downhill[1], -1.0) * G;
        let told = told(&sim, &[0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.01, 0.005);
        assert_eq!(told[0].0, 0.0);
        for (time, contacts) in told {
            let friction: Vector3<f64> = contacts.iter().map(|contact| contact.force).sum();
            let expected = Vector3::new(-0.6 * downhill[0], -0.6 * downhill[1], 1.0) * 2.0 * G;
            assert!((friction - expected).norm() < 1e-7, "{downhill:?}, {time} s: {friction} for {expected}");
        }
    }
}

/// A slender box stands on a slope and leans over a corner: the forces of equal springs would pull there. Those that are told balance its
/// weight, push, and are inside their friction cones.
#[test]
fn the_forces_of_a_leaning_box_are_admissible() {
    let (half, mu) = (Vector3::new(0.05, 0.05, 0.2), 0.3);
    let mut sim = simulation(floating_box([0.1, 0.1, 0.4], 1.0), &[("floor", Vector3::z())], mu);
    for tilt in [[0.15, 0.15], [0.2, -0.19], [0.0, 0.24], [-0.2, 0.1], [0.12, 0.05]] {
        sim.gravity = Vector3::new(tilt[0], tilt[1], -1.0) * G;
        let contacts = told(&sim, &[0.0, 0.0, half.z, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.1, 0.05).pop().unwrap().1;
        let (mut force, mut moment, mut least) = (sim.gravity, Vector3::zeros(), f64::INFINITY);
        for contact in &contacts {
            force += contact.force;
            moment += (contact.point - Vector3::new(0.0, 0.0, half.z)).cross(&contact.force);
            let along = contact.force.xy().norm();
            least = least.min(contact.normal_force).min(mu * contact.normal_force - along);
        }
        assert!(contacts.len() == 4 && force.norm() < 1e-8 && moment.norm() < 1e-9, "{tilt:?}: {force} {moment}");
        assert!(least > -1e-8, "{tilt:?}: {least} N outside, {contacts:?}");
    }
}

/// A mass on a spring oscillates on a block that stands on the floor. Its amplitude is a little more than the one at which the block would
/// lift off: the load is negative for some thousandths of the period only, well within a step of the integrator.
#[test]
fn a_lift_off_within_a_step_is_seen() {
    let block = Part::slider("block", "base", Z).weighing(1.5, [1.0; 3]).shaped(&ball(0.1));
    let chain = chain(&[block, Part::slider("mass", "block", Z).weighing(0.5, [1.0; 3])]);
    let (stiffness, mass, whole) = (80.0_f64, 0.5, 2.0);
    let frequency = (stiffness / mass).sqrt();
    for (excess, tolerance) in [(1e-3, 1e-6), (1e-4, 1e-6), (1e-4, 1e-9), (1e-5, 1e-9)] {
        let mut sim = simulation(chain.clone(), &[("floor", Vector3::z())], 0.0);
        sim.tolerance = tolerance;
        let gains = |k: f64| Gains::from(vec![0.0, k]);
        sim.drive = Drive::Pd(carom_sim::Pd { kp: gains(stiffness), kd: gains(0.0), target: vec![0.0; 2] });
        let amplitude = (1.0 + excess) * whole * G / stiffness;
        // From 0.3 rad after the highest point, through the lowest one.
        let phase = std::f64::consts::PI + 0.3;
        let place = -mass * G / stiffness - amplitude * phase.cos();
        let run = sim.run(&[0.1, place], &[0.0, amplitude * frequency * phase.sin()], 6.5 / frequency).unwrap();
        let leaves = run
            .events
            .iter()
            .find(|event| event.kind.name() == "lift-off")
            .unwrap_or_else(|| panic!("{excess} {tolerance}: {:?} {:?}", names(&run), run.summary.statistics));
        let expected = (3.0 * std::f64::consts::PI - (1.0 / (1.0 + excess)).acos() - phase) / frequency;
        // The load is zero at a small angle: an error of it is one of the time by 1/√(2 excess).
        let allowed = 10.0 * tolerance / (2.0 * excess).sqrt();
        assert!((leaves.time - expected).abs() < allowed, "{} s for {expected} s, {excess} {tolerance}", leaves.time);
    }
}

/// A box at rest on a slope in time steps: its contact forces balance its weight, in space and along the normal of each contact. The
/// forces are impulses of a step over its length, for a motion whose accelerations end within some steps.
#[test]
fn contact_forces_of_time_steps_balance_the_weight_of_a_box_on_a_slope() {
    let gravity = Vector3::new(0.2, 0.1, -1.0) * 9.81;
    let on_floor = simulation(floating_box([0.2, 0.3, 0.1], 2.0), &[("floor", Vector3::z())], 0.6);
    let sim = Simulation { gravity, stepping: true, contact_step: 1e-3, ..on_floor };
    let run = sim.run(&[0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0], &[0.0; 6], 0.2).unwrap();
    let contacts = &run.summary.contacts;
    assert_eq!(contacts.len(), 4);
    let force: Vector3<f64> = contacts.iter().map(|contact| contact.force).sum();
    assert!((force + 2.0 * gravity).norm() < 1e-6 * 2.0 * gravity.norm(), "{force}");
    let normal: f64 = contacts.iter().map(|contact| contact.normal_force).sum();
    assert!((normal - 2.0 * 9.81).abs() < 1e-6 * 2.0 * 9.81, "{normal} N");
    for contact in contacts {
        assert!((contact.force.dot(&contact.normal) - contact.normal_force).abs() < 1e-9 * normal);
    }
}

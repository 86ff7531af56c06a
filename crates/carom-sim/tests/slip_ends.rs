//! Slip that ends: what is left of it after an event for less than a quarter of the Zeno time is left out. Slip that passes a dead point.

use carom_impact::Energetic;
use carom_sim::{ContactRule, Drive, Loop, LoopFrame, LoopJoint, Simulation, Touch};
use carom_testing::build::{self, O, Part, X, Y, Z, ball, chain, free, shape};
use carom_testing::numeric::rk4;
use carom_testing::scenes::{G, half_space, kinds, newton, on_floor, surface};
use nalgebra::{Matrix3, Vector3};

const FRICTION: f64 = 0.5;
const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];

/// A mass on three prismatic joints over a floor, with a flywheel about the vertical.
fn mass_over_floor(contact: ContactRule, tolerance: f64) -> Simulation {
    let parts = [
        Part::slider("a", "base", X).massless(),
        Part::slider("b", "a", Y).massless(),
        Part::slider("c", "b", Z).weighing(0.7, [1.0; 3]).shaped(&ball(0.1)),
        Part::hinge("d", "c", Z).weighing(0.3, [1.0; 3]),
    ];
    let zeno_time = Simulation::zeno_time_for(tolerance);
    Simulation { tolerance, zeno_time, ..on_floor(chain(&parts), contact) }
}

/// A mass that starts across an incline, of which `down` is the acceleration along it, stops at a known place and time. With φ the angle
/// between its velocity u and the line of greatest slope, k = μ g/a and t = tan φ/2: u = u₀ t^k/sin φ, dx = −u² cos φ dφ/(a sin φ),
/// dy = −u² dφ/a and dt = −u dφ/(a sin φ).
#[test]
fn a_mass_that_starts_across_an_incline_stops_at_a_known_place() {
    for (down, tolerance) in [2.0, 0.5].into_iter().flat_map(|down| TOLERANCES.map(|tolerance| (down, tolerance))) {
        let k = FRICTION * G / down;
        let contact = newton(0.0, FRICTION);
        let gravity = Vector3::new(down, 0.0, -G);
        let sim = Simulation { gravity, ..mass_over_floor(contact, tolerance) };
        // The second slip ends at once.
        for slip in [1.0, 0.1 * FRICTION * G * sim.zeno_time] {
            let run = sim.run(&[0.0, 0.0, 0.1, 0.0], &[0.0, slip, 0.0, 0.0], 1.0).unwrap();
            let size = slip * slip / down;
            let x = size / 4.0 * (1.0 / (2.0 * k - 2.0) - 1.0 / (2.0 * k + 2.0));
            let y = size / 2.0 * (1.0 / (2.0 * k - 1.0) + 1.0 / (2.0 * k + 1.0));
            let stops = slip / down * k / (k * k - 1.0);
            let last = &run.summary.last;
            let off = (last.q[0] - x).abs().max((last.q[1] - y).abs());
            assert!(off < tolerance, "{off:e} at {tolerance:e} from {slip}");
            assert_eq!(last.qd, [0.0; 4]);
            assert!(run.summary.energy.error().abs() < tolerance, "{:?}", run.summary.energy);
            // On the shallow one slip turns by more than the root of the tolerance while it halves, and ends by an event.
            if down < 1.0 && slip == 1.0 {
                let sticks = run.events.iter().find(|event| event.kind.name() == "sticking").unwrap().time;
                assert!(((stops - sticks) * 64.0 / sim.zeno_time - 1.0).abs() < 0.01, "{sticks} of {stops}");
            }
        }
    }
}

/// Slow slip on a smooth floor is not taken for rest while another joint is fast: it stops after v²/(2 μ g).
#[test]
fn slow_slip_beside_a_fast_joint_goes_as_far_as_friction_lets_it() {
    let (mu, v) = (1e-3, 2e-3);
    let far = v * v / (2.0 * mu * G);
    for tolerance in TOLERANCES {
        let contact = newton(0.0, mu);
        let run = mass_over_floor(contact, tolerance).run(&[0.0, 0.0, 0.1, 0.0], &[v, 0.0, 0.0, 10.0], 0.5).unwrap();
        let off = run.summary.last.q[0] - far;
        assert!(off.abs() < tolerance * far, "{off:e} of {far:e} at {tolerance:e}");
    }
}

/// A mass bounces to rest while it slides, and its slip ends within the jump over its last impacts: it stops where friction of μ m g since
/// the start stops it, and does not move back.
#[test]
fn slip_that_ends_while_impacts_accumulate_does_not_turn_back() {
    let (mu, e, fall) = (0.3, 0.5, 0.1);
    // It strikes the floor with the speed `fall`, and the impacts accumulate until `ends`; the jump begins after the second one.
    let ends = 2.0 * fall * e / (G * (1.0 - e));
    for stops in [0.6 * ends, 0.8 * ends, 0.95 * ends] {
        // All of the downward momentum passes through the floor.
        let v = mu * (fall + G * stops);
        let run = |zeno_time: f64| {
            let contact = ContactRule::new(Energetic { restitution: e, friction: mu });
            let sim = Simulation { zeno_time, ..mass_over_floor(contact, 1e-9) };
            sim.run(&[0.0, 0.0, 0.1, 0.0], &[v, 0.0, -fall, 0.0], 0.1).unwrap()
        };
        let (jumped, followed) = (run(0.9 * ends), run(1e-6));
        for event in &jumped.events {
            // Rounding of v.
            assert!(event.qd_plus[0] >= -1e-15, "{} at {}: {:?}", event.kind.name(), event.time, event.qd_plus);
        }
        assert_eq!(jumped.summary.last.qd, [0.0; 4]);
        // During one bounce slip differs by the friction of its impact.
        let off = jumped.summary.last.q[0] - followed.summary.last.q[0];
        assert!(off.abs() < mu * G * (0.5 * ends).powi(2), "{off:e}");
    }
}

/// Without gravity a mass slides on along a rough floor that bears nothing.
#[test]
fn a_contact_without_load_brakes_nothing() {
    let contact = newton(0.0, FRICTION);
    let sim = Simulation { gravity: Vector3::zeros(), ..mass_over_floor(contact, 1e-9) };
    let run = sim.run(&[0.0, 0.0, 0.1, 0.0], &[0.3, 0.4, 0.0, 0.0], 1.0).unwrap();
    let last = &run.summary.last;
    assert!((last.q[0] - 0.3).abs() < 1e-12 && (last.q[1] - 0.4).abs() < 1e-12, "{last:?}");
    assert_eq!(last.qd, [0.3, 0.4, 0.0, 0.0]);
}

/// A bar falls flat on two balls, with a torque that lifts one end of it in flight, but not while the other end stands: as the impacts of
/// that one accumulate, so do those of the end that it holds down, and both come to rest by one event.
#[test]
fn an_end_that_another_one_holds_down_comes_to_rest_with_it() {
    let (mass, half, inertia) = (1.0, 0.5, 1.0 / 12.0);
    let end = |x: f64| shape(&ball(0.1), [x, 0.0, 0.0], O);
    let bar = Part::hinge("bar", "a", Y).weighing(mass, [inertia; 3]).with(end(-half) + &end(half));
    let chain = chain(&[Part::slider("a", "base", Z).massless(), bar]);
    // It presses the end at +x. In flight the other end rises if it is above m g I/(m half), about the first one if above m g half.
    let torque = 0.6 * mass * G * half;
    let (tolerance, zeno_time) = (1e-8, Simulation::zeno_time_for(1e-8));
    let sim = Simulation {
        tolerance,
        zeno_time,
        drive: Drive::Constant(vec![0.0, torque]),
        ..on_floor(chain, newton(0.4, 0.0))
    };
    let run = sim.run(&[0.1, 0.0], &[-0.1 * G * zeno_time, 0.0], 0.1).unwrap();
    assert_eq!(kinds(&run), ["several", "zeno", "zeno", "sliding", "sliding", "rest"]);
    assert_eq!(run.events[1].time, run.events[2].time);
    let last = &run.summary.last;
    // It moved for less than the Zeno time.
    assert!((last.q[0] - 0.1).abs() < G * zeno_time.powi(2) && last.qd == [0.0; 2], "{last:?}");
}

/// Two arms on a hinge without friction, and a hinge between them that dry friction stops within a quarter of the Zeno time: afterwards both turn as
/// one body with the angular momentum of the start. Its error is of second order in that time.
#[test]
fn a_joint_that_dry_friction_stops_at_once_passes_its_momentum_on() {
    let link = |name: &str, parent: &str| {
        Part { com: [0.5, 0.0, 0.0], ..Part::hinge(name, parent, Z) }.weighing(1.0, [0.1; 3])
    };
    let two = link("two", "one").at(X).joint("<dynamics friction='3'/>");
    let chain = chain(&[link("one", "base"), two]);
    for tolerance in TOLERANCES {
        let zeno_time = Simulation::zeno_time_for(tolerance);
        let sim = Simulation {
            gravity: Vector3::zeros(),
            tolerance,
            zeno_time,
            ..Simulation::new(chain.clone(), Vec::new())
        };
        let (angle, qd) = (0.7_f64, [0.2, 3.0 * zeno_time]);
        let run = sim.run(&[0.0, angle], &qd, 1.0).unwrap();
        // Moments of inertia about the shoulder and the elbow, and what couples them.
        let (own, across) = (0.1 + 0.25, 0.5 * angle.cos());
        let whole = own + 1.0 + own + 2.0 * across;
        let turns = qd[0] + (own + across) / whole * qd[1];
        let last = &run.summary.last;
        assert!((last.qd[0] - turns).abs() < tolerance, "{} {turns} at {tolerance:e}", last.qd[0]);
        assert!((last.q[1] - angle).abs() < tolerance, "{last:?}");
        assert!(last.qd[1].abs() < 1e-15, "{last:?}"); // rounding
        assert!(run.summary.energy.error().abs() < tolerance, "{:?}", run.summary.energy);
    }
}

/// A tripod turns about one of its feet, which slips by little, while the two others slide. With a short Zeno time this slip is followed
/// to its end; with a long one it ends at once, by impulses of all three feet along the directions of their forces. Both motions agree up
/// to terms of second order in the time of the slip.
#[test]
fn a_foot_whose_slip_ends_at_once_moves_its_body_as_one_whose_slip_is_followed() {
    let feet = [[0.05, 0.0], [-0.1, 0.15], [-0.1, -0.15]];
    let foot = |[x, y]: [f64; 2]| shape(&ball(0.03), [x, y, -0.2], O);
    let body = on_floor(free(2.0, [0.02, 0.03, 0.04], &feet.map(foot).concat()), newton(0.0, FRICTION));
    let (turn, slip) = (1.0, [1.5e-4, 1e-4]);
    let run = |zeno_time: f64| {
        let sim = Simulation { tolerance: 1e-10, zeno_time, ..body.clone() };
        // The first foot moves with `slip`, and the body turns about the vertical.
        let qd = [slip[0], slip[1] - turn * feet[0][0], 0.0, 0.0, 0.0, turn];
        sim.run(&[0.0, 0.0, 0.23, 0.0, 0.0, 0.0, 1.0], &qd, 0.01).unwrap()
    };
    let (at_once, followed) = (run(1e-3), run(1e-7));
    let sticks = |run: &carom_sim::Trajectory| {
        run.events.iter().find(|event| event.kind.name() == "sticking").map(|event| event.time)
    };
    assert_eq!(sticks(&at_once), Some(0.0));
    assert!(sticks(&followed) > Some(0.0), "{:?}", sticks(&followed));
    let (one, other) = (&at_once.summary.last, &followed.summary.last);
    let off = one.qd.iter().zip(&other.qd).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // A quarter of the Zeno time squared, and changes of the accelerations at a rate of some tens of 1/s³ in that time.
    assert!(off < 10.0 * (1e-3_f64 / 4.0).powi(2), "{off:e}: {:?} {:?}", one.qd, other.qd);
    for run in [&at_once, &followed] {
        assert!(run.summary.energy.error().abs() < 1e-9, "{:?}", run.summary.energy);
    }
}

/// A crank on the wall, and a rod on it whose foot, a ball, slides on a floor with friction: in the x–z plane, with the angles α and β of
/// crank and rod to the floor.
struct Slider {
    crank: f64,
    /// From the crank to the centre of mass, and to that of the ball.
    rod: [f64; 2],
    ball: f64,
    mass: f64,
    /// About the hinge of the crank, and of the rod about its centre of mass.
    inertia: [f64; 2],
    gravity: f64,
    floor: f64,
}

impl Slider {
    const NEW: Self =
        Self { crank: 0.1, rod: [0.3, 0.5], ball: 0.02, mass: 0.5, inertia: [0.02, 0.005], gravity: 40.0, floor: -0.1 };

    /// β from α, and its rate, as the foot stays on the floor.
    fn rod_at(&self, (angle, rate): (f64, f64)) -> (f64, f64) {
        let rod = ((self.floor + self.ball - self.crank * angle.sin()) / self.rod[1]).asin();
        (rod, -self.crank * angle.cos() * rate / (self.rod[1] * rod.cos()))
    }

    /// Slip and acceleration of α while friction acts in this direction (1 or −1): the equations of motion of both angles, with the force
    /// of the floor as third unknown.
    fn moves(&self, state: [f64; 2], direction: f64) -> (f64, f64) {
        let Self { crank: r, rod: [c, l], ball, mass, inertia, gravity, .. } = *self;
        let [a, a_rate] = state;
        let (b, b_rate) = self.rod_at((a, a_rate));
        let (normal, along) = ([r * a.cos(), l * b.cos()], [-r * a.sin(), -l * b.sin() + ball]);
        let force = [0, 1].map(|k| normal[k] + direction * FRICTION * along[k]);
        let (coupling, turns) = (mass * r * c * (a - b).cos(), mass * r * c * (a - b).sin());
        let equations = Matrix3::new(
            inertia[0] + mass * r * r,
            coupling,
            -force[0],
            coupling,
            inertia[1] + mass * c * c,
            -force[1],
            normal[0],
            normal[1],
            0.0,
        );
        let right = Vector3::new(
            -turns * b_rate * b_rate - mass * gravity * r * a.cos(),
            turns * a_rate * a_rate - mass * gravity * c * b.cos(),
            r * a.sin() * a_rate * a_rate + l * b.sin() * b_rate * b_rate,
        );
        let found = equations.lu().solve(&right).unwrap();
        assert!(found.z > 0.0, "the foot is pressed on the floor");
        (along[0] * a_rate + along[1] * b_rate, found.x)
    }

    /// α and its rate after this time, and the times at which the slip passes through zero: by Runge and Kutta's method, whose step is cut
    /// where the slip vanishes.
    fn after(&self, mut state: [f64; 2], duration: f64) -> ([f64; 2], Vec<f64>) {
        let step =
            |state: [f64; 2], h: f64, direction: f64| rk4(|[a, v]| [v, self.moves([a, v], direction).1], state, h);
        let mut slips = -self.moves(state, 1.0).0.signum();
        let (mut time, mut turns) = (0.0, Vec::new());
        while time < duration {
            let h = f64::min(2e-5, duration - time);
            let next = step(state, h, slips);
            if self.moves(next, slips).0 * slips <= 0.0 {
                (state, time) = (next, time + h);
                continue;
            }
            let (mut before, mut beyond) = (0.0, h);
            for _ in 0..60 {
                let middle = 0.5 * (before + beyond);
                let back = self.moves(step(state, middle, slips), slips).0 * slips <= 0.0;
                if back { before = middle } else { beyond = middle }
            }
            (state, time) = (step(state, beyond, slips), time + beyond);
            turns.push(time);
            slips = -slips;
        }
        (state, turns)
    }

    /// Crank and rod as a tree; or with the rod on joints of its own, and a loop as the hinge between them.
    fn simulation(&self, in_loop: bool) -> Simulation {
        let Self { crank, rod, ball, mass, inertia, gravity, floor } = *self;
        let turns = |name: &str, parent: &str, x: f64| Part::hinge(name, parent, [0.0, -1.0, 0.0]).at([x, 0.0, 0.0]);
        let rod_on = |parent: &str, x: f64| {
            let foot = shape(&build::ball(ball), [rod[1], 0.0, 0.0], O);
            turns("rod", parent, x).com([rod[0], 0.0, 0.0]).weighing(mass, [inertia[1]; 3]).with(foot)
        };
        let slides =
            |name: &str, parent: &str, axis| Part::slider(name, parent, axis).limits(-9.0, 9.0, 9.0).massless();
        let crank_part = turns("crank", "base", 0.0).weighing(1.0, [inertia[0]; 3]);
        let chain = match in_loop {
            true => chain(&[crank_part, slides("a", "base", X), slides("b", "a", Z), rod_on("b", 0.0)]),
            false => chain(&[crank_part, rod_on("crank", crank)]),
        };
        let floor = surface("floor", half_space([0.0, 0.0, floor], Vector3::z()), newton(0.0, FRICTION));
        let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
        let frame = |link, x| LoopFrame::new(Some(link), [x, 0.0, 0.0], [0.0; 3]);
        let pin = LoopJoint::Pin { axis: Vector3::y() };
        let pin = Loop { name: "hinge".into(), joint: pin, frames: [frame("crank", crank), frame("rod", 0.0)] };
        let loops = if in_loop { vec![pin] } else { Vec::new() };
        Simulation { loops, gravity: Vector3::new(0.0, 0.0, -gravity), ..Simulation::new(chain, touches) }
    }
}

/// The foot of a slider-crank slides back and forth. At its dead points its slip is zero while the crank turns on, and friction only
/// changes its direction: times and motion are those of the equation of motion of the one angle, as a tree and as a loop.
#[test]
fn the_foot_of_a_slider_crank_passes_its_dead_points() {
    let slider = Slider::NEW;
    let (start, duration) = ([1.0, 26.0], 0.6);
    let (wanted, turns) = slider.after(start, duration);
    assert!(turns.len() > 3 && wanted[1] > 5.0, "{turns:?} {wanted:?}");
    let (rod, rod_rate) = slider.rod_at((start[0], start[1]));
    let (r, [a, v]) = (slider.crank, start);
    let states = [
        (false, vec![a, rod - a], vec![v, rod_rate - v]),
        (true, vec![a, r * a.cos(), r * a.sin(), rod], vec![v, -r * a.sin() * v, r * a.cos() * v, rod_rate]),
    ];
    for (in_loop, q, qd) in &states {
        let sim = slider.simulation(*in_loop);
        for (planar, tolerance) in
            [true, false].into_iter().flat_map(|planar| (4..=12).map(move |k| (planar, 10_f64.powi(-k))))
        {
            let zeno_time = Simulation::zeno_time_for(tolerance);
            let sim = Simulation { planar, tolerance, zeno_time, ..sim.clone() };
            let run = sim.run(q, qd, duration).unwrap();
            let told = format!("{tolerance:e}, loop {in_loop}, planar {planar}");
            let last = &run.summary.last;
            let off = [last.q[0] - wanted[0], last.qd[0] - wanted[1]];
            // Velocities change fast: by some hundred times as much in a second. The reference is rounded, too.
            let allowed = 20.0 * tolerance + 1e-11;
            assert!(off[0].abs() < allowed && off[1].abs() < 10.0 * allowed, "{off:?} at {told}");
            let balance = run.summary.energy;
            assert!(balance.error().abs() < allowed && balance.impacts.abs() < allowed, "{balance:?} at {told}");
            let slides = run.events.iter().all(|event| event.kind.name() == "sliding");
            let times = run.events.iter().map(|event| event.time).skip(1);
            let on_time = times.zip(&turns).all(|(time, turn)| (time - turn).abs() < allowed);
            assert!(slides && on_time && run.events.len() == 1 + turns.len(), "{told}: {turns:?} {:?}", run.events);
        }
    }
}

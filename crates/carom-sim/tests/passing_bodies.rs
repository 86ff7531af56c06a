//! Bodies with faces and edges that tumble past each other: no contact is missed, in free motion or beside one that lasts.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::{Energetic, Newton};
use carom_sim::{ContactRule, Sampling, Seen, Simulation, Surface, Touch};
use carom_testing::build::{O, floating_box, free, shape};
use carom_testing::scenes::{DOWN, newton, surface};
use nalgebra::{Isometry3, Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// A table 1 m wide, whose top is at z = 0, m.
const TABLE: Vector3<f64> = Vector3::new(1.0, 1.0, 0.5);

fn table(contact: ContactRule) -> Surface {
    let place = Isometry3::translation(0.0, 0.0, -0.25);
    let obstacle = Obstacle::cuboid(place, TABLE).unwrap();
    surface("table", obstacle, contact)
}

fn simulation(chain: Chain, contact: ContactRule) -> Simulation {
    let touches = Touch::all(&chain, &[table(contact)], 0.0).unwrap().touches;
    Simulation { gravity: DOWN, tolerance: 1e-8, ..Simulation::new(chain, touches) }
}

fn rotation(q: &[f64]) -> Matrix3<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5])).to_rotation_matrix().into_inner()
}

/// The greatest separation of the box and the table over the normals of their faces and the products of their edges: their distance
/// is at least this, and they overlap where it is negative (Gottschalk, Lin & Manocha 1996).
fn separation(half: Vector3<f64>, q: &[f64]) -> f64 {
    let turn = rotation(q);
    let apart = Vector3::new(q[0], q[1], q[2] + 0.25);
    let edges = (0..9).map(|k| turn.column(k % 3).cross(&Matrix3::identity().column(k / 3)));
    let faces = (0..3).flat_map(|k| [turn.column(k).into_owned(), Matrix3::identity().column(k).into_owned()]);
    let along = |n: Vector3<f64>| {
        let reach = half.dot(&(turn.transpose() * n).abs()) + 0.5 * TABLE.dot(&n.abs());
        n.dot(&apart).abs() - reach
    };
    faces.chain(edges).filter_map(|n| n.try_normalize(1e-6)).map(along).fold(f64::NEG_INFINITY, f64::max)
}

/// Boxes fall and tumble past the border of a table, with and without friction. At no time do the bodies overlap by more than the
/// error of the samples, and all losses of energy are those of impacts and friction.
#[test]
fn tumbling_boxes_do_not_pass_through_the_border_of_a_table() {
    let mut rng = fastrand::Rng::with_seed(4);
    let (mut struck, mut slid) = (0, 0);
    for k in 0..300 {
        let mut draw = |low: f64, high: f64| low + (high - low) * rng.f64();
        let size = Vector3::new(draw(0.1, 0.4), draw(0.1, 0.4), draw(0.05, 0.3));
        let contact = Energetic { restitution: 0.4 * f64::from(k % 2), friction: 0.4 * f64::from(k % 3) };
        let sim = simulation(floating_box([size.x, size.y, size.z], 2.0), ContactRule::new(contact));
        let turn = nalgebra::Vector4::from_fn(|_, _| draw(-1.0, 1.0)).normalize();
        let place = [draw(0.45, 0.65), draw(-0.1, 0.1), draw(0.2, 0.35)];
        let q = [&place[..], turn.as_slice()].concat();
        let qd = [draw(-0.8, 0.5), draw(-0.8, 0.8), draw(-1.0, 0.5), draw(-6.0, 6.0), draw(-6.0, 6.0), draw(-6.0, 6.0)];
        if separation(size / 2.0, &q) < 0.0 {
            continue;
        }
        let mut deepest = (0.0_f64, 0.0);
        let sampling = Sampling { every: Some(1e-3), ..Sampling::default() };
        let mut see = |seen: Seen| {
            if let Seen::Moment(moment) = seen {
                let gap = separation(size / 2.0, &moment.q);
                if gap < deepest.0 {
                    deepest = (gap, moment.time);
                }
            }
        };
        let run = sim.stream(&q, &qd, 0.5, sampling, &mut see).unwrap();
        // Samples between steps are as exact as the dense output; a contact that is missed overlaps by millimetres.
        assert!(deepest.0 > -1e-6, "start {k}: overlap of {} m at {} s", -deepest.0, deepest.1);
        let energy = run.energy.error().abs();
        // Time steps, which some corners at a border need, have a loss of their own.
        let exact = run.statistics.contact_steps == 0;
        assert!(!exact || energy < 1e-6 * run.energy.start.abs(), "start {k}: {energy} J");
        struck += usize::from(run.events > 0);
        slid += usize::from(run.events > 1);
    }
    assert!(struck > 150 && slid > 100, "{struck} boxes struck the table, {slid} more than once");
}

/// A cylinder falls on the edge of a table that is parallel to its axis: its rims strike at one time, and it moves as a ball with the
/// same inertia does in the plane across the edge.
#[test]
fn a_cylinder_along_an_edge_moves_as_a_ball_across_it() {
    let body = |element: &str| free(2.2, [0.05, 0.07, 0.05], &shape(element, O, [FRAC_PI_2, 0.0, 0.0]));
    let q = [0.55, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0];
    for (spin, friction) in [(0.0, 0.0), (-5.0, 0.5), (3.0, 0.8)] {
        let run = |shape: &str| {
            let sim = simulation(body(shape), newton(0.3, friction));
            sim.run(&q, &[0.2, 0.0, -0.5, 0.0, spin, 0.0], 0.3).unwrap()
        };
        let (cylinder, ball) = (run("<cylinder radius='0.26' length='0.3'/>"), run("<sphere radius='0.26'/>"));
        assert_eq!(cylinder.summary.statistics.contact_steps, 0);
        let strikes = |run: &carom_sim::Trajectory| run.events.first().map(|event| event.time);
        assert!((strikes(&cylinder).unwrap() - strikes(&ball).unwrap()).abs() < 1e-10);
        let (a, b) = (&cylinder.summary.last, &ball.summary.last);
        for (k, (a, b)) in a.q.iter().chain(&a.qd).zip(b.q.iter().chain(&b.qd)).enumerate() {
            assert!((a - b).abs() < 1e-7, "spin {spin}, number {k}: {a} against {b}");
        }
    }
}

/// A flat rod slides over the edge of a table without friction and turns about it, until its rear edge passes the edge of the table: a
/// corner that moves off a face does not strike it. Against the equations in the plane, with the rod's normal n and its tangent t: the
/// edge is at s = c·t from its centre and h below it, c̈·n + 2 ω c̈ₜ + ω̇ s − ω² h = 0 with forces along n.
#[test]
fn a_rod_that_slides_off_a_table_leaves_its_edge_without_an_impact() {
    let (length, h, mass) = (0.36, 0.006, 1.0);
    let inertia = mass * (length * length + 4.0 * h * h) / 12.0;
    for (start, speed) in [(0.02, 2.0), (0.03, 1.5), (0.05, 3.0)] {
        let chain = floating_box([length, 0.05, 2.0 * h], mass);
        let sim = simulation(chain, ContactRule::new(Newton { restitution: 0.3, friction: 0.0 }));
        let run = sim.run(&[0.5 + start, 0.0, h, 0.0, 0.0, 0.0, 1.0], &[speed, 0.0, 0.0, 0.0, 0.0, 0.0], 0.25).unwrap();
        assert!(
            run.events.iter().all(|event| ["sliding", "lift-off"].contains(&event.kind.name())),
            "{:?}",
            run.events
        );

        // y = x, z, θ, ẋ, ż, ω from the edge; θ lowers the front.
        let along = |y: &[f64; 6]| y[0] * y[2].cos() - y[1] * y[2].sin();
        let rate = |y: &[f64; 6]| {
            let (sine, cosine) = y[2].sin_cos();
            let (s, w) = (along(y), y[5]);
            let slides = y[3] * cosine - y[4] * sine;
            let push = (9.81 * cosine - 2.0 * w * slides + w * w * h) / (1.0 / mass + s * s / inertia);
            let push = if s < 0.5 * length { push } else { 0.0 };
            [y[3], y[4], w, push * sine / mass, push * cosine / mass - 9.81, push * s / inertia]
        };
        let mut y = [start, h, 0.0, speed, 0.0, 0.0];
        let step = |h: f64, y: &mut [f64; 6]| {
            let plus = |y: &[f64; 6], k: &[f64; 6], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
            let a = rate(y);
            let b = rate(&plus(y, &a, 0.5 * h));
            let c = rate(&plus(y, &b, 0.5 * h));
            let d = rate(&plus(y, &c, h));
            *y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        };
        let mut time = 0.0;
        while along(&y) < 0.5 * length {
            // The last steps end at the rear edge.
            let left = (0.5 * length - along(&y)) / (y[3] * y[2].cos() - y[4] * y[2].sin());
            let now = if left < 1e-11 { 1e-11 } else { left.min(1e-4) * 0.9 };
            step(now, &mut y);
            time += now;
        }
        let lift_off = run.events.last().unwrap().time;
        assert!((lift_off - time).abs() < 1e-8, "{lift_off} s for {time} s");
        let left = 0.25 - time;
        let last = &run.summary.last;
        let expected = [0.5 + y[0] + y[3] * left, y[1] + (y[4] - 0.5 * 9.81 * left) * left, y[5]];
        for (found, expected) in [last.q[0], last.q[2], last.qd[4]].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-7, "{found} for {expected}, from {start} m at {speed} m/s");
        }
    }
}

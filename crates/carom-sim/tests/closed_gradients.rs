//! Derivatives of whole runs against closed forms.

use carom_impact::{KelvinVoigt, Newton};
use carom_sim::{Compliance, ContactRule, Drive, Gains, Parameter, Pd, Scene, Simulation, Touch, Yielding};
use carom_testing::build::{self, Part, X, Y, Z, chain, falling_ball};
use carom_testing::mechanisms::{self, Cut, FourBar};
use carom_testing::scenes::{among, changed, half_space, newton, on_floor, surface, with_robots};
use nalgebra::{DMatrix, DVector, Vector3};
use std::f64::consts::PI;

/// A ball of radius 0.1 m on a vertical slider over the floor z = 0.
pub fn ball(contact: ContactRule) -> Simulation {
    on_floor(falling_ball(), contact)
}

/// Dropped from the height h, it falls with g − a and rises with g + a, where a is the dry friction of its slider over its mass. With v =
/// √(2 (g − a) h) and s = T − v/(g − a) it is at e v s − (g + a) s²/2 after its first bounce. Its derivatives by h, the initial velocity and e
/// in closed form; a difference of the drop without the event would be 1 by h. A block that friction holds beside it, which the impact does not
/// move, takes no digit from them; nor do differences of its position far from the zero of its slider.
#[test]
fn the_final_height_of_a_bouncing_ball_has_its_closed_form_gradient() {
    let (g, e, h, end) = (9.81_f64, 0.7, 0.8, 0.6);
    for (friction, away, beside) in [(0.0, 0.0, false), (0.0, 0.0, true), (3.0, 0.0, false), (3.0, 1000.0, false)] {
        let falls = Part::slider("ball", "base", Z).limits(-9.0, 1009.0, 0.0).at([0.0, 0.0, -away]);
        let falls = falls.joint(&format!("<dynamics friction='{friction}'/>"));
        let block = Part::slider("block", "base", X).limits(-9.0, 9.0, 0.0).joint("<dynamics friction='3'/>");
        let mut parts = vec![falls.weighing(2.0, [0.008; 3]).shaped(&build::ball(0.1))];
        parts.extend(beside.then(|| block.weighing(2.0, [0.01; 3]).at([0.0, 5.0, 5.0])));
        let n = parts.len();
        let sim = on_floor(chain(&parts), ContactRule::new(Newton { restitution: e, friction: 0.0 }));
        let (start, rest) = (&[away + h + 0.1, 0.0][..n], &[0.0; 2][..n]);
        let found = sim.sensitivity(start, rest, end, &[Parameter::restitution()]).unwrap();
        let (down, up) = (g - friction / 2.0, g + friction / 2.0);
        let v = (2.0 * down * h).sqrt();
        let s = end - v / down;
        let by_v = e * s - (e * v - up * s) / down; // of the height, by v, with ds/dv = −1/(g − a)
        let own = found.last_by.unwrap();
        let close = |column: usize, exact: f64| {
            let apart = own[(0, column)] - exact;
            assert!(apart.abs() < 1e-11, "{friction}, {away}, {beside}: {}: {apart:e}", found.names[column]);
        };
        close(0, by_v * down / v);
        close(2 * n, v * s);
        if friction == 0.0 {
            // A start upwards with u: v = √(2gh + u²), and the impact is later by u/g to first order.
            close(n, -(e * v - g * s) / g);
        }
        let event = &found.events[0];
        let told = (event.time - v / down).abs() < 1e-12 && (event.time_by[0] - 1.0 / v).abs() < 1e-11;
        assert!(told || away > 0.0, "{event:?}");
    }
}

/// A parallelogram without gravity whose coupler strikes a wall at the angle θ_w turns with −e times its rate then: θ(T) =
/// θ_w − e θ̇₀ T − e (θ₀ − θ_w). The loop turns its share of the impulse, and the jump of the velocities with it.
#[test]
fn a_struck_parallelogram_has_its_closed_form_gradient() {
    let (e, end, start, rate) = (0.6, 0.9, 2.0_f64, -1.7);
    let (chain, loops) = mechanisms::parallelogram(mechanisms::ball(0.5, 0.05), "");
    let wall = surface("wall", half_space([0.7, 0.0, 0.0], [-1.0, 0.0, 0.0]), newton(e, 0.0));
    let sim = Simulation { loops, tolerance: 1e-11, ..among(chain, &[wall]) };
    let at = 0.15_f64.acos();
    let [q, qd] = [start, rate].map(|x| [x, -x, x]);
    let found = sim.sensitivity(&q, &qd, end, &[Parameter::restitution()]).unwrap();
    let along = DMatrix::from_fn(7, 3, |i, j| match (i / 3, j) {
        (2, 2) => 1.0,
        (block, _) if block == j => [1.0, -1.0, 1.0][i % 3],
        _ => 0.0,
    });
    let by = found.last_by.unwrap() * &along;
    let exact = [[-e, -e * end, -rate * end - (start - at)], [0.0, -e, -rate]];
    for (row, exact) in exact.iter().enumerate() {
        for (j, exact) in exact.iter().enumerate() {
            for (k, sign) in [1.0, -1.0, 1.0].into_iter().enumerate() {
                let off = by[(3 * row + k, j)] - sign * exact;
                assert!(off.abs() < 1e-10, "row {row}, {j}, joint {k}: {off:e}");
            }
        }
    }
    let time_by = DVector::from_column_slice(&found.events[0].time_by).tr_mul(&along);
    for (j, exact) in [-1.0 / rate, (start - at) / (rate * rate), 0.0].into_iter().enumerate() {
        assert!((time_by[j] - exact).abs() < 1e-10, "time by {j}: {:e}", time_by[j] - exact);
    }
}

/// An elastic frictionless strike reverses a mechanism of one freedom: without gravity it goes back the way that it came. Its state at T is that
/// of the motion without the wall at 2 t₁ − T, with the opposite rates, and t₁ is where that motion meets the wall. The tangent of its loop turns, so
/// that the jump turns with it.
#[test]
fn a_struck_four_bar_has_the_gradient_of_its_way_back() {
    let bar = FourBar { crank: 0.3, coupler: 0.9, rocker: 0.8, ground: 0.7 };
    let [start, rates] = bar.state(Cut::Joint, 0.9, 3.0);
    let at = |wall: &[carom_sim::Surface], stop: &str| {
        let chain = bar.chain(Cut::Joint, [String::new(), mechanisms::ball(0.5, 0.05), String::new()], [stop, "", ""]);
        let touches = Touch::all(&chain, wall, 1.0).unwrap().touches;
        let loops = vec![bar.closure(Cut::Joint, mechanisms::pin())];
        Simulation { loops, tolerance: 1e-12, ..Simulation::new(chain, touches) }
    };
    // A wall that the ball meets at the crank angle 1.2, square to its velocity there; and a stop of the crank.
    let free = at(&[], "");
    let [there, velocities] = bar.state(Cut::Joint, 1.2, 3.0);
    let mut workspace = free.chain.workspace();
    let kin = workspace.update(&free.chain, &there).unwrap();
    let ball = free.chain.point(free.chain.frame("coupler").unwrap(), Vector3::new(0.5, 0.0, 0.0));
    let (place, velocity) = (kin.position(ball), kin.point_velocity(ball, &velocities).unwrap());
    let normal = -velocity.normalize();
    let wall = surface("wall", half_space(place - 0.05 * normal, normal), newton(1.0, 0.0));
    let stop = r#"<limit lower="-20" upper="1.2" effort="0" velocity="0"/>"#;
    for sim in [at(&[wall], ""), at(&[], stop)] {
        let end = 0.18;
        let found = sim.sensitivity(&start, &rates, end, &[]).unwrap();
        let [event] = &found.events[..] else { panic!("{:?}", found.events) };
        let back = free.sensitivity(&start, &rates, 2.0 * event.time - end, &[]).unwrap();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(found.last.q.iter().zip(&back.last.q).all(|(a, b)| close(*a, *b)), "{:?} {:?}", found.last, back.last);
        let (own, other) = (found.last_by.unwrap(), back.last_by.unwrap());
        for j in 0..6 {
            for k in 0..6 {
                let sign = if k < 3 { 1.0 } else { -1.0 };
                let exact = sign * (other[(k, j)] + 2.0 * back.rate[k] * event.time_by[j]);
                let off = (own[(k, j)] - exact).abs();
                assert!(off < 1e-8, "{:?}, {k} by {j}: {off:e} of {exact}", event.kinds);
            }
        }
    }
}

/// The last impacts before an accumulation are slow, and the errors of their times are divided by their speed: the derivative by the height is
/// right to 1e-5 of its size, or it is not a number. With v₀ = √(2 g h), impact n is at (1 + 2 (e + … + eⁿ)) v₀/g.
#[test]
fn times_of_the_last_impacts_before_rest_have_right_derivatives_or_none() {
    let (g, e, h) = (9.81_f64, 0.6, 0.3);
    let sim = ball(ContactRule::new(Newton { restitution: e, friction: 0.0 }));
    let found = sim.sensitivity(&[h + 0.1], &[0.0], 1.5, &[]).unwrap();
    let (mut told, mut faint, mut bounces, mut power) = (0, 0, 0.0, 1.0);
    for event in found.events.iter().filter(|event| event.kinds.contains(&"impact")) {
        // d√(2 g h)/dh / g.
        let exact = (1.0 + 2.0 * bounces) / (2.0 * g * h).sqrt();
        power *= e;
        bounces += power;
        if event.time_by[0].is_nan() {
            faint += 1;
        } else {
            told += 1;
            assert!((event.time_by[0] - exact).abs() < 1e-8 * exact, "{event:?}, {exact}");
        }
    }
    assert!(told > 5 && faint > 0, "{told} told, {faint} not");
}

/// Two equal balls on a line exchange their velocities: the final velocity of each is the initial one of the other.
#[test]
fn an_elastic_pair_exchanges_its_gradients() {
    let body = |name: &str| Part::slider(name, "base", X).weighing(1.0, [0.004; 3]).shaped(&build::ball(0.1));
    let chain = chain(&[body("one"), body("other")]);
    let touches = Touch::between(&chain, "one", "other", &newton(1.0, 0.0)).unwrap();
    let sim = Simulation::new(chain, touches);
    // They meet at (1 − 0.2)/2 s; then one stands at the place of the meeting less the radius.
    let found = sim.sensitivity(&[0.0, 1.0], &[2.0, 0.0], 1.0, &[]).unwrap();
    let own = found.last_by.unwrap();
    // Positions after: x₁ = y + v₂ T − 0.2, x₂ = x + v₁ T + 0.2.
    let exact = DMatrix::from_row_slice(4, 4, &[0., 1., 0., 1., 1., 0., 1., 0., 0., 0., 0., 1., 0., 0., 1., 0.]);
    assert!((&own - &exact).amax() < 1e-11, "{own}");
}

/// A parameter of a user: gravity. The time of the fall is √(2h/g).
#[test]
fn a_users_parameter_is_differentiated() {
    let sim = ball(ContactRule::default());
    let gravity = Parameter::new("gravity", 10.0, |sim, delta| sim.gravity.z -= delta);
    let found = sim.sensitivity(&[0.6], &[0.0], 0.5, &[gravity]).unwrap();
    let time = (2.0 * 0.5 / 9.81_f64).sqrt();
    assert!((found.events[0].time_by[2] + 0.5 * time / 9.81).abs() < 1e-9, "{:?}", found.events);
    assert_eq!(found.names, ["q jl1", "qd jl1", "gravity"]);
}

/// A block of 2 kg on a slider with dry friction of 3 N.
fn slider() -> Simulation {
    let block = Part::slider("block", "base", X).limits(-9.0, 9.0, 0.0).joint("<dynamics friction='3'/>");
    let chain = chain(&[block.weighing(2.0, [0.01; 3])]);
    Simulation { tolerance: 1e-10, ..Simulation::new(chain, Vec::new()) }
}

/// A slider that dry friction stops: with the deceleration a the place is q + v²/2a and the time v/a, whatever follows.
#[test]
fn a_slider_that_friction_stops_has_the_derivatives_of_its_closed_form() {
    let sim = slider();
    let (v, a) = (1.2, 3.0 / 2.0);
    let found = sim.sensitivity(&[0.1], &[v], 1.0 + v / a, &[]).unwrap();
    assert!((found.last.q[0] - 0.1 - v * v / (2.0 * a)).abs() < 1e-9);
    let by = found.last_by.expect("derivatives of the end");
    let expected = DMatrix::from_row_slice(2, 2, &[1.0, v / a, 0.0, 0.0]);
    assert!((&by - &expected).amax() < 1e-7, "{by} {expected}");
    assert!((found.events[0].time_by[1] - 1.0 / a).abs() < 1e-7, "{:?}", found.events);
}

/// A slider at rest that the force F moves against dry friction f has the derivatives of starts in its direction; those in the other
/// one are braked first, and end with the slope (F − f)/(F + f) by their velocity.
#[test]
fn a_slider_that_begins_to_move_at_the_start_has_the_derivatives_of_the_side_of_its_motion() {
    let sim = Simulation { gravity: Vector3::new(2.5, 0.0, 0.0), ..slider() };
    let (f, force, end, h) = (3.0, 5.0, 0.5, 1e-4);
    let by = sim.sensitivity(&[0.1], &[0.0], end, &[]).unwrap().last_by.unwrap();
    let expected = DMatrix::from_row_slice(2, 2, &[1.0, end, 0.0, 1.0]);
    assert!((&by - &expected).amax() < 1e-7, "{by} {expected}");
    let speed = |start: f64| sim.run(&[0.1], &[start], end).unwrap().summary.last.qd[0];
    for (start, slope) in [(h, 1.0), (-h, (force - f) / (force + f))] {
        assert!(((speed(start) - speed(0.0)) / start - slope).abs() < 1e-7, "{start}");
    }
}

/// Closed form: a hinge that a stiff controller holds at its target is at rest, with the longest steps, and the motion beside it is a damped
/// oscillation of hundreds of rad/s: x″ = −(k x + d x′)/I.
#[test]
fn a_motion_at_rest_has_the_derivatives_of_the_fast_one_beside_it() {
    let inertia = 0.1;
    let arm = chain(&[Part::hinge("arm", "base", Y).weighing(1.0, [inertia; 3])]);
    for (k, d, time) in [(2e4, 20.0, 0.1), (2e4, 20.0, 1.0), (2e3, 10.0, 0.25), (50.0, 40.0, 2.0)] {
        let (kp, kd, target) = (Gains::Same(k), Gains::Same(d), vec![0.3]);
        let drive = Drive::Pd(Pd { kp, kd, target });
        let sim = Simulation { gravity: Vector3::zeros(), drive, ..Simulation::new(arm.clone(), Vec::new()) };
        let found = sim.sensitivity(&[0.3], &[0.0], time, &[]).unwrap();
        let (a, w) = (d / (2.0 * inertia), k / inertia - (d / (2.0 * inertia)).powi(2));
        // cos and sin, or cosh and sinh, of √|w| t.
        let root = w.abs().sqrt();
        let (c, s) = if w > 0.0 {
            ((root * time).cos(), (root * time).sin() / root)
        } else {
            ((root * time).cosh(), (root * time).sinh() / root)
        };
        let decay = (-a * time).exp();
        let exact = [[c + a * s, s], [-k / inertia * s, c - a * s]].map(|row| row.map(|x| decay * x));
        let by = found.last_by.unwrap();
        for (i, row) in exact.iter().enumerate() {
            for (j, exact) in row.iter().enumerate() {
                // In units in which both coordinates of the oscillation have the same size.
                let unit = [1.0, (k / inertia).sqrt()];
                let error = (by[(i, j)] - exact).abs() * unit[j] / unit[i];
                assert!(error < 1e-7, "k {k}, d {d}, {time} s, {i} {j}: {} for {exact}", by[(i, j)]);
            }
        }
    }
}

/// Restitution 1 and friction 0 have neighbours on one side only: the derivatives there are those on this side.
#[test]
fn numbers_at_an_end_of_their_range_have_the_derivative_on_the_side_that_there_is() {
    let by = |scene: &Scene, path: &str, duration: f64| {
        let found = scene.plan().unwrap().sensitivity(duration, &[scene.parameter(path).unwrap()]).unwrap();
        assert!(found.broken.is_none(), "{path}: {:?}", found.broken);
        found.last_by.unwrap().column(12).into_owned()
    };
    let elastic = changed("bounce", &[("restitution = 0.8", "restitution = 1")]);
    // From 1 m: z = e v (T − t) − ½ g (T − t)².
    let (g, end) = (9.81_f64, 0.8);
    let (strike, speed) = ((2.0 / g).sqrt(), (2.0 * g).sqrt());
    let found = by(&elastic, "contact.restitution", end);
    for (k, expected) in [(2, speed * (end - strike)), (8, speed)] {
        assert!((found[k] - expected).abs() < 1e-8, "{k}: {} {expected}", found[k]);
    }
    // A box that slides: ẋ = 1 − μ g t.
    let slides = with_robots(
        "[robot]\nurdf = \"box.urdf\"\nfloating = true\nq = [0, 0, 0.025, 0, 0, 0, 1]\nqd = [1, 0, 0, 0, 0, 0]\n\
         [[surface]]\nshape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }\n\
         [contact]\nlaw = \"newton\"\nfriction = 0\n[run]\nduration = 0.2\n",
    )
    .unwrap();
    let found = by(&slides, "contact.friction", 0.2);
    for (k, expected) in [(0, -0.5 * g * 0.04), (6, -g * 0.2)] {
        assert!((found[k] - expected).abs() < 1e-8, "{k}: {} {expected}", found[k]);
    }
}

/// Without gravity a ball leaves a compliant floor with e v. Its force vanishes after a time τ that does not depend on v, at the penetration d:
///
/// | | ω², ζ | τ | d |
/// | --- | --- | --- | --- |
/// | Kelvin & Voigt | k/m, as e asks | 2 acos ζ/(√(1 − ζ²) ω) | c e v/k = 2 ζ e v/ω |
/// | Walton & Braun | k/m | ½ π (1 + e)/ω | (1 − e²) v/ω |
///
/// So it is at −d + e v (T − h/v − τ) at the end, with d and τ proportional to 1/√k.
#[test]
fn a_bounce_whose_force_vanishes_before_it_opens_has_its_closed_form_gradient() {
    let (m, k, e, v, h, end) = (2.0_f64, 5e3, 0.6, 1.5, 0.3, 0.5);
    let omega = (k / m).sqrt();
    for normal in [Yielding::KelvinVoigt { pulls: false }, Yielding::WaltonBraun] {
        let law = Newton { restitution: e, friction: 0.0 };
        let compliance = Some(Compliance { normal, ..Compliance::new(k) });
        let sim = ball(ContactRule { compliance, ..ContactRule::new(law) });
        let sim = Simulation { gravity: Vector3::zeros(), ..sim };
        let stiffness =
            Parameter::new("k", k, |sim, delta| sim.touches[0].contact.compliance.as_mut().unwrap().stiffness += delta);
        let found = sim.sensitivity(&[h + 0.1], &[-v], end, &[stiffness]).unwrap();
        let (tau, d) = if normal == Yielding::WaltonBraun {
            (0.5 * PI * (1.0 + e) / omega, (1.0 - e * e) * v / omega)
        } else {
            let zeta = KelvinVoigt::new(k, e).unwrap().damping_ratio();
            (2.0 * zeta.acos() / ((1.0 - zeta * zeta).sqrt() * omega), 2.0 * zeta * e * v / omega)
        };
        let kinds: Vec<_> = found.events.iter().flat_map(|event| &event.kinds).copied().collect();
        assert_eq!(kinds, ["pressing", "lift-off"]);
        let last = -d + e * v * (end - h / v - tau);
        assert!((found.last.q[0] - 0.1 - last).abs() < 1e-9, "{normal:?}: {} {last}", found.last.q[0] - 0.1);
        let by = found.last_by.unwrap();
        // By a share of k, not by 1 N/m.
        let exact = [[-e, 0.0], [d / v - e * (end - tau), -e], [0.5 * (d + e * v * tau), 0.0]];
        for (j, (exact, unit)) in exact.iter().zip([1.0, 1.0, k]).enumerate() {
            for (row, exact) in exact.iter().enumerate() {
                let apart = by[(row, j)] * unit - exact;
                // Twice the tolerance of the run.
                assert!(apart.abs() < 2e-9, "{normal:?} {row} by {}: {apart:e} of {exact}", found.names[j]);
            }
        }
    }
}

/// Without gravity a ball leaves a floor at z₀ with e v, a time τ(v) after it has touched it: it is at z₀ + e v (T − (h − z₀)/v − τ) at the end, with
/// the derivatives 1 + e by z₀ and −e by h whatever the force. While the contact lasts they are up to √(k/m) times as large, in 1/s: they lose so
/// many digits. Depths are micrometres, and z₀ = 0 gives no size for the step of a difference.
#[test]
fn a_stiff_bounce_has_its_closed_form_gradient_by_the_height_of_the_floor() {
    let (e, v) = (0.6, 2.3);
    for force in ["hunt-crossley", "kelvin-voigt", "walton-braun"] {
        for stiffness in [1e4, 1e6, 1e8] {
            let start = format!("qd = [0, 0, -{v}, 0, 0, 0]");
            let law = format!("restitution = {e}\ncompliance = {{ force = \"{force}\", stiffness = {stiffness:e} }}");
            let scene = changed(
                "bounce",
                &[
                    ("qd = [0, 0, 0, 0, 0, 0]", &start),
                    ("restitution = 0.8", &law),
                    ("gravity = [0, 0, -9.81]", "gravity = [0, 0, 0]"),
                ],
            );
            let height = scene.parameter("surface[0].shape.halfspace.point[2]").unwrap();
            let by = scene.plan().unwrap().sensitivity(0.6, &[height]).unwrap().last_by.unwrap();
            for (row, column, exact) in [(2, 2, -e), (8, 2, 0.0), (2, 12, 1.0 + e), (8, 12, 0.0)] {
                let apart: f64 = by[(row, column)] - exact;
                assert!(
                    apart.abs() < 1e-7 * f64::sqrt(stiffness),
                    "{force}, {stiffness:e}: {row} by {column}: {apart:e} of {exact}"
                );
            }
        }
    }
}

//! The paper's arm compared with formulas that are written out here and do not use the chain.
//!
//! | symbol | value or meaning |
//! | --- | --- |
//! | p₁, p₂, p₃ | 3.473, 0.196, 0.242 kg m²: M = [[p₁ + 2p₃c, p₂ + p₃c], [p₂ + p₃c, p₂]], c = cos q₂ |
//! | L | 0.45 m, the length of each link |
//! | r | 1 µm, the radius of the ball that is the tip |
//! | n | (−1, 0), the normal of the wall |

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use carom_impact::Frictionless;
use carom_sim::Impacts;
use carom_sim::{Drive, Event, EventKind, Integrator, Scene, Simulation, Trajectory};
use carom_testing::build::planar2_mass;
use carom_testing::files::ROOT;
use carom_testing::numeric::rk4;
use nalgebra::{Matrix2, Vector2, Vector3};

const P3: f64 = 0.242;
const L: f64 = 0.45;
const R: f64 = 1e-6;
const WALL: f64 = 0.6364;
const E: f64 = 0.35;
const G: f64 = 9.81;

/// (q₁, q₂, q̇₁, q̇₂)
type State = [f64; 4];

/// M q̈ = p₃ sin q₂ (q̇₂(2q̇₁ + q̇₂), −q̇₁²)
fn rate([_, b, va, vb]: State) -> State {
    let force = Vector2::new(vb * (2.0 * va + vb), -va * va) * P3 * b.sin();
    let acceleration = planar2_mass(b).try_inverse().unwrap() * force;
    [va, vb, acceleration[0], acceleration[1]]
}

/// Gap between tip and wall.
fn gap(y: State) -> f64 {
    WALL - R - L * (y[0].cos() + (y[0] + y[1]).cos())
}

/// J of the contact point, at distance r from the centre of the tip.
fn jacobian(q: &[f64]) -> Matrix2<f64> {
    let (elbow, fore) =
        (L * Vector2::new(q[0].cos(), q[0].sin()), L * Vector2::new((q[0] + q[1]).cos(), (q[0] + q[1]).sin()));
    let turned = |arm: Vector2<f64>| Vector2::new(-arm.y, arm.x);
    let fore = fore + Vector2::new(R, 0.0);
    Matrix2::from_columns(&[turned(elbow + fore), turned(fore)])
}

/// Eqs (10)–(15): H = J M⁻¹ Jᵀ, p = −(1+e) uₙ/(nᵀHn), q̇⁺ = q̇⁻ + M⁻¹Jᵀn p.
fn after_impact(y: State) -> Vector2<f64> {
    let (j, inverse, n) = (jacobian(&y[..2]), planar2_mass(y[1]).try_inverse().unwrap(), Vector2::new(-1.0, 0.0));
    let qd = Vector2::new(y[2], y[3]);
    let h = j * inverse * j.transpose();
    let p = -(1.0 + E) * n.dot(&(j * qd)) / n.dot(&(h * n));
    qd + inverse * j.transpose() * n * p
}

/// Time and state when the gap closes: RK4 steps of 10 µs, the last one found by bisection.
fn until_touch(mut y: State) -> (f64, State) {
    let (mut steps, h) = (0.0, 1e-5);
    while gap(rk4(rate, y, h)) > 0.0 {
        (steps, y) = (steps + 1.0, rk4(rate, y, h));
    }
    let (mut low, mut high) = (0.0, h);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if gap(rk4(rate, y, middle)) > 0.0 { low = middle } else { high = middle }
    }
    (steps * h + high, rk4(rate, y, high))
}

fn scene() -> Scene {
    Scene::from_file(format!("{ROOT}/scenes/planar2.toml")).unwrap()
}

fn first_impact(run: &Trajectory) -> &Event {
    let event = &run.events[0];
    assert!(matches!(event.kind, EventKind::Impact { .. }), "{event:?}");
    event
}

/// The scene starts some micrometres before the wall, and some millimetres before it when the start is moved back in time.
#[test]
fn time_and_velocities_of_the_impact_match_the_closed_form() {
    let scene = scene();
    let at_wall: State = [scene.q[0], scene.q[1], scene.qd[0], scene.qd[1]];
    let u = jacobian(&scene.q) * Vector2::new(scene.qd[0], scene.qd[1]);
    assert!(
        (u - Vector2::new(0.2, -0.2) * 0.5_f64.sqrt()).norm() < 1e-6,
        "0.2 m/s at 45°, except for the radius of the ball: {u}"
    );
    for back in [0.0, 0.02, 0.05] {
        let start = (0..1000).fold(at_wall, |y, _| rk4(rate, y, -back / 1000.0));
        let (time, y) = until_touch(start);
        let run = scene.simulation.run(&start[..2], &start[2..], 0.2).unwrap();
        let event = first_impact(&run);
        // The scene's tolerance is 1e-9 for each step; the error of RK4 is far below it, (10 µs)⁴.
        assert!((event.time - time).abs() < 1e-10, "back {back}: {} against {time}", event.time);
        let close = |got: &[f64], want: &[f64]| {
            got.len() == want.len() && got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-10)
        };
        assert!(close(&event.q, &y[..2]) && close(&event.qd_minus, &y[2..]), "back {back}: {event:?} against {y:?}");
        let plus = after_impact(y);
        assert!(close(&event.qd_plus, plus.as_slice()), "back {back}: {:?} against {plus}", event.qd_plus);
        assert!((plus - Vector2::new(y[2], y[3])).norm() > 0.1, "the velocities jump");
    }
}

/// The velocity jump of the event equals that of a single impact at the same state. The contact point is given in the axes
/// of the tip.
#[test]
fn an_impact_in_a_scene_equals_the_single_impact_at_its_state() {
    let Scene { simulation: Simulation { chain, .. }, .. } = &scene();
    let scene = scene();
    let run = scene.simulation.run(&scene.q, &scene.qd, scene.duration).unwrap();
    let event = first_impact(&run);
    let tip = chain.frame("tip").unwrap();
    let mut workspace = chain.workspace();
    let turn = workspace.update(chain, &event.q).unwrap().pose(tip).rotation;
    let offset = turn.transpose() * Vector3::x() * R;
    let strike = chain.impact(&event.q, &event.qd_minus).at(tip).offset(offset).normal([-1.0, 0.0, 0.0]);
    let hit = strike.resolve(&Frictionless { restitution: E }).unwrap();
    for (a, b) in event.qd_plus.iter().zip(&hit.qd_plus) {
        // Both have the rounding of M⁻¹, whose condition number is about 20.
        assert!((a - b).abs() < 1e-14, "{a} against {b}");
    }
}

/// ½ q̇ᵀMq̇ + g (m₁c₁ + m₂L) sin q₁ + g (p₃/L) sin(q₁ + q₂)
fn energy(state: &[f64]) -> f64 {
    let qd = Vector2::new(state[2], state[3]);
    let first_moment = 5.0 * 0.18 + (12.0 + 2.689) * L;
    0.5 * qd.dot(&(planar2_mass(state[1]) * qd))
        + G * (first_moment * state[0].sin() + P3 / L * (state[0] + state[1]).sin())
}

/// One minute under gravity against a nearly elastic wall: the energy is constant between impacts.
#[test]
fn energy_changes_at_impacts_only() {
    let mut sim = scene().simulation;
    sim.gravity = Vector3::new(0.0, -G, 0.0);
    sim.touches.iter_mut().for_each(|touch| touch.contact.law = Frictionless { restitution: 0.99 }.into());
    for tolerance in [1e-9, 1e-12] {
        sim.tolerance = tolerance;
        let start = [-1.0, 0.3, 1.5, 0.0];
        let run = sim.run(&start[..2], &start[2..], 60.0).unwrap();
        let (mut k, mut level, mut worst) = (0, energy(&start), 0.0_f64);
        for segment in &run.segments {
            while run.events.get(k).is_some_and(|event| event.time <= segment.start) {
                level = energy(&[run.events[k].q.as_slice(), &run.events[k].qd_plus].concat());
                k += 1;
            }
            for state in &segment.states {
                worst = worst.max((energy(state) - level).abs());
            }
        }
        assert!(k > 20, "{k} impacts");
        // Each of some tens of steps between two impacts has an error of the tolerance; energies are up to 70 J.
        assert!(worst < 1e3 * tolerance, "{worst} J at {tolerance}");
    }
}

/// Damped joints, a PD controller that pulls the tip into the wall, and gravity: the error of the energy balance is that of
/// the integration.
#[test]
fn energy_balance_closes_to_the_integration_error() {
    let text = std::fs::read_to_string(format!("{ROOT}/robots/planar2.urdf")).unwrap();
    let damped = text.replace("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 1\"/><dynamics damping=\"0.5\"/>");
    let mut sim = scene().simulation;
    let tip = sim.touches.iter().find(|touch| touch.link() == Some("tip")).unwrap().clone();
    sim = Simulation {
        chain: Chain::from_urdf_str(&damped, &LoadOptions::default()).unwrap(),
        touches: vec![tip],
        ..sim
    };
    assert!(sim.chain.joints().iter().filter(|joint| joint.damping == 0.5).count() == 2);
    sim.gravity = Vector3::new(0.0, -G, 0.0);
    for tolerance in [1e-7, 1e-9, 1e-11] {
        sim.tolerance = tolerance;
        sim.drive = Drive::Pd(carom_sim::Pd { kp: 60.0.into(), kd: 1.0.into(), target: vec![0.4, -0.6] });
        let run = sim.run(&[0.9, -1.7], &[0.0, 0.0], 5.0).unwrap();
        let balance = run.summary.energy;
        assert!(run.events.iter().any(|event| event.kind.name() == "zeno") && run.events.len() > 20);
        let terms = [balance.drive, balance.resistance, balance.impacts];
        assert!(terms.iter().all(|term| term.abs() > 10.0), "no term of the balance is small: {balance:?}");
        // Terms of about 100 J, each computed to the tolerance.
        assert!(balance.error().abs() < 100.0 * tolerance, "{} J at {tolerance}", balance.error());
    }
}

/// The error of the implicit integrator is below its tolerance times the number of steps.
#[test]
fn radau_keeps_its_tolerance() {
    let free =
        Simulation { touches: Vec::new(), gravity: Vector3::new(0.0, -G, 0.0), max_step: 1.0, ..scene().simulation };
    let end = |integrator, tolerance| {
        let sim = Simulation { integrator, tolerance, ..free.clone() };
        sim.run(&[0.85, -1.65], &[-0.3, 1.5], 0.4).unwrap().summary.last
    };
    let exact = end(Integrator::DormandPrince, 1e-13);
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12] {
        let last = end(Integrator::Radau, tolerance);
        for (a, b) in last.q.iter().zip(&exact.q) {
            // The errors of 15 to 200 steps add up, each below the tolerance.
            assert!((a - b).abs() < 10.0 * tolerance, "{a} against {b} at {tolerance}");
        }
    }
}

//! Surfaces that move: harmonic motion, tables of velocities, belts and turntables.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::Newton;
use carom_sim::{
    Belt, ContactLaw, ContactRule, Oscillation, Profile, Sampling, Seen, SimError, Simulation, Surface, SurfaceMotion,
    Touch,
};
use carom_testing::build::{Part, X, Y, Z, along, ball, chain};
use carom_testing::scenes::{G, among, level as ground, surface};
use nalgebra::Vector3;

/// s + ω⁻² s̈ = 0, and ṡ² + ω² s² = (amplitude · ω)² in each direction.
#[test]
fn an_oscillation_solves_the_equation_of_a_harmonic_oscillator() {
    let amplitude = Vector3::new(0.3, -0.2, 0.05);
    for (frequency, phase) in [(3.0, 0.4), (0.5, -2.0), (-3.0, 0.4)] {
        for time in [-0.7, 0.0, 0.3, 2.0] {
            let [place, velocity, acceleration] = Oscillation { amplitude, frequency, phase }.at(time);
            let wanted = place * (-frequency * frequency);
            assert!(place.norm() > 0.01, "the displacement is too small to see the sign of the acceleration");
            assert!((acceleration - wanted).amax() < 1e-15 * wanted.amax().max(1.0), "{acceleration} {wanted}");
            let energy = velocity.component_mul(&velocity) + place.component_mul(&place) * frequency * frequency;
            let exact = amplitude.component_mul(&amplitude) * frequency * frequency;
            assert!((energy - exact).amax() < 1e-15, "{energy} {exact}");
            // The velocity is the derivative of the displacement: a central difference has the error ω³ h²/6.
            let h = 1e-5;
            let [after, before] = [h, -h].map(|h| Oscillation { amplitude, frequency, phase }.at(time + h)[0]);
            assert!(((after - before) / (2.0 * h) - velocity).amax() < 1e-9, "{velocity}");
        }
    }
}

/// A body that moves along the axes without turning, with a ball of 5 cm about its centre; mass 2 kg.
fn glider(axes: &[[f64; 3]]) -> Chain {
    along(axes, 2.0, [1.0; 3], &ball(0.05))
}

fn on(chain: Chain, obstacle: Obstacle, law: impl Into<ContactLaw>, motion: SurfaceMotion) -> Simulation {
    let ground = Surface { motion: Some(motion), ..surface("ground", obstacle, ContactRule::new(law)) };
    Simulation { tolerance: 1e-11, ..among(chain, &[ground]) }
}

fn belt(velocity: Profile<6>) -> SurfaceMotion {
    SurfaceMotion::Belt(Belt { velocity, centre: Vector3::new(0.1, -0.2, 0.0) })
}

/// On a belt of speed v a body slips for v/(μ g), over half of the path of the belt, and is then carried.
#[test]
fn a_body_on_a_belt_slips_for_v_over_mu_g() {
    let (v, mu) = (0.6, 0.25);
    let along = belt(Profile::constant([v, 0.0, 0.3, 0.0, 0.0, 0.0])); // the part normal to the ground is ignored
    let sim = on(glider(&[X, Y, Z]), ground(), Newton { restitution: 0.0, friction: mu }, along);
    let run = sim.run(&[0.0, 0.0, 0.05], &[0.0; 3], 1.0).unwrap();
    let slip = v / (mu * G);
    let stick = run.events.iter().find(|event| event.kind.name() == "sticking").unwrap();
    assert!((stick.time - slip).abs() < 1e-10, "{} {slip}", stick.time);
    let last = &run.summary.last;
    assert!((last.q[0] - v * (1.0 - slip / 2.0)).abs() < 1e-10 && last.q[1].abs() < 1e-12, "{last:?}");
    // The belt gives the kinetic energy ½ m v² and as much heat: its work on the body is booked as that of contacts.
    let energy = run.summary.energy;
    assert!((energy.resistance - v * v).abs() < 1e-9 && energy.error().abs() < 1e-9, "{energy:?}");
}

/// On a turntable whose speed is a table, a body that sticks turns by the integral of its angular velocity; it leaves its
/// place when |a| = √((ω²r)² + (ω̇r)²) reaches μ g.
#[test]
fn a_body_on_a_turntable_follows_it_until_friction_is_spent() {
    let spin = |w: f64| [0.0, 0.0, 0.0, 0.0, 0.0, w];
    let (mu, r, rate) = (0.5, 0.4, 2.0);
    let table =
        Profile::new(&[0.0, 1.0, 1.25, 9.0], &[spin(1.0), spin(2.0), spin(2.0), spin(2.0 + rate * 7.75)]).unwrap();
    let chain = glider(&[X, Y, Z]);
    let sim = on(chain, ground(), Newton { restitution: 0.0, friction: mu }, belt(table));
    // The centre is (0.1, −0.2).
    let run = sim.run(&[0.1 + r, -0.2, 0.05], &[0.0, r, 0.0], 3.0).unwrap();
    let moment = run.at(&sim.chain, 1.2);
    let angle: f64 = 1.5 + 2.0 * 0.2;
    let place = [0.1 + r * angle.cos(), -0.2 + r * angle.sin()];
    assert!((0..2).all(|k| (moment.q[k] - place[k]).abs() < 1e-8), "{moment:?} {place:?}");
    let speed = ((mu * G / r).powi(2) - rate * rate).powf(0.25);
    let slides = run.events.iter().find(|event| event.kind.name() == "sliding").unwrap();
    assert!((slides.time - (1.25 + (speed - 2.0) / rate)).abs() < 1e-7, "{} {speed}", slides.time);
}

/// A wall that accelerates meets a body after √(2d/a) and, elastic, gives it twice its speed.
#[test]
fn a_wall_with_a_table_of_velocities_hits_a_body_at_rest() {
    let (d, a) = (0.2, 1.6);
    let motion = SurfaceMotion::Translation(Profile::new(&[0.0, 10.0], &[[0.0; 3], [10.0 * a, 0.0, 0.0]]).unwrap());
    let wall = Obstacle::half_space(Vector3::new(-d - 0.05, 0.0, 0.0), Vector3::x()).unwrap();
    let mut sim = on(glider(&[X]), wall, Newton { restitution: 1.0, friction: 0.0 }, motion);
    sim.gravity = Vector3::zeros();
    let run = sim.run(&[0.0], &[0.0], 1.0).unwrap();
    let time = (2.0 * d / a).sqrt();
    assert!((run.events[0].time - time).abs() < 1e-12, "{} {time}", run.events[0].time);
    assert!((run.events[0].qd_plus[0] - 2.0 * a * time).abs() < 1e-12);
}

/// A body rests on a ball that is lifted with a table of velocities: N = m (g + a), on both sides of every row.
#[test]
fn the_force_on_a_lift_jumps_with_its_acceleration() {
    let rows = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.6], [0.0, 0.0, -0.3]];
    let motion = SurfaceMotion::Translation(Profile::new(&[0.2, 0.5, 0.7], &rows).unwrap());
    let lift = Obstacle::sphere(Vector3::zeros(), 0.15).unwrap();
    let law = Newton { restitution: 0.0, friction: 0.0 };
    for obstacle in [lift, ground()] {
        let height = if matches!(obstacle.surface(), carom_contact::Surface::HalfSpace { .. }) { 0.05 } else { 0.2 };
        let sim = on(glider(&[Z]), obstacle, law, motion.clone());
        let mut forces = Vec::new();
        let sampling = Sampling { every: Some(0.0125), ..Sampling::default() };
        sim.stream(&[height], &[0.0], 0.8, sampling, &mut |seen| {
            if let Seen::Contacts(time, states) = seen {
                forces.push((time, states[0].normal_force));
            }
        })
        .unwrap();
        assert!(forces.len() > 60, "{}", forces.len());
        for (time, force) in forces {
            let near = [0.2, 0.5, 0.7].iter().any(|knot| f64::abs(time - knot) < 1e-9);
            let a = if time < 0.2 {
                0.0
            } else if time < 0.5 {
                2.0
            } else if time < 0.7 {
                -4.5
            } else {
                0.0
            };
            // Numerical differences are exact to 1e-12 of the speeds over their step.
            assert!(near || (force - 2.0 * (G + a)).abs() < 1e-7, "{force} at {time}, a = {a}");
        }
    }
}

/// A wall pushes a body against another one, or against the limit of its joint: no motion of the body is possible when it has got there.
#[test]
fn a_body_that_is_squeezed_is_refused() {
    let motion = SurfaceMotion::Translation(Profile::new(&[0.0, 10.0], &[[0.5, 0.0, 0.0]; 2]).unwrap());
    let wall = |x: f64, way: f64, motion: Option<SurfaceMotion>| Surface {
        name: if motion.is_some() { "piston" } else { "wall" }.into(),
        obstacle: Obstacle::half_space(Vector3::new(x, 0.0, 0.0), Vector3::x() * way).unwrap(),
        contact: ContactRule::new(Newton { restitution: 0.0, friction: 0.0 }),
        motion,
    };
    for start in [0.0, 99.9] {
        let slider = Part::slider("l1", "base", X).limits(-100.0, 100.0, 0.0);
        let chain = chain(&[slider.weighing(2.0, [1.0; 3]).shaped(&ball(0.05))]);
        let surfaces = [wall(start - 0.1, 1.0, Some(motion.clone())), wall(0.15, -1.0, None)];
        let count = if start == 0.0 { 2 } else { 1 };
        let touches = Touch::all(&chain, &surfaces[..count], 0.0).unwrap().touches;
        let sim = Simulation { tolerance: 1e-11, ..Simulation::new(chain, touches) };
        // The piston meets the body after 0.1 s, and the body the wall or its limit after 0.1 m at 0.5 m/s.
        let refused = sim.run(&[start], &[0.0], 1.0).unwrap_err();
        let SimError::Squeezed { time, touches, speed } = &refused else { panic!("{refused}") };
        assert!((time - 0.3).abs() < 1e-9 && touches.contains("piston") && *speed > 0.1, "{refused}");
    }
}

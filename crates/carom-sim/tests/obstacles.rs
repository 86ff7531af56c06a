//! Cylinders and capsules as surfaces of a scene: a smooth ball bounces off them as off the sphere or line that is nearest to it.

use carom_testing::scenes::with_robots;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Radii of the obstacles and of the ball, m; coefficient of restitution.
const OBSTACLE: f64 = 0.2;
const BALL: f64 = 0.05;
const RESTITUTION: f64 = 0.6;

/// Time and velocity after the first impact of a ball that falls from (x, y, 1) at 1 m/s, without gravity.
fn bounce(shape: &str, x: f64, y: f64) -> Option<(f64, Vector3<f64>)> {
    let text = format!(
        "[robot]\nurdf = \"ball.urdf\"\nfloating = true\nq = [{x}, {y}, 1, 0, 0, 0, 1]\nqd = [0, 0, -1, 0, 0, 0]\n\
         [[surface]]\nshape = {{ {shape} }}\n[contact]\nlaw = \"newton\"\nrestitution = {RESTITUTION}\nfriction = 0\n\
         [run]\nduration = 1.2\ngravity = [0, 0, 0]\ntolerance = 1e-11\n"
    );
    let scene = with_robots(&text).unwrap();
    let run = scene.plan().unwrap().run(scene.duration).unwrap();
    let hit = run.events.iter().find(|event| event.kind.name() == "impact")?;
    Some((hit.time, Vector3::from_column_slice(&hit.qd_plus[..3])))
}

/// The same for a ball whose centre passes the nearest point (0, y₀, 0) of the axis at the horizontal distance `d`: it touches at
/// the distance R + r, and the impulse along the line between them returns e times the speed of approach.
fn expected(d: Vector3<f64>) -> (f64, Vector3<f64>) {
    let reach = OBSTACLE + BALL;
    let height = (reach * reach - d.norm_squared()).sqrt();
    let normal = (d + Vector3::z() * height) / reach;
    (1.0 - height, -Vector3::z() + normal * ((1.0 + RESTITUTION) * normal.z))
}

fn agree(found: Option<(f64, Vector3<f64>)>, expected: (f64, Vector3<f64>)) {
    let (time, velocity) = found.unwrap();
    // The distance to the obstacle is a closed form; the time of the event is a root found to the tolerance.
    assert!((time - expected.0).abs() < 1e-10, "{time} {expected:?}");
    assert!((velocity - expected.1).norm() < 1e-9, "{velocity} {expected:?}");
}

/// The side of a lying cylinder is a line at the distance R + r for the ball's centre.
#[test]
fn a_ball_bounces_off_the_side_of_a_cylinder() {
    let lying =
        format!("cylinder = {{ centre = [0, 0.1, 0], radius = {OBSTACLE}, length = 0.8, rpy = [{FRAC_PI_2}, 0, 0] }}");
    for (x, y) in [(0.0, 0.1), (0.12, 0.3), (-0.2, -0.15)] {
        agree(bounce(&lying, x, y), expected(Vector3::new(x, 0.0, 0.0)));
    }
    // The length ends the side: 0.4 m from the centre, and a radius of the ball beyond it.
    assert_eq!(bounce(&lying, 0.0, 0.1 + 0.4 + BALL + 1e-6), None);
}

/// The cap of an upright cylinder is a plane at the height of half its length.
#[test]
fn a_ball_bounces_off_the_cap_of_a_cylinder() {
    let upright = format!("cylinder = {{ centre = [0, 0, 0.1], radius = {OBSTACLE}, length = 0.3 }}");
    agree(bounce(&upright, 0.15, 0.05), (1.0 - 0.25 - BALL, Vector3::new(0.0, 0.0, RESTITUTION)));
    assert_eq!(bounce(&upright, OBSTACLE + BALL + 1e-6, 0.0), None);
}

/// A capsule is a segment for the ball's centre: its side, and its ends, which are spheres.
#[test]
fn a_ball_bounces_off_the_side_and_the_ends_of_a_capsule() {
    let lying =
        format!("capsule = {{ centre = [0, 0, 0], radius = {OBSTACLE}, length = 0.4, rpy = [{FRAC_PI_2}, 0, 0] }}");
    agree(bounce(&lying, 0.12, 0.15), expected(Vector3::new(0.12, 0.0, 0.0)));
    for (x, y) in [(0.0, 0.3), (0.1, 0.35)] {
        agree(bounce(&lying, x, y), expected(Vector3::new(x, y - 0.2, 0.0)));
        agree(bounce(&lying, x, -y), expected(Vector3::new(x, 0.2 - y, 0.0)));
    }
    assert_eq!(bounce(&lying, 0.0, 0.2 + OBSTACLE + BALL + 1e-6), None);
}

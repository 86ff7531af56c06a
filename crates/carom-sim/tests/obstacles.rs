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

/// The side of a lying cylinder is a line at the distance R + r for the ball's centre, the cap of an upright one a plane at the height of half its
/// length; a capsule is a segment with spheres as its ends. The length ends a side, and a radius of the ball beyond it.
#[test]
fn a_ball_bounces_off_sides_caps_and_ends_of_cylinders_and_capsules() {
    let lying = format!("radius = {OBSTACLE}, rpy = [{FRAC_PI_2}, 0, 0]");
    let [side, cap, capsule] = [
        &format!("cylinder = {{ centre = [0, 0.1, 0], length = 0.8, {lying} }}"),
        &format!("cylinder = {{ centre = [0, 0, 0.1], radius = {OBSTACLE}, length = 0.3 }}"),
        &format!("capsule = {{ centre = [0, 0, 0], length = 0.4, {lying} }}"),
    ];
    let from = |x: f64, y: f64| Some(expected(Vector3::new(x, y, 0.0)));
    for (shape, x, y, expected) in [
        (side, 0.0, 0.1, from(0.0, 0.0)),
        (side, 0.12, 0.3, from(0.12, 0.0)),
        (side, -0.2, -0.15, from(-0.2, 0.0)),
        (side, 0.0, 0.1 + 0.4 + BALL + 1e-6, None),
        (cap, 0.15, 0.05, Some((1.0 - 0.25 - BALL, Vector3::new(0.0, 0.0, RESTITUTION)))),
        (cap, OBSTACLE + BALL + 1e-6, 0.0, None),
        (capsule, 0.12, 0.15, from(0.12, 0.0)),
        (capsule, 0.0, 0.3, from(0.0, 0.1)),
        (capsule, 0.0, -0.3, from(0.0, -0.1)),
        (capsule, 0.1, 0.35, from(0.1, 0.15)),
        (capsule, 0.1, -0.35, from(0.1, -0.15)),
        (capsule, 0.0, 0.2 + OBSTACLE + BALL + 1e-6, None),
    ] {
        let found = bounce(shape, x, y);
        assert_eq!(found.is_some(), expected.is_some(), "{shape}, {x}, {y}: {found:?}");
        let (Some(found), Some(expected)) = (found, expected) else { continue };
        // The distance to the obstacle is a closed form; the time of the event is a root found to the tolerance.
        assert!((found.0 - expected.0).abs() < 1e-10, "{shape}, {x}, {y}: {found:?} {expected:?}");
        assert!((found.1 - expected.1).norm() < 1e-9, "{shape}, {x}, {y}: {found:?} {expected:?}");
    }
}

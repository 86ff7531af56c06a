//! Comparison of gaps with parry's over random poses.
//!
//! parry's distances between polyhedra (box, hull, segment) are exact to rounding; those of round bodies are not. Spheres
//! and capsules are therefore compared by their cores (a tiny sphere for the point), and cylinders with a large tolerance;
//! `optimality.rs` tests cylinders to rounding.

use crate::common::*;
use carom_contact::{Gap, LinkShape, Solid, gap, gap_between};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, ConvexPolyhedron, Cuboid, Cylinder, HalfSpace, Segment, SharedShape};

fn out(v: Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn back(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn place(isometry: &Isometry3<f64>) -> Pose {
    Pose::from_parts(out(isometry.translation.vector), Rotation::from_scaled_axis(out(isometry.rotation.scaled_axis())))
}

/// The core as a shape of parry, the skin, and the rotation from parry's axis y to z.
fn core(solid: &Solid) -> (SharedShape, f64, Isometry3<f64>) {
    let none = Isometry3::identity();
    match solid {
        Solid::Sphere { radius } => (SharedShape::new(Ball::new(1e-12)), *radius, none),
        Solid::Capsule { radius, half_length } => {
            let z = Vector::new(0.0, 0.0, *half_length);
            (SharedShape::new(Segment::new(-z, z)), *radius, none)
        }
        Solid::Cylinder { radius, half_length } => {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            (SharedShape::new(Cylinder::new(*half_length, *radius)), 0.0, turn.into_isometry())
        }
        Solid::Box { half } => (SharedShape::new(Cuboid::new(out(*half))), 0.0, none),
        Solid::Hull(hull) => {
            let points: Vec<Vector> = hull.vertices().iter().map(|v| out(*v)).collect();
            (SharedShape::new(ConvexPolyhedron::from_convex_hull(&points).unwrap()), 0.0, none)
        }
    }
}

trait IntoIsometry {
    fn into_isometry(self) -> Isometry3<f64>;
}

impl IntoIsometry for UnitQuaternion<f64> {
    fn into_isometry(self) -> Isometry3<f64> {
        Isometry3::from_parts(Default::default(), self)
    }
}

/// parry's gap (of the cores, minus the skins), its distance of the cores, and its normal from the second body to the first.
fn parry_gap(a: (&LinkShape, &Isometry3<f64>), b: (&LinkShape, &Isometry3<f64>)) -> (f64, f64, Vector3<f64>) {
    let ((shape_a, skin_a, turn_a), (shape_b, skin_b, turn_b)) = (core(a.0.solid()), core(b.0.solid()));
    let (at_a, at_b) = (place(&(a.1 * turn_a)), place(&(b.1 * turn_b)));
    let contact = query::contact(&at_b, &*shape_b, &at_a, &*shape_a, 100.0).unwrap().unwrap();
    (contact.dist - skin_a - skin_b, contact.dist, back(contact.normal1))
}

fn compare(kinds: (&str, &str), spread: f64, tolerance: f64, turn: f64) {
    let mut rng = fastrand::Rng::with_seed(11);
    let (mut open, mut overlapping) = (0, 0);
    for _ in 0..1000 {
        let (a, b) = (body(kinds.0, &mut rng), body(kinds.1, &mut rng));
        let (at_a, at_b) = (isometry(&mut rng, spread), isometry(&mut rng, spread));
        let ours: Gap = gap_between((&a, &at_a.into()), (&b, &at_b.into()));
        let (distance, of_cores, normal) = parry_gap((&a, &at_a), (&b, &at_b));
        // Cores of lower dimension that intersect: parry's result is right for a point in a body, but not for crossing segments.
        if of_cores < 0.0 && kinds == ("capsule", "capsule") {
            continue;
        }
        assert!((ours.distance - distance).abs() < tolerance, "{kinds:?}: {} against {distance}", ours.distance);
        // Close to a core's surface parry's normal is inaccurate; deep inside, several directions may be equally short.
        if of_cores > 1e-3 {
            assert!((ours.normal - normal).norm() < turn, "{kinds:?}: {:?} against {normal:?}", ours.normal);
        }
        if ours.distance > 0.0 { open += 1 } else { overlapping += 1 }
    }
    assert!(open > 50 && overlapping > 50, "{kinds:?}: {open} open, {overlapping} overlapping");
}

macro_rules! pairs {
    ($($name:ident: $a:literal, $b:literal, $tolerance:literal, $turn:literal;)*) => {
        $(#[test] fn $name() { compare(($a, $b), 0.2, $tolerance, $turn); })*
    };
}

pairs! {
    sphere_sphere_gap_equals_parrys: "sphere", "sphere", 1e-9, 1e-6;
    sphere_capsule_gap_equals_parrys: "sphere", "capsule", 1e-9, 1e-6;
    sphere_box_gap_equals_parrys: "sphere", "box", 1e-9, 1e-6;
    sphere_hull_gap_equals_parrys: "sphere", "hull", 1e-9, 1e-6;
    capsule_capsule_gap_equals_parrys: "capsule", "capsule", 1e-9, 1e-6;
    capsule_box_gap_equals_parrys: "capsule", "box", 1e-9, 1e-6;
    capsule_hull_gap_equals_parrys: "capsule", "hull", 1e-9, 1e-6;
    box_box_gap_equals_parrys: "box", "box", 1e-9, 1e-6;
    box_hull_gap_equals_parrys: "box", "hull", 1e-9, 1e-6;
    hull_hull_gap_equals_parrys: "hull", "hull", 1e-9, 1e-6;
    sphere_cylinder_gap_is_near_parrys: "sphere", "cylinder", 1e-4, 3e-2;
    capsule_cylinder_gap_is_near_parrys: "capsule", "cylinder", 1e-4, 3e-2;
    box_cylinder_gap_is_near_parrys: "box", "cylinder", 1e-4, 3e-2;
    hull_cylinder_gap_is_near_parrys: "hull", "cylinder", 1e-4, 3e-2;
    cylinder_cylinder_gap_is_near_parrys: "cylinder", "cylinder", 1e-4, 3e-2;
}

#[test]
fn half_space_gap_of_every_body_equals_parrys() {
    let mut rng = fastrand::Rng::with_seed(5);
    for kind in KINDS {
        for _ in 0..1000 {
            let (body, at) = (body(kind, &mut rng), isometry(&mut rng, 0.2));
            let (point, normal) = (vector(&mut rng, 0.2), unit(&mut rng));
            let ours = gap(&body, &at.into(), &half_space(point, normal));
            let (shape, skin, turn) = core(body.solid());
            // The half-space first: in the other order parry's distance is wrong.
            let plane = Pose::from_parts(out(point), Rotation::IDENTITY);
            let contact = query::contact(&plane, &HalfSpace::new(out(normal)), &place(&(at * turn)), &*shape, 100.0);
            let contact = contact.unwrap().unwrap();
            assert!((ours.distance - (contact.dist - skin)).abs() < 1e-9, "{kind}: {ours:?} against {contact:?}");
            assert!((ours.normal - normal).norm() < 1e-15);
        }
    }
}

//! Gaps against parry's, over random poses: two routes to the same number.
//!
//! parry's distances of polyhedra (box, hull, segment) are right to rounding; of bodies with round parts they are not, so
//! spheres and capsules are compared by their cores (a tiny ball for the point), and cylinders loosely here, exactly in
//! `optimality.rs`.

mod common;

use carom_contact::{Gap, LinkShape, Solid, gap, gap_between};
use common::*;
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

/// The core as parry's shape, the skin, and the turn from parry's axis y to z.
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

/// parry's gap: of the cores, less the skins; normal from the second body to the first.
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
        let ours: Gap = gap_between((&a, &pose(&at_a)), (&b, &pose(&at_b)));
        let (distance, of_cores, normal) = parry_gap((&a, &at_a), (&b, &at_b));
        // Cores of lower dimension that meet: parry's answer for a point in a body is fine, for crossing segments not.
        if of_cores < 0.0 && kinds == ("capsule", "capsule") {
            continue;
        }
        assert!((ours.distance - distance).abs() < tolerance, "{kinds:?}: {} against {distance}", ours.distance);
        // Near a core's surface the difference of two points tells no direction; deep inside several may be as short.
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
    sphere_and_sphere: "sphere", "sphere", 1e-9, 1e-6;
    sphere_and_capsule: "sphere", "capsule", 1e-9, 1e-6;
    sphere_and_box: "sphere", "box", 1e-9, 1e-6;
    sphere_and_hull: "sphere", "hull", 1e-9, 1e-6;
    capsule_and_capsule: "capsule", "capsule", 1e-9, 1e-6;
    capsule_and_box: "capsule", "box", 1e-9, 1e-6;
    capsule_and_hull: "capsule", "hull", 1e-9, 1e-6;
    box_and_box: "box", "box", 1e-9, 1e-6;
    box_and_hull: "box", "hull", 1e-9, 1e-6;
    hull_and_hull: "hull", "hull", 1e-9, 1e-6;
    sphere_and_cylinder_as_well_as_parry_can: "sphere", "cylinder", 1e-4, 3e-2;
    capsule_and_cylinder_as_well_as_parry_can: "capsule", "cylinder", 1e-4, 3e-2;
    box_and_cylinder_as_well_as_parry_can: "box", "cylinder", 1e-4, 3e-2;
    hull_and_cylinder_as_well_as_parry_can: "hull", "cylinder", 1e-4, 3e-2;
    cylinder_and_cylinder_as_well_as_parry_can: "cylinder", "cylinder", 1e-4, 3e-2;
}

#[test]
fn every_body_and_a_half_space() {
    let mut rng = fastrand::Rng::with_seed(5);
    for kind in KINDS {
        for _ in 0..1000 {
            let (body, at) = (body(kind, &mut rng), isometry(&mut rng, 0.2));
            let (point, normal) = (vector(&mut rng, 0.2), unit(&mut rng));
            let ours = gap(&body, &pose(&at), &half_space(point, normal));
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

//! Optimality of gaps, without a reference: the nearest points belong to the bodies and are extreme along the normal, and no
//! other direction has a greater separation.

use crate::common::*;
use carom_chain::urdf::Shape;
use carom_contact::{Gap, LinkShape, Obstacle, Solid, gap, gap_between};
use nalgebra::{Isometry3, Vector3};

/// Height of a body's lowest point along n, world axes.
fn lowest(body: &LinkShape, at: &Isometry3<f64>, n: Vector3<f64>) -> f64 {
    n.dot(&at.translation.vector) + body.solid().lowest(at.rotation.inverse() * n).0
}

/// Separation along n: height of the lowest point of a minus that of the highest point of b.
fn separation(a: (&LinkShape, &Isometry3<f64>), b: (&LinkShape, &Isometry3<f64>), n: Vector3<f64>) -> f64 {
    lowest(a.0, a.1, n) + lowest(b.0, b.1, -n)
}

/// Distance of a point outside a body, by the body's definition (0 for hulls, whose points are combinations of corners).
fn outside(body: &LinkShape, at: &Isometry3<f64>, x: Vector3<f64>) -> f64 {
    let p = at.inverse_transform_point(&x.into()).coords;
    match body.solid() {
        Solid::Sphere { radius } => p.norm() - radius,
        Solid::Capsule { radius, half_length } => {
            (p - Vector3::new(0.0, 0.0, p.z.clamp(-half_length, *half_length))).norm() - radius
        }
        Solid::Cylinder { radius, half_length } => (p.x.hypot(p.y) - radius).max(p.z.abs() - half_length),
        Solid::Box { half } => (p.abs() - half).max(),
        Solid::Hull(_) => 0.0,
    }
}

const ROUNDING: f64 = 2e-13;

#[test]
fn nearest_points_of_separate_bodies_are_optimal() {
    let mut rng = fastrand::Rng::with_seed(1);
    for first in KINDS {
        for second in KINDS {
            let (mut open, mut worst) = (0, [0.0_f64; 3]);
            for _ in 0..400 {
                let (a, b) = (body(first, &mut rng), body(second, &mut rng));
                let (at_a, at_b) = (isometry(&mut rng, 0.4), isometry(&mut rng, 0.4));
                let found = gap_between((&a, &at_a.into()), (&b, &at_b.into()));
                if found.distance <= 0.0 {
                    continue;
                }
                open += 1;
                let Gap { distance, normal, on_robot, on_environment } = found;
                worst[0] = worst[0].max((distance - (on_robot - on_environment).norm()).abs());
                worst[1] = worst[1].max((distance - separation((&a, &at_a), (&b, &at_b), normal)).abs());
                worst[2] = worst[2].max(outside(&a, &at_a, on_robot)).max(outside(&b, &at_b, on_environment));
            }
            assert!(open > 100, "{first} and {second}: {open}");
            assert!(worst.iter().all(|w| *w < ROUNDING), "{first} and {second}: {worst:?}");
        }
    }
}

#[test]
fn normal_of_an_overlap_has_the_greatest_separation() {
    let mut rng = fastrand::Rng::with_seed(2);
    for first in KINDS {
        for second in KINDS {
            let mut overlapping = 0;
            for _ in 0..150 {
                let (a, b) = (body(first, &mut rng), body(second, &mut rng));
                let (at_a, at_b) = (isometry(&mut rng, 0.12), isometry(&mut rng, 0.12));
                let found = gap_between((&a, &at_a.into()), (&b, &at_b.into()));
                if found.distance >= 0.0 {
                    continue;
                }
                overlapping += 1;
                let along = |n| separation((&a, &at_a), (&b, &at_b), n);
                assert!((along(found.normal) - found.distance).abs() < ROUNDING, "{first} and {second}");
                for _ in 0..300 {
                    let n = unit(&mut rng);
                    assert!(along(n) <= found.distance + ROUNDING, "{first} and {second}: {} {found:?}", along(n));
                }
            }
            assert!(overlapping > 30, "{first} and {second}: {overlapping}");
        }
    }
}

/// The bodies touch at the nearest points if the first is translated by −g n. With a rim, whose separation changes only by
/// rounding when the normal turns by 1e-8, the points of two such directions may be combined.
#[test]
fn deepest_points_of_overlapping_bodies_are_extreme_along_the_normal() {
    let mut rng = fastrand::Rng::with_seed(4);
    for first in KINDS {
        for second in KINDS {
            let (mut overlapping, mut worst) = (0, [0.0_f64; 4]);
            for _ in 0..400 {
                let (a, b) = (body(first, &mut rng), body(second, &mut rng));
                let (at_a, at_b) = (isometry(&mut rng, 0.12), isometry(&mut rng, 0.12));
                let found = gap_between((&a, &at_a.into()), (&b, &at_b.into()));
                if found.distance >= 0.0 {
                    continue;
                }
                overlapping += 1;
                let Gap { distance, normal, on_robot, on_environment } = found;
                let height = normal.dot(&on_robot) - lowest(&a, &at_a, normal);
                let depth = normal.dot(&on_environment) + lowest(&b, &at_b, -normal);
                worst[0] = worst[0].max((normal * distance - (on_robot - on_environment)).norm());
                worst[1] = worst[1].max(height.abs());
                worst[2] = worst[2].max(depth.abs());
                worst[3] = worst[3].max(outside(&a, &at_a, on_robot)).max(outside(&b, &at_b, on_environment));
            }
            assert!(overlapping > 100, "{first} and {second}: {overlapping}");
            let round = [first, second].contains(&"cylinder");
            assert!(worst[0] < if round { 1e-6 } else { ROUNDING }, "{first} and {second}: {worst:?}");
            assert!(worst[1..].iter().all(|w| *w < ROUNDING), "{first} and {second}: {worst:?}");
        }
    }
}

/// The same bodies with all lengths multiplied by a power of two, as by a change of the unit of length.
#[test]
fn gap_is_proportional_to_a_common_scale_of_all_lengths() {
    let mut rng = fastrand::Rng::with_seed(6);
    let scaled = |body: &LinkShape, k: f64| match body.solid() {
        Solid::Sphere { radius } => link_shape(Shape::Sphere { radius: k * radius }),
        Solid::Capsule { radius, half_length } => {
            link_shape(Shape::Capsule { radius: k * radius, length: 2.0 * k * half_length })
        }
        Solid::Cylinder { radius, half_length } => {
            link_shape(Shape::Cylinder { radius: k * radius, length: 2.0 * k * half_length })
        }
        Solid::Box { half } => link_shape(Shape::Box { size: half * (2.0 * k) }),
        Solid::Hull(hull) => hull_of(&hull.vertices().iter().map(|v| v * k).collect::<Vec<_>>(), k.to_bits()),
    };
    let moved = |at: &Isometry3<f64>, k: f64| Isometry3::from_parts((at.translation.vector * k).into(), at.rotation);
    for first in KINDS {
        for second in KINDS {
            for _ in 0..15 {
                let (a, b) = (body(first, &mut rng), body(second, &mut rng));
                let (at_a, at_b) = (isometry(&mut rng, 0.2), isometry(&mut rng, 0.2));
                let of = |k: f64| {
                    let (a, b) = (scaled(&a, k), scaled(&b, k));
                    gap_between((&a, &moved(&at_a, k).into()), (&b, &moved(&at_b, k).into())).distance / k
                };
                let one = of(1.0);
                for power in [-20, 20, 60] {
                    let other = of(2.0_f64.powi(power));
                    assert!((other - one).abs() < ROUNDING, "{first} and {second}, 2^{power}: {other} against {one}");
                }
            }
        }
    }
}

/// Translating a body along the normal changes the gap by the same amount, through zero, to rounding. Exception: where a
/// corner comes to lie on a corner or a rim, the normal is not determined at the touch, and an overlap may be separated in
/// another direction. There the gap must only lie between zero and the value that was aimed at.
#[test]
fn translation_along_the_normal_changes_the_gap_by_the_same_amount() {
    let mut rng = fastrand::Rng::with_seed(3);
    let obstacles = |rng: &mut fastrand::Rng| {
        let at = isometry(rng, 0.1);
        [
            half_space(vector(rng, 0.2), unit(rng)),
            Obstacle::sphere(vector(rng, 0.1), 0.2).unwrap(),
            Obstacle::cuboid(at, Vector3::new(0.3, 0.4, 0.2)).unwrap(),
            Obstacle::mesh(box_mesh(Vector3::new(0.3, 0.4, 0.2)), at).unwrap(),
        ]
    };
    let (mut all, mut sharp) = (0, 0);
    for kind in KINDS {
        for _ in 0..150 {
            for (which, obstacle) in obstacles(&mut rng).iter().enumerate() {
                let (body, mut at) = (body(kind, &mut rng), isometry(&mut rng, 1.0));
                let start = gap(&body, &at.into(), obstacle);
                if start.distance < 0.01 {
                    continue;
                }
                for target in [0.1, 1e-3, 1e-5, 1e-6, 1e-8, 1e-12, 0.0, -1e-12, -1e-8, -1e-5, -1e-3] {
                    let now = gap(&body, &at.into(), obstacle).distance;
                    at.translation.vector += start.normal * (target - now);
                    let found = gap(&body, &at.into(), obstacle);
                    let (off, turned) = (found.distance - target, (found.normal - start.normal).norm());
                    all += 1;
                    if turned < 1e-9 || (target >= 1e-6 && turned < 1e-4) {
                        assert!(off.abs() < ROUNDING, "{kind} {which}: {found:?} {target}");
                    } else {
                        sharp += 1;
                        let (low, high) = (target.min(0.0) - ROUNDING, target.max(0.0) + ROUNDING);
                        assert!(target < 1e-6, "{kind} {which}: {found:?} {target} {turned:e}");
                        assert!((low..high).contains(&found.distance), "{kind} {which}: {found:?} {target}");
                    }
                    at.translation.vector -= start.normal * (target - now);
                }
            }
        }
    }
    assert!(sharp * 3 < all, "{sharp} of {all}");
}

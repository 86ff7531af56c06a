//! Optimality of gaps, without a reference: the nearest points belong to the bodies and are extreme along the normal, and no
//! other direction has a greater separation.

use crate::common::*;
use carom_chain::urdf::Shape;
use carom_contact::{Gap, LinkShape, Obstacle, Solid, gap, gap_between};
use nalgebra::{Isometry3, Vector3};
use std::collections::BTreeMap;

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

/// Random pairs of bodies of every kind, up to `spread` from the origin, with their gaps.
type Pair<'a> = (&'a str, [(&'a LinkShape, &'a Isometry3<f64>); 2], &'a Gap);

fn each_pair(seed: u64, (count, spread): (usize, f64), mut check: impl FnMut(Pair)) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for first in KINDS {
        for second in KINDS {
            for _ in 0..count {
                let (a, b) = (body(first, &mut rng), body(second, &mut rng));
                let (at_a, at_b) = (isometry(&mut rng, spread), isometry(&mut rng, spread));
                let found = gap_between((&a, &at_a.into()), (&b, &at_b.into()));
                check((&format!("{first} and {second}"), [(&a, &at_a), (&b, &at_b)], &found));
            }
        }
    }
}

/// The number of pairs of each two kinds with a check of their own.
fn enough(counts: &BTreeMap<String, usize>, least: usize) {
    assert!(counts.len() == KINDS.len().pow(2) && counts.values().all(|count| *count > least), "{counts:?}");
}

/// Nearest points of separate bodies belong to them and are extreme along the normal. So are the deepest points of overlapping ones, which touch
/// there if the first is translated by −g n. With a rim, whose separation changes only by rounding when the normal turns by 1e-8, the points of
/// two such directions may be combined.
#[test]
fn nearest_and_deepest_points_are_extreme_along_the_normal() {
    for (seed, spread, open) in [(1, 0.4, true), (4, 0.12, false)] {
        let mut counts = BTreeMap::<String, usize>::new();
        each_pair(seed, (400, spread), |(name, [a, b], &Gap { distance, normal, on_robot, on_environment })| {
            if distance == 0.0 || (distance > 0.0) != open {
                return;
            }
            *counts.entry(name.to_owned()).or_default() += 1;
            let between = on_robot - on_environment;
            let apart = if open { (distance - between.norm()).abs() } else { (normal * distance - between).norm() };
            let within = if !open && name.contains("cylinder") { 1e-6 } else { ROUNDING };
            assert!(apart < within, "{name}: {apart:e}");
            let height = normal.dot(&on_robot) - lowest(a.0, a.1, normal);
            let depth = normal.dot(&on_environment) + lowest(b.0, b.1, -normal);
            let out = outside(a.0, a.1, on_robot).max(outside(b.0, b.1, on_environment));
            let off = if open { (distance - separation(a, b, normal)).abs() } else { height.abs().max(depth.abs()) };
            assert!(off < ROUNDING && out < ROUNDING, "{name}: {off:e} {out:e}");
        });
        enough(&counts, 100);
    }
}

#[test]
fn normal_of_an_overlap_has_the_greatest_separation() {
    let (mut rng, mut counts) = (fastrand::Rng::with_seed(5), BTreeMap::<String, usize>::new());
    each_pair(2, (150, 0.12), |(name, [a, b], found)| {
        if found.distance >= 0.0 {
            return;
        }
        *counts.entry(name.to_owned()).or_default() += 1;
        assert!((separation(a, b, found.normal) - found.distance).abs() < ROUNDING, "{name}");
        for _ in 0..300 {
            let along = separation(a, b, unit(&mut rng));
            assert!(along <= found.distance + ROUNDING, "{name}: {along} {found:?}");
        }
    });
    enough(&counts, 30);
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

//! The contacts of parts of two bodies against finite differences and against the gap of the whole bodies.

use crate::common::*;
use carom_chain::Spatial;
use carom_chain::algebra::Pose;
use carom_chain::urdf::Shape;
use carom_contact::{LinkShape, Meeting, Met, Parts, Separation, gap_between};
use nalgebra::{Rotation3, Vector3};

type Place = Pose<Spatial<f64>>;

/// The pose after a time of constant velocities.
fn after(pose: &Place, v: Vector3<f64>, w: Vector3<f64>, t: f64) -> Place {
    Pose { rotation: *Rotation3::new(w * t).matrix() * pose.rotation, translation: pose.translation + v * t }
}

fn random_pose(rng: &mut fastrand::Rng) -> Place {
    let rotation = *Rotation3::new(unit(rng) * (3.0 * rng.f64())).matrix();
    Pose { rotation, translation: vector(rng, 0.3) }
}

/// Tests of one process write their hulls to files of their own.
fn tetrahedron() -> LinkShape {
    static NUMBER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(7700);
    let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    hull_of(&[[0.0, 0.0, 0.0], [0.3, 0.0, 0.05], [0.0, 0.4, 0.0], [0.1, 0.1, 0.35]].map(Vector3::from), number)
}

fn bodies() -> [(&'static str, LinkShape); 4] {
    [
        ("box", link_shape(Shape::Box { size: Vector3::new(0.4, 0.6, 0.2) })),
        ("capsule", link_shape(Shape::Capsule { radius: 0.1, length: 0.5 })),
        ("cylinder", link_shape(Shape::Cylinder { radius: 0.2, length: 0.3 })),
        ("hull", tetrahedron()),
    ]
}

/// Rates of the normal and of the contact points on their bodies, for every kind of pair, by central differences of fourth
/// order along rigid motions that keep the gap closed. Their error is about 1e-11 of the rates, which are some units.
#[test]
fn contact_points_and_normals_move_as_their_differences_in_time() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut kinds = std::collections::BTreeMap::<String, usize>::new();
    let word = |part| format!("{part}").split(' ').next().unwrap_or_default().to_owned();
    for (own_name, own_shape) in bodies() {
        for (other_name, other_shape) in bodies() {
            let (own, other) = (Parts::of_shape(&own_shape).unwrap(), Parts::of_shape(&other_shape).unwrap());
            for meeting in Meeting::all(&own, &other) {
                for _ in 0..20 {
                    let (mut a, b) = (random_pose(&mut rng), random_pose(&mut rng));
                    let met = meeting.at((&own, &a), (&other, &b));
                    if met.gap.distance == 1.0 {
                        continue; // parts that face away from each other
                    }
                    // Closed by a translation, then moved so that the gap stays closed in first order.
                    a.translation -= met.gap.normal * met.gap.distance;
                    let met = meeting.at((&own, &a), (&other, &b));
                    // A point that is not on its part may be another one after the translation.
                    let other_point = met.gap.distance.abs() > 1e-14 && !met.counts();
                    if met.gap.distance == 1.0 || met.gap.normal.norm() < 0.5 || other_point {
                        continue;
                    }
                    assert!(met.gap.distance.abs() < 1e-14);
                    let (w, turn) = (vector(&mut rng, 2.0), vector(&mut rng, 2.0));
                    let (mut v, speed) = (vector(&mut rng, 1.0), vector(&mut rng, 1.0));
                    let point = met.gap.on_robot;
                    let slip = |v: Vector3<f64>| {
                        v + w.cross(&(point - a.translation)) - speed - turn.cross(&(point - b.translation))
                    };
                    v -= met.gap.normal * met.gap.normal.dot(&slip(v));
                    let u = slip(v);
                    let slide = meeting.slide(((&own, &a), w), ((&other, &b), turn), u);
                    let h = 1e-4;
                    let at = |k: f64| {
                        let (a, b) = (after(&a, v, w, k * h), after(&b, speed, turn, k * h));
                        let gap = meeting.at((&own, &a), (&other, &b)).gap;
                        (gap.normal, a.inverse().point(gap.on_robot), b.inverse().point(gap.on_environment))
                    };
                    let steps = [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)];
                    let (mut n, mut on_own, mut on_other) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
                    let mut clear = true;
                    for (k, weight) in steps {
                        let (normal, p, q) = at(k);
                        clear &= normal.dot(&met.gap.normal) > 0.9;
                        n += normal * weight / (12.0 * h);
                        on_own += a.rotation * p * weight / (12.0 * h);
                        on_other += b.rotation * q * weight / (12.0 * h);
                    }
                    // Of edges that are almost parallel the crossing moves without bound.
                    let size = slide.on_robot.norm().max(slide.on_environment.norm()).max(slide.normal_rate.norm());
                    if !clear || size > 30.0 {
                        continue;
                    }
                    let error = (n - slide.normal_rate).norm()
                        + (on_own - slide.on_robot).norm()
                        + (on_other - slide.on_environment).norm();
                    let pair = format!("{} on {}", word(meeting.own()), word(meeting.other()));
                    assert!(error < 1e-8 * (1.0 + size).powi(3), "{own_name} {other_name} {pair}: {error:e} of {size}");
                    *kinds.entry(pair).or_default() += 1;
                }
            }
        }
    }
    // Each kind of pair was examined, with the environment's part first or second.
    for kind in [
        "corner on face",
        "face on corner",
        "rim on face",
        "face on rim",
        "edge on edge",
        "corner on edge",
        "rim on edge",
        "edge on rim",
    ] {
        assert!(kinds.get(kind).is_some_and(|count| *count > 100), "{kind}: {kinds:?}");
    }
    assert!(kinds["edge on corner"] > 100 && kinds["corner on corner"] > 20, "{kinds:?}");
}

/// Bodies that are moved together until they touch: the least gap of the parts that face each other is then zero, too, and no
/// gap of parts is below that of the bodies. Pairs whose parts are complete, so all but those of rims with round bodies.
#[test]
fn bodies_touch_where_their_parts_touch() {
    let mut rng = fastrand::Rng::with_seed(8);
    let mut touched = 0;
    for (own_name, own_shape) in bodies() {
        for (other_name, other_shape) in bodies() {
            let (own, other) = (Parts::of_shape(&own_shape).unwrap(), Parts::of_shape(&other_shape).unwrap());
            if !Meeting::are_complete(&own, &other) {
                continue;
            }
            let meetings = Meeting::all(&own, &other);
            let least = |a: &Place, b: &Place| {
                let met = meetings.iter().map(|meeting| meeting.at((&own, a), (&other, b))).filter(Met::counts);
                met.map(|met| met.gap.distance).fold(f64::INFINITY, f64::min)
            };
            for _ in 0..200 {
                let (mut a, b) = (random_pose(&mut rng), random_pose(&mut rng));
                let way = unit(&mut rng);
                a.translation = b.translation - way * 2.0;
                // Conservative advancement: steps of the gap, which is a lower bound of the free way.
                let gap = |a: &Place| gap_between((&own_shape, a), (&other_shape, &b)).distance;
                let mut left = gap(&a);
                for _ in 0..10_000 {
                    a.translation += way * left;
                    left = gap(&a);
                    // Points up to `Met::OUTSIDE` beside a face or beyond the end of an edge count, too, on both bodies.
                    assert!(
                        least(&a, &b) > left - 4.0 * Met::OUTSIDE,
                        "{own_name} {other_name}: {} {left}",
                        least(&a, &b)
                    );
                    if left < 1e-11 || (a.translation - b.translation).dot(&way) > 2.0 {
                        break;
                    }
                }
                if left < 1e-11 {
                    touched += 1;
                    assert!(least(&a, &b) < 1e-9, "{own_name} {other_name}: {}", least(&a, &b));
                }
            }
        }
    }
    assert!(touched > 200, "{touched}");
}

/// A cylinder on a plane touches with the lowest points of its rims, which are those of its gap.
#[test]
fn the_lower_rim_of_a_cylinder_has_its_gap() {
    let mut rng = fastrand::Rng::with_seed(4);
    let plane = carom_contact::Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let shape = link_shape(Shape::Cylinder { radius: 0.2, length: 0.3 });
    let (own, other) = (Parts::of_shape(&shape).unwrap(), Parts::of_obstacle(&plane).unwrap());
    assert!(Meeting::are_complete(&own, &other));
    for _ in 0..200 {
        let a = random_pose(&mut rng);
        let met =
            Meeting::all(&own, &other).into_iter().map(|meeting| meeting.at((&own, &a), (&other, &Pose::identity())));
        let least = met.filter(Met::counts).map(|met| met.gap.distance).fold(f64::INFINITY, f64::min);
        let whole = carom_contact::gap(&shape, &a, &plane).distance;
        assert!((least - whole).abs() < 1e-15, "{least} {whole}");
    }
    // Upright: the fixed points of the lower rim.
    let upright = Pose { translation: Vector3::new(0.0, 0.0, 0.15), ..Pose::identity() };
    let counted = Meeting::all(&own, &other).into_iter().filter(|meeting| {
        let met = meeting.at((&own, &upright), (&other, &Pose::identity()));
        met.counts() && met.gap.distance.abs() < 1e-15
    });
    assert_eq!(counted.count(), 8);
}

/// A cylinder that lies with the end of its side on the edge of a box, and is pushed over it by s: the least gap of the parts is
/// that of the bodies to s²/R, on both sides of the end and at it, where the two crossings of the rim and the side have merged.
#[test]
fn a_contact_passes_over_the_end_of_a_round_side_onto_its_rim() {
    let mut rng = fastrand::Rng::with_seed(27);
    let (radius, length) = (0.2, 0.3);
    let own_shape = link_shape(Shape::Cylinder { radius, length });
    let other_shape = link_shape(Shape::Box { size: Vector3::new(0.4, 2.0, 0.2) });
    let (own, other) = (Parts::of_shape(&own_shape).unwrap(), Parts::of_shape(&other_shape).unwrap());
    let meetings = Meeting::all(&own, &other);
    let (b, edge) = (Pose::identity(), Vector3::y());
    for _ in 0..300 {
        // n between the normals of both faces of the edge; the axis across n, oblique to the edge.
        let tilt = 0.2 + 1.1 * rng.f64();
        let n = Vector3::new(tilt.sin(), 0.0, tilt.cos());
        let turn = (0.2 + 1.1 * rng.f64()) * if rng.bool() { 1.0 } else { -1.0 };
        let axis = edge * turn.cos() + edge.cross(&n) * turn.sin();
        let rotation = nalgebra::Matrix3::from_columns(&[n, axis.cross(&n), axis]);
        let end = if rng.bool() { 0.5 } else { -0.5 } * length;
        let point = Vector3::new(0.2, 0.5 * (2.0 * rng.f64() - 1.0), 0.1);
        for s in [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4] {
            for s in [s, -s] {
                let beyond = end + s * end.signum();
                let a = Pose { rotation, translation: point + n * radius - axis * beyond };
                let met = meetings.iter().map(|meeting| meeting.at((&own, &a), (&other, &b))).filter(Met::counts);
                let least = met.map(|met| met.gap.distance).fold(f64::INFINITY, f64::min);
                let whole = gap_between((&own_shape, &a), (&other_shape, &b)).distance;
                assert!((least - whole).abs() < 1e-14, "{s}: {least} {whole}, tilt {tilt}, turn {turn}");
            }
        }
    }
}

/// The separation along normals of faces is never above the gap, and equal to it where a corner or rim is nearest to a face.
#[test]
fn the_separation_along_normals_of_faces_is_a_lower_bound_of_the_gap() {
    let mut rng = fastrand::Rng::with_seed(15);
    let mut equal = 0;
    for (own_name, own_shape) in bodies() {
        for (other_name, other_shape) in bodies() {
            let (own, other) = (Parts::of_shape(&own_shape).unwrap(), Parts::of_shape(&other_shape).unwrap());
            for _ in 0..200 {
                let (mut a, b) = (random_pose(&mut rng), random_pose(&mut rng));
                a.translation += unit(&mut rng) * rng.f64();
                let Some(bound) = Separation::of((&own, &a), (&other, &b)) else {
                    assert_eq!((own_name, other_name), ("capsule", "capsule"));
                    continue;
                };
                let whole = gap_between((&own_shape, &a), (&other_shape, &b));
                // The search for round bodies is exact to 1e-14 of their size.
                assert!(bound.gap.distance <= whole.distance + 1e-13, "{own_name} {other_name}");
                if whole.distance - bound.gap.distance < 1e-13 {
                    equal += 1;
                    assert!((bound.gap.normal - whole.normal).norm() < 1e-6, "{own_name} {other_name}");
                }
                let along = bound.gap.normal.dot(&(bound.gap.on_robot - bound.gap.on_environment));
                assert!((along - bound.gap.distance).abs() < 1e-14);
            }
        }
    }
    assert!(equal > 300, "{equal}");
}

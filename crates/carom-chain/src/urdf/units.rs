//! Warnings of numbers that are likely to be in other units than those of URDF, which are m, rad, kg and kg m².
//!
//! Each warning is about the first or the greatest number of its kind and says how many there are, because a file in other units
//! has all of them in these.

use super::robot::{Joint, JointType, Link, Shape, short};
use super::source::{Source, own_child};
use super::tree::Tree;
use super::warnings::Warnings;
use nalgebra::{Isometry3, Vector3};
use roxmltree::Node;
use std::f64::consts::{PI, TAU};

/// Largest angle of an `rpy`, rad: every rotation has one within half a turn; a whole turn and digits of a file are left over.
const TURN: f64 = TAU + 1e-3;

/// Limits of hinges in degrees: whole or half numbers above two turns, which few hinges exceed, in rad, up to two turns in degrees. The
/// numbers that files have for "no limit", as 1000 or 1e16, are above.
const DEGREES: std::ops::RangeInclusive<f64> = 2.0 * TAU..=720.0;

/// Distance between the frames of two links, m, that no robot has, and in mm nearly every robot.
const FAR: f64 = 100.0;

/// A principal moment is suspicious above this multiple of m L² and of M L², for the mass m of the link, that of the robot M, and its size
/// L of at least 1 m: a radius of gyration of ten times L. The second bound leaves out links with a small mass that stands for none.
const SPREAD: f64 = 100.0;

/// `moves`: which links move. `reach`: see [`Tree::reach`].
pub(super) fn check(
    source: &Source,
    tree: &Tree,
    links: &[Link],
    joints: &[Joint],
    (moves, reach): (&[bool], f64),
    warnings: &mut Warnings,
) {
    rotations_in_degrees(source, warnings);
    limits_in_degrees(source, joints, warnings);
    lengths_in_millimetres(source, tree, links, joints, moves, warnings);
    inertias_in_square_millimetres(source, links, moves, reach, warnings);
}

/// ` (the first of 3 such joints)`, if there are several.
fn of_several(what: &str, count: usize, things: &str) -> String {
    if count > 1 { format!(" ({what} of {count} such {things})") } else { String::new() }
}

fn rotations_in_degrees(source: &Source, warnings: &mut Warnings) {
    let all = source.links().into_iter().chain(source.joints()).flat_map(|node| node.descendants());
    let mut odd = all.filter(|node| node.has_tag_name("origin")).filter_map(|node| {
        let mut numbers = node.attribute("rpy")?.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
        numbers.find(|angle| angle.abs() > TURN).map(|angle| (node, angle))
    });
    let Some((node, angle)) = odd.next() else { return };
    let text = format!(
        "{} is more than a turn: angles are in rad; {0}° are {} rad{}",
        short(angle),
        short(angle * PI / 180.0),
        of_several("the first", 1 + odd.count(), "origins")
    );
    warnings.odd_attribute(source, node, "rpy", &text);
}

fn limits_in_degrees(source: &Source, joints: &[Joint], warnings: &mut Warnings) {
    let mut odd = joints.iter().zip(source.joints()).filter_map(|(joint, node)| {
        let limits = [joint.limits.lower?, joint.limits.upper?];
        let odd = joint.kind == JointType::Revolute
            && limits.iter().any(|x| DEGREES.contains(&x.abs()))
            && limits.iter().all(|x| x.abs() <= *DEGREES.end() && (2.0 * x).fract() == 0.0);
        odd.then_some((node, limits))
    });
    let Some((node, limits)) = odd.next() else { return };
    let ([lower, upper], [from, to]) = (limits.map(short), limits.map(|x| short(x * PI / 180.0)));
    let text = format!(
        "{lower} … {upper} is more than two turns: limits are in rad; {lower}° … {upper}° are {from} … {to} rad{}",
        of_several("the first", 1 + odd.count(), "joints")
    );
    warnings.odd(source, own_child(node, "limit"), &text);
}

fn lengths_in_millimetres(
    source: &Source,
    tree: &Tree,
    links: &[Link],
    joints: &[Joint],
    moves: &[bool],
    warnings: &mut Warnings,
) {
    let between = joints.iter().zip(&tree.ends).zip(source.joints());
    let between = between.filter(|((_, (parent, _)), _)| moves[*parent]);
    let between = between.map(|((joint, _), node)| (node, joint.origin.translation.vector.norm()));
    let centres = links.iter().zip(source.links()).zip(moves).filter(|(_, moves)| **moves);
    let centres =
        centres.filter_map(|((link, node), _)| Some((own_child(node, "inertial"), link.inertial?.com.norm())));
    let odd: Vec<(Node, f64)> = between.chain(centres).filter(|(_, length)| *length >= FAR).collect();
    // the first of equal ones
    let Some((node, length)) = odd.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
    let text = format!(
        "lies {} m from the origin of the link: lengths are in m; 1 mm is 0.001 m{}",
        short(*length),
        of_several("the greatest", odd.len(), "lengths")
    );
    warnings.odd_attribute(source, own_child(*node, "origin"), "xyz", &text);
}

fn inertias_in_square_millimetres(
    source: &Source,
    links: &[Link],
    moves: &[bool],
    reach: f64,
    warnings: &mut Warnings,
) {
    let shapes = links.iter().flat_map(|link| {
        let collisions = link.collisions.iter().map(|it| (&it.origin, &it.shape));
        collisions.chain(link.visuals.iter().map(|it| (&it.origin, &it.shape)))
    });
    let size = shapes.map(|(origin, shape)| extent(origin, shape)).fold(reach, f64::max);
    let masses = links.iter().zip(moves).filter(|(_, moves)| **moves).filter_map(|(link, _)| link.inertial);
    let whole: f64 = masses.map(|inertial| inertial.mass).sum();
    let square = size.max(1.0).powi(2);
    let odd: Vec<(Node, f64, f64)> = links
        .iter()
        .zip(source.links())
        .zip(moves)
        .filter(|(_, moves)| **moves)
        .filter_map(|((link, node), _)| {
            let inertial = link.inertial.filter(|it| it.mass > 0.0)?;
            let moment = inertial.inertia_at_com.symmetric_eigenvalues().max();
            let odd = moment > SPREAD * inertial.mass * square && moment > whole * square;
            odd.then(|| (own_child(own_child(node, "inertial"), "inertia"), moment, inertial.mass))
        })
        .collect();
    let Some((node, moment, mass)) = odd.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
    let text = format!(
        "a principal moment of {} kg m² is that of {} kg at a distance of {} m, but the robot has a size of {} m: moments are in kg m²; \
         1 kg mm² is 1e-6 kg m²{}",
        short(*moment),
        short(*mass),
        short((moment / mass).sqrt()),
        short(size),
        of_several("the greatest", odd.len(), "links")
    );
    warnings.odd(source, *node, &text);
}

/// Distance of the farthest point of a shape from the origin of its link, or more, m. The size of a mesh is not known here.
fn extent(origin: &Isometry3<f64>, shape: &Shape) -> f64 {
    let own = match shape {
        Shape::Box { size } => size.norm() / 2.0,
        Shape::Sphere { radius } => *radius,
        Shape::Cylinder { radius, length } => Vector3::new(*radius, length / 2.0, 0.0).norm(),
        Shape::Capsule { radius, length } => radius + length / 2.0,
        Shape::Mesh { .. } | Shape::MissingMesh { .. } => 0.0,
    };
    origin.translation.vector.norm() + own
}

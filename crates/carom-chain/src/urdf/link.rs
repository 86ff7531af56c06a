//! Inertia of links: whether it is physically possible, and whether every moving part has mass.

use super::robot::{Inertial, JointType, Link};
use super::source::{Source, own_child};
use super::tree::Tree;
use super::warnings::Warnings;
use super::{joint::pose, robot::Joint};
use crate::error::ChainError;
use nalgebra::Matrix3;

/// Relative violation of the triangle inequality that is accepted as rounding.
const ROUNDED: f64 = 1e-3;

/// An error in an `<inertial>`: the element in it, its attribute, and the rule.
struct Flaw {
    element: &'static str,
    attribute: Option<&'static str>,
    rule: String,
}

/// The inertia of each link. An impossible one on a link that never moves has no effect and is left out, with a warning.
///
/// # Errors
/// An impossible inertia on a link that moves.
pub(super) fn inertials(
    source: &Source,
    urdf: &urdf_rs::Robot,
    moves: &[bool],
    warnings: &mut Warnings,
) -> Result<Vec<Option<Inertial>>, ChainError> {
    let mut inertials = Vec::new();
    for ((link, node), moves) in urdf.links.iter().zip(source.links()).zip(moves) {
        // urdf-rs reads zeros where there is no <inertial>
        let inertial_node = own_child(node, "inertial");
        if inertial_node == node {
            inertials.push(None);
            continue;
        }
        inertials.push(match inertial(&link.inertial) {
            Ok((inertial, remark)) => {
                if let Some(remark) = remark {
                    warnings.odd(source, inertial_node, &remark);
                }
                inertial
            }
            Err(flaw) if *moves => {
                return Err(source.error(own_child(inertial_node, flaw.element), flaw.attribute, flaw.rule));
            }
            Err(flaw) => {
                let text = format!("{}; not used, since the link never moves", flaw.rule);
                warnings.odd(source, own_child(inertial_node, flaw.element), &text);
                None
            }
        });
    }
    Ok(inertials)
}

/// The inertia in link axes, and a warning if it looks wrong.
fn inertial(urdf: &urdf_rs::Inertial) -> Result<(Option<Inertial>, Option<String>), Flaw> {
    let mass = urdf.mass.value;
    let i = &urdf.inertia;
    let matrix = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let bad_mass = |rule| Err(Flaw { element: "mass", attribute: Some("value"), rule });
    if mass < 0.0 {
        return bad_mass(format!("{mass} kg is negative: the mass of a body must be positive"));
    }
    if mass == 0.0 {
        if matrix != Matrix3::zeros() {
            return bad_mass(
                "is 0 kg, but <inertia> is not zero: give the mass of the body, or remove <inertial>".into(),
            );
        }
        let remark = "mass and inertia are zero; read as without <inertial>";
        return Ok((None, Some(remark.into())));
    }
    let remark = check_moments(&matrix)?;
    let placement = pose(&urdf.origin);
    let rotation = placement.rotation.to_rotation_matrix();
    let turned = rotation * matrix * rotation.transpose();
    // the mean of both halves: the products above differ in the last digit
    let inertia_at_com = (turned + turned.transpose()) / 2.0;
    Ok((Some(Inertial { mass, com: placement.translation.vector, inertia_at_com }), remark))
}

/// Principal moments are integrals of y² + z², z² + x² and x² + y²: none is negative, and none exceeds the sum of the
/// other two.
fn check_moments(matrix: &Matrix3<f64>) -> Result<Option<String>, Flaw> {
    let mut moments: [f64; 3] = matrix.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    let [a, b, c] = moments;
    let bad = |rule| Err(Flaw { element: "inertia", attribute: None, rule });
    let [sa, sb, sc, sum] = [a, b, c, a + b].map(short);
    let moments = format!("principal moments {sa}, {sb} and {sc} kg m²");
    if a < -1e-9 * c {
        return bad(format!("{moments}: none may be negative; check signs and the terms ixy, ixz, iyz"));
    }
    let excess = if c > 0.0 { (c - (a + b)) / c } else { 0.0 };
    if excess > ROUNDED {
        return bad(format!(
            "{moments}: {sa} + {sb} = {sum} is less than {sc}, but no principal moment of a body exceeds the sum of the \
             other two; compute the inertia again, about the centre of mass"
        ));
    }
    Ok((excess > 1e-9).then(|| {
        format!(
            "{moments}: the greatest exceeds the sum of the other two by the fraction {excess:.1e} of itself, accepted as \
             rounding"
        )
    }))
}

/// The number to six digits, without the rounding of the eigenvalue iteration.
fn short(number: f64) -> String {
    let rounded = format!("{number:.5e}").parse().unwrap_or(number);
    format!("{rounded}")
}

/// Which links can move relative to the world.
pub(super) fn moving(tree: &Tree, kinds: &[JointType], floating_base: bool) -> Vec<bool> {
    let mut moves = vec![false; tree.ends.len() + 1];
    moves[tree.root] = floating_base;
    for joint in &tree.outwards {
        let (parent, child) = tree.ends[*joint];
        moves[child] = moves[parent] || kinds[*joint] != JointType::Fixed;
    }
    moves
}

/// Checks that every moving joint, and a floating base, moves some mass.
///
/// # Errors
/// The first joint in the file that moves none.
pub(super) fn check_massless(
    source: &Source,
    tree: &Tree,
    links: &[Link],
    joints: &[Joint],
    floating_base: bool,
) -> Result<(), ChainError> {
    let mut carries: Vec<bool> = links.iter().map(|link| link.inertial.is_some()).collect();
    for joint in tree.outwards.iter().rev() {
        let (parent, child) = tree.ends[*joint];
        carries[parent] |= carries[child];
    }
    for (joint, node) in joints.iter().zip(source.joints()) {
        if joint.kind != JointType::Fixed && !carries[joint.child] {
            let rule = format!(
                "moves link '{0}', and neither it nor any link below it has mass: give link '{0}' an <inertial>, or \
                 make the joint fixed",
                links[joint.child].name
            );
            return Err(source.error(node, None, rule));
        }
    }
    if floating_base && !carries[tree.root] {
        let rule = "no link has mass, and a floating base needs mass: give link";
        let rule = format!("{rule} '{}' an <inertial>", links[tree.root].name);
        return Err(source.error(source.root, None, rule));
    }
    Ok(())
}

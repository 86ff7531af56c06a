//! Reads the inertia of motors' rotors from `<transmission>`: the elements `drake:rotor_inertia` and `drake:gear_ratio` of an
//! `<actuator>`, as Drake's parser documents them. `<transmission>` of ROS has no inertia, and none of its data is used.

use super::names::suggestion;
use super::robot::{Joint, JointType};
use super::source::{Source, own_children};
use super::warnings::Warnings;
use crate::error::ChainError;
use roxmltree::Node;

/// Whether a `<transmission>` gives the inertia of a rotor.
pub(super) fn has_rotor(transmission: Node) -> bool {
    own_children(transmission, "actuator").any(|actuator| drake(actuator, "rotor_inertia").is_some())
}

/// Sets [`Joint::rotor_inertia`]: N² I with the gear ratio N (1 where it is not given) and the inertia I of the rotor, summed
/// over the actuators of the joint.
///
/// # Errors
/// A value that is not a finite number, an inertia that is negative.
pub(super) fn read_rotors(source: &Source, joints: &mut [Joint], warnings: &mut Warnings) -> Result<(), ChainError> {
    for transmission in own_children(source.root, "transmission").filter(|node| has_rotor(*node)) {
        let mut driven = own_children(transmission, "joint").filter_map(|node| node.attribute("name"));
        let (Some(name), None) = (driven.next(), driven.next()) else {
            warnings.odd(source, transmission, "does not drive exactly one joint; its rotors are not used");
            continue;
        };
        let Some(j) = joints.iter().position(|joint| joint.name == name) else {
            let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
            let text = format!("no joint is named '{name}': {}; its rotors are not used", suggestion(name, &names));
            warnings.odd(source, transmission, &text);
            continue;
        };
        let joint = &mut joints[j];
        let turns = matches!(joint.kind, JointType::Revolute | JointType::Continuous | JointType::Prismatic);
        if !turns || joint.mimic.is_some() {
            let kind = if turns { "mimic" } else { joint.kind.name() };
            let text =
                format!("a rotor belongs to a joint with one coordinate of its own, and '{name}' is {kind}; not used");
            warnings.odd(source, transmission, &text);
            continue;
        }
        for actuator in own_children(transmission, "actuator") {
            let inertia = number(source, actuator, "rotor_inertia", 0.0)?;
            let ratio = number(source, actuator, "gear_ratio", 1.0)?;
            joint.rotor_inertia += ratio * ratio * inertia;
        }
    }
    Ok(())
}

/// The child of an actuator with this tag in Drake's namespace, whose name varies between files.
fn drake<'a>(actuator: Node<'a, 'a>, tag: &str) -> Option<Node<'a, 'a>> {
    actuator.children().find(|child| {
        let name = child.tag_name();
        name.name() == tag && name.namespace().is_some_and(|namespace| namespace.contains("drake"))
    })
}

/// The attribute `value` of such a child.
fn number<'a>(source: &Source<'a>, actuator: Node<'a, 'a>, tag: &str, missing: f64) -> Result<f64, ChainError> {
    let Some(node) = drake(actuator, tag) else { return Ok(missing) };
    let text =
        node.attribute("value").ok_or_else(|| source.error(node, None, "the attribute value is missing: add it"))?;
    match text.trim().parse::<f64>() {
        Ok(number) if (0.0..1e50).contains(&number) || (tag == "gear_ratio" && number.abs() < 1e50) => Ok(number),
        _ => {
            let kind = if tag == "gear_ratio" {
                "a finite number"
            } else {
                "a finite number that is not negative, kg m² or kg"
            };
            Err(source.error(node, Some("value"), format!("\"{text}\" is wrong: it must be {kind}")))
        }
    }
}

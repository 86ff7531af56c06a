//! Table of the elements and attributes of URDF that are used.

/// An element that is used.
pub(super) struct Element {
    pub tag: &'static str,
    pub occurs: Occurs,
    pub attributes: &'static [Attribute],
    pub children: &'static [Element],
}

/// How often an element may occur in its parent.
#[derive(PartialEq)]
pub(super) enum Occurs {
    AtMostOnce,
    Once,
    Often,
    /// Exactly one of all elements marked so.
    OneOf,
}

/// An attribute that is used.
pub(super) struct Attribute {
    pub name: &'static str,
    pub required: bool,
    pub value: Value,
}

/// Type of an attribute's value.
pub(super) enum Value {
    Text,
    /// Text that is not empty.
    Name,
    JointType,
    /// This many finite numbers, separated by spaces.
    Numbers(usize, Range),
}

/// Allowed range of each number.
#[derive(PartialEq)]
pub(super) enum Range {
    Any,
    NotZero,
    NotNegative,
    Positive,
}

use Occurs::{AtMostOnce, Often, Once, OneOf};
use Range::{Any, NotNegative, NotZero, Positive};
use Value::{JointType, Name, Numbers, Text};

pub(super) const ROBOT: Element =
    element("robot", Once, &[optional("name", Text), optional("version", Text)], &[LINK, JOINT]);

const LINK: Element = element("link", Often, &[required("name", Name)], &[INERTIAL, COLLISION]);

const INERTIAL: Element = element("inertial", AtMostOnce, &[], &[ORIGIN, MASS, INERTIA]);

const MASS: Element = element("mass", Once, &[required("value", Numbers(1, Any))], &[]);

const INERTIA: Element = element(
    "inertia",
    Once,
    &[
        required("ixx", Numbers(1, Any)),
        required("ixy", Numbers(1, Any)),
        required("ixz", Numbers(1, Any)),
        required("iyy", Numbers(1, Any)),
        required("iyz", Numbers(1, Any)),
        required("izz", Numbers(1, Any)),
    ],
    &[],
);

const COLLISION: Element = element("collision", Often, &[optional("name", Text)], &[ORIGIN, GEOMETRY]);

const GEOMETRY: Element = element("geometry", Once, &[], &[BOX, SPHERE, CYLINDER, CAPSULE, MESH]);

const BOX: Element = element("box", OneOf, &[required("size", Numbers(3, Positive))], &[]);

const SPHERE: Element = element("sphere", OneOf, &[RADIUS], &[]);

const CYLINDER: Element = element("cylinder", OneOf, &[RADIUS, LENGTH], &[]);

const CAPSULE: Element = element("capsule", OneOf, &[RADIUS, LENGTH], &[]);

const MESH: Element =
    element("mesh", OneOf, &[required("filename", Name), optional("scale", Numbers(3, NotZero))], &[]);

const RADIUS: Attribute = required("radius", Numbers(1, Positive));

const LENGTH: Attribute = required("length", Numbers(1, Positive));

const JOINT: Element = element(
    "joint",
    Often,
    &[required("name", Name), required("type", JointType)],
    &[PARENT, CHILD, ORIGIN, AXIS, LIMIT, DYNAMICS, MIMIC],
);

const PARENT: Element = element("parent", Once, &[required("link", Name)], &[]);

const CHILD: Element = element("child", Once, &[required("link", Name)], &[]);

const ORIGIN: Element =
    element("origin", AtMostOnce, &[optional("xyz", Numbers(3, Any)), optional("rpy", Numbers(3, Any))], &[]);

const AXIS: Element = element("axis", AtMostOnce, &[required("xyz", Numbers(3, Any))], &[]);

const LIMIT: Element = element(
    "limit",
    AtMostOnce,
    &[
        optional("lower", Numbers(1, Any)),
        optional("upper", Numbers(1, Any)),
        optional("effort", Numbers(1, NotNegative)),
        optional("velocity", Numbers(1, NotNegative)),
    ],
    &[],
);

const DYNAMICS: Element = element(
    "dynamics",
    AtMostOnce,
    &[optional("damping", Numbers(1, NotNegative)), optional("friction", Numbers(1, NotNegative))],
    &[],
);

const MIMIC: Element = element(
    "mimic",
    AtMostOnce,
    &[required("joint", Name), optional("multiplier", Numbers(1, Any)), optional("offset", Numbers(1, Any))],
    &[],
);

const fn element(
    tag: &'static str,
    occurs: Occurs,
    attributes: &'static [Attribute],
    children: &'static [Element],
) -> Element {
    Element { tag, occurs, attributes, children }
}

const fn required(name: &'static str, value: Value) -> Attribute {
    Attribute { name, required: true, value }
}

const fn optional(name: &'static str, value: Value) -> Attribute {
    Attribute { name, required: false, value }
}

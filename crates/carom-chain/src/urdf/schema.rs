//! Table of the elements and attributes of URDF that are used.

/// Tags of the URDF specification and of common extensions that this crate does not use. Other tags are unknown.
pub(super) const UNUSED: [&str; 9] = [
    "calibration",
    "contact",
    "gazebo",
    "mujoco",
    "ros2_control",
    "safety_controller",
    "sensor",
    "transmission",
    "verbose",
];

/// Elements of which `visual` uses what can be drawn.
pub(super) const DRAWN: [&str; 2] = ["material", "visual"];

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
    /// The specification requires it once; without it, the text says what is assumed.
    Expected(&'static str),
    Often,
    /// At most one of all elements marked so.
    OneOf,
}

/// An attribute that is used.
pub(super) struct Attribute {
    pub name: &'static str,
    pub presence: Presence,
    pub value: Value,
}

/// Whether an attribute may be missing.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Presence {
    Required,
    Optional,
    /// Optional, with this default, which also replaces a wrong count of numbers.
    Default(&'static str),
    /// Required by the specification; this value replaces a missing one and a wrong count of numbers.
    Assumed(&'static str),
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
    NotNegative,
}

use Occurs::{AtMostOnce, Expected, Often, Once, OneOf};
use Range::{Any, NotNegative};
use Value::{JointType, Name, Numbers, Text};

pub(super) const ROBOT: Element =
    element("robot", Once, &[optional("name", Text), optional("version", Text)], &[LINK, JOINT]);

const LINK: Element = element("link", Often, &[required("name", Name)], &[INERTIAL, COLLISION]);

const INERTIAL: Element = element("inertial", AtMostOnce, &[], &[ORIGIN, MASS, INERTIA]);

const MASS: Element = element("mass", Once, &[required("value", Numbers(1, Any))], &[]);

const INERTIA: Element = element(
    "inertia",
    Expected("zero: the mass is a point"),
    &[
        required("ixx", Numbers(1, Any)),
        assumed("ixy", Numbers(1, Any), "0"),
        assumed("ixz", Numbers(1, Any), "0"),
        required("iyy", Numbers(1, Any)),
        assumed("iyz", Numbers(1, Any), "0"),
        required("izz", Numbers(1, Any)),
    ],
    &[],
);

const COLLISION: Element = element("collision", Often, &[optional("name", Text)], &[ORIGIN, GEOMETRY]);

pub(super) const GEOMETRY: Element = element("geometry", Once, &[], &[BOX, SPHERE, CYLINDER, CAPSULE, MESH]);

const BOX: Element = element("box", OneOf, &[required("size", Numbers(3, NotNegative))], &[]);

const SPHERE: Element = element("sphere", OneOf, &[RADIUS], &[]);

const CYLINDER: Element = element("cylinder", OneOf, &[RADIUS, LENGTH], &[]);

const CAPSULE: Element = element("capsule", OneOf, &[RADIUS, LENGTH], &[]);

const MESH: Element =
    element("mesh", OneOf, &[required("filename", Name), default("scale", Numbers(3, Any), "1 1 1")], &[]);

const RADIUS: Attribute = required("radius", Numbers(1, NotNegative));

const LENGTH: Attribute = required("length", Numbers(1, NotNegative));

const JOINT: Element = element(
    "joint",
    Often,
    &[required("name", Name), required("type", JointType)],
    &[PARENT, CHILD, ORIGIN, AXIS, LIMIT, DYNAMICS, MIMIC],
);

const PARENT: Element = element("parent", Once, &[required("link", Name)], &[]);

const CHILD: Element = element("child", Once, &[required("link", Name)], &[]);

const ORIGIN: Element = element("origin", AtMostOnce, &[zeros("xyz", 3), zeros("rpy", 3)], &[]);

const AXIS: Element = element("axis", AtMostOnce, &[assumed("xyz", Numbers(3, Any), "1 0 0")], &[]);

const LIMIT: Element = element(
    "limit",
    AtMostOnce,
    &[
        zeros("lower", 1),
        zeros("upper", 1),
        optional("effort", Numbers(1, NotNegative)),
        optional("velocity", Numbers(1, NotNegative)),
    ],
    &[],
);

const DYNAMICS: Element = element(
    "dynamics",
    AtMostOnce,
    &[default("damping", Numbers(1, NotNegative), "0"), default("friction", Numbers(1, NotNegative), "0")],
    &[],
);

const MIMIC: Element = element(
    "mimic",
    AtMostOnce,
    &[required("joint", Name), default("multiplier", Numbers(1, Any), "1"), zeros("offset", 1)],
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
    Attribute { name, presence: Presence::Required, value }
}

const fn optional(name: &'static str, value: Value) -> Attribute {
    Attribute { name, presence: Presence::Optional, value }
}

const fn default(name: &'static str, value: Value, text: &'static str) -> Attribute {
    Attribute { name, presence: Presence::Default(text), value }
}

const fn zeros(name: &'static str, count: usize) -> Attribute {
    default(name, Numbers(count, Any), if count == 1 { "0" } else { "0 0 0" })
}

const fn assumed(name: &'static str, value: Value, text: &'static str) -> Attribute {
    Attribute { name, presence: Presence::Assumed(text), value }
}

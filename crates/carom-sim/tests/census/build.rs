//! Builders of robots and scenes, with random numbers.

use fastrand::Rng;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

pub type V = Vector3<f64>;
pub const X: [f64; 3] = [1.0, 0.0, 0.0];
pub const Y: [f64; 3] = [0.0, 1.0, 0.0];
pub const Z: [f64; 3] = [0.0, 0.0, 1.0];
pub const O: [f64; 3] = [0.0; 3];
pub const LAWS: [&str; 8] =
    ["frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith"];
pub const SEVERAL: [&str; 4] = ["moreau", "poisson", "sequential", "energetic"];

pub fn within(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

pub fn one_of<T: Copy>(rng: &mut Rng, these: &[T]) -> T {
    these[rng.usize(0..these.len())]
}

pub fn direction(rng: &mut Rng) -> V {
    loop {
        let v = V::from_fn(|_, _| within(rng, -1.0, 1.0));
        if (0.1..1.0).contains(&v.norm()) {
            return v.normalize();
        }
    }
}

/// Roll, pitch, yaw of a random rotation.
pub fn turn(rng: &mut Rng) -> [f64; 3] {
    let (roll, pitch, yaw) =
        UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_unchecked(direction(rng)), within(rng, 0.0, PI))
            .euler_angles();
    [roll, pitch, yaw]
}

pub fn rotation(rpy: [f64; 3]) -> Rotation3<f64> {
    Rotation3::from_euler_angles(rpy[0], rpy[1], rpy[2])
}

/// Numbers with spaces, as URDF has them, to the bit.
pub fn xml(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ")
}

/// Numbers as a TOML array, to the bit.
pub fn list(numbers: &[f64]) -> String {
    format!("[{}]", numbers.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", "))
}

/// A collision shape: its element, at a place.
pub fn shape(element: &str, at: [f64; 3], rpy: [f64; 3]) -> String {
    let (at, rpy) = (xml(&at), xml(&rpy));
    format!(r#"<collision><origin xyz="{at}" rpy="{rpy}"/><geometry>{element}</geometry></collision>"#)
}

pub fn ball(radius: f64) -> String {
    format!(r#"<sphere radius="{radius:?}"/>"#)
}

pub fn brick(size: [f64; 3]) -> String {
    format!(r#"<box size="{}"/>"#, xml(&size))
}

pub fn cylinder(radius: f64, length: f64) -> String {
    format!(r#"<cylinder radius="{radius:?}" length="{length:?}"/>"#)
}

pub fn capsule(radius: f64, length: f64) -> String {
    format!(r#"<capsule radius="{radius:?}" length="{length:?}"/>"#)
}

/// A box as an OBJ mesh.
pub fn brick_mesh(size: [f64; 3]) -> String {
    let mut text = String::new();
    for k in 0..8 {
        let at = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { 0.5 * size[axis] } else { -0.5 * size[axis] });
        text += &format!("v {}\n", xml(&at));
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
    }
    text
}

/// A link with the joint that carries it.
#[derive(Clone)]
pub struct Part {
    pub name: String,
    pub parent: String,
    pub joint: &'static str,
    pub axis: [f64; 3],
    pub at: [f64; 3],
    pub rpy: [f64; 3],
    /// Elements of the joint.
    pub more: String,
    pub mass: f64,
    pub com: [f64; 3],
    pub inertia: [f64; 3],
    pub shapes: String,
}

impl Part {
    /// The joint has the name of the link with a `j` before it. Mass 1, inertia 0.01 on all axes.
    pub fn new(name: &str, parent: &str, joint: &'static str, axis: [f64; 3], at: [f64; 3]) -> Self {
        let (name, parent) = (name.to_owned(), parent.to_owned());
        let (more, shapes) = (String::new(), String::new());
        Self { name, parent, joint, axis, at, rpy: O, more, mass: 1.0, com: O, inertia: [0.01; 3], shapes }
    }

    pub fn turned(self, rpy: [f64; 3]) -> Self {
        Self { rpy, ..self }
    }

    pub fn with(mut self, shape: String) -> Self {
        self.shapes += &shape;
        self
    }

    pub fn joint(mut self, element: &str) -> Self {
        self.more += element;
        self
    }

    pub fn weighing(self, mass: f64, inertia: [f64; 3]) -> Self {
        Self { mass, inertia, ..self }
    }

    /// Random inertia of a body of about this size.
    pub fn random(mut self, rng: &mut Rng, size: f64) -> Self {
        self.mass = within(rng, 0.3, 3.0);
        self.com = [0.0; 3].map(|_: f64| within(rng, -0.3, 0.3) * size);
        let [a, b, c] = [0.0; 3].map(|_: f64| within(rng, 0.1, 1.0) * 0.1 * self.mass * size * size);
        self.inertia = [b + c, a + c, a + b];
        self
    }

    /// The link alone.
    pub fn link(&self) -> String {
        let Self { name, shapes, mass, .. } = self;
        let [ixx, iyy, izz] = self.inertia.map(|x| format!("{x:?}"));
        let com = xml(&self.com);
        let moments = format!(r#"<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/>"#);
        let inertia = match *mass {
            0.0 => String::new(),
            _ => format!(r#"<inertial><origin xyz="{com}"/><mass value="{mass:?}"/>{moments}</inertial>"#),
        };
        format!("<link name=\"{name}\">{inertia}{shapes}</link>\n")
    }

    fn write(&self) -> String {
        let Self { name, parent, joint, more, .. } = self;
        let (at, rpy, axis) = (xml(&self.at), xml(&self.rpy), xml(&self.axis));
        let limited = ["revolute", "prismatic"].contains(joint) && !more.contains("<limit");
        let limit = if limited { r#"<limit lower="-50" upper="50" effort="1000" velocity="1000"/>"# } else { "" };
        format!(
            "{}<joint name=\"j{name}\" type=\"{joint}\"><parent link=\"{parent}\"/><child link=\"{name}\"/>\
             <origin xyz=\"{at}\" rpy=\"{rpy}\"/><axis xyz=\"{axis}\"/>{limit}{more}</joint>\n",
            self.link()
        )
    }
}

/// A robot with the massless root link `base`.
pub fn urdf(parts: &[Part]) -> String {
    rooted("<link name=\"base\"/>\n", parts)
}

/// A robot with this root link.
pub fn rooted(root: &str, parts: &[Part]) -> String {
    let parts: String = parts.iter().map(Part::write).collect();
    format!("<robot name=\"r\">\n{root}{parts}</robot>\n")
}

/// Where and how a whole scene is put into space.
#[derive(Clone, Copy)]
pub struct Place {
    pub at: V,
    pub rpy: [f64; 3],
}

impl Place {
    /// Upright, turned by right angles, or turned at random: in the last case zeros of the upright scene are rounding.
    pub fn random(rng: &mut Rng) -> Self {
        let right = |rng: &mut Rng| 0.5 * PI * rng.i32(0..4) as f64;
        let (at, rpy) = match rng.usize(0..10) {
            0 => (V::zeros(), O),
            1 | 2 => (V::from_fn(|_, _| within(rng, -1.0, 1.0)), [right(rng), right(rng), right(rng)]),
            _ => (V::from_fn(|_, _| within(rng, -2.0, 2.0)), turn(rng)),
        };
        Self { at, rpy }
    }

    pub fn point(&self, p: V) -> V {
        self.at + rotation(self.rpy) * p
    }

    pub fn vector(&self, v: V) -> V {
        rotation(self.rpy) * v
    }

    /// A fixed joint from `base` to the link `mount`, to which the robot is attached.
    pub fn mount(&self) -> Part {
        Part::new("mount", "base", "fixed", Z, self.at.into()).turned(self.rpy).weighing(0.0, O)
    }

    pub fn halfspace(&self, name: &str, point: V, normal: V) -> String {
        let (point, normal) = (self.point(point), self.vector(normal));
        let (point, normal) = (list(point.as_slice()), list(normal.as_slice()));
        format!("[[surface]]\nname = \"{name}\"\nshape = {{ halfspace = {{ point = {point}, normal = {normal} }} }}\n")
    }

    pub fn gravity(&self, g: V) -> String {
        format!("gravity = {}\n", list(self.vector(g).as_slice()))
    }
}

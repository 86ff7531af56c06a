//! Builders of robots and scenes, with random numbers.

pub use carom_testing::build::{O, Part, X, Y, Z, ball, brick, capsule, cylinder, rooted, shape, urdf, xml};
use fastrand::Rng;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

pub type V = Vector3<f64>;
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

/// Numbers as a TOML array, to the bit.
pub fn list(numbers: &[f64]) -> String {
    format!("[{}]", numbers.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", "))
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

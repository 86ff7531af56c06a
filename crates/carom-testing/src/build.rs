//! Robots from parts: a part is a link with the joint that carries it.

use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use fastrand::Rng;
use nalgebra::Matrix2;

/// Axes, and the origin.
pub const X: [f64; 3] = [1.0, 0.0, 0.0];
/// The axis y.
pub const Y: [f64; 3] = [0.0, 1.0, 0.0];
/// The axis z.
pub const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// The origin, or no rotation.
pub const O: [f64; 3] = [0.0; 3];

/// Numbers with spaces, as URDF has them, to the bit.
pub fn xml(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ")
}

/// A collision shape: its element, at a place.
pub fn shape(element: &str, at: [f64; 3], rpy: [f64; 3]) -> String {
    let (at, rpy) = (xml(&at), xml(&rpy));
    format!(r#"<collision><origin xyz="{at}" rpy="{rpy}"/><geometry>{element}</geometry></collision>"#)
}

/// The element of a ball.
pub fn ball(radius: f64) -> String {
    format!(r#"<sphere radius="{radius:?}"/>"#)
}

/// The element of a box.
pub fn brick(size: [f64; 3]) -> String {
    format!(r#"<box size="{}"/>"#, xml(&size))
}

/// The element of a cylinder about z.
pub fn cylinder(radius: f64, length: f64) -> String {
    format!(r#"<cylinder radius="{radius:?}" length="{length:?}"/>"#)
}

/// The element of a capsule about z.
pub fn capsule(radius: f64, length: f64) -> String {
    format!(r#"<capsule radius="{radius:?}" length="{length:?}"/>"#)
}

/// The text of an STL file, by the corners of each triangle.
pub fn stl(triangles: impl IntoIterator<Item = [[f64; 3]; 3]>) -> String {
    let corner = |corner: [f64; 3]| format!("vertex {}\n", xml(&corner));
    let facet = |corners: [[f64; 3]; 3]| {
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.map(corner).concat())
    };
    format!("solid s\n{}endsolid s\n", triangles.into_iter().map(facet).collect::<String>())
}

/// The principal moments of a uniform box about its centre, kg m².
pub fn box_inertia(mass: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    [(y, z), (x, z), (x, y)].map(|(a, b)| mass * (a * a + b * b) / 12.0)
}

/// A link with the joint that carries it.
#[derive(Clone, Debug)]
pub struct Part {
    /// Of the link; the joint has this name with a `j` before it.
    pub name: String,
    /// The link on which it is.
    pub parent: String,
    /// The type of the joint.
    pub joint: &'static str,
    /// The axis of the joint.
    pub axis: [f64; 3],
    /// The place of the joint on the parent, m.
    pub at: [f64; 3],
    /// Roll, pitch, yaw of the joint.
    pub rpy: [f64; 3],
    /// Elements of the joint.
    pub more: String,
    /// kg; a link with mass 0 has no `<inertial>`.
    pub mass: f64,
    /// Centre of mass, m.
    pub com: [f64; 3],
    /// Moments of inertia about the axes of the link, kg m².
    pub inertia: [f64; 3],
    /// Products of inertia xy, xz, yz, kg m².
    pub products: [f64; 3],
    /// Collision elements.
    pub shapes: String,
}

impl Part {
    /// Mass 1, inertia 0.01 on all axes.
    pub fn new(name: &str, parent: &str, joint: &'static str, axis: [f64; 3], at: [f64; 3]) -> Self {
        let (name, parent) = (name.to_owned(), parent.to_owned());
        let (more, shapes) = (String::new(), String::new());
        Self { name, parent, joint, axis, at, rpy: O, more, mass: 1.0, com: O, inertia: [0.01; 3], products: O, shapes }
    }

    /// A part that slides, with its joint in the origin of the parent.
    pub fn slider(name: &str, parent: &str, axis: [f64; 3]) -> Self {
        Self::new(name, parent, "prismatic", axis, O)
    }

    /// A part on a hinge without limits, with its joint in the origin of the parent.
    pub fn hinge(name: &str, parent: &str, axis: [f64; 3]) -> Self {
        Self::new(name, parent, "continuous", axis, O)
    }

    /// At this place on the parent.
    pub fn at(self, at: [f64; 3]) -> Self {
        Self { at, ..self }
    }

    /// Turned by roll, pitch and yaw.
    pub fn turned(self, rpy: [f64; 3]) -> Self {
        Self { rpy, ..self }
    }

    /// With one more collision element.
    pub fn with(mut self, shape: String) -> Self {
        self.shapes += &shape;
        self
    }

    /// With one more collision shape about its origin, by its element.
    pub fn shaped(self, element: &str) -> Self {
        self.with(shape(element, O, O))
    }

    /// With one more element of the joint.
    pub fn joint(mut self, element: &str) -> Self {
        self.more += element;
        self
    }

    /// With the limits of its coordinate, and its greatest effort.
    pub fn limits(self, lower: f64, upper: f64, effort: f64) -> Self {
        self.joint(&format!(r#"<limit lower="{lower:?}" upper="{upper:?}" effort="{effort:?}" velocity="1000"/>"#))
    }

    /// With a mass and principal moments.
    pub fn weighing(self, mass: f64, inertia: [f64; 3]) -> Self {
        Self { mass, inertia, ..self }
    }

    /// With products of inertia xy, xz, yz.
    pub fn products(self, products: [f64; 3]) -> Self {
        Self { products, ..self }
    }

    /// Without mass and inertia.
    pub fn massless(self) -> Self {
        self.weighing(0.0, O)
    }

    /// With its centre of mass at this place.
    pub fn com(self, com: [f64; 3]) -> Self {
        Self { com, ..self }
    }

    /// Random inertia of a body of about this size.
    pub fn random(mut self, rng: &mut Rng, size: f64) -> Self {
        let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
        self.mass = within(0.3, 3.0);
        self.com = [0.0; 3].map(|_: f64| within(-0.3, 0.3) * size);
        let [a, b, c] = [0.0; 3].map(|_: f64| within(0.1, 1.0) * 0.1 * self.mass * size * size);
        self.inertia = [b + c, a + c, a + b];
        self
    }

    /// The link alone.
    pub fn link(&self) -> String {
        let Self { name, shapes, mass, .. } = self;
        let [ixx, iyy, izz] = self.inertia.map(|x| format!("{x:?}"));
        let [ixy, ixz, iyz] = self.products;
        let com = xml(&self.com);
        let moments = format!(r#"<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="{ixy}" ixz="{ixz}" iyz="{iyz}"/>"#);
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

/// The chain of a URDF.
#[track_caller]
pub fn of_urdf(text: &str) -> Chain {
    Chain::from_urdf_str(text, &LoadOptions::default()).unwrap_or_else(|why| panic!("{why}\n{text}"))
}

/// The chain of a URDF on a floating base.
#[track_caller]
pub fn floating_urdf(text: &str) -> Chain {
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    Chain::from_urdf_str(text, &options).unwrap_or_else(|why| panic!("{why}\n{text}"))
}

/// The chain of a robot with the massless root link `base`, which does not move.
#[track_caller]
pub fn chain(parts: &[Part]) -> Chain {
    of_urdf(&urdf(parts))
}

/// A body alone, as a URDF.
pub fn one_body(mass: f64, inertia: [f64; 3], shapes: &str) -> String {
    rooted(&Part::new("body", "", "fixed", Z, O).weighing(mass, inertia).with(shapes.to_owned()).link(), &[])
}

/// A body that floats: q = (x, y, z, quaternion x, y, z, w).
pub fn free(mass: f64, inertia: [f64; 3], shapes: &str) -> Chain {
    floating_urdf(&one_body(mass, inertia, shapes))
}

/// A uniform box that floats.
pub fn floating_box(size: [f64; 3], mass: f64) -> Chain {
    free(mass, box_inertia(mass, size), &shape(&brick(size), O, O))
}

/// A body that moves in the x–z plane: q = (x, z, angle about y).
pub fn in_plane(mass: f64, inertia: f64, shapes: &str) -> Chain {
    let body = Part::hinge("body", "b", Y).weighing(mass, [inertia; 3]).with(shapes.to_owned());
    chain(&[Part::slider("a", "base", X).massless(), Part::slider("b", "a", Z).massless(), body])
}

/// A body that slides along these axes in turn without turning; q are its displacements along them.
pub fn along(axes: &[[f64; 3]], mass: f64, inertia: [f64; 3], element: &str) -> Chain {
    let name = |k: usize| if k == 0 { "base".into() } else { format!("l{k}") };
    let rails = axes.iter().enumerate().map(|(k, axis)| {
        let part = Part::slider(&name(k + 1), &name(k), *axis).limits(-1000.0, 1000.0, 0.0);
        if k + 1 == axes.len() { part.weighing(mass, inertia).shaped(element) } else { part.massless() }
    });
    chain(&rails.collect::<Vec<_>>())
}

/// M of the robot `planar2` of the repository, by the formula at its head: p₁ = 3.473, p₂ = 0.196, p₃ = 0.242 kg m².
pub fn planar2_mass(elbow: f64) -> Matrix2<f64> {
    let (p1, p2, p3) = (3.473, 0.196, 0.242 * elbow.cos());
    Matrix2::new(p1 + 2.0 * p3, p2 + p3, p2 + p3, p2)
}

/// A ball of 2 kg and 0.1 m on a vertical slider.
pub fn falling_ball() -> Chain {
    along(&[Z], 2.0, [0.008; 3], &ball(0.1))
}

/// Two arms of two links on one base; the right one has a ball at its end.
pub fn two_arms() -> String {
    let link = |name: &str, parent: &str, x: f64| {
        let part = Part::hinge(name, parent, Z).at([x, 0.0, 0.0]).com([0.15, 0.0, 0.0]);
        part.weighing(1.0, [0.001, 0.01, 0.01])
    };
    let tip = shape(&ball(0.02), [0.3, 0.0, 0.0], O);
    urdf(&[
        link("left1", "base", -1.0),
        link("left2", "left1", 0.3),
        link("right1", "base", 0.2),
        link("right2", "right1", 0.3).with(tip),
    ])
}

/// An arm whose hand is a box.
pub fn arm_with_hand() -> String {
    let arm = Part::hinge("arm", "base", Z).com([0.3, 0.0, 0.0]).weighing(2.0, [0.01, 0.1, 0.1]);
    let hand = Part::hinge("hand", "arm", Z).at([0.6, 0.0, 0.0]).com([0.1, 0.0, 0.0]).weighing(1.0, [0.01, 0.02, 0.02]);
    urdf(&[arm, hand.with(shape(&brick([0.2, 0.1, 0.06]), [0.1, 0.0, 0.0], O))])
}

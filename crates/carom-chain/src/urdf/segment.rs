//! A slender link as rigid segments joined by elastic hinges: the static deflection and the lowest bending modes of a beam.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | L, d | length and direction of the beam |
//! | s | distance from its first end, 0 … L |
//! | n | number of bends, at s = (k − ½) L/n for k = 1 … n |
//! | E I | bending stiffness, N m² |
//! | k = n E I/L | stiffness of a bend: each takes the bending of its element of length L/n, N m/rad |
//! | ρ(s) = (m/L) (1 + β (2 s/L − 1)) | mass per length, kg/m; β from the centre of mass |
//!
//! Finite segment method: R. L. Huston, *Multi-body dynamics including the effects of flexibility and compliance*, Computers &
//! Structures 14 (1981) 443. A cantilever under a force at its end deflects by F L³/(3 E I) · (1 − 1/(4 n²)).

use super::names::suggestion;
use super::robot::{Inertial, Joint, JointType, Link, Robot};
use crate::error::ChainError;
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

/// Negative moments of a segment up to this share of the greatest are rounding of the numbers in the file.
const ROUNDED: f64 = 1e-6;

/// The largest part of a unit axis of bending along the beam: the digits of a file.
const NORMAL: f64 = 1e-6;

/// A link that bends, for [`Robot::with_segments`].
#[derive(Debug, Clone, PartialEq)]
pub struct Beam {
    /// Ends of the part that bends, in link axes, m.
    pub ends: [Vector3<f64>; 2],
    /// Number of bends, at least 1.
    pub bends: usize,
    /// One or two axes of bending, in link axes and normal to the beam, each with the bending stiffness E I about it, N m².
    pub stiffness: Vec<(Vector3<f64>, f64)>,
}

/// An elastic hinge between two segments.
#[derive(Debug, Clone, PartialEq)]
pub struct Bend {
    /// Name of the joint: `<link>_bend<k>`, of two axes `<link>_bend<k>a` and `<link>_bend<k>b`.
    pub joint: String,
    /// Stiffness of the spring that it needs, with rest position 0, N m/rad.
    pub stiffness: f64,
}

impl Robot {
    /// The same robot with a slender link divided into `beam.bends` + 1 rigid segments, and the hinges between them. The first
    /// segment keeps the name and the frame of the link; the others are `<link>_part<k>`, with frames at their hinges and the axes
    /// of the link while it is straight. The new joints come after those of the file.
    ///
    /// Mass, centre of mass and inertia of the straight link are those of the file: the mass is distributed linearly along the
    /// beam. The difference between the link's inertia and that of this line of mass is divided among the segments in proportion to
    /// their masses. Joints, collision and visual shapes of the link move with the segment that contains their origin; a shape that
    /// is longer than a segment stays whole. Springs are not part of a chain: a simulation needs one for each bend.
    ///
    /// # Errors
    /// [`ChainError::UnknownFrame`]; [`ChainError::Beam`] if the link has no mass, its centre of mass is not in the middle third
    /// of the beam, it has less inertia than a line of mass, an axis is not normal to the beam, a number is not positive and
    /// finite, or the robot has a name of a new link or joint already.
    pub fn with_segments(&self, link: &str, beam: &Beam) -> Result<(Self, Vec<Bend>), ChainError> {
        let Some(at) = self.links.iter().position(|it| it.name == link) else {
            let names: Vec<&str> = self.links.iter().map(|it| it.name.as_str()).collect();
            return Err(ChainError::UnknownFrame { name: link.into(), hint: suggestion(link, &names) });
        };
        let refuse = |problem: String| ChainError::Beam { link: link.into(), problem };
        let line = Line::of(beam).map_err(refuse)?;
        let mut robot = self.clone();
        let whole = &self.links[at];
        let inertials = line.inertials(whole.inertial).map_err(refuse)?;

        robot.links[at] = Link { inertial: Some(inertials[0]), ..Link::new(link) };
        // index of the link of each segment, and its origin in the link's frame
        let (mut segments, mut bends) = (vec![(at, Vector3::zeros())], Vec::new());
        for (k, inertial) in (1..).zip(&inertials[1..]) {
            let (mut parent, mut from) = segments[k - 1];
            let hinge = line.hinge(k);
            let letters: &[&str] = if beam.stiffness.len() == 1 { &[""] } else { &["a", "b"] };
            for (j, (letter, (axis, stiffness))) in letters.iter().zip(&beam.stiffness).enumerate() {
                let last = j + 1 == letters.len();
                let (child, joint) = (robot.links.len(), format!("{link}_bend{k}{letter}"));
                robot.links.push(Link::new(if last {
                    format!("{link}_part{}", k + 1)
                } else {
                    format!("{link}_hinge{k}")
                }));
                bends.push(Bend { joint: joint.clone(), stiffness: stiffness * line.bends as f64 / line.length });
                robot.joints.push(Joint {
                    origin: shifted(hinge - from),
                    axis: Unit::new_normalize(*axis),
                    ..Joint::new(joint, JointType::Continuous, parent, child)
                });
                (parent, from) = (child, hinge);
            }
            robot.links[parent].inertial = Some(Inertial { com: inertial.com - hinge, ..*inertial });
            segments.push((parent, hinge));
        }

        let moved = |origin: &Isometry3<f64>| {
            let (segment, from) = segments[line.segment(origin.translation.vector)];
            (segment, shifted(-from) * origin)
        };
        for joint in robot.joints.iter_mut().take(self.joints.len()).filter(|joint| joint.parent == at) {
            (joint.parent, joint.origin) = moved(&joint.origin);
        }
        for shape in &whole.collisions {
            let (segment, origin) = moved(&shape.origin);
            robot.links[segment].collisions.push(super::Collision { origin, ..shape.clone() });
        }
        for shape in &whole.visuals {
            let (segment, origin) = moved(&shape.origin);
            robot.links[segment].visuals.push(super::Visual { origin, ..shape.clone() });
        }
        for [a, b] in self.disabled_pairs.iter().filter(|pair| pair.iter().any(|name| name == link)) {
            let other = if a == link { b } else { a };
            let names = segments[1..].iter().map(|(segment, _)| robot.links[*segment].name.clone());
            robot.disabled_pairs.extend(names.map(|name| [name, other.clone()]));
        }
        let twin = robot.links[self.links.len()..]
            .iter()
            .map(|it| &it.name)
            .find(|name| self.links.iter().any(|it| it.name == **name));
        let twin = twin
            .or_else(|| bends.iter().map(|it| &it.joint).find(|name| self.joints.iter().any(|it| it.name == **name)));
        match twin {
            Some(name) => Err(refuse(format!("the robot has the name '{name}' already: rename it"))),
            None => Ok((robot, bends)),
        }
    }
}

/// A pose without rotation.
fn shifted(by: Vector3<f64>) -> Isometry3<f64> {
    Isometry3::translation(by.x, by.y, by.z)
}

/// A checked beam.
struct Line {
    from: Vector3<f64>,
    along: Vector3<f64>,
    length: f64,
    bends: usize,
}

impl Line {
    fn of(beam: &Beam) -> Result<Self, String> {
        let along = beam.ends[1] - beam.ends[0];
        let length = along.norm();
        if !(length > 0.0 && length.is_finite()) {
            return Err(format!("its ends are {length} m apart: the length must be positive and finite"));
        }
        let along = along / length;
        if beam.bends == 0 {
            return Err("0 bends: give at least 1".into());
        }
        if !(1..=2).contains(&beam.stiffness.len()) {
            return Err(format!("{} axes of bending: give one or two", beam.stiffness.len()));
        }
        for (axis, stiffness) in &beam.stiffness {
            if !(*stiffness > 0.0 && stiffness.is_finite()) {
                return Err(format!("bending stiffness {stiffness} N m²: it must be positive and finite"));
            }
            let share = axis.dot(&along).abs() / axis.norm();
            if share.is_nan() || share > NORMAL {
                let [x, y, z]: [f64; 3] = (*axis).into();
                return Err(format!("axis of bending ({x}, {y}, {z}): it must be normal to the beam"));
            }
        }
        Ok(Self { from: beam.ends[0], along, length, bends: beam.bends })
    }

    /// Distance of bend k = 1 … n from the first end, m.
    fn place(&self, k: usize) -> f64 {
        (k as f64 - 0.5) * self.length / self.bends as f64
    }

    /// Position of bend k in the link's frame, m.
    fn hinge(&self, k: usize) -> Vector3<f64> {
        self.from + self.along * self.place(k)
    }

    /// The segment, counted from 0, whose range contains a point of the link's frame.
    fn segment(&self, point: Vector3<f64>) -> usize {
        let s = (point - self.from).dot(&self.along);
        (1..=self.bends).take_while(|k| self.place(*k) <= s).count()
    }

    /// The inertias of the segments, with centres of mass in the link's frame.
    fn inertials(&self, whole: Option<Inertial>) -> Result<Vec<Inertial>, String> {
        let Some(Inertial { mass, com, inertia_at_com }) = whole.filter(|it| it.mass > 0.0) else {
            return Err("it has no mass that could be distributed".into());
        };
        let (l, centre) = (self.length, (com - self.from).dot(&self.along));
        let beta = 6.0 * (centre / l - 0.5);
        if beta.abs() > 1.0 {
            let (low, high) = (l / 3.0, 2.0 * l / 3.0);
            return Err(format!(
                "its centre of mass is {centre} m from the first end: no linear distribution of mass along {l} m has it \
                 outside {low} … {high} m; choose other ends"
            ));
        }
        let across = Matrix3::identity() - self.along * self.along.transpose();
        // the inertia beyond that of the line of mass
        let rest = inertia_at_com - across * (mass * l * l * (1.0 / 12.0 - beta * beta / 36.0));
        let largest = inertia_at_com.symmetric_eigenvalues().max();
        let segment = |k: usize| {
            let a = if k == 0 { 0.0 } else { self.place(k) };
            let b = if k == self.bends { l } else { self.place(k + 1) };
            let power = |n: i32| b.powi(n) - a.powi(n);
            let share = (1.0 - beta) * power(1) / l + beta * power(2) / (l * l);
            let first = (1.0 - beta) * power(2) / (2.0 * l) + 2.0 * beta * power(3) / (3.0 * l * l);
            let second = (1.0 - beta) * power(3) / (3.0 * l) + beta * power(4) / (2.0 * l * l);
            let own = mass * (second - first * first / share);
            let inertia_at_com = across * own + rest * share;
            let least = inertia_at_com.symmetric_eigenvalues().min();
            if least < -ROUNDED * largest {
                return Err(format!(
                    "its inertia is less than that of its mass along the beam: segment {} would have the principal moment \
                     {least} kg m²; choose ends that are nearer",
                    k + 1
                ));
            }
            let com = com + self.along * (first / share - centre);
            Ok(Inertial { mass: mass * share, com, inertia_at_com })
        };
        (0..=self.bends).map(segment).collect()
    }
}

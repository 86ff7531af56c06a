//! Bodies and joints prepared for the recursions: quantities that do not depend on the configuration are precomputed.
//!
//! The placement of a hinge is R = R_z(a) R_x(b) R_z(c), with z its axis. c is added to the hinge's angle at no cost. a is 0
//! or π if the axes are parallel, or if x is their common perpendicular; for a = π, R_z(π) R_x(b) = R_x(−b) R_z(π). What
//! remains is a rotation about x (a tilt), or the identity. A tilt costs 18 operations, a product of rotations 45. The axes
//! of the bodies do not change, so points and frames do not change either.

use crate::algebra::{Algebra, Inertia, Pose, Real};
use crate::base_parameters::base_parameters;
use crate::chain::Body;
use crate::turned::Angle;
use nalgebra::convert;
use std::ops::AddAssign;

/// One body and its parent joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step<A: Algebra> {
    pub joint: A::Joint,
    pub placing: Placing<A>,
    /// Position of the joint's origin in the parent body, parent axes, m.
    pub translation: A::Vector,
    /// Joint position = `ratio` · q + `shift`.
    pub ratio: A::Scalar,
    /// See `ratio`.
    pub shift: A::Scalar,
    /// Base inertial parameters: see [`base_parameters`].
    pub inertia: Inertia<A>,
    pub parent: Option<usize>,
    pub q_index: usize,
    pub v_index: usize,
    /// First body of the run that ends with this one: consecutive bodies, each the parent of the next.
    pub run: usize,
    /// End of its subtree, which is the range from this body to `end`, because bodies are numbered depth first.
    pub end: usize,
    /// Whether it has more than one child.
    pub branches: bool,
    /// Where an inward pass stores its contribution to its parent.
    pub held_by: Held,
    /// Whether no base inertial parameters of its subtree have mass.
    pub massless: bool,
}

/// Where an inward pass stores the contribution of a body to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Held {
    /// Nowhere: the parent is the world, and there is nothing to accumulate.
    World,
    /// Nowhere: the parent is the previous body, and the contribution is kept in registers.
    InHand,
    /// In the entry of this parent, which it overwrites: the body is the parent's last child, the first to be visited.
    Last(usize),
    /// In the entry of this parent, to which it is added.
    Between(usize),
}

impl Held {
    /// Stores the contribution of a body in its parent's entry.
    #[inline(always)]
    pub fn keep<X: Copy + AddAssign>(self, places: &mut [X], x: X) {
        match self {
            Self::World | Self::InHand => {}
            Self::Last(p) => places[p] = x,
            Self::Between(p) => places[p] += x,
        }
    }

    /// Adds the contribution of a body to its parent's entry, which already holds the parent's own part.
    #[inline(always)]
    pub fn add<X: Copy + AddAssign>(self, places: &mut [X], x: X) {
        match self {
            Self::World | Self::InHand => {}
            Self::Last(p) | Self::Between(p) => places[p] += x,
        }
    }
}

/// Rotation from the joint's axes to those of the parent body while the joint is at zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Placing<A: Algebra> {
    /// A hinge: R_z(turn) R_x(tilt), as sines and cosines; `None` for the identity. The remaining rotation about the hinge's
    /// axis is in its `shift`.
    Hinge { turn: Option<[A::Scalar; 2]>, tilt: Option<[A::Scalar; 2]> },
    /// Any other joint.
    Other(A::Rotation),
}

impl<A: Algebra<Scalar = f64>> Step<A> {
    /// All steps of a tree.
    pub fn of(bodies: &[Body<A>]) -> Vec<Self> {
        let mut end: Vec<usize> = (1..=bodies.len()).collect();
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(p) = body.parent {
                end[p] = end[p].max(end[i]);
            }
        }
        let inertia = base_parameters(bodies);
        let mut massless: Vec<bool> = bodies.iter().map(|body| A::turns(body.joint)).collect();
        let mut branches = vec![false; bodies.len()];
        let mut held_by = vec![Held::World; bodies.len()];
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(p) = body.parent {
                massless[p] &= massless[i];
                held_by[i] = match branches[p] {
                    _ if p + 1 == i => Held::InHand,
                    true => Held::Between(p),
                    false => Held::Last(p),
                };
                branches[p] |= p + 1 < i;
            }
        }
        let mut run: Vec<usize> = Vec::with_capacity(bodies.len());
        for (i, body) in bodies.iter().enumerate() {
            run.push(if i > 0 && body.parent == Some(i - 1) { run[i - 1] } else { i });
        }
        let step = |(i, body): (usize, &Body<A>)| {
            let Pose { rotation, translation } = body.placement;
            let (placing, shift) = if A::turns(body.joint) {
                let (placing, shift) = Placing::hinge(rotation);
                (placing, body.shift + shift)
            } else {
                (Placing::Other(rotation), body.shift)
            };
            let Body { parent, joint, q_index, v_index, ratio, .. } = *body;
            let (inertia, run, end) = (inertia[i], run[i], end[i]);
            let (branches, held_by, massless) = (branches[i], held_by[i], massless[i]);
            Self {
                joint,
                placing,
                translation,
                ratio,
                shift,
                inertia,
                parent,
                q_index,
                v_index,
                run,
                end,
                branches,
                held_by,
                massless,
            }
        };
        bodies.iter().enumerate().map(step).collect()
    }

    /// The same over another scalar.
    pub fn cast<U: Real>(&self) -> Step<A::Cast<U>> {
        let both = |x: &[f64; 2]| x.map(convert);
        let placing = match &self.placing {
            Placing::Hinge { turn, tilt } => {
                Placing::Hinge { turn: turn.as_ref().map(both), tilt: tilt.as_ref().map(both) }
            }
            Placing::Other(rotation) => Placing::Other(A::cast_rotation(*rotation)),
        };
        Step {
            joint: self.joint,
            placing,
            translation: A::cast_vector(self.translation),
            ratio: convert(self.ratio),
            shift: convert(self.shift),
            inertia: self.inertia.cast(),
            parent: self.parent,
            q_index: self.q_index,
            v_index: self.v_index,
            run: self.run,
            end: self.end,
            branches: self.branches,
            held_by: self.held_by,
            massless: self.massless,
        }
    }
}

impl<A: Algebra<Scalar = f64>> Placing<A> {
    /// The placement of a hinge, and the part of it that is added to the hinge's angle, rad.
    fn hinge(rotation: A::Rotation) -> (Self, f64) {
        use std::f64::consts::{PI, TAU};
        // A rotation whose sine is below ε is within the rounding of a product of rotations.
        let none = |angle: f64| angle.sin().abs() <= f64::EPSILON && angle.cos() > 0.0;
        let half = |angle: f64| angle.sin().abs() <= f64::EPSILON && angle.cos() < 0.0;
        let [a, b, c] = A::euler_angles(rotation);
        let (a, b, c) = match (a, b, c) {
            (a, b, c) if none(b) => (0.0, 0.0, a + c),
            (a, b, c) if half(a) => (0.0, -b, c + PI),
            angles => angles,
        };
        let some = |angle: f64| (!none(angle)).then(|| [angle.sin(), angle.cos()]);
        (Self::Hinge { turn: some(a), tilt: some(b) }, c - ((c - PI) / TAU).ceil() * TAU)
    }
}

impl<A: Algebra> Placing<A> {
    /// The rotation of the joint's frame, for that of the parent body.
    #[inline(always)]
    pub fn placed(&self, outer: A::Rotation) -> A::Rotation {
        match self {
            Self::Hinge { turn, tilt } => {
                // No closures: for SIMD lanes the compiler does not inline them.
                let turned = if let Some([sin, cos]) = *turn { A::turn(outer, sin, cos) } else { outer };
                if let Some([sin, cos]) = *tilt { A::tilt(turned, sin, cos) } else { turned }
            }
            Self::Other(rotation) => A::compose(outer, *rotation),
        }
    }
}

impl<A: Algebra> Step<A> {
    /// The angle of its hinge.
    #[inline(always)]
    pub fn angle(&self) -> Angle<A::Scalar> {
        Angle { coordinate: self.q_index, sense: self.ratio, shift: self.shift }
    }

    /// Its inertia in world axes.
    #[inline(always)]
    pub fn turned_inertia(&self, rotation: A::Rotation) -> Inertia<A> {
        if A::turns(self.joint) { self.inertia.rotated_turning(rotation) } else { self.inertia.rotated(rotation) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{Planar, Spatial, Turn};
    use nalgebra::Matrix3;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn hinge_placement_equals_turn_tilt_and_shift() {
        let about_z = |angle: f64| Spatial::<f64>::turn(Matrix3::identity(), angle.sin(), angle.cos());
        let about_x = |angle: f64| Spatial::<f64>::tilt(Matrix3::identity(), angle.sin(), angle.cos());
        let outer = about_x(0.4) * about_z(1.1) * about_x(-2.0);
        let angles = [0.0, 1e-17, 1e-9, 0.7, FRAC_PI_2, PI, -FRAC_PI_2, -2.5, -PI];
        let (mut bare, mut tilted) = (0, 0);
        for (a, b, c) in angles.iter().flat_map(|a| angles.iter().flat_map(move |b| angles.map(|c| (*a, *b, c)))) {
            let rotation = about_z(a) * about_x(b) * about_z(c);
            let (placing, shift) = Placing::<Spatial<f64>>::hinge(rotation);
            assert!(shift.abs() <= PI, "{shift}");
            // Rounding of a dozen operations on numbers up to 1 and angles up to 2π.
            let apart = (placing.placed(outer) * about_z(shift) - outer * rotation).amax();
            assert!(apart < 16.0 * f64::EPSILON, "({a}, {b}, {c}): {apart}, {placing:?}, {shift}");
            match placing {
                Placing::Hinge { turn: None, tilt: None } => bare += 1,
                Placing::Hinge { turn: None, tilt: Some(_) } => tilted += 1,
                _ => {}
            }
        }
        // Parallel axes (b is 0 or 1e-17), or a is 0, 1e-17, π or −π.
        assert!(bare >= 2 * 81 && tilted >= 4 * 7 * 9, "{bare} {tilted}");
    }

    #[test]
    fn planar_hinge_placement_is_a_shift_only() {
        for angle in [0.0, 0.3, -FRAC_PI_2, PI, -3.0] {
            let (placing, shift) = Placing::<Planar<f64>>::hinge(Turn { cos: angle.cos(), sin: angle.sin() });
            assert_eq!(placing, Placing::Hinge { turn: None, tilt: None });
            assert!((shift - angle).abs() <= 2.0 * f64::EPSILON, "{shift} {angle}");
        }
    }
}

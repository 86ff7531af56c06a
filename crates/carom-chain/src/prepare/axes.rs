//! Axes of the bodies: of the placement of a hinge only a tilt remains.
//!
//! The placement of a hinge is R = R_z(a) R_x(b) R_z(c), with z its axis. c is added to the hinge's angle at no cost. If the
//! parent body is on a hinge too, its axes may be rotated about its own hinge: by the a of its first child, whose placement
//! is then R_x(b) R_z(c). Craig, *Introduction to Robotics* (1989), section 3.5, gives each link such axes; the origins remain
//! those of the file, because Craig's go to infinity for nearly parallel axes. A tilt costs 18 operations, a product of
//! rotations 45. What is placed on the world does not move, and its rotation is a constant.
//!
//! Placements, inertias and frames are expressed in the rotated axes. Joint angles, and what is measured in world axes, do
//! not depend on them.

use crate::algebra::{Algebra, Pose, Real};
use crate::body::{Body, Frame};
use nalgebra::convert;
use std::f64::consts::{PI, TAU};

/// Rotation from the joint's axes to those of the parent body while the joint is at zero, without the rotation about a hinge's
/// own axis that is in the hinge's angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Placing<A: Algebra> {
    /// The identity.
    Parallel,
    /// R_x(b): the sine and cosine of b.
    Tilt([A::Scalar; 2]),
    /// Any rotation; always for a joint on the world.
    Rotation(A::Rotation),
}

/// Rotates the axes of the bodies on hinges. Returns each body's placing, and the angle to be added to that of its hinge, rad.
pub(crate) fn align<A: Algebra<Scalar = f64>>(
    bodies: &mut [Body<A>],
    frames: &mut [Frame<A>],
) -> Vec<(Placing<A>, f64)> {
    let about_z = |angle: f64| A::turn(A::no_rotation(), angle.sin(), angle.cos());
    let hinge = |i: usize| A::turns(bodies[i].joint);
    // The angle about its own hinge by which the axes of each body are rotated.
    let mut turn = vec![0.0; bodies.len()];
    let mut angles = vec![[0.0; 3]; bodies.len()];
    for i in (0..bodies.len()).filter(|&i| hinge(i)) {
        let Body { parent, placement, .. } = bodies[i];
        angles[i] = match parent {
            // Bodies are numbered depth first: a body's first child is the next body.
            Some(p) if p + 1 == i && hinge(p) => {
                let [a, b, c] = hinge_angles::<A>(placement.rotation);
                turn[p] = a;
                [0.0, b, c]
            }
            Some(p) => hinge_angles::<A>(A::compose(about_z(-turn[p]), placement.rotation)),
            None => hinge_angles::<A>(placement.rotation),
        };
    }
    let outward = |body: Option<usize>, pose: Pose<A>| {
        let back = about_z(body.map_or(0.0, |p| -turn[p]));
        Pose { rotation: A::compose(back, pose.rotation), translation: A::rotate(back, pose.translation) }
    };
    for frame in frames {
        frame.pose = outward(frame.body, frame.pose);
    }
    for (body, turn) in bodies.iter_mut().zip(&turn) {
        let Pose { rotation, translation } = outward(body.parent, body.placement);
        body.placement = Pose { rotation: A::compose(rotation, about_z(*turn)), translation };
        body.inertia = body.inertia.rotated(about_z(-turn));
    }
    let placing = |((body, &[a, b, c]), turn): ((&Body<A>, &[f64; 3]), &f64)| {
        if !A::turns(body.joint) {
            return (Placing::Rotation(body.placement.rotation), 0.0);
        }
        let placing = if body.parent.is_none() || a != 0.0 {
            Placing::Rotation(A::tilt(about_z(a), b.sin(), b.cos()))
        } else if b != 0.0 {
            Placing::Tilt([b.sin(), b.cos()])
        } else {
            Placing::Parallel
        };
        let c = c + turn;
        (placing, c - ((c - PI) / TAU).ceil() * TAU)
    };
    bodies.iter().zip(&angles).zip(&turn).map(placing).collect()
}

/// The angles a, b and c of the placement of a hinge, rad. For parallel axes, and where x is the common perpendicular of both
/// axes, a is 0; for parallel axes b is 0 too.
fn hinge_angles<A: Algebra<Scalar = f64>>(rotation: A::Rotation) -> [f64; 3] {
    // A rotation whose sine is below ε is within the rounding of a product of rotations.
    let none = |angle: f64| angle.sin().abs() <= f64::EPSILON && angle.cos() > 0.0;
    let half = |angle: f64| angle.sin().abs() <= f64::EPSILON && angle.cos() < 0.0;
    match A::euler_angles(rotation) {
        [a, b, c] if none(b) => [0.0, 0.0, a + c],
        // R_z(a) R_x(π) = R_x(π) R_z(−a), R_z(π) R_x(b) = R_x(−b) R_z(π)
        [a, b, c] if half(b) => [0.0, b, c - a],
        [a, b, c] if half(a) => [0.0, -b, c + PI],
        [a, b, c] if none(a) => [0.0, b, c],
        angles => angles,
    }
}

impl<A: Algebra> Placing<A> {
    /// The rotation of the joint's frame, for that of the parent body; `None` is the world.
    #[inline(always)]
    pub fn placed(&self, outer: Option<A::Rotation>) -> A::Rotation {
        match (*self, outer) {
            (Self::Rotation(rotation), None) => rotation,
            (Self::Rotation(rotation), Some(outer)) => A::compose(outer, rotation),
            (Self::Tilt([sin, cos]), Some(outer)) => A::tilt(outer, sin, cos),
            (Self::Tilt([sin, cos]), None) => A::tilt(A::no_rotation(), sin, cos),
            (Self::Parallel, Some(outer)) => outer,
            (Self::Parallel, None) => A::no_rotation(),
        }
    }

    /// The same over another scalar.
    pub fn cast<U: Real>(&self) -> Placing<A::Cast<U>>
    where
        A: Algebra<Scalar = f64>,
    {
        match *self {
            Self::Parallel => Placing::Parallel,
            Self::Tilt(tilt) => Placing::Tilt(tilt.map(convert)),
            Self::Rotation(rotation) => Placing::Rotation(A::cast_rotation(rotation)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{Geometry, Inertia, Planar, PlanarJoint, Spatial, SpatialJoint, Turn};
    use nalgebra::{Matrix3, Vector3};
    use std::f64::consts::FRAC_PI_2;

    type Space = Spatial<f64>;

    fn about_z(angle: f64) -> Matrix3<f64> {
        Space::turn(Matrix3::identity(), angle.sin(), angle.cos())
    }

    fn about_x(angle: f64) -> Matrix3<f64> {
        Space::tilt(Matrix3::identity(), angle.sin(), angle.cos())
    }

    fn body<A: Algebra<Scalar = f64>>(joint: A::Joint, parent: Option<usize>, rotation: A::Rotation) -> Body<A> {
        let placement = Pose { rotation, translation: A::vector(|i| 0.3 - 0.2 * i as f64) };
        let (inertia, q_index, v_index) = (Inertia::zero(), 0, 0);
        Body { parent, joint_index: 0, joint, placement, inertia, q_index, v_index, ratio: 1.0, shift: 0.0, rotor: 0.0 }
    }

    #[test]
    fn rotated_axes_keep_poses_and_leave_a_tilt_of_a_first_child() {
        let angles = [0.0, 1e-17, 1e-9, 0.7, FRAC_PI_2, PI, -FRAC_PI_2, -2.5, -PI];
        let (mut parallel, mut tilted) = (0, 0);
        for (a, b, c) in angles.iter().flat_map(|a| angles.iter().flat_map(move |b| angles.map(|c| (*a, *b, c)))) {
            let rotation = about_z(a) * about_x(b) * about_z(c);
            let hinge = |parent, rotation| body::<Space>(SpatialJoint::Revolute, parent, rotation);
            let slider = body::<Space>(SpatialJoint::Prismatic, Some(1), rotation);
            // A row of three, and beside the last a hinge and a slider.
            let file = [hinge(None, rotation), hinge(Some(0), rotation), hinge(Some(1), rotation)];
            let file = [&file[..], &[hinge(Some(1), about_x(0.4) * rotation), slider]].concat();
            let mut bodies = file.clone();
            let frames = (0..file.len()).map(|i| Frame { name: String::new(), body: Some(i), pose: Pose::identity() });
            let mut frames: Vec<_> = frames.collect();
            let placings = align(&mut bodies, &mut frames);
            let (mut by_file, mut by_axes, mut by_placing) = (Vec::new(), Vec::new(), Vec::new());
            let under = |poses: &[Pose<Space>], p: Option<usize>| p.map_or(Pose::identity(), |p| poses[p]);
            for (i, (placing, shift)) in placings.iter().enumerate() {
                let theta = 0.3 + 0.5 * i as f64;
                let turned = |angle| Pose::<Space> { rotation: about_z(angle), translation: Vector3::zeros() };
                let parent = file[i].parent;
                by_file.push(under(&by_file, parent).then(&file[i].placement).then(&turned(theta)));
                by_axes.push(under(&by_axes, parent).then(&bodies[i].placement).then(&turned(theta)));
                let outer = under(&by_placing, parent);
                let placed = placing.placed(parent.map(|_| outer.rotation));
                let translation = outer.point(bodies[i].placement.translation);
                by_placing.push(Pose { rotation: placed, translation }.then(&turned(theta + shift)));
                assert!(shift.abs() <= PI, "{shift}");
                for pose in [&by_axes[i], &by_placing[i]] {
                    let (of_frame, apart) = (pose.then(&frames[i].pose), by_file[i]);
                    // Rounding of some dozen operations on numbers up to 1 and angles up to 2π.
                    let turn = (of_frame.rotation - apart.rotation).amax();
                    let place = (of_frame.translation - apart.translation).amax();
                    assert!(turn.max(place) < 32.0 * f64::EPSILON, "({a}, {b}, {c}) {i}: {turn} {place} {placings:?}");
                }
            }
            assert!(matches!(placings[0].0, Placing::Rotation(_)));
            for (placing, _) in &placings[1..3] {
                match placing {
                    Placing::Parallel => parallel += 1,
                    Placing::Tilt(_) => tilted += 1,
                    Placing::Rotation(_) => panic!("({a}, {b}, {c}): {placings:?}"),
                }
            }
        }
        // b is 0 or 1e-17 for parallel axes.
        assert_eq!((parallel, tilted), (2 * 2 * 81, 2 * 7 * 81));
    }

    #[test]
    fn hinge_placements_in_the_plane_are_shifts() {
        for angle in [0.0, 0.3, -FRAC_PI_2, PI, -3.0] {
            let hinge = |parent| {
                body::<Planar<f64>>(PlanarJoint::Revolute, parent, Turn { cos: angle.cos(), sin: angle.sin() })
            };
            let mut bodies = [hinge(None), hinge(Some(0))];
            let placings = align(&mut bodies, &mut []);
            assert_eq!(bodies, [hinge(None), hinge(Some(0))]);
            assert_eq!(placings[0].0.placed(None), Planar::no_rotation());
            assert_eq!(placings[1].0, Placing::Parallel);
            assert!(placings.iter().all(|(_, shift)| (shift - angle).abs() <= 2.0 * f64::EPSILON), "{placings:?}");
        }
    }
}

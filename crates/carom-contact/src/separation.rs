//! A lower bound of the gap of two bodies: their separation along the normals of their faces.
//!
//! The gap is the greatest separation over all directions, so that along any direction is a lower bound. Where a face is
//! nearest, the separation along its normal is the gap; where the separation along the normal of a contact of parts is its gap, so is
//! that.

use crate::gap::Gap;
use crate::meeting::Placed;
use crate::parts::Parts;
use nalgebra::Vector3;

/// The greatest separation of two bodies along the normals of their faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// The separation, its direction from the environment to the robot, and the extreme points of both bodies along it.
    pub gap: Gap,
    /// Whether the direction is the normal of a face of the robot, and turns with it.
    pub is_own: bool,
}

impl Separation {
    /// The separation along a unit vector `n` from the environment to the robot: height of the robot's lowest point minus that of
    /// the environment's highest point, m.
    pub fn along(n: Vector3<f64>, (own, pose): Placed, (other, place): Placed) -> f64 {
        let (low, _) = own.lowest(pose.rotation.tr_mul(&n));
        let (high, _) = other.lowest(-place.rotation.tr_mul(&n));
        n.dot(&(pose.translation - place.translation)) + low + high
    }

    /// `None` if neither body has a face.
    pub fn of((own, pose): Placed, (other, place): Placed) -> Option<Self> {
        let theirs = other.faces.iter().map(|face| {
            let n = place.rotation * face.normal;
            let (height, low) = own.lowest(pose.rotation.tr_mul(&n));
            let distance = height + n.dot(&(pose.translation - place.point(face.point)));
            let on_robot = pose.point(low);
            let gap = Gap { distance, normal: n, on_robot, on_environment: on_robot - n * distance };
            Self { gap, is_own: false }
        });
        let ours = own.faces.iter().map(|face| {
            let n = pose.rotation * face.normal;
            let (height, low) = other.lowest(place.rotation.tr_mul(&n));
            let distance = height + n.dot(&(place.translation - pose.point(face.point)));
            let on_environment = place.point(low);
            let gap = Gap { distance, normal: -n, on_robot: on_environment - n * distance, on_environment };
            Self { gap, is_own: true }
        });
        theirs.chain(ours).max_by(|a, b| a.gap.distance.total_cmp(&b.gap.distance))
    }
}

impl Parts {
    /// Height and position of the lowest point along a unit vector. Of a half-space, which has none, −∞.
    fn lowest(&self, n: Vector3<f64>) -> (f64, Vector3<f64>) {
        let mut least = (f64::INFINITY, Vector3::zeros());
        for (position, radius) in &self.outline {
            let height = n.dot(position) - radius;
            if height < least.0 {
                least = (height, position - n * *radius);
            }
        }
        for rim in &self.rims {
            let down = n - rim.axis * n.dot(&rim.axis);
            let tilt = down.norm();
            let height = n.dot(&rim.centre) - rim.radius * tilt;
            if height < least.0 {
                let toward = if tilt > 0.0 { down / tilt } else { down };
                least = (height, rim.centre - toward * rim.radius);
            }
        }
        if least.0 == f64::INFINITY { (f64::NEG_INFINITY, Vector3::zeros()) } else { least }
    }
}

//! Extent of a scene, for the sizes of what is drawn and for the position of the viewer's eye.

use crate::geometry::{Body, Look};
use crate::rerun;
use carom_chain::algebra::{Pose, z_onto};
use carom_chain::{Chain, FrameId, Kinematics, Spatial};
use carom_contact::{Obstacle, Surface as Form};
use nalgebra::Vector3;

/// A growing box along the world's axes, m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    lower: Vector3<f64>,
    upper: Vector3<f64>,
}

impl Bounds {
    pub fn empty() -> Self {
        Self { lower: Vector3::repeat(f64::INFINITY), upper: Vector3::repeat(f64::NEG_INFINITY) }
    }

    pub fn include(&mut self, centre: Vector3<f64>, radius: f64) {
        self.lower = self.lower.inf(&centre.add_scalar(-radius));
        self.upper = self.upper.sup(&centre.add_scalar(radius));
    }

    pub fn centre(&self) -> Vector3<f64> {
        if self.is_empty() { Vector3::zeros() } else { (self.lower + self.upper) / 2.0 }
    }

    /// Length of the diagonal, m; 1 if it is zero or not finite.
    pub fn size(&self) -> f64 {
        let size = if self.is_empty() { 0.0 } else { (self.upper - self.lower).norm() };
        if size > 1e-9 && size.is_finite() { size } else { 1.0 }
    }

    /// Half the extent along a unit direction, m.
    pub fn half_depth(&self, along: &Vector3<f64>) -> f64 {
        if self.is_empty() { 0.0 } else { ((self.upper - self.lower) / 2.0).dot(&along.abs()) }
    }

    fn is_empty(&self) -> bool {
        self.lower.x > self.upper.x
    }

    /// Includes a finite obstacle, or the nearest point of a half-space if it is nearer than twice the size.
    pub fn include_obstacle(&mut self, obstacle: &Obstacle) {
        match obstacle.surface() {
            Form::HalfSpace { point, normal } => {
                let height = normal.dot(&(self.centre() - point));
                if height.abs() < 2.0 * self.size() {
                    self.include(self.centre() - normal * height, 0.0);
                }
            }
            Form::Solid { pose, solid } => {
                let (centre, radius) = solid.bounding_sphere();
                self.include((pose * nalgebra::Point3::from(centre)).coords, radius);
            }
            Form::Mesh { pose, mesh } => {
                mesh.vertices().iter().for_each(|v| self.include((pose * nalgebra::Point3::from(*v)).coords, 0.0));
            }
        }
    }
}

/// Balls that enclose the links of a chain: frame, centre in its axes, radius (m).
pub(crate) struct Outline(Vec<(FrameId, Vector3<f64>, f64)>);

impl Outline {
    /// A shape with more corners than this is enclosed by one ball.
    const MANY: usize = 32;

    pub fn of(chain: &Chain, looks: &[Look]) -> Self {
        let mut balls = Vec::new();
        for frame in chain.frames() {
            balls.extend(chain.frame(&frame.name).map(|frame| (frame, Vector3::zeros(), 0.0)));
        }
        for Look { frame, origin, body, .. } in looks {
            let corners: Vec<(Vector3<f64>, f64)> = match body {
                Body::Solid(solid) => solid.corners().iter().map(|corner| (corner.position, corner.radius)).collect(),
                Body::Mesh(mesh) => mesh.vertices().iter().map(|vertex| (*vertex, 0.0)).collect(),
            };
            let ball = |(centre, radius): (Vector3<f64>, f64)| (*frame, origin.point(centre), radius);
            if corners.len() > Self::MANY {
                let mut bounds = Bounds::empty();
                corners.iter().for_each(|(corner, radius)| bounds.include(*corner, *radius));
                balls.push(ball((bounds.centre(), bounds.size() / 2.0)));
            } else {
                balls.extend(corners.into_iter().map(ball));
            }
        }
        Self(balls)
    }

    /// Includes the chain at its current configuration.
    pub fn enter(&self, kin: &Kinematics<Spatial<f64>>, bounds: &mut Bounds) {
        self.0.iter().for_each(|(frame, centre, radius)| bounds.include(kin.pose(*frame).point(*centre), *radius));
    }
}

/// Position and direction of the viewer's eye.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Eye {
    pub position: Vector3<f64>,
    pub target: Vector3<f64>,
    pub up: Vector3<f64>,
}

impl Eye {
    /// Tangent of half the viewer's vertical field of view.
    const SLOPE: f64 = 0.52;
    /// Ratio of width to height of a view that is wider than high, in a window of the usual shape.
    pub const WIDE: f64 = 1.3;

    /// The eye in the direction `from` of the centre, as near as all of the bounds are seen in a view of the ratio `aspect` of width
    /// to height.
    pub fn looking(bounds: &Bounds, from: Vector3<f64>, up: Vector3<f64>, aspect: f64) -> Self {
        let right = up.cross(&from).try_normalize(1e-9).unwrap_or_else(|| z_onto(from).column(0).into_owned());
        let above = from.cross(&right);
        let target = bounds.centre();
        let half = if bounds.is_empty() { Vector3::repeat(0.5) } else { bounds.upper - target };
        // Each corner must be within the pyramid of sight: |x| ≤ slope · (distance − its depth towards the eye).
        let corner = |k: usize| {
            let side = |bit: usize, h: f64| if k & bit == 0 { -h } else { h };
            Vector3::new(side(1, half.x), side(2, half.y), side(4, half.z))
        };
        let needed = |c: Vector3<f64>| {
            let across = (c.dot(&right).abs() / aspect).max(c.dot(&above).abs());
            c.dot(&from) + across / Self::SLOPE
        };
        let distance = (0..8).map(|k| needed(corner(k))).fold(0.0, f64::max).max(0.1 * bounds.size());
        Self { position: target + from * distance, target, up: above }
    }
}

/// The rotation of a pose as a quaternion in `f32`, for the viewer.
pub(crate) fn quaternion(pose: &Pose<Spatial<f64>>) -> rerun::Quaternion {
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(pose.rotation);
    let [x, y, z, w] = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation).coords.into();
    rerun::Quaternion::from_xyzw([x as f32, y as f32, z as f32, w as f32])
}

/// A vector in `f32`, for the viewer.
pub(crate) fn xyz(v: Vector3<f64>) -> [f32; 3] {
    v.map(|x| x as f32).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In a view of any shape every point of the bounds is within the pyramid of sight, and one is nearly on its side.
    #[test]
    fn all_of_the_bounds_are_seen_in_wide_and_in_narrow_views() {
        let mut bounds = Bounds::empty();
        [[0.0, -0.4, 0.1], [1.5, 0.3, 0.2]].iter().for_each(|at| bounds.include(Vector3::from(*at), 0.05));
        for (from, up) in [(Vector3::z(), Vector3::y()), (Vector3::new(0.48, -0.8, 0.36), Vector3::z())] {
            for aspect in [0.65, Eye::WIDE] {
                let eye = Eye::looking(&bounds, from, up, aspect);
                let (ahead, right) = (-from, eye.up.cross(&from));
                let mut greatest = 0.0_f64;
                for k in 0..8 {
                    let side = |bit: usize, i: usize| if k & bit == 0 { bounds.lower[i] } else { bounds.upper[i] };
                    let ray = Vector3::new(side(1, 0), side(2, 1), side(4, 2)) - eye.position;
                    let slope = |across: f64| across.abs() / (Eye::SLOPE * ray.dot(&ahead));
                    greatest = greatest.max(slope(ray.dot(&right)) / aspect).max(slope(ray.dot(&eye.up)));
                }
                assert!((greatest - 1.0).abs() < 1e-9, "{greatest}: {from} {aspect}");
            }
        }
    }
}

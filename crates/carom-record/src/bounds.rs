//! Extent of a scene, for the sizes of what is drawn and for the position of the viewer's eye.

use carom_chain::algebra::{Pose, z_onto};
use carom_chain::{Chain, FrameId, Kinematics, Spatial};
use carom_contact::{LinkShape, Obstacle, Surface as Form};
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

    pub fn of(chain: &Chain, shapes: &[LinkShape]) -> Self {
        let mut balls = Vec::new();
        for frame in chain.frames() {
            balls.extend(chain.frame(&frame.name).map(|frame| (frame, Vector3::zeros(), 0.0)));
        }
        for shape in shapes {
            let corners = shape.corners();
            if corners.len() > Self::MANY {
                let (centre, radius) = shape.solid().bounding_sphere();
                balls.push((shape.frame(), shape.origin().point(centre), radius));
            } else {
                balls.extend(corners.iter().map(|corner| (shape.frame(), corner.position, corner.radius)));
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
    /// Assumed ratio of width to height of the view.
    const ASPECT: f64 = 1.3;

    /// The eye in the direction `from` of the centre, as near as all of the bounds are seen.
    pub fn looking(bounds: &Bounds, from: Vector3<f64>, up: Vector3<f64>) -> Self {
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
            let across = (c.dot(&right).abs() / Self::ASPECT).max(c.dot(&above).abs());
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

//! What may come together: a link's shape with a surface, or a joint with its limit. Each has a gap, and the gap closes
//! at the rate of the joint velocities times one row: to the event loop they are alike.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | g, ġ | 1 | gap (> 0 open) and its rate | `gap`, `gap_rate` |
//! | j | nv | ġ = j·qd | `normal_row` |
//! | J | 3×nv | velocity of the touching point (surfaces only) | `jacobian` |

use crate::error::SimError;
use carom_chain::{Chain, Coordinates, Kinematics, Spatial};
use carom_contact::{LinkShape, Obstacle, gap, link_shapes, reachable_pairs};
use nalgebra::{DMatrix, DVector, Vector3};

/// A pair that may touch.
#[derive(Debug, Clone)]
pub struct Touch {
    /// What people call it: `tip on surface 1`, `upper limit of elbow`.
    pub name: String,
    pub(crate) kind: TouchKind,
}

#[derive(Debug, Clone)]
pub(crate) enum TouchKind {
    Surface { shape: Box<LinkShape>, obstacle: Box<Obstacle> },
    Limit { joint: String, q: usize, v: usize, bound: f64, upper: bool },
}

/// A touch at one configuration.
#[derive(Debug, Clone)]
pub(crate) struct At {
    pub gap: f64,
    /// Touching point on the robot, and unit normal from the environment to the robot, world (surfaces only).
    pub surface: Option<(carom_chain::Point<Spatial<f64>>, Vector3<f64>)>,
}

impl Touch {
    /// The limits of all joints that have some.
    pub(crate) fn limits(chain: &Chain) -> Vec<Self> {
        let mut touches = Vec::new();
        for joint in chain.joints() {
            let Coordinates::Own { q, v } = &joint.coordinates else { continue };
            for (bound, upper, side) in [(joint.limits.lower, false, "lower"), (joint.limits.upper, true, "upper")] {
                let Some(bound) = bound else { continue };
                let kind = TouchKind::Limit { joint: joint.name.clone(), q: q.start, v: v.start, bound, upper };
                touches.push(Self { name: format!("{side} limit of {}", joint.name), kind });
            }
        }
        touches
    }

    /// Every shape of a link with every surface that it can reach at some pose, and every joint limit. What is out of reach
    /// is left out once, and exactly.
    ///
    /// # Errors
    /// A mesh that can't be used.
    pub fn all(chain: &Chain, surfaces: Vec<(String, Obstacle)>) -> Result<Vec<Self>, SimError> {
        let shapes = link_shapes(chain)?;
        let (names, obstacles): (Vec<String>, Vec<Obstacle>) = surfaces.into_iter().unzip();
        let reachable = reachable_pairs(chain, &shapes, &obstacles).pairs.into_iter().map(|pair| {
            let (shape, obstacle) = (&shapes[pair.shape], &obstacles[pair.obstacle]);
            let name = format!("{} on {}", shape.link(), names[pair.obstacle]);
            Self {
                name,
                kind: TouchKind::Surface { shape: Box::new(shape.clone()), obstacle: Box::new(obstacle.clone()) },
            }
        });
        Ok(reachable.chain(Self::limits(chain)).collect())
    }

    /// Gap and place at a configuration.
    pub(crate) fn at(&self, kin: &Kinematics<Spatial<f64>>, q: &[f64]) -> At {
        match &self.kind {
            TouchKind::Surface { shape, obstacle } => {
                let pose = kin.pose(shape.frame());
                let found = gap(shape, &pose, obstacle);
                let point = carom_contact::contact_point(kin, shape, &found);
                At { gap: found.distance, surface: Some((point, found.normal)) }
            }
            TouchKind::Limit { q: at, bound, upper, .. } => {
                At { gap: if *upper { bound - q[*at] } else { q[*at] - bound }, surface: None }
            }
        }
    }

    /// ġ = j·qd.
    pub(crate) fn gap_rate(&self, at: &At, kin: &Kinematics<Spatial<f64>>, qd: &[f64]) -> Result<f64, SimError> {
        match (&self.kind, at.surface) {
            (TouchKind::Limit { v, upper, .. }, _) => Ok(if *upper { -qd[*v] } else { qd[*v] }),
            (_, Some((point, normal))) => Ok(normal.dot(&kin.point_velocity(point, qd)?)),
            (_, None) => Ok(0.0),
        }
    }

    /// The row j.
    pub(crate) fn normal_row(&self, at: &At, kin: &Kinematics<Spatial<f64>>) -> Result<DVector<f64>, SimError> {
        let mut row = DVector::zeros(kin.chain().nv());
        match (&self.kind, at.surface) {
            (TouchKind::Limit { v, upper, .. }, _) => row[*v] = if *upper { -1.0 } else { 1.0 },
            (_, Some((point, normal))) => kin.add_point_force(point, normal, row.as_mut_slice())?,
            (_, None) => {}
        }
        Ok(row)
    }

    /// The Jacobian of the touching point; `None` for a limit, which has no tangents.
    pub(crate) fn jacobian(&self, at: &At, kin: &Kinematics<Spatial<f64>>) -> Option<DMatrix<f64>> {
        at.surface.map(|(point, _)| kin.point_jacobian(point))
    }
}

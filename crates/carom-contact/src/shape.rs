//! The shapes of a chain's links, prepared: sizes checked, meshes read, hulls taken.

use crate::error::ContactError;
use crate::gap::Gap;
use crate::hull::Hull;
use crate::mesh::Mesh;
use crate::solid::{Corner, Solid};
use carom_chain::algebra::{Algebra, Pose};
use carom_chain::urdf::{Collision, Shape};
use carom_chain::{Chain, ChainError, FrameId, Kinematics, Point, Spatial};
use nalgebra::Isometry3;

/// A shape of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkShape {
    link: String,
    name: Option<String>,
    frame: FrameId,
    origin: Pose<Spatial<f64>>,
    solid: Solid,
}

/// The collision shapes of all links of a chain, in the order of the file. A mesh becomes its convex hull. Links that a
/// reduction has left out of the chain have no shapes here.
///
/// # Errors
/// [`ContactError::Size`] and [`ContactError::Mesh`], with the link's name.
pub fn link_shapes<A: Algebra>(chain: &Chain<A>) -> Result<Vec<LinkShape>, ContactError> {
    let mut shapes = Vec::new();
    for link in chain.links() {
        let Ok(frame) = chain.frame(&link.name) else { continue };
        for collision in &link.collisions {
            shapes.push(LinkShape::new(&link.name, frame, collision)?);
        }
    }
    Ok(shapes)
}

impl LinkShape {
    /// A collision element of the link `link`, whose frame is `frame`.
    ///
    /// # Errors
    /// [`ContactError::Size`], [`ContactError::Mesh`].
    pub fn new(link: &str, frame: FrameId, collision: &Collision) -> Result<Self, ContactError> {
        let solid = solid(&format!("link '{link}'"), &collision.shape)?;
        let origin = pose_of(&collision.origin);
        Ok(Self { link: link.into(), name: collision.name.clone(), frame, origin, solid })
    }

    /// The link's name.
    pub fn link(&self) -> &str {
        &self.link
    }
    /// The collision element's own name, if it has one.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }
    /// The link's frame.
    pub fn frame(&self) -> FrameId {
        self.frame
    }
    /// Pose of the body's axes in the link's frame.
    pub fn origin(&self) -> &Pose<Spatial<f64>> {
        &self.origin
    }
    /// The body.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The points on which it can rest, in the link's frame: see [`Solid::corners`].
    pub fn corners(&self) -> Vec<Corner> {
        let mut corners = self.solid.corners();
        corners.iter_mut().for_each(|corner| corner.position = self.origin.point(corner.position));
        corners
    }
}

/// The material point of the chain that touches: `kin.point_jacobian(point)` is the contact Jacobian (3×nv, world axes),
/// `kin.add_point_force(point, normal, …)` its normal row.
pub fn contact_point(kin: &Kinematics<Spatial<f64>>, shape: &LinkShape, gap: &Gap) -> Point<Spatial<f64>> {
    let in_link = kin.pose(shape.frame).inverse().point(gap.on_robot);
    kin.chain().point(shape.frame, in_link)
}

/// d(gap)/dt = n · J qd against an obstacle at rest, m/s; < 0 approaching.
///
/// # Errors
/// [`ChainError::WrongLength`].
pub fn gap_rate(kin: &Kinematics<Spatial<f64>>, shape: &LinkShape, gap: &Gap, qd: &[f64]) -> Result<f64, ChainError> {
    Ok(gap.normal.dot(&kin.point_velocity(contact_point(kin, shape, gap), qd)?))
}

fn solid(owner: &str, shape: &Shape) -> Result<Solid, ContactError> {
    let sized = |what, value: f64| positive(owner, what, value).map(|()| value);
    Ok(match shape {
        Shape::Sphere { radius } => Solid::Sphere { radius: sized("radius", *radius)? },
        Shape::Cylinder { radius, length } => {
            Solid::Cylinder { radius: sized("radius", *radius)?, half_length: sized("length", *length)? / 2.0 }
        }
        Shape::Capsule { radius, length } => {
            Solid::Capsule { radius: sized("radius", *radius)?, half_length: sized("length", *length)? / 2.0 }
        }
        Shape::Box { size } => {
            for (what, value) in ["size x", "size y", "size z"].into_iter().zip(size.iter()) {
                sized(what, *value)?;
            }
            Solid::Box { half: size / 2.0 }
        }
        Shape::Mesh { file, scale } => Solid::Hull(Hull::of(&Mesh::read(file, *scale, owner)?)),
    })
}

pub(crate) fn positive(owner: &str, what: &'static str, value: f64) -> Result<(), ContactError> {
    let good = value > 0.0 && value.is_finite();
    if good { Ok(()) } else { Err(ContactError::Size { owner: owner.into(), what, value }) }
}

pub(crate) fn pose_of(isometry: &Isometry3<f64>) -> Pose<Spatial<f64>> {
    Pose { rotation: isometry.rotation.to_rotation_matrix().into_inner(), translation: isometry.translation.vector }
}

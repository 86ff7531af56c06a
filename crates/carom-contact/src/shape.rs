//! Collision shapes of a chain's links, prepared for gaps: sizes checked, meshes read and replaced by their convex hulls.

use crate::error::ContactError;
use crate::hull::Hull;
use crate::mesh::Mesh;
use crate::solid::{Corner, Solid};
use carom_chain::algebra::{Algebra, Pose};
use carom_chain::urdf::{Collision, Shape};
use carom_chain::{Chain, FrameId, Spatial};

/// A collision shape of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkShape {
    link: String,
    name: Option<String>,
    pub(crate) frame: FrameId,
    origin: Pose<Spatial<f64>>,
    solid: Solid,
}

/// The collision shapes of all links of a chain, in the order of the file. A mesh is replaced by its convex hull. Links that
/// were pruned from the chain are left out, and so are missing meshes of links that never move.
///
/// # Errors
/// [`ContactError::Size`], [`ContactError::Mesh`], with the link's name.
pub fn link_shapes<A: Algebra>(chain: &Chain<A>) -> Result<Vec<LinkShape>, ContactError> {
    shapes_where(chain, |link, shape| {
        let moves = || chain.frames().iter().any(|frame| frame.name == link && frame.body.is_some());
        !matches!(shape, Shape::MissingMesh { .. }) || moves()
    })
}

/// The collision shapes of the links for which `wanted` is true, given a link's name and the shape.
fn shapes_where<A: Algebra>(
    chain: &Chain<A>,
    wanted: impl Fn(&str, &Shape) -> bool,
) -> Result<Vec<LinkShape>, ContactError> {
    let mut shapes = Vec::new();
    for link in chain.links() {
        let Ok(frame) = chain.frame(&link.name) else { continue };
        for collision in link.collisions.iter().filter(|collision| wanted(&link.name, &collision.shape)) {
            shapes.push(LinkShape::new(&link.name, frame, collision)?);
        }
    }
    Ok(shapes)
}

/// The collision shapes of one link, in the order of the file; see [`link_shapes`].
///
/// # Errors
/// [`ContactError::Size`], [`ContactError::Mesh`].
pub fn shapes_of_link<A: Algebra>(chain: &Chain<A>, link: &str) -> Result<Vec<LinkShape>, ContactError> {
    shapes_where(chain, |name, _| name == link)
}

/// The collision shapes of all links without those whose mesh was not found, for drawing; see [`link_shapes`].
///
/// # Errors
/// [`ContactError::Size`], [`ContactError::Mesh`].
pub fn found_shapes<A: Algebra>(chain: &Chain<A>) -> Result<Vec<LinkShape>, ContactError> {
    shapes_where(chain, |_, shape| !matches!(shape, Shape::MissingMesh { .. }))
}

impl LinkShape {
    /// The shape of a collision element of the link `link`, whose frame is `frame`.
    ///
    /// # Errors
    /// [`ContactError::Size`], [`ContactError::Mesh`].
    #[doc(hidden)]
    pub fn new(link: &str, frame: FrameId, collision: &Collision) -> Result<Self, ContactError> {
        let solid = solid(&format!("link '{link}'"), &collision.shape)?;
        let origin = collision.origin.into();
        Ok(Self { link: link.into(), name: collision.name.clone(), frame, origin, solid })
    }

    /// The link's name.
    pub fn link(&self) -> &str {
        &self.link
    }
    /// Name of the collision element, if it has one.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }
    /// The link's frame.
    pub fn frame(&self) -> FrameId {
        self.frame
    }
    /// Pose of the body's axes in the link's frame, m.
    #[doc(hidden)]
    pub fn origin(&self) -> &Pose<Spatial<f64>> {
        &self.origin
    }
    /// The body, in its own axes.
    #[doc(hidden)]
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// The points on which the body can rest, in the link's frame: see [`Solid::corners`].
    #[doc(hidden)]
    pub fn corners(&self) -> Vec<Corner> {
        let mut corners = self.solid.corners();
        corners.iter_mut().for_each(|corner| corner.position = self.origin.point(corner.position));
        corners
    }
}

pub(crate) fn solid(owner: &str, shape: &Shape) -> Result<Solid, ContactError> {
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
        Shape::MissingMesh { name, tried } => {
            let fault = format!(
                "is not found; {tried}. Correct the path, or name the folder of its package: --package-dir, in scenes package_dirs"
            );
            return Err(ContactError::Mesh { owner: owner.into(), file: name.into(), fault });
        }
        Shape::Mesh { file, scale } => Solid::Hull(Hull::of(&Mesh::read(file, *scale, owner)?)),
    })
}

fn positive(owner: &str, what: &'static str, value: f64) -> Result<(), ContactError> {
    let good = value > 0.0 && value.is_finite();
    if good { Ok(()) } else { Err(ContactError::Size { owner: owner.into(), what, value }) }
}

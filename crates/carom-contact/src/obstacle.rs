//! Fixed obstacles: half-spaces, boxes, spheres, cylinders, capsules and meshes.

use crate::error::ContactError;
use crate::mesh::{Mesh, TRIANGLES, no_triangles};
use crate::parry::Triangles;
use crate::shape::solid;
use crate::solid::Solid;
use carom_chain::Spatial;
use carom_chain::algebra::Pose;
use carom_chain::urdf::Shape;
use nalgebra::{Isometry3, Vector3};
use std::path::Path;

/// An obstacle that is fixed in the world, checked and prepared for [`crate::gap`].
#[derive(Debug, Clone)]
pub struct Obstacle {
    surface: Surface,
    pose: Pose<Spatial<f64>>,
    /// Those of a mesh, prepared for distance queries.
    triangles: Option<Triangles>,
}

/// The geometry of an [`Obstacle`]. World axes, m.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// All points x with normal · (x − point) ≤ 0.
    HalfSpace {
        /// A point of its boundary.
        point: Vector3<f64>,
        /// Unit normal, pointing out of the solid.
        normal: Vector3<f64>,
    },
    /// A convex body.
    Solid {
        /// Pose of the body's axes in the world, m.
        pose: Isometry3<f64>,
        /// The body, in its own axes.
        solid: Solid,
    },
    /// A triangle mesh.
    Mesh {
        /// Pose of the mesh's axes in the world, m.
        pose: Isometry3<f64>,
        /// The mesh, in its own axes.
        mesh: Mesh,
    },
}

const OWNER: &str = "obstacle";

impl Obstacle {
    /// A half-space: `point` on its boundary (m), `normal` out of the solid (any length), world axes.
    ///
    /// # Errors
    /// [`ContactError::Vector`] if a coordinate is not finite or the normal is zero.
    pub fn half_space(point: Vector3<f64>, normal: Vector3<f64>) -> Result<Self, ContactError> {
        finite("point", point)?;
        finite("normal", normal)?;
        // Divided by its largest coordinate first, to avoid overflow.
        let unit = (normal / normal.amax()).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
        let normal = unit.ok_or_else(|| refuse("normal", normal, "a direction must not be zero"))?;
        Ok(Self { surface: Surface::HalfSpace { point, normal }, pose: Pose::identity(), triangles: None })
    }

    /// A box with full sides `size` (m), centred at `pose`.
    ///
    /// # Errors
    /// [`ContactError::Size`] for a side that is not positive and finite; [`ContactError::Vector`] for a pose that is not
    /// finite.
    pub fn cuboid(pose: Isometry3<f64>, size: Vector3<f64>) -> Result<Self, ContactError> {
        Self::solid(pose, &Shape::Box { size })
    }

    /// A sphere. `centre` in world axes; both in m.
    ///
    /// # Errors
    /// [`ContactError::Size`] for a radius that is not positive and finite; [`ContactError::Vector`] for a centre that is
    /// not finite.
    pub fn sphere(centre: Vector3<f64>, radius: f64) -> Result<Self, ContactError> {
        Self::solid(Isometry3::translation(centre.x, centre.y, centre.z), &Shape::Sphere { radius })
    }

    /// A cylinder of full `length` along the z-axis of `pose`, centred there; m.
    ///
    /// # Errors
    /// [`ContactError::Size`] for a radius or length that is not positive and finite; [`ContactError::Vector`] for a pose
    /// that is not finite.
    pub fn cylinder(pose: Isometry3<f64>, radius: f64, length: f64) -> Result<Self, ContactError> {
        Self::solid(pose, &Shape::Cylinder { radius, length })
    }

    /// A capsule at `pose`: all points within `radius` of a segment of `length` along its z-axis, centred there; m. Its
    /// whole length is `length + 2 radius`.
    ///
    /// # Errors
    /// As [`Obstacle::cylinder`].
    pub fn capsule(pose: Isometry3<f64>, radius: f64, length: f64) -> Result<Self, ContactError> {
        Self::solid(pose, &Shape::Capsule { radius, length })
    }

    /// A mesh at `pose`, read from an STL, DAE or OBJ file. `scale`: see [`Mesh::read`].
    ///
    /// # Errors
    /// [`ContactError::Mesh`]; [`ContactError::Vector`] for a pose that is not finite.
    pub fn mesh_file(file: &Path, scale: Vector3<f64>, pose: Isometry3<f64>) -> Result<Self, ContactError> {
        let mesh = Mesh::read(file, scale, OWNER)?;
        Self::mesh(mesh, pose).map_err(|error| match error {
            ContactError::Mesh { owner, fault, .. } => ContactError::Mesh { owner, file: file.into(), fault },
            other => other,
        })
    }

    /// A mesh at `pose`.
    ///
    /// # Errors
    /// [`ContactError::Vector`] for a pose that is not finite; [`ContactError::Mesh`] if parry refuses the triangles.
    pub fn mesh(mesh: Mesh, pose: Isometry3<f64>) -> Result<Self, ContactError> {
        let place = finite_pose(&pose)?;
        let triangles = Triangles::new(mesh.vertices(), mesh.triangles(), mesh.is_closed());
        let triangles = triangles.ok_or_else(|| ContactError::Mesh {
            owner: OWNER.into(),
            file: TRIANGLES.into(),
            fault: no_triangles(mesh.triangles().len()),
        })?;
        Ok(Self { surface: Surface::Mesh { pose, mesh }, pose: place, triangles: Some(triangles) })
    }

    fn solid(pose: Isometry3<f64>, shape: &Shape) -> Result<Self, ContactError> {
        let solid = solid(OWNER, shape)?;
        Ok(Self { pose: finite_pose(&pose)?, surface: Surface::Solid { pose, solid }, triangles: None })
    }

    /// The geometry.
    #[doc(hidden)]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    pub(crate) fn pose(&self) -> &Pose<Spatial<f64>> {
        &self.pose
    }

    pub(crate) fn triangles(&self) -> Option<&Triangles> {
        self.triangles.as_ref()
    }
}

fn refuse(what: &'static str, value: Vector3<f64>, rule: &'static str) -> ContactError {
    ContactError::Vector { owner: OWNER.into(), what, value: value.into(), rule }
}

fn finite(what: &'static str, value: Vector3<f64>) -> Result<(), ContactError> {
    let good = value.iter().all(|x| x.is_finite());
    if good { Ok(()) } else { Err(refuse(what, value, "every coordinate must be finite")) }
}

fn finite_pose(pose: &Isometry3<f64>) -> Result<Pose<Spatial<f64>>, ContactError> {
    finite("position", pose.translation.vector)?;
    finite("rotation (i, j, k)", pose.rotation.imag())?;
    Ok((*pose).into())
}

//! The surfaces of a scene.

use super::contact::overridden;
use super::file::{self, Shape};
use crate::contact::{ContactRule, Oscillation, Surface};
use carom_chain::urdf::find_mesh;
use carom_contact::Obstacle;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Where the files that a scene names are searched for.
#[derive(Clone, Copy)]
pub(crate) struct Places<'a> {
    pub folder: &'a Path,
    pub package_dirs: &'a [PathBuf],
}

impl Places<'_> {
    /// The file of a surface's mesh. A plain path need not exist.
    pub fn mesh(self, name: &Path) -> Result<PathBuf, String> {
        match name.to_str() {
            Some(text) if text.contains("://") => {
                find_mesh(text, Some(self.folder), self.package_dirs).map_err(|e| e.to_string())
            }
            _ => Ok(self.folder.join(name)),
        }
    }
}

pub(crate) fn surface(
    places: Places,
    k: usize,
    surface: &file::Surface,
    rule: &ContactRule,
) -> Result<Surface, String> {
    let name = surface.name.clone().unwrap_or_else(|| format!("surface {}", k + 1));
    let placed = |centre: [f64; 3], rpy: [f64; 3]| {
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        Isometry3::from_parts(Translation3::from(Vector3::from(centre)), turn)
    };
    let obstacle = match &surface.shape {
        Shape::Halfspace { point, normal } => Obstacle::half_space((*point).into(), (*normal).into()),
        Shape::Box { centre, size, rpy } => Obstacle::cuboid(placed(*centre, *rpy), (*size).into()),
        Shape::Sphere { centre, radius } => Obstacle::sphere((*centre).into(), *radius),
        Shape::Mesh { file, scale, position, rpy } => {
            let file = places.mesh(file).map_err(|e| format!("[[surface]] '{name}': {e}"))?;
            Obstacle::mesh_file(&file, (*scale).into(), placed(*position, *rpy))
        }
    };
    let obstacle = obstacle.map_err(|e| format!("[[surface]] '{name}': {e}"))?;
    let contact = overridden(rule, &surface.contact).map_err(|why| format!("[[surface]] '{name}': contact {why}"))?;
    contact.check(&format!("[[surface]] '{name}'")).map_err(|e| e.to_string())?;
    let motion = surface.motion.as_ref().map(|motion| Oscillation {
        amplitude: motion.amplitude.into(),
        frequency: motion.frequency * std::f64::consts::TAU,
        phase: motion.phase,
    });
    if let Some(Oscillation { amplitude, frequency, phase }) = &motion
        && !(amplitude.iter().all(|x| x.is_finite()) && frequency.is_finite() && phase.is_finite())
    {
        return Err(format!("[[surface]] '{name}': every number of motion must be finite"));
    }
    Ok(Surface { name, obstacle, contact, motion })
}

pub(crate) fn half_space(surface: Option<&Surface>) -> Option<Vector3<f64>> {
    match surface.map(|surface| surface.obstacle.surface()) {
        Some(carom_contact::Surface::HalfSpace { normal, .. }) => Some(*normal),
        _ => None,
    }
}

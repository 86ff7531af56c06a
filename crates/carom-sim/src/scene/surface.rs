//! The surfaces of a scene.

use super::contact::overridden;
use super::file::{self, Shape};
use super::force::profile;
use crate::contact::{Belt, ContactRule, Oscillation, Surface, SurfaceMotion, Touch};
use crate::state::Profile;
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
        Shape::Box { centre, size, rpy } => Obstacle::cuboid(placed(**centre, **rpy), (*size).into()),
        Shape::Sphere { centre, radius } => Obstacle::sphere((*centre).into(), *radius),
        Shape::Cylinder { centre, radius, length, rpy } => {
            Obstacle::cylinder(placed(**centre, **rpy), *radius, *length)
        }
        Shape::Capsule { centre, radius, length, rpy } => Obstacle::capsule(placed(**centre, **rpy), *radius, *length),
        Shape::Mesh { file, scale, position, rpy } => {
            let file = places.mesh(file).map_err(|e| format!("[[surface]] '{name}': {e}"))?;
            Obstacle::mesh_file(&file, (*scale).into(), placed(**position, **rpy))
        }
    };
    let obstacle = obstacle.map_err(|e| format!("[[surface]] '{name}': {e}"))?;
    let contact = overridden(rule, &surface.contact).map_err(|why| format!("[[surface]] '{name}': contact {why}"))?;
    contact.check(&format!("[[surface]] '{name}'")).map_err(|e| e.to_string())?;
    let refuse = |why: String| format!("[[surface]] '{name}': {why}");
    let motion = match (&surface.motion, &surface.belt) {
        (None, None) => None,
        (Some(given), None) => Some(motion(places, given).map_err(refuse)?),
        (None, Some(given)) => Some(belt(places, given).map_err(refuse)?),
        (Some(_), Some(_)) => return Err(refuse("has both motion and belt: give one of them".into())),
    };
    Ok(Surface { name, obstacle, contact, motion })
}

/// Warnings about belts on which nothing rubs.
pub(crate) fn idle_belts(
    given: &[file::Surface],
    surfaces: &[Surface],
    touches: &[Touch],
) -> impl Iterator<Item = String> {
    let belts = given.iter().zip(surfaces).filter(|(given, _)| given.belt.is_some());
    belts.filter_map(|(_, Surface { name, .. })| {
        let mut own = touches.iter().filter(|touch| touch.surface() == Some(name)).peekable();
        let idle = own.peek().is_some() && own.all(|touch| touch.contact.law.friction() == 0.0);
        idle.then(|| format!("[[surface]] '{name}': belt: no contact of this surface has friction"))
    })
}

pub(crate) fn half_space(surface: Option<&Surface>) -> Option<Vector3<f64>> {
    match surface.map(|surface| surface.obstacle.surface()) {
        Some(carom_contact::Surface::HalfSpace { normal, .. }) => Some(*normal),
        _ => None,
    }
}

/// A table over time beside the scene.
fn table<const N: usize>(places: Places, file: &Path, columns: [&str; N]) -> Result<Profile<N>, String> {
    let path = places.folder.join(file);
    let table = profile(&path, columns, "velocity").map_err(|why| format!("file {}: {why}", path.display()))?;
    match table.times().windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => {
            let time = pair[0];
            Err(format!("file {}: the velocity jumps at time {time}: give the rows different times", path.display()))
        }
        None => Ok(table),
    }
}

/// The motion of a shape: harmonic, or at a velocity.
fn motion(places: Places, given: &file::Motion) -> Result<SurfaceMotion, String> {
    let file::Motion { amplitude, frequency, phase, velocity, file, .. } = given;
    let harmonic = amplitude.is_some() || frequency.is_some() || phase.is_some();
    let finite = |numbers: &[f64]| {
        let fine = numbers.iter().all(|x| x.is_finite());
        if fine { Ok(()) } else { Err("every number of motion must be finite".to_owned()) }
    };
    match (velocity, file) {
        (None, None) => {
            let needs = |key: &str| format!("motion needs the key {key} (or else velocity, or file)");
            let amplitude = amplitude.ok_or_else(|| needs("amplitude"))?;
            let frequency = frequency.ok_or_else(|| needs("frequency"))? * std::f64::consts::TAU;
            let phase = phase.unwrap_or(0.0);
            finite(&[amplitude.as_slice(), &[frequency, phase]].concat())?;
            Ok(Oscillation { amplitude: amplitude.into(), frequency, phase }.into())
        }
        (Some(velocity), None) if !harmonic => {
            finite(&**velocity)?;
            Ok(SurfaceMotion::Translation(Profile::constant(**velocity)))
        }
        (None, Some(file)) if !harmonic => Ok(SurfaceMotion::Translation(table(places, file, ["vx", "vy", "vz"])?)),
        _ => Err("motion is either amplitude, frequency and phase, or velocity, or file: give one of them".into()),
    }
}

/// The velocity of a surface whose shape stays.
fn belt(places: Places, given: &file::Belt) -> Result<SurfaceMotion, String> {
    let file::Belt { velocity, angular_velocity, centre, file, .. } = given;
    let velocity = match (file, velocity, angular_velocity) {
        (Some(file), None, None) => table(places, file, ["vx", "vy", "vz", "wx", "wy", "wz"])?,
        (None, None, None) => return Err("belt needs velocity, angular_velocity or both, or else file".into()),
        (None, ..) => {
            let [v, w] = [velocity, angular_velocity].map(|given| given.unwrap_or_default());
            Profile::constant([v[0], v[1], v[2], w[0], w[1], w[2]])
        }
        (Some(_), ..) => return Err("belt has file and a constant velocity: give one of them".into()),
    };
    let numbers = centre.iter().copied().chain(velocity.at(0.0));
    if numbers.into_iter().any(|x| !x.is_finite()) {
        return Err("every number of belt must be finite".into());
    }
    Ok(SurfaceMotion::Belt(Belt { velocity, centre: (*centre).into() }))
}

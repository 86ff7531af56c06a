//! The start of a scene that gives the velocity of the tip.

use super::file::TipVelocity;
use super::surface::half_space;
use crate::contact::Surface;
use crate::state::{EQUAL, EXACT};
use carom_chain::{Chain, ChainError, Rows};
use nalgebra::{DVector, Vector3};

/// The joint velocities with the least kinetic energy that give the tip the velocity u: qd = M⁻¹Jᵀ H⁺ u.
pub(crate) fn tip_velocity(
    (chain, q): (&Chain, &[f64]),
    link: &str,
    tip: &TipVelocity,
    surface: Option<&Surface>,
) -> Result<Vec<f64>, String> {
    let say = |e: ChainError| e.to_string();
    let Some(normal) = half_space(surface) else {
        return Err("tip_velocity is relative to the first surface, which must be a halfspace: give qd instead".into());
    };
    let along = Vector3::from(tip.along);
    if !(tip.speed.is_finite() && tip.angle_deg.is_finite()) {
        let (speed, angle) = (tip.speed, tip.angle_deg);
        return Err(format!("tip_velocity: speed {speed} and angle_deg {angle} must be finite"));
    }
    let alpha = tip.angle_deg.to_radians();
    let shadow = (along - normal * normal.dot(&along)).try_normalize(EXACT);
    if shadow.is_none() && alpha.cos().abs() > EXACT {
        let [x, y, z] = tip.along;
        return Err(format!(
            "tip_velocity: along = [{x}, {y}, {z}] is normal to the surface: give a direction along the surface"
        ));
    }
    let shadow = shadow.unwrap_or_else(Vector3::zeros);
    let u = (shadow * alpha.cos() - normal * alpha.sin()) * tip.speed;
    let point = chain.point(chain.frame(link).map_err(say)?, Vector3::zeros());
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(chain, q).map_err(say)?;
    let inertia = kin.contact_inertia(point).map_err(say)?;
    let force: DVector<f64> = inertia.principal[..inertia.rank]
        .iter()
        .map(|(direction, sigma)| {
            direction * (direction.dot(&DVector::from_column_slice(u.as_slice())) / (sigma * sigma))
        })
        .fold(DVector::zeros(3), |sum, part| sum + part);
    let (mut impulse, mut response) = (Rows::new(chain.nv()), Rows::default());
    kin.add_point_force(point, Vector3::new(force[0], force[1], force[2]), impulse.add()).map_err(say)?;
    kin.respond(&impulse, &mut response).map_err(say)?;
    let qd = response.row(0);
    let reached = kin.point_velocity(point, qd).map_err(say)?;
    if (reached - u).norm() > EQUAL * tip.speed.abs() {
        let [x, y, z] = u.into();
        return Err(format!(
            "tip_velocity: at this pose no joint velocities give the link '{link}' the velocity ({x}, {y}, {z}) m/s: \
             change q or tip_velocity"
        ));
    }
    Ok(qd.to_vec())
}

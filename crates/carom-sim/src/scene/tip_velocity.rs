//! The start of a scene that gives the velocity of the tip.

use super::file::TipVelocity;
use super::surface::half_space;
use crate::contact::Surface;
use crate::state::EXACT;
use carom_chain::{Chain, ChainError, FramePoint};
use nalgebra::Vector3;

/// The joint velocities that give the tip its velocity.
pub(crate) fn tip_velocity(
    (chain, q): (&Chain, &[f64]),
    link: &str,
    tip: &TipVelocity,
    surface: Option<&Surface>,
) -> Result<Vec<f64>, String> {
    let say = |e: ChainError| format!("tip_velocity: {e}");
    let velocity = match (tip.velocity, tip.speed, tip.angle_deg, tip.along) {
        (Some(velocity), None, None, None) => Vector3::from(velocity),
        (None, Some(speed), Some(angle), Some(along)) => towards((speed, angle, along), surface)?,
        _ => return Err("tip_velocity needs velocity, or speed, angle_deg and along: give one of both".into()),
    };
    let point = FramePoint::from(chain.frame(link).map_err(say)?);
    let mut workspace = chain.workspace();
    let found = workspace.update(chain, q).and_then(|mut at| at.tool_velocity(point, velocity, tip.motion.0));
    Ok(found.map_err(say)?.as_slice().to_vec())
}

/// The velocity of this speed and angle to the first surface.
fn towards((speed, angle, along): (f64, f64, [f64; 3]), surface: Option<&Surface>) -> Result<Vector3<f64>, String> {
    let Some(normal) = half_space(surface) else {
        return Err("tip_velocity with an angle is relative to the first surface, which must be a halfspace: give \
                    tip_velocity.velocity or qd instead"
            .into());
    };
    if !(speed.is_finite() && angle.is_finite()) {
        return Err(format!("tip_velocity: speed {speed} and angle_deg {angle} must be finite"));
    }
    let alpha = angle.to_radians();
    let along = Vector3::from(along);
    let shadow = (along - normal * normal.dot(&along)).try_normalize(EXACT);
    if shadow.is_none() && alpha.cos().abs() > EXACT {
        let [x, y, z] = along.into();
        return Err(format!(
            "tip_velocity: along = [{x}, {y}, {z}] is normal to the surface: give a direction along the surface"
        ));
    }
    Ok((shadow.unwrap_or_default() * alpha.cos() - normal * alpha.sin()) * speed)
}

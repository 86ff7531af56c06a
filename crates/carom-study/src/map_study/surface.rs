//! Contact axes of a study's surfaces: tangents and normal, computed from `normal` or `normal_deg` and `along`.

use super::axis::Axis;
use super::file::Impact;
use super::read::axis;
use carom_chain::algebra::z_onto;
use nalgebra::{SMatrix, Vector2, Vector3};

/// A normal as written in the study file.
pub(super) enum Normal {
    Vector(Vector3<f64>),
    /// Angle from the first axis of the arm's plane, degrees.
    Degrees(f64),
}

/// The axis of the normals, and the contact axes of each.
pub(super) fn normals<const D: usize>(
    impact: &Impact,
    straight: bool,
    surface: impl Fn(Normal, Option<Vector3<f64>>, bool) -> Result<SMatrix<f64, D, D>, String>,
) -> Result<(Axis, Vec<SMatrix<f64, D, D>>), String> {
    let along = impact.along.map(Vector3::from);
    if let Some(along) = along.filter(|along| along.iter().any(|x| !x.is_finite()) || along.norm() == 0.0) {
        return Err(format!("[impact] along = {:?}: a direction needs a finite length above 0", along.as_slice()));
    }
    match (&impact.normal, &impact.normal_deg) {
        (Some(normals), None) => {
            let made = normals.0.iter().map(|given| {
                let normal = Vector3::from(*given);
                if !(normal.norm() > 0.0 && normal.norm().is_finite()) {
                    return Err(format!("[impact] normal = {given:?}: a normal needs a finite length above 0"));
                }
                surface(Normal::Vector(normal), along, straight)
            });
            let made: Vec<_> = made.collect::<Result<_, _>>()?;
            let names = normals.0.iter().map(|[x, y, z]| format!("{x} {y} {z}")).collect();
            Ok((Axis::words("normal", names), made))
        }
        (None, Some(values)) => {
            let axis = axis("impact", "normal_deg", "°", values)?;
            if axis.count() > 1 << 20 {
                return Err(format!(
                    "[impact] normal_deg has {} values: at most {} are allowed",
                    axis.count(),
                    1 << 20
                ));
            }
            let each = (0..axis.count()).map(|k| surface(Normal::Degrees(axis.value(k)), along, straight));
            let made = each.collect::<Result<_, _>>()?;
            Ok((axis, made))
        }
        (None, None) => {
            Err("[impact] has no normal: give normal = [x, y, z], from the environment to the robot".into())
        }
        (Some(_), Some(_)) => Err("[impact] has both normal and normal_deg: keep one of them".into()),
    }
}

fn no_tangential_part(along: &Vector3<f64>) -> String {
    let [x, y, z] = (*along).into();
    format!("[impact] along = [{x}, {y}, {z}] is normal to the surface: give a direction along the surface")
}

/// Contact axes of a planar arm as columns: tangent, normal.
pub(super) fn surface_in_plane(
    basis: &SMatrix<f64, 3, 2>,
    normal: Normal,
    along: Option<Vector3<f64>>,
    _straight: bool,
) -> Result<SMatrix<f64, 2, 2>, String> {
    let n = match normal {
        Normal::Vector(v) => basis.tr_mul(&v).normalize(),
        Normal::Degrees(angle) => {
            let (sin, cos) = angle.to_radians().sin_cos();
            Vector2::new(cos, sin)
        }
    };
    let left = Vector2::new(-n.y, n.x);
    let t = match along {
        None => left,
        Some(along) => {
            let part = basis.tr_mul(&along).dot(&left);
            if part.abs() <= 1e-9 * along.norm() {
                return Err(no_tangential_part(&along));
            }
            left * part.signum()
        }
    };
    Ok(SMatrix::from_columns(&[t, n]))
}

/// Contact axes in space as columns: tangent in the direction of the approach, second tangent, normal.
pub(super) fn surface_in_space(
    normal: Normal,
    along: Option<Vector3<f64>>,
    straight: bool,
) -> Result<SMatrix<f64, 3, 3>, String> {
    let Normal::Vector(n) = normal else {
        return Err("[impact] normal_deg needs a planar arm: give normal = [x, y, z]".into());
    };
    let n = n.normalize();
    let t = match along {
        Some(along) => {
            let part = along - n * n.dot(&along);
            if part.norm() <= 1e-9 * along.norm() {
                return Err(no_tangential_part(&along));
            }
            part.normalize()
        }
        None if straight => z_onto(n).column(0).into_owned(),
        None => {
            return Err(
                "[impact] has no along: give the tangential direction of the approach, as approach_deg is not 90"
                    .into(),
            );
        }
    };
    Ok(SMatrix::from_columns(&[t, n.cross(&t), n]))
}

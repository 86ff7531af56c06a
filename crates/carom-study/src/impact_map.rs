//! Maps of the tangential velocity ratio of a two-link arm over positions of its tip.

use crate::self_motion::{check_lengths, two_link_pose};
use carom_chain::{FrameId, PlanarChain};
use carom_sim::SimError;
use nalgebra::{Matrix2, Vector2, Vector3};

/// One pose of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapPoint {
    /// Joint angles, rad.
    pub q: [f64; 2],
    /// Tip position in the chain's plane, m.
    pub tip: Vector2<f64>,
    /// v_t⁺/v_t⁻: above 1 the tangential velocity grows, from 0 to 1 it shrinks, below 0 it reverses.
    pub tangential_ratio: f64,
}

/// Wall and approach of the tip. The velocity of the tip before the impact has the direction `tangent − normal`, which is at
/// 45° to the wall for orthonormal vectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Unit contact normal in the arm's plane, from the wall to the robot.
    pub normal: Vector2<f64>,
    /// Unit tangent of the wall in the arm's plane, in the direction of the approach.
    pub tangent: Vector2<f64>,
    /// Coefficient of restitution.
    pub restitution: f64,
}

/// Computes v_t⁺/v_t⁻ of a frictionless impact of a two-link planar arm for the tip at each of `targets` (arm's plane, m). The
/// links have the lengths `lengths`, m, begin at the world's origin and are along x at q = 0. Targets out of reach and singular
/// poses are left out. `elbow` is +1 for an elbow to the left of (above) the line from base to tip, −1 for the other side.
///
/// At 45° v_t⁺/v_t⁻ = 1 + (1+e) H_tn/H_nn, eq. (15) of Pagilla and Yu. At a regular pose each velocity
/// of the tip belongs to joint velocities, and u⁺ = u⁻ + (1+e) H n/(nᵀHn).
///
/// # Errors
/// [`SimError`]: the chain does not have two joints, or the lengths are not those of the chain.
pub fn tangential_map(
    flat: &PlanarChain,
    tip: FrameId,
    lengths: [f64; 2],
    approach: Approach,
    elbow: f64,
    targets: impl IntoIterator<Item = [f64; 2]>,
) -> Result<Vec<MapPoint>, SimError> {
    let chain = &flat.chain;
    if chain.nv() != 2 {
        let rule = "a tangential map needs an arm with two joints";
        return Err(SimError::Setting { what: "number of joints", value: chain.nv() as f64, rule });
    }
    let Approach { normal, tangent, restitution } = approach;
    let point = flat.point(tip, Vector3::zeros());
    let mut workspace = chain.workspace();
    let mut map = Vec::new();
    for target in targets {
        let Some(q) = two_link_pose(lengths, target, elbow) else { continue };
        let mut kin = workspace.update(chain, &q)?;
        let response = kin.contact(point, normal, &[])?;
        let tip = response.position;
        check_lengths(chain.name(), &lengths, target, tip.into())?;
        let jacobian = Matrix2::from_columns(response.jacobian);
        if jacobian.determinant().abs() <= 1e-12 * jacobian.norm_squared() {
            continue;
        }
        let impulse = (1.0 + restitution) / response.mobility;
        let [x, y, _] = response.delassus;
        let after = tangent - normal + (x * normal.x + y * normal.y) * impulse;
        map.push(MapPoint { q, tip, tangential_ratio: tangent.dot(&after) });
    }
    Ok(map)
}

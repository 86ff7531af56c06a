//! Impact maps: what a wall does to the tip, over all poses.

use carom_chain::algebra::{Algebra, Planar};
use carom_chain::{ChainError, FrameId, PlanarChain};
use carom_sim::frictionless_jump_into;
use nalgebra::{Vector2, Vector3};

/// One pose of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapPoint {
    /// Joint angles, rad.
    pub q: [f64; 2],
    /// Tip position in the chain's plane, m.
    pub tip: Vector2<f64>,
    /// v_t⁺/v_t⁻: over 1 the tangential velocity grows, from 0 to 1 it shrinks, below 0 it reverses.
    pub tangential_ratio: f64,
}

/// v_t⁺/v_t⁻ of a frictionless impact for every pose of a two-joint planar chain on a grid of `per_joint`² joint angles
/// (second joint on `elbow`'s side only, straight and folded poses left out), the tip coming in at 45° along
/// `tangent − normal` (vectors in the plane, `normal` from the wall to the robot).
///
/// v_t⁺/v_t⁻ = 1 + (1+e) H_tn/H_nn for that angle: the paper's eq. (15). It is computed by the impact kernel, with the
/// joint velocities that such a tip velocity needs.
///
/// # Errors
/// [`ChainError`]: another number of joints than two.
pub fn tangential_map(
    flat: &PlanarChain,
    tip: FrameId,
    normal: Vector2<f64>,
    tangent: Vector2<f64>,
    restitution: f64,
    elbow_up: bool,
    per_joint: usize,
) -> Result<Vec<MapPoint>, ChainError> {
    let chain = &flat.chain;
    if chain.nv() != 2 {
        let why = format!("a tangential map needs two joints, '{}' has {}", chain.name(), chain.nv());
        return Err(ChainError::NotReducible(why));
    }
    let point = flat.point(tip, Vector3::zeros());
    let mut workspace = chain.workspace();
    let (mut scratch, mut qd_plus) = ([0.0; 2], [0.0; 2]);
    let mut map = Vec::with_capacity(per_joint * per_joint);
    let turn = std::f64::consts::TAU;
    for i in 0..per_joint {
        for k in 0..per_joint {
            let share = |k: usize| (k as f64 + 0.5) / per_joint as f64;
            let bend = turn / 2.0 * share(k);
            let q = [turn * (share(i) - 0.5), if elbow_up { -bend } else { bend }];
            let mut kin = workspace.update(chain, &q)?;
            let mut jacobian = nalgebra::Matrix2::zeros();
            kin.point_jacobian_into(point, &mut jacobian);
            let Some(qd) = jacobian.lu().solve(&(tangent - normal)) else { continue };
            frictionless_jump_into(&mut kin, point, normal, restitution, qd.as_slice(), &mut scratch, &mut qd_plus)?;
            let after = kin.point_velocity(point, &qd_plus)?;
            let ratio = Planar::<f64>::dot(tangent, after) / tangent.norm_squared();
            map.push(MapPoint { q, tip: kin.position(point), tangential_ratio: ratio });
        }
    }
    Ok(map)
}

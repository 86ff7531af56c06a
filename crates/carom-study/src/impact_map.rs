//! Impact maps: what a wall does to the tip, over all poses.

use crate::paper::{Elbow, regular};
use crate::self_motion::{check_lengths, two_link_pose};
use carom_chain::{FrameId, PlanarChain};
use carom_sim::{SimError, frictionless_jump_into};
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

/// What the tip meets, and how it comes in: vectors in the arm's plane, the normal from the wall to the robot. The tip
/// comes in along `tangent − normal`, at 45° for unit vectors square to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Approach {
    /// Unit normal of the wall.
    pub normal: Vector2<f64>,
    /// Unit tangent that the tip comes in along.
    pub tangent: Vector2<f64>,
    /// Coefficient of restitution.
    pub restitution: f64,
}

/// v_t⁺/v_t⁻ of a frictionless impact of a two-link planar arm (links of `lengths` from the world's origin, zero along x)
/// for the tip at each of `targets`. Targets out of reach, and poses in which the tip can't move in all directions, are
/// left out.
///
/// v_t⁺/v_t⁻ = 1 + (1+e) H_tn/H_nn at 45°: the paper's eq. (15). It is computed by the impact kernel, with the joint
/// velocities that such a tip velocity needs.
///
/// # Errors
/// [`SimError`]: another number of joints than two, lengths that are not the chain's.
pub fn tangential_map(
    flat: &PlanarChain,
    tip: FrameId,
    lengths: [f64; 2],
    approach: Approach,
    elbow: Elbow,
    targets: impl IntoIterator<Item = [f64; 2]>,
) -> Result<Vec<MapPoint>, SimError> {
    let chain = &flat.chain;
    if chain.nv() != 2 {
        let rule = "a tangential map is for two joints";
        return Err(SimError::Setting { what: "number of joints", value: chain.nv() as f64, rule });
    }
    let Approach { normal, tangent, restitution } = approach;
    let point = flat.point(tip, Vector3::zeros());
    let mut workspace = chain.workspace();
    let (mut scratch, mut qd_plus) = ([0.0; 2], [0.0; 2]);
    let mut map = Vec::new();
    for target in targets {
        let Some(q) = two_link_pose(lengths, target, elbow.side()) else { continue };
        let mut kin = workspace.update(chain, &q)?;
        let mut jacobian = nalgebra::Matrix2::zeros();
        kin.point_jacobian_into(point, &mut jacobian);
        check_lengths(chain.name(), &lengths, target, kin.position(point).into())?;
        let Some(qd) = regular(jacobian).and_then(|j| j.lu().solve(&(tangent - normal))) else { continue };
        frictionless_jump_into(&mut kin, point, normal, restitution, qd.as_slice(), &mut scratch, &mut qd_plus)?;
        let after = kin.point_velocity(point, &qd_plus)?;
        map.push(MapPoint { q, tip: kin.position(point), tangential_ratio: tangent.dot(&after) });
    }
    Ok(map)
}

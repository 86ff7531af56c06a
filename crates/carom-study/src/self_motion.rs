//! Self-motion of a redundant arm: the poses with the same position of the tip.

use carom_chain::{Chain, FrameId};
use carom_sim::SimError;
use nalgebra::{Matrix3, Vector3};

/// One pose of a self-motion.
#[derive(Debug, Clone, PartialEq)]
pub struct SelfMotionPoint {
    /// Joint positions, rad.
    pub q: Vec<f64>,
    /// Effective mass along the normal, kg; `None` in a singular normal direction.
    pub effective_mass: Option<f64>,
    /// h = tᵀHn/nᵀHn with the normal into the surface: without friction the tangential jump is −(1+e)·h times the approach
    /// speed. `None` in a singular normal direction.
    pub coupling: Option<f64>,
}

/// Samples the self-motion of a planar three-joint arm with its tip at `target` (world frame, m): `samples` equally spaced
/// absolute directions of the last link, with both elbows. Directions out of reach are left out.
///
/// `lengths` are the three link lengths, m. `normal` and `tangent` are unit vectors in the world frame; the normal points from
/// the surface to the robot.
///
/// # Errors
/// [`SimError`]: the lengths are not those of the chain, or the mass matrix is singular.
pub fn self_motion(
    chain: &Chain,
    tip: FrameId,
    lengths: [f64; 3],
    target: [f64; 2],
    normal: Vector3<f64>,
    tangent: Vector3<f64>,
    samples: usize,
) -> Result<Vec<SelfMotionPoint>, SimError> {
    let point = chain.point(tip, Vector3::zeros());
    let mut workspace = chain.workspace();
    let mut poses = Vec::new();
    for elbow in [1.0, -1.0] {
        for k in 0..samples {
            let direction = std::f64::consts::TAU * k as f64 / samples as f64;
            let Some(q) = three_link_pose(lengths, target, direction, elbow) else { continue };
            let mut kin = workspace.update(chain, &q)?;
            check_lengths(chain.name(), &lengths, target, kin.position(point).xy().into())?;
            let response = kin.contact(point, normal, &[])?;
            let effective_mass = response.moves().then(|| 1.0 / response.mobility);
            let into = Matrix3::from_columns(&response.delassus) * -normal;
            let coupling = effective_mass.map(|m| m * tangent.dot(&into));
            poses.push(SelfMotionPoint { q: q.to_vec(), effective_mass, coupling });
        }
    }
    Ok(poses)
}

/// Checks that a pose computed from `lengths` has the tip at `target`.
pub(crate) fn check_lengths(chain: &str, lengths: &[f64], target: [f64; 2], found: [f64; 2]) -> Result<(), SimError> {
    let off = (found[0] - target[0]).hypot(found[1] - target[1]);
    if off <= 1e-9 * lengths.iter().sum::<f64>() {
        return Ok(());
    }
    Err(SimError::Lengths { chain: chain.into(), lengths: lengths.to_vec(), target, found })
}

/// Joint angles of three links with the tip at `target` and the last link in `direction`, rad; `None` out of reach.
fn three_link_pose(lengths: [f64; 3], target: [f64; 2], direction: f64, elbow: f64) -> Option<[f64; 3]> {
    let [a, b, c] = lengths;
    let wrist = [target[0] - c * direction.cos(), target[1] - c * direction.sin()];
    let [first, bend] = two_link_pose([a, b], wrist, elbow)?;
    Some([first, bend, wrap(direction - first - bend)])
}

/// Joint angles of two links from the origin with the tip at `target`; `None` out of reach. `elbow` is +1 for an elbow to the
/// left of (above) the line from base to tip, −1 for the other side.
pub(crate) fn two_link_pose(lengths: [f64; 2], target: [f64; 2], elbow: f64) -> Option<[f64; 2]> {
    let [direction, base, bend] = triangle(lengths, target)?;
    Some([wrap(direction + elbow * base), -elbow * bend])
}

/// By the law of cosines: the direction of the tip from the origin, the angle there from it to the first of two links, and the
/// bend between the links, the last two from 0 to π; rad. `None` out of reach.
pub(crate) fn triangle(lengths: [f64; 2], target: [f64; 2]) -> Option<[f64; 3]> {
    let ([a, b], [x, y]) = (lengths, target);
    let cos_bend = (x * x + y * y - a * a - b * b) / (2.0 * a * b);
    if cos_bend.abs() > 1.0 {
        return None;
    }
    // sin and cos of the acos, not of the cosine, which has lost the digits of a small bend
    let bend = cos_bend.acos();
    let (sin, cos) = bend.sin_cos();
    Some([y.atan2(x), (b * sin).atan2(a + b * cos), bend])
}

fn wrap(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

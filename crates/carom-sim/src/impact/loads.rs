//! The loads of an impact on the joints: the impulses through drives, gears and bearings.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | Jᵀp | nv | impulse at the contact as impulses on the joints | `joint_impulse` |
//! | fᵢ | 6 | impulse that the parent link of joint i exerts on its child link | `through` |

use super::hit::ChainImpact;
use super::strike::Strike;
use crate::error::SimError;
use crate::state::written;
use carom_chain::{Chain, FramePoint};
use nalgebra::Vector3;
use serde::Serialize;

/// What an impact does to the joints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImpactLoads {
    /// Jᵀp of all impulses, length nv, N m s or N s: what the impact demands of each joint. It accelerates the chain where joints are
    /// free, M (q̇⁺ − q̇⁻) = Jᵀp, and loads the drives where they are locked.
    pub joint_impulse: Vec<f64>,
    /// The impulse through every joint that moves, in the order of the file.
    #[serde(rename = "bearings")]
    pub through: Vec<JointImpulse>,
}

/// The impulse that the parent link of a joint exerts on its child link, by bearing, gear and drive together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointImpulse {
    /// Name of the joint.
    pub joint: String,
    /// In the axes of the child link, N s.
    #[serde(serialize_with = "written::vector")]
    pub force: Vector3<f64>,
    /// Moment about the origin of the child link, in its axes, N m s.
    #[serde(serialize_with = "written::vector")]
    pub moment: Vector3<f64>,
}

/// The loads on the joints of a chain at `q`, whose velocities change by `change` = q̇⁺ − q̇⁻ (length nv) under impulses on points of
/// links (world axes, N s). For a mechanism with loops they are not determined by these.
///
/// # Errors
/// [`SimError::Chain`] for a wrong length or numbers that are not finite.
pub fn impact_loads(
    chain: &Chain,
    q: &[f64],
    change: &[f64],
    impulses: &[(FramePoint, Vector3<f64>)],
) -> Result<ImpactLoads, SimError> {
    chain.check_state(q, change)?;
    let mut workspace = chain.workspace();
    let mut at = workspace.update(chain, q)?;
    let mut joint_impulse = vec![0.0; chain.nv()];
    for (point, impulse) in impulses {
        at.add_point_force(chain.point(point.frame, point.offset), *impulse, &mut joint_impulse)?;
    }
    let mut through: Vec<_> = at.joint_wrenches(&vec![0.0; chain.nv()], change, Vector3::zeros(), impulses)?;
    through.sort_by_key(|wrench| wrench.joint);
    let named = |wrench: carom_chain::JointWrench| JointImpulse {
        joint: chain.joints()[wrench.joint].name.clone(),
        force: wrench.force,
        moment: wrench.moment,
    };
    Ok(ImpactLoads { joint_impulse, through: through.into_iter().map(named).collect() })
}

impl Strike<'_> {
    /// The loads of one of its impacts on the joints.
    ///
    /// ```
    /// # use carom_chain::uniform_chain;
    /// # use carom_impact::Energetic;
    /// # use carom_sim::Impacts;
    /// let arm = uniform_chain(2, 1.0, 1.0)?;
    /// let (q, qd) = ([0.3, 0.7], [-0.5, -1.0]);
    /// let strike = arm.impact(&q, &qd).at(arm.frame("tip")?).normal([0.0, 1.0, 0.0]);
    /// let hit = strike.clone().resolve(&Energetic { restitution: 0.5, friction: 0.3 })?;
    /// let loads = strike.loads(&hit)?;
    /// // A free hinge transmits no moment about its axis.
    /// assert!(loads.through.iter().all(|joint| joint.moment.z.abs() < 1e-15));
    /// assert_eq!(loads.through[0].joint, "joint1");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Strike::contact`].
    pub fn loads(&self, hit: &ChainImpact) -> Result<ImpactLoads, SimError> {
        let point = self.aim()?.point;
        let change: Vec<f64> = hit.qd_plus.iter().zip(self.qd).map(|(after, before)| after - before).collect();
        impact_loads(self.chain, self.q, &change, &[(point, hit.impulse)])
    }
}

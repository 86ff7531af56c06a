//! The action of the joint drives during an impact.

use crate::error::{SimError, require};
use carom_chain::urdf::JointType;
use carom_chain::{Chain, ChainError, Coordinates};

/// The model of the joint drives during an impact. They add a diagonal inertia W to M:
///
/// ```text
/// (M + W)(q̇⁺ − q̇⁻) = Jᵀp,   j = −W (q̇⁺ − q̇⁻),   T⁺ − T⁻ = ½ p·(u⁻ + u⁺) + ½ j·(q̇⁻ + q̇⁺)
/// ```
///
/// A drive resists a *change* of the velocity of its joint; a moving joint that is locked keeps its velocity. The energy
/// bounds of an impact law hold for the work of the contact impulse ½ p·(u⁻ + u⁺), which is the change of ½ q̇ᵀ(M + W)q̇. The
/// work of the drives ½ j·(q̇⁻ + q̇⁺) is added to it and may have either sign.
///
/// For an arm under stiff position control, measured impacts agree much better with the inertia of locked joints than with
/// that of free joints (arXiv:2202.12646).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum JointModel<'a> {
    /// The drives have no effect (W = 0): the limit of an impact of zero duration for drives with finite force.
    #[default]
    Free,
    /// The joints with these names keep their velocities (W infinite).
    Locked(&'a [&'a str]),
    /// All joints except floating ones keep their velocities. With a floating base the robot then is one rigid body.
    AllLocked,
    /// Impedance-weighted joints: each drive is a spring and a damper relative to the motion before the impact, acting during
    /// a contact of duration Δt. `W = Δt (K Δt + D)`, from one implicit integration step of that length.
    Impedance {
        /// Stiffness K for each velocity coordinate, length nv, N m/rad or N/m; 0 for coordinates without a drive.
        stiffness: &'a [f64],
        /// Damping D for each velocity coordinate, length nv, N m s/rad or N s/m.
        damping: &'a [f64],
        /// Duration Δt of the contact, above 0 s.
        contact_time: f64,
    },
}

impl JointModel<'_> {
    /// One number for all joints: that of each velocity coordinate, 0 for those of floating joints, which have no drive.
    #[doc(hidden)]
    pub fn for_all_joints(chain: &Chain, number: f64) -> Vec<f64> {
        let mut all = vec![0.0; chain.nv()];
        for joint in chain.joints().iter().filter(|joint| joint.kind != JointType::Floating) {
            if let Coordinates::Own { v, .. } = &joint.coordinates {
                all[v.clone()].fill(number);
            }
        }
        all
    }

    /// The diagonal of W; empty if it is zero.
    pub(super) fn added_inertia(&self, chain: &Chain) -> Result<Vec<f64>, SimError> {
        if *self == Self::Free {
            return Ok(Vec::new());
        }
        let mut added = vec![0.0; chain.nv()];
        match *self {
            Self::Free => {}
            Self::Locked(joints) => {
                for name in joints {
                    let Coordinates::Own { v, .. } = &chain.joint(name)?.coordinates else {
                        return Err(ChainError::NotReducible(format!(
                            "joint '{name}' has no coordinate of its own to lock (it is fixed, or follows another joint)"
                        ))
                        .into());
                    };
                    added[v.clone()].fill(f64::INFINITY);
                }
            }
            Self::AllLocked => added = Self::for_all_joints(chain, f64::INFINITY),
            Self::Impedance { stiffness, damping, contact_time } => {
                chain.check_v("stiffness", stiffness)?;
                chain.check_v("damping", damping)?;
                let lasts = contact_time > 0.0 && contact_time.is_finite();
                require(lasts, "the contact time", contact_time, "it must be finite and above 0 s")?;
                for (k, sum) in added.iter_mut().enumerate() {
                    for (what, value) in [("a joint's stiffness", stiffness[k]), ("a joint's damping", damping[k])] {
                        require(value >= 0.0, what, value, "it must be 0 or more")?;
                    }
                    *sum = contact_time * (stiffness[k] * contact_time + damping[k]);
                    let rule = "it must be finite; lock the joint instead";
                    require(sum.is_finite(), "the inertia Δt (K Δt + D)", *sum, rule)?;
                }
            }
        }
        Ok(added)
    }
}

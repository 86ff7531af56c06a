//! The wrenches that joints transmit, by bearings and drives.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | fᵢ | 6 | wrench of the parent link on body i, at the body's origin | `ws.force` |
//! | Iᵢ aᵢ + vᵢ × Iᵢ vᵢ | 6 | rate of momentum of body i | – |
//!
//! `fᵢ = Iᵢ aᵢ + vᵢ × Iᵢ vᵢ − (applied forces) + Σ fⱼ` over the bodies j that body i carries: the inward pass of the recursive
//! Newton–Euler algorithm, of which inverse dynamics keeps the component along the joint axis only. Source: Featherstone (2008),
//! section 5.3.

use crate::algebra::{Force, Geometry, Inertia, Spatial};
use crate::body::FramePoint;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::scratch::Flow;
use nalgebra::Vector3;

/// The wrench that the parent link of a joint exerts on its child link, by bearing, gear and drive together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointWrench {
    /// Index of the joint in [`Chain::joints`](crate::Chain::joints).
    pub joint: usize,
    /// Force on the child link, in the axes of the child link, N; N s for an impulse.
    pub force: Vector3<f64>,
    /// Moment on the child link about the origin of its frame, in its axes, N m; N m s for an impulse.
    pub moment: Vector3<f64>,
}

impl Kinematics<'_, Spatial<f64>> {
    /// The wrench through every joint that moves, in the order of the bodies, for velocities `qd` and accelerations `qdd` (length nv),
    /// gravity (world axes, m/s²) and forces on points of links (world axes, N).
    ///
    /// For an impact, `qd` is zero, `qdd` is the change q̇⁺ − q̇⁻, there is no gravity, and the forces are the impulses: the result is
    /// the impulse through each joint. The component along the axis of a hinge or slider is the force of its drive, less the reflected
    /// inertia of its rotor times its acceleration.
    ///
    /// ```
    /// # use carom_chain::{FramePoint, uniform_chain};
    /// # use nalgebra::Vector3;
    /// // A rod on a hinge, 2 m and 3 kg, whose end gets an impulse p = 1 N s across it, beyond its centre of percussion at 2/3 l: with
    /// // Δq̇ = 3 p/(m l) its centre gets m l/2 Δq̇ = 3/2 p, of which the hinge gives the half that p does not.
    /// let rod = uniform_chain(1, 2.0, 3.0)?;
    /// let mut workspace = rod.workspace();
    /// let mut at = workspace.update(&rod, &[0.0])?;
    /// let end = FramePoint::from(rod.frame("tip")?);
    /// let rate = 3.0 / (3.0 * 2.0);
    /// let through = at.joint_wrenches(&[0.0], &[rate], Vector3::zeros(), &[(end, Vector3::y())])?;
    /// assert!((through[0].force.y - 0.5).abs() < 1e-14 && through[0].moment.norm() < 1e-14);
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn joint_wrenches(
        &mut self,
        qd: &[f64],
        qdd: &[f64],
        gravity: Vector3<f64>,
        forces: &[(FramePoint, Vector3<f64>)],
    ) -> Result<Vec<JointWrench>, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.chain.check_nv("qdd", qdd.len())?;
        // The pass leaves the motion of every body. Its forces are those of inertias of which a hinge's own have been divided among the
        // bodies, which have the same joint forces, but not the same wrenches.
        self.spread_force(qd, Some(qdd), gravity);
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let Flow { spin, spin_rate, acceleration } = self.ws.flow[i];
            let Inertia { mass, first_moment: h, rotational } = body.inertia.rotated(self.ws.links[i].rotation);
            let inertia = |rate| <Spatial<f64> as Geometry>::apply_inertia(rotational, rate);
            self.ws.force[i] = Force {
                force: acceleration * mass + spin_rate.cross(&h) + spin.cross(&spin.cross(&h)),
                moment: inertia(spin_rate) + spin.cross(&inertia(spin)) + h.cross(&acceleration),
            };
        }
        for (at, force) in forces {
            let point = self.chain.point(at.frame, at.offset);
            if let Some(body) = point.body {
                let arm = self.position(point) - self.ws.links[body].position;
                self.ws.force[body] += Force { moment: force.cross(&arm), force: -force };
            }
        }
        let (bodies, ws) = (&self.chain.bodies, &mut *self.ws);
        self.chain.sum_subtrees(&ws.links, &mut ws.force, |force, r| force.shifted(r));
        let last = |i: &usize| bodies.get(i + 1).is_none_or(|next| next.joint_index != bodies[*i].joint_index);
        let wrench = |i: usize| {
            let joint = bodies[i].joint_index;
            let child = self.pose(self.chain.frame(&self.chain.joints()[joint].child)?);
            let Force { moment, force } = self.ws.force[i].shifted(self.ws.links[i].position - child.translation);
            let turn = |v: Vector3<f64>| child.rotation.tr_mul(&v);
            Ok(JointWrench { joint, force: turn(force), moment: turn(moment) })
        };
        (0..bodies.len()).filter(last).map(wrench).collect()
    }
}

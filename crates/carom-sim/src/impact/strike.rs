//! One impact of a chain at one point: `qd⁺ = qd⁻ + M⁻¹ Jᵀ p`.
//!
//! Data flow: chain, contact point, normal, joint model → [`PreparedStrike`]; with q and qd → response of the chain at the
//! point ([`carom_chain::PointResponse`]) → [`ImpactProblem`](carom_impact::ImpactProblem) → law → [`ChainImpact`].
//! [`Contact`] holds the response, for several laws at one state.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | n | 3 | unit normal, from the environment to the robot, world | `normal` |
//! | R | 3×3 | contact axes (t₁, t₂, n) as columns, world | `axes` |
//! | J | 3×nv | Jacobian of the contact point, world | `jacobian` |
//! | H | 3×3 | Delassus matrix, world | `delassus` |
//! | u⁻, u⁺ | 3 | velocity of the contact point before and after, world | `u_minus`, `u_plus` |
//! | p | 3 | impulse on the robot, world, N s | `impulse` |
//! | W | nv | inertia that the drives add to the diagonal of M; infinite at locked joints | – |
//! | j | nv | impulse of the drives, −W (q̇⁺ − q̇⁻) | `drive_impulse` |

use super::contact::Contact;
use super::derivative::{ImpactDerivative, unit};
use super::hit::ChainImpact;
use super::joints::JointModel;
use super::prepared::{Aim, PreparedStrike};
use super::saltation::{Saltation, saltation};
use super::together::{self, SeveralImpact, StruckPoint};
use crate::contact::SeveralLaw;
use crate::error::SimError;
use crate::state::Moment;
use carom_chain::algebra::z_onto;
use carom_chain::{Chain, ChainError, FramePoint, Point, Spatial};
use carom_impact::Law;
use nalgebra::Vector3;

/// Extension trait of [`Chain`] with the method `chain.impact(&q, &qd)`; in the prelude of `carom`.
pub trait Impacts {
    /// Describes an impact of the chain at configuration `q` (length nq; rad, m, quaternion) with joint velocities `qd`
    /// (length nv; rad/s, m/s). The contact point and the normal are set on the returned [`Strike`].
    fn impact<'a>(&'a self, q: &'a [f64], qd: &'a [f64]) -> Strike<'a>;

    /// Computes an impact of the chain at several points at the same moment, as one problem: a toe line, a face, two feet.
    ///
    /// # Errors
    /// [`SimError::Incomplete`] without points; for each point those of [`Strike::contact`]; [`SimError::Impact`] for a
    /// coefficient out of its range; [`SimError::Together`] where no impulses were found that satisfy the law, neither with the
    /// coefficients of restitution given nor without restitution.
    ///
    /// ```
    /// # use carom_chain::{Chain, FramePoint, urdf::LoadOptions};
    /// # use nalgebra::Vector3;
    /// # use carom_sim::{Grip, Impacts, JointModel, SeveralLaw, StruckPoint};
    /// // A free cube with edges of 0.2 m, which falls flat on a toe line through two corners.
    /// let text = "<robot name='cube'><link name='cube'><inertial><mass value='3'/>
    ///     <inertia ixx='0.02' ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.02'/></inertial></link></robot>";
    /// let cube = Chain::from_urdf_str(text, &LoadOptions { floating_base: true, ..Default::default() })?;
    /// let (q, qd) = ([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]);
    /// let corner = |y| StruckPoint {
    ///     point: FramePoint::new(cube.frame("cube").unwrap(), [0.1, y, -0.1]),
    ///     normal: Vector3::z(),
    ///     grip: Grip::Sticks,
    ///     relative_stiffness: 1.0,
    /// };
    /// let line = [corner(-0.1), corner(0.1)];
    /// let hit = cube.impact_at_points(&q, &qd, &line, JointModel::Free, SeveralLaw::Moreau)?;
    /// // It turns about the line at m v r / (I + m r²), with the lever r = 0.1 m and the distance √2 r of the line.
    /// let rate = -3.0 * 1.0 * 0.1 / (0.02 + 3.0 * 0.02);
    /// assert!((hit.qd_plus[4] - rate).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn impact_at_points(
        &self,
        q: &[f64],
        qd: &[f64],
        points: &[StruckPoint],
        joints: JointModel,
        law: SeveralLaw,
    ) -> Result<SeveralImpact, SimError>;
}

impl Impacts for Chain {
    fn impact<'a>(&'a self, q: &'a [f64], qd: &'a [f64]) -> Strike<'a> {
        let joints = JointModel::Free;
        Strike { chain: self, q, qd, point: None, offset: None, normal: None, joints }
    }

    fn impact_at_points(
        &self,
        q: &[f64],
        qd: &[f64],
        points: &[StruckPoint],
        joints: JointModel,
        law: SeveralLaw,
    ) -> Result<SeveralImpact, SimError> {
        self.check_state(q, qd)?;
        let aim = |struck: &StruckPoint| {
            Ok((*struck, self.impact(q, qd).at(struck.point).normal(struck.normal).joints(joints).aim()?))
        };
        let points: Vec<_> = points.iter().map(aim).collect::<Result<_, SimError>>()?;
        together::resolve(self, (q, qd), &points, law)
    }
}

/// The description of an impact: contact point, normal, and model of the joints.
#[derive(Debug, Clone)]
pub struct Strike<'a> {
    pub(super) chain: &'a Chain,
    pub(super) q: &'a [f64],
    pub(super) qd: &'a [f64],
    point: Option<FramePoint>,
    offset: Option<Vector3<f64>>,
    normal: Option<Vector3<f64>>,
    joints: JointModel<'a>,
}

impl<'a> Strike<'a> {
    /// The contact point: a point of a link, or the origin of a link frame.
    pub fn at(mut self, point: impl Into<FramePoint>) -> Self {
        self.point = Some(point.into());
        self
    }

    /// The contact point relative to the origin of the frame of [`Strike::at`], in its axes, m.
    pub fn offset(mut self, offset: impl Into<Vector3<f64>>) -> Self {
        self.offset = Some(offset.into());
        self
    }

    /// Contact normal in world axes, from the environment to the robot, of any length except zero.
    pub fn normal(mut self, normal: impl Into<Vector3<f64>>) -> Self {
        self.normal = Some(normal.into());
        self
    }

    /// The action of the drives during the impact; none by default.
    pub fn joints(mut self, joints: JointModel<'a>) -> Self {
        self.joints = joints;
        self
    }

    /// Checks the inputs that do not depend on q and qd: contact point, normal and joint model. The result computes impacts of
    /// many states without allocation.
    ///
    /// # Errors
    /// [`SimError::Incomplete`], [`SimError::FixedPoint`], [`SimError::Locked`] if all joints that move the point are locked,
    /// [`SimError::Chain`] for a normal that is zero, a point that is not finite or an invalid joint, [`SimError::Setting`] for
    /// invalid impedances.
    pub fn prepare(&self) -> Result<PreparedStrike<'a>, SimError> {
        Ok(PreparedStrike::new(self.aim()?))
    }

    pub(super) fn aim(&self) -> Result<Aim<'a>, SimError> {
        let Some(mut contact) = self.point else {
            return Err(SimError::Incomplete { missing: "point", say: ".at(chain.frame(\"…\")?)" });
        };
        contact.offset = self.offset.unwrap_or(contact.offset);
        if let Some(index) = contact.offset.iter().position(|x| !x.is_finite()) {
            return Err(ChainError::NotFinite { what: "point", index, value: contact.offset[index] }.into());
        }
        let Some(normal) = self.normal else {
            return Err(SimError::Incomplete { missing: "normal", say: ".normal([x, y, z])" });
        };
        let normal = unit(normal)?;
        let link = || self.chain.frame_name(contact.frame).to_owned();
        let point: Point<Spatial<f64>> = self.chain.point(contact.frame, contact.offset);
        if point.body.is_none() {
            return Err(SimError::FixedPoint { link: link() });
        }
        let added = self.joints.added_inertia(self.chain)?;
        let bodies = self.chain.bodies();
        let mut above = std::iter::successors(point.body, |&body| bodies[body].parent);
        if !added.is_empty() && above.all(|body| added[bodies[body].v_index].is_infinite()) {
            return Err(SimError::Locked { link: link(), normal });
        }
        Ok(Aim { chain: self.chain, point: contact, axes: z_onto(normal), added })
    }

    /// Computes the contact: Jacobian, Delassus matrix and impact problem, which are the same for all laws.
    ///
    /// # Errors
    /// As [`Strike::prepare`]; [`SimError::Chain`] for an invalid state; [`SimError::SingularNormal`] or [`SimError::Locked`] if
    /// no (free) joint moves the contact point along the normal.
    pub fn contact(&self) -> Result<Contact<'a>, SimError> {
        let aim = self.aim()?;
        self.chain.check_state(self.q, self.qd)?;
        Contact::new(aim, self.q, self.qd)
    }

    /// Computes the impact with a law.
    ///
    /// # Errors
    /// As [`Strike::contact`]; [`SimError::Impact`] for errors of the law.
    pub fn resolve(&self, law: &dyn Law<f64, 3>) -> Result<ChainImpact, SimError> {
        let mut prepared = self.prepare()?;
        self.chain.check_state(self.q, self.qd)?;
        let mut hit = prepared.outcome();
        prepared.resolve_into(self.q, self.qd, law, &mut hit)?;
        Ok(hit)
    }

    /// Computes the impact with a law and the derivatives of `qd_plus` with respect to q, qd⁻, e and μ. The contact point is
    /// fixed on its link and the normal is fixed in the world.
    ///
    /// ```
    /// # use carom_chain::uniform_chain;
    /// # use carom_impact::Energetic;
    /// # use carom_sim::Impacts;
    /// let arm = uniform_chain(2, 1.0, 1.0)?;
    /// let tip = arm.frame("tip")?;
    /// let (q, qd) = ([0.3, 0.7], [-0.5, -1.0]);
    /// let law = Energetic { restitution: 0.5, friction: 0.3 };
    /// let derivative = arm.impact(&q, &qd).at(tip).normal([0.0, 1.0, 0.0]).derivative(&law)?;
    /// // qd⁺ is homogeneous of degree one in qd⁻: ∂qd⁺/∂qd⁻ qd⁻ = qd⁺ (Euler's theorem).
    /// let by_speed = &derivative.qd * nalgebra::DVector::from_column_slice(&qd);
    /// assert!((by_speed - nalgebra::DVector::from_vec(derivative.hit.qd_plus)).amax() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Strike::resolve`]; [`SimError::Impact`] for a user-defined law, which has no derivative;
    /// [`SimError::DerivativeOfHeldJoints`].
    pub fn derivative(&self, law: &dyn Law<f64, 3>) -> Result<ImpactDerivative, SimError> {
        let mut prepared = self.prepare()?;
        self.chain.check_state(self.q, self.qd)?;
        prepared.derivative(self.q, self.qd, law)
    }

    /// The saltation matrix of this impact with a plane at rest, for a chain that moves freely under `gravity` (world axes,
    /// m/s²) before and after it: see [`saltation`](crate::saltation()).
    ///
    /// # Errors
    /// As [`Strike::derivative`], with held joints too; [`SimError::Setting`] if the contact point does not approach the plane.
    pub fn saltation(&self, law: &dyn Law<f64, 3>, gravity: impl Into<Vector3<f64>>) -> Result<Saltation, SimError> {
        let (aim, gravity) = (self.aim()?, gravity.into());
        if !aim.added.is_empty() {
            return Err(SimError::DerivativeOfHeldJoints);
        }
        let plane = aim.plane();
        let Self { chain, q, qd, .. } = self;
        let moment = Moment { time: 0.0, q: q.to_vec(), qd: qd.to_vec() };
        saltation(chain, &moment, &plane, law, |at| {
            let mut workspace = chain.workspace();
            let tau = vec![0.0; at.qd.len()];
            Ok(workspace.update(chain, &at.q)?.forward_dynamics(&at.qd, &tau, gravity)?)
        })
    }
}

//! One impact of a chain at one point: `qd⁺ = qd⁻ + M⁻¹ Jᵀ p`.
//!
//! Data flow: chain, q, qd, contact point and normal → [`Contact`] (Jacobian, Delassus matrix, contact axes,
//! [`ImpactProblem`]) → law → [`ChainImpact`].
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

use crate::derivative::{At, ImpactDerivative, PlaneContact, differentiate};
use crate::error::SimError;
use crate::saltation::{Saltation, saltation};
use crate::trajectory::Moment;
use carom_chain::algebra::z_onto;
use carom_chain::urdf::JointType;
use carom_chain::{Chain, ChainError, ContactInertia, Coordinates, FrameId, Point, Spatial, Workspace};
use carom_impact::{CoefficientRanges, Flags, ImpactOutcome, ImpactProblem, Law, Mode};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Extension trait of [`Chain`] with the method `chain.impact(&q, &qd)`; in the prelude of `carom`.
pub trait Impacts {
    /// Describes an impact of the chain at configuration `q` (length nq; rad, m, quaternion) with joint velocities `qd`
    /// (length nv; rad/s, m/s). The contact point and the normal are set on the returned [`Strike`].
    fn impact<'a>(&'a self, q: &'a [f64], qd: &'a [f64]) -> Strike<'a>;
}

impl Impacts for Chain {
    fn impact<'a>(&'a self, q: &'a [f64], qd: &'a [f64]) -> Strike<'a> {
        let joints = JointModel::Free;
        Strike { chain: self, q, qd, frame: None, offset: Vector3::zeros(), normal: None, joints }
    }
}

/// The description of an impact: contact point, normal, and model of the joints.
#[derive(Debug, Clone)]
pub struct Strike<'a> {
    chain: &'a Chain,
    q: &'a [f64],
    qd: &'a [f64],
    frame: Option<FrameId>,
    offset: Vector3<f64>,
    normal: Option<[f64; 3]>,
    joints: JointModel<'a>,
}

impl<'a> Strike<'a> {
    /// The link frame whose origin is the contact point.
    pub fn at(mut self, frame: FrameId) -> Self {
        self.frame = Some(frame);
        self
    }

    /// The contact point relative to that origin, in the axes of the frame, m; zero by default.
    pub fn offset(mut self, offset: [f64; 3]) -> Self {
        self.offset = offset.into();
        self
    }

    /// Contact normal in world axes, from the environment to the robot, of any length except zero.
    pub fn normal(mut self, normal: [f64; 3]) -> Self {
        self.normal = Some(normal);
        self
    }

    /// The action of the drives during the impact; none by default.
    pub fn joints(mut self, joints: JointModel<'a>) -> Self {
        self.joints = joints;
        self
    }

    /// Validates the inputs that do not depend on q and qd: contact point, normal and joint model. Useful before a loop over
    /// many states.
    ///
    /// # Errors
    /// [`SimError::Incomplete`], [`SimError::FixedPoint`], [`SimError::Locked`] if all joints that move the point are locked,
    /// [`SimError::Chain`] for a normal that is zero or an invalid joint, [`SimError::Setting`] for invalid impedances.
    pub fn check(&self) -> Result<(), SimError> {
        self.checked().map(|_| ())
    }

    fn checked(&self) -> Result<Checked, SimError> {
        let Some(frame) = self.frame else {
            return Err(SimError::Incomplete { missing: "point", say: ".at(chain.frame(\"…\")?)" });
        };
        let Some(normal) = self.normal else {
            return Err(SimError::Incomplete { missing: "normal", say: ".normal([x, y, z])" });
        };
        let given = Vector3::from(normal);
        // Scaled first, so that squares neither overflow nor underflow.
        let normal = (given / given.amax()).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
        let Some(normal) = normal else {
            return Err(ChainError::NoDirection { given: given.as_slice().to_vec(), length: given.norm() }.into());
        };
        let point: Point<Spatial<f64>> = self.chain.point(frame, self.offset);
        if point.body.is_none() {
            return Err(SimError::FixedPoint { link: self.chain.frame_name(frame).to_owned() });
        }
        let added = self.joints.added_inertia(self.chain)?;
        let bodies = self.chain.bodies();
        let mut above = std::iter::successors(point.body, |&body| bodies[body].parent);
        if added.as_ref().is_some_and(|added| above.all(|body| added[bodies[body].v_index].is_infinite())) {
            let link = self.chain.frame_name(frame).to_owned();
            return Err(SimError::Locked { link, normal: normal.into() });
        }
        Ok(Checked { frame, normal, added })
    }

    /// Computes the contact: Jacobian, Delassus matrix and impact problem, which are the same for all laws.
    ///
    /// # Errors
    /// As [`Strike::check`]; [`SimError::Chain`] for an invalid state; [`SimError::SingularNormal`] or [`SimError::Locked`] if
    /// no (free) joint moves the contact point along the normal.
    pub fn contact(self) -> Result<Contact<'a>, SimError> {
        let Checked { frame, normal, added } = self.checked()?;
        self.chain.check_state(self.q, self.qd)?;
        let contact = Contact::new(self.chain, self.q, self.qd, frame, self.offset, normal, added);
        contact.map_err(|why| match why {
            SimError::SingularNormal { link, normal } if self.joints.locks() => SimError::Locked { link, normal },
            why => why,
        })
    }

    /// Computes the impact with a law.
    ///
    /// # Errors
    /// As [`Strike::contact`]; [`SimError::Impact`] for errors of the law.
    pub fn resolve(self, law: &dyn Law<f64, 3>) -> Result<ChainImpact, SimError> {
        self.contact()?.resolve(law)
    }

    /// Computes all impacts that satisfy the law, see [`Law::branches`]. The first one is that of [`Strike::resolve`].
    ///
    /// # Errors
    /// As [`Strike::resolve`].
    pub fn branches(self, law: &dyn Law<f64, 3>) -> Result<Vec<ChainImpact>, SimError> {
        self.contact()?.branches(law)
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
    pub fn derivative(self, law: &dyn Law<f64, 3>) -> Result<ImpactDerivative, SimError> {
        self.contact()?.derivative(law)
    }

    /// Bounds of the outcome while e and μ vary in ranges: see [`Contact::band`].
    ///
    /// # Errors
    /// As [`Strike::contact`] and [`Contact::band`].
    pub fn band(self, law: &dyn Law<f64, 3>, ranges: &CoefficientRanges) -> Result<ImpactBand, SimError> {
        self.contact()?.band(law, ranges)
    }

    /// The saltation matrix of this impact with a plane at rest, for a chain that moves freely under `gravity` (world axes,
    /// m/s²) before and after it: see [`saltation`](crate::saltation()).
    ///
    /// # Errors
    /// As [`Strike::derivative`]; [`SimError::Setting`] if the contact point does not approach the plane.
    pub fn saltation(self, law: &dyn Law<f64, 3>, gravity: [f64; 3]) -> Result<Saltation, SimError> {
        let contact = self.contact()?;
        let Contact { chain, q, qd, frame, offset, axes, .. } = contact;
        let plane = PlaneContact { frame, offset, radius: 0.0, axes, motion: None };
        let moment = Moment { time: 0.0, q: q.to_vec(), qd: qd.to_vec() };
        saltation(chain, &moment, &plane, law, |at| {
            let mut workspace = chain.workspace();
            let tau = vec![0.0; at.qd.len()];
            Ok(workspace.update(chain, &at.q)?.forward_dynamics(&at.qd, &tau, gravity.into())?)
        })
    }
}

/// The validated inputs that do not depend on q and qd.
struct Checked {
    frame: FrameId,
    /// Unit normal.
    normal: Vector3<f64>,
    /// Diagonal of W, if the drives act.
    added: Option<Vec<f64>>,
}

/// A contact at one state of a chain, to which laws are applied.
#[derive(Debug)]
pub struct Contact<'a> {
    chain: &'a Chain,
    q: &'a [f64],
    qd: &'a [f64],
    workspace: Workspace<Spatial<f64>>,
    /// Contact axes in the world: two tangents, then the normal.
    axes: Matrix3<f64>,
    jacobian: DMatrix<f64>,
    frame: FrameId,
    offset: Vector3<f64>,
    inertia: ContactInertia,
    problem: ImpactProblem<f64, 3>,
    /// Diagonal of W, if the drives act.
    added: Option<Vec<f64>>,
}

impl<'a> Contact<'a> {
    fn new(
        chain: &'a Chain,
        q: &'a [f64],
        qd: &'a [f64],
        frame: FrameId,
        offset: Vector3<f64>,
        normal: Vector3<f64>,
        added: Option<Vec<f64>>,
    ) -> Result<Self, SimError> {
        let point: Point<Spatial<f64>> = chain.point(frame, offset);
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(chain, q)?;
        let inertia = match &added {
            None => kin.contact_inertia(point)?,
            Some(added) => kin.contact_inertia_with(point, added)?,
        };
        if inertia.effective_mass(normal.as_slice()).is_none() {
            let link = chain.frame_name(frame).to_owned();
            return Err(SimError::SingularNormal { link, normal: normal.into() });
        }
        let jacobian = kin.point_jacobian(point);
        let u = kin.point_velocity(point, qd)?;
        let axes = z_onto(normal);
        let delassus = Matrix3::from_fn(|i, j| inertia.delassus[(i, j)]);
        let problem = ImpactProblem::new(axes.transpose() * delassus * axes, axes.transpose() * u)?;
        Ok(Self { chain, q, qd, workspace, axes, jacobian, frame, offset, inertia, problem, added })
    }

    /// The impact problem, which is the input of the law: in contact axes, tangents first, normal last.
    pub fn problem(&self) -> &ImpactProblem<f64, 3> {
        &self.problem
    }

    /// Delassus matrix and effective mass at the contact point, world axes. Inertia of drives is included.
    pub fn inertia(&self) -> &ContactInertia {
        &self.inertia
    }

    /// Jacobian of the contact point, 3×nv, world axes.
    pub fn jacobian(&self) -> &DMatrix<f64> {
        &self.jacobian
    }

    /// Computes the impact with a law.
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law.
    pub fn resolve(&mut self, law: &dyn Law<f64, 3>) -> Result<ChainImpact, SimError> {
        let outcome = law.resolve(&self.problem)?;
        self.carry(outcome)
    }

    /// Computes all impacts that satisfy the law, see [`Law::branches`]. The first one is that of [`Contact::resolve`].
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law.
    pub fn branches(&mut self, law: &dyn Law<f64, 3>) -> Result<Vec<ChainImpact>, SimError> {
        let outcomes = law.branches(&self.problem)?;
        outcomes.into_iter().map(|outcome| self.carry(outcome)).collect()
    }

    fn carry(&mut self, outcome: ImpactOutcome<f64, 3>) -> Result<ChainImpact, SimError> {
        let Self { chain, q, qd, workspace, axes, inertia, added, jacobian, .. } = self;
        let mut hit = carry(outcome, axes, &inertia.response, qd, &mut |qd| {
            Ok(workspace.update(chain, q)?.kinetic_energy(qd)?)
        })?;
        if let Some(added) = added {
            let qd_plus = DVector::from_column_slice(&hit.qd_plus);
            let before = DVector::from_column_slice(qd);
            let jump = &qd_plus - &before;
            // The impulse of a locked joint follows from M Δq̇ = Jᵀp + j.
            let missing = workspace.update(chain, q)?.mass_matrix() * &jump - jacobian.transpose() * hit.impulse;
            let given = added.iter().enumerate();
            let given = given.map(|(k, w)| if w.is_finite() { -w * jump[k] } else { missing[k] });
            hit.drive_impulse = given.collect();
            hit.drive_work = 0.5 * DVector::from_column_slice(&hit.drive_impulse).dot(&(before + qd_plus));
        }
        Ok(hit)
    }

    /// Bounds of the outcome while e and μ vary in ranges. [`ImpactProblem::band`](carom_impact::ImpactProblem::band)
    /// documents for which problems the bounds are exact and for which they are sampled.
    ///
    /// # Errors
    /// [`SimError::Impact`]: errors of the law at any of the coefficients, an invalid range, a user-defined law.
    pub fn band(&self, law: &dyn Law<f64, 3>, ranges: &CoefficientRanges) -> Result<ImpactBand, SimError> {
        let Self { problem, axes, inertia, .. } = self;
        // Linear functions of the impulse in contact axes: qd⁺ − qd⁻, u⁺ − u⁻ and the impulse in world axes.
        let joints = &inertia.response * axes;
        let velocity = axes * problem.delassus();
        let rows = joints.row_iter().map(|row| row.transpose());
        let rows = rows.chain((0..3).map(|i| velocity.row(i).transpose()));
        let rows: Vec<Vector3<f64>> = rows.chain((0..3).map(|i| axes.row(i).transpose())).collect();
        let found = problem.band(law, ranges, &rows)?;
        let u_minus = axes * problem.u_minus();
        let before = self.qd.iter().chain(u_minus.iter()).copied().chain([0.0; 3]);
        let bounds = before.zip(found.low.iter().zip(&found.high));
        let mut bounds: Vec<[f64; 2]> = bounds.map(|(x, (low, high))| [x + low, x + high]).collect();
        let rest = bounds.split_off(self.qd.len());
        Ok(ImpactBand {
            qd_plus: bounds,
            u_plus: [rest[0], rest[1], rest[2]],
            impulse: [rest[3], rest[4], rest[5]],
            exact: found.exact,
            evaluations: found.evaluations,
        })
    }

    /// Computes the impact with a law and its derivatives: see [`Strike::derivative`].
    ///
    /// # Errors
    /// [`SimError::Impact`] for errors of the law and for a user-defined law, which has no derivative;
    /// [`SimError::DerivativeOfHeldJoints`].
    pub fn derivative(&mut self, law: &dyn Law<f64, 3>) -> Result<ImpactDerivative, SimError> {
        if self.added.is_some() {
            return Err(SimError::DerivativeOfHeldJoints);
        }
        let law = self.problem.differentiate(law)?;
        let contact =
            PlaneContact { frame: self.frame, offset: self.offset, radius: 0.0, axes: self.axes, motion: None };
        let rows = self.axes.transpose() * &self.jacobian;
        let state = At { chain: self.chain, q: self.q, qd: self.qd, time: 0.0 };
        let by = differentiate(state, &contact, &rows, &(&self.inertia.response * self.axes), &law)?;
        let hit = self.carry(law.outcome)?;
        Ok(ImpactDerivative { hit, q: by.q, qd: by.qd, restitution: by.restitution, friction: by.friction })
    }
}

/// Joint velocities from the impulse of a law: qd⁺ = qd⁻ + M⁻¹Jᵀp, where `response` is M⁻¹Jᵀ in world axes. Without drives.
pub(crate) fn carry(
    outcome: ImpactOutcome<f64, 3>,
    axes: &Matrix3<f64>,
    response: &DMatrix<f64>,
    qd: &[f64],
    kinetic_energy: &mut dyn FnMut(&[f64]) -> Result<f64, SimError>,
) -> Result<ChainImpact, SimError> {
    let impulse = axes * outcome.impulse;
    let qd_plus = DVector::from_column_slice(qd) + response * impulse;
    Ok(ChainImpact {
        impulse,
        u_minus: axes * outcome.u_minus,
        u_plus: axes * outcome.u_plus,
        energy_before: kinetic_energy(qd)?,
        energy_after: kinetic_energy(qd_plus.as_slice())?,
        mode: outcome.mode,
        flags: outcome.flags,
        contact: outcome,
        drive_impulse: vec![0.0; qd.len()],
        drive_work: 0.0,
        qd_plus: qd_plus.as_slice().to_vec(),
    })
}

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
    fn locks(&self) -> bool {
        matches!(self, Self::Locked(_) | Self::AllLocked)
    }

    /// The diagonal of W; none if it is zero.
    fn added_inertia(&self, chain: &Chain) -> Result<Option<Vec<f64>>, SimError> {
        let mut added = vec![0.0; chain.nv()];
        match *self {
            Self::Free => return Ok(None),
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
            Self::AllLocked => {
                for joint in chain.joints().iter().filter(|joint| joint.kind != JointType::Floating) {
                    if let Coordinates::Own { v, .. } = &joint.coordinates {
                        added[v.clone()].fill(f64::INFINITY);
                    }
                }
            }
            Self::Impedance { stiffness, damping, contact_time } => {
                chain.check_v("stiffness", stiffness)?;
                chain.check_v("damping", damping)?;
                let not = |what, value, rule| Err(SimError::Setting { what, value, rule });
                if !(contact_time > 0.0 && contact_time.is_finite()) {
                    return not("the contact time", contact_time, "it must be finite and above 0 s");
                }
                for (k, sum) in added.iter_mut().enumerate() {
                    for (what, value) in [("a joint's stiffness", stiffness[k]), ("a joint's damping", damping[k])] {
                        if value < 0.0 {
                            return not(what, value, "it must be 0 or more");
                        }
                    }
                    *sum = contact_time * (stiffness[k] * contact_time + damping[k]);
                    if !sum.is_finite() {
                        return not("the inertia Δt (K Δt + D)", *sum, "it must be finite; lock the joint instead");
                    }
                }
            }
        }
        Ok(Some(added))
    }
}

/// Bounds [minimum, maximum] of an impact over ranges of the coefficients. Each bound is attained, but in general not all
/// of them for the same coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactBand {
    /// Bounds of each joint velocity after the impact, rad/s or m/s.
    pub qd_plus: Vec<[f64; 2]>,
    /// Bounds of the velocity of the contact point after the impact, world axes, m/s.
    pub u_plus: [[f64; 2]; 3],
    /// Bounds of the impulse on the robot, world axes, N s.
    pub impulse: [[f64; 2]; 3],
    /// `true`: the bounds are exact up to rounding. `false`: they are sampled and may be too narrow.
    pub exact: bool,
    /// Number of impacts computed.
    pub evaluations: usize,
}

/// The result of an impact of a chain.
#[derive(Debug, Clone)]
pub struct ChainImpact {
    /// Joint velocities after the impact, length nv; rad/s, m/s.
    pub qd_plus: Vec<f64>,
    /// Impulse on the robot, world axes, N s.
    pub impulse: Vector3<f64>,
    /// Velocity of the contact point before, world axes, m/s.
    pub u_minus: Vector3<f64>,
    /// Velocity of the contact point after, world axes, m/s.
    pub u_plus: Vector3<f64>,
    /// Kinetic energy of the whole chain before, J.
    pub energy_before: f64,
    /// Kinetic energy of the whole chain after, J, from `qd_plus`: `energy_before + ½ p·(u⁻ + u⁺) + drive_work`.
    pub energy_after: f64,
    /// Impulse of the drives on each joint, length nv, N m s or N s; zeros with [`JointModel::Free`].
    pub drive_impulse: Vec<f64>,
    /// Work of that impulse, J.
    pub drive_work: f64,
    /// Contact mode at the end of the impact: no impact, stick, slip or reverse slip.
    pub mode: Mode,
    /// Notes about the result, for instance an energy gain.
    pub flags: Flags,
    /// The outcome of the law in contact axes: work, realised coefficients, phases. Its energies include the inertia W of the
    /// drives.
    pub contact: ImpactOutcome<f64, 3>,
}

impl ChainImpact {
    /// T⁺/T⁻ of the whole chain. Its square root is what the paper's eq. (16) calls "energetic coefficient": a ratio of
    /// kinetic energies, not Stronge's coefficient of the normal work. 1 for a chain at rest.
    pub fn energy_ratio(&self) -> f64 {
        if self.energy_before > 0.0 { self.energy_after / self.energy_before } else { 1.0 }
    }

    /// Kinetic energy lost, J (negative: gained).
    pub fn energy_loss(&self) -> f64 {
        self.energy_before - self.energy_after
    }
}

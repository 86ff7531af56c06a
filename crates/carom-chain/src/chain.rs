//! The immutable model: a tree of bodies, each with one degree of freedom, and the links and joints of the file.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | λ(i) | parent of body i; always smaller than i | [`Body::parent`] |
//! | Xᵀ(i) | pose of joint i's frame in its parent body | [`Body::placement`] |
//! | Iᵢ | inertia of body i about its own origin, body axes | [`Body::inertia`] |
//! | n | number of bodies, `bodies.len()` | – |
//!
//! Links on fixed joints are merged into their parent. A floating joint becomes six bodies, the last of which has the
//! inertia; a planar joint becomes three. Each of these is the parent of the next and adjacent to it in the list. Bodies
//! are numbered depth first. A mimic joint is a body that shares the coordinate of the joint it mimics: position =
//! ratio · q + shift. Every joint of the recursions therefore has one degree of freedom. Without mimic joints n = nv.

use crate::about::{About, Coordinates, JointCoordinate, JointInfo, Member};
use crate::algebra::{Algebra, Inertia, Pose, Real, Spatial};
use crate::body::{Body, Frame, FrameId, Point};
use crate::delassus::Structure;
use crate::error::ChainError;
use crate::planarize::PlanarChain;
use crate::prepare::PreparedBody;
use crate::urdf::{Link, LoadReport, NamedPose, suggestion};
use num_traits::Zero;
use std::sync::{Arc, OnceLock};

/// A kinematic chain (a tree of bodies): immutable, `Send + Sync`, shared by reference.
///
/// `Chain` without a parameter is the chain in space over `f64`; [`Chain::to_planar`] returns the chain in the plane and
/// [`Chain::cast`] the chain over another scalar.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain<A: Algebra = Spatial<f64>> {
    pub(crate) about: Arc<About>,
    pub(crate) bodies: Vec<Body<A>>,
    pub(crate) prepared: Vec<PreparedBody<A>>,
    pub(crate) structure: Arc<Structure>,
    pub(crate) frames: Vec<Frame<A>>,
    pub(crate) nq: usize,
    pub(crate) nv: usize,
    pub(crate) flat: Flat,
}

/// The chain in the plane, which depends on the rest of the chain alone: computed at its first use, shared by the clones, and
/// left out of comparisons.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flat(pub Arc<OnceLock<Option<PlanarChain>>>);

impl PartialEq for Flat {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<A: Algebra> Chain<A> {
    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.about.name
    }
    /// Length of q.
    pub fn nq(&self) -> usize {
        self.nq
    }
    /// Length of qd: the degrees of freedom.
    pub fn nv(&self) -> usize {
        self.nv
    }
    /// The bodies, parents first.
    #[doc(hidden)]
    pub fn bodies(&self) -> &[Body<A>] {
        &self.bodies
    }
    /// The frames: one for each link of the file, in its order, without those of pruned links.
    pub fn frames(&self) -> &[Frame<A>] {
        &self.frames
    }
    /// The joints of the file, in its order (a floating base first).
    pub fn joints(&self) -> &[JointInfo] {
        &self.about.joints
    }
    /// The links of the file, as it describes them, in its order.
    pub fn links(&self) -> &[Link] {
        &self.about.links
    }
    /// Sum of the masses of all links in the file, the fixed base included, kg.
    pub fn total_mass(&self) -> f64 {
        self.about.total_mass
    }
    /// What loading has found in the file and changed: warnings, elements that are not used, repairs.
    pub fn report(&self) -> &LoadReport {
        &self.about.report
    }
    /// The pairs of links between which the SRDF disables collisions
    /// ([`LoadOptions::srdf`](crate::urdf::LoadOptions::srdf)).
    #[doc(hidden)]
    pub fn disabled_pairs(&self) -> &[[String; 2]] {
        &self.about.disabled_pairs
    }
    /// The poses that the SRDF names ([`LoadOptions::srdf`](crate::urdf::LoadOptions::srdf)); none of a chain of several robots.
    pub fn poses(&self) -> &[NamedPose] {
        &self.about.poses
    }
    /// The robots of a chain that [`Chain::join`] has made, with their entries of q and qd; empty for any other chain.
    pub fn members(&self) -> &[Member] {
        &self.about.members
    }
    /// The links that move without mass: those of bodies whose coordinate moves neither mass nor inertia at any configuration.
    /// The mass matrix is then singular everywhere. Kinematics and Jacobians do not depend on it.
    pub fn massless_links(&self) -> Vec<&str> {
        self.massless_links_with(&[])
    }

    /// The same with the diagonal of an inertia added to M, which holds joints; empty without one.
    fn massless_links_with(&self, added: &[A::Scalar]) -> Vec<&str> {
        let own = |body: &Body<A>| body.inertia != Inertia::zero();
        let mut carries: Vec<bool> = self.bodies.iter().map(own).collect();
        let holds = |v: usize| added.get(v).is_some_and(|inertia| *inertia != A::Scalar::zero());
        let mut moved: Vec<bool> = (0..self.nv).map(holds).collect();
        for (i, body) in self.bodies.iter().enumerate().rev() {
            moved[body.v_index] |= carries[i] || body.rotor != A::Scalar::zero();
            if let Some(parent) = body.parent {
                carries[parent] |= carries[i];
            }
        }
        let massless = |frame: &&Frame<A>| frame.body.is_some_and(|body| !moved[self.bodies[body].v_index]);
        self.frames.iter().filter(massless).map(|frame| frame.name.as_str()).collect()
    }

    /// Checks that every coordinate moves mass or inertia at some configuration.
    ///
    /// # Errors
    /// [`ChainError::Massless`] with [`Chain::massless_links`].
    #[doc(hidden)]
    pub fn check_dynamics(&self) -> Result<(), ChainError> {
        self.check_dynamics_with(&[])
    }

    /// The same with the diagonal of an inertia added to M, infinite at locked joints: a joint that is held needs none behind it.
    ///
    /// # Errors
    /// As [`Chain::check_dynamics`].
    #[doc(hidden)]
    pub fn check_dynamics_with(&self, added: &[A::Scalar]) -> Result<(), ChainError> {
        let massless = self.massless_links_with(added);
        let links: Vec<String> = massless.into_iter().map(|link| format!("'{link}'")).collect();
        if links.is_empty() { Ok(()) } else { Err(ChainError::Massless { chain: self.name().into(), links }) }
    }
    /// Whether the chain has mimic joints, so that several bodies share one coordinate.
    #[doc(hidden)]
    pub fn is_coupled(&self) -> bool {
        self.bodies.len() != self.nv
    }

    /// The frame of a link.
    ///
    /// # Errors
    /// [`ChainError::UnknownFrame`] with the nearest names.
    pub fn frame(&self, link: &str) -> Result<FrameId, ChainError> {
        let found = self.frames.iter().position(|f| f.name == link);
        found.map(FrameId).ok_or_else(|| ChainError::UnknownFrame {
            name: link.into(),
            hint: suggestion(link, &self.frames.iter().map(|f| f.name.as_str()).collect::<Vec<_>>()),
        })
    }

    /// Name of a frame.
    ///
    /// # Panics
    /// May panic if the handle belongs to another chain.
    #[doc(hidden)]
    pub fn frame_name(&self, frame: FrameId) -> &str {
        &self.frames[frame.0].name
    }

    /// A joint of the file.
    ///
    /// # Errors
    /// [`ChainError::UnknownJoint`] with the nearest names.
    pub fn joint(&self, name: &str) -> Result<&JointInfo, ChainError> {
        self.about.joints.iter().find(|j| j.name == name).ok_or_else(|| ChainError::UnknownJoint {
            name: name.into(),
            hint: suggestion(name, &self.about.joints.iter().map(|j| j.name.as_str()).collect::<Vec<_>>()),
        })
    }

    /// The joints with coordinates of their own, which are neither fixed nor mimic joints, in the order of q.
    #[doc(hidden)]
    pub fn moving_joints(&self) -> impl Iterator<Item = &JointInfo> {
        self.about.joints.iter().filter(|joint| matches!(joint.coordinates, Coordinates::Own { .. }))
    }

    /// The coordinate with which a joint moves, its own or that of the joint which it mimics; `None` for fixed joints and for those with
    /// several coordinates.
    #[doc(hidden)]
    pub fn coordinate_of(&self, joint: &JointInfo) -> Option<JointCoordinate> {
        match &joint.coordinates {
            Coordinates::Own { q, v } if v.len() == 1 => {
                Some(JointCoordinate { q: q.start, v: v.start, multiplier: 1.0, offset: 0.0 })
            }
            Coordinates::Follows { joint, multiplier, offset } => {
                let leader = self.joint(joint).ok()?;
                Some(JointCoordinate { multiplier: *multiplier, offset: *offset, ..self.coordinate_of(leader)? })
            }
            _ => None,
        }
    }

    /// The joint of a velocity coordinate (index into qd); `None` for an index of [`Chain::nv`] or more.
    ///
    /// ```
    /// let chain = carom_chain::uniform_chain(2, 1.0, 1.0)?;
    /// assert_eq!(chain.joint_of_velocity(1).map(|joint| joint.name.as_str()), Some("joint2"));
    /// assert!(chain.joint_of_velocity(2).is_none());
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    #[doc(hidden)]
    pub fn joint_of_velocity(&self, index: usize) -> Option<&JointInfo> {
        let owns = |j: &&JointInfo| matches!(&j.coordinates, Coordinates::Own { v, .. } if v.contains(&index));
        self.about.joints.iter().find(owns)
    }

    /// The point at `offset` (frame axes, m) from a frame's origin.
    ///
    /// # Panics
    /// May panic if the handle belongs to another chain.
    pub fn point(&self, frame: FrameId, offset: A::Vector) -> Point<A> {
        let frame = &self.frames[frame.0];
        Point { body: frame.body, position: frame.pose.point(offset) }
    }

    /// The same chain over another scalar: `f32`, SIMD lanes, dual numbers.
    pub fn cast<U: Real>(&self) -> Chain<A::Cast<U>>
    where
        A: Algebra<Scalar = f64>,
    {
        let pose =
            |p: &Pose<A>| Pose { rotation: A::cast_rotation(p.rotation), translation: A::cast_vector(p.translation) };
        let body = |b: &Body<A>| Body {
            parent: b.parent,
            joint_index: b.joint_index,
            joint: b.joint,
            placement: pose(&b.placement),
            inertia: b.inertia.cast(),
            q_index: b.q_index,
            v_index: b.v_index,
            ratio: nalgebra::convert(b.ratio),
            shift: nalgebra::convert(b.shift),
            rotor: nalgebra::convert(b.rotor),
        };
        let frame = |f: &Frame<A>| Frame { name: f.name.clone(), body: f.body, pose: pose(&f.pose) };
        Chain {
            about: self.about.clone(),
            bodies: self.bodies.iter().map(body).collect(),
            prepared: self.prepared.iter().map(PreparedBody::cast).collect(),
            structure: self.structure.clone(),
            frames: self.frames.iter().map(frame).collect(),
            nq: self.nq,
            nv: self.nv,
            flat: Flat::default(),
        }
    }

    /// The same chain with the rotational inertia of every body about its centre of mass multiplied by `scale`. Masses and
    /// centres of mass do not change. This ratio of inertia to mass is what velocities before and after an impact can
    /// identify, because they do not change when all masses and inertias are multiplied by the same factor.
    ///
    /// # Errors
    /// [`ChainError::OutOfRange`]: a scale that is not positive and finite.
    ///
    /// ```
    /// let chain = carom_chain::uniform_chain(2, 1.0, 1.0)?;
    /// let (once, thrice) = (chain.with_inertia_scaled(1.0)?, chain.with_inertia_scaled(3.0)?);
    /// let least = |c: &carom_chain::Chain| c.workspace().update(c, &[0.0; 2]).map(|mut at| at.mass_matrix()[(1, 1)]);
    /// // A link of length l = 1/2 and mass m = 1/2: m l²/4 about its joint for the mass, m l²/12 for its inertia.
    /// assert!((least(&once)? - 0.125 / 3.0).abs() < 1e-15);
    /// assert!((least(&thrice)? - 0.125 / 2.0).abs() < 1e-15);
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    pub fn with_inertia_scaled(&self, scale: f64) -> Result<Self, ChainError>
    where
        A: Algebra<Scalar = f64>,
    {
        if !(scale > 0.0 && scale.is_finite()) {
            let rule = "the scale of the rotational inertia must be positive and finite";
            return Err(ChainError::OutOfRange { what: "inertia scale".into(), value: scale, rule });
        }
        let mut scaled = self.clone();
        for Body { inertia, .. } in &mut scaled.bodies {
            let com = if inertia.mass > 0.0 { inertia.first_moment * (1.0 / inertia.mass) } else { A::Vector::zero() };
            let of_mass = Inertia::<A>::from_com(inertia.mass, com, A::Rotational::zero()).rotational;
            inertia.rotational = of_mass + (inertia.rotational - of_mass) * scale;
        }
        Ok(Self::of(scaled.about, scaled.bodies, scaled.frames, scaled.nq, scaled.nv))
    }

    /// The same chain with the inertia of a motor's rotor at a joint, reflected through its gear: N² I for the gear ratio N and the
    /// rotor's inertia I about its own axis, kg m² (of a motor that drives a slider kg). It is added to the diagonal of M,
    /// and so to the kinetic energy, the dynamics and the inertia at a contact. The rotor's mass belongs to the link that carries the
    /// motor, and its gyroscopic moments are left out (they are smaller by the factor 1/N; Featherstone 2008, section 9.6; MuJoCo's
    /// `armature`). Replaces an earlier value.
    ///
    /// # Errors
    /// [`ChainError::UnknownJoint`]; [`ChainError::OutOfRange`]: a number that is negative or not finite, or a joint that does
    /// not have exactly one coordinate of its own.
    ///
    /// ```
    /// let bare = carom_chain::uniform_chain(2, 1.0, 1.0)?;
    /// let geared = bare.with_rotor_inertia("joint1", 100.0_f64.powi(2) * 2e-6)?; // N = 100, I = 2e-6 kg m²
    /// let m = |chain: &carom_chain::Chain| chain.workspace().update(chain, &[0.1, 0.4]).map(|mut at| at.mass_matrix());
    /// let (bare, geared) = (m(&bare)?, m(&geared)?);
    /// assert!((geared[(0, 0)] - bare[(0, 0)] - 0.02).abs() < 1e-15 && geared[(1, 1)] == bare[(1, 1)]);
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    pub fn with_rotor_inertia(&self, joint: &str, inertia: f64) -> Result<Self, ChainError>
    where
        A: Algebra<Scalar = f64>,
    {
        let refuse = |rule| ChainError::OutOfRange { what: format!("rotor inertia of {joint}"), value: inertia, rule };
        if !(inertia >= 0.0 && inertia.is_finite()) {
            return Err(refuse("the reflected inertia of a rotor must be finite and not negative"));
        }
        let rule = "a rotor belongs to a joint with one coordinate of its own, not to a fixed, floating, planar or mimic joint";
        let coordinate = self.joint(joint)?.driven_coordinate().ok_or_else(|| refuse(rule))?;
        let mut geared = self.clone();
        if let Some(body) = geared.bodies.iter_mut().find(|body| body.v_index == coordinate) {
            body.rotor = inertia;
        }
        Ok(Self::of(geared.about, geared.bodies, geared.frames, geared.nq, geared.nv))
    }

    /// The same chain with another effort limit of a joint, N m or N: motors of a simulation that obeys effort limits give no more.
    ///
    /// # Errors
    /// [`ChainError::UnknownJoint`]; [`ChainError::OutOfRange`] for a number that is negative or NaN, and a joint that no motor drives.
    pub fn with_effort_limit(&self, joint: &str, effort: f64) -> Result<Self, ChainError> {
        let refuse = |rule| ChainError::OutOfRange { what: format!("effort limit of {joint}"), value: effort, rule };
        if effort.is_nan() || effort < 0.0 {
            return Err(refuse("it must not be negative"));
        }
        let rule = "an effort limit belongs to a joint with one coordinate of its own, not to a fixed, floating, planar or mimic joint";
        self.joint(joint)?.driven_coordinate().ok_or_else(|| refuse(rule))?;
        let mut limited = self.clone();
        let own = Arc::make_mut(&mut limited.about).joints.iter_mut().filter(|own| own.name == joint);
        own.for_each(|own| own.limits.effort = Some(effort));
        Ok(limited)
    }

    /// The reflected inertia of the rotor of each velocity coordinate: see [`Chain::with_rotor_inertia`].
    #[doc(hidden)]
    pub fn rotor_inertias(&self) -> Vec<A::Scalar> {
        let mut inertias = vec![A::Scalar::zero(); self.nv];
        self.bodies.iter().for_each(|body| inertias[body.v_index] += body.rotor);
        inertias
    }

    /// The chain of these bodies, prepared for the recursions; axes of bodies on hinges are rotated about the hinge.
    pub(crate) fn of(
        about: Arc<About>,
        mut bodies: Vec<Body<A>>,
        mut frames: Vec<Frame<A>>,
        nq: usize,
        nv: usize,
    ) -> Self
    where
        A: Algebra<Scalar = f64>,
    {
        let prepared = PreparedBody::of(&mut bodies, &mut frames);
        let structure = Arc::new(Structure::of(&prepared, nv));
        Self { about, prepared, structure, bodies, frames, nq, nv, flat: Flat::default() }
    }

    /// The name of the joint of a velocity coordinate.
    pub(crate) fn name_of_velocity(&self, v_index: usize) -> String {
        self.joint_of_velocity(v_index).map_or("?".into(), |j| j.name.clone())
    }

    #[inline(always)]
    pub(crate) fn check_nq(&self, got: usize) -> Result<(), ChainError> {
        let note = if self.nq == self.nv { "" } else { "; a floating joint has x y z qx qy qz qw" };
        self.check_length("q", got, self.nq, note)
    }

    #[inline(always)]
    pub(crate) fn check_nv(&self, what: &'static str, got: usize) -> Result<(), ChainError> {
        self.check_length(what, got, self.nv, "")
    }

    #[inline(always)]
    fn check_length(&self, what: &'static str, got: usize, expected: usize, note: &str) -> Result<(), ChainError> {
        if got == expected { Ok(()) } else { Err(self.wrong_length(what, got, expected, note)) }
    }

    #[cold]
    #[inline(never)]
    fn wrong_length(&self, what: &'static str, got: usize, expected: usize, note: &str) -> ChainError {
        let names: Vec<&str> = self.moving_joints().map(|j| j.name.as_str()).collect();
        let layout = match names.as_slice() {
            [first @ .., last] if first.len() > 20 => format!("{}, …, {last}{note}", first[..20].join(", ")),
            names => format!("{}{note}", names.join(", ")),
        };
        ChainError::WrongLength { what, got, expected, layout }
    }
}

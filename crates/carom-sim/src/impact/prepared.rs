//! A strike whose contact point, normal and joint model have been checked: it computes impacts of many states without
//! allocation, in the plane (D = 2) or in space (D = 3).
//!
//! A chain whose joints move in one plane, struck along a normal in it, has no velocity, no inertia and so no impulse across the
//! plane. Its impact problem has then one tangent, and a known law is applied to that problem; its outcome is converted
//! to the contact axes in space. A user's own law is given the same problem in space.
//!
//! Symbols as in `strike.rs`.

use super::derivative::{ImpactDerivative, PlaneContact, RowRates, differentiate};
use super::hit::{ChainImpact, in_axes};
use crate::error::SimError;
use crate::state::ROUNDING;
use carom_chain::algebra::Algebra;
use carom_chain::{
    Chain, FramePoint, Keep, Kept, Planar, Point, PointResponse, ResponseMemory, Spatial, Visit, Workspace,
};
use carom_impact::{AnyLaw, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, LawDerivative};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, SMatrix, SVector, Vector2, Vector3};

/// A contact point of a chain with its normal and joint model, checked once: see [`Strike::prepare`](crate::Strike::prepare).
///
/// ```
/// # use carom_chain::uniform_chain;
/// # use carom_impact::Energetic;
/// # use carom_sim::Impacts;
/// let arm = uniform_chain(2, 1.0, 1.0)?;
/// let (q, qd) = ([0.3, 0.7], [-0.5, -1.0]);
/// let mut strike = arm.impact(&q, &qd).at(arm.frame("tip")?).normal([0.0, 1.0, 0.0]).prepare()?;
/// let law = Energetic { restitution: 0.5, friction: 0.3 };
/// let mut hit = strike.outcome();
/// for k in 0..3 {
///     strike.resolve_into(&[0.3, 0.7 + 0.1 * k as f64], &qd, &law, &mut hit)?;
///     assert!(hit.energy_after < hit.energy_before);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PreparedStrike<'a> {
    pub(super) aim: Aim<'a>,
    pub(super) pass: Route<'a>,
}

/// The algebra in which the impacts are computed.
#[derive(Debug, Clone)]
pub(super) enum Route<'a> {
    Plane(Pass<'a, Planar<f64>, OfPlane, 2>),
    Space(Pass<'a, Spatial<f64>, InSpace, 3>),
}

impl<'a> PreparedStrike<'a> {
    pub(super) fn new(aim: Aim<'a>) -> Self {
        let pass = Pass::in_plane(&aim).map_or_else(|| Route::Space(Pass::in_space(&aim)), Route::Plane);
        Self { aim, pass }
    }

    /// The impact with its derivatives, see [`Strike::derivative`](crate::Strike::derivative).
    ///
    /// # Errors
    /// As [`PreparedStrike::resolve_into`]; [`SimError::Impact`] for a user-defined law, which has no derivative;
    /// [`SimError::DerivativeOfHeldJoints`].
    pub fn derivative(&mut self, q: &[f64], qd: &[f64], law: &dyn Law<f64, 3>) -> Result<ImpactDerivative, SimError> {
        if !self.aim.added.is_empty() {
            return Err(SimError::DerivativeOfHeldJoints);
        }
        self.aim.chain.check_v("qd", qd)?;
        match &mut self.pass {
            Route::Plane(pass) => pass.derivative(&self.aim, (q, qd), law),
            Route::Space(pass) => pass.derivative(&self.aim, (q, qd), law),
        }
    }

    /// Checks that every coordinate that the drives do not hold moves mass or inertia at some configuration.
    ///
    /// # Errors
    /// [`SimError::Chain`] with the links that move without mass.
    #[doc(hidden)]
    pub fn check_dynamics(&self) -> Result<(), SimError> {
        Ok(self.aim.chain.check_dynamics_with(&self.aim.added)?)
    }

    /// Memory for one result.
    pub fn outcome(&self) -> ChainImpact {
        ChainImpact::empty(self.aim.chain.nv())
    }

    /// Computes the impact of the chain at `q` (length nq; rad, m, unit quaternion) and `qd` (length nv; rad/s, m/s) with a law,
    /// and writes it to `hit`. Allocates only at the first
    /// call, for chains with mimic joints or more than 48 bodies, and in a nearly singular contact. That the numbers are finite is checked by their effect at the
    /// contact; [`Chain::check_state`](carom_chain::Chain::check_state) checks each of them.
    ///
    /// # Errors
    /// [`SimError::Chain`] for a wrong length or a singular mass matrix; [`SimError::SingularNormal`] or [`SimError::Locked`] if
    /// no (free) joint moves the contact point along the normal; [`SimError::Impact`] for errors of the law, also if its outcome
    /// fails a check; [`SimError::Unbalanced`] if the energy of the chain does not change by the work of the impulse. `hit` is then
    /// unspecified.
    ///
    /// # Panics
    /// If `hit` was made for a chain with another number of velocities.
    pub fn resolve_into(
        &mut self,
        q: &[f64],
        qd: &[f64],
        law: &dyn Law<f64, 3>,
        hit: &mut ChainImpact,
    ) -> Result<(), SimError> {
        let nv = self.aim.chain.nv();
        if qd.len() != nv {
            self.aim.chain.check_v("qd", qd)?;
        }
        assert_eq!(
            hit.qd_plus.len(),
            nv,
            "this result belongs to another chain: make one with PreparedStrike::outcome"
        );
        match &mut self.pass {
            Route::Plane(pass) => pass.resolve_into(&self.aim, q, qd, law, hit),
            Route::Space(pass) => pass.resolve_into(&self.aim, q, qd, law, hit),
        }
    }
}

/// Contact point, normal and joint model, checked.
#[derive(Debug, Clone)]
pub(super) struct Aim<'a> {
    pub chain: &'a Chain,
    pub point: FramePoint,
    /// Contact axes in the world: two tangents, then the normal.
    pub axes: Matrix3<f64>,
    /// Diagonal of W; empty if the drives do not act.
    pub added: Vec<f64>,
}

impl Aim<'_> {
    /// Name of the link that is struck.
    fn link(&self) -> String {
        self.chain.frame_name(self.point.frame).to_owned()
    }

    /// The contact as a plane, for saltation.
    pub fn plane(&self) -> PlaneContact {
        PlaneContact { point: self.point, radius: 0.0, axes: self.axes, motion: None }
    }
}

/// How the contact axes of a pass are placed in space.
pub(super) trait Place<const D: usize>: Sized {
    /// Applies the law to the problem and sets all of the result but energies and drives. `rows` are those of X = M⁻¹Jᵀ. Returns
    /// the impulse in the axes of the chain.
    fn resolve<A: Algebra>(
        &self,
        one: &mut OneImpact<A, Self, D>,
        problem: &ImpactProblem<f64, D>,
        rows: &[SVector<f64, D>],
    ) -> Result<SVector<f64, D>, ImpactError>;
    /// The derivative of a law, and its outcome in the contact axes in space.
    fn differentiate(
        &self,
        law: &dyn Law<f64, 3>,
        problem: &ImpactProblem<f64, D>,
    ) -> Result<(LawDerivative<D>, ImpactOutcome<f64, 3>), ImpactError>;
    /// The components in the contact axes of the pass of a vector in those in space.
    fn project(&self, x: &Vector3<f64>) -> SVector<f64, D>;
}

/// The contact axes are those in space.
#[derive(Debug, Clone, Copy)]
pub(super) struct InSpace;

impl Place<3> for InSpace {
    #[inline(always)]
    fn resolve<A: Algebra>(
        &self,
        one: &mut OneImpact<A, Self, 3>,
        problem: &ImpactProblem<f64, 3>,
        rows: &[Vector3<f64>],
    ) -> Result<Vector3<f64>, ImpactError> {
        let outcome = problem.resolve(one.law)?;
        let impulse = one.jump(rows, &outcome.impulse);
        one.hit.take(outcome, &one.aim.axes);
        Ok(impulse)
    }

    fn differentiate(
        &self,
        law: &dyn Law<f64, 3>,
        problem: &ImpactProblem<f64, 3>,
    ) -> Result<(LawDerivative<3>, ImpactOutcome<f64, 3>), ImpactError> {
        let by = problem.differentiate(law)?;
        Ok((by, by.outcome))
    }

    #[inline(always)]
    fn project(&self, x: &Vector3<f64>) -> Vector3<f64> {
        *x
    }
}

fn known(law: &dyn Law<f64, 3>) -> Result<AnyLaw, ImpactError> {
    law.known().ok_or_else(|| ImpactError::NotDifferentiable { law: law.name(), known: LAW_NAMES.join(", ") })
}

/// A plane through the normal.
#[derive(Debug, Clone, Copy)]
pub(super) struct OfPlane {
    /// Tangent of the plane, unit, in the two tangents in space.
    tangent: Vector2<f64>,
    /// This tangent and the normal in the world.
    axes: Matrix3x2<f64>,
}

impl Place<2> for OfPlane {
    #[inline(always)]
    fn resolve<A: Algebra>(
        &self,
        one: &mut OneImpact<A, Self, 2>,
        problem: &ImpactProblem<f64, 2>,
        rows: &[Vector2<f64>],
    ) -> Result<Vector2<f64>, ImpactError> {
        // The law is not moved: a processor waits where it reads as one what it has just written in parts.
        let known = one.law.known();
        let Some(known) = &known else {
            let outcome = problem.in_space(self.tangent).resolve(one.law)?;
            let impulse = one.jump(rows, &self.project(&outcome.impulse));
            one.hit.take(outcome, &one.aim.axes);
            return Ok(impulse);
        };
        let outcome = known.resolve(problem)?;
        let impulse = one.jump(rows, &outcome.impulse);
        let hit = &mut *one.hit;
        for (x, of) in [
            (&mut hit.impulse, &outcome.impulse),
            (&mut hit.u_minus, &outcome.u_minus),
            (&mut hit.u_plus, &outcome.u_plus),
        ] {
            for i in 0..3 {
                x[i] = self.axes[(i, 0)] * of.x + self.axes[(i, 1)] * of.y;
            }
        }
        (hit.mode, hit.flags) = (outcome.mode, outcome.flags);
        hit.contact = outcome.in_space(self.tangent);
        Ok(impulse)
    }

    fn differentiate(
        &self,
        law: &dyn Law<f64, 3>,
        problem: &ImpactProblem<f64, 2>,
    ) -> Result<(LawDerivative<2>, ImpactOutcome<f64, 3>), ImpactError> {
        let by = problem.differentiate(&known(law)?)?;
        Ok((by, by.outcome.in_space(self.tangent)))
    }

    #[inline(always)]
    fn project(&self, x: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.tangent.x * x.x + self.tangent.y * x.y, x.z)
    }
}

/// The response of a chain at its contact point, and what follows from it.
#[derive(Debug, Clone)]
pub(super) struct Pass<'a, A: Algebra, P, const D: usize> {
    pub chain: &'a Chain<A>,
    pub point: Point<A>,
    /// Contact axes, tangents first, in the axes of the chain.
    pub axes: SMatrix<f64, D, D>,
    pub place: P,
    memory: ResponseMemory<A>,
    /// For chains that the fused pass does not serve: the response is in its memory.
    pub workspace: Option<Box<Workspace<A>>>,
}

impl<'a> Pass<'a, Planar<f64>, OfPlane, 2> {
    /// In the plane, if the chain and the normal are in one.
    pub fn in_plane(aim: &Aim<'a>) -> Option<Self> {
        let normal = aim.axes.column(2).into_owned();
        let flat = aim.chain.in_plane().filter(|flat| flat.plane.normal.dot(&normal).abs() <= ROUNDING)?;
        let normal = flat.plane.project(normal);
        let tangent = Vector2::new(-normal.y, normal.x);
        let along = flat.plane.lift(tangent);
        let axes = Matrix3x2::from_columns(&[along, aim.axes.column(2).into_owned()]);
        let place = OfPlane { tangent: aim.axes.tr_mul(&along).xy(), axes };
        let point = flat.point(aim.point.frame, aim.point.offset);
        Some(Self::new(&flat.chain, point, Matrix2::from_columns(&[tangent, normal]), place))
    }
}

impl<'a> Pass<'a, Spatial<f64>, InSpace, 3> {
    pub fn in_space(aim: &Aim<'a>) -> Self {
        Self::new(aim.chain, aim.chain.point(aim.point.frame, aim.point.offset), aim.axes, InSpace)
    }
}

impl<'a, A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> Pass<'a, A, P, D> {
    fn new(chain: &'a Chain<A>, point: Point<A>, axes: SMatrix<f64, D, D>, place: P) -> Self {
        let workspace = (!chain.has_fused_pass()).then(|| Box::new(chain.workspace()));
        Self { chain, point, axes, place, memory: ResponseMemory::default(), workspace }
    }

    pub fn normal(&self) -> SVector<f64, D> {
        self.axes.column(D - 1).into_owned()
    }

    /// Computes the impact of state (q, qd) and writes it to `hit`.
    pub fn resolve_into(
        &mut self,
        aim: &Aim,
        q: &[f64],
        qd: &[f64],
        law: &dyn Law<f64, 3>,
        hit: &mut ChainImpact,
    ) -> Result<(), SimError> {
        let normal = self.normal();
        let Self { chain, point, axes, place, memory, workspace } = self;
        let mut one = OneImpact { aim, chain, axes, place, q, qd, law, hit, done: Ok(()) };
        match workspace {
            None => chain.contact_point(*point)?.visit(q, normal, &aim.added, memory, &mut one)?,
            Some(workspace) => {
                let mut kin = workspace.update(chain, q)?;
                (&mut one).visit(kin.contact(*point, normal, &aim.added)?);
            }
        }
        one.done?;
        if self.workspace.is_some() {
            self.account(aim, (q, qd), hit)?;
        }
        Ok(())
    }

    /// Computes the response at `q` into the memory, and the impact problem.
    pub fn problem(&mut self, aim: &Aim, (q, qd): (&[f64], &[f64])) -> Result<ImpactProblem<f64, D>, SimError> {
        let normal = self.normal();
        let Self { chain, point, memory, workspace, .. } = self;
        match workspace {
            None => chain.contact_point(*point)?.visit(q, normal, &aim.added, memory, Keep)?,
            Some(workspace) => {
                workspace.update(chain, q)?.contact(*point, normal, &aim.added)?;
            }
        }
        problem(&self.response(), aim, self.chain, &self.axes, (q, qd))
    }

    /// The response of the last evaluation into the memory.
    pub fn response(&self) -> PointResponse<'_, A> {
        self.workspace.as_ref().map_or_else(|| self.memory.response(), |workspace| workspace.contact())
    }

    /// The impact with its derivatives. No drives act.
    pub fn derivative(
        &mut self,
        aim: &Aim,
        (q, qd): (&[f64], &[f64]),
        law: &dyn Law<f64, 3>,
    ) -> Result<ImpactDerivative, SimError> {
        let problem = self.problem(aim, (q, qd))?;
        let (law, outcome) = self.place.differentiate(law, &problem)?;
        let in_axes = |of: &[SVector<f64, D>]| of.iter().map(|x| self.axes.tr_mul(x)).collect::<Vec<_>>();
        let (rows, response) = (in_axes(self.response().jacobian), in_axes(self.response().response));
        let mut workspace = self.chain.workspace();
        let mut kin = workspace.update(self.chain, q)?;
        let rates = RowRates::of_point(&kin, (self.point, SVector::zeros()), &self.axes, qd.len());
        let by = differentiate(&mut kin, qd, (&rows, &rates), &response, &law, |_, _| {})?;
        let mut hit = ChainImpact::empty(qd.len());
        self.carry(aim, (q, qd), outcome, &mut hit)?;
        Ok(ImpactDerivative { hit, q: by.q, qd: by.qd, restitution: by.restitution, friction: by.friction })
    }

    /// Writes the result of an outcome at the state of the response.
    pub fn carry(
        &mut self,
        aim: &Aim,
        (q, qd): (&[f64], &[f64]),
        outcome: ImpactOutcome<f64, 3>,
        hit: &mut ChainImpact,
    ) -> Result<(), SimError> {
        hit.take(outcome, &aim.axes);
        let impulse = self.axes * self.place.project(&hit.contact.impulse);
        hit.jump(self.response().response, &impulse, qd);
        self.account(aim, (q, qd), hit)
    }

    /// Energies and drives of `hit`, which holds the joint velocities after the impact.
    fn account(&mut self, aim: &Aim, (q, qd): (&[f64], &[f64]), hit: &mut ChainImpact) -> Result<(), SimError> {
        let impulse = self.axes * self.place.project(&hit.contact.impulse);
        if !self.response().mass_matrix.is_empty() {
            hit.account(&self.response(), &aim.added, &impulse, qd);
            return hit.check(&self.response(), &impulse, qd, || aim.link());
        }
        let Self { chain, workspace, .. } = self;
        let Some(workspace) = workspace else { return Ok(()) };
        let jacobian = workspace.contact().jacobian.to_vec();
        let mut kin = workspace.update(chain, q)?;
        (hit.energy_before, hit.energy_after) = (kin.kinetic_energy(qd)?, kin.kinetic_energy(&hit.qd_plus)?);
        if !aim.added.is_empty() {
            let jump: Vec<f64> = hit.qd_plus.iter().zip(qd).map(|(after, before)| after - before).collect();
            // M Δq̇: inverse dynamics at rest without gravity.
            let momentum = kin.inverse_dynamics(&vec![0.0; qd.len()], &jump, A::zero())?;
            hit.drive(&aim.added, qd, |k, _| momentum[k] - jacobian[k].dot(&impulse));
        }
        hit.check(&self.response(), &impulse, qd, || aim.link())
    }
}

/// The sum of the columns times the entries of x: their product, without a call.
#[inline(always)]
fn combine<const D: usize>(columns: &SMatrix<f64, D, D>, x: &SVector<f64, D>) -> SVector<f64, D> {
    (1..D).fold(columns.column(0) * x[0], |sum, k| sum + columns.column(k) * x[k])
}

/// H and u of a contact in contact axes.
#[inline(always)]
pub(super) fn problem<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
    response: &PointResponse<A>,
    aim: &Aim,
    chain: &Chain<A>,
    axes: &SMatrix<f64, D, D>,
    (q, qd): (&[f64], &[f64]),
) -> Result<ImpactProblem<f64, D>, SimError> {
    if response.is_doubtful() {
        check_inertia(chain, q, &aim.added)?;
    }
    if !response.moves() {
        let (link, normal) = (aim.link(), aim.axes.column(2).into_owned());
        return Err(if aim.added.iter().any(|w| w.is_infinite()) {
            SimError::Locked { link, normal }
        } else {
            SimError::SingularNormal { link, normal }
        });
    }
    let delassus = SMatrix::<f64, D, D>::from_fn(|i, k| response.delassus[k][i]);
    let along: [_; D] = std::array::from_fn(|k| combine(&delassus, &axes.column(k).into_owned()));
    let mut delassus = SMatrix::<f64, D, D>::from_fn(|i, k| axes.column(i).dot(&along[k]));
    let velocity = response.velocity(qd);
    let mut u = SVector::<f64, D>::from_fn(|i, _| axes.column(i).dot(&velocity));
    if !response.is_regular(&delassus) {
        (delassus, u) = in_axes(response, axes, qd);
    }
    Ok(ImpactProblem::from_gram(delassus, u)?)
}

#[cold]
fn check_inertia<A: Algebra<Scalar = f64>>(chain: &Chain<A>, q: &[f64], added: &[f64]) -> Result<(), SimError> {
    Ok(chain.workspace().update(chain, q)?.check_inertia(added)?)
}

/// One impact, computed while the response is in registers.
pub(super) struct OneImpact<'s, A: Algebra, P, const D: usize> {
    pub aim: &'s Aim<'s>,
    pub chain: &'s Chain<A>,
    pub axes: &'s SMatrix<f64, D, D>,
    pub place: &'s P,
    pub q: &'s [f64],
    pub qd: &'s [f64],
    pub law: &'s dyn Law<f64, 3>,
    pub hit: &'s mut ChainImpact,
    pub done: Result<(), SimError>,
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> Visit<A>
    for &mut OneImpact<'_, A, P, D>
{
    const KEEPS: Kept = Kept::Nothing;
    #[inline(always)]
    fn visit(&mut self, response: PointResponse<A>) {
        if let Err(error) = self.resolve(&response) {
            self.done = Err(error);
        }
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> OneImpact<'_, A, P, D> {
    #[inline(always)]
    pub fn resolve(&mut self, response: &PointResponse<A>) -> Result<(), SimError> {
        // A slice of the length of the response, so that loops are unrolled where the compiler knows this length.
        let qd = &self.qd[..response.response.len()];
        let problem = problem(response, self.aim, self.chain, self.axes, (self.q, qd))?;
        let impulse = self.place.resolve(self, &problem, response.response)?;
        if response.mass_matrix.is_empty() {
            return Ok(()); // the caller has the energies of recursions
        }
        self.hit.account(response, &self.aim.added, &impulse, qd);
        self.hit.check(response, &impulse, qd, || self.aim.link())
    }
}

impl<A: Algebra, P, const D: usize> OneImpact<'_, A, P, D> {
    /// Sets q̇⁺ from the impulse in contact axes, which is returned in the axes of the chain. Called before the rest of the result
    /// is written, so that q̇⁺ has reached the memory when the energies are computed from it.
    #[inline(always)]
    fn jump(&mut self, rows: &[SVector<f64, D>], impulse: &SVector<f64, D>) -> SVector<f64, D> {
        let impulse = combine(self.axes, impulse);
        self.hit.jump(rows, &impulse, self.qd);
        impulse
    }
}

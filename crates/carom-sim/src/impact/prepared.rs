//! A strike whose contact point, normal and joint model have been checked: it computes impacts of many states without
//! allocation.
//!
//! Symbols as in `strike.rs`.

use super::derivative::PlaneContact;
use super::hit::ChainImpact;
use crate::error::SimError;
use carom_chain::algebra::z_onto;
use carom_chain::{Chain, FrameId, Keep, Kept, Point, PointResponse, ResponseMemory, Spatial, Visit, Workspace};
use carom_impact::{ImpactProblem, Law};
use nalgebra::{Matrix3, Vector3};

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
    pub(super) chain: &'a Chain,
    pub(super) frame: FrameId,
    offset: Vector3<f64>,
    point: Point<Spatial<f64>>,
    normal: Vector3<f64>,
    /// Contact axes in the world: two tangents, then the normal.
    pub(super) axes: Matrix3<f64>,
    /// Whether the joint model locks joints.
    locks: bool,
    /// Diagonal of W; empty if the drives do not act.
    pub(super) added: Vec<f64>,
    memory: ResponseMemory<Spatial<f64>>,
    /// For chains that the fused pass does not serve: the response is in its memory.
    workspace: Option<Box<Workspace<Spatial<f64>>>>,
}

impl<'a> PreparedStrike<'a> {
    pub(super) fn new(
        chain: &'a Chain,
        (frame, offset): (FrameId, Vector3<f64>),
        normal: Vector3<f64>,
        added: Vec<f64>,
        locks: bool,
    ) -> Self {
        let point = chain.point(frame, offset);
        let workspace = (!chain.has_fused_pass()).then(|| Box::new(chain.workspace()));
        let (axes, memory) = (z_onto(normal), ResponseMemory::default());
        Self { chain, frame, offset, point, normal, axes, locks, added, memory, workspace }
    }

    /// Memory for one result.
    pub fn outcome(&self) -> ChainImpact {
        ChainImpact::empty(self.chain.nv())
    }

    /// Computes the impact of the chain at `q` (length nq; rad, m, unit quaternion) and `qd` (length nv; rad/s, m/s) with a law,
    /// and writes it to `hit`. Allocates only at the first
    /// call, and for chains with mimic joints or more than 48 bodies. That the numbers are finite is checked by their effect at the
    /// contact; [`Chain::check_state`] checks each of them.
    ///
    /// # Errors
    /// [`SimError::Chain`] for a wrong length or a singular mass matrix; [`SimError::SingularNormal`] or [`SimError::Locked`] if
    /// no (free) joint moves the contact point along the normal; [`SimError::Impact`] for errors of the law. `hit` is then
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
        self.check(qd, hit)?;
        let Self { chain, point, normal, axes, locks, added, memory, workspace, .. } = self;
        let link = (*chain, self.frame, *normal, *locks);
        let mut blow = Blow { link, axes, added, q, qd, law, hit, done: Ok(()) };
        match workspace {
            None => chain.contact_point(*point)?.visit(q, *normal, added, memory, &mut blow)?,
            Some(workspace) => {
                let mut kin = workspace.update(chain, q)?;
                (&mut blow).visit(kin.contact(*point, *normal, added)?);
            }
        }
        blow.done?;
        if self.workspace.is_some() {
            self.account(q, qd, hit)?;
        }
        Ok(())
    }

    fn check(&self, qd: &[f64], hit: &ChainImpact) -> Result<(), SimError> {
        let nv = self.chain.nv();
        if qd.len() != nv {
            self.chain.check_v("qd", qd)?;
        }
        assert_eq!(
            hit.qd_plus.len(),
            nv,
            "this result belongs to another chain: make one with PreparedStrike::outcome"
        );
        Ok(())
    }

    /// Computes the response at `q` into the memory, and the impact problem.
    pub(super) fn problem(&mut self, q: &[f64], qd: &[f64]) -> Result<ImpactProblem<f64, 3>, SimError> {
        let Self { chain, point, normal, added, memory, workspace, .. } = self;
        match workspace {
            None => chain.contact_point(*point)?.visit(q, *normal, added, memory, Keep)?,
            Some(workspace) => {
                workspace.update(chain, q)?.contact(*point, *normal, added)?;
            }
        }
        let link = (self.chain, self.frame, self.normal, self.locks);
        problem(&self.response(), link, &self.axes, &self.added, (q, qd))
    }

    /// The response of the last evaluation into the memory.
    pub(super) fn response(&self) -> PointResponse<'_, Spatial<f64>> {
        self.workspace.as_ref().map_or_else(|| self.memory.response(), |workspace| workspace.contact())
    }

    /// The contact as a plane, for derivatives.
    pub(super) fn plane(&self) -> PlaneContact {
        let Self { frame, offset, axes, .. } = *self;
        PlaneContact { frame, offset, radius: 0.0, axes, motion: None }
    }

    /// Completes `hit`, which holds the joint velocities after the impact, for a response that does not contain M.
    pub(super) fn account(&mut self, q: &[f64], qd: &[f64], hit: &mut ChainImpact) -> Result<(), SimError> {
        if !self.response().mass_matrix.is_empty() {
            account(&self.response(), &self.added, qd, hit);
            return Ok(());
        }
        let Self { chain, added, workspace, .. } = self;
        let Some(workspace) = workspace else { return Ok(()) };
        let nv = qd.len();
        let jacobian = workspace.contact().jacobian.to_vec();
        let mut kin = workspace.update(chain, q)?;
        (hit.energy_before, hit.energy_after) = (kin.kinetic_energy(qd)?, kin.kinetic_energy(&hit.qd_plus)?);
        if !added.is_empty() {
            let jump: Vec<f64> = hit.qd_plus.iter().zip(qd).map(|(after, before)| after - before).collect();
            // M Δq̇: inverse dynamics at rest without gravity.
            let momentum = kin.inverse_dynamics(&vec![0.0; nv], &jump, Vector3::zeros())?;
            drive(hit, added, qd, &jacobian, |k, _| momentum[k]);
        }
        Ok(())
    }
}

/// H and u of a contact in contact axes.
#[inline(always)]
fn problem(
    response: &PointResponse<Spatial<f64>>,
    (chain, frame, normal, locks): (&Chain, FrameId, Vector3<f64>, bool),
    axes: &Matrix3<f64>,
    added: &[f64],
    (q, qd): (&[f64], &[f64]),
) -> Result<ImpactProblem<f64, 3>, SimError> {
    if response.is_doubtful() {
        check_inertia(chain, q, added)?;
    }
    if !response.moves() {
        let (link, normal) = (chain.frame_name(frame).to_owned(), normal.into());
        return Err(if locks { SimError::Locked { link, normal } } else { SimError::SingularNormal { link, normal } });
    }
    let delassus = Matrix3::from_columns(&response.delassus);
    let (mut delassus, mut u) = (axes.transpose() * delassus * axes, axes.transpose() * response.velocity(qd));
    // Along a singular tangent J, and with it u, is rounding. An entry that is not small needs no second look.
    let small = delassus.trace() * f64::EPSILON;
    for k in 0..2 {
        if delassus[(k, k)] <= small && !response.moves_along(axes.column(k).into_owned()) {
            delassus.row_mut(k).fill(0.0);
            delassus.column_mut(k).fill(0.0);
            u[k] = 0.0;
        }
    }
    Ok(ImpactProblem::from_gram(delassus, u)?)
}

#[cold]
fn check_inertia(chain: &Chain, q: &[f64], added: &[f64]) -> Result<(), SimError> {
    Ok(chain.workspace().update(chain, q)?.check_inertia(added)?)
}

/// Energies and drives, for a response that contains M.
#[inline(always)]
fn account(response: &PointResponse<Spatial<f64>>, added: &[f64], qd: &[f64], hit: &mut ChainImpact) {
    hit.energy_before = response.kinetic_energy(qd);
    hit.energy_after = response.kinetic_energy(&hit.qd_plus);
    if !added.is_empty() {
        let nv = qd.len();
        let row = |k: usize, after: &[f64]| {
            let column = &response.mass_matrix[k * nv..][..nv];
            column.iter().zip(after.iter().zip(qd)).map(|(m, (after, before))| m * (after - before)).sum()
        };
        drive(hit, added, qd, response.jacobian, row);
    }
}

/// Impulse and work of the drives; `momentum` is M Δq̇ by coordinate and q̇⁺. The impulse of a locked joint follows from M Δq̇ = Jᵀp + j.
fn drive(
    hit: &mut ChainImpact,
    added: &[f64],
    qd: &[f64],
    jacobian: &[Vector3<f64>],
    momentum: impl Fn(usize, &[f64]) -> f64,
) {
    hit.drive_work = 0.0;
    for (k, w) in added.iter().enumerate() {
        let jump = hit.qd_plus[k] - qd[k];
        hit.drive_impulse[k] =
            if w.is_finite() { -w * jump } else { momentum(k, &hit.qd_plus) - jacobian[k].dot(&hit.impulse) };
        hit.drive_work += 0.5 * hit.drive_impulse[k] * (qd[k] + hit.qd_plus[k]);
    }
}

/// One impact, computed while the response is in registers.
struct Blow<'s> {
    link: (&'s Chain, FrameId, Vector3<f64>, bool),
    axes: &'s Matrix3<f64>,
    added: &'s [f64],
    q: &'s [f64],
    qd: &'s [f64],
    law: &'s dyn Law<f64, 3>,
    hit: &'s mut ChainImpact,
    done: Result<(), SimError>,
}

impl Visit<Spatial<f64>> for &mut Blow<'_> {
    const KEEPS: Kept = Kept::Nothing;
    #[inline(always)]
    fn visit(&mut self, response: PointResponse<Spatial<f64>>) {
        self.done = self.resolve(&response);
    }
}

impl Blow<'_> {
    #[inline(always)]
    fn resolve(&mut self, response: &PointResponse<Spatial<f64>>) -> Result<(), SimError> {
        let problem = problem(response, self.link, self.axes, self.added, (self.q, self.qd))?;
        let outcome = self.law.resolve(&problem)?;
        self.hit.carry(outcome, self.axes, response.response.iter(), self.qd);
        if !response.mass_matrix.is_empty() {
            account(response, self.added, self.qd, self.hit);
        }
        Ok(())
    }
}

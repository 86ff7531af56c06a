//! The result of an impact of a chain: `qd⁺ = qd⁻ + M⁻¹ Jᵀ p`, energies, and the impulse of the drives.
//!
//! Symbols as in `strike.rs`.

use crate::error::SimError;
use crate::state::{EQUAL, EXACT, NOTICED, written};
use carom_chain::PointResponse;
use carom_chain::algebra::Algebra;
use carom_impact::{Flags, ImpactOutcome, Mode};
use nalgebra::{Matrix3, MatrixXx3, SMatrix, SVector, Vector3};
use serde::{Serialize, Serializer};

/// The result of an impact of a chain. Serde writes what happens at the contact point; numbers by joint are written beside it, in the
/// order of joints that is wanted there.
#[derive(Debug, Clone, Serialize)]
pub struct ChainImpact {
    /// Joint velocities after the impact, length nv; rad/s, m/s.
    #[serde(skip)]
    pub qd_plus: Vec<f64>,
    /// Impulse on the robot, world axes, N s.
    #[serde(serialize_with = "written::vector")]
    pub impulse: Vector3<f64>,
    /// Velocity of the contact point before, world axes, m/s.
    #[serde(serialize_with = "written::vector")]
    pub u_minus: Vector3<f64>,
    /// Velocity of the contact point after, world axes, m/s.
    #[serde(serialize_with = "written::vector")]
    pub u_plus: Vector3<f64>,
    /// Kinetic energy of the whole chain before, J.
    pub energy_before: f64,
    /// Kinetic energy of the whole chain after, J, from `qd_plus`: `energy_before + ½ p·(u⁻ + u⁺) + drive_work`.
    pub energy_after: f64,
    /// Impulse of the drives on each joint, length nv, N m s or N s; zeros with [`JointModel::Free`](crate::JointModel::Free).
    #[serde(skip)]
    pub drive_impulse: Vec<f64>,
    /// Work of that impulse, J.
    #[serde(skip)]
    pub drive_work: f64,
    /// Contact mode at the end of the impact: no impact, stick, slip or reverse slip.
    #[serde(serialize_with = "written::mode")]
    pub mode: Mode,
    /// The outcome of the law in contact axes: work, realised coefficients, phases. Its energies include the inertia W of the
    /// drives. Serde writes the works.
    #[serde(flatten, serialize_with = "works")]
    pub contact: ImpactOutcome<f64, 3>,
    /// Notes about the result, for instance an energy gain.
    #[serde(serialize_with = "written::flags")]
    pub flags: Flags,
}

fn works<S: Serializer>(of: &ImpactOutcome<f64, 3>, to: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Works {
        normal_work: f64,
        friction_work: f64,
    }
    Works { normal_work: of.normal_work, friction_work: of.friction_work }.serialize(to)
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

    /// An impact of a chain without motion, as memory for the result.
    pub(crate) fn empty(nv: usize) -> Self {
        let zero = Vector3::zeros();
        Self {
            qd_plus: vec![0.0; nv],
            impulse: zero,
            u_minus: zero,
            u_plus: zero,
            energy_before: 0.0,
            energy_after: 0.0,
            drive_impulse: vec![0.0; nv],
            drive_work: 0.0,
            mode: Mode::Open,
            flags: Flags::default(),
            contact: ImpactOutcome::default(),
        }
    }

    /// All but energies and drives from the outcome of a law, where `response` is X = M⁻¹Jᵀ in world axes.
    pub(crate) fn of_outcome(
        outcome: ImpactOutcome<f64, 3>,
        axes: &Matrix3<f64>,
        response: &MatrixXx3<f64>,
        qd: &[f64],
    ) -> Box<Self> {
        let mut hit = Box::new(Self::empty(qd.len()));
        hit.take(outcome, axes);
        for ((after, before), row) in hit.qd_plus.iter_mut().zip(qd).zip(response.row_iter()) {
            *after = before + row.transpose().dot(&hit.impulse);
        }
        hit
    }

    /// Sets impulse, contact velocities, mode and flags from the outcome of a law in contact axes.
    #[inline(always)]
    pub(super) fn take(&mut self, outcome: ImpactOutcome<f64, 3>, axes: &Matrix3<f64>) {
        self.impulse = axes * outcome.impulse;
        (self.u_minus, self.u_plus) = (axes * outcome.u_minus, axes * outcome.u_plus);
        (self.mode, self.flags, self.contact) = (outcome.mode, outcome.flags, outcome);
    }

    /// qd⁺ = qd⁻ + X p, for the rows of X = M⁻¹Jᵀ and p in the same axes.
    #[inline(always)]
    pub(super) fn jump<const D: usize>(&mut self, rows: &[SVector<f64, D>], impulse: &SVector<f64, D>, qd: &[f64]) {
        let n = rows.len();
        let (after, before) = (&mut self.qd_plus[..n], &qd[..n]);
        for i in 0..n {
            after[i] = before[i] + rows[i].dot(impulse);
        }
    }

    /// Sets energies and drives from a response that contains M, and the impulse in its axes. `added`: the diagonal of W, by
    /// coordinate; empty if the drives do not act.
    #[inline(always)]
    pub(super) fn account<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &mut self,
        response: &PointResponse<A>,
        added: &[f64],
        impulse: &SVector<f64, D>,
        qd: &[f64],
    ) {
        self.energy_before = response.kinetic_energy(qd);
        self.energy_after = response.kinetic_energy(&self.qd_plus[..qd.len()]);
        if !added.is_empty() {
            let nv = qd.len();
            self.drive(added, qd, |k, after| {
                let column = &response.mass_matrix[k * nv..][..nv];
                let momentum: f64 =
                    column.iter().zip(after.iter().zip(qd)).map(|(m, (after, before))| m * (after - before)).sum();
                momentum - response.jacobian[k].dot(impulse)
            });
        }
    }

    /// Whether T⁺ − T⁻ is the work of impulse and drives to 1e-9 of T⁻. `false` for numbers that are not finite.
    #[inline(always)]
    fn is_balanced(&self) -> bool {
        let (change, work) = self.balance();
        (change - work).abs() <= EQUAL * self.energy_before
    }

    /// T⁺ − T⁻, and the work of impulse and drives.
    #[inline(always)]
    fn balance(&self) -> (f64, f64) {
        (self.energy_after - self.energy_before, self.contact.energy_change + self.drive_work)
    }

    /// Checks energies, which are those of M and q̇, against the work, which is that of p and u: that u⁺ is J q̇⁺ along p.
    /// `impulse` in the axes of the response.
    ///
    /// # Errors
    /// [`SimError::Unbalanced`].
    #[inline(always)]
    pub(super) fn check<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &self,
        response: &PointResponse<A>,
        impulse: &SVector<f64, D>,
        qd: &[f64],
        link: impl Fn() -> String,
    ) -> Result<(), SimError> {
        if self.is_balanced() { Ok(()) } else { self.check_terms(response, impulse, qd, link) }
    }

    /// [`Self::check`] with the rounding of the terms of the energies.
    #[cold]
    #[inline(never)]
    fn check_terms<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        &self,
        response: &PointResponse<A>,
        impulse: &SVector<f64, D>,
        qd: &[f64],
        link: impl Fn() -> String,
    ) -> Result<(), SimError> {
        let push = impulse.abs();
        let jumps = response.response.iter().map(|row| row.abs().dot(&push));
        let rates: Vec<f64> = jumps.zip(qd).map(|(jump, before)| jump + before.abs()).collect();
        let pushed = response.jacobian.iter().zip(&rates).map(|(column, rate)| column.abs().dot(&push) * rate);
        // −W Δq̇ of a stiff drive has the rounding of q̇, times W.
        let jumps = self.qd_plus.iter().zip(qd).map(|(after, before)| (after - before).abs());
        let size = |((impulse, rate), jump): ((&f64, &f64), f64)| {
            impulse.abs() * (if jump > 0.0 { rate / jump } else { 1.0 }) * rate
        };
        let drives = self.drive_impulse.iter().zip(&rates).zip(jumps).map(size);
        let momenta = response
            .mass_matrix
            .chunks_exact(rates.len().max(1))
            .zip(&rates)
            .map(|(column, rate)| column.iter().zip(&rates).map(|(m, other)| m.abs() * other).sum::<f64>() * rate);
        // Without M the energies are sums of squares of bodies, whose velocities are those that the impulse changes.
        let terms = self.energy_before + self.energy_after + pushed.chain(drives).chain(momenta).sum::<f64>();
        // Where rounding could take a larger share of T⁻, velocities are not known.
        let allowed = EQUAL * self.energy_before + (EXACT * terms).min(NOTICED * self.energy_before);
        let (found, expected) = self.balance();
        let holds = (found - expected).abs() <= allowed; // false for NaN too
        if holds { Ok(()) } else { Err(SimError::Unbalanced { link: link(), found, expected, allowed }) }
    }

    /// Sets impulse and work of the drives; `locked` is the impulse of a locked joint, which follows from M Δq̇ = Jᵀp + j, by
    /// coordinate and q̇⁺.
    pub(super) fn drive(&mut self, added: &[f64], qd: &[f64], locked: impl Fn(usize, &[f64]) -> f64) {
        self.drive_work = 0.0;
        for (k, w) in added.iter().enumerate() {
            let jump = self.qd_plus[k] - qd[k];
            self.drive_impulse[k] = if w.is_finite() { -w * jump } else { locked(k, &self.qd_plus) };
            self.drive_work += 0.5 * self.drive_impulse[k] * (qd[k] + self.qd_plus[k]);
        }
    }
}

/// H and u from columns in the contact axes: with the rank that the joints give H, and exact zeros along axes in which no joint
/// moves the point.
#[cold]
pub(super) fn in_axes<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
    response: &PointResponse<A>,
    axes: &SMatrix<f64, D, D>,
    qd: &[f64],
) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
    let axes: [SVector<f64, D>; D] = std::array::from_fn(|k| axes.column(k).into_owned());
    let delassus = response.delassus_in(axes);
    let u = SVector::from_fn(|i, _| {
        let along = response.jacobian.iter().zip(qd).map(|(column, rate)| column.dot(&axes[i]) * rate);
        if delassus[(i, i)] > 0.0 { along.sum::<f64>() } else { 0.0 }
    });
    (delassus, u)
}

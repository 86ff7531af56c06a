//! The energetic law for several contacts: impulses are distributed along the impact by stiffness and stored energy.

mod extrapolation;
mod motion;

use nalgebra::{DMatrix, DVector};

use super::sequential::Reduced;
use super::solve::Found;
use super::{Accuracy, Constraint, SeveralOutcome, SeveralProblem};
use crate::laws::refuse;
use crate::rounding::RANK;
use crate::{Flags, ImpactError};
use motion::{Motion, Pressed};

/// Steps of the integration are this much more accurate than the outcome: the energies of some dozens of steps add up their errors.
const FINER: f64 = 0.01;

/// What [`SeveralProblem::energetic`] knows of the contacts beside their coefficients of restitution: the normal force k δ^η
/// over the penetration δ. Only the ratios of the stiffnesses k matter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stiffnesses<'a> {
    /// η, 1 to 10: 1 for flat contacts (linear springs), 1.5 for round bodies (Hertz).
    pub exponent: f64,
    /// k of each constraint, relative to one another, > 0; those of `Dry` and `Held` are not used. Empty: all equal.
    pub ratios: &'a [f64],
}

impl Default for Stiffnesses<'_> {
    /// Equal stiffnesses of round bodies, η = 1.5.
    fn default() -> Self {
        Self { exponent: 1.5, ratios: &[] }
    }
}

impl Stiffnesses<'_> {
    fn check(&self, constraints: usize) -> Result<(), ImpactError> {
        let refuse = |what, value, rule| Err(ImpactError::Compliance { what, value, rule });
        if !(1.0..=10.0).contains(&self.exponent) {
            let rule = "the exponent of the normal force lies between 1 (linear springs) and 10: 1.5 for round bodies";
            return refuse("exponent", self.exponent, rule);
        }
        if !self.ratios.is_empty() && self.ratios.len() != constraints {
            let found = self.ratios.len();
            let rule = "give one for each, or none if all are equal";
            return Err(ImpactError::Sizes(format!("{found} stiffnesses for {constraints} constraints: {rule}")));
        }
        match self.ratios.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
            Some(&value) => {
                refuse("stiffness", value, "it must be positive and finite: only ratios matter, give 1 to all")
            }
            None => Ok(()),
        }
    }
}

/// Outcome of [`SeveralProblem::energetic`].
#[derive(Debug, Clone, PartialEq)]
pub struct EnergeticOutcome {
    /// Impulses and velocities. `iterations` are the steps of the integration, `residual` the larger of the error of the energy
    /// balance, as a share of the energy stored, and the remaining approach velocity, as a share of the initial one.
    pub total: SeveralOutcome,
    /// Energy that each constraint stored during the impact, all its compressions together (J); it returned e² times as much.
    pub stored: DVector<f64>,
    /// Number of compressions of each constraint; more than 1 if it was compressed again.
    pub compressions: Vec<usize>,
}

impl SeveralProblem {
    /// The energetic law for several contacts (Liu, Zhao and Brogliato), without friction: during the impact the normal
    /// impulses grow in the ratios of the contact forces, which stiffness and stored energy give.
    ///
    /// | Symbol | Meaning | Our name |
    /// |---|---|---|
    /// | kᵢ, η | normal force kᵢ δᵢ^η (only ratios of k matter) | `ratios`, `exponent` |
    /// | δᵢ, Eᵢ | penetration, and the energy stored, `kᵢ δᵢ^(η+1)/(η+1)` | |
    /// | Pᵢ | normal impulse so far; u = u⁻ + H P | |
    /// | eᵢ | energetic coefficient of restitution | `restitution` |
    ///
    /// ```text
    /// dPᵢ/dPⱼ = (kᵢ/kⱼ)^(1/(η+1)) (Eᵢ/Eⱼ)^(η/(η+1))
    /// dEᵢ = -u_n,i dPᵢ          while u_n,i < 0: the contact stores energy
    /// dEᵢ = -u_n,i dPᵢ / eᵢ²    while u_n,i > 0: it returns eᵢ² of what it stored
    /// end     all Eᵢ = 0 and no contact approaches
    /// ```
    ///
    /// A contact may be compressed again, before or after its energy is returned. All compressions together obey the
    /// energetic constraint: work returned = e² × work stored.
    ///
    /// **Start.** All E are zero at first, where the ratios are undefined. In the variables δ and P, with a parameter τ
    /// for which dPᵢ = Fᵢ dτ, the same equations are
    ///
    /// ```text
    /// dPᵢ/dτ = kᵢ max(δᵢ, 0)^η,    dδᵢ/dτ = -u_n,i  (loading or open),  -u_n,i / eᵢ²  (unloading)
    /// ```
    ///
    /// They are regular at the start, where δ = 0 and P = 0, and have one solution: δᵢ = |u⁻_n,i| τ for a contact that
    /// approaches, so that the impulses start in the ratios `kᵢ |u⁻_n,i|^η : kⱼ |u⁻_n,j|^η`; a contact that begins at rest is
    /// compressed by the impulses of the others, with a higher power of τ (τ^(η+2) for the second contact of a
    /// cradle). There is no primary contact to choose, nor to change when its energy is spent. A negative δ is a gap, small as
    /// the penetrations are: a contact that has separated closes again only when its gap has closed.
    ///
    /// **Parameters.** e of each contact, √(work returned/work stored); the ratios of stiffnesses and η in `stiffnesses`.
    ///
    /// **Guarantee.** Energy is never gained, whatever the coefficients: the loss is Σ (1 - eᵢ²) × energy stored. With e = 1 the
    /// outcome is the limit of elastic contacts for k → ∞. The solution exists and is unique for every H in which the
    /// approaching contacts can be stopped, singular ones too: redundant contacts share the impulse by their stiffnesses. For one
    /// contact it is [`Energetic`](crate::Energetic) without friction. The integration is accurate to about 1e-11 of the
    /// velocities.
    ///
    /// `Held` constraints hold throughout. Dry friction and forces (`u_free - u_minus`) have no part in the impact; they act
    /// after it, as an inelastic problem without rebound, solved by Moreau's law.
    ///
    /// **Fails**, with an error, if contacts with e = 1 on both sides of a body pass it to and fro for ever, and for
    /// stiffnesses so different that the stiffer contact bounces more often than 30 000 steps resolve.
    ///
    /// **Source.** C. Liu, Z. Zhao, B. Brogliato, *Frictionless multiple impacts in multibody systems*, Proc. R. Soc. A 464 (2008)
    /// 3193 and 465 (2009) 1. The parameter τ, the gaps of separated contacts and the rules for held constraints,
    /// dry friction and forces are ours.
    ///
    /// # Errors
    ///
    /// - [`ImpactError::Constraint`]: a contact has friction.
    /// - [`ImpactError::Compliance`], [`ImpactError::Sizes`]: invalid `stiffnesses`.
    /// - [`ImpactError::SingularNormal`]: a contact approaches whose velocity no impulse changes.
    /// - [`ImpactError::Endless`]: the impact does not end.
    ///
    /// ```
    /// use carom_impact::{Accuracy, Constraint, SeveralProblem, Stiffnesses};
    /// use nalgebra::{dmatrix, dvector};
    ///
    /// // Newton's cradle: three round balls of 1 kg, the first strikes at 1 m/s, the others touch at rest.
    /// let between = Constraint::Stop { restitution: 1.0 };
    /// let cradle = SeveralProblem::new(dmatrix![2.0, -1.0; -1.0, 2.0], dvector![-1.0, 0.0], vec![between; 2])?;
    /// let hit = cradle.energetic(&Stiffnesses::default(), &Accuracy::default())?.total;
    /// let balls = [1.0 - hit.impulse[0], hit.impulse[0] - hit.impulse[1], hit.impulse[1]]; // m/s
    /// assert!((balls[0] + 0.070952).abs() < 1e-6 && (balls[2] - 0.994549).abs() < 1e-6);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn energetic(&self, stiffnesses: &Stiffnesses, accuracy: &Accuracy) -> Result<EnergeticOutcome, ImpactError> {
        stiffnesses.check(self.constraints.len())?;
        for (index, constraint) in self.constraints.iter().enumerate() {
            if let Constraint::Contact { friction, .. } = *constraint
                && friction > 0.0
            {
                let rule = "has no part in the energetic law for several contacts: give 0, or choose the law of Moreau, of Glocker and \
                            Pfeiffer, or sequential impacts";
                refuse("friction", friction, rule)
                    .map_err(|reason| ImpactError::Constraint { index, reason: Box::new(reason) })?;
            }
        }
        let impact = Self { u_free: self.u_minus.clone(), ..self.clone() };
        let mut outcome = impact.press(stiffnesses, accuracy)?;
        let pushed = self.u_free != self.u_minus;
        let rubbed = self.constraints.iter().any(|one| matches!(one, Constraint::Dry { bound } if *bound > 0.0));
        if pushed || rubbed {
            let after = Self { u_free: &self.u_free + &self.delassus * &outcome.total.impulse, ..self.inelastic(1.0) };
            let rest = after.simultaneous(accuracy, None)?;
            let total = &mut outcome.total;
            total.impulse += rest.impulse;
            total.u_plus = rest.u_plus;
            total.residual = total.residual.max(rest.residual);
            total.iterations += rest.iterations;
            (total.energy_change, total.flags) = self.energy(&total.impulse, &total.u_plus, total.residual);
        }
        Ok(outcome)
    }

    /// The impact without forces and dry friction.
    fn press(&self, stiffnesses: &Stiffnesses, accuracy: &Accuracy) -> Result<EnergeticOutcome, ImpactError> {
        let reduced = Reduced::new(self);
        let (h, u) = (&reduced.delassus, &reduced.u_free);
        let normal = |row: usize, constraint: &Constraint| match constraint {
            Constraint::Contact { .. } => Some(row + 2),
            Constraint::Stop { .. } => Some(row),
            Constraint::Dry { .. } | Constraint::Held => None,
        };
        let contacts: Vec<(usize, usize)> =
            self.rows().enumerate().filter_map(|(k, (row, constraint))| Some((k, normal(row, constraint)?))).collect();
        let speed = contacts.iter().fold(0.0_f64, |most, &(_, row)| most.max(-u[row]));
        let largest = contacts.iter().fold(0.0_f64, |most, &(_, row)| most.max(h[(row, row)]));
        let mut pressed = Vec::new();
        for &(k, row) in &contacts {
            if h[(row, row)] > RANK * RANK * largest {
                pressed.push((k, row));
            } else if u[row] < -RANK.sqrt() * self.u_minus.amax() {
                return Err(ImpactError::SingularNormal { inverse_mass: h[(row, row)], trace: self.delassus.trace() });
            }
        }
        let mut impulse = DVector::zeros(u.len());
        let mut stored = DVector::zeros(self.constraints.len());
        let mut compressions = vec![0; self.constraints.len()];
        let (mut steps, mut residual) = (0, 0.0);
        if speed > 0.0 && !pressed.is_empty() {
            let stiffness = |k: usize| stiffnesses.ratios.get(k).copied().unwrap_or(1.0);
            let stiffest = pressed.iter().fold(0.0_f64, |most, &(k, _)| most.max(stiffness(k)));
            let rows: Vec<usize> = pressed.iter().map(|&(_, row)| row).collect();
            let motion = Motion {
                delassus: DMatrix::from_fn(rows.len(), rows.len(), |i, j| h[(rows[i], rows[j])] / largest),
                u_minus: DVector::from_fn(rows.len(), |i, _| u[rows[i]] / speed),
                stiffness: pressed.iter().map(|&(k, _)| stiffness(k) / stiffest).collect(),
                restitution: pressed.iter().map(|&(k, _)| self.constraints[k].restitution()).collect(),
                exponent: stiffnesses.exponent,
            };
            let end = motion.run(FINER * accuracy.tolerance)?;
            steps = end.steps;
            for (&(k, row), (p, Pressed { stored: own, compressions: times })) in
                pressed.iter().zip(end.impulse.iter().zip(end.contacts))
            {
                impulse[row] = p * speed / largest;
                stored[k] = own * speed * speed / largest;
                compressions[k] = times;
            }
            let change = 0.5 * impulse.dot(&(u * 2.0 + h * &impulse));
            let lost = |k: usize| stored[k] * (1.0 - self.constraints[k].restitution().powi(2));
            let lost: f64 = (0..stored.len()).map(lost).sum();
            let after = u + h * &impulse;
            let left = pressed.iter().fold(0.0_f64, |most, &(_, row)| most.max(-after[row]));
            residual = ((change + lost).abs() / stored.sum().max(f64::MIN_POSITIVE)).max(left / speed);
        }
        let mut total = self.outcome(Found { impulse: reduced.with_held(impulse), residual, iterations: steps });
        total.flags |= Flags::NO_APPROACH.when(speed <= 0.0);
        Ok(EnergeticOutcome { total, stored, compressions })
    }
}

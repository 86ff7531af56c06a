//! Whether the motion with several contacts is unique.
//!
//! Two kinds of contacts leave it open:
//!
//! - **Redundant contacts that slide.** The constraints leave a change of their forces free, and with it friction, so the
//!   accelerations depend on the convention by which forces are distributed (`held.rs`): a spinning box, corners with different
//!   friction. The criterion is that of [`undetermined`]: K ν = 0 with Fᵀν ≠ 0. It is examined only where rows are redundant.
//! - **Several consistent modes** of the complementarity problem (`select.rs`). They need forces that balance each other inside
//!   their friction cones, as those of a block wedged between two walls, or a contact whose own force pulls the bodies together
//!   (Painlevé): n H n < μ |H_tn|. Where one of both is possible the problem is solved again from zero forces and from large ones,
//!   and the accelerations are compared.
//!
//! That no forces balance each other, K λ = 0, is certified by a velocity v = M⁻¹Rᵀc with F v > 0 for all rays of the cones, for a
//! contact at rest n·u > μ |t·u|: then cᵀK λ = λᵀF v > 0 (Gordan's theorem). Rosenblatt's perceptron finds it in a few steps where
//! contacts push to one side, as those of a body that lies on a floor.

use super::active_set::{Hold, Lasting};
use super::assembled::Assembled;
use super::rows::{Contact, push};
use super::select::{ACCURACY, Solution};
use super::smooth::Motion;
use crate::error::SimError;
use crate::state::{Basis, CLEAR, EQUAL, STEPS, Space};
use carom_impact::{Flags, SeveralProblem, undetermined};
use nalgebra::DVector;

/// Why the motion is not unique.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NonUnique {
    /// It depends on how forces are distributed over redundant contacts, of which some slide.
    Distribution,
    /// Several modes of the contacts are consistent, with different accelerations.
    Modes,
}

impl NonUnique {
    /// The reason in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Distribution => "the motion depends on the distribution of forces over redundant contacts",
            Self::Modes => "several modes of the contacts are consistent",
        }
    }
}

impl Assembled {
    /// For each rigid contact whether its force is not determined, and the motion depends on it.
    pub fn undetermined(&self) -> Vec<bool> {
        let constraints = &self.constraints;
        let none = vec![false; constraints.contacts.len()];
        // Rows whose own responses were not needed are independent.
        if constraints.skewed.is_empty() || self.own_responses.is_empty() {
            return none;
        }
        if Basis::of(&self.gram()).rows.len() == constraints.rows.len() {
            return none;
        }
        let forces = undetermined(&self.delassus(), &constraints.forces.times(&self.responses));
        constraints.contacts.iter().map(|contact| forces[contact.rows.clone()].contains(&true)).collect()
    }
}

impl<A: Space> Motion<'_, A> {
    /// The flags of the lasting contacts in the present mode, in their order, after [`Motion::accelerations`].
    pub fn flags(&self) -> Vec<Flags> {
        let mut rigid = self.assembled.undetermined().into_iter();
        let flag = |own: &Lasting| {
            let open = own.is_rigid() && rigid.next().unwrap_or_default();
            if open { Flags::NON_UNIQUE } else { Flags::NONE }
        };
        self.active.lasting.iter().map(flag).collect()
    }

    /// The touches whose forces leave the motion open in the present mode, with the reason.
    pub fn open(&mut self, time: f64, y: &[f64]) -> Result<Option<(NonUnique, Vec<usize>)>, SimError> {
        if let Some(touches) = &self.other_mode {
            return Ok(Some((NonUnique::Modes, touches.clone())));
        }
        if self.active.lasting.iter().filter(|own| own.is_rigid()).count() < 2 {
            return Ok(None);
        }
        match self.accelerations(time, y) {
            Err(SimError::Jam { .. }) => return Ok(None),
            held => held?,
        };
        let flags = self.flags();
        let open = self.active.lasting.iter().zip(&flags).filter(|(_, flags)| flags.contains(Flags::NON_UNIQUE));
        let touches: Vec<usize> = open.map(|(own, _)| own.touch).collect();
        Ok((!touches.is_empty()).then_some((NonUnique::Distribution, touches)))
    }

    /// Whether the complementarity problem has a solution with other accelerations than these.
    pub(super) fn has_other_mode(
        &self,
        problem: &SeveralProblem,
        found: &Assembled,
        solution: &Solution,
    ) -> Result<bool, SimError> {
        if !self.may_have_other_modes(found) {
            return Ok(false);
        }
        // Along the forces, too: the weight of a block between walls does not act along their normals.
        let Assembled { constraints, free, .. } = found;
        let terms = |row: &[f64]| row.iter().zip(free.iter()).map(|(r, a)| (r * a).abs()).sum::<f64>();
        let largest = constraints.forces.iter().map(terms).fold(solution.scale[0], f64::max);
        let mobility = found.delassus().diagonal().amax().max(f64::MIN_POSITIVE);
        let force = solution.scale[1].max(largest / mobility);
        let mut squeezed = DVector::zeros(solution.force.len());
        for contact in &found.constraints.contacts {
            squeezed[contact.rows.end - 1] = force / CLEAR.sqrt();
        }
        for start in [DVector::zeros(solution.force.len()), squeezed] {
            let other = problem.simultaneous(&ACCURACY, Some(&start))?;
            if other.residual > EQUAL {
                continue;
            }
            let mut change = DVector::<f64>::zeros(found.free.len());
            push(change.as_mut_slice(), &found.responses, (other.impulse - &solution.force).as_slice());
            if found.constraints.rows.iter().chain(found.constraints.forces.iter()).any(|row| {
                let a: f64 = row.iter().zip(change.iter()).map(|(r, a)| r * a).sum();
                a.abs() > CLEAR * largest
            }) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn may_have_other_modes(&self, found: &Assembled) -> bool {
        let contacts = &found.constraints.contacts;
        let touch = |contact: &Contact| &self.sim.touches[contact.own.touch];
        let mu = |contact: &Contact| touch(contact).contact.law.friction();
        if contacts.iter().all(|contact| mu(contact) == 0.0 || touch(contact).link().is_none()) {
            return false;
        }
        let k = found.delassus();
        let pulls = contacts.iter().any(|contact| {
            let n = contact.rows.end - 1;
            let across = k.view((contact.rows.start, n), (contact.rows.len() - 1, 1)).norm();
            contact.own.hold != Hold::Latched && k[(n, n)] <= mu(contact) * across
        });
        pulls || (found.constraints.rows.len() > 1 && contacts.len() > 1 && !self.push_to_one_side(found))
    }

    /// Whether a velocity certifies that no forces of these contacts balance each other.
    fn push_to_one_side(&self, found: &Assembled) -> bool {
        let constraints = &found.constraints;
        if !constraints.joints.is_empty() || constraints.contacts.iter().any(|it| it.own.hold == Hold::Latched) {
            return false;
        }
        let (gram, forces) = (found.gram(), constraints.forces.times(found.own()));
        let m = gram.nrows();
        // v = M⁻¹Rᵀ c; u = F v.
        let mut u = DVector::<f64>::zeros(m);
        let mut c = DVector::<f64>::zeros(m);
        for _ in 0..STEPS {
            let size = c.dot(&(&gram * &c)).max(0.0).sqrt();
            // The contact that is farthest outside, with the ray of its cone that shows it.
            let mut worst: Option<(f64, DVector<f64>)> = None;
            for contact in &constraints.contacts {
                let (first, n) = (contact.rows.start, contact.rows.end - 1);
                let mut ray = DVector::zeros(m);
                ray[n] = 1.0;
                let slip = u.rows(first, n - first).norm();
                if n > first && slip > 0.0 {
                    let mu = self.sim.touches[contact.own.touch].contact.law.friction();
                    (first..n).for_each(|row| ray[row] = -mu * u[row] / slip);
                }
                let length = ray.dot(&(&gram * &ray)).max(f64::MIN_POSITIVE).sqrt();
                let inside = ray.dot(&u) / length;
                if worst.as_ref().is_none_or(|(least, _)| inside < *least) {
                    worst = Some((inside, ray / length));
                }
            }
            let Some((inside, ray)) = worst else { return false };
            if inside > EQUAL * size && size > 0.0 {
                return true;
            }
            u += &forces * &ray;
            c += ray;
        }
        false
    }
}

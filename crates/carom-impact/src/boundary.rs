//! Boundaries between the modes of an impact, and the normalised distance of a problem to each of them (margin).
//!
//! On a boundary two quantities a and b are equal. The margin is `|a - b|/(|a| + |b|)`: 0 on the boundary, at most 1,
//! and independent of units.

use std::fmt;

use nalgebra::SVector;

use crate::contact::{Contact, length};
use crate::derivative::known;
use crate::laws::Family;
use crate::{ImpactError, ImpactOutcome, ImpactProblem, Law, Mode, Phase};

/// The condition that holds on a boundary between two modes, in the order of an impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Edge {
    /// `u_n⁻ = 0`: the contact does not approach. The margin is `|u_n⁻|/|u⁻|`.
    NoApproach,
    /// `u_t⁻ = 0`: the contact does not slip before the impact. The margin is `|u_t⁻|/|u⁻|`.
    NoSlip,
    /// Slip stops as compression ends: `p₁ = p_c`.
    StopsAtTurn,
    /// Slip stops as the impact ends: `p₁ = P_n`. If slip does not stop, p₁ is extrapolated with the rate of slip at
    /// the end.
    StopsAtEnd,
    /// Friction is just large enough to keep a contact sticking after its slip has stopped: `μ = μ_stick`.
    JustHolds,
    /// Friction just jams while the contact slips: `μ u·h = C`, in the plane `μ = μ_jam`. The flag `jam` changes there;
    /// the outcome is smooth.
    Jams,
    /// The impulse of sticking is on the friction cone. Whittaker's law: if the contact sticks, its `|P_t|` is compared
    /// with `μ P_n`; if it slips, the margin is `|u_t⁺|/(|u_t⁺| + |u⁻|)`. Chatterjee & Ruina's law: inside the cone
    /// `|P_t|` is compared with `μ P_n`; on the cone, with the tangential impulse that the tangential restitution
    /// prescribes.
    OnCone,
    /// The prescribed impulse ratio is the largest admissible one (Brach's law).
    Clipped,
}

impl Edge {
    /// Kebab-case name.
    ///
    /// ```
    /// # use carom_impact::Edge;
    /// assert_eq!(Edge::StopsAtEnd.name(), "stops-at-end");
    /// ```
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoApproach => "no-approach",
            Self::NoSlip => "no-slip",
            Self::StopsAtTurn => "stops-at-turn",
            Self::StopsAtEnd => "stops-at-end",
            Self::JustHolds => "just-holds",
            Self::Jams => "jams",
            Self::OnCone => "on-cone",
            Self::Clipped => "clipped",
        }
    }
}

impl fmt::Display for Edge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A boundary of the mode of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boundary {
    /// The condition that holds on it.
    pub edge: Edge,
    /// The mode on the other side. It may be the same mode: then slip stops in another phase, or only a flag or a
    /// derivative changes.
    pub beyond: Mode,
    /// Normalised distance, 0 to 1: `|a - b|/(|a| + |b|)` of the two quantities that [`Edge`] names.
    pub margin: f64,
}

/// `|a - b|/(|a| + |b|)`.
fn apart(a: f64, b: f64) -> f64 {
    let sum = a.abs() + b.abs();
    if sum > 0.0 { (a - b).abs() / sum } else { 0.0 }
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// The boundaries of the mode of this problem under a law, in ascending order of their margins; empty if the
    /// contact does not approach.
    ///
    /// ```
    /// # use carom_impact::{Edge, Energetic, ImpactProblem, Mode};
    /// # use nalgebra::{matrix, vector};
    /// // A rod at 45°: μ_stick is 0.6, so the margin of μ = 0.61 is 0.01/1.21.
    /// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0, -1.0])?;
    /// let nearest = problem.boundaries(&Energetic { restitution: 0.5, friction: 0.61 })?[0];
    /// assert_eq!((nearest.edge, nearest.beyond), (Edge::JustHolds, Mode::ReverseSlip));
    /// assert!((nearest.margin - 0.01 / 1.21).abs() < 1e-12);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Law::resolve`]; [`ImpactError::NotDifferentiable`] for a user-defined law.
    pub fn boundaries(&self, law: &dyn Law<f64, D>) -> Result<Vec<Boundary>, ImpactError> {
        let outcome = law.resolve(self)?;
        let law = known(law)?;
        if outcome.mode == Mode::Open {
            return Ok(Vec::new());
        }
        let contact = Contact::of(self);
        let mu = law.coefficients().friction;
        let (slip, speed) = (length(&contact.slip), self.u_minus().norm());
        let mut found =
            vec![Boundary { edge: Edge::NoApproach, beyond: Mode::Open, margin: (contact.v_n / speed).abs() }];
        let mut add = |edge, beyond, margin| found.push(Boundary { edge, beyond, margin });
        if mu > 0.0 && D > 1 {
            add(Edge::NoSlip, across_rest(outcome.mode), slip / speed);
            match law.family(self) {
                Family::Path(_) => self.along_the_slip(&contact, mu, &outcome, &mut add),
                Family::Cone(tangential) => {
                    let tangential_size = |x: &SVector<f64, D>| x.rows(0, D - 1).norm();
                    let (along, p_n) = (tangential_size(&outcome.impulse), outcome.impulse[D - 1]);
                    let end = tangential_size(&outcome.u_plus);
                    match tangential {
                        None if outcome.mode == Mode::Stick => add(Edge::OnCone, Mode::Slip, apart(along, mu * p_n)),
                        None => add(Edge::OnCone, Mode::Stick, end / (end + speed)),
                        Some(e_t) => {
                            let smooth = -contact.v_n / contact.normal;
                            let free = contact.slip + contact.coupling * smooth;
                            let stop = length(&contact.at_held_normal().least_solution(&free));
                            let (asked, given) = ((1.0 + e_t) * stop, along);
                            let inside = given >= asked * (1.0 - 1e-12);
                            // Inside the cone the impulse is compared with the cone, on it with the prescribed one.
                            let margin = if inside { apart(along, mu * p_n) } else { apart(asked, given) };
                            add(Edge::OnCone, outcome.mode, margin);
                        }
                    }
                }
                Family::Ratio(brach) => {
                    let (asked, bound) = brach.asked_and_bound(self);
                    add(Edge::Clipped, outcome.mode, apart(asked, bound));
                }
                Family::Frictionless | Family::Mean => {}
            }
        }
        found.sort_by(|a, b| a.margin.total_cmp(&b.margin));
        Ok(found)
    }

    /// The boundaries of the laws that follow the slip (Newton, Poisson, Stronge).
    fn along_the_slip(
        &self,
        contact: &Contact<f64>,
        mu: f64,
        outcome: &ImpactOutcome<f64, D>,
        add: &mut dyn FnMut(Edge, Mode, f64),
    ) {
        let end = outcome.impulse[D - 1];
        let turn = end / (1.0 + outcome.poisson.unwrap_or(0.0));
        let mu_stick = length(&contact.mobility().least_solution(&contact.coupling));
        let slips = length(&contact.slip) > 0.0;
        // The mode after slip has stopped, and the one if μ were on the other side of μ_stick.
        let (then, other) =
            if mu >= mu_stick { (Mode::Stick, Mode::ReverseSlip) } else { (Mode::ReverseSlip, Mode::Stick) };
        if let Some(stop) = outcome.slip_stop {
            add(Edge::StopsAtTurn, outcome.mode, apart(stop, turn));
            if outcome.slip_end == Some(Phase::Restitution) {
                add(Edge::StopsAtEnd, Mode::Slip, apart(stop, end));
            }
        } else if slips {
            // Extrapolated with the rate at the end.
            let v_t = nalgebra::Vector2::from_fn(|i, _| if i < D - 1 { outcome.u_plus[i] } else { 0.0 });
            let speed = length(&v_t);
            // In the plane the direction is the initial one; that of a slip about to stop may be rounding.
            let u = if speed > 0.0 && D > 2 { v_t / speed } else { contact.slip / length(&contact.slip) };
            let rate = u.dot(&(contact.coupling - contact.tangents * u * mu));
            if rate < 0.0 {
                add(Edge::StopsAtEnd, then, apart(end - speed / rate, end));
            }
        }
        if outcome.slip_stop.is_some() || !slips {
            let slides = if slips {
                other
            } else if outcome.mode == Mode::Stick {
                Mode::Slip
            } else {
                Mode::Stick
            };
            add(Edge::JustHolds, slides, apart(mu, mu_stick));
        }
        let along = if slips { contact.slip.dot(&contact.coupling) / length(&contact.slip) } else { 0.0 };
        if along > 0.0 {
            add(Edge::Jams, outcome.mode, apart(mu * along, contact.normal));
        }
    }
}

/// The mode if the initial slip had the other direction.
fn across_rest(mode: Mode) -> Mode {
    match mode {
        Mode::Slip => Mode::ReverseSlip,
        Mode::ReverseSlip => Mode::Slip,
        other => other,
    }
}

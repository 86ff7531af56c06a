//! How far a problem is from where its impact changes its mode.
//!
//! All distances are of two quantities a and b that are equal on the boundary, measured as `|a - b|/(|a| + |b|)`: from 0
//! on the boundary to 1 as far as can be, whatever the units.

use std::fmt;

use nalgebra::SVector;

use crate::contact::{Contact, length};
use crate::derivative::known;
use crate::{ImpactError, ImpactOutcome, ImpactProblem, Law, Mode, Phase};

/// What happens on a boundary between two modes. In the order of an impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Edge {
    /// `u_n⁻ = 0`: no approach. Compared are `|u_n⁻|` and zero, beside `|u⁻|`.
    NoApproach,
    /// `u_t⁻ = 0`: no slip. Compared are `|u_t⁻|` and zero, beside `|u⁻|`.
    NoSlip,
    /// Slip stops as compression ends: `p₁ = p_c`.
    StopsAtTurn,
    /// Slip stops as the contact parts: `p₁ = P_n`. Where slip goes on, p₁ is where it would stop at its last rate.
    StopsAtEnd,
    /// Friction just holds a contact whose slip has stopped: `μ = μ_stick`.
    JustHolds,
    /// Friction just drives the slipping contact deeper: `μ = μ_jam`. A change of flag; nothing has a kink there.
    Jams,
    /// The impulse that sticks is on the friction cone: its `|P_t|` and `μ P_n` (Whittaker's law); the tangential restitution
    /// asked for and what the cone leaves of it (Chatterjee & Ruina's).
    OnCone,
    /// The impulse ratio asked for is the largest admissible one (Brach's law).
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

/// A boundary of the mode that a problem is in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boundary {
    /// What happens there.
    pub edge: Edge,
    /// The mode beyond, which may bear the same name: slip may stop in another phase.
    pub beyond: Mode,
    /// How far it is, 0 … 1: `|a - b|/(|a| + |b|)` of the two quantities that [`Edge`] names.
    pub margin: f64,
}

/// `|a - b|/(|a| + |b|)`.
fn apart(a: f64, b: f64) -> f64 {
    let sum = a.abs() + b.abs();
    if sum > 0.0 { (a - b).abs() / sum } else { 0.0 }
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// The boundaries of the mode in which a law answers, the nearest first; empty without approach.
    ///
    /// ```
    /// # use carom_impact::{Edge, Energetic, ImpactProblem, Mode};
    /// # use nalgebra::{matrix, vector};
    /// // A rod at 45°: friction of 0.6 is what just holds it, 0.61 is 0.01/1.21 above.
    /// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0, -1.0])?;
    /// let nearest = problem.boundaries(&Energetic { restitution: 0.5, friction: 0.61 })?[0];
    /// assert_eq!((nearest.edge, nearest.beyond), (Edge::JustHolds, Mode::ReverseSlip));
    /// assert!((nearest.margin - 0.01 / 1.21).abs() < 1e-12);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// What the law refuses; [`ImpactError::NotDifferentiable`] for a law from elsewhere.
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
            if law.follows_slip() {
                self.along_the_slip(&contact, mu, &outcome, &mut add);
            }
            if let Some(tangential) = law.cone() {
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
                        // Within the cone the impulse is compared with the cone, on it with what was asked for.
                        let margin = if inside { apart(along, mu * p_n) } else { apart(asked, given) };
                        add(Edge::OnCone, outcome.mode, margin);
                    }
                }
            }
            if let Some((asked, bound)) = law.brach_ratios(self) {
                add(Edge::Clipped, outcome.mode, apart(asked, bound));
            }
        }
        found.sort_by(|a, b| a.margin.total_cmp(&b.margin));
        Ok(found)
    }

    /// The boundaries of laws that follow the slip.
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
        // What follows a stop.
        let (then, other) =
            if mu >= mu_stick { (Mode::Stick, Mode::ReverseSlip) } else { (Mode::ReverseSlip, Mode::Stick) };
        if let Some(stop) = outcome.slip_stop {
            add(Edge::StopsAtTurn, outcome.mode, apart(stop, turn));
            if outcome.slip_end == Some(Phase::Restitution) {
                add(Edge::StopsAtEnd, Mode::Slip, apart(stop, end));
            }
        } else if slips {
            // Slip goes on at this rate.
            let v_t = nalgebra::Vector2::from_fn(|i, _| if i < D - 1 { outcome.u_plus[i] } else { 0.0 });
            let speed = length(&v_t);
            // In the plane the direction is that of before, whatever rounding leaves of a slip about to stop.
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

/// The name that a mode has when the first slip is in the other direction.
fn across_rest(mode: Mode) -> Mode {
    match mode {
        Mode::Slip => Mode::ReverseSlip,
        Mode::ReverseSlip => Mode::Slip,
        other => other,
    }
}

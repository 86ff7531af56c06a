//! Bands: bounds of the outcome while e and μ lie in ranges.
//!
//! The outputs (u⁺, qd⁺) are linear in the impulse P, so a band is the range of c·P(e, μ) over a box in (e, μ).
//!
//! **Exact** where monotonicity is proved. In the plane, under a law that follows the slip:
//!
//! - *In e.* The path of the impulse does not depend on e; only its end does, and it advances along the path as e
//!   grows. For each μ, c·P therefore has its extremes at the ends of the range of e, or at the corner of the path
//!   where slip stops.
//! - *In μ.* Slip s, with `p_1 = -v_t/(B - μ s A)` and `p_c = -v_n/(C - μ s B)`, changes its class where `p_1 = k p_c`
//!   (`k = 1`, `1 + e`: linear in μ) and at μ_stick. On each interval between, with `z = 1/(B - μ s A)`:
//!
//! | class | c·P | so |
//! |---|---|---|
//! | slip never stops; the corner | linear fractional in μ | monotone |
//! | then sticks, from compression on: Newton, Poisson | affine in z | monotone |
//! | the same: Stronge | affine in z + root of a quadratic in z | convex or concave in z |
//! | then sticks, from restitution on: Newton | affine in z | monotone |
//! | the same: Poisson | affine in z + linear fractional in z | convex or concave in z |
//! | then sticks, from restitution on: Stronge; slips back | – | not proved: sampled |
//!
//! A convex or concave interval has one extreme inside if the derivative has different signs at its ends. Without
//! friction P is affine in e. Chatterjee & Ruina's P is monotone in μ and piecewise affine in e with one kink, in space
//! too.
//!
//! **Sampled** in all other cases: in the plane along the edges of the box, by the sign of the derivative at some
//! points of each interval; in space and for the remaining laws on a grid. A sampled band may be too narrow;
//! [`Band::exact`] is then `false`.

use nalgebra::SVector;

use crate::contact::{Contact, length};
use crate::derivative::known;
use crate::laws::{AnyLaw, Family};
use crate::plane::SlipPlane;
use crate::roots::bisect;
use crate::routh::Ending;
use crate::{Coefficients, ImpactError, ImpactProblem, Law, Mode, Phase};

/// Points at which the derivative is evaluated on an interval without a proof.
const LOOKS: usize = 24;

/// Halvings of an interval around an extreme, at which the output is flat.
const HALVINGS: usize = 48;

/// Points along each side of the grid.
const GRID: usize = 25;

/// Ranges of the coefficients: lowest and highest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoefficientRanges {
    /// Range of the coefficient of restitution, as the law defines it.
    pub restitution: [f64; 2],
    /// Range of the coefficient of friction.
    pub friction: [f64; 2],
}

/// Bounds of quantities that are linear in the impulse.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// The lowest value of each quantity.
    pub low: Vec<f64>,
    /// The highest value of each quantity.
    pub high: Vec<f64>,
    /// Whether the bounds are proved, up to rounding. `false`: sampled, and possibly too narrow.
    pub exact: bool,
    /// Number of impacts resolved.
    pub evaluations: usize,
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// Bounds of c·P for each c of `outputs` while e and μ lie in their ranges (N s times the unit of c).
    ///
    /// The restitution and friction of `law` itself are not used; its tangential restitution is.
    ///
    /// ```
    /// # use carom_impact::{CoefficientRanges, Energetic, ImpactProblem};
    /// # use nalgebra::{matrix, vector};
    /// // A rod at 45°, dropped vertically, with μ > μ_stick: it sticks, and P_n = (1 + e) |v_n| A/det H.
    /// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![0.0, -1.0])?;
    /// let ranges = CoefficientRanges { restitution: [0.3, 0.5], friction: [0.7, 0.9] };
    /// let band = problem.band(&Energetic { restitution: 0.4, friction: 0.8 }, &ranges, &[vector![0.0, 1.0]])?;
    /// assert!(band.exact && (band.low[0] - 1.3 * 0.625).abs() < 1e-15 && (band.high[0] - 1.5 * 0.625).abs() < 1e-15);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    ///
    /// # Errors
    /// [`ImpactError::Range`] for a range that is not in ascending order; the errors of [`Law::resolve`] at any point
    /// of the ranges that is evaluated; [`ImpactError::NotDifferentiable`] for a user-defined law.
    pub fn band(
        &self,
        law: &dyn Law<f64, D>,
        ranges: &CoefficientRanges,
        outputs: &[SVector<f64, D>],
    ) -> Result<Band, ImpactError> {
        let law = known(law)?;
        let CoefficientRanges { restitution, friction } = *ranges;
        for (what, [low, high]) in [("restitution", restitution), ("friction", friction)] {
            if low.is_nan() || high.is_nan() || low > high {
                return Err(ImpactError::Range { what, low, high });
            }
        }
        let mut search = Search {
            problem: self,
            law,
            outputs,
            band: Band {
                low: vec![f64::INFINITY; outputs.len()],
                high: vec![f64::NEG_INFINITY; outputs.len()],
                exact: true,
                evaluations: 0,
            },
        };
        for e in restitution {
            for mu in friction {
                search.visit(e, mu)?;
            }
        }
        if self.approach_speed() <= 0.0 || friction == [0.0; 2] {
            return Ok(search.band);
        }
        match (law.family(self), SlipPlane::of(self)) {
            (Family::Frictionless, _) => {}
            (Family::Cone(Some(tangential)), _) => search.cone(tangential, restitution, friction)?,
            (Family::Path(path), Some(plane)) => search.path(&plane.contact, path.ending, restitution, friction)?,
            _ => search.grid(restitution, friction)?,
        }
        Ok(search.band)
    }
}

struct Search<'a, const D: usize> {
    problem: &'a ImpactProblem<f64, D>,
    law: AnyLaw,
    outputs: &'a [SVector<f64, D>],
    band: Band,
}

impl<const D: usize> Search<'_, D> {
    fn law(&self, e: f64, mu: f64) -> AnyLaw {
        self.law.with(Coefficients { restitution: e, friction: mu, ..self.law.coefficients() })
    }

    /// Extends the band by the outcome at (e, μ).
    fn visit(&mut self, e: f64, mu: f64) -> Result<(), ImpactError> {
        let impulse = self.law(e, mu).resolve(self.problem)?.impulse;
        self.band.evaluations += 1;
        for ((c, low), high) in self.outputs.iter().zip(&mut self.band.low).zip(&mut self.band.high) {
            let value = c.dot(&impulse);
            (*low, *high) = (low.min(value), high.max(value));
        }
        Ok(())
    }

    /// ∂P/∂μ.
    fn slope(&mut self, e: f64, mu: f64) -> Result<SVector<f64, D>, ImpactError> {
        self.band.evaluations += 1;
        Ok(self.problem.differentiate(&self.law(e, mu))?.friction)
    }

    /// Chatterjee & Ruina: the kinks in e, on both edges in μ.
    fn cone(&mut self, tangential: f64, [e_low, e_high]: [f64; 2], friction: [f64; 2]) -> Result<(), ImpactError> {
        let contact = Contact::of(self.problem);
        let smooth = -contact.v_n / contact.normal;
        let slip = contact.slip + contact.coupling * smooth;
        let stop = -contact.at_held_normal().least_solution(&slip);
        let lift = -contact.coupling.dot(&stop) / contact.normal;
        for mu in friction {
            // On the cone κ = μ (1 + e) smooth/(|stop| − μ lift); in it κ = 1 + e_t.
            let e = (1.0 + tangential) * (length(&stop) - mu * lift) / (mu * smooth) - 1.0;
            if e > e_low && e < e_high {
                self.visit(e, mu)?;
            }
        }
        Ok(())
    }

    /// Laws that follow the slip, in the plane.
    fn path(
        &mut self,
        plane: &ImpactProblem<f64, 2>,
        ending: Ending,
        restitution: [f64; 2],
        [mu_low, mu_high]: [f64; 2],
    ) -> Result<(), ImpactError> {
        let ((a, b, c), (v_t, v_n)) = (plane.abc(), plane.velocity());
        let s = if v_t == 0.0 { b.signum() } else { v_t.signum() };
        let (speed, drop) = (v_t.abs(), v_n.abs());
        let mu_stick = plane.mu_stick();
        // p₁ = k p_c
        let stops_at = |k: f64| (speed * c + k * drop * s * b) / (k * drop * a + speed * s * b);
        let [e_low, e_high] = restitution;
        for e in [e_low, e_high] {
            let mut cuts = vec![mu_low, mu_high, mu_stick, s * b / a, stops_at(1.0), stops_at(1.0 + e)];
            cuts.retain(|mu| *mu >= mu_low && *mu <= mu_high);
            cuts.sort_by(f64::total_cmp);
            for pair in cuts.windows(2) {
                self.visit(e, pair[1])?;
                if pair[1] - pair[0] > 1e-12 * pair[1] {
                    self.stretch(ending, e, [pair[0], pair[1]])?;
                }
            }
        }
        // The corner of the path, if it is an outcome within the ranges.
        for mu in [mu_low, mu_high] {
            let (stop, turn) = (speed / (mu * a - s * b), drop / (c - mu * s * b));
            let e = stop / turn - 1.0;
            if stop > 0.0 && turn > 0.0 && e > e_low && e < e_high {
                self.visit(e, mu)?;
            }
        }
        Ok(())
    }

    /// The extremes in μ within one class.
    fn stretch(&mut self, ending: Ending, e: f64, [low, high]: [f64; 2]) -> Result<(), ImpactError> {
        let middle = self.law(e, 0.5 * (low + high)).resolve(self.problem)?;
        let stops_early = middle.slip_end == Some(Phase::Compression);
        let (monotone, bent) = match middle.mode {
            // Without slip before, nothing depends on μ while the contact sticks.
            Mode::Slip => (true, true),
            Mode::Stick if middle.slip_end.is_none() => (true, true),
            Mode::Stick => {
                // The outcomes of Newton's and Poisson's law contain no square root.
                let rational = ending != Ending::Work;
                (ending == Ending::Velocity || (stops_early && rational), stops_early || rational)
            }
            _ => (false, false),
        };
        if monotone {
            return Ok(());
        }
        self.band.exact &= bent;
        let looks = if bent { 1 } else { LOOKS };
        // Just inside, where the derivative is that of this class.
        let inset = 1e-9 * (high - low);
        let at = |k: usize| low + inset + (high - low - 2.0 * inset) * k as f64 / looks as f64;
        let mut before = self.slope(e, at(0))?;
        for k in 1..=looks {
            let after = self.slope(e, at(k))?;
            for i in 0..self.outputs.len() {
                let output = self.outputs[i];
                let (first, last) = (output.dot(&before), output.dot(&after));
                if first * last < 0.0 {
                    let mut refused = Ok(());
                    let turns = |mu: f64| match self.slope(e, mu) {
                        Ok(slope) => output.dot(&slope) * first <= 0.0,
                        Err(why) => {
                            refused = Err(why);
                            true
                        }
                    };
                    let extreme = bisect(at(k - 1), at(k), HALVINGS, turns);
                    refused?;
                    self.visit(e, extreme)?;
                }
            }
            before = after;
            self.visit(e, at(k))?;
        }
        Ok(())
    }

    fn grid(&mut self, [e_low, e_high]: [f64; 2], [mu_low, mu_high]: [f64; 2]) -> Result<(), ImpactError> {
        self.band.exact = false;
        let share = |k: usize| k as f64 / (GRID - 1) as f64;
        for i in 0..GRID {
            for j in 0..GRID {
                self.visit(e_low + (e_high - e_low) * share(i), mu_low + (mu_high - mu_low) * share(j))?;
            }
        }
        Ok(())
    }
}

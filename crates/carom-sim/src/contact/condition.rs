//! When a touch may close.

use crate::state::{EQUAL, LinearFunction};
use carom_chain::Chain;

/// A condition under which a touch may close: a linear function of joint coordinates is positive. It has no effect on a contact that lasts.
///
/// The swing foot of a walker without knees goes through the floor in the middle of its step. Its contact then is one that closes while
/// the leg is in front.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ClosesWhile {
    formula: String,
    value: LinearFunction,
    rate: LinearFunction,
}

impl ClosesWhile {
    /// Reads the function.
    ///
    /// # Errors
    /// A formula that is not linear, and one of other numbers than joint coordinates.
    pub fn of(formula: &str, chain: &Chain) -> Result<Self, String> {
        let value = LinearFunction::of(formula, chain)?;
        let nq = chain.nq();
        let joint =
            |k: usize| chain.joints().iter().find_map(|joint| chain.coordinate_of(joint).filter(|at| at.q == k));
        if value.terms.is_empty() || value.terms.iter().any(|(k, _)| *k >= nq || joint(*k).is_none()) {
            return Err(format!(
                "\"{formula}\" must be a function of joints with one coordinate, such as left - right"
            ));
        }
        let terms = value.terms.iter().filter_map(|(k, c)| Some((nq + joint(*k)?.v, *c))).collect();
        Ok(Self { formula: formula.to_owned(), value, rate: LinearFunction { terms, constant: 0.0 } })
    }

    /// The function as it is written.
    pub fn formula(&self) -> &str {
        &self.formula
    }

    /// The function and its rate at a state (q, qd).
    pub fn at(&self, state: &[f64]) -> (f64, f64) {
        (self.value.at(state), self.rate.at(state))
    }

    /// Whether it holds; where the function is zero, whether it holds from now on. `pace`: the rate of the motion, 1/s.
    pub fn holds(&self, state: &[f64], pace: f64) -> bool {
        let (value, rate) = self.at(state);
        if value.abs() * pace > EQUAL * rate.abs() { value > 0.0 } else { rate > 0.0 }
    }
}

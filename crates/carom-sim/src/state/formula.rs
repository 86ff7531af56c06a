//! Formulas of named numbers, as files write them: `left - 2*{arm/elbow} + 0.5`.

use exmex::prelude::*;
use exmex::{FloatOpsFactory, MakeOperators};

/// A function of named numbers.
///
/// A name of letters, digits and underscores stands as it is, any other in braces: `{qd left}`. Constants and functions that formulas have
/// themselves, as `e` and `sin`, stand without braces. There are no exponents: 0.001 instead of 1e-3.
#[derive(Debug, Clone)]
pub struct Formula(FlatEx<f64>);

impl Formula {
    /// Reads a formula. `known`: the names that numbers may have.
    ///
    /// # Errors
    /// The formula and the rule: what cannot be read, and a known name without braces that is a constant or a function, too.
    pub fn of(formula: &str, known: &[&str]) -> Result<Self, String> {
        let parsed = FlatEx::parse(formula).map_err(|why| {
            format!(
                "\"{formula}\" is no formula: {why}; names with other characters than letters, digits and underscores stand in braces, as \
                 {{qd elbow}}; numbers are written as 0.001"
            )
        })?;
        let own = FloatOpsFactory::<f64>::make();
        let meant_twice =
            outside_of_braces(formula).find(|word| known.contains(word) && own.iter().any(|it| it.repr() == *word));
        match meant_twice {
            Some(word) => Err(format!(
                "\"{formula}\" has {word} without braces, which is a constant or a function of formulas: write {{{word}}} for the number of \
                 this name"
            )),
            None => Ok(Self(parsed)),
        }
    }

    /// The names that it has, in the order of its arguments.
    pub fn names(&self) -> &[String] {
        self.0.var_names()
    }

    /// Its value at values of the names, in their order; NaN where it has none.
    pub fn at(&self, values: &[f64]) -> f64 {
        self.0.eval(values).unwrap_or(f64::NAN)
    }
}

/// The words of a formula that do not stand in braces.
fn outside_of_braces(formula: &str) -> impl Iterator<Item = &str> {
    let outside = formula
        .split('{')
        .enumerate()
        .map(|(k, part)| if k == 0 { part } else { part.split_once('}').map_or("", |(_, rest)| rest) });
    outside.flat_map(|part| part.split(|c: char| !c.is_alphanumeric() && c != '_'))
}

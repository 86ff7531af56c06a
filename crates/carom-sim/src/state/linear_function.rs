//! Linear functions of the numbers of a state, as files write them: `left - 2*{arm/elbow} + 0.5`.

use super::Formula;
use carom_chain::{Chain, Coordinates};

/// A linear function of the numbers of (q, qd).
#[derive(Debug, Clone, PartialEq)]
pub struct LinearFunction {
    /// Indices into (q, qd), each with its coefficient.
    pub terms: Vec<(usize, f64)>,
    /// What is added.
    pub constant: f64,
}

impl LinearFunction {
    /// Reads a formula. Its variables are the joints with one coordinate, as `left`; `qd left` is the velocity of this joint; of a
    /// floating joint there are `base x`, `base y`, `base z` and `qd base 1` to `qd base 6`. Names with other characters than letters, digits
    /// and underscores stand in braces: `{qd left}`.
    ///
    /// # Errors
    /// A formula that cannot be read, is not linear or not finite, or has an unknown variable.
    pub fn of(formula: &str, chain: &Chain) -> Result<Self, String> {
        let refuse = |why: &str| Err(format!("\"{formula}\" {why}"));
        let known = state_variables(chain);
        let known_names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
        let parsed = Formula::of(formula, &known_names)?;
        let names = parsed.names();
        let mut indices = Vec::new();
        for name in names {
            let Some((_, index)) = known.iter().find(|(known, _)| known == name) else {
                return refuse(&format!("has no variable '{name}': there are {}", known_names.join(", ")));
            };
            indices.push(*index);
        }
        let at = |values: &[f64]| parsed.at(values);
        let along = |k: usize, by: f64| {
            let mut values = vec![0.0; names.len()];
            values[k] = by;
            at(&values)
        };
        let constant = at(&vec![0.0; names.len()]);
        let coefficients: Vec<f64> = (0..names.len()).map(|k| along(k, 1.0) - constant).collect();
        // A place at which no function of few operations has the value of its linear part by chance.
        let place: Vec<f64> = (0..names.len()).map(|k| 1.7 + 0.61 * k as f64).collect();
        let (mut linear, mut size) = (constant, constant.abs());
        for (x, c) in place.iter().zip(&coefficients) {
            (linear, size) = (linear + c * x, size + (c * x).abs());
        }
        if !linear.is_finite() || (at(&place) - linear).abs() > 1e-12 * size {
            return refuse("is not linear: write sums of joints with numbers, like left - 2*right + 0.5");
        }
        Ok(Self { terms: indices.into_iter().zip(coefficients).collect(), constant })
    }

    /// Its value at a state (q, qd).
    pub fn at(&self, state: &[f64]) -> f64 {
        self.constant + self.terms.iter().map(|(k, c)| c * state[*k]).sum::<f64>()
    }

    /// Its derivatives by a small displacement of q and by qd, at a configuration: 2 nv numbers.
    pub fn slope(&self, chain: &Chain, q: &[f64]) -> Vec<f64> {
        let (nq, nv) = (chain.nq(), chain.nv());
        let mut slope = vec![0.0; 2 * nv];
        for v in 0..nv {
            let mut unit = vec![0.0; nv];
            unit[v] = 1.0;
            // Coordinates of joints with one number and the position of floating joints are linear in their displacements.
            let moved = chain.integrate(q, &unit, 1.0).unwrap_or_else(|_| q.to_vec());
            slope[v] = self.terms.iter().filter(|(k, _)| *k < nq).map(|(k, c)| c * (moved[*k] - q[*k])).sum();
        }
        self.terms.iter().filter(|(k, _)| *k >= nq).for_each(|(k, c)| slope[nv + k - nq] += c);
        slope
    }
}

/// The numbers of (q, qd) of which functions are made: their names in formulas, and their indices.
pub fn state_variables(chain: &Chain) -> Vec<(String, usize)> {
    let (mut names, nq) = (Vec::new(), chain.nq());
    for joint in chain.joints() {
        let Coordinates::Own { q, v } = &joint.coordinates else { continue };
        let name = &joint.name;
        if q.len() == 1 {
            names.push((name.clone(), q.start));
            names.push((format!("qd {name}"), nq + v.start));
        } else if !v.is_empty() {
            let axes = ["x", "y", "z"].iter().enumerate().filter(|_| q.len() != v.len());
            names.extend(axes.map(|(k, axis)| (format!("{name} {axis}"), q.start + k)));
            names.extend(v.clone().map(|k| (format!("qd {name} {}", k - v.start + 1), nq + k)));
        }
    }
    names
}

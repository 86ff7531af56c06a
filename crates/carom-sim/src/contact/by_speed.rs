//! A coefficient of restitution that depends on the approach speed.

use crate::error::SimError;
use carom_impact::{AnyLaw, Coefficients, ImpactError, ImpactOutcome, ImpactProblem, Law};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::sync::Arc;

/// A coefficient of restitution as a function of the approach speed v = −u_n > 0 (m/s).
///
/// ```
/// use carom_sim::RestitutionBySpeed;
/// let measured = RestitutionBySpeed::Table(vec![[0.1, 0.9], [1.1, 0.7]]);
/// assert_eq!([0.0, 0.6, 5.0].map(|v| measured.at(v)), [0.9, 0.8, 0.7]);
/// assert_eq!(RestitutionBySpeed::Viscoelastic(0.2).at(1.0), 0.8);
/// ```
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RestitutionBySpeed {
    /// e = max(0, 1 − a v^(1/5)): the first term of viscoelastic impacts of spheres, with a ≥ 0 in (s/m)^(1/5). Kuwabara & Kono,
    /// Jpn. J. Appl. Phys. 26 (1987) 1230; the terms that it leaves out, of order a² v^(2/5), in Schwager & Pöschel, Phys. Rev. E 57
    /// (1998) 650.
    Viscoelastic(f64),
    /// Pairs of a speed (m/s, 0 or more, ascending) and the coefficient (0 to 1): linear between them, constant outside.
    Table(#[serde(deserialize_with = "pairs")] Vec<[f64; 2]>),
}

/// An array of serde would leave further numbers of a row unread.
fn pairs<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[f64; 2]>, D::Error> {
    let pair = |row: Vec<f64>| {
        let wrong = |row: Vec<f64>| {
            D::Error::custom(format_args!(
                "each row of the table is a pair [speed, coefficient], and one has {} numbers",
                row.len()
            ))
        };
        row.try_into().map_err(wrong)
    };
    Vec::deserialize(from)?.into_iter().map(pair).collect()
}

impl RestitutionBySpeed {
    /// The coefficient at an approach speed, m/s; at 0 for a contact that does not approach.
    pub fn at(&self, speed: f64) -> f64 {
        match self {
            Self::Viscoelastic(a) => (1.0 - a * speed.max(0.0).powf(0.2)).max(0.0),
            Self::Table(rows) => match rows.partition_point(|[v, _]| *v <= speed) {
                0 => rows.first().map_or(0.0, |[_, e]| *e),
                k if k == rows.len() => rows[k - 1][1],
                k => {
                    let [[v, e], [next_v, next_e]] = [rows[k - 1], rows[k]];
                    e + (next_e - e) * (speed - v) / (next_v - v)
                }
            },
        }
    }

    /// The largest coefficient of all speeds.
    pub(crate) fn largest(&self) -> f64 {
        match self {
            Self::Viscoelastic(_) => 1.0,
            Self::Table(rows) => rows.iter().fold(0.0, |most, [_, e]| most.max(*e)),
        }
    }

    /// # Errors
    /// [`SimError::Contact`] with the touch's name.
    pub(crate) fn check(&self, touch: &str) -> Result<(), SimError> {
        let refuse = |what, value, rule| Err(SimError::Contact { touch: touch.into(), what, value, rule });
        match self {
            Self::Viscoelastic(a) if *a >= 0.0 && a.is_finite() => Ok(()),
            Self::Viscoelastic(a) => {
                refuse("restitution viscoelastic", *a, "a in 1 − a v^(1/5) is finite and not negative")
            }
            Self::Table(rows) => {
                let mut last = -f64::MIN_POSITIVE;
                for &[v, e] in rows {
                    if !(v > last && v.is_finite()) {
                        let rule = "the speeds of the table are finite, not negative, and each is above the one before";
                        return refuse("restitution table", v, rule);
                    }
                    if !(0.0..=1.0).contains(&e) {
                        let rule = "the second number of each pair, the coefficient, lies between 0 and 1";
                        return refuse("restitution table", e, rule);
                    }
                    last = v;
                }
                if rows.is_empty() {
                    return refuse("restitution table", 0.0, "it has at least one pair [speed, coefficient]");
                }
                Ok(())
            }
        }
    }
}

impl fmt::Display for RestitutionBySpeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Viscoelastic(a) => write!(f, "1 − {a} v^(1/5)"),
            Self::Table(rows) => {
                let one = |[v, e]: &[f64; 2]| format!("{e} at {v} m/s");
                f.write_str(&rows.iter().map(one).collect::<Vec<_>>().join(", "))
            }
        }
    }
}

/// A law of `carom-impact` with such a coefficient.
pub(super) struct BySpeed {
    pub law: AnyLaw,
    pub restitution: Arc<RestitutionBySpeed>,
}

impl Law<f64, 3> for BySpeed {
    fn name(&self) -> &'static str {
        Law::<f64, 3>::name(&self.law)
    }

    fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
        let restitution = self.restitution.at(problem.approach_speed());
        self.law.with(Coefficients { restitution, ..self.law.coefficients() }).resolve(problem)
    }
}

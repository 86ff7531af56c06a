//! What a scene of the stress table consists of, and what is measured and told of a method in it.

use carom_impact::{Coefficients, LAW_NAMES, Law, law_by_name};
use serde::Serialize;

/// The methods, in the order of the table's columns: the laws of one contact, those of several, and the simulators.
pub(crate) const METHODS: [&str; LAW_NAMES.len() + 7] = {
    let others = [MOREAU, GLOCKER_PFEIFFER, SEQUENTIAL, LIU_ZHAO_BROGLIATO, EVENTS, STEPS, COMPLIANT];
    let (mut all, mut k) = ([""; LAW_NAMES.len() + 7], 0);
    while k < all.len() {
        all[k] = if k < LAW_NAMES.len() { LAW_NAMES[k] } else { others[k - LAW_NAMES.len()] };
        k += 1;
    }
    all
};

/// Newton's restitution for all contacts at once.
pub(crate) const MOREAU: &str = "moreau";
/// Poisson's law for several contacts.
pub(crate) const GLOCKER_PFEIFFER: &str = "glocker-pfeiffer";
/// One contact after another.
pub(crate) const SEQUENTIAL: &str = "sequential";
/// The energetic law for several contacts.
pub(crate) const LIU_ZHAO_BROGLIATO: &str = "liu-zhao-brogliato";
/// Event-driven simulation.
pub(crate) const EVENTS: &str = "events";
/// Moreau–Jean time steps.
pub(crate) const STEPS: &str = "steps";
/// Compliant contacts.
pub(crate) const COMPLIANT: &str = "compliant";

/// The result of one method in one scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The figure is rounding: at most 1e-12.
    Exact,
    /// The figure is at most the scene's tolerance.
    Within,
    /// The figure is above the tolerance, by an error of approximation of the predicted size.
    Degrades,
    /// No answer, but an error that states the reason, as predicted.
    Refused,
    /// Wrong, by the amount that theory predicts for this method.
    Fails,
    /// The prediction does not hold.
    Defect,
}

carom_study::words! {
    Verdict {
        Exact "exact",
        Within "within tolerance",
        Degrades "degrades",
        Refused "refused",
        Fails "fails as theory predicts",
        Defect "defect"
    }
}

/// Largest figure of [`Verdict::Exact`].
pub(crate) const EXACT: f64 = 1e-12;

/// The bound on a figure.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bound {
    /// There is no figure: the method refuses.
    NoFigure,
    AtMost(f64),
    Between(f64, f64),
    /// The predicted value for a method, and the relative error allowed.
    Near(fn(&str) -> Result<f64, String>, f64),
}

/// What theory predicts for one or several methods in a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected {
    pub(crate) methods: &'static [&'static str],
    pub(crate) verdict: Verdict,
    pub(crate) bound: Bound,
    pub(crate) reason: &'static str,
}

impl Expected {
    pub(crate) const fn exact(methods: &'static [&'static str], reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Exact, bound: Bound::AtMost(EXACT), reason }
    }

    pub(crate) const fn within(methods: &'static [&'static str], most: f64, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Within, bound: Bound::AtMost(most), reason }
    }

    pub(crate) const fn degrades(methods: &'static [&'static str], bound: Bound, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Degrades, bound, reason }
    }

    pub(crate) const fn fails(methods: &'static [&'static str], bound: Bound, reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Fails, bound, reason }
    }

    pub(crate) const fn refused(methods: &'static [&'static str], reason: &'static str) -> Self {
        Self { methods, verdict: Verdict::Refused, bound: Bound::NoFigure, reason }
    }

    /// Least and largest figure allowed; `None` for a refusal.
    pub(crate) fn limits(&self, method: &str) -> Result<Option<[f64; 2]>, String> {
        Ok(match self.bound {
            Bound::NoFigure => None,
            Bound::AtMost(most) => Some([0.0, most]),
            Bound::Between(least, most) => Some([least, most]),
            Bound::Near(value, relative) => {
                let value = value(method)?;
                Some([value * (1.0 - relative), value * (1.0 + relative)])
            }
        })
    }
}

/// One method in one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Cell {
    /// One of [`METHODS`].
    pub method: &'static str,
    /// The verdict: the expected one, or [`Verdict::Defect`].
    pub verdict: Verdict,
    /// The verdict that theory predicts.
    pub expected: Verdict,
    /// The scene's figure; `None` if the method refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figure: Option<f64>,
    /// Least and largest figure that theory allows; `None` if it predicts a refusal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<[f64; 2]>,
    /// Why theory predicts this.
    pub reason: &'static str,
    /// Further facts; of a defect, what differs from the prediction.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// One scene with all methods that apply to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Short name.
    pub scene: &'static str,
    /// What happens.
    pub story: &'static str,
    /// What the figure measures.
    pub measures: &'static str,
    /// Up to this figure a cell is within tolerance.
    pub tolerance: f64,
    /// The cells, in the order of [`METHODS`].
    pub cells: Vec<Cell>,
}

/// A scene of the table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene {
    /// Short name.
    pub(crate) name: &'static str,
    pub(crate) story: &'static str,
    pub(crate) measures: &'static str,
    pub(crate) tolerance: f64,
    /// The methods that apply are those that something is expected of.
    pub(crate) expected: &'static [Expected],
    pub(crate) judge: fn(&str) -> Judged,
}

/// What a scene measured of one method.
pub(crate) struct Found {
    pub(crate) figure: f64,
    /// Side conditions that do not hold.
    pub(crate) violated: Vec<String>,
    pub(crate) note: String,
}

/// `Err`: the error with which the method refused.
pub(crate) type Judged = Result<Found, String>;

impl Found {
    pub(crate) fn figure(figure: f64) -> Self {
        Self { figure, violated: Vec::new(), note: String::new() }
    }

    pub(crate) fn noting(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// A side condition: `value` is at most `most`.
    pub(crate) fn must(mut self, what: &str, value: f64, most: f64) -> Self {
        // Written so that NaN fails.
        let holds = value <= most;
        if !holds {
            self.violated.push(format!("{what}: {value:.3e}, at most {most:e} expected"));
        }
        self
    }

    /// A side condition that holds or not.
    pub(crate) fn must_be(mut self, what: &str, holds: bool) -> Self {
        if !holds {
            self.violated.push(format!("{what}: not so"));
        }
        self
    }
}

/// One law of one contact, in the plane or in space.
pub(crate) fn law<const D: usize>(name: &str, restitution: f64, friction: f64) -> Box<dyn Law<f64, D> + Send + Sync> {
    let coefficients = Coefficients { restitution, friction, ..Coefficients::default() };
    law_by_name(name, coefficients).unwrap_or_else(|| unreachable!("the scene lists laws only"))
}

/// A step h of the classical method of Runge and Kutta for dy/dt = rate(y): the integrator of the reference solutions, independent
/// of those that the scenes test.
pub(crate) fn runge_kutta<const N: usize>(y: [f64; N], h: f64, rate: impl Fn([f64; N]) -> [f64; N]) -> [f64; N] {
    let plus = |k: [f64; N], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
    let k1 = rate(y);
    let k2 = rate(plus(k1, h / 2.0));
    let k3 = rate(plus(k2, h / 2.0));
    let k4 = rate(plus(k3, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// An error's text.
pub(crate) fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

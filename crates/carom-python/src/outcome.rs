//! A law on plain numbers: `carom.law` and its result.

use crate::array::{Array, Given, Numbers, list};
use crate::error::{Raise, exceptions};
use crate::laws::{GivenLaw, each_law, problem};
use crate::pickle::{fields, variants};
use carom_impact::ImpactOutcome;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The same expression for both sizes.
macro_rules! of {
    ($outcome:expr, $hit:ident => $what:expr) => {
        match &$outcome.numbers {
            OutcomeNumbers::Plane($hit) => $what,
            OutcomeNumbers::Space($hit) => $what,
        }
    };
}

/// The outcome of a law on plain numbers, in contact axes: tangents first, normal last.
#[pyclass(frozen, module = "carom")]
pub struct Outcome {
    numbers: OutcomeNumbers,
}

impl Outcome {
    /// Name of the law and its impulse.
    pub fn point(&self) -> (String, &[f64]) {
        (of!(self, hit => hit.law.to_owned()), of!(self, hit => hit.impulse.as_slice()))
    }
}

fields! { Outcome { numbers } }
variants! { OutcomeNumbers { Plane(hit), Space(hit) } }

enum OutcomeNumbers {
    Plane(ImpactOutcome<f64, 2>),
    Space(ImpactOutcome<f64, 3>),
}

getters! { Outcome, self, py {
    /// Name of the law.
    law: &'static str = of!(self, hit => hit.law);
    /// Impulse on the robot, shape of u, N s.
    impulse: Array<'py> = of!(self, hit => list(py, hit.impulse.as_slice()))?;
    /// Contact velocity before, m/s.
    u_minus: Array<'py> = of!(self, hit => list(py, hit.u_minus.as_slice()))?;
    /// Contact velocity after, m/s.
    u_plus: Array<'py> = of!(self, hit => list(py, hit.u_plus.as_slice()))?;
    /// Contact mode at the end: "open", "stick", "slip" or "reverse-slip".
    mode: &'static str, "_Mode" = of!(self, hit => hit.mode.name());
    /// Names of the flags that are set.
    flags: Vec<&'static str> = of!(self, hit => hit.flags.names().collect());
    /// Kinetic energy in contact space before, ½ uᵀ H⁻¹ u, J.
    energy_before: f64 = of!(self, hit => hit.energy_before);
    /// Kinetic energy in contact space after, J.
    energy_after: f64 = of!(self, hit => hit.energy_after);
    /// T⁺/T⁻ in contact space; 1 at rest.
    energy_ratio: f64 = of!(self, hit => hit.energy_ratio());
    /// Work of the normal impulse, J.
    normal_work: f64 = of!(self, hit => hit.normal_work);
    /// Work of the tangential impulse, J.
    friction_work: f64 = of!(self, hit => hit.friction_work);
} }

#[pymethods]
impl Outcome {
    /// The realised coefficients of restitution: a dict of "newton", "poisson", "energetic"; None where not defined.
    #[getter]
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let [newton, poisson, energetic] = of!(self, hit => [hit.newton, hit.poisson, hit.energetic]);
        Ok(dict! { py,
            "newton": newton,
            "poisson": poisson,
            "energetic": energetic,
        })
    }

    fn __repr__(&self) -> String {
        let (law, mode) = of!(self, hit => (hit.law, hit.mode));
        let (impulse, u_plus) = of!(self, hit => (hit.impulse.as_slice().to_vec(), hit.u_plus.as_slice().to_vec()));
        format!("<carom.Outcome {}: {}, impulse {impulse:?}, u_plus {u_plus:?}>", law, mode)
    }
}

/// The outcome of an impact law on plain numbers.
///
/// Args:
///     H: Delassus matrix (inverse inertia at the contact), shape (3, 3) or in the plane (2, 2), 1/kg.
///     u: contact velocity before the impact, shape (3,) or (2,), m/s. The axes are the contact axes: tangents first, normal last;
///         the normal points from the environment to the robot, so an approaching contact has u[-1] < 0.
///     law: an impact law, a function of H and u, or a list of them.
///     branches: returns a list of all outcomes that satisfy the law, the chosen one first.
///
/// Raises:
///     StateError: a wrong shape.
///     ImpactError: a matrix that is not symmetric or not positive semidefinite, or a law without a solution.
#[pyfunction]
#[pyo3(signature = (H, u, law, *, branches=false))]
#[allow(non_snake_case)] // the name of the matrix in the literature
pub fn law<'py>(
    py: Python<'py>,
    H: Given<'_, 'py>,
    u: Given<'_, 'py>,
    law: Given<'_, 'py>,
    branches: bool,
) -> PyResult<Array<'py>> {
    let (laws, several) = each_law(law)?;
    let (h, u) = (Numbers::read("H", H)?, Numbers::read("u", u)?);
    let all = |law: &GivenLaw| -> PyResult<Vec<Outcome>> {
        let refuse = |e: carom_impact::ImpactError| law.raise(e.raise(""));
        let numbers: Vec<OutcomeNumbers> = match u.shape() {
            [2] => {
                let found = law.in_plane().branches(&problem(&h, &u)?).map_err(refuse)?;
                found.into_iter().map(OutcomeNumbers::Plane).collect()
            }
            [3] => {
                let found = law.in_space().branches(&problem(&h, &u)?).map_err(refuse)?;
                found.into_iter().map(OutcomeNumbers::Space).collect()
            }
            shape => {
                let shape = crate::array::shown(shape);
                let message =
                    format!("u has the shape {shape}: (2,) in the plane (t, n) or (3,) in space (t1, t2, n) is needed");
                return Err(exceptions::StateError::new_err(message));
            }
        };
        Ok(numbers.into_iter().map(|numbers| Outcome { numbers }).collect())
    };
    let one = |law: &GivenLaw| -> PyResult<Array<'py>> {
        let mut found = all(law)?;
        if branches {
            return Ok(PyList::new(py, found.into_iter().map(|it| Bound::new(py, it)).collect::<PyResult<Vec<_>>>()?)?
                .into_any());
        }
        Ok(Bound::new(py, found.swap_remove(0))?.into_any())
    };
    if several {
        let all: Vec<_> = laws.iter().map(one).collect::<PyResult<_>>()?;
        return Ok(PyList::new(py, all)?.into_any());
    }
    one(&laws[0])
}

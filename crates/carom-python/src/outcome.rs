//! A law on plain numbers: `carom.law` and its result.

use crate::array::{Array, Given, Numbers, list};
use crate::error::{Raise, exceptions};
use crate::laws::{GivenLaw, each_law, of_laws, problem};
use crate::pickle::fields;
use carom_impact::{Account, ImpactOutcome};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The outcome of a law on plain numbers, in contact axes: tangents first, normal last.
#[pyclass(frozen, module = "carom")]
pub struct Outcome {
    law: &'static str,
    impulse: Vec<f64>,
    u_minus: Vec<f64>,
    u_plus: Vec<f64>,
    energy_before: f64,
    energy_after: f64,
    energy_ratio: f64,
    account: Account<f64>,
}

fields! { Outcome { law, impulse, u_minus, u_plus, energy_before, energy_after, energy_ratio, account } }

impl<const D: usize> From<ImpactOutcome<f64, D>> for Outcome {
    fn from(hit: ImpactOutcome<f64, D>) -> Self {
        let [impulse, u_minus, u_plus] =
            [hit.impulse, hit.u_minus, hit.u_plus].map(|vector| vector.as_slice().to_vec());
        let energy_ratio = hit.energy_ratio();
        let ImpactOutcome { law, energy_before, energy_after, account, .. } = hit;
        Self { law, impulse, u_minus, u_plus, energy_before, energy_after, energy_ratio, account }
    }
}

impl Outcome {
    /// Name of the law and its impulse.
    pub fn point(&self) -> (String, &[f64]) {
        (self.law.to_owned(), &self.impulse)
    }
}

getters! { Outcome, self, py {
    /// Name of the law.
    law: &'static str = self.law;
    /// Impulse on the robot, shape of u, N s.
    impulse: Array<'py> = list(py, &self.impulse)?;
    /// Contact velocity before, m/s.
    u_minus: Array<'py> = list(py, &self.u_minus)?;
    /// Contact velocity after, m/s.
    u_plus: Array<'py> = list(py, &self.u_plus)?;
    /// Contact mode at the end: "open", "stick", "slip" or "reverse-slip".
    mode: &'static str, "_Mode" = self.account.mode.name();
    /// Names of the flags that are set.
    flags: Vec<&'static str> = self.account.flags.names().collect();
    /// Kinetic energy in contact space before, ½ uᵀ H⁻¹ u, J.
    energy_before: f64 = self.energy_before;
    /// Kinetic energy in contact space after, J.
    energy_after: f64 = self.energy_after;
    /// T⁺/T⁻ in contact space; 1 at rest.
    energy_ratio: f64 = self.energy_ratio;
    /// Work of the normal impulse, J.
    normal_work: f64 = self.account.normal_work;
    /// Work of the tangential impulse, J.
    friction_work: f64 = self.account.friction_work;
} }

#[pymethods]
impl Outcome {
    /// The realised coefficients of restitution: a dict of "newton", "poisson", "energetic"; None where not defined.
    #[getter]
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Account { newton, poisson, energetic, .. } = self.account;
        Ok(dict! { py,
            "newton": newton,
            "poisson": poisson,
            "energetic": energetic,
        })
    }

    fn __repr__(&self) -> String {
        let Self { law, impulse, u_plus, account, .. } = self;
        format!("<carom.Outcome {law}: {}, impulse {impulse:?}, u_plus {u_plus:?}>", account.mode)
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
pub fn law(H: Given, u: Given, law: Given, branches: bool) -> PyResult<Py<PyAny>> {
    let py = H.py();
    let (laws, several) = each_law(law)?;
    let (h, u) = (Numbers::read("H", H)?, Numbers::read("u", u)?);
    let all = |law: &GivenLaw| -> PyResult<Vec<Outcome>> {
        let refuse = |e: carom_impact::ImpactError| law.raise(e.raise(""));
        match u.shape() {
            [2] => {
                let found = law.in_plane().branches(&problem(&h, &u)?).map_err(refuse)?;
                Ok(found.into_iter().map(Outcome::from).collect())
            }
            [3] => {
                let found = law.in_space().branches(&problem(&h, &u)?).map_err(refuse)?;
                Ok(found.into_iter().map(Outcome::from).collect())
            }
            shape => {
                let shape = crate::array::shown(shape);
                let message =
                    format!("u has the shape {shape}: (2,) in the plane (t, n) or (3,) in space (t1, t2, n) is needed");
                Err(exceptions::StateError::new_err(message))
            }
        }
    };
    let one = |law: &GivenLaw| {
        let mut found = all(law)?;
        if branches {
            return Ok(PyList::new(py, found.into_iter().map(|it| Bound::new(py, it)).collect::<PyResult<Vec<_>>>()?)?
                .into_any());
        }
        Ok(Bound::new(py, found.swap_remove(0))?.into_any())
    };
    Ok(of_laws(py, &laws, several, one)?.unbind())
}

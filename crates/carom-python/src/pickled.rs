//! The classes of objects that are pickled, and chains, which are made again from what they were made from.

use crate::array::Array;
use crate::chain::{Chain, Origin, Urdf};
use crate::contact_problem::{ContactProblem, ContactSolution};
use crate::error::raise;
use crate::fit::FitResult;
use crate::impact::Impact;
use crate::impacts::Impacts;
use crate::laws::PythonLaw;
use crate::outcome::Outcome;
use crate::pickle::{Parts, Pickled, tuple, unknown_variant};
use crate::points::SeveralImpact as SeveralPoints;
use crate::run::{Run, RunEvent};
use crate::scene::{Planned, Scene};
use crate::sensitivity::Sensitivity as RunSensitivity;
use crate::study::Study;
use crate::table::Table;
use pyo3::prelude::*;
use std::sync::Arc;

/// By its origin, from which it is made again.
impl Pickled for Chain {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        match self.origin() {
            Origin::Urdf(urdf) => tuple(py, ["Urdf".write(py)?, urdf.write(py)?]),
            Origin::Uniform { links, length, mass } => {
                tuple(py, ["Uniform".write(py)?, links.write(py)?, length.write(py)?, mass.write(py)?])
            }
            Origin::Of(owner) => {
                let (kind, owner) = owner.told(py)?;
                tuple(py, [kind.write(py)?, owner])
            }
        }
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let kind: String = parts.next()?;
        let (chain, origin) = match kind.as_str() {
            "Urdf" => {
                let urdf: Urdf = parts.next()?;
                (urdf.chain().map_err(raise)?, Origin::Urdf(urdf))
            }
            "Uniform" => {
                let (links, length, mass) = (parts.next()?, parts.next()?, parts.next()?);
                let chain = carom_chain::uniform_chain(links, length, mass).map_err(raise)?;
                (chain, Origin::Uniform { links, length, mass })
            }
            "Scene" => {
                let scene: Scene = parts.next()?;
                (scene.scene.simulation.chain.clone(), Origin::Of(Arc::new(scene)))
            }
            "Plan" => {
                let scene: Scene = parts.next()?;
                let chain = scene.scene.plan().map_err(raise)?.simulation.chain;
                (chain, Origin::Of(Arc::new(Planned(scene))))
            }
            "Study" => {
                let study: Study = parts.next()?;
                (study.its_chain().clone(), Origin::Of(Arc::new(study)))
            }
            _ => return Err(unknown_variant(&kind)),
        };
        Ok(Self::new(chain, origin))
    }
}

/// The classes of objects that are pickled: `__reduce__` of each, and the function that reads them again. What does not change is its
/// own copy.
macro_rules! classes {
    ($($class:ident)*) => {
        $(
            #[pymethods]
            impl $class {
                fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Array<'py>, (&'static str, Array<'py>))> {
                    let read = py.import("carom._carom")?.getattr("unpickled")?;
                    Ok((read, (stringify!($class), self.write(py)?)))
                }
            }
        )*

        /// Reads a pickled object.
        #[pyfunction]
        pub fn unpickled<'py>(py: Python<'py>, class: &str, state: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
            $(if class == stringify!($class) {
                return Ok(Bound::new(py, $class::read(state)?)?.into_any());
            })*
            Err(unknown_variant(class))
        }
    };
}

classes! {
    Chain ContactProblem ContactSolution FitResult Impact Impacts Outcome PythonLaw Run RunEvent Scene RunSensitivity SeveralPoints Study
    Table
}

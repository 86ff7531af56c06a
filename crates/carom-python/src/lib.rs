//! The Python package of carom: impacts of kinematic chains, scenes, maps and fits on NumPy arrays.
//!
//! Order of the modules: `error` and `array` (errors and numbers of Python), `threads` and `batch` (loops over states), `callable`
//! (functions of Python), `pickle`, `chain`, `order` and `dynamics` (the class `Chain`), `laws` and `outcome` (laws on plain numbers), `impact` and
//! `impacts`, `points` (one impact, a batch of impacts, several points), `diagram`, `table`, `controller`, `scene`, `run`, `sensitivity`,
//! `session` and `simulate` (simulations), `study` and `fit`, `evidence`; `notebook` (tables and plots); `pickled` (the classes that are pickled). Nothing
//! is computed here: every method converts its arguments, calls the crates and
//! converts the result.

/// A dict of these keys.
macro_rules! dict {
    ($py:ident, $($key:literal: $value:expr),* $(,)?) => {{
        let dict = pyo3::types::PyDict::new($py);
        $(dict.set_item($key, $value)?;)*
        dict
    }};
}

/// Getters of a class: each has its documentation, name and type, where `stubs.py` cannot know it the type of the stub, and an
/// expression of `self` and the token `py`.
macro_rules! getters {
    ($class:ident, $this:ident, $py:ident { $($(#[$($doc:tt)*])* $name:ident: $type:ty $(, $stub:literal)? = $value:expr;)* }) => {
        #[pymethods]
        impl $class {
            $(
                $(#[$($doc)*])*
                #[getter]
                #[allow(unused_variables, clippy::needless_lifetimes)]
                fn $name<'py>(&$this, $py: Python<'py>) -> PyResult<$type> {
                    Ok($value)
                }
            )*
        }
    };
}

mod aim;
mod array;
mod batch;
mod callable;
mod chain;
mod contact_problem;
mod controller;
mod diagram;
mod dynamics;
mod error;
mod evidence;
mod fit;
mod impact;
mod impacts;
mod laws;
mod linear_run;
mod notebook;
mod orbit;
mod order;
mod outcome;
mod pickle;
mod pickled;
mod points;
mod run;
mod scene;
mod sensitivity;
mod session;
mod simulate;
mod study;
mod table;
mod text;
mod threads;

use pyo3::prelude::*;

#[pymodule]
mod _carom {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::aim::aim;
    #[pymodule_export]
    use crate::chain::{Chain, find_package};
    #[pymodule_export]
    use crate::contact_problem::{ContactProblem, ContactSolution};
    #[pymodule_export]
    use crate::diagram::diagram;
    #[pymodule_export]
    use crate::evidence::{chart, compare_laws, tosses};
    #[pymodule_export]
    use crate::fit::{FitResult, fit_impacts, fit_tosses};
    #[pymodule_export]
    use crate::impact::Impact;
    #[pymodule_export]
    use crate::impacts::Impacts;
    #[pymodule_export]
    use crate::laws::{KnownLaw, PythonLaw};
    #[pymodule_export]
    use crate::linear_run::LinearRun;
    #[pymodule_export]
    use crate::orbit::{basin, cycles, orbit};
    #[pymodule_export]
    use crate::outcome::{Outcome, law};
    #[pymodule_export]
    use crate::pickled::unpickled;
    #[pymodule_export]
    use crate::points::SeveralImpact;
    #[pymodule_export]
    use crate::run::{Run, RunEvent, can_record, record};
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::sensitivity::Sensitivity;
    #[pymodule_export]
    use crate::session::{Session, SessionState};
    #[pymodule_export]
    use crate::study::{Study, map};
    #[pymodule_export]
    use crate::table::Table;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::laws::add(module)
    }
}

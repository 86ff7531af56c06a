//! Impact laws: the eight laws of carom as classes, and laws written in Python.

use crate::array::{Array, Given, Numbers, array, numpy};
use crate::callable::Callable;
use crate::error::{Raise, exceptions};
use crate::pickle::{Parts, Pickled, kept, tuple};
use carom_impact::{AnyLaw, Brach, Coefficients, ImpactError, ImpactOutcome, ImpactProblem, Law};
use carom_sim::ContactLaw;
use nalgebra::{SMatrix, SVector};
use pyo3::PyClassInitializer;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::sync::Arc;

/// An impact law of carom with its coefficients; the base class of the eight laws. Immutable.
#[pyclass(frozen, subclass, module = "carom", name = "Law")]
pub struct KnownLaw {
    pub law: AnyLaw,
    shown: String,
}

getters! { KnownLaw, self, py {
    /// Name of the law, as on the command line and in scenes.
    name: &'static str = name(&self.law);
    /// Coefficient of restitution, as the law defines it.
    restitution: f64 = self.law.coefficients().restitution;
    /// Coulomb's coefficient of friction; 0 for a law without one. For Brach's law the size of its impulse ratio.
    friction: f64 = self.law.coefficients().friction;
    /// Coefficient of tangential restitution; 0 for a law without one.
    tangential_restitution: f64 = self.law.coefficients().tangential_restitution;
} }

#[pymethods]
impl KnownLaw {
    fn __repr__(&self) -> String {
        format!("carom.{}", self.shown)
    }

    fn __eq__(&self, other: Given) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().law == self.law)
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.shown.hash(&mut hasher);
        hasher.finish()
    }
}

fn name(law: &AnyLaw) -> &'static str {
    Law::<f64, 3>::name(law)
}

/// A law with its coefficients, checked.
fn known(class: &str, law: AnyLaw, given: &[(&str, f64)]) -> PyResult<KnownLaw> {
    // The coefficients are checked by an impact.
    let problem = ImpactProblem::new(SMatrix::<f64, 3, 3>::identity(), SVector::from([0.0, 0.0, -1.0]));
    problem.and_then(|problem| law.resolve(&problem)).map_err(|e| e.raise(""))?;
    let given: Vec<String> = given.iter().map(|(name, value)| format!("{name}={value}")).collect();
    Ok(KnownLaw { law, shown: format!("{class}({})", given.join(", ")) })
}

/// What an argument of a law means.
macro_rules! meaning {
    (restitution) => {
        "    restitution: 0 to 1."
    };
    (friction) => {
        "    friction: Coulomb's coefficient, 0 or more."
    };
    (tangential_restitution) => {
        "    tangential_restitution: -1 (no tangential impulse) to 1 (one that reverses the slip)."
    };
}

/// The class of a law, by its row in the table of laws.
macro_rules! class {
    // Brach's law has an argument that takes the place of friction.
    ($(#[$doc:meta])* BrachTowardsRest friction) => {
        $(#[$doc])*
        ///
        /// Args:
        ///     restitution: 0 to 1.
        ///     friction: size of the impulse ratio, which is directed towards rest; 0 or more.
        ///     impulse_ratio: instead of friction, tangential over normal impulse, negative against the initial slip. Where the ratio
        ///         that ends the slip has the other sign, friction would act away from rest, and the tangential impulse is 0.
        ///
        /// Raises:
        ///     ImpactError: a coefficient out of its range.
        #[pyclass(frozen, extends = KnownLaw, module = "carom", name = "Brach")]
        pub struct BrachLaw {
            friction: Option<f64>,
            impulse_ratio: Option<f64>,
        }
    };
    ($(#[$doc:meta])* $class:ident $($more:ident)*) => {
        $(#[$doc])*
        ///
        /// Args:
        #[doc = meaning!(restitution)]
        $(#[doc = meaning!($more)])*
        ///
        /// Raises:
        ///     ImpactError: a coefficient out of its range.
        #[pyclass(frozen, extends = KnownLaw, module = "carom")]
        pub struct $class;

        #[pymethods]
        impl $class {
            #[new]
            #[pyo3(signature = (restitution $(, $more = 0.0)*))]
            fn new(restitution: f64 $(, $more: f64)*) -> PyResult<PyClassInitializer<Self>> {
                let law = AnyLaw::from(carom_impact::$class { restitution $(, $more)* });
                let given = [("restitution", restitution) $(, (stringify!($more), $more))*];
                Ok(PyClassInitializer::from(known(stringify!($class), law, &given)?).add_subclass(Self))
            }

            fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<(Py<PyAny>, Bound<'py, PyTuple>)> {
                let own = this.as_super().get().law.coefficients();
                let given = PyTuple::new(this.py(), [own.restitution $(, own.$more)*])?;
                Ok((this.get_type().into_any().unbind(), given))
            }
        }
    };
}

/// The classes of the laws, and the function that adds them to the module.
macro_rules! classes {
    ($($(#[$doc:meta])* $name:literal $(| $alias:literal)* $class:ident { restitution $(, $more:ident)* } $summary:literal;)*) => {
        $(class! { $(#[$doc])* $class $($more)* })*

        type BrachTowardsRest = BrachLaw;

        /// Adds the classes of the laws to the module.
        pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
            $(module.add_class::<$class>()?;)*
            Ok(())
        }
    };
}

carom_impact::law_table! { classes! }

#[pymethods]
impl BrachLaw {
    #[new]
    #[pyo3(signature = (restitution, friction=None, impulse_ratio=None))]
    fn new(restitution: f64, friction: Option<f64>, impulse_ratio: Option<f64>) -> PyResult<PyClassInitializer<Self>> {
        let own = Self { friction, impulse_ratio };
        let given = [Some(("restitution", restitution)), friction.map(|x| ("friction", x))];
        let given: Vec<_> = given.into_iter().chain([impulse_ratio.map(|x| ("impulse_ratio", x))]).flatten().collect();
        let law = match (friction, impulse_ratio) {
            (Some(_), Some(_)) => {
                return Err(PyTypeError::new_err("Brach has both friction and impulse_ratio: give one of them"));
            }
            (None, Some(impulse_ratio)) => AnyLaw::from(Brach { restitution, impulse_ratio }),
            (friction, None) => {
                let coefficients =
                    Coefficients { restitution, friction: friction.unwrap_or(0.0), ..Default::default() };
                AnyLaw::named("brach", coefficients).ok_or_else(|| PyTypeError::new_err("brach"))?
            }
        };
        Ok(PyClassInitializer::from(known("Brach", law, &given)?).add_subclass(own))
    }

    fn __reduce__(this: &Bound<'_, Self>) -> (Py<PyAny>, (f64, Option<f64>, Option<f64>)) {
        let own = this.get();
        let coefficients = (this.as_super().get().law.coefficients().restitution, own.friction, own.impulse_ratio);
        (this.get_type().into_any().unbind(), coefficients)
    }
}

/// An impact law written in Python.
///
/// The function is called as `function(H, u)` with the Delassus matrix H (shape (3, 3), 1/kg) and the contact velocity u
/// (shape (3,), m/s) in contact axes: two tangents, then the normal, which points from the environment to the robot, so that an
/// approaching contact has u[-1] < 0. It returns the impulse on the robot in the same axes, shape (3,), N s. With
/// `carom.law` in the plane the sizes are 2.
///
/// Args:
///     function: the law.
///     restitution: coefficient of restitution, 0 to 1, that holds in scenes where an impact law does not apply: several
///         contacts at once, time steps, compliant contacts.
///     friction: Coulomb's coefficient of friction, 0 or more, for the same and for lasting contacts.
///     name: name of the law in results; that of the function by default.
///
/// A plain function may be given wherever a law is expected; its coefficients are then zero. A call takes some microseconds and
/// needs the GIL: batches are computed one state after another.
#[pyclass(frozen, module = "carom", name = "PythonLaw")]
pub struct PythonLaw {
    own: Arc<Own>,
    restitution: f64,
    friction: f64,
}

/// The function with the name of its law.
pub struct Own {
    function: Callable,
    name: &'static str,
}

getters! { PythonLaw, self, py {
    /// Name of the law.
    name: &'static str = self.own.name;
    /// Coefficient of restitution where an impact law does not apply.
    restitution: f64 = self.restitution;
    /// Coulomb's coefficient of friction where an impact law does not apply.
    friction: f64 = self.friction;
} }

#[pymethods]
impl PythonLaw {
    #[new]
    #[pyo3(signature = (function, restitution=0.0, friction=0.0, name=None))]
    fn new(function: Given, restitution: f64, friction: f64, name: Option<String>) -> PyResult<Self> {
        let (function, own) = Callable::new(function, "H and u")?;
        // The coefficients have the rules of those of the laws of carom.
        known("", AnyLaw::from(carom_impact::Energetic { restitution, friction }), &[])?;
        let own = Arc::new(Own { function, name: kept(name.unwrap_or(own)) });
        Ok(Self { own, restitution, friction })
    }

    fn __repr__(&self) -> String {
        let Self { own, restitution, friction } = self;
        format!("carom.PythonLaw({}, restitution={restitution}, friction={friction})", own.name)
    }
}

/// By its function, which Python pickles by its name.
impl Pickled for PythonLaw {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let Self { own, restitution, friction } = self;
        tuple(py, [own.function.function(py), restitution.write(py)?, friction.write(py)?, own.name.write(py)?])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let function: Py<PyAny> = parts.next()?;
        Self::new(function.bind(from.py()), parts.next()?, parts.next()?, Some(parts.next()?))
    }
}

impl<const D: usize> Law<f64, D> for Own {
    fn name(&self) -> &'static str {
        self.name
    }

    fn resolve(&self, problem: &ImpactProblem<f64, D>) -> Result<ImpactOutcome<f64, D>, ImpactError> {
        if problem.approach_speed() <= 0.0 {
            return ImpactOutcome::of_impulse(self.name, problem, SVector::zeros());
        }
        let arguments = |py: Python<'_>| {
            let h = array(py, problem.delassus().as_slice().to_vec(), &[D, D])?;
            let u = array(py, problem.u_minus().as_slice().to_vec(), &[D])?;
            Ok((h.unbind(), u.unbind()))
        };
        let mut impulse = SVector::<f64, D>::zeros();
        let done = self.function.call("the impulse of the law", arguments, impulse.as_mut_slice());
        done.map_err(|reason| ImpactError::UsersLaw { law: self.name, reason })?;
        ImpactOutcome::of_impulse(self.name, problem, impulse)
    }
}

/// The law of a call.
#[derive(Clone)]
pub enum GivenLaw {
    Known(AnyLaw),
    Python(Arc<Own>, Coefficients),
}

impl GivenLaw {
    /// Reads a law.
    ///
    /// # Errors
    /// `TypeError` for anything that is neither a law nor can be called.
    pub fn read(given: Given) -> PyResult<Self> {
        if let Ok(law) = given.cast::<KnownLaw>() {
            return Ok(Self::Known(law.get().law));
        }
        if given.is_instance_of::<pyo3::types::PyType>() {
            return Err(PyTypeError::new_err(
                "law is a class: give it its coefficients, like carom.Energetic(0.5, 0.2)",
            ));
        }
        let python = |law: &PythonLaw| {
            let coefficients =
                Coefficients { restitution: law.restitution, friction: law.friction, ..Default::default() };
            Self::Python(law.own.clone(), coefficients)
        };
        if let Ok(law) = given.cast::<PythonLaw>() {
            return Ok(python(law.get()));
        }
        if given.is_callable() {
            return Ok(python(&PythonLaw::new(given, 0.0, 0.0, None)?));
        }
        let found = given.get_type().name()?;
        let message = format!("law is {found}: give a law like carom.Energetic(0.5, 0.2), or a function of H and u");
        Err(PyTypeError::new_err(message))
    }

    /// Whether the law is written in Python.
    pub fn is_python(&self) -> bool {
        matches!(self, Self::Python(..))
    }

    /// The same law with these coefficients of restitution and friction, if they are given.
    pub fn with(&self, [restitution, friction]: [Option<f64>; 2]) -> Self {
        let (Self::Known(law), true) = (self, restitution.or(friction).is_some()) else { return self.clone() };
        let own = law.coefficients();
        let (restitution, friction) = (restitution.unwrap_or(own.restitution), friction.unwrap_or(own.friction));
        Self::Known(law.with(Coefficients { restitution, friction, ..own }))
    }

    /// The law on problems in space.
    pub fn in_space(&self) -> &(dyn Law<f64, 3> + Send + Sync) {
        match self {
            Self::Known(law) => law,
            Self::Python(own, _) => &**own,
        }
    }

    /// The law on problems in the plane.
    pub fn in_plane(&self) -> &(dyn Law<f64, 2> + Send + Sync) {
        match self {
            Self::Known(law) => law,
            Self::Python(own, _) => &**own,
        }
    }

    /// The law of a contact of a scene.
    pub fn of_contact(&self) -> ContactLaw {
        match self {
            Self::Known(law) => (*law).into(),
            Self::Python(own, coefficients) => {
                ContactLaw::new(Shared(own.clone()), coefficients.restitution, coefficients.friction)
            }
        }
    }

    /// Takes the exception that the function of the law has raised last.
    pub fn raised(&self) -> Option<PyErr> {
        match self {
            Self::Known(_) => None,
            Self::Python(own, _) => own.function.raised(),
        }
    }

    /// The exception that the function of the law has raised; `error` if there is none.
    pub fn raise(&self, error: PyErr) -> PyErr {
        self.raised().unwrap_or(error)
    }
}

/// A law that contacts of a scene share.
struct Shared(Arc<Own>);

impl Law<f64, 3> for Shared {
    fn name(&self) -> &'static str {
        self.0.name
    }

    fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
        Law::<f64, 3>::resolve(&*self.0, problem)
    }
}

/// One law, or a list of laws.
pub fn each_law(given: Given) -> PyResult<(Vec<GivenLaw>, bool)> {
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() {
        let laws = given.try_iter()?.map(|law| GivenLaw::read(&law?)).collect::<PyResult<_>>()?;
        return Ok((laws, true));
    }
    Ok((vec![GivenLaw::read(given)?], false))
}

/// What `one` makes of the laws of [`each_law`]: of one law, or a list of them.
pub fn of_laws<'py>(
    py: Python<'py>,
    laws: &[GivenLaw],
    several: bool,
    one: impl Fn(&GivenLaw) -> PyResult<Array<'py>>,
) -> PyResult<Array<'py>> {
    if several {
        let all: Vec<_> = laws.iter().map(one).collect::<PyResult<_>>()?;
        return Ok(PyList::new(py, all)?.into_any());
    }
    one(&laws[0])
}

/// Matrix and vector of a contact with D axes.
pub fn problem<const D: usize>(h: &Numbers, u: &Numbers) -> PyResult<ImpactProblem<f64, D>> {
    let shape = h.shape();
    if shape != [D, D] {
        let shape = crate::array::shown(shape);
        let message = format!("H has the shape {shape}: u has {D} numbers, so ({D}, {D}) is needed");
        return Err(exceptions::StateError::new_err(message));
    }
    let matrix = SMatrix::<f64, D, D>::from_row_slice(h.slice());
    ImpactProblem::new(matrix, SVector::from_column_slice(u.slice())).map_err(|e| e.raise(""))
}

/// An array of texts.
pub fn texts<'py>(py: Python<'py>, texts: &[&str]) -> PyResult<Array<'py>> {
    numpy(py)?.call_method1("array", (PyList::new(py, texts)?,))
}

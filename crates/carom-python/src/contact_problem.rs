//! A contact problem by itself: its matrix, its velocities and the laws of its rows.

use crate::array::{Array, Given, Maybe, Numbers, list, shown};
use crate::error::exceptions::{ImpactError, StateError};
use crate::error::raise;
use crate::impact::matrix;
use crate::pickle::{Parts, Pickled, fields, tuple, variants};
use crate::points::several_law;
use carom_impact::{Accuracy, Constraint, SeveralOutcome, SeveralProblem};
use carom_sim::SeveralLaw;
use nalgebra::{DMatrix, DVector};
use pyo3::prelude::*;

/// A contact problem: impulses p and velocities u = u_free + H p that obey the laws of the constraints.
///
/// The rows of a contact are its two tangents and its normal, which points from the environment to the robot; a contact in the plane
/// has zeros in the row and column of its second tangent. Every other constraint has one row. `carom.fclib` reads and writes
/// problems of contacts in the format of the field's collections. Immutable.
///
/// Args:
///     delassus: H = J M⁻¹ Jᵀ, shape (n, n), 1/kg: symmetric, positive semidefinite, singular where constraints are redundant.
///     u_free: velocities without impulses, shape (n,), m/s.
///     friction: Coulomb's coefficient, a number or shape (K,) for K constraints; of contacts alone. Default 0.
///     restitution: Newton's coefficient (Poisson's, the energetic one under these laws), a number or shape (K,). Default 0.
///     u_minus: velocities before, to which restitution refers, shape (n,); None: u_free, an impact without forces.
///     kinds: of each constraint "contact", "stop" (a contact or joint limit without friction), "dry" (dry friction of a joint) or
///         "held" (the row's velocity is 0); None: contacts only.
///     bounds: the largest impulse of dry friction, N s, shape (K,); used for "dry" alone.
///
/// Raises:
///     StateError: a wrong shape.
///     ImpactError: a matrix that is not symmetric and positive semidefinite, a coefficient out of its range.
#[pyclass(frozen, module = "carom")]
pub struct ContactProblem {
    problem: SeveralProblem,
}

impl From<SeveralProblem> for ContactProblem {
    fn from(problem: SeveralProblem) -> Self {
        Self { problem }
    }
}

/// The kinds of constraints.
const KINDS: [&str; 4] = ["contact", "stop", "dry", "held"];

const fn kind(constraint: &Constraint) -> &'static str {
    match constraint {
        Constraint::Contact { .. } => KINDS[0],
        Constraint::Stop { .. } => KINDS[1],
        Constraint::Dry { .. } => KINDS[2],
        Constraint::Held => KINDS[3],
    }
}

/// Friction, restitution and bound of a constraint; 0 and infinity where it has none.
const fn numbers(constraint: &Constraint) -> [f64; 3] {
    match *constraint {
        Constraint::Contact { restitution, friction } => [friction, restitution, NONE[2]],
        Constraint::Stop { restitution } => [NONE[0], restitution, NONE[2]],
        Constraint::Dry { bound } => [NONE[0], NONE[1], bound],
        Constraint::Held => NONE,
    }
}

/// Friction, restitution and bound of a constraint that has none.
const NONE: [f64; 3] = [0.0, 0.0, f64::INFINITY];

/// A number of each constraint: one for all, or one for each; and whether it was one for all.
fn each(what: &str, given: Given, count: usize) -> PyResult<(Vec<f64>, bool)> {
    let rows = Numbers::read(what, given)?.scalars(what)?;
    match rows.count() {
        Some(found) if found != count => {
            let why = format!("{what} has {found} numbers for {count} constraints: give one for each, or one for all");
            Err(StateError::new_err(why))
        }
        found => Ok(((0..count).map(|k| rows.plain().row(k)[0]).collect(), found.is_none())),
    }
}

/// A vector of this length.
fn vector(what: &str, given: Given, length: usize) -> PyResult<DVector<f64>> {
    let numbers = Numbers::read(what, given)?;
    if numbers.shape() != [length] {
        let found = shown(numbers.shape());
        return Err(StateError::new_err(format!(
            "{what} has the shape {found}: ({length},) is needed, a number for each row"
        )));
    }
    if let Some(k) = numbers.slice().iter().position(|x| !x.is_finite()) {
        return Err(StateError::new_err(format!("{what}[{k}] is {}: it must be finite", numbers.slice()[k])));
    }
    Ok(DVector::from_column_slice(numbers.slice()))
}

impl ContactProblem {
    /// A number of each constraint.
    fn column<'py>(&self, py: Python<'py>, which: usize) -> PyResult<Array<'py>> {
        list(py, &self.problem.constraints().iter().map(|one| numbers(one)[which]).collect::<Vec<_>>())
    }
}

getters! { ContactProblem, self, py {
    /// H, shape (n, n), 1/kg.
    delassus: Array<'py> = matrix(py, self.problem.delassus())?;
    /// Velocities without impulses, shape (n,), m/s.
    u_free: Array<'py> = list(py, self.problem.u_free().as_slice())?;
    /// Velocities before, shape (n,), m/s.
    u_minus: Array<'py> = list(py, self.problem.u_minus().as_slice())?;
    /// The kind of each constraint: "contact", "stop", "dry" or "held".
    kinds: Vec<&'static str> = self.problem.constraints().iter().map(kind).collect();
    /// Coulomb's coefficient of each constraint, shape (K,); 0 for those without one.
    friction: Array<'py> = self.column(py, 0)?;
    /// Coefficient of restitution of each constraint, shape (K,); 0 for those without one.
    restitution: Array<'py> = self.column(py, 1)?;
    /// The largest impulse of dry friction, N s, shape (K,); inf for the other constraints.
    bounds: Array<'py> = self.column(py, 2)?;
} }

#[pymethods]
impl ContactProblem {
    #[new]
    #[pyo3(signature = (delassus, u_free, *, friction=None, restitution=None, u_minus=None, kinds=None, bounds=None))]
    fn new(
        delassus: Given,
        u_free: Given,
        friction: Maybe,
        restitution: Maybe,
        u_minus: Maybe,
        kinds: Option<Vec<String>>,
        bounds: Maybe,
    ) -> PyResult<Self> {
        let free = Numbers::read("u_free", u_free)?;
        let (n, given) = (free.slice().len(), Numbers::read("delassus", delassus)?);
        let free = vector("u_free", u_free, n)?;
        if given.shape() != [n, n] {
            let found = shown(given.shape());
            return Err(StateError::new_err(format!(
                "delassus has the shape {found}, but u_free has {n} numbers: ({n}, {n}) is needed"
            )));
        }
        let kinds = kinds.unwrap_or_else(|| vec![KINDS[0].to_owned(); n / 3]);
        if let Some(k) = kinds.iter().position(|kind| !KINDS.contains(&kind.as_str())) {
            let why = format!("kinds[{k}] is '{}': the kinds are {}", kinds[k], KINDS.join(", "));
            return Err(ImpactError::new_err(why));
        }
        let column = |what: &str, given: Maybe, which: usize, of: &[&str]| {
            let Some(given) = given else { return Ok(vec![NONE[which]; kinds.len()]) };
            let (all, is_one) = each(what, given, kinds.len())?;
            let has = |k: &usize| of.contains(&kinds[*k].as_str());
            let idle = (0..kinds.len()).find(|k| !has(k) && all[*k] != 0.0 && all[*k] != NONE[which]);
            // One number for all is that of the constraints that have one.
            match idle.filter(|_| !(is_one && (0..kinds.len()).any(|k| has(&k)))) {
                Some(k) => Err(ImpactError::new_err(format!(
                    "{what} is {} for constraint {k}, which is a '{}': only '{}' has one",
                    all[k],
                    kinds[k],
                    of.join("' and '")
                ))),
                None => Ok(all),
            }
        };
        let friction = column("friction", friction, 0, &KINDS[..1])?;
        let restitution = column("restitution", restitution, 1, &KINDS[..2])?;
        let bound = column("bounds", bounds, 2, &KINDS[2..3])?;
        if let Some(k) = kinds.iter().position(|kind| kind == KINDS[2]).filter(|_| bounds.is_none()) {
            let why = format!("kinds[{k}] is '{}': give bounds, the largest impulses of dry friction", KINDS[2]);
            return Err(ImpactError::new_err(why));
        }
        let made = |(k, kind): (usize, &String)| match KINDS.iter().position(|known| known == kind) {
            Some(0) => Constraint::Contact { restitution: restitution[k], friction: friction[k] },
            Some(1) => Constraint::Stop { restitution: restitution[k] },
            Some(2) => Constraint::Dry { bound: bound[k] },
            _ => Constraint::Held,
        };
        let constraints = kinds.iter().enumerate().map(made).collect();
        let before = u_minus.map_or_else(|| Ok(free.clone()), |given| vector("u_minus", given, n))?;
        let problem = SeveralProblem::new(DMatrix::from_row_slice(n, n, given.slice()), before, constraints);
        let problem = problem.and_then(|problem| problem.with_free_velocity(free)).map_err(raise)?;
        Ok(Self { problem })
    }

    /// Solves the problem.
    ///
    /// Args:
    ///     law: "moreau" (restitution of velocities, all constraints at once; with restitution 0 Coulomb's law and Signorini's condition),
    ///         "poisson", "sequential" or "energetic", as for `Chain.impact_at_points`.
    ///     tolerance: residual, relative to the largest velocity, at which the iteration ends.
    ///     max_iterations: the largest number of sweeps and Newton steps; of "sequential" of impacts.
    ///     start: under "moreau" impulses to begin with, shape (n,), N s.
    ///     relative_stiffness, exponent: as for `Chain.impact_at_points`; the stiffnesses have shape (K,).
    ///
    /// Returns:
    ///     A ContactSolution. A problem without a solution, or whose solution is not found, is no error: its residual is above the
    ///     tolerance, and `solved` is False.
    ///
    /// Raises:
    ///     StateError: a wrong shape.
    ///     ImpactError: an unknown law; friction under "energetic"; arguments that the law does not use.
    #[pyo3(signature = (*, law="moreau", tolerance=1e-12, max_iterations=2000, start=None, relative_stiffness=None, exponent=None))]
    fn solve(
        &self,
        py: Python<'_>,
        law: &str,
        tolerance: f64,
        max_iterations: usize,
        start: Maybe,
        relative_stiffness: Maybe,
        exponent: Option<f64>,
    ) -> PyResult<ContactSolution> {
        let (problem, law) = (&self.problem, several_law(law, exponent, relative_stiffness.is_some())?);
        // Written so that NaN fails.
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(ImpactError::new_err(format!("tolerance is {tolerance}: give a finite number >= 0")));
        }
        if start.is_some() && law != SeveralLaw::Moreau {
            let why = format!("start has no effect under the law '{}': only 'moreau' uses it", law.name());
            return Err(ImpactError::new_err(why));
        }
        let count = problem.constraints().len();
        let stiffnesses = relative_stiffness.map_or_else(
            || Ok(vec![1.0; count]),
            |given| Ok::<_, PyErr>(each("relative_stiffness", given, count)?.0),
        )?;
        let start = start.map(|given| vector("start", given, problem.u_free().len())).transpose()?;
        let accuracy = Accuracy { tolerance, max_iterations };
        let found = py.detach(|| law.solve(problem, &stiffnesses, &accuracy, start.as_ref())).map_err(raise)?;
        Ok(ContactSolution { solved: found.is_solved(&accuracy), found })
    }

    fn __repr__(&self) -> String {
        let (constraints, rows) = (self.problem.constraints().len(), self.problem.u_free().len());
        format!("<carom.ContactProblem: {constraints} constraints, {rows} rows>")
    }
}

/// The impulses and velocities of a contact problem. Immutable.
#[pyclass(frozen, module = "carom")]
pub struct ContactSolution {
    found: SeveralOutcome,
    solved: bool,
}

getters! { ContactSolution, self, py {
    /// Impulses on the robot along the rows, shape (n,), N s.
    impulse: Array<'py> = list(py, self.found.impulse.as_slice())?;
    /// Velocities after, shape (n,), m/s.
    u_plus: Array<'py> = list(py, self.found.u_plus.as_slice())?;
    /// Violation of the law, relative to the largest velocity.
    residual: f64 = self.found.residual;
    /// Number of sweeps and Newton steps; of "sequential" of impacts.
    iterations: usize = self.found.iterations;
    /// Work of the impulses at the mean of the velocities before and after, J.
    energy_change: f64 = self.found.energy_change;
    /// Whether the residual is within the tolerance.
    solved: bool = self.solved;
    /// Notes about the solution: "energy-gain", "no-approach" (no impulses are needed), "non-unique" (other impulses give other
    /// velocities).
    flags: Vec<&'static str> = self.found.flags.names().collect();
} }

#[pymethods]
impl ContactSolution {
    fn __repr__(&self) -> String {
        let SeveralOutcome { residual, iterations, .. } = self.found;
        let solved = if self.solved { "solved" } else { "not solved" };
        format!("<carom.ContactSolution: {solved}, residual {residual}, {iterations} iterations>")
    }
}

impl Pickled for ContactProblem {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let (u_minus, u_free) = (self.problem.u_minus().write(py)?, self.problem.u_free().write(py)?);
        tuple(py, [self.problem.delassus().write(py)?, u_minus, u_free, self.problem.constraints().to_vec().write(py)?])
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut parts = Parts::of(from)?;
        let (delassus, u_minus, u_free) = (parts.next()?, parts.next()?, parts.next()?);
        let problem = SeveralProblem::from_gram(delassus, u_minus, parts.next()?);
        Ok(problem.and_then(|problem| problem.with_free_velocity(u_free)).map_err(raise)?.into())
    }
}

variants! {
    Constraint { Contact { restitution, friction }, Stop { restitution }, Dry { bound }, Held }
}

fields! {
    ContactSolution { found, solved }
    SeveralOutcome { impulse, u_plus, residual, iterations, energy_change, flags }
}

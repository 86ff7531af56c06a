//! `Chain.impact_at_points`: an impact at several points at the same moment.

use crate::array::{Array, Given, Maybe, Numbers, array, list, shown, vector};
use crate::chain::Chain;
use crate::error::{exceptions, raise};
use crate::impact::Joints;
use crate::pickle::fields;
use carom_chain::FramePoint;
use carom_sim::{Grip, Impacts as _, SeveralLaw, StruckPoint};
use nalgebra::Vector3;
use pyo3::prelude::*;

/// The result of an impact at several points.
#[pyclass(frozen, module = "carom")]
pub struct SeveralImpact {
    hit: carom_sim::SeveralImpact,
}

fields! { SeveralImpact { hit } }

fn rows<'py>(py: Python<'py>, vectors: &[Vector3<f64>]) -> PyResult<Array<'py>> {
    array(py, vectors.iter().flat_map(|v| v.iter().copied()).collect(), &[vectors.len(), 3])
}

getters! { SeveralImpact, self, py {
    /// Joint velocities after the impact, shape (nv,); rad/s, m/s.
    qd_plus: Array<'py> = list(py, &self.hit.qd_plus)?;
    /// Impulses on the robot, shape (K, 3) for K points, world axes, N s. Where points are redundant (three on one body), other
    /// impulses with the same effect on the motion are possible.
    impulses: Array<'py> = rows(py, &self.hit.impulses)?;
    /// Velocities of the points before the impact, shape (K, 3), world axes, m/s.
    u_minus: Array<'py> = rows(py, &self.hit.u_minus)?;
    /// Velocities of the points after the impact, shape (K, 3), world axes, m/s.
    u_plus: Array<'py> = rows(py, &self.hit.u_plus)?;
    /// Kinetic energy of the robot before the impact, J.
    energy_before: f64 = self.hit.energy_before;
    /// Kinetic energy of the robot after the impact, J.
    energy_after: f64 = self.hit.energy_after;
    /// Violation of the law, relative to the largest velocity of a point, at most 1e-9.
    residual: f64 = self.hit.residual;
    /// Notes about the result, as for Impact; and "without-restitution": no impulses satisfy the law with the coefficients of
    /// restitution given, and the result is that with all of them zero, as in scenes.
    flags: Vec<&'static str> = self.hit.flags.names().collect();
} }

#[pymethods]
impl SeveralImpact {
    fn __repr__(&self) -> String {
        let hit = &self.hit;
        let (points, before, after) = (hit.impulses.len(), hit.energy_before, hit.energy_after);
        let flags = if hit.flags.is_empty() { String::new() } else { format!(", flags {}", hit.flags) };
        format!(
            "<carom.SeveralImpact: {points} points, qd_plus {:?}, energy {before} -> {after} J{flags}>",
            hit.qd_plus
        )
    }
}

/// The law of several contacts with this name.
///
/// # Errors
/// `ImpactError` for an unknown one, and for an exponent or stiffnesses that it does not use.
pub fn several_law(name: &str, exponent: Option<f64>, stiffnesses: bool) -> PyResult<SeveralLaw> {
    let law = SeveralLaw::ALL.into_iter().find(|law| law.name() == name);
    match law {
        Some(SeveralLaw::Energetic { exponent: own }) => {
            Ok(SeveralLaw::Energetic { exponent: exponent.unwrap_or(own) })
        }
        Some(law) => {
            match [("exponent", exponent.is_some()), ("relative_stiffness", stiffnesses)].iter().find(|it| it.1) {
                Some((what, _)) => {
                    let why = format!("{what} has no effect under the law '{name}': only 'energetic' uses it");
                    Err(exceptions::ImpactError::new_err(why))
                }
                None => Ok(law),
            }
        }
        None => {
            let names = SeveralLaw::ALL.map(SeveralLaw::name).join(", ");
            let why = format!("law is '{name}': the laws of several points are {names}");
            Err(exceptions::ImpactError::new_err(why))
        }
    }
}

/// A coefficient of every point; 0 if it is not given.
fn for_all(what: &str, given: Maybe) -> PyResult<f64> {
    let Some(given) = given else { return Ok(0.0) };
    let numbers = Numbers::read(what, given)?;
    match numbers.slice() {
        [one] => Ok(*one),
        _ => {
            let why = format!("{what} has the shape {}: give one number, that of every point", shown(numbers.shape()));
            Err(exceptions::StateError::new_err(why))
        }
    }
}

#[pymethods]
impl Chain {
    /// The impact of several points of the robot at the same moment, as one problem: a toe line, a face, two feet.
    ///
    /// Args:
    ///     q, qd: state before the impact, shapes (nq,) and (nv,).
    ///     points: a list of (frame, point): name of the link, and the point in its axes from its origin, m.
    ///     normal: contact normal in world axes, from the environment to the robot, of any length but zero; one for all points, or
    ///         shape (K, 3).
    ///     restitution, friction: coefficients of every point.
    ///     law: "moreau" (restitution of velocities, at all points at once), "poisson" (restitution of impulses), "sequential"
    ///         (one point after another, always the fastest) or "energetic" (impulses in the ratios that stiffnesses and stored
    ///         energies give, without friction).
    ///     sticks: every point stops and neither slips nor leaves, whatever impulse that takes; restitution and friction are not
    ///         used.
    ///     joints: as for impact.
    ///     relative_stiffness: under "energetic" the stiffnesses of the points relative to one another, shape (K,); None: all equal.
    ///     exponent: under "energetic" that of the normal force over the penetration: 1 for flat contacts, 1.5 for round bodies, which is
    ///         the default.
    ///
    /// Returns:
    ///     A SeveralImpact.
    ///
    /// Raises:
    ///     StateError: a wrong shape, or numbers that are not finite.
    ///     ImpactError: no points, a fixed point, a singular direction, a coefficient out of its range; or no impulses were found that
    ///         satisfy the law, not even without restitution.
    #[pyo3(signature = (q, qd, points, normal, *, restitution=None, friction=None, law="moreau", sticks=false, joints=None, relative_stiffness=None, exponent=None))]
    fn impact_at_points(
        &self,
        q: Given,
        qd: Given,
        points: Vec<(String, [f64; 3])>,
        normal: Given,
        restitution: Maybe,
        friction: Maybe,
        law: &str,
        sticks: bool,
        joints: Maybe,
        relative_stiffness: Option<Vec<f64>>,
        exponent: Option<f64>,
    ) -> PyResult<SeveralImpact> {
        let law = several_law(law, exponent, relative_stiffness.is_some())?;
        if let Some(what) =
            [("restitution", restitution), ("friction", friction)].iter().find(|it| sticks && it.1.is_some())
        {
            let why = format!("{} has no effect with sticks=True: leave one of them out", what.0);
            return Err(exceptions::ImpactError::new_err(why));
        }
        let (restitution, friction) = (for_all("restitution", restitution)?, for_all("friction", friction)?);
        let normals: Vec<Vector3<f64>> = match normal.extract::<Vec<[f64; 3]>>() {
            Ok(each) if each.len() == points.len() => each.into_iter().map(Into::into).collect(),
            Ok(each) => {
                let why = format!(
                    "normal has {} rows: give one vector, or one for each of {} points",
                    each.len(),
                    points.len()
                );
                return Err(exceptions::StateError::new_err(why));
            }
            Err(_) => vec![vector("normal", normal)?.into(); points.len()],
        };
        let grip = if sticks { Grip::Sticks } else { Grip::Contact { restitution, friction } };
        let stiffnesses = relative_stiffness.unwrap_or_else(|| vec![1.0; points.len()]);
        if stiffnesses.len() != points.len() {
            let why = format!("relative_stiffness has {} numbers for {} points", stiffnesses.len(), points.len());
            return Err(exceptions::StateError::new_err(why));
        }
        let struck = |(k, (frame, offset)): (usize, &(String, [f64; 3]))| {
            let point = FramePoint::new(self.frame(frame)?, *offset);
            Ok(StruckPoint { point, normal: normals[k], grip, relative_stiffness: stiffnesses[k] })
        };
        let points: Vec<StruckPoint> = points.iter().enumerate().map(struck).collect::<PyResult<_>>()?;
        let (q, qd) = (self.q(q)?.single("q")?, self.v("qd", qd)?.single("qd")?);
        let hit = Joints::read(self, joints)?.with(|model| self.chain.impact_at_points(&q, &qd, &points, model, law));
        Ok(SeveralImpact { hit: hit.map_err(raise)? })
    }
}

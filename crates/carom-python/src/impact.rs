//! One impact: `Chain.impact`, and its result at a single state.

use crate::array::{Array, Given, Maybe, Numbers, Plain, Rows, array, list, vectors};
use crate::chain::Chain;
use crate::dynamics::free_fall;
use crate::error::{exceptions, raise};
use crate::impacts::{self, Each, Impacts};
use crate::laws::{GivenLaw, each_law, of_laws};
use crate::notebook;
use crate::pickle::{Pickled, fields};
use carom_impact::{CoefficientRanges, Flags, LawInfo};
use carom_sim::{ChainImpact, ImpactBand, ImpactDerivative, Impacts as _, JointModel, Saltation, Strike};
use nalgebra::{DMatrix, Vector3};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The action of the drives, from Python.
pub enum Joints {
    Free,
    AllLocked,
    Locked(Vec<String>),
    Impedance { stiffness: Vec<f64>, damping: Vec<f64>, contact_time: f64 },
}

impl Joints {
    /// The argument `joints`.
    pub fn read(chain: &Chain, given: Maybe) -> PyResult<Self> {
        let Some(given) = given else { return Ok(Self::Free) };
        if let Ok(word) = given.extract::<String>() {
            return match word.as_str() {
                "free" => Ok(Self::Free),
                "locked" => Ok(Self::AllLocked),
                _ => Err(exceptions::ImpactError::new_err(format!(
                    "joints is '{word}': give 'free', 'locked', a list of names of locked joints, or a dict of stiffness, damping \
                     and contact_time"
                ))),
            };
        }
        if let Ok(dict) = given.cast::<PyDict>() {
            let known = ["stiffness", "damping", "contact_time"];
            for (key, _) in dict {
                let key = key.to_string();
                if !known.contains(&key.as_str()) {
                    return Err(PyTypeError::new_err(format!("joints has '{key}': give {}", known.join(", "))));
                }
            }
            let need = |key: &str| {
                let missing =
                    || PyTypeError::new_err(format!("joints has no '{key}': give stiffness, damping and contact_time"));
                dict.get_item(key)?.ok_or_else(missing)
            };
            let diagonal = |key: &'static str| -> PyResult<Vec<f64>> {
                let given = need(key)?;
                match given.extract::<f64>() {
                    Ok(all) => Ok(JointModel::for_all_joints(&chain.chain, all)),
                    Err(_) => chain.v(key, &given)?.single(key),
                }
            };
            let (stiffness, damping) = (diagonal("stiffness")?, diagonal("damping")?);
            return Ok(Self::Impedance { stiffness, damping, contact_time: need("contact_time")?.extract()? });
        }
        Ok(Self::Locked(given.extract()?))
    }

    /// Calls `work` with the joint model.
    pub fn with<R>(&self, work: impl FnOnce(JointModel) -> R) -> R {
        match self {
            Self::Free => work(JointModel::Free),
            Self::AllLocked => work(JointModel::AllLocked),
            Self::Locked(names) => {
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                work(JointModel::Locked(&names))
            }
            Self::Impedance { stiffness, damping, contact_time } => {
                work(JointModel::Impedance { stiffness, damping, contact_time: *contact_time })
            }
        }
    }
}

/// What is to be computed beside the impact.
#[derive(Clone, Copy)]
pub struct Wanted {
    pub derivatives: bool,
    pub band: Option<CoefficientRanges>,
    /// Gravity of the saltation matrix, m/s².
    pub saltation: Option<[f64; 3]>,
}

/// An impact of a chain at one state.
#[pyclass(frozen, module = "carom")]
pub struct Impact {
    pub hit: ChainImpact,
    /// Most calls do not want it: a small object is made faster.
    more: Option<Box<More>>,
}

fields! {
    Impact { hit, more }
    More { derivatives, band, saltation }
    Derivatives { q, qd, restitution, friction }
}

/// What is computed beside the impact.
struct More {
    derivatives: Option<Derivatives>,
    band: Option<ImpactBand>,
    saltation: Option<Saltation>,
}

/// Derivatives of qd⁺, without the impact.
pub struct Derivatives {
    pub q: DMatrix<f64>,
    pub qd: DMatrix<f64>,
    pub restitution: Vec<f64>,
    pub friction: Vec<f64>,
}

impl Impact {
    pub fn of(hit: ChainImpact, derivatives: Option<Derivatives>) -> Self {
        let more = derivatives.map(|own| Box::new(More { derivatives: Some(own), band: None, saltation: None }));
        Self { hit, more }
    }

    /// Computes what is wanted at one state.
    pub fn compute(strike: Strike<'_>, law: &GivenLaw, wanted: &Wanted) -> Result<Self, carom_sim::SimError> {
        let law = law.in_space();
        let Wanted { derivatives, band, saltation } = wanted;
        if !derivatives && band.is_none() && saltation.is_none() {
            return Ok(Self { hit: strike.resolve(law)?, more: None });
        }
        let (hit, derivatives) = if *derivatives {
            let ImpactDerivative { hit, q, qd, restitution, friction } = strike.clone().derivative(law)?;
            let vector = |v: nalgebra::DVector<f64>| v.as_slice().to_vec();
            let own = Derivatives { q, qd, restitution: vector(restitution), friction: vector(friction) };
            (hit, Some(own))
        } else {
            (strike.clone().resolve(law)?, None)
        };
        let band = band.map(|ranges| strike.clone().contact()?.band(law, &ranges)).transpose()?;
        let saltation = saltation.map(|gravity| strike.saltation(law, gravity)).transpose()?;
        Ok(Self { hit, more: Some(Box::new(More { derivatives, band, saltation })) })
    }

    pub fn by(&self) -> Option<&Derivatives> {
        self.more.as_ref()?.derivatives.as_ref()
    }
}

/// A matrix as an array.
pub fn matrix<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Array<'py>> {
    array(py, m.transpose().as_slice().to_vec(), &[m.nrows(), m.ncols()])
}

getters! { Impact, self, py {
    /// Joint velocities after the impact, shape (nv,); rad/s, m/s.
    qd_plus: Array<'py> = list(py, &self.hit.qd_plus)?;
    /// Impulse on the robot, shape (3,), world axes, N s.
    impulse: Array<'py> = list(py, self.hit.impulse.as_slice())?;
    /// Velocity of the contact point before the impact, shape (3,), world axes, m/s.
    u_minus: Array<'py> = list(py, self.hit.u_minus.as_slice())?;
    /// Velocity of the contact point after the impact, shape (3,), world axes, m/s.
    u_plus: Array<'py> = list(py, self.hit.u_plus.as_slice())?;
    /// Kinetic energy of the robot before the impact, J.
    energy_before: f64 = self.hit.energy_before;
    /// Kinetic energy of the robot after the impact, J.
    energy_after: f64 = self.hit.energy_after;
    /// T⁺/T⁻ of the robot; 1 at rest.
    energy_ratio: f64 = self.hit.energy_ratio();
    /// Contact mode at the end of the impact: "open", "stick", "slip" or "reverse-slip".
    mode: &'static str, "_Mode" = self.hit.mode.name();
    /// Name of the law.
    law: &'static str = self.hit.contact.law;
    /// Names of the flags that are set, of "energy-gain", "jam", "singular", "grazing", "non-unique", "no-approach".
    flags: Vec<&'static str> = self.hit.flags.names().collect();
    /// Work of the normal impulse, J.
    normal_work: f64 = self.hit.contact.normal_work;
    /// Work of the tangential impulse, J.
    friction_work: f64 = self.hit.contact.friction_work;
    /// Impulse of the drives on each joint, shape (nv,), N m s or N s; zeros with free joints.
    drive_impulse: Array<'py> = list(py, &self.hit.drive_impulse)?;
    /// Work of the drives, J.
    drive_work: f64 = self.hit.drive_work;
} }

#[pymethods]
impl Impact {
    /// With derivatives=True a dict of the derivatives of qd_plus: "q" and "qd" of shape (nv, nv), "restitution" and "friction"
    /// of shape (nv,). Column k of "q" is the derivative along the motion with unit qd[k]. Else None.
    #[getter]
    fn derivatives<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(by) = self.by() else { return Ok(None) };
        Ok(Some(dict! { py,
            "q": matrix(py, &by.q)?,
            "qd": matrix(py, &by.qd)?,
            "restitution": list(py, &by.restitution)?,
            "friction": list(py, &by.friction)?,
        }))
    }

    /// With band=… a dict of bounds over the ranges of the coefficients: "qd_plus" of shape (nv, 2), "u_plus" and "impulse" of
    /// shape (3, 2), "exact" (False: sampled, possibly too narrow) and "evaluations". Else None.
    #[getter]
    fn band<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(band) = self.more.as_ref().and_then(|more| more.band.as_ref()) else { return Ok(None) };
        let pairs = |pairs: &[[f64; 2]]| array(py, pairs.concat(), &[pairs.len(), 2]);
        Ok(Some(dict! { py,
            "qd_plus": pairs(&band.qd_plus)?,
            "u_plus": pairs(&band.u_plus)?,
            "impulse": pairs(&band.impulse)?,
            "exact": band.exact,
            "evaluations": band.evaluations,
        }))
    }

    /// With saltation=True a dict: "matrix" of shape (2nv, 2nv), which maps small changes of (q, qd) before the impact to those
    /// after it; "closing", the rate of the gap before, m/s; "time", the derivative of the time of the impact, shape (2nv,).
    /// Else None.
    #[getter]
    fn saltation<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(found) = self.more.as_ref().and_then(|more| more.saltation.as_ref()) else { return Ok(None) };
        Ok(Some(dict! { py,
            "matrix": matrix(py, &found.matrix)?,
            "closing": found.closing,
            "time": list(py, found.time.as_slice())?,
        }))
    }

    /// Draws the velocities of the contact point before and after, and the impulse, by world axes, with matplotlib.
    ///
    /// Args:
    ///     axes: two Axes to draw into; new ones by default.
    ///
    /// Returns:
    ///     The Axes.
    ///
    /// Raises:
    ///     ImportError: matplotlib is not installed.
    #[pyo3(signature = (axes=None))]
    fn plot<'py>(this: &Bound<'py, Self>, axes: Maybe<'_, 'py>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "impact_plot", (this, axes))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "impact_html", (this,))
    }

    fn __repr__(&self) -> String {
        let ChainImpact { qd_plus, impulse, mode, flags, contact, .. } = &self.hit;
        let flags = if flags.is_empty() { String::new() } else { format!(", flags {flags}") };
        let (law, size, ratio) = (contact.law, impulse.norm(), self.hit.energy_ratio());
        format!("<carom.Impact {law}: {mode}, qd_plus {qd_plus:?}, impulse {size} N s, energy ratio {ratio}{flags}>")
    }
}

#[pymethods]
impl Chain {
    /// The impact of one point of the robot.
    ///
    /// Args:
    ///     q, qd: state before the impact, shapes (nq,) and (nv,), or a batch (B, nq) and (B, nv).
    ///     frame: name of the link that is hit.
    ///     point: contact point in the axes of the frame, from its origin, m; the origin by default. Shape (3,), or (B, 3) with a
    ///         point for each state.
    ///     normal: contact normal in world axes, from the environment to the robot, of any length but zero. Shape (3,), or (B, 3)
    ///         with a normal for each state.
    ///     law: an impact law like carom.Energetic(0.5, 0.2), a function of H and u, or a list of them.
    ///     restitution, friction: instead of the coefficients of the law, numbers or shape (B,); not for a function.
    ///     joints: "free", "locked", a list of names of locked joints, or a dict of stiffness, damping (one number for all joints but a
    ///         floating base, or shape (nv,)) and contact_time (s) of drives that act during the impact.
    ///     derivatives: also computes the derivatives of qd_plus by q, qd, restitution and friction; with free joints only.
    ///     saltation: also computes the saltation matrix for an impact with a plane at rest; with free joints only.
    ///     gravity: acceleration of free fall for the saltation matrix, world axes, m/s²; (0, 0, -9.81) by default.
    ///     band: ((e_low, e_high), (mu_low, mu_high)): also computes bounds over these ranges of the coefficients.
    ///
    /// Returns:
    ///     An Impact for one state, Impacts if q, qd, point, normal or a coefficient is a batch; a list of them for a list of laws. saltation and band need one state.
    ///
    /// Raises:
    ///     StateError: a wrong shape, or numbers that are not finite.
    ///     ImpactError: a fixed point, a singular direction, a law without a solution; derivatives of a law in Python.
    #[pyo3(signature = (q, qd, frame, normal, law, *, point=None, restitution=None, friction=None, joints=None, derivatives=false, saltation=false, gravity=None, band=None))]
    fn impact<'py>(
        &self,
        py: Python<'py>,
        q: Given<'_, 'py>,
        qd: Given<'_, 'py>,
        frame: &str,
        normal: Given<'_, 'py>,
        law: Given<'_, 'py>,
        point: Maybe<'_, 'py>,
        restitution: Maybe<'_, 'py>,
        friction: Maybe<'_, 'py>,
        joints: Maybe<'_, 'py>,
        derivatives: bool,
        saltation: bool,
        gravity: Maybe<'_, 'py>,
        band: Option<([f64; 2], [f64; 2])>,
    ) -> PyResult<Array<'py>> {
        let (laws, several) = each_law(law)?;
        let (frame, normal) = (self.frame(frame)?, vectors("normal", normal, "world axes")?);
        let point = point.map(|point| vectors("point", point, "axes of the frame")).transpose()?;
        let scalars =
            |what, given: Maybe<'_, 'py>| given.map(|given| Numbers::read(what, given)?.scalars(what)).transpose();
        let own = [scalars("restitution", restitution)?, scalars("friction", friction)?];
        if own.iter().any(Option::is_some) && laws.iter().any(GivenLaw::is_python) {
            return Err(PyTypeError::new_err(
                "restitution and friction are coefficients of the laws of carom: a function has its own",
            ));
        }
        let name = |law: &GivenLaw| law.in_space().name();
        if own[1].is_some() && !laws.iter().any(|law| LawInfo::named(name(law)).is_some_and(|law| law.has("friction")))
        {
            let names: Vec<_> = laws.iter().map(name).collect();
            let why = format!("friction has no effect: the law '{}' has none", names.join("', '"));
            return Err(PyTypeError::new_err(why));
        }
        let (q, qd, joints) = (self.q(q)?, self.v("qd", qd)?, Joints::read(self, joints)?);
        if gravity.is_some() && !saltation {
            return Err(PyTypeError::new_err(
                "gravity acts on the saltation matrix only: give saltation=True, or leave it out",
            ));
        }
        let saltation = if saltation { Some(free_fall(gravity)?.into()) } else { None };
        let band = band.map(|(restitution, friction)| CoefficientRanges { restitution, friction });
        let wanted = Wanted { derivatives, band, saltation };
        let more = [("point", &point), ("restitution", &own[0]), ("friction", &own[1])];
        let more = more.iter().filter_map(|(what, rows)| Some((*what, rows.as_ref()?)));
        let count = crate::array::together([("q", &q), ("qd", &qd), ("normal", &normal)].into_iter().chain(more))?;
        let varies =
            [&point, &own[0], &own[1]].iter().any(|rows| rows.as_ref().is_some_and(|rows| rows.count().is_some()));
        let varies = varies || normal.count().is_some() || own.iter().any(Option::is_some);
        if count.is_some() && (wanted.band.is_some() || wanted.saltation.is_some()) {
            return Err(PyTypeError::new_err(
                "band and saltation need one state: call impact for each state of the batch",
            ));
        }
        let (states, still) = ((q.plain(), qd.plain()), count.is_none());
        let (normal, point, own) =
            (normal.plain(), point.as_ref().map(Rows::plain), own.each_ref().map(|own| own.as_ref().map(Rows::plain)));
        let vector = |rows: Plain<'_>, k: usize| <[f64; 3]>::try_from(rows.row(k)).unwrap_or_default();
        joints.with(|model| {
            let strike = |k: usize| {
                let described = self.chain.impact(states.0.row(k), states.1.row(k)).at(frame);
                let offset = point.map_or_else(Vector3::zeros, |point| vector(point, k).into());
                described.offset(offset).normal(vector(normal, k)).joints(model)
            };
            let one = |law: &GivenLaw| -> PyResult<Array<'py>> {
                let law_of = |k: usize| law.with(own.map(|own| own.map(|own| own.row(k)[0])));
                if still {
                    let hit = Impact::compute(strike(0), &law_of(0), &wanted).map_err(|e| law.raise(raise(e)))?;
                    return Ok(Bound::new(py, hit)?.into_any());
                }
                let (states, each) = ((states, count.unwrap_or(0)), Each { derivatives, varies });
                let found = impacts::compute(py, &self.chain, states, &strike, &law_of, each);
                let found = found.map_err(|e| law.raise(e))?;
                Ok(Bound::new(py, Impacts::new(py, found, self.chain.nv(), law.in_space().name())?)?.into_any())
            };
            of_laws(py, &laws, several, one)
        })
    }
}

/// By the names of those that are set.
impl Pickled for Flags {
    fn write<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.names().collect::<Vec<_>>().write(py)
    }

    fn read(from: &Bound<'_, PyAny>) -> PyResult<Self> {
        let names: Vec<String> = Vec::read(from)?;
        let all = (0..u8::BITS).map(|bit| Self::from_bits(1 << bit));
        let written = all.filter(|flag| flag.names().any(|own| names.iter().any(|name| name == own)));
        Ok(written.fold(Self::NONE, |sum, flag| sum | flag))
    }
}

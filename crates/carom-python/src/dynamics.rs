//! Methods of `Chain`: kinematics and dynamics of a state or of a batch.

use crate::array::{Rows, Target, array, together, vector};
use crate::batch::each_row;
use crate::chain::Chain;
use crate::error::raise;
use carom_chain::{ChainError, Kinematics, Point, Spatial};
use nalgebra::{DMatrix, Vector3};
use pyo3::prelude::*;

type Kin<'a> = Kinematics<'a, Spatial<f64>>;

impl Chain {
    /// Computes `work` at each configuration and writes its numbers into `out`, of the shape `each` for one state.
    fn at_states<'py>(
        &self,
        py: Python<'py>,
        (q, count): (&Rows<'py>, Option<usize>),
        each: &[usize],
        out: Option<&Bound<'py, PyAny>>,
        work: impl Fn(&mut Kin, usize, &mut [f64]) -> Result<(), ChainError> + Sync + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut target = Target::new(out, count, each)?;
        let (chain, q) = (&*self.chain, q.plain());
        let (slice, still) = (target.slice(), vec![0.0; chain.nv()]);
        let one = |workspace: &mut _, k: usize, out: &mut [f64]| -> Result<(), ChainError> {
            let workspace: &mut carom_chain::Workspace<Spatial<f64>> = workspace;
            chain.check_state(q.row(k), &still)?;
            work(&mut workspace.update(chain, q.row(k))?, k, out)
        };
        if count.is_none() {
            self.with_workspace(|workspace| one(workspace, 0, slice)).map_err(raise)?;
        } else {
            each_row(py, count, slice, each.iter().product(), || chain.workspace(), one)?;
        }
        target.finish(py)
    }

    fn point(&self, frame: &str, point: Option<&Bound<'_, PyAny>>) -> PyResult<Point<Spatial<f64>>> {
        Ok(self.chain.point(self.frame(frame)?, offset(point)?))
    }
}

/// The contact point in the axes of its frame; its origin if it is not given.
pub fn offset(point: Option<&Bound<'_, PyAny>>) -> PyResult<Vector3<f64>> {
    point.map_or(Ok(Vector3::zeros()), |point| Ok(vector("point", point)?.into()))
}

/// Gravity, m/s²; zero if it is not given.
pub fn free_fall(gravity: Option<&Bound<'_, PyAny>>) -> PyResult<Vector3<f64>> {
    gravity.map_or(Ok(Vector3::zeros()), |gravity| Ok(vector("gravity", gravity)?.into()))
}

/// Copies a matrix row by row.
fn by_rows(matrix: &DMatrix<f64>, out: &mut [f64]) {
    let columns = matrix.ncols();
    out.iter_mut().enumerate().for_each(|(k, x)| *x = matrix[(k / columns, k % columns)]);
}

#[pymethods]
impl Chain {
    /// Mass matrix M, shape (nv, nv) or (B, nv, nv); kg m², kg m, kg.
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    #[pyo3(signature = (q, *, out=None))]
    fn mass_matrix<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, nv) = (self.q(q)?, self.chain.nv());
        self.at_states(py, (&q, q.count()), &[nv, nv], out, |kin, _, out| {
            // A symmetric matrix has the same entries in the order of C and of Fortran.
            kin.mass_matrix_into(&mut nalgebra::DMatrixViewMut::from_slice(out, nv, nv));
            Ok(())
        })
    }

    /// Jacobian of the velocity of a point, shape (3, nv) or (B, 3, nv), world axes. With full=True the geometric Jacobian of
    /// the frame's origin, shape (6, nv): angular rows first, then the linear ones.
    ///
    /// Args:
    ///     frame: name of the link.
    ///     point: the point in the axes of the frame, from its origin, m.
    #[pyo3(signature = (q, frame, point=None, *, full=false, out=None))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        frame: &str,
        point: Option<&Bound<'py, PyAny>>,
        full: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, nv, frame_id) = (self.q(q)?, self.chain.nv(), self.frame(frame)?);
        if full && point.is_some() {
            let message = "full=True gives the Jacobian of the frame's origin: leave point out";
            return Err(pyo3::exceptions::PyTypeError::new_err(message));
        }
        let point = self.point(frame, point)?;
        let rows = if full { 6 } else { 3 };
        self.at_states(py, (&q, q.count()), &[rows, nv], out, |kin, _, out| {
            if full {
                by_rows(&kin.geometric_jacobian(frame_id), out);
            } else {
                kin.point_jacobian_into(
                    point,
                    &mut nalgebra::DMatrixViewMut::from_slice_with_strides_mut(out, 3, nv, nv, 1),
                );
            }
            Ok(())
        })
    }

    /// Pose of a frame in the world, shape (4, 4) or (B, 4, 4): rotation and position (m) as a homogeneous matrix.
    #[pyo3(signature = (q, frame, *, out=None))]
    fn pose<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        frame: &str,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, frame) = (self.q(q)?, self.frame(frame)?);
        self.at_states(py, (&q, q.count()), &[4, 4], out, |kin, _, out| {
            let pose = kin.pose(frame);
            for i in 0..3 {
                (0..3).for_each(|k| out[4 * i + k] = pose.rotation[(i, k)]);
                out[4 * i + 3] = pose.translation[i];
            }
            out[12..].copy_from_slice(&[0.0, 0.0, 0.0, 1.0]);
            Ok(())
        })
    }

    /// Position of a point in the world, shape (3,) or (B, 3), m.
    #[pyo3(signature = (q, frame, point=None, *, out=None))]
    fn position<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        frame: &str,
        point: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, point) = (self.q(q)?, self.point(frame, point)?);
        self.at_states(py, (&q, q.count()), &[3], out, |kin, _, out| {
            out.copy_from_slice(kin.position(point).as_slice());
            Ok(())
        })
    }

    /// Bias force C q̇ + g, shape (nv,) or (B, nv), N m and N.
    ///
    /// Args:
    ///     gravity: acceleration of free fall, world axes, m/s²; zero by default.
    #[pyo3(signature = (q, qd, *, gravity=None, out=None))]
    fn bias<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        gravity: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, qd, gravity) = (self.q(q)?, self.v("qd", qd)?, free_fall(gravity)?);
        let count = together(&[("q", &q), ("qd", &qd)])?;
        let rates = qd.plain();
        self.at_states(py, (&q, count), &[self.chain.nv()], out, |kin, k, out| {
            kin.chain().check_v("qd", rates.row(k))?;
            out.copy_from_slice(kin.bias(rates.row(k), gravity)?.as_slice());
            Ok(())
        })
    }

    /// Inverse dynamics tau = M q̈ + C q̇ + g by the recursive Newton–Euler algorithm, shape (nv,) or (B, nv), N m and N.
    ///
    /// Args:
    ///     qdd: joint accelerations, shape of qd.
    ///     gravity: acceleration of free fall, world axes, m/s²; zero by default.
    #[pyo3(signature = (q, qd, qdd, *, gravity=None, out=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        qdd: &Bound<'py, PyAny>,
        gravity: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, qd, qdd, gravity) = (self.q(q)?, self.v("qd", qd)?, self.v("qdd", qdd)?, free_fall(gravity)?);
        let count = together(&[("q", &q), ("qd", &qd), ("qdd", &qdd)])?;
        let (rates, accelerations) = (qd.plain(), qdd.plain());
        self.at_states(py, (&q, count), &[self.chain.nv()], out, |kin, k, out| {
            kin.chain().check_v("qd", rates.row(k))?;
            kin.chain().check_v("qdd", accelerations.row(k))?;
            kin.inverse_dynamics_into(rates.row(k), accelerations.row(k), gravity, out)
        })
    }

    /// Forward dynamics q̈ = M⁻¹ (tau − C q̇ − g), shape (nv,) or (B, nv). Damping and friction of the joints are not included.
    ///
    /// Args:
    ///     tau: joint forces, shape of qd, N m and N; zero by default.
    ///     gravity: acceleration of free fall, world axes, m/s²; zero by default.
    ///
    /// Raises:
    ///     ChainError: a singular mass matrix, massless links.
    #[pyo3(signature = (q, qd, tau=None, *, gravity=None, out=None))]
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        tau: Option<&Bound<'py, PyAny>>,
        gravity: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let nv = self.chain.nv();
        let zero = array(py, vec![0.0; nv], &[nv])?;
        let (q, qd, tau) = (self.q(q)?, self.v("qd", qd)?, self.v("tau", tau.unwrap_or(&zero))?);
        let gravity = free_fall(gravity)?;
        let count = together(&[("q", &q), ("qd", &qd), ("tau", &tau)])?;
        let (rates, forces) = (qd.plain(), tau.plain());
        self.at_states(py, (&q, count), &[nv], out, |kin, k, out| {
            kin.chain().check_v("qd", rates.row(k))?;
            kin.chain().check_v("tau", forces.row(k))?;
            kin.forward_dynamics_into(rates.row(k), forces.row(k), gravity, out)
        })
    }

    /// Delassus matrix H = J M⁻¹ Jᵀ of a point (inverse inertia at a contact), shape (3, 3) or (B, 3, 3), world axes, 1/kg.
    ///
    /// Raises:
    ///     ChainError: a singular mass matrix, massless links, a point of a link that is fixed to the world.
    #[pyo3(signature = (q, frame, point=None, *, out=None))]
    fn delassus<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        frame: &str,
        point: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, point) = (self.q(q)?, self.point(frame, point)?);
        self.at_states(py, (&q, q.count()), &[3, 3], out, |kin, _, out| {
            let response = kin.contact(point, Vector3::zeros(), &[])?;
            (0..9).for_each(|k| out[k] = response.delassus[k % 3][k / 3]);
            Ok(())
        })
    }

    /// Effective mass 1/(nᵀHn) of a point along a direction, a number or shape (B,), kg. inf if no joint moves the point along
    /// the direction.
    ///
    /// Args:
    ///     normal: the direction, world axes, of any length but zero.
    #[pyo3(signature = (q, frame, normal, point=None, *, out=None))]
    fn effective_mass<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        frame: &str,
        normal: &Bound<'py, PyAny>,
        point: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (q, point, given) = (self.q(q)?, self.point(frame, point)?, vector("normal", normal)?);
        let Some(normal) = Vector3::from(given).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite())) else {
            let length = Vector3::from(given).norm();
            return Err(raise(ChainError::NoDirection { given: given.to_vec(), length }));
        };
        self.at_states(py, (&q, q.count()), &[], out, |kin, _, out| {
            let response = kin.contact(point, normal, &[])?;
            out[0] = if response.moves() { 1.0 / response.mobility } else { f64::INFINITY };
            Ok(())
        })
    }

    /// Kinetic and potential energy, a pair of numbers or of arrays (B,), J. The potential energy is zero at the world's origin.
    ///
    /// Args:
    ///     gravity: acceleration of free fall, world axes, m/s²; zero by default.
    #[pyo3(signature = (q, qd, *, gravity=None))]
    fn energies<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        gravity: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (q, qd, gravity) = (self.q(q)?, self.v("qd", qd)?, free_fall(gravity)?);
        let count = together(&[("q", &q), ("qd", &qd)])?;
        let rates = qd.plain();
        let kinetic = self.at_states(py, (&q, count), &[], None, |kin, k, out| {
            kin.chain().check_v("qd", rates.row(k))?;
            out[0] = kin.kinetic_energy(rates.row(k))?;
            Ok(())
        })?;
        let potential = self.at_states(py, (&q, count), &[], None, |kin, _, out| {
            out[0] = kin.potential_energy(gravity);
            Ok(())
        })?;
        Ok((kinetic, potential))
    }
}

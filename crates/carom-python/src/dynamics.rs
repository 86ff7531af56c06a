//! Methods of `Chain`: kinematics and dynamics of a state or of a batch.

use crate::array::{Given, Maybe, Target, list, together, vector};
use crate::batch::each_row;
use crate::chain::Chain;
use crate::error::{exceptions, raise};
use carom_chain::{ChainError, FramePoint, Kinematics, Point, Spatial, ToolMotion, Workspace};
use carom_sim::{ImpactLoads, JointImpulse};
use nalgebra::{DMatrix, Vector3};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

type Kin<'a> = Kinematics<'a, Spatial<f64>>;

impl Chain {
    /// Reads configurations and `vectors` of length nv with their names, computes `work` at each state, and writes its numbers
    /// into `out`, of the shape `each` for one state.
    fn at_states<const N: usize>(
        &self,
        q: Given,
        vectors: [(&'static str, Given); N],
        (each, out): (&[usize], Maybe),
        work: impl Fn(&mut Kin, [&[f64]; N], &mut [f64]) -> Result<(), ChainError> + Sync + Send,
    ) -> PyResult<Py<PyAny>> {
        let (py, q, chain) = (q.py(), self.q(q)?, &*self.chain);
        let given = vectors.map(|(what, given)| self.v(what, given).map(|rows| (what, rows)));
        let given = given.into_iter().collect::<PyResult<Vec<_>>>()?;
        let count = together([("q", &q)].into_iter().chain(given.iter().map(|(what, rows)| (*what, rows))))?;
        let mut target = Target::new(out, count, each)?;
        let (slice, q, plain) = (target.slice(), q.plain(), given.iter().map(|(what, rows)| (*what, rows.plain())));
        let plain: Vec<_> = plain.collect();
        let one = |workspace: &mut Workspace<Spatial<f64>>, k: usize, out: &mut [f64]| -> Result<(), ChainError> {
            chain.check_q(q.row(k))?;
            plain.iter().try_for_each(|(what, rows)| chain.check_v(what, rows.row(k)))?;
            work(&mut workspace.update(chain, q.row(k))?, std::array::from_fn(|i| plain[i].1.row(k)), out)
        };
        if count.is_none() {
            self.with_workspace(|workspace| one(workspace, 0, slice)).map_err(raise)?;
        } else {
            each_row(py, count, slice, each.iter().product(), || chain.workspace(), one)?;
        }
        target.finish(py)
    }

    fn point(&self, frame: &str, point: Maybe) -> PyResult<Point<Spatial<f64>>> {
        Ok(self.chain.point(self.frame(frame)?, offset(point)?))
    }
}

/// The contact point in the axes of its frame; its origin if it is not given.
pub fn offset(point: Maybe) -> PyResult<Vector3<f64>> {
    point.map_or(Ok(Vector3::zeros()), |point| Ok(vector("point", point)?.into()))
}

/// Gravity, m/s²; that of the Earth along z if it is not given, as in scenes.
pub fn free_fall(gravity: Maybe) -> PyResult<Vector3<f64>> {
    gravity.map_or(Ok(Vector3::new(0.0, 0.0, -9.81)), |gravity| Ok(vector("gravity", gravity)?.into()))
}

/// Copies a matrix row by row.
fn by_rows(matrix: &DMatrix<f64>, out: &mut [f64]) {
    let columns = matrix.ncols();
    out.iter_mut().enumerate().for_each(|(k, x)| *x = matrix[(k / columns, k % columns)]);
}

/// The loads of an impact as a dict.
pub fn loads_dict<'py>(py: Python<'py>, loads: &ImpactLoads) -> PyResult<Bound<'py, PyDict>> {
    let bearings = PyDict::new(py);
    for JointImpulse { joint, force, moment } in &loads.through {
        bearings.set_item(
            joint,
            dict! { py, "force": list(py, force.as_slice())?, "moment": list(py, moment.as_slice())? },
        )?;
    }
    Ok(dict! { py, "joint_impulse": list(py, &loads.joint_impulse)?, "bearings": bearings })
}

#[pymethods]
impl Chain {
    /// Mass matrix M, shape (nv, nv) or (B, nv, nv); kg m², kg m, kg.
    ///
    /// Raises:
    ///     StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
    #[pyo3(signature = (q, *, out=None))]
    fn mass_matrix(&self, q: Given, out: Maybe) -> PyResult<Py<PyAny>> {
        let nv = self.chain.nv();
        self.at_states(q, [], (&[nv, nv], out), |kin, [], out| {
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
    fn jacobian(&self, q: Given, frame: &str, point: Maybe, full: bool, out: Maybe) -> PyResult<Py<PyAny>> {
        let (nv, frame_id) = (self.chain.nv(), self.frame(frame)?);
        if full && point.is_some() {
            let message = "full=True gives the Jacobian of the frame's origin: leave point out";
            return Err(pyo3::exceptions::PyTypeError::new_err(message));
        }
        let point = self.point(frame, point)?;
        let rows = if full { 6 } else { 3 };
        self.at_states(q, [], (&[rows, nv], out), |kin, [], out| {
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
    fn pose(&self, q: Given, frame: &str, out: Maybe) -> PyResult<Py<PyAny>> {
        let frame = self.frame(frame)?;
        self.at_states(q, [], (&[4, 4], out), |kin, [], out| {
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
    fn position(&self, q: Given, frame: &str, point: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let point = self.point(frame, point)?;
        self.at_states(q, [], (&[3], out), |kin, [], out| {
            out.copy_from_slice(kin.position(point).as_slice());
            Ok(())
        })
    }

    /// Joint velocities that give a point of a link a velocity, shape (nv,) or (B, nv), rad/s and m/s.
    ///
    /// Args:
    ///     frame: name of the link.
    ///     velocity: velocity of the point, world axes, m/s, shape (3,).
    ///     point: the point in the axes of the link, m; its origin by default.
    ///     motion: "least-energy": those of the least kinetic energy; "least-norm": of the least sum of squares;
    ///         "without-rotation": the link does not turn, and of these the ones of the least kinetic energy.
    ///
    /// Raises:
    ///     ChainError: no joint velocities give the point this velocity; an unknown motion.
    #[pyo3(signature = (q, frame, velocity, *, point=None, motion="least-energy", out=None))]
    fn tool_velocity(
        &self,
        q: Given,
        frame: &str,
        velocity: Given,
        point: Maybe,
        motion: &str,
        out: Maybe,
    ) -> PyResult<Py<PyAny>> {
        let motion =
            ToolMotion::from_name(motion).map_err(|why| exceptions::ChainError::new_err(format!("motion: {why}")))?;
        let at = FramePoint::new(self.frame(frame)?, offset(point)?);
        let velocity: Vector3<f64> = vector("velocity", velocity)?.into();
        self.at_states(q, [], (&[self.chain.nv()], out), |kin, [], out| {
            out.copy_from_slice(kin.tool_velocity(at, velocity, motion)?.as_slice());
            Ok(())
        })
    }

    /// The loads of an impact on the joints: what their drives, gears and bearings get.
    ///
    /// Args:
    ///     q: configuration, shape (nq,).
    ///     change: change of the joint velocities, qd_plus - qd, shape (nv,).
    ///     frame: name of the link that is hit.
    ///     impulse: impulse on the link, world axes, N s, shape (3,).
    ///     point: contact point in the axes of the link, m; its origin by default.
    ///
    /// Returns:
    ///     A dict of joint_impulse, Jᵀp of shape (nv,), N m s or N s; and bearings, by joint the force (N s) and the moment (N m s)
    ///     of the impulse that its parent link exerts on its child link, in the axes of the child link, about its origin.
    #[pyo3(signature = (q, change, frame, impulse, *, point=None))]
    fn impact_loads<'py>(
        &self,
        py: Python<'py>,
        q: Given<'_, 'py>,
        change: Given<'_, 'py>,
        frame: &str,
        impulse: Given<'_, 'py>,
        point: Maybe<'_, 'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let at = FramePoint::new(self.frame(frame)?, offset(point)?);
        let impulse: Vector3<f64> = vector("impulse", impulse)?.into();
        let (q, change) = (self.q(q)?, self.v("change", change)?);
        if q.count().is_some() || change.count().is_some() {
            return Err(PyTypeError::new_err("impact_loads needs one state: call it for each state of the batch"));
        }
        let (q, change) = (q.plain(), change.plain());
        let loads = carom_sim::impact_loads(&self.chain, q.row(0), change.row(0), &[(at, impulse)]).map_err(raise)?;
        loads_dict(py, &loads)
    }

    /// Bias force C q̇ + g, shape (nv,) or (B, nv), N m and N.
    ///
    /// Args:
    ///     gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
    #[pyo3(signature = (q, qd, *, gravity=None, out=None))]
    fn bias(&self, q: Given, qd: Given, gravity: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let gravity = free_fall(gravity)?;
        self.at_states(q, [("qd", qd)], (&[self.chain.nv()], out), |kin, [qd], out| {
            out.copy_from_slice(kin.bias(qd, gravity)?.as_slice());
            Ok(())
        })
    }

    /// Inverse dynamics tau = M q̈ + C q̇ + g by the recursive Newton–Euler algorithm, shape (nv,) or (B, nv), N m and N.
    ///
    /// Args:
    ///     qdd: joint accelerations, shape of qd.
    ///     gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
    #[pyo3(signature = (q, qd, qdd, *, gravity=None, out=None))]
    fn inverse_dynamics(&self, q: Given, qd: Given, qdd: Given, gravity: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let gravity = free_fall(gravity)?;
        let vectors = [("qd", qd), ("qdd", qdd)];
        self.at_states(q, vectors, (&[self.chain.nv()], out), |kin, [qd, qdd], out| {
            kin.inverse_dynamics_into(qd, qdd, gravity, out)
        })
    }

    /// The derivatives of `inverse_dynamics` by q and by qd, shape (2, nv, nv) or (B, 2, nv, nv): column k of the first is that along the
    /// motion with unit qd[k], so that a floating joint has six. That by qdd is the mass matrix.
    ///
    /// Args:
    ///     qdd: joint accelerations, shape of qd.
    ///     gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
    #[pyo3(signature = (q, qd, qdd, *, gravity=None, out=None))]
    fn inverse_dynamics_derivatives(
        &self,
        q: Given,
        qd: Given,
        qdd: Given,
        gravity: Maybe,
        out: Maybe,
    ) -> PyResult<Py<PyAny>> {
        let gravity = free_fall(gravity)?;
        let (vectors, nv) = ([("qd", qd), ("qdd", qdd)], self.chain.nv());
        self.at_states(q, vectors, (&[2, nv, nv], out), |kin, [qd, qdd], out| {
            let both = kin.inverse_dynamics_derivatives(qd, qdd, gravity)?;
            // NumPy's rows are nalgebra's columns.
            for (out, by) in out.chunks_mut((nv * nv).max(1)).zip(&both) {
                out.copy_from_slice(by.transpose().as_slice());
            }
            Ok(())
        })
    }

    /// Forward dynamics q̈ = M⁻¹ (tau − C q̇ − g), shape (nv,) or (B, nv). Damping and friction of the joints are not included.
    ///
    /// Args:
    ///     tau: joint forces, shape of qd, N m and N; zero by default.
    ///     gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
    ///
    /// Raises:
    ///     ChainError: a singular mass matrix, massless links.
    #[pyo3(signature = (q, qd, tau=None, *, gravity=None, out=None))]
    fn forward_dynamics(&self, q: Given, qd: Given, tau: Maybe, gravity: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let nv = self.chain.nv();
        let zero = list(q.py(), &vec![0.0; nv])?;
        let (vectors, gravity) = ([("qd", qd), ("tau", tau.unwrap_or(&zero))], free_fall(gravity)?);
        self.at_states(q, vectors, (&[nv], out), |kin, [qd, tau], out| kin.forward_dynamics_into(qd, tau, gravity, out))
    }

    /// Delassus matrix H = J M⁻¹ Jᵀ of a point (inverse inertia at a contact), shape (3, 3) or (B, 3, 3), world axes, 1/kg.
    ///
    /// Raises:
    ///     ChainError: a singular mass matrix, massless links, a point of a link that is fixed to the world.
    #[pyo3(signature = (q, frame, point=None, *, out=None))]
    fn delassus(&self, q: Given, frame: &str, point: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let point = self.point(frame, point)?;
        self.at_states(q, [], (&[3, 3], out), |kin, [], out| {
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
    fn effective_mass(&self, q: Given, frame: &str, normal: Given, point: Maybe, out: Maybe) -> PyResult<Py<PyAny>> {
        let (point, given) = (self.point(frame, point)?, vector("normal", normal)?);
        let Some(normal) = Vector3::from(given).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite())) else {
            let length = Vector3::from(given).norm();
            return Err(raise(ChainError::NoDirection { given: given.to_vec(), length }));
        };
        self.at_states(q, [], (&[], out), |kin, [], out| {
            let response = kin.contact(point, normal, &[])?;
            out[0] = if response.moves() { 1.0 / response.mobility } else { f64::INFINITY };
            Ok(())
        })
    }

    /// Kinetic and potential energy, a named pair (`Energies`) of numbers or of arrays (B,), J. The potential energy is zero at the
    /// world's origin.
    ///
    /// Args:
    ///     gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
    #[pyo3(signature = (q, qd, *, gravity=None))]
    fn energies(&self, q: Given, qd: Given, gravity: Maybe) -> PyResult<Py<PyAny>> {
        let gravity = free_fall(gravity)?;
        let kinetic = self.at_states(q, [("qd", qd)], (&[], None), |kin, [qd], out| {
            out[0] = kin.kinetic_energy(qd)?;
            Ok(())
        })?;
        // With qd, so that both have the length of a batch of velocities at one configuration.
        let potential = self.at_states(q, [("qd", qd)], (&[], None), |kin, _, out| {
            out[0] = kin.potential_energy(gravity);
            Ok(())
        })?;
        static ENERGIES: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        Ok(ENERGIES.import(q.py(), "carom._results", "Energies")?.call1((kinetic, potential))?.unbind())
    }
}

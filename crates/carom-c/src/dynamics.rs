//! Kinematics and dynamics at one state.

use crate::chain::{Chain, frame};
use crate::error::Status;
use carom_chain::{Kinematics, Spatial, Workspace};
use nalgebra::{DMatrixViewMut, Vector3};
use std::sync::Arc;

/// The memory in which the dynamics of a chain are computed, allocated once. One thread at a time may use it.
pub struct Dynamics {
    chain: Arc<carom_chain::Chain>,
    workspace: Workspace<Spatial<f64>>,
}

impl Dynamics {
    fn new(chain: Arc<carom_chain::Chain>) -> Self {
        let mut workspace = chain.workspace();
        // The memory of a contact point grows at its first use; whether the robot has dynamics at this pose does not matter.
        for frame in chain.frames() {
            let known = (workspace.update(&chain, &chain.zero_configuration()), chain.frame(&frame.name));
            if let (Ok(mut kin), Ok(frame)) = known {
                let _ = kin.contact(chain.point(frame, Vector3::zeros()), Vector3::z(), &[]);
            }
        }
        Self { chain, workspace }
    }

    /// The chain at q, checked.
    fn at(&mut self, q: &[f64]) -> Result<Kinematics<'_, Spatial<f64>>, carom_chain::ChainError> {
        self.chain.check_q(q)?;
        self.workspace.update(&self.chain, q)
    }
}

/// Makes the memory for the dynamics of a chain; freed by carom_dynamics_free. No other function of the dynamics allocates, but for
/// chains with mimic joints, and for the message of a fault.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_dynamics_create(chain: *const Chain, dynamics: *mut *mut Dynamics) -> Status {
    call!(carom_dynamics_create, |shared chain, created dynamics| {
        dynamics.give(Dynamics::new(chain.chain.clone()));
        Ok(())
    })
}

/// Frees the memory; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_dynamics_free(dynamics: *mut Dynamics) {
    free!(carom_dynamics_free, free dynamics);
}

/// Pose of a frame at `q` (length nq): the homogeneous matrix of rotation and position (m) in the world, 4 × 4, row by row.
/// cbindgen:ptrs-as-arrays=[[pose;16]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_pose(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    frame: usize,
    pose: *mut f64,
) -> Status {
    let pose_length = 16;
    call!(carom_pose, |exclusive dynamics, input q [q_length], output pose [pose_length]| {
        let frame = self::frame(&dynamics.chain, frame)?;
        let found = dynamics.at(q)?.pose(frame);
        for i in 0..3 {
            (0..3).for_each(|k| pose[4 * i + k] = found.rotation[(i, k)]);
            pose[4 * i + 3] = found.translation[i];
        }
        pose[12..].copy_from_slice(&[0.0, 0.0, 0.0, 1.0]);
        Ok(())
    })
}

/// Jacobian J of the velocity of a point at `q` (length nq): `jacobian` is 3 × nv, row by row, world axes; J qd is the velocity of the
/// point, m/s. `point`: the point in the axes of the frame, from its origin, m.
/// cbindgen:ptrs-as-arrays=[[point;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_jacobian(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    frame: usize,
    point: *const f64,
    jacobian: *mut f64,
    jacobian_length: usize,
) -> Status {
    call!(carom_jacobian, |exclusive dynamics, input q [q_length], three point, output jacobian [jacobian_length]| {
        let (chain, nv) = (dynamics.chain.clone(), dynamics.chain.nv());
        let frame = self::frame(&chain, frame)?;
        has_length("jacobian", jacobian, 3 * nv, "3 × nv")?;
        let mut out = DMatrixViewMut::from_slice_with_strides_mut(jacobian, 3, nv, nv, 1);
        dynamics.at(q)?.point_jacobian_into(chain.point(frame, point), &mut out);
        Ok(())
    })
}

/// Mass matrix M at `q` (length nq): `mass_matrix` is nv × nv, symmetric; kg m², kg m, kg.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_mass_matrix(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    mass_matrix: *mut f64,
    mass_matrix_length: usize,
) -> Status {
    call!(carom_mass_matrix, |exclusive dynamics, input q [q_length], output mass_matrix [mass_matrix_length]| {
        let nv = dynamics.chain.nv();
        has_length("mass_matrix", mass_matrix, nv * nv, "nv × nv")?;
        dynamics.at(q)?.mass_matrix_into(&mut DMatrixViewMut::from_slice(mass_matrix, nv, nv));
        Ok(())
    })
}

/// Delassus matrix H = J M⁻¹ Jᵀ of a point at `q` (length nq), the inverse inertia there: 3 × 3, symmetric, world axes, 1/kg. `point`
/// as in carom_jacobian. Refused physics: a joint that moves no inertia.
/// cbindgen:ptrs-as-arrays=[[point;3], [delassus;9]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_delassus(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    frame: usize,
    point: *const f64,
    delassus: *mut f64,
) -> Status {
    let length = 9;
    call!(carom_delassus, |exclusive dynamics, input q [q_length], three point, output delassus [length]| {
        let point = dynamics.chain.point(self::frame(&dynamics.chain, frame)?, point);
        let mut kin = dynamics.at(q)?;
        let found = kin.contact(point, Vector3::z(), &[])?;
        for (column, out) in found.delassus.iter().zip(delassus.chunks_exact_mut(3)) {
            out.copy_from_slice(column.as_slice());
        }
        Ok(())
    })
}

/// Inverse dynamics: the joint forces `tau` = M qdd + C qd + g (length nv; N m, N) at `q` (length nq), `qd` and `qdd` (length nv; rad/s²,
/// m/s²). With qdd = 0 they are the bias forces. `gravity`: the acceleration of free fall, world axes, m/s², such as {0, 0, -9.81}.
/// cbindgen:ptrs-as-arrays=[[gravity;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_inverse_dynamics(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    qdd: *const f64,
    qdd_length: usize,
    gravity: *const f64,
    tau: *mut f64,
    tau_length: usize,
) -> Status {
    call!(
        carom_inverse_dynamics,
        |exclusive dynamics, input q [q_length], input qd [qd_length], input qdd [qdd_length], three gravity, output tau [tau_length]| {
            dynamics.chain.check_v("qd", qd)?;
            dynamics.chain.check_v("qdd", qdd)?;
            dynamics.at(q)?.inverse_dynamics_into(qd, qdd, gravity, tau)?;
            Ok(())
        }
    )
}

/// Forward dynamics: the joint accelerations `qdd` = M⁻¹(tau − C qd − g) (length nv) at `q` (length nq), `qd` and `tau` (length nv).
/// Damping and friction of the joints are not included: add them to tau. `gravity` as in carom_inverse_dynamics. Refused physics: a
/// joint that moves no inertia.
/// cbindgen:ptrs-as-arrays=[[gravity;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_forward_dynamics(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    tau: *const f64,
    tau_length: usize,
    gravity: *const f64,
    qdd: *mut f64,
    qdd_length: usize,
) -> Status {
    call!(
        carom_forward_dynamics,
        |exclusive dynamics, input q [q_length], input qd [qd_length], input tau [tau_length], three gravity, output qdd [qdd_length]| {
            dynamics.chain.check_v("qd", qd)?;
            dynamics.chain.check_v("tau", tau)?;
            dynamics.at(q)?.forward_dynamics_into(qd, tau, gravity, qdd)?;
            Ok(())
        }
    )
}

/// Kinetic and potential energy, J, at `q` (length nq) and `qd` (length nv). `gravity` as in carom_inverse_dynamics; the potential energy is
/// zero for a centre of mass at the origin of the world.
/// cbindgen:ptrs-as-arrays=[[gravity;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_energies(
    dynamics: *mut Dynamics,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    gravity: *const f64,
    kinetic: *mut f64,
    potential: *mut f64,
) -> Status {
    call!(
        carom_energies,
        |exclusive dynamics, input q [q_length], input qd [qd_length], three gravity, place kinetic, place potential| {
            dynamics.chain.check_v("qd", qd)?;
            let mut kin = dynamics.at(q)?;
            kinetic.put(kin.kinetic_energy(qd)?);
            potential.put(kin.potential_energy(gravity));
            Ok(())
        }
    )
}

/// # Errors
/// An array of another length.
pub(crate) fn has_length<T>(what: &str, given: &[T], expected: usize, rule: &str) -> Result<(), crate::error::Fault> {
    if given.len() == expected {
        return Ok(());
    }
    let got = given.len();
    Err(crate::error::Fault::invalid(format!("{what} has {got} numbers, {expected} are needed ({rule})")))
}

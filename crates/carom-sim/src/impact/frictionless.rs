//! The frictionless impact as a kernel without branches and allocations: for sweeps, SIMD lanes and dual numbers.
//!
//! `qd⁺ = qd⁻ − (1+e) (n·J qd⁻)/(nᵀHn) M⁻¹Jᵀn`: eqs. (10)–(15) of Pagilla & Yu, IEEE/ASME T. Mechatronics 9 (2004). The
//! articulated-body recursion gives M⁻¹Jᵀn in O(n), and nᵀHn = (Jᵀn)·(M⁻¹Jᵀn).

use carom_chain::algebra::Algebra;
use carom_chain::{ChainError, Kinematics, Point};
use num_traits::{One, Zero};

/// Joint velocities after a frictionless impact of `point` along the unit `normal` (world axes, from the environment to
/// the robot) with `restitution` (Newton's, Poisson's and Stronge's coefficients are equal without friction). Writes
/// `qd_plus`, overwrites `scratch` (both of length nv), and returns the normal impulse, N s. Allocates nothing.
///
/// The kernel checks neither the sign of the approach velocity nor a singular normal, which gives infinite results; use
/// [`crate::Strike`] for these checks.
///
/// # Errors
/// [`ChainError::WrongLength`]; [`ChainError::Coupled`] for a chain with mimic joints.
pub fn frictionless_jump_into<A: Algebra>(
    kin: &mut Kinematics<A>,
    point: Point<A>,
    normal: A::Vector,
    restitution: A::Scalar,
    qd: &[A::Scalar],
    scratch: &mut [A::Scalar],
    qd_plus: &mut [A::Scalar],
) -> Result<A::Scalar, ChainError> {
    let approach = A::dot(normal, kin.point_velocity(point, qd)?);
    kin.articulate()?.respond_along(point, normal, scratch, qd_plus)?;
    let mut c = A::Scalar::zero();
    for (j, x) in scratch.iter().zip(qd_plus.iter()) {
        c += *j * *x;
    }
    let impulse = -(A::Scalar::one() + restitution) * approach / c;
    for (x, v) in qd_plus.iter_mut().zip(qd) {
        *x = *v + *x * impulse;
    }
    Ok(impulse)
}

//! The frictionless impact as one branch-free, allocation-free kernel: for sweeps, SIMD lanes and dual numbers.
//!
//! `qd⁺ = qd⁻ − (1+e) (n·J qd⁻)/(nᵀHn) M⁻¹Jᵀn`: eqs. (10)–(15) of Pagilla & Yu, IEEE/ASME T. Mechatronics 9 (2004). The
//! articulated recursion gives M⁻¹Jᵀn in time O(n), and nᵀHn = (Jᵀn)·(M⁻¹Jᵀn) comes with it.

use carom_chain::algebra::Algebra;
use carom_chain::{ChainError, Kinematics, Point};
use num_traits::{One, Zero};

/// Joint velocities after a frictionless impact of `point` along the unit `normal` (world axes, from the environment to
/// the robot) with `restitution` (Newton's, Poisson's and Stronge's coincide here). Returns the normal impulse, N s;
/// fills `qd_plus`; `scratch` is overwritten; both of length nv. Allocates nothing.
///
/// The sign of the approach is not looked at, and a singular normal gives infinities: this is the kernel, and
/// [`crate::Strike`] is what checks.
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
    scratch.fill(A::Scalar::zero());
    kin.add_point_force(point, normal, scratch)?;
    kin.articulate()?.solve_into(scratch, qd_plus)?;
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

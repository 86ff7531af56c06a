//! The fused pass for rows of two and three hinges, unrolled: the same operations in the same order. The compiler does not
//! unroll loops over SIMD lanes, and keeps arrays that are indexed in a loop in memory.
//!
//! Gain in a batch, for each configuration: 209 → 139 instructions and 20 → 13 ns (planar2), 307 → 213 and 29 → 19 (planar3;
//! `docs/performance.md`). `tests/delassus.rs` compares rows of all lengths with the definitions.

use super::fused::{BodyAt, Sum};
use super::response::PointResponse;
use crate::algebra::Algebra;
use crate::prepare::{Hinge, HingeAngles, PreparedBody, Subspace};
use num_traits::One;

/// The pass for two hinges.
#[inline(always)]
pub(super) fn read_two<A: Algebra>(
    prepared: [&PreparedBody<A>; 2],
    arm: A::Vector,
    turned: &impl HingeAngles<A>,
    n: A::Vector,
) -> Answer<A, 2> {
    let b0 = BodyAt::<A, Hinge<A>>::at(prepared[0], 0, None, &[], turned);
    let b1 = BodyAt::<A, Hinge<A>>::at(prepared[1], 1, Some(b0.rotation), &[], turned);

    let f1 = b1.axis.momentum(&b1.composite);
    let m11 = b1.axis.project(f1) + prepared[1].rotor;
    let m10 = b0.axis.project(f1.shifted(b1.offset));
    let mut composite = b0.composite;
    composite += b1.composite.shifted(b1.offset);
    let m00 = b0.axis.project(b0.axis.momentum(&composite)) + prepared[0].rotor;

    let r1 = A::rotate(b1.rotation, arm);
    let j1 = b1.axis.at(r1);
    let r0 = A::plus(r1, b1.offset);
    let j0 = b0.axis.at(r0);
    let position = A::plus(r0, b0.offset);
    let l1 = A::size(r1);
    let l0 = l1 + A::size(b1.offset);

    let d1 = A::Scalar::one() / m11;
    let l10 = m10 * d1;
    let d0 = A::Scalar::one() / (m00 - l10 * m10);

    let (mut sum, x1) = Sum::<A>::of(j1, d1, n);
    let y0 = A::minus(j0, A::times(j1, l10));
    let x0 = sum.add(y0, d0, n);
    Answer {
        position,
        jacobian: [j0, j1],
        mass_matrix: [[m00, m10], [m10, m11]],
        delassus: sum.delassus,
        response: [x0, A::minus(x1, A::times(x0, l10))],
        mobility: sum.mobility,
        reduced_jacobian: [y0, j1],
        inverse_d: [d0, d1],
        levers: [l0, l1],
    }
}

/// The pass for three hinges.
#[inline(always)]
pub(super) fn read_three<A: Algebra>(
    prepared: [&PreparedBody<A>; 3],
    arm: A::Vector,
    turned: &impl HingeAngles<A>,
    n: A::Vector,
) -> Answer<A, 3> {
    let b0 = BodyAt::<A, Hinge<A>>::at(prepared[0], 0, None, &[], turned);
    let b1 = BodyAt::<A, Hinge<A>>::at(prepared[1], 1, Some(b0.rotation), &[], turned);
    let b2 = BodyAt::<A, Hinge<A>>::at(prepared[2], 2, Some(b1.rotation), &[], turned);

    let f2 = b2.axis.momentum(&b2.composite);
    let m22 = b2.axis.project(f2) + prepared[2].rotor;
    let f2 = f2.shifted(b2.offset);
    let m21 = b1.axis.project(f2);
    let m20 = b0.axis.project(f2.shifted(b1.offset));
    let mut composite = b1.composite;
    composite += b2.composite.shifted(b2.offset);
    let f1 = b1.axis.momentum(&composite);
    let m11 = b1.axis.project(f1) + prepared[1].rotor;
    let m10 = b0.axis.project(f1.shifted(b1.offset));
    let carried = composite.shifted(b1.offset);
    let mut composite = b0.composite;
    composite += carried;
    let m00 = b0.axis.project(b0.axis.momentum(&composite)) + prepared[0].rotor;

    let r2 = A::rotate(b2.rotation, arm);
    let j2 = b2.axis.at(r2);
    let r1 = A::plus(r2, b2.offset);
    let j1 = b1.axis.at(r1);
    let r0 = A::plus(r1, b1.offset);
    let j0 = b0.axis.at(r0);
    let position = A::plus(r0, b0.offset);
    let l2 = A::size(r2);
    let l1 = l2 + A::size(b2.offset);
    let l0 = l1 + A::size(b1.offset);

    let d2 = A::Scalar::one() / m22;
    let (l21, l20) = (m21 * d2, m20 * d2);
    let (e11, e10, e00) = (m11 - l21 * m21, m10 - l21 * m20, m00 - l20 * m20);
    let d1 = A::Scalar::one() / e11;
    let l10 = e10 * d1;
    let d0 = A::Scalar::one() / (e00 - l10 * e10);

    let (mut sum, x2) = Sum::<A>::of(j2, d2, n);
    let y1 = A::minus(j1, A::times(j2, l21));
    let x1 = sum.add(y1, d1, n);
    let y0 = A::minus(A::minus(j0, A::times(j2, l20)), A::times(y1, l10));
    let x0 = sum.add(y0, d0, n);
    let x1 = A::minus(x1, A::times(x0, l10));
    Answer {
        position,
        jacobian: [j0, j1, j2],
        mass_matrix: [[m00, m10, m20], [m10, m11, m21], [m20, m21, m22]],
        delassus: sum.delassus,
        response: [x0, x1, A::minus(A::minus(x2, A::times(x1, l21)), A::times(x0, l20))],
        mobility: sum.mobility,
        reduced_jacobian: [y0, y1, j2],
        inverse_d: [d0, d1, d2],
        levers: [l0, l1, l2],
    }
}

/// The results for N hinges.
pub(super) struct Answer<A: Algebra, const N: usize> {
    position: A::Vector,
    jacobian: [A::Vector; N],
    mass_matrix: [[A::Scalar; N]; N],
    delassus: [A::Vector; 3],
    response: [A::Vector; N],
    mobility: A::Scalar,
    reduced_jacobian: [A::Vector; N],
    inverse_d: [A::Scalar; N],
    levers: [A::Scalar; N],
}

impl<A: Algebra, const N: usize> Answer<A, N> {
    #[inline(always)]
    pub fn response(&self) -> PointResponse<'_, A> {
        PointResponse {
            position: self.position,
            jacobian: &self.jacobian,
            mass_matrix: self.mass_matrix.as_flattened(),
            delassus: self.delassus,
            response: &self.response,
            mobility: self.mobility,
            reduced_jacobian: &self.reduced_jacobian,
            inverse_d: &self.inverse_d,
            levers: &self.levers,
        }
    }
}

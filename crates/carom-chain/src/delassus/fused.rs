//! The fused pass, generic over the shape of the chain (see [`super`] for the symbols).

use super::PointResponse;
use super::row::HingeRow;
use crate::algebra::{Algebra, Real};
use crate::moves::Moves;
use crate::turned::Turned;
use num_traits::{One, Zero};
use std::ops::Range;

/// One body in the fused pass. Aligned, so that no vector of eight numbers crosses a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct BodyAt<A: Algebra, X: Moves<A>> {
    rotation: A::Rotation,
    offset: A::Vector,
    axis: X,
    composite: X::Inertia,
}

/// Output and scratch memory: `factor` has n rows of [`row_length`], M has n² and the others n entries.
pub(super) struct Memory<'a, A: Algebra> {
    pub factor: &'a mut [A::Scalar],
    pub by_depth: &'a mut [A::Vector],
    pub jacobian: &'a mut [A::Vector],
    pub mass_matrix: &'a mut [A::Scalar],
    pub felt: &'a mut [A::Vector],
    pub inverse_d: &'a mut [A::Scalar],
    pub response: &'a mut [A::Vector],
}

/// Whether `T` is one number and not SIMD lanes. Numbers stored one by one and read in pairs miss store forwarding, so
/// single numbers are kept in registers from one body to the next. Lanes are stored and read whole; in registers the
/// compiler would split and reassemble them.
const fn single<T>() -> bool {
    size_of::<T>() <= size_of::<f64>()
}

/// Number of entries of a row of the factor that are processed together, for single numbers.
const TOGETHER: usize = 4;

/// Length of a row of the factor of n bodies.
pub(super) const fn row_length<T>(n: usize) -> usize {
    if single::<T>() { n.next_multiple_of(TOGETHER) } else { n }
}

/// Subtracts `share` · row `k` of the factor from row `i`, up to the diagonal entry `last` of row `i`, rounded up to a
/// multiple of [`TOGETHER`]: entries beyond the diagonal are not used.
#[inline(always)]
fn subtract<T: Real>(rows: &mut [T], length: usize, i: usize, k: usize, share: T, last: usize) {
    if !single::<T>() {
        for b in (0..last + 1).rev() {
            let product = share * rows[k * length + b];
            rows[i * length + b] -= product;
        }
        return;
    }
    let mut b = 0;
    while b <= last {
        // All entries are read before one is written, so that the compiler vectorises the loop.
        let (mut entries, mut others) = ([T::zero(); TOGETHER], [T::zero(); TOGETHER]);
        others.copy_from_slice(&rows[k * length + b..][..TOGETHER]);
        let here = &mut rows[i * length + b..][..TOGETHER];
        entries.copy_from_slice(here);
        for (entry, other) in entries.iter_mut().zip(others) {
            *entry -= share * other;
        }
        here.copy_from_slice(&entries);
        b += TOGETHER;
    }
}

/// All results for the point at `arm` on the body [`Topology::point`]. `added`: inertia added to the diagonal of the factored
/// matrix, by coordinate; empty for none.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn read<'a, A: Algebra, S: Shape<A>>(
    shape: S,
    n: usize,
    arm: A::Vector,
    q: &[A::Scalar],
    turned: &impl Turned<A>,
    normal: A::Vector,
    added: &[A::Scalar],
    bodies: &mut [BodyAt<A, S::Axis>],
    mut memory: Memory<'a, A>,
) -> PointResponse<'a, A> {
    let bodies = &mut bodies[..n];
    outward(shape, bodies, q, turned);
    composite_rigid_body(shape, bodies, added, &mut memory);
    let position = jacobian(shape, bodies, arm, &mut memory);
    eliminate(shape, n, position, normal, memory)
}

/// Poses of all bodies.
#[inline(always)]
fn outward<A: Algebra, S: Shape<A>>(
    shape: S,
    bodies: &mut [BodyAt<A, S::Axis>],
    q: &[A::Scalar],
    turned: &impl Turned<A>,
) {
    let at_hand = single::<A::Scalar>();
    let mut before = A::no_rotation();
    for i in 0..bodies.len() {
        let outer = match shape.parent(i) {
            Some(p) if at_hand && p + 1 == i => Some(before),
            Some(p) => Some(bodies[p].rotation),
            None => None,
        };
        let body = shape.place(i, outer, q, turned);
        before = body.rotation;
        bodies[i] = body;
    }
}

/// Inward: composite inertias, and with each the column of M (see `mass_matrix_into`).
#[inline(always)]
fn composite_rigid_body<A: Algebra, S: Shape<A>>(
    shape: S,
    bodies: &mut [BodyAt<A, S::Axis>],
    added: &[A::Scalar],
    memory: &mut Memory<A>,
) {
    let (n, at_hand) = (bodies.len(), single::<A::Scalar>());
    let length = row_length::<A::Scalar>(n);
    let (rows, mass_matrix) = (&mut memory.factor[..n * length], &mut memory.mass_matrix[..n * n]);
    let mut carried = S::Axis::nothing();
    for i in (0..n).rev() {
        let mut composite = bodies[i].composite;
        if at_hand && i + 1 < n && shape.parent(i + 1) == Some(i) {
            composite += carried;
        }
        if let Some(p) = shape.parent(i) {
            carried = shape.shifted(i, &composite, bodies[i].offset);
            if !at_hand || p + 1 < i {
                bodies[p].composite += carried;
            }
        }
        let mut f = bodies[i].axis.momentum(&composite);
        let v = shape.coordinate(i);
        let own = bodies[i].axis.share(f);
        let depth = shape.depth(i);
        let row = &mut rows[i * length..][..=depth];
        (row[depth], mass_matrix[v * n + v]) = (own, own);
        if let Some(more) = added.get(v) {
            row[depth] += *more;
        }
        let mut shift = bodies[i].offset;
        let mut b = depth;
        for run in shape.runs(i) {
            for j in run.rev() {
                b -= 1;
                f = f.shifted(shift);
                let m = bodies[j].axis.share(f);
                shift = bodies[j].offset;
                let w = shape.coordinate(j);
                row[b] = m;
                (mass_matrix[v * n + w], mass_matrix[w * n + v]) = (m, m);
            }
        }
    }
}

/// From the point to the world: J. Returns the position of the point.
#[inline(always)]
fn jacobian<A: Algebra, S: Shape<A>>(
    shape: S,
    bodies: &[BodyAt<A, S::Axis>],
    arm: A::Vector,
    memory: &mut Memory<A>,
) -> A::Vector {
    let n = bodies.len();
    let (jacobian, felt) = (&mut memory.jacobian[..n], &mut memory.felt[..n]);
    let point = shape.point(n);
    let mut r = A::rotate(bodies[point].rotation, arm);
    let mut next = Some(point);
    while let Some(i) = next {
        let column = bodies[i].axis.at(r);
        let v = shape.coordinate(i);
        (jacobian[v], felt[v]) = (column, column);
        r = A::plus(r, bodies[i].offset);
        next = shape.parent(i);
    }
    r
}

/// M = Lᵀ D L, with the rows of M in `factor`, indexed by the depths of the body's ancestors, and J in `felt`. As soon as a
/// row is known, its parts of Y = L⁻ᵀ Jᵀ and of H = Yᵀ D⁻¹ Y are computed, which hides the latency of the divisions.
#[inline(always)]
pub(super) fn eliminate<'a, A: Algebra>(
    shape: impl Topology,
    n: usize,
    position: A::Vector,
    normal: A::Vector,
    memory: Memory<'a, A>,
) -> PointResponse<'a, A> {
    let length = row_length::<A::Scalar>(n);
    let (rows, by_depth) = (&mut memory.factor[..n * length], &mut memory.by_depth[..n]);
    let (felt, inverse_d) = (&mut memory.felt[..n], &mut memory.inverse_d[..n]);
    let response = &mut memory.response[..n];
    let mut sum = Sum::<A> { delassus: [A::zero(); 3], mobility: A::Scalar::zero() };
    let mut on_the_way = Some(shape.point(n));
    for k in shape.moved(n).rev() {
        let depth = shape.depth(k);
        let inverse = A::Scalar::one() / rows[k * length + depth];
        let mut a = depth;
        for run in shape.runs(k) {
            for i in run.rev() {
                a -= 1;
                let share = rows[k * length + a] * inverse;
                subtract(rows, length, i, k, share, a);
            }
        }
        rows[k * length + depth] = inverse;
        let v = shape.coordinate(k);
        inverse_d[v] = inverse;
        if on_the_way != Some(k) {
            response[v] = A::zero();
            continue;
        }
        on_the_way = shape.parent(k);
        let scaled = sum.add(felt[v], inverse, normal);
        response[v] = scaled;
        let mut a = depth;
        for run in shape.runs(k) {
            for i in run.rev() {
                a -= 1;
                let w = shape.coordinate(i);
                felt[w] = A::minus(felt[w], A::times(scaled, rows[k * length + a]));
            }
        }
    }

    // Outward: M⁻¹Jᵀ = X = L⁻¹ (D⁻¹ Y). Bodies are numbered depth first: the last body of each smaller depth is an ancestor.
    for i in shape.moved(n) {
        let v = shape.coordinate(i);
        let depth = shape.depth(i);
        let mut carried = A::zero();
        for (b, x) in by_depth[..depth].iter().enumerate() {
            carried = A::plus(carried, A::times(*x, rows[i * length + b]));
        }
        let x = A::minus(response[v], A::times(carried, rows[i * length + depth]));
        (by_depth[depth], response[v]) = (x, x);
    }
    let Sum { delassus, mobility } = sum;
    let Memory { jacobian, mass_matrix, .. } = memory;
    PointResponse { position, jacobian, mass_matrix, delassus, response, mobility, felt, inverse_d }
}

/// The kernel for two hinges, unrolled: the same operations in the same order. The compiler does not unroll loops over
/// SIMD lanes, and keeps arrays that are indexed in a loop in memory.
#[inline(always)]
pub(super) fn read_two<A: Algebra>(
    row: &HingeRow<A>,
    arm: A::Vector,
    turned: &impl Turned<A>,
    n: A::Vector,
) -> Answer<A, 2> {
    let b0 = row.place(0, None, &[], turned);
    let b1 = row.place(1, Some(b0.rotation), &[], turned);

    let f1 = b1.axis.momentum(&b1.composite);
    let m11 = b1.axis.share(f1);
    let m10 = b0.axis.share(f1.shifted(b1.offset));
    let mut composite = b0.composite;
    composite += b1.composite.shifted(b1.offset);
    let m00 = b0.axis.share(b0.axis.momentum(&composite));

    let r1 = A::rotate(b1.rotation, arm);
    let j1 = b1.axis.at(r1);
    let r0 = A::plus(r1, b1.offset);
    let j0 = b0.axis.at(r0);
    let position = A::plus(r0, b0.offset);

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
        felt: [y0, j1],
        inverse_d: [d0, d1],
    }
}

/// The kernel for three hinges, unrolled.
#[inline(always)]
pub(super) fn read_three<A: Algebra>(
    row: &HingeRow<A>,
    arm: A::Vector,
    turned: &impl Turned<A>,
    n: A::Vector,
) -> Answer<A, 3> {
    let b0 = row.place(0, None, &[], turned);
    let b1 = row.place(1, Some(b0.rotation), &[], turned);
    let b2 = row.place(2, Some(b1.rotation), &[], turned);

    let f2 = b2.axis.momentum(&b2.composite);
    let m22 = b2.axis.share(f2);
    let f2 = f2.shifted(b2.offset);
    let m21 = b1.axis.share(f2);
    let m20 = b0.axis.share(f2.shifted(b1.offset));
    let mut composite = b1.composite;
    composite += b2.composite.shifted(b2.offset);
    let f1 = b1.axis.momentum(&composite);
    let m11 = b1.axis.share(f1);
    let m10 = b0.axis.share(f1.shifted(b1.offset));
    let carried = composite.shifted(b1.offset);
    let mut composite = b0.composite;
    composite += carried;
    let m00 = b0.axis.share(b0.axis.momentum(&composite));

    let r2 = A::rotate(b2.rotation, arm);
    let j2 = b2.axis.at(r2);
    let r1 = A::plus(r2, b2.offset);
    let j1 = b1.axis.at(r1);
    let r0 = A::plus(r1, b1.offset);
    let j0 = b0.axis.at(r0);
    let position = A::plus(r0, b0.offset);

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
        felt: [y0, y1, j2],
        inverse_d: [d0, d1, d2],
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
    felt: [A::Vector; N],
    inverse_d: [A::Scalar; N],
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
            felt: &self.felt,
            inverse_d: &self.inverse_d,
        }
    }
}

/// H = Yᵀ D⁻¹ Y and nᵀHn, accumulated joint by joint.
struct Sum<A: Algebra> {
    delassus: [A::Vector; 3],
    mobility: A::Scalar,
}

impl<A: Algebra> Sum<A> {
    /// The contribution of one joint with row `y` and 1/D, and its row of D⁻¹ Y.
    #[inline(always)]
    fn of(y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> (Self, A::Vector) {
        let scaled = A::times(y, inverse_d);
        let mut delassus = [A::zero(); 3];
        for (c, column) in delassus[..A::LINEAR].iter_mut().enumerate() {
            *column = A::times(y, A::linear_part(scaled, c));
        }
        let along = A::dot(y, normal);
        (Self { delassus, mobility: along * (along * inverse_d) }, scaled)
    }

    /// Adds the contribution of another joint; returns its row of D⁻¹ Y.
    #[inline(always)]
    fn add(&mut self, y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> A::Vector {
        let (other, scaled) = Self::of(y, inverse_d, normal);
        for c in 0..A::LINEAR {
            self.delassus[c] = A::plus(self.delassus[c], other.delassus[c]);
        }
        self.mobility += other.mobility;
        scaled
    }
}

/// The structure of M: which entries of its factor are not zero.
pub(super) trait Topology: Copy {
    /// The ancestors of body `i`, from its parent to the world, as runs of consecutive indices, each to be visited backwards.
    fn runs(self, i: usize) -> impl Iterator<Item = Range<usize>>;
    fn parent(self, i: usize) -> Option<usize>;
    /// Number of ancestors of body `i`.
    fn depth(self, i: usize) -> usize;
    fn coordinate(self, i: usize) -> usize;
    /// The body that the point is fixed to, in a chain of n bodies.
    fn point(self, n: usize) -> usize;
    /// The bodies that an impulse at the point moves: the branch of the point.
    fn moved(self, n: usize) -> Range<usize>;
}

/// The structure of a chain, and its bodies.
pub(super) trait Shape<A: Algebra>: Topology {
    type Axis: Moves<A>;
    /// Body `i`, for the rotation `outer` of its parent.
    fn place(
        self,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> BodyAt<A, Self::Axis>;
    /// Composite inertia of body `i`, about the point at −r.
    fn shifted(self, i: usize, inertia: &Carried<A, Self>, r: A::Vector) -> Carried<A, Self>;
}

/// Type of the composite inertia of a shape.
pub(super) type Carried<A, S> = <<S as Shape<A>>::Axis as Moves<A>>::Inertia;

impl<A: Algebra, X: Moves<A>> BodyAt<A, X> {
    #[inline(always)]
    pub fn at(rotation: A::Rotation, offset: A::Vector, axis: X, composite: X::Inertia) -> Self {
        Self { rotation, offset, axis, composite }
    }

    /// Initial contents, to be overwritten.
    pub fn new() -> Self {
        Self::at(A::no_rotation(), A::zero(), X::still(), X::nothing())
    }
}

//! The fused pass, generic over the structure of the chain and over its joints (see [`super`] for the symbols).

use super::response::PointResponse;
use super::topology::Topology;
use crate::algebra::{Algebra, Real};
use crate::prepare::{HingeAngles, PreparedBody, Subspace};
use crate::scratch::Link;
use num_traits::{One, Zero};

/// One body in the fused pass. Aligned, so that no vector of eight numbers crosses a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct BodyAt<A: Algebra, X: Subspace<A>> {
    pub rotation: A::Rotation,
    pub offset: A::Vector,
    pub axis: X,
    pub composite: X::Inertia,
}

/// Output and scratch memory: `factor` has n rows of [`row_length`], M has n² and the others n entries.
pub(super) struct Memory<'a, A: Algebra> {
    pub factor: &'a mut [A::Scalar],
    pub by_depth: &'a mut [A::Vector],
    pub jacobian: &'a mut [A::Vector],
    pub mass_matrix: &'a mut [A::Scalar],
    pub reduced_jacobian: &'a mut [A::Vector],
    pub inverse_d: &'a mut [A::Scalar],
    pub levers: &'a mut [A::Scalar],
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

/// Where the pass takes the poses of the bodies from. It is a trait because inlining of a closure cannot be forced.
pub(super) trait Poses<A: Algebra> {
    /// Writes all bodies, without their children's inertia.
    fn write<X: Subspace<A>>(&self, topology: impl Topology, prepared: &[PreparedBody<A>], bodies: &mut [BodyAt<A, X>]);
}

/// The poses at q, for the sines and cosines of the hinges' angles.
pub(super) struct At<'a, A: Algebra, U> {
    pub q: &'a [A::Scalar],
    pub turned: &'a U,
}

impl<A: Algebra, U: HingeAngles<A>> Poses<A> for At<'_, A, U> {
    #[inline(always)]
    fn write<X: Subspace<A>>(
        &self,
        topology: impl Topology,
        prepared: &[PreparedBody<A>],
        bodies: &mut [BodyAt<A, X>],
    ) {
        let from_registers = single::<A::Scalar>();
        let mut before = A::no_rotation();
        for i in 0..bodies.len() {
            let outer = match topology.parent(i) {
                Some(p) if from_registers && p + 1 == i => Some(before),
                Some(p) => Some(bodies[p].rotation),
                None => None,
            };
            let body = BodyAt::at(&prepared[i], i, outer, self.q, self.turned);
            before = body.rotation;
            bodies[i] = body;
        }
    }
}

/// The poses of a workspace.
impl<A: Algebra> Poses<A> for [Link<A>] {
    #[inline(always)]
    fn write<X: Subspace<A>>(&self, _: impl Topology, prepared: &[PreparedBody<A>], bodies: &mut [BodyAt<A, X>]) {
        for ((at, body), link) in bodies.iter_mut().zip(prepared).zip(self) {
            let (axis, composite) = (X::of(body, link), X::own(body, link.rotation));
            *at = BodyAt { rotation: link.rotation, offset: link.offset, axis, composite };
        }
    }
}

/// All results for the point at `arm` on the body [`Topology::point`]. `added`: inertia added to the diagonal of the factored
/// matrix, by coordinate; empty for none.
#[inline(always)]
pub(super) fn read<'a, A: Algebra, X: Subspace<A>>(
    topology: impl Topology,
    prepared: &[PreparedBody<A>],
    bodies: &mut [BodyAt<A, X>],
    arm: A::Vector,
    normal: A::Vector,
    added: &[A::Scalar],
    mut memory: Memory<'a, A>,
) -> PointResponse<'a, A> {
    composite_rigid_body(topology, prepared, bodies, added, &mut memory);
    let position = jacobian(topology, prepared, bodies, arm, &mut memory);
    eliminate(topology, bodies.len(), position, normal, memory)
}

/// Inward: composite inertias, and with each the column of M (see `mass_matrix_into`).
#[inline(always)]
fn composite_rigid_body<A: Algebra, X: Subspace<A>>(
    topology: impl Topology,
    prepared: &[PreparedBody<A>],
    bodies: &mut [BodyAt<A, X>],
    added: &[A::Scalar],
    memory: &mut Memory<A>,
) {
    let (n, from_registers) = (bodies.len(), single::<A::Scalar>());
    let length = row_length::<A::Scalar>(n);
    let (rows, mass_matrix) = (&mut memory.factor[..n * length], &mut memory.mass_matrix[..n * n]);
    let mut carried = X::nothing();
    for i in (0..n).rev() {
        let mut composite = bodies[i].composite;
        if from_registers && i + 1 < n && topology.parent(i + 1) == Some(i) {
            composite += carried;
        }
        if let Some(p) = topology.parent(i) {
            carried = X::shifted(&prepared[i], &composite, bodies[i].offset);
            if !from_registers || p + 1 < i {
                bodies[p].composite += carried;
            }
        }
        let mut f = bodies[i].axis.momentum(&composite);
        let v = topology.coordinate(i);
        let own = bodies[i].axis.project(f) + prepared[i].rotor;
        let depth = topology.depth(i);
        let row = &mut rows[i * length..][..=depth];
        (row[depth], mass_matrix[v * n + v]) = (own, own);
        if let Some(more) = added.get(v) {
            row[depth] += *more;
        }
        let mut shift = bodies[i].offset;
        let mut b = depth;
        for run in topology.runs(i) {
            for j in run.rev() {
                b -= 1;
                f = f.shifted(shift);
                let m = bodies[j].axis.project(f);
                shift = bodies[j].offset;
                let w = topology.coordinate(j);
                row[b] = m;
                (mass_matrix[v * n + w], mass_matrix[w * n + v]) = (m, m);
            }
        }
    }
}

/// From the point to the world: J and the levers. Returns the position of the point.
#[inline(always)]
fn jacobian<A: Algebra, X: Subspace<A>>(
    topology: impl Topology,
    prepared: &[PreparedBody<A>],
    bodies: &[BodyAt<A, X>],
    arm: A::Vector,
    memory: &mut Memory<A>,
) -> A::Vector {
    let n = bodies.len();
    let (jacobian, reduced_jacobian) = (&mut memory.jacobian[..n], &mut memory.reduced_jacobian[..n]);
    let levers = &mut memory.levers[..n];
    let point = topology.point(n);
    let mut r = A::rotate(bodies[point].rotation, arm);
    let mut reach = A::size(r);
    let mut next = Some(point);
    while let Some(i) = next {
        let column = bodies[i].axis.at(r);
        let v = topology.coordinate(i);
        (jacobian[v], reduced_jacobian[v]) = (column, column);
        levers[v] = bodies[i].axis.lever(reach);
        r = A::plus(r, bodies[i].offset);
        reach += prepared[i].length(bodies[i].offset);
        next = topology.parent(i);
    }
    r
}

/// M = Lᵀ D L, with the rows of M in `factor`, indexed by the depths of the body's ancestors, and J in `reduced_jacobian`. As soon as a
/// row is known, its parts of Y = L⁻ᵀ Jᵀ and of H = Yᵀ D⁻¹ Y are computed, which hides the latency of the divisions.
#[inline(always)]
pub(super) fn eliminate<'a, A: Algebra>(
    topology: impl Topology,
    n: usize,
    position: A::Vector,
    normal: A::Vector,
    memory: Memory<'a, A>,
) -> PointResponse<'a, A> {
    let length = row_length::<A::Scalar>(n);
    let (rows, by_depth) = (&mut memory.factor[..n * length], &mut memory.by_depth[..n]);
    let (reduced_jacobian, inverse_d) = (&mut memory.reduced_jacobian[..n], &mut memory.inverse_d[..n]);
    let response = &mut memory.response[..n];
    let mut sum = Sum::<A> { delassus: [A::zero(); 3], mobility: A::Scalar::zero() };
    let mut on_the_way = Some(topology.point(n));
    for k in topology.moved(n).rev() {
        let depth = topology.depth(k);
        let inverse = A::Scalar::one() / rows[k * length + depth];
        let mut a = depth;
        for run in topology.runs(k) {
            for i in run.rev() {
                a -= 1;
                let share = rows[k * length + a] * inverse;
                subtract(rows, length, i, k, share, a);
            }
        }
        rows[k * length + depth] = inverse;
        let v = topology.coordinate(k);
        inverse_d[v] = inverse;
        if on_the_way != Some(k) {
            response[v] = A::zero();
            continue;
        }
        on_the_way = topology.parent(k);
        let scaled = sum.add(reduced_jacobian[v], inverse, normal);
        response[v] = scaled;
        let mut a = depth;
        for run in topology.runs(k) {
            for i in run.rev() {
                a -= 1;
                let w = topology.coordinate(i);
                reduced_jacobian[w] = A::minus(reduced_jacobian[w], A::times(scaled, rows[k * length + a]));
            }
        }
    }

    // Outward: M⁻¹Jᵀ = X = L⁻¹ (D⁻¹ Y). Bodies are numbered depth first: the last body of each smaller depth is an ancestor.
    for i in topology.moved(n) {
        let v = topology.coordinate(i);
        let depth = topology.depth(i);
        let mut carried = A::zero();
        for (b, x) in by_depth[..depth].iter().enumerate() {
            carried = A::plus(carried, A::times(*x, rows[i * length + b]));
        }
        let x = A::minus(response[v], A::times(carried, rows[i * length + depth]));
        (by_depth[depth], response[v]) = (x, x);
    }
    let Sum { delassus, mobility } = sum;
    let Memory { jacobian, mass_matrix, levers, .. } = memory;
    PointResponse { position, jacobian, mass_matrix, delassus, response, mobility, reduced_jacobian, inverse_d, levers }
}

/// H = Yᵀ D⁻¹ Y and nᵀHn, accumulated joint by joint.
pub(super) struct Sum<A: Algebra> {
    pub delassus: [A::Vector; 3],
    pub mobility: A::Scalar,
}

impl<A: Algebra> Sum<A> {
    /// The contribution of one joint with row `y` and 1/D, and its row of D⁻¹ Y.
    #[inline(always)]
    pub fn of(y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> (Self, A::Vector) {
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
    pub fn add(&mut self, y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> A::Vector {
        let (other, scaled) = Self::of(y, inverse_d, normal);
        for c in 0..A::LINEAR {
            self.delassus[c] = A::plus(self.delassus[c], other.delassus[c]);
        }
        self.mobility += other.mobility;
        scaled
    }
}

impl<A: Algebra, X: Subspace<A>> BodyAt<A, X> {
    /// Body `i`, for the rotation `outer` of its parent, without its children's inertia.
    #[inline(always)]
    pub fn at(
        body: &PreparedBody<A>,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl HingeAngles<A>,
    ) -> Self {
        let (rotation, offset) = X::place(body, i, outer, q, turned);
        Self { rotation, offset, axis: X::at_rotation(body, rotation), composite: X::own(body, rotation) }
    }

    /// Initial contents, to be overwritten.
    pub fn new() -> Self {
        Self { rotation: A::no_rotation(), offset: A::zero(), axis: X::still(), composite: X::nothing() }
    }
}

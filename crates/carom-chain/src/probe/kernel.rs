//! The kernel: one source for every shape of chain (see [`super`] for the symbols).

use super::row::HingeRow;
use super::{Found, Turned};
use crate::algebra::{Algebra, Force};
use num_traits::{One, Zero};
use std::ops::{AddAssign, Range};

/// The scratch memory of one body. Aligned, so that no vector of eight lies across two lines of the cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Link<A: Algebra, X: Moves<A>> {
    rotation: A::Rotation,
    offset: A::Vector,
    axis: X,
    composite: X::Inertia,
    felt: A::Vector,
}

/// Where the kernel writes: `links`, `jacobian`, `joint_impulse` and `response` have n entries, the others n².
pub(super) struct Memory<'a, A: Algebra, X: Moves<A>> {
    pub links: &'a mut [Link<A, X>],
    pub factor: &'a mut [A::Scalar],
    pub jacobian: &'a mut [A::Vector],
    pub mass_matrix: &'a mut [A::Scalar],
    pub joint_impulse: &'a mut [A::Scalar],
    pub response: &'a mut [A::Scalar],
}

/// Everything about the point at `arm` on the shape's last body, or the one it names.
#[inline(always)]
pub(super) fn read<'a, A: Algebra, S: Shape<A>>(
    shape: S,
    n: usize,
    arm: A::Vector,
    q: &[A::Scalar],
    turned: &impl Turned<A>,
    normal: A::Vector,
    memory: Memory<'a, A, S::Axis>,
) -> Found<'a, A> {
    let links = &mut memory.links[..n];
    let l = &mut memory.factor[..n * n];
    let (jacobian, mass_matrix) = (&mut memory.jacobian[..n], &mut memory.mass_matrix[..n * n]);
    let (joint_impulse, response) = (&mut memory.joint_impulse[..n], &mut memory.response[..n]);

    // Outward: where everything is. What body i − 1 hands to body i, and body i + 1 on the way inward, stays at hand: read
    // from memory, where numbers were just stored one by one, pairs of them would wait for the cache.
    let mut before = A::no_rotation();
    for i in 0..n {
        let outer = shape.parent(i).map(|p| if p + 1 == i { before } else { links[p].rotation });
        let link = shape.place(i, outer, q, turned);
        before = link.rotation;
        links[i] = link;
    }

    // Inward: composite inertias, and with each the column of M (see `mass_matrix_into`).
    let mut carried = S::Axis::nothing();
    for i in (0..n).rev() {
        let mut composite = links[i].composite;
        if i + 1 < n && shape.parent(i + 1) == Some(i) {
            composite += carried;
        }
        if let Some(p) = shape.parent(i) {
            carried = shape.shifted(i, &composite, links[i].offset);
            if p + 1 < i {
                links[p].composite += carried;
            }
        }
        let mut f = links[i].axis.momentum(&composite);
        let v = shape.coordinate(i);
        let own = links[i].axis.share(f);
        (l[i * n + i], mass_matrix[v * n + v]) = (own, own);
        let mut shift = links[i].offset;
        for j in shape.below(i) {
            f = f.shifted(shift);
            let m = links[j].axis.share(f);
            shift = links[j].offset;
            let w = shape.coordinate(j);
            l[i * n + j] = m;
            (mass_matrix[v * n + w], mass_matrix[w * n + v]) = (m, m);
        }
    }

    // From the point down: J.
    let point = shape.point(n);
    let mut r = A::rotate(links[point].rotation, arm);
    let mut next = Some(point);
    while let Some(i) = next {
        let felt = links[i].axis.at(r);
        links[i].felt = felt;
        let v = shape.coordinate(i);
        (jacobian[v], joint_impulse[v]) = (felt, A::dot(felt, normal));
        r += links[i].offset;
        next = shape.parent(i);
    }
    let position = r;

    // M = Lᵀ D L in place, and with each row of L, once it is there, Y = L⁻ᵀ Jᵀ from the point down and H = Yᵀ D⁻¹ Y:
    // together, because each division keeps the next row waiting.
    let mut sum = Sum::<A> { delassus: [A::zero(); 3], mobility: A::Scalar::zero() };
    let mut on_the_way = Some(point);
    for k in shape.moved(n).rev() {
        let inverse_d = A::Scalar::one() / l[k * n + k];
        for i in shape.below(k) {
            let a = l[k * n + i] * inverse_d;
            l[i * n + i] -= a * l[k * n + i];
            for j in shape.below(i) {
                let product = a * l[k * n + j];
                l[i * n + j] -= product;
            }
            l[k * n + i] = a;
        }
        if on_the_way == Some(k) {
            let y = links[k].felt;
            response[shape.coordinate(k)] = sum.add(y, inverse_d, normal);
            on_the_way = shape.parent(k);
            for i in shape.below(k) {
                let product = y * l[k * n + i];
                links[i].felt -= product;
            }
        }
    }

    // Outward: M⁻¹Jᵀn = L⁻¹ (D⁻¹ Y n).
    for i in shape.moved(n) {
        let v = shape.coordinate(i);
        let mut x = response[v];
        for j in shape.below(i) {
            x -= l[i * n + j] * response[shape.coordinate(j)];
        }
        response[v] = x;
    }
    let Sum { delassus, mobility } = sum;
    Found { position, jacobian, mass_matrix, delassus, joint_impulse, response, mobility }
}

/// The kernel for two hinges, written out: the same operations in the same order, without a loop. The compiler does not
/// unroll loops over lanes, and what is in arrays that a loop walks stays in memory.
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
    let r0 = r1 + b1.offset;
    let j0 = b0.axis.at(r0);
    let position = r0 + b0.offset;

    let d1 = A::Scalar::one() / m11;
    let l10 = m10 * d1;
    let d0 = A::Scalar::one() / (m00 - l10 * m10);

    let (mut sum, x1) = Sum::<A>::of(j1, d1, n);
    let x0 = sum.add(j0 - j1 * l10, d0, n);
    Answer {
        position,
        jacobian: [j0, j1],
        mass_matrix: [[m00, m10], [m10, m11]],
        delassus: sum.delassus,
        joint_impulse: [A::dot(j0, n), A::dot(j1, n)],
        response: [x0, x1 - l10 * x0],
        mobility: sum.mobility,
    }
}

/// The kernel for three hinges, written out.
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
    let r1 = r2 + b2.offset;
    let j1 = b1.axis.at(r1);
    let r0 = r1 + b1.offset;
    let j0 = b0.axis.at(r0);
    let position = r0 + b0.offset;

    let d2 = A::Scalar::one() / m22;
    let (l21, l20) = (m21 * d2, m20 * d2);
    let (e11, e10, e00) = (m11 - l21 * m21, m10 - l21 * m20, m00 - l20 * m20);
    let d1 = A::Scalar::one() / e11;
    let l10 = e10 * d1;
    let d0 = A::Scalar::one() / (e00 - l10 * e10);

    let (mut sum, x2) = Sum::<A>::of(j2, d2, n);
    let y1 = j1 - j2 * l21;
    let x1 = sum.add(y1, d1, n);
    let x0 = sum.add((j0 - j2 * l20) - y1 * l10, d0, n);
    let x1 = x1 - l10 * x0;
    Answer {
        position,
        jacobian: [j0, j1, j2],
        mass_matrix: [[m00, m10, m20], [m10, m11, m21], [m20, m21, m22]],
        delassus: sum.delassus,
        joint_impulse: [A::dot(j0, n), A::dot(j1, n), A::dot(j2, n)],
        response: [x0, x1, (x2 - l21 * x1) - l20 * x0],
        mobility: sum.mobility,
    }
}

/// What is found of N hinges.
pub(super) struct Answer<A: Algebra, const N: usize> {
    position: A::Vector,
    jacobian: [A::Vector; N],
    mass_matrix: [[A::Scalar; N]; N],
    delassus: [A::Vector; 3],
    joint_impulse: [A::Scalar; N],
    response: [A::Scalar; N],
    mobility: A::Scalar,
}

impl<A: Algebra, const N: usize> Answer<A, N> {
    #[inline(always)]
    pub fn found(&self) -> Found<'_, A> {
        Found {
            position: self.position,
            jacobian: &self.jacobian,
            mass_matrix: self.mass_matrix.as_flattened(),
            delassus: self.delassus,
            joint_impulse: &self.joint_impulse,
            response: &self.response,
            mobility: self.mobility,
        }
    }
}

/// H = Yᵀ D⁻¹ Y and nᵀHn, joint by joint.
struct Sum<A: Algebra> {
    delassus: [A::Vector; 3],
    mobility: A::Scalar,
}

impl<A: Algebra> Sum<A> {
    /// What one joint with row `y` and 1/D gives, and its entry of D⁻¹ Y n.
    #[inline(always)]
    fn of(y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> (Self, A::Scalar) {
        let scaled = y * inverse_d;
        let column = |c: usize| if c < A::LINEAR { y * A::linear_part(scaled, c) } else { A::zero() };
        let along = A::dot(y, normal);
        let moved = along * inverse_d;
        (Self { delassus: [column(0), column(1), column(2)], mobility: along * moved }, moved)
    }

    /// Adds another joint.
    #[inline(always)]
    fn add(&mut self, y: A::Vector, inverse_d: A::Scalar, normal: A::Vector) -> A::Scalar {
        let (other, moved) = Self::of(y, inverse_d, normal);
        for c in 0..A::LINEAR {
            self.delassus[c] += other.delassus[c];
        }
        self.mobility += other.mobility;
        moved
    }
}

/// What the kernel need not look up, body by body.
pub(super) trait Shape<A: Algebra>: Copy {
    type Axis: Moves<A>;
    /// The bodies that carry body `i`, from its parent down to the world.
    fn below(self, i: usize) -> impl Iterator<Item = usize>;
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        self.below(i).next()
    }
    fn coordinate(self, i: usize) -> usize;
    /// The body that carries the point, of n.
    fn point(self, n: usize) -> usize;
    /// The bodies that an impulse at the point moves: all that hang from the world where the point does.
    fn moved(self, n: usize) -> Range<usize>;
    /// Body `i`, whose parent has the rotation `outer`.
    fn place(
        self,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> Link<A, Self::Axis>;
    /// What body `i` carries, about the point at −r.
    fn shifted(self, i: usize, inertia: &Carried<A, Self>, r: A::Vector) -> Carried<A, Self>;
}

/// The inertia that the joints of a shape carry.
pub(super) type Carried<A, S> = <<S as Shape<A>>::Axis as Moves<A>>::Inertia;

/// An axis that a joint moves along, in world axes about the joint's own origin, and the inertia that it moves.
pub(super) trait Moves<A: Algebra>: Copy {
    type Inertia: Copy + AddAssign;
    /// An axis of length zero.
    fn still() -> Self;
    /// No inertia.
    fn nothing() -> Self::Inertia;
    /// I s
    fn momentum(self, inertia: &Self::Inertia) -> Force<A>;
    /// s · f
    fn share(self, force: Force<A>) -> A::Scalar;
    /// The velocity that unit rate gives the point r away.
    fn at(self, r: A::Vector) -> A::Vector;
}

impl<A: Algebra, X: Moves<A>> Link<A, X> {
    #[inline(always)]
    pub fn at(rotation: A::Rotation, offset: A::Vector, axis: X, composite: X::Inertia) -> Self {
        Self { rotation, offset, axis, composite, felt: A::zero() }
    }

    /// Memory, to be written.
    pub fn new() -> Self {
        Self::at(A::no_rotation(), A::zero(), X::still(), X::nothing())
    }
}

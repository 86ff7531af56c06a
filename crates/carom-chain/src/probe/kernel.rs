//! The kernel: one source for every shape of chain (see [`super`] for the symbols).

use super::row::{HingeRow, Turning};
use super::{Angle, Found, Turned};
use crate::algebra::{Algebra, Axis, Force, Inertia};
use crate::chain::Body;
use num_traits::{One, Zero};
use std::ops::AddAssign;

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

    // Outward: where everything is.
    for i in 0..n {
        let outer = shape.parent(i).map(|p| links[p].rotation);
        links[i] = shape.place(i, outer, q, turned);
    }

    // Inward: composite inertias, and with each the column of M (see `mass_matrix_into`).
    for i in (0..n).rev() {
        let composite = links[i].composite;
        if let Some(p) = shape.parent(i) {
            let carried = S::Axis::shifted(&composite, links[i].offset);
            links[p].composite += carried;
        }
        let mut f = links[i].axis.momentum(&composite);
        let v = shape.coordinate(i);
        let own = links[i].axis.share(f);
        (l[i * n + i], mass_matrix[v * n + v]) = (own, own);
        let mut j = i;
        while let Some(p) = shape.parent(j) {
            f = f.shifted(links[j].offset);
            j = p;
            let m = links[j].axis.share(f);
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
    for k in (0..n).rev() {
        let inverse_d = A::Scalar::one() / l[k * n + k];
        let mut next = shape.parent(k);
        while let Some(i) = next {
            let a = l[k * n + i] * inverse_d;
            let mut beyond = Some(i);
            while let Some(j) = beyond {
                let product = a * l[k * n + j];
                l[i * n + j] -= product;
                beyond = shape.parent(j);
            }
            l[k * n + i] = a;
            next = shape.parent(i);
        }
        if on_the_way == Some(k) {
            let y = links[k].felt;
            response[shape.coordinate(k)] = sum.add(y, inverse_d, normal);
            on_the_way = shape.parent(k);
            let mut beyond = on_the_way;
            while let Some(i) = beyond {
                let product = y * l[k * n + i];
                links[i].felt -= product;
                beyond = shape.parent(i);
            }
        }
    }

    // Outward: M⁻¹Jᵀn = L⁻¹ (D⁻¹ Y n).
    for i in 0..n {
        let v = shape.coordinate(i);
        let mut x = response[v];
        let mut next = shape.parent(i);
        while let Some(j) = next {
            x -= l[i * n + j] * response[shape.coordinate(j)];
            next = shape.parent(j);
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
) -> Few<A, 2> {
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
    Few {
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
) -> Few<A, 3> {
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
    Few {
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
pub(super) struct Few<A: Algebra, const N: usize> {
    position: A::Vector,
    jacobian: [A::Vector; N],
    mass_matrix: [[A::Scalar; N]; N],
    delassus: [A::Vector; 3],
    joint_impulse: [A::Scalar; N],
    response: [A::Scalar; N],
    mobility: A::Scalar,
}

impl<A: Algebra, const N: usize> Few<A, N> {
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
    fn parent(self, i: usize) -> Option<usize>;
    fn coordinate(self, i: usize) -> usize;
    /// The body that carries the point, of n.
    fn point(self, n: usize) -> usize;
    /// Body `i`, whose parent has the rotation `outer`.
    fn place(
        self,
        i: usize,
        outer: Option<A::Rotation>,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> Link<A, Self::Axis>;
}

/// An axis that a joint moves along, in world axes about the joint's own origin, and the inertia that it moves.
pub(super) trait Moves<A: Algebra>: Copy {
    type Inertia: Copy + AddAssign;
    fn still() -> (Self, Self::Inertia);
    /// The same inertia about the point at −r.
    fn shifted(inertia: &Self::Inertia, r: A::Vector) -> Self::Inertia;
    /// I s
    fn momentum(self, inertia: &Self::Inertia) -> Force<A>;
    /// s · f
    fn share(self, force: Force<A>) -> A::Scalar;
    /// The velocity that unit rate gives the point r away.
    fn at(self, r: A::Vector) -> A::Vector;
}

impl<A: Algebra, X: Moves<A>> Link<A, X> {
    #[inline(always)]
    fn at(rotation: A::Rotation, offset: A::Vector, axis: X, composite: X::Inertia) -> Self {
        Self { rotation, offset, axis, composite, felt: A::zero() }
    }

    /// Memory, to be written.
    #[inline(always)]
    pub fn new() -> Self {
        let (axis, inertia) = X::still();
        Self::at(A::no_rotation(), A::zero(), axis, inertia)
    }
}

/// Hinges one after another, in the order of their coordinates, the point on the last.
impl<A: Algebra> Shape<A> for &HingeRow<A> {
    type Axis = Hinge<A>;
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        i.checked_sub(1)
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn point(self, n: usize) -> usize {
        n - 1
    }
    #[inline(always)]
    fn place(
        self,
        i: usize,
        outer: Option<A::Rotation>,
        _: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> Link<A, Hinge<A>> {
        let body = &self.bodies[i];
        let (placed, offset) = match outer {
            None => (self.base, body.offset),
            Some(outer) => (A::tilt(outer, body.tilt.0, body.tilt.1), A::rotate(outer, body.offset)),
        };
        let (sin, cos) = turned.sin_cos(i, body.angle(i));
        let rotation = A::turn(placed, sin, cos);
        Link::at(rotation, offset, Hinge(A::hinge(rotation, body.sense)), body.turning.rotated(rotation))
    }
}

/// The axis of a hinge of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hinge<A: Algebra>(A::Angular);

impl<A: Algebra> Moves<A> for Hinge<A> {
    type Inertia = Turning<A>;
    #[inline(always)]
    fn still() -> (Self, Turning<A>) {
        (Self(A::zero_angular()), Turning::zero())
    }
    #[inline(always)]
    fn shifted(inertia: &Turning<A>, r: A::Vector) -> Turning<A> {
        inertia.shifted(r)
    }
    #[inline(always)]
    fn momentum(self, inertia: &Turning<A>) -> Force<A> {
        Force { moment: A::apply_inertia(inertia.rotational, self.0), force: A::swing(self.0, inertia.first_moment) }
    }
    #[inline(always)]
    fn share(self, force: Force<A>) -> A::Scalar {
        A::dot_angular(self.0, force.moment)
    }
    #[inline(always)]
    fn at(self, r: A::Vector) -> A::Vector {
        A::swing(self.0, r)
    }
}

impl<A: Algebra> Body<A> {
    /// The angle of its hinge.
    #[inline(always)]
    pub(super) fn angle(&self) -> Angle<A::Scalar> {
        Angle { coordinate: self.q_index, sense: self.ratio, shift: self.shift }
    }
}

/// Joints of any type in a tree, the point on the body `point`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tree<'a, A: Algebra> {
    pub bodies: &'a [Body<A>],
    pub point: usize,
}

impl<A: Algebra> Shape<A> for Tree<'_, A> {
    type Axis = Axis<A>;
    #[inline(always)]
    fn parent(self, i: usize) -> Option<usize> {
        self.bodies[i].parent
    }
    #[inline(always)]
    fn coordinate(self, i: usize) -> usize {
        self.bodies[i].v_index
    }
    #[inline(always)]
    fn point(self, _: usize) -> usize {
        self.point
    }
    #[inline(always)]
    fn place(self, i: usize, outer: Option<A::Rotation>, q: &[A::Scalar], turned: &impl Turned<A>) -> Link<A, Axis<A>> {
        let body = &self.bodies[i];
        let (placed, offset) = match outer {
            None => (body.placement.rotation, body.placement.translation),
            Some(outer) => (A::compose(outer, body.placement.rotation), A::rotate(outer, body.placement.translation)),
        };
        let (rotation, offset) = if A::turns(body.joint) {
            let (sin, cos) = turned.sin_cos(i, body.angle());
            (A::turn(placed, sin, cos), offset)
        } else {
            let (rotation, moved) = A::move_joint(body.joint, placed, body.ratio, body.shift, &q[body.q_index..]);
            (rotation, offset + moved)
        };
        let axis = A::axis(body.joint, rotation).scaled(body.ratio);
        Link::at(rotation, offset, axis, body.inertia.rotated(rotation))
    }
}

impl<A: Algebra> Moves<A> for Axis<A> {
    type Inertia = Inertia<A>;
    #[inline(always)]
    fn still() -> (Self, Inertia<A>) {
        (Self::Turn(A::zero_angular()), Inertia::zero())
    }
    #[inline(always)]
    fn shifted(inertia: &Inertia<A>, r: A::Vector) -> Inertia<A> {
        inertia.shifted(r)
    }
    #[inline(always)]
    fn momentum(self, inertia: &Inertia<A>) -> Force<A> {
        inertia.along(self)
    }
    #[inline(always)]
    fn share(self, force: Force<A>) -> A::Scalar {
        self.dot(force)
    }
    #[inline(always)]
    fn at(self, r: A::Vector) -> A::Vector {
        self.point_velocity(r)
    }
}

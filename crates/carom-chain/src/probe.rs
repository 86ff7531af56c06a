//! What a contact at one point needs of a chain, fused: position, J, M, H and the response to a unit impulse.
//!
//! [`crate::Kinematics`] answers any question in any order; this kernel answers one, and shares what the answers have in
//! common. M is built once and factored in place, `M = Lᵀ D L`, which keeps the zeros of a tree; then with `Y = L⁻ᵀ Jᵀ`
//! (zero off the way from the point to the world) `H = Yᵀ D⁻¹ Y`, and `M⁻¹Jᵀn = L⁻¹ D⁻¹ Y n`. No bias, no roots, one
//! division for each joint.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | J | 3×nv, 2×nv | velocity of the point for unit joint rates, world axes | `jacobian` |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | L, D | nv×nv | unit lower triangle and diagonal: M = Lᵀ D L | `factor`, `inverse_d` |
//! | yₖ | 3, 2 | row k of Y: what the joint k feels of unit forces at the point, those beyond it free | `felt` |
//! | H | 3×3, 2×2 | Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg | `delassus` |
//! | Jᵀn | nv | joint impulse of a unit impulse along n | `joint_impulse` |
//! | M⁻¹Jᵀn | nv | joint velocities that it gives | `response` |
//! | nᵀHn | 1 | velocity along n that it gives the point, 1/kg | `mobility` |
//!
//! **Shapes.** The kernel is written once, over slices. What a chain is made of is looked at once, when the probe is made:
//! hinges one after another take no branches on joints and parents ([`Row`]), and two and three of them have fixed sizes,
//! so that everything lives in registers; all else is a [`Tree`]. Instructions of the paper's chain of quantities by
//! `Row` against `Tree`, and with fixed size against `Row`, are in `docs/speed.md`. `tests/probe.rs` holds all to
//! [`crate::Kinematics`].
//!
//! Source: Featherstone (2008), tables 6.2 (CRBA), 6.3 (LTDL) and 6.4, in world axes (see [`crate::algebra`]).

use crate::algebra::{Algebra, Axis, Force, Inertia};
use crate::chain::{Body, Chain, Point};
use crate::error::ChainError;
use crate::sine::sin_cos;
use num_traits::{One, Zero};

/// One point of a chain, ready to be asked at many configurations. Immutable, and shared by reference.
#[derive(Debug, Clone)]
pub struct Probe<A: Algebra> {
    chain: Chain<A>,
    body: usize,
    arm: A::Vector,
    kind: Kind,
}

/// What the chain is made of: [`Row`] of two, of three, of any number, or [`Tree`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    RowOfTwo,
    RowOfThree,
    Row,
    Tree,
}

/// What a probe finds at one configuration, and the scratch memory to find it.
#[derive(Debug, Clone)]
pub struct Reading<A: Algebra> {
    /// World position of the point, m.
    pub position: A::Vector,
    /// Column for each coordinate: velocity of the point for unit rate, world axes.
    pub jacobian: Vec<A::Vector>,
    /// nv×nv, all of it.
    pub mass_matrix: Vec<A::Scalar>,
    /// Columns of the Delassus matrix J M⁻¹ Jᵀ, world axes, 1/kg; in the plane the third is zero.
    pub delassus: [A::Vector; 3],
    /// Jᵀn: the joint impulse of a unit impulse along the normal.
    pub joint_impulse: Vec<A::Scalar>,
    /// M⁻¹Jᵀn: the joint velocities that a unit impulse along the normal gives.
    pub response: Vec<A::Scalar>,
    /// nᵀHn: the velocity along the normal that it gives the point, 1/kg.
    pub mobility: A::Scalar,
    factor: Vec<A::Scalar>,
    row: Vec<Link<A, Hinge<A>>>,
    tree: Vec<Link<A, Axis<A>>>,
}

impl<A: Algebra> Chain<A> {
    /// Makes a point ready to be asked at many configurations.
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints; [`ChainError::FixedPoint`] for a point of the world.
    pub fn probe(&self, point: Point<A>) -> Result<Probe<A>, ChainError> {
        if self.is_coupled() {
            return Err(ChainError::Coupled { chain: self.name().into() });
        }
        let body = point.body.ok_or_else(|| ChainError::FixedPoint { chain: self.name().into() })?;
        let follows = |(i, b): (usize, &Body<A>)| {
            A::turns(b.joint) && b.parent == i.checked_sub(1) && b.v_index == i && b.q_index == i
        };
        let row = body + 1 == self.bodies.len() && self.bodies.iter().enumerate().all(follows);
        let kind = match (row, self.bodies.len()) {
            (true, 2) => Kind::RowOfTwo,
            (true, 3) => Kind::RowOfThree,
            (true, _) => Kind::Row,
            (false, _) => Kind::Tree,
        };
        Ok(Probe { chain: self.clone(), body, arm: point.position, kind })
    }
}

impl<A: Algebra> Probe<A> {
    /// The chain.
    pub fn chain(&self) -> &Chain<A> {
        &self.chain
    }

    /// # Errors
    /// [`ChainError::WrongLength`] unless `length` is the number of velocities, nv.
    pub fn check_velocities(&self, length: usize) -> Result<(), ChainError> {
        self.chain.check_nv("qd", length)
    }

    /// Memory for what this probe finds. Allocates; reading into it does not.
    pub fn reading(&self) -> Reading<A> {
        let n = self.chain.nv;
        let (row, tree) = if self.kind == Kind::Tree { (0, n) } else { (n, 0) };
        let zero = A::Scalar::zero();
        Reading {
            position: A::zero(),
            jacobian: vec![A::zero(); n],
            mass_matrix: vec![zero; n * n],
            delassus: [A::zero(); 3],
            joint_impulse: vec![zero; n],
            response: vec![zero; n],
            mobility: zero,
            factor: vec![zero; n * n],
            row: vec![Link::new(); row],
            tree: vec![Link::new(); tree],
        }
    }

    /// Everything at `q`, for the normal n, with the sine and cosine of each joint's angle given. Allocates nothing.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    ///
    /// # Panics
    /// If the reading was made for another chain.
    #[inline(always)]
    pub fn read_turned(
        &self,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
        normal: A::Vector,
        reading: &mut Reading<A>,
    ) -> Result<(), ChainError> {
        self.chain.check_nq(q.len())?;
        assert_eq!(reading.joint_impulse.len(), self.chain.nv, "this reading belongs to another chain");
        match self.kind {
            Kind::RowOfTwo => self.read_fixed::<2>(turned, normal, reading),
            Kind::RowOfThree => self.read_fixed::<3>(turned, normal, reading),
            Kind::Row => {
                let mut links = std::mem::take(&mut reading.row);
                let mut factor = std::mem::take(&mut reading.factor);
                self.read::<Row>(&self.chain.bodies, q, turned, normal, &mut links, &mut factor, reading);
                (reading.row, reading.factor) = (links, factor);
            }
            Kind::Tree => {
                let mut links = std::mem::take(&mut reading.tree);
                let mut factor = std::mem::take(&mut reading.factor);
                // Off the way from the point to the world, and between branches, nothing is written.
                reading.mass_matrix.fill(A::Scalar::zero());
                reading.jacobian.fill(A::zero());
                reading.joint_impulse.fill(A::Scalar::zero());
                reading.response.fill(A::Scalar::zero());
                self.read::<Tree>(&self.chain.bodies, q, turned, normal, &mut links, &mut factor, reading);
                (reading.tree, reading.factor) = (links, factor);
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn read_fixed<const N: usize>(&self, turned: &impl Turned<A>, normal: A::Vector, reading: &mut Reading<A>) {
        let mut links = [Link::new(); N];
        let mut factor = [[A::Scalar::zero(); N]; N];
        self.read::<Row>(&self.chain.bodies[..N], &[], turned, normal, &mut links, factor.as_flattened_mut(), reading);
    }

    /// The kernel.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // it is one function so that sizes known to a caller are known inside
    fn read<S: Shape<A>>(
        &self,
        bodies: &[Body<A>],
        q: &[A::Scalar],
        turned: &impl Turned<A>,
        normal: A::Vector,
        links: &mut [Link<A, S::Axis>],
        factor: &mut [A::Scalar],
        reading: &mut Reading<A>,
    ) {
        let n = bodies.len();
        let links = &mut links[..n];
        let l = &mut factor[..n * n];
        let (jacobian, mass_matrix) = (&mut reading.jacobian[..n], &mut reading.mass_matrix[..n * n]);
        let (joint_impulse, response) = (&mut reading.joint_impulse[..n], &mut reading.response[..n]);

        // Outward: where everything is.
        for i in 0..n {
            let body = &bodies[i];
            let (placed, offset) = match S::parent(body, i) {
                None => (body.placement.rotation, body.placement.translation),
                Some(p) => {
                    let outer = links[p].rotation;
                    (A::compose(outer, body.placement.rotation), A::rotate(outer, body.placement.translation))
                }
            };
            let (rotation, moved, axis) = S::step(body, i, placed, q, turned);
            let link = &mut links[i];
            (link.rotation, link.axis) = (rotation, axis);
            link.offset = S::displaced(offset, moved);
            link.composite = S::inertia(body, rotation);
        }

        // Inward: composite inertias, and with each the column of M (see `mass_matrix_into`).
        for i in (0..n).rev() {
            let composite = links[i].composite;
            if let Some(p) = S::parent(&bodies[i], i) {
                let carried = composite.shifted(links[i].offset);
                links[p].composite += carried;
            }
            let mut f = links[i].axis.momentum(&composite);
            let v = S::coordinate(&bodies[i], i);
            let own = links[i].axis.share(f);
            (l[i * n + i], mass_matrix[v * n + v]) = (own, own);
            let mut j = i;
            while let Some(p) = S::parent(&bodies[j], j) {
                f = f.shifted(links[j].offset);
                j = p;
                let m = links[j].axis.share(f);
                let w = S::coordinate(&bodies[j], j);
                l[i * n + j] = m;
                (mass_matrix[v * n + w], mass_matrix[w * n + v]) = (m, m);
            }
        }

        // From the point down: J.
        let point = S::point(self.body, n);
        let mut r = A::rotate(links[point].rotation, self.arm);
        let mut next = Some(point);
        while let Some(i) = next {
            let felt = links[i].axis.at(r);
            links[i].felt = felt;
            let v = S::coordinate(&bodies[i], i);
            (jacobian[v], joint_impulse[v]) = (felt, A::dot(felt, normal));
            r += links[i].offset;
            next = S::parent(&bodies[i], i);
        }
        reading.position = r;

        // M = Lᵀ D L in place.
        for k in (0..n).rev() {
            let inverse_d = A::Scalar::one() / l[k * n + k];
            links[k].inverse_d = inverse_d;
            let mut next = S::parent(&bodies[k], k);
            while let Some(i) = next {
                let a = l[k * n + i] * inverse_d;
                let mut beyond = Some(i);
                while let Some(j) = beyond {
                    let product = a * l[k * n + j];
                    l[i * n + j] -= product;
                    beyond = S::parent(&bodies[j], j);
                }
                l[k * n + i] = a;
                next = S::parent(&bodies[i], i);
            }
        }

        // Y = L⁻ᵀ Jᵀ from the point down, and H = Yᵀ D⁻¹ Y on the way.
        let mut h = [A::zero(); 3];
        let mut mobility = A::Scalar::zero();
        let mut next = Some(point);
        while let Some(k) = next {
            let (y, inverse_d) = (links[k].felt, links[k].inverse_d);
            let scaled = y * inverse_d;
            for (c, column) in h.iter_mut().enumerate().take(A::LINEAR) {
                *column += y * A::linear_part(scaled, c);
            }
            let along = A::dot(y, normal);
            let moved = along * inverse_d;
            mobility += along * moved;
            response[S::coordinate(&bodies[k], k)] = moved;
            next = S::parent(&bodies[k], k);
            let mut beyond = next;
            while let Some(i) = beyond {
                let product = y * l[k * n + i];
                links[i].felt -= product;
                beyond = S::parent(&bodies[i], i);
            }
        }
        (reading.delassus, reading.mobility) = (h, mobility);

        // Outward: M⁻¹Jᵀn = L⁻¹ (D⁻¹ Y n).
        for i in 0..n {
            let v = S::coordinate(&bodies[i], i);
            let mut x = response[v];
            let mut next = S::parent(&bodies[i], i);
            while let Some(j) = next {
                x -= l[i * n + j] * response[S::coordinate(&bodies[j], j)];
                next = S::parent(&bodies[j], j);
            }
            response[v] = x;
        }
    }
}

impl<A: Algebra<Scalar = f64>> Probe<A> {
    /// Everything at `q` (length nq; rad, m, quaternion), for the unit normal n in world axes. Allocates nothing.
    ///
    /// Numbers are not looked at: [`Chain::check_state`] does that, and a singular M gives infinities.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    ///
    /// # Panics
    /// If the reading was made for another chain.
    pub fn read_into(&self, q: &[f64], normal: A::Vector, reading: &mut Reading<A>) -> Result<(), ChainError> {
        self.read_turned(q, &ByAngle(q), normal, reading)
    }
}

/// Where the sines and cosines of joint angles come from. (A trait and not a closure, because a closure can't be made to
/// be inlined, and in lanes a call of it cost more than the sines.)
pub trait Turned<A: Algebra> {
    /// Of the angle `ratio · q + shift` of body `i`, a hinge.
    fn sin_cos(&self, i: usize, body: &Body<A>) -> (A::Scalar, A::Scalar);
}

/// From q, one after another.
struct ByAngle<'a>(&'a [f64]);

impl<A: Algebra<Scalar = f64>> Turned<A> for ByAngle<'_> {
    #[inline(always)]
    fn sin_cos(&self, _: usize, body: &Body<A>) -> (f64, f64) {
        sin_cos(body.ratio * self.0[body.q_index] + body.shift)
    }
}

/// The scratch memory of one body.
#[derive(Debug, Clone, Copy)]
struct Link<A: Algebra, X> {
    rotation: A::Rotation,
    offset: A::Vector,
    axis: X,
    composite: Inertia<A>,
    felt: A::Vector,
    inverse_d: A::Scalar,
}

impl<A: Algebra, X: Moves<A>> Link<A, X> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            rotation: A::no_rotation(),
            offset: A::zero(),
            axis: X::still(),
            composite: Inertia::zero(),
            felt: A::zero(),
            inverse_d: A::Scalar::zero(),
        }
    }
}

/// An axis that a joint moves along, in world axes about the joint's own origin.
trait Moves<A: Algebra>: Copy {
    fn still() -> Self;
    /// I s
    fn momentum(self, inertia: &Inertia<A>) -> Force<A>;
    /// s · f
    fn share(self, force: Force<A>) -> A::Scalar;
    /// The velocity that unit rate gives the point r away.
    fn at(self, r: A::Vector) -> A::Vector;
}

/// A hinge's axis.
#[derive(Debug, Clone, Copy)]
struct Hinge<A: Algebra>(A::Angular);

impl<A: Algebra> Moves<A> for Hinge<A> {
    #[inline(always)]
    fn still() -> Self {
        Self(A::zero_angular())
    }
    #[inline(always)]
    fn momentum(self, inertia: &Inertia<A>) -> Force<A> {
        inertia.along(Axis::Turn(self.0))
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

impl<A: Algebra> Moves<A> for Axis<A> {
    #[inline(always)]
    fn still() -> Self {
        Self::Turn(A::zero_angular())
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

/// What the kernel need not look up, body by body.
trait Shape<A: Algebra> {
    type Axis: Moves<A>;
    fn parent(body: &Body<A>, i: usize) -> Option<usize>;
    fn coordinate(body: &Body<A>, i: usize) -> usize;
    /// The body that carries the point.
    fn point(body: usize, n: usize) -> usize;
    /// Rotation, displacement (if any) and axis of the body, its joint's frame being `placed`.
    fn step(
        body: &Body<A>,
        i: usize,
        placed: A::Rotation,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> (A::Rotation, Option<A::Vector>, Self::Axis);
    #[inline(always)]
    fn displaced(offset: A::Vector, moved: Option<A::Vector>) -> A::Vector {
        match moved {
            None => offset,
            Some(moved) => offset + moved,
        }
    }
    /// The body's inertia in world axes.
    #[inline(always)]
    fn inertia(body: &Body<A>, rotation: A::Rotation) -> Inertia<A> {
        body.inertia.rotated(rotation)
    }
}

/// Hinges one after another, in the order of their coordinates, the point on the last.
struct Row;

impl<A: Algebra> Shape<A> for Row {
    type Axis = Hinge<A>;
    #[inline(always)]
    fn parent(_: &Body<A>, i: usize) -> Option<usize> {
        i.checked_sub(1)
    }
    #[inline(always)]
    fn coordinate(_: &Body<A>, i: usize) -> usize {
        i
    }
    #[inline(always)]
    fn point(_: usize, n: usize) -> usize {
        n - 1
    }
    #[inline(always)]
    fn step(
        body: &Body<A>,
        i: usize,
        placed: A::Rotation,
        _: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> (A::Rotation, Option<A::Vector>, Hinge<A>) {
        let (sin, cos) = turned.sin_cos(i, body);
        let rotation = A::turn(placed, sin, cos);
        (rotation, None, Hinge(A::hinge(rotation) * body.ratio))
    }
}

/// Joints of any type in a tree.
struct Tree;

impl<A: Algebra> Shape<A> for Tree {
    type Axis = Axis<A>;
    #[inline(always)]
    fn parent(body: &Body<A>, _: usize) -> Option<usize> {
        body.parent
    }
    #[inline(always)]
    fn coordinate(body: &Body<A>, _: usize) -> usize {
        body.v_index
    }
    #[inline(always)]
    fn point(body: usize, _: usize) -> usize {
        body
    }
    #[inline(always)]
    fn step(
        body: &Body<A>,
        i: usize,
        placed: A::Rotation,
        q: &[A::Scalar],
        turned: &impl Turned<A>,
    ) -> (A::Rotation, Option<A::Vector>, Axis<A>) {
        let (rotation, moved) = if A::turns(body.joint) {
            let (sin, cos) = turned.sin_cos(i, body);
            (A::turn(placed, sin, cos), None)
        } else {
            let (rotation, moved) = A::move_joint(body.joint, placed, body.ratio, body.shift, &q[body.q_index..]);
            (rotation, Some(moved))
        };
        (rotation, moved, A::axis(body.joint, rotation).scaled(body.ratio))
    }
}

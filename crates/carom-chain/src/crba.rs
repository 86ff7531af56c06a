//! Mass matrix by the composite-rigid-body algorithm (CRBA).
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | Iᶜᵢ | – | composite inertia: body i and its subtree as one rigid body | `composite` |
//! | Iᶜ s | – | force that accelerates the subtree by one unit along s | `force` |
//!
//! Source: Featherstone (2008), table 6.2, in world axes (see [`crate::algebra`]).

use crate::algebra::{Algebra, Axis, Force};
use crate::chain::Chain;
use crate::kinematics::Kinematics;
use crate::prepare::{Hinge, PreparedBody, Subspace};
use crate::scratch::Link;
use nalgebra::{DMatrix, Dim, Dyn, Matrix, RawStorageMut};
use num_traits::Zero;
use std::marker::PhantomData;
use std::ops::AddAssign;

impl<A: Algebra> Kinematics<'_, A> {
    /// The mass matrix M (nv×nv; kg m², kg m, kg) by the composite-rigid-body algorithm. Writes both triangles into the
    /// leading nv×nv block of `out` and zero elsewhere; does not allocate.
    ///
    /// # Panics
    /// If `out` is smaller than nv×nv.
    pub fn mass_matrix_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &mut self,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        let chain = self.chain;
        let nv = chain.nv;
        if out.shape() != (nv, nv) {
            out.fill(A::Scalar::zero());
        }
        let mut out = out.view_mut((0, 0), (nv, nv));
        if !chain.structure.hinges_alone || chain.prepared.last().is_some_and(|last| last.run > 0) {
            // Column by column, each one contiguous fill: `fill` of a view costs a dozen instructions per number.
            for v in 0..nv {
                let mut column = out.view_mut((0, v), (nv, 1));
                (0..nv).for_each(|w| column[(w, 0)] = A::Scalar::zero());
            }
        }
        if chain.structure.hinges_alone { self.columns::<Hinge<A>, _>(out) } else { self.columns::<Axis<A>, _>(out) }
    }

    /// Writes the entries of M that can be non-zero; `out` holds zeros elsewhere.
    #[inline(always)]
    fn columns<X: Subspace<A>, S: RawStorageMut<A::Scalar, Dyn, Dyn>>(&mut self, out: Matrix<A::Scalar, Dyn, Dyn, S>) {
        let ws = &mut *self.ws;
        let prepared = &self.chain.prepared[..];
        let n = prepared.len();
        let (links, forces) = (&ws.links[..n], &mut ws.force[..n]);
        // Composite inertia of the first child of body i, about the origin of body i: the first child is the next body, so
        // it is kept in registers.
        let mut carried = X::nothing();
        for (i, body) in prepared.iter().enumerate().rev() {
            let link = &links[i];
            let mut composite = X::own(body, link.rotation);
            if body.end > i + 1 {
                composite += carried;
            }
            if body.branches {
                composite += X::part(ws.inertia[i]);
            }
            carried = X::shifted(body, &composite, link.offset);
            body.parent_slot.keep(&mut ws.inertia, X::whole(carried));
            // The force that accelerates the subtree of body i by one unit along sᵢ.
            forces[i] = X::of(body, link).momentum(&composite);
        }
        // Its projections on the axes of joint i and of the joints between it and the world are the entries of M. The forces
        // of a body and its parent are propagated together (SIMD).
        let mut columns = Columns::<A, X, S> { prepared, links, out, axis: PhantomData };
        let mut i = n;
        while i > 0 {
            i -= 1;
            let (v, f) = (prepared[i].v_index, forces[i]);
            columns.put(v, v, columns.axis(i).project(f) + prepared[i].rotor);
            if prepared[i].run == i {
                columns.down(i, [v], [f]);
                continue;
            }
            let far = f.shifted(links[i].offset);
            i -= 1;
            let (u, near) = (prepared[i].v_index, forces[i]);
            columns.put(u, u, columns.axis(i).project(near) + prepared[i].rotor);
            columns.put_both(u, v, columns.axis(i).project(far));
            columns.down(i, [u, v], [near, far]);
        }
    }

    /// Inward pass of the composite inertias: Iᶜᵢ = Iᵢ + Σ Iᶜ of the children.
    pub(crate) fn composites(&mut self) {
        let ws = &mut *self.ws;
        for (i, body) in self.chain.bodies.iter().enumerate() {
            ws.inertia[i] = body.inertia.rotated(ws.links[i].rotation);
        }
        self.chain.sum_subtrees(&ws.links, &mut ws.inertia, |inertia, r| inertia.shifted(r));
    }

    /// As [`Self::mass_matrix_into`]; returns a new matrix.
    pub fn mass_matrix(&mut self) -> DMatrix<A::Scalar> {
        let mut m = DMatrix::zeros(self.chain.nv, self.chain.nv);
        self.mass_matrix_into(&mut m);
        m
    }
}

impl<A: Algebra> Chain<A> {
    /// Adds to the entry of each body those of the bodies that it carries. `shifted` is an entry about the point at −r.
    pub(crate) fn sum_subtrees<X: Copy + AddAssign>(
        &self,
        links: &[Link<A>],
        entries: &mut [X],
        shifted: impl Fn(X, A::Vector) -> X,
    ) {
        for (i, body) in self.bodies.iter().enumerate().rev() {
            if let Some(parent) = body.parent {
                let carried = shifted(entries[i], links[i].offset);
                entries[parent] += carried;
            }
        }
    }
}

/// The mass matrix while it is being filled.
struct Columns<'a, A: Algebra, X, S: RawStorageMut<A::Scalar, Dyn, Dyn>> {
    prepared: &'a [PreparedBody<A>],
    links: &'a [Link<A>],
    out: Matrix<A::Scalar, Dyn, Dyn, S>,
    axis: PhantomData<X>,
}

impl<A: Algebra, X: Subspace<A>, S: RawStorageMut<A::Scalar, Dyn, Dyn>> Columns<'_, A, X, S> {
    #[inline(always)]
    fn axis(&self, i: usize) -> X {
        X::of(&self.prepared[i], &self.links[i])
    }

    #[inline(always)]
    fn put(&mut self, v: usize, w: usize, m: A::Scalar) {
        // Bodies that share a coordinate add to the same entries.
        if X::COUPLED { self.out[(v, w)] += m } else { self.out[(v, w)] = m }
    }

    #[inline(always)]
    fn put_both(&mut self, v: usize, w: usize, m: A::Scalar) {
        self.put(v, w, m);
        self.put(w, v, m);
    }

    /// Propagates forces on body `i` to the world; writes their projections on the axes of the joints passed into the columns
    /// of these coordinates.
    #[inline(always)]
    fn down<const K: usize>(&mut self, i: usize, coordinates: [usize; K], mut forces: [Force<A>; K]) {
        let (prepared, links) = (self.prepared, self.links);
        let (mut start, mut end, mut shift) = (prepared[i].run, i, links[i].offset);
        loop {
            for (body, link) in prepared[start..end].iter().zip(&links[start..end]).rev() {
                let axis = X::of(body, link);
                let mut shares = [A::Scalar::zero(); K];
                for (f, share) in forces.iter_mut().zip(&mut shares) {
                    *f = f.shifted(shift);
                    *share = axis.project(*f);
                }
                shift = link.offset;
                let w = body.v_index;
                for (v, m) in coordinates.into_iter().zip(shares) {
                    self.put_both(v, w, m);
                }
            }
            let Some(p) = prepared[start].parent else { break };
            (start, end) = (prepared[p].run, p + 1);
        }
    }
}

//! Mass matrix, inverse dynamics, energies and momentum.
//!
//! `M(q) q̈ + C(q, q̇) q̇ + g(q) = τ`, the equation of motion without contact.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | C q̇ + g | nv | bias force | `bias` |
//! | g | nv | gravity force | `gravity_force` |
//! | Iᶜᵢ | – | composite inertia: body i and its subtree as one rigid body | `composite` |
//! | vᵢ, aᵢ, fᵢ | – | velocity, acceleration, force on body i | `velocity`, `acceleration`, `force` |
//! | T, V | 1 | kinetic and potential energy | `kinetic_energy`, `potential_energy` |
//!
//! Source: Featherstone (2008), tables 5.1 (RNEA) and 6.2 (CRBA), in world axes (see [`crate::algebra`]).

use crate::algebra::{Algebra, Axis, Force, Inertia};
use crate::error::ChainError;
use crate::moves::{Hinge, Moves};
use crate::steps::{Held, Step};
use crate::workspace::{Flow, Kinematics, Link, clear};
use nalgebra::{DMatrix, DVector, Dim, Dyn, Matrix, RawStorageMut};
use num_traits::Zero;
use std::marker::PhantomData;

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
        if !chain.structure.hinges_alone || chain.steps.last().is_some_and(|last| last.run > 0) {
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
    fn columns<X: Moves<A>, S: RawStorageMut<A::Scalar, Dyn, Dyn>>(&mut self, out: Matrix<A::Scalar, Dyn, Dyn, S>) {
        let ws = &mut *self.ws;
        let steps = &self.chain.steps[..];
        let n = steps.len();
        let (links, forces) = (&ws.links[..n], &mut ws.force[..n]);
        // Composite inertia of the first child of body i, about the origin of body i: the first child is the next body, so
        // it is kept in registers.
        let mut carried = X::nothing();
        for (i, step) in steps.iter().enumerate().rev() {
            let link = &links[i];
            let mut composite = X::own(step, link.rotation);
            if step.end > i + 1 {
                composite += carried;
            }
            if step.branches {
                composite += X::part(ws.inertia[i]);
            }
            carried = X::shifted(step, &composite, link.offset);
            step.held_by.keep(&mut ws.inertia, X::whole(carried));
            // The force that accelerates the subtree of body i by one unit along sᵢ.
            forces[i] = X::of(step, link).momentum(&composite);
        }
        // Its projections on the axes of joint i and of the joints between it and the world are the entries of M. The forces
        // of a body and its parent are propagated together (SIMD).
        let mut columns = Columns::<A, X, S> { steps, links, out, axis: PhantomData };
        let mut i = n;
        while i > 0 {
            i -= 1;
            let (v, f) = (steps[i].v_index, forces[i]);
            columns.put(v, v, columns.axis(i).share(f));
            if steps[i].run == i {
                columns.down(i, [v], [f]);
                continue;
            }
            let far = f.shifted(links[i].offset);
            i -= 1;
            let (u, near) = (steps[i].v_index, forces[i]);
            columns.put(u, u, columns.axis(i).share(near));
            columns.put_both(u, v, columns.axis(i).share(far));
            columns.down(i, [u, v], [near, far]);
        }
    }

    /// Inward pass of the composite inertias: Iᶜᵢ = Iᵢ + Σ Iᶜ of the children.
    pub(crate) fn composites(&mut self) {
        let (bodies, ws) = (&self.chain.bodies, &mut *self.ws);
        for (i, body) in bodies.iter().enumerate() {
            ws.inertia[i] = body.inertia.rotated(ws.links[i].rotation);
        }
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(p) = body.parent {
                let carried = ws.inertia[i].shifted(ws.links[i].offset);
                ws.inertia[p] += carried;
            }
        }
    }

    /// As [`Self::mass_matrix_into`]; returns a new matrix.
    pub fn mass_matrix(&mut self) -> DMatrix<A::Scalar> {
        let mut m = DMatrix::zeros(self.chain.nv, self.chain.nv);
        self.mass_matrix_into(&mut m);
        m
    }

    /// Inverse dynamics τ = M q̈ + C q̇ + g by the recursive Newton–Euler algorithm. `qd`, `qdd` and `tau` (N m, N) have
    /// length nv; `gravity` in world axes, m/s². Does not allocate.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn inverse_dynamics_into(
        &mut self,
        qd: &[A::Scalar],
        qdd: &[A::Scalar],
        gravity: A::Vector,
        tau: &mut [A::Scalar],
    ) -> Result<(), ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.chain.check_nv("qdd", qdd.len())?;
        self.chain.check_nv("tau", tau.len())?;
        self.spread_force(qd, Some(qdd), gravity);
        self.gather_force(tau);
        Ok(())
    }

    /// As [`Self::inverse_dynamics_into`]; returns a new vector.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn inverse_dynamics(
        &mut self,
        qd: &[A::Scalar],
        qdd: &[A::Scalar],
        gravity: A::Vector,
    ) -> Result<DVector<A::Scalar>, ChainError> {
        let mut tau = DVector::zeros(self.chain.nv);
        self.inverse_dynamics_into(qd, qdd, gravity, tau.as_mut_slice())?;
        Ok(tau)
    }

    /// The bias force C q̇ + g (length nv; N m, N). `gravity` in world axes, m/s².
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn bias(&mut self, qd: &[A::Scalar], gravity: A::Vector) -> Result<DVector<A::Scalar>, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        let mut tau = DVector::zeros(self.chain.nv);
        self.spread_force(qd, None, gravity);
        self.gather_force(tau.as_mut_slice());
        Ok(tau)
    }

    /// The gravity force g (length nv; N m, N): the joint forces that hold the chain at rest. `gravity` in world axes, m/s².
    pub fn gravity_force(&mut self, gravity: A::Vector) -> DVector<A::Scalar> {
        let mut tau = DVector::zeros(self.chain.nv);
        let ws = &mut *self.ws;
        for (i, step) in self.chain.steps.iter().enumerate() {
            let h = A::rotate(ws.links[i].rotation, step.inertia.first_moment);
            ws.force[i] = Force { moment: -A::moment(h, gravity), force: -(gravity * step.inertia.mass) };
        }
        self.gather_force(tau.as_mut_slice());
        tau
    }

    /// Outward pass of RNEA: accelerations, for a base that accelerates by −gravity, and the forces that cause them.
    fn spread_force(&mut self, qd: &[A::Scalar], qdd: Option<&[A::Scalar]>, gravity: A::Vector) {
        let (chain, ws) = (self.chain, &mut *self.ws);
        let base = Flow::base(-gravity);
        let mut flow = base;
        for (i, step) in chain.steps.iter().enumerate() {
            let outer = ws.flow_below(i, step.parent, &flow, &base);
            flow = ws.flow_on(chain, i, &outer, qd, qdd.map_or(A::Scalar::zero(), |qdd| qdd[step.v_index]));
            let Flow { spin, spin_rate, acceleration } = flow;
            let Inertia { mass, first_moment: h, rotational } = step.turned_inertia(ws.links[i].rotation);
            let mut force = A::swing(spin_rate, h) + A::swing(spin, A::swing(spin, h));
            if !A::turns(step.joint) {
                force += acceleration * mass;
            }
            let momentum = A::apply_inertia(rotational, spin);
            let moment = A::apply_inertia(rotational, spin_rate) + A::cross_angular(spin, momentum);
            ws.flow[i] = flow;
            ws.force[i] = Force { moment: moment + A::moment(h, acceleration), force };
        }
    }

    /// Inward pass: sums the forces over each subtree and projects the sum on the joint's axis.
    fn gather_force(&mut self, tau: &mut [A::Scalar]) {
        clear(tau);
        let (steps, ws) = (&self.chain.steps, &mut *self.ws);
        let mut carried = Force::zero();
        for (i, step) in steps.iter().enumerate().rev() {
            let Link { offset, ref axis, .. } = ws.links[i];
            let mut force = ws.force[i];
            if step.end > i + 1 {
                force += carried;
            }
            tau[step.v_index] += axis.dot(force);
            if step.held_by != Held::World {
                carried = force.shifted(offset);
                step.held_by.add(&mut ws.force, carried);
            }
        }
    }

    /// Kinetic energy T = ½ Σ v·Iv, J.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn kinetic_energy(&mut self, qd: &[A::Scalar]) -> Result<A::Scalar, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.spread_velocity(qd);
        let mut twice = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let v = self.ws.velocity[i];
            twice += body.inertia.rotated(self.ws.links[i].rotation).apply(v).power(v);
        }
        Ok(twice * nalgebra::convert(0.5))
    }

    /// Potential energy V = −Σ m g·c of the moving bodies, relative to the world's origin, J. `gravity` in world axes, m/s².
    pub fn potential_energy(&self, gravity: A::Vector) -> A::Scalar {
        let mut v = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let h = self.ws.links[i].position * body.inertia.mass
                + A::rotate(self.ws.links[i].rotation, body.inertia.first_moment);
            v -= A::dot(gravity, h);
        }
        v
    }

    /// Linear momentum (kg m/s) and angular momentum about the world's origin (kg m²/s) of the moving bodies, world axes.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn momentum(&mut self, qd: &[A::Scalar]) -> Result<Force<A>, ChainError> {
        self.chain.check_nv("qd", qd.len())?;
        self.spread_velocity(qd);
        let mut sum = Force::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let own = body.inertia.rotated(self.ws.links[i].rotation).apply(self.ws.velocity[i]);
            sum += own.shifted(self.ws.links[i].position);
        }
        Ok(sum)
    }
}

/// The mass matrix while it is being filled.
struct Columns<'a, A: Algebra, X, S: RawStorageMut<A::Scalar, Dyn, Dyn>> {
    steps: &'a [Step<A>],
    links: &'a [Link<A>],
    out: Matrix<A::Scalar, Dyn, Dyn, S>,
    axis: PhantomData<X>,
}

impl<A: Algebra, X: Moves<A>, S: RawStorageMut<A::Scalar, Dyn, Dyn>> Columns<'_, A, X, S> {
    #[inline(always)]
    fn axis(&self, i: usize) -> X {
        X::of(&self.steps[i], &self.links[i])
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
        let (steps, links) = (self.steps, self.links);
        let (mut start, mut end, mut shift) = (steps[i].run, i, links[i].offset);
        loop {
            for (step, link) in steps[start..end].iter().zip(&links[start..end]).rev() {
                let axis = X::of(step, link);
                let mut shares = [A::Scalar::zero(); K];
                for (f, share) in forces.iter_mut().zip(&mut shares) {
                    *f = f.shifted(shift);
                    *share = axis.share(*f);
                }
                shift = link.offset;
                let w = step.v_index;
                for (v, m) in coordinates.into_iter().zip(shares) {
                    self.put_both(v, w, m);
                }
            }
            let Some(p) = steps[start].parent else { break };
            (start, end) = (steps[p].run, p + 1);
        }
    }
}

//! Mass matrix, inverse dynamics, energies and momentum.
//!
//! `M(q) q̈ + C(q, q̇) q̇ + g(q) = τ` (the paper's eq. (1) in free flight).
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | M | nv×nv | mass matrix | `mass_matrix` |
//! | C q̇ + g | nv | bias force | `bias` |
//! | g | nv | gravity force | `gravity_force` |
//! | Iᶜᵢ | – | inertia of body i and all it carries, as one rigid body | `composite` |
//! | vᵢ, aᵢ, fᵢ | – | velocity, acceleration, force on body i | `velocity`, `acceleration`, `force` |
//! | T, V | 1 | kinetic and potential energy | `kinetic_energy`, `potential_energy` |
//!
//! Source: Featherstone (2008), tables 5.1 (RNEA) and 6.2 (CRBA), in world axes (see [`crate::algebra`]).

use crate::algebra::{Algebra, Force, Inertia};
use crate::error::ChainError;
use crate::steps::Held;
use crate::workspace::{Flow, Kinematics, Link, clear};
use nalgebra::{DMatrix, DVector, Dim, Matrix, RawStorageMut};
use num_traits::Zero;

impl<A: Algebra> Kinematics<'_, A> {
    /// The composite-rigid-body algorithm. Fills all of `out` (nv×nv, kg m², kg m, kg); allocates nothing.
    ///
    /// # Panics
    /// If `out` is smaller than nv×nv.
    pub fn mass_matrix_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &mut self,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        let (chain, ws) = (self.chain, &mut *self.ws);
        let nv = chain.nv;
        if out.shape() != (nv, nv) {
            out.fill(A::Scalar::zero());
        }
        let mut out = out.view_mut((0, 0), (nv, nv));
        if chain.steps.last().is_some_and(|last| !last.on_all || chain.is_coupled()) {
            // Column by column, which is one fill of memory each: `fill` of a view takes a dozen instructions per number.
            for v in 0..nv {
                let mut column = out.view_mut((0, v), (nv, 1));
                (0..nv).for_each(|w| column[(w, 0)] = A::Scalar::zero());
            }
        }
        // What body i carries, about its origin: its first child's, which is the next body's, is still at hand.
        let mut carried = Inertia::zero();
        for (i, step) in chain.steps.iter().enumerate().rev() {
            let Link { rotation, offset, ref axis, .. } = ws.links[i];
            let mut composite = step.turned_inertia(rotation);
            if step.end > i + 1 {
                composite += carried;
            }
            if step.branches {
                composite += ws.inertia[i];
            }
            // The force that gives body i and all it carries unit acceleration along sᵢ, felt by every joint below.
            let mut f = composite.along(*axis);
            let own = axis.dot(f);
            let (links, mut shift) = (&ws.links[..=i], offset);
            let mut feel = |j: usize| {
                f = f.shifted(shift);
                shift = links[j].offset;
                links[j].axis.dot(f)
            };
            let v = step.v_index;
            if chain.is_coupled() {
                // Bodies that share a coordinate share its entries.
                out[(v, v)] += own;
                chain.below(i).for_each(|j| {
                    let (w, m) = (chain.bodies[j].v_index, feel(j));
                    out[(v, w)] += m;
                    out[(w, v)] += m;
                });
            } else {
                out[(v, v)] = own;
                let put = |j: usize| {
                    let (w, m) = (chain.bodies[j].v_index, feel(j));
                    (out[(v, w)], out[(w, v)]) = (m, m);
                };
                if step.on_all { (0..i).rev().for_each(put) } else { chain.below(i).for_each(put) }
            }
            carried = if step.massless { composite.shifted_massless(offset) } else { composite.shifted(offset) };
            step.held_by.keep(&mut ws.inertia, carried);
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

    /// As [`Self::mass_matrix_into`], in a new matrix.
    pub fn mass_matrix(&mut self) -> DMatrix<A::Scalar> {
        let mut m = DMatrix::zeros(self.chain.nv, self.chain.nv);
        self.mass_matrix_into(&mut m);
        m
    }

    /// The recursive Newton–Euler algorithm: τ = M q̈ + C q̇ + g. `gravity` in world axes, m/s². Allocates nothing.
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

    /// As [`Self::inverse_dynamics_into`], in a new vector.
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

    /// The bias force C q̇ + g.
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

    /// The gravity force g: what holds the chain at rest.
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

    /// Outward pass of RNEA: accelerations from a base that accelerates against gravity, and the forces they need.
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

    /// Inward pass: each joint feels its own share of the forces beyond it.
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

    /// T = ½ Σ v·Iv, J.
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

    /// V = −Σ m g·c over the moving bodies, zero at the world's origin, J.
    pub fn potential_energy(&self, gravity: A::Vector) -> A::Scalar {
        let mut v = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let h = self.ws.links[i].position * body.inertia.mass
                + A::rotate(self.ws.links[i].rotation, body.inertia.first_moment);
            v -= A::dot(gravity, h);
        }
        v
    }

    /// Linear momentum, and angular momentum about the world's origin, of the moving bodies.
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

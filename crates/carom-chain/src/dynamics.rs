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

use crate::algebra::{Algebra, Force, Motion};
use crate::error::ChainError;
use crate::workspace::{Kinematics, clear};
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
        self.composites();
        let (bodies, ws) = (&self.chain.bodies, &*self.ws);
        out.fill(A::Scalar::zero());
        for (i, body) in bodies.iter().enumerate() {
            // The force that gives body i and all it carries unit acceleration along sᵢ, felt by every joint below.
            let mut f = ws.composite[i].along(ws.axis[i]);
            out[(body.v_index, body.v_index)] += ws.axis[i].dot(f);
            let mut j = i;
            while let Some(p) = bodies[j].parent {
                f = f.shifted(ws.offset[j]);
                j = p;
                let m = ws.axis[j].dot(f);
                out[(body.v_index, bodies[j].v_index)] += m;
                out[(bodies[j].v_index, body.v_index)] += m;
            }
        }
    }

    /// Inward pass of the composite inertias: Iᶜᵢ = Iᵢ + Σ Iᶜ of the children.
    pub(crate) fn composites(&mut self) {
        let (bodies, ws) = (&self.chain.bodies, &mut *self.ws);
        for (i, body) in bodies.iter().enumerate() {
            ws.composite[i] = body.inertia.rotated(ws.rotation[i]);
        }
        for (i, body) in bodies.iter().enumerate().rev() {
            if let Some(p) = body.parent {
                let carried = ws.composite[i].shifted(ws.offset[i]);
                ws.composite[p] += carried;
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
        self.spread_velocity(qd);
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
        self.spread_velocity(qd);
        self.spread_force(qd, None, gravity);
        self.gather_force(tau.as_mut_slice());
        Ok(tau)
    }

    /// The gravity force g: what holds the chain at rest.
    pub fn gravity_force(&mut self, gravity: A::Vector) -> DVector<A::Scalar> {
        let mut tau = DVector::zeros(self.chain.nv);
        let ws = &mut *self.ws;
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let h = A::rotate(ws.rotation[i], body.inertia.first_moment);
            ws.force[i] = Force { moment: -A::moment(h, gravity), force: -(gravity * body.inertia.mass) };
        }
        self.gather_force(tau.as_mut_slice());
        tau
    }

    /// Outward pass of RNEA: accelerations from a base that accelerates against gravity, and the forces they need.
    fn spread_force(&mut self, qd: &[A::Scalar], qdd: Option<&[A::Scalar]>, gravity: A::Vector) {
        let ws = &mut *self.ws;
        let base = Motion { angular: A::zero_angular(), linear: -gravity };
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let carried = body.parent.map_or(base, |p| ws.acceleration[p]).shifted(ws.offset[i]);
            let mut a = carried + ws.force_free_rate(self.chain, i, qd);
            if let Some(qdd) = qdd {
                a = a + ws.axis[i].at_rate(qdd[body.v_index]);
            }
            ws.acceleration[i] = a;
            let inertia = body.inertia.rotated(ws.rotation[i]);
            let v = ws.velocity[i];
            ws.force[i] = inertia.apply(a) + v.carry_force(inertia.apply(v));
        }
    }

    /// Inward pass: each joint feels its own share of the forces beyond it.
    fn gather_force(&mut self, tau: &mut [A::Scalar]) {
        clear(tau);
        let ws = &mut *self.ws;
        for (i, body) in self.chain.bodies.iter().enumerate().rev() {
            tau[body.v_index] += ws.axis[i].dot(ws.force[i]);
            if let Some(p) = body.parent {
                let felt = ws.force[i].shifted(ws.offset[i]);
                ws.force[p] += felt;
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
            twice += body.inertia.rotated(self.ws.rotation[i]).apply(v).power(v);
        }
        Ok(twice * nalgebra::convert(0.5))
    }

    /// V = −Σ m g·c over the moving bodies, zero at the world's origin, J.
    pub fn potential_energy(&self, gravity: A::Vector) -> A::Scalar {
        let mut v = A::Scalar::zero();
        for (i, body) in self.chain.bodies.iter().enumerate() {
            let h = self.ws.position[i] * body.inertia.mass + A::rotate(self.ws.rotation[i], body.inertia.first_moment);
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
            let own = body.inertia.rotated(self.ws.rotation[i]).apply(self.ws.velocity[i]);
            sum += own.shifted(self.ws.position[i]);
        }
        Ok(sum)
    }
}

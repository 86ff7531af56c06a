//! Forward dynamics and the Delassus matrix by recursion, in time that grows as the number of bodies.
//!
//! One inward pass gives the articulated inertias; with them `M = (1+HφK) D (1+HφK)ᵀ` is factored without being built
//! (Rodriguez, Jain & Kreutz-Delgado 1991), so that a solve is two sweeps and
//! `H = J M⁻¹ Jᵀ = Σ ε εᵀ / D` is a single inward sweep of unit forces from the contact to the world.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | Iᴬᵢ | 3×3, 6×6 | inertia that joint i feels, the joints beyond it free | `articulated` |
//! | Uᵢ | 3, 6 | Iᴬᵢ sᵢ | `transmitted` |
//! | 1/Dᵢ | 1 | 1 / sᵢ·Uᵢ | `inverse_d` |
//! | uᵢ, ε | 1 | joint force left after what the bodies beyond already use | `drive` |
//! | H | 3×3, 2×2 | Delassus matrix of a point, world axes, 1/kg | `delassus` |
//!
//! Mimic joints tie bodies together that the recursion takes for free, so a coupled chain has no [`Articulation`]: use
//! the dense way ([`Kinematics::contact_inertia`] picks by itself).
//! Source: Featherstone (2008), table 7.1 (ABA).

use crate::algebra::{Algebra, Articulated, Force, Motion};
use crate::chain::Point;
use crate::error::ChainError;
use crate::workspace::Kinematics;
use nalgebra::SimdComplexField;
use nalgebra::{DMatrix, Dim, Matrix, RawStorageMut};
use num_traits::{One, Zero};

/// The chain at one configuration with its articulated inertias.
#[derive(Debug)]
pub struct Articulation<'a, 'b, A: Algebra> {
    kin: &'a mut Kinematics<'b, A>,
}

impl<'b, A: Algebra> Kinematics<'b, A> {
    /// The inward pass of the articulated-body algorithm. Allocates nothing.
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints.
    pub fn articulate(&mut self) -> Result<Articulation<'_, 'b, A>, ChainError> {
        self.articulate_with(None)
    }

    /// With inertia added to each coordinate, as a rotor's: it enters at the joint's own Dᵢ. Infinite, it makes 1/Dᵢ
    /// zero, and the joint passes on everything: it is locked.
    pub(crate) fn articulate_with(
        &mut self,
        added: Option<&[A::Scalar]>,
    ) -> Result<Articulation<'_, 'b, A>, ChainError> {
        if self.chain.is_coupled() {
            return Err(ChainError::Coupled { chain: self.chain.name().into() });
        }
        let (bodies, ws) = (&self.chain.bodies, &mut *self.ws);
        for (i, body) in bodies.iter().enumerate() {
            ws.articulated[i] = A::Articulated::from_rigid(&body.inertia.rotated(ws.rotation[i]));
        }
        for (i, body) in bodies.iter().enumerate().rev() {
            let u = ws.articulated[i].along(ws.axis[i]);
            let own = added.map_or_else(A::Scalar::zero, |added| added[body.v_index]);
            let inverse_d = A::Scalar::one() / (ws.axis[i].dot(u) + own);
            ws.transmitted[i] = u;
            ws.inverse_d[i] = inverse_d;
            if let Some(p) = body.parent {
                let felt = ws.articulated[i].without(u, inverse_d).shifted(ws.offset[i]);
                ws.articulated[p] += felt;
            }
        }
        Ok(Articulation { kin: self })
    }
}

impl<'a, 'b, A: Algebra> Articulation<'a, 'b, A> {
    /// The view of a workspace that holds a finished inward pass.
    pub(crate) fn of(kin: &'a mut Kinematics<'b, A>) -> Self {
        Self { kin }
    }

    /// Forward dynamics: q̈ = M⁻¹(τ − C q̇ − g). `gravity` in world axes, m/s². The damping and dry friction that the file
    /// gives its joints do not enter: put them into τ. Allocates nothing.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn forward_dynamics_into(
        &mut self,
        qd: &[A::Scalar],
        tau: &[A::Scalar],
        gravity: A::Vector,
        qdd: &mut [A::Scalar],
    ) -> Result<(), ChainError> {
        for (what, length) in [("qd", qd.len()), ("tau", tau.len()), ("qdd", qdd.len())] {
            self.kin.chain.check_nv(what, length)?;
        }
        self.kin.spread_velocity(qd);
        let (chain, ws) = (self.kin.chain, &mut *self.kin.ws);
        for (i, body) in chain.bodies.iter().enumerate() {
            let v = ws.velocity[i];
            ws.acceleration[i] = ws.force_free_rate(chain, i, qd);
            ws.force[i] = v.carry_force(body.inertia.rotated(ws.rotation[i]).apply(v));
        }
        self.sweep(tau, gravity, qdd);
        Ok(())
    }

    /// M⁻¹ · vector: the acceleration, or the velocity jump, that joint forces, or impulses, give. Allocates nothing.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn solve_into(&mut self, joint_force: &[A::Scalar], out: &mut [A::Scalar]) -> Result<(), ChainError> {
        self.kin.chain.check_nv("tau", joint_force.len())?;
        self.kin.chain.check_nv("qdd", out.len())?;
        let ws = &mut *self.kin.ws;
        ws.acceleration.fill(Motion::zero());
        ws.force.fill(Force::zero());
        self.sweep(joint_force, A::zero(), out);
        Ok(())
    }

    /// In: the force-free rates c in `acceleration`, the bias forces p in `force`. Inward: uᵢ = τᵢ − sᵢ·pᵢ. Outward:
    /// q̈ᵢ = (uᵢ − Uᵢ·a)/Dᵢ.
    fn sweep(&mut self, tau: &[A::Scalar], gravity: A::Vector, qdd: &mut [A::Scalar]) {
        let (bodies, ws) = (&self.kin.chain.bodies, &mut *self.kin.ws);
        for (i, body) in bodies.iter().enumerate().rev() {
            let u = tau[body.v_index] - ws.axis[i].dot(ws.force[i]);
            ws.drive[i] = u;
            if let Some(p) = body.parent {
                let c = ws.acceleration[i];
                let left = u - ws.transmitted[i].power(c);
                let felt = ws.force[i] + ws.articulated[i].apply(c) + ws.transmitted[i] * (left * ws.inverse_d[i]);
                let felt = felt.shifted(ws.offset[i]);
                ws.force[p] += felt;
            }
        }
        let base = Motion { angular: A::zero_angular(), linear: -gravity };
        for (i, body) in bodies.iter().enumerate() {
            let carried = body.parent.map_or(base, |p| ws.acceleration[p]).shifted(ws.offset[i]);
            let a = carried + ws.acceleration[i];
            let rate = (ws.drive[i] - ws.transmitted[i].power(a)) * ws.inverse_d[i];
            ws.acceleration[i] = a + ws.axis[i].at_rate(rate);
            qdd[body.v_index] = rate;
        }
    }

    /// The Delassus matrix of a point, LINEAR×LINEAR, world axes, 1/kg: fills all of `out`; allocates nothing.
    ///
    /// # Panics
    /// If `out` is smaller.
    pub fn delassus_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &self,
        point: Point<A>,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        out.fill(A::Scalar::zero());
        self.send_unit_forces(point, |i, epsilon| {
            for a in 0..A::LINEAR {
                let scaled = epsilon[a] * self.kin.ws.inverse_d[i];
                for b in 0..A::LINEAR {
                    out[(a, b)] += scaled * epsilon[b];
                }
            }
        });
    }

    /// A factor of the Delassus matrix: E, LINEAR×nv, with H = E Eᵀ.
    pub fn delassus_factor(&self, point: Point<A>) -> DMatrix<A::Scalar> {
        let mut e = DMatrix::zeros(A::LINEAR, self.kin.chain.nv);
        self.send_unit_forces(point, |i, epsilon| {
            let root = self.kin.ws.inverse_d[i].simd_sqrt();
            for k in 0..A::LINEAR {
                e[(k, self.kin.chain.bodies[i].v_index)] = epsilon[k] * root;
            }
        });
        e
    }

    /// Sends unit forces along each axis from a point to the world; each joint on the way keeps its share ε.
    fn send_unit_forces(&self, point: Point<A>, mut keep: impl FnMut(usize, [A::Scalar; 3])) {
        let Some(body) = point.body else { return };
        let ws = &*self.kin.ws;
        let r = self.kin.arm(body, point);
        let unit = |k: usize| {
            let e = A::vector(|i| if i == k { A::Scalar::one() } else { A::Scalar::zero() });
            Force::at(r, e)
        };
        let mut f = [unit(0), unit(1), unit(A::LINEAR - 1)]; // in the plane the third repeats the second, unread
        let mut next = Some(body);
        while let Some(i) = next {
            let epsilon = f.map(|f| ws.axis[i].dot(f));
            keep(i, epsilon);
            for k in 0..A::LINEAR {
                f[k] = (f[k] - ws.transmitted[i] * (epsilon[k] * ws.inverse_d[i])).shifted(ws.offset[i]);
            }
            next = self.kin.chain.bodies[i].parent;
        }
    }

    /// As [`Self::delassus_into`], in a new matrix.
    pub fn delassus(&self, point: Point<A>) -> DMatrix<A::Scalar> {
        let mut h = DMatrix::zeros(A::LINEAR, A::LINEAR);
        self.delassus_into(point, &mut h);
        h
    }
}

//! Derivatives of M, of the inverse dynamics and of the Jacobian of a point, in closed form.
//!
//! A unit motion of joint k moves its subtree as one rigid body. In axes that move with the subtree, M x changes there only
//! because the acceleration a_λ of the parent body (at joint accelerations x) turns backwards; on the joints between k and the
//! world it changes by the force F of the subtree, which turns with it:
//!
//! ```text
//! ∂(Mx)ⱼ/∂q_k = −(Iᶜⱼ sⱼ) · (s_k × a_λ)                j in the subtree of k
//! ∂(Mx)ⱼ/∂q_k = sⱼ · (s_k ×* F_k − Iᶜ_k (s_k × a_λ))     j between k and the world
//! ```
//!
//! The subtree's own part of F is F_k − Iᶜ_k a_λ, and x · (s ×* F) = −F · (s × x): summed over the joints with a second vector y of
//! joint accelerations,
//!
//! ```text
//! ∂(yᵀ M x)/∂q_k = −F_k(y) · (s_k × a_λ(x)) − F_k(x) · (s_k × a_λ(y))
//! ```
//!
//! **Inverse dynamics.** With velocities, too, the motion of joint k changes in these axes the velocity of every body of the subtree by
//! w and its acceleration by c + w × v, and a unit of q̇_k changes the velocity by s_k and the acceleration by d + s_k × v:
//!
//! ```text
//! w = v_λ × s_k,   c = a_λ × s_k + v_λ × w,   d = w + v_k × s_k
//! ```
//!
//! Here a are the spatial accelerations at q̈ of a base that accelerates by −gravity. The force f = I a + v ×* I v on a body changes by
//! I c + B w, or I d + B s_k, with B x = İ x + x ×* I v and the rate İ = v×* I − I v× of the inertia. Summed over a subtree, Iᶜ, İᶜ and
//! the momentum h = Σ I v give
//!
//! ```text
//! ∂τⱼ/∂q_k = sⱼ · (Iᶜⱼ c + Bᶜⱼ w),                        ∂τⱼ/∂q̇_k = sⱼ · (Iᶜⱼ d + Bᶜⱼ s_k)       j in the subtree of k
//! ∂τⱼ/∂q_k = sⱼ · (s_k ×* F_k + Iᶜ_k c + Bᶜ_k w),          ∂τⱼ/∂q̇_k = sⱼ · (Iᶜ_k d + Bᶜ_k s_k)      j between k and the world
//! ```
//!
//! A Jacobian column Jᵢ turns with joint k if it lies on the outer side of k, otherwise only the point moves:
//!
//! ```text
//! ∂Jᵢ/∂q_k = z_k × Jᵢ − zᵢ × (z_k × d),   zᵢ × (J_k − z_k × d)
//! ```
//!
//! **Tangent space.** Column k is the derivative along the motion with unit `qd[k]`. The axes of a floating joint are fixed in
//! its child body: each of its motions moves all six.
//!
//! | symbol | meaning | our name |
//! | --- | --- | --- |
//! | s, z | axis of a joint; its direction if it turns, else zero | `axis`, `turning` |
//! | Iᶜ | composite inertia | `composite` |
//! | Iᶜ s | momentum of the subtree at unit joint rate | `momentum` |
//! | a, F | accelerations at joint accelerations x, a_λ that of the parent body; force of the subtree | `velocity`, `force` |
//! | v, v_λ | velocities of a body and of the parent body of a joint | `velocity`, `below` |
//! | İᶜ, h | rate of the composite inertia; momentum of the subtree | `rate`, `momentum` |
//! | d | from the material point, which moves with its body, to the contact point: a vector that is constant in the world | `lever` |
//!
//! Source: Carpentier & Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018); those of M for zero velocity.

use crate::algebra::{Algebra, Axis, Force, Inertia, Motion};
use crate::body::Point;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::prepare::PreparedBody;
use crate::scratch::Link;
use nalgebra::{DMatrix, SMatrix};

/// The first axis of the joint that body k belongs to: its own, or the first of a floating joint.
fn first_axis<A: Algebra>(prepared: &[PreparedBody<A>], k: usize) -> usize {
    (0..=k).rev().find(|&i| !A::rides_along(prepared[i].joint)).unwrap_or(k)
}

fn turning<A: Algebra>(axis: Axis<A>) -> A::Angular {
    axis.at_rate(nalgebra::convert(1.0)).angular
}

impl<A: Algebra> Kinematics<'_, A> {
    /// ∂(M x)/∂q, nv×nv, for a vector x (length nv), in the tangent space of q.
    ///
    /// # Panics
    /// If x is shorter than nv.
    pub fn mass_matrix_derivatives(&mut self, x: &[A::Scalar]) -> DMatrix<A::Scalar> {
        let (chain, n) = (self.chain, self.chain.bodies.len());
        let prepared = &chain.prepared;
        self.composites();
        let links = &self.ws.links;
        let momentum: Vec<Force<A>> = (0..n).map(|j| self.ws.inertia[j].along(links[j].axis)).collect();
        self.spread(x, &self.own_inertia());
        let ws = &*self.ws;
        let mut out = DMatrix::zeros(chain.nv, chain.nv);
        for k in 0..n {
            let (first, v, link) = (first_axis(prepared, k), prepared[k].v_index, &ws.links[k]);
            let unit = link.axis.at_rate(nalgebra::convert(1.0));
            let below = prepared[first]
                .parent
                .map_or(Motion::zero(), |p| ws.velocity[p].shifted(link.position - ws.links[p].position));
            let turned = unit.carry(below);
            for j in first..prepared[k].end {
                let there = turned.shifted(ws.links[j].position - link.position);
                out[(prepared[j].v_index, v)] -= momentum[j].power(there);
            }
            let mut force = unit.carry_force(ws.force[k]) - ws.inertia[k].apply(turned);
            let (mut at, mut next) = (link.position, prepared[first].parent);
            while let Some(j) = next {
                force = force.shifted(at - ws.links[j].position);
                at = ws.links[j].position;
                out[(prepared[j].v_index, v)] += ws.links[j].axis.dot(force);
                next = prepared[j].parent;
            }
        }
        out
    }

    /// ∂(xₐᵀ M x_b)/∂q_k for each pair of the vectors x (length nv each): a K×K matrix for each k, in the tangent space of q.
    ///
    /// # Panics
    /// If an x is shorter than nv.
    pub fn quadratic_derivatives<const K: usize>(&mut self, x: [&[A::Scalar]; K]) -> Vec<SMatrix<A::Scalar, K, K>> {
        let own = self.own_inertia();
        let spread = x.map(|x| {
            self.spread(x, &own);
            (self.ws.velocity.clone(), self.ws.force.clone())
        });
        let (prepared, links) = (&self.chain.prepared, &self.ws.links);
        let mut out = vec![SMatrix::zeros(); self.chain.nv];
        for (k, link) in links.iter().enumerate() {
            // A body of the world does not accelerate.
            let Some(p) = prepared[first_axis(prepared, k)].parent else { continue };
            let (unit, lever) = (link.axis.at_rate(nalgebra::convert(1.0)), link.position - links[p].position);
            let turned = spread.each_ref().map(|(velocity, _)| unit.carry(velocity[p].shifted(lever)));
            let of = &mut out[prepared[k].v_index];
            for (a, (_, force)) in spread.iter().enumerate() {
                for (b, turned) in turned.iter().enumerate() {
                    let power = force[k].power(*turned);
                    of[(a, b)] -= power;
                    of[(b, a)] -= power;
                }
            }
        }
        out
    }

    /// ∂τ/∂q and ∂τ/∂q̇, nv×nv each, of the inverse dynamics τ = M q̈ + C q̇ + g at these velocities and accelerations (length nv), in the
    /// tangent space of q: column k is the derivative along the motion with unit `qd[k]`. `gravity` in world axes, m/s². ∂τ/∂q̈ is M.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn inverse_dynamics_derivatives(
        &mut self,
        qd: &[A::Scalar],
        qdd: &[A::Scalar],
        gravity: A::Vector,
    ) -> Result<[DMatrix<A::Scalar>; 2], ChainError> {
        let (chain, n) = (self.chain, self.chain.bodies.len());
        chain.check_nv("qd", qd.len())?;
        chain.check_nv("qdd", qdd.len())?;
        let prepared = &chain.prepared;
        self.composites();
        self.spread_velocity(qd);
        let own = self.own_inertia();
        let ws = &mut *self.ws;
        let links = &ws.links;
        let base = Motion { angular: A::zero_angular(), linear: -gravity };
        // v_λ and a_λ at the origin of each body, and the accelerations of the bodies.
        let (mut below, mut accelerations) = (Vec::with_capacity(n), Vec::<Motion<A>>::with_capacity(n));
        for (j, body) in prepared.iter().enumerate() {
            let (v, a) = prepared[first_axis(prepared, j)].parent.map_or((Motion::zero(), base), |p| {
                let lever = links[j].position - links[p].position;
                (ws.velocity[p].shifted(lever), accelerations[p].shifted(lever))
            });
            below.push((v, a));
            let before = body.parent.map_or(base, |p| accelerations[p].shifted(links[j].offset));
            let Link { axis, .. } = links[j];
            let own = axis.at_rate(qdd[body.v_index]) + v.carry(axis.at_rate(qd[body.v_index]));
            accelerations.push(before + own);
        }
        // h, F and İᶜ.
        let mut momentum: Vec<Force<A>> = own.iter().zip(&ws.velocity).map(|(own, v)| own.apply(*v)).collect();
        let mut rate: Vec<Inertia<A>> = own.iter().zip(&ws.velocity).map(|(own, v)| own.rate(*v)).collect();
        for j in 0..n {
            ws.force[j] = own[j].apply(accelerations[j]) + ws.velocity[j].carry_force(momentum[j]);
        }
        chain.sum_subtrees(links, &mut momentum, |momentum, r| momentum.shifted(r));
        chain.sum_subtrees(links, &mut ws.force, |force, r| force.shifted(r));
        chain.sum_subtrees(links, &mut rate, |rate, r| rate.shifted(r));
        // sⱼᵀ Iᶜⱼ and sⱼᵀ Bᶜⱼ.
        let unit = |j: usize| links[j].axis.at_rate(nalgebra::convert(1.0));
        let rows: Vec<[Force<A>; 2]> = (0..n)
            .map(|j| {
                let axis = links[j].axis;
                [ws.inertia[j].along(axis), rate[j].along(axis) - unit(j).carry_force(momentum[j])]
            })
            .collect();
        let (mut by_q, mut by_qd) = (DMatrix::zeros(chain.nv, chain.nv), DMatrix::zeros(chain.nv, chain.nv));
        for (k, body) in prepared.iter().enumerate() {
            let (first, v, s) = (first_axis(prepared, k), body.v_index, unit(k));
            let last = (k + 1..n).take_while(|&j| A::rides_along(prepared[j].joint)).last().unwrap_or(k);
            let (outer, acceleration) = below[k];
            let w = outer.carry(s);
            let c = acceleration.carry(s) + outer.carry(w);
            let d = w + ws.velocity[last].carry(s);
            for j in first..body.end {
                let (r, u) = (links[j].position - links[k].position, prepared[j].v_index);
                let [inertia, turned] = rows[j];
                by_q[(u, v)] += inertia.power(c.shifted(r)) + turned.power(w.shifted(r));
                by_qd[(u, v)] += inertia.power(d.shifted(r)) + turned.power(s.shifted(r));
            }
            let bent = |x: Motion<A>| rate[k].apply(x) + x.carry_force(momentum[k]);
            let mut forces =
                [s.carry_force(ws.force[k]) + ws.inertia[k].apply(c) + bent(w), ws.inertia[k].apply(d) + bent(s)];
            let (mut at, mut next) = (links[k].position, prepared[first].parent);
            while let Some(j) = next {
                forces = forces.map(|force| force.shifted(at - links[j].position));
                at = links[j].position;
                let u = prepared[j].v_index;
                by_q[(u, v)] += links[j].axis.dot(forces[0]);
                by_qd[(u, v)] += links[j].axis.dot(forces[1]);
                next = prepared[j].parent;
            }
        }
        Ok([by_q, by_qd])
    }

    /// Inertias of the bodies, in world axes.
    fn own_inertia(&self) -> Vec<Inertia<A>> {
        let bodies = self.chain.bodies.iter().zip(&self.ws.links);
        bodies.map(|(body, link)| body.inertia.rotated(link.rotation)).collect()
    }

    /// Accelerations of the bodies at joint accelerations x, into `velocity`, and forces of the subtrees.
    fn spread(&mut self, x: &[A::Scalar], own: &[Inertia<A>]) {
        self.spread_velocity(x);
        let ws = &mut *self.ws;
        for ((force, own), velocity) in ws.force.iter_mut().zip(own).zip(&ws.velocity) {
            *force = own.apply(*velocity);
        }
        self.chain.sum_subtrees(&ws.links, &mut ws.force, |force, r| force.shifted(r));
    }

    /// Visits the derivatives ∂Jᵢ/∂q_k that are not zero: i, k, and the derivative of column i of the Jacobian of a point at
    /// the constant `lever` (world axes, m) from the material `point`, in the tangent space of q. Bodies that share a
    /// coordinate are visited one by one: add them.
    pub fn for_each_jacobian_derivative(
        &self,
        point: Point<A>,
        lever: A::Vector,
        mut visit: impl FnMut(usize, usize, A::Vector),
    ) {
        let (prepared, links) = (&self.chain.prepared, &self.ws.links);
        let mut movers = Vec::new();
        self.for_each_mover(point, |i, r| movers.push((i, links[i].axis.point_velocity(r + lever))));
        for &(k, column_k) in &movers {
            let (first, z_k) = (first_axis(prepared, k), turning(links[k].axis));
            let swept = A::swing(z_k, lever);
            for &(i, column_i) in &movers {
                let z_i = turning(links[i].axis);
                let rate = if i >= first {
                    A::swing(z_k, column_i) - A::swing(z_i, swept)
                } else {
                    A::swing(z_i, column_k - swept)
                };
                visit(prepared[i].v_index, prepared[k].v_index, rate);
            }
        }
    }
}

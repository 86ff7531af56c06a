//! Inverse dynamics by the recursive Newton–Euler algorithm (RNEA): `M(q) q̈ + C(q, q̇) q̇ + g(q) = τ`, the equation of motion
//! without contact. Its outward pass is also that of the articulated-body algorithm and of the drift J̇ q̇.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | C q̇ + g | nv | bias force | `bias` |
//! | g | nv | gravity force | `gravity_force` |
//! | ωᵢ, ω̇ᵢ, aᵢ | – | angular velocity and acceleration of body i; acceleration of its origin | `spin`, `spin_rate`, `acceleration` |
//! | fᵢ | – | force on body i | `force` |
//!
//! Source: Featherstone (2008), table 5.1, in world axes (see [`crate::algebra`]).

use crate::algebra::{Algebra, Axis, Force, Inertia, Motion};
use crate::chain::Chain;
use crate::error::ChainError;
use crate::kinematics::{Kinematics, Workspace};
use crate::prepare::ParentSlot;
use crate::scratch::{Flow, Link};
use nalgebra::DVector;
use num_traits::Zero;

impl<A: Algebra> Kinematics<'_, A> {
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
        for body in &self.chain.prepared {
            tau[body.v_index] += body.rotor * qdd[body.v_index];
        }
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
        for (i, body) in self.chain.prepared.iter().enumerate() {
            let h = A::rotate(ws.links[i].rotation, body.inertia.first_moment);
            ws.force[i] = Force { moment: -A::moment(h, gravity), force: -(gravity * body.inertia.mass) };
        }
        self.gather_force(tau.as_mut_slice());
        tau
    }

    /// Outward pass of RNEA: accelerations, for a base that accelerates by −gravity, and the forces that cause them.
    pub(crate) fn spread_force(&mut self, qd: &[A::Scalar], qdd: Option<&[A::Scalar]>, gravity: A::Vector) {
        let (chain, ws) = (self.chain, &mut *self.ws);
        let base = Flow::base(-gravity);
        let mut flow = base;
        for (i, body) in chain.prepared.iter().enumerate() {
            let outer = ws.flow_below(i, body.parent, &flow, &base);
            flow = ws.flow_on(chain, i, &outer, qd, qdd.map_or(A::Scalar::zero(), |qdd| qdd[body.v_index]));
            let Flow { spin, spin_rate, acceleration } = flow;
            let Inertia { mass, first_moment: h, rotational } = body.turned_inertia(ws.links[i].rotation);
            let mut force = A::swing(spin_rate, h) + A::swing(spin, A::swing(spin, h));
            if !A::turns(body.joint) {
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
        tau.fill(A::Scalar::zero());
        let (prepared, ws) = (&self.chain.prepared, &mut *self.ws);
        let mut carried = Force::zero();
        for (i, body) in prepared.iter().enumerate().rev() {
            let Link { offset, ref axis, .. } = ws.links[i];
            let mut force = ws.force[i];
            if body.end > i + 1 {
                force += carried;
            }
            tau[body.v_index] += axis.dot(force);
            if body.parent_slot != ParentSlot::World {
                carried = force.shifted(offset);
                body.parent_slot.add(&mut ws.force, carried);
            }
        }
    }
}

impl<A: Algebra> Workspace<A> {
    /// Motion of the parent of body i. `before` is the motion of body i − 1, usually the parent: it is kept in registers.
    #[inline(always)]
    pub(crate) fn flow_below(&self, i: usize, parent: Option<usize>, before: &Flow<A>, base: &Flow<A>) -> Flow<A> {
        match parent {
            Some(p) if p + 1 == i => *before,
            Some(p) => self.flow[p],
            None => *base,
        }
    }

    /// Motion of body i for its parent's motion, joint velocities `qd` and joint acceleration `qdd`.
    #[inline(always)]
    pub(crate) fn flow_on(
        &self,
        chain: &Chain<A>,
        i: usize,
        outer: &Flow<A>,
        qd: &[A::Scalar],
        qdd: A::Scalar,
    ) -> Flow<A> {
        let body = &chain.prepared[i];
        let Link { offset, axis, .. } = self.links[i];
        let (turn, drift) = self.drift(chain, i, outer.spin, qd);
        let carried = outer.acceleration + A::swing(outer.spin_rate, offset) + drift;
        match axis {
            Axis::Turn(z) => Flow {
                spin: outer.spin + z * qd[body.v_index],
                spin_rate: outer.spin_rate + turn + z * qdd,
                acceleration: carried,
            },
            Axis::Slide(z) => Flow { spin: outer.spin, spin_rate: outer.spin_rate, acceleration: carried + z * qdd },
        }
    }

    /// Velocity-dependent terms of ω̇ and of the acceleration of body i, without ω̇ × r, for the parent's ω. Hinge:
    /// ω × z q̇, and ω × (ω × r). Slider: zero, and 2 ω × z q̇ + ω × (ω × r).
    #[inline(always)]
    pub(crate) fn drift(
        &self,
        chain: &Chain<A>,
        i: usize,
        spin: A::Angular,
        qd: &[A::Scalar],
    ) -> (A::Angular, A::Vector) {
        let body = &chain.prepared[i];
        let Link { offset, axis, .. } = self.links[i];
        let centripetal = A::swing(spin, A::swing(spin, offset));
        match axis {
            Axis::Turn(_) if A::rides_along(body.joint) => self.drift_of_floating(chain, i, qd),
            Axis::Turn(z) => (A::cross_angular(spin, z * qd[body.v_index]), centripetal),
            Axis::Slide(z) => {
                let carried = A::swing(spin, z * qd[body.v_index]);
                (A::zero_angular(), centripetal + carried + carried)
            }
        }
    }

    /// The same for the rotational axes of a floating joint, which all move with the parent body of the joint: ω × z q̇ and
    /// z q̇ × u, with ω the angular velocity of that body and u the joint's linear velocity.
    #[cold]
    fn drift_of_floating(&self, chain: &Chain<A>, i: usize, qd: &[A::Scalar]) -> (A::Angular, A::Vector) {
        let mut first = i;
        while A::rides_along(chain.prepared[first].joint) {
            first -= 1;
        }
        let mut joint = Motion::zero();
        for k in first..i {
            if let slide @ Axis::Slide(_) = self.links[k].axis {
                joint = joint + slide.at_rate(qd[chain.prepared[k].v_index]);
            }
        }
        let own = self.links[i].axis.at_rate(qd[chain.prepared[i].v_index]).angular;
        // The first axis is a slider: its ω is that of the parent body.
        (A::cross_angular(self.flow[first].spin, own), A::swing(own, joint.linear))
    }
}

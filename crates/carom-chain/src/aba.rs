//! Forward dynamics by the articulated-body algorithm (ABA) and the Delassus matrix by the same recursion, in time
//! proportional to the number of bodies.
//!
//! One inward pass computes the articulated inertias. They give the factorisation `M = (1+HφK) D (1+HφK)ᵀ` without forming
//! M (Rodriguez, Jain & Kreutz-Delgado 1991): a solve with M is two sweeps, and `H = J M⁻¹ Jᵀ = Σ ε εᵀ / D` is one inward
//! sweep of unit forces from the contact to the world.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | Iᴬᵢ | 3×3, 6×6 | articulated inertia: that of body i with the joints of its subtree free | `articulated` |
//! | Uᵢ | 3, 6 | Iᴬᵢ sᵢ | `transmitted` |
//! | 1/Dᵢ | 1 | 1 / sᵢ·Uᵢ | `inverse_d` |
//! | uᵢ, ε | 1 | force on joint i after the joints beyond it are eliminated | `drive` |
//! | H | 3×3, 2×2 | Delassus matrix of a point, world axes, 1/kg | `delassus` |
//!
//! The recursion requires independent joints, so a chain with mimic joints has no [`Articulation`]: use the dense methods
//! ([`Kinematics::contact_inertia`], [`Kinematics::respond`] and [`Kinematics::forward_dynamics`] choose the method).
//! Source: Featherstone (2008), table 7.1 (ABA).

use crate::algebra::{Algebra, Articulated, Axis, Force, Inertia, Motion};
use crate::body::Point;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::prepare::ParentSlot;
use crate::rounding::rounding;
use crate::scratch::{Flow, Free, Link};
use nalgebra::{DMatrix, Dim, Matrix, RawStorageMut, RealField};
use num_traits::{One, Zero};

/// The chain at one configuration with its articulated inertias.
#[derive(Debug)]
pub struct Articulation<'a, 'b, A: Algebra> {
    pub(crate) kin: &'a mut Kinematics<'b, A>,
}

impl<'b, A: Algebra> Kinematics<'b, A> {
    /// The inward pass of the articulated-body algorithm. Does not allocate. It does not check that every joint moves
    /// inertia: for a singular M the results are infinite or meaningless.
    ///
    /// # Errors
    /// [`ChainError::Coupled`] for a chain with mimic joints.
    #[doc(hidden)]
    pub fn articulate(&mut self) -> Result<Articulation<'_, 'b, A>, ChainError> {
        self.articulate_with(&[])
    }

    /// The same with inertia added to each coordinate, for example that of a rotor: it is added to the joint's Dᵢ. Infinite
    /// inertia makes 1/Dᵢ zero, which locks the joint. `added` is empty or has length nv.
    pub(crate) fn articulate_with(&mut self, added: &[A::Scalar]) -> Result<Articulation<'_, 'b, A>, ChainError> {
        if self.chain.is_coupled() {
            return Err(ChainError::Coupled { chain: self.chain.name().into() });
        }
        let (chain, ws) = (self.chain, &mut *self.ws);
        // Contribution of the first child of body i, which is the next body: kept in registers.
        let mut to_parent = A::Articulated::from_rigid(&Inertia::zero());
        for (i, (prepared, body)) in chain.prepared.iter().zip(&chain.bodies).enumerate().rev() {
            let Link { rotation, offset, ref axis, .. } = ws.links[i];
            let rigid = body.inertia.rotated(rotation);
            ws.inertia[i] = rigid;
            let (below, own) = ws.free.split_at_mut(i);
            let own = &mut own[0];
            let mut articulated = A::Articulated::from_rigid(&rigid);
            if prepared.end > i + 1 {
                articulated += to_parent;
            }
            if prepared.branches {
                articulated += own.articulated;
            }
            let u = articulated.along(*axis);
            let mut d = axis.dot(u) + prepared.rotor;
            if let Some(more) = added.get(prepared.v_index) {
                d += *more;
            }
            let inverse_d = A::Scalar::one() / d;
            (own.articulated, own.transmitted, own.inverse_d) = (articulated, u, inverse_d);
            if prepared.parent_slot != ParentSlot::World {
                to_parent = articulated.without(u, inverse_d).shifted(offset);
                match prepared.parent_slot {
                    ParentSlot::World | ParentSlot::Previous => {}
                    ParentSlot::Last(p) => below[p].articulated = to_parent,
                    ParentSlot::Between(p) => below[p].articulated += to_parent,
                }
            }
        }
        Ok(Articulation { kin: self })
    }
}

impl<'b, A: Algebra> Kinematics<'b, A>
where
    A::Scalar: RealField,
{
    /// [`Kinematics::articulate`], with an error if a joint moves no inertia: if Dᵢ is no larger than the rounding error of
    /// the composite inertia of the joint's subtree.
    pub(crate) fn articulate_checked(&mut self, added: &[A::Scalar]) -> Result<Articulation<'_, 'b, A>, ChainError> {
        self.composites();
        let rounding: A::Scalar = rounding();
        let size = |(link, composite): (&Link<A>, &Inertia<A>)| match link.axis {
            Axis::Turn(z) => A::dot_angular(z, z) * A::trace(composite.rotational),
            Axis::Slide(z) => A::dot(z, z) * composite.mass,
        };
        // The inward pass overwrites the composite inertias, so their sizes are stored in `drive`, which is used only later.
        for ((free, link), composite) in self.ws.free.iter_mut().zip(&self.ws.links).zip(&self.ws.inertia) {
            free.drive = size((link, composite));
        }
        self.articulate_with(added)?;
        for i in 0..self.chain.bodies.len() {
            let Free { inverse_d, drive: size, .. } = self.ws.free[i];
            let d = A::Scalar::one() / inverse_d;
            let moves_inertia = d > size * rounding; // false for NaN too
            if !moves_inertia {
                return Err(self.no_inertia(self.chain.bodies[i].v_index));
            }
        }
        Ok(Articulation { kin: self })
    }
}

impl<A: Algebra> Articulation<'_, '_, A> {
    /// Forward dynamics: q̈ = M⁻¹(τ − C q̇ − g). `qd`, `tau` and `qdd` have length nv; `gravity` in world axes, m/s². Joint
    /// damping and friction of the file are not included: add them to τ. Does not allocate.
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
        // Accelerations due to velocities and gravity, without ω̇ × r, and the forces that cause them.
        let (chain, ws) = (self.kin.chain, &mut *self.kin.ws);
        let base = Flow::base(-gravity);
        let mut flow = base;
        for (i, body) in chain.prepared.iter().enumerate() {
            let outer = ws.flow_below(i, body.parent, &flow, &base);
            let (turn, drift) = ws.drift(chain, i, outer.spin, qd);
            let spin = outer.spin + ws.links[i].axis.at_rate(qd[body.v_index]).angular;
            let acceleration = outer.acceleration + drift;
            let Inertia { mass, first_moment: h, rotational } = ws.inertia[i];
            flow = Flow { spin, spin_rate: turn, acceleration };
            ws.flow[i] = flow;
            ws.force[i] = Force {
                moment: A::cross_angular(spin, A::apply_inertia(rotational, spin)) + A::moment(h, acceleration),
                force: acceleration * mass + A::swing(spin, A::swing(spin, h)),
            };
        }
        self.sweep::<true>(tau, qdd);
        Ok(())
    }

    /// Solves M x = `joint_force`: joint accelerations for joint forces, or velocity jumps for joint impulses. Both slices
    /// have length nv. Does not allocate.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub(crate) fn solve_into(&mut self, joint_force: &[A::Scalar], out: &mut [A::Scalar]) -> Result<(), ChainError> {
        self.kin.chain.check_nv("tau", joint_force.len())?;
        self.kin.chain.check_nv("qdd", out.len())?;
        self.kin.ws.force.fill(Force::zero());
        self.sweep::<false>(joint_force, out);
        Ok(())
    }

    /// Input: the bias forces p in `force` and, with `TURNS`, the velocity-dependent rates c of ω in `flow`.
    /// Inward: uᵢ = τᵢ − sᵢ·pᵢ. Outward: q̈ᵢ = (uᵢ − Uᵢ·a)/Dᵢ. In the plane c is zero.
    fn sweep<const TURNS: bool>(&mut self, tau: &[A::Scalar], qdd: &mut [A::Scalar]) {
        let (prepared, ws) = (&self.kin.chain.prepared, &mut *self.kin.ws);
        let turns = TURNS && A::ANGULAR > 1;
        let mut to_parent = Force::zero();
        for (i, body) in prepared.iter().enumerate().rev() {
            let Link { offset, ref axis, .. } = ws.links[i];
            let own = &mut ws.free[i];
            let mut force = ws.force[i];
            if body.end > i + 1 {
                force += to_parent;
            }
            let u = tau[body.v_index] - axis.dot(force);
            own.drive = u;
            if body.parent_slot != ParentSlot::World {
                let mut left = u;
                if turns {
                    let c = ws.flow[i].spin_rate;
                    left -= A::dot_angular(c, own.transmitted.moment);
                    force += own.articulated.along(Axis::Turn(c));
                }
                to_parent = (force + own.transmitted * (left * own.inverse_d)).shifted(offset);
                body.parent_slot.add(&mut ws.force, to_parent);
            }
        }
        self.kin.accelerate(turns, |v, rate| qdd[v] = rate);
    }

    /// The Delassus matrix H of a point, 3×3 (2×2 in the plane), world axes, 1/kg. Overwrites all of `out`; does not
    /// allocate.
    ///
    /// # Panics
    /// If `out` is smaller.
    pub fn delassus_into<R: Dim, C: Dim, S: RawStorageMut<A::Scalar, R, C>>(
        &self,
        point: Point<A>,
        out: &mut Matrix<A::Scalar, R, C, S>,
    ) {
        out.fill(A::Scalar::zero());
        let Some(body) = point.body else { return };
        self.kin.send_unit_forces(body, point, |i, epsilon| {
            let scaled = A::times(epsilon, self.kin.ws.free[i].inverse_d);
            for a in 0..A::LINEAR {
                for b in 0..A::LINEAR {
                    out[(a, b)] += A::linear_part(scaled, a) * A::linear_part(epsilon, b);
                }
            }
        });
    }

    /// As [`Self::delassus_into`]; returns a new matrix.
    pub fn delassus(&self, point: Point<A>) -> DMatrix<A::Scalar> {
        let mut h = DMatrix::zeros(A::LINEAR, A::LINEAR);
        self.delassus_into(point, &mut h);
        h
    }
}

impl<A: Algebra> Kinematics<'_, A> {
    /// Propagates unit forces along each axis from a point to the world, and calls `keep` with each joint's ε.
    pub(crate) fn send_unit_forces(&self, body: usize, point: Point<A>, mut keep: impl FnMut(usize, A::Vector)) {
        let ws = &*self.ws;
        let r = self.arm(body, point);
        let unit = |k: usize| {
            let e = A::vector(|i| if i == k { A::Scalar::one() } else { A::Scalar::zero() });
            Force::at(r, e)
        };
        let mut f = [unit(0), unit(1), unit(A::LINEAR - 1)]; // in the plane the third is not used
        let mut next = Some(body);
        while let Some(i) = next {
            let epsilon = f.map(|f| ws.links[i].axis.dot(f));
            keep(i, A::vector(|k| epsilon[k]));
            for k in 0..A::LINEAR {
                f[k] =
                    (f[k] - ws.free[i].transmitted * (epsilon[k] * ws.free[i].inverse_d)).shifted(ws.links[i].offset);
            }
            next = self.chain.bodies[i].parent;
        }
    }

    /// The outward pass q̈ᵢ = (uᵢ − Uᵢ·a)/Dᵢ for the forces u in `drive`; calls `keep` with each coordinate and its q̈. With
    /// `turns`, the velocity-dependent rates c of ω in `flow` are added.
    #[inline(always)]
    pub(crate) fn accelerate(&mut self, turns: bool, mut keep: impl FnMut(usize, A::Scalar)) {
        let (prepared, ws) = (&self.chain.prepared, &mut *self.ws);
        let mut a = Motion::zero();
        for (i, body) in prepared.iter().enumerate() {
            let Link { offset, ref axis, .. } = ws.links[i];
            let carried = match body.parent {
                Some(p) if p + 1 == i => a.shifted(offset),
                Some(p) => ws.free[p].acceleration.shifted(offset),
                None => Motion::zero(),
            };
            let own = &mut ws.free[i];
            a = carried;
            if turns {
                a.angular += ws.flow[i].spin_rate;
            }
            let rate = (own.drive - own.transmitted.power(a)) * own.inverse_d;
            a = a + axis.at_rate(rate);
            own.acceleration = a;
            keep(body.v_index, rate);
        }
    }
}

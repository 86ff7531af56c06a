//! The response at a point for the poses of a workspace, and what is read off a response.

use super::fused::{Memory, eliminate, row_length};
use super::topology::Row;
use super::{ContactPoint, Keep, LONG, PointResponse, ResponseMemory};
use crate::aba::Articulation;
use crate::algebra::Algebra;
use crate::body::Point;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::prepare::Subspace;
use crate::rounding::rounding;
use nalgebra::{DMatrixViewMut, RealField, SMatrix, convert};
use num_traits::{One, Zero};

impl<A: Algebra> PointResponse<'_, A> {
    /// J q̇, the velocity of the point for joint velocities of length nv, world axes, m/s.
    #[inline(always)]
    pub fn velocity(&self, qd: &[A::Scalar]) -> A::Vector {
        let mut velocity = A::zero();
        for (column, rate) in self.jacobian.iter().zip(qd) {
            velocity = A::plus(velocity, A::times(*column, *rate));
        }
        velocity
    }

    /// T = ½ q̇ᵀ M q̇, J: by M, which the response must contain.
    #[inline(always)]
    pub fn kinetic_energy(&self, qd: &[A::Scalar]) -> A::Scalar {
        let (mut twice, n) = (A::Scalar::zero(), qd.len());
        for v in 0..n {
            // Σ over pairs of joints: M is symmetric.
            let mut momentum = A::Scalar::zero();
            for (w, rate) in qd[..v].iter().enumerate() {
                momentum += self.mass_matrix[v * n + w] * *rate;
            }
            twice += (self.mass_matrix[v * n + v] * qd[v] + momentum + momentum) * qd[v];
        }
        twice * convert(0.5)
    }
}

impl<A: Algebra> Articulation<'_, '_, A> {
    /// What a unit impulse at a point along `direction` (world axes) does: `row` becomes Jᵀ d, the impulse on the joints, and
    /// `response` M⁻¹Jᵀ d, the jump of the joint velocities; both of length nv. For any scalar, SIMD lanes included, without
    /// branches and allocations; it is not checked that the joints move inertia.
    ///
    /// # Errors
    /// [`ChainError::WrongLength`].
    pub fn respond_along(
        &mut self,
        point: Point<A>,
        direction: A::Vector,
        row: &mut [A::Scalar],
        response: &mut [A::Scalar],
    ) -> Result<(), ChainError> {
        row.fill(A::Scalar::zero());
        self.kin.add_point_force(point, direction, row)?;
        self.solve_into(row, response)
    }
}

impl<A: Algebra> PointResponse<'_, A>
where
    A::Scalar: RealField,
{
    /// Whether an impulse along the normal moves the point along it: √(nᵀHn) > 64 ε √(Σ lₖ²/Dₖ). `false` for NaN.
    #[inline(always)]
    pub fn moves(&self) -> bool {
        self.mobility > self.mobility_of_levers() * rounding::<A::Scalar>() * rounding()
    }

    /// Σ lₖ²/Dₖ, 1/kg: the mobility of the same chain with its levers along the direction. No mobility of the point is larger,
    /// and one of (64 ε)² of it is rounding.
    #[inline(always)]
    pub(crate) fn mobility_of_levers(&self) -> A::Scalar {
        let mut sum = A::Scalar::zero();
        for (lever, inverse_d) in self.levers.iter().zip(self.inverse_d) {
            sum += *lever * (*lever * *inverse_d);
        }
        sum
    }

    /// Whether H, rotated into contact axes, is regular beyond doubt: its least eigenvalue, which is more than det H/(tr H)^(D−1), is
    /// far above the rounding of its trace, which a rotation spreads over all entries, and its trace far above the rounding of the
    /// levers. Otherwise [`Self::delassus_in`] has the rank of H.
    #[doc(hidden)]
    #[inline(always)]
    pub fn is_regular<const D: usize>(&self, h: &SMatrix<A::Scalar, D, D>) -> bool {
        /// √ε: half of the digits of the least eigenvalue are left.
        const CLEAR: f64 = 1.0 / (1u64 << 26) as f64;
        let clear: A::Scalar = convert(CLEAR);
        let trace = h.trace();
        let (det, power) = match D {
            1 => (h[(0, 0)], A::Scalar::one()),
            2 => (h[(0, 0)] * h[(1, 1)] - h[(0, 1)] * h[(0, 1)], trace),
            _ => (h.fixed_view::<3, 3>(0, 0).determinant(), trace * trace),
        };
        det > clear * trace * power && trace > clear * clear * self.mobility_of_levers()
    }

    /// H in these orthonormal axes, as a Gram matrix in them: each entry is a sum over joints, with the rounding error of the
    /// terms of this sum, and not with that of the largest entry of H, as H in world axes would have after a rotation. So H keeps
    /// the rank that its joints give it: what is rounding of a joint's lever in its row of Y is no motion. Rows and columns of axes
    /// along which the point does not move, by the rule of [`Self::moves`], are exactly zero.
    pub fn delassus_in<const D: usize>(&self, axes: [A::Vector; D]) -> SMatrix<A::Scalar, D, D> {
        let mut h = SMatrix::zeros();
        let rows = self.reduced_jacobian.iter().zip(self.inverse_d).zip(self.levers);
        for ((y, inverse_d), lever) in rows {
            let rounding = *lever * rounding();
            let along = axes.map(|axis| {
                let along = A::dot(*y, axis);
                let still = along <= rounding && along >= -rounding; // false for NaN
                if still { A::Scalar::zero() } else { along }
            });
            for i in 0..D {
                let scaled = along[i] * *inverse_d;
                for j in 0..=i {
                    h[(i, j)] += scaled * along[j];
                }
            }
        }
        let nothing = self.mobility_of_levers() * rounding::<A::Scalar>() * rounding();
        let moves: [bool; D] = std::array::from_fn(|i| h[(i, i)] > nothing);
        for i in 0..D {
            for j in 0..=i {
                if !(moves[i] && moves[j]) {
                    h[(i, j)] = A::Scalar::zero();
                }
                h[(j, i)] = h[(i, j)];
            }
        }
        h
    }

    /// Whether some joint may move no inertia: its D is below 1e-6 of its diagonal entry of M, or not a number.
    /// [`Kinematics::check_inertia`] decides.
    #[doc(hidden)]
    #[inline(always)]
    pub fn is_doubtful(&self) -> bool {
        let n = self.inverse_d.len();
        if self.mass_matrix.len() != n * n {
            return false;
        }
        let mut doubt = false;
        for k in 0..n {
            let share = self.mass_matrix[k * (n + 1)] * self.inverse_d[k];
            let clear = share >= A::Scalar::zero() && share < convert(1e6); // false for NaN too
            doubt |= !clear;
        }
        doubt
    }
}

impl<A: Algebra> Kinematics<'_, A>
where
    A::Scalar: RealField,
{
    /// The response of the chain at a point, for the unit normal n in world axes. `added`: inertia W added to the
    /// diagonal of M, by coordinate, kg m² or kg, 0 or more, infinite for a locked joint; empty for none. All zero for a point
    /// of the world. Allocates only at the first call for a workspace.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular; [`ChainError::WrongLength`] for `added`.
    pub fn contact(
        &mut self,
        point: Point<A>,
        normal: A::Vector,
        added: &[A::Scalar],
    ) -> Result<PointResponse<'_, A>, ChainError> {
        let (chain, nv) = (self.chain, self.chain.nv);
        if !added.is_empty() {
            chain.check_nv("added inertia", added.len())?;
        }
        let mut memory = std::mem::take(&mut self.ws.response);
        let done = match point.body {
            None => {
                memory.clear(nv, 0);
                Ok(())
            }
            Some(body) if chain.bodies.len() > LONG && !chain.is_coupled() => {
                memory.clear(nv, 0);
                self.recursive((body, point), normal, added, &mut memory)
            }
            Some(body) => {
                if chain.is_coupled() {
                    self.full(point, normal, added, &mut memory);
                } else {
                    let contact = ContactPoint { chain, body, arm: point.position };
                    contact.many(&self.ws.links[..], normal, added, &mut memory, Keep);
                }
                Ok(())
            }
        };
        self.ws.response = memory;
        done?;
        if self.ws.contact().is_doubtful() {
            self.check_inertia(added)?;
        }
        Ok(self.ws.contact())
    }

    /// [`Self::contact`] and M in `memory`, by recursions: faster than [`ContactPoint::visit`] for long chains.
    ///
    /// # Errors
    /// As [`Self::contact`]; [`ChainError::Coupled`] for a chain with mimic joints; [`ChainError::FixedPoint`] for a point of the
    /// world.
    #[doc(hidden)]
    pub fn contact_and_mass_matrix_into(
        &mut self,
        point: Point<A>,
        normal: A::Vector,
        memory: &mut ResponseMemory<A>,
    ) -> Result<(), ChainError> {
        let body = self.chain.contact_point(point)?.body;
        let n = self.chain.nv;
        memory.grow(n, row_length::<A::Scalar>(n));
        memory.zeros_of = None;
        memory.vectors.fill(A::zero());
        self.mass_matrix_into(&mut DMatrixViewMut::from_slice(memory.parts(n).2.mass_matrix, n, n));
        self.recursive((body, point), normal, &[], memory)
    }

    /// Checks that every joint moves inertia: that its D exceeds the rounding of the composite inertia of its subtree, or of its
    /// diagonal entry of M for a chain with mimic joints. `added` as for [`Kinematics::contact`].
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] with the joint.
    #[doc(hidden)]
    pub fn check_inertia(&mut self, added: &[A::Scalar]) -> Result<(), ChainError> {
        if self.chain.is_coupled() { self.dense(added).map(|_| ()) } else { self.articulate_checked(added).map(|_| ()) }
    }

    /// M + diag(`added`) = Lᵀ D L, for a chain with mimic joints, whose bodies share coordinates.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`]; [`ChainError::WrongLength`] for `added`.
    pub(crate) fn dense(&mut self, added: &[A::Scalar]) -> Result<Dense<A>, ChainError> {
        if !added.is_empty() {
            self.chain.check_nv("added inertia", added.len())?;
        }
        // The factor does not depend on the point.
        let mut memory = ResponseMemory::default();
        self.full(Point { body: None, position: A::zero() }, A::zero(), added, &mut memory);
        let contact = memory.response();
        for (v, own) in contact.mass_matrix.iter().step_by(self.chain.nv + 1).enumerate() {
            let moves_inertia = *own * contact.inverse_d[v] * rounding() < A::Scalar::one(); // false for NaN too
            if !moves_inertia {
                return Err(self.no_inertia(v));
            }
        }
        Ok(Dense(memory))
    }

    /// The coordinate and the lever of each joint that moves the point.
    fn for_each_lever(&self, point: Point<A>, mut visit: impl FnMut(usize, A::Scalar)) {
        let Some(body) = point.body else { return };
        let mut reach = A::size(self.arm(body, point));
        let mut next = Some(body);
        while let Some(i) = next {
            let (link, prepared) = (&self.ws.links[i], &self.chain.prepared[i]);
            visit(prepared.v_index, link.axis.lever(reach));
            reach += prepared.length(link.offset);
            next = prepared.parent;
        }
    }

    /// By the same factorisation without the zeros, for bodies that share coordinates.
    fn full(&mut self, point: Point<A>, normal: A::Vector, added: &[A::Scalar], memory: &mut ResponseMemory<A>) {
        let n = self.chain.nv;
        let length = row_length::<A::Scalar>(n);
        memory.clear(n, length);
        let (_, _, parts) = memory.parts(n);
        self.mass_matrix_into(&mut DMatrixViewMut::from_slice(parts.mass_matrix, n, n));
        for (i, column) in parts.mass_matrix.chunks_exact(n).enumerate() {
            let row = &mut parts.factor[i * length..][..=i];
            row.copy_from_slice(&column[..=i]);
            if let Some(more) = added.get(i) {
                row[i] += *more;
            }
        }
        self.for_each_mover(point, |i, r| {
            let v = self.chain.bodies[i].v_index;
            parts.jacobian[v] += self.ws.links[i].axis.point_velocity(r);
        });
        self.for_each_lever(point, |v, lever| parts.levers[v] += lever);
        parts.reduced_jacobian.copy_from_slice(parts.jacobian);
        let response = eliminate(Row, n, self.position(point), normal, parts);
        let PointResponse { position, delassus, mobility, .. } = response;
        (memory.position, memory.delassus, memory.mobility) = (position, delassus, mobility);
    }

    /// By the articulated-body recursion, in time proportional to the number of bodies. It does not form M.
    fn recursive(
        &mut self,
        (body, point): (usize, Point<A>),
        normal: A::Vector,
        added: &[A::Scalar],
        memory: &mut ResponseMemory<A>,
    ) -> Result<(), ChainError> {
        self.articulate_checked(added)?;
        let position = self.position(point);
        let bodies = &self.chain.bodies;
        let (_, _, parts) = memory.parts(self.chain.nv);
        let Memory { jacobian, reduced_jacobian, inverse_d, levers, response, .. } = parts;
        self.for_each_mover(point, |i, r| jacobian[bodies[i].v_index] = self.ws.links[i].axis.point_velocity(r));
        self.for_each_lever(point, |v, lever| levers[v] = lever);
        let (mut delassus, mut mobility) = ([A::zero(); 3], A::Scalar::zero());
        self.send_unit_forces(body, point, |i, y| {
            let (v, inverse) = (bodies[i].v_index, self.ws.free[i].inverse_d);
            (reduced_jacobian[v], inverse_d[v]) = (y, inverse);
            let scaled = A::times(y, inverse);
            for (c, column) in delassus[..A::LINEAR].iter_mut().enumerate() {
                *column += A::times(y, A::linear_part(scaled, c));
            }
            mobility += A::dot(y, normal) * A::dot(scaled, normal);
        });
        for k in 0..A::LINEAR {
            for (free, body) in self.ws.free.iter_mut().zip(&self.chain.prepared) {
                free.drive = A::linear_part(reduced_jacobian[body.v_index], k);
            }
            let unit = A::vector(|i| if i == k { convert(1.0) } else { A::Scalar::zero() });
            self.accelerate(false, |v, rate| response[v] += A::times(unit, rate));
        }
        (memory.position, memory.delassus, memory.mobility) = (position, delassus, mobility);
        Ok(())
    }
}

/// The factor of [`Kinematics::dense`].
pub(crate) struct Dense<A: Algebra>(ResponseMemory<A>);

impl<A: Algebra> Dense<A> {
    /// Solves M x = b in place: x = L⁻¹ D⁻¹ L⁻ᵀ b.
    pub fn solve(&mut self, x: &mut [A::Scalar]) {
        let (n, length) = (x.len(), row_length::<A::Scalar>(x.len()));
        // Row k holds D_k times the entries of L before the diagonal, and there 1/D_k.
        let factor = &*self.0.parts(n).2.factor;
        let row = |k: usize| &factor[k * length..][..=k];
        for k in (0..n).rev() {
            let share = x[k] * row(k)[k];
            for (there, entry) in x[..k].iter_mut().zip(row(k)) {
                *there -= share * *entry;
            }
        }
        for k in 0..n {
            let before = x[..k].iter().zip(row(k)).fold(A::Scalar::zero(), |sum, (x, entry)| sum + *x * *entry);
            x[k] = (x[k] - before) * row(k)[k];
        }
    }
}

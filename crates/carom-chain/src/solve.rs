//! Systems with the mass matrix: by the articulated-body recursion, or by the factorisation M = L Lᵀ for chains with mimic
//! joints.

use crate::algebra::Algebra;
use crate::delassus::singular;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use nalgebra::{Cholesky, DVector, Dyn, RealField, convert, try_convert};
use std::cmp::Ordering;

impl<A: Algebra> Kinematics<'_, A>
where
    A::Scalar: RealField,
{
    /// Solves M x = `joint_force`: by the recursion, or by the dense method for chains with mimic joints.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular, [`ChainError::WrongLength`].
    pub(crate) fn solve(&mut self, joint_force: &[A::Scalar]) -> Result<DVector<A::Scalar>, ChainError> {
        self.chain.check_nv("tau", joint_force.len())?;
        if self.chain.is_coupled() {
            let cholesky = self.cholesky()?;
            return Ok(cholesky.solve(&DVector::from_column_slice(joint_force)));
        }
        let mut out = DVector::zeros(self.chain.nv);
        self.articulate_checked(&[])?.solve_into(joint_force, out.as_mut_slice())?;
        Ok(out)
    }

    /// Forward dynamics q̈ = M⁻¹(τ − C q̇ − g): by the recursion, or by the dense method for chains with mimic joints.
    /// `gravity` in world axes, m/s². Joint damping and friction of the file are not included: add them to τ.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular, [`ChainError::WrongLength`].
    pub fn forward_dynamics(
        &mut self,
        qd: &[A::Scalar],
        tau: &[A::Scalar],
        gravity: A::Vector,
    ) -> Result<DVector<A::Scalar>, ChainError> {
        let mut qdd = DVector::zeros(self.chain.nv);
        self.forward_dynamics_into(qd, tau, gravity, qdd.as_mut_slice())?;
        Ok(qdd)
    }

    /// As [`Self::forward_dynamics`], into `qdd` (length nv). Allocates only for chains with mimic joints.
    ///
    /// # Errors
    /// As [`Self::forward_dynamics`].
    pub fn forward_dynamics_into(
        &mut self,
        qd: &[A::Scalar],
        tau: &[A::Scalar],
        gravity: A::Vector,
        qdd: &mut [A::Scalar],
    ) -> Result<(), ChainError> {
        if self.chain.is_coupled() {
            self.chain.check_nv("tau", tau.len())?;
            self.chain.check_nv("qdd", qdd.len())?;
            let left = DVector::from_column_slice(tau) - self.bias(qd, gravity)?;
            qdd.copy_from_slice(self.solve(left.as_slice())?.as_slice());
            return Ok(());
        }
        self.articulate_checked(&[])?.forward_dynamics_into(qd, tau, gravity, qdd)
    }

    /// M = L Lᵀ, with an error if a pivot is no larger than the rounding error of its diagonal entry.
    pub(crate) fn cholesky(&mut self) -> Result<Cholesky<A::Scalar, Dyn>, ChainError> {
        let m = self.mass_matrix();
        let lost = |c: &Cholesky<A::Scalar, Dyn>, k: usize| {
            let root = c.l_dirty()[(k, k)];
            root * root <= m[(k, k)] * singular()
        };
        let at = match m.clone().cholesky() {
            Some(c) => match (0..m.nrows()).find(|&k| lost(&c, k)) {
                None => return Ok(c),
                at => at,
            },
            // nalgebra does not return where the factorisation failed: the first leading block without a factor.
            None => (0..m.nrows()).find(|&k| m.view((0, 0), (k + 1, k + 1)).clone_owned().cholesky().is_none()),
        };
        Err(self.no_inertia(at.unwrap_or(0)))
    }

    /// The error for a coordinate whose joint moves no inertia, or whose inertia is lost: beside m L² of bodies at a distance L,
    /// numbers of 16 digits have none left for m l², where l is the length of a body, from L = l/√(64 ε) on.
    #[cold]
    pub(crate) fn no_inertia(&self, v_index: usize) -> ChainError {
        if let Err(massless) = self.chain.check_dynamics() {
            return massless;
        }
        let joint = self.chain.name_of_velocity(v_index);
        let bodies = self.chain.bodies.iter();
        // 1 mm for a robot without lengths of its own
        let own = bodies.fold(convert::<f64, A::Scalar>(1e-6), |own, body| {
            let (arm, inertia) = (body.placement.translation, body.inertia);
            let gyration = A::trace(inertia.rotational) / inertia.mass;
            let own = own.max(A::dot(arm, arm));
            if gyration > own { gyration } else { own } // NaN for a body without mass
        });
        let squares = self.ws.links.iter().map(|link| A::dot(link.offset, link.offset));
        let is_far = |square: &A::Scalar| {
            let near = *square * singular() <= own;
            !near // true for NaN too
        };
        let far = squares.filter(is_far).max_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        let Some(square) = far else { return ChainError::NoInertia { joint } };
        let distance = try_convert(square).map_or(f64::NAN, f64::sqrt);
        let problem = format!(
            "at this pose links are {distance:.1e} m apart, so that its inertia is lost in the rounding of numbers of 16 digits: \
             check the positions and their units (m, rad)"
        );
        ChainError::TooLarge { joint, problem }
    }
}

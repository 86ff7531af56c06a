//! Systems with the mass matrix: by the articulated-body recursion, or by the factor of the whole matrix for chains with mimic
//! joints.

use crate::algebra::Algebra;
use crate::delassus::Dense;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::rounding::rounding;
use nalgebra::{DVector, RealField, convert, try_convert};
use std::cmp::Ordering;

impl<A: Algebra> Kinematics<'_, A>
where
    A::Scalar: RealField,
{
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
            let mut dense = self.dense(&[])?;
            return self.dense_dynamics(&mut dense, (qd, tau, gravity), qdd);
        }
        self.articulate_checked(&[])?.forward_dynamics_into(qd, tau, gravity, qdd)
    }

    /// As [`Self::forward_dynamics_into`], by the factor of the whole matrix.
    pub(crate) fn dense_dynamics(
        &mut self,
        dense: &mut Dense<A>,
        (qd, tau, gravity): (&[A::Scalar], &[A::Scalar], A::Vector),
        qdd: &mut [A::Scalar],
    ) -> Result<(), ChainError> {
        self.chain.check_nv("tau", tau.len())?;
        self.chain.check_nv("qdd", qdd.len())?;
        qdd.copy_from_slice((DVector::from_column_slice(tau) - self.bias(qd, gravity)?).as_slice());
        dense.solve(qdd);
        Ok(())
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
            let near = *square * rounding() <= own;
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

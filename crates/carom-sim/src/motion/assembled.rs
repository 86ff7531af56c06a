//! The constraints of one state with what they feel of the chain, the forces that follow, and the independent rows among them.

use super::rows::Constraints;
use carom_chain::Rows;
use nalgebra::{DMatrix, DVector, Vector3};

/// Accelerations and constraint forces at one state.
#[derive(Debug, Clone)]
pub(crate) struct Held {
    pub qdd: DVector<f64>,
    /// The forces of the lasting contacts, in their order.
    pub contacts: Vec<Force>,
    /// Constraint forces of the joints that dry friction holds, in the order of `dry`; 0 for the others.
    pub joints: Vec<f64>,
    /// Power of the drive, and of all dissipative forces.
    pub power: [f64; 2],
}

/// The force of one contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Force {
    /// On the robot, world, N; zero for a joint limit.
    pub force: Vector3<f64>,
    pub normal: Vector3<f64>,
    /// Its normal component, or the force of a joint limit; it must not be negative.
    pub normal_force: f64,
    /// Rate of the bristle's deflection, world, m/s.
    pub bends: Vector3<f64>,
}

impl Force {
    /// μ λ_n − |λ_t|, N: positive inside the friction cone.
    pub fn cone(&self, friction: f64) -> f64 {
        friction * self.normal_force - (self.force - self.normal * self.normal_force).norm()
    }
}

/// A pivot of R M⁻¹ Rᵀ below this share of its diagonal entry counts as zero: the row depends on others. The entries are sums
/// of some dozens of products, and rows that depend on others do so within the projection of the state, 1e-13 of its size.
const DEPENDENT: f64 = 1e-10;

/// The constraints of one state with what they feel of the chain: scratch memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Assembled {
    pub constraints: Constraints,
    /// M⁻¹Fᵀ.
    pub responses: Rows,
    /// M⁻¹Rᵀ, where F ≠ R.
    pub own_responses: Rows,
    pub free: DVector<f64>,
    /// Powers of the drive, and of damping, slipping dry friction and compliant contacts.
    pub power: [f64; 2],
    /// Forces of the compliant contacts.
    pub pressed: Vec<Force>,
    /// Joint forces.
    pub tau: Vec<f64>,
    pub scratch: Vec<f64>,
}

impl Assembled {
    pub fn new(nv: usize) -> Self {
        Self {
            constraints: Constraints::new(nv),
            responses: Rows::new(nv),
            own_responses: Rows::new(nv),
            free: DVector::zeros(nv),
            tau: vec![0.0; nv],
            scratch: vec![0.0; nv],
            ..Self::default()
        }
    }

    /// K and R q̈₀ + drift.
    pub fn problem(&self) -> (DMatrix<f64>, DVector<f64>) {
        let Self { constraints, responses, free, .. } = self;
        let offset = DVector::from_fn(constraints.rows.len(), |i, _| {
            constraints.rows.dot(i, free.as_slice()) + constraints.drifts[i]
        });
        (constraints.rows.times(responses), offset)
    }
}

/// Independent rows of a positive semidefinite matrix, by Cholesky factorisation with diagonal pivoting (Golub & Van Loan,
/// *Matrix Computations*, 4th ed., section 4.2.8).
pub(crate) struct Basis {
    pub rows: Vec<usize>,
}

impl Basis {
    pub fn of(gram: &DMatrix<f64>) -> Self {
        let m = gram.nrows();
        let mut left: Vec<f64> = gram.diagonal().iter().copied().collect();
        let mut factor: Vec<DVector<f64>> = Vec::new();
        let mut rows = Vec::new();
        let most = gram.diagonal().amax();
        while rows.len() < m {
            let share = |i: &usize| left[*i] / gram[(*i, *i)].max(most * DEPENDENT);
            let Some(next) = (0..m).filter(|i| !rows.contains(i)).max_by(|a, b| share(a).total_cmp(&share(b))) else {
                break;
            };
            let dependent = share(&next).is_nan() || share(&next) <= DEPENDENT;
            if dependent {
                break;
            }
            let pivot = left[next].sqrt();
            let mut column = gram.column(next).into_owned();
            for before in &factor {
                column.axpy(-before[next], before, 1.0);
            }
            column /= pivot;
            left.iter_mut().zip(column.iter()).for_each(|(left, x)| *left -= x * x);
            factor.push(column);
            rows.push(next);
        }
        Self { rows }
    }

    /// X with R = X R_B, for the matrix R M⁻¹ Rᵀ.
    pub fn spread(&self, gram: &DMatrix<f64>) -> DMatrix<f64> {
        let r = self.rows.len();
        let own = DMatrix::from_fn(r, r, |i, j| gram[(self.rows[i], self.rows[j])]);
        let across = DMatrix::from_fn(r, gram.nrows(), |i, j| gram[(self.rows[i], j)]);
        match own.cholesky() {
            Some(factor) => factor.solve(&across).transpose(),
            None => DMatrix::zeros(gram.nrows(), r),
        }
    }
}

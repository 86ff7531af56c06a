//! Inertia at a contact point: Delassus matrix, effective mass, singular directions.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | H = J M⁻¹ Jᵀ | 3×3, 2×2 | Delassus matrix, world axes, 1/kg | `delassus` |
//! | E | 3×nv, 2×nv | a factor: H = E Eᵀ, with the singular values of H's square root | `factor` |
//! | 1/(nᵀHn) | 1 | effective mass in direction n, kg | `effective_mass` |
//!
//! **Rank.** Singular directions are found from the singular values of E. A direction whose singular value is 1e-13 of what the
//! chain's levers could give is still distinguished from a singular one; from the eigenvalues of H the limit would be 1e-7.

use crate::algebra::{Algebra, Force};
use crate::body::Point;
use crate::delassus::PointResponse;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use crate::rounding::ROUNDING;
use nalgebra::{DMatrix, DVector, RealField};
use num_traits::{One, Zero};

/// The inertia of the chain at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactInertia {
    /// The Delassus matrix H = J M⁻¹ Jᵀ, 3×3 (2×2 in the plane), world axes, 1/kg.
    pub delassus: DMatrix<f64>,
    /// Orthonormal principal directions (world axes), each with the square root σ of its eigenvalue of H (1/√kg), largest
    /// first. A unit impulse along one gives the point the speed σ²; one joule of kinetic energy the speed √2 σ. Empty if
    /// a number of E is not finite.
    pub principal: Vec<(DVector<f64>, f64)>,
    /// Number of principal directions in which the point can move; the remaining ones are singular: no joint motion moves the point
    /// along them.
    pub rank: usize,
    /// M⁻¹Jᵀ, nv×3 (nv×2 in the plane): the joint velocities that unit impulses along the axes give.
    pub response: DMatrix<f64>,
    /// Size of σ below which a direction is singular: 64 ε √(Σ lₖ²/Dₖ), with the levers of [`PointResponse::levers`].
    tolerance: f64,
}

impl ContactInertia {
    /// The inertia of the chain at a contact.
    #[doc(hidden)]
    pub fn of<A: Algebra<Scalar = f64>>(contact: PointResponse<A>) -> Self {
        let (rows, nv) = (A::LINEAR, contact.reduced_jacobian.len());
        let part = |v: A::Vector, i: usize| A::linear_part(v, i);
        let factor = DMatrix::from_fn(rows, nv, |i, k| {
            part(contact.reduced_jacobian[k], i) * contact.inverse_d[k].max(0.0).sqrt()
        });
        // E of a few rows, by a rank-revealing factorisation: E = U Σ Vᵀ. Short chains have fewer columns than rows: columns
        // of zeros are added.
        let e = faer::Mat::from_fn(rows, nv.max(rows), |i, j| if j < nv { factor[(i, j)] } else { 0.0 });
        let mut principal = match e.thin_svd() {
            Ok(svd) => {
                let (u, s) = (svd.U(), svd.S().column_vector());
                let columns = (0..rows).map(|j| {
                    let sigma = if j < s.nrows() { s[j] } else { 0.0 };
                    (DVector::from_fn(rows, |i, _| u[(i, j)]), sigma)
                });
                columns.collect()
            }
            // Only a factor that is not finite has no decomposition.
            Err(_) => Vec::new(),
        };
        principal.sort_by(|a: &(DVector<f64>, f64), b| b.1.total_cmp(&a.1));
        // What the chain's levers could give decides, also where no joint moves the point and all of E is rounding.
        let tolerance = factor.norm().max(contact.mobility_of_levers().sqrt()) * ROUNDING;
        let rank = principal.iter().filter(|p| p.1 > tolerance).count();
        let response = DMatrix::from_fn(nv, rows, |k, i| part(contact.response[k], i));
        Self { delassus: &factor * factor.transpose(), principal, rank, response, tolerance }
    }

    /// Effective mass in the direction `n` (world axes, any length): 1/(nᵀHn) for unit n, kg. `None` if n is singular
    /// (√(nᵀHn) within the rounding of the lengths of the chain), because the effective mass is then undefined; also if n is zero or not
    /// finite, or its length is not the number of rows of H.
    pub fn effective_mass(&self, n: &[f64]) -> Option<f64> {
        if n.len() != self.delassus.nrows() {
            return None;
        }
        let n = DVector::from_column_slice(n).try_normalize(0.0)?;
        // nᵀHn as Σ (n·uᵢ)² σᵢ²: no cancellation
        let moving = self.principal[..self.rank].iter();
        let speed = moving.map(|(u, sigma)| (u.dot(&n) * sigma).powi(2)).sum::<f64>();
        (speed.sqrt() > self.tolerance).then(|| 1.0 / speed)
    }
}

impl<A: Algebra> Kinematics<'_, A>
where
    A::Scalar: RealField,
{
    /// The Delassus matrix of the chain with all joints locked: the moving bodies of the point's branch form one rigid body
    /// that is not connected to the base. World axes, 1/kg; zero for a point of the world. Measured impacts of an arm under
    /// stiff position control agreed much better with this inertia than with that of free joints (arXiv:2202.12646).
    ///
    /// # Errors
    /// [`ChainError::NoLockedInertia`], for example for a straight chain of thin rods and a point beside its axis.
    #[doc(hidden)]
    pub fn locked_delassus(&mut self, point: Point<A>) -> Result<DMatrix<A::Scalar>, ChainError> {
        let mut h = DMatrix::zeros(A::LINEAR, A::LINEAR);
        let Some(body) = point.body else { return Ok(h) };
        let mut r = self.arm(body, point);
        let mut root = body;
        while let Some(p) = self.chain.bodies[root].parent {
            r += self.ws.links[root].offset;
            root = p;
        }
        self.composites();
        let whole = self.ws.inertia[root];
        let one = A::Scalar::one();
        let com = whole.first_moment * (one / whole.mass);
        let at_com = whole.shifted(-com);
        let d = r - com;
        for k in 0..A::LINEAR {
            let e = A::vector(|i| if i == k { one } else { A::Scalar::zero() });
            let spin = A::solve_inertia(at_com.rotational, Force::<A>::at(d, e).moment);
            let spin = spin.ok_or(ChainError::NoLockedInertia)?;
            let column = e * (one / whole.mass) + A::swing(spin, d);
            for i in 0..A::LINEAR {
                h[(i, k)] = A::linear_part(column, i);
            }
        }
        Ok(h)
    }

    /// The Delassus matrix H (world axes, 1/kg).
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular.
    pub fn delassus(&mut self, point: Point<A>) -> Result<DMatrix<A::Scalar>, ChainError> {
        let columns = self.contact(point, A::zero(), &[])?.delassus;
        Ok(DMatrix::from_fn(A::LINEAR, A::LINEAR, |i, k| A::linear_part(columns[k], i)))
    }
}

impl<A: Algebra<Scalar = f64>> Kinematics<'_, A> {
    /// The inertia at a point: Delassus matrix, principal and singular directions, and the joint response.
    ///
    /// # Errors
    /// [`ChainError::NoInertia`] where M is singular.
    pub fn contact_inertia(&mut self, point: Point<A>) -> Result<ContactInertia, ChainError> {
        Ok(ContactInertia::of(self.contact(point, A::zero(), &[])?))
    }
}

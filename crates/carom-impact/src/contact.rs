//! An impact problem in blocks, always with two tangents.
//!
//! A contact in the plane, or with a normal only, is written as one in space whose missing tangents have zero velocity
//! and zero entries in H. No impulse arises along them, so the same code serves all sizes.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | A | 2 × 2 | `H_tt` (1/kg) | `tangents` |
//! | h | 2 | `H_tn` (1/kg) | `coupling` |
//! | C | 1 | `H_nn` (1/kg) | `normal` |
//! | S | 2 × 2 | `A - h hᵀ/C`: inverse inertia of the tangents at fixed normal velocity (1/kg) | `at_held_normal` |

use nalgebra::{Matrix2, RealField, SVector, Vector2};

use crate::problem::{determinant, plain};
use crate::rounding::{CANCELLED, NULL_PIVOT, rounding};
use crate::{ImpactError, ImpactProblem};

/// A contact with two tangents.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact<T> {
    pub tangents: Matrix2<T>,
    pub coupling: Vector2<T>,
    pub normal: T,
    /// Slip velocity before the impact (m/s).
    pub slip: Vector2<T>,
    /// Normal velocity before the impact (m/s).
    pub v_n: T,
}

impl<T: RealField + Copy> Contact<T> {
    pub fn of<const D: usize>(problem: &ImpactProblem<T, D>) -> Self {
        let (h, u, n) = (problem.delassus(), problem.u_minus(), D - 1);
        let entry = |i: usize, j: usize| if i < n && j < n { h[(i, j)] } else { T::zero() };
        let along = |x: &SVector<T, D>| Vector2::from_fn(|i, _| if i < n { x[i] } else { T::zero() });
        Self {
            tangents: Matrix2::from_fn(entry),
            coupling: along(&h.column(n).into_owned()),
            normal: h[(n, n)],
            slip: along(u),
            v_n: u[n],
        }
    }

    /// The vector of size D with these tangential and normal parts.
    pub fn lift<const D: usize>(tangent: &Vector2<T>, normal: T) -> SVector<T, D> {
        SVector::from_fn(|i, _| if i == D - 1 { normal } else { tangent[i] })
    }

    /// Whether friction lowers the normal velocity at the start of the slip: `dv_n/dp = C - μ h·u < 0`, or zero and, as
    /// the slip turns, about to become negative.
    pub fn jams(&self, mu: T) -> bool {
        let (h, r) = (&self.coupling, length(&self.slip));
        let (drive, hold) = (mu * h.dot(&self.slip), self.normal * r);
        if drive != hold || hold <= T::zero() {
            return drive > hold;
        }
        // On the boundary: d²v_n/dp² = -μ (h·u⊥) dφ/dp.
        let u = self.slip / r;
        let across = |x: Vector2<T>| u.x * x.y - u.y * x.x;
        let turning = across(h - self.tangents * u * mu);
        turning == T::zero() || across(*h) * turning > T::zero()
    }

    pub fn at_held_normal(&self) -> Mobility<T> {
        let s = self.tangents - self.coupling * (self.coupling / self.normal).transpose();
        Mobility::new(s, self.floor())
    }

    /// Whether the slip `v_t` after the impulses is rounding of the terms that cancel in it.
    pub fn rests(&self, v_t: &Vector2<T>, p_t: &Vector2<T>, p_n: T) -> bool {
        let terms = self.slip.abs() + self.tangents.abs() * p_t.abs() + self.coupling.abs() * p_n.abs();
        v_t.amax() <= terms.amax() * rounding(CANCELLED)
    }

    /// The error of a contact that sticks at normal velocity `v_n` with this inverse mass along its normal.
    pub fn wedged(&self, mu: T, v_n: T, inverse_mass: T) -> ImpactError {
        ImpactError::Wedged {
            friction: plain(mu),
            normal_velocity: plain(v_n),
            inverse_mass: plain(inverse_mass),
            free_inverse_mass: plain(self.normal),
        }
    }

    /// `1024 ε` times the largest entry of A: a smaller eigenvalue counts as zero.
    pub fn floor(&self) -> T {
        self.tangents.amax() * rounding(NULL_PIVOT)
    }

    /// Whether H has a null direction with a normal component: then S has a lower rank than A.
    pub fn is_singular(&self) -> bool {
        self.at_held_normal().rank() < self.mobility().rank()
    }

    /// A with its rank.
    pub fn mobility(&self) -> Mobility<T> {
        Mobility::new(self.tangents, self.floor())
    }

    /// Inverse mass along the normal while the contact sticks, `C - hᵀ A⁺ h` (1/kg).
    pub fn held_inverse_mass(&self) -> T {
        let hold = self.mobility().least_solution(&self.coupling);
        self.normal - self.coupling.dot(&hold)
    }

    /// Whether an inverse mass along the normal is zero within rounding, relative to `H_nn`.
    pub fn is_locked(&self, inverse_mass: T) -> bool {
        inverse_mass <= self.normal * rounding(NULL_PIVOT)
    }
}

impl<T: RealField + Copy> ImpactProblem<T, 3> {
    /// `|A⁺ h|`: the least coefficient of friction that keeps a contact sticking once its slip has stopped; 0 where all
    /// tangents are singular (A = 0).
    ///
    /// ```
    /// # use carom_impact::ImpactProblem;
    /// # use nalgebra::{matrix, vector};
    /// let h = matrix![2.0, 0.3, 0.5; 0.3, 1.5, -0.4; 0.5, -0.4, 1.2];
    /// let problem = ImpactProblem::new(h, vector![0.6, -0.2, -1.0])?;
    /// assert!((problem.mu_stick() - 0.44267251_f64).abs() < 1e-8);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn mu_stick(&self) -> T {
        let contact = Contact::of(self);
        length(&contact.mobility().least_solution(&contact.coupling))
    }
}

/// The length of x. At x = 0, where it has no derivative, dual numbers get 0.
pub(crate) fn length<T: RealField + Copy>(x: &Vector2<T>) -> T {
    // Scaled first, so that the squares of small numbers do not underflow.
    let largest = x.amax();
    if largest > T::zero() { (x / largest).norm() * largest } else { T::zero() }
}

/// A positive semidefinite 2 × 2 matrix M with its rank, for equations `(M + s 1) x = b` with `s >= 0`.
///
/// The inverse is computed from the adjugate. Eigenvectors have no derivative at a multiple eigenvalue, such as that of
/// a sphere's tangents.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mobility<T> {
    matrix: Matrix2<T>,
    rank: Rank<T>,
}

#[derive(Debug, Clone, Copy)]
enum Rank<T> {
    Zero,
    /// Unit vector along the range of M, and the eigenvalue.
    One(Vector2<T>, T),
    /// The determinant.
    Two(T),
}

impl<T: RealField + Copy> Mobility<T> {
    /// Eigenvalues up to `floor` count as zero.
    pub fn new(matrix: Matrix2<T>, floor: T) -> Self {
        let (a, b, d) = (matrix[(0, 0)], matrix[(0, 1)], matrix[(1, 1)]);
        let (trace, det) = (a + d, determinant(a, b, d));
        let rank = if trace <= floor {
            Rank::Zero
        } else if det <= floor * trace {
            // The larger column of λ x xᵀ.
            let column = if a >= d { Vector2::new(a, b) } else { Vector2::new(b, d) };
            Rank::One(column / column.norm(), trace)
        } else {
            Rank::Two(det)
        };
        Self { matrix, rank }
    }

    /// M without the eigenvalues that count as zero.
    pub fn matrix(&self) -> Matrix2<T> {
        match self.rank {
            Rank::Zero => Matrix2::zeros(),
            Rank::One(axis, value) => axis * (axis * value).transpose(),
            Rank::Two(_) => self.matrix,
        }
    }

    pub fn rank(&self) -> usize {
        match self.rank {
            Rank::Zero => 0,
            Rank::One(..) => 1,
            Rank::Two(_) => 2,
        }
    }

    /// `det(M + s 1) (M + s 1)⁻¹ b` and `det(M + s 1)` as polynomials in s, for a regular M.
    pub fn polynomials(&self, b: &Vector2<T>) -> Option<([Vector2<T>; 2], [T; 3])> {
        match self.rank {
            Rank::Two(det) => Some(([self.adjugate(T::zero(), b), *b], [det, self.matrix.trace(), T::one()])),
            _ => None,
        }
    }

    /// The part of `b` in the range of M.
    pub fn moved(&self, b: &Vector2<T>) -> Vector2<T> {
        match self.rank {
            Rank::Zero => Vector2::zeros(),
            Rank::One(axis, _) => axis * axis.dot(b),
            Rank::Two(_) => *b,
        }
    }

    /// `M⁺ b`: the shortest x for which `M x` is the part of `b` in the range of M.
    pub fn least_solution(&self, b: &Vector2<T>) -> Vector2<T> {
        match self.rank {
            Rank::Zero => Vector2::zeros(),
            Rank::One(axis, value) => axis * (axis.dot(b) / value),
            Rank::Two(det) => self.adjugate(T::zero(), b) / det,
        }
    }

    /// `(M + s 1)⁻¹ b` for `s > 0`.
    pub fn shifted_solution(&self, s: T, b: &Vector2<T>) -> Vector2<T> {
        match self.rank {
            Rank::Zero => b / s,
            Rank::One(axis, value) => {
                let along = axis * axis.dot(b);
                along / (value + s) + (b - along) / s
            }
            Rank::Two(det) => self.adjugate(s, b) / (det + s * (self.matrix.trace() + s)),
        }
    }

    fn adjugate(&self, s: T, b: &Vector2<T>) -> Vector2<T> {
        let m = &self.matrix;
        Vector2::new((m[(1, 1)] + s) * b.x - m[(0, 1)] * b.y, (m[(0, 0)] + s) * b.y - m[(0, 1)] * b.x)
    }
}

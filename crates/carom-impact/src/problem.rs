//! The impact problem of one contact: Delassus matrix and contact velocity, and the quantities that follow from them
//! before a law is chosen.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | D × D | Delassus matrix: inverse inertia at the contact (1/kg) | `delassus` |
//! | u⁻ | D | contact velocity before the impact (m/s) | `u_minus` |
//! | T | 1 | `½ uᵀ H⁺ u`, the kinetic energy that contact impulses can change (J) | `kinetic_energy` |
//! | μ_stick | 1 | `\|B\|/A`, least friction that keeps a contact sticking | `mu_stick` |
//! | μ_jam | 1 | `C/\|B\|`, Painlevé's threshold | `mu_jam` |

use nalgebra::{DMatrix, Dim, Matrix, Matrix3x2, RealField, SMatrix, SVector, StorageMut, Vector2, convert};

use crate::ImpactError;
use crate::rounding::{CANCELLED, NULL_PIVOT, rounding};

/// Largest asymmetry that is averaged instead of refused, relative to the largest entry.
const SYMMETRY: f64 = 1e-8;

/// Real part as f64, for messages.
pub(crate) fn plain<T: RealField + Copy>(x: T) -> f64 {
    nalgebra::convert_unchecked(x)
}

/// One contact at the instant of impact. Contact axes: tangents first, normal last; the normal points from the
/// environment to the robot, so an approaching contact has `u_n < 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactProblem<T, const D: usize> {
    delassus: SMatrix<T, D, D>,
    u_minus: SVector<T, D>,
}

impl<T: RealField + Copy, const D: usize> ImpactProblem<T, D> {
    /// Checks and stores `delassus` (1/kg) and `u_minus` (m/s); D is 1, 2 or 3.
    ///
    /// # Errors
    ///
    /// - [`ImpactError::NotFinite`]: an entry is NaN or infinite.
    /// - [`ImpactError::Matrix`]: the matrix differs from its transpose by more than 1e-8 of its largest entry (smaller differences are
    ///   averaged), or is not positive semidefinite within 1024 ε of its largest entry.
    pub fn new(delassus: SMatrix<T, D, D>, u_minus: SVector<T, D>) -> Result<Self, ImpactError> {
        const { assert!(D > 0 && D <= 3, "a contact has its normal and at most two tangents") };
        let mut h = delassus;
        check_delassus(&mut h)?;
        check_velocity("u_minus", u_minus.as_slice())?;
        Ok(Self::trusted(h, u_minus))
    }

    /// The problem of a matrix that is symmetric and positive semidefinite by construction, for instance as a sum of squares
    /// H = Σ yₖ yₖᵀ / dₖ: checks only that all numbers are finite.
    ///
    /// # Errors
    ///
    /// [`ImpactError::NotFinite`]: an entry is NaN or infinite.
    #[doc(hidden)]
    #[inline(always)]
    pub fn from_gram(delassus: SMatrix<T, D, D>, u_minus: SVector<T, D>) -> Result<Self, ImpactError> {
        // A sum is finite only if no term is NaN or infinite.
        if !(delassus.sum() + u_minus.sum()).is_finite() {
            check_delassus(&mut delassus.clone_owned())?;
            check_velocity("u_minus", u_minus.as_slice())?;
        }
        let mirrored = delassus.transpose();
        Ok(Self::trusted(mirrored + (delassus - mirrored) * convert::<f64, T>(0.5), u_minus))
    }

    /// A problem made from parts of one that has been checked.
    pub(crate) fn trusted(delassus: SMatrix<T, D, D>, u_minus: SVector<T, D>) -> Self {
        Self { delassus, u_minus }
    }

    /// Delassus matrix: inverse inertia at the contact, symmetric (1/kg).
    pub fn delassus(&self) -> &SMatrix<T, D, D> {
        &self.delassus
    }

    /// Contact velocity before the impact (m/s).
    pub fn u_minus(&self) -> &SVector<T, D> {
        &self.u_minus
    }

    /// `-u_n`, the speed at which the contact closes (m/s); zero or negative if there is no impact.
    pub fn approach_speed(&self) -> T {
        -self.u_minus[D - 1]
    }

    /// `½ uᵀ H⁺ u` (J): the part of the kinetic energy at contact velocity `u` (m/s) that contact impulses can change.
    ///
    /// H is eliminated from the normal upwards and null pivots are skipped, so the energy is defined for a singular H
    /// too: a component of `u` that H cannot change does not contribute. The energy balance `½ P·(u⁻ + u⁺) = T⁺ - T⁻`
    /// holds if H is regular or `u` lies in the range of H, as every `u = J q̇` does.
    ///
    /// ```
    /// # use carom_impact::ImpactProblem;
    /// # use nalgebra::{matrix, vector};
    /// let u = vector![1.0_f64, -2.0];
    /// let problem = ImpactProblem::new(matrix![2.0, 0.5; 0.5, 1.0], u)?;
    /// let inverse = problem.delassus().try_inverse().unwrap();
    /// assert!((problem.kinetic_energy(&u) - 0.5 * u.dot(&(inverse * u))).abs() < 1e-15);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn kinetic_energy(&self, u: &SVector<T, D>) -> T {
        let [energy] = self.kinetic_energies([*u]);
        energy
    }

    /// [`Self::kinetic_energy`] of several velocities, for which H is eliminated once.
    #[inline(always)]
    pub(crate) fn kinetic_energies<const N: usize>(&self, mut w: [SVector<T, D>; N]) -> [T; N] {
        let nothing = self.trace_rounding();
        let mut h = self.delassus;
        let mut twice = [T::zero(); N];
        for k in (0..D).rev() {
            let pivot = h[(k, k)];
            if pivot <= nothing || pivot <= self.delassus[(k, k)] * rounding(NULL_PIVOT) {
                continue;
            }
            // w := L⁻¹ u, so that uᵀ (L D Lᵀ)⁻¹ u = Σ w_k²/d_k.
            let inverse = T::one() / pivot;
            for (w, twice) in w.iter_mut().zip(&mut twice) {
                let share = w[k] * inverse;
                *twice += w[k] * share;
                for i in 0..k {
                    w[i] -= h[(i, k)] * share;
                }
            }
            eliminate(&mut h, k, inverse);
        }
        twice.map(|twice| twice * convert(0.5))
    }

    /// `(64 ε)² tr H`: a diagonal entry `j M⁻¹ jᵀ` below it is the square of a row j of rounding errors. The trace is
    /// an upper bound of the largest eigenvalue.
    pub(crate) fn trace_rounding(&self) -> T {
        let tiny: T = rounding(CANCELLED);
        self.delassus.trace() * tiny * tiny
    }

    /// The largest entry of H, which is on the diagonal, because H is positive semidefinite.
    pub(crate) fn largest_entry(&self) -> T {
        (1..D).fold(self.delassus[(0, 0)], |most, i| most.max(self.delassus[(i, i)]))
    }

    /// Whether `H_nn` is so small beside the trace that it may be rounding.
    pub(crate) fn normal_is_doubtful(&self) -> bool {
        self.delassus[(D - 1, D - 1)] <= self.delassus.trace() * rounding(NULL_PIVOT)
    }

    /// Fails if the normal direction is singular (`H_nn = 0`): the normal impulse would be infinite.
    pub(crate) fn check_normal(&self) -> Result<(), ImpactError> {
        let inverse_mass = self.delassus[(D - 1, D - 1)];
        if inverse_mass > self.trace_rounding() {
            return Ok(());
        }
        Err(ImpactError::SingularNormal { inverse_mass: plain(inverse_mass), trace: plain(self.delassus.trace()) })
    }
}

impl<T: RealField + Copy> ImpactProblem<T, 2> {
    /// The same contact in contact axes of space, in which `tangent` has the components of the tangent of the plane (unit). No
    /// impulse changes the velocity across the plane, which is zero.
    pub fn in_space(&self, tangent: Vector2<T>) -> ImpactProblem<T, 3> {
        let lift = Matrix3x2::new(tangent.x, T::zero(), tangent.y, T::zero(), T::zero(), T::one());
        ImpactProblem::trusted(lift * self.delassus * lift.transpose(), lift * self.u_minus)
    }

    /// `|B|/A`: the least coefficient of friction that keeps a contact sticking once its slip has stopped; 0 where the
    /// tangent is singular (A = 0).
    ///
    /// ```
    /// # use carom_impact::ImpactProblem;
    /// # use nalgebra::{matrix, vector};
    /// let problem = ImpactProblem::new(matrix![2.0, -0.5; -0.5, 1.0], vector![0.0, -1.0])?;
    /// assert_eq!(problem.mu_stick(), 0.25);
    /// assert_eq!(problem.mu_jam(), Some(2.0));
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn mu_stick(&self) -> T {
        self.hold().abs()
    }

    /// `C/|B|`, Painlevé's threshold: with at least this friction, slip towards `sign B` lowers v_n (jam). `None` where
    /// `B = 0`, which no friction jams. Never below [`Self::mu_stick`], because `A C >= B²`.
    pub fn mu_jam(&self) -> Option<T> {
        let (_, b, c) = self.abc();
        (b != T::zero()).then(|| c / b.abs())
    }

    /// `(A, B, C) = (H_tt, H_tn, H_nn)`.
    pub(crate) fn abc(&self) -> (T, T, T) {
        (self.delassus[(0, 0)], self.delassus[(0, 1)], self.delassus[(1, 1)])
    }

    /// `(v_t, v_n)` before the impact.
    pub(crate) fn velocity(&self) -> (T, T) {
        (self.u_minus[0], self.u_minus[1])
    }

    /// Whether the tangent is singular (A = 0), as for a slide along the normal.
    pub(crate) fn tangent_is_frozen(&self) -> bool {
        self.delassus[(0, 0)] <= self.trace_rounding()
    }

    /// `det H = A C - B²`.
    pub(crate) fn determinant(&self) -> T {
        let (a, b, c) = self.abc();
        let product = a * c;
        let difference = product - b * b;
        // Where the terms do not cancel, the difference is exact enough.
        if difference * convert(16.0) > product { difference } else { determinant(a, b, c) }
    }

    /// `B/A`: the friction per unit of normal impulse that keeps a contact sticking, opposed to the tangent; 0 where the
    /// tangent is singular.
    pub(crate) fn hold(&self) -> T {
        let (a, b, _) = self.abc();
        if self.tangent_is_frozen() { T::zero() } else { b / a }
    }

    /// `det H/A`: inverse mass along the normal while the contact sticks (1/kg).
    pub(crate) fn held_inverse_mass(&self) -> T {
        let (a, _, c) = self.abc();
        if self.tangent_is_frozen() { c } else { self.determinant() / a }
    }

    /// Whether `det H/A` is zero within rounding, relative to `H_nn`.
    pub(crate) fn is_singular(&self) -> bool {
        let (a, b, c) = self.abc();
        // Well above the threshold the determinant need not be exact.
        let regular = a * c - b * b > a * c * rounding(2.0 * NULL_PIVOT);
        !regular && self.is_locked(self.held_inverse_mass())
    }

    /// Whether an inverse mass along the normal is zero within rounding, relative to `H_nn`.
    pub(crate) fn is_locked(&self, inverse_mass: T) -> bool {
        inverse_mass <= self.delassus[(1, 1)] * rounding(NULL_PIVOT)
    }
}

/// # Errors
/// [`ImpactError::Matrix`] unless the matrix is square.
pub(crate) fn check_square(delassus: &DMatrix<f64>) -> Result<(), ImpactError> {
    let (rows, columns) = delassus.shape();
    if rows == columns {
        return Ok(());
    }
    let rule = "it must be square; build it as J M^-1 J^T";
    Err(ImpactError::Matrix(format!("delassus is {rows} x {columns}: {rule}")))
}

/// Checks that a matrix of any size is finite, symmetric (small asymmetries are averaged) and positive semidefinite.
pub(crate) fn check_delassus<T, D, S>(h: &mut Matrix<T, D, D, S>) -> Result<(), ImpactError>
where
    T: RealField + Copy,
    D: Dim,
    S: StorageMut<T, D, D> + Clone,
{
    let size = h.nrows();
    for i in 0..size {
        for j in 0..size {
            let value = h[(i, j)];
            if !value.is_finite() {
                let entry = format!("delassus[{i}][{j}]");
                return Err(ImpactError::NotFinite { entry, value: plain(value) });
            }
        }
    }
    let largest = h.amax();
    let allowed = largest * convert(SYMMETRY);
    for i in 0..size {
        for j in i + 1..size {
            let (upper, lower) = (h[(i, j)], h[(j, i)]);
            if (upper - lower).abs() > allowed {
                return Err(ImpactError::Matrix(format!(
                    "delassus[{i}][{j}] = {} but delassus[{j}][{i}] = {}: the matrix must be symmetric within {} (1e-8 of its largest \
                     entry); build it as J M^-1 J^T",
                    plain(upper),
                    plain(lower),
                    plain(allowed)
                )));
            }
            // Halving the difference, not the sum, cannot overflow and leaves equals alone.
            let mean = lower + (upper - lower) * convert(0.5);
            h[(i, j)] = mean;
            h[(j, i)] = mean;
        }
    }
    check_positive(h, largest * rounding(NULL_PIVOT))
}

/// `a c - b²`: a fused multiply-add recovers the rounding error of `b²` (Kahan).
#[inline(always)]
pub(crate) fn determinant<T: RealField + Copy>(a: T, b: T, c: T) -> T {
    let square = b * b;
    a.mul_add(c, -square) + (-b).mul_add(b, square)
}

/// Checks that every entry of the velocity called `name` is finite.
pub(crate) fn check_velocity<T: RealField + Copy>(name: &str, u: &[T]) -> Result<(), ImpactError> {
    match u.iter().position(|value| !value.is_finite()) {
        Some(i) => Err(ImpactError::NotFinite { entry: format!("{name}[{i}]"), value: plain(u[i]) }),
        None => Ok(()),
    }
}

/// `H + allowed 1` has positive pivots exactly when no eigenvalue of H lies below `-allowed`
/// (Sylvester's law of inertia).
fn check_positive<T, D, S>(h: &Matrix<T, D, D, S>, allowed: T) -> Result<(), ImpactError>
where
    T: RealField + Copy,
    D: Dim,
    S: StorageMut<T, D, D> + Clone,
{
    let Some(found) = negative_pivot(h.clone(), allowed) else {
        return Ok(());
    };
    let (row, pivot) = negative_pivot(h.clone(), T::zero()).unwrap_or(found);
    Err(ImpactError::Matrix(format!(
        "the Delassus matrix is not positive semidefinite: eliminated from the normal upwards, its pivot at [{row}][{row}] is {}, below \
         -{} (rounding); no mass distribution has it, check the mass matrix and the order of the contact axes",
        plain(pivot),
        plain(allowed)
    )))
}

/// First negative pivot of `H + shift 1`, eliminated from the normal upwards.
fn negative_pivot<T, D, S>(mut h: Matrix<T, D, D, S>, shift: T) -> Option<(usize, T)>
where
    T: RealField + Copy,
    D: Dim,
    S: StorageMut<T, D, D>,
{
    for i in 0..h.nrows() {
        h[(i, i)] += shift;
    }
    for k in (0..h.nrows()).rev() {
        let pivot = h[(k, k)];
        if pivot < T::zero() {
            return Some((k, pivot));
        }
        if pivot == T::zero() {
            continue; // H = 0 has nothing to eliminate; any other H has a positive shift
        }
        let inverse = T::one() / pivot;
        eliminate(&mut h, k, inverse);
    }
    None
}

/// Schur complement of pivot k, whose inverse is given, in the rows above it; column k keeps its entries.
#[inline(always)]
fn eliminate<T, D, S>(h: &mut Matrix<T, D, D, S>, k: usize, inverse: T)
where
    T: RealField + Copy,
    D: Dim,
    S: StorageMut<T, D, D>,
{
    for i in 0..k {
        let l = h[(i, k)] * inverse;
        for j in 0..=i {
            let fill = l * h[(j, k)];
            h[(i, j)] -= fill;
            h[(j, i)] = h[(i, j)];
        }
    }
}

//! One constraint alone, the others' impulses given: solved exactly.
//!
//! With c the velocity at λ = 0 (restitution included), a contact's impulse λ is one of three:
//!
//! ```text
//! open    c_n ≥ 0:  λ = 0
//! stick   λ_t = -A⁺ b,          if that is in the cone
//! slip    λ_t = -(A + s 1)⁻¹ b, with s > 0 such that |λ_t| = μ λ_n
//! where   λ_n = -(c_n + H_nt λ_t)/H_nn,  A = H_tt - H_tn H_nt/H_nn,  b = c_t - H_tn c_n/H_nn
//! ```
//!
//! The slip follows from `u_t⁺ = A λ_t + b = -s λ_t`: friction against the slip it leaves. `|λ_t| - μ λ_n` is
//! positive at s = 0, where sticking left the cone, and negative for large s, so a root lies between
//! (unless A is singular, b out of its range, and the friction jams: then there may be none).

use nalgebra::{DMatrix, Matrix2, SymmetricEigen, Vector2, Vector3};

use super::Constraint;

/// A share below which a number is rounding of zero beside its neighbours.
const NOTHING: f64 = 1024.0 * f64::EPSILON;

/// A constraint with what its rows of H say, prepared once.
pub(super) struct Block {
    pub constraint: Constraint,
    /// First row.
    pub row: usize,
    /// Mean diagonal entry of its rows (1/kg); 1 where nothing can move it, so that it can divide.
    pub scale: f64,
    /// Of a contact: the eigenvectors of A as columns, its eigenvalues, and H_nt along the former.
    axes: Matrix2<f64>,
    values: Vector2<f64>,
    coupling: Vector2<f64>,
    /// H_nn of a contact, H of any other constraint (1/kg).
    inverse_mass: f64,
}

impl Block {
    pub fn new(constraint: Constraint, row: usize, h: &DMatrix<f64>) -> Self {
        let rows = constraint.rows();
        let mean = (row..row + rows).map(|i| h[(i, i)]).sum::<f64>() / rows as f64;
        let last = row + rows - 1;
        // A diagonal entry that is rounding beside the whole matrix cannot carry an impulse.
        let nothing = h.diagonal().amax() * NOTHING * NOTHING;
        let inverse_mass = if h[(last, last)] > nothing { h[(last, last)] } else { 0.0 };
        let mut block = Self {
            constraint,
            row,
            scale: if mean > nothing { mean } else { 1.0 },
            axes: Matrix2::identity(),
            values: Vector2::zeros(),
            coupling: Vector2::zeros(),
            inverse_mass,
        };
        if rows == 3 && inverse_mass > 0.0 {
            let tangents = h.fixed_view::<2, 2>(row, row).into_owned();
            let coupling = h.fixed_view::<2, 1>(row, last).into_owned();
            let reduced = tangents - coupling * coupling.transpose() / inverse_mass;
            let floor = tangents.amax() * NOTHING;
            // Only numbers near overflow could keep it from an end.
            if let Some(eigen) = SymmetricEigen::try_new(reduced, f64::EPSILON, 100) {
                block.axes = eigen.eigenvectors;
                block.values = eigen.eigenvalues.map(|value| if value > floor { value } else { 0.0 });
            }
            block.coupling = block.axes.transpose() * coupling;
        }
        block
    }

    /// The impulse along one row, with velocity c (m/s) at none.
    pub fn solve_one(&self, c: f64) -> f64 {
        if self.inverse_mass == 0.0 {
            return 0.0;
        }
        let rest = -c / self.inverse_mass;
        match self.constraint {
            Constraint::Stop { .. } => rest.max(0.0),
            Constraint::Dry { bound } => rest.clamp(-bound, bound),
            Constraint::Held | Constraint::Contact { .. } => rest,
        }
    }

    /// The impulse of a contact with friction μ, with velocity c (m/s) at none, where c is a sum of terms of the
    /// given size (m/s).
    pub fn solve_contact(&self, mu: f64, c: Vector3<f64>, size: f64) -> Vector3<f64> {
        let mass = self.inverse_mass;
        if c.z >= 0.0 || mass == 0.0 {
            return Vector3::zeros();
        }
        let smooth = Vector3::new(0.0, 0.0, -c.z / mass);
        if mu == 0.0 {
            return smooth;
        }
        let mut b = self.axes.tr_mul(&c.xy()) - self.coupling * (c.z / mass);
        // Where nothing moves a tangent, velocity along it that is rounding of the rest is none.
        let rounding = size * NOTHING * (1.0 + self.coupling.amax() / mass);
        for i in 0..2 {
            if self.values[i] == 0.0 && b[i].abs() <= rounding {
                b[i] = 0.0;
            }
        }
        let impulse = |s: f64| {
            let share = |i: usize| if b[i] == 0.0 { 0.0 } else { -b[i] / (self.values[i] + s) };
            let along = Vector2::new(share(0), share(1));
            (along, -(c.z + self.coupling.dot(&along)) / mass)
        };
        let lift = |(along, normal): (Vector2<f64>, f64)| {
            let tangent = self.axes * along;
            Vector3::new(tangent.x, tangent.y, normal)
        };
        // Infinite where A is singular and b out of its range: what nothing moves does not stick.
        let stick = impulse(0.0);
        if stick.0.norm().is_finite() && stick.0.norm() <= mu * stick.1 {
            return lift(stick);
        }

        let excess = |s: f64| {
            let (along, normal) = impulse(s);
            let size = along.norm();
            let rate = Vector2::new(along.x / (self.values.x + s), along.y / (self.values.y + s));
            let slope = -along.dot(&rate) / size - mu * self.coupling.dot(&rate) / mass;
            (size - mu * normal, slope)
        };
        // Without coupling and A the root would be here.
        let mut high = b.norm() / (mu * smooth.z);
        for _ in 0..300 {
            if excess(high).0 <= 0.0 {
                break;
            }
            high *= 16.0;
        }
        // Where nothing moves a tangent that restitution is to move, friction may wedge the contact: no impulse is
        // an answer, and the smooth one is at least of finite size.
        root(high, excess).map_or(smooth, |s| lift(impulse(s)))
    }
}

/// The root of a function that is positive near 0 and not at `high`, to full precision: Newton's method, kept in
/// the bracket, which every fourth step halves (by its geometric mean, since s spans many orders). `None` if the
/// function is positive nowhere.
fn root(mut high: f64, f: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
    let mut low = 0.0;
    let mut s = high;
    for step in 1..400 {
        let (value, slope) = f(s);
        if value > 0.0 {
            low = s
        } else {
            high = s
        }
        let newton = s - value / slope;
        let halved = if low > 0.0 { (low * high).sqrt() } else { high / 1024.0 };
        let next = if step % 4 != 0 && newton > low && newton < high { newton } else { halved };
        let moved = (next - s).abs();
        s = next;
        if moved <= 2.0 * f64::EPSILON * s || high - low <= 2.0 * f64::EPSILON * high || s < f64::MIN_POSITIVE {
            break;
        }
    }
    // The way down to zero found no positive value: there is no root, or one among the subnormal numbers.
    (s.is_finite() && s >= f64::MIN_POSITIVE).then_some(s)
}

//! Joint velocities for a velocity of a point of a link.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | u | 3 | velocity of the point, world axes, m/s | `velocity` |
//! | J, J_ω | 3×nv | Jacobian of the point; of the angular velocity of its link, times the longest lever | `jacobian` |
//! | W | nv×nv | M⁻¹, or the identity | – |
//!
//! q̇ = W Jᵀ (J W Jᵀ)⁺ u is the solution of J q̇ = u with the least q̇ᵀ W⁻¹ q̇: the least kinetic energy for W = M⁻¹, the least sum of
//! squares for W = 1 (Khatib 1987; Ben-Israel, Greville 2003, section 3.1).

use crate::algebra::Spatial;
use crate::body::FramePoint;
use crate::delassus::Rows;
use crate::error::ChainError;
use crate::kinematics::Kinematics;
use nalgebra::{DMatrix, DVector, Vector3};

/// Which of the joint velocities that give a point its velocity are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToolMotion {
    /// Those of the least kinetic energy: the link rotates in general.
    #[default]
    LeastEnergy,
    /// Those with the least sum of squares of the joint velocities.
    LeastNorm,
    /// Those with which the link does not turn; of these the ones of the least kinetic energy.
    Translation,
}

impl ToolMotion {
    /// All of them, with their names in files and on the command line.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::LeastEnergy, "least-energy"), (Self::LeastNorm, "least-norm"), (Self::Translation, "without-rotation")];

    /// The one of this name.
    ///
    /// # Errors
    /// A message with all names.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(|(_, name)| name).join(", ");
        let found = Self::ALL.iter().find(|(_, own)| *own == name);
        found.map(|(motion, _)| *motion).ok_or_else(|| format!("'{name}' is none of {}", known()))
    }
}

/// Velocities that differ by less than this share of the one asked for are reached.
const REACHED: f64 = 1e-9;
/// Singular values below this share of the largest are zero: they are rounding of matrices with some dozens of columns.
const SINGULAR: f64 = 1e-12;

impl Kinematics<'_, Spatial<f64>> {
    /// The joint velocities (length nv; rad/s, m/s) that give a point of a link the velocity `velocity` (world axes, m/s).
    ///
    /// ```
    /// # use carom_chain::{FramePoint, ToolMotion, uniform_chain};
    /// # use nalgebra::Vector3;
    /// let arm = uniform_chain(3, 1.2, 6.0)?;
    /// let tip = FramePoint::from(arm.frame("tip")?);
    /// let mut workspace = arm.workspace();
    /// let mut at = workspace.update(&arm, &[0.4, 0.7, -0.5])?;
    /// let u = Vector3::new(0.3, -0.5, 0.0);
    /// let qd = at.tool_velocity(tip, u, ToolMotion::Translation)?;
    /// assert!(qd.sum().abs() < 1e-12); // in the plane the rates add up to the angular velocity
    /// # Ok::<(), carom_chain::ChainError>(())
    /// ```
    ///
    /// # Errors
    /// [`ChainError::NoVelocity`] where no joint velocities give the point this velocity, as at a stretched pose, without moving joints,
    /// or where the link cannot move without turning; [`ChainError::FixedPoint`]; [`ChainError::NotFinite`]; [`ChainError::NoInertia`] where M is singular.
    pub fn tool_velocity(
        &mut self,
        at: FramePoint,
        velocity: Vector3<f64>,
        motion: ToolMotion,
    ) -> Result<DVector<f64>, ChainError> {
        if let Some(index) = velocity.iter().position(|x| !x.is_finite()) {
            return Err(ChainError::NotFinite { what: "tool velocity", index, value: velocity[index] });
        }
        let point = self.chain.point(at.frame, at.offset);
        if point.body.is_none() {
            return Err(ChainError::FixedPoint { chain: self.chain.name().to_owned() });
        }
        let jacobian = self.point_jacobian(point);
        let lever = jacobian.amax();
        let found = match motion {
            ToolMotion::LeastEnergy => {
                let inertia = self.contact_inertia(point)?;
                let mut force = Vector3::zeros();
                for (direction, sigma) in &inertia.principal[..inertia.rank] {
                    let own = Vector3::new(direction[0], direction[1], direction[2]);
                    force += own * (own.dot(&velocity) / (sigma * sigma));
                }
                let (mut impulse, mut response) = (Rows::new(self.chain.nv), Rows::default());
                self.add_point_force(point, force, impulse.add())?;
                self.respond(&impulse, &mut response)?;
                DVector::from_column_slice(response.row(0))
            }
            ToolMotion::LeastNorm => least_norm(jacobian) * velocity,
            ToolMotion::Translation => {
                let mut rows = self.geometric_jacobian(at.frame);
                rows.rows_mut(0, 3).scale_mut(lever);
                rows.rows_mut(3, 3).copy_from(&jacobian);
                let mut asked = DVector::zeros(6);
                asked.rows_mut(3, 3).copy_from(&velocity);
                self.check_inertia(&[])?;
                // With M = L Lᵀ the least energy is the least norm of Lᵀ q̇.
                let lower = self.mass_matrix().cholesky().ok_or_else(|| self.no_inertia(0))?.unpack();
                let no_inertia = || self.no_inertia(0);
                let scaled = lower.solve_lower_triangular(&rows.transpose()).ok_or_else(no_inertia)?;
                let least = least_norm(scaled.transpose()) * asked;
                lower.tr_solve_lower_triangular(&least).ok_or_else(no_inertia)?
            }
        };
        let reached = self.point_velocity(point, found.as_slice())?;
        let turning = match motion {
            ToolMotion::Translation => self.angular_velocity(at.frame, found.as_slice())?.norm() * lever,
            _ => 0.0,
        };
        if (reached - velocity).norm().max(turning) > REACHED * velocity.norm() {
            let how = if motion == ToolMotion::Translation { " without turning it" } else { "" };
            let link = self.chain.frame_name(at.frame).to_owned();
            return Err(ChainError::NoVelocity { link, velocity: velocity.into(), how });
        }
        Ok(found)
    }
}

/// A⁺: A⁺ u is the least solution of A x = u, if there is one.
fn least_norm(a: DMatrix<f64>) -> DMatrix<f64> {
    let svd = a.svd(true, true);
    let least = SINGULAR * svd.singular_values.max();
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { unreachable!("both were asked for") };
    let inverse = svd.singular_values.map(|x| if x > least { 1.0 / x } else { 0.0 });
    v_t.tr_mul(&DMatrix::from_diagonal(&inverse)) * u.transpose()
}

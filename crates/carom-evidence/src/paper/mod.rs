//! Model of the experiment of Pagilla and Yu (2004): two elbows × four angles × three speeds, frictionless impacts with
//! Newton's coefficients of Table I.
//!
//! | symbol | meaning | here |
//! | --- | --- | --- |
//! | α | angle between the tip's velocity before the impact and the surface; 90° is a normal impact | `angle_deg` |
//! | n | the paper's normal, *into* the surface; `NORMAL` is −n, from the surface to the robot | `NORMAL` |
//! | t | tangent, down the wall | `TANGENT` |
//! | h | tᵀHn / nᵀHn with the paper's n: reversal if h(1+e) > cot α, growth if h < 0 | `Run::coupling` |
//!
//! The tip meets a wall at x = 0.6364 m. The paper gives no geometry, joint angles or inertia. Arm and poses are those of
//! the stand-in `robots/planar2.urdf`, with the line from base to tip along the surface normal.

mod claims;
mod figures;
mod report;
mod simulated;

pub use claims::{Claim, claims};
pub use report::{Paper, stand_in};

use carom_chain::Chain;
use carom_impact::Frictionless;
use carom_sim::{ChainImpact, Impacts, SimError};
use nalgebra::{DVector, Matrix2, Vector3};
use serde::ser::{Serialize, SerializeStruct, Serializer};

/// Contact normal, world frame, from the wall to the robot (the paper's has the opposite sign).
pub(crate) const NORMAL: [f64; 3] = [-1.0, 0.0, 0.0];
/// Tangential direction of the approach, world frame: down the wall.
pub(crate) const TANGENT: [f64; 3] = [0.0, -1.0, 0.0];
/// Impact angles, degrees.
pub(crate) const ANGLES_DEG: [f64; 4] = [30.0, 45.0, 60.0, 90.0];
/// Impact speeds, m/s.
pub(crate) const SPEEDS: [f64; 3] = [0.1, 0.2, 0.3];

/// The two configurations of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elbow {
    /// Elbow above the line from base to tip (the paper's Fig. 2).
    Up,
    /// Elbow below it (the paper's Fig. 3).
    Down,
}

impl Elbow {
    /// +1 if the elbow is above the line from base to tip, −1 if it is below.
    pub fn side(self) -> f64 {
        if self == Self::Up { 1.0 } else { -1.0 }
    }

    /// Joint angles at the impact, rad.
    pub fn pose(self) -> [f64; 2] {
        let sign = self.side();
        [sign * 45_f64.to_radians(), -sign * 90_f64.to_radians()]
    }

    /// Newton's coefficients of Table I, measured at 0.2 m/s, for [`ANGLES_DEG`].
    pub(crate) fn newton(self) -> [f64; 4] {
        match self {
            Self::Up => [0.40, 0.35, 0.28, 0.35],
            Self::Down => [0.30, 0.35, 0.34, 0.35],
        }
    }

    /// "Energetic coefficients" of Table I for [`ANGLES_DEG`]: √(T⁺/T⁻), eq. (16).
    pub(crate) fn measured_energy_root(self) -> [f64; 4] {
        match self {
            Self::Up => [0.49, 0.59, 0.62, 0.73],
            Self::Down => [0.76, 0.93, 0.91, 0.79],
        }
    }
}

/// Change of the tangential velocity in an impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tangential {
    /// Greater after the impact, in the same direction.
    Grows,
    /// Not greater after the impact, in the same direction.
    Shrinks,
    /// In the opposite direction after the impact.
    Reverses,
    /// Zero before the impact (normal impact).
    Appears,
}

impl Tangential {
    /// The change from velocity `before` to `after`; `before` counts as zero up to 1e-12 of `after`.
    pub fn of(before: f64, after: f64) -> Self {
        if before.abs() <= 1e-12 * after.abs() {
            Self::Appears
        } else if after * before < 0.0 {
            Self::Reverses
        } else if after.abs() > before.abs() {
            Self::Grows
        } else {
            Self::Shrinks
        }
    }
}

carom_study::words! {
    Elbow { Up "up", Down "down" }
    Tangential { Grows "grows", Shrinks "shrinks", Reverses "reverses", Appears "appears" }
}

/// One impact of the experiment.
#[derive(Debug, Clone)]
pub struct Run {
    /// Configuration of the arm.
    pub elbow: Elbow,
    /// Angle between the tip's velocity before the impact and the surface, degrees.
    pub angle_deg: f64,
    /// Speed of the tip before the impact, m/s.
    pub speed: f64,
    /// Newton's coefficient of restitution.
    pub restitution: f64,
    /// Joint velocities before the impact, rad/s.
    pub qd_minus: [f64; 2],
    /// The impact.
    pub hit: ChainImpact,
    /// h = tᵀHn/nᵀHn with the paper's normal.
    pub(crate) coupling: f64,
}

impl Run {
    /// Tangential velocity before and after, down the wall, m/s.
    pub fn tangential(&self) -> (f64, f64) {
        let t = Vector3::from(TANGENT);
        (t.dot(&self.hit.u_minus), t.dot(&self.hit.u_plus))
    }

    /// Normal velocity before and after, away from the wall, m/s.
    pub fn normal(&self) -> (f64, f64) {
        let n = Vector3::from(NORMAL);
        (n.dot(&self.hit.u_minus), n.dot(&self.hit.u_plus))
    }

    /// Change of the tangential velocity.
    pub fn tangential_change(&self) -> Tangential {
        let (before, after) = self.tangential();
        Tangential::of(before, after)
    }
}

impl Serialize for Run {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        let mut run = out.serialize_struct("Run", 10)?;
        run.serialize_field("elbow", &self.elbow)?;
        run.serialize_field("speed", &self.speed)?;
        run.serialize_field("angle_deg", &self.angle_deg)?;
        run.serialize_field("newton", &self.restitution)?;
        run.serialize_field("tangential", &self.tangential())?;
        run.serialize_field("normal", &self.normal())?;
        run.serialize_field("energy_loss", &self.hit.energy_loss())?;
        run.serialize_field("energy_root", &self.hit.energy_ratio().sqrt())?;
        run.serialize_field("coupling", &self.coupling)?;
        run.serialize_field("change", &self.tangential_change())?;
        run.end()
    }
}

/// Computes one impact of the arm in the pose of [`Elbow::pose`]. Before the impact the tip has `speed` (m/s), towards and
/// down the wall, at `angle_deg` (degrees) to it.
///
/// # Errors
/// [`SimError`]: the chain is not a two-link arm with a frame `tip`, the pose is singular, or the coefficient is out of range.
pub fn strike(chain: &Chain, elbow: Elbow, angle_deg: f64, speed: f64, restitution: f64) -> Result<Run, SimError> {
    let tip = chain.frame("tip")?;
    let (n, t) = (Vector3::from(NORMAL), Vector3::from(TANGENT));
    let alpha = angle_deg.to_radians();
    // exactly 0 at 90°, where the cosine in f64 is not
    let along = if angle_deg == 90.0 { 0.0 } else { alpha.cos() };
    let u_minus = t * (speed * along) - n * (speed * alpha.sin());
    let q = elbow.pose();
    let qd_minus = velocities_for(chain, &q, u_minus)?;
    let mut contact = chain.impact(&q, &qd_minus).at(tip).normal(NORMAL).contact()?;
    let h = contact.inertia().delassus.clone();
    let h_n = DVector::from_column_slice((&h * -n).as_slice());
    let coupling =
        h_n.dot(&DVector::from_column_slice(t.as_slice())) / -h_n.dot(&DVector::from_column_slice(n.as_slice()));
    let hit = contact.resolve(&Frictionless { restitution })?;
    Ok(Run { elbow, angle_deg, speed, restitution, qd_minus, hit, coupling })
}

/// Joint velocities that give the tip of a two-link arm the velocity `u`.
fn velocities_for(chain: &Chain, q: &[f64; 2], u: Vector3<f64>) -> Result<[f64; 2], SimError> {
    let mut workspace = chain.workspace();
    let tip = chain.point(chain.frame("tip")?, Vector3::zeros());
    let jacobian = workspace.update(chain, q)?.point_jacobian(tip);
    let square = Matrix2::from_fn(|i, j| jacobian[(i, j)]);
    let singular = || SimError::SingularPose { link: "tip".into(), q: q.to_vec() };
    // Singular is what is so within rounding.
    let regular = square.determinant().abs() > 1e-12 * square.norm_squared();
    let qd = regular.then(|| square.lu().solve(&u.xy())).flatten().ok_or_else(singular)?;
    Ok(qd.into())
}

/// Computes all twenty-four impacts of the experiment, in the order elbow, speed, angle.
///
/// # Errors
/// As [`strike`].
pub fn experiment(chain: &Chain) -> Result<Vec<Run>, SimError> {
    let mut runs = Vec::new();
    for elbow in Elbow::ALL {
        for speed in SPEEDS {
            for (angle, restitution) in ANGLES_DEG.into_iter().zip(elbow.newton()) {
                runs.push(strike(chain, elbow, angle, speed, restitution)?);
            }
        }
    }
    Ok(runs)
}

#[cfg(test)]
#[path = "../../tests/paper.rs"]
mod experiment_tests;
#[cfg(test)]
#[path = "../../tests/paper_figures.rs"]
mod tests;

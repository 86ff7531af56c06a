//! Forward dynamics of a row of one to four hinges in the plane, in closed form.
//!
//! Gain: 280 instructions for two hinges; the rates of all states of a simulation 570 where the recursion took 2200
//! (`docs/performance.md`). `tests/planar_row.rs` compares the results with the recursion.
//!
//! With the absolute angles φᵢ of the bodies instead of joint angles, every coefficient of the equation of motion of a row
//! of hinges is a product of two vectors, each fixed in a body:
//!
//! ```text
//! Σⱼ Mᵢⱼ ω̇ⱼ = Qᵢ + Σ_{j>i} Sᵢⱼ ωⱼ² − Σ_{j<i} Sⱼᵢ ωⱼ² + Hᵢ × g,    Mᵢⱼ = Dᵢ·Hⱼ,  Sᵢⱼ = Dᵢ × Hⱼ  (i < j),  Mᵢᵢ = Jᵢ
//! ```
//!
//! These are Lagrange's equations for the point masses at x = Σ_{k<j} D_k + ρ of body j; Craig, *Introduction to Robotics*
//! (1989), section 6.7, gives the equations of two links in joint angles. M is factored from the last body to the first:
//! its pivots are then the articulated inertias of the recursion ([`crate::Articulation`]). Without gravity no coefficient
//! depends on the first angle, and the first rotation is omitted.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | ωᵢ | 1 | angular velocity of body i, rad/s | `turning` |
//! | Dᵢ | 2 | from joint i to joint i+1, world axes, m | `link` |
//! | Hᵢ | 2 | first moment about joint i of body i and of the mass beyond it, the latter at joint i+1, world axes, kg m | `moment` |
//! | Jᵢ | 1 | rotational inertia about joint i of the same, kg m² | `inertia` |
//! | Q | n | generalised forces on φ: sᵢτᵢ − sᵢ₊₁τᵢ₊₁, with s = ±1 the sense of a joint | `push` |

use super::sine::sin_cos;
use crate::algebra::{Geometry, Planar};
use crate::chain::Chain;
use nalgebra::Vector2;

/// Largest number of hinges: the work grows with its square, that of the recursion linearly.
const MOST: usize = 4;

/// A row of one to four hinges in the plane, each body the parent of the next, with the quantities that do not depend on
/// the configuration precomputed. Immutable; can be shared by reference.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarRow {
    bodies: Vec<Swing>,
}

/// One body of the row and its parent hinge.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Swing {
    /// Angle relative to the previous body = `sense` · q + `shift`.
    sense: f64,
    shift: f64,
    /// In the body's axes.
    link: Vector2<f64>,
    moment: Vector2<f64>,
    inertia: f64,
}

impl PlanarRow {
    /// The row of a planar chain; `None` if the chain is not such a row, or has rotors, whose inertia is not that of a body.
    pub fn of(chain: &Chain<Planar<f64>>) -> Option<Self> {
        let bodies = chain.bodies();
        if !chain.structure.row || bodies.len() > MOST || bodies.iter().any(|body| body.rotor != 0.0) {
            return None;
        }
        let mut beyond = 0.0; // mass
        let mut row = Vec::with_capacity(bodies.len());
        for (i, (body, prepared)) in bodies.iter().zip(&chain.prepared).enumerate().rev() {
            let link = bodies.get(i + 1).map_or_else(Vector2::zeros, |next| next.placement.translation);
            row.push(Swing {
                sense: prepared.ratio,
                shift: prepared.shift,
                link,
                moment: body.inertia.first_moment + link * beyond,
                inertia: body.inertia.rotational + beyond * link.norm_squared(),
            });
            beyond += body.inertia.mass;
        }
        row.reverse();
        Some(Self { bodies: row })
    }

    /// Writes q̈ = M⁻¹(τ − C q̇ − g) into `qdd`, as [`Kinematics::forward_dynamics`](crate::Kinematics::forward_dynamics) of
    /// the same chain. `gravity` in the plane's axes, m/s². Returns `false` if a joint moves no inertia or a length is wrong;
    /// `Kinematics::forward_dynamics` then returns the error. Does not allocate.
    pub fn accelerate(&self, q: &[f64], qd: &[f64], tau: &[f64], gravity: Vector2<f64>, qdd: &mut [f64]) -> bool {
        match self.bodies.len() {
            1 => self.swing::<1>(q, qd, tau, gravity, qdd),
            2 => self.swing::<2>(q, qd, tau, gravity, qdd),
            3 => self.swing::<3>(q, qd, tau, gravity, qdd),
            MOST => self.swing::<MOST>(q, qd, tau, gravity, qdd),
            _ => None,
        }
        .is_some()
    }

    /// The length is a constant, so that the compiler unrolls the loops.
    #[inline(always)]
    fn swing<const N: usize>(
        &self,
        q: &[f64],
        qd: &[f64],
        tau: &[f64],
        gravity: Vector2<f64>,
        qdd: &mut [f64],
    ) -> Option<()> {
        let bodies: &[Swing; N] = self.bodies.as_slice().try_into().ok()?;
        let (q, qd): (&[f64; N], &[f64; N]) = (q.try_into().ok()?, qd.try_into().ok()?);
        let (tau, qdd): (&[f64; N], &mut [f64; N]) = (tau.try_into().ok()?, qdd.try_into().ok()?);

        // Outward: directions and angular velocities.
        let falls = gravity != Vector2::zeros();
        let (mut link, mut moment) = ([Vector2::zeros(); N], [Vector2::zeros(); N]);
        let (mut turning, mut push) = ([0.0; N], [0.0; N]);
        let mut rotation = Planar::<f64>::no_rotation();
        for i in 0..N {
            let body = &bodies[i];
            if i > 0 || falls {
                let (sin, cos) = sin_cos(body.sense * q[i] + body.shift);
                rotation = Planar::turn(rotation, sin, cos);
            }
            (link[i], moment[i]) = (Planar::rotate(rotation, body.link), Planar::rotate(rotation, body.moment));
            turning[i] = body.sense * qd[i] + if i > 0 { turning[i - 1] } else { 0.0 };
            push[i] = body.sense * tau[i] + cross(moment[i], gravity);
            if i > 0 {
                push[i - 1] -= body.sense * tau[i];
            }
        }
        // `stiff`: composite inertia of each joint, with the joints beyond it locked.
        let (mut m, mut stiff, mut beyond) = ([[0.0; N]; N], [0.0; N], 0.0);
        for i in (0..N).rev() {
            m[i][i] = bodies[i].inertia;
            beyond += m[i][i];
            for j in i + 1..N {
                m[i][j] = Planar::dot(link[i], moment[j]);
                beyond += m[i][j] + m[i][j];
                let across = cross(link[i], moment[j]);
                push[i] += across * turning[j] * turning[j];
                push[j] -= across * turning[i] * turning[i];
            }
            stiff[i] = beyond;
        }

        // Inward: M = U D Uᵀ in place, U above the diagonal; the right-hand side is reduced with it.
        for k in (0..N).rev() {
            let pivot = m[k][k];
            // A pivot within the rounding error of the composite inertia counts as zero; false for NaN too.
            let moves_inertia = pivot > 64.0 * f64::EPSILON * stiff[k];
            if !moves_inertia {
                return None;
            }
            let inverse = 1.0 / pivot;
            let column: [f64; N] = std::array::from_fn(|i| m[i][k]);
            for i in 0..k {
                let share = column[i] * inverse;
                for j in i..k {
                    m[i][j] -= share * column[j];
                }
                m[i][k] = share;
                push[i] -= share * push[k];
            }
            push[k] *= inverse;
        }
        // Outward: ω̇, and its differences, the joint accelerations.
        let mut before = 0.0;
        for k in 0..N {
            for i in 0..k {
                push[k] -= m[i][k] * push[i];
            }
            qdd[k] = bodies[k].sense * (push[k] - before);
            before = push[k];
        }
        Some(())
    }
}

/// a × b.
#[inline(always)]
fn cross(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    Planar::moment(a, b)
}

//! An impact at several points of a chain at the same moment: a toe line, a face, two feet.
//!
//! | symbol | size | meaning | our name |
//! |---|---|---|---|
//! | Jᵢ | 3×nv | Jacobian of point i in its contact axes, tangents first, normal last | `rows` |
//! | Xᵢ | nv×3 | M⁻¹Jᵢᵀ, inertia of drives included | `columns` |
//! | H | 3k×3k | Delassus matrix of k points, with blocks Jᵢ Xⱼ | `delassus` |
//! | p | 3k | impulses | `impulse` |
//!
//! q̇⁺ = q̇⁻ + Σ Xᵢ pᵢ, and [`SeveralProblem`] gives p. Two points of one body that stick leave the line between them without a
//! velocity, and three leave the body none: H is then singular, and only the sums of the impulses that the motion depends on are
//! determined.

use super::prepared::{Aim, problem};
use crate::contact::SeveralLaw;
use crate::error::SimError;
use crate::state::EQUAL;
use carom_chain::{Chain, FramePoint};
use carom_impact::{Accuracy, Constraint, Flags, SeveralOutcome, SeveralProblem};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, MatrixXx3, Vector3};

/// One of several points at which a chain is struck at the same moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StruckPoint {
    /// The point of the link.
    pub point: FramePoint,
    /// Contact normal in world axes, from the environment to the robot, of any length except zero.
    pub normal: Vector3<f64>,
    /// What holds at the point.
    pub grip: Grip,
    /// Stiffness relative to the other points, > 0, which decides how they share an impact under
    /// [`SeveralLaw::Energetic`]; no other law uses it.
    pub relative_stiffness: f64,
}

/// What holds at a struck point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Grip {
    /// Restitution and Coulomb friction; the impulse pushes.
    Contact {
        /// Newton's coefficient; Poisson's under [`SeveralLaw::Poisson`], the energetic one under [`SeveralLaw::Energetic`].
        restitution: f64,
        /// Coefficient of friction; 0 under [`SeveralLaw::Energetic`].
        friction: f64,
    },
    /// The point stops and neither slips nor leaves, whatever impulse that takes: a foot that is assumed to stick.
    Sticks,
}

/// The result of an impact at several points.
#[derive(Debug, Clone, PartialEq)]
pub struct SeveralImpact {
    /// Joint velocities after the impact, length nv; rad/s, m/s.
    pub qd_plus: Vec<f64>,
    /// Impulse on the robot at each point, world axes, N s. Where points are redundant (three on one body), other impulses with the
    /// same effect on the motion are possible.
    pub impulses: Vec<Vector3<f64>>,
    /// Velocity of each point before, world axes, m/s.
    pub u_minus: Vec<Vector3<f64>>,
    /// Velocity of each point after, world axes, m/s.
    pub u_plus: Vec<Vector3<f64>>,
    /// Kinetic energy of the whole chain before, J.
    pub energy_before: f64,
    /// Kinetic energy of the whole chain after, J; with drives that act, it contains their work.
    pub energy_after: f64,
    /// Violation of the law, relative to the largest velocity of a point, at most 1e-9: see
    /// [`SeveralOutcome::residual`](carom_impact::SeveralOutcome::residual).
    pub residual: f64,
    /// Notes about the result. [`Flags::WITHOUT_RESTITUTION`]: no impulses satisfy the law with the coefficients of restitution
    /// given, and the result is that with all of them zero, as in scenes.
    pub flags: Flags,
}

/// A point's Jacobian, its response and its axes.
struct Seen {
    rows: Matrix3xX<f64>,
    columns: MatrixXx3<f64>,
    axes: Matrix3<f64>,
    u_minus: Vector3<f64>,
}

/// The impact at these points of a chain in state (q, q̇) as one problem.
pub(super) fn resolve(
    chain: &Chain,
    (q, qd): (&[f64], &[f64]),
    points: &[(StruckPoint, Aim)],
    law: SeveralLaw,
) -> Result<SeveralImpact, SimError> {
    if points.is_empty() {
        return Err(SimError::Incomplete { missing: "points", say: "a list with at least one StruckPoint" });
    }
    let mut workspace = chain.workspace();
    let mut at = workspace.update(chain, q)?;
    let mut seen = Vec::new();
    for (_, aim) in points {
        let Aim { point, axes, added, .. } = aim;
        let response = at.contact(chain.point(point.frame, point.offset), axes.column(2).into_owned(), added)?;
        seen.push(Seen {
            rows: axes.tr_mul(&Matrix3xX::from_columns(response.jacobian)),
            columns: MatrixXx3::from_fn(qd.len(), |k, i| response.response[k].dot(&axes.column(i))),
            axes: *axes,
            u_minus: *problem(&response, aim, chain, axes, (q, qd))?.u_minus(),
        });
    }
    let size = 3 * seen.len();
    let mut delassus = DMatrix::zeros(size, size);
    for (i, a) in seen.iter().enumerate() {
        for (j, b) in seen.iter().enumerate().skip(i) {
            let block = &a.rows * &b.columns;
            delassus.view_mut((3 * j, 3 * i), (3, 3)).copy_from(&block.transpose());
            delassus.view_mut((3 * i, 3 * j), (3, 3)).copy_from(&block);
        }
    }
    let u_minus = DVector::from_iterator(size, seen.iter().flat_map(|point| point.u_minus.iter().copied()));
    let constraints = points.iter().flat_map(|(struck, _)| match struck.grip {
        Grip::Contact { restitution, friction } => {
            vec![(Constraint::Contact { restitution, friction }, struck.relative_stiffness)]
        }
        Grip::Sticks => vec![(Constraint::Held, 1.0); 3],
    });
    let (constraints, stiffnesses): (_, Vec<f64>) = constraints.unzip();
    let problem = SeveralProblem::new(delassus, u_minus, constraints)?;
    let solve = |problem: &SeveralProblem| -> Result<SeveralOutcome, SimError> {
        let mut found = law.solve(problem, &stiffnesses, &Accuracy::default(), None)?;
        let rounding = problem.rounding(&found.impulse);
        let known = rounding <= found.residual; // false for NaN too
        found.residual = if known { found.residual } else { rounding };
        Ok(found)
    };
    let mut outcome = solve(&problem)?;
    let solved = |found: &SeveralOutcome| found.residual <= EQUAL;
    if !solved(&outcome) {
        let first = outcome.residual;
        outcome = solve(&problem.without_restitution())?;
        if !solved(&outcome) {
            let names: Vec<&str> = points.iter().map(|(_, aim)| chain.frame_name(aim.point.frame)).collect();
            let residuals = [first, outcome.residual];
            return Err(SimError::Together { law: law.name(), points: names.join(", "), residuals });
        }
        outcome.flags |= Flags::WITHOUT_RESTITUTION;
    }

    let mut qd_plus = qd.to_vec();
    let mut impulses = Vec::new();
    for (i, point) in seen.iter().enumerate() {
        let impulse = outcome.impulse.fixed_rows::<3>(3 * i).into_owned();
        let jump = &point.columns * impulse;
        qd_plus.iter_mut().zip(jump.iter()).for_each(|(rate, jump)| *rate += jump);
        impulses.push(point.axes * impulse);
    }
    let after = |i: usize| seen[i].axes * (&seen[i].rows * DVector::from_column_slice(&qd_plus));
    Ok(SeveralImpact {
        energy_before: at.kinetic_energy(qd)?,
        energy_after: at.kinetic_energy(&qd_plus)?,
        u_minus: seen.iter().map(|point| point.axes * point.u_minus).collect(),
        u_plus: (0..seen.len()).map(after).collect(),
        impulses,
        residual: outcome.residual,
        flags: outcome.flags,
        qd_plus,
    })
}

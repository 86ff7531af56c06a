//! The saltation matrix: the first-order map of a small change of the state before an impact to the change after it,
//! including the change of the time of the impact.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | x | 2nv | (q, qd), q in its tangent space | – |
//! | F⁻, F⁺ | 2nv | ẋ = (qd, q̈) before and after | `rate` |
//! | R | 2nv | the reset x⁺ = R(x⁻, t) | `reset`, `reset_rate` |
//! | g | 1 | the gap, m; its derivatives with respect to x and time | `gap`, `−surface.z` |
//! | Ξ | 2nv×2nv | δx⁺ = Ξ δx⁻ | `matrix` |
//!
//! ```text
//! Ξ = D_x R + (F⁺ − D_x R F⁻ − D_t R) D_x g/(D_t g + D_x g F⁻)
//! ```
//!
//! The denominator is the rate of the gap; Ξ is proportional to its inverse and unbounded towards grazing. The derivative
//! of the flow of a motion with impacts is `Φₙ Ξₙ … Φ₁ Ξ₁ Φ₀`; over one period this is the monodromy matrix. A covariance
//! Σ is mapped to `Ξ Σ Ξᵀ`.
//!
//! Source: Kong, Payne, Zhu & Johnson, *Saltation matrices: the essential tool for linearizing hybrid dynamical systems*,
//! Proc. IEEE 112 (2024) 585.

use super::derivative::{ContactRows, differentiate};
use crate::error::{SimError, require};
use crate::state::Moment;
use carom_chain::{Chain, Rows};
use carom_impact::{ImpactProblem, Law};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// The saltation matrix of an impact, for small changes of the state (q, qd), with q in its tangent space.
#[derive(Debug, Clone, PartialEq)]
pub struct Saltation {
    /// Ξ, 2nv×2nv: δx⁺ = Ξ δx⁻, both at the time of the undisturbed impact.
    pub matrix: DMatrix<f64>,
    /// Rate of the gap before the impact, m/s, negative. Ξ is of the order of its inverse, and is not valid for changes of
    /// the state that change this rate by its own size.
    pub closing: f64,
    /// Derivative of the time of the impact with respect to x⁻, 2nv, s per unit.
    pub time: DVector<f64>,
}

/// The saltation matrix of an impact of a chain: Ξ for its state (q, qd), of size 2nv×2nv.
///
/// `moment` is the state just before the impact, `contact` the contact (for a link and a plane:
/// [`PlaneContact`](crate::PlaneContact)), and `acceleration` returns q̈ in free motion; it is called for the states just
/// before and just after the impact. For a chain under gravity alone see [`Strike::saltation`](crate::Strike::saltation).
///
/// # Errors
/// [`SimError::Chain`]: an invalid state. [`SimError::Setting`]: a gap that does not close. [`SimError::Impact`]: errors of
/// the law, and a user-defined law, which has no derivative. Errors of `acceleration`.
pub fn saltation<C: ContactRows>(
    chain: &Chain,
    moment: &Moment,
    contact: &C,
    law: &dyn Law<f64, 3>,
    acceleration: impl Fn(&Moment) -> Result<DVector<f64>, SimError>,
) -> Result<Saltation, SimError> {
    let Moment { time, q, qd } = moment;
    chain.check_state(q, qd)?;
    let nv = chain.nv();
    let mut workspace = chain.workspace();
    let mut kin = workspace.update(chain, q)?;
    let (rows, surface) = (contact.rows(&kin, *time)?, contact.surface_velocity(&kin, *time));
    let velocities = DVector::from_column_slice(qd);
    let (mut forces, mut answers) = (Rows::new(nv), Rows::new(nv));
    for row in rows.row_iter() {
        forces.add().iter_mut().zip(row.iter()).for_each(|(entry, x)| *entry = *x);
    }
    kin.respond(&forces, &mut answers)?;
    let columns: Vec<Vector3<f64>> = rows.column_iter().map(Into::into).collect();
    let response: Vec<Vector3<f64>> = (0..nv).map(|i| Vector3::from_fn(|b, _| answers.row(b)[i])).collect();
    let delassus: Matrix3<f64> = columns.iter().zip(&response).map(|(j, x)| j * x.transpose()).sum();
    let law = ImpactProblem::new(delassus, &rows * &velocities - surface)?.differentiate(law)?;
    let rates = contact.rates(&kin, q, *time)?;
    let by = differentiate(&mut kin, qd, (&columns, &rates), &response, &law, |_, _| {})?;

    let impulse = law.outcome.impulse;
    let after = DVector::from_fn(nv, |i, _| qd[i] + response[i].dot(&impulse));
    let rate = |qd: &DVector<f64>| -> Result<DVector<f64>, SimError> {
        let qdd = acceleration(&Moment { time: *time, q: q.clone(), qd: qd.as_slice().to_vec() })?;
        chain.check_v("acceleration", qdd.as_slice())?;
        Ok(DVector::from_iterator(2 * nv, qd.iter().chain(qdd.iter()).copied()))
    };
    let mut reset = DMatrix::identity(2 * nv, 2 * nv);
    reset.view_mut((nv, 0), (nv, nv)).copy_from(&by.q);
    reset.view_mut((nv, nv), (nv, nv)).copy_from(&by.qd);
    let mut reset_rate = DVector::zeros(2 * nv);
    if let Some(time) = by.time {
        reset_rate.rows_mut(nv, nv).copy_from(&time);
    }
    let mut gap = DVector::zeros(2 * nv);
    gap.rows_mut(0, nv).copy_from(&rows.row(2).transpose());
    let before = rate(&velocities)?;
    let closing = gap.dot(&before) - surface.z;
    let rule = "it must be negative: the state before an impact closes the gap (at grazing there is no derivative)";
    require(closing < 0.0, "rate of the gap", closing, rule)?;
    let late = &reset * before + reset_rate - rate(&after)?;
    let time = -gap / closing;
    Ok(Saltation { matrix: reset + late * time.transpose(), closing, time })
}

//! Prepared strikes: many impacts at one point along one normal.

use crate::border::HeldStrike;
use crate::chain::{Chain, frame as frame_of};
use crate::dynamics::has_length;
use crate::error::{Fault, Status};
use crate::hit::Hit;
use crate::law::Law;
use carom_chain::FramePoint;
use carom_sim::{ChainImpact, ImpactDerivative, Impacts, JointModel};
use nalgebra::DMatrix;
use std::ffi::c_char;

/// A contact point of a chain with its normal and the joints that are locked, checked once, with the memory for impacts there. One
/// thread at a time may use it.
pub struct Strike {
    strike: HeldStrike,
    hit: ChainImpact,
}

impl Strike {
    /// The impact at one state, with the checks of the state that `Strike::resolve` of the Rust library makes.
    fn resolve(&mut self, law: &Law, q: &[f64], qd: &[f64]) -> Result<&ChainImpact, Fault> {
        let Self { strike, hit } = self;
        strike.with(|chain, strike| {
            chain.check_state(q, qd)?;
            strike.resolve_into(q, qd, &law.law, hit)
        })?;
        Ok(hit)
    }
}

/// The joints of a list of names, "all" for all of them: their names in the chain.
fn locked_joints<'c>(chain: &'c carom_chain::Chain, given: Option<&str>) -> Result<Vec<&'c str>, Fault> {
    let names = given.filter(|all| all.trim() != "all").into_iter().flat_map(|all| all.split(',')).map(str::trim);
    names.filter(|name| !name.is_empty()).map(|name| Ok(chain.joint(name)?.name.as_str())).collect()
}

/// Prepares impacts at a point of a link: checks what does not depend on the state, and allocates all memory. `frame`: the link, by
/// carom_chain_frame. `point`: the contact point in the axes of the link, from its origin, m. `normal`: the contact normal, world axes,
/// from the environment to the robot, of any length but zero. `locked`: names of joints that keep their velocities, separated by commas,
/// or "all"; NULL if all joints are free. The strike is freed by carom_strike_free.
///
/// carom_strike_resolve and carom_strike_many allocate nothing but the message of a fault; for chains with mimic joints or more than 48
/// bodies, and for contacts that are nearly singular, they do. Refused physics: a link that no (free) joint moves.
/// cbindgen:ptrs-as-arrays=[[point;3], [normal;3]]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_strike_prepare(
    chain: *const Chain,
    frame: usize,
    point: *const f64,
    normal: *const f64,
    locked: *const c_char,
    strike: *mut *mut Strike,
) -> Status {
    call!(carom_strike_prepare, |shared chain, three point, three normal, optional locked, created strike| {
        let at = FramePoint::new(frame_of(&chain.chain, frame)?, point);
        chain.chain.check_dynamics()?;
        let all = locked.is_some_and(|locked| locked.trim() == "all");
        let mut held = HeldStrike::new(
            chain.chain.clone(),
            |chain| locked_joints(chain, locked),
            |chain, names| Ok(chain.impact(&[], &[]).at(at).normal(normal).joints(joint_model(names, all)).prepare()?),
        )?;
        let mut hit = held.with(|_, strike| strike.outcome());
        // Memory that grows at the first impact grows here. That there is no impact at this pose does not matter.
        let (q, qd) = (chain.chain.zero_configuration(), vec![0.0; chain.chain.nv()]);
        let law = carom_impact::Frictionless { restitution: 0.0 };
        let _ = held.with(|_, strike| strike.resolve_into(&q, &qd, &law, &mut hit));
        strike.give(Strike { strike: held, hit });
        Ok(())
    })
}

fn joint_model<'c>(names: &'c [&'c str], all: bool) -> JointModel<'c> {
    match names {
        _ if all => JointModel::AllLocked,
        [] => JointModel::Free,
        names => JointModel::Locked(names),
    }
}

/// Frees a strike; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_strike_free(strike: *mut Strike) {
    free!(carom_strike_free, free strike);
}

/// The impact at the configuration `q` (length nq) with the joint velocities `qd` (length nv) under a law: writes the joint velocities
/// afterwards to `qd_plus` (length nv; rad/s, m/s), qd⁺ = qd + M⁻¹ Jᵀ p, and the rest to `hit`. A contact that does not approach is no
/// error: the impulse is zero, and the flag CAROM_NO_APPROACH is set. Refused physics: no joint moves the point along the normal
/// at this pose, a joint that moves no inertia, a contact that wedges; `qd_plus` and `hit` are then left as they were.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_strike_resolve(
    strike: *mut Strike,
    law: *const Law,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    qd_plus: *mut f64,
    qd_plus_length: usize,
    hit: *mut Hit,
) -> Status {
    call!(
        carom_strike_resolve,
        |exclusive strike, shared law, input q [q_length], input qd [qd_length], output qd_plus [qd_plus_length], place hit| {
            has_length("qd_plus", qd_plus, strike.hit.qd_plus.len(), "nv")?;
            let found = strike.resolve(law, q, qd)?;
            qd_plus.copy_from_slice(&found.qd_plus);
            hit.put(Hit::of_chain(found));
            Ok(())
        }
    )
}

/// The impacts at `count` states, one after another, with the digits of carom_strike_resolve. `q` is count × nq, `qd` and `qd_plus` are
/// count × nv, row by row: a row for each state; `hits` has count entries. A state that is refused does not keep the others from being
/// computed: its numbers are NaN, its carom_hit.status is the reason, and the status that is returned, with its message, is that of the
/// first such state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_strike_many(
    strike: *mut Strike,
    law: *const Law,
    count: usize,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    qd_plus: *mut f64,
    qd_plus_length: usize,
    hits: *mut Hit,
) -> Status {
    call!(
        carom_strike_many,
        |exclusive strike, shared law, input q [q_length], input qd [qd_length], output qd_plus [qd_plus_length], places hits [count]| {
            let (nq, nv) = strike.strike.with(|chain, _| (chain.nq(), chain.nv()));
            has_length("q", q, count.saturating_mul(nq), "count × nq")?;
            has_length("qd", qd, count.saturating_mul(nv), "count × nv")?;
            has_length("qd_plus", qd_plus, count.saturating_mul(nv), "count × nv")?;
            let mut first = Ok(());
            for k in 0..hits.len() {
                let after = &mut qd_plus[k * nv..][..nv];
                match strike.resolve(law, &q[k * nq..][..nq], &qd[k * nv..][..nv]) {
                    Ok(found) => {
                        after.copy_from_slice(&found.qd_plus);
                        hits.put_at(k, Hit::of_chain(found));
                    }
                    Err(Fault { status, message }) => {
                        after.fill(f64::NAN);
                        hits.put_at(k, Hit::refused(status));
                        let message = format!("state {k}: {message}");
                        first = first.and(Err(Fault { status, message }));
                    }
                }
            }
            first
        }
    )
}

/// The first derivatives of qd⁺ at a state, within the contact mode of the impact: by the configuration, `by_q`, and by the joint
/// velocities, `by_qd`, nv × nv, row by row: entry (i, k) is that of qd⁺[i]; column k of `by_q` is the derivative along the
/// motion with unit qd[k]. `by_restitution` and `by_friction` (length nv) are those by the coefficients of the law. The contact point is
/// fixed on its link, the normal in the world. Allocates. Refused physics: as carom_strike_resolve, and joints that are locked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_strike_derivative(
    strike: *mut Strike,
    law: *const Law,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
    by_q: *mut f64,
    by_q_length: usize,
    by_qd: *mut f64,
    by_qd_length: usize,
    by_restitution: *mut f64,
    by_restitution_length: usize,
    by_friction: *mut f64,
    by_friction_length: usize,
) -> Status {
    call!(
        carom_strike_derivative,
        |exclusive strike, shared law, input q [q_length], input qd [qd_length], output by_q [by_q_length], output by_qd [by_qd_length],
         output by_restitution [by_restitution_length], output by_friction [by_friction_length]| {
            let nv = strike.hit.qd_plus.len();
            has_length("by_q", by_q, nv * nv, "nv × nv")?;
            has_length("by_qd", by_qd, nv * nv, "nv × nv")?;
            has_length("by_restitution", by_restitution, nv, "nv")?;
            has_length("by_friction", by_friction, nv, "nv")?;
            let found = strike.strike.with(|chain, strike| {
                chain.check_state(q, qd)?;
                strike.derivative(q, qd, &law.law)
            });
            let ImpactDerivative { q, qd, restitution, friction, .. } = found?;
            by_rows(&q, by_q);
            by_rows(&qd, by_qd);
            by_restitution.copy_from_slice(restitution.as_slice());
            by_friction.copy_from_slice(friction.as_slice());
            Ok(())
        }
    )
}

/// Copies a matrix row by row.
fn by_rows(matrix: &DMatrix<f64>, out: &mut [f64]) {
    let columns = matrix.ncols();
    out.iter_mut().enumerate().for_each(|(k, x)| *x = matrix[(k / columns, k % columns)]);
}

//! Motion with the motors off, between impacts.

use crate::error::SimError;
use crate::trajectory::Moment;
use carom_chain::{Chain, ChainError, Coordinates};
use ivp::prelude::{FirstOrderSystem, Ivp, Method};
use nalgebra::Vector3;
use std::cell::RefCell;

/// Motions that need more steps than this are refused.
const MAX_STEPS: usize = 1_000_000;

/// The free motion M q̈ + C q̇ + g = 0 (no damping, no dry friction) from `(q, qd)` at time 0 to `end` seconds (negative: back in time), sampled at
/// `samples` ≥ 2 equal steps, both ends included. Dormand–Prince 8(5,3), relative tolerance 1e-12.
///
/// # Errors
/// [`SimError::Chain`]: a state that does not fit, a floating joint (whose q̇ is not qd), too few samples; or an
/// integration that fails or needs over a million steps.
pub fn free_motion(
    chain: &Chain,
    q: &[f64],
    qd: &[f64],
    gravity: Vector3<f64>,
    end: f64,
    samples: usize,
) -> Result<Vec<Moment>, SimError> {
    chain.check_state(q, qd)?;
    let floats = |c: &Coordinates| matches!(c, Coordinates::Own { q, v } if q.len() != v.len());
    if let Some(joint) = chain.joints().iter().find(|j| floats(&j.coordinates)) {
        let why = format!("joint '{}' floats: free motion is for joints with q̇ = qd", joint.name);
        return Err(ChainError::NotReducible(why).into());
    }
    if samples < 2 {
        let rule = "both ends are sampled, so it is 2 or more";
        return Err(SimError::Setting { what: "number of samples", value: samples as f64, rule });
    }
    if !end.is_finite() || end == 0.0 {
        return Err(SimError::Setting { what: "end of the motion", value: end, rule: "it must be finite and not 0 s" });
    }
    let free = Free { chain, gravity, workspace: RefCell::new(chain.workspace()), failed: RefCell::new(None) };
    let start: Vec<f64> = q.iter().chain(qd).copied().collect();
    let times: Vec<f64> = (0..samples).map(|k| end * k as f64 / (samples - 1) as f64).collect();
    let solution = Ivp::first_order(&free, 0.0, end, &start)
        .method(Method::DOP853)
        .rtol(1e-12)
        .atol(1e-14)
        .max_steps(MAX_STEPS)
        .t_eval(times)
        .solve()
        .map_err(|e| SimError::Integration { time: 0.0, reason: format!("{e:?}") })?;
    if let Some(error) = free.failed.into_inner() {
        return Err(error.into());
    }
    if !solution.status.is_success() || solution.t.len() != samples {
        let reason = format!("{:?} after {} steps", solution.status, solution.nstep);
        return Err(SimError::Integration { time: 0.0, reason });
    }
    let sample = |(time, state): (f64, &[f64])| {
        let (q, qd) = state.split_at(chain.nq());
        Moment { time, q: q.to_vec(), qd: qd.to_vec() }
    };
    Ok(solution.iter().map(|(t, y)| sample((t, y))).collect())
}

struct Free<'a> {
    chain: &'a Chain,
    gravity: Vector3<f64>,
    workspace: RefCell<carom_chain::Workspace<carom_chain::Spatial<f64>>>,
    failed: RefCell<Option<ChainError>>,
}

impl FirstOrderSystem for Free<'_> {
    fn derivative(&self, _: f64, state: &[f64], rate: &mut [f64]) {
        let (q, qd) = state.split_at(self.chain.nq());
        let tau = vec![0.0; qd.len()];
        let mut workspace = self.workspace.borrow_mut();
        let qdd = workspace.update(self.chain, q).and_then(|mut kin| kin.forward_dynamics(qd, &tau, self.gravity));
        match qdd {
            Ok(qdd) => {
                rate[..qd.len()].copy_from_slice(qd);
                rate[qd.len()..].copy_from_slice(qdd.as_slice());
            }
            Err(error) => {
                rate.fill(0.0);
                *self.failed.borrow_mut() = Some(error);
            }
        }
    }
}

//! Free motion of a chain: motors off, no contacts.

use crate::error::{SimError, ended};
use crate::state::{MAX_STEPS, Moment};
use carom_chain::{Chain, ChainError};
use ivp::prelude::{FirstOrderSystem, Ivp, Method};
use nalgebra::Vector3;
use std::cell::RefCell;

/// The free motion M q̈ + C q̇ + g = 0, without damping, dry friction and contacts, from `(q, qd)` at time 0 to `end` seconds
/// (negative: back in time). Returns `samples` ≥ 2 moments at equal intervals, both ends included. `gravity` is in world
/// axes, m/s². Integrated by Dormand–Prince 8(5,3) with a relative tolerance of 1e-12.
///
/// # Errors
/// [`SimError::Chain`]: a state of wrong length or with numbers that are not finite. [`SimError::Setting`]: fewer than 2
/// samples, or an `end` that is 0 or not finite. [`SimError::Integration`]: the integrator failed or needs over ten million steps.
pub fn free_motion(
    chain: &Chain,
    q: &[f64],
    qd: &[f64],
    gravity: Vector3<f64>,
    end: f64,
    samples: usize,
) -> Result<Vec<Moment>, SimError> {
    chain.check_state(q, qd)?;
    if samples < 2 {
        let rule = "it must be 2 or more, as both ends are sampled";
        return Err(SimError::Setting { what: "number of samples", value: samples as f64, rule });
    }
    if !end.is_finite() || end == 0.0 {
        return Err(SimError::Setting { what: "end of the motion", value: end, rule: "it must be finite and not 0 s" });
    }
    let times: Vec<f64> = (0..samples).map(|k| end * k as f64 / (samples - 1) as f64).collect();
    free_motion_at(chain, q, qd, gravity, &times)
}

/// The free motion as in [`free_motion`], sampled at given times, s. All times have the same sign (the first may be 0), and
/// their absolute values increase.
///
/// # Errors
/// As [`free_motion`]; [`SimError::Setting`] for times that break this rule.
pub fn free_motion_at(
    chain: &Chain,
    q: &[f64],
    qd: &[f64],
    gravity: Vector3<f64>,
    times: &[f64],
) -> Result<Vec<Moment>, SimError> {
    chain.check_state(q, qd)?;
    let end = times.last().copied().unwrap_or_default();
    let mut last = 0.0;
    for (k, &time) in times.iter().enumerate() {
        let further = time.is_finite() && time * end >= 0.0 && (time.abs() > f64::abs(last) || (k == 0 && time == 0.0));
        if !further {
            let rule = "the times must be finite, have the same sign and increase in absolute value";
            return Err(SimError::Setting { what: "time of a sample", value: time, rule });
        }
        last = time;
    }
    let start: Vec<f64> = q.iter().chain(qd).copied().collect();
    if end == 0.0 {
        return Ok(times.iter().map(|&time| Moment { time, q: q.to_vec(), qd: qd.to_vec() }).collect());
    }
    let free = Free { chain, gravity, workspace: RefCell::new(chain.workspace()), failed: RefCell::new(None) };
    let solution = Ivp::first_order(&free, 0.0, end, &start)
        .method(Method::DOP853)
        .rtol(1e-12)
        .atol(1e-14)
        .max_steps(MAX_STEPS)
        .t_eval(times.to_vec())
        .solve()
        .map_err(|e| SimError::Integration { time: 0.0, reason: format!("{e:?}") })?;
    if let Some(error) = free.failed.into_inner() {
        return Err(error.into());
    }
    if !solution.status.is_success() || solution.t.len() != times.len() {
        let reason = ended(solution.status).into();
        return Err(SimError::Integration { time: 0.0, reason });
    }
    let still = vec![0.0; chain.nv()];
    let sample = |(time, state): (f64, &[f64])| {
        let (q, qd) = state.split_at(chain.nq());
        // A step of length zero normalises the quaternions.
        Ok(Moment { time, q: chain.integrate(q, &still, 0.0)?, qd: qd.to_vec() })
    };
    solution.iter().map(|(t, y)| sample((t, y))).collect()
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
                self.chain.q_rate_into(q, qd, &mut rate[..q.len()]);
                rate[q.len()..].copy_from_slice(qdd.as_slice());
            }
            Err(error) => {
                rate.fill(0.0);
                *self.failed.borrow_mut() = Some(error);
            }
        }
    }
}

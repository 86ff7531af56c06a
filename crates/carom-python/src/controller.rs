//! Controllers written in Python.

use crate::array::list;
use crate::callable::Callable;
use carom_chain::Coordinates;
use carom_sim::{Controller, Drive, Moment, Observed, Plan, Sampling, Seen, SimError, StopReason, Summary};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Arc;

/// A function of time, q and qd that returns joint forces.
#[derive(Clone)]
pub struct PythonController(Arc<Own>);

struct Own {
    function: Callable,
    name: String,
    /// Calls per second; `None`: whenever the integrator needs the forces.
    rate: Option<f64>,
}

impl PythonController {
    /// # Errors
    /// `TypeError` for what cannot be called, `ValueError` for a rate that is not positive.
    pub fn new(function: &Bound<'_, PyAny>, rate: Option<f64>) -> PyResult<Self> {
        if let Some(rate) = rate.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            let message = format!("rate is {rate}: it must be positive and finite, in calls per second");
            return Err(PyValueError::new_err(message));
        }
        let (function, name) = Callable::new(function, "time, q and qd")?;
        Ok(Self(Arc::new(Own { function, name, rate })))
    }

    /// The drive of a scene.
    pub fn drive(&self) -> Drive {
        Drive::user(self.clone())
    }

    /// Calls per second, if the controller samples.
    pub fn rate(&self) -> Option<f64> {
        self.0.rate
    }

    /// The function.
    pub fn function<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.0.function.function(py)
    }

    /// Takes the exception that the function has raised last.
    pub fn raised(&self) -> Option<PyErr> {
        self.0.function.raised()
    }

    /// Runs a plan with this controller: called at `rate`, its forces are constant between the calls.
    pub fn run(
        &self,
        (plan, rate): (&Plan, f64),
        duration: f64,
        sampling: Sampling,
        watch: &mut dyn FnMut(Seen),
    ) -> Result<Summary, SimError> {
        let mut plan = plan.clone();
        let chain = plan.simulation.chain.clone();
        let gravity = plan.simulation.gravity;
        let forces = |time: f64, q: &[f64], qd: &[f64]| {
            let mut forces = vec![0.0; qd.len()];
            self.forces(&Observed { chain: &chain, time, q, qd, gravity, hit: false }, &mut forces)?;
            // As for a controller that is not sampled: no motor drives a floating or planar joint.
            for joint in chain.joints() {
                if let Coordinates::Own { v, .. } = &joint.coordinates
                    && v.len() > 1
                {
                    forces[v.clone()].fill(0.0);
                }
            }
            Ok::<_, SimError>(forces)
        };
        let start = plan.simulation.start_time;
        plan.simulation.drive = Drive::Constant(forces(start, &plan.q, &plan.qd)?);
        let mut session = plan.start()?;
        let mut calls = 0.0;
        loop {
            calls += 1.0;
            let share = duration.min(calls / rate);
            let stop = session.stream(start + share - session.time(), sampling, watch)?;
            if share >= duration || stop == StopReason::Events {
                return session.summary(stop);
            }
            let Moment { time, q, qd } = session.moment();
            session.set_forces(&forces(time, &q, &qd)?)?;
        }
    }
}

impl Controller for PythonController {
    fn name(&self) -> &str {
        &self.0.name
    }

    fn forces(&self, now: &Observed, forces: &mut [f64]) -> Result<(), SimError> {
        let arguments = |py: Python<'_>| {
            let array = |numbers: &[f64]| Ok::<_, PyErr>(list(py, numbers)?.unbind());
            Ok((now.time, array(now.q)?, array(now.qd)?))
        };
        let fail = |reason| SimError::UsersController { controller: self.0.name.clone(), reason };
        self.0.function.call("the result of the controller", arguments, forces).map_err(fail)?;
        match forces.iter().position(|force| !force.is_finite()) {
            Some(k) => {
                Err(fail(format!("at {} s its force {k} is {}: every force must be finite", now.time, forces[k])))
            }
            None => Ok(()),
        }
    }
}

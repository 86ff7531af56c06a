//! The vector field of one contact mode with its guards, and its form for the integrator.

use super::guard::GuardValue;
use super::sampler::Told;
use crate::error::SimError;
use crate::state::NONE;
use ivp::ivp::FirstOrderSystem;
use ivp::matrix::Matrix;
use std::cell::RefCell;

/// A smooth vector field with guards: one contact mode of one chain.
pub(crate) trait Flow {
    /// ẏ at (t, y).
    fn rate(&mut self, t: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError>;
    /// The step of each component of y for difference quotients of the rate.
    fn steps(&mut self, t: f64, y: &[f64], out: &mut [f64]) -> Result<(), SimError>;
    /// The unit of each number of a state of this length, of which its absolute error is a share.
    fn units(&self, state: usize) -> Vec<f64> {
        vec![1.0; state]
    }
    /// The guards at (t, y), each with its rate in time if a minimum within a step is to be detected.
    fn guards(&mut self, t: f64, y: &[f64], out: &mut Vec<GuardValue>) -> Result<(), SimError>;
    /// GuardValue `k` at (t, y).
    fn guard(&mut self, k: usize, t: f64, y: &[f64]) -> Result<GuardValue, SimError>;
    /// Whether bodies touch at some of their parts.
    fn touches(&self) -> bool {
        false
    }
    /// By how much such bodies are separated beyond what counts as an overlap, m, and the angular speed with which they turn relative to
    /// each other, rad/s.
    fn separated(&mut self, _: f64, _: &[f64]) -> Result<[f64; 2], SimError> {
        Ok([f64::INFINITY, 0.0])
    }
    /// The gap of parts of such bodies that has closed last, where they have begun to overlap.
    fn closed_last(&mut self, _: f64, _: &[f64]) -> Result<Option<usize>, SimError> {
        Ok(None)
    }
    /// What is output at (t, y), with the forces of the motors or without.
    fn told(&mut self, t: f64, y: &[f64], motors: bool) -> Result<Told, SimError>;
    /// Closes the loops at a state between two steps.
    fn close(&mut self, y: &mut [f64]) -> Result<(), SimError>;
    /// The shares of a step, between these states and of this length, at which it is divided for derivatives; the last is 1.
    fn pieces(&mut self, _: [(f64, &[f64]); 2]) -> Result<Vec<f64>, SimError> {
        Ok(vec![1.0])
    }
    /// Projects a state that drifted off its constraint back onto it; returns whether it changed the state.
    fn settle(&mut self, t: f64, y: &mut [f64]) -> Result<bool, SimError>;
}

/// The flow for the integrator. Errors are stored here, as the integrator cannot return them.
pub(crate) struct System<'a>(pub RefCell<Inner<'a>>);

pub(crate) struct Inner<'a> {
    pub flow: &'a mut dyn Flow,
    pub error: Option<SimError>,
}

impl<'a> System<'a> {
    pub fn new(flow: &'a mut dyn Flow) -> Self {
        Self(RefCell::new(Inner { flow, error: None }))
    }

    pub fn ask<T: Default>(&self, question: impl FnOnce(&mut dyn Flow) -> Result<T, SimError>) -> T {
        let inner = &mut *self.0.borrow_mut();
        question(inner.flow).unwrap_or_else(|error| {
            inner.error.get_or_insert(error);
            T::default()
        })
    }

    /// The state after a short time, by the midpoint rule.
    pub fn midpoint(&self, (time, y): (f64, &[f64]), span: f64) -> Result<Vec<f64>, SimError> {
        let mut rate = vec![0.0; y.len()];
        let moved = |rate: &[f64], span: f64| y.iter().zip(rate).map(|(y, rate)| y + rate * span).collect::<Vec<_>>();
        self.derivative(time, y, &mut rate);
        let middle = moved(&rate, span / 2.0);
        self.derivative(time + span / 2.0, &middle, &mut rate);
        self.0.borrow_mut().error.take().map_or_else(|| Ok(moved(&rate, span)), Err)
    }
}

impl FirstOrderSystem for System<'_> {
    fn derivative(&self, t: f64, y: &[f64], rate: &mut [f64]) {
        rate.fill(0.0);
        self.ask(|flow| flow.rate(t, y, rate));
        rate.iter_mut().filter(|rate| rate.abs() < NONE).for_each(|rate| *rate = 0.0);
    }

    /// By forward differences with the steps of the flow, zero where a step is zero: where slip begins, the rate changes by its own size with a velocity
    /// far below that for which ivp's own differences are made.
    fn jac(&self, t: f64, y: &[f64], jacobian: &mut Matrix) {
        let mut steps = vec![0.0; y.len()];
        self.ask(|flow| flow.steps(t, y, &mut steps));
        let (mut moved, mut here, mut there) = (y.to_vec(), vec![0.0; y.len()], vec![0.0; y.len()]);
        self.derivative(t, y, &mut here);
        for (column, step) in steps.iter().enumerate() {
            moved[column] += step;
            // The step as the numbers have it.
            let whole = moved[column] - y[column];
            if whole > 0.0 {
                self.derivative(t, &moved, &mut there);
            }
            moved[column] = y[column];
            for (row, (there, here)) in there.iter().zip(&here).enumerate() {
                jacobian[(row, column)] = if whole > 0.0 { (there - here) / whole } else { 0.0 };
            }
        }
    }
}

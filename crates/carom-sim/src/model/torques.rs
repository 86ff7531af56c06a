//! Joint forces without feedback: none, constant ones, those of a table, and those that balance gravity.

use super::control_law::{Add, Asked, Body, ControlLaw, Driven, Number, Part, State};
use super::gains::Motor;
use crate::error::SimError;
use crate::state::{Space, View, between, check_rows, next_of};

/// Motors off.
pub(super) struct Off;

/// The joint forces that balance gravity.
pub(super) struct GravityCompensation;

/// Joint forces at given times, interpolated linearly, constant before the first and after the last time.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueTable {
    /// Ascending times, s. A time that is given twice is a jump.
    pub times: Vec<f64>,
    /// Joint forces at each time, length nv; N m or N.
    pub forces: Vec<Vec<f64>>,
}

impl TorqueTable {
    /// Whether its forces are the same at all times.
    pub(crate) fn is_steady(&self) -> bool {
        self.forces.windows(2).all(|pair| pair[0] == pair[1])
    }
}

impl ControlLaw for Off {
    fn is_decoupled(&self) -> bool {
        true
    }

    fn drive<A: Space>(&self, _: &Asked, _: Body<A>, _: State, _: Add) -> Result<(), SimError> {
        Ok(())
    }
}

/// Constant joint forces.
impl ControlLaw for Vec<f64> {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        vec![("torque", Part::V(self))]
    }

    fn is_decoupled(&self) -> bool {
        true
    }

    fn force_by(&self, _: Number, _: &Motor, _: &Asked, _: State) -> f64 {
        1.0
    }

    fn drive<A: Space>(&self, _: &Asked, _: Body<A>, _: State, add: Add) -> Result<(), SimError> {
        self.iter().enumerate().for_each(|(i, force)| add(i, *force));
        Ok(())
    }
}

impl ControlLaw for TorqueTable {
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        self.forces.iter_mut().map(|row| ("torque", Part::V(row))).collect()
    }

    fn check(&self, _: &Driven) -> Result<(), SimError> {
        let Self { times, forces } = self;
        let names = ["number of rows of the torque table", "number in the torque table", "time in the torque table"];
        check_rows(names, times, forces)
    }

    fn is_decoupled(&self) -> bool {
        true
    }

    fn force_by(&self, number: Number, _: &Motor, asked: &Asked, _: State) -> f64 {
        let (before, after, share) = between(&self.times, asked.time);
        match number.row {
            Some(row) if row == before => 1.0 - share,
            Some(row) if row == after => share,
            Some(_) => 0.0,
            None => 1.0,
        }
    }

    fn span(&self, row: usize) -> [f64; 2] {
        let first = row.checked_sub(1).map_or(f64::NEG_INFINITY, |before| self.times[before]);
        [first, self.times.get(row + 1).copied().unwrap_or(f64::INFINITY)]
    }

    fn next_kink(&self, time: f64) -> Option<f64> {
        next_of(&self.times, time)
    }

    fn drive<A: Space>(&self, asked: &Asked, _: Body<A>, (_, qd): State, add: Add) -> Result<(), SimError> {
        let (before, after, share) = between(&self.times, asked.time);
        let (before, after) = (&self.forces[before], &self.forces[after]);
        (0..qd.len()).for_each(|i| add(i, before[i] + (after[i] - before[i]) * share));
        Ok(())
    }
}

impl ControlLaw for GravityCompensation {
    fn drive<A: Space>(
        &self,
        asked: &Asked,
        (model, workspace): Body<A>,
        (q, _): State,
        add: Add,
    ) -> Result<(), SimError> {
        let forces = View::<A>::new(model, workspace, q)?.gravity_force(asked.gravity);
        asked.motors.iter().for_each(|motor| add(motor.v, forces[motor.v]));
        Ok(())
    }
}

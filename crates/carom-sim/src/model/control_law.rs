//! What a controller has to say. Each is a type with [`ControlLaw`] in a file of its own, and a row of [`Drive`](super::Drive), which
//! has what can be said in a word.

use super::gains::{Gains, Motor};
use super::spring::SpringAt;
use crate::error::SimError;
use crate::state::Space;
use carom_chain::{Chain, Workspace};
use nalgebra::Vector3;
use std::ops::Range;

/// The chain in the plane or in space, and its scratch memory.
pub(crate) type Body<'a, A> = (&'a <A as Space>::Model, &'a mut Workspace<A>);
/// q and qd.
pub(crate) type State<'a> = (&'a [f64], &'a [f64]);
/// Takes joint forces by number of qd.
pub(crate) type Add<'a> = &'a mut dyn FnMut(usize, f64);

/// A controller of a [`Drive`](super::Drive). The defaults are those of a controller without gains and kinks.
pub(crate) trait ControlLaw {
    /// What in it depends on the chain, each with its name in messages.
    fn parts(&mut self) -> Vec<(&'static str, Part<'_>)> {
        Vec::new()
    }

    /// Checks that it fits a robot, beside its [`Self::parts`].
    ///
    /// # Errors
    /// [`SimError`] with the rule that is broken.
    fn check(&self, _robot: &Driven) -> Result<(), SimError> {
        Ok(())
    }

    /// Stiffness and damping of a joint with one coordinate, by its number of qd.
    fn gains(&self, _v: usize) -> (f64, f64) {
        (0.0, 0.0)
    }

    /// Whether the force at each joint depends on the state only by its gains.
    fn is_decoupled(&self) -> bool {
        false
    }

    /// The derivative of the force at a joint by its number, of [`Drive::parameters`](super::Drive).
    fn force_by(&self, _number: Number, _joint: &Motor, _asked: &Asked, _state: State) -> f64 {
        0.0
    }

    /// The first and the last time at which a row of its table over time acts.
    fn span(&self, _row: usize) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }

    /// The next time at which the forces have a kink.
    fn next_kink(&self, _time: f64) -> Option<f64> {
        None
    }

    /// Passes the joint forces to `add`, by number of qd; several for one number add up.
    fn drive<A: Space>(&self, asked: &Asked, body: Body<A>, state: State, add: Add) -> Result<(), SimError>
    where
        Self: Sized;
}

/// The inputs of a drive beside the state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub chain: &'a Chain,
    pub time: f64,
    pub gravity: Vector3<f64>,
    /// For each number of qd whether an impact has hit its robot.
    pub hit: &'a [bool],
    /// Impacts so far, by touch.
    pub impacts: &'a [usize],
    /// The joints that motors can drive.
    pub motors: &'a [Motor],
    /// Largest force of each number of qd; empty: no limits.
    pub limits: &'a [f64],
    /// Damping of each number of qd, and springs: the passive joint forces.
    pub damping: &'a [f64],
    pub springs: &'a [SpringAt],
}

impl Asked<'_> {
    /// Whether an impact has hit the robot, or one of several robots with one drive.
    pub fn was_hit(&self) -> bool {
        self.hit.contains(&true)
    }
}

/// A number of a controller at a joint by which a run can be differentiated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Number {
    pub name: &'static str,
    /// Its row, in a table over time.
    pub row: Option<usize>,
}

/// A part of a controller that depends on the chain.
pub(crate) enum Part<'a> {
    /// Numbers of q.
    Q(&'a mut Vec<f64>),
    /// Numbers of qd.
    V(&'a mut Vec<f64>),
    /// Gains.
    Gains(&'a mut Gains),
    /// The name of a link.
    Link(&'a mut String),
}

/// A robot that is driven.
pub(crate) struct Driven<'a> {
    /// The chain, of one robot or of several.
    pub chain: &'a Chain,
    /// Its joints that motors can drive.
    pub motors: &'a [Motor],
    /// Its entries of qd.
    pub v: Range<usize>,
}

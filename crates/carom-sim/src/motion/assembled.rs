//! The constraints of one state, the response of the chain to them, and the forces that follow.

use super::rows::Constraints;
use crate::error::SimError;
use crate::state::{Space, View};
use carom_chain::Rows;
use nalgebra::{DMatrix, DVector, Vector3};

/// Accelerations and constraint forces at one state.
#[derive(Debug, Clone, Default)]
pub(crate) struct ConstraintForces {
    pub qdd: DVector<f64>,
    /// The forces of the lasting contacts, in their order.
    pub contacts: Vec<Force>,
    /// Constraint forces of the joints that dry friction holds, in the order of `dry`; 0 for the others. Of joints that are locked they,
    /// and the forces of the limits, are computed by [`Motion::in_mode`](super::Motion::in_mode) only.
    pub joints: Vec<f64>,
    /// Power of the drive, and of all dissipative forces.
    pub power: [f64; 2],
}

/// The force of one contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Force {
    /// On the robot, world, N; zero for a joint limit.
    pub force: Vector3<f64>,
    pub normal: Vector3<f64>,
    /// Its normal component, or the force of a joint limit; it must not be negative.
    pub normal_force: f64,
    /// Rate of the bristle's deflection, world, m/s.
    pub bends: Vector3<f64>,
}

impl Force {
    /// μ λ_n − |λ_t|, N: positive inside the friction cone.
    pub fn cone(&self, friction: f64) -> f64 {
        friction * self.normal_force - (self.force - self.normal * self.normal_force).norm()
    }
}

/// The constraints of one state and the response of the chain to them: scratch memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct Assembled {
    pub constraints: Constraints,
    /// M⁻¹Fᵀ.
    pub responses: Rows,
    /// M⁻¹Rᵀ, where F ≠ R; none if they were not asked for.
    pub own_responses: Rows,
    /// M⁻¹Tᵀ.
    pub tangent_responses: Rows,
    pub free: DVector<f64>,
    /// Inertia added to each coordinate: ∞ for joints that are locked; empty if none is.
    pub locked: Vec<f64>,
    /// λ.
    pub lambda: DVector<f64>,
    /// Powers of the drive, and of damping, slipping dry friction and compliant contacts.
    pub power: [f64; 2],
    /// Forces of the compliant contacts.
    pub pressed: Vec<Force>,
    /// Joint forces.
    pub tau: Vec<f64>,
    pub scratch: Vec<f64>,
    /// All rows one after another, and their responses.
    stacked: Rows,
    answers: Rows,
}

impl Assembled {
    pub fn new(nv: usize) -> Self {
        Self {
            constraints: Constraints::new(nv),
            responses: Rows::new(nv),
            own_responses: Rows::new(nv),
            tangent_responses: Rows::new(nv),
            free: DVector::zeros(nv),
            tau: vec![0.0; nv],
            scratch: vec![0.0; nv],
            stacked: Rows::new(nv),
            answers: Rows::new(nv),
            ..Self::default()
        }
    }

    /// The acceleration without constraint forces, and the responses of all rows, by one factorisation of M. `own`: whether those of
    /// the rows R are needed where F ≠ R.
    pub fn respond<A: Space>(
        &mut self,
        view: &mut View<A>,
        (qd, gravity): (&[f64], Vector3<f64>),
        own: bool,
    ) -> Result<(), SimError> {
        let Self { constraints, free, tau, locked, stacked, answers, .. } = self;
        let Constraints { rows, forces, tangents, skewed, starts, .. } = constraints;
        let dynamics = (qd, tau.as_slice(), gravity);
        if skewed.is_empty() || (starts.is_empty() && (!own || rows.len() == 1)) {
            self.own_responses.clear();
            return view.accelerate_and_respond(dynamics, locked, free.as_mut_slice(), forces, &mut self.responses);
        }
        stacked.clear();
        // The other rows of R are those of F, with the same responses.
        let own = skewed.iter().map(|&i| rows.row(i));
        for row in forces.iter().chain(own).chain(tangents.iter()) {
            stacked.add().copy_from_slice(row);
        }
        view.accelerate_and_respond(dynamics, locked, free.as_mut_slice(), stacked, answers)?;
        self.tangent_responses = answers.split_off(forces.len() + skewed.len());
        let own = answers.split_off(forces.len());
        self.responses.clone_from(answers);
        self.own_responses.clone_from(answers);
        for (&i, own) in skewed.iter().zip(own.iter()) {
            self.own_responses.iter_mut().nth(i).into_iter().for_each(|response| response.copy_from_slice(own));
        }
        Ok(())
    }

    /// K.
    pub fn delassus(&self) -> DMatrix<f64> {
        self.constraints.rows.times(&self.responses)
    }

    /// R M⁻¹Rᵀ; where F ≠ R, with the responses of the rows R.
    pub fn gram(&self) -> DMatrix<f64> {
        self.constraints.rows.times(self.own())
    }

    /// M⁻¹Rᵀ, if it was asked for.
    pub fn own(&self) -> &Rows {
        if self.own_responses.is_empty() { &self.responses } else { &self.own_responses }
    }

    /// The size of the accelerations along the rows: of the terms that cancel where a contact is about to open.
    pub fn largest(&self) -> f64 {
        let Self { constraints, free, .. } = self;
        let rows = constraints.rows.iter().zip(&constraints.drifts);
        let terms = |row: &[f64]| row.iter().zip(free.iter()).map(|(r, a)| (r * a).abs()).sum::<f64>();
        rows.map(|(row, drift)| terms(row) + drift.abs()).fold(0.0, f64::max)
    }

    /// The sum of the sizes of the terms of Kᵢᵢ, of which its rounding is a share.
    pub fn terms(&self, i: usize) -> f64 {
        self.constraints.rows.row(i).iter().zip(self.responses.row(i)).map(|(r, x)| (r * x).abs()).sum()
    }

    /// R q̈₀ + drift.
    pub fn offset(&self) -> DVector<f64> {
        let Self { constraints, free, .. } = self;
        DVector::from_fn(constraints.rows.len(), |i, _| {
            constraints.rows.dot(i, free.as_slice()) + constraints.drifts[i]
        })
    }
}
